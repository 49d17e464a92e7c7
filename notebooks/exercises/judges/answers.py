"""An answer as the judges see it: a function that runs in a process of its own, with the cases only."""

from __future__ import annotations

import base64
import json
import os
import pickle
import secrets
import struct
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any

import cloudpickle  # type: ignore[import-untyped]
import numpy as np

from .process import Process

_PROGRAM = Path(__file__).with_name("answer_program.py")
_STARTING = 120.0  # time that Python and its packages may take to start [s]
_programs: dict[tuple[str, ...], Process] = {}  # that wait for an answer, by the modules that they hold


class Refusal(Exception):
    """An answer that is wrong for a reason other than its numbers."""


class Failure(Exception):
    """An answer that stopped with an exception; the text says with which."""


@dataclass(frozen=True)
class Other:
    """A result that is no number, text or ellipse: only the name of its type is known."""

    kind: str
    is_uneven: bool = False


def pack(answer: Callable[..., Any]) -> dict[str, str]:
    """The code of a function, with what it uses, as text that JSON can hold.

    Raises
    ------
    Refusal : the function uses something that no other process can have.
    """
    module = sys.modules.get(getattr(answer, "__module__", ""))
    is_own = module is not None and module.__name__.partition(".")[0] not in (
        "szlib",
        "judges",
        "__main__",
    )
    by_value = is_own and "site-packages" not in (getattr(module, "__file__", "") or "site-packages")
    if by_value:
        cloudpickle.register_pickle_by_value(module)
    try:
        return {"pickle": base64.b64encode(cloudpickle.dumps(answer)).decode()}
    except Exception as error:
        raise Refusal(
            f"your function uses something of the notebook that cannot leave it: {error}"
        ) from error
    finally:
        if by_value:
            cloudpickle.unregister_pickle_by_value(module)


class Answer:
    """The function of a packed answer, in a process that is forked for it.

    Parameters
    ----------
    packed : from `pack`, or {"source": text, "name": name of the function}.
    modules : modules of szlib that the answer may use.
    seconds : time for all calls together [s]; the judge's own work between them does not count.
    """

    def __init__(self, packed: dict[str, str], modules: tuple[str, ...], seconds: float) -> None:
        self._modules, self._seconds = modules, seconds
        self._mark, self._packed = secrets.token_hex(8), packed
        self._left = seconds  # for the calls to come [s]
        self._program: Process | None = None
        self._last_line, self._has_ended = f"end {self._mark}\n".encode(), False

    def __enter__(self) -> Answer:
        program = _programs.pop(self._modules, None)
        if program is None or program.code is not None:
            path = str(Path(__file__).resolve().parents[3])
            program = Process(["-I", str(_PROGRAM), path, *self._modules])
            if program.receive(monotonic() + _STARTING) != b"ready\n":
                program.end()
                raise RuntimeError(f"{_PROGRAM} does not start; run it by hand to see why")
        self._program = program
        first = {"mark": self._mark, "seconds": self._seconds, **self._packed}
        self._send(first, monotonic() + self._seconds)
        return self

    def __exit__(self, *_: object) -> None:
        if self._program is None:
            return
        late = monotonic() + 2.0
        if not self._has_ended:
            self._send(None, late)
        while not self._has_ended and (line := self._program.receive(late)):
            self._has_ended = line == self._last_line
        if self._has_ended and hasattr(os, "fork"):
            _programs[self._modules] = self._program
        else:
            self._program.end()
        self._program = None

    def _send(self, value: Any, deadline: float) -> None:
        data = pickle.dumps(value)
        if self._program is not None:
            self._program.send(struct.pack(">Q", len(data)) + data, deadline + 1.0)

    def __call__(self, *arguments: Any) -> Any:
        """The result of the function for these arguments."""
        if self._program is None:
            raise RuntimeError("an Answer is used in a `with` statement")
        if self._has_ended:
            raise Refusal("your function ended its process")
        start = monotonic()
        try:
            return self._ask(self._program, arguments, start + self._left)
        finally:
            self._left -= monotonic() - start

    def _ask(self, program: Process, arguments: tuple[Any, ...], deadline: float) -> Any:
        self._send(arguments, deadline)
        while True:
            line = program.receive(deadline)
            if line is None:
                raise Refusal(f"your function is too slow: the check ends after {self._seconds:g} s")
            self._has_ended = line == self._last_line
            if not line or self._has_ended:
                raise Refusal("your function ended its process, or took more time or memory than it may")
            found = _read(line)
            if found.get("mark") == self._mark:
                return _decode(found)


def end_programs() -> None:
    """End the programs that wait for answers."""
    while _programs:
        _programs.popitem()[1].end()


def _read(line: bytes) -> dict[str, Any]:
    """The line as a dictionary; an empty one if it is no line of the program."""
    try:
        found = json.loads(line)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _decode(found: dict[str, Any]) -> Any:
    from szlib.zones.ellipses import Ellipse

    from .qp import Infeasible

    match found:
        case {"refused": str(text)}:
            raise Refusal(text)
        case {"error": "NotImplementedError", "text": text}:
            raise NotImplementedError(text)
        case {"error": "Infeasible", "text": text}:
            raise Infeasible(text)
        case {"error": str(kind), "text": text}:
            raise Failure(f"your function stopped with {kind}: {text}")
        case {"text": str(text)}:
            return text
        case {"ellipse": [center, axes, angle]}:
            return Ellipse(center, axes, angle)
        case {"numbers": numbers, "kind": kind, "shape": shape}:
            array = np.array(numbers, dtype={"b": bool, "f": float}.get(kind, int)).reshape(shape)
            return array if shape else array.item()
        case {"type": str(kind)}:
            return Other(kind, is_uneven=bool(found.get("is_uneven")))
    return None

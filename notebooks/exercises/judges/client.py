"""Check an answer from a notebook: the judges are a program of their own, which the notebook cannot change."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Any

from szlib.core.errors import DataError, SzlibError

from .answers import Refusal, pack
from .process import Process

_LONGEST = 600.0  # of a check, with the start of the judges [s]
_programs: list[Process] = []  # the judges, once they are started


@dataclass(frozen=True)
class Verdict:
    """The result of a check.

    Attributes
    ----------
    task : name of the task.
    passed : True if the answer is correct in every case.
    message : what is correct or wrong.
    """

    task: str
    passed: bool
    message: str

    def __repr__(self) -> str:
        return f"{'passed' if self.passed else 'not yet'} - {self.task}: {self.message}"

    def require(self) -> None:
        """Raise SzlibError with the message if the answer did not pass; graders count errors."""
        if not self.passed:
            raise SzlibError(repr(self))


def check(name: str, answer: Callable[..., Any], *, seed: int | None = None) -> Verdict:
    """Check an answer, and say what is correct or wrong.

    Parameters
    ----------
    name : name of the task.
    answer : the function itself, not its result.
    seed : seed of the cases; None draws fresh cases each time.

    Returns
    -------
    The verdict. Its text stands below the cell.

    Raises
    ------
    DataError : there is no such task.

    Notes
    -----
    The function runs in a process that has the cases only, and a second one compares the results. The first
    check of a notebook starts both, which takes some seconds.

    Examples
    --------
    >>> import judges
    >>> def speed_limit(h, gamma, dt, person_speed):
    ...     return gamma * h / dt - person_speed
    >>> judges.check("speed_limit", speed_limit, seed=1)
    passed - speed_limit: correct in 40 fresh cases
    """
    if not callable(answer):
        return Verdict(
            name,
            False,
            f"give the function itself, check({name!r}, {name}), not its result",
        )
    try:
        packed = pack(answer)
    except Refusal as refusal:
        return Verdict(name, False, str(refusal))
    found = _ask(
        {
            "name": name,
            "seed": secrets.randbelow(10**6) if seed is None else seed,
            "answer": packed,
        }
    )
    if "error" in found:
        raise DataError(found["error"])
    return Verdict(name, found["passed"], found["message"])


def _ask(question: dict[str, Any]) -> Any:
    """Send a question to the judges, which are started if they do not run, and return their reply."""
    deadline = monotonic() + _LONGEST
    if not _programs or _programs[0].code is not None:
        _programs[:] = [Process(["-I", str(Path(__file__).parent), "serve"])]
    program = _programs[0]
    program.send(json.dumps(question).encode() + b"\n", deadline)
    line = program.receive(deadline)
    if not line:
        program.end()
        raise SzlibError("the judges do not reply; run the cell again")
    return json.loads(line)

"""The functions of a solver as machine code: the same numbers, to the last bit, several times as fast.

With `MPCSettings.compile = "auto"` a size that has been built is looked up in the user's cache. If it is not
there, a process in the background writes it as C and asks the C compiler ($CC, else cc); meanwhile the
virtual machine of CasADi goes on. A file of the cache is known by its functions, hence by this code and the
settings, by the compiler, and by how that is called. `szlib compile` does the same ahead of time, and says
what is wrong where it cannot be done. Where there is no compiler or no cache, nothing changes, and the log
"szlib" says why.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import platform
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from time import perf_counter
from typing import Any

import casadi as ca

from ...errors import SolverError, StorageError
from ...files import cache_folder, claim_folder, load_cached, store_cached, temporary_folder
from ..problem import BUILDING, Buffered
from ..settings import Compile

_log = logging.getLogger("szlib")

PURPOSE = "compiled functions of controllers"
"""What the folder of the cache is marked as."""
FLAGS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")
"""A product and a sum stay two operations, as in the virtual machine: so the numbers are the same."""
MOST = 500
"""Files in the cache; beyond, the oldest give way. One takes 70 to 300 kB."""
_LOOK = 0.2
"""Seconds between two looks for what has been compiled."""


_processes: dict[Path, subprocess.Popen[bytes]] = {}
"""Which process compiles, or has compiled, a file of the cache."""


class Compiled:
    """Puts compiled functions in the place of those of solvers: at once, or as soon as they are there."""

    def __init__(self, compile: Compile) -> None:
        self._on, self._looked = compile == "auto", 0.0
        self._waiting: dict[Path, Sequence[Buffered]] = {}

    def take(self, functions: Sequence[Buffered]) -> None:
        """Those of one solver from the cache; what is not there is waited for. Call it under `BUILDING`."""
        if self._on:
            try:
                self._waiting[library(functions)] = functions
                self._replace()
            except (SolverError, StorageError) as error:
                self._on = False
                _log.warning("nothing is compiled: %s", error)

    def begin(self) -> None:
        """Have what is waited for compiled, in the background."""
        if not self._waiting:
            return
        with BUILDING, tempfile.TemporaryFile() as told:
            wanted = {path: _said(of) for path, of in self._waiting.items() if path not in _processes}
            if wanted:
                pickle.dump(wanted, told)
                told.seek(0)
                command = [sys.executable, "-m", __name__]
                process = subprocess.Popen(command, stdin=told, stderr=subprocess.DEVNULL)
                _processes.update(dict.fromkeys(wanted, process))

    def look(self) -> None:
        """Take what has been compiled by now: looks a few times a second, and waits for no other thread."""
        if not self._waiting or perf_counter() < self._looked + _LOOK or not BUILDING.acquire(blocking=False):
            return
        try:
            asked = self._waiting.keys() & _processes.keys()
            ended = {path for path in asked if _processes[path].poll() is not None}
            self._replace()
            for path in ended & self._waiting.keys():
                del self._waiting[path]
                _log.warning("%s could not be compiled; `szlib compile` says why", path)
            self._looked = perf_counter()
        finally:
            BUILDING.release()

    def _replace(self) -> None:
        for path in [path for path in self._waiting if _is_there(path)]:
            for function in self._waiting.pop(path):
                function.become(loaded(function.function, path))


def loaded(function: Any, path: Path) -> Any:
    """The compiled one in the place of a function."""
    return ca.external(function.name(), str(path))


def library(functions: Sequence[Buffered]) -> Path:
    """The file of the cache in which these functions are, or will be.

    Raises SolverError where there is no compiler, StorageError where there is no cache.
    """
    home = cache_folder("compiled")
    if home is None:
        raise StorageError("the cache is off ($SZLIB_CACHE); name a folder, or unset it")
    known_by = "\0".join([*_said(functions), *_compiler(), *FLAGS, platform.machine(), version("casadi")])
    return home.absolute() / f"{hashlib.sha256(known_by.encode()).hexdigest()[:32]}.so"


def compile_now(functions: Sequence[Buffered]) -> float:
    """Have these functions in the cache; how long it took to compile them [s], 0 where they were there."""
    began = perf_counter()
    with BUILDING:
        path, said = library(functions), _said(functions)
    if _is_there(path):
        return 0.0
    compile_library(path, said)
    return perf_counter() - began


def compile_library(path: Path, functions: Sequence[str]) -> None:
    """Compile functions, as CasADi serializes them, into a file of the cache.

    Raises SolverError where there is no compiler or it fails, StorageError where the file cannot be written.
    """
    claim_folder(path.parent, PURPOSE)
    with temporary_folder() as place:
        with BUILDING:
            code = ca.CodeGenerator("functions.c")
            for each in functions:
                code.add(ca.Function.deserialize(each))
            code.generate(f"{place}{os.sep}")
        command = [*_compiler()[:-1], *FLAGS, "functions.c", "-o", "functions.so", "-lm"]
        done = subprocess.run(command, cwd=place, capture_output=True, text=True)
        if done.returncode:
            raise SolverError(f"{' '.join(command)} failed ({done.returncode}): {done.stderr.strip()[:500]}")
        store_cached(path, (place / "functions.so").read_bytes(), path.stem)
    for old in sorted(path.parent.glob("*.so"), key=lambda file: file.stat().st_mtime)[:-MOST]:
        old.unlink(missing_ok=True)
        old.with_name(f"{old.name}.json").unlink(missing_ok=True)


def _is_there(path: Path) -> bool:
    """Whether a file of the cache is there, and whole: what is damaged is compiled anew."""
    return load_cached(path, path.stem) is not None


def _said(functions: Sequence[Buffered]) -> list[str]:
    return [each.function.serialize() for each in functions]


@cache
def _compiler() -> tuple[str, ...]:
    """How the C compiler is called, and last what it says of its version."""
    command = shlex.split(os.environ.get("CC", "cc"))
    try:
        said = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.SubprocessError, IndexError) as error:
        raise SolverError(
            f"there is no C compiler {' '.join(command)!r} ({error}); name one in $CC"
        ) from error
    return (*command, said)


def main() -> None:
    """Compile what standard input says, as `Compiled.begin` writes it."""
    for path, functions in pickle.load(sys.stdin.buffer).items():
        compile_library(path, functions)


if __name__ == "__main__":
    main()

"""A program in a process of its own, which is asked line by line and cannot keep the caller waiting."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import subprocess
import sys
from collections.abc import Sequence
from threading import Thread
from time import monotonic

_LONGEST = 50_000_000  # of a line [bytes]


class Process:
    """A program that reads bytes and writes lines.

    Parameters
    ----------
    command : the arguments of Python.
    prefix : a program that starts Python, with its arguments.

    Notes
    -----
    A thread reads the lines, so that `receive` returns in time even if a process that the program has started
    holds its pipe open. `end` ends the program with its whole process group.
    """

    def __init__(self, command: Sequence[str], prefix: Sequence[str] = ()) -> None:
        self._process = subprocess.Popen(
            [*prefix, sys.executable, *command], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, start_new_session=True, env=_environment(), close_fds=True,
        )  # fmt: skip
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        if self._process.stdout is None:
            return
        with contextlib.suppress(OSError, ValueError), self._process.stdout as pipe:
            while line := pipe.readline(_LONGEST):
                self._lines.put(line)
        self._lines.put(b"")

    def send(self, data: bytes, deadline: float) -> None:
        """Send bytes until `deadline` (of `time.monotonic`); a program that has ended gets none."""

        def write() -> None:
            if self._process.stdin is not None:
                with contextlib.suppress(OSError, ValueError):
                    self._process.stdin.write(data)
                    self._process.stdin.flush()

        writer = Thread(target=write, daemon=True)
        writer.start()
        writer.join(max(0.0, deadline - monotonic()))

    def receive(self, deadline: float) -> bytes | None:
        """The next line; empty if there is none any more, None after the `deadline`."""
        try:
            return self._lines.get(timeout=max(0.0, deadline - monotonic()))
        except queue.Empty:
            return None

    @property
    def code(self) -> int | None:
        """The exit code; None while the program runs."""
        return self._process.poll()

    def wait(self) -> int | None:
        """The exit code of a program that closed its pipe; None if it goes on nevertheless."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self._process.wait(1.0)
        return None

    def end(self) -> None:
        """End the program, and what it has started in its process group."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
            else:
                self._process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()


def _environment() -> dict[str, str]:
    """The variables that Python needs; one thread of BLAS, whose threads would take a core each."""
    names = (
        "PATH",
        "HOME",
        "LANG",
        "LC_ALL",
        "TMPDIR",
        "TEMP",
        "SYSTEMROOT",
        "LD_LIBRARY_PATH",
    )
    return {name: os.environ[name] for name in names if name in os.environ} | {"OMP_NUM_THREADS": "1"}

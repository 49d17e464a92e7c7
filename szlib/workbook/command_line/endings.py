"""How a command ends before its time, and what it says on standard error."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from ...files import printable


@contextmanager
def endings() -> Iterator[None]:
    """SIGTERM, and SIGHUP unless it is ignored, end a command as Ctrl-C does."""

    def stop(number: int, _frame: object) -> None:
        """End as Ctrl-C does, with the signal's own exit code."""
        raise KeyboardInterrupt(128 + number)

    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    here = threading.current_thread() is threading.main_thread()
    numbers = [getattr(signal, name) for name in names] if here else []
    before = {n: signal.signal(n, stop) for n in numbers if signal.getsignal(n) is not signal.SIG_IGN}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def complain(what: str) -> None:
    """One line on standard error, and nothing left for a standard output that takes no more."""
    with suppress(OSError, ValueError, AttributeError):
        print(f"szlib: {printable(' '.join(what.split()))}", file=sys.stderr, flush=True)
    try:
        sys.stdout.flush()
    except (OSError, ValueError, AttributeError):
        with suppress(OSError, ValueError, AttributeError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, sys.stdout.fileno())


def show_warning(message: Warning | str, *_: object) -> None:
    """A warning in one line on standard error."""
    with suppress(OSError, ValueError, AttributeError):
        print(f"szlib: {printable(message)}", file=sys.stderr)

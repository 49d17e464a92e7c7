"""The way in: `main`.

Nothing heavy is imported before a command needs it, so that `--version`, `--help` and a typo answer at once.
Exit codes: 0; 1 where a check does not hold or a day failed; 2 where something was asked that cannot be
done, explained in one line (SZLIB_TRACEBACK=1 shows where); 130 after Ctrl-C, 143 after SIGTERM, 129 where
the terminal was closed: all three end the same way.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from contextlib import suppress

from ... import memory
from ...errors import SzlibError
from .endings import complain, endings, show_warning
from .options import parser


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line `szlib`; returns the exit code."""
    for stream in (sys.stdout, sys.stderr):  # a terminal that knows no umlauts gets them spelled out
        with suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    options = parser().parse_args(arguments)
    try:
        with endings(), memory.granted(options.memory), warnings.catch_warnings():
            warnings.showwarning = show_warning  # type: ignore[assignment]
            code = int(options.command(options))
            if sys.stdout is not None:
                sys.stdout.flush()
        return code
    except KeyboardInterrupt as stop:
        complain("stopped; what was finished stays in the results")
        return int(stop.args[0]) if stop.args else 130
    except Exception as error:
        if os.environ.get("SZLIB_TRACEBACK"):
            raise
        expected = isinstance(error, SzlibError | OSError)
        complain(str(error) if expected and str(error) else f"{type(error).__name__}: {error}")
        return 2

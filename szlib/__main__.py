"""The command `szlib`, also `python -m szlib`: Ctrl-C ends it without a traceback, even while it imports."""

import os
import shlex
import signal
import sys


def main() -> int:
    """Run the command line of this process and return its exit code.

    Errors of reading advise the command with other options, also in the processes that it starts.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.environ["SZLIB_COMMAND"] = shlex.join(["szlib", *sys.argv[1:]])
    from .workbook.cli import main

    return main()


if __name__ == "__main__":
    sys.exit(main())

"""The command `szlib`: Ctrl-C ends it without a traceback, also while it imports what it needs."""

import signal


def main() -> int:
    """Run the command line of this process and return its exit code."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from .cli import main

    return main()

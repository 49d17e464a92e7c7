"""`python -m szlib`: the command line."""

import sys

from .workbook.console import main

if __name__ == "__main__":
    sys.exit(main())

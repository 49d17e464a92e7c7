"""Build sdist and wheel into dist/, with absolute links in the README: `make dist HOME_URL=...`.

HOME_URL is where the repository's files are served, such as https://github.com/OWNER/szlib/raw/main: the page
of a package index shows pictures by absolute links only.
"""

import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

from flit_core import buildapi

ROOT = Path(__file__).resolve().parents[1]
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "results", "dist", "__pycache__", ".*_cache", ".hyp*")


def absolute(text: str, home: str) -> str:
    """Make the relative Markdown links of `text` absolute: they then start with `home`."""
    return re.sub(r"\]\((?!https?://|#)([^)]+)\)", rf"]({home.rstrip('/')}/\1)", text)


def main(home: str) -> None:
    """Build from a copy, so that the repository's own README keeps its relative links."""
    if not home.startswith("https://"):
        sys.exit("make dist needs HOME_URL=https://..., where the repository's files are served")
    (ROOT / "dist").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "szlib"
        shutil.copytree(ROOT, copy, ignore=LEFT_OUT)
        readme = copy / "README.md"
        readme.write_text(absolute(readme.read_text(encoding="utf-8"), home), encoding="utf-8")
        os.chdir(copy)
        for build in (buildapi.build_sdist, buildapi.build_wheel):
            print(build(str(ROOT / "dist")))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "")

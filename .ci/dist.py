"""Build sdist and wheel into dist/, with absolute links in the README: `make dist HOME_URL=...`.

HOME_URL is the address of the repository's files, such as https://github.com/OWNER/szlib/raw/main. A package
index shows only pictures with absolute links.
"""

import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

from flit_core import buildapi

ROOT = Path(__file__).resolve().parents[1]
EXCLUDED = shutil.ignore_patterns(".git", ".venv", "results", "dist", "__pycache__", ".*_cache", ".hyp*")


def make_links_absolute(text: str, home: str) -> str:
    """Make the relative Markdown links of `text` absolute: they then start with `home`."""
    return re.sub(r"\]\((?!https?://|#)([^)]+)\)", rf"]({home.rstrip('/')}/\1)", text)


def main(home: str) -> None:
    """Build from a copy of the repository, whose README gets links that start with `home`."""
    if not home.startswith("https://"):
        sys.exit("make dist needs HOME_URL=https://..., the address of the repository's files")
    (ROOT / "dist").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "szlib"
        shutil.copytree(ROOT, copy, ignore=EXCLUDED)
        readme = copy / "README.md"
        readme.write_text(make_links_absolute(readme.read_text(encoding="utf-8"), home), encoding="utf-8")
        os.chdir(copy)
        for build in (buildapi.build_sdist, buildapi.build_wheel):
            print(build(str(ROOT / "dist")))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "")

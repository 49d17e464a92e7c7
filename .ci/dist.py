"""Build sdist and wheel: the build backend of pyproject.toml, and `make dist HOME_URL=...`.

The wheel holds the notebooks as well, without their executed copies: they become `szlib/workbook/notebooks`.
HOME_URL is the address of the repository's files, such as https://github.com/OWNER/szlib/raw/main. A package
index shows only pictures with absolute links.
"""

import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, contextmanager
from pathlib import Path

from flit_core import buildapi
from flit_core.buildapi import (
    build_editable,
    build_sdist,
    prepare_metadata_for_build_editable,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "prepare_metadata_for_build_editable",
]
ROOT = Path(__file__).resolve().parents[1]
EXCLUDED = shutil.ignore_patterns(
    ".git", ".venv", "results", "dist", "__pycache__", ".*_cache", ".hyp*"
)
# What the wheel holds of the notebooks.
NOTEBOOKS = (
    "[0-9]*.py", "deeper/*.py", "laboratory/*.py", "laboratory/*.js", "plots/*.py", "studies/*.py",
    "exercises/*.py",
    "exercises/judges/*.*", "solutions/*.py", "examples/*.py", "tables/*.csv",
    "project/*.*", "project/rivals/*.py",
    "which_settings.md", "reference.md", "figures/mall.png", "figures/making_room.gif",
)  # fmt: skip


@contextmanager
def copy_tree() -> Iterator[Path]:
    """A copy of the current folder, in which the with block runs."""
    with tempfile.TemporaryDirectory() as folder:
        copy = shutil.copytree(Path.cwd(), Path(folder) / "szlib", ignore=EXCLUDED)
        with chdir(copy):
            yield copy


def build_wheel(
    wheel_directory: str,
    config_settings: object = None,
    metadata_directory: object = None,
) -> str:
    """Build the wheel into `wheel_directory` and return its name, as PEP 517 says; the others are unused."""
    place = Path(wheel_directory).resolve()
    with copy_tree() as copy:
        for file in (
            file for part in NOTEBOOKS for file in (copy / "notebooks").glob(part)
        ):
            target = copy / "szlib" / "workbook" / file.relative_to(copy)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
        return buildapi.build_wheel(str(place))


def make_links_absolute(text: str, home: str) -> str:
    """Make the relative Markdown links of `text` absolute: they then start with `home`."""
    return re.sub(r"\]\((?!https?://|#)([^)]+)\)", rf"]({home.rstrip('/')}/\1)", text)


def main(home: str) -> None:
    """Build from a copy of the repository, whose README gets links that start with `home`."""
    if not home.startswith("https://"):
        sys.exit(
            "make dist needs HOME_URL=https://..., the address of the repository's files"
        )
    (ROOT / "dist").mkdir(exist_ok=True)
    with chdir(ROOT), copy_tree() as copy:
        readme = copy / "README.md"
        readme.write_text(
            make_links_absolute(readme.read_text(encoding="utf-8"), home),
            encoding="utf-8",
        )
        for build in (build_sdist, build_wheel):
            print(build(str(ROOT / "dist")))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "")

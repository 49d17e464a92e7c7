"""Remove the environment and the results that `szlib run` wrote: `make clean`. Other files and days stay.

Runs with the standard library only, since the environment may be missing or damaged.
"""

import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# The purpose of a folder of results, as its marker file `.szlib` states it.
WORKBOOK, RUN, DAYS = "results of the workbook", "results of ", "encounters by day"
# What the notebooks write into the folder of a run. Each cached file has a checksum NAME.json beside it.
CACHED = (
    "encounters.parquet",
    "zone.json",
    "paper_zone.json",
    "area.txt",
    "plaza-*.csv",
)
NOTEBOOK = "[0-9][0-9]*_*"
OF_RUN = (
    "report.html", "report.html.json", "summary.json", "parameters.json",
    f"{NOTEBOOK}.ipynb", f"{NOTEBOOK}.csv", f"records/{NOTEBOOK}.json", f"figures/{NOTEBOOK}",
    *CACHED, *(f"{name}.json" for name in CACHED),
)  # fmt: skip
# What `make slides` writes.
OF_SLIDES = (f"{NOTEBOOK}.html", f"{NOTEBOOK}.pdf", f"figures/{NOTEBOOK}.png")


def clean(results: Path) -> None:
    """Remove from the folder of all `results` what szlib wrote, and the folders that are then empty."""
    for folder in (*results.glob("*"), *results.glob("lab/*")):
        if read_purpose(folder).startswith(RUN) and not folder.is_symlink():
            if read_purpose(folder / "days") == DAYS:  # of notebook 24
                shutil.rmtree(folder / "days")
            remove(folder, OF_RUN)
    if (results / "site" / "searchindex.js").exists():  # of `make docs`
        shutil.rmtree(results / "site")
    remove(results / "slides", OF_SLIDES)
    for folder in (results / "lab", results):
        if read_purpose(folder) == WORKBOOK:
            remove(folder, ())


def remove(folder: Path, patterns: tuple[str, ...]) -> None:
    """Remove the files of a `folder` that match `patterns`, and the folder if only its marker is left."""
    files = [file for pattern in patterns for file in folder.glob(pattern)]
    for file in files:
        file.unlink()
    for inside in sorted({file.parent for file in files} - {folder}, reverse=True):
        if not any(inside.iterdir()):
            inside.rmdir()
    if folder.is_dir() and all(
        path.name.startswith(".szlib") for path in folder.iterdir()
    ):
        shutil.rmtree(folder)


def read_purpose(folder: Path) -> str:
    """The purpose for which a `folder` was marked; empty if it was not."""
    try:
        return (folder / ".szlib").read_text(encoding="utf-8").partition("\n")[0]
    except OSError:
        return ""


if __name__ == "__main__":
    shutil.rmtree(ROOT / ".venv", ignore_errors=True)
    shutil.rmtree(ROOT / ".docs" / "pages", ignore_errors=True)
    clean(ROOT / "results")
    if kept := sorted(path.name for path in (ROOT / "results").glob("[!.]*")):
        print(f"results/ keeps what szlib run did not write: {', '.join(kept)}")

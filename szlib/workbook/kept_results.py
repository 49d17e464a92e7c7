"""Results of earlier runs that are kept: of the same notebook, code, data and parameters, and undamaged."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.input_files import open_regular
from . import folders

# Notebooks whose results later ones need, the encounters and the zone, and the file of each.
PRODUCTS = {"02": "encounters.parquet", "05": "zone.json"}
# Notebooks that read the records of all others. The others are independent of each other.
SUMMARIES = ("28",)


def package_checksum(notebooks: Path) -> str:
    """SHA-256 of the code of szlib, and of the tables, studies and laboratory that the `notebooks` use."""
    package = Path(__file__).parents[1]
    beside = (notebooks.glob(f"{name}/*.*") for name in ("laboratory", "studies"))
    parts = (package.rglob("*.*"), folders.NOTEBOOKS.glob("tables/*"), *beside)
    files = {
        file
        for part in parts
        for file in part
        if file.is_file() and file.suffix != ".pyc"
    }
    return _checksum([], sorted(files))


def outcome_checksum(
    home: Path, script: Path, outcome: Mapping[str, Any], code: str
) -> str:
    """SHA-256 of a notebook's `script`, its `outcome`, its outputs in `home`, and the `code`, a checksum."""
    number = script.stem.partition("_")[0]
    outputs = [
        script,
        *folders.list_outputs(home, script.stem),
        *home.glob(f"{number}_*.csv"),
    ]
    outputs += [home / PRODUCTS[number]] if number in PRODUCTS else []
    outputs += (home / "records").glob("*.json") if number in SUMMARIES else []
    without = {key: value for key, value in outcome.items() if key != "checksum"}
    return _checksum(
        [code, json.dumps(without, sort_keys=True)],
        sorted({f for f in outputs if f.is_file()}),
    )


def find_kept(
    home: Path,
    scripts: Sequence[Path],
    stored: Mapping[str, Mapping[str, Any]],
    code: str,
    figures: str | None = None,
) -> list[str]:
    """The names of the notebooks among `scripts` whose `stored` outcomes, and outputs in `home`, can be kept.

    `code` is the `package_checksum`.  Each figure must be there in the format `figures`, too.  A summary of
    all is kept only with all others.
    """
    kept = [
        script.stem
        for script in scripts
        if (outcome := stored.get(script.stem, {})).get("status")
        in ("done", "undecided")
        and _has_figures(home, outcome, figures)
        and outcome.get("checksum") == outcome_checksum(home, script, outcome, code)
    ]
    others = {
        script.stem for script in scripts if not script.stem.startswith(SUMMARIES)
    }
    return [name for name in kept if name in others or others <= set(kept)]


def _has_figures(home: Path, outcome: Mapping[str, Any], kind: str | None) -> bool:
    """Whether each figure of a notebook is also there in the format `kind`, if there is one."""
    names = [
        Path(str(name)) for name in outcome["figures"] if str(name).endswith(".png")
    ]
    return not kind or all(
        (home / "figures" / name.with_suffix(f".{kind}")).exists() for name in names
    )


def _checksum(texts: Iterable[str], files: Iterable[Path]) -> str:
    """SHA-256 of `texts`, and of the names and contents of `files`."""
    digest = hashlib.sha256()
    for text in texts:
        digest.update(f"{len(text)} {text}".encode())
    for file in files:
        with open_regular(file) as stream:
            digest.update(
                f"{file.name} {hashlib.sha256(stream.read()).hexdigest()}".encode()
            )
    return digest.hexdigest()

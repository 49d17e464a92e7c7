"""The command `szlib fit`: from extracted days, or tracks, to a zone with its table, verdict and figure."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from .. import (
    DataError,
    DataWarning,
    EncounterSettings,
    Extraction,
    MPCSettings,
    Recipe,
    SocialZone,
    StorageError,
    ZoneError,
    find_encounters,
    of_kind,
    read_tracks,
)
from ..core.files import folder_purpose, write_file
from ..core.input_files import file_content, printable
from ..encounters import days as several_days
from ..tracks import datasets
from ..zones.outliers import R_MAX
from ..zones.social_zone import FORMAT, check_method
from ..zones.uncertainty import N_RESAMPLES
from ..zones.verdict import describe_missing_encounters, require_encounters
from .folders import read_json_object, require_place
from .record.data_cache import find_null_model

# The verdicts of a zone say what its warnings say; those of reading and of the area are shown.
_verdict_only = partial(warnings.catch_warnings, action="ignore", category=DataWarning)
SPEED = MPCSettings.zone_speed  # of the zone that is drawn and judged [m/s]
NO_TRACKS = (
    "no null model: extracted days hold no tracks; add --tracks FILE... (those of one day are enough) to "
    "compare with people who ignore each other"
)


def fit(
    paths: Sequence[str],
    *,
    out: str | Path,
    settings: EncounterSettings,
    reading: Recipe,
    method: str | None = None,
    kind: Sequence[str] | None = None,
    tracks: Sequence[str] = (),
    exclude: Sequence[str] = (),
) -> str:
    """Fit a zone, write it and its figure, and return its table and verdict as text.

    Parameters
    ----------
    paths : a folder of extracted days, or files of tracks.
    out : the file of the zone; its figure has the same name, with .png.
    settings, reading : what counts as an encounter and how files are read; extracted days have their own.
    method, kind : as `method` of `szlib.SocialZone.fit`, and as `szlib.of_kind`.
    tracks : tracks of extracted days, for the null model.
    exclude : extracted days to leave out.

    Raises
    ------
    DataError : the paths are neither, or hold no encounters; or tracks are of other days.
    StorageError : the zone cannot be written there.
    ZoneError : there are too few encounters for a zone.
    """
    from matplotlib.figure import Figure

    file = _require_place(Path(out))
    if method is not None:
        check_method(method)
    if any(folder_purpose(path) == several_days.PURPOSE for path in paths):
        samples, table, settings = _read_days(paths, tracks, exclude)
        zone = _fit_lone_encounters(samples, table, settings, method, kind)
    elif tracks or exclude:
        raise DataError(
            f"--tracks and --exclude belong to a folder of extracted days; {paths[0]} is none"
        )
    else:
        zone, table = _fit_files(paths, settings, reading, method, kind)
    figure = Figure(figsize=(6, 4.5), layout="constrained")
    content = io.BytesIO()
    zone.plot(SPEED if SPEED in zone.ellipses else None, ax=figure.subplots())
    figure.savefig(content, format="png", dpi=150)
    zone.save(file)
    picture = file.with_suffix(".png")
    write_file(picture, content.getvalue())
    notes = [f"zone: {printable(file)}; figure: {printable(picture)}"]
    notes += [] if table is not None else [NO_TRACKS]
    verdict = f"zone at {SPEED:g} m/s: {zone.verdict(SPEED).sentence}"
    return "\n".join(
        [
            f"method {zone.meaning}",
            format_table(zone).to_string(index=False),
            *notes,
            verdict,
        ]
    )


def _read_days(
    paths: Sequence[str], tracks: Sequence[str], exclude: Sequence[str]
) -> tuple[pd.DataFrame, pd.DataFrame | None, EncounterSettings]:
    """The encounters of extracted days, the table of their `tracks` (None without), and their settings."""
    if len(paths) > 1:
        raise DataError(
            f"{' '.join(paths)}: give one folder of extracted days, or files of tracks"
        )
    days = Extraction.load(paths[0], exclude=exclude)
    sources = days.sources.values()
    of_days = [list(content) for source in sources for content in source["files"]]
    checksums = [checksum for _, _, checksum in of_days]
    if len(set(checksums)) < len(checksums):
        raise DataError(
            f"{paths[0]}: two of its days are one file; pass --exclude DAY, or extract into a new folder"
        )
    files = datasets.find(tracks) if tracks else []
    other = [each for each in files if [each.name, *file_content(each)] not in of_days]
    if other:
        raise DataError(
            f"{printable(other[0])}: is none of the files of the extracted days, unchanged"
        )
    table = read_tracks(files, recipe=days.recipe) if files else None
    return days.samples(), table, days.settings


def _fit_files(
    paths: Sequence[str],
    settings: EncounterSettings,
    reading: Recipe,
    method: str | None,
    kind: Sequence[str] | None,
) -> tuple[SocialZone, pd.DataFrame]:
    """Fit a zone to files of tracks: ours to every pair of people, the others to lone encounters."""
    table = read_tracks(datasets.find(paths), recipe=reading)
    if method in (None, "respect"):
        options: Any = {"kinds": kind, "method": method, "progress": True}
        try:
            with _verdict_only():
                return SocialZone.from_tracks(
                    table, area=settings.area, **options
                ), table
        except DataError as error:
            raise DataError(
                f"{error}; the paper's zone of lone encounters may still be found: --method paper"
            ) from error
    samples = find_encounters(table, settings=settings)
    require_encounters(samples)
    return _fit_lone_encounters(samples, table, settings, method, kind), table


def _fit_lone_encounters(
    samples: pd.DataFrame,
    table: pd.DataFrame | None,
    settings: EncounterSettings,
    method: str | None,
    kind: Sequence[str] | None,
) -> SocialZone:
    """Fit a zone to lone encounters, with their null model where there is a track `table`."""
    samples = of_kind(samples, kind)
    null = None
    if table is not None:
        null = find_null_model(table, settings=settings, kinds=kind, r_max=R_MAX)
    elif method == "respect":
        raise DataError(f"method respect needs a null model; {NO_TRACKS}")
    try:
        with _verdict_only():
            return SocialZone.fit(
                samples, method=method, null=null, n_resamples=N_RESAMPLES
            )
    except (ZoneError, DataError) as error:
        missing = describe_missing_encounters(
            {"encounters": samples["encounter"].nunique()}
        )
        raise ZoneError("; ".join(filter(None, [str(error), missing]))) from error


def format_table(zone: SocialZone) -> pd.DataFrame:
    """The table of a `zone` as texts: semi-axes with their 95 % intervals, encounters, verdict."""
    table = zone.table()
    shown = pd.DataFrame({"speed [m/s]": table["speed"].map("{:g}".format)})
    for name in ("a", "b"):
        rows = table[[name, f"{name}_low", f"{name}_high"]].itertuples(index=False)
        shown[f"{name} [m] (95 %)"] = [
            f"{v:.2f} ({low:.2f} to {high:.2f})".replace("nan to nan", "unknown")
            for v, low, high in rows
        ]
    return shown.assign(
        encounters=table["encounters"].map("{:,.0f}".format), verdict=table["verdict"]
    )


def _require_place(file: Path) -> Path:
    """The `file`, if a zone can be written there."""
    if file.suffix != ".json":
        raise StorageError(f"{printable(file)}: expected a file that ends in .json")
    is_zone = read_json_object(require_place(file)).get("format") == FORMAT
    for each in (file, file.with_suffix(".png")):
        if each.exists() and not is_zone:
            raise StorageError(
                f"{printable(each)}: exists, and is no zone of szlib; choose another name with --out"
            )
    return file

"""Many days to encounters: a cached Parquet file for each, resumable, on one machine or many.

In the folder `out` each day has two files: ``<day>.parquet``, its samples and their funnel, and then
``<day>.parquet.json``, their checksum and what they are made of: the content of the day's files, every
parameter, and the version of szlib.  Each file is written atomically.  A day whose two files match is not
computed again, so a run that was stopped or killed continues where it ended.  Then a file of the same inode,
size and times is not even read.  A day whose files cannot be used has no result, not even an earlier one.
"""

from __future__ import annotations

import io
import json
import time
import warnings
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import joblib
import pandas as pd
from tqdm import tqdm

from .. import __version__
from ..core.errors import DataError, DataWarning, SzlibError, warn
from ..core.files import claim_folder, folder_purpose, load_cached, store_cached
from ..core.input_files import (
    file_content,
    file_state,
    printable,
    read_small,
    reading,
    unchanged_files,
)
from ..core.parallel import run_tasks
from ..tracks import datasets, funnels
from ..tracks.clock import interpolate, read_tracks
from ..tracks.readers import (
    find_day,
    find_format,
    load_files,
    merge_files,
    name_recordings,
)
from ..tracks.recipe import Recipe, find_recipe
from .areas import AUTO, as_area, has_calendar
from .finding import find_encounters, find_place, select_near
from .geometry import Area, AttentionalSpace
from .settings import EncounterSettings

# of the cached result of a day; a result of another version is computed again
_VERSION = 12
# purpose of an extraction's folder, as its marker states it
PURPOSE = "encounters by day"
# a row of the table of days, of an excluded one
_ROW: dict[str, Any] = {
    "day": "",
    "status": "excluded",
    "files": 0,
    "rows": 0,
    "unusable": 0,
    "encounters": 0,
    "samples": 0,
    "seconds": 0.0,
    "why": "",
}


def find_area(
    files: Sequence[Path], settings: EncounterSettings, recipe: Recipe
) -> Area:
    """The area of `files` of one place: that of the `settings`, of the `recipe` or of the mall's files.

    Without one the files are read, to find where people walked.  Then the area has a `reason`.
    """
    areas = {settings.area}
    if settings.area is None:
        areas = {find_format(file, recipe).area for file in files}
    if len(areas) == 1 and not areas & {None, AUTO}:
        return as_area(areas.pop())
    # Reading the day itself warns of rejected rows.
    with warnings.catch_warnings(action="ignore", category=DataWarning):
        tracks = read_tracks(files, recipe=recipe)
    return find_place(tracks, settings)[1]


def describe_source(
    files: Sequence[Path],
    settings: EncounterSettings,
    recipe: Recipe,
    known: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """What the encounters of a day are made of, in JSON values.

    It holds names, sizes and checksums of the `files`, their states, `settings`, `recipe`, and the version of
    szlib.  Checksums are taken from an earlier description, `known`, if the states are the same.
    """
    states = find_states(files)
    if known and known.get("states") == states:
        content = known["files"]
    else:
        content = sorted([file.name, *file_content(file)] for file in files)
    return {
        "version": _VERSION,
        "szlib": __version__,
        "files": content,
        "states": states,
        "parameters": settings.as_json() | {"recipe": recipe.as_json()},
    }


def find_states(files: Sequence[Path]) -> list[list[Any]]:
    """Name, inode, size and times of each of the `files`, which differ after it has changed."""
    return sorted([file.name, *file_state(file)] for file in files)


def load_source(folder: Path, day: str) -> dict[str, Any] | None:
    """What the result of a `day` in `folder` is made of; None if there is none, or it is damaged."""
    with suppress(OSError, LookupError, TypeError, ValueError):
        return dict(json.loads(read_small(folder / f"{day}.parquet.json"))["made_of"])
    return None


def load_day(folder: Path, day: str, source: Mapping[str, Any]) -> pd.DataFrame | None:
    """The samples of a `day` in `folder`; None if missing, damaged, or made of another `source`."""
    content = load_cached(folder / f"{day}.parquet", source)
    return None if content is None else pd.read_parquet(io.BytesIO(content))


def _add_stages(samples: Iterable[pd.DataFrame]) -> list[dict[str, Any]]:
    """The funnels of several `samples`, added up as if their files had been read together."""
    return funnels.add(
        [
            stage | {"stage": "read all files"}
            if stage["stage"].startswith("read ")
            else stage
            for stage in funnels.get(each)
        ]
        for each in samples
    )


def _find_excluded(exclude: Iterable[str], days: Iterable[str]) -> set[str]:
    """The days to `exclude`, one or several; a DataWarning names those that are not among the `days`."""
    excluded = {exclude} if isinstance(exclude, str) else set(map(str, exclude))
    if unknown := sorted(excluded.difference(days)):
        warn(f"{', '.join(unknown)}: excluded, but there is no such day", 3)
    return excluded


@dataclass(frozen=True, eq=False)
class Extraction:
    """Result of `extract_days`.

    Attributes
    ----------
    out : folder of the results.
    table : one row a day: day, status ("done" now, "kept" from before, "excluded", "failed"), files, rows
        read, unusable rows among them, encounters, samples, seconds, and why a day failed, or what is
        implausible in it.
    settings : what counted as an encounter.  Its area is the same in every day; else it is "auto" or None.
    recipe : how the files were read.
    sources : what the result of each finished day is made of: content, parameters and version.
    exclude : days that were left out.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=20))
    >>> days = szlib.extract_days(plaza, out="days", progress=False)
    >>> days.table["status"].tolist(), len(days.failed)
    (['done'], 0)
    >>> samples = days.samples()
    """

    out: Path
    table: pd.DataFrame
    settings: EncounterSettings
    recipe: Recipe
    sources: Mapping[str, Mapping[str, Any]]
    exclude: set[str]

    @classmethod
    def load(cls, out: str | Path, *, exclude: Iterable[str] = ()) -> Extraction:
        """Load the days that `extract_days` left in the folder `out`, but not those to `exclude`.

        `exclude` is a day or several.  A DataWarning names those that the folder does not hold.

        Raises
        ------
        DataError : the folder holds no extracted days, or they differ in settings or version; or none is
            left, or a day is damaged.
        """
        folder = Path(out)
        if folder_purpose(folder) != PURPOSE:
            raise DataError(
                f"{folder}: holds no extracted days; expected a folder of `szlib extract`"
            )
        sources: dict[str, dict[str, Any]] = {}
        files = {
            file.name.removesuffix(".parquet.json"): file
            for file in folder.glob("*.parquet.json")
        }
        excluded = _find_excluded(exclude, files)
        for day in sorted(files.keys() - excluded):
            file = files[day]
            with reading(
                file, "as an extracted day", "this version; extract the day again"
            ):
                sources[day] = json.loads(read_small(file))["made_of"]
                parameters = dict(sources[day]["parameters"])
                recipe = Recipe(**parameters.pop("recipe"))
                settings = EncounterSettings(
                    space=AttentionalSpace(**parameters.pop("space")), **parameters
                )
            first = next(iter(sources))
            of_day = {"files": None, "states": None}
            if sources[day] | of_day != sources[first] | of_day:
                raise DataError(
                    f"{folder}: {day} was extracted with other settings than {first}, or another version; "
                    "extract all days again, or exclude it"
                )
        if not sources:
            raise DataError(
                f"{folder}: no day is left; expected one besides those excluded, {sorted(excluded)}, and "
                "those that failed: `szlib extract` says why"
            )
        return cls(
            folder,
            pd.DataFrame({"day": list(sources), "status": "kept"}),
            settings,
            recipe,
            sources,
            excluded,
        )

    @property
    def failed(self) -> pd.DataFrame:
        """The days that failed, and why."""
        return self.table[self.table["status"] == "failed"]

    def samples(self) -> pd.DataFrame:
        """Samples of all finished days, as from `szlib.find_encounters`, by day, encounters numbered anew.

        The funnels of all days are added up, stage by stage.  The result depends neither on the order of the
        files nor on the number of processes.  Recordings of several files that share a day are distinguished
        by their names.

        Raises
        ------
        DataError : no day is finished, or another run has since replaced a result in the folder.
        """
        if not self.sources:
            raise DataError(f"no day was finished in {self.out}; see the table: {self}")
        parts = {}
        for day, source in sorted(self.sources.items()):
            part = load_day(self.out, day, source)
            if part is None:
                raise DataError(
                    f"{self.out / day}.parquet: is not the result of this extraction (another run, other "
                    "data or parameters, or damage); extract again, into another folder"
                )
            parts[day] = part
        # a stored table without a row has no categories
        filled = {day: part for day, part in parts.items() if len(part)} or parts
        samples = pd.concat(filled, names=["file"]).reset_index("file")
        samples["day"] = samples["day"].astype(str)
        samples = samples[~samples["day"].isin(self.exclude)].reset_index(drop=True)
        samples["encounter"] = samples.groupby(
            ["file", "encounter"], sort=False
        ).ngroup()
        names = samples["day"] + " (" + samples.pop("file") + ")"
        is_one = names.groupby(samples["day"]).transform("nunique") == 1
        samples["day"] = samples["day"].where(is_one, names).astype("category")
        return funnels.attach(samples, _add_stages(parts.values()))

    def __str__(self) -> str:
        shown = self.table.to_string(index=False, float_format="{:.1f}".format)
        statuses = self.table["status"].value_counts().sort_index()
        text = ", ".join(f"{count} {status}" for status, count in statuses.items())
        area = self.settings.area
        if isinstance(area, Area):
            text = f"{text}; area: {area} {area.reason}".rstrip()
        return f"{shown}\n{text}"


def extract_days(
    paths: str | Path | Sequence[str | Path],
    *,
    out: str | Path,
    settings: EncounterSettings | None = None,
    recipe: Recipe | None = None,
    n_jobs: int = 1,
    exclude: Iterable[str] = (),
    progress: bool = True,
    **parameters: Any,
) -> Extraction:
    """Find the encounters of many days, each separately, and store them in a folder.

    Parameters
    ----------
    paths : files, folders or globs.  Files that begin on the same calendar day make one day (the pieces
        of the 1 Hz day).  A recording without a calendar day is a day of its own, named after its file (and
        its folder, where two files have the same name).
    out : folder for the results only; made if it is missing.
    settings : what counts as an encounter; None takes the paper's.  With area None the files of the ATC mall
        have `ATC_SQUARE`; others have "auto": the `szlib.walked_area` of the first day, the
        same for all days of a calendar; recordings without a calendar have each their own.
    recipe : how files are read.
    n_jobs : number of processes; -1 takes all cores, or all workers of ``joblib.parallel_config("dask")``.
    exclude : a day "YYYY-MM-DD", or several, to leave out, as event days were in the paper (sec. 2); they are
        not read.  A DataWarning names those that are no day of the files.
    progress : whether to show a bar over the days.
    parameters : single values in place of those of `settings` and `recipe`, such as area or unit.

    Returns
    -------
    An `Extraction`.  Its table gives the status of each day; a day that fails does not stop the others.

    Raises
    ------
    DataError : there is no such file or parameter.
    StorageError : the folder cannot be made, or holds files that szlib did not write.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=20))
    >>> days = szlib.extract_days(plaza, out="days", min_speed=0.5, progress=False)
    >>> days.samples()["encounter"].nunique() > 0
    True
    """
    of_recipe = {
        each.name: parameters.pop(each.name)
        for each in fields(Recipe)
        if each.name in parameters and each.name != "area"
    }
    settings = (settings or EncounterSettings()).with_parameters(parameters)
    # a file of several names once; links keep their names
    files = sorted(
        {file.resolve(): file.absolute() for file in datasets.find(paths)}.values()
    )
    recipe = find_recipe(files, recipe, **of_recipe)
    folder = claim_folder(out, PURPOSE)
    days: dict[str, dict[Path, Any]] = {}
    for file, name in zip(files, name_recordings(files), strict=True):
        [state] = find_states([file])
        day = find_day(file, recipe) or printable(name)
        days.setdefault(day, {})[file] = state
    excluded = _find_excluded(exclude, days)
    included = {day: days[day] for day in sorted(days.keys() - excluded)}
    shared = [day for day in included if has_calendar(day) or len(included) == 1]
    common = settings
    for day in shared:
        # the first day with an area; computing a day that fails says why
        with suppress(SzlibError):
            common = replace(
                settings, area=find_area([*included[day]], settings, recipe)
            )
            break
    tasks = [
        joblib.delayed(extract_day)(
            day,
            included[day],
            folder.resolve(),
            common if day in shared else settings,
            recipe,
        )
        for day in included
    ]
    # With disable=None the bar is shown in a terminal.
    rows = list(
        tqdm(
            run_tasks(tasks, n_jobs=n_jobs),
            total=len(tasks),
            unit="day",
            disable=not progress or None,
        )
    )
    rows += [
        _ROW | {"day": day, "files": len(days[day])} for day in days.keys() & excluded
    ]
    table = pd.DataFrame(rows, columns=list(_ROW)).sort_values("day", ignore_index=True)
    sources = {row["day"]: row["source"] for row in rows if "source" in row}
    if len(shared) == len(included):
        settings = common
    return Extraction(folder, table, settings, recipe, sources, excluded)


def extract_day(
    day: str,
    states: Mapping[Path, Any],
    out: Path,
    settings: EncounterSettings,
    recipe: Recipe,
) -> dict[str, Any]:
    """Compute one `day`, or load it from the folder `out`; return its row of the table.

    `states` has the files of the day, and their states before the day and the area were found; they must be
    the same now.  `settings` and `recipe` as in `extract_days`.  Days share nothing but `out`.
    """
    start = time.perf_counter()
    files = list(states)
    row = _ROW | {"day": day, "status": "failed", "files": len(files)}
    try:
        with unchanged_files(files), ThreadPoolExecutor(1) as thread:
            if find_states(files) != sorted(states.values()):
                raise DataError(
                    f"{files[0]}: changed after its day or the area was found; extract the day again"
                )
            source = samples = None
            stored = load_source(out, day)
            if stored:
                source = describe_source(files, settings, recipe, stored)
                samples = load_day(out, day, source | {"states": stored.get("states")})
            status = "kept"
            if samples is None:
                status = "done"
                # The table and the funnel count the rejected rows.
                with warnings.catch_warnings(action="ignore", category=DataWarning):
                    loaded = load_files(files, recipe)
                    # Checksums are computed meanwhile.
                    described = thread.submit(
                        describe_source, files, settings, recipe, source
                    )
                    tracks = interpolate(
                        merge_files(loaded, select=partial(select_near, settings)),
                        recipe.max_gap,
                    )
                    samples = find_encounters(tracks, settings=settings)
                source = described.result()
        if status == "done" or source != stored:
            store_cached(
                out / f"{day}.parquet", samples.to_parquet(index=False), source
            )
        read = _add_stages([samples])[0]
        row |= {
            "status": status,
            "rows": read["entered"],
            "unusable": read["entered"] - read["kept"],
            "encounters": samples["encounter"].nunique(),
            "samples": len(samples),
            "why": "; ".join(funnels.warnings(funnels.get(samples))),
            "source": source,
        }
    except Exception as error:  # whatever fails in one day, the others go on
        row["why"] = printable(error if isinstance(error, SzlibError) else repr(error))
        if type(error) is DataError:  # an earlier result is not that of this file
            with suppress(OSError):
                (out / f"{day}.parquet.json").unlink()
    return row | {"seconds": time.perf_counter() - start}

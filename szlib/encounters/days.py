"""Many days to encounters: a cached Parquet file for each, resumable, on one machine or many.

In the folder `out` each day has two files: ``<day>.parquet``, its samples and their funnel, and then
``<day>.parquet.json``, their checksum and what they are made of: the content of the day's files, every
parameter, and the version of szlib.  Each file is written atomically.  A day whose two files match is not
computed again, so a run that was stopped or killed continues where it ended.
"""

from __future__ import annotations

import io
import time
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from contextvars import copy_context
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import joblib
import pandas as pd
from tqdm import tqdm

from .. import __version__
from ..core.errors import DataError, DataWarning, SzlibError
from ..core.files import claim_folder, folder_purpose, load_cached, store_cached
from ..core.input_files import (
    file_content,
    printable,
    read_json_object,
    unchanged_files,
)
from ..core.parallel import run_tasks
from ..tracks import datasets, funnels
from ..tracks.clock import read_tracks, to_clock
from ..tracks.readers import find_day, find_format, name_recordings
from ..tracks.recipe import Recipe, find_recipe
from .areas import AUTO, area_for, as_area, has_calendar, place_apart
from .finding import find_encounters
from .geometry import Area, AttentionalSpace
from .near_rows import read_near_area
from .samples import no_samples
from .settings import EncounterSettings

# Advice by a word of the condition that rejected everything.
_ADVICE = {
    "corner": 'the space ahead of a person, 4 m x 5 m, has no room there: give a larger area, or "auto"',
    "not in the area": 'give an area in which people walked: four numbers or a polygon, or "auto"',
    "slow": "are unit and frame rate right? else pass a smaller min_speed",
    "velocity": "tracks are single points: pass a longer max_gap, or join the ids of one person",
    "ends": "tracks are short or broken: pass a longer max_gap, or a shorter duration",
    "nobody": "people were never near each other: more data, or a larger space",
    "several": "it was crowded: a smaller space",
    "nearer": "people came into view late: pass a smaller min_distance",
    "somebody else": "more data, or other conditions (szlib.find_encounters)",
}
# of the cached result of a day; a result of another version is computed again
_VERSION = 9


def find_encounters_in_files(
    files: Sequence[Path], settings: EncounterSettings, recipe: Recipe
) -> pd.DataFrame:
    """Find the encounters of the `files` of one day: the same as in ``szlib.read_tracks(files)``.

    `settings` say what counts as an encounter, `recipe` how the files are read.  Raises DataError also where
    a file changes meanwhile.
    """
    tracks, settings = read_for_encounters(files, settings, recipe)
    if len(tracks) == 0:
        return funnels.attach(no_samples(), funnels.get(tracks))
    return find_encounters(tracks, settings=settings)


def read_for_encounters(
    files: Sequence[Path], settings: EncounterSettings, recipe: Recipe
) -> tuple[pd.DataFrame, EncounterSettings]:
    """The tracks on which encounters in the `files` of one day depend, and the `settings` with their area.

    The files are read as `recipe` says.
    """
    with unchanged_files(files):
        area = known_area(settings, files, recipe)
        raw = read_near_area(
            files, area=area, duration=settings.duration, recipe=recipe
        )
    tracks = to_clock(raw, max_gap=recipe.max_gap) if len(raw) else raw
    return tracks, replace(settings, area=area or AUTO)


def with_area(
    settings: EncounterSettings,
    files: Sequence[Path],
    recipe: Recipe,
    tracks: pd.DataFrame | None = None,
) -> EncounterSettings:
    """The `settings` with the area of these `files` where it is "auto" or None.

    The files are read as `recipe` say, unless their `tracks` are given.
    """
    area = known_area(settings, files, recipe)
    if area is None:
        if tracks is None:
            # Reading the day itself warns of rejected rows.
            with warnings.catch_warnings(action="ignore", category=DataWarning):
                tracks = read_tracks(files, recipe=recipe)
        area = area_for(place_apart(tracks), AUTO, settings.space)
    return replace(settings, area=area)


def find_area(
    files: Sequence[str], settings: EncounterSettings, recipe: Recipe
) -> tuple[EncounterSettings, list[Any] | None]:
    """The `settings` with the area of `files`, and the contents of these if it was found in them.

    The files are read as `recipe` say; for their contents see `describe_source`.
    """
    paths = [Path(file) for file in files]
    with unchanged_files(paths):
        is_known = known_area(settings, paths, recipe) is not None
        contents = (
            None if is_known else describe_source(files, settings, recipe)["files"]
        )
        return with_area(settings, paths, recipe), contents


def known_area(
    settings: EncounterSettings, files: Sequence[Path], recipe: Recipe
) -> Area | None:
    """The area of the `settings`, of the `recipe`, or of the mall's `files`; None where it must be found."""
    if isinstance(settings.area, Area):
        return settings.area
    areas = {find_format(file, recipe).area for file in files}
    known = areas.pop() if settings.area is None and len(areas) == 1 else None
    return as_area(known) if known and known != AUTO else None


def require_encounters(samples: pd.DataFrame) -> pd.DataFrame:
    """Return the `samples` if there are any; else raise DataError: the stage that rejected everything, why,
    and what to do."""
    if len(samples):
        return samples
    stages = [stage for stage in funnels.get(samples) if stage["entered"]]
    emptied = next((stage for stage in stages if not stage["kept"]), None)
    if emptied is None:
        raise DataError(
            "the table of samples is empty, and has no funnel that says why"
        )
    rows = ", ".join(
        f"{count:,} {reason}" for reason, count in emptied["rejected"].items()
    )
    last = list(emptied["rejected"])[-1]
    usual = next(
        (text for words, text in _ADVICE.items() if words in last),
        _ADVICE["somebody else"],
    )
    raise DataError(
        f"there is no encounter in the area {samples.attrs.get('area', '')}: of {emptied['entered']:,} "
        f"({emptied['stage']}) none is left: {rows}.  The last condition: {last}; {usual}"
    )


def describe_source(
    files: Sequence[str], settings: EncounterSettings, recipe: Recipe
) -> dict[str, Any]:
    """What the encounters of a day are made of, in JSON values.

    It holds names, sizes and checksums of the `files`, `settings`, `recipe`, and the version of szlib.
    """
    content = sorted([Path(file).name, *file_content(Path(file))] for file in files)
    parameters = settings.as_json() | {"recipe": recipe.as_json()}
    return {
        "version": _VERSION,
        "szlib": __version__,
        "files": content,
        "parameters": parameters,
    }


def read_parameters(
    parameters: Mapping[str, Any],
) -> tuple[EncounterSettings, Recipe]:
    """Settings and recipe from the `parameters` of `describe_source`; a missing one has its default."""
    values = {**parameters, "space": AttentionalSpace(**parameters["space"])}
    known = {each.name for each in fields(EncounterSettings)} & values.keys()
    settings = EncounterSettings(**{name: values[name] for name in known})
    return settings, Recipe(**values.get("recipe", {}))


def load_day(
    folder: Path, day: str, source: Mapping[str, Any] | None
) -> pd.DataFrame | None:
    """The samples of a `day` in `folder`; None if missing, damaged, or made of another `source`."""
    content = load_cached(folder / f"{day}.parquet", source)
    return None if content is None else pd.read_parquet(io.BytesIO(content))


# purpose of an extraction's folder, as its marker states it
PURPOSE = "encounters by day"
_READ = "read all files"  # the first stage of the funnel of many days


@dataclass(frozen=True, eq=False)
class Extraction:
    """Result of `extract_days`.

    Attributes
    ----------
    out : folder of the results.
    table : one row a day: day, status ("done" now, "kept" from before, "excluded", "failed"), files, rows
        read, unusable rows among them, encounters, samples, seconds, and why a day failed, or what is
        implausible in it.
    exclude : days that were left out.
    sources : what the result of each finished day is made of: content, parameters and version.
    area : where encounters were searched, the same in every day; None where each recording has its own, or
        no day has one.
    settings, recipe : what counted as an encounter, and how the files were read.

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
    exclude: tuple[str, ...] = ()
    sources: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    area: Area | None = None
    settings: EncounterSettings = field(default_factory=EncounterSettings)
    recipe: Recipe = field(default_factory=Recipe)

    @classmethod
    def load(cls, out: str | Path, *, exclude: Iterable[str] = ()) -> Extraction:
        """Load the days that `extract_days` left in the folder `out`, but not those in `exclude`.

        Raises
        ------
        DataError : the folder holds no extracted days, or they differ in settings or version; or none is
            left, or a day is damaged.
        """
        folder, excluded = Path(out), sorted(map(str, exclude))
        if folder_purpose(folder) != PURPOSE:
            raise DataError(
                f"{folder}: holds no extracted days; expected a folder of `szlib extract`"
            )
        stored = {
            file.name.removesuffix(".parquet.json"): file
            for file in folder.glob("*.parquet.json")
        }
        sources: dict[str, dict[str, Any]] = {}
        for day in sorted(stored.keys() - set(excluded)):
            sources[day] = read_json_object(stored[day]).get("made_of") or {}
            if "parameters" not in sources[day]:
                raise DataError(f"{stored[day]}: is damaged; extract the day again")
        if not sources:
            raise DataError(
                f"{folder}: no day is left; all of {', '.join(sorted(stored))} are excluded"
            )
        first = next(iter(sources))
        made_by = [{**source, "files": None} for source in sources.values()]
        if other := next(
            (day for day, of in zip(sources, made_by, strict=True) if of != made_by[0]),
            None,
        ):
            raise DataError(
                f"{folder}: {other} was extracted with other settings than {first}, or another version; "
                "extract all days again, or exclude it"
            )
        table = pd.DataFrame({"day": list(sources), "status": "kept"})
        settings, recipe = read_parameters(sources[first]["parameters"])
        area = settings.area if isinstance(settings.area, Area) else None
        return cls(folder, table, tuple(excluded), sources, area, settings, recipe)

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
        days = self.table.loc[self.table["status"].isin(["done", "kept"]), "day"]
        if len(days) == 0:
            raise DataError(f"no day was finished in {self.out}; see the table: {self}")
        parts, stages, count = [], [], 0
        for day in sorted(days):
            part = load_day(self.out, day, self.sources.get(day))
            if part is None:
                raise DataError(
                    f"{self.out / day}.parquet: is not the result of this extraction (another run, other "
                    "data or parameters, or damage); extract again, into another folder"
                )
            stages.append(
                [
                    s | {"stage": _READ} if s["stage"].startswith("read ") else s
                    for s in funnels.get(part)
                ]
            )
            part = part[~part["day"].isin(self.exclude)]
            numbers, found = pd.factorize(part["encounter"])
            parts.append(
                part.assign(
                    encounter=numbers + count, day=part["day"].astype(str), file=day
                )
            )
            count += len(found)
        shared = Counter(name for part in parts for name in part["day"].unique())
        for k, part in enumerate(parts):
            ambiguous = part["day"].map(shared) > 1
            day = part["day"].where(~ambiguous, part["day"] + " (" + part["file"] + ")")
            parts[k] = part.assign(day=day).drop(columns="file")
        samples = pd.concat(
            [part for part in parts if len(part)] or parts[:1], ignore_index=True
        )
        return funnels.attach(samples.astype({"day": "category"}), funnels.add(stages))

    def __str__(self) -> str:
        shown = self.table.to_string(index=False, float_format="{:.1f}".format)
        statuses = self.table["status"].value_counts().sort_index()
        counts = ", ".join(f"{n} {status}" for status, n in statuses.items())
        area = f"; area: {self.area} {self.area.reason}".rstrip() if self.area else ""
        return f"{shown}\n{counts}{area}"


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
    exclude : days "YYYY-MM-DD" to leave out, as event days were in the paper (sec. 2); they are not read.
    progress : whether to show a bar over the days.
    parameters : single values in place of those of `settings` and `recipe`, such as area or unit.

    Returns
    -------
    An `Extraction`.  Its table gives the status of each day; a day that fails does not stop the others.

    Raises
    ------
    DataError : there is no such file or parameter.
    StorageError : the folder cannot be made, holds files that szlib did not write, or holds the input.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=20))
    >>> days = szlib.extract_days(plaza, out="days", min_speed=0.5, progress=False)
    >>> days.samples()["encounter"].nunique() > 0
    True
    """
    read_names = {each.name for each in fields(Recipe)} - {"area"}
    others = {
        name: value for name, value in parameters.items() if name not in read_names
    }
    settings = (settings or EncounterSettings()).with_parameters(others)
    folder = Path(out)
    excluded = (
        (exclude,) if isinstance(exclude, str) else tuple(sorted(map(str, exclude)))
    )
    files = sorted({file.resolve() for file in datasets.find(paths)})
    reading = {k: v for k, v in parameters.items() if k in read_names}
    recipe = find_recipe(files, recipe, **reading)
    claim_folder(folder, PURPOSE, inputs=files)
    days = _group_by_day(files, recipe)
    included = [
        (day, of_day) for day, of_day in sorted(days.items()) if day not in excluded
    ]
    given, contents = settings, {}
    shared = [each for each in included if has_calendar(each[0]) or len(included) == 1]
    for day, of_day in shared:
        with suppress(
            SzlibError
        ):  # the first day with an area; computing a day that fails says why
            settings, contents[day] = find_area(of_day, settings, recipe)
            break
    rows = [
        _row(day, of_day, status="excluded")
        for day, of_day in days.items()
        if day in excluded
    ]
    tasks = [
        joblib.delayed(extract_day)(
            day,
            of_day,
            str(folder.resolve()),
            settings if (day, of_day) in shared else given,
            recipe,
            contents.get(day),
        )
        for day, of_day in included
    ]
    with tqdm(total=len(tasks), unit="day", disable=None if progress else True) as bar:
        for row in run_tasks(tasks, n_jobs=n_jobs):
            rows.append(row)
            bar.update()
            bar.set_postfix_str(f"{row['day']} {row['status']}")
    sources = {row["day"]: row.pop("source") for row in rows}
    table = pd.DataFrame(rows).sort_values("day", ignore_index=True)
    is_one = shared == included or given.area == settings.area
    settings = settings if is_one else given
    area = settings.area if isinstance(settings.area, Area) else None
    return Extraction(folder, table, excluded, sources, area, settings, recipe)


def _group_by_day(files: Sequence[Path], recipe: Recipe) -> dict[str, list[str]]:
    """The files of each day, or of each recording that has no calendar day."""
    days: dict[str, list[str]] = {}
    for file, name in zip(files, name_recordings(files), strict=True):
        days.setdefault(find_day(file, recipe) or printable(name), []).append(str(file))
    return days


def extract_day(
    day: str,
    files: Sequence[str],
    out: str,
    settings: EncounterSettings,
    recipe: Recipe,
    contents: list[Any] | None = None,
) -> dict[str, Any]:
    """Compute one `day` from its `files`, or load it from the folder `out`; return its row of the table.

    `settings` and `recipe` as in `extract_days`.  The files must begin on this day, and have the `contents`
    in which the area was found, if they are given.  Days share nothing but `out`.
    """
    start = time.perf_counter()
    row, folder, paths = (
        _row(day, files, status="failed"),
        Path(out),
        [Path(file) for file in files],
    )
    try:
        # Checksums are computed while the files are read.
        with unchanged_files(paths), ThreadPoolExecutor(1) as thread:
            source = thread.submit(
                copy_context().run, describe_source, files, settings, recipe
            )
            is_stored, status = (folder / f"{day}.parquet").is_file(), "kept"
            samples = load_day(folder, day, source.result()) if is_stored else None
            if samples is None:
                status = "done"
                # The table and the funnel count the rejected rows.
                with warnings.catch_warnings(action="ignore", category=DataWarning):
                    samples = find_encounters_in_files(paths, settings, recipe)
            begins = {find_day(path, recipe) or day for path in paths}
        if begins != {day} or contents not in (None, source.result()["files"]):
            raise DataError(
                f"{paths[0]}: changed after its day or the area was found; extract the day again"
            )
        row["source"] = source.result()
        if status == "done":
            content = samples.to_parquet(index=False)
            store_cached(folder / f"{day}.parquet", content, source.result())
        read = [
            stage
            for stage in funnels.get(samples)
            if stage["stage"].startswith("read ")
        ]
        row |= {
            "status": status,
            "rows": sum(stage["entered"] for stage in read),
            "unusable": sum(stage["entered"] - stage["kept"] for stage in read),
            "encounters": int(samples["encounter"].nunique()),
            "samples": len(samples),
            "why": "; ".join(funnels.warnings(funnels.get(samples))),
        }
    except SzlibError as error:
        row["why"] = printable(error)
    except Exception as error:  # whatever fails in one day, the others go on
        row["why"] = printable(f"{type(error).__name__}: {error}")
    return row | {"seconds": time.perf_counter() - start}


def _row(day: str, files: Sequence[str], status: str) -> dict[str, Any]:
    counts = dict.fromkeys(("rows", "unusable", "encounters", "samples"), 0)
    row = {"day": day, "status": status, "files": len(files), **counts}
    return row | {"seconds": 0.0, "why": "", "source": {}}

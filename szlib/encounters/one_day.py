"""One day: from its files to its encounters, whole in memory or near the area only, and the cached result."""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pandas as pd

from .. import __version__
from ..core.errors import DataError, DataWarning
from ..core.files import load_cached, store_cached
from ..core.input_files import file_content, unchanged_files
from ..tracks import funnels
from ..tracks.clock import read_tracks, to_clock
from ..tracks.readers import find_format
from ..tracks.recipe import Recipe
from .areas import AUTO, area_for, as_area, place_apart
from .finding import find_encounters
from .geometry import Area, AttentionalSpace, Region, Square
from .near_rows import read_near_area, select_near_rows
from .samples import no_samples
from .settings import EncounterSettings

# With fewer encounters, what relaxing a condition would give is stated (assumed: in 22 of the ETH
# sequence no zone is found).
FEW_ENCOUNTERS = 60
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
    with unchanged_files(files):
        area = known_area(settings, files, recipe)
        raw = read_near_area(
            files, area=area, duration=settings.duration, recipe=recipe
        )
    tracks = to_clock(raw, max_gap=recipe.max_gap) if len(raw) else raw
    if len(tracks) == 0:
        return funnels.attach(no_samples(), funnels.get(tracks))
    return find_encounters(tracks, settings=replace(settings, area=area or AUTO))


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
    if isinstance(settings.area, Square | Region):
        return settings.area
    areas = {find_format(file, recipe).area for file in files}
    known = areas.pop() if settings.area is None and len(areas) == 1 else None
    return as_area(known) if known and known != AUTO else None


def relax_conditions(
    samples: pd.DataFrame, tracks: pd.DataFrame, settings: EncounterSettings
) -> str:
    """What relaxing one condition of an encounter would give, where few are found: a sentence.

    `samples` were found in the `tracks` with the `settings`.  The first condition named costs most.
    """
    count, area = samples["encounter"].nunique(), as_area(samples.attrs["area"])
    settings, near = (
        replace(settings, area=area),
        select_near_rows(tracks, area, settings.duration),
    )
    space, half = settings.space, max(settings.steps // 2 / 10, 0.1)
    small = replace(
        space, width=round(space.width / 2, 1), length=round(0.6 * space.length, 1)
    )
    size = f"{small.width:g} m x {small.length:g} m"
    relaxed: dict[str, dict[str, Any]] = {
        f"an attentional space of {size} (space_width, space_length)": {"space": small},
        "a space that may reach beyond the outline, if this is a wall (has_walls)": {
            "has_walls": True
        },
        f"windows of {half:g} s (duration)": {"duration": half},
        "any distance at the opening (min_distance)": {"min_distance": 0.0},
        f"people of {settings.min_speed / 2:g} m/s (min_speed)": {
            "min_speed": settings.min_speed / 2
        },
    }
    found = [
        (
            find_encounters(near, settings=replace(settings, **change))[
                "encounter"
            ].nunique(),
            name,
        )
        for name, change in relaxed.items()
        if len(near)
    ]
    more = "; ".join(
        f"{name}: {n:,} encounters"
        for n, name in sorted(found, reverse=True)
        if n > count
    )
    return f"{count} encounters are few; one condition relaxed gives {f'more: {more}' if more else 'no more'}"


def require_encounters(samples: pd.DataFrame, advice: str = "") -> pd.DataFrame:
    """Return the `samples` if there are any; else raise DataError: the stage that rejected everything, why,
    and what to do, with the `advice` of `relax_conditions`."""
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
        + (f"; {advice}" if advice else "")
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


def store_day(
    folder: Path, day: str, samples: pd.DataFrame, source: Mapping[str, Any]
) -> None:
    """Write the `samples` of a `day` to `folder`, with the `source` they are made of."""
    content = io.BytesIO()
    samples.to_parquet(content, index=False)
    store_cached(folder / f"{day}.parquet", content.getvalue(), source)


def load_day(
    folder: Path, day: str, source: Mapping[str, Any] | None
) -> pd.DataFrame | None:
    """The samples of a `day` in `folder`; None if missing, damaged, or made of another `source`."""
    content = load_cached(folder / f"{day}.parquet", source)
    return None if content is None else pd.read_parquet(io.BytesIO(content))

"""The shapes of files that have a name: how each is recognised, and the `Recipe` that reads it.

A new shape is one entry in `shapes.toml` beside this file.  A file that is no table also has a function here
that makes one of it.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
from polars import selectors

from ..core.checks import check_columns, require
from ..core.errors import DataError, SzlibError, warn
from ..core.input_files import reading
from .recipe import Recipe
from .sources import (
    Source,
    find_separator,
    open_frame,
    open_table,
    open_text,
    read_text,
    split_line,
)

# Central square of the ATC mall, (lowest, highest) x and y [m] (assumed; free of pillars, walls and queues).
ATC_AREA = ((-18.5, -7.5), (-10.0, 8.0))
# Sessions of THOR-MAGNI are nearer to each other than this share of the usual step of the clock.
_SESSION = 0.5

# Frames a second of EWAP files: ETH; hotel, zara and students.  A track ends after so many sampling intervals
# without a sample: 0.9 s where samples are 0.4 s apart.
_EWAP_RATES, _EWAP_GAP = (15.0, 25.0), 2.25
# A rate needs so many steps of at least this length [m], and is at most this share off.
_EWAP_STEPS, _EWAP_STEP, _EWAP_ERROR = 10, 0.02, 0.1
_VADERE_RATE = (
    10.0  # frames a second to which PedPy brings footsteps: those of the clock
)

# The table of a file, and the values of a recipe that the file states.
Parsed = tuple[pl.DataFrame | pd.DataFrame | Source, dict[str, Any]]


@dataclass(frozen=True)
class Shape:
    """A kind of files: an entry of `shapes.toml`.

    Attributes
    ----------
    name : of the shape.
    recipe : how it is read; values that users give are taken before.
    begins : regular expression for the first two lines; its named groups stand in braces in columns.
    file : regular expression for the name of the file.
    header : names that are in its header.
    n_fields : number of fields of a row without header.
    has_header : whether the first line names the columns; None looks at it.
    parse : what makes a table of the file: a name in `PARSERS`, or of a loader of PedPy.
    is_sequence : whether each file is a recording of its own, without a calendar.
    is_streamed : whether files are too large to be read as a whole.
    is_sure : whether units and columns cannot be others.

    Examples
    --------
    >>> import szlib
    >>> from szlib.tracks.shapes import SHAPES
    >>> SHAPES["ngsim"].recipe.unit
    'ft'
    """

    name: str
    recipe: Recipe
    begins: str = ""
    file: str = ""
    header: Collection[str] = ()
    n_fields: int = 0
    has_header: bool | None = None
    parse: str = ""
    is_sequence: bool = False
    is_streamed: bool = False
    is_sure: bool = False

    def open(
        self, plain: Path, path: Path, recipe: Recipe, size: int | None = None
    ) -> tuple[Source, Recipe]:
        """The table of the unpacked file `plain`, given as `path`, and the `recipe` completed by the file.

        Of a text only `size` bytes are read.
        """
        where, n = f"{path}", self.n_fields
        if not self.parse:
            has_header = False if n else self.has_header
            return open_text(
                plain, where, has_header=has_header, n_fields=n, size=size
            ), recipe
        reader, advice = "szlib", "fetch it again"
        try:
            if self.parse in PARSERS:
                table, stated = PARSERS[self.parse](plain, path, recipe)
                recipe = recipe.over(Recipe(**stated))
            else:
                reader, advice = "PedPy", _PEDPY_ADVICE
                table, stated = _load_by_pedpy(self.parse, plain, path, recipe)
                recipe = Recipe(**stated).over(recipe)
            if isinstance(table, Source):
                return table, recipe
            return open_table(table, where), recipe
        except SzlibError:
            raise
        except Exception as error:  # of any library that a reader uses
            fault = f"{type(error).__name__}: {error}".replace(str(plain), path.name)
            raise DataError(
                f"{path}: {reader} cannot read it as {self.name} ({' '.join(fault.split())}); {advice}"
            ) from error


def _read_shapes() -> dict[str, Shape]:
    text = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
    return {
        name: Shape(name, Recipe(**entry.pop("recipe", {})), **entry)
        for name, entry in tomllib.loads(text).items()
    }


SHAPES = _read_shapes()
"""Shapes by name, in the order of recognition; "tidy" is any other table."""


def require_format(recipe: Recipe) -> None:
    """Raise DataError where the format in the `recipe` has no entry in `SHAPES`."""
    known, given = list(SHAPES), recipe.file_format
    require(given is None or given in SHAPES, "file_format", given, f"one of {known}")


def recognise(head: str, path: Path, recipe: Recipe) -> Shape:
    """The shape in the `recipe`, or else that of a file `path` whose first two lines are `head`."""
    require_format(recipe)
    first = head.partition("\n")[0].strip()
    fields = split_line(first, find_separator(first))
    named = recipe.names_people
    fitting = (
        shape
        for shape in SHAPES.values()
        if not (named and "id" in (shape.recipe.columns or {}) and not shape.parse)
        and set(shape.header) <= set(fields)
        and re.match(shape.begins, head, re.MULTILINE)
        and re.match(shape.file, path.name)
    )
    shape = SHAPES[recipe.file_format] if recipe.file_format else next(fitting)
    found = re.match(shape.begins, head, re.MULTILINE)
    if not (found and found.groupdict()):
        return shape
    sums = shape.recipe.columns or {}
    sums = {k: str(v).format_map(found.groupdict()) for k, v in sums.items()}
    return replace(shape, recipe=replace(shape.recipe, columns=sums))


# --- files that are no tables -------------------------------------------------------------------------


def _parse_splines(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """UCY's splines: each person's control points x, y [pixels from the middle], frame, direction."""
    lines, rows = iter(read_text(plain, f"{path}").splitlines()), list[list[Any]]()
    for person in range(1, int(next(lines).split()[0]) + 1):
        for _point in range(int(next(lines).split()[0])):
            rows.append([person, *next(lines).split()[:3]])
    return pl.DataFrame(rows, schema=["id", "x", "y", "frame"], orient="row"), {}


def _parse_ewap(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """EWAP counts frames: their rate follows from the displacement in a frame, and the velocity."""
    source, given = open_text(plain, f"{path}", has_header=False), recipe.frame_rate
    columns = {"frame": 0, "id": 1, "x": 2, "y": 4, "vx": 5, "vy": 7}
    texts = pl.DataFrame({name: source.column(k) for name, k in columns.items()})
    rows = texts.cast(pl.Float64, strict=False)
    rows = rows.filter(pl.all_horizontal(pl.all().is_finite())).sort("id", "frame")
    x, y, vx, vy, frames = map(pl.col, ("x", "y", "vx", "vy", "frame"))
    steps = rows.select(
        pl.col("frame", "x", "y").diff().over("id"),
        pl.col("vx", "vy").rolling_mean(2).over("id"),
    ).filter(frames > 0)
    length = x**2 + y**2
    far = steps.filter(length > _EWAP_STEP**2)
    rates = far.select((x * vx + y * vy) * frames / length).to_series()
    median = rates.median() if len(rates) >= _EWAP_STEPS else 0.0
    near = [r for r in _EWAP_RATES if abs(median - r) < _EWAP_ERROR * r]  # type: ignore[operator]
    if given is None and not near:
        raise DataError(
            f"{path}: the frame rate cannot be estimated from the file's velocities; pass frame_rate=15 "
            "(ETH) or 25 (hotel, zara, students), or what the video has"
        )
    rate = given or near[0]
    if near and abs(rate - near[0]) > _EWAP_ERROR * near[0]:
        warn(
            f"{path.name}: read at {rate:g} frames/s as given; its velocities suggest {near[0]:g}"
        )
    interval = steps["frame"].median()
    gap = _EWAP_GAP * interval / rate if isinstance(interval, float) else None
    return source, {"frame_rate": rate, "max_gap": gap}


def _parse_trajnet(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """TrajNet++: a JSON object a line; a scene states the samples a second.  Predictions are no tracks."""
    text = read_text(plain, f"{path}")
    lines = [json.loads(line) for line in text.splitlines() if line]
    rates = [line["scene"].get("fps", 2.5) for line in lines if "scene" in line]
    tracks = [line["track"] for line in lines if "track" in line]
    rows = [each for each in tracks if each.get("prediction_number") is None]
    table = pd.DataFrame(rows)[["f", "p", "x", "y"]].drop_duplicates(["f", "p"])
    frames = np.unique(table["f"])
    step = np.diff(frames).min() if len(frames) > 1 else 1.0
    return table, {"frame_rate": float(step * min(rates, default=2.5))}


def _parse_pathfinder(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """JSON of Pathfinder: an object of people, each an object of times.

    PedPy reads it as well, but rounds the number of frames a second: 2.5 becomes 2, and people slow.
    """
    rows = [
        (t, person, at["position"]["x"], at["position"]["y"])
        for person, times in json.loads(read_text(plain, f"{path}")).items()
        for t, at in times.items()
    ]
    return pl.DataFrame(rows, schema=["t", "id", "x", "y"], orient="row"), {}


def _parse_magni(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """THOR-MAGNI: a helmet is worn by different people one after the other."""
    return read_magni_rows(plain, path), {}


def read_magni_rows(plain: Path, path: Path) -> pd.DataFrame:
    """Rows of THOR-MAGNI as t, x, y, session, label, id, from file `plain`, given as `path`.

    id = 100 * session + helmet, both from 1.  Raises DataError where a column is missing, or a helmet has no
    number.
    """
    with reading(path, "as CSV", "a file of THOR-MAGNI"):
        rows = pd.read_csv(plain)
    check_columns(rows, list(SHAPES["magni"].header))
    times = np.unique(rows["Time"])
    step = np.diff(times)
    begins = times[1:][step < _SESSION * np.median(step)] if len(step) else times[:0]
    session = np.searchsorted(begins, rows["Time"], side="right")
    helmet = rows["ag_id"].astype(str).str.extract(r"(\d+)$")[0]
    if helmet.isna().any():
        name = rows.loc[helmet.isna(), "ag_id"].iloc[0]
        raise DataError(
            f"{path}: ag_id {name!r} ends in no number; expected one like Helmet_4"
        )
    people = rows.rename(columns={"Time": "t", "data_label": "label"})
    people["id"] = 100 * (session + 1) + helmet.astype(int)
    return people.assign(session=session)[["t", "session", "x", "y", "label", "id"]]


def _parse_wide(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """A table with columns x1, y1, x2, y2, ...: two for each person; a blank is nobody."""
    source = open_text(plain, f"{path}")
    table = pl.DataFrame({n: source.column(k) for k, n in enumerate(source.names)})
    places = selectors.matches(r"(?i)^[xy]_?\d+$")
    name = pl.col("variable")
    long = table.with_row_index("row").unpivot(places, index=~places)
    long = long.filter(pl.col("value") != "").with_columns(
        id=name.str.extract(r"(\d+)$"), variable=name.str.head(1).str.to_lowercase()
    )
    rows = long.pivot("variable", index=selectors.exclude("variable", "value"))
    return replace(open_frame(rows, f"{path}"), decimal=source.decimal), {}


def _parse_level_x(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """The inD family: whom a track belongs to, and the frame rate, are in files beside it."""
    table, stated = pl.read_csv(plain, infer_schema=False), dict[str, Any]()
    if "_tracks." not in path.name:
        return table, {}
    beside = (
        path.with_name(path.name.replace("_tracks.", f"_{name}."))
        for name in ("tracksMeta", "recordingMeta")
    )
    kinds, recording = beside
    if recording.is_file():
        rates = pl.read_csv(recording, infer_schema=False)["frameRate"]
        stated["frame_rate"] = float(rates[0])
    if kinds.is_file():
        people = pl.read_csv(kinds, infer_schema=False).select("trackId", "class")
        table = table.join(people, "trackId", "left", maintain_order="left")
        stated["where"] = "class = 'pedestrian'"
    return table, stated


def _parse_nuscenes(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """nuScenes: annotations; times, scenes and kinds are in files beside them."""

    def load(name: str) -> dict[str, Any]:
        """The objects of a file, by token."""
        file = path.with_name(name)
        expected = f"the {name} of the same version, beside {path.name}"
        with reading(file, "as nuScenes", expected):
            return {each["token"]: each for each in json.loads(read_text(file, name))}

    samples, instances, kinds = map(
        load, ("sample.json", "instance.json", "category.json")
    )
    rows = []
    for each in json.loads(read_text(plain, f"{path}")):
        sample, person = samples[each["sample_token"]], each["instance_token"]
        kind = kinds[instances[person]["category_token"]]["name"]
        if kind.startswith("human"):
            t, scene = 1e-6 * sample["timestamp"], sample["scene_token"]
            rows.append((t, person, *each["translation"][:2], scene))
    return pl.DataFrame(rows, schema=["t", "id", "x", "y", "day"], orient="row"), {}


PARSERS: dict[str, Callable[[Path, Path, Recipe], Parsed]] = {
    "splines": _parse_splines, "ewap": _parse_ewap, "trajnet": _parse_trajnet, "magni": _parse_magni,
    "pathfinder": _parse_pathfinder, "wide": _parse_wide, "level_x": _parse_level_x,
    "nuscenes": _parse_nuscenes,
}  # fmt: skip
_PEDPY_ADVICE = (
    "if the file does not state them, pass frame_rate= and unit='m' or 'cm'; if it is another format, pass "
    "file_format="
)


def _load_by_pedpy(loader: str, plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """The rows that function `loader` of PedPy gives, and frames a second."""
    try:
        import pedpy
    except ImportError as error:
        raise DataError(
            f"{path}: is read by PedPy: pip install 'szlib[pedpy]' ({error})"
        ) from error
    given: dict[str, Any] = {}
    if loader == "txt":
        units = pedpy.TrajectoryUnit
        known = {None: None, "m": units.METER, "cm": units.CENTIMETER}
        got = recipe.scale or recipe.unit
        if got not in known:
            raise DataError(
                f"{path}: is juelich-text, which is in 'm' or 'cm'; got unit {got!r}"
            )
        given = {"default_frame_rate": recipe.frame_rate, "default_unit": known[got]}
    elif recipe.frame_rate is not None or recipe.has_places:
        stated = "states its frame rate and is in metres"
        raise DataError(f"{path}: {stated}; leave frame_rate, unit and scale out")
    elif loader == "vadere":
        given = {"frame_rate": _VADERE_RATE}
    load = getattr(pedpy, f"load_trajectory_from_{loader}")
    loaded = load(trajectory_file=plain, **given)
    if not (rate := float(loaded.frame_rate)) > 0:
        raise ValueError(f"it states {rate:g} frames/s; expected a positive number")
    rows = pd.DataFrame(loaded.data)[["frame", "id", "x", "y"]]
    return rows, {"frame_rate": rate, "unit": "m"}

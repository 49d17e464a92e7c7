"""The shapes of files that have a name: how each is recognised, and the `Recipe` that reads it.

A new shape is one entry of `SHAPES`: names of its header, or how it begins, and a recipe.  A file that is no
table also has a function that makes one of it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl

from ..core.checks import check_columns, require
from ..core.errors import DataError, SzlibError, warn
from ..core.input_files import reading
from .recipe import Recipe
from .sources import (
    Source,
    find_separator,
    is_number,
    open_frame,
    open_text,
    read_text,
    split_line,
)

# Central square of the ATC mall, (lowest, highest) x and y [m] (assumed; free of pillars, walls and queues).
ATC_AREA = ((-18.5, -7.5), (-10.0, 8.0))
_ATC_TEXT = "-18.5 -7.5 -10 8"
# Days of LaCE-LHMP, whose files MMDD.csv may count from midnight; and of all recordings [s since 1970].
ATC_YEAR, _ATC_FILES = (
    2012,
    ["1024", "1028", "1031", "1104", "1107", "1111", "1114", "1118", "1121", "1125"],
)
_ATC_TIMES = (1_350_000_000.0, 1_390_000_000.0)
# Sessions of THOR-MAGNI are nearer to each other than this share of the usual step of the clock.
_SESSION = 0.5
_MAGNI = ("Time", "ag_id", "x", "y", "data_label")

# Frames a second of EWAP files: ETH; hotel, zara and students.  A track ends after so many sampling intervals
# without a sample: 0.9 s where samples are 0.4 s apart.
_EWAP_RATES, _EWAP_GAP = (15.0, 25.0), 2.25
# A rate needs so many steps of at least this length [m], and is at most this share off.
_EWAP_STEPS, _EWAP_STEP, _EWAP_ERROR = 10, 0.02, 0.1

# The table of an unpacked file, given as a path and read with a recipe; and this recipe, completed.
Parsed = tuple[pl.DataFrame | pd.DataFrame | Source, Recipe]


@dataclass(frozen=True)
class Shape:
    """A kind of files.

    Attributes
    ----------
    name : of the shape.
    recipe : how it is read; values that users give are taken before.
    begins : pattern of the first line.
    header : names that are in its header.
    n_fields, separator : of a first line of numbers.
    has_header : whether the first line names the columns; None looks at it.
    parse : makes a table of the file.
    reader, advice : what `parse` uses, and what to do where it fails.
    is_sequence : whether each file is a recording of its own, without a calendar.
    is_streamed : whether files are too large to be read as a whole.
    """

    name: str
    recipe: Recipe = field(default_factory=Recipe)
    begins: bytes = b""
    header: frozenset[str] = frozenset()
    n_fields: int = 0
    separator: str = ","
    has_header: bool | None = None
    parse: Callable[[Path, Path, Recipe], Parsed] | None = None
    reader: str = "szlib"
    advice: str = "fetch it again"
    is_sequence: bool = False
    is_streamed: bool = False

    def recognises(self, head: bytes, path: Path) -> bool:
        """Whether a file `path` with the first line `head` has this shape."""
        if self.begins:
            return re.match(self.begins, head) is not None
        first = head.decode("utf-8", errors="replace").strip()
        fields = split_line(
            first, self.separator if self.n_fields else find_separator(first)
        )
        if self.header:
            return self.header <= set(fields)
        return (
            len(fields) == self.n_fields
            and all(map(is_number, fields))
            and self._has_times(fields, path)
        )

    def _has_times(self, fields: list[str], path: Path) -> bool:
        """Whether the first time is one of the mall's, where other data can have as many numbers in a row."""
        if self.name != "atc-1hz":
            return True
        low, high = _ATC_TIMES
        return low < float(fields[0]) < high or path.name.split(".")[0] in _ATC_FILES

    def open(
        self, plain: Path, path: Path, recipe: Recipe, size: int | None = None
    ) -> tuple[Source, Recipe]:
        """The table of the unpacked file `plain`, given as `path`, and the `recipe` completed by the file.

        Of a text only `size` bytes are read.
        """
        if self.parse is None:
            n_fields = max(self.n_fields, 0)
            where, has_header = f"{path}", False if n_fields else self.has_header
            return open_text(
                plain, where, has_header=has_header, n_fields=n_fields, size=size
            ), recipe
        try:
            table, recipe = self.parse(plain, path, recipe)
            if isinstance(table, pd.DataFrame):
                table = pl.from_pandas(table.reset_index(drop=True), nan_to_null=False)
            if isinstance(table, pl.DataFrame):
                table = open_frame(table, f"{path}")
            return table, recipe
        except SzlibError:
            raise
        except Exception as error:  # of any library that a reader uses
            fault = f"{type(error).__name__}: {error}".replace(str(plain), path.name)
            raise DataError(
                f"{path}: {self.reader} cannot read it as {self.name} ({' '.join(fault.split())}); "
                f"{self.advice}"
            ) from error


# --- files that are no tables -------------------------------------------------------------------------


def _parse_splines(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """UCY's splines: each person's control points x, y [pixels from the middle], frame, direction."""
    lines, rows = (
        iter(read_text(plain, f"{path}").splitlines()),
        list[tuple[Any, ...]](),
    )
    for person in range(1, int(next(lines).split()[0]) + 1):
        for _point in range(int(next(lines).split()[0])):
            x, y, frame, *_rest = next(lines).split()
            rows.append((float(frame), person, float(x), float(y)))
    return pd.DataFrame(rows, columns=["frame", "id", "x", "y"]), recipe


def _parse_ewap(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """EWAP counts frames: their rate follows from the displacement in a frame, and the velocity."""
    source, given = open_text(plain, f"{path}", has_header=False), recipe.frame_rate
    columns = {"frame": 0, "id": 1, "x": 2, "y": 4, "vx": 5, "vy": 7}
    texts = pl.DataFrame({name: source.column(k) for name, k in columns.items()})
    rows = texts.cast(pl.Float64, strict=False)
    rows = rows.filter(pl.all_horizontal(pl.all().is_finite())).sort("id", "frame")
    steps = rows.select(
        pl.col("frame", "x", "y").diff().over("id"),
        pl.col("vx", "vy").rolling_mean(2).over("id"),
    ).filter(pl.col("frame") > 0)
    x, y = pl.col("x"), pl.col("y")
    length = x**2 + y**2
    rates = steps.filter(length > _EWAP_STEP**2).select(
        (x * pl.col("vx") + y * pl.col("vy")) * pl.col("frame") / length
    )
    median = rates.median().item() if rates.height >= _EWAP_STEPS else 0.0
    near = [r for r in _EWAP_RATES if abs(median - r) < _EWAP_ERROR * r]
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
    return source, recipe.over(Recipe(frame_rate=rate, max_gap=gap))


def _parse_trajnet(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """TrajNet++: a JSON object a line; a scene states the samples a second.  Predictions are no tracks."""
    lines = [
        json.loads(line) for line in read_text(plain, f"{path}").splitlines() if line
    ]
    rates = [line["scene"].get("fps", 2.5) for line in lines if "scene" in line]
    tracks = [line["track"] for line in lines if "track" in line]
    rows = pd.DataFrame(
        [each for each in tracks if each.get("prediction_number") is None]
    )
    rows = rows[["f", "p", "x", "y"]].set_axis(["frame", "id", "x", "y"], axis=1)
    rows = rows.drop_duplicates(["frame", "id"])
    frames = np.unique(rows["frame"])
    step = float(np.diff(frames).min()) if len(frames) > 1 else 1.0
    return rows, recipe.over(Recipe(frame_rate=step * float(min(rates, default=2.5))))


def _parse_pathfinder(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """JSON of Pathfinder: an object of people, each an object of times.

    PedPy reads it as well, but rounds the number of frames a second: 2.5 becomes 2, and people slow.
    """
    rows = [
        (float(t), int(person), float(at["position"]["x"]), float(at["position"]["y"]))
        for person, times in json.loads(read_text(plain, f"{path}")).items()
        for t, at in times.items()
    ]
    return pd.DataFrame(rows, columns=["t", "id", "x", "y"]), recipe


def _parse_magni(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """THOR-MAGNI: a helmet is worn by different people one after the other."""
    return read_magni_rows(plain, path)[["t", "id", "x", "y"]], recipe


def read_magni_rows(plain: Path, path: Path) -> pd.DataFrame:
    """Rows of THOR-MAGNI as t, x, y, session, label, id, from file `plain`, given as `path`.

    id = 100 * session + helmet, both from 1.  Raises DataError where a column is missing, or a helmet has no
    number.
    """
    with reading(path, "as CSV", "a file of THOR-MAGNI"):
        rows = pd.read_csv(plain)
    check_columns(rows, _MAGNI)
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
    people = pd.DataFrame({"t": rows["Time"], "session": session})
    people[["x", "y", "label"]] = rows[["x", "y", "data_label"]]
    return people.assign(id=100 * (session + 1) + helmet.astype(int))


def _parse_wide(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """A table with columns x1, y1, x2, y2, ...: two for each person; a blank is nobody."""
    table = open_text(plain, f"{path}")
    names = {name.replace("_", "").casefold(): k for k, name in enumerate(table.names)}
    people = [
        name[1:]
        for name in names
        if name[0] == "x" and name[1:].isdecimal() and f"y{name[1:]}" in names
    ]
    times = [
        k
        for k, name in enumerate(table.names)
        if not re.fullmatch(r"(?i)[xy]_?\d+", name)
    ]
    head = {table.names[k]: table.column(k) for k in times}
    parts = [
        pl.DataFrame(
            head | {c: table.column(names[f"{c}{person}"]) for c in "xy"}
        ).with_columns(id=pl.lit(person))
        for person in people
    ]
    rows = pl.concat(parts).filter(
        (pl.col("x").fill_null("") != "") | (pl.col("y").fill_null("") != "")
    )
    return rows.with_columns(
        pl.col("x", "y").str.replace(",", ".", literal=True)
    ), recipe


def _parse_level_x(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """The inD family: whom a track belongs to, and the frame rate, are in files beside it."""
    table, stated = pl.read_csv(plain, infer_schema=False), dict[str, Any]()
    kinds, recording = (
        path.with_name(path.name.replace("_tracks.", each))
        for each in ("_tracksMeta.", "_recordingMeta.")
    )
    if kinds != path and recording.is_file():
        stated["frame_rate"] = float(
            pl.read_csv(recording, infer_schema=False)["frameRate"][0]
        )
    if kinds != path and kinds.is_file():
        people = pl.read_csv(kinds, infer_schema=False).select("trackId", "class")
        table, stated["where"] = (
            table.join(people, "trackId", "left", maintain_order="left"),
            "class = 'pedestrian'",
        )
    return table, recipe.over(Recipe(**stated))


def _parse_nuscenes(plain: Path, path: Path, recipe: Recipe) -> Parsed:
    """nuScenes: annotations; times, scenes and kinds are in files beside them."""

    def load(name: str) -> dict[str, Any]:
        """The objects of a file, by token."""
        with reading(
            path.with_name(name),
            "as nuScenes",
            f"the {name} of the same version, beside {path.name}",
        ):
            return {
                each["token"]: each
                for each in json.loads(read_text(path.with_name(name), name))
            }

    samples, instances, kinds = (
        load("sample.json"),
        load("instance.json"),
        load("category.json"),
    )
    rows = [
        (
            samples[each["sample_token"]]["timestamp"] * 1e-6,
            each["instance_token"],
            *each["translation"][:2],
            samples[each["sample_token"]]["scene_token"],
        )
        for each in json.loads(read_text(plain, f"{path}"))
        if kinds[instances[each["instance_token"]]["category_token"]][
            "name"
        ].startswith("human")
    ]
    return pl.DataFrame(rows, schema=["t", "id", "x", "y", "day"], orient="row"), recipe


def _load(loader: str, plain: Path, path: Path, recipe: Recipe, **given: Any) -> Parsed:
    """The rows that function `loader` of PedPy gives, and frames a second."""
    try:
        import pedpy
    except ImportError as error:
        raise DataError(
            f"{path}: is read by PedPy: pip install 'szlib[pedpy]' ({error})"
        ) from error
    if loader == "txt":
        if recipe.unit not in (None, "m", "cm") or recipe.scale is not None:
            got = recipe.unit or recipe.scale
            raise DataError(
                f"{path}: is juelich-text, which is in 'm' or 'cm'; got unit {got!r}"
            )
        unit = {
            "m": pedpy.TrajectoryUnit.METER,
            "cm": pedpy.TrajectoryUnit.CENTIMETER,
        }.get(recipe.unit or "")
        given = {"default_frame_rate": recipe.frame_rate, "default_unit": unit}
    elif recipe.frame_rate is not None or recipe.has_places:
        known = "states its frame rate and is in metres"
        raise DataError(f"{path}: {known}; leave frame_rate, unit and scale out")
    loaded = getattr(pedpy, f"load_trajectory_from_{loader}")(
        trajectory_file=plain, **given
    )
    if not (rate := float(loaded.frame_rate)) > 0:
        raise ValueError(f"it states {rate:g} frames/s; expected a positive number")
    return pd.DataFrame(loaded.data)[["frame", "id", "x", "y"]], Recipe(
        frame_rate=rate, unit="m"
    ).over(recipe)


# --- the table ----------------------------------------------------------------------------------------

_PLACES = {"id": "id", "x": "x", "y": "y"}
_FRAMES, _TIMES = (
    Recipe(columns={"frame": "frame", **_PLACES}),
    Recipe(columns={"t": "t", **_PLACES}),
)
# Vadere records footsteps; PedPy brings them to as many frames a second as the clock has ticks.  Files of old
# versions begin with their column names.
_VADERE = rb"#IDXCOL|(?=.*pedestrianId)(?=.*simTime)"
_WIDE = rb"(?i)(?!.*\b(\w*id|track|ped)\b)(?=.*\bx_?1\b)(?=.*\by_?1\b)(?=.*\bx_?2\b)(?=.*\by_?2\b)"
_pedpy = partial(
    Shape,
    recipe=_FRAMES,
    reader="PedPy",
    advice="if the file does not state them, pass frame_rate= and unit='m' or 'cm'; if it is another format, "
    "pass file_format=",
)


_BOX = {
    "x": "f2 + f4 / 2",
    "y": "f3 + f5",
}  # where somebody in a box of the MOT Challenge stands
_SHAPES = (
    Shape("vsp", Recipe(frame_rate=25.0, unit="px").over(_FRAMES), rb"\s*\d+ - the number of splines",
          parse=_parse_splines, is_sequence=True),
    Shape("trajnet", _FRAMES, rb'\s*\{"(scene|track)"', parse=_parse_trajnet, is_sequence=True),
    Shape("pathfinder", _TIMES, rb'\s*\{\s*"\d+"\s*:\s*\{', parse=_parse_pathfinder, is_sequence=True),
    Shape("nuscenes", Recipe(unit="m", columns={"t": "t", "day": "day", **_PLACES}),
          rb'\s*\[\s*\{[^}]*"instance_token"', parse=_parse_nuscenes),
    Shape("magni", Recipe(max_gap=0.9).over(_TIMES), header=frozenset(_MAGNI), parse=_parse_magni,
          is_sequence=True),
    _pedpy("jupedsim", begins=rb"SQLite format 3\0", parse=partial(_load, "jupedsim_sqlite")),
    _pedpy("juelich-hdf5", begins=rb"\x89HDF", parse=partial(_load, "ped_data_archive_hdf5")),
    _pedpy("viswalk", begins=rb"\$(VISION|PEDESTRIAN)", parse=partial(_load, "viswalk")),
    _pedpy("vadere", begins=_VADERE, parse=partial(_load, "vadere", frame_rate=10.0)),
    _pedpy("juelich-text", begins=rb"#", parse=partial(_load, "txt")),
    Shape("wide", begins=_WIDE, parse=_parse_wide),
    Shape("boxes", Recipe(unit="px", columns={"x": "(x1 + x2) / 2", "y": "(y1 + y2) / 2"}),
          header=frozenset({"x1", "y1", "x2", "y2"})),
    Shape("ind", Recipe(frame_rate=25.0, unit="m", columns={
              "frame": "frame", "id": "trackId", "x": "xCenter", "y": "yCenter", "day": "recordingId"}),
          header=frozenset({"recordingId", "trackId", "frame", "xCenter", "yCenter"}), parse=_parse_level_x),
    Shape("highd", Recipe(frame_rate=25.0, unit="m", columns={
              "frame": "frame", "id": "id", "x": "x + width / 2", "y": "y + height / 2"}),
          header=frozenset({"frame", "id", "x", "y", "width", "height", "laneId"})),
    Shape("argoverse2", Recipe(frame_rate=10.0, unit="m", where="object_type = 'pedestrian'", columns={
              "frame": "timestep", "id": "track_id", "x": "position_x", "y": "position_y",
              "day": "scenario_id"}),
          header=frozenset({"object_type", "track_id", "timestep", "position_x", "position_y"})),
    Shape("ngsim", Recipe(time_unit="ms", unit="ft", columns={
              "t": "Global_Time", "id": "Vehicle_ID", "x": "Local_X", "y": "Local_Y", "day": "Location"}),
          header=frozenset({"Vehicle_ID", "Global_Time", "Local_X", "Local_Y"})),
    Shape("opentraj", Recipe(unit="m", columns={
              "id": "agent_id", "x": "pos_x", "y": "pos_y", "day": "scene_id"}),
          header=frozenset({"agent_id", "pos_x", "pos_y", "scene_id"})),
    Shape("sdd", Recipe(frame_rate=30.0, unit="px", where="f9 = 'Pedestrian' AND f6 = '0'", columns={
              "id": 0, "frame": 5, "x": "(f1 + f3) / 2", "y": "(f2 + f4) / 2"}),
          rb'(\d+ ){6}[01] [01] [01] "?\w+"?\s*$', has_header=False),
    Shape("mot-truth", Recipe(unit="px", where="f7 = '1'", columns={"frame": 0, "id": 1, **_BOX}),
          n_fields=9),
    Shape("mot", Recipe(unit="px", columns={"frame": 0, "id": 1, **_BOX}), n_fields=10),
    Shape("petrack", Recipe(columns={"id": 0, "frame": 1, "x": 2, "y": 3}), n_fields=-1, has_header=False),
    Shape("atc-raw", Recipe(unit="mm", time_unit="s", max_gap=0.5, tz="Asia/Tokyo", area=_ATC_TEXT, columns={
              "t": 0, "id": 1, "x": 2, "y": 3, "speed": 5}), n_fields=8, is_streamed=True),
    Shape("atc-1hz", Recipe(time_unit="s", max_gap=1.6, tz="Asia/Tokyo", area=_ATC_TEXT, columns={
              "t": 0, "id": 1, "x": 2, "y": 3, "speed": 4}), n_fields=6),
    Shape("ewap", Recipe(columns={"frame": 0, "id": 1, "x": 2, "y": 4}), n_fields=8, separator=" ",
          parse=_parse_ewap, is_sequence=True),
    Shape("tidy"),
)  # fmt: skip
SHAPES: dict[str, Shape] = {each.name: each for each in _SHAPES}
"""Shapes by name, in the order of recognition; "tidy" is any other table."""


def require_format(recipe: Recipe) -> None:
    """Raise DataError where the format in the `recipe` has no entry in `SHAPES`."""
    known, given = list(SHAPES), recipe.file_format
    require(given is None or given in SHAPES, "file_format", given, f"one of {known}")


def recognise(head: bytes, path: Path, recipe: Recipe) -> Shape:
    """The shape in the `recipe`, or else that of a file `path` whose first line is `head`."""
    require_format(recipe)
    if recipe.file_format is not None:
        return SHAPES[recipe.file_format]
    own = {"id", "x", "y"} <= set(recipe.columns or ())
    candidates = [each for each in SHAPES.values() if each.parse or not own]
    found = (each for each in candidates if each.recognises(head, path))
    return next(found, SHAPES["tidy"])

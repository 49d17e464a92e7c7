"""Files that are no tables of text, and tables of other libraries, as columns.

A file whose shape in `shapes.toml` has a key `parse` is read by a function here, or by a loader of PedPy.
"""

from __future__ import annotations

import json
import sqlite3
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.dataset  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]
from polars import Series, col, selectors

from ..core.checks import check_columns
from ..core.errors import DataError, SzlibError
from ..core.input_files import explain_errors, reading
from .recipe import SHAPES, Recipe, Shape
from .sources import File, Source, check_size, open_text

# Central square of the ATC mall, (lowest, highest) x and y [m] (assumed; free of pillars, walls and queues).
ATC_AREA = ((-18.5, -7.5), (-10.0, 8.0))
# rows that are read before the size of all is checked, of a table and of a database
_ROWS_AT_ONCE = 4096
_VALUES_AT_ONCE = 100
# Sessions of THOR-MAGNI are nearer to each other than this share of the usual step of the clock.
_SESSION = 0.5

# Frames a second of EWAP files: ETH; hotel, zara and students.
_EWAP_RATES = (15.0, 25.0)
# The rate follows from steps of at least this length [m], and is at most this share off.
_EWAP_STEP = 0.02
_EWAP_ERROR = 0.1
# Frames a second to which PedPy brings footsteps: those of the clock.
_VADERE_RATE = 10.0
_PEDPY_ADVICE = (
    "if the file does not state them, pass frame_rate= and unit='m' or 'cm'; if it is another format, pass "
    "file_format="
)

# The table of a file, and the values of a recipe that the file states.
ParsedFile = tuple[pl.DataFrame | pd.DataFrame | Source, dict[str, Any]]


def open_shape(shape: Shape, file: File) -> tuple[Source, Recipe]:
    """The table of a `file` of a `shape`, and its recipe completed by what the file states."""
    recipe = file.recipe
    n = shape.n_fields
    if not shape.parse:
        return open_text(file, False if n else shape.has_header, n), recipe
    advice = "fetch it again"
    try:
        if shape.parse in PARSERS:
            table, stated = PARSERS[shape.parse](file)
            recipe = recipe.over(Recipe(**stated))
        else:
            advice = _PEDPY_ADVICE
            table, stated = _load_by_pedpy(shape.parse, file)
            recipe = Recipe(**stated).over(recipe)
        return open_table(table, file.path), recipe
    except SzlibError:
        raise
    except Exception as error:  # of any library that a reader uses
        fault = f"{type(error).__name__}: {error}"
        fault = " ".join(fault.replace(str(file.plain), file.path.name).split())
        raise DataError(
            f"{file.path}: cannot be read as {shape.name} ({fault}); {advice}"
        ) from error


# --- tables -------------------------------------------------------------------------------------------


def open_table(table: Any, where: Path) -> Source:
    """A `table` of another library, called `where` in messages; see `is_table`."""
    if isinstance(table, Source):
        return table
    if not isinstance(table, pd.DataFrame):
        columns = pl.DataFrame(table)
        return Source(where, columns.columns, columns.to_series)
    frame = table

    def column(at: int) -> Series:
        """A column of the table; one of mixed types as text."""
        values = frame.iloc[:, at].reset_index(drop=True)
        return Series(values.astype("string") if values.dtype.kind == "O" else values)

    return Source(where, list(map(str, frame.columns)), column)


def open_arrow(file: File) -> Source:
    """A Parquet or Feather `file`, read by pyarrow: a damaged file can make Polars abort the process."""
    kind = "Parquet" if file.head.startswith("PAR1") else "Feather"
    what = f"{file.path}: damaged {kind}"
    advice = "fetch or write the file again"
    with explain_errors(what, advice):
        is_parquet = kind == "Parquet"
        opened = (pq.ParquetFile if is_parquet else pa.ipc.open_file)(file.plain)
        schema = opened.schema_arrow if is_parquet else opened.schema
        data = pa.dataset.dataset(file.plain, schema, kind.lower())

    def column(k: int) -> Series:
        """A column of the file."""
        with explain_errors(what, advice):
            found = schema.field(k)
            batches = data.to_batches(columns=[found.name], batch_size=_ROWS_AT_ONCE)
            checked = _check_batches(
                batches, lambda batch: int(batch.nbytes), file.path
            )
            table = pa.Table.from_batches(checked, pa.schema([found]))
            table.validate(full=True)
            # without metadata
            return pl.DataFrame(pa.table({"c": table[0]})).to_series()

    return Source(file.path, schema.names, column)


def _check_batches(
    batches: Iterable[Any], measure: Callable[[Any], int], where: Path
) -> Iterator[Any]:
    """The batches of a column, as long as memory is allowed for all of them; `measure` gives their bytes."""
    size = 0
    for batch in batches:
        size += measure(batch)
        check_size(size, where, "a column")
        yield batch


def open_json(file: File) -> Source:
    """A JSON `file`: an object a line, a list of objects, or points of GeoJSON."""
    content = replace(file, size=None).text()  # a list cannot be cut
    expected = "an object a line, a list of objects, or GeoJSON of points"
    with reading(file.path, "as JSON", expected):
        if content.lstrip().startswith("["):
            rows = json.loads(content)
        elif '"FeatureCollection"' in content[:1000]:
            rows = [
                each["properties"]
                | dict(
                    zip(("lon", "lat"), each["geometry"]["coordinates"], strict=False)
                )
                for each in json.loads(content)["features"]
            ]
        else:
            rows = [json.loads(line) for line in content.splitlines() if line.strip()]
        table = pd.DataFrame(map(dict, rows), dtype=object)
    return open_table(table, file.path)


def open_database(file: File) -> list[Source]:
    """The tables of a SQLite `file`; none where it is damaged.  Nothing is written, not even a journal."""
    path = file.path
    journal = path.with_name(f"{path.name}-wal")
    if journal.is_file() and journal.stat().st_size:
        raise DataError(
            f"{path}: {journal.name} holds changes that are not in the file yet; close the program that "
            f"writes it, or run: sqlite3 {path.name} 'PRAGMA wal_checkpoint(TRUNCATE)'"
        )
    address = f"{file.plain.absolute().as_uri()}?mode=ro&immutable=1"

    def query(text: str, k: int) -> Iterator[Any]:
        """The values of column `k` that a query gives, as text, as long as memory is allowed for them."""
        with closing(sqlite3.connect(address, uri=True)) as database:
            database.text_factory = lambda content: content.decode(errors="replace")
            rows = database.execute(text)
            values = (None if row[k] is None else str(row[k]) for row in rows)
            some = iter(lambda: [*islice(values, _VALUES_AT_ONCE)], [])
            yield from chain.from_iterable(
                _check_batches(some, lambda each: sum(map(sys.getsizeof, each)), path)
            )

    def open_one(table: str) -> Source:
        """One of the tables; its values as text.

        One query gives every column: with an index, another one gives its rows in another order.
        """
        names = [*query(f'PRAGMA table_xinfo("{table}")', 1)]
        columns = ", ".join(f'"{name}"' for name in names)
        select = f'SELECT {columns} FROM "{table}"'
        return Source(path, names, lambda k: Series(query(select, k), dtype=pl.String))

    try:
        names = query("SELECT name FROM sqlite_master WHERE type = 'table'", 0)
        return [*map(open_one, names)]
    except sqlite3.DatabaseError:
        return []


# --- shapes that have a parser ------------------------------------------------------------------------


def _parse_ewap(file: File) -> ParsedFile:
    """EWAP counts frames: their rate follows from the distance walked in a frame, and the speed."""
    source = open_text(file, has_header=False)
    columns = {"frame": 0, "id": 1, "x": 2, "y": 4, "vx": 5, "vy": 7}
    texts = pl.DataFrame({name: source.column(k) for name, k in columns.items()})
    steps = texts.cast(pl.Float64, strict=False).sort("id", "frame")
    steps = steps.select(col("frame", "x", "y").diff().over("id"), "vx", "vy")
    length, speed = (
        (col(a) ** 2 + col(b) ** 2).sqrt() for a, b in (("x", "y"), ("vx", "vy"))
    )
    rates = steps.filter(length > _EWAP_STEP).select(speed * col.frame / length)
    median = rates.to_series().quantile(0.5) or 0.0
    near = [each for each in _EWAP_RATES if abs(median / each - 1) < _EWAP_ERROR]
    return source, {"frame_rate": near[0]} if near else {}


def _parse_trajnet(file: File) -> ParsedFile:
    """TrajNet++: a JSON object a line; a scene states the samples a second.  Predictions are left out."""
    lines = [json.loads(line) for line in file.text().splitlines() if line]
    rates = [line["scene"].get("fps", 2.5) for line in lines if "scene" in line]
    tracks = [line["track"] for line in lines if "track" in line]
    is_seen = [each.get("prediction_number") is None for each in tracks]
    table = pd.DataFrame(tracks)[is_seen][["f", "p", "x", "y"]].drop_duplicates()
    frames = np.unique(table["f"])
    step = np.diff(frames).min() if len(frames) > 1 else 1.0
    return table, {"frame_rate": float(step * min(rates, default=2.5))}


def read_magni_rows(path: Path, plain: Path | None = None) -> pd.DataFrame:
    """Rows of THOR-MAGNI as t, x, y, session, label, id, from the file `path`, unpacked at `plain`.

    A helmet is worn by different people one after the other: id = 100 * session + helmet, both from 1.
    Raises DataError where a column is missing, or a helmet has no number.
    """
    with reading(path, "as CSV", "a file of THOR-MAGNI"):
        rows = pd.read_csv(plain or path)
        check_columns(rows, list(SHAPES["magni"].header))
        helmet = rows["ag_id"].astype(str).str.extract(r"(\d+)$")[0]
    if helmet.isna().any():
        raise DataError(
            f"{path}: ag_id {rows.loc[helmet.isna(), 'ag_id'].iloc[0]!r} ends in no number; expected one "
            "like Helmet_4"
        )
    times = np.unique(rows["Time"])
    step = np.diff(times)
    begins = times[1:][step < _SESSION * np.median(step)] if len(step) else times[:0]
    session = np.searchsorted(begins, rows["Time"], side="right")
    people = rows.rename(columns={"Time": "t", "data_label": "label"})
    people["id"] = 100 * (session + 1) + helmet.astype(int)
    return people.assign(session=session)[["t", "session", "x", "y", "label", "id"]]


def _parse_wide(file: File) -> ParsedFile:
    """A table with columns x1, y1, x2, y2, ...: two for each person; a blank field means an absent person."""
    source = open_text(file)
    table = pl.DataFrame({n: source.column(k) for k, n in enumerate(source.names)})
    places = selectors.matches(r"(?i)^[xy]_?\d+$")
    long = table.with_row_index("row").unpivot(places, index=~places)
    long = long.filter(col.value != "").with_columns(
        id=col.variable.str.extract(r"(\d+)$"),
        variable=col.variable.str.head(1).str.to_lowercase(),
    )
    rows = long.pivot("variable", index=selectors.exclude("variable", "value"))
    # a row that is too short lacks the last people
    is_long = source.column(len(source.names)) != ""
    ragged = is_long.gather(rows["row"])
    found = open_table(rows, file.path)
    return replace(found, decimal=source.decimal, ragged=ragged), {}


def _parse_level_x(file: File) -> ParsedFile:
    """The inD family: kinds of tracks, such as pedestrian, and the frame rate are in files beside it."""
    table = pl.read_csv(file.plain, infer_schema=False)
    stated = dict[str, Any]()
    stem, _, ending = file.path.name.partition("_tracks.")
    recording = file.path.with_name(f"{stem}_recordingMeta.{ending}")
    kinds = file.path.with_name(f"{stem}_tracksMeta.{ending}")
    if recording.is_file():
        rates = pl.read_csv(recording, infer_schema=False)["frameRate"]
        stated["frame_rate"] = float(rates[0])
    if kinds.is_file():
        rows = pl.read_csv(kinds, infer_schema=False).select("trackId", "class")
        table = table.join(rows, "trackId", "left", maintain_order="left")
        stated["where"] = "class = 'pedestrian'"
    return table, stated


def _parse_nuscenes(file: File) -> ParsedFile:
    """nuScenes: annotations; times, scenes and kinds are in files beside them."""
    tables = []
    for name in ("sample", "instance", "category"):
        place = file.path.with_name(f"{name}.json")
        expected = f"the {name}.json of the same version, beside {file.path.name}"
        with reading(place, "as nuScenes", expected):
            objects = json.loads(replace(file, plain=place).text())
            tables.append({each["token"]: each for each in objects})
    samples, instances, kinds = tables
    rows = []
    for each in json.loads(file.text()):
        sample = samples[each["sample_token"]]
        person = each["instance_token"]
        kind = kinds[instances[person]["category_token"]]["name"]
        if kind.startswith("human"):
            begin = 1e-6 * sample["timestamp"], person, *each["translation"][:2]
            rows.append((*begin, sample["scene_token"]))
    return pl.DataFrame(rows, schema=["t", "id", "x", "y", "day"], orient="row"), {}


PARSERS: dict[str, Callable[[File], ParsedFile]] = {
    "ewap": _parse_ewap,
    "trajnet": _parse_trajnet,
    "magni": lambda file: (read_magni_rows(file.path, file.plain), {}),
    "wide": _parse_wide,
    "level_x": _parse_level_x,
    "nuscenes": _parse_nuscenes,
}


def _load_by_pedpy(loader: str, file: File) -> ParsedFile:
    """The rows that function `loader` of PedPy gives, and frames a second."""
    path = file.path
    recipe = file.recipe
    with explain_errors(
        f"{path}: PedPy is missing", "install it: pip install 'szlib[pedpy]'"
    ):
        import pedpy
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
    elif recipe.frame_rate is not None or recipe.has_metres:
        raise DataError(
            f"{path}: states its frame rate and is in metres; leave frame_rate, unit and scale out"
        )
    elif loader == "vadere":
        given = {"frame_rate": _VADERE_RATE}
    load = getattr(pedpy, f"load_trajectory_from_{loader}")
    loaded = load(trajectory_file=file.plain, **given)
    stated = {"frame_rate": float(loaded.frame_rate), "unit": "m"}
    return pd.DataFrame(loaded.data)[["frame", "id", "x", "y"]], stated

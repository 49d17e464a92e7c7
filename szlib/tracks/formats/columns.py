"""Which column of a table holds what: by the names given, by usual names, or by how people would walk."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import TypeVar

import numpy as np
import polars as pl

from ...core.errors import DataError
from ..motion import find_walking
from ..options import FRAMES, UNITS, ReadOptions, advise
from .base import TrackFormat
from .values import to_ids, to_numbers, to_times

# Usual names of each quantity, without blanks, underscores and accents; the first one is taken before others.
_USUAL = {
    "t": "t time times timestamp timestamps datetime sec seconds zeit uhrzeit zeitstempel sekunden temps "
    "horodatage secondes tiempo tempo tijd czas время 時刻 時間 时间 時間戳 시간",
    "frame": "frame frames frameid framenumber frameno framenr frameindex bild bildnummer image trame "
    "fotograma кадр フレーム フレーム番号 帧 프레임",
    "id": "id pid ped pedid pedestrian pedestrianid person personid personnr agent agentid track trackid "
    "traj trajid trajectory trajectoryid object objectid objid participant subject fußgänger fußgängerid "
    "personne piéton identifiant persona peatón pessoa pedone человек 人 人物 人物id 歩行者 歩行者id "
    "行人 行人id 보행자",
    "x": "x posx xpos positionx xposition xcoord coordx xcoordinate centerx x座標 x坐标",
    "y": "y posy ypos positiony yposition ycoord coordy ycoordinate centery y座標 y坐标",
    "day": "day",
}
_SECONDS = {
    "s": 1.0,
    "sec": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
}  # in a unit of time
_PIXELS = ("px", "pixel", "pixels")
_RECORDINGS = frozenset({
    "recording", "recordingid", "scene", "sceneid", "camera", "cameraid", "cam", "session", "sessionid",
    "sequence", "sequenceid", "video", "videoid", "date", "run", "runid", "trial", "trialid", "experiment",
    "clip", "place", "location", "locationid", "site", "dataset",
})  # fmt: skip
# people have so many rows under each value that tells recordings apart
_LONGEST_SHARE = 5
_GUESSED = 6  # number of columns that are tried out, as whose people walk
_Format = TypeVar("_Format", bound=TrackFormat)


def find_columns(
    layout: _Format,
    names: Sequence[str],
    options: ReadOptions,
    where: str,
    sample: Callable[[], pl.DataFrame],
) -> _Format:
    """Complete the format of a table with its columns, and with the units that their names state.

    Parameters
    ----------
    layout : the format.
    names : names of all columns; empty texts where the table has no header.
    options : how it is read.
    where : the beginning of an error message.
    sample : gives the first rows, in which columns are guessed for an error message.

    Raises
    ------
    DataError : a column is missing, doubled or ambiguous, frames have no rate, or pixels no scale; it says
        which columns look like what.
    """
    given, keys = dict(options.columns or {}), [_split_unit(name) for name in names]
    numbered = [k for k in given.values() if isinstance(k, int)]
    if beyond := [k for k in numbered if not 0 <= k < len(names)]:
        raise DataError(
            f"{where} has no field {beyond[0]}; it has {len(names)}, the first is 0"
        )
    at = {quantity: _candidates(quantity, given, names, keys) for quantity in _USUAL}
    is_free = "t" not in given and bool(at["frame"])
    has_frames = "frame" in given or (
        is_free and (not at["t"] or options.frame_rate is not None)
    )
    quantities = [
        "frame" if has_frames else "t",
        "id",
        "x",
        "y",
        *(["day"] if at["day"] else []),
    ]
    for quantity in quantities:
        same = {names[k] for k in at[quantity]}
        if len(same) > 1:
            advice = advise(columns={**given, quantity: names[at[quantity][0]]})
            raise DataError(
                f"{where}: {', '.join(sorted(same))} can all be {quantity}; {advice}"
            )
        if len(at[quantity]) > 1:
            raise DataError(f"{where} names {same.pop()} twice; rename one of them")
    found = {quantity: at[quantity][0] for quantity in quantities if at[quantity]}
    if missing := [quantity for quantity in quantities if quantity not in found]:
        lacking = ", ".join(str(given.get(quantity, quantity)) for quantity in missing)
        raise DataError(
            f"{where} has no column {lacking}; {_suggest(names, options, found, missing, sample)}"
        )
    time = found.pop("frame" if has_frames else "t")
    if has_frames and options.frame_rate is None:
        raise DataError(
            f"{where}: {names[time] or time!r} counts frames; pass frame_rate=, frames a second; of a video "
            f"with {FRAMES:g}: {advise(frame_rate=FRAMES)}"
        )
    if not has_frames and options.frame_rate is not None:
        raise DataError(
            f"{where}: is tidy, whose times are in seconds; leave frame_rate out, or name the column that "
            f"counts frames: {advise(columns={**given, 'frame': names[time] or time})}"
        )
    unit = keys[found["x"]][1] if keys[found["x"]][1] == keys[found["y"]][1] else ""
    if unit in _PIXELS and options.metres is None:
        raise DataError(
            f"{where}: positions are in pixels; pass scale=, metres in a pixel"
        )
    taken = {"frame" if has_frames else "t": time, **found}
    return replace(
        layout,
        n_fields=len(names),
        names=tuple(names),
        columns={"t": time, **found},
        metres=UNITS.get(unit, layout.metres),
        seconds=1 / options.frame_rate if options.frame_rate else 1.0,
        time_unit=1.0 if has_frames else _SECONDS.get(keys[time][1]),
        text=", ".join(
            f"{quantity} = {names[k] or k}" for quantity, k in taken.items()
        ),
    )


def ask_about_recordings(
    layout: TrackFormat,
    t: pl.Series,
    ids: pl.Series,
    column: Callable[[int], pl.Series],
    where: str,
    *,
    by_name: bool,
) -> None:
    """Raise DataError where an unused column tells recordings apart that would be mixed.

    Such a column has few values, and changes where people are at one time twice, or go back in time. With
    `by_name` one is also asked about if it has a usual name, and people are seen under several of its values.

    Parameters
    ----------
    layout : the format, with the columns that are used.
    t, ids : times and ids of all rows.
    column : gives another column.
    where : the beginning of the message.
    """
    rows = pl.DataFrame({"id": ids, "t": t})
    is_mixed = _begins_again(rows, ["id"])
    for k in sorted(set(range(layout.n_fields)) - set(layout.columns.values())):
        name = layout.names[k]
        is_usual = by_name and _split_unit(name)[0] in _RECORDINGS
        if not (is_mixed or is_usual):
            continue
        table = rows.with_columns(c=column(k).cast(pl.String))
        n_pieces = table.select("id", "c").n_unique()
        if table["c"].n_unique() < 2 or n_pieces * _LONGEST_SHARE > len(rows):
            continue
        is_shared = n_pieces > rows["id"].n_unique()
        if is_shared and (is_usual or not _begins_again(table, ["id", "c"])):
            raise DataError(
                f"{where}: column {name or k!r} changes where people or times begin again, so it seems to "
                f"tell recordings apart; {advise(columns={'day': name or k})}; "
                "if it does not, name the columns of id, x and y"
            )


def _begins_again(rows: pl.DataFrame, keys: list[str]) -> bool:
    """Whether somebody is seen twice at one time, or goes back in time, among rows of the same `keys`."""
    step = rows.select(pl.col("t").diff().over(keys)).to_series()
    return bool((step <= 0).any())


def _split_unit(name: str) -> tuple[str, str]:
    """A name without blanks, accents and capitals, and its unit: ("posx", "mm") of "Pos X [mm]"."""
    letters = unicodedata.normalize("NFKD", name.casefold())
    words = re.findall(
        r"[^\W_]+", "".join(each for each in letters if not unicodedata.combining(each))
    )
    has_unit = len(words) > 1 and words[-1] in (*UNITS, *_SECONDS, *_PIXELS)
    unit = words.pop() if has_unit else ""
    return "".join(words), unit


def _candidates(
    quantity: str,
    given: Mapping[str, str | int],
    names: Sequence[str],
    keys: Sequence[tuple[str, str]],
) -> list[int]:
    """The columns that can hold a quantity: the one given, those with its name, or with a usual one."""
    name = given.get(quantity, quantity)
    if isinstance(name, int):
        return [name]
    exact = [k for k, each in enumerate(names) if each == name]
    usual = {_split_unit(each)[0] for each in _USUAL[quantity].split()}
    return exact or (
        []
        if quantity in given
        else [k for k, (key, _) in enumerate(keys) if key in usual]
    )


def _suggest(
    names: Sequence[str],
    options: ReadOptions,
    found: Mapping[str, int],
    missing: Sequence[str],
    sample: Callable[[], pl.DataFrame],
) -> str:
    """As which columns people would walk, and how to read them."""
    quantities = ("frame" if "frame" in (*found, *missing) else "t", "id", "x", "y")
    rows = sample()
    free = [k for k in range(rows.width) if k not in found.values()][:_GUESSED]
    numbers = {k: _as_floats(rows.to_series(k)) for k in [*found.values(), *free]}
    usable = [
        k
        for k, values in numbers.items()
        if np.isfinite(values).sum() * 2 > rows.height
    ]
    known = {
        quantities.index(q): usable.index(k)
        for q, k in found.items()
        if q in quantities and k in usable
    }
    stated = {UNITS[unit] for _, unit in map(_split_unit, names) if unit in UNITS} | {
        options.metres
    } - {None}
    readings = product(
        (FRAMES,) if quantities[0] == "frame" else (1.0, FRAMES),
        stated or UNITS.values(),
    )
    given = dict(options.columns or {})
    for rate, metres in readings if usable else ():
        values = np.array([numbers[k] for k in usable])
        if order := find_walking(values, known, rate, metres or 1.0):
            time = "t" if rate == 1 else "frame"
            shown = [names[usable[k]] or usable[k] for k in order]
            columns = {**given, **dict(zip((time, "id", "x", "y"), shown, strict=True))}
            unit = next(
                (
                    name
                    for name, each in UNITS.items()
                    if each == metres != 1 and not stated
                ),
                None,
            )
            more = {"frame_rate": None if rate == 1 else rate, "unit": unit}
            advice = advise(
                columns=columns,
                **{name: value for name, value in more.items() if value},
            )
            return f"people walk if these are {columns}; {advice}"
    listed = (
        ", ".join(map(repr, filter(None, names[:12])))
        or f"{len(names)} fields without a header"
    )
    named = {**given, **dict.fromkeys(missing, "...")}
    return f"it has {listed}; {advise(columns=named)}"


def _as_floats(values: pl.Series) -> np.ndarray:
    """A column as floats, whatever it holds: numbers, times, or texts of which each gets a number."""
    for numbers in (to_numbers(values), to_times(values, "UTC").seconds):
        if 2 * numbers.null_count() <= len(values):
            return numbers.fill_null(np.nan).to_numpy()
    return to_ids(values).cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy()

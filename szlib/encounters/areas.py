"""Areas: one in any form (`as_area`), or the area in which people walked everywhere (`walked_area`)."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import shapely
from scipy.ndimage import distance_transform_edt
from shapely.geometry.base import BaseGeometry

from ..core.checks import check_columns
from ..core.errors import DataError, warn
from ..core.input_files import printable, read_small, reading
from ..tracks import funnels
from ..tracks.clock import COLUMNS
from .geometry import PAPER_SPACE, Area, AttentionalSpace, Square

AUTO = "auto"  # stands for the area that `walked_area` finds
EXPECTED = (
    'expected "X0 X1 Y0 Y1" in metres, a polygon as well-known text or GeoJSON, a file of one of these, or '
    f'"{AUTO}"'
)

# People walked everywhere where at least so many walked on each cell of this width [m] (measured: it finds
# the rectangle of the ATC mall that was found by eye, and the hall of Grand Central; 1 m misses pillars).
_CELL, _PEOPLE = 0.5, 3
# While the median visited cell saw no more people, cells are doubled, up to this width [m]: with few people
# a cell is empty by chance (measured on plazas of 100 to 2,600 encounters).
_SPARSE, _WIDEST = 4 * _PEOPLE, 2.0
_WALKING = 0.4  # a slower person [m/s] stands, queues or sits (paper: 0.4 for a reference pedestrian)
# 3 s of walking [m], for which a rectangle is longer than the attentional space
_BEHIND = 3 * 1.2
# A rectangle that is narrower than this number of lengths of the space, and smaller than this share of the
# place, wastes encounters (assumed; measured on small rooms and oblique views).
_WIDE, _MAIN = 2.0, 2 / 3
_MOST_CELLS = 400  # largest number of cells along an axis; cells grow with the site
_APART = 50.0  # least distance of recordings that are placed side by side [m]
_OUTLYING = 1e-3  # share of positions on either side that does not belong to the site: trackers jump
# A spot can be seen unless a disc of this radius [m] in which nobody was seen covers it (assumed: as wide as
# gaps that few people leave).  Each cell has so many parts along each axis, for which that is decided.
_EMPTY, _PARTS = 2.0, 5


def as_area(area: object) -> Area:
    """Convert an area in any form; the text ``str(area)`` gives the same area again.

    Parameters
    ----------
    area : an `Area`; a Shapely polygon; an object with a ``polygon`` (PedPy's ``WalkableArea``
        and ``MeasurementArea``); four numbers x0, x1, y0, y1; or text: these numbers, well-known text,
        GeoJSON, or the path of a file of one of these.  All in metres, in the frame of the tracks.

    Raises
    ------
    DataError : `area` has another form, is not valid, or has no inside.

    Examples
    --------
    >>> import szlib
    >>> szlib.as_area("0 12 0 8")
    Area(x=(0.0, 12.0), y=(0.0, 8.0), area=96.0)
    >>> szlib.as_area("POLYGON ((0 0, 12 0, 12 8, 0 0))").area
    48.0
    """
    if isinstance(area, Area):
        return area
    if isinstance(area, Path) or (isinstance(area, str) and not _is_area(area)):
        return _from_file(Path(area))
    if isinstance(area, str):
        return _from_text(area.strip())
    if hasattr(area, "polygon"):
        area = area.polygon
    if hasattr(area, "geom_type"):
        return Area(area)
    if isinstance(area, list | tuple | np.ndarray):
        return _from_numbers(area)
    raise DataError(
        f"{type(area).__name__} is no area; {EXPECTED}, an Area, a Shapely polygon or PedPy's"
    )


def area_for(
    tracks: pd.DataFrame, area: object, space: AttentionalSpace = PAPER_SPACE
) -> Area:
    """Convert `area` as `as_area` does; "auto" stands for the `walked_area` of the `tracks` for a `space`."""
    if not (isinstance(area, str) and area.strip() == AUTO):
        return as_area(area)
    places = _find_places(tracks)
    if len(set(places.values())) < 2:
        return walked_area(tracks, space=space)
    groups = tracks.groupby(tracks["day"].astype(str).map(places))
    found = {name: walked_area(part, space=space) for name, part in groups}
    reasons = "; ".join(
        f"{name or 'days'}: {each.reason}" for name, each in found.items()
    )
    return Area(
        shapely.union_all([each.polygon for each in found.values()]),
        f"for each recording, side by side along x: {reasons}",
    )


def place_apart(tracks: pd.DataFrame) -> pd.DataFrame:
    """Move recordings without a calendar apart along x, so that each can have an area of its own.

    Days of a calendar stay where they are: they are of one place.  Where `tracks` are of one place, they are
    returned themselves.
    """
    places = _find_places(tracks)
    if len(set(places.values())) < 2:
        return tracks
    place = tracks["day"].astype(str).map(places)
    offsets, end = {}, None
    for name, (low, high) in tracks.groupby(place)["x"].agg(["min", "max"]).iterrows():
        offsets[name] = 0 if end is None else int(np.ceil(end + _APART) - np.floor(low))
        end = high + offsets[name]
    return tracks.assign(x=tracks["x"] + place.map(offsets))


def has_calendar(day: object) -> bool:
    """Whether a `day` is a date, not the name of a recording."""
    return re.match(r"\d{4}-\d\d-\d\d", str(day)) is not None


def _find_places(tracks: pd.DataFrame) -> dict[str, str]:
    """The name of the place of each day: that of a recording; empty for days of a calendar."""
    return {
        str(day): "" if has_calendar(day) else str(day)
        for day in tracks["day"].unique()
    }


def walked_area(
    tracks: pd.DataFrame,
    *,
    space: AttentionalSpace = PAPER_SPACE,
) -> Area:
    """Find the largest rectangle along the axes in which people walked everywhere, or the place's outline.

    Everywhere means: on each square cell of 0.5 m at least three people walked, at 0.4 m/s or faster.
    The attentional space can turn in the rectangle.  Where few people walked, or such a rectangle is missing,
    or narrow and a small part of the place (small rooms, corridors, oblique views), the area is the outline
    of the place where people were seen.  It may hold spots where nobody walked (furniture, pillars), of
    which a DataWarning states the share if many people walked: look at the map
    (`plots.plot_map`, beside the notebooks).

    The area never reaches outside where people can be seen: where people were seen, and in gaps between
    them that are narrower than 4 m.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks`.
    space : the attentional space that must fit in.

    Returns
    -------
    The area; its `reason` says what was taken, and why.

    Raises
    ------
    DataError : nobody walks, people were seen on lines only, or the table lacks a column.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> szlib.walked_area(szlib.read_tracks(plaza)).reason
    'the outline of the place where people were seen, as few people walked'
    """
    check_columns(tracks, COLUMNS)
    walks = tracks[np.hypot(*tracks[["vx", "vy"]].to_numpy(float).T) >= _WALKING]
    if len(walks) == 0:
        raise DataError(
            f"nobody walks at {_WALKING} m/s or faster in these tracks: no area can be found"
        )
    count, corner, fine = _count_people(walks, _CELL)
    seen = _find_seen_parts(tracks, corner, fine, count.shape)
    middle, lowest, width = (
        corner[:, None, None] + fine * (np.indices(count.shape) + 0.5),
        corner,
        fine,
    )
    while (
        is_sparse := np.median(count[count > 0]) <= _SPARSE
    ) and 2 * width <= _WIDEST:
        count, lowest, width = _count_people(walks, 2 * width)
    walked = (count >= _PEOPLE)[
        tuple(((middle - lowest[:, None, None]) // width).astype(int))
    ]
    first, end = _largest_rectangle(
        walked, int(np.ceil(np.hypot(space.length, space.width) / fine))
    )
    first, end = _trim(seen, _PARTS * first, _PARTS * end)
    part, sides = fine / _PARTS, fine / _PARTS * (end - first)
    is_main = (
        sides.min() >= _WIDE * space.length
        or sides.prod() >= _MAIN * part**2 * seen.sum()
    )
    if not is_sparse and is_main and sides.max() >= space.length + _BEHIND:
        (x0, x1), (y0, y1) = (
            (corner + part * np.stack([first, end])).round(6).T.tolist()
        )
        everywhere = f"on each cell of {width:g} m at least {_PEOPLE} people walked"
        return replace(
            Square((x0, x1), (y0, y1)),
            reason=f"the largest rectangle in which {everywhere}",
        )
    outline = _outline(seen, corner, part, space)
    if outline.is_empty:
        implausible = "".join(
            f"{text}; " for text in funnels.warnings(funnels.get(tracks))
        )
        raise DataError(
            f"{implausible}no area was found: people were seen in no place as wide as the attentional "
            f"space, {space.width:g} m x {space.length:g} m; use more data, pass a smaller space, or give "
            f"the area yourself: {EXPECTED}"
        )
    middles = seen[_PARTS // 2 :: _PARTS, _PARTS // 2 :: _PARTS]
    if not is_sparse and (share := 1 - walked[middles].mean()) > 0:
        warn(
            f"in {share:.0%} of the area found ({outline.area:.0f} m2) fewer than {_PEOPLE} people walked, "
            "perhaps for furniture, pillars or walls: look at the map, and give a better area if you know one"
        )
    why = (
        "few people walked"
        if is_sparse
        else "there is no large rectangle in which people walked"
    )
    return Area(outline, f"the outline of the place where people were seen, as {why}")


def _find_seen_parts(
    tracks: pd.DataFrame, corner: np.ndarray, cell: float, shape: tuple[int, ...]
) -> np.ndarray:
    """Whether people can be seen on each part of the cells, of which `_PARTS` x `_PARTS` make one."""
    size, empty = _PARTS * np.array(shape), int(_EMPTY * _PARTS / cell)
    place = ((tracks[["x", "y"]].to_numpy(float) - corner) // (cell / _PARTS)).astype(
        np.int64
    )
    place = place[((place >= 0) & (place < size)).all(axis=1)]
    parts = np.zeros(size + 2 * empty + 2, bool)
    parts[tuple(place.T + empty + 1)] = True
    covered = distance_transform_edt(~parts) <= empty
    closed = distance_transform_edt(covered) > empty
    return np.asarray(closed[empty + 1 : -empty - 1, empty + 1 : -empty - 1])


def _trim(
    seen: np.ndarray, first: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The rectangle from `first` to `end` without the lines of its border that are `seen` least."""
    first, end = first.copy(), end.copy()
    while not (inside := seen[first[0] : end[0], first[1] : end[1]]).all():
        lines = [(inside[0], first, 0, 1), (inside[:, 0], first, 1, 1)]
        lines += [(inside[-1], end, 0, -1), (inside[:, -1], end, 1, -1)]
        _, border, axis, step = min(lines, key=lambda line: line[0].mean())
        border[axis] += step
    return first, end


def _outline(
    seen: np.ndarray, corner: np.ndarray, part: float, space: AttentionalSpace
) -> BaseGeometry:
    """The outline of `seen` parts, without strips narrower than 1 m and pieces narrower than the space."""
    ends = np.diff(np.pad(seen, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (column, low), high = np.nonzero(ends == 1), np.nonzero(ends == -1)[1]
    whole, strip = (
        shapely.union_all(shapely.box(column, low, column + 1, high)),
        0.5 / part,
    )
    wide = (
        whole.buffer(-strip, join_style="mitre")
        .buffer(strip, join_style="mitre")
        .intersection(whole)
    )
    shapes = shapely.transform(
        shapely.get_parts(wide.simplify(1)), lambda points: corner + part * points
    )
    has_room = ~shapely.is_empty(shapely.buffer(shapes, -space.width / 2))
    return shapely.set_precision(shapely.union_all(shapes[has_room]), 0.01)


def _count_people(
    walks: pd.DataFrame, cell: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Number of people who walked on each cell, (nx, ny); the lowest corner [m]; the width of a cell [m]."""
    at = walks[["x", "y"]].to_numpy(float)
    low, high = np.quantile(at, [_OUTLYING, 1 - _OUTLYING], axis=0)
    while (high - low).max() / cell > _MOST_CELLS:
        cell *= 2
    first, size = np.floor(low / cell), np.floor(high / cell) - np.floor(low / cell) + 1
    place = np.floor(at / cell) - first
    within = ((place >= 0) & (place < size)).all(axis=1)
    shape = (int(size[0]), int(size[1]))
    spot = np.ravel_multi_index(tuple(place[within].T.astype(np.int64)), shape)
    person = walks.groupby(["day", "id"], observed=True).ngroup().to_numpy()[within]
    visits = np.unique(person * (shape[0] * shape[1]) + spot)
    count = np.bincount(visits % (shape[0] * shape[1]), minlength=shape[0] * shape[1])
    return count.reshape(shape), first * cell, cell


def _largest_rectangle(walked: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """The largest rectangle of cells walked on that is at least `side` wide.

    Returns its first cell and its end, each (2,); all 0 where there is none.
    """
    best, found = 0.0, (np.zeros(2, int), np.zeros(2, int))
    if min(walked.shape) < side:
        return found
    total = np.zeros((walked.shape[0] + 1, walked.shape[1] + 1))
    total[1:, 1:] = np.where(walked, 1.0, -walked.size).cumsum(axis=0).cumsum(axis=1)
    for top in range(walked.shape[0] - side + 1):
        # by last row: sums over columns from the first
        strips = total[top + side :] - total[top]
        least = np.minimum.accumulate(strips[:, :-side], axis=1)
        gain = strips[:, side:] - least
        row, column = np.unravel_index(int(gain.argmax()), gain.shape)
        if gain[row, column] > best:
            best = gain[row, column]
            left = int(np.argmax(strips[row] == least[row, column]))
            found = (
                np.array([top, left]),
                np.array([top + side + int(row), int(column) + side]),
            )
    return found


def _is_area(text: str) -> bool:
    """Whether a text is an area itself, not the path of a file."""
    number = r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?"
    numbers, polygon = (
        rf"[\s,]*{number}([\s,]+{number})*[\s,]*",
        r"\s*((MULTI)?POLYGON\b.*|\{.*)",
    )
    return bool(
        re.fullmatch(f"{numbers}|{polygon}", text, flags=re.IGNORECASE | re.DOTALL)
    )


def _from_numbers(numbers: Any) -> Area:
    try:
        x0, x1, y0, y1 = map(float, numbers)
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{printable(str(numbers)[:80])}: is no area; {EXPECTED}"
        ) from error
    return Square((x0, x1), (y0, y1))


def _from_file(path: Path) -> Area:
    """The area in a file: well-known text, GeoJSON, or four numbers."""
    with reading(path, "as an area", EXPECTED.removeprefix("expected ")):
        text = read_small(path).decode("utf-8-sig").strip()
    if not text or not _is_area(text):
        raise DataError(
            f"{printable(path)}: begins with {printable(text[:40])!r}; {EXPECTED}"
        )
    try:
        return as_area(text)
    except DataError as error:
        raise DataError(f"{printable(path)}: {error}") from error


def _from_text(text: str) -> Area:
    """The area of four numbers, well-known text or GeoJSON: all polygons of a collection in one."""
    if not re.match(r"[{MP]", text, re.IGNORECASE):
        return _from_numbers(text.replace(",", " ").split())
    is_json = text.startswith("{")
    try:
        shape = shapely.from_geojson(text) if is_json else shapely.from_wkt(text)
    except shapely.errors.ShapelyError as error:
        form = "GeoJSON" if is_json else "well-known text"
        raise DataError(
            f"{printable(text[:40])!r}: is no {form} ({error}); {EXPECTED}"
        ) from error
    if shape.geom_type == "GeometryCollection":
        parts = shapely.get_parts(shape)
        shape = shapely.union_all(parts) if len(parts) != 1 else parts[0]
    return Area(shape)

"""Which area: as it is written (`as_area`), or where people walked everywhere (`walked_area`)."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..checks import check_columns
from ..errors import DataError, DataWarning
from ..files import printable
from ..tracks.clock import COLUMNS
from .geometry import PAPER_SPACE, Area, Region, Square

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

AUTO = "auto"
"""Stands for the area that `walked_area` finds."""
EXPECTED = (
    'expected "X0 X1 Y0 Y1" in metres, a polygon as well-known text or GeoJSON, a file of one of these, or '
    f'"{AUTO}"'
)

CELL, PEOPLE = 0.5, 3
"""People walked everywhere where on each cell so wide [m] so many walked (measured: finds the rectangle of
the ATC mall that was found by eye, and the open hall of Grand Central; cells of 1 m overlook pillars)."""
TYPICAL, WIDEST = 4 * PEOPLE, 2.0
"""While the median cell where anybody walked saw no more people, cells are doubled, up to this width [m]:
with few people a cell is empty by chance (measured on plazas of 100 to 2,600 encounters)."""
WALKING = 0.4
"""Who is slower [m/s] stands, queues or sits (paper: 0.4 for a reference pedestrian)."""
NARROWEST = float(np.hypot(PAPER_SPACE.length, PAPER_SPACE.width))
"""In less [m] the attentional space cannot turn."""
SHORTEST = PAPER_SPACE.length + 3 * 1.2
"""The space, and 3 s of walking behind it [m]."""
_LOSS = 2.0
"""Where no rectangle is wide enough, a cell where nobody walked costs as much as so many are worth (measured
on THOR-MAGNI, a laboratory with furniture, and ETH, an entrance: 16 % and 8 % of their areas)."""
_MOST_CELLS = 400
"""Along each axis; cells grow with the site."""
_REAL_TRACKS = 1e-3
"""This share of positions on either side is left out of the site's extent: trackers jump."""


def as_area(area: object) -> Area:
    """An area in one form, whatever it was given as; its text ``str(area)`` gives the same area again.

    Parameters
    ----------
    area : a `Square` or `Region`; a Shapely polygon; what has a ``polygon`` (PedPy's ``WalkableArea`` and
        ``MeasurementArea``); four numbers x0, x1, y0, y1; or text: these numbers, well-known text, GeoJSON,
        or the path of a file of one of these.  All in metres, in the frame of the tracks.

    Returns
    -------
    A `Square` where the area is a rectangle along the axes, else a `Region`.

    Raises
    ------
    DataError : it is none of these, is not valid, or has no inside.
    """
    if isinstance(area, Square | Region):
        return area
    if isinstance(area, Path) or (isinstance(area, str) and not _is_area(area)):
        return _from_file(Path(area))
    if isinstance(area, str):
        text = area.strip()
        if text[0] == "{":
            return _from_geojson(text)
        return Region(text).simplest() if text[0].isalpha() else _from_numbers(text.replace(",", " ").split())
    if hasattr(area, "polygon"):
        area = area.polygon
    if hasattr(area, "geom_type"):
        return _from_shape(area)
    if isinstance(area, list | tuple | np.ndarray):
        return _from_numbers(area)
    raise DataError(f"{type(area).__name__} is no area; {EXPECTED}, a Square, a Shapely polygon or PedPy's")


def area_for(tracks: pd.DataFrame, area: object) -> Area:
    """`as_area`, but for "auto", which is the `walked_area` of these tracks."""
    return walked_area(tracks) if isinstance(area, str) and area.strip() == AUTO else as_area(area)


def walked_area(tracks: pd.DataFrame, *, cell: float | None = None, people: int = PEOPLE) -> Square:
    """The largest rectangle along the axes in which people walked everywhere, wide enough to watch them in.

    Everywhere means: on each square `cell` [m] at least `people` different people walked, at `WALKING`
    or faster.  The rectangle is at least `NARROWEST` wide and `SHORTEST` long: the attentional space can turn
    in it.  Where there is none, the area may hold places where nobody walked (furniture, pillars, walls),
    each of which counts against it, and a DataWarning says how much of it they are: look at the map
    (`szlib.workbook.figures.plot_map`) before you use it.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks`.
    cell, people : see above; by default the cell is `CELL`, or wider where few people walked (`TYPICAL`);
        it grows with sites wider than 200 m.

    Raises
    ------
    DataError : there is no such rectangle, or the table lacks a column.
    """
    check_columns(tracks, COLUMNS)
    if not ((cell is None or 0.05 <= cell < np.inf) and people >= 1):
        raise DataError(f"expected cell >= 0.05 m and people >= 1; got {cell} m, {people}")
    walks = tracks[np.hypot(*tracks[["vx", "vy"]].to_numpy(float).T) >= WALKING]
    if len(walks) == 0:
        raise DataError(f"nobody walks at {WALKING} m/s or faster in these tracks: no area can be found")
    count, corner, width = _counted(walks, cell or CELL)
    while cell is None and np.median(count[count > 0]) <= TYPICAL and 2 * width <= WIDEST:
        count, corner, width = _counted(walks, 2 * width)
    walked, cell = count >= people, width
    side = int(np.ceil(NARROWEST / cell))
    rows, columns, share = _largest(walked, side, np.inf)
    if cell * max(rows[1] - rows[0], columns[1] - columns[0]) < SHORTEST:
        rows, columns, share = _largest(walked, side, _LOSS)
    (i0, i1), (j0, j1) = rows, columns
    if cell * max(i1 - i0, j1 - j0) < SHORTEST:
        far = cell * np.array(walked.shape)
        raise DataError(
            f"no area was found: within the {far[0]:g} m x {far[1]:g} m of these tracks there is no "
            f"rectangle of {NARROWEST:.1f} m x {SHORTEST:.1f} m in which {people} people walked on nearly "
            f"every spot of {cell:g} m; more data may have one, or give the area yourself: {EXPECTED}"
        )
    x, y = (tuple(float(c + cell * k) for k in ends) for c, ends in zip(corner, (rows, columns), strict=True))
    found = Square((x[0], x[1]), (y[0], y[1]))
    if share < 1:
        warnings.warn(
            f"in {1 - share:.0%} of the area found ({found}) nobody walked, perhaps for furniture, pillars "
            "or walls: look at the map, and give a better area if you know one",
            DataWarning, stacklevel=2,
        )  # fmt: skip
    return found


def _counted(walks: pd.DataFrame, cell: float) -> tuple[np.ndarray, np.ndarray, float]:
    """How many people walked on each cell, (nx, ny); the lowest corner [m]; the side of a cell [m]."""
    at = walks[["x", "y"]].to_numpy(float)
    low, high = np.quantile(at, [_REAL_TRACKS, 1 - _REAL_TRACKS], axis=0)
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


def _largest(walked: np.ndarray, side: int, loss: float) -> tuple[tuple[int, int], tuple[int, int], float]:
    """The rectangle with the most cells walked on, less `loss` for each other one; at least `side` wide.

    Its rows (first, end), its columns (first, end), and the share walked on; all 0 where there is none.
    """
    none = (0, 0), (0, 0), 0.0
    if min(walked.shape) < side:
        return none
    total = np.zeros((walked.shape[0] + 1, walked.shape[1] + 1))
    total[1:, 1:] = np.where(walked, 1.0, -min(loss, walked.size)).cumsum(axis=0).cumsum(axis=1)
    best, found = 0.0, none
    for top in range(walked.shape[0] - side + 1):
        strips = total[top + side :] - total[top]  # by last row: sums over columns from the first
        least = np.minimum.accumulate(strips[:, :-side], axis=1)
        gain = strips[:, side:] - least
        row, column = np.unravel_index(int(gain.argmax()), gain.shape)
        if gain[row, column] > best:
            left = int(np.argmax(strips[row] == least[row, column]))
            rows, columns = (top, top + side + int(row)), (left, int(column) + side)
            best = gain[row, column]
            found = rows, columns, float(walked[slice(*rows), slice(*columns)].mean())
    return found


def _is_area(text: str) -> bool:
    """Whether a text is an area itself, not the path of a file."""
    wkt = r"(MULTI)?POLYGON\b.*|\{.*"
    return bool(re.fullmatch(wkt, text.strip(), flags=re.IGNORECASE | re.DOTALL)) or _all_numbers(text)


def _all_numbers(text: str) -> bool:
    parts = text.replace(",", " ").split()
    return bool(parts) and all(
        re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", part, re.I) for part in parts
    )


def _from_numbers(numbers: Any) -> Square:
    try:
        x0, x1, y0, y1 = map(float, numbers)
    except (TypeError, ValueError) as error:
        raise DataError(f"{printable(str(numbers)[:80])}: is no area; {EXPECTED}") from error
    return Square((x0, x1), (y0, y1))


def _from_file(path: Path) -> Area:
    """The area in a file: well-known text, GeoJSON, or four numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig").strip()
    except (OSError, ValueError) as error:
        raise DataError(
            f"{printable(path)}: is no area, and no file that can be read ({error}); {EXPECTED}"
        ) from error
    if not text or not _is_area(text):
        raise DataError(f"{printable(path)}: begins with {printable(text[:40])!r}; {EXPECTED}")
    try:
        return as_area(text)
    except DataError as error:
        raise DataError(f"{printable(path)}: {error}") from error


def _from_geojson(text: str) -> Area:
    """All polygons of a GeoJSON geometry, feature or collection, in one."""
    import shapely

    try:
        known = json.loads(text)
        shapes = [shapely.from_geojson(json.dumps(each)) for each in _geometries(known)]
    except (ValueError, KeyError, TypeError, shapely.errors.ShapelyError) as error:
        raise DataError(f"{printable(text[:40])!r}: is no GeoJSON ({error}); {EXPECTED}") from error
    return _from_shape(shapely.union_all(shapes) if len(shapes) != 1 else shapes[0])


def _geometries(known: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    if known["type"] == "FeatureCollection":
        return [geometry for feature in known["features"] for geometry in _geometries(feature)]
    return [known["geometry"]] if known["type"] == "Feature" else [known]


def _from_shape(shape: BaseGeometry) -> Area:
    import shapely

    return Region(shapely.to_wkt(shapely.force_2d(shape), rounding_precision=-1)).simplest()

"""Areas: one in any form (`as_area`), or the area in which people walked everywhere (`walked_area`)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..checks import check_columns
from ..errors import DataError, warn
from ..input_files import printable, read_small, reading
from ..tracks import funnels
from ..tracks.clock import COLUMNS
from .geometry import PAPER_SPACE, Area, Region, Square

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

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
# The attentional space cannot turn in a narrower rectangle [m].
_MIN_WIDTH = float(np.hypot(PAPER_SPACE.length, PAPER_SPACE.width))
_MIN_LENGTH = PAPER_SPACE.length + 3 * 1.2  # the space, and 3 s of walking behind it [m]
# Where no rectangle is wide enough, a cell where nobody walked costs as much as this number of other cells
# is worth (measured on THOR-MAGNI, a laboratory with furniture, and ETH, an entrance: 16 % and 8 %).
_LOSS = 2.0
_MOST_CELLS = 400  # largest number of cells along an axis; cells grow with the site
_OUTLYING = 1e-3  # share of positions on either side that does not belong to the site: trackers jump


def as_area(area: object) -> Area:
    """Convert an area in any form; the text ``str(area)`` gives the same area again.

    Parameters
    ----------
    area : a `Square` or `Region`; a Shapely polygon; an object with a ``polygon`` (PedPy's ``WalkableArea``
        and ``MeasurementArea``); four numbers x0, x1, y0, y1; or text: these numbers, well-known text,
        GeoJSON, or the path of a file of one of these.  All in metres, in the frame of the tracks.

    Returns
    -------
    A `Square` where the area is a rectangle along the axes, else a `Region`.

    Raises
    ------
    DataError : `area` has another form, is not valid, or has no inside.

    Examples
    --------
    >>> import szlib
    >>> szlib.as_area("0 12 0 8")
    Square(x=(0.0, 12.0), y=(0.0, 8.0))
    >>> szlib.as_area("POLYGON ((0 0, 12 0, 12 8, 0 0))").area
    48.0
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
    """Convert `area` as `as_area` does; "auto" stands for the `walked_area` of the `tracks`."""
    return walked_area(tracks) if isinstance(area, str) and area.strip() == AUTO else as_area(area)


def walked_area(tracks: pd.DataFrame, *, cell: float | None = None, n_people: int = _PEOPLE) -> Square:
    """Find the largest rectangle along the axes in which people walked everywhere.

    Everywhere means: on each square cell at least `n_people` different people walked, at 0.4 m/s or faster.
    The rectangle is so wide and long that the attentional space can turn in it.  If there is none, the area
    may hold places where nobody walked (furniture, pillars, walls).  Each of them counts against the area,
    and a DataWarning states their share: look at the map (`szlib.workbook.figures.plot_map`) before you use
    the area.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks`.
    cell : width of a cell [m]; None takes 0.5, or more where few people walked.  It grows with sites wider
        than 200 m.
    n_people : number of people who must have walked on each cell.

    Returns
    -------
    The rectangle.

    Raises
    ------
    DataError : there is no such rectangle, or the table lacks a column.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> isinstance(szlib.walked_area(szlib.read_tracks(plaza)), szlib.Square)
    True
    """
    check_columns(tracks, COLUMNS)
    if not ((cell is None or 0.05 <= cell < np.inf) and n_people >= 1):
        raise DataError(f"expected cell >= 0.05 m and n_people >= 1; got {cell} m, {n_people}")
    walks = tracks[np.hypot(*tracks[["vx", "vy"]].to_numpy(float).T) >= _WALKING]
    if len(walks) == 0:
        raise DataError(f"nobody walks at {_WALKING} m/s or faster in these tracks: no area can be found")
    count, corner, width = _count_people(walks, cell or _CELL)
    while cell is None and np.median(count[count > 0]) <= _SPARSE and 2 * width <= _WIDEST:
        count, corner, width = _count_people(walks, 2 * width)
    walked, side = count >= n_people, int(np.ceil(_MIN_WIDTH / width))
    for loss in (np.inf, _LOSS):
        first, end, share = _largest_rectangle(walked, side, loss)
        if width * (end - first).max() >= _MIN_LENGTH:
            break
    else:
        far = width * np.array(walked.shape)
        implausible = "".join(f"{text}; " for text in funnels.warnings(funnels.get(tracks)))
        raise DataError(
            f"{implausible}no area was found: within the {far[0]:g} m x {far[1]:g} m of these tracks there "
            f"is no rectangle of {_MIN_WIDTH:.1f} m x {_MIN_LENGTH:.1f} m in which {n_people} people walked "
            f"on nearly every cell of {width:g} m; use more data, or give the area yourself: {EXPECTED}"
        )
    (x0, y0), (x1, y1) = (corner + width * first).tolist(), (corner + width * end).tolist()
    found = Square((x0, x1), (y0, y1))
    if share < 1:
        warn(
            f"in {1 - share:.0%} of the area found ({found}) nobody walked, perhaps for furniture, pillars "
            "or walls: look at the map, and give a better area if you know one"
        )
    return found


def _count_people(walks: pd.DataFrame, cell: float) -> tuple[np.ndarray, np.ndarray, float]:
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


def _largest_rectangle(walked: np.ndarray, side: int, loss: float) -> tuple[np.ndarray, np.ndarray, float]:
    """The rectangle with the most cells walked on, minus `loss` for each other cell; at least `side` wide.

    Returns its first cell and its end, each (2,), and the share walked on; all 0 where there is none.
    """
    best, found = 0.0, (np.zeros(2, int), np.zeros(2, int), 0.0)
    if min(walked.shape) < side:
        return found
    total = np.zeros((walked.shape[0] + 1, walked.shape[1] + 1))
    total[1:, 1:] = np.where(walked, 1.0, -min(loss, walked.size)).cumsum(axis=0).cumsum(axis=1)
    for top in range(walked.shape[0] - side + 1):
        strips = total[top + side :] - total[top]  # by last row: sums over columns from the first
        least = np.minimum.accumulate(strips[:, :-side], axis=1)
        gain = strips[:, side:] - least
        row, column = np.unravel_index(int(gain.argmax()), gain.shape)
        if gain[row, column] > best:
            best = gain[row, column]
            left = int(np.argmax(strips[row] == least[row, column]))
            first, end = np.array([top, left]), np.array([top + side + int(row), int(column) + side])
            found = first, end, float(walked[first[0] : end[0], first[1] : end[1]].mean())
    return found


def _is_area(text: str) -> bool:
    """Whether a text is an area itself, not the path of a file."""
    number = r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?"
    numbers, polygon = rf"[\s,]*{number}([\s,]+{number})*[\s,]*", r"\s*((MULTI)?POLYGON\b.*|\{.*)"
    return bool(re.fullmatch(f"{numbers}|{polygon}", text, flags=re.IGNORECASE | re.DOTALL))


def _from_numbers(numbers: Any) -> Square:
    try:
        x0, x1, y0, y1 = map(float, numbers)
    except (TypeError, ValueError) as error:
        raise DataError(f"{printable(str(numbers)[:80])}: is no area; {EXPECTED}") from error
    return Square((x0, x1), (y0, y1))


def _from_file(path: Path) -> Area:
    """The area in a file: well-known text, GeoJSON, or four numbers."""
    with reading(path, "as an area", EXPECTED.removeprefix("expected ")):
        text = read_small(path).decode("utf-8-sig").strip()
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
        shape = shapely.from_geojson(text)
    except shapely.errors.ShapelyError as error:
        raise DataError(f"{printable(text[:40])!r}: is no GeoJSON ({error}); {EXPECTED}") from error
    if shape.geom_type == "GeometryCollection":
        parts = shapely.get_parts(shape)
        shape = shapely.union_all(parts) if len(parts) != 1 else parts[0]
    return _from_shape(shape)


def _from_shape(shape: BaseGeometry) -> Area:
    import shapely

    return Region(shapely.to_wkt(shapely.force_2d(shape), rounding_precision=-1)).simplest()

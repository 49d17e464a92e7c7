"""Walls from lines, polygons and maps: occupancy grids of ROS map_server, and other grids of cells.

The cells that are occupied are united and simplified; the outlines are the walls.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import yaml
from numpy.typing import ArrayLike
from PIL import Image
from shapely.affinity import affine_transform

from ..core.checks import Array, check_array, check_number, check_vector
from ..core.errors import DataError
from ..core.input_files import printable, read_small
from .obstacles import SHORTEST_WALL
from .settings import check_argument

_STRAIGHT = 1e-9  # angle between pieces of one straight wall [rad]
_PICTURES = "1", "L", "P", "RGB"  # modes of Pillow: of at most 8 bits, not transparent


def read_walls(walls: Any) -> Array:
    """Read walls as segments, shape (n, 2, 2) [m], in the order in which they are given.

    Parameters
    ----------
    walls : segments, shape (2, 2) each; polylines, shape (m, 2); Shapely's lines, rings, polygons and
        collections; one or many, nested in any way. The outline of a polygon and the edges of its holes are
        walls; to an `MPCCBF` it is solid, so give a room by its `exterior`. Corners of a line that are closer
        than `SHORTEST_WALL` count as one. Pieces of a straight wall, one after the other, are joined.

    Raises
    ------
    SolverError : something is no wall, or a number cannot be used.

    Examples
    --------
    >>> from szlib.control import read_walls
    >>> read_walls([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)]).shape  # a polyline of two segments
    (2, 2, 2)
    """
    lines = np.concatenate([[], *(lines for lines, _ in _find_shapes(walls))])
    check_array("a wall", shapely.get_coordinates(lines), (..., 2))
    lines = shapely.remove_repeated_points(lines, SHORTEST_WALL)
    is_long = shapely.length(lines) >= SHORTEST_WALL
    expected = f"{SHORTEST_WALL} m long or longer"
    check_argument(is_long.all(), "a wall", lines[~is_long], expected)
    corners, line = shapely.get_coordinates(lines, return_index=True)
    ends = np.stack([corners[:-1], corners[1:]], axis=1)
    return _join_pieces(ends[line[:-1] == line[1:]])


def _join_pieces(ends: Array) -> Array:
    """Segments, of which those that continue the one before on its line are joined to it."""
    ways = np.diff(ends, axis=1)[:, 0] @ (1, 1j)
    turns = ways[1:] / ways[:-1]
    is_straight = (turns.real > 0) & (np.abs(turns.imag) <= _STRAIGHT * turns.real)
    is_new = np.ones(len(ends), bool)
    is_new[1:] = ~is_straight | (ends[1:, 0] != ends[:-1, 1]).any(axis=1)
    is_last = np.append(is_new[1:], True)[: len(ends)]
    return np.stack([ends[is_new, 0], ends[is_last, 1]], axis=1)


def find_solids(walls: Any) -> Any:
    """The union of the areas that `walls` enclose, of Shapely; None if there are none."""
    found = [area for _, area in _find_shapes(walls) if area is not None]
    return shapely.union_all(found) if found else None


def _find_shapes(walls: Any) -> Iterator[tuple[Any, Any]]:
    """Lines among nested `walls`, shape (n,), each with the area that they enclose, or None; of Shapely."""
    if hasattr(walls, "geoms"):
        walls = list(walls.geoms)
    is_nested = isinstance(walls, list | tuple) and not any(map(_is_corner, walls))
    if is_nested:
        for part in walls:
            yield from _find_shapes(part)
    elif isinstance(walls, shapely.Polygon):
        yield shapely.get_parts(walls.boundary), shapely.make_valid(walls)
    elif isinstance(walls, shapely.LineString):
        yield [walls], None
    else:
        corners = check_array("a wall", walls, (...,))
        given = corners.shape
        is_line = len(given) > 1 and given[-1] == 2 and given[-2] > 1
        expected = (
            "a line of shape (m, 2), with m > 1, or segments of shape (n, 2, 2); make them of rows of four "
            "numbers by np.reshape(walls, (-1, 2, 2))"
        )
        check_argument(is_line, "a wall", given, expected)
        yield np.ravel(shapely.linestrings(corners)), None


def _is_corner(part: Any) -> bool:
    is_list = isinstance(part, list | tuple | np.ndarray)
    return is_list and all(map(np.isscalar, part))


def walls_from_map(
    path: str | Path,
    *,
    simplify: float = 0.05,
    unknown: bool = False,
) -> Array:
    """Read the map of ROS map_server in the YAML file `path`: the outlines of what is occupied.

    Parameters
    ----------
    path : the YAML file, with image (PGM or PNG, of 8 bits, not transparent), resolution, origin,
        occupied_thresh, free_thresh, and, if it is not 0, negate. Its mode is "trinary".
    simplify : as of `walls_from_grid`.
    unknown : True if unknown cells are solid as well.

    Returns
    -------
    Segments, shape (n, 2, 2) [m], in the map's frame; for `MPCCBF(walls=...)`.

    Raises
    ------
    DataError : a file cannot be read, or an entry is missing or out of its range; the message names both.
    SolverError : `simplify` is no number >= 0.

    Notes
    -----
    Cells are read as map_server does.

    Examples
    --------
    >>> import szlib
    >>> from pathlib import Path
    >>> row = bytes([254] * 8 + [0] * 12)  # free, then occupied
    >>> _ = Path("map.pgm").write_bytes(b"P5 20 4 255 " + 4 * row)
    >>> entries = "image: map.pgm", "resolution: 0.5", "origin: [0, 0, 0]"
    >>> thresholds = "occupied_thresh: 0.65", "free_thresh: 0.2"
    >>> _ = Path("map.yaml").write_text("\\n".join([*entries, *thresholds]))
    >>> walls = szlib.walls_from_map("map.yaml")
    >>> walls.min(axis=(0, 1)).tolist(), walls.max(axis=(0, 1)).tolist()
    ([4.0, 0.0], [10.0, 2.0])
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), walls=walls)
    """
    within = check_number("simplify", simplify)
    check_argument(within >= 0, "simplify", within, "at least 0")
    what = "the map"
    folder = Path(path).parent
    try:
        entries = {
            "negate": 0,
            "mode": "trinary",
            **yaml.safe_load(read_small(Path(path))),
        }
        names = "resolution", "free_thresh", "occupied_thresh"
        side, free, occupied = (check_number(name, entries[name]) for name in names)
        origin = check_array("origin", entries["origin"], (3,))
        below = f"from 0 to below occupied_thresh = {occupied}, which is at most 1"
        check_argument(0 <= free < occupied <= 1, "free_thresh", free, below)
        check_argument(
            entries["negate"] in (0, 1), "negate", entries["negate"], "0 or 1"
        )
        check_argument(
            entries["mode"] == "trinary", "mode", entries["mode"], "'trinary'"
        )
        check_argument(side > 0, "resolution", side, "positive")
        what = f"image {entries['image']!r}"
        picture = Image.open(io.BytesIO(read_small(folder / entries["image"])))
        check_argument(
            picture.mode in _PICTURES, "its mode", picture.mode, f"of {_PICTURES}"
        )
        grey = np.asarray(picture.convert("RGB"), float).mean(axis=2)
        p = (grey if entries["negate"] else 255 - grey) / 255
        is_solid = (p >= free) if unknown else (p > occupied)
        return walls_from_grid(is_solid[::-1], side, origin, simplify=within)
    # whatever YAML, Pillow and NumPy say of a bad file
    except Exception as fault:
        raise DataError(
            f"{printable(path)}: {what} cannot be read: {fault}; expected a YAML file of map_server, whole, "
            "with an opaque PGM or PNG picture"
        ) from fault


def walls_from_grid(
    occupied: ArrayLike,
    resolution: float,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    *,
    simplify: float = 0.05,
) -> Array:
    """Find the outlines of the occupied cells of a grid, as segments, shape (n, 2, 2) [m].

    Parameters
    ----------
    occupied : True where a cell is occupied, shape (rows, columns), the row of the smallest y first.
    resolution : side of a cell [m].
    origin : (x, y, yaw) of the outer corner of the first cell [m, rad].
    simplify : an outline may deviate by this much from that of the cells, by twice as much at corners [m].

    Raises
    ------
    SolverError : a number or a shape cannot be used.

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.control import walls_from_grid
    >>> walls_from_grid(np.ones((20, 40), bool), resolution=0.05).shape  # a block of 2 m by 1 m
    (4, 2, 2)
    """
    side = check_number("resolution", resolution)
    within = check_number("simplify", simplify)
    given = (side, within)
    expected = "positive, and at least 0"
    check_argument(side > 0 <= within, "resolution, simplify", given, expected)
    x, y, yaw = check_vector("origin", origin, 3)
    cells = np.asarray(occupied)
    expected = "truth values of shape (rows, columns), such as grid > 65"
    is_grid = cells.ndim == 2 and cells.dtype == bool
    check_argument(is_grid, "occupied", occupied, expected)
    # edges come in pairs: where a run of occupied cells begins, and where it ends
    row, edge = np.diff(cells, prepend=False, append=False).nonzero()
    low = row[::2]
    outlines = shapely.union_all(shapely.box(edge[::2], low, edge[1::2], low + 1))
    c = side * cos(yaw)
    s = side * sin(yaw)
    turn = [c, -s, s, c, x, y]
    return read_walls(affine_transform(shapely.simplify(outlines, within / side), turn))

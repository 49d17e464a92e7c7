"""Walls from lines, polygons and maps: occupancy grids of ROS map_server, and other grids of cells.

The cells that are occupied are united and simplified; the outlines are the walls.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import yaml
from numpy.typing import ArrayLike
from PIL import Image

from ..core.checks import Array, check_array, check_number, require
from ..core.errors import DataError, SolverError
from ..core.input_files import printable, read_small
from .obstacles import SHORTEST_WALL, Wall, check_wall

_NUMBERS = {"origin": (3,), "resolution": (), "free_thresh": (), "occupied_thresh": ()}
_EIGHT_BITS = ("1", "L", "LA", "P", "PA", "RGB", "RGBA")
_MOST_PIXELS = 50_000_000  # of a picture; a file of 10 MB may hold many more
_FAULTS = (
    OSError,
    ValueError,
    TypeError,
    SyntaxError,
    RuntimeError,
    yaml.YAMLError,
    Image.DecompressionBombError,
)
Circle = tuple[float, float, float]


def read_walls(walls: Any) -> Array:
    """Read walls as segments, shape (n, 2, 2) [m], in the order in which they are given.

    Parameters
    ----------
    walls : segments, shape (2, 2) each; polylines, shape (m, 2); Shapely's lines, rings, polygons and
        collections, or objects with `.coords`, `.exterior` and `.interiors`, or `.geoms` like them; one or
        many, nested in any way. The outline of a polygon and the edges of its holes are walls; to an `MPCCBF`
        it is solid, so give a room by its `exterior`. Corners of a line that are closer than `SHORTEST_WALL`
        count as one.

    Raises
    ------
    SolverError : something is no wall, or a number cannot be used.

    Examples
    --------
    >>> from szlib.control import read_walls
    >>> read_walls([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)]).shape  # a polyline of two segments
    (2, 2, 2)
    """
    segments = [
        check_wall(segment)
        for line in _find_lines(walls)
        for segment in _split_line(line)
    ]
    return np.reshape(np.array(segments, float), (-1, 2, 2))


class Walls(np.ndarray[Any, np.dtype[np.float64]]):
    """Segments, shape (n, 2, 2) [m], that know which areas they enclose; what is computed from them does not.

    Attributes
    ----------
    solids : these areas, of Shapely; None: not known.
    """

    solids: Any = None


def find_solids(walls: Any) -> Any:
    """The union of the polygons among `walls`, and of `Walls.solids`; None if there are none."""
    if hasattr(walls, "exterior"):
        return shapely.make_valid(
            shapely.Polygon(
                walls.exterior.coords, [hole.coords for hole in walls.interiors]
            )
        )
    parts = getattr(walls, "geoms", walls)
    if isinstance(parts, np.ndarray) or not isinstance(parts, Iterable):
        return getattr(walls, "solids", None)
    found = [solid for part in parts if (solid := find_solids(part)) is not None]
    return shapely.union_all(found) if found else None


def _find_lines(walls: Any) -> Iterator[Any]:
    """Find each line among nested `walls`, as a list of its corners."""
    if hasattr(walls, "geoms"):
        parts = list(walls.geoms)
    elif hasattr(walls, "exterior"):
        parts = [walls.exterior, *walls.interiors]
    elif hasattr(walls, "coords"):
        parts = [corner[:2] for corner in walls.coords]
    elif isinstance(walls, Iterable) and not isinstance(walls, str):
        parts = list(walls)
    else:
        raise SolverError(
            f"a wall must be a segment, a line, or one of Shapely's; got {walls!r}"
        )
    if parts and all(_is_corner(part) for part in parts):
        yield parts
    else:
        for part in parts:
            yield from _find_lines(part)


def _is_corner(part: Any) -> bool:
    return isinstance(part, Sequence | np.ndarray) and all(
        np.isscalar(number) for number in part
    )


def _split_line(line: Any) -> list[Array]:
    """Split a line into its segments."""
    if np.shape(line)[1:] == (4,):
        raise SolverError(
            "walls must be segments [[(xa, ya), (xb, yb)], ...], shape (n, 2, 2); got rows of four numbers: "
            "use np.reshape(walls, (-1, 2, 2))"
        )
    corners = check_array("a wall", line, (..., 2))
    if len(corners) < 2:
        raise SolverError(f"a wall needs two end points; got {corners.tolist()}")
    separate = [corners[0]]
    for corner in corners[1:]:
        if np.hypot(*(corner - separate[-1])) >= SHORTEST_WALL:
            separate.append(corner)
    return [np.array(ends) for ends in pairwise(separate)] or [corners[[0, -1]]]


def walls_from_map(
    path: str | Path,
    *,
    simplify: float = 0.05,
    near: Circle | None = None,
    unknown: bool = False,
) -> Walls:
    """Read the map of ROS map_server in the YAML file `path`: the outlines of what is occupied.

    Parameters
    ----------
    path : the YAML file, with image (PGM or PNG), resolution, origin, occupied_thresh, free_thresh, and, if
        they differ from 0 and "trinary", negate and mode.
    simplify, near : as of `walls_from_grid`.
    unknown : True if unknown cells are solid as well.

    Returns
    -------
    Segments, shape (n, 2, 2) [m], in the map's frame; for `MPCCBF(walls=...)`, which also learns from them
    that what they enclose is solid.

    Raises
    ------
    DataError : a file cannot be read, or an entry is missing or out of its range; the message names both.

    Notes
    -----
    Cells are read as map_server does. In mode "raw" a pixel of 0 to 100 is the occupancy in per cent, and
    occupied from `occupied_thresh` on.

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
    what = "the map"
    try:
        given = {
            "negate": 0,
            "mode": "trinary",
            **yaml.safe_load(read_small(Path(path))),
        }
        missing = {"image", *_NUMBERS} - set(given)
        require(not missing, "a map", f"one without {sorted(missing)}", "complete")
        origin, side, free, occupied = (
            check_array(key, given[key], _NUMBERS[key]) for key in _NUMBERS
        )
        below = f"from 0 to below occupied_thresh = {occupied}, which is at most 1"
        for key, holds, expected in (
            ("resolution", side > 0, "a positive number of metres"),
            ("free_thresh", 0 <= free < occupied <= 1, below),
            ("negate", given["negate"] in (0, 1), "0 or 1"),
            (
                "mode",
                given["mode"] in ("trinary", "scale", "raw"),
                "'trinary', 'scale' or 'raw'",
            ),
            ("image", isinstance(given["image"], str), "the name of a picture"),
        ):
            require(holds, key, given[key], expected)
        what = f"image {given['image']!r}"
        picture = Image.open(io.BytesIO(read_small(Path(path).parent / given["image"])))
        fits = (
            picture.mode in _EIGHT_BITS
            and picture.width * picture.height <= _MOST_PIXELS
        )
        require(
            fits,
            "it",
            (picture.mode, picture.size),
            f"of 8 bits, and at most {_MOST_PIXELS} pixels",
        )
        grey, alpha = np.moveaxis(np.asarray(picture.convert("LA"), np.float32), -1, 0)
    except _FAULTS as fault:
        expected = "a YAML file of map_server with a PGM or PNG picture"
        raise DataError(
            f"{printable(path)}: {what} cannot be read: {fault}; expected {expected}"
        ) from fault
    if given["mode"] == "raw":
        is_solid, is_unknown = (grey >= 100 * occupied) & (grey <= 100), grey > 100
    else:
        if given["mode"] == "trinary" and picture.has_transparency_data:
            grey = (3 * grey + alpha) / 4
        p = (grey if given["negate"] else 255 - grey) / 255
        is_solid, is_between = p > occupied, (p >= free) & (p <= occupied)
        is_unknown = is_between & ((given["mode"] == "trinary") | (alpha < 255))
    cells = (is_solid | (is_unknown & unknown))[::-1]
    return walls_from_grid(cells, float(side), origin, simplify=simplify, near=near)


def walls_from_grid(
    occupied: ArrayLike,
    resolution: float,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    *,
    simplify: float = 0.05,
    near: Circle | None = None,
) -> Walls:
    """Find the outlines of the occupied cells of a grid, as segments, shape (n, 2, 2) [m].

    Parameters
    ----------
    occupied : True where a cell is occupied, shape (rows, columns), the row of the smallest y first.
    resolution : side of a cell [m].
    origin : (x, y, yaw) of the outer corner of the first cell [m, rad].
    simplify : an outline may deviate by this much from that of the cells [m].
    near : (x, y, r): keep walls within r of (x, y) only [m].

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
    side, within = (
        check_number("resolution", resolution),
        check_number("simplify", simplify),
    )
    require(
        side > 0 and within >= 0,
        "resolution, simplify",
        (side, within),
        "positive",
        SolverError,
    )
    (x, y, yaw), cells = (
        check_array("origin", origin, (3,)).tolist(),
        np.asarray(occupied, bool),
    )
    require(
        cells.ndim == 2,
        "occupied",
        cells.shape,
        "of shape (rows, columns)",
        SolverError,
    )
    edges = np.diff(np.pad(cells, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (row, begin), end = (edges > 0).nonzero(), (edges < 0).nonzero()[1]
    solids = shapely.simplify(
        shapely.union_all(shapely.box(begin, row, end, row + 1)), within / side
    )
    turn = side * np.array([[cos(yaw), sin(yaw)], [-sin(yaw), cos(yaw)]])
    solids = shapely.transform(solids, lambda points: points @ turn + (x, y))
    segments = read_walls(solids)
    if near is not None:
        px, py, r = check_array("near", near, (3,)).tolist()
        gaps = Wall.gap(px, py, 0.0, *segments.reshape(-1, 4).T)
        segments = segments[gaps <= r]
    walls = segments.view(Walls)
    walls.solids = solids
    return walls

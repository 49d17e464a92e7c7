"""Walls from lines, polygons and maps: occupancy grids of ROS map_server, and other grids of cells.

The cells that are occupied are united and simplified; the outlines are the walls.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from math import cos, sin
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import yaml
from numpy.typing import ArrayLike
from PIL import Image
from shapely.affinity import affine_transform

from ..core.checks import Array, check_array, check_number, require
from ..core.errors import DataError, SolverError
from ..core.input_files import printable, read_small
from .obstacles import SHORTEST_WALL

_NUMBERS = {"origin": (3,), "resolution": (), "free_thresh": (), "occupied_thresh": ()}
_EIGHT_BITS = "1", "L", "LA", "P", "PA", "RGB", "RGBA"
_MOST_PIXELS = 50_000_000  # of a picture; a file of 10 MB may hold many more


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
    lines = np.concatenate([[], *(lines for lines, _ in _find_shapes(walls))])
    check_array("a wall", shapely.get_coordinates(lines), (..., 2))
    lines = shapely.remove_repeated_points(lines, SHORTEST_WALL)
    is_long, expected = shapely.length(lines) > 0, f"{SHORTEST_WALL} m long or longer"
    require(is_long.all(), "a wall", lines[~is_long], expected, SolverError)
    corners, line = shapely.get_coordinates(lines, return_index=True)
    ends = np.stack([corners[:-1], corners[1:]], axis=1)
    return np.asarray(ends[line[:-1] == line[1:]])


class Walls(np.ndarray[Any, np.dtype[np.float64]]):
    """Segments, shape (n, 2, 2) [m], that know which areas they enclose; what is computed from them does not.

    Attributes
    ----------
    solids : these areas, of Shapely; None: not known.
    """

    solids: Any = None


def find_solids(walls: Any) -> Any:
    """The union of the polygons among `walls`, and of `Walls.solids`; None if there are none."""
    found = [area for _, area in _find_shapes(walls) if area is not None]
    return shapely.union_all(found) if found else None


def _find_shapes(walls: Any) -> Iterator[tuple[Any, Any]]:
    """Lines among nested `walls`, shape (n,), each with the area that they enclose, or None; of Shapely."""
    parts = getattr(walls, "geoms", walls)
    if hasattr(parts, "exterior"):
        holes = [hole.coords for hole in parts.interiors]
        area = shapely.Polygon(parts.exterior.coords, holes)
        yield shapely.get_parts(area.boundary), shapely.make_valid(area)
    elif hasattr(parts, "coords"):
        yield _draw_lines([corner[:2] for corner in parts.coords]), None
    elif isinstance(parts, str) or not isinstance(parts, Iterable):
        expected = "a segment, a line, or one of Shapely's"
        raise SolverError(f"a wall must be {expected}; got {walls!r}")
    elif isinstance(parts, np.ndarray) or any(map(_is_corner, parts)):
        yield _draw_lines(parts), getattr(parts, "solids", None)
    else:
        for part in parts:
            yield from _find_shapes(part)


def _is_corner(part: Any) -> bool:
    return isinstance(part, Sequence | np.ndarray) and all(map(np.isscalar, part))


def _draw_lines(corners: Any) -> Any:
    """Lines of Shapely from their corners, shape (..., m, 2) [m]."""
    numbers = check_array("a wall", corners, (...,))
    given = numbers.shape
    if given[1:] == (4,):
        raise SolverError(
            "walls must be segments [[(xa, ya), (xb, yb)], ...], shape (n, 2, 2); got rows of four numbers: "
            "use np.reshape(walls, (-1, 2, 2))"
        )
    is_line = given[-1:] == (2,) and len(given) > 1 and given[-2] > 1
    require(is_line, "a wall", given, "of shape (m, 2), with m > 1", SolverError)
    return np.ravel(shapely.linestrings(numbers))


def walls_from_map(
    path: str | Path,
    *,
    simplify: float = 0.05,
    unknown: bool = False,
) -> Walls:
    """Read the map of ROS map_server in the YAML file `path`: the outlines of what is occupied.

    Parameters
    ----------
    path : the YAML file, with image (PGM or PNG), resolution, origin, occupied_thresh, free_thresh, and, if
        they differ from 0 and "trinary", negate and mode.
    simplify : as of `walls_from_grid`.
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
        entries = _check_entries(yaml.safe_load(read_small(Path(path))))
        what = f"image {entries['image']!r}"
        pixels = _read_picture(Path(path).parent / entries["image"], entries["mode"])
    # whatever YAML, Pillow and NumPy say of a bad file
    except Exception as fault:
        expected = "a YAML file of map_server with a PGM or PNG picture"
        raise DataError(
            f"{printable(path)}: {what} cannot be read: {fault}; expected {expected}"
        ) from fault
    solid, unclear = _classify_pixels(*pixels, entries)
    cells = (solid | (unclear & unknown))[::-1]
    side, origin = entries["resolution"], entries["origin"]
    return walls_from_grid(cells, float(side), origin, simplify=simplify)


def _check_entries(given: Any) -> dict[str, Any]:
    """The entries of a map, with arrays of numbers; DataError if one is missing or cannot be used."""
    entries = {"negate": 0, "mode": "trinary", **given}
    missing = {"image", *_NUMBERS} - set(entries)
    require(not missing, "a map", f"one without {sorted(missing)}", "complete")
    for key, shape in _NUMBERS.items():
        entries[key] = check_array(key, entries[key], shape)
    free, occupied = entries["free_thresh"], entries["occupied_thresh"]
    below = f"from 0 to below occupied_thresh = {occupied}, which is at most 1"
    modes = "trinary", "scale", "raw"
    for key, holds, expected in (
        ("resolution", entries["resolution"] > 0, "a positive number of metres"),
        ("free_thresh", 0 <= free < occupied <= 1, below),
        ("negate", entries["negate"] in (0, 1), "0 or 1"),
        ("mode", entries["mode"] in modes, " or ".join(map(repr, modes))),
        ("image", isinstance(entries["image"], str), "the name of a picture"),
    ):
        require(holds, key, entries[key], expected)
    return entries


def _read_picture(path: Path, mode: str) -> tuple[Any, Any]:
    """Grey of the pixels of a map, and True where they are transparent."""
    picture = Image.open(io.BytesIO(read_small(path)))
    n = picture.width * picture.height
    fits = picture.mode in _EIGHT_BITS and n <= _MOST_PIXELS
    expected = f"of 8 bits, and at most {_MOST_PIXELS} pixels"
    require(fits, "it", (picture.mode, picture.size), expected)
    grey, alpha = np.moveaxis(np.asarray(picture.convert("LA"), np.float32), -1, 0)
    is_mixed = mode == "trinary" and picture.has_transparency_data
    return (3 * grey + alpha) / 4 if is_mixed else grey, alpha < 255


def _classify_pixels(
    grey: Any, is_transparent: Any, entries: dict[str, Any]
) -> tuple[Any, Any]:
    """Which pixels of a map are occupied, and which are unknown."""
    mode, occupied = entries["mode"], entries["occupied_thresh"]
    if mode == "raw":
        return (grey >= 100 * occupied) & (grey <= 100), grey > 100
    p = (grey if entries["negate"] else 255 - grey) / 255
    is_between = (p >= entries["free_thresh"]) & (p <= occupied)
    return p > occupied, is_between & (is_transparent | (mode == "trinary"))


def walls_from_grid(
    occupied: ArrayLike,
    resolution: float,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    *,
    simplify: float = 0.05,
) -> Walls:
    """Find the outlines of the occupied cells of a grid, as segments, shape (n, 2, 2) [m].

    Parameters
    ----------
    occupied : True where a cell is occupied, shape (rows, columns), the row of the smallest y first.
    resolution : side of a cell [m].
    origin : (x, y, yaw) of the outer corner of the first cell [m, rad].
    simplify : an outline may deviate by this much from that of the cells [m].

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
    require(side > 0, "resolution", side, "positive", SolverError)
    require(within >= 0, "simplify", within, "at least 0", SolverError)
    x, y, yaw = check_array("origin", origin, (3,)).tolist()
    cells = np.asarray(occupied, bool)
    expected = "of shape (rows, columns)"
    require(cells.ndim == 2, "occupied", cells.shape, expected, SolverError)
    edges = np.diff(np.pad(cells, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (row, begin), end = (edges > 0).nonzero(), (edges < 0).nonzero()[1]
    outlines = shapely.union_all(shapely.box(begin, row, end, row + 1))
    c, s = side * cos(yaw), side * sin(yaw)
    turn = [c, -s, s, c, x, y]
    solids = affine_transform(shapely.simplify(outlines, within / side), turn)
    walls = read_walls(solids).view(Walls)
    walls.solids = solids
    return walls

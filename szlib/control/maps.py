"""Walls from maps: occupancy grids of ROS map_server, and other grids of cells.

The cells that are occupied are united and simplified; the outlines are the walls.
"""

from __future__ import annotations

import io
from math import cos, sin
from pathlib import Path

import numpy as np
import shapely
import yaml
from numpy.typing import ArrayLike
from PIL import Image

from ..checks import check_array, check_number, require
from ..errors import DataError, SolverError
from ..input_files import printable, read_small
from .barriers import Walls, euclidean_segment_formula, read_walls

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
        segments = segments[
            euclidean_segment_formula(px, py, *segments.reshape(-1, 4).T) <= r
        ]
    walls = segments.view(Walls)
    walls.solids = solids
    return walls

"""Barriers: how far the robot is from walls and social zones, and when that distance is safe.

    segment   g = [(x-xa)(yb-ya) - (y-ya)(xb-xa)] / L,   t = [(L/2)^2 - |x-xc|^2] / L
              d = sqrt(g^2 + ((|t| - t)/2)^2)                                (paper, eq. 3-5)
    ellipse   d = (|x-ca| + |x-cb|)/2 - a,  ca and cb the foci              (paper, eq. 7)
    barrier   h = d - r_robot - eps, safe where h >= 0                      (paper, sec. 4)
    CBF       h(x_{k+1}) - h(x_k) >= -gamma h(x_k)                          (paper, eq. 1)

`|t| - t` stands for the paper's norm of a scalar. Each formula is written once, with operators only, so that
the same lines run on floats, on NumPy arrays and on the symbols of CasADi.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike

from ..checks import Array, check_array
from ..errors import SolverError
from ..zones.ellipses import Ellipse

# Below this length the direction of a wall cannot be used [m]; a pillar may be a wall of a millimetre.
SHORTEST_WALL = 1e-3


def segment_formula(x: Any, y: Any, xa: Any, ya: Any, xb: Any, yb: Any) -> Any:
    """Approximate distance of (`x`, `y`) to the segment (`xa`, `ya`) to (`xb`, `yb`) [m] (paper, eq. 3-5)."""
    length = ((xb - xa) ** 2 + (yb - ya) ** 2) ** 0.5
    g = ((x - xa) * (yb - ya) - (y - ya) * (xb - xa)) / length
    t = (
        (length / 2) ** 2 - (x - (xa + xb) / 2) ** 2 - (y - (ya + yb) / 2) ** 2
    ) / length
    return (g**2 + ((abs(t) - t) / 2) ** 2) ** 0.5


def euclidean_segment_formula(
    x: Any, y: Any, xa: Any, ya: Any, xb: Any, yb: Any
) -> Any:
    """Euclidean distance of (`x`, `y`) to the segment from (`xa`, `ya`) to (`xb`, `yb`) [m]."""
    length = ((xb - xa) ** 2 + (yb - ya) ** 2) ** 0.5
    g = ((x - xa) * (yb - ya) - (y - ya) * (xb - xa)) / length
    along = ((x - (xa + xb) / 2) * (xb - xa) + (y - (ya + yb) / 2) * (yb - ya)) / length
    beyond = abs(along) - length / 2
    return (g**2 + ((abs(beyond) + beyond) / 2) ** 2) ** 0.5


def ellipse_formula(x: Any, y: Any, xa: Any, ya: Any, xb: Any, yb: Any, a: Any) -> Any:
    """Approximate distance of (`x`, `y`) to an ellipse [m] (paper, eq. 7).

    The foci are (`xa`, `ya`) and (`xb`, `yb`), the semi-major axis is `a`.
    """
    return (
        ((x - xa) ** 2 + (y - ya) ** 2) ** 0.5 + ((x - xb) ** 2 + (y - yb) ** 2) ** 0.5
    ) / 2 - a


def barrier(distance: Any, radius: float, margin: Any) -> Any:
    """Barrier h = d - r_robot - eps [m]: safe where it is not negative (paper, sec. 4).

    Parameters
    ----------
    distance : d, to a wall or a zone [m].
    radius : of the robot [m].
    margin : eps [m].

    Examples
    --------
    >>> from szlib.control import barrier
    >>> barrier(2.0, radius=0.5, margin=0.25)
    1.25
    """
    return distance - (radius + margin)


def compute_h(
    x: Any,
    y: Any,
    zones: Iterable[Sequence[float]],
    walls: Iterable[Sequence[float]],
    *,
    r_robot: float,
    eps: float,
    time: float = 0.0,
) -> list[Any]:
    """h of every zone and then of every wall, for a robot at (x, y): a list, each of the shape of `x` [m].

    Parameters
    ----------
    x, y : position of the robot, numbers or arrays [m].
    zones : foci, semi-major axis and velocity of each zone, (xa, ya, xb, yb, a, vx, vy) [m, m/s].
    walls : end points and margin of each wall, (xa, ya, xb, yb, margin) [m].
    r_robot : radius of the robot [m].
    eps : margin around zones [m].
    time : how long the zones have moved at their velocities, a number or an array [s].

    Examples
    --------
    >>> from szlib.control import compute_h
    >>> zone = (0.0, 0.0, 0.0, 0.0, 1.0, -0.5, 0.0)  # a circle of 1 m that moves to the left
    >>> wall = (-5.0, 2.0, 5.0, 2.0, 0.0)
    >>> compute_h(-4.0, 0.0, [zone], [wall], r_robot=0.5, eps=0.0)
    [2.5, 1.5]
    >>> compute_h(-4.0, 0.0, [zone], [wall], r_robot=0.5, eps=0.0, time=2.0)
    [1.5, 1.5]
    """
    h = []
    for xa, ya, xb, yb, a, vx, vy in zones:
        distance = ellipse_formula(x - time * vx, y - time * vy, xa, ya, xb, yb, a)
        h.append(barrier(distance, r_robot, eps))
    for xa, ya, xb, yb, margin in walls:
        h.append(barrier(segment_formula(x, y, xa, ya, xb, yb), r_robot, margin))
    return h


def cbf_residual(h_next: Any, h: Any, gamma: float) -> Any:
    """Residual of the discrete CBF condition [m]: satisfied where it is not negative (paper, eq. 1).

    Parameters
    ----------
    h_next : h one step later [m].
    h : now [m].
    gamma : fraction of h that a step may use up.

    Examples
    --------
    >>> from szlib.control import cbf_residual
    >>> cbf_residual(h_next=0.5, h=1.0, gamma=0.5)
    0.0
    """
    return h_next - (1 - gamma) * h


def segment_distance(points: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """Approximate distance of points to the segment from a to b (paper, eq. 3-5).

    It is zero exactly on the segment and positive elsewhere. It is Euclidean for points in the disc that has
    the segment as its diameter; beyond, it is an approximation that is exact to first order at the ends.

    Parameters
    ----------
    points : positions, shape (..., 2) [m].
    a, b : end points, shape (2,) [m].

    Returns
    -------
    Distances, shape (...) [m].

    Raises
    ------
    SolverError : the segment has no length, or a shape or a number cannot be used.

    Examples
    --------
    >>> import szlib
    >>> szlib.segment_distance([(0.0, 0.5), (0.0, -0.5)], (-1.0, 0.0), (1.0, 0.0)).tolist()
    [0.5, 0.5]
    """
    xy = check_array("points", points, (..., 2))
    (xa, ya), (xb, yb) = check_wall([np.asarray(a), np.asarray(b)])
    return np.asarray(segment_formula(xy[..., 0], xy[..., 1], xa, ya, xb, yb))


def ellipse_distance(points: ArrayLike, ellipse: Ellipse) -> Array:
    """Approximate signed distance of points to an ellipse, from the sum of focal distances (paper, eq. 7).

    It is zero on the ellipse, negative inside (at least -(a - c)), and positive outside. For a circle it is
    Euclidean.

    Parameters
    ----------
    points : positions, shape (..., 2), in the frame of the ellipse's centre [m].
    ellipse : the social zone.

    Returns
    -------
    Distances, shape (...) [m].

    Examples
    --------
    >>> import szlib
    >>> circle = szlib.Ellipse(center=(0.0, 0.0), semi_axes=(1.0, 1.0))
    >>> szlib.ellipse_distance([(2.0, 0.0), (0.0, 0.0)], circle).tolist()
    [1.0, -1.0]
    """
    xy = check_array("points", points, (..., 2))
    return np.asarray(ellipse_formula(xy[..., 0], xy[..., 1], *ellipse.foci_and_axis))


def find_near_walls(walls: Array, x: float, y: float, reach: float) -> list[int]:
    """Numbers of the `walls`, shape (n, 2, 2), whose way s from (`x`, `y`) is at most `reach` [m].

    Notes
    -----
    With d the approximate distance to a wall of length L, s = L/2 (sqrt(1 + 4 d/L) - 1), so that d = F(s) =
    s + s^2/L. It changes by no more than the robot moves (`szlib.control.differential_drive`). A wall can be
    left out of the problem while s >= r_robot + eps + 2 v dt/gamma (dt and gamma of the longest step): then
    its rows hold whatever a robot does that is no faster than v. With S = r_robot + eps, and r_robot + margin
    <= F(S) (`distances.wall_margin`),

        gamma h(x_k) >= gamma (F(s) - F(S)) = gamma (s - S) (1 + (s + S)/L) >= v dt (1 + 2 s/L)
                     >= F(s) - F(s - v dt) >= h(x_k) - h(x_{k+1})

    A step of m dt keeps (1 - gamma)^m of h: the same with m dt and 1 - (1 - gamma)^m, and the longest step
    needs most. If the wall is farther by v times the horizon now, this holds on the whole horizon.
    """
    length = np.hypot(*(walls[:, 1] - walls[:, 0]).T)
    d = np.asarray(segment_formula(x, y, *walls.reshape(-1, 4).T))
    return [
        *map(
            int, np.flatnonzero(length / 2 * (np.sqrt(1 + 4 * d / length) - 1) <= reach)
        )
    ]


def check_wall(wall: ArrayLike) -> Array:
    """End points of a `wall`, shape (2, 2) [m]; SolverError if it is shorter than `SHORTEST_WALL`."""
    ends = check_array("wall", wall, (2, 2))
    length = np.hypot(*(ends[1] - ends[0]))
    if length == 0:
        raise SolverError(
            f"a wall needs two different end points; got {ends[0].tolist()} twice"
        )
    if length < SHORTEST_WALL:
        raise SolverError(
            f"a wall must be at least {SHORTEST_WALL} m long; got {length:.3g} m from {ends[0].tolist()}; "
            "leave it out or join it to its neighbour"
        )
    return ends


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
    corners = check_array("a wall", line, (..., 2))
    if len(corners) < 2:
        raise SolverError(f"a wall needs two end points; got {corners.tolist()}")
    separate = [corners[0]]
    for corner in corners[1:]:
        if np.hypot(*(corner - separate[-1])) >= SHORTEST_WALL:
            separate.append(corner)
    return [np.array(ends) for ends in pairwise(separate)] or [corners[[0, -1]]]

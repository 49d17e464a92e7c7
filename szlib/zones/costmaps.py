"""Zones around people as a layer of a costmap, as navigation stacks read it (nav_msgs/OccupancyGrid).

    100         in a person's body
    99 ... 50   in their zone, falling linearly from its centre to its boundary
    49 ... 0    beyond, falling linearly over `fade`, along the line from the zone's centre

so a cell costs 50 or more exactly if its centre lies in somebody's zone or body. Where zones overlap, the
greatest cost counts. Of somebody too slow to say which way they face, the zone is `circle_around` it. To
inflate costs by the robot's radius is left to the stack.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import atan2, cos, hypot, pi, sin
from typing import Any, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import Array
from ..errors import ZoneError

BODY_RADIUS = 0.25
"""Radius of a person's body: half the breadth of shoulders [m] (assumed)."""
FADE = 0.5
"""How far from a zone its cost has faded to 0 [m] (assumed)."""
WALKING = 0.2
"""Speed from which on a velocity says which way somebody faces [m/s] (assumed)."""
ZONE_SPEED = 1.1
"""Walking speed whose zone is meant, where a zone depends on speed [m/s] (paper, sec. 4)."""
BODY, CENTRE, BOUNDARY = 100, 99, 50
"""Costs of a body, at the centre of a zone, and at its boundary."""
_BISECTIONS = 60
"""Halvings of a quarter turn until nothing is left of it in double precision."""


class Oval(Protocol):
    """What is asked of an `Ellipse` here."""

    @property
    def center(self) -> tuple[float, float]:
        """(x, y) [m]."""

    @property
    def semi_axes(self) -> tuple[float, float]:
        """The larger, the smaller [m]."""

    @property
    def angle(self) -> float:
        """From x to the larger axis [rad]."""

    def level(self, points: Array) -> Array:
        """Of points (n, 2): 1 on the ellipse, less inside, more outside."""

    def placed(self, position: tuple[float, float], heading: float) -> Oval:
        """The same in the world frame, of a person there with this heading [m, rad]."""


@dataclass(frozen=True)
class Grid:
    """Cells of a costmap, along the axes of the world frame.

    Parameters
    ----------
    origin : (x, y) of the corner of cell (0, 0) where x and y are least [m].
    resolution : side of a cell [m].
    shape : (rows, columns): cells along y, and along x.

    Raises
    ------
    ZoneError : a number is not finite, or resolution or shape not positive.
    """

    origin: tuple[float, float]
    resolution: float
    shape: tuple[int, int]

    def __post_init__(self) -> None:
        origin, resolution = np.asarray(self.origin, float), float(self.resolution)
        if origin.shape != (2,) or not np.isfinite([*origin, resolution]).all() or resolution <= 0:
            raise ZoneError(
                f"a grid needs an origin (x, y) and a resolution > 0; got {self.origin}, {self.resolution}"
            )
        shape = np.asarray(self.shape)
        if shape.shape != (2,) or shape.dtype.kind not in "iu" or (shape < 1).any():
            raise ZoneError(f"a grid's shape must be (rows, columns), whole numbers >= 1; got {self.shape}")
        object.__setattr__(self, "origin", (float(origin[0]), float(origin[1])))
        object.__setattr__(self, "resolution", resolution)
        object.__setattr__(self, "shape", (int(shape[0]), int(shape[1])))

    def centers(self, rows: slice = slice(None), columns: slice = slice(None)) -> Array:
        """(x, y) of the centre of each cell in these rows and columns, shape (rows, columns, 2) [m]."""
        (x, y), side = self.origin, self.resolution
        xs = x + side * (np.arange(self.shape[1])[columns] + 0.5)
        ys = y + side * (np.arange(self.shape[0])[rows] + 0.5)
        return np.stack(np.broadcast_arrays(xs, ys[:, None]), axis=-1)

    def window(self, around: tuple[float, float], reach: float) -> tuple[slice, slice]:
        """Rows and columns of all the cells that may lie within reach of a place [m]."""
        ends = []
        for middle, corner, cells in zip(around[::-1], self.origin[::-1], self.shape, strict=True):
            first, last = ((middle + side - corner) / self.resolution for side in (-reach, reach))
            ends.append(slice(int(np.clip(first - 1, 0, cells)), int(np.clip(last + 1, 0, cells))))
        return ends[0], ends[1]


Z = TypeVar("Z", bound=Oval)


class Layer:
    """A zone that can be drawn into a costmap: an `Ellipse`, or anything with `.ellipse(speed)`."""

    def costmap(
        self,
        people: Sequence[Any] | ArrayLike,
        grid: Grid,
        *,
        speed: float = ZONE_SPEED,
        fade: float = FADE,
        body: float = BODY_RADIUS,
    ) -> NDArray[np.int8]:
        """Costs 0 to 100 of this zone around people; see the top of `szlib.zones.costmaps`.

        Parameters
        ----------
        people : an array, shape (n, 4): x, y [m], vx, vy [m/s], world frame; or `Person`s: a `zone` of their
            own is drawn in place of this one. Who is slower than 0.2 m/s, without a heading, gets the circle.
        grid : the cells.
        speed : walking speed whose zone is meant, where it depends on speed [m/s].
        fade : how far beyond a zone its cost ends [m]; 0: at its boundary.
        body : radius of a person's body [m].

        Returns
        -------
        int8, shape `grid.shape`: [row, column] is the cell at y, x. `.ravel()` is `OccupancyGrid.data`.

        Raises
        ------
        ZoneError : a number is not finite or negative, a shape is wrong, or the zone is undefined at `speed`.
        """
        if not (np.isfinite([fade, body]).all() and min(fade, body) >= 0):
            raise ZoneError(f"fade and body must be finite and >= 0, in metres; got {fade}, {body}")
        costs = np.zeros(grid.shape, np.int8)
        mine: Oval | None = None
        for (x, y), heading, own in _each(people):
            zone = _oval(own, speed) if own is not None else (mine := mine or _oval(self, speed))
            placed = (circle_around(zone) if heading is None else zone).placed((x, y), heading or 0.0)
            offset = hypot(placed.center[0] - x, placed.center[1] - y)
            window = grid.window(placed.center, max(offset + body, placed.semi_axes[0] + fade))
            points = grid.centers(*window)
            cost = _zone_cost(points, placed, fade)
            cost[np.hypot(*np.moveaxis(points - (x, y), -1, 0)) <= body] = BODY
            costs[window] = np.maximum(costs[window], cost)
        return costs


def circle_around(zone: Z) -> Z:
    """The smallest circle around a person that contains their zone whichever way they face.

    Its radius is the greatest distance from the person to the ellipse. With the person's offset from the
    centre (-p, -q), p, q >= 0, in the ellipse's frame, the farthest point (a cos t, b sin t) lies in the
    first quadrant, and half the derivative of the squared distance by t,

        b q cos t - a p sin t - (a^2 - b^2) sin t cos t,

    changes its sign once there: divided by sin t cos t it falls.
    """
    radius = _farthest(zone.center, zone.semi_axes, zone.angle)
    circle = {"center": (0.0, 0.0), "semi_axes": (radius, radius), "angle": 0.0, "support": None}
    return cast(Z, replace(cast(Any, zone), **circle))


@lru_cache(maxsize=256)
def _farthest(center: tuple[float, float], semi_axes: tuple[float, float], angle: float) -> float:
    (m, n), (a, b) = center, semi_axes
    c, s = cos(angle), sin(angle)
    p, q = abs(m * c + n * s), abs(n * c - m * s)
    low, high = 0.0, pi / 2
    for _ in range(_BISECTIONS):
        t = (low + high) / 2
        rises = b * q * cos(t) - a * p * sin(t) - (a**2 - b**2) * sin(t) * cos(t) > 0
        low, high = (t, high) if rises else (low, t)
    return hypot(p + a * cos(low), q + b * sin(low))


def _zone_cost(points: Array, zone: Oval, fade: float) -> NDArray[np.int8]:
    """Cost of a zone at points (..., 2), 0 to 99."""
    share = np.sqrt(zone.level(points))  # of the way from the centre to the boundary
    inside = np.rint(CENTRE - (CENTRE - BOUNDARY) * share)
    beyond = np.hypot(*np.moveaxis(points - zone.center, -1, 0)) * (1 - 1 / np.maximum(share, 1))
    outside = np.floor(BOUNDARY * (1 - beyond / fade)) if fade else np.zeros_like(share)
    return np.asarray(np.where(share <= 1, inside, np.clip(outside, 0, BOUNDARY - 1)), np.int8)


def _each(people: Sequence[Any] | ArrayLike) -> Iterator[tuple[tuple[float, float], float | None, Any]]:
    """Position, heading (None: unknown) and own zone of everybody."""
    rows = people if isinstance(people, np.ndarray) else list(cast(Sequence[Any], people))
    if len(rows) and all(hasattr(row, "position") for row in rows):
        yield from ((row.position, row.heading, row.zone) for row in rows)
        return
    numbers = np.asarray(rows, float)
    if numbers.size and (numbers.ndim != 2 or numbers.shape[1] != 4):
        raise ZoneError(f"people must be Persons, or an array (n, 4): x, y, vx, vy; got {numbers.shape}")
    for i, (x, y, vx, vy) in enumerate(numbers.reshape(-1, 4).tolist()):
        if not np.isfinite([x, y, vx, vy]).all():
            raise ZoneError(
                f"people must be finite; number {i} is {[x, y, vx, vy]}: leave it out, or repair it"
            )
        yield (x, y), atan2(vy, vx) if hypot(vx, vy) >= WALKING else None, None


def _oval(zone: Any, speed: float) -> Oval:
    return cast(Oval, zone.ellipse(speed) if hasattr(zone, "ellipse") else zone)

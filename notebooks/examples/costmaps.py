"""Zones around people as a costmap, in the convention of navigation stacks (nav_msgs/OccupancyGrid).

    100         in a person's body
    99 ... 50   in a person's zone, falling linearly from its centre to its boundary
    49 ... 0    outside, falling linearly over the distance `fade`, along the line from the zone's centre

A cell costs 50 or more exactly if its centre lies in a zone or a body. Where zones overlap, the greatest cost
counts. A person whose heading is unknown gets the circle `circle_around` the zone. The costmap does not
inflate costs by the robot's radius: navigation stacks do this themselves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import atan2, hypot
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from szlib.core.checks import Array
from szlib.core.errors import ZoneError
from szlib.zones.ellipses import BODY_RADIUS, Ellipse, circle_around

FADE = 0.5  # distance from a zone at which its cost reaches 0 [m] (assumed)
# speed above which the velocity gives the heading of a person [m/s] (assumed)
MIN_HEADING_SPEED = 0.2
# Walking speed of the zone that is drawn, if a zone depends on speed [m/s] (paper, sec. 4).
ZONE_SPEED = 1.1
# Costs of a body, at the centre of a zone, and at its boundary.
BODY_COST, CENTER_COST, BOUNDARY_COST = 100, 99, 50


@dataclass(frozen=True)
class Grid:
    """Cells of a costmap, along the axes of the world frame.

    Parameters
    ----------
    origin : (x, y) of the corner of cell (0, 0) with the smallest x and y [m].
    resolution : side of a cell [m].
    shape : (rows, columns): number of cells along y and along x.

    Raises
    ------
    ZoneError : a number is not finite, or `resolution` or `shape` is not positive.

    Examples
    --------
    >>> from costmaps import Grid
    >>> grid = Grid(origin=(-2.0, -2.0), resolution=0.1, shape=(40, 40))
    >>> grid.centers()[0, 0].round(2).tolist()
    [-1.95, -1.95]
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
        """(x, y) of the cell centres in these `rows` and `columns`, shape (rows, columns, 2) [m]."""
        (x, y), side = self.origin, self.resolution
        xs = x + side * (np.arange(self.shape[1])[columns] + 0.5)
        ys = y + side * (np.arange(self.shape[0])[rows] + 0.5)
        return np.stack(np.broadcast_arrays(xs, ys[:, None]), axis=-1)

    def window(self, center: tuple[float, float], radius: float) -> tuple[slice, slice]:
        """Rows and columns of all cells that may lie within `radius` of the point `center` [m]."""
        ends = []
        for middle, corner, cells in zip(center[::-1], self.origin[::-1], self.shape, strict=True):
            first, last = ((middle + side - corner) / self.resolution for side in (-radius, radius))
            ends.append(slice(int(np.clip(first - 1, 0, cells)), int(np.clip(last + 1, 0, cells))))
        return ends[0], ends[1]


def draw_costmap(
    zone: Any,
    people: Sequence[Any] | ArrayLike,
    grid: Grid,
    *,
    speed: float = ZONE_SPEED,
    fade: float = FADE,
    body_radius: float = BODY_RADIUS,
) -> NDArray[np.int8]:
    """Draw a zone around people into a costmap (see the top of this module for the costs).

    Parameters
    ----------
    zone : an `Ellipse` in the person's frame, or an object with a method `.ellipse(speed)`, such as
        `SocialZone`.
    people : array (n, 4) of x, y [m], vx, vy [m/s] in the world frame, or a sequence of `Person`. The `zone`
        of a `Person` replaces the argument `zone`. A person slower than 0.2 m/s has no known heading.
    grid : the cells.
    speed : walking speed of the zone, if it depends on speed [m/s].
    fade : distance from a zone at which its cost reaches 0 [m].
    body_radius : radius of a person's body [m].

    Returns
    -------
    Costs 0 to 100, int8, of shape `grid.shape`: [row, column] is the cell at y, x. Its `.ravel()` is
    `OccupancyGrid.data`.

    Raises
    ------
    ZoneError : a number is not finite or negative, a shape is wrong, or the zone is undefined at `speed`.

    Examples
    --------
    >>> import szlib
    >>> from costmaps import Grid, draw_costmap
    >>> zone = szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))
    >>> grid = Grid(origin=(-2.0, -2.0), resolution=0.5, shape=(8, 8))
    >>> costs = draw_costmap(zone, [[0.25, 0.25, 1.0, 0.0]], grid)
    >>> int(costs[4, 4]), int(costs[4, 5]), int(costs[0, 0])  # the body, the zone, far away
    (100, 79, 0)
    """
    if not (np.isfinite([fade, body_radius]).all() and min(fade, body_radius) >= 0):
        raise ZoneError(f"fade and body_radius must be finite and >= 0 [m]; got {fade}, {body_radius}")
    costs = np.zeros(grid.shape, np.int8)
    common = _as_ellipse(zone, speed)
    for (x, y), heading, own_zone in _read_people(people):
        ellipse = common if own_zone is None else _as_ellipse(own_zone, speed)
        placed = (circle_around(ellipse) if heading is None else ellipse).placed((x, y), heading or 0.0)
        offset = hypot(placed.center[0] - x, placed.center[1] - y)
        window = grid.window(placed.center, max(offset + body_radius, placed.semi_axes[0] + fade))
        points = grid.centers(*window)
        cost = _zone_cost(points, placed, fade)
        cost[np.hypot(*np.moveaxis(points - (x, y), -1, 0)) <= body_radius] = BODY_COST
        costs[window] = np.maximum(costs[window], cost)
    return costs


def _zone_cost(points: Array, zone: Ellipse, fade: float) -> NDArray[np.int8]:
    """Cost of a zone at points (..., 2), 0 to 99."""
    share = np.sqrt(zone.level(points))  # of the way from the centre to the boundary
    inside = np.rint(CENTER_COST - (CENTER_COST - BOUNDARY_COST) * share)
    distance = np.hypot(*np.moveaxis(points - zone.center, -1, 0)) * (1 - 1 / np.maximum(share, 1))
    outside = np.floor(BOUNDARY_COST * (1 - distance / fade)) if fade else np.zeros_like(share)
    return np.asarray(np.where(share <= 1, inside, np.clip(outside, 0, BOUNDARY_COST - 1)), np.int8)


def _read_people(
    people: Sequence[Any] | ArrayLike,
) -> Iterator[tuple[tuple[float, float], float | None, Any]]:
    """Position, heading (None: unknown) and own zone (None: none) of each person."""
    rows = people if isinstance(people, np.ndarray) else list(cast(Sequence[Any], people))
    if len(rows) and all(hasattr(row, "position") for row in rows):
        yield from ((row.position, row.heading, row.zone) for row in rows)
        return
    table = np.asarray(rows, float)
    if table.size and (table.ndim != 2 or table.shape[1] != 4):
        raise ZoneError(f"people must be Persons, or an array (n, 4): x, y, vx, vy; got {table.shape}")
    for i, (x, y, vx, vy) in enumerate(table.reshape(-1, 4).tolist()):
        if not np.isfinite([x, y, vx, vy]).all():
            raise ZoneError(f"people must be finite; person {i} is {[x, y, vx, vy]}: drop or repair it")
        yield (
            (x, y),
            atan2(vy, vx) if hypot(vx, vy) >= MIN_HEADING_SPEED else None,
            None,
        )


def _as_ellipse(zone: Any, speed: float) -> Ellipse:
    return cast(Ellipse, zone.ellipse(speed) if hasattr(zone, "ellipse") else zone)

"""Where the plan heads: a way through space and time, and the side of a person who is met head-on.

A *map* of cells holds the time to the goal from each cell: around everything fixed, and around people who
stand (Dijkstra's algorithm). Around the robot a *search in space and time* continues it to people who walk:
in one layer of cells after the other it finds the least cost to be there at that time (dynamic programming).
A second costs 1, more in a zone, and much more where a body is. So to wait has its price as well.

Two ways are *distinct* if they pass a person or something fixed on different sides: seen from there, one
turns by about 2 pi more than the other (their winding numbers differ). In front of and behind a person who
walks are different sides, too. An optimiser that improves a plan in small steps never changes the side: each
side needs a plan of its own. The next way is found where places near the ways before have a price.

The robot keeps its way until another one is `SWITCH_GAIN` cheaper, so that it does not dither (hysteresis).
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from math import acos, atan2, ceil, cos, dist, hypot, inf, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import binary_dilation
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from ..core.checks import Array, check_number, check_point, require
from ..core.errors import SolverError
from ..zones.ellipses import BODY_RADIUS
from .obstacles import (
    Group,
    Obstacles,
    Wall,
    Zone,
    barrier,
    find_bodies,
    find_places,
)
from .people import STANDING_SPEED
from .settings import MPCSettings
from .walls import read_walls

Point = tuple[float, float]
Cells = NDArray[np.intp]
Mask = NDArray[np.bool_]
CELL = 0.15
"""Side of a cell [m] (assumed)."""
MOST_CELLS = 250_000
"""Number of cells of a map; those of a larger one are larger (assumed)."""
SEARCH_RADIUS, SEARCH_TIME = 4.0, 6.0
"""How far the search looks, from the robot [m], and in time [s] (assumed)."""
SEARCH_INTERVAL = 0.4
"""Time between two searches, rounded up to whole steps [s] (assumed)."""
ZONE_SECOND, BODY_SECOND, REPEAT_SECOND = 2.0, 100.0, 1.5
"""Price of a second in a zone, in a body, and near a way that was found before [s] (assumed)."""
SIDE_PRICE = 0.5
"""Price of meeting people head-on, and passing on the side that is not `pass_side` [s] (assumed)."""
GROUP_SECOND, GROUP_DISTANCE, GROUP_SPEED = 4.0, 1.5, 0.3
"""Price of a second between people who are together [s]; how near [m] and alike [m/s] they are (assumed)."""
SWITCH_GAIN = 1.0
"""A way is kept until another one is this much cheaper [s] (assumed)."""
_GROUP_REACH = (
    3.0  # people of a group that is given are together up to this distance [m]
)
MOST_WAYS = 3
"""Number of ways that are looked for (assumed)."""
_AROUND_WALLS, _AROUND_POINTS = 2.0, 8.0  # edge of a map [m]
_FARTHEST = 20.0  # of a target on a route [m]
_LEAST = 0.06  # clearance that a map can show [m]
_CHUNK = 1_000_000  # cells that are measured at once
_PEOPLE = 10.0  # people who are farther from the robot than this are left out [m]
# places of people who stand are rounded so, and a goal is the same if it moved less [m]
_MOVED, _GOAL_MOVED = 0.3, 0.5
_NEAR_WAY = 0.45  # places that are nearer to a way than this are near it [m]
_PLACES = 48  # of what is fixed, around which turns are measured
_MOST_SHARE = 1.2  # least offset of obstacles, in cells: no step leads across a wall
_NEIGHBOURS = (0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1)
_MOVE_PRICE = (
    0.015  # price of a step to a neighbour: a robot that waits stands still [s]
)
_NAMED_WITHIN = 2.5  # people who are passed nearer than this are named [m]
_DOOR = 0.6  # a door has less room than this on both sides, and more so far before and behind [m]
_NAMED = 3  # largest number of parts of a name
_WAITING = 8  # tenths of a second of rest that are called waiting
# where free space is looked for, from a zone's centre to where the robot passes
_ALONG = np.linspace(0, 1, 20)
# times at which people are looked at [s], and the time between two of them
_TIMES = np.linspace(0.0, 2 * SEARCH_TIME, 121)
_TICK, _LAST = float(_TIMES[1]), 60  # of a search
_MOVES = np.array([[2, 1, 2], [1, 0, 1], [2, 1, 2]], np.float32)


class Way(NamedTuple):
    """A way to the goal.

    Attributes
    ----------
    points : from where the robot was when the way was found, at most `SEARCH_INTERVAL` ago, shape (k, 2) [m].
    times : when the robot is there, from then on, shape (k,) [s].
    cost : time to the end, and the prices on the way [s].
    name : in words, such as "left of person 3, behind person 5".
    """

    points: Array
    times: Array
    cost: float
    name: str = ""

    def at(self, times: Array) -> Array:
        """Where the robot is at these `times`, shape (n, 2) [m]; at the goal from its arrival on."""
        x, y = (np.interp(times, self.times, each) for each in self.points.T)
        return np.column_stack([x, y])


class Heading(NamedTuple):
    """Where a plan heads.

    Attributes
    ----------
    target : the point that attracts it [m].
    length : of the way to the goal [m]; inf if there is none.
    ways : those that were found, the one that is taken first.
    is_searched : True if the ways were looked for in this step, not taken from one before.
    """

    target: Point
    length: float
    ways: tuple[Way, ...] = ()
    is_searched: bool = False


class Map:
    """Cells, those that are free of everything fixed, and the time from each to a goal.

    Parameters
    ----------
    fixed : what is fixed.
    points : which the map must hold, shape (n, 2) [m].
    cell : side of a cell [m].

    Attributes
    ----------
    free : whether h >= 0 in the centre of a cell, shape (nx, ny).
    price : of a second in a cell, because of people who stand [s].
    seconds_to_goal : from the centre of a cell [s]; inf without a way.
    """

    def __init__(self, fixed: Obstacles, points: Array, cell: float = CELL) -> None:
        boxes = [g.kind.bounds(g.numbers, g.offsets) for g in fixed.groups]
        ends = np.concatenate([np.zeros((0, 2)), *(e for box in boxes for e in box)])
        ends = ends[np.isfinite(ends).all(axis=1)]
        first, last = points.min(axis=0), points.max(axis=0)
        low = np.minimum(
            first - _AROUND_POINTS, ends.min(axis=0, initial=inf) - _AROUND_WALLS
        )
        high = np.maximum(
            last + _AROUND_POINTS, ends.max(axis=0, initial=-inf) + _AROUND_WALLS
        )
        # of a large building the part around the points
        (w, h), most = last - first, MOST_CELLS * cell**2
        margin = (sqrt(max((w - h) ** 2 + 4 * most, (w + h) ** 2)) - w - h) / 4
        margin = max(margin, _AROUND_POINTS)
        self.corner = np.maximum(low, first - margin)
        size = np.minimum(high, last + margin) - self.corner
        self.cell = max(cell, float(sqrt(size.prod() / MOST_CELLS)))
        self.shape: tuple[int, ...] = tuple(
            np.ceil(size / self.cell).astype(int).tolist()
        )
        offsets = [g.offsets.min(initial=inf) for g in fixed.groups]
        self._is_thin = min(offsets, default=inf) < 2 * self.cell
        covered = self._cover(fixed)
        self.free = ~covered | covered.all()
        self._places = np.argwhere(self.free)
        self._link()

    def _cover(self, fixed: Obstacles) -> Mask:
        """Where h < 0. Each obstacle is measured in the cells of its box."""
        covered = np.zeros(self.shape, bool)
        for kind, numbers, given in fixed.groups:
            offsets = np.maximum(given, _MOST_SHARE * self.cell)
            ends = [
                ((each - self.corner) / self.cell).clip(0, self.shape)
                for each in kind.bounds(numbers, offsets)
            ]
            first, last = (each.astype(int) for each in (ends[0], ends[1] + 1))
            last = np.minimum(last, self.shape)
            size = np.maximum(last - first, 0)
            counts = size.prod(axis=1)
            parts = np.flatnonzero(np.diff(counts.cumsum() // _CHUNK)) + 1
            for rows in np.split(np.arange(len(counts)), parts):
                which = np.repeat(rows, counts[rows])
                begins = counts[rows].cumsum() - counts[rows]
                place = np.arange(len(which)) - np.repeat(begins, counts[rows])
                i, j = first[which].T + np.divmod(place, size[which, 1])
                x, y = self.centers(np.column_stack([i, j])).T
                d = kind.distance(x, y, 0.0, *numbers[which].T)
                unsafe = d < offsets[which]
                covered[i[unsafe], j[unsafe]] = True
        return covered

    def _link(self) -> None:
        """Find the pairs of free neighbours, in 16 directions, and their distances."""
        nx, ny = self.shape
        padded = np.full((nx + 4, ny + 4), -1, np.int32)
        self._numbers = padded[2:-2, 2:-2]
        self._numbers[self.free] = np.arange(len(self._places))
        begins, ends, lengths = list[Any](), list[Any](), list[Array]()
        for a, b in _NEIGHBOURS:
            to = padded[2 + a : nx + 2 + a, 2 + b : ny + 2 + b]
            both = (self._numbers >= 0) & (to >= 0)
            begins.append(self._numbers[both])
            ends.append(to[both])
            lengths.append(np.full(len(begins[-1]), self.cell * hypot(a, b)))
        self._pairs = np.concatenate(begins), np.concatenate(ends)
        self._lengths = np.concatenate(lengths)

    def centers(self, cells: Cells) -> Array:
        """Centres of `cells`, shape (n, 2) [m]."""
        return np.asarray(self.corner + (cells + 0.5) * self.cell)

    def holds(self, *points: Point) -> bool:
        """True if these `points` lie within the map."""
        at = (np.array(points) - self.corner) / self.cell
        return bool((at >= 0).all() and (at < self.shape).all())

    def locate(self, points: Array) -> tuple[Cells, Cells]:
        """The cells of `points`, shape (..., 2), as two indices; beyond the map the nearest one."""
        cells = np.floor((points - self.corner) / self.cell).astype(int)
        i, j = np.moveaxis(cells.clip(0, np.array(self.shape) - 1), -1, 0)
        return i, j

    def find_cell(self, point: ArrayLike, among: Mask | None = None) -> tuple[int, ...]:
        """The cell of a `point`, or the nearest one that is free, or is `among` these."""
        at, mask = self.locate(np.array(point)), self.free if among is None else among
        if mask[at]:
            return int(at[0]), int(at[1])
        places = np.argwhere(mask)
        return tuple(places[((places - at) ** 2).sum(axis=1).argmin()].tolist())

    def measure(self, start: Point, goal: Point, speed: float, price: Array) -> bool:
        """Measure the times to the `goal` at this `speed` [m/s], with the `price` of a second in each cell.

        False if there is no way from the `start`: the times are to the nearest point that can be reached.
        """
        self.price, at = price, self.find_cell(start)
        cost, (i, j) = 1 + price[self.free], self._pairs
        weights = self._lengths / speed * (cost[i] + cost[j]) / 2
        n = len(cost)
        graph = coo_array((weights, (i, j)), shape=(n, n)).tocsr()
        end = self.find_cell(goal)
        self._measure_from(graph, end)
        if np.isfinite(self.seconds_to_goal[at]):
            return True
        self._measure_from(graph, at)
        self._measure_from(
            graph, self.find_cell(goal, np.isfinite(self.seconds_to_goal))
        )
        return False

    def _measure_from(self, graph: Any, cell: tuple[int, ...]) -> None:
        far, self._next = dijkstra(
            graph, directed=False, indices=self._numbers[cell], return_predecessors=True
        )
        self.seconds_to_goal, self.end = np.full(self.shape, inf), cell
        self.seconds_to_goal[self.free] = far

    def descend(self, cell: tuple[int, ...]) -> Array:
        """Centres of the cells from `cell` to the end, shape (n, 2) [m]."""
        found, k = list[int](), int(self._numbers[cell])
        while k >= 0:
            found.append(k)
            k = int(self._next[k])
        return self.centers(self._places[found])

    def sees(self, start: Array, ends: Array, blocked: Mask) -> Mask:
        """Whether straight lines from `start` to `ends`, shape (n, 2) [m], cross no cell that is `blocked`.

        Those around the start do not count.
        """
        longest = np.abs(ends - start).max(initial=0.0) * (1 + self._is_thin)
        shares = np.linspace(0, 1, 2 + int(longest / self.cell))
        offsets = shares[:, None, None] * (ends - start)
        nearest = 1.5 * self.cell
        if self._is_thin and not blocked[self.locate(start)]:
            nearest = 0.0
        is_away = np.hypot(*np.moveaxis(offsets, -1, 0)) >= nearest
        return np.asarray(
            ~(blocked[self.locate(start + offsets)] & is_away).any(axis=0)
        )


def find_route(
    start: ArrayLike, goal: ArrayLike, walls: Any, clearance: float
) -> Array:
    """Find a short way from `start` to `goal` around `walls`: a polyline, shape (m, 2) [m].

    It is some 3 % longer than the shortest one: it leads over cells of at most `CELL`.

    Parameters
    ----------
    start, goal : (x, y) [m].
    walls : as of `MPCCBF`.
    clearance : distance to keep from walls [m]; at least 6 cm. A `start` or `goal` nearer to a wall begins or
        ends at the nearest place that is free.

    Returns
    -------
    The corners of the way, with start and goal; empty, shape (0, 2), if there is none.

    Raises
    ------
    SolverError : a number or a wall cannot be used.

    Examples
    --------
    >>> from szlib.control import find_route
    >>> route = find_route((0.0, 0.0), (4.0, 0.0), walls=[[(2.0, -1.0), (2.0, 5.0)]], clearance=0.5)
    >>> bool(route[:, 1].min() < -1.4)  # around the lower end
    True
    """
    c, at, end = (
        check_number("clearance", clearance),
        check_point("start", start),
        check_point("goal", goal),
    )
    require(c >= 0, "clearance", clearance, "a number >= 0", SolverError)
    segments, c = read_walls(walls), max(c, _LEAST)
    length = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    group = Group(Wall, segments.reshape(-1, 4), c + c**2 / length)
    found = Map(Obstacles((group,), c), np.array([at, end]), _choose_cell(c))
    if not found.measure(at, end, 1.0, np.zeros(found.shape)):
        return np.zeros((0, 2))
    points = np.vstack([at, found.descend(found.find_cell(at))[1:-1], end])
    corners = [0]
    while corners[-1] < len(points) - 1:
        ahead = points[corners[-1] + 1 :]
        seen = np.flatnonzero(found.sees(points[corners[-1]], ahead, ~found.free))
        corners.append(corners[-1] + 1 + int(seen.max(initial=0)))
    return points[corners]


def _choose_cell(clearance: float) -> float:
    """Side of a cell with which a map shows walls of this `clearance` [m]."""
    return min(CELL, max(_LEAST, clearance) / _MOST_SHARE)


class WayFinder:
    """Ways of one robot around what is fixed and people; it remembers the map, and the way that it is on.

    Parameters
    ----------
    fixed : what is fixed.
    settings : of the robot.
    """

    def __init__(self, fixed: Obstacles, settings: MPCSettings) -> None:
        self._fixed, self._s = fixed, settings
        self._map: Map | None = None
        self._every = ceil(SEARCH_INTERVAL / settings.dt)
        self.reset()

    def reset(self) -> None:
        """Forget the goal and the way."""
        self._ways, self._goal, self._steps = list[Way](), (inf, inf), 0
        self._n_people, self._known = 0, tuple[Any, ...]()

    def find(
        self,
        at: Point,
        goal: Point,
        zones: Obstacles,
        groups: Sequence[Hashable] = (),
    ) -> Heading:
        """The way from `at` to the `goal` among people with these `zones` and `groups`."""
        if dist(goal, self._goal) > _GOAL_MOVED:
            self._ways, self._goal, self._steps = [], goal, 0
        m = self._get_map(at, goal)
        is_searched = not self._steps or zones.size != self._n_people
        if is_searched:
            self._search(at, goal, _Stamps(zones, groups, m.cell, self._s))
            self._steps, self._n_people = self._every, zones.size
        self._steps -= 1
        heading = self._find_target(at, goal, self._ways[0].points, self._blocked)
        length, ways = heading.length if self._is_reached else inf, tuple(self._ways)
        return heading._replace(length=length, ways=ways, is_searched=is_searched)

    def follow(self, at: Point, goal: Point, route: Array) -> Heading | None:
        """The target from `at` on a `route` to the `goal`, shape (m, 2) [m]; None if no point is in sight."""
        m, self._steps = self._get_map(at, goal), 0
        corners = np.vstack([route, goal])
        lengths = _time(corners, 1.0)
        along = np.linspace(0, lengths[-1], 2 + int(lengths[-1] / m.cell))
        points = np.column_stack(
            [np.interp(along, lengths, each) for each in corners.T]
        )
        begin = int(np.hypot(*(points - at).T).argmin())
        near = points[begin:][: 1 + int(min(self._s.lookahead, _FARTHEST) / m.cell)]
        if not m.sees(np.array(at), near, ~m.free).any():
            return None
        return self._find_target(at, goal, points, ~m.free)

    def _get_map(self, at: Point, goal: Point) -> Map:
        """The map that holds these points."""
        if self._map is None or not self._map.holds(at, goal):
            side = _choose_cell(self._s.r_robot + self._s.eps)
            self._map, self._known = Map(self._fixed, np.array([at, goal]), side), ()
            self._steps = 0
        return self._map

    def _search(self, at: Point, goal: Point, stamps: _Stamps) -> None:
        """Find the ways anew, and choose one."""
        m = self._get_map(at, goal)
        places = stamps.find_places(_TIMES)
        is_near = np.hypot(*(places[:, 0] - at).T) < _PEOPLE
        moved = np.hypot(*(places[:, _LAST] - places[:, 0]).T)
        stands = is_near & (moved < STANDING_SPEED * SEARCH_TIME)
        near = np.flatnonzero(is_near[: stamps.n_people])
        people = places[near]
        known = (self._goal, *np.round(places[stands, 0] / _MOVED).ravel().tolist())
        if known != self._known or not np.isfinite(m.seconds_to_goal[m.find_cell(at)]):
            price = np.zeros((1, *m.shape))
            stamps.add(price, np.flatnonzero(stands), np.zeros(1), m.corner)
            self._is_reached = m.measure(at, goal, self._s.v_max, price[0])
            self._known, self._blocked = known, ~m.free | (price[0] >= BODY_SECOND)
        walks = np.flatnonzero(is_near & ~stands)
        around = self._list_around(m, at, people)
        found = self._find_ways(m, at, goal, people, around, stamps, walks)
        ways = sorted(found, key=lambda way: way.cost)
        if self._ways:
            before = _cut(self._ways[0], at)
            kept = [way for way in ways if not _differ(way, before, around)]
            if kept and kept[0].cost < ways[0].cost + SWITCH_GAIN:
                ways = [kept[0], *(way for way in ways if way is not kept[0])]
        names = [_name(m, way, people, near.tolist()) for way in ways]
        if not self._is_reached:
            names = ["to the nearest point that it can reach"] * len(ways)
        pairs = zip(ways, names, strict=True)
        self._ways = [way._replace(name=name) for way, name in pairs]

    def _find_ways(
        self,
        m: Map,
        at: Point,
        goal: Point,
        people: Array,
        around: Array,
        stamps: _Stamps,
        walks: Cells,
    ) -> list[Way]:
        """Distinct ways on the map `m` among `people`; those in the rows `walks` of `stamps` walk."""
        v_max = self._s.v_max
        start = np.array(m.find_cell(at, np.isfinite(m.seconds_to_goal)))
        size = ceil(SEARCH_RADIUS / m.cell)
        low, high = np.maximum(start - size, 0), np.minimum(start + size + 1, m.shape)
        window = tuple(slice(*ends) for ends in zip(low, high, strict=True))
        far, begin = m.seconds_to_goal[window], tuple((start - low).tolist())
        ends = np.array(goal)[None] if self._is_reached else np.zeros((0, 2))
        dt = 1.2 * m.cell / v_max  # between a step along an axis and a diagonal one
        times: Array = dt * np.arange(1.0, ceil(SEARCH_TIME / dt) + 1)
        prices = np.zeros((len(times), *far.shape))
        stamps.add(prices, walks, times, m.corner + low * m.cell)
        if not prices.any() and not m.price[window].any():
            points = np.vstack([at, m.descend(tuple(start.tolist()))[1:], ends])
            if len(ends) and m.sees(points[0], ends, ~m.free)[0]:
                points = np.linspace(at, goal, len(points))
            return [Way(points, _time(points, v_max), float(far[begin]))]
        costs = (dt * (1 + m.price[window] + prices)).astype(np.float32)
        costs[:, ~m.free[window]] = inf
        end = np.array(m.end) - low
        if (end >= 0).all() and (end < far.shape).all():
            costs[:, end[0], end[1]] = 0.0  # a robot at its goal may stay there
        ways, again = list[Way](), np.zeros(far.shape, np.float32)
        layers, tube = (
            np.arange(len(times)),
            np.ones(2 * [2 * int(_NEAR_WAY / m.cell) + 1]),
        )
        while len(ways) < MOST_WAYS:
            cells = _cross_layers(costs + again, begin, far)
            then = tuple(cells[-1].tolist())
            rest = m.descend(tuple((low + then).tolist()))[1:]
            points, k = (
                np.vstack([at, m.centers(low + cells[1:]), rest, ends]),
                len(cells) - 1,
            )
            begun = np.concatenate([[0.0], times[:k]])
            late = begun[-1] + _time(points[k:], v_max)[1:]
            cost = float(costs[layers[:k], *cells[1:].T].sum() + far[then])
            way = Way(points, np.concatenate([begun, late]), cost)
            way = way._replace(cost=cost + self._price_sides(way, people))
            if any(not _differ(way, each, around) for each in ways):
                break
            ways.append(way)
            used = np.zeros(far.shape, bool)
            used[tuple(cells.T)] = np.hypot(*(cells - begin).T) * m.cell > 2 * _NEAR_WAY
            again += np.float32(dt * REPEAT_SECOND) * binary_dilation(used, tube)
        return ways

    @staticmethod
    def _list_around(m: Map, at: Point, people: Array) -> Array:
        """Places of `people`, and those that are not free, at `_TIMES`, shape (n, k, 2) [m]."""
        size = ceil(SEARCH_RADIUS / m.cell)
        i, j = (each - size for each in m.find_cell(at))
        around = m.free[max(i, 0) : i + 2 * size, max(j, 0) : j + 2 * size]
        fixed = np.argwhere(~around)
        fixed = fixed[:: 1 + len(fixed) // _PLACES] + np.maximum([i, j], 0)
        still = np.repeat(m.centers(fixed)[:, None], len(_TIMES), axis=1)
        return np.concatenate([people, still])

    def _price_sides(self, way: Way, people: Array) -> float:
        """Price of a `way` that meets `people` head-on, and passes on the side that is not preferred [s]."""
        ahead = way.points[-1] - way.points[0]
        vx, vy = (people[:, 1] - people[:, 0]).T / _TICK
        across = np.abs(ahead[0] * vy - ahead[1] * vx)
        share = self._s.head_on_share * np.hypot(vx, vy) * np.hypot(*ahead)
        meets = (across <= share) & (ahead[0] * vx + ahead[1] * vy <= 0)
        sign = 1 if self._s.pass_side == "right" else -1
        turns = sign * _find_turns(way, people)
        return SIDE_PRICE * bool((meets & (turns < -pi / 2)).any())

    def _find_target(
        self, at: Point, goal: Point, points: Array, blocked: Mask
    ) -> Heading:
        """The target on the way through these `points`: the farthest one in sight, at most `lookahead` away.

        Behind it the target goes on straight ahead while this is free, so that the robot does not stop there.
        """
        m, p = self._get_map(at, goal), np.array(at)
        points = points[int(np.hypot(*(points - p).T).argmin()) :]
        lengths, lookahead = _time(np.vstack([p, points]), 1.0)[1:], self._s.lookahead
        n = int(np.searchsorted(lengths, min(lookahead, _FARTHEST)))
        n = max(n, min(2, len(points)))  # the next cell of a large map may be farther
        choice = np.unique(np.r_[min(1, n - 1) : min(8, n), 8:n:3, n - 1])
        seen = choice[m.sees(p, points[choice], blocked)]
        around = int(np.searchsorted(lengths, 3 * m.cell))  # a corner, close by
        if around < len(points) and blocked[m.locate(points[around])]:
            around = 0  # somebody stands there
        i = max(int(seen.max(initial=0)), min(around, n - 1))
        last, left = points[i], float(lengths[-1] - lengths[i])
        gone = float(np.hypot(*(last - p)))
        if not left or gone < 2 * m.cell:
            return Heading((float(last[0]), float(last[1])), gone + left)
        reach = min(lookahead, gone + left)
        shares = np.linspace(reach / (gone or 1.0), 1.0, 12)
        beyond = p + shares[:, None] * (last - p)
        free = m.sees(p, beyond, blocked)
        x, y = (beyond[free.argmax()] if free.any() else last).tolist()
        return Heading((x, y), gone + left)


def _find_turns(way: Way, around: Array) -> Array:
    """Angles by which a `way` turns around places `around` it at `_TIMES`, shape (n,) [rad]."""
    offset = way.at(_TIMES) - around
    turns = np.diff(np.arctan2(offset[..., 1], offset[..., 0]), axis=1)
    return np.asarray(((turns + pi) % (2 * pi) - pi).sum(axis=1))


def _differ(a: Way, b: Way, around: Array) -> bool:
    """True if the ways `a` and `b` are distinct, by what is `around` them."""
    turns = _find_turns(a, around) - _find_turns(b, around)
    return bool((np.abs(turns) > pi).any())


class _Stamps:
    """Prices of cells around each person, and between two who stand or walk together.

    Parameters
    ----------
    zones : of all people.
    groups : to which they belong, None for somebody of whom this is not known; empty: it is known of nobody.
    cell : side of a cell [m].
    s : settings of the robot.
    """

    def __init__(
        self,
        zones: Obstacles,
        groups: Sequence[Hashable],
        cell: float,
        s: MPCSettings,
    ) -> None:
        self._cell, self._zones, self.n_people = cell, zones, zones.size
        if not zones.groups:
            return
        own, bodies = zones.groups[0], find_bodies(zones, s).groups[0]
        people = own.numbers[:, 5:9]
        foci = np.abs(own.numbers[:, :4] - np.tile(people[:, 2:], 2)).max()
        reach = foci + float((own.numbers[:, 4] + own.offsets).max())
        reach = max(reach, BODY_RADIUS + float(bodies.offsets.max()))
        reach = ceil(min(reach, 2 * SEARCH_RADIUS) / cell)
        steps = np.arange(-reach, reach + 1)
        cells = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)
        x, y = np.moveaxis(people[:, None, None, 2:] + cell * cells, -1, 0)
        prices = np.zeros(x.shape)
        for (kind, numbers, offsets), price in (
            (own, ZONE_SECOND),
            (bodies, BODY_SECOND),
        ):
            d = kind.distance(x, y, 0.0, *numbers.T[..., None, None])
            prices[d < offsets[:, None, None]] = price
        i, j = np.triu_indices(len(people), 1)
        apart = np.hypot(*(people[i] - people[j])[:, 2:].T)
        differ = np.hypot(*(people[i] - people[j])[:, :2].T)
        together = (apart < GROUP_DISTANCE) & (differ < GROUP_SPEED)
        if any(group is not None for group in groups):
            pairs = zip(i.tolist(), j.tolist(), strict=True)
            is_same = [groups[a] == groups[b] for a, b in pairs]
            is_known = np.array([group is not None for group in groups])
            known = is_known[i] & is_known[j]
            together[known] = (np.array(is_same) & (apart < _GROUP_REACH))[known]
        i, j, apart = i[together], j[together], apart[together]
        between = np.hypot(*cells.T) * cell < apart[:, None, None] / 2
        self._prices = np.concatenate([prices, GROUP_SECOND * between])
        self._pairs = i, j

    def find_places(self, times: Array) -> Array:
        """Places of people, and of the middles of pairs, at these `times`, shape (n, k, 2) [m]."""
        if not self._zones.groups:
            return np.zeros((0, len(times), 2))
        people, (i, j) = find_places(self._zones.groups[0], times), self._pairs
        return np.concatenate([people, (people[i] + people[j]) / 2])

    def add(self, prices: Array, rows: Cells, times: Array, corner: Array) -> None:
        """Add the `prices` of the people in these `rows`, at each of these `times`, shape (times, nx, ny).

        The `corner` is that of the first cell [m]. Where people overlap, the higher price counts.
        """
        cells = np.floor((self.find_places(times) - corner) / self._cell).astype(int)
        for row in rows:
            stamp = self._prices[row]
            first = cells[row] - len(stamp) // 2
            for layer, (i, j) in zip(prices, first.tolist(), strict=True):
                part = layer[max(i, 0) : max(i + len(stamp), 0)]
                part = part[:, max(j, 0) : max(j + len(stamp), 0)]
                own = stamp[max(-i, 0) :, max(-j, 0) :][: len(part), : part.shape[1]]
                np.maximum(part, own, out=part)


def _cross_layers(costs: Any, begin: tuple[int, ...], far: Array) -> Array:
    """Cells of the cheapest way through layers of `costs`, one in each, shape (k + 1, 2).

    It begins in the cell `begin`, and ends in the last layer, or in any at the edge: where its cost and `far`
    are least together.
    """
    layers = np.full((len(costs) + 1, *(n + 2 for n in far.shape)), inf, np.float32)
    layers[0, begin[0] + 1, begin[1] + 1] = 0.0
    step = np.float32(_MOVE_PRICE)
    for now, then, cost in zip(layers, layers[1:], costs, strict=False):
        across = np.minimum(np.minimum(now[:-2], now[2:]) + step, now[1:-1])
        both = np.minimum(across[:, :-2], across[:, 2:]) + step
        then[1:-1, 1:-1] = np.minimum(both, across[:, 1:-1]) + cost
    ends = layers[:, 1:-1, 1:-1] + far
    ends[:-1, 1:-1, 1:-1] = inf
    k, i, j = (int(each) for each in np.unravel_index(ends.argmin(), ends.shape))
    cells = [(i, j)]
    for layer in layers[:k][::-1]:
        i, j = cells[-1]
        a, b = divmod(int((layer[i : i + 3, j : j + 3] + step * _MOVES).argmin()), 3)
        cells.append((i + a - 1, j + b - 1))
    return np.array(cells[::-1])


def _time(points: Array, speed: float) -> Array:
    """Times at which a robot of this `speed` [m/s] is at these `points`, shape (n,) [s]."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], lengths.cumsum() / speed])


def _cut(way: Way, at: Point) -> Way:
    """What is left of a `way` for a robot that is `at` this point."""
    k = int(np.hypot(*(way.points - at).T).argmin())
    return way._replace(
        points=np.vstack([at, way.points[k + 1 :]]), times=way.times[k:] - way.times[k]
    )


def _find_door(m: Map, way: Way) -> list[tuple[float, str]]:
    """When a way leads through the first door, and where: it is narrow, with more room before and behind."""
    lengths = _time(way.points, 1.0)
    along = np.arange(0.0, min(float(lengths[-1]), 2 * SEARCH_RADIUS), m.cell)
    places = np.column_stack([np.interp(along, lengths, each) for each in way.points.T])
    if len(places) < 3:
        return []
    ahead = np.gradient(places, axis=0)
    across = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    across /= np.maximum(np.hypot(*across.T), 1e-9)[:, None]
    aside = np.arange(m.cell, _DOOR + m.cell, m.cell)[:, None, None]
    left, right = (
        ~m.free[m.locate(places + side * aside * across)].all(axis=0)
        for side in (-1, 1)
    )
    n = ceil(_DOOR / m.cell)
    narrow = np.pad(left & right, n)
    doors = np.flatnonzero(narrow[n:-n] & ~narrow[: -2 * n] & ~narrow[2 * n :])
    doors = doors[doors - doors[:1] == np.arange(len(doors))]  # the first one
    return [
        (
            float(np.interp(along[k], lengths, way.times)),
            "through the door at ({:.1f}, {:.1f})".format(*places[k]),
        )
        for k in doors[len(doors) // 2 :][:1]
    ]


def _name(m: Map, way: Way, people: Array, numbers: Sequence[int]) -> str:
    """A way in words: a door, the side of people whom it passes, and for whom it waits."""
    times, found = _TIMES, _find_door(m, way)
    points = way.at(times)
    for number, places in zip(numbers, people, strict=True):
        offset = points - places
        k = int(np.hypot(*offset.T).argmin())
        if not 0 < k < len(times) - 1 or np.hypot(*offset[k]) > _NAMED_WITHIN:
            continue
        dx, dy = points[min(k + 5, 120)] - points[max(k - 5, 0)]
        (x, y), (vx, vy) = offset[k], (places[k + 1] - places[k]) / _TICK
        if abs(dx * vy - dy * vx) > 0.5 * hypot(dx, dy) * max(
            hypot(vx, vy), STANDING_SPEED
        ):
            side = "in front of" if x * vx + y * vy > 0 else "behind"
        else:
            side = "left of" if dx * y - dy * x > 0 else "right of"
        found.append((times[k], f"{side} person {number}"))
    words = [word for _, word in sorted(found)[:_NAMED]]
    moved = np.hypot(*np.diff(points, axis=0).T)
    away = np.hypot(*(way.points - way.points[-1]).T) > 2 * m.cell
    arrival = way.times[np.flatnonzero(away)].max(initial=0.0)
    rests = (moved < 0.2 * moved.max(initial=0.0)) & (times[1:] < arrival)
    if rests.sum() >= _WAITING and len(people):
        last = points[np.flatnonzero(rests)[-1]]
        gaps = np.hypot(*(people[:, 0] - last).T)
        words.insert(0, f"waits for person {numbers[int(gaps.argmin())]}")
    straight = float(np.hypot(*(way.points[-1] - way.points[0])))
    is_straight = _time(way.points, 1.0)[-1] < 1.05 * straight + m.cell
    return ", ".join(words) or (
        "straight to the goal" if is_straight else "around walls"
    )


def find_target(
    position: tuple[float, float],
    goal: tuple[float, float],
    zones: Sequence[Sequence[float]],
    fixed: Obstacles,
    settings: MPCSettings,
) -> tuple[float, float]:
    """Find the point that attracts the plan [m]: the goal, or one beside a person who is met head-on.

    Parameters
    ----------
    position, goal : (x, y) of the robot and of its goal [m].
    zones : the numbers of the `Zone` of each person.
    fixed : walls, and whatever else stands still.
    settings : `head_on_share`, `pass_side`, and what the barriers need.

    Notes
    -----
    A person blocks the way if the line to the goal enters the set h < 0, itself an ellipse with the foci of
    the zone. Its two tangents from the robot lie at the angles +-w about -grad h, the bisector of the
    directions to the foci (this holds for all confocal ellipses). Let the goal lie at the angle b from there.
    At b = 0 both ways around are equally long, the optimum is to stand still in front of the person, and
    every solver stays there for ever. So for |b| <= share * w, with share = `head_on_share`, the target lies
    along the tangent on `pass_side`, as far away as the goal. Once the robot is on that side, the target
    turns back to the goal between |b| = share * w and 2 share * w, without a jump. If a wall leaves no space
    beside the person on that side, the same holds for the other side. If there is no space at all, the
    target stays the goal, and the robot yields. The paper has no such rule.

    The rule holds only if the barrier is active now, h <= closing speed * dt / gamma, or may become so
    within the horizon, h <= closing speed * horizon. (With the first condition alone and gamma > 1/N, the
    slightest tilt of the zone would decide the side before this rule does.) It does not hold for people who
    walk across the way, because they clear it themselves, nor for a person who stands on the goal. The
    nearest person counts.
    """
    s = settings
    (x, y), way = position, (goal[0] - position[0], goal[1] - position[1])
    distance = hypot(*way)
    if distance == 0 or s.head_on_share == 0:
        return goal
    nearest, target = inf, goal
    for zone in zones:
        vx, vy = zone[5:7]
        speed = hypot(vx, vy)
        if abs(_cross(way, (vx, vy))) > s.head_on_share * speed * distance:
            continue
        h = barrier(Zone.distance(x, y, 0.0, *zone), s.r_robot, s.eps)
        closing = (s.v_max + speed) * s.dt
        reach = max(closing / s.gamma, closing * sum(s.step_lengths))
        if h > min(nearest, distance, reach):
            continue
        angles = _find_angles(zone, position, way, s)
        if angles is None:
            continue
        nearest, target = h, goal
        turn = _find_turn(zone, goal, way, *angles, fixed, s)
        if turn is not None:
            c, d = cos(turn), sin(turn)
            target = (x + c * way[0] - d * way[1], y + d * way[0] + c * way[1])
    return target


def _find_angles(
    zone: Sequence[float],
    position: tuple[float, float],
    way: tuple[float, float],
    s: MPCSettings,
) -> tuple[float, float] | None:
    """w, half the angle between the tangents, and b, that of the way from their middle; None on a focus."""
    (x, y), (xa, ya, xb, yb, *_) = position, zone
    to_a, to_b = (xa - x, ya - y), (xb - x, yb - y)
    ra, rb = hypot(*to_a), hypot(*to_b)
    if ra * rb == 0:
        return None
    inward = (to_a[0] / ra + to_b[0] / rb, to_a[1] / ra + to_b[1] / rb)
    cosine = (ra**2 + rb**2 - 4 * _unsafe_semi_axis(zone, s) ** 2) / (2 * ra * rb)
    w = acos(max(-1.0, min(1.0, cosine))) / 2
    return w, atan2(_cross(inward, way), inward[0] * way[0] + inward[1] * way[1])


def _find_turn(
    zone: Sequence[float],
    goal: tuple[float, float],
    way: tuple[float, float],
    w: float,
    b: float,
    fixed: Obstacles,
    s: MPCSettings,
) -> float | None:
    """Angle by which the way is turned to a free side, `pass_side` first [rad]; None if it is not turned."""
    if s.head_on_share * w == 0:
        return None
    for left in (s.pass_side == "left", s.pass_side != "left"):
        lead = (b if left else -b) / (s.head_on_share * w)
        if not -1 <= lead < 2:
            continue
        if _is_side_free(zone, way, left, fixed, s) and not blocks(zone, goal, s):
            return ((w if left else -w) - b) * min(1.0, 2 - lead)
    return None


def _unsafe_semi_axis(zone: Sequence[float], s: MPCSettings) -> float:
    """Semi-major axis of the set h < 0 [m]."""
    return zone[4] + s.r_robot + s.eps


def _is_side_free(
    zone: Sequence[float],
    way: tuple[float, float],
    left: bool,
    fixed: Obstacles,
    s: MPCSettings,
) -> bool:
    """True if nothing fixed stands between the zone's centre and where the robot passes on that side."""
    length = hypot(*way) if left else -hypot(*way)
    beside = (-way[1] / length, way[0] / length)
    xa, ya, xb, yb, *_ = zone
    half = ((xa - xb) / 2, (ya - yb) / 2)
    width = sqrt(_unsafe_semi_axis(zone, s) ** 2 - _cross(half, beside) ** 2)
    x, y = (xa + xb) / 2, (ya + yb) / 2
    h = fixed.h(x + width * beside[0] * _ALONG, y + width * beside[1] * _ALONG)
    return bool((h >= 0).all())


def blocks(zone: Sequence[float], goal: Point, settings: MPCSettings) -> bool:
    """True if h < 0 at the `goal` by the `zone` of a person who stands, and these `settings`."""
    if hypot(*zone[5:7]) >= STANDING_SPEED:
        return False
    distance = Zone.distance(*goal, 0.0, *zone)
    return bool(barrier(distance, settings.r_robot, settings.eps) < 0)


def _cross(u: tuple[float, float], v: tuple[float, float]) -> float:
    return u[0] * v[1] - u[1] * v[0]

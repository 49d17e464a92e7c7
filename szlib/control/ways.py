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

from cmath import phase, rect
from collections.abc import Hashable, Sequence
from itertools import combinations
from math import acos, ceil, dist, hypot, inf, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import binary_dilation
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from ..core.checks import Array
from ..zones.ellipses import BODY_RADIUS
from .obstacles import Obstacles, ellipse_formula, find_bodies, find_places
from .people import STANDING_SPEED
from .settings import MPCSettings

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
        ends = np.vstack([np.zeros((0, 2)), *(each for box in boxes for each in box)])
        ends = ends[np.isfinite(ends).all(axis=1)]
        first, last = points.min(axis=0), points.max(axis=0)
        low = np.vstack([first - _AROUND_POINTS, ends - _AROUND_WALLS]).min(axis=0)
        high = np.vstack([last + _AROUND_POINTS, ends + _AROUND_WALLS]).max(axis=0)
        # of a large building the part around the points
        w, h = last - first
        half = sqrt(max((w - h) ** 2 + 4 * MOST_CELLS * cell**2, (w + h) ** 2))
        margin = max((half - w - h) / 4, _AROUND_POINTS)
        self.corner = np.maximum(low, first - margin)
        size = np.minimum(high, last + margin) - self.corner
        self.cell = max(cell, float(sqrt(size.prod() / MOST_CELLS)))
        self.shape = tuple(np.ceil(size / self.cell).astype(int).tolist())
        self._last = np.subtract(self.shape, 1)
        end = self.corner + self.cell * np.array(self.shape)
        self._box = self.corner.tolist(), end.tolist()
        self._is_thin = any(g.offsets.min() < 2 * self.cell for g in fixed.groups)
        covered = self._cover(fixed)
        self.free = ~covered | covered.all()
        self._places = np.argwhere(self.free)
        self._link()

    def _cover(self, fixed: Obstacles) -> Mask:
        """Where h < 0. Each obstacle is measured in the cells of its box."""
        covered = np.zeros(self.shape, bool)
        for kind, numbers, given in fixed.groups:
            offsets = np.maximum(given, _MOST_SHARE * self.cell)
            low, high = (each - self.corner for each in kind.bounds(numbers, offsets))
            first = (low / self.cell).clip(0, self.shape).astype(int)
            last = (high / self.cell + 1).clip(0, self.shape).astype(int)
            size = np.maximum(last - first, 0)
            counts = size.prod(axis=1)
            n_parts = 1 + min(len(counts), int(counts.sum() // _CHUNK))
            for rows in np.array_split(np.arange(len(counts)), n_parts):
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
        padded = np.pad(np.full(self.shape, -1, np.int32), 2, constant_values=-1)
        self._numbers = padded[2:-2, 2:-2]
        self._numbers[self.free] = np.arange(len(self._places))
        pairs, lengths = list[Array](), list[Array]()
        for step in _NEIGHBOURS:
            to = padded[tuple(slice(2 + n, n - 2 or None) for n in step)]
            both = np.stack([self._numbers, to])[:, (self._numbers >= 0) & (to >= 0)]
            pairs.append(both)
            lengths.append(np.full(both.shape[1], self.cell * hypot(*step)))
        self._pairs, self._lengths = np.hstack(pairs), np.concatenate(lengths)

    def centers(self, cells: Cells) -> Array:
        """Centres of `cells`, shape (n, 2) [m]."""
        return np.asarray(self.corner + (cells + 0.5) * self.cell)

    def holds(self, *points: Point) -> bool:
        """True if these `points` lie within the map."""
        low, high = self._box
        return all(
            first <= x < last
            for point in points
            for first, x, last in zip(low, point, high, strict=True)
        )

    def locate(self, points: Array) -> tuple[Cells, Cells]:
        """The cells of `points`, shape (..., 2), as two indices; beyond the map the nearest one."""
        cells = ((points - self.corner) / self.cell).astype(int)
        cells = np.minimum(np.maximum(cells, 0), self._last)
        return cells[..., 0], cells[..., 1]

    def find_cell(self, point: ArrayLike, among: Mask | None = None) -> tuple[int, ...]:
        """The cell of a `point`, or the nearest one that is free, or is `among` these."""
        at, mask = self.locate(np.array(point)), self.free if among is None else among
        if not mask[at]:
            places = np.argwhere(mask)
            at = places[((places - at) ** 2).sum(axis=1).argmin()]
        return int(at[0]), int(at[1])

    def measure(self, start: Point, goal: Point, speed: float, price: Array) -> bool:
        """Measure the times to the `goal` at this `speed` [m/s], with the `price` of a second in each cell.

        False if there is no way from the `start`: the times are to the nearest point that can be reached.
        """
        self.price, begin = price, self.find_cell(start)
        cost, (i, j) = 1 + price[self.free], self._pairs
        weights = self._lengths / speed * (cost[i] + cost[j]) / 2
        graph = coo_array((weights, (i, j)), shape=(len(cost), len(cost))).tocsr()
        self._measure_from(graph, self.find_cell(goal))
        is_reached = bool(np.isfinite(self.seconds_to_goal[begin]))
        if not is_reached:
            self._measure_from(graph, begin)
            nearest = self.find_cell(goal, np.isfinite(self.seconds_to_goal))
            self._measure_from(graph, nearest)
        return is_reached

    def _measure_from(self, graph: Any, cell: tuple[int, ...]) -> None:
        number, self.end = self._numbers[cell], cell
        far, self._next = dijkstra(graph, False, number, return_predecessors=True)
        self.seconds_to_goal = np.full(self.shape, inf)
        self.seconds_to_goal[self.free] = far

    def descend(self, cell: Any) -> Array:
        """Centres of the cells from `cell` to the end, shape (n, 2) [m]."""
        found, k = list[int](), int(self._numbers[*cell])
        while k >= 0:
            found.append(k)
            k = int(self._next[k])
        return self.centers(self._places[found])

    def sees(self, start: Array, ends: Array, blocked: Mask) -> Mask:
        """Whether straight lines from `start` to `ends`, shape (n, 2) [m], cross no cell that is `blocked`.

        Those around the start do not count.
        """
        lines = ends - start
        longest = np.abs(lines).max(initial=0.0) * (1 + self._is_thin)
        n = 1 + int(longest / self.cell)
        offsets = np.arange(n + 1)[:, None, None] / n * lines
        hidden = blocked[self.locate(start + offsets)]
        if not self._is_thin or blocked[self.locate(start)]:
            distances = np.hypot(*offsets.T).T
            hidden &= distances >= 1.5 * self.cell
        return np.asarray(~hidden.any(axis=0))

    def list_around(self, at: Point, people: Array) -> Array:
        """Places of `people`, and those near `at` that are not free, at `_TIMES`, shape (n, k, 2) [m]."""
        cell, size = np.array(self.find_cell(at)), ceil(SEARCH_RADIUS / self.cell)
        low, (i, j) = np.maximum(cell - size, 0), cell + size
        fixed = np.argwhere(~self.free[low[0] : i, low[1] : j]) + low
        still = self.centers(fixed[:: 1 + len(fixed) // _PLACES])[:, None]
        return np.concatenate([people, np.repeat(still, len(_TIMES), axis=1)])


def choose_cell(clearance: float) -> float:
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
        self, at: Point, goal: Point, zones: Obstacles, groups: Sequence[Hashable]
    ) -> Heading:
        """The way from `at` to the `goal` among people with these `zones` and `groups`."""
        if dist(goal, self._goal) > _GOAL_MOVED:
            self._ways, self._goal, self._steps = [], goal, 0
        m = self._get_map(at, goal)
        is_searched = not self._steps or zones.size != self._n_people
        if is_searched:
            self._search(m, at, goal, Stamps(zones, groups, m.cell, self._s))
            self._steps, self._n_people = self._every, zones.size
        self._steps -= 1
        target, length = self._find_target(m, at, self._ways[0].points, self._blocked)
        length = length if self._is_reached else inf
        return Heading(target, length, tuple(self._ways), is_searched)

    def follow(self, at: Point, goal: Point, route: Array) -> Heading | None:
        """The target from `at` on a `route` to the `goal`, shape (m, 2) [m]; None if no point is in sight."""
        m, self._steps = self._get_map(at, goal), 0
        points = _sample_line(np.vstack([route, goal]), m.cell)
        begin = int(np.hypot(*(points - at).T).argmin())
        near = points[begin:][: 1 + int(min(self._s.lookahead, _FARTHEST) / m.cell)]
        if not m.sees(np.array(at), near, ~m.free).any():
            return None
        return Heading(*self._find_target(m, at, points, ~m.free))

    def _get_map(self, at: Point, goal: Point) -> Map:
        """The map that holds these points."""
        if self._map is None or not self._map.holds(at, goal):
            side = choose_cell(self._s.r_robot + self._s.eps)
            self._map, self._known = Map(self._fixed, np.array([at, goal]), side), ()
            self._steps = 0
        return self._map

    def _search(self, m: Map, at: Point, goal: Point, stamps: Stamps) -> None:
        """Find the ways anew, and choose one."""
        places = stamps.find_places(_TIMES)
        is_near = np.hypot(*(places[:, 0] - at).T) < _PEOPLE
        moved = np.hypot(*(places[:, _LAST] - places[:, 0]).T)
        stands = is_near & (moved < STANDING_SPEED * SEARCH_TIME)
        near = np.flatnonzero(is_near[: stamps.n_people])
        people = places[near]
        known = (self._goal, *np.round(places[stands, 0] / _MOVED).ravel().tolist())
        if known != self._known or not np.isfinite(m.seconds_to_goal[m.find_cell(at)]):
            still = np.flatnonzero(stands)
            (price,) = stamps.find_prices(still, np.zeros(1), m.corner, m.shape)
            self._is_reached = m.measure(at, goal, self._s.v_max, price)
            self._known, self._blocked = known, ~m.free | (price >= BODY_SECOND)
        walks = np.flatnonzero(is_near & ~stands)
        around = m.list_around(at, people)
        ways = self._find_ways(m, at, goal, people, around, stamps, walks)
        ways.sort(key=lambda way: way.cost)
        if self._ways:
            before = _find_turns(_cut(self._ways[0], at), around)
            kept = [
                way for way in ways if not _differ(_find_turns(way, around), before)
            ]
            if kept and kept[0].cost < ways[0].cost + SWITCH_GAIN:
                ways = [kept[0], *(way for way in ways if way is not kept[0])]
        nearest = "to the nearest point that it can reach"
        self._ways = [
            way._replace(
                name=_name(m, way, people, near) if self._is_reached else nearest
            )
            for way in ways
        ]

    def _find_ways(
        self,
        m: Map,
        at: Point,
        goal: Point,
        people: Array,
        around: Array,
        stamps: Stamps,
        walks: Cells,
    ) -> list[Way]:
        """Distinct ways on the map `m` among `people`; those in the rows `walks` of `stamps` walk."""
        v_max, shape = self._s.v_max, np.array(m.shape)
        start = np.array(m.find_cell(at, np.isfinite(m.seconds_to_goal)))
        size = ceil(SEARCH_RADIUS / m.cell)
        low = np.maximum(start - size, 0)
        window = tuple(map(slice, low, np.minimum(start + size + 1, shape)))
        far, begin = m.seconds_to_goal[window], start - low
        ends = np.array(goal)[None] if self._is_reached else np.zeros((0, 2))
        dt = 1.2 * m.cell / v_max  # between a step along an axis and a diagonal one
        times: Array = dt * np.arange(1.0, ceil(SEARCH_TIME / dt) + 1)
        corner = m.corner + low * m.cell
        prices = stamps.find_prices(walks, times, corner, far.shape)
        if not prices.any() and not m.price[window].any():
            points = np.vstack([at, m.descend(start)[1:], ends])
            if len(ends) and m.sees(points[0], ends, ~m.free)[0]:
                points = np.linspace(at, goal, len(points))
            return [Way(points, _time(points, v_max), float(far[tuple(begin)]))]
        costs = (dt * (1 + m.price[window] + prices)).astype(np.float32)
        costs[:, ~m.free[window]] = inf
        end = np.array(m.end) - low
        if (end >= 0).all() and (end < far.shape).all():
            costs[:, end[0], end[1]] = 0.0  # a robot at its goal may stay there
        ways, turns = list[Way](), list[Array]()
        again = np.zeros(far.shape, np.float32)
        tube = np.ones(2 * [2 * int(_NEAR_WAY / m.cell) + 1])
        while len(ways) < MOST_WAYS:
            cells = cross_layers(costs + again, begin, far)
            k, then = len(cells) - 1, cells[-1]
            rest = m.descend(low + then)[1:]
            points = np.vstack([at, m.centers(low + cells[1:]), rest, ends])
            begun = np.concatenate([[0.0], times[:k]])
            late = begun[-1] + _time(points[k:], v_max)[1:]
            within = costs[np.arange(k), *cells[1:].T].sum()
            way = Way(points, np.concatenate([begun, late]), float(within + far[*then]))
            turns.append(_find_turns(way, around))
            if not all(_differ(turns[-1], each) for each in turns[:-1]):
                break
            price = self._price_sides(way, people, turns[-1][: len(people)])
            ways.append(way._replace(cost=way.cost + price))
            used = np.zeros(far.shape, bool)
            used[*cells.T] = np.hypot(*(cells - begin).T) * m.cell > 2 * _NEAR_WAY
            again += np.float32(dt * REPEAT_SECOND) * binary_dilation(used, tube)
        return ways

    def _price_sides(self, way: Way, people: Array, turns: Array) -> float:
        """Price of a `way` that meets `people` head-on, and `turns` to the side that is not preferred [s]."""
        x, y = way.points[-1] - way.points[0]
        vx, vy = (people[:, 1] - people[:, 0]).T / _TICK
        share = self._s.head_on_share * np.hypot(vx, vy) * np.hypot(x, y)
        meets = (np.abs(x * vy - y * vx) <= share) & (x * vx + y * vy <= 0)
        sign = 1 if self._s.pass_side == "right" else -1
        is_other = sign * turns < -pi / 2
        return SIDE_PRICE * bool((meets & is_other).any())

    def _find_target(
        self, m: Map, at: Point, points: Array, blocked: Mask
    ) -> tuple[Point, float]:
        """The target on the way through these `points`, and the length of the way [m].

        It is the farthest one in sight, at most `lookahead` away. Behind it the target goes on straight ahead
        while this is free, so that the robot does not stop there.
        """
        p, lookahead = np.array(at), self._s.lookahead
        points = points[int(np.hypot(*(points - p).T).argmin()) :]
        lengths = _time(np.vstack([p, points]), 1.0)[1:]
        n = int(np.searchsorted(lengths, min(lookahead, _FARTHEST)))
        n = max(n, min(2, len(points)))  # the next cell of a large map may be farther
        chosen = {*range(min(1, n - 1), min(8, n)), *range(8, n, 3), n - 1}
        choice = np.array(sorted(chosen))
        seen = choice[m.sees(p, points[choice], blocked)]
        around = int(np.searchsorted(lengths, 3 * m.cell))  # a corner, close by
        if around < len(points) and blocked[m.locate(points[around])]:
            around = 0  # somebody stands there
        i = max(int(seen.max(initial=0)), min(around, n - 1))
        last, left = points[i], float(lengths[-1] - lengths[i])
        gone = float(np.hypot(*(last - p)))
        if left and gone >= 2 * m.cell:
            shares = np.linspace(min(lookahead, gone + left) / gone, 1.0, 12)
            beyond = p + shares[:, None] * (last - p)
            free = m.sees(p, beyond, blocked)
            last = beyond[free.argmax()] if free.any() else last
        x, y = last.tolist()
        return (x, y), gone + left


def _find_turns(way: Way, around: Array) -> Array:
    """Angles by which a `way` turns around places `around` it at `_TIMES`, shape (n,) [rad]."""
    offset = way.at(_TIMES) - around
    turns = np.diff(np.arctan2(offset[..., 1], offset[..., 0]), axis=1)
    return np.asarray(((turns + pi) % (2 * pi) - pi).sum(axis=1))


def _differ(turns: Array, others: Array) -> bool:
    """True if two ways are distinct, by their turns."""
    return bool((np.abs(turns - others) > pi).any())


class Stamps:
    """Prices of cells around each person, and between two who stand or walk together.

    Parameters
    ----------
    zones : of all people.
    groups : to which they belong, None for somebody of whom this is not known.
    cell : side of a cell [m].
    s : settings of the robot.
    """

    def __init__(
        self, zones: Obstacles, groups: Sequence[Hashable], cell: float, s: MPCSettings
    ) -> None:
        self._cell, self._zones, self.n_people = cell, zones, zones.size
        if not zones.groups:
            return
        own, bodies = zones.groups[0], find_bodies(zones, s).groups[0]
        at, velocities = own.numbers[:, 5:7], own.numbers[:, 7:9].tolist()
        foci = np.abs(own.numbers[:, :4] - np.tile(at, 2)).max()
        reach = foci + float((own.numbers[:, 4] + own.offsets).max())
        reach = max(reach, BODY_RADIUS + float(bodies.offsets.max()))
        n = ceil(min(reach, 2 * SEARCH_RADIUS) / cell)
        x, y = cell * np.mgrid[-n : n + 1, -n : n + 1]
        prices = np.zeros((zones.size, *x.shape))
        for (kind, numbers, offsets), price in (
            (own, ZONE_SECOND),
            (bodies, BODY_SECOND),
        ):
            px, py = at.T[..., None, None]
            d = kind.distance(px + x, py + y, 0.0, *numbers.T[..., None, None])
            prices[d < offsets[:, None, None]] = price
        places = at.tolist()

        def are_together(i: int, j: int) -> bool:
            """True if the people `i` and `j` are of one group, or are near and walk alike."""
            apart = dist(places[i], places[j])
            if None not in (groups[i], groups[j]):
                return groups[i] == groups[j] and apart < _GROUP_REACH
            is_alike = dist(velocities[i], velocities[j]) < GROUP_SPEED
            return apart < GROUP_DISTANCE and is_alike

        pairs = [
            pair for pair in combinations(range(zones.size), 2) if are_together(*pair)
        ]
        self._pairs = i, j = np.reshape(pairs, (-1, 2)).astype(int).T
        apart = np.hypot(*(at[i] - at[j]).T)[:, None, None]
        between = np.hypot(x, y) < apart / 2
        found = np.concatenate([prices, GROUP_SECOND * between])
        self._prices = found.astype(np.float32)

    def find_places(self, times: Array) -> Array:
        """Places of people, and of the middles of pairs, at these `times`, shape (n, k, 2) [m]."""
        people = find_places(self._zones, times)
        if not len(people):
            return people
        i, j = self._pairs
        return np.concatenate([people, (people[i] + people[j]) / 2])

    def find_prices(
        self, rows: Cells, times: Array, corner: Array, shape: tuple[int, ...]
    ) -> Array:
        """Prices of the people in these `rows`, at each of these `times`, shape (times, nx, ny).

        The `corner` is that of the first cell [m], of so many as `shape` says. Where people overlap, the
        higher price counts.
        """
        n = self._prices.shape[1] if len(rows) else 1
        prices = np.zeros((len(times), *(size + 2 * n for size in shape)), np.float32)
        cells = np.floor((self.find_places(times) - corner) / self._cell).astype(int)
        first = cells - n // 2 + n
        is_inside = np.all((first > 0) & (first < np.add(shape, n)), axis=-1)
        for row in rows:
            (inside,) = is_inside[row].nonzero()
            corners = first[row, inside].tolist()
            for k, (i, j) in zip(inside.tolist(), corners, strict=True):
                part = prices[k, i : i + n, j : j + n]
                np.maximum(part, self._prices[row], out=part)
        return np.asarray(prices[:, n:-n, n:-n], float)


def cross_layers(costs: Any, begin: Any, far: Array) -> Array:
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
    k, i, j = np.unravel_index(ends.argmin(), ends.shape)
    cells = [np.array([i, j])]
    for layer in layers[:k][::-1]:
        i, j = cells[-1]
        best = (layer[i : i + 3, j : j + 3] + step * _MOVES).argmin()
        cells.append(cells[-1] + np.divmod(best, 3) - 1)
    return np.array(cells[::-1])


def _time(points: Array, speed: float) -> Array:
    """Times at which a robot of this `speed` [m/s] is at these `points`, shape (n,) [s]."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], lengths.cumsum() / speed])


def _sample_line(corners: Array, piece: float, longest: float = inf) -> Array:
    """Points on a line through `corners`, at most a `piece` apart, and at most so far along it [m]."""
    lengths = _time(corners, 1.0)
    end = min(float(lengths[-1]), longest)
    along = np.linspace(0, end, 2 + int(end / piece))
    return np.column_stack([np.interp(along, lengths, each) for each in corners.T])


def _cut(way: Way, at: Point) -> Way:
    """What is left of a `way` for a robot that is `at` this point."""
    k = int(np.hypot(*(way.points - at).T).argmin())
    left = np.vstack([at, way.points[k + 1 :]])
    return way._replace(points=left, times=way.times[k:] - way.times[k])


def _find_door(m: Map, way: Way) -> list[tuple[float, str]]:
    """When a way leads through the first door, and where: it is narrow, with more room before and behind."""
    places = _sample_line(way.points, m.cell, 2 * SEARCH_RADIUS)
    ahead = np.gradient(places, axis=0)
    across = ahead[:, ::-1] * (-1, 1) / np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    aside = np.arange(m.cell, _DOOR + m.cell, m.cell)[:, None, None] * across
    left, right = (~m.free[m.locate(places + s * aside)].all(axis=0) for s in (-1, 1))
    ends = np.flatnonzero(np.diff(np.pad(left & right, 1)))
    for first, last in ends.reshape(-1, 2).tolist():
        if first and last < len(places) and (last - first) * m.cell < 2 * _DOOR:
            x, y = places[(first + last - 1) // 2]
            k = int(np.hypot(*(way.points - (x, y)).T).argmin())
            return [(way.times[k], f"through the door at ({x:.1f}, {y:.1f})")]
    return []


def _name(m: Map, way: Way, people: Array, numbers: Cells) -> str:
    """A way in words: a door, the side of people whom it passes, and for whom it waits."""
    found, points = _find_door(m, way), way.at(_TIMES)
    for number, places in zip(numbers, people, strict=True):
        offsets = points - places
        k = int(np.hypot(*offsets.T).argmin())
        if not 0 < k < len(_TIMES) - 1 or np.hypot(*offsets[k]) > _NAMED_WITHIN:
            continue
        # complex numbers: the conjugate of u times v has the angle from u to v
        back = complex(*points[k + 1 :][:5][-1] - points[max(k - 5, 0)]).conjugate()
        walk, offset = complex(*places[k + 1] - places[k]) / _TICK, complex(*offsets[k])
        side = "left of" if (back * offset).imag > 0 else "right of"
        if abs((back * walk).imag) > abs(back) / 2 * max(abs(walk), STANDING_SPEED):
            is_before = (walk.conjugate() * offset).real > 0
            side = "in front of" if is_before else "behind"
        found.append((_TIMES[k], f"{side} person {number}"))
    words = [word for _, word in sorted(found)[:_NAMED]]
    moved = np.hypot(*np.diff(points, axis=0).T)
    is_away = np.hypot(*(way.points - way.points[-1]).T) > 2 * m.cell
    arrival = way.times[is_away].max(initial=0.0)
    rests = (moved < 0.2 * moved.max(initial=0.0)) & (_TIMES[1:] < arrival)
    if rests.sum() >= _WAITING and len(people):
        last = points[np.flatnonzero(rests)[-1]]
        k = int(np.hypot(*(people[:, 0] - last).T).argmin())
        words.insert(0, f"waits for person {numbers[k]}")
    straight = dist(way.points[-1], way.points[0])
    is_straight = _time(way.points, 1.0)[-1] < 1.05 * straight + m.cell
    usual = "straight to the goal" if is_straight else "around walls"
    return ", ".join(words) or usual


def find_target(
    position: Point,
    goal: Point,
    zones: Sequence[Sequence[float]],
    fixed: Obstacles,
    settings: MPCSettings,
) -> Point:
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
    s, (x, y), chosen, away = settings, position, None, dist(position, goal)
    wx, wy = goal[0] - x, goal[1] - y
    nearest, margin = away, s.r_robot + s.eps
    time = s.dt * max(1 / s.gamma, sum(s.step_lengths))
    for zone in zones if away and s.head_on_share else ():
        vx, vy = zone[7:9]
        speed = hypot(vx, vy)
        if abs(wx * vy - wy * vx) > s.head_on_share * speed * away:
            continue
        h = ellipse_formula(x, y, *zone[:5]) - margin
        if h <= min(nearest, (s.v_max + speed) * time):
            nearest, chosen = h, zone
    if not chosen:
        return goal
    at, end = complex(x, y), complex(*goal)
    end = at + (end - at) * _turn_aside(at, end, chosen, fixed, s)
    return end.real, end.imag


def _turn_aside(
    at: complex, end: complex, zone: Sequence[float], fixed: Obstacles, s: MPCSettings
) -> complex:
    """By what the way from `at` to the `end` is turned, to pass a person with this `zone`."""
    # complex numbers: the conjugate of u times v has the angle from u to v
    way, semi_axis = end - at, zone[4] + s.r_robot + s.eps  # of the set h < 0
    a, b = complex(*zone[:2]) - at, complex(*zone[2:4]) - at
    is_on_goal = ellipse_formula(end.real, end.imag, *zone[:5]) < s.r_robot + s.eps
    if not a * b or (is_on_goal and hypot(*zone[7:9]) < STANDING_SPEED):
        return 1.0
    cosine = (abs(a) ** 2 + abs(b) ** 2 - 4 * semi_axis**2) / (2 * abs(a) * abs(b))
    w = acos(max(-1.0, min(1.0, cosine))) / 2
    bearing = phase((a / abs(a) + b / abs(b)).conjugate() * way)
    for side in (1, -1) if s.pass_side == "left" else (-1, 1):
        lead = side * bearing / (s.head_on_share * w) if w else inf
        if not -1 <= lead < 2:
            continue
        # from the zone's centre to where the robot passes
        beside = side * 1j * way / abs(way)
        half = (a - b) / 2
        width = sqrt(semi_axis**2 - (half.conjugate() * beside).imag ** 2)
        points = at + (a + b) / 2 + width * beside * _ALONG
        if (fixed.h(points.real, points.imag) >= 0).all():
            return rect(1.0, (side * w - bearing) * min(1.0, 2 - lead))
    return 1.0

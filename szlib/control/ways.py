"""Where the plan heads: a way through space and time, and the side of a person who is met head-on.

A *map* of cells holds the time to the goal from each cell: around everything fixed, and around people who
stand (Dijkstra's algorithm). Around the robot a *search in space and time* continues it to people who walk:
in one layer of cells after the other it finds the least cost to be there at that time (dynamic programming).
A second costs 1, more in a zone, and much more where a body is. So to wait has its price as well.

Two ways are *distinct* if they pass a person or something fixed on different sides: seen from there, one
turns by about 2 pi more than the other (their winding numbers differ). In front of and behind a person who
walks are different sides, too. An optimiser that improves a plan in small steps never changes the side: each
side needs a plan of its own. The next way is found where places near the ways before have a price.

The search does not know how the robot moves now. So a plan is refined along each way (`MPCCBF`), and the way
is taken whose plan violates least, and of these the cheapest one. The robot keeps its way until another one
is clearly better, so that it does not dither (hysteresis, see `Way.rank`).
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Hashable, Iterator, Sequence
from math import acos, ceil, dist, hypot, inf, pi, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import (
    binary_dilation,
    distance_transform_edt,
    label,
)
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ..core.checks import Array
from ..zones.ellipses import BODY_RADIUS
from .obstacles import Mask, Obstacles, Point, ellipse_formula
from .people import STANDING_SPEED, Person, find_places
from .settings import MPCSettings

Cells = NDArray[np.intp]
CELL = 0.15
"""Side of a cell [m] (assumed)."""
SMALLEST_CELL = 0.06
"""Side of a cell of a small robot [m] (assumed): smaller ones take too long to search."""
MOST_CELLS = 250_000
"""About the greatest number of cells of a map; those of a large one are larger (assumed)."""
SEARCH_RADIUS = 4.0
SEARCH_TIME = 6.0
"""How far the search looks, from the robot [m], and in time [s] (assumed)."""
SEARCH_INTERVAL = 0.4
"""Time between two searches, rounded up to whole steps [s] (assumed)."""
ZONE_SECOND = 2.0
BODY_SECOND = 100.0
REPEAT_SECOND = 1.5
"""Price of a second in a zone, in a body, and near a way that was found before [s] (assumed)."""
SIDE_PRICE = 0.5
"""Price of passing people, who do not cross the way, on the side that is not `pass_side` [s] (assumed)."""
GROUP_SECOND = 4.0
GROUP_DISTANCE = 1.5
GROUP_SPEED = 0.3
"""Price of a second between people who are together [s]; how near [m] and alike [m/s] they are (assumed).
People of a group that is given are together up to twice this distance."""
SWITCH_GAIN = 1.0
SWITCH_VIOLATION = 0.05
"""A way is kept until another one is this much cheaper [s], or its plan violates a wall less, or bodies or
zones by so much less in all its steps together [m] (assumed)."""
MOST_WAYS = 3
"""Number of ways that are looked for (assumed)."""
# the edge of a map is so far from its points, at least and at most [m]
_AROUND = 8.0
_FARTHEST_WALL = 35.0
_FARTHEST = 10.0  # of a target on a way [m]
_MARGIN = 4  # cells around a map
_CHUNK = 1_000_000  # cells that are measured at once
# places of people who stand are rounded so, and a goal is the same if it moved less [m]
_MOVED = 0.3
_GOAL_MOVED = 0.5
_NEAR_WAY = 3  # cells that are near a way are at most so many steps from it
_EVERY = 20  # turns are measured around so many cells that are not free, one of
_MOST_SHARE = 1.2  # least offset of obstacles, in cells: no step leads across a wall
_NEIGHBOURS = np.array(
    [
        (0, 1),
        (1, 0),
        (1, 1),
        (1, -1),
        (1, 2),
        (2, 1),
        (1, -2),
        (2, -1),
    ]
)
# price of a step to a neighbour: a robot that waits stands still [s]
_MOVE_PRICE = 0.015
_MOVES = _MOVE_PRICE * np.array(
    [
        [2, 1, 2],
        [1, 0, 1],
        [2, 1, 2],
    ],
    np.float32,
)
_NAMED_WITHIN = 2.5  # people who are passed nearer than this are named [m]
_ALONG = 0.4  # cosine of the angle from a walk within which one is in front or behind
_DOOR = 1.0  # a place is narrow if no free disc of this radius holds it [m]
_WAITING = 0.8  # rest that is called waiting [s]
# times at which people are looked at, and the time between two of them [s]
_TIMES = np.linspace(0.0, 2 * SEARCH_TIME, 121)
_TICK = float(_TIMES[1])

# where free space is looked for: from a zone's centre to where the robot passes; along each step of a way, as
# shares of it; and across the way, in cells
_BESIDE = np.linspace(0, 1, 20)
_SHARES = np.arange(8)[:, None] / 8
_ACROSS = np.linspace(-1, 1, 33)[:, None, None]


class Way(NamedTuple):
    """A way to the goal.

    Attributes
    ----------
    points : from where the robot was when the way was found, about `SEARCH_INTERVAL` ago, shape (k, 2) [m].
    times : when the robot is there, from then on, shape (k,) [s].
    cost : time to the end, the prices on the way, and the time that the refined plan loses [s].
    name : in words, such as "left of person 3, behind person 5".
    is_kept : whether it passes everything on the same side as the way that the robot was on.
    """

    points: Array
    times: Array
    cost: float
    name: str = ""
    is_kept: bool = False

    def rank(self, violations: Sequence[float] = ()) -> tuple[Any, ...]:
        """Of two ways the better one has the lesser rank: by `violations` of its plan [m], and then by cost.

        They are those of walls, bodies and zones. The way that is kept may violate bodies and zones by
        `SWITCH_VIOLATION` more, and cost `SWITCH_GAIN` more.
        """
        allowed = 0.0, SWITCH_VIOLATION, SWITCH_VIOLATION
        pairs = zip(violations, allowed, strict=False)
        counted = [max(0.0, each - self.is_kept * more) for each, more in pairs]
        return counted if any(counted) else [], self.cost - SWITCH_GAIN * self.is_kept

    def at(self, times: Array) -> Array:
        """Where the robot is at these `times`, shape (n, 2) [m]; at the goal from its arrival on."""
        along = [np.interp(times, self.times, each) for each in self.points.T]
        return np.column_stack(along)


class Heading(NamedTuple):
    """Where a plan heads.

    Attributes
    ----------
    target : the point that attracts it [m].
    length : of the way to the goal [m]; inf if there is none.
    ways : first the one along which the plan heads, then others that were found.
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
    clearance : of thin walls [m].
    slack : by which h may be negative in the centre of a free cell, in cells: a robot may fit in a place that
        is too narrow for the centres.

    Attributes
    ----------
    free : whether h >= 0, but for the slack, in the centre of a cell, shape (nx, ny); False in the two rows
        at each edge.
    is_narrow : whether it is free, but in no free disc of the radius `_DOOR`.
    price : of a second in a cell, because of people who stand [s].
    blocked : whether a cell is not free, or in the body of somebody who stands.
    is_near : whether a cell can be reached from where the robot was.
    seconds_to_goal : from the centre of a cell [s]; inf without a way.
    end : the point to which they are measured: the goal, or the nearest one that can be reached [m].
    is_reached : whether it is the goal.
    """

    def __init__(
        self,
        fixed: Obstacles,
        points: Array,
        clearance: float = inf,
        slack: float = 0.0,
    ) -> None:
        boxes = [np.vstack(g.kind.bounds(g.numbers, g.offsets)) for g in fixed.groups]
        ends = np.vstack([points - _AROUND, points + _AROUND, *boxes])
        ends = ends[np.isfinite(ends).all(axis=1)]
        low = np.maximum(ends.min(axis=0), points.min(axis=0) - _FARTHEST_WALL)
        high = np.minimum(ends.max(axis=0), points.max(axis=0) + _FARTHEST_WALL)
        self._low = low
        self._high = high
        size = high - low
        side = min(CELL, max(SMALLEST_CELL, clearance / (_MOST_SHARE + slack)))
        # so that MOST_CELLS = (size[0] / cell + 2 _MARGIN) (size[1] / cell + 2 _MARGIN)
        most = MOST_CELLS - 4 * _MARGIN**2
        half = _MARGIN * size.sum() / most
        self.cell = max(side, float(half + sqrt(half**2 + size.prod() / most)))
        self.corner = low - _MARGIN * self.cell
        n = np.ceil(size / self.cell).astype(int) + 2 * _MARGIN
        self.shape = tuple(n.tolist())
        covered = self._cover(fixed, slack * self.cell)[2:-2, 2:-2]
        self.free = np.pad(~covered | covered.all(), 2)
        self.blocked = ~self.free
        n = ceil(2 * _DOOR / self.cell)
        open_ = np.pad(~covered, 2 + n, constant_values=True)  # beyond the map as well
        wide = distance_transform_edt(open_) * self.cell >= _DOOR
        narrow = distance_transform_edt(~wide) * self.cell > _DOOR
        self.is_narrow = self.free & narrow[n:-n, n:-n]
        self._parts, _ = label(self.free, np.ones((3, 3)))
        # pairs of free neighbours, in 16 directions
        numbers = np.flatnonzero(self.free)
        neighbours = numbers + (_NEIGHBOURS @ (self.shape[1], 1))[:, None]
        direction, k = self.free.ravel()[neighbours].nonzero()
        pairs = np.stack([numbers[k], neighbours[direction, k]])
        self._pairs = pairs.astype(np.intc)  # older SciPy takes no others
        self._lengths = self.cell * np.hypot(*_NEIGHBOURS[direction].T)

    def _cover(self, fixed: Obstacles, slack: float) -> Mask:
        """Where h < -`slack` [m]. Each obstacle is measured in the cells of its box."""
        covered = np.zeros(self.shape, bool)
        for kind, numbers, given in fixed.groups:
            offsets = np.maximum(given - slack, _MOST_SHARE * self.cell)
            first, last = (
                np.column_stack(self.locate(corners))
                for corners in kind.bounds(numbers, offsets)
            )
            sizes = last - first + 1
            counts = sizes.prod(axis=1)
            indices = np.arange(len(counts))
            for rows in np.array_split(indices, 1 + counts.sum() // _CHUNK):
                which = np.repeat(rows, counts[rows])
                place = np.concatenate([np.arange(n) for n in counts[rows]])
                cells = first[which].T + np.divmod(place, sizes[which, 1])
                x, y = self.centers(cells.T).T
                unsafe = kind.distance(x, y, 0.0, *numbers[which].T) < offsets[which]
                covered[*cells[:, unsafe]] = True
        return covered

    def centers(self, cells: ArrayLike) -> Array:
        """Centres of `cells`, shape (..., 2) [m]."""
        return np.asarray(self.corner + (np.array(cells) + 0.5) * self.cell)

    def holds(self, points: Array) -> bool:
        """True if these `points` lie within the map."""
        return bool(((self._low < points) & (points < self._high)).all())

    def locate(self, points: Array) -> tuple[Cells, Cells]:
        """The cells of `points`, shape (..., 2), as two indices; beyond the map the nearest one."""
        cells = (points - self.corner) / self.cell
        cells = cells.clip(0, np.subtract(self.shape, 1)).astype(int)
        return cells[..., 0], cells[..., 1]

    def find_cell(self, point: ArrayLike, among: Mask | None = None) -> Cells:
        """The cell of a `point`, or the nearest one that is free, or is `among` these, shape (2,)."""
        cell = self.locate(np.array(point))
        mask = self.free if among is None else among
        places = np.argwhere(mask) if not mask[cell] else np.array([cell])
        return np.asarray(places[((places - cell) ** 2).sum(axis=1).argmin()])

    def links(self, points: Array) -> bool:
        """True if free cells close to both `points` are parts of one place, shape (2, 2)."""
        cells = np.array([self.find_cell(point) for point in points])
        apart = np.hypot(*(self.centers(cells) - points).T)
        first, last = self._parts[*cells.T]
        return bool(first == last and apart.max() < 2 * self.cell)

    def measure(self, start: Point, goal: Point, speed: float, price: Array) -> None:
        """Measure the times to the `goal`, or the nearest point that can be reached from the `start`.

        Each cell has the `price` of a second; the robot drives at this `speed` [m/s].
        """
        self.price = price
        self.blocked = ~self.free | (price >= BODY_SECOND)
        self.is_near = self._parts == self._parts[*self.find_cell(start)]
        cell = self.find_cell(goal, self.is_near)
        self.is_reached = bool(self.is_near[*self.find_cell(goal)])
        self.end = self.centers(cell)
        cost = 1 + price.ravel()
        weights = self._lengths / speed * cost[self._pairs].mean(axis=0)
        graph = csr_array((weights, self._pairs), shape=2 * cost.shape)
        number = np.ravel_multi_index(cell, self.shape)
        far, self._next = dijkstra(graph, False, number, return_predecessors=True)
        self.seconds_to_goal = far.reshape(self.shape)

    def descend(self, cell: Any) -> Array:
        """Centres of the cells from `cell` to the end, shape (n, 2) [m]."""
        found = []
        k = int(np.ravel_multi_index(tuple(cell), self.shape))
        while k >= 0:
            found.append(k)
            k = int(self._next[k])
        return self.centers(np.column_stack(np.unravel_index(found, self.shape)))

    def sees(self, start: Array, ends: Array) -> Mask:
        """Whether lines from `start` to `ends`, shape (n, 2) [m], cross no `blocked` cell (but close by)."""
        lines = ends - start
        n = 2 + int(2 * np.abs(lines).max(initial=0.0) / self.cell)
        offsets = np.linspace(0, 1, n)[:, None, None] * lines
        hidden = self.blocked[self.locate(start + offsets)]
        distances = np.hypot(*offsets.T).T
        hidden &= distances >= 1.5 * self.cell
        return np.asarray(~hidden.any(axis=0))


class WayFinder:
    """Ways of one robot around what is fixed and people; it remembers the map, and the way that it is on.

    Parameters
    ----------
    fixed : what is fixed.
    settings : of the robot.

    Attributes
    ----------
    ways : those that were found last, the one that is taken first.
    """

    def __init__(self, fixed: Obstacles, settings: MPCSettings) -> None:
        self._fixed = fixed
        self._s = settings
        self._map: Map | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the goal and the way."""
        self.ways: Sequence[Way] = ()
        self._goal = (inf, inf)
        self._steps = 0
        self._ids = list[Hashable]()
        self._standing: Any = None
        self._measured = self._goal
        self._loose: Map | None = None

    def find(
        self, at: Point, goal: Point, people: Sequence[Person], zones: Obstacles
    ) -> list[Heading]:
        """Along each way from `at` to the `goal` among `people` with these `zones`, or the one that is kept.

        The first one is the best before plans are known. The first of `ways` is kept.
        """
        if dist(goal, self._goal) > _GOAL_MOVED:
            self.reset()
            self._goal = goal
        points = np.array([at, goal])
        m = self._loose or self._map
        if m is None or not m.holds(points):
            self._loose = None
            m = self._map = self._make_map(points)
        ids = [each.id for each in people]
        is_searched = not self._steps or ids != self._ids
        if is_searched:
            # a robot may fit where the centres of cells are too near to walls
            if not (self._loose or m.links(points)):
                m = self._loose = self._make_map(points, slack=0.5)
            self._search(m, at, goal, Surroundings(people, zones, at, m, self._s))
            self._steps = ceil(SEARCH_INTERVAL / self._s.dt)
            self._ids = ids
        self._steps -= 1
        chosen = range(len(self.ways) if is_searched else 1)
        found = [self._head_for(m, at, self.ways[k:]) for k in chosen]
        return [each._replace(is_searched=is_searched) for each in found]

    def _make_map(self, points: Array, slack: float = 0.0) -> Map:
        """A new map that holds these `points`, with this `slack`."""
        self._standing = None
        self._steps = 0
        return Map(self._fixed, points, self._s.r_robot + self._s.eps, slack)

    def _search(self, m: Map, at: Point, goal: Point, near: Surroundings) -> None:
        """Find the ways anew, and choose one."""
        standing = np.round(near.places[near.stands, 0] / _MOVED).ravel().tolist()
        if (
            standing != self._standing
            or not m.is_near[*near.start]
            or self._is_elsewhere(m, goal)
        ):
            (price,) = near.find_prices(near.stands, np.zeros(1), 0, m.shape)
            self._standing = standing
            self._measured = goal
            for _ in range(MOST_WAYS):
                m.measure(at, goal, self._s.v_max, price)
                tight = self._find_tight(m, m.descend(near.start)[1:])
                if not len(tight):
                    break
                price[m.locate(tight)] = BODY_SECOND
            m.is_reached &= not len(tight)
        if m.is_reached:
            m.end = np.array(goal)  # it may have moved a little
        before = np.array(inf)
        if self.ways:
            last = self.ways[0]
            passed = last.times[np.hypot(*(last.points - at).T).argmin()]
            before = _find_turns(last, near.around, passed)
        found = [
            way._replace(is_kept=bool((np.abs(turns - before) <= pi).all()))
            for way, turns in self._find_ways(m, at, near)
        ]
        self.ways = sorted(found, key=Way.rank)

    def _is_elsewhere(self, m: Map, goal: Point) -> bool:
        """True if the times of the map `m` are not those to the `goal`: it moved out of sight."""
        is_in_sight = m.is_reached and m.sees(m.end, np.array([goal]))[0]
        return goal != self._measured and not is_in_sight

    def _find_tight(self, m: Map, way: Array) -> Array:
        """Points of a `way` where h < 0 even beside it, on a loose map `m`, shape (n, 2) [m]."""
        steps = np.diff(way, axis=0)
        points = (way[:-1, None] + steps[:, None] * _SHARES).reshape(-1, 2)
        across = steps[:, ::-1] * (-1, 1) / np.hypot(*steps.T)[:, None]
        across = across.repeat(len(_SHARES), axis=0)
        found = [way[:0]]
        # few obstacles are near so few points
        for k in range(0, len(points) if m is self._loose else 0, 64):
            part = points[k : k + 64]
            h = self._fixed.h(*part.T).min(axis=1, initial=inf)
            x, y = np.moveaxis(part + m.cell * _ACROSS * across[k : k + 64], -1, 0)
            least = self._fixed.select_near(h - m.cell).h(x, y).min(axis=0, initial=inf)
            found.append(part[least.max(axis=0) < 0])
        return np.concatenate(found)

    def _find_ways(
        self, m: Map, at: Point, near: Surroundings
    ) -> Iterator[tuple[Way, Array]]:
        """Distinct ways on the map `m` from `at` this point, and their turns."""
        v_max = self._s.v_max
        low = near.low
        window = near.window
        far = m.seconds_to_goal[window]
        begin = near.start - low
        dt = 1.2 * m.cell / v_max  # between a step along an axis and a diagonal one
        times: Array = dt * np.arange(1.0, ceil(SEARCH_TIME / dt) + 1)
        prices = near.find_prices(~near.stands, times, low, far.shape) + m.price[window]
        is_empty = not prices.any()
        costs = dt * (1 + prices)
        costs[:, ~m.free[window]] = inf
        other_side = "left of" if self._s.pass_side == "right" else "right of"
        found = list[Array]()
        again = np.zeros(far.shape, np.float32)
        while len(found) < (1 if is_empty else MOST_WAYS):
            cells = begin[None] if is_empty else cross_layers(costs + again, begin, far)
            k = len(cells) - 1
            then = cells[-1]
            within = m.centers(low + cells[1:])
            later = m.descend(low + then)[1:]
            points = np.vstack([at, within, later, m.end])
            if is_empty and m.sees(points[0], points[-1:])[0]:
                points = np.linspace(at, m.end, len(points))
            late = k * dt + _time(points[k:], v_max)
            arrivals = np.concatenate([dt * np.arange(k), late])
            cost = float(costs[np.arange(k), *cells[1:].T].sum() + far[*then])
            way = Way(points, arrivals, cost)
            turns = _find_turns(way, near.around)
            # ways are distinct if they turn differently around something
            if not all((np.abs(turns - each) > pi).any() for each in found):
                return
            found.append(turns)
            name = _name(m, way, near, turns)
            cost += SIDE_PRICE * (other_side in name)
            yield way._replace(cost=cost, name=name), turns
            used = np.zeros(far.shape, bool)
            used[*cells.T] = True
            again += dt * REPEAT_SECOND * binary_dilation(used, iterations=_NEAR_WAY)

    def _head_for(self, m: Map, at: Point, ways: Sequence[Way]) -> Heading:
        """The farthest point of the first of the `ways` that is in sight, or a corner close by."""
        p = np.array(at)
        points = ways[0].points
        farthest = min(self._s.lookahead, _FARTHEST)
        points = points[int(np.hypot(*(points - p).T).argmin()) :]
        lengths = _time(np.vstack([p, points]), 1.0)[1:]
        n = max(2, int(np.searchsorted(lengths, farthest)))
        chosen = m.sees(p, points[:n]) | (lengths[:n] < 3 * m.cell)
        i = np.flatnonzero(chosen).max(initial=0)
        (x, y), left = points[i].tolist(), float(lengths[-1] - lengths[i])
        length = dist(at, (x, y)) + left if m.is_reached else inf
        return Heading((x, y), length, tuple(ways))


def _find_turns(way: Way, around: Array, since: float = 0.0) -> Array:
    """Angles by which a `way`, `since` a time [s] on, turns around places `around` it, shape (n,) [rad]."""
    seen = (way.at(since + _TIMES) - around) @ (1, 1j)
    turns = np.angle(seen[:, 1:] * seen[:, :-1].conj())
    return np.asarray(turns.sum(axis=1))


class Surroundings:
    """What is near the robot: cells of the map, people, where they will be, and prices around them.

    Parameters
    ----------
    people : everybody to be respected.
    zones : theirs.
    at : where the robot is [m].
    m : the map.
    s : settings of the robot.

    Attributes
    ----------
    start, low, window : the cell of the robot, the first one that is near, and all of these.
    people : places of people at `_TIMES`, shape (n, k, 2) [m].
    places : those, and the middles of two who are together, shape (n + pairs, k, 2) [m].
    stands : whether these places stay where they are.
    around : those of people, and of cells that are not free, shape (n + cells, k, 2) [m].
    """

    def __init__(
        self,
        people: Sequence[Person],
        zones: Obstacles,
        at: Point,
        m: Map,
        s: MPCSettings,
    ) -> None:
        size = ceil(SEARCH_RADIUS / m.cell)
        self.start = m.find_cell(at)
        self.low = np.maximum(self.start - size, 0)
        self.window = tuple(map(slice, self.low, self.start + size + 1))
        walls = m.centers(np.argwhere(~m.free[self.window]) + self.low)
        walls = walls[::_EVERY, None].repeat(len(_TIMES), axis=1)
        places = find_places(people, _TIMES)
        i, j = _find_pairs(places, [each.group for each in people])
        apart = np.hypot(*(places[i, 0] - places[j, 0]).T)[:, None, None] / 2
        reach = [BODY_RADIUS + s.r_robot + s.body_gap, *apart.flat]
        for _, numbers, offsets in zones.groups:
            xa, ya, xb, yb, a, px, py = numbers.T[:7]
            middle = np.hypot((xa + xb) / 2 - px, (ya + yb) / 2 - py)
            reach += [*(middle + a + offsets)]
        size = min(size, ceil(max(reach) / m.cell))
        x, y = m.cell * np.mgrid[-size : size + 1, -size : size + 1]
        prices = np.zeros((len(people), *x.shape))
        for kind, numbers, offsets in zones.groups:
            table = numbers.T[..., None, None]
            d = kind.distance(table[5] + x, table[6] + y, 0.0, *table)
            prices[d < offsets[:, None, None]] = ZONE_SECOND
        prices[:, np.hypot(x, y) < BODY_RADIUS + s.r_robot + s.body_gap] = BODY_SECOND
        between = GROUP_SECOND * (np.hypot(x, y) < apart)
        self._prices = np.concatenate([prices, between]).astype(np.float32)
        self._map = m
        self.people = places
        self.places = np.concatenate([places, (places[i] + places[j]) / 2])
        self.around = np.concatenate([places, walls])
        moved = np.hypot(*(self.places - self.places[:, :1]).T).max(axis=0)
        self.stands = moved < STANDING_SPEED * _TIMES[-1]

    def find_prices(
        self, rows: Mask, times: Array, low: Any, shape: tuple[int, ...]
    ) -> Array:
        """Prices of the `places` of these `rows`, at each of these `times`, shape (times, nx, ny).

        The first cell is `low`, as many as `shape`. The higher price counts where people overlap.
        """
        n = self._prices.shape[1]
        stamps = self._prices[rows]
        prices = np.zeros((len(times), *(size + 2 * n for size in shape)), np.float32)
        places = self.places[rows][:, np.searchsorted(_TIMES[:-1], times)]
        cells = np.floor((places - self._map.corner) / self._map.cell).astype(int)
        cells += n - n // 2 - low
        is_inside = ((cells > 0) & (cells < np.add(shape, n))).all(axis=-1)
        for row, k in np.argwhere(is_inside).tolist():
            i, j = cells[row, k].tolist()
            part = prices[k, i : i + n, j : j + n]
            np.maximum(part, stamps[row], out=part)
        return prices[:, n:-n, n:-n]


def _find_pairs(people: Array, groups: Sequence[Hashable]) -> Cells:
    """Pairs of `people` of one of the `groups`, or who are near and walk alike, shape (2, n)."""
    numbers = dict[Hashable, int]({None: 0})
    own = np.array([numbers.setdefault(each, len(numbers)) for each in groups], int)
    i, j = np.triu_indices(len(own), 1)
    apart, unlike = (
        np.hypot(*(each[i] - each[j]).T)
        for each in (people[:, 0], (people[:, 1] - people[:, 0]) / _TICK)
    )
    is_known = (own[i] > 0) & (own[j] > 0)
    reach = np.where(is_known, 2 * (own[i] == own[j]), unlike < GROUP_SPEED)
    # bodies that touch leave nothing between them
    is_pair = (apart > 2 * BODY_RADIUS) & (apart < reach * GROUP_DISTANCE)
    return np.stack([i, j])[:, is_pair]


def cross_layers(costs: Any, begin: Any, far: Array) -> Array:
    """Cells of the cheapest way through layers of `costs`, one in each, shape (k + 1, 2).

    From `begin` to the last layer, or to the edge or the goal, where cost and `far` are least together.
    """
    # with a border around each layer, so that all cells have eight neighbours
    layers = np.full((len(costs) + 1, *np.add(far.shape, 2)), inf, np.float32)
    within = layers[:, 1:-1, 1:-1]
    within[0, *begin] = 0.0
    for layer, cost, after in zip(layers, costs, within[1:], strict=False):
        moved = np.minimum(layer[:-2], layer[2:]) + _MOVE_PRICE
        beside = np.minimum(layer[1:-1], moved)
        moved = np.minimum(beside[:, :-2], beside[:, 2:]) + _MOVE_PRICE
        after[:] = np.minimum(beside[:, 1:-1], moved) + cost
    edge = far.copy()
    edge[1:-1, 1:-1][far[1:-1, 1:-1] > 0] = inf
    ends = within + edge
    ends[-1] = within[-1] + far
    k, i, j = map(int, np.unravel_index(ends.argmin(), ends.shape))
    cells = [(i, j)]
    for layer in layers[:k][::-1]:
        near = layer[i : i + 3, j : j + 3]
        along, across = divmod(int((near + _MOVES).argmin()), 3)
        i += along - 1
        j += across - 1
        cells.append((i, j))
    return np.array(cells[::-1])


def _time(points: Array, speed: float) -> Array:
    """Times at which a robot of this `speed` [m/s] is at these `points`, shape (n,) [s]."""
    lengths = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate([[0.0], lengths.cumsum() / speed])


def _name(m: Map, way: Way, near: Surroundings, turns: Array) -> str:
    """A way in words: a door, the side of people whom it passes, and for whom it waits."""
    if not m.is_reached:
        return "to the nearest point that it can reach"
    found = _find_door(m, way)
    points = way.at(_TIMES)
    moved = np.hypot(*np.diff(way.points, axis=0).T)
    rest = np.diff(way.times)[moved == 0].sum()
    for number, places in enumerate(near.people):
        offsets = points - places
        gaps = np.hypot(*offsets.T)
        k = gaps.argmin()
        turn = turns[number]
        if abs(turn) < pi / 2 or gaps[k] > _NAMED_WITHIN:
            continue
        walk = np.gradient(places, _TICK, axis=0)[k]
        side = "right of" if turn > 0 else "left of"
        ahead = walk @ offsets[k]
        if abs(ahead) > _ALONG * gaps[k] * max(np.hypot(*walk), STANDING_SPEED):
            behind = "waits for" if rest > _WAITING else "behind"
            side = "in front of" if ahead > 0 else behind
        found.append((_TIMES[k], f"{side} person {number}"))
    words = ", ".join(word for _, word in sorted(found)[:3])
    is_straight = moved.sum() < 1.05 * dist(way.points[-1], way.points[0]) + m.cell
    return words or ("straight to the goal" if is_straight else "around obstacles")


def _find_door(m: Map, way: Way) -> list[tuple[float, str]]:
    """When a way leads through the first door, and where: a narrow place, with room before and behind."""
    is_narrow = m.is_narrow[m.locate(way.points)]
    ends = np.flatnonzero(np.diff(is_narrow))[:2] + 1
    if is_narrow[0] or len(ends) < 2:
        return []
    k = ends.sum() // 2
    x, y = way.points[k]
    return [(way.times[k], f"through the door at ({x:.1f}, {y:.1f})")]


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
    s = settings
    at = complex(*position)
    way = complex(*goal) - complex(*position)
    nearest = abs(way)
    turn = 1.0 + 0.0j
    time = s.dt * max(1 / s.gamma, sum(s.step_lengths))
    for zone in zones if way and s.head_on_share else ():
        walk = complex(*zone[7:9])
        across = abs((way.conjugate() * walk).imag)
        h = ellipse_formula(*position, *zone[:5]) - s.r_robot - s.eps
        reach = min(nearest, (s.v_max + abs(walk)) * time)
        if h <= reach and across <= s.head_on_share * abs(way) * abs(walk):
            nearest = h
            turn = _turn_aside(at, way, zone, fixed, s)
    target = complex(*goal) + way * (turn - 1)  # exactly the goal without a turn
    return target.real, target.imag


def _turn_aside(
    at: complex, way: complex, zone: Sequence[float], fixed: Obstacles, s: MPCSettings
) -> complex:
    """By what the `way` is turned, to pass a person with this `zone`."""
    # complex numbers: the conjugate of u times v has the angle from u to v
    a = complex(*zone[:2]) - at
    b = complex(*zone[2:4]) - at
    semi_axis = zone[4] + s.r_robot + s.eps  # of the set h < 0
    is_goal_within = abs(way - a) + abs(way - b) < 2 * semi_axis
    if not a * b or (is_goal_within and hypot(*zone[7:9]) < STANDING_SPEED):
        return 1.0
    cosine = (abs(a) ** 2 + abs(b) ** 2 - 4 * semi_axis**2) / (2 * abs(a) * abs(b))
    w = acos(max(-1.0, min(1.0, cosine))) / 2
    bearing = phase((a / abs(a) + b / abs(b)).conjugate() * way)
    across = 1j * way / abs(way)
    width = sqrt(semi_axis**2 - ((a - b).conjugate() * across).imag ** 2 / 4)
    for side in (1, -1) if s.pass_side == "left" else (-1, 1):
        lead = side * bearing / (s.head_on_share * w) if w else inf
        beside = at + (a + b) / 2 + side * width * across * _BESIDE
        if -1 <= lead < 2 and (fixed.h(beside.real, beside.imag) >= 0).all():
            return rect(1.0, (side * w - bearing) * min(1.0, 2 - lead))
    return 1.0

"""Where the plan heads: the way around walls, and the side of a person who is met head-on.

The way around walls is a shortest path in a visibility graph.

A wall is replaced by a *box*, the smallest rectangle along the wall that holds every position with h < 0. The
approximate distance of a wall of length L is below rho = r_robot + margin inside the box of the half sizes

    along:   sqrt(L^2 / 4 + L rho)        across:   sqrt(L rho - L^2 / 4),  rho if L >= 2 rho

(`verification.find_safe_boundary` is the curve inside it). A shortest path outside of all boxes turns at
their corners only, and touches a box there without entering it. The graph of the corners that see each other
is built once for each set of walls, and the distances of all corners from the goal once for each goal. A
step then needs to know only which corners the robot sees. Of many walls the graph has those that were in the
way so far: a shortest path around some walls that crosses no other wall is the shortest around all.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import acos, atan2, cos, dist, hypot, inf, sin, sqrt
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from ..checks import Array, check_number, check_point, require
from ..errors import SolverError
from .obstacles import Obstacles, Wall, Zone, barrier
from .people import STANDING_SPEED
from .settings import MPCSettings
from .walls import read_walls

Point = tuple[float, float]
# walls that are in the graph from the beginning: its building takes some 0.1 s
_MANY = 64
_CORNER = 1e-3  # distance of a route's corner from its box [m]: more than rounding, less than a robot feels
_DETOUR = 0.5  # a route is kept until it is this much longer than it was at its best [m] (assumed)
# distances from the goal are kept until it has moved this far [m] (assumed)
_GOAL_MOVED = 0.5
# points of a user's route of which the farthest visible one is the target
_SAMPLES = 33
_SEEN = 1 - 1e-9  # share of the way to a point that must be free: all but rounding
# Where free space is looked for, from a zone's centre to where the robot passes.
_ALONG = np.linspace(0, 1, 20)
_SIGNS = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])  # of the corners of a box


def find_route(
    start: ArrayLike, goal: ArrayLike, walls: Any, clearance: float
) -> Array:
    """Find the shortest way from `start` to `goal` around `walls`: a polyline, shape (m, 2) [m].

    Parameters
    ----------
    start, goal : (x, y) [m].
    walls : as of `MPCCBF`.
    clearance : half the width of a wall's box, and how far it reaches beyond the ends [m]. A `start` or
        `goal` inside a box may leave it, but not across its wall.

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
    >>> route.round(2).tolist()
    [[0.0, 0.0], [1.5, -1.5], [2.5, -1.5], [4.0, 0.0]]
    """
    c, at = check_number("clearance", clearance), check_point("start", start)
    require(c >= 0, "clearance", clearance, "a number >= 0", SolverError)
    segments = read_walls(walls)
    length = np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    planner = RoutePlanner(
        segments, np.column_stack([length / 2 + c, np.full(len(segments), c)])
    )
    planner.aim(at, check_point("goal", goal), inf)
    return (
        np.vstack([at, planner.points[planner.turns]])
        if planner.turns
        else np.zeros((0, 2))
    )


def find_boxes(walls: Sequence[Wall], settings: MPCSettings) -> Array:
    """Half sizes of the boxes that hold h < 0, along and across each wall, shape (n, 2) [m].

    Parameters
    ----------
    walls : the walls.
    settings : of the robot.
    """
    xa, ya, xb, yb = np.reshape([wall.numbers for wall in walls], (-1, 4)).T
    margin = np.array([wall.margin(settings) for wall in walls])
    length, rho = np.hypot(xb - xa, yb - ya), settings.r_robot + margin
    ends, side = np.sqrt(length**2 / 4 + length * rho), np.minimum(length, 2 * rho)
    return np.column_stack([ends, np.sqrt(side * rho - side**2 / 4)])


class RoutePlanner:
    """Routes around one set of walls; it remembers the last goal and the last route.

    Parameters
    ----------
    walls : segments, shape (n, 2, 2) [m].
    half : half sizes of their boxes, along and across, shape (n, 2) [m].

    Attributes
    ----------
    points : the corners of the graph, and at last the goal, shape (m, 2) [m].
    turns : numbers of the points on the way, from the next one to the goal; empty if there is no way.
    """

    def __init__(self, walls: Array, half: Array) -> None:
        way = walls[:, 1] - walls[:, 0]
        self._half_length, self._middle, self._half = (
            np.hypot(*way.T) / 2,
            walls.mean(axis=1),
            half,
        )
        along = way / (2 * self._half_length[:, None])
        self._axes = np.stack([along, along[:, ::-1] * (-1, 1)], axis=1)
        reach = np.hypot(*half.T)[:, None]
        self._tree = shapely.STRtree(
            shapely.box(*(self._middle - reach).T, *(self._middle + reach).T)
        )
        self._build_graph(np.arange(len(walls) if len(walls) <= _MANY else 0))

    def reset(self) -> None:
        """Forget the goal and the route."""
        self._goal, self._shortest = (inf, inf), inf
        self.turns: list[int] = []

    def _build_graph(self, boxes: NDArray[np.intp]) -> None:
        """Find the corners outside of these `boxes`, and the pairs of them that see each other.

        A shortest path turns at a corner only between ways that touch its box, without entering it. The boxes
        rule pairs out one after another, the largest first, so that few pairs meet all of them.
        """
        self._boxes = boxes = boxes[np.argsort(-self._half[boxes, 0])]
        out = self._half[boxes]
        out[:, 0] = np.maximum(out[:, 0], self._half_length[boxes] + out[:, 1])
        outward = _SIGNS[:, :, None] * self._axes[boxes, None]
        corners = self._middle[boxes, None] + np.einsum(
            "nkij,ni->nkj", outward, out + _CORNER
        )
        corners, outward = corners.reshape(-1, 2), outward.reshape(-1, 2, 2)
        inside = np.any(
            np.all(np.abs(self._to_boxes(corners, boxes)) < self._half[boxes], axis=2),
            axis=1,
        )
        self._corners, outward = corners[~inside], outward[~inside]
        pairs: NDArray[np.intp] = np.array(np.triu_indices(len(outward), 1))
        for end in (0, 1):
            way = self._corners[pairs[1]] - self._corners[pairs[0]]
            pairs = pairs[
                :,
                np.einsum("nij,nj->ni", outward[pairs[end]], way).prod(axis=1) <= 1e-9,
            ]
        for box in boxes[:, None]:
            start, stop = self._corners[pairs]
            pairs = pairs[:, self._enter(start, stop, self._half, box)[:, 0] >= _SEEN]
        self._pairs = pairs
        self.reset()

    def _to_boxes(self, points: Array, boxes: NDArray[np.intp]) -> Array:
        """Coordinates of `points`, shape (..., 2), along and across n `boxes`, shape (..., n, 2) [m]."""
        offset = points[..., None, :] - self._middle[boxes]
        return np.asarray(np.einsum("...nj,nij->...ni", offset, self._axes[boxes]))

    def _enter(
        self, start: Array, ends: Array, half: Array, boxes: NDArray[np.intp]
    ) -> Array:
        """Where ways from `start` through `ends`, shape (m, 2), enter n `boxes`, shape (m, n).

        As a multiple of the distance to each end; inf if a way does not enter a box.
        """
        at = self._to_boxes(start, boxes)
        way = self._to_boxes(ends, boxes) - at
        way = np.where(way == 0, 1e-200, way)
        first, second = (-half[boxes] - at) / way, (half[boxes] - at) / way
        enter, leave = (
            np.minimum(first, second).max(axis=-1),
            np.maximum(first, second).min(axis=-1),
        )
        return np.where(
            (enter < leave) & (leave > 1 - _SEEN), np.maximum(enter, 0.0), inf
        )

    def _measure_free(self, start: Array, ends: Array, half: Array) -> Array:
        """How far ways from `start` through `ends` lead outside of boxes, at most to the ends.

        As a multiple of the distance to each end, shape (m,).
        """
        points = np.vstack([start, ends])
        near = self._tree.query(shapely.box(*points.min(axis=0), *points.max(axis=0)))
        if not len(near):
            return np.ones(len(ends))
        return np.asarray(self._enter(start, ends, half, near).min(axis=1, initial=1.0))

    def _cut_boxes(self, *points: Point) -> Array:
        """Half sizes of the boxes, cut back to those of `points` that they hold, but not across a wall."""
        half = self._half
        for point in points:
            if not len(near := self._tree.query(shapely.points(point))):
                continue
            half = half.copy()
            at = np.abs(self._to_boxes(np.array(point), near))
            inside, beyond = (
                (at < half[near]).all(axis=1),
                at[:, 0] > self._half_length[near],
            )
            half[near] = np.where(
                np.column_stack([inside & beyond, inside & ~beyond]), at, half[near]
            )
        return half

    def _take_goal(self, goal: Point) -> None:
        """Measure the distances of all corners from the `goal`."""
        self.reset()
        self._goal, n, half = goal, len(self._corners), self._cut_boxes(goal)
        free = self._enter(np.array(goal), self._corners, half, self._boxes) >= _SEEN
        seen = np.flatnonzero(free.all(axis=1))
        i, j = np.hstack([self._pairs, [seen, np.full(len(seen), n)]]).astype(np.intc)
        self.points = points = np.vstack([self._corners, goal])
        graph = coo_array(
            (np.hypot(*(points[i] - points[j]).T), (i, j)), shape=(n + 1, n + 1)
        )
        self._far, self._next = dijkstra(
            graph.tocsr(), directed=False, indices=n, return_predecessors=True
        )

    def aim(
        self, position: Point, goal: Point, lookahead: float
    ) -> tuple[Point, float]:
        """The point to head for from `position` on the way to the `goal`, and the length of that way [m].

        It lies in sight, at most `lookahead` [m] away: on the way, or straight behind its first corner, so
        that the robot does not stop there. Without a way it is the `goal`, and the length is inf.
        """
        if dist(goal, self._goal) > _GOAL_MOVED:
            self._take_goal(goal)
        self.points[-1] = goal
        p, half = np.array(position), self._cut_boxes(position, goal)
        corners = np.array(self.turns[3::-1], int)
        if not self._choose(
            p, corners, self._measure_free(p, self.points[corners], half)[:, None]
        ):
            self._search(p, goal, half)
        if not self.turns:
            return goal, inf
        first = self.points[self.turns[0]]
        length = float(np.hypot(*(first - p)) + self._far[self.turns[0]])
        return self._stretch(p, first, half, min(lookahead, length)), length

    def _search(self, p: Array, goal: Point, half: Array) -> None:
        """Take the shortest way from `p`; walls that it crosses join the graph, until it crosses none."""
        while True:
            self.turns, self._shortest = [], inf
            order = np.argsort(np.hypot(*(self.points - p).T) + self._far)
            self._choose(
                p, order, self._enter(p, self.points[order], half, self._boxes)
            )
            legs = pairwise([p, *self.points[self.turns]])
            enters = [
                self._enter(a, b[None], half, np.arange(len(half)))[0] < _SEEN
                for a, b in legs
            ]
            crossed = np.setdiff1d(np.flatnonzero(np.any(enters, axis=0)), self._boxes)
            if not len(crossed):
                return
            self._build_graph(np.append(self._boxes, crossed))
            self._take_goal(goal)

    def _choose(self, p: Array, corners: NDArray[np.intp], enters: Array) -> bool:
        """Go from `p` to the first of these `corners` on the way to which it `enters` no box.

        False if there is none, or if the way has become a detour. `enters` has shape (corners, boxes).
        """
        seen = corners[(enters >= _SEEN).all(axis=1) & np.isfinite(self._far[corners])]
        if not len(seen):
            return False
        turns = [int(seen[0])]
        length = float(np.hypot(*(self.points[turns[0]] - p)) + self._far[turns[0]])
        if length > self._shortest + _DETOUR:
            return False
        while turns[-1] < len(self._corners):
            turns.append(int(self._next[turns[-1]]))
        self.turns, self._shortest = turns, min(length, self._shortest)
        return True

    def _stretch(self, p: Array, point: Array, half: Array, reach: float) -> Point:
        """The point at `reach` [m] from `p` in the direction of `point`, or where the way enters a box."""
        way = (point - p) * (reach / (float(np.hypot(*(point - p))) or 1.0))
        x, y = (p + self._measure_free(p, p + way[None], half)[0] * way).tolist()
        return x, y

    def follow(
        self, route: Array, position: Point, goal: Point, lookahead: float
    ) -> tuple[Point, float]:
        """As `aim`, with `position` and `lookahead`, on a given `route` to the `goal`, shape (m, 2) [m].

        It begins at the point of the route nearest to the robot. Where no point of it is in sight, the robot
        takes a way of its own.
        """
        p, half = np.array(position), self._cut_boxes(position, goal)
        line = shapely.LineString([*route, goal])
        begin = line.project(shapely.Point(position))
        at = np.linspace(begin, min(line.length, begin + lookahead), _SAMPLES)
        points = shapely.get_coordinates(shapely.line_interpolate_point(line, at))
        seen = np.flatnonzero(self._measure_free(p, points, half) >= _SEEN)
        if not len(seen):
            return self.aim(position, goal, lookahead)
        last, length = points[seen[-1]], dist(position, points[0]) + line.length - begin
        reach = dist(p, last) if at[seen[-1]] == line.length else min(lookahead, length)
        return self._stretch(p, last, half, reach), length


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

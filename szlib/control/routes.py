"""The way to the goal around walls: shortest paths in a visibility graph.

A wall is replaced by a *box*, the smallest rectangle along the wall that holds every position with h < 0. The
approximate distance of a wall of length L is below rho = r_robot + margin inside the box of the half sizes

    along:   sqrt(L^2 / 4 + L rho)        across:   sqrt(L rho - L^2 / 4),  rho if L >= 2 rho

(`distances.find_safe_boundary` is the curve inside it). A shortest path outside of all boxes turns at their
corners only, and touches a box there without entering it. The graph of the corners that see each other is
built once for each set of walls, and the distances of all corners from the goal once for each goal. A step
then needs to know only which corners the robot sees.
"""

from __future__ import annotations

from math import dist, inf
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from ..checks import Array, check_number, check_point, require
from ..errors import SolverError
from .barriers import read_walls

Point = tuple[float, float]
_CORNER = (
    1e-3  # distance of a corner of a route from its box [m]: more than rounding, less than a robot feels
)
_DETOUR = 0.5  # a route is kept until it is this much longer than it was at its best [m] (assumed)
_GOAL_MOVED = 0.5  # distances from the goal are kept until it has moved this far [m] (assumed)
_SAMPLES = 33  # points of a user's route of which the farthest visible one is the target
_BATCH = 32  # corners that are tried at a time, the most promising first
_SEEN = 1 - 1e-9  # share of the way to a point that must be free: all but rounding
_ALL = slice(None)


def find_route(start: ArrayLike, goal: ArrayLike, walls: Any, clearance: float) -> Array:
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
    segments = read_walls(walls)
    c = check_number("clearance", clearance)
    require(c >= 0, "clearance", clearance, "a number >= 0", SolverError)
    half = np.column_stack(
        [np.hypot(*(segments[:, 1] - segments[:, 0]).T) / 2 + c, np.full(len(segments), c)]
    )
    return RoutePlanner(segments, half).find(check_point("start", start), check_point("goal", goal))


def find_boxes(walls: ArrayLike, r_robot: float) -> Array:
    """Half sizes of the boxes that hold h < 0, along and across each wall, shape (n, 2) [m].

    Parameters
    ----------
    walls : end points and margin of each wall, shape (n, 5) [m].
    r_robot : radius of the robot [m].
    """
    xa, ya, xb, yb, margin = np.reshape(np.asarray(walls, float), (-1, 5)).T
    length, rho = np.hypot(xb - xa, yb - ya), r_robot + margin
    ends, side = np.sqrt(length**2 / 4 + length * rho), np.minimum(length, 2 * rho)
    return np.column_stack([ends, np.sqrt(side * rho - side**2 / 4)])


class RoutePlanner:
    """Routes around one set of walls; it remembers the last goal, and the corners of the last route.

    Parameters
    ----------
    walls : segments, shape (n, 2, 2) [m].
    half : half sizes of their boxes, along and across, shape (n, 2) [m].
    """

    def __init__(self, walls: Array, half: Array) -> None:
        way = walls[:, 1] - walls[:, 0]
        self._half_length, self._middle, self._half = np.hypot(*way.T) / 2, walls.mean(axis=1), half
        along = way / (2 * self._half_length[:, None])
        self._axes = np.stack([along, along[:, ::-1] * (-1, 1)], axis=1)
        self._corners, self._pairs = self._build_graph()
        self.reset()

    def reset(self) -> None:
        """Forget the goal and the route."""
        self._goal, self._shortest = (inf, inf), inf
        self._turns: list[int] = []

    def _build_graph(self) -> tuple[Array, NDArray[np.intp]]:
        """Corners outside of all boxes, and pairs of them that see each other, shape (2, m).

        A shortest path turns at a corner only between ways that touch its box, without entering it. The boxes
        rule pairs out one after another, the largest first, so that few pairs meet all of them.
        """
        signs = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
        along = np.maximum(self._half[:, 0], self._half_length + self._half[:, 1])
        out = signs * (np.column_stack([along, self._half[:, 1]])[:, None] + _CORNER)
        corners = (self._middle[:, None] + out @ self._axes).reshape(-1, 2)
        outward = (signs[:, :, None] * self._axes[:, None]).reshape(-1, 2, 2)
        free = np.full(len(corners), True)
        boxes = [slice(i, i + 1) for i in np.argsort(-self._half[:, 0]).tolist()]
        for box in boxes:
            free[free] = ~self._is_in_boxes(corners[free], box)[:, 0]
        corners, outward = corners[free], outward[free]
        pairs: NDArray[np.intp] = np.array(np.triu_indices(len(corners), 1))
        for end in (0, 1):
            way = corners[pairs[1]] - corners[pairs[0]]
            pairs = pairs[:, np.einsum("nij,nj->ni", outward[pairs[end]], way).prod(axis=1) <= 1e-9]
        for box in boxes:
            start, end = corners[pairs]
            pairs = pairs[:, self._measure_free(start, end, self._half, box) >= _SEEN]
        return corners, pairs

    def _to_boxes(self, points: Array, box: slice = _ALL) -> Array:
        """Coordinates of `points`, shape (..., 2), along and across each box, shape (..., n, 2) [m]."""
        offset = points[..., None, :] - self._middle[box]
        return np.asarray(np.einsum("...nj,nij->...ni", offset, self._axes[box]))

    def _is_in_boxes(self, points: Array, box: slice = _ALL) -> NDArray[np.bool_]:
        """True where one of `points`, shape (..., 2), lies in a box, shape (..., n)."""
        return np.asarray((np.abs(self._to_boxes(points, box)) < self._half[box]).all(axis=-1))

    def _measure_free(self, start: Array, ends: Array, half: Array, box: slice = _ALL) -> Array:
        """How far ways from `start` through `ends`, shape (m, 2), lead until they enter a box, shape (m,).

        As a multiple of the distance to each end; inf if a way enters none.
        """
        at = self._to_boxes(start, box)
        way = self._to_boxes(ends, box) - at
        way = np.where(way == 0, 1e-200, way)
        first, second = (-half[box] - at) / way, (half[box] - at) / way
        enter, leave = np.minimum(first, second).max(axis=-1), np.maximum(first, second).min(axis=-1)
        hits = (enter < leave) & (leave > 1 - _SEEN)
        return np.asarray(np.where(hits, np.maximum(enter, 0.0), inf).min(axis=-1, initial=inf))

    def _cut_boxes(self, *points: Point) -> Array:
        """Half sizes of the boxes, cut back to those of `points` that they hold, but not across a wall."""
        half = self._half
        for point in points:
            inside = self._is_in_boxes(np.array(point)).nonzero()[0]
            if len(inside):
                at, half = np.abs(self._to_boxes(np.array(point))[inside]), half.copy()
                side = (at[:, 0] <= self._half_length[inside]).astype(int)
                half[inside, side] = np.minimum(half[inside, side], at[np.arange(len(inside)), side])
        return half

    def _take_goal(self, goal: Point) -> None:
        """Measure the distances of all corners from the `goal`, the last of `_points`."""
        self.reset()
        self._goal, n, half = goal, len(self._corners), self._cut_boxes(goal)
        seen = np.flatnonzero(self._measure_free(np.array(goal), self._corners, half) >= _SEEN)
        i, j = np.hstack([self._pairs, [seen, np.full(len(seen), n)]]).astype(int)
        self._points = points = np.vstack([self._corners, goal])
        graph = coo_array((np.hypot(*(points[i] - points[j]).T), (i, j)), shape=(n + 1, n + 1))
        self._far, self._next = dijkstra(graph.tocsr(), directed=False, indices=n, return_predecessors=True)

    def find(self, start: Point, goal: Point) -> Array:
        """The shortest way from `start` to `goal`, shape (m, 2) [m]; empty if there is none."""
        self.reset()
        self.aim(start, goal, inf)
        return np.vstack([start, self._points[self._turns]]) if self._turns else np.zeros((0, 2))

    def aim(self, position: Point, goal: Point, lookahead: float) -> tuple[Point, float]:
        """The point to head for from `position` on the way to the `goal`, and the length of that way [m].

        It lies in sight, at most `lookahead` [m] away: on the way, or straight behind its first corner, so
        that the robot does not stop there. Without a way it is the `goal`, and the length is inf.
        """
        if dist(goal, self._goal) > _GOAL_MOVED:
            self._take_goal(goal)
        self._points[-1] = goal
        p, half = np.array(position), self._cut_boxes(position, goal)
        if not self._choose(p, half, self._turns[::-1]):
            length = np.hypot(*(self._points - p).T) + self._far
            order = np.argsort(length)[: np.isfinite(length).sum()].tolist()
            self._turns, self._shortest = [], inf
            any(self._choose(p, half, order[i : i + _BATCH]) for i in range(0, len(order), _BATCH))
        if not self._turns:
            return goal, inf
        first = self._points[self._turns[0]]
        length = float(np.hypot(*(first - p)) + self._far[self._turns[0]])
        return self._stretch(p, first, half, min(lookahead, length)), length

    def _choose(self, p: Array, half: Array, corners: list[int]) -> bool:
        """Go from `p` to the first of these `corners` that is in sight; False if none is, or for a detour."""
        seen = np.flatnonzero(self._measure_free(p, self._points[corners], half) >= _SEEN)
        if not len(seen):
            return False
        turns = [corners[seen[0]]]
        length = float(np.hypot(*(self._points[turns[0]] - p)) + self._far[turns[0]])
        if length > self._shortest + _DETOUR:
            return False
        while turns[-1] < len(self._corners):
            turns.append(int(self._next[turns[-1]]))
        self._turns, self._shortest = turns, min(length, self._shortest)
        return True

    def _stretch(self, p: Array, point: Array, half: Array, reach: float) -> Point:
        """The point at `reach` [m] from `p` in the direction of `point`, or where the way enters a box."""
        way = point - p
        away = float(np.hypot(*way)) or 1.0
        share = min(reach / away, float(self._measure_free(p, point[None], half)[0]))
        x, y = (p + share * way).tolist()
        return x, y

    def follow(self, route: Array, position: Point, goal: Point, lookahead: float) -> tuple[Point, float]:
        """As `aim`, with `position` and `lookahead`, on a given `route` to the `goal`, shape (m, 2) [m].

        It begins at the point of the route nearest to the robot. Where no point of it is in sight, the robot
        takes a way of its own.
        """
        line, p, half = (
            shapely.LineString([*route, goal]),
            np.array(position),
            self._cut_boxes(position, goal),
        )
        begin = line.project(shapely.Point(position))
        at = np.linspace(begin, min(line.length, begin + lookahead), _SAMPLES)
        points = shapely.get_coordinates(shapely.line_interpolate_point(line, at))
        seen = np.flatnonzero(self._measure_free(p, points, half) >= _SEEN)
        if not len(seen):
            return self.aim(position, goal, lookahead)
        last, length = points[seen[-1]], dist(position, points[0]) + line.length - begin
        reach = dist(p, last) if at[seen[-1]] == line.length else min(lookahead, length)
        return self._stretch(p, last, half, reach), length

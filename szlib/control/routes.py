"""The way to the goal around walls: shortest paths in a visibility graph.

A wall is replaced by a *box*, the smallest rectangle along the wall that holds every position with h < 0. The
approximate distance of a wall of length L is below rho = r_robot + margin inside the box of the half sizes

    along:   sqrt(L^2 / 4 + L rho)        across:   sqrt(L rho - L^2 / 4),  rho if L >= 2 rho

(`distances.find_safe_boundary` is the curve inside it). A shortest path outside of all boxes turns at their
corners only, and touches a box there without entering it. The graph of the corners that see each other is
built once for each set of walls, and the distances of all corners from the goal once for each goal. A step
then needs to know only which corners the robot sees. Of many walls the graph has those that were in the way
so far: a shortest path around some walls that crosses no other wall is the shortest around all.
"""

from __future__ import annotations

from itertools import pairwise
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
_MANY = (
    64  # walls that are in the graph from the beginning: its building takes some 0.1 s
)
_CORNER = 1e-3  # distance of a corner of a route from its box [m]: larger than rounding
_DETOUR = 0.5  # a route is kept until it is this much longer than it was at its best [m] (assumed)
_GOAL_MOVED = (
    0.5  # distances from the goal are kept until it has moved this far [m] (assumed)
)
_SAMPLES = (
    33  # points of a user's route of which the farthest visible one is the target
)
_SEEN = 1 - 1e-9  # share of the way to a point that must be free: all but rounding
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

"""The admissible-control polygon: what a step could have chosen, and what forbids the rest.

With a in place of the first acceleration and the rest of the plan as it is, the states are

    x_k(a) = x_k + dt^2 (k - 1/2) (a - u_0),   v_k(a) = v_k + dt (a - u_0),   k >= 1

so each row of the problem is a condition on a alone.  A speed row leaves a disc; a barrier row leaves one
side of a curve that is nearly straight, for in one step the robot moves by millimetres.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
import shapely

from ..checks import Array
from .barriers import cbf_residual, compute_h
from .step import Step

_REACH = 3
"""The box of accelerations ends within so many times its half-width of any point in it."""
_POINTS = 49
"""Points of each curve: between two of them it is straight to 1e-3 m/s2."""
_BISECTIONS = 20
"""Halvings after which nothing is left of the width of the box that could be seen."""


class BarrierLimit(NamedTuple):
    """The edge of what one barrier row allows: of which person or wall, from k to k+1, shape (n, 2) [m/s2].

    The curve passes what is allowed on its left.
    """

    kind: Literal["person", "wall"]
    number: int
    k: int
    curve: Array


class AdmissibleControls(NamedTuple):
    """All accelerations that obey every row, with the rest of the plan kept [m/s2, world frame].

    `polygon` is a Shapely polygon, of several parts or empty where the rows leave it so; `limits` are the
    barrier rows that take something away from the box and the speed limit.
    """

    polygon: Any
    limits: tuple[BarrierLimit, ...]


def find_admissible_controls(step: Step) -> AdmissibleControls:
    """The accelerations among which a step could choose: bounds, speed limit, and every barrier row.

    A terminal condition is left out: with the rest of the plan kept it leaves the chosen one alone.  Of a
    step whose plan is not feasible the polygon is empty, or does not hold the control.
    """
    s, u0, x = step.scene.settings, step.control, step.predicted
    free = shapely.box(-s.a_max, -s.a_max, s.a_max, s.a_max)
    for velocity in x[1:, 2:]:
        disc = shapely.Point(u0 - velocity / s.dt).buffer(s.v_max / s.dt, quad_segs=256)
        free = free.intersection(disc)
    polygon, limits = free, []
    people = len(step.scene.people)
    for row, (curve, inward) in enumerate(_edges(step)):
        i, k = divmod(row, s.N_h)
        allowed = shapely.Polygon(np.vstack([curve, curve[::-1] + 2 * _REACH * s.a_max * inward]))
        if not allowed.covers(free):
            limits.append(
                BarrierLimit("person" if i < people else "wall", i - people * (i >= people), k, curve)
            )
            polygon = polygon.intersection(allowed)
    return AdmissibleControls(polygon, tuple(limits))


def _edges(step: Step) -> list[tuple[Array, Array]]:
    """Of each barrier row, obstacle by obstacle, its edge as seen along the way in, and that way."""
    s, u0 = step.scene.settings, step.control
    reach, rows = _REACH * s.a_max, (len(step.h), s.N_h)
    nudges = 1e-3 * s.a_max * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    at = np.broadcast_to(u0 + nudges, (*rows, 4, 2))
    right, left, up, down = np.moveaxis(_residuals(step, at), -1, 0)
    inward = np.stack([right - left, up - down], axis=-1)
    steepest = np.hypot(inward[..., :1], inward[..., 1:])
    inward = np.where(steepest > 0, inward / np.where(steepest > 0, steepest, 1.0), (1.0, 0.0))
    across = np.stack([inward[..., 1], -inward[..., 0]], axis=-1)
    along = u0 + np.linspace(-reach, reach, _POINTS)[:, None] * across[..., None, :]
    low, high = np.full((*rows, _POINTS), -reach), np.full((*rows, _POINTS), reach)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        obeys = _residuals(step, along + middle[..., None] * inward[..., None, :]) >= 0
        low, high = np.where(obeys, low, middle), np.where(obeys, middle, high)
    edges = along + high[..., None] * inward[..., None, :]
    return list(zip(edges.reshape(-1, _POINTS, 2), inward.reshape(-1, 2), strict=True))


def _residuals(step: Step, first: Array) -> Array:
    """What each barrier row leaves over with other first accelerations, (obstacles, N_h, n, 2) to (.., n)."""
    s, k = step.scene.settings, np.arange(step.scene.settings.N_h + 1)[:, None]
    moved = s.dt**2 * np.maximum(k - 0.5, 0)[..., None]
    left = []
    for i, of_one in enumerate(first - step.control):
        now, after = (
            _barrier(step, i, step.predicted[rows, None, :2] + moved[rows] * of_one, s.dt * k[rows])
            for rows in (slice(s.N_h), slice(1, s.N_h + 1))
        )
        left.append(cbf_residual(after, now, s.gamma))
    return np.reshape(np.array(left, float), first.shape[:-1])


def _barrier(step: Step, i: int, points: Array, time: Any) -> Any:
    """h of row `i` of `Step.h` at points (..., 2), `time` seconds from now, shape (...) [m]."""
    scene, s, people = step.scene, step.scene.settings, len(step.scene.people)
    zones, walls = scene.zones[i : i + 1], scene.walls[i - people :][:1] if i >= people else ()
    x, y = np.moveaxis(points, -1, 0)
    return compute_h(x, y, zones, walls, r_robot=s.r_robot, eps=s.eps, time=time)[0]

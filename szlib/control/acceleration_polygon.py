"""The polygon of admissible controls: what a step could have chosen, and what forbids the rest.

With a in place of the first acceleration and the rest of the plan as it is, the states are

    x_k(a) = x_k + dt^2 (k - 1/2) (a - u_0),   v_k(a) = v_k + dt (a - u_0),   k >= 1

so each row of the problem is a condition on a alone. A speed row allows a disc. A barrier row allows one side
of a curve that is nearly straight, because the robot moves by millimetres in one step.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
import shapely

from ..checks import Array
from .barriers import compute_h
from .step import Step

_REACH = 3  # reach of the curves, in half-widths of the box of accelerations: enough to cross the whole box
_POINTS = 49  # points of each curve: between two of them it is straight to 1e-3 m/s2
_BISECTIONS = 20  # halvings after which the rest of the box is too narrow to be seen


class BarrierLimit(NamedTuple):
    """The edge of what one barrier row allows.

    Attributes
    ----------
    kind : "person" or "wall".
    number : of the person or wall.
    k : the row links steps k and k + 1 of the plan.
    curve : points with the allowed side on the left, shape (n, 2) [m/s2].
    """

    kind: Literal["person", "wall"]
    number: int
    k: int
    curve: Array


class AdmissibleControls(NamedTuple):
    """All first accelerations that obey every row, with the rest of the plan unchanged [m/s2, world frame].

    Attributes
    ----------
    polygon : a Shapely polygon, which may be empty or have several parts.
    limits : the barrier rows that forbid something that the bounds and the speed limit allow.
    """

    polygon: Any
    limits: tuple[BarrierLimit, ...]


def find_admissible_controls(step: Step) -> AdmissibleControls:
    """Find the accelerations that a step could have chosen: bounds, speed limit, and every barrier row.

    Prices are ignored: every decay counts as hard. A terminal condition is ignored, because with the rest of
    the plan unchanged it allows only the chosen acceleration. If the plan is not feasible, the polygon is
    empty or does not contain the control.

    Parameters
    ----------
    step : of an `MPCCBF`.

    Examples
    --------
    >>> import shapely
    >>> import szlib
    >>> from szlib.control import find_admissible_controls
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> step = controller.step((-2.5, 0.0, 0.2, 0.0), (4.0, 0.0), [szlib.Person((0.0, 0.0))])
    >>> found = find_admissible_controls(step)
    >>> found.polygon.distance(shapely.Point(step.control)) < 1e-3
    True
    """
    s, u0, x = step.scene.settings, step.control, step.predicted
    free = shapely.box(-s.a_max, -s.a_max, s.a_max, s.a_max)
    for velocity in x[1:, 2:]:
        disc = shapely.Point(u0 - velocity / s.dt).buffer(s.v_max / s.dt, quad_segs=256)
        free = free.intersection(disc)
    polygon, limits = free, []
    for row, (curve, inward) in enumerate(_edges(step)):
        i, k = divmod(row, s.N_h)
        allowed = shapely.Polygon(
            np.vstack([curve, curve[::-1] + 2 * _REACH * s.a_max * inward])
        )
        if not allowed.covers(free):
            limits.append(BarrierLimit(*step.scene.obstacle(i), k, curve))
            polygon = polygon.intersection(allowed)
    return AdmissibleControls(polygon, tuple(limits))


def _edges(step: Step) -> list[tuple[Array, Array]]:
    """The edge of each barrier row, obstacle by obstacle, and the direction to its allowed side."""
    s, u0 = step.scene.settings, step.control
    reach, rows = _REACH * s.a_max, (len(step.h), s.N_h)
    nudges = 1e-3 * s.a_max * np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    at = np.broadcast_to(u0 + nudges, (*rows, 4, 2))
    right, left, up, down = np.moveaxis(_residuals(step, at), -1, 0)
    inward = np.stack([right - left, up - down], axis=-1)
    steepest = np.hypot(inward[..., :1], inward[..., 1:])
    inward = np.where(
        steepest > 0, inward / np.where(steepest > 0, steepest, 1.0), (1.0, 0.0)
    )
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
    """Residual of each barrier row for other first accelerations, (obstacles, N_h, n, 2) to (.., n)."""
    s, n_people = step.scene.settings, len(step.scene.people)
    times, lengths = (
        np.array(s.times[: s.N_h + 1])[:, None],
        np.array(s.step_lengths[: s.N_h])[:, None],
    )
    gammas = [gamma for *_, gamma, _ in step.scene.barriers[:n_people]] + [
        s.gamma
    ] * len(step.scene.walls)
    keeps = (1 - np.reshape(gammas, (-1, 1, 1))) ** lengths
    moved = s.dt * np.maximum(times - 0.5 * s.dt, 0)[..., None]
    left = []
    for i, change in enumerate(first - step.control):
        now, after = (
            _barrier(
                step,
                i,
                step.predicted[rows, None, :2] + moved[rows] * change,
                times[rows],
            )
            for rows in (slice(s.N_h), slice(1, s.N_h + 1))
        )
        left.append(after - keeps[i] * now)
    return np.reshape(np.array(left, float), first.shape[:-1])


def _barrier(step: Step, i: int, points: Array, time: Any) -> Any:
    """h of row `i` of `Step.h` at points (..., 2), `time` seconds from now, shape (...) [m]."""
    scene, s, people = step.scene, step.scene.settings, len(step.scene.people)
    zones, walls = (
        scene.zones[i : i + 1],
        scene.walls[i - people :][:1] if i >= people else (),
    )
    x, y = np.moveaxis(points, -1, 0)
    return compute_h(x, y, zones, walls, r_robot=s.r_robot, eps=s.eps, time=time)[0]

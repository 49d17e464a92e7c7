"""A step checked again, by formulas written anew from the paper: NumPy only, without the problem's code.

Distances, barriers, rows, motion, bounds and overlaps are computed from the question (`Scene`) and the plan
alone, and compared with what the step claims.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
import shapely

from ..checks import Array
from ..zones.ellipses import BODY_RADIUS
from .scene import Scene
from .settings import TOLERANCE

# Two computations of one number may differ by this much, relative to the largest number (at least 1).
ROUNDING = 1e-7
_SAMPLES = 17  # times within a step at which gaps are computed


class ProblemRow(NamedTuple):
    """A row of the problem.

    Attributes
    ----------
    kind : a person's or a wall's barrier, the gap to a person's body in a crowd, the speed limit, or the
        terminal condition ("end").
    number : of the person or wall.
    k : step of the plan: a barrier row links k and k + 1.
    value : negative where the row is violated [m for barriers, m2/s2 for speed, m/s for the end].
    """

    kind: Literal["person", "body", "wall", "speed", "end"]
    number: int
    k: int
    value: float


@dataclass(frozen=True)
class StepReport:
    """What `Step.verify` found.

    Attributes
    ----------
    faults : each claim that is wrong, as a sentence; empty if all claims hold.
    differences : between the step's numbers and ours: of "motion" [m, m/s], "h" and "residual" [m], "slack".
    out_of_bounds : largest |ax| or |ay| of the plan beyond `a_max`, 0 if none [m/s2].
    worst : the row with the smallest value.
    slack : by how much `worst` is violated, 0 if it is not.
    h : smallest barrier in the state itself, in a crowd also after the control [m]; inf without any.
    gap : smallest Euclidean gap of the robot's disc to bodies and walls, or h + eps of a person,
        at times from now until after the control [m].
    feasible, safe : as `Step.feasible` and `Step.safe`, by these numbers.
    """

    faults: tuple[str, ...]
    differences: dict[str, float]
    out_of_bounds: float
    worst: ProblemRow
    slack: float
    h: float
    gap: float
    feasible: bool
    safe: bool

    @property
    def ok(self) -> bool:
        """True if every claim of the step holds."""
        return not self.faults


def verify_plan(step: Any) -> StepReport:
    """Check the plan of a `step` (a `Step`), and its claims: h, residual, slack, feasible and safe."""
    scene: Scene = step.scene
    s, x, control = scene.settings, np.asarray(step.predicted, float), step.control
    lengths, level = np.array(s.grid or [1] * s.N), _find_level(scene)
    dt, times = s.dt * lengths[:, None], s.dt * np.r_[0, np.cumsum(lengths)]
    u = np.diff(x[:, 2:], axis=0) / dt
    moved = np.vstack(
        [scene.state, np.c_[x[:-1, :2] + dt * x[:-1, 2:] + dt**2 / 2 * u, x[1:, 2:]]]
    )
    at = list(zip(x[:, :2], times, strict=True))
    h = np.reshape([_compute_h(scene, *each) for each in at], (len(x), -1)).T
    gaps = np.reshape([_compute_gaps(scene, *each) for each in at], (len(x), -1)).T
    gamma = np.full((len(h), 1), s.gamma)
    if s.crowding and level != "alone":
        gamma[: len(scene.people)] = s.crowding.gamma
    residual = h[:, 1 : s.N_h + 1] - (1 - gamma) ** lengths[: s.N_h] * h[:, : s.N_h]
    t = np.linspace(0.0, s.dt, _SAMPLES)[:, None]
    path = x[0, :2] + t * x[0, 2:] + t**2 / 2 * control
    gap = _find_gap(scene, path)
    worst = min(_list_rows(scene, x, h, gaps, residual), key=lambda row: row.value)
    # In a crowd no row demands h >= 0, so that of people is checked after the control as well.
    after = h[: len(scene.people) if level == "crowd" else 0, 1]
    slack, min_h = (
        max(0.0, -worst.value),
        float(np.r_[h[:, 0], after].min(initial=np.inf)),
    )
    feasible = slack <= TOLERANCE
    safe = feasible and not scene.tracked.unknown and min(min_h, gap) >= -TOLERANCE
    beyond = max(0.0, float(np.abs([*u, control]).max()) - s.a_max)
    size, scale = (
        max(1.0, float(np.abs(x).max())),
        max(1.0, float(np.abs(h).max(initial=0.0))),
    )
    differences = {
        "motion": float(
            max(np.abs(moved - x).max(), s.dt * np.abs(u[0] - control).max())
        ),
        "h": _differ(h[:, 0], step.h),
        "residual": _differ(residual, step.residual),
        "slack": abs(slack - step.slack),
    }
    faults = [
        f"{name} differs by {value:.2g}"
        for name, value in differences.items()
        if not value <= ROUNDING * (size if name == "motion" else scale)
    ]
    if not beyond <= ROUNDING / s.dt * size:
        faults.append(f"an acceleration is {beyond:.2g} m/s2 beyond its bound")
    undecided = abs(slack - TOLERANCE) <= ROUNDING * scale
    claims = step.feasible, step.safe
    undecided |= _is_undecided(scene, path, min(min_h, gap), claims[1])
    if not undecided and (feasible, safe) != claims:
        faults.append(
            "the step says feasible {}, safe {}; found {}, {}".format(
                *claims, feasible, safe
            )
        )
    return StepReport(
        tuple(faults), differences, beyond, worst, slack, min_h, gap, feasible, safe
    )


def verify_disc(scene: Scene, heading: float, step: Any) -> StepReport:
    """Check the disc of a robot with two wheels: the report of the point ahead, with the disc's numbers.

    Parameters
    ----------
    scene : what the step was asked, for the disc.
    heading : of the robot now [rad].
    step : a `DriveStep`.
    """
    found: StepReport = step.point.verify()
    (v, omega), dt = step.control, scene.settings.dt
    turned = 1j * (omega or 1e-9) * np.linspace(0.0, dt, _SAMPLES)
    way = v * np.exp(1j * heading) * np.expm1(turned) / turned[-1] * dt
    path = np.array(scene.state[:2]) + np.c_[way.real, way.imag]
    now, gap = _compute_h(scene, path[0], 0.0), _find_gap(scene, path)
    min_h = min(now, default=np.inf)
    worst = min(min_h, gap, *_compute_h(scene, path[-1], dt))
    safe = found.feasible and not scene.tracked.unknown and worst >= -TOLERANCE
    rounding = ROUNDING * max(1.0, float(np.abs([*path.ravel(), *now]).max()))
    is_right = {
        "motion": np.abs(path[[0, -1]] - step.predicted[:2, :2]).max() <= rounding,
        "h": _differ(np.array(now), step.h) <= rounding,
        "safe": safe == step.safe or _is_undecided(scene, path, worst, step.safe),
    }
    faults = [
        f"{name} of the disc is wrong" for name, holds in is_right.items() if not holds
    ]
    return replace(found, faults=(*found.faults, *faults), h=min_h, gap=gap, safe=safe)


def _differ(found: Array, claimed: Array) -> float:
    """Largest difference; walls out of reach, of which inf is claimed, are judged by their rows alone."""
    return float(np.abs((found - claimed)[claimed != np.inf]).max(initial=0.0))


def _is_undecided(scene: Scene, path: Array, worst: float, claimed: bool) -> bool:
    """True if rounding decides whether the step is safe, or a loose bound may say (`claimed`) unsafe."""
    speed = max(
        [float(np.hypot(*person.velocity)) for person in scene.people], default=0.0
    )
    reach = scene.settings.dt * speed + 2 * np.abs(path - path[0]).sum(axis=1).max()
    is_rounded = abs(worst + TOLERANCE) <= ROUNDING * max(
        1.0, float(np.abs(path).max())
    )
    return bool(is_rounded or (not claimed and worst <= reach))


def _find_gap(scene: Scene, path: Array) -> float:
    """Smallest gap to bodies and walls, and h + eps of people, on the `path` of a step, shape (n, 2) [m].

    -inf inside of a solid wall.
    """
    if scene.solids is not None and scene.solids.distance(shapely.Point(path[0])) == 0:
        return -np.inf
    found, n = [np.inf], len(scene.people)
    for point, time in zip(
        path, np.linspace(0.0, scene.settings.dt, len(path)), strict=True
    ):
        h = _compute_h(scene, point, time)[:n]
        found += [*_compute_gaps(scene, point, time), *np.add(h, scene.settings.eps)]
    return float(min(found))


def _find_level(scene: Scene) -> str:
    """How crowded it is around the robot, counted anew."""
    crowding = scene.settings.crowding
    if crowding is None or not scene.people:
        return "alone"
    offsets = np.array([person.position for person in scene.people]) - scene.state[:2]
    near = (np.hypot(*offsets.T) <= crowding.radius).sum()
    return (
        "crowd" if near >= crowding.many else "few" if near >= crowding.few else "alone"
    )


def _list_rows(
    scene: Scene, x: Array, h: Array, gaps: Array, residual: Array
) -> list[ProblemRow]:
    """Every row of the hard problem."""
    s, level, rows = scene.settings, _find_level(scene), list[ProblemRow]()
    for (i, k), value in np.ndenumerate(residual):
        kind, number = scene.obstacle(i)
        if kind == "person" and level == "few":
            rows.append(ProblemRow(kind, number, k, float(h[i, k + 1])))
        elif kind == "person" and level == "crowd" and s.crowding:
            rows.append(
                ProblemRow("body", number, k, float(gaps[i, k + 1]) - s.crowding.gap)
            )
        else:
            rows.append(ProblemRow(kind, number, k, float(value)))
    speed = s.v_max**2 - (x[1:, 2:] ** 2).sum(axis=1)
    rows += [
        ProblemRow("speed", 0, k + 1, float(value)) for k, value in enumerate(speed)
    ]
    if scene.terminal != "none":
        expected = (
            scene.people[0].velocity if scene.terminal == "person" else (0.0, 0.0)
        )
        rows.append(
            ProblemRow("end", 0, s.N, -float(np.abs(x[-1, 2:] - expected).max()))
        )
    return rows


def _compute_h(scene: Scene, point: Array, time: float) -> list[float]:
    """h of every person, `time` seconds from now, and of every wall (paper, eq. 3-7) [m]."""
    s, found = scene.settings, []
    for person, zone in zip(scene.people, scene.person_zones, strict=True):
        position, heading = (
            np.add(person.position, np.multiply(time, person.velocity)),
            person.heading or 0.0,
        )
        c, n, tilt = np.cos(heading), np.sin(heading), heading + zone.angle
        offset = point - position - np.array([[c, -n], [n, c]]) @ np.array(zone.center)
        along, across = (
            offset @ (np.cos(tilt), np.sin(tilt)),
            offset @ (-np.sin(tilt), np.cos(tilt)),
        )
        (a, b) = zone.semi_axes
        f = np.sqrt((a - b) * (a + b))
        distance = (np.hypot(along - f, across) + np.hypot(along + f, across)) / 2 - a
        found.append(float(distance) - s.r_robot - s.eps)
    start, end, margin = np.hsplit(
        np.reshape(np.array(scene.walls, float), (-1, 5)), (2, 4)
    )
    length = np.hypot(*(end - start).T)
    (ux, uy), (px, py) = (end - start).T / length, (point - (start + end) / 2).T
    t = length / 4 - (px**2 + py**2) / length
    return [
        *found,
        *(np.hypot(px * uy - py * ux, np.minimum(t, 0.0)) - s.r_robot - margin[:, 0]),
    ]


def _compute_gaps(scene: Scene, point: Array, time: float) -> list[float]:
    """Euclidean gaps of the robot's disc to every body, `time` seconds from now, and to every wall [m]."""
    found = []
    for person in scene.people:
        position = np.add(person.position, np.multiply(time, person.velocity))
        found.append(
            float(np.hypot(*(point - position))) - BODY_RADIUS - scene.settings.r_robot
        )
    start, end, _ = np.hsplit(np.reshape(np.array(scene.walls, float), (-1, 5)), (2, 4))
    along = ((point - start) * (end - start)).sum(axis=1) / ((end - start) ** 2).sum(
        axis=1
    )
    nearest = start + np.clip(along, 0.0, 1.0)[:, None] * (end - start)
    return [*found, *(np.hypot(*(point - nearest).T) - scene.settings.r_robot)]

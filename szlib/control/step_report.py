"""A step checked again, by formulas written anew from the paper: NumPy only, and nothing of the problem's.

Distances, barriers, rows, motion, bounds and overlaps are worked out from what was asked (`Scene`) and the
plan alone, and held against what the step says of itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from ..checks import Array
from .person import BODY_RADIUS
from .problem import TOLERANCE
from .scene import Scene

if TYPE_CHECKING:
    from .step import Step

NEAR = 1e-7
"""Two computations of one number may differ by so much, relative to the largest (at least 1)."""


class Row(NamedTuple):
    """A row of the problem: of a person's or a wall's barrier from k to k+1, of the speed at k, of the end.

    `which` person or wall it is; `value` is what it leaves over, negative where it is violated [m for
    barriers, m2/s2 for speed, m/s for the end].
    """

    kind: Literal["person", "wall", "speed", "end"]
    which: int
    k: int
    value: float


@dataclass(frozen=True)
class Report:
    """What was found when a step was checked again.

    Attributes
    ----------
    faults : what is not as the step says, in words; empty if everything is.
    off : by how much the step's number and ours differ: of "motion" [m, m/s], "h" and "residual" [m], and
        "slack".
    out_of_bounds : largest |ax| or |ay| of the plan beyond `a_max`, 0 if none [m/s2].
    worst : the row that leaves over least.
    slack : by how much it is violated, 0 if it is not.
    h : least barrier in the state itself [m]; inf with nobody and no wall.
    gap : least Euclidean gap of the robot's disc to bodies and walls, now and after the control [m].
    feasible, safe : as `Step.feasible` and `Step.safe`, by these numbers.
    """

    faults: tuple[str, ...]
    off: dict[str, float]
    out_of_bounds: float
    worst: Row
    slack: float
    h: float
    gap: float
    feasible: bool
    safe: bool

    @property
    def ok(self) -> bool:
        """True if everything is as the step says."""
        return not self.faults


def verified(step: Step) -> Report:
    """The report of `Step.verify`."""
    scene, s, x = step.scene, step.scene.settings, np.asarray(step.predicted, float)
    u = np.diff(x[:, 2:], axis=0) / s.dt
    moved = np.vstack([scene.state, np.c_[x[:-1, :2] + s.dt * x[:-1, 2:] + s.dt**2 / 2 * u, x[1:, 2:]]])
    h = np.reshape([_barriers(scene, point, k * s.dt) for k, point in enumerate(x[:, :2])], (len(x), -1)).T
    residual = h[:, 1 : s.N_h + 1] - (1 - s.gamma) * h[:, : s.N_h]
    gaps = [*_gaps(scene, x[0, :2], 0.0), *_gaps(scene, x[1, :2], s.dt)]
    worst = min(_rows(step, x, residual), key=lambda row: row.value)
    slack, least_h, gap = (
        max(0.0, -worst.value),
        float(h[:, 0].min(initial=np.inf)),
        min(gaps, default=np.inf),
    )
    feasible = slack <= TOLERANCE
    safe = feasible and not scene.seen.lost and min(least_h, gap) >= -TOLERANCE
    beyond = max(0.0, float(np.abs([*u, step.control]).max()) - s.a_max)
    scale = max(1.0, float(np.abs(h).max(initial=0.0)))
    off = {
        "motion": float(max(np.abs(moved - x).max(), s.dt * np.abs(u[0] - step.control).max())),
        "h": float(np.abs(h[:, 0] - step.h).max(initial=0.0)),
        "residual": float(np.abs(residual - step.residual).max(initial=0.0)),
        "slack": abs(slack - step.slack),
    }
    largest = {"motion": max(1.0, float(np.abs(x).max()))}
    faults = [
        f"{name} is {each:.2g} off"
        for name, each in off.items()
        if not each <= NEAR * largest.get(name, scale)
    ]
    if not beyond <= NEAR / s.dt * largest["motion"]:
        faults.append(f"an acceleration is {beyond:.2g} m/s2 beyond its bound")
    blurred = abs(slack - TOLERANCE) <= NEAR * scale or abs(min(least_h, gap) + TOLERANCE) <= NEAR * scale
    if not blurred and (feasible, safe) != (step.feasible, step.safe):
        faults.append(f"it says feasible {step.feasible}, safe {step.safe}; found {feasible}, {safe}")
    return Report(tuple(faults), off, beyond, worst, slack, least_h, gap, feasible, safe)


def _rows(step: Step, x: Array, residual: Array) -> list[Row]:
    """Every row of the hard problem."""
    scene, s, people = step.scene, step.scene.settings, len(step.scene.people)
    rows = [
        Row("person", i, k, float(value)) if i < people else Row("wall", i - people, k, float(value))
        for i, of_one in enumerate(residual)
        for k, value in enumerate(of_one)
    ]
    left = s.v_max**2 - (x[1:, 2:] ** 2).sum(axis=1)
    rows += [Row("speed", 0, k + 1, float(value)) for k, value in enumerate(left)]
    if step.terminal != "none":
        meant = scene.people[0].velocity if step.terminal == "person" else (0.0, 0.0)
        rows.append(Row("end", 0, s.N, -float(np.abs(x[-1, 2:] - meant).max())))
    return rows


def _barriers(scene: Scene, point: Array, seconds: float) -> list[float]:
    """h of every person, so many seconds later, and of every wall (paper, eq. 3-7) [m]."""
    s, found = scene.settings, []
    for person, zone in zip(scene.people, scene.kept, strict=True):
        here, heading = np.array(person.position) + seconds * np.array(person.velocity), person.heading or 0.0
        c, n, tilt = np.cos(heading), np.sin(heading), heading + zone.angle
        off = point - here - np.array([[c, -n], [n, c]]) @ np.array(zone.center)
        along, across = off @ (np.cos(tilt), np.sin(tilt)), off @ (-np.sin(tilt), np.cos(tilt))
        (a, b) = zone.semi_axes
        f = np.sqrt((a - b) * (a + b))
        distance = (np.hypot(along - f, across) + np.hypot(along + f, across)) / 2 - a
        found.append(float(distance) - s.r_robot - s.eps)
    for wall, margin in zip(scene.walls, scene.margins, strict=True):
        start, end = np.reshape(wall, (2, 2))
        length = np.hypot(*(end - start))
        (ux, uy), (px, py) = (end - start) / length, point - (start + end) / 2
        t = length / 4 - (px**2 + py**2) / length
        found.append(float(np.hypot(px * uy - py * ux, min(t, 0.0))) - s.r_robot - margin)
    return found


def _gaps(scene: Scene, point: Array, seconds: float) -> list[float]:
    """Euclidean gaps of the robot's disc to every body, so many seconds later, and to every wall [m]."""
    found = []
    for person in scene.people:
        here = np.array(person.position) + seconds * np.array(person.velocity)
        found.append(float(np.hypot(*(point - here))) - BODY_RADIUS - scene.settings.r_robot)
    for wall in scene.walls:
        start, end = np.reshape(wall, (2, 2))
        share = np.clip((point - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
        found.append(float(np.hypot(*(point - start - share * (end - start)))) - scene.settings.r_robot)
    return found


# in words


def described(step: Step, report: Report) -> str:
    """A step in words: what happened, what is near, and where no plan is feasible, why and what helps."""
    scene, (ax, ay) = step.scene, step.control.tolist()
    lines = [f"Step: {_HAPPENED[step.rung]}; {'safe' if step.safe else 'not safe: ' + _why(step)}"]
    lines.append(f"  control ({ax:.3g}, {ay:.3g}) m/s2 after {1e3 * step.solve_time:.2g} ms")
    if len(step.h):
        i = int(np.argmin(step.h))
        lines.append(f"  nearest is {_name(scene, i)}: h = {step.h[i]:.3g} m")
    if not step.feasible:
        lines.append(f"  the plan does not keep {_cause(step, report.worst)}, by {report.slack:.2g}")
        lines.append(f"  what helps: {_help(step, report.worst)}")
    if step.timed_out:
        lines.append(f"  its time was up, {scene.settings.time_limit} s; what helps: a larger time_limit")
    if step.goal_blocked:
        lines.append(f"  the goal {scene.goal} cannot be reached: h < 0 there; the robot waits beside it")
    if step.set_aside:
        lines.append(
            f"  {step.set_aside} of the people had numbers that cannot be used; {step.lost} are lost"
        )
    lines += [f"  WRONG: {fault}" for fault in report.faults]
    return "\n".join(lines)


_HAPPENED = {
    "warm": "optimal, from the last plan",
    "cold": "optimal, from full braking",
    "kept": "kept to the last plan, which ends at rest",
    "relaxed": "relaxed, with as little violation as there may be",
    "braking": "full braking, since no solver had an answer",
}


def _why(step: Step) -> str:
    if step.lost:
        return "somebody is lost, so it comes to rest"
    if (step.h < -TOLERANCE).any():
        return f"the robot already is too near to {_name(step.scene, int(np.argmin(step.h)))}"
    return "its plan is not feasible" if not step.feasible else "its disc overlaps a body or a wall"


def _name(scene: Scene, i: int) -> str:
    """The person or wall of a row of `Step.h`."""
    people = len(scene.people)
    if i >= people:
        return f"wall {i - people}"
    known = scene.people[i].id
    return f"person {i}" + ("" if known is None else f" (id {known!r})")


def _of(scene: Scene, row: Row) -> int:
    """The row of `Step.h` that it belongs to."""
    return row.which + (len(scene.people) if row.kind == "wall" else 0)


def _cause(step: Step, row: Row) -> str:
    if row.kind == "speed":
        return f"the speed limit at k = {row.k}"
    if row.kind == "end":
        return "the velocity that it has to end with"
    return f"the barrier of {_name(step.scene, _of(step.scene, row))} from k = {row.k} to {row.k + 1}"


def _help(step: Step, row: Row) -> str:
    s = step.scene.settings
    if row.kind in ("person", "wall") and step.h[_of(step.scene, row)] < -TOLERANCE:
        return "nothing now, for the robot already is too near; it leads out again"
    if row.kind == "speed":
        return f"start at v_max = {s.v_max:g} m/s or slower, or raise v_max"
    if row.kind == "end":
        return (
            f"more than N = {s.N} steps, a larger a_max than {s.a_max:g}, or a lower v_max than {s.v_max:g}"
        )
    longer = f"a larger N_h than {s.N_h}" if s.N_h < s.N else f"a larger N than {s.N}"
    return f"to brake sooner: a smaller gamma than {s.gamma:g}, {longer}, or a lower v_max than {s.v_max:g}"

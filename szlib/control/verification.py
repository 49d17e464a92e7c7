"""Steps computed again by other formulas.

`verify_step` uses formulas written anew from the paper, NumPy only, without the problem's code: distances,
barriers, rows, motion, bounds and overlaps are computed from the question (`Scene`) and the plan alone, and
compared with what the step claims. Kinds of obstacles that are not of szlib are measured by their own
formula, and two wheels follow the point by the model of the robot (`Unicycle`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import inf
from typing import Any, NamedTuple

import numpy as np
import shapely

from ..core.checks import Array
from ..zones.ellipses import BODY_RADIUS, Ellipse
from .obstacles import HalfPlane, PaperWall, Priority, Wall, Zone
from .settings import TOLERANCE, MPCSettings

# Two computations of one number may differ by this much, or by a share of the largest number.
ROUNDING = 1e-7
_RELATIVE = 1e-12
PIECES = 16  # of a step, at whose ends gaps are computed
_SAMPLES = PIECES + 1
_MOST_PIECES = 1000  # of a braking path
# A robot that moves less than this for a step is never faster than 1 mm/s within it: it rests [m/s].
AT_REST = 2.5e-4


class Row(NamedTuple):
    """A row of the problem.

    Attributes
    ----------
    kind : of the obstacle; "speed" or "end" for the speed limit and rest at the end.
    name : what the row is about, in words.
    value : negative where the row is violated [m for barriers, m2/s2 for speed, m/s for the end].
    """

    kind: str
    name: str
    value: float


class Rows(NamedTuple):
    """Rows of one level, of all obstacles of a kind.

    Attributes
    ----------
    level : their priority; None: of the robot, which no obstacle changes.
    kind : of the obstacles; "speed" or "end" for the speed limit and rest at the end.
    first : number of the first obstacle.
    values : negative where a row is violated, shape (obstacles, k) [as of `Row`].
    is_floor : True if it joins only with a `decay_price`, or where barrier conditions contradict each other.
    """

    level: Priority | None
    kind: str
    first: int
    values: Array
    is_floor: bool = False

    def is_hard(self, s: MPCSettings) -> bool:
        """True if no price can buy a violation, by the settings `s`."""
        if self.level is None or s.decay_price == inf:
            return not self.is_floor
        return self.level < Priority.ZONE + (s.zone_price == inf)


def list_rows(scene: Any, x: Array, h: Array, gaps: Array) -> Iterator[Rows]:
    """The rows of every level at the states `x` of a plan for a `scene`, shape (N+1, 4).

    `h` are the barriers there, and `gaps` those to bodies less `body_gap`, shape (n, N+1) each [m].
    """
    s = scene.settings
    lengths = np.array(s.step_lengths)
    first = 0
    stop = 1 - min(1.0, s.a_max * s.dt / s.v_max)
    for kind, _, offsets in scene.barriers.groups:
        own = h[first : first + len(offsets)]
        now, then = own[:, :-1], own[:, 1:]
        if kind.has_barrier:
            falls = then - (1 - s.gamma) ** lengths * now
            yield Rows(Priority.DECAY, kind.kind, first, falls[:, : s.N_h])
            is_fixed = kind.priority == Priority.WALL
            then = then - stop**lengths * now if is_fixed else then[:, : s.N_h]
        yield Rows(kind.priority, kind.kind, first, then, kind.has_barrier)
        first += len(offsets)
    if len(gaps):
        yield Rows(Priority.BODY, "body", 0, gaps[:, 1:], is_floor=True)
    velocity = x[1:, 2:]
    slower = s.v_max**2 - (velocity**2).sum(axis=1)
    yield Rows(None, "speed", 0, slower[None])
    if s.terminal == "rest":
        speed = np.abs(velocity).max(axis=1)
        is_end = np.arange(s.N) == s.N - 1
        yield Rows(None, "end", 0, np.where(is_end, -speed, inf)[None])


@dataclass(frozen=True)
class Report:
    """What `Step.verify` found.

    Attributes
    ----------
    faults : each claim that is wrong, as a sentence; empty if all claims hold.
    worst : the row without a price that has the smallest value.
    slack : by how much `worst` is violated, 0 if it is not.
    feasible, safe : as `Step.feasible` and `Step.safe`, by these numbers.
    """

    faults: tuple[str, ...]
    worst: Row
    slack: float
    feasible: bool
    safe: bool

    @property
    def ok(self) -> bool:
        """True if every claim of the step holds."""
        return not self.faults


class Sampled(NamedTuple):
    """A way: `points` and their `times`, `PIECES` for each input, and the `states` between two inputs."""

    points: Array
    times: Array
    states: Array


def verify_step(step: Any) -> Report:
    """Check the plan of a `step` (a `Step`), and its claims."""
    scene = step.scene
    asked = step.asked
    s = asked.settings
    x = step.planned
    lengths = np.array(s.step_lengths)
    way = _sample(np.array(asked.state), step.inputs, s.dt * lengths)
    at = x[:, :2], way.times[::PIECES]
    h = _measure(asked, *at, is_barrier=True)
    residual = h[:, 1:] - (1 - s.gamma) ** lengths * h[:, :-1]
    gaps = _measure(asked, *at)[: len(scene.people)] - s.body_gap
    rows = list_rows(asked, x, h, gaps)
    worst = _find_worst(asked, (each for each in rows if each.is_hard(s)))
    path = step.carry(way).points
    within = path[:_SAMPLES], way.times[:_SAMPLES]
    of_disc = _measure(scene, *within, is_barrier=True)
    gap = _measure(scene, *within).min(initial=inf)
    of_zones = of_disc[: len(scene.people)].min(initial=inf) + scene.settings.eps
    if shapely.distance(scene.solids, shapely.Point(path[0])) == 0:
        gap = -inf
    lowest = float(min(of_disc[:, [0, -1]].min(initial=inf), gap, of_zones))
    slack = max(0.0, -worst.value)
    feasible = slack <= TOLERANCE
    safe = feasible and not scene.tracked.unknown and lowest >= -TOLERANCE
    compared = [
        ("motion differs", way.states, x),
        ("motion of the disc differs", path[::PIECES], step.predicted[:, :2]),
        ("h differs", of_disc[:, 0], step.h),
        ("residual differs", residual[:, : s.N_h], step.residual),
        ("slack differs", slack, step.slack),
        (
            "an acceleration is beyond its bound",
            step.inputs.clip(-s.a_max, s.a_max),
            step.inputs,
        ),
    ]
    if step.of_point is None:
        compared.append(("control differs", step.control, step.inputs[0]))
    largest = max(np.abs(x).max(), np.abs(h).max(initial=0.0))
    tolerance = max(ROUNDING, _RELATIVE * largest)
    faults = []
    for name, found, given in compared:
        error = np.abs(found - given).max(initial=0.0)
        if not error <= tolerance:
            faults.append(f"{name} by {error:.2g}")
    undecided = min(abs(slack - TOLERANCE), abs(lowest + TOLERANCE)) <= tolerance
    # the bound of a step may be loose where somebody or the robot is fast
    fastest = max([np.hypot(*each.velocity) for each in scene.people], default=0.0)
    reach = s.dt * fastest + 2 * np.abs(within[0] - path[0]).sum(axis=1).max()
    undecided |= not step.safe and lowest <= reach
    if not undecided and (feasible, safe) != (step.feasible, step.safe):
        faults.append(
            f"the step says feasible {step.feasible}, safe {step.safe}; found {feasible}, {safe}"
        )
    if step.status == "optimal" and slack > TOLERANCE + tolerance:
        faults.append(f"the status is optimal; the plan violates {worst.name}")
    faults += _check_guard(step, s.dt * lengths)
    return Report(tuple(faults), worst, slack, feasible, safe)


def _sample(state: Array, inputs: Array, lasts: Array, rests_by: Any = None) -> Sampled:
    """The way of a double integrator that holds each of the `inputs` for its time (paper, eq. 8).

    Then it brakes as hard as it can, with the settings `rests_by`, in steps of dt (two wheels follow each).
    """
    if rests_by:
        v = state[2:] + lasts @ inputs
        stop = np.abs(v).max() / rests_by.a_max
        piece = rests_by.dt * max(1, np.ceil(stop / rests_by.dt / _MOST_PIECES))
        left = np.append(np.arange(stop, ROUNDING, -piece), 0.0)
        braking = np.diff(left)[:, None] * v / (piece * stop or 1.0)
        inputs = np.concatenate([inputs, braking])
        lasts = np.append(lasts, np.full(len(braking), piece))
    points = [state[None, :2]]
    times = [np.zeros(1)]
    states = [state]
    shares = np.linspace(0.0, 1.0, _SAMPLES)[1:]
    for u, dt in zip(inputs, lasts, strict=True):
        p, v = np.split(states[-1], 2)
        t = dt * shares[:, None]
        points.append(p + t * v + t**2 / 2 * u)
        times.append(times[-1][-1] + t[:, 0])
        states.append(np.r_[points[-1][-1], v + dt * u])
    return Sampled(np.concatenate(points), np.concatenate(times), np.array(states))


def _check_guard(step: Any, lasts: Array) -> Iterator[str]:
    """What is wrong with `walls_safe` and `passively_safe` of a `step`, by many points of both ways.

    Its inputs have the times `lasts`.
    """
    scene = step.scene
    s = step.asked.settings
    is_clear = []
    levels = np.array([each.priority for each in scene.barriers.items], int)
    places = np.reshape([person.position for person in scene.people], (-1, 2))
    for n in (1, s.N):
        asked = np.array(step.asked.state), step.inputs[:n], lasts[:n]
        points, times, _ = step.carry(_sample(*asked, s))
        gaps = _measure(scene, points, times, as_predicted=False)
        touches = np.asarray((gaps < -TOLERANCE).any(axis=1))
        if n == 1:
            stops = not touches[levels == Priority.WALL].any()
        moved = points[::PIECES] - points[0]
        nearer = ((places - points[0]) @ moved.T > TOLERANCE).any(axis=1)
        overlaps = gaps[: len(places), 0] < -TOLERANCE
        is_hit: Array = np.where(overlaps, nearer, touches[: len(places)])
        rests = np.hypot(*(points - points[0]).T).max() <= AT_REST * s.dt
        is_clear.append(bool(rests or not is_hit.any()))
    if step.walls_safe and not stops:
        yield "the step says that it can stop before every wall; it cannot"
    if step.passively_safe and not (stops and any(is_clear)):
        yield "the step says that it rests before somebody walks into it; it does not"


def _find_worst(scene: Any, rows: Iterable[Rows]) -> Row:
    """The row without a price that has the smallest value."""
    level, kind, first, values, _ = min(rows, key=lambda each: float(each.values.min()))
    i, k = np.unravel_index(values.argmin(), values.shape)
    name = {"speed": "the speed limit", "end": "rest"}.get(kind, "")
    if level is not None:
        name = f"the condition of {'the body of ' * (kind == 'body')}{scene.name(first + int(i))}"
    return Row(kind, f"{name} at k = {k + 1}", float(values[i, k]))


def _measure(
    scene: Any,
    points: Array,
    times: Array,
    *,
    is_barrier: bool = False,
    as_predicted: bool = True,
) -> Array:
    """h, or Euclidean gaps of the disc, of each obstacle at points and times from now, shape (n, k) [m].

    People keep their velocity, or move `as_predicted`.
    """
    s = scene.settings
    found = []
    for i, each in enumerate(scene.barriers.items):
        if isinstance(each, Zone):
            person = scene.people[i]
            center, growth = _find_places(person, times, s, as_predicted)
            offset = points - center
            measured = np.hypot(*offset.T) - BODY_RADIUS
            if is_barrier:
                facing = person.heading or 0.0
                measured = _measure_zone(offset, facing, scene.person_zones[i]) - growth
        elif type(each) is HalfPlane:
            normal = complex(*each.numbers[2:])
            seen = points @ (1, 1j) - complex(*each.numbers[:2])
            measured = (seen * normal.conjugate()).real
        elif type(each) in (Wall, PaperWall):
            is_paper = is_barrier and isinstance(each, PaperWall)
            measured = _measure_wall(points, each, is_paper)
        else:
            measure = each.distance if is_barrier else each.gap
            measured = measure(*points.T, times, *each.numbers)
        if is_barrier:
            measured = measured - each.margin(s)
        found.append(measured - s.r_robot)
    return np.reshape(found, (-1, len(points)))


def _find_places(
    person: Any, times: Array, s: Any, as_predicted: bool
) -> tuple[Array, Array]:
    """Where a `person` is at these `times`, shape (n, 2), and by how much the zone has grown, (n,) [m]."""
    steady = person.position + np.outer(times, person.velocity)
    if person.prediction is None or not as_predicted:
        return steady, np.zeros(len(steady))
    samples = person.prediction.sample(person, s.times).T
    dx, dy, growth = (np.interp(times, s.times, each) for each in samples)
    return steady + np.column_stack([dx, dy]), growth


def _measure_zone(offset: Array, heading: float, zone: Ellipse) -> Array:
    """Focal distance to a zone of a person at these offsets of the robot (paper, eq. 7)."""
    # complex numbers: the robot, seen along the zone's major axis from its centre
    seen = (offset @ (1, 1j) * np.exp(-1j * heading) - complex(*zone.center)) * np.exp(
        -1j * zone.angle
    )
    a, b = zone.semi_axes
    focus = np.sqrt((a - b) * (a + b))
    return np.asarray((np.abs(seen - focus) + np.abs(seen + focus)) / 2 - a)


def _measure_wall(points: Array, wall: Wall, is_paper: bool) -> Array:
    """Euclidean distance to a wall, or the approximate one (paper, eq. 3-5)."""
    xa, ya, xb, yb = wall.numbers
    start = complex(xa, ya)
    along = complex(xb - xa, yb - ya)
    length = abs(along)
    # complex numbers: along the wall from its middle, and across
    seen = (points @ (1, 1j) - start) / (along / length) - length / 2
    if is_paper:
        beyond = np.maximum((np.abs(seen) ** 2 - length**2 / 4) / length, 0.0)
    else:
        beyond = np.maximum(np.abs(seen.real) - length / 2, 0.0)
    return np.asarray(np.hypot(seen.imag, beyond))

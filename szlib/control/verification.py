"""Other formulas for the same: Euclidean distances, and steps computed again.

The paper's distances compared with Euclidean ones, and the margin that makes them safe
----------------------------------------------------------------------------------------
A robot of radius r must stay r away from a wall or a zone, in Euclidean distance e. The barrier keeps
d >= r + eps instead, so eps is large enough where {e < r} lies inside {d < r + eps}:

    required margin = max of d over {e <= r}, less r

*Ellipse*: none. With p the nearest point on the ellipse, |x-c| <= |x-p| + |p-c| for both foci, so
d(x) <= e(x) + d(p) = e(x): the focal distance never over-estimates, for any eccentricity. Inside, the
same with x and p exchanged gives |d| <= |e|.

*Wall* of length L: r^2/L. Let the point at distance r from an end lie at the angle phi off the wall's
line. Its trimming term is r cos phi + r^2/L, so d^2 = r^2 + 2 (r^3/L) cos phi + r^4/L^2, which is
greatest straight ahead of the end: d = r + r^2/L. A point beside the wall, u <= L/2 from the end, has
the term (r^2 - u (L-u))/L at most, and is exact where that is negative.

So the controller gives each wall the margin it requires (`Wall.margin`). This costs at most 0.42 r of space,
beside a wall of L = 2 r. Around a pillar, L -> 0, {d < r + r^2/L} becomes the disc of radius r, and it costs
nothing.

Steps computed again
--------------------
`verify_step` uses formulas written anew from the paper, NumPy only, without the problem's code: distances,
barriers, rows, motion, bounds and overlaps are computed from the question (`Scene`) and the plan alone, and
compared with what the step claims. Kinds of obstacles that are not of szlib are measured by their own
formula.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

from ..core.checks import Array, check_array
from ..zones.ellipses import BODY_RADIUS, Ellipse
from .obstacles import (
    Wall,
    Zone,
    check_wall,
    ellipse_distance,
    euclidean_segment_formula,
    segment_distance,
)
from .settings import TOLERANCE

_BISECTIONS = 60  # halvings of a quarter turn that reach double precision


def euclidean_to_segment(points: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """Euclidean distance of `points`, shape (..., 2), to the segment from `a` to `b`, shape (...) [m].

    Examples
    --------
    >>> from szlib.control import euclidean_to_segment
    >>> euclidean_to_segment([(0.0, 0.5), (2.0, 0.0)], (-1.0, 0.0), (1.0, 0.0)).tolist()
    [0.5, 1.0]
    """
    xy = check_array("points", points, (..., 2))
    (xa, ya), (xb, yb) = check_wall([np.asarray(a), np.asarray(b)])
    return np.asarray(euclidean_segment_formula(xy[..., 0], xy[..., 1], xa, ya, xb, yb))


def euclidean_to_ellipse(points: ArrayLike, ellipse: Ellipse) -> Array:
    """Euclidean signed distance of points to an ellipse, negative inside, shape (...) [m].

    Parameters
    ----------
    points : positions, shape (..., 2) [m].
    ellipse : the zone.

    Notes
    -----
    For (p, q) in the first quadrant of the ellipse's frame the nearest point is (a cos t, b sin t), with t
    the root of half the derivative of the squared distance,

        a p sin t - b q cos t - (a^2 - b^2) sin t cos t.

    It is negative below this one root in the quadrant and positive above, so bisection finds it.

    Examples
    --------
    >>> import szlib
    >>> from szlib.control import euclidean_to_ellipse
    >>> ellipse = szlib.Ellipse((0.0, 0.0), (2.0, 1.0))
    >>> euclidean_to_ellipse([(3.0, 0.0), (0.0, 2.0)], ellipse).round(6).tolist()
    [1.0, 1.0]
    """
    offset = check_array("points", points, (..., 2)) - ellipse.center
    (a, b), cos, sin = ellipse.semi_axes, np.cos(ellipse.angle), np.sin(ellipse.angle)
    p = np.abs(offset[..., 0] * cos + offset[..., 1] * sin)
    q = np.abs(offset[..., 1] * cos - offset[..., 0] * sin)
    low, high = np.zeros_like(p), np.full_like(p, np.pi / 2)
    for _ in range(_BISECTIONS):
        t = (low + high) / 2
        below = (
            a * p * np.sin(t)
            - b * q * np.cos(t)
            - (a**2 - b**2) * np.sin(t) * np.cos(t)
            < 0
        )
        low, high = np.where(below, t, low), np.where(below, high, t)
    inside = (p / a) ** 2 + (q / b) ** 2 < 1
    return np.asarray(
        np.hypot(p - a * np.cos(low), q - b * np.sin(low)) * np.where(inside, -1, 1)
    )


def required_margin(of: Ellipse | ArrayLike, r_robot: float) -> float:
    """The smallest eps with which a robot never touches a zone or a wall [m].

    It is 0 for an ellipse, and r_robot^2 / L for a wall of length L; see the proof at the top of this module.

    Parameters
    ----------
    of : an ellipse, or the end points of a wall, shape (2, 2) [m].
    r_robot : radius of the robot [m].

    Examples
    --------
    >>> from szlib.control import required_margin
    >>> required_margin([(0.0, 0.0), (1.0, 0.0)], r_robot=0.5)
    0.25
    """
    if isinstance(of, Ellipse):
        return 0.0
    start, end = check_wall(of)
    return float(r_robot**2 / np.hypot(*(end - start)))


@dataclass(frozen=True)
class DistanceComparison:
    """The error of the approximate distance on the line h = 0.

    Attributes
    ----------
    nearest, farthest : smallest and largest Euclidean gap between the robot's disc and the zone or wall [m].
        `nearest` below 0 is a collision that the barrier calls safe; `farthest` above eps is wasted space.
    required : the margin with which `nearest` is 0 [m]; see `required_margin`.
    """

    nearest: float
    farthest: float
    required: float


def compare_distances(
    of: Ellipse | ArrayLike, *, r_robot: float, eps: float, n: int = 2001
) -> DistanceComparison:
    """Compare the approximate with the Euclidean distance on the line h = 0.

    Parameters
    ----------
    of : an ellipse, or the end points of a wall, shape (2, 2) [m].
    r_robot : radius of the robot [m].
    eps : margin [m].
    n : number of points on each arc.

    Examples
    --------
    >>> from szlib.control import compare_distances
    >>> round(compare_distances([(0.0, 0.0), (1.0, 0.0)], r_robot=0.5, eps=0.05).nearest, 2)  # they overlap
    -0.11
    """
    points = find_safe_boundary(of, r_robot + eps, n)
    # the approximate distance is r_robot + eps
    gap = eps - compute_distance_error(points, of)
    return DistanceComparison(
        float(gap.min()), float(gap.max()), required_margin(of, r_robot)
    )


def find_safe_boundary(
    of: Ellipse | ArrayLike, distance: float, n: int = 2001
) -> Array:
    """Find points where the approximate distance is `distance` > 0, shape (m, 2) [m].

    Parameters
    ----------
    of : an ellipse, or the end points of a wall, shape (2, 2) [m].
    distance : approximate distance of the points [m].
    n : number of points on each arc.

    Notes
    -----
    Around a zone it is the confocal ellipse of semi-major axis a + distance. Around a wall, in its own frame,
    y = distance sin psi and x^2 = L^2/4 + L distance cos psi - y^2, for each end and side.
    """
    if isinstance(of, Ellipse):
        (a, b), reach = of.semi_axes, of.semi_axes[0] + distance
        # a circle stays one, without rounding
        across = min(reach, float(np.sqrt(reach**2 - a**2 + b**2)))
        return replace(of, semi_axes=(reach, across), support=None).curve(n)
    start, end = check_wall(of)
    length, psi = float(np.hypot(*(end - start))), np.linspace(0, np.pi / 2, n)
    along = (end - start) / length
    y = distance * np.sin(psi)
    squared = length**2 / 4 + length * distance * np.cos(psi) - y**2
    x, y = np.sqrt(squared[squared >= 0]), y[squared >= 0]
    quarters = np.array(
        [(sx * x, sy * y) for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    )
    local = np.concatenate(
        [q.T if i % 2 == 0 else q.T[::-1] for i, q in enumerate(quarters)]
    )
    return np.asarray(
        (start + end) / 2 + local @ np.array([along, [-along[1], along[0]]])
    )


def compute_distance_error(points: ArrayLike, of: Ellipse | ArrayLike) -> Array:
    """Approximate minus Euclidean distance of `points` (..., 2) to `of` [m]: dangerous if positive."""
    if isinstance(of, Ellipse):
        return ellipse_distance(points, of) - euclidean_to_ellipse(points, of)
    ends = check_wall(of)
    return segment_distance(points, *ends) - euclidean_to_segment(points, *ends)


# Two computations of one number may differ by this much, relative to the largest number (at least 1).
ROUNDING = 1e-7
_SAMPLES = 17  # times within a step at which gaps are computed
AT_REST = 1e-3  # a slower robot rests [m/s]
# points of a way and their times, to those of another way
Carry = Callable[[Array, Array], tuple[Array, Array]]


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


@dataclass(frozen=True)
class Report:
    """What `Step.verify` found.

    Attributes
    ----------
    faults : each claim that is wrong, as a sentence; empty if all claims hold.
    differences : between the step's numbers and ours: of "motion" [m, m/s], "h" and "residual" [m], "slack".
    out_of_bounds : largest |ax| or |ay| of the plan beyond `a_max`, 0 if none [m/s2].
    worst : the row without a price that has the smallest value.
    slack : by how much `worst` is violated, 0 if it is not.
    h : smallest barrier in the state itself and after the control [m]; inf without any.
    gap : smallest Euclidean gap of the robot's disc to bodies and everything fixed, or h + eps of a person,
        at times from now until after the control [m].
    feasible, safe : as `Step.feasible` and `Step.safe`, by these numbers.
    """

    faults: tuple[str, ...]
    differences: dict[str, float]
    out_of_bounds: float
    worst: Row
    slack: float
    h: float
    gap: float
    feasible: bool
    safe: bool

    @property
    def ok(self) -> bool:
        """True if every claim of the step holds."""
        return not self.faults


def verify_step(step: Any, carried: Any = None, carry: Carry | None = None) -> Report:
    """Check the plan of a `step` (a `Step`), and its claims.

    Parameters
    ----------
    step : the step.
    carried, carry : scene and way of the disc, if the step is that of another point: see `_check_promises`.
    """
    scene, s, x = step.scene, step.scene.settings, np.asarray(step.predicted, float)
    lengths = np.array(s.grid or [1] * s.N)
    dt, times = s.dt * lengths[:, None], s.dt * np.r_[0, np.cumsum(lengths)]
    u = np.diff(x[:, 2:], axis=0) / dt
    ahead = x[:-1, :2] + dt * x[:-1, 2:] + dt**2 / 2 * u
    moved = np.vstack([scene.state, np.c_[ahead, x[1:, 2:]]])
    h = _measure_all(scene, x[:, :2], times, is_barrier=True)
    keep = (1 - s.gamma) ** lengths[: s.N_h]
    residual = h[:, 1 : s.N_h + 1] - keep * h[:, : s.N_h]
    t = np.linspace(0.0, s.dt, _SAMPLES)[:, None]
    path = x[0, :2] + t * x[0, 2:] + t**2 / 2 * step.control
    gap, min_h = find_gap(scene, path), float(h[:, :2].min(initial=np.inf))
    worst = min(_list_rows(scene, x, h, residual), key=lambda row: row.value)
    slack = max(0.0, -worst.value)
    feasible = slack <= TOLERANCE
    safe = feasible and not scene.tracked.unknown and min(min_h, gap) >= -TOLERANCE
    beyond = max(0.0, float(np.abs([*u, step.control]).max()) - s.a_max)
    size, scale = _scale(x), _scale(h)
    differences = {
        "motion": float(
            max(np.abs(moved - x).max(), s.dt * np.abs(u[0] - step.control).max())
        ),
        "h": _differ(h[:, 0], step.h[scene.rows]),
        "residual": _differ(residual, step.residual[scene.rows]),
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
    undecided |= is_undecided(scene, path, min(min_h, gap), step.safe)
    claims = step.feasible, step.safe
    if not undecided and (feasible, safe) != claims:
        faults.append(
            "the step says feasible {}, safe {}; found {}, {}".format(
                *claims, feasible, safe
            )
        )
    faults += _check_promises(step, carried or scene, carry)
    return Report(
        tuple(faults), differences, beyond, worst, slack, min_h, gap, feasible, safe
    )


def _check_promises(step: Any, scene: Any, carry: Carry | None = None) -> Iterator[str]:
    """What is wrong with `walls_safe` and `passively_safe` of a `step`, by many points of both ways.

    Parameters
    ----------
    step : a `Step`.
    scene : that of the disc, to which the claims belong.
    carry : the way of the disc from that of the point which is planned for; None: it is the same.
    """
    s, x = scene.settings, np.asarray(step.predicted, float)
    lengths = s.dt * np.array(s.grid or [1] * s.N)
    plan = list(zip(np.diff(x[:, 2:], axis=0) / lengths[:, None], lengths, strict=True))
    is_fixed = np.array([each.is_fixed for each in scene.barriers.items], bool)
    places = np.reshape([person.position for person in scene.people], (-1, 2))
    is_clear = list[bool]()
    for pieces in ([(step.control, s.dt)], plan):
        points, times = _sample(x[0], pieces, s)
        if carry:
            points, times = carry(points[:: _SAMPLES - 1], times[:: _SAMPLES - 1])
        gaps = _measure_all(scene, points, times, is_barrier=False, as_predicted=False)
        of_fixed, of_bodies = gaps[is_fixed], gaps[~is_fixed]
        if not is_clear and step.walls_safe and (of_fixed < -TOLERANCE).any():
            yield "the step says that it can stop before every wall; it cannot"
        free = of_bodies[of_bodies[:, 0] >= -TOLERANCE]
        rests = np.ptp(points, axis=0).max() <= AT_REST * s.dt
        overlapped = of_bodies[:, 0] < -TOLERANCE
        ends = points[:: _SAMPLES - 1] - points[0]
        nearer = ((places - points[0]) @ ends.T > TOLERANCE).any(axis=1)
        is_clear.append(
            bool(rests or ((free >= -TOLERANCE).all() and not nearer[overlapped].any()))
        )
    if step.passively_safe and not any(is_clear):
        yield "the step says that it rests before somebody walks into it; it does not"


def _sample(
    state: Array, pieces: Iterable[tuple[Array, float]], s: Any
) -> tuple[Array, Array]:
    """Points of a way, and their times: each control is held for its time, then the robot brakes."""
    points, times, todo = [state[None, :2]], [np.zeros(1)], deque(pieces)
    p, v = state[:2], state[2:]
    while todo or np.abs(v).max() > 1e-9:
        if not todo:
            stop = np.abs(v).max() / s.a_max
            lasts = s.dt * max(1.0, np.ceil(stop / s.dt / _SAMPLES))
            todo.append((-v / max(lasts, stop), lasts))
        control, lasts = todo.popleft()
        shares = lasts * np.linspace(0.0, 1.0, _SAMPLES)[1:, None]
        points.append(p + shares * v + shares**2 / 2 * control)
        times.append(times[-1][-1] + shares[:, 0])
        p, v = points[-1][-1], v + lasts * control
    return np.concatenate(points), np.concatenate(times)


def _scale(numbers: Array) -> float:
    return max(1.0, float(np.abs(numbers).max(initial=0.0)))


def _differ(found: Array, claimed: Array) -> float:
    return float(np.abs(found - claimed).max(initial=0.0))


def is_undecided(scene: Any, path: Array, worst: float, claimed: bool) -> bool:
    """True if rounding decides whether the step is safe, or a loose bound may say (`claimed`) unsafe.

    Parameters
    ----------
    scene, path : what the step was asked, and where the robot goes.
    worst : the smallest number found [m].
    claimed : what the step says.
    """
    speed = max(
        [float(np.hypot(*person.velocity)) for person in scene.people], default=0.0
    )
    reach = scene.settings.dt * speed + 2 * np.abs(path - path[0]).sum(axis=1).max()
    is_rounded = abs(worst + TOLERANCE) <= ROUNDING * _scale(path)
    return bool(is_rounded or (not claimed and worst <= reach))


def find_gap(scene: Any, path: Array) -> float:
    """Smallest gap on the `path` of a step, shape (n, 2), as of `Report.gap`, in this `scene` [m].

    -inf inside of a solid wall.
    """
    solids = scene.solids
    if solids is not None and solids.distance(shapely.Point(path[0])) == 0:
        return -np.inf
    times = np.linspace(0.0, scene.settings.dt, len(path))
    gaps = _measure_all(scene, path, times, is_barrier=False)
    h = _measure_all(scene, path, times, is_barrier=True)[: len(scene.people)]
    least = min(gaps.min(initial=np.inf), (h + scene.settings.eps).min(initial=np.inf))
    return float(least)


def _list_rows(scene: Any, x: Array, h: Array, residual: Array) -> list[Row]:
    """Every row without a price."""
    s, items = scene.settings, scene.barriers.items
    lengths = np.array(s.grid or [1] * s.N)
    hard = dict[str, tuple[str, Array]]()
    names = [scene.name(i) for i in scene.rows]
    for i, each in enumerate(items):
        if not each.has_barrier:
            hard[names[i]] = each.kind, h[i, 1:]
        elif s.decay_price == np.inf:
            hard[names[i]] = each.kind, residual[i]
        elif each.is_fixed:
            gamma = min(1.0, s.a_max * s.dt / s.v_max)
            hard[names[i]] = each.kind, h[i, 1:] - (1 - gamma) ** lengths * h[i, :-1]
        elif s.zone_price == np.inf:
            hard[names[i]] = each.kind, h[i, 1 : s.N_h + 1]
    if s.decay_price < np.inf:
        for i, person in enumerate(scene.people):
            places, _ = _find_places(person, np.array(s.times), s, True)
            away = np.hypot(*(x[:, :2] - places).T)[1:]
            gap = away - BODY_RADIUS - s.r_robot - s.body_gap
            hard[f"the body of {names[i]}"] = "body", gap
    rows = [
        Row(kind, f"the condition of {name} from k = {k} to {k + 1}", float(value))
        for name, (kind, values) in hard.items()
        for k, value in enumerate(values)
    ]
    speed = s.v_max**2 - (x[1:, 2:] ** 2).sum(axis=1)
    rows += [
        Row("speed", f"the speed limit at k = {k + 1}", float(value))
        for k, value in enumerate(speed)
    ]
    if s.terminal == "rest":
        rows.append(Row("end", "rest at the end", -float(np.abs(x[-1, 2:]).max())))
    return rows


def _measure_all(
    scene: Any,
    points: Array,
    times: Array,
    *,
    is_barrier: bool,
    as_predicted: bool = True,
) -> Array:
    """h, or Euclidean gaps of the disc, of each obstacle at points and times from now, shape (n, k) [m].

    People keep their velocity, or move `as_predicted`.
    """
    s, found = scene.settings, list[Array]()
    for i, each in enumerate(scene.barriers.items):
        if isinstance(each, Zone):
            person, zone = scene.people[i], scene.person_zones[i]
            center, growth = _find_places(person, times, s, as_predicted)
            measured = np.hypot(*(points - center).T) - BODY_RADIUS
            if is_barrier:
                offset, heading = points - center, person.heading or 0.0
                measured = _measure_zone(offset, heading, zone) - growth
        elif isinstance(each, Wall):
            measured = (_measure_wall if is_barrier else _measure_segment)(points, each)
        else:
            measure = each.distance if is_barrier else each.gap
            measured = np.array(
                [
                    measure(*p, t, *each.numbers)
                    for p, t in zip(points, times, strict=True)
                ]
            )
        margin = each.margin(s) if is_barrier else 0.0
        found.append(measured - s.r_robot - margin)
    return np.reshape(found, (-1, len(points)))


def _find_places(
    person: Any, times: Array, s: Any, as_predicted: bool
) -> tuple[Array, Array]:
    """Where a `person` is at these `times`, shape (n, 2), and by how much the zone has grown, (n,) [m]."""
    steady = person.position + np.outer(times, person.velocity)
    if person.prediction is None or not as_predicted:
        return steady, np.zeros(len(steady))
    samples = person.prediction.sample(person, np.array(s.times)).T
    dx, dy, growth = (np.interp(times, s.times, each) for each in samples)
    return steady + np.column_stack([dx, dy]), growth


def _measure_zone(offset: Array, heading: float, zone: Ellipse) -> Array:
    """Focal distance to a zone of a person at these offsets of the robot (paper, eq. 7)."""
    c, n, tilt = np.cos(heading), np.sin(heading), heading + zone.angle
    offset = offset - np.array([[c, -n], [n, c]]) @ np.array(zone.center)
    along = offset @ (np.cos(tilt), np.sin(tilt))
    across = offset @ (-np.sin(tilt), np.cos(tilt))
    (a, b) = zone.semi_axes
    f = np.sqrt((a - b) * (a + b))
    return np.asarray(
        (np.hypot(along - f, across) + np.hypot(along + f, across)) / 2 - a
    )


def _measure_wall(points: Array, wall: Wall) -> Array:
    """Approximate distance to a wall (paper, eq. 3-5)."""
    start, end = np.reshape(wall.numbers, (2, 2))
    length = np.hypot(*(end - start))
    (ux, uy), (px, py) = (end - start) / length, (points - (start + end) / 2).T
    t = length / 4 - (px**2 + py**2) / length
    return np.asarray(np.hypot(px * uy - py * ux, np.minimum(t, 0.0)))


def _measure_segment(points: Array, wall: Wall) -> Array:
    """Euclidean distance to a wall, by a clamped projection."""
    start, end = np.reshape(wall.numbers, (2, 2))
    along = (points - start) @ (end - start) / ((end - start) ** 2).sum()
    nearest = start + np.clip(along, 0.0, 1.0)[:, None] * (end - start)
    return np.asarray(np.hypot(*(points - nearest).T))

"""What a step is asked, what the controller decided, and how far that can be relied upon: `Scene`, `Step`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import dist, hypot, inf
from typing import Literal, NamedTuple, get_args

import numpy as np
import shapely

from ..core.checks import Array
from ..zones.ellipses import Ellipse
from .obstacles import Obstacle, Obstacles, Path, Priority, find_bodies
from .people import Person, TrackedPeople
from .problem import build_horizon, list_conditions
from .settings import TOLERANCE, MPCSettings
from .verification import Report, Row, verify_step
from .ways import Way, blocks

Status = Literal["optimal", "relaxed", "restarted", "braking"]
STATUSES: tuple[Status, ...] = get_args(Status)
"""How a control was found; see `Step.status`."""
HOLDS = (
    2e-3  # a barrier condition whose residual is smaller than this holds the robot [m]
)
_MEANING: dict[Status, str] = {
    "optimal": "optimal, every row without a price holds",
    "relaxed": "relaxed by priorities: walls, bodies, zones, decay",
    "restarted": "relaxed by priorities, from full braking",
    "braking": "full braking",
}


class Scene(NamedTuple):
    """What a step is asked [m, m/s].

    Attributes
    ----------
    state : (x, y, vx, vy) of the robot.
    goal : (x, y).
    tracked : people to be respected, as the tracker knows them.
    person_zones : the zone of each person, in their own frame.
    zones : zones of people in the world.
    fixed : walls, and whatever else the controller was given.
    near_fixed : what can matter of them to this step.
    settings : parameters of the controller.
    solids : areas that walls enclose, of Shapely; None: there are none.
    near : places of `near_fixed` in `fixed`; None: all. Of many obstacles those out of reach are left out
        (`Obstacles.find_near`), and what a step says of them is inf.
    """

    state: tuple[float, ...]
    goal: tuple[float, float]
    tracked: TrackedPeople
    person_zones: tuple[Ellipse, ...]
    zones: Obstacles
    fixed: Obstacles
    near_fixed: Obstacles
    settings: MPCSettings
    solids: object = None
    near: tuple[int, ...] | None = None

    @property
    def people(self) -> tuple[Person, ...]:
        """Everybody to be respected, in the order of `Step.obstacles`."""
        return self.tracked.people

    @property
    def barriers(self) -> Obstacles:
        """What has barriers and can matter: zones, then what is fixed near by."""
        return self.zones.joined(self.near_fixed)

    @property
    def bodies(self) -> Obstacles:
        """The bodies of people."""
        return find_bodies(self.zones, self.settings)

    @property
    def goal_blocked(self) -> bool:
        """True if h < 0 at the goal, because of something fixed or of a person who stands there."""
        zones = (zone.numbers for zone in self.zones.items)
        stands = any(blocks(zone, self.goal, self.settings) for zone in zones)
        return stands or bool((self.fixed.h(*self.goal) < 0).any())

    @property
    def is_in_solid(self) -> bool:
        """True if the robot's centre lies inside of a solid wall."""
        solids = self.solids
        return solids is not None and bool(shapely.contains_xy(solids, *self.state[:2]))

    @property
    def rows(self) -> list[int]:
        """Places of `barriers` among all obstacles of `Step.h`."""
        n = len(self.people)
        near = range(self.fixed.size) if self.near is None else self.near
        return [*range(n), *(n + i for i in near)]

    def spread(self, rows: Array) -> Array:
        """Rows of all obstacles from `rows` of those near; inf for the others."""
        if self.near is None:
            return rows
        n = len(self.people) + self.fixed.size
        spread = np.full((n, *rows.shape[1:]), inf)
        spread[self.rows] = rows
        return spread

    def name(self, i: int) -> str:
        """Name of the obstacle `i` of `Step.obstacles`, such as "wall 0 (0, 0, 5, 0)"."""
        if i < len(self.people):
            known = self.people[i].id
            return f"person {i}" + ("" if known is None else f" (id {known!r})")
        number = i - len(self.people)
        kinds = [each.kind for each in self.fixed.items]
        same = kinds[:number].count(kinds[number])
        numbers = ", ".join(f"{each:g}" for each in self.fixed.items[number].numbers)
        return f"{kinds[number]} {same} ({numbers})"

    def bound_gap(self, path: Path) -> float:
        """Lower bound of the gaps to bodies and everything fixed, and of h + eps of people, on a `path`.

        -inf inside of a solid wall. h has the allowance eps: it is for what a way cuts off a round zone.
        """
        if self.is_in_solid:
            return -inf
        gaps, _ = self.barriers.bound(path)
        h, _ = self.zones.bound(path, is_barrier=True)
        least = min(gaps.min(initial=inf), h.min(initial=inf) + self.settings.eps)
        return float(least)


@dataclass(frozen=True, repr=False)
class Step:
    """What the controller decided, and how far it can be relied upon.

    Attributes
    ----------
    control : acceleration (ax, ay) to apply now, within its bounds, shape (2,) [m/s2].
    inputs : accelerations of the plan, shape (N, 2) [m/s2].
    status : "optimal": the plan satisfies every row without a price. "relaxed": it violates the least, by
        priorities. "restarted": the same, found from full braking instead of from the last plan. "braking":
        full braking, because it is safer than the plan, or there is none.
    walls_safe : True if the robot, which holds the control for dt and then brakes as hard as it can, touches
        nothing fixed. A robot that was walls_safe once stays so, whatever people do: see `szlib.control.mpc`.
    passively_safe : True if, besides, it overlaps no body while it moves, if people keep their velocity: if
        it brakes after dt, or if it follows the plan to its end and brakes there. It does not move towards a
        body that it overlaps already, by more than the curve of its way within a step.
    target : point that attracts the plan, shape (2,) [m]: the goal, or the point ahead on the route, except
        where the robot meets a person head-on.
    solve_time : wall-clock time of the whole step [s].
    timed_out : True if the plan was cut short because time was up (`MPCSettings.time_limit` or `deadline`).
    scene : what the step was asked.
    way_length : length of the way to the goal [m]: of the route, else straight; inf if there is none.
    ways : ways to the goal, the one that is taken first; empty where none was looked for (`lookahead`).
    stuck : time for which the robot has come no nearer to its goal, from 5 s on; 0 before, while it
        approaches, and at the goal [s].
    clock : what is wrong with the times given to `MPCCBF.step`, in a sentence; "" if nothing is.

    Examples
    --------
    >>> import szlib
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> person = szlib.Person((0.0, 0.3), (-0.5, 0.0))
    >>> step = controller.step(state=(-4.0, 0.0, 0.0, 0.0), goal=(4.0, 0.0), people=[person])
    >>> step.status, step.safe, step.walls_safe, step.passively_safe
    ('optimal', True, True, True)
    >>> step.verify().ok
    True
    >>> print(step.explain().splitlines()[0])
    Step: optimal, every row without a price holds; safe
    """

    control: Array
    inputs: Array
    status: Status
    walls_safe: bool
    passively_safe: bool
    target: Array
    solve_time: float
    timed_out: bool
    scene: Scene
    way_length: float = 0.0
    ways: tuple[Way, ...] = ()
    stuck: float = 0.0
    clock: str = ""

    @cached_property
    def predicted(self) -> Array:
        """States x_0 .. x_N of the plan, shape (N+1, 4) [m, m/s]."""
        horizon = build_horizon(self.scene.settings)
        return horizon.states(np.array(self.scene.state), self.inputs)

    @property
    def way(self) -> str:
        """The way that is taken in words, such as "left of person 3, behind person 5"; "" without ways."""
        return self.ways[0].name if self.ways else ""

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What `h` belongs to: the `Zone` of each person, then everything fixed."""
        return self.scene.zones.items + self.scene.fixed.items

    @cached_property
    def h(self) -> Array:
        """Barriers in the state itself, shape (obstacles,) [m].

        Where one is negative, the robot already is where it should not be, and the plan leads out again.
        Obstacles out of reach have inf here, in `residual` and in `clearance`: see `Scene`.
        """
        return self.scene.spread(self.scene.barriers.h(*self.scene.state[:2]))

    @cached_property
    def _h_of_plan(self) -> Array:
        """h of each near obstacle at each state of the plan."""
        x, y, *_ = self.predicted.T
        return self.scene.barriers.h(x, y, np.array(self.scene.settings.times))

    @property
    def residual(self) -> Array:
        """h_{k+1} - (1-gamma)^m h_k for each step of m dt, shape (obstacles, N_h) [m]."""
        s, h = self.scene.settings, self._h_of_plan
        keep = (1 - s.gamma) ** np.array(s.step_lengths[: s.N_h], float)
        return self.scene.spread(h[:, 1 : s.N_h + 1] - keep * h[:, : s.N_h])

    @cached_property
    def violations(self) -> dict[Priority, float]:
        """Largest violation by the plan of the conditions of each `Priority` [m]: see `control.planner`."""
        return self._find_violations(has_floors=True)

    def _find_violations(self, has_floors: bool) -> dict[Priority, float]:
        """As `violations`, with or without floors."""
        scene, s = self.scene, self.scene.settings
        worst, found = dict.fromkeys(Priority, 0.0), [(scene.barriers, self._h_of_plan)]
        if has_floors:
            x, y, *_ = self.predicted.T
            bodies = find_bodies(scene.zones, s, as_predicted=True)
            found.append((bodies, bodies.h(x, y, np.array(s.times))))
        for obstacles, h in found:
            kinds = (kind for kind, *_, offsets in obstacles.groups for _ in offsets)
            for kind, own in zip(kinds, h, strict=True):
                for level, keep in list_conditions(s, kind, has_floors):
                    left = own[1 : len(keep) + 1] - np.array(keep) * own[: len(keep)]
                    worst[level] = max(worst[level], -float(left.min()))
        return worst

    @cached_property
    def slack(self) -> float:
        """Largest violation of a row without a price, 0 if none [m for barriers, m2/s2 for the speed].

        Also of rest at the end, if the plan must end there [m/s].
        """
        s, velocity = self.scene.settings, self.predicted[:, 2:]
        worst = self._find_violations(has_floors=s.decay_price < inf)
        for level, price in (
            (Priority.ZONE, s.zone_price),
            (Priority.DECAY, s.decay_price),
        ):
            if price < inf:
                del worst[level]
        found = [*worst.values()]
        found.append(float((velocity[1:] ** 2).sum(axis=1).max()) - s.v_max**2)
        if s.terminal == "rest":
            found.append(float(np.abs(velocity[-1]).max()))
        return max(0.0, *found)

    @property
    def feasible(self) -> bool:
        """True if the plan satisfies every row without a price; else see `slack`."""
        return self.slack <= TOLERANCE

    @property
    def goal_blocked(self) -> bool:
        """True if the goal cannot be reached: h < 0 there, or no way leads there.

        A person slower than `people.STANDING_SPEED` counts as standing. The robot waits beside them; without
        a way it goes to the nearest point that it can reach.
        """
        return self.scene.goal_blocked or self.way_length == inf

    @property
    def rejected(self) -> int:
        """Number of people whose measurement cannot be used; see `MPCCBF.step`."""
        return self.scene.tracked.rejected

    @property
    def unknown(self) -> int:
        """Number of rejected people of whom no earlier measurement is known; the robot then brakes."""
        return self.scene.tracked.unknown

    @property
    def clearance(self) -> Array:
        """Euclidean gaps from the robot's disc to bodies (of `BODY_RADIUS`) and everything fixed [m].

        Shape (obstacles, N+1): now, and at each state of the plan, with people who keep their velocity.
        Negative is an overlap.
        """
        x, y, *_ = self.predicted.T
        times = np.array(self.scene.settings.times)
        return self.scene.spread(self.scene.barriers.gaps(x, y, times))

    @property
    def safe(self) -> bool:
        """True if this step keeps the robot safe from walls, and from people who keep their velocity.

        That is: no person is unknown (see `MPCCBF.step`); the plan satisfies every row without a price;
        h >= 0 now and after the control; and the robot's disc overlaps no body and no wall, by Euclidean
        distance, and enters no zone by more than eps, from now until after the control, between samples too.
        People who turn, stop or speed up within a step may still cause h < 0 after a safe step; the next step
        then says so. What holds beyond this step says `passively_safe`.
        """
        return not self._find_danger()

    def _find_danger(self) -> str:
        """Why this step is not safe; "" if it is."""
        if self.unknown:
            return "the position of a person is unknown, so the robot comes to rest"
        if self.scene.is_in_solid:
            return "the robot is inside of a solid wall"
        if (self.h < -TOLERANCE).any():
            return f"the robot is already too close to {self.scene.name(int(np.argmin(self.h)))}"
        if not self.feasible:
            return "its plan is not feasible"
        after = self.scene.spread(self._h_of_plan[:, 1])
        if (after < -TOLERANCE).any():
            return f"it comes too close to {self.scene.name(int(np.argmin(after)))}"
        dt = self.scene.settings.dt
        bow = hypot(*self.control.tolist()) * dt**2 / 8
        path = Path(self.predicted[:2, :2], np.array([0.0, dt]), *np.full((2, 1), bow))
        is_clear = self.scene.bound_gap(path) >= -TOLERANCE
        return "" if is_clear else "its disc overlaps a body or a wall"

    def verify(self) -> Report:
        """Check this step again, by formulas that share no code with the controller."""
        return verify_step(self)

    def __repr__(self) -> str:
        ax, ay = self.control.tolist()
        safe, h = "safe" if self.safe else "not safe", min(self.h.tolist(), default=inf)
        return f"Step({self.status}, {safe}, control=({ax:.3g}, {ay:.3g}) m/s2, min h={h:.3g} m)"

    def explain(self) -> str:
        """Explain the step in sentences, after it is verified: what happened, and what would help."""
        scene, (ax, ay) = self.scene, self.control.tolist()
        report, danger = self.verify(), self._find_danger()
        verdict = f"not safe: {danger}" if danger else "safe"
        lines = [
            f"Step: {_MEANING[self.status]}; {verdict}",
            f"  control ({ax:.3g}, {ay:.3g}) m/s2 after {1e3 * self.solve_time:.2g} ms",
        ]
        if len(self.h):
            i = int(np.argmin(self.h))
            lines.append(f"  nearest is {scene.name(i)}: h = {self.h[i]:.3g} m")
        if self.ways:
            lines.append(f"  way: {self.way}")
            lines += [f"  not: {self._explain_other(way)}" for way in self.ways[1:]]
        if not self.feasible:
            lines.append(
                f"  the plan violates {report.worst.name} by {report.slack:.2g}"
            )
            lines.append(f"  what helps: {self._advise(report.worst)}")
        lines += self._list_notes()
        return "\n".join(lines + [f"  WRONG: {fault}" for fault in report.faults])

    def _list_notes(self) -> list[str]:
        """What else has to be known, and what would help."""
        scene, s, notes = self.scene, self.scene.settings, list[str]()
        if s.decay_price < inf and self.violations[Priority.DECAY] > TOLERANCE:
            worst = scene.name(int(self.residual.min(axis=1).argmin()))
            notes.append(
                f"h of {worst} falls faster than gamma = {s.gamma:g}, at its price; what helps: "
                f"a decay_price above {s.decay_price:g}"
            )
        if s.zone_price < inf and self.violations[Priority.ZONE] > TOLERANCE:
            notes.append(
                f"it enters a zone by {self.violations[Priority.ZONE]:.2g} m, at its price; what helps: "
                f"a zone_price above {s.zone_price:g}"
            )
        if not self.walls_safe:
            notes.append("it cannot stop before a wall; what helps: start slower")
        if not self.passively_safe:
            notes.append(
                "somebody may walk into it before it rests; what helps: a larger body_gap or a lower v_max"
            )
        if self.timed_out:
            notes.append(
                f"time was up after {min(s.time_limit, s.deadline)} s; what helps: a larger one"
            )
        if self.scene.goal_blocked:
            notes.append(
                f"the goal {scene.goal} cannot be reached, h < 0 there, so the robot waits beside it; what "
                "helps: another goal"
            )
        if self.way_length == inf:
            notes.append(
                "walls leave no way to the goal, so the robot goes to the nearest point that it can "
                "reach; what helps: another goal"
            )
        if self.rejected:
            notes.append(
                f"{self.rejected} measurements of people were rejected; {self.unknown} are unknown"
            )
        if self.stuck:
            notes.append(f"no progress for {self.stuck:.1f} s, {self._explain_stuck()}")
        return [f"  {note}" for note in [*notes, self.clock] if note]

    def _explain_other(self, way: Way) -> str:
        """Why another way is not taken."""
        more = way.cost - self.ways[0].cost
        if more >= 0:
            return f"{way.name}, which costs {more:.1f} s more"
        return f"{way.name}, which is only {-more:.1f} s cheaper than the way that it is on"

    def _explain_stuck(self) -> str:
        """How far the goal is, and what holds the robot: the barriers that are at their limit."""
        holding = np.flatnonzero(self.residual.min(axis=1, initial=inf) <= HOLDS)
        names = " and ".join(self.scene.name(i) for i in holding.tolist())
        s, away = self.scene.settings, dist(self.scene.state[:2], self.scene.goal)
        helps = "another goal or a route" if s.decay_price < inf else "among_people()"
        return f"{away:.1f} m from the goal; held by {names or 'nothing'}; what helps: {helps}"

    def _advise(self, row: Row) -> str:
        s = self.scene.settings
        if (self.h < -TOLERANCE).any():
            return "nothing now, because the robot is already too close; the plan leads out again"
        if row.kind == "speed":
            return f"start at v_max = {s.v_max:g} m/s or slower, or raise v_max"
        if row.kind == "end":
            return f"more than N = {s.N} steps, an a_max above {s.a_max:g}, or a v_max below {s.v_max:g}"
        longer = f"an N_h above {s.N_h}" if s.N_h < s.N else f"an N above {s.N}"
        return f"brake earlier: a gamma below {s.gamma:g}, {longer}, or a v_max below {s.v_max:g}"

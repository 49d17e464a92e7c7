"""What a step is asked, what the controller decided, and how far that can be relied upon: `Scene`, `Step`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import dist, hypot, inf
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np
import shapely

from ..core.checks import Array
from ..zones.ellipses import Ellipse
from .obstacles import Obstacle, Obstacles, Path, Priority, find_bodies
from .people import STANDING_SPEED, Person, TrackedPeople
from .problem import build_horizon
from .settings import TOLERANCE, MPCSettings
from .verification import Report, Row, Rows, Sampled, list_rows, verify_step
from .ways import Way

Status = Literal["optimal", "relaxed", "restarted", "kept", "braking"]
STATUSES: tuple[Status, ...] = get_args(Status)
"""How a control was found; see `Step.status`."""
# A barrier condition whose residual is smaller than this holds the robot [m].
HOLDS = 2e-3
_MEANING: dict[Status, str] = {
    "optimal": "optimal, every row without a price holds",
    "relaxed": "relaxed by priorities: walls, bodies, zones, decay",
    "restarted": "relaxed by priorities, from full braking",
    "kept": "the rest of the last plan, which is safe, as neither the new one nor braking is",
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
    settings : parameters of the controller.
    solids : areas that walls enclose, of Shapely; None: there are none.
    """

    state: tuple[float, ...]
    goal: tuple[float, float]
    tracked: TrackedPeople
    person_zones: tuple[Ellipse, ...]
    zones: Obstacles
    fixed: Obstacles
    settings: MPCSettings
    solids: object = None

    @property
    def people(self) -> tuple[Person, ...]:
        """Everybody to be respected, in the order of `Step.obstacles`."""
        return self.tracked.people

    @property
    def barriers(self) -> Obstacles:
        """What has barriers: zones, then what is fixed."""
        return self.zones.joined(self.fixed)

    def find_standing_h(self, x: Any, y: Any) -> Array:
        """Barriers at `x`, `y`, shape (obstacles, ...) [m]; inf for people who walk: they leave it free."""
        h = self.barriers.h(x, y)
        walk = [hypot(*each.velocity) >= STANDING_SPEED for each in self.people]
        h[: len(walk)][walk] = inf
        return h

    @property
    def goal_blocked(self) -> bool:
        """True if h < 0 at the goal, because of something fixed or of a person who stands; or in a solid."""
        return self.is_solid(*self.goal) or bool(
            (self.find_standing_h(*self.goal) < 0).any()
        )

    def is_solid(self, x: float, y: float) -> bool:
        """True if walls enclose the place (`x`, `y`) [m]."""
        return bool(shapely.contains_xy(self.solids, x, y))

    def name(self, i: int) -> str:
        """Name of the obstacle `i` of `Step.obstacles`, such as "wall 0 (0, 0, 5, 0)"."""
        n = len(self.people)
        if i < n:
            known = self.people[i].id
            return f"person {i}" + ("" if known is None else f" (id {known!r})")
        *before, own = self.fixed.items[: i - n + 1]
        same = sum(each.kind == own.kind for each in before)
        return f"{own.kind} {same}{repr(own).removeprefix(own.kind)}"


@dataclass(frozen=True, eq=False, repr=False)
class Step:
    """What the controller decided, and how far it can be relied upon.

    Attributes
    ----------
    control : acceleration (ax, ay) to apply now, within its bounds, shape (2,) [m/s2].
    inputs : accelerations of the plan, shape (N, 2) [m/s2].
    status : "optimal": the plan satisfies every row without a price. "relaxed": it violates the least, by
        priorities. "restarted": the same, found from full braking instead of from the last plan. "kept": the
        rest of the last plan, because only that is passively safe. "braking": full braking, because it is
        safer than the plan, or there is none.
    walls_safe : True if the robot, which holds the control for dt and then brakes as hard as it can, touches
        nothing fixed. A robot that was walls_safe once stays so, whatever people do: see `szlib.control.mpc`.
    passively_safe : True if, besides, it overlaps no body while it moves, if people keep their velocity: if
        it brakes after dt, or if it follows the plan to its end and brakes there. It does not move towards a
        body that it overlaps already, by more than the curve of its way within a step.
    target : point that attracts the plan, shape (2,) [m]: the goal, or the point ahead on the way, except
        where the robot meets a person head-on.
    solve_time : wall-clock time of the whole step [s].
    timed_out : True if the plan was cut short because time was up (`MPCSettings.time_limit` or `deadline`).
    scene : what the step was asked.
    of_point : what the plan was asked, if it is that of a point which is not the disc's centre.
    way_length : length of the way to the goal [m]; inf if there is none.
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
    of_point: Scene | None = None
    way_length: float = 0.0
    ways: tuple[Way, ...] = ()
    stuck: float = 0.0
    clock: str = ""
    _units: ClassVar[str] = "({:.3g}, {:.3g}) m/s2"

    @property
    def asked(self) -> Scene:
        """What the plan was asked."""
        return self.of_point or self.scene

    @cached_property
    def planned(self) -> Array:
        """States x_0 .. x_N of the plan, shape (N+1, 4) [m, m/s]."""
        return build_horizon(self.asked.settings).states(
            np.array(self.asked.state), self.inputs
        )

    @cached_property
    def predicted(self) -> Array:
        """(x, y, vx, vy) of the disc's centre now and along the plan, shape (N+1, 4) [m, m/s]."""
        return self.planned

    @property
    def path(self) -> Path:
        """Where the disc goes within this step."""
        dt = self.scene.settings.dt
        bows = np.full(1, self._sideways * dt**2 / 8)
        return Path(self.predicted[:2, :2], np.array([0.0, dt]), bows)

    @property
    def _sideways(self) -> float:
        """Largest acceleration away from a uniform motion within this step [m/s2]."""
        return hypot(*self.control.tolist())

    @property
    def way(self) -> str:
        """The way that is taken in words, such as "left of person 3, behind person 5"; "" without ways."""
        return self.ways[0].name if self.ways else ""

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What `h` belongs to: the `Zone` of each person, then everything fixed."""
        return self.scene.barriers.items

    @cached_property
    def h(self) -> Array:
        """Barriers in the state itself, shape (obstacles,) [m].

        Where one is negative, the robot already is where it should not be, and the plan leads out again.
        """
        return self.scene.barriers.h(*self.scene.state[:2])

    @property
    def residual(self) -> Array:
        """h_{k+1} - (1-gamma)^m h_k for each step of m dt of the plan, shape (obstacles, N_h) [m]."""
        s = self.asked.settings
        h = self._planned_h[:, : s.N_h + 1]
        return h[:, 1:] - (1 - s.gamma) ** np.array(s.step_lengths[: s.N_h]) * h[:, :-1]

    @cached_property
    def _planned_h(self) -> Array:
        """Barriers at the states of the plan, shape (obstacles, N+1) [m]."""
        x, y, *_ = self.planned.T
        return self.asked.barriers.h(x, y, self.asked.settings.times)

    @cached_property
    def _rows(self) -> list[Rows]:
        """The rows of every level at the states of the plan."""
        scene = self.asked
        s = scene.settings
        x, y, *_ = self.planned.T
        bodies = find_bodies(scene.zones, s, as_predicted=True).h(x, y, s.times)
        return list(list_rows(scene, self.planned, self._planned_h, bodies))

    @cached_property
    def violations(self) -> dict[Priority, float]:
        """Largest violation by the plan of the conditions of each `Priority` [m]: see `control.planner`."""
        worst = dict.fromkeys(Priority, 0.0)
        for level, _, _, values, _ in self._rows:
            if level is not None:
                worst[level] = max(worst[level], -float(values.min()))
        return worst

    @cached_property
    def slack(self) -> float:
        """Largest violation of a row without a price, 0 if none [m for barriers, m2/s2 for the speed].

        Also of rest at the end, if the plan must end there [m/s].
        """
        s = self.asked.settings
        return max(0.0, *(-float(r.values.min()) for r in self._rows if r.is_hard(s)))

    @property
    def feasible(self) -> bool:
        """True if the plan satisfies every row without a price; else see `slack`."""
        return self.slack <= TOLERANCE

    @property
    def goal_blocked(self) -> bool:
        """True if the goal cannot be reached: h < 0 there, or no way leads there.

        A person on the goal who is slower than `people.STANDING_SPEED` blocks it; the robot waits beside
        them. People on the way do not: they may leave (see `stuck`). Where walls leave no way, the robot goes
        to the nearest point that it can reach. Ways are looked for on a map of cells, on which a narrow door
        may be closed for a small robot although it fits: see `MPCSettings.lookahead`.
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

        Shape (obstacles, N+1): now, and at each state of the plan, with people who move as predicted, else
        keep their velocity. Negative is an overlap.
        """
        x, y, *_ = self.predicted.T
        return self.scene.barriers.gaps(x, y, self.scene.settings.times)

    @property
    def safe(self) -> bool:
        """True if this step keeps the robot safe from walls and people.

        That is, if people move as predicted, else keep their velocity: no person is unknown (see
        `MPCCBF.step`); the plan satisfies every row without a price; h >= 0 now and after the control; and
        the robot's disc overlaps no body and no wall, by Euclidean distance, and enters no zone by more than
        eps, from now until after the control, between samples too. People who turn, stop or speed up within a
        step may still cause h < 0 after a safe step; the next step then says so. What holds beyond this step
        says `passively_safe`.
        """
        return not self._find_danger()

    def _find_danger(self) -> str:
        """Why this step is not `safe`; "" if it is.

        h has the allowance eps on the way: it is for what a way cuts off a round zone.
        """
        scene = self.scene
        path = self.path
        barriers = scene.barriers
        if scene.tracked.unknown:
            return "the position of a person is unknown, so the robot comes to rest"
        if scene.is_solid(*path.points[0]):
            return "the robot is inside of a solid wall"
        x, y = path.points.T
        now, then = barriers.h(x, y, path.times).T
        if (now < -TOLERANCE).any():
            return f"the robot is already too close to {scene.name(int(now.argmin()))}"
        if not self.feasible:
            return "its plan is not feasible"
        if (then < -TOLERANCE).any():
            return f"it comes too close to {scene.name(int(then.argmin()))}; what helps: a larger eps"
        if not barriers.bound(path).is_safe:
            return "its disc may overlap a body or a wall; what helps: a larger eps or body_gap"
        h = scene.zones.bound(path, is_barrier=True).lower + scene.settings.eps
        if h < -TOLERANCE:
            return "it may enter a zone on its way; what helps: a larger eps"
        return ""

    def carry(self, way: Sampled) -> Sampled:
        """The `way` of the disc, from that of the point which is planned for; here it is the same."""
        return way

    def verify(self) -> Report:
        """Check this step again, by formulas that share no code with the controller."""
        return verify_step(self)

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({self.status}, {'safe' if self.safe else 'not safe'}, "
            f"control={self._units.format(*self.control)}, min h={self.h.min(initial=inf):.3g} m)"
        )

    def explain(self) -> str:
        """Explain the step in sentences, after it is verified: what happened, and what would help."""
        scene = self.scene
        report = self.verify()
        danger = self._find_danger()
        verdict = f"not safe: {danger}" if danger else "safe"
        lines = [
            f"Step: {_MEANING[self.status]}; {verdict}",
            f"  control {self._units.format(*self.control)} after {1e3 * self.solve_time:.2g} ms",
        ]
        if len(self.h):
            i = int(np.argmin(self.h))
            lines.append(f"  nearest is {scene.name(i)}: h = {self.h[i]:.3g} m")
        if self.ways:
            lines.append(f"  way: {self.way}")
            lines += [f"  not: {self._explain_other(way)}" for way in self.ways[1:]]
        if not self.feasible:
            lines += [
                f"  the plan violates {report.worst.name} by {report.slack:.2g}",
                f"  what helps: {self._advise(report.worst)}",
            ]
        elif (self.h < -TOLERANCE).any():
            lines.append("  what helps: nothing now, the plan leads out again")
        lines += self._list_notes()
        return "\n".join(lines + [f"  WRONG: {fault}" for fault in report.faults])

    def _list_notes(self) -> list[str]:
        """What else has to be known, and what would help."""
        scene = self.scene
        s = scene.settings
        worst = self.violations
        falls = self.residual.min(axis=1)
        slowest = scene.name(int(falls.argmin())) if len(falls) else ""
        notes = {
            f"h of {slowest} falls faster than gamma = {s.gamma:g}, at its price; what helps: a "
            f"decay_price above {s.decay_price:g}": s.decay_price < inf
            and worst[Priority.DECAY] > TOLERANCE,
            f"the plan enters a zone by {worst[Priority.ZONE]:.2g} m; what helps: "
            "zone_price=inf": s.zone_price < inf and worst[Priority.ZONE] > TOLERANCE,
            "it cannot stop before a wall, so it may not rest before people come either; what helps: start "
            "slower": not self.walls_safe,
            "somebody may walk into it before it rests; what helps: a larger body_gap or a lower "
            "v_max": self.walls_safe and not self.passively_safe,
            f"time was up after {min(s.time_limit, s.deadline)} s; what helps: a larger one": self.timed_out,
            f"the goal {scene.goal} cannot be reached, h < 0 there, so the robot waits beside it; what "
            "helps: another goal": scene.goal_blocked,
            "there is no way to the goal, so the robot goes to the nearest point that it can reach; what "
            "helps: another goal": self.way_length == inf,
            f"{self.rejected} measurements of people were rejected; {self.unknown} are unknown; what helps: "
            "finite numbers, and ids, by which people are remembered": self.rejected
            > 0,
            f"no progress for {self.stuck:.1f} s, {self._explain_stuck()}": self.stuck
            > 0,
            self.clock: bool(self.clock),
        }
        return [f"  {note}" for note, holds in notes.items() if holds]

    def _explain_other(self, way: Way) -> str:
        """Why another way is not taken."""
        taken = self.ways[0]
        more = way.cost - taken.cost
        if more >= 0:
            return f"{way.name}, which costs {more:.1f} s more"
        if taken.rank() < way.rank():
            return f"{way.name}, which is only {-more:.1f} s cheaper than the way that it is on"
        return f"{way.name}, whose plan would violate more"

    def _explain_stuck(self) -> str:
        """How far the goal is, and what holds the robot: the barriers that are at their limit."""
        holding = np.flatnonzero(self.residual.min(axis=1, initial=inf) <= HOLDS)
        names = [self.scene.name(i) for i in holding.tolist()]
        return (
            f"{dist(self.scene.state[:2], self.scene.goal):.1f} m from the goal; held by "
            f"{' and '.join(names) or 'nothing'}; what helps: "
            f"{'another goal' if self.scene.settings.decay_price < inf else 'among_people()'}"
        )

    def _advise(self, row: Row) -> str:
        s = self.scene.settings
        if (self.h < -TOLERANCE).any():
            return "nothing now: the robot is already too close, and the plan leads out where it can"
        if row.kind == "speed":
            return f"start at v_max = {s.v_max:g} m/s or slower, or raise v_max"
        if row.kind == "end":
            return f"more than N = {s.N} steps, an a_max above {s.a_max:g}, or a v_max below {s.v_max:g}"
        longer = f"an N_h above {s.N_h}" if s.N_h < s.N else f"an N above {s.N}"
        return f"brake earlier: a gamma below {s.gamma:g}, {longer}, or a v_max below {s.v_max:g}"

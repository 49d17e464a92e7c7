"""What the controller decided, and how far it can be relied upon: `Step`."""

from __future__ import annotations

from dataclasses import dataclass
from math import dist, hypot
from typing import Literal, cast, get_args

import numpy as np

from ..checks import Array
from .crowding import count_near
from .scene import Scene
from .settings import TOLERANCE, Crowding, Terminal
from .step_report import ProblemRow, StepReport, verify_plan

Fallback = Literal["warm", "cold", "kept", "relaxed", "braking"]
FALLBACKS: tuple[Fallback, ...] = get_args(Fallback)
"""The ways to a control, in the order in which they are tried: see `szlib.control.solvers.fallbacks`."""
HOLDS = (
    2e-3  # a barrier condition whose residual is smaller than this holds the robot [m]
)
Status = Literal["optimal", "kept", "relaxed", "braking"]
_MEANING = {
    "warm": "optimal, from the last plan",
    "cold": "optimal, from full braking",
    "kept": "the last plan, shifted, which ends at rest",
    "relaxed": "relaxed, with the smallest possible violation",
    "braking": "full braking, because no solver found a plan",
}


@dataclass(frozen=True, repr=False)
class Step:
    """What the controller decided, and how far it can be relied upon.

    Attributes
    ----------
    control : acceleration (ax, ay) to apply now, within its bounds, shape (2,) [m/s2].
    predicted : states x_0 .. x_N of the plan, shape (N+1, 4) [m, m/s].
    fallback : the way in which the plan was found; see `szlib.control.solvers.fallbacks`.
    slack : largest violation of a hard row by the plan, 0 if none [m for barriers, m2/s2 for speed,
        m/s for the terminal velocity].
    residual : h_{k+1} - (1-gamma)^m h_k for each step of m dt, people before walls, shape
        (people + walls, N_h) [m]. In a crowd, or among few, those of people may be negative: see `crowding`.
    h : barriers in the state itself, people before walls, shape (people + walls,) [m]. Where one is
        negative, the robot already is where it should not be, and the plan leads out again. Of more than 24
        walls, those out of reach of the plan have inf here, in `residual` and in `clearance`: see `Scene`.
    target : point that attracts the plan, shape (2,) [m]: the goal, or the point ahead on the route, except
        where the robot meets a person head-on.
    cost : cost of the plan, without any penalty.
    solve_time : wall-clock time of the whole step [s].
    timed_out : True if a solver was stopped or skipped because time was up (`MPCSettings.time_limit` or
        `deadline`).
    scene : what the step was asked.
    way_length : length of the way to the goal [m]: of the route, else straight; inf if no route was found.
    stuck : time for which the robot has come no nearer to its goal, from 5 s on; 0 before, while it
        approaches, and at the goal [s].
    clock : what is wrong with the times given to `MPCCBF.step`, in a sentence; "" if nothing is.

    Examples
    --------
    >>> import szlib
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> person = szlib.Person((0.0, 0.3), (-0.5, 0.0))
    >>> step = controller.step(state=(-4.0, 0.0, 0.0, 0.0), goal=(4.0, 0.0), people=[person])
    >>> step.status, step.safe, step.control.shape
    ('optimal', True, (2,))
    >>> step.verify().ok
    True
    >>> print(step.explain().splitlines()[0])
    Step: optimal, from the last plan; safe
    """

    control: Array
    predicted: Array
    fallback: Fallback
    slack: float
    residual: Array
    h: Array
    target: Array
    cost: float
    solve_time: float
    timed_out: bool
    scene: Scene
    way_length: float = 0.0
    stuck: float = 0.0
    clock: str = ""

    @property
    def status(self) -> Status:
        """ "optimal": a solver converged and every hard row holds; else the fallback."""
        return status_of(self.fallback)

    @property
    def feasible(self) -> bool:
        """True if the plan satisfies the hard problem, whatever fallback it comes from; else see `slack`."""
        return self.slack <= TOLERANCE

    @property
    def goal_blocked(self) -> bool:
        """True if the goal cannot be reached, h < 0 there: because of a wall, or of a person who stands.

        A person slower than `person.STANDING_SPEED` counts as standing. The robot waits beside them.
        """
        return self.scene.goal_blocked

    @property
    def rejected(self) -> int:
        """Number of people whose measurement cannot be used; see `MPCCBF.step`."""
        return self.scene.tracked.rejected

    @property
    def unknown(self) -> int:
        """Number of rejected people of whom no earlier measurement is known; the robot then brakes."""
        return self.scene.tracked.unknown

    @property
    def terminal(self) -> Terminal:
        """What the plan ends in: see `Scene.terminal`."""
        return self.scene.terminal

    @property
    def clearance(self) -> Array:
        """Euclidean gaps from the robot's disc to bodies (of `BODY_RADIUS`) and walls [m].

        Shape (people + walls, N+1), people before walls: now, and at each state of the plan, with people who
        keep their velocity. Negative is an overlap.
        """
        states, times = self.predicted[:, :2].tolist(), self.scene.settings.times
        gaps = [
            self.scene.gaps(x, y, time)
            for (x, y), time in zip(states, times, strict=True)
        ]
        return self.scene.spread(np.reshape(np.array(gaps, float), (len(gaps), -1)).T)

    @property
    def safe(self) -> bool:
        """True if this step keeps the robot safe from walls, and from people who keep their velocity.

        That is: no person is unknown (see `MPCCBF.step`); the plan satisfies the hard problem, from a state
        that satisfies every barrier and lies in no solid wall; and the robot's disc overlaps no body and no
        wall, by Euclidean distance, and enters no zone by more than eps, from now until after the control,
        between samples too (`Scene.smallest_gap`). People who turn, stop or speed up within a step may still
        cause h < 0 after a safe step (notebook 23 counts them); the next step then says so.
        """
        return not self._find_danger()

    def _find_danger(self) -> str:
        """Why this step is not safe; "" if it is."""
        if self.unknown:
            return "the position of a person is unknown, so the robot comes to rest"
        if self.scene.is_in_solid:
            return "the robot is inside of a solid wall"
        if (self.h < -TOLERANCE).any():
            return f"the robot is already too close to {self._obstacle(int(np.argmin(self.h)))}"
        if not self.feasible:
            return "its plan is not feasible"
        if self.scene.level == "crowd" and min(self._h_after, default=0.0) < -TOLERANCE:
            return "it enters a zone, in a crowd"
        start, end = self.predicted[:2, :2].tolist()
        gap = self.scene.smallest_gap(start, end, hypot(*self.control.tolist()))
        return "" if gap >= -TOLERANCE else "its disc overlaps a body or a wall"

    @property
    def _h_after(self) -> list[float]:
        """h after the control [m]."""
        x, y = self.predicted[1, :2].tolist()
        return self.scene.h(x, y, self.scene.settings.dt)

    def verify(self) -> StepReport:
        """Check this step again, by formulas that share no code with the controller."""
        return verify_plan(self)

    def __repr__(self) -> str:
        ax, ay = self.control.tolist()
        safe, h = (
            "safe" if self.safe else "not safe",
            min(self.h.tolist(), default=np.inf),
        )
        return f"Step({self.fallback}, {safe}, control=({ax:.3g}, {ay:.3g}) m/s2, min h={h:.3g} m)"

    def explain(self) -> str:
        """Explain the step in sentences, after it is verified: what happened, and why no plan is feasible."""
        scene, s, (ax, ay) = self.scene, self.scene.settings, self.control.tolist()
        report, danger = self.verify(), self._find_danger()
        lines = [
            f"Step: {_MEANING[self.fallback]}; {f'not safe: {danger}' if danger else 'safe'}"
        ]
        lines.append(
            f"  control ({ax:.3g}, {ay:.3g}) m/s2 after {1e3 * self.solve_time:.2g} ms"
        )
        if len(self.h):
            i = int(np.argmin(self.h))
            lines.append(f"  nearest is {self._obstacle(i)}: h = {self.h[i]:.3g} m")
        if s.crowding and scene.level != "alone":
            lines.append(f"  {self._describe_crowd(s.crowding)}")
        if not self.feasible:
            lines.append(
                f"  the plan violates {self._name_row(report.worst)} by {report.slack:.2g}"
            )
            lines.append(f"  what helps: {self._advise(report.worst)}")
        if self.timed_out:
            limit = min(s.time_limit, s.deadline)
            lines.append(
                f"  time was up after {limit} s; what helps: a larger time_limit or deadline"
            )
        if self.goal_blocked:
            lines.append(
                f"  the goal {scene.goal} cannot be reached: h < 0 there; the robot waits beside it"
            )
        if self.way_length == np.inf:
            lines.append(
                "  walls leave no way to the goal; the plan heads straight for it"
            )
        if self.rejected:
            lines.append(
                f"  {self.rejected} measurements of people were rejected; {self.unknown} are unknown"
            )
        if self.stuck:
            lines.append(
                f"  no progress for {self.stuck:.1f} s, {self._explain_stuck()}"
            )
        lines += [f"  {self.clock}"] * bool(self.clock)
        return "\n".join(lines + [f"  WRONG: {fault}" for fault in report.faults])

    def _explain_stuck(self) -> str:
        """How far the goal is, and who and what holds the robot: the barriers that are at their limit."""
        holding = np.flatnonzero(self.residual.min(axis=1, initial=np.inf) <= HOLDS)
        names = (
            " and ".join(self._obstacle(i) for i in holding.tolist())
            or "no person and no wall"
        )
        return f"{dist(self.scene.state[:2], self.scene.goal):.1f} m from the goal; held by {names}"

    def _describe_crowd(self, crowding: Crowding) -> str:
        near = count_near(self.scene.state, self.scene.people, crowding.radius)
        meaning = "a fast decay of h has a price, h >= 0 is hard"
        if self.scene.level == "crowd":
            inside = sum(
                h < -TOLERANCE for h in self._h_after[: len(self.scene.people)]
            )
            meaning = (
                f"in a crowd; {inside} zones overlap here, keeps {crowding.gap:g} m"
            )
        return f"{near} people are within {crowding.radius:g} m: {meaning}"

    def _obstacle(self, i: int) -> str:
        """Name of the person or wall of row `i` of `h`."""
        kind, number = self.scene.obstacle(i)
        if kind == "wall":
            return "wall {} ({:g}, {:g})-({:g}, {:g})".format(
                number, *self.scene.walls[number][:4]
            )
        known = self.scene.people[i].id
        return f"{kind} {number}" + ("" if known is None else f" (id {known!r})")

    def _row_of_h(self, row: ProblemRow) -> int:
        return row.number + (len(self.scene.people) if row.kind == "wall" else 0)

    def _name_row(self, row: ProblemRow) -> str:
        if row.kind == "speed":
            return f"the speed limit at k = {row.k}"
        if row.kind == "end":
            return "the terminal velocity"
        if row.kind == "body":
            return f"the gap to the body of {self._obstacle(row.number)} at k = {row.k + 1}"
        return f"the barrier of {self._obstacle(self._row_of_h(row))} from k = {row.k} to {row.k + 1}"

    def _advise(self, row: ProblemRow) -> str:
        s = self.scene.settings
        if (
            row.kind in ("person", "body", "wall")
            and self.h[self._row_of_h(row)] < -TOLERANCE
        ):
            return "nothing now, because the robot is already too close; the plan leads out again"
        if row.kind == "speed":
            return f"start at v_max = {s.v_max:g} m/s or slower, or raise v_max"
        if row.kind == "end":
            return f"more than N = {s.N} steps, an a_max above {s.a_max:g}, or a v_max below {s.v_max:g}"
        longer = f"an N_h above {s.N_h}" if s.N_h < s.N else f"an N above {s.N}"
        return f"brake earlier: a gamma below {s.gamma:g}, {longer}, or a v_max below {s.v_max:g}"


def status_of(fallback: Fallback) -> Status:
    """Status of a plan by its `fallback`: see `Step.status`."""
    return "optimal" if fallback in ("warm", "cold") else cast(Status, fallback)

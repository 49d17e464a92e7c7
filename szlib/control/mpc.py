"""The controller: model predictive control with barriers around people and walls (MPC-CBF).

The problem stands in `problem`; it is solved by `sqp` or `ipopt`. Each step climbs
down a ladder until a rung holds:

    warm      the problem, from the last plan, shifted
    cold      the problem, from full braking
    kept      the last plan, shifted, if it still satisfies the problem        terminal condition only
    relaxed   the problem with penalised slack
    kept      the last plan, shifted, if it is a way to a safe end             terminal condition only
    braking   to rest as soon as the bounds allow

The terminal condition and what it is good for
----------------------------------------------
`terminal="rest"` (barriers on the whole horizon, v_N = 0). *Recursive feasibility*: let everybody
stand, h(x_0) >= 0, and let u_0 .. u_{N-1} satisfy the problem. One step later take u_1 .. u_{N-1}, 0.
Its states are x_1 .. x_N, x_N, for v_N = 0. Bounds, speed and the terminal condition hold, and so do
the barrier rows of the steps that both plans share. The new row is
h(x_N) - (1 - gamma) h(x_N) = gamma h(x_N), and the old rows give h(x_{k+1}) >= (1 - gamma) h(x_k), so
h(x_N) >= (1 - gamma)^N h(x_0) >= 0: it holds as well. So a robot that starts in the safe set with a
solution, at rest for instance (u = 0), has one for ever, and h >= 0 for ever.

*Passive safety*: if people walk as predicted, the new row may fail: they come closer while the robot
rests. Call a plan safe to its end if h >= 0 at all its states up to the one from which on it rests.
By the inequality above each solution is; and the shift of one that is, is one. So where the problem
has no solution, the ladder applies the relaxed plan only if it is safe to its end, and else the
last plan, shifted. Then at the first instant at which any h < 0 the robot is at rest: nobody is
hit by a moving robot.

`terminal="person"` (one person, walking at velocity w, |w| <= v_max, no wall; v_N = w). Seen from the
person both arguments are the first one: appending 0 keeps the robot at their pace, so
h(x_{N+1}, N+1) = h(x_N, N), and the problem is recursively feasible although they walk.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from ..errors import SolverError
from ..zones.ellipses import Ellipse
from .barriers import Array, barrier, check_wall, finite, segment_formula
from .head_on import subgoal
from .ipopt import Ipopt
from .people import Person, PlacedZone, SpeedZone, as_ellipse, place
from .problem import TOLERANCE, Numbers, ProblemSolver
from .settings import MPCSettings
from .sqp import Sqp

Rung = Literal["warm", "cold", "kept", "relaxed", "braking"]
RUNGS: tuple[Rung, ...] = get_args(Rung)
Status = Literal["optimal", "kept", "relaxed", "braking"]

_log = logging.getLogger("szlib")


@dataclass(frozen=True)
class Step:
    """What the controller decided, and how far it can be relied upon.

    Attributes
    ----------
    control : acceleration (ax, ay) to apply now, within its bounds, shape (2,) [m/s2].
    predicted : states x_0 .. x_N of the plan, shape (N+1, 4) [m, m/s].
    rung : the rung of the ladder that gave the plan; see `szlib.control.mpc`.
    slack : largest violation of a hard row by the plan, 0 if none [m for barriers, m2/s2 for speed,
        m/s for the terminal velocity].
    residual : h_{k+1} - (1-gamma) h_k, people before walls, shape (people + walls, N_h) [m].
    h : barriers in the state itself, people before walls, shape (people + walls,) [m]; where one is
        negative, the robot already is where it should not be, and the plan leads out again.
    target : where the plan is drawn to: the goal, but for a meeting head-on, shape (2,) [m].
    cost : the cost of the plan, without any penalty.
    solve_time : wall-clock time of the whole step [s].
    """

    control: Array
    predicted: Array
    rung: Rung
    slack: float
    residual: Array
    h: Array
    target: Array
    cost: float
    solve_time: float

    @property
    def status(self) -> Status:
        """ "optimal": a solver converged and every hard row holds; else the rung."""
        return status_of(self.rung)

    @property
    def feasible(self) -> bool:
        """True if the plan satisfies the hard problem, whatever rung it comes from; else see `slack`."""
        return self.slack <= TOLERANCE

    @property
    def safe(self) -> bool:
        """True if the plan satisfies the hard problem, from a state that satisfies every barrier."""
        return self.feasible and bool((self.h >= -TOLERANCE).all())


def status_of(rung: Rung) -> Status:
    """What a rung says of its plan: see `Step.status`."""
    return "optimal" if rung in ("warm", "cold") else cast(Status, rung)


class MPCCBF:
    """Drives a double integrator to a goal, outside the social zones of people and clear of walls.

    Parameters
    ----------
    zone : the social zone of a person, in the person's frame [m]; or anything with `.ellipse(speed)`,
        such as a `SocialZone`, which is asked for `settings.zone_speed`.
    walls : segments, shape (n, 2, 2): end points [m].
    settings : every other parameter.
    max_people : how many people to build for now. More make the controller grow once, which takes
        a moment and is logged by "szlib" (at level INFO).

    Raises
    ------
    SolverError : a wall is not finite or has no length, or settings and walls do not go together.
    ZoneError : `zone` is no zone.
    """

    def __init__(
        self,
        zone: Ellipse | SpeedZone,
        *,
        walls: ArrayLike | Sequence[ArrayLike] = (),
        settings: MPCSettings | None = None,
        max_people: int = 1,
    ) -> None:
        self.settings = settings or MPCSettings()
        self.zone = as_ellipse(zone, self.settings.zone_speed)
        ends = [check_wall(wall) for wall in cast(Sequence[ArrayLike], walls)]
        self.walls = np.reshape(np.array(ends, float), (-1, 2, 2))
        if self.settings.terminal == "person" and len(ends):
            raise SolverError(f"terminal='person' is for open space; got {len(ends)} walls; use 'rest'")
        if not isinstance(max_people, int) or max_people < 0:
            raise SolverError(f"max_people must be a whole number >= 0; got {max_people!r}")
        self._segments = [tuple(wall) for wall in self.walls.reshape(-1, 4).tolist()]
        self._solvers: list[ProblemSolver] = []
        self._build(max_people)
        self.reset()

    def _build(self, n_people: int) -> None:
        kind = Sqp if self.settings.solver == "sqp" else Ipopt
        for n in range(len(self._solvers), n_people + 1):
            self._solvers.append(kind(self.settings, n, len(self.walls)))

    def reset(self) -> None:
        """Forget the last plan and goal: what follows depends on nothing that went before."""
        self._plan = np.zeros(2 * self.settings.N)
        self._goal: tuple[float, float] | None = None
        for solver in self._solvers:
            solver.reset()

    def step(self, state: ArrayLike, goal: ArrayLike, people: Sequence[Person] = ()) -> Step:
        """The acceleration to apply for the next `dt`.

        A goal is checked when it is new; from then on a moving robot always gets a control.

        Parameters
        ----------
        state : (x, y, vx, vy) [m, m/s].
        goal : (x, y) [m].
        people : everybody to be respected now.

        Raises
        ------
        SolverError : a number is not finite, a shape is wrong, or a new goal cannot be reached,
            because it lies too close to a wall or in the zone of somebody who stands.
        """
        began = perf_counter()
        x = finite("state", state, (4,))
        gx, gy = finite("goal", goal, (2,)).tolist()
        if (gx, gy) != self._goal:
            self._check_goal((gx, gy), people)
            self._goal = (gx, gy)
        solver = self._solver(len(people))
        placed = [place(person, self.zone_of(person)) for person in people]
        target = subgoal((float(x[0]), float(x[1])), (gx, gy), placed, self.walls, self.settings)
        parameters = self._parameters(x, target, placed)

        rung, plan, numbers = self._solve_with_fallbacks(solver, parameters)
        self._plan = plan
        return Step(
            control=plan[:2].copy(),
            predicted=numbers.states,
            rung=rung,
            slack=numbers.slack,
            residual=numbers.rows[: solver.evaluate.n_cbf].reshape(-1, self.settings.N_h),
            h=numbers.h[:, 0],
            target=parameters[4:6],
            cost=numbers.cost,
            solve_time=perf_counter() - began,
        )

    def _solver(self, n_people: int) -> ProblemSolver:
        built = len(self._solvers) - 1
        if n_people > built:
            if self.settings.terminal == "person" and n_people > 1:
                raise SolverError(f"terminal='person' is for one person; got {n_people}; use 'rest'")
            _log.info("the controller was built for %d people and now grows to %d", built, n_people)
            self._build(n_people)
        return self._solvers[n_people]

    def _parameters(self, x: Array, target: tuple[float, float], placed: Sequence[PlacedZone]) -> Array:
        """The numbers of `Problem.parameters`."""
        pace = placed[0][5:] if self.settings.terminal == "person" and placed else (0.0, 0.0)
        numbers = [*x.tolist(), *target, *pace]
        for zone in placed:
            numbers += zone
        for segment in self._segments:
            numbers += segment
        return np.array(numbers)

    def _solve_with_fallbacks(self, solver: ProblemSolver, parameters: Array) -> tuple[Rung, Array, Numbers]:
        """The first rung that holds, its plan, and the plan's numbers."""
        ends = self.settings.terminal != "none"
        shifted = np.concatenate([self._plan[2:], (0.0, 0.0)])
        rung: Rung
        for rung in ("warm", "cold"):
            guess = shifted if rung == "warm" else self._brake(parameters[2:4])
            plan, converged = solver.hard(guess, parameters)
            if converged:
                numbers = solver.evaluate(plan, parameters)
                if numbers.slack <= TOLERANCE:
                    return rung, plan, numbers
        kept = solver.evaluate(shifted, parameters)
        if ends and kept.slack <= TOLERANCE:
            return "kept", shifted, kept
        safe_end = ends and _safe_to_its_end(kept, parameters)
        plan, converged = solver.relaxed(shifted, parameters)
        if converged and np.isfinite(plan).all():
            numbers = solver.evaluate(plan, parameters)
            if not safe_end or _safe_to_its_end(numbers, parameters):
                return ("warm" if numbers.slack <= TOLERANCE else "relaxed"), plan, numbers
        if safe_end:
            return "kept", shifted, kept
        plan = self._brake(parameters[2:4])
        return "braking", plan, solver.evaluate(plan, parameters)

    def _brake(self, velocity: Array) -> Array:
        """The inputs that bring the robot to rest soonest along its path, shape (2N,) [m/s2]."""
        s, (vx, vy) = self.settings, velocity.tolist()
        plan: list[float] = []
        for _ in range(s.N):
            time = max(s.dt, max(abs(vx), abs(vy)) / s.a_max)
            plan += (-vx / time, -vy / time)
            vx, vy = vx - s.dt * vx / time, vy - s.dt * vy / time
        return np.array(plan)

    def zone_of(self, person: Person) -> Ellipse:
        """The zone that is kept for a person: their own, or the controller's; in the person's frame."""
        return self.zone if person.zone is None else as_ellipse(person.zone, self.settings.zone_speed)

    def placed_zones(self, people: Sequence[Person]) -> list[Ellipse]:
        """The zone of each person, in the world frame."""
        return [self.zone_of(p).placed(p.position, cast(float, p.heading)) for p in people]

    def barriers(self, position: ArrayLike, people: Sequence[Person] = ()) -> Array:
        """h of every person and then of every wall at a position, shape (people + walls,) [m]."""
        x, y = finite("position", position, (2,)).tolist()
        distances = [place(person, self.zone_of(person)).distance(x, y) for person in people]
        distances += [segment_formula(x, y, *segment) for segment in self._segments]
        return np.asarray(barrier(np.array(distances, float), self.settings.r_robot, self.settings.eps))

    def _check_goal(self, goal: tuple[float, float], people: Sequence[Person]) -> None:
        standing = [p for p in people if p.stands]
        h = self.barriers(goal, standing)
        if (h < 0).any():
            i = int(h.argmin())
            if i < len(standing):
                what = f"in the zone of the person who stands at {standing[i].position}"
            else:
                what = f"too close to the wall {self.walls[i - len(standing)].tolist()}"
            raise SolverError(
                f"the goal {list(goal)} cannot be reached: it lies {what} (h = {h[i]:.3f} m); "
                "choose one where h >= 0"
            )


def _safe_to_its_end(plan: Numbers, parameters: Array) -> bool:
    """True if the plan ends as it should, with h >= 0 at every state up to the one from which on it does."""
    off = np.abs(plan.states[:, 2:] - parameters[6:8]).max(axis=1) > TOLERANCE
    last = int(off.nonzero()[0].max(initial=-1)) + 1
    return last < len(off) and bool((plan.h[:, : last + 1] >= -TOLERANCE).all())

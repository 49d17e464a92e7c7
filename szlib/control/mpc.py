"""The controller: model predictive control with barriers around people and walls (MPC-CBF).

`problem` states the problem, `solvers` solve it, `solvers.fallbacks` says what follows where they fail.

The terminal condition
----------------------
`terminal="rest"` (barriers on the whole horizon, v_N = 0). *Recursive feasibility*: let all people
stand, h(x_0) >= 0, and let u_0 .. u_{N-1} satisfy the problem. One step later take u_1 .. u_{N-1}, 0.
Its states are x_1 .. x_N, x_N, because v_N = 0. Bounds, speed and the terminal condition hold, and so do
the barrier rows of the steps that both plans share. The new row is
h(x_N) - (1 - gamma) h(x_N) = gamma h(x_N), and the old rows give h(x_{k+1}) >= (1 - gamma) h(x_k), so
h(x_N) >= (1 - gamma)^N h(x_0) >= 0: the new row holds as well. So a robot that starts in the safe set with
a solution, at rest for instance (u = 0), has one for ever, and h >= 0 for ever.

*Passive safety*: if people walk as predicted, the new row may fail, because they come closer while the
robot rests. Say that a plan reaches a safe end if h >= 0 at all its states up to the one from which on it
rests. By the inequality above each solution does, and so does a shifted plan that did before. So if the
problem has no solution, the relaxed plan is applied only if it reaches a safe end, and otherwise the last
plan, shifted. Then at the first instant at which any h < 0 the robot is at rest: a moving robot hits nobody.

`terminal="person"` (one person, walking at velocity w, |w| <= v_max, no wall; v_N = w). In the frame of the
person both arguments are the first one: appending 0 keeps the robot at the person's velocity, so
h(x_{N+1}, N+1) = h(x_N, N), and the problem is recursively feasible although the person walks.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from math import dist, hypot
from threading import get_ident
from time import perf_counter
from typing import Any
from warnings import catch_warnings

import numpy as np
from numpy.typing import ArrayLike

from ..checks import (
    Array,
    check_array,
    check_number,
    check_point,
    check_vector,
    require,
)
from ..errors import DataWarning, SolverError, warn
from ..zones.ellipses import Ellipse, circle_around
from .barriers import find_near_walls, find_solids, read_walls
from .controller import Controller
from .distances import walls_with_margins
from .head_on import find_target
from .person import Person, SpeedZone, as_ellipse, place_zone
from .routes import Point, RoutePlanner, find_boxes
from .scene import Scene
from .settings import MPCSettings
from .solvers.fallbacks import solve_with_fallbacks
from .solvers.solver_pool import SolverPool, active_rows, padded_parameters
from .step import Step
from .step_clock import StepClock
from .tracker import People, TrackedPeople, Tracker

_MOST_PEOPLE = 1000  # greatest number for which solvers are prepared: those for 10,000 take 1.5 GB of memory
_FEW_WALLS = (
    24  # up to this number all walls are in the problem, of more those that are near
)


class MPCCBF(Controller):
    """Drives a double integrator to a goal, outside the social zones of people and away from walls.

    A controller belongs to the thread that first calls `step`; give each thread its own, for instance a copy.
    A copy (`copy.copy`, `copy.deepcopy`, `pickle`) gives the same steps as its original, bit for bit, unless
    a time limit ends a step.

    Parameters
    ----------
    zone : the social zone of a person, in the person's frame [m]; or anything with `.ellipse(speed)`, such as
        a `SocialZone`, whose zone at `settings.zone_speed` is used.
    walls : segments, shape (n, 2, 2): end points [m]; or anything else that `read_walls` accepts. Inside of
        a polygon, or of a map's walls (`walls_from_map`), no step is safe. The attribute `walls` holds their
        segments.
    settings : every other parameter.
    max_people : number of people to prepare solvers for, at most 1000. None: 8, and more in the background as
        soon as half of this number is present. For more people than are prepared the solver is built within
        the step, which no time limit covers; the log "szlib" says so (level INFO).
    tracker : remembers people by their ids; default: `Tracker()`.

    Raises
    ------
    SolverError : a wall is not finite or has no length, or settings and walls do not fit.
    ZoneError : `zone` is no zone.

    Warns
    -----
    DataWarning : `zone` was fitted, and its verdict at `settings.zone_speed` is not "usable".

    Examples
    --------
    >>> import szlib
    >>> zone = szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))
    >>> controller = szlib.MPCCBF(zone, walls=[[(-6.0, 2.3), (7.0, 2.3)]])
    >>> person = szlib.Person(position=(0.0, 0.0), velocity=(-0.5, 0.0))
    >>> step = controller.step(state=(-4.0, 0.0, 0.0, 0.0), goal=(4.0, 0.0), people=[person])
    >>> step.safe
    True
    >>> ax, ay = step.control  # the acceleration to apply for the next 0.1 s
    """

    settings: MPCSettings
    zone: Ellipse
    walls: Array
    _planner: RoutePlanner | None

    def __init__(
        self,
        zone: Ellipse | SpeedZone,
        *,
        walls: Any = (),
        settings: MPCSettings | None = None,
        max_people: int | None = None,
        tracker: Tracker | None = None,
    ) -> None:
        self.settings = settings or MPCSettings()
        speed = self.settings.zone_speed
        if hasattr(zone, "verdict") and (verdict := zone.verdict(speed)) != "usable":
            warn(
                f"the zone at {speed:g} m/s should not be relied on: {verdict.sentence}"
            )
        with catch_warnings(
            action="ignore", category=DataWarning
        ):  # the verdict states the same
            self.zone = as_ellipse(zone, speed)
        is_number = max_people is None or (
            isinstance(max_people, int) and 0 <= max_people <= _MOST_PEOPLE
        )
        expected = f"a whole number from 0 to {_MOST_PEOPLE}, or None"
        require(is_number, "max_people", max_people, expected, SolverError)
        self.tracker, self._thread = tracker or Tracker(), dict[str, int]()
        self._take_walls(walls)
        self._pool = SolverPool(
            self.settings, max_people, min(len(self.walls), _FEW_WALLS)
        )
        self.reset()

    def _take_walls(self, walls: Any) -> None:
        segments = read_walls(walls)
        if self.settings.terminal == "person" and len(segments):
            raise SolverError(
                f"terminal='person' is for open space; got {len(segments)} walls; use 'rest'"
            )
        self.walls, self._wall_rows = (
            segments,
            walls_with_margins(segments, self.settings),
        )
        self._solids, self._planner = find_solids(walls), None
        self._near_from, self._near_reach, self._slots = (0.0, 0.0), 0.0, 0

    def set_walls(self, walls: Any) -> None:
        """Replace the walls, from the next step on.

        Parameters
        ----------
        walls : as of `MPCCBF`. A solver of another size (1, 2, 3, 4, 6, ... walls) is built now if needed.

        Raises
        ------
        SolverError : as of `MPCCBF`, and the walls stay as they were; or the controller belongs to another
            thread.
        """
        self._check_thread()
        self._take_walls(walls)
        self._pool.get(self._n_barriers, min(len(self.walls), _FEW_WALLS))

    def _check_thread(self) -> None:
        if self._thread.setdefault("first", get_ident()) != get_ident():
            raise SolverError(
                "this controller belongs to another thread; build one in each thread"
            )

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the thread: a copy continues from the same plan, in another thread."""
        return {**self.__dict__, "_thread": {}}

    def reset(self) -> None:
        """Forget the last plan and all people, so that the next step depends on no earlier one."""
        self._plan, self._change = np.zeros((2, 2 * self.settings.N))
        self._clock, self._n_barriers = StepClock(self.settings.dt), 0
        self.tracker.reset()
        self._pool.reset()
        self._near_reach, self._slots = 0.0, 0
        if self._planner:
            self._planner.reset()

    def step(
        self,
        state: ArrayLike,
        goal: ArrayLike,
        people: People = (),
        *,
        ids: Iterable[Hashable] | None = None,
        stamps: ArrayLike | None = None,
        now: float | None = None,
        route: ArrayLike | None = None,
        state_age: float = 0.0,
    ) -> Step:
        """Decide the acceleration for the next `dt`.

        The robot always gets a control, whatever people do and whatever a sensor measures. `Step.fallback`
        and `Step.slack` tell if people leave it no way, `Step.goal_blocked` if the goal cannot be reached.

        Measurements of people that cannot be used are rejected and counted (`Step.rejected`); the last known
        state of the same person, moved forward, takes their place. If nothing is known of a person
        (`Step.unknown`), no plan can be proved safe, but a robot at rest hits nobody. So the step is not
        `safe`, and the target is the point where full braking ends, instead of the goal. The robot still
        keeps out of all known zones, and away from walls.

        Latency: give the true times of measurement. `stamps` bring people to `now`; `state_age` brings the
        robot there, by the controls commanded since. If a control takes effect late, by d seconds, let `now`
        be the time at which it does, and add d to `state_age`. `Step.clock` says if the times do not fit.

        Parameters
        ----------
        state : (x, y, vx, vy) [m, m/s].
        goal : (x, y) [m].
        people : everybody to be respected: `Person`s, or an array, shape (n, 4): x, y [m], vx, vy [m/s].
        ids : by which the tracker recognises them, None for a person without an id; default: those of the
            `Person`s. See `Tracker`.
        stamps : when they were measured, one time for each or one for all [s]; default: now.
        now : time, by the same clock [s]; default: `dt` after the last step.
        route : a way to the goal from a global planner, corners, shape (m, 2) [m]. The plan heads for its
            farthest point in sight, at most `settings.lookahead` ahead of where the route passes the robot;
            the people and walls on it are avoided as always. Default: a route of its own (`find_route`) if
            `settings.lookahead` is finite, else none.
        state_age : time from the measurement of `state` to `now`, at most 1 s [s].

        Raises
        ------
        SolverError : an error of the program: a number or a shape cannot be used, the goal of the first step
            lies too close to a wall, or the controller belongs to another thread.
        """
        began = perf_counter()
        self._check_thread()
        x, towards = check_vector("state", state, 4), check_point("goal", goal)
        clock, first = self._clock, not self._clock.has_begun
        if first:
            self._check_goal(towards)
        clock.tick(now, stamps)
        if age := check_number("state_age", state_age):
            x = clock.bring_forward(self.robot, np.array(x), age, np.zeros(2)).tolist()
        tracked = self.tracker.see(people, now=clock.now, ids=ids, stamps=stamps)
        scene = self._scene(x, towards, tracked, self._find_near(*x))
        ahead, way_length = self._look_ahead((x[0], x[1]), towards, route)
        remaining = way_length if way_length < np.inf else dist(x[:2], towards)
        barriers, n_walls = scene.barriers, len(scene.near_walls)
        self._n_barriers = len(barriers)
        solver = self._pool.get(self._n_barriers, max(n_walls, self._slots))
        self._pool.budget.begin(perf_counter() - began)
        size = solver.evaluate.size
        parameters = self._parameters(x, ahead, scene, barriers, size)
        fallback, plan, timed_out = solve_with_fallbacks(
            solver, self._plan, self._change, parameters
        )
        self._change = np.zeros(plan.inputs.size) if first else plan.inputs - self._plan
        self._plan, rows = plan.inputs, active_rows(len(scene.zones), n_walls, size)
        clock.hold(self._plan[:2])
        return Step(
            control=self._plan[:2].copy(),
            predicted=plan.states,
            fallback=fallback,
            slack=plan.slack,
            residual=scene.spread(
                plan.rows[: solver.evaluate.n_cbf].reshape(-1, self.settings.N_h)[rows]
            ),
            h=scene.spread(plan.h[rows, 0]),
            target=parameters[4:6],
            cost=plan.cost,
            solve_time=perf_counter() - began,
            timed_out=timed_out,
            scene=scene,
            way_length=way_length,
            stuck=clock.time_without_progress(remaining, towards),
            clock=clock.describe(stamps, self.tracker.memory),
        )

    def _find_near(
        self, x: float, y: float, vx: float, vy: float
    ) -> Sequence[int] | None:
        """Numbers of the walls that can matter: see `Scene.near`. They are looked for once a metre."""
        s, speed = self.settings, max(self.settings.v_max, hypot(vx, vy))
        if len(self.walls) <= _FEW_WALLS:
            return None
        longest = max(s.step_lengths)
        time = s.times[-1] + 2 * longest * s.dt / (1 - (1 - s.gamma) ** longest)
        reach = s.r_robot + s.eps + speed * time
        if reach + dist((x, y), self._near_from) > self._near_reach:
            self._near_from, self._near_reach = (x, y), reach + 1.0
            self._near = find_near_walls(self.walls, x, y, self._near_reach)
            self._slots = max(_FEW_WALLS, self._slots, len(self._near))
        return self._near

    def _look_ahead(
        self, at: Point, goal: Point, route: ArrayLike | None
    ) -> tuple[Point, float]:
        """The point of the route that attracts the plan, and the length of the way to the `goal` [m]."""
        s = self.settings
        if route is None and s.lookahead == np.inf:
            return goal, dist(at, goal)
        if self._planner is None:
            self._planner = RoutePlanner(
                self.walls, find_boxes(self._wall_rows, s.r_robot)
            )
        if route is None:
            return self._planner.aim(at, goal, s.lookahead)
        return self._planner.follow(
            check_array("route", route, (..., 2)), at, goal, s.lookahead
        )

    def _scene(
        self,
        state: Sequence[float],
        goal: Point,
        tracked: TrackedPeople,
        near: Sequence[int] | None = None,
    ) -> Scene:
        """What the step is asked, with the zone of every person."""
        zones = [self.zone_of(person) for person in tracked.people]
        placed = [
            place_zone(person, zone)
            for person, zone in zip(tracked.people, zones, strict=True)
        ]
        walls, solids = self._wall_rows, self._solids
        return Scene(
            tuple(state),
            goal,
            tracked,
            zones,
            placed,
            walls,
            self.settings,
            solids,
            near,
        )

    def _parameters(
        self,
        x: list[float],
        ahead: Point,
        scene: Scene,
        barriers: Sequence[Sequence[float]],
        size: tuple[int, int],
    ) -> Array:
        """Parameters of the problem of this size: see `Problem.parameters`."""
        if scene.tracked.unknown:
            time = max(abs(x[2]), abs(x[3])) / self.settings.a_max
            target = (
                x[0] + x[2] * time / 2,
                x[1] + x[3] * time / 2,
            )  # where full braking ends
        else:
            target = find_target(
                (x[0], x[1]), ahead, scene.zones, scene.near_walls, self.settings
            )
        end_velocity = scene.zones[0][5:] if scene.terminal == "person" else (0.0, 0.0)
        numbers = padded_parameters(x, barriers, scene.near_walls, size)
        return np.array([*x, *target, *end_velocity, *self._plan[:2], *numbers])

    def zone_of(self, person: Person) -> Ellipse:
        """Zone of a `person` in their own frame: their own, or the controller's.

        If their heading is unknown, it is the circle around that zone.
        """
        zone = self.zone if person.zone is None else person.zone
        if not isinstance(zone, Ellipse):
            zone = as_ellipse(zone, self.settings.zone_speed)
        return circle_around(zone) if person.heading is None else zone

    def barriers(self, position: ArrayLike, people: Sequence[Person] = ()) -> Array:
        """h of all `people` and then of all walls at a `position`, shape (people + walls,) [m]."""
        x, y = point = check_point("position", position)
        scene = self._scene((x, y, 0.0, 0.0), point, TrackedPeople(tuple(people)))
        return np.array(scene.h(x, y), float)

    def goal_blocked(self, goal: ArrayLike, people: Sequence[Person] = ()) -> bool:
        """True if h < 0 at the `goal`, because of a wall or of one of `people` who stands."""
        x, y = point = check_point("goal", goal)
        return self._scene(
            (x, y, 0.0, 0.0), point, TrackedPeople(tuple(people))
        ).goal_blocked

    def check_start(
        self, state: ArrayLike, goal: ArrayLike, people: Sequence[Person] = ()
    ) -> None:
        """Raise SolverError if no run can start in this state.

        Parameters
        ----------
        state : (x, y, vx, vy) [m, m/s], which must keep every barrier and the speed limit.
        goal : (x, y) [m], which must be free of walls and of people who stand.
        people : everybody who is present.
        """
        x, y, vx, vy = check_vector("state", state, 4)
        h, limit = self.barriers((x, y), people), self.settings.v_max
        if len(h) and h.min() < 0:
            i = int(h.argmin())
            obstacle = f"person {i}" if i < len(people) else f"wall {i - len(people)}"
            raise SolverError(
                f"the run starts in violation: h = {h[i]:.3f} m for {obstacle} at {[x, y]}; "
                "start where h >= 0"
            )
        if self.goal_blocked(goal, people):
            raise SolverError(
                f"the goal {list(check_point('goal', goal))} cannot be reached: it lies in the zone of a "
                "person who stands; choose one where h >= 0"
            )
        if (speed := float(np.hypot(vx, vy))) > limit:
            raise SolverError(
                f"the run starts at {speed:.3f} m/s; the limit is {limit} m/s"
            )

    def _check_goal(self, goal: tuple[float, float]) -> None:
        h = self.barriers(goal)
        if (h < 0).any():
            i = int(h.argmin())
            raise SolverError(
                f"the goal {list(goal)} cannot be reached: it lies too close to the wall "
                f"{self.walls[i].tolist()} (h = {h[i]:.3f} m); choose one where h >= 0"
            )

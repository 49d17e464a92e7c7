"""The controller: model predictive control with barriers around people and walls (MPC-CBF).

`problem` states the problem, `solvers` solve it, and `solvers.fallbacks` says what follows where they cannot.

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

from collections.abc import Hashable, Iterable, Sequence
from threading import get_ident
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..checks import Array, check_point, check_vector
from ..errors import SolverError
from ..zones.ellipses import Ellipse
from .barriers import barrier, segment_formula, walls_of
from .distances import wall_margin
from .head_on import subgoal
from .person import Person, SpeedZone, as_ellipse, circle_around, place
from .scene import Scene
from .settings import MPCSettings
from .solvers.fallbacks import solve_with_fallbacks
from .solvers.solver_pool import Sizes, slots, taken
from .step import Step, terminal_of
from .tracker import People, Seen, Tracker


class MPCCBF:
    """Drives a double integrator to a goal, outside the social zones of people and clear of walls.

    A controller belongs to the thread that first asks it for a step; give each thread one of its own, for
    instance a `copy.deepcopy`. It can be pickled.

    Parameters
    ----------
    zone : the social zone of a person, in the person's frame [m]; or anything with `.ellipse(speed)`,
        such as a `SocialZone`, which is asked for `settings.zone_speed`.
    walls : segments, shape (n, 2, 2): end points [m]; or polylines, Shapely's lines and polygons, or whatever
        else `barriers.walls_of` takes; `self.walls` are their segments.
    settings : every other parameter.
    max_people : how many people to be ready for; None: for 8, and in time for more, built in a thread of its
        own from when half of the slots are taken. More people than it is ready for make the controller grow
        at once, which no time limit covers, and is logged by "szlib" (at level INFO).
    tracker : what is remembered of people by their ids; default: `Tracker()`.

    Raises
    ------
    SolverError : a wall is not finite or has no length, or settings and walls do not go together.
    ZoneError : `zone` is no zone.
    """

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
        self.zone = as_ellipse(zone, self.settings.zone_speed)
        if max_people is not None and not (isinstance(max_people, int) and max_people >= 0):
            raise SolverError(f"max_people must be a whole number >= 0, or None; got {max_people!r}")
        self.tracker, self._thread = tracker or Tracker(), dict[str, int]()
        self._take(walls)
        self._sizes = Sizes(self.settings, max_people, len(self.walls))
        self.reset()

    def _take(self, walls: Any) -> None:
        segments = walls_of(walls)
        if self.settings.terminal == "person" and len(segments):
            raise SolverError(f"terminal='person' is for open space; got {len(segments)} walls; use 'rest'")
        self.walls = segments
        self._segments: list[list[float]] = self.walls.reshape(-1, 4).tolist()
        self._margins = [wall_margin(wall, self.settings) for wall in self.walls]
        pairs = zip(self._segments, self._margins, strict=True)
        self._wall_numbers = [number for segment, margin in pairs for number in (*segment, margin)]

    def set_walls(self, walls: Any) -> None:
        """Know these walls from the next step on, in place of those before; given as to the controller.

        A number of walls that needs another size (1, 2, 3, 4, 6, ...) is built now: see `SolverPool`.

        Raises
        ------
        SolverError : as the controller, which then keeps its walls; or another thread has it.
        """
        self._own()
        self._take(walls)
        self._sizes.of(self._n_people, len(self.walls))

    def _own(self) -> None:
        if self._thread.setdefault("first", get_ident()) != get_ident():
            raise SolverError("this controller belongs to another thread; build one in each thread")

    def __getstate__(self) -> dict[str, Any]:
        """Everything but the thread: a copy goes on from the same plan, in whatever thread asks it first."""
        return {**self.__dict__, "_thread": {}}

    def reset(self) -> None:
        """Forget the last plan and everybody: what follows depends on nothing that went before."""
        self._plan, self._change, self._now = *np.zeros((2, 2 * self.settings.N)), 0.0
        self._moved, self._n_people = False, 0
        self.tracker.reset()
        self._sizes.reset()

    def step(
        self,
        state: ArrayLike,
        goal: ArrayLike,
        people: People = (),
        *,
        ids: Iterable[Hashable] | None = None,
        stamps: ArrayLike | None = None,
        now: float | None = None,
    ) -> Step:
        """The acceleration to apply for the next `dt`.

        Whatever people do, and whatever a sensor says of them, the robot gets a control: where they leave it
        no way, `Step.rung` and `Step.slack` say so, and `Step.goal_blocked` where the goal cannot be reached.

        People with numbers that cannot be used are set aside and counted (`Step.set_aside`); in their place
        the tracker puts where they must be by now. Out of the zone of those of whom it knows nothing
        (`Step.lost`) no plan can be proved to keep, but a robot at rest hits nobody. So while somebody is
        lost the step is not `safe`, and the robot is drawn to where full braking ends, not to the goal; out
        of the zones of those whom it sees, and off walls, it keeps all the same.

        Parameters
        ----------
        state : (x, y, vx, vy) [m, m/s].
        goal : (x, y) [m].
        people : everybody to be respected: `Person`s, or an array, shape (n, 4): x, y [m], vx, vy [m/s].
        ids : of each of them, by which they are known again, None for who has none; default: those of the
            `Person`s. See `Tracker` for what is remembered.
        stamps : when they were seen, a time for each or one for all [s]; default: now.
        now : time [s], of the same clock; default: `dt` after the last step.

        Raises
        ------
        SolverError : an error of the program: state or goal is no number, a shape is wrong, the goal of the
            first step lies too close to a wall, or another thread has this controller.
        """
        began = perf_counter()
        self._own()
        x, towards = check_vector("state", state, 4), check_point("goal", goal)
        if not self._moved:
            self._check_goal(towards)
        self._now = self._clock(now, stamps)
        scene = self._scene(x, towards, self.tracker.see(people, now=self._now, ids=ids, stamps=stamps))
        first, self._moved, self._n_people = not self._moved, True, len(scene.zones)
        solver = self._sizes.of(self._n_people, len(self.walls))
        self._sizes.budget.begin()
        size = solver.evaluate.size
        parameters = self._parameters(x, scene, size)
        rung, numbers, timed_out = solve_with_fallbacks(solver, self._plan, self._change, parameters)
        self._change = np.zeros(numbers.inputs.size) if first else numbers.inputs - self._plan
        self._plan, rows = numbers.inputs, taken(self._n_people, len(self.walls), size)
        return Step(
            control=self._plan[:2].copy(),
            predicted=numbers.states,
            rung=rung,
            slack=numbers.slack,
            residual=numbers.rows[: solver.evaluate.n_cbf].reshape(-1, self.settings.N_h)[rows],
            h=numbers.h[rows, 0],
            target=parameters[4:6],
            cost=numbers.cost,
            solve_time=perf_counter() - began,
            timed_out=timed_out,
            scene=scene,
        )

    def _scene(self, x: list[float], goal: tuple[float, float], seen: Seen) -> Scene:
        """Everything that the step is asked, with the zone that is kept of everybody."""
        kept = [self.zone_of(person) for person in seen.people]
        placed = [place(person, zone) for person, zone in zip(seen.people, kept, strict=True)]
        return Scene(tuple(x), goal, seen, kept, placed, self._segments, self._margins, self.settings)

    def _parameters(self, x: list[float], scene: Scene, size: tuple[int, int]) -> Array:
        """The numbers of the problem of this size: state, target, the pace at its end, people and walls."""
        if scene.seen.lost:
            target = self._stop(x)
        else:
            target = subgoal(
                (x[0], x[1]), scene.goal, scene.zones, self._segments, self._margins, self.settings
            )
        first_pace = terminal_of(self.settings, len(scene.zones)) == "person"
        pace = scene.zones[0][5:] if first_pace else (0.0, 0.0)
        return np.array([*x, *target, *pace, *slots(x, scene.zones, self._wall_numbers, size)])

    def _clock(self, now: float | None, stamps: ArrayLike | None) -> float:
        """The time of this step [s]: as given, or `dt` after the last."""
        if now is None:
            if stamps is not None:
                raise SolverError(
                    "stamps need `now`, the time of the robot's state by the same clock; got none"
                )
            return self._now + self.settings.dt if self._moved else 0.0
        if not np.isfinite(now):
            raise SolverError(f"now must be a finite time [s]; got {now!r}")
        return float(now)

    def _stop(self, x: list[float]) -> tuple[float, float]:
        """Where full braking along the way ends [m]."""
        px, py, vx, vy = x
        time = max(abs(vx), abs(vy)) / self.settings.a_max
        return px + vx * time / 2, py + vy * time / 2

    def zone_of(self, person: Person) -> Ellipse:
        """The zone that is kept for a person: their own, or the controller's; in the person's frame.

        Of somebody whose heading is unknown it is `circle_around` that.
        """
        zone = self.zone if person.zone is None else person.zone
        if not isinstance(zone, Ellipse):
            zone = as_ellipse(zone, self.settings.zone_speed)
        return circle_around(zone) if person.heading is None else zone

    def placed_zones(self, people: Sequence[Person]) -> list[Ellipse]:
        """The zone of each person, in the world frame."""
        return [self.zone_of(p).placed(p.position, p.heading or 0.0) for p in people]

    def barriers(self, position: ArrayLike, people: Sequence[Person] = ()) -> Array:
        """h of every person and then of every wall at a position, shape (people + walls,) [m]."""
        x, y = check_point("position", position)
        distances = [place(person, self.zone_of(person)).distance(x, y) for person in people]
        distances += [segment_formula(x, y, *segment) for segment in self._segments]
        margins = [self.settings.eps] * len(people) + self._margins
        return np.asarray(barrier(np.array(distances), self.settings.r_robot, np.array(margins)), float)

    def goal_blocked(self, goal: ArrayLike, people: Sequence[Person] = ()) -> bool:
        """True if the goal cannot be reached, h < 0 there: for a wall, or for somebody who stands."""
        x, y = check_point("goal", goal)
        placed = [place(who, self.zone_of(who)) for who in people]
        return any(zone.blocks((x, y), self.settings) for zone in placed) or bool(
            (self.barriers(goal) < 0).any()
        )

    def _check_goal(self, goal: tuple[float, float]) -> None:
        h = self.barriers(goal)
        if (h < 0).any():
            i = int(h.argmin())
            raise SolverError(
                f"the goal {list(goal)} cannot be reached: it lies too close to the wall "
                f"{self.walls[i].tolist()} (h = {h[i]:.3f} m); choose one where h >= 0"
            )

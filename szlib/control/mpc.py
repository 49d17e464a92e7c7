"""The controller: model predictive control with barriers around people and walls (MPC-CBF).

`planner` states the problem and solves it. Before a control is applied, one check looks at what would follow.

The guard
---------
*Walls.* Say that a state can stop if a robot that brakes as hard as it can along its path touches nothing
fixed. It moves on a straight segment then, which ends where it rests. A control is applied only if the way
during dt touches nothing fixed and the state after it can stop; else the robot brakes. If a state can stop,
the state after dt of braking can, because its segment is a part of the first one (and so are the pieces of
which `Obstacles.bound` bounds the gap: it is up to 2 mm below the true one by the default settings). So by
induction:

    from any state that can stop, the robot never touches a wall, whatever people do, appear or vanish, and
    whatever a sensor says about them,

because people enter neither the condition nor the braking (`Step.walls_safe`).

*Bodies.* A control is passively safe if, with people who keep their velocity, the robot overlaps no body
while it moves: if it brakes after dt, or if it follows its plan to the end and brakes there. It must not
move towards a body that it overlaps already, by more than the curve within a step of the plan. If it is not
passively safe, the robot brakes, if that is better, or follows the rest of the plan before, if only that is
safe. So if it was passively safe once, it stays so as long as it overlaps nobody and people keep their
velocity, and is at rest when somebody walks into it (`Step.passively_safe`; passive safety: Macek et al.,
ECMR 2009). With a `grid` this holds nearly always: of its long steps the rest has the mean. It ends where
walls do not leave way for the rest. Walls go first: if a control is safe for walls, the robot brakes for a
body only if braking is safe for walls, too.

The terminal condition
----------------------
`terminal="rest"` (barriers on the whole horizon, v_N = 0). *Recursive feasibility*: let all people
stand, h(x_0) >= 0, and let u_0 .. u_{N-1} satisfy the problem. One step later take u_1 .. u_{N-1}, 0.
Its states are x_1 .. x_N, x_N, because v_N = 0. Bounds, speed and the terminal condition hold, and so do
the barrier rows of the steps that both plans share. The new row is
h(x_N) - (1 - gamma) h(x_N) = gamma h(x_N), and the old rows give h(x_{k+1}) >= (1 - gamma) h(x_k), so
h(x_N) >= (1 - gamma)^N h(x_0) >= 0: the new row holds as well. So a robot that starts in the safe set with
a solution, at rest for instance (u = 0), has one for ever, and h >= 0 for ever.

This is proved without the guard. With the guard, which is the default, a plan that curves beside a wall may
be given up for braking, and then a barrier row may be violated: in 5 of 213 random worlds with people who
stand, walls and gamma up to 0.3. With `guard=False` this happened in none of 59,360 steps in 742 worlds.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from math import dist, hypot, inf
from time import perf_counter
from typing import Any
from warnings import catch_warnings

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import (
    Array,
    check_number,
    check_point,
    check_vector,
)
from ..core.errors import DataWarning, SolverError, warn
from ..zones.ellipses import BODY_RADIUS, Ellipse, circle_around
from .controller import Controller, StepClock, find_stopping_path
from .obstacles import (
    Bound,
    Group,
    Obstacle,
    Obstacles,
    Path,
    Point,
    Wall,
    Zone,
    find_bodies,
)
from .people import (
    STANDING_SPEED,
    People,
    Person,
    SpeedZone,
    TrackedPeople,
    Tracker,
    as_ellipse,
    list_knots,
)
from .planner import Plan, Planner
from .problem import Question, follow_velocities, plan_braking
from .settings import TOLERANCE, MPCSettings, check_argument
from .step import Scene, Status, Step
from .verification import AT_REST
from .walls import find_solids, read_walls
from .ways import CELL, Heading, WayFinder, find_target


class MPCCBF(Controller):
    """Drives a double integrator to a goal, outside the social zones of people and away from walls.

    A controller belongs to the thread that first calls `step`; give each thread its own, for instance a copy.
    A copy (`copy.copy`, `copy.deepcopy`, `pickle`) gives the same steps as its original, bit for bit, unless
    a time limit ends a step, or ids of people are compared by identity (`Tracker`).

    Parameters
    ----------
    zone : the social zone of a person, in the person's frame [m]; or anything with `.ellipse(speed)`, such as
        a `SocialZone`, whose zone at `settings.zone_speed` is used.
    walls : segments, shape (n, 2, 2): end points [m]; or anything else that `read_walls` accepts. Inside of
        a polygon no step is safe. The attribute `walls` holds the segments.
    obstacles : what else stands still: each a `HalfPlane` or an `Obstacle` of your own; an attribute as well.
    settings : every other parameter.
    tracker : remembers people by their ids; default: `Tracker()`.

    Raises
    ------
    SolverError : a wall is not finite or has no length, or something is no obstacle.
    ZoneError : `zone` is no zone.

    Warns
    -----
    DataWarning : `zone` was fitted, and its verdict at `settings.zone_speed` is not "usable".

    Notes
    -----
    The robot always gets a control, whatever people do and whatever a sensor measures. `Step.status` tells if
    people leave it no way, `Step.goal_blocked` if the goal cannot be reached.

    Measurements of people that cannot be used are rejected and counted (`Step.rejected`); the last known
    state of the same person, moved forward, takes their place. If nothing is known of a person
    (`Step.unknown`), no plan can be proved safe, but a robot at rest hits nobody. So the step is not `safe`,
    and the target is the point where full braking ends, instead of the goal. The robot still keeps out of all
    known zones, and away from walls.

    Latency: give the true times of measurement. `stamps` bring people to `now`; `state_age` brings the robot
    there, by the controls commanded since. If a control takes effect late, by d seconds, let `now` be the
    time at which it does, and add d to `state_age`. `Step.clock` says if the times do not fit.

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

    zone: Ellipse

    def __init__(
        self,
        zone: Ellipse | SpeedZone,
        *,
        walls: Any = (),
        obstacles: Iterable[Obstacle] = (),
        settings: MPCSettings | None = None,
        tracker: Tracker | None = None,
    ) -> None:
        self._settings = MPCSettings() if settings is None else settings
        is_one = isinstance(self.settings, MPCSettings)
        check_argument(
            is_one,
            "settings",
            settings,
            "MPCSettings, such as MPCSettings.among_people()",
        )
        self._s = self._plan_with(self.settings)
        self.zone = _choose_zone(zone, self._s.zone_speed)
        self.tracker = tracker or Tracker()
        self._planner = Planner(self._s)
        self._take_walls(walls)
        self._take_obstacles(obstacles)
        self.reset()

    @property
    def settings(self) -> MPCSettings:  # type: ignore[override]
        """The settings; build another controller for others."""
        return self._settings

    @property
    def walls(self) -> Array:
        """The walls, shape (n, 2, 2), read-only [m]; see `set_walls`."""
        segments = self._segments.view()
        segments.flags.writeable = False
        return segments

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """What else stands still; others may be assigned, which makes a new map of ways (some 0.1 s)."""
        return self._obstacles

    @obstacles.setter
    def obstacles(self, obstacles: Iterable[Obstacle]) -> None:
        """Replace what else stands still, from the next step on."""
        self._planner.check_thread()
        self._take_obstacles(obstacles)

    def _plan_with(self, s: MPCSettings) -> MPCSettings:
        """Settings of the plan of a robot with the settings `s`."""
        return s

    def _take_walls(self, walls: Any) -> None:
        self._segments, self._solids = read_walls(walls), find_solids(walls)

    def _take_obstacles(self, obstacles: Iterable[Obstacle]) -> None:
        """Build what is fixed, of the walls and these `obstacles`."""
        check_argument(
            isinstance(obstacles, Iterable),
            "obstacles",
            obstacles,
            "a list of obstacles",
        )
        others = tuple(obstacles)
        for each in others:
            check_argument(
                isinstance(each, Obstacle), "an obstacle", each, "an Obstacle"
            )
            each.check()
        self._obstacles = others
        walls = (Wall(*each) for each in self._segments.reshape(-1, 4).tolist())
        items = [*walls, *others]
        self._fixed = Obstacles.of(items, self._s)
        self._fixed_of_disc = Obstacles.of(items, self.settings)
        self._ways = WayFinder(self._fixed, self._s)
        self._walls = self._fixed_of_disc.walls
        self._room: tuple[Point, float] = (inf, inf), -inf

    def set_walls(self, walls: Any) -> None:
        """Replace the walls, from the next step on.

        Parameters
        ----------
        walls : as of `MPCCBF`.

        Raises
        ------
        SolverError : as of `MPCCBF`, and the walls stay as they were; or the controller belongs to another
            thread.
        """
        self._planner.check_thread()
        self._take_walls(walls)
        self._take_obstacles(self._obstacles)

    def reset(self) -> None:
        """Forget the last plan and all people, so that the next step depends on no earlier one."""
        self._plan, self._change = np.zeros((2, self._s.N, 2))
        self._clock = StepClock(self._s.dt)
        self.tracker.reset()
        self._planner.reset()
        self._ways = WayFinder(self._fixed, self._s)

    def step(
        self,
        state: ArrayLike,
        goal: ArrayLike,
        people: People = (),
        *,
        ids: Iterable[Hashable] | None = None,
        stamps: ArrayLike | None = None,
        now: float | None = None,
        state_age: float = 0.0,
    ) -> Step:
        """Decide the acceleration for the next `dt`.

        Parameters
        ----------
        state : (x, y, vx, vy) [m, m/s]; for a `DifferentialDrive` see there.
        goal : (x, y) [m].
        people : all to be respected: each a `Person`; or an array, shape (n, 4): x, y [m], vx, vy [m/s].
        ids : by which the tracker recognises them, None for a person without an id; default: that of each
            `Person`. See `Tracker`.
        stamps : when they were measured, one time for each or one for all [s]; default: now.
        now : time, by the same clock [s]; default: `dt` after the last step.
        state_age : time from the measurement of `state` to `now`, at most 1 s [s]; down to -dt, by jitter, it
            counts as 0.

        Raises
        ------
        SolverError : a number or a shape cannot be used, or the controller belongs to another thread.
        """
        began = perf_counter()
        clock = self._clock
        self._planner.check_thread()
        faults = clock.tick(now, stamps)
        goal = check_point("goal", goal)
        x, towards = self._locate(state, goal, check_number("state_age", state_age))
        tracked = self.tracker.see(people, now=clock.now, ids=ids, stamps=stamps)
        scene = self._make_scene(x, towards, tracked, is_point=True)
        headings = self._find_headings(scene)
        self._planner.begin(began)
        heading, question, plan = self._refine(scene, headings)
        status, plan, (walls_safe, passively_safe) = self._choose(scene, question, plan)
        remaining = heading.length if heading.length < inf else dist(x[:2], towards)
        step: Step = self._finish(
            control=plan.inputs[0].copy(),
            inputs=plan.inputs,
            status=status,
            walls_safe=walls_safe,
            passively_safe=passively_safe,
            target=np.array(heading.target),
            solve_time=perf_counter() - began,
            timed_out=plan.timed_out,
            scene=scene,
            way_length=heading.length,
            ways=heading.ways,
            stuck=clock.time_without_progress(remaining, goal),
            clock="; ".join(filter(None, [*faults, tracked.fault])),
        )
        clock.hold(step.control)
        return step

    def _locate(
        self, state: ArrayLike, goal: Point, age: float
    ) -> tuple[list[float], Point]:
        """State now, from a `state` of this `age`, and `goal` of the point that is planned for."""
        x = check_vector("state", state, 4)
        if age:
            x = self._clock.bring_forward(
                self.robot, np.array(x), age, np.zeros(2)
            ).tolist()
        return x, goal

    def _choose(
        self, scene: Scene, question: Question, plan: Plan
    ) -> tuple[Status, Plan, tuple[bool, bool]]:
        """The plan if it is safe; else the rest of the last one if only that is; else braking or the plan.

        And whether it touches nothing fixed, and whether it overlaps no body besides.
        """
        velocity = scene.state[2:]
        status, plan = self._decide(question, plan)
        inputs = plan.inputs
        rank = self._check(scene, inputs)
        if self._s.guard and not all(rank[:2]):
            rest = self._find_rest(velocity)
            kept = self._check(scene, rest)
            brake = plan_braking(self._s, velocity)
            braked = self._check(scene, brake)
            if kept[1] and not braked[1]:
                status = "kept"
                inputs = rest
                rank = kept
            elif braked >= rank:
                status = "braking"
                inputs = brake
                rank = braked
        if self._clock.has_begun:
            self._change = inputs - self._plan
        self._plan = inputs
        return status, plan._replace(inputs=inputs), rank[:2]

    def _find_rest(self, velocity: Sequence[float]) -> Array:
        """The rest of the last plan, and then braking, for a robot of this `velocity`, shape (N, 2) [m/s2].

        A step of the grid that is longer than dt has the mean of what the plan had for its time.
        """
        s = self._s
        lengths = np.array(s.step_lengths)
        rest = self._plan.repeat(lengths, axis=0)[1:]
        last = plan_braking(s, velocity + s.dt * rest.sum(axis=0))[:1]
        begins = lengths.cumsum() - lengths
        rest = np.vstack([rest, last])
        return np.asarray(np.add.reduceat(rest, begins) / lengths[:, None])

    def _finish(self, **found: Any) -> Any:
        """What the robot does, by what was `found`."""
        return Step(**found)

    def _decide(self, question: Question, plan: Plan) -> tuple[Status, Plan]:
        """A `plan`, or braking if there is none.

        A plan that violates a floor may be a poor local optimum, which leads through a wall; so it is
        compared with the one that is found from full braking.
        """
        s = self._s
        velocity = question.state[2:]
        if plan.violations == (inf,):
            return "braking", plan._replace(inputs=plan_braking(s, velocity))
        if max(plan.violations, default=0.0) > 0.0 and not plan.timed_out:
            other = self._planner.plan(question, plan_braking(s, velocity))
            if other.rank < plan.rank:
                return "restarted", other
        if plan.is_relaxed or hypot(*velocity) > s.v_max + TOLERANCE:
            return "relaxed", plan
        return "optimal", plan

    def _refine(
        self, scene: Scene, headings: Sequence[Heading]
    ) -> tuple[Heading, Question, Plan]:
        """Of the plans along the `headings`, the one that violates least, and of these costs least.

        A plan cannot change the side on which it passes somebody; so each way that was just looked for has
        one of its own, which begins along it. For the first way, the plan before is a guess as well.
        """
        s = self._s
        state = scene.state
        last = self._plan[0] if self._clock.has_begun else (0.0, 0.0)
        guesses = [self._plan + self._change]
        found = []
        for k, heading in enumerate(headings):
            barriers = _shrink_zones(scene, heading)
            question = Question(state, heading.target, last, barriers)
            if not heading.is_searched:
                return heading, question, self._planner.plan(question, *guesses)
            way = heading.ways[0]
            points = way.at(s.times)
            targets = np.gradient(points, s.times, axis=0)[1:]
            guesses.append(follow_velocities(s, state[2:], targets))
            plan = self._planner.plan(question, *guesses)
            lost = self._planner.find_time_lost(question, plan, points[1:])
            way = way._replace(cost=way.cost + lost)
            found.append((way.rank(plan.violations), k, way, question, plan))
            if plan.timed_out:
                break
            guesses = []
        _, numbers, ways, questions, plans = zip(*sorted(found), strict=True)
        unrefined = [each.ways[0] for each in headings[k + 1 :]]
        self._ways.ways = ways = (*ways, *unrefined)
        heading = headings[numbers[0]]._replace(ways=ways)
        return heading, questions[0], plans[0]._replace(timed_out=plan.timed_out)

    def _check(self, scene: Scene, inputs: Array) -> tuple[bool, bool, float]:
        """Whether the robot touches nothing fixed, and overlaps no body besides, and the least gap, to order.

        If it brakes after one step of the `inputs`. For bodies it is enough if that holds while it follows
        all of them, and then brakes. The gap is that to bodies, or to what it touches; 0 at most [m].
        """
        walls, bodies = self._find_near(scene, inputs[0])
        if not (walls.groups or bodies.groups):
            return True, True, 0.0
        path = self._carry(find_stopping_path(scene.state, inputs[:1], self._s))
        wall = walls.bound(path)
        body = self._bound_bodies(bodies, path)
        is_safe = body.is_safe
        if not is_safe:
            whole = self._carry(find_stopping_path(scene.state, inputs, self._s))
            is_safe = self._bound_bodies(bodies, whole).is_safe
        worst = body if wall.is_safe else wall
        return wall.is_safe, wall.is_safe and is_safe, min(-TOLERANCE, worst.seen)

    def _find_near(self, scene: Scene, control: Array) -> tuple[Obstacles, Obstacles]:
        """The fixed obstacles that the robot may touch before it rests, and all bodies, or none if it is far.

        It brakes at once, or after one step with `control`. It goes no farther than `reach`: the way to brake
        at once is less than |v| dt / 4 longer than after any control, and to brake in steps adds less than
        a_max dt^2 / 4. A person is far if the whole line is, on which they walk until then. `_room` is where
        the gap to the nearest wall was last measured, and that gap.
        """
        s, (x, y, vx, vy), (ax, ay) = self._s, scene.state, control.tolist()
        at = x, y
        after = vx + s.dt * ax, vy + s.dt * ay
        stop = max(map(abs, after)) / s.a_max
        time = stop + 2 * s.dt
        reach = hypot(vx, vy) * s.dt + hypot(*after) * (s.dt + stop) / 2
        reach += s.a_max * s.dt**2 + s.r_robot - self._settings.r_robot
        walls = bodies = Obstacles((), self._settings.r_robot)
        place, room = self._room
        if room - dist(place, at) < reach:
            gaps = self._walls.gaps(*at)
            walls = self._walls.select_near(gaps - reach)
            self._room = at, float(gaps.min(initial=inf))
        contact = BODY_RADIUS + self._settings.r_robot + reach
        for person in scene.people:
            offset = complex(*person.position) - complex(*at)
            walk = time * complex(*person.velocity)
            share = -(offset * walk.conjugate()).real / (abs(walk) ** 2 or 1.0)
            if abs(offset + max(0.0, min(share, 1.0)) * walk) < contact:
                return walls, find_bodies(scene.zones, self.settings)
        return walls, bodies

    def _carry(self, path: Path) -> Path:
        """The way of the disc, if the point that is planned for goes along a `path`."""
        return path

    def _bound_bodies(self, bodies: Obstacles, path: Path) -> Bound:
        """How near the disc comes to `bodies`, or towards those that it overlaps, while it moves."""
        bound = bodies.bound(path)
        begin = path.points[0]
        moved = path.points - begin
        if bound.is_safe or np.hypot(*moved.T).max() <= AT_REST * self._s.dt:
            return Bound()
        overlaps = bodies.gaps(*begin) < -TOLERANCE
        if not overlaps.any():
            return bound
        bound = bodies.select_near(np.where(overlaps, inf, 0.0)).bound(path)
        offsets = bodies.groups[0].numbers[overlaps, :2] - begin
        towards = float((offsets @ moved.T).max())
        if towards > 0:
            bound = Bound(min(bound.lower, -towards), min(bound.seen, -towards))
        return bound

    def _make_scene(
        self,
        state: Iterable[float],
        goal: Point,
        tracked: TrackedPeople,
        *,
        is_point: bool = False,
    ) -> Scene:
        """What the step is asked, with the zone of every person; for the disc, or for the planned point."""
        s = self._s if is_point else self._settings
        fixed = self._fixed if is_point else self._fixed_of_disc
        people = tracked.people
        zones = Obstacles((), s.r_robot)
        found = tuple(map(self.zone_of, people))
        if people:
            placed = [
                Zone.place(zone, each.position, each.heading or 0.0, each.velocity)
                for zone, each in zip(found, people, strict=True)
            ]
            numbers = np.array(placed)
            if [each for each in people if each.prediction]:
                numbers = np.hstack([numbers, [list_knots(each, s) for each in people]])
            offsets = np.array(len(people) * [s.r_robot + s.eps])
            zones = Obstacles((Group(Zone, numbers, offsets),), s.r_robot)
        return Scene(tuple(state), goal, tracked, found, zones, fixed, s, self._solids)

    def _find_headings(self, scene: Scene) -> Sequence[Heading]:
        """Where the plan may head; among unknown people, where full braking ends."""
        s = self._s
        x, y, vx, vy = scene.state
        goal = scene.goal
        at = (x, y)
        headings = [Heading(goal, dist(at, goal))]
        if s.lookahead < inf:
            headings = self._ways.find(at, goal, scene.people, scene.zones)
        if scene.tracked.unknown:
            time = max(abs(vx), abs(vy)) / s.a_max
            rest = x + vx * time / 2, y + vy * time / 2
            return [headings[0]._replace(target=rest, is_searched=False)]
        if scene.people and not headings[0].ways:
            ((_, numbers, _),) = scene.zones.groups
            target = find_target(at, goal, numbers.tolist(), self._fixed, s)
            return [headings[0]._replace(target=target)]
        return headings

    def zone_of(self, person: Person) -> Ellipse:
        """Zone of a `person` in their own frame: their own, or the controller's.

        If their heading is unknown, it is the circle around that zone.
        """
        zone = self.zone if person.zone is None else person.zone
        if not isinstance(zone, Ellipse):
            zone = as_ellipse(zone, self._s.zone_speed)
        return circle_around(zone) if person.heading is None else zone

    def _ask(
        self, state: ArrayLike, goal: ArrayLike, people: Sequence[Person]
    ) -> Scene:
        return self._make_scene(
            check_vector("state", state, 4),
            check_point("goal", goal),
            TrackedPeople(tuple(people)),
        )

    def barriers(self, position: ArrayLike, people: Sequence[Person] = ()) -> Array:
        """h at a `position`: of the zones of `people`, then of everything fixed, shape (obstacles,) [m]."""
        at = check_point("position", position)
        return self._ask((*at, 0.0, 0.0), at, people).barriers.h(*at)

    def check_start(
        self, state: ArrayLike, goal: ArrayLike, people: Sequence[Person] = ()
    ) -> None:
        """Raise SolverError if no run can start in this state.

        Parameters
        ----------
        state : (x, y, vx, vy) [m, m/s], which must keep every barrier and the speed limit.
        goal : (x, y) [m], which must be free of everything fixed and of people who stand.
        people : everybody who is present.
        """
        scene = self._ask(state, goal, people)
        *at, vx, vy = scene.state
        for fault, place, h in (
            ("the run starts in violation", at, scene.barriers.h(*at)),
            (
                "the goal cannot be reached",
                scene.goal,
                scene.find_standing_h(*scene.goal),
            ),
        ):
            is_free = not scene.is_solid(*place)
            check_argument(is_free, "start and goal", place, "outside of solids")
            if (h < 0).any():
                i = int(h.argmin())
                raise SolverError(
                    f"{fault}: h = {h[i]:.3f} m for {scene.name(i)} at {place}; choose a place where h >= 0"
                )
        speed = hypot(vx, vy)
        expected = f"at most v_max = {self._s.v_max:g} m/s"
        check_argument(speed <= self._s.v_max, "speed at the start", speed, expected)


def _shrink_zones(scene: Scene, heading: Heading) -> Obstacles:
    """The barriers; a zone of a person who stands is shrunk where the way leads through it.

    The search pays for each second in a zone, the plan for each metre of depth. With the whole zone the robot
    would wait in front of it for ever. A zone is shrunk until the way cuts it by a third of a cell. It stays
    whole if the way cuts it by less than a cell, if the way ends in it, or if there is no room for `body_gap`
    to the body. With an infinite `zone_price` or `decay_price` all zones stay whole.
    """
    s = scene.settings
    if not heading.ways or max(s.zone_price, s.decay_price) == inf:
        return scene.barriers
    stands = scene.zones.speeds < STANDING_SPEED
    if not stands.any():
        return scene.barriers
    ((kind, numbers, offsets),) = scene.zones.groups
    points = heading.ways[0].points[1:]
    h = scene.zones.h(*points.T)
    gaps = scene.zones.gaps(*points.T).min(axis=1)
    is_passed = stands & (gaps >= s.body_gap) & (h[:, -1] >= 0)
    lowest = h.min(axis=1)
    depths = np.where(is_passed & (lowest < -CELL), lowest + CELL / 3, 0.0)
    groups = (Group(kind, numbers, offsets + depths),)
    return scene.zones._replace(groups=groups).joined(scene.fixed)


def _choose_zone(zone: Ellipse | SpeedZone, speed: float) -> Ellipse:
    """The ellipse of a `zone` at a walking `speed` [m/s], with a warning if it is not usable."""
    verdict: Any = getattr(zone, "verdict", "usable")
    if callable(verdict):
        verdict = verdict(speed)
    if verdict != "usable":
        warn(f"the zone at {speed:g} m/s should not be relied on: {verdict.sentence}")
    # the verdict states the same
    with catch_warnings(action="ignore", category=DataWarning):
        return as_ellipse(zone, speed)

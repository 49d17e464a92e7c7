"""How people move, and how the controller sees them: they walk on, turn, hide, or react to the robot.

Every `CrowdModel` makes a `Crowd` from a scenario.  `ReactingPeople` walk by one of `WALKING_MODELS`:

    orca          optimal reciprocal collision avoidance, by pyrvo, which wraps the authors' RVO2 library
    social force  people are pushed by each other, by walls and by the robot

Sources: J. van den Berg, S. Guy, M. Lin, D. Manocha, "Reciprocal n-body collision avoidance", ISRR 2009;
M. Moussaid et al., "Experimental study of the behavioural mechanisms underlying self-organization in human
crowds", Proc. R. Soc. B 276, 2009, with the numbers of PySocialForce 1.1.2.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from math import atan2, cos, hypot, sin
from typing import Any, Literal, Protocol, get_args

import numpy as np
import shapely

from ..control import MPCSettings, Person
from ..core.checks import Array, check_array, require
from ..core.errors import SolverError
from ..zones.ellipses import BODY_RADIUS
from .scenario import Scenario

Crowd = Callable[[float, Array], Sequence[Person | None]]
"""The true people at a time [s], given the robot's state (x, y, vx, vy) at that time.

The number and the order of people never change; None stands for a person who is absent.  The loop calls it
once a step, at 0, dt, 2 dt, ..., so that a crowd may advance with each call.
"""


class CrowdModel(Protocol):
    """How people move, and how the controller sees them: `Behaviour`, or another class with these methods.

    A subclass needs only `start`.  The robot keeps out of the zones of the scenario's people.
    """

    def start(self, scenario: Scenario, seed: int) -> Crowd:
        """The people of a `scenario` from its start on, with a `seed` for what is random."""

    def observe(
        self, people: tuple[Person, ...], rng: np.random.Generator
    ) -> Sequence[Person | None]:
        """What the controller sees of the `people` who are present, in their order; None: not seen.

        `rng` is for noise.  By default the controller sees all people as they are.
        """
        return people


@dataclass(frozen=True)
class Behaviour:
    """People who walk on, unaffected by the robot (paper, sec. 4), or who change their velocity once.

    Parameters
    ----------
    pace : factor of a walker's speed after the change; 0 stops them.
    turn : angle by which they turn then, to a random side [rad].
    noise : standard deviation of the position that the controller sees, for each coordinate [m].
    between : first and last time of the change [s].

    All defaults are assumed.

    Raises
    ------
    SolverError : a number is negative or not finite.
    """

    pace: float = 1.0
    turn: float = 0.0
    noise: float = 0.0
    between: tuple[float, float] = (1.0, 6.0)

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            is_valid = np.isfinite(value) & np.greater_equal(value, 0)
            require(np.all(is_valid), each.name, value, "finite and >= 0", SolverError)

    def start(self, scenario: Scenario, seed: int) -> Crowd:
        """The true motion of the people of a `scenario`, with times and sides of changes from the `seed`."""
        people = scenario.people
        if self.pace == 1.0 and self.turn == 0.0:
            return lambda t, _: [person.after(t) for person in people]
        rng = np.random.default_rng([seed, 1])
        changes = [self._draw_change(person, rng) for person in people]
        return lambda t, _: [
            person.after(t) if t <= time else changed.after(t - time)
            for person, (time, changed) in zip(people, changes, strict=True)
        ]

    def _draw_change(
        self, person: Person, rng: np.random.Generator
    ) -> tuple[float, Person]:
        """When a person changes their velocity, and the person at that time, with the new one."""
        time = rng.uniform(*self.between)
        turn = self.turn * rng.choice([-1, 1])
        if person.stands:
            return time, person
        vx, vy = person.velocity
        heading = (atan2(vy, vx) if person.heading is None else person.heading) + turn
        speed = self.pace * hypot(vx, vy)
        velocity = (speed * cos(heading), speed * sin(heading))
        now = person.after(time)
        return time, replace(now, velocity=velocity, heading=heading, prediction=None)

    def observe(
        self, people: tuple[Person, ...], rng: np.random.Generator
    ) -> tuple[Person, ...]:
        """The `people` at positions with noise from `rng`."""
        if self.noise == 0:
            return people
        noise = rng.normal(0.0, self.noise, (len(people), 2)).tolist()
        return tuple(
            p.at((p.position[0] + dx, p.position[1] + dy))
            for p, (dx, dy) in zip(people, noise, strict=True)
        )


# People who walk on at constant velocity and are seen without noise (paper, sec. 4).
UNAFFECTED = Behaviour()


class VisiblePeople:
    """A `CrowdModel` of people who walk on, unaffected; the controller sees those whom no wall hides."""

    def start(self, scenario: Scenario, seed: int) -> Crowd:
        """The true motion of the people of a `scenario`, whatever the `seed`."""
        crowd = UNAFFECTED.start(scenario, seed)
        self._walls = scenario.walls

        def crowd_and_robot(t: float, robot: Array) -> Sequence[Person | None]:
            """The people; the position of the robot is remembered for `observe`."""
            self._robot = robot[:2]
            return crowd(t, robot)

        return crowd_and_robot

    def observe(
        self, people: tuple[Person, ...], rng: np.random.Generator
    ) -> tuple[Person | None, ...]:
        """The `people`, with None for those whom a wall hides; nothing is drawn from `rng`."""
        return tuple(
            p if is_visible(self._robot, p.position, self._walls) else None
            for p in people
        )

    def __reduce__(self) -> tuple[type[VisiblePeople], tuple[()]]:
        """A copy remembers nothing of a run."""
        return VisiblePeople, ()


def is_visible(a: Array, b: tuple[float, float], walls: Array) -> bool:
    """True if the line from `a` to `b` crosses no wall of `walls`, shape (n, 2, 2)."""
    sight = shapely.LineString([a, b])
    return not shapely.crosses(sight, shapely.linestrings(walls)).any()


# --- models of walking -------------------------------------------------------------------------------

INSTALL_CROWDS = "pip install -e '.[crowds]'"  # command that installs pyrvo
# Largest speed of people who avoid others by ORCA, as a multiple of their own (Helbing and Molnar 1995).
MAX_SPEED_FACTOR = 1.3
HORIZON = 3.0  # time for which people keep apart from others [s] (assumed)
WALL_HORIZON = 1.0  # and from walls [s] (assumed)
NEIGHBOUR_RANGE = 10.0  # how far they see [m] (as in RVO2's examples)
MAX_NEIGHBOURS = 10  # to how many at once they react (as in RVO2's examples)
STEP_ASIDE_SPEED = 0.5  # largest speed of people who stand [m/s] (assumed)

RELAXATION_TIME = 0.5  # in which a person takes their own speed [s]
STRENGTH = 5.1  # of the push of a person [m/s2]
REACH = 0.35  # of this push, for each m/s [m]
WALL_STRENGTH = 10.0  # of the push of each point of a wall [m/s2]
WALL_REACH = 0.2  # of this push [m]
WALL_GAP = 0.35  # radius of a person before a wall [m]
WALL_RANGE = 3.35  # farther points of walls push nobody [m]
ARRIVED = 0.5  # distance to the goal at which a person stops [m]
POINTS_PER_METRE = 10.0  # walls are points
MIN_WALL_LENGTH = 0.2  # a shorter wall counts as one of this length [m]
_SMALLEST = 1e-100  # keeps 0 / 0 from being NaN


@dataclass(frozen=True)
class Walkers:
    """All people at the start, and their goals.

    Attributes
    ----------
    positions, velocities, goals : shape (n, 2) [m, m/s, m].
    speeds : speed at which each walks to their goal, shape (n,) [m/s]; 0 for people who stand.
    walls : segments, shape (m, 2, 2) [m].
    r_robot : radius of the disc for which people take the robot [m]; None: they do not see it.
    """

    positions: Array
    velocities: Array
    goals: Array
    speeds: Array
    walls: Array
    r_robot: float | None


class WalkingModel(Protocol):
    """A model of walking, built for some `Walkers`."""

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """Velocity of each person for the next time step, shape (n, 2) [m/s].

        Parameters
        ----------
        positions : where people are, shape (n, 2) [m].
        robot : (x, y, vx, vy) of the robot [m, m/s], unless they do not see it.
        dt : time step [s].
        """


# a function of a module, so that other processes find it
ModelFactory = Callable[[Walkers], WalkingModel]


class OrcaModel:
    """`walkers` who avoid each other, the robot and walls by ORCA: a `WalkingModel`."""

    def __init__(self, walkers: Walkers) -> None:
        try:
            import pyrvo as rvo
        except ImportError as error:
            raise SolverError(
                f"these people need the package pyrvo ({error}); install it with: {INSTALL_CROWDS}"
            ) from error
        near = (NEIGHBOUR_RANGE, MAX_NEIGHBOURS, HORIZON, WALL_HORIZON)
        sim: Any = rvo.RVOSimulator(0.1, *near, BODY_RADIUS, 1.0)
        fastest = np.where(
            walkers.speeds > 0, MAX_SPEED_FACTOR * walkers.speeds, STEP_ASIDE_SPEED
        ).tolist()
        for position, velocity, speed in zip(
            walkers.positions, walkers.velocities, fastest, strict=True
        ):
            sim.add_agent(
                position.tolist(), *near, BODY_RADIUS, speed, velocity.tolist()
            )
        if walkers.r_robot is not None:
            sim.add_agent((0.0, 0.0), *near, walkers.r_robot, 1.0, (0.0, 0.0))
        for wall in walkers.walls:
            sim.add_obstacle(wall.tolist())
        sim.process_obstacles()
        self._walkers = walkers
        self._sim = sim

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """See `WalkingModel.velocities` for `positions`, `robot` and `dt`."""
        w = self._walkers
        sim = self._sim
        n = len(positions)
        offset = w.goals - positions
        distance = np.hypot(*offset.T)
        fastest = np.where(w.speeds > 0, w.speeds, STEP_ASIDE_SPEED)
        speed = np.minimum(fastest, distance / dt)
        preferred = offset * (speed / np.maximum(distance, _SMALLEST))[:, None]
        for i in range(n):
            sim.set_agent_position(i, positions[i].tolist())
            sim.set_agent_pref_velocity(i, preferred[i].tolist())
        if w.r_robot is not None:
            x, y, vx, vy = robot.tolist()
            sim.set_agent_position(n, (x, y))
            sim.set_agent_velocity(n, (vx, vy))
            sim.set_agent_pref_velocity(n, (vx, vy))
        sim.set_time_step(dt)
        sim.do_step()
        return np.array(
            [sim.get_agent_velocity(i).to_tuple() for i in range(n)], float
        ).reshape(-1, 2)


class SocialForceModel:
    """`walkers` who are pushed by each other, the robot and walls: a `WalkingModel`.

    People have no radius, except to walls; the robot is one more of them.  They stop within `ARRIVED` of
    their goal; people who stand do not move.

    Notes
    -----
    A person accelerates to their own speed within `RELAXATION_TIME`.  The interaction is along
    D = e - 2 (v - v'), e the direction away from the other person: with B = `REACH` |D| and theta the angle
    from e to D, it pushes with exp(-d/B - (3 B theta)^2) along D, and turns with exp(-d/B - (2 B theta)^2).
    """

    def __init__(self, walkers: Walkers) -> None:
        self._walkers = walkers
        self._velocities = walkers.velocities
        points = [_list_points(wall) for wall in walkers.walls]
        self._wall_points = np.vstack([np.zeros((0, 2)), *points])

    def velocities(self, positions: Array, robot: Array, dt: float) -> Array:
        """See `WalkingModel.velocities` for `positions`, `robot` and `dt`."""
        speeds = self._walkers.speeds[:, None]
        course, distance = _normalise(self._walkers.goals - positions)
        others = positions
        their_velocities = self._velocities
        if self._walkers.r_robot is not None:
            others = np.vstack([others, robot[:2]])
            their_velocities = np.vstack([their_velocities, robot[2:]])
        force = (course * speeds - self._velocities) / RELAXATION_TIME
        force += STRENGTH * _push_apart(
            positions[:, None] - others, self._velocities[:, None] - their_velocities
        )
        force += WALL_STRENGTH * self._push_from_walls(positions)
        desired = self._velocities + dt * force
        speed = _normalise(desired)[1]
        velocities = desired * np.minimum(1.0, speeds / np.maximum(speed, _SMALLEST))
        self._velocities = np.where(distance < ARRIVED, 0.0, velocities)
        return self._velocities

    def _push_from_walls(self, positions: Array) -> Array:
        away, distance = _normalise(positions[:, None] - self._wall_points)
        gap = distance - WALL_GAP
        push = np.where(gap < WALL_RANGE, np.exp(-gap / WALL_REACH), 0.0)
        return np.asarray((push * away).sum(axis=1))


def _push_apart(offset: Array, velocity: Array) -> Array:
    """Sum of the pushes by all others; offset and velocity relative to each, shape (n, m, 2); (n, 2)."""
    away, distance = _normalise(offset)
    along, size = _normalise(away - 2 * velocity)
    reach = REACH * np.maximum(size, _SMALLEST)
    left = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    # the angle from away to along, in [-pi, pi] in every frame
    theta = np.arctan2(-(left * away).sum(-1), (along * away).sum(-1))[..., None]
    push = np.exp(-distance / reach - (3 * reach * theta) ** 2)
    turn = np.sign(theta) * np.exp(-distance / reach - (2 * reach * theta) ** 2)
    return np.asarray((push * along - turn * left).sum(axis=1))


def _normalise(vectors: Array) -> tuple[Array, Array]:
    """Directions (..., 2), 0 of a vector without length, and lengths (..., 1)."""
    length = np.sqrt((vectors**2).sum(axis=-1, keepdims=True))
    return vectors / np.maximum(length, _SMALLEST), length


def _list_points(wall: Array) -> Array:
    """Points of a wall, `POINTS_PER_METRE` of them; a short wall is lengthened to `MIN_WALL_LENGTH`."""
    middle = wall.mean(axis=0)
    half = (wall[1] - wall[0]) / 2
    half *= max(1.0, MIN_WALL_LENGTH / (2 * np.hypot(*half)))
    first = middle - half
    last = middle + half
    return np.linspace(
        first, last, int(np.linalg.norm(first - last) * POINTS_PER_METRE)
    )


WALKING_MODELS: dict[str, ModelFactory] = {
    "orca": OrcaModel,
    "social force": SocialForceModel,
}
"""Models of walking, by name; "orca" needs the extra `crowds`."""
RobotAppearance = Literal["robot", "person", "nothing"]
MIN_HEADING_SPEED = 0.2  # slower people keep their last heading [m/s] (assumed)


@dataclass(frozen=True)
class ReactingPeople(CrowdModel):
    """People who walk by a model, each to their own goal: a `CrowdModel` for `drive` and `rollouts`.

    Parameters
    ----------
    model : a name in `WALKING_MODELS`, or a `ModelFactory`: a class or a function of a module that makes a
        `WalkingModel` from `Walkers`.
    sees : what people take the robot for: a disc of its radius, a person, or nothing (they do not see it).
    goals : goal of each person of the scenario, shape (n, 2) [m]; None: their position at the end of the
        scenario at constant velocity; people who stand stay.
    pace : speed of people who stand at first and have a goal [m/s] (paper, sec. 4); others keep their own.
    jitter : standard deviation of a random shift of each coordinate of the goals [m]. Without it two
        people who meet exactly head-on stop in front of each other.
    r_robot : radius of the robot [m].

    Raises
    ------
    SolverError : an unknown name, or a number that is negative or not finite.
    """

    model: str | ModelFactory
    sees: RobotAppearance = "robot"
    goals: tuple[tuple[float, float], ...] | None = None
    pace: float = 0.5
    jitter: float = 0.05
    r_robot: float = MPCSettings.r_robot

    def __post_init__(self) -> None:
        is_model = callable(self.model) or self.model in WALKING_MODELS
        expected = f"{', '.join(WALKING_MODELS)}, or make a model from walkers"
        require(is_model, "model", self.model, expected, SolverError)
        appearances = get_args(RobotAppearance)
        expected = f"one of {', '.join(appearances)}"
        require(self.sees in appearances, "sees", self.sees, expected, SolverError)
        for name in ("pace", "jitter", "r_robot"):
            value = getattr(self, name)
            require(0 <= value < np.inf, name, value, "finite and >= 0", SolverError)

    def start(self, scenario: Scenario, seed: int) -> Crowd:
        """The people of a `scenario` from time 0 on, with goals shifted by the `seed`.

        The crowd must be asked for increasing times, as the closed loop does.

        Raises
        ------
        SolverError : the model's package is missing, the number of goals is not that of people, or time
            decreases.
        """
        people = scenario.people
        appearance = {"robot": self.r_robot, "person": BODY_RADIUS, "nothing": None}
        states = np.reshape([(*p.position, *p.velocity) for p in people], (-1, 4))
        positions = states[:, :2]
        velocities = states[:, 2:]
        speeds = np.hypot(*velocities.T)
        if self.goals is not None:
            speeds = np.where(speeds > 0, speeds, self.pace)
        walkers = Walkers(
            positions,
            velocities,
            goals=self._shift_goals(scenario, np.random.default_rng([seed, 3])),
            speeds=speeds,
            walls=scenario.walls,
            r_robot=appearance[self.sees],
        )
        make_model = self.model if callable(self.model) else WALKING_MODELS[self.model]
        return _ReactingCrowd(people, walkers, make_model(walkers))

    def _shift_goals(self, scenario: Scenario, rng: np.random.Generator) -> Array:
        people = scenario.people
        goals = self.goals
        if goals is None:
            goals = tuple(p.after(scenario.duration).position for p in people)
        expected = f"a goal for each of {len(people)} people"
        require(len(goals) == len(people), "goals", goals, expected, SolverError)
        shift = rng.normal(0.0, self.jitter, (len(people), 2))
        if self.goals is None:
            shift[[person.stands for person in people]] = 0.0
        return check_array("goals", np.reshape(goals, (-1, 2)), shift.shape) + shift


class _ReactingCrowd:
    """A crowd that walks: people decide from the robot's present state, and move for `dt`."""

    def __init__(
        self, people: tuple[Person, ...], walkers: Walkers, model: WalkingModel
    ) -> None:
        self._people = people
        self._model = model
        self._positions = walkers.positions.copy()
        self._time = 0.0
        self._robot = np.zeros(4)

    def __call__(self, t: float, robot: Array) -> tuple[Person, ...]:
        if t < self._time:
            raise SolverError(
                f"the time of a crowd cannot decrease: it is {self._time} s; got {t} s"
            )
        if t > self._time and self._people:
            dt = round(t - self._time, 9)
            velocities = self._model.velocities(self._positions, self._robot, dt)
            self._positions += dt * velocities
            motions = zip(self._positions.tolist(), velocities.tolist(), strict=True)
            people = []
            for person, (position, velocity) in zip(self._people, motions, strict=True):
                heading = person.heading
                if hypot(*velocity) >= MIN_HEADING_SPEED:
                    heading = atan2(velocity[1], velocity[0])
                people.append(
                    replace(
                        person,
                        position=position,
                        velocity=velocity,
                        heading=heading,
                        heading_unknown=heading is None,
                        prediction=None,
                    )
                )
            self._people = tuple(people)
        self._time = t
        self._robot = np.array(robot, float)
        return self._people

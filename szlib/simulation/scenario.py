"""Scenarios: where the robot, people and walls are, what the paper claims, and how people move.

World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from math import atan2, cos, hypot, pi, sin
from typing import Any, Protocol

import numpy as np

from ..control.obstacles import Obstacle, Wall, check_wall
from ..control.people import Person
from ..core.checks import Array, check_array, require
from ..core.errors import SolverError

GOAL_RADIUS = 0.1  # the robot has arrived within this distance of the goal [m], when it has stopped (assumed)
# Below this speed the robot stands; below this progress to the goal it yields [m/s] (assumed).
STOPPED_SPEED = 0.05

Crowd = Callable[[float, Array], Sequence[Person | None]]
"""The true people at a time [s], given the robot's state (x, y, vx, vy) at that time.

The number and the order of people never change; None stands for a person who is absent.  The loop calls it
once a step, at 0, dt, 2 dt, ..., so that a crowd may advance with each call.
"""


@dataclass(frozen=True)
class Claim:
    """A claim of the paper about a scenario, and its check.

    Parameters
    ----------
    text : the claim.
    check : function of a `Run` of the scenario; returns whether the claim holds, and the number that decides.
    """

    text: str
    check: Callable[[Any], tuple[bool, float]]


@dataclass(frozen=True)
class Scenario:
    """A scene: the robot's start and goal, people, walls, and other obstacles.

    Parameters
    ----------
    name : short name.
    start : (x, y, vx, vy) of the robot [m, m/s].
    goal : (x, y) [m].
    people : all people, at time 0.
    walls : segments, shape (n, 2, 2) [m].
    claims : what the paper claims of it.
    title : title of its figures.
    duration : time limit of a run [s].
    obstacles : what else stands still, such as a `HalfPlane`.

    Raises
    ------
    SolverError : a number is not finite, a shape is wrong, or a wall has no length.

    Examples
    --------
    >>> import szlib
    >>> walls = [((-5.0, 2.0), (5.0, 2.0))]
    >>> person = szlib.Person((3.0, 0.0), velocity=(-0.5, 0.0))
    >>> szlib.Scenario("hall", (-4, 0, 0, 0), (4, 0), (person,), walls).walls.shape
    (1, 2, 2)
    """

    name: str
    start: Array
    goal: Array
    people: tuple[Person, ...] = ()
    walls: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))
    claims: tuple[Claim, ...] = ()
    title: str = ""
    duration: float = 60.0
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        arrays = {
            "start": check_array("start", self.start, (4,)),
            "goal": check_array("goal", self.goal, (2,)),
            "walls": np.array([check_wall(wall) for wall in self.walls]).reshape(
                -1, 2, 2
            ),
        }
        for name, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "people", tuple(self.people))
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        is_positive = 0 < self.duration < np.inf
        require(
            is_positive,
            "duration",
            self.duration,
            "a positive number of seconds",
            SolverError,
        )

    @property
    def fixed(self) -> tuple[Obstacle, ...]:
        """Everything that stands still: the walls, then the other obstacles."""
        walls = (Wall(*ends) for ends in self.walls.reshape(-1, 4).tolist())
        return (*walls, *self.obstacles)

    def turn_people(self) -> Scenario:
        """The same scene with all people facing the other way; people who walk then walk backwards."""
        people = tuple(
            p if p.heading is None else replace(p, heading=p.heading + pi)
            for p in self.people
        )
        return replace(self, people=people)


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
        plans = [
            (p, rng.uniform(*self.between), self.turn * rng.choice([-1, 1]))
            for p in people
        ]
        return lambda t, _: [self._locate(t, *plan) for plan in plans]

    def _locate(
        self, t: float, person: Person, change_time: float, turn: float
    ) -> Person:
        if t <= change_time or person.stands:
            return person.after(t)
        vx, vy = person.velocity
        heading = (atan2(vy, vx) if person.heading is None else person.heading) + turn
        speed = self.pace * hypot(vx, vy)
        velocity = (speed * cos(heading), speed * sin(heading))
        position = person.after(change_time).position
        return Person(position, velocity, heading, person.zone, person.id).after(
            t - change_time
        )

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

"""What a closed loop needs: a scene with its people and walls, what is claimed of it, and what people do.

World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from math import atan2, cos, hypot, pi, sin
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..checks import Array, check_array
from ..control.barriers import check_wall
from ..control.person import Person
from ..errors import SolverError

if TYPE_CHECKING:
    from .log import SimulationLog

GOAL_RADIUS = 0.1
"""The robot has arrived within this distance of the goal [m], when it has stopped (assumed)."""
STOPPED_SPEED = 0.05
"""Below this speed the robot stands, and below this progress to the goal it yields [m/s] (assumed)."""

Crowd = Callable[[float, Array], Sequence[Person | None]]
"""Everybody as they truly are, from the time [s] and the robot's state (x, y, vx, vy) then.

Always as many, in the same order; None for who is not there at that time. The loop asks once a step, at 0,
dt, 2 dt, ..., so that a crowd may move on with each call.
"""


@dataclass(frozen=True)
class Claim:
    """A sentence that the paper claims of a scenario, and the check of a run against it.

    `check(log)` returns whether it holds, and the figure that decides.
    """

    text: str
    check: Callable[[SimulationLog], tuple[bool, float]]


@dataclass(frozen=True)
class Scenario:
    """A scene: who is where, and what should happen.

    Parameters
    ----------
    name, title : short name, and the line above a figure.
    start : (x, y, vx, vy) of the robot [m, m/s].
    goal : (x, y) [m].
    people : everybody, at time 0.
    walls : segments, shape (n, 2, 2) [m].
    claims : what the paper says of it.
    duration : time after which a run that has not arrived is given up [s].

    Raises
    ------
    SolverError : a number is not finite, a shape is wrong, or a wall has no length.
    """

    name: str
    start: Array
    goal: Array
    people: tuple[Person, ...] = ()
    walls: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))
    claims: tuple[Claim, ...] = ()
    title: str = ""
    duration: float = 60.0

    def __post_init__(self) -> None:
        walls = np.array([check_wall(wall) for wall in self.walls]).reshape(-1, 2, 2)
        given = {
            "start": check_array("start", self.start, (4,)),
            "goal": check_array("goal", self.goal, (2,)),
            "walls": walls,
        }
        for name, value in given.items():
            frozen = value.copy()
            frozen.setflags(write=False)
            object.__setattr__(self, name, frozen)
        object.__setattr__(self, "people", tuple(self.people))
        if not 0 < self.duration < np.inf:
            raise SolverError(f"duration must be a positive number of seconds; got {self.duration}")

    def turn_people(self) -> Scenario:
        """The same place with everybody facing the other way; who walks, walks on backwards."""
        people = tuple(p if p.heading is None else replace(p, heading=p.heading + pi) for p in self.people)
        return replace(self, people=people)


class CrowdModel(Protocol):
    """What people do, and how the controller is given them: a `Behaviour`, or anything else with these two.

    The people of the scenario have the zones that are kept for them.
    """

    def crowd(self, scenario: Scenario, seed: int) -> Crowd:
        """Everybody of a scenario, from its start on."""

    def seen(self, people: tuple[Person, ...], rng: np.random.Generator) -> Sequence[Person | None]:
        """What the controller gets of those who are there, in their order; None for who is not seen."""


@dataclass(frozen=True)
class Behaviour:
    """What people do: walk on, unaffected by the robot (paper, sec. 4), or deviate from what is expected.

    Parameters
    ----------
    pace : factor of a walker's speed once they change their mind; 0 stops them.
    turn : by how much they turn then, to either side [rad].
    noise : standard deviation of the position that the controller is given, each coordinate [m].
    between : first and last time at which a walker changes their mind [s].

    All of them are assumed.

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
            value = np.asarray(getattr(self, each.name))
            if not (np.isfinite(value) & (value >= 0)).all():
                raise SolverError(f"{each.name} must be finite and >= 0; got {getattr(self, each.name)}")

    def crowd(self, scenario: Scenario, seed: int) -> Crowd:
        """Everybody's true motion from time 0 on; these people do not look at the robot."""
        people = scenario.people
        if self.pace == 1.0 and self.turn == 0.0:
            return lambda t, _: [person.after(t) for person in people]
        rng = np.random.default_rng([seed, 1])
        plans = [(p, rng.uniform(*self.between), self.turn * rng.choice([-1, 1])) for p in people]
        return lambda t, _: [self._at(t, *plan) for plan in plans]

    def _at(self, t: float, person: Person, when: float, turn: float) -> Person:
        if t <= when or person.stands:
            return person.after(t)
        vx, vy = person.velocity
        heading = (atan2(vy, vx) if person.heading is None else person.heading) + turn
        speed = self.pace * hypot(vx, vy)
        changed = (speed * cos(heading), speed * sin(heading))
        here = person.after(when).position
        return Person(here, changed, heading, person.zone, person.id).after(t - when)

    def seen(self, people: tuple[Person, ...], rng: np.random.Generator) -> tuple[Person, ...]:
        """Everybody as the controller is given them."""
        if self.noise == 0:
            return people
        off = rng.normal(0.0, self.noise, (len(people), 2)).tolist()
        return tuple(
            p.at((p.position[0] + dx, p.position[1] + dy)) for p, (dx, dy) in zip(people, off, strict=True)
        )


UNAFFECTED = Behaviour()
"""People who walk on at constant velocity, exactly seen (paper, sec. 4)."""

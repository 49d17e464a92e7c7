"""People who have somewhere to go, and who react to each other, to walls and to the robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import atan2, hypot
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np

from ...checks import Array, check_array
from ...control.person import BODY_RADIUS, Person
from ...control.settings import MPCSettings
from ...errors import SolverError
from ..scenario import Crowd, Scenario
from .orca import Orca
from .social_force import SocialForce
from .speed_model import SpeedModel
from .walking_model import Build, Model, Walkers

MODELS: Mapping[str, Build] = MappingProxyType(
    {"orca": Orca, "social force": SocialForce, "speed model": SpeedModel}
)
"""Models of walking, by name; the first two need the extra `crowds`, the third JuPedSim."""
Sees = Literal["robot", "person", "nothing"]
MIN_HEADING_SPEED = 0.2
"""Slower people keep the heading that they had [m/s] (assumed)."""


@dataclass(frozen=True)
class ReactingPeople:
    """People who walk by a model, each to their own goal: a behaviour for `simulate` and `rollouts`.

    Parameters
    ----------
    model : a name in `MODELS`.
    sees : what people take the robot for: a disc of its radius, a person, or nothing ("blind").
    goals : where each person of the scenario wants to go, shape (n, 2) [m]; None: to where they would be at
        the end of the scenario at constant velocity, and who stands stays there.
    pace : speed of who stands at first and has somewhere to go [m/s] (paper, sec. 4); others go at their own.
    jitter : goals are moved by so much, each coordinate, standard deviation, from the seed, or two people who
        meet exactly head-on stop in front of each other [m].
    r_robot : radius of the robot [m].

    Raises
    ------
    SolverError : an unknown name, or a number that is negative or not finite.
    """

    model: str
    sees: Sees = "robot"
    goals: tuple[tuple[float, float], ...] | None = None
    pace: float = 0.5
    jitter: float = 0.05
    r_robot: float = MPCSettings.r_robot

    def __post_init__(self) -> None:
        for name, known in (("model", tuple(MODELS)), ("sees", get_args(Sees))):
            if getattr(self, name) not in known:
                raise SolverError(f"{name} must be one of {', '.join(known)}; got {getattr(self, name)!r}")
        for name in ("pace", "jitter", "r_robot"):
            if not 0 <= getattr(self, name) < np.inf:
                raise SolverError(f"{name} must be finite and >= 0; got {getattr(self, name)}")

    def crowd(self, scenario: Scenario, seed: int) -> Crowd:
        """Everybody's motion from time 0 on; asked for later and later times, as the closed loop does.

        Raises SolverError where the model's package is missing, goals and people do not go together, or time
        goes back.
        """
        people = scenario.people
        r_robot = {"robot": self.r_robot, "person": BODY_RADIUS, "nothing": None}[self.sees]
        goals = self._goals(scenario, np.random.default_rng([seed, 3]))
        velocities = np.array([p.velocity for p in people]).reshape(-1, 2)
        paces = np.hypot(*velocities.T)
        if self.goals is not None:
            paces = np.where(paces > 0, paces, self.pace)
        positions = np.array([p.position for p in people]).reshape(-1, 2)
        walkers = Walkers(positions, velocities, goals, paces, scenario.walls, r_robot)
        return _Walking(people, walkers, MODELS[self.model](walkers))

    def seen(self, people: tuple[Person | None, ...], rng: np.random.Generator) -> tuple[Person | None, ...]:
        """Everybody as the controller is given them: as they are."""
        return people

    def _goals(self, scenario: Scenario, rng: np.random.Generator) -> Array:
        people = scenario.people
        if self.goals is None:
            goals = [person.after(scenario.duration).position for person in people]
        else:
            goals = list(self.goals)
        if len(goals) != len(people):
            raise SolverError(f"{len(people)} people need a goal each; got {len(goals)}")
        exact = check_array("goals", np.reshape(goals, (-1, 2)), (len(people), 2))
        stay = np.array([self.goals is None and person.stands for person in people], bool)
        moved = rng.normal(0.0, self.jitter, exact.shape)
        return exact + np.where(stay[:, None], 0.0, moved)


class _Walking:
    """A crowd on its way: people decide from what they see of the robot now, and are there `dt` later."""

    def __init__(self, people: tuple[Person, ...], walkers: Walkers, model: Model) -> None:
        self._people, self._model = people, model
        self._positions = walkers.positions.copy()
        self._time, self._robot = 0.0, np.zeros(4)

    def __call__(self, t: float, robot: Array) -> tuple[Person, ...]:
        if t < self._time:
            raise SolverError(f"a crowd that reacts only goes on: it is at {self._time} s, and got {t} s")
        if t > self._time and self._people:
            dt = round(t - self._time, 9)
            velocities = self._model.velocities(self._positions, self._robot, dt)
            self._positions += dt * velocities
            pairs = zip(self._people, self._positions.tolist(), velocities.tolist(), strict=True)
            self._people = tuple(_moved(*each) for each in pairs)
        self._time, self._robot = t, np.array(robot, float)
        return self._people


def _moved(person: Person, at: list[float], velocity: list[float]) -> Person:
    """The person elsewhere, facing where they walk, or below `MIN_HEADING_SPEED` where they faced."""
    (x, y), (vx, vy) = at, velocity
    heading = atan2(vy, vx) if hypot(vx, vy) >= MIN_HEADING_SPEED else person.heading
    return replace(
        person, position=(x, y), velocity=(vx, vy), heading=heading, heading_unknown=heading is None
    )

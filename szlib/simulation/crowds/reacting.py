"""People with goals, who react to each other, to walls and to the robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import atan2, hypot
from typing import Literal, get_args

import numpy as np

from ...control.people import Person
from ...control.settings import MPCSettings
from ...core.checks import Array, check_array, require
from ...core.errors import SolverError
from ...zones.ellipses import BODY_RADIUS
from ..scenario import Crowd, CrowdModel, Scenario
from .orca import OrcaModel
from .social_force import SocialForceModel
from .walking_model import ModelFactory, Walkers, WalkingModel

MODELS: Mapping[str, ModelFactory] = {
    "orca": OrcaModel,
    "social force": SocialForceModel,
}
"""Models of walking, by name; they need the extra `crowds`."""
RobotAppearance = Literal["robot", "person", "nothing"]
MIN_HEADING_SPEED = 0.2  # slower people keep their last heading [m/s] (assumed)


@dataclass(frozen=True)
class ReactingPeople(CrowdModel):
    """People who walk by a model, each to their own goal: a `CrowdModel` for `drive` and `rollouts`.

    Parameters
    ----------
    model : a name in `MODELS`, or a `ModelFactory` of `szlib.simulation.crowds.walking_model`: a class or a
        function of a module that makes a `WalkingModel` from `Walkers`.
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
        models, appearances = ", ".join(MODELS), get_args(RobotAppearance)
        is_model = callable(self.model) or self.model in MODELS
        require(
            is_model,
            "model",
            self.model,
            f"{models}, or make a model from walkers",
            SolverError,
        )
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
        r_robot = {"robot": self.r_robot, "person": BODY_RADIUS, "nothing": None}[
            self.sees
        ]
        goals = self._shifted_goals(scenario, np.random.default_rng([seed, 3]))
        velocities = np.array([p.velocity for p in people]).reshape(-1, 2)
        speeds = np.hypot(*velocities.T)
        if self.goals is not None:
            speeds = np.where(speeds > 0, speeds, self.pace)
        positions = np.array([p.position for p in people]).reshape(-1, 2)
        walkers = Walkers(positions, velocities, goals, speeds, scenario.walls, r_robot)
        make_model = self.model if callable(self.model) else MODELS[self.model]
        return _ReactingCrowd(people, walkers, make_model(walkers))

    def _shifted_goals(self, scenario: Scenario, rng: np.random.Generator) -> Array:
        people = scenario.people
        if self.goals is None:
            goals = [person.after(scenario.duration).position for person in people]
        else:
            goals = list(self.goals)
        if len(goals) != len(people):
            raise SolverError(
                f"expected a goal for each of {len(people)} people; got {len(goals)}"
            )
        unshifted = check_array("goals", np.reshape(goals, (-1, 2)), (len(people), 2))
        stay = np.array(
            [self.goals is None and person.stands for person in people], bool
        )
        shift = rng.normal(0.0, self.jitter, unshifted.shape)
        return unshifted + np.where(stay[:, None], 0.0, shift)


class _ReactingCrowd:
    """A crowd that walks: people decide from the robot's present state, and move for `dt`."""

    def __init__(
        self, people: tuple[Person, ...], walkers: Walkers, model: WalkingModel
    ) -> None:
        self._people, self._model = people, model
        self._positions = walkers.positions.copy()
        self._time, self._robot = 0.0, np.zeros(4)

    def __call__(self, t: float, robot: Array) -> tuple[Person, ...]:
        if t < self._time:
            raise SolverError(
                f"the time of a crowd cannot decrease: it is {self._time} s; got {t} s"
            )
        if t > self._time and self._people:
            dt = round(t - self._time, 9)
            velocities = self._model.velocities(self._positions, self._robot, dt)
            self._positions += dt * velocities
            pairs = zip(
                self._people, self._positions.tolist(), velocities.tolist(), strict=True
            )
            self._people = tuple(_move(*each) for each in pairs)
        self._time, self._robot = t, np.array(robot, float)
        return self._people


def _move(person: Person, at: list[float], velocity: list[float]) -> Person:
    """The person at another position; below `MIN_HEADING_SPEED` they keep their heading."""
    (x, y), (vx, vy) = at, velocity
    heading = atan2(vy, vx) if hypot(vx, vy) >= MIN_HEADING_SPEED else person.heading
    return replace(
        person,
        position=(x, y),
        velocity=(vx, vy),
        heading=heading,
        heading_unknown=heading is None,
    )

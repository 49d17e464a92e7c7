"""The scene of the laboratory, and a robot in it for each choice of settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import cos, degrees, radians, sin
from typing import Any

import numpy as np

from ...checks import Array, check_array
from ...control.barriers import check_wall
from ...control.mpc import MPCCBF
from ...control.people import Person
from ...control.settings import MPCSettings
from ...control.step import Step
from ...errors import SolverError
from ...simulation.closed_loop import advance
from ...simulation.scenario import Scenario
from ...zones.ellipses import Ellipse


@dataclass(frozen=True)
class Choice:
    """What is set for one robot.

    Parameters
    ----------
    gamma, N_h, a_max : as of `MPCSettings`; a plan is as long as N_h where that is longer than its default.
    size : the zone is so many times as large.
    estimator : by which the zone was found: a name among those of the bench.
    """

    gamma: float = 0.05
    N_h: int = 2
    a_max: float = 1.0
    size: float = 1.0
    estimator: str = "quantile"

    def settings(self) -> MPCSettings:
        """The controller's; SolverError for a value out of its range."""
        N = max(self.N_h, MPCSettings().N)
        return MPCSettings(gamma=self.gamma, N=N, N_h=self.N_h, a_max=self.a_max)

    def zone(self, zones: Mapping[str, Ellipse]) -> Ellipse:
        """The zone that is kept, in the person's frame; SolverError for an estimator that is not there."""
        if self.estimator not in zones:
            raise SolverError(f"estimator must be one of {', '.join(zones)}; got {self.estimator!r}")
        return zones[self.estimator].scaled(self.size)


class Bench:
    """One scene, and in it a robot for each choice, which do not see each other.

    Parameters
    ----------
    scenario : where everything begins.
    zones : a zone for each estimator, in the person's frame.
    choices : of each robot.

    Raises
    ------
    SolverError : a choice is out of its range.
    """

    def __init__(self, scenario: Scenario, zones: Mapping[str, Ellipse], choices: Sequence[Choice]) -> None:
        self.scenario, self.zones = scenario, dict(zones)
        self.choices = list(choices)
        self._controllers = [self._controller(choice) for choice in choices]
        self.restart()

    def _controller(self, choice: Choice) -> MPCCBF:
        zone = choice.zone(self.zones)
        return MPCCBF(zone, walls=self.scenario.walls, settings=choice.settings())

    def restart(self) -> None:
        """Robots and people are where they began."""
        self._step, self._put = 0, (0, list(self.scenario.people))
        self.states: list[Array] = [self.scenario.start.copy() for _ in self.choices]
        for controller in self._controllers:
            controller.reset()

    @property
    def t(self) -> float:
        """Time since everything began [s]."""
        return self._step * self._controllers[0].settings.dt

    @property
    def people(self) -> list[Person]:
        """Everybody as they are now."""
        when, people = self._put
        return [p.after((self._step - when) * self._controllers[0].settings.dt) for p in people]

    def choose(self, robot: int, **changed: Any) -> None:
        """Set something for one robot: names of `Choice`."""
        choice = replace(self.choices[robot], **changed)
        self._controllers[robot], self.choices[robot] = self._controller(choice), choice

    def move(
        self,
        *,
        goal: Sequence[float] | None = None,
        people: Mapping[int, Sequence[float]] | None = None,
        walls: Sequence[Sequence[float]] | None = None,
        speed: float | None = None,
    ) -> None:
        """Put something elsewhere: the goal, people by number, all walls [m]; or set people's speed [m/s].

        Before the first step that is where they begin.  Raises SolverError for what is no place, and then
        everything stays.
        """
        moved = self.people
        for i, place in (people or {}).items():
            x, y = check_array("a person's position", place, (2,)).tolist()
            moved[i] = replace(moved[i], position=(x, y))
        if speed is not None:
            moved = [_walking(person, speed) for person in moved]
        segments = [np.reshape(wall, (2, 2)) for wall in (self.scenario.walls if walls is None else walls)]
        changed = replace(
            self.scenario,
            goal=self.scenario.goal if goal is None else check_array("goal", goal, (2,)),
            walls=np.reshape([check_wall(wall) for wall in segments], (-1, 2, 2)),
            people=tuple(moved) if self._step == 0 else self.scenario.people,
        )
        if walls is not None:
            for controller in self._controllers:
                controller.set_walls(changed.walls)
        if speed is not None:
            changed = replace(changed, people=tuple(_walking(p, speed) for p in changed.people))
        self.scenario, self._put = changed, (self._step, moved)

    def look(self) -> list[Step]:
        """What each robot decides now."""
        pairs, people = zip(self._controllers, self.states, strict=True), self.people
        return [controller.step(state, self.scenario.goal, people) for controller, state in pairs]

    def step(self) -> list[Step]:
        """What each robot decides now; then dt passes."""
        steps, dt = self.look(), self._controllers[0].settings.dt
        self.states = [advance(x, step.control, dt) for x, step in zip(self.states, steps, strict=True)]
        self._step += 1
        return steps

    def cell(self) -> str:
        """The parameter cell that begins with this scene and these choices."""
        lines = [f"goal = {self.scenario.goal.round(2).tolist()}  # x, y [m]"]
        for person in self.scenario.people[:1]:
            facing = degrees(person.heading or 0.0)
            place = [round(number, 2) for number in (*person.position, facing)]
            lines.append(f"person = {place}  # x, y [m], walks towards [deg]")
            lines.append(f"speed = {round(float(np.hypot(*person.velocity)), 2)}  # of the person [m/s]")
        lines.append(
            f"walls = {self.scenario.walls.round(2).reshape(-1).tolist()}  # xa, ya, xb, yb of each [m]"
        )
        for choice, suffix in zip(self.choices, ("", "_b"), strict=False):
            lines += [f"{name}{suffix} = {value!r}" for name, value in asdict(choice).items()]
        return "\n".join(lines)


def scene(
    goal: Sequence[float],
    person: Sequence[float],
    speed: float,
    walls: Sequence[float],
    start: Sequence[float],
) -> Scenario:
    """The scene of a parameter cell: see `Bench.cell`; the robot begins at rest at `start`, (x, y) [m]."""
    x, y, facing = person
    who = _walking(Person((x, y), heading=radians(facing)), speed)
    there = np.reshape(np.asarray(walls, float), (-1, 2, 2))
    begin = np.array([*start, 0.0, 0.0])
    return Scenario("laboratory", begin, np.asarray(goal, float), (who,), there, title="The laboratory")


def _walking(person: Person, speed: float) -> Person:
    heading = person.heading or 0.0
    return replace(person, velocity=(speed * cos(heading), speed * sin(heading)), heading=heading)

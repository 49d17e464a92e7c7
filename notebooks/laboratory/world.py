"""The world of the laboratory: a scene, one or two robots in it, and every change that a user made.

Each change begins a new run from the instant on the screen: the controllers forget their last plans. So a run
is known by its beginning and its number of steps. It can be computed again, which is how the world goes back
in time, and be written as a few lines of code, which is how it is shared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, hypot, sin
from typing import Any, NamedTuple

import numpy as np

import szlib
from szlib.control.controller import advance
from szlib.core.checks import Array, check_array, check_number, require
from szlib.simulation.scenario import GOAL_RADIUS, STOPPED_SPEED

_TWO_DOORS = szlib.Scenario(
    "two_doors",
    start=np.array([-3.0, 0.0, 0.0, 0.0]),
    goal=np.array([6.0, 0.0]),
    people=(szlib.Person((2.0, 0.0), heading=np.pi),),
    walls=np.array(
        [
            [(-4.0, -2.0), (7.0, -2.0)],
            [(-4.0, 5.2), (7.0, 5.2)],
            [(2.0, -2.0), (2.0, -0.9)],
            [(2.0, 0.9), (2.0, 2.4)],
            [(2.0, 4.2), (2.0, 5.2)],
        ]
    ),
    title="Two doors: a person stands in the nearer one",
)
PRESETS: dict[str, szlib.Scenario] = {**szlib.SCENARIOS, **szlib.MEETINGS, _TWO_DOORS.name: _TWO_DOORS}
"""The scenes to begin with, by name: the scenarios of the paper, the meetings, and two doors."""
CONSTRUCTORS: dict[str, Callable[..., szlib.MPCSettings]] = {
    "MPCSettings": szlib.MPCSettings,
    "MPCSettings.paper": szlib.MPCSettings.paper,
    "MPCSettings.among_people": szlib.MPCSettings.among_people,
}
"""The settings to begin with, by the name of their constructor in szlib."""
# Lowest and highest value of each setting that can be changed; longer horizons take seconds to build.
LIMITS = {"N": (1, 40), "N_h": (1, 40), "gamma": (0.001, 1), "v_max": (0.05, 3)}
_SPEEDS = (0, 3)  # of people [m/s]
_FARTHEST = 100  # largest coordinate [m]
_MOST = {"people": 12, "walls": 50}  # for more, solvers take seconds to build


@dataclass(frozen=True)
class RobotOptions:
    """The settings of one robot.

    Parameters
    ----------
    constructor : a key of `CONSTRUCTORS`.
    changes : values of N, N_h, gamma and v_max that differ from those of the constructor.

    Raises
    ------
    SolverError : there is no such constructor or setting, or a value is out of range.
    """

    constructor: str = "MPCSettings"
    changes: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names, settings = ", ".join(CONSTRUCTORS), ", ".join(LIMITS)
        require(
            self.constructor in CONSTRUCTORS,
            "constructor",
            self.constructor,
            f"one of {names}",
            szlib.SolverError,
        )
        for name, value in self.changes.items():
            require(name in LIMITS, "a setting", name, f"one of {settings}", szlib.SolverError)
            _check_range(name, value, *LIMITS[name])

    @property
    def settings(self) -> szlib.MPCSettings:
        """The settings of the controller."""
        return CONSTRUCTORS[self.constructor](**self.changes)

    @property
    def code(self) -> str:
        """The Python expression of the settings."""
        changes = ", ".join(f"{name}={value!r}" for name, value in self.changes.items())
        return f"szlib.{self.constructor}({changes})"


class Beginning(NamedTuple):
    """The beginning of a run.

    Attributes
    ----------
    n : number of time steps before it.
    scenario : its people, goal and walls.
    robots : the settings of each robot.
    states : the state of each robot (x, y, vx, vy), in order [m, m/s].
    """

    n: int
    scenario: szlib.Scenario
    robots: tuple[RobotOptions, ...]
    states: tuple[Array, ...]


class World:
    """A scene with one or two robots, which do not see each other.

    Parameters
    ----------
    scenario : the scene at the start.
    zone : the zone of people, in their own frame [m].
    robots : the settings of each robot.

    Attributes
    ----------
    n : number of time steps since the start.
    dt : time step [s].
    states : the state of each robot now (x, y, vx, vy) [m, m/s].
    steps : what each controller decided now.

    Raises
    ------
    SolverError : a setting is out of its range.

    Examples
    --------
    >>> import szlib
    >>> from laboratory import World
    >>> world = World(szlib.SCENARIOS["corridor"], szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> world.advance()
    >>> world.n, [step.safe for step in world.steps]
    (1, [True])
    """

    def __init__(
        self,
        scenario: szlib.Scenario,
        zone: szlib.Ellipse,
        robots: Sequence[RobotOptions] = (RobotOptions(),),
    ) -> None:
        self.zone, self._controllers = zone, dict[tuple[int, szlib.MPCSettings], szlib.MPCCBF]()
        robots = tuple(robots)
        self._runs = [Beginning(0, scenario, robots, (scenario.start,) * len(robots))]
        self._begin()

    def _begin(self) -> None:
        """Begin the last run, with controllers that remember nothing."""
        self.n, self.scenario, self.robots, states = self._runs[-1]
        earlier, self._controllers = self._controllers, {}
        for key in enumerate(options.settings for options in self.robots):
            controller = earlier.get(key) or szlib.MPCCBF(self.zone, settings=key[1])
            controller.set_walls(self.scenario.walls)
            controller.reset()
            self._controllers[key], self.dt = controller, controller.settings.dt
        self.states = list(states)
        self._decide()

    def _decide(self) -> None:
        robots = zip(self._controllers.values(), self.states, strict=True)
        self.steps = [robot.step(state, self.scenario.goal, self.people) for robot, state in robots]

    @property
    def people(self) -> tuple[szlib.Person, ...]:
        """The people now."""
        time = (self.n - self._runs[-1].n) * self.dt
        return tuple(person.after(time) for person in self.scenario.people)

    @property
    def arrived(self) -> bool:
        """True if every robot rests at the goal."""
        offsets = [state - [*self.scenario.goal, 0, 0] for state in self.states]
        return all(hypot(x, y) <= GOAL_RADIUS and hypot(*v) <= STOPPED_SPEED for x, y, *v in offsets)

    def advance(self) -> None:
        """Let one time step pass."""
        robots = zip(self.states, self.steps, strict=True)
        self.states = [advance(state, step.control, self.dt) for state, step in robots]
        self.n += 1
        self._decide()

    def rewind(self, n: int) -> None:
        """Go back to the time after `n` steps, by computing its run again; SolverError if it is not there."""
        require(isinstance(n, int) and 0 <= n <= self.n, "n", n, f"0 to {self.n}", szlib.SolverError)
        self._runs = [run for run in self._runs if run.n <= n]
        self._begin()
        while self.n < n:
            self.advance()

    def change(
        self,
        *,
        people: Mapping[Any, Mapping[str, Any] | None] | None = None,
        robots: Sequence[RobotOptions] | None = None,
        start: Sequence[float] | None = None,
        goal: Sequence[float] | None = None,
        walls: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Change the world, from this instant on.

        Parameters
        ----------
        people : index -> new position (x, y) [m], heading [rad] and speed [m/s], those that change; None for
            a person who leaves. The index after the last is that of a new person.
        robots : the settings of each robot, one or two.
        start : where the robots are put, at rest (x, y) [m].
        goal : (x, y) [m].
        walls : all walls, each with two ends (xa, ya, xb, yb) [m].

        Raises
        ------
        SolverError : a value is invalid. Then nothing has changed.
        """
        runs, n = self._runs, self.n
        changed: dict[str, Any] = {"people": _edit_people(self.people, people or {})}
        if goal is not None:
            changed["goal"] = _check_places("goal", goal, (2,))
        if walls is not None:
            changed["walls"] = _check_places("walls", np.reshape(walls, (-1, 4)), (..., 4)).reshape(-1, 2, 2)
        robots, states = tuple(robots or self.robots), self.states
        if start is not None:
            states = [np.array([*_check_places("start", start, (2,)), 0, 0])]
        states = [*states, *states][: len(robots)]  # a robot that is added begins beside the first
        for name in _MOST:
            _check_range(f"the number of {name}", len(changed.get(name, ())), 0, _MOST[name])
        _check_range("the number of robots", len(robots), 1, 2)
        begun = Beginning(n, replace(self.scenario, **changed), robots, tuple(states))
        try:
            self._runs = [*(run for run in runs if run.n < n), begun]
            self._begin()
        except Exception:
            self._runs = runs
            self.rewind(n)
            raise

    def code(self) -> str:
        """Python code that computes what is on the screen: the run since the last change, to this instant."""
        begun, zone = self._runs[-1], self.zone
        people = [_person_code(person) for person in self.scenario.people]
        walls = [tuple(map(tuple, wall)) for wall in self.scenario.walls.tolist()]
        lines = [
            "import szlib",
            "from szlib.simulation import LoopSettings, drive",
            "",
            f"zone = szlib.{zone!r}",
        ]
        for name, values in (("people", people), ("walls", map(repr, walls))):
            lines += [f"{name} = [", *(f"    {value}," for value in values), "]"]
        lines += [f"goal = {self.scenario.goal.tolist()}"]
        time = f"max_time={(self.n - begun.n) * self.dt:.1f}"
        lines += [f"loop = LoopSettings({time}, until_arrival=False)", ""]
        for end, options, state in zip(("", "_b"), begun.robots, begun.states, strict=False):
            scene = f"{self.scenario.name!r}, {state.tolist()}, goal, people, walls"
            lines += [
                f"scenario{end} = szlib.Scenario({scene})",
                f"settings{end} = {options.code}",
                f"controller{end} = szlib.MPCCBF(zone, walls=walls, settings=settings{end})",
                f"log{end} = drive(scenario{end}, controller{end}, loop)",
                f"print(log{end}.controls[-1])  # acceleration of the robot on the screen [m/s2]",
                "",
            ]
        return "\n".join([*lines, "log.plot()", "# Laboratory(scenario, zone=zone)  # opens it here again"])


def _edit_people(
    people: Sequence[szlib.Person], edits: Mapping[Any, Mapping[str, Any] | None]
) -> tuple[szlib.Person, ...]:
    """The `people` after the `edits` of `World.change`."""
    edited = dict(enumerate(people))
    for key, edit in edits.items():
        index = int(key)
        _check_range("the number of a person", index, 0, len(people))
        if edit is None:
            del edited[index]
            continue
        person = edited.get(index, szlib.Person((0.0, 0.0), heading=0.0))
        position = _check_places("a person's position", edit.get("position", person.position), (2,))
        velocity, heading = person.velocity, person.heading
        if "heading" in edit or "speed" in edit:
            speed = edit.get("speed", hypot(*velocity))
            _check_range("speed", speed, *_SPEEDS)
            heading = check_number("heading", edit.get("heading", heading or 0.0))
            velocity = (speed * cos(heading), speed * sin(heading))
        x, y = position.tolist()
        edited[index] = replace(person, position=(x, y), velocity=velocity, heading=heading)
    return tuple(edited.values())


def _check_range(name: str, value: Any, low: float, high: float) -> None:
    expected = f"{low:g} to {high:g}"
    require(low <= check_number(name, value) <= high, name, value, expected, szlib.SolverError)


def _check_places(name: str, value: Any, shape: tuple[Any, ...]) -> Array:
    """`check_array`, within reach."""
    places = check_array(name, value, shape)
    largest = float(np.abs(places).max(initial=0.0))
    _check_range(f"the largest coordinate of {name}", largest, 0, _FARTHEST)
    return places


def _person_code(person: szlib.Person) -> str:
    zone = "" if person.zone is None else f", zone=szlib.{person.zone!r}"
    return f"szlib.Person({person.position}, {person.velocity}, heading={person.heading!r}{zone})"

"""The closed loop: a robot with any controller, among people who walk on, change their velocity, or react.

The robot is the double integrator of the paper (eq. 8), unless the controller has another one.  People
walk at constant velocity, unaffected by the robot (paper, sec. 4), unless a `CrowdModel` or a `Crowd`
moves them.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter
from typing import Any

import numpy as np

from ..control import Controller, MPCSettings, Obstacle, Person, as_controller
from ..control.people import SpeedZone, as_ellipse
from ..core.checks import Array, check_array, require
from ..core.errors import SolverError
from ..zones.ellipses import BODY_RADIUS, Ellipse, circle_around
from .crowds import UNAFFECTED, Crowd, CrowdModel
from .log import SimulationLog
from .scenario import GOAL_RADIUS, STOPPED_SPEED, Scenario

# Makes the zone that the robot keeps out of from a person's own zone.
ZoneTransform = Callable[[Ellipse], Ellipse]

# Zone of people if neither they nor the controller have one: their body.
BODY_ZONE = Ellipse((0.0, 0.0), (BODY_RADIUS, BODY_RADIUS))
_ABSENT = [np.nan] * 5
# What the log keeps of each step, as of `szlib.Step`, and its value if a controller does not report it.
# The step itself is not kept: a thousand of them cost a garbage collection.
_UNREPORTED = {
    "predicted": np.zeros((0, 4)),
    "residual": None,
    "status": "",
    "safe": None,
    "slack": np.nan,
    "stuck": 0.0,
    "solve_time": None,
}


@dataclass(frozen=True)
class LoopSettings:
    """How the loop runs: who moves the people, who measures, and when it ends.

    Parameters
    ----------
    behaviour : how people move and how the controller sees them.
    crowd : the true people, in place of those of `behaviour`, which then only decides whom the controller
        sees. If the scenario has people, the crowd must have as many, and their zones apply; else each person
        has the zone with which they first appear.
    seed : seed of the behaviour.
    zone_transform : makes the zone that the robot keeps out of from each person's own zone, or the
        controller's, or `BODY_ZONE`; from the smallest circle around it for a person without a heading.
    settings : settings of the measurements (dt, r_robot, eps, zone_speed); None: the controller's.
    max_time : time limit [s]; None: the scenario's duration.
    until_arrival : False: run to the time limit, so that a robot at its goal may still have to make room.

    Examples
    --------
    >>> import szlib
    >>> from szlib.simulation.closed_loop import drive
    >>> controller = szlib.MPCCBF(szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7)))
    >>> run = drive(szlib.SCENARIOS["passing"], controller, szlib.LoopSettings(max_time=1.0))
    >>> run.metrics()["infeasible_steps"]
    0
    """

    behaviour: CrowdModel = UNAFFECTED
    crowd: Crowd | None = None
    seed: int = 0
    zone_transform: ZoneTransform | None = None
    settings: MPCSettings | None = None
    max_time: float | None = None
    until_arrival: bool = True


def simulate(
    scenario: Scenario,
    controller: Controller,
    *,
    crowd: Crowd | None = None,
    max_time: float | None = None,
) -> SimulationLog:
    """Run a scenario until the robot rests at the goal, or until the time limit.

    The loop resets the controller first, so that the same scenario gives the same run.  Each row of the log,
    also the last one, has the control that is decided in its state.

    Parameters
    ----------
    scenario : the scene.
    controller : an `MPCCBF`, or any other `szlib.control.Controller`.
    crowd : the true people as a function of time and the robot's state (`szlib.simulation.Crowd`);
        default: the scenario's people, who walk on.
    max_time : time limit [s]; default: the scenario's duration.

    Raises
    ------
    SolverError : `scenario` is no `Scenario`, or the controller has other walls or obstacles, or gives a
        control that cannot be used. For an `MPCCBF` also: the start violates a barrier or the speed limit, or
        the goal cannot be reached, because it lies too close to a wall or in the zone of a person who stands.

    Examples
    --------
    >>> import szlib
    >>> scenario = szlib.SCENARIOS["corridor"]
    >>> zone = szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))
    >>> log = szlib.simulate(scenario, szlib.MPCCBF(zone, walls=scenario.walls))
    >>> log.success, log.metrics()["passing_side"]
    (True, 'right')
    """
    is_one = isinstance(scenario, Scenario)
    require(
        is_one, "scenario", scenario, "a Scenario, as in szlib.SCENARIOS", SolverError
    )
    controller = as_controller(controller)
    if controller.walls is not None and not np.array_equal(
        controller.walls, scenario.walls
    ):
        raise SolverError(
            f"the controller knows {len(controller.walls)} walls, and not the {len(scenario.walls)} of "
            f"{scenario.name!r}; build it with walls=scenario.walls"
        )
    known = controller.obstacles
    if known is not None and _list_numbers(known) != _list_numbers(scenario.obstacles):
        raise SolverError(
            f"the controller knows other obstacles than {scenario.name!r}: {list(known)}, and not "
            f"{list(scenario.obstacles)}; build it with obstacles=scenario.obstacles"
        )
    try:
        controller.check_start(
            scenario.start, scenario.goal, scenario.people if crowd is None else ()
        )
    except SolverError as error:
        raise SolverError(f"{scenario.name!r}: {error}") from error
    return drive(scenario, controller, LoopSettings(crowd=crowd, max_time=max_time))


def _list_numbers(obstacles: Iterable[Obstacle]) -> list[tuple[Any, ...]]:
    """What makes obstacles the same: their class and their numbers."""
    return [(type(each), *each.numbers) for each in obstacles]


def drive(
    scenario: Scenario, controller: Controller, loop: LoopSettings = LoopSettings()
) -> SimulationLog:
    """Run the loop from any start, without the checks of `simulate`, and with any behaviour of people.

    Parameters
    ----------
    scenario : the scene.
    controller : an `MPCCBF`, or any other `szlib.control.Controller`.
    loop : how the loop runs.

    Raises
    ------
    SolverError : a control is not finite or has another length than `robot.inputs`, `max_time` is
        negative, the crowd changes its size, or the controller's dt is not that of `loop.settings`. For an
        `MPCCBF` also: the goal lies too close to a wall.

    Examples
    --------
    >>> import szlib
    >>> from szlib.simulation import Behaviour, LoopSettings
    >>> turning = LoopSettings(behaviour=Behaviour(turn=1.5), seed=1)
    >>> zone = szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))
    >>> log = szlib.drive(szlib.MEETINGS["frontal approach"], szlib.MPCCBF(zone), turning)
    >>> log.metrics()["unflagged_overlaps"]
    0
    """
    controller = as_controller(controller)
    settings = loop.settings or controller.settings or MPCSettings()
    if controller.settings and controller.settings.dt != settings.dt:
        raise SolverError(
            f"the controller steps every {controller.settings.dt} s, the loop every {settings.dt} s; give one"
        )
    robot = controller.robot
    zone = BODY_ZONE if controller.zone is None else controller.zone
    people = _People(scenario, zone, loop, settings)
    recorder = _Recorder()
    duration = scenario.duration if loop.max_time is None else loop.max_time
    require(
        0 <= duration < inf, "max_time", duration, "finite, at least 0", SolverError
    )
    arrival: int | None = None
    controller.reset()
    own = robot.start(scenario.start)
    for k in range(round(duration / settings.dt) + 1):
        time = k * settings.dt
        state = robot.body(own)
        everyone = people.locate(time, state)
        seen = people.observe(everyone)
        begin = perf_counter()
        step = controller.step(own, scenario.goal, tuple(seen.values()))
        recorder.add(state, everyone, list(seen), step, perf_counter() - begin)
        is_near = np.hypot(*(state[:2] - scenario.goal)) <= GOAL_RADIUS
        if arrival is None and is_near and np.hypot(*state[2:]) <= STOPPED_SPEED:
            arrival = k
            if loop.until_arrival:
                break
        control = check_array(
            f"the control at {time:g} s", recorder.controls[-1], (len(robot.inputs),)
        )
        own = robot.advance(own, control, settings.dt)
    return SimulationLog(
        scenario=scenario,
        settings=settings,
        zones=people.zones(len(everyone)),
        arrival=arrival,
        inputs=tuple(robot.inputs),
        **recorder.collect(len(everyone), len(scenario.fixed)),
    )


class _People:
    """The people of a run with their zones, and what the controller sees of them.

    Each person has a zone from when they first appear.  People of the `scenario` have theirs at once.
    """

    def __init__(
        self,
        scenario: Scenario,
        default: Ellipse | SpeedZone,
        loop: LoopSettings,
        settings: MPCSettings,
    ) -> None:
        self._default = default
        self._loop = loop
        self._speed = settings.zone_speed
        self._zones: dict[int, Ellipse] = {}
        self._rng = np.random.default_rng([loop.seed, 2])
        people = tuple(
            replace(p, zone=self._zone_of(i, p)) for i, p in enumerate(scenario.people)
        )
        self._n_people = len(people) or None
        # it advances also where `loop.crowd` moves the people: what is observed may depend on it
        self._crowd = loop.behaviour.start(replace(scenario, people=people), loop.seed)

    def _zone_of(self, i: int, person: Person | None) -> Ellipse:
        """The zone of person `i`, made from the `person` at the first call; None: they never appear."""
        if i not in self._zones:
            own = self._default
            if person is not None and person.zone is not None:
                own = person.zone
            zone = as_ellipse(own, self._speed)
            if person is not None and person.heading is None:
                zone = circle_around(zone)
            transform = self._loop.zone_transform
            self._zones[i] = transform(zone) if transform else zone
        return self._zones[i]

    def zones(self, n: int) -> tuple[Ellipse, ...]:
        """The zones of all `n` people."""
        return tuple(self._zone_of(i, None) for i in range(n))

    def locate(self, time: float, robot: Array) -> list[Person | None]:
        """The people at a `time` [s] with their zones; SolverError if their number changes."""
        people = self._crowd(time, robot)
        if self._loop.crowd is not None:
            people = self._loop.crowd(time, robot)
        if self._n_people is None:
            self._n_people = len(people)
        if len(people) != self._n_people:
            raise SolverError(
                "the number of people in a crowd must not change, use None for people who are absent; it was "
                f"{self._n_people}, and now is {len(people)}"
            )
        return [
            p
            if p is None or p.zone is self._zones.get(i, self)
            else replace(p, zone=self._zone_of(i, p))
            for i, p in enumerate(people)
        ]

    def observe(self, everyone: Sequence[Person | None]) -> dict[int, Person]:
        """The people whom the controller sees, by their place among `everyone`."""
        present = {i: p for i, p in enumerate(everyone) if p is not None}
        observed = self._loop.behaviour.observe(tuple(present.values()), self._rng)
        pairs = zip(present, observed, strict=True)
        return {i: p for i, p in pairs if p is not None}


class _Recorder:
    """What is recorded of each step of a run."""

    def __init__(self) -> None:
        self.controls: list[Array] = []
        self._states: list[Array] = []
        self._people: list[float] = []
        self._headings: dict[int, float] = {}  # the last known of each person
        self._seen: list[list[int]] = []
        self._reported: dict[str, list[Any]] = {name: [] for name in _UNREPORTED}

    def add(
        self,
        state: Array,
        everyone: Sequence[Person | None],
        seen: list[int],
        step: Any,
        duration: float,
    ) -> None:
        """Record a `step`, which took a `duration` [s], and the places of the people `seen`."""
        is_step = hasattr(step, "control")
        require(is_step, "a step", step, "an object with control", SolverError)
        self._states.append(state)
        self.controls.append(np.asarray(step.control, float))
        self._seen.append(seen)
        for i, person in enumerate(everyone):
            if person is None:
                self._people += _ABSENT
                continue
            if person.heading is not None:
                self._headings[i] = person.heading
            heading = self._headings.get(i, 0.0)
            self._people += (*person.position, heading, *person.velocity)
        defaults = _UNREPORTED | {"solve_time": duration}
        for name, column in self._reported.items():
            value = getattr(step, name, None)
            column.append(defaults[name] if value is None else value)

    def collect(self, n_people: int, n_fixed: int) -> dict[str, Any]:
        """The arrays of the run, as of `Run`."""
        reported = self._reported
        return {
            "states": np.array(self._states),
            "controls": np.array(self.controls),
            "people": np.reshape(self._people, (len(self._states), n_people, 5)),
            "predicted": _stack_plans(reported["predicted"]),
            "residual": _align_residuals(
                reported["residual"], self._seen, n_people, n_fixed
            ),
            "status": np.array(reported["status"]),
            "safe": np.array(reported["safe"], bool),
            "has_safety_claims": reported["safe"][0] is not None,
            **{
                name: np.array(reported[name], float)
                for name in ("slack", "solve_time", "stuck")
            },
        }


def _stack_plans(plans: Sequence[Array]) -> Array:
    """The plan of each step, shape (n, N+1, 4); (n, 0, 4) if there are none, NaN after shorter ones."""
    stacked = np.full((len(plans), max(map(len, plans)), 4), np.nan)
    for row, plan in zip(stacked, plans, strict=True):
        row[: len(plan)] = plan
    return stacked


def _align_residuals(
    rows: Sequence[Any], seen: Sequence[list[int]], n_people: int, n_fixed: int
) -> Array:
    """The conditions of each step, shape (n, P+W, N_h), NaN for people who were not seen; else (n, P+W, 0).

    A step has a row for each person whom it sees, for people whom it remembers, then for everything fixed.
    """
    if any(row is None for row in rows):
        return np.zeros((len(rows), n_people + n_fixed, 0))
    residuals = np.full((len(rows), n_people + n_fixed, rows[0].shape[1]), np.nan)
    for residual, row, i in zip(residuals, rows, seen, strict=True):
        if len(row) < len(i) + n_fixed:
            raise SolverError(
                "the residual of a step must have a row for each person it sees, then for everything fixed; "
                f"got {len(row)} rows, expected {len(i) + n_fixed}"
            )
        residual[i] = row[: len(i)]
        residual[n_people:] = row[len(row) - n_fixed :]
    return residuals

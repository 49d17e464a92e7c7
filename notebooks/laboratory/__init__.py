"""The laboratory: one scene with several robots, which a user drags and sets while it runs.

`Experiment` holds the scene and its robots.  `LaboratoryWidget` shows it in JupyterLab or in the classic
notebook, on a canvas that `laboratory.js` draws.  The page asks for each step, and the kernel computes
it.  The widget uses anywidget, which needs no build step and no extension of JupyterLab.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from math import cos, degrees, radians, sin
from pathlib import Path
from typing import Any

import anywidget
import numpy as np
import shapely
import traitlets

from szlib.checks import Array, check_array, check_number, require
from szlib.control.acceleration_polygon import find_admissible_controls
from szlib.control.controller import advance
from szlib.control.mpc import MPCCBF
from szlib.control.person import Person
from szlib.control.settings import MPCSettings
from szlib.control.step import Step
from szlib.errors import SolverError, SzlibError
from szlib.simulation.scenario import Scenario
from szlib.workbook import folders
from szlib.workbook.figures.movies import read_scripts, scene_layout, snapshot
from szlib.workbook.record.parameters import RANGES
from szlib.zones.ellipses import Ellipse

_MARGIN = 0.7  # around everything that can be dragged [m]
_FARTHEST = 1e4  # largest coordinate [m]
_MOST_WALLS = 50  # number of walls for which the solvers are built within a second
_KINDS = ("decide", "step", "share")  # of the requests of the page
# Lowest and highest options of a robot; with a longer horizon a solver takes seconds to build.
_LIMITS = {"N_h": (1, 40), "a_max": (0.01, 100), "size": RANGES["size"]}


@dataclass(frozen=True)
class RobotOptions:
    """Options of one robot.

    Parameters
    ----------
    gamma : as in `MPCSettings`.
    N_h : as in `MPCSettings` [steps]. A plan is as long as N_h if that is longer than the default plan.
    a_max : as in `MPCSettings` [m/s2].
    size : factor by which the zone is scaled.
    estimator : name of the estimator whose zone the robot keeps.

    Raises
    ------
    SolverError : N_h, a_max or size is out of range.

    Examples
    --------
    >>> import laboratory
    >>> laboratory.RobotOptions(gamma=0.2).settings().gamma
    0.2
    """

    gamma: float = 0.05
    N_h: int = 2
    a_max: float = 1.0
    size: float = 1.0
    estimator: str = "quantile"

    def __post_init__(self) -> None:
        for name, (low, high) in _LIMITS.items():
            _check_range(name, getattr(self, name), low, high)

    def settings(self) -> MPCSettings:
        """Settings of the controller.

        Raises
        ------
        SolverError : an option is out of range.
        """
        N = max(self.N_h, MPCSettings().N)
        return MPCSettings(gamma=self.gamma, N=N, N_h=self.N_h, a_max=self.a_max)

    def zone(self, zones: Mapping[str, Ellipse]) -> Ellipse:
        """The zone that the robot keeps, in the person's frame.

        Parameters
        ----------
        zones : estimator -> zone in the person's frame.

        Raises
        ------
        SolverError : there is no zone of this estimator.
        """
        names = ", ".join(zones)
        require(self.estimator in zones, "estimator", self.estimator, f"one of {names}", SolverError)
        return zones[self.estimator].scaled(self.size)


class Experiment:
    """One scene with several robots that do not see each other.

    Parameters
    ----------
    scenario : the scene at the start.
    zones : estimator -> zone in the person's frame.
    robots : options of each robot.

    Attributes
    ----------
    dt : time step [s].

    Raises
    ------
    SolverError : an option is out of range.

    Examples
    --------
    >>> import szlib
    >>> import laboratory
    >>> zones = {"quantile": szlib.Ellipse((0.05, 0.0), (0.95, 0.75))}
    >>> scene = laboratory.make_scene((4, 0), (2, 0, 180), 0.5, [], start=(-4, 0))
    >>> experiment = laboratory.Experiment(scene, zones, [laboratory.RobotOptions()])
    >>> [step.safe for step in experiment.step()]
    [True]
    """

    def __init__(
        self, scenario: Scenario, zones: Mapping[str, Ellipse], robots: Sequence[RobotOptions]
    ) -> None:
        self.scenario, self.zones = scenario, dict(zones)
        self.robots = list(robots)
        self._controllers = [self._make_controller(options) for options in robots]
        self.dt = self._controllers[0].settings.dt
        self.restart()

    def _make_controller(self, options: RobotOptions) -> MPCCBF:
        zone = options.zone(self.zones)
        return MPCCBF(zone, walls=self.scenario.walls, settings=options.settings())

    def restart(self) -> None:
        """Put the robots and the people back to the start."""
        self._n_steps, self._placed = 0, (0, list(self.scenario.people))
        self.states: list[Array] = [self.scenario.start.copy() for _ in self.robots]
        for controller in self._controllers:
            controller.reset()

    @property
    def t(self) -> float:
        """Time since the start [s]."""
        return self._n_steps * self.dt

    @property
    def people(self) -> list[Person]:
        """The people at this time."""
        since, people = self._placed
        return [person.after((self._n_steps - since) * self.dt) for person in people]

    def configure_robot(self, index: int, **options: Any) -> None:
        """Change `options` of the robot `index`: fields of `RobotOptions`."""
        _check_range("the number of a robot", index, 0, len(self.robots) - 1)
        changed = replace(self.robots[index], **options)
        self._controllers = [*self._controllers]  # `LaboratoryWidget.answer` keeps the lists before a change
        self.robots = [*self.robots]
        self._controllers[index], self.robots[index] = self._make_controller(changed), changed

    def move(
        self,
        *,
        goal: Sequence[float] | None = None,
        people: Mapping[int, Sequence[float]] | None = None,
        walls: Sequence[Sequence[float]] | None = None,
        speed: float | None = None,
    ) -> None:
        """Move parts of the scene. Before the first step, this changes the start as well.

        Parameters
        ----------
        goal : new goal (x, y) [m].
        people : index -> new position (x, y) of a person [m].
        walls : all walls, each with two ends [m].
        speed : new speed of all people [m/s]; it changes the start at any time.

        Raises
        ------
        SolverError : a position is invalid. Nothing has moved then.
        """
        _check_range("the number of walls", 0 if walls is None else len(walls), 0, _MOST_WALLS)
        moved = self.people
        for i, place in (people or {}).items():
            _check_range("the number of a person", i, 0, len(moved) - 1)
            x, y = _check_places("a person's position", place, (2,)).tolist()
            moved[i] = replace(moved[i], position=(x, y))
        start = moved if self._n_steps == 0 else list(self.scenario.people)
        if speed is not None:
            _check_range("speed", speed, *RANGES["speed"])
            moved, start = ([_with_speed(person, speed) for person in group] for group in (moved, start))
        changes: dict[str, Any] = {"people": tuple(start)}
        if goal is not None:
            changes["goal"] = _check_places("goal", goal, (2,))
        if walls is not None:
            ends = _check_places("walls", np.reshape(walls, (-1, 4)), (..., 4))
            changes["walls"] = ends.reshape(-1, 2, 2)
        changed = replace(self.scenario, **changes)
        if walls is not None:
            for controller in self._controllers:
                controller.set_walls(changed.walls)
        self.scenario, self._placed = changed, (self._n_steps, moved)

    def decide(self) -> list[Step]:
        """The step of each robot at this time; no time passes."""
        given = self.scenario.goal, self.people
        robots = zip(self._controllers, self.states, strict=True)
        return [controller.step(state, *given, now=self.t) for controller, state in robots]

    def step(self) -> list[Step]:
        """The step of each robot at this time; then one time step passes."""
        steps = self.decide()
        self.states = [advance(x, step.control, self.dt) for x, step in zip(self.states, steps, strict=True)]
        self._n_steps += 1
        return steps

    def parameter_cell(self) -> str:
        """Text of a parameter cell that starts with this scene and these robots."""
        lines = [f"goal = {self.scenario.goal.round(2).tolist()}  # x, y [m]"]
        for person in self.scenario.people[:1]:
            facing = degrees(person.heading or 0.0)
            place = [round(number, 2) for number in (*person.position, facing)]
            lines.append(f"person = {place}  # x, y [m], walks towards [deg]")
            lines.append(f"speed = {round(float(np.hypot(*person.velocity)), 2)}  # of the person [m/s]")
        walls = self.scenario.walls.round(2).reshape(-1).tolist()
        lines.append(f"walls = {walls}  # xa, ya, xb, yb of each [m]")
        for options, suffix in zip(self.robots, ("", "_b"), strict=False):
            lines += [f"{name}{suffix} = {value!r}" for name, value in asdict(options).items()]
        return "\n".join(lines)


def make_scene(
    goal: Sequence[float],
    person: Sequence[float],
    speed: float,
    walls: Sequence[float],
    *,
    start: Sequence[float],
) -> Scenario:
    """Make the scene of a parameter cell (see `Experiment.parameter_cell`).

    Parameters
    ----------
    goal : (x, y) [m].
    person : position and direction (x, y, facing) [m, m, deg].
    speed : speed of the person [m/s].
    walls : ends of all walls (xa, ya, xb, yb, ...) [m].
    start : (x, y) where the robot starts at rest [m].

    Examples
    --------
    >>> import laboratory
    >>> scene = laboratory.make_scene((4, 0), (2, 0, 180), 0.5, [], start=(-4, 0))
    >>> scene.people[0].position
    (2.0, 0.0)
    """
    x, y, facing = person
    people = (_with_speed(Person((x, y), heading=radians(facing)), speed),)
    segments = np.reshape(np.asarray(walls, float), (-1, 2, 2))
    state = np.array([*start, 0.0, 0.0])
    return Scenario("laboratory", state, np.asarray(goal, float), people, segments, title="The laboratory")


def _check_range(name: str, value: Any, low: float, high: float) -> None:
    require(low <= check_number(name, value) <= high, name, value, f"{low:g} to {high:g}", SolverError)


def _check_places(name: str, value: Any, shape: tuple[Any, ...]) -> Array:
    """`check_array`, within reach."""
    places = check_array(name, value, shape)
    _check_range(f"the largest coordinate of {name}", float(np.abs(places).max(initial=0.0)), 0, _FARTHEST)
    return places


def _with_speed(person: Person, speed: float) -> Person:
    heading = person.heading or 0.0
    return replace(person, velocity=(speed * cos(heading), speed * sin(heading)), heading=heading)


def is_interactive() -> bool:
    """Return True if a page of JupyterLab or of the classic notebook started the kernel, not `szlib run`.

    Examples
    --------
    >>> import laboratory
    >>> laboratory.is_interactive()
    False
    """
    return "JPY_SESSION_NAME" in os.environ and folders.RUN_VARIABLE not in os.environ


def show_sliders(draw: Callable[..., object], **sliders: tuple[float, float, float, float]) -> None:
    """Draw with sliders on a page of a notebook; do nothing in a headless run.

    Parameters
    ----------
    draw : function of the sliders' values, by name.
    sliders : name -> (value, least, greatest, step).

    Examples
    --------
    >>> import laboratory
    >>> laboratory.show_sliders(lambda speed: print(speed), speed=(1.0, 0.5, 1.5, 0.1))
    """
    if not is_interactive():
        return
    from ipywidgets import FloatSlider, interact

    widgets = {
        name: FloatSlider(value, min=low, max=high, step=step, continuous_update=False)
        for name, (value, low, high, step) in sliders.items()
    }

    def draw_silently(**values: float) -> None:
        """Draw, and return nothing that the page would show."""
        draw(**values)

    interact(draw_silently, **widgets)


class LaboratoryWidget(anywidget.AnyWidget):
    """An experiment on a page: drag the person, the goal and the ends of walls; set each robot; run, share.

    Parameters
    ----------
    experiment : the scene and its robots.

    Examples
    --------
    >>> import szlib
    >>> import laboratory
    >>> zones = {"quantile": szlib.Ellipse((0.05, 0.0), (0.95, 0.75))}
    >>> scene = laboratory.make_scene((4, 0), (2, 0, 180), 0.5, [], start=(-4, 0))
    >>> experiment = laboratory.Experiment(scene, zones, [laboratory.RobotOptions()])
    >>> widget = laboratory.LaboratoryWidget(experiment)
    >>> widget.answer({"kind": "step", "changes": {}})["snapshots"][0]["safe"]
    True
    """

    _esm = read_scripts("scene") + (Path(__file__).with_name("laboratory.js")).read_text(encoding="utf-8")
    content = traitlets.Dict().tag(sync=True)

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        people = experiment.scenario.people
        speed = float(np.hypot(*people[0].velocity)) if people else 0.0
        content = {
            "layout": self._layout(),
            "robots": [asdict(options) for options in experiment.robots],
            "estimators": list(experiment.zones),
            "speed": round(speed, 2),
        }
        super().__init__(content=content)
        self._thread = ThreadPoolExecutor(1)  # controllers belong to one thread; messages come in several
        self.on_msg(lambda _, request, __: self.send(self._thread.submit(self.answer, request).result()))

    def _layout(self) -> dict[str, Any]:
        scene = self.experiment.scenario
        places = [scene.start[:2], scene.goal, *(person.position for person in scene.people)]
        points = np.vstack([np.array(places), scene.walls.reshape(-1, 2)])
        (x0, y0), (x1, y1) = points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
        limits = x0, x1, min(y0, -2.0), max(y1, 2.0)
        return scene_layout(scene, self.experiment.robots[0].settings(), limits)

    def answer(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Answer a message of the page.

        Parameters
        ----------
        request : `changes` to apply first (robots, people, goal, walls, speed, restart), and the `kind`:
            "decide" and "step" ask for the step of each robot, and "step" lets one time step pass; "share"
            asks for the parameter cell.

        Returns
        -------
        The answer, with its `kind`: "snapshots", "cell", or "error" for an invalid change or a malformed
        request. After an error nothing has changed.
        """
        before, walls = {**vars(self.experiment)}, self.experiment.scenario.walls
        try:
            require(request["kind"] in _KINDS, "the kind of a request", request["kind"], f"one of {_KINDS}")
            self._apply(request["changes"])
            if request["kind"] == "share":
                return {"kind": "cell", "text": self.experiment.parameter_cell()}
            t, states, people = self.experiment.t, self.experiment.states, self.experiment.people
            steps = self.experiment.step() if request["kind"] == "step" else self.experiment.decide()
            zones = [options.zone(self.experiment.zones) for options in self.experiment.robots]
            robots = zip(states, steps, zones, strict=True)
            snapshots = [_robot_snapshot(t, state, people, zone, step) for state, step, zone in robots]
            return {"kind": "snapshots", "snapshots": snapshots}
        except (SzlibError, LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
            vars(self.experiment).update(before)
            for controller in self.experiment._controllers:
                controller.set_walls(walls)
            text = str(error) if isinstance(error, SzlibError) else f"the request is malformed: {error!r}"
            return {"kind": "error", "text": text, "layout": self._layout()}

    def _apply(self, changes: Mapping[str, Any]) -> None:
        for index, options in changes.get("robots", {}).items():
            self.experiment.configure_robot(int(index), **options)
        people = {int(i): place for i, place in changes.get("people", {}).items()}
        moved = {name: changes[name] for name in ("goal", "walls", "speed") if name in changes}
        if people or moved:
            self.experiment.move(people=people, **moved)
        if changes.get("restart"):
            self.experiment.restart()


def _robot_snapshot(
    t: float, state: Array, people: Sequence[Person], zone: Ellipse, step: Step
) -> dict[str, Any]:
    """One time of one robot, for `laboratory.js`."""
    placed = np.array([(*p.position, p.heading or 0.0) for p in people]).reshape(-1, 3)
    zones = [zone] * len(people)
    parts = shapely.get_parts(find_admissible_controls(step).polygon.simplify(0.01))  # 0.01 m/s2 off
    allowed = [part.exterior.coords for part in parts if part.geom_type == "Polygon" and not part.is_empty]
    return snapshot(t, state, placed, zones, step.predicted, step.h, step.fallback) | {
        "control": step.control.round(3).tolist(),
        "a_max": step.scene.settings.a_max,
        "allowed": [np.round(corners, 3).tolist() for corners in allowed],
        "safe": step.safe,
        "stuck": step.stuck,
    }

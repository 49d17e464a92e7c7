"""The laboratory: a scene that is dragged and set while it runs, with one robot for each set of options.

`Experiment` holds the scene and its robots; `LaboratoryWidget` shows it in JupyterLab or in the classic
notebook, on a canvas that `static/laboratory.js` draws.  The page asks for each step, and the kernel computes
it.  The widget uses anywidget, which needs no build step and no extension of JupyterLab.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from math import cos, degrees, radians, sin
from typing import Any

import anywidget
import numpy as np
import traitlets

from ..checks import Array, check_array
from ..control.acceleration_polygon import admissible
from ..control.barriers import check_wall
from ..control.mpc import MPCCBF
from ..control.person import Person
from ..control.settings import MPCSettings
from ..control.step import Step
from ..errors import SolverError, SzlibError
from ..simulation.closed_loop import advance
from ..simulation.scenario import Scenario
from ..zones.ellipses import Ellipse
from .figures.movies import Stage, moment, script
from .record import places

__all__ = ["Experiment", "LaboratoryWidget", "RobotOptions", "is_interactive", "make_scene", "show_sliders"]


@dataclass(frozen=True)
class RobotOptions:
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


class Experiment:
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

    def __init__(
        self, scenario: Scenario, zones: Mapping[str, Ellipse], choices: Sequence[RobotOptions]
    ) -> None:
        self.scenario, self.zones = scenario, dict(zones)
        self.choices = list(choices)
        self._controllers = [self._controller(choice) for choice in choices]
        self.restart()

    def _controller(self, choice: RobotOptions) -> MPCCBF:
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
        """Set something for one robot: names of `RobotOptions`."""
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


def make_scene(
    goal: Sequence[float],
    person: Sequence[float],
    speed: float,
    walls: Sequence[float],
    start: Sequence[float],
) -> Scenario:
    """The scene of a parameter cell (see `Experiment.cell`), the robot at rest at `start`, (x, y) [m]."""
    x, y, facing = person
    who = _walking(Person((x, y), heading=radians(facing)), speed)
    there = np.reshape(np.asarray(walls, float), (-1, 2, 2))
    begin = np.array([*start, 0.0, 0.0])
    return Scenario("laboratory", begin, np.asarray(goal, float), (who,), there, title="The laboratory")


def _walking(person: Person, speed: float) -> Person:
    heading = person.heading or 0.0
    return replace(person, velocity=(speed * cos(heading), speed * sin(heading)), heading=heading)


SLIDERS = [
    {"name": "gamma", "label": "gamma", "low": 0.01, "high": 1.0, "step": 0.01},
    {"name": "N_h", "label": "N_h [steps]", "low": 1, "high": 24, "step": 1},
    {"name": "a_max", "label": "a_max [m/s\u00b2]", "low": 0.2, "high": 3.0, "step": 0.1},
    {"name": "size", "label": "size of the zone [times]", "low": 0.3, "high": 2.0, "step": 0.05},
]
"""What can be set of each robot."""
SPEED = {"label": "speed of the person [m/s]", "low": 0.0, "high": 2.0, "step": 0.05}
_AROUND = 0.7
"""Room left around everything that can be dragged [m]."""
_FINE = 0.01
"""To this the polygon of accelerations is drawn [m/s2]."""


def is_interactive() -> bool:
    """Whether the kernel was started by a page: JupyterLab or the classic notebook; never in `szlib run`."""
    return "JPY_SESSION_NAME" in os.environ and places.RUN_VARIABLE not in os.environ


def show_sliders(draw: Callable[..., object], **sliders: tuple[float, float, float, float]) -> None:
    """Draw with sliders where a page is open, and not at all headless.

    Each is (value, least, greatest, step); `draw` gets their values by name.
    """
    if not is_interactive():
        return
    from ipywidgets import FloatSlider, interact

    made = {
        name: FloatSlider(value, min=low, max=high, step=step, continuous_update=False)
        for name, (value, low, high, step) in sliders.items()
    }

    def drawn(**values: float) -> None:
        """What ipywidgets takes for a function of all of them."""
        draw(**values)

    interact(drawn, **made)


class LaboratoryWidget(anywidget.AnyWidget):
    """A bench on a page: drag the person, the goal, the ends of walls; set each robot; run, pause, share.

    Parameters
    ----------
    bench : what is shown.
    """

    _esm = script("scene", "laboratory")
    begin = traitlets.Dict().tag(sync=True)

    def __init__(self, bench: Experiment) -> None:
        self.bench = bench
        people = bench.scenario.people
        speed = float(np.hypot(*people[0].velocity)) if people else 0.0
        begin = {
            "stage": self._stage(),
            "choices": [asdict(choice) for choice in bench.choices],
            "estimators": list(bench.zones),
            "sliders": SLIDERS,
            "speed": {**SPEED, "value": round(speed, 2)},
        }
        super().__init__(begin=begin)
        self._thread = ThreadPoolExecutor(1)  # controllers belong to one thread, messages come in several
        self.on_msg(lambda _, asked, __: self.send(self._thread.submit(self.answer, asked).result()))

    def _stage(self) -> dict[str, Any]:
        scene, settings = self.bench.scenario, self.bench.choices[0].settings()
        places = [scene.start[:2], scene.goal, *(person.position for person in scene.people)]
        points = np.vstack([np.array(places), scene.walls.reshape(-1, 2)])
        low, high = points.min(axis=0) - _AROUND, points.max(axis=0) + _AROUND
        limits = [low[0], high[0], min(low[1], -2.0), max(high[1], 2.0)]
        walls = scene.walls.reshape(-1, 4).tolist()
        return Stage(
            walls, scene.goal.tolist(), [float(x) for x in limits], settings.r_robot, settings.dt
        ).told()

    def answer(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """What the page is told: it says what was `changed`, and the `kind` of what it asks for.

        "look" and "step" give what each robot decides now, the second lets dt pass then; "share" gives the
        parameter cell. What cannot be is refused in words, and nothing has changed.
        """
        try:
            self._change(asked["changed"])
            if asked["kind"] == "share":
                return {"kind": "cell", "text": self.bench.cell()}
            t, states, people = self.bench.t, self.bench.states, self.bench.people
            steps = self.bench.step() if asked["kind"] == "step" else self.bench.look()
            zones = [choice.zone(self.bench.zones) for choice in self.bench.choices]
            told = zip(states, steps, zones, strict=True)
            moments = [told_of(t, state, people, zone, step) for state, step, zone in told]
            return {"kind": "moments", "moments": moments}
        except SzlibError as error:
            return {"kind": "refused", "text": str(error), "stage": self._stage()}

    def _change(self, changed: Mapping[str, Any]) -> None:
        for robot, names in changed.get("choices", {}).items():
            self.bench.choose(int(robot), **names)
        people = {int(i): place for i, place in changed.get("people", {}).items()}
        moved = {name: changed[name] for name in ("goal", "walls", "speed") if name in changed}
        if people or moved:
            self.bench.move(people=people, **moved)
        if changed.get("restart"):
            self.bench.restart()


def told_of(t: float, state: Array, people: Sequence[Person], zone: Ellipse, step: Step) -> dict[str, Any]:
    """One instant of one robot, as `static/laboratory.js` shows it."""
    placed = np.array([(*p.position, p.heading or 0.0) for p in people]).reshape(-1, 3)
    free = admissible(step).polygon.simplify(_FINE)
    parts = [part for part in getattr(free, "geoms", [free]) if not part.is_empty]
    return moment(t, state, placed, [zone] * len(people), step.predicted, step.h, step.rung) | {
        "control": step.control.round(3).tolist(),
        "a_max": step.scene.settings.a_max,
        "free": [
            np.asarray(part.exterior.coords).round(3).tolist()
            for part in parts
            if part.geom_type == "Polygon"
        ],
        "told": "safe" if step.safe else "NOT SAFE",
    }

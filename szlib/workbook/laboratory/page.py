"""The laboratory on a page of JupyterLab or of the classic notebook, by a canvas of `static/laboratory.js`.

The page asks for step after step; the kernel computes each.  anywidget carries it: it needs no build step and
no extension of JupyterLab, where ipympl sends pictures, bqplot plots data, and ipycanvas sends every stroke.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from typing import Any

import anywidget
import numpy as np
import traitlets

from ...checks import Array
from ...control.people import Person
from ...control.step import Step, admissible
from ...errors import SzlibError
from ...zones.ellipses import Ellipse
from ..figures.players import Stage, moment, script
from ..record import places
from .bench import Bench

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


def live() -> bool:
    """Whether the kernel was started by a page: JupyterLab or the classic notebook; never in `szlib run`."""
    return "JPY_SESSION_NAME" in os.environ and places.RUN_VARIABLE not in os.environ


def slide(draw: Callable[..., object], **sliders: tuple[float, float, float, float]) -> None:
    """Draw with sliders where a page is open, and not at all headless.

    Each is (value, least, greatest, step); `draw` gets their values by name.
    """
    if not live():
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


class Laboratory(anywidget.AnyWidget):
    """A bench on a page: drag the person, the goal, the ends of walls; set each robot; run, pause, share.

    Parameters
    ----------
    bench : what is shown.
    """

    _esm = script("scene", "laboratory")
    begin = traitlets.Dict().tag(sync=True)

    def __init__(self, bench: Bench) -> None:
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

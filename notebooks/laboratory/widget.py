"""The laboratory on a page of JupyterLab: a canvas that `laboratory.js` draws, and a kernel that computes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import anywidget
import numpy as np
import shapely
import traitlets

import szlib
from szlib.core.checks import require
from szlib.workbook.figures.movies import read_scripts, scene_layout, snapshot

from .explanation import explain, name_limit
from .world import CONSTRUCTORS, LIMITS, PRESETS, RobotOptions, World

_MARGIN = 0.8  # around everything that can be dragged [m]
_HEIGHT = 2.0  # half of the least height of the scene [m]
_KINDS = ("show", "step", "share")  # of the requests of the page
_SCRIPT, _ACCELERATIONS = (
    Path(__file__).with_name(f"{name}.js").read_text(encoding="utf-8")
    for name in ("laboratory", "accelerations")
)


class Laboratory(anywidget.AnyWidget):
    """A scene on a page: drag people, robot, goal and walls; set, run, step, go back, ask why, share.

    Parameters
    ----------
    scenario : the scene, or the name of one: a key of `PRESETS`.
    zone : the zone of people, in their own frame; default: a reference zone of szlib.
    robots : the settings of the robot, or of two to compare.

    Attributes
    ----------
    world : the scene and its robots.

    Raises
    ------
    SolverError : there is no such scene, or the goal lies too close to a wall.

    Examples
    --------
    >>> from laboratory import Laboratory
    >>> lab = Laboratory("passing")
    >>> lab.answer({"kind": "step", "n": 0, "changes": {}})["snapshots"][0]["safety"]
    'Safe, if people keep their velocity.'
    """

    _esm = f"{read_scripts('scene')}\n{_ACCELERATIONS}\n{_SCRIPT}"
    content = traitlets.Dict().tag(sync=True)

    def __init__(
        self,
        scenario: szlib.Scenario | str = "corridor",
        *,
        zone: szlib.Ellipse | None = None,
        robots: Sequence[RobotOptions] = (RobotOptions(),),
    ) -> None:
        self._thread = ThreadPoolExecutor(1)  # controllers belong to one thread; messages come in several
        self._zone = zone or szlib.reference_zone("grand-central-strangers").ellipse
        self._own = {} if isinstance(scenario, str) else {scenario.name: scenario}
        self._in_thread(self._load, scenario if isinstance(scenario, str) else scenario.name, robots)
        settings = {
            name: {key: getattr(make(), key) for key in LIMITS} for name, make in CONSTRUCTORS.items()
        }
        super().__init__(content={"presets": [*self._own, *PRESETS], "settings": settings})
        self.on_msg(lambda _, request, __: self.send(self.answer(request)))

    def _in_thread(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return self._thread.submit(function, *arguments).result()

    def _load(self, name: str, robots: Sequence[RobotOptions]) -> None:
        """Begin with the scene of this `name`."""
        scenes = PRESETS | self._own
        require(name in scenes, "scenario", name, f"one of {', '.join(scenes)}", szlib.SolverError)
        scene = scenes[name]
        self.world, self._name = World(scene, self._zone, robots), name
        places = [scene.start[:2], scene.goal, *(person.position for person in scene.people)]
        points = np.vstack([np.array(places), scene.walls.reshape(-1, 2)])
        (x0, y0), (x1, y1) = points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
        self._limits = x0, x1, min(y0, -_HEIGHT), max(y1, _HEIGHT)

    def answer(self, request: Any) -> dict[str, Any]:
        """Answer a message of the page.

        Parameters
        ----------
        request : `kind`: "show" asks what is there, "step" lets one time step pass, "share" asks for code;
            `n`: the number of the time step on the screen, to which the world goes back first; `changes`:
            those of `World.change`, or "scenario", the name of a scene to begin with.

        Returns
        -------
        The `kind` "snapshots" with what is there now, "code" with the text, or "error" with the text for an
        invalid change or a malformed request, and what is there: the same as before.
        """
        return self._in_thread(self._answer, request)

    def _answer(self, request: Any) -> dict[str, Any]:
        try:
            require(request["kind"] in _KINDS, "the kind of a request", request["kind"], f"one of {_KINDS}")
            self._apply(request["n"], {**request["changes"]})
            if request["kind"] == "share":
                return {"kind": "code", "text": self.world.code()}
            if request["kind"] == "step":
                self.world.advance()
            return self._describe("snapshots")
        except (szlib.SzlibError, LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
            is_ours = isinstance(error, szlib.SzlibError)
            return self._describe("error", str(error) if is_ours else f"the request is malformed: {error!r}")

    def _apply(self, n: int, changes: dict[str, Any]) -> None:
        if "robots" in changes:
            changes["robots"] = [
                RobotOptions(each["constructor"], each["changes"]) for each in changes["robots"]
            ]
        if "scenario" in changes:
            self._load(changes["scenario"], changes.get("robots", self.world.robots))
            return
        if n != self.world.n:
            self.world.rewind(n)
        if changes:
            self.world.change(**changes)

    def _describe(self, kind: str, text: str = "") -> dict[str, Any]:
        """What is there now, for `laboratory.js`."""
        world = self.world
        scene = replace(world.scenario, people=world.people)
        return {
            "kind": kind,
            "text": text,
            "n": world.n,
            "scenario": self._name,
            "title": scene.title,
            "arrived": world.arrived,
            "layout": scene_layout(scene, world.steps[0].scene.settings, self._limits),
            "robots": [
                {each.name: getattr(robot, each.name) for each in fields(robot)} for robot in world.robots
            ],
            "speeds": [round(float(np.hypot(*person.velocity)), 3) for person in world.people],
            "snapshots": [self._snapshot(step) for step in world.steps],
        }

    def _snapshot(self, step: szlib.Step) -> dict[str, Any]:
        """One robot now, for `laboratory.js`."""
        scene, people, reasons = step.scene, self.world.people, explain(step)
        placed = np.array([(*p.position, p.heading or 0.0) for p in people]).reshape(-1, 3)
        parts = shapely.get_parts(reasons.found.polygon.simplify(0.01))  # 0.01 m/s2 off
        allowed = [
            part.exterior.coords for part in parts if part.geom_type == "Polygon" and not part.is_empty
        ]
        t, h, n = self.world.n * self.world.dt, step.h, len(people)
        shown = snapshot(t, np.array(scene.state), placed, scene.person_zones, step.predicted, h, step.status)
        return shown | {
            "h_people": round(float(h[:n].min()), 3) if n else None,
            "h_walls": round(float(h[n:].min()), 3) if len(h) > n else None,
            "v_max": scene.settings.v_max,
            "control": step.control.round(3).tolist(),
            "a_max": scene.settings.a_max,
            "allowed": [np.round(corners, 3).tolist() for corners in allowed],
            "active": [
                {"kind": kind, "number": int(number), "curve": limit.curve.round(3).tolist()}
                for limit in reasons.active
                for kind, number in [name_limit(step, limit).rsplit(" ", 1)]
            ],
            "ways": [way.points.round(3).tolist() for way in step.ways],
            "way": reasons.way,
            "sentence": reasons.sentence,
            "safety": reasons.safety,
            "notes": reasons.notes,
        }

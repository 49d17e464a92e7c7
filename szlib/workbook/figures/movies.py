"""Runs as players: a canvas with controls where scripts run, and the moving picture where they do not."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable, Sequence
from hashlib import sha256
from html import escape
from math import isfinite, isnan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...checks import Array
from ...simulation.log import SimulationLog
from ...zones.ellipses import Ellipse
from .style import BLUE, GREEN, RED

SCRIPTS = Path(__file__).parents[1] / "static"
"""Where the scripts are that draw in a browser."""
COLOURS = {"robot": BLUE, "person": RED, "plan": GREEN}


class Stage(NamedTuple):
    """What of a scene stays where it is, as `static/scene.js` draws it.

    Walls (xa, ya, xb, yb), goal (x, y), limits (x0, x1, y0, y1), radius of the robot [m]; dt [s].
    """

    walls: list[list[float]]
    goal: list[float]
    limits: list[float]
    radius: float
    dt: float

    def told(self) -> dict[str, Any]:
        """The same for JSON, with the colours."""
        return {**self._asdict(), "colours": COLOURS}


def moment(
    t: float, state: Array, people: Array, zones: Iterable[Ellipse], plan: Array, h: Array, rung: str
) -> dict[str, Any]:
    """One instant of a run, as `static/scene.js` draws it.

    Parameters
    ----------
    t : time [s]; state : (x, y, vx, vy) of the robot [m, m/s].
    people : (x, y, heading, ...) of each, NaN for who is not there; zones : theirs, in their own frames.
    plan : states of the plan, shape (N+1, 4) or (0, 4); h : every barrier [m]; rung : `Step.rung`, or "".
    """
    placed = [
        (x, y, heading, zone.placed((x, y), heading))
        for (x, y, heading), zone in zip(people[:, :3].tolist(), zones, strict=True)
        if not isnan(x)
    ]
    there = h[np.isfinite(h)]
    return {
        "t": round(t, 3),
        "robot": _short(state[:2]),
        "speed": round(float(np.hypot(state[2], state[3])), 3),
        "people": [_short((x, y, heading)) for x, y, heading, _ in placed],
        "zones": [_short((*zone.center, *zone.semi_axes, zone.angle)) for *_, zone in placed],
        "plan": [_short(point) for point in plan[:, :2].tolist() if isfinite(point[0])],
        "h": round(float(there.min()), 3) if there.size else None,
        "rung": rung,
    }


class Movie(bytes):
    """A run as an animated GIF, its bytes; in a notebook and in HTML a player with controls.

    Attributes
    ----------
    run : what `static/player.js` plays: stage, moments, alt.
    """

    run: dict[str, Any]

    def __new__(cls, gif: bytes, run: dict[str, Any]) -> Movie:
        movie = super().__new__(cls, gif)
        movie.run = run
        return movie

    @classmethod
    def of(cls, gif: bytes, log: SimulationLog, limits: Sequence[float]) -> Movie:
        """The moving picture of a run, and what plays it: a moment for each step, within these limits [m]."""
        stage = Stage(
            log.scenario.walls.reshape(-1, 4).tolist(),
            log.scenario.goal.tolist(),
            [round(float(limit), 2) for limit in limits],
            log.settings.r_robot,
            log.settings.dt,
        )
        rows = zip(
            log.time.tolist(),
            log.states,
            log.people,
            log.predicted,
            log.h,
            log.fallback.tolist(),
            strict=True,
        )
        moments = [moment(t, x, people, log.zones, plan, h, rung) for t, x, people, plan, h, rung in rows]
        people = len(log.zones)
        who = "nobody else" if not people else "a person" if people == 1 else f"{people} people"
        alt = f"{log.scenario.title or log.scenario.name}: a robot and {who}, {log.time[-1]:.1f} s"
        return cls(gif, {"stage": stage.told(), "moments": moments, "alt": alt})

    def __repr__(self) -> str:
        return str(self.run["alt"])

    def _repr_html_(self) -> str:
        picture = f"data:image/gif;base64,{b64encode(self).decode()}"
        alt = escape(self.run["alt"], quote=True)
        content = json.dumps(self.run, separators=(",", ":")).replace("</", "<\\/")
        name = f"szlib-{sha256(self).hexdigest()[:8]}"
        return (
            f'<figure class="szlib-player" data-run="{name}"><img src="{picture}" alt="{alt}"></figure>\n'
            f"<script>(() => {{\n{script('scene', 'player')}\nconst run = {content};\n"
            f"const figures = document.querySelectorAll('[data-run={name}]:not([data-ready])');\n"
            "figures.forEach((figure) => play(figure, run));\n})()</script>"
        )


def script(*names: str) -> str:
    """The text of these scripts, one after the other."""
    return "\n".join((SCRIPTS / f"{name}.js").read_text(encoding="utf-8") for name in names)


def _short(numbers: Any) -> list[float]:
    """To the millimetre, or the thousandth of a radian."""
    return [round(float(number), 3) for number in numbers]

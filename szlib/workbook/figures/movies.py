"""Runs as animations: a player with controls where scripts run, and an animated GIF where they do not."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable, Sequence
from hashlib import sha256
from html import escape
from itertools import pairwise
from math import isnan
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from ...control.settings import MPCSettings
from ...core.checks import Array
from ...simulation import Run, Scenario
from ...zones.ellipses import Ellipse
from .style import BLUE, GREEN, RED, outline_obstacle

_STATIC = Path(__file__).parents[1] / "static"  # what a browser shows


def scene_layout(
    scenario: Scenario, settings: MPCSettings, limits: Sequence[float]
) -> dict[str, Any]:
    """The part of a scene that does not move, for `static/scene.js`.

    Parameters
    ----------
    scenario : its goal, its walls and other obstacles are drawn.
    settings : its radius of the robot and its time step are used.
    limits : x0, x1, y0, y1 of the scene [m].
    """
    return {
        "walls": [
            [*start, *end]
            for obstacle in scenario.fixed
            for line in outline_obstacle(obstacle, limits)
            for start, end in pairwise(line.round(3).tolist())
        ],
        "goal": scenario.goal.tolist(),
        "limits": [round(float(limit), 2) for limit in limits],
        "radius": settings.r_robot,
        "dt": settings.dt,
        "colours": {"robot": BLUE, "person": RED, "plan": GREEN},
    }


def snapshot(
    t: float,
    state: Array,
    people: Array,
    zones: Iterable[Ellipse],
    plan: Array,
    h: Array,
    status: str,
) -> dict[str, Any]:
    """One time of a run, for `static/scene.js`.

    Parameters
    ----------
    t : time [s].
    state : (x, y, vx, vy) of the robot [m, m/s].
    people : (x, y, heading, ...) of each person, shape (P, 3 or more) [m, rad]; NaN for an absent person.
    zones : zone of each person, in the person's frame.
    plan : states of the plan, shape (N+1, 4) or (0, 4).
    h : barrier of each obstacle [m].
    status : `Step.status`, or "".
    """
    present = ~np.isnan(people[:, 0])
    known = h[np.isfinite(h)]
    placed = place_zones(zones, people)
    return {
        "t": round(t, 3),
        "robot": state[:2].round(3).tolist(),
        "speed": round(float(np.hypot(state[2], state[3])), 3),
        "people": people[present, :3].round(3).tolist(),
        "zones": [
            np.round((*z.center, *z.semi_axes, z.angle), 3).tolist() for z in placed
        ],
        "plan": plan[np.isfinite(plan[:, 0]), :2].round(3).tolist(),
        "h": round(float(known.min()), 3) if known.size else None,
        "status": status,
    }


def place_zones(zones: Iterable[Ellipse], people: Array) -> list[Ellipse]:
    """The zone of each person who is present, in the world frame; `zones` and `people` as of `snapshot`."""
    poses = people[:, :3].tolist()
    return [
        z.placed((x, y), angle)
        for z, (x, y, angle) in zip(zones, poses, strict=True)
        if not isnan(x)
    ]


class Movie(bytes):
    """A run as the bytes of an animated GIF; in a notebook and in HTML it is a player with controls.

    Attributes
    ----------
    run : data for `static/player.js`: layout, snapshots, alt.

    Examples
    --------
    >>> import szlib
    >>> from szlib.workbook import figures
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> log = szlib.simulate(szlib.SCENARIOS["passing"], controller, max_time=1.0)
    >>> movie = figures.animate(log, width=3.0)
    >>> movie.startswith(b"GIF89a")
    True
    """

    run: dict[str, Any]

    def __new__(cls, gif: bytes, run: Run, limits: Sequence[float]) -> Movie:
        """Build the movie of a run.

        Parameters
        ----------
        gif : bytes of the animated GIF.
        run : the run; its steps become the frames of the player.
        limits : x0, x1, y0, y1 of the scene [m].
        """
        movie = super().__new__(cls, gif)
        n = len(run.zones)
        columns = (
            run.time.tolist(),
            run.states,
            run.people,
            run.predicted,
            run.h,
            run.status,
            run.stuck.tolist(),
        )
        movie.run = {
            "layout": scene_layout(run.scenario, run.settings, limits),
            "snapshots": [
                snapshot(t, state, people, run.zones, plan, h, str(status))
                | {"stuck": s}
                for t, state, people, plan, h, status, s in zip(*columns, strict=True)
            ],
            "alt": f"{run.scenario.title or run.scenario.name}: a robot and {n} "
            f"{'person' if n == 1 else 'people'}, {run.time[-1]:.1f} s",
        }
        return movie

    def __repr__(self) -> str:
        return str(self.run["alt"])

    def _repr_html_(self) -> str:
        page = Template((_STATIC / "player.html").read_text(encoding="utf-8").rstrip())
        return page.substitute(
            name=f"szlib-{sha256(self).hexdigest()[:8]}",
            gif=b64encode(self).decode(),
            alt=escape(self.run["alt"], quote=True),
            scripts=read_scripts("scene", "player"),
            run=json.dumps(self.run, separators=(",", ":")).replace("</", "<\\/"),
        )


def read_scripts(*names: str) -> str:
    """The text of the scripts `names`, one after the other."""
    return "\n".join(
        (_STATIC / f"{name}.js").read_text(encoding="utf-8") for name in names
    )

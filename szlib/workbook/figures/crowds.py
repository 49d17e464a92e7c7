"""Figures of robots among other people's crowds: everybody's paths, and a table of promises."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from ...simulation.log import SimulationLog
from ...simulation.replay import Replay
from ...simulation.safety_claims import MOTION_CHANGES
from .style import BLACK, BLUE, GREEN, ORANGE, RED, get_axes, label_metres

_AROUND = 3.0
"""Floor that is shown around the robot's path [m]."""
_SHADES = {
    "came": (BLACK, ""),
    "turned": (RED, "///"),
    "slowed down": (GREEN, "..."),
    "sped up": (ORANGE, "xxx"),
    "faced elsewhere": (BLUE, "|||"),
}


def plot_crowd(log: SimulationLog, *, replay: Replay | None = None, ax: Axes | None = None) -> Axes:
    """Everybody's paths, with a dot each second; robot and people as they were when it was nearest to one.

    With the `replay` that it drove in, the path of the person whom it replaced as well.
    """
    ax = get_axes(ax, size=(6, 5))
    second = max(1, round(1 / log.settings.dt))
    distance = np.hypot(log.relative[..., 0], log.relative[..., 1])
    row = int(np.nanargmin(np.where(log.is_present, distance, np.inf).min(axis=1, initial=np.inf)))
    for i in range(log.people.shape[1]):
        x, y = log.people[:, i, 0], log.people[:, i, 1]
        ax.plot(x, y, color=RED, linewidth=1, alpha=0.5, label="people" if i == 0 else None)
        ax.plot(x[::second], y[::second], ".", color=RED, markersize=3, alpha=0.5)
        if log.is_present[row, i]:
            px, py, heading = log.people[row, i, :3].tolist()
            ax.plot(*log.zones[i].placed((px, py), heading).curve().T, color=RED, linewidth=1.2)
            ax.plot(px, py, marker=(3, 0, np.degrees(heading) - 90), color=RED, markersize=6)
    if replay is not None:
        ax.plot(*replay.walker.states[:, :2].T, "--", color=GREEN, linewidth=2, label="person replaced")
    for i, wall in enumerate(log.scenario.walls):
        ax.plot(*wall.T, color=BLACK, linewidth=3, label="wall" if i == 0 else None)
    ax.plot(*log.states[:, :2].T, color=BLUE, linewidth=2, label="robot")
    ax.plot(*log.states[::second, :2].T, ".", color=BLUE, markersize=5)
    ax.add_patch(Circle(log.states[row, :2].tolist(), log.settings.r_robot, color=BLUE, alpha=0.5, lw=0))
    ax.plot(*log.scenario.goal, "D", color=BLUE, markersize=8, markeredgecolor=BLACK, label="goal")
    path = np.vstack([log.states[:, :2], log.scenario.goal])
    low, high = path.min(axis=0) - _AROUND, path.max(axis=0) + _AROUND
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    return label_metres(ax, log.scenario.title)


def plot_safety_claims(table: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Steps that said they were safe and led to h < 0, of a thousand that said so, by what people did.

    `table` has a row for each crowd: its name as the index, claimed_safe_steps, and a column for each
    of `MOTION_CHANGES`.
    """
    ax = get_axes(ax, size=(8, 3.5))
    left = np.zeros(len(table))
    for did in MOTION_CHANGES:
        share = 1000 * table[did].to_numpy(float) / table["claimed_safe_steps"].to_numpy(float)
        if did in _SHADES or share.any():
            colour, hatch = _SHADES.get(did, ("magenta", "ooo"))
            ax.barh(table.index, share, left=left, color=colour, hatch=hatch, edgecolor="white", label=did)
        left += share
    ax.set_xlim(0, 1.08 * max(float(left.max(initial=0)), 1e-9))
    ax.set(xlabel="steps that led to h < 0, of 1,000 that said they were safe")
    ax.invert_yaxis()
    ax.legend(fontsize=8, title="what people did")
    return ax

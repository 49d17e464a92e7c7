"""Figures of runs: paths of several runs, crowds (notebooks 09, 12, 26, 29)."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from szlib.core.checks import Array
from szlib.simulation import Run, compute_metrics
from szlib.simulation.robot_run import nanmin
from szlib.workbook.figures.movies import place_zones
from szlib.workbook.figures.simulation import (
    ZONE_COLOURS,
    draw_moving,
    draw_scenery,
    draw_zone,
    set_limits,
)
from szlib.workbook.figures.style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    RED,
    add_legend_below,
    get_axes,
    label_metres,
)

_CROWD_MARGIN = 3.0  # margin around the robot's path in a crowd [m]


def plot_robot_paths(runs: Mapping[str, Run], *, ax: Axes | None = None) -> Axes:
    """Plot the paths of several runs of one scene, with the zones at the start.

    Parameters
    ----------
    runs : name -> run, at most four.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import szlib
    >>> import plots
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> log = szlib.simulate(szlib.SCENARIOS["passing"], controller, max_time=2.0)
    >>> ax = plots.plot_robot_paths({"gamma = 0.05": log})
    """
    ax = get_axes(ax, size=(9, 4))
    first = next(iter(runs.values()))
    set_limits(ax, [(run, np.zeros(1, int)) for run in runs.values()])
    draw_scenery(ax, first.scenario)
    for zone in place_zones(first.zones, first.people[0]):
        draw_zone(ax, zone, ZONE_COLOURS(0.5))
    styles = zip((BLUE, ORANGE, GREEN, BLACK), ("-", "--", "-.", ":"), strict=True)
    for (name, run), (colour, line) in zip(runs.items(), styles, strict=False):
        ax.plot(*run.states[:, :2].T, color=colour, linestyle=line, linewidth=2, label=name)
    add_legend_below(ax, gap=0.15, ncols=4)
    return label_metres(ax, first.scenario.title)


def plot_crowd(run: Run, *, walked: Array | None = None, ax: Axes | None = None) -> Axes:
    """Plot the paths of the robot and of all people, with a dot each second.

    The robot, people and zones are drawn at the time when the robot is nearest to a person.

    Parameters
    ----------
    run : the run.
    walked : path of the person whom the robot replaces, shape (n, 2) [m].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import szlib
    >>> import plots
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> log = szlib.simulate(szlib.SCENARIOS["passing"], controller, max_time=2.0)
    >>> ax = plots.plot_crowd(log)
    """
    ax = get_axes(ax, size=(6, 5))
    second = max(1, round(1 / run.settings.dt))
    distance = np.hypot(run.relative[..., 0], run.relative[..., 1])
    row = int(nanmin(distance, axis=1).argmin())
    path = np.vstack([run.states[:, :2], run.scenario.goal])
    low, high = path.min(axis=0) - _CROWD_MARGIN, path.max(axis=0) + _CROWD_MARGIN
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    for i, (x, y) in enumerate(np.moveaxis(run.people[:, :, :2], 0, -1)):
        ax.plot(x, y, color=RED, linewidth=1, alpha=0.5, label="people" if i == 0 else None)
        ax.plot(x[::second], y[::second], ".", color=RED, markersize=3, alpha=0.5)
    if walked is not None:
        ax.plot(
            *walked.T,
            "--",
            color=GREEN,
            linewidth=2,
            label="person replaced",
        )
    ax.plot(*run.states[:, :2].T, color=BLUE, linewidth=2, label="robot")
    ax.plot(*run.states[::second, :2].T, ".", color=BLUE, markersize=5)
    draw_scenery(ax, run.scenario)
    draw_moving(ax, run, row, robot=BLUE, zone=RED)
    return label_metres(ax, run.scenario.title)


def draw_crowds(runs: Mapping[str, Run]) -> Figure:
    """Draw `runs` along x through one crowd side by side, with the time to the goal and that with h < 0.

    Examples
    --------
    >>> import szlib
    >>> import plots
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> log = szlib.simulate(szlib.SCENARIOS["passing"], controller, max_time=2.0)
    >>> plots.draw_crowds({"ours": log, "again": log}).axes[0].get_title()
    'ours: no goal in 2 s, h >= 0'
    """
    figure, panels = plt.subplots(
        1, len(runs), figsize=(10, 2.9), layout="constrained", sharex=True, sharey=True
    )
    reach = np.concatenate([run.states[:, 1] for run in runs.values()])
    for ax, (name, run) in zip(panels, runs.items(), strict=True):
        plot_crowd(run, ax=ax).set(xlim=(-1, 12), ylim=(reach.min() - 2, reach.max() + 1))
        metrics = compute_metrics(run)
        arrival = f"goal in {metrics['time_to_goal']:.1f} s"
        end = arrival if run.success else f"no goal in {run.time[-1]:.0f} s"
        within = run.settings.dt * metrics["violations"]
        ax.set_title(f"{name}: {end}, " + (f"h < 0 for {within:.1f} s" if within else "h >= 0"))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right center")
    return figure

"""One scene, driven by the paper's chain and by ours (notebooks 09 to 11), or with several settings (notebook 12)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import plots
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pandas.io.formats.style import Styler
from studies.lesson_zones import choose_paper_zone, choose_zone
from studies.paper_claims import count_claims, drive, record_claims

import szlib
from szlib.control.settings import TOLERANCE
from szlib.simulation.metrics import ACTIVE_RESIDUAL
from szlib.simulation.robot_run import Run
from szlib.simulation.scenario import Scenario
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, TUNED, NotebookRecord, parameters

FIVE_NUMBERS = {
    "time_to_goal": "time to goal [s]",
    "min_h": "least h [m]",
    "min_speed": "slowest [m/s]",
    "min_clearance": "least clearance [m]",
    "time_yielding": "time yielding [s]",
}
"""The five numbers that the chapters show of a run: the metric, and its name with the unit."""
PAPERS, OURS = "the paper's chain", "ours"
ATC_ZONE = "atc-paper"
ON_ATC = "the paper's chain, zone of the ATC day"
STYLES = {PAPERS: ("--", figures.ORANGE), OURS: ("-", figures.BLUE)}
PASSAGE = (0.0, 3.0)
"""Both ends of the passage of the scenarios "waiting" and "making_room" [m]."""


@dataclass(frozen=True)
class ScenarioRuns:
    """The runs of a scenario: `paper`, by the paper's chain, `ours`, and `atc`, by the paper's chain with the zone
    that it gives for a day of the paper's mall."""

    paper: Run
    ours: Run
    atc: Run

    def all_by_name(self) -> dict[str, Run]:
        """The runs by their names; figures show those of `STYLES`."""
        return {PAPERS: self.paper, ON_ATC: self.atc, OURS: self.ours}


def paper_settings(settings: szlib.MPCSettings) -> szlib.MPCSettings:
    """The paper's controller with gamma, N, N_h and a_max of ours: the paper gives none of gamma and a_max."""
    same = {name: getattr(settings, name) for name in ("gamma", "N", "N_h", "a_max")}
    return szlib.MPCSettings.paper(**same)


def drive_both(record: NotebookRecord, scenario: Scenario, settings: szlib.MPCSettings) -> ScenarioRuns:
    """Drive a `scenario` with the paper's chain, on this data and on the ATC day, and with our zone and `settings`."""
    papers = paper_settings(settings)
    paper = drive(scenario, choose_paper_zone(record), papers)
    atc = drive(scenario, szlib.reference_zone(ATC_ZONE).ellipse, papers)
    return ScenarioRuns(paper, drive(scenario, choose_zone(record), settings), atc)


def list_parameters(settings: szlib.MPCSettings, *more: tuple[str, object, str, str]) -> Styler:
    """The parameters of a notebook with their sources, folded: those of all three chapters, and `more`."""
    differences = (
        "5 cm of margin around walls, no rule of the side, the zone by LOF and hull: "
        "gamma and a_max are ours there, too"
    )
    return parameters(
        [
            *more,
            ("N, N_h, dt", f"{settings.N}, {settings.N_h}, {settings.dt} s", PAPER, "sec. 4"),
            ("gamma", settings.gamma, TUNED, "on these four scenarios; in 2,000 other worlds: chapter 09"),
            (
                "a_max; Q, R, P",
                f"{settings.a_max} m/s²; as in chapter 08",
                ASSUMED,
                "the paper gives none, its code others",
            ),
            ("head_on_share", settings.head_on_share, ASSUMED, "ours: where the rule of the side acts"),
            ("the paper's chain", "", PAPER, differences),
        ]
    )


def tabulate_five(runs: Mapping[str, Run]) -> pd.DataFrame:
    """The five numbers of each run, its side, and how many of the paper's claims hold: one row a run."""
    found = {name: run.metrics() for name, run in runs.items()}
    rows = {name: [metrics[key] for key in FIVE_NUMBERS] for name, metrics in found.items()}
    table = pd.DataFrame.from_dict(rows, orient="index", columns=list(FIVE_NUMBERS.values())).round(2)
    table["side"] = [metrics["passing_side"] for metrics in found.values()]
    table["claims that hold"] = ["{} of {}".format(*count_claims(run)) for run in runs.values()]
    return table


def record_safety(record: NotebookRecord, runs: ScenarioRuns, prefix: str = "") -> None:
    """Record what must hold for our run with any zone that leaves the scene passable, and what the paper's do."""
    found = runs.ours.metrics()
    for text, holds, evidence in (
        ("the goal is reached", found["success"], "after {time_to_goal:.1f} s"),
        ("h >= 0 at every step", found["min_h"] >= 0, "least h {min_h:.2f} m"),
        ("no infeasible step", found["infeasible_steps"] == 0, "{infeasible_steps} steps"),
        (
            "nothing is touched (Euclidean)",
            found["min_clearance"] > 0,
            "least clearance {min_clearance:.2f} m",
        ),
        ("never faster than 1 m/s", found["max_speed"] <= 1 + 1e-6, "greatest speed {max_speed:.2f} m/s"),
    ):
        record.check(prefix + text, holds, evidence.format_map(found))
    for name, run in {PAPERS: runs.paper, ON_ATC: runs.atc}.items():
        paper = run.metrics()
        is_safe = paper["min_h"] >= -TOLERANCE and paper["min_clearance"] > 0
        evidence = (
            "goal after {time_to_goal:.1f} s, least h {min_h:.2f} m, least clearance "
            "{min_clearance:.2f} m, side {passing_side}"
        ).format_map(paper)
        record.claim(f"{prefix}{name}: safe, and at its goal", is_safe and paper["success"], evidence)
    honest = runs.paper.metrics()["unflagged_violations"]
    text = f"{prefix}the paper's chain: no step that called itself safe led to h < 0"
    record.check(text, honest == 0, f"{honest} steps", always=True)
    record.key |= {f"{prefix}{key}": found[key] for key in FIVE_NUMBERS}


def record_both_claims(record: NotebookRecord, runs: ScenarioRuns, prefix: str = "") -> None:
    """Record the claims of the paper about a scenario, for the paper's chain and for ours."""
    for name, run in {"": runs.paper, "ours: ": runs.ours}.items():
        record_claims(record, run.scenario.claims, run, prefix=f"{prefix}{name}")


def draw_paths_and_speeds(runs: ScenarioRuns, title: str) -> Figure:
    """Draw the paths of both robots beside their speeds over time; the `title` says the result."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.6), layout="constrained", width_ratios=(1.5, 1))
    # plot_robot_paths draws the first run as STYLES has ours, and the second as the paper's.
    plots.plot_robot_paths({OURS: runs.ours, PAPERS: runs.paper}, ax=left)
    left.get_legend().remove()
    figures.add_shared_legend((left,))
    left.set_title("Paths, and the zone at the start")
    for name, (line, colour) in STYLES.items():
        run = runs.all_by_name()[name]
        right.plot(run.time, run.speed, line, color=colour)
    right.set(xlabel="time [s]", ylabel="speed [m/s]", ylim=(0, 1.1), title="Speeds")
    figure.suptitle(title)
    return figure


def draw_space_time(ax: Axes, runs: ScenarioRuns, title: str) -> None:
    """Draw x over time of both robots and of the person with the zone, and the passage as a band."""
    ax.axhspan(*PASSAGE, color=figures.GREY, alpha=0.25, lw=0, label="inside the passage")
    for name, (line, colour) in STYLES.items():
        run = runs.all_by_name()[name]
        ax.plot(run.time, run.states[:, 0], line, color=colour, linewidth=2, label=f"robot, {name}")
    time, x, reach = runs.ours.time, runs.ours.people[:, 0, 0], runs.ours.zones[0].semi_axes[0]
    ax.plot(time, x, ":", color=figures.RED, linewidth=2, label="person")
    ax.fill_between(time, x - reach, x + reach, color=figures.RED, alpha=0.15, lw=0, label="zone")
    ax.set(xlabel="time [s]", ylabel="x [m]", title=title, ylim=(-4, 6.5))


def draw_space_times(runs: Mapping[str, ScenarioRuns]) -> Figure:
    """Draw `draw_space_time` of several scenarios side by side; `runs` are by the titles of the panels."""
    figure, panels = plt.subplots(1, len(runs), figsize=(11, 3.9), sharey=True, layout="constrained")
    for ax, (title, each) in zip(panels, runs.items(), strict=True):
        draw_space_time(ax, each, title)
    figures.add_shared_legend(panels)
    return figure


def make_streams(seed: int, pace: float) -> tuple[szlib.Person, ...]:
    """Eight people who walk across the way of a robot at this `pace` [m/s], four from each side."""
    rng = np.random.default_rng(seed)
    side = np.tile([-1, 1], 4)
    row = np.repeat(np.arange(4), 2)
    x = np.where(side < 0, 3.5, 7.5) - 0.8 * side * (row % 2) + rng.uniform(-0.4, 0.4, 8)
    y = side * (np.where(side < 0, 1.5, 2.5) + 4 * row) + rng.uniform(-0.4, 0.4, 8)
    return tuple(szlib.Person((x[i], y[i]), (0.0, -pace * side[i])) for i in range(8))


def drive_each(
    zone: szlib.Ellipse,
    goal: tuple[float, float],
    people: tuple[szlib.Person, ...] = (),
    walls: Any = (),
    *,
    settings: Mapping[str, szlib.MPCSettings],
    speed: float = 0.0,
    title: str = "A meeting",
) -> dict[str, Run]:
    """The run with each of the `settings`, by name, of a robot that starts at the origin with a `speed` [m/s]."""
    walls = np.reshape(walls, (-1, 2, 2)).astype(float)
    start = np.array([0.0, 0, speed, 0])
    scene = Scenario("scene", start, np.array(goal), people, walls, title=title, duration=40.0)
    robots = {name: szlib.MPCCBF(zone, walls=walls, settings=each) for name, each in settings.items()}
    return {name: szlib.drive(scene, robot) for name, robot in robots.items()}


def find_holding_times(run: Run) -> dict[str, np.ndarray]:
    """The times [s] at which the person, and each wall of a corridor, holds the robot back."""
    holds = run.residual.min(axis=2) <= ACTIVE_RESIDUAL
    rows = ("person", "wall to its left", "wall to its right")
    return {name: run.time[row] for name, row in zip(rows, holds.T, strict=True)}


def list_arrivals(table: Sequence[Mapping[str, Any]]) -> str:
    """The runs of a recording of widths and paces, with their times to the goal, the latest first."""
    rows = sorted(table, key=lambda row: row["time"] or math.inf, reverse=True)
    return "; ".join(
        f"{row['width']:g} m and {row['pace']:g} m/s: "
        + (f"{row['time']:.1f} s" if row["time"] else "not within 30 s")
        for row in rows
    )

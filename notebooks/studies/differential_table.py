"""The table of robots with two wheels in random worlds.

    python -m studies.differential_table [--worlds 2000]

Writes notebooks/tables/29_differential.csv: a row for each robot, all of them in the same worlds, by
`szlib.rollouts`. Beside its metrics, which are about the robot's disc at the samples, the disc is followed
along its arcs, ten times within each step, and Euclidean distances to zones, bodies and walls are taken
there. Finished worlds are kept in results/rollouts, so that a run that was stopped goes on.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from studies.committed import WORLDS, read_arguments, study, write_table
from studies.distances import euclidean_to_ellipse, euclidean_to_segment

import szlib
from szlib.control.differential_drive import Unicycle
from szlib.control.obstacles import ellipse_distance
from szlib.control.settings import TOLERANCE
from szlib.core.checks import Array
from szlib.simulation.baseline_controllers import DEFAULT_ZONE, make_mpc_cbf
from szlib.simulation.monte_carlo import RolloutSetup
from szlib.simulation.scenario import GOAL_RADIUS, ONE_PERSON, Worlds
from szlib.workbook.claims import find_interval
from szlib.zones.ellipses import BODY_RADIUS

TABLE = "29_differential"
FIRST = 1_000_000
"""Seed of the first world: that of the first block of rollout_table."""
SUBSTEPS = 10
NEAR = 0.6
"""A robot that ends this close to the goal, but not at it, was blocked by an obstacle beside it [m]."""


def two_wheels(scenario: szlib.Scenario, settings: szlib.MPCSettings, omega_max: float) -> Any:
    """A differential drive that heads anywhere where it starts at rest."""
    drive = szlib.DifferentialDrive(
        DEFAULT_ZONE,
        walls=scenario.walls,
        settings=settings,
        omega_max=omega_max,
    )
    rng = np.random.default_rng([int(scenario.name.split()[1]), 3])
    drive.robot = Unicycle(rng.uniform(-np.pi, np.pi))
    return drive


def nimble(scenario: szlib.Scenario, settings: szlib.MPCSettings) -> Any:
    """Turns at up to 8 rad/s."""
    return two_wheels(scenario, settings, 8.0)


def common(scenario: szlib.Scenario, settings: szlib.MPCSettings) -> Any:
    """Turns at up to 4 rad/s."""
    return two_wheels(scenario, settings, 4.0)


def slow(scenario: szlib.Scenario, settings: szlib.MPCSettings) -> Any:
    """Turns at up to 2 rad/s."""
    return two_wheels(scenario, settings, 2.0)


ROBOTS = {"double integrator": make_mpc_cbf, "8 rad/s": nimble, "4 rad/s": common, "2 rad/s": slow}
TABULATED = ["double integrator", "4 rad/s"]
"""Robots of the table; the others run on request."""
SETS = {"all": Worlds(), "one person": ONE_PERSON}


def along(log: szlib.SimulationLog) -> Array:
    """The disc's centre within each step, and at its end, shape (steps, SUBSTEPS, 2) [m].

    Of two wheels along an arc, whose direction is that of its chord less half its turn; else by the
    constant acceleration.
    """
    dt, at, after = log.settings.dt, log.states[:-1], log.states[1:, :2]
    t = dt * np.arange(1, SUBSTEPS + 1) / SUBSTEPS
    u = log.controls[:-1, None]
    if log.inputs == ("ax", "ay"):
        return at[:, None, :2] + t[:, None] * at[:, None, 2:] + 0.5 * t[:, None] ** 2 * u
    v, omega = u[..., 0], u[..., 1]
    chord = (after - at[:, :2]) * np.sign(v)
    heading = np.arctan2(chord[:, 1:], chord[:, :1]) - omega * dt / 2 + omega * t / 2
    way = v * t * np.sinc(omega * t / 2 / np.pi)
    centers = at[:, None, :2] + way[..., None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    if not np.allclose(centers[:, -1], after, atol=1e-9):
        raise ValueError(f"{log.scenario.name}: the arcs do not end where the robot is")
    return centers


def to_zone(points: Array, zone: szlib.Ellipse) -> Array:
    """Euclidean distances where they matter, within 1 m; beyond, the focal ones, which are smaller."""
    distances = ellipse_distance(points, zone)
    near = distances < 1.0
    distances[near] = euclidean_to_ellipse(points[near], zone)
    return distances


def finely(log: szlib.SimulationLog) -> dict[str, float]:
    """Smallest Euclidean gaps of the disc within and after the steps that said they were safe, and more."""
    s, centers = log.settings, along(log)
    share = np.arange(1, SUBSTEPS + 1)[:, None] / SUBSTEPS
    gaps: dict[str, list[Array]] = {"zone": [], "body": [], "wall": []}
    for i, zone in enumerate(log.zones):
        here, there = log.people[:-1, None, i, :2], log.people[1:, None, i, :2]
        offset, heading = centers - here - share * (there - here), log.people[0, i, 2]
        gaps["zone"].append(to_zone(offset, zone.placed((0.0, 0.0), heading)) - s.r_robot)
        gaps["body"].append(np.hypot(*np.moveaxis(offset, -1, 0)) - BODY_RADIUS - s.r_robot)
    gaps["wall"] = [euclidean_to_segment(centers, *wall) - s.r_robot for wall in log.scenario.walls]
    row = {}
    for name, found in gaps.items():
        least = np.min(found, axis=(0, 2)) if found else np.full(len(centers), np.inf)
        row[f"fine_{name}"] = float(least[log.safe[:-1]].min(initial=np.inf))
        row[f"fine_{name}_broken"] = float((log.safe[:-1] & (least < -TOLERANCE)).sum())
    steps = np.abs(np.diff(log.controls[:, 0] if log.inputs == ("v", "omega") else log.speed))
    row["steps"] = float(len(centers))
    row["away"] = float(np.hypot(*(log.states[-1, :2] - log.scenario.goal)))
    return row | {"largest_dv": float(steps.max(initial=0.0)) / s.dt}


def line(rows: pd.DataFrame, against: pd.DataFrame) -> dict[str, Any]:
    """One robot in all the worlds, against the double integrator in the same."""
    n, arrived = len(rows), int(rows["success"].sum())
    both = rows["success"].to_numpy() & against["success"].to_numpy()
    later = (rows["time_to_goal"] - against["time_to_goal"])[both].to_numpy()
    drawn = np.random.default_rng(0).choice(later, (2000, len(later))).mean(axis=1)
    broken = int((rows["unflagged_violations"] > 0).sum())
    low, high = find_interval(arrived, n)
    return {
        "worlds": n,
        "steps": int(rows["steps"].sum()),
        "unflagged h < 0, steps": int(rows["unflagged_violations"].sum()),
        "worlds with one, high 95 %": find_interval(broken, n)[1],
        **{f"unflagged fine {g} < 0, steps": int(rows[f"fine_{g}_broken"].sum()) for g in GAPS},
        **{f"least fine {g} [m]": float(rows[f"fine_{g}"].min()) for g in GAPS},
        "flagged steps": int(rows["flagged_steps"].sum()),
        "share h < 0": float((rows["min_h"] < -TOLERANCE).mean()),
        "share arrived": arrived / n,
        "arrived low": low,
        "arrived high": high,
        "share near": float(((rows["away"] < NEAR) & (rows["away"] > GOAL_RADIUS)).mean()),
        "time to goal, median [s]": float(rows["time_to_goal"].median()),
        "later, mean [s]": float(later.mean()),
        "later low [s]": float(np.quantile(drawn, 0.025)),
        "later high [s]": float(np.quantile(drawn, 0.975)),
        "path, median [m]": float(rows.loc[rows["success"], "path_length"].median()),
        "largest change of speed, p99 [m/s2]": float(rows["largest_dv"].quantile(0.99)),
        "solve time, median [ms]": 1000 * float(rows["solve_time_median"].median()),
        "solve time, p99 [ms]": 1000 * float(rows["solve_time_p99"].max()),
    }


GAPS = ("zone", "body", "wall")


def probe(name: str, robot: str) -> dict[str, float]:
    """Path and smallest gap to a zone in the first worlds [m], without a time limit."""
    settings = szlib.MPCSettings(time_limit=np.inf)
    setup = RolloutSetup(worlds=SETS[name], controller=ROBOTS[robot], measure=finely)
    first = szlib.rollouts(3, setup, settings=settings, seed=FIRST, progress=False)
    return {"probe path": float(first["path_length"].sum()), "probe zone": float(first["fine_zone"].min())}


@study("29_differential", notebook="29")
def recompute(row: pd.Series) -> dict[str, float]:
    return probe(row["set"], row["robot"])


def main() -> None:
    given = read_arguments(__doc__, worlds=2000, jobs=-1, out=WORLDS, robots=TABULATED, sets=list(SETS))
    options = {"seed": FIRST, "out": given.out, "n_jobs": given.jobs}
    lines = []
    for name in given.sets:
        setup = RolloutSetup(worlds=SETS[name], measure=finely)
        tables = {
            robot: szlib.rollouts(given.worlds, replace(setup, controller=ROBOTS[robot]), **options)
            for robot in given.robots
        }
        against = szlib.rollouts(given.worlds, setup, **options)
        for robot, rows in tables.items():
            lines.append({"set": name, "robot": robot, **line(rows, against), **probe(name, robot)})
        write_table(pd.DataFrame(lines), TABLE, seed=FIRST)


if __name__ == "__main__":
    main()

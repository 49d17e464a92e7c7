"""The claims of the paper in many conditions: the tables of notebook 28.

    python -m studies.paper_matrix zones    28_zones.csv    zones by the paper's chain, people drawn anew
    python -m studies.paper_matrix robots   28_matrix.csv   in how many zones each claim holds, by condition

A zone is drawn from each of `SOURCES`: pairs of people with replacement, or a plaza of another seed. `CHAINS`
varies the paper's chain, `ROBOTS` its controller; each varies one thing. `CONTROLS` are robots without what
the paper gives as the cause. They are no conditions: a claim about a cause compares with them. A zone that
leaves the robot no room in the corridor is not counted there. The real data is looked for in
$SZLIB_DATA_DIR (atc-1hz/ and gc/). Finished zones are kept in results/paper_matrix, so that a run that was
stopped goes on. Two hours on one core.
"""

from __future__ import annotations

import json
import tempfile
import textwrap
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import joblib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from studies.claims import SITES
from studies.committed import claim_new_folder, read_arguments, study, write_table
from studies.lesson_zones import WIDEST
from studies.plaza_truth import true_kinds

import szlib
from szlib.control.people import TrackedPeople
from szlib.control.settings import TOLERANCE
from szlib.core.parallel import run_tasks
from szlib.simulation.catalogue import SCENARIOS
from szlib.simulation.robot_run import Run
from szlib.simulation.scenario import Scenario
from szlib.workbook.record import read_table
from szlib.zones.hulls import HullEstimator
from szlib.zones.outliers import complementary_points, is_outlier, local_outlier_factors, pair_numbers

DRAWS = 40
PLAZAS = "plazas"
SOURCES = {
    "ATC day, everybody": ("ATC day", None),
    "ATC day, strangers": ("ATC day", "strangers"),
    "Grand Central, everybody": ("Grand Central", None),
    PLAZAS: ("plaza", None),
}
"""Site and kind of people of each source of zones."""
PAPERS = "the paper's"
CHAINS: dict[str, dict[str, Any]] = {
    PAPERS: {},
    "no outliers removed": {"fraction": 0.0},
    "0.1 % removed": {"fraction": 0.001},
    "0.4 % removed": {"fraction": 0.004},
    "200 neighbours": {"n_neighbours": 200},
    "r_max = 2.5 m": {"r_max": 2.5},
}
"""The chain of the paper, and what each other chain changes."""
PAPER_CHAIN: dict[str, Any] = {"fraction": 0.002, "n_neighbours": 20, "r_max": 2.0}
SPEEDS = (0.7, 1.1, 1.3)
"""Slow, that of the robot's zone, and fast [m/s]."""
PAPER = szlib.MPCSettings.paper()
WEIGHTS_OF_CODE: dict[str, Any] = {"Q": (10.0,) * 4, "R": (1.0,) * 2, "P": (100.0,) * 4}
"""Of the public code that the paper uses (Zeng, Zhang and Sreenath, MPC-CBF, examples/test.m)."""
ROBOTS = {
    PAPERS: PAPER,
    **{f"gamma = {gamma:g}": replace(PAPER, gamma=gamma) for gamma in (0.02, 0.1, 0.2, 0.4)},
    **{f"N_h = {n}": replace(PAPER, N_h=n) for n in (1, 4, 8)},
    "weights of its code": replace(PAPER, **WEIGHTS_OF_CODE),
    "weights and gamma of its code": replace(PAPER, gamma=0.4, **WEIGHTS_OF_CODE),
    "ours": szlib.MPCSettings(time_limit=np.inf),
}
"""The paper's controller, with one change each; and ours."""
NO_BARRIER, DISTANCE, CIRCLE = "no barrier of the person", "gamma = 1", "circle of the same area"
CONTROLS = (NO_BARRIER, DISTANCE, CIRCLE)
LARGER = 1.2
SLOWER = 0.05
"""By how much slower a robot is beside the person, as a share of its greatest speed, if a barrier slows it."""
NO_SCENARIO = "-"
FOLDER = Path("../results/paper_matrix")


class Blind(szlib.MPCCBF):
    """The controller of a robot that does not look at people; its steps know of them, so that they can be judged."""

    def step(self, state: Any, goal: Any, people: Any = (), **options: Any) -> szlib.Step:
        step = super().step(state, goal, **options)
        tracked = TrackedPeople(tuple(people))
        scene = self._make_scene(step.scene.state, step.scene.goal, tracked)
        return replace(step, scene=scene)


# --- zones -------------------------------------------------------------------------------------------


@cache
def read_source(source: str, draw: int = 0) -> pd.DataFrame:
    """All samples of a source; of plazas, those of the plaza of this seed."""
    site, kind = SOURCES[source]
    if source == PLAZAS:
        with tempfile.TemporaryDirectory() as folder:
            tracks = szlib.read_tracks(szlib.make_plaza(Path(folder) / "plaza.csv", seed=draw))
        return szlib.find_encounters(tracks, square=szlib.ATC_SQUARE)
    load, square = SITES[site]
    samples = szlib.find_encounters(load(), square=square)
    return szlib.of_kind(samples, kind) if kind else samples


def draw_people(samples: pd.DataFrame, draw: int) -> pd.DataFrame:
    """Pairs of people of `samples`, drawn with replacement; a pair that is drawn twice is two pairs."""
    pair = pair_numbers(samples)
    n = int(pair.max()) + 1
    counts = np.random.default_rng(draw).multinomial(n, np.full(n, 1 / n))[pair]
    rows = np.repeat(np.arange(len(samples)), counts)
    copy = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
    drawn = samples.iloc[rows].reset_index(drop=True)
    return drawn.assign(encounter=drawn["encounter"] * (int(counts.max()) + 1) + copy)


def fit_chain(samples: pd.DataFrame, chain: str) -> dict[str, float]:
    """The zone by a chain: the ellipse at 1.1 m/s, and the areas of a slow and of a fast walker [m2]."""
    options = PAPER_CHAIN | CHAINS[chain]
    try:
        estimator = HullEstimator.from_samples(samples, **options)
        found = estimator.refit(np.ones((1, len(estimator.encounters))), SPEEDS)[0]
    except szlib.SzlibError:
        found = np.full((len(SPEEDS), 5), np.nan)
    slow, middle, fast = found.tolist()
    names = ("center_x", "center_y", "a", "b", "angle")
    areas = {"area_slow": np.pi * slow[2] * slow[3], "area_fast": np.pi * fast[2] * fast[3]}
    return dict(zip(names, middle, strict=True)) | areas


def judge_outliers(samples: pd.DataFrame, chain: str, seed: int) -> dict[str, float]:
    """Of a plaza: the share of intruders in what LOF removes, and of the outliers that lie nearer than 1 m
    in complementary and in plain coordinates."""
    options = PAPER_CHAIN | CHAINS[chain]
    close = samples[samples["distance"] <= options["r_max"]]
    removed = is_outlier(close, **options)
    if not removed.any():
        return {}
    intruder = true_kinds(close, seed=seed) == "intruder"
    points = complementary_points(close, r_max=options["r_max"])
    plain = close["distance"].to_numpy()[:, None] * points / np.hypot(*points.T)[:, None].clip(1e-9)
    factors = local_outlier_factors(plain, options["n_neighbours"])
    near = (close["distance"] < 1.0).to_numpy()
    as_many = factors >= np.sort(factors)[-removed.sum()]
    return {
        "intruders_removed": round(float(intruder[removed].mean()), 3),
        "edge_removed": float(near[removed & ~intruder].sum()),
        "edge_removed_plain": float(near[as_many & ~intruder].sum()),
    }


def list_zones(source: str, draws: Sequence[int]) -> Iterator[dict[str, Any]]:
    """The zones of a source, one row a draw and a chain."""
    for draw in draws:
        is_plaza = source == PLAZAS
        samples = read_source(source, draw) if is_plaza else draw_people(read_source(source), draw)
        for chain in CHAINS:
            row: dict[str, Any] = {"source": source, "draw": draw, "chain": chain}
            row |= shorten(fit_chain(samples, chain), chain)
            yield row | (judge_outliers(samples, chain, draw) if is_plaza else {})


def shorten(zone: dict[str, float], chain: str) -> dict[str, float]:
    """What a table needs of a `zone`: all of the paper's, for the robots, and of others what claims are about."""
    if chain == PAPERS:
        return zone
    return {name: round(zone[name], 3) for name in ("center_x", "a", "area_slow", "area_fast")}


@study("28_zones", notebook="28")
def recompute_zone(row: pd.Series) -> dict[str, float]:
    """The zone of a plaza, again."""
    return shorten(fit_chain(read_source(PLAZAS, int(row["draw"])), row["chain"]), row["chain"])


# --- robots ------------------------------------------------------------------------------------------


def drive(scenario: Scenario, zone: szlib.Ellipse, settings: szlib.MPCSettings, control: str = "") -> Run:
    """The run of a `scenario` with these `settings`, or of one of the `CONTROLS`."""
    if control == DISTANCE:
        settings = replace(settings, gamma=1.0)
    if control == CIRCLE:
        radius = float(np.sqrt(np.prod(zone.semi_axes)))
        zone = szlib.Ellipse((0.0, 0.0), (radius, radius))
    make = Blind if control == NO_BARRIER else szlib.MPCCBF
    return szlib.simulate(scenario, make(zone, walls=scenario.walls, settings=settings))


def has_room(scenario: Scenario, zone: szlib.Ellipse) -> bool:
    """Whether a `zone` leaves the robot room to pass."""
    return scenario.name != "corridor" or bool(np.abs(zone.curve()[:, 1]).max() <= WIDEST)


Answers = dict[str, bool]
"""Whether each claim holds, by the claim."""


def judge_run(run: Run, zone: szlib.Ellipse, settings: szlib.MPCSettings, control: str = "") -> Answers:
    """The claims about one scenario, from its `run` with this `zone`."""
    scenario, found = run.scenario, run.metrics()
    is_safe = bool(found["min_h"] >= -TOLERANCE)
    answers = {claim.text: bool(claim.check(run)[0]) for claim in scenario.claims}
    answers["The robot remains within the safety set."] = is_safe
    if scenario.name in ("passing", "corridor"):
        answers["The robot passes on the right."] = found["passing_side"] == "right"
    if scenario.name == "passing":
        answers["The robot navigates around the person."] = is_safe and bool(found["success"])
    if scenario.name == "corridor":
        answers["No wall is touched, and the zone stays free."] = is_safe and found["min_clearance"] > 0
    scaled = zone.scaled(LARGER)
    if scenario.name in ("corridor", "waiting") and has_room(scenario, scaled):
        larger = drive(scenario, scaled, settings, control).metrics()
        is_later = not larger["time_to_goal"] <= found["time_to_goal"]
        answers["A larger zone makes the robot yield longer, and later."] = bool(
            is_later and larger["time_yielding"] > found["time_yielding"]
        )
    if scenario.name == "corridor" and control != DISTANCE:
        (_, slow), (_, plain) = (
            scenario.claims[0].check(each) for each in (run, drive(scenario, zone, settings, DISTANCE))
        )
        answers["The barrier slows the robot: a plain distance does not."] = bool(slow < plain - SLOWER)
    return answers


def judge_zone(
    zone: szlib.Ellipse,
    names: Sequence[str] = tuple(SCENARIOS),
    conditions: Sequence[str] = (*ROBOTS, *CONTROLS),
) -> Iterator[dict[str, Any]]:
    """Each claim about a robot with this `zone`: one row a claim, a scenario of these `names` and a condition."""
    for condition in conditions:
        settings = ROBOTS.get(condition, PAPER)
        control = condition if condition in CONTROLS else ""
        for name in (each for each in names if has_room(SCENARIOS[each], zone)):
            run = drive(SCENARIOS[name], zone, settings, control)
            for claim, holds in judge_run(run, zone, settings, control).items():
                yield {"claim": claim, "scenario": name, "condition": condition, "holds": holds}


def read_zone(row: pd.Series) -> szlib.Ellipse:
    """The zone in a row of 28_zones.csv."""
    return szlib.Ellipse((row["center_x"], row["center_y"]), (row["a"], row["b"]), row["angle"])


def judge_row(source: str, draw: int, zone: szlib.Ellipse) -> list[dict[str, Any]]:
    """`judge_zone` of a draw, kept in `FOLDER`."""
    file = FOLDER / f"{source}-{draw}.json"
    if not file.exists():
        warnings.simplefilter("ignore", szlib.DataWarning)
        rows = [{"source": source, "draw": draw, **row} for row in judge_zone(zone)]
        file.write_text(json.dumps(rows), encoding="utf-8")
    found: list[dict[str, Any]] = json.loads(file.read_text(encoding="utf-8"))
    return found


def list_robots(zones: pd.DataFrame, jobs: int) -> Iterator[dict[str, Any]]:
    """The claims about robots, in each of the `zones` by the paper's chain."""
    claim_new_folder(FOLDER, "judged zones of studies")
    papers = zones.query('chain == "the paper\'s"').dropna(subset=["a"]).sort_values(["draw", "source"])
    found = [(row["source"], row["draw"], read_zone(row)) for _, row in papers.iterrows()]
    tasks = [joblib.delayed(judge_row)(*each) for each in found]
    for rows in run_tasks(tasks, n_jobs=jobs):
        yield from rows


# --- what the zones say ------------------------------------------------------------------------------


CHAIN_CLAIMS: dict[str, Callable[[pd.DataFrame], pd.Series]] = {
    "The zone is larger in front of the person.": lambda zone: zone["center_x"] > 0,
    "The zone grows with the speed (ours, not the paper's).": lambda zone: (
        zone["area_fast"] > zone["area_slow"]
    ),
    "Most of what LOF removes are outliers.": lambda zone: zone["intruders_removed"] > 0.5,
    "Complementary distances spare the edge.": lambda zone: zone["edge_removed"] < zone["edge_removed_plain"],
}
"""The claims about a zone and its outliers, from rows of 28_zones.csv."""


def list_chains(zones: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """The claims about zones, in each row that can decide them."""
    for claim, judge in CHAIN_CLAIMS.items():
        needs = "intruders_removed" if "LOF" in claim or "edge" in claim else "area_slow"
        known = zones.dropna(subset=[needs, "a"])
        for row, holds in zip(known.to_dict("records"), judge(known), strict=True):
            yield {
                **{name: row[name] for name in ("source", "draw")},
                "claim": claim,
                "scenario": NO_SCENARIO,
                "condition": row["chain"],
                "holds": bool(holds),
            }


CELL = ["claim", "scenario", "source", "condition"]


def count(rows: pd.DataFrame) -> pd.DataFrame:
    """One line a cell of `rows` in the order of draws: how many, in how many the claim holds, the first draw, and
    whether it holds there."""
    cells = rows.groupby(CELL, sort=False)
    found = cells["holds"].agg(draws="size", held="sum", probe="first").astype(int)
    found["draw"] = cells["draw"].first()
    found = found.reset_index()
    return found.assign(is_control=found["condition"].isin(CONTROLS))


@study("28_matrix", notebook="28")
def recompute(row: pd.Series) -> dict[str, int]:
    """The first draw of a cell, again: of robots with any zone, of chains on a plaza."""
    zones = read_table("28_zones").query(f"source == {row['source']!r} and draw == {row['draw']}")
    if row["scenario"] == NO_SCENARIO:
        rows = list_chains(pd.DataFrame(list_zones(row["source"], [int(row["draw"])])))
    else:
        zone = read_zone(zones.query('chain == "the paper\'s"').iloc[0])
        rows = judge_zone(zone, [row["scenario"]], [row["condition"]])
    asked = {name: row[name] for name in ("claim", "condition")}
    return {"probe": next(int(each["holds"]) for each in rows if asked.items() <= each.items())}


# --- the picture -------------------------------------------------------------------------------------


def draw_matrix(matrix: pd.DataFrame) -> Figure:
    """Draw the share of draws in which each claim holds, by source and by condition."""
    robots = matrix[matrix["scenario"] != NO_SCENARIO]
    chains = matrix[matrix["scenario"] == NO_SCENARIO]
    parts = [(robots, (*ROBOTS, *CONTROLS), "robot, and controls"), (chains, tuple(CHAINS), "chain")]
    heights = [part["claim"].nunique() for part, _, _ in parts]
    shape = {"height_ratios": heights, "width_ratios": (len(SOURCES), len(ROBOTS) + len(CONTROLS))}
    figure, panels = plt.subplots(2, 2, figsize=(12.5, 10), layout="constrained", gridspec_kw=shape)
    for (part, conditions, title), (left, right) in zip(parts, panels, strict=True):
        names = list(dict.fromkeys(part["claim"]))
        _draw_shares(left, part[~part["is_control"]], "source", list(SOURCES), names)
        _draw_shares(right, part, "condition", list(conditions), names)
        left.set_yticks(range(len(names)), [textwrap.fill(name, 40) for name in names], fontsize=9)
        left.set_title("zones of", fontsize=10)
        right.set_title(title, fontsize=10)
        right.set_yticks([])
    panels[0, 1].axvline(len(ROBOTS) - 0.5, color="black", linewidth=2)
    title = "gamma decides whether the robot is safe, the place whether the zone is larger in front"
    figure.suptitle(f"{title}\n(share of zones in which each claim holds, in %)")
    return figure


def _draw_shares(ax: Axes, cells: pd.DataFrame, factor: str, levels: list[str], names: list[str]) -> None:
    """Draw one panel: claims by the levels of a factor."""
    sums = cells.groupby(["claim", factor])[["held", "draws"]].sum()
    shares = (100 * sums["held"] / sums["draws"]).unstack().reindex(index=names, columns=levels)
    ax.imshow(np.ma.masked_invalid(shares), cmap="cividis", vmin=0, vmax=100, aspect="auto")
    for (i, j), share in np.ndenumerate(shares.to_numpy()):
        if np.isfinite(share):
            colour = "black" if share > 50 else "white"
            ax.text(j, i, f"{share:.0f}", ha="center", va="center", color=colour, fontsize=8)
    ax.set_xticks(range(len(levels)), levels, rotation=40, ha="right", fontsize=9)
    ax.tick_params(length=0)


def main() -> None:
    asked = read_arguments(__doc__, table=("zones", "robots"), draws=DRAWS, jobs=2)
    warnings.simplefilter("ignore", szlib.DataWarning)
    if asked.table == "zones":
        draws = range(1, asked.draws + 1)
        write_table(pd.DataFrame(row for source in SOURCES for row in list_zones(source, draws)), "28_zones")
        return
    zones = read_table("28_zones")
    rows = [*list_chains(zones), *list_robots(zones, asked.jobs)]
    write_table(count(pd.DataFrame(rows)), "28_matrix")


if __name__ == "__main__":
    main()

"""Robots among other people's crowds, real and simulated: the tables of notebook 29.

python -m studies.crowd_trials           both tables, as they are saved: some 15 min on one core
python -m studies.crowd_trials --n 10    at most 10 trials of each kind; with --work FOLDER it goes on from there

29_crowds.csv     means with 95 % intervals: crowd by what people see by controller
29_safety_claims.csv   steps that said they were safe, how many led to h < 0, and what the people did

They go to notebooks/tables.  The real data is looked for in $SZLIB_DATA_DIR (atc-1hz/, gc/, eth/).  The speed
model is left out where JuPedSim is not installed (`INSTALL_JUPEDSIM` in tests/helpers/speed_model.py).  An exception in any trial ends the run.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from importlib.util import find_spec
from itertools import chain, product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from studies import quantile_zone
from studies.claims import SITES
from studies.committed import read_arguments, study, write_table
from studies.replay import ReplacedWalker, Replays, find_replays
from studies.safety_claims import MOTION_CHANGES, safety_violations
from studies.social_metrics import compute_replay_metrics
from studies.summaries import summarise

import szlib
from szlib.simulation.baseline_controllers import CONTROLLERS, ControllerFactory, make_mpc_cbf
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.simulation.crowds import WALKING_MODELS, ModelFactory, ReactingPeople
from szlib.simulation.log import SimulationLog
from szlib.simulation.monte_carlo import RolloutSetup
from szlib.simulation.scenario import Worlds

CROWDED = Worlds(
    people=(6, 10),
    standing=0.2,
    pace=(0.3, 1.2),
    walls=0.3,
    size=8.0,
    travel=(5.0, 8.0),
    start_speed=0.0,
    duration=20.0,
)
"""Six to ten people in 8 m x 8 m, most of whom walk, at up to the pace of a mall."""
WORLDS = {"orca": 250, "speed model": 250, "social force": 150}
WALKERS = {"ATC day": 200, "plaza": 100, "ETH": 150, "Grand Central": 12}
OTHERS, BASELINES, IN_PLACE = 40, 25, 20
"""Trials of the controller with its defaults with each model and at each site (fewer where fewer walkers may
be replaced), at most of it with other settings, of each baseline, and of both in the place of walkers."""
SETTINGS = {
    "MPC-CBF": szlib.MPCSettings(),
    "MPC-CBF, rest": szlib.MPCSettings(terminal="rest"),
    "MPC-CBF, gamma 0.2": szlib.MPCSettings(gamma=0.2, N_h=8),
    "MPC-CBF, among people": szlib.MPCSettings.among_people(),
}
"""szlib's defaults; plans that end at rest; barriers on the whole horizon that may be used up faster; and the
controller that is recommended in crowds."""
PROBE = 1
"""The trial that is driven again in each run of notebook 29: barriers bind there."""
BY = ("crowd", "sees", "controller")
PROBED = ("claimed_safe_steps", "path_efficiency")
"""Columns of the trial `PROBE` in the table of safety claims."""
SCORES = ("reached", "time_to_goal", "path_efficiency", "intrusions", "time_intruding", "nearest")


def measure(log: SimulationLog) -> dict[str, float]:
    """Scores, and violated safety claims by what people did."""
    broken = safety_violations(log)
    counts = {did: float((broken["change"] == did).sum()) for did in MOTION_CHANGES}
    rest = {
        "unexplained": float((~broken["explained"].astype(bool)).sum()),
        "broken_steps": float(broken["t"].nunique()),
        "to_who_kept": float(violated_by_who_kept(log)),
        "steps": float(len(log.states) - 1),
        "worst": float(broken["h"].min()) if len(broken) else np.nan,
    }
    return compute_replay_metrics(log) | counts | rest


def violated_by_who_kept(log: SimulationLog) -> int:
    """Steps that said they were safe, times people with h < 0 then who went on as they had been seen.

    From positions alone, by the sum of the distances to the two foci: nothing of `count_safety_claims` or `log.h`.
    """
    count, s = 0, log.settings
    for k in np.flatnonzero(log.safe[:-1]):
        before, after = log.people[k], log.people[k + 1]
        walked = np.hypot(*(after[:, :2] - before[:, :2] - s.dt * before[:, 3:]).T)
        same = (walked <= 1e-6) & (np.abs(np.angle(np.exp(1j * (after[:, 2] - before[:, 2])))) <= 1e-6)
        for i in np.flatnonzero(same):
            x, y, heading = after[i, :3]
            foci = (x + 1j * y) + np.exp(1j * heading) * (log.zones[i].foci @ (1, 1j))
            robot = complex(*log.states[k + 1, :2])
            h = np.abs(robot - foci).sum() / 2 - log.zones[i].semi_axes[0] - s.r_robot - s.eps
            count += h < -1e-6
    return count


def controllers(
    n: int, most: int, others: int, baselines: int
) -> Iterator[tuple[str, ControllerFactory, szlib.MPCSettings, int]]:
    """Name, factory, settings and trials of each."""
    for name, settings in SETTINGS.items():
        trials = min(n, most) if name == "MPC-CBF" else min(n, most, others)
        yield name, CONTROLLERS["MPC-CBF"], settings, trials
    for name in ("straight", "social force", "dynamic window"):
        yield name, CONTROLLERS[name], szlib.MPCSettings(), min(n, most, baselines)


def factories() -> dict[str, ModelFactory]:
    """The models of walking: szlib's, and JuPedSim's, which the tests define, where it is installed."""
    if not find_spec("jupedsim"):
        return dict(WALKING_MODELS)
    sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
    from helpers.speed_model import SpeedModel

    return {**WALKING_MODELS, "speed model": SpeedModel}


def react(
    n: int,
    model: ModelFactory,
    sees: str,
    factory: ControllerFactory,
    settings: szlib.MPCSettings,
    **more: Any,
) -> pd.DataFrame:
    """Trials of one controller among people who walk by a model; `more`: as of `szlib.rollouts`."""
    return szlib.rollouts(
        n,
        RolloutSetup(
            worlds=CROWDED, behaviour=ReactingPeople(model, sees=sees), controller=factory, measure=measure
        ),
        settings=settings,
        progress=False,
        **more,
    )


def probe(row: pd.Series) -> pd.Series:
    """The trial `PROBE` of a row among people who react, without a time limit: the same on every machine."""
    known = {name: (factory, settings) for name, factory, settings, _ in controllers(1, 1, 1, 1)}
    factory, settings = known[row["controller"]]
    settings = replace(settings, time_limit=np.inf)
    return react(1, factories()[row["crowd"]], row["sees"], factory, settings, seed=PROBE).iloc[0]


@study("29_crowds", notebook="29")
def recompute(row: pd.Series) -> dict[str, float]:
    """The trial `PROBE` of a row of the means, again."""
    return {"probe": probe(row)[row["metric"]]}


@study("29_safety_claims", notebook="29")
def recompute_safety_claims(row: pd.Series) -> dict[str, float]:
    """The steps of the trial `PROBE` that claimed to be safe, and its path, again."""
    again = probe(row)
    return {f"probe_{name}": again[name] for name in PROBED}


def reacting(n: int, work: Path | None) -> Iterator[pd.DataFrame]:
    """Trials among people who react, or would if they saw the robot."""
    known = factories()
    for model, sees in product((name for name in WORLDS if name in known), ("robot", "nothing")):
        for name, factory, settings, trials in controllers(n, WORLDS[model], OTHERS, BASELINES):
            rows = react(trials, known[model], sees, factory, settings, out=work)
            yield rows.assign(crowd=model, sees=sees, controller=name)


def recorded(n: int, work: Path | None) -> Iterator[pd.DataFrame]:
    """Trials in the place of recorded walkers, and these walkers themselves."""
    for site, most in WALKERS.items():
        load, square = SITES[site]
        zone = zone_of("plaza" if site == "plaza" else "ATC day")
        made = find_replays(load(), min(n, most), seed=0, area=square, zone=zone)
        for name, factory, settings, trials in controllers(n, len(made), IN_PLACE, IN_PLACE):
            rows = szlib.rollouts(
                trials,
                RolloutSetup(
                    worlds=made,
                    behaviour=made,
                    controller=make_mpc_cbf if name.startswith("MPC") else factory,
                    measure=measure,
                ),
                settings=settings,
                out=work,
                n_jobs=1,
                progress=False,
            )
            yield rows.assign(crowd=site, sees="nothing", controller=name)
        yield walkers(made).assign(crowd=site, sees="nothing", controller="the person replaced")


def walkers(made: Replays) -> pd.DataFrame:
    """Scores of the people who are replaced."""
    logs = (
        drive(each.scenario, ReplacedWalker(each), LoopSettings(behaviour=each, until_arrival=False))
        for each in made
    )
    return pd.DataFrame([{"seed": i} | compute_replay_metrics(log) for i, log in enumerate(logs)])


@lru_cache
def zone_of(site: str) -> szlib.Ellipse:
    """The zone at 1.1 m/s fitted to a site: the plaza's to itself, the ATC day's to all real people."""
    load, square = SITES[site]
    samples = szlib.find_encounters(load(), square=square)
    return szlib.SocialZone.fit(samples, method=quantile_zone.NAME).ellipse(1.1)


def count_safety_claims(rows: pd.DataFrame) -> pd.DataFrame:
    """One row each crowd and controller: trials, steps, and how many safety claims held."""
    of_mpc = rows[rows["controller"].str.startswith("MPC")]
    sums = [
        "steps",
        "claimed_safe_steps",
        "broken_steps",
        *MOTION_CHANGES,
        "unexplained",
        "to_who_kept",
        "flagged_steps",
    ]
    table = of_mpc.groupby(list(BY), sort=False).agg(
        trials=("seed", "size"),
        **{name: (name, "sum") for name in sums},
        worst=("worst", "min"),
    )
    probes = of_mpc[of_mpc["seed"] == PROBE].set_index(list(BY))[list(PROBED)].add_prefix("probe_")
    return table.astype(dict.fromkeys(sums, int)).join(probes).reset_index()


def means(rows: pd.DataFrame) -> pd.DataFrame:
    """Means of the scores over the trials of one controller, and the trial `PROBE`."""
    table = summarise(rows, by=BY, metrics=SCORES).drop(columns="first")
    one = rows.set_index("seed").reindex([PROBE]).iloc[0]
    return table.assign(probe=[one[name] for name in table["metric"]])


def main(n: int, work: Path | None) -> None:
    parts = []
    for rows in chain(reacting(n, work), recorded(n, work)):
        parts.append(rows)
        print(*rows[list(BY)].iloc[0], len(rows), flush=True)
    table = count_safety_claims(pd.concat(parts, ignore_index=True))
    write_table(pd.concat(map(means, parts), ignore_index=True), "29_crowds")
    write_table(table, "29_safety_claims")
    print(table.to_string())


if __name__ == "__main__":
    given = read_arguments(__doc__, n=10**6, work="")
    main(given.n, Path(given.work) if given.work else None)

"""Robots in the place of recorded walkers, all on the same ways: two tables of notebook 29.

python -m studies.walkers            both tables, as they are saved: some 25 min on one core
python -m studies.walkers --n 5      at most 5 ways at each site

29_walkers.csv      site by speed by controller: means with 95 % intervals
29_sensitivity.csv  the controller among people with one number doubled or halved

Sites are those of `studies.claims`, Grand Central also with ways through the whole hall. The robot has a limit
of 1 m/s, or drives at most at the mean speed of the walker whom it replaces. Each trial has no time limit for
the solver, so that it is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pandas as pd
from studies.claims import SITES
from studies.committed import read_arguments, study, write_table
from studies.crowd_trials import zone_of
from studies.replay import TIME_FACTOR, ReplacedWalker, Replay, find_replays
from studies.social_metrics import REACHED, compute_replay_metrics
from studies.summaries import summarise

import szlib
from szlib.simulation.baseline_controllers import CONTROLLERS, make_mpc_cbf
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.tracks.clock import TICKS_PER_SECOND

PLACES = ("plaza", "Grand Central", "Grand Central, long", "ETH", "ATC day", "THOR-MAGNI")
CROWDED = ("Grand Central", "ETH", "THOR-MAGNI")
"""Places for the sensitivity, at 15 ways each."""
SEED = 7
SETTINGS = {
    "MPC-CBF": szlib.MPCSettings(time_limit=np.inf),
    "among people": szlib.MPCSettings.among_people(time_limit=np.inf),
}
METRICS = ("reached", "time_to_goal", "time_ratio", "time_intruding", "nearest", "jerk")
BY = ("crowd", "speed", "controller")
OURS = SETTINGS["among people"]


def changed() -> dict[str, szlib.MPCSettings]:
    """The controller among people, with each number of it halved and doubled."""
    found = {"as it is": OURS}
    for name in ("gamma", "jerk_weight", "decay_price", "zone_price", "body_gap"):
        for factor in (0.5, 2.0):
            value = factor * getattr(OURS, name)
            found[f"{name} {value:g}"] = replace(OURS, **{name: value})
    return found


@lru_cache
def ways(place: str, n: int) -> tuple[Replay, ...]:
    """The walkers at a place who are replaced."""
    load, square = SITES[place.split(",")[0]]
    area = None if place.endswith("long") else square
    zone = zone_of("plaza" if place == "plaza" else "ATC day")
    return tuple(find_replays(load(), n, seed=SEED, area=area, zone=zone))


def at_speed(way: Replay, v_max: float) -> Replay:
    """The same way for a robot that drives at most at `v_max`, with time enough for it."""
    scenario, states = way.scenario, way.walker.states
    velocity = states[0, 2:4] * min(1.0, 0.99 * v_max / max(np.hypot(*states[0, 2:4]), 1e-6))
    start = np.r_[scenario.start[:2], velocity]
    least = float(np.hypot(*(scenario.goal - start[:2]))) / v_max
    duration = round(TIME_FACTOR * max(walking_time(way), least), 1)
    return replace(way, scenario=replace(scenario, start=start, duration=duration))


def walking_time(way: Replay) -> float:
    """Time for which the person walked [s]."""
    return (len(way.walker.states) - 1) / TICKS_PER_SECOND


def own_speed(way: Replay) -> float:
    """Mean speed of the person who is replaced, to 0.1 m/s, at least 0.3 m/s."""
    steps = np.diff(way.walker.states[:, :2], axis=0)
    return max(0.3, round(float(np.hypot(*steps.T).sum()) / walking_time(way), 1))


def measure(way: Replay, controller: szlib.control.Controller) -> dict[str, float]:
    """Scores of one trial; jerk until the goal is reached."""
    log = drive(way.scenario, controller, LoopSettings(behaviour=way, until_arrival=False))
    scores = compute_replay_metrics(log)
    near = np.flatnonzero(np.hypot(*(log.states[:, :2] - way.scenario.goal).T) <= REACHED)
    gone = log.states[: near[0] + 1 if len(near) else None, 2:]
    jerk = np.diff(gone, 2, axis=0) / log.settings.dt**2
    scores["jerk"] = float((jerk**2).sum(axis=1).mean()) if len(jerk) else 0.0
    return scores | {"time_ratio": scores["time_to_goal"] / walking_time(way)}


def trials(
    place: str, n: int, speed: str, name: str, settings: szlib.MPCSettings
) -> Iterator[dict[str, float]]:
    """The scores of a controller on each way of a place."""
    for seed, way in enumerate(ways(place, n)):
        v_max = 1.0 if speed == "1 m/s" else own_speed(way)
        at = at_speed(way, v_max)
        limited = replace(settings, v_max=v_max)
        if name == "the person replaced":
            robot: szlib.control.Controller = ReplacedWalker(at, limited)
        elif name in CONTROLLERS:
            robot = CONTROLLERS[name](at.scenario, limited)
        else:
            robot = make_mpc_cbf(at.scenario, limited)
        yield {"seed": seed} | measure(at, robot)


@study("29_walkers", notebook="29")
def recompute(row: pd.Series) -> dict[str, float]:
    """The first way of a row, driven again."""
    settings = SETTINGS.get(row["controller"], SETTINGS["MPC-CBF"])
    first = next(trials(row["crowd"], 1, row["speed"], row["controller"], settings))
    return {"probe": first[row["metric"]]}


def compare(n: int) -> Iterator[pd.DataFrame]:
    """All controllers at all places."""
    controllers = {
        **SETTINGS,
        "social force": SETTINGS["MPC-CBF"],
        "the person replaced": SETTINGS["MPC-CBF"],
    }
    for place in PLACES:
        for speed in ("1 m/s", "their own"):
            for name, settings in controllers.items():
                rows = pd.DataFrame(trials(place, n, speed, name, settings))
                yield rows.assign(crowd=place, speed=speed, controller=name)


def means(rows: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """Means over the ways, with intervals; `probe` is the first way."""
    return summarise(rows, by=by, metrics=METRICS).rename(columns={"first": "probe"})


@study("29_sensitivity", notebook="29", has_probe=False)
def main(n: int) -> None:
    parts = []
    for rows in compare(n):
        parts.append(rows)
        print(*rows[list(BY)].iloc[0], len(rows), rows[list(METRICS)].mean().round(2).to_dict(), flush=True)
    recorded = pd.concat(parts[len(parts) // len(PLACES) :], ignore_index=True)
    pooled = recorded.assign(
        crowd="all recorded", seed=recorded["seed"] + 1000 * recorded["crowd"].map(PLACES.index)
    )
    tables = [means(rows, BY) for rows in parts]
    write_table(pd.concat([*tables, means(pooled, BY)], ignore_index=True), "29_walkers", seed=SEED)
    sensitive = []
    for name, settings in changed().items():
        places = [pd.DataFrame(trials(place, min(n, 15), "1 m/s", name, settings)) for place in CROWDED]
        rows = pd.concat(places, ignore_index=True).assign(change=name)
        sensitive.append(rows.assign(seed=rows.index))
        print(name, rows[list(METRICS)].mean().round(2).to_dict(), flush=True)
    write_table(means(pd.concat(sensitive), ("change",)), "29_sensitivity", seed=SEED)


if __name__ == "__main__":
    main(read_arguments(__doc__, n=40).n)

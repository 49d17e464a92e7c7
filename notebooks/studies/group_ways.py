"""Robots among recorded groups: `python -m studies.group_ways` writes 29_groups.csv.

How often does a robot walk between two people of one group?  The groups are the labels of ETH and THOR-MAGNI; the
ways are those of `studies.walkers`, with a limit of 1 m/s.  The controller among people drives them three times: it
is given the groups, it finds them by distance and motion, or it takes everybody for single.  The person who is
replaced crosses groups, too.  The real data is looked for in $SZLIB_DATA_DIR.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pandas as pd
from studies.claims import DATA
from studies.committed import read_arguments, study, write_table
from studies.replay import RecordedPerson, ReplacedWalker, Replay
from studies.sites import read_groups, read_magni_groups
from studies.social_metrics import compute_replay_metrics
from studies.summaries import summarise
from studies.walkers import OURS, SEED, at_speed, walking_time, ways

import szlib
from szlib.control.people import Person
from szlib.core.checks import Array
from szlib.simulation.baseline_controllers import make_mpc_cbf
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.simulation.crowds import Crowd, CrowdModel
from szlib.simulation.log import SimulationLog

LABELS: dict[str, Callable[[], pd.DataFrame]] = {
    "ETH": lambda: read_groups(DATA / "eth" / "seq_eth_groups.txt"),
    "THOR-MAGNI": lambda: read_magni_groups(DATA / "magni" / "A.csv"),
}
"""Who walks with whom at each site."""
KNOWN = ("given", "found", "nobody", "the person replaced")
"""What the robot knows of the groups; the last is the recorded person."""
TOGETHER = 3.0
"""People of a group who are farther apart are not passed as one [m], as for the controller."""
METRICS = ("crosses", "reached", "time_ratio", "nearest")


@dataclass(frozen=True)
class Labelled(CrowdModel):
    """The people of a `way`, each with the group of `group_of` their id."""

    way: Replay
    group_of: Mapping[int, Hashable]

    def start(self, scenario: szlib.Scenario, seed: int) -> Crowd:
        """The people of the way, whatever the `scenario` and the `seed`."""
        people = self.way.start(scenario, seed)
        groups = [self.group_of.get(other.id) for other in self.way.others]

        def see(t: float, robot: Array) -> tuple[Person | None, ...]:
            """The people at a time `t` [s] near the `robot`."""
            seen = zip(people(t, robot), groups, strict=True)
            return tuple(person and replace(person, group=group) for person, group in seen)

        return see


def crosses(log: SimulationLog, way: Replay, group_of: Mapping[int, int]) -> bool:
    """Whether the robot of the `log` walked between two people of one group."""
    others = [other for other in way.others if other.id in group_of]
    times = np.arange(len(log.states)) * log.settings.dt
    return any(
        walks_between(times, log.states[:, :2], one, other)
        for one, other in combinations(others, 2)
        if group_of[one.id] == group_of[other.id] and one.id != other.id
    )


def walks_between(times: Array, path: Array, one: RecordedPerson, other: RecordedPerson) -> bool:
    """Whether a `path` (n, 2) [m] at `times` (n,) [s] goes between two people who are within `TOGETHER`."""
    before = 0.0
    for t, place in zip(times.tolist(), path, strict=True):
        people = [each.at(t) for each in (one, other)]
        if people[0] is None or people[1] is None:
            before = 0.0
            continue
        first, second = (np.array(person.position) for person in people if person)
        along, at = second - first, place - first
        length, share = float(np.hypot(*along)), float(along @ at) / max(float(along @ along), 1e-9)
        side = float(np.sign(along[0] * at[1] - along[1] * at[0]))
        if side * before < 0 and 0 < share < 1 and length <= TOGETHER:
            return True
        before = side or before  # 0 is on the line between them
    return False


def trials(place: str, n: int, known: str) -> Iterator[dict[str, float]]:
    """The scores of each way at a place, for a robot that knows so much of the groups."""
    labels = LABELS[place]()
    group_of = dict(zip(labels["id"], labels["group"], strict=True))
    for seed, way in enumerate(ways(place, n)):
        at = at_speed(way, 1.0)
        alone = {other.id: f"person {other.id}" for other in at.others}
        names: Mapping[int, Hashable] = {"given": alone | group_of, "nobody": alone}.get(known, {})
        robot = ReplacedWalker(at, OURS) if known == KNOWN[-1] else make_mpc_cbf(at.scenario, OURS)
        log = drive(at.scenario, robot, LoopSettings(behaviour=Labelled(at, names), until_arrival=False))
        scores = compute_replay_metrics(log)
        ratio = scores["time_to_goal"] / walking_time(at)
        yield {"seed": seed, "crosses": crosses(log, at, group_of), "time_ratio": ratio} | {
            name: scores[name] for name in ("reached", "nearest")
        }


def compare(n: int) -> Iterator[pd.DataFrame]:
    """All robots at all places."""
    for place in LABELS:
        for known in KNOWN:
            rows = pd.DataFrame(trials(place, n, known)).assign(crowd=place, groups=known)
            print(place, known, len(rows), rows[list(METRICS)].mean().round(3).to_dict(), flush=True)
            yield rows


@study("29_groups", notebook="29", has_probe=False)
def main(n: int) -> None:
    rows = pd.concat(compare(n), ignore_index=True)
    rows["seed"] += 1000 * rows["crowd"].map([*LABELS].index)
    parts = [rows, rows.assign(crowd="both")]
    table = summarise(pd.concat(parts), by=("crowd", "groups"), metrics=METRICS)
    write_table(table.drop(columns="first"), "29_groups", seed=SEED)


if __name__ == "__main__":
    main(read_arguments(__doc__, n=200).n)

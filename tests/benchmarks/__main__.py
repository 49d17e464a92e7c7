"""Speed, as ratios of two things run in turn in this one process: `make bench`.

Prints each number with its bar and its last saved value, and writes all numbers to results/bench.json.
Seconds depend on the machine; ratios hardly do: `--save` appends the ratios to tests/benchmarks/ratios.csv.
`--long` adds 4,000 states on which IPOPT must agree, and 1,000 head-on meetings.  Names of cases
after the options select these cases.  $SZLIB_BEFORE names a clone of an earlier commit to compare with.
"""

import importlib.util
import itertools
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pandas as pd
from tqdm import tqdm

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "notebooks")]  # helpers, and studies

from helpers.random_states import meetings, questions
from studies.ipopt import ByIpopt

import szlib
from benchmarks import data_growth, data_sizes, measuring, steps
from szlib.core.checks import Array
from szlib.core.files import claim_folder
from szlib.plaza.generation import make_plaza
from szlib.tracks import datasets
from szlib.workbook.folders import PURPOSE


def in_turn(
    first: Callable[[], object], second: Callable[[], object], repeats: int
) -> tuple[float, float]:
    """Medians of both, run alternately after one warm-up each."""
    first(), second()
    pairs = [
        (measuring.seconds(first), measuring.seconds(second)) for _ in range(repeats)
    ]
    return median(p[0] for p in pairs), median(p[1] for p in pairs)


ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
Question = tuple[Array, Sequence[szlib.Person], Array]
CROWD = szlib.Scenario(
    "crowd",
    (-4.0, 0.0, 0.0, 0.0),
    (8.0, 0.5),
    tuple(
        szlib.Person(position, velocity)
        for position, velocity in (
            ((3.0, 0.3), (-0.5, 0.0)),
            ((0.0, 2.5), (0.1, -0.3)),
            ((5.0, -2.5), (-0.4, 0.2)),
            ((8.0, 1.0), (-0.5, 0.1)),
            ((1.0, -3.0), (0.3, 0.2)),
        )
    ),
    [
        ((-6, 5), (10, 5)),
        ((-6, -5), (10, -5)),
        ((4, 5), (4, 3.2)),
        ((0, -5), (0, -3.8)),
    ],
)


def controller_of(
    scenario: szlib.Scenario,
    make: Callable[..., szlib.MPCCBF] = szlib.MPCCBF,
    **options: Any,
) -> szlib.MPCCBF:
    return make(ZONE, walls=scenario.walls, **options)


def way(scenario: szlib.Scenario) -> list[Question]:
    """State, people and target at each step of a run."""
    controller = controller_of(scenario)
    log = szlib.simulate(scenario, controller)
    controller.reset()
    asked = []
    for k, x in enumerate(log.table[["x", "y", "vx", "vy"]].to_numpy()):
        people = [p.after(k * controller.settings.dt) for p in scenario.people]
        asked.append((x, people, controller.step(x, scenario.goal, people).target))
    return asked


def race(
    scenario: szlib.Scenario,
    baselines: dict[str, Callable[..., object]],
    repeats: int = 7,
) -> dict[str, Array]:
    """Times of each rival along the way [s], shape (steps,): laps in turn, medians over them.

    The first steps of a lap, where every rival is cold, do not count.
    """
    laps: dict[str, list[list[float]]] = {name: [] for name in baselines}
    asked = way(scenario)
    for _ in range(repeats):
        for name, step in baselines.items():
            laps[name].append(
                [measuring.seconds(lambda of=step, on=each: of(*on)) for each in asked][
                    3:
                ]
            )
    return {name: np.median(lap, axis=0) for name, lap in laps.items()}


def ratios(times: dict[str, Array], rival: str) -> dict[str, float]:
    """Median, p95 and maximum over the steps: of `sqp` in ms, and of the rival as multiples."""
    sqp_times, rival_times = times["sqp"], times[rival]
    return {
        "sqp ms": 1e3 * float(np.median(sqp_times)),
        "sqp p99 ms": 1e3 * float(np.quantile(sqp_times, 0.99)),
        "sqp p99.9 ms": 1e3 * float(np.quantile(sqp_times, 0.999)),
        f"{rival} / sqp median": float(np.median(rival_times) / np.median(sqp_times)),
        f"{rival} / sqp p95": float(
            np.quantile(rival_times, 0.95) / np.quantile(sqp_times, 0.95)
        ),
        f"{rival} / sqp max": float(rival_times.max() / sqp_times.max()),
    }


def bench_solvers(scenario: szlib.Scenario) -> dict[str, float]:
    """One control step by SQP against IPOPT, warm: as tuned here, and as it comes."""
    rivals = {
        "sqp": controller_of(scenario),
        "ipopt": controller_of(scenario, ByIpopt),
        "plain ipopt": controller_of(scenario, ByIpopt, options={}),
    }
    steps = {name: asking(each, scenario) for name, each in rivals.items()}
    times = race(scenario, steps)
    return ratios(times, "ipopt") | ratios(times, "plain ipopt")


def asking(
    controller: szlib.MPCCBF, scenario: szlib.Scenario
) -> Callable[..., szlib.Step]:
    return lambda state, people, target: controller.step(state, scenario.goal, people)


def bench_rival() -> dict[str, float]:
    """The same problem in do-mpc: the same controls, and how much longer they take."""
    from benchmarks.do_mpc_controller import do_mpc_step

    scenario = szlib.SCENARIOS["passing"]
    step, rival = (
        asking(controller_of(scenario), scenario),
        do_mpc_step(szlib.MPCSettings(), ZONE),
    )

    def rival_control(x: Array, people: Sequence[szlib.Person], target: Array) -> Array:
        return rival(x, target, people[0])

    apart = [
        np.abs(step(*each).control - rival_control(*each)).max()
        for each in way(scenario)
    ]
    found = ratios(
        race(scenario, {"sqp": step, "do-mpc": rival_control}, repeats=3), "do-mpc"
    )
    return found | {"largest difference of controls": max(apart)}


def bench_cruel(count: int) -> dict[str, float]:
    """Steps from inside zones and walls, at speed: they take longest, and the time limit counts."""
    from hostile.controller import attack_time

    tally: Counter[str] = Counter()
    attack_time(count, tally)
    return {
        what: n
        for what, n in tally.items()
        if what.startswith(("p", "max", "timed", "broken"))
    }


def check_agreement(count: int) -> dict[str, float]:
    """SQP and IPOPT on seeded states, each from nothing: where they differ, and by how much where not."""
    found = dict.fromkeys(
        ("states", "both solve", "same", "lower by sqp", "lower by ipopt"), 0
    )
    found |= dict.fromkeys(("only sqp", "only ipopt"), 0)
    apart, residual = [0.0], [0.0]
    for question in tqdm(
        itertools.islice(questions(seed=10), count), "agreement", count
    ):
        sqp, other = (
            question.ask(szlib.MPCSettings(head_on_share=0.0), make)
            for make in (szlib.MPCCBF, ByIpopt)
        )
        solved = [step.status == "optimal" for step in (sqp, other)]
        found["states"] += 1
        found["both solve"] += all(solved)
        found["only sqp"] += solved == [True, False]
        found["only ipopt"] += solved == [False, True]
        if all(solved):
            relative = (cost_of(sqp) - cost_of(other)) / max(cost_of(other), 1e-9)
            found["same"] += abs(relative) <= 1e-6
            found["lower by sqp"] += relative < -1e-6
            found["lower by ipopt"] += relative > 1e-6
            residual.append(float(sqp.residual.min(initial=0)))
            if abs(relative) <= 1e-6:
                apart.append(float(np.abs(sqp.control - other.control).max()))
    return found | {"largest |du|": max(apart), "least residual": min(residual)}


def cost_of(step: szlib.Step) -> float:
    """The cost of a plan on a horizon of equal steps, without jerk (paper, eq. 2)."""
    s, x = step.scene.settings, step.predicted[1:] - [*step.target, 0.0, 0.0]
    on_way, at_end = (x[:-1] ** 2 @ s.Q).sum(), x[-1] ** 2 @ s.P
    return float(at_end + on_way + (step.inputs**2 @ s.R).sum())


def check_meetings(count: int) -> dict[str, float]:
    """Exactly symmetric meetings: how many end at the goal, and on the side that was to be expected."""
    reached = side = 0
    for scenario, place in tqdm(
        itertools.islice(meetings(seed=11), count), "meetings", count
    ):
        log = szlib.simulate(scenario, controller_of(scenario))
        reached += log.success
        side += log.metrics()["passing_side"] == (
            "left" if place == "wall" else "right"
        )
    return {"meetings": count, "goal reached": reached, "on the expected side": side}


def bench_day() -> dict[str, float]:
    """The real 1 Hz day, files to zone, against reading the same files with pandas alone."""
    files = datasets.find("atc-1hz", cache=tempfile.gettempdir())
    whole, pandas = in_turn(
        lambda: szlib.SocialZone.fit(szlib.find_encounters(szlib.read_tracks(files))),
        lambda: pd.concat([pd.read_csv(file, header=None) for file in files]),
        repeats=3,
    )
    return {"s": whole, "ours / pandas read_csv": whole / pandas}


def bench_plaza() -> dict[str, float]:
    """The synthetic plaza: made, written; and read back to its zone."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plaza.csv"
        made = measuring.seconds(lambda: make_plaza(file, seed=0))
        fitted = measuring.seconds(
            lambda: szlib.SocialZone.fit(szlib.find_encounters(szlib.read_tracks(file)))
        )
        return {
            "made and written s": made,
            "MB": file.stat().st_size / 1e6,
            "read to zone s": fitted,
        }


def bench_import() -> dict[str, float]:
    """`import szlib` against an interpreter that imports nothing, as whole processes."""
    imported, bare = in_turn(
        lambda: subprocess.run([sys.executable, "-c", "import szlib"], check=True),
        lambda: subprocess.run([sys.executable, "-c", "pass"], check=True),
        repeats=5,
    )
    return {
        "s more than bare Python": imported - bare,
        "szlib / bare Python": imported / bare,
    }


BARS: dict[str, measuring.Bars] = {
    "one person": {"ipopt / sqp p95": (">=", 20)},
    "5 people, 4 walls": {"ipopt / sqp median": (">=", 10), "sqp p99 ms": ("<=", 5)},
}
"""Of a case: what its numbers are held against."""


def main() -> None:
    passing = szlib.SCENARIOS["passing"]
    cases: dict[str, Callable[[], dict[str, float]]] = {
        "one person": lambda: bench_solvers(passing),
        "5 people, 4 walls": lambda: bench_solvers(CROWD),
        "cruel states": lambda: bench_cruel(3000 if "--long" in sys.argv else 200),
        **steps.CASES,
        "import szlib": bench_import,
        "plaza": bench_plaza,
        **data_growth.CASES,
    }
    if importlib.util.find_spec("do_mpc"):
        cases["do-mpc"] = bench_rival
    if "--long" in sys.argv:
        cases["agreement"] = lambda: check_agreement(4000)
        cases["head-on"] = lambda: check_meetings(1000)
    if os.environ.get(datasets.DATA_DIR_VARIABLE):
        cases["1 Hz day, files to zone"] = bench_day
    if "--long" in sys.argv or os.environ.get(data_sizes.RAW_DAY_VARIABLE):
        cases |= data_sizes.CASES
    bars = BARS | steps.BARS | data_sizes.BARS | data_growth.BARS
    wanted = [name for name in sys.argv[1:] if not name.startswith("--")] or list(cases)
    if unknown := set(wanted) - set(cases):
        sys.exit(
            f"no such case: {', '.join(sorted(unknown))}; there are {', '.join(cases)}"
        )
    results = claim_folder("results", PURPOSE)
    found: dict[str, dict[str, float]] = {}
    for name in wanted:
        bench = cases[name]
        found[name] = {key: float(f"{value:.4g}") for key, value in bench().items()}
        print(measuring.report(name, found[name], bars.get(name)), flush=True)
    (results / "bench.json").write_text(json.dumps(found, indent=1))
    if "--save" in sys.argv:
        measuring.save(found)


if __name__ == "__main__":
    main()

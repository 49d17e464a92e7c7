"""Judge controllers in random worlds that their authors have not seen, and write a board.

    python notebooks/project/judge.py submissions/*.py --meeting intersection --seed 7 --worlds 12

Each submission is a file with a function `make_controller(walls, zone)`. It runs in a process of its own
(`submission.py`) and learns what a robot would measure. The world, its seed and the measurements stay here. A
process is no prison: judge the files of strangers in a container.
"""

import argparse
import os
import secrets
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product
from pathlib import Path
from threading import Timer

import numpy as np
import pandas as pd

sys.path.append(str(Path(__file__).resolve().parents[1]))  # for `studies`
from studies.atlas import REFERENCE
from submission import RULES, RefusedError, Submission

import szlib
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.simulation.crowds import VisiblePeople
from szlib.simulation.scenario import Variations

PRICE = 5  # a second in somebody's zone costs as much as this many seconds on the way
RIVALS = sorted((Path(__file__).parent / "rivals").glob("*.py"))
COLUMNS = ["points", "time_to_goal", "time_in_zones", "gap_to_people", "gap_to_walls"]


def measure(log: szlib.SimulationLog) -> dict[str, float]:
    """The points of a run, and what they are made of."""
    found, world = log.metrics(), log.scenario
    inside = RULES.dt * int((log.h[:, : len(world.people)] < -1e-6).any(axis=1).sum())
    alone = np.hypot(*(world.goal - world.start[:2])) / RULES.v_max + RULES.v_max / RULES.a_max
    points = 100 * alone / (found["time_to_goal"] + PRICE * inside)
    gaps = found["min_clearance_people"], found["min_clearance_walls"]
    return dict(zip(COLUMNS, (points, found["time_to_goal"], inside, *gaps), strict=True))


def judge(file: Path, meeting: str, seeds: list[int], time_limit: float) -> dict[str, object]:
    """Run a submission in the worlds of a meeting; return a row of the table."""
    people = tuple(replace(person, id=i) for i, person in enumerate(szlib.MEETINGS[meeting].people))
    worlds = Variations(replace(szlib.MEETINGS[meeting], people=people), REFERENCE)
    zone, submission, rows, reasons = REFERENCE, Submission(file), [], []
    try:
        for world in map(worlds, seeds):
            timer = Timer(time_limit, submission.stop)
            timer.start()
            try:
                submission.ask(walls=world.walls.tolist(), zone=(zone.center, zone.semi_axes, zone.angle))
                log = drive(world, submission, LoopSettings(behaviour=VisiblePeople(), settings=RULES))
            finally:
                timer.cancel()
            rows.append(measure(log))
    except RefusedError as error:
        reasons.append(f"{error} (in world {len(rows) + 1})")
    finally:
        submission.end()
        submission.process.communicate()
    table = pd.DataFrame(rows, columns=COLUMNS)
    counts = {"touches a person": (table["gap_to_people"] < 0).sum(),
              "touches a wall": (table["gap_to_walls"] < 0).sum(),
              "does not arrive": table["time_to_goal"].isna().sum()}  # fmt: skip
    reasons += [f"{fault} in {n} of {len(rows)} worlds" for fault, n in counts.items() if n]
    row = {"controller": "/".join(file.with_suffix("").parts[-2:]), "meeting": meeting, **table.mean()}
    row |= table[["gap_to_people", "gap_to_walls"]].min()
    return row | {"points": 0.0 if reasons else row["points"], "refused": "; ".join(reasons)}


def make_board(table: pd.DataFrame) -> pd.DataFrame:
    """The board: the mean over the meetings for each controller, best first; and why controllers are refused."""
    groups = table.groupby("controller")
    board = groups[["points", "time_to_goal", "time_in_zones"]].mean().join(groups["gap_to_people"].min())
    reasons = table["meeting"] + ": " + table["refused"].replace(r"[|\s]+", " ", regex=True)
    board["refused"] = reasons[table["refused"] != ""].groupby(table["controller"]).agg("; ".join)
    board = board.fillna({"refused": ""}).sort_values("points", ascending=False, kind="stable").reset_index()
    return board.round({"points": 1, "time_to_goal": 1, "time_in_zones": 1, "gap_to_people": 2})


def make_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, help="submissions; the rivals are always judged")
    parser.add_argument("--meeting", choices=szlib.MEETINGS, help="one meeting; default: all")
    parser.add_argument("--worlds", type=int, default=12, help="worlds of each meeting")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**9), help="default: a new one")
    parser.add_argument("--time-limit", type=float, default=60.0, help="for a world [s]")
    parser.add_argument("--out", type=Path, default=Path("results/project"), help="folder of the board")
    return parser


def main(arguments: list[str] | None = None) -> None:
    """Judge the submissions of the command line, and print and write the board."""
    given = make_parser().parse_args(arguments)
    seeds = np.random.SeedSequence(given.seed).generate_state(given.worlds).tolist()
    meetings = [given.meeting] if given.meeting else list(szlib.MEETINGS)
    tasks = product([*given.files, *RIVALS], meetings)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        table = pd.DataFrame(pool.map(lambda task: judge(*task, seeds, given.time_limit), tasks))
    board = make_board(table)
    cells = board.map(lambda value: "" if pd.isna(value) else str(value)).to_numpy()
    lines = [board.columns, ["---"] * len(board.columns), *cells]
    lines = [f"| {' | '.join(line)} |" for line in lines]
    where = f'--meeting "{given.meeting}"' if given.meeting else "all meetings"
    text = "\n".join([*lines, "", f"Worlds: --seed {given.seed} --worlds {given.worlds}, {where}."])
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "board.md").write_text(text + "\n", encoding="utf-8")
    table.to_csv(given.out / "board.csv", index=False, float_format="%.6g")
    print(text)


if __name__ == "__main__":
    main()

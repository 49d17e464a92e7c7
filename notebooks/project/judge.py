"""Judge controllers in random worlds that their authors have not seen, and write a board.

    python notebooks/project/judge.py submissions/*.py --meeting intersection --worlds 12

Each submission is a file with a function `make_controller(walls, zone)`. It runs in a process of its own
(`submission.py`), one after the other, and learns what a robot would measure. The world, its seed and the
measurements stay here, and the files are read before the first of them runs. A process is no prison: judge the
files of strangers in a container.
"""

import argparse
import os
import secrets
import sys
import tempfile
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.append(str(Path(__file__).resolve().parents[1]))  # for `studies`
from studies.atlas import REFERENCE
from studies.committed import claim_new_folder
from submission import RULES, RefusedError, Submission, find_prefix

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


def judge(name: str, source: str, meeting: str, seeds: list[int], time_limit: float) -> dict[str, object]:
    """Run a submission in the worlds of a meeting; return a row of the table."""
    people = tuple(replace(person, id=i) for i, person in enumerate(szlib.MEETINGS[meeting].people))
    worlds = Variations(replace(szlib.MEETINGS[meeting], people=people), REFERENCE)
    rows, reasons, submission = [], [], None
    with tempfile.TemporaryDirectory() as folder:
        (file := Path(folder) / "my_controller.py").write_text(source, encoding="utf-8")
        try:
            submission = Submission(file, time_limit)
            for world in map(worlds, seeds):
                submission.begin_world(world, REFERENCE)
                loop = LoopSettings(behaviour=VisiblePeople(), settings=RULES)
                rows.append(measure(drive(world, submission, loop)))
        except RefusedError as error:
            reasons.append(f"{error} (in world {len(rows) + 1})")
        finally:
            if submission is not None:
                submission.end()
    table = pd.DataFrame(rows, columns=COLUMNS)
    counts = {"touches a person": (table["gap_to_people"] < 0).sum(),
              "touches a wall": (table["gap_to_walls"] < 0).sum(),
              "does not arrive": table["time_to_goal"].isna().sum()}  # fmt: skip
    reasons += [f"{fault} in {n} of {len(rows)} worlds" for fault, n in counts.items() if n]
    row = {"controller": name, "meeting": meeting, **table.mean()}
    row |= table[["gap_to_people", "gap_to_walls"]].min()
    return row | {"points": 0.0 if reasons else row["points"], "refused": "; ".join(reasons)}


def score(points: float, board: pd.DataFrame) -> float:
    """The 30 points of the rubric for the result: 20 for the best rival, the rest for a quarter of what it lacks."""
    rivals = board[board["controller"].str.startswith("rivals/")].set_index("controller")["points"]
    if rivals.empty:
        return float("nan")
    low, best = rivals.get("rivals/paper", rivals.min()), rivals.max()
    to_best = np.clip((points - low) / max(best - low, 1e-9), 0, 1)
    beyond = np.clip((points - best) / max(0.25 * (100 - best), 1e-9), 0, 1)
    return float(20 * to_best + 10 * beyond)


def read_submissions(files: list[Path]) -> dict[str, str]:
    """The sources of the submissions and the rivals, by their paths from the folder that they share."""
    paths = list(dict.fromkeys(file.resolve() for file in files))
    shared = Path(os.path.commonpath([path.parent for path in paths])).parent if paths else Path()
    found = {path.relative_to(shared).with_suffix("").as_posix(): path.read_text("utf-8") for path in paths}
    clash = [name for name in found if name.startswith("rivals/")]
    if clash:
        raise SystemExit(f"{clash[0]}: rename the folder; the rivals of the judge have this name")
    return found | {f"rivals/{path.stem}": path.read_text(encoding="utf-8") for path in RIVALS}


def make_board(table: pd.DataFrame) -> pd.DataFrame:
    """The board: the mean over the meetings for each controller, best first; and why controllers are refused."""
    groups = table.groupby("controller")
    board = groups[["points", "time_to_goal", "time_in_zones"]].mean().join(groups["gap_to_people"].min())
    reasons = table["meeting"] + ": " + table["refused"].replace(r"[|\s]+", " ", regex=True)
    board["refused"] = reasons[table["refused"] != ""].groupby(table["controller"]).agg("; ".join)
    board = board.fillna({"refused": ""}).sort_values("points", ascending=False, kind="stable").reset_index()
    board.insert(1, "result", [score(points, board) for points in board["points"]])
    return board.round({"result": 1, "points": 1, "time_to_goal": 1, "time_in_zones": 1, "gap_to_people": 2})


def make_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, help="submissions; the rivals are always judged")
    parser.add_argument("--meeting", choices=szlib.MEETINGS, help="one meeting; default: all")
    parser.add_argument("--worlds", type=int, default=12, help="worlds of each meeting")
    text = "default: a new one; - reads it from the standard input, where no submission can see it"
    parser.add_argument("--seed", default=str(secrets.randbelow(10**9)), help=text)
    parser.add_argument("--time-limit", type=float, default=60.0, help="for a world [s]")
    parser.add_argument("--out", type=Path, default=Path("results/project"), help="folder of the board")
    return parser


def main(arguments: list[str] | None = None) -> None:
    """Judge the submissions of the command line, and print and write the board."""
    given = make_parser().parse_args(arguments)
    seed = int(sys.stdin.readline() if given.seed == "-" else given.seed)
    if not find_prefix():
        print("unshare is not available: a submission can see the processes of this machine", file=sys.stderr)
    seeds = np.random.SeedSequence(seed).generate_state(given.worlds).tolist()
    meetings = [given.meeting] if given.meeting else list(szlib.MEETINGS)
    tasks = product(read_submissions(given.files).items(), meetings)
    rows = [judge(*each, meeting, seeds, given.time_limit) for each, meeting in tasks]
    table = pd.DataFrame(rows)
    board = make_board(table)
    table.insert(2, "result", table["controller"].map(board.set_index("controller")["result"]))
    cells = board.map(lambda value: "" if pd.isna(value) else str(value)).to_numpy()
    lines = [board.columns, ["---"] * len(board.columns), *cells]
    lines = [f"| {' | '.join(line)} |" for line in lines]
    where = f'--meeting "{given.meeting}"' if given.meeting else "all meetings"
    text = "\n".join([*lines, "", f"Worlds: --seed {seed} --worlds {given.worlds}, {where}."])
    claim_new_folder(given.out, "boards of the project")
    (given.out / "board.md").write_text(text + "\n", encoding="utf-8")
    table.to_csv(given.out / "board.csv", index=False, float_format="%.6g")
    print(text)


if __name__ == "__main__":
    main()

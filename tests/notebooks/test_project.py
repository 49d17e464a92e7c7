"""The judge of the final project: better settings win, faulty and cheating submissions are refused."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pandas as pd
import psutil
import pytest

import szlib
from szlib.simulation.closed_loop import LoopSettings
from szlib.workbook import folders

PROJECT = folders.NOTEBOOKS / "project"
sys.path.append(str(PROJECT))
import judge as judging  # noqa: E402
from submission import RULES, Submission  # noqa: E402

LONG = 600.0  # a limit that no submission of these tests needs [s]
OWN = """
from types import SimpleNamespace
import numpy as np

class Mine:
    def reset(self):
        pass

    def step(self, state, goal, people):
        return SimpleNamespace(control={control})

def make_controller(walls, zone):
    return Mine()
"""
STRAIGHT = OWN.format(
    control="10 * ((goal - state[:2]) / max(1, np.hypot(*(goal - state[:2]))) - state[2:])"
)
PLAIN = """
import szlib

def make_controller(walls, zone):
    return szlib.MPCCBF(zone, walls=walls)
"""
BOLDER = """
import math, szlib

def make_controller(walls, zone):
    settings = szlib.MPCSettings(gamma=0.2, N=24, N_h=24, time_limit=math.inf)
    return szlib.MPCCBF(zone, walls=walls, settings=settings)
"""


@pytest.fixture
def run():
    """`run(source, meeting, worlds, limit)`: the row of a submission with this source."""

    def run(source, meeting="pedestrian obstruction", worlds=1, limit=LONG):
        return judging.judge("mine", source, meeting, list(range(worlds)), limit)

    return run


@pytest.mark.slow
def test_a_larger_gamma_with_a_longer_barrier_beats_the_papers_settings(run):
    ours = run(BOLDER, "intersection", 2)
    paper = run((PROJECT / "rivals" / "paper.py").read_text(), "intersection", 2)
    assert ours["refused"] == paper["refused"] == ""
    assert ours["points"] > paper["points"] + 10


def test_points_are_the_time_alone_over_the_time_with_a_price_for_zones(run):
    world = szlib.simulation.Variations(
        szlib.MEETINGS["overtaking"], judging.REFERENCE
    )(0)
    found = run(BOLDER, "overtaking")
    distance = ((world.goal - world.start[:2]) ** 2).sum() ** 0.5
    cost = found["time_to_goal"] + judging.PRICE * found["time_in_zones"]
    assert found["points"] == pytest.approx(100 * (distance + 1.0) / cost)
    assert found["points"] < 100


@pytest.mark.slow
@pytest.mark.parametrize(
    ("source", "reason"),
    [
        (OWN.format(control="np.zeros(2)"), "does not arrive in 1 of 1 worlds"),
        (STRAIGHT, "touches a person in 1 of 1 worlds"),
        (
            OWN.format(control="np.array([0, 1])"),
            "touches a wall in 1 of 1 worlds; does not arrive",
        ),
        (
            OWN.format(control="1 / 0"),
            r"line 10: ZeroDivisionError: division by zero \(in world 1\)",
        ),
        (
            OWN.format(control="[np.nan, 0]"),
            r"gives the acceleration \[nan, 0.0\]; expected two finite",
        ),
        (OWN.format(control="[1, 2, 3]"), "expected two finite numbers"),
        ("def make_controller(:", "line 1: SyntaxError"),
        ("x = 1", "KeyError: 'make_controller'"),
        ("import os\nos._exit(3)", "ends its process with exit code 3"),
        (
            "import os\n[os.write(i, b'5\\n') for i in range(3, 99) if os.path.exists(f'/dev/fd/{i}')]",
            "answers",
        ),
    ],
)
def test_a_faulty_submission_is_refused_with_the_reason(run, source, reason):
    row = run(source)
    assert row["points"] == 0
    assert pd.Series([row["refused"]]).str.contains(reason).item(), row["refused"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "start",
    [
        "",
        "import os\nif not os.fork():\n    time.sleep(3600)",
        "import os\nif not os.fork():\n    os.setsid()\n    time.sleep(3600)",
        "import os\nos.setsid()",
        "import signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)",
    ],
)
def test_a_submission_that_takes_too_long_is_refused(run, start):
    """Also if it leaves a process that holds the pipe."""
    if start and not hasattr(os, "fork"):
        pytest.skip("needs fork")
    before = {each.pid for each in psutil.Process().children(recursive=True)}
    row = run(f"import time\n{start}\ntime.sleep(3600)", limit=0.5)
    assert row["refused"] == "is too slow (in world 1)"
    left = {each.pid for each in psutil.Process().children(recursive=True)} - before
    assert not left


def test_a_submission_sees_no_other_process(run):
    """Neither its judge, whose command line may hold a seed, nor a sibling."""
    if not judging.find_prefix():
        pytest.skip("unshare is not allowed here")
    source = "import os, psutil\nothers = [p.pid for p in psutil.process_iter() if p.pid != os.getpid()]\n"
    row = run(source + OWN.format(control="[len(others)]"))
    assert row["refused"].startswith("gives the acceleration [0.0]"), row


def test_files_of_the_same_name_have_rows_of_their_own(tmp_path):
    files = [tmp_path / who / "submission" / "my_controller.py" for who in ("a", "b")]
    for file in files:
        file.parent.mkdir(parents=True)
        file.write_text(PLAIN)
    names = list(judging.read_submissions(files))
    assert names[0] == f"{tmp_path.name}/a/submission/my_controller"
    assert len(names) == len(set(names)) == 2 + len(judging.RIVALS)


def test_the_result_is_a_distance_to_the_rivals():
    rivals = {"rivals/paper": 40.0, "rivals/tuned": 60.0, "me": 0.0}
    board = pd.DataFrame({"controller": rivals.keys(), "points": rivals.values()})
    scores = [judging.score(points, board) for points in (0, 40, 50, 60, 65, 70, 100)]
    assert scores == [0, 0, 10, 20, 25, 30, 30]


def test_the_board_has_the_result_of_each_controller(tmp_path, monkeypatch, capsys):
    """One mark a controller, from its mean points over the meetings; also in each of its rows of the CSV."""
    points = {"rivals/paper": 40.0, "rivals/tuned": 60.0, "mine": 50.0, "best": 70.0}
    rest = {"time_to_goal": 20.0, "time_in_zones": 0.0, "gap_to_people": 0.5}

    def judge(name, source, meeting, seeds, time_limit):
        shift = 5.0 if meeting == "overtaking" else 0.0
        row = {"controller": name, "meeting": meeting, "points": points[name] + shift}
        return row | rest | {"refused": ""}

    monkeypatch.setattr(judging, "judge", judge)
    monkeypatch.setattr(
        judging, "read_submissions", lambda _: dict.fromkeys(points, "")
    )
    monkeypatch.chdir(tmp_path)
    judging.main([])
    head, _, *rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in capsys.readouterr().out.splitlines()
        if line.startswith("|")
    ]
    found = {row[0]: float(row[head.index("result")]) for row in rows}
    assert list(found) == ["best", "rivals/tuned", "mine", "rivals/paper"]
    low, best = 40 + 5 / len(szlib.MEETINGS), 60 + 5 / len(szlib.MEETINGS)
    beyond = 20 + 10 * min(1, 10 / (0.25 * (100 - best)))
    expected = {"best": beyond, "rivals/tuned": 20, "mine": 10, "rivals/paper": 0}
    assert best - low == pytest.approx(20)
    assert found == pytest.approx(expected, abs=0.05)
    table = pd.read_csv(tmp_path / "results" / "project" / "board.csv")
    assert table.groupby("controller")["result"].unique().map(list).to_dict() == {
        name: [value] for name, value in found.items()
    }
    folders.claim_results(tmp_path / "results", "synthetic")  # as `szlib run` does


EDIT = """
import szlib
import szlib.simulation.metrics
for scenario in szlib.MEETINGS.values():
    object.__setattr__(scenario, "people", ())
szlib.simulation.metrics.compute_metrics = lambda run: {"success": True, "time_to_goal": 0.1}
szlib.simulation.drive = szlib.simulation.closed_loop.drive = None
def edit(state, goal, people):
    goal[:] = state[:2]
    for person in people:
        object.__setattr__(person, "position", (1000.0, 1000.0))
    return np.zeros(2)
"""


def test_a_submission_that_edits_the_world_or_the_metrics_changes_nothing(run):
    row = run(EDIT + OWN.format(control="edit(state, goal, people)"))
    assert row["refused"] == "does not arrive in 1 of 1 worlds"
    assert row["gap_to_people"] > 0


SPY = """
import gc, os, sys, szlib
def find(state):
    scenes = [each for each in gc.get_objects() if isinstance(each, szlib.Scenario)]
    starts = [each for each in scenes if np.array_equal(each.start, state)]
    told = [word for word in [*sys.argv, *os.environ.values()] if "4711" in word]
    raise RuntimeError(f"{len(starts)} scenarios, {len(told)} seeds")
"""


def test_a_submission_does_not_find_the_world_or_its_seed():
    source = SPY + OWN.format(control="find(state)")
    row = judging.judge("spy", source, "blind corner", [4711], LONG)
    assert "RuntimeError: 0 scenarios, 0 seeds" in row["refused"]


@pytest.mark.parametrize(("meeting", "seen"), [("blind corner", 0), ("overtaking", 1)])
def test_a_person_behind_a_wall_is_not_seen(run, meeting, seen):
    refused = run(OWN.format(control="[len(people)]"), meeting)["refused"]
    assert refused.startswith(f"gives the acceleration [{seen}.0]")


def test_the_motors_have_limits(tmp_path):
    file = tmp_path / "rocket.py"
    file.write_text(OWN.format(control="np.array([1e9, -1e9])"))
    rocket, world = Submission(file), szlib.MEETINGS["frontal approach"]
    rocket.begin_world(world, szlib.Ellipse((0, 0), (1, 1)))
    loop = LoopSettings(settings=RULES, max_time=3.0)
    log = szlib.simulation.drive(world, rocket, loop)
    rocket.end()
    assert abs(log.controls).max() <= RULES.a_max + 1e-9
    assert log.speed.max() == pytest.approx(RULES.v_max)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_board_and_an_error_stops_nobody_else(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(judging, "RIVALS", [])
    for name, source in {"crash": "1 / 0", "plain": PLAIN}.items():
        (tmp_path / f"{name}.py").write_text(source)
    files = [str(file) for file in sorted(tmp_path.glob("*.py"))]
    boards = []
    for seed in ("7", "7", "8"):
        out = tmp_path / f"out{len(boards)}"
        given = [
            "--meeting",
            "overtaking",
            "--worlds",
            "1",
            "--seed",
            seed,
            "--out",
            str(out),
        ]
        judging.main([*files, *given])
        boards.append(
            (out / "board.csv").read_bytes() + (out / "board.md").read_bytes()
        )
    assert boards[0] == boards[1] != boards[2]
    printed = capsys.readouterr().out
    assert printed.splitlines()[2].startswith(f"| {tmp_path.name}/plain |")
    assert 'Worlds: --seed 8 --worlds 1, --meeting "overtaking".' in printed
    table = pd.read_csv(tmp_path / "out0" / "board.csv")
    assert sorted(Path(name).name for name in table["controller"]) == ["crash", "plain"]
    assert "line 1: ZeroDivisionError" in table["refused"].dropna().str.cat()


@pytest.mark.slow
def test_the_template_runs_as_it_is_and_is_not_refused(run, tmp_path):
    template = PROJECT / "my_controller.py"
    subprocess.run(
        [sys.executable, template], cwd=tmp_path, check=True, capture_output=True
    )
    assert (tmp_path / "my_controller.png").stat().st_size > 10_000
    assert run(template.read_text(), "intersection")["refused"] == ""


def test_the_assignment_states_the_rules_of_the_judge():
    text = (PROJECT / "README.md").read_text(encoding="utf-8")
    assert "column `result` of the board" in text
    missing = [
        link
        for link in re.findall(r"\]\((?!http)([^)#]+)\)", text)
        if not (PROJECT / link).exists()
    ]
    assert missing == []
    assert rf"T + {judging.PRICE}\,T" in text
    assert f"has {szlib.MEETINGS['overtaking'].duration:g} s" in text
    assert f"radius of {RULES.r_robot:g} m" in text
    for command in re.findall(
        r"^python notebooks/project/judge\.py (.+)$", text, flags=re.M
    ):
        assert judging.make_parser().parse_args(shlex.split(command)).worlds == 12

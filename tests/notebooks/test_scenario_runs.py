"""Both runs of a scenario for the chapters 09 to 11, and the five numbers that they show."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from studies import chains, lesson_zones, scenario_runs
from studies.atlas import REFERENCE

import szlib
from szlib.workbook.record import NotebookRecord

SETTINGS = szlib.MPCSettings(gamma=0.08, N=6)


@pytest.fixture(scope="module")
def corridor():
    return scenario_runs.drive(szlib.SCENARIOS["corridor"], REFERENCE, SETTINGS)


def test_the_papers_settings_take_our_gamma_and_horizon_and_no_rule_of_the_side():
    paper = scenario_runs.paper_settings(SETTINGS)
    assert (paper.gamma, paper.N, paper.head_on_share) == (0.08, 6, 0.0)


def test_five_numbers_are_those_of_the_metrics_and_have_units(corridor):
    table = scenario_runs.tabulate_five({"ours": corridor})
    numbers = [name for name in table.columns if "[" in name]
    assert len(numbers) == 5
    assert all(name.endswith(("[s]", "[m]", "[m/s]")) for name in numbers)
    assert table.loc["ours", "side"] == corridor.metrics()["passing_side"]
    held = sum(claim.check(corridor)[0] for claim in corridor.scenario.claims)
    assert table.loc["ours", "claims that hold"] == f"{held} of 1"
    assert table.loc["ours", "least h [m]"] == pytest.approx(
        corridor.metrics()["min_h"], abs=0.005
    )


def test_a_row_holds_the_robot_only_where_its_residual_is_zero(corridor):
    holding = scenario_runs.find_holding_times(corridor)
    assert list(holding) == ["person", "wall to its left", "wall to its right"]
    at = np.isin(corridor.time, holding["person"])
    assert at.any() and not at.all()
    assert (
        corridor.residual[at, 0].min(axis=1).max()
        <= 1e-4
        < corridor.residual[~at, 0].min()
    )


def test_a_change_is_described_by_what_changed():
    rows = [
        {
            "scenario": "passing",
            "chain": chain,
            "time_to_goal": 11.0,
            "min_h": h,
            "min_speed": 0.5,
        }
        | {"passing_side": side, "claims_held": 2, "changed": chain == "side rule"}
        for chain, h, side in (
            ("paper", 0.17, "left"),
            ("margin", 0.17, "left"),
            ("side rule", 0.21, "right"),
        )
    ]
    found = pd.DataFrame(rows).set_index(["chain", "scenario"])
    assert chains.describe_change(found, "margin", "passing") == "-"
    assert (
        chains.describe_change(found, "side rule", "passing")
        == "least h 0.17 to 0.21 m; side left to right"
    )


@pytest.mark.parametrize(
    ("axes", "data", "is_kept"),
    [
        ((0.4, 0.3), "hall.csv", True),
        ((0.97, 0.75), "hall.csv", True),
        ((1.3, 1.2), "hall.csv", False),
        ((1.8, 1.0), "hall.csv", False),
        ((1.3, 1.2), "synthetic", True),
    ],
)
def test_a_lesson_takes_the_plazas_zone_where_its_scenes_have_no_room(
    axes, data, is_kept, tmp_path, capsys
):
    if data != "synthetic":
        data = str(tmp_path / data)
        Path(data).write_text("t,id,x,y\n0,1,0,0\n")
    given = {"data": data, "results": str(tmp_path / "results"), "zone_speed": 1.1}
    record = NotebookRecord("99_test", given, plaza_zone=True)
    capsys.readouterr()
    zone = szlib.Ellipse((0.0, 0.0), axes)
    chosen = lesson_zones.fit_to_scenes(record, zone, "The zone of this data")
    said = capsys.readouterr().out
    assert (chosen == zone) == is_kept
    assert ("they take the plaza's zone" in said) != is_kept
    if not is_kept:
        assert chosen == szlib.PlazaSettings().true_zone(1.1)


def test_arrivals_are_listed_latest_first_and_a_robot_that_does_not_arrive_before_all():
    table = [
        {"width": 5.0, "pace": 0.3, "time": 12.0},
        {"width": 4.4, "pace": 0.7, "time": 16.04},
        {"width": 3.8, "pace": 0.3, "time": None},
    ]
    assert scenario_runs.list_arrivals(table) == (
        "3.8 m and 0.3 m/s: not within 30 s; 4.4 m and 0.7 m/s: 16.0 s; 5 m and 0.3 m/s: 12.0 s"
    )


def test_two_streams_walk_towards_the_way_of_the_robot_at_one_pace():
    people = scenario_runs.make_streams(seed=0, pace=0.5)
    assert len(people) == 8 and people == scenario_runs.make_streams(seed=0, pace=0.5)
    for person in people:
        _, y = person.position
        vx, vy = person.velocity
        assert vx == 0 and abs(vy) == 0.5 and y * vy < 0


def test_each_of_the_settings_drives_through_the_same_scene():
    settings = {"slow": SETTINGS, "short": szlib.MPCSettings(N=4)}
    wall = [((-1.0, 2.0), (6.0, 2.0))]
    runs = scenario_runs.drive_each(
        REFERENCE, (1.0, 0.0), walls=wall, speed=0.5, settings=settings
    )
    assert list(runs) == ["slow", "short"]
    for name, run in runs.items():
        assert run.settings == settings[name] and run.success
        assert run.states[0].tolist() == [0, 0, 0.5, 0]
        assert run.scenario.walls.tolist() == np.array(wall).tolist()

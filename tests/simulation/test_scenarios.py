"""The four scenarios of the paper, their claims, and the metrics of a run."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import shapely
from helpers.made_runs import make_log

import szlib
from szlib.simulation.metrics import find_avoidance_start, find_passing_side
from szlib.zones.ellipses import BODY_RADIUS

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7), 0.0)
KEYS = {
    "success", "time_to_goal", "path_length", "min_h", "min_clearance", "min_speed", "mean_speed",
    "max_speed", "time_stopped", "time_yielding", "passing_side", "infeasible_steps",
    "solve_time_median", "solve_time_p95", "solve_time_max", "outcome",
    "steps_optimal", "steps_relaxed", "steps_restarted", "steps_kept", "steps_braking",
    "min_h_people", "min_h_walls", "jerk", "people", "walls", "flagged_steps", "unflagged_violations",
    "unflagged_overlaps", "min_clearance_people", "min_clearance_walls",
    "max_slack", "solve_time_p99", "violations", "overlaps", "claimed_safe_steps",
}  # fmt: skip


def run(scenario, zone=ZONE, **settings):
    controller = szlib.MPCCBF(
        zone, walls=scenario.walls, settings=szlib.MPCSettings(**settings)
    )
    return szlib.simulate(scenario, controller)


@pytest.fixture(scope="module")
def logs():
    return {name: run(scenario) for name, scenario in szlib.SCENARIOS.items()}


def test_scenarios_have_claims_and_titles():
    for scenario in szlib.SCENARIOS.values():
        assert scenario.walls.shape[1:] == (2, 2) and scenario.start.shape == (4,)
        assert scenario.title
    for name in ("passing", "corridor", "waiting", "making_room"):
        scenario = szlib.SCENARIOS[name]
        assert all(np.hypot(*p.velocity) in (0, 0.5) for p in scenario.people)
        assert scenario.claims


@pytest.mark.parametrize("name", szlib.SCENARIOS)
def test_the_robot_arrives_and_never_leaves_the_safe_set(logs, name):
    log, metrics = logs[name], logs[name].metrics()
    assert set(metrics) == KEYS
    assert metrics["success"] and metrics["infeasible_steps"] == 0
    assert (log.h >= 0).all()
    assert metrics["max_speed"] <= 1 + 1e-6
    assert metrics["min_clearance"] > 0


@pytest.mark.parametrize("name", szlib.SCENARIOS)
def test_the_papers_claims_hold(logs, name):
    for claim in szlib.SCENARIOS[name].claims:
        holds, value = claim.check(logs[name])
        assert holds, f"{claim.text} got {value}"
        assert np.isfinite(value)


@pytest.mark.parametrize("name", szlib.SCENARIOS)
@pytest.mark.parametrize(
    "zone",
    [
        szlib.Ellipse((0.2, 0.0), (1.15, 0.8), 0.2),
        szlib.Ellipse((0.2, 0.0), (1.15, 0.8), -0.2),
        szlib.Ellipse((0.05, 0.0), (0.85, 0.6), 0.2),
        szlib.Ellipse((0.15, 0.0), (0.85, 0.6), -0.2),
    ],
)
def test_the_papers_claims_hold_for_other_zones(name, zone):
    scenario = szlib.SCENARIOS[name]
    log = run(scenario, zone)
    assert log.success and log.h.min() >= 0 and log.metrics()["infeasible_steps"] == 0
    assert all(claim.check(log)[0] for claim in scenario.claims)
    if name in ("passing", "corridor"):
        assert log.metrics()["passing_side"] == log.settings.pass_side


def test_a_zone_without_a_front_starts_avoidance_at_the_same_distance_from_either_side():
    symmetric = szlib.Ellipse((0.0, 0.0), (1.0, 0.7))
    scenario = szlib.SCENARIOS["passing"]
    front, back = (
        find_avoidance_start(run(s, symmetric))[0]
        for s in (scenario, scenario.turn_people())
    )
    assert front == pytest.approx(back, abs=1e-3)
    assert not scenario.claims[0].check(
        run(scenario, szlib.Ellipse((-0.2, 0.0), (1.0, 0.7)))
    )[0]


def test_the_other_passing_side_gives_the_mirror_image():
    for name in ("passing", "corridor"):
        right, left = (
            run(szlib.SCENARIOS[name]),
            run(szlib.SCENARIOS[name], pass_side="left"),
        )
        assert (right.metrics()["passing_side"], left.metrics()["passing_side"]) == (
            "right",
            "left",
        )
        assert right.table["y"].to_numpy() == pytest.approx(
            -left.table["y"].to_numpy(), abs=1e-3
        )


def test_a_run_is_repeatable(logs):
    log = logs["making_room"]
    again = run(log.scenario)
    pd.testing.assert_frame_equal(
        log.table.drop(columns="solve_time"),
        again.table.drop(columns="solve_time"),
        check_exact=True,
    )


def test_the_table_has_motion_and_barriers(logs):
    log = logs["waiting"]
    table, dt, controller = log.table, 0.1, szlib.MPCCBF(ZONE, walls=log.scenario.walls)
    assert len(table) == len(log.predicted)
    x, v, a = (
        table[list(columns)].to_numpy()
        for columns in (("x", "y"), ("vx", "vy"), ("ax", "ay"))
    )
    assert table["t"].to_numpy() == pytest.approx(np.arange(len(table)) * dt)
    assert x[1:] == pytest.approx(x[:-1] + dt * v[:-1] + dt**2 / 2 * a[:-1], abs=1e-12)
    assert v[1:] == pytest.approx(v[:-1] + dt * a[:-1], abs=1e-12)
    assert log.predicted[:-1, 1] == pytest.approx(np.c_[x, v][1:], abs=1e-9)
    assert table["person_0_x"].to_numpy() == pytest.approx(
        4 - 0.5 * table["t"].to_numpy()
    )
    for i in (0, 57, len(table) - 1):
        person = log.scenario.people[0].after(table["t"][i])
        expected = controller.barriers(x[i], [person])
        found = table.loc[
            i, ["h_person_0", *(f"h_wall_{j}" for j in range(4))]
        ].to_numpy(float)
        assert found == pytest.approx(expected, abs=1e-9)
        robot = shapely.Point(x[i])
        gaps = [robot.distance(shapely.LineString(wall)) for wall in log.scenario.walls]
        gaps.append(robot.distance(shapely.Point(person.position)) - BODY_RADIUS)
        assert table["clearance"][i] == pytest.approx(min(gaps) - 0.5)


def test_metrics_without_people():
    scenario = szlib.Scenario("alone", (0.0, 0.0, 0.0, 0.0), (3.0, 4.0))
    metrics = run(scenario).metrics()
    assert metrics["success"] and metrics["passing_side"] == "none"
    assert metrics["path_length"] == pytest.approx(5, abs=0.11)
    assert np.isnan(metrics["min_h"]) and np.isnan(metrics["min_clearance"])
    assert metrics["time_stopped"] == metrics["time_yielding"] == 0
    assert metrics["min_speed"] > 0.9


def test_a_run_that_ends_early_is_no_success():
    scenario = szlib.SCENARIOS["waiting"]
    log = szlib.simulate(scenario, szlib.MPCCBF(ZONE, walls=scenario.walls), max_time=5)
    assert not log.success and np.isnan(log.metrics()["time_to_goal"])
    assert log.table["t"].iloc[-1] == 5
    assert log.metrics()["passing_side"] == "none"


def test_a_robot_that_is_boxed_in_stands_without_yielding_and_one_that_is_held_yields():
    box = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    walls = np.stack([box, np.roll(box, -1, axis=0)], axis=1)
    boxed = szlib.Scenario(
        "boxed", (0.0, 0.0, 0.0, 0.0), (5.0, 0.0), walls=walls, duration=20
    )
    metrics = run(boxed).metrics()
    assert metrics["time_stopped"] > 8 and metrics["time_yielding"] == 0
    # walls too close for a way around: the person who stands there holds the robot
    lane = [((-6, y), (6, y)) for y in (1.0, -1.0)]
    standing = szlib.Person((0.0, 0.0), heading=np.pi)
    held = szlib.Scenario(
        "held", (-4.0, 0, 0, 0), (4.0, 0), (standing,), lane, duration=20
    )
    metrics = run(held).metrics()
    assert (
        metrics["time_yielding"] > 5
        and metrics["min_h"] >= 0
        and not metrics["success"]
    )


def test_steps_that_had_to_be_relaxed_are_counted_and_the_robot_recovers():
    close = szlib.Person((0.0, 0.0), (-0.5, 0.0))
    log = run(szlib.Scenario("close", (-1.9, 0.0, 0.0, 0.0), (4.0, 0.0), (close,)))
    relaxed = log.table["status"] != "optimal"
    # the last step is not among them
    assert 0 < log.metrics()["infeasible_steps"] == relaxed.sum() < 20
    assert (log.table["slack"][relaxed] > 0).all()
    assert log.success


def test_several_people_with_own_zones_and_velocities_among_several_walls():
    people = (
        szlib.Person((0.0, 1.0), (-0.5, 0.0)),
        szlib.Person(
            (2.0, -1.5), (-0.2, 0.3), zone=szlib.Ellipse((0.2, 0.0), (0.8, 0.6))
        ),
        szlib.Person(
            (5.0, -3.0), heading=2.0, zone=szlib.Ellipse((0.0, 0.0), (1.3, 0.9))
        ),
    )
    walls = [((-8, 5), (8, 5)), ((-8, -5), (8, -5))]
    log = run(szlib.Scenario("busy", (-5.0, 0, 0, 0), (6.0, 1.0), people, walls))
    assert log.success and log.h.min() >= -1e-6
    assert [name for name in log.table if name.startswith("h_")] == [
        *(f"h_person_{i}" for i in range(3)),
        "h_wall_0",
        "h_wall_1",
    ]


def passing_log(y, x=(-2.0, -1.0, 0.5, 2.0)):
    """A made-up run past a person at the origin, who is only looked at."""
    person = szlib.Person((0, 0), heading=0.0)
    scenario = szlib.Scenario("made", (-2.0, 0, 0, 0), (2.0, 0), (person,))
    states = np.zeros((4, 4))
    states[:, 0], states[:, 1] = x, y
    return make_log(
        scenario, states, np.zeros((4, 1, 5)), zone=ZONE, residual=0.0, arrival=3
    )


def test_the_passing_side_is_opposite_to_the_person():
    assert find_passing_side(passing_log(y=-1.0)) == "right"
    assert find_passing_side(passing_log(y=1.0)) == "left"
    assert find_passing_side(passing_log(y=1.0, x=(-2, -1.5, -1, -1))) == "none"


def test_avoidance_starts_where_the_line_is_left():
    # 0.1 m beside it at x = -0.5 m
    distance, h = find_avoidance_start(passing_log(y=[0.0, -0.05, -0.2, 0.0]))
    assert distance == pytest.approx(np.hypot(0.5, 0.1))
    person = szlib.Person((0, 0), heading=0.0)
    before, after = (
        szlib.MPCCBF(ZONE).barriers(at, [person])[0]
        for at in ((-1.0, -0.05), (0.5, -0.2))
    )
    assert h == pytest.approx(before + (after - before) / 3)
    assert np.isnan(find_avoidance_start(passing_log(y=0.0))).all()


def test_turn_people_changes_only_headings():
    scenario = szlib.SCENARIOS["corridor"]
    turned = scenario.turn_people().people[0]
    assert np.cos(turned.heading) == pytest.approx(1)
    assert (turned.position, turned.velocity) == (
        scenario.people[0].position,
        scenario.people[0].velocity,
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"start": (-1.2, 0, 0, 0)},
            r"'passing': the run starts in violation: h = -0\.\d+ m for person 0",
        ),
        (
            {"start": (-4, 0, 1.2, 0)},
            "speed at the start must be at most v_max = 1 m/s; got 1.2",
        ),
        ({"goal": (0.3, 0.0)}, "cannot be reached"),
        ({"walls": [((-5, 0.3), (5, 0.3))]}, "starts in violation: .* for wall 0"),
    ],
)
def test_invalid_starts_and_goals_are_rejected(change, message):
    with pytest.raises(szlib.SolverError, match=message):
        run(replace(szlib.SCENARIOS["passing"], **change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start": (0, 0)}, "start must have shape"),
        ({"goal": (np.nan, 0)}, "goal must be finite"),
        ({"walls": [((1, 1), (1, 1))]}, "a wall must be 0.001 m long or longer"),
        ({"duration": -1}, "duration must be finite, above 0; got -1"),
    ],
)
def test_invalid_scenarios_are_rejected(change, message):
    with pytest.raises(szlib.SolverError, match=message):
        replace(szlib.SCENARIOS["passing"], **change)


def test_the_name_of_a_scenario_is_no_scenario():
    with pytest.raises(szlib.SolverError, match=r"must be a Scenario.*got 'corridor'"):
        szlib.simulate("corridor", szlib.MPCCBF(ZONE))


def test_walls_of_a_scenario_are_those_of_a_controller_that_is_given_the_same():
    room = shapely.box(-6, -3, 6, 3).exterior
    scenario = replace(szlib.SCENARIOS["passing"], walls=room)
    assert len(scenario.walls) == 4
    assert run(scenario).success
    assert szlib.simulate(scenario, szlib.MPCCBF(ZONE, walls=room)).success


def test_a_controller_with_other_walls_is_rejected():
    with pytest.raises(
        szlib.SolverError, match="knows 0 walls, and not the 2 of 'corridor'"
    ):
        szlib.simulate(szlib.SCENARIOS["corridor"], szlib.MPCCBF(ZONE))


def test_scenarios_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        szlib.SCENARIOS["corridor"].walls[0] = 0


# --- the log -----------------------------------------------------------------------------------------


def rewrite(file, change):
    """Save the run of `file` with a `change` of the text that it holds."""
    arrays = dict(np.load(file))
    np.savez(file, **arrays | {"content": np.array(change(str(arrays["content"])))})


def test_a_log_with_an_obstacle_of_an_unknown_kind_is_rejected(tmp_path):
    edge = szlib.control.HalfPlane((0.0, -2.0), (0.0, 1.0))
    log = szlib.simulate(
        replace(szlib.SCENARIOS["passing"], obstacles=(edge,)),
        szlib.MPCCBF(ZONE, obstacles=[edge]),
        max_time=0.2,
    )
    log.save(tmp_path / "run")
    (back,) = szlib.SimulationLog.load(tmp_path / "run").scenario.obstacles
    assert (type(back), back.numbers) == (type(edge), edge.numbers)
    rewrite(tmp_path / "run.npz", lambda text: text.replace('"half-plane"', '"sofa"'))
    with pytest.raises(
        szlib.DataError, match="kind of an obstacle must be that of a class"
    ):
        szlib.SimulationLog.load(tmp_path / "run")


def test_a_walker_whose_heading_is_unknown_is_saved_and_loaded(tmp_path):
    person = szlib.Person((4.0, 0.0), (-0.5, 0.0), heading_unknown=True)
    scenario = szlib.Scenario("short", (-3.0, 0.0, 0.0, 0.0), (3.0, 0.0), (person,))
    szlib.simulate(scenario, szlib.MPCCBF(ZONE), max_time=0.1).save(tmp_path / "run")
    back = szlib.SimulationLog.load(tmp_path / "run")
    assert back.scenario.people[0].heading is None


def test_names_with_a_dot_are_different_runs(tmp_path):
    scenario = szlib.Scenario("short", (-3.0, 0.0, 0.0, 0.0), (3.0, 0.0))
    for gamma, seconds in ((0.1, 0.5), (0.4, 1.0)):
        log = szlib.simulate(scenario, szlib.MPCCBF(ZONE), max_time=seconds)
        log.save(tmp_path / f"gamma_{gamma}")
    sizes = [
        len(szlib.SimulationLog.load(tmp_path / f"gamma_{gamma}").states)
        for gamma in (0.1, 0.4)
    ]
    assert sizes == [6, 11]


@pytest.mark.parametrize("name", szlib.SCENARIOS)
def test_a_log_is_saved_and_loaded_unchanged(logs, name, tmp_path):
    log = logs[name]
    log.save(tmp_path / "run.npz")
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]
    back = szlib.SimulationLog.load(tmp_path / "run")
    pd.testing.assert_frame_equal(back.table, log.table, check_exact=True)
    assert back.metrics() == log.metrics()
    assert np.array_equal(back.predicted, log.predicted) and np.array_equal(
        back.residual, log.residual
    )
    assert (back.settings, back.zones) == (log.settings, log.zones)
    assert back.scenario.claims == ()


def test_a_log_of_another_version_of_szlib_is_loaded(logs, tmp_path):
    log = logs["passing"]
    log.save(tmp_path / "run")
    file = tmp_path / "run.npz"
    own = f'"szlib": "{szlib.__version__}"'
    rewrite(file, lambda text: text.replace(own, '"szlib": "0.1.0"'))
    assert '"szlib": "0.1.0"' in str(np.load(file)["content"])
    pd.testing.assert_frame_equal(szlib.SimulationLog.load(file).table, log.table)


def test_a_log_without_people_is_saved_and_loaded(tmp_path):
    log = run(szlib.Scenario("alone", (0.0, 0.0, 0.0, 0.0), (3.0, 4.0)))
    log.save(tmp_path / "alone")
    pd.testing.assert_frame_equal(
        szlib.SimulationLog.load(tmp_path / "alone").table, log.table
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda folder: (folder / "run.npz").unlink(), "FileNotFoundError"),
        (lambda folder: (folder / "run.npz").write_bytes(b"PK\x03\x04"), "BadZipFile"),
        (lambda folder: (folder / "run.npz").write_bytes(b"[]"), "ValueError"),
        (
            lambda folder: rewrite(
                folder / "run.npz", lambda _: '{"format": "other", "version": 1}'
            ),
            "other 1",
        ),
        (
            lambda folder: rewrite(folder / "run.npz", lambda _: "[]"),
            "TypeError",
        ),
        (
            lambda folder: np.savez(folder / "run.npz", states=np.zeros((2, 4))),
            "content",
        ),
    ],
)
def test_damaged_logs_are_rejected(logs, tmp_path, change, message):
    logs["passing"].save(tmp_path / "run")
    change(tmp_path)
    with pytest.raises(szlib.DataError, match=message):
        szlib.SimulationLog.load(tmp_path / "run")


def test_a_log_that_cannot_be_written_is_an_error(logs, tmp_path):
    with pytest.raises(szlib.DataError, match="cannot be written"):
        logs["passing"].save(tmp_path / "missing" / "run")


def test_the_repr_of_a_log_is_short(logs):
    shown = repr(logs["corridor"])
    assert len(shown.splitlines()) <= 3 and len(shown) < 300
    assert (
        "'corridor'" in shown
        and "outcome arrived" in shown
        and "1 people, 2 obstacles" in shown
    )
    html = logs["corridor"]._repr_html_()
    assert "time_to_goal" in html and "Avoiding a person" in html

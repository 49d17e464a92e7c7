"""Zones of the literature are what their sources say; comparisons are paired, intervals are honest."""

import numpy as np
import pandas as pd
import pytest
import shapely
from studies.literature_zones import ZONES, compare, kirby_curve, measure_time_inside
from studies.summaries import summarise

import szlib
from szlib.simulation.monte_carlo import (
    BEHAVIOURS,
    FORMULATIONS,
    WORLDS,
    RolloutSetup,
)

FITTED = szlib.Ellipse((0.1, -0.02), (1.0, 0.7), 0.3)


def test_zones_have_the_sizes_of_their_sources():
    zones = {name: zone(FITTED) for name, zone in ZONES.items()}
    assert zones["fitted"] == FITTED
    assert zones["equal circle"].area == pytest.approx(FITTED.area)
    assert zones["Hall"].semi_axes == (1.2, 1.2)
    assert zones["none"].semi_axes == (0.25, 0.25)


def test_kirbys_ellipse_is_the_smallest_around_its_curve():
    curve = kirby_curve(np.linspace(-np.pi, np.pi, 2001), 0.5)
    reach = [curve[:, 0].max(), curve[:, 0].min(), curve[:, 1].max()]
    assert reach == pytest.approx([1.0, -0.5, 2 / 3], abs=1e-5)
    ellipse = ZONES["Kirby"](FITTED)
    assert ellipse.level(curve).max() == pytest.approx(1.0, abs=1e-6)
    outline, inside = shapely.Polygon(ellipse.curve(2001)), shapely.Polygon(curve)
    assert outline.buffer(1e-4).contains(inside)
    assert ellipse.area < 1.15 * inside.area


@pytest.mark.parametrize("seed", range(20))
def test_robots_start_outside_each_zone(seed):
    scenario = WORLDS(seed)
    for zone in ZONES.values():
        controller = szlib.MPCCBF(zone(scenario.people[0].zone), walls=scenario.walls)
        people = [
            szlib.Person(p.position, p.velocity, p.heading) for p in scenario.people
        ]
        assert controller.barriers(scenario.start[:2], people).min() >= 0


def test_time_inside_is_measured_with_the_zones_of_the_world():
    log = RolloutSetup(worlds=WORLDS, zone_transform=ZONES["none"]).run(0)
    inside = measure_time_inside(log)
    bodies = log.clearance[:, : len(log.scenario.people)]
    assert inside["inside none"] == pytest.approx(0.1 * (bodies.min(axis=1) < 0).sum())
    assert (
        inside["inside none"] <= inside["inside equal circle"] <= inside["inside Hall"]
    )


def test_compare_is_paired():
    rows = compare(
        2, zones=("none", "fitted"), formulations=("szlib",), n_jobs=1, progress=False
    )
    assert len(rows) == 4
    assert rows.groupby("zone")["seed"].apply(list).tolist() == [[0, 1], [0, 1]]
    assert rows["people"].tolist()[:2] == rows["people"].tolist()[2:]
    found = summarise(rows, against={"zone": "fitted"}).set_index(["zone", "metric"])
    assert (found.loc["fitted"][["mean", "low", "high"]] == 0).all(axis=None)
    with pytest.raises(
        szlib.SolverError, match="unknown names: Hull; expected none, equal circle"
    ):
        szlib.compare(1, zones=("Hull",))


def table(**columns):
    seeds = np.tile(np.arange(200), 2)
    return pd.DataFrame({"seed": seeds, "zone": np.repeat(["a", "b"], 200), **columns})


def test_intervals_cover_the_mean_and_pairs_sharpen_them():
    rng = np.random.default_rng(0)
    world_effect = rng.normal(0, 10, 200)
    x = np.concatenate([world_effect + 1, world_effect + rng.normal(0, 0.1, 200)])
    alone = summarise(table(x=x), ["zone"], ["x"]).set_index("zone")
    assert (alone["low"] < alone["mean"]).all()
    assert (alone["mean"] < alone["high"]).all()
    spread = np.std(x[:200]) / np.sqrt(200)
    assert alone.loc["a", "high"] - alone.loc["a", "low"] == pytest.approx(
        2 * 1.96 * spread, rel=0.15
    )
    paired = summarise(table(x=x), ["zone"], ["x"], against={"zone": "b"}).set_index(
        "zone"
    )
    assert paired.loc["a", "mean"] == pytest.approx(1, abs=0.05)
    assert paired.loc["a", "high"] - paired.loc["a", "low"] < 0.1
    assert paired.loc["b", ["low", "high"]].tolist() == [0, 0]


def test_missing_values_are_left_out():
    rows = table(x=np.where(np.arange(400) % 2, np.nan, 3.0))
    found = summarise(rows, ["zone"], ["x"])
    assert found[["mean", "low", "high"]].to_numpy() == pytest.approx(3.0)
    assert found["n"].tolist() == [100, 100]


def test_unknown_names_are_rejected():
    assert list(FORMULATIONS) == ["paper", "szlib", "whole horizon", "rest"]
    assert FORMULATIONS["paper"] == szlib.MPCSettings.paper()
    assert FORMULATIONS["whole horizon"].N_h == szlib.MPCSettings().N
    assert "as expected" in BEHAVIOURS

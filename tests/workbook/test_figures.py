"""Figures: every one labels its axes with units, keeps metres square, and leaves its input alone."""

import doctest
import importlib
import inspect
import io
import re
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import plots
import pytest
from PIL import Image
from studies import quantile_zone
from studies.pooling import pool
from studies.safety_claims import MOTION_CHANGES

import szlib
from szlib.workbook import figures

matplotlib.use("Agg")
import matplotlib.pyplot as plt

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))


@pytest.fixture(scope="module")
def log():
    scenario = szlib.SCENARIOS["corridor"]
    return szlib.simulate(
        scenario, szlib.MPCCBF(ZONE, walls=scenario.walls), max_time=3.0
    )


@pytest.fixture(scope="module")
def step():
    scenario = szlib.SCENARIOS["making_room"]
    controller = szlib.MPCCBF(ZONE, walls=scenario.walls)
    return controller.step(
        [1.6, -0.1, -0.15, -0.16], (6.0, 0.0), [szlib.Person((4.0, 0.0), (-0.5, 0.0))]
    )


EDGE = szlib.control.HalfPlane(point=(0.0, -2.0), normal=(0.1, 1.0))


@pytest.fixture(scope="module")
def platform():
    person = szlib.Person((2.0, 0.3), (-0.5, 0.0))
    walls = [((-5.0, 3.0), (5.0, 3.0))]
    scenario = szlib.Scenario(
        "platform", (-4, 0, 0, 0), (4, 0), (person,), walls, obstacles=(EDGE,)
    )
    controller = szlib.MPCCBF(ZONE, walls=walls, obstacles=[EDGE])
    return szlib.simulate(scenario, controller, max_time=4.0), controller


def along_edge(ax):
    """The ends of the line of the half-plane in `ax`, and whether its other side is hatched."""
    (line,) = (each for each in ax.lines if each.get_label() == "half-plane")
    (inside,) = (each for each in ax.collections if getattr(each, "hatches", None))
    (hatched,) = (path for path in inside.get_paths() if len(path))
    return line.get_xydata(), hatched


@pytest.mark.parametrize("name", ["scenario", "robot paths", "crowd", "step"])
def test_a_half_plane_is_a_line_across_the_picture_and_hatched_beyond(platform, name):
    log, controller = platform
    step = controller.step(*log.controller_inputs(3.5))
    ax = {
        "scenario": lambda: figures.plot_scenario(log),
        "robot paths": lambda: plots.plot_robot_paths({"a": log}),
        "crowd": lambda: plots.plot_crowd(log),
        "step": lambda: plots.plot_step(step),
    }[name]()
    assert in_metres(ax)
    ends, hatched = along_edge(ax)
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    assert EDGE.distance(*ends.T, 0.0, *EDGE.numbers) == pytest.approx(0.0, abs=1e-3)
    at_border = np.isclose(ends, [x0, y0]) | np.isclose(ends, [x1, y1])
    assert len(ends) == 2 and at_border.any(axis=1).all()
    beyond = EDGE.distance(*hatched.vertices.T, 0.0, *EDGE.numbers)
    assert beyond.max() <= 1e-3 and beyond.min() < -0.1


def test_the_player_draws_a_half_plane_as_one_line(platform):
    log, _ = platform
    wall, edge = figures.animate(log, width=3.0).run["layout"]["walls"]
    assert wall == [-5.0, 3.0, 5.0, 3.0]
    x, y = np.reshape(edge, (2, 2)).T
    assert EDGE.distance(x, y, 0.0, *EDGE.numbers) == pytest.approx(0.0, abs=2e-3)


@pytest.fixture(scope="module")
def samples():
    rng = np.random.default_rng(0)
    n = 31 * 40
    return pd.DataFrame(
        {
            "encounter": np.repeat(np.arange(40), 31),
            "los_angle": rng.uniform(-np.pi, np.pi, n),
            "distance": rng.uniform(0.9, 2.5, n),
            "speed": rng.uniform(0.4, 1.6, n),
        }
    )


@pytest.fixture(scope="module")
def zone(samples):
    return szlib.SocialZone.fit(
        samples, method="hull", speeds=(0.9, 1.1), n_resamples=20
    )


@pytest.fixture(scope="module")
def tracks():
    t = np.arange(50) / 10
    return pd.DataFrame(
        {"day": "d", "id": 1, "t": t, "x": -13 + t, "y": 0 * t, "vx": 1.0, "vy": 0.0}
    )


def in_metres(ax):
    return (
        "[m]" in ax.get_xlabel() and "[m]" in ax.get_ylabel() and ax.get_aspect() == 1
    )


def paths():
    t = np.arange(31) / 10
    rows = [(k, s, s, 0, 5 - s, 0.1 * k) for k in range(5) for s in t]
    return pd.DataFrame(
        rows, columns=["encounter", "t", "ref_x", "ref_y", "other_x", "other_y"]
    )


MAPS = {
    "map": lambda f: plots.plot_map(f("tracks"), szlib.ATC_SQUARE),
    "paths": lambda f: plots.plot_encounter_paths(paths(), n_shown=3),
    "los": lambda f: plots.plot_relative_positions(f("samples")),
    "outliers": lambda f: plots.draw_outliers(
        np.eye(2), np.eye(2), np.arange(2) < 1
    ).axes[1],
    "zone": lambda f: figures.plot_zone(f("zone"), 1.1, truth=ZONE),
    "zones": lambda f: figures.plot_zones(f("zone")),
    "ellipse": lambda f: plots.plot_distance(ZONE),
    "segment": lambda f: plots.plot_distance((np.array([-1.0, 0]), np.array([1.0, 0]))),
    "scenario": lambda f: figures.plot_scenario(f("log")),
    "step": lambda f: plots.plot_step(f("step")),
    "robot paths": lambda f: plots.plot_robot_paths({"a": f("log"), "b": f("log")}),
}


@pytest.fixture(scope="module")
def ways_step():
    people = [szlib.Person((3.0, y), heading=np.pi) for y in (-0.9, 0.0, 0.9)]
    settings = szlib.MPCSettings.among_people(time_limit=np.inf)
    controller = szlib.MPCCBF(ZONE, settings=settings, walls=[[(-1, -4), (9, -4)]])
    return controller.step((0, 0, 0, 0), (8, 0), people)


def test_the_way_that_is_taken_is_solid_and_the_others_are_dashed(ways_step):
    ax = plots.plot_ways(ways_step)
    assert len(ways_step.ways) > 1 and in_metres(ax)
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    lines = [line for line in ax.lines if line.get_label() in names]
    assert [line.get_linestyle() == "-" for line in lines] == [True, False]
    assert len({line.get_color() for line in lines}) == len(lines)
    for i, (way, line, name) in enumerate(
        zip(ways_step.ways, lines, names, strict=True)
    ):
        assert np.array_equal(line.get_xydata(), way.points)
        word = "not taken" if i else "taken"
        whole = f"{word}: {way.name}, cost {way.cost:.1f} s"
        assert name.replace("\n", " ") == whole
    assert {text.get_text() for text in ax.texts} == {"0", "1", "2"}
    x0, x1 = ax.get_xlim()
    assert x0 < 0 and x1 > 8


def test_without_ways_the_scene_is_drawn(step):
    assert step.ways == ()
    ax = plots.plot_ways(step)
    assert ax.get_legend() is None and ax.get_title() == "No way was looked for"
    assert in_metres(ax)


GRAPHS = {
    "speeds": lambda f: plots.plot_speed_histogram(np.ones(9), np.zeros(9)),
    "los-distance": lambda f: plots.plot_distance_by_direction(f("samples")),
    "hull": lambda f: plots.plot_hull(f("zone"), (0.9, 1.1)),
}


@pytest.mark.parametrize("name", MAPS)
def test_maps_are_square_and_in_metres(name, request):
    ax = MAPS[name](request.getfixturevalue)
    assert in_metres(ax)
    assert ax.get_title()
    ax.figure.savefig(io.BytesIO())


def test_the_cells_count_every_sample_within_r_max(samples):
    for plot in (plots.plot_relative_positions, plots.plot_distance_by_direction):
        (cells,) = [c for c in plot(samples).collections if c.get_array() is not None]
        assert cells.get_array().sum() == (samples["distance"] <= 2).sum()


def test_an_arrow_points_along_the_end_of_each_path():
    ax = plots.plot_encounter_paths(paths(), n_shown=3)
    marks = [
        line
        for line in ax.lines
        if isinstance(line.get_marker(), tuple) and len(line.get_xdata())
    ]
    assert (
        sorted(round(line.get_marker()[2] + 90) % 360 for line in marks)
        == [0] * 3 + [180] * 3
    )


@pytest.mark.parametrize("name", GRAPHS)
def test_graphs_name_units(name, request):
    ax = GRAPHS[name](request.getfixturevalue)
    assert "[" in ax.get_xlabel() + ax.get_ylabel()
    assert ax.get_title()
    ax.figure.savefig(io.BytesIO())


@pytest.mark.parametrize(
    "name", sorted(file.stem for file in Path(plots.__file__).parent.glob("[a-z]*.py"))
)
def test_examples_of_the_figures_of_notebooks_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(f"plots.{name}")
    assert doctest.testmod(module).failed == 0


def test_the_hull_stands_beside_the_zones_that_it_leaves_free(zone):
    points = np.array([[0.1, 0.2, 0.9], [-0.3, 0.1, 1.1]])
    _, right = plots.draw_hull_and_zones(zone, points).axes
    assert in_metres(right)
    for line, speed in zip(right.lines, zone.ellipses, strict=False):
        assert np.array_equal(line.get_xydata(), zone.boundary(speed))


def test_the_reach_of_a_zone_is_its_outline_in_each_direction():
    bands = pd.DataFrame(
        {"direction": [-np.pi / 2, 0.0, np.pi / 2], "low": 0.6, "high": 0.9}
    )
    _, right = plots.draw_zone_and_reach(
        ZONE, szlib.Ellipse((0, 0), (1, 1)), bands, 1.1
    ).axes
    reach, truth = (line.get_ydata() for line in right.lines)
    assert reach == pytest.approx([0.697, 1.1, 0.697], abs=2e-3)
    assert truth == pytest.approx([1, 1, 1], abs=1e-5)


def test_a_plan_is_drawn_with_the_person_where_they_are_at_that_time(log):
    _, ax = plots.draw_plans(log, (0, 20)).axes
    assert ax.get_title() == f"2 s: {log.speed[20]:.2f} m/s"
    drawn = {line.get_label(): line.get_xydata() for line in ax.lines}
    assert drawn["person"] == pytest.approx(log.people[20, :1, :2])
    assert np.array_equal(
        drawn[f"plan, {log.settings.N} steps"], log.predicted[20][:, :2]
    )


def test_given_axes_are_drawn_on(zone):
    _, ax = plt.subplots()
    assert figures.plot_zone(zone, 1.1, ax=ax) is ax


def test_n_shown_limits_the_number_of_paths():
    ax = plots.plot_encounter_paths(paths(), n_shown=3)
    assert all(len(c.get_segments()) == 3 for c in ax.collections)


def test_the_drawn_curve_is_the_ellipse(zone):
    ax = figures.plot_zone(zone, 1.1)
    drawn = ax.lines[0].get_xydata()
    assert np.abs(zone.ellipse(1.1).level(drawn) - 1).max() < 1e-9


def fit_few(samples):
    with pytest.warns(szlib.DataWarning, match="fewer than 20"):
        return szlib.SocialZone.fit(
            samples[samples["encounter"] < 15],
            method=quantile_zone.NAME,
            speeds=(0.9, 1.1),
            n_resamples=20,
        )


def test_only_a_usable_zone_is_solid(zone, samples, monkeypatch):
    usable = szlib.SocialZone(**vars(zone))
    monkeypatch.setattr(
        szlib.SocialZone,
        "verdict",
        lambda self, speed: "usable" if self is usable else "undecided",
    )
    for known, line in ((usable, "-"), (fit_few(samples), "--")):
        ellipse = figures.plot_zone(known, 1.1).lines[0]
        assert ellipse.get_linestyle() == line
        ax = figures.plot_zones(known)
        assert [each.get_linestyle() for each in ax.lines[:2]] == [line] * 2
        labels = [text.get_text() for text in ax.get_legend().get_texts()]
        assert all(("undecided" in label) == (line == "--") for label in labels)


def test_the_band_is_drawn_exactly_where_an_interval_is_known(zone, samples):
    band = figures.plot_zone(zone, 1.1).collections[0]
    reach = np.hypot(*np.concatenate([path.vertices for path in band.get_paths()]).T)
    known = zone.uncertainty.bands.query("speed == 1.1")
    assert reach.min() == pytest.approx(known["low"].min())
    assert reach.max() == pytest.approx(known["high"].max())
    plain = szlib.SocialZone.fit(samples, speeds=(1.1,), n_resamples=0)
    assert not figures.plot_zone(plain, 1.1).collections
    assert "interval" not in figures.plot_zones(plain).get_title()


def test_a_fitted_zone_has_no_hull(samples):
    zone = szlib.SocialZone.fit(
        samples, method=quantile_zone.NAME, speeds=(1.1,), n_resamples=0
    )
    labels = [
        text.get_text()
        for text in figures.plot_zone(zone, 1.1).get_legend().get_texts()
    ]
    assert labels == ["fitted ellipse"]
    with pytest.raises(szlib.ZoneError, match="'quantile' has no hull to draw"):
        plots.plot_hull(zone)


def test_the_limits_hold_everything_that_is_drawn(log):
    ax = figures.plot_scenario(log, every=1.0)
    limits = np.array([ax.get_xlim(), ax.get_ylim()])
    drawn = [
        patch.get_path().vertices @ patch.get_patch_transform().get_matrix()[:2, :2].T
        + patch.get_patch_transform().get_matrix()[:2, 2]
        for patch in ax.patches
    ]
    everything = np.vstack([*drawn, log.states[:, :2]])
    assert (everything.min(axis=0) >= limits[:, 0] - 1e-9).all()
    assert (everything.max(axis=0) <= limits[:, 1] + 1e-9).all()


PLOTS = [
    (module, name)
    for module in (figures, plots)
    for name in dir(module)
    if name.startswith("plot_")
]


@pytest.mark.parametrize(("module", "name"), PLOTS)
def test_every_plot_takes_axes_or_makes_them_and_needs_no_title(module, name):
    parameters = inspect.signature(getattr(module, name)).parameters
    assert parameters["ax"].default is None
    assert "title" not in parameters


@pytest.mark.parametrize("module", [figures, plots])
def test_every_plot_is_exported(module):
    defined = {
        (module, name)
        for file in Path(module.__file__).parent.glob("*.py")
        for name in re.findall(r"^def (plot_\w+)", file.read_text(), re.MULTILINE)
    }
    assert defined == {each for each in PLOTS if each[0] is module}


def test_a_log_has_plot_and_animate(log):
    assert in_metres(log.plot())
    assert log.animate(every=2.0, width=2.0).startswith(b"GIF8")


def test_an_animation_has_a_frame_for_each_interval(log):
    with Image.open(io.BytesIO(figures.animate(log, every=1.0, width=3.0))) as movie:
        assert movie.format == "GIF"
        assert movie.n_frames == int(np.floor(log.table["t"].iloc[-1] + 1e-9)) + 1


@pytest.mark.parametrize(("every", "step"), [(0.4, 0.4), (0.27, 0.3), (0.01, 0.1)])
def test_an_animation_is_twice_as_fast_as_the_run(log, every, step):
    with Image.open(io.BytesIO(figures.animate(log, every=every, width=2.0))) as movie:
        assert movie.info["duration"] == pytest.approx(1000 * step / 2)


def test_alt_text_holds_titles_axes_and_legends():
    fig, (left, right) = plt.subplots(1, 2)
    left.plot([0], [0], label="robot")
    left.set(title="A run", xlabel="time [s]", ylabel="h [m]")
    left.legend()
    right.set(xlabel="speed\n[m/s]")
    assert (
        figures.alt_text(fig) == "A run: h [m] over time [s], with robot; speed [m/s]"
    )


# --- respect, claims, sensitivity, many runs ----------------------------------------------------------


def test_each_zone_size_has_a_band():
    sizes = {"a": [1.2, 1.0], "a_low": [1.0, 0.9], "a_high": [1.5, 1.1]}
    ax = plots.plot_zone_sizes(
        pd.DataFrame({"encounters": [10, 100], **sizes}), {"a": "hull"}
    )
    assert ax.get_xscale() == "log" and "[m]" in ax.get_ylabel()
    assert len(ax.collections) == len(ax.lines) == 1


def test_the_largest_sensitivity_is_on_top():
    rows = [
        ("default", "", 2.0),
        ("r_max", "1.5", 1.9),
        ("speed", "0.9", 0.5),
        ("speed", "1.3", 4.0),
    ]
    ax = plots.plot_sensitivity(
        pd.DataFrame(rows, columns=["parameter", "value", "area"])
    )
    assert [label.get_text() for label in ax.get_yticklabels()] == [
        "r_max\n1.5",
        "speed\n0.9; 1.3",
    ]


def test_a_map_of_strategies_has_the_fill_of_its_strategy_in_each_cell():
    cells = pd.DataFrame(
        {
            "gamma": [0.1, 0.1, 0.2, 0.2],
            "width": [1.0, 2.0] * 2,
            "strategy": list("xyyz"),
        }
    )
    ax = plots.plot_strategies(
        cells, names=["x", "y", "z"], rows="gamma", columns="width"
    )
    handles, names = ax.get_legend_handles_labels()
    fills = {
        handle.get_facecolor(): name
        for handle, name in zip(handles, names, strict=True)
    }
    found = {
        tuple(patch.get_center()): fills[patch.get_facecolor()]
        for bars in ax.containers
        for patch in bars
    }
    assert found == {(0, 0): "x", (1, 0): "y", (0, 1): "y", (1, 1): "z"}
    assert ax.get_xlabel() == "width" and [
        each.get_text() for each in ax.get_yticklabels()
    ] == ["0.1", "0.2"]


def test_claims_differ_by_more_than_colour_and_keep_their_units():
    table = pd.DataFrame(
        {"claim": list("abcd"), "effect": [1.0, -1.0, 0.1, np.nan], "low": [0.5, -2, -1, np.nan],
         "high": [2.0, -0.5, 1, np.nan], "unit": ["m", "m2", "s", "m"],
         "verdict": ["supported", "not supported", *["not decidable with n = 3"] * 2]}
    )  # fmt: skip
    panels = plots.draw_claims(table).axes
    assert len({ax.lines[0].get_marker() for ax in panels}) == 3
    assert [ax.get_title(loc="left") for ax in panels] == list("abcd")
    assert [ax.get_title(loc="right") for ax in panels[1:3]] == [
        "not supported",
        "not decidable",
    ]
    assert [ax.get_xlabel() for ax in panels] == ["m", "m2", "s", "m"]
    # the interval fills the panel, and 0 is in the middle
    assert panels[1].get_xlim() == pytest.approx((-2.3, 2.3))


def test_a_forest_plot_has_a_row_for_each_site_the_mean_and_a_new_site():
    sites = {
        "hall": (0.9, 0.8, 1.0),
        "mall": (1.2, 1.0, 1.4),
        "lab": (0.6, 0.5, 0.7),
        "yard": (1.0, 0.7, 1.4),
    }
    pooled = pool(sites)
    ax = plots.plot_forest(pooled)
    labels = [label.get_text() for label in ax.get_yticklabels()]
    assert [label.partition(":")[0] for label in labels] == [
        *sites,
        "mean",
        "a new site",
    ]
    assert labels[1] == "mall: 1.20 (1.00 to 1.40)"
    assert (
        ax.get_xlabel().startswith("radius of the zone [m]")
        and ax.get_xscale() == "log"
    )
    diamond = ax.patches[0].get_xy()[:, 0]
    assert (diamond.min(), diamond.max()) == (pooled.low, pooled.high)
    assert ax.lines[-1].get_xdata().tolist() == [pooled.new_low, pooled.new_high]
    few = plots.plot_forest(
        pool({name: sites[name] for name in ("hall", "mall")}, quantity="center_x")
    )
    assert len(few.get_yticklabels()) == 3 and few.get_xscale() == "linear"


def test_an_interval_grid_has_a_panel_for_each_metric_and_one_legend():
    rows = [
        (w, c, m, 0.5, 0.4, 0.6)
        for w in ("a", "b")
        for c in ("x", "y")
        for m in ("s", "t", "u", "v")
    ]
    table = pd.DataFrame(
        rows, columns=["crowd", "who", "metric", "mean", "low", "high"]
    )
    labels = {"s": "share", "t": "time [s]", "u": "u", "v": "v"}
    grid = plots.draw_interval_grid(
        table, labels, rows="crowd", colour="who", title="A and b"
    )
    assert [ax.get_xlabel() for ax in grid.axes if ax.axison] == list(labels.values())
    assert [text.get_text() for text in grid.legends[0].get_texts()] == ["x", "y"]


def test_a_crowd_is_drawn_at_the_nearest_approach(log):
    ax = plots.plot_crowd(log)
    robot = ax.patches[-1]
    row = int(np.hypot(log.relative[:, 0, 0], log.relative[:, 0, 1]).argmin())
    assert robot.center == pytest.approx(tuple(log.states[row, :2]))
    assert in_metres(ax)


def test_safety_violations_are_shares_of_the_steps_claimed_safe():
    table = pd.DataFrame(
        0, index=["orca", "ETH"], columns=[*MOTION_CHANGES, "claimed_safe_steps"]
    )
    table["claimed_safe_steps"], table["turned"], table["appeared"] = (
        [1000, 500],
        [3, 0],
        [0, 1],
    )
    widths = [
        bar.get_width()
        for bars in plots.plot_safety_claims(table).containers
        for bar in bars
    ]
    assert sorted(widths)[-2:] == [2, 3]

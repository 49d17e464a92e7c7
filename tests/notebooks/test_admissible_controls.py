"""The admissible-control polygon, against `Step.verify`, which works every row out by formulas of its own."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
import shapely
from laboratory import find_admissible_controls, plot_admissible_controls

import szlib

ZONE = szlib.Ellipse((0.05, 0.0), (0.97, 0.75))
PASSAGE = szlib.SCENARIOS["making_room"].walls
MOMENTS = {
    "backing out": (
        [1.6, -0.1, -0.07, -0.06],
        szlib.Person((4.0, 0.0), (-0.5, 0.0)),
        PASSAGE,
    ),
    "waiting beside the mouth": (
        [-0.72, -1.5, 0.03, -0.19],
        szlib.Person((0.5, 0.0), (-0.5, 0.0)),
        PASSAGE,
    ),
    "at full speed": (
        [-2.55, -0.7, 0.5, -0.86],
        szlib.Person((0.0, 0.0), heading=np.pi),
        [],
    ),
}


def step_at(state, person, walls, **settings):
    controller = szlib.MPCCBF(
        ZONE,
        walls=walls,
        settings=szlib.MPCSettings(**{"time_limit": np.inf} | settings),
    )
    return controller.step(state, (6.0, 0.0), [person])


def with_first(step, a):
    """The same plan, but for its first acceleration."""
    inputs = step.inputs.copy()
    inputs[0] = a
    return replace(step, control=a, inputs=inputs)


@pytest.mark.parametrize("n_h", [2, 8])
@pytest.mark.parametrize("moment", MOMENTS)
def test_points_satisfy_every_row_exactly_if_they_lie_inside_the_polygon(moment, n_h):
    step = step_at(*MOMENTS[moment], N_h=n_h)
    polygon = find_admissible_controls(step).polygon
    edge, inside = polygon.boundary, 0
    for a in np.random.default_rng(n_h).uniform(-1, 1, (120, 2)):
        point = shapely.Point(a)
        if edge.distance(point) < 2e-3:
            continue
        inside += polygon.covers(point)
        assert polygon.covers(point) == with_first(step, a).verify().feasible
    assert 2 < inside < 118


def test_the_polygon_lies_within_the_bounds_of_the_acceleration():
    step = step_at(*MOMENTS["at full speed"])
    assert (
        shapely.box(-1, -1, 1, 1)
        .buffer(1e-9)
        .covers(find_admissible_controls(step).polygon)
    )


@pytest.mark.parametrize("moment", MOMENTS)
def test_the_control_of_a_feasible_step_is_allowed(moment):
    step = step_at(*MOMENTS[moment])
    assert step.feasible
    assert (
        find_admissible_controls(step).polygon.distance(shapely.Point(step.control))
        < 1e-3
    )


def test_a_robot_alone_at_rest_may_choose_every_acceleration():
    step = step_at([0.0, 0.0, 0.0, 0.0], szlib.Person((500.0, 0.0), heading=0.0), [])
    found = find_admissible_controls(step)
    assert found.limits == ()
    slow = szlib.MPCCBF(ZONE).step([0.0, 0.0, 0.0, 0.0], (0.0, 0.0))
    assert find_admissible_controls(slow).polygon.area == pytest.approx(4.0)


def test_each_limit_names_its_obstacle_and_has_the_allowed_side_on_its_left():
    found = find_admissible_controls(step_at(*MOMENTS["backing out"]))
    step = step_at(*MOMENTS["backing out"])
    names = {step.scene.name(each.row).partition(" (")[0] for each in found.limits}
    assert names == {"person 0", "wall 1"} and {each.k for each in found.limits} <= {
        0,
        1,
    }
    inner = np.array(found.polygon.representative_point().coords[0])
    for limit in found.limits:
        along, off = limit.curve[-1] - limit.curve[0], inner - limit.curve[0]
        assert along[0] * off[1] - along[1] * off[0] > 0


def test_the_control_of_an_infeasible_plan_lies_outside_the_polygon():
    step = step_at([0.0, 0.0, 1.0, 0.0], szlib.Person((1.6, 0.0), (-0.5, 0.0)), [])
    assert not step.feasible
    assert not find_admissible_controls(step).polygon.covers(
        shapely.Point(step.control)
    )


def test_a_decay_with_a_price_limits_the_polygon_as_a_hard_one():
    state, person, walls = MOMENTS["at full speed"]
    changes = {"N_h": 8, "gamma": 0.2}
    priced = step_at(state, person, walls, decay_price=100.0, **changes)
    polygon, inside = find_admissible_controls(priced).polygon, 0
    for a in np.random.default_rng(1).uniform(-1, 1, (80, 2)):
        if polygon.boundary.distance(shapely.Point(a)) > 2e-3:
            inside += polygon.covers(shapely.Point(a))
            obeys = with_first(priced, a).residual.min() >= 0
            fast = np.hypot(*with_first(priced, a).predicted[1:, 2:].T).max() > 1
            assert polygon.covers(shapely.Point(a)) == (obeys and not fast)
    assert inside > 2


def test_limits_are_rows_of_the_step_among_many_walls():
    """Obstacles that were left out of the problem are counted: `row` is a place in `Step.obstacles`."""
    far = [[(x, 30.0), (x + 0.5, 30.0)] for x in range(30)]
    walls = np.array([*far, [(-6.0, 1.0), (6.0, 1.0)]])
    step = step_at([0.0, 0.3, 0.0, 0.3], szlib.Person((40.0, 0.0)), walls)
    (row,) = {each.row for each in find_admissible_controls(step).limits}
    assert step.obstacles[row].numbers == (-6.0, 1.0, 6.0, 1.0)


def test_admissible_controls_name_the_person_and_the_walls_that_forbid_others():
    step = step_at(*MOMENTS["backing out"])
    ax = plot_admissible_controls(step)
    assert ax.get_xlabel().endswith("[m/s²]") and ax.get_aspect() == 1
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert {"allowed", "chosen"} <= set(labels)
    assert {name.split(",")[0] for name in labels} >= {"person 0", "wall 1"}
    styles = [
        line.get_linestyle() for line in ax.lines if "step" in str(line.get_label())
    ]
    assert len(set(styles)) == len(styles) == 2  # readable without colour
    plt.close(ax.figure)

"""The exact distance to a zone against shapely's, and steps checked again."""

import ast
import re
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import shapely
from helpers.random_states import questions
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq
from studies.distances import euclidean_to_ellipse, euclidean_to_segment

import szlib
from szlib.control import HalfPlane, Wall, verification
from szlib.control.controller import find_stopping_path
from szlib.control.obstacles import Obstacles

coordinate = st.floats(-3, 3, allow_subnormal=False)
points = st.tuples(coordinate, coordinate)
ellipses = st.builds(
    lambda center, a, share, angle: szlib.Ellipse(center, (a, share * a), angle),
    points, st.floats(0.1, 2), st.floats(0.05, 1), st.floats(-3, 3),
)  # fmt: skip


@given(points, ellipses)
def test_euclidean_distance_to_an_ellipse_equals_shapelys(point, ellipse):
    # The polygon of n corners lies inside the curve, by at most a (1 - cos(pi/n)).
    n = 20_000
    exact = shapely.LinearRing(ellipse.curve(n + 1)).distance(shapely.Point(point))
    found = euclidean_to_ellipse(point, ellipse)
    assert abs(found) == pytest.approx(
        exact, abs=2 * ellipse.semi_axes[0] * (1 - np.cos(np.pi / n)) + 1e-9
    )
    assert (found < 0) == (ellipse.level(point) < 1) or exact < 1e-9


@pytest.mark.parametrize("angle", [0.0, 1.0])
def test_euclidean_distance_is_exact_on_the_axes_of_an_ellipse(angle):
    ellipse = szlib.Ellipse((0.0, 0.0), (2.0, 1.0), angle)
    along, across = (
        np.array([np.cos(angle), np.sin(angle)]),
        np.array([-np.sin(angle), np.cos(angle)]),
    )
    at = np.array([0 * along, 3 * along, 3 * across, 1.9 * along, 0.5 * across])
    # Beyond the centre of curvature, a - b^2/a = 1.5 from the centre, the vertex is nearest.
    assert euclidean_to_ellipse(at, ellipse) == pytest.approx(
        [-1, 1, 2, -0.1, -0.5], abs=1e-9
    )


# --- steps computed again ----------------------------------------------------------------------------

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
GOAL = (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)
CLAIMS = "safe", "feasible", "walls_safe", "passively_safe"


def controller_of(walls=(), obstacles=(), **settings):
    chosen = szlib.MPCSettings(**{"time_limit": np.inf} | settings)
    return szlib.MPCCBF(ZONE, walls=walls, obstacles=obstacles, settings=chosen)


def test_the_report_imports_no_formula_of_the_controller():
    """The part that checks steps takes classes only, and asks unknown kinds for their formula."""
    source = Path(verification.__file__).read_text(encoding="utf-8")
    tree = ast.parse(source[source.index("# Two computations of one number") :])
    taken = {
        alias.name
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom) and node.level
        for alias in node.names
    }
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    own = {"Array", "BODY_RADIUS", "TOLERANCE", "Ellipse", "HalfPlane"}
    own |= {"PaperWall", "Wall", "Zone"}
    own |= {"MPCSettings", "Priority"}
    assert taken & names <= own, "types and constants, no formula"


@pytest.mark.parametrize(
    "formulation",
    [
        {},
        {"N_h": 8},
        {"terminal": "rest"},
        {"margin": "paper", "guard": False},
        {"grid": (1, 1, 2, 3), "decay_price": 100.0, "body_gap": 0.2, "gamma": 0.2},
    ],
    ids=str,
)
def test_every_claim_of_a_step_is_verified(formulation):
    s = szlib.MPCSettings(time_limit=np.inf, **formulation)
    for question in islice(questions(seed=41), 40):
        step = question.ask(s)
        found = step.verify()
        assert found.ok, (found, step)
        assert (found.feasible, found.safe) == (step.feasible, step.safe)
        assert found.slack == pytest.approx(step.slack, abs=1e-7)


@pytest.mark.parametrize("people", [False, True])
def test_every_claim_of_a_step_from_an_unsafe_state_is_verified(people):
    """In walls, in zones, on bodies, and far too fast."""
    rng, seen = np.random.default_rng(6), set()
    chosen = szlib.MPCSettings.among_people if people else szlib.MPCSettings
    s = chosen(time_limit=np.inf)
    for _ in range(60):
        walls = rng.uniform(-2, 2, (rng.integers(0, 4), 2, 2))
        rows = rng.uniform(-2, 2, (rng.integers(0, 5), 4))
        obstacles = [HalfPlane(rng.uniform(-2, 2, 2), rng.normal(size=2))]
        controller = szlib.MPCCBF(ZONE, walls=walls, obstacles=obstacles, settings=s)
        state = rng.uniform(-1.5, 1.5, 4)
        step = controller.step(state, rng.uniform(-5, 5, 2), rows)
        assert step.verify().ok and "WRONG" not in step.explain(), step.explain()
        seen.add((step.safe, step.walls_safe, step.passively_safe))
    assert len(seen) >= 3


def test_a_robot_at_the_edge_of_a_barrier_is_safe_for_the_report_as_well():
    controller = controller_of(walls=[[(-9.0, 0.0), (9.0, 0.0)]])
    edge = brentq(
        lambda y: controller.step((0, y, 0, 0), (0, 5)).h[0], 0.2, 2.0, xtol=1e-14
    )
    step = controller.step((0, edge, 0, 0), (0, 5))
    assert abs(step.h[0]) < 1e-9 and step.safe
    assert step.verify().ok and step.verify().safe


def test_people_of_every_kind_are_checked():
    own = szlib.Ellipse((0.0, 0.2), (0.8, 0.5), 0.7)
    people = [
        FACING,
        szlib.Person((2.0, 2.0)),
        szlib.Person((1.0, -2.0), (0.3, 0.1), zone=own),
    ]
    step = controller_of(terminal="rest", walls=[[(-6, 3), (6, 3)]]).step(
        (-4, 0, 0.3, 0), GOAL, people
    )
    assert step.verify().ok and step.verify().safe


def with_scene(step, **changes):
    return replace(step, scene=step.scene._replace(**changes))


def forged(step, name, value):
    """The same step, which says something else of itself."""
    lie = replace(step)
    lie.__dict__[name] = value
    object.__setattr__(lie, name, value)
    return lie


LIES = {
    "control": lambda step: replace(step, control=np.add(step.control, (1e-4, 0))),
    "h": lambda step: forged(step, "h", step.h + 1e-4),
    "plan": lambda step: forged(
        step, "predicted", step.predicted + 1e-4 * np.eye(9, 4, k=-3)
    ),
    "slack": lambda step: forged(step, "slack", step.slack + 1e-4),
    "start": lambda step: forged(
        with_scene(step, state=(-4.0, 0.1, 0.0, 0.0)), "predicted", step.predicted
    ),
    "walls": lambda step: forged(
        with_scene(
            step,
            fixed=Obstacles.of([Wall(-6, 1.9, 6, 1.9)], step.scene.settings),
        ),
        "h",
        step.h,
    ),
    "zones": lambda step: with_scene(
        step, person_zones=(szlib.Ellipse((0, 0), (1.2, 1.2)),)
    ),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_false_claim_of_a_step_is_reported_as_a_fault(lie):
    step = controller_of(walls=[[(-6, 2.0), (6, 2.0)]]).step(
        (-4, 0, 0.3, 0), GOAL, [FACING]
    )
    assert step.verify().ok
    found = LIES[lie](step).verify()
    assert not found.ok and found.faults
    assert "WRONG" in LIES[lie](step).explain()


def test_a_lie_is_found_far_from_the_origin_as_well():
    """At the coordinates of a national grid."""
    x, y = 5e5, 5.6e6
    controller = szlib.MPCCBF(ZONE, settings=szlib.MPCSettings(r_robot=0.3))
    person = [x + 1.3, y + 0.3, -0.8, 0.0]
    step = controller.step((x, y, 0.5, 0.0), (x + 6.0, y), [person])
    assert step.verify().ok
    for change in ({"control": step.control + 0.01}, {"inputs": step.inputs + 0.01}):
        assert not replace(step, **change).verify().ok


def test_a_plan_out_of_bounds_is_reported_as_a_fault():
    step = controller_of().step((-4, 0, 0.3, 0), GOAL, [FACING])
    faults = replace(step, inputs=np.add(step.inputs, (3.0, 0.0))).verify().faults
    assert any("beyond its bound" in fault for fault in faults)


# claims of the guard, forged

TOO_FAST = {
    # it holds the wall off after the control, and cannot stop before it
    "wall": ([[(-20.0, 0.0), (20.0, 0.0)]], (), (0.0, 0.65, 0.3, -0.9)),
    "half-plane": ((), [HalfPlane((0.0, 0.0), (0.0, 1.0))], (0.0, 0.65, 0.3, -0.9)),
    "end of a wall": ([[(0.0, -1.0), (0.0, 0.0)]], (), (-0.75, -0.1, 0.9, 0.0)),
}


@pytest.mark.parametrize("name", TOO_FAST)
def test_a_forged_claim_that_walls_are_safe_is_a_fault(name):
    walls, obstacles, state = TOO_FAST[name]
    step = controller_of(walls=walls, obstacles=obstacles).step(state, (0.0, 5.0))
    assert not step.walls_safe and not step.passively_safe
    assert step.verify().ok, step.verify().faults
    (fault,) = replace(step, walls_safe=True).verify().faults
    assert "it can stop before every wall; it cannot" in fault
    assert "WRONG" in replace(step, walls_safe=True).explain()


def test_a_forged_claim_of_passive_safety_is_a_fault():
    towards = szlib.Person((0.9, 0.0), (-1.2, 0.0))
    step = controller_of().step((-0.3, 0.0, 0.9, 0.0), GOAL, [towards])
    assert step.walls_safe and not step.passively_safe
    assert step.verify().ok, step.verify().faults
    (fault,) = replace(step, passively_safe=True).verify().faults
    assert "it rests before somebody walks into it; it does not" in fault


def test_a_claim_that_a_moving_robot_makes_of_an_overlapped_body_is_checked():
    """It overlaps a body, and moves towards it: that is not passively safe, and a claim of it is a fault."""
    standing = szlib.Person((0.5, 0.0))
    step = controller_of(guard=False).step((0.0, 0.0, 0.9, 0.0), GOAL, [standing])
    assert not step.passively_safe
    assert not replace(step, passively_safe=True).verify().ok


def test_claims_that_are_withheld_are_no_faults():
    step = controller_of().step((-4, 0, 0.3, 0), GOAL, [FACING])
    assert step.walls_safe and step.passively_safe
    for name in ("walls_safe", "passively_safe"):
        assert replace(step, **{name: False}).verify().ok


@pytest.mark.parametrize("seed", range(4))
def test_random_forged_claims_are_found_wherever_the_robot_would_touch(seed):
    """By many points of the way on which the robot brakes after its control, recomputed here."""
    rng, forged_walls = np.random.default_rng(seed), 0
    for _ in range(80):
        wall = rng.uniform(-2, 2, (1, 2, 2))
        state = np.r_[rng.uniform(-1.5, 1.5, 2), rng.uniform(-1, 1, 2)]
        step = controller_of(walls=wall).step(state, (5.0, 5.0))
        x, u, found = state, step.control, []
        for _ in range(40):
            for t in np.linspace(0, 0.1, 9):
                found.append(x[:2] + t * x[2:] + t**2 / 2 * u)
            x = np.r_[x[:2] + 0.1 * x[2:] + 0.005 * u, x[2:] + 0.1 * u]
            u = -x[2:] / max(0.1, np.abs(x[2:]).max())
        gap = euclidean_to_segment(found, *wall[0]).min() - 0.5
        if abs(gap) < 1e-3:
            continue
        claimed = replace(step, walls_safe=True).verify()
        assert claimed.ok == (gap > 0) and step.walls_safe <= (gap > 0)
        forged_walls += gap < 0
    assert forged_walls > 10


@pytest.mark.parametrize(
    ("state", "settings", "people", "worst", "words"),
    [
        (
            (-1.9, 0, 1, 0),
            {},
            [FACING],
            ("person", "person 0 at k = 1"),
            "person 0 at k = 1.*N_h above 2",
        ),
        (
            (-1.9, 0, 1, 0),
            {"N_h": 8},
            [FACING],
            ("person", "person 0"),
            "condition of person 0 .*N above 8",
        ),
        (
            (-9, 1.6, 0.3, 0.9),
            {},
            [FACING],
            ("wall", "wall 0"),
            "condition of wall 0 .*at k = 1",
        ),
        (
            (-4, 0, 1.4, 0),
            {},
            [FACING],
            ("speed", "k = 1"),
            "speed limit at k = 1.*v_max = 1 m/s",
        ),
        (
            (-9, 0, 1, 0),
            {"terminal": "rest"},
            [FACING],
            ("end", "rest at k = 8"),
            "rest at k = 8.*more than N = 8",
        ),
        ((-1.0, 0, 0, 0), {}, [FACING], ("person", "person 0"), "already too close"),
    ],
)
def test_explain_names_the_violated_row_and_what_helps(
    state, settings, people, worst, words
):
    step = controller_of(walls=[[(-12, 2.2), (6, 2.2)]], **settings).step(
        state, GOAL, people
    )
    assert not step.feasible
    kind, name = worst
    found = step.verify().worst
    assert found.kind == kind and name in found.name
    assert found.value == pytest.approx(-step.slack)
    assert "what helps: " in step.explain()
    assert re.search(words, step.explain(), re.DOTALL), step.explain()


def test_explain_describes_the_step_in_sentences():
    controller = controller_of()
    step = controller.step(
        (-4, 0, 0, 0), GOAL, [[0, 0, 0.1, 0], [np.nan] * 4], ids=["ann", "bob"]
    )
    said = step.explain()
    assert (
        "person 0 (id 'ann')" in said
        and "1 are unknown" in said
        and "not safe: the position" in said
    )
    ordinary = controller.step((-4, 0, 0, 0), GOAL).explain()
    assert (
        ordinary.startswith("Step: optimal, every row")
        and "time was up" not in ordinary
    )
    assert (
        "cannot be reached"
        in controller.step((-4, 0, 0, 0), (0.3, 0), [FACING]).explain()
    )


@pytest.mark.parametrize("dt", [0.001, 0.05, 0.2, 0.4])
def test_braking_is_checked_in_the_steps_in_which_the_robot_brakes(dt):
    """Two wheels follow a point from step to step, so that other steps are another way of the disc."""
    s = szlib.MPCSettings(dt=dt)
    rng = np.random.default_rng(0)
    for state in [np.zeros(4), *rng.uniform(-1, 1, (20, 4))]:
        control = rng.uniform(-1, 1, 2)
        path = find_stopping_path(state, control[None], s)
        way = verification._sample(state, control[None], np.array([dt]), s)
        n = verification.PIECES
        assert way.times[::n] == pytest.approx(path.times)
        assert way.points[::n] == pytest.approx(path.points)
        assert way.states[-1, 2:] == pytest.approx(0.0, abs=1e-12)


def test_a_step_that_contradicts_itself_is_a_fault():
    walls = [[(-20.0, 0.0), (20.0, 0.0)]]
    step = controller_of(walls=walls).step((0, 0.65, 0.3, -0.9), (0, 5))
    assert not step.walls_safe
    (fault,) = replace(step, passively_safe=True).verify().faults
    assert "rests" in fault
    relaxed = controller_of().step((0, 0, 0.9, 0), (5, 0), [[1.2, 0, -1, 0]])
    assert relaxed.slack > 0.01
    (fault,) = replace(relaxed, status="optimal").verify().faults
    assert "optimal" in fault


def test_a_half_plane_is_measured_again(monkeypatch):
    wrong = staticmethod(lambda x, y, t, px, py, nx, ny: (y - py) * ny + 2)
    monkeypatch.setattr(HalfPlane, "distance", wrong)
    settings = szlib.MPCSettings(eps=0.0501)  # what CasADi compiles is kept for these
    edge = HalfPlane((0.0, 0.0), (0.0, 1.0))
    controller = szlib.MPCCBF(ZONE, obstacles=[edge], settings=settings)
    step = controller.step((0, 0.2, 0, 0), (3, 0.2))
    assert step.walls_safe and not step.verify().ok

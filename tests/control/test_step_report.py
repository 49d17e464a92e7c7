"""A step checked again: right where it is right, and every lie found; a step in words."""

import ast
import re
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from helpers.random_states import ZONE, questions
from hostile.controller import cruel_states
from scipy.optimize import brentq

import szlib
from szlib.control import step_report as report

GOAL = (4.0, 0.0)
FACING = szlib.Person((0.0, 0.0), heading=np.pi)
SOLVERS = ("sqp", "ipopt")


def controller_of(solver="sqp", walls=(), **settings):
    return szlib.MPCCBF(
        ZONE, walls=walls, settings=szlib.MPCSettings(solver=solver, **settings)
    )


def test_the_report_imports_no_formula_of_the_controller():
    source = Path(report.__file__).read_text(encoding="utf-8")
    taken = {
        alias.name
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom) and node.level
        for alias in node.names
    }
    assert taken == {"Array", "BODY_RADIUS", "TOLERANCE", "Scene"}, (
        "types and constants, no formula"
    )


@pytest.mark.parametrize(
    "formulation", ({}, {"N_h": 8}, {"terminal": "rest"}, {"margin": "paper"}), ids=str
)
@pytest.mark.parametrize(("solver", "count"), [("sqp", 40), ("ipopt", 5)])
def test_every_claim_of_a_step_is_verified(solver, count, formulation):
    for question in islice(questions(seed=41), count):
        step = question.ask(szlib.MPCSettings(solver=solver, **formulation))
        found = step.verify()
        assert found.ok, (found, step)
        assert (found.feasible, found.safe) == (step.feasible, step.safe)
        assert found.slack == pytest.approx(step.slack, abs=1e-7)
        assert found.out_of_bounds <= 1e-9


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_claim_of_a_step_from_an_unsafe_state_is_verified(solver):
    s = szlib.MPCSettings(solver=solver, N_h=8, gamma=0.5)
    for state, goal, people, walls in islice(
        cruel_states(6), 25 if solver == "sqp" else 4
    ):
        step = szlib.MPCCBF(ZONE, walls=walls, settings=s, max_people=5).step(
            state, goal, people
        )
        assert step.verify().ok and "WRONG" not in step.explain()


def test_a_robot_at_the_edge_of_a_barrier_is_safe_for_the_report_as_well():
    controller = controller_of(walls=[[(-9.0, 0.0), (9.0, 0.0)]])
    edge = brentq(
        lambda y: controller.step((0, y, 0, 0), (0, 5)).h[0], 0.2, 2.0, xtol=1e-14
    )
    step = controller.step((0, edge, 0, 0), (0, 5))
    assert abs(step.h[0]) < 1e-9 and step.safe
    assert step.verify().ok and step.verify().safe


def test_the_largest_numbers_are_checked_as_well():
    large = 1e8
    controller = controller_of(walls=[[(large - 1, 3.0), (large, 3.0)]])
    step = controller.step(
        (-large / 2, 0, 0, large),
        (large / 3, 0),
        [szlib.Person((large, 0), (-large, 0))],
    )
    assert step.verify().ok


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
    walker = controller_of(terminal="person").step(
        (-4, 0, 0, 0), GOAL, [szlib.Person((1, 0.3), (-0.4, 0))]
    )
    assert walker.verify().ok and walker.verify().worst.kind in ("end", "person")


def moved(step, **fields):
    return replace(
        step, **{name: getattr(step, name) + off for name, off in fields.items()}
    )


LIES = {
    "control": lambda step: moved(step, control=np.array([1e-4, 0])),
    "plan": lambda step: moved(step, predicted=1e-4 * np.eye(9, 4, k=-3)),
    "h": lambda step: moved(step, h=1e-4),
    "residual": lambda step: moved(step, residual=1e-4),
    "slack": lambda step: moved(step, slack=1e-4),
    "start": lambda step: replace(
        step, scene=step.scene._replace(state=(-4.0, 0.1, 0.0, 0.0))
    ),
    "walls": lambda step: replace(
        step, scene=step.scene._replace(walls=[[-6, 2.0, 6, 2.0, 0.5]])
    ),
    "zones": lambda step: replace(
        step,
        scene=step.scene._replace(person_zones=[szlib.Ellipse((0, 0), (1.2, 1.2))]),
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


def test_a_plan_out_of_bounds_or_falsely_feasible_is_reported_as_a_fault():
    step = controller_of().step((-4, 0, 0.3, 0), GOAL, [FACING])
    plan = step.predicted.copy()
    plan[1:, :2] += 0.5 * 0.1**2 * 3.0
    plan[1:, 2:] += 0.1 * 3.0
    plan[2:, :2] += 0.1 * 3.0 * 0.1 * np.arange(1, 8)[:, None]
    faults = replace(step, predicted=plan).verify().faults
    assert any("beyond its bound" in fault for fault in faults)
    through = controller_of().step((-1.9, 0.0, 1.0, 0.0), GOAL, [FACING])
    assert not through.feasible and through.verify().ok
    faults = replace(through, slack=0.0).verify().faults
    assert any("says feasible True" in fault for fault in faults)


@pytest.mark.parametrize(
    ("state", "settings", "people", "worst", "words"),
    [
        (
            (-1.9, 0, 1, 0),
            {},
            [FACING],
            ("person", 0, 0),
            "person 0 from k = 0 to 1.*N_h above 2",
        ),
        (
            (-1.9, 0, 1, 0),
            {"N_h": 8},
            [FACING],
            ("person", 0),
            "barrier of person 0 .*N above 8",
        ),
        (
            (-9, 1.6, 0.3, 0.9),
            {},
            [FACING],
            ("wall", 0, 0),
            "barrier of wall 0 .*from k = 0 to 1",
        ),
        (
            (-4, 0, 1.4, 0),
            {},
            [FACING],
            ("speed", 0, 1),
            "speed limit at k = 1.*v_max = 1 m/s",
        ),
        (
            (-9, 0, 1, 0),
            {"terminal": "rest"},
            [FACING],
            ("end", 0, 8),
            "terminal velocity.*more than N = 8",
        ),
        ((-1.0, 0, 0, 0), {}, [FACING], ("person", 0), "already too close"),
    ],
)
def test_explain_names_the_violated_row_and_what_helps(
    state, settings, people, worst, words
):
    step = controller_of(walls=[[(-12, 2.2), (6, 2.2)]], **settings).step(
        state, GOAL, people
    )
    assert not step.feasible
    assert step.verify().worst[: len(worst)] == worst
    assert step.verify().worst.value == pytest.approx(-step.slack)
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
    assert ordinary.startswith("Step: optimal, from") and "time was up" not in ordinary
    assert (
        "cannot be reached"
        in controller.step((-4, 0, 0, 0), (0.3, 0), [FACING]).explain()
    )

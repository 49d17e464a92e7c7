"""Each claim about a scenario fails on a run that contradicts it."""

import numpy as np
import pytest
from helpers.made_runs import make_log

import szlib

SETTINGS = szlib.MPCSettings()
ACTIVE, INACTIVE = 0.0, 1.0


def make_run(name, xy, *, arrives=True, residual=INACTIVE):
    """A run of the paper's scenario of this `name` along given positions, one a time step."""
    positions, dt = np.array(xy, float), SETTINGS.dt
    n, scenario = len(positions), szlib.SCENARIOS[name]
    states = np.hstack([positions, np.gradient(positions, dt, axis=0)])
    persons = [person.after(k * dt) for k in range(n) for person in scenario.people]
    people = np.array([(*p.position, p.heading, *p.velocity) for p in persons])
    arrival = n - 1 if arrives else None
    around = people.reshape(n, -1, 5)
    return make_log(scenario, states, around, residual=residual, arrival=arrival)


def walk(*corners, speed=1.0):
    """Positions along straight lines between `corners`, at constant speed."""
    parts = []
    for a, b in zip(corners[:-1], corners[1:], strict=True):
        steps = max(round(np.hypot(*np.subtract(b, a)) / speed / SETTINGS.dt), 1)
        parts.append(np.linspace(a, b, steps, endpoint=False))
    return np.vstack([*parts, corners[-1:]])


def evade_at(distance, side=-0.2):
    """Straight at the person of the first scenario; 0.1 m beside the line at about this distance."""
    x = -distance
    return np.vstack(
        [walk((-4.0, 0.0), (x, 0.0)), [(x, side)], walk((x, side), (4.0, side))]
    )


def stand(at, seconds):
    return np.tile(at, (round(seconds / SETTINGS.dt), 1))


def wait_and_enter(at):
    """Into the restricted pathway, at this time [s] after the start, and through it."""
    return np.vstack([stand((-2.0, 0.0), at - 2.0), walk((-2.0, 0.0), (6.0, 0.0))])


FAILURES = {
    ("passing", "Avoidance starts farther away head-on than from behind."): lambda: [
        make_run("passing", evade_at(1.3))
    ],
    ("passing", "Avoidance starts well before the zone."): lambda: [
        make_run("passing", evade_at(1.6)),  # h = 0.35 m
        make_run("passing", walk((-4.0, 0.0), (4.0, 0.0))),
    ],
    ("corridor", "The robot slows down while passing."): lambda: [
        make_run("corridor", walk((-4.0, -1.5), (4.0, -1.5))),
        make_run(
            "corridor",
            stand((-4.0, -1.5), 2.0) + np.linspace(0, 1, 20)[:, None] ** 2 * (1, 0),
        ),
    ],
    ("waiting", "The robot waits."): lambda: [
        make_run("waiting", wait_and_enter(20.0)),  # nothing holds it back
        make_run(
            "waiting",
            np.vstack([stand((-2.0, 0.0), 1.5), wait_and_enter(2.0)]),
            residual=ACTIVE,
        ),
        make_run(
            "waiting",
            np.vstack([stand((-2.2, 0.0), 9.0), wait_and_enter(2.0)]),
            residual=ACTIVE,
        ),
    ],
    ("waiting", "The robot enters the pathway after the person has left it."): lambda: [
        make_run("waiting", wait_and_enter(7.5)),  # the person leaves at 8 s
        make_run("waiting", wait_and_enter(12.0), arrives=False),
        make_run("waiting", walk((-2.0, 0.0), (6.0, 0.0), speed=2.0)),
    ],
    ("waiting", "The robot goes on to its goal."): lambda: [
        make_run("waiting", wait_and_enter(12.0), arrives=False)
    ],
    ("making_room", "The robot is in the way and goes back to make room."): lambda: [
        make_run("making_room", walk((1.2, 0.0), (0.8, 0.0), (6.0, 0.0)))
    ],
    (
        "making_room",
        "The robot enters the pathway after the person has left it.",
    ): lambda: [
        make_run(
            "making_room",
            np.vstack([walk((1.2, 0.0), (-1.0, 0.0)), walk((-1.0, 0.0), (6.0, 0.0))]),
        )
    ],
    ("making_room", "The robot goes on to its goal."): lambda: [
        make_run("making_room", wait_and_enter(12.0), arrives=False)
    ],
}
"""Runs that contradict each claim of each scenario."""


@pytest.mark.parametrize("name", szlib.SCENARIOS)
def test_every_claim_fails_on_runs_that_contradict_it(name):
    for claim in szlib.SCENARIOS[name].claims:
        runs = FAILURES[name, claim.text]()
        assert runs
        for run in runs:
            holds, value = claim.check(run)
            assert not holds, f"{claim.text} got {value}"


def check(name, text, run):
    (claim,) = (claim for claim in szlib.SCENARIOS[name].claims if text in claim.text)
    return claim.check(run)


@pytest.mark.parametrize(
    ("distance", "holds"), [(1.70, False), (1.80, True), (2.5, True)]
)
def test_well_before_the_zone_is_half_a_metre(distance, holds):
    found, h = check("passing", "well before", make_run("passing", evade_at(distance)))
    assert found == holds
    halfway = (distance + np.hypot(distance, 0.2)) / 2  # h is interpolated
    assert h == pytest.approx(halfway - 0.7 - SETTINGS.r_robot - SETTINGS.eps)


@pytest.mark.parametrize(
    ("entry", "holds"), [(7.5, False), (8.0, False), (8.5, True), (12.0, True)]
)
def test_the_time_between_leaving_and_entering_decides(entry, holds):
    """The person leaves the pathway at 8 s; the robot is outside until one step before it enters."""
    found, between = check(
        "waiting", "enters", make_run("waiting", wait_and_enter(entry))
    )
    assert found == holds
    assert between == pytest.approx(entry - 0.1 - 8.0)


@pytest.mark.parametrize(("share", "holds"), [(0.85, False), (0.75, True)])
def test_slow_is_less_than_four_fifths_of_the_greatest_speed(share, holds):
    """The robot passes within 1 m of the person, who walks at 0.5 m/s towards it."""
    fast = walk((-4.0, -1.5), (0.0, -1.5))
    run = make_run(
        "corridor", np.vstack([fast[:-1], walk((0.0, -1.5), (4.0, -1.5), speed=share)])
    )
    assert check("corridor", "slows down", run) == (
        holds,
        pytest.approx(share, abs=0.01),
    )


def test_the_robot_waits_for_a_second_without_going_back():
    held = make_run(
        "waiting",
        np.vstack([stand((-2.0, 0.0), 3.0), wait_and_enter(2.0)]),
        residual=ACTIVE,
    )
    holds, waited = check("waiting", "waits", held)
    assert holds and 1.9 <= waited <= 2.1, "the first second is the start-up"
    back = np.vstack(
        [
            walk((-2.0, 0.0), (-2.2, 0.0)),
            stand((-2.2, 0.0), 3.0),
            walk((-2.2, 0.0), (6.0, 0.0)),
        ]
    )
    assert not check("waiting", "waits", make_run("waiting", back, residual=ACTIVE))[0]


@pytest.mark.parametrize(("back", "holds"), [(0.45, False), (0.55, True)])
def test_room_is_made_by_going_back_half_a_metre(back, holds):
    run = make_run("making_room", walk((1.2, 0.0), (1.2 - back, 0.0), (6.0, 0.0)))
    assert check("making_room", "make room", run) == (holds, pytest.approx(back))

"""Sheet 6, the robot: its speed limit, gamma by experiment, the plan of the terminal proof, predictions."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ...control.mpc import MPCCBF
from ...control.settings import MPCSettings
from ...simulation.closed_loop import simulate
from ...simulation.metrics import find_avoidance_start
from ...simulation.scenarios.paper import SCENARIOS
from ...zones.ellipses import Ellipse
from .task import Case, Rng, Task, formula

GAMMAS = (0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.15, 0.2)
"""What is tried by experiment."""


def _approach(rng: Rng) -> tuple[Any, ...]:
    return round(rng.uniform(1, 3), 2), round(rng.uniform(0.06, 0.2), 3), 0.2, round(rng.uniform(0.1, 0.4), 2)


def _limit(h: float, gamma: float, dt: float, pace: float) -> float:
    return gamma * h / dt - pace


def _some_zone(rng: Rng) -> Ellipse:
    b = round(rng.uniform(0.65, 0.75), 2)
    return Ellipse((round(rng.uniform(0.05, 0.12), 2), 0.0), (round(b + rng.uniform(0.2, 0.3), 2), b))


@lru_cache(maxsize=64)
def _run(name: str, zone: Ellipse, settings: MPCSettings, turned: bool = False) -> dict[str, float]:
    """A scenario of the paper in numbers: infeasible steps, least h [m], where avoidance starts [m]."""
    scenario = SCENARIOS[name].turn_people() if turned else SCENARIOS[name]
    log = simulate(scenario, MPCCBF(zone, walls=scenario.walls, settings=settings, max_people=1))
    found = log.metrics()
    return {name: found[name] for name in ("infeasible_steps", "min_h")} | {
        "start": find_avoidance_start(log)[0]
    }


def _weak_brake(rng: Rng) -> tuple[Any, ...]:
    return _some_zone(rng), round(rng.uniform(0.4, 0.7), 2), GAMMAS


def _largest(zone: Ellipse, a_max: float, gammas: tuple[float, ...]) -> float:
    """The last gamma before the first one with an infeasible step."""
    kept = 0.0
    for gamma in gammas:
        if _run("passing", zone, MPCSettings(gamma=gamma, a_max=a_max))["infeasible_steps"]:
            break
        kept = gamma
    return kept


def _next_larger(zone: Ellipse, a_max: float, gammas: tuple[float, ...]) -> float:
    return gammas[min(gammas.index(_largest(zone, a_max, gammas)) + 1, len(gammas) - 1)]


def _plan(rng: Rng) -> tuple[Any, ...]:
    plan = rng.uniform(-1, 1, (8, 2)).round(2)
    return (np.vstack([plan[:-1], plan[-1:] + 0.1]),)


def _shifted(plan: Any) -> Any:
    return np.vstack([plan[1:], np.zeros((1, 2))])


QUESTIONS = {
    "passing, gamma from 0.05 to 0.1: the least h is": ("smaller", "larger"),
    "waiting at gamma 0.2, N_h from 2 to 8: the infeasible steps are": ("fewer", "more"),
    "passing, from the front to from behind: avoidance starts": ("nearer", "farther away"),
}
"""What is asked before the runs, and what may be answered: that the number falls, that it rises."""


def _runs(rng: Rng) -> Case:
    """What the runs with a fresh zone say, and their numbers."""
    zone, calm, bold = _some_zone(rng), MPCSettings(), MPCSettings(gamma=0.2)
    first, sooner = _run("passing", zone, calm), _run("passing", zone, MPCSettings(gamma=0.1))
    short, long = (_run("waiting", zone, s) for s in (bold, MPCSettings(gamma=0.2, N_h=8)))
    behind = _run("passing", zone, calm, turned=True)
    pairs = [("min_h", first, sooner), ("infeasible_steps", short, long), ("start", first, behind)]
    truth = {}
    for (question, (falls, rises)), (name, one, other) in zip(QUESTIONS.items(), pairs, strict=True):
        said = falls if other[name] < one[name] else rises if other[name] > one[name] else "the same"
        truth[question] = (said, f"{one[name]:.3g}, then {other[name]:.3g}")
    return (), truth


def _compared(_: tuple[Any, ...], truth: dict[str, tuple[str, str]], got: Any) -> str:
    if not isinstance(got, dict) or set(got) != set(truth):
        return f"expected a dict with an answer to each of {list(truth)}; got {got!r}"
    for question, (said, numbers) in truth.items():
        if got[question] not in (*QUESTIONS[question], "the same"):
            return f"{question!r}: expected one of {QUESTIONS[question]}; got {got[question]!r}"
        if got[question] != said:
            return f"you predicted: {question} {got[question]!r}; the runs say {said!r} ({numbers})"
    return ""


def _prediction(**wrong: str) -> dict[str, str]:
    """Every answer as it comes out, but for those at the numbers named (q0, q1, q2)."""
    return {q: wrong.get(f"q{i}", answers[0]) for i, (q, answers) in enumerate(QUESTIONS.items())}


TASKS = (
    Task(
        "speed_limit",
        5,
        (
            "In a step h may fall by gamma h at most. How fast may the two come nearer to each other?",
            "By gamma h / dt. Part of that the person uses up, by walking towards the robot.",
            "gamma * h / dt - person_speed; where it is negative, the robot has to go back.",
        ),
        formula(_approach, _limit),
        {
            "dt is forgotten: gamma h is a length, used up in one step": lambda h, g, dt, v: g * h - v,
            "the person walks towards the robot and uses up part of it": lambda h, g, dt, v: g * h / dt,
            "the person's speed has the wrong sign: they come towards the robot": lambda h, g, dt, v: (
                g * h / dt + v
            ),
            "dt multiplies here where it has to divide": lambda h, g, dt, v: g * h * dt - v,
        },
        unit="m/s",
    ),
    Task(
        "largest_gamma",
        40,
        (
            "Run szlib.SCENARIOS['passing'] with each gamma and this zone, and look at log.metrics().",
            "szlib.MPCCBF(zone, settings=szlib.MPCSettings(gamma=gamma, a_max=a_max)); what is counted in "
            "metrics()['infeasible_steps']?",
            "Go through the gammas from the smallest; stop at the first with an infeasible step and return "
            "the one before.",
        ),
        formula(_weak_brake, _largest),
        {
            "one too far: with this gamma there are infeasible steps already": _next_larger,
            "this is the smallest gamma; larger ones had no infeasible step": lambda z, a, gammas: gammas[0],
            "this is the largest gamma of all, whatever the runs say": lambda z, a, gammas: gammas[-1],
            "this is for a robot that brakes with 1 m/s2: hand a_max over": lambda z, a, gammas: _largest(
                z, 1.0, gammas
            ),
        },
        cases=1,
    ),
    Task(
        "next_plan",
        15,
        (
            "The first control has been applied. What is left of the plan, and what is missing at its end?",
            "The plan ended at rest (v_N = 0). Which control keeps a robot at rest where it is?",
            "np.vstack([plan[1:], [[0, 0]]]); the new row is then gamma h(x_N) >= 0.",
        ),
        formula(_plan, _shifted),
        {
            "the last control is repeated: a robot at rest would start to move": lambda p: np.vstack(
                [p[1:], p[-1:]]
            ),
            "this is the old plan; its first control has been applied already": lambda p: p,
            "the plan is shifted the wrong way: its first control is applied already": lambda p: np.vstack(
                [np.zeros((1, 2)), p[:-1]]
            ),
            "a plan has as many controls as before: what comes last?": lambda p: p[1:],
        },
        unit="m/s2",
    ),
    Task(
        "prediction",
        20,
        (
            "What does gamma allow, what does a longer horizon see, on which side is a zone longer?",
            "A larger gamma lets h fall faster; more barrier steps tell the robot earlier; the zone reaches "
            "farther ahead of a person than behind.",
            "Now run: szlib.simulate(scenario, controller).metrics(), and scenario.turn_people() too.",
        ),
        _runs,
        {
            "'larger'; the runs say 'smaller'": lambda: _prediction(q0="larger"),
            "'more'; the runs say 'fewer'": lambda: _prediction(q1="more"),
            "'farther away'; the runs say 'nearer'": lambda: _prediction(q2="farther away"),
            "expected a dict with an answer": lambda: "smaller",
        },
        judge=_compared,
        cases=1,
    ),
)

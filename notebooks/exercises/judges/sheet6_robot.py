"""Sheet 6: the robot's speed limit, gamma by experiment, the plan of the terminal proof, predictions."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from szlib.control.mpc import MPCCBF
from szlib.control.settings import MPCSettings
from szlib.simulation.closed_loop import simulate
from szlib.simulation.metrics import find_avoidance_start
from szlib.simulation.scenarios.paper import SCENARIOS
from szlib.zones.ellipses import Ellipse

from .task import Case, Rng, formula, make_task

_GAMMAS = (0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.15, 0.2)  # that the experiment tries


def _draw_approach(rng: Rng) -> tuple[Any, ...]:
    return round(rng.uniform(1, 3), 2), round(rng.uniform(0.06, 0.2), 3), 0.2, round(rng.uniform(0.1, 0.4), 2)


def _draw_zone(rng: Rng) -> Ellipse:
    b = round(rng.uniform(0.65, 0.75), 2)
    return Ellipse((round(rng.uniform(0.05, 0.12), 2), 0.0), (round(b + rng.uniform(0.2, 0.3), 2), b))


@lru_cache(maxsize=64)
def _run(name: str, zone: Ellipse, settings: MPCSettings, turned: bool = False) -> dict[str, float]:
    """Metrics of a scenario of the paper, with the distance where avoidance starts, `start` [m]."""
    scenario = SCENARIOS[name].turn_people() if turned else SCENARIOS[name]
    log = simulate(scenario, MPCCBF(zone, walls=scenario.walls, settings=settings, max_people=1))
    return log.metrics() | {"start": find_avoidance_start(log)[0]}


def _draw_weak_robot(rng: Rng) -> tuple[Any, ...]:
    return _draw_zone(rng), round(rng.uniform(0.4, 0.7), 2), _GAMMAS


def _largest(zone: Ellipse, a_max: float, gammas: tuple[float, ...]) -> float:
    """The last gamma before the first one with an infeasible step."""
    best = 0.0
    for gamma in gammas:
        if _run("passing", zone, MPCSettings(gamma=gamma, a_max=a_max))["infeasible_steps"]:
            break
        best = gamma
    return best


def _next_larger(zone: Ellipse, a_max: float, gammas: tuple[float, ...]) -> float:
    return gammas[min(gammas.index(_largest(zone, a_max, gammas)) + 1, len(gammas) - 1)]


def _draw_plan(rng: Rng) -> tuple[Any, ...]:
    plan = rng.uniform(-1, 1, (8, 2)).round(2)
    return (np.vstack([plan[:-1], plan[-1:] + 0.1]),)


# Question -> the answers for a smaller and for a larger number.
QUESTIONS = {
    "passing, gamma from 0.05 to 0.1: the least h is": ("smaller", "larger"),
    "waiting at gamma 0.2, N_h from 2 to 8: the infeasible steps are": ("fewer", "more"),
    "passing, from the front to from behind: avoidance starts": ("nearer", "farther away"),
}


def _draw_runs(rng: Rng) -> Case:
    """The correct answers, from runs with a random zone, and their numbers."""
    zone, calm, bold = _draw_zone(rng), MPCSettings(), MPCSettings(gamma=0.2)
    first, sooner = _run("passing", zone, calm), _run("passing", zone, MPCSettings(gamma=0.1))
    short, long = (_run("waiting", zone, s) for s in (bold, MPCSettings(gamma=0.2, N_h=8)))
    behind = _run("passing", zone, calm, turned=True)
    pairs = [("min_h", first, sooner), ("infeasible_steps", short, long), ("start", first, behind)]
    truth = {}
    for (question, (falls, rises)), (name, one, other) in zip(QUESTIONS.items(), pairs, strict=True):
        answer = falls if other[name] < one[name] else rises if other[name] > one[name] else "the same"
        truth[question] = (answer, f"{one[name]:.3g}, then {other[name]:.3g}")
    return (), truth


def _judge_prediction(_: tuple[Any, ...], truth: dict[str, tuple[str, str]], got: Any) -> str:
    """Accept a dict with the correct answer to each question."""
    if not isinstance(got, dict) or set(got) != set(truth):
        return f"expected a dict with an answer to each of {list(truth)}; got {got!r}"
    for question, (answer, numbers) in truth.items():
        if got[question] not in (*QUESTIONS[question], "the same"):
            return f"{question!r}: expected one of {QUESTIONS[question]}; got {got[question]!r}"
        if got[question] != answer:
            return f"you predicted: {question} {got[question]!r}; the runs give {answer!r} ({numbers})"
    return ""


TASKS = (
    make_task(
        "speed_limit",
        formula(_draw_approach, lambda h, gamma, dt, person_speed: gamma * h / dt - person_speed),
        no_dt=lambda h, gamma, dt, person_speed: gamma * h - person_speed,
        no_person=lambda h, gamma, dt, person_speed: gamma * h / dt,
        sign=lambda h, gamma, dt, person_speed: gamma * h / dt + person_speed,
        multiplied=lambda h, gamma, dt, person_speed: gamma * h * dt - person_speed,
    ),
    make_task(
        "largest_gamma",
        formula(_draw_weak_robot, _largest),
        next=_next_larger,
        smallest=lambda zone, a_max, gammas: gammas[0],
        largest=lambda zone, a_max, gammas: gammas[-1],
        default_brake=lambda zone, a_max, gammas: _largest(zone, 1.0, gammas),
    ),
    make_task(
        "next_plan",
        formula(_draw_plan, lambda plan: np.vstack([plan[1:], np.zeros((1, 2))])),
        repeated=lambda plan: np.vstack([plan[1:], plan[-1:]]),
        unchanged=lambda plan: plan,
        wrong_way=lambda plan: np.vstack([np.zeros((1, 2)), plan[:-1]]),
        shorter=lambda plan: plan[1:],
    ),
    make_task("prediction", _draw_runs, judge=_judge_prediction),
)

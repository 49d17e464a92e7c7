"""Tasks: the robot's speed limit, gamma by experiment, the terminal proof, predictions, distinct ways."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from szlib.control.mpc import MPCCBF
from szlib.control.settings import MPCSettings
from szlib.core.checks import Array
from szlib.simulation.catalogue import SCENARIOS
from szlib.simulation.closed_loop import simulate
from szlib.simulation.metrics import find_avoidance_start
from szlib.zones.ellipses import Ellipse

from .task import Args, Rng, make_task, repeat

_GAMMAS = (0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.15, 0.2, 0.3)  # that the experiment tries
_BRAKES = ((0.3, 0.42), (0.68, 0.85))  # a_max of a weak and of a stronger robot [m/s2]
_ANSWERS = ("smaller", "larger")


def _draw_approach(rng: Rng) -> Args:
    h, gamma, person_speed = rng.uniform(0.5, 3), rng.uniform(0.03, 0.2), rng.uniform(0.1, 1.6)
    return round(h, 2), round(gamma, 3), float(rng.choice([0.05, 0.1, 0.2])), round(person_speed, 2)


def _limit(h: float, gamma: float, dt: float, person_speed: float) -> float:
    return gamma * h / dt - person_speed


def _draw_zone(rng: Rng, b: float = 0.7) -> Ellipse:
    b = round(b + rng.uniform(-0.05, 0.05), 2)
    return Ellipse((round(rng.uniform(0.05, 0.12), 2), 0.0), (round(b + rng.uniform(0.2, 0.3), 2), b))


@lru_cache(maxsize=256)
def _run(name: str, zone: Ellipse, settings: MPCSettings, turned: bool = False) -> dict[str, float]:
    """Metrics of a scenario of the paper, with the distance where avoidance starts, `start` [m]."""
    scenario = SCENARIOS[name].turn_people() if turned else SCENARIOS[name]
    log = simulate(scenario, MPCCBF(zone, walls=scenario.walls, settings=settings))
    return log.metrics() | {"start": find_avoidance_start(log)[0]}


def _draw_robots(rng: Rng) -> Iterator[Args]:
    """A robot with a weak brake and one with a stronger brake, in either order: no constant fits both."""
    for low, high in rng.permutation(_BRAKES):
        zone = _draw_zone(rng)
        while _largest(zone, 1.0, _GAMMAS) == _GAMMAS[-1]:  # the default brake would give the largest of all
            zone = _draw_zone(rng)
        yield zone, round(rng.uniform(low, high), 2), _GAMMAS


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


def _by_formula(zone: Ellipse, a_max: float, gammas: tuple[float, ...]) -> float:
    return max((gamma for gamma in gammas if gamma <= 0.1 * a_max), default=gammas[0])


def _draw_plan(rng: Rng) -> Args:
    plan = rng.uniform(-1, 1, (int(rng.integers(5, 11)), 2)).round(2)
    return (np.vstack([plan[:-1], plan[-1:] + 0.1]),)


def _draw_changes(rng: Rng) -> Iterator[Args]:
    """Twelve changes: six kinds, each there and back, with what two runs with a random zone give."""
    zone, wide = _draw_zone(rng), _draw_zone(rng, 0.85)
    low, high = round(rng.uniform(0.03, 0.05), 3), round(rng.uniform(0.08, 0.11), 3)
    n_h, brake = int(rng.integers(6, 9)), round(rng.uniform(0.4, 0.55), 2)

    def runs(name: str, *settings: MPCSettings) -> list[dict[str, float]]:
        return [_run(name, zone, each) for each in settings]

    gamma = runs("passing", MPCSettings(gamma=low), MPCSettings(gamma=high))
    horizon = runs("waiting", MPCSettings(gamma=0.2), MPCSettings(gamma=0.2, N_h=n_h))
    brakes = runs("passing", MPCSettings(gamma=0.15, a_max=brake), MPCSettings(gamma=0.15, a_max=1.2))
    front = _run("passing", zone, MPCSettings())
    behind, beside = _run("passing", zone, MPCSettings(), turned=True), _run("passing", wide, MPCSettings())
    kinds = [
        ("passing", "gamma", low, high, "min_h", gamma),
        ("passing", "gamma", low, high, "start", gamma),
        ("waiting", "N_h", 2, n_h, "infeasible_steps", horizon),
        ("passing", "a_max", brake, 1.2, "infeasible_steps", brakes),
        ("passing", "approach", "front", "behind", "start", [front, behind]),
        ("passing", "width", zone.semi_axes[1], wide.semi_axes[1], "path_length", [front, beside]),
    ]
    changes = []
    for scenario, change, before, after, quantity, (one, other) in kinds:
        rises = other[quantity] > one[quantity]
        changes += [((scenario, change, before, after, quantity), _ANSWERS[rises])]
        changes += [((scenario, change, after, before, quantity), _ANSWERS[not rises])]
    yield ([changes[i] for i in rng.permutation(len(changes))],)


def _judge_predictions(ask: Callable[..., Any], args: Args) -> str:
    """Accept correct predictions of all changes; do not say which one is wrong, since that is its answer."""
    given: dict[Args, str] = {}
    for change, _ in args[0]:
        given[change] = got = ask(*change)
        if not isinstance(got, str) or got not in _ANSWERS:
            return f"expected one of {_ANSWERS} for {change}; got {got!r}"
    for (scenario, change, before, after, quantity), got in given.items():
        if got == given[scenario, change, after, before, quantity]:
            return f"{change}, {quantity}: the same answer for {before} to {after} as for the change back"
    if all(given[change] != truth for change, truth in args[0]):
        return "each change is predicted the wrong way around: does `before` come first?"
    if any(given[change] != truth for change, truth in args[0]):
        return "at least one kind of change goes the other way; make the runs and look for the reason"
    return ""


def _draw_ways(rng: Rng) -> Args:
    """Twelve ways of a robot from (0, 0) to (8, 0) in 10 s among three people, one of whom walks at least."""
    shares = np.linspace(0.0, 1.0, 101)[:, None]
    at, velocity = rng.uniform((2.5, -2.0), (5.5, 2.0), (3, 2)), rng.uniform(0.2, 0.4, (3, 2))
    velocity *= rng.choice([-1.0, 1.0], (3, 2)) * (
        0.5,
        1.0,
    )  # far from the start at first, from the goal at last
    velocity[1:] *= rng.integers(0, 2, (2, 1))
    people = (at - 5.0 * velocity)[:, None] + 10.0 * shares * velocity[:, None]
    paths: list[Array] = []
    while len(paths) < 12:
        corners = [(0.0, 0.0), *((x, rng.uniform(-4, 4)) for x in (2.0, 4.0, 6.0)), (8.0, 0.0)]
        x, y = np.transpose(corners)
        times = np.linspace(0, 1, len(corners)) + np.array([0.0, *rng.uniform(-0.1, 0.1, 3), 0.0])
        path = np.column_stack([np.interp(shares[:, 0], times, each) for each in (x, y)])
        if np.hypot(*np.moveaxis(path - people, -1, 0)).min() > 0.5:
            paths.append(path)
    return np.array(paths).round(3), people.round(3)


def _find_turns(paths: Array, people: Array) -> Array:
    """Angles by which people turn who look at the robot, shape (ways, people) [rad]."""
    offset = paths[:, None] - people
    angles = np.unwrap(np.arctan2(offset[..., 1], offset[..., 0]), axis=-1)
    return np.asarray(angles[..., -1] - angles[..., 0])


def _count(paths: Array, people: Array) -> int:
    return _count_rows(_find_turns(paths, people))


def _count_rows(turns: Array) -> int:
    """Number of rows of angles that differ by a full turn."""
    return len(np.unique(np.round((turns - turns[0]) / (2 * np.pi)), axis=0))


def _count_sums(paths: Array, people: Array) -> int:
    """The number that comes out if the turns around all people are added up."""
    return _count_rows(_find_turns(paths, people).sum(axis=1, keepdims=True))


def _draw_scenes(rng: Rng) -> Iterator[Args]:
    """Twenty scenes, and one in which distinct ways have the same sum of turns."""
    for _ in range(20):
        yield _draw_ways(rng)
    while _count_sums(*(last := _draw_ways(rng))) == _count(*last):
        pass
    yield last


TASKS = (
    make_task(globals(), "speed_limit", repeat(_draw_approach), solution=_limit),
    make_task(globals(), "largest_gamma", _draw_robots, solution=_largest, allowed=("szlib",), seconds=300.0),
    make_task(
        globals(),
        "next_plan",
        repeat(_draw_plan),
        solution=lambda plan: np.vstack([plan[1:], np.zeros((1, 2))]),
    ),
    make_task(globals(), "prediction", _draw_changes, drive=_judge_predictions),
    make_task(globals(), "count_ways", _draw_scenes, solution=_count),
)

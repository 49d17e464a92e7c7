"""Sheet 1: velocity from positions, the line of sight, the attentional space, sampling at 1 Hz."""

from __future__ import annotations

from typing import Any

import numpy as np

from szlib.encounters.geometry import AttentionalSpace, wrap_angle

from .task import Rng, formula, make_task

_TICK = 0.1  # of the common clock [s]
_SPANS = (2, 3, 4, 6, 7, 8)  # not 5: over one second nobody would notice a missing division


def _draw_path(rng: Rng) -> tuple[Any, ...]:
    half = int(rng.choice(_SPANS))
    steps = rng.uniform(0.05, 0.15, (31, 2)) * rng.choice([-1, 1], 2)
    return np.cumsum(steps, axis=0).round(3), int(rng.integers(half, 31 - half)), half


def _draw_two_people(rng: Rng) -> tuple[Any, ...]:
    """A person who walks nearly backwards, and another one beyond the jump of the angle at 180 degrees."""
    ref, side = rng.uniform(-5, 5, 2).round(2), float(rng.choice([-1, 1]))
    bearing, distance = -side * rng.uniform(1.3, 3.1), rng.uniform(1, 4)
    other = ref + distance * np.array([np.cos(bearing), np.sin(bearing)])
    return ref, round(side * rng.uniform(2, 3), 2), other.round(2)


def _bearing(ref: Any, heading: float, other: Any) -> Any:
    dx, dy = other - ref
    return np.arctan2(dy, dx) - heading


def _line_of_sight(ref: Any, heading: float, other: Any) -> Any:
    return wrap_angle(_bearing(ref, heading, other))


def _draw_people_around(rng: Rng) -> tuple[Any, ...]:
    ref, heading = rng.uniform(-5, 5, 2).round(2), rng.uniform(0.5, 2.5) * rng.choice([-1, 1])
    return ref, round(float(heading), 2), ref + rng.uniform(-6, 6, (60, 2)).round(2)


def _in_space(ref: Any, heading: float, others: Any, space: AttentionalSpace | None = None) -> Any:
    (dx, dy), cos, sin = (others - ref).T, np.cos(heading), np.sin(heading)
    return (space or AttentionalSpace()).contains(dx * cos + dy * sin, dy * cos - dx * sin)


def _draw_turn(rng: Rng) -> tuple[Any, ...]:
    radius, speed = round(rng.uniform(0.6, 1.5), 2), round(rng.uniform(0.6, 1.4), 2)
    return radius, speed, round(rng.uniform(0.5, 0.9) * radius / speed * 2, 2)


def _chord_error(radius: float, speed: float, interval: float) -> Any:
    return radius * (1 - np.cos(speed * interval / radius / 2))


TASKS = (
    make_task(
        "velocity",
        formula(_draw_path, lambda path, k, half: (path[k + half] - path[k - half]) / (2 * half * _TICK)),
        displacement=lambda path, k, half: path[k + half] - path[k - half],
        ticks=lambda path, k, half: (path[k + half] - path[k - half]) / (2 * half),
        half_time=lambda path, k, half: (path[k + half] - path[k - half]) / (half * _TICK),
        one_tick=lambda path, k, half: (path[k + 1] - path[k]) / _TICK,
    ),
    make_task(
        "line_of_sight",
        formula(_draw_two_people, _line_of_sight),
        degrees=lambda ref, heading, other: np.degrees(_line_of_sight(ref, heading, other)),
        world=lambda ref, heading, other: _line_of_sight(ref, 0.0, other),
        swapped=lambda ref, heading, other: _line_of_sight(other, heading, ref),
        not_wrapped=_bearing,
        arctan_order=lambda ref, heading, other: wrap_angle(np.arctan2(*(other - ref)) - heading),
    ),
    make_task(
        "in_space",
        formula(_draw_people_around, _in_space),
        not_turned=lambda ref, heading, others: _in_space(ref, 0.0, others),
        turned_back=lambda ref, heading, others: _in_space(ref, -heading, others),
        twice_as_wide=lambda ref, heading, others: _in_space(ref, heading, others, AttentionalSpace(5, 8)),
        swapped=lambda ref, heading, others: _in_space(ref, heading, others, AttentionalSpace(4, 5)),
        centred=lambda ref, heading, others: _in_space(ref, heading, others, AttentionalSpace(centred=True)),
    ),
    make_task(
        "one_hertz",
        formula(_draw_turn, _chord_error),
        whole_angle=lambda radius, speed, interval: radius * (1 - np.cos(speed * interval / radius)),
        small_angle=lambda radius, speed, interval: (speed * interval) ** 2 / (8 * radius),
        one_second=lambda radius, speed, interval: _chord_error(radius, speed, 1.0),
        from_centre=lambda radius, speed, interval: radius * np.cos(speed * interval / radius / 2),
    ),
)

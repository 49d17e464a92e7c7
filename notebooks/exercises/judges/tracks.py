"""Tasks: velocity from positions, the line of sight, the attentional space, sampling at 1 Hz."""

from __future__ import annotations

from typing import Any

import numpy as np

from szlib.encounters.geometry import AttentionalSpace, wrap_angle

from .task import Args, Rng, make_task, repeat

_TICK = 0.1  # of the common clock [s]
_OFF = 0.003  # [m]: nobody is exactly beside another person, or at the edge of a space
_SPANS = (2, 3, 4, 6, 7, 8)  # not 5: over one second nobody would notice a missing division


def _draw_path(rng: Rng) -> Args:
    half = int(rng.choice(_SPANS))
    steps = rng.uniform(0.05, 0.15, (31, 2)) * rng.choice([-1, 1], 2)
    return np.cumsum(steps, axis=0).round(3), int(rng.integers(half, 31 - half)), half


def _velocity(path: Any, k: int, half: int) -> Any:
    return (path[k + half] - path[k - half]) / (2 * half * _TICK)


def _draw_two_people(rng: Rng) -> Args:
    """Two people in any direction and with any heading."""
    ref, (bearing, heading) = rng.uniform(-5, 5, 2).round(2), rng.uniform(-3.1, 3.1, 2)
    other = ref + rng.uniform(1, 4) * np.array([np.cos(bearing), np.sin(bearing)])
    return ref, round(heading, 2), other.round(2) + _OFF


def _bearing(ref: Any, heading: float, other: Any) -> Any:
    dx, dy = other - ref
    return np.arctan2(dy, dx) - heading


def _line_of_sight(ref: Any, heading: float, other: Any) -> Any:
    return wrap_angle(_bearing(ref, heading, other))


def _half_plane(ref: Any, heading: float, other: Any) -> Any:
    dx, dy = other - ref
    return wrap_angle(np.arctan(dy / dx) - heading)


def _draw_people_around(rng: Rng) -> Args:
    ref, heading = rng.uniform(-5, 5, 2).round(2), rng.uniform(0.5, 2.5) * rng.choice([-1, 1])
    return ref, round(float(heading), 2), (ref + rng.uniform(-6, 6, (40, 2))).round(2) + _OFF


def _in_space(ref: Any, heading: float, others: Any, space: AttentionalSpace | None = None) -> Any:
    (dx, dy), cos, sin = (others - ref).T, np.cos(heading), np.sin(heading)
    return (space or AttentionalSpace()).contains(dx * cos + dy * sin, dy * cos - dx * sin)


def _ahead(ref: Any, heading: float, others: Any) -> Any:
    return (others - ref) @ [np.cos(heading), np.sin(heading)]


def _draw_turn(rng: Rng) -> Args:
    radius, speed = round(rng.uniform(0.6, 1.5), 2), round(rng.uniform(0.6, 1.4), 2)
    return radius, speed, round(rng.uniform(0.5, 0.9) * radius / speed * 2, 2)


def _chord_error(radius: float, speed: float, interval: float) -> Any:
    return radius * (1 - np.cos(speed * interval / radius / 2))


def _chord(radius: float, speed: float, interval: float) -> Any:
    return 2 * radius * np.sin(speed * interval / radius / 2)


TASKS = (
    make_task(globals(), "velocity", repeat(_draw_path), solution=_velocity),
    make_task(globals(), "line_of_sight", repeat(_draw_two_people), solution=_line_of_sight),
    make_task(globals(), "in_space", repeat(_draw_people_around), solution=_in_space),
    make_task(globals(), "one_hertz", repeat(_draw_turn), solution=_chord_error),
)

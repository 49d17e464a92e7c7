"""Sheet 1, tracks and meetings: velocity from positions, the line of sight, the attentional space, 1 Hz."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...encounters.geometry import AttentionalSpace, wrap_angle
from .task import Rng, Task, formula

_TICK = 0.1  # of the common clock [s]
_SPANS = (2, 3, 4, 6, 7, 8)  # not 5: over one second a forgotten division goes unseen


def _path(rng: Rng) -> tuple[Any, ...]:
    half = int(rng.choice(_SPANS))
    steps = rng.uniform(0.05, 0.15, (31, 2)) * rng.choice([-1, 1], 2)
    return np.cumsum(steps, axis=0).round(3), int(rng.integers(half, 31 - half)), half


def _velocity(path: Any, k: int, half: int) -> Any:
    return (path[k + half] - path[k - half]) / (2 * half * _TICK)


def _two_people(rng: Rng) -> tuple[Any, ...]:
    """One heading nearly backwards, on the other side of the jump at +-180 degrees from the other person."""
    ref, side = rng.uniform(-5, 5, 2).round(2), float(rng.choice([-1, 1]))
    bearing, distance = -side * rng.uniform(1.3, 3.1), rng.uniform(1, 4)
    other = ref + distance * np.array([np.cos(bearing), np.sin(bearing)])
    return ref, round(side * rng.uniform(2, 3), 2), other.round(2)


def _bearing(ref: Any, heading: float, other: Any) -> Any:
    dx, dy = other - ref
    return np.arctan2(dy, dx) - heading


def _line_of_sight(ref: Any, heading: float, other: Any) -> Any:
    return wrap_angle(_bearing(ref, heading, other))


def _many_around(rng: Rng) -> tuple[Any, ...]:
    ref, heading = rng.uniform(-5, 5, 2).round(2), rng.uniform(0.5, 2.5) * rng.choice([-1, 1])
    return ref, round(float(heading), 2), ref + rng.uniform(-6, 6, (60, 2)).round(2)


def _in_frame(ref: Any, heading: float, others: Any) -> tuple[Any, Any]:
    (dx, dy), cos, sin = (others - ref).T, np.cos(heading), np.sin(heading)
    return dx * cos + dy * sin, dy * cos - dx * sin


def _sees(ref: Any, heading: float, others: Any, space: AttentionalSpace | None = None) -> Any:
    return (space or AttentionalSpace()).contains(*_in_frame(ref, heading, others))


def _turn(rng: Rng) -> tuple[Any, ...]:
    radius, speed = round(rng.uniform(0.6, 1.5), 2), round(rng.uniform(0.6, 1.4), 2)
    return radius, speed, round(rng.uniform(0.5, 0.9) * radius / speed * 2, 2)


def _cut(radius: float, speed: float, interval: float) -> Any:
    return radius * (1 - np.cos(speed * interval / radius / 2))


TASKS = (
    Task(
        "velocity",
        5,
        (
            "Velocity is a displacement divided by the time that it took.",
            "From tick k - half to tick k + half: how many ticks is that, and how much time?",
            "(path[k + half] - path[k - half]) / (2 * half * 0.1)",
        ),
        formula(_path, _velocity),
        {
            "this is a displacement [m]: divide it by the time that it took": lambda p, k, h: (
                p[k + h] - p[k - h]
            ),
            "dt is forgotten: you divide by a number of ticks, and a tick is 0.1 s": lambda p, k, h: (
                (p[k + h] - p[k - h]) / (2 * h)
            ),
            "twice too fast: from k - half to k + half there are 2 * half ticks": lambda p, k, h: (
                (p[k + h] - p[k - h]) / (h * _TICK)
            ),
            "this is the velocity of one single tick; take the whole span": lambda p, k, h: (
                (p[k + 1] - p[k]) / _TICK
            ),
        },
        unit="m/s",
    ),
    Task(
        "line_of_sight",
        10,
        (
            "Draw both people, and where the reference pedestrian walks. Which angle is asked?",
            "np.arctan2(dy, dx) is the bearing in the world. How far is the person turned there already?",
            "Subtract the heading, then bring the angle back to (-pi, pi]: np.angle(np.exp(1j * angle)).",
        ),
        formula(_two_people, _line_of_sight),
        {
            "these are degrees, not radians": lambda r, a, o: np.degrees(_line_of_sight(r, a, o)),
            "this is the bearing in the world: the heading of the reference pedestrian is forgotten": (
                lambda r, a, o: _line_of_sight(r, 0.0, o)
            ),
            "the two are swapped: this is where the reference pedestrian is, seen from the other": (
                lambda r, a, o: _line_of_sight(o, a, r)
            ),
            "the angle is not wrapped: it must lie in (-pi, pi]": _bearing,
            "np.arctan2 takes y first, then x": lambda r, a, o: wrap_angle(
                np.arctan2(*(np.asarray(o) - r)) - a
            ),
        },
        unit="rad",
    ),
    Task(
        "in_space",
        15,
        (
            "The space turns with the person: first ask where the others are in the person's own frame.",
            "ahead = dx cos(heading) + dy sin(heading), left = dy cos(heading) - dx sin(heading)",
            "Inside: 0 <= ahead <= 5 and |left| <= 4 / 2.",
        ),
        formula(_many_around, _sees),
        {
            "the space does not turn with the person: use their own frame, not the world's": (
                lambda r, a, o: _sees(r, 0.0, o)
            ),
            "the frame is turned the wrong way: into the person's frame means by minus their heading": (
                lambda r, a, o: _sees(r, -a, o)
            ),
            "4 m is the whole width: 2 m to either side": lambda r, a, o: _sees(
                r, a, o, AttentionalSpace(5.0, 8.0)
            ),
            "length and width are swapped: 5 m ahead, 4 m wide": lambda r, a, o: _sees(
                r, a, o, AttentionalSpace(4.0, 5.0)
            ),
            "the space lies ahead of the person, not around them": lambda r, a, o: _sees(
                r, a, o, AttentionalSpace(centred=True)
            ),
        },
    ),
    Task(
        "one_hertz",
        20,
        (
            "Between two samples the track is a chord of the circle. Where are chord and arc farthest apart?",
            "In the middle. The person turns by the angle speed * interval / radius from sample to sample.",
            "The middle of the chord is radius * cos(angle / 2) from the centre of the circle.",
        ),
        formula(_turn, _cut),
        {
            "half the angle: the middle of the arc is half a turn away from either sample": lambda r, v, t: (
                r * (1 - np.cos(v * t / r))
            ),
            "near, but this is the formula for small angles; here the turn is not small": lambda r, v, t: (
                (v * t) ** 2 / (8 * r)
            ),
            "the interval is forgotten: this is for one sample a second": lambda r, v, t: _cut(r, v, 1.0),
            "this is how far the middle of the chord is from the centre, not from the arc": lambda r, v, t: (
                r * np.cos(v * t / r / 2)
            ),
        },
        unit="m",
    ),
)

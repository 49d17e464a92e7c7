"""A synthetic square full of people whose true social zone is known.

It exists so that the way from tracks to zone can be proved: `make_plaza` writes a day in the raw ATC
format, and what `szlib.SocialZone.fit` makes of it must be `PlazaSettings.true_zone`.

Pairs of people cross the square one after another.  The *walker* goes straight on at constant speed;
the *other* passes on a path that touches, or nearly touches, the walker's zone, at a bearing and a
speed of the walker spread over all there are.  In the walker's frame it is a straight line, or it
bends towards the walker until the two are closest: no straight path from ahead touches the back.
Each of the two keeps out of the other's zone at every moment, but for a few *intruders* who walk
right through.  Who stands has no direction of motion, and so no zone.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
from numpy.typing import NDArray

from ..checks import Array
from ..encounters.geometry import wrap_angle
from ..errors import ZoneError
from ..files import write_file
from .settings import (
    MARGIN,
    SLOWEST,
    SPACE,
    PlazaSettings,
    direction,
    first_moment,
    in_unit_disc,
    swept_length,
    to_left,
    turned,
    zones_at,
)

KINDS = ("overtaking", "head-on", "crossing", "together", "standing", "intruder")
"""Kinds of encounter; the first three by the angle between the directions of motion when closest."""
FIRST_ID, ID_STEP = 9_190_600, 100
"""Of people's ids, as on the first day of ATC; the two of a pair follow each other."""

_VECTORS = ("walker_", "other_", "walker_v", "other_v", "swerve_")  # of staged encounters, each with x and y
_TRACKED = 3.4  # a pair is tracked for the window of 3 s, wherever the ticks of the clock fall [s]
_PAUSE = 1.0  # between a pair's end and the start of the next [s]
_BEFORE = (0.5, 2.5)  # from a pair's start until the two are closest [s]
_TOGETHER = 0.25  # who walk together drift apart slower than that [m/s]
_BEND = 1.2  # sharpest curvature of a path in the walker's frame [1/m]
_MOMENTS = np.linspace(0, _TRACKED, 52)  # at which a path is checked [s]
_ROUNDS, _SHIFT, _PATIENCE = 5000, 0.001, 200  # draws; each keeps 1 mm more clear; new bearing after so many
_FRAMES = (33, 50)  # from one frame to the next [ms]
_SHORT_GAP, _LONG_GAP = (0.1, 0.4), (0.6, 1.0)  # a track ends after 0.5 s of silence [s]
_HEIGHT = (1.5, 1.8)  # of people [m]
_VELOCITY_NOISE, _FACING_NOISE = 0.45, 0.3  # of the sensor's own velocity [m/s] and facing angle [rad]


def make_plaza(path: str | Path, *, seed: int = 0, settings: PlazaSettings | None = None) -> Path:
    """Write a day on the plaza in the raw ATC format (method, sec. 1), and return its path.

    The same seed and settings give the same bytes; the file is replaced as a whole or not at all.

    Raises
    ------
    StorageError : the file cannot be written.
    ZoneError : people cannot respect the zones of `settings` (see `stage_encounters`).
    """
    path, settings = Path(path), settings or PlazaSettings()
    rows = _sensed(stage_encounters(seed=seed, settings=settings), seed, settings)
    write_file(path, rows.write_csv(include_header=False, float_precision=3))
    return path


def stage_encounters(*, seed: int = 0, settings: PlazaSettings | None = None) -> pd.DataFrame:
    """Who meets whom, exactly as they walk: one row an encounter, for `positions`.

    Columns: kind (one of `KINDS`); start, when both are first seen, and closest [s since 1970]; and
    for the latter moment walker_x, walker_y, other_x, other_y [m], walker_vx, walker_vy, other_vx,
    other_vy [m/s], swerve_x, swerve_y [m/s2]: the other's acceleration until then.

    Raises ZoneError where no path keeps out of both zones, because they are too large.
    """
    rng, settings = np.random.default_rng(seed), settings or PlazaSettings()
    plan, speed, before, motion = _approaches(rng, settings)
    n = len(plan)
    heading = rng.uniform(-np.pi, np.pi, n)
    ahead, swept = direction(heading), swept_length(speed)
    half = (np.abs(ahead) * swept[:, None] + np.abs(to_left(ahead)) * SPACE.width) / 2
    low, high = np.transpose([settings.square.x, settings.square.y])
    middle = rng.uniform(low + half + MARGIN, high - half - MARGIN)
    walker = middle + (speed * before - swept / 2)[:, None] * ahead
    start = first_moment(settings) + np.arange(n) * (_TRACKED + _PAUSE)
    offset, other_v, swerve = np.moveaxis(turned(motion, heading[:, None]), 1, 0)
    apart = np.abs(np.arctan2(motion[:, 1, 1], motion[:, 1, 0]))
    kind = np.where(
        plan == "passing", np.select([apart < np.pi / 4, apart > 3 * np.pi / 4], KINDS[:2], KINDS[2]), plan
    )
    vectors = [walker, walker + offset, speed[:, None] * ahead, other_v, swerve]
    columns = {
        name + axis: v[:, k] for name, v in zip(_VECTORS, vectors, strict=True) for k, axis in enumerate("xy")
    }
    return pd.DataFrame({"kind": kind, "start": start, "closest": start + before, **columns})


def positions(staged: pd.DataFrame, t: Array) -> tuple[Array, Array]:
    """Where the two of each staged encounter are at times t (n,) [s since 1970], and how they move.

    Returns positions [m] and velocities [m/s], both of shape (n, 2, 2): walker and other, x and y.
    """
    since = (np.asarray(t, float) - staged["closest"].to_numpy())[:, None]
    until = np.minimum(since, 0.0)
    walker, other, walker_v, other_v, swerve = (
        staged[[name + "x", name + "y"]].to_numpy() for name in _VECTORS
    )
    where = [walker + walker_v * since, other + other_v * since + swerve * until**2 / 2]
    return np.stack(where, axis=1), np.stack([walker_v, other_v + swerve * until], axis=1)


def _approaches(
    rng: np.random.Generator, settings: PlazaSettings
) -> tuple[NDArray[np.str_], Array, Array, Array]:
    """Plans, walkers' speeds [m/s], times from start to closest [s], and the others' motion when closest.

    The motion (n, 3, 2) is offset [m], velocity [m/s] and swerve [m/s2] along the walker's axes.
    Paths are drawn until they keep out of both zones; those that do not are drawn anew, farther out.
    """
    n = settings.encounters
    ends = np.rint(n * np.cumsum([settings.standing, settings.together, settings.intruders]))
    plan = np.array(["standing", "together", "intruder", "passing"])[
        np.searchsorted(ends, rng.permutation(n), side="right")
    ]
    speed, bearing = _spread(rng, n, *settings.speeds), _spread(rng, n, -np.pi, np.pi)
    clear = rng.exponential(settings.clearance, n)
    before, motion = np.zeros(n), np.zeros((n, 3, 2))
    todo = np.arange(n)
    for turn in range(_ROUNDS):
        anew = todo if turn % _PATIENCE == _PATIENCE - 1 else todo[plan[todo] != "passing"]
        bearing[anew] = rng.uniform(-np.pi, np.pi, len(anew))
        clear[anew] = rng.exponential(settings.clearance, len(anew))
        before[todo] = rng.uniform(*_BEFORE, len(todo))
        motion[todo] = _draw(
            rng, settings, plan[todo], speed[todo], bearing[todo], clear[todo], bend=turn % 2 * _BEND
        )
        todo = todo[~_possible(settings, plan[todo], speed[todo], before[todo], motion[todo])]
        if not len(todo):
            return plan, speed, before, motion
        clear[todo] += _SHIFT
    raise ZoneError(
        f"{len(todo)} of {n} pairs find no way around each other's zones; expected zones that leave room in "
        f"the attentional space of {SPACE.length} m by {SPACE.width} m; make `slow` and `fast` smaller"
    )


def _draw(
    rng: np.random.Generator,
    settings: PlazaSettings,
    plan: NDArray[np.str_],
    speed: Array,
    bearing: Array,
    clear: Array,
    *,
    bend: float,
) -> Array:
    """One motion (n, 3, 2), as in `_approaches`, that touches each zone but for what is kept clear.

    `bearing` is the touching point's parameter on the ellipse; intruders pass the person at that bearing.
    """
    n, standing, intruder = len(plan), plan == "standing", plan == "intruder"
    center, semi_axes, angle = zones_at(settings, speed)
    a, b = semi_axes.T
    beside = np.arctan2(b * np.cos(angle), a * np.sin(angle)) + np.pi * rng.integers(2, size=n)
    unit = direction(np.where(standing, beside, bearing))
    edge = turned(to_left(unit) * semi_axes, angle)
    point = center + turned(unit * semi_axes, angle)
    tangent = np.where(intruder[:, None], to_left(unit), edge / np.linalg.norm(edge, axis=-1, keepdims=True))
    normal = -to_left(tangent)
    intrusion = rng.uniform(*settings.intrusion, n)
    offset = np.where(intruder[:, None], intrusion[:, None] * unit, point + clear[:, None] * normal)
    slowest = np.where(intruder, settings.pace[0], _TOGETHER)
    quickest = np.where(intruder, min(settings.pace[1], 2 * settings.fastest), 2 * settings.fastest)
    pace = rng.uniform(slowest, quickest)
    pace = np.where(plan == "together", rng.uniform(0, _TOGETHER, n), np.where(standing, speed, pace))
    side = np.where(standing, -np.sign(tangent[:, 0]), rng.choice([-1.0, 1.0], n))
    passing = (side * pace)[:, None] * tangent
    curvature = np.where(plan == "passing", rng.uniform(0, bend, n), 0.0)
    swerve = -(curvature * pace**2)[:, None] * normal
    return np.stack([offset, passing + speed[:, None] * [1.0, 0.0], swerve], axis=1)


def _possible(
    settings: PlazaSettings, plan: NDArray[np.str_], speed: Array, before: Array, motion: Array
) -> NDArray[np.bool_]:
    """Which motions start ahead of the walker, at speeds that people walk, and keep out of both zones."""
    since = (_MOMENTS - before[:, None])[..., None]
    until = np.minimum(since, 0.0)
    offset, velocity, swerve = (motion[:, None, k] for k in range(3))
    passing = velocity - speed[:, None, None] * [1.0, 0.0]
    where, moves = offset + passing * since + swerve * until**2 / 2, velocity + swerve * until
    x, y = where[:, 0].T
    seen = (x >= MARGIN) & (x <= SPACE.length - MARGIN) & (np.abs(y) <= SPACE.width / 2 - MARGIN)
    pace, standing, minds = np.linalg.norm(moves, axis=-1), plan == "standing", plan != "intruder"
    natural = ((pace <= settings.fastest) & ((pace >= SLOWEST) | standing[:, None])).all(axis=1)
    possible = seen & (np.hypot(x, y) >= 1 + MARGIN) & natural
    some = np.flatnonzero(possible & minds)  # most are out already: to ask for zones takes longest
    possible[some] = _keeps_out(settings, where[some], np.broadcast_to(speed[some, None], pace[some].shape))
    some = np.flatnonzero(possible & minds & ~standing)
    course = np.arctan2(moves[some, :, 1], moves[some, :, 0])
    possible[some] = _keeps_out(settings, turned(-where[some], -course), pace[some])
    return np.asarray(possible)


def _keeps_out(settings: PlazaSettings, points: Array, speed: Array) -> NDArray[np.bool_]:
    """Which paths (n, moments, 2) [m] keep out of zones at speeds (n, moments) all the time; (n,)."""
    return np.asarray((np.linalg.norm(in_unit_disc(settings, points, speed), axis=-1) >= 1).all(axis=1))


def _sensed(staged: pd.DataFrame, seed: int, settings: PlazaSettings) -> pl.DataFrame:
    """What the sensor writes: the eight columns of an ATC file, two rows a frame, without the gaps."""
    rng = np.random.default_rng([seed, 1])
    n, start = len(staged), staged["start"].to_numpy()
    ms = rng.integers(
        _FRAMES[0], _FRAMES[1], int((start[-1] - start[0] + _TRACKED) * 1000 / _FRAMES[0]) + 1, endpoint=True
    )
    frames = start[0] + np.cumsum(ms) / 1000
    pair = np.searchsorted(start, frames, side="right") - 1
    pair, frames = (array[frames <= start[pair] + _TRACKED] for array in (pair, frames))
    where, moves = positions(staged.iloc[pair], frames)
    seen = where + rng.normal(0, settings.noise, where.shape)
    felt = moves + rng.normal(0, _VELOCITY_NOISE, moves.shape)
    facing = np.arctan2(moves[..., 1], moves[..., 0]) + rng.normal(0, _FACING_NOISE, moves.shape[:2])
    height = rng.uniform(*_HEIGHT, (n, 2))[pair] + rng.normal(0, settings.noise, moves.shape[:2])
    kind = rng.choice(3, (n, 2), p=[settings.gaps, settings.losses, 1 - settings.gaps - settings.losses])
    length = np.stack([rng.uniform(*_SHORT_GAP, (n, 2)), rng.uniform(*_LONG_GAP, (n, 2)), np.zeros((n, 2))])
    length = np.take_along_axis(length, kind[None], axis=0)[0]
    lost = start[:, None] + rng.uniform(0, _TRACKED - length)
    there = ~((frames[:, None] > lost[pair]) & (frames[:, None] < (lost + length)[pair]))
    mm = {
        name: np.rint(1000 * value).astype(np.int32)
        for name, value in {
            "x": seen[..., 0],
            "y": seen[..., 1],
            "z": height,
            "velocity": np.linalg.norm(felt, axis=-1),
        }.items()
    }
    columns = {
        "time": np.broadcast_to(frames[:, None], there.shape),
        "id": FIRST_ID + ID_STEP * (2 * pair[:, None] + np.arange(2)),
        **mm,
        "motion_angle": np.arctan2(felt[..., 1], felt[..., 0]),
        "facing_angle": wrap_angle(facing),
    }
    return pl.DataFrame({name: column[there] for name, column in columns.items()})


def _spread(rng: np.random.Generator, n: int, low: float, high: float) -> Array:
    """n numbers in random order, one in each nth part from low to high."""
    return low + (high - low) * rng.permutation(np.arange(n) + rng.uniform(size=n)) / n

"""How people walk on the synthetic plaza, and what a sensor records of them.

The plaza tests the way from tracks to zones: `make_plaza` writes a day in the raw ATC format, and
`szlib.SocialZone.fit` must find `PlazaSettings.true_zone` in it.

Pairs of people cross the square one after another. The *walker* goes straight on at constant speed. The
*other* passes on a path that touches, or nearly touches, the walker's zone. The bearings and the walkers'
speeds cover their whole range. In the walker's frame the path is a straight line, or it bends towards the
walker until the two are closest: no straight path from ahead touches the back. Each of the two stays outside
the other's zone at every moment, except for a few *intruders* who walk through it. A standing person has no
direction of motion, and so no zone.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
from numpy.typing import NDArray

from ..core.checks import Array
from ..core.errors import ZoneError
from ..core.files import write_file
from ..encounters.geometry import wrap_angle
from ..zones.ellipses import unit_vectors
from .settings import (
    MARGIN,
    MIN_WALKING_SPEED,
    SPACE,
    WINDOW,
    PlazaSettings,
    swept_length,
)

KINDS = ("overtaking", "head-on", "crossing", "together", "standing", "intruder")
"""Kinds of encounter; the first three by the angle between the directions of motion when closest."""
# First id, and step between ids, as on the first day of ATC. The ids of a pair are successive.
FIRST_ID = 9_190_600
ID_STEP = 100

# of staged encounters, each with x and y
_VECTORS = ("walker_", "other_", "walker_v", "other_v", "swerve_")
_COLUMNS = [name + axis for name in _VECTORS for axis in "xy"]
_PAUSE = 1.0  # between a pair's end and the start of the next [s]
# from the start of the window until the two are closest [s]
_TIME_TO_CLOSEST = (0.5, 2.5)
_DRIFT = 0.25  # greatest relative speed of people who walk together [m/s]
_MAX_CURVATURE = 1.2  # of a path in the walker's frame [1/m]
_CHECKS = 15  # of a path in a second
_MAX_ROUNDS = 5000  # of draws
# each draw is 1 mm farther out; a new bearing after so many draws
_SHIFT = 0.001
_NEW_BEARING = 200
# After so many draws the mean clearance grows as well: companions with small zones walk too near otherwise.
_GROWS_AFTER = 1000
_FRAMES = (33, 50)  # time between frames, (shortest, longest) [ms]
_GAPS = ((0.1, 0.4), (0.6, 1.0))  # short and long: one of 0.5 s ends a track [s]
_HEIGHT = (1.5, 1.8)  # of people [m]
# of the sensor's own velocity [m/s] and facing angle [rad]
_VELOCITY_NOISE = 0.45
_FACING_NOISE = 0.3


def make_plaza(
    path: str | Path, *, seed: int = 0, settings: PlazaSettings | None = None
) -> Path:
    """Write a day on the plaza in the raw ATC format.

    Parameters
    ----------
    path : of the file; it is replaced as a whole or not at all.
    seed : the same seed and settings give the same bytes.
    settings : of the plaza; None: the defaults.

    Returns
    -------
    The path.

    Raises
    ------
    StorageError : the file cannot be written.
    ZoneError : people cannot stay outside the zones of `settings` (see `stage_encounters`).

    Examples
    --------
    >>> import szlib
    >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=20))
    >>> szlib.read_tracks(path)["id"].nunique() >= 40
    True
    """
    path = Path(path)
    settings = settings or PlazaSettings()
    rows = _record(stage_encounters(seed=seed, settings=settings), seed, settings)
    write_file(path, rows.write_csv(include_header=False, float_precision=3))
    return path


def stage_encounters(
    *, seed: int = 0, settings: PlazaSettings | None = None
) -> pd.DataFrame:
    """Draw the encounters and the exact paths of both people: one row for each encounter.

    Parameters
    ----------
    seed : of the random numbers.
    settings : of the plaza; None: the defaults.

    Returns
    -------
    kind (one of `KINDS`); start, when both are first seen, and closest [s since 1970]; for the latter moment
    walker_x, walker_y, other_x, other_y [m], walker_vx, walker_vy, other_vx, other_vy [m/s]; and
    swerve_x, swerve_y, the other's acceleration until then [m/s2].

    Raises
    ------
    ZoneError : no path stays outside both zones, because they are too large.

    Examples
    --------
    >>> import szlib
    >>> from szlib.plaza import stage_encounters
    >>> len(stage_encounters(seed=1, settings=szlib.PlazaSettings(n_encounters=20)))
    20
    """
    rng = np.random.default_rng(seed)
    settings = settings or PlazaSettings()
    plan, speed, before, motion = _draw_encounters(rng, settings)
    n = len(plan)
    heading = rng.uniform(-np.pi, np.pi, n)
    ahead = unit_vectors(heading)
    swept = swept_length(speed)
    half = (
        np.abs(ahead) * swept[:, None] + np.abs(_rotate_left(ahead)) * SPACE.width
    ) / 2
    low, high = np.transpose([settings.area.x, settings.area.y])
    middle = rng.uniform(low + half + MARGIN, high - half - MARGIN)
    walker = middle + (speed * before - swept / 2)[:, None] * ahead
    start = settings.compute_start_time() + np.arange(n) * (settings.tracked + _PAUSE)
    offset, other_v, swerve = np.moveaxis(_rotate(motion, heading[:, None]), 1, 0)
    apart = np.abs(np.arctan2(motion[:, 1, 1], motion[:, 1, 0]))
    kind = np.where(
        plan == "passing",
        np.select([apart < np.pi / 4, apart > 3 * np.pi / 4], KINDS[:2], KINDS[2]),
        plan,
    )
    closest = start + settings.lead_time + before
    columns = {"kind": kind, "start": start, "closest": closest}
    vectors = [walker, walker + offset, speed[:, None] * ahead, other_v, swerve]
    columns |= zip(_COLUMNS, np.hstack(vectors).T, strict=True)
    return pd.DataFrame(columns)


def positions(staged: pd.DataFrame, t: Array) -> tuple[Array, Array]:
    """Compute the positions and velocities of both people of each staged encounter.

    Parameters
    ----------
    staged : n encounters, as from `stage_encounters`.
    t : one time for each encounter, shape (n,) [s since 1970].

    Returns
    -------
    Positions [m] and velocities [m/s], both of shape (n, 2, 2): walker and other, x and y.

    Examples
    --------
    >>> import szlib
    >>> from szlib.plaza import positions, stage_encounters
    >>> staged = stage_encounters(settings=szlib.PlazaSettings(n_encounters=20))
    >>> positions(staged, staged["closest"])[0].shape
    (20, 2, 2)
    """
    since = (np.asarray(t, float) - staged["closest"].to_numpy())[:, None]
    swerved, deviation = _swerve(since)
    vectors = np.split(staged[_COLUMNS].to_numpy(), len(_VECTORS), axis=1)
    walker, other, walker_v, other_v, swerve = vectors
    position = [walker + walker_v * since, other + other_v * since + swerve * deviation]
    return np.stack(position, axis=1), np.stack(
        [walker_v, other_v + swerve * swerved], axis=1
    )


def _draw_encounters(
    rng: np.random.Generator, settings: PlazaSettings
) -> tuple[NDArray[np.str_], Array, Array, Array]:
    """Plans, walkers' speeds [m/s], times from start to closest [s], and the others' motion when closest.

    The motion (n, 3, 2) is offset [m], velocity [m/s] and swerve [m/s2] along the walker's axes. Paths that
    enter a zone are drawn again, farther out.
    """
    n = settings.n_encounters
    ends = np.rint(
        n * np.cumsum([settings.standing, settings.together, settings.intruders])
    )
    plan = np.array(["standing", "together", "intruder", "passing"])[
        np.searchsorted(ends, rng.permutation(n), side="right")
    ]
    speed = _stratify(rng, n, *settings.speeds)
    bearing = _stratify(rng, n, -np.pi, np.pi)
    clear = rng.exponential(settings.clearance, n)
    before = np.zeros(n)
    motion = np.zeros((n, 3, 2))
    pending = np.arange(n)
    for number in range(_MAX_ROUNDS):
        is_last = number % _NEW_BEARING == _NEW_BEARING - 1
        redrawn = pending if is_last else pending[plan[pending] != "passing"]
        bearing[redrawn] = rng.uniform(-np.pi, np.pi, len(redrawn))
        mean = settings.clearance + _SHIFT * max(0, number - _GROWS_AFTER)
        clear[redrawn] = rng.exponential(mean, len(redrawn))
        before[pending] = rng.uniform(*_TIME_TO_CLOSEST, len(pending))
        motion[pending] = _draw(
            rng,
            settings,
            plan[pending],
            speed[pending],
            bearing[pending],
            clear[pending],
            bend=number % 2 * _MAX_CURVATURE,
        )
        drawn = (plan[pending], speed[pending], before[pending], motion[pending])
        pending = pending[~_is_possible(settings, *drawn)]
        if not len(pending):
            return plan, speed, before, motion
        clear[pending] += _SHIFT
    raise ZoneError(
        f"{len(pending)} of {n} pairs find no path around each other's zones (first: {plan[pending[0]]}, at "
        f"{speed[pending[0]]:.2f} m/s); the zones must leave space in the attentional space of "
        f"{SPACE.length} m by {SPACE.width} m; make the zones smaller"
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
    """One motion (n, 3, 2), as in `_draw_encounters`, that passes each zone at the distance `clear`.

    `bearing` is the parameter of the nearest point on the ellipse; intruders pass the person at this bearing.
    """
    n = len(plan)
    standing = plan == "standing"
    intruder = plan == "intruder"
    center, semi_axes, angle = settings.interpolate_zones(speed)
    a, b = semi_axes.T
    beside = np.arctan2(b * np.cos(angle), a * np.sin(angle)) + np.pi * rng.integers(
        2, size=n
    )
    unit = unit_vectors(np.where(standing, beside, bearing))
    edge = _rotate(_rotate_left(unit) * semi_axes, angle)
    point = center + _rotate(unit * semi_axes, angle)
    edge /= np.linalg.norm(edge, axis=-1, keepdims=True)
    tangent = np.where(intruder[:, None], _rotate_left(unit), edge)
    normal = -_rotate_left(tangent)
    intrusion = rng.uniform(*settings.intruder_distances, (n, 1))
    offset = np.where(
        intruder[:, None], intrusion * unit, point + clear[:, None] * normal
    )
    low, high = settings.intruder_speeds
    limit = 2 * settings.max_speed
    pace = rng.uniform(
        np.where(intruder, low, _DRIFT), np.where(intruder, min(high, limit), limit)
    )
    pace = np.where(plan == "together", rng.uniform(0, _DRIFT, n), pace)
    pace = np.where(standing, speed, pace)
    side = np.where(standing, -np.sign(tangent[:, 0]), rng.choice([-1.0, 1.0], n))
    passing = (side * pace)[:, None] * tangent
    curvature = np.where(plan == "passing", rng.uniform(0, bend, n), 0.0)
    swerve = -(curvature * pace**2)[:, None] * normal
    return np.stack([offset, passing + speed[:, None] * [1.0, 0.0], swerve], axis=1)


def _is_possible(
    settings: PlazaSettings,
    plan: NDArray[np.str_],
    speed: Array,
    before: Array,
    motion: Array,
) -> NDArray[np.bool_]:
    """Which motions start ahead of the walker, have walking speeds, and stay outside both zones."""
    lead = settings.lead_time
    moments = np.linspace(-lead, WINDOW + lead, 1 + round(_CHECKS * settings.tracked))
    since = (np.append(moments, 0.0) - before[:, None])[..., None]
    swerved, deviation = _swerve(since)
    offset, velocity, swerve = (motion[:, None, k] for k in range(3))
    passing = velocity - speed[:, None, None] * [1.0, 0.0]
    position = offset + passing * since + swerve * deviation
    velocity = velocity + swerve * swerved
    x, y = position[:, -1].T
    is_in_view = (
        (x >= MARGIN)
        & (x <= SPACE.length - MARGIN)
        & (np.abs(y) <= SPACE.width / 2 - MARGIN)
    )
    pace = np.linalg.norm(velocity, axis=-1)
    is_standing = plan == "standing"
    is_fast_enough = (pace >= MIN_WALKING_SPEED) | is_standing[:, None]
    has_walking_speed = ((pace <= settings.max_speed) & is_fast_enough).all(axis=1)
    possible = is_in_view & (np.hypot(x, y) >= 1 + MARGIN) & has_walking_speed
    is_checked = possible & (plan != "intruder")
    # checked last, because zones take longest
    some = np.flatnonzero(is_checked)
    possible[some] = _stays_outside(settings, position[some], speed[some, None])
    some = np.flatnonzero(possible & is_checked & ~is_standing)
    course = np.arctan2(velocity[some, :, 1], velocity[some, :, 0])
    possible[some] = _stays_outside(
        settings, _rotate(-position[some], -course), pace[some]
    )
    return np.asarray(possible)


def _swerve(since: Array) -> tuple[Array, Array]:
    """Change of velocity [s] and position [s2] by a swerve of 1 m/s2, at a time `since` the closest [s].

    A path bends until the two are closest; it is straight before the time in which a window can begin.
    """
    bent = np.clip(since, -_TIME_TO_CLOSEST[1], 0.0)
    return bent, bent * since - bent**2 / 2


def _stays_outside(
    settings: PlazaSettings, points: Array, speed: Array
) -> NDArray[np.bool_]:
    """Which paths (n, moments, 2) [m] are always outside the zones at speeds (n, moments or 1); (n,)."""
    center, semi_axes, angle = settings.interpolate_zones(speed)
    # the zones become the unit disc
    mapped = _rotate(points - center, -angle) / semi_axes
    return np.asarray((np.linalg.norm(mapped, axis=-1) >= 1).all(axis=1))


def _record(staged: pd.DataFrame, seed: int, settings: PlazaSettings) -> pl.DataFrame:
    """The recording of the sensor: the columns of an ATC file, two rows for each frame, without the gaps."""
    rng = np.random.default_rng([seed, 1])
    n = len(staged)
    start = staged["start"].to_numpy()
    lasts = start[-1] - start[0] + settings.tracked
    ms = rng.integers(*_FRAMES, int(lasts * 1000 / _FRAMES[0]) + 1, endpoint=True)
    frames = start[0] + np.cumsum(ms) / 1000
    pair = np.searchsorted(start, frames, side="right") - 1
    is_tracked = frames <= start[pair] + settings.tracked
    pair = pair[is_tracked]
    frames = frames[is_tracked]
    position, velocity = positions(staged.iloc[pair], frames)
    position += rng.normal(0, settings.noise, position.shape)
    sensor_velocity = velocity + rng.normal(0, _VELOCITY_NOISE, velocity.shape)
    facing = np.arctan2(velocity[..., 1], velocity[..., 0]) + rng.normal(
        0, _FACING_NOISE, velocity.shape[:2]
    )
    height = rng.uniform(*_HEIGHT, (n, 2))[pair] + rng.normal(
        0, settings.noise, velocity.shape[:2]
    )
    short = settings.short_gaps
    long = settings.long_gaps
    kind = rng.choice(3, (n, 2), p=[short, long, 1 - short - long])
    lengths = [rng.uniform(*gap, (n, 2)) for gap in _GAPS]
    length = np.choose(kind, [*lengths, np.zeros((n, 2))])
    gap_start = start[:, None] + rng.uniform(0, settings.tracked - length)
    time = frames[:, None]
    is_recorded = ~((time > gap_start[pair]) & (time < (gap_start + length)[pair]))
    speed = np.linalg.norm(sensor_velocity, axis=-1)
    metres = [*np.moveaxis(position, -1, 0), height, speed]
    millimetres = np.rint(np.multiply(1000, metres)).astype(np.int32)
    columns = {
        "time": np.broadcast_to(time, is_recorded.shape),
        "id": FIRST_ID + ID_STEP * (2 * pair[:, None] + np.arange(2)),
        **dict(zip(("x", "y", "z", "velocity"), millimetres, strict=True)),
        "motion_angle": np.arctan2(sensor_velocity[..., 1], sensor_velocity[..., 0]),
        "facing_angle": wrap_angle(facing),
    }
    return pl.DataFrame({name: column[is_recorded] for name, column in columns.items()})


def _stratify(rng: np.random.Generator, n: int, low: float, high: float) -> Array:
    """n numbers in random order, one in each nth part from low to high."""
    return low + (high - low) * rng.permutation(np.arange(n) + rng.uniform(size=n)) / n


def _rotate_left(vectors: Array) -> Array:
    """Rotate `vectors` (..., 2) by 90 degrees, counter-clockwise."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def _rotate(vectors: Array, angle: Array) -> Array:
    """Rotate `vectors` (..., 2) by `angle` (...) [rad], counter-clockwise."""
    cos = np.cos(angle)[..., None]
    sin = np.sin(angle)[..., None]
    return np.asarray(cos * vectors + sin * _rotate_left(vectors))

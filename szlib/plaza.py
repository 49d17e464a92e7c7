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

import os
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
import polars as pl
from numpy.typing import NDArray

from .ellipses import Ellipse
from .encounters import ATC_SQUARE, AttentionalSpace, Square, wrap_angle
from .errors import DataError, ZoneError
from .outliers import R_MAX

Array = NDArray[np.float64]

KINDS = ("overtaking", "head-on", "crossing", "together", "standing", "intruder")
"""Kinds of encounter; the first three by the angle between the directions of motion when closest."""
SLOWEST = 0.45
"""Who walks, walks at least that fast [m/s]; the paper looks at speeds from 0.4 m/s."""

_SLOW, _FAST = 0.5, 1.5  # speeds at which the settings give the zone [m/s]
_VECTORS = (
    "walker_",
    "other_",
    "walker_v",
    "other_v",
    "swerve_",
)  # columns of staged encounters, without x, y
_ZONE_SLOW, _ZONE_FAST = Ellipse((0.04, 0.0), (0.88, 0.68)), Ellipse((0.06, 0.0), (1.0, 0.78))
_JAPAN = ZoneInfo("Asia/Tokyo")
_SPACE = AttentionalSpace()
_MARGIN = 0.15  # what must be inside stays so in spite of the noise [m]
_TRACKED = 3.4  # a pair is tracked for the window of 3 s, wherever the ticks of the clock fall [s]
_LOOKED_AT = 3.15  # the window begins at the first tick or, at the latest, the next [s]
_PAUSE = 1.0  # between a pair's end and the start of the next [s]
_BEFORE = (0.5, 2.5)  # from a pair's start until the two are closest [s]
_TOGETHER = 0.25  # who walk together drift apart slower than that [m/s]
_HASTE = 1.5  # intruders rush past faster than that [m/s]: LOF cannot tell many near samples from a habit
_BEND = 1.2  # sharpest curvature of a path in the walker's frame [1/m]
_MOMENTS = np.linspace(0, _TRACKED, 52)  # at which a path is checked [s]
_ROUNDS, _SHIFT, _PATIENCE = 5000, 0.001, 200  # draws; each keeps 1 mm more clear; new bearing after so many
_BULGE = 0.003  # of the hull out of the free space that still counts as convex [m]
_FRAMES = (33, 50)  # from one frame to the next [ms]
_FIRST_ID, _ID_STEP, _FIRST_HOUR = 9_190_600, 100, 10  # ids as on the first day of ATC
_SHORT_GAP, _LONG_GAP = (0.1, 0.4), (0.6, 1.0)  # a track ends after 0.5 s of silence [s]
_HEIGHT = (1.5, 1.8)  # of people [m]
_VELOCITY_NOISE, _FACING_NOISE = 0.45, 0.3  # of the sensor's own velocity [m/s] and facing angle [rad]


@dataclass(frozen=True)
class PlazaSettings:
    """Who comes to the plaza, how they walk, what they keep clear, and what the sensor makes of it.

    Parameters
    ----------
    encounters : pairs of people.
    slow, fast : the true zone at 0.5 and at 1.5 m/s, in the person's frame [m]; at other speeds,
        centre, semi-axes and angle follow in proportion.
    speeds : of the walkers, (lowest, highest) [m/s], evenly spread.
    fastest : nobody is faster than that [m/s].
    clearance : mean distance that people who pass keep from the zone (exponential) [m].
    standing, together, intruders : shares of encounters with a person who stands, of two who walk
        together, and with one who walks right through the walker's zone.
    intrusion : how close intruders come, (nearest, farthest) [m].
    noise : standard deviation of each coordinate measured [m].
    gaps, losses : shares of tracks interrupted for 0.1-0.4 s, and for 0.6-1 s, which ends a track.
    square : where people meet [m].
    date : of the day, in Japan, "YYYY-MM-DD".

    Raises
    ------
    DataError : a number has no meaning, or the square is too small for an encounter.
    ZoneError : no hull can find this truth.  Points (x', y', speed) of people who keep out of the
        zone, r' = r_max - r, fill a body that must be *convex*, or its hull bulges into the zone.  So
        the zone must hold its person, reach less than r_max = 2 m, and not be too thin.
    """

    encounters: int = 2500
    slow: Ellipse = _ZONE_SLOW
    fast: Ellipse = _ZONE_FAST
    speeds: tuple[float, float] = (SLOWEST, 1.55)
    fastest: float = 2.2
    clearance: float = 0.1
    standing: float = 0.08
    together: float = 0.12
    intruders: float = 0.0025
    intrusion: tuple[float, float] = (0.2, 0.4)
    noise: float = 0.01
    gaps: float = 0.05
    losses: float = 0.01
    square: Square = ATC_SQUARE
    date: str = "2000-01-02"

    def __post_init__(self) -> None:
        shares = (self.standing, self.together, self.intruders)
        if not (min(shares) >= 0 and sum(shares) <= 1):
            raise DataError(f"standing, together, intruders must be shares, in sum at most 1; got {shares}")
        if not (min(self.gaps, self.losses) >= 0 and self.gaps + self.losses <= 1):
            raise DataError(f"gaps, losses must be shares, in sum at most 1; got {self.gaps}, {self.losses}")
        if not (self.encounters >= 1 and 0 <= self.clearance < np.inf and 0 <= self.noise < np.inf):
            raise DataError(
                "expected encounters >= 1, clearance >= 0 m and noise >= 0 m; "
                f"got {self.encounters}, {self.clearance} m, {self.noise} m"
            )
        if not SLOWEST <= self.speeds[0] < self.speeds[1] <= self.fastest < np.inf:
            raise DataError(
                f"expected {SLOWEST} <= lowest < highest speed <= fastest [m/s]; "
                f"got {self.speeds} and {self.fastest}"
            )
        if not 0 < self.intrusion[0] <= self.intrusion[1] < np.inf:
            raise DataError(f"expected 0 < nearest <= farthest intrusion; got {self.intrusion} m")
        needed = np.hypot(_swept(self.speeds[1]), _SPACE.width) + 2 * _MARGIN
        given = min(np.ptp(self.square.x), np.ptp(self.square.y))
        if given < needed:
            raise DataError(
                f"at speeds up to {self.speeds[1]} m/s a square needs sides of {needed:.1f} m or more; "
                f"got {given:.1f} m; take a larger square or slower walkers"
            )
        _first_moment(self)
        _check_convex(self)

    def true_zone(self, speed: float) -> Ellipse:
        """The zone, in the person's frame [m], that others keep out of, by the person's `speed` [m/s]."""
        (m, n), (a, b), angle = _zones(self, np.array(float(speed)))
        return Ellipse((m, n), (a, b), float(angle))


def make_plaza(path: str | Path, *, seed: int = 0, settings: PlazaSettings | None = None) -> Path:
    """Write a day on the plaza in the raw ATC format (method, sec. 1), and return its path.

    The same seed and settings give the same bytes; the file is replaced as a whole or not at all.

    Raises
    ------
    DataError : the file cannot be written.
    ZoneError : people cannot respect the zones of `settings` (see `stage_encounters`).
    """
    path, settings = Path(path), settings or PlazaSettings()
    rows = _sensed(stage_encounters(seed=seed, settings=settings), seed, settings)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        rows.write_csv(unfinished, include_header=False, float_precision=3)
        unfinished.replace(path)
    except OSError as error:
        raise DataError(
            f"{path}: cannot write the plaza ({error}); choose a folder that exists and is writable"
        ) from error
    finally:
        unfinished.unlink(missing_ok=True)
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
    ahead, swept = _direction(heading), _swept(speed)
    half = (np.abs(ahead) * swept[:, None] + np.abs(_left(ahead)) * _SPACE.width) / 2
    low, high = np.transpose([settings.square.x, settings.square.y])
    middle = rng.uniform(low + half + _MARGIN, high - half - _MARGIN)
    walker = middle + (speed * before - swept / 2)[:, None] * ahead
    start = _first_moment(settings) + np.arange(n) * (_TRACKED + _PAUSE)
    offset, other_v, swerve = np.moveaxis(_turned(motion, heading[:, None]), 1, 0)
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
        f"the attentional space of {_SPACE.length} m by {_SPACE.width} m; make `slow` and `fast` smaller"
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
    center, semi_axes, angle = _zones(settings, speed)
    a, b = semi_axes.T
    beside = np.arctan2(b * np.cos(angle), a * np.sin(angle)) + np.pi * rng.integers(2, size=n)
    unit = _direction(np.where(standing, beside, bearing))
    edge = _turned(_left(unit) * semi_axes, angle)
    point = center + _turned(unit * semi_axes, angle)
    tangent = np.where(intruder[:, None], _left(unit), edge / np.linalg.norm(edge, axis=-1, keepdims=True))
    normal = -_left(tangent)
    intrusion = rng.uniform(*settings.intrusion, n)
    offset = np.where(intruder[:, None], intrusion[:, None] * unit, point + clear[:, None] * normal)
    pace = rng.uniform(np.where(intruder, _HASTE, _TOGETHER), 2 * settings.fastest)
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
    seen = (x >= _MARGIN) & (x <= _SPACE.length - _MARGIN) & (np.abs(y) <= _SPACE.width / 2 - _MARGIN)
    pace, course = np.linalg.norm(moves, axis=-1), np.arctan2(moves[..., 1], moves[..., 0])
    standing = plan == "standing"
    natural = ((pace <= settings.fastest) & ((pace >= SLOWEST) | standing[:, None])).all(axis=1)
    kept = _keeps_out(settings, where, np.broadcast_to(speed[:, None], pace.shape))
    kept &= _keeps_out(settings, _turned(-where, -course), pace) | standing
    allowed = natural & (kept | (plan == "intruder"))
    return np.asarray(seen & (np.hypot(x, y) >= 1 + _MARGIN) & allowed)


def _keeps_out(settings: PlazaSettings, points: Array, speed: Array) -> NDArray[np.bool_]:
    """Which paths (n, moments, 2) [m] keep out of zones at speeds (n, moments) all the time; (n,)."""
    return np.asarray((np.linalg.norm(_in_unit_disc(settings, points, speed), axis=-1) >= 1).all(axis=1))


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
        "id": _FIRST_ID + _ID_STEP * (2 * pair[:, None] + np.arange(2)),
        **mm,
        "motion_angle": np.arctan2(felt[..., 1], felt[..., 0]),
        "facing_angle": wrap_angle(facing),
    }
    return pl.DataFrame({name: column[there] for name, column in columns.items()})


def _check_convex(settings: PlazaSettings) -> None:
    """Raise ZoneError unless the midpoint of any two free points (x', y', speed) is free as well."""
    unit, speed = _direction(np.linspace(0, 2 * np.pi, 90, endpoint=False)), np.linspace(*settings.speeds, 3)
    shape = (len(speed), len(unit))
    speed, unit = np.repeat(speed, shape[1]), np.tile(unit, (shape[0], 1))
    reach = _reach(settings, unit, speed)
    if not (reach < R_MAX).all():
        raise ZoneError(
            f"slow = {settings.slow}, fast = {settings.fast}: at {settings.speeds} m/s the zone must hold "
            f"the person's own place and reach less than {R_MAX} m; make it smaller or centre it"
        )
    free = (R_MAX - reach)[:, None] * unit
    middle, between = (free[:, None] + free) / 2, (speed[:, None] + speed) / 2
    distance = np.linalg.norm(middle, axis=-1)
    middle = np.where(distance[..., None] > 0, middle, [1.0, 0.0])
    excess = (
        distance + _reach(settings, middle / np.linalg.norm(middle, axis=-1, keepdims=True), between) - R_MAX
    )
    if excess.max() > _BULGE:
        raise ZoneError(
            f"slow = {settings.slow}, fast = {settings.fast}: no hull finds this zone, for the space it "
            f"leaves free is not convex (by {excess.max():.3f} m, allowed: {_BULGE} m); make it rounder"
        )


def _reach(settings: PlazaSettings, unit: Array, speed: Array) -> Array:
    """How far zones at speeds (...) reach along unit vectors (..., 2) [m]; inf: the person is outside."""
    origin = _in_unit_disc(settings, np.zeros_like(unit), speed)
    along = _in_unit_disc(settings, unit, speed) - origin
    p, q, s = (np.sum(u * v, axis=-1) for u, v in ((along, origin), (along, along), (origin, origin)))
    return np.where(s < 1, (np.sqrt(p**2 + q * np.maximum(1 - s, 0)) - p) / q, np.inf)


def _zones(settings: PlazaSettings, speed: Array) -> tuple[Array, Array, Array]:
    """Centres (..., 2), semi-axes (..., 2) [m] and angles (...) [rad] of the true zones at speeds (...)."""
    slow, fast, share = settings.slow, settings.fast, (speed - _SLOW) / (_FAST - _SLOW)
    turn = Ellipse((0, 0), (1, 1), fast.angle - slow.angle).angle  # the shorter way round
    center, semi_axes = (
        np.add(start, share[..., None] * np.subtract(end, start))
        for start, end in ((slow.center, fast.center), (slow.semi_axes, fast.semi_axes))
    )
    return center, semi_axes, slow.angle + share * turn


def _in_unit_disc(settings: PlazaSettings, points: Array, speed: Array) -> Array:
    """Points (..., 2) [m] in coordinates in which the zones at speeds (...) are the unit disc."""
    center, semi_axes, angle = _zones(settings, speed)
    return _turned(points - center, -angle) / semi_axes


def _first_moment(settings: PlazaSettings) -> float:
    """When the first pair comes [s since 1970]."""
    try:
        day = datetime.strptime(settings.date, "%Y-%m-%d").replace(hour=_FIRST_HOUR, tzinfo=_JAPAN)
    except ValueError as error:
        raise DataError(f'date must be a day "YYYY-MM-DD"; got {settings.date!r}') from error
    return day.timestamp()


def _swept(speed: float | Array) -> Array:
    """Length of what the attentional space sweeps over within the window [m]."""
    return np.asarray(_SPACE.length + speed * _LOOKED_AT)


def _spread(rng: np.random.Generator, n: int, low: float, high: float) -> Array:
    """n numbers in random order, one in each nth part from low to high."""
    return low + (high - low) * rng.permutation(np.arange(n) + rng.uniform(size=n)) / n


def _direction(angle: Array) -> Array:
    """Unit vectors (..., 2) at angles (...) [rad]."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _left(vectors: Array) -> Array:
    """Vectors (..., 2) turned by 90 degrees, counter-clockwise."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def _turned(vectors: Array, angle: Array) -> Array:
    """Vectors (..., 2) turned by angles (...) [rad], counter-clockwise."""
    cos, sin = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return np.asarray(cos * vectors + sin * _left(vectors))

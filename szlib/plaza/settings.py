"""The known truth of the synthetic plaza: whose zone it is, how large, and whether data can show it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta, timezone

import numpy as np

from ..checks import Array
from ..encounters.geometry import ATC_SQUARE, AttentionalSpace, Square
from ..errors import DataError, ZoneError
from ..zones.ellipses import Ellipse
from ..zones.outliers import R_MAX

SLOWEST = 0.45
"""Who walks, walks at least that fast [m/s]; the paper looks at speeds from 0.4 m/s."""
SPACE = AttentionalSpace()
MARGIN = 0.15
"""What must be inside stays so in spite of the noise [m]."""
RUSHING_INTRUDERS, SLOW_INTRUDERS = (1.5, np.inf), (0.25, 1.0)
"""Paces of intruders, relative to the walker, (slowest, fastest) [m/s]."""

_SLOW, _FAST = 0.5, 1.5  # speeds at which the settings give the zone [m/s]
_ZONE_SLOW, _ZONE_FAST = Ellipse((0.04, 0.0), (0.88, 0.68)), Ellipse((0.06, 0.0), (1.0, 0.78))
_JAPAN = timezone(timedelta(hours=9))
_FIRST_HOUR = 10  # of the day, when the first pair comes
_LOOKED_AT = 3.15  # the window of 3 s begins at the first tick or, at the latest, the next [s]
_PACE = 0.5  # who is slower does not come close within the window [m/s]
_BULGE = 0.003  # of the hull out of the free space that still counts as convex [m]


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
    pace : of intruders, relative to the walker, (slowest, fastest) [m/s].  `RUSHING_INTRUDERS`, the
        default, leave a few samples within the zone; `SLOW_INTRUDERS` leave many.
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

    What nobody can see: who is behind me has me ahead.  Where zones reach much farther ahead than
    behind, people who respect each other never touch the back of a fast walker's zone, and no data
    shows it.  The default is 0.1 m longer ahead than behind; with 0.2 m the fit is 5 to 7 cm off.
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
    pace: tuple[float, float] = RUSHING_INTRUDERS
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
        if not (0 < self.pace[0] <= self.pace[1] >= _PACE and self.pace[0] < 2 * self.fastest):
            raise DataError(
                f"expected 0 < slowest <= fastest pace, the slowest below {2 * self.fastest} m/s (two people "
                f"at their fastest), the fastest {_PACE} m/s or more (from 1 m away); got {self.pace}"
            )
        needed = np.hypot(swept_length(self.speeds[1]), SPACE.width) + 2 * MARGIN
        given = min(np.ptp(self.square.x), np.ptp(self.square.y))
        if given < needed:
            raise DataError(
                f"at speeds up to {self.speeds[1]} m/s a square needs sides of {needed:.1f} m or more; "
                f"got {given:.1f} m; take a larger square or slower walkers"
            )
        first_moment(self)
        _check_convex(self)

    def true_zone(self, speed: float) -> Ellipse:
        """The zone, in the person's frame [m], that others keep out of, by the person's `speed` [m/s]."""
        (m, n), (a, b), angle = zones_at(self, np.array(float(speed)))
        return Ellipse((m, n), (a, b), float(angle))


def _check_convex(settings: PlazaSettings) -> None:
    """Raise ZoneError unless the midpoint of any two free points (x', y', speed) is free as well."""
    unit, speed = direction(np.linspace(0, 2 * np.pi, 90, endpoint=False)), np.linspace(*settings.speeds, 3)
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
    origin = in_unit_disc(settings, np.zeros_like(unit), speed)
    along = in_unit_disc(settings, unit, speed) - origin
    p, q, s = (np.sum(u * v, axis=-1) for u, v in ((along, origin), (along, along), (origin, origin)))
    return np.where(s < 1, (np.sqrt(p**2 + q * np.maximum(1 - s, 0)) - p) / q, np.inf)


def zones_at(settings: PlazaSettings, speed: Array) -> tuple[Array, Array, Array]:
    """Centres (..., 2), semi-axes (..., 2) [m] and angles (...) [rad] of the true zones at speeds (...)."""
    slow, fast, share = settings.slow, settings.fast, (speed - _SLOW) / (_FAST - _SLOW)
    turn = Ellipse((0, 0), (1, 1), fast.angle - slow.angle).angle  # the shorter way round
    center, semi_axes = (
        np.add(start, share[..., None] * np.subtract(end, start))
        for start, end in ((slow.center, fast.center), (slow.semi_axes, fast.semi_axes))
    )
    return center, semi_axes, slow.angle + share * turn


def in_unit_disc(settings: PlazaSettings, points: Array, speed: Array) -> Array:
    """Points (..., 2) [m] in coordinates in which the zones at speeds (...) are the unit disc."""
    center, semi_axes, angle = zones_at(settings, speed)
    return turned(points - center, -angle) / semi_axes


def first_moment(settings: PlazaSettings) -> float:
    """When the first pair comes [s since 1970]."""
    try:
        day = datetime.strptime(settings.date, "%Y-%m-%d").replace(hour=_FIRST_HOUR, tzinfo=_JAPAN)
    except ValueError as error:
        raise DataError(f'date must be a day "YYYY-MM-DD"; got {settings.date!r}') from error
    return day.timestamp()


def swept_length(speed: float | Array) -> Array:
    """Length of what the attentional space sweeps over within the window [m]."""
    return np.asarray(SPACE.length + speed * _LOOKED_AT)


def direction(angle: Array) -> Array:
    """Unit vectors (..., 2) at angles (...) [rad]."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def to_left(vectors: Array) -> Array:
    """Vectors (..., 2) turned by 90 degrees, counter-clockwise."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def turned(vectors: Array, angle: Array) -> Array:
    """Vectors (..., 2) turned by angles (...) [rad], counter-clockwise."""
    cos, sin = np.cos(angle)[..., None], np.sin(angle)[..., None]
    return np.asarray(cos * vectors + sin * to_left(vectors))

"""The settings of the synthetic plaza, the true zone of its people, and the precision of a rule."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta, timezone

import numpy as np
from numpy.typing import NDArray

from ..core.checks import Array, require
from ..core.errors import DataError, ZoneError
from ..encounters.geometry import ATC_SQUARE, Area, AttentionalSpace
from ..zones.ellipses import Ellipse, ellipse_reach
from ..zones.outliers import R_MAX

# lowest speed of a walking person [m/s]; the paper has speeds from 0.4 m/s
MIN_WALKING_SPEED = 0.45
SPACE = AttentionalSpace()
MARGIN = 0.15  # distance from an edge at which a point stays inside in spite of the noise [m]
RUSHING_INTRUDERS = (1.5, np.inf)
SLOW_INTRUDERS = (0.25, 1.0)
ANY_SPEED_INTRUDERS = (0.25, np.inf)
"""Speeds of intruders relative to the walker, (lowest, highest) [m/s]."""
WINDOW = 3.4  # a pair seen for this time is seen for 3 s of the clock, wherever its ticks fall [s]

_LOW_SPEED = 0.5  # speeds of `slow_zone` and `fast_zone` [m/s]
_HIGH_SPEED = 1.5
_SLOW_ZONE = Ellipse((0.04, 0.0), (0.88, 0.68))
_FAST_ZONE = Ellipse((0.06, 0.0), (1.0, 0.78))
_JAPAN = timezone(timedelta(hours=9))
_FIRST_HOUR = 10  # of the day, when the first pair comes
# the window of 3 s begins at the first tick or, at the latest, the next [s]
_SWEPT = 3.15
_LONGEST_TRACKED = 60.0  # of a pair [s]
# a slower intruder does not come close within the window [m/s]
_MIN_INTRUDER_SPEED = 0.5


@dataclass(frozen=True)
class PlazaSettings:
    """The people on the plaza: how they walk, the distance they keep, and the errors of the sensor.

    Parameters
    ----------
    n_encounters : number of pairs of people.
    slow_zone, fast_zone : the true zone at 0.5 and at 1.5 m/s, in the person's frame [m]. Centre, semi-axes
        and angle are linear in the speed.
    tracked : time for which both people of a pair are seen, evenly before and after the window of 3 s [s].
        The default is the window alone; data at 1 Hz needs 5.4 s.
    speeds : of the walkers, (lowest, highest), evenly spread [m/s].
    max_speed : highest speed of any person [m/s].
    clearance : mean distance from the zone of the people who pass (exponential) [m].
    standing, together, intruders : shares of encounters with a standing person, with two people who walk
        together, and with a person who walks through the walker's zone.
    intruder_distances : nearest approach of intruders, (smallest, largest) [m].
    intruder_speeds : of intruders, relative to the walker, (lowest, highest) [m/s]. `RUSHING_INTRUDERS`, the
        default, leave a few samples within the zone; `SLOW_INTRUDERS` leave many; `ANY_SPEED_INTRUDERS` are
        slow, rushing and in between.
    noise : standard deviation of each measured coordinate [m].
    short_gaps, long_gaps : shares of tracks with a gap of 0.1 to 0.4 s, and of 0.6 to 1 s, which ends a
        track.
    area : where people meet, a rectangle along the axes [m].
    date : of the day, in Japan, "YYYY-MM-DD".

    Raises
    ------
    DataError : a number is invalid, the area is no rectangle, or too small for an encounter.
    ZoneError : the zone does not contain its person, or reaches r_max = 2 m.

    Notes
    -----
    Points (x', y', speed) of people outside the zone, r' = r_max - r, fill a body. Where the zone is so thin
    that this body is not *convex*, its hull enters the zone, and method "hull" finds a smaller zone.

    A zone of any form can be walked, but not every form can be observed. A person behind me has me ahead: if
    zones reach farther ahead than behind, people who respect each other never touch the back of a zone. And a
    radius is the nearest approach over 35 deg. Errors of the quantile zone without intruders, at 500
    encounters (mean of eight seeds, a x b = 0.95 m x 0.70 m unless given):

        true zone            a          b          centre                  angle
        centred              + 2 cm     + 2 cm     0
        centre 0.10 m ahead  + 2 cm     + 2 cm     5 cm too far back
        centre 0.20 m ahead  + 7 cm     + 2 cm     12 cm too far back
        turned by 29 deg     + 1 cm     + 7 cm     2 cm too far back       12 deg too small
        1.4 m x 0.6 m        -20 cm     - 1 cm     0

    Examples
    --------
    >>> import szlib
    >>> settings = szlib.PlazaSettings(n_encounters=100, intruders=0.01)
    >>> settings.true_zone(1.0).semi_axes
    (0.94, 0.73)
    """

    n_encounters: int = 2500
    slow_zone: Ellipse = _SLOW_ZONE
    fast_zone: Ellipse = _FAST_ZONE
    tracked: float = WINDOW
    speeds: tuple[float, float] = (MIN_WALKING_SPEED, 1.55)
    max_speed: float = 2.2
    clearance: float = 0.1
    standing: float = 0.08
    together: float = 0.12
    intruders: float = 0.0025
    intruder_distances: tuple[float, float] = (0.2, 0.4)
    intruder_speeds: tuple[float, float] = RUSHING_INTRUDERS
    noise: float = 0.01
    short_gaps: float = 0.05
    long_gaps: float = 0.01
    area: Area = ATC_SQUARE
    date: str = "2000-01-02"

    def __post_init__(self) -> None:
        low, high = self.speeds
        nearest, farthest = self.intruder_distances
        slowest, fastest = self.intruder_speeds
        top = self.max_speed
        checks = {
            "n_encounters": (self.n_encounters >= 1, "at least 1"),
            "tracked": (
                WINDOW <= self.tracked <= _LONGEST_TRACKED,
                f"{WINDOW} to {_LONGEST_TRACKED:g} s",
            ),
            "clearance": (0 <= self.clearance < np.inf, "at least 0 m"),
            "area": (self.area.is_rectangle, "a rectangle along the axes"),
            "noise": (0 <= self.noise < np.inf, "at least 0 m"),
            "speeds": (
                MIN_WALKING_SPEED <= low < high <= top < np.inf,
                f"(lowest, highest), from {MIN_WALKING_SPEED} m/s to max_speed = {top} m/s",
            ),
            "intruder_distances": (
                0 < nearest <= farthest < np.inf,
                "(smallest, largest), both positive [m]",
            ),
            "intruder_speeds": (
                0 < slowest <= fastest >= _MIN_INTRUDER_SPEED and slowest < 2 * top,
                f"(lowest, highest), between 0 and {2 * top} m/s and at least {_MIN_INTRUDER_SPEED} m/s",
            ),
        }
        for names in ("standing, together, intruders", "short_gaps, long_gaps"):
            shares = [getattr(self, name) for name in names.split(", ")]
            are_shares = min(shares) >= 0 and sum(shares) <= 1
            require(are_shares, names, shares, "shares, in sum at most 1")
        for name, (is_valid, expected) in checks.items():
            require(is_valid, name, getattr(self, name), expected)
        needed = np.hypot(swept_length(high), SPACE.width) + 2 * MARGIN
        given = min(np.ptp(self.area.x), np.ptp(self.area.y))
        if given < needed:
            raise DataError(
                f"at speeds up to {high} m/s, the area needs sides of at least {needed:.1f} m; "
                f"got {given:.1f} m; use a larger area or slower walkers"
            )
        self.compute_start_time()
        zones = self.interpolate_zones(np.linspace(low, high, 3))
        reach = ellipse_reach(np.column_stack(zones))
        if not (reach < R_MAX).all():  # NaN where a zone does not contain the person
            raise ZoneError(
                f"{self.slow_zone}, {self.fast_zone}: at {self.speeds} m/s the zone must "
                f"contain the person and reach less than {R_MAX} m; make it smaller or centre it"
            )

    def true_zone(self, speed: float) -> Ellipse:
        """The true zone, in the person's frame [m], of a person who walks at `speed` [m/s]."""
        (m, n), (a, b), angle = self.interpolate_zones(np.array(float(speed)))
        return Ellipse((m, n), (a, b), float(angle))

    def interpolate_zones(self, speed: Array) -> tuple[Array, Array, Array]:
        """Centres (..., 2), semi-axes (..., 2) [m] and angles (...) [rad] of the zones at `speed`."""
        slow = self.slow_zone
        fast = self.fast_zone
        share = (speed - _LOW_SPEED) / (_HIGH_SPEED - _LOW_SPEED)
        # the shorter rotation
        turn = Ellipse((0, 0), (1, 1), fast.angle - slow.angle).angle
        part = share[..., None]
        center = np.add(slow.center, part * np.subtract(fast.center, slow.center))
        growth = np.subtract(fast.semi_axes, slow.semi_axes)
        return center, slow.semi_axes + part * growth, slow.angle + share * turn

    def compute_start_time(self) -> float:
        """Compute the time at which the first pair comes [s since 1970]."""
        try:
            day = datetime.strptime(self.date, "%Y-%m-%d").replace(
                hour=_FIRST_HOUR, tzinfo=_JAPAN
            )
        except ValueError as error:
            raise DataError(
                f'date must be a day "YYYY-MM-DD"; got {self.date!r}'
            ) from error
        return day.timestamp()

    @property
    def lead_time(self) -> float:
        """Time for which a pair is seen before its window, and after it [s]."""
        return (self.tracked - WINDOW) / 2


def swept_length(speed: float | Array) -> Array:
    """Length of the area that the attentional space sweeps at `speed` within the window [m]."""
    return np.asarray(SPACE.length + speed * _SWEPT)


def precision_and_recall(
    removed: NDArray[np.bool_], intruders: NDArray[np.bool_]
) -> tuple[float, float]:
    """Compute the precision and recall of a rule that removes intruders.

    Parameters
    ----------
    removed : whether the rule removed each sample (or encounter), shape (n,).
    intruders : whether each is an intruder's, shape (n,).

    Returns
    -------
    The share of intruders among the removed, and the share of the intruders that is removed; nan for a share
    of nothing.

    Raises
    ------
    DataError : the shapes differ.

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.plaza import precision_and_recall
    >>> precision_and_recall(np.array([True, True, False]), np.array([True, False, False]))
    (0.5, 1.0)
    """
    removed = np.asarray(removed, bool)
    intruders = np.asarray(intruders, bool)
    if removed.shape != intruders.shape:
        raise DataError(
            f"expected two arrays of one shape; got {removed.shape} and {intruders.shape}"
        )
    found = removed & intruders
    precision, recall = (
        float(found[each].mean()) if each.any() else np.nan
        for each in (removed, intruders)
    )
    return precision, recall

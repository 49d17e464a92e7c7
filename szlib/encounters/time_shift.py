"""The same people on the same paths, each moved in time by an amount of their own: `time_shifted`.

Every path and speed stays, and so does the density of the crowd over the day.  Interaction is removed:
people meet by chance only.

The recording is closed to a circle: a person who is moved past its end appears at its beginning.  So nobody
leaves the recorded hours, and every moment remains equally likely.  (Reversing the sign of such a shift
instead would thin out the first and the last minutes.)  One empty tick is the seam of the circle: a person
who walks across it loses that tick, and has two pieces of track from there on.

*Companions are separated*: two people who were within 2 m of each other for 5 s or more, counted in whole
seconds, get shifts that differ by 10 s or more, some 10 m of walking.  (By chance 2 % of them would not.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ..core.checks import require
from ..core.errors import DataError
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND, compute_velocities
from .geometry import Area
from .kinds import NEAR, TOGETHER
from .near_rows import is_near
from .neighbours import find_neighbours
from .occupants import TrackRows

# Shortest and longest shift [min]: longer than a meeting, shorter than the day's ups and downs (assumed).  A
# recording shorter than their sum has both in proportion: 0.55 and 5.5 min in 6 min.
MINUTES = (1.0, 10.0)
# Smallest difference between the shifts of companions [s] (assumed: some 10 m of walking).
COMPANION_SEPARATION = 10.0

_MINUTE = 60 * TICKS_PER_SECOND
_ATTEMPTS = 1000  # number of times that shifts of companions are drawn again where they are too similar


def time_shifted(
    tracks: pd.DataFrame,
    *,
    seed: int | Sequence[int] = 0,
    minutes: tuple[float, float] | None = None,
) -> pd.DataFrame:
    """Move each person in time by an amount of their own: paths and density stay, interaction is removed.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks` (any row order, left untouched).
    seed : of the random shifts.
    minutes : shortest and longest shift [min], forward or backward; every tick in between is equally likely.
        None takes 1 and 10 min, and in a recording shorter than 11 min both in proportion.

    Returns
    -------
    A track table, sorted by day, id, t.  Each person is moved around the circle of their day's recording
    (`szlib.encounters.time_shift`).  The funnel counts the ticks that fall on the seam.

    Raises
    ------
    DataError : as `szlib.find_encounters`; or `minutes` has no meaning, is too long for a recording, or too
        narrow to separate companions; or a recording is shorter than 1.8 min and `minutes` is None.

    Examples
    --------
    >>> import numpy as np, pandas as pd, szlib
    >>> t = np.arange(0, 600, 0.1).round(1)
    >>> walk = pd.DataFrame({"day": "a", "id": 1, "t": t, "x": 0.1 * t, "y": 0.0, "vx": 0.1, "vy": 0.0})
    >>> moved = szlib.time_shifted(walk, seed=1)
    >>> len(walk) - len(moved) <= 1
    True
    """
    shiftable = ShiftableTracks.from_tracks(tracks)
    return shiftable.shift(shiftable.draw_shifts(seed, minutes))


@dataclass(frozen=True, eq=False)
class ShiftableTracks:
    """Tracks of people who can be moved in time.

    Attributes
    ----------
    table : track table, sorted by person and time.
    person, tick : number of the person and tick of the clock, of each row.
    day : number of each person's day.
    first, period : of each day: first tick, and ticks of the circle (those recorded, and the seam).
    companions : pairs of people to be separated, shape (n, 2).
    """

    table: pd.DataFrame
    person: np.ndarray
    tick: np.ndarray
    day: np.ndarray
    first: np.ndarray
    period: np.ndarray
    companions: np.ndarray

    @classmethod
    def from_tracks(cls, tracks: pd.DataFrame) -> ShiftableTracks:
        """Prepare the people of a track table `tracks`."""
        rows = TrackRows.from_tracks(tracks)
        day_starts = np.flatnonzero(np.diff(rows.day, prepend=-1))
        first = np.minimum.reduceat(rows.tick, day_starts)
        period = np.maximum.reduceat(rows.tick, day_starts) - first + 2
        table = tracks.iloc[rows.order].reset_index(drop=True)
        day = rows.day[np.diff(rows.person, prepend=-1) > 0]
        return cls(table, rows.person, rows.tick, day, first, period, _companions(rows))

    def near(self, area: Area, duration: float) -> ShiftableTracks:
        """The rows that encounters in the `area`, in windows of `duration` [s], can depend on."""
        x, y = self.table["x"].to_numpy(), self.table["y"].to_numpy()
        near = is_near(x, y, self.person, area, duration)
        stage = funnels.stage(
            "near the area", len(near), near.sum(), {"elsewhere": (~near).sum()}
        )
        table = funnels.attach(self.table[near].reset_index(drop=True), [stage])
        return replace(
            self, table=table, person=self.person[near], tick=self.tick[near]
        )

    def minutes_by_day(self, minutes: tuple[float, float] | None) -> np.ndarray:
        """Shortest and longest shift of each day [min], (n, 2); `minutes` and errors as in `time_shifted`."""
        low, high = (float(m) for m in minutes or MINUTES)
        is_range = 1 / _MINUTE <= low <= high < np.inf
        require(is_range, "minutes", minutes, "(shortest, longest), both positive")
        recorded = (self.period - 1) / _MINUTE
        share, lasts = np.minimum(recorded / (low + high), 1), float(recorded.min())
        if minutes is not None and lasts < low + high:
            raise DataError(
                f"a day was recorded for {lasts:.1f} min, too short for shifts of up to {high:g} min: "
                f"around its circle they come back to less than {low:g} min; leave minutes out"
            )
        if minutes is None and low * share.min() < COMPANION_SEPARATION / 60:
            raise DataError(
                f"a day was recorded for {lasts:.1f} min, too short for a null model, which moves people by "
                f"{COMPANION_SEPARATION:g} s and more; leave out recordings shorter than 2 min"
            )
        return np.outer(share, (low, high))

    def draw_shifts(
        self, seed: int | Sequence[int], minutes: tuple[float, float] | None
    ) -> np.ndarray:
        """Draw a shift for each person [ticks]; companions are separated.

        `seed`, `minutes` and errors as in `time_shifted`.
        """
        by_day = self.minutes_by_day(minutes)
        low, high = minutes or MINUTES
        share = (by_day[:, 1] / high)[self.day]
        rng = np.random.default_rng(seed)

        def draw(people: np.ndarray) -> np.ndarray:
            """Shifts of `people`, earlier or later [ticks]."""
            ticks = rng.integers(
                round(low * _MINUTE), round(high * _MINUTE), len(people), endpoint=True
            )
            return np.asarray(
                np.rint(ticks * share[people]).astype(int)
                * rng.choice([-1, 1], len(people))
            )

        shift = draw(np.arange(len(self.day)))
        one, other = self.companions.T
        around = self.period[self.day[one]]
        for _ in range(_ATTEMPTS):
            difference = (shift[one] - shift[other]) % around
            similar = (
                np.minimum(difference, around - difference)
                < COMPANION_SEPARATION * TICKS_PER_SECOND
            )
            if not similar.any():
                return shift
            redrawn = np.unique(other[similar])
            shift[redrawn] = draw(redrawn)
        shortest, longest = by_day[:, 0].min(), by_day[:, 1].max()
        raise DataError(
            f"with shifts of {shortest:.2g} to {longest:.2g} min, {int(similar.sum())} pairs of companions "
            f"could not be separated by {COMPANION_SEPARATION:g} s; "
            + (
                "use a longer recording"
                if minutes is None
                else "leave minutes out, for a wider range"
            )
        )

    def shift(self, shift: np.ndarray) -> pd.DataFrame:
        """The track table with each person moved by `shift` [ticks] around the circle."""
        first, period = (
            each[self.day[self.person]] for each in (self.first, self.period)
        )
        turns, since = np.divmod(self.tick - first + shift[self.person], period)
        rows = np.flatnonzero(since < period - 1)
        order = rows[np.lexsort((since[rows], self.person[rows]))]
        table = self.table.iloc[order].reset_index(drop=True)
        table["t"] = (first + since)[order] / TICKS_PER_SECOND
        across = (self.person[1:] == self.person[:-1]) & (turns[1:] != turns[:-1])
        cut = np.isin(self.person[order], self.person[1:][across])
        if cut.any():  # within half a second of the seam the velocity is that of the end of a piece
            table.loc[cut, ["vx", "vy"]] = compute_velocities(table[cut])
        rejected = {"on the seam of the day": len(since) - len(rows)}
        stage = funnels.stage("time shifted: ticks", len(since), len(rows), rejected)
        return funnels.attach(table, [*funnels.get(self.table), stage])


def _companions(rows: TrackRows) -> np.ndarray:
    """Pairs of people who were within `NEAR` [m] of each other for `TOGETHER` [s] or more; (n, 2)."""
    whole = rows.tick % TICKS_PER_SECOND == 0
    found = find_neighbours(rows.x[whole], rows.y[whole], rows.moment[whole], NEAR)
    near = [np.empty((2, 0), np.intp), *map(np.stack, found)]
    pairs = np.sort(rows.person[whole][np.concatenate(near, axis=1).T], axis=1)
    pairs, seconds = np.unique(pairs, axis=0, return_counts=True)
    return np.asarray(pairs[seconds >= TOGETHER])

"""The same people on the same paths, each moved in time alone: `time_shifted` keeps all but interaction.

Each person comes some minutes earlier or later than they did, each by a time of their own.  Every path and
speed, the density of the crowd and its ups and downs over the day stay; who met whom is lost.

The recording is closed to a circle: who is moved past its end comes at its beginning.  So nobody leaves the
recorded hours, nobody is lost, and every moment remains as likely as before.  (To turn the sign of such a
shift instead would thin out the first and the last minutes.)  One empty tick is the seam of the circle:
whoever walks across it loses that tick, and is two pieces of track from there on.

*Companions are taken apart*: two people who were within 2 m of each other for 5 s or more, seconds counted,
get shifts that differ by 10 s or more, some 10 m of walking.  (By chance alone 2 % of them would not.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from ..errors import DataError
from ..tracks import funnels
from ..tracks.clock import TICKS_PER_SECOND, clock_index, to_clock
from .geometry import Area
from .kinds import NEAR, TOGETHER, number_people
from .nearby import may_matter

MINUTES = (1.0, 10.0)
"""Shortest and longest shift [min]: longer than a meeting, shorter than the day's ups and downs (assumed)."""
APART = 10.0
"""The shifts of companions differ by at least that [s] (assumed: some 10 m of walking)."""

_MINUTE = 60 * TICKS_PER_SECOND
_ROUNDS = 1000  # of drawing anew for companions whose shifts are too alike


def time_shifted(
    tracks: pd.DataFrame, *, seed: int | Sequence[int] = 0, minutes: tuple[float, float] = MINUTES
) -> pd.DataFrame:
    """The same people, each moved in time alone: paths and density stay, interaction is lost.

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks` (any row order, left untouched).
    seed : of the shifts.
    minutes : shortest and longest shift [min], forward or backward, every tick between them as likely.

    Returns
    -------
    A track table, sorted by day, id, t: each person moved around the circle of their day's recording (see
    the module).  Its funnel counts the ticks lost on the seam.

    Raises
    ------
    DataError : as `szlib.find_encounters`; or `minutes` has no meaning, is too long for a recording, or too
        narrow to take companions apart.
    """
    crowd = Crowd.of(tracks)
    return crowd.moved(crowd.shifts(seed, minutes))


@dataclass(frozen=True, eq=False)
class Crowd:
    """People whose tracks can be moved in time.

    Parameters
    ----------
    table : track table, sorted by person and time.
    person, tick : number of the person and tick of the clock, of each row.
    day : number of each person's day.
    first, period : of each day: first tick, and ticks of the circle (those recorded, and the seam).
    companions : pairs of people to be taken apart, shape (n, 2).
    """

    table: pd.DataFrame
    person: np.ndarray
    tick: np.ndarray
    day: np.ndarray
    first: np.ndarray
    period: np.ndarray
    companions: np.ndarray

    @classmethod
    def of(cls, tracks: pd.DataFrame) -> Crowd:
        """Everybody of a track table."""
        order, tick, _ = clock_index(tracks)
        table = tracks.iloc[order].reset_index(drop=True)
        days = pd.factorize(table["day"], sort=True)[0]
        person, begins = number_people(days, table["id"].to_numpy())
        begun = np.flatnonzero(np.r_[True, days[1:] != days[:-1]])
        first = np.minimum.reduceat(tick, begun)
        period = np.maximum.reduceat(tick, begun) - first + 2
        return cls(table, person, tick, days[begins], first, period, _companions(table, person, days, tick))

    def near(self, square: Area, duration: float) -> Crowd:
        """Only the rows that `find_encounters` can depend on, whatever the shifts."""
        x, y = self.table["x"].to_numpy(), self.table["y"].to_numpy()
        kept = may_matter(x, y, self.person, square, duration)
        stage = funnels.stage("near the square", len(kept), kept.sum(), {"elsewhere": (~kept).sum()})
        table = funnels.attach(self.table[kept].reset_index(drop=True), [stage])
        return replace(self, table=table, person=self.person[kept], tick=self.tick[kept])

    def shifts(self, seed: int | Sequence[int], minutes: tuple[float, float]) -> np.ndarray:
        """A shift for each person [ticks], with companions taken apart; errors as in `time_shifted`."""
        low, high = (float(m) for m in minutes)
        if not (1 / _MINUTE <= low <= high < np.inf):
            raise DataError(f"minutes must be (shortest, longest), both positive; got {minutes}")
        recorded = (self.period - 1) / _MINUTE
        if (short := recorded < low + high).any():
            lasts = float(recorded[short].min())
            raise DataError(
                f"a day was recorded for {lasts:.1f} min, too short for shifts of up to {high:g} min: around "
                f"its circle they would come back to less than {low:g} min; pass shorter ones, such as "
                f"minutes=({lasts / 20:.2g}, {lasts / 3:.2g})"
            )
        rng = np.random.default_rng(seed)

        def draw(people: int) -> np.ndarray:
            """Shifts of so many people, earlier or later by `minutes` [ticks]."""
            ticks = rng.integers(round(low * _MINUTE), round(high * _MINUTE), people, endpoint=True)
            return np.asarray(ticks * rng.choice([-1, 1], people))

        shift = draw(len(self.day))
        one, other = self.companions.T
        around = self.period[self.day[one]]
        for _ in range(_ROUNDS):
            apart = (shift[one] - shift[other]) % around
            alike = np.minimum(apart, around - apart) < APART * TICKS_PER_SECOND
            if not alike.any():
                return shift
            again = np.unique(other[alike])
            shift[again] = draw(len(again))
        raise DataError(
            f"with shifts of {low:g} to {high:g} min, {int(alike.sum())} pairs of companions could not be "
            f"taken {APART:g} s apart; pass a wider range of minutes"
        )

    def moved(self, shift: np.ndarray) -> pd.DataFrame:
        """The track table with each person moved by so many ticks around the circle."""
        first, period = (each[self.day[self.person]] for each in (self.first, self.period))
        turns, since = np.divmod(self.tick - first + shift[self.person], period)
        kept = np.flatnonzero(since < period - 1)
        order = kept[np.lexsort((since[kept], self.person[kept]))]
        table = self.table.iloc[order].reset_index(drop=True)
        table["t"] = (first + since)[order] / TICKS_PER_SECOND
        across = (self.person[1:] == self.person[:-1]) & (turns[1:] != turns[:-1])
        cut = np.isin(self.person[order], self.person[1:][across])
        if cut.any():  # half a second to either side of the seam, velocity is that of a piece's end
            raw = table.loc[cut, ["day", "id", "t", "x", "y"]]
            raw.attrs.clear()
            table.loc[cut, ["vx", "vy"]] = to_clock(raw, max_gap=1.5 / TICKS_PER_SECOND)[
                ["vx", "vy"]
            ].to_numpy()
        lost = {"on the seam of the day": len(since) - len(kept)}
        stage = funnels.stage("time shifted: ticks", len(since), len(kept), lost)
        return funnels.attach(table, [*funnels.get(self.table), stage])


def _companions(table: pd.DataFrame, person: np.ndarray, days: np.ndarray, tick: np.ndarray) -> np.ndarray:
    """Pairs of people who were within `NEAR` of each other for `TOGETHER` seconds or more; (n, 2)."""
    whole = np.flatnonzero(tick % TICKS_PER_SECOND == 0)
    second = tick[whole] // TICKS_PER_SECOND
    moment = np.unique(np.column_stack([days[whole], second]), axis=0, return_inverse=True)[1].ravel()
    where = table[["x", "y"]].to_numpy(float)[whole]
    points = np.column_stack([where, 2 * NEAR * moment])  # people of two moments are never near
    pairs = np.sort(person[whole][cKDTree(points).query_pairs(NEAR, output_type="ndarray")], axis=1)
    pairs, seconds = np.unique(pairs, axis=0, return_counts=True)
    return np.asarray(pairs[seconds >= TOGETHER])

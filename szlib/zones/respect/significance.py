"""Is it respect at all?  The data tested against its null model.

Under the null hypothesis, that nobody minds anybody, the data is one more time-shifted day.  So a statistic
of the data has any rank among those of the shifts, and

    p = (1 + shifts with a statistic at least as large) / (1 + shifts)

is a valid p-value, whatever the statistic (Davison & Hinkley, "Bootstrap methods", 1997, sec. 4.2).
The statistic asks whether too few come near: of the encounters that come within r_max at all, a share F(R)
comes within R where nobody minds, and k of n did.  It is the largest signed root of the likelihood ratio of
k / n against F(R) over radii R from 0.2 to 1.5 m, positive where k / n < F(R).  F is that of data and shifts
together, so that data and shifts are treated alike.
"""

from __future__ import annotations

import warnings
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import xlogy

from ...encounters.kinds import COMPANIONS
from ...encounters.null import NullEncounters
from ...errors import DataWarning, ZoneError
from ...tracks.clock import check_columns
from .boundary import respect_radius
from .presence import Presence

RADII = np.arange(0.2, 1.5 + 1e-9, 0.05)
"""Within which too few may come [m]; none of them needs to be the zone's."""
SIGNIFICANT = 0.05

_EXPECTED = 30
"""A kind of encounter expected more often, and never seen, was filtered out on one side only."""


@dataclass(frozen=True)
class NullTest:
    """Whether people keep out of each other's way more than the null model does.

    Parameters
    ----------
    p_value : of the one-sided test (see the module).
    statistic, null_statistics : of the data, and of each shift.
    encounters : of the data, within r_max.
    radius, null_radii : respect zone of the data, and of each shift against all others (or none was asked
        for), all bearings [m].
    beyond : encounters nearer than that were left out [m].
    """

    p_value: float
    statistic: float
    null_statistics: tuple[float, ...] = field(repr=False)
    encounters: int
    radius: float
    null_radii: tuple[float, ...] = field(repr=False)
    beyond: float = 0.0

    @property
    def shifts(self) -> int:
        """How many null models the data was compared with."""
        return len(self.null_statistics)

    @property
    def respect(self) -> bool:
        """Whether respect was found: p <= 0.05."""
        return self.p_value <= SIGNIFICANT

    def record(self) -> dict[str, Any]:
        """All of it, as JSON values."""
        return asdict(self)

    @classmethod
    def from_record(cls, record: dict[str, Any]) -> NullTest:
        """What `record` has kept; raises ZoneError where it is damaged."""
        try:
            lists = {name: tuple(map(float, record[name])) for name in ("null_statistics", "null_radii")}
            return cls(**{**record, **lists})
        except (KeyError, TypeError, ValueError) as error:
            raise ZoneError(f"no record of a test against the null ({error!r}); test it again") from error

    def __str__(self) -> str:
        found = "respect" if self.respect else "no respect shown"
        return f"{found}: p = {self.p_value:.3g} ({self.shifts} shifts, {self.encounters} encounters)"


def null_test(
    samples: pd.DataFrame, null: NullEncounters, *, beyond: float = 0.0, radii: bool = True
) -> NullTest:
    """Test whether people keep out of each other's way, one-sided (see the module).

    Leave out companions, and best also those who walk in the same direction
    (``kinds=("opposite", "crossing")``), in data and null alike: who comes in a bunch walks alike without any
    respect, and condition 3 (1 m at the opening) then keeps them apart.

    Parameters
    ----------
    samples : as from `szlib.find_encounters`.
    null : of the same tracks, found with the same parameters, of the same kinds.
    beyond : leave out encounters that came nearer than that [m]: 0.5 asks for more than that two bodies
        cannot be in one place.
    radii : whether to fit the zone of each shift as well, which takes longest.

    Raises
    ------
    DataError : the samples lack a column or are empty.
    ZoneError : no encounter of the data, or of the null, came within r_max.
    """
    check_columns(samples, ["encounter", "los_angle", "distance", "speed"])
    _warn_of_kinds(samples, null)
    nearest = samples.groupby("encounter", observed=True)["distance"].min().to_numpy(float)
    of_null = null.encounters["nearest"].to_numpy(float)
    counted = [(each >= beyond) & (each < null.r_max) for each in (nearest, of_null)]
    if not all(each.any() for each in counted):
        raise ZoneError(
            f"{counted[0].sum()} encounters of the data and {counted[1].sum()} of the null model came within "
            f"{beyond:g} to {null.r_max:g} m: nothing to test; more data, or more shifts, is needed"
        )
    shift = np.r_[np.zeros(counted[0].sum(), int), 1 + null.encounters["shift"].to_numpy()[counted[1]]]
    within = np.r_[nearest[counted[0]], of_null[counted[1]]][:, None] < RADII
    n = np.bincount(shift, minlength=1 + null.shifts)
    k = np.stack([np.bincount(shift, column, minlength=1 + null.shifts) for column in within.T], axis=1)
    statistics = _too_few(k, n)
    return NullTest(
        p_value=float((1 + (statistics[1:] >= statistics[0]).sum()) / (1 + null.shifts)),
        statistic=float(statistics[0]),
        null_statistics=tuple(map(float, statistics[1:])),
        encounters=int(n[0]),
        radius=respect_radius(samples, null),
        null_radii=_null_radii(null) if radii else (),
        beyond=float(beyond),
    )


def _too_few(k: NDArray[Any], n: NDArray[Any]) -> NDArray[np.float64]:
    """Largest signed root of the likelihood ratio, by row: k (rows, radii) of n (rows,) came within each."""
    expected = k.sum(axis=0) / n.sum()
    share = k / np.maximum(n, 1)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = xlogy(k, share / expected) + xlogy(n[:, None] - k, (1 - share) / (1 - expected))
    ratio = np.where((expected > 0) & (expected < 1), ratio, 0.0)
    return np.asarray((np.sign(expected - share) * np.sqrt(2 * np.maximum(ratio, 0))).max(axis=1))


def _null_radii(null: NullEncounters) -> tuple[float, ...]:
    """Respect zone of each shift against all others [m]; NaN where nothing of it can be compared."""
    everybody = Presence.of(null.samples, r_max=null.r_max)
    radii = []
    for shift in range(null.shifts):
        samples = null.one(shift)
        own = Presence.of(samples, r_max=null.r_max) if len(samples) else None
        others = None if own is None else Presence(everybody.counts - own.counts, null.r_max)
        if own is None or others is None or not others.counts.any():
            radii.append(float("nan"))
        else:
            radii.append(respect_radius(own, others))
    return tuple(radii)


def _warn_of_kinds(samples: pd.DataFrame, null: NullEncounters) -> None:
    """Warn where a kind of encounter was left out on one side only; companions, the null model may lack."""
    if "kind" not in samples or "kind" not in null.encounters:
        return
    data = samples.drop_duplicates("encounter")["kind"].value_counts()
    model = null.encounters["kind"].value_counts()
    for here, there, name in ((data, model, "the data has"), (model, data, "the null model has")):
        expected = there * here.sum() / max(there.sum(), 1)
        for kind in expected.index[expected > _EXPECTED]:
            if here.get(kind, 0) == 0 and (here is data or kind != COMPANIONS):
                warnings.warn(
                    f"{name} no encounter of the kind {kind!r}, {expected[kind]:.0f} were expected; treat "
                    "both alike: szlib.of_kind(samples, kinds) and null.of_kind(kinds)",
                    DataWarning,
                    stacklevel=3,
                )

"""Is it respect at all?  The data tested against its null model.

Under the null hypothesis, that nobody minds anybody, the data is one more time-shifted day.  So a statistic
of the data has any rank among those of the shifts, and

    p = (1 + shifts with a statistic at least as large) / (1 + shifts)

is a valid p-value, whatever the statistic (Davison & Hinkley, "Bootstrap methods", 1997, sec. 4.2).
The statistic asks whether too few come near: of the encounters *of a kind* that come within r_max at all, a
share F(R), of data and shifts together, comes within R. It is by how many standard deviations fewer came
than that makes expect, all kinds added up (Mantel & Haenszel, J. Nat. Cancer Inst. 22, 1959), the largest
over radii R from 0.2 to 1.5 m.

Kind by kind, because shifts in time undo more than respect. Who comes in a bunch, as from a train, walks the
same way as the rest of it without minding anybody, and kept apart by condition 3 (1 m at the opening);
shifted alone they meet people who cross instead, and nearer. All kinds in one, that mix looked like respect
in 17 of 100 made crowds, kind by kind in 1 (notebook 15).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..checks import check_columns
from ..encounters.kinds import COMPANIONS
from ..encounters.null_model import NullEncounters
from ..errors import DataWarning, ZoneError
from .occupancy import OccupancyHistogram
from .respect import respect_radius

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

    Each kind of encounter is compared with its like; without a column kind all are of one.  A kind that the
    null model has none of (companions, who are taken apart) does not count.

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
    near = np.r_[nearest[counted[0]], of_null[counted[1]]][:, None] < RADII
    kind = _kinds(samples, null, counted)
    statistics = _too_few(shift, near, kind, 1 + null.shifts)
    return NullTest(
        p_value=float((1 + (statistics[1:] >= statistics[0]).sum()) / (1 + null.shifts)),
        statistic=float(statistics[0]),
        null_statistics=tuple(map(float, statistics[1:])),
        encounters=int(counted[0].sum()),
        radius=respect_radius(samples, null),
        null_radii=_null_radii(null) if radii else (),
        beyond=float(beyond),
    )


def _kinds(
    samples: pd.DataFrame, null: NullEncounters, counted: Sequence[NDArray[np.bool_]]
) -> NDArray[np.intp]:
    """Number of the kind of each encounter counted, the data's and then the null's; all 0 where unknown."""
    if not ("kind" in samples and "kind" in null.encounters):
        return np.zeros(sum(int(each.sum()) for each in counted), int)
    of_data = samples.groupby("encounter", observed=True)["kind"].first()
    both = zip((of_data, null.encounters["kind"]), counted, strict=True)
    return pd.factorize(
        np.concatenate([each.to_numpy(object)[kept] for each, kept in both]), use_na_sentinel=False
    )[0]


def _too_few(
    shift: NDArray[np.intp], near: NDArray[np.bool_], kind: NDArray[np.intp], shifts: int
) -> NDArray[np.float64]:
    """By how many standard deviations too few encounters of each shift are near (n, radii), at most.

    Expected of each kind is the share of all shifts together, drawn without replacement.
    """
    missed = variance = np.zeros((shifts, near.shape[1]))
    for each in range(kind.max() + 1):
        there = kind == each
        n = np.bincount(shift[there], minlength=shifts)[:, None]
        k = np.stack([np.bincount(shift[there], c, minlength=shifts) for c in near[there].T], axis=1)
        total = n.sum()
        share = k.sum(axis=0) / total
        missed = missed + n * share - k
        variance = variance + n * share * (1 - share) * (total - n) / max(total - 1, 1)
    deviations = np.divide(missed, np.sqrt(variance), out=np.zeros_like(missed), where=variance > 0)
    return np.asarray(deviations.max(axis=1))


def _null_radii(null: NullEncounters) -> tuple[float, ...]:
    """Respect zone of each shift against all others [m]; NaN where nothing of it can be compared."""
    everybody = OccupancyHistogram.from_samples(null.samples, r_max=null.r_max)
    radii = []
    for shift in range(null.shifts):
        samples = null.one(shift)
        own = OccupancyHistogram.from_samples(samples, r_max=null.r_max) if len(samples) else None
        others = None if own is None else OccupancyHistogram(everybody.counts - own.counts, null.r_max)
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

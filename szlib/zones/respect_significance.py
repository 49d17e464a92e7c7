"""Is it respect at all: the test of the data against its null model.

Under the null hypothesis, people ignore each other, and the data is one more time-shifted day. So a
statistic of the data has any rank among those of the shifts with the same probability, and

    p = (1 + shifts with a statistic at least as large) / (1 + shifts)

is a valid p-value for any statistic (Davison & Hinkley, "Bootstrap methods", 1997, sec. 4.2).

The statistic measures whether too few people come near. For each *kind* of encounter, let F(R) be the share
of the encounters within r_max that come within R, pooled over data and shifts. The statistic counts by how
many standard deviations the number of encounters within R is smaller than F(R) predicts, summed over all
kinds (Mantel & Haenszel, J. Nat. Cancer Inst. 22, 1959). It is the largest value over radii R from 0.2 to
1.5 m.

Kinds are separate because a shift in time removes more than respect. People who come in a group, as from a
train, walk in the same direction as the rest of it, and condition 3 (1 m at the opening) keeps them apart
without any respect. Shifted alone, they meet people who cross, and these come nearer. With all kinds pooled,
this mix looked like respect in 17 of 100 simulated crowds; with separate kinds in 1 (notebook 06).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.errors import DataError, ZoneError, warn
from ..encounters.kinds import COMPANIONS
from ..encounters.null_model import NullEncounters
from ..encounters.sensors import SensorCheck
from .estimators import Estimator
from .respect_profile import Approaches, RespectRadius, fit_radius

# Radii of the statistic [m]; the radius of the zone need not be among them.
RADII = np.arange(0.2, 1.5 + 1e-9, 0.05)
SIGNIFICANCE_LEVEL = 0.05
# zones fitted to the null model, and most encounters of each
_NULL_DRAWS, _MAX_DRAWN = (5, 1000)

# A kind that is expected more often than this and is missing was filtered out on one side only.
_MIN_EXPECTED = 30


@dataclass(frozen=True)
class NullTest:
    """The result of the test of the data against its null model.

    Parameters
    ----------
    p_value : of the one-sided test (see the top of this module).
    statistic, null_statistics : of the data, and of each shift.
    n_encounters : of the data, within r_max.
    respect : the radius of the respect zone of the data, all directions pooled.
    excluded_below : encounters nearer than this were left out [m].
    sensor : what the data says about the sensor; None: not looked at.
    p_beyond : p-value of the encounters beyond the distance that the sensor resolves, where it loses people.
    null_radius : the largest radius that the same fit gives one of some shifts against the others [m].
    grouped : share of the people who walk with somebody, where the null model moved each of them alone.

    Examples
    --------
    >>> import szlib
    >>> radius = szlib.RespectRadius(0.0, 0.0, 0.3, careless=0.1, careless_high=0.2)
    >>> result = szlib.NullTest(0.25, 0.4, (0.1, 0.6, 0.2), n_encounters=50, respect=radius)
    >>> result.is_significant
    False
    >>> print(result)
    no respect shown (p = 0.25, 3 shifts, 50 encounters)
    """

    p_value: float
    statistic: float
    null_statistics: tuple[float, ...] = field(repr=False)
    n_encounters: int
    respect: RespectRadius
    excluded_below: float = 0.0
    sensor: SensorCheck | None = None
    p_beyond: float | None = None
    null_radius: float = 0.0
    grouped: float = 0.0

    @property
    def n_shifts(self) -> int:
        """Number of null models that the data was compared with."""
        return len(self.null_statistics)

    @property
    def is_significant(self) -> bool:
        """Whether the data shows respect: p <= 0.05."""
        return self.p_value <= SIGNIFICANCE_LEVEL

    def __str__(self) -> str:
        result = (
            "people avoid each other" if self.is_significant else "no respect shown"
        )
        return f"{result} (p = {self.p_value:.2g}, {self.n_shifts} shifts, {self.n_encounters:,} encounters)"


def null_test(
    samples: pd.DataFrame, null: NullEncounters, *, excluded_below: float = 0.0
) -> NullTest:
    """Test whether people keep away from each other, one-sided (see the top of this module).

    Each kind of encounter is compared with the same kind of the null model; without a column `kind`, all
    encounters are of one kind. A kind that the null model does not have (companions) does not count.

    Parameters
    ----------
    samples : as from `szlib.find_encounters`.
    null : the null model of the same tracks, with the same parameters and kinds.
    excluded_below : leave out encounters nearer than this [m]. With 0.5, respect means more than that two
        bodies cannot be in one place.

    Raises
    ------
    DataError : the samples lack a column or are empty.
    ZoneError : no encounter of the data, or of the null model, is within r_max.

    Warns
    -----
    DataWarning : one side lacks a kind of encounter that the other side has.

    Examples
    --------
    >>> import szlib
    >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> tracks = szlib.read_tracks(path)
    >>> null = szlib.null_encounters(tracks, shifts=3, minutes=(0.5, 2.0), progress=False)
    >>> test = szlib.null_test(szlib.find_encounters(tracks), null)
    >>> test.p_value >= 0.25  # the smallest possible value with 3 shifts
    True
    """
    _warn_about_kinds(samples, null)
    found = Approaches.of(samples, null, excluded_below=excluded_below)
    p_value, statistics = _compare(found)
    sensor, p_beyond = null.sensor, None
    if sensor is not None and sensor.loses_people:
        far = found.select(found.nearest >= sensor.resolved)
        p_beyond = _compare(far)[0] if (far.shift == 0).any() else 1.0
    return NullTest(
        p_value=p_value,
        statistic=float(statistics[0]),
        null_statistics=tuple(map(float, statistics[1:])),
        n_encounters=int((found.shift == 0).sum()),
        respect=fit_radius(found),
        excluded_below=float(excluded_below),
        sensor=sensor,
        p_beyond=p_beyond,
        null_radius=_fit_null_radius(found),
        grouped=float(null.parameters.get("grouped", 0.0)),
    )


def _compare(found: Approaches) -> tuple[float, NDArray[np.float64]]:
    """The p-value, and the statistics of the data and of each shift."""
    near = found.nearest[:, None] < RADII
    statistics = _find_deficits(found.shift, near, found.kind, 1 + found.n_shifts)
    p_value = (1 + (statistics[1:] >= statistics[0]).sum()) / (1 + found.n_shifts)
    return float(p_value), statistics


def _fit_null_radius(found: Approaches) -> float:
    """The largest low end of the radius that some shifts have, each against all others [m]; 0: none."""
    radii = [0.0]
    for k in range(1, 1 + min(_NULL_DRAWS, found.n_shifts - 1)):
        others = found.select(found.shift > 0)
        as_data = np.where(others.shift == k, 0, np.maximum(others.shift, 1))
        with suppress(ZoneError):  # no encounter of a kind of the others
            radii.append(fit_radius(replace(others, shift=as_data)).low)
    return max(radii)


def fit_null_radii(
    build: Callable[[pd.DataFrame], Estimator],
    null: NullEncounters,
    n_encounters: int,
    speeds: list[float],
    seed: int,
) -> dict[float, float]:
    """Find the mean radius of the zone that an estimator gives people who ignore each other.

    Parameters
    ----------
    build : makes the estimator from samples.
    null : the null model, of which encounters are drawn.
    n_encounters : number of encounters of the data. At most 1,000 are drawn: fewer have larger zones.
    speeds : speeds of the zones [m/s].
    seed : of the draws.

    Returns
    -------
    By speed, the largest of several draws [m]; NaN where none has a zone.
    """
    rng, known = np.random.default_rng(seed), null.samples["encounter"].unique()
    size, radii = (
        min(n_encounters, len(known), _MAX_DRAWN),
        np.full((_NULL_DRAWS, len(speeds)), np.nan),
    )
    for row in radii:
        drawn = null.samples["encounter"].isin(rng.choice(known, size, replace=False))
        with suppress(ZoneError, DataError):  # no zone: stays NaN
            estimator = build(null.samples[drawn])
            ellipses = estimator.refit(np.ones((1, len(estimator.encounters))), speeds)
            row[:] = np.sqrt(ellipses[0, :, 2] * ellipses[0, :, 3])
    return dict(zip(speeds, np.fmax.reduce(radii, axis=0).tolist(), strict=True))


def _find_deficits(
    shift: NDArray[np.intp],
    near: NDArray[np.bool_],
    kind: NDArray[np.intp],
    shifts: int,
) -> NDArray[np.float64]:
    """Largest deficit of near encounters over all radii, for each shift, in standard deviations.

    `near` (n, radii) says whether each encounter is within each radius. The expectation for each kind is the
    share of all shifts together, drawn without replacement.
    """
    deficit = variance = np.zeros((shifts, near.shape[1]))
    for each in range(kind.max() + 1):
        is_kind = kind == each
        n = np.bincount(shift[is_kind], minlength=shifts)[:, None]
        k = np.stack(
            [np.bincount(shift[is_kind], c, minlength=shifts) for c in near[is_kind].T],
            axis=1,
        )
        total = n.sum()
        share = k.sum(axis=0) / total
        deficit = deficit + n * share - k
        variance = variance + n * share * (1 - share) * (total - n) / max(total - 1, 1)
    deviations = np.divide(
        deficit, np.sqrt(variance), out=np.zeros_like(deficit), where=variance > 0
    )
    return np.asarray(deviations.max(axis=1))


def _warn_about_kinds(samples: pd.DataFrame, null: NullEncounters) -> None:
    """Warn if a kind of encounter was left out on one side only; the null model may lack companions."""
    if "kind" not in samples or "kind" not in null.encounters:
        return
    data = samples.drop_duplicates("encounter")["kind"].value_counts()
    model = null.encounters["kind"].value_counts()
    for here, there, name in (
        (data, model, "the data has"),
        (model, data, "the null model has"),
    ):
        expected = there * here.sum() / max(there.sum(), 1)
        for kind in expected.index[expected > _MIN_EXPECTED]:
            if here.get(kind, 0) == 0 and (here is data or kind != COMPANIONS):
                warn(
                    f"{name} no encounter of the kind {kind!r}, {expected[kind]:.0f} were expected; select "
                    "the same kinds on both sides: szlib.of_kind(samples, kinds) and null.of_kind(kinds)",
                    3,
                )

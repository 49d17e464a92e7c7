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

The *radius* of the respect zone, all directions pooled, comes from the nearest approach r of each encounter.
Its likelihood is that of the ellipse (`szlib.zones.respect`), with h = r - R:

    p(r | k) = N_k(r) g(r - R) / sum over r of N_k g

R is the distance at which careful people are half as frequent as in the null model, but for those who step
aside and are seen just outside (A and c). Without them, people who swerve around a circle of 0.8 m seemed to
keep 0.74 m. The likelihood is computed for *all* R and the rest of a fine grid, so the best one is not missed
and needs no start; A has the prior of the ellipse. The interval holds every R with 2 (log L_max - log L)
below 3.84, with L the best over the rest: the 95 % quantile of chi square with one degree of freedom, times
1 + n/m for n encounters of the data and m of the null model. Because people differ from the model, it is at
least `_MODEL_ERROR` wide on both sides. It is meant to contain the true radius. In 30 crowds that swerve
around circles of 0.5, 0.8 and 1.0 m it does, and R is right to 1 cm; in 8 that keep circles by ORCA, whose
edge is sharp, it does, and R is up to 2 cm too small. Noise is not in the model, and the nearest of several
noisy distances is too near. So the radius comes from smoothed paths (`smooth_paths`). What is left of 5 cm
of noise at 10 Hz makes R 2 to 3 cm too small, of 10 cm 5 to 8 cm (9 and 15 cm without smoothing).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from itertools import permutations, product

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view
from scipy.special import expit
from scipy.stats import chi2

from ..core.checks import Array, check_columns
from ..core.errors import ZoneError, warn
from ..encounters.kinds import COMPANIONS
from ..encounters.null_model import NullEncounters
from ..encounters.sensor import SensorCheck
from .outliers import R_MAX, nearest_approaches, smooth_paths
from .respect_likelihood import EXCESS_PRIOR, respect_factor
from .verdict import MIN_SHIFTS, NO_RESPECT, SIGNIFICANCE

# Radii of the statistic [m]; the radius of the zone need not be among them.
RADII = np.arange(0.2, 1.5 + 1e-9, 0.05)
_NULL_DRAWS = 5  # shifts that are fitted as if they were data
# A kind that is expected more often than this and is missing was filtered out on one side only.
_MIN_EXPECTED = 30
# Softness of the edge w [m]; f, with a half and more there is no zone; A and c [m].
_SOFTNESS = np.array([0.005, 0.02, 0.06, 0.12, 0.25])
_IGNORING = np.array([0.0, *expit(np.linspace(-6, 4, 15))])
_EXCESS = [(0.0, 1.0), *product((0.3, 1.0, 4.0, 16.0), (0.02, 0.08, 0.2, 0.5))]
_MODEL_ERROR = 0.02  # [m]
_STEPS = 400  # in r_max; in these steps are:
_BIN = 5  # the width of a bin of r
_BETWEEN = 2  # the distance between two values of R
_FARTHEST = 320  # the end of R: beyond it people at a distance are hardly seen
_N_BINS = _STEPS // _BIN
_LEVEL = 0.95


def collect_approaches(
    samples: pd.DataFrame,
    null: NullEncounters,
    *,
    excluded_below: float = 0.0,
    smooth: bool = False,
) -> pd.DataFrame:
    """Collect the encounters of `samples` and `null` that came within `excluded_below` [m] to its r_max.

    With `smooth`, they are those on smoothed paths; of the null model, those whose samples are stored.

    Returns
    -------
    One row for each encounter: encounter; nearest [m]; shift, 0 for the data and from 1 on for the shifts;
    kind, a number. Without a column `kind` in `samples` and `null`, all encounters are of one kind.

    Raises
    ------
    DataError : the samples lack a column or are empty.
    ZoneError : no encounter of the data or of the null model came so near.
    """
    check_columns(samples, ["encounter", "los_angle", "distance", "speed"])

    def find_nearest(table: pd.DataFrame) -> pd.DataFrame:
        """The nearest approach of each encounter."""
        if smooth:
            table = table.assign(distance=smooth_paths(table)[1])
        return nearest_approaches(table).rename(columns={"distance": "nearest"})

    data = find_nearest(samples).assign(shift=-1)
    model = find_nearest(null.samples) if smooth else null.encounters
    both = pd.concat([data, model], join="inner", ignore_index=True)
    found = both[(both["nearest"] >= excluded_below) & (both["nearest"] < null.r_max)]
    n = (found["shift"] == -1).sum()
    n_null = len(found) - n
    if not (n and n_null):
        raise ZoneError(
            f"{n} encounters of the data and {n_null} of the null model came within {excluded_below:g} to "
            f"{null.r_max:g} m: nothing to test; add data, or more shifts"
        )
    kind = found.get("kind", pd.Series("", found.index)).astype(object)
    number = pd.factorize(kind, use_na_sentinel=False)[0]
    return found[["encounter", "nearest"]].assign(shift=1 + found["shift"], kind=number)


@dataclass(frozen=True)
class RespectRadius:
    """The radius of the respect zone, and the share of encounters of people who ignore others.

    Parameters
    ----------
    radius, low, high : R and its interval [m]; 0: no zone.
    careless, careless_high : share of the encounters in which a person enters the zone and ignores the other
        person, and the upper end of its interval.

    Examples
    --------
    >>> import szlib
    >>> print(szlib.RespectRadius(0.8, 0.75, 0.86, careless=0.01, careless_high=0.03))
    0.80 m (0.75 to 0.86 m)
    """

    radius: float
    low: float
    high: float
    careless: float
    careless_high: float

    def __str__(self) -> str:
        return f"{self.radius:.2f} m ({self.low:.2f} to {self.high:.2f} m)"


def fit_radius(approaches: pd.DataFrame, r_max: float = R_MAX) -> RespectRadius:
    """Fit the radius (see the top of this module) to `approaches` up to `r_max` [m]: `collect_approaches`."""
    step = r_max / _STEPS
    is_seen = np.arange(1.5, _N_BINS + 1) * _BIN * step > approaches["nearest"].min()
    strata = []  # histograms of data and null model, for each kind that both have
    for _, of_kind in approaches.groupby("kind"):
        is_real = of_kind["shift"] == 0
        real, null = (
            np.histogram(of_kind["nearest"][side], _N_BINS, (0, r_max))[0]
            for side in (is_real, ~is_real)
        )
        if real.any() and null.any():
            strata.append((real, null))
    if not strata:
        raise ZoneError(
            "no kind of encounter is in the data and in its null model as well: nothing to compare"
        )
    n, m = np.sum(strata, axis=(0, 2))
    # h = r - R has few values: what depends on it is computed once, and seen from each R
    radii = np.arange(0, _FARTHEST, _BETWEEN)[:, None, None] * step
    h = (np.arange(1 - _FARTHEST, _STEPS)[:, None, None] + _BIN / 2) * step
    mean, spread = EXCESS_PRIOR
    found = []  # by R, w and f
    for excess, reach in _EXCESS:
        factor, edge, *_ = respect_factor(
            h, _IGNORING, _SOFTNESS[:, None], excess, reach
        )
        # An empty bin of the data counts nothing, even where g is 0 (0 log 0 would be NaN).
        g, log_g, inside = (
            sliding_window_view(each, _STEPS, axis=0)[::-_BETWEEN, ..., ::_BIN]
            for each in (factor, np.log(factor + 1e-300), 1 - edge)
        )
        likelihood, careless = np.zeros((2, *g.shape[:-1]))
        if excess:
            likelihood -= ((np.log(excess) - mean) / spread) ** 2 / 2
        for real, null in strata:
            expected = (null + 1e-3 * m / _N_BINS) * is_seen
            total = g @ expected
            likelihood += log_g @ real - real.sum() * np.log(total / expected.sum())
            careless += _IGNORING * (inside @ expected) / total * real.sum() / n
        found.append((likelihood, careless))
    likelihood, careless = np.stack(found, axis=1)
    is_likely = 2 * (likelihood.max() - likelihood) <= chi2.ppf(_LEVEL, 1) * (1 + n / m)
    every = np.broadcast_to(radii * (_IGNORING < 0.5), likelihood.shape)
    best = likelihood.argmax()
    at = every.flat[best]
    likely = every[is_likely]
    low = min(likely.min(), max(at - _MODEL_ERROR, 0.0))
    high = max(likely.max(), at + _MODEL_ERROR)
    radius, low, high = np.round([at, low, high], 2).tolist()
    return RespectRadius(
        radius,
        low,
        high,
        careless=float(careless.flat[best]),
        careless_high=float(careless[is_likely].max()),
    )


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

    Examples
    --------
    >>> import szlib
    >>> radius = szlib.RespectRadius(0.0, 0.0, 0.3, careless=0.1, careless_high=0.2)
    >>> result = szlib.NullTest(0.25, 0.4, (0.1, 0.6, 0.2), n_encounters=50, respect=radius)
    >>> result.is_significant
    False
    >>> print(result)
    too few shifts to tell (p = 0.25, 3 shifts, 50 encounters)
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

    @property
    def n_shifts(self) -> int:
        """Number of null models that the data was compared with."""
        return len(self.null_statistics)

    @property
    def is_significant(self) -> bool:
        """Whether the data shows respect: p <= 0.05."""
        return self.p_value <= SIGNIFICANCE

    def __str__(self) -> str:
        finding = "people avoid each other" if self.is_significant else NO_RESPECT
        if self.n_shifts < MIN_SHIFTS:
            finding = "too few shifts to tell"
        return (
            f"{finding} "
            f"(p = {self.p_value:.2g}, {self.n_shifts} shifts, {self.n_encounters:,} encounters)"
        )


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
    found = collect_approaches(samples, null, excluded_below=excluded_below)
    p_value, (statistic, *null_statistics) = _compare(found, null.shifts)
    sensor = null.sensor
    p_beyond = None
    if sensor is not None and sensor.loses_people:
        far = found[found["nearest"] >= sensor.resolved]
        p_beyond = _compare(far, null.shifts)[0] if (far["shift"] == 0).any() else 1.0
    smoothed = collect_approaches(
        samples, null, excluded_below=excluded_below, smooth=True
    )
    return NullTest(
        p_value=p_value,
        statistic=statistic,
        null_statistics=tuple(null_statistics),
        n_encounters=int((found["shift"] == 0).sum()),
        respect=fit_radius(smoothed, null.r_max),
        excluded_below=excluded_below,
        sensor=sensor,
        p_beyond=p_beyond,
        null_radius=_fit_null_radius(smoothed, null),
    )


def _compare(found: pd.DataFrame, n_shifts: int) -> tuple[float, list[float]]:
    """The p-value, and the statistics of the data and of each shift."""
    statistics = _find_deficits(found, 1 + n_shifts)
    p_value = (1 + (statistics[1:] >= statistics[0]).sum()) / (1 + n_shifts)
    return float(p_value), statistics.tolist()


def _fit_null_radius(found: pd.DataFrame, null: NullEncounters) -> float:
    """The largest low end of the radius that some shifts have, each against all others [m]; 0: none."""
    radii = [0.0]
    others = found[found["shift"] > 0]
    for k in range(1, 1 + min(_NULL_DRAWS, null.shifts - 1)):
        as_data = others.assign(shift=others["shift"].where(others["shift"] != k, 0))
        with suppress(ZoneError):  # no encounter of a kind of the others
            radii.append(fit_radius(as_data, null.r_max).low)
    return max(radii)


def _find_deficits(found: pd.DataFrame, shifts: int) -> Array:
    """Largest deficit of near encounters over all radii, for each shift, in standard deviations.

    The expectation for each kind is the share of all shifts together, drawn without replacement.
    """
    bins = [np.arange(shifts + 1), np.array([0, *RADII, np.inf])]
    deficit = variance = np.zeros((shifts, len(RADII)))
    for _, of_kind in found.groupby("kind"):
        count = np.histogram2d(of_kind["shift"], of_kind["nearest"], bins)[0]
        within = count.cumsum(axis=1)
        k = within[:, :-1]
        n = within[:, -1:]
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
    counts = pd.DataFrame({"the data": data, "the null model": model}).fillna(0)
    for here, there in permutations(counts):
        expected = counts[there] * counts[here].sum() / counts[there].sum()
        for kind in counts.index[(counts[here] == 0) & (expected > _MIN_EXPECTED)]:
            if here == "the data" or kind != COMPANIONS:
                warn(
                    f"{here} has no encounter of the kind {kind!r}, {expected[kind]:.0f} were expected; "
                    "select the same kinds on both sides: szlib.of_kind(samples, kinds), null.of_kind(kinds)",
                    3,
                )

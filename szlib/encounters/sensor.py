"""What tracks say about the sensor that made them: the people it loses, its noise, and the ids it exchanges.

A tracker can fake respect: one that loses one of two people who come near each other leaves no pair nearer
than the distance that it resolves, as if they kept apart. It shows where tracks end and begin: in a merging
tracker most tracks that end inside the area do so beside somebody else. So at each distance the share of ends
with a stranger there is compared with the share of all samples.

Noise: a walking person's path is smooth. So the fourth difference of positions, at the rate of the sensor, is
mostly its error: of a variance 70 times that of a position. Where tracks were interpolated, only the ticks at
which they bend were measured. Below 5 Hz people turn between two samples, so the number is an upper bound.

Exchanged ids: after two people passed within 0.6 m, each goes on as the other did before.

Measured on crowds whose sensor is known (`tests/benchmarks/truth`): noise of 1, 5 and 10 cm, at 10 and
2.5 Hz, is found to 3 %. Where half of the pairs within 0.5 m have their ids exchanged, a third of those
within 0.6 m is found; of the 500 passes of crowds that walk straight on, or swerve, none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import beta, quantile_test

from .occupants import TrackRows

NEAR_END = 0.6
"""Distance at which somebody is near the end of a track, or passes close by [m]."""

_EDGES = np.r_[
    0, np.arange(0.2, 1.25, 0.1)
]  # of the distances at which ends are counted [m]
# A sound tracker has at most so many times as many ends as samples at a distance.
_MOST = 2.0
_FEWEST = 5  # ends that say something
_SMALL = 0.005  # level at which a distance counts as not resolved
_MOST_LAG = 20  # steps of the clock between two samples of the slowest sensor
_BENT = 1e-6  # a path that bends by less is interpolated [m]
_FEWEST_KNOTS = 10  # fourth differences of a person whose noise is measured
_SECOND = np.array([1, -2, 1])
_FOURTH = np.array([1, -4, 6, -4, 1])
BEFORE = 12
"""Steps of the clock before and after a pass at which velocities are compared."""

# Exchanged ids: the change of velocity of both people [m/s] that is more than a step aside.
_TURNED = 1.0
_LEFT_OVER = 0.5  # largest share of it that is left if the ids are exchanged back


@dataclass(frozen=True)
class SensorCheck:
    """What tracks say about the sensor, each number with its 95 % interval.

    Parameters
    ----------
    ends, samples : number of beginnings and ends of tracks inside the area, and of all samples there.
    ends_near, ends_low, ends_high : share of the ends with a stranger within 0.6 m, and its interval.
    samples_near : the same share of all samples.
    resolved : distance beyond which no more tracks end than elsewhere [m]; 0: at every distance.
    noise, noise_low, noise_high : standard error of a position [m], the median over people, and its interval;
        0: none was found.
    passes, exchanged : number of pairs of strangers who pass within 0.6 m, and of those whose ids look
        exchanged.

    Examples
    --------
    >>> from szlib.encounters import SensorCheck
    >>> SensorCheck(50, 9000, 0.6, 0.45, 0.73, 0.01, 0.5).loses_people
    True
    """

    ends: int
    samples: int
    ends_near: float
    ends_low: float
    ends_high: float
    samples_near: float
    resolved: float
    noise: float = 0.0
    noise_low: float = 0.0
    noise_high: float = 0.0
    passes: int = 0
    exchanged: int = 0

    @property
    def loses_people(self) -> bool:
        """Whether tracks end beside other people more often than chance explains."""
        return self.resolved > 0

    def __str__(self) -> str:
        ends = "no track ends inside the area"
        noise = "no error of positions was found"
        passes = f"no two people pass within {NEAR_END:g} m"
        if self.ends:
            ends = (
                f"{self.ends_near:.1%} ({self.ends_low:.1%} to {self.ends_high:.1%}) of {self.ends:,} ends "
                f"of tracks have somebody within {NEAR_END:g} m, and {self.samples_near:.1%} of all samples"
            )
        if self.noise:
            low = 100 * self.noise_low
            high = 100 * self.noise_high
            noise = f"a position errs by {100 * self.noise:.1f} cm ({low:.1f} to {high:.1f})"
        if self.passes:
            low, high = _interval_of_share(self.exchanged, self.passes)
            passes = (
                f"{self.exchanged:,} of {self.passes:,} pairs who pass within {NEAR_END:g} m "
                f"({low:.0%} to {high:.0%}) look exchanged"
            )
        return f"{ends}; {noise}; {passes}"


def count_ends(
    rows: TrackRows, inside: np.ndarray, pairs: np.ndarray
) -> dict[str, Any]:
    """Compare the ends of tracks with all samples: the fields of `SensorCheck` from ends to resolved.

    Parameters
    ----------
    rows : of the tracks, by person and time.
    inside : whether each of them is in the area.
    pairs : rows of two strangers at one moment who are near each other, shape (2, n).
    """
    breaks = np.diff(rows.piece) != 0
    recorded = (rows.tick > rows.tick.min() + 1) & (rows.tick < rows.tick.max() - 1)
    is_end = (np.r_[True, breaks] | np.r_[breaks, True]) & inside & recorded
    nearest = np.full(len(rows), np.inf)
    distance = rows.distance(*pairs)
    for each in pairs:
        np.minimum.at(nearest, each, distance)
    ends = nearest[is_end]
    samples = nearest[inside]
    n = len(ends)
    near, common = (np.histogram(d, _EDGES)[0] for d in (ends, samples))
    expected = common / max(len(samples), 1)
    least = beta.ppf(_SMALL, near, n - near + 1)
    is_lost = (near >= _FEWEST) & (least > _MOST * expected)
    resolved = float(_EDGES[1:][is_lost].max(initial=0.0))
    low, high = _interval_of_share(int((ends < NEAR_END).sum()), n)
    return {
        "ends": n,
        "samples": len(samples),
        "ends_near": _share(ends < NEAR_END),
        "ends_low": low,
        "ends_high": high,
        "samples_near": _share(samples < NEAR_END),
        "resolved": resolved,
    }


def measure_noise(rows: TrackRows, inside: np.ndarray) -> dict[str, Any]:
    """Measure the error of positions: the fields of `SensorCheck` that begin with noise.

    `rows` and `inside` are as in `count_ends`.
    """
    at = _same_piece(rows, np.arange(len(rows)), 1)
    bends = np.abs(_differences(rows, at, 1, _SECOND)) > _BENT
    lag = int(np.clip(np.rint(1 / max(_share(bends), 1e-9)), 1, _MOST_LAG))
    at = _same_piece(rows, at[bends], 2 * lag)
    at = at[inside[at]]
    variance = (
        np.abs(_differences(rows, at, lag, _FOURTH)) ** 2 / (_FOURTH**2).sum() / 2
    )
    of_person = pd.Series(variance).groupby(rows.person[at]).agg(["mean", "size"])
    is_measured = of_person["size"] >= _FEWEST_KNOTS
    errors = np.sqrt(of_person["mean"][is_measured])
    if len(errors) <= _FEWEST:
        return {}
    low, high = quantile_test(errors, p=0.5).confidence_interval(0.95)
    return {"noise": float(errors.median()), "noise_low": low, "noise_high": high}


def _same_piece(rows: TrackRows, at: np.ndarray, reach: int) -> np.ndarray:
    """Those rows `at` whose piece of track goes on for `reach` steps before and after them."""
    at = at[(at >= reach) & (at < len(rows) - reach)]
    return np.asarray(at[rows.piece[at - reach] == rows.piece[at + reach]])


def _differences(
    rows: TrackRows, at: np.ndarray, lag: int, weights: np.ndarray
) -> np.ndarray:
    """Differences of positions around the rows `at`, `lag` steps apart, with these `weights`."""
    steps = lag * (np.arange(len(weights)) - len(weights) // 2)
    return np.asarray(rows.place[at[:, None] + steps] @ weights)


def count_exchanged(before: np.ndarray, after: np.ndarray) -> int:
    """How many pairs go on as the other did; velocities `before` and `after` they pass, (2, n) [m/s]."""
    own, exchanged = (np.abs(after - v).sum(axis=0) for v in (before, before[::-1]))
    return int(((own > _TURNED) & (exchanged < _LEFT_OVER * own)).sum())


def _share(is_so: np.ndarray) -> float:
    """The share of those that are so; 0 of none."""
    return float(is_so.mean()) if len(is_so) else 0.0


def _interval_of_share(k: int, n: int) -> tuple[float, float]:
    """The 95 % interval of a share of which `k` of `n` were seen (Jeffreys)."""
    low, high = beta.ppf([0.025, 0.975], k + 0.5, n - k + 0.5)
    return float(low), float(high)

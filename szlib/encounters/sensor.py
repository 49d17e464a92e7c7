"""What tracks say about the sensor that made them: the people it loses, its noise, and the ids it exchanges.

A tracker can fake respect: one that loses one of two people who come near each other leaves no pair nearer
than the distance that it resolves, as if they kept apart. It shows where tracks end: most of them end where
somebody would come near within `AHEAD` seconds, if both walked on (and begin where somebody had come near).
So at each such distance the share of samples at which a track ends is compared with the share at all larger
distances. A tracker may lose people some time before they are near; so where they vanish is not resolved,
either.

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

from .occupants import TrackRows, find_neighbours

NEAR_END = 0.6
"""Distance within which somebody comes near the end of a track, or passes close by [m]."""

AHEAD = 2.0
"""Time for which two people are taken to walk on [s] (assumed)."""
_FARTHEST = 2.0  # approaches up to this are looked at [m]
_REACH = 6.0  # of people who may come so near within `AHEAD` [m]
# Of a sound tracker, the share of samples at which a track ends is at most _MOST times the share p beyond,
# and at most p + _MOST_LOST (1 - p). (Beyond 2 m, p is 1 % at the ATC mall and 5 % at Grand Central.)
_MOST = 2.0
_MOST_LOST = 0.05
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
    ends, samples : number of begins and ends of tracks inside the area, and of all samples there, one a
        second, each looked at backward and forward.
    ends_near, ends_low, ends_high : share of the ends at which a stranger would come within 0.6 m (see the
        top of this module), and its interval.
    samples_near : the same share of all samples.
    resolved : distance beyond which no more tracks end than elsewhere, at least 0.6 m; 0: at every distance.
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
        passes = (
            f"no two people pass within {NEAR_END:g} m: make sure that nothing removed people near "
            "others, or pushed them apart"
        )
        if self.ends:
            ends = (
                f"{self.ends_near:.1%} ({self.ends_low:.1%} to {self.ends_high:.1%}) of {self.ends:,} ends "
                f"of tracks are where somebody would come within {NEAR_END:g} m, and {self.samples_near:.1%} "
                "of all samples"
            )
        if self.noise:
            noise = (
                f"a position errs by {100 * self.noise:.1f} cm ({100 * self.noise_low:.1f} to "
                f"{100 * self.noise_high:.1f})"
            )
        if self.passes:
            low, high = _interval_of_share(self.exchanged, self.passes)
            passes = (
                f"{self.exchanged:,} of {self.passes:,} pairs who pass within {NEAR_END:g} m "
                f"({low:.0%} to {high:.0%}) look exchanged"
            )
        return f"{ends}; {noise}; {passes}"


def count_ends(
    rows: TrackRows, inside: np.ndarray, left: np.ndarray, unit: np.ndarray
) -> dict[str, Any]:
    """Compare the ends of tracks with all samples: the fields of `SensorCheck` from ends to resolved.

    Parameters
    ----------
    rows : of the tracks at whole seconds, by person and time.
    inside : whether each of them is in the area, and not at the begin or end of the recording.
    left : time from each of them to the begin, and to the end, of its track, shape (2, n) [s].
    unit : number of the unit of each person: only others are strangers.
    """
    is_end = inside & (np.abs(left) < 1)
    left = np.where(is_end, left, 0.0)
    approach = np.full(left.shape, np.inf)
    distance = approach.copy()
    for pairs in find_neighbours(rows.place, rows.moment, _REACH):
        own, others = unit[rows.person[pairs]]
        pairs = pairs[:, own != others]
        for side, begin in enumerate((-AHEAD, 0.0)):
            nearest = rows.approach(pairs, begin, begin + AHEAD)
            for one, other in (pairs, pairs[::-1]):
                np.minimum.at(approach[side], one, nearest)
                is_least = nearest == approach[side, one]
                least = np.stack([one, other])[:, is_least]
                then = left[side, least[0]]
                distance[side, least[0]] = rows.approach(least, then, then)
    ends = approach[is_end]
    samples = approach[:, inside].ravel()
    resolved = _find_excess(ends, samples, _FARTHEST)
    if resolved:
        lost = inside & (approach < resolved)
        resolved = max(
            resolved, _find_excess(distance[lost & is_end], distance[lost], _REACH)
        )
    low, high = _interval_of_share((ends < NEAR_END).sum(), len(ends))
    return {
        "ends": len(ends),
        "samples": len(samples),
        "ends_near": _share(ends < NEAR_END),
        "ends_low": low,
        "ends_high": high,
        "samples_near": _share(samples < NEAR_END),
        "resolved": resolved,
    }


def _find_excess(ends: np.ndarray, samples: np.ndarray, farthest: float) -> float:
    """Distance up to which more of the `samples` are `ends` than at larger ones [m]; 0: nowhere.

    Both are distances [m], of which those up to the `farthest` are looked at.
    """
    edges = np.r_[0.0, np.arange(NEAR_END, farthest + 0.05, 0.1)]
    near, common = (np.histogram(each, edges)[0] for each in (ends, samples))
    beyond = (len(ends) - near.cumsum() + 1) / (len(samples) - common.cumsum() + 1)
    most = np.minimum(_MOST * beyond, beyond + _MOST_LOST * (1 - beyond))
    is_more = beta.ppf(_SMALL, near, common - near + 1) > most
    return float(edges[1:][is_more & (near >= _FEWEST)].max(initial=0.0))


def measure_noise(rows: TrackRows, inside: np.ndarray) -> dict[str, Any]:
    """Measure the error of positions: the fields of `SensorCheck` that begin with noise.

    `rows` are those of the tracks, by person and time; `inside` says whether each of them is in the area.
    """
    every = np.arange(len(rows))
    bend = np.abs(rows.around(rows.place, every, np.arange(-1, 2)) @ _SECOND)
    share = _share(bend[np.isfinite(bend)] > _BENT)
    lag = int(np.clip(np.rint(1 / max(share, 1e-9)), 1, _MOST_LAG))
    at = np.flatnonzero(inside & (bend > _BENT))
    fourth = rows.around(rows.place, at, lag * np.arange(-2, 3)) @ _FOURTH
    variance = pd.Series(np.abs(fourth) ** 2 / (_FOURTH**2).sum() / 2)
    of_person = variance.groupby(rows.person[at]).agg(["mean", "count"])
    is_measured = of_person["count"] >= _FEWEST_KNOTS
    errors = np.sqrt(of_person["mean"][is_measured])
    if len(errors) <= _FEWEST:
        return {}
    # of the median, 95 %
    low, high = quantile_test(errors).confidence_interval()
    return {"noise": float(errors.median()), "noise_low": low, "noise_high": high}


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

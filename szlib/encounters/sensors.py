"""Whether the sensor loses people who are near each other: a tracker can fake respect.

A tracker that loses one of two people who come near each other leaves no pair nearer than the distance that
it resolves, as if they kept apart. It shows where tracks end and begin: in a merging tracker most tracks that
end inside the area do so beside somebody else. So at each distance the share of ends with a stranger there is
compared with the share of all samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

from .occupants import TrackRows

NEAR_END = 0.6
"""Distance at which somebody is near the end of a track [m]."""

_EDGES = np.arange(0.2, 1.25, 0.1)  # of the distances at which ends are counted [m]
_MOST = (
    2.0  # times as many ends as samples at a distance that a sound tracker has at most
)
_FEWEST = 5  # ends that say something
_SMALL = 0.005  # level at which a distance counts as not resolved


@dataclass(frozen=True)
class SensorCheck:
    """Ends of tracks inside the area beside somebody else, against all samples.

    Parameters
    ----------
    ends, samples : number of beginnings and ends of tracks inside the area, and of all samples there.
    ends_near, ends_low, ends_high : share of the ends with a stranger within 0.6 m, and its interval.
    samples_near : the same share of all samples.
    resolved : distance beyond which no more tracks end than elsewhere [m]; 0: at every distance.

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

    @property
    def loses_people(self) -> bool:
        """Whether tracks end beside other people more often than chance explains."""
        return self.resolved > 0

    def __str__(self) -> str:
        return (
            f"{self.ends_near:.1%} ({self.ends_low:.1%} to {self.ends_high:.1%}) of {self.ends:,} ends "
            f"of tracks have somebody within {NEAR_END:g} m, and {self.samples_near:.1%} of all samples"
        )


def check_sensor(
    rows: TrackRows, inside: np.ndarray, one: np.ndarray, other: np.ndarray
) -> SensorCheck:
    """Compare the ends of tracks with all samples.

    Parameters
    ----------
    rows : of the tracks, by person and time.
    inside : whether each of them is in the area.
    one, other : rows of two strangers at one moment who are near each other, shape (n,).
    """
    is_end = _find_ends(rows, inside)
    distance = np.hypot(rows.x[one] - rows.x[other], rows.y[one] - rows.y[other])
    nearest = np.full(len(rows), np.inf)
    np.minimum.at(nearest, one, distance)
    np.minimum.at(nearest, other, distance)
    ends, samples = nearest[is_end], nearest[inside]
    resolved = 0.0
    for low, high in zip(np.r_[0, _EDGES[:-1]], _EDGES, strict=True):
        k, n = int(((ends >= low) & (ends < high)).sum()), len(ends)
        expected = (
            float(((samples >= low) & (samples < high)).mean()) if len(samples) else 0.0
        )
        if k >= _FEWEST and beta.ppf(_SMALL, k, n - k + 1) > _MOST * expected:
            resolved = float(high)
    k, n = int((ends < NEAR_END).sum()), len(ends)
    low, high = beta.ppf([0.025, 0.975], [k + 0.5] * 2, [n - k + 0.5] * 2)
    near = float((samples < NEAR_END).mean()) if len(samples) else 0.0
    return SensorCheck(
        n, len(samples), k / max(n, 1), float(low), float(high), near, resolved
    )


def _find_ends(rows: TrackRows, inside: np.ndarray) -> NDArray[np.bool_]:
    """Whether a track begins or ends at each row inside the area, but for those cut by the recording."""
    breaks = (np.diff(rows.piece) != 0) | (np.diff(rows.tick) != 1)
    recorded = (rows.tick > rows.tick.min() + 1) & (rows.tick < rows.tick.max() - 1)
    return np.asarray((np.r_[True, breaks] | np.r_[breaks, True]) & inside & recorded)

"""The respect zone: the area where people are half as frequent as if they ignored each other.

Let R be the number of samples of the data, and N that of the null model (`szlib.null_encounters`), at
distance r and direction theta in the frame of the reference pedestrian. Up to a factor, the pair correlation
is

    g(r, theta) = R(r, theta) / N(r, theta)

The contour g = 1/2 bounds the zone. Places that are empty for other reasons are empty in N as in R, so only
respect remains. g is fitted, not binned, because a contour of bins depends on the bins and on chance:

    g(r, theta) = c(theta) [f + (1 - f) s((r - rho(theta)) / w)],      s(z) = 1 / (1 + exp(-z))
    rho(theta) = q0 / sqrt(1 + q1 cos theta + q2 sin theta + q3 cos 2 theta + q4 sin 2 theta)

rho is exactly an ellipse around the person, or nearly an ellipse off the centre. c is the plateau far out, f
the share of people who ignore others (intruders, companions), and w the softness of the edge. The fit
maximises the likelihood of each sample's distance, given its direction:

    p(r | theta) = N(r, theta) g(r, theta) / sum over r of N g

so c cancels: the number of encounters and their mix of directions do not matter, only the distances in each
direction. The contour is where g = c / 2. It does not depend on the number of encounters, because no
parameter is an extreme. It is 0 if people do not keep away: f is 1/2 or more, or there is no edge.

Few people do not determine the shape, so a penalty of 30 (q1^2 + ... + q4^2) on the log likelihood prefers
circles. It is negligible for tens of thousands of samples. (Measured on 72 encounters of Grand Central,
drawn 30 times: the radius ahead scatters by 0.20 m about 0.86 m, without the penalty by 0.31 m; all 4,176
give 0.86 m.)
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.special import expit, logit
from threadpoolctl import ThreadpoolController

from ..checks import Array, require
from ..encounters.null_model import NullEncounters
from ..errors import ZoneError
from ..tracks import funnels
from .estimators import Estimator
from .occupancy import OccupancyHistogram
from .outliers import encounter_numbers
from .polar import DIRECTIONS, PolarZone, fit_ellipses

SPEED_WIDTH = 0.2  # standard deviation of the Gaussian weight of samples at other speeds [m/s]

_N_WAVES = 4  # cos theta, sin theta, cos 2 theta, sin 2 theta
_MIN_SUM = 0.1  # of the sum under the root: no direction reaches farther than 3 q0
_PENALTY = 30.0  # weight of q1^2 + .. + q4^2, in samples
_STARTS = (0.15, 0.35, 0.55, 0.75)  # of rho, in r_max: the likelihood may have several peaks
_SOFTNESS_BOUNDS = (0.005, 0.15)  # of w, in r_max
_LOGIT_BOUND = 6.0  # of |logit f|
_MAX_LEFT_OUT = 20  # encounters that are left out one by one


@dataclass(frozen=True, eq=False)
class Respect:
    """The fitted pair correlation g (see the top of this module).

    Parameters
    ----------
    edge : q0 [m] and q1 to q4 of rho(theta); q0 alone if all directions are pooled.
    softness : w [m].
    ignoring_share : f, the share of people who ignore others.
    r_max : largest distance of the samples, and largest radius of the zone [m].

    Examples
    --------
    >>> import numpy as np
    >>> import szlib
    >>> szlib.Respect(edge=np.array([0.8]), softness=0.1, ignoring_share=0.0, r_max=2.0).radii(0.0).item()
    0.8
    """

    edge: Array
    softness: float
    ignoring_share: float
    r_max: float

    def radii(self, theta: ArrayLike) -> Array:
        """Distance at which g is half of its plateau, in the directions `theta` (...) [rad], same shape [m].

        It is 0 where people do not keep away, and at most `r_max`.
        """
        theta = np.asarray(theta, float)
        if self.ignoring_share >= 0.5:
            return np.zeros(theta.shape)
        half = self.softness * logit((0.5 - self.ignoring_share) / (1 - self.ignoring_share))
        rho, _ = _edge(_waves(theta, len(self.edge)), self.edge)
        return np.asarray(np.clip(rho + half, 0.0, self.r_max))


def fit_respect(
    samples: pd.DataFrame | OccupancyHistogram,
    null: NullEncounters | OccupancyHistogram,
    *,
    speed: float | None = None,
    speed_width: float = SPEED_WIDTH,
    pool_directions: bool = False,
) -> Respect:
    """Fit the pair correlation g to data and its null model.

    Parameters
    ----------
    samples : as from `szlib.find_encounters`, or an `OccupancyHistogram` (of weighted samples).
    null : the null model of the same tracks, with the same parameters and kinds; its `r_max` applies.
    speed : give samples a weight by their distance from this speed of the reference pedestrian [m/s]; None:
        equal weights.
    speed_width : standard deviation of this weight [m/s].
    pool_directions : whether to treat all directions as one.

    Raises
    ------
    ZoneError : there is no sample, or no null, within r_max (at about this speed).

    Examples
    --------
    >>> import szlib
    >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> tracks = szlib.read_tracks(path)
    >>> null = szlib.null_encounters(tracks, shifts=3, minutes=(0.5, 2.0), progress=False)
    >>> respect = szlib.fit_respect(szlib.find_encounters(tracks), null)
    >>> respect.radii([0.0, 3.14]).shape  # ahead and behind
    (2,)
    """
    against, data = null, samples
    if isinstance(against, NullEncounters):
        against = OccupancyHistogram.from_samples(against.samples, r_max=against.r_max)
    if isinstance(data, pd.DataFrame):
        data = OccupancyHistogram.from_samples(data, r_max=against.r_max)
    if data.r_max != against.r_max:
        raise ZoneError(f"data within {data.r_max} m, null within {against.r_max} m; expected the same r_max")
    real, model = (each.weighted_sum(speed, speed_width) for each in (data, against))
    if not (real.sum() > 0 and model.sum() > 0):
        where = f"within {against.r_max:g} m" + ("" if speed is None else f" at about {speed:g} m/s")
        raise ZoneError(
            f"{real.sum():g} samples of the data and {model.sum():g} of the null model {where}: nothing to "
            "compare; add data, use more shifts, or choose another speed"
        )
    if pool_directions:
        real, model = real.sum(axis=0, keepdims=True), model.sum(axis=0, keepdims=True)
    return _fit(real, model, against.r_max)


def respect_radius(
    samples: pd.DataFrame | OccupancyHistogram, null: NullEncounters | OccupancyHistogram
) -> float:
    """Compute the radius of the respect zone, all directions and speeds pooled [m].

    Parameters
    ----------
    samples, null : as in `fit_respect`; so are the errors.

    Examples
    --------
    >>> import szlib
    >>> path = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> tracks = szlib.read_tracks(path)
    >>> null = szlib.null_encounters(tracks, shifts=3, minutes=(0.5, 2.0), progress=False)
    >>> szlib.respect_radius(szlib.find_encounters(tracks), null) < null.r_max
    True
    """
    return float(fit_respect(samples, null, pool_directions=True).radii(0.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class RespectEstimator(Estimator):
    """The estimator of the respect zone at several speeds.

    Parameters
    ----------
    samples : within r_max of the null model.
    number : row in `encounters` of each sample, shape (n,).
    null : histogram of the null model.
    counts_by_shift : histogram of each shift of the null model, (shifts, speeds, directions, distances).
    speed_width : standard deviation of the weight of other speeds [m/s]; inf: equal weights.
    encounters, parameters, funnel : see `Estimator`.
    """

    samples: pd.DataFrame
    number: NDArray[np.intp]
    null: OccupancyHistogram
    counts_by_shift: NDArray[np.float32]
    speed_width: float

    @classmethod
    def from_samples(
        cls,
        samples: pd.DataFrame,
        *,
        r_max: float,
        null: NullEncounters | None = None,
        speed_width: float = SPEED_WIDTH,
    ) -> RespectEstimator:
        """Prepare samples and their null model.

        Parameters
        ----------
        samples : as from `szlib.find_encounters`.
        r_max : distance within which people count [m]; that of the null model.
        null : the null model.
        speed_width : standard deviation of the weight of other speeds [m/s]; inf: equal weights.

        Raises
        ------
        ZoneError : there is no null model, its `r_max` differs, or `speed_width` is not positive.
        """
        if null is None:
            raise ZoneError('method="respect" needs a null model; pass null=szlib.null_encounters(tracks)')
        if null.r_max != r_max:
            raise ZoneError(
                f"r_max is {r_max} m, that of the null model {null.r_max} m; pass the same to both"
            )
        expected = "positive, inf for equal weights [m/s]"
        require(speed_width > 0, "speed_width", speed_width, expected, ZoneError)
        is_near = samples["distance"] < r_max
        close = funnels.select(samples, is_near, "samples: close", f"farther than {r_max} m")
        histogram = OccupancyHistogram.from_samples(null.samples, r_max=r_max)
        counts = np.zeros((null.shifts, *histogram.counts.shape), np.float32)
        for k in null.samples["shift"].unique():
            counts[k] = OccupancyHistogram.from_samples(null.one(k), r_max=r_max).counts
        number, encounters = encounter_numbers(close)
        return cls(
            samples=close,
            number=number,
            null=histogram,
            counts_by_shift=counts,
            speed_width=float(speed_width),
            encounters=encounters,
            parameters={
                "speed_width": None if np.isinf(speed_width) else float(speed_width),
                "shifts": null.shifts,
                "null": null.parameters,
            },
            funnel=funnels.get(close),
        )

    def fit_shape(self, speeds: Sequence[float]) -> PolarZone:
        """Fit the radii at `speeds`, ascending [m/s]."""
        return PolarZone(np.array(speeds), DIRECTIONS, self._fit_radii(None, speeds, self.null))

    def refit(self, weights: Array, speeds: Sequence[float], rng: np.random.Generator | None = None) -> Array:
        """Fit ellipses to encounters with `weights` at `speeds`; `rng` resamples the shifts."""
        radii = np.full((len(weights), len(speeds), len(DIRECTIONS)), np.nan)
        for row, weight in zip(radii, weights, strict=True):
            null = self.null if rng is None else self._resample_null(rng)
            with suppress(ZoneError):
                row[:] = self._fit_radii(weight[self.number], speeds, null)
        return fit_ellipses(radii.reshape(-1, len(DIRECTIONS))).reshape(len(weights), len(speeds), 5)

    def find_influential(self, speeds: Sequence[float]) -> NDArray[np.intp]:
        """Row numbers of the encounters with the nearest approaches, whatever the `speeds`."""
        nearest = np.full(len(self.encounters), np.inf)
        np.minimum.at(nearest, self.number, self.samples["distance"].to_numpy(float))
        return np.argsort(nearest, kind="stable")[:_MAX_LEFT_OUT]

    def _resample_null(self, rng: np.random.Generator) -> OccupancyHistogram:
        """The null model of as many shifts, drawn with replacement."""
        n_shifts = len(self.counts_by_shift)
        drawn = rng.multinomial(n_shifts, np.full(n_shifts, 1 / n_shifts))
        counts = np.tensordot(drawn.astype(float), self.counts_by_shift, axes=1)
        return OccupancyHistogram(counts, self.null.r_max)

    def _fit_radii(self, weights: Array | None, speeds: Sequence[float], null: OccupancyHistogram) -> Array:
        """Radii (s, 72) [m] for weights (n,) of the samples and a null model."""
        data = OccupancyHistogram.from_samples(self.samples, r_max=self.null.r_max, weights=weights)
        distinct = speeds[:1] if np.isinf(self.speed_width) else speeds
        fits = [fit_respect(data, null, speed=v, speed_width=self.speed_width) for v in distinct]
        return np.broadcast_to([fit.radii(DIRECTIONS) for fit in fits], (len(speeds), len(DIRECTIONS)))


def _fit(real: Array, null: Array, r_max: float) -> Respect:
    """Maximise the likelihood of the distances, given the directions; both (directions, distances)."""
    directions, distances = real.shape
    theta = (np.arange(directions) + 0.5) * 2 * np.pi / directions
    r = (np.arange(distances) + 0.5) * r_max / distances
    size = 1 + (_N_WAVES if directions > 1 else 0)
    waves = _waves(theta, size)
    model = null + null.sum(axis=0) / null.sum()  # a pseudo-sample in every direction
    model /= model.sum(axis=1, keepdims=True)
    n_in_direction, n = real.sum(axis=1), real.sum()

    def cost(p: Array) -> tuple[float, Array]:
        """Negative log likelihood for each sample, with the penalty, and its gradient by p."""
        (rho, by_q), w, f = _edge(waves, p[:size]), np.exp(p[size]), expit(p[size + 1])
        z = (r - rho[:, None]) / w
        s = (1 + np.tanh(z / 2)) / 2  # several times as fast as expit
        g = f + (1 - f) * s
        total = np.einsum("ij,ij->i", model, g)
        by_g = (n_in_direction / total)[:, None] * model - real / g
        by_s = by_g * (1 - s)
        by_z = by_s * s * (1 - f)
        gradient = [by_q.T @ -by_z.sum(axis=1) / w, [-np.vdot(by_z, z)], [by_s.sum() * f * (1 - f)]]
        gradient[0][1:] += 2 * _PENALTY * p[1:size]
        likelihood = np.vdot(real, np.log(g)) - n_in_direction @ np.log(total)
        return float(_PENALTY * (p[1:size] ** 2).sum() - likelihood) / n, np.concatenate(gradient) / n

    bounds = [(-r_max / 4, 5 * r_max / 4)] + [(-1.0, 1.0)] * (size - 1)
    bounds += [tuple(np.log(np.multiply(_SOFTNESS_BOUNDS, r_max))), (-_LOGIT_BOUND, _LOGIT_BOUND)]
    starts = [np.r_[share * r_max, np.zeros(size - 1), np.log(0.05 * r_max), -4.0] for share in _STARTS]
    with _threads().limit(limits=1):  # many small products: on several threads they take ten times as long
        tries = [minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds) for start in starts]
    p = min(tries, key=lambda found: float(found.fun)).x
    return Respect(np.asarray(p[:size]), float(np.exp(p[size])), float(expit(p[size + 1])), r_max)


@cache
def _threads() -> ThreadpoolController:
    """The threads of the loaded libraries; cached, because finding them takes as long as one fit."""
    return ThreadpoolController()


def _waves(theta: Array, size: int) -> Array:
    """Factors of the coefficients of rho at `theta` (...), shape (..., size); 0 for the first."""
    turns = [wave(k * theta) for k in range(1, (size - 1) // 2 + 1) for wave in (np.cos, np.sin)]
    return np.stack([np.zeros_like(theta), *turns], axis=-1)


def _edge(waves: Array, q: Array) -> tuple[Array, Array]:
    """rho (...) [m] for waves (..., len(q)), and its derivatives by q (..., len(q))."""
    total = 1 + waves[..., 1:] @ q[1:]
    shape = np.maximum(total, _MIN_SUM) ** -0.5
    by_q = np.where(total > _MIN_SUM, -q[0] / 2 * shape**3, 0.0)[..., None] * waves
    by_q[..., 0] = shape
    return q[0] * shape, by_q

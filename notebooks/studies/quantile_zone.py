"""The quantile zone: where a share q of the encounters come nearer, in each direction. A description.

In each direction, the radius is the q-quantile of the nearest approaches there, over the encounters in which
a person was seen there. The hull shrinks as encounters are added; a quantile does not. People who ignore
others do not determine it, up to a share q of them. Paths are smoothed first: the nearest of several noisy
samples is too near, by 8 cm for a noise of 5 cm.

A radius that is estimated in each direction errs to both sides, and an ellipse around its largest errors would
be too large. So the ellipse is *fitted*: it minimises the sum over directions of (radius - its reach)^2.

Chapter 05 builds it in ten lines, chapter 25 asks how well it finds a known zone. Importing this module adds
the method "quantile", with the option `q`, to `szlib.SocialZone.fit`: so an estimator is added by one file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from szlib.core.checks import Array, check_columns, check_rows, require
from szlib.core.errors import ZoneError
from szlib.tracks import funnels
from szlib.zones.ellipses import DIRECTIONS, Ellipse, unit_vectors
from szlib.zones.estimators import Estimator
from szlib.zones.hulls import find_widest_gap, missing_directions_error
from szlib.zones.outliers import SMOOTHING, encounter_numbers, is_close, smooth_paths
from szlib.zones.social_zone import METHODS
from szlib.zones.uncertainty import SPEED_BAND

NAME = "quantile"  # of the method, in `SocialZone.fit`
QUANTILE = 0.05  # share q of the encounters that may enter the zone (assumed)
# Number of directions, 5 deg apart, over which the nearest approach is taken: 35 deg (assumed; 25 to 45 deg
# do as well).
SECTOR = 7
# Range of directions without data from which on there is no zone [rad]; the hull has the same limit.
WIDEST_GAP = np.pi

# of Levenberg and Marquardt; step relative to the mean radius
_MAX_ITERATIONS, _CONVERGED = (100, 1e-12)


@dataclass(frozen=True, eq=False)
class Approaches:
    """Where people were within r_max, on smoothed paths.

    Parameters
    ----------
    number : row in `encounters` of each sample, shape (n,).
    direction : index of the nearest of `DIRECTIONS`, shape (n,).
    distance : distance of the other person [m], shape (n,).
    speed : speed of the reference pedestrian [m/s], shape (n,).
    encounters : the first sample of each encounter.
    """

    number: NDArray[np.intp]
    direction: NDArray[np.intp]
    distance: Array
    speed: Array
    encounters: pd.DataFrame

    @classmethod
    def from_samples(cls, samples: pd.DataFrame, *, r_max: float) -> Approaches:
        """Find the approaches within `r_max` [m] in `samples` as from `szlib.find_encounters`.

        Raises DataError if columns are missing, a value is not finite, or no person was within r_max.
        """
        check_columns(samples, ["los_angle", "distance", "speed"])
        values = samples[["los_angle", "distance", "speed"]].to_numpy(float)
        is_finite = np.isfinite(values).all(axis=1)
        check_rows(
            samples,
            is_finite,
            ["los_angle", "distance", "speed"],
            "expected finite numbers",
        )
        angle, distance = smooth_paths(samples)
        close = is_close(distance, r_max)
        step = 2 * np.pi / len(DIRECTIONS)
        direction = np.rint((angle[close] - DIRECTIONS[0]) / step).astype(int) % len(DIRECTIONS)
        number, encounters = encounter_numbers(samples[close])
        return cls(number, direction, distance[close], values[close, 2], encounters)

    def nearest(self, speed: float) -> tuple[NDArray[np.intp], Array]:
        """The encounters (k,) at a `speed` [m/s] (+-`SPEED_BAND`), and their nearest approaches (k, 72) [m].

        Each approach is the nearest within `SECTOR` directions; it is inf if no person was seen there.
        """
        in_band = np.abs(self.speed - speed) <= SPEED_BAND
        encounters, row = np.unique(self.number[in_band], return_inverse=True)
        distances = np.full((len(encounters), len(DIRECTIONS)), np.inf)
        np.minimum.at(distances, (row, self.direction[in_band]), self.distance[in_band])
        turns = range(-(SECTOR // 2), SECTOR // 2 + 1)
        return encounters, np.minimum.reduce([np.roll(distances, turn, axis=1) for turn in turns])


def quantile_radii(approaches: Approaches, speed: float, q: float, weights: Array | None = None) -> Array:
    """Compute the radius in each direction that at least a share q of the encounters enter.

    Parameters
    ----------
    approaches : of all encounters.
    speed : speed of the reference pedestrian [m/s].
    q : share of the encounters.
    weights : weights of the encounters, shape (k, n), one row for each result; None: one result, equal
        weights.

    Returns
    -------
    Radii (k, 72) [m]; NaN where no person was seen.
    """
    encounters, nearest = approaches.nearest(speed)
    weights = np.ones((1, len(encounters))) if weights is None else weights[:, encounters]
    radii = np.full((len(weights), len(DIRECTIONS)), np.nan)
    order, is_seen = np.argsort(nearest, axis=0, kind="stable"), np.isfinite(nearest)
    needed = q * (weights @ is_seen) * (1 - 1e-12)
    for d, count in enumerate(is_seen.sum(axis=0)):
        if count:
            # the quantile lies among the first of them
            likely = int(q * count + 8 * np.sqrt(q * count) + 8)
            for first in (order[: min(likely, count), d], order[:count, d]):
                cumulated = np.cumsum(weights[:, first], axis=1)
                if (cumulated[:, -1] >= needed[:, d]).all():
                    break
            at = np.argmax(cumulated >= needed[:, d : d + 1], axis=1)
            radii[:, d] = np.where(needed[:, d] > 0, nearest[first[at], d], np.nan)
    return radii


@dataclass(frozen=True, eq=False, kw_only=True)
class QuantileEstimator(Estimator):
    """The estimator of the quantile zone.

    Parameters
    ----------
    approaches : of all encounters.
    q : share of the encounters that may enter the zone.
    encounters, parameters, funnel : see `Estimator`.

    Raises
    ------
    ZoneError : q is not in 0 < q < 1.
    """

    approaches: Approaches
    q: float

    def __post_init__(self) -> None:
        require(0 < self.q < 1, "q", self.q, "a share of encounters, 0 < q < 1", ZoneError)

    @classmethod
    def from_samples(cls, samples: pd.DataFrame, *, r_max: float, q: float = QUANTILE) -> QuantileEstimator:
        """Prepare `samples` within `r_max` [m] for a share `q`; errors as in `Approaches.from_samples`."""
        approaches = Approaches.from_samples(samples, r_max=r_max)
        entered, kept = len(encounter_numbers(samples)[1]), len(approaches.encounters)
        near = funnels.stage(
            "encounters: near",
            entered,
            kept,
            {f"never within {r_max} m": entered - kept},
        )
        sector = 360 * SECTOR / len(DIRECTIONS)
        assumed = {
            "sector_deg": sector,
            "speed_band": SPEED_BAND,
            "smoothing": SMOOTHING,
        }
        return cls(
            approaches=approaches,
            q=float(q),
            encounters=approaches.encounters,
            parameters={"q": float(q), **assumed},
            funnel=[*funnels.get(samples), near],
        )

    def fit_shape(self, speeds: Sequence[float]) -> PolarZone:
        """Fit the radii at `speeds`, ascending [m/s]."""
        radii = [quantile_radii(self.approaches, speed, self.q)[0] for speed in speeds]
        return PolarZone(np.array(speeds), DIRECTIONS, np.array(radii))

    def refit(self, weights: Array, speeds: Sequence[float]) -> Array:
        """Fit ellipses to encounters with `weights` at `speeds` (see `Estimator`)."""
        radii = np.stack(
            [quantile_radii(self.approaches, v, self.q, weights) for v in speeds],
            axis=1,
        )
        return fit_ellipses(fill_gaps(radii.reshape(-1, radii.shape[-1]))).reshape(*radii.shape[:2], 5)


@dataclass(frozen=True, eq=False)
class PolarZone:
    """Radii of a zone by speed and direction, in the frame of the reference pedestrian.

    Parameters
    ----------
    speeds : speeds of the reference pedestrian, ascending, shape (m,) [m/s].
    directions : counter-clockwise from ahead, ascending within [-pi, pi), shape (n,) [rad].
    radii : shape (m, n) [m]; NaN where no person was seen.

    Raises
    ------
    ZoneError : the shapes do not fit, a radius is negative, or speeds or directions do not ascend.

    Examples
    --------
    >>> import numpy as np
    >>> from studies.quantile_zone import PolarZone
    >>> directions = np.radians(np.arange(-180, 180, 5))
    >>> zone = PolarZone(speeds=[0.9, 1.1], directions=directions, radii=np.ones((2, 72)))
    >>> zone.ellipse(1.0).semi_axes
    (1.0, 1.0)
    """

    speeds: Array
    directions: Array
    radii: Array

    def __post_init__(self) -> None:
        for name in ("speeds", "directions", "radii"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), float))
        shape = (len(self.speeds), len(self.directions))
        if self.radii.shape != shape or 0 in shape:
            raise ZoneError(f"radii must have shape (speeds, directions) = {shape}; got {self.radii.shape}")
        for name, values in (("speeds", self.speeds), ("directions", self.directions)):
            if not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
                raise ZoneError(f"{name} of radii must be finite and ascend; got {values.tolist()}")
        if (self.radii < 0).any():
            raise ZoneError(f"radii must not be negative; got {np.nanmin(self.radii)} m")

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest fitted speed [m/s]."""
        return float(self.speeds[0]), float(self.speeds[-1])

    def radii_at(self, speed: float) -> Array:
        """Radii (n,) [m] at a `speed` [m/s], linear between fitted speeds; raises ZoneError outside."""
        low, high = self.speed_range
        if not low <= speed <= high:
            raise ZoneError(
                f"the zone at {speed:g} m/s is undefined: it was fitted for {low:g} to {high:g} m/s; "
                "fit it with this speed in `speeds`"
            )
        after = min(int(np.searchsorted(self.speeds, speed)), len(self.speeds) - 1)
        if self.speeds[after] == speed:
            return np.asarray(self.radii[after])
        share = (speed - self.speeds[after - 1]) / (self.speeds[after] - self.speeds[after - 1])
        return np.asarray((1 - share) * self.radii[after - 1] + share * self.radii[after])

    def boundary(self, speed: float, theta: ArrayLike) -> Array:
        """Boundary at a `speed` [m/s] in the directions `theta` (...) [rad], shape (..., 2) [m].

        It is linear between known directions and NaN where no person was seen.
        """
        directions = np.append(self.directions, self.directions[0] + 2 * np.pi)
        radii = np.append(self.radii_at(speed), self.radii_at(speed)[0])
        r = np.interp(
            np.subtract(theta, directions[0]) % (2 * np.pi) + directions[0],
            directions,
            radii,
        )
        return np.asarray(r[..., None] * unit_vectors(theta))

    def ellipse(self, speed: float) -> Ellipse:
        """The ellipse fitted at a `speed` [m/s]; raises ZoneError if too few directions have data."""
        radii = self.radii_at(speed)
        complete = fill_gaps(radii[None], self.directions)
        if np.isnan(complete).any():
            raise missing_directions_error(speed, self.directions[np.isfinite(radii)])
        m, n, a, b, angle = fit_ellipses(complete, self.directions)[0]
        if not b > 0:
            raise ZoneError(
                f"the zone at {speed:g} m/s is undefined: no ellipse around the person fits radii of "
                f"{radii.min():.2f} to {radii.max():.2f} m"
            )
        return Ellipse((m, n), (a, b), angle)


def fill_gaps(radii: Array, directions: Array = DIRECTIONS) -> Array:
    """Fill each gap (NaN) of `radii` (k, n) [m] linearly over `directions` (n,) [rad].

    A row is all NaN if its widest gap is `WIDEST_GAP` or more.
    """
    out = radii.copy()
    for row in np.flatnonzero(np.isnan(radii).any(axis=1)):
        has_data = np.isfinite(radii[row])
        low, high = find_widest_gap(directions[has_data])
        if high - low >= WIDEST_GAP:
            out[row] = np.nan
        else:
            out[row] = np.interp(directions, directions[has_data], radii[row, has_data], period=2 * np.pi)
    return out


def fit_ellipses(radii: Array, directions: Array = DIRECTIONS) -> Array:
    """Fit an ellipse to each row of radii by least squares in metres.

    Parameters
    ----------
    radii : shape (k, n) [m].
    directions : of the radii, shape (n,) [rad].

    Returns
    -------
    Ellipses (k, 5): centre m, n, semi-axes a >= b [m], angle in (-pi/2, pi/2] [rad]. NaN for rows that
    contain a NaN or that no ellipse around the person fits.
    """
    ellipses = np.full((len(radii), 5), np.nan)
    rows = np.flatnonzero(np.isfinite(radii).all(axis=1) & (radii.sum(axis=1) > 0))
    if not len(rows):
        return ellipses
    unit = unit_vectors(directions)
    scale = radii[rows].mean(axis=1)
    target = radii[rows] / scale[:, None]
    # m, n, and the root [[p, r], [r, s]] of the form
    p = np.tile([0.0, 0.0, 1.0, 0.0, 1.0], (len(rows), 1))
    damping = np.full(len(rows), 1e-3)
    residual, jacobian = _parametric_reach(p, unit)
    residual -= target
    active = np.arange(len(rows))
    for _ in range(_MAX_ITERATIONS):
        transposed = jacobian[active].transpose(0, 2, 1)
        normal = transposed @ jacobian[active]
        diagonal = np.einsum("kii->ki", normal)
        damped = normal + (damping[active, None] * diagonal)[:, :, None] * np.eye(5)
        step = -np.linalg.solve(damped, transposed @ residual[active, :, None])[..., 0]
        new_residual, new_jacobian = _parametric_reach(p[active] + step, unit)
        new_residual -= target[active]
        # NaN: False
        better = (new_residual**2).sum(axis=1) <= (residual[active] ** 2).sum(axis=1)
        p[active[better]] += step[better]
        residual[active[better]] = new_residual[better]
        jacobian[active[better]] = new_jacobian[better]
        damping[active] *= np.where(better, 0.1, 10)
        active = active[~(np.abs(step).max(axis=1) < _CONVERGED)]
        if not len(active):
            break
    root = p[:, [2, 3, 3, 4]].reshape(-1, 2, 2)
    values, vectors = np.linalg.eigh(root)
    values = np.abs(values)
    minor = np.argmax(values, axis=1)
    major = vectors[np.arange(len(rows)), :, 1 - minor]
    angle = np.pi / 2 - (np.pi / 2 - np.arctan2(major[:, 1], major[:, 0])) % np.pi
    axes = 1 / np.sort(values, axis=1)
    ellipses[rows] = np.column_stack([p[:, :2] * scale[:, None], axes * scale[:, None], angle])
    return ellipses


def _parametric_reach(p: Array, unit: Array) -> tuple[Array, Array]:
    """Reach t (k, n) of ellipses |L (t unit - centre)| = 1 and its slope (k, n, 5); NaN: origin outside."""
    root = p[:, [2, 3, 3, 4]].reshape(-1, 2, 2)
    along = np.einsum("kij,nj->kni", root, unit)
    start = -np.einsum("kij,kj->ki", root, p[:, :2])[:, None]
    a, b, c = (along**2).sum(-1), (along * start).sum(-1), (start**2).sum(-1) - 1
    with np.errstate(invalid="ignore"):
        t = np.where(c < 0, (np.sqrt(b * b - a * c) - b) / a, np.nan)
    w, d = t[..., None] * along + start, t[..., None] * unit - p[:, None, :2]
    slope = np.concatenate(
        [
            np.einsum("kij,knj->kni", root, w),
            -np.stack(
                [w[..., 0] * d[..., 0], w[..., 0] * d[..., 1] + w[..., 1] * d[..., 0]],
                axis=-1,
            ),
            -(w[..., 1] * d[..., 1])[..., None],
        ],
        axis=-1,
    )
    return t, slope / (w * along).sum(-1)[..., None]


METHODS[NAME] = (QuantileEstimator.from_samples, ("q",))

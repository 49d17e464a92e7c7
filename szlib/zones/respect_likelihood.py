"""The likelihood of the respect zone, and the posterior of its parameters: the formulas are in `respect`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import Bounds, minimize
from scipy.special import expit
from threadpoolctl import ThreadpoolController

from ..core.checks import Array, check_columns, check_rows
from ..encounters.kinds import WALKING
from .outliers import encounter_numbers, smooth_paths
from .sampling import Draws, sample

REFERENCE_SPEED = 1.1  # at which the parameters describe the ellipse [m/s]
# slower and faster people carry the ellipse of these speeds [m/s]
_SPEED_BOUNDS = (0.3, 2.0)
COLUMNS = [
    "encounter",
    "distance",
    "los_angle",
    "speed",
    "other_los_angle",
    "other_speed",
]
# Columns of each of the two people: direction of the other person, and speed; and their lowest speed [m/s].
# A person who stands has no direction of motion, and one of unknown velocity has none either.
_VIEWS = (("los_angle", "speed", 0.0), ("other_los_angle", "other_speed", WALKING))

EXCESS_PRIOR = (-3.0, 2.0)  # mean and standard deviation of log A
# Of each parameter: lowest and highest value, mean and standard deviation of its prior.
_PARAMETERS = [
    (-0.5, 0.5, 0.0, 0.15),  # centre ahead [m]
    (-0.5, 0.5, 0.0, 0.15),  # its change with speed
    (-0.3, 0.3, 0.0, 0.15),  # centre to the left [m]
    (*np.log([0.1, 1.9, 0.8]), 0.5),  # logarithm of the semi-axis along [m]
    (-0.6, 0.6, 0.0, 0.15),  # its change with speed
    (*np.log([0.1, 1.9, 0.8]), 0.5),  # logarithm of the semi-axis across [m]
    (-0.6, 0.6, 0.0, 0.15),  # its change with speed
    (-0.6, 0.6, 0.0, 0.15),  # shear
    (-6.0, 1.5, 0.0, np.inf),  # logit f
    (*np.log([0.005, 0.3, 1.0]), np.inf),  # log w [m]
    (-5.0, 3.0, *EXCESS_PRIOR),  # log A: at most 20 times as many as by chance
    (*np.log([0.01, 0.6, 1.0]), np.inf),  # log c [m]
]
_LOW, _HIGH, _MEAN, _SPREAD = np.transpose(_PARAMETERS)
_REPORTED = 9  # the ellipse, and the share f of careless people
# Spread of the first draws, as a share of the bounds: the data tells the ellipse better than f, w, A and c.
_FIRST_SPREAD = np.repeat([0.02, 0.15, 0.05], [8, 1, 3])
_ELONGATION = 0.4  # standard deviation of the logarithm of the ratio of the semi-axes
_NEWTON = 30  # most steps of its logarithm to the mean of g
_EXACT = 1e-5  # the last step
_BANK = 24  # ellipses that say which samples may be the nearest
_RADII = np.arange(0.2, 1.81, 0.1)  # of the circles from which the fit starts [m]
_STARTS = 3  # number of best circles tried
_START_GAP = 0.15  # least difference of their radii [m]
_BACK = (
    -0.15,
    -0.1,
    -0.05,
    0.05,
    0.1,
    0.15,
)  # moves of the centre, to look for another peak [m]
_GAIN = 0.5  # least gain in log density for which it is moved on


@dataclass(frozen=True, eq=False)
class PairPaths:
    """Where each person of each encounter was in the other's frame: the samples that may be the nearest.

    Parameters
    ----------
    x, y : position in the frame of the person who carries the ellipse, shape (n,) [m].
    speed : of that person, relative to `REFERENCE_SPEED`, shape (n,) [m/s].
    encounter : row of the encounter of each sample, ascending, shape (n,).
    kind : of each encounter, shape (k,).
    encounters : one row for each encounter.
    """

    x: Array
    y: Array
    speed: Array
    encounter: NDArray[np.intp]
    kind: NDArray[np.object_]
    encounters: pd.DataFrame

    @classmethod
    def from_samples(cls, samples: pd.DataFrame) -> PairPaths:
        """Prepare `samples` as from `szlib.find_encounters`.

        Raises DataError if a column is missing or a value is not finite.
        """
        check_columns(samples, COLUMNS)
        columns = COLUMNS[1:4]
        is_finite = np.isfinite(samples[columns].to_numpy(float)).all(axis=1)
        check_rows(samples, is_finite, columns, "expected finite numbers")
        number, encounters = encounter_numbers(samples)
        views = []
        for angle, own_speed, slowest in _VIEWS:
            theta, r = smooth_paths(samples, angle)
            own = samples[own_speed].to_numpy(float)
            path = r * np.exp(1j * theta)
            has_zone = np.isfinite(path) & (own >= slowest)
            carried = np.clip(own, *_SPEED_BOUNDS) - REFERENCE_SPEED
            view = pd.DataFrame(
                {"x": path.real, "y": path.imag, "speed": carried, "row": number}
            )
            views.append(view[has_zone])
        paths = pd.concat(views).sort_values("row", kind="stable")
        kind = encounters.get("kind", pd.Series("", encounters.index)).to_numpy(object)
        x, y, speed, row = (paths[name].to_numpy() for name in paths)
        every = cls(x, y, speed, row, kind, encounters)
        may_be_nearest = np.any([every._is_nearest(p) for p in _bank()], axis=0)
        of_samples = ("x", "y", "speed", "encounter")
        return replace(
            every, **{name: getattr(every, name)[may_be_nearest] for name in of_samples}
        )

    @cached_property
    def first(self) -> NDArray[np.intp]:
        """First sample of each encounter, shape (k,)."""
        return np.flatnonzero(np.diff(self.encounter, prepend=-1))

    @cached_property
    def coarse(self) -> PairPaths:
        """The same in 32 bits, which take half the time of 64.

        Then h jumps by 1e-7 m: an optimiser that follows lines stops there, a draw does not mind.
        """
        x, y, speed = (v.astype("float32") for v in (self.x, self.y, self.speed))
        return replace(self, x=x, y=y, speed=speed)

    def distances(self, p: Array) -> Array:
        """h of each encounter for the parameters `p`, shape (k,) [m]."""
        every = _signed_distances(self.x, self.y, self.speed, p)[0]
        return np.minimum.reduceat(every, self.first).astype(float)

    def _is_nearest(self, p: Array) -> NDArray[np.bool_]:
        """Whether each sample is the nearest of its encounter, or as near, for the parameters `p`."""
        every = _signed_distances(self.x, self.y, self.speed, p)[0]
        return np.asarray(
            every == np.minimum.reduceat(every, self.first)[self.encounter]
        )

    def distances_and_slopes(self, p: Array) -> tuple[Array, Array]:
        """h (k,) [m] as from `distances`, and its derivatives by the first eight of `p`, (k, 8)."""
        at = np.flatnonzero(self._is_nearest(p))
        # the first of equal ones
        at = at[np.flatnonzero(np.diff(self.encounter[at], prepend=-1))]
        speed = self.speed[at]
        h, u, v, by_a, by_b = _signed_distances(self.x[at], self.y[at], speed, p)
        k = 1 / (np.maximum(np.hypot(u, v), 1e-9) * np.sqrt(by_a * by_b))
        by_y = k * v * by_b
        by_x = k * u * by_a - by_y * p[7]
        shear = -by_y * u / by_a
        by_a = h / 2 - k * u * u
        by_b = h / 2 - k * v * v
        slopes = (
            -by_x,
            -by_x * speed,
            -by_y,
            by_a,
            by_a * speed,
            by_b,
            by_b * speed,
            shear,
        )
        return h, np.stack(slopes, axis=1)


def _signed_distances(x: Array, y: Array, speed: Array, p: Array) -> tuple[Array, ...]:
    """Distances of points to the ellipse of `p` [m], and the four numbers they are made of.

    These are the point in the frame in which the ellipse is the unit circle, and the inverse semi-axes. The
    distance to the circle is multiplied by the geometric mean of the semi-axes.
    """
    p = p.astype(x.dtype)
    by_a = np.exp(-p[3] - p[4] * speed)
    by_b = np.exp(-p[5] - p[6] * speed)
    ahead = x - p[0] - p[1] * speed
    u = ahead * by_a
    v = (y - p[2] - p[7] * ahead) * by_b
    return (np.sqrt(u * u + v * v) - 1) / np.sqrt(by_a * by_b), u, v, by_a, by_b


@cache
def _bank() -> Array:
    """Parameters of ellipses of all forms, one a row."""
    bank = np.zeros((_BANK, len(_PARAMETERS)))
    low = [-0.25, -0.1, -0.3, *np.log([0.35, 0.35])]
    high = [0.25, 0.1, 0.3, *np.log([1.5, 1.3])]
    rng = np.random.default_rng(0)
    bank[:, [0, 2, 7, 3, 5]] = rng.uniform(low, high, (_BANK, 5))
    return bank


def respect_factor(
    h: Any, f: Any, w: Any, excess: Any, reach: Any
) -> tuple[Array, Array, Array, Array]:
    """g(h) (see `respect`), and what it is made of: the edge, the excess there, and max(h, 0) / c.

    Parameters
    ----------
    h : distance to the edge of the zone [m], negative inside.
    f, w, excess, reach : share of careless people, softness [m], A and c [m], of shapes that broadcast.
    """
    s = expit(h / w)
    outside = np.maximum(h, 0) / reach
    near = excess * np.exp(-outside)
    return f + (1 - f) * s * (1 + near), s, near, outside


def _edge(p: Array) -> tuple[Any, ...]:
    """The last four arguments of `respect_factor` from the parameters `p`."""
    return expit(p[8]), *np.exp(p[9:])


def _factor_and_slopes(h: Array, p: Array) -> tuple[Array, Array, Array]:
    """g(h) (k,), its derivative by h (k,), and by the last four parameters (k, 4)."""
    f, w, excess, reach = _edge(p)
    g, s, near, outside = respect_factor(h, f, w, excess, reach)
    out = (1 - f) * s
    by_h = out * ((1 - s) / w * (1 + near) - near / reach * (h > 0))
    by_f = f * (1 - f) * (1 - s * (1 + near))
    by_w = -out * (1 - s) * (1 + near) * h / w
    return g, by_h, np.stack([by_f, by_w, out * near, out * near * outside], axis=1)


def _minus_log_prior(p: Array) -> tuple[float, Array]:
    """Minus the logarithm of the prior density, up to a constant, and its gradient."""
    deviation = (p - _MEAN) / _SPREAD
    elongation = (p[3] - p[5]) / _ELONGATION
    gradient = deviation / _SPREAD
    gradient[3] += elongation / _ELONGATION
    gradient[5] -= elongation / _ELONGATION
    return float((deviation**2).sum() + elongation**2) / 2, gradient


def chance_level(g: Array, g_null: Array) -> tuple[float, float]:
    """The mean of g over people who ignore each other, and the log likelihood ratio against g = 1.

    Parameters
    ----------
    g, g_null : g(h) of the encounters of the data (n,) and of the null model (m,), of one kind.

    Both are samples: an encounter of the data has the density N(h) g(h) / mean, one of the null model N(h).
    The likelihood is maximised over all distributions N on the encounters seen, and over the mean (Qin,
    Biometrika 85, 1998): it is that of a logistic regression that tells data from null model.
    """
    n = len(g)
    m = len(g_null)
    both = np.concatenate([g, g_null])
    level = g_null.mean()
    for _ in range(_NEWTON):
        share = both / (both + m / n * level)
        step = (share.sum() - n) / np.maximum(share @ (1 - share), 1e-9)
        level *= np.exp(np.clip(step, -2, 2))
        if abs(step) < _EXACT:
            break
    ratio = both / level
    log_ratio = np.log(ratio[:n]).sum() - np.log((m + n * ratio) / (m + n)).sum()
    return float(level), float(log_ratio)


@dataclass(frozen=True, eq=False)
class Likelihood:
    """The likelihood of the encounters of data and null model.

    Parameters
    ----------
    data, null : the encounters.
    """

    data: PairPaths
    null: PairPaths

    @cached_property
    def kinds(self) -> list[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
        """For each kind of encounter, whether each of the data and of the null model is of it."""
        return [
            (self.data.kind == each, self.null.kind == each)
            for each in np.unique(self.data.kind)
        ]

    def log_ratio(self, p: Array, h: Array, h_null: Array) -> float:
        """Log likelihood ratio of the parameters `p` against no zone.

        `h` and `h_null` are the distances of the encounters of data and null model to the ellipse of `p` [m].
        """
        g, g_null = (respect_factor(each, *_edge(p))[0] for each in (h, h_null))
        return sum(
            chance_level(g[of_data], g_null[of_null])[1]
            for of_data, of_null in self.kinds
        )

    def log_posterior(self, p: Array) -> float:
        """Logarithm of the posterior density of the parameters `p`; 0 without a zone."""
        ratio = self.log_ratio(p, self.data.distances(p), self.null.distances(p))
        return ratio - _minus_log_prior(p)[0]

    def cost(self, p: Array) -> tuple[float, Array]:
        """Minus the logarithm of the posterior density of the parameters `p`, and its gradient."""
        value, gradient = _minus_log_prior(p)
        h, slope = self.data.distances_and_slopes(p)
        g, by_h, by_p = _factor_and_slopes(h, p)
        h_null, slope_null = self.null.distances_and_slopes(p)
        g_null, by_h_null, by_p_null = _factor_and_slopes(h_null, p)
        per = 1 / g
        per_null = np.zeros(len(g_null))
        for of_data, of_null in self.kinds:
            near = g[of_data]
            far = g_null[of_null]
            level, log_ratio = chance_level(near, far)
            value -= log_ratio
            expected = len(far) / len(near) * level
            per[of_data] -= 1 / (near + expected)
            per_null[of_null] = 1 / (far + expected)
        by_ellipse = (per_null * by_h_null) @ slope_null - (per * by_h) @ slope
        by_edge = per_null @ by_p_null - per @ by_p
        return value, gradient + np.concatenate([by_ellipse, by_edge])

    def maximise(self, starts: Sequence[Array]) -> Array:
        """The best parameters found from several `starts`."""
        # several threads take ten times as long for small products
        with threads().limit(limits=1):
            tries = [
                minimize(
                    self.cost,
                    p,
                    jac=True,
                    method="L-BFGS-B",
                    bounds=Bounds(_LOW, _HIGH),
                )
                for p in starts
            ]
        return np.asarray(min(tries, key=lambda found: found.fun).x)

    def find_peak(self) -> Array:
        """The maximum, or one of several that are nearly as high: the draws go on from there.

        The density has many small peaks, because each encounter adds an edge. Some lie far apart: a zone
        whose centre is farther back, and which is as much longer, reaches as far ahead. So these are tried.
        """
        best = self.maximise(self.starts())
        while True:
            found = self.maximise([_move_back(best, metres) for metres in _BACK])
            if self.cost(found)[0] > self.cost(best)[0] - _GAIN:
                return best
            best = found

    def starts(self) -> list[Array]:
        """The best circles of a grid of radii, edges and shares."""
        circle = np.zeros(len(_PARAMETERS))
        circle[11] = np.log(0.12)
        nearest, nearest_null = (
            each.distances(circle) + 1 for each in (self.data, self.null)
        )
        tries = []
        for radius, *edge in product(
            _RADII, (-3, -1), np.log([0.05, 0.15]), (-2, 2, 3)
        ):
            p = circle.copy()
            p[[3, 5]] = np.log([1.1 * radius, 0.9 * radius])
            p[8:11] = edge
            ratio = self.log_ratio(p, nearest - radius, nearest_null - radius)
            tries.append((ratio - _minus_log_prior(p)[0], radius, p))
        best: list[Array] = []
        while tries and len(best) < _STARTS:
            _, at, p = max(tries, key=lambda found: found[0])
            best.append(p)
            tries = [each for each in tries if abs(each[1] - at) > _START_GAP]
        return best

    def draw(self, start: Array, rng: np.random.Generator) -> Draws:
        """Draw parameters from the posterior around its maximum `start`, with `rng`."""
        coarse = replace(self, data=self.data.coarse, null=self.null.coarse)
        with threads().limit(limits=1):
            return sample(
                coarse.log_posterior,
                start,
                _LOW,
                _HIGH,
                rng,
                spread=_FIRST_SPREAD,
                n_reported=_REPORTED,
            )


def _move_back(p: Array, metres: float) -> Array:
    """The parameters `p` with the centre so many `metres` farther back, and a reach ahead that stays."""
    moved = p.copy()
    moved[0] -= metres
    moved[3] = np.log(max(np.exp(p[3]) + metres, np.exp(_LOW[3])))
    return np.clip(moved, _LOW, _HIGH)


@cache
def threads() -> ThreadpoolController:
    """The threads of the loaded libraries; cached, because finding them takes as long as one fit."""
    return ThreadpoolController()


def zone_ellipses(parameters: Array, speeds: Sequence[float]) -> Array:
    """Ellipses (k, s, 5), centre, semi-axes and angle, for `parameters` (k, 12) at `speeds` (s,) [m/s]."""
    p = parameters.T[..., None]
    speed = np.clip(speeds, *_SPEED_BOUNDS) - REFERENCE_SPEED
    ahead = p[0] + p[1] * speed
    by_a = np.exp(-p[3] - p[4] * speed)
    by_b = np.exp(-p[5] - p[6] * speed)
    shear = -p[7] * by_b
    form = np.array([[by_a**2 + shear**2, shear * by_b], [shear * by_b, by_b**2]])
    values, vectors = np.linalg.eigh(np.moveaxis(form, [0, 1], [-2, -1]))
    major = vectors[..., 0]
    angle = np.pi / 2 - (np.pi / 2 - np.arctan2(major[..., 1], major[..., 0])) % np.pi
    left = np.broadcast_to(p[2], ahead.shape)
    return np.stack([ahead, left, *np.moveaxis(values, -1, 0) ** -0.5, angle], axis=-1)

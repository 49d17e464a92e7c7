"""Draws from a posterior density by importance sampling that adapts.

In each round, draws from a multivariate t distribution are weighted by the density. The next t distribution
has the weighted mean and covariance of all draws so far. The weight of a draw is the density over the mean of
all t distributions (adaptive multiple importance sampling; Cornuet et al., Scandinavian Journal of Statistics
39, 2012). Early on few draws have all the weight: then all weights are raised to a power below 1. No gradient
is needed, and small peaks of the density do not hold a draw back.

The draws of each round are dealt to four groups. The rounds end when the groups agree, with the largest R-hat
below 1.01, and `_ENOUGH` draws are effective (400 would do: Vehtari et al., Bayesian Analysis 16, 2021), or
after `_MOST_ROUNDS` rounds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp
from scipy.stats import multivariate_t

from ..core.checks import Array

R_HAT = 1.01
EFFECTIVE = 400
_ENOUGH = 500  # effective draws, more than needed: to stop by luck costs little
_GROUPS = 4
_DRAWN = 300  # draws of a round
_MOST_ROUNDS = 60
_FREEDOM = 5.0  # degrees of freedom of the t distributions: long tails
_FEWEST = 5  # effective draws for each parameter to which a t distribution is fitted
_KEPT = 4000  # equally likely draws in the end


@dataclass(frozen=True, eq=False)
class Draws:
    """Equally likely draws.

    Parameters
    ----------
    values : the draws, shape (k, ...).
    r_hat : the largest R-hat of a reported parameter, between the groups.
    n_effective : number of independent draws that are worth as much as all weighted ones.
    n_evaluated : number of times that the density was evaluated.
    """

    values: Array
    r_hat: float
    n_effective: float
    n_evaluated: int

    @property
    def has_converged(self) -> bool:
        """Whether the groups agree and are large enough."""
        return self.r_hat < R_HAT and self.n_effective >= EFFECTIVE

    def __str__(self) -> str:
        return (
            f"{self.n_evaluated} draws, {self.n_effective:.0f} of them effective, "
            f"R-hat {self.r_hat:.3f}"
        )


def sample(
    log_density: Callable[[Array], float],
    start: Array,
    low: Array,
    high: Array,
    rng: np.random.Generator,
    *,
    spread: Array,
    n_reported: int,
) -> Draws:
    """Draw from a density between bounds.

    Parameters
    ----------
    log_density : the logarithm of the density at parameters (d,), up to a constant.
    start : the maximum of the density, or near it, shape (d,).
    low, high : bounds of the parameters, shape (d,).
    rng : of the draws.
    spread : scale of the first draws around the start, as a share of the bounds, shape (d,).
    n_reported : the groups must agree about so many parameters, the first ones.

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.zones.sampling import sample
    >>> bell = lambda p: -12.5 * float(p @ p)
    >>> edge, rng = np.ones(3), np.random.default_rng(0)
    >>> draws = sample(bell, 0 * edge, -edge, edge, rng, spread=0.3 * edge, n_reported=3)
    >>> draws.has_converged, [round(float(each), 1) for each in draws.values.std(axis=0)]
    (True, [0.2, 0.2, 0.2])
    """

    def log_inside(p: Array) -> float:
        """The logarithm of the density, minus infinity outside the bounds."""
        is_inside = bool(((low < p) & (p < high)).all())
        return log_density(p) if is_inside else -np.inf

    variance = (spread * (high - low)) ** 2
    values = np.empty((0, len(start)))
    log_f = np.empty(0)
    proposals = [(start, np.diag(variance))]
    while True:
        drawn = multivariate_t.rvs(
            *proposals[-1], _FREEDOM, size=_DRAWN, random_state=rng
        ).reshape(_DRAWN, -1)
        values = np.concatenate([values, drawn])
        log_f = np.append(log_f, [log_inside(p) for p in drawn])
        by_proposal = [multivariate_t.logpdf(values, *p, _FREEDOM) for p in proposals]
        log_weight = log_f - logsumexp(by_proposal, axis=0) + np.log(len(proposals))
        r_hat, n_effective = diagnose(values[:, :n_reported], log_weight)
        is_enough = r_hat < R_HAT and n_effective >= _ENOUGH
        if is_enough or len(proposals) == _MOST_ROUNDS:
            break
        weight = _temper(log_weight, _FEWEST * len(start))
        covariance = np.cov(values.T, aweights=weight) + 1e-6 * np.diag(variance)
        proposals.append((weight @ values, covariance))
    share = (np.arange(_KEPT) + rng.uniform()) / _KEPT
    at = np.searchsorted(_weigh(log_weight).cumsum(), share)
    return Draws(
        values[np.minimum(at, len(values) - 1)], r_hat, n_effective, len(values)
    )


def _weigh(log_weight: Array) -> Array:
    """Weights that add up to 1, none above the square root of their number times the mean.

    That limit costs little bias, and no draw has all the weight (Ionides, Journal of Computational and
    Graphical Statistics 17, 2008).
    """
    weight = np.exp(log_weight - log_weight.max())
    weight = np.minimum(weight, weight.mean() * np.sqrt(len(weight)))
    return np.asarray(weight / weight.sum())


def _temper(log_weight: Array, fewest: float) -> Array:
    """Weights raised to the largest power, at most 1, that leaves the `fewest` effective draws."""
    for power in 0.85 ** np.arange(60):
        weight = _weigh(np.where(np.isfinite(log_weight), power * log_weight, -np.inf))
        if 1 / (weight @ weight) >= fewest:
            break
    return weight


def diagnose(values: Array, log_weight: Array) -> tuple[float, float]:
    """The largest R-hat of the parameters, and the number of effective draws.

    Parameters
    ----------
    values : draws of all groups in turn, shape (k, d).
    log_weight : logarithms of their weights, shape (k,).

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.zones.sampling import diagnose
    >>> r_hat, n = diagnose(np.random.default_rng(0).normal(size=(2000, 2)), np.zeros(2000))
    >>> r_hat < 1.01, round(n)
    (True, 2000)
    """
    means = []
    variances = []
    for group in range(_GROUPS):
        weight = _weigh(log_weight[group::_GROUPS])
        of_group = values[group::_GROUPS]
        means.append(weight @ of_group)
        variances.append(weight @ (of_group - means[-1]) ** 2)
    ratio = np.var(means, axis=0, ddof=1) / np.mean(variances, axis=0)
    weight = _weigh(log_weight)
    return float(np.sqrt(1 + ratio.max())), float(1 / (weight @ weight))

"""Draws from a posterior density by several ensembles of walkers, until the ensembles agree.

Each walker of an ensemble steps along the difference of two others, so that steps fit the density without a
gradient or a covariance (differential evolution; Ter Braak, Statistics and Computing 16, 2006). emcee moves
the walkers (Foreman-Mackey et al., PASP 125, 2013). The ensembles do not know each other. They end when the
largest R-hat is below 1.01 and each parameter that is reported has 400 effective draws (Vehtari et al.,
Bayesian Analysis 16, 2021), or after `_MOST_BLOCKS` blocks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import emcee
import numpy as np

from ..core.checks import Array

R_HAT, EFFECTIVE = 1.01, 400
_ENSEMBLES, _WALKERS = 4, 5  # walkers for each parameter
_BURN_IN, _BLOCK, _MOST_BLOCKS = 60, 40, 12  # steps; blocks
_MOVES = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)]


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of all walkers.

    Parameters
    ----------
    values : the draws, shape (k, d).
    r_hat, n_effective : the largest R-hat, and the fewest effective draws, of a reported parameter.
    """

    values: Array
    r_hat: float
    n_effective: float

    @property
    def has_converged(self) -> bool:
        """Whether the ensembles agree and are long enough."""
        return self.r_hat < R_HAT and self.n_effective >= EFFECTIVE


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
    spread : standard deviation of the first walkers around the start, as a share of the bounds, shape (d,).
    n_reported : the ensembles must agree about so many parameters, the first ones.
    """

    def log_inside(p: Array) -> float:
        """The logarithm of the density, minus infinity outside the bounds."""
        is_inside = bool(((low < p) & (p < high)).all())
        return log_density(p) if is_inside else -np.inf

    d = len(start)
    ensembles = [
        emcee.EnsembleSampler(_WALKERS * d, d, log_inside, moves=_MOVES)
        for _ in range(_ENSEMBLES)
    ]
    for ensemble in ensembles:
        shift = spread * rng.normal(size=(_WALKERS * d, d))
        edge = spread * rng.uniform(size=shift.shape)
        share = np.clip((start - low) / (high - low) + shift, edge, 1 - edge)
        seed = np.random.RandomState(rng.integers(2**31)).get_state()
        first = emcee.State(low + (high - low) * share, random_state=seed)
        ensemble.run_mcmc(first, _BURN_IN)
        ensemble.reset()
    for _ in range(_MOST_BLOCKS):
        for ensemble in ensembles:
            ensemble.run_mcmc(None, _BLOCK)
        # by ensemble, step, walker and parameter
        draws = np.stack([ensemble.get_chain() for ensemble in ensembles])
        found = Draws(draws.reshape(-1, d), *diagnose(draws[..., :n_reported]))
        if found.has_converged:
            break
    return found


def diagnose(draws: Array) -> tuple[float, float]:
    """The largest split R-hat, and the fewest effective draws, over the parameters.

    Parameters
    ----------
    draws : by ensemble, step, walker and parameter, shape (m, n, w, d). R-hat compares the ensembles, each
        split in two halves. Autocorrelation is that of the walkers.

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.zones.sampling import diagnose
    >>> r_hat, n = diagnose(np.random.default_rng(0).normal(size=(4, 500, 10, 2)))
    >>> r_hat < 1.01, n > 10_000
    (True, True)
    """
    m, n, w, d = draws.shape
    halves = draws[:, : n // 2 * 2].reshape(2 * m, -1, d)
    within = halves.var(axis=1, ddof=1).mean(axis=0)
    between = halves.mean(axis=1).var(axis=0, ddof=1)
    r_hat = np.sqrt(1 + between / within).max()

    walkers = draws.transpose(0, 2, 1, 3).reshape(m * w, n, d)
    spread = walkers.var(axis=1, ddof=1).mean(axis=0)
    total = (n - 1) / n * spread + walkers.mean(axis=1).var(axis=0, ddof=1)
    centred = walkers - walkers.mean(axis=1, keepdims=True)
    spectrum = np.abs(np.fft.rfft(centred, 2 * n, axis=1)) ** 2
    covariance = np.fft.irfft(spectrum, axis=1)[:, :n].mean(axis=0) / n
    correlation = 1 - (spread - covariance * n / (n - 1)) / total
    pairs = correlation[0 : n // 2 * 2 : 2] + correlation[1 : n // 2 * 2 : 2]
    # Geyer's initial positive sequence
    pairs = np.where(np.cumprod(pairs > 0, axis=0), pairs, 0)
    time = np.maximum(2 * pairs.sum(axis=0) - 1, 1 / np.log10(m * w * n))
    return float(r_hat), float((m * w * n / time).min())

"""Draws from a posterior density by Hamiltonian Monte Carlo, until several chains agree.

Each chain follows the gradient, so that its draws are nearly independent (Neal, "MCMC using Hamiltonian
dynamics", 2011). Parameters have bounds, and are drawn on the whole real line by a logit. The steps fit the
curvature at the maximum, then the covariance of the draws so far. The chains end when the largest R-hat is
below 1.01 and each parameter that is reported has 400 effective draws (Vehtari et al., Bayesian Analysis 16,
2021), or after `_MOST_BLOCKS` blocks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logit

from ..core.checks import Array

Cost = Callable[[Array], tuple[float, Array]]

R_HAT, EFFECTIVE = 1.01, 400
_CHAINS, _BLOCK, _MOST_BLOCKS = 4, 60, 24
_ADAPTING = 4  # blocks before the first draw; the last one adapts the step only
_STEPS = (3, 10)  # of the leapfrog, least and less than
_ACCEPTED, _RATE = (
    0.8,
    0.1,
)  # share of proposals aimed at, and how fast the step follows it
_DIFFERENCE = 1e-3  # for the curvature


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of all chains.

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
        """Whether the chains agree and are long enough."""
        return self.r_hat < R_HAT and self.n_effective >= EFFECTIVE


class _Space:
    """The density on the whole real line, in units of a linear map `root` around a centre."""

    def __init__(self, cost: Cost, start: Array, low: Array, high: Array) -> None:
        self.cost, self.low, self.high = cost, low, high
        share = np.clip((start - low) / (high - low), 0.01, 0.99)
        self.center = np.asarray(logit(share))
        self.root: Array = np.eye(len(start))

    def parameters(self, z: Array) -> Array:
        """The parameters at `z` (..., d)."""
        return np.asarray(
            self.low + (self.high - self.low) * expit(self.center + z @ self.root.T)
        )

    def energy(self, z: Array) -> tuple[float, Array]:
        """Minus the logarithm of the density at `z` (d,), and its gradient."""
        share = expit(self.center + self.root @ z)
        inner = np.maximum(share * (1 - share), 1e-12)
        width = self.high - self.low
        value, slope = self.cost(self.low + width * share)
        slope = slope * width * inner - (1 - 2 * share)
        return float(value - np.log(inner).sum()), slope @ self.root

    def fit_curvature(self) -> None:
        """Choose the map from the curvature at the centre."""
        d = len(self.center)
        steps = _DIFFERENCE * np.eye(d)
        sides = [[self.energy(sign * step)[1] for sign in (1, -1)] for step in steps]
        curvature = np.array([up - down for up, down in sides]) / (2 * _DIFFERENCE)
        values, vectors = np.linalg.eigh((curvature + curvature.T) / 2)
        self.root = np.asarray(vectors / np.sqrt(np.maximum(np.abs(values), 0.3)))

    def fit_draws(self, u: Array) -> None:
        """Choose centre and map from draws `u` (k, d) on the real line."""
        self.center = np.asarray(u.mean(axis=0))
        covariance = np.cov(u.T) + 1e-6 * np.eye(u.shape[1])
        self.root = np.asarray(np.linalg.cholesky(covariance))


def sample(
    cost: Cost,
    start: Array,
    low: Array,
    high: Array,
    rng: np.random.Generator,
    *,
    n_reported: int,
) -> Draws:
    """Draw from the density exp(-cost) between bounds.

    Parameters
    ----------
    cost : gives minus the logarithm of the density at parameters (d,), up to a constant, and its gradient.
    start : the maximum of the density, or near it, shape (d,).
    low, high : bounds of the parameters, shape (d,).
    rng : of the draws.
    n_reported : the chains must agree about so many parameters, the first ones.
    """
    space = _Space(cost, np.asarray(start, float), low, high)
    space.fit_curvature()
    z = rng.normal(0, 1, (_CHAINS, len(start)))
    step = 0.3
    for block in range(_ADAPTING):
        chains, step = _run(space, z, step, rng, adapts=True)
        u = space.center + chains @ space.root.T
        if block < _ADAPTING - 1:
            space.fit_draws(u[:, _BLOCK // 3 :].reshape(-1, len(start)))
        z = np.linalg.solve(space.root, (u[:, -1] - space.center).T).T
    blocks: list[Array] = []
    while len(blocks) < _MOST_BLOCKS:
        chains, step = _run(space, z, step, rng)
        z = chains[:, -1]
        blocks.append(chains)
        draws = np.concatenate(blocks, axis=1)
        found = Draws(space.parameters(draws), *diagnose(draws[..., :n_reported]))
        if found.has_converged:
            break
    return Draws(found.values.reshape(-1, len(start)), found.r_hat, found.n_effective)


def _run(
    space: _Space,
    z: Array,
    step: float,
    rng: np.random.Generator,
    *,
    adapts: bool = False,
) -> tuple[Array, float]:
    """One block of each chain from `z` (chains, d): its draws (chains, n, d), and the step."""
    out = np.empty((len(z), _BLOCK, z.shape[1]))
    for chain, at in enumerate(z):
        energy, slope = space.energy(at)
        for k in range(_BLOCK):
            momentum = rng.normal(size=len(at))
            there, speed, value, force = at, momentum, energy, slope
            for _ in range(rng.integers(*_STEPS)):
                speed = speed - step / 2 * force
                there = there + step * speed
                value, force = space.energy(there)
                speed = speed - step / 2 * force
            gain = float(energy - value) + (momentum @ momentum - speed @ speed) / 2
            accepted = math.exp(min(float(gain), 0.0)) if math.isfinite(gain) else 0.0
            if rng.random() < accepted:
                at, energy, slope = there, value, force
            if adapts:
                step *= np.exp(_RATE * (accepted - _ACCEPTED))
            out[chain, k] = at
    return out, step


def diagnose(chains: Array) -> tuple[float, float]:
    """The largest split R-hat, and the fewest effective draws, over the parameters of `chains` (m, n, d).

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.zones.sampling import diagnose
    >>> r_hat, n = diagnose(np.random.default_rng(0).normal(size=(4, 500, 2)))
    >>> r_hat < 1.01, n > 1000
    (True, True)
    """
    half = chains.shape[1] // 2
    split = np.concatenate([chains[:, :half], chains[:, half : 2 * half]])
    m, n, _ = split.shape
    within = split.var(axis=1, ddof=1).mean(axis=0)
    total = (n - 1) / n * within + split.mean(axis=1).var(axis=0, ddof=1)
    centred = split - split.mean(axis=1, keepdims=True)
    spectrum = np.abs(np.fft.rfft(centred, 2 * n, axis=1)) ** 2
    covariance = np.fft.irfft(spectrum, axis=1)[:, :n].mean(axis=0) / n
    correlation = 1 - (within - covariance * n / (n - 1)) / total
    pairs = correlation[0 : n // 2 * 2 : 2] + correlation[1 : n // 2 * 2 : 2]
    pairs = np.where(
        np.cumprod(pairs > 0, axis=0), pairs, 0
    )  # Geyer's initial positive sequence
    time = np.maximum(2 * pairs.sum(axis=0) - 1, 1 / np.log10(m * n))
    return float(np.sqrt(total / within).max()), float((m * n / time).min())

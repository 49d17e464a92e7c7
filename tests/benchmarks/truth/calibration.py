"""Simulation-based calibration of the posterior of the respect zone (Talts et al., arXiv:1804.06788, 2018).

    python tests/benchmarks/truth/calibration.py 200

Parameters are drawn from the prior. Many encounters of people who ignore each other are simulated. The data
is a sample of them in which each is as probable as its factor g(h), the null model is a plain sample. If the
posterior is right, the rank of the true parameter among draws from it is uniform. A Kolmogorov-Smirnov test
says so for each of the twelve parameters.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from helpers.passing_pairs import passing_pairs

from szlib.zones import respect_likelihood as model
from szlib.zones.respect_likelihood import Likelihood, PairPaths

NAMES = [
    *("m", "m by speed", "n", "log a", "a by speed", "log b", "b by speed", "shear"),
    *("logit f", "log w", "log A", "log c"),
]
EVERYBODY, PAIRS, NULL, RANKS = 20_000, 100, 2000, 100
BINS = 10


def draw_prior(rng: np.random.Generator) -> np.ndarray:
    """Draw parameters from the prior, shape (12,)."""
    while True:
        normal = rng.normal(
            model._MEAN, np.where(np.isfinite(model._SPREAD), model._SPREAD, 1.0)
        )
        flat = rng.uniform(model._LOW, model._HIGH)
        p = np.where(np.isfinite(model._SPREAD), normal, flat)
        elongation = (p[3] - p[5]) / model._ELONGATION
        is_inside = ((p > model._LOW) & (p < model._HIGH)).all()
        if is_inside and rng.uniform() < np.exp(-(elongation**2) / 2):
            return np.asarray(p)


def draw_encounters(
    everybody: PairPaths, p: np.ndarray, rng: np.random.Generator
) -> PairPaths:
    """Draw encounters of `everybody` with the frequencies of the model with parameters `p`."""
    g = model.respect_factor(everybody.distances(p), *model._edge(p))[0]
    share = np.zeros(len(g))
    for kind in np.unique(everybody.kind):
        of_kind = everybody.kind == kind
        share[of_kind] = g[of_kind] / g[of_kind].sum() * of_kind.mean()
    return take(everybody, rng.choice(len(g), PAIRS, p=share))


def take(everybody: PairPaths, drawn: np.ndarray) -> PairPaths:
    """The encounters of `everybody` with the numbers `drawn`."""
    ends = np.append(everybody.first, len(everybody.x))
    every = np.concatenate([np.arange(ends[i], ends[i + 1]) for i in drawn])
    return replace(
        everybody,
        x=everybody.x[every],
        y=everybody.y[every],
        speed=everybody.speed[every],
        encounter=np.repeat(np.arange(len(drawn)), np.diff(ends)[drawn]),
        kind=everybody.kind[drawn],
        encounters=everybody.encounters.iloc[drawn],
    )


def find_ranks(n: int) -> Iterator[dict[str, float]]:
    """The ranks of the true parameters among `RANKS` - 1 draws, of `n` posteriors."""
    everybody = PairPaths.from_samples(passing_pairs(EVERYBODY, 0))
    for seed in range(n):
        rng = np.random.default_rng([seed, 1])
        p = draw_prior(rng)
        data = draw_encounters(everybody, p, rng)
        null = take(everybody, rng.choice(len(everybody.kind), NULL, replace=False))
        likelihood = Likelihood(data, null)
        found = likelihood.draw(likelihood.find_peak(), rng)
        thinned = found.values[rng.choice(len(found.values), RANKS - 1, replace=False)]
        ranks = dict(zip(NAMES, (thinned < p).sum(axis=0).tolist(), strict=True))
        yield ranks | {"r_hat": found.r_hat, "n_effective": found.n_effective}


def main() -> None:
    """Print the counts of ranks in ten bins, and the p-value of each parameter."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("posteriors", type=int)
    n = parser.parse_args().posteriors
    rows = []
    for row in find_ranks(n):
        rows.append(row)
        print(len(rows), row, file=sys.stderr, flush=True)
    table = pd.DataFrame(rows)
    print(f"{(table['r_hat'] < 1.01).mean():.0%} of {n} posteriors have R-hat < 1.01")
    for name in NAMES:
        counts = np.histogram(table[name], bins=BINS, range=(0, RANKS))[0]
        share = (table[name] + 0.5) / RANKS
        p_value = stats.kstest(share, "uniform").pvalue
        print(f"{name:12} {counts} p = {p_value:.3f}")


if __name__ == "__main__":
    main()

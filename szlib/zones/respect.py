"""The respect zone: the ellipse that careful people keep out of, against people who ignore each other.

Both people of an encounter carry the same ellipse, turned with their motion. Let h be the smallest signed
distance of either person to the other's ellipse during the encounter. Each encounter counts once. Among
people who ignore each other, encounters of the kind k have values of h with the frequencies of the null model
(`szlib.null_encounters`). Respect changes these by a factor g(h):

    p(h | k) = N_k(h) g(h) / (mean of g over people who ignore each other)
    g(h) = f + (1 - f) (1 + A exp(-max(h, 0) / c)) / (1 + exp(-h / w))

f is the share of careless people among those who would enter, and w the softness of the edge. A and c
describe people who step aside: they are then seen just outside. A is at most 20: with more, only those just
outside would count, and an ellipse far from the true one may fit them. The mix of kinds does not matter,
because p is conditional on the kind. Only people who come towards each other or cross are compared: on plazas
with a known zone, those who walk in the same direction alone moved the centre by 15 cm, because a shift in
time also separates people who keep together.

The null model is a sample as well, and where people step aside few of its encounters lie. So N_k is not
taken from it alone: the likelihood is that of both samples, `chance_level`. With the mean of g over the
null model in its place, the same plaza had its centre at 3 to 17 cm with seven seeds of the null model; with
both samples, and 12,000 encounters of the null model, 39 of 40 plazas have it within 2 cm.

The ellipse has a centre, a semi-axis along the motion and one across, and a shear. Centre and the logarithms
of the semi-axes are linear in the speed of the person who carries it. Weak priors hold the semi-axes (0.8 m,
with a standard deviation of 0.5 of the logarithm) and the logarithm of their ratio (0.4), the changes with
speed (0.15 for each m/s), and the shear (0.15). That of the centre (0, 0.15 m) matters: how far a zone
reaches ahead is known well; how far it reaches behind, no pair tells if it reaches farther ahead, because a
person behind me has me ahead. The prior decides between zones that are alike ahead.

The zone has the median of each parameter in the posterior. Its maximum is not stable: each encounter adds an
edge, so the density has many small peaks. The intervals are meant to contain the true zone. People differ
from the model: around circles of 0.8 m that people keep by ORCA the zone is 1 to 3 cm too small, in every
crowd, and noise of 5 cm makes the semi-axis across 2 cm too small. So the posterior has a standard deviation
of at least 3 cm of the centre ahead and of the semi-axis along the motion, and of 1.8 cm of that across.

Measured on zones imposed on real paths: notebook 25.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from ..core.checks import Array, check_columns
from ..core.errors import ZoneError
from ..encounters.null_model import NullEncounters
from ..tracks import funnels
from .ellipses import Ellipse, EllipseZone, ellipse_reach
from .estimators import Estimator
from .respect_likelihood import COLUMNS, Likelihood, PairPaths, zone_ellipses
from .sampling import Draws

# Kinds of encounter that are compared.  People of one stream walk in the same direction, side by side or in
# a row, for other reasons than respect, which a shift in time removes as well. A person who stands has no
# heading.
_KINDS = ("opposite", "crossing")
# Twice the logarithm of the posterior density of a zone over that of none. Without respect: up to 19 in 45
# crowds of 9 kinds with 500 to 1,700 pairs (singles, groups, trains, turnstiles, signals and others). With a
# circle of 0.5 m that people keep: at least 110 from 150 pairs on.
_MIN_EVIDENCE = 35.0
_DRAWN = 12_000  # encounters of each sample that are used
# Encounters of the data within r_max: with fewer the zone reaches as far as nobody was seen.
MIN_COMPARED = 150
# What the edge of people differs from that of the model: least standard deviation of the posterior of centre
# (ahead, left), semi-axes [m] and angle (measured on crowds of
# tests/benchmarks/truth, and on noisy plazas: notebook 25).
_MODEL_ERROR = (0.03, 0.01, 0.03, 0.018, 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class RespectEstimator(Estimator):
    """The estimator of the respect zone, one fit for all speeds.

    Parameters
    ----------
    data, null : of the data, and of encounters drawn from the null model.
    encounters, parameters, funnel : see `Estimator`.
    """

    data: PairPaths
    null: PairPaths

    @classmethod
    def from_samples(
        cls, samples: pd.DataFrame, *, r_max: float, null: NullEncounters | None = None
    ) -> RespectEstimator:
        """Prepare samples and their null model.

        Parameters
        ----------
        samples : as from `szlib.find_encounters`.
        r_max : distance within which people count [m]; that of the null model.
        null : the null model of the same tracks, with the same parameters and kinds.

        Raises
        ------
        DataError : the samples lack a column.
        ZoneError : there is no null model, its `r_max` differs, or nothing can be compared.
        """
        if null is None:
            raise ZoneError(
                'method="respect" needs a null model; pass null=szlib.null_encounters(tracks)'
            )
        if null.r_max != r_max:
            raise ZoneError(
                f"r_max is {r_max} m, that of the null model {null.r_max} m; pass the same to both"
            )
        check_columns(samples, COLUMNS)
        is_far = samples["distance"] >= r_max
        close = funnels.select(
            samples, ~is_far, "samples: close", f"farther than {r_max} m"
        )
        against = null.samples[null.samples["distance"] < r_max]
        if "kind" in close and "kind" in against:
            kinds = {*_KINDS} & {*close["kind"]} & {*against["kind"]}
            close = funnels.select(
                close,
                close["kind"].isin(kinds),
                "samples: kinds compared",
                "of a kind that is not compared (same direction, companions), or not in the null model",
            )
            against = against[against["kind"].isin(kinds)]
        rng = np.random.default_rng(0)
        is_drawn = _draw(close["encounter"], _DRAWN, rng)
        if not is_drawn.all():
            close = funnels.select(
                close,
                is_drawn,
                "samples: drawn",
                f"of more than {_DRAWN:,} encounters, some at random",
            )
        n, n_null = (each["encounter"].nunique() for each in (close, against))
        against = against[_draw(against["encounter"], _DRAWN, rng)]
        if not (n and n_null):
            raise ZoneError(
                f"{n} encounters of the data and {n_null} of the null model, of the kinds "
                f"{', '.join(_KINDS)}, came within {r_max:g} m: nothing to compare; add data, or more shifts"
            )
        data = PairPaths.from_samples(close)
        return cls(
            data=data,
            null=PairPaths.from_samples(against),
            encounters=data.encounters,
            parameters={"null_encounters": n_null, "null": null.parameters},
            funnel=funnels.get(close),
        )

    @property
    def is_large(self) -> bool:
        """Whether the data holds `MIN_COMPARED` encounters, and the null model as many as the data."""
        n = len(self.encounters)
        return bool(MIN_COMPARED <= n <= self.parameters["null_encounters"])

    @cached_property
    def likelihood(self) -> Likelihood:
        """The likelihood of the encounters."""
        return Likelihood(self.data, self.null)

    @cached_property
    def peak(self) -> Array:
        """The maximum of the posterior density; raises ZoneError if no zone fits better than none."""
        peak = self.likelihood.find_peak()
        evidence = 2 * self.likelihood.log_posterior(peak)
        if evidence < _MIN_EVIDENCE:
            raise ZoneError(
                "no respect zone: people who ignore each other explain the data nearly as well (twice "
                f"the log posterior ratio is {evidence:.1f}, at least {_MIN_EVIDENCE:g} expected); add data"
            )
        return peak

    @cached_property
    def draws(self) -> Draws:
        """Parameters drawn from the posterior."""
        return self.likelihood.draw(self.peak, np.random.default_rng(0))

    @cached_property
    def middle(self) -> Array:
        """The parameters of the zone: of each the median of the draws."""
        return np.median(self.draws.values, axis=0)

    def fit_shape(self, speeds: Sequence[float]) -> EllipseZone:
        """Fit the ellipses at `speeds`, ascending [m/s]."""
        rows = zone_ellipses(self.middle[None], speeds)[0]
        if np.isnan(ellipse_reach(rows)).any():
            raise ZoneError("the respect zone does not contain its person; add data")
        return EllipseZone(
            {
                speed: Ellipse(row[:2], row[2:4], row[4])
                for speed, row in zip(speeds, rows, strict=True)
            }
        )

    def posterior(self, speeds: Sequence[float]) -> Draws:
        """The ellipses drawn from the posterior at `speeds` (s,) [m/s], values (k, s, 5).

        Of a nearly round zone the longer axis of a draw is now the one, now the other. So the first semi-axis
        of all draws is the one nearer to the longer one of the zone itself, even where it is the shorter one.
        """
        ellipses = zone_ellipses(self.draws.values, speeds)
        ellipses = np.where(_is_across(ellipses), _exchange_axes(ellipses), ellipses)
        mean = ellipses.mean(axis=0)
        spread = np.maximum(ellipses.std(axis=0), 1e-9)
        wide = mean + (ellipses - mean) * np.maximum(1, _MODEL_ERROR / spread)
        middle = zone_ellipses(self.middle[None], speeds)
        wide = np.where(_is_across(middle), _exchange_axes(wide), wide)
        return replace(self.draws, values=wide)


def _draw(
    encounters: pd.Series[Any], size: int, rng: np.random.Generator
) -> pd.Series[bool]:
    """Whether each of `encounters`, one a sample, is among `size` of them drawn with `rng`, or fewer."""
    known = encounters.unique()
    if len(known) > size:
        known = rng.choice(known, size, replace=False)
    return encounters.isin(known)


def _is_across(ellipses: Array) -> Array:
    """Whether the first semi-axis of `ellipses` (..., 5) is nearer to across than to along, (..., 1)."""
    return np.asarray(np.abs(np.sin(ellipses[..., 4:])) > np.sqrt(0.5))


def _exchange_axes(ellipses: Array) -> Array:
    """The same `ellipses` (..., 5) with the other semi-axis first, its angle within 90 deg of ahead."""
    exchanged = ellipses[..., [0, 1, 3, 2, 4]]
    exchanged[..., 4] += np.where(ellipses[..., 4] > 0, -np.pi / 2, np.pi / 2)
    return exchanged

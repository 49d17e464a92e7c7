"""The way to respect zones by speed, to go again with other people (see `szlib.zones.uncertainty`)."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..checks import Array
from ..encounters.null_model import NullEncounters
from ..errors import ZoneError
from ..tracks import funnels
from .occupancy import OccupancyHistogram
from .outliers import encounter_numbers
from .polar import DIRECTIONS, PolarZone, fit_ellipses
from .respect import SPEED_WIDTH, respect_boundary

_NEAREST = 20  # encounters that are left out one by one


@dataclass(frozen=True, eq=False)
class RespectEstimator:
    """Respect zones of samples, all within r_max, against their null model.

    Parameters
    ----------
    samples : within r_max of the null model.
    encounter : which of `encounters` each belongs to, shape (n,).
    encounters : the first of each encounter's samples.
    null : how often the null model was where.
    shifts : the same by shift, shape (shifts, speeds, directions, distances).
    speed_width : standard deviation of the weight of other speeds [m/s]; inf: all speeds alike.
    parameters, funnel : for the provenance.
    """

    samples: pd.DataFrame
    encounter: NDArray[np.intp]
    encounters: pd.DataFrame
    null: OccupancyHistogram
    shifts: NDArray[np.float32]
    speed_width: float
    parameters: dict[str, Any]
    funnel: list[dict[str, Any]]
    extreme = False
    vertices = None

    @classmethod
    def of(
        cls,
        samples: pd.DataFrame,
        *,
        r_max: float,
        null: NullEncounters | None = None,
        speed_width: float = SPEED_WIDTH,
    ) -> RespectEstimator:
        """From samples; ZoneError without a null model of the same r_max, or a width above 0 m/s."""
        if null is None:
            raise ZoneError(
                'method="respect" needs a null model to compare with: pass null=szlib.null_encounters(tracks)'
            )
        if null.r_max != r_max:
            raise ZoneError(
                f"r_max is {r_max} m, that of the null model {null.r_max} m; pass the same to both"
            )
        if not speed_width > 0:
            raise ZoneError(f"speed_width must be above 0 m/s, inf for all speeds alike; got {speed_width}")
        close = samples[samples["distance"] < r_max]
        far = {f"farther than {r_max} m": len(samples) - len(close)}
        parameters = {
            "speed_width": None if np.isinf(speed_width) else float(speed_width),
            "shifts": null.shifts,
            "null": null.parameters,
        }
        whole = OccupancyHistogram.from_samples(null.samples, r_max=r_max)
        return cls(
            close,
            *encounter_numbers(close),
            whole,
            _by_shift(null, whole),
            float(speed_width),
            parameters,
            [*funnels.get(samples), funnels.stage("samples: close", len(samples), len(close), far)],
        )

    def radii(self, speeds: Sequence[float]) -> PolarZone:
        """Radii at speeds, ascending [m/s]; ZoneError where there is nothing to compare."""
        return PolarZone(np.array(speeds), DIRECTIONS, self._lines(None, speeds, self.null))

    def refit(self, weights: Array, speeds: Sequence[float], rng: np.random.Generator | None = None) -> Array:
        """Ellipses (k, s, 5) for weights (k, n) of the encounters, shifts drawn anew by rng; NaN: no zone."""
        lines = np.full((len(weights), len(speeds), len(DIRECTIONS)), np.nan)
        for i, weight in enumerate(weights):
            null = self.null if rng is None else self._other_null(rng)
            with suppress(ZoneError):
                lines[i] = self._lines(weight[self.encounter], speeds, null)
        return fit_ellipses(lines.reshape(-1, len(DIRECTIONS))).reshape(*lines.shape[:2], 5)

    def leave_one_out(self, speeds: Sequence[float]) -> tuple[NDArray[np.intp], Array]:
        """The encounters that came nearest (k,), and the ellipses (k, s, 5) without each of them."""
        near = np.full(len(self.encounters), np.inf)
        np.minimum.at(near, self.encounter, self.samples["distance"].to_numpy(float))
        nearest = np.argsort(near, kind="stable")[:_NEAREST]
        weights = np.ones((len(nearest), len(near)))
        weights[np.arange(len(nearest)), nearest] = 0
        return nearest, self.refit(weights, speeds)

    def _other_null(self, rng: np.random.Generator) -> OccupancyHistogram:
        """The null model of as many shifts, drawn with replacement: it is known from so many only."""
        drawn = rng.multinomial(len(self.shifts), np.full(len(self.shifts), 1 / len(self.shifts)))
        return OccupancyHistogram(np.tensordot(drawn.astype(float), self.shifts, axes=1), self.null.r_max)

    def _lines(self, weights: Array | None, speeds: Sequence[float], null: OccupancyHistogram) -> Array:
        """Radii (s, 72) [m] for weights (n,) of the samples, against a null model."""
        data = OccupancyHistogram.from_samples(self.samples, r_max=self.null.r_max, weights=weights)
        asked = speeds[:1] if np.isinf(self.speed_width) else speeds
        lines = [
            respect_boundary(data, null, DIRECTIONS, speed=v, speed_width=self.speed_width) for v in asked
        ]
        return np.broadcast_to(lines, (len(speeds), len(DIRECTIONS)))


def _by_shift(null: NullEncounters, whole: OccupancyHistogram) -> NDArray[np.float32]:
    """How often each shift was where, shape (shifts, speeds, directions, distances)."""
    counts = np.zeros((null.shifts, *whole.counts.shape), np.float32)
    for k in null.samples["shift"].unique():
        counts[k] = OccupancyHistogram.from_samples(null.one(k), r_max=null.r_max).counts
    return counts

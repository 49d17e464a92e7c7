"""What all estimators of zones, and all shapes of zones, have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import pandas as pd
from numpy.typing import ArrayLike

from ..core.checks import Array
from .ellipses import Ellipse
from .sampling import Draws


class ZoneShape(Protocol):
    """The boundary of a zone by speed and direction: a `HullZone` or an `EllipseZone`."""

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed with data [m/s]."""

    def boundary(self, speed: float, theta: ArrayLike) -> Array:
        """Boundary at a `speed` [m/s] in the directions `theta` (...) [rad], shape (..., 2) [m]."""

    def ellipse(self, speed: float) -> Ellipse:
        """The ellipse at a `speed` [m/s]; raises ZoneError if the zone is undefined there."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Estimator(ABC):
    """A zone estimator that can be fitted again to resampled encounters.

    Parameters
    ----------
    encounters : one row for each encounter, with its number and, if known, its day and people.
    parameters : the options of the estimator, for the provenance of the zone.
    funnel : row counts of all stages, for the provenance of the zone.
    """

    encounters: pd.DataFrame
    parameters: dict[str, Any]
    funnel: list[dict[str, Any]]
    is_extreme: ClassVar[bool] = False
    """Whether the nearest people alone determine the zone."""

    @abstractmethod
    def fit_shape(self, speeds: Sequence[float]) -> ZoneShape:
        """Fit the zone to all encounters at `speeds`, ascending [m/s]."""

    def refit(self, weights: Array, speeds: Sequence[float]) -> Array:
        """Fit ellipses to weighted encounters; an estimator with a posterior is not asked.

        Parameters
        ----------
        weights : weight of each encounter in each fit, shape (k, n).
        speeds : speeds of the zones, shape (s,) [m/s].

        Returns
        -------
        Ellipses (k, s, 5): centre, semi-axes [m] and angle [rad]; NaN where there is no zone.
        """
        raise NotImplementedError

    def posterior(self, speeds: Sequence[float]) -> Draws | None:
        """Draws of ellipses at `speeds`, values (k, s, 5) as from `refit`; None: there is no posterior."""
        return None

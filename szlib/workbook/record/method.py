"""The knobs between tracks and the robot's zone: turned in one notebook, they reach all that follow.

A run hands every parameter to every notebook, and what notebooks leave for each other is known by these.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from ...control.settings import MPCSettings
from ...encounters.geometry import PAPER_SPACE, AttentionalSpace
from ...encounters.settings import EncounterSettings
from ...zones.outliers import R_MAX
from ...zones.quantile import QUANTILE
from ...zones.social_zone import SPEEDS


@dataclass(frozen=True)
class Method:
    """How the robot's zone is made; the names are those of the notebooks' parameters.

    Parameters
    ----------
    space_width, space_length : of the attentional space [m] (notebook 02).
    duration, min_distance, min_speed : of an encounter [s, m, m/s], as of `szlib.find_encounters` (02).
    r_max : distance within which people count [m] (03).
    q : share of encounters that may enter the quantile zone (05).
    zone_speed : walking speed whose zone the robot keeps [m/s] (05).
    """

    space_width: float = PAPER_SPACE.width
    space_length: float = PAPER_SPACE.length
    duration: float = EncounterSettings.duration
    min_distance: float = EncounterSettings.min_distance
    min_speed: float = EncounterSettings.min_speed
    r_max: float = R_MAX
    q: float = QUANTILE
    zone_speed: float = MPCSettings.zone_speed

    @classmethod
    def of(cls, variables: Mapping[str, Any]) -> Method:
        """That of a notebook's variables; what they do not name has its default."""
        return cls(**{each.name: variables[each.name] for each in fields(cls) if each.name in variables})

    def search(self) -> dict[str, Any]:
        """Keywords of `szlib.find_encounters`."""
        space = AttentionalSpace(self.space_length, self.space_width)
        names = ("duration", "min_distance", "min_speed")
        return {"space": space} | {name: getattr(self, name) for name in names}

    def fit(self) -> dict[str, Any]:
        """Keywords of `szlib.SocialZone.fit` for the zone that the robot keeps."""
        return {"r_max": self.r_max, "q": self.q, "speeds": sorted({*SPEEDS, self.zone_speed})}


DEFAULTS: Mapping[str, Any] = asdict(Method())
"""The knobs as they stand where nobody turned them."""

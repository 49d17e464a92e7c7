"""What counts as an encounter: `EncounterSettings`, carried through every search."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from ..core.checks import require
from ..core.errors import DataError
from ..tracks.clock import TICKS_PER_SECOND
from .areas import AUTO, as_area
from .geometry import PAPER_SPACE, AttentionalSpace

_LONGEST_WINDOW = 3600.0  # upper limit of the duration of a window [s]


@dataclass(frozen=True)
class EncounterSettings:
    """Settings of `szlib.find_encounters` and of every function that calls it, validated when built.

    The defaults are the four conditions of the paper (sec. 2); it does not give the coordinates of its area.
    Condition 2, "only one other pedestrian is present in this space for a duration of 3 seconds", is read
    loosely: that person is inside when the window opens, and nobody else is inside at any time.

    Parameters
    ----------
    area : where the attentional space must stay: an `Area`, a Shapely polygon, PedPy's ``WalkableArea``,
        text or a file, as for `szlib.as_area`; or "auto", the `szlib.walked_area` of the tracks, and of each
        recording that has no calendar (these are placed side by side, as their `reason` says).  None
        stands for `ATC_SQUARE` where the tracks are files of the ATC mall, else for "auto".
    space : the attentional space of the reference pedestrian.
    duration : of a window [s], a multiple of 0.1 (paper: 3).
    min_distance : of the other person when the window opens [m] (paper: 1).
    min_speed : of the reference pedestrian, throughout the window [m/s] (paper: 0.4).
    throughout : also require that the other person stays inside the space for the whole window.  That
        strict reading never sees anybody behind, although the paper's people pass each other: on the ATC day
        it finds 139 encounters instead of 252, and no zone that is closed behind (assumed: False).
    has_walls : whether the outline of the area is a wall, behind which nobody walks: the attentional space
        may reach beyond it (assumed: False).

    Raises
    ------
    DataError : a value has no meaning.

    Examples
    --------
    >>> import szlib
    >>> settings = szlib.EncounterSettings(area="0 12 0 8", min_speed=0.6)
    >>> settings.area
    Area(x=(0.0, 12.0), y=(0.0, 8.0), area=96.0)
    >>> szlib.EncounterSettings(duration=0.25)
    Traceback (most recent call last):
    ...
    szlib.core.errors.DataError: duration must be a multiple of 0.1 s, ...; got 0.25
    """

    area: object = None
    space: AttentionalSpace = PAPER_SPACE
    duration: float = 3.0
    min_distance: float = 1.0
    min_speed: float = 0.4
    throughout: bool = False
    has_walls: bool = False

    def __post_init__(self) -> None:
        if self.area is not None:
            area = AUTO if str(self.area).strip() == AUTO else as_area(self.area)
            object.__setattr__(self, "area", area)
        duration = self.duration
        require(
            0 < duration < _LONGEST_WINDOW
            and abs(duration * TICKS_PER_SECOND - self.steps) <= 1e-6,
            "duration",
            duration,
            f"a multiple of 0.1 s, the step of the clock, and shorter than {_LONGEST_WINDOW:g} s",
        )
        require(
            0 <= self.min_distance < np.inf,
            "min_distance",
            self.min_distance,
            "at least 0 m",
        )
        require(
            0 < self.min_speed < np.inf, "min_speed", self.min_speed, "positive [m/s]"
        )

    @property
    def steps(self) -> int:
        """Steps of the clock in a window."""
        return round(self.duration * TICKS_PER_SECOND)

    def with_parameters(self, parameters: Mapping[str, Any]) -> EncounterSettings:
        """These settings with `parameters` (names and values) in place of their own.

        `square` is accepted for `area`.  Raises DataError for an unknown name, or if both are given.
        """
        known = [each.name for each in fields(self)]
        given = {
            "area" if name == "square" else name: value
            for name, value in parameters.items()
        }
        unknown = sorted(given.keys() - known)
        if unknown:
            raise DataError(f"unknown parameter {unknown}; expected some of {known}")
        if len(given) < len(parameters):
            raise DataError(
                "both area and square are given; they mean the same: give area alone"
            )
        return replace(self, **given)

    def as_json(self) -> dict[str, Any]:
        """Every setting as a JSON value; the area as text from which `szlib.as_area` gives it again."""
        return asdict(self) | {"area": None if self.area is None else str(self.area)}

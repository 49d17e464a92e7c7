"""The parameters of the notebooks: how the zone is made, and checks before a notebook starts."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ... import (
    AttentionalSpace,
    DataError,
    EncounterSettings,
    MPCSettings,
    Recipe,
    SolverError,
    as_area,
)
from ...core.input_files import printable
from ...encounters.areas import AUTO
from ...encounters.geometry import PAPER_SPACE
from ...zones.outliers import R_MAX
from ...zones.social_zone import SPEEDS
from ..folders import OPTIONS, read_defaults

# Parameters that set the controller under another name, or that list values of one of its settings.
SETTINGS = {"gammas": "gamma", "horizons": "N_h", "limits": "a_max"}
_LARGEST = 2**31
# Lowest and highest value of a parameter that is not a setting of the controller.
RANGES: dict[str, tuple[float, float]] = {
    "seed": (0, 2**63),
    "space_width": (0.1, 100),
    "space_length": (0.1, 100),
    "duration": (0.1, 60),
    "min_distance": (0, 100),
    "min_speed": (0.01, 10),
    "q": (0.001, 0.5),
    "zone_speed": (0.01, 10),
    "intruders": (0, 0.5),
    "examples": (1, _LARGEST),
    "worlds": (1, _LARGEST),
    "n_jobs": (-1, _LARGEST),
    "fraction": (1e-6, 0.5),
    "r_max": (0.01, 100),
    "speeds": (0.01, 10),
    "lengths": (1e-3, 1e4),
    "eccentricities": (0, 0.999999),
}
# Parameters that no check depends on: the data, the way of computing, and the amount shown.
NEUTRAL = {*OPTIONS, "area", "reading", "n_jobs", "examples"}


@dataclass(frozen=True)
class ZoneMethod:
    """How the zone of the robot is made; every notebook of a run receives the same values.

    Parameters
    ----------
    space_width, space_length : size of the attentional space [m] (notebook 02).
    duration, min_distance, min_speed : conditions of an encounter [s, m, m/s] (notebook 02).
    reading : how the files of the data are read: options of `szlib.Recipe` by name (notebook 01).
    has_walls : whether the outline of the area is a wall, beyond which the space may reach (notebook 02).
    r_max : distance up to which samples count [m] (notebook 03).
    zone_speed : walking speed whose zone the robot keeps out of [m/s] (notebook 05).

    Examples
    --------
    >>> from szlib.workbook.record import ZoneMethod
    >>> ZoneMethod.from_variables({"r_max": 1.5, "seed": 7}).r_max
    1.5
    """

    space_width: float = PAPER_SPACE.width
    space_length: float = PAPER_SPACE.length
    duration: float = EncounterSettings.duration
    min_distance: float = EncounterSettings.min_distance
    min_speed: float = EncounterSettings.min_speed
    has_walls: bool = EncounterSettings.has_walls
    r_max: float = R_MAX
    zone_speed: float = MPCSettings.zone_speed
    reading: Mapping[str, Any] = field(default_factory=dict, hash=False)

    @classmethod
    def from_variables(cls, variables: Mapping[str, Any]) -> ZoneMethod:
        """Take the values from the `variables` of a notebook; a missing variable has its default."""
        known = METHOD_DEFAULTS.keys() & variables.keys()
        return cls(**{name: variables[name] for name in known})

    def read_options(self) -> Recipe:
        """Options of `szlib.read_tracks`; raises DataError where `reading` holds something else."""
        try:
            return Recipe(**self.reading)
        except TypeError as error:
            expected = 'options of szlib.Recipe by name, such as {"unit": "mm"}'
            raise DataError(
                f"parameter reading: expected {expected}; got {self.reading!a:.80}"
            ) from error

    def encounter_settings(self, area: object = None) -> EncounterSettings:
        """Settings of `szlib.find_encounters` for encounters in an `area`."""
        space = AttentionalSpace(length=self.space_length, width=self.space_width)
        names = ("duration", "min_distance", "min_speed", "has_walls")
        return EncounterSettings(
            area=area, space=space, **{name: getattr(self, name) for name in names}
        )

    def fit_options(self) -> dict[str, Any]:
        """Keywords of `szlib.SocialZone.fit`."""
        return {
            "r_max": self.r_max,
            "speeds": sorted({*SPEEDS, self.zone_speed}),
        }


METHOD_DEFAULTS: Mapping[str, Any] = asdict(ZoneMethod())


def check_parameters(
    given: Mapping[str, Any], notebooks: Sequence[Path]
) -> dict[str, Any]:
    """Check parameters before any notebook starts.

    Parameters
    ----------
    given : parameters by name.
    notebooks : scripts of the notebooks that receive them.

    Returns
    -------
    The parameters that differ from the default of at least one of the notebooks; an area in one form of text.

    Raises
    ------
    DataError : a parameter is unknown to all notebooks, has another type, or is out of its range.
    """
    given = dict(given)
    if given.get("area") not in (None, "", AUTO):
        given["area"] = str(as_area(given["area"]))
    if "reading" in given:
        recipe = ZoneMethod(reading=given["reading"]).read_options()
        given["reading"] = recipe.as_json()
    defaults: dict[str, list[Any]] = {}
    for notebook in notebooks:
        for name, value in read_defaults(notebook).items():
            defaults.setdefault(name, []).append(value)
    unknown = sorted(given.keys() - defaults.keys())
    if unknown:
        raise DataError(
            f"unknown parameter {', '.join(map(ascii, unknown))}; the notebooks know "
            f"{', '.join(sorted(defaults))}"
        )
    for name, value in given.items():
        if name in OPTIONS:
            raise DataError(f"parameter {name}: use the option {OPTIONS[name]} instead")
        default = defaults[name][0]
        _check_type(name, value, default)
        if isinstance(default, list) and default and not value:
            raise DataError(
                f"parameter {name}: expected values such as {default!r}; got an empty list"
            )
        for each in value if isinstance(value, list) else [value]:
            if isinstance(default, list):
                _check_type(name, each, default[0] if default else "")
            _check_range(name, each)
    return {
        name: value
        for name, value in given.items()
        if any(value != each for each in defaults[name])
    }


def _check_type(name: str, value: Any, default: Any) -> None:
    is_whole = type(default) is float and type(value) is int
    if not is_whole and type(value) is not type(default):
        raise DataError(
            f"parameter {name}: expected {type(default).__name__}, such as {json.dumps(default)}; got "
            f"{value!a:.80}"
        )


def _check_range(name: str, value: Any) -> None:
    if isinstance(value, Mapping):
        return
    if isinstance(value, str):
        if printable(value) != value:
            raise DataError(
                f"parameter {name}: expected readable text; got {value!a:.80}"
            )
        return
    low, high = RANGES.get(name, (-_LARGEST, _LARGEST))
    if not low <= value <= high:
        raise DataError(
            f"parameter {name}: expected {low:g} to {high:g}; got {value!a:.80}"
        )
    setting = SETTINGS.get(name, name)
    if setting in MPCSettings.__dataclass_fields__:
        try:
            MPCSettings(
                **{"N": max(value, 1), "N_h": value}
                if setting == "N_h"
                else {setting: value}
            )
        except (SolverError, TypeError, OverflowError) as error:
            raise DataError(f"parameter {name}: {error}") from error

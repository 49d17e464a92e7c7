"""Parameters of notebooks: known, of the right type and within their range before anything is started.

A parameter that is a setting of the controller (gamma, N_h, a_max, ...) is tried on `MPCSettings`; the others
that have a range stand in `RANGES`.  Of a list each value is checked.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...control.settings import MPCSettings
from ...errors import DataError, SolverError
from ...files import printable

SETTINGS = {"gamma": "gamma", "gammas": "gamma", "horizons": "N_h", "limits": "a_max"}
SETTINGS |= {f"{name}_b": name for name in ("gamma", "N_h", "a_max")}
"""Parameters that are settings of the controller by another name, or lists of them."""
_MANY = 2**31
RANGES: dict[str, tuple[float, float]] = {
    "seed": (0, 2**63), "space_width": (0.1, 100), "space_length": (0.1, 100), "duration": (0.1, 60),
    "min_distance": (0, 100), "min_speed": (0.01, 10), "q": (0.001, 0.5), "zone_speed": (0.01, 10),
    "intruders": (0, 0.5), "examples": (1, _MANY), "worlds": (1, _MANY), "n_jobs": (-1, _MANY),
    "fraction": (1e-6, 0.5), "r_max": (0.01, 100), "speeds": (0.01, 10), "lengths": (1e-3, 1e4),
    "eccentricities": (0, 0.999999), "size": (0.05, 20), "size_b": (0.05, 20), "speed": (0, 10),
}  # fmt: skip
"""Lowest and highest value."""
FOR_OPTIONS = {"data": "--data", "results": "--out"}
"""Parameters that the command line has options for."""
NEUTRAL = {*FOR_OPTIONS, "area", "n_jobs", "examples"}
"""Parameters that no check was made for: which data, how it is computed, what is shown."""


def check_parameters(given: Mapping[str, Any], sources: Sequence[Path]) -> dict[str, Any]:
    """Those that are not the default of every notebook that knows them.

    DataError unless each is known to one of these notebooks, of its type, and in its range.
    """
    defaults: dict[str, list[Any]] = {}
    for source in sources:
        for name, value in defaults_of(source).items():
            defaults.setdefault(name, []).append(value)
    unknown = set(given) - set(defaults)
    if unknown:
        known = ", ".join(sorted(defaults))
        raise DataError(
            f"unknown parameter {', '.join(map(printable, sorted(unknown)))}; the notebooks know {known}"
        )
    for name, value in given.items():
        if name in FOR_OPTIONS:
            raise DataError(f"parameter {name}: is set by {FOR_OPTIONS[name]}")
        default = defaults[name][0]
        _check_type(name, value, default)
        if isinstance(default, list):
            if default and not value:
                raise DataError(f"parameter {name}: expected values such as {default!r}; got none")
            for each in value:
                _check_type(name, each, default[0] if default else "")
        for each in value if isinstance(value, list) else [value]:
            _check_range(name, each)
    return {name: value for name, value in given.items() if any(value != each for each in defaults[name])}


def defaults_of(source: Path) -> dict[str, Any]:
    """What the cell tagged "parameters" of a notebook, a percent script, sets."""
    cells = re.split(r"^# %%", source.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {
        node.targets[0].id: ast.literal_eval(node.value)
        for head, _, body in (cell.partition("\n") for cell in cells)
        if re.search(r'tags=\[[^]]*"parameters"', head)
        for node in ast.parse(body).body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }


def _check_type(name: str, value: Any, default: Any) -> None:
    number = isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool)
    if not number and type(value) is not type(default):
        raise DataError(
            f"parameter {name}: expected {type(default).__name__}, such as {default!r}; got {_short(value)}"
        )


def _check_range(name: str, value: Any) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise DataError(f"parameter {name}: expected a finite number; got {value!r}")
    if isinstance(value, str) and printable(value) != value:
        raise DataError(f"parameter {name}: expected readable text; got {_short(value)}")
    low, high = RANGES.get(name, (-math.inf, math.inf))
    if not isinstance(value, str) and not low <= value <= high:
        raise DataError(f"parameter {name}: expected {low:g} to {high:g}; got {_short(value)}")
    if name == "n_jobs" and value == 0:
        raise DataError("parameter n_jobs: expected a number of processes, or -1 for every core; got 0")
    setting = SETTINGS.get(name, name)
    if setting in MPCSettings.__dataclass_fields__:
        try:
            MPCSettings(**{"N": max(value, 1), "N_h": value} if setting == "N_h" else {setting: value})
        except (SolverError, TypeError, OverflowError) as error:
            raise DataError(f"parameter {name}: {error}") from error


def _short(value: Any) -> str:
    """The value on one line, not too long to read."""
    try:
        text = ascii(value)
    except ValueError:  # a whole number of more digits than Python prints
        return "a number too long to print"
    return text if len(text) <= 80 else f"{text[:77]}..."

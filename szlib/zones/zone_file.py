"""The file of a social zone: versioned JSON, whole or not at all, and what is wrong with one that is none.

Version 2 adds the method, radii by direction, who was seen, intervals, and a checksum of all of it; version 1
(hulls only) loads.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import __version__
from ..errors import SzlibError, ZoneError
from ..files import write_file
from .ellipses import Ellipse
from .polar import PolarZone
from .respect_significance import NullTest
from .uncertainty import SECTORS, Uncertainty

FORMAT, VERSION = "szlib.SocialZone", 2
THINNEST_ZONE = 0.05
"""Semi-axis below which a zone of a file without a checksum is damage and no zone [m]: nobody is so thin."""
UNITS = "m, s, rad; frame of the reference pedestrian: x ahead, y to the left"

_TABLES = {
    "intervals": ("speed", "quantity", "low", "high"),
    "bands": ("speed", "direction", "low", "high"),
    "influence": ("speed", "encounter", "metres"),
}
_SEEN = ("speed", "encounters", *SECTORS)


def write_zone(path: Path, fields: Mapping[str, Any]) -> None:
    """Write the fields of a `SocialZone` to `path`; raises ZoneError where that is impossible."""
    radii, seen, uncertainty = fields["radii"], fields["seen"], fields["uncertainty"]
    content = {
        "format": FORMAT,
        "version": VERSION,
        "units": UNITS,
        "method": fields["method"],
        "r_max": fields["r_max"],
        "ellipses": [
            {"speed": v, "center": e.center, "semi_axes": e.semi_axes, "angle": e.angle}
            for v, e in sorted(fields["ellipses"].items())
        ],
        "undefined": [{"speed": v, "why": why} for v, why in sorted(fields["undefined"].items())],
        "provenance": fields["provenance"],
        "seen": None if seen is None else _columns(seen),
        "uncertainty": None if uncertainty is None else _record(uncertainty),
        "null_test": None if fields["null_test"] is None else fields["null_test"].record(),
        "radii": None if radii is None else {name: _plain(value) for name, value in vars(radii).items()},
        "hull_vertices": None if fields["vertices"] is None else fields["vertices"].tolist(),
    }
    try:
        content["checksum"] = _checksum(content)
        write_file(path, json.dumps(content, indent=1))
    except (SzlibError, OSError, TypeError, ValueError) as error:
        raise ZoneError(
            f"{path}: cannot write the zone ({error}); choose a file in a folder that exists and is "
            "writable, and keep to JSON values in the provenance"
        ) from error


def read_zone(path: Path) -> dict[str, Any]:
    """The fields of the zone in a file; raises ZoneError where it is none, or of a newer szlib."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:  # ValueError: bad UTF-8, JSON or numbers
        raise ZoneError(
            f"{path}: cannot be read as a zone ({error}); expected JSON written by SocialZone.save"
        ) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ZoneError(
            f'{path}: is JSON but no zone; expected "format": "{FORMAT}", as SocialZone.save writes it'
        )
    if content.get("version") not in range(1, VERSION + 1):
        raise ZoneError(
            f"{path}: has format version {content.get('version')!r}, this szlib {__version__} reads "
            f"1 to {VERSION}; install a newer szlib or fit the zone again"
        )
    if content["version"] == 1:
        unknown = dict.fromkeys(("seen", "uncertainty", "null_test", "radii"))
        content = {"method": "hull", **unknown, **content}
    return content


def zone_fields(content: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a `SocialZone` from the content of its file; damage shows as an ordinary Python error."""
    radii, seen, uncertainty = content["radii"], content["seen"], content["uncertainty"]
    vertices = content["hull_vertices"]
    ellipses = {_number(e["speed"]): _ellipse(e) for e in content["ellipses"]}
    if content["version"] == 1 and any(e.semi_axes[1] < THINNEST_ZONE for e in ellipses.values()):
        raise ValueError(f"an ellipse is thinner than {THINNEST_ZONE} m")
    return {
        "vertices": None if vertices is None else np.array(vertices, float),
        "r_max": _number(content["r_max"]),
        "ellipses": ellipses,
        "undefined": {float(u["speed"]): str(u["why"]) for u in content["undefined"]},
        "provenance": dict(content["provenance"]),
        "method": str(content["method"]),
        "radii": None if radii is None else PolarZone(**{k: np.array(v, float) for k, v in radii.items()}),
        "seen": None if seen is None else _table(seen, _SEEN),
        "uncertainty": None if uncertainty is None else _uncertainty(uncertainty),
        "null_test": None if content["null_test"] is None else NullTest.from_record(content["null_test"]),
    }


def check_whole(content: Mapping[str, Any], path: Path) -> None:
    """ZoneError unless the content of the file is what was written; version 1 has no checksum."""
    expected = content.get("checksum")
    if content["version"] > 1 and expected != _checksum(content):
        raise ZoneError(
            f"{path}: the zone in it is damaged: its checksum is {expected!r}, and not that of its content; "
            "a zone is not to be edited: fit and save it again"
        )


def _checksum(content: Mapping[str, Any]) -> str:
    """SHA-256 of everything else, as it is once written and read."""
    rest = json.loads(json.dumps({name: value for name, value in content.items() if name != "checksum"}))
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"expected a number; got {value!r}")
    return float(value)


def _ellipse(record: Mapping[str, Any]) -> Ellipse:
    (m, n), (a, b) = ([_number(each) for each in record[name]] for name in ("center", "semi_axes"))
    return Ellipse((m, n), (a, b), _number(record["angle"]))


def _record(uncertainty: Uncertainty) -> dict[str, Any]:
    tables = {name: _columns(getattr(uncertainty, name)) for name in _TABLES}
    return {**vars(uncertainty), **tables}


def _uncertainty(record: Mapping[str, Any]) -> Uncertainty:
    tables = {name: _table(record[name], columns) for name, columns in _TABLES.items()}
    return Uncertainty(**{**record, **tables})


def _table(content: Mapping[str, Any], columns: Sequence[str]) -> pd.DataFrame:
    table = pd.DataFrame({name: content[name] for name in columns})
    numbers = [name for name in columns if name in ("speed", "direction", "low", "high", "metres")]
    return table.astype(dict.fromkeys(numbers, float))


def _columns(table: pd.DataFrame) -> dict[str, list[Any]]:
    return {str(name): _plain(table[name].to_numpy()) for name in table}


def _plain(values: np.ndarray) -> list[Any]:
    """Lists of JSON values; NaN and infinity, which JSON has no words for, become null and text."""
    if values.dtype.kind != "f":
        return list(values.tolist())
    out = values.astype(object)
    out[np.isnan(values)], out[np.isposinf(values)] = None, "Infinity"
    return list(out.tolist())

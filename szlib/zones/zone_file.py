"""The JSON file of a social zone: written as a whole or not at all, and checked when it is read.

It holds a checksum of its content.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from .. import __version__
from ..core.errors import SzlibError, ZoneError
from ..core.files import write_file
from ..core.input_files import read_small, reading
from ..encounters.sensors import SensorCheck
from .ellipses import Ellipse
from .hulls import HullZone
from .polar import PolarZone
from .respect_test import NullTest, RespectRadius
from .uncertainty import Uncertainty
from .verdict import Verdict

Zone = TypeVar("Zone")

FORMAT, VERSION = "szlib.SocialZone", 4
UNITS = "m, s, rad; frame of the reference pedestrian: x ahead, y to the left"


def write_zone(
    path: Path, fields: Mapping[str, Any], verdicts: Mapping[float, Verdict]
) -> None:
    """Write the `fields` of a `SocialZone`, and its `verdicts` by speed, to `path`.

    The verdicts are for other programs: when the file is read, they are made again. Raises ZoneError if the
    file cannot be written.
    """
    shape = fields["shape"]
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
        "undefined": [
            {"speed": v, "why": reason}
            for v, reason in sorted(fields["undefined"].items())
        ],
        "provenance": fields["provenance"],
        "side_counts": fields["side_counts"],
        "uncertainty": fields["uncertainty"],
        "null_test": fields["null_test"],
        "verdicts": [
            {"speed": v, "verdict": each, "reasons": each.reasons}
            for v, each in verdicts.items()
        ],
        "radii": shape if isinstance(shape, PolarZone) else None,
        "hull_vertices": shape.vertices if isinstance(shape, HullZone) else None,
    }
    try:
        content = json.loads(json.dumps(content, default=_to_json))
        content["checksum"] = _checksum(content)
        write_file(path, json.dumps(content, indent=1))
    except (SzlibError, OSError, TypeError, ValueError) as error:
        raise ZoneError(
            f"{path}: cannot write the zone ({error}); choose a file in a folder that exists and is "
            "writable, and use only JSON values in the provenance"
        ) from error


def read_zone(path: Path, build: Callable[..., Zone]) -> Zone:
    """Read the file at `path` and pass the fields of its zone to `build`.

    Raises ZoneError if the file holds no zone, is damaged, or was written by a newer szlib.
    """
    content = _read_content(path)
    expected = content.pop("checksum", None)
    if expected != _checksum(content):
        raise ZoneError(
            f"{path}: the zone in it is damaged: its checksum is {expected!r}, which is not that of its "
            "content; do not edit zone files: fit and save the zone again"
        )
    try:
        return build(**_fields(content))
    except (
        KeyError,
        TypeError,
        IndexError,
        ValueError,
        OverflowError,
        AttributeError,
    ) as error:
        raise ZoneError(
            f"{path}: the zone in it is damaged ({error!r}); fit and save it again"
        ) from error


def _read_content(path: Path) -> dict[str, Any]:
    """The content of the file, a zone of a known version."""
    with reading(path, "as a zone", "JSON written by SocialZone.save", ZoneError):
        content = json.loads(read_small(path))
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise ZoneError(
            f'{path}: is JSON but no zone; expected "format": "{FORMAT}", as SocialZone.save writes it'
        )
    if content.get("version") != VERSION:
        raise ZoneError(
            f"{path}: has format version {content.get('version')!r}, this szlib {__version__} reads "
            f"{VERSION}; install the szlib that wrote it, or fit the zone again"
        )
    return content


def _fields(content: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a `SocialZone` from the content of its file; damage raises an ordinary Python error."""
    r_max, side_counts = float(content["r_max"]), content["side_counts"]
    uncertainty, null_test = content["uncertainty"], content["null_test"]
    if uncertainty is not None:
        tables = {name: _table(uncertainty[name]) for name in ("intervals", "bands")}
        uncertainty = Uncertainty(**{**uncertainty, **tables})
    if null_test is not None:
        statistics = tuple(map(float, null_test["null_statistics"]))
        respect = RespectRadius(**null_test["respect"])
        sensor = null_test.get("sensor")
        null_test |= {
            "null_statistics": statistics,
            "respect": respect,
            "sensor": None if sensor is None else SensorCheck(**sensor),
        }
        null_test = NullTest(**null_test)
    return {
        "shape": HullZone(np.array(content["hull_vertices"], float), r_max)
        if content["radii"] is None
        else PolarZone(
            **{
                name: np.array(values, float)
                for name, values in content["radii"].items()
            }
        ),
        "r_max": r_max,
        "ellipses": {
            float(e["speed"]): Ellipse(e["center"], e["semi_axes"], e["angle"])
            for e in content["ellipses"]
        },
        "undefined": {float(u["speed"]): str(u["why"]) for u in content["undefined"]},
        "provenance": dict(content["provenance"]),
        "method": str(content["method"]),
        "side_counts": None if side_counts is None else _table(side_counts),
        "uncertainty": uncertainty,
        "null_test": null_test,
    }


def _checksum(content: Mapping[str, Any]) -> str:
    """SHA-256 of everything else in the file."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _table(content: Mapping[str, Any]) -> pd.DataFrame:
    table = pd.DataFrame(content)
    numbers = table.columns.intersection(["speed", "direction", "low", "high"])
    return table.astype(dict.fromkeys(numbers, float))


def _to_json(value: Any) -> Any:
    """JSON values of a table, array or group of fields; NaN is null and infinity "Infinity"."""
    if isinstance(value, pd.DataFrame):
        return {name: column.to_numpy() for name, column in value.items()}
    if isinstance(
        value, Uncertainty | NullTest | RespectRadius | SensorCheck | PolarZone
    ):
        return vars(value)
    if isinstance(value, np.generic):
        return value.item()
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{type(value).__name__} is no JSON value")
    out = value.astype(object)
    if value.dtype.kind == "f":
        out[np.isnan(value)], out[np.isposinf(value)] = None, "Infinity"
    return out.tolist()

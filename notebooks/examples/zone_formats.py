"""A zone in the formats of other programs: GeoJSON and parameters of ROS 2; a fitted one in LaTeX, too.

A reference zone goes into a file as well:

    Path("zone.yaml").write_text(as_ros_params(szlib.reference_zone("hall")))
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import yaml

from szlib import Ellipse, SocialZone, __version__
from szlib.workbook.fit_command import format_table
from szlib.zones.ellipses import circle_around
from szlib.zones.reference_zones import ReferenceZone

REFERENCE_SPEED = 1.1  # of the people of a reference zone, about [m/s]
_DIGITS = 4  # decimals of metres and radians: tenths of a millimetre
_SPECIAL = {
    "%": r"\%",
    "&": r"\&",
    "_": r"\_",
    "#": r"\#",
}  # letters that LaTeX reads as commands


def as_latex(zone: SocialZone) -> str:
    """The table of a `zone` as a LaTeX `tabular` with the rules of the package booktabs.

    It needs no other package; `pandas.DataFrame.to_latex`, for all columns of its table, needs Jinja2.
    """
    table = format_table(zone)
    texts: list[list[str]] = [list(table.columns), *table.to_numpy().tolist()]
    rows = [" & ".join(map(_escape, row)) + r" \\" for row in texts]
    lines = [
        r"\begin{tabular}{rllrl}",
        r"\toprule",
        rows[0],
        r"\midrule",
        *rows[1:],
        r"\bottomrule",
    ]
    return "\n".join([*lines, r"\end{tabular}", ""])


def _escape(text: str) -> str:
    return "".join(_SPECIAL.get(letter, letter) for letter in text)


def _list_ellipses(zone: SocialZone | ReferenceZone) -> list[tuple[float, Ellipse, str]]:
    """Speed [m/s], ellipse and verdict of each ellipse of a `zone`."""
    if isinstance(zone, ReferenceZone):
        return [(REFERENCE_SPEED, zone.ellipse, str(zone.verdict))]
    return [(v, each, str(zone.verdict(v))) for v, each in sorted(zone.ellipses.items())]


def as_geojson(zone: SocialZone | ReferenceZone, n: int = 72) -> str:
    """The ellipses of a `zone` as GeoJSON: a polygon of `n` corners for each speed, with its verdict.

    Coordinates are metres in the frame of the person, x ahead, y to the left: no longitudes.
    """
    features = []
    for speed, ellipse, verdict in _list_ellipses(zone):
        ring = ellipse.curve(n + 1).round(_DIGITS)
        ring[-1] = ring[0]
        properties = {
            "speed": speed,
            "verdict": verdict,
            **_numbers(ellipse),
        }
        geometry = {"type": "Polygon", "coordinates": [ring.tolist()]}
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    return json.dumps({"type": "FeatureCollection", "features": features}, indent=1)


def as_ros_params(zone: SocialZone | ReferenceZone, layer: str = "social_zone") -> str:
    """The ellipses of a `zone` as YAML: parameters of ROS 2, lists with one entry for each speed.

    They stand under ``/**: ros__parameters``, so that every node finds them in the name of the costmap
    `layer`: speeds [m/s], center_x, center_y, semi_major, semi_minor [m], angle [rad], verdict, and the
    radius [m] of the circle that contains the zone in every direction, for layers that know only circles.
    """
    speeds, ellipses, verdicts = map(list, zip(*_list_ellipses(zone), strict=True))
    numbers = [_numbers(ellipse) for ellipse in ellipses]
    lists: dict[str, list[Any]] = {name: [each[name] for each in numbers] for name in numbers[0]}
    circles = [circle_around(ellipse).semi_axes[0] for ellipse in ellipses]
    # not too small
    radii = [float(np.ceil(radius * 10**_DIGITS) / 10**_DIGITS) for radius in circles]
    values = {
        "speeds": speeds,
        **lists,
        "radius": radii,
        "verdict": verdicts,
    }
    text = yaml.safe_dump({"/**": {"ros__parameters": {layer: values}}}, sort_keys=False, width=100)
    head = (
        f"szlib {__version__}: social zones by method {zone.method}, one for each walking speed [m/s]",
        "ellipses in the frame of the person, x ahead, y to the left [m, rad]",
        "radius: of the circle around the person that contains the ellipse in every direction [m]",
    )
    return "".join(f"# {line}\n" for line in head) + str(text)


def _numbers(ellipse: Any) -> dict[str, float]:
    """Centre, semi-axes and angle of an ellipse by name [m, rad]."""
    values = (*ellipse.center, *ellipse.semi_axes, ellipse.angle)
    names = ("center_x", "center_y", "semi_major", "semi_minor", "angle")
    return {name: round(float(value), _DIGITS) for name, value in zip(names, values, strict=True)}

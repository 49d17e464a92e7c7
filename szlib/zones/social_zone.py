"""The social zone: from samples of encounters to one ellipse for each speed, and to a file.

`SocialZone.fit` is the paper's whole section 2 behind one name: outliers, hull, slices, ellipses.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import __version__
from ..errors import DataWarning, ZoneError
from ..tracks import funnels
from ..tracks.clock import check_columns
from .ellipses import Ellipse, minimum_enclosing_ellipse_of_curve
from .hulls import Slice, hull_vertices, slice_hull
from .outliers import R_MAX, complementary_points, remove_outliers

SPEEDS = (0.5, 0.7, 0.9, 1.1, 1.3, 1.5)
"""Speeds of the reference pedestrian whose zones are fitted [m/s] (assumed; the paper shows a range)."""

_FORMAT, _VERSION = "szlib.SocialZone", 1


@dataclass(frozen=True, eq=False)
class SocialZone:
    """Minimum social zones by speed, in the reference pedestrian's frame (paper, fig. 5).

    Parameters
    ----------
    vertices : of the hull over (x', y', speed), shape (k, 3) [m, m, m/s]: all that the zone needs.
    r_max : distance that the complement is taken from [m].
    ellipses : the fitted ellipse by speed.
    undefined : why there is none, by speed, where one was asked for and could not be.
    provenance : data, parameters and the row counts of every stage it came from.

    Raises
    ------
    ZoneError : the vertices have no hull, or r_max is no positive distance.
    """

    vertices: np.ndarray
    r_max: float
    ellipses: dict[float, Ellipse]
    undefined: dict[float, str] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        hull_vertices(self.vertices)
        if not 0 < self.r_max < np.inf:
            raise ZoneError(f"r_max must be a positive distance in metres; got {self.r_max}")

    @classmethod
    def fit(
        cls,
        samples: pd.DataFrame,
        *,
        r_max: float = R_MAX,
        outlier_fraction: float | None = None,
        speeds: Iterable[float] = SPEEDS,
        neighbours: int | None = None,
        speed_scale: float | None = None,
    ) -> SocialZone:
        """Fit the zones to samples as from `szlib.find_encounters`.

        Parameters are those of `szlib.remove_outliers` (`outlier_fraction=0.002` is the paper's way, None
        judges whole encounters), and `speeds` [m/s] are the slices to fit.
        A speed without a zone gives a DataWarning and is kept in `undefined`.

        Raises
        ------
        DataError : the samples lack columns or are too few for LOF.
        ZoneError : there is no hull, or none of the speeds has a zone.
        """
        check_columns(samples, ["los_angle", "distance", "speed"])
        inliers = remove_outliers(
            samples, outlier_fraction, r_max, neighbours=neighbours, speed_scale=speed_scale
        )
        points = np.column_stack(
            [complementary_points(inliers, r_max=r_max), inliers["speed"].to_numpy(float)]
        )
        vertices = hull_vertices(points)
        ellipses, undefined = {}, {}
        for speed in map(float, speeds):
            try:
                ellipses[speed] = _enclose(slice_hull(vertices, speed, r_max=r_max))
            except ZoneError as error:
                undefined[speed] = str(error)
        if not ellipses:
            raise ZoneError("no speed has a zone: " + ("; ".join(undefined.values()) or "none was asked for"))
        if undefined:
            warnings.warn("; ".join(undefined.values()), DataWarning, stacklevel=2)
        inside = {"inside the hull": len(points) - len(vertices)}
        provenance = {
            "szlib": __version__,
            "days": sorted(map(str, samples["day"].unique())) if "day" in samples else [],
            "encounters": int(samples["encounter"].nunique()) if "encounter" in samples else None,
            "parameters": {
                "r_max": float(r_max),
                "outlier_fraction": None if outlier_fraction is None else float(outlier_fraction),
                "neighbours": None if neighbours is None else int(neighbours),
                "speed_scale": None if speed_scale is None else float(speed_scale),
            },
            "funnel": [*funnels.of(inliers), funnels.stage("hull", len(points), len(vertices), inside)],
        }
        return cls(vertices, float(r_max), ellipses, undefined, provenance)

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed in the data [m/s]."""
        return float(self.vertices[:, 2].min()), float(self.vertices[:, 2].max())

    def slice(self, speed: float) -> Slice:
        """The hull's slice at a speed [m/s]; raises ZoneError where the zone is undefined."""
        return slice_hull(self.vertices, speed, r_max=self.r_max)

    def boundary(self, speed: float, n: int = 361) -> np.ndarray:
        """The zone's boundary r_zone(theta) at a speed [m/s], n points in the person's frame, (n, 2) [m]."""
        return self.slice(speed).boundary(np.linspace(-np.pi, np.pi, n))

    def ellipse(self, speed: float) -> Ellipse:
        """The smallest ellipse around the zone at any speed [m/s] inside the data's range.

        Raises ZoneError, naming the speed, the range and the missing directions, where it is undefined.
        """
        known = self.ellipses.get(float(speed))
        return known if known is not None else _enclose(self.slice(speed))

    def table(self) -> pd.DataFrame:
        """One row a fitted speed: speed [m/s], center_x, center_y, a, b [m], angle_deg [deg], area [m2]."""
        rows = [
            (v, *e.center, *e.semi_axes, np.degrees(e.angle), e.area)
            for v, e in sorted(self.ellipses.items())
        ]
        return pd.DataFrame(rows, columns=["speed", "center_x", "center_y", "a", "b", "angle_deg", "area"])

    def save(self, path: str | Path) -> None:
        """Write the zone as JSON; the file is replaced as a whole or not at all."""
        content = {
            "format": _FORMAT,
            "version": _VERSION,
            "units": "m, s, rad; frame of the reference pedestrian: x ahead, y to the left",
            "r_max": self.r_max,
            "ellipses": [
                {"speed": v, "center": e.center, "semi_axes": e.semi_axes, "angle": e.angle}
                for v, e in sorted(self.ellipses.items())
            ],
            "undefined": [{"speed": v, "why": why} for v, why in sorted(self.undefined.items())],
            "provenance": self.provenance,
            "hull_vertices": self.vertices.tolist(),
        }
        path = Path(path)
        unfinished = path.parent / f".{path.name}.{os.getpid()}"
        try:
            unfinished.write_text(json.dumps(content, indent=1), encoding="utf-8")
            unfinished.replace(path)
        except (OSError, TypeError, ValueError) as error:
            with suppress(OSError):  # what could not be written may not be there to be removed
                unfinished.unlink()
            raise ZoneError(
                f"{path}: cannot write the zone ({error}); choose a file in a folder that exists and is "
                "writable, and keep to JSON values in the provenance"
            ) from error

    @classmethod
    def load(cls, path: str | Path) -> SocialZone:
        """Read a zone written by `save`; raises ZoneError where the file is none, or of a newer szlib."""
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:  # ValueError: bad UTF-8, JSON or numbers
            raise ZoneError(
                f"{path}: cannot be read as a zone ({error}); expected JSON written by SocialZone.save"
            ) from error
        if not isinstance(content, dict) or content.get("format") != _FORMAT:
            raise ZoneError(
                f'{path}: is JSON but no zone; expected "format": "{_FORMAT}", as SocialZone.save writes it'
            )
        if content.get("version") != _VERSION:
            raise ZoneError(
                f"{path}: has format version {content.get('version')!r}, this szlib {__version__} reads "
                f"{_VERSION}; install a newer szlib or fit the zone again"
            )
        try:
            vertices = np.array(content["hull_vertices"], float)
            ellipses = {
                float(e["speed"]): Ellipse(e["center"], e["semi_axes"], e["angle"])
                for e in content["ellipses"]
            }
            undefined = {float(u["speed"]): str(u["why"]) for u in content["undefined"]}
            return cls(vertices, float(content["r_max"]), ellipses, undefined, dict(content["provenance"]))
        except (KeyError, TypeError, IndexError, ValueError, OverflowError) as error:
            raise ZoneError(
                f"{path}: the zone in it is damaged ({error!r}); fit and save it again"
            ) from error


def _enclose(section: Slice) -> Ellipse:
    return minimum_enclosing_ellipse_of_curve(section.boundary, section.corner_angles)

"""The social zone: from samples of encounters to one ellipse for each speed, and to a file.

`SocialZone.fit` estimates it in one of three ways:

hull      where (nearly) nobody ever was: outliers, hull, slices, smallest ellipses (paper, sec. 2)
quantile  where all but a share q of encounters keep out: does not shrink as data grows
respect   where people were half as often as they would be if they took no notice of each other

and says how sure it is: intervals, who was seen on which side, and at which speeds that is enough.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import __version__
from ..checks import check_columns
from ..encounters.null_model import NullEncounters
from ..errors import DataWarning, ZoneError
from .ellipses import Ellipse
from .enclosing_ellipse import minimum_enclosing_ellipse_of_curve
from .hulls import HullEstimator, Slice, hull_vertices, slice_hull
from .outliers import R_MAX, encounter_numbers
from .polar import PolarZone
from .quantile import QuantileEstimator
from .respect_estimator import RespectEstimator
from .respect_significance import NullTest, null_test
from .uncertainty import QUANTITIES, RESAMPLES, Estimate, Uncertainty, count_seen, measure, missing_sides
from .zone_file import check_whole, read_zone, write_zone, zone_fields

SPEEDS = (0.5, 0.7, 0.9, 1.1, 1.3, 1.5)
"""Speeds of the reference pedestrian whose zones are fitted [m/s] (assumed; the paper shows a range)."""

METHODS: dict[str, tuple[Callable[..., Estimate], tuple[str, ...]]] = {
    "hull": (HullEstimator.of, ("outlier_fraction", "neighbours", "speed_scale")),
    "quantile": (QuantileEstimator.of, ("q",)),
    "respect": (RespectEstimator.of, ("speed_width",)),
}
"""Ways to a zone, and the keywords of `SocialZone.fit` that belong to each."""


@dataclass(frozen=True, eq=False)
class SocialZone:
    """Minimum social zones by speed, in the reference pedestrian's frame (paper, fig. 5).

    Parameters
    ----------
    vertices : of the hull over (x', y', speed), shape (k, 3) [m, m, m/s]; None: not a hull's zone.
    r_max : distance within which people count, and that the complement is taken from [m].
    ellipses : the fitted ellipse by speed.
    undefined : why there is none, by speed, where one was asked for and could not be.
    provenance : data, parameters and the row counts of every stage it came from.
    method : how it was estimated, one of `METHODS`.
    radii : by speed and direction, of a zone that is not a hull's.
    seen : encounters by speed and side (see `szlib.zones.uncertainty.count_seen`); None: not known.
    uncertainty : intervals; None: not known.
    null_test : whether it is respect at all; None: not tested.

    Raises
    ------
    ZoneError : neither vertices that have a hull nor radii, or both, or r_max is no positive distance.
    """

    vertices: np.ndarray | None
    r_max: float
    ellipses: dict[float, Ellipse]
    undefined: dict[float, str] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)
    method: str = "hull"
    radii: PolarZone | None = None
    seen: pd.DataFrame | None = None
    uncertainty: Uncertainty | None = None
    null_test: NullTest | None = None

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ZoneError(f"method must be one of {', '.join(METHODS)}; got {self.method!r}")
        if (self.method == "hull") != (self.radii is None) or (self.vertices is None) == (self.radii is None):
            raise ZoneError("a zone has either a hull's vertices (method hull) or radii (any other method)")
        if self.vertices is not None:
            hull_vertices(self.vertices)
        if not 0 < self.r_max < np.inf:
            raise ZoneError(f"r_max must be a positive distance in metres; got {self.r_max}")

    @classmethod
    def fit(
        cls,
        samples: pd.DataFrame,
        *,
        method: str | None = None,
        r_max: float = R_MAX,
        speeds: Iterable[float] = SPEEDS,
        outlier_fraction: float | None = None,
        neighbours: int | None = None,
        speed_scale: float | None = None,
        q: float | None = None,
        null: NullEncounters | None = None,
        speed_width: float | None = None,
        resamples: int = RESAMPLES,
        seed: int = 0,
    ) -> SocialZone:
        """Fit the zones to samples as from `szlib.find_encounters`.

        Parameters
        ----------
        samples : a table with los_angle [rad], distance [m], speed [m/s], encounter; with ref_id and
            other_id people are drawn anew, not encounters; with t paths can be smoothed.
        method : "quantile", "hull" (the paper's) or "respect".  None takes the quantile, which does not
            shrink as people are added, or the hull where one of its keywords is given.
        r_max : distance within which people count [m].
        speeds : whose zones are fitted [m/s].
        outlier_fraction, neighbours, speed_scale : of the hull, as in `szlib.remove_outliers`:
            outlier_fraction=0.002 is the paper's way, None judges whole encounters.
        q : of the quantile, the share of encounters that may enter (0.05).
        speed_width : of respect, over how wide a range speeds are taken together (0.2) [m/s]; inf: all.
        null : the null model, from `szlib.null_encounters`, that respect needs, and that a zone of any
            method is tested against (`null_test`).
        resamples : zones estimated anew for the intervals; 0: no intervals.
        seed : of the resampling.

        One DataWarning names the speeds that have no zone (`undefined`) or too few people to rely on.

        Raises
        ------
        DataError : the samples lack columns, or are too few.
        ZoneError : a keyword belongs to another method, or none of the speeds has a zone.
        """
        given = {
            "outlier_fraction": outlier_fraction,
            "neighbours": neighbours,
            "speed_scale": speed_scale,
            "q": q,
            "speed_width": speed_width,
        }
        method, options = _options_of(method, given)
        check_columns(samples, ["los_angle", "distance", "speed"])
        asked = sorted({float(speed) for speed in speeds})
        if not asked:
            raise ZoneError("no speed has a zone: none was asked for")
        if method == "respect":
            options["null"] = null
        estimate = METHODS[method][0](samples, r_max=r_max, **options)
        provenance = _provenance(samples, {"method": method, "r_max": float(r_max)}, estimate)
        zone = cls(estimate.vertices, float(r_max), {}, {}, provenance, method, estimate.radii(asked))
        ellipses, undefined = zone._fit_all(asked)
        if not ellipses:
            half = f"half of the samples are slower than {samples['speed'].median():.1f} m/s"
            why = "; ".join(undefined.values())
            raise ZoneError(f"no speed has a zone: {why}; {half}: ask for a speed near that, or add data")
        tested = None if null is None else null_test(samples, null)
        zone = replace(zone, ellipses=ellipses, undefined=undefined, null_test=tested)
        if "encounter" in samples:
            zone = replace(zone, seen=count_seen(samples, asked, r_max=r_max))
            if resamples:
                sure = measure(estimate, list(ellipses), resamples=resamples, seed=seed)
                zone = replace(zone, uncertainty=sure)
        told = [*undefined.values(), *filter(None, map(zone.missing, ellipses))]
        if told:
            warnings.warn("; ".join(dict.fromkeys(told)), DataWarning, stacklevel=2)
        return zone

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the hull's data, or of the speeds that radii were fitted for [m/s]."""
        v = self.radii.speeds if self.radii else self._hull()[:, 2]
        return float(v.min()), float(v.max())

    def slice(self, speed: float) -> Slice:
        """The hull's slice at a speed [m/s]; ZoneError where the zone is undefined, or not a hull's."""
        return slice_hull(self._hull(), speed, r_max=self.r_max)

    def boundary(self, speed: float, n: int = 361) -> np.ndarray:
        """The zone's boundary r_zone(theta) at a speed [m/s], n points in the person's frame, (n, 2) [m].

        Not a hull's: linear between directions and fitted speeds, NaN where nobody was seen.
        """
        theta = np.linspace(-np.pi, np.pi, n)
        return self.radii.boundary(speed, theta) if self.radii else self.slice(speed).boundary(theta)

    def ellipse(self, speed: float) -> Ellipse:
        """The zone's ellipse at any speed [m/s] inside the data's range.

        A DataWarning says what is missing where the speed is not `adequate`.  Raises ZoneError, naming the
        speed, the range and the missing directions, where it is undefined.
        """
        known = self.ellipses.get(float(speed))
        ellipse = known if known is not None else self._fitted(speed)
        if missing := self.missing(speed):
            warnings.warn(missing, DataWarning, stacklevel=2)
        return ellipse

    def adequate(self, speed: float) -> bool:
        """Whether enough encounters were seen on every side to rely on the zone at a speed [m/s]."""
        return not self.missing(speed)

    def missing(self, speed: float) -> str:
        """What the zone at a speed [m/s] lacks to be relied on; "" where it is adequate."""
        if self.seen is None:
            return (
                "the zone is of unknown worth: who was seen on which side is not known (an older file, or "
                "samples without `encounter`); fit it again"
            )
        return missing_sides(self.seen, float(speed))

    def table(self) -> pd.DataFrame:
        """One row a fitted speed.

        speed [m/s]; center_x, center_y, a, b [m], angle_deg [deg], area [m2], each with _low and _high (its
        interval, NaN where there is none); influence: what one encounter's absence moves at most [m];
        encounters within r_max at that speed; adequate.
        """
        rows = [
            (v, *e.center, *e.semi_axes, np.degrees(e.angle), e.area)
            for v, e in sorted(self.ellipses.items())
        ]
        table = pd.DataFrame(rows, columns=["speed", *QUANTITIES]).set_index("speed")
        sure, seen = self.uncertainty, self.seen
        for name in QUANTITIES:
            for end in ("low", "high"):
                table[f"{name}_{end}"] = (
                    np.nan
                    if sure is None
                    else sure.intervals.pivot(index="speed", columns="quantity")[end][name]
                )
        table["influence"] = np.nan if sure is None else sure.influence.set_index("speed")["metres"]
        table["encounters"] = np.nan if seen is None else seen.set_index("speed")["encounters"]
        return table.assign(adequate=[self.adequate(v) for v in table.index]).reset_index()

    def save(self, path: str | Path) -> None:
        """Write the zone as JSON; the file is replaced as a whole or not at all."""
        write_zone(Path(path), vars(self))

    @classmethod
    def load(cls, path: str | Path) -> SocialZone:
        """Read a zone written by `save`; raises ZoneError where the file is none, or of a newer szlib."""
        content = read_zone(Path(path))
        try:
            zone = cls(**zone_fields(content))
        except (KeyError, TypeError, IndexError, ValueError, OverflowError, AttributeError) as error:
            raise ZoneError(
                f"{path}: the zone in it is damaged ({error!r}); fit and save it again"
            ) from error
        check_whole(content, Path(path))
        return zone

    def _hull(self) -> np.ndarray:
        if self.vertices is None:
            raise ZoneError(f"a zone of method {self.method!r} has no hull; ask its boundary or ellipse")
        return self.vertices

    def _fit_all(self, speeds: Sequence[float]) -> tuple[dict[float, Ellipse], dict[float, str]]:
        """The ellipses by speed, and why there is none."""
        ellipses, undefined = {}, {}
        for speed in speeds:
            try:
                ellipses[speed] = self._fitted(speed)
            except ZoneError as error:
                undefined[speed] = str(error)
        return ellipses, undefined

    def _fitted(self, speed: float) -> Ellipse:
        if self.radii is not None:
            return self.radii.ellipse(speed)
        section = self.slice(speed)
        return minimum_enclosing_ellipse_of_curve(section.boundary, section.corner_angles)


def _provenance(samples: pd.DataFrame, parameters: Mapping[str, Any], estimate: Estimate) -> dict[str, Any]:
    """Where a zone comes from: version, days, encounters, parameters and funnel."""
    return {
        "szlib": __version__,
        "days": sorted(map(str, samples["day"].unique())) if "day" in samples else [],
        "encounters": len(encounter_numbers(samples)[1]) if "encounter" in samples else None,
        "parameters": {**parameters, **estimate.parameters},
        "funnel": estimate.funnel,
    }


def _options_of(method: str | None, given: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """The method, and the keywords given, all its own; ZoneError for an unknown one or a stray keyword."""
    options = {name: value for name, value in given.items() if value is not None}
    if method is None:
        method = "hull" if options.keys() & set(METHODS["hull"][1]) else "quantile"
    if method not in METHODS:
        raise ZoneError(f"method must be one of {', '.join(METHODS)}; got {method!r}")
    for name in options:
        if name not in METHODS[method][1]:
            home = next(m for m, (_, names) in METHODS.items() if name in names)
            raise ZoneError(f'{name} belongs to method="{home}"; got method="{method}": drop one of them')
    return method, options

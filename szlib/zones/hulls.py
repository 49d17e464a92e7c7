"""The convex hull over (x', y', speed), its slices, and the zone they leave free (paper, sec. 2).

A slice of the hull at one speed is a convex polygon around the origin of the complementary plane.
With R'(theta) the distance from the origin to its edge, people at that speed were nowhere nearer
than

    r_zone(theta) = r_max - R'(theta)

which is the *minimum social zone*.  Map first, enclose second: an ellipse around the slice itself
is not a zone.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from ..errors import ZoneError
from ..tracks import funnels
from .enclosing_ellipse import minimum_enclosing_ellipse
from .outliers import complementary_points, encounter_numbers, remove_outliers
from .polar import DIRECTIONS


def hull_vertices(points: ArrayLike) -> np.ndarray:
    """Vertices of the convex hull of points (n, 3): x' [m], y' [m], speed [m/s]; shape (k, 3).

    Raises ZoneError for fewer than four points, all points in a plane, or a value that is not finite.
    """
    hull = _hull(points)
    return np.asarray(hull.points[hull.vertices])


def _hull(points: ArrayLike) -> ConvexHull:
    points = np.asarray(points, float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ZoneError(f"a hull needs points of shape (n, 3): x', y', speed; got shape {points.shape}")
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise ZoneError(f"point {row} of the hull is not finite: {points[row].tolist()}; drop it first")
    if len(points) < 4:
        raise ZoneError(f"a hull in three dimensions needs at least 4 points; got {len(points)}; add data")
    try:
        return ConvexHull(points)
    except QhullError as error:
        spread = np.ptp(points, axis=0)
        raise ZoneError(
            f"all {len(points)} points lie in one plane (or on a line), so they have no hull; spread of "
            f"x', y', speed: {spread[0]:.3g} m, {spread[1]:.3g} m, {spread[2]:.3g} m/s; "
            "data of more bearings and speeds is needed"
        ) from error


@dataclass(frozen=True, eq=False)
class Slice:
    """One slice of the hull, at one speed.

    Parameters
    ----------
    polygon : corners in the complementary plane, counter-clockwise, shape (k, 2) [m].
    speed : of the reference pedestrian [m/s].
    r_max : distance that the complement is taken from [m].
    """

    polygon: np.ndarray
    speed: float
    r_max: float

    def __post_init__(self) -> None:
        if (self._edges()[1] <= 0).any():
            low, high = np.degrees(self._missing_directions())
            raise ZoneError(
                f"the zone at {self.speed:g} m/s is undefined: nobody was seen in the directions from "
                f"{low:.0f} counter-clockwise to {high:.0f} deg (the origin is outside the slice); "
                "more data, or another speed, is needed"
            )

    @property
    def corner_angles(self) -> np.ndarray:
        """Directions of the corners, sorted [rad]: between them the zone's boundary is smooth."""
        return np.sort(np.arctan2(self.polygon[:, 1], self.polygon[:, 0]))

    def reach(self, theta: ArrayLike) -> np.ndarray:
        """R'(theta), distance from the origin to the polygon's edge; same shape as theta [m]."""
        normals, offsets = self._edges()
        theta = np.asarray(theta, float)
        along = np.cos(theta)[..., None] * normals[:, 0] + np.sin(theta)[..., None] * normals[:, 1]
        return np.asarray(
            np.min(np.where(along > 0, offsets / np.where(along > 0, along, 1.0), np.inf), axis=-1)
        )

    def boundary(self, theta: ArrayLike) -> np.ndarray:
        """The zone's boundary r_zone(theta) as points in the reference pedestrian's frame, (..., 2) [m]."""
        theta = np.asarray(theta, float)
        directions = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
        return np.asarray((self.r_max - self.reach(theta))[..., None] * directions)

    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Outward unit normals (k, 2) and distances from the origin (k,) of the polygon's edges."""
        along = np.roll(self.polygon, -1, axis=0) - self.polygon
        normals = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
        return normals, np.einsum("ij,ij->i", normals, self.polygon)

    def _missing_directions(self) -> tuple[float, float]:
        """The range of directions that leaves the origin without meeting the polygon, in (-pi, pi] [rad]."""
        away = self.polygon[np.hypot(*self.polygon.T) > 0]
        angles = np.sort(np.arctan2(away[:, 1], away[:, 0]))
        widest = int(np.argmax(np.diff(np.r_[angles, angles[0] + 2 * np.pi])))
        return float(angles[widest]), float(angles[(widest + 1) % len(angles)])


def slice_hull(points: ArrayLike, speed: float, *, r_max: float) -> Slice:
    """Section of the hull of points (n, 3) with the plane of one speed.

    Raises ZoneError where the speed is not inside the hull's range, or the zone is undefined there.
    """
    hull = _hull(points)
    v = hull.points[:, 2]
    low, high = v[hull.vertices].min(), v[hull.vertices].max()
    if not low < speed < high:
        raise ZoneError(
            f"the zone at {speed:g} m/s is undefined: the data covers {low:.3f} to {high:.3f} m/s"
        )
    edges = np.unique(
        np.sort(np.vstack([hull.simplices[:, pair] for pair in ((0, 1), (1, 2), (2, 0))]), axis=1), axis=0
    )
    i, j = edges[(v[edges[:, 0]] - speed) * (v[edges[:, 1]] - speed) <= 0].T
    i, j = i[v[i] != v[j]], j[v[i] != v[j]]
    share = ((speed - v[i]) / (v[j] - v[i]))[:, None]
    section = hull.points[i, :2] + share * (hull.points[j, :2] - hull.points[i, :2])
    try:
        outline = ConvexHull(section)
    except QhullError as error:
        raise ZoneError(
            f"the zone at {speed:g} m/s is undefined: the hull has no extent there; add data"
        ) from error
    return Slice(section[outline.vertices], float(speed), float(r_max))


@dataclass(frozen=True, eq=False)
class HullEstimator:
    """The paper's way to zones: outliers, hull, slices, smallest ellipses; to go again with other people.

    Parameters
    ----------
    points : inliers (x', y', speed), shape (n, 3) [m, m, m/s].
    encounter : which of `encounters` each belongs to, shape (n,).
    encounters : the first of each encounter's inliers.
    r_max : distance that the complement is taken from [m].
    parameters, funnel : for the provenance.
    """

    points: np.ndarray
    encounter: NDArray[np.intp]
    encounters: pd.DataFrame
    r_max: float
    parameters: dict[str, Any]
    funnel: list[dict[str, Any]]
    extreme = True

    @classmethod
    def of(
        cls,
        samples: pd.DataFrame,
        *,
        r_max: float,
        outlier_fraction: float | None = None,
        neighbours: int | None = None,
        speed_scale: float | None = None,
    ) -> HullEstimator:
        """From samples; parameters and errors as in `szlib.remove_outliers`."""
        inliers = remove_outliers(
            samples, outlier_fraction, r_max, neighbours=neighbours, speed_scale=speed_scale
        )
        speed = inliers["speed"].to_numpy(float)
        points = np.column_stack([complementary_points(inliers, r_max=r_max), speed])
        count = len(hull_vertices(points))
        parameters = {
            "outlier_fraction": None if outlier_fraction is None else float(outlier_fraction),
            "neighbours": None if neighbours is None else int(neighbours),
            "speed_scale": None if speed_scale is None else float(speed_scale),
        }
        inside = {"inside the hull": len(points) - count}
        funnel = [*funnels.get(inliers), funnels.stage("hull", len(points), count, inside)]
        return cls(points, *encounter_numbers(inliers), float(r_max), parameters, funnel)

    @property
    def vertices(self) -> np.ndarray:
        """Of the hull, shape (k, 3) [m, m, m/s]."""
        return hull_vertices(self.points)

    def radii(self, speeds: Sequence[float]) -> None:
        """None: the vertices tell all."""

    def refit(
        self, weights: np.ndarray, speeds: Sequence[float], rng: np.random.Generator | None = None
    ) -> np.ndarray:
        """Ellipses (k, s, 5) of the encounters whose weights (k, n) are above 0; NaN: no zone.

        Straight from the hull's faces, around the boundary in 72 directions.  Nothing else is drawn.
        """
        ellipses = np.full((len(weights), len(speeds), 5), np.nan)
        unit = np.column_stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
        start: dict[int, list[int]] = {}
        for i, weight in enumerate(weights):
            with suppress(ZoneError):
                reach = _reach(_hull(self.points[weight[self.encounter] > 0]), unit, speeds)
                for j in map(int, np.flatnonzero(np.isfinite(reach).all(axis=1))):
                    boundary = (self.r_max - reach[j])[:, None] * unit
                    ellipse = minimum_enclosing_ellipse(boundary, start=start.get(j, []))
                    ellipses[i, j] = [*ellipse.center, *ellipse.semi_axes, ellipse.angle]
                    on = (boundary[:, None] == ellipse.support).all(axis=-1).any(axis=1)
                    start[j] = np.flatnonzero(on).tolist()
        return ellipses

    def leave_one_out(self, speeds: Sequence[float]) -> tuple[NDArray[np.intp], np.ndarray]:
        """The encounters that the hull rests on (k,), and the ellipses (k, s, 5) without each of them.

        A new vertex is a point of these encounters, or a vertex of the hull of all others.
        """
        on = np.unique(self.encounter[_hull(self.points).vertices])
        theirs = np.isin(self.encounter, on)
        kept = np.flatnonzero(theirs)
        with suppress(ZoneError):
            rest = np.flatnonzero(~theirs)
            kept = np.union1d(kept, rest[_hull(self.points[rest]).vertices])
        shell = replace(self, points=self.points[kept], encounter=self.encounter[kept])
        weights = np.ones((len(on), len(self.encounters)))
        weights[np.arange(len(on)), on] = 0
        return on, shell.refit(weights, speeds)


def _reach(hull: ConvexHull, unit: np.ndarray, speeds: Sequence[float]) -> np.ndarray:
    """R' (s, k) of the hull at speeds along unit vectors (k, 2) [m]; NaN where the zone is undefined."""
    along = hull.equations[:, :2] @ unit.T
    v = hull.points[hull.vertices, 2]
    reach = np.full((len(speeds), len(unit)), np.nan)
    for i, speed in enumerate(speeds):
        offset = -(hull.equations[:, 3] + hull.equations[:, 2] * speed)
        if v.min() < speed < v.max() and (offset > 0).all():
            with np.errstate(divide="ignore", invalid="ignore"):
                reach[i] = np.min(np.where(along > 0, offset[:, None] / along, np.inf), axis=0)
    return reach

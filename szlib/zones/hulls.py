"""The convex hull over (x', y', speed), its slices, and the zone outside of it (paper, sec. 2).

A slice of the hull at one speed is a convex polygon around the origin of the complementary plane. Let
R'(theta) be the distance from the origin to the polygon's edge. People at that speed were nowhere nearer than

    r_zone(theta) = r_max - R'(theta)

which is the *minimum social zone*. The order matters: first map to r_zone, then enclose it by an ellipse. An
ellipse around the slice itself is not a zone.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from ..core.checks import Array
from ..core.errors import ZoneError
from ..tracks import funnels
from .ellipses import DIRECTIONS, Ellipse, unit_vectors
from .enclosing_ellipse import (
    check_points,
    minimum_enclosing_ellipse,
    minimum_enclosing_ellipse_of_curve,
)
from .estimators import Estimator
from .outliers import complementary_points, encounter_numbers, remove_outliers


def hull_vertices(points: ArrayLike) -> Array:
    """Vertices (k, 3) of the convex hull of `points` (n, 3): x' [m], y' [m], speed [m/s].

    Raises ZoneError if there are fewer than four points, all lie in a plane, or a value is not finite.

    Examples
    --------
    >>> from szlib.zones import hull_vertices
    >>> corners = [(x, y, v) for x in (-1, 1) for y in (-1, 1) for v in (0.5, 1.5)]
    >>> len(hull_vertices([*corners, (0, 0, 1)]))
    8
    """
    hull = _convex_hull(points)
    return np.asarray(hull.points[hull.vertices])


def _convex_hull(points: ArrayLike) -> ConvexHull:
    points = check_points(points, "x', y', speed", 4)
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
    """A slice of the hull at one speed.

    Parameters
    ----------
    polygon : corners in the complementary plane, counter-clockwise, shape (k, 2) [m].
    speed : speed of the reference pedestrian [m/s].
    r_max : distance from which complementary distances are measured [m].

    Raises
    ------
    ZoneError : the origin is outside the polygon, so no person was seen in some directions.
    """

    polygon: Array
    speed: float
    r_max: float

    def __post_init__(self) -> None:
        if (self._edges()[1] <= 0).any():  # the origin is outside the polygon
            away = self.polygon[self.polygon.any(axis=1)]
            raise missing_directions_error(
                self.speed, np.sort(np.angle(away @ [1, 1j]))
            )

    @property
    def corner_angles(self) -> Array:
        """Sorted directions of the corners [rad]. Between them the zone's boundary is smooth."""
        return np.sort(np.angle(self.polygon @ [1, 1j]))

    def reach(self, theta: ArrayLike) -> Array:
        """R'(theta), the distance from the origin to the polygon's edge; same shape as `theta` [m]."""
        normals, offsets = self._edges()
        # a product of matrices would differ in the last bit, and the ellipse around it in the eighth digit
        along = (unit_vectors(theta)[..., None, :] * normals).sum(axis=-1)
        return _reach(along, offsets)

    def boundary(self, theta: ArrayLike) -> Array:
        """Boundary of the zone in the directions `theta` (...) [rad], in the person's frame, (..., 2) [m]."""
        return (self.r_max - self.reach(theta))[..., None] * unit_vectors(theta)

    def _edges(self) -> tuple[Array, Array]:
        """Outward unit normals (k, 2) and distances from the origin (k,) of the polygon's edges."""
        along = np.roll(self.polygon, -1, axis=0) - self.polygon
        normals = along[:, ::-1] * [1, -1] / np.hypot(*along.T)[:, None]
        return normals, np.einsum("ij,ij->i", normals, self.polygon)


def slice_hull(points: ArrayLike, speed: float, *, r_max: float) -> Slice:
    """Cut the hull of points at one speed.

    Parameters
    ----------
    points : x' [m], y' [m], speed [m/s], shape (n, 3).
    speed : speed of the slice [m/s].
    r_max : distance from which complementary distances are measured [m].

    Raises
    ------
    ZoneError : the speed is outside the hull's range, or the zone is undefined there.

    Examples
    --------
    >>> from szlib.zones import slice_hull
    >>> corners = [(x, y, v) for x in (-1, 1) for y in (-1, 1) for v in (0.5, 1.5)]
    >>> section = slice_hull(corners, 1.0, r_max=2.0)
    >>> section.boundary(0.0).tolist()  # 2 m - 1 m, straight ahead
    [1.0, 0.0]
    """
    hull = _convex_hull(points)
    v = hull.points[:, 2]
    if not v.min() < speed < v.max():
        raise ZoneError(
            f"the zone at {speed:g} m/s is undefined: the data covers {v.min():.3f} to {v.max():.3f} m/s"
        )
    corners = np.sort(hull.simplices, axis=1)
    edges = corners[:, [[0, 1], [0, 2], [1, 2]]].reshape(-1, 2)
    slowest, fastest = np.sort(v[edges], axis=1).T
    is_cut = (slowest <= speed) & (speed <= fastest) & (slowest < fastest)
    i, j = edges[is_cut].T
    share = ((speed - v[i]) / (v[j] - v[i]))[:, None]
    section = hull.points[i, :2] + share * (hull.points[j, :2] - hull.points[i, :2])
    try:
        outline = ConvexHull(section)
    except QhullError as error:
        raise ZoneError(
            f"the zone at {speed:g} m/s is undefined: the hull has no extent there; add data"
        ) from error
    return Slice(section[outline.vertices], speed, r_max)


@dataclass(frozen=True, eq=False)
class HullZone:
    """The zone outside the hull over (x', y', speed).

    Parameters
    ----------
    vertices : of the hull, shape (k, 3) [m, m, m/s].
    r_max : distance from which complementary distances are measured [m].

    Raises
    ------
    ZoneError : the vertices have no hull.

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.zones import HullZone
    >>> corners = np.array([(x, y, v) for x in (-1, 1) for y in (-1, 1) for v in (0.5, 1.5)])
    >>> HullZone(corners, r_max=2.0).boundary(1.0, 0.0).tolist()
    [1.0, 0.0]
    """

    vertices: Array
    r_max: float

    def __post_init__(self) -> None:
        _convex_hull(self.vertices)

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed of the hull [m/s]."""
        speed = self.vertices[:, 2]
        return float(speed.min()), float(speed.max())

    def slice(self, speed: float) -> Slice:
        """The slice at a `speed` [m/s]; raises ZoneError if the zone is undefined there."""
        return slice_hull(self.vertices, speed, r_max=self.r_max)

    def boundary(self, speed: float, theta: ArrayLike) -> Array:
        """Boundary at a `speed` [m/s] in the directions `theta` (...) [rad], shape (..., 2) [m]."""
        return self.slice(speed).boundary(theta)

    def ellipse(self, speed: float) -> Ellipse:
        """The smallest ellipse around the boundary at a `speed` [m/s]; ZoneError if it is undefined."""
        section = self.slice(speed)
        return minimum_enclosing_ellipse_of_curve(
            section.boundary, section.corner_angles
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class HullEstimator(Estimator):
    """Remove outliers, take the hull, slice it, enclose the slices by ellipses (paper, sec. 2).

    Parameters
    ----------
    points : inliers (x', y', speed), shape (n, 3) [m, m, m/s].
    number : row in `encounters` of each point, shape (n,).
    r_max : distance from which complementary distances are measured [m].
    encounters, parameters, funnel : see `Estimator`.
    """

    points: Array
    number: NDArray[np.intp]
    r_max: float
    is_extreme: ClassVar[bool] = True

    @classmethod
    def from_samples(
        cls,
        samples: pd.DataFrame,
        *,
        r_max: float,
        fraction: float | None = None,
        n_neighbours: int | None = None,
    ) -> HullEstimator:
        """Remove outliers from samples; parameters and errors as in `szlib.remove_outliers`.

        Parameters
        ----------
        samples, r_max, fraction, n_neighbours : as in `szlib.remove_outliers`.
        """
        options: dict[str, Any] = {"fraction": fraction, "n_neighbours": n_neighbours}
        inliers = remove_outliers(samples, r_max=r_max, **options)
        near = complementary_points(inliers, r_max=r_max)
        points = np.column_stack([near, inliers["speed"].to_numpy(float)])
        n_vertices = len(hull_vertices(points))
        number, encounters = encounter_numbers(inliers)
        return cls(
            points=points,
            number=number,
            r_max=r_max,
            encounters=encounters,
            parameters=options,
            funnel=[
                *funnels.get(inliers),
                funnels.stage(
                    "hull",
                    len(points),
                    n_vertices,
                    {"inside the hull": len(points) - n_vertices},
                ),
            ],
        )

    def fit_shape(self, speeds: Sequence[float]) -> HullZone:
        """The zone outside the hull of all points, whatever the `speeds`."""
        return HullZone(hull_vertices(self.points), self.r_max)

    def refit(self, weights: Array, speeds: Sequence[float]) -> Array:
        """Fit ellipses to the encounters with positive `weights` at `speeds`.

        They enclose the boundary in 72 directions, which comes directly from the hull's faces: this is faster
        than slices.
        """
        ellipses = np.full((len(weights), len(speeds), 5), np.nan)
        unit = unit_vectors(DIRECTIONS)
        for i, weight in enumerate(weights):
            with suppress(ZoneError):
                hull = _convex_hull(self.points[weight[self.number] > 0])
                normals, by_speed, shift = np.split(hull.equations, [2, 3], axis=1)
                offsets = -(shift + by_speed * speeds).T
                reach = _reach(unit @ normals.T, offsets[:, None])
                for j in np.flatnonzero((offsets > 0).all(axis=1)):
                    boundary = (self.r_max - reach[j])[:, None] * unit
                    ellipses[i, j] = minimum_enclosing_ellipse(boundary).parameters
        return ellipses


def missing_directions_error(speed: float, known: Array) -> ZoneError:
    """The error at a `speed` [m/s] if people were seen only in the directions `known`, ascending [rad]."""
    low, high = np.degrees(find_widest_gap(known))
    return ZoneError(
        f"the zone at {speed:g} m/s is undefined: no person was seen in the directions from {low:.0f} "
        f"counter-clockwise to {180 - (180 - high) % 360:.0f} deg; add data, or choose another speed"
    )


def find_widest_gap(known: Array) -> tuple[float, float]:
    """The two of the `known` directions around the widest gap, counter-clockwise [rad]."""
    if not len(known):
        return -np.pi, np.pi
    widths = np.diff(np.append(known, known[0] + 2 * np.pi))
    widest = np.argmax(widths)
    return known[widest], known[widest] + widths[widest]


def _reach(along: Array, offsets: Array) -> Array:
    """Distance from the origin to the nearest edge, in directions.

    `along` (..., edges) are the cosines of directions with the normals of edges, which are at `offsets`
    (..., edges).
    """
    every = np.full(np.broadcast_shapes(along.shape, offsets.shape), np.inf)
    np.divide(offsets, along, out=every, where=along > 0)
    return np.asarray(every.min(axis=-1))

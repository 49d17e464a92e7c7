"""Ellipses, and the smallest one that encloses a set of points or a closed curve.

An ellipse with centre (m, n), semi-axes a >= b and angle th is where (paper, eq. 6, with the sign
of its second term put right)

    [(x-m) cos th + (y-n) sin th]^2 / a^2  +  [-(x-m) sin th + (y-n) cos th]^2 / b^2  =  1

The smallest enclosing ellipse comes from its dual problem. With q = (1, x, y), weights w >= 0 that sum
to 1 and M(w) = sum w q q^T, every w gives a lower bound 2 pi sqrt(det M) on the area, and the ellipse
q^T M^-1 q = 3 attains it where it encloses all points: then w maximises det M, and both are optimal
(D. M. Titterington, "Optimal design: some geometrical aspects of D-optimality", Biometrika 62, 1975).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import Array
from ..errors import ZoneError
from .costmaps import Layer

Curve = Callable[[Array], Array]

THINNEST = 1e-9  # width over length below which points count as collinear: a choice, far from any zone
_ENCLOSED, _CURVE_ENCLOSED = 1e-13, 1e-12  # excess of the level at a point and on a curve taken for rounding
_FULL_STEP, _SETTLED = 0.25, 1e-8  # Newton decrements: each is below the square of the last; one step to go
_TINY, _SQRT2 = 1e-15, np.sqrt(2)  # floor of singular values: what is below is the kernel
_TARGET = np.array([-2.0, 1.0, 1.0, 0.0, 0.0, 0.0])  # I - 3 e1 e1^T: gradients of log det M and 3 sum w
_ARC_SAMPLES = 25  # nodes an arc; on an arc of a zone the level has one or two peaks
_ZOOM, _ZOOMS = 8, 9  # each zoom makes a bracket 8 times smaller: 8^-9 < sqrt(machine precision)
_MAX_ROUNDS = 50  # exchanges with a curve; a smooth one settles in about six


@dataclass(frozen=True)
class Ellipse(Layer):
    """An ellipse in the plane, in metres.

    Parameters
    ----------
    center : (m, n), the centre [m].
    semi_axes : (a, b), semi-major and semi-minor axis [m], a >= b > 0.
    angle : direction of the major axis, counter-clockwise from x [rad]; stored in (-pi/2, pi/2].
    support : points that determine it, shape (3..5, 2), where it came from a fit; else None.

    Raises
    ------
    ZoneError : a number is not finite, an axis is not positive, or a < b.
    """

    center: tuple[float, float]
    semi_axes: tuple[float, float]
    angle: float = 0.0
    support: Array | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        center = (float(self.center[0]), float(self.center[1]))
        a, b = (float(axis) for axis in self.semi_axes)
        if not np.all(np.isfinite([*center, a, b, self.angle])):
            raise ZoneError(f"an ellipse needs finite numbers; got {self.center}, {(a, b)}, {self.angle}")
        if not a >= b > 0:
            raise ZoneError(f"semi-axes must satisfy a >= b > 0; got a = {a}, b = {b}")
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "semi_axes", (a, b))
        object.__setattr__(self, "angle", float(np.pi / 2 - (np.pi / 2 - self.angle) % np.pi))

    @property
    def area(self) -> float:
        """Area [m2]."""
        return float(np.pi * self.semi_axes[0] * self.semi_axes[1])

    @cached_property
    def foci(self) -> Array:
        """The two foci, shape (2, 2) [m]; c = sqrt(a^2 - b^2) from the centre (paper, sec. 3)."""
        a, b = self.semi_axes
        c = np.sqrt((a - b) * (a + b)) * np.array([np.cos(self.angle), np.sin(self.angle)])
        return np.array([self.center + c, self.center - c])

    @cached_property
    def numbers(self) -> tuple[float, ...]:
        """The foci and the semi-major axis, (xa, ya, xb, yb, a) [m]: all that a distance to it needs."""
        return (*self.foci.ravel().tolist(), self.semi_axes[0])

    def level(self, points: ArrayLike) -> Array:
        """Left side of the ellipse equation at points (..., 2): 1 on the curve, less inside."""
        d, cos, sin = np.asarray(points, float) - self.center, np.cos(self.angle), np.sin(self.angle)
        u = (d[..., 0] * cos + d[..., 1] * sin) / self.semi_axes[0]
        v = (d[..., 1] * cos - d[..., 0] * sin) / self.semi_axes[1]
        return np.asarray(u**2 + v**2)

    def curve(self, n: int = 200) -> Array:
        """n points on the curve, shape (n, 2), the first repeated at the end [m]."""
        phi, cos, sin = np.linspace(0, 2 * np.pi, n), np.cos(self.angle), np.sin(self.angle)
        u, v = self.semi_axes[0] * np.cos(phi), self.semi_axes[1] * np.sin(phi)
        return np.stack([self.center[0] + u * cos - v * sin, self.center[1] + u * sin + v * cos], axis=-1)

    def scaled(self, scale: float) -> Ellipse:
        """This ellipse of a person's frame, so many times as large about the person."""
        (m, n), (a, b) = self.center, self.semi_axes
        return Ellipse((scale * m, scale * n), (scale * a, scale * b), self.angle)

    def placed(self, position: ArrayLike, heading: float) -> Ellipse:
        """This ellipse of a person's frame, in the world, where they are at `position` [m] and face [rad]."""
        (x, y), (m, n) = np.asarray(position, float), self.center
        cos, sin = np.cos(heading), np.sin(heading)
        return Ellipse((x + m * cos - n * sin, y + m * sin + n * cos), self.semi_axes, self.angle + heading)


def minimum_enclosing_ellipse(points: ArrayLike, *, start: Sequence[int] = ()) -> Ellipse:
    """Smallest-area ellipse that encloses points (n, 2) [m], exact up to rounding (paper, sec. 2).

    Its level is at most 1, up to rounding, at every point, and `support` holds the three to five of
    them that determine it. Duplicates and points inside change nothing. A good guess of their indices,
    three or more that are not on a line, as `start` saves time and changes nothing else.

    Method: start from a large triangle; let the point farthest outside join, find the smallest ellipse of
    these few, forget those it does not need; repeat until none is outside. The area only grows, so no
    support comes twice, and the search ends.

    Raises
    ------
    ZoneError : not of shape (n, 2), a number is not finite, fewer than three distinct points, or all
        of them on a line, up to `THINNEST` of their length or up to the rounding of their coordinates.
    """
    return _enclose(_checked(points), list(start))[0]


def minimum_enclosing_ellipse_of_curve(curve: Curve, breaks: ArrayLike = ()) -> Ellipse:
    """Smallest-area ellipse that encloses a whole closed curve, not just samples of it (paper, sec. 2).

    Parameters
    ----------
    curve : angles (n,) [rad] -> points (n, 2) [m]; continuous, of period 2 pi.
    breaks : angles where the curve may have a corner, in any order [rad]; it is smooth between them.

    Method: enclose samples, find where each arc goes farthest outside, add finer samples there, repeat.
    Every such ellipse is at most as large as the one sought, so the one that encloses all is smallest,
    to 1e-12 in area; as area is flat at its least, centre and axes may be known to 1e-6 only.

    Raises
    ------
    ZoneError : `breaks` or a point of the curve is not finite or of the wrong shape, the curve lies on
        a line, or no ellipse settles because the curve is not smooth between its breaks.
    """
    corners = np.asarray(breaks, float)
    if corners.ndim != 1 or not np.all(np.isfinite(corners)):
        raise ZoneError(f"breaks must be finite angles of shape (k,) [rad]; got {breaks!r}")
    ends = np.unique([*corners % (2 * np.pi), *np.linspace(0, 2 * np.pi, 9)])  # no arc above 45 degrees
    nodes = (1 - np.cos(np.linspace(0, np.pi, _ARC_SAMPLES))) / 2  # denser towards the corners
    angles = ends[:-1, None] + np.diff(ends)[:, None] * nodes
    samples = _on_curve(curve, angles)
    points: Array = samples.reshape(-1, 2)
    support: list[int] = []
    for turn in range(_MAX_ROUNDS):
        ellipse, support = _enclose(points, support)
        peaks, reach = _peaks(ellipse, curve, angles, samples)
        summits = _on_curve(curve, peaks)
        excess = ellipse.level(summits) - 1
        if np.max(excess, initial=0) <= _CURVE_ENCLOSED:
            return _touching(ellipse, np.vstack([points, summits]))
        out = excess > 0
        finer = reach[out] / _ZOOM**turn * np.linspace(-1, 1, 4 * _ZOOM + 1)[:, None]
        points = np.vstack([points, summits, _on_curve(curve, (peaks[out] + finer).ravel())])
    raise ZoneError(
        f"after {_MAX_ROUNDS} rounds the curve still leaves its ellipse, by {np.max(excess):.1e} in level; "
        "it must be a function that is smooth between its breaks: name every corner in `breaks`"
    )


def _checked(points: ArrayLike) -> Array:
    """Points as an array (n, 2) of finite numbers, n >= 3."""
    try:
        array = np.asarray(points, float)
    except (TypeError, ValueError) as error:
        raise ZoneError(f"points must be numbers, one row (x, y) a point: {error}") from error
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < 3:
        raise ZoneError(f"points must have shape (n, 2), n >= 3, a row (x, y) each; got {array.shape}")
    for i in np.flatnonzero(~np.all(np.isfinite(array), axis=1))[:1]:
        raise ZoneError(f"points must be finite; point {i} is {array[i].tolist()}: drop or repair it")
    return array


def _enclose(points: Array, support: list[int] | None = None) -> tuple[Ellipse, list[int]]:
    """Smallest ellipse around checked points and the indices of its support, sought from a given one."""
    triangle = _large_triangle(points)
    origin = points[triangle[0]]
    frame = (points[triangle[1:]] - origin).T  # affine: in its coordinates no point set is thin or far away
    q = np.column_stack([np.ones(len(points)), np.linalg.solve(frame, (points - origin).T).T])
    joined = support or triangle
    weights = np.full(len(joined), 1 / len(joined))
    seen: set[frozenset[int]] = set()
    while True:
        kept, weights = _design(q[joined], weights)
        support = [joined[i] for i in kept]
        root = _root(q[support], weights)
        level = (np.sum(np.linalg.solve(root, q.T) ** 2, axis=0) - 1) / 2
        farthest = int(np.argmax(level))
        if level[farthest] <= 1 + _ENCLOSED or frozenset(support) in seen:  # seen: only rounding is left
            break
        seen.add(frozenset(support))
        joined, weights = [*support, farthest], np.append(weights, 0.0)
    axes, semi_axes, _ = np.linalg.svd(np.sqrt(2) * frame @ root[1:, 1:])
    center, angle = origin + frame @ root[1:, 0], np.arctan2(axes[1, 0], axes[0, 0])
    ellipse = Ellipse((center[0], center[1]), (semi_axes[0], semi_axes[1]), angle, points[support])
    return _touching(ellipse, points), support


def _large_triangle(points: Array) -> list[int]:
    """Indices of the two ends of the longer coordinate and of the point farthest from their line."""
    along = points[:, np.argmax(np.ptp(points, axis=0))]
    first, last = int(np.argmin(along)), int(np.argmax(along))
    edge, offset = points[last] - points[first], points - points[first]
    doubled = np.abs(offset[:, 0] * edge[1] - offset[:, 1] * edge[0])  # areas of the triangles
    apex, length = int(np.argmax(doubled)), np.hypot(*edge)
    rounding = 64 * np.finfo(float).eps * np.max(np.abs(points))
    if doubled[apex] > length * max(THINNEST * length, rounding):
        return [first, last, apex]
    if (distinct := len(np.unique(points, axis=0))) < 3:
        raise ZoneError(f"an ellipse encloses at least 3 distinct points; got {distinct}: add points")
    raise ZoneError(
        f"the {distinct} distinct points lie on a line: {length:.3g} m long and at most "
        f"{doubled[apex] / length:.1e} m wide, expected a width above {THINNEST:g} of the length and above "
        f"{rounding:.1e} m, the rounding of their coordinates; add points beside the line"
    )


def _root(q: Array, weights: Array) -> Array:
    """Cholesky factor of M: [[1, 0], [centre, square root of the covariance]] where weights sum to 1."""
    return np.asarray(np.linalg.cholesky((q.T * weights) @ q))


def _design(q: Array, weights: Array) -> tuple[NDArray[np.intp], Array]:
    """Rows kept of q (k, 3), k <= 6, and the weights > 0 on them that maximise det M from a feasible start.

    Damped Newton steps on log det M - 3 sum w. With R the outer products of the rows of q, whitened by
    the root of M and written as vectors of R^6, a step minimises |R d - t|; the Hessian R^T R is never
    formed, so nearly coincident and cocircular points keep their digits. A weight that would become
    negative leaves. (Six points on one conic have a singular R, and the step then goes along its kernel
    until a weight leaves: that is Caratheodory's reduction to five.)
    """
    kept, last = np.arange(len(q)), float("inf")
    while True:
        root = _root(q[kept], weights)
        x, y, z = np.linalg.solve(root, q[kept].T)
        r = np.stack([x * x, y * y, z * z, _SQRT2 * x * y, _SQRT2 * x * z, _SQRT2 * y * z])
        left, singular, right = np.linalg.svd(r, full_matrices=False)
        target = left.T @ _TARGET
        step = right.T @ (target / np.maximum(singular, _TINY))
        decrement = float(np.linalg.norm(target))
        length = 1.0 if decrement < _FULL_STEP else 1 / (1 + decrement)
        limits = np.full(len(kept), np.inf)
        np.divide(weights, -step, out=limits, where=step < 0)
        leaving = int(np.argmin(limits))
        stays = limits[leaving] > length
        weights = np.maximum(weights + min(length, limits[leaving]) * step, 0)
        if not stays:
            kept, weights = np.delete(kept, leaving), np.delete(weights, leaving)
        weights /= np.sum(weights)
        if stays and (decrement < _SETTLED or last <= decrement < _FULL_STEP):  # or: only rounding is left
            return kept, weights
        last = decrement if stays else float("inf")


def _touching(ellipse: Ellipse, points: Array) -> Ellipse:
    """The ellipse scaled about its centre so that, rounding included, its level at points is at most 1."""
    scale = float(np.sqrt(np.max(ellipse.level(points))))
    a, b = ellipse.semi_axes
    return replace(ellipse, semi_axes=(a * scale, b * scale))


def _on_curve(curve: Curve, angles: Array) -> Array:
    """Points of the curve at angles (...), shape (..., 2)."""
    points = np.asarray(curve(angles.ravel()), float)
    if points.shape != (angles.size, 2):
        raise ZoneError(f"curve must give points (n, 2); got {points.shape} for n = {angles.size} angles")
    for i in np.flatnonzero(~np.all(np.isfinite(points), axis=1))[:1]:
        raise ZoneError(f"the curve must be finite; at {angles.ravel()[i]} rad it is {points[i].tolist()}")
    return points.reshape(*angles.shape, 2)


def _peaks(ellipse: Ellipse, curve: Curve, angles: Array, samples: Array) -> tuple[Array, Array]:
    """Angles (k,) where the level peaks and may exceed 1, from samples (arcs, nodes, 2), and their spacing.

    A parabola rises above the highest of three samples by less than that is above the lowest.
    """
    level = np.pad(ellipse.level(samples), ((0, 0), (1, 1)), constant_values=-np.inf)
    before, here, after = level[:, :-2], level[:, 1:-1], level[:, 2:]
    may_exceed = 2 * here - np.minimum(before, after) >= 1 - _CURVE_ENCLOSED
    arc, best = np.nonzero((here >= before) & (here >= after) & may_exceed)
    grid, rows, last = angles[arc], np.arange(len(arc)), angles.shape[1] - 1
    spacing = np.max(np.diff(grid, axis=1), axis=1)
    for _ in range(_ZOOMS):
        low, high = grid[rows, np.maximum(best - 1, 0)], grid[rows, np.minimum(best + 1, last)]
        grid, last = np.linspace(low, high, 2 * _ZOOM + 1, axis=1), 2 * _ZOOM
        best = np.argmax(ellipse.level(_on_curve(curve, grid)), axis=1)
    return grid[rows, best], spacing

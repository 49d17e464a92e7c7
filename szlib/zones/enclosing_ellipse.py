"""The smallest ellipse that encloses a set of points, or a closed curve.

It comes from its dual problem. With q = (1, x, y), weights w >= 0 that sum to 1 and M(w) = sum w q q^T,
every w gives a lower bound 2 pi sqrt(det M) on the area. The ellipse q^T M^-1 q = 3 attains this bound if
it encloses all points: then w maximises det M, and both are optimal (D. M. Titterington, "Optimal design:
some geometrical aspects of D-optimality", Biometrika 62, 1975).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.checks import Array
from ..core.errors import ZoneError
from .ellipses import Ellipse

# a closed curve: angles (n,) [rad] to points (n, 2) [m]
Curve = Callable[[Array], Array]

_MIN_WIDTH = 1e-9  # width over length below which points count as collinear (a choice, far from any zone)
# excess of the level that counts as rounding
_POINT_TOLERANCE = 1e-13
_CURVE_TOLERANCE = 1e-12
# Newton decrements: each is below the square of the last
_FULL_STEP = 0.25
_CONVERGED = 1e-8
_TINY = 1e-15  # smaller singular values count as zero
_SQRT2 = np.sqrt(2)
# I - 3 e1 e1^T: gradients of log det M and 3 sum w
_TARGET = np.array([-2.0, 1.0, 1.0, 0.0, 0.0, 0.0])
_ARC_SAMPLES = 25  # nodes of an arc; on an arc of a zone the level has one or two peaks
# each zoom makes a bracket 8 times smaller: 8^-9 < sqrt(machine precision)
_ZOOM = 8
_N_ZOOMS = 9
_MAX_ROUNDS = 50  # exchanges with a curve; a smooth curve needs about six


def minimum_enclosing_ellipse(points: ArrayLike) -> Ellipse:
    """Find the smallest-area ellipse that encloses all points, exact up to rounding (paper, sec. 2).

    Parameters
    ----------
    points : shape (n, 2) [m]. Duplicates and points inside do not change the result.

    Returns
    -------
    The ellipse. Its level is at most 1, up to rounding, at every point. Its `support` holds the three to
    five points that determine it.

    Raises
    ------
    ZoneError : the shape is not (n, 2), a number is not finite, there are fewer than three distinct points,
        or all points lie on a line (up to 1e-9 of their length or the rounding of their coordinates).

    Notes
    -----
    The search starts from a large triangle. It adds the point farthest outside, finds the smallest ellipse
    around these few points, and drops the points that this ellipse does not need. It repeats this until no
    point is outside. The area only grows, so no support occurs twice and the search ends.

    Examples
    --------
    >>> import szlib
    >>> ellipse = szlib.minimum_enclosing_ellipse([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, 0)])
    >>> [round(axis, 6) for axis in ellipse.semi_axes]  # the circle through the corners
    [1.414214, 1.414214]
    """
    return _enclose(check_points(points, "x, y", 3))[0]


def minimum_enclosing_ellipse_of_curve(curve: Curve, breaks: ArrayLike = ()) -> Ellipse:
    """Find the smallest-area ellipse that encloses a whole closed curve, not only samples of it.

    Parameters
    ----------
    curve : function from angles (n,) [rad] to points (n, 2) [m]; continuous, of period 2 pi.
    breaks : angles where the curve may have a corner, in any order [rad]. It is smooth between them.

    Raises
    ------
    ZoneError : `breaks` or a point of the curve is not finite or has the wrong shape, the curve lies on
        a line, or the search does not converge because the curve is not smooth between its breaks.

    Notes
    -----
    The search encloses samples, finds where each arc goes farthest outside, and adds finer samples there,
    until no arc goes outside. Every ellipse on the way is at most as large as the one sought, so the last one
    is the smallest, to 1e-12 in area. The area is flat at its minimum: centre and axes are exact to 1e-6.

    Examples
    --------
    >>> import numpy as np
    >>> import szlib
    >>> from szlib.zones import minimum_enclosing_ellipse_of_curve
    >>> ellipse = szlib.Ellipse((0, 0), (2.0, 1.0))
    >>> curve = lambda angles: np.column_stack([2 * np.cos(angles), np.sin(angles)])
    >>> round(minimum_enclosing_ellipse_of_curve(curve).area / ellipse.area, 6)
    1.0
    """
    corners = np.asarray(breaks, float)
    if corners.ndim != 1 or not np.isfinite(corners).all():
        raise ZoneError(
            f"breaks must be finite angles of shape (k,) [rad]; got {breaks!r}"
        )
    # no arc above 45 degrees
    ends = np.unique([*corners % (2 * np.pi), *np.linspace(0, 2 * np.pi, 9)])
    nodes = (
        1 - np.cos(np.linspace(0, np.pi, _ARC_SAMPLES))
    ) / 2  # denser towards the corners
    angles = ends[:-1, None] + np.diff(ends)[:, None] * nodes
    samples = _evaluate(curve, angles)
    points = samples.reshape(-1, 2)
    support: list[int] = []
    for number in range(_MAX_ROUNDS):
        ellipse, support = _enclose(points, support)
        peaks, spacing = _find_peaks(ellipse, curve, angles, samples)
        peak_points = _evaluate(curve, peaks)
        excess = ellipse.level(peak_points) - 1
        if np.max(excess, initial=0) <= _CURVE_TOLERANCE:
            return _scale_to_contain(ellipse, np.vstack([points, peak_points]))
        outside = excess > 0
        steps = np.linspace(-1, 1, 4 * _ZOOM + 1)[:, None]
        finer = spacing[outside] / float(_ZOOM) ** number * steps
        points = np.vstack(
            [points, peak_points, _evaluate(curve, (peaks[outside] + finer).ravel())]
        )
    raise ZoneError(
        f"after {_MAX_ROUNDS} rounds the curve still leaves its ellipse, by {np.max(excess):.1e} in level; "
        "the curve must be smooth between its breaks: list every corner in `breaks`"
    )


def check_points(points: ArrayLike, columns: str, min_points: int) -> Array:
    """Convert points to an array of finite numbers, or raise ZoneError.

    Parameters
    ----------
    points : one row for each point.
    columns : names of the coordinates, with a comma between them.
    min_points : smallest number of points.
    """
    size = len(columns.split(","))
    try:
        array = np.asarray(points, float)
    except (TypeError, ValueError) as error:
        raise ZoneError(
            f"points must be numbers, one row ({columns}) for each point: {error}"
        ) from error
    if array.ndim != 2 or array.shape[1] != size or len(array) < min_points:
        raise ZoneError(
            f"points must have shape (n, {size}), n >= {min_points}, one row ({columns}) each; "
            f"got {array.shape}; add data"
        )
    for i in np.flatnonzero(~np.isfinite(array).all(axis=1))[:1]:
        raise ZoneError(
            f"points must be finite; point {i} is {array[i].tolist()}: drop or repair it"
        )
    return array


def _enclose(
    points: Array, support: list[int] | None = None
) -> tuple[Ellipse, list[int]]:
    """The smallest ellipse around checked points, and its support; the search starts at `support`."""
    triangle = _find_large_triangle(points)
    origin = points[triangle[0]]
    frame = (
        points[triangle[1:]] - origin
    ).T  # affine coordinates: no point set is thin or far away
    q = np.column_stack(
        [np.ones(len(points)), np.linalg.solve(frame, (points - origin).T).T]
    )
    active = support or triangle
    weights = np.full(len(active), 1 / len(active))
    seen: set[frozenset[int]] = set()
    while True:
        rows, weights = _maximise_determinant(q[active], weights)
        support = [active[i] for i in rows]
        root = _root(q[support], weights)
        level = (np.sum(np.linalg.solve(root, q.T) ** 2, axis=0) - 1) / 2
        farthest = int(np.argmax(level))
        if level[farthest] <= 1 + _POINT_TOLERANCE or frozenset(support) in seen:
            break  # a support seen before differs by rounding only
        seen.add(frozenset(support))
        active = [*support, farthest]
        weights = np.append(weights, 0.0)
    axes, semi_axes, _ = np.linalg.svd(np.sqrt(2) * frame @ root[1:, 1:])
    ellipse = Ellipse(
        tuple(origin + frame @ root[1:, 0]),
        tuple(semi_axes),
        np.arctan2(axes[1, 0], axes[0, 0]),
        points[support],
    )
    return _scale_to_contain(ellipse, points), support


def _find_large_triangle(points: Array) -> list[int]:
    """Indices of the two ends of the longer coordinate and of the point farthest from their line."""
    along = points[:, np.argmax(np.ptp(points, axis=0))]
    first = int(np.argmin(along))
    last = int(np.argmax(along))
    edge = points[last] - points[first]
    offset = points - points[first]
    # areas of the triangles
    doubled = np.abs(offset[:, 0] * edge[1] - offset[:, 1] * edge[0])
    apex = int(np.argmax(doubled))
    length = np.hypot(*edge)
    rounding = 64 * np.finfo(float).eps * np.max(np.abs(points))
    if doubled[apex] > length * max(_MIN_WIDTH * length, rounding):
        return [first, last, apex]
    distinct = len(np.unique(points, axis=0))
    if distinct < 3:
        raise ZoneError(
            f"an ellipse needs at least 3 distinct points; got {distinct}: add points"
        )
    raise ZoneError(
        f"the {distinct} distinct points lie on a line: {length:.3g} m long and at most "
        f"{doubled[apex] / length:.1e} m wide, expected a width above {_MIN_WIDTH:g} of the length and above "
        f"{rounding:.1e} m, the rounding of their coordinates; add points beside the line"
    )


def _root(q: Array, weights: Array) -> Array:
    """Cholesky factor of M: [[1, 0], [centre, square root of the covariance]] where weights sum to 1."""
    return np.asarray(np.linalg.cholesky((q.T * weights) @ q))


def _maximise_determinant(q: Array, weights: Array) -> tuple[NDArray[np.intp], Array]:
    """The rows of q (k, 3), k <= 6, and the weights > 0 on them, that maximise det M.

    The method takes damped Newton steps on log det M - 3 sum w from feasible `weights`. Let R hold the outer
    products of the rows of q, whitened by the root of M and written as vectors of R^6: a step minimises
    |R d - t|. The Hessian R^T R is never formed, so nearly coincident and cocircular points keep their
    digits. A row is dropped when its weight would become negative. (Six points on one conic have a singular
    R. The step then goes along its kernel until a row is dropped: Caratheodory's reduction to five.)
    """
    rows = np.arange(len(q))
    last = np.inf
    while True:
        root = _root(q[rows], weights)
        x, y, z = np.linalg.solve(root, q[rows].T)
        r = np.stack(
            [x * x, y * y, z * z, _SQRT2 * x * y, _SQRT2 * x * z, _SQRT2 * y * z]
        )
        left, singular, right = np.linalg.svd(r, full_matrices=False)
        target = left.T @ _TARGET
        step = right.T @ (target / np.maximum(singular, _TINY))
        decrement = float(np.linalg.norm(target))
        length = 1.0 if decrement < _FULL_STEP else 1 / (1 + decrement)
        limits = np.full(len(rows), np.inf)
        np.divide(weights, -step, out=limits, where=step < 0)
        dropped = np.argmin(limits)
        is_complete = limits[dropped] > length
        weights = np.maximum(weights + min(length, limits[dropped]) * step, 0)
        if not is_complete:
            rows = np.delete(rows, dropped)
            weights = np.delete(weights, dropped)
        weights /= np.sum(weights)
        if is_complete and (
            decrement < _CONVERGED or last <= decrement < _FULL_STEP
        ):  # or rounding
            return rows, weights
        last = decrement if is_complete else np.inf


def _scale_to_contain(ellipse: Ellipse, points: Array) -> Ellipse:
    """The ellipse scaled about its centre so that, rounding included, its level at points is at most 1."""
    scale = np.sqrt(np.max(ellipse.level(points)))
    a, b = ellipse.semi_axes
    return replace(ellipse, semi_axes=(a * scale, b * scale))


def _evaluate(curve: Curve, angles: Array) -> Array:
    """Points of the curve at angles (...), shape (..., 2)."""
    flat = angles.ravel()
    points = np.asarray(curve(flat), float)
    if points.shape != (flat.size, 2):
        raise ZoneError(
            f"curve must give points (n, 2); got {points.shape} for n = {flat.size} angles"
        )
    for i in np.flatnonzero(~np.isfinite(points).all(axis=1))[:1]:
        raise ZoneError(
            f"the curve must be finite; at {flat[i]} rad it is {points[i].tolist()}"
        )
    return points.reshape(*angles.shape, 2)


def _find_peaks(
    ellipse: Ellipse, curve: Curve, angles: Array, samples: Array
) -> tuple[Array, Array]:
    """Angles (k,) of the peaks of the level that may exceed 1, and the spacing (k,) of the samples there.

    `samples` has the shape (arcs, nodes, 2). A parabola exceeds the highest of three samples by less than
    the highest exceeds the lowest.
    """
    level = np.pad(ellipse.level(samples), ((0, 0), (1, 1)), constant_values=-np.inf)
    before = level[:, :-2]
    here = level[:, 1:-1]
    after = level[:, 2:]
    may_exceed = 2 * here - np.minimum(before, after) >= 1 - _CURVE_TOLERANCE
    arc, best = np.nonzero((here >= before) & (here >= after) & may_exceed)
    grid = angles[arc]
    rows = np.arange(len(arc))
    spacing = np.max(np.diff(grid, axis=1), axis=1)
    for _ in range(_N_ZOOMS):
        ends = np.clip([best - 1, best + 1], 0, grid.shape[1] - 1)
        low, high = grid[rows, ends]
        grid = np.linspace(low, high, 2 * _ZOOM + 1, axis=1)
        best = np.argmax(ellipse.level(_evaluate(curve, grid)), axis=1)
    return grid[rows, best], spacing

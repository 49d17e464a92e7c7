"""The paper's distances compared with Euclidean ones, and the margin that makes them safe (notebook 22).

A robot of radius r must stay r away from a wall or a zone, in Euclidean distance e. The barrier keeps
d >= r + eps instead, so eps is large enough where {e < r} lies inside {d < r + eps}:

    required margin = max of d over {e <= r}, less r

*Ellipse*: none. With p the nearest point on the ellipse, |x-c| <= |x-p| + |p-c| for both foci, so
d(x) <= e(x) + d(p) = e(x): the focal distance never over-estimates, for any eccentricity. Inside, the
same with x and p exchanged gives |d| <= |e|.

*Wall* of length L: r^2/L. Let the point at distance r from an end lie at the angle phi off the wall's
line. Its trimming term is r cos phi + r^2/L, so d^2 = r^2 + 2 (r^3/L) cos phi + r^4/L^2, which is
greatest straight ahead of the end: d = r + r^2/L. A point beside the wall, u <= L/2 from the end, has
the term (r^2 - u (L-u))/L at most, and is exact where that is negative.

So `MPCSettings()` gives each wall the margin it requires (`Wall.margin`). This costs at most 0.42 r of space,
beside a wall of L = 2 r. Around a pillar, L -> 0, {d < r + r^2/L} becomes the disc of radius r, and it costs
nothing. `MPCSettings.among_people()` keeps eps in Euclidean distance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

import szlib
from szlib.control import Wall, ellipse_distance, segment_distance
from szlib.control.obstacles import check_wall
from szlib.core.checks import Array, check_array
from szlib.workbook import figures
from szlib.zones.ellipses import Ellipse

_BISECTIONS = 60  # halvings of a quarter turn that reach double precision


def euclidean_to_ellipse(points: ArrayLike, ellipse: Ellipse) -> Array:
    """Euclidean signed distance of points to an ellipse, negative inside, shape (...) [m].

    Parameters
    ----------
    points : positions, shape (..., 2) [m].
    ellipse : the zone.

    Notes
    -----
    For (p, q) in the first quadrant of the ellipse's frame the nearest point is (a cos t, b sin t), with t
    the root of half the derivative of the squared distance,

        a p sin t - b q cos t - (a^2 - b^2) sin t cos t.

    It is negative below this one root in the quadrant and positive above, so bisection finds it.

    Examples
    --------
    >>> import szlib
    >>> from studies.distances import euclidean_to_ellipse
    >>> ellipse = szlib.Ellipse((0.0, 0.0), (2.0, 1.0))
    >>> euclidean_to_ellipse([(3.0, 0.0), (0.0, 2.0)], ellipse).round(6).tolist()
    [1.0, 1.0]
    """
    offset = check_array("points", points, (..., 2)) - ellipse.center
    (a, b), cos, sin = ellipse.semi_axes, np.cos(ellipse.angle), np.sin(ellipse.angle)
    p = np.abs(offset[..., 0] * cos + offset[..., 1] * sin)
    q = np.abs(offset[..., 1] * cos - offset[..., 0] * sin)
    low, high = np.zeros_like(p), np.full_like(p, np.pi / 2)
    for _ in range(_BISECTIONS):
        t = (low + high) / 2
        below = a * p * np.sin(t) - b * q * np.cos(t) - (a**2 - b**2) * np.sin(t) * np.cos(t) < 0
        low, high = np.where(below, t, low), np.where(below, high, t)
    inside = (p / a) ** 2 + (q / b) ** 2 < 1
    return np.asarray(np.hypot(p - a * np.cos(low), q - b * np.sin(low)) * np.where(inside, -1, 1))


def euclidean_to_segment(points: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """Euclidean distance of `points`, shape (..., 2), to the segment from `a` to `b`, shape (...) [m].

    Examples
    --------
    >>> from studies.distances import euclidean_to_segment
    >>> euclidean_to_segment([(0.0, 0.5), (2.0, 0.0)], (-1.0, 0.0), (1.0, 0.0)).tolist()
    [0.5, 1.0]
    """
    xy = check_array("points", points, (..., 2))
    ends = check_wall([np.asarray(a), np.asarray(b)])
    return np.asarray(Wall.distance(xy[..., 0], xy[..., 1], 0.0, *ends.ravel()))


def required_margin(of: Ellipse | ArrayLike, r_robot: float) -> float:
    """The smallest eps with which a robot never touches a zone or a wall [m].

    It is 0 for an ellipse, and r_robot^2 / L for a wall of length L; see the proof at the top of this module.

    Parameters
    ----------
    of : an ellipse, or the end points of a wall, shape (2, 2) [m].
    r_robot : radius of the robot [m].

    Examples
    --------
    >>> from studies.distances import required_margin
    >>> required_margin([(0.0, 0.0), (1.0, 0.0)], r_robot=0.5)
    0.25
    """
    if isinstance(of, Ellipse):
        return 0.0
    robot = szlib.MPCSettings(r_robot=r_robot, eps=0.0)
    return Wall(*check_wall(of).ravel()).margin(robot)


@dataclass(frozen=True)
class DistanceComparison:
    """The error of the approximate distance on the line h = 0.

    Attributes
    ----------
    nearest, farthest : smallest and largest Euclidean gap between the robot's disc and the zone or wall [m].
        `nearest` below 0 is a collision that the barrier calls safe; `farthest` above eps is wasted space.
    required : the margin with which `nearest` is 0 [m]; see `required_margin`.
    """

    nearest: float
    farthest: float
    required: float


def compare_distances(
    of: Ellipse | ArrayLike, *, r_robot: float, eps: float, n: int = 2001
) -> DistanceComparison:
    """Compare the approximate with the Euclidean distance on the line h = 0.

    Parameters
    ----------
    of : an ellipse, or the end points of a wall, shape (2, 2) [m].
    r_robot : radius of the robot [m].
    eps : margin [m].
    n : number of points on each arc.

    Examples
    --------
    >>> from studies.distances import compare_distances
    >>> round(compare_distances([(0.0, 0.0), (1.0, 0.0)], r_robot=0.5, eps=0.05).nearest, 2)  # they overlap
    -0.11
    """
    points = find_safe_boundary(of, r_robot + eps, n)
    # the approximate distance is r_robot + eps
    gap = eps - compute_distance_error(points, of)
    return DistanceComparison(float(gap.min()), float(gap.max()), required_margin(of, r_robot))


def find_safe_boundary(of: Ellipse | ArrayLike, distance: float, n: int = 2001) -> Array:
    """Find points where the approximate distance is `distance` > 0, shape (m, 2) [m].

    Parameters
    ----------
    of : an ellipse, or the end points of a wall, shape (2, 2) [m].
    distance : approximate distance of the points [m].
    n : number of points on each arc.

    Notes
    -----
    Around a zone it is the confocal ellipse of semi-major axis a + distance. Around a wall, in its own frame,
    y = distance sin psi and x^2 = L^2/4 + L distance cos psi - y^2, for each end and side.
    """
    if isinstance(of, Ellipse):
        (a, b), reach = of.semi_axes, of.semi_axes[0] + distance
        # a circle stays one, without rounding
        across = min(reach, float(np.sqrt(reach**2 - a**2 + b**2)))
        return replace(of, semi_axes=(reach, across), support=None).curve(n)
    start, end = check_wall(of)
    length, psi = float(np.hypot(*(end - start))), np.linspace(0, np.pi / 2, n)
    along = (end - start) / length
    y = distance * np.sin(psi)
    squared = length**2 / 4 + length * distance * np.cos(psi) - y**2
    x, y = np.sqrt(squared[squared >= 0]), y[squared >= 0]
    quarters = np.array([(sx * x, sy * y) for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))])
    local = np.concatenate([q.T if i % 2 == 0 else q.T[::-1] for i, q in enumerate(quarters)])
    return np.asarray((start + end) / 2 + local @ np.array([along, [-along[1], along[0]]]))


def compute_distance_error(points: ArrayLike, of: Ellipse | ArrayLike) -> Array:
    """Approximate minus Euclidean distance of `points` (..., 2) to `of` [m]: dangerous if positive."""
    approximate, true = _measure_both(points, of)
    return approximate - true


def _measure_both(points: ArrayLike, of: Ellipse | ArrayLike) -> tuple[Array, Array]:
    """Approximate and Euclidean distance of `points`, shape (..., 2), to `of` [m]."""
    if isinstance(of, Ellipse):
        return ellipse_distance(points, of), euclidean_to_ellipse(points, of)
    ends = check_wall(of)
    return segment_distance(points, *ends), euclidean_to_segment(points, *ends)


def plot_distance_error(
    shape: Ellipse | ArrayLike,
    *,
    r_robot: float,
    eps: float,
    extent: float = 2.0,
    ax: Axes | None = None,
) -> Axes:
    """Plot the approximate minus the Euclidean distance near a zone or a wall, and h = 0 with two margins.

    The robot's disc touches the zone or the wall on the dotted line.  A line h = 0 inside the dotted line
    allows a collision.

    Parameters
    ----------
    shape : ellipse, or the two ends of a wall [m].
    r_robot : radius of the robot [m].
    eps : margin [m]. The second margin is the least one without collisions.
    extent : half the side of the figure [m].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> from studies.distances import plot_distance_error
    >>> ax = plot_distance_error([(-1.0, 0.0), (1.0, 0.0)], r_robot=0.5, eps=0.05)
    """
    ax = figures.get_axes(ax, size=(5.5, 4.5))
    x, y = np.meshgrid(*2 * [np.linspace(-extent, extent, 321)])
    approximate, true = _measure_both(np.stack([x, y], axis=-1), shape)
    # no error matters farther away
    shown = np.ma.masked_where((true < 0) | (true > 0.9), 100 * (approximate - true))
    image = ax.pcolormesh(x, y, shown, cmap="RdBu_r", vmin=-25, vmax=25, rasterized=True)
    ax.figure.colorbar(image, ax=ax, shrink=0.85, label="d - Euclidean [cm]; red is dangerous")
    outline = shape.curve() if isinstance(shape, Ellipse) else check_wall(shape)
    ax.plot(*outline.T, color=figures.BLACK, linewidth=3)
    margins = dict.fromkeys((eps, max(eps, required_margin(shape, r_robot))))
    for margin, line in zip(margins, ("-", "--"), strict=False):
        edge = find_safe_boundary(shape, r_robot + margin)
        label = f"h = 0, eps = {100 * margin:.0f} cm"
        ax.plot(
            *np.vstack([edge, edge[:1]]).T,
            line,
            color=figures.BLACK,
            linewidth=1.8,
            label=label,
        )
    ax.contour(x, y, true, levels=[r_robot], colors=[figures.BLACK], linestyles=[":"], linewidths=1.8)
    ax.plot([], [], ":", color=figures.BLACK, label="the robot's disc touches")
    ax.set(xlim=(-extent, extent), ylim=(-extent, extent))
    figures.add_legend_below(ax)
    return figures.label_metres(ax, "Error of the approximate distance")

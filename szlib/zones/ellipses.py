"""Ellipses in the plane, and the zone of a person as ellipses, one for each speed, in that person's frame.

An ellipse with centre (m, n), semi-axes a >= b and angle th is where (paper, eq. 6, with the sign of its
second term corrected)

    [(x-m) cos th + (y-n) sin th]^2 / a^2  +  [-(x-m) sin th + (y-n) cos th]^2 / b^2  =  1
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import cos, hypot, pi, sin

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import Array
from ..core.errors import ZoneError

DIRECTIONS: Array = np.radians(np.arange(-180.0, 180.0, 5.0))
"""Directions around a person, counter-clockwise from ahead [rad]."""

BODY_RADIUS = 0.25
"""Radius of a person's body: half the breadth of the shoulders [m] (assumed)."""

_BISECTIONS = 60  # halvings of a quarter turn that reach double precision


@dataclass(frozen=True)
class Ellipse:
    """An ellipse in the plane, in metres.

    Parameters
    ----------
    center : (m, n), the centre [m].
    semi_axes : (a, b), semi-major and semi-minor axis [m], a >= b > 0.
    angle : direction of the major axis, counter-clockwise from x [rad]; stored in (-pi/2, pi/2].
    support : points that determine a fitted ellipse, shape (3 to 5, 2) [m]; else None.

    Raises
    ------
    ZoneError : a number is not finite, an axis is not positive, or a < b.

    Examples
    --------
    >>> import szlib
    >>> zone = szlib.Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))
    >>> round(zone.area, 2)
    2.2
    >>> bool(zone.level((0.0, 0.5)) < 1)  # inside
    True
    """

    center: tuple[float, float]
    semi_axes: tuple[float, float]
    angle: float = 0.0
    support: Array | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        x, y = map(float, self.center)
        a, b = map(float, self.semi_axes)
        if not np.isfinite([x, y, a, b, self.angle]).all():
            raise ZoneError(
                f"an ellipse needs finite numbers; got {self.center}, {(a, b)}, {self.angle}"
            )
        if not a >= b > 0:
            raise ZoneError(f"semi-axes must satisfy a >= b > 0; got a = {a}, b = {b}")
        # A remainder can be rounded up to the whole half turn, so it is taken twice.
        angle = float(pi / 2 - (pi / 2 - self.angle) % pi % pi)
        object.__setattr__(self, "center", (x, y))
        object.__setattr__(self, "semi_axes", (a, b))
        object.__setattr__(self, "angle", angle)

    @property
    def area(self) -> float:
        """Area [m2]."""
        return np.pi * self.semi_axes[0] * self.semi_axes[1]

    @property
    def parameters(self) -> Array:
        """Centre and semi-axes [m], angle [rad]: m, n, a, b, th, shape (5,)."""
        return np.array([*self.center, *self.semi_axes, self.angle])

    @cached_property
    def foci(self) -> Array:
        """The two foci, shape (2, 2) [m], at c = sqrt(a^2 - b^2) from the centre (paper, sec. 3)."""
        a, b = self.semi_axes
        c = np.sqrt((a - b) * (a + b)) * unit_vectors(self.angle)
        return np.array([self.center + c, self.center - c])

    @cached_property
    def foci_and_axis(self) -> tuple[float, ...]:
        """The foci and the semi-major axis, (xa, ya, xb, yb, a) [m]: the input of the distance formula."""
        return (*self.foci.ravel().tolist(), self.semi_axes[0])

    def level(self, points: ArrayLike) -> Array:
        """Left side of the ellipse equation at `points` (..., 2) [m]: 1 on the curve, less inside."""
        offset = np.asarray(points, float) - self.center
        along = (offset[..., None, :] * _axes(self.angle)).sum(axis=-1)
        return np.asarray(((along / self.semi_axes) ** 2).sum(axis=-1))

    def curve(self, n: int = 200) -> Array:
        """`n` points on the curve, shape (n, 2) [m]; the last repeats the first."""
        along = unit_vectors(np.linspace(0, 2 * np.pi, n)) * self.semi_axes
        return self.center + along @ _axes(self.angle)

    def scaled(self, scale: float) -> Ellipse:
        """This ellipse of a person's frame, enlarged by the factor `scale` about the person."""
        m, n = self.center
        a, b = self.semi_axes
        return Ellipse((scale * m, scale * n), (scale * a, scale * b), self.angle)

    def placed(self, position: ArrayLike, heading: float) -> Ellipse:
        """This ellipse of a person's frame, in the world frame.

        Parameters
        ----------
        position : (x, y) of the person [m].
        heading : direction in which the person faces, counter-clockwise from x [rad].
        """
        moved = np.add(position, self.center @ _axes(heading))
        return Ellipse(tuple(moved), self.semi_axes, self.angle + heading)


@dataclass(frozen=True, eq=False)
class EllipseZone:
    """A zone given as one ellipse for each of several speeds.

    Between two speeds, centre and shape matrix R diag(a^2, b^2) R^T are linear.

    Parameters
    ----------
    ellipses : by speed of the reference pedestrian [m/s].

    Raises
    ------
    ZoneError : there is no ellipse.

    Examples
    --------
    >>> from szlib.zones import Ellipse, EllipseZone
    >>> zone = EllipseZone({0.9: Ellipse((0, 0), (1, 1)), 1.1: Ellipse((0.2, 0), (1, 1))})
    >>> round(zone.ellipse(1.0).center[0], 6)
    0.1
    """

    ellipses: Mapping[float, Ellipse]

    def __post_init__(self) -> None:
        if not self.ellipses:
            raise ZoneError("a zone needs an ellipse for one speed or more; got none")

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest speed with an ellipse [m/s]."""
        return min(self.ellipses), max(self.ellipses)

    def ellipse(self, speed: float) -> Ellipse:
        """The ellipse at a `speed` [m/s]; raises ZoneError outside of the range."""
        low, high = self.speed_range
        if not low <= speed <= high:
            raise ZoneError(
                f"the zone at {speed:g} m/s is undefined: it was fitted for {low:g} to {high:g} m/s; "
                "fit it with this speed in `speeds`"
            )
        speeds = find_neighbours(self.ellipses, speed)
        ends = [self.ellipses[v] for v in speeds]
        if len(ends) == 1:
            return ends[0]
        share = (speed - speeds[0]) / (speeds[1] - speeds[0])
        weights = (1 - share, share)
        center = np.average([e.center for e in ends], axis=0, weights=weights)
        roots = [_axes(e.angle).T * e.semi_axes for e in ends]
        squares, axes = np.linalg.eigh(
            np.average([r @ r.T for r in roots], axis=0, weights=weights)
        )
        b, a = np.sqrt(squares)
        return Ellipse(tuple(center), (a, b), np.arctan2(axes[1, 1], axes[0, 1]))

    def boundary(self, speed: float, theta: ArrayLike) -> Array:
        """Boundary at a `speed` [m/s] in the directions `theta` (...) [rad], shape (..., 2) [m]."""
        directions = np.asarray(theta, float)
        reach = ellipse_reach(self.ellipse(speed).parameters, directions)
        return reach.reshape(*directions.shape, 1) * unit_vectors(directions)


def find_neighbours(speeds: Iterable[float], speed: float) -> list[float]:
    """The `speeds` next to a `speed`, below and above; one if it is among them, or outside of them."""
    known = sorted(speeds)
    return sorted(
        {*[v for v in known if v <= speed][-1:], *[v for v in known if v >= speed][:1]}
    )


def ellipse_reach(ellipses: Array, directions: Array = DIRECTIONS) -> Array:
    """Distance from the person to the boundary of `ellipses` in `directions` (n,) [rad].

    `ellipses` (..., 5) hold centre, semi-axes [m] and angle [rad]. The result has the shape (..., n) [m]; it
    is NaN if the person is outside the ellipse.
    """
    m, n, a, b, angle = np.moveaxis(ellipses[..., None, :], -1, 0)
    cos = np.cos(angle)
    sin = np.sin(angle)
    turn = directions - angle
    u = np.cos(turn) / a
    v = np.sin(turn) / b
    x = (m * cos + n * sin) / a
    y = (n * cos - m * sin) / b
    p = u * u + v * v
    q = u * x + v * y
    r = x * x + y * y - 1
    with np.errstate(invalid="ignore"):
        return np.where(r < 0, (q + np.sqrt(q * q - p * r)) / p, np.nan)


def _axes(angle: float) -> Array:
    """Unit vectors along and to the left of the direction `angle` [rad], shape (2, 2)."""
    cosine, sine = unit_vectors(angle)
    return np.array([[cosine, sine], [-sine, cosine]])


def unit_vectors(theta: ArrayLike) -> Array:
    """Unit vectors in the directions `theta` (...) [rad], shape (..., 2)."""
    return np.stack([np.cos(theta), np.sin(theta)], axis=-1)


@lru_cache(maxsize=256)
def circle_around(zone: Ellipse) -> Ellipse:
    """The smallest circle around a person that contains the person's `zone` for every heading.

    Its radius is the greatest distance from the person to the ellipse. With the person's offset from the
    centre (-p, -q), p, q >= 0, in the ellipse's frame, the farthest point (a cos t, b sin t) lies in the
    first quadrant. Half the derivative of the squared distance by t,

        b q cos t - a p sin t - (a^2 - b^2) sin t cos t,

    changes its sign once there, because divided by sin t cos t it falls.

    Examples
    --------
    >>> from szlib.zones import Ellipse, circle_around
    >>> round(circle_around(Ellipse(center=(0.1, 0.0), semi_axes=(1.0, 0.7))).semi_axes[0], 6)
    1.1
    """
    m, n = zone.center
    a, b = zone.semi_axes
    c = cos(zone.angle)
    s = sin(zone.angle)
    p = abs(m * c + n * s)
    q = abs(n * c - m * s)
    low = 0.0
    high = pi / 2
    for _ in range(_BISECTIONS):
        t = (low + high) / 2
        rises = b * q * cos(t) - a * p * sin(t) - (a**2 - b**2) * sin(t) * cos(t) > 0
        low, high = (t, high) if rises else (low, t)
    radius = hypot(p + a * cos(low), q + b * sin(low))
    return Ellipse((0.0, 0.0), (radius, radius))

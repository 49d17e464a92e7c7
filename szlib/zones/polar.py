"""A zone given as its radius in each direction, and the ellipse fitted to it.

The zone of the hull ends where no person ever was, so its ellipse is the smallest one *around* it. A radius
that is estimated in each direction errs to both sides, and an ellipse around its largest errors would be too
large. So the ellipse is *fitted*: it minimises the sum over directions of (radius - reach of the ellipse)^2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import Array
from ..core.errors import ZoneError
from .ellipses import Ellipse, unit_vectors

# Directions of the radii, counter-clockwise from ahead [rad].
DIRECTIONS: Array = np.radians(np.arange(-180.0, 180.0, 5.0))
# Range of directions without data from which on there is no zone [rad]; the hull has the same limit.
WIDEST_GAP = np.pi

# of Levenberg and Marquardt; step relative to the mean radius
_MAX_ITERATIONS, _CONVERGED = (100, 1e-12)


@dataclass(frozen=True, eq=False)
class PolarZone:
    """Radii of a zone by speed and direction, in the frame of the reference pedestrian.

    Parameters
    ----------
    speeds : speeds of the reference pedestrian, ascending, shape (m,) [m/s].
    directions : counter-clockwise from ahead, ascending within [-pi, pi), shape (n,) [rad].
    radii : shape (m, n) [m]; NaN where no person was seen.

    Raises
    ------
    ZoneError : the shapes do not fit, a radius is negative, or speeds or directions do not ascend.

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.zones import PolarZone
    >>> directions = np.radians(np.arange(-180, 180, 5))
    >>> zone = PolarZone(speeds=[0.9, 1.1], directions=directions, radii=np.ones((2, 72)))
    >>> zone.ellipse(1.0).semi_axes
    (1.0, 1.0)
    """

    speeds: Array
    directions: Array
    radii: Array

    def __post_init__(self) -> None:
        for name in ("speeds", "directions", "radii"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), float))
        shape = (len(self.speeds), len(self.directions))
        if self.radii.shape != shape or 0 in shape:
            raise ZoneError(
                f"radii must have shape (speeds, directions) = {shape}; got {self.radii.shape}"
            )
        for name, values in (("speeds", self.speeds), ("directions", self.directions)):
            if not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
                raise ZoneError(
                    f"{name} of radii must be finite and ascend; got {values.tolist()}"
                )
        if (self.radii < 0).any():
            raise ZoneError(
                f"radii must not be negative; got {np.nanmin(self.radii)} m"
            )

    @property
    def speed_range(self) -> tuple[float, float]:
        """Lowest and highest fitted speed [m/s]."""
        return float(self.speeds[0]), float(self.speeds[-1])

    def radii_at(self, speed: float) -> Array:
        """Radii (n,) [m] at a `speed` [m/s], linear between fitted speeds; raises ZoneError outside."""
        low, high = self.speed_range
        if not low <= speed <= high:
            raise ZoneError(
                f"the zone at {speed:g} m/s is undefined: it was fitted for {low:g} to {high:g} m/s; "
                "fit it with this speed in `speeds`"
            )
        after = min(int(np.searchsorted(self.speeds, speed)), len(self.speeds) - 1)
        if self.speeds[after] == speed:
            return np.asarray(self.radii[after])
        share = (speed - self.speeds[after - 1]) / (
            self.speeds[after] - self.speeds[after - 1]
        )
        return np.asarray(
            (1 - share) * self.radii[after - 1] + share * self.radii[after]
        )

    def boundary(self, speed: float, theta: ArrayLike) -> Array:
        """Boundary at a `speed` [m/s] in the directions `theta` (...) [rad], shape (..., 2) [m].

        It is linear between known directions and NaN where no person was seen.
        """
        directions = np.append(self.directions, self.directions[0] + 2 * np.pi)
        radii = np.append(self.radii_at(speed), self.radii_at(speed)[0])
        r = np.interp(
            np.subtract(theta, directions[0]) % (2 * np.pi) + directions[0],
            directions,
            radii,
        )
        return np.asarray(r[..., None] * unit_vectors(theta))

    def ellipse(self, speed: float) -> Ellipse:
        """The ellipse fitted at a `speed` [m/s]; raises ZoneError if too few directions have data."""
        radii = self.radii_at(speed)
        complete = fill_gaps(radii[None], self.directions)
        if np.isnan(complete).any():
            raise missing_directions_error(speed, self.directions[np.isfinite(radii)])
        m, n, a, b, angle = fit_ellipses(complete, self.directions)[0]
        if not b > 0:
            raise ZoneError(
                f"the zone at {speed:g} m/s is undefined: no ellipse around the person fits radii of "
                f"{radii.min():.2f} to {radii.max():.2f} m"
            )
        return Ellipse((m, n), (a, b), angle)


def fill_gaps(radii: Array, directions: Array = DIRECTIONS) -> Array:
    """Fill each gap (NaN) of `radii` (k, n) [m] linearly over `directions` (n,) [rad].

    A row is all NaN if its widest gap is `WIDEST_GAP` or more.
    """
    out = radii.copy()
    for row in np.flatnonzero(np.isnan(radii).any(axis=1)):
        has_data = np.isfinite(radii[row])
        low, high = _find_widest_gap(directions[has_data])
        if high - low >= WIDEST_GAP:
            out[row] = np.nan
        else:
            out[row] = np.interp(
                directions, directions[has_data], radii[row, has_data], period=2 * np.pi
            )
    return out


def fit_ellipses(radii: Array, directions: Array = DIRECTIONS) -> Array:
    """Fit an ellipse to each row of radii by least squares in metres.

    Parameters
    ----------
    radii : shape (k, n) [m].
    directions : of the radii, shape (n,) [rad].

    Returns
    -------
    Ellipses (k, 5): centre m, n, semi-axes a >= b [m], angle in (-pi/2, pi/2] [rad]. NaN for rows that
    contain a NaN or that no ellipse around the person fits.
    """
    ellipses = np.full((len(radii), 5), np.nan)
    rows = np.flatnonzero(np.isfinite(radii).all(axis=1) & (radii.sum(axis=1) > 0))
    if not len(rows):
        return ellipses
    unit = unit_vectors(directions)
    scale = radii[rows].mean(axis=1)
    target = radii[rows] / scale[:, None]
    # m, n, and the root [[p, r], [r, s]] of the form
    p = np.tile([0.0, 0.0, 1.0, 0.0, 1.0], (len(rows), 1))
    damping = np.full(len(rows), 1e-3)
    residual, jacobian = _parametric_reach(p, unit)
    residual -= target
    active = np.arange(len(rows))
    for _ in range(_MAX_ITERATIONS):
        transposed = jacobian[active].transpose(0, 2, 1)
        normal = transposed @ jacobian[active]
        diagonal = np.einsum("kii->ki", normal)
        damped = normal + (damping[active, None] * diagonal)[:, :, None] * np.eye(5)
        step = -np.linalg.solve(damped, transposed @ residual[active, :, None])[..., 0]
        new_residual, new_jacobian = _parametric_reach(p[active] + step, unit)
        new_residual -= target[active]
        # NaN: False
        better = (new_residual**2).sum(axis=1) <= (residual[active] ** 2).sum(axis=1)
        p[active[better]] += step[better]
        residual[active[better]] = new_residual[better]
        jacobian[active[better]] = new_jacobian[better]
        damping[active] *= np.where(better, 0.1, 10)
        active = active[~(np.abs(step).max(axis=1) < _CONVERGED)]
        if not len(active):
            break
    root = p[:, [2, 3, 3, 4]].reshape(-1, 2, 2)
    values, vectors = np.linalg.eigh(root)
    values = np.abs(values)
    minor = np.argmax(values, axis=1)
    major = vectors[np.arange(len(rows)), :, 1 - minor]
    angle = np.pi / 2 - (np.pi / 2 - np.arctan2(major[:, 1], major[:, 0])) % np.pi
    axes = 1 / np.sort(values, axis=1)
    ellipses[rows] = np.column_stack(
        [p[:, :2] * scale[:, None], axes * scale[:, None], angle]
    )
    return ellipses


def ellipse_reach(ellipses: Array, directions: Array = DIRECTIONS) -> Array:
    """Distance from the person to the boundary of `ellipses` in `directions` (n,) [rad].

    `ellipses` (..., 5) are as from `fit_ellipses`. The result has the shape (..., n) [m]; it is NaN if the
    person is outside the ellipse.
    """
    m, n, a, b, angle = np.moveaxis(ellipses[..., None, :], -1, 0)
    cos, sin, turn = np.cos(angle), np.sin(angle), directions - angle
    u, v = np.cos(turn) / a, np.sin(turn) / b
    x, y = (m * cos + n * sin) / a, (n * cos - m * sin) / b
    p, q, r = u * u + v * v, u * x + v * y, x * x + y * y - 1
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(r < 0, (q + np.sqrt(q * q - p * r)) / p, np.nan))


def _parametric_reach(p: Array, unit: Array) -> tuple[Array, Array]:
    """Reach t (k, n) of ellipses |L (t unit - centre)| = 1 and its slope (k, n, 5); NaN: origin outside."""
    root = p[:, [2, 3, 3, 4]].reshape(-1, 2, 2)
    along = np.einsum("kij,nj->kni", root, unit)
    start = -np.einsum("kij,kj->ki", root, p[:, :2])[:, None]
    a, b, c = (along**2).sum(-1), (along * start).sum(-1), (start**2).sum(-1) - 1
    with np.errstate(invalid="ignore"):
        t = np.where(c < 0, (np.sqrt(b * b - a * c) - b) / a, np.nan)
    w, d = t[..., None] * along + start, t[..., None] * unit - p[:, None, :2]
    slope = np.concatenate(
        [
            np.einsum("kij,knj->kni", root, w),
            -np.stack(
                [w[..., 0] * d[..., 0], w[..., 0] * d[..., 1] + w[..., 1] * d[..., 0]],
                axis=-1,
            ),
            -(w[..., 1] * d[..., 1])[..., None],
        ],
        axis=-1,
    )
    return t, slope / (w * along).sum(-1)[..., None]


def missing_directions_error(speed: float, known: Array) -> ZoneError:
    """The error at a `speed` [m/s] if people were seen only in the directions `known`, ascending [rad]."""
    low, high = np.degrees(_find_widest_gap(known))
    return ZoneError(
        f"the zone at {speed:g} m/s is undefined: no person was seen in the directions from {low:.0f} "
        f"counter-clockwise to {180 - (180 - high) % 360:.0f} deg; add data, or choose another speed"
    )


def _find_widest_gap(known: Array) -> tuple[float, float]:
    """The two of the `known` directions around the widest gap, counter-clockwise [rad]."""
    if not len(known):
        return -np.pi, np.pi
    widths = np.diff(np.append(known, known[0] + 2 * np.pi))
    widest = int(np.argmax(widths))
    return float(known[widest]), float(known[widest] + widths[widest])

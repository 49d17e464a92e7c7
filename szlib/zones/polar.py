"""A zone told by its radius in every direction, and the ellipse that stands for it.

The hull's zone ends where nobody ever was, so the smallest ellipse *around* it is meant.  A radius that
is estimated in each direction errs to both sides: around its largest errors an ellipse would be too
large.  So it is *fitted*, such that the sum over directions of (radius - reach of the ellipse)^2 is least.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..checks import Array
from ..errors import ZoneError
from .ellipses import Ellipse

DIRECTIONS: Array = np.radians(np.arange(-180.0, 180.0, 5.0))
"""Directions in which a radius is told, counter-clockwise from ahead [rad]."""
WIDEST_GAP = np.pi
"""Unseen directions beyond which there is no zone [rad]: as for the hull, where the origin is outside."""

_ROUNDS, _SETTLED = 100, 1e-12  # of Gauss, Newton, Levenberg and Marquardt; step relative to the mean radius


@dataclass(frozen=True, eq=False)
class PolarZone:
    """Radii of the zone by speed and direction, in the reference pedestrian's frame.

    Parameters
    ----------
    speeds : of the reference pedestrian, ascending, shape (m,) [m/s].
    directions : counter-clockwise from ahead, ascending within [-pi, pi), shape (n,) [rad].
    radii : shape (m, n) [m]; NaN where nobody was seen.

    Raises
    ------
    ZoneError : shapes do not fit, or speeds or directions do not ascend.
    """

    speeds: Array
    directions: Array
    radii: Array

    def __post_init__(self) -> None:
        for name in ("speeds", "directions", "radii"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), float))
        shape = (len(self.speeds), len(self.directions))
        if self.radii.shape != shape or 0 in shape:
            raise ZoneError(f"radii must have shape (speeds, directions) = {shape}; got {self.radii.shape}")
        if not ((np.diff(self.speeds) > 0).all() and (np.diff(self.directions) > 0).all()):
            raise ZoneError("speeds and directions of radii must ascend")
        if not (np.isfinite(self.speeds).all() and np.isfinite(self.directions).all()):
            raise ZoneError("speeds and directions of radii must be finite")
        if (self.radii < 0).any():
            raise ZoneError(f"radii must not be negative; got {np.nanmin(self.radii)} m")

    def at(self, speed: float) -> Array:
        """Radii (n,) [m] at a speed [m/s], linear between those fitted; ZoneError outside."""
        low, high = self.speeds[[0, -1]]
        if not low <= speed <= high:
            raise ZoneError(
                f"the zone at {speed:g} m/s is undefined: it was fitted for {low:g} to {high:g} m/s; "
                "fit it with this speed in `speeds`"
            )
        after = min(int(np.searchsorted(self.speeds, speed)), len(self.speeds) - 1)
        if self.speeds[after] == speed:
            return np.asarray(self.radii[after])
        share = (speed - self.speeds[after - 1]) / (self.speeds[after] - self.speeds[after - 1])
        return np.asarray((1 - share) * self.radii[after - 1] + share * self.radii[after])

    def boundary(self, speed: float, theta: ArrayLike) -> Array:
        """Boundary in directions theta (...) [rad], linear between those known; (..., 2) [m], NaN: unseen."""
        theta = np.asarray(theta, float)
        around = np.append(self.directions, self.directions[0] + 2 * np.pi)
        radii = np.append(self.at(speed), self.at(speed)[0])
        r = np.interp((theta - around[0]) % (2 * np.pi) + around[0], around, radii)
        return np.asarray(r[..., None] * np.stack([np.cos(theta), np.sin(theta)], axis=-1))

    def ellipse(self, speed: float) -> Ellipse:
        """The ellipse fitted to the radii at a speed [m/s]; ZoneError where too few directions were seen."""
        radii = self.at(speed)
        whole = closed(radii[None], self.directions)
        if np.isnan(whole).any():
            low, high = np.degrees(_widest_gap(radii, self.directions))
            raise ZoneError(
                f"the zone at {speed:g} m/s is undefined: nobody was seen in the directions from "
                f"{low:.0f} counter-clockwise to {high:.0f} deg; more data, or another speed, is needed"
            )
        m, n, a, b, angle = fit_ellipses(whole, self.directions)[0]
        if not b > 0:
            raise ZoneError(
                f"the zone at {speed:g} m/s is undefined: radii of {radii.min():.2f} to {radii.max():.2f} m "
                "are those of no ellipse around the person"
            )
        return Ellipse((m, n), (a, b), angle)


def closed(radii: Array, directions: Array = DIRECTIONS) -> Array:
    """Radii (k, n) [m] with each gap (NaN) closed, linear in direction; all NaN beyond `WIDEST_GAP`."""
    out = radii.copy()
    for row in np.flatnonzero(np.isnan(radii).any(axis=1)):
        seen = np.isfinite(radii[row])
        low, high = _widest_gap(radii[row], directions) if seen.any() else (0.0, np.inf)
        if high - low >= WIDEST_GAP:
            out[row] = np.nan
        else:
            out[row] = np.interp(directions, directions[seen], radii[row, seen], period=2 * np.pi)
    return out


def fit_ellipses(radii: Array, directions: Array = DIRECTIONS) -> Array:
    """Ellipses whose reach is nearest to each row of radii (k, n) [m], least squares in metres.

    Returns (k, 5): centre m, n, semi-axes a >= b [m], angle in (-pi/2, pi/2] [rad]; NaN for rows with a
    NaN, or that are those of no ellipse around the person.
    """
    found = np.full((len(radii), 5), np.nan)
    rows = np.flatnonzero(np.isfinite(radii).all(axis=1) & (radii.sum(axis=1) > 0))
    if not len(rows):
        return found
    unit = np.stack([np.cos(directions), np.sin(directions)], axis=-1)
    scale = radii[rows].mean(axis=1)
    target = radii[rows] / scale[:, None]
    p = np.tile([0.0, 0.0, 1.0, 0.0, 1.0], (len(rows), 1))  # m, n, and the root [[p, r], [r, s]] of the form
    damping = np.full(len(rows), 1e-3)
    miss, slope = _reach(p, unit)
    miss -= target
    todo = np.arange(len(rows))
    for _ in range(_ROUNDS):
        back = slope[todo].transpose(0, 2, 1)
        normal = back @ slope[todo]
        diagonal = np.einsum("kii->ki", normal)
        damped = normal + (damping[todo, None] * diagonal)[:, :, None] * np.eye(5)
        step = -np.linalg.solve(damped, back @ miss[todo, :, None])[..., 0]
        missed, sloped = _reach(p[todo] + step, unit)
        missed -= target[todo]
        better = (missed**2).sum(axis=1) <= (miss[todo] ** 2).sum(axis=1)  # False: the origin has left (NaN)
        p[todo[better]] += step[better]
        miss[todo[better]], slope[todo[better]] = missed[better], sloped[better]
        damping[todo] *= np.where(better, 0.1, 10)
        todo = todo[~(np.abs(step).max(axis=1) < _SETTLED)]
        if not len(todo):
            break
    root = p[:, [2, 3, 3, 4]].reshape(-1, 2, 2)
    values, vectors = np.linalg.eigh(root)
    values = np.abs(values)
    minor = np.argmax(values, axis=1)
    major = vectors[np.arange(len(rows)), :, 1 - minor]
    angle = np.pi / 2 - (np.pi / 2 - np.arctan2(major[:, 1], major[:, 0])) % np.pi
    axes = 1 / np.sort(values, axis=1)
    found[rows] = np.column_stack([p[:, :2] * scale[:, None], axes * scale[:, None], angle])
    return found


def ellipse_reach(ellipses: Array, directions: Array = DIRECTIONS) -> Array:
    """How far ellipses (..., 5), as from `fit_ellipses`, reach from the person in directions (n,) [m].

    Shape (..., n); NaN for an ellipse beside the person.
    """
    m, n, a, b, angle = np.moveaxis(ellipses[..., None, :], -1, 0)
    cos, sin, turn = np.cos(angle), np.sin(angle), directions - angle
    u, v = np.cos(turn) / a, np.sin(turn) / b
    x, y = (m * cos + n * sin) / a, (n * cos - m * sin) / b
    p, q, r = u * u + v * v, u * x + v * y, x * x + y * y - 1
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(r < 0, (q + np.sqrt(q * q - p * r)) / p, np.nan))


def _reach(p: Array, unit: Array) -> tuple[Array, Array]:
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
            -np.stack([w[..., 0] * d[..., 0], w[..., 0] * d[..., 1] + w[..., 1] * d[..., 0]], axis=-1),
            -(w[..., 1] * d[..., 1])[..., None],
        ],
        axis=-1,
    )
    return t, slope / (w * along).sum(-1)[..., None]


def _widest_gap(radii: Array, directions: Array) -> tuple[float, float]:
    """The two known directions around the widest gap, counter-clockwise [rad]."""
    seen = directions[np.isfinite(radii)]
    if not len(seen):
        return -np.pi, np.pi
    widths = np.diff(np.append(seen, seen[0] + 2 * np.pi))
    widest = int(np.argmax(widths))
    return float(seen[widest]), float(seen[widest] + widths[widest])

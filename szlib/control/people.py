"""Meetings: people as the controller sees them, and what to do when one is met head-on."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, sin
from typing import NamedTuple, Protocol, cast

from ..errors import SolverError, ZoneError
from ..zones.ellipses import Ellipse
from .barriers import ellipse_formula, finite


class SpeedZone(Protocol):
    """Anything that has a zone for each walking speed, such as `SocialZone`."""

    def ellipse(self, speed: float) -> Ellipse: ...


def as_ellipse(zone: Ellipse | SpeedZone, speed: float) -> Ellipse:
    """The zone at a walking speed [m/s]; ZoneError for what is none."""
    if isinstance(zone, Ellipse):
        return zone
    if not hasattr(zone, "ellipse"):
        raise ZoneError(f"a zone must be an Ellipse or have .ellipse(speed); got {type(zone).__name__}")
    return zone.ellipse(speed)


@dataclass(frozen=True)
class Person:
    """A person as the controller sees them: here, and at constant velocity from now on.

    Parameters
    ----------
    position : (x, y) [m].
    velocity : (vx, vy) [m/s].
    heading : where they face, counter-clockwise from x [rad]; None: where they walk.
    zone : their social zone, in their own frame; None: the controller's.

    Raises
    ------
    SolverError : a number is not finite, or a standing person has no heading.
    """

    position: tuple[float, float]
    velocity: tuple[float, float] = (0.0, 0.0)
    heading: float | None = None
    zone: Ellipse | SpeedZone | None = None

    def __post_init__(self) -> None:
        x, y = finite("a person's position", self.position, (2,)).tolist()
        vx, vy = finite("a person's velocity", self.velocity, (2,)).tolist()
        object.__setattr__(self, "position", (x, y))
        object.__setattr__(self, "velocity", (vx, vy))
        if self.heading is None and vx == vy == 0:
            raise SolverError(f"a person who stands needs a heading; got none for the one at {(x, y)}")
        heading = atan2(vy, vx) if self.heading is None else self.heading
        object.__setattr__(self, "heading", float(finite("a person's heading", heading, ())))

    @property
    def stands(self) -> bool:
        """True if the velocity is zero."""
        return self.velocity == (0.0, 0.0)

    def after(self, seconds: float) -> Person:
        """The same person, so many seconds later."""
        (x, y), (vx, vy) = self.position, self.velocity
        return Person((x + vx * seconds, y + vy * seconds), self.velocity, self.heading, self.zone)


class PlacedZone(NamedTuple):
    """A person's zone in the world: the two foci and the semi-major axis [m], and its velocity [m/s]."""

    xa: float
    ya: float
    xb: float
    yb: float
    a: float
    vx: float
    vy: float

    def distance(self, x: float, y: float) -> float:
        """Approximate distance of (x, y) to the zone now [m]."""
        return float(ellipse_formula(x, y, *self[:5]))


def place(person: Person, zone: Ellipse) -> PlacedZone:
    """The zone, of the person's own frame, around a person."""
    (x, y), heading = person.position, cast(float, person.heading)
    c, s = cos(heading), sin(heading)
    (ma, na), (mb, nb) = zone.foci.tolist()
    foci = (x + ma * c - na * s, y + ma * s + na * c, x + mb * c - nb * s, y + mb * s + nb * c)
    return PlacedZone(*foci, zone.semi_axes[0], *person.velocity)

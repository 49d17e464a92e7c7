"""A person as the controller sees them, and their zone in the world."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from math import atan2, cos, hypot, sin
from typing import NamedTuple, Protocol

from ..checks import LARGEST, check_number, check_point
from ..errors import SolverError, ZoneError
from ..zones.ellipses import Ellipse, circle_around
from .barriers import barrier, ellipse_formula
from .settings import MPCSettings

# Below this speed a person counts as standing, to allow for a tracker's noise [m/s] (assumed).
STANDING_SPEED = 0.1


class SpeedZone(Protocol):
    """Anything that has a zone for each walking speed, such as `SocialZone`."""

    def ellipse(self, speed: float) -> Ellipse:
        """The zone at a walking `speed` [m/s], in the person's frame."""


def as_ellipse(zone: Ellipse | SpeedZone, speed: float) -> Ellipse:
    """Ellipse of `zone` at a walking `speed` [m/s].

    ZoneError if it is none, reaches beyond `LARGEST`, or does not contain the person's position. It may be
    smaller than a body, as a measured zone may be: `Step.safe` keeps the robot off bodies besides.
    """
    if not isinstance(zone, Ellipse):
        if not hasattr(zone, "ellipse"):
            raise ZoneError(
                f"a zone must be an Ellipse or have .ellipse(speed); got {type(zone).__name__}"
            )
        zone = zone.ellipse(speed)
    (m, n), (a, _) = zone.center, zone.semi_axes
    if not max(abs(m), abs(n), a) <= LARGEST:
        raise ZoneError(
            f"a zone must lie within {LARGEST:g} m of its person; got {zone}"
        )
    xa, ya, xb, yb, a = zone.foci_and_axis
    if hypot(xa, ya) + hypot(xb, yb) > 2 * a * (1 + 1e-9):
        raise ZoneError(
            f"a zone must contain its person, who is at (0, 0) of its frame; got {zone}"
        )
    return zone


@dataclass(frozen=True)
class Person:
    """A person as the controller sees them: a state now, and constant velocity from now on.

    Parameters
    ----------
    position : (x, y) [m].
    velocity : (vx, vy) [m/s].
    heading : direction in which they face, counter-clockwise from x [rad]; None: in which they walk. It stays
        None if they stand, or with `heading_unknown`; then the circle around their zone is used.
    zone : their social zone, in their own frame; None: the controller's.
    id : by which a `Tracker` recognises them; None: they are new at each step.
    heading_unknown : True if they are too slow for the velocity to give the heading.

    Raises
    ------
    SolverError : a number cannot be used (give measurements to `MPCCBF.step` as an array), or a heading is
        both given and unknown.
    ZoneError : the zone reaches beyond `LARGEST`, or does not contain the person.

    Examples
    --------
    >>> import szlib
    >>> person = szlib.Person(position=(4.0, 0.0), velocity=(-0.5, 0.0))
    >>> round(person.heading, 3)
    3.142
    >>> person.after(2.0).position
    (3.0, 0.0)
    >>> szlib.Person((0.0, 0.0)).heading is None  # they stand: the direction is unknown
    True
    """

    position: tuple[float, float]
    velocity: tuple[float, float] = (0.0, 0.0)
    heading: float | None = None
    zone: Ellipse | SpeedZone | None = None
    id: Hashable = None
    heading_unknown: bool = False

    def __post_init__(self) -> None:
        x, y = position = check_point("a person's position", self.position)
        vx, vy = velocity = check_point("a person's velocity", self.velocity)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "velocity", velocity)
        if self.heading is not None:
            object.__setattr__(
                self, "heading", check_number("a person's heading", self.heading)
            )
            if self.heading_unknown:
                raise SolverError(
                    f"a heading is given or unknown; got {self.heading} and heading_unknown for {(x, y)}"
                )
        elif not (self.stands or self.heading_unknown):
            object.__setattr__(self, "heading", atan2(vy, vx))
        if isinstance(self.zone, Ellipse):
            as_ellipse(self.zone, 0.0)

    @property
    def stands(self) -> bool:
        """True if the velocity is zero."""
        return self.velocity == (0.0, 0.0)

    def after(self, seconds: float) -> Person:
        """The same person, `seconds` later."""
        if self.stands:
            return self
        (x, y), (vx, vy) = self.position, self.velocity
        return self.at((x + vx * seconds, y + vy * seconds))

    def at(self, position: tuple[float, float]) -> Person:
        """The same person at another `position` [m]; only the position is checked, for speed."""
        moved = object.__new__(type(self))
        moved.__dict__.update(
            self.__dict__, position=check_point("a person's position", position)
        )
        return moved


class PlacedZone(NamedTuple):
    """A person's zone in the world.

    Attributes
    ----------
    xa, ya, xb, yb : the two foci [m].
    a : semi-major axis [m].
    vx, vy : velocity [m/s].
    """

    xa: float
    ya: float
    xb: float
    yb: float
    a: float
    vx: float
    vy: float

    def distance(self, x: float, y: float) -> float:
        """Approximate distance of (`x`, `y`) to the zone now [m]."""
        return float(ellipse_formula(x, y, *self[:5]))

    def blocks(self, goal: tuple[float, float], settings: MPCSettings) -> bool:
        """True if a person slower than `STANDING_SPEED` has the `goal` in their zone: h < 0 by `settings`."""
        stands = hypot(self.vx, self.vy) < STANDING_SPEED
        return stands and bool(
            barrier(self.distance(*goal), settings.r_robot, settings.eps) < 0
        )


def place_zone(person: Person, zone: Ellipse) -> PlacedZone:
    """Place `zone`, in the person's own frame, around `person`; without a heading the circle around it."""
    (x, y), (vx, vy), heading = person.position, person.velocity, person.heading
    if heading is None:
        zone, heading = circle_around(zone), 0.0
    c, s, (ma, na, mb, nb, a) = cos(heading), sin(heading), zone.foci_and_axis
    xa, ya, xb, yb = (
        x + ma * c - na * s,
        y + ma * s + na * c,
        x + mb * c - nb * s,
        y + mb * s + nb * c,
    )
    # The constructor of a named tuple would take as long as all of this.
    return tuple.__new__(PlacedZone, (xa, ya, xb, yb, a, vx, vy))

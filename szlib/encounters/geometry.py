"""Where encounters are searched: an open area and the attentional space (paper, sec. 2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from ..core.checks import require
from ..core.errors import DataError
from ..tracks.shapes import ATC_AREA


@dataclass(frozen=True)
class Square:
    """An open rectangle along the axes of the world.

    Parameters
    ----------
    x, y : extent along each axis, (lowest, highest) [m].
    reason : why `szlib.walked_area` took it, a sentence; empty for a square that was given.

    Raises
    ------
    DataError : a value is not finite, or the lowest is not below the highest.

    Examples
    --------
    >>> import szlib
    >>> square = szlib.Square(x=(0, 12), y=(0, 8))
    >>> square.area
    96
    >>> square.grown(-1)
    Square(x=(1, 11), y=(1, 7))
    >>> szlib.ATC_SQUARE.area
    198.0
    """

    x: tuple[float, float]
    y: tuple[float, float]
    reason: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        is_square = (
            np.isfinite([*self.x, *self.y]).all()
            and self.x[0] < self.x[1]
            and self.y[0] < self.y[1]
        )
        require(
            is_square,
            "x and y of a square",
            (self.x, self.y),
            "finite, each (lowest, highest)",
        )

    def __str__(self) -> str:
        return " ".join(repr(float(value)) for value in (*self.x, *self.y))

    @property
    def box(self) -> Square:
        """The smallest rectangle around it: itself."""
        return self

    @property
    def area(self) -> float:
        """Its size [m2]."""
        return (self.x[1] - self.x[0]) * (self.y[1] - self.y[0])

    @property
    def outlines(self) -> list[np.ndarray]:
        """Its one border, closed, shape (5, 2) [m]."""
        (x0, x1), (y0, y1) = self.x, self.y
        return [np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])]

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Whether each point (arrays `x`, `y` of one shape) lies inside or on the border."""
        return np.asarray(
            (x >= self.x[0]) & (x <= self.x[1]) & (y >= self.y[0]) & (y <= self.y[1])
        )

    def covers(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Whether each quadrilateral lies inside; `x`, `y` of its corners in order, each (4, n) [m]."""
        return np.asarray(self.contains(x, y).all(axis=0))

    def grown(self, margin: float) -> Square:
        """The square with a `margin` [m] on each side; smaller where it is negative."""
        (x0, x1), (y0, y1) = self.x, self.y
        return Square((x0 - margin, x1 + margin), (y0 - margin, y1 + margin))


@dataclass(frozen=True)
class Region:
    """An open area of any outline: a polygon, or several, with or without holes (pillars).

    Parameters
    ----------
    wkt : the polygon in metres as well-known text, such as "POLYGON ((0 0, 12 0, 12 8, 0 0))".
        `szlib.as_area` makes it from Shapely's polygons, PedPy's areas and files.
    reason : as for a `Square`.

    Raises
    ------
    DataError : the text is not a valid polygon.

    Examples
    --------
    >>> import numpy as np, szlib
    >>> region = szlib.Region("POLYGON ((0 0, 12 0, 12 8, 0 0))")
    >>> region.contains(np.array([8.0, 1.0]), np.array([1.0, 7.0]))
    array([ True, False])
    """

    wkt: str
    reason: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        _ = self.polygon

    def __str__(self) -> str:
        return self.wkt

    @cached_property
    def polygon(self) -> BaseGeometry:
        """The polygon as a Shapely geometry; raises DataError if it is not valid."""
        try:
            polygon = shapely.from_wkt(self.wkt)
        except (shapely.errors.ShapelyError, TypeError) as error:
            raise DataError(
                f"{str(self.wkt)[:80]!r}: is no well-known text ({error})"
            ) from error
        if polygon.geom_type not in ("Polygon", "MultiPolygon") or polygon.is_empty:
            raise DataError(
                f"{self.wkt[:80]!r}: an area must be a polygon with an inside; got a {polygon.geom_type}"
            )
        if not (np.isfinite(polygon.bounds).all() and polygon.is_valid):
            raise DataError(
                f"{self.wkt[:80]!r}: is no valid polygon ({shapely.is_valid_reason(polygon)}); its border "
                "must not cross itself (shapely.make_valid can repair it)"
            )
        shapely.prepare(polygon)
        return polygon

    @property
    def box(self) -> Square:
        """The smallest rectangle along the axes around it."""
        x0, y0, x1, y1 = self.polygon.bounds
        return Square((x0, x1), (y0, y1))

    @property
    def area(self) -> float:
        """Its size [m2]."""
        return float(self.polygon.area)

    @property
    def outlines(self) -> list[np.ndarray]:
        """Every border, outer and inner, closed, each (n, 2) [m]."""
        rings = shapely.get_parts(shapely.get_rings(shapely.get_parts(self.polygon)))
        return [shapely.get_coordinates(ring) for ring in rings]

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Whether each point (arrays `x`, `y` of one shape) lies inside or on the border."""
        return np.asarray(shapely.intersects_xy(self.polygon, x, y))

    def covers(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Whether each quadrilateral lies inside; `x`, `y` of its corners in order, each (4, n) [m].

        Where the area is not convex, four corners inside are not enough: a pillar can stand between them.
        """
        inside = np.asarray(self.contains(x, y).all(axis=0))
        if not self.convex:
            at = np.flatnonzero(inside)
            shapes = shapely.polygons(
                np.stack([x[:, at], y[:, at]], axis=-1).transpose(1, 0, 2)
            )
            inside[at] = shapely.covers(self.polygon, shapes)
        return inside

    @cached_property
    def convex(self) -> bool:
        """Whether the area is convex."""
        return bool(self.polygon.equals(self.polygon.convex_hull))

    def simplest(self) -> Area:
        """The same area, as a `Square` where it is a rectangle along the axes."""
        return (
            self.box
            if self.convex and self.polygon.equals(self.polygon.envelope)
            else self
        )

    def grown(self, margin: float) -> Region:
        """The area with a `margin` [m] on each side, corners kept; smaller where it is negative."""
        return Region(self.polygon.buffer(margin, join_style="mitre").wkt)


Area = Square | Region
"""Where encounters are searched."""

ATC_SQUARE = Square(*ATC_AREA)
"""The central square of the ATC mall (assumed; free of pillars, walls and queues on the real day)."""


@dataclass(frozen=True)
class AttentionalSpace:
    """The rectangle to which a pedestrian attends: 4 m by 5 m in the paper (sec. 2).

    Parameters
    ----------
    length : extent along the direction of motion [m] (paper: 5).
    width : extent across it [m] (paper: 4).
    centred : False puts it ahead of the person, True around them (assumed: ahead).

    Raises
    ------
    DataError : a side is not positive.

    Examples
    --------
    >>> import szlib
    >>> szlib.AttentionalSpace(length=3.0, centred=True).ahead
    (-1.5, 1.5)
    """

    length: float = 5.0
    width: float = 4.0
    centred: bool = False

    def __post_init__(self) -> None:
        for name, side in (("length", self.length), ("width", self.width)):
            require(
                0 < side < np.inf,
                f"{name} of an attentional space",
                side,
                "positive [m]",
            )

    @property
    def ahead(self) -> tuple[float, float]:
        """Extent along the direction of motion, (nearest, farthest) [m]."""
        return (
            (-self.length / 2, self.length / 2) if self.centred else (0.0, self.length)
        )

    @property
    def corners(self) -> np.ndarray:
        """The four corners in the reference pedestrian's frame, shape (4, 2) [m]."""
        (near, far), side = self.ahead, self.width / 2
        return np.array([(near, -side), (far, -side), (far, side), (near, side)])

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Whether points `x` ahead and `y` to the left of the person [m] lie inside or on the border."""
        return np.asarray(
            (x >= self.ahead[0]) & (x <= self.ahead[1]) & (np.abs(y) <= self.width / 2)
        )


PAPER_SPACE = AttentionalSpace()
"""The attentional space of the paper, ahead of the person."""


def wrap_angle(angle: np.ndarray) -> np.ndarray:
    """Wrap each `angle` [rad] to (-pi, pi]."""
    return np.asarray(np.pi - np.mod(np.pi - angle, 2 * np.pi))

"""Where encounters are searched: an open area and the attentional space (paper, sec. 2)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from ..core.checks import require
from ..tracks.shapes import ATC_AREA


@dataclass(frozen=True)
class Area:
    """Where encounters are searched: a polygon, or several, with or without holes (pillars).

    Equal areas are equal and have one hash, whatever the order of their corners.  ``str(area)`` is text from
    which `szlib.as_area` makes the same area: "x0 x1 y0 y1" of a rectangle along the axes, else well-known
    text.

    Parameters
    ----------
    polygon : a Shapely polygon or multipolygon in metres.  `szlib.as_area` takes other forms.
    reason : how `szlib.walked_area` found it, a sentence; empty for an area that was given.

    Raises
    ------
    DataError : the polygon is not valid, not finite, or has no inside.

    Examples
    --------
    >>> import numpy as np, szlib
    >>> area = szlib.as_area("POLYGON ((0 0, 12 0, 12 8, 0 0))")
    >>> area
    Area(x=(0.0, 12.0), y=(0.0, 8.0), area=48.0)
    >>> area.contains(np.array([8.0, 1.0]), np.array([1.0, 7.0]))
    array([ True, False])
    """

    polygon: Polygon | MultiPolygon
    reason: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        polygon = self.polygon
        require(
            isinstance(polygon, Polygon | MultiPolygon) and not polygon.is_empty,
            "an area",
            polygon,
            "a polygon with an inside",
        )
        require(
            polygon.is_valid,
            "the border of an area",
            shapely.is_valid_reason(polygon),
            "that of a valid polygon: it must not cross itself (shapely.make_valid can repair it)",
        )
        # as it is written as text: digits are lost
        shape = shapely.from_wkt(shapely.force_2d(polygon).wkt)
        if shape.equals(shape.envelope):
            # 0 for -0, which has another hash
            shape = shapely.box(*np.add(polygon.bounds, 0.0))
        object.__setattr__(self, "polygon", shapely.normalize(shape))

    def __str__(self) -> str:
        if self.is_rectangle:
            return " ".join(map(str, self.x + self.y))
        return str(self.polygon.wkt)

    def __repr__(self) -> str:
        return f"Area(x={self.x}, y={self.y}, area={self.area})"

    @property
    def is_rectangle(self) -> bool:
        """Whether it is a rectangle along the axes."""
        return bool(self.polygon.equals(self.polygon.envelope))

    @property
    def x(self) -> tuple[float, float]:
        """Its extent along x, (lowest, highest) [m]."""
        return tuple(self.polygon.bounds[::2])

    @property
    def y(self) -> tuple[float, float]:
        """Its extent along y, (lowest, highest) [m]."""
        return tuple(self.polygon.bounds[1::2])

    @property
    def area(self) -> float:
        """Its size [m2]."""
        return float(self.polygon.area)

    @property
    def outlines(self) -> list[np.ndarray]:
        """Every border, outer and inner, closed, each (n, 2) [m]."""
        return [
            shapely.get_coordinates(ring)
            for ring in shapely.get_rings(shapely.get_parts(self.polygon))
        ]

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Whether each point (arrays `x`, `y` of one shape) lies inside or on the border."""
        if self.is_rectangle:
            west, south, east, north = self.polygon.bounds
            return np.asarray((west <= x) & (x <= east) & (south <= y) & (y <= north))
        shapely.prepare(self.polygon)  # once; does nothing the next time
        return np.asarray(shapely.intersects_xy(self.polygon, x, y))

    def covers(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Whether each quadrilateral lies inside; `x`, `y` of its corners in order, each (4, n) [m].

        Where the area is not convex, four corners inside are not enough: a pillar can stand between them.
        """
        inside = np.asarray(self.contains(x, y).all(axis=0))
        if not self.polygon.equals(self.polygon.convex_hull):
            corners = np.stack([x.T, y.T], axis=-1)[inside]
            inside[inside] = shapely.covers(self.polygon, shapely.polygons(corners))
        return inside

    def grown(self, margin: float) -> Area:
        """The area with a `margin` [m] on each side, corners kept; smaller where it is negative."""
        return Area(self.polygon.buffer(margin, join_style="mitre"))


def Square(x: tuple[float, float], y: tuple[float, float]) -> Area:
    """Make an open rectangle along the axes of the world.

    Parameters
    ----------
    x, y : extent along each axis, (lowest, highest) [m].

    Raises
    ------
    DataError : a value is not finite, or the lowest is not below the highest.

    Examples
    --------
    >>> import szlib
    >>> str(szlib.Square(x=(0, 12), y=(0, 8)).grown(-1))
    '1.0 11.0 1.0 7.0'
    >>> szlib.ATC_SQUARE.area
    198.0
    """
    x0, x1 = x
    y0, y1 = y
    require(
        -np.inf < x0 < x1 < np.inf and -np.inf < y0 < y1 < np.inf,
        "x and y of a square",
        (x, y),
        "finite, each (lowest, highest)",
    )
    return Area(shapely.box(x0, y0, x1, y1))


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
        for side in (self.length, self.width):
            require(
                0 < side < np.inf,
                "length and width of an attentional space",
                side,
                "positive [m]",
            )

    @property
    def ahead(self) -> tuple[float, float]:
        """Extent along the direction of motion, (nearest, farthest) [m]."""
        nearest = -self.length / 2 if self.centred else 0.0
        return nearest, nearest + self.length

    @property
    def corners(self) -> np.ndarray:
        """The four corners in the reference pedestrian's frame, shape (4, 2) [m]."""
        near, far = self.ahead
        side = self.width / 2
        return np.array(
            [
                (near, -side),
                (far, -side),
                (far, side),
                (near, side),
            ]
        )

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Whether points `x` ahead and `y` to the left of the person [m] lie inside or on the border."""
        nearest, farthest = self.ahead
        return (nearest <= x) & (x <= farthest) & (abs(y) <= self.width / 2)


PAPER_SPACE = AttentionalSpace()
"""The attentional space of the paper, ahead of the person."""


def wrap_angle(angle: np.ndarray) -> np.ndarray:
    """Wrap each `angle` [rad] to (-pi, pi]."""
    turn = 2 * np.pi
    # A remainder can be rounded up to the whole turn, so it is taken twice.
    return np.pi - (np.pi - angle) % turn % turn

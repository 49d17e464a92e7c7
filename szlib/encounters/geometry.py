"""Where encounters are looked for: an open area and the attentional space (paper, sec. 2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import DataError
from ..tracks.formats.atc import ATC_AREA

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


@dataclass(frozen=True)
class Square:
    """An open rectangle of the world, x and y each (lowest, highest) [m]."""

    x: tuple[float, float]
    y: tuple[float, float]

    def __post_init__(self) -> None:
        if not (np.isfinite([*self.x, *self.y]).all() and self.x[0] < self.x[1] and self.y[0] < self.y[1]):
            raise DataError(
                f"a square needs finite x and y, each (lowest, highest); got x = {self.x}, y = {self.y}"
            )

    def __str__(self) -> str:
        return " ".join(repr(float(value)) for value in (*self.x, *self.y))

    @property
    def box(self) -> Square:
        """The smallest square around it: itself."""
        return self

    @property
    def area(self) -> float:
        """Its area [m2]."""
        return (self.x[1] - self.x[0]) * (self.y[1] - self.y[0])

    @property
    def outlines(self) -> list[np.ndarray]:
        """Its one border, closed, shape (5, 2) [m]."""
        (x0, x1), (y0, y1) = self.x, self.y
        return [np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])]

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Which points (any shape, the same for x and y) lie inside or on the border."""
        return np.asarray((x >= self.x[0]) & (x <= self.x[1]) & (y >= self.y[0]) & (y <= self.y[1]))

    def covers(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Which quadrilaterals lie inside; x and y of their corners in order, each (4, n) [m]; shape (n,)."""
        return np.asarray(self.contains(x, y).all(axis=0))

    def grown(self, by: float) -> Square:
        """The square with `by` metres more on each side."""
        return Square((self.x[0] - by, self.x[1] + by), (self.y[0] - by, self.y[1] + by))


@dataclass(frozen=True)
class Region:
    """An open area of any outline: a polygon, or several, with or without holes (pillars).

    Parameters
    ----------
    wkt : the polygon in metres as well-known text, such as "POLYGON ((0 0, 12 0, 12 8, 0 0))".
        `szlib.as_area` makes it from Shapely's polygons, PedPy's areas and files.
    """

    wkt: str

    def __post_init__(self) -> None:
        _ = self.polygon

    def __str__(self) -> str:
        return self.wkt

    @cached_property
    def polygon(self) -> BaseGeometry:
        """The polygon as a Shapely geometry; DataError where the text is none, or it is not valid."""
        import shapely

        try:
            polygon = shapely.from_wkt(self.wkt)
        except (shapely.errors.ShapelyError, TypeError) as error:
            raise DataError(f"{str(self.wkt)[:80]!r}: is no well-known text ({error})") from error
        if polygon.geom_type not in ("Polygon", "MultiPolygon") or polygon.is_empty:
            raise DataError(
                f"{self.wkt[:80]!r}: an area must be a polygon with an inside; got a {polygon.geom_type}"
            )
        if not (np.isfinite(polygon.bounds).all() and polygon.is_valid):
            raise DataError(
                f"{self.wkt[:80]!r}: is no valid polygon ({shapely.is_valid_reason(polygon)}); its border "
                "must not cross itself (shapely.make_valid can mend it)"
            )
        shapely.prepare(polygon)
        return polygon

    @property
    def box(self) -> Square:
        """The smallest square around it."""
        x0, y0, x1, y1 = self.polygon.bounds
        return Square((x0, x1), (y0, y1))

    @property
    def area(self) -> float:
        """Its area [m2]."""
        return float(self.polygon.area)

    @property
    def outlines(self) -> list[np.ndarray]:
        """Every border, outer and inner, closed, each (n, 2) [m]."""
        import shapely

        rings = shapely.get_parts(shapely.get_rings(shapely.get_parts(self.polygon)))
        return [shapely.get_coordinates(ring) for ring in rings]

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Which points (any shape, the same for x and y) lie inside or on the border."""
        import shapely

        return np.asarray(shapely.intersects_xy(self.polygon, x, y))

    def covers(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Which quadrilaterals lie inside; x and y of their corners in order, each (4, n) [m]; shape (n,).

        Where the area is not convex, four corners inside are not enough: no pillar may stand between them.
        """
        import shapely

        inside = np.asarray(self.contains(x, y).all(axis=0))
        if not self.convex:
            at = np.flatnonzero(inside)
            shapes = shapely.polygons(np.stack([x[:, at], y[:, at]], axis=-1).transpose(1, 0, 2))
            inside[at] = shapely.covers(self.polygon, shapes)
        return inside

    @cached_property
    def convex(self) -> bool:
        """Whether it is its own convex hull."""
        return bool(self.polygon.equals(self.polygon.convex_hull))

    def simplest(self) -> Area:
        """The same area, as a `Square` where it is a rectangle along the axes."""
        return self.box if self.convex and self.polygon.equals(self.polygon.envelope) else self

    def grown(self, by: float) -> Region:
        """The area with `by` metres more on each side, corners kept; less where `by` is negative."""
        return Region(self.polygon.buffer(by, join_style="mitre").wkt)


Area = Square | Region
"""Where encounters are looked for."""

ATC_SQUARE = Square(*ATC_AREA)
"""The central square of the ATC mall (assumed; free of pillars, walls and queues on the real day)."""


@dataclass(frozen=True)
class AttentionalSpace:
    """The rectangle a pedestrian attends to: 4 m by 5 m in the paper (sec. 2).

    Parameters
    ----------
    length : extent along the direction of motion [m] (paper: 5).
    width : extent across it [m] (paper: 4).
    centred : False puts it ahead of the person, True around them (assumed: ahead).
    """

    length: float = 5.0
    width: float = 4.0
    centred: bool = False

    def __post_init__(self) -> None:
        if not (0 < self.length < np.inf and 0 < self.width < np.inf):
            raise DataError(
                f"an attentional space needs positive sides; got {self.length} m by {self.width} m"
            )

    @property
    def ahead(self) -> tuple[float, float]:
        """Extent along the direction of motion, (nearest, farthest) [m]."""
        return (-self.length / 2, self.length / 2) if self.centred else (0.0, self.length)

    @property
    def corners(self) -> np.ndarray:
        """The four corners in the reference pedestrian's frame, shape (4, 2) [m]."""
        (near, far), side = self.ahead, self.width / 2
        return np.array([(near, -side), (far, -side), (far, side), (near, side)])

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Which points of the reference pedestrian's frame lie inside or on the border."""
        return np.asarray((x >= self.ahead[0]) & (x <= self.ahead[1]) & (np.abs(y) <= self.width / 2))


PAPER_SPACE = AttentionalSpace()
"""The attentional space of the paper, ahead of the person."""


def wrap_angle(angle: np.ndarray) -> np.ndarray:
    """Angles [rad] wrapped to (-pi, pi]."""
    return np.asarray(np.pi - np.mod(np.pi - angle, 2 * np.pi))

"""Where encounters are looked for: the open square and the attentional space (paper, sec. 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import DataError


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

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Which points (any shape, the same for x and y) lie inside or on the border."""
        return np.asarray((x >= self.x[0]) & (x <= self.x[1]) & (y >= self.y[0]) & (y <= self.y[1]))

    def grown(self, by: float) -> Square:
        """The square with `by` metres more on each side."""
        return Square((self.x[0] - by, self.x[1] + by), (self.y[0] - by, self.y[1] + by))


ATC_SQUARE = Square(x=(-18.5, -7.5), y=(-10.0, 8.0))
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

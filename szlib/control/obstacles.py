"""What the robot keeps out of: zones of people, their bodies, walls, and whatever a user adds.

An obstacle is one class: the distance of a point, and the priority with which the robot keeps out.

    segment     d = sqrt(g^2 + b^2): g across its line, b beyond its ends   (Euclidean)
                g = [(x-xa)(yb-ya) - (y-ya)(xb-xa)] / L,   t = [(L/2)^2 - |x-xc|^2] / L
                d = sqrt(g^2 + ((|t| - t)/2)^2)                            (paper, eq. 3-5)
    ellipse     d = (|x-ca| + |x-cb|)/2 - a,  ca and cb the foci          (paper, eq. 7)
    barrier     h = d - r_robot - margin, safe where h >= 0                (paper, sec. 4)
    condition   h(x_{k+1}) - h(x_k) >= -gamma h(x_k)                       (paper, eq. 1)

`|t| - t` stands for the paper's norm of a scalar. The controller, its steps, the runs and the figures know
nothing of single kinds. Each formula is written once, with operators only, so that the same lines run on
floats, on NumPy arrays and on CasADi's symbols.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from enum import IntEnum
from itertools import groupby
from math import cos, hypot, inf, sin
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.checks import Array, check_array, check_point
from ..core.errors import SolverError
from ..zones.ellipses import BODY_RADIUS, Ellipse
from .settings import TOLERANCE, MPCSettings, check_argument

# Below this length the direction of a wall cannot be used [m]; a pillar may be a wall of a millimetre.
SHORTEST_WALL = 1e-3
KNOT = 4  # numbers of each interval of a prediction


def _project(x: Any, y: Any, xa: Any, ya: Any, xb: Any, yb: Any) -> tuple[Any, ...]:
    """Length of the segment (`xa`, `ya`) to (`xb`, `yb`), and g of (`x`, `y`) and its place along [m].

    The place is measured from the middle (paper, eq. 3).
    """
    length = ((xb - xa) ** 2 + (yb - ya) ** 2) ** 0.5
    ux = (xb - xa) / length
    uy = (yb - ya) / length
    dx = x - (xa + xb) / 2
    dy = y - (ya + yb) / 2
    return length, dx * uy - dy * ux, dx * ux + dy * uy


def segment_formula(x: Any, y: Any, *ends: Any) -> Any:
    """Approximate distance of (`x`, `y`) to the segment with these `ends` (xa, ya, xb, yb) [m] (eq. 3-5)."""
    length, g, along = _project(x, y, *ends)
    t = ((length / 2) ** 2 - along**2 - g**2) / length
    return (g**2 + ((abs(t) - t) / 2) ** 2) ** 0.5


def euclidean_segment_formula(x: Any, y: Any, *ends: Any) -> Any:
    """Euclidean distance of (`x`, `y`) to the segment with the `ends` (xa, ya, xb, yb) [m]."""
    length, g, along = _project(x, y, *ends)
    beyond = abs(along) - length / 2
    return (g**2 + ((abs(beyond) + beyond) / 2) ** 2) ** 0.5


def ellipse_formula(x: Any, y: Any, xa: Any, ya: Any, xb: Any, yb: Any, a: Any) -> Any:
    """Approximate distance of (`x`, `y`) to an ellipse [m] (paper, eq. 7).

    The foci are (`xa`, `ya`) and (`xb`, `yb`), the semi-major axis is `a`.
    """
    return (
        ((x - xa) ** 2 + (y - ya) ** 2) ** 0.5 + ((x - xb) ** 2 + (y - yb) ** 2) ** 0.5
    ) / 2 - a


def barrier(distance: Any, radius: float, margin: Any) -> Any:
    """Barrier h = d - r_robot - eps [m]: safe where it is not negative (paper, sec. 4).

    Parameters
    ----------
    distance : d, to a wall or a zone [m].
    radius : of the robot [m].
    margin : eps [m].

    Examples
    --------
    >>> from szlib.control import barrier
    >>> barrier(2.0, radius=0.5, margin=0.25)
    1.25
    """
    return distance - (radius + margin)


def cbf_residual(h_next: Any, h: Any, gamma: float) -> Any:
    """Residual of the discrete CBF condition [m]: satisfied where it is not negative (paper, eq. 1).

    Parameters
    ----------
    h_next : h one step later [m].
    h : now [m].
    gamma : fraction of h that a step may use up.

    Examples
    --------
    >>> from szlib.control import cbf_residual
    >>> cbf_residual(h_next=0.5, h=1.0, gamma=0.5)
    0.0
    """
    return h_next - (1 - gamma) * h


def segment_distance(points: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """Approximate distance of points to the segment from a to b (paper, eq. 3-5).

    It is zero exactly on the segment and positive elsewhere. It is Euclidean for points in the disc that has
    the segment as its diameter; beyond, it is an approximation that is exact to first order at the ends.

    Parameters
    ----------
    points : positions, shape (..., 2) [m].
    a, b : end points, shape (2,) [m].

    Returns
    -------
    Distances, shape (...) [m].

    Raises
    ------
    SolverError : the segment has no length, or a shape or a number cannot be used.

    Examples
    --------
    >>> import szlib
    >>> szlib.segment_distance([(0.0, 0.5), (0.0, -0.5)], (-1.0, 0.0), (1.0, 0.0)).tolist()
    [0.5, 0.5]
    """
    xy = check_array("points", points, (..., 2))
    ends = check_wall([np.asarray(a), np.asarray(b)])
    return np.asarray(segment_formula(xy[..., 0], xy[..., 1], *ends.ravel()))


def ellipse_distance(points: ArrayLike, ellipse: Ellipse) -> Array:
    """Approximate signed distance of points to an ellipse, from the sum of focal distances (paper, eq. 7).

    It is zero on the ellipse, negative inside (at least -(a - c)), and positive outside. For a circle it is
    Euclidean.

    Parameters
    ----------
    points : positions, shape (..., 2), in the frame of the ellipse's centre [m].
    ellipse : the social zone.

    Returns
    -------
    Distances, shape (...) [m].

    Examples
    --------
    >>> import szlib
    >>> circle = szlib.Ellipse(center=(0.0, 0.0), semi_axes=(1.0, 1.0))
    >>> szlib.ellipse_distance([(2.0, 0.0), (0.0, 0.0)], circle).tolist()
    [1.0, -1.0]
    """
    xy = check_array("points", points, (..., 2))
    return np.asarray(ellipse_formula(xy[..., 0], xy[..., 1], *ellipse.foci_and_axis))


def check_wall(wall: ArrayLike) -> Array:
    """End points of a `wall`, shape (2, 2) [m]; SolverError if it is shorter than `SHORTEST_WALL`."""
    ends = check_array("a wall", wall, (2, 2))
    is_long = np.hypot(*(ends[1] - ends[0])) >= SHORTEST_WALL
    expected = f"two different end points, at least {SHORTEST_WALL} m apart"
    check_argument(is_long, "a wall", ends.tolist(), expected)
    return ends


Point = tuple[float, float]
Mask = NDArray[np.bool_]


class Priority(IntEnum):
    """What a plan violates last: never a lower number to satisfy a higher one.

    WALL : what stands still and is known. BODY : bodies of people. ZONE : h >= 0 of their zones.
    DECAY : the barrier condition of all of these (paper, eq. 1).
    """

    WALL = 0
    BODY = 1
    ZONE = 2
    DECAY = 3


_KINDS = dict[str, Any]()  # classes of obstacles by their kinds


class Obstacle:
    """Base class of obstacles: derive from it, and write `distance`.

    Parameters
    ----------
    numbers : the parameters of `distance`, finite, at least one.

    Attributes
    ----------
    kind : name of the class in logs and explanations, such as "wall"; by default that of the class.
    priority : which violation is worse, if the robot cannot avoid all; what has that of a wall stands still.
        The guard, and `Step.passively_safe`, look at walls and at bodies of people, at no other `BODY`.

    Notes
    -----
    `distance` must not change by more than the robot and the obstacle move, and should be convex: then plans
    of a few iterations keep it. What moves has the priority `BODY` or `ZONE`, and gives its `speeds`.

    Examples
    --------
    A round table, of which the controller knows nothing but this:

    >>> import szlib
    >>> class Table(szlib.control.Obstacle):
    ...     kind = "table"
    ...     @staticmethod
    ...     def distance(x, y, t, px, py, radius):
    ...         return ((x - px) ** 2 + (y - py) ** 2) ** 0.5 - radius
    >>> zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    >>> controller = szlib.MPCCBF(zone, obstacles=[Table(0.0, 0.2, 0.6)])
    >>> step = controller.step((-2.0, 0.0, 0.3, 0.0), (3.0, 0.0))
    >>> float(step.h[0].round(3)), step.safe, step.obstacles[0].kind
    (0.86, True, 'table')
    """

    kind: ClassVar[str] = "obstacle"
    priority: ClassVar[Priority] = Priority.WALL
    has_barrier: ClassVar[bool] = (
        True  # False, of a body: h >= 0 is required, not the barrier condition
    )
    numbers: tuple[float, ...]

    def __init_subclass__(cls) -> None:
        if "kind" not in cls.__dict__:
            cls.kind = cls.__name__.lower()
        is_level = cls.priority < Priority.DECAY
        expected = "WALL, BODY or ZONE"
        check_argument(is_level, f"priority of {cls.kind}", cls.priority, expected)
        _KINDS[cls.kind] = cls

    def __init__(self, *numbers: float) -> None:
        n = len(numbers) or 1
        given = check_array(f"the numbers of a {self.kind}", numbers, (n,))
        self.numbers = tuple(given.tolist())

    def check(self) -> None:
        """Raise SolverError if `distance` cannot be computed for many places, or a wall moves."""
        try:
            with np.errstate(all="ignore"):
                places = np.array([(1, 1, -3, -3), (1, 1, 2, 2), (0.0, 1, 0, 1)])
                now, then = np.reshape(self.distance(*places, *self.numbers), (2, 2)).T
        except (TypeError, ValueError, NotImplementedError) as error:
            raise SolverError(
                f"{self}: `distance` must be a formula of x, y, t and {len(self.numbers)} numbers, by "
                f"operators only: {error!r}"
            ) from error
        stands = self.priority > Priority.WALL or np.array_equal(now, then, True)
        check_argument(
            stands, "priority of what moves", self, "BODY or ZONE: walls stand still"
        )

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        """Distance of (`x`, `y`) to the obstacle, `t` seconds from now [m]; operators only.

        Parameters
        ----------
        x, y : position, floats, arrays or symbols [m].
        t : time from now [s].
        numbers : of the obstacle.
        """
        raise NotImplementedError

    @classmethod
    def gap(cls, x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        """Euclidean distance to what the robot would touch [m]; by default, and for parameters, see
        `Obstacle.distance`.
        """
        return cls.distance(x, y, t, *numbers)

    @staticmethod
    def _travel(distance: Any, *numbers: Any) -> Any:
        """How far a robot at this `distance` must move at least to reach the obstacle [m]."""
        return distance

    @classmethod
    def bounds(cls, numbers: Array, offsets: Array) -> tuple[Array, Array]:
        """Boxes that hold all places nearer to obstacles than `offsets`: corners, shape (n, 2) each [m].

        By default everywhere: then a map of ways measures each cell, and ends 8 m from robot and goal. It
        takes each obstacle for solid, whatever its priority.

        Parameters
        ----------
        numbers : of the obstacles, shape (n, m).
        offsets : distances, shape (n,) [m].
        """
        everywhere = np.full((len(numbers), 2), inf)
        return -everywhere, everywhere

    def margin(self, settings: MPCSettings) -> float:
        """Margin that the robot keeps by its `settings` [m]: eps."""
        return settings.eps

    @classmethod
    def speeds(cls, numbers: Array) -> Array:
        """Speeds of obstacles of this kind with these `numbers`, shape (n, m) [m/s]; here 0."""
        return np.zeros(len(numbers))

    def __repr__(self) -> str:
        return f"{self.kind} ({', '.join(f'{number:.9g}' for number in self.numbers)})"


def _drift(t: Any, knots: Any) -> list[Any]:
    """Integrals of rates from 0 to `t`; `knots`: for each interval its end, and its rates."""
    found = [0.0] * (KNOT - 1)
    begin = 0.0
    for i in range(0, len(knots), KNOT):
        end, *rates = knots[i : i + KNOT]
        # time within the interval
        inside = (abs(t - begin) - abs(t - end) + end - begin) / 2
        found = [sum_ + rate * inside for sum_, rate in zip(found, rates, strict=True)]
        begin = end
    return found


class Zone(Obstacle):
    """The social zone of a person, in the world: an ellipse that moves with the person (paper, eq. 7).

    Parameters
    ----------
    numbers : the foci (xa, ya, xb, yb), the semi-major axis, and of the person's `Body` the position (x, y)
        and the velocity (vx, vy) [m, m/s]. With a `Prediction` there follow, for each interval of the
        horizon, its end, and the rates at which the person leaves the motion at constant velocity, and at
        which the zone grows [s, m/s, m/s, m/s].
    """

    kind = "person"
    priority = Priority.ZONE

    @staticmethod
    def place(
        zone: Ellipse, position: Point, heading: float, velocity: Point
    ) -> tuple[float, ...]:
        """The numbers of a `zone` of a person's frame around a person at this position.

        Parameters
        ----------
        zone : in the person's frame.
        position : (x, y) [m].
        heading : direction in which the person faces [rad].
        velocity : (vx, vy) [m/s].
        """
        (x, y), c, s = position, cos(heading), sin(heading)
        ma, na, mb, nb, a = zone.foci_and_axis
        xa = x + ma * c - na * s
        ya = y + ma * s + na * c
        return (
            xa,
            ya,
            x + mb * c - nb * s,
            y + mb * s + nb * c,
            a,
            x,
            y,
            *velocity,
        )

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        """See `Obstacle.distance`: approximate, from the sum of focal distances."""
        vx, vy, *knots = numbers[7:]
        dx, dy, growth = _drift(t, knots)
        return ellipse_formula(x - dx - t * vx, y - dy - t * vy, *numbers[:5]) - growth

    @staticmethod
    def gap(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        """Distance to the person's body; parameters as of `Obstacle.distance`."""
        return Body.distance(x, y, t, *numbers[5:])

    @staticmethod
    def speeds(numbers: Array) -> Array:
        """See `Obstacle.speeds`; `numbers` as there."""
        return Body.speeds(numbers[:, 5:])


class Body(Obstacle):
    """The body of a person, a disc of `BODY_RADIUS`.

    Its `numbers` are (x, y, vx, vy) [m, m/s], and end as those of a `Zone`.
    """

    kind = "body"
    priority = Priority.BODY
    has_barrier = False

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        """See `Obstacle.distance`: Euclidean."""
        px, py, vx, vy, *knots = numbers
        dx, dy, _ = _drift(t, knots)
        squared = (x - dx - px - t * vx) ** 2 + (y - dy - py - t * vy) ** 2
        return squared**0.5 - BODY_RADIUS

    def margin(self, settings: MPCSettings) -> float:
        """The gap that the robot keeps to bodies by its `settings` [m]."""
        return settings.body_gap

    @staticmethod
    def speeds(numbers: Array) -> Array:
        """See `Obstacle.speeds`; `numbers` as there."""
        rates = numbers[:, 4:].reshape(len(numbers), -1, KNOT)[..., 1:]
        fastest = np.abs(rates).sum(axis=2).max(axis=1, initial=0.0)
        return np.asarray(np.hypot(numbers[:, 2], numbers[:, 3]) + fastest)


class Wall(Obstacle):
    """A wall: a segment, whose `numbers` are its ends (xa, ya, xb, yb) [m].

    Its distance is Euclidean. Where `margin` of the settings is "required" or "paper", it is measured as a
    `PaperWall`.
    """

    kind = "wall"

    def margin(self, settings: MPCSettings) -> float:
        """Margin around this wall by the `settings` [m]: see `MPCSettings.margin`."""
        xa, ya, xb, yb = self.numbers
        if settings.margin != "required":
            return settings.eps
        return max(settings.eps, settings.r_robot**2 / hypot(xb - xa, yb - ya))

    @classmethod
    def bounds(cls, numbers: Array, offsets: Array) -> tuple[Array, Array]:
        """See `Obstacle.bounds`; `numbers` and `offsets` as there."""
        ends = numbers.reshape(-1, 2, 2)
        reach = offsets[:, None]
        return ends.min(axis=1) - reach, ends.max(axis=1) + reach

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        """See `Obstacle.distance`: Euclidean."""
        return euclidean_segment_formula(x, y, *numbers)


class PaperWall(Wall):
    """A `Wall` whose distance is that of the paper: it is no less than the Euclidean one (eq. 3-5).

    Beyond an end of a wall of length L it is s + s^2/L, with s how far a robot must move to the wall. So it
    changes by more than the robot moves, and without a margin of r_robot^2 / L the robot may overlap the end.

    Parameters
    ----------
    numbers : the ends (xa, ya, xb, yb) [m].
    """

    kind = "wall"

    @classmethod
    def bounds(cls, numbers: Array, offsets: Array) -> tuple[Array, Array]:
        """See `Obstacle.bounds`; `numbers` and `offsets` as there.

        A wall of length L is nearer than rho within sqrt(L^2/4 + L rho) of its middle, along the wall, and
        within sqrt(l rho - l^2/4) across, with l = min(L, 2 rho): no farther than rho and sqrt(L rho).
        """
        length, _, _ = _project(0.0, 0.0, *numbers.T)
        return super().bounds(numbers, np.minimum(offsets, np.sqrt(length * offsets)))

    @staticmethod
    def _travel(distance: Any, *numbers: Any) -> Any:
        """The s of d = s + s^2/L: it changes by no more than the robot moves (`differential_drive`)."""
        length, _, _ = _project(0.0, 0.0, *numbers)
        return length / 2 * ((1 + 4 * distance / length) ** 0.5 - 1)

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        """See `Obstacle.distance`: approximate beyond the ends."""
        return segment_formula(x, y, *numbers)

    @classmethod
    def gap(cls, x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        """Euclidean distance to the segment; parameters as of `Obstacle.distance`."""
        return euclidean_segment_formula(x, y, *numbers)


_KINDS[Wall.kind] = Wall  # in a file, a wall is one however it is measured


class HalfPlane(Obstacle):
    """A side on which the robot must not be: beyond the edge of a platform, or the line of a queue.

    Parameters
    ----------
    point : (x, y) on the edge [m].
    normal : (nx, ny), a direction from the edge to the side that is allowed.

    Raises
    ------
    SolverError : a number cannot be used, or the direction has no length.

    Examples
    --------
    >>> import szlib
    >>> from szlib.control import HalfPlane
    >>> edge = HalfPlane(point=(0.0, -1.0), normal=(0.0, 1.0))  # the rails lie below y = -1
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)), obstacles=[edge])
    >>> controller.step((0.0, 0.0, 0.0, -0.2), (5.0, 0.0)).h.round(2).tolist()
    [0.45]
    """

    kind = "half-plane"

    def __init__(self, point: ArrayLike, normal: ArrayLike) -> None:
        x, y = check_point("point", point)
        nx, ny = check_point("normal", normal)
        length = hypot(nx, ny)
        check_argument(length > 0, "normal", normal, "a direction")
        super().__init__(x, y, nx / length, ny / length)

    @staticmethod
    def distance(x: Any, y: Any, t: Any, *numbers: Any) -> Any:
        """See `Obstacle.distance`: Euclidean."""
        px, py, nx, ny = numbers
        return (x - px) * nx + (y - py) * ny


_PARTS = 16  # of a piece of a path that is cut


class Path(NamedTuple):
    """Where the robot goes: nearly straight from point to point.

    Attributes
    ----------
    points : shape (k+1, 2) [m].
    times : from now, shape (k+1,) [s].
    bows : by which it leaves a uniform motion between two points at most, shape (k,) [m].
    """

    points: Array
    times: Array
    bows: Array

    def cut(self) -> Path:
        """The same path, each piece cut into `_PARTS` of equal times."""
        n = len(self.bows)
        places = np.linspace(0.0, n, n * _PARTS + 1)
        x, y, t = (
            np.interp(places, np.arange(n + 1), each)
            for each in (*self.points.T, self.times)
        )
        return Path(np.column_stack([x, y]), t, np.repeat(self.bows, _PARTS))


class Bound(NamedTuple):
    """How near the robot comes to obstacles.

    Attributes
    ----------
    lower : lower bound of the gaps on the way [m].
    seen : the least of these gaps at points of the way [m].
    """

    lower: float = inf
    seen: float = inf

    @property
    def is_safe(self) -> bool:
        """Whether the robot touches none of them."""
        return bool(self.lower >= -TOLERANCE)


class Group(NamedTuple):
    """Obstacles of one kind, as a table.

    Attributes
    ----------
    kind : their class, derived from `Obstacle`.
    numbers : of each, shape (n, m).
    offsets : r_robot + margin of each, shape (n,) [m].
    """

    kind: Any
    numbers: Array
    offsets: Array


class Obstacles(NamedTuple):
    """Obstacles in an order, so that h of all of them is one computation for each kind.

    Attributes
    ----------
    groups : the obstacles: all of one kind, then all of another.
    r_robot : radius of the robot [m].

    Examples
    --------
    >>> import szlib
    >>> from szlib.control import HalfPlane, Obstacles
    >>> obstacles = Obstacles.of([HalfPlane((0.0, 0.0), (0.0, 1.0))], szlib.MPCSettings())
    >>> obstacles.h(0.0, 2.0).round(3).tolist()
    [1.45]
    """

    groups: tuple[Group, ...]
    r_robot: float

    @classmethod
    def of(cls, items: Iterable[Obstacle], settings: MPCSettings) -> Obstacles:
        """The obstacles `items` of a robot with these `settings`."""
        groups = []
        wall = Wall if settings.margin == "euclidean" else PaperWall
        as_measured: dict[Any, Any] = {Wall: wall, PaperWall: wall}
        for (kind, _), of_kind in groupby(
            items,
            lambda each: (as_measured.get(type(each), type(each)), len(each.numbers)),
        ):
            chosen = list(of_kind)
            numbers = np.array([each.numbers for each in chosen], float)
            offsets = [settings.r_robot + each.margin(settings) for each in chosen]
            groups.append(Group(kind, numbers, np.array(offsets)))
        return cls(tuple(groups), settings.r_robot)

    def joined(self, others: Obstacles) -> Obstacles:
        """These, and then the `others`."""
        return Obstacles(self.groups + others.groups, self.r_robot)

    def select_near(self, distances: NDArray[Any], multiple: int = 1) -> Obstacles:
        """Those at a distance <= 0, and the next nearest of each kind until their number is a `multiple`.

        Parameters
        ----------
        distances : of all, shape (n,) [m].
        multiple : of which the number of each kind is a multiple, or else that of all of this kind.
        """
        groups = []
        rest: Any = distances
        for kind, numbers, offsets in self.groups:
            own, rest = np.split(rest, [len(offsets)])
            n = -(-np.count_nonzero(own <= 0) // multiple) * multiple
            rows = np.sort(np.argsort(own)[:n])
            if n:
                groups.append(Group(kind, numbers[rows], offsets[rows]))
        return self._replace(groups=tuple(groups))

    @property
    def walls(self) -> Obstacles:
        """Those that belong to the building: the robot can always stop before them."""
        return self._replace(
            groups=tuple(g for g in self.groups if g.kind.priority == Priority.WALL)
        )

    @property
    def size(self) -> int:
        """Number of obstacles."""
        return sum(len(group.offsets) for group in self.groups)

    @property
    def speeds(self) -> Array:
        """The speed of each, shape (n,) [m/s]."""
        found = [g.kind.speeds(g.numbers) for g in self.groups]
        return np.concatenate([np.empty(0), *found])

    @property
    def items(self) -> tuple[Obstacle, ...]:
        """The obstacles one by one."""
        return tuple(
            rebuild(group.kind, numbers)
            for group in self.groups
            for numbers in group.numbers.tolist()
        )

    def h(self, x: Any, y: Any, t: Any = 0.0) -> Array:
        """h of each obstacle for a robot at (`x`, `y`), `t` seconds from now, shape (n, ...) [m].

        Parameters
        ----------
        x, y : position, numbers or arrays of one shape [m].
        t : time from now, a number or an array of this shape [s].
        """
        return self._collect("distance", x, y, t, is_barrier=True)

    def gaps(self, x: Any, y: Any, t: Any = 0.0) -> Array:
        """Euclidean gaps of the robot's disc, shape (n, ...) [m]; `x`, `y` and `t` as of `h`."""
        return self._collect("gap", x, y, t) - self.r_robot

    def bound(self, path: Path, *, is_barrier: bool = False) -> Bound:
        """Lower bound of the gaps on a path, and the least gap at its points but the first.

        Both are inf without obstacles.

        Parameters
        ----------
        path : of the robot.
        is_barrier : True: of h instead of the gap; not of walls, whose h may change faster than the robot
            moves.

        Notes
        -----
        Within a piece of the path no distance changes by more than the robot and the obstacle move, so it is
        nowhere less than half of the sum of both ends less that way. The robot leaves a uniform motion by at
        most the bow. Where this bound is negative, the pieces are cut (`Path.cut`), which raises it.
        """
        if not self.groups:
            return Bound()
        measure = self.h if is_barrier else self.gaps
        bound = self._bound_pieces(path, measure)
        if bound.is_safe:
            return bound
        return bound._replace(lower=self._bound_pieces(path.cut(), measure).lower)

    def _bound_pieces(self, path: Path, measure: Callable[..., Array]) -> Bound:
        """The `bound` of a path whose pieces are not cut; `measure` gives the gaps."""
        points = path.points
        times = path.times
        gaps = measure(*points.T, times)
        moved = self.speeds[:, None] * (times[1:] - times[:-1])
        reach = np.hypot(*(points[1:] - points[:-1]).T) + moved
        lower = (gaps[:, 1:] + gaps[:, :-1] - reach) / 2 - path.bows
        return Bound(lower.min(), gaps[:, 1:].min())

    def find_travel(self, x: Array, y: Array, t: Any, body_gap: float) -> Array:
        """How far a robot must move at least until it violates a floor of each obstacle, shape (n, k) [m].

        That is until h = 0, or until it is `body_gap` from the body of a person. An obstacle with the
        velocity w can be left out of a step of dt that begins where this is at least 2 (v + w) dt/gamma: then
        its rows hold whatever a robot does that is no faster than v. This is clear where h changes by no more
        than the robot moves. For a `PaperWall` of length L, d = F(s) = s + s^2/L, where s changes by no more
        than the robot moves. With S the same where h = 0,

            gamma h(x_k) = gamma (F(s) - F(S)) = gamma (s - S) (1 + (s + S)/L) >= v dt (1 + 2 s/L)
                         >= F(s) - F(s - v dt) >= h(x_k) - h(x_{k+1})

        A step of m dt keeps (1 - gamma)^m of h: the same with m dt and 1 - (1 - gamma)^m.

        Parameters
        ----------
        x, y : positions, shape (k,) [m].
        t : their times from now, shape (k,) [s].
        body_gap : gap that the robot keeps to bodies [m].
        """
        found = [np.empty((0, len(x)))]
        for kind, numbers, offsets in self.groups:
            table = numbers.T[..., None]
            own = kind._travel(kind.distance(x, y, t, *table), *table)
            own = own - kind._travel(offsets, *numbers.T)[:, None]
            if kind.priority > Priority.BODY:
                gaps = kind.gap(x, y, t, *table) - self.r_robot
                own = np.minimum(own, gaps - body_gap)
            found.append(own)
        return np.concatenate(found)

    def _collect(
        self, formula: str, x: Any, y: Any, t: Any, *, is_barrier: bool = False
    ) -> Array:
        """The `formula` of each obstacle, shape (n, ...); of a barrier less its offset."""
        shape = np.shape(x + y + t)
        axes = (...,) + (None,) * len(shape)
        found = [np.empty((0, *shape))]
        for kind, numbers, offsets in self.groups:
            values = getattr(kind, formula)(x, y, t, *numbers.T[axes])
            found.append(values - offsets[axes] if is_barrier else values)
        return np.concatenate(found)


def find_bodies(
    obstacles: Obstacles, settings: MPCSettings, *, as_predicted: bool = False
) -> Obstacles:
    """The bodies of the people whose zones are among `obstacles`, for a robot with these `settings`.

    At constant velocity, or `as_predicted`.
    """
    last = None if as_predicted else 9
    own = [g.numbers[:, 5:last] for g in obstacles.groups if g.kind is Zone]
    return Obstacles(
        tuple(
            Group(Body, each, np.full(len(each), settings.r_robot + settings.body_gap))
            for each in own
        ),
        settings.r_robot,
    )


def rebuild(kind: type[Obstacle], numbers: Sequence[float]) -> Obstacle:
    """An obstacle of this `kind` from its `numbers`, whatever arguments its class takes."""
    obstacle = kind.__new__(kind)
    obstacle.numbers = tuple(numbers)
    return obstacle


def number_kinds(obstacles: Iterable[Obstacle]) -> list[str]:
    """A name for each of the `obstacles`: its kind, and its number among those of this kind."""
    counts = Counter[str]()
    names = []
    for each in obstacles:
        names.append(f"{each.kind}_{counts[each.kind]}")
        counts[each.kind] += 1
    return names


def describe(obstacle: Obstacle) -> dict[str, Any]:
    """An `obstacle` as its kind and numbers, for a file; `restore` reads it."""
    return {"kind": obstacle.kind, "numbers": list(obstacle.numbers)}


def restore(content: dict[str, Any]) -> Obstacle:
    """The obstacle that `describe` wrote as `content`; SolverError if no class has its kind."""
    kind: Any = _KINDS.get(content["kind"])
    expected = (
        "that of a class of obstacles, which must be defined before the file is read"
    )
    check_argument(kind, "the kind of an obstacle", content["kind"], expected)
    return rebuild(kind, content["numbers"])

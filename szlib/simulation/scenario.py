"""A scene to drive through, and worlds: scenes that are drawn from a seed.

`Variations` are small changes of one scene, `Worlds` are random people and walls.  World frame, metres and
seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import cos, dist, pi, sin
from typing import Any

import numpy as np

from ..control import MPCSettings, Obstacle, Obstacles, Person, Wall, Zone
from ..control.obstacles import euclidean_segment_formula
from ..control.walls import read_walls
from ..core.checks import Array, check_array, require
from ..core.errors import SolverError
from ..zones.ellipses import BODY_RADIUS, Ellipse

GOAL_RADIUS = 0.1  # the robot has arrived within this distance of the goal [m], when it has stopped (assumed)
# Below this speed the robot stands; below this progress to the goal it yields [m/s] (assumed).
STOPPED_SPEED = 0.05
_ROBOT = MPCSettings()  # settings of the robot that must have space
_TRIES = 5_000  # draws after which the search for a world ends; a usual world takes fewer than a hundred
# Fractions of a person's path at which it is checked against walls.
_FRACTIONS = np.linspace(0, 1, 31)[:, None]


@dataclass(frozen=True)
class Claim:
    """A claim of the paper about a scenario, and its check.

    Parameters
    ----------
    text : the claim.
    check : function of a `Run` of the scenario; returns whether the claim holds, and the number that decides.
    """

    text: str
    check: Callable[[Any], tuple[bool, float]]


@dataclass(frozen=True)
class Scenario:
    """A scene: the robot's start and goal, people, walls, and other obstacles.

    Parameters
    ----------
    name : short name.
    start : (x, y, vx, vy) of the robot [m, m/s].
    goal : (x, y) [m].
    people : all people, at time 0.
    walls : segments, shape (n, 2, 2) [m]; or anything else that `read_walls` accepts. The attribute holds
        segments: pieces of a straight wall are joined, and the inside of a polygon is not solid.
    claims : what the paper claims of it.
    title : title of its figures.
    duration : time limit of a run [s].
    obstacles : what else stands still, such as a `HalfPlane`.

    Raises
    ------
    SolverError : a number is not finite, a shape is wrong, or a wall has no length.

    Examples
    --------
    >>> import szlib
    >>> walls = [((-5.0, 2.0), (5.0, 2.0))]
    >>> person = szlib.Person((3.0, 0.0), velocity=(-0.5, 0.0))
    >>> szlib.Scenario("hall", (-4, 0, 0, 0), (4, 0), (person,), walls).walls.shape
    (1, 2, 2)
    """

    name: str
    start: Array
    goal: Array
    people: tuple[Person, ...] = ()
    walls: Array = field(default_factory=lambda: np.zeros((0, 2, 2)))
    claims: tuple[Claim, ...] = ()
    title: str = ""
    duration: float = 60.0
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        arrays = {
            "start": check_array("start", self.start, (4,)),
            "goal": check_array("goal", self.goal, (2,)),
            "walls": read_walls(self.walls),
        }
        for name, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "people", tuple(self.people))
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        value = self.duration
        require(0 < value < np.inf, "duration", value, "finite, above 0", SolverError)

    @property
    def fixed(self) -> tuple[Obstacle, ...]:
        """Everything that stands still: the walls, then the other obstacles."""
        walls = (Wall(*ends) for ends in self.walls.reshape(-1, 4).tolist())
        return (*walls, *self.obstacles)

    def turn_people(self) -> Scenario:
        """The same scene with all people facing the other way; people who walk then walk backwards."""
        people = tuple(
            p if p.heading is None else replace(p, heading=p.heading + pi)
            for p in self.people
        )
        return replace(self, people=people)


@dataclass(frozen=True)
class Variations:
    """Random variations of one scenario, one for each seed: worlds for `rollouts`.

    People lose their prediction: it is of another start and speed.

    Parameters
    ----------
    scenario : the scenario.
    zone : zone of all people; None: their own, or the controller's.
    shift : people and the robot start up to this distance to either side, in x and y [m].
    pace : smallest and largest factor of each person's speed.

    All defaults are assumed.
    """

    scenario: Scenario
    zone: Ellipse | None = None
    shift: float = 0.2
    pace: tuple[float, float] = (0.8, 1.2)

    def __call__(self, seed: int) -> Scenario:
        """The variation of a `seed`."""
        rng = np.random.default_rng(seed)
        start = self.scenario.start.copy()
        start[:2] += rng.uniform(-self.shift, self.shift, 2)
        people = []
        for person in self.scenario.people:
            shift = rng.uniform(-self.shift, self.shift, 2)
            velocity = np.multiply(rng.uniform(*self.pace), person.velocity)
            people.append(
                replace(
                    person,
                    position=np.add(person.position, shift).tolist(),
                    velocity=velocity.tolist(),
                    zone=self.zone or person.zone,
                    prediction=None,
                )
            )
        return replace(self.scenario, start=start, people=tuple(people))


@dataclass(frozen=True)
class Worlds:
    """What random worlds contain.  Called with a seed, it draws a world: `worlds(seed)`.

    Values are drawn uniformly from their ranges.  A world without space for the robot, or with another
    distance to the goal, is drawn again, so that worlds with walls or many people are fewer than drawn.  All
    defaults are assumed.

    Parameters
    ----------
    people : smallest and largest number of people.
    standing : fraction of people who stand.
    pace : smallest and largest walking speed [m/s]; the paper's people walk at 0.5 m/s.
    walls : probability that a draw has walls; by default some 44 % of the worlds have some.
    max_walls : largest number of walls in a world with walls.
    wall_length : smallest and largest length of a wall [m].
    size : side of the square in which start, goal, people and midpoints of walls lie [m].
    travel : smallest and largest distance to the goal [m].
    start_speed : largest speed at the start, in any direction [m/s].
    min_h : smallest h of every person and wall at the start, and where full braking ends [m].
    duration : time limit of the robot [s].
    zone : zone of all people, for instance a fitted one; None: one drawn for each world (`draw_zone`).

    Raises
    ------
    SolverError : a range is empty or a fraction is not in [0, 1].

    Examples
    --------
    >>> import szlib
    >>> worlds = szlib.Worlds(people=(2, 2), walls=0.0)
    >>> scenario = worlds(seed=0)
    >>> len(scenario.people), len(scenario.walls)
    (2, 0)
    """

    people: tuple[int, int] = (1, 5)
    standing: float = 0.5
    pace: tuple[float, float] = (0.1, 0.5)
    walls: float = 0.5
    max_walls: int = 4
    wall_length: tuple[float, float] = (1.0, 6.0)
    size: float = 10.0
    travel: tuple[float, float] = (3.0, 8.0)
    start_speed: float = 1.0
    min_h: float = 0.0
    duration: float = 15.0
    zone: Ellipse | None = None

    def __post_init__(self) -> None:
        for name in ("people", "pace", "wall_length", "travel"):
            low, high = value = getattr(self, name)
            is_range = 0 <= low <= high < np.inf
            require(is_range, name, value, "a range 0 <= low <= high", SolverError)
        for name in ("standing", "walls"):
            value = getattr(self, name)
            require(0 <= value <= 1, name, value, "a fraction in [0, 1]", SolverError)
        for name in ("max_walls", "size", "duration"):
            value = getattr(self, name)
            require(0 < value < np.inf, name, value, "positive", SolverError)

    def __call__(self, seed: int) -> Scenario:
        """The world of a `seed`: the same one each time, whatever controller drives in it.

        Start and goal are clear of walls, by the distance that a robot of the default radius needs.  The goal
        is clear of people who stand.  People keep clear of walls and, at the start, of each other's bodies.
        Paths are checked at 31 places: walkers cross no wall, unless they walk farther than 15 m.  All people
        have one zone: `zone`, or one drawn by `draw_zone`.

        Raises
        ------
        SolverError : no world fits in many draws; ask for fewer people or more space.
        """
        rng = np.random.default_rng(seed)
        shortest, longest = self.travel
        for _ in range(_TRIES):
            drawn = draw_zone(
                rng
            )  # in any case: the rest of the world does not depend on it
            zone = self.zone or drawn
            walls = _draw_walls(rng, self)
            people = _draw_people(rng, self, walls, zone)
            start, goal = rng.uniform(-self.size / 2, self.size / 2, (2, 2))
            speed = self.start_speed * rng.uniform()
            heading = rng.uniform(-pi, pi)
            if not shortest <= np.hypot(*(goal - start)) <= longest:
                continue
            world = Scenario(
                name=f"world {seed}",
                title=f"World {seed}",
                start=np.array([*start, speed * cos(heading), speed * sin(heading)]),
                goal=goal,
                people=tuple(people),
                walls=walls,
                duration=self.duration,
            )
            if self._has_space(world, zone):
                return world
        raise SolverError(
            f"no world of seed {seed} fits {self} in {_TRIES} draws; ask for fewer people or a larger size"
        )

    def _has_space(self, world: Scenario, zone: Ellipse) -> bool:
        """True if h >= `min_h` at the start, where full braking ends, and at the goal."""
        zones = [
            Zone(*Zone.place(zone, p.position, p.heading or 0.0, p.velocity))
            for p in world.people
        ]
        margins = [_ROBOT.eps, *(each.margin(_ROBOT) for each in world.fixed)]
        robot = replace(_ROBOT, eps=max(margins), margin="paper")
        start, velocity = np.split(world.start, 2)
        stop = start + velocity * np.hypot(*velocity) / (2 * _ROBOT.a_max)
        places = np.array([start, stop, world.goal])
        h = Obstacles.of([*zones, *world.fixed], robot).h(*places.T)
        walks = [not person.stands for person in world.people]
        h[: len(zones)][walks, 2] = np.inf  # they leave the goal
        return bool(h.min(initial=np.inf) >= self.min_h)


ONE_PERSON = Worlds(people=(1, 1), walls=0.0, start_speed=0.0, min_h=0.3)
"""One person in open space and a robot that starts at rest: the simplest worlds."""


def draw_zone(rng: np.random.Generator) -> Ellipse:
    """A random zone from `rng`, similar to fitted ones (1.0 m x 0.75 m), with any tilt, off centre."""
    a = rng.uniform(0.7, 1.2)
    center = (rng.uniform(-0.1, 0.2), rng.uniform(-0.1, 0.1))
    return Ellipse(center, (a, a * rng.uniform(0.6, 1.0)), rng.uniform(-pi / 2, pi / 2))


def _draw_walls(rng: np.random.Generator, w: Worlds) -> Array:
    count = (
        rng.integers(1, w.max_walls, endpoint=True) if rng.uniform() < w.walls else 0
    )
    middle = rng.uniform(-w.size / 2, w.size / 2, (count, 2))
    angle = rng.uniform(0, pi, count)
    half = rng.uniform(*w.wall_length, count) / 2
    along = half[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.stack([middle - along, middle + along], axis=1)


def _draw_people(
    rng: np.random.Generator, w: Worlds, walls: Array, zone: Ellipse
) -> list[Person]:
    """People one by one, clear of the walls and of each other; fewer where there is no space."""
    people: list[Person] = []
    times = w.duration * _FRACTIONS
    ends = walls.reshape(-1, 4).T
    for _ in range(rng.integers(*w.people, endpoint=True)):
        for _ in range(100):
            x, y = rng.uniform(-w.size / 2, w.size / 2, 2).tolist()
            heading = rng.uniform(-pi, pi)
            pace = 0.0 if rng.uniform() < w.standing else rng.uniform(*w.pace)
            vx = pace * cos(heading)
            vy = pace * sin(heading)
            if any(dist((x, y), other.position) < 2 * BODY_RADIUS for other in people):
                continue
            path = x + vx * times, y + vy * times
            if (euclidean_segment_formula(*path, *ends) >= BODY_RADIUS).all():
                people.append(Person((x, y), (vx, vy), heading, zone))
                break
    return people

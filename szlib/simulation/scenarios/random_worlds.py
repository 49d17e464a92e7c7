"""Random worlds: scenarios with people who stand or walk, and walls, each drawn from a seed.

World frame, metres and seconds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, dist, pi, sin

import numpy as np

from ...control.obstacles import Obstacles, Wall, Zone, euclidean_segment_formula
from ...control.people import Person
from ...control.settings import MPCSettings
from ...control.verification import required_margin
from ...core.checks import Array, require
from ...core.errors import SolverError
from ...zones.ellipses import BODY_RADIUS, Ellipse
from ..scenario import Scenario

_ROBOT = MPCSettings()  # settings of the robot that must have space
_TRIES = 5_000  # draws after which the search for a world ends; a usual world takes fewer than a hundred
# Fractions of a person's path at which it is checked against walls.
_FRACTIONS = np.linspace(0, 1, 31)[:, None]


@dataclass(frozen=True)
class Worlds:
    """What random worlds contain.  Called with a seed, it draws a world: `worlds(seed)`.

    Values are drawn uniformly from their ranges.  All defaults are assumed.

    Parameters
    ----------
    people : smallest and largest number of people.
    standing : fraction of people who stand.
    pace : smallest and largest walking speed [m/s]; the paper's people walk at 0.5 m/s.
    walls : fraction of worlds with walls.
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
            low, high = getattr(self, name)
            require(
                0 <= low <= high < np.inf,
                name,
                (low, high),
                "a range 0 <= low <= high",
                SolverError,
            )
        for name, value in (("standing", self.standing), ("walls", self.walls)):
            require(0 <= value <= 1, name, value, "a fraction in [0, 1]", SolverError)
        for name in ("max_walls", "size", "duration"):
            require(
                0 < getattr(self, name) < np.inf,
                name,
                getattr(self, name),
                "positive",
                SolverError,
            )

    def __call__(self, seed: int) -> Scenario:
        """The world of a `seed`: the same one each time, whatever controller drives in it.

        Start and goal are clear of walls, by the distance that a robot of the default radius needs.  The goal
        is clear of people who stand.  People keep clear of walls and, at the start, of each other's bodies;
        walkers never cross a wall.  All people have one zone: `zone`, or one drawn by `draw_zone`.

        Raises
        ------
        SolverError : no world fits in many draws; ask for fewer people or more space.
        """
        rng = np.random.default_rng(seed)
        for _ in range(_TRIES):
            # in any case: the rest of the world does not depend on it
            drawn = draw_zone(rng)
            zone, walls = self.zone or drawn, _draw_walls(rng, self)
            people = _draw_people(rng, self, walls, zone)
            x, goal = rng.uniform(-self.size / 2, self.size / 2, (2, 2))
            speed, heading = self.start_speed * rng.uniform(), rng.uniform(-pi, pi)
            velocity = speed * np.array([cos(heading), sin(heading)])
            if not self.travel[0] <= np.hypot(*(goal - x)) <= self.travel[1]:
                continue
            eps = max(
                [_ROBOT.eps, *(required_margin(wall, _ROBOT.r_robot) for wall in walls)]
            )
            placed = [_place(person, zone) for person in people]
            standing = [
                each
                for each, person in zip(placed, people, strict=True)
                if person.stands
            ]
            stop = x + velocity * speed / (2 * _ROBOT.a_max)
            points = ((x, placed), (stop, placed), (goal, standing))
            if all(
                _min_h(point, zones, walls, eps) >= self.min_h
                for point, zones in points
            ):
                return Scenario(
                    name=f"world {seed}",
                    title=f"World {seed}",
                    start=np.concatenate([x, velocity]),
                    goal=goal,
                    people=tuple(people),
                    walls=walls,
                    duration=self.duration,
                )
        raise SolverError(
            f"no world of seed {seed} fits {self} in {_TRIES} draws; ask for fewer people or a larger size"
        )


ONE_PERSON = Worlds(people=(1, 1), walls=0.0, start_speed=0.0, min_h=0.3)
"""One person in open space and a robot that starts at rest: the simplest worlds."""


def draw_zone(rng: np.random.Generator) -> Ellipse:
    """A random zone from `rng`, similar to fitted ones (1.0 m x 0.75 m), with any tilt, off centre."""
    a = rng.uniform(0.7, 1.2)
    center = (rng.uniform(-0.1, 0.2), rng.uniform(-0.1, 0.1))
    return Ellipse(center, (a, a * rng.uniform(0.6, 1.0)), rng.uniform(-pi / 2, pi / 2))


def _draw_walls(rng: np.random.Generator, w: Worlds) -> Array:
    count = (
        int(rng.integers(1, w.max_walls, endpoint=True))
        if rng.uniform() < w.walls
        else 0
    )
    middle = rng.uniform(-w.size / 2, w.size / 2, (count, 2))
    angle, half = rng.uniform(0, pi, count), rng.uniform(*w.wall_length, count) / 2
    along = half[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.stack([middle - along, middle + along], axis=1)


def _draw_people(
    rng: np.random.Generator, w: Worlds, walls: Array, zone: Ellipse
) -> list[Person]:
    """People one by one, clear of the walls and of each other; fewer where there is no space."""
    people: list[Person] = []
    times, ends = w.duration * _FRACTIONS, walls.reshape(-1, 4).T
    for _ in range(int(rng.integers(*w.people, endpoint=True))):
        for _ in range(100):
            x, y = rng.uniform(-w.size / 2, w.size / 2, 2).tolist()
            heading = rng.uniform(-pi, pi)
            pace = 0.0 if rng.uniform() < w.standing else rng.uniform(*w.pace)
            vx, vy = pace * cos(heading), pace * sin(heading)
            if any(dist((x, y), other.position) < 2 * BODY_RADIUS for other in people):
                continue
            path = x + vx * times, y + vy * times
            if (
                not len(walls)
                or (euclidean_segment_formula(*path, *ends) >= BODY_RADIUS).all()
            ):
                people.append(Person((x, y), (vx, vy), heading, zone))
                break
    return people


def _place(person: Person, zone: Ellipse) -> Zone:
    """The zone of a person in the world."""
    return Zone(
        *Zone.place(zone, person.position, person.heading or 0.0, person.velocity)
    )


def _min_h(point: Array, zones: list[Zone], walls: Array, eps: float) -> float:
    """Smallest h of the people and walls at a point, with the margin `eps` around all [m]."""
    items = [*zones, *(Wall(*ends) for ends in walls.reshape(-1, 4).tolist())]
    with_eps = replace(_ROBOT, eps=eps, margin="paper")
    return float(Obstacles.of(items, with_eps).h(*point).min(initial=np.inf))

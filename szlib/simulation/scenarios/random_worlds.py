"""Random worlds: people who stand or walk, walls, a robot with somewhere to go - each from its seed.

A world is a `Scenario` like the paper's four. World frame, metres and seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, dist, pi, sin

import numpy as np

from ...checks import Array
from ...control.barriers import barrier, euclidean_segment_formula, segment_formula
from ...control.distances import required_margin
from ...control.person import BODY_RADIUS, Person, PlacedZone, place_zone
from ...control.settings import MPCSettings
from ...errors import SolverError
from ...zones.ellipses import Ellipse
from ..scenario import Scenario

_DRIVER = MPCSettings()
"""Of the robot for which there has to be room."""
_TRIES = 5_000
"""Draws after which a world is given up as impossible; a usual one takes fewer than a hundred."""
_ALONG = np.linspace(0, 1, 31)[:, None]
"""Where a person's path is held clear of walls, from its start to its end."""


@dataclass(frozen=True)
class Worlds:
    """What a random world may hold; every range is drawn from uniformly (all of them assumed).

    Parameters
    ----------
    people : least and greatest number of people.
    standing : share of people who stand.
    pace : slowest and fastest walk [m/s]; the paper's people walk at 0.5 m/s.
    walls : share of worlds that have walls.
    max_walls : greatest number of walls in such a world.
    wall_length : shortest and longest wall [m].
    size : start, goal, people and walls' midpoints lie in a square of this side [m].
    travel : nearest and farthest goal [m].
    start_speed : fastest start, in any direction [m/s].
    min_h : least h of every person and wall at the start, and where full braking would end [m].
    duration : time that the robot has [s].
    zone : everybody's, such as one that was learned; None draws one for each world (`draw_zone`).

    Raises
    ------
    SolverError : a range is empty or a share is not in [0, 1].
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
            if not 0 <= low <= high < np.inf:
                raise SolverError(f"{name} must be a range 0 <= low <= high; got {(low, high)}")
        for name in ("standing", "walls"):
            if not 0 <= getattr(self, name) <= 1:
                raise SolverError(f"{name} must be a share in [0, 1]; got {getattr(self, name)}")
        for name in ("max_walls", "size", "duration"):
            if not 0 < getattr(self, name) < np.inf:
                raise SolverError(f"{name} must be positive; got {getattr(self, name)}")

    def __call__(self, seed: int) -> Scenario:
        """The world of this seed; see `world`."""
        return make_world(seed, self)


ONE_PERSON = Worlds(people=(1, 1), walls=0.0, start_speed=0.0, min_h=0.3)
"""One person in open space, a robot that starts at rest: here a controller has no excuse."""


def make_world(seed: int, worlds: Worlds | None = None) -> Scenario:
    """The world of this seed: the same one every time, whatever controller is to drive in it.

    Start and goal are clear of walls by what a robot of the default radius requires, the goal also
    of people who stand. People keep off walls and off each other's bodies at the start, and walkers
    never cross a wall. Each person has the zone of the world: `worlds.zone`, or one by `draw_zone`.

    Raises
    ------
    SolverError : nothing that fits was found in many tries; ask for fewer people or more space.
    """
    w, rng = worlds or Worlds(), np.random.default_rng(seed)
    for _ in range(_TRIES):
        drawn = draw_zone(rng)  # drawn in any case: the rest of the world does not depend on it
        zone, walls = w.zone or drawn, _walls(rng, w)
        people = _people(rng, w, walls, zone)
        x, goal = rng.uniform(-w.size / 2, w.size / 2, (2, 2))
        speed, heading = w.start_speed * rng.uniform(), rng.uniform(-pi, pi)
        velocity = speed * np.array([cos(heading), sin(heading)])
        if not w.travel[0] <= np.hypot(*(goal - x)) <= w.travel[1]:
            continue
        eps = max([_DRIVER.eps, *(required_margin(wall, _DRIVER.r_robot) for wall in walls)])
        everybody = [place_zone(person, zone) for person in people]
        standing = [where for where, person in zip(everybody, people, strict=True) if person.stands]
        stop = x + velocity * speed / (2 * _DRIVER.a_max)
        held = ((x, everybody), (stop, everybody), (goal, standing))
        if all(_h(point, zones, walls, eps) >= w.min_h for point, zones in held):
            return Scenario(
                name=f"world {seed}",
                title=f"World {seed}",
                start=np.concatenate([x, velocity]),
                goal=goal,
                people=tuple(people),
                walls=walls,
                duration=w.duration,
            )
    raise SolverError(
        f"no world of seed {seed} fits {w} in {_TRIES} tries; ask for fewer people or a larger size"
    )


def draw_zone(rng: np.random.Generator) -> Ellipse:
    """A zone of the fitted family: like those learned (1.0 m x 0.75 m), of any tilt, off centre."""
    a = rng.uniform(0.7, 1.2)
    center = (rng.uniform(-0.1, 0.2), rng.uniform(-0.1, 0.1))
    return Ellipse(center, (a, a * rng.uniform(0.6, 1.0)), rng.uniform(-pi / 2, pi / 2))


def _walls(rng: np.random.Generator, w: Worlds) -> Array:
    count = int(rng.integers(1, w.max_walls, endpoint=True)) if rng.uniform() < w.walls else 0
    middle = rng.uniform(-w.size / 2, w.size / 2, (count, 2))
    angle, half = rng.uniform(0, pi, count), rng.uniform(*w.wall_length, count) / 2
    along = half[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.stack([middle - along, middle + along], axis=1)


def _people(rng: np.random.Generator, w: Worlds, walls: Array, zone: Ellipse) -> list[Person]:
    """People one by one, each off the walls and off those before; fewer where there is no room."""
    people: list[Person] = []
    times, ends = w.duration * _ALONG, walls.reshape(-1, 4).T
    for _ in range(int(rng.integers(*w.people, endpoint=True))):
        for _ in range(100):
            x, y = rng.uniform(-w.size / 2, w.size / 2, 2).tolist()
            heading = rng.uniform(-pi, pi)
            pace = 0.0 if rng.uniform() < w.standing else rng.uniform(*w.pace)
            vx, vy = pace * cos(heading), pace * sin(heading)
            if any(dist((x, y), other.position) < 2 * BODY_RADIUS for other in people):
                continue
            path = x + vx * times, y + vy * times
            if not len(walls) or (euclidean_segment_formula(*path, *ends) >= BODY_RADIUS).all():
                people.append(Person((x, y), (vx, vy), heading, zone))
                break
    return people


def _h(point: Array, zones: list[PlacedZone], walls: Array, eps: float) -> float:
    """Smallest h of anybody or any wall [m]."""
    x, y = point.tolist()
    distances = [zone.distance(x, y) for zone in zones]
    distances += [segment_formula(x, y, *ends) for ends in walls.reshape(-1, 4).tolist()]
    return float(barrier(min(distances, default=np.inf), _DRIVER.r_robot, eps))

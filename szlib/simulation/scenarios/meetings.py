"""Eleven meetings of a robot and people after Francis et al. (2025), and small variations of each.

The source names and draws them.  Coordinates, speeds and walls are assumed: people walk at about 0.5 m/s
(sec. 4 of the paper) and do not react; without people the robot drives straight from start to goal; two who
pass have just enough space for a zone of 1.0 x 0.7 m.

>>> import szlib
>>> len(szlib.MEETINGS), szlib.MEETINGS["overtaking"].title
(11, 'A person walks ahead, at 0.3 m/s')

Source: A. Francis et al., "Principles and guidelines for evaluating social robot navigation algorithms", ACM
Transactions on Human-Robot Interaction 14(2), 2025, fig. 7.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin

import numpy as np
import shapely

from ...control.people import Person
from ...core.checks import Array
from ...zones.ellipses import Ellipse
from ..scenario import UNAFFECTED, Crowd, Scenario

WALKING_SPEED = 0.5  # speed of people who walk [m/s] (paper, sec. 4)
_START, _GOAL = (-5.0, 0.0, 0.0, 0.0), (5.0, 0.0)

Place = tuple[float, float]


def _walker(at: Place, to: Place, speed: float = WALKING_SPEED) -> Person:
    """A person who walks from one place towards another."""
    offset = np.subtract(to, at)
    vx, vy = (speed * offset / np.hypot(*offset)).tolist()
    return Person(at, (vx, vy))


def _standing_person(at: Place, facing: Place) -> Person:
    return Person(at, heading=float(np.arctan2(facing[1] - at[1], facing[0] - at[0])))


def _hall(half_width: float) -> list[tuple[Place, Place]]:
    return [((-8.0, y), (8.0, y)) for y in (half_width, -half_width)]


def _corner(x: float, y: float, right: float, up: float) -> list[tuple[Place, Place]]:
    """The two walls of a corner at (x, y); they lead right (or left: -1) and up (or down: -1)."""
    return [((x, y), (right * 8.0, y)), ((x, y), (x, up * 6.0))]


def _circle(n: int, radius: float) -> list[Place]:
    """Places on a circle, one straight ahead."""
    angles = [2 * pi * k / n for k in range(n)]
    return [(radius * cos(angle), radius * sin(angle)) for angle in angles]


def _crossing_walker(at: Place, distance: float = 0.7) -> Person:
    """A person who crosses a circle and passes its centre on the right."""
    x, y = at
    shift = distance / np.hypot(x, y)
    return _walker(at, (y * shift, -x * shift), 0.8)


_DOOR = [((0.0, y), (0.0, 6 * y)) for y in (0.9, -0.9)]

_MEETINGS: dict[str, tuple[str, Sequence[Person], Sequence[tuple[Place, Place]]]] = {
    "frontal approach": (
        "A person comes straight towards the robot",
        [_walker((5.0, 0.0), (-5.0, 0.0))],
        [],
    ),
    "pedestrian obstruction": (
        "A person stands in the way",
        [_standing_person((0.0, 0.0), (-1.0, 0.0))],
        _hall(2.5),
    ),
    "narrow hallway": (
        "A person comes along a hallway 3.2 m wide, on their right",
        [_walker((6.0, 0.7), (-6.0, 0.7))],
        _hall(1.6),
    ),
    "narrow doorway": (
        "A person comes through a door 1.8 m wide",
        [_walker((2.5, 0.0), (-5.0, 0.0))],
        _DOOR,
    ),
    "overtaking": (
        "A person walks ahead, at 0.3 m/s",
        [_walker((-2.5, 0.0), (5.0, 0.0), 0.3)],
        [],
    ),
    "intersection": (
        "A person crosses where two halls meet",
        [_walker((0.0, -3.0), (0.0, 5.0))],
        [
            wall
            for x in (-2, 2)
            for y in (-2, 2)
            for wall in _corner(x, y, x / 2, y / 2)
        ],
    ),
    "blind corner": (
        "A person comes from behind a corner",
        [_walker((1.0, 3.6), (1.0, -5.0), 0.7)],
        _corner(0.0, 1.3, -1, 1) + _corner(0.0, -1.3, -1, -1),
    ),
    "parallel traffic": (
        "People walk on both sides, one way and the other",
        [
            *(_walker((x, 1.7), (-9.0, 1.7)) for x in (0.5, 3.5)),
            *(_walker((x, -1.7), (9.0, -1.7)) for x in (-3.5, -0.5)),
        ],
        [],
    ),
    "perpendicular traffic": (
        "People cross the way, from both sides",
        [
            _walker((-1.5, -2.5), (-1.5, 9.0)),
            _walker((0.5, 3.5), (0.5, -9.0)),
            _walker((2.5, -4.0), (2.5, 9.0)),
        ],
        [],
    ),
    "circular crossing": (
        "All people cross a circle, past its centre",
        [_crossing_walker(at) for at in _circle(6, 4.5) if at[0] > -4.0],
        [],
    ),
    "robot crowding": (
        "People stand around the robot",
        [_standing_person(at, (0.0, 0.0)) for at in _circle(5, 2.6)],
        [],
    ),
}

MEETINGS: dict[str, Scenario] = {
    name: Scenario(
        name=name,
        title=title,
        start=np.array((0.0, 0.0, 0.0, 0.0) if name == "robot crowding" else _START),
        goal=np.array(_GOAL),
        people=tuple(people),
        walls=np.reshape(np.array(walls, float), (-1, 2, 2)),
        duration=40.0,
    )
    for name, (title, people, walls) in _MEETINGS.items()
}
"""The eleven meetings, by name."""


@dataclass(frozen=True)
class Variations:
    """Random variations of one scenario, one for each seed: worlds for `rollouts`.

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
        people = tuple(self._vary(person, rng) for person in self.scenario.people)
        return replace(self.scenario, start=start, people=people)

    def _vary(self, person: Person, rng: np.random.Generator) -> Person:
        (x, y), (dx, dy) = (
            person.position,
            rng.uniform(-self.shift, self.shift, 2).tolist(),
        )
        factor = rng.uniform(*self.pace)
        velocity = (factor * person.velocity[0], factor * person.velocity[1])
        zone = person.zone if self.zone is None else self.zone
        return replace(person, position=(x + dx, y + dy), velocity=velocity, zone=zone)


class VisiblePeople:
    """A `CrowdModel` of people who walk on, unaffected; the controller sees those whom no wall hides."""

    def start(self, scenario: Scenario, seed: int) -> Crowd:
        """The true motion of the people of a `scenario`, whatever the `seed`."""
        crowd = UNAFFECTED.start(scenario, seed)
        self._walls = scenario.walls

        def crowd_and_robot(t: float, robot: Array) -> Sequence[Person | None]:
            """The people; the position of the robot is remembered for `observe`."""
            self._robot = robot[:2]
            return crowd(t, robot)

        return crowd_and_robot

    def observe(
        self, people: tuple[Person, ...], rng: np.random.Generator
    ) -> tuple[Person | None, ...]:
        """The `people`, with None for those whom a wall hides; nothing is drawn from `rng`."""
        return tuple(
            p if is_visible(self._robot, p.position, self._walls) else None
            for p in people
        )

    def __reduce__(self) -> tuple[type[VisiblePeople], tuple[()]]:
        """A copy remembers nothing of a run."""
        return VisiblePeople, ()


def is_visible(a: Array, b: Place, walls: Array) -> bool:
    """True if the line from `a` to `b` crosses no wall of `walls`, shape (n, 2, 2)."""
    sight = shapely.LineString([a, b])
    return not shapely.crosses(sight, shapely.linestrings(walls)).any()

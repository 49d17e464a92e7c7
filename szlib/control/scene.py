"""What a step is asked: the robot, its goal, people and walls, as the controller took them."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf
from typing import Any, Literal, NamedTuple

import numpy as np
import shapely

from ..checks import Array
from ..zones.ellipses import BODY_RADIUS, Ellipse
from .barriers import compute_h, euclidean_segment_formula
from .crowding import Level, find_level, list_barriers
from .person import Person, PlacedZone
from .settings import MPCSettings, Terminal
from .tracker import TrackedPeople

_INSTANT = 1e-3  # share of a step over which the slope of a distance is taken


class Scene(NamedTuple):
    """What a step is asked [m, m/s].

    Attributes
    ----------
    state : (x, y, vx, vy) of the robot.
    goal : (x, y).
    tracked : people to be respected, as the tracker knows them.
    person_zones : the zone of each person, in their own frame.
    zones : the same zones in the world.
    walls : end points and margin of each wall, (xa, ya, xb, yb, margin).
    settings : parameters of the controller.
    solids : areas that walls enclose, of Shapely; None: there are none.
    near : numbers of the walls that can matter to this step; None: all. Of many walls those out of reach are
        left out (`barriers.find_near_walls`), and what a step says of them is inf.
    """

    state: tuple[float, ...]
    goal: tuple[float, float]
    tracked: TrackedPeople
    person_zones: Sequence[Ellipse]
    zones: Sequence[PlacedZone]
    walls: Sequence[Sequence[float]]
    settings: MPCSettings
    solids: Any = None
    near: Sequence[int] | None = None

    @property
    def people(self) -> tuple[Person, ...]:
        """Everybody to be respected, in the order of `Step.h`."""
        return self.tracked.people

    @property
    def terminal(self) -> Terminal:
        """What the plan ends in: `MPCSettings.terminal`; "rest" in place of "person" without one person."""
        terminal = self.settings.terminal
        return "rest" if terminal == "person" and len(self.people) != 1 else terminal

    @property
    def goal_blocked(self) -> bool:
        """True if h < 0 at the goal, because of a wall or of a person who stands there."""
        s = self.settings
        at_walls = compute_h(*self.goal, (), self.walls, r_robot=s.r_robot, eps=s.eps)
        return any(zone.blocks(self.goal, s) for zone in self.zones) or any(
            h < 0 for h in at_walls
        )

    @property
    def is_in_solid(self) -> bool:
        """True if the robot's centre lies inside of a solid wall."""
        return self.solids is not None and bool(
            shapely.contains_xy(self.solids, *self.state[:2])
        )

    @property
    def near_walls(self) -> Sequence[Sequence[float]]:
        """End points and margin of the walls that can matter."""
        return self.walls if self.near is None else [self.walls[i] for i in self.near]

    def spread(self, rows: Array) -> Array:
        """Rows of all people and all walls, from `rows` of people and near walls; inf for the other walls."""
        if self.near is None:
            return rows
        spread = np.full((len(self.people) + len(self.walls), *rows.shape[1:]), inf)
        spread[
            [*range(len(self.people)), *(len(self.people) + i for i in self.near)]
        ] = rows
        return spread

    @property
    def level(self) -> Level:
        """How crowded the surroundings of the robot are: see `szlib.control.crowding`."""
        return find_level(self.state, self.people, self.settings)

    @property
    def barriers(self) -> Sequence[Sequence[float]]:
        """Each barrier of people, as in `Problem.parameters`: see `szlib.control.crowding.list_barriers`."""
        return list_barriers(self.level, self.zones, self.people, self.settings)

    def obstacle(self, row: int) -> tuple[Literal["person", "wall"], int]:
        """Kind and number of the person or wall of a `row` of `Step.h`."""
        people = len(self.people)
        return ("person", row) if row < people else ("wall", row - people)

    def h(self, x: float, y: float, time: float = 0.0) -> list[float]:
        """h of people and then of near walls for the robot at (`x`, `y`), `time` seconds from now [m]."""
        s = self.settings
        return compute_h(
            x, y, self.zones, self.near_walls, r_robot=s.r_robot, eps=s.eps, time=time
        )

    def gaps(self, x: float, y: float, time: float = 0.0) -> list[float]:
        """Euclidean gaps of the disc at (`x`, `y`) to bodies and near walls, `time` seconds from now [m]."""
        gaps, radius = [], self.settings.r_robot
        for person in self.people:
            (px, py), (vx, vy) = person.position, person.velocity
            gaps.append(
                hypot(x - px - time * vx, y - py - time * vy) - BODY_RADIUS - radius
            )
        return gaps + [
            euclidean_segment_formula(x, y, *wall[:4]) - radius
            for wall in self.near_walls
        ]

    def smallest_gap(
        self, start: Sequence[float], end: Sequence[float], acceleration: float
    ) -> float:
        """Lower bound of the disc's gaps to bodies and walls, and of h + eps of people, within a step [m].

        Parameters
        ----------
        start, end : (x, y) of the robot now and dt later [m].
        acceleration : largest acceleration of the robot on the way [m/s2].

        Notes
        -----
        If the robot moved straight at a constant velocity, as people do, these distances would be convex
        functions of time. Such a function lies above its tangents at both ends, so nowhere below the point
        where they cross. The robot leaves that motion by at most acceleration dt^2 / 8, and no distance
        changes by more than the way. h has the allowance eps: it is for what a way cuts off a round zone.
        Inside of a solid wall the bound is -inf.
        """
        if self.is_in_solid:
            return -inf
        (x, y), s = start, self.settings
        dx, dy, bow = end[0] - x, end[1] - y, acceleration * s.dt**2 / 8
        reach = hypot(dx, dy) + s.dt * max(
            [hypot(*person.velocity) for person in self.people], default=0.0
        )

        def gaps_after(share: float) -> list[float]:
            """These distances after a share of the step, without the acceleration."""
            at = x + share * dx, y + share * dy
            h = compute_h(
                *at, self.zones, (), r_robot=s.r_robot, eps=0.0, time=share * s.dt
            )
            return self.gaps(*at, share * s.dt) + h

        gaps = gaps_after(0.0)
        if min(gaps, default=inf) >= reach + bow:
            return min(gaps, default=inf) - reach - bow
        for i, rows in enumerate(
            zip(gaps, *map(gaps_after, (_INSTANT, 1 - _INSTANT, 1.0)), strict=True)
        ):
            slope, slope_at_end = (
                (rows[1] - rows[0]) / _INSTANT,
                (rows[3] - rows[2]) / _INSTANT,
            )
            gaps[i] = min(rows)
            if slope < 0 < slope_at_end:
                gaps[i] = rows[0] + slope * (rows[3] - slope_at_end - rows[0]) / (
                    slope - slope_at_end
                )
        return min(gaps) - _INSTANT * reach - bow

"""What people would otherwise use, each in a few lines: none promises anything, none knows of zones.

    straight      ahead to the goal, and stop for what is in the way
    social force  Helbing and Molnar (1995), with the interaction measured by Moussaid et al. (2009)
    dwa           the dynamic window: of all velocities within reach, the best that can still be stopped

All keep the limits of `MPCSettings` (a_max, v_max), and a gap of eps to bodies and walls.  No package on PyPI
was found that is kept and light: dynamic-window-approach has had no release since 2020, pytorch-mppi brings
PyTorch.

Sources: D. Helbing, P. Molnar, "Social force model for pedestrian dynamics", Phys. Rev. E 51, 1995;
M. Moussaid et al., "Experimental study of the behavioural mechanisms underlying self-organization in human
crowds", Proc. R. Soc. B 276, 2009; D. Fox, W. Burgard, S. Thrun, "The dynamic window approach to collision
avoidance", IEEE Robotics & Automation Magazine 4(1), 1997.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..checks import Array
from ..control.barriers import euclidean_segment_formula
from ..control.controller import Controller
from ..control.person import BODY_RADIUS, Person
from ..control.settings import MPCSettings
from .scenario import Scenario


class Command(NamedTuple):
    """What a baseline decided: (ax, ay) [m/s2], and nothing else."""

    control: Array


@dataclass(frozen=True)
class Baseline(Controller):
    """What the baselines share: `settings` for their limits, the walls, and a velocity that each wants."""

    settings: MPCSettings = field()
    walls: Array = field()

    def step(self, state: Array, goal: Array, people: Sequence[Person]) -> Command:
        """The acceleration that brings the robot nearest to the velocity that it wants."""
        s, velocity = self.settings, state[2:]
        wanted = self.wanted(state[:2], velocity, goal, people)
        change = (wanted / max(1.0, np.hypot(*wanted) / s.v_max) - velocity) / s.dt
        return Command(change / max(1.0, np.abs(change).max() / s.a_max))

    def wanted(self, position: Array, velocity: Array, goal: Array, people: Sequence[Person]) -> Array:
        """The velocity wanted now [m/s]."""
        return self.towards(goal - position)

    def towards(self, offset: Array) -> Array:
        """A velocity to the goal: full speed, but so that the robot can stop there [m/s]."""
        distance = float(np.hypot(*offset))
        return offset / max(distance, 1e-9) * min(self.settings.v_max, distance)

    def gap(self, at: Array, people: Sequence[Person], time: Any = 0.0) -> Array:
        """Euclidean gap from the robot's disc to the nearest body or wall, then; at (..., 2), time (...)."""
        x, y = at[..., 0], at[..., 1]
        nearest = np.full(x.shape, np.inf)
        for (px, py), (vx, vy) in ((p.position, p.velocity) for p in people):
            nearest = np.minimum(nearest, np.hypot(x - px - time * vx, y - py - time * vy) - BODY_RADIUS)
        for wall in self.walls:
            nearest = np.minimum(nearest, euclidean_segment_formula(x, y, *wall.ravel()))
        return nearest - self.settings.r_robot - self.settings.eps


@dataclass(frozen=True)
class Straight(Baseline):
    """Straight ahead; stops for who is in its lane, no farther than it needs to stop, and `margin` [m]."""

    margin: float = 0.5

    def wanted(self, position: Array, velocity: Array, goal: Array, people: Sequence[Person]) -> Array:
        """To the goal at full speed, or nowhere."""
        s, ahead = self.settings, self.towards(goal - position)
        reach = float(velocity @ velocity) / (2 * s.a_max) + s.v_max * s.dt + self.margin
        lane = position + np.linspace(0.0, 1.0, 9)[:, None] * reach * ahead / max(np.hypot(*ahead), 1e-9)
        return ahead if self.gap(lane, people).min() > 0 else np.zeros(2)


@dataclass(frozen=True)
class SocialForce(Baseline):
    """Drawn to the goal within `tau` [s], pushed by people and walls; numbers of Moussaid et al. (2009).

    The interaction is along D = e + `relative` (v - v'), e the direction to the person: with B = `reach` |D|
    and theta the angle from D to e, `strength` exp(-d/B) [m/s2], slowing by exp(-(2 B theta)^2), turning by
    exp(-(3 B theta)^2); walls push with `wall` exp(-d/`wall_reach`).  d is the distance of two people with
    the same gap, for the robot is larger than one.  A bias of theta, 0.005 B, is the choice of the right.
    """

    tau: float = 0.54
    strength: float = 4.5
    relative: float = 2.0
    reach: float = 0.35
    wall: float = 3.0
    wall_reach: float = 0.1

    def wanted(self, position: Array, velocity: Array, goal: Array, people: Sequence[Person]) -> Array:
        """What the forces make of the velocity in one step."""
        force = (self.towards(goal - position) - velocity) / self.tau
        for person in people:
            force = force + self._push(position, velocity, person)
        for xa, ya, xb, yb in self.walls.reshape(-1, 4).tolist():
            along = np.array([xb - xa, yb - ya])
            share = np.clip((position - (xa, ya)) @ along / (along @ along), 0, 1)
            away = position - (xa, ya) - share * along
            distance = max(float(np.hypot(*away)), 1e-9)
            gap = distance - self.settings.r_robot
            force = force + self.wall * np.exp(-max(gap, 0.0) / self.wall_reach) * away / distance
        return velocity + self.settings.dt * force

    def _push(self, position: Array, velocity: Array, person: Person) -> Array:
        to = np.subtract(person.position, position)
        distance = max(float(np.hypot(*to)), 1e-9)
        apart = distance - self.settings.r_robot + BODY_RADIUS
        drive = to / distance + self.relative * (velocity - person.velocity)
        size = max(float(np.hypot(*drive)), 1e-9)
        drive, b = drive / size, self.reach * size
        left = np.array([-drive[1], drive[0]])
        theta = np.arctan2(left @ to, drive @ to) + 0.005 * b
        slow, turn = np.exp(-((2 * b * theta) ** 2)), np.exp(-((3 * b * theta) ** 2))
        return np.asarray(-self.strength * np.exp(-apart / b) * (slow * drive + np.sign(theta) * turn * left))


@dataclass(frozen=True)
class DynamicWindow(Baseline):
    """The dynamic window, for a robot that accelerates in any direction; weights and sizes are assumed.

    Of `samples` squared velocities that can be had one step from now, those are admissible with which the
    robot, held at them, could still brake before it touches a wall, or people at constant velocity; the best
    is nearest to the goal after `horizon` [s], less `clearance` times the least gap on the way, of which more
    than 1 m is worth nothing.  Where none is admissible the robot brakes.
    """

    horizon: float = 2.0
    clearance: float = 0.5
    samples: int = 9

    def wanted(self, position: Array, velocity: Array, goal: Array, people: Sequence[Person]) -> Array:
        """The best velocity of the window."""
        s = self.settings
        change = np.linspace(-1, 1, self.samples) * s.a_max * s.dt
        window = velocity + np.stack(np.meshgrid(change, change), axis=-1).reshape(-1, 2)
        window = window[np.hypot(*window.T) <= s.v_max]
        time = np.arange(1, round(self.horizon / s.dt) + 1) * s.dt
        at = position + time[:, None] * window[:, None]
        gap = self.gap(at, people, time)
        free = np.where((gap > 0).all(axis=1), np.inf, time[(gap <= 0).argmax(axis=1)])
        admissible = free > np.hypot(*window.T) / s.a_max + s.dt
        if not admissible.any():
            return np.zeros(2)
        away = np.hypot(*(at[:, -1] - goal).T)
        worth = self.clearance * np.minimum(gap.min(axis=1), 1.0) - away
        return np.asarray(window[np.where(admissible, worth, -np.inf).argmax()])


def straight(scenario: Scenario, settings: MPCSettings) -> Straight:
    """Straight ahead, with stop; a `ControllerFactory`."""
    return Straight(settings, scenario.walls)


def social_force(scenario: Scenario, settings: MPCSettings) -> SocialForce:
    """Social forces; a `ControllerFactory`."""
    return SocialForce(settings, scenario.walls)


def dynamic_window(scenario: Scenario, settings: MPCSettings) -> DynamicWindow:
    """The dynamic window; a `ControllerFactory`."""
    return DynamicWindow(settings, scenario.walls)

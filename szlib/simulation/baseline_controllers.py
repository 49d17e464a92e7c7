"""Baseline controllers to compare with: none claims that its steps are safe, none knows zones.

    straight        straight to the goal; stops for what is in the way
    social force    Helbing and Molnar (1995), with the interaction measured by Moussaid et al. (2009)
    dynamic window  the best velocity within reach from which the robot can still stop

All keep the limits of `MPCSettings` (a_max, v_max).  Straight and dynamic window keep a gap of eps to
walls and to people who stand; the dynamic window checks times dt apart, and may be some millimetres short.
The social force promises no gap.  PyPI has no package that is both maintained and light:
dynamic-window-approach has had no release since 2020, pytorch-mppi needs PyTorch.

Sources: D. Helbing, P. Molnar, "Social force model for pedestrian dynamics", Phys. Rev. E 51, 1995;
M. Moussaid et al., "Experimental study of the behavioural mechanisms underlying self-organization in human
crowds", Proc. R. Soc. B 276, 2009; D. Fox, W. Burgard, S. Thrun, "The dynamic window approach to collision
avoidance", IEEE Robotics & Automation Magazine 4(1), 1997.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..control import MPCCBF, Body, Controller, MPCSettings, Obstacles, Person
from ..core.checks import Array
from ..zones.ellipses import BODY_RADIUS, Ellipse
from .scenario import Scenario

# Makes a controller for a scenario. A function of a module, so that other processes find it.
ControllerFactory = Callable[[Scenario, MPCSettings], Controller]
# Zone of people who have none [m] (assumed); in random worlds all people have one.
DEFAULT_ZONE = Ellipse((0.0, 0.0), (1.0, 1.0))


def make_mpc_cbf(scenario: Scenario, settings: MPCSettings) -> MPCCBF:
    """The MPC-CBF controller for a `scenario` with `settings`; people without a zone have `DEFAULT_ZONE`."""
    return MPCCBF(
        DEFAULT_ZONE,
        walls=scenario.walls,
        obstacles=scenario.obstacles,
        settings=settings,
    )


class BaselineController(Controller):
    """Base of the baselines: the limits of the robot, and a desired velocity.

    Parameters
    ----------
    scenario : gives the walls and other obstacles.
    settings : gives the limits and the sizes.
    """

    settings: MPCSettings

    def __init__(self, scenario: Scenario, settings: MPCSettings) -> None:
        self.settings = settings
        self.walls = scenario.walls
        self._fixed = Obstacles.of(scenario.fixed, settings)

    def step(
        self, state: Array, goal: Array, people: Sequence[Person]
    ) -> SimpleNamespace:
        """The acceleration towards the desired velocity; see `Controller.step` for `state`, `goal`,
        `people`.
        """
        s = self.settings
        desired = self.desired_velocity(state, goal, people)
        change = (desired / max(1.0, np.hypot(*desired) / s.v_max) - state[2:]) / s.dt
        return SimpleNamespace(
            control=change / max(1.0, np.abs(change).max() / s.a_max)
        )

    def desired_velocity(
        self, state: Array, goal: Array, people: Sequence[Person]
    ) -> Array:
        """The velocity that the robot desires now [m/s].

        Parameters
        ----------
        state : (x, y, vx, vy) [m, m/s].
        goal : (x, y) [m].
        people : the people whom the robot sees.
        """
        raise NotImplementedError

    def velocity_to_goal(self, offset: Array) -> Array:
        """A velocity along the `offset` to the goal [m]: full speed, or slower so that the robot can stop
        [m/s].
        """
        distance = float(np.hypot(*offset))
        return offset / max(distance, 1e-9) * min(self.settings.v_max, distance)

    def gap(self, at: Array, people: Sequence[Person], time: Any = 0.0) -> Array:
        """Euclidean gap from the robot's disc to the nearest body or wall [m].

        Parameters
        ----------
        at : positions of the robot, shape (..., 2) [m].
        people : the people, who walk at constant velocity.
        time : time of each position, shape (...) [s].
        """
        bodies = (Body(*p.position, *p.velocity) for p in people)
        obstacles = Obstacles.of(bodies, self.settings).joined(self._fixed)
        gaps = obstacles.gaps(at[..., 0], at[..., 1], time)
        return np.asarray(gaps.min(axis=0, initial=np.inf) - self.settings.eps)


class StraightController(BaselineController):
    """Drives straight to the goal; stops if something is within its braking distance and `margin` [m].

    `scenario`, `settings` : as of `BaselineController`.
    """

    margin = 0.5

    def desired_velocity(
        self, state: Array, goal: Array, people: Sequence[Person]
    ) -> Array:
        """See `BaselineController.desired_velocity` for `state`, `goal`, `people`."""
        s = self.settings
        position, velocity = np.split(state, 2)
        ahead = self.velocity_to_goal(goal - position)
        reach = (
            float(velocity @ velocity) / (2 * s.a_max) + s.v_max * s.dt + self.margin
        )
        lane = position + np.linspace(0.0, 1.0, 9)[:, None] * reach * ahead / max(
            np.hypot(*ahead), 1e-9
        )
        return ahead if self.gap(lane, people).min() > 0 else np.zeros(2)


class SocialForceController(BaselineController):
    """Attracted to the goal within `tau` [s], pushed by people and walls; numbers of Moussaid et al. (2009).

    `scenario`, `settings` : as of `BaselineController`.

    The interaction is along D = e + `relative` (v - v'), e the direction to the person: with B = `reach` |D|
    and theta the angle from D to e, `strength` exp(-d/B) [m/s2], slowing by exp(-(3 B theta)^2), turning by
    exp(-(2 B theta)^2); d is the distance of two people with the same gap, because the robot is larger than
    a person.  A bias of theta, 0.005 B, prefers the right.  Walls and other obstacles push with `wall`
    exp(-gap/`wall_reach`).  No gap is promised: the robot may touch people and walls.
    """

    tau = 0.54
    strength = 4.5
    relative = 2.0
    reach = 0.35
    wall = 3.0
    wall_reach = 0.1

    def desired_velocity(
        self, state: Array, goal: Array, people: Sequence[Person]
    ) -> Array:
        """See `BaselineController.desired_velocity` for `state`, `goal`, `people`."""
        position, velocity = np.split(state, 2)
        force = (self.velocity_to_goal(goal - position) - velocity) / self.tau
        force += self._push_from_fixed(position)
        for person in people:
            force += self._push(position, velocity, person)
        return velocity + self.settings.dt * force

    def _push_from_fixed(self, position: Array) -> Array:
        """Sum of the pushes of walls and obstacles, each along the gradient of its gap."""
        shift = 1e-4 * np.eye(2)
        before, after = (
            self._fixed.gaps(*(position + way).T) for way in (-shift, shift)
        )
        gap = np.maximum(self._fixed.gaps(*position), 0.0)
        away = (after - before) / 2e-4
        return np.asarray(self.wall * np.exp(-gap / self.wall_reach) @ away)

    def _push(self, position: Array, velocity: Array, person: Person) -> Array:
        to = np.subtract(person.position, position)
        distance = max(float(np.hypot(*to)), 1e-9)
        apart = distance - self.settings.r_robot + BODY_RADIUS
        drive = to / distance + self.relative * (velocity - person.velocity)
        size = max(float(np.hypot(*drive)), 1e-9)
        drive /= size
        b = self.reach * size
        left = np.array([-drive[1], drive[0]])
        theta = np.arctan2(left @ to, drive @ to) + 0.005 * b
        slow = np.exp(-((3 * b * theta) ** 2))
        turn = np.exp(-((2 * b * theta) ** 2))
        return np.asarray(
            -self.strength
            * np.exp(-apart / b)
            * (slow * drive + np.sign(theta) * turn * left)
        )


class DynamicWindowController(BaselineController):
    """The dynamic window for a robot that accelerates in any direction; weights and sizes are assumed.

    `scenario`, `settings` : as of `BaselineController`.

    The window has `samples` squared velocities that the robot can reach in one step.  A velocity is
    admissible if the robot, held at it, can brake before it touches a wall, or a person at constant
    velocity.  The best one has the smallest distance to the goal after `horizon` [s], less `clearance`
    times the smallest gap on the path, up to 1 m.  Without an admissible velocity the robot brakes.
    """

    horizon = 2.0
    clearance = 0.5
    samples = 9

    def desired_velocity(
        self, state: Array, goal: Array, people: Sequence[Person]
    ) -> Array:
        """See `BaselineController.desired_velocity` for `state`, `goal`, `people`."""
        s = self.settings
        position, velocity = np.split(state, 2)
        change = np.linspace(-1, 1, self.samples) * s.a_max * s.dt
        window = velocity + np.stack(np.meshgrid(change, change), axis=-1).reshape(
            -1, 2
        )
        window = window[np.hypot(*window.T) <= s.v_max]
        time = np.arange(1, round(self.horizon / s.dt) + 1) * s.dt
        at = position + time[:, None] * window[:, None]
        gap = self.gap(at, people, time)
        free = np.where((gap > 0).all(axis=1), np.inf, time[(gap <= 0).argmax(axis=1)])
        admissible = free > np.hypot(*window.T) / s.a_max + s.dt
        if not admissible.any():
            return np.zeros(2)
        to_goal = np.hypot(*(at[:, -1] - goal).T)
        value = self.clearance * np.minimum(gap.min(axis=1), 1.0) - to_goal
        return np.asarray(window[np.where(admissible, value, -np.inf).argmax()])


CONTROLLERS: dict[str, ControllerFactory] = {
    "MPC-CBF": make_mpc_cbf,
    "straight": StraightController,
    "social force": SocialForceController,
    "dynamic window": DynamicWindowController,
}
"""MPC-CBF and its rivals, by name; another rival is one more entry."""

"""What the closed loop asks of a controller, of its steps, and of a robot.

    class Straight:                                     # a controller in five lines
        def reset(self): ...
        def step(self, state, goal, people):
            ahead = goal - state[:2]                    # 1 m/s at most, 1 m/s2 or so
            wanted = ahead / max(1.0, np.hypot(*ahead))
            return SimpleNamespace(control=np.clip(wanted - state[2:], -1, 1))

Nothing needs to be inherited.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from ..checks import Array
from ..control.person import Person
from ..control.settings import MPCSettings
from .scenario import Scenario


class StepLike(Protocol):
    """What a controller decided: `control`, what the robot is driven by for the next `dt`.

    Where it has more, the log keeps it, with the meaning of `szlib.control.step.Step`: `safe`, a promise;
    `slack`, `rung`, `residual`, `predicted`, `solve_time`.
    """

    @property
    def control(self) -> Array:
        """What the robot is driven by: (ax, ay) [m/s2], or as its `Robot` takes it."""


class Controller(Protocol):
    """Drives a robot: `reset` before a run, `step` once each `dt`, with everybody who is there then.

    `state` is the robot's own: (x, y, vx, vy) of the paper's double integrator, driven by (ax, ay)
    [m, m/s, m/s2], unless the controller has an attribute `robot`, a `Robot`.  `goal` is (x, y), shape
    (2,) [m]. Limits of speed and acceleration are the controller's to keep: what it gives is applied.

    An attribute `settings` (`MPCSettings`) gives the loop its dt, and measures their radius; `zone` is the
    zone of people who have none; `walls`, shape (n, 2, 2), must be those of the scenario.
    """

    def reset(self) -> None:
        """Forget the run before."""

    def step(self, state: Array, goal: Array, people: Sequence[Person]) -> StepLike:
        """The control to hold for the next `dt`."""


class Robot(Protocol):
    """How a robot moves: its own state from that of the disc around it, back, and one step on.

    Its own state has any shape; the disc's, (x, y, vx, vy) [m, m/s], is what is logged and measured.  An
    attribute `inputs`, names of the controls, gives the columns of the log's table.
    """

    def start(self, state: Array) -> Array:
        """The robot's own state from the disc's."""

    def body(self, own: Array) -> Array:
        """The disc's (x, y, vx, vy) from the robot's own state."""

    def advance(self, own: Array, control: Array, dt: float) -> Array:
        """Its own state dt later [s]."""


ControllerFactory = Callable[[Scenario, MPCSettings], Controller]
"""Makes a controller for a scenario; a function of a module, so that other processes find it."""


def advance(state: Array, control: Array, dt: float) -> Array:
    """The state (x, y, vx, vy) one step later: a double integrator, exact (paper, eq. 8)."""
    (x, y, vx, vy), (ax, ay), half = state.tolist(), control.tolist(), 0.5 * dt**2
    return np.array([x + dt * vx + half * ax, y + dt * vy + half * ay, vx + dt * ax, vy + dt * ay])


class DoubleIntegrator:
    """The robot of the paper, (x, y, vx, vy) driven by (ax, ay) (eq. 8): its own state is the disc's."""

    inputs = ("ax", "ay")

    def start(self, state: Array) -> Array:
        """A copy of the state."""
        return state.copy()

    def body(self, own: Array) -> Array:
        """The state itself."""
        return own

    def advance(self, own: Array, control: Array, dt: float) -> Array:
        """As of `advance`."""
        return advance(own, control, dt)

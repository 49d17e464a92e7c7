"""What every controller has in common: the base class `Controller`, and the robots that controllers drive."""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from ..checks import Array
from .person import Person
from .settings import MPCSettings


class Robot(Protocol):
    """How a robot moves. Its own state has any shape; the log holds the state of its disc."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the controls, which become columns of the log's table."""

    def start(self, state: Array) -> Array:
        """Own state of the robot from `state`, (x, y, vx, vy) of its disc [m, m/s]."""

    def body(self, own: Array) -> Array:
        """(x, y, vx, vy) of the robot's disc [m, m/s] from `own`, the robot's own state."""

    def advance(self, own: Array, control: Array, dt: float) -> Array:
        """Own state of the robot after it has held `control` for `dt` [s] in the state `own`."""


def advance(state: Array, control: Array, dt: float) -> Array:
    """State of a double integrator one time step later, without any error (paper, eq. 8).

    Parameters
    ----------
    state : (x, y, vx, vy) [m, m/s].
    control : (ax, ay) [m/s2].
    dt : time step [s].

    Examples
    --------
    >>> import numpy as np
    >>> from szlib.control import advance
    >>> advance(np.array([0.0, 0.0, 1.0, 0.0]), np.array([0.5, 0.0]), dt=2.0).tolist()
    [3.0, 0.0, 2.0, 0.0]
    """
    (x, y, vx, vy), (ax, ay), half = state.tolist(), control.tolist(), 0.5 * dt**2
    return np.array(
        [x + dt * vx + half * ax, y + dt * vy + half * ay, vx + dt * ax, vy + dt * ay]
    )


class DoubleIntegrator:
    """The robot of the paper: (x, y, vx, vy), driven by (ax, ay) (eq. 8); its own state is its disc's."""

    inputs = ("ax", "ay")

    def start(self, state: Array) -> Array:
        """Copy of `state`."""
        return state.copy()

    def body(self, own: Array) -> Array:
        """The state `own` itself."""
        return own

    def advance(self, own: Array, control: Array, dt: float) -> Array:
        """State after `own` when `control` was held for `dt` [s]: see `advance` of this module."""
        return advance(own, control, dt)


class Controller:
    """Base class of controllers: `reset` before a run, `step` once each `dt`.

    Derive from it and write `step`. The closed loop accepts any other object with `reset` and `step` as well:
    see `as_controller`.

    Attributes
    ----------
    settings : gives the closed loop its time step and the sizes that are measured; None: `MPCSettings()`.
    zone : the zone of people who have none of their own; None: their body alone.
    walls : the walls that the controller knows, shape (n, 2, 2) [m], which must be those of the scenario;
        None: not checked.
    robot : how the robot moves.

    Examples
    --------
    A controller that drives straight to the goal at up to 1 m/s and ignores people:

    >>> import numpy as np
    >>> import szlib
    >>> from types import SimpleNamespace
    >>> class Straight(szlib.control.Controller):
    ...     def step(self, state, goal, people):
    ...         offset = goal - state[:2]
    ...         velocity = offset / max(1.0, np.hypot(*offset))
    ...         return SimpleNamespace(control=np.clip(velocity - state[2:], -1, 1))
    >>> log = szlib.simulate(szlib.SCENARIOS["passing"], Straight())
    >>> bool(log.metrics()["min_clearance"] < 0)  # it hits the person
    True
    """

    settings: MPCSettings | None = None
    zone: Any = None
    walls: Any = None
    robot: Robot = DoubleIntegrator()

    def __copy__(self) -> Self:
        """A deep copy: two controllers cannot share a plan, or the people they remember."""
        return deepcopy(self)

    def reset(self) -> None:
        """Forget the run before."""

    def step(self, state: Array, goal: Array, people: Sequence[Person]) -> Any:
        """Decide what the robot does for the next `dt`.

        Parameters
        ----------
        state : the robot's own state: (x, y, vx, vy) [m, m/s] for a double integrator.
        goal : (x, y), shape (2,) [m].
        people : everybody who is present and seen.

        Returns
        -------
        An object with `control`, shape (n,): (ax, ay) [m/s2] for a double integrator. The log also keeps
        `predicted`, `residual`, `fallback`, `safe`, `slack` and `solve_time` where it has them: see `Step`.
        """
        raise NotImplementedError

    def check_start(
        self, state: ArrayLike, goal: ArrayLike, people: Sequence[Person]
    ) -> None:
        """Raise SolverError if no run can start from `state` to `goal` among `people`; here: never."""


class _Adapter(Controller):
    """A controller made of any object with `reset` and `step`."""

    def __init__(self, controller: Any) -> None:
        for name in ("reset", "step", "zone", "walls", "robot"):
            if getattr(controller, name, None) is not None:
                setattr(self, name, getattr(controller, name))
        if isinstance(settings := getattr(controller, "settings", None), MPCSettings):
            self.settings = settings


def as_controller(controller: Any) -> Controller:
    """Return `controller` as a `Controller`, with the defaults of what it lacks.

    Parameters
    ----------
    controller : a `Controller`, or any object with `reset` and `step`; of its attributes `settings`, `zone`,
        `walls` and `robot` those that exist are used.
    """
    return controller if isinstance(controller, Controller) else _Adapter(controller)

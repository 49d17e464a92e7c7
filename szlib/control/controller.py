"""What every controller has in common: the class `Controller`, the robots, and the clock of the steps."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from copy import deepcopy
from math import ceil, dist, inf
from statistics import median_low
from time import perf_counter
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import Array
from .obstacles import Path
from .people import Person, check_finite
from .settings import MPCSettings, check_argument


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
    velocity = state[2:]
    position = state[:2] + dt * velocity + 0.5 * dt**2 * control
    return np.concatenate([position, velocity + dt * control])


_MOST_PIECES = 1000  # of a braking path, which are longer than dt if it needs more


def find_stopping_path(state: Sequence[float], inputs: Array, s: MPCSettings) -> Path:
    """Where a double integrator goes that holds each of the `inputs`, and then brakes as hard as it can.

    It brakes on a straight line, to rest, in pieces of dt; the pieces that are left after one of them are the
    braking path of the state there (if there are no more than `_MOST_PIECES`).

    Parameters
    ----------
    state : (x, y, vx, vy) [m, m/s].
    inputs : the first k accelerations of a plan, shape (k, 2) [m/s2].
    s : settings: the lengths of the steps, and a_max.
    """
    # complex numbers: places x + i y, and velocities; Python's own, because they are few
    x, y, *velocity = state
    v = complex(*velocity)
    steps = []
    for m, control in zip(s.step_lengths, inputs.tolist(), strict=False):
        v += s.dt * m * complex(*control)
        steps.append((s.dt * m, v))
    fastest = max(abs(v.real), abs(v.imag))
    piece = s.dt * max(1, ceil(fastest / s.a_max / s.dt / _MOST_PIECES))
    n = ceil(fastest / s.a_max / piece - 1e-9)  # none at rest
    slower = (max(1 - k * s.a_max * piece / fastest, 0.0) for k in range(1, n + 1))
    steps += [(piece, share * v) for share in slower]
    v = complex(*velocity)
    points = [complex(x, y)]
    times = [0.0]
    bows = []
    for length, after in steps:
        points.append(points[-1] + length * (v + after) / 2)
        times.append(times[-1] + length)
        bows.append(length * abs(after - v) / 8)
        v = after
    places = np.array(points).view(float).reshape(-1, 2)
    return Path(places, np.array(times), np.array(bows))


class DoubleIntegrator:
    """The robot of the paper: (x, y, vx, vy), driven by (ax, ay) (eq. 8); its own state is its disc's."""

    inputs = ("ax", "ay")

    def start(self, state: Array) -> Array:
        """Copy of `state`."""
        return state.copy()

    def body(self, own: Array) -> Array:
        """The state `own` itself."""
        return own

    advance = staticmethod(advance)


class Controller:
    """Base class of controllers: `reset` before a run, `step` once each `dt`.

    Derive from it and write `step`. The closed loop accepts any other object with `reset` and `step` as well:
    see `as_controller`.

    Attributes
    ----------
    settings : gives the closed loop its time step and the sizes that are measured; None: `MPCSettings()`.
    zone : the zone of people who have none of their own; None: their body alone.
    walls, obstacles : the walls, shape (n, 2, 2) [m], and the other obstacles that the controller knows,
        which must be those of the scenario; None: not checked.
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
    obstacles: Any = None
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
        `predicted`, `residual`, `status`, `safe`, `slack` and `solve_time` where it has them: see `Step`.
        """
        raise NotImplementedError

    def check_start(
        self, state: ArrayLike, goal: ArrayLike, people: Sequence[Person]
    ) -> None:
        """Raise SolverError if no run can start from `state` to `goal` among `people`; here: never."""


def as_controller(controller: Any) -> Controller:
    """Return `controller` as a `Controller`, with the defaults of what it lacks.

    Parameters
    ----------
    controller : a `Controller`, or any object with `reset` and `step`; of its attributes `settings`, `zone`,
        `walls`, `obstacles` and `robot` those that exist are used: as of a `Controller`.
    """
    if isinstance(controller, Controller):
        return controller
    is_one = hasattr(controller, "step")
    check_argument(is_one, "controller", controller, "an object with reset and step")
    found = Controller()
    for name in ("reset", "step", "settings", "zone", "walls", "obstacles", "robot"):
        value = getattr(controller, name, None)
        if value is not None:
            setattr(found, name, value)
    return found


OLDEST_STATE = 1.0
"""The greatest age of a robot's state that can be brought to the present [s] (assumed)."""
STUCK_AFTER = 5.0
"""Time without progress from which on a robot counts as stuck [s] (assumed)."""
PROGRESS = 0.1  # by which the way to the goal must shorten; this near, the robot is there [m] (assumed)
CLOSING_SPEED = 0.1  # a robot that approaches its goal faster than this makes progress [m/s] (assumed)
NEW_GOAL = 0.5  # a goal that has moved farther than this is another goal [m] (assumed)
DETOUR = 1.0  # a way that is so much longer than before is another way [m] (assumed)
RATE_STEPS = (
    9  # a loop has another rate than dt if most of so many steps have (assumed)
)
RATE_ERROR = (
    0.2  # share of dt by which the time between two steps may differ from dt (assumed)
)
# Calls without `now` are timed if they come between these multiples of dt, as those of a robot; a simulation
# calls as fast as it can (assumed).
REAL_TIME = 0.25, 4.0


class StepClock:
    """When a controller decides its steps, and what it has commanded since.

    Parameters
    ----------
    dt : time between two steps for which the controller is made [s].

    Attributes
    ----------
    now : time of the present step [s].
    has_begun : True if a control was commanded.
    """

    def __init__(self, dt: float) -> None:
        self.now = 0.0
        self.has_begun = False
        self._dt = dt
        self._elapsed = dt
        self._called = 0.0
        self._held = deque[tuple[Array, float]](maxlen=100 * ceil(OLDEST_STATE / dt))
        self._periods = deque[float](maxlen=RATE_STEPS)
        self._goal = (inf, inf)
        self._nearest = inf
        self._remaining = inf
        self._waited = 0.0

    def tick(self, now: float | None, stamps: ArrayLike | None) -> list[str]:
        """Begin a step: what is wrong with its times, in words.

        Parameters
        ----------
        now : time of the step [s]; None: `dt` after the last, which no `stamps` can refer to.
        stamps : when people were measured [s].
        """
        is_timed = now is None
        last = self.now
        called = perf_counter()
        expected = "given with `stamps`, by the same clock"
        faults = []
        check_argument(not is_timed or stamps is None, "now", now, expected)
        if now is not None:
            self.now = check_finite("now", now)
        elif self.has_begun:
            self.now += self._dt
        if self.has_begun:
            self._elapsed = self.now - last
            if self._elapsed < 0:
                faults.append(
                    f"the clock went back by {-self._elapsed:.3g} s; nobody is forgotten"
                )
                self._elapsed = self._dt
            self._held.append((self._control, self._elapsed))
            self._periods.append(called - self._called if is_timed else self._elapsed)
        self._called = called
        return faults + self._check_rate(is_timed)

    def _check_rate(self, is_timed: bool) -> list[str]:
        """What is wrong with the rate of the steps, by `now` or, if it `is_timed`, by a clock of our own."""
        periods = self._periods
        dt = self._dt
        low, high = REAL_TIME if is_timed else (0.0, inf)
        if len(periods) < RATE_STEPS or not low <= periods[-1] / dt <= high:
            return []
        period = median_low(periods)
        off = min(abs(period - dt), abs(periods[-1] - dt))
        near = [each for each in periods if abs(each - period) < RATE_ERROR * period]
        is_even = len(near) > RATE_STEPS / 2
        if off <= RATE_ERROR * dt or (is_timed and not is_even):
            return []
        return [
            f"steps come every {period:.3g} s, not every dt = {dt:g} s: gamma is per dt"
            + "; give `now`, or call every dt" * is_timed
        ]

    def hold(self, control: Array) -> None:
        """End a step: the robot holds `control` until the next one."""
        self._control = control
        self.has_begun = True

    def bring_forward(
        self, robot: Robot, own: Array, age: float, at_first: Array
    ) -> Array:
        """State of a `robot` now, from its state `own` of the `age` [s]; `at_first`: before all commands."""
        spans = []
        expected = f"{-self._dt:g} to {OLDEST_STATE:g} s"
        is_usable = -self._dt <= age <= OLDEST_STATE
        check_argument(is_usable, "state_age", age, expected)
        for control, held in reversed(self._held):
            if age <= 0:
                break
            spans.append((control, min(held, age)))
            age -= spans[-1][1]
        for control, seconds in reversed([*spans, (at_first, age)]):
            own = robot.advance(own, control, seconds) if seconds > 0 else own
        return own

    def time_without_progress(
        self, remaining: float, goal: tuple[float, float]
    ) -> float:
        """How long the robot has made no progress [s]; 0 below `STUCK_AFTER`, and while it approaches.

        Progress is a shorter `remaining` way [m] than any before. It begins anew with a `goal` that moves
        far, and where the way becomes a longer one, because a door has closed.
        """
        approaches = self._remaining - remaining > CLOSING_SPEED * self._elapsed
        # the clock may jump
        self._waited += min(self._elapsed, max(self._dt, OLDEST_STATE))
        is_new = dist(goal, self._goal) > NEW_GOAL
        is_new |= remaining > self._remaining + DETOUR
        if is_new or remaining < self._nearest - PROGRESS:
            self._nearest = remaining
            self._waited = 0.0
            self._goal = goal
        self._remaining = remaining
        if self._waited < STUCK_AFTER or remaining <= PROGRESS or approaches:
            return 0.0
        return self._waited

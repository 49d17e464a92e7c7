"""The clock of a controller: when it decides, how old a state is, and how long there is no progress."""

from __future__ import annotations

from collections import deque
from itertools import islice
from math import ceil, dist, inf
from statistics import median_low

import numpy as np
from numpy.typing import ArrayLike

from ..checks import Array, require
from ..errors import SolverError
from .controller import Robot
from .tracker import check_time

OLDEST_STATE = 1.0
"""The greatest age of a robot's state that can be brought to the present [s] (assumed)."""
STUCK_AFTER = 5.0
"""Time without progress from which on a robot counts as stuck [s] (assumed)."""
PROGRESS = (
    0.1  # the way must become shorter by this; nearer, the robot is there [m] (assumed)
)
CLOSING_SPEED = 0.1  # a robot that approaches its goal faster than this makes progress [m/s] (assumed)
NEW_GOAL = 0.5  # a goal that is farther than this from the last one is another goal [m] (assumed)
RATE_STEPS = 9  # the rate of a loop is the median of so many steps
RATE_ERROR = 0.2  # share of dt by which that median may differ from dt (assumed)


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
        self.now, self.has_begun, self._dt, self._elapsed, self._back = (
            0.0,
            False,
            dt,
            dt,
            0.0,
        )
        self._held = deque[tuple[Array, float]](
            maxlen=max(RATE_STEPS, 2 * ceil(OLDEST_STATE / dt))
        )
        self._goal, self._nearest, self._remaining, self._waited = (
            (inf, inf),
            inf,
            inf,
            0.0,
        )

    def tick(self, now: float | None, stamps: ArrayLike | None) -> None:
        """Begin a step at the time `now` [s]; None: `dt` after the last, which no `stamps` can refer to."""
        if now is None and stamps is not None:
            raise SolverError(
                "stamps need `now`, the time of the robot's state by the same clock; got none"
            )
        last = self.now
        self.now = (
            check_time(now) if now is not None else last + self._dt * self.has_begun
        )
        self._back = max(0.0, last - self.now) * self.has_begun
        self._elapsed = (
            self.now - last if self.has_begun and not self._back else self._dt
        )
        if self.has_begun:
            self._held.append((self._control, self._elapsed))

    def hold(self, control: Array) -> None:
        """End a step: the robot holds `control` until the next one."""
        self._control, self.has_begun = control, True

    def bring_forward(
        self, robot: Robot, own: Array, age: float, at_first: Array
    ) -> Array:
        """State of a `robot` now, from its state `own` of the `age` [s]; `at_first`: before all commands."""
        left, spans = age, list[tuple[Array, float]]()
        require(
            0 <= left <= OLDEST_STATE,
            "state_age",
            age,
            f"0 to {OLDEST_STATE:g} s",
            SolverError,
        )
        while left > 0 and len(spans) < len(self._held):
            control, held = self._held[-1 - len(spans)]
            spans.append((control, min(held, left)))
            left -= spans[-1][1]
        for control, seconds in reversed([*spans, (at_first, left)]):
            own = robot.advance(own, control, seconds) if seconds > 0 else own
        return own

    def time_without_progress(
        self, remaining: float, goal: tuple[float, float]
    ) -> float:
        """How long the robot has made no progress [s]; 0 below `STUCK_AFTER`, and while it approaches.

        Progress is a shorter `remaining` way [m] than any before. A `goal` that jumps is a new one.
        """
        approaches = self._remaining - remaining > CLOSING_SPEED * self._elapsed
        self._waited += min(
            self._elapsed, max(self._dt, OLDEST_STATE)
        )  # the clock may jump
        if dist(goal, self._goal) > NEW_GOAL or remaining < self._nearest - PROGRESS:
            self._nearest, self._waited = remaining, 0.0
        self._goal, self._remaining = goal, remaining
        return (
            0.0
            if self._waited < STUCK_AFTER or remaining <= PROGRESS or approaches
            else self._waited
        )

    def describe(self, stamps: ArrayLike | None, memory: float) -> str:
        """What is wrong with the times of this step, with the `stamps` of people and a tracker's `memory`."""
        found = []
        if self._back:
            found.append(
                f"the clock went back by {self._back:.3g} s; nobody is forgotten"
            )
        late = (
            0.0
            if stamps is None
            else np.abs(np.asarray(stamps, float) - self.now).max(initial=0.0)
        )
        if late > memory:
            found.append(
                f"people were measured {late:.3g} s from now, and are remembered for {memory:g} s only"
            )
        recent = [held for _, held in islice(reversed(self._held), RATE_STEPS)]
        period = median_low(recent) if len(recent) == RATE_STEPS else self._dt
        if abs(period - self._dt) > RATE_ERROR * self._dt:
            found.append(
                f"steps come every {period:.3g} s, not every dt = {self._dt:g} s: gamma is per dt"
            )
        return "; ".join(found)

"""What the controller decided, and how far it can be relied upon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast, get_args

import numpy as np

from ..checks import Array
from .problem import TOLERANCE
from .scene import Scene
from .settings import MPCSettings, Terminal
from .step_report import Report, described, verified

Rung = Literal["warm", "cold", "kept", "relaxed", "braking"]
RUNGS: tuple[Rung, ...] = get_args(Rung)
Status = Literal["optimal", "kept", "relaxed", "braking"]


@dataclass(frozen=True, repr=False)
class Step:
    """What the controller decided, and how far it can be relied upon.

    Attributes
    ----------
    control : acceleration (ax, ay) to apply now, within its bounds, shape (2,) [m/s2].
    predicted : states x_0 .. x_N of the plan, shape (N+1, 4) [m, m/s].
    rung : the rung of the ladder that gave the plan; see `szlib.control.solvers.fallbacks`.
    slack : largest violation of a hard row by the plan, 0 if none [m for barriers, m2/s2 for speed,
        m/s for the terminal velocity].
    residual : h_{k+1} - (1-gamma) h_k, people before walls, shape (people + walls, N_h) [m].
    h : barriers in the state itself, people before walls, shape (people + walls,) [m]; where one is
        negative, the robot already is where it should not be, and the plan leads out again.
    target : where the plan is drawn to: the goal, but for a meeting head-on, shape (2,) [m].
    cost : the cost of the plan, without any penalty.
    solve_time : wall-clock time of the whole step [s].
    timed_out : a rung was cut short or left out because the time was up (`MPCSettings.time_limit`).
    scene : what was asked.
    """

    control: Array
    predicted: Array
    rung: Rung
    slack: float
    residual: Array
    h: Array
    target: Array
    cost: float
    solve_time: float
    timed_out: bool
    scene: Scene

    @property
    def status(self) -> Status:
        """ "optimal": a solver converged and every hard row holds; else the rung."""
        return status_of(self.rung)

    @property
    def feasible(self) -> bool:
        """True if the plan satisfies the hard problem, whatever rung it comes from; else see `slack`."""
        return self.slack <= TOLERANCE

    @property
    def goal_blocked(self) -> bool:
        """True if the goal cannot be reached, h < 0 there: for a wall, or for somebody who stands.

        Who is slower than `person.STANDS` counts as standing. The robot waits beside them.
        """
        return self.scene.goal_blocked

    @property
    def set_aside(self) -> int:
        """How many people were given with numbers that could not be used; see `MPCCBF.step`."""
        return self.scene.seen.set_aside

    @property
    def lost(self) -> int:
        """Of how many of those nothing is known that could stand in: the robot brakes."""
        return self.scene.seen.lost

    @property
    def terminal(self) -> Terminal:
        """What the plan ends in: see `terminal_of`."""
        return terminal_of(self.scene.settings, len(self.scene.people))

    @property
    def clearance(self) -> Array:
        """Euclidean gaps from the robot's disc to bodies (of `BODY_RADIUS`) and walls [m].

        Shape (people + walls, N+1): now, and at each state of the plan, with people who keep their
        velocity; people before walls. Negative is an overlap.
        """
        gaps = [self._gaps(k) for k in range(len(self.predicted))]
        return np.reshape(np.array(gaps, float), (len(gaps), -1)).T

    @property
    def safe(self) -> bool:
        """True if this step keeps every promise to people who keep their velocity, and to walls.

        That is: nobody is lost (see `MPCCBF.step`), the plan satisfies the hard problem, from a state that
        satisfies every barrier, and the robot's disc overlaps nobody's body and no wall, neither now nor when
        the control has been applied, by Euclidean distance. People who turn, stop or speed up within a step
        may still bring about h < 0 after a step that was safe (notebook 13 counts them); the next step then
        says so.
        """
        if not self.feasible or self.scene.seen.lost or min(self.h.tolist(), default=0.0) < -TOLERANCE:
            return False
        (x, y), (x_next, y_next) = self.predicted[:2, :2].tolist()
        gaps = self.scene.gaps(x, y, 0.0) + self.scene.gaps(x_next, y_next, self.scene.settings.dt)
        return min(gaps, default=0.0) >= -TOLERANCE

    def verify(self) -> Report:
        """Check this step again, by formulas of the report's own, from the scene as it was given."""
        return verified(self)

    def __repr__(self) -> str:
        return described(self, self.verify())

    def _gaps(self, k: int) -> list[float]:
        x, y = self.predicted[k, :2].tolist()
        return self.scene.gaps(x, y, k * self.scene.settings.dt)


def terminal_of(settings: MPCSettings, n_people: int) -> Terminal:
    """What a plan ends in: as in the settings, but at rest for "person" while there is not exactly one."""
    return "rest" if settings.terminal == "person" and n_people != 1 else settings.terminal


def status_of(rung: Rung) -> Status:
    """What a rung says of its plan: see `Step.status`."""
    return "optimal" if rung in ("warm", "cold") else cast(Status, rung)

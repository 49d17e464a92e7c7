"""A run of the closed loop: the arrays that it leaves, and the quantities that follow from them.

Metrics, claims and figures are written against `Run`.  The log of the user, `szlib.SimulationLog`, is a run
with a table, pictures and files.  World frame, metres and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..control import MPCSettings, Obstacles, Person, barrier, ellipse_distance
from ..core.checks import Array, require
from ..zones.ellipses import BODY_RADIUS, Ellipse
from .scenario import Scenario


def nanmin(values: Array, axis: int | tuple[int, ...] | None = None) -> Array:
    """Smallest of `values` along `axis` without NaN; inf where there is none."""
    return np.asarray(np.fmin.reduce(values, axis=axis, initial=np.inf))


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """One run in n states, dt apart, each with the step that the controller decided there.

    P is the number of people, W that of walls and other obstacles.  Arrays that belong to both have the
    people first, in the order of `Step.h`.  A value of a person who is absent is NaN.

    Attributes
    ----------
    scenario : the scene; its people have their own zones.
    settings : settings of the loop and of the measurements: dt, r_robot, eps.
    zones : zone that the robot keeps out of, for each person, in the person's frame; h is about these.
    states : (x, y, vx, vy) of the robot's disc, shape (n, 4) [m, m/s].
    controls : control of each step, shape (n, 2): (ax, ay) [m/s2] for the paper's robot. The control of the
        last state is not applied.
    people : true (x, y, heading, vx, vy) of each person, shape (n, P, 5) [m, rad, m/s].
    predicted : plan of each step, shape (n, N+1, 4); (n, 0, 4) if the controller reports none.
    residual : `Step.residual`, shape (n, P+W, N_h) [m]; NaN for people whom the controller did not see;
        (n, P+W, 0) if the controller reports none.
    status : `Step.status`, shape (n,); "" if the controller reports none.
    safe : `Step.safe`, shape (n,): True is a safety claim.
    slack : largest violation of a row without a price by each plan, shape (n,); NaN if not reported.
    solve_time : time of each step, shape (n,) [s]: as reported, else the duration of the call.
    stuck : time without progress at each step, `Step.stuck`, shape (n,) [s]; 0 if not reported.
    arrival : index of the first state at rest at the goal; None if there is none.
    has_safety_claims : True if the controller reports whether its steps are safe.
    inputs : names of the controls.
    """

    scenario: Scenario
    settings: MPCSettings
    zones: tuple[Ellipse, ...]
    states: Array
    controls: Array
    people: Array
    predicted: Array
    residual: Array
    status: NDArray[np.generic]
    safe: NDArray[np.bool_]
    slack: Array
    solve_time: Array
    stuck: Array
    arrival: int | None
    has_safety_claims: bool = True
    inputs: tuple[str, ...] = ("ax", "ay")

    @property
    def flagged(self) -> NDArray[np.bool_]:
        """Steps that are reported as not safe, shape (n,); none for a controller without safety claims."""
        return ~self.safe & self.has_safety_claims

    @property
    def success(self) -> bool:
        """True if the robot comes to rest at the goal."""
        return self.arrival is not None

    @property
    def until_arrival(self) -> slice:
        """The rows up to the arrival; all rows if the robot does not arrive."""
        return slice(None if self.arrival is None else self.arrival + 1)

    @cached_property
    def time(self) -> Array:
        """Time of each state, shape (n,) [s]."""
        return np.round(np.arange(len(self.states)) * self.settings.dt, 9)

    @cached_property
    def speed(self) -> Array:
        """Speed of the robot, shape (n,) [m/s]."""
        return np.asarray(np.hypot(self.states[:, 2], self.states[:, 3]))

    @cached_property
    def relative(self) -> Array:
        """Position of the robot in each person's frame, shape (n, P, 2) [m]."""
        offset = self.states[:, None, :2] - self.people[:, :, :2]
        x, y = np.moveaxis(offset, -1, 0)
        cos = np.cos(self.people[:, :, 2])
        sin = np.sin(self.people[:, :, 2])
        return np.stack([x * cos + y * sin, y * cos - x * sin], axis=-1)

    @cached_property
    def is_present(self) -> NDArray[np.bool_]:
        """True where a person is present, shape (n, P)."""
        return ~np.isnan(self.people[:, :, 0])

    def distances_to_zones(
        self, zones: Sequence[Ellipse], distance: Callable[[Array, Ellipse], Array]
    ) -> Array:
        """Distance of the robot's centre to one of `zones` for each person, shape (n, P) [m].

        `distance` computes it from points, shape (m, 2), and a zone, both in the person's frame.
        """
        values = np.full(self.is_present.shape, np.nan)
        for i, (zone, rows) in enumerate(zip(zones, self.is_present.T, strict=True)):
            values[rows, i] = distance(self.relative[rows, i], zone)
        return values

    @cached_property
    def fixed(self) -> Obstacles:
        """Walls and other obstacles that stand still, for this robot."""
        return Obstacles.of(self.scenario.fixed, self.settings)

    @cached_property
    def h(self) -> Array:
        """Barriers with the true positions of people, shape (n, P+W) [m]."""
        distances = self.distances_to_zones(self.zones, ellipse_distance)
        to_people = barrier(distances, self.settings.r_robot, self.settings.eps)
        return np.hstack([to_people, self.fixed.h(*self.states[:, :2].T).T])

    @cached_property
    def clearance(self) -> Array:
        """Euclidean gaps from the disc to bodies (of `BODY_RADIUS`) and obstacles, shape (n, P+W) [m]."""
        away = np.hypot(self.relative[..., 0], self.relative[..., 1])
        to_people = away - BODY_RADIUS - self.settings.r_robot
        return np.hstack([to_people, self.fixed.gaps(*self.states[:, :2].T).T])

    @cached_property
    def cbf_people(self) -> Array:
        """Smallest residual of a person's barrier condition, shape (n,) [m]; inf where there is none."""
        return nanmin(self.residual[:, : len(self.zones)], axis=(1, 2))

    def controller_inputs(self, time: float) -> tuple[Array, Array, list[Person]]:
        """State, goal and the true people, with their zones, at a `time` [s], for `Controller.step`.

        `controller.step(*run.controller_inputs(5.0))` decides there again, if the controller remembers
        nothing and saw all people as they were.  The run does not hold noise, whom the controller did not
        see, unknown headings, ids, groups and predictions.

        Raises
        ------
        DataError : the run has no such time, or its robot has other controls than (ax, ay), and so another
            state.
        """
        expected = "('ax', 'ay'): a run holds no more of another robot than its disc"
        require(self.inputs == ("ax", "ay"), "inputs", self.inputs, expected)
        row = round(time / self.settings.dt)
        expected = f"a time of the run, from 0 to {self.time[-1]:g} s"
        require(0 <= row < len(self.states), "time", time, expected)
        present = list[Person]()
        for i in np.flatnonzero(self.is_present[row]):
            x, y, heading, vx, vy = self.people[row, i].tolist()
            present.append(Person((x, y), (vx, vy), heading, self.zones[i]))
        return self.states[row], self.scenario.goal, present

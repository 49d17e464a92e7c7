"""The parameters of the controller, and where each one comes from."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal, get_args

import numpy as np

from ..checks import check_array
from ..errors import SolverError

TOLERANCE = 1e-6
"""Largest violation of a hard row, in its own unit, that still counts as satisfied."""
Margin = Literal["euclidean", "paper"]
Side = Literal["right", "left"]
Solver = Literal["sqp", "ipopt"]
Terminal = Literal["none", "rest", "person"]


def _from(badge: str, default: Any) -> Any:
    return field(default=default, metadata={"badge": badge})


@dataclass(frozen=True)
class MPCSettings:
    """Every parameter of the controller; `MPCSettings.badges()` says where each default comes from.

    Parameters
    ----------
    dt : time step [s].
    N : steps of the prediction horizon.
    N_h : steps under barrier conditions, 1 <= N_h <= N; all N of them if there is a terminal condition.
    gamma : share of h that a step may use up, 0 < gamma <= 1.
    Q, P : weights of the state (x, y, vx, vy) against the goal, on the way and at the end, >= 0.
    R : weights of the accelerations (ax, ay), > 0.
    a_max : largest |ax| and |ay| [m/s2].
    v_max : largest Euclidean speed [m/s].
    r_robot : radius of the robot [m].
    eps : margin for the error of the approximate distances [m].
    margin : around walls: "euclidean", what each requires to stay clear of the robot's disc, and at least
        eps (`distances.wall_margin`); "paper", eps, which overlooks overlaps with the ends of walls shorter
        than r_robot^2 / eps.
    zone_speed : walking speed whose social zone is kept, where a zone depends on speed [m/s].
    pass_side : the robot's own hand on which it passes a person whom it meets head-on.
    tie : a meeting is head-on while the goal lies within this share of the half-angle under which the
        robot sees the person's zone; see `head_on.find_target`. At most 0.5.
    terminal : what the plan ends in: "none", as in the paper; "rest", zero velocity; "person", the
        velocity of the one person there is, in open space ("rest" while there is not exactly one; see
        `terminal_for`). See the proof in `szlib.control.mpc`.
    solver : "sqp", the condensed SQP of `szlib.control.solvers.sqp`, or "ipopt", as in the paper.
    slack_weight : penalty of slack [cost per m, and per m of distance to the goal (at least 1 m)],
        to which the multipliers of the barriers are in proportion.
    max_iterations : iterations that a solver may take before the next fallback of the ladder.
    time_limit : computing time of the step's thread after which the best plan so far, or full braking, is
        taken; see `Step.timed_out` [s]. `inf` for none. What other processes take does not count, so that
        runs stay the same on a busy machine.

    Raises
    ------
    SolverError : a value out of its range.
    """

    dt: float = _from("paper", 0.1)
    N: int = _from("paper", 8)
    N_h: int = _from("paper", 2)
    gamma: float = _from("measured", 0.05)
    Q: tuple[float, float, float, float] = _from("assumed", (10.0, 10.0, 1.0, 1.0))
    R: tuple[float, float] = _from("assumed", (1.0, 1.0))
    P: tuple[float, float, float, float] = _from("assumed", (100.0, 100.0, 10.0, 10.0))
    a_max: float = _from("assumed", 1.0)
    v_max: float = _from("paper", 1.0)
    r_robot: float = _from("paper", 0.5)
    eps: float = _from("paper", 0.05)
    margin: Margin = _from("measured", "euclidean")  # noqa: RUF009
    zone_speed: float = _from("paper", 1.1)
    pass_side: Side = _from("assumed", "right")  # noqa: RUF009
    tie: float = _from("assumed", 0.25)
    terminal: Terminal = _from("paper", "none")  # noqa: RUF009
    solver: Solver = _from("measured", "sqp")  # noqa: RUF009
    slack_weight: float = _from("measured", 1e5)
    max_iterations: int = _from("assumed", 100)
    time_limit: float = _from("assumed", 0.05)

    def __post_init__(self) -> None:
        for name, length in (("Q", 4), ("R", 2), ("P", 4)):
            weights = check_array(name, getattr(self, name), (length,))
            object.__setattr__(self, name, tuple(weights.tolist()))
        for name in ("N", "N_h", "max_iterations"):
            value = getattr(self, name)
            _require(isinstance(value, int | np.integer) and value >= 1, name, value, "a whole number >= 1")
        for name in ("dt", "gamma", "a_max", "v_max", "r_robot", "eps", "zone_speed", "tie", "slack_weight"):
            object.__setattr__(self, name, float(check_array(name, getattr(self, name), ())))
        for name in ("dt", "a_max", "v_max", "zone_speed", "slack_weight"):
            _require(getattr(self, name) > 0, name, getattr(self, name), "a positive number")
        for name in ("r_robot", "eps"):
            _require(getattr(self, name) >= 0, name, getattr(self, name), "a number >= 0")
        _require(0 < self.gamma <= 1, "gamma", self.gamma, "in (0, 1]")
        _require(self.N_h <= self.N, "N_h", self.N_h, f"at most N = {self.N}")
        _require(min(self.Q) >= 0, "Q", self.Q, "weights >= 0")
        _require(min(self.P) >= 0, "P", self.P, "weights >= 0")
        _require(min(self.R) > 0, "R", self.R, "weights > 0")
        self._check_choices()
        positive = isinstance(self.time_limit, int | float | np.number) and self.time_limit > 0
        _require(positive, "time_limit", self.time_limit, "a positive number of seconds, or inf")
        if self.terminal != "none":
            object.__setattr__(self, "N_h", self.N)
        _require(0 <= self.tie <= 0.5, "tie", self.tie, "in [0, 0.5]")

    def _check_choices(self) -> None:
        choices = {"margin": Margin, "pass_side": Side, "terminal": Terminal, "solver": Solver}
        for name, literal in choices.items():
            given, allowed = getattr(self, name), get_args(literal)
            _require(given in allowed, name, given, " or ".join(map(repr, allowed)))

    def terminal_for(self, n_people: int) -> Terminal:
        """What a plan among `n_people` ends in: "rest" in place of "person", unless there is one person."""
        return "rest" if self.terminal == "person" and n_people != 1 else self.terminal

    @classmethod
    def badges(cls) -> dict[str, str]:
        """Where each default comes from: 'paper', 'assumed' or 'measured'."""
        return {setting.name: setting.metadata["badge"] for setting in fields(cls)}


def _require(holds: bool | np.bool, name: str, value: Any, expected: str) -> None:
    if not holds:
        raise SolverError(f"{name} must be {expected}; got {value!r}")

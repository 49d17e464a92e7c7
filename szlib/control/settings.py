"""The parameters of the controller, and the source of each default."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import expm1, inf, log1p
from typing import Any, Literal, get_args

import numpy as np

from ..core.checks import Array, check_array, check_number, require
from ..core.errors import SolverError

# Raises SolverError: "`name` must be `expected`; got `value`".
check_argument = partial(require, error=SolverError)
TOLERANCE = 1e-6  # largest violation of a hard row, in its own unit, that still counts as satisfied
Margin = Literal["required", "euclidean", "paper"]
Side = Literal["right", "left"]
Terminal = Literal["none", "rest"]
_CHOICES = {
    "margin": Margin,
    "pass_side": Side,
    "terminal": Terminal,
    "guard": Literal[True, False],
}
_COUNTS = "N", "N_h", "max_iterations"
# settings that may be infinite
_LIMITS = "lookahead decay_price zone_price time_limit deadline"
_POSITIVE = 5e-324  # the smallest positive float
# Ranges of numbers: both ends, in words, and the names of the settings that must lie in it.
_RANGES = (
    (_POSITIVE, inf, "positive", f"dt R a_max v_max zone_speed {_LIMITS}"),
    (0.0, inf, "at least 0", "Q P jerk_weight r_robot eps body_gap"),
    (_POSITIVE, 1.0, "in (0, 1]", "gamma"),
    (0.0, 0.5, "in [0, 0.5]", "head_on_share"),
)


@dataclass(frozen=True)
class MPCSettings:
    """Every parameter of the controller.

    `MPCSettings()` has szlib's defaults, `MPCSettings.paper()` the paper's values to the letter. They differ
    in the margin around walls, the rule of the side, the guard and the time limit. What the paper does not
    give is tuned (gamma), measured (margin, guard) or assumed (Q, R, P, a_max, and whatever acts on the side,
    on bodies and on the computing time).

    Parameters
    ----------
    dt : time step [s].
    N : steps of the prediction horizon.
    N_h : steps with barrier conditions, 1 <= N_h <= N; all N if there is a terminal condition or a grid.
    grid : length of each step of the horizon, in multiples of `dt`, which sets N; the first is 1. Empty: N
        steps of `dt`.
    gamma : fraction of h that a step of dt may use up, 0 < gamma <= 1: with another dt it is another limit;
        see `with_gamma_rate`. The default was tuned on the paper's four scenarios (notebook 09).
    Q, P : weights of the state (x, y, vx, vy) against the goal, on the way and at the end, >= 0.
    R : weights of the accelerations (ax, ay), > 0.
    jerk_weight : weight of the squared change of acceleration from step to step, >= 0.
    a_max : largest |ax| and |ay| [m/s2]. A robot that stops in more time than it plans ahead, v_max / a_max,
        drives past its goal and comes back: at 2 m/s and 0.3 m/s2 `among_people()` goes 2.5 m too far. A
        longer `grid` helps (0.6 m with 6.6 s), a lower v_max as well.
    v_max : largest Euclidean speed [m/s]. The paper gives 1 m/s, and does not say that it is the Euclidean
        speed (assumed).
    r_robot : radius of the robot [m].
    lookahead : the plan heads for the point of the way that lies at most this far ahead [m]: see
        `szlib.control.ways`. `inf`, as in the paper: no way is looked for, and the plan heads for the goal.
        On a large map a new goal takes some 0.1 s, at most some 0.5 s; 1 s if r_robot + eps is nearly 0.
        The cells of a square map have 1/500 of its side, and at least 0.06 m. For a robot with
        r_robot + eps < 1.7 cells, a door narrower than 3 cells may be closed although it fits: narrower than
        0.18 m on a map of 30 m, and than 0.45 m on one of 75 m. A map ends 35 m beyond robot and goal, at
        the latest. Towards a goal that is 150 m away or more, wider doors may be closed: give a nearer one.
        A door that leaves only some mm to spare may be closed, too.
    eps : margin [m], for instance for the error of the approximate distances; see `margin`.
    margin : around walls. "euclidean": eps, in Euclidean distance. By the paper's distance (eq. 3-5), which
        is greater beyond the ends: "paper": eps, which allows overlaps with the ends of walls shorter
        than r_robot^2 / eps; "required": r_robot^2 / L around a wall of length L, and at least eps.
    zone_speed : walking speed whose social zone is used, if a zone depends on speed [m/s].
    pass_side : the side on which the robot prefers to pass a person whom it meets head-on: "right" or "left".
    head_on_share : a meeting is head-on while the goal lies within this share of the half-angle under which
        the robot sees the person's zone; the rule of the side acts up to twice this share. At most 0.5; 0
        switches the rule off, as in the paper. See `ways.find_target`.
    terminal : what the plan ends in. "none": nothing, as in the paper. "rest": zero velocity; see the proof
        in `szlib.control.mpc`.
    decay_price, zone_price : prices of a metre, and 0.1 s, of decay of h beyond gamma, and of h < 0 of a zone
        [cost per metre to the goal]. `inf`, as in the paper: violated only where no plan satisfies the row.
        Finite prices above 1e5 count as 1e5.
        A way may always lead through a zone (`szlib.control.ways`). If both prices are finite, the plan
        follows it through zones of people who stand.
    body_gap : gap to the bodies of people that has priority over zones and decay [m].
    guard : True: the robot brakes in a step whose plan might end in a wall or a body; see
        `szlib.control.mpc`. False, as in the paper.
    max_iterations : quadratic programs of a plan: see `szlib.control.planner`.
    time_limit : computing time of the step's thread after which the plan so far is used [s]; see
        `Step.timed_out`. `inf` for none. Time of other processes does not count, so that runs are the same on
        a busy machine.
    deadline : the same, counted by a clock on the wall from the call of `step` [s]: for a robot, whose next
        control is due whatever else its computer does. It is looked at between two quadratic programs; a
        problem of a new size is built first, once (with predictions up to some 0.5 s).

    Raises
    ------
    SolverError : a value is out of its range.

    Examples
    --------
    >>> import szlib
    >>> settings = szlib.MPCSettings(gamma=0.1, terminal="rest")
    >>> settings.N_h == settings.N  # a terminal condition needs barriers on the whole horizon
    True
    """

    dt: float = 0.1
    N: int = 8
    N_h: int = 2
    grid: tuple[int, ...] = ()
    gamma: float = 0.05
    Q: tuple[float, float, float, float] = (10.0, 10.0, 1.0, 1.0)
    R: tuple[float, float] = (1.0, 1.0)
    P: tuple[float, float, float, float] = (100.0, 100.0, 10.0, 10.0)
    jerk_weight: float = 0.0
    a_max: float = 1.0
    v_max: float = 1.0
    lookahead: float = inf
    r_robot: float = 0.5
    eps: float = 0.05
    margin: Margin = "required"
    zone_speed: float = 1.1
    pass_side: Side = "right"
    head_on_share: float = 0.25
    terminal: Terminal = "none"
    decay_price: float = inf
    zone_price: float = inf
    body_gap: float = 0.0
    guard: bool = True
    max_iterations: int = 100
    time_limit: float = 0.05
    deadline: float = inf

    def __post_init__(self) -> None:
        put = partial(object.__setattr__, self)
        for least, most, expected, names in _RANGES:
            for name in names.split():
                value = getattr(self, name)
                shape = np.shape(getattr(MPCSettings, name))
                if name in _LIMITS.split() and value == inf:
                    continue
                numbers = check_array(name, value, shape)
                is_within = ((least <= numbers) & (numbers <= most)).all()
                check_argument(is_within, name, value, expected)
                put(name, tuple(numbers.tolist()) if shape else float(numbers))
        for name in _COUNTS:
            value = getattr(self, name)
            is_count = isinstance(value, int | np.integer) and value >= 1
            check_argument(is_count, name, value, "a whole number >= 1")
        for name, choice in _CHOICES.items():
            value = getattr(self, name)
            allowed = get_args(choice)
            expected = " or ".join(map(repr, allowed))
            is_allowed = isinstance(value, str | bool | np.bool_) and value in allowed
            check_argument(is_allowed, name, value, expected)
        lengths = check_array("grid", self.grid, (np.size(self.grid),))
        grid = tuple(lengths.astype(int).tolist())
        put("grid", grid)
        put("guard", bool(self.guard))
        if grid:
            is_grid = grid[0] == 1 == min(grid) and self.terminal == "none"
            is_grid &= grid == tuple(lengths.tolist())
            expected = "whole numbers >= 1, the first 1, and no terminal condition"
            check_argument(is_grid, "grid", grid, expected)
            put("N", len(grid))
        if grid or self.terminal != "none":
            put("N_h", self.N)
        check_argument(self.N_h <= self.N, "N_h", self.N_h, f"at most N = {self.N}")

    @classmethod
    def paper(cls, **changes: Any) -> MPCSettings:
        """The paper's controller to the letter (eq. 2, sec. 4), with `changes` by name.

        A margin of 5 cm around every wall, no rule of the side, no guard, no time limit. The paper does not
        give gamma, Q, R, P and a_max: they are szlib's. Where a step has no solution, the plan violates walls
        as little as it can, then bodies, zones, and the decay (`szlib.control.planner`). The paper's solver,
        IPOPT, finds the same plans (notebook 08).

        Examples
        --------
        >>> import szlib
        >>> szlib.MPCSettings.paper(gamma=0.1).margin
        'paper'
        """
        own: dict[str, Any] = {
            "margin": "paper",
            "head_on_share": 0.0,
            "guard": False,
            "time_limit": inf,
        }
        return cls(**own | changes)

    @property
    def gamma_rate(self) -> float:
        """The rate at which h may fall, whatever dt is: h(t) >= h(0) exp(-gamma_rate t) [1/s]."""
        return -log1p(-self.gamma) / self.dt if self.gamma < 1 else inf

    def with_gamma_rate(self, rate: float) -> MPCSettings:
        """The same settings with the gamma that gives this `rate` [1/s] at their dt; see `gamma_rate`.

        Examples
        --------
        >>> import szlib
        >>> settings = szlib.MPCSettings(dt=0.2).with_gamma_rate(0.5)
        >>> round(settings.gamma, 4), settings.gamma_rate
        (0.0952, 0.5)
        """
        return replace(self, gamma=-expm1(-check_number("rate", rate) * self.dt))

    @classmethod
    def among_people(cls, **changes: Any) -> MPCSettings:
        """The controller that a robot should run among people, with `changes` by name.

        It plans 30 `dt` ahead (3 s with the default dt), in 14 steps with barriers on each, takes a way
        around walls and between people, to a point at most 1 m farther than it can come, and prefers a
        smooth ride. A decay of h beyond gamma has a price, and a zone a high one, so that the robot passes
        where people leave it no other way: see `Step.safe` and `Step.explain`. Distances to walls are
        Euclidean. Notebook 12 compares it with the paper's controller.

        Examples
        --------
        >>> import szlib
        >>> settings = szlib.MPCSettings.among_people(v_max=1.3)
        >>> settings.N, float(settings.times[-1].round(6))
        (14, 3.0)
        """
        own: dict[str, Any] = {
            "gamma": 0.1,
            "grid": (1,) * 4 + (2,) * 4 + (3,) * 6,
            "jerk_weight": 6.0,
            "decay_price": 10.0,
            "zone_price": 200.0,
            "body_gap": 0.2,
            "margin": "euclidean",
            "max_iterations": 8,
        }
        counts = {"N", "N_h"} & changes.keys()
        expected = "left out, because `grid` sets them; give `grid` instead"
        is_used = not (counts and changes.get("grid", True))
        check_argument(is_used, "N and N_h", changes, expected)
        chosen = cls(**own | changes)
        farther = 1.0 + chosen.times[-1] * chosen.v_max
        return replace(chosen, lookahead=changes.get("lookahead", farther))

    @cached_property
    def step_lengths(self) -> tuple[int, ...]:
        """Length of each step of the horizon, in multiples of `dt`, N numbers."""
        return self.grid or (1,) * self.N

    @cached_property
    def times(self) -> Array:
        """Time of each state of the plan, from now, shape (N+1,), read-only [s]."""
        times = self.dt * np.cumsum((0, *self.step_lengths))
        times.flags.writeable = False
        return times

"""The parameters of the controller, and the source of each default."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from itertools import accumulate
from math import expm1, inf, log1p
from typing import Any, Literal, get_args

import numpy as np

from ..core.checks import check_array, check_number, require
from ..core.errors import SolverError

_require = partial(require, error=SolverError)
TOLERANCE = 1e-6  # largest violation of a hard row, in its own unit, that still counts as satisfied
Margin = Literal["euclidean", "paper"]
Side = Literal["right", "left"]
Solver = Literal["sqp", "ipopt"]
Terminal = Literal["none", "rest"]


def _setting(badge: str, default: Any, **paper: Any) -> Any:
    """A default and its source; `paper`: the value that the paper has instead."""
    return field(default=default, metadata={"badge": badge, **paper})


def _check_numbers(
    settings: Any, expected: str, holds: Callable[[float], bool], *names: str
) -> None:
    """Make the settings of these names floats; SolverError unless each `holds` what is `expected`."""
    for name in names:
        object.__setattr__(
            settings,
            name,
            value := float(check_array(name, getattr(settings, name), ())),
        )
        _require(holds(value), name, value, expected)


@dataclass(frozen=True)
class MPCSettings:
    """Every parameter of the controller.

    `MPCSettings()` has szlib's defaults, `MPCSettings.paper()` the paper's values to the letter.  They differ
    in the solver, the margin around walls, the rule of the side and the time limit.  `badges` gives the
    source of each value.

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
    a_max : largest |ax| and |ay| [m/s2].
    v_max : largest Euclidean speed [m/s]. The paper gives 1 m/s, and does not say that it is the Euclidean
        speed (assumed).
    r_robot : radius of the robot [m].
    lookahead : the plan heads for the point of the way that lies at most this far ahead [m]: see
        `szlib.control.ways`. `inf`, as in the paper: no way is looked for, and the plan heads for the goal.
        On a large map a new goal takes some 0.1 s.
    eps : margin for the error of the approximate distances [m].
    margin : around walls. "euclidean": what each wall requires so that the robot does not touch it, and at
        least eps (see `Wall.margin`). "paper": eps, which allows overlaps with the ends of walls shorter
        than r_robot^2 / eps.
    zone_speed : walking speed whose social zone is used, if a zone depends on speed [m/s].
    pass_side : the side on which the robot prefers to pass a person whom it meets head-on: "right" or "left".
    head_on_share : a meeting is head-on while the goal lies within this share of the half-angle under which
        the robot sees the person's zone; the rule of the side acts up to twice this share. At most 0.5; 0
        switches the rule off, as in the paper. See `ways.find_target`.
    terminal : what the plan ends in. "none": nothing, as in the paper. "rest": zero velocity; see the proof
        in `szlib.control.mpc`.
    decay_price, zone_price : prices of a metre, and 0.1 s, of decay of h beyond gamma, and of h < 0 of a zone
        [cost per metre to the goal]. `inf`, as in the paper: violated only where no plan satisfies the row.
    body_gap : gap to the bodies of people that has priority over zones and decay [m].
    guard : True: the robot brakes in a step whose plan might end in a wall or a body; see
        `szlib.control.mpc`. False, as in the paper.
    solver : "sqp", the quadratic programs of `szlib.control.planner`, or "ipopt", as in the paper.
    max_iterations : iterations of a solver.
    time_limit : computing time of the step's thread after which the plan so far is used [s]; see
        `Step.timed_out`. `inf` for none. Time of other processes does not count, so that runs are the same on
        a busy machine.
    deadline : the same, counted by a clock on the wall from the call of `step` [s]: for a robot, whose next
        control is due whatever else its computer does. A solver looks at it between two iterations.

    Raises
    ------
    SolverError : a value is out of its range.

    Examples
    --------
    >>> import szlib
    >>> settings = szlib.MPCSettings(gamma=0.1, terminal="rest")
    >>> settings.N_h == settings.N  # a terminal condition needs barriers on the whole horizon
    True
    >>> settings.badges()["dt"], settings.badges()["gamma"]
    ('paper', 'chosen')
    """

    dt: float = _setting("paper", 0.1)
    N: int = _setting("paper", 8)
    N_h: int = _setting("paper", 2)
    grid: tuple[int, ...] = _setting("paper", ())
    gamma: float = _setting("tuned", 0.05)
    Q: tuple[float, float, float, float] = _setting("assumed", (10.0, 10.0, 1.0, 1.0))
    R: tuple[float, float] = _setting("assumed", (1.0, 1.0))
    P: tuple[float, float, float, float] = _setting(
        "assumed", (100.0, 100.0, 10.0, 10.0)
    )
    jerk_weight: float = _setting("paper", 0.0)
    a_max: float = _setting("assumed", 1.0)
    v_max: float = _setting("paper", 1.0)
    lookahead: float = _setting("paper", np.inf)
    r_robot: float = _setting("paper", 0.5)
    eps: float = _setting("paper", 0.05)
    margin: Margin = _setting("measured", "euclidean", paper="paper")  # noqa: RUF009
    zone_speed: float = _setting("paper", 1.1)
    pass_side: Side = _setting("assumed", "right")  # noqa: RUF009
    head_on_share: float = _setting("assumed", 0.25, paper=0.0)
    terminal: Terminal = _setting("paper", "none")  # noqa: RUF009
    decay_price: float = _setting("paper", np.inf)
    zone_price: float = _setting("paper", np.inf)
    body_gap: float = _setting("assumed", 0.0)
    guard: bool = _setting("measured", True, paper=False)
    solver: Solver = _setting("measured", "sqp", paper="ipopt")  # noqa: RUF009
    max_iterations: int = _setting("assumed", 100)
    time_limit: float = _setting("assumed", 0.05, paper=np.inf)
    deadline: float = _setting("assumed", np.inf)

    def __post_init__(self) -> None:
        for name, length in (("Q", 4), ("R", 2), ("P", 4)):
            weights = check_array(name, getattr(self, name), (length,))
            object.__setattr__(self, name, tuple(weights.tolist()))
        object.__setattr__(
            self, "grid", grid := tuple(operator.index(length) for length in self.grid)
        )
        if grid:
            is_grid = grid[0] == 1 and min(grid) >= 1 and self.terminal == "none"
            _require(
                is_grid,
                "grid",
                grid,
                "whole numbers >= 1, the first 1, and no terminal condition",
            )
            object.__setattr__(self, "N", len(grid))
            object.__setattr__(self, "N_h", len(grid))
        for name in ("N", "N_h", "max_iterations"):
            value = getattr(self, name)
            _require(
                isinstance(value, int | np.integer) and value >= 1,
                name,
                value,
                "a whole number >= 1",
            )
        positive = "dt", "a_max", "v_max", "zone_speed"
        _check_numbers(self, "a positive number", lambda v: v > 0, *positive)
        _check_numbers(
            self,
            "a number >= 0",
            lambda v: v >= 0,
            "r_robot",
            "eps",
            "jerk_weight",
            "body_gap",
        )
        _check_numbers(self, "in (0, 1]", lambda v: 0 < v <= 1, "gamma")
        _check_numbers(self, "in [0, 0.5]", lambda v: 0 <= v <= 0.5, "head_on_share")
        _require(self.N_h <= self.N, "N_h", self.N_h, f"at most N = {self.N}")
        _require(min(self.Q) >= 0, "Q", self.Q, "weights >= 0")
        _require(min(self.P) >= 0, "P", self.P, "weights >= 0")
        _require(min(self.R) > 0, "R", self.R, "weights > 0")
        choices = {
            "margin": Margin,
            "pass_side": Side,
            "terminal": Terminal,
            "solver": Solver,
        }
        for name, literal in choices.items():
            given, allowed = getattr(self, name), get_args(literal)
            _require(given in allowed, name, given, " or ".join(map(repr, allowed)))
        for name, unit in (
            ("time_limit", "seconds"),
            ("deadline", "seconds"),
            ("lookahead", "metres"),
            ("decay_price", "cost"),
            ("zone_price", "cost"),
        ):
            is_positive = (
                isinstance(value := getattr(self, name), int | float | np.number)
                and value > 0
            )
            _require(is_positive, name, value, f"a positive number of {unit}, or inf")
        if self.terminal != "none":
            object.__setattr__(self, "N_h", self.N)

    @classmethod
    def paper(cls, **changes: Any) -> MPCSettings:
        """The paper's controller to the letter (eq. 2, sec. 4), with `changes` by name.

        IPOPT, a margin of 5 cm around every wall, no rule of the side, no time limit.  The paper does not
        give gamma, Q, R, P and a_max: they are szlib's (see `badges`), as is what happens if a step has no
        solution.

        Examples
        --------
        >>> import szlib
        >>> szlib.MPCSettings.paper(gamma=0.1).solver
        'ipopt'
        """
        differing = {
            f.name: f.metadata["paper"] for f in fields(cls) if "paper" in f.metadata
        }
        return cls(**{**differing, **changes})

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

        It plans 3 s ahead, in 14 steps with barriers on each, takes a way around walls and between people, to
        a point at most 1 m farther than it can come, and prefers a smooth ride. A decay of h beyond gamma has
        a price, and a zone a high one, so that the robot passes where people leave it no other way: see
        `Step.safe` and `Step.explain`. Notebook 12 compares it with the paper's controller.

        Examples
        --------
        >>> import szlib
        >>> settings = szlib.MPCSettings.among_people(v_max=1.3)
        >>> settings.N, round(settings.times[-1], 6)
        (14, 3.0)
        """
        grid = (1,) * 4 + (2,) * 4 + (3,) * 6
        reach = sum(grid) * changes.get("dt", cls.dt) * changes.get("v_max", cls.v_max)
        own = {"gamma": 0.2, "grid": grid, "jerk_weight": 6.0, "lookahead": reach + 1.0}
        own |= {"decay_price": 10.0, "zone_price": 400.0, "body_gap": 0.2}
        own |= {"max_iterations": 8}
        return cls(**{**own, **changes})

    @cached_property
    def step_lengths(self) -> tuple[int, ...]:
        """Length of each step of the horizon, in multiples of `dt`, N numbers."""
        return self.grid or (1,) * self.N

    @cached_property
    def times(self) -> tuple[float, ...]:
        """Time of each state of the plan, from now, N+1 numbers [s]."""
        return tuple(self.dt * k for k in accumulate(self.step_lengths, initial=0))

    def badges(self) -> dict[str, str]:
        """The source of each value, by name.

        "paper", "assumed", "measured", "tuned" (on the paper's four scenarios), or "chosen" by the user.
        """
        badges = {}
        for each in fields(self):
            value = getattr(self, each.name)
            badges[each.name] = (
                each.metadata["badge"] if value == each.default else "chosen"
            )
            if value == each.metadata.get("paper", object()):
                badges[each.name] = "paper"
        return badges

"""Comparisons on identical worlds: controllers, zones, formulations and behaviours of people.

Each zone of the literature is an `Ellipse` in the person's frame, made from the fitted one where it
depends on it.  Each formulation is a set of settings.  Each behaviour violates one expectation of the
controller.

Sources: E. T. Hall, "The Hidden Dimension", 1966 (personal distance up to 1.2 m); R. Kirby, R. Simmons,
J. Forlizzi, "COMPANION: A constraint-optimizing method for person-acceptable navigation", RO-MAN 2009
(asymmetric Gaussian); metrics after A. Francis et al., "Principles and guidelines for evaluating social
robot navigation algorithms", 2023.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from itertools import product
from math import pi, sqrt
from typing import Any

import numpy as np
import pandas as pd

from ..control.people import as_ellipse
from ..control.settings import MPCSettings
from ..control.verification import euclidean_to_ellipse
from ..core.checks import Array
from ..core.errors import SolverError
from ..zones.ellipses import Ellipse
from ..zones.enclosing_ellipse import minimum_enclosing_ellipse_of_curve
from .baseline_controllers import (
    DynamicWindowController,
    SocialForceController,
    StraightController,
)
from .closed_loop import BODY_ZONE, ZoneTransform
from .monte_carlo import ControllerFactory, ScenarioSource, make_mpc_cbf, rollouts
from .run import Run
from .scenario import Behaviour, CrowdModel
from .scenarios.random_worlds import Worlds

HALL_PERSONAL = 1.2
"""Largest personal distance [m] (Hall 1966)."""
KIRBY_SPEED = 0.5
"""Walking speed of Kirby's zone [m/s]: that of the people (paper, sec. 4)."""


def keep_zone(fitted: Ellipse) -> Ellipse:
    """The `fitted` ellipse itself."""
    return fitted


def use_body(fitted: Ellipse) -> Ellipse:
    """A person's body (`BODY_ZONE`) in place of the `fitted` ellipse: a distance constraint."""
    return BODY_ZONE


def use_equal_circle(fitted: Ellipse) -> Ellipse:
    """A circle around the person with the area of the `fitted` ellipse."""
    radius = sqrt(fitted.area / pi)
    return Ellipse((0.0, 0.0), (radius, radius))


def use_hall_circle(fitted: Ellipse) -> Ellipse:
    """Hall's personal distance in place of the `fitted` ellipse."""
    return Ellipse((0.0, 0.0), (HALL_PERSONAL, HALL_PERSONAL))


def use_kirby_ellipse(fitted: Ellipse) -> Ellipse:
    """The smallest ellipse around `kirby_curve` at `KIRBY_SPEED`, in place of the `fitted` ellipse."""
    return _fit_kirby_ellipse()


def kirby_curve(angles: Array, speed: float) -> Array:
    """The one-sigma line of Kirby's asymmetric Gaussian, shape (n, 2) [m].

    Sigma is 2 v ahead, at least 1/2; 2/3 of this to the sides, and 1/2 of it behind.

    Parameters
    ----------
    angles : directions, shape (n,) [rad].
    speed : walking speed v [m/s].
    """
    ahead = max(2 * speed, 0.5)
    x, y = np.cos(angles), np.sin(angles)
    return np.column_stack([ahead * np.where(x > 0, x, x / 2), ahead * 2 / 3 * y])


@lru_cache
def _fit_kirby_ellipse() -> Ellipse:
    return minimum_enclosing_ellipse_of_curve(
        partial(kirby_curve, speed=KIRBY_SPEED), [-pi / 2, pi / 2]
    )


ZONES: Mapping[str, ZoneTransform] = {
    "none": use_body,
    "equal circle": use_equal_circle,
    "Hall": use_hall_circle,
    "Kirby": use_kirby_ellipse,
    "fitted": keep_zone,
}
"""Zones that the robot keeps out of, by name."""

FORMULATIONS: Mapping[str, MPCSettings] = {
    "paper": MPCSettings.paper(),
    "szlib": MPCSettings(),
    "whole horizon": MPCSettings(N_h=MPCSettings.N),
    "rest": MPCSettings(terminal="rest"),
}
"""Settings by name: the paper's to the letter, szlib's defaults, and two changes of them."""

BEHAVIOURS: Mapping[str, Behaviour] = {
    "as expected": Behaviour(),
    "speeds up": Behaviour(pace=2.0),
    "turns": Behaviour(turn=pi / 2),
    "stops": Behaviour(pace=0.0),
    "seen 10 cm off": Behaviour(noise=0.1),
}
"""How people move, or how the controller sees them, by name."""

CONTROLLERS: Mapping[str, ControllerFactory] = {
    "MPC-CBF": make_mpc_cbf,
    "straight": StraightController,
    "social force": SocialForceController,
    "dynamic window": DynamicWindowController,
}
"""Controllers, by name."""

# columns of `compare` that name a method
METHOD = ("controller", "zone", "formulation", "behaviour")

WORLDS = Worlds(people=(3, 5), size=8.0, travel=(4.0, 8.0), start_speed=0.0, min_h=1.0)
"""Worlds with space for each of the zones at the start and at the goal: the robot starts outside all."""

METRICS = (
    "success",
    "time_to_goal",
    "path_length",
    "time_stopped",
    "jerk",
    "min_clearance",
    *(f"inside {name}" for name in ZONES),
    "flagged_steps",
    "unflagged_violations",
)
"""Columns that are compared; seconds, metres, m2/s6, steps."""


def measure_time_inside(run: Run) -> dict[str, float]:
    """Time for which the robot's disc of a `run` overlaps a zone of each kind, by Euclidean distance [s].

    The fitted zones are those of the scenario's people, whatever zones the robot keeps out of.  People
    without a zone in the scenario have the one that the robot keeps out of.
    """
    own = [person.zone for person in run.scenario.people] or [None] * len(run.zones)
    fitted = [
        as_ellipse(each or zone, run.settings.zone_speed)
        for each, zone in zip(own, run.zones, strict=True)
    ]
    inside = {}
    for name, zone in ZONES.items():
        gaps = run.distances_to_zones(
            [zone(each) for each in fitted], euclidean_to_ellipse
        )
        # NaN, of absent people, is no overlap
        overlaps = (gaps < run.settings.r_robot).any(axis=1)
        inside[f"inside {name}"] = run.settings.dt * float(overlaps.sum())
    return inside


def compare(
    n: int,
    *,
    controllers: Sequence[str] | Mapping[str, ControllerFactory] = ("MPC-CBF",),
    zones: Sequence[str] | Mapping[str, ZoneTransform] = tuple(ZONES),
    formulations: Sequence[str] | Mapping[str, MPCSettings] = tuple(FORMULATIONS),
    behaviours: Sequence[str] | Mapping[str, CrowdModel] = ("as expected",),
    worlds: ScenarioSource = WORLDS,
    **options: Any,
) -> pd.DataFrame:
    """Drive through the same n worlds with each combination of methods.

    Parameters
    ----------
    n, worlds : as of `rollouts`.
    options : `seed`, `out`, `n_jobs` and `progress` of `rollouts`.
    controllers : names in `CONTROLLERS`, or a mapping from names of your own to controller factories.
    zones : names in `ZONES`, or a mapping to zone transforms.
    formulations : names in `FORMULATIONS`, or a mapping to settings.
    behaviours : names in `BEHAVIOURS`, or a mapping to crowd models.

    Returns
    -------
    The rows of `rollouts`, with the columns `METHOD` and the time in each of `ZONES`.

    Raises
    ------
    SolverError : a name is unknown.

    Examples
    --------
    >>> import szlib
    >>> worlds = szlib.Worlds(duration=1.0)
    >>> table = szlib.simulation.compare(
    ...     1, zones=["none", "fitted"], formulations=["szlib"], worlds=worlds, progress=False
    ... )
    >>> table[["zone", "formulation", "seed"]].to_numpy().tolist()
    [['none', 'szlib', 0], ['fitted', 'szlib', 0]]
    """
    methods = (controllers, zones, formulations, behaviours)
    tables = []
    for names in product(
        *map(_resolve_names, methods, (CONTROLLERS, ZONES, FORMULATIONS, BEHAVIOURS))
    ):
        (_, controller), (_, zone), (_, settings), (_, behaviour) = names
        robot = {"settings": settings, "controller": controller, "zone_transform": zone}
        people = {"worlds": worlds, "behaviour": behaviour}
        table = rollouts(n, **robot, **people, measure=measure_time_inside, **options)
        tables.append(
            table.assign(**dict(zip(METHOD, (name for name, _ in names), strict=True)))
        )
    return pd.concat(tables, ignore_index=True)


def _resolve_names(
    given: Sequence[str] | Mapping[str, Any], known: Mapping[str, Any]
) -> list[tuple[str, Any]]:
    """Names and the objects that they stand for."""
    if isinstance(given, Mapping):
        return list(given.items())
    if unknown := sorted(set(given) - set(known)):
        raise SolverError(
            f"unknown names: {', '.join(unknown)}; expected {', '.join(known)}, or a mapping"
        )
    return [(name, known[name]) for name in given]


def summarise(
    rows: pd.DataFrame,
    by: Sequence[str] = METHOD,
    metrics: Sequence[str] = METRICS,
    *,
    against: Mapping[str, str] | None = None,
    level: float = 0.95,
    resamples: int = 2000,
    seed: int = 0,
) -> pd.DataFrame:
    """Means over worlds, with percentile bootstrap intervals.

    A bootstrap sample draws worlds, each with the runs of all methods: comparisons are paired.

    Parameters
    ----------
    rows : rows of `compare`.
    by : columns that name a method.
    metrics : columns to average; worlds without a value (no time to a goal that is not reached) are left out.
    against : the method, such as {"zone": "fitted"}, that is subtracted from all others in each world;
        columns that are not named keep their own value.
    level : level of the intervals.
    resamples : number of bootstrap samples.
    seed : seed of the bootstrap.

    Returns
    -------
    One row for each method and metric: `by`, metric, mean, low, high, n (number of worlds with a value), and
    first, the value in the first world; NaN without a value.

    Raises
    ------
    SolverError : the level is not in (0, 1), or the number of samples is not positive.
    """
    if not 0 < level < 1 or resamples < 1:
        raise SolverError(
            f"level must be in (0, 1) and resamples positive; got {level}, {resamples}"
        )
    values = rows.set_index(["seed", *by])[list(metrics)].astype(float)
    if against is not None:
        rest = [name for name in by if name not in against]
        base = rows[(rows[list(against)] == pd.Series(against)).all(axis=1)]
        values = values - base.set_index(["seed", *rest])[list(metrics)].astype(float)
        values = values.reorder_levels(["seed", *by])
    wide = values.unstack(list(by))
    drawn = np.random.default_rng(seed).integers(len(wide), size=(resamples, len(wide)))
    counts = np.stack([np.bincount(row, minlength=len(wide)) for row in drawn])
    weight = counts @ wide.notna().to_numpy()
    means = np.full(weight.shape, np.nan)
    np.divide(counts @ wide.fillna(0.0).to_numpy(), weight, out=means, where=weight > 0)
    low, high = (
        pd.DataFrame(means).quantile([(1 - level) / 2, (1 + level) / 2]).to_numpy()
    )
    table = pd.DataFrame(wide.columns.tolist(), columns=["metric", *by])
    table = table.assign(
        mean=np.asarray(wide.mean()), low=low, high=high, n=np.asarray(wide.count())
    )
    return table.assign(first=wide.iloc[0].to_numpy())[
        [*by, "metric", "mean", "low", "high", "n", "first"]
    ]

"""The fitted zone against what people would otherwise use, on identical worlds.

Each zone from the literature is an `Ellipse` in the person's frame, made from the fitted one where it
depends on it; each formulation is a set of settings; each behaviour is a way to be wrong about people.

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
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from ..checks import Array
from ..control.distances import euclidean_to_ellipse
from ..control.person import BODY_RADIUS, as_ellipse
from ..control.settings import MPCSettings
from ..errors import SolverError
from ..zones.ellipses import Ellipse
from ..zones.enclosing_ellipse import minimum_enclosing_ellipse_of_curve
from .baseline_controllers import dynamic_window, social_force, straight
from .closed_loop import Zones
from .log import SimulationLog
from .monte_carlo import Scenes, mpc_cbf, rollouts
from .robots import ControllerFactory
from .scenario import Behaviour, CrowdModel
from .scenarios.random_worlds import Worlds

HALL_PERSONAL = 1.2
"""Far end of the personal distance [m] (Hall 1966)."""
KIRBY_PACE = 0.5
"""Walking speed for which Kirby's zone is taken [m/s]: that of the people (paper, sec. 4)."""


def own_zone(fitted: Ellipse) -> Ellipse:
    """The fitted ellipse itself."""
    return fitted


def no_zone(fitted: Ellipse) -> Ellipse:
    """A person's body alone: a distance constraint (`BODY_RADIUS`)."""
    return Ellipse((0.0, 0.0), (BODY_RADIUS, BODY_RADIUS))


def equal_circle(fitted: Ellipse) -> Ellipse:
    """A circle around the person with the fitted ellipse's area."""
    radius = sqrt(fitted.area / pi)
    return Ellipse((0.0, 0.0), (radius, radius))


def hall_circle(fitted: Ellipse) -> Ellipse:
    """Hall's personal distance."""
    return Ellipse((0.0, 0.0), (HALL_PERSONAL, HALL_PERSONAL))


def kirby_ellipse(fitted: Ellipse) -> Ellipse:
    """The smallest ellipse around the one-sigma line of Kirby's asymmetric Gaussian at `KIRBY_PACE`."""
    return _kirby(KIRBY_PACE)


def kirby_curve(angles: Array, pace: float) -> Array:
    """Kirby's one-sigma line, shape (n, 2) [m]: sigma 2 v ahead, at least 1/2; to the sides 2/3 of it,
    and 1/2 of it behind."""
    ahead = max(2 * pace, 0.5)
    x, y = np.cos(angles), np.sin(angles)
    return np.column_stack([ahead * np.where(x > 0, x, x / 2), ahead * 2 / 3 * y])


@lru_cache
def _kirby(pace: float) -> Ellipse:
    return minimum_enclosing_ellipse_of_curve(lambda angles: kirby_curve(angles, pace), [-pi / 2, pi / 2])


ZONES: Mapping[str, Zones] = MappingProxyType(
    {
        "none": no_zone,
        "equal circle": equal_circle,
        "Hall": hall_circle,
        "Kirby": kirby_ellipse,
        "fitted": own_zone,
    }
)
"""What a controller may keep out of, by name."""

FORMULATIONS: Mapping[str, MPCSettings] = MappingProxyType(
    {
        "paper": MPCSettings(),
        "whole horizon": MPCSettings(N_h=MPCSettings.N),
        "rest": MPCSettings(terminal="rest"),
    }
)
"""How long the barriers hold in the plan, and what it ends in, by name."""

BEHAVIOURS: Mapping[str, Behaviour] = MappingProxyType(
    {
        "as expected": Behaviour(),
        "speeds up": Behaviour(pace=2.0),
        "turns": Behaviour(turn=pi / 2),
        "stops": Behaviour(pace=0.0),
        "seen 10 cm off": Behaviour(noise=0.1),
    }
)
"""What people do, or how they are seen, by name."""

CONTROLLERS: Mapping[str, ControllerFactory] = MappingProxyType(
    {
        "MPC-CBF": mpc_cbf,
        "straight": straight,
        "social force": social_force,
        "dynamic window": dynamic_window,
    }
)
"""What drives the robot, by name."""

METHOD = ("controller", "zone", "formulation", "behaviour")
"""Columns of `compare` that name a method."""

WORLDS = Worlds(people=(3, 5), size=8.0, travel=(4.0, 8.0), start_speed=0.0, min_h=1.0)
"""Room enough at the start and at the goal for every one of the zones: nobody begins inside one."""

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


def measure_time_inside(log: SimulationLog) -> dict[str, float]:
    """Seconds for which the robot's disc overlapped anybody's zone of each kind, Euclidean.

    The fitted zones are those of the world, whatever the controller kept; those that were kept for people
    of whom the world says nothing.
    """
    own = [person.zone for person in log.scenario.people] or [None] * len(log.zones)
    fitted = [
        as_ellipse(each or zone, log.settings.zone_speed) for each, zone in zip(own, log.zones, strict=True)
    ]
    inside = {}
    for name, zone in ZONES.items():
        gaps = [
            log.distance_to_person(i, partial(euclidean_to_ellipse, ellipse=zone(each)))
            - log.settings.r_robot
            for i, each in enumerate(fitted)
        ]
        overlaps = np.fmin.reduce(np.reshape(gaps, (-1, len(log.states))), initial=np.inf) < 0
        inside[f"inside {name}"] = log.settings.dt * float(overlaps.sum())
    return inside


def compare(
    n: int,
    *,
    seed: int = 0,
    controllers: Sequence[str] | Mapping[str, ControllerFactory] = ("MPC-CBF",),
    zones: Sequence[str] | Mapping[str, Zones] = tuple(ZONES),
    formulations: Sequence[str] | Mapping[str, MPCSettings] = tuple(FORMULATIONS),
    behaviours: Sequence[str] | Mapping[str, CrowdModel] = ("as expected",),
    worlds: Scenes = WORLDS,
    out: str | Path | None = None,
    n_jobs: int = -1,
    progress: bool = True,
) -> pd.DataFrame:
    """Drive through the same n worlds in every combination; rows of `rollouts`, each with its names.

    Parameters
    ----------
    controllers, zones, formulations, behaviours : names in `CONTROLLERS`, `ZONES`, `FORMULATIONS`,
        `BEHAVIOURS`, or a mapping from names of your own to factories, zones, settings, crowd models.
    n, seed, worlds, out, n_jobs, progress : as of `rollouts`.

    Raises
    ------
    SolverError : an unknown name.
    """
    given = (controllers, zones, formulations, behaviours)
    tables = []
    for names in product(*map(_by_name, given, (CONTROLLERS, ZONES, FORMULATIONS, BEHAVIOURS))):
        (_, controller), (_, zone), (_, settings), (_, behaviour) = names
        table = rollouts(
            n,
            seed=seed,
            settings=settings,
            worlds=worlds,
            behaviour=behaviour,
            controller=controller,
            zones=zone,
            measure=measure_time_inside,
            out=out,
            n_jobs=n_jobs,
            progress=progress,
        )
        tables.append(table.assign(**dict(zip(METHOD, (name for name, _ in names), strict=True))))
    return pd.concat(tables, ignore_index=True)


def _by_name(given: Sequence[str] | Mapping[str, Any], known: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Names and what they stand for."""
    if isinstance(given, Mapping):
        return list(given.items())
    if unknown := sorted(set(given) - set(known)):
        raise SolverError(
            f"unknown: {', '.join(unknown)}; there are {', '.join(known)}; for your own give a mapping"
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
    """Means over worlds with percentile bootstrap intervals; worlds are drawn, and with them all methods.

    Parameters
    ----------
    rows : as from `compare`.
    by : columns that name a method.
    metrics : columns to average; a world that lacks one (no time to a goal never reached) is left out.
    against : the method, such as {"zone": "fitted"}, that is subtracted world by world first; columns
        not named keep their own value.
    level, resamples, seed : of the intervals.

    Returns
    -------
    One row each method and metric: `by`, metric, mean, low, high, n (worlds that count); NaN if none does.
    """
    if not 0 < level < 1 or resamples < 1:
        raise SolverError(f"level must be in (0, 1) and resamples positive; got {level}, {resamples}")
    values = rows.set_index(["seed", *by])[list(metrics)].astype(float)
    if against is not None:
        rest = [name for name in by if name not in against]
        base = rows[(rows[list(against)] == pd.Series(against)).all(axis=1)]
        values = values - base.set_index(["seed", *rest])[list(metrics)].astype(float)
        values = values.reorder_levels(["seed", *by])
    wide = values.unstack(list(by))
    drawn = np.random.default_rng(seed).integers(len(wide), size=(resamples, len(wide)))
    counts = np.stack([np.bincount(row, minlength=len(wide)) for row in drawn])
    data, there = wide.fillna(0.0).to_numpy(), wide.notna().to_numpy()
    weight = counts @ there
    means = np.divide(counts @ data, weight, out=np.full(weight.shape, np.nan), where=weight > 0)
    some = np.asarray(there.any(axis=0))
    low, high = bounds = np.full((2, len(some)), np.nan)
    bounds[:, some] = np.nanquantile(means[:, some], [(1 - level) / 2, (1 + level) / 2], axis=0)
    table = pd.DataFrame(wide.columns.tolist(), columns=["metric", *by])
    mean = np.where(some, data.sum(axis=0) / np.maximum(there.sum(axis=0), 1), np.nan)
    table = table.assign(mean=mean, low=low, high=high, n=there.sum(axis=0))
    return table[[*by, "metric", "mean", "low", "high", "n"]]

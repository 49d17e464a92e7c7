"""One drive through a world in arrays: every state, what was flagged, and how it ended.

Leaner than `simulate`, which makes a table row of each step, and not for people at constant velocity
only; the whole time of the world is driven, beyond the arrival, so that a robot that rests at its goal
may still have to make room.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from ..control.barriers import Array, barrier, ellipse_distance, segment_distance
from ..control.distances import euclidean_to_segment
from ..control.mpc import MPCCBF, Rung
from ..control.people import Person, as_ellipse
from ..control.problem import TOLERANCE
from ..control.settings import MPCSettings
from ..errors import SolverError
from ..zones.ellipses import Ellipse
from .closed_loop import BODY_RADIUS, GOAL_RADIUS, STOPPED, Scenario, advance
from .worlds import Behaviour

Outcome = Literal[
    "arrived", "hit wall", "run into", "squeezed", "drove in", "boxed in", "deadlock", "out of time"
]
"""How a run ended; see `outcome`."""
Zones = Callable[[Ellipse], Ellipse]
"""What the controller keeps in place of a person's own zone, made from it."""
CROWDED = 0.2
"""Two barriers below this h at once leave a robot no way out [m] (assumed)."""
AT_LAST = 3.0
"""A robot that stood for so long at the end has stopped for good [s] (assumed)."""
_CELL = 0.1
"""Grid on which a way to the goal is looked for [m]."""
_AROUND = 2.5
"""How far around everything it reaches: enough for a zone and the robot beside it [m]."""


@dataclass(frozen=True)
class Run:
    """One drive through one world.

    Attributes
    ----------
    scenario : the world, its people with their own zones.
    kept : the zone of each person that the controller kept, in the person's frame; h is about these.
    settings : of the controller.
    states : (x, y, vx, vy) at each time, shape (n+1, 4) [m, m/s].
    controls : shape (n, 2) [m/s2].
    people : (x, y, heading) of everybody as they truly were, shape (n+1, P, 3) [m, rad].
    rung : `Step.rung` of each step, shape (n,).
    safe : `Step.safe` of each step, shape (n,): False is a flag.
    slack : largest violation of a hard row by each plan, shape (n,).
    solve_time : of each step, shape (n,) [s].
    arrived : index of the first state at rest at the goal; None if there is none.
    """

    scenario: Scenario
    kept: tuple[Ellipse, ...]
    settings: MPCSettings
    states: Array
    controls: Array
    people: Array
    rung: NDArray[np.str_]
    safe: NDArray[np.bool_]
    slack: Array
    solve_time: Array
    arrived: int | None

    @cached_property
    def relative(self) -> Array:
        """The robot in each person's frame at each time, shape (n+1, P, 2) [m]."""
        offset = self.states[:, None, :2] - self.people[:, :, :2]
        cos, sin = np.cos(self.people[:, :, 2]), np.sin(self.people[:, :, 2])
        ahead = offset[..., 0] * cos + offset[..., 1] * sin
        return np.stack([ahead, offset[..., 1] * cos - offset[..., 0] * sin], axis=-1)

    @cached_property
    def h(self) -> Array:
        """True barriers, people before walls, shape (n+1, P+W) [m]."""
        d = [ellipse_distance(self.relative[:, i], zone) for i, zone in enumerate(self.kept)]
        d += [segment_distance(self.states[:, :2], *wall) for wall in self.scenario.walls]
        distances = np.reshape(d, (len(d), len(self.states))).T
        return np.asarray(barrier(distances, self.settings.r_robot, self.settings.eps))

    @cached_property
    def clearance(self) -> Array:
        """Euclidean gaps from the robot's disc to bodies and walls, shape (n+1, P+W) [m]."""
        to_people = np.hypot(self.relative[..., 0], self.relative[..., 1]) - BODY_RADIUS
        to_walls = [euclidean_to_segment(self.states[:, :2], *wall) for wall in self.scenario.walls]
        gaps = [*to_people.T, *to_walls]
        return np.reshape(gaps, (len(gaps), len(self.states))).T - self.settings.r_robot


def drive(
    scenario: Scenario,
    settings: MPCSettings,
    behaviour: Behaviour | None = None,
    seed: int = 0,
    zones: Zones | None = None,
) -> Run:
    """Drive through a scenario to its end, among people who may do what is not expected.

    `zones` makes what the controller keeps from each person's own zone; `seed` is of the behaviour.

    Raises
    ------
    SolverError : a person has no zone of their own, or the goal cannot be reached.
    """
    behaviour, dt = behaviour or Behaviour(), settings.dt
    own = [own_ellipse(person, settings) for person in scenario.people]
    kept = tuple(own if zones is None else map(zones, own))
    people = tuple(replace(p, zone=zone) for p, zone in zip(scenario.people, kept, strict=True))
    unused = Ellipse((0.0, 0.0), (1.0, 1.0))  # everybody has a zone of their own
    controller = MPCCBF(unused, walls=scenario.walls, settings=settings, max_people=len(people))
    times = np.linspace(0, scenario.duration, round(scenario.duration / dt) + 1)
    paths, rng = behaviour.paths(people, times.tolist(), seed), np.random.default_rng([seed, 2])
    states, steps = [scenario.start.copy()], []
    for now in paths[:-1]:
        step = controller.step(states[-1], scenario.goal, behaviour.seen(now, rng))
        steps.append(step)
        states.append(advance(states[-1], step.control, dt))
    true = [[(*p.position, p.heading) for p in now] for now in paths]
    way = np.array(states) - np.r_[scenario.goal, 0.0, 0.0]
    there = (np.hypot(way[:, 0], way[:, 1]) <= GOAL_RADIUS) & (np.hypot(way[:, 2], way[:, 3]) <= STOPPED)
    return Run(
        scenario=scenario,
        kept=kept,
        settings=settings,
        states=np.array(states),
        controls=np.array([step.control for step in steps]),
        people=np.reshape(np.array(true, float), (len(states), len(people), 3)),
        rung=np.array([step.rung for step in steps]),
        safe=np.array([step.safe for step in steps]),
        slack=np.array([step.slack for step in steps]),
        solve_time=np.array([step.solve_time for step in steps]),
        arrived=int(there.argmax()) if there.any() else None,
    )


def metrics(run: Run) -> dict[str, Any]:
    """A row of `rollouts`, in s, m, m/s; inf where there is nothing to keep clear of.

    people, walls : how many.
    success, outcome : came to rest at the goal; and `outcome(run)`.
    time_to_goal : NaN without success.
    path_length, time_stopped, jerk : until the arrival; slower than `STOPPED` after it first was faster;
        mean squared change of acceleration over time [m2/s6].
    min_h, min_h_people, min_h_walls, min_clearance : at any state, with people as they truly were.
    warm, cold, kept, relaxed, braking : steps that each rung of the ladder gave.
    infeasible : steps whose plan violates the hard problem.
    flagged : steps that say that they are not safe.
    silent : steps that said they were safe and led to h < 0.
    max_slack : of any step.
    solve_time_median, solve_time_p99, solve_time_max : of `Step.solve_time`.
    """
    dt, n_people = run.settings.dt, len(run.scenario.people)
    way = slice(None if run.arrived is None else run.arrived + 1)
    speed = np.hypot(run.states[way, 2], run.states[way, 3])
    moved = np.maximum.accumulate(speed > STOPPED)
    change = np.diff(run.controls[way], axis=0)
    worst = run.h.min(axis=1, initial=np.inf)
    return {
        "people": n_people,
        "walls": len(run.scenario.walls),
        "success": run.arrived is not None,
        "outcome": outcome(run),
        "time_to_goal": np.nan if run.arrived is None else dt * run.arrived,
        "path_length": float(np.hypot(*np.diff(run.states[way, :2], axis=0).T).sum()),
        "time_stopped": dt * int((moved & (speed < STOPPED))[:-1].sum()),
        "jerk": float((change**2).sum(axis=1).mean() / dt**2) if len(change) else 0.0,
        "min_h": float(worst.min()),
        "min_h_people": float(run.h[:, :n_people].min(initial=np.inf)),
        "min_h_walls": float(run.h[:, n_people:].min(initial=np.inf)),
        "min_clearance": float(run.clearance.min(initial=np.inf)),
        **{rung: int((run.rung == rung).sum()) for rung in get_args(Rung)},
        "infeasible": int((run.slack > TOLERANCE).sum()),
        "flagged": int((~run.safe).sum()),
        "silent": int((run.safe & (worst[1:] < -TOLERANCE)).sum()),
        "max_slack": float(run.slack.max()),
        "solve_time_median": float(np.median(run.solve_time)),
        "solve_time_p99": float(np.quantile(run.solve_time, 0.99)),
        "solve_time_max": float(run.solve_time.max()),
    }


def outcome(run: Run) -> Outcome:
    """How a run ended; where a barrier was broken, how that began.

    "arrived", or where h fell below 0 first: "hit wall"; "run into", by a person who came nearer while
    the robot did so less; "squeezed", the same with another barrier close by (`CROWDED`); "drove in",
    the robot did it. Where it never did: "boxed in", stopped where no way leads to the goal;
    "deadlock", stopped where one does; "out of time", still on its way.
    """
    broken = np.flatnonzero(run.h.min(axis=1, initial=np.inf) < -TOLERANCE)
    if len(broken):
        return _breach(run, int(broken[0]))
    if run.arrived is not None:
        return "arrived"
    last = round(AT_LAST / run.settings.dt)
    if np.hypot(*run.states[-last:, 2:].T).max() > STOPPED:
        return "out of time"
    return "deadlock" if way_exists(run) else "boxed in"


def _breach(run: Run, k: int) -> Outcome:
    """Who broke the barrier at state k."""
    i = int(run.h[k].argmin())
    if i >= len(run.scenario.people):
        return "hit wall"
    before = max(k - 1, 0)
    away = run.states[before, :2] - run.people[before, i, :2]
    away = away / np.hypot(*away)
    walked = (run.people[k, i, :2] - run.people[before, i, :2]) @ away
    drove = -(run.states[k, :2] - run.states[before, :2]) @ away
    if drove > walked:
        return "drove in"
    return "squeezed" if (run.h[k] < CROWDED).sum() > 1 else "run into"


def way_exists(run: Run) -> bool:
    """True if h >= 0 all along some way from the robot to the goal, with everybody where they are at last."""
    ends = np.array([run.states[-1, :2], run.scenario.goal])
    everything = np.vstack([ends, run.people[-1, :, :2], run.scenario.walls.reshape(-1, 2)])
    low, high = everything.min(axis=0) - _AROUND, everything.max(axis=0) + _AROUND
    axes = [np.arange(low[i], high[i], _CELL) for i in range(2)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    s, free = run.settings, np.ones(grid.shape[:2], bool)
    for zone, (x, y, heading) in zip(run.kept, run.people[-1], strict=True):
        free &= barrier(ellipse_distance(grid, zone.placed((x, y), heading)), s.r_robot, s.eps) >= 0
    for wall in run.scenario.walls:
        free &= barrier(segment_distance(grid, *wall), s.r_robot, s.eps) >= 0
    here, there = np.round((ends - low) / _CELL).astype(int)
    regions = label(free, structure=np.ones((3, 3)))[0]
    around = [regions[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] for i, j in (here, there)]
    return bool(set(np.unique(around[0])) & set(np.unique(around[1])) - {0})


def own_ellipse(person: Person, settings: MPCSettings) -> Ellipse:
    """A person's own zone; SolverError for a person who has none."""
    if person.zone is None:
        raise SolverError(f"every person of a run needs a zone of their own; the one at {person.position}")
    return as_ellipse(person.zone, settings.zone_speed)

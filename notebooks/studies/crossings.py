"""CrowdNav's circle crossings, for which other people publish results: the table 29_crossings.csv.

python -m studies.crossings           the table as it is saved: some 15 min on one core
python -m studies.crossings --n 20    the first 20 worlds

Five people walk across a circle of 4 m radius by ORCA and do not see the robot, which crosses it as well.
Places, numbers and rules are those of C. Chen et al., "Crowd-robot interaction: crowd-aware robot navigation
with attention-based deep reinforcement learning", ICRA 2019; the code is our own.  CrowdNav's robot has any
velocity at once; szlib's controllers drive a double integrator, and decide once or twice in each 0.25 s.
The time steps, accelerations and zones of the table were tried on the seeds 0 to 99 (CrowdNav's validation),
which are not in it.
"""

from __future__ import annotations

from itertools import product
from math import hypot

import numpy as np
import pandas as pd
import pyrvo
from scipy.stats import binomtest
from studies.committed import read_arguments, study, write_table

import szlib
from szlib.control.controller import Controller, advance
from szlib.core.checks import Array
from szlib.simulation.baseline_controllers import CONTROLLERS
from szlib.simulation.scenario import Scenario

# Radius of the robot and of people [m]; time step and time limit [s]: CrowdNav ends 1 s before its 25 s.
RADIUS, DT, END = 0.3, 0.25, 24.0
# People in a world, the seed of CrowdNav's first test, and the number of its tests.
PEOPLE, FIRST, WORLDS = 5, 1000, 500
START, GOAL = np.array([0.0, -4.0]), np.array([0.0, 4.0])
ZONES = {
    "body": szlib.Ellipse((0.0, 0.0), (RADIUS, RADIUS)),
    "learned": szlib.reference_zone("grand-central-strangers").ellipse,
}
SCENARIO = Scenario("crossing", np.array([*START, 0.0, 0.0]), GOAL, (szlib.Person((0.0, 0.0)),) * PEOPLE)
BY = ("controller", "zone", "dt", "a_max")
SIMPLE, PAPER, OURS = ("social force", "dynamic window"), "MPC-CBF, paper", "MPC-CBF, among people"
# Controller, zone, time step [s] and largest acceleration [m/s2] of each row of the table.
ROWS = [
    ("ORCA", "body", DT, np.inf),
    *((name, "body", dt, 4.0) for name, dt in product(SIMPLE, (DT, DT / 2))),
    *((PAPER, zone, dt, a_max) for zone, dt, a_max in product(ZONES, (DT, DT / 2), (1.0, 4.0))),
    *((OURS, zone, DT, a_max) for zone, a_max in product(ZONES, (1.0, 4.0))),
    (OURS, "body", DT / 2, 4.0),
]


def place_people(seed: int) -> Array:
    """Where people start, shape (PEOPLE, 2) [m]; they walk to the opposite point."""
    rng = np.random.RandomState(seed)
    placed: list[Array] = []
    while len(placed) < PEOPLE:
        angle, *shift = rng.random_sample(3) * (2 * np.pi, 1, 1) - (0, 0.5, 0.5)
        at = 4 * np.array([np.cos(angle), np.sin(angle)]) + shift
        taken = [START, GOAL, *placed, *(-each for each in placed)]
        if min(hypot(*(at - each)) for each in taken) >= 2 * RADIUS + 0.2:
            placed.append(at)
    return np.array(placed)


class Orca:
    """Agents who avoid each other by ORCA, with CrowdNav's numbers."""

    def __init__(self, n: int) -> None:
        near = (10.0, 10, 5.0, 5.0)
        self._sim = pyrvo.RVOSimulator(DT, *near, RADIUS + 0.01, 1.0)
        for _ in range(n):
            self._sim.add_agent((0.0, 0.0), *near, RADIUS + 0.01, 1.0, (0.0, 0.0))

    def velocities(self, at: Array, velocities: Array, goals: Array) -> Array:
        """Next velocities of agents `at` points who have `velocities` and head for `goals`, all (n, 2)."""
        offset = goals - at
        preferred = offset / np.maximum(np.hypot(*offset.T), 1.0)[:, None]
        for i in range(len(at)):
            self._sim.set_agent_position(i, at[i].tolist())
            self._sim.set_agent_velocity(i, velocities[i].tolist())
            self._sim.set_agent_pref_velocity(i, preferred[i].tolist())
        self._sim.do_step()
        return np.array([self._sim.get_agent_velocity(i).to_tuple() for i in range(len(at))], float)


class OrcaRobot(Orca):
    """The first of the agents is a robot that sees everybody; its velocity changes at once."""

    def move(self, state: Array, at: Array, velocities: Array) -> Array:
        """States of the robot in the next `DT`, shape (n, 4), from its `state`, and people `at` points."""
        everyone, moving = np.vstack([state[:2], at]), np.vstack([state[2:], velocities])
        velocity = self.velocities(everyone, moving, np.vstack([GOAL, at]))[0]
        return np.concatenate([state[:2] + DT * velocity, velocity])[None]


class SzlibRobot:
    """A double integrator, driven by a `controller` of szlib, which sees people with a `zone`."""

    def __init__(self, controller: Controller, zone: szlib.Ellipse, dt: float) -> None:
        self._controller, self._zone, self._dt = controller, zone, dt

    def move(self, state: Array, at: Array, velocities: Array) -> Array:
        """As `OrcaRobot.move`, for `state`, `at` and `velocities`; the controller may step more often."""
        moving = enumerate(zip(at.tolist(), velocities.tolist(), strict=True))
        seen = [szlib.Person(tuple(p), velocity=tuple(v), zone=self._zone, id=i) for i, (p, v) in moving]
        path = [state]
        for k in range(round(DT / self._dt)):
            people = [person.after(k * self._dt) for person in seen]
            control = self._controller.step(path[-1], GOAL, people).control
            path.append(advance(path[-1], control, self._dt))
        return np.array(path[1:])


def cross(seed: int, robot: OrcaRobot | SzlibRobot) -> tuple[str, float]:
    """How the crossing of a world ends, and when [s]."""
    at, orca = place_people(seed), Orca(PEOPLE)
    goals, velocities, state = -at, np.zeros((PEOPLE, 2)), np.array([*START, 0.0, 0.0])
    for k in range(round(END / DT)):
        path = np.vstack([state, robot.move(state, at, velocities)])
        times = np.linspace(0, DT, len(path))[:, None, None]
        # as in CrowdNav, a collision is looked for with the velocity that people had so far
        if nearest(at + times * velocities - path[:, None, :2]) < 2 * RADIUS:
            return "collision", (k + 1) * DT
        state = path[-1]
        if hypot(*(state[:2] - GOAL)) < RADIUS:
            return "success", (k + 1) * DT
        velocities = orca.velocities(at, velocities, goals)
        at = at + DT * velocities
    return "time-out", END


def nearest(offsets: Array) -> float:
    """Smallest distance of the origin to the segments between consecutive `offsets`, (n, people, 2) [m]."""
    begin, along = offsets[:-1], np.diff(offsets, axis=0)
    share = -(begin * along).sum(axis=2) / np.maximum((along**2).sum(axis=2), 1e-18)
    share = np.clip(share, 0, 1)[..., None]
    return float(np.hypot(*np.moveaxis(begin + share * along, 2, 0)).min())


def find_settings(controller: str, dt: float, a_max: float) -> szlib.MPCSettings:
    """Settings of a `controller` at another `dt`, with the same limit of decay per second."""
    eps = 0.1 if controller in CONTROLLERS else 0.05  # a body has 0.25 m for the former
    limits = {"dt": dt, "a_max": a_max, "r_robot": RADIUS, "eps": eps, "time_limit": np.inf}
    if controller == OURS:
        # 3 s; the lookahead with which the table was made
        limits |= {"grid": (1,) * 12, "lookahead": 8.5} if dt == DT else {}
        among = szlib.MPCSettings.among_people
        return among(body_gap=0.25, **limits).with_gamma_rate(among().gamma_rate)
    paper = szlib.MPCSettings.paper
    return paper(**limits).with_gamma_rate(paper().gamma_rate)


def find_robot(controller: str, zone: str, dt: float, a_max: float) -> OrcaRobot | SzlibRobot:
    """A new robot for a row of the table."""
    if controller == "ORCA":
        return OrcaRobot(PEOPLE + 1)
    make = CONTROLLERS.get(controller, CONTROLLERS["MPC-CBF"])
    return SzlibRobot(make(SCENARIO, find_settings(controller, dt, a_max)), ZONES[zone], dt)


@study("29_crossings", notebook="29")
def recompute(row: pd.Series) -> dict[str, float]:
    """When the crossing of the first world of a row ends, again."""
    return {"probe": cross(FIRST, find_robot(*row[list(BY)]))[1]}


def main(n: int) -> None:
    table = []
    for by in ROWS:
        crossings = [cross(FIRST + k, find_robot(*by)) for k in range(n)]
        ends, times = (pd.Series(column) for column in zip(*crossings, strict=True))
        row = dict(zip(BY, by, strict=True))
        for name in ("success", "collision", "time-out"):
            hits = int((ends == name).sum())
            low, high = binomtest(hits, n).proportion_ci(method="wilson")
            row |= {name: hits / n, f"{name}_low": low, f"{name}_high": high}
        table.append(row | {"mean_time": times[ends == "success"].mean(), "n": n, "probe": times[0]})
        print(*by, row["success"], row["collision"], flush=True)
    write_table(pd.DataFrame(table), "29_crossings", seed=FIRST)


if __name__ == "__main__":
    main(read_arguments(__doc__, n=WORLDS).n)

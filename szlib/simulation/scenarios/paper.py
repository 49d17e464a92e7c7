"""The four scenarios of the paper (fig. 6) as data, with what the paper claims of each as a check.

The paper gives no coordinates. They are assumed, so as to show a person who stands or walks at
0.5 m/s (sec. 4) in the way of a robot that starts at rest. World frame, metres and seconds.
"""

from __future__ import annotations

from math import pi

import numpy as np

from ...control.mpc import MPCCBF
from ...control.person import Person
from ..closed_loop import simulate
from ..log import SimulationLog
from ..metrics import find_avoidance_start, find_passing_side, locate_along_course
from ..scenario import GOAL_RADIUS, Claim, Scenario
from ..strategies import MIN_RETREAT, MIN_WAIT

WELL_BEFORE = 0.5
"""Avoidance that starts at this h starts well before the zone [m] (assumed)."""
BESIDE = 1.0
"""A person no farther ahead or behind than this is being passed [m] (assumed)."""
SLOWED = 0.8
"""Below this share of its greatest speed the robot has slowed down (assumed)."""
MOUTH = 0.0
"""x of the near end of the restricted pathway [m]."""

_CORRIDOR = np.array([[(-6.0, y), (7.0, y)] for y in (2.3, -2.3)])
_PATHWAY = np.array(
    [[(MOUTH, y), (MOUTH + 3.0, y)] for y in (1.0, -1.0)]
    + [[(MOUTH, y), (MOUTH, 4.0 * y)] for y in (1.0, -1.0)]
)


def _avoids_earlier_head_on(log: SimulationLog) -> tuple[bool, float]:
    """How much farther away [m]."""
    head_on = find_avoidance_start(log)[0]
    controller = MPCCBF(log.zones[0], walls=log.scenario.walls, settings=log.settings)
    from_behind = find_avoidance_start(simulate(log.scenario.turn_people(), controller))[0]
    return head_on > from_behind, head_on - from_behind


def _avoids_well_before(log: SimulationLog) -> tuple[bool, float]:
    """h where avoidance starts [m]."""
    h = find_avoidance_start(log)[1]
    return h > WELL_BEFORE, h


def _passes_on_chosen_side(log: SimulationLog) -> tuple[bool, float]:
    """How far to the robot's left the person is when abeam [m]."""
    ahead, left = locate_along_course(log, 0)
    return find_passing_side(log) == log.settings.pass_side, float(left[np.abs(ahead).argmin()])


def _slows_while_passing(log: SimulationLog) -> tuple[bool, float]:
    """Least speed beside the person, as a share of the greatest speed."""
    speed = log.table["speed"].to_numpy()
    beside = np.abs(locate_along_course(log, 0)[0]) <= BESIDE
    share = float(speed[beside].min() / speed.max()) if beside.any() else np.nan
    return share < SLOWED, share


def _waits(log: SimulationLog) -> tuple[bool, float]:
    """How long the robot yields [s], without having to go back."""
    waited = float(log.metrics()["time_yielding"])
    return waited >= MIN_WAIT and _retreat(log) < GOAL_RADIUS, waited


def _makes_room(log: SimulationLog) -> tuple[bool, float]:
    """How far the robot goes back behind its start [m]."""
    return _retreat(log) >= MIN_RETREAT, _retreat(log)


def _retreat(log: SimulationLog) -> float:
    return float(log.scenario.start[0] - log.table["x"].min())


def _lets_person_out_first(log: SimulationLog) -> tuple[bool, float]:
    """Time from the person's leaving the pathway to the robot's entering it for good [s]."""
    table = log.table
    person_out = table["t"][table["person_0_x"] <= MOUTH]
    robot_out = table["t"][table["x"] < MOUTH]
    if person_out.empty or robot_out.empty or not log.success:
        return False, np.nan
    between = float(robot_out.iloc[-1] - person_out.iloc[0])
    return between > 0, between


def _goes_on(log: SimulationLog) -> tuple[bool, float]:
    """Time to the goal [s]."""
    return log.success, float(log.metrics()["time_to_goal"])


_CHOSEN_SIDE = Claim("The robot passes the person on the chosen side.", _passes_on_chosen_side)
_OUT_FIRST = Claim("It enters the pathway after the person has left it.", _lets_person_out_first)
_GOES_ON = Claim("Then it goes on to its goal.", _goes_on)

_ALL = (
    Scenario(
        name="passing",
        title="Passing a stationary person",
        start=np.array([-4.0, 0.0, 0.0, 0.0]),
        goal=np.array([4.0, 0.0]),
        people=(Person((0.0, 0.0), heading=pi),),
        claims=(
            Claim("Avoidance starts farther away head-on than from behind.", _avoids_earlier_head_on),
            Claim("Avoidance starts well before the zone.", _avoids_well_before),
            _CHOSEN_SIDE,
        ),
    ),
    Scenario(
        name="corridor",
        title="Avoiding a person in a narrow corridor",
        start=np.array([-4.0, 0.0, 0.0, 0.0]),
        goal=np.array([4.0, 0.0]),
        people=(Person((4.0, 0.0), (-0.5, 0.0)),),
        walls=_CORRIDOR,
        claims=(Claim("The robot slows down while passing.", _slows_while_passing), _CHOSEN_SIDE),
    ),
    Scenario(
        name="waiting",
        title="Yielding in a restricted pathway (1): waiting",
        start=np.array([-2.0, -1.5, 0.0, 0.0]),
        goal=np.array([6.0, 0.0]),
        people=(Person((4.0, 0.0), (-0.5, 0.0)),),
        walls=_PATHWAY,
        claims=(Claim("The robot waits.", _waits), _OUT_FIRST, _GOES_ON),
    ),
    Scenario(
        name="making_room",
        title="Yielding in a restricted pathway (2): making room",
        start=np.array([1.2, 0.0, 0.0, 0.0]),
        goal=np.array([6.0, 0.0]),
        people=(Person((5.0, 0.0), (-0.5, 0.0)),),
        walls=_PATHWAY,
        claims=(
            Claim("The robot is in the way and goes back to make room.", _makes_room),
            _OUT_FIRST,
            _GOES_ON,
        ),
    ),
)

SCENARIOS: dict[str, Scenario] = {scenario.name: scenario for scenario in _ALL}
"""The four scenarios of the paper, by name: passing, corridor, waiting, making_room."""

"""The four scenarios of the paper (fig. 6), each with checks of what the paper claims of it.

The paper gives no coordinates.  They are assumed: a person stands, or walks at 0.5 m/s (sec. 4), in the
way of a robot that starts at rest.  World frame, metres and seconds.

The side on which the robot passes is not among the claims: nothing in the paper's formulation prefers one
(see `szlib.control.ways`).

>>> import szlib
>>> list(szlib.SCENARIOS)
['passing', 'corridor', 'waiting', 'making_room']
"""

from __future__ import annotations

from math import pi

import numpy as np

from ...control.mpc import MPCCBF
from ...control.people import Person
from ..closed_loop import simulate
from ..metrics import compute_metrics, find_avoidance_start, locate_along_course
from ..run import Run
from ..scenario import GOAL_RADIUS, Claim, Scenario
from ..strategies import MIN_RETREAT, MIN_WAIT

# avoidance that starts above this h starts well before the zone [m] (assumed)
EARLY_H = 0.5
PASSING_DISTANCE = 1.0  # the robot passes a person who is within this distance ahead or behind [m] (assumed)
# below this fraction of its greatest speed the robot has slowed down (assumed)
SLOW_FRACTION = 0.8
MOUTH = 0.0  # x of the near end of the restricted pathway [m]

_CORRIDOR = np.array([[(-6.0, y), (7.0, y)] for y in (2.3, -2.3)])
_PATHWAY = np.array(
    [[(MOUTH, y), (MOUTH + 3.0, y)] for y in (1.0, -1.0)]
    + [[(MOUTH, y), (MOUTH, 4.0 * y)] for y in (1.0, -1.0)]
)


def _avoids_earlier_head_on(run: Run) -> tuple[bool, float]:
    """Difference of the two distances [m]."""
    head_on = find_avoidance_start(run)[0]
    controller = MPCCBF(run.zones[0], walls=run.scenario.walls, settings=run.settings)
    from_behind = find_avoidance_start(
        simulate(run.scenario.turn_people(), controller)
    )[0]
    return head_on > from_behind, head_on - from_behind


def _avoids_well_before(run: Run) -> tuple[bool, float]:
    """h where avoidance starts [m]."""
    h = find_avoidance_start(run)[1]
    return h > EARLY_H, h


def _slows_while_passing(run: Run) -> tuple[bool, float]:
    """Smallest speed beside the person, as a fraction of the greatest speed."""
    beside = np.abs(locate_along_course(run, 0)[0]) <= PASSING_DISTANCE
    fraction = (
        float(run.speed[beside].min() / run.speed.max()) if beside.any() else np.nan
    )
    return fraction < SLOW_FRACTION, fraction


def _waits(run: Run) -> tuple[bool, float]:
    """Time for which the robot yields [s], without going back."""
    waited = float(compute_metrics(run)["time_yielding"])
    return waited >= MIN_WAIT and _retreat_from_start(run) < GOAL_RADIUS, waited


def _makes_room(run: Run) -> tuple[bool, float]:
    """Distance by which the robot goes back behind its start [m]."""
    retreat = _retreat_from_start(run)
    return retreat >= MIN_RETREAT, retreat


def _retreat_from_start(run: Run) -> float:
    return float(run.scenario.start[0] - run.states[:, 0].min())


def _lets_person_out_first(run: Run) -> tuple[bool, float]:
    """Time from the person's leaving of the pathway to the robot's last entering [s]."""
    person_outside = run.time[run.people[:, 0, 0] <= MOUTH]
    robot_outside = run.time[run.states[:, 0] < MOUTH]
    if not (len(person_outside) and len(robot_outside) and run.success):
        return False, np.nan
    between = float(robot_outside[-1] - person_outside[0])
    return between > 0, between


def _goes_on(run: Run) -> tuple[bool, float]:
    """Time to the goal [s]."""
    return run.success, float(compute_metrics(run)["time_to_goal"])


_OUT_FIRST = Claim(
    "The robot enters the pathway after the person has left it.", _lets_person_out_first
)
_GOES_ON = Claim("The robot goes on to its goal.", _goes_on)

_SCENARIOS = (
    Scenario(
        name="passing",
        title="Passing a stationary person",
        start=np.array([-4.0, 0.0, 0.0, 0.0]),
        goal=np.array([4.0, 0.0]),
        people=(Person((0.0, 0.0), heading=pi),),
        claims=(
            Claim(
                "Avoidance starts farther away head-on than from behind.",
                _avoids_earlier_head_on,
            ),
            Claim("Avoidance starts well before the zone.", _avoids_well_before),
        ),
    ),
    Scenario(
        name="corridor",
        title="Avoiding a person in a narrow corridor",
        start=np.array([-4.0, 0.0, 0.0, 0.0]),
        goal=np.array([4.0, 0.0]),
        people=(Person((4.0, 0.0), (-0.5, 0.0)),),
        walls=_CORRIDOR,
        claims=(Claim("The robot slows down while passing.", _slows_while_passing),),
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

SCENARIOS: dict[str, Scenario] = {scenario.name: scenario for scenario in _SCENARIOS}
"""The four scenarios of the paper, by name: passing, corridor, waiting, making_room."""

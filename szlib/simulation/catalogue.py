"""The named scenarios: those of the paper (fig. 6), with its claims, and standard meetings with people.

Neither source gives coordinates, speeds or walls; they are assumed.  In the paper's scenarios a person
stands, or walks at 0.5 m/s (sec. 4), in the way of a robot that starts at rest.  The side on which the robot
passes is not among the claims: nothing in the paper's formulation prefers one (see `szlib.control.ways`).
In the meetings people walk at about 0.5 m/s and do not react; without people the robot drives straight from
start to goal; two who pass have just enough space for a zone of 1.0 x 0.7 m.

>>> import szlib
>>> szlib.SCENARIOS["passing"].title
'Passing a stationary person'
>>> szlib.MEETINGS["overtaking"].title
'A person walks ahead, at 0.3 m/s'

Source of the meetings: A. Francis et al., "Principles and guidelines for evaluating social robot navigation
algorithms", ACM Transactions on Human-Robot Interaction 14(2), 2025, fig. 7.  World frame, metres and
seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, pi, sin

import numpy as np

from ..control import MPCCBF, Person
from .closed_loop import simulate
from .metrics import (
    MIN_RETREAT,
    MIN_WAIT,
    compute_metrics,
    find_avoidance_start,
    locate_along_course,
)
from .robot_run import Run
from .scenario import GOAL_RADIUS, Claim, Scenario

# avoidance that starts above this h starts well before the zone [m] (assumed)
EARLY_H = 0.5
PASSING_DISTANCE = 1.0  # the robot passes a person who is within this distance ahead or behind [m] (assumed)
# below this fraction of its greatest speed the robot has slowed down (assumed)
SLOW_FRACTION = 0.8
MOUTH = 0.0  # x of the near end of the restricted pathway [m]


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

WALKING_SPEED = 0.5  # speed of people who walk [m/s] (paper, sec. 4)
Place = tuple[float, float]


def _walker(at: Place, to: Place, speed: float = WALKING_SPEED) -> Person:
    """A person who walks from one place towards another."""
    offset = np.subtract(to, at)
    vx, vy = (speed * offset / np.hypot(*offset)).tolist()
    return Person(at, (vx, vy))


def _hall(
    half_width: float, begin: float = -8.0, end: float = 8.0
) -> list[tuple[Place, Place]]:
    """The two walls of a hall along x."""
    return [((begin, y), (end, y)) for y in (half_width, -half_width)]


def _door(half_width: float, end: float) -> list[tuple[Place, Place]]:
    """The two walls beside a door at x = `MOUTH`; they end at y = `end` and -`end`."""
    ends = ((half_width, end), (-half_width, -end))
    return [((MOUTH, near), (MOUTH, far)) for near, far in ends]


def _corner(x: float, y: float, right: float, up: float) -> list[tuple[Place, Place]]:
    """The two walls of a corner at (x, y); they lead right (or left: -1) and up (or down: -1)."""
    return [((x, y), (right * 8.0, y)), ((x, y), (x, up * 6.0))]


def _circle(n: int, radius: float) -> list[Place]:
    """Places on a circle, one straight ahead."""
    angles = np.arange(n) * 2 * pi / n
    return [(radius * cos(angle), radius * sin(angle)) for angle in angles]


def _crossing_walker(at: Place, distance: float = 0.7) -> Person:
    """A person who crosses a circle and passes its centre on the right."""
    x, y = at
    shift = distance / np.hypot(x, y)
    return _walker(at, (y * shift, -x * shift), 0.8)


def _scene(
    name: str,
    title: str,
    people: Sequence[Person],
    walls: Sequence[tuple[Place, Place]] = (),
    *,
    start: Place = (-5.0, 0.0),
    goal: Place = (5.0, 0.0),
    duration: float = 40.0,
    claims: Sequence[Claim] = (),
) -> Scenario:
    """A scenario of a robot that starts at rest."""
    return Scenario(
        name=name,
        title=title,
        start=np.array([*start, 0.0, 0.0]),
        goal=np.array(goal),
        people=tuple(people),
        walls=np.reshape(walls, (-1, 2, 2)),
        duration=duration,
        claims=tuple(claims),
    )


_PATHWAY = [*_hall(1.0, MOUTH, MOUTH + 3.0), *_door(1.0, 4.0)]
_SCENARIOS = (
    _scene(
        "passing",
        "Passing a stationary person",
        [Person((0.0, 0.0), heading=pi)],
        start=(-4.0, 0.0),
        goal=(4.0, 0.0),
        duration=60.0,
        claims=[
            Claim(
                "Avoidance starts farther away head-on than from behind.",
                _avoids_earlier_head_on,
            ),
            Claim("Avoidance starts well before the zone.", _avoids_well_before),
        ],
    ),
    _scene(
        "corridor",
        "Avoiding a person in a narrow corridor",
        [Person((4.0, 0.0), (-0.5, 0.0))],
        _hall(2.3, -6.0, 7.0),
        start=(-4.0, 0.0),
        goal=(4.0, 0.0),
        duration=60.0,
        claims=[Claim("The robot slows down while passing.", _slows_while_passing)],
    ),
    _scene(
        "waiting",
        "Yielding in a restricted pathway (1): waiting",
        [Person((4.0, 0.0), (-0.5, 0.0))],
        _PATHWAY,
        start=(-2.0, -1.5),
        goal=(6.0, 0.0),
        duration=60.0,
        claims=[Claim("The robot waits.", _waits), _OUT_FIRST, _GOES_ON],
    ),
    _scene(
        "making_room",
        "Yielding in a restricted pathway (2): making room",
        [Person((5.0, 0.0), (-0.5, 0.0))],
        _PATHWAY,
        start=(1.2, 0.0),
        goal=(6.0, 0.0),
        duration=60.0,
        claims=[
            Claim("The robot is in the way and goes back to make room.", _makes_room),
            _OUT_FIRST,
            _GOES_ON,
        ],
    ),
)

SCENARIOS = {scenario.name: scenario for scenario in _SCENARIOS}
"""The scenarios of the paper, by name; another scenario is one more entry."""

_MEETINGS = (
    _scene(
        "frontal approach",
        "A person comes straight towards the robot",
        [_walker((5.0, 0.0), (-5.0, 0.0))],
    ),
    _scene(
        "pedestrian obstruction",
        "A person stands in the way",
        [Person((0.0, 0.0), heading=pi)],
        _hall(2.5),
    ),
    _scene(
        "narrow hallway",
        "A person comes along a hallway 3.2 m wide, on their right",
        [_walker((6.0, 0.7), (-6.0, 0.7))],
        _hall(1.6),
    ),
    _scene(
        "narrow doorway",
        "A person comes through a door 1.8 m wide",
        [_walker((2.5, 0.0), (-5.0, 0.0))],
        _door(0.9, 5.4),
    ),
    _scene(
        "overtaking",
        "A person walks ahead, at 0.3 m/s",
        [_walker((-2.5, 0.0), (5.0, 0.0), 0.3)],
    ),
    _scene(
        "intersection",
        "A person crosses where two halls meet",
        [_walker((0.0, -3.0), (0.0, 5.0))],
        [
            wall
            for x in (-2, 2)
            for y in (-2, 2)
            for wall in _corner(x, y, x / 2, y / 2)
        ],
    ),
    _scene(
        "blind corner",
        "A person comes from behind a corner",
        [_walker((1.0, 3.6), (1.0, -5.0), 0.7)],
        _corner(0.0, 1.3, -1, 1) + _corner(0.0, -1.3, -1, -1),
    ),
    _scene(
        "parallel traffic",
        "People walk on both sides, one way and the other",
        [
            *(_walker((x, 1.7), (-9.0, 1.7)) for x in (0.5, 3.5)),
            *(_walker((x, -1.7), (9.0, -1.7)) for x in (-3.5, -0.5)),
        ],
    ),
    _scene(
        "perpendicular traffic",
        "People cross the way, from both sides",
        [
            _walker((-1.5, -2.5), (-1.5, 9.0)),
            _walker((0.5, 3.5), (0.5, -9.0)),
            _walker((2.5, -4.0), (2.5, 9.0)),
        ],
    ),
    _scene(
        "circular crossing",
        "All people cross a circle, past its centre",
        [_crossing_walker(at) for at in _circle(6, 4.5) if at[0] > -4.0],
    ),
    _scene(
        "robot crowding",
        "People stand around the robot",
        [Person((x, y), heading=atan2(0.0 - y, 0.0 - x)) for x, y in _circle(5, 2.6)],
        start=(0.0, 0.0),
    ),
)

MEETINGS = {meeting.name: meeting for meeting in _MEETINGS}
"""The meetings, by name; another meeting is one more entry."""

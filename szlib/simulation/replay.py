"""The robot in the place of somebody who was recorded, among all others as they walked that day.

They do not see it: what they would have done for a robot nobody recorded.  Tracks are on the house's clock
(`szlib.tracks.clock`): between two samples people walk straight on, and their velocity is their displacement
over +-0.5 s, half of which has not happened yet.  World frame, metres and seconds; time 0 is when the walker
who is replaced was first seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, hypot
from math import floor as whole
from typing import Any

import numpy as np
import pandas as pd

from ..checks import Array
from ..control.person import Person
from ..control.settings import MPCSettings
from ..encounters.areas import area_for
from ..encounters.geometry import Area
from ..errors import DataError
from ..tracks.clock import TICKS_PER_SECOND, clock_index
from ..zones.ellipses import Ellipse
from .crowds.reacting import MIN_HEADING_SPEED
from .scenario import Crowd, Scenario

TIME_FACTOR = 2.0
"""The robot has so many times as long as the walker took, or as it needs itself at full speed (assumed)."""
SENSING_RANGE = 6.0
"""The controller is given who is within this distance of the robot [m] (assumed)."""
MIN_START_DISTANCE = 2.0
"""Nobody is within this distance when the robot is put in [m] (assumed): it has no companions."""
MIN_TRAVEL = 5.0
"""Walkers who came no farther than this are not replaced [m] (assumed)."""
_ROUNDING = 1e-6


@dataclass(frozen=True)
class RecordedPerson:
    """A person from one tick to another without a gap.

    Attributes
    ----------
    id : of the track table.
    first : tick of the first row, from time 0 of the replay.
    states : x, y, vx, vy, heading, shape (n, 5) [m, m/s, rad].
    """

    id: int
    first: int
    states: Array

    def at(self, t: float, zone: Ellipse | None = None) -> Person | None:
        """The person, with this zone, at a time [s]; None where they were not there."""
        tick = t * TICKS_PER_SECOND - self.first
        if not -_ROUNDING <= tick <= len(self.states) - 1 + _ROUNDING:
            return None
        row = min(max(whole(tick + _ROUNDING), 0), len(self.states) - 1)
        now, after = self.states[row], self.states[min(row + 1, len(self.states) - 1)]
        x, y, vx, vy = (now[:4] + max(tick - row, 0.0) * (after[:4] - now[:4])).tolist()
        return Person((x, y), (vx, vy), float(now[4]), zone)


@dataclass(frozen=True)
class Replay:
    """A recorded scene without one of its people: a behaviour, with the scenario that it belongs to.

    Attributes
    ----------
    scenario : the robot from the walker's first to their last point, at first with their velocity, or as
        much of it as it may; people come and go, so that it names none.
    walker : who is replaced.
    others : everybody else who was there meanwhile; who was lost and found again counts twice.
    zone : of everybody; None: that of the controller.
    sight : how far the controller is given people [m].
    """

    scenario: Scenario
    walker: RecordedPerson
    others: tuple[RecordedPerson, ...] = field(repr=False)
    zone: Ellipse | None = None
    sight: float = SENSING_RANGE

    def crowd(self, scenario: Scenario, seed: int) -> Crowd:
        """Everybody within sight of the robot as they were; the same whatever the seed."""
        return self._at

    def _at(self, t: float, robot: Array) -> tuple[Person | None, ...]:
        return tuple(self._within_sight(other.at(t, self.zone), robot) for other in self.others)

    def _within_sight(self, person: Person | None, robot: Array) -> Person | None:
        if person is None:
            return None
        (x, y), (rx, ry) = person.position, robot[:2].tolist()
        return person if hypot(x - rx, y - ry) <= self.sight else None

    def seen(self, people: tuple[Person, ...], rng: np.random.Generator) -> tuple[Person, ...]:
        """Everybody as the controller is given them: as they are."""
        return people


class Replays(tuple[Replay, ...]):
    """Several of them, each by its seed, as `rollouts` wants them.

    ``szlib.rollouts(len(made), worlds=made, behaviour=made)``: seed 0 is the first, and after the last comes
    the first again.
    """

    def __call__(self, seed: int) -> Scenario:
        """The scenario of a seed."""
        return self[seed % len(self)].scenario

    def crowd(self, scenario: Scenario, seed: int) -> Crowd:
        """The crowd of a seed."""
        return self[seed % len(self)].crowd(scenario, seed)

    def seen(self, people: tuple[Person, ...], rng: np.random.Generator) -> tuple[Person, ...]:
        """Everybody as the controller is given them: as they are."""
        return people


class ReplacedWalker:
    """The walker who was replaced, as a controller and its robot: drives their own path, whatever is ahead.

    With it the person replaced is measured like any controller.
    """

    inputs = ()

    def __init__(self, replay: Replay, settings: MPCSettings | None = None) -> None:
        self.settings, self._path = settings or MPCSettings(), replay.walker.states[:, :4]

    @property
    def robot(self) -> ReplacedWalker:
        """Itself; its own state is the time since the start, shape (1,) [s]."""
        return self

    def reset(self) -> None:
        """Nothing to forget."""

    def step(self, state: Array, goal: Array, people: Sequence[Person]) -> ReplacedWalker:
        """On along the path."""
        return self

    @property
    def control(self) -> Array:
        """None is needed, shape (0,)."""
        return np.zeros(0)

    def start(self, state: Array) -> Array:
        """Time 0."""
        return np.zeros(1)

    def body(self, own: Array) -> Array:
        """(x, y, vx, vy) then; who has come to the end stays there."""
        tick = min(float(own[0]) * TICKS_PER_SECOND, len(self._path) - 1.0)
        return np.array([np.interp(tick, np.arange(len(self._path)), column) for column in self._path.T])

    def advance(self, own: Array, control: Array, dt: float) -> Array:
        """`dt` later."""
        return own + dt


def find_replays(
    tracks: pd.DataFrame,
    n: int,
    *,
    seed: int = 0,
    area: object = None,
    zone: Ellipse | None = None,
    settings: MPCSettings | None = None,
) -> Replays:
    """At most n recorded walkers, drawn by the seed, each to be replaced by the robot.

    A walker's way is a gap-free piece of their track within the area, at least `MIN_TRAVEL` from its first
    to its last point, with nobody within `MIN_START_DISTANCE` at the first.

    Parameters
    ----------
    tracks : a track table; of several days, each is a scene of its own.
    area : open floor, where the robot may drive: whatever `szlib.as_area` takes, or "auto"; None: everywhere,
        though tracks say nothing of walls.
    zone : of everybody; None: that of the controller.
    settings : of the robot: its greatest speed.

    Raises
    ------
    DataError : nobody walked so.
    """
    s = settings or MPCSettings()
    order, tick, piece = clock_index(tracks)
    table = tracks.iloc[order]
    states = table[["x", "y", "vx", "vy"]].to_numpy(float)
    days, ids = pd.factorize(table["day"])[0], table["id"].to_numpy()
    starts = np.flatnonzero(np.r_[True, np.diff(piece) > 0])
    ends = np.r_[starts[1:], len(piece)]
    known = ends - starts > 1
    pieces = pd.DataFrame({"begin": starts[known], "end": ends[known]})
    pieces["day"], pieces["id"] = days[pieces["begin"]], ids[pieces["begin"]]
    pieces["first"], pieces["last"] = tick[pieces["begin"]], tick[pieces["end"] - 1]
    floor = None if area is None else area_for(tracks, area)
    ways = _ways(states, pieces, floor)
    made: list[Replay] = []
    for i in np.random.default_rng(seed).permutation(len(ways)):
        number, begin, end = ways[i]
        t0, straight = int(tick[begin]), hypot(*(states[end - 1, :2] - states[begin, :2]))
        time = round(TIME_FACTOR * max((end - 1 - begin) / TICKS_PER_SECOND, straight / s.v_max), 1)
        until = t0 + round(time * TICKS_PER_SECOND)
        there = (pieces["day"] == pieces["day"].iloc[number]) & (pieces["id"] != ids[begin])
        there &= (pieces["last"] >= t0) & (pieces["first"] <= until)
        others = [_cut(states, each, t0, until) for each in pieces[there].itertuples()]
        walker = RecordedPerson(int(ids[begin]), 0, _with_heading(states[begin:end]))
        if _has_room(walker, others):
            made.append(Replay(_scenario(walker, time, s), walker, tuple(others), zone))
        if len(made) == n:
            break
    if not made:
        raise DataError(
            f"no walker came {MIN_TRAVEL} m far within {floor or 'the tracks'} from a point with nobody "
            f"within {MIN_START_DISTANCE} m ({len(ways)} came so far); give a larger area or other tracks"
        )
    return Replays(made)


def _cut(states: Array, piece: Any, t0: int, until: int) -> RecordedPerson:
    """What a piece has of the ticks from `t0` to `until`, from when they first came."""
    rows = slice(max(t0 - piece.first, 0), until + 1 - piece.first)
    whole_way = _with_heading(states[piece.begin : piece.end])
    return RecordedPerson(int(piece.id), int(max(piece.first - t0, 0)), whole_way[rows])


def _ways(states: Array, pieces: pd.DataFrame, area: Area | None) -> list[tuple[int, int, int]]:
    """Number of the piece, first row and end of every way that is long enough."""
    inside = np.ones(len(states), bool)
    if area is not None:
        inside = np.asarray(area.contains(states[:, 0], states[:, 1]))
    ways = []
    for number, (a, b) in enumerate(pieces[["begin", "end"]].itertuples(index=False)):
        edges = np.flatnonzero(np.diff(np.r_[False, inside[a:b], False])).reshape(-1, 2) + a
        for begin, end in edges.tolist():
            if hypot(*(states[end - 1, :2] - states[begin, :2])) >= MIN_TRAVEL:
                ways.append((number, begin, end))
    return ways


def _has_room(walker: RecordedPerson, others: list[RecordedPerson]) -> bool:
    """True if nobody is within `MIN_START_DISTANCE` where the walker began."""
    near = [person for other in others if (person := other.at(0.0)) is not None]
    return all(np.hypot(*(walker.states[0, :2] - person.position)) > MIN_START_DISTANCE for person in near)


def _scenario(walker: RecordedPerson, time: float, s: MPCSettings) -> Scenario:
    """The robot from the walker's first to their last point, as fast as they were or as it may be."""
    x, y, vx, vy, _ = walker.states[0].tolist()
    share = min(1.0, 0.99 * s.v_max / max(hypot(vx, vy), _ROUNDING))
    return Scenario(
        name=f"replay of {walker.id}",
        title=f"In the place of person {walker.id}",
        start=np.array([x, y, share * vx, share * vy]),
        goal=walker.states[-1, :2],
        duration=time,
    )


def _with_heading(states: Array) -> Array:
    """x, y, vx, vy and heading: where they walk, or last walked at `MIN_HEADING_SPEED`, or first walk."""
    vx, vy = states[:, 2:].T
    walking = np.hypot(vx, vy) >= MIN_HEADING_SPEED
    if walking.any():
        row = np.maximum.accumulate(np.where(walking, np.arange(len(states)), -1))
        heading = np.arctan2(vy, vx)[np.where(row >= 0, row, walking.argmax())]
    else:
        heading = np.full(len(states), atan2(*(states[-1, :2] - states[0, :2])[::-1]))
    return np.column_stack([states, heading])

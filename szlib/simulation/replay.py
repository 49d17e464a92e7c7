"""Replay: the robot takes the place of a recorded walker, among all other people as they walked that day.

The people do not see the robot: their reaction to it was not recorded.  Tracks are on szlib's clock
(`szlib.tracks.clock`): between two samples people walk straight on, and their velocity is their displacement
over +-0.5 s, half of which lies in the future.  World frame, metres and seconds; time 0 is the first
sample of the walker who is replaced.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, floor, hypot
from typing import Any

import numpy as np
import pandas as pd

from ..control.controller import Controller
from ..control.people import Person
from ..control.settings import MPCSettings
from ..core.checks import Array
from ..core.errors import DataError
from ..encounters.areas import area_for
from ..encounters.geometry import Area
from ..tracks.clock import TICKS_PER_SECOND, clock_index
from ..zones.ellipses import Ellipse
from .crowds.reacting import MIN_HEADING_SPEED
from .scenario import Crowd, CrowdModel, Scenario

TIME_FACTOR = 2.0
"""Time limit of the robot, as a multiple of the walker's time, or of its own time at full speed (assumed)."""
SENSING_RANGE = 6.0
"""The controller sees people within this distance of the robot [m] (assumed)."""
MIN_START_DISTANCE = 2.0
"""No person is within this distance of the robot's start [m] (assumed): the robot has no companions."""
MIN_TRAVEL = 5.0  # walkers who cover a smaller distance are not replaced [m] (assumed)
_ROUNDING = 1e-6


@dataclass(frozen=True)
class RecordedPerson:
    """A recorded person, from one tick to another without a gap.

    Attributes
    ----------
    id : id in the track table.
    first : tick of the first row, from time 0 of the replay.
    states : x, y, vx, vy, heading, shape (n, 5) [m, m/s, rad].
    """

    id: int
    first: int
    states: Array

    def at(self, t: float, zone: Ellipse | None = None) -> Person | None:
        """The person at a time `t` [s], with this `zone`; None if they are absent."""
        tick = t * TICKS_PER_SECOND - self.first
        if not -_ROUNDING <= tick <= len(self.states) - 1 + _ROUNDING:
            return None
        row = min(max(floor(tick + _ROUNDING), 0), len(self.states) - 1)
        now, after = self.states[row], self.states[min(row + 1, len(self.states) - 1)]
        x, y, vx, vy = (now[:4] + max(tick - row, 0.0) * (after[:4] - now[:4])).tolist()
        return Person((x, y), (vx, vy), float(now[4]), zone)


@dataclass(frozen=True)
class Replay(CrowdModel):
    """A recorded scene without one of its people: a `CrowdModel`, with its scenario.

    Attributes
    ----------
    scenario : from the walker's first to their last point. The robot starts with their velocity, up to its
        own limit. It has no people: people come and go.
    walker : the person who is replaced.
    others : all other people; a person who was lost and found again counts twice.
    zone : zone of all people; None: that of the controller.
    """

    scenario: Scenario
    walker: RecordedPerson
    others: tuple[RecordedPerson, ...] = field(repr=False)
    zone: Ellipse | None = None

    def start(self, scenario: Scenario, seed: int) -> Crowd:
        """The recorded people within range of the robot, whatever the `scenario` and the `seed`."""
        return self._people_in_range

    def _people_in_range(self, t: float, robot: Array) -> tuple[Person | None, ...]:
        x, y = robot[:2].tolist()
        people = (other.at(t, self.zone) for other in self.others)
        return tuple(
            p
            if p and hypot(p.position[0] - x, p.position[1] - y) <= SENSING_RANGE
            else None
            for p in people
        )


class Replays(tuple[Replay, ...]):
    """Several replays, each with its seed: worlds and behaviour of `rollouts`.

    ``szlib.rollouts(len(replays), worlds=replays, behaviour=replays)``: seed 0 is the first replay; after the
    last the first follows again.
    """

    def __call__(self, seed: int) -> Scenario:
        """The scenario of a `seed`."""
        return self[seed % len(self)].scenario

    def start(self, scenario: Scenario, seed: int) -> Crowd:
        """The people of the replay of a `seed`, whatever the `scenario`."""
        return self[seed % len(self)].start(scenario, seed)

    def observe(
        self, people: tuple[Person, ...], rng: np.random.Generator
    ) -> tuple[Person, ...]:
        """The `people` themselves; nothing is drawn from `rng`."""
        return people


class ReplacedWalker(Controller):
    """The walker of a `replay`, as a controller and its own robot: follows the recorded path, whatever is
    ahead.

    With it a person is measured like any robot, with the same `settings` (default: `MPCSettings()`).
    """

    inputs = ()
    control = np.zeros(0)

    def __init__(self, replay: Replay, settings: MPCSettings | None = None) -> None:
        self.settings, self.robot = settings or MPCSettings(), self
        self._path = replay.walker.states[:, :4]

    def step(
        self, state: Array, goal: Array, people: Sequence[Person]
    ) -> ReplacedWalker:
        """No control is needed, whatever the `state`, `goal` and `people`."""
        return self

    def start(self, state: Array) -> Array:
        """The own state is the time since the start, shape (1,) [s], whatever the `state`."""
        return np.zeros(1)

    def body(self, own: Array) -> Array:
        """(x, y, vx, vy) at the time `own`; at the end of the path the walker stays there."""
        tick = min(float(own[0]) * TICKS_PER_SECOND, len(self._path) - 1.0)
        return np.array(
            [
                np.interp(tick, np.arange(len(self._path)), column)
                for column in self._path.T
            ]
        )

    def advance(self, own: Array, control: Array, dt: float) -> Array:
        """The time `own`, `dt` later; there is no `control`."""
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
    """Draw recorded walkers whom the robot can replace.

    The robot takes a piece of a walker's track without gaps, within the area, of at least `MIN_TRAVEL`
    from its first to its last point, with no other person within `MIN_START_DISTANCE` of
    the first.

    Parameters
    ----------
    tracks : a track table; each day is a scene of its own.
    n : largest number of walkers.
    seed : seed of the draw.
    area : open floor, where the robot may drive: as for `szlib.as_area`, or "auto"; None: everywhere,
        although tracks say nothing of walls.
    zone : zone of all people; None: that of the controller.
    settings : settings of the robot, for its speed limit.

    Raises
    ------
    DataError : there is no such walker.
    """
    s = settings or MPCSettings()
    order, tick, piece = clock_index(tracks)
    table = tracks.iloc[order]
    states = table[["x", "y", "vx", "vy"]].to_numpy(float)
    days, ids = pd.factorize(table["day"])[0], table["id"].to_numpy()
    starts = np.flatnonzero(np.r_[True, np.diff(piece) > 0])
    ends = np.r_[starts[1:], len(piece)]
    is_long = ends - starts > 1
    pieces = pd.DataFrame({"begin": starts[is_long], "end": ends[is_long]})
    pieces["day"], pieces["id"] = days[pieces["begin"]], ids[pieces["begin"]]
    pieces["first"], pieces["last"] = tick[pieces["begin"]], tick[pieces["end"] - 1]
    floor_area = None if area is None else area_for(tracks, area)
    paths = _find_paths(states, pieces, floor_area)
    replays: list[Replay] = []
    for i in np.random.default_rng(seed).permutation(len(paths)):
        number, begin, end = paths[i]
        t0, distance = (
            int(tick[begin]),
            hypot(*(states[end - 1, :2] - states[begin, :2])),
        )
        duration = round(
            TIME_FACTOR * max((end - 1 - begin) / TICKS_PER_SECOND, distance / s.v_max),
            1,
        )
        t1 = t0 + round(duration * TICKS_PER_SECOND)
        is_other = (pieces["day"] == pieces["day"].iloc[number]) & (
            pieces["id"] != ids[begin]
        )
        is_other &= (pieces["last"] >= t0) & (pieces["first"] <= t1)
        others = tuple(
            _cut(states, each, t0, t1) for each in pieces[is_other].itertuples()
        )
        walker = RecordedPerson(int(ids[begin]), 0, _add_heading(states[begin:end]))
        if _has_free_start(walker, others):
            replays.append(
                Replay(_make_scenario(walker, duration, s), walker, others, zone)
            )
        if len(replays) == n:
            break
    if not replays:
        raise DataError(
            f"no walker covers {MIN_TRAVEL} m within {floor_area or 'the tracks'} from a point with no "
            f"person within {MIN_START_DISTANCE} m ({len(paths)} cover this distance); give a larger area "
            "or other tracks"
        )
    return Replays(replays)


def _cut(states: Array, piece: Any, t0: int, t1: int) -> RecordedPerson:
    """A piece of a track from tick `t0` to tick `t1`."""
    rows = slice(max(t0 - piece.first, 0), t1 + 1 - piece.first)
    whole = _add_heading(states[piece.begin : piece.end])
    return RecordedPerson(int(piece.id), int(max(piece.first - t0, 0)), whole[rows])


def _find_paths(
    states: Array, pieces: pd.DataFrame, area: Area | None
) -> list[tuple[int, int, int]]:
    """Number of the piece, first row and end of each path that is long enough."""
    inside = np.ones(len(states), bool)
    if area is not None:
        inside = np.asarray(area.contains(states[:, 0], states[:, 1]))
    paths = []
    for number, (a, b) in enumerate(pieces[["begin", "end"]].itertuples(index=False)):
        edges = (
            np.flatnonzero(np.diff(np.r_[False, inside[a:b], False])).reshape(-1, 2) + a
        )
        for begin, end in edges.tolist():
            if hypot(*(states[end - 1, :2] - states[begin, :2])) >= MIN_TRAVEL:
                paths.append((number, begin, end))
    return paths


def _has_free_start(walker: RecordedPerson, others: Sequence[RecordedPerson]) -> bool:
    """True if no person is within `MIN_START_DISTANCE` of the walker's start."""
    present = [person for other in others if (person := other.at(0.0)) is not None]
    return all(
        np.hypot(*(walker.states[0, :2] - p.position)) > MIN_START_DISTANCE
        for p in present
    )


def _make_scenario(walker: RecordedPerson, duration: float, s: MPCSettings) -> Scenario:
    """From the walker's first to their last point, with their velocity up to the robot's limit."""
    x, y, vx, vy, _ = walker.states[0].tolist()
    factor = min(1.0, 0.99 * s.v_max / max(hypot(vx, vy), _ROUNDING))
    return Scenario(
        name=f"replay of {walker.id}",
        title=f"In the place of person {walker.id}",
        start=np.array([x, y, factor * vx, factor * vy]),
        goal=walker.states[-1, :2],
        duration=duration,
    )


def _add_heading(states: Array) -> Array:
    """x, y, vx, vy, heading: the direction of the last motion at `MIN_HEADING_SPEED`, or of the first."""
    vx, vy = states[:, 2:].T
    walking = np.hypot(vx, vy) >= MIN_HEADING_SPEED
    if walking.any():
        row = np.maximum.accumulate(np.where(walking, np.arange(len(states)), -1))
        heading = np.arctan2(vy, vx)[np.where(row >= 0, row, walking.argmax())]
    else:
        heading = np.full(len(states), atan2(*(states[-1, :2] - states[0, :2])[::-1]))
    return np.column_stack([states, heading])

"""People as the controller sees them: `Person`, and from one measurement to the next: `Tracker`.

A sensor is noisy and late, and loses people. By the ids of people,

    heading     is the direction in which they walked when last seen at `walking_speed` or faster; unknown
                before that, and for people without an id whenever they are slower
    position    is moved forward to now at constant velocity, for people who were seen earlier
    unseen      people stay, at constant velocity, for `memory` seconds
    rejected    are measurements that are not finite, or beyond `LARGEST`, or measured more than `memory`
                before or after now. The last known state of the same id takes their place, moved forward;
                people without such a state are *unknown*
    late        measurements, older than what is known of the same id, are ignored
    ids         that are NaN, or given to two people at once, tell nothing. If a person is more than
                `SAME_PERSON` from where the same id is expected, they are somebody else
    lost        people give their place to a person with a new id who is within `SAME_PLACE` of where they are
                expected: a sensor that changes ids makes nobody appear twice
    the clock   may go back: that step is taken to be as long as the one before, and nobody is forgotten
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import atan2, dist, hypot, inf, isfinite
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import (
    LARGEST,
    Array,
    check_array,
    check_number,
    check_point,
    require,
)
from ..core.errors import SolverError, ZoneError
from ..zones.ellipses import Ellipse
from .settings import MPCSettings

# Below this speed a person counts as standing, to allow for a tracker's noise [m/s] (assumed).
STANDING_SPEED = 0.1


class SpeedZone(Protocol):
    """Anything that has a zone, such as `SocialZone` or `ReferenceZone`."""

    @property
    def ellipse(self) -> Any:
        """The zone in the person's frame, or a function that gives it for a walking speed [m/s]."""


def as_ellipse(zone: Ellipse | SpeedZone, speed: float) -> Ellipse:
    """Ellipse of `zone` at a walking `speed` [m/s].

    ZoneError if it is none, reaches beyond `LARGEST`, or does not contain the person's position. It may be
    smaller than a body, as a measured zone may be: `Step.safe` keeps the robot off bodies besides.
    """
    found = zone if isinstance(zone, Ellipse) else getattr(zone, "ellipse", None)
    if callable(found):
        found = found(speed)
    if not isinstance(found, Ellipse):
        raise ZoneError(
            f"a zone must be an Ellipse or have .ellipse(speed); got {type(zone).__name__}"
        )
    is_near = max(*map(abs, found.center), found.semi_axes[0]) <= LARGEST
    require(is_near, "a zone", found, f"within {LARGEST:g} m of its person", ZoneError)
    xa, ya, xb, yb, a = found.foci_and_axis
    if hypot(xa, ya) + hypot(xb, yb) > 2 * a * (1 + 1e-9):
        raise ZoneError(
            f"a zone must contain its person, who is at (0, 0) of its frame; got {found}"
        )
    return found


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where a person will be, by a predictor; after its last time they keep their velocity.

    The zone of the person grows by `SPREAD` standard deviations: along one direction, a normally distributed
    position is farther off towards the robot with a probability of 5 %.

    Parameters
    ----------
    times : from when the person was measured, positive and increasing, shape (T,) [s].
    positions : shape (T, 2) [m].
    spread : of the positions: standard deviation, a number or shape (T,) [m], or covariance matrices, shape
        (T, 2, 2) [m2], of which the largest standard deviation counts. It begins at 0 now.

    Raises
    ------
    SolverError : a number or a shape cannot be used.

    Examples
    --------
    A person who is about to turn left, as a predictor says:

    >>> import szlib
    >>> from szlib.control import Prediction
    >>> turns = Prediction(times=[1.0, 2.0], positions=[(1.0, 0.5), (1.5, 1.0)], spread=[0.1, 0.2])
    >>> person = szlib.Person((0.0, 0.0), (1.0, 0.0), prediction=turns)
    >>> person.after(1.5).position
    (1.25, 0.75)
    """

    times: Any
    positions: Any
    spread: Any = 0.0

    def __post_init__(self) -> None:
        name = "the times of a prediction"
        times = check_array(name, self.times, (...,))
        n, expected = times.size, "positive and increasing, shape (T,)"
        is_later = times.shape == (n,) and (np.diff(times, prepend=0.0) > 0).all()
        require(n and is_later, name, self.times, expected, SolverError)
        positions = check_array("the positions of a prediction", self.positions, (n, 2))
        name = "the spread of a prediction"
        spread = check_array(name, self.spread, (...,))
        if spread.shape == (n, 2, 2):
            spread = np.sqrt(np.linalg.norm(spread, ord=2, axis=(1, 2)))
        is_spread = spread.shape in ((), (n,)) and (spread >= 0).all()
        expected = f"at least 0: a number, or of shape ({n},) or ({n}, 2, 2)"
        require(is_spread, name, self.spread, expected, SolverError)
        spread = np.broadcast_to(spread, n)
        vars(self).update(times=times, positions=positions, spread=spread)

    def sample(self, person: Person, times: Array) -> Array:
        """Offset of a `person` from constant velocity and growth of the zone at `times`, (n, 3) [m]."""
        steady = np.add(person.position, np.outer(self.times, person.velocity))
        offsets = np.column_stack([self.positions - steady, SPREAD * self.spread])
        knots = np.r_[0.0, self.times]
        rows = [np.interp(times, knots, np.r_[0.0, each]) for each in offsets.T]
        return np.column_stack(rows)

    def later(self, seconds: float) -> Prediction | None:
        """The same prediction for the person `seconds` later; None if nothing of it is left."""
        left = self.times > seconds
        if not left.any():
            return None
        times = self.times[left] - seconds
        return Prediction(times, self.positions[left], self.spread[left])


def list_knots(person: Person, settings: MPCSettings) -> Array:
    """What a `PredictedZone` of a `person` needs for each interval of the horizon of these `settings`."""
    times, rates = np.array(settings.times), np.zeros((settings.N, 3))
    if person.prediction is not None:
        offsets = person.prediction.sample(person, times)
        rates = np.diff(offsets, axis=0) / np.diff(times)[:, None]
    return np.column_stack([times[1:], rates]).ravel()


SPREAD = 1.64
"""Standard deviations of a predicted position by which the zone grows: 95 % on one side (assumed)."""


def predict(
    people: ArrayLike, times: ArrayLike, positions: Any, spread: Any = 0.0
) -> list[Person]:
    """`Person`s with the predictions of all of them.

    Parameters
    ----------
    people : shape (n, 4): x, y [m], vx, vy [m/s].
    times : one array for all, as of `Prediction`.
    positions : shape (n, T, 2) [m].
    spread : a number or shape (n, T) [m], or covariance matrices, shape (n, T, 2, 2) [m2].

    Raises
    ------
    SolverError : a number or a shape cannot be used.

    Examples
    --------
    >>> from szlib.control import predict
    >>> one, = predict([[0.0, 0.0, 1.0, 0.0]], times=[1.0], positions=[[(1.0, 0.2)]], spread=0.1)
    >>> one.after(1.0).position
    (1.0, 0.2)
    """
    rows = check_array("people", people, (..., 4))
    require(rows.ndim == 2, "people", rows.shape, "of shape (n, 4)", SolverError)
    positions = check_array("positions", positions, (...,))
    spreads = check_array("spread", spread, (...,))
    spreads = spreads if spreads.ndim else np.full(len(rows), spread)
    for name, given in (("positions", positions), ("spread", spreads)):
        is_each = given.shape[:1] == (len(rows),)
        expected = f"one for each of {len(rows)} people"
        require(is_each, name, given.shape, expected, SolverError)
    return [
        Person((x, y), (vx, vy), prediction=Prediction(times, xy, own))
        for (x, y, vx, vy), xy, own in zip(
            rows.tolist(), positions, spreads, strict=True
        )
    ]


@dataclass(frozen=True)
class Person:
    """A person as the controller sees them: a state now, and constant velocity from now on.

    Parameters
    ----------
    position : (x, y) [m].
    velocity : (vx, vy) [m/s].
    heading : direction in which they face, counter-clockwise from x [rad]; None: in which they walk. It stays
        None if they stand, or with `heading_unknown`; then the circle around their zone is used.
    zone : their social zone, in their own frame; None: the controller's.
    id : by which a `Tracker` recognises them; None: they are new at each step.
    heading_unknown : True if they are too slow for the velocity to give the heading.
    prediction : where they will be; None: they keep their velocity. The problem and the ways use it. What a
        step claims (`Step.safe`, `Step.passively_safe`) is about people who keep their velocity.
    group : with whom they are together: a way between two of a group has a price. None: whoever is near and
        has a like velocity (`szlib.control.ways`).

    Raises
    ------
    SolverError : a number cannot be used (give measurements to `MPCCBF.step` as an array), or a heading is
        both given and unknown.
    ZoneError : the zone reaches beyond `LARGEST`, or does not contain the person.

    Examples
    --------
    >>> import szlib
    >>> person = szlib.Person(position=(4.0, 0.0), velocity=(-0.5, 0.0))
    >>> round(person.heading, 3)
    3.142
    >>> person.after(2.0).position
    (3.0, 0.0)
    >>> szlib.Person((0.0, 0.0)).heading is None  # they stand: the direction is unknown
    True
    """

    position: tuple[float, float]
    velocity: tuple[float, float] = (0.0, 0.0)
    heading: float | None = None
    zone: Ellipse | SpeedZone | None = None
    id: Hashable = None
    heading_unknown: bool = False
    prediction: Prediction | None = None
    group: Hashable = None

    def __post_init__(self) -> None:
        position = check_point("a person's position", self.position)
        velocity = check_point("a person's velocity", self.velocity)
        vars(self).update(position=position, velocity=velocity)
        if self.heading is not None:
            heading = check_number("a person's heading", self.heading)
            vars(self).update(heading=heading)
            if self.heading_unknown:
                raise SolverError(
                    f"a heading is given or unknown; got {heading} and heading_unknown for {position}"
                )
        elif not (self.stands or self.heading_unknown):
            vars(self).update(heading=atan2(velocity[1], velocity[0]))
        if isinstance(self.zone, Ellipse):
            as_ellipse(self.zone, 0.0)
        if not isinstance(self.prediction, Prediction | None):
            raise SolverError(
                f"the prediction of a person must be a Prediction; got {self.prediction!r:.200}"
            )

    @property
    def stands(self) -> bool:
        """True if the velocity is zero."""
        return self.velocity == (0.0, 0.0)

    def after(self, seconds: float) -> Person:
        """The same person, `seconds` later, as predicted."""
        if self.stands and self.prediction is None:
            return self
        (x, y), (vx, vy) = self.position, self.velocity
        x, y = x + vx * seconds, y + vy * seconds
        if self.prediction is None:
            return self.at((x, y))
        (dx, dy, _), *_ = self.prediction.sample(self, np.array([seconds])).tolist()
        moved = self.at((x + dx, y + dy))
        vars(moved).update(prediction=self.prediction.later(seconds))
        return moved

    def at(self, position: tuple[float, float]) -> Person:
        """The same person at another `position` [m]; only the position is checked, for speed."""
        moved = copy(self)
        vars(moved).update(position=check_point("a person's position", position))
        return moved


SAME_PERSON = 2.0
"""Distance from the expected position up to which the same id means the same person [m] (assumed)."""
SAME_PLACE = 0.5
"""Distance from where a lost person is expected up to which a new id means the same person [m] (assumed)."""
_LastSeen = tuple[Person, float]  # a person as last seen, and when [s]
# a measurement: the `Person` if one was given, x, y [m], vx, vy [m/s]
_Row = tuple[Person | None, float, float, float, float]
People = Sequence[Person] | ArrayLike
"""People as `Person`s, or as an array, shape (n, 4): x, y [m], vx, vy [m/s]."""


class TrackedPeople(NamedTuple):
    """Everybody to be respected now.

    Attributes
    ----------
    people : those given, in their order, then those who are remembered.
    rejected : number of those given whose measurement cannot be used.
    unknown : number of rejected people of whom nothing is known that could take the place of the
        measurement. They are among `people`, as standing where they were measured, only if that position can
        be used.
    """

    people: tuple[Person, ...]
    rejected: int = 0
    unknown: int = 0


class Tracker:
    """Remembers people by their ids; see the top of this module.

    Parameters
    ----------
    walking_speed : speed from which on the velocity gives the heading [m/s] (assumed: ten times the noise of
        a sensor that is 2 cm/s off).
    memory : time for which people who are not seen any more are remembered and respected, and the greatest
        age of a measurement [s] (assumed).

    Raises
    ------
    SolverError : a parameter is not a finite number >= 0.

    Examples
    --------
    >>> import szlib
    >>> tracker = szlib.Tracker(memory=1.0)
    >>> tracker.see([[0.0, 0.0, 1.0, 0.0]], ids=["ann"], now=0.0).people[0].position
    (0.0, 0.0)
    >>> tracker.see([], ids=[], now=0.5).people[0].position  # hidden, and remembered
    (0.5, 0.0)
    >>> tracker.see([], ids=[], now=2.0).people
    ()
    """

    def __init__(self, *, walking_speed: float = 0.2, memory: float = 1.0) -> None:
        for name, value in (("walking_speed", walking_speed), ("memory", memory)):
            is_time = isinstance(value, int | float | np.number) and 0 <= value < inf
            require(is_time, name, value, "a finite number >= 0", SolverError)
        self.walking_speed, self.memory = float(walking_speed), float(memory)
        self._last_seen: dict[Hashable, _LastSeen] = {}
        self._now, self._interval = inf, 0.0

    def reset(self) -> None:
        """Forget everybody."""
        self._last_seen.clear()

    def see(
        self,
        people: People = (),
        *,
        now: float,
        ids: Iterable[Hashable] | None = None,
        stamps: ArrayLike | None = None,
    ) -> TrackedPeople:
        """Bring what was measured of people to the present.

        Parameters
        ----------
        people : `Person`s, or an array, shape (n, 4): x, y [m], vx, vy [m/s]. A heading that a `Person` was
            given is used.
        now : time, of any clock [s].
        ids : one for each of them, None for a person without an id; default: those of the `Person`s.
        stamps : when they were measured, one time for each or one for all [s]; default: now.

        Raises
        ------
        SolverError : an argument has the wrong type or shape: an error of the program, not of a sensor.
        """
        now = check_time(now)
        self._set_clock(now)
        is_plain = ids is None and stamps is None and not self._last_seen
        if is_plain and isinstance(people, list | tuple):
            known = tuple(
                [one for one in people if type(one) is Person and one.id is None]
            )
            if len(known) == len(people):
                return TrackedPeople(known)
        rows = _split_rows(people)
        names, given = _check_names(ids, rows)
        times = _as_floats("stamps", now if stamps is None else stamps)
        expected = f"one time, or one for each of {len(rows)} people"
        is_each = times.shape in ((), (len(rows),))
        require(is_each, "stamps", times.shape, expected, SolverError)
        self._last_seen = {
            k: v for k, v in self._last_seen.items() if abs(now - v[1]) <= self.memory
        }
        present, rejected, unknown = list[Person](), 0, 0
        each_time = np.broadcast_to(times, len(rows)).tolist()
        for row, name, time in zip(rows, names, each_time, strict=True):
            if given[name] > 1 or name != name:  # NaN
                name = None
            last = None if name is None else self._recall(row, name, time, given)
            seen, is_usable = self._update(row, name, time, last)
            if seen and name is not None and (is_usable or last):
                self._last_seen[name] = seen
            person = _move_forward(*seen, now) if seen else None
            present += [person] if person else []
            rejected += not (is_usable and person)
            unknown += not ((is_usable or last) and person)
        for name, seen in self._last_seen.items():
            person = None if name in given else _move_forward(*seen, now)
            present += [person] if person else []
        return TrackedPeople(tuple(present), rejected, unknown)

    def _set_clock(self, now: float) -> None:
        """Begin a step at the time `now`; if the clock went back, so do the times of everybody."""
        if now < self._now:
            back = self._now + self._interval - now
            self._last_seen = {
                name: (person, time - back)
                for name, (person, time) in self._last_seen.items()
            }
        elif now - self._now <= self.memory:
            self._interval = now - self._now
        self._now = now

    def _recall(
        self, row: _Row, name: Hashable, time: float, given: Counter[Hashable]
    ) -> _LastSeen | None:
        """What is known of the person of a measurement: by their id, or by their place if the id is new."""
        last = self._last_seen.get(name)
        if not time <= self._now + self.memory:
            return last
        if last is None:
            lost = {
                other: _measure_deviation(row, time, *seen)
                for other, seen in self._last_seen.items()
                if other not in given and seen[1] <= time
            }
            nearest = min(lost, key=lost.__getitem__, default=None)
            is_same = lost.get(nearest, inf) <= SAME_PLACE
            return self._last_seen.pop(nearest) if is_same else None
        if last[1] <= time and SAME_PERSON < _measure_deviation(row, time, *last) < inf:
            # may be hidden, and has no id any more
            self._last_seen[Tracker, name] = last
            return None
        return last

    def _update(
        self, row: _Row, name: Hashable, time: float, last: _LastSeen | None
    ) -> tuple[_LastSeen | None, bool]:
        """The last known state of a person, if any, and True if all numbers of the measurement are usable."""
        (person, x, y, vx, vy), now = row, self._now
        if person and name is None and time == now:
            return (person, now), True
        if not _are_usable(x, y):
            return last, False
        if not (abs(now - time) <= self.memory and (last or _are_usable(vx, vy))):
            zone = person.zone if person else None
            return last or (Person((x, y), zone=zone, id=name), now), False
        if last and time < last[1]:
            return last, True
        if last and not _are_usable(vx, vy):
            return (last[0].at((x, y)), time), False
        seen = person or Person((x, y), (vx, vy), heading_unknown=True)
        heading, is_moving = seen.heading, (vx, vy) != (0.0, 0.0)
        if heading is None or (
            is_moving and name is not None and heading == atan2(vy, vx)
        ):
            heading = last[0].heading if last else None
            if hypot(vx, vy) >= self.walking_speed:
                heading = atan2(vy, vx)
        is_unknown = heading is None
        seen = replace(seen, id=name, heading=heading, heading_unknown=is_unknown)
        return (seen, time), True


def _move_forward(person: Person, time: float, now: float) -> Person | None:
    """A person seen at `time`, moved to `now` at constant velocity; None if that is beyond `LARGEST`."""
    if time == now:
        return person
    (x, y), (vx, vy) = person.position, person.velocity
    if not _are_usable(x + (now - time) * vx, y + (now - time) * vy):
        return None
    return person.after(now - time)


def _measure_deviation(row: _Row, time: float, person: Person, seen: float) -> float:
    """Distance from a measurement of this `time` to where a `person`, `seen` before, is expected [m]."""
    expected, place = _move_forward(person, seen, time), row[1:3]
    is_known = expected and _are_usable(*place)
    return dist(place, expected.position) if expected and is_known else inf


def _are_usable(x: float, y: float) -> bool:
    return abs(x) <= LARGEST and abs(y) <= LARGEST


def _split_rows(people: Any) -> list[Any]:
    """People one by one, with their numbers, finite or not."""
    if isinstance(people, Iterable) and not isinstance(people, np.ndarray):
        people = list(people)
        if not [each for each in people if not isinstance(each, Person)]:
            return [(each, *each.position, *each.velocity) for each in people]
    expected = "Persons, or numbers of shape (n, 4): x, y, vx, vy"
    numbers = _as_floats("people", people, expected)
    is_rows = numbers.shape[1:] == (4,) or not numbers.size
    require(is_rows, "people", numbers.shape, expected, SolverError)
    return [(None, *each) for each in numbers.reshape(-1, 4).tolist()]


def _check_names(
    ids: Iterable[Hashable] | None, rows: Sequence[_Row]
) -> tuple[list[Hashable], Counter[Hashable]]:
    """The id of each person, or None, and how often each id was given."""
    try:
        names = [row[0] and row[0].id for row in rows] if ids is None else list(ids)
        given = Counter(name for name in names if name is not None)
    except TypeError as error:
        raise SolverError(
            f"ids must be a list of hashable values; got {ids!r:.200}"
        ) from error
    expected = f"one for each of {len(rows)} people"
    require(len(names) == len(rows), "ids", len(names), expected, SolverError)
    return names, given


def check_time(now: float) -> float:
    """The time `now` [s] as a Python float; SolverError if it is not a finite number."""
    if type(now) is float and isfinite(now):
        return now
    time = _as_floats("now", now)
    is_time = not time.shape and np.isfinite(time)
    require(is_time, "now", now, "a finite time [s]", SolverError)
    return float(time)


def _as_floats(name: str, value: Any, expected: str = "numbers [s]") -> Array:
    """The numbers of an argument, finite or not."""
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError, OverflowError) as error:
        raise SolverError(f"{name} must be {expected}; got {value!r:.200}") from error

"""People as the controller sees them: `Person`, and from one measurement to the next: `Tracker`.

A sensor is noisy and late, and loses people. By the ids of people,

    heading     is the direction in which they walked when last seen at `walking_speed` or faster; unknown
                before that, and for people without an id whenever they are slower
    position    is moved forward to now at constant velocity, for people who were seen earlier
    unseen      people stay, at constant velocity, for `memory` seconds
    rejected    are measurements with a number that is not finite, or beyond `LARGEST`, and those from
                more than `memory` before or after now. The last known state of the same id takes their place,
                moved forward; people without such a state are *unknown*
    late        measurements, older than what is known of the same id, are ignored
    ids         that are NaN or NA, or given to two people at once, tell nothing; others compare by value
    lost        people give their place to a person with a new id who is within `SAME_PLACE` of where they are
                expected: a sensor that changes ids makes nobody appear twice
    the clock   may go back: that step is taken to be as long as the one before, and nobody is forgotten
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import atan2, dist, hypot, inf
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ..core.checks import (
    LARGEST,
    Array,
    check_array,
    check_number,
    check_point,
)
from ..core.errors import SolverError, ZoneError
from ..zones.ellipses import Ellipse
from .settings import MPCSettings, check_argument

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
    found = getattr(zone, "ellipse", zone)
    if callable(found):
        found = found(speed)
    if isinstance(found, Ellipse):
        reach = max(*map(abs, found.center), found.semi_axes[0])
        if reach <= LARGEST:
            xa, ya, xb, yb, a = found.foci_and_axis
            if hypot(xa, ya) + hypot(xb, yb) <= 2 * a * (1 + 1e-9):
                return found
    raise ZoneError(
        f"a zone must contain its person, who is at (0, 0) of its frame, reach no farther than "
        f"{LARGEST:g} m, and be an Ellipse or have .ellipse(speed); got {found!r}"
    )


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where a person will be, by a predictor; after its last time they keep their velocity.

    The controller reads it at the times of its plan, and takes it as linear in between.

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
        times = check_array("the times of a prediction", self.times, (...,)).ravel()
        n = times.size
        positions = check_array("the positions of a prediction", self.positions, (n, 2))
        spread = check_array("the spread of a prediction", self.spread, (...,))
        if spread.shape[1:] == (2, 2):
            spread = np.sqrt(np.linalg.norm(spread, ord=2, axis=(1, 2)))
        is_later = (np.diff(times, prepend=0.0) > 0).all()
        is_spread = spread.shape in ((), (n,)) and (spread >= 0).all()
        expected = (
            "of times that are positive and increasing, with a spread of at least 0: a number, or of shape "
            f"({n},) or ({n}, 2, 2)"
        )
        given = self.times, self.spread
        check_argument(is_later and is_spread, "a prediction", given, expected)
        spread = np.broadcast_to(spread, n)
        vars(self).update(times=times, positions=positions, spread=spread)

    def sample(self, person: Person, times: Array) -> Array:
        """Offset of a `person` from constant velocity and growth of the zone at `times`, (n, 3) [m]."""
        steady = np.add(person.position, np.outer(self.times, person.velocity))
        offsets = np.column_stack([self.positions - steady, SPREAD * self.spread])
        knots = np.r_[0.0, self.times]
        return np.column_stack(
            [np.interp(times, knots, np.r_[0.0, each]) for each in offsets.T]
        )

    def later(self, seconds: float) -> Prediction | None:
        """The same prediction for the person `seconds` later; None if nothing of it is left."""
        left = self.times > seconds
        if not left.any():
            return None
        return Prediction(
            self.times[left] - seconds, self.positions[left], self.spread[left]
        )


def list_knots(person: Person, settings: MPCSettings) -> Array:
    """What `Zone` and `Body` of a `person` need for each interval of the horizon of these `settings`."""
    times = settings.times
    offsets = np.zeros((settings.N + 1, 3))
    if person.prediction is not None:
        offsets = person.prediction.sample(person, times)
    rates = np.diff(offsets, axis=0) / np.diff(times)[:, None]
    return np.column_stack([times[1:], rates]).ravel()


SPREAD = 1.64
"""Standard deviations of a predicted position by which the zone grows: 95 % on one side (assumed)."""


def predict(
    people: ArrayLike, times: ArrayLike, positions: Any, spread: Any = 0.0
) -> list[Person]:
    """A list with a `Person` for each row, who has a prediction.

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
    if np.size(people) == 0:
        return []
    rows = check_array("people", people, (..., 4)).reshape(-1, 4).tolist()
    n = len(rows)
    spreads = check_array("spread", spread, (...,))
    positions = check_array("positions", positions, (n, np.size(times), 2))
    spreads = spreads if spreads.ndim else np.full(n, spreads)
    expected = f"a number, or one for each of {n} people"
    check_argument(len(spreads) == n, "spread", spreads.shape, expected)
    return [
        Person((x, y), (vx, vy), prediction=Prediction(times, xy, own))
        for (x, y, vx, vy), xy, own in zip(rows, positions, spreads, strict=True)
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
    heading_unknown : True if they are too slow for the velocity to give the heading: then it is `heading`.
    prediction : where they will be; None: they keep their velocity. The problem, the ways, `Step.safe` and
        `Step.clearance` use it. `Step.passively_safe` is about people who keep their velocity.
    group : with whom they are together: a way between two of a group has a price. None: whoever is near and
        has a like velocity (`szlib.control.ways`).

    Raises
    ------
    SolverError : a number cannot be used: give measurements to `MPCCBF.step` as an array.
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
        heading = self.heading
        if heading is not None:
            heading = check_number("a person's heading", heading)
        elif not (velocity == (0.0, 0.0) or self.heading_unknown):
            heading = atan2(velocity[1], velocity[0])
        vars(self).update(position=position, velocity=velocity, heading=heading)
        if isinstance(self.zone, Ellipse):
            as_ellipse(self.zone, 0.0)
        is_name = isinstance(self.group, Hashable)
        check_argument(is_name, "a group", self.group, "hashable, such as a number")
        is_one = isinstance(self.prediction, Prediction | None)
        check_argument(is_one, "prediction", self.prediction, "a Prediction")

    @property
    def stands(self) -> bool:
        """True if the velocity is zero."""
        return self.velocity == (0.0, 0.0)

    def after(self, seconds: float) -> Person:
        """The same person, `seconds` later, as predicted, but no farther from the origin than `LARGEST`."""
        if not seconds or (self.stands and self.prediction is None):
            return self
        ((place,),) = find_places([self], np.array([seconds]))
        person = self.at(place.clip(-LARGEST, LARGEST))
        if self.prediction is not None:
            vars(person).update(prediction=self.prediction.later(seconds))
        return person

    def at(self, position: ArrayLike) -> Person:
        """The same person at another `position` [m]; only the position is checked, for speed."""
        moved = copy(self)
        vars(moved).update(position=check_point("a person's position", position))
        return moved


def find_places(people: Sequence[Person], times: Array) -> Array:
    """Where `people` are at these `times` from now, as predicted, shape (n, k, 2) [m]."""
    found = [np.zeros((0, len(times), 2))]
    for each in people:
        places = each.position + np.outer(times, each.velocity)
        if each.prediction is not None:
            places += each.prediction.sample(each, times)[:, :2]
        found.append(places[None])
    return np.concatenate(found)


SAME_PLACE = 0.5
"""Distance from where a lost person is expected up to which a new id means the same person [m] (assumed)."""
_LastSeen = tuple[Person, float]  # a person as last seen, and when [s]
People = Sequence[Person] | ArrayLike
"""People: each a `Person`; or an array, shape (n, 4): x, y [m], vx, vy [m/s]."""


class TrackedPeople(NamedTuple):
    """Everybody to be respected now.

    Attributes
    ----------
    people : those given, in their order, then those who are remembered.
    rejected : number of those given whose measurement cannot be used.
    unknown : number of rejected people of whom nothing is known that could take the place of the
        measurement. They are among `people`, as standing where they were measured, only if that position can
        be used.
    fault : what is wrong with the times of measurements, in words; "" if nothing is.
    """

    people: tuple[Person, ...]
    rejected: int = 0
    unknown: int = 0
    fault: str = ""


class Tracker:
    """Remembers people by their ids; see the top of this module.

    Ids are compared by value: take numbers, texts or tuples of these. A copy of a tracker does not recognise
    an id that is equal to nothing but itself, such as an object of a plain class.

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
        self.walking_speed = check_finite("walking_speed", walking_speed, 0.0)
        self.memory = check_finite("memory", memory, 0.0)
        self.reset()

    def reset(self) -> None:
        """Forget everybody, and the time."""
        self._last_seen = dict[Hashable, _LastSeen]()
        self._now = inf
        self._interval = 0.0

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
        people : each a `Person`; or an array, shape (n, 4): x, y [m], vx, vy [m/s]. A heading that a
            `Person` was given is used.
        now : time, of any clock [s].
        ids : one for each of them, None for a person without an id; default: that of each `Person`.
        stamps : when they were measured, one time for each or one for all [s]; default: now.

        Raises
        ------
        SolverError : an argument has the wrong type or shape: an error of the program, not of a sensor.
        """
        now = check_finite("now", now)
        self._set_clock(now)
        measured, given = self._list_measurements(people, now, ids, stamps)
        present = []
        rejected = 0
        unknown = 0
        for person, is_usable, name, time in measured:
            # NaN is not equal to itself, and pandas' NA does not say
            if given[name] > 1 or (name != name) not in {False}:
                name = None
            last = self._last_seen.get(name)
            if is_usable and abs(now - time) <= self.memory:
                if name is None:
                    last = person, time
                else:
                    last = last or self._find_lost(person, time, given)
                    if last is None or time >= last[1]:
                        last = self._identify(person, name, last), time
                    self._last_seen[name] = last
            else:
                rejected += 1
                unknown += last is None
                if last is None and person:
                    last = person, now
            if last:
                present.append(last[0].after(now - last[1]))
        for name, (person, time) in self._last_seen.items():
            if name not in given:
                present.append(person.after(now - time))
        late = [time for *_, time in measured if abs(now - time) > self.memory]
        fault = ""
        if late:
            fault = (
                f"people were measured {max(abs(now - time) for time in late):.3g} s from now, and are "
                f"remembered for {self.memory:g} s only; what helps: `now` by the clock of `stamps`"
            )
        return TrackedPeople(tuple(present), rejected, unknown, fault)

    def _list_measurements(
        self,
        people: People,
        now: float,
        ids: Iterable[Hashable] | None,
        stamps: ArrayLike | None,
    ) -> tuple[list[Any], Counter[Hashable]]:
        """Of each measurement the person, whether it can be used, name and time; how often a name is given.

        `people`, `now`, `ids` and `stamps` are as of `see`.
        """
        listed: Any = people
        try:
            if not isinstance(people, (list, tuple)):
                listed = np.ma.filled(np.asanyarray(people, float), np.nan).tolist()
            names = [getattr(each, "id", None) for each in listed]
            names = names if ids is None else list(ids)
            times = [now] * len(listed)
            if stamps is not None:
                times = np.full(len(listed), stamps, float).tolist()
            measured = [
                (*self._read(each, name), name, time)
                for each, name, time in zip(listed, names, times, strict=True)
            ]
            return measured, Counter(names)
        except (TypeError, ValueError, OverflowError) as error:
            raise SolverError(
                "people must be Persons, or numbers of shape (n, 4): x, y, vx, vy; ids must be a list of "
                "hashable values, one for each; stamps must be one time [s], or one for each; got "
                f"{people!r:.200}, {ids!r:.200}, {stamps!r:.200}: {error}"
            ) from error

    def _set_clock(self, now: float) -> None:
        """Begin a step at the time `now`: forget people; if the clock went back, so do their times."""
        back = 0.0
        if now < self._now:
            back = self._now + self._interval - now
        elif now - self._now <= self.memory:
            self._interval = now - self._now
        self._now = now
        self._last_seen = {
            name: (person, time - back)
            for name, (person, time) in self._last_seen.items()
            if abs(now - (time - back)) <= self.memory
        }

    def _read(self, each: Any, name: Hashable) -> tuple[Any, bool]:
        """The `Person` of a measurement, or None, and True if all of its numbers can be used."""
        if isinstance(each, Person):
            return each, True
        x, y, vx, vy = map(float, each)
        if not hypot(x, y) <= LARGEST:
            return None, False
        speed = hypot(vx, vy)
        is_usable = speed <= LARGEST
        is_slow = not speed >= self.walking_speed
        velocity = (vx, vy) if is_usable else (0.0, 0.0)
        return Person((x, y), velocity, id=name, heading_unknown=is_slow), is_usable

    def _find_lost(
        self, person: Person, time: float, given: dict[Hashable, int]
    ) -> _LastSeen | None:
        """What is known of a `person` whose id is new, by their place; it is not theirs any more."""
        away = {
            name: dist(person.position, lost.after(time - then).position)
            for name, (lost, then) in self._last_seen.items()
            if name not in given
        }
        nearest = min(away, key=away.__getitem__, default=None)
        if away.get(nearest, inf) > SAME_PLACE:
            return None
        return self._last_seen.pop(nearest)

    def _identify(
        self, person: Person, name: Hashable, last: _LastSeen | None
    ) -> Person:
        """A measured `person` with their id, and with the heading that is known of them."""
        heading = person.heading
        vx, vy = person.velocity
        is_slow = hypot(vx, vy) < self.walking_speed and not person.stands
        if heading is None or (is_slow and heading == atan2(vy, vx)):
            heading = last[0].heading if last else None
        known: Any = {
            "id": name,
            "heading": heading,
            "heading_unknown": heading is None,
        }
        is_same = known.items() <= vars(person).items()
        return person if is_same else replace(person, **known)


def check_finite(name: str, value: Any, least: float = -1e300) -> float:
    """A `value` as a float; SolverError, with its `name`, if it is not finite, or below the `least`."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = inf
    if not (abs(number) < inf and number >= least):
        raise SolverError(
            f"{name} must be a finite number, at least {least:g}; got {value!r}"
        )
    return number

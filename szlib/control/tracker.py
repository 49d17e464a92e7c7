"""People from one measurement to the next: their headings, their positions now, and people not seen any more.

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
    the clock   may go back: that step is taken to be as long as the one before, and nobody is forgotten
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from math import atan2, dist, hypot, inf, isfinite
from typing import NamedTuple, TypeGuard, cast

import numpy as np
from numpy.typing import ArrayLike

from ..checks import LARGEST, Array
from ..errors import SolverError
from .person import Person

SAME_PERSON = 2.0
"""Distance from the expected position up to which the same id means the same person [m] (assumed)."""
_LastSeen = tuple[Person, float]  # a person as last seen, and when [s]
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
            if not (isinstance(value, int | float | np.number) and 0 <= value < inf):
                raise SolverError(f"{name} must be a finite number >= 0; got {value!r}")
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
        if now < self._now:
            back = self._now + self._interval - now
            self._last_seen = {
                k: (person, time - back)
                for k, (person, time) in self._last_seen.items()
            }
        elif now - self._now <= self.memory:
            self._interval = now - self._now
        self._now = now
        if (
            ids is None
            and stamps is None
            and not self._last_seen
            and _have_no_ids(people)
        ):
            return TrackedPeople(tuple(people))
        rows = _split_rows(people)
        try:
            names = (
                [getattr(row, "id", None) for row in rows] if ids is None else list(ids)
            )
            given = Counter(names)
        except TypeError as error:
            raise SolverError(
                f"ids must be a list of hashable values; got {ids!r:.200}"
            ) from error
        if len(names) != len(rows):
            raise SolverError(
                f"ids must be one for each of {len(rows)} people; got {len(names)}"
            )
        times = _check_stamps(stamps, len(rows), now)
        self._last_seen = {
            k: v for k, v in self._last_seen.items() if abs(now - v[1]) <= self.memory
        }
        present: list[Person | None] = []
        rejected = unknown = 0
        row: Person | list[float]
        for row, name, time in zip(rows, names, times, strict=True):
            if given[name] > 1 or name != name:  # NaN
                name = None
            last = None if name is None else self._last_seen.get(name)
            if (
                last is not None
                and last[1] <= time <= now + self.memory
                and _is_elsewhere(row, time, *last)
            ):
                self._last_seen[Tracker, name], last = (
                    last,
                    None,
                )  # may be hidden, and has no id any more
            found, usable = self._update(row, name, time, now, last)
            if found is not None and name is not None and (usable or last is not None):
                self._last_seen[name] = found
            present.append(None if found is None else _move_forward(*found, now))
            rejected += not usable or present[-1] is None
            unknown += (not usable and last is None) or present[-1] is None
        present += [
            _move_forward(*seen, now)
            for name, seen in self._last_seen.items()
            if name not in given
        ]
        return TrackedPeople(
            tuple(person for person in present if person is not None), rejected, unknown
        )

    def _update(
        self,
        row: Person | list[float],
        name: Hashable,
        time: float,
        now: float,
        last: _LastSeen | None,
    ) -> tuple[_LastSeen | None, bool]:
        """The last known state of a person, if any, and True if all numbers of the measurement are usable."""
        if isinstance(row, Person) and name is None and time == now:
            return (row, now), True
        x, y, vx, vy = (
            (*row.position, *row.velocity) if isinstance(row, Person) else row
        )
        if not _are_usable(x, y):
            return last, False
        heading, zone = (
            (row.heading, row.zone) if isinstance(row, Person) else (None, None)
        )
        if not abs(now - time) <= self.memory:
            return last or (Person((x, y), zone=zone, id=name), now), False
        if last is not None and time < last[1]:
            return last, True
        if not _are_usable(vx, vy):
            return (Person((x, y), id=name), now) if last is None else (
                last[0].at((x, y)),
                time,
            ), False
        is_given = heading is not None and (
            vx == vy == 0 or name is None or heading != atan2(vy, vx)
        )
        if not is_given and hypot(vx, vy) >= self.walking_speed:
            heading = atan2(vy, vx)
        elif not is_given:
            heading = None if last is None else last[0].heading
        return (
            Person((x, y), (vx, vy), heading, zone, name, heading is None),
            time,
        ), True


def _move_forward(person: Person, time: float, now: float) -> Person | None:
    """A person seen at `time`, moved to `now` at constant velocity; None if that is beyond `LARGEST`."""
    if time == now:
        return person
    (x, y), (vx, vy) = person.position, person.velocity
    position = (x + (now - time) * vx, y + (now - time) * vy)
    return person.at(position) if _are_usable(*position) else None


def _is_elsewhere(
    row: Person | list[float], time: float, person: Person, seen: float
) -> bool:
    """True if the measurement of this `time` is too far from a `person` who was `seen` before."""
    x, y = row.position if isinstance(row, Person) else row[:2]
    expected = _move_forward(person, seen, time)
    return bool(
        expected and _are_usable(x, y) and dist((x, y), expected.position) > SAME_PERSON
    )


def _are_usable(x: float, y: float) -> bool:
    return abs(x) <= LARGEST and abs(y) <= LARGEST


def _have_no_ids(people: People) -> TypeGuard[Sequence[Person]]:
    """True if these are `Person`s without ids."""
    if not isinstance(people, list | tuple):
        return False
    for person in people:  # noqa: SIM110 - all() takes three times as long
        if not isinstance(person, Person) or person.id is not None:
            return False
    return True


def _split_rows(people: People) -> Sequence[Person | list[float]]:
    """People one by one: `Person`s, or (x, y, vx, vy), finite or not."""
    try:
        if not isinstance(people, np.ndarray):
            given = list(cast(Sequence[Person], people))
            if all(isinstance(person, Person) for person in given):
                return given
        numbers = np.asarray(people, float)
    except (TypeError, ValueError, OverflowError) as error:
        raise SolverError(
            f"people must be Persons, or numbers of shape (n, 4); got {people!r:.200}"
        ) from error
    if numbers.size and (numbers.ndim != 2 or numbers.shape[1] != 4):
        raise SolverError(
            f"people as an array must have shape (n, 4): x, y, vx, vy; got {numbers.shape}"
        )
    return cast(list[list[float]], numbers.reshape(-1, 4).tolist())


def _check_stamps(stamps: ArrayLike | None, n: int, now: float) -> list[float]:
    """When each person was measured [s], finite or not."""
    if stamps is None:
        return [now] * n
    times = _as_floats("stamps", stamps)
    if times.shape not in ((), (n,)):
        raise SolverError(
            f"stamps must be one time, or one for each of {n} people; got shape {times.shape}"
        )
    return cast(list[float], np.broadcast_to(times, n).tolist())


def check_time(now: float) -> float:
    """The time `now` [s] as a Python float; SolverError if it is not a finite number."""
    if type(now) is float and isfinite(now):
        return now
    time = _as_floats("now", now)
    if time.shape or not np.isfinite(time):
        raise SolverError(f"now must be a finite time [s]; got {now!r}")
    return float(time)


def _as_floats(name: str, value: ArrayLike) -> Array:
    """The numbers of an argument, finite or not."""
    try:
        return np.asarray(value, float)
    except (TypeError, ValueError, OverflowError) as error:
        raise SolverError(f"{name} must be numbers [s]; got {value!r:.200}") from error

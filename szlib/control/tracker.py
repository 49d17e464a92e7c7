"""People from one look to the next: which way they face, where they are by now, and who is not seen any more.

A sensor has noise, comes late, and loses people. By their ids,

    heading     where they walked when last seen at `walking` or faster; unknown before that, and of people
                without an id whenever they are slower
    now         who was seen at an earlier time is brought forward at constant velocity
    unseen      who is not seen any more is kept, at constant velocity, for `keep` seconds
    set aside   numbers that are not finite, or beyond `LARGEST`, are never used. In their place stands what
                was last known of this id, brought forward; of whom nothing is known is *lost*
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from math import atan2, hypot, inf
from typing import NamedTuple, TypeGuard, cast

import numpy as np
from numpy.typing import ArrayLike

from ..checks import LARGEST
from ..errors import SolverError
from .person import Person

_Known = tuple[Person, float]
"""Somebody as last seen, and when [s]."""
People = Sequence[Person] | ArrayLike
"""Everybody: as `Person`s, or as an array, shape (n, 4): x, y [m], vx, vy [m/s]."""


class Seen(NamedTuple):
    """Everybody to be respected now: those given, in their order, then those unseen for a while.

    `set_aside` counts those given with numbers that could not be used. Of these, `lost` counts those of whom
    nothing is known that could stand in. They are among `people` only if their position could be used, as
    standing there; so `people` is not all that there is to be respected.
    """

    people: tuple[Person, ...]
    set_aside: int = 0
    lost: int = 0


class Tracker:
    """Remembers people by their ids; see the top of this module.

    Parameters
    ----------
    walking : speed from which on a velocity says which way somebody faces [m/s] (assumed: ten times the noise
        of a sensor that is 2 cm/s off).
    keep : how long somebody is remembered, and kept out of, who is not seen any more [s] (assumed).

    Raises
    ------
    SolverError : a parameter is not a finite number >= 0.
    """

    def __init__(self, *, walking: float = 0.2, keep: float = 1.0) -> None:
        for name, value in (("walking", walking), ("keep", keep)):
            if not (isinstance(value, int | float | np.number) and 0 <= value < inf):
                raise SolverError(f"{name} must be a finite number >= 0; got {value!r}")
        self.walking, self.keep = float(walking), float(keep)
        self._known: dict[Hashable, _Known] = {}

    def reset(self) -> None:
        """Forget everybody."""
        self._known.clear()

    def see(
        self,
        people: People = (),
        *,
        now: float,
        ids: Iterable[Hashable] | None = None,
        stamps: ArrayLike | None = None,
    ) -> Seen:
        """Everybody as they are now, from what was seen of them.

        Parameters
        ----------
        people : `Person`s, or an array, shape (n, 4): x, y [m], vx, vy [m/s]. A heading that a `Person` was
            given is theirs.
        now : time, of any clock [s].
        ids : of each of them, None for who has none; default: those of the `Person`s.
        stamps : when they were seen, a time for each or one for all [s]; default: now.

        Raises
        ------
        SolverError : what is given has not the right shape: an error of the program, not of a sensor.
        """
        if ids is None and stamps is None and not self._known and _are_new(people):
            return Seen(tuple(people))
        rows = _rows(people)
        names = [getattr(row, "id", None) for row in rows] if ids is None else list(ids)
        if len(names) != len(rows):
            raise SolverError(f"ids must be one for each of {len(rows)} people; got {len(names)}")
        times = _times(stamps, len(rows), now)
        self._known = {k: known for k, known in self._known.items() if abs(now - known[1]) <= self.keep}
        here: list[Person | None] = []
        set_aside = lost = 0
        row: Person | list[float]
        for row, name, time in zip(rows, names, times, strict=True):
            last = None if name is None else self._known.get(name)
            found, usable = self._look(row, name, time, now, last)
            if found is not None and name is not None and (usable or last is not None):
                self._known[name] = found
            here.append(None if found is None else _forward(*found, now))
            set_aside += not usable or here[-1] is None
            lost += (not usable and last is None) or here[-1] is None
        given = set(names)
        here += [_forward(*known, now) for name, known in self._known.items() if name not in given]
        return Seen(tuple(person for person in here if person is not None), set_aside, lost)

    def _look(
        self, row: Person | list[float], name: Hashable, time: float, now: float, last: _Known | None
    ) -> tuple[_Known | None, bool]:
        """What is known of them by now, if anything, and whether all of their numbers could be used."""
        if isinstance(row, Person) and name is None and time == now:
            return (row, now), True
        x, y, vx, vy = (*row.position, *row.velocity) if isinstance(row, Person) else row
        if not _usable(x, y, now - time):
            return last, False
        if _usable(vx, vy):
            return (self._turned(row, name, last), time), True
        if last is None:
            return (Person((x, y), id=name), now), False
        return (last[0].at((x, y)), time), False

    def _turned(self, row: Person | list[float], name: Hashable, last: _Known | None) -> Person:
        """Somebody whose numbers can be used, facing where they are known to."""
        x, y, vx, vy = (*row.position, *row.velocity) if isinstance(row, Person) else row
        heading, zone = (row.heading, row.zone) if isinstance(row, Person) else (None, None)
        told = heading is not None and (vx == vy == 0 or name is None or heading != atan2(vy, vx))
        if not told and hypot(vx, vy) >= self.walking:
            heading = atan2(vy, vx)
        elif not told:
            heading = None if last is None else last[0].heading
        return Person((x, y), (vx, vy), heading, zone, name, heading is None)


def _forward(person: Person, time: float, now: float) -> Person | None:
    """Somebody seen at a time, by now; None if that is beyond `LARGEST`."""
    if time == now:
        return person
    (x, y), (vx, vy) = person.position, person.velocity
    reached = (x + (now - time) * vx, y + (now - time) * vy)
    return person.at(reached) if _usable(*reached) else None


def _usable(*numbers: float) -> bool:
    return all(abs(number) <= LARGEST for number in numbers)


def _are_new(people: People) -> TypeGuard[Sequence[Person]]:
    """True if these are `Person`s of whom nobody has an id."""
    if not isinstance(people, list | tuple):
        return False
    for person in people:  # noqa: SIM110 - all() takes three times as long
        if not isinstance(person, Person) or person.id is not None:
            return False
    return True


def _rows(people: People) -> Sequence[Person | list[float]]:
    """Everybody, one by one: `Person`s, or (x, y, vx, vy), finite or not."""
    if not isinstance(people, np.ndarray):
        given = list(cast(Sequence[Person], people))
        if all(isinstance(person, Person) for person in given):
            return given
    try:
        numbers = np.asarray(people, float)
    except (TypeError, ValueError) as error:
        raise SolverError(f"people must be Persons, or numbers of shape (n, 4); got {people!r}") from error
    if numbers.size and (numbers.ndim != 2 or numbers.shape[1] != 4):
        raise SolverError(f"people as an array must have shape (n, 4): x, y, vx, vy; got {numbers.shape}")
    return cast(list[list[float]], numbers.reshape(-1, 4).tolist())


def _times(stamps: ArrayLike | None, n: int, now: float) -> list[float]:
    """When each was seen [s], finite or not."""
    if stamps is None:
        return [now] * n
    times = np.asarray(stamps, float)
    if times.shape not in ((), (n,)):
        raise SolverError(f"stamps must be one time, or one for each of {n} people; got shape {times.shape}")
    return cast(list[float], np.broadcast_to(times, n).tolist())

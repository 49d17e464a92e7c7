"""Solvers for any number of people and walls: some sizes are built before they are needed, for all others.

A slot that is not taken holds a zone, or a wall, far away, and of a size so far below zero that its h is
`UNFELT` or more in every state: its rows never bind, and their multipliers stay zero. So the solution is that
of the problem without the slot, and which sizes have been built so far changes nothing but the time.

To build a size takes as long as a hundred steps. So a controller builds some when it is made, and the next
one, in a thread of its own, from when half of its slots are taken. A size that is not there by the time it is
needed is built in place.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from functools import lru_cache
from threading import Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..problem import BUILDING, Budget, ProblemSolver
from ..settings import MPCSettings
from .ipopt import Ipopt
from .sqp import Sqp

_log = logging.getLogger("szlib")

READY = 8
"""How many people a controller is ready for, unless it is told (assumed)."""
UNFELT = 1e9
"""h of an empty slot, at least [m]."""
_AWAY = 1e6
"""How far from the robot it is put [m]: a distance has a gradient there, of length 1."""


def rounded(n: int) -> int:
    """The size for so many: 0, 1, 2, 3, 4, 6, 8, 12, ..., so that at most a third of the slots is empty."""
    power = 1 << (n - 1).bit_length() if n else 0
    return power - power // 4 if n <= power - power // 4 else power


def up_to(largest: int) -> Iterator[int]:
    """Every size up to this one."""
    size = 0
    while size <= largest:
        yield size
        size = rounded(size + 1)


class Sizes:
    """The solvers of one controller, by how many people and walls there are.

    Parameters
    ----------
    settings : of the controller.
    max_people : how many people to be ready for; None: `READY`, and more of them ahead of the need.
    n_walls : how many walls there are, at first.
    """

    def __init__(self, settings: MPCSettings, max_people: int | None, n_walls: int) -> None:
        self.settings, self.budget = settings, Budget(settings.time_limit)
        self.ready, self._grows = rounded(READY if max_people is None else max_people), max_people is None
        self._solvers: dict[tuple[int, int], ProblemSolver] = {}
        self._begun = {(self.ready, rounded(n_walls))}
        self._builder: Thread | None = None
        self._build(self.ready, rounded(n_walls))

    def of(self, n_people: int, n_walls: int) -> ProblemSolver:
        """The solver for so many people and walls; it has `Evaluator.size` slots for them."""
        people, walls = size = rounded(n_people), rounded(n_walls)
        if people > self.ready:
            _log.info("the controller was built for %d people and now grows to %d", self.ready, people)
            self.ready, self._grows = people, True
        if size not in self._solvers:
            self._add(people, walls)
        if self._builder is None or not self._builder.is_alive():
            if self._grows and 2 * n_people >= self.ready:
                self.ready *= 2
            if (self.ready, walls) not in self._begun:
                self._begun.add((self.ready, walls))
                self._builder = Thread(target=self._build, args=(self.ready, walls), name="szlib sizes")
                self._builder.start()
        return self._solvers[size]

    def __getstate__(self) -> dict[str, Any]:
        remembered = {size: solver.remembered.copy() for size, solver in list(self._solvers.items())}
        return {"settings": self.settings, "ready": self.ready, "grows": self._grows, "solvers": remembered}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Build the same sizes, which remember the same."""
        self.__init__(state["settings"], 0, 0)  # type: ignore[misc]
        self.ready, self._grows = state["ready"], state["grows"]
        for size, remembered in state["solvers"].items():
            self._add(*size)
            self._solvers[size].remembered = remembered

    def reset(self) -> None:
        """Let every solver forget what it remembers from call to call."""
        for solver in list(self._solvers.values()):
            solver.reset()

    def _build(self, largest: int, walls: int) -> None:
        """Every size up to the largest number of people."""
        for people in up_to(largest):
            self._add(people, walls)

    def _add(self, people: int, walls: int) -> None:
        """One size, unless it is there already: who comes second waits for who came first."""
        with BUILDING:
            if (people, walls) not in self._solvers:
                solver = _solver(self.settings, people, walls)
                solver.budget = self.budget
                self._solvers[people, walls] = solver


def _solver(settings: MPCSettings, n_people: int, n_walls: int) -> ProblemSolver:
    return (Sqp if settings.solver == "sqp" else Ipopt)(settings, n_people, n_walls)


def slots(
    x: Sequence[float],
    zones: Sequence[Sequence[float]],
    walls: Sequence[Sequence[float]],
    size: tuple[int, int],
) -> list[float]:
    """Zones (7 numbers each) and walls (5) as in `Problem.parameters`, with empty slots up to `size`.

    `x` is the state of the robot, (x, y, vx, vy) [m, m/s]; the walls come one after another.
    """
    there, y = x[0] + _AWAY, x[1]
    numbers: list[float] = []
    for zone in zones:
        numbers += zone
    numbers += (size[0] - len(zones)) * (there, y, there, y, -UNFELT, 0.0, 0.0)
    for wall in walls:
        numbers += wall
    numbers += (size[1] - len(walls)) * (there, y, there, y + 1.0, -UNFELT)
    return numbers


@lru_cache
def taken(n_people: int, n_walls: int, size: tuple[int, int]) -> slice | NDArray[np.intp]:
    """Which rows of people and walls are those of slots that are taken."""
    if n_people == size[0] or n_walls == 0:
        return slice(n_people + n_walls)
    return np.array([*range(n_people), *range(size[0], size[0] + n_walls)])

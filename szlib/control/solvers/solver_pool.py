"""A pool of solvers for different numbers of people and walls.

Solvers exist for some sizes only. An unused slot of a solver holds a zone or a wall far away, with a size so
far below zero that its h is at least `INACTIVE_H` in every state. Its rows never bind, and their multipliers
stay zero. So the solution is that of the problem without the slot, and the sizes that exist change nothing
but the time.

Building a size takes as long as a hundred steps. So a controller builds some sizes when it is made, and the
next one in a background thread as soon as half of its slots are used. A size that is missing when it is
needed is built at once.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import lru_cache
from itertools import chain
from threading import Thread
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..problem import CASADI_LOCK, ProblemSolver, TimeBudget
from ..settings import MPCSettings
from .ipopt import Ipopt
from .sqp import Sqp

DEFAULT_MAX_PEOPLE = (
    8  # number of people for whom solvers are built by default (assumed)
)
INACTIVE_H = 1e9  # smallest h of an unused slot [m]
_AWAY = 1e6  # distance of an unused slot from the robot [m]: its distance has a gradient there, of length 1


def round_up_size(n: int) -> int:
    """Smallest size for `n` people or walls: 0, 1, 2, 3, 4, 6, 8, 12, ...; at most a third is unused."""
    power = 1 << (n - 1).bit_length() if n else 0
    return power - power // 4 if n <= power - power // 4 else power


class SolverPool:
    """The solvers of one controller, one for each size.

    Parameters
    ----------
    settings : of the controller.
    max_people : number of people to prepare for; None: `DEFAULT_MAX_PEOPLE`, and more before they are needed.
    n_walls : number of walls at the start.
    """

    def __init__(
        self, settings: MPCSettings, max_people: int | None, n_walls: int
    ) -> None:
        self.settings, self.budget = (
            settings,
            TimeBudget(settings.time_limit, settings.deadline),
        )
        self._grows = max_people is None
        self.max_people = round_up_size(
            DEFAULT_MAX_PEOPLE if max_people is None else max_people
        )
        self._solvers: dict[tuple[int, int], ProblemSolver] = {}
        self._begun = {(self.max_people, round_up_size(n_walls))}
        self._builder: Thread | None = None
        self._build(self.max_people, round_up_size(n_walls))

    def get(self, n_people: int, n_walls: int) -> ProblemSolver:
        """Get the solver for `n_people` and `n_walls`; it has `PlanEvaluator.size` slots for them."""
        people, walls = size = round_up_size(n_people), round_up_size(n_walls)
        if people > self.max_people:
            logging.getLogger("szlib").info(
                "the controller was built for %d people and now grows to %d",
                self.max_people,
                people,
            )
            self.max_people, self._grows = people, True
        if size not in self._solvers:
            self._add(people, walls)
        if self._builder is None or not self._builder.is_alive():
            if self._grows and 2 * n_people >= self.max_people:
                self.max_people *= 2
            if (self.max_people, walls) not in self._begun:
                self._begun.add((self.max_people, walls))
                self._builder = Thread(
                    target=self._build,
                    args=(self.max_people, walls),
                    name="szlib solver pool",
                )
                self._builder.start()
        return self._solvers[size]

    def __getstate__(self) -> dict[str, Any]:
        remembered = {
            size: solver.remembered.copy()
            for size, solver in list(self._solvers.items())
        }
        settings, max_people, grows = self.settings, self.max_people, self._grows
        return {
            "settings": settings,
            "max_people": max_people,
            "grows": grows,
            "solvers": remembered,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Build the same sizes, with the same multipliers."""
        self.__init__(state["settings"], 0, 0)  # type: ignore[misc]
        self.max_people, self._grows = state["max_people"], state["grows"]
        for size, remembered in state["solvers"].items():
            self._add(*size)
            self._solvers[size].remembered = remembered

    def reset(self) -> None:
        """Let every solver forget its multipliers."""
        for solver in list(self._solvers.values()):
            solver.reset()

    def _build(self, largest: int, walls: int) -> None:
        """Build every size up to the largest number of people."""
        for people in sorted({round_up_size(n) for n in range(largest + 1)}):
            self._add(people, walls)

    def _add(self, people: int, walls: int) -> None:
        """Build one size unless it exists; a second thread waits for the first."""
        with CASADI_LOCK:
            if (people, walls) not in self._solvers:
                kind = Sqp if self.settings.solver == "sqp" else Ipopt
                solver: ProblemSolver = kind(self.settings, people, walls)
                solver.budget = self.budget
                self._solvers[people, walls] = solver


def padded_parameters(
    x: Sequence[float],
    barriers: Sequence[Sequence[float]],
    walls: Sequence[Sequence[float]],
    size: tuple[int, int],
) -> list[float]:
    """Parameters of zones and walls as in `Problem.parameters`, with unused slots up to the size.

    Parameters
    ----------
    x : state of the robot, (x, y, vx, vy) [m, m/s].
    barriers : of people, 9 numbers each: see `Problem`.
    walls : 5 numbers each: end points and margin [m].
    size : number of people and of walls of the solver.
    """
    away, y = x[0] + _AWAY, x[1]
    no_person = (away, y, away, y, -INACTIVE_H, 0.0, 0.0, 1.0, INACTIVE_H)
    no_wall = (away, y, away, y + 1.0, -INACTIVE_H)
    slots = [
        *barriers,
        *[no_person] * (size[0] - len(barriers)),
        *walls,
        *[no_wall] * (size[1] - len(walls)),
    ]
    return list(chain.from_iterable(slots))


@lru_cache
def active_rows(
    n_people: int, n_walls: int, size: tuple[int, int]
) -> slice | NDArray[np.intp]:
    """Rows of `n_people` and `n_walls` among the slots of a solver of this `size`."""
    if n_people == size[0] or n_walls == 0:
        return slice(n_people + n_walls)
    return np.array([*range(n_people), *range(size[0], size[0] + n_walls)])

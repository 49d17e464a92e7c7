"""Random states and meetings for the controller, from a seed, for tests and benchmarks."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import szlib
from szlib.core.checks import Array

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7), 0.0)
PAPER_ZONE = szlib.Ellipse(
    (0.03197926920546479, -0.00029110391250195336),
    (0.9641442601156448, 0.7550394491386551),
    0.02296741922148504,
)
"""The zone of the paper's method at 1.1 m/s on the synthetic plaza of seed 0, as in notebooks 09 to 11."""


@dataclass(frozen=True)
class Question:
    """A state from which to plan."""

    state: Array
    goal: Array
    people: tuple[szlib.Person, ...]
    walls: Array

    def ask(
        self,
        settings: szlib.MPCSettings,
        make: Callable[..., szlib.MPCCBF] = szlib.MPCCBF,
    ) -> szlib.Step:
        """The step of a new controller."""
        controller = make(ZONE, walls=self.walls, settings=settings)
        return controller.step(self.state, self.goal, self.people)


def questions(seed: int) -> Iterator[Question]:
    """Safe states at any speed, among up to three people who walk and up to two walls; endless."""
    rng = np.random.default_rng(seed)
    while True:
        people = tuple(
            szlib.Person(tuple(rng.uniform(-3, 3, 2)), tuple(rng.uniform(-0.5, 0.5, 2)))
            for _ in range(rng.integers(0, 4))
        )
        starts = rng.uniform(-4, 4, (rng.integers(0, 3), 1, 2))
        walls = np.concatenate(
            [starts, starts + rng.uniform(-3, 3, starts.shape)], axis=1
        )
        state = np.r_[rng.uniform(-3, 3, 2), rng.uniform(-0.6, 0.6, 2)]
        goal = rng.uniform(-6, 6, 2)
        controller = szlib.MPCCBF(ZONE, walls=walls)
        h = np.r_[controller.barriers(state[:2], people), controller.barriers(goal)]
        if h.min(initial=np.inf) >= 0:
            yield Question(state, goal, people, walls)


def meetings(seed: int) -> Iterator[tuple[szlib.Scenario, str]]:
    """Exactly symmetric meetings with a free way, and the place: open, corridor or wall; endless.

    At any angle, with a person who stands or walks, faces the robot or not; a corridor
    is symmetric; a wall is on the right of the robot, so that only the left is free.
    """
    rng = np.random.default_rng(seed)
    while True:
        angle, before, behind = rng.uniform((-np.pi, 3.0, 2.0), (np.pi, 6.0, 5.0))
        ahead = np.array([np.cos(angle), np.sin(angle)])
        left = np.array([-ahead[1], ahead[0]])
        center, walks = rng.uniform(-3, 3, 2), rng.random() < 0.5
        velocity = -ahead * rng.uniform(0.2, 0.6) if walks else np.zeros(2)
        facing = angle + (np.pi if walks or rng.random() < 0.5 else 0.0)
        person = szlib.Person(tuple(center), tuple(velocity), heading=facing)
        place = ("open", "corridor", "wall")[rng.integers(3)]
        beside = {"open": [], "corridor": [1, -1], "wall": [-1]}[place]
        away = rng.uniform(2.2, 3.0) if place == "corridor" else rng.uniform(0.7, 1.2)
        walls = [
            center + side * away * left + np.outer([-12, 12], ahead) for side in beside
        ]
        start = np.r_[center - before * ahead, 0, 0]
        yield (
            szlib.Scenario("meeting", start, center + behind * ahead, (person,), walls),
            place,
        )

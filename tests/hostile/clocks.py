"""Clocks, orders and ids at the controller: any time and any id gives a step that is as reported, or an error
of szlib; a consistent clock gives safety between samples too, however late people are measured.

The steps are judged by formulas of our own, and where people are by a tracker of our own.

With a random clock this is held: a step or an error of szlib, a control within its bounds, and a report that
is right for the people whom the step names.  That these people are where it says is held for a consistent
clock alone: `now` grows, and stamps are no later than it and no older than a second.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from decimal import Decimal
from math import atan2, hypot
from typing import Any

import numpy as np
from controller import A_SETTING, BETWEEN, TOLERANCE, Judge, along
from controller import settings_of as any_settings
from tqdm import tqdm

import szlib

STEPS = {False: 600, True: 50_000}
LOOPS = {False: 6, True: 200}
"""Closed loops, each of up to `TICKS` steps."""
TICKS = 60


class Unhashable:
    """An id that compares and has no hash."""

    __hash__ = None


ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
CIRCLE = szlib.Ellipse((0.0, 0.0), (1.1, 1.1))
"""The smallest circle around a person that contains `ZONE` for every heading."""
NAN = float("nan")
TIMES = [0.0, 0.1, -0.1, 1.0, -1.0, 5.0, 1e9, -1e9, 1e18, 1e300, -1e300, 1e308, NAN, np.inf, -np.inf, 5e-324,
         2**70, True, np.float32(0.1), np.int64(3)]  # fmt: skip
NO_TIMES = ["x", "", None, [], [1.0], {}, b"1", 1j, Decimal("1.5"), np.datetime64("2020-01-01"), object(),
            np.zeros(2), [[1.0]], float, 10**400]  # fmt: skip
IDS = [None, 0, 1, 1.0, True, "anna", "", ("a", 1), NAN, np.inf, 2**70, -1, np.int64(1), np.float64("nan"),
       frozenset(), b"x", "x" * 10_000]  # fmt: skip
NO_IDS = [[], {}, set(), Unhashable(), np.zeros(3), ([],)]
NO_LISTS = [5, "abc", {}, object(), iter(()), range(3), [1], [None] * 50, float]
NUMBERS = [0.0, 1e8, 1e9, -1e300, 1e-300, NAN, np.inf, -np.inf]


def attack(long: bool) -> Counter[str]:
    """Count the steps and loops, and what was broken."""
    tally: Counter[str] = Counter()
    attack_arguments(STEPS[long], tally)
    for name, change in CHANGES.items():
        attack_loops(LOOPS[long], tally, name, **change)
    return tally


# any clock


def attack_arguments(count: int, tally: Counter[str], seed: int = 0) -> None:
    """Steps with random people, ids, stamps and times: a step that is as reported, or an error of szlib."""
    with tqdm(total=count, unit="step", desc="random clocks", leave=False) as bar:
        for k in range(max(1, count // A_SETTING)):
            rng = np.random.default_rng([seed, k, 24])
            s = replace(any_settings(rng), terminal="none", time_limit=1.0)
            tracker = szlib.Tracker(
                memory=rng.choice([0.0, 1.0, 1e9]), walking_speed=rng.choice([0.0, 0.2])
            )
            walls = [np.array([(-1.0, 9.0), (4.0, 9.5)])] * int(rng.integers(2))
            controller = szlib.MPCCBF(ZONE, walls=walls, settings=s, tracker=tracker)
            state, goal, clock = (
                rng.uniform(-3, 3, 4) * [1, 1, 0.1, 0.1],
                (4.0, 0.0),
                0.0,
            )
            for i in range(min(A_SETTING, count)):
                clock += s.dt
                people, options = draw(rng, clock)
                where = f"seed [{seed}, {k}, 24], step {i}"
                step = ask(controller, state, goal, people, options, tally, where)
                if step is None:
                    continue
                tally["steps with a random clock"] += 1
                tally["steps with a random clock, safe"] += int(step.safe)
                tally["steps with a random clock, unknown people"] += int(
                    step.unknown > 0
                )
                found = [seen(person) for person in step.scene.people]
                for fault in Judge(s, walls, found).faults(
                    state, np.asarray(goal), step
                ):
                    broken(tally, fault, where)
                if step.safe and step.unknown:
                    broken(tally, "safe with unknown people", where)
                if len(found) + step.unknown < len(people):
                    broken(tally, "fewer people than were given", where)
                if i % 5 == 4:
                    state = np.r_[
                        rng.uniform(-3, 3, 2), rng.uniform(-1, 1, 2) * s.v_max
                    ]
            controller.reset()
            same = szlib.Tracker(
                memory=tracker.memory, walking_speed=tracker.walking_speed
            )
            new = szlib.MPCCBF(ZONE, walls=walls, settings=s, tracker=same)
            after, fresh = (c.step(state, goal, [(0.0, 2.0, 0.3, 0.0)], ids=["a"], stamps=4.9, now=5.0)
                            for c in (controller, new))  # fmt: skip
            if not np.allclose(after.control, fresh.control, atol=1e-4):
                broken(
                    tally,
                    "a reset controller differs from a new one",
                    f"seed [{seed}, {k}, 24]",
                )
            bar.update(A_SETTING)


def ask(
    controller: Any,
    state: Any,
    goal: Any,
    people: Any,
    options: Any,
    tally: Counter[str],
    where: str,
) -> Any:
    """The step, or None where it was refused; anything but an error of szlib is broken."""
    try:
        return controller.step(state, goal, people, **options)
    except szlib.SzlibError:
        tally["random clocks refused"] += 1
    except Exception as error:
        broken(
            tally,
            f"{type(error).__name__} instead of an error of szlib",
            f"{where}: {options!r:.300}",
        )
    return None


def draw(rng: np.random.Generator, clock: float) -> tuple[Any, dict[str, Any]]:
    """People, and ids, stamps and now: mostly what a sensor might give, sometimes what nothing gives."""

    def choose(pool: list[Any]) -> Any:
        return pool[rng.integers(len(pool))]

    def time() -> Any:
        return clock + choose(TIMES) if rng.random() < 0.7 else choose(TIMES)

    count = int(rng.integers(0, 7))
    people = rng.uniform([-6, -6, -1, -1], [6, 6, 1, 1], (count, 4))
    for row in people:
        if rng.random() < 0.1:
            row[rng.integers(4)] = choose(NUMBERS)
    ids = [choose(IDS) for _ in range(count)]
    options: dict[str, Any] = {}
    if rng.random() < 0.7:
        options["ids"] = list(rng.permutation(np.array([*ids, None], object))[:count])
    if count and rng.random() < 0.02:
        options["ids"] = [*ids[:-1], choose(NO_IDS)]
    if rng.random() < 0.8:
        options["now"] = time()
        if rng.random() < 0.6:
            options["stamps"] = (
                time() if rng.random() < 0.5 else [time() for _ in range(count)]
            )
    for name, pool in (("now", NO_TIMES), ("stamps", NO_TIMES), ("ids", NO_LISTS)):
        if rng.random() < 0.01:
            options[name] = choose(pool)
    return people, options


def seen(person: szlib.Person) -> szlib.Person:
    """A person with the zone and the heading that `Judge` needs; without a heading, the circle around it."""
    zone = CIRCLE if person.heading is None else ZONE
    return replace(
        person, heading=person.heading or 0.0, zone=zone, heading_unknown=False
    )


# a consistent clock


def attack_loops(count: int, tally: Counter[str], name: str, **change: Any) -> None:
    """Closed loops in random worlds, with people who are measured late or not at all."""
    for seed in tqdm(range(count), unit="loop", desc=name, leave=False):
        Loop(seed, tally, name, **change).run()
        tally[f"loops, {name}"] += 1


@dataclass
class Loop:
    """A robot among people who keep their velocity, whom a sensor measures exactly, but late or not."""

    seed: int
    tally: Counter[str]
    name: str
    another_dt: bool = False
    """The robot asks for a step after any time, not after dt."""
    goes_back: bool = False
    """The clock goes back now and then: nobody is forgotten, and each such step says so."""
    lag: bool = False
    """The acceleration follows the control with a time constant: no promise of safety, only of the report."""
    rng: np.random.Generator = field(init=False)

    def run(self) -> None:
        """Up to `TICKS` steps."""
        self.rng = rng = np.random.default_rng([self.seed, 7])
        s = szlib.MPCSettings(dt=float(rng.choice([0.05, 0.1, 0.2])), gamma=float(rng.choice([0.05, 0.3])),
                              terminal=str(rng.choice(["none", "rest"])))  # fmt: skip
        world = szlib.Worlds()(88_000_000 + self.seed)
        walls, start = list(world.walls), float(rng.choice([0.0, 1.75e9]))
        controller = szlib.MPCCBF(ZONE, walls=walls, settings=s)
        x, u, now, hidden, back = (
            world.start.astype(float),
            np.zeros(2),
            start,
            set[int](),
            0.0,
        )
        for i in range(TICKS):
            where = f"{self.name}, seed {self.seed}, step {i}"
            truth = [person.after(now - start) for person in world.people]
            hidden = {
                k
                for k in range(len(truth))
                if i and k not in hidden and rng.random() < 0.2
            }
            shown = [int(k) for k in rng.permutation(len(truth)) if k not in hidden]
            late = rng.uniform(0, 0.4, len(shown))
            then = [truth[k].after(-by) for k, by in zip(shown, late, strict=True)]
            rows = np.reshape(
                [[*person.position, *person.velocity] for person in then], (-1, 4)
            )
            ids, jump = (
                [f"p{k}" for k in shown],
                rng.uniform(1, 9) * (self.goes_back and i % 7 == 5),
            )
            back += jump
            step = controller.step(
                x, world.goal, rows, ids=ids, stamps=now - back - late, now=now - back
            )
            if bool(step.clock) != bool(jump) and not self.another_dt:
                broken(
                    self.tally,
                    "a clock that goes back is not reported, or one that does not is",
                    where,
                )
            found = [int(person.id[1:]) for person in step.scene.people]
            if (
                sorted(found) != list(range(len(truth)))
                or step.unknown
                or step.rejected
            ):
                broken(self.tally, "somebody is forgotten", where)
                return
            judge = Judge(s, walls, [self.person(truth[k]) for k in found])
            gone = [abs(np.subtract(p.position, truth[k].position)).max()
                    for p, k in zip(step.scene.people, found, strict=True)]  # fmt: skip
            if max(gone, default=0.0) > 1e-6 * (1 if start == 0 else 10):
                broken(self.tally, "somebody is not where the step says", where)
            for fault in Judge(s, walls, [seen(p) for p in step.scene.people]).faults(
                x, world.goal, step
            ):
                broken(self.tally, fault, where)
            held = float(rng.uniform(0.2, 3.0)) * s.dt if self.another_dt else s.dt
            self.tally[f"steps, {self.name}"] += 1
            if self.lag:
                x, u = self.follow(x, u, step.control, held)
                overlap = judge.gaps(x[:2], held).min(initial=1.0) < -TOLERANCE
                self.tally[f"overlaps after a safe step, {self.name}"] += int(
                    step.safe and overlap
                )
            else:
                if step.safe:
                    self.tally[f"steps safe, {self.name}"] += 1
                    (a, b), times = (
                        along(x, step.control, (0.0, s.dt)),
                        min(held, s.dt) * BETWEEN,
                    )
                    bow = hypot(*step.control) * s.dt**2 / 8
                    excess = judge.between(
                        a, b, along(x, step.control, times), times, bow, s.dt
                    )
                    if excess < -1e-5 or (
                        held >= s.dt and judge.h(b, s.dt).min(initial=1) < -1e-5
                    ):
                        broken(
                            self.tally,
                            "unsafe between samples after a safe step",
                            f"{where}: {excess}",
                        )
                x = np.r_[
                    x[:2] + held * x[2:] + held**2 / 2 * step.control,
                    x[2:] + held * step.control,
                ]
            now += held

    def person(self, person: szlib.Person) -> szlib.Person:
        """A true person as a tracker knows them who sees no heading below 0.2 m/s."""
        vx, vy = person.velocity
        slow = hypot(vx, vy) < 0.2
        return seen(
            replace(
                person, heading=None if slow else atan2(vy, vx), heading_unknown=slow
            )
        )

    def follow(self, x: Any, u: Any, control: Any, seconds: float) -> tuple[Any, Any]:
        """The robot after a control that its motors follow with a time constant of 0.2 s."""
        for _ in range(20):
            u = u + (control - u) * seconds / 20 / 0.2
            x = np.r_[x[:2] + seconds / 20 * x[2:], x[2:] + seconds / 20 * u]
        return x, u


CHANGES: dict[str, dict[str, bool]] = {
    "measured late": {}, "another dt": {"another_dt": True}, "lag of the motors": {"lag": True},
    "clock goes back": {"goes_back": True},
}  # fmt: skip


def broken(tally: Counter[str], what: str, where: str) -> None:
    """Count it, and say where it was."""
    tally[f"broken: {what}"] += 1
    tqdm.write(f"{what}: {where}")

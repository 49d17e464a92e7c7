"""The controller under attack: every step and every world recomputed by formulas of our own.

Nothing of szlib is used to judge it: distances, barriers, motion and bounds are written anew from the paper,
overlaps are Euclidean.
"""

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
from tqdm import tqdm

import szlib
from szlib.simulation.monte_carlo import RolloutSetup

BODY = 0.25
TOLERANCE = 1e-6
NEAR = 1e-7
"""Two computations of the same number may differ by so much, relative to it (at least 1)."""
STEPS = {False: 600, True: 50_000}
A_SETTING = 100
"""Steps with the same settings, people and walls: to build a problem takes as long as some hundred steps."""
WORLDS = {False: 12, True: 20_000}
BETWEEN = np.array([0.25, 0.5, 0.75])
"""Fractions of dt at which the robot is looked at between samples."""
FIRST_WORLD = 77_000_000
CRUEL = {False: 60, True: 3_000}


# formulas of our own


def to_segment(p: Any, wall: Any) -> float:
    """Euclidean distance, by a clamped projection."""
    a, b = np.asarray(wall, float)
    share = min(1.0, max(0.0, (p - a) @ (b - a) / ((b - a) @ (b - a))))
    return float(np.linalg.norm(p - a - share * (b - a)))


def paper_to_segment(p: Any, wall: Any) -> float:
    """Eq. 3-5."""
    a, b = np.asarray(wall, float)
    length = np.linalg.norm(b - a)
    g = ((p[0] - a[0]) * (b[1] - a[1]) - (p[1] - a[1]) * (b[0] - a[0])) / length
    t = ((length / 2) ** 2 - np.sum((p - (a + b) / 2) ** 2)) / length
    return float(np.hypot(g, min(t, 0.0)))


def foci(center: Any, heading: float, zone: szlib.Ellipse) -> Any:
    """The two foci of a zone around a person at `center`, shape (2, 2)."""
    c, s = np.cos(heading), np.sin(heading)
    tilt, off = (
        heading + zone.angle,
        np.sqrt(zone.semi_axes[0] ** 2 - zone.semi_axes[1] ** 2),
    )
    reach = off * np.array([np.cos(tilt), np.sin(tilt)])
    return (
        np.asarray(center)
        + np.array([[c, -s], [s, c]]) @ np.asarray(zone.center)
        + [reach, -reach]
    )


def dip(way: float, near: float) -> float:
    """How far a distance may fall, within a chord of length `way`, below the line between its two ends.

    The chord stays `near` or farther from the points whose mean distance it is.  That has a second derivative
    of at most 1 / near along the chord, and changes by no more than the way.
    """
    return min(way / 2, way**2 / (8 * near) if near > 0 else np.inf)


def to_zone(p: Any, center: Any, heading: float, zone: szlib.Ellipse) -> float:
    """Eq. 7, in the frame of the ellipse."""
    c, s = np.cos(heading), np.sin(heading)
    middle = center + np.array([[c, -s], [s, c]]) @ np.asarray(zone.center)
    tilt = heading + zone.angle
    along = (p - middle) @ np.array([np.cos(tilt), np.sin(tilt)])
    across = (p - middle) @ np.array([-np.sin(tilt), np.cos(tilt)])
    a, f = zone.semi_axes[0], np.sqrt(zone.semi_axes[0] ** 2 - zone.semi_axes[1] ** 2)
    return float((np.hypot(along - f, across) + np.hypot(along + f, across)) / 2 - a)


@dataclass
class Judge:
    """What must hold around one robot."""

    s: szlib.MPCSettings
    walls: list[Any]
    people: list[szlib.Person]

    def to_wall(self, p: Any, wall: Any) -> float:
        is_true = self.s.margin == "euclidean"
        return to_segment(p, wall) if is_true else paper_to_segment(p, wall)

    def margin(self, wall: Any) -> float:
        needed = self.s.r_robot**2 / np.linalg.norm(wall[1] - wall[0])
        return max(self.s.eps, needed if self.s.margin == "required" else 0.0)

    def h(self, p: Any, seconds: float = 0.0) -> Any:
        found = []
        for person in self.people:
            center = np.array(person.position) + seconds * np.array(person.velocity)
            found.append(
                to_zone(p, center, person.heading, person.zone)
                - self.s.r_robot
                - self.s.eps
            )
        found += [
            self.to_wall(p, wall) - self.s.r_robot - self.margin(wall)
            for wall in self.walls
        ]
        return np.array(found)

    def gaps(self, p: Any, seconds: float = 0.0) -> Any:
        found = [
            np.linalg.norm(p - person.position - seconds * np.array(person.velocity))
            - BODY
            for person in self.people
        ]
        found += [to_segment(p, wall) for wall in self.walls]
        return np.array(found) - self.s.r_robot

    def floors(self, h: Any, gaps: Any) -> Any:
        """What a plan without hard decay must keep: h of walls, from which it can stop, gaps, zones.

        Negative where it does not; from `h` and `gaps` at each state of the plan, shape (N+1, obstacles).
        """
        people, keep = (
            len(self.people),
            1 - min(1.0, self.s.a_max * self.s.dt / self.s.v_max),
        )
        walls = h[1:, people:] - keep * h[:-1, people:]
        # a zone may have a price
        zones = h[1 : self.s.N_h + 1, :people][
            : self.s.N * (self.s.zone_price == np.inf)
        ]
        rows = (gaps[1:, :people] - self.s.body_gap, walls, zones)
        return np.concatenate([each.ravel() for each in rows])

    def between(
        self, a: Any, b: Any, path: Any, times: Any, bow: float, dt: float
    ) -> float:
        """The least h of people and gap of walls on a `path` between two samples, above what is allowed [m].

        Parameters
        ----------
        a, b : positions at two samples that are `dt` apart, where no h and no gap is negative.
        path, times : positions between them, and when.
        bow : distance by which the path leaves the straight line from a to b, at most [m].
        """
        least = np.inf
        for i, person in enumerate(self.people):
            move = dt * np.array(person.velocity)
            chord, points = (
                (a, b - move),
                foci(person.position, person.heading, person.zone),
            )
            near = min(
                to_segment(point, chord) if np.any(a != b - move) else 0.0
                for point in points
            )
            h = min(self.h(p, time)[i] for p, time in zip(path, times, strict=True))
            least = min(least, h + dip(np.linalg.norm(b - move - a), near) + bow)
        way = np.linalg.norm(b - a)
        for wall in self.walls:
            near = min(to_segment(a, wall), to_segment(b, wall)) - way / 2
            gap = min(to_segment(p, wall) for p in path) - self.s.r_robot
            least = min(least, gap + dip(way, near) + bow)
        return float(least)

    def faults(
        self, state: Any, goal: Any, step: szlib.control.step.Step
    ) -> Iterator[str]:
        """What is not as it should be."""
        s, x = self.s, step.predicted
        if not (np.isfinite(x).all() and np.isfinite(step.control).all()):
            yield "not finite"
            return
        u = np.diff(x[:, 2:], axis=0) / s.dt
        moved = x[:-1, :2] + s.dt * x[:-1, 2:] + s.dt**2 / 2 * u
        if not (
            same(x[0], state) and same(x[1:, :2], moved) and same(u[0], step.control)
        ):
            yield "plan is no motion"
        if (
            max(np.abs(u).max(), np.abs(step.control).max())
            > s.a_max * (1 + NEAR) + NEAR / s.dt
        ):
            yield "out of bounds"
        h = np.array([self.h(p, k * s.dt) for k, p in enumerate(x[:, :2])]).reshape(
            len(x), -1
        )
        rows = (h[1 : s.N_h + 1] - (1 - s.gamma) * h[: s.N_h]).T
        if not same(step.h, h[0]) or not same(
            step.residual, rows, np.abs(h).max(initial=1)
        ):
            yield "h or residual"
        speeding = (x[1:, 2:] ** 2).sum(axis=1).max() - s.v_max**2
        late = np.abs(x[-1, 2:]).max() if s.terminal == "rest" else 0.0
        gaps = np.array(
            [self.gaps(p, k * s.dt) for k, p in enumerate(x[:, :2])]
        ).reshape(len(x), -1)
        hard = rows if s.decay_price == np.inf else self.floors(h, gaps)
        slack = max(0.0, -hard.min(initial=0.0), speeding, late)
        if not same(step.slack, slack, np.abs(h).max(initial=1)):
            yield "slack"
        if step.feasible != (step.slack <= TOLERANCE) or (
            step.status == "optimal" and not step.feasible
        ):
            yield "feasible or status"
        if not same(step.clearance, gaps.T):
            yield "clearance"
        if step.safe:
            ahead = state[:2] + s.dt * state[2:] + s.dt**2 / 2 * step.control
            least = min(
                self.gaps(state[:2]).min(initial=1),
                self.gaps(ahead, s.dt).min(initial=1),
            )
            worst = min(
                self.h(state[:2]).min(initial=1), self.h(ahead, s.dt).min(initial=1)
            )
            if (
                least < -TOLERANCE - NEAR
                or worst < -2 * TOLERANCE - NEAR
                or not step.feasible
            ):
                yield "safe"
        on_goal, people = self.h(np.asarray(goal)) < -NEAR, len(self.people)
        stands = [not any(person.velocity) for person in self.people]
        is_blocked = on_goal[people:].any() or on_goal[:people][stands].any()
        if is_blocked and not step.goal_blocked:
            yield "goal_blocked"


def along(state: Any, control: Any, times: Any) -> Any:
    """Positions of a double integrator at `times` after `state`, shape (n, 2)."""
    times = np.asarray(times)[:, None]
    return state[:2] + times * state[2:] + times**2 / 2 * control


def same(one: Any, other: Any, scale: float = 1.0) -> bool:
    return bool(np.allclose(one, other, rtol=NEAR, atol=NEAR * max(1.0, scale)))


# what is tried


def settings_of(rng: np.random.Generator) -> szlib.MPCSettings:
    """Any settings that a robot may have."""
    n = int(rng.integers(1, 13))
    return szlib.MPCSettings(
        dt=rng.uniform(0.02, 0.4),
        N=n,
        N_h=int(rng.integers(1, n + 1)),
        gamma=10 ** rng.uniform(-2, 0),
        Q=tuple(10 ** rng.uniform(-1, 2, 4)),
        R=tuple(10 ** rng.uniform(-2, 2, 2)),
        P=tuple(10 ** rng.uniform(-1, 3, 4)),
        a_max=rng.uniform(0.2, 4),
        v_max=rng.uniform(0.2, 3),
        r_robot=rng.choice([0.0, rng.uniform(0.05, 0.8)]),
        eps=rng.choice([0.0, 0.05, rng.uniform(0, 0.3)]),
        margin=rng.choice(["required", "euclidean", "paper"]),
        head_on_share=rng.choice([0.0, 0.25, 0.5]),
        pass_side=rng.choice(["left", "right"]),
        terminal=rng.choice(["none", "none", "rest"]),
        decay_price=rng.choice([np.inf, np.inf, 10 ** rng.uniform(0, 3)]),
        body_gap=rng.choice([0.0, rng.uniform(0, 0.3)]),
        guard=bool(rng.random() < 0.7),
    )


def person_of(rng: np.random.Generator) -> szlib.Person:
    a = rng.uniform(0.3, 2)
    zone = szlib.Ellipse(
        tuple(rng.uniform(-0.5, 0.5, 2)),
        (a, a * rng.uniform(0.1, 1)),
        rng.uniform(-3, 3),
    )
    # a zone contains its person
    inside = min(1.0, 0.99 / float(np.sqrt(zone.level((0.0, 0.0)))))
    zone = replace(zone, center=(inside * zone.center[0], inside * zone.center[1]))
    velocity = rng.uniform(-1.5, 1.5, 2) * (rng.random() < 0.6)
    return szlib.Person(
        tuple(rng.uniform(-5, 5, 2)), tuple(velocity), rng.uniform(-4, 4), zone
    )


def attack_steps(count: int, tally: Counter[str], seed: int = 0) -> None:
    """Steps in any state: driven for a while, then thrown elsewhere, with other people and goals."""
    with tqdm(total=count, unit="step", desc="steps", leave=False) as bar:
        for k in range(count // A_SETTING):
            rng = np.random.default_rng([seed, k])
            s, here = (
                settings_of(rng),
                rng.uniform(-5, 5, (rng.integers(0, 5), 1, 2)),
            )
            turns, lengths = (
                rng.uniform(-3, 3, len(here)),
                10 ** rng.uniform(-2, 1.2, len(here)),
            )
            reach = (lengths * np.array([np.cos(turns), np.sin(turns)])).T[:, None]
            walls = list(np.concatenate([here, here + reach], axis=1))
            count_people = int(rng.integers(0, 5))
            controller = szlib.MPCCBF(
                szlib.Ellipse((0, 0), (1, 1)),
                walls=walls,
                settings=s,
            )
            state = goal = people = None
            for i in range(A_SETTING):
                if i % 10 == 0:
                    state = np.r_[
                        rng.uniform(-6, 6, 2), rng.uniform(-1.2, 1.2, 2) * s.v_max
                    ]
                    goal = rng.uniform(-6, 6, 2)
                    people = [
                        person_of(rng) for _ in range(rng.integers(0, count_people + 1))
                    ]
                judge, step = (
                    Judge(s, walls, people),
                    controller.step(state, goal, people),
                )
                tally["steps"] += 1
                tally["steps safe"] += int(step.safe)
                tally[f"steps {step.status}"] += 1
                tally["steps timed out"] += int(step.timed_out)
                for fault in judge.faults(state, goal, step):
                    tally[f"broken: {fault}"] += 1
                    tqdm.write(f"{fault}: seed [{seed}, {k}], step {i}, {s}")
                u = step.control
                state = np.r_[
                    state[:2] + s.dt * state[2:] + s.dt**2 / 2 * u, state[2:] + s.dt * u
                ]
                people = [person.after(s.dt) for person in people]
            bar.update(A_SETTING)


def attack_worlds(seeds: range, tally: Counter[str], **parameters: Any) -> None:
    """Whole runs: motion, barriers, overlaps, and what was said of them, from the states alone."""
    for seed in tqdm(seeds, unit="world", leave=False):
        log = RolloutSetup(**parameters).run(seed)
        judge = Judge(log.settings, list(log.scenario.walls), list(log.scenario.people))
        dt, x, u = log.settings.dt, log.states, log.controls[:-1]
        times = dt * np.arange(len(x))
        h = np.array(
            [judge.h(p, t) for p, t in zip(x[:, :2], times, strict=True)]
        ).reshape(len(x), -1)
        gaps = np.array(
            [judge.gaps(p, t) for p, t in zip(x[:, :2], times, strict=True)]
        ).reshape(len(x), -1)
        people, numbers = len(judge.people), log.metrics()
        moved = np.c_[x[:-1, :2] + dt * x[:-1, 2:] + dt**2 / 2 * u, x[:-1, 2:] + dt * u]
        tally["worlds"] += 1
        tally["worlds with h < 0"] += int(h.min(initial=1) < -TOLERANCE)
        tally["broken: a wall is touched"] += int(
            gaps[:, people:].min(initial=1) < -TOLERANCE
        )
        tally["worlds with an overlap of a person"] += int(
            gaps[:, :people].min(initial=1) < -TOLERANCE
        )
        said = log.safe[:-1]
        tally["broken: safe before h < 0"] += int(
            (said & (h[1:].min(axis=1, initial=1) < -1e-5)).sum()
        )
        tally["broken: safe before an overlap"] += int(
            (said & (gaps[1:].min(axis=1, initial=1) < -1e-5)).sum()
        )
        for k in np.flatnonzero(said):
            near = replace(
                judge, people=[person.after(times[k]) for person in judge.people]
            )
            bow, moments = np.hypot(*u[k]) * dt**2 / 8, dt * BETWEEN
            path = along(x[k], u[k], moments)
            least = near.between(x[k, :2], x[k + 1, :2], path, moments, bow, dt)
            tally["broken: unsafe between samples after a safe step"] += int(
                least < -1e-5
            )
        tally["broken: no motion"] += int(not same(x[1:], moved))
        tally["broken: out of bounds"] += bool(
            (np.abs(u) > log.settings.a_max + NEAR).any()
        )
        tally["broken: metrics"] += not (
            same(numbers["min_h"], h.min(initial=np.inf))
            and same(numbers["min_clearance"], gaps.min())
            if h.size
            else True
        )


def cruel_states(seed: int) -> Iterator[tuple[Any, Any, list[szlib.Person], list[Any]]]:
    """Deep inside zones that move against each other, at speed, between walls: here steps take longest."""
    rng = np.random.default_rng(seed)
    zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    while True:
        x, spread, pace = (
            rng.uniform(-2, 2, 2),
            rng.choice([0.01, 0.3, 1.5]),
            rng.choice([0.0, 0.7, 1.0, 3.0]),
        )
        walls = [
            np.array([p, p + rng.uniform(-3, 3, 2)])
            for p in rng.uniform(-2, 2, (rng.integers(5), 2))
        ]
        people = [
            szlib.Person(
                tuple(x + rng.normal(0, spread, 2)),
                tuple(rng.uniform(-1, 1, 2)),
                zone=zone,
            )
            for _ in range(rng.integers(1, 6))
        ]
        yield np.r_[x, rng.uniform(-1, 1, 2) * pace], (30.0, 20.0), people, walls


def attack_time(count: int, tally: Counter[str], **settings: Any) -> None:
    """The time that a step takes of its thread, against its limit."""
    s = szlib.MPCSettings(N_h=8, gamma=0.5, **settings)
    took = []
    for state, goal, people, walls in tqdm(
        islice(cruel_states(5), count),
        total=count,
        desc="cruel",
        leave=False,
    ):
        controller = szlib.MPCCBF(
            szlib.Ellipse((0, 0), (1, 1)), walls=walls, settings=s
        )
        begun = time.thread_time()
        step = controller.step(state, goal, people)
        took.append(time.thread_time() - begun)
        tally["cruel states"] += 1
        tally["timed out"] += int(step.timed_out)
        for fault in Judge(s, walls, people).faults(state, goal, step):
            tally[f"broken: {fault}"] += 1
    for name, share in (("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999), ("max", 1.0)):
        longest = 1e3 * float(np.quantile(took, share))
        tally[f"{name} of cruel steps [ms]"] = round(longest, 2)
    # clocks of computing time may tick every 10 ms
    over = sum(each > 2 * s.time_limit for each in took)
    tally["broken: took longer than two limits"] += over


def attack(long: bool) -> Counter[str]:
    tally: Counter[str] = Counter()
    attack_steps(STEPS[long], tally)
    attack_worlds(range(FIRST_WORLD, FIRST_WORLD + WORLDS[long] // 2), tally)
    rest = szlib.MPCSettings(terminal="rest")
    attack_worlds(
        range(FIRST_WORLD, FIRST_WORLD + WORLDS[long] // 2), tally, settings=rest
    )
    attack_time(CRUEL[long], tally)
    return tally

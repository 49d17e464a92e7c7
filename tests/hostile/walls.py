"""The controller's promises about walls and bodies under attack: corridors, and a search for bad worlds.

From any state that can stop, the robot must never touch a wall, whatever people do, appear or vanish, and
whatever a sensor says about them.  The judge has its own geometry and looks ten times a step.

*Corridors*: two and three people abreast, beside one wall or between two, towards the robot and along its
way.  *Search*: islands of worlds of 2 to 4 s.  Half of an island is drawn, half mutates its worst worlds.
Each world begins in a state from which full braking touches no wall.  An island depends on its number alone,
so that any part of a search can be run again, or in another process:

    python tests/hostile/walls.py search 1000 --first 0      # 1000 worlds, from island 0 on
    python tests/hostile/walls.py corridors 200              # 200 runs of each controller
"""

import argparse
import multiprocessing
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import szlib
from szlib.control import STATUSES, HalfPlane

BODY = 0.25
TOLERANCE = 1e-6
ROUNDING = 1e-8
SUBSTEPS = 10
AT_SPEED = 0.05  # a robot that is faster moves [m/s]
AT_REST = 1e-3
ISLAND = 40  # worlds; half of them are drawn
PARENTS = 4
WORLDS = {False: 40, True: 20_000}
RUNS = {False: 1, True: 200}
PROCESSES = {False: 1, True: 2}
OMEGA_MAX = 4.0  # of two wheels [rad/s]
ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))

Settings = szlib.MPCSettings
AMONG = Settings.among_people
# Name: how the settings are made, what they change, and whether the robot has two wheels.
SETTINGS: dict[str, tuple[Any, dict[str, Any], bool]] = {
    "default": (Settings, {}, False),
    "default, decay_price 30": (Settings, {"decay_price": 30.0}, False),
    "default, body_gap 0.3": (Settings, {"body_gap": 0.3}, False),
    "default, eps 0": (Settings, {"eps": 0.0}, False),
    "default, margin paper": (Settings, {"margin": "paper"}, False),
    "default, margin euclidean": (Settings, {"margin": "euclidean"}, False),
    "default, gamma 1": (Settings, {"gamma": 1.0}, False),
    "default, a_max 0.2": (Settings, {"a_max": 0.2}, False),
    "default, dt 0.05": (Settings, {"dt": 0.05}, False),
    "default, dt 0.4": (Settings, {"dt": 0.4}, False),
    "rest": (Settings, {"terminal": "rest", "N": 12}, False),
    "rest, decay_price 100": (
        Settings,
        {"terminal": "rest", "N": 12, "decay_price": 100.0},
        False,
    ),
    "N 1": (Settings, {"N": 1, "N_h": 1}, False),
    "N 1, gamma 1, a_max 0.3": (
        Settings,
        {"N": 1, "N_h": 1, "gamma": 1.0, "a_max": 0.3, "decay_price": 50.0},
        False,
    ),
    "among people": (AMONG, {}, False),
    "among people, decay_price inf": (AMONG, {"decay_price": np.inf}, False),
    "among people, eps 0": (AMONG, {"eps": 0.0, "body_gap": 0.0}, False),
    "among people, dt 0.3": (AMONG, {"dt": 0.3}, False),
    "two wheels": (Settings, {}, True),
    "two wheels, among people": (AMONG, {}, True),
    "two wheels, eps 0, dt 0.2": (Settings, {"eps": 0.0, "dt": 0.2}, True),
    "two wheels, a_max 0.3": (AMONG, {"a_max": 0.3}, True),
}


# geometry of our own


def to_segments(points: Any, walls: Any) -> Any:
    """Euclidean distances of `points` (k, 2) to `walls` (n, 4), shape (n, k)."""
    a, along = walls[:, None, :2], walls[:, None, 2:] - walls[:, None, :2]
    away = points[None] - a
    share = np.clip((away * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
    return np.linalg.norm(away - share[..., None] * along, axis=-1)


def wall_gaps(points: Any, world: "World") -> Any:
    """Gaps of the disc to walls and half-planes at `points` (k, 2), shape (n, k)."""
    found = [to_segments(points, world.walls)] if len(world.walls) else []
    found += [(points - plane[:2]) @ plane[2:] for plane in world.planes]
    gaps = [np.reshape(each, (-1, len(points))) for each in found]
    return np.concatenate([*gaps, np.empty((0, len(points)))]) - world.radius


def cross(begin: Any, end: Any, walls: Any) -> Any:
    """True for each of the `walls` (n, 4) that the segment from `begin` to `end` crosses."""

    def side(a: Any, b: Any, c: Any) -> Any:
        d, e = b - a, c - a
        return d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]

    a, b = walls[:, :2], walls[:, 2:]
    return (side(a, b, begin) * side(a, b, end) < 0) & (
        side(begin, end, a) * side(begin, end, b) < 0
    )


def segment_gap(begin: Any, end: Any, world: "World") -> float:
    """Smallest gap of the disc that moves straight from `begin` to `end` to all walls and half-planes."""
    least = wall_gaps(np.array([begin, end]), world).min(initial=np.inf)
    if len(world.walls) and np.any(begin != end):
        if cross(begin, end, world.walls).any():
            return -world.radius - 1e-3
        way = np.r_[begin, end][None]
        corners = world.walls.reshape(-1, 2)
        least = min(least, to_segments(corners, way).min() - world.radius)
    return float(least)


def brake(state: Any, s: Any) -> tuple[Any, Any, Any]:
    """Points, times and speeds of a double integrator that brakes as hard as it can, in steps of dt."""
    p, v, now = np.array(state[:2]), np.array(state[2:]), 0.0
    points, times, speeds = [p], [0.0], [np.hypot(*v)]
    while np.abs(v).max() > 1e-12:
        u = -v / max(s.dt, np.abs(v).max() / s.a_max)
        for share in np.arange(1, SUBSTEPS + 1) / SUBSTEPS:
            t = share * s.dt
            points.append(p + t * v + t**2 / 2 * u)
            times.append(now + t)
            speeds.append(np.hypot(*(v + t * u)))
        p, v, now = points[-1], v + s.dt * u, now + s.dt
    return np.array(points), np.array(times), np.array(speeds)


def stopping_gap(state: Any, world: "World", s: Any) -> float:
    """Smallest gap to a wall if the robot brakes as hard as it can from `state`, (x, y, vx, vy)."""
    points, *_ = brake(state, s)
    return segment_gap(points[0], points[-1], world)


def focal(points: Any, centers: Any, heading: float, zone: Any) -> Any:
    """Focal distance of `points` to a zone of a person at `centers`, both (k, 2) (paper, eq. 7)."""
    turn = np.array(
        [[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]
    )
    a, b = zone.semi_axes
    tilt, reach = heading + zone.angle, np.sqrt(a**2 - b**2)
    middle = centers + turn @ np.array(zone.center)
    off = reach * np.array([np.cos(tilt), np.sin(tilt)])
    to_foci = [np.linalg.norm(points - middle + sign * off, axis=1) for sign in (1, -1)]
    return sum(to_foci) / 2 - a


# worlds


@dataclass
class World:
    """A robot, what stands around it, and people with a sensor that may err.

    Attributes
    ----------
    start : (x, y, vx, vy); of two wheels vx, vy give heading and speed.
    walls, planes : segments (n, 4), and points and normals of half-planes (m, 4).
    people : of each x, y, vx, vy at the time it appears, and when it appears and vanishes, the amplitude and
        frequency of its zigzag, when it jumps, and how far in x and y, shape (k, 11).
    faults : of the sensor of each: the share of NaN, the error of the velocity, and how often its id changes
        [steps], 0 for no id, shape (k, 3).
    """

    settings: str
    radius: float
    v_max: float
    start: Any
    goal: Any
    walls: Any
    planes: Any
    people: Any
    faults: Any
    seconds: float
    seed: int
    origin: str = field(default="", compare=False)

    def make_settings(self) -> Any:
        make, changes, _ = SETTINGS[self.settings]
        own = {"r_robot": self.radius, "v_max": self.v_max, "time_limit": np.inf}
        return make(**{**own, **changes})

    def make_controller(self) -> Any:
        planes = [HalfPlane(each[:2], each[2:]) for each in self.planes]
        kind = szlib.DifferentialDrive if SETTINGS[self.settings][2] else szlib.MPCCBF
        return kind(
            ZONE,
            walls=self.walls.reshape(-1, 2, 2),
            obstacles=planes,
            settings=self.make_settings(),
        )

    @property
    def is_possible(self) -> bool:
        """True if full braking from the start touches no wall, with a hair to spare."""
        return stopping_gap(self.start, self, self.make_settings()) > 1e-4

    def see(self, t: float, k: int, rng: Any) -> tuple[Any, Any]:
        """People as measured at the time t, in step k, shape (n, 4), and their ids."""
        rows, ids = [], []
        for i, person in enumerate(self.people):
            x, y, vx, vy, begins, ends, wide, often, jump, jx, jy = person
            share, error, change = self.faults[i]
            noise, is_nan = rng.normal(0.0, 1.0, 2), rng.random(4) < share
            if not begins <= t < ends:
                continue
            past, jumps = t - begins, t >= jump
            across = np.array([-vy, vx]) / (np.hypot(vx, vy) or 1.0)
            at = np.array([x, y]) + past * np.array([vx, vy])
            at = at + wide * np.sin(often * past) * across + jumps * np.array([jx, jy])
            velocity = np.array([vx, vy]) + wide * often * np.cos(often * past) * across
            row = np.r_[at, velocity + error * noise]
            rows.append(np.where(is_nan, np.nan, row))
            ids.append((i, k // int(change)) if change else None)
        return np.reshape(rows, (-1, 4)), ids


def draw_walls(rng: Any, at: Any, radius: float) -> Any:
    """1 to 6 walls around a point."""
    walls = list[Any]()
    count = int(rng.integers(1, 7))
    while len(walls) < count:
        turn, away = rng.uniform(-np.pi, np.pi), radius + rng.exponential(0.4)
        out = np.array([np.cos(turn), np.sin(turn)])
        side = np.array([-out[1], out[0]])
        base = at + away * out
        kind = rng.choice(
            [
                "long",
                "short",
                "pillar",
                "corner",
                "wedge",
                "gap",
                "cross",
                "corridor",
                "end",
            ]
        )
        if kind == "long":
            walls.append(np.r_[base - 20 * side, base + 20 * side])
        elif kind == "end":  # the wall ends beside the robot
            walls.append(np.r_[base, base + rng.uniform(1, 20) * side])
        elif kind == "short":
            tip = base + rng.uniform(0.05, 1.5) * rotate(out, rng.uniform(-3, 3))
            walls.append(np.r_[base, tip])
        elif kind == "pillar":
            length = 10 ** rng.uniform(-2.9, -1)
            walls.append(np.r_[base, base + length * rotate(out, rng.uniform(-3, 3))])
        elif kind == "corner":
            reach = rng.uniform(0.3, 5, 2)
            walls.append(np.r_[base, base + reach[0] * side])
            walls.append(
                np.r_[base, base - reach[1] * rotate(side, rng.uniform(-2, 2))]
            )
        elif kind == "wedge":
            tip, half = at + (away + 2) * out, rng.uniform(0.05, 0.9)
            walls += [
                np.r_[tip, tip - 6 * rotate(out, sign * half)] for sign in (1, -1)
            ]
        elif kind == "gap":
            half = radius * rng.uniform(0.8, 1.6)
            walls += [
                np.r_[base + sign * half * side, base + sign * 8 * side]
                for sign in (1, -1)
            ]
        elif kind == "cross":
            for _ in range(2):
                arm = rng.uniform(0.2, 3) * rotate(out, rng.uniform(-3, 3))
                walls.append(np.r_[base - arm, base + arm])
        else:
            half = radius + rng.exponential(0.3)
            walls += [
                np.r_[
                    at + sign * half * side - 10 * out,
                    at + sign * half * side + 10 * out,
                ]
                for sign in (1, -1)
            ]
    return np.array(walls)


def rotate(vector: Any, angle: float) -> Any:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ vector


def draw_person(rng: Any, start: Any) -> tuple[Any, Any]:
    """Mostly someone near, who walks towards the robot."""
    turn, away = rng.uniform(-np.pi, np.pi), rng.uniform(0.3, 4.0)
    at = start[:2] + away * np.array([np.cos(turn), np.sin(turn)])
    aim = start[:2] + rng.uniform(0, 1.5) * start[2:] + rng.normal(0, 0.4, 2) - at
    pace = rng.choice([0.0, 0.5, 1.2, 1.6, 2.5]) * rng.uniform(0.7, 1.1)
    velocity = pace * aim / (np.hypot(*aim) or 1.0)
    begins = rng.choice([0.0, rng.uniform(0, 2)])
    ends = rng.choice([99.0, begins + rng.uniform(0.1, 2)])
    zigzag = rng.random() < 0.3
    wide, often = zigzag * rng.uniform(0, 0.5), rng.uniform(2, 8)
    jump = rng.choice([99.0, 99.0, rng.uniform(0, 3)])
    person = [*at, *velocity, begins, ends, wide, often, jump, *rng.normal(0, 1, 2)]
    faults = [
        rng.choice([0.0, 0.0, rng.uniform(0, 0.3)]),
        rng.choice([0.0, 0.0, rng.uniform(0, 1)]),
        rng.choice([0, 1, 3, 1000, 1000]),
    ]
    return person, faults


def draw_world(rng: Any, name: str | None = None) -> World:
    """A random world in which the robot can stop."""
    while True:
        chosen = name or str(rng.choice(list(SETTINGS)))
        radius = float(rng.choice([0.3, 0.5, rng.uniform(0.02, 0.8)]))
        v_max = float(rng.choice([1.0, 1.0, rng.uniform(0.3, 2.0)]))
        turn, speed = rng.uniform(-np.pi, np.pi), rng.choice([0.0, 0.5, 1.0, 1.0, 1.3])
        is_drive = SETTINGS[chosen][2]
        speed = min(speed, 0.9) if is_drive else speed
        velocity = speed * v_max * np.array([np.cos(turn), np.sin(turn)])
        start = np.r_[rng.uniform(-1, 1, 2), velocity]
        goal = start[:2] + rotate(
            np.array([rng.uniform(0.5, 6), 0.0]), turn + rng.normal(0, 0.7)
        )
        walls = draw_walls(rng, start[:2] + rng.uniform(0, 0.6) * velocity, radius)
        if rng.random() < 0.1:  # more walls than are always in the problem
            places = rng.uniform(-8, 8, (26, 2))
            walls = np.concatenate(
                [walls, np.hstack([places, places + rng.normal(0, 1, (26, 2))])]
            )
        planes = []
        for _ in range(int(rng.choice([0, 0, 0, 1, 2]))):
            normal = rotate(np.array([1.0, 0.0]), rng.uniform(-3, 3))
            planes.append(
                np.r_[start[:2] - (radius + rng.exponential(0.4)) * normal, normal]
            )
        drawn = [draw_person(rng, start) for _ in range(int(rng.integers(1, 7)))]
        world = World(
            chosen, radius, v_max, start, goal, walls, np.reshape(planes, (-1, 4)),
            np.array([each for each, _ in drawn]), np.array([each for _, each in drawn]),
            float(rng.uniform(2, 4)), int(rng.integers(2**31)), "drawn",
        )  # fmt: skip
        if world.is_possible:
            return world


def mutate(world: World, rng: Any) -> World:
    """A world much like another one; the same if no try is possible."""
    for _ in range(20):
        size = 10 ** rng.uniform(-2.5, -0.3)
        new = replace(world, origin="mutated", seed=int(rng.integers(2**31)))
        what = rng.integers(6)
        if what == 0:
            new.start = world.start + size * rng.normal(0, 1, 4)
        elif what == 1:
            new.goal = world.goal + 3 * size * rng.normal(0, 1, 2)
        elif what == 2:
            new.walls = world.walls.copy()
            new.walls[rng.integers(len(new.walls))] += size * rng.normal(0, 1, 4)
        elif what == 3:
            new.people = world.people.copy()
            new.people[rng.integers(len(new.people)), :9] += size * rng.normal(0, 1, 9)
        elif what == 4:
            at = rng.integers(len(world.people))
            new.people, new.faults = world.people.copy(), world.faults.copy()
            new.people[at], new.faults[at] = draw_person(rng, world.start)
        else:
            new.walls = np.vstack(
                [world.walls, draw_walls(rng, world.start[:2], world.radius)[:1]]
            )
        longest = np.hypot(*(new.walls[:, 2:] - new.walls[:, :2]).T).min() > 1.1e-3
        speed = np.hypot(*new.start[2:])
        is_slow = not SETTINGS[world.settings][2] or speed <= 0.95 * world.v_max
        if longest and is_slow and new.is_possible:
            return new
    return world


# the judge


def arc(own: Any, control: Any, times: Any) -> Any:
    """(x, y) of two wheels that hold (v, omega), at `times`, shape (k, 2), and the heading at each."""
    (x, y, theta), (v, omega) = own[:3], control
    half = omega * times / 2
    chord = v * times * np.sinc(half / np.pi)
    points = np.stack(
        [x + chord * np.cos(theta + half), y + chord * np.sin(theta + half)], axis=1
    )
    return points, theta + omega * times


@dataclass
class Robot:
    """Where a robot is, and how it moves, by formulas of our own."""

    own: Any
    is_drive: bool
    dt: float

    @classmethod
    def of(cls, start: Any, is_drive: bool, dt: float) -> "Robot":
        if not is_drive:
            return cls(np.array(start), False, dt)
        x, y, vx, vy = start
        return cls(
            np.array([x, y, np.arctan2(vy, vx), np.hypot(vx, vy), 0.0]), True, dt
        )

    def move(self, control: Any) -> tuple[Any, Any, Any]:
        """Advance by dt: points and speeds at times within the step."""
        t = np.linspace(0.0, self.dt, SUBSTEPS + 1)
        if self.is_drive:
            points, headings = arc(self.own, control, t)
            self.own = np.array([*points[-1], headings[-1], *control])
            return points, np.full(len(t), abs(control[0])), t
        v = self.own[2:] + t[:, None] * control
        points = (
            self.own[:2] + t[:, None] * self.own[2:] + t[:, None] ** 2 / 2 * control
        )
        self.own = np.r_[points[-1], v[-1]]
        return points, np.hypot(*v.T), t


def body_faults(
    points: Any, speeds: Any, times: Any, step: Any, radius: float, longest: int = 1
) -> Iterator[str]:
    """How the robot overlaps a known body while it moves, if people keep their velocity.

    `longest` is the number of dt in the longest step of the way: its ends are known to move away from a body
    that it overlaps, what is between them may bend towards it.
    """
    is_moving = np.maximum(speeds, np.r_[speeds[1:], 0.0]) > AT_REST
    s = step.scene.settings
    bend = OMEGA_MAX * s.v_max if hasattr(step, "point") else 2**0.5 * s.a_max
    curve = bend * (longest * s.dt) ** 2 / 8 + 1e-5
    for person in step.scene.people:
        centers = np.array(person.position) + times[:, None] * np.array(person.velocity)
        gaps = np.linalg.norm(points - centers, axis=1) - BODY - radius
        if gaps[0] >= 0:
            if gaps[is_moving].min(initial=0.0) < -TOLERANCE - ROUNDING:
                yield f"overlaps a body by {-gaps[is_moving].min():.2g} m"
        else:
            nearer = (points - points[0]) @ (centers[0] - points[0])
            nearer = nearer / (np.linalg.norm(centers[0] - points[0]) or 1.0)
            if nearer.max() > curve:
                yield f"moves {nearer.max():.2g} m towards a body that it overlaps"


def claim_faults(
    step: Any, before: Any, robot: Robot, moved: Any, world: World
) -> Iterator[str]:
    """Which claims of a step are broken by what follows."""
    s, (points, speeds, times) = world.make_settings(), moved
    limits = [s.v_max, OMEGA_MAX] if robot.is_drive else s.a_max
    if not (np.abs(step.control) <= np.multiply(limits, 1 + ROUNDING)).all():
        yield f"out of bounds: {step.control}"
    gaps = wall_gaps(points, world)
    least = gaps.min(initial=np.inf)
    if len(world.walls) and cross(points[0], points[-1], world.walls).any():
        least = -np.inf
    if step.walls_safe and least < -TOLERANCE - ROUNDING:
        yield f"walls_safe: touches a wall within the step, {least:.2g} m"
    if step.walls_safe and not robot.is_drive:
        stop = stopping_gap(robot.own, world, s)
        if stop < -TOLERANCE - ROUNDING:
            yield f"walls_safe: cannot stop after the step, {stop:.2g} m"
    if step.passively_safe:
        found = list(body_faults(points, speeds, times, step, world.radius))
        if found:
            yield f"passively_safe: within the step {found[0]}"
        elif not robot.is_drive and (
            faults := way_faults(step, before, robot, world, s)
        ):
            yield f"passively_safe: {faults}"
    if step.safe:
        if least < -TOLERANCE - ROUNDING:
            yield "safe: touches a wall"
        for person, zone in zip(
            step.scene.people, step.scene.person_zones, strict=True
        ):
            centers = np.array(person.position) + times[:, None] * np.array(
                person.velocity
            )
            h = focal(points, centers, person.heading or 0.0, zone) - s.r_robot - s.eps
            gap = np.linalg.norm(points - centers, axis=1) - BODY - s.r_robot
            worst = min(h[0], h[-1], (h + s.eps).min(), gap.min())
            if worst < -2 * TOLERANCE:
                yield f"safe: {worst:.2g} m to a person"


def way_faults(step: Any, before: Any, robot: Robot, world: World, s: Any) -> str:
    """A body that is overlapped both if the robot brakes after dt and if it follows its plan to the end."""
    faults = list[str]()
    for inputs, lengths in (
        (step.inputs[:1], [1]),
        (step.inputs, s.grid or [1] * s.N),
    ):
        way, speed, time, state, now = [], [], [], before, 0.0
        for u, m in zip(inputs, lengths, strict=True):
            t = np.linspace(0.0, m * s.dt, SUBSTEPS * m + 1)
            v = state[2:] + t[:, None] * u
            way.append(state[:2] + t[:, None] * state[2:] + t[:, None] ** 2 / 2 * u)
            speed.append(np.hypot(*v.T))
            time.append(now + t)
            state, now = np.r_[way[-1][-1], v[-1]], now + m * s.dt
        points, times, speeds = brake(state, s)
        found = next(
            body_faults(
                np.vstack([*way, points]),
                np.concatenate([*speed, speeds]),
                np.concatenate([*time, now + times]),
                step,
                world.radius,
                max(lengths),
            ),
            "",
        )
        if not found:
            return ""
        faults.append(found)
    return "; and ".join(faults)


def run_world(
    world: World, tally: Counter[tuple[str, str]], report: Any = print
) -> float:
    """Run one world; the lower the number that is returned, the worse it is."""
    s, controller = world.make_settings(), world.make_controller()
    robot = Robot.of(world.start, SETTINGS[world.settings][2], s.dt)
    rng, least, hard, was_safe = np.random.default_rng(world.seed), np.inf, 0, False
    steps, decided, kinds = max(3, int(world.seconds / s.dt)), set[str](), set[str]()

    def count(what: str, n: int = 1) -> None:
        tally[world.settings, what] += n

    def fault(what: str, k: int) -> None:
        kind = what.partition(":")[0]
        count(f"broken: {kind}")
        if kind not in kinds:  # the first of each kind in a world
            report(f"{world.settings} [{world.origin}] step {k}: {what}")
        kinds.add(kind)

    for k in range(steps):
        people, ids = world.see(k * s.dt, k, rng)
        before = robot.own
        step = controller.step(robot.own, world.goal, people, ids=ids)
        moved = robot.move(step.control)
        count(f"steps {step.status}")
        decided.add(step.status)
        hard += step.status != "optimal"
        gaps = wall_gaps(moved[0], world)
        least = min(least, gaps.min(initial=np.inf))
        if was_safe and not step.walls_safe:
            fault("walls_safe lost", k)
        elif k == 0 and not step.walls_safe:  # bounds of gaps are not sharp
            count("worlds not called walls_safe at first")
        was_safe = step.walls_safe
        for what in claim_faults(step, before, robot, moved, world):
            fault(what, k)
        if not (verdict := step.verify()).ok:
            fault(f"verify: {verdict.faults[0]}", k)
        if len(world.walls) and cross(moved[0][0], moved[0][-1], world.walls).any():
            fault("centre crosses a wall", k)
    count("worlds")
    count("steps", steps)
    for status in decided:
        count(f"worlds with {status}")
    if least < -TOLERANCE - ROUNDING:
        fault(f"wall touched: {least:.3g} m", steps)
    return float(least - 0.2 * len(kinds) - 0.05 * hard / steps)


# the search


def list_worlds(number: int, run: Any = None) -> Iterator[tuple[World, Any]]:
    """The worlds of an island, and the counts of each: half are drawn, half mutate the worst.

    Parameters
    ----------
    number : of the island.
    run : called with a world, its counts and a place in the island; returns how bad the world is.
    """
    rng, found = np.random.default_rng([number, 33]), list[tuple[float, int, World]]()
    for i in range(ISLAND):
        if i < ISLAND // 2:
            world = draw_world(rng)
        else:
            found.sort(key=lambda each: each[:2])
            world = mutate(found[rng.integers(PARENTS)][2], rng)
        tally = Counter[tuple[str, str]]()
        found.append((run(world, tally, i) if run else 0.0, i, world))
        yield world, tally


def search_island(number: int, report: Any = print) -> Counter[tuple[str, str]]:
    """Counts of an island, by settings; "drawn" counts the worlds that are drawn."""
    total = Counter[tuple[str, str]]()

    def run(world: World, tally: Counter[tuple[str, str]], i: int) -> float:
        tell = lambda text: report(f"island {number}, world {i}: {text}")  # noqa: E731
        return run_world(world, tally, tell)

    for world, tally in list_worlds(number, run):
        total += tally
        if world.origin == "drawn":
            total.update({("drawn", what): n for (_, what), n in tally.items()})
    return total


def find_world(number: int, place: int) -> World:
    """The world at a `place` of an island, to look at it again."""
    is_mutated = place >= ISLAND // 2

    def run(world: World, tally: Counter[tuple[str, str]], i: int) -> float:
        return run_world(world, tally, lambda text: None)

    worlds = list_worlds(number, run if is_mutated else None)
    return next(world for i, (world, _) in enumerate(worlds) if i == place)


def search(first: int, count: int, processes: int = 1) -> Counter[tuple[str, str]]:
    """Islands from the number `first` on, `count` worlds in all."""
    islands, tally = (
        range(first, first - (-count // ISLAND)),
        Counter[tuple[str, str]](),
    )
    if processes == 1:
        for number in islands:
            tally += search_island(number)
        return tally
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for found in pool.imap_unordered(search_island, islands):
            tally += found
    return tally


# corridors

CORRIDORS = {
    "default": (Settings, {}, False),
    "among people": (AMONG, {}, False),
    "two wheels": (Settings, {}, True),
    "two wheels, among people": (AMONG, {}, True),
}


def run_corridor(name: str, seed: int, report: Any = print) -> Counter[tuple[str, str]]:
    """People abreast in a corridor, or beside a wall."""
    rng, tally = np.random.default_rng([seed, 44]), Counter[tuple[str, str]]()
    radius, width = float(rng.choice([0.3, 0.5])), rng.uniform(2.0, 4.0)
    sides = [[-20, 0, 20, 0], [-20, width, 20, width]][: int(rng.integers(1, 3))]
    count, towards = int(rng.integers(2, 4)), rng.random() < 0.6
    paces = rng.uniform(0.8, 1.6) + rng.choice([0.0, 0.1]) * rng.normal(0, 1, count)
    apart = rng.uniform(0.5, 0.8)
    low, high = BODY, max(BODY, width - BODY - apart * (count - 1))
    ys = rng.uniform(low, high) + apart * np.arange(count)
    free = radius + 0.06 + 2 * SETTINGS[name][2] * 0.3
    y = rng.uniform(min(free, width / 2), max(width - free, width / 2))
    if towards:
        xs, velocity = rng.uniform(3, 8) + rng.normal(0, 0.1, count), -paces
    else:
        xs, velocity = (
            rng.choice([-1, 1]) * rng.uniform(2, 4) + rng.normal(0, 0.1, count),
            paces,
        )
    people = np.c_[xs, ys, velocity, np.zeros(count)]
    speed = rng.choice([0.0, 0.6])
    world = World(
        name, radius, 1.0, np.array([0.0, y, speed, 0.0]), np.array([9.0, y]), np.array(sides, float),
        np.empty((0, 4)), people, np.zeros((count, 3)), 14.0, seed,
    )  # fmt: skip
    s, controller = world.make_settings(), world.make_controller()
    robot, was_safe, least, broken = (
        Robot.of(world.start, SETTINGS[name][2], s.dt),
        True,
        np.inf,
        set[str](),
    )
    stands: dict[int, Any] = {}  # where the robot would stand, by person
    overlapped = set[int]()
    for k in range(int(world.seconds / s.dt)):
        now = people.copy()
        now[:, :2] += k * s.dt * people[:, 2:]
        before = robot.own
        for i in range(count):
            if i not in stands and np.linalg.norm(now[i, :2] - before[:2]) < 3:
                v = (
                    before[2:]
                    if not robot.is_drive
                    else before[3] * np.array([np.cos(before[2]), np.sin(before[2])])
                )
                stands[i] = brake(np.r_[before[:2], v], s)[0][-1]
        step = controller.step(robot.own, world.goal, now, ids=list(range(count)))
        moved = points, speeds, t = robot.move(step.control)
        tally[name, f"steps {step.status}"] += 1
        tally[name, "steps"] += 1
        least = min(least, wall_gaps(points, world).min())
        if was_safe and not step.walls_safe:
            broken.add("walls_safe lost")
        was_safe = step.walls_safe
        broken |= set(claim_faults(step, before, robot, moved, world))
        if not (verdict := step.verify()).ok:
            broken.add(f"verify: {verdict.faults[0]}")
        if cross(points[0], points[-1], world.walls).any():
            broken.add("centre crosses a wall")
        for i in range(count):
            centers = now[i, :2] + t[:, None] * now[i, 2:]
            overlaps = (
                np.linalg.norm(points - centers, axis=1) < BODY + radius - TOLERANCE
            )
            if (overlaps & (speeds > AT_SPEED)).any() and i not in overlapped:
                overlapped.add(i)
                tally[name, "overlaps at speed"] += 1
                ways = np.hstack([people[:, :2], people[:, :2] + 99 * people[:, 2:]])
                misses = to_segments(stands[i][None], ways)[:, 0] >= BODY + radius
                if misses.all():
                    broken.add(
                        f"overlap: standing still would have avoided it (person {i}, step {k})"
                    )
                elif misses[i]:  # others would have walked into it
                    tally[name, "overlaps of a person who would have passed"] += 1
    tally[name, "worlds"] += 1
    tally[name, "arrived"] += int(np.linalg.norm(robot.own[:2] - world.goal) < 0.3)
    if least < -TOLERANCE - ROUNDING:
        broken.add(f"wall touched: {least:.3g} m")
    for what in broken:
        tally[name, f"broken: {what.partition(':')[0]}"] += 1
        report(f"corridor {name}, seed {seed}: {what}")
    return tally


def corridors(runs: int) -> Counter[tuple[str, str]]:
    tally = Counter[tuple[str, str]]()
    for name in CORRIDORS:
        for seed in range(runs):
            tally += run_corridor(name, seed)
    return tally


def table(tally: Counter[tuple[str, str]]) -> str:
    """The counts as a table of Markdown, a line for each kind of settings."""
    columns = ["worlds", "steps", *(f"steps {each}" for each in STATUSES)]
    columns += sorted({what for _, what in tally} - set(columns))
    lines = [
        "| settings | " + " | ".join(columns) + " |",
        "|---" + "|--:" * len(columns) + "|",
    ]
    for name in dict.fromkeys(name for name, _ in tally):
        lines.append(
            f"| {name} | "
            + " | ".join(str(tally[name, each]) for each in columns)
            + " |"
        )
    return "\n".join(lines)


def attack(long: bool) -> Counter[str]:
    """Both attacks, as counts of all settings together."""
    searched = search(0, WORLDS[long], PROCESSES[long])
    walked = corridors(RUNS[long])
    print(table(searched), table(walked), sep="\n\n")
    tally = Counter[str]()
    for found, prefix in ((searched, ""), (walked, "corridors: ")):
        for (name, what), n in found.items():
            if what.startswith("broken"):
                tally[what] += n * (name != "drawn")
            else:
                tally[("drawn worlds: " if name == "drawn" else prefix) + what] += n
    return tally


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["search", "corridors"])
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--processes", type=int, default=1)
    given = parser.parse_args()
    if given.what == "search":
        print(table(search(given.first, given.count, given.processes)))
    else:
        print(table(corridors(given.count)))


if __name__ == "__main__":
    main()

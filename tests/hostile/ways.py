"""Ways through people: rows, a U, a second door, groups that stand, people who walk; and maps of many walls.

Each scene knows the length of its shortest free way: from Dijkstra's search on a grid of .05 m around walls
and people who stand, pulled taut.  The search is our own and shares nothing with the controller.  People keep
their velocity; the robot is an exact double integrator, judged ten times a step.

    python tests/hostile/ways.py --seeds 100 --processes 2       # every scene
    python tests/hostile/ways.py --only row,groups --seeds 12
    python tests/hostile/ways.py --building --steps 100          # times of steps among many walls

The kinds of scenes are row, u, door, groups, stream, and corridor.
"""

import argparse
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

import szlib

BODY, RADIUS = 0.25, 0.3
BODY_GAP, WALL_GAP = 0.2, 0.05
"""Gaps of a free way to bodies and to walls [m]; the first is also the bar of a robot that moves."""
CELL, SAMPLE, MARGIN = 0.05, 0.01, 3.0
"""Side of a cell, distance of points on a wall, and floor around a scene, of the search [m]."""
STANDING = 0.1
"""People who are slower stand [m/s]."""
ARRIVED, MOVING, SIDEWAYS = 0.2, 0.01, 0.05
"""Distance from the goal [m]; a robot that is faster moves; a side that counts [m/s]."""
SUBSTEPS = 10
TIME_RATIO, ARRIVALS = 1.5, 0.97
"""Bars: the time of a way, as a multiple of the free way's, and the share of scenes with an arrival."""
TOLERANCE = 1e-6
BARRED = ("row", "u", "door", "groups")
"""Kinds of scenes with people who stand, which the bars are for."""
SEEDS, PROCESSES = {False: 2, True: 100}, {False: 1, True: 2}
NEAR, FAR, WALKERS = (1.5, 5.0), 6.0, 10
"""Distances from the robot at which people appear, and beyond which they vanish [m]; and how many walk."""
MOVES = ((1, 0), (0, 1), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))
NO_WALLS = np.empty((0, 2, 2))


# scenes


@dataclass(frozen=True, eq=False)
class Scene:
    """A robot, its goal, and people and walls between them.

    Attributes
    ----------
    start : (x, y, vx, vy) of the robot.
    people : of each x, y, vx, vy at first, shape (n, 4); they keep their velocity.
    walls : segments, shape (m, 2, 2).
    free_way : length of the shortest way with free space around it [m]; `inf` if there is none.
    """

    name: str
    start: Any
    goal: Any
    people: Any
    walls: Any
    free_way: float


def make_scene(
    name: str,
    people: Any,
    walls: Any = NO_WALLS,
    start: Any = (0.0, 0.0),
    goal: Any = (8.0, 0.0),
) -> Scene:
    """A scene whose robot starts at rest; its free way is searched for."""
    people, walls = np.reshape(people, (-1, 4)), np.reshape(walls, (-1, 2, 2))
    start, goal = np.asarray(start, float), np.asarray(goal, float)
    standing = people[np.hypot(*people[:, 2:].T) < STANDING, :2]
    free_way = find_free_way(start, goal, standing, walls)
    return Scene(name, np.r_[start, 0.0, 0.0], goal, people, walls, free_way)


def make_standing(points: Any) -> Any:
    """People who stand at `points`, shape (n, 4)."""
    points = np.reshape(points, (-1, 2))
    return np.hstack([points, np.zeros_like(points)])


def row(n: int, apart: float = 0.6) -> Scene:
    """`n` people side by side across the way, `apart` from each other, on open floor."""
    sideways = apart * (np.arange(n) - (n - 1) / 2)
    return make_scene(
        f"row of {n}, {apart:g} m", make_standing(np.c_[np.full(n, 4.0), sideways])
    )


def u_of(n: int) -> Scene:
    """`n` people in a U, .8 m apart, that is open towards the robot."""
    along, half = 0.8 * (np.arange(n) - (n - 1) / 2), 0.9
    arms = np.maximum(np.abs(along) - half, 0.0)
    points = np.c_[5.0 - arms, np.clip(along, -half, half)]
    return make_scene(f"U of {n}", make_standing(points))


def second_door() -> Scene:
    """Two rooms with two doors, 1 m wide and 4 m apart; a person stands in the nearer one."""
    outline = [(-2.0, -2.5), (10.0, -2.5), (10.0, 6.5), (-2.0, 6.5), (-2.0, -2.5)]
    between = [(-2.5, -0.5), (0.5, 3.5), (4.5, 6.5)]
    walls = [*zip(outline, outline[1:], strict=False)]
    walls += [((4.0, low), (4.0, high)) for low, high in between]
    return make_scene("second door", make_standing((4.0, 0.0)), walls)


def standing_group(seed: int) -> Scene:
    """3 to 6 people who stand across the way, neighbours .5 to 1.2 m apart."""
    rng = np.random.default_rng([seed, 341])
    n, turn = int(rng.integers(3, 7)), rng.normal(0, 0.3)
    steps = rng.uniform(0.5, 1.2, n - 1)
    turns = np.pi / 2 + turn + rng.normal(0, 0.4, n - 1)
    points = np.zeros((n, 2))
    points[1:] = np.cumsum(steps[:, None] * np.c_[np.cos(turns), np.sin(turns)], axis=0)
    points += (4.0, rng.uniform(-0.5, 0.5)) - points.mean(axis=0)
    return make_scene(f"group {seed}", make_standing(points))


def crossing_stream(seed: int) -> Scene:
    """6 to 12 people who walk across the way from one side or both, some in pairs."""
    rng = np.random.default_rng([seed, 342])
    n, both, rows = int(rng.integers(6, 13)), rng.random() < 0.5, list[Any]()
    while len(rows) < n:
        side = rng.choice([-1, 1]) if both else 1
        turn, pace = side * np.pi / 2 + rng.normal(0, 0.2), rng.uniform(0.8, 1.5)
        velocity = pace * np.array([np.cos(turn), np.sin(turn)])
        crossing = np.array([rng.uniform(2.0, 6.0), 0.0])
        at = crossing - rng.uniform(2.0, 12.0) * velocity
        beside = rng.uniform(0.6, 0.8) * np.array([-velocity[1], velocity[0]]) / pace
        rows += [np.r_[at + k * beside, velocity] for k in range(rng.integers(1, 3))]
    return make_scene(f"stream {seed}", rows[:n])


def person_in_corridor(seed: int) -> Scene:
    """A person who walks in a corridor, towards the robot or slowly ahead, with space to pass."""
    rng = np.random.default_rng([seed, 343])
    width = rng.uniform(2.4, 3.2)
    walls = [[(-10.0, y), (30.0, y)] for y in (0.0, width)]
    y = rng.uniform(BODY + 0.05, width - BODY - 0.05)
    if rng.random() < 0.6:
        person = (rng.uniform(5, 10), y, -rng.uniform(0.8, 1.5), 0.0)
    else:
        person = (rng.uniform(2, 3), y, rng.uniform(0.2, 0.5), 0.0)
    middle, length = rng.uniform(0.5, width - 0.5), rng.uniform(10, 14)
    ends = (0.0, middle), (length, width / 2)
    return make_scene(f"corridor {seed}", person, walls, *ends)


KINDS: dict[str, Callable[[int], list[Callable[[], Scene]]]] = {
    "row": lambda seeds: [partial(row, 3), partial(row, 5), partial(row, 5, 1.2)],
    "u": lambda seeds: [partial(u_of, 7)],
    "door": lambda seeds: [second_door],
    "groups": lambda seeds: [partial(standing_group, k) for k in range(seeds)],
    "stream": lambda seeds: [partial(crossing_stream, k) for k in range(seeds)],
    "corridor": lambda seeds: [partial(person_in_corridor, k) for k in range(seeds)],
}


# the shortest free way


class FreeSpace:
    """Where the robot has gaps of `WALL_GAP` to walls and `BODY_GAP` to people at `bodies` (n, 2)."""

    def __init__(self, bodies: Any, walls: Any) -> None:
        samples = [np.empty((0, 2))]
        for a, b in np.asarray(walls):
            shares = np.linspace(0, 1, 2 + int(np.hypot(*(b - a)) / SAMPLE))[:, None]
            samples.append(a + shares * (b - a))
        self.walls, self.bodies = np.concatenate(samples), np.reshape(bodies, (-1, 2))
        self._trees = [
            (cKDTree(points), gap)
            for points, gap in (
                (self.walls, RADIUS + WALL_GAP),
                (self.bodies, BODY + RADIUS + BODY_GAP),
            )
            if len(points)
        ]

    def holds(self, points: Any) -> Any:
        """True for each of the `points`, shape (..., 2), that is free."""
        is_free = np.ones(np.shape(points)[:-1], bool)
        for tree, gap in self._trees:
            away, _ = tree.query(points, distance_upper_bound=gap)
            is_free &= away >= gap
        return is_free

    def sees(self, a: Any, b: Any) -> bool:
        """True if the straight way from `a` to `b` is free."""
        count = 2 + int(np.hypot(*(b - a)) / (2 * SAMPLE))
        shares = np.linspace(0, 1, count)[:, None]
        return bool(self.holds(a + shares * (b - a)).all())


def find_free_way(start: Any, goal: Any, bodies: Any, walls: Any) -> float:
    """Length of the shortest free way, about 1 % too long at most; `inf` if there is none [m]."""
    space = FreeSpace(bodies, walls)
    if not space.holds(np.array([start, goal])).all():
        return float("inf")
    if space.sees(start, goal):
        return float(np.hypot(*(goal - start)))
    corners = np.concatenate([[start, goal], space.bodies, np.reshape(walls, (-1, 2))])
    low = corners.min(axis=0) - MARGIN
    shape = tuple(np.ceil((corners.max(axis=0) + MARGIN - low) / CELL).astype(int))
    cells = low + CELL * np.moveaxis(np.indices(shape), 0, -1)
    numbers, is_free = np.arange(cells[..., 0].size).reshape(shape), space.holds(cells)
    begins, ends, lengths = list[Any](), list[Any](), list[Any]()
    for dx, dy in MOVES:
        one = slice(0, shape[0] - dx), slice(max(0, -dy), shape[1] - max(0, dy))
        two = slice(dx, shape[0]), slice(max(0, dy), shape[1] - max(0, -dy))
        both = is_free[one] & is_free[two]
        begins.append(numbers[one][both])
        ends.append(numbers[two][both])
        lengths.append(np.full(len(begins[-1]), CELL * np.hypot(dx, dy)))
    places = np.concatenate(begins), np.concatenate(ends)
    graph = coo_array((np.concatenate(lengths), places), shape=(numbers.size,) * 2)
    points, free = cells.reshape(-1, 2), np.flatnonzero(is_free)
    _, (first, last) = cKDTree(points[free]).query(np.array([start, goal]))
    first, last = free[first], free[last]
    _, before = dijkstra(
        graph.tocsr(), directed=False, indices=first, return_predecessors=True
    )
    if before[last] < 0 and first != last:
        return float("inf")
    way = [last]
    while way[-1] != first:
        way.append(before[way[-1]])
    return pull_taut(np.concatenate([[goal], points[way], [start]]), space)


def pull_taut(way: Any, space: FreeSpace, rounds: int = 4) -> float:
    """Length of a `way` (n, 2) after its corners are cut, from both ends in turn [m]."""
    for _ in range(rounds):
        kept, at = [0], 0
        while at < len(way) - 1:
            ahead = len(way) - 1 - at
            while ahead > 1 and not space.sees(way[at], way[at + ahead]):
                ahead = ahead * 4 // 5
            at += ahead
            kept.append(at)
        corners = way[kept]
        lengths = np.hypot(*np.diff(corners, axis=0).T)
        total, travelled = lengths.sum(), np.r_[0.0, np.cumsum(lengths)]
        marks = np.union1d(travelled, np.arange(0.0, total, 2 * CELL))
        way = np.c_[
            np.interp(marks, travelled, corners[:, 0]),
            np.interp(marks, travelled, corners[:, 1]),
        ][::-1]
    return float(total)


# runs


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of a run.

    Attributes
    ----------
    arrived : True if it came within `ARRIVED` of the goal.
    time : of the arrival, or of the whole run [s].
    body_gap : least gap to a body while the robot moves [m].
    wall_gap : least gap to a wall at any time [m].
    side_changes : how often it turned from going to the left to going to the right, or back.
    step_times : processor time of each step [s].
    """

    arrived: bool
    time: float
    body_gap: float
    wall_gap: float
    side_changes: int
    step_times: Any


def make_controller(walls: Any) -> szlib.MPCCBF:
    """The controller that a robot of .3 m runs among people."""
    zone = szlib.reference_zone("grand-central-strangers").ellipse
    settings = szlib.MPCSettings.among_people(r_robot=RADIUS, v_max=1.0)
    return szlib.MPCCBF(zone, walls=walls, settings=settings)


def run(scene: Scene, controller: szlib.MPCCBF, seconds: float = 60) -> Outcome:
    """Drive a robot through a scene until it arrives, for at most `seconds`."""
    dt, state = controller.settings.dt, scene.start.copy()
    ids, walls = list(range(len(scene.people))), scene.walls
    ahead = (scene.goal - state[:2]) / np.hypot(*(scene.goal - state[:2]))
    times, sides = list[float](), list[float]()
    body_gap = wall_gap = np.inf
    steps, arrived = round(seconds / dt), False
    shares = np.arange(1, SUBSTEPS + 1)[:, None] / SUBSTEPS * dt
    for k in range(steps):
        people = scene.people.copy()
        people[:, :2] += k * dt * people[:, 2:]
        begun = time.process_time()
        step = controller.step(state, scene.goal, people, ids=ids)
        times.append(time.process_time() - begun)
        u = np.asarray(step.control)
        points = state[:2] + shares * state[2:] + shares**2 / 2 * u
        velocities = state[2:] + shares * u
        moves = np.hypot(*velocities.T) > MOVING
        centers = people[:, None, :2] + shares * people[:, None, 2:]
        gaps = np.linalg.norm(points - centers, axis=-1) - RADIUS - BODY
        body_gap = min(body_gap, gaps[:, moves].min(initial=np.inf))
        wall_gap = min(
            wall_gap, find_wall_distances(points, walls).min(initial=np.inf) - RADIUS
        )
        state = np.r_[points[-1], velocities[-1]]
        sideways = ahead[0] * state[3] - ahead[1] * state[2]
        if abs(sideways) > SIDEWAYS:
            sides.append(np.sign(sideways))
        if np.hypot(*(state[:2] - scene.goal)) <= ARRIVED:
            arrived = True
            break
    changes = int((np.diff(sides) != 0).sum())
    spent = len(times) * dt
    return Outcome(arrived, spent, body_gap, wall_gap, changes, np.array(times))


def find_wall_distances(points: Any, walls: Any) -> Any:
    """Distances of `points` (k, 2) to `walls` (n, 2, 2), shape (n, k)."""
    a, along = walls[:, None, 0], walls[:, None, 1] - walls[:, None, 0]
    away = points - a
    shares = np.clip((away * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
    return np.linalg.norm(away - shares[..., None] * along, axis=-1)


def run_task(task: tuple[str, Callable[[], Scene]]) -> tuple[str, Scene, Outcome]:
    """Make and run a scene, in any process."""
    kind, make = task
    scene = make()
    return kind, scene, run(scene, make_controller(scene.walls))


def run_all(
    kinds: list[str], seeds: int, processes: int
) -> list[tuple[str, Scene, Outcome]]:
    """Run every scene of the `kinds`, in their order."""
    tasks = [(kind, make) for kind in kinds for make in KINDS[kind](seeds)]
    if processes == 1:
        return [run_task(task) for task in tasks]
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        return pool.map(run_task, tasks, chunksize=1)


def find_time_ratio(scene: Scene, outcome: Outcome) -> float:
    """Time of a run over that of the free way at 1 m/s; `inf` without arrival."""
    return outcome.time / scene.free_way if outcome.arrived else np.inf


# tables


def table(found: list[tuple[str, Scene, Outcome]]) -> str:
    """A table of Markdown, one line for each kind of scenes, and the scenes without arrival."""
    lines = [
        "| scene | scenes | arrived | time ratio | within 1.5 | body gap | wall gap "
        "| side changes | step median | p99.9 |",
        "|---" + "|--:" * 9 + "|",
    ]
    groups: dict[str, list[tuple[Scene, Outcome]]] = {}
    for kind, scene, outcome in found:
        name = kind if kind in ("groups", "stream", "corridor") else scene.name
        groups.setdefault(name, []).append((scene, outcome))
    for name, pairs in groups.items():
        outcomes = [outcome for _, outcome in pairs]
        ratios = np.array([find_time_ratio(*pair) for pair in pairs])
        times = 1e3 * np.concatenate([each.step_times for each in outcomes])
        body, wall = (
            min(gaps)
            for gaps in zip(
                *((each.body_gap, each.wall_gap) for each in outcomes), strict=True
            )
        )
        lines.append(
            f"| {name} | {len(pairs)} | {np.mean([each.arrived for each in outcomes]):.2f} "
            f"| {np.median(ratios):.2f} | {np.mean(ratios <= TIME_RATIO):.2f} "
            f"| {body:.3f} | {wall:.3f} "
            f"| {np.median([each.side_changes for each in outcomes]):.0f} "
            f"| {np.median(times):.2f} | {np.quantile(times, 0.999):.1f} |"
        )
    failed = [scene.name for _, scene, outcome in found if not outcome.arrived]
    lines += ["", f"not arrived: {', '.join(failed) or 'none'}"]
    return "\n".join(lines)


def attack(long: bool) -> Counter[str]:
    """The bars of scenes with people who stand, and no wall touched in any."""
    found = run_all(list(KINDS), SEEDS[long], PROCESSES[long])
    print(table(found))
    tally = Counter[str]()
    for kind, scene, outcome in found:
        tally["scenes"] += 1
        tally["scenes with an arrival"] += outcome.arrived
        tally["broken: walls touched"] += int(outcome.wall_gap < -TOLERANCE)
        if kind in BARRED:
            is_near = outcome.body_gap < BODY_GAP - TOLERANCE
            is_slow = find_time_ratio(scene, outcome) > TIME_RATIO
            tally["broken: too near to bodies"] += int(is_near)
            tally["slower than the bar"] += int(outcome.arrived and is_slow)
    arrivals = [outcome.arrived for kind, _, outcome in found if kind in BARRED]
    tally["broken: too few arrivals"] += int(np.mean(arrivals) < ARRIVALS)
    return tally


# maps of many walls


def draw_walkers(at: Any, known: Any, rng: np.random.Generator) -> Any:
    """Replace walkers who are far from the robot; of each x, y, vx, vy and id, shape (n, 5)."""
    known = known[np.hypot(*(known[:, :2] - at).T) < FAR]
    while len(known) < WALKERS:
        turns, away, pace = (
            rng.uniform(0, 2 * np.pi, 2),
            rng.uniform(*NEAR),
            rng.uniform(0.5, 1.3),
        )
        (x, vx), (y, vy) = np.cos(turns), np.sin(turns)
        new = [
            at[0] + away * x,
            at[1] + away * y,
            pace * vx,
            pace * vy,
            rng.integers(2**31),
        ]
        known = np.vstack([known, new])
    return known


def time_map(name: str, plan: Any, is_crowded: bool, steps: int) -> str:
    """A line of the table: the time of the first step, and of `steps` later ones."""
    controller, rng = make_controller(plan.walls), np.random.default_rng(344)
    state, people, times = np.r_[plan.start, 0.0, 0.0], np.empty((0, 5)), list[float]()
    lengths, dt = list[float](), controller.settings.dt
    for _ in range(steps + 1):
        if is_crowded:
            people = draw_walkers(state[:2], people, rng)
        ids = [int(each) for each in people[:, 4]]
        begun = time.process_time()
        step = controller.step(state, plan.goal, people[:, :4], ids=ids)
        times.append(1e3 * (time.process_time() - begun))
        lengths.append(step.way_length)
        u = np.asarray(step.control)
        state = np.r_[state[:2] + dt * state[2:] + dt**2 / 2 * u, state[2:] + dt * u]
        people[:, :2] += dt * people[:, 2:4]
    first, *later = times
    free_way = find_free_way(plan.start, plan.goal, (), plan.walls)
    return (
        f"| {name} | {len(plan.walls)} | {WALKERS * is_crowded} | {first:.0f} "
        f"| {np.median(later):.2f} | {np.quantile(later, 0.999):.1f} "
        f"| {lengths[0] / free_way:.3f} |"
    )


def time_maps(steps: int) -> None:
    """Print the times of steps in the building, its ragged map, and among scattered walls."""
    from helpers.buildings import make_building, make_scattered

    warm_up = second_door()
    run(warm_up, make_controller(warm_up.walls), seconds=2)
    print(
        "| map | walls | people | first step [ms] | later median | p99.9 | way / free way |"
    )
    print("|---" + "|--:" * 6 + "|")
    for name, make in (
        ("building", partial(make_building, 0)),
        ("ragged map", partial(make_building, 0, ragged=True)),
        ("scattered", partial(make_scattered, 0)),
    ):
        plan = make()
        for is_crowded in (False, True):
            print(time_map(name, plan, is_crowded, steps), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--only", default=",".join(KINDS))
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--building", action="store_true")
    parser.add_argument("--steps", type=int, default=100)
    given = parser.parse_args()
    if given.building:
        sys.path.insert(0, str(Path(__file__).parents[1]))  # the folder of all tests
        time_maps(given.steps)
        return
    kinds = given.only.split(",")
    if unknown := sorted(set(kinds) - set(KINDS)):
        parser.error(
            f"no scenes are called {', '.join(unknown)}; use {', '.join(KINDS)}"
        )
    print(table(run_all(kinds, given.seeds, given.processes)))


if __name__ == "__main__":
    main()

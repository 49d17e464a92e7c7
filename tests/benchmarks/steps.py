"""The step at its limits (see `make bench`): how it grows with people, walls and horizons, what the first
step of a size costs, what happens when a crowd comes, and how a commit compares with an earlier one.

$SZLIB_BEFORE is a clone of an earlier commit: its step is then run in turn with this one's.
"""

import gc
import importlib.util
import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from multiprocessing import get_context
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from helpers.random_states import ZONE

import szlib
from benchmarks import measuring
from szlib.control.controller import advance
from szlib.core.checks import Array

BEFORE_VARIABLE = "SZLIB_BEFORE"
GOAL = (8.0, 0.5)
_WALLS = [
    ((-6, 5), (10, 5)),
    ((-6, -5), (10, -5)),
    ((4, 5), (4, 3.2)),
    ((0, -5), (0, -3.8)),
]


def crowd(n: int) -> Array:
    """People along the way and beside it, shape (n, 4), always the same: x, y [m], vx, vy [m/s]."""
    rng = np.random.default_rng(5)
    rows = np.c_[
        rng.uniform(-2, 10, 40),
        rng.uniform(0.3, 4.5, 40),
        rng.uniform(-0.5, 0.5, (40, 2)),
    ]
    rows[::2, 1] *= -1
    return rows[:n]


def walls(n: int) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Four walls of a room, then short ones that stand off them."""
    short = [
        ((-5 + 0.6 * i, side * 5), (-5 + 0.6 * i, side * 4.3))
        for i in range(23)
        for side in (1, -1)
    ]
    return (_WALLS + short)[:n]


def controller_of(of: ModuleType, n_walls: int, **settings: Any) -> Any:
    """A controller of this szlib, or of an earlier one."""
    zone = of.Ellipse(ZONE.center, ZONE.semi_axes, ZONE.angle)
    return of.MPCCBF(zone, walls=walls(n_walls), settings=of.MPCSettings(**settings))


def way(
    people: int, n_walls: int, steps: int = 120, **settings: Any
) -> list[tuple[Array, Array]]:
    """The states of a run, and everybody's numbers in each."""
    controller = controller_of(szlib, n_walls, **settings)
    x, rows, asked = np.array([-4.0, 0.0, 0.0, 0.0]), crowd(people), []
    for _ in range(steps):
        asked.append((x, rows))
        x = advance(x, controller.step(x, GOAL, rows).control, 0.1)
        rows = rows + 0.1 * np.c_[rows[:, 2:], np.zeros((len(rows), 2))]
    return asked


def laps(
    rivals: Sequence[tuple[ModuleType, Any]],
    asked: Sequence[tuple[Array, Array]],
    repeats: int,
) -> tuple[Array, float]:
    """Times of each rival, shape (rivals, repeats, steps) [s], laps in turn; largest |du| from the first."""
    took, apart, first = (
        np.zeros((len(rivals), repeats, len(asked))),
        0.0,
        np.zeros((len(asked), 2)),
    )
    people = [
        [
            [of.Person(tuple(row[:2]), tuple(row[2:])) for row in rows.tolist()]
            for _, rows in asked
        ]
        for of, _ in rivals
    ]
    for lap in range(-1, repeats):
        for i, (_, controller) in enumerate(rivals):
            controller.reset()
            for k, ((x, _), everybody) in enumerate(zip(asked, people[i], strict=True)):
                begun = time.perf_counter()
                step = controller.step(x, GOAL, everybody)
                took[i, lap, k] = time.perf_counter() - begun
                if i == 0:
                    first[k] = step.control
                apart = max(apart, float(np.abs(step.control - first[k]).max()))
    return took[:, :, 3:], apart


GROWTH: dict[str, tuple[tuple[int, ...], Callable[[int], dict[str, Any]]]] = {
    "people": ((1, 2, 4, 8, 16, 20), lambda n: {"people": n, "n_walls": 0}),
    "walls": ((1, 5, 10, 20, 50), lambda n: {"people": 1, "n_walls": n}),
    "N": ((8, 16, 32), lambda n: {"people": 2, "n_walls": 2, "N": n}),
    "N_h": ((2, 4, 8), lambda n: {"people": 5, "n_walls": 4, "N_h": n}),
}
"""What grows, how far, and the controller of each size."""


def bench_growth(of: str) -> dict[str, float]:
    """The step as one thing grows: median [ms] at each size, and the exponent."""
    sizes, case = GROWTH[of]
    found = {}
    for n in sizes:
        size = case(n)
        asked = way(**size, steps=60)
        del size["people"]
        took, _ = laps([(szlib, controller_of(szlib, **size))], asked, 5)
        found[f"{of} = {n}: ms"] = 1e3 * float(np.median(took))
    return found | {"exponent": measuring.exponent(sizes, list(found.values()))}


def bench_build() -> dict[str, float]:
    """The first step of a size, in a process of its own: of one controller, and of another."""
    found = {}
    for people, n_walls in ((1, 0), (4, 4), (8, 4), (16, 16), (32, 16)):
        with get_context("spawn").Pool(1) as pool:
            first, again = pool.apply(build, (people, n_walls))
        name = f"{people} + {n_walls}"
        found |= {f"{name}: first ms": first, f"{name}: another ms": again}
    return found


def build(people: int, n_walls: int) -> tuple[float, float]:
    """Times to build a controller and to ask it once: the first with this size, and another [ms]."""
    x = np.array([-4.0, 0.0, 0.0, 0.0])

    def ask(of_people: int, of_walls: int) -> float:
        begun = time.perf_counter()
        controller_of(szlib, of_walls).step(x, GOAL, crowd(of_people))
        return 1e3 * (time.perf_counter() - begun)

    ask(2, 2)
    return ask(people, n_walls), ask(people, n_walls)


def bench_jump() -> dict[str, float]:
    """A crowd of 20 comes: the first step with them, and the longest while they come one by one.

    Processor time. The time limit does not end what is built for a new number of people.
    """
    with get_context("spawn").Pool(1) as pool:
        at_once, _ = pool.apply(jump, ([20],))
    with get_context("spawn").Pool(1) as pool:
        longest, usual = pool.apply(jump, (list(range(2, 21)),))
    return {
        "at once CPU ms": at_once,
        "one by one, longest CPU ms": longest,
        "usual step CPU ms": usual,
    }


def jump(numbers: list[int]) -> tuple[float, float]:
    """The longest first step with each of these numbers of people, and the median step with the last [ms]."""
    controller, x = controller_of(szlib, 4), np.array([-4.0, 0.0, 0.0, 0.0])

    def ask(n: int) -> float:
        begun = time.thread_time()
        controller.step(x, GOAL, crowd(n))
        return 1e3 * (time.thread_time() - begun)

    for _ in range(3):
        ask(1)
    longest = max(ask(n) for n in numbers)
    return longest, float(np.median([ask(numbers[-1]) for _ in range(200)]))


def earlier(clone: str) -> ModuleType:
    """The package of another clone, beside this one, under a name of its own."""
    file = Path(clone) / "szlib" / "__init__.py"
    spec = importlib.util.spec_from_file_location(
        "szlib_before", file, submodule_search_locations=[str(file.parent)]
    )
    if spec is None or spec.loader is None:
        raise SystemExit(
            f"${BEFORE_VARIABLE}: {file} is no package; name a clone of szlib"
        )
    module = sys.modules["szlib_before"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def bench_before(people: int, n_walls: int) -> dict[str, float]:
    """This step over the earlier commit's, in turn: median, p95 and p99.9; how far they differ."""
    before = sys.modules.get("szlib_before") or earlier(os.environ[BEFORE_VARIABLE])
    rivals = [(of, controller_of(of, n_walls)) for of in (before, szlib)]
    gc.collect()
    took, apart = laps(rivals, way(people, n_walls), 15)
    before_each, now_each = np.median(took, axis=1)
    return {
        "ms": 1e3 * float(np.median(now_each)),
        "now / before median": float(np.median(now_each) / np.median(before_each)),
        "now / before p95": float(
            np.quantile(now_each, 0.95) / np.quantile(before_each, 0.95)
        ),
        "now / before p99.9": float(
            np.quantile(took[1], 0.999) / np.quantile(took[0], 0.999)
        ),
        "largest |du|": apart,
    }


def bench_worlds(count: int) -> dict[str, float]:
    """Random worlds, one core: CPU time of the earlier commit over this one's; rows that differ by 1e-5.

    Each has a process of its own, or it would collect the others' garbage.
    """
    rivals = ("before", "now")
    took, rows = (
        np.zeros((len(rivals), count // 10)),
        dict[tuple[int, int], list[dict[str, Any]]](),
    )
    with ExitStack() as open_pools:
        pools = [open_pools.enter_context(get_context("spawn").Pool(1)) for _ in rivals]
        for first in 2 * [
            *range(0, count, 10)
        ]:  # the first lap builds what the second times
            for i, (rival, pool) in enumerate(zip(rivals, pools, strict=True)):
                took[i, first // 10], rows[i, first] = pool.apply(
                    ten_worlds, (rival, first)
                )
    pairs = (
        zip(rows[0, first], rows[1, first], strict=True)
        for first in range(0, count, 10)
    )
    differ = sum(not _same(*pair) for ten in pairs for pair in ten)
    before, now = took.sum(axis=1)
    return {"before / now": before / now, "rows that differ": differ}


def ten_worlds(rival: str, first: int) -> tuple[float, list[dict[str, Any]]]:
    """CPU time and rows of ten worlds, by the earlier commit ("before") or this one ("now")."""
    of = (
        sys.modules.get("szlib_before") or earlier(os.environ[BEFORE_VARIABLE])
        if rival == "before"
        else szlib
    )
    settings = of.MPCSettings(time_limit=np.inf)
    begun = time.process_time()
    table = of.rollouts(10, seed=first, settings=settings, n_jobs=1, progress=False)
    return time.process_time() - begun, table.to_dict("records")


def _same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """True if the columns that both rows have agree to 1e-5, but for times."""
    names = [
        name for name in one if name in other and not name.startswith("solve_time")
    ]
    numbers = [name for name in names if isinstance(one[name], float)]
    return all(
        one[name] == other[name] for name in set(names) - set(numbers)
    ) and np.allclose(
        [one[name] for name in numbers],
        [other[name] for name in numbers],
        1e-5,
        1e-6,
        equal_nan=True,
    )


CASES: dict[str, Callable[[], dict[str, float]]] = {
    "crowd comes": bench_jump,
    "first steps": bench_build,
    **{f"step by {name}": (lambda name=name: bench_growth(name)) for name in GROWTH},  # type: ignore[misc]
}
if os.environ.get(BEFORE_VARIABLE):
    CASES |= {
        f"{n} + {m} against before": (lambda n=n, m=m: bench_before(n, m))  # type: ignore[misc]
        for n, m in ((1, 0), (5, 4), (10, 12))
    }
    CASES["worlds against before"] = lambda: bench_worlds(100)

BARS: dict[str, measuring.Bars] = {
    "crowd comes": {
        "at once CPU ms": ("<=", 10),
        "one by one, longest CPU ms": ("<=", 10),
    },
    "worlds against before": {"before / now": (">=", 2.1)},
} | {
    f"{size} against before": {
        "now / before median": ("<=", 1.0),
        "now / before p95": ("<=", 1.0),
    }
    for size in ("1 + 0", "5 + 4", "10 + 12")
}
"""Of a case: what its numbers are held against."""

"""The step at its limits (see `make bench`): how it grows with people, walls and horizons, what a controller
costs to build, what happens when a crowd comes, and how a commit compares with an earlier one.

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
from benchmarks import measuring
from helpers.random_states import ZONE

import szlib
from szlib.checks import Array
from szlib.control.controller import advance

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


def controller_of(of: ModuleType, people: int, n_walls: int, **settings: Any) -> Any:
    """A controller of this szlib, or of an earlier one."""
    zone = of.Ellipse(ZONE.center, ZONE.semi_axes, ZONE.angle)
    return of.MPCCBF(
        zone,
        walls=walls(n_walls),
        settings=of.MPCSettings(**settings),
        max_people=people,
    )


def way(
    people: int, n_walls: int, steps: int = 120, **settings: Any
) -> list[tuple[Array, Array]]:
    """The states of a run, and everybody's numbers in each."""
    controller, x, rows = (
        controller_of(szlib, people, n_walls, **settings),
        np.zeros(4),
        crowd(people),
    )
    x[0], asked = -4.0, []
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
        controller = (szlib, controller_of(szlib, **case(n)))
        took, _ = laps([controller], way(**case(n), steps=60), 5)
        found[f"{of} = {n}: ms"] = 1e3 * float(np.median(took))
    return found | {"exponent": measuring.exponent(sizes, list(found.values()))}


def bench_build() -> dict[str, float]:
    """What a controller costs, in a process of its own: the first of its size, another, and the memory."""
    found, sizes = {}, ((1, 0), (4, 4), (8, 4), (16, 16), (32, 16))
    for people, n_walls in sizes:
        with get_context("spawn").Pool(1) as pool:
            first, again, megabytes = pool.apply(build, (people, n_walls))
        name = f"{people} + {n_walls}"
        found |= {
            f"{name}: first ms": first,
            f"{name}: another ms": again,
            f"{name}: first MB": megabytes,
        }
    slots = [people + n_walls for people, n_walls in sizes]
    return found | {
        "exponent": measuring.exponent(
            slots, [v for k, v in found.items() if k.endswith("first ms")]
        )
    }


def build(people: int, n_walls: int) -> tuple[float, float, float]:
    """Time of the first controller of a size and of another, and what the first took [ms, ms, MB]."""
    controller_of(szlib, 0, 0)
    before, times = _resident(), []
    for _ in range(2):
        begun = time.perf_counter()
        controller_of(szlib, people, n_walls)
        times.append(1e3 * (time.perf_counter() - begun))
        if len(times) == 1:
            taken = _resident() - before
    return times[0], times[1], taken


def _resident() -> float:
    """The memory of this process [MB]; NaN where the system does not say (not Linux)."""
    file = Path("/proc/self/statm")
    return (
        int(file.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
        if file.exists()
        else np.nan
    )


def bench_jump() -> dict[str, float]:
    """A crowd of 20 comes: its first step when the size was built ahead, and when it was not (bars: 5 ms,
    150 ms), in computing time; and the longest step beside a thread that builds, by the clock."""
    with get_context("spawn").Pool(1) as pool:
        ahead, beside, usual = pool.apply(jump, (True,))
    with get_context("spawn").Pool(1) as pool:
        at_once, _, _ = pool.apply(jump, (False,))
    return {
        "built ahead CPU ms": ahead,
        "at once CPU ms": at_once,
        "longest beside a builder ms": beside,
        "longest else ms": usual,
    }


def jump(ahead: bool) -> tuple[float, float, float]:
    """The first step with 20 people, the longest step while sizes are built, and the longest after [ms]."""
    controller = szlib.MPCCBF(ZONE, walls=walls(4))
    x, longest, usual = np.array([-4.0, 0.0, 0.0, 0.0]), 0.0, 0.0
    ask = lambda n: 1e3 * measuring.seconds(lambda: controller.step(x, GOAL, crowd(n)))  # noqa: E731
    for n in (1, 1, 1):
        ask(n)
    for n in (4, 8, 16) if ahead else ():
        ask(n)
        while (builder := controller._pool._builder) is not None and builder.is_alive():
            longest = max(longest, ask(n))
            time.sleep(0.001)
        usual = max([usual, *(ask(n) for _ in range(200))])
    begun = time.thread_time()
    ask(20)
    return 1e3 * (time.thread_time() - begun), longest, usual


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
    rivals = [(of, controller_of(of, people, n_walls)) for of in (before, szlib)]
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
    "controllers": bench_build,
    **{f"step by {name}": (lambda name=name: bench_growth(name)) for name in GROWTH},  # type: ignore[misc]
}
if os.environ.get(BEFORE_VARIABLE):
    CASES |= {
        f"{n} + {m} against before": (lambda n=n, m=m: bench_before(n, m))  # type: ignore[misc]
        for n, m in ((1, 0), (5, 4), (10, 12))
    }
    CASES["worlds against before"] = lambda: bench_worlds(100)

BARS: dict[str, measuring.Bars] = {
    "crowd comes": {"built ahead CPU ms": ("<=", 5), "at once CPU ms": ("<=", 150)},
    "worlds against before": {"before / now": (">=", 2.1)},
} | {
    f"{size} against before": {
        "now / before median": ("<=", 0.8),
        "now / before p95": ("<=", 0.75),
    }
    for size in ("1 + 0", "5 + 4", "10 + 12")
}
"""Of a case: what its numbers are held against."""

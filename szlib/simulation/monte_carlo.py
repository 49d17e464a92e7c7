"""Monte Carlo: thousands of random worlds, each driven through, measured, and classified if it failed.

    table = szlib.rollouts(10_000, settings=szlib.MPCSettings(), out="results/rollouts")
    log = rerun_world(4711)                     # the world of a row, once more, with every state

Worlds run in parallel; each chunk of them is a Parquet file, written as a whole or not at all, in a
folder named after the parameters: an interrupted call goes on where it stopped, a larger `n` adds.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from threading import get_ident
from types import FunctionType
from typing import Any, get_args

import joblib
import pandas as pd
from joblib import delayed
from tqdm import tqdm

from .. import __version__
from ..control.mpc import MPCCBF
from ..control.problem import TOLERANCE
from ..control.settings import MPCSettings
from ..errors import SolverError, SzlibError
from ..files import claim_folder, load_cached, store_cached, write_file
from ..parallel import run_tasks
from ..zones.ellipses import Ellipse
from .closed_loop import Zones, drive
from .log import SimulationLog
from .outcomes import Outcome
from .robots import ControllerFactory
from .scenario import Behaviour, CrowdModel, Scenario
from .scenarios.random_worlds import Worlds

PURPOSE = "rollouts"
"""What the folder of finished chunks is marked as."""

CHUNK = 50
"""Worlds in one file and in one task: half a second of work."""

DEFAULT_ZONE = Ellipse((0.0, 0.0), (1.0, 1.0))
"""The zone of people without one [m] (assumed); in random worlds everybody has one of their own."""

Scenes = Callable[[int], Scenario]
"""A scene of each seed: `Worlds`, or anything else that makes the same one every time."""

Measure = Callable[[SimulationLog], dict[str, float]]
"""Further columns of a row; must be a function of a module."""


def rollouts(
    n: int,
    *,
    seed: int = 0,
    settings: MPCSettings | None = None,
    worlds: Scenes | None = None,
    behaviour: CrowdModel | None = None,
    controller: ControllerFactory | None = None,
    zones: Zones | None = None,
    measure: Measure | None = None,
    out: str | Path | None = None,
    n_jobs: int = -1,
    progress: bool = True,
) -> pd.DataFrame:
    """Drive through the worlds of seeds `seed` to `seed + n - 1`; one row of metrics each.

    Parameters
    ----------
    n, seed : how many worlds, and the first one's seed.
    settings, worlds, behaviour : of the controller, of the worlds, and of the people in them: a `Worlds` or
        another function of the seed, a `Behaviour` or another `CrowdModel`.
    controller : makes the controller for a world, from its scenario and the settings; default: `mpc_cbf`,
        of which worlds with as many people and walls take one in turn.
    zones : what is kept in place of a person's own zone, made from it.
    measure : further columns from each run.
    out : folder for finished chunks, to go on from; default: none is kept. Parameters and szlib's
        version name the folder inside it; after a change of the code choose another.
    n_jobs : worlds at a time, as joblib counts: -1 for every core.
    progress : show a bar.

    Returns
    -------
    The columns of `metrics.metrics`, sorted by seed.

    Raises
    ------
    SolverError : `n` is not positive, a world broke the controller (it names the seed), or chunks are to be
        kept of a function that is defined inside another: nothing names it.
    """
    if n < 1:
        raise SolverError(f"n must be at least 1; got {n}")
    setup = make_setup(
        settings=settings,
        worlds=worlds,
        behaviour=behaviour,
        controller=controller,
        zones=zones,
        measure=measure,
    )
    folder = None if out is None else Path(out) / setup.key()
    if folder is not None:
        claim_folder(folder.parent, PURPOSE)
        claim_folder(folder, f"{PURPOSE} {setup.key()}")
        write_file(folder / "parameters.txt", setup.describe() + "\n")
    chunks = [range(first, min(first + CHUNK, seed + n)) for first in range(seed, seed + n, CHUNK)]
    tasks = [delayed(_chunk)(setup, chunk, folder) for chunk in chunks]
    tables: list[pd.DataFrame] = []
    with tqdm(total=n, unit="world", disable=not progress) as bar:
        for table in run_tasks(tasks, n_jobs=n_jobs):
            tables.append(table)
            bar.update(len(table))
    return pd.concat(tables).sort_values("seed", ignore_index=True)


def mpc_cbf(scenario: Scenario, settings: MPCSettings, zone: Ellipse = DEFAULT_ZONE) -> MPCCBF:
    """The controller of the paper; `zone` is that of people without one of their own."""
    return MPCCBF(zone, walls=scenario.walls, settings=settings, max_people=len(scenario.people))


class OneOfEachSize:
    """As `mpc_cbf`, but worlds with as many people and walls take one controller in turn: to build one takes
    as long as ten steps. The loop resets it before each, so that nothing is left of the world before.
    """

    def __init__(self) -> None:
        self._made: dict[tuple[int, int], MPCCBF] = {}

    def __call__(self, scenario: Scenario, settings: MPCSettings) -> MPCCBF:
        size = len(scenario.people), len(scenario.walls)
        if size not in self._made:
            self._made[size] = mpc_cbf(scenario, settings)
        self._made[size].set_walls(scenario.walls)
        return self._made[size]


@lru_cache(maxsize=1)
def _in_turn(settings: MPCSettings, thread: int) -> OneOfEachSize:
    """The controllers of a worker, from chunk to chunk: of these settings, and its own thread's."""
    return OneOfEachSize()


@dataclass(frozen=True)
class Setup:
    """Everything but the seed that decides what a row says; parameters as of `rollouts`."""

    settings: MPCSettings
    worlds: Scenes
    behaviour: CrowdModel
    controller: ControllerFactory
    zones: Zones | None
    measure: Measure | None

    def describe(self) -> str:
        """Every parameter, as text."""
        named = {field.name: identify(getattr(self, field.name)) for field in fields(self)}
        return repr((__version__, named))

    def key(self) -> str:
        """A short name for these parameters."""
        return hashlib.sha256(self.describe().encode()).hexdigest()[:12]

    def run(self, seed: int) -> SimulationLog:
        """Drive through one world."""
        scenario = self.worlds(seed)
        try:
            return drive(
                scenario,
                self.controller(scenario, self.settings),
                behaviour=self.behaviour,
                seed=seed,
                zones=self.zones,
                settings=self.settings,
                until_arrival=False,
            )
        except SzlibError as error:
            raise SolverError(f"world {seed} broke the controller: {error}; see worlds({seed})") from error
        except Exception as error:
            error.add_note(f"in world {seed}")
            raise


def make_setup(**given: Any) -> Setup:
    """A `Setup` of what is given, and of the defaults where that is None or missing."""
    setup: dict[str, Any] = {"settings": MPCSettings(), "worlds": Worlds(), "behaviour": Behaviour()}
    setup |= {"controller": mpc_cbf, "zones": None, "measure": None}
    return Setup(**(setup | {name: value for name, value in given.items() if value is not None}))


def identify(part: Any) -> str:
    """What tells a part of a `Setup` from any other, in every process: its name if it is a function of a
    module, its text if it is one of szlib's own settings, and else its type with a hash of what it holds.

    Raises SolverError for a function that is defined inside another.
    """
    if part is None or type(part) in (MPCSettings, Worlds, Behaviour):
        return repr(part)
    kind = part if isinstance(part, FunctionType | type) else type(part)
    name = f"{kind.__module__}.{kind.__qualname__}"
    if "<" in name:
        raise SolverError(f"{name} cannot be told from others of that name; define it in a module")
    return name if kind is part else f"{name} {joblib.hash(part)}"


def summarise_rollouts(rows: pd.DataFrame) -> pd.Series[Any]:
    """Rows of `rollouts` in one: worlds, steps by what they say, shares of worlds with h < 0, with Euclidean
    overlaps, and of each outcome, least h and clearance [m]."""
    numbers: dict[str, Any] = {"worlds": len(rows)}
    numbers |= {
        name: int(rows[name].sum())
        for name in ("infeasible_steps", "flagged_steps", "unflagged_violations", "unflagged_overlaps")
    }
    numbers |= {
        "share h < 0": float((rows["min_h"] < -TOLERANCE).mean()),
        "min_h": float(rows["min_h"].min()),
        "share overlap wall": float((rows["min_clearance_walls"] < -TOLERANCE).mean()),
        "share overlap person": float((rows["min_clearance_people"] < -TOLERANCE).mean()),
        "min_clearance": float(rows["min_clearance"].min()),
    }
    numbers |= {ending: float((rows["outcome"] == ending).mean()) for ending in get_args(Outcome)}
    return pd.Series(numbers)


def rerun_world(seed: int, **parameters: Any) -> SimulationLog:
    """One world again, with every state; parameters as of `rollouts` (settings, worlds, ...)."""
    return make_setup(**parameters).run(seed)


def _chunk(setup: Setup, seeds: range, folder: Path | None) -> pd.DataFrame:
    """The rows of these seeds: read where they are finished, else driven, and kept."""
    file = None if folder is None else folder / f"seeds-{seeds.start:07d}-{seeds.stop - 1:07d}.parquet"
    made = {"rollouts": file and setup.describe(), "seeds": [seeds.start, seeds.stop]}
    if file is not None and (content := load_cached(file, made)) is not None:
        return pd.read_parquet(io.BytesIO(content))
    if setup.controller is mpc_cbf:
        setup = replace(setup, controller=_in_turn(setup.settings, get_ident()))
    rows = []
    for seed in seeds:
        log = setup.run(seed)
        more = {} if setup.measure is None else setup.measure(log)
        rows.append({"seed": seed, **log.metrics(), **more})
    table = pd.DataFrame(rows)
    if file is not None:
        buffer = io.BytesIO()
        table.to_parquet(buffer)
        store_cached(file, buffer.getvalue(), made)
    return table

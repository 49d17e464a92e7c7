"""Monte Carlo: thousands of random worlds, each driven through, measured, and classified if it failed.

    table = szlib.rollouts(10_000, settings=szlib.MPCSettings(), out="results/rollouts")
    log = replay(4711)                     # the world of a row, once more, with every state

Worlds run in parallel; each chunk of them is a Parquet file, written as a whole or not at all, in a
folder named after the parameters: an interrupted call goes on where it stopped, a larger `n` adds.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import pandas as pd
from joblib import delayed
from tqdm import tqdm

from .. import __version__
from ..control.mpc import MPCCBF
from ..control.problem import TOLERANCE
from ..control.settings import MPCSettings
from ..errors import SolverError, SzlibError
from ..files import keep, kept, own_folder, write_file
from ..parallel import run_tasks
from ..zones.ellipses import Ellipse
from .closed_loop import Zones, drive
from .log import SimulationLog
from .metrics import Outcome
from .scenario import Behaviour
from .worlds import Worlds, world

PURPOSE = "rollouts"
"""What the folder of finished chunks is marked as."""

CHUNK = 50
"""Worlds in one file and in one task: about a second of work."""

_UNUSED = Ellipse((0.0, 0.0), (1.0, 1.0))
"""The controller's zone; in random worlds everybody has one of their own."""

Measure = Callable[[SimulationLog], dict[str, float]]
"""Further columns of a row; must be a function of a module."""


def rollouts(
    n: int,
    *,
    seed: int = 0,
    settings: MPCSettings | None = None,
    worlds: Worlds | None = None,
    behaviour: Behaviour | None = None,
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
    settings, worlds, behaviour : of the controller, of the worlds, and of the people in them.
    zones : what the controller keeps in place of a person's own zone; a function of a module.
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
    SolverError : `n` is not positive, or a world broke the controller; it names the seed.
    """
    if n < 1:
        raise SolverError(f"n must be at least 1; got {n}")
    setup = Setup(settings or MPCSettings(), worlds or Worlds(), behaviour or Behaviour(), zones, measure)
    folder = None if out is None else Path(out) / setup.key()
    if folder is not None:
        own_folder(folder.parent, PURPOSE)
        own_folder(folder, f"{PURPOSE} {setup.key()}")
        write_file(folder / "parameters.txt", setup.describe() + "\n")
    chunks = [range(first, min(first + CHUNK, seed + n)) for first in range(seed, seed + n, CHUNK)]
    tasks = [delayed(_chunk)(setup, chunk, folder) for chunk in chunks]
    tables: list[pd.DataFrame] = []
    with tqdm(total=n, unit="world", disable=not progress) as bar:
        for table in run_tasks(tasks, n_jobs=n_jobs):
            tables.append(table)
            bar.update(len(table))
    return pd.concat(tables).sort_values("seed", ignore_index=True)


@dataclass(frozen=True)
class Setup:
    """Everything but the seed that decides what a row says."""

    settings: MPCSettings
    worlds: Worlds
    behaviour: Behaviour
    zones: Zones | None
    measure: Measure | None

    def describe(self) -> str:
        """Every parameter, as text."""
        names = [f"{f.__module__}.{f.__qualname__}" if f else "default" for f in (self.zones, self.measure)]
        return repr((__version__, self.settings, self.worlds, self.behaviour, *names))

    def key(self) -> str:
        """A short name for these parameters."""
        return hashlib.sha256(self.describe().encode()).hexdigest()[:12]

    def run(self, seed: int) -> SimulationLog:
        """Drive through one world."""
        scenario = world(seed, self.worlds)
        controller = MPCCBF(
            _UNUSED, walls=scenario.walls, settings=self.settings, max_people=len(scenario.people)
        )
        try:
            return drive(
                scenario,
                controller,
                behaviour=self.behaviour,
                seed=seed,
                zones=self.zones,
                until_arrival=False,
            )
        except SzlibError as error:
            raise SolverError(
                f"world {seed} broke the controller: {error}; see worlds.world({seed})"
            ) from error


def tally(rows: pd.DataFrame) -> pd.Series[Any]:
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


def replay(seed: int, **parameters: Any) -> SimulationLog:
    """One world again, with every state; parameters as of `rollouts` (settings, worlds, ...)."""
    given = {"settings": MPCSettings(), "worlds": Worlds(), "behaviour": Behaviour()}
    given |= {"zones": None, "measure": None}
    return Setup(**(given | parameters)).run(seed)  # type: ignore[arg-type]


def _chunk(setup: Setup, seeds: range, folder: Path | None) -> pd.DataFrame:
    """The rows of these seeds: read where they are finished, else driven, and kept."""
    file = None if folder is None else folder / f"seeds-{seeds.start:07d}-{seeds.stop - 1:07d}.parquet"
    made = {"rollouts": setup.describe(), "seeds": [seeds.start, seeds.stop]}
    if file is not None and (content := kept(file, made)) is not None:
        return pd.read_parquet(io.BytesIO(content))
    rows = []
    for seed in seeds:
        log = setup.run(seed)
        more = {} if setup.measure is None else setup.measure(log)
        rows.append({"seed": seed, **log.metrics(), **more})
    table = pd.DataFrame(rows)
    if file is not None:
        buffer = io.BytesIO()
        table.to_parquet(buffer)
        keep(file, buffer.getvalue(), made)
    return table

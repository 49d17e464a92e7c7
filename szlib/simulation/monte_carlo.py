"""Monte Carlo: the robot drives through thousands of random worlds; each run is measured and classified.

    table = szlib.rollouts(10_000, settings=szlib.MPCSettings(), out="results/rollouts")
    log = szlib.simulation.rerun_world(4711)     # the world of one row again, with every state

Worlds run in parallel.  Each chunk of worlds is one Parquet file, written atomically, in a folder named after
the parameters: an interrupted call continues where it stopped, and a larger `n` adds chunks.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import FunctionType
from typing import Any

import joblib
import pandas as pd
from joblib import delayed
from tqdm import tqdm

from .. import __version__
from ..control.controller import Controller
from ..control.mpc import MPCCBF
from ..control.settings import MPCSettings
from ..core.errors import SolverError, SzlibError
from ..core.files import claim_folder, load_cached, store_cached, write_file
from ..core.parallel import run_tasks
from ..zones.ellipses import Ellipse
from .closed_loop import ZoneTransform, drive
from .log import SimulationLog
from .run import Run
from .scenario import UNAFFECTED, Behaviour, CrowdModel, Scenario
from .scenarios.random_worlds import Worlds

PURPOSE = "rollouts"  # purpose with which the folder of finished chunks is marked

CHUNK_SIZE = 50  # worlds in one file and in one task: half a second of work

# Zone of people who have none [m] (assumed); in random worlds all people have one.
DEFAULT_ZONE = Ellipse((0.0, 0.0), (1.0, 1.0))

# Makes a controller for a scenario. A function of a module, so that other processes find it.
ControllerFactory = Callable[[Scenario, MPCSettings], Controller]

# Makes the scenario of a seed, the same one each time: `Worlds` or another function.
ScenarioSource = Callable[[int], Scenario]

# further columns of a row; a function of a module
Measure = Callable[[Run], dict[str, float]]


def make_mpc_cbf(scenario: Scenario, settings: MPCSettings) -> MPCCBF:
    """The MPC-CBF controller for a `scenario` with `settings`; people without a zone have `DEFAULT_ZONE`."""
    return MPCCBF(
        DEFAULT_ZONE,
        walls=scenario.walls,
        obstacles=scenario.obstacles,
        settings=settings,
    )


def rollouts(
    n: int,
    *,
    seed: int = 0,
    settings: MPCSettings | None = None,
    worlds: ScenarioSource | None = None,
    behaviour: CrowdModel = UNAFFECTED,
    controller: ControllerFactory | None = None,
    zone_transform: ZoneTransform | None = None,
    measure: Measure | None = None,
    out: str | Path | None = None,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Drive through the worlds of seeds `seed` to `seed + n - 1`; one row of metrics for each.

    Parameters
    ----------
    n : number of worlds.
    seed : seed of the first world.
    settings : settings of the controller and the loop; default: `MPCSettings()`.
    worlds : `Worlds`, or another function of the seed that makes scenarios; default: `Worlds()`.
    behaviour : what people do: `Behaviour`, or another `CrowdModel`; default: they walk on.
    controller : makes the controller for a scenario with these settings; default: `make_mpc_cbf`.
    zone_transform : makes the zone that the robot keeps out of from each person's own zone.
    measure : further columns from each run.
    out : folder for finished chunks; a later call continues from them. Default: no files. The parameters and
        szlib's version name a folder inside it. After a change of your own code choose another folder.
    n_jobs : worlds at a time; -1: one for each core.
    progress : show a progress bar.

    Returns
    -------
    seed, and the columns of `szlib.simulation.compute_metrics`, sorted by seed.

    Raises
    ------
    SolverError : `n` is not positive, the controller fails in a world (the error names the seed), or `out` is
        given with a function that is defined inside another: it has no name that other processes know.

    Examples
    --------
    >>> import szlib
    >>> table = szlib.rollouts(2, worlds=szlib.Worlds(duration=2.0), progress=False)
    >>> table["seed"].tolist(), (table["unflagged_violations"] == 0).all()
    ([0, 1], np.True_)
    """
    if n < 1:
        raise SolverError(f"n must be at least 1; got {n}")
    scene = worlds or Worlds(), behaviour, controller or make_mpc_cbf
    setup = RolloutSetup(settings or MPCSettings(), *scene, zone_transform, measure)
    folder = None if out is None else Path(out) / setup.key()
    if folder is not None:
        claim_folder(folder.parent, PURPOSE)
        claim_folder(folder, f"{PURPOSE} {setup.key()}")
        write_file(folder / "parameters.txt", setup.describe() + "\n")
    chunks = [
        range(first, min(first + CHUNK_SIZE, seed + n))
        for first in range(seed, seed + n, CHUNK_SIZE)
    ]
    tasks = [delayed(run_chunk)(setup, chunk, folder) for chunk in chunks]
    tables: list[pd.DataFrame] = []
    with tqdm(total=n, unit="world", disable=None if progress else True) as bar:
        for table in run_tasks(tasks, n_jobs=n_jobs):
            tables.append(table)
            bar.update(len(table))
    return pd.concat(tables).sort_values("seed", ignore_index=True)


@dataclass(frozen=True)
class RolloutSetup:
    """Everything except the seed that decides a row: `settings`, `worlds`, `behaviour`, `controller`,
    `zone_transform`, `measure`, as of `rollouts`.
    """

    settings: MPCSettings = field(default_factory=MPCSettings)
    worlds: ScenarioSource = field(default_factory=Worlds)
    behaviour: CrowdModel = UNAFFECTED
    controller: ControllerFactory = make_mpc_cbf
    zone_transform: ZoneTransform | None = None
    measure: Measure | None = None

    def describe(self) -> str:
        """Every parameter, as text."""
        parts = {each.name: identify(getattr(self, each.name)) for each in fields(self)}
        return repr((__version__, parts))

    def key(self) -> str:
        """A short name for these parameters."""
        return hashlib.sha256(self.describe().encode()).hexdigest()[:12]

    def run(self, seed: int) -> SimulationLog:
        """Drive through the world of a `seed`."""
        scenario = self.worlds(seed)
        try:
            return drive(
                scenario,
                self.controller(scenario, self.settings),
                behaviour=self.behaviour,
                seed=seed,
                zone_transform=self.zone_transform,
                settings=self.settings,
                until_arrival=False,
            )
        except SzlibError as error:
            raise SolverError(
                f"the controller failed in world {seed}: {error}; see worlds({seed})"
            ) from error
        except Exception as error:
            error.add_note(f"in world {seed}")
            raise


def identify(part: Any) -> str:
    """Text that identifies a `part` of a `RolloutSetup` in every process.

    A function of a module: its name.  Settings of szlib: their text.  Other objects: their type and a hash of
    their content.

    Raises
    ------
    SolverError : the part is a function that is defined inside another.
    """
    if part is None or type(part) in (MPCSettings, Worlds, Behaviour):
        return repr(part)
    kind = part if isinstance(part, FunctionType | type) else type(part)
    name = f"{kind.__module__}.{kind.__qualname__}"
    if "<" in name:
        raise SolverError(
            f"{name} has no name that other processes know; define it in a module"
        )
    return name if kind is part else f"{name} {joblib.hash(part)}"


def rerun_world(seed: int, **parameters: Any) -> SimulationLog:
    """Drive through the world of a `seed` again, for its log; `parameters` as of `rollouts`."""
    return RolloutSetup(**parameters).run(seed)


def run_chunk(
    setup: RolloutSetup, seeds: range, folder: Path | None = None
) -> pd.DataFrame:
    """The rows of the worlds of `seeds` with a `setup`: read from `folder` if finished, else driven and
    stored.
    """
    file = (
        None
        if folder is None
        else folder / f"seeds-{seeds.start:07d}-{seeds.stop - 1:07d}.parquet"
    )
    key = {"rollouts": file and setup.describe(), "seeds": [seeds.start, seeds.stop]}
    if file is not None and (content := load_cached(file, key)) is not None:
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
        store_cached(file, buffer.getvalue(), key)
    return table

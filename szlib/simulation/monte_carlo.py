"""Monte Carlo: the robot drives through thousands of worlds; each run is measured and classified.

    table = szlib.rollouts(10_000, settings=szlib.MPCSettings(), out="results/rollouts")
    log = szlib.simulation.RolloutSetup().run(4711)     # the world of one row again, with every state

Worlds run in parallel.  Each chunk of worlds is one Parquet file, written atomically, in a folder named after
the parameters: an interrupted call continues where it stopped, and a larger `n` adds chunks.

`compare` drives with each combination of controllers, zones, formulations and behaviours through the same
worlds.  Each behaviour violates one expectation of the controller.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import product
from math import pi, sqrt
from pathlib import Path
from types import FunctionType
from typing import Any

import joblib
import pandas as pd
from joblib import delayed
from tqdm import tqdm

from .. import __version__
from ..control import MPCSettings
from ..core.checks import require
from ..core.errors import SolverError, SzlibError
from ..core.files import claim_folder, load_cached, store_cached, write_file
from ..core.parallel import run_tasks
from ..zones.ellipses import Ellipse
from .baseline_controllers import CONTROLLERS, ControllerFactory, make_mpc_cbf
from .closed_loop import BODY_ZONE, LoopSettings, ZoneTransform, drive
from .crowds import UNAFFECTED, Behaviour, CrowdModel
from .log import SimulationLog
from .robot_run import Run
from .scenario import Scenario, Worlds

PURPOSE = "rollouts"  # purpose with which the folder of finished chunks is marked

CHUNK_SIZE = 50  # worlds in one file and in one task: half a second of work

# Makes the scenario of a seed, the same one each time: `Worlds` or another function.
ScenarioSource = Callable[[int], Scenario]

# further columns of a row; a function of a module
Measure = Callable[[Run], dict[str, float]]


@dataclass(frozen=True)
class RolloutSetup:
    """Everything except the seed that decides a row.

    Parameters
    ----------
    settings : settings of the controller and the loop.
    worlds : `Worlds`, or another function of the seed that makes scenarios.
    behaviour : what people do: `Behaviour`, or another `CrowdModel`.
    controller : makes the controller for a scenario with these settings.
    zone_transform : makes the zone that the robot keeps out of from each person's own zone.
    measure : further columns from each run.

    Examples
    --------
    >>> import szlib
    >>> setup = szlib.RolloutSetup(behaviour=szlib.simulation.Behaviour(pace=0.8))
    >>> setup.run(3).metrics()["success"]
    True
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
        loop = LoopSettings(
            behaviour=self.behaviour,
            seed=seed,
            zone_transform=self.zone_transform,
            settings=self.settings,
            until_arrival=False,
        )
        try:
            return drive(scenario, self.controller(scenario, self.settings), loop)
        except SzlibError as error:
            raise SolverError(
                f"the controller failed in world {seed}: {error}; see worlds({seed})"
            ) from error
        except Exception as error:
            error.add_note(f"in world {seed}")
            raise


def rollouts(
    n: int,
    setup: RolloutSetup | None = None,
    *,
    settings: MPCSettings | None = None,
    seed: int = 0,
    out: str | Path | None = None,
    n_jobs: int = 1,
    progress: bool = True,
) -> pd.DataFrame:
    """Drive through the worlds of seeds `seed` to `seed + n - 1`; one row of metrics for each.

    Parameters
    ----------
    n : number of worlds.
    setup : worlds, people, controller and measures; default: `RolloutSetup()`.
    settings : settings of the controller and the loop, in place of those of `setup`.
    seed : seed of the first world.
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
    >>> setup = szlib.simulation.RolloutSetup(worlds=szlib.Worlds(duration=2.0))
    >>> table = szlib.rollouts(2, setup, progress=False)
    >>> table["seed"].tolist(), (table["unflagged_violations"] == 0).all()
    ([0, 1], np.True_)
    """
    require(n >= 1, "n", n, "at least 1", SolverError)
    setup = setup or RolloutSetup()
    if settings is not None:
        setup = replace(setup, settings=settings)
    folder = None
    if out is not None:
        folder = Path(out) / setup.key()
        claim_folder(folder.parent, PURPOSE)
        claim_folder(folder, f"{PURPOSE} {setup.key()}")
        write_file(folder / "parameters.txt", setup.describe() + "\n")
    seeds = range(seed, seed + n)
    chunks = [seeds[i : i + CHUNK_SIZE] for i in range(0, n, CHUNK_SIZE)]
    tasks = [delayed(run_chunk)(setup, chunk, folder) for chunk in chunks]
    tables: list[pd.DataFrame] = []
    with tqdm(total=n, unit="world", disable=None if progress else True) as bar:
        for table in run_tasks(tasks, n_jobs=n_jobs):
            tables.append(table)
            bar.update(len(table))
    return pd.concat(tables).sort_values("seed", ignore_index=True)


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


def run_chunk(
    setup: RolloutSetup, seeds: range, folder: Path | None = None
) -> pd.DataFrame:
    """The rows of the worlds of `seeds` with a `setup`: read from `folder` if finished, else driven and
    stored.
    """
    if folder is None:
        return _drive_worlds(setup, seeds)
    file = folder / f"seeds-{seeds.start:07d}-{seeds.stop - 1:07d}.parquet"
    key = {"rollouts": setup.describe(), "seeds": [seeds.start, seeds.stop]}
    content = load_cached(file, key)
    if content is None:
        buffer = io.BytesIO()
        _drive_worlds(setup, seeds).to_parquet(buffer)
        content = buffer.getvalue()
        store_cached(file, content, key)
    return pd.read_parquet(io.BytesIO(content))


def _drive_worlds(setup: RolloutSetup, seeds: range) -> pd.DataFrame:
    rows = []
    for seed in seeds:
        log = setup.run(seed)
        row = {"seed": seed, **log.metrics()}
        if setup.measure is not None:
            row |= setup.measure(log)
        rows.append(row)
    return pd.DataFrame(rows)


# --- comparisons -------------------------------------------------------------------------------------


def keep_zone(fitted: Ellipse) -> Ellipse:
    """The `fitted` ellipse itself."""
    return fitted


def use_body(fitted: Ellipse) -> Ellipse:
    """A person's body (`BODY_ZONE`) in place of the `fitted` ellipse: a distance constraint."""
    return BODY_ZONE


def use_equal_circle(fitted: Ellipse) -> Ellipse:
    """A circle around the person with the area of the `fitted` ellipse."""
    radius = sqrt(fitted.area / pi)
    return Ellipse((0.0, 0.0), (radius, radius))


ZONES: dict[str, ZoneTransform] = {
    "none": use_body,
    "equal circle": use_equal_circle,
    "fitted": keep_zone,
}
"""Zones that the robot keeps out of, by name."""

FORMULATIONS: dict[str, MPCSettings] = {
    "paper": MPCSettings.paper(),
    "szlib": MPCSettings(),
    "whole horizon": MPCSettings(N_h=MPCSettings.N),
    "rest": MPCSettings(terminal="rest"),
}
"""Settings by name: the paper's to the letter, szlib's defaults, and two changes of them."""

BEHAVIOURS: dict[str, Behaviour] = {
    "as expected": Behaviour(),
    "speeds up": Behaviour(pace=2.0),
    "turns": Behaviour(turn=pi / 2),
    "stops": Behaviour(pace=0.0),
    "seen 10 cm off": Behaviour(noise=0.1),
}
"""How people move, or how the controller sees them, by name."""

# Names of methods, or methods by names of the user's own.
Methods = Sequence[str] | Mapping[str, Any]

# columns of `compare` that name a method
METHOD = ("controller", "zone", "formulation", "behaviour")

WORLDS = Worlds(people=(3, 5), size=8.0, travel=(4.0, 8.0), start_speed=0.0, min_h=1.0)
"""Worlds with space for each of the zones at the start and at the goal: the robot starts outside all."""


def compare(
    n: int,
    *,
    controllers: Methods = ("MPC-CBF",),
    zones: Methods = tuple(ZONES),
    formulations: Methods = tuple(FORMULATIONS),
    behaviours: Methods = ("as expected",),
    worlds: ScenarioSource = WORLDS,
    measure: Measure | None = None,
    **options: Any,
) -> pd.DataFrame:
    """Drive through the same n worlds with each combination of methods.

    Parameters
    ----------
    n : number of worlds.
    worlds, measure : as of `RolloutSetup`.
    options : `seed`, `out`, `n_jobs` and `progress` of `rollouts`.
    controllers : names in `CONTROLLERS`, or a mapping from names of your own to controller factories.
    zones : names in `ZONES`, or a mapping to zone transforms.
    formulations : names in `FORMULATIONS`, or a mapping to settings.
    behaviours : names in `BEHAVIOURS`, or a mapping to crowd models.

    Returns
    -------
    The rows of `rollouts`, with the columns `METHOD`.

    Raises
    ------
    SolverError : a name is unknown.

    Examples
    --------
    >>> import szlib
    >>> worlds = szlib.Worlds(duration=1.0)
    >>> table = szlib.simulation.compare(
    ...     1, zones=["none", "fitted"], formulations=["szlib"], worlds=worlds, progress=False
    ... )
    >>> table[["zone", "formulation", "seed"]].to_numpy().tolist()
    [['none', 'szlib', 0], ['fitted', 'szlib', 0]]
    """
    choices = [
        _find_methods(controllers, CONTROLLERS),
        _find_methods(zones, ZONES),
        _find_methods(formulations, FORMULATIONS),
        _find_methods(behaviours, BEHAVIOURS),
    ]
    tables = []
    for chosen in product(*(each.items() for each in choices)):
        names, (controller, zone, settings, behaviour) = zip(*chosen, strict=True)
        setup = RolloutSetup(settings, worlds, behaviour, controller, zone, measure)
        table = rollouts(n, setup, **options)
        tables.append(table.assign(**dict(zip(METHOD, names, strict=True))))
    return pd.concat(tables, ignore_index=True)


def _find_methods(given: Methods, known: Mapping[str, Any]) -> Mapping[str, Any]:
    """Methods by name: those `given`, or those of the names given."""
    if isinstance(given, Mapping):
        return given
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise SolverError(
            f"unknown names: {', '.join(unknown)}; expected {', '.join(known)}, or a mapping"
        )
    return {name: known[name] for name in given}

"""Factories of tracks, and the real data where it is at hand."""

from __future__ import annotations

import contextlib
import os
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded: threads of BLAS that wait take a core

import hypothesis
import jupytext
import numpy as np
import pandas as pd
import pytest

import szlib

DAY = "2012-10-24"

os.environ["SZLIB_CACHE"] = "off"  # nor do tests leave anything in the user's cache
hypothesis.settings.register_profile("szlib", deadline=None)  # tests are never timed
hypothesis.settings.load_profile("szlib")


def make_walk(
    start: Sequence[float],
    velocity: Sequence[float],
    *,
    person: int = 1,
    day: str = DAY,
    begin: float = 0.0,
    duration: float = 4.0,
) -> pd.DataFrame:
    """A person who walks straight on: the rows of a track table."""
    tick = round(begin * 10) + np.arange(round(duration * 10) + 1)
    since = (tick - tick[0])[:, None] / 10
    rows = pd.DataFrame({"day": day, "id": person, "t": tick / 10})
    rows[["x", "y"]] = np.asarray(start, float) + since * np.asarray(velocity, float)
    rows[["vx", "vy"]] = np.broadcast_to(np.asarray(velocity, float), (len(tick), 2))
    return rows


def make_tracks(*walks: pd.DataFrame) -> pd.DataFrame:
    """A track table of several people."""
    return pd.concat(walks, ignore_index=True).astype({"day": "category"})


def make_crowd(
    seed: int, *, people: int = 14, seconds: int = 40, square: szlib.Square = szlib.ATC_SQUARE
) -> pd.DataFrame:
    """People who come and go, wander through the square, stop, and get lost now and then."""
    rng = np.random.default_rng(seed)
    walks = []
    for person in range(people):
        n = int(rng.integers(40, 180))
        heading = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(0, 0.03, n))
        pace = np.clip(rng.normal(1.0, 0.3) + np.cumsum(rng.normal(0, 0.02, n)), 0.0, 2.0)
        velocity = pace[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        middle = [rng.uniform(*square.x), rng.uniform(*square.y)]
        position = middle + (np.cumsum(velocity, axis=0) - velocity[: n // 2].sum(axis=0)) / 10
        walk = pd.DataFrame(
            {"day": DAY, "id": 100 + person, "t": (rng.integers(seconds * 10) + np.arange(n)) / 10}
        )
        walk[["x", "y"]], walk[["vx", "vy"]] = position, velocity
        if rng.random() < 0.3:
            gap = int(rng.integers(10, n - 10))
            walk = walk.drop(index=range(gap, min(gap + 8, n)))
        walks.append(walk)
    return make_tracks(*walks)


def make_hall(
    seed: int = 0, *, people: int = 250, pillar: tuple[float, ...] = (), size: tuple[float, float] = (12, 8)
) -> pd.DataFrame:
    """People who walk straight through a hall from wall to wall; who would meet the pillar stays away."""
    rng = np.random.default_rng(seed)
    walks = []
    for person in range(people):
        a, b = rng.uniform(0, size, (2, 2))
        a[person % 2], b[person % 2] = 0, size[person % 2]
        span = np.linspace(0, 1, 200)[:, None]
        path = a + span * (b - a)
        if pillar and ((path > pillar[:2]) & (path < pillar[2:])).all(axis=1).any():
            continue
        duration = round(float(np.hypot(*(b - a))) / 1.2, 1)
        walks.append(make_walk(a, (b - a) / duration, person=person, begin=2.0 * person, duration=duration))
    return make_tracks(*walks)


def real_data(folder: str) -> Path:
    """A folder of real data; the test is skipped, saying why, where there is none."""
    root = os.environ.get("SZLIB_DATA_DIR")
    if not root:
        pytest.skip("SZLIB_DATA_DIR is not set: no real data")
    if not (Path(root) / folder).is_dir():
        pytest.skip(f"SZLIB_DATA_DIR has no folder {folder}")
    return Path(root) / folder


@pytest.fixture(scope="session")
def real_tracks() -> pd.DataFrame:
    """The real day, 2012-10-24, on the common clock."""
    return szlib.read_tracks(sorted(real_data("atc-1hz").glob("*.csv")))


@pytest.fixture(scope="session")
def real_samples(real_tracks: pd.DataFrame) -> pd.DataFrame:
    """The encounters of the real day."""
    return szlib.find_encounters(real_tracks)


NOTEBOOK = """# %%
import pathlib

from szlib.workbook.record import NotebookRecord

# %% tags=["parameters"]
data = "synthetic"
seed = 0
results = "../results"

# %%
record = NotebookRecord("{name}", globals())
record.key["seed"] = seed
"""
"""What a notebook of a test begins with."""


@pytest.fixture
def notebooks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """A workbook of one's own: `notebooks(name=code)` writes them and gives their folder; few data."""
    from szlib.workbook.record import places

    folder = tmp_path / "notebooks"
    folder.mkdir()
    monkeypatch.setattr(places, "NOTEBOOKS", folder)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.csv").write_text("t,id,x,y\n0,1,0,0\n1,1,1,0\n")

    def write(**codes: str) -> Path:
        for name, code in codes.items():
            text = NOTEBOOK.format(name=f"{name[1:]}") + code + "\n\n# %%\nrecord.close()\n"
            (folder / f"{name[1:]}.py").write_text(text)
        return folder

    return write


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Notebooks of a run are executed in this process, without kernels: for what a run does around them."""
    from szlib.workbook.runner import execution, worker

    class Here(Executor):
        def submit(self, function: Callable[..., Any], /, *args: Any, **named: Any) -> Future[Any]:
            future: Future[Any] = Future()
            future.set_result(function(*args, **named))
            return future

    def execute(temporary: Path, script: Path, folder: Path, given: dict[str, Any]) -> dict[str, Any]:
        notebook, variables = jupytext.read(script), dict[str, Any]()
        try:
            with contextlib.chdir(script.parent), warnings.catch_warnings():
                warnings.simplefilter("default")
                for cell in notebook.cells:
                    exec(cell.source, variables)
                    if "parameters" in cell.metadata.get("tags", []):
                        variables |= given
        except Exception as error:
            name = type(error).__name__
            return {"status": "refused" if name in worker.REFUSED else "error", "error": f"{name}: {error}"}
        finally:
            jupytext.write(notebook, folder / f"{script.stem}.ipynb")
        return {}

    monkeypatch.setattr(execution, "_pool", lambda *_: contextlib.nullcontext(Here()))
    monkeypatch.setattr(worker, "_execute_in", execute)

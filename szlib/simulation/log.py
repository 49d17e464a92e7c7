"""The log of a run for its user: a run with its table, metrics, pictures and files."""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from .. import __version__
from ..control import MPCSettings, Person
from ..control.obstacles import describe, number_kinds, restore
from ..core.errors import DataError
from ..core.files import write_file
from ..core.input_files import open_regular
from ..zones.ellipses import Ellipse
from .metrics import compute_metrics
from .robot_run import Run, nanmin
from .scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FORMAT = "szlib.SimulationLog"
_VERSION = 9
_ARRAYS = (
    "states",
    "controls",
    "people",
    "predicted",
    "residual",
    "status",
    "safe",
    "slack",
    "solve_time",
    "stuck",
)
_SHOWN = (
    "success",
    "outcome",
    "time_to_goal",
    "min_h",
    "min_clearance",
    "infeasible_steps",
)


class SimulationLog(Run):
    """The log of one run, with a table, metrics, pictures and files.

    `szlib.simulate` returns it.  Its arrays are those of `szlib.simulation.Run`: `scenario`, `settings`,
    `zones`, `states`, `controls`, `people`, `predicted`, `residual`, `status`, `safe`, `slack`,
    `solve_time`, `stuck`, `arrival`, `has_safety_claims`, `inputs`.

    Examples
    --------
    >>> import szlib
    >>> scenario = szlib.SCENARIOS["passing"]
    >>> log = szlib.simulate(scenario, szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7))))
    >>> log.metrics()["outcome"]
    'arrived'
    >>> log.table[["t", "x", "y", "h_person_0"]].round(2).iloc[0].tolist()
    [0.0, -4.0, 0.0, 2.35]
    >>> log.save("run")
    >>> szlib.SimulationLog.load("run").success
    True
    """

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row for each step: the state at its time and the control decided there.

        Columns: t [s], x, y [m], vx, vy, speed [m/s], ax, ay [m/s2] (or `inputs`), status, slack,
        solve_time, stuck [s], cbf_people [m], clearance (the smallest) [m], and for each person i and wall j,
        or another kind of obstacle in place of wall:
        person_i_x, person_i_y [m], person_i_heading [rad], h_person_i, h_wall_j [m].
        """
        n = len(self.zones)
        columns: dict[str, Any] = {
            "t": self.time,
            **dict(zip(("x", "y", "vx", "vy"), self.states.T, strict=True)),
            "speed": self.speed,
            **dict(zip(self.inputs, self.controls.T, strict=True)),
            **_pick(self, "status", "slack", "solve_time", "stuck"),
            "cbf_people": self.cbf_people,
            "clearance": nanmin(self.clearance, axis=1),
        }
        for i in range(n):
            for k, name in enumerate(("x", "y", "heading")):
                columns[f"person_{i}_{name}"] = self.people[:, i, k]
            columns[f"h_person_{i}"] = self.h[:, i]
        names = number_kinds(self.scenario.fixed)
        columns |= {f"h_{name}": self.h[:, n + j] for j, name in enumerate(names)}
        return pd.DataFrame(columns)

    def metrics(self) -> dict[str, Any]:
        """The run in numbers; see `szlib.simulation.compute_metrics` for the meaning of each."""
        return compute_metrics(self)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the run (paper, fig. 6) on `ax`; `options` as of `workbook.figures.plot_scenario`."""
        from ..workbook.figures.simulation import plot_scenario

        return plot_scenario(self, ax=ax, **options)

    def animate(self, **options: Any) -> bytes:
        """The run as an animated GIF, a player in notebooks; `options` as of `workbook.figures.animate`."""
        from ..workbook.figures.simulation import animate

        return animate(self, **options)

    def __repr__(self) -> str:
        metrics = self.metrics()
        numbers = ", ".join(f"{name} {_format(metrics[name])}" for name in _SHOWN)
        return (
            f"SimulationLog of {self.scenario.name!r}: {len(self.states)} states in {self.time[-1]:g} s, "
            f"{len(self.zones)} people, {len(self.scenario.fixed)} obstacles\n  {numbers}"
        )

    def _repr_html_(self) -> str:
        rows = pd.Series(
            {name: _format(value) for name, value in self.metrics().items()}
        )
        title = self.scenario.title or self.scenario.name
        return (
            f"<p><b>{title}</b></p>" + rows.to_frame(f"{self.time[-1]:g} s").to_html()
        )

    def save(self, path: str | Path) -> None:
        """Write the run to ``<path>.npz``: its arrays, and all else as a text of JSON, `content`.

        `path` may have this suffix.  Claims are functions and are not saved, nor are ids, groups and
        predictions of people.

        Raises
        ------
        DataError : a file cannot be written.
        """
        scenario = self.scenario
        scene = _pick(scenario, "name", "title", "duration")
        for name in ("start", "goal", "walls"):
            scene[name] = getattr(scenario, name).tolist()
        scene["obstacles"] = [describe(each) for each in scenario.obstacles]
        content = {
            "format": _FORMAT,
            "version": _VERSION,
            "szlib": __version__,
            "units": "m, s, rad; world frame, zones in the frame of their person",
            "run": _pick(self, "arrival", "has_safety_claims", "inputs"),
            "settings": asdict(self.settings),
            "zones": [
                _pick(each, "center", "semi_axes", "angle") for each in self.zones
            ],
            "scenario": scene,
            "people": [
                _pick(each, "position", "velocity", "heading", "heading_unknown")
                for each in scenario.people
            ],
        }
        buffer = io.BytesIO()
        text = np.array(json.dumps(content, indent=1))
        np.savez_compressed(buffer, content=text, **_pick(self, *_ARRAYS))
        write_file(_find_file(path), buffer.getvalue())

    @classmethod
    def load(cls, path: str | Path) -> SimulationLog:
        """Read the run that `save` wrote to a `path`.  Its people have the zones that the robot kept out of.

        Raises
        ------
        DataError : there is no run, it is damaged, or it has another format version.
        """
        file = _find_file(path)
        try:
            with open_regular(file) as stream:
                arrays = dict(np.load(stream))
            content = json.loads(str(arrays.pop("content")))
            if (content["format"], content["version"]) != (_FORMAT, _VERSION):
                raise ValueError(
                    f"format {content['format']} {content['version']}, expected {_FORMAT} {_VERSION}"
                )
            zones = tuple(Ellipse(**each) for each in content["zones"])
            people = tuple(
                Person(**person, zone=zone)
                for person, zone in zip(content["people"], zones, strict=False)
            )
            scene = content["scenario"]
            run = content["run"]
            run["inputs"] = tuple(run["inputs"])
            scene["obstacles"] = [restore(each) for each in scene["obstacles"]]
            return cls(
                Scenario(**scene, people=people),
                MPCSettings(**content["settings"]),
                zones,
                **arrays,
                **run,
            )
        except Exception as error:  # of NumPy, zipfile, zlib or json
            raise DataError(
                f"{file}: cannot be read as a run ({error!r}); expected a file of SimulationLog.save"
            ) from error


def _find_file(path: str | Path) -> Path:
    """The file of a run that is saved to `path`."""
    return Path(f"{str(path).removesuffix('.npz')}.npz")


def _pick(whole: Any, *names: str) -> dict[str, Any]:
    return {name: getattr(whole, name) for name in names}


def _format(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)

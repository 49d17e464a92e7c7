"""The log of a closed loop: light arrays, and from them its table, its metrics, its pictures, its file."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .. import __version__
from ..checks import Array
from ..control.barriers import barrier, ellipse_formula, euclidean_segment_formula, segment_formula
from ..control.distances import wall_margin
from ..control.person import BODY_RADIUS, Person
from ..control.settings import MPCSettings
from ..control.step import status_of
from ..errors import DataError
from ..files import write_file
from ..zones.ellipses import Ellipse
from .metrics import compute_metrics
from .outcomes import nanmin
from .scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FORMAT, _VERSION = "szlib.SimulationLog", 2
_ARRAYS = ("states", "controls", "people", "predicted", "residual", "rung", "safe", "slack", "solve_time")
_SHOWN = ("success", "outcome", "time_to_goal", "min_h", "min_clearance", "infeasible_steps")


@dataclass(frozen=True, eq=False, repr=False)
class SimulationLog:
    """One run in n states, dt apart, each with the step that the controller decided there.

    Attributes
    ----------
    scenario : what was run, its people with their own zones.
    settings : of the loop, and of what is measured: dt, r_robot, eps; the controller's, if it has any.
    zones : the zone of each person that was kept for them, in the person's frame; h is about these.
    states : (x, y, vx, vy) of the robot's disc, shape (n, 4) [m, m/s].
    controls : what the robot was driven by, (ax, ay) [m/s2] for the paper's, shape (n, 2); that of the last
        state was not applied any more.
    people : (x, y, heading, vx, vy) of everybody as they truly were, shape (n, P, 5) [m, rad, m/s]; NaN
        where somebody was not there.
    predicted : the plan of each step, shape (n, N+1, 4), or (n, 0, 4).
    residual : `Step.residual`, people before walls, shape (n, P+W, N_h) [m], NaN for whom the controller
        was not given, or (n, P+W, 0).
    rung : `Step.rung`, shape (n,), or "".
    safe : `Step.safe`, shape (n,): True is a promise.
    slack : largest violation of a hard row by each plan, shape (n,), or NaN.
    solve_time : of each step, shape (n,) [s]: what it says, or how long the call took.
    arrived : index of the first state at rest at the goal; None if there is none.
    promises : whether the controller says of its steps if they are safe.
    inputs : names of the controls.

    `predicted`, `residual`, `rung`, `slack` are empty as said where a controller does not tell them.
    """

    scenario: Scenario
    settings: MPCSettings
    zones: tuple[Ellipse, ...]
    states: Array
    controls: Array
    people: Array
    predicted: Array
    residual: Array
    rung: NDArray[np.str_]
    safe: NDArray[np.bool_]
    slack: Array
    solve_time: Array
    arrived: int | None
    promises: bool = True
    inputs: tuple[str, ...] = ("ax", "ay")

    @property
    def flagged(self) -> NDArray[np.bool_]:
        """Steps that said they were not safe, shape (n,): none of a controller that promises nothing."""
        return ~self.safe & self.promises

    @property
    def success(self) -> bool:
        """The robot came to rest at the goal."""
        return self.arrived is not None

    @cached_property
    def time(self) -> Array:
        """Time of each state, shape (n,) [s]."""
        return np.round(np.arange(len(self.states)) * self.settings.dt, 9)

    @cached_property
    def speed(self) -> Array:
        """Of the robot, shape (n,) [m/s]."""
        return np.asarray(np.hypot(self.states[:, 2], self.states[:, 3]))

    @cached_property
    def relative(self) -> Array:
        """The robot in each person's frame, shape (n, P, 2) [m]."""
        offset = self.states[:, None, :2] - self.people[:, :, :2]
        cos, sin = np.cos(self.people[:, :, 2]), np.sin(self.people[:, :, 2])
        ahead = offset[..., 0] * cos + offset[..., 1] * sin
        return np.stack([ahead, offset[..., 1] * cos - offset[..., 0] * sin], axis=-1)

    @cached_property
    def there(self) -> NDArray[np.bool_]:
        """Who was there when, shape (n, P)."""
        return ~np.isnan(self.people[:, :, 0])

    def to_person(self, i: int, distance: Callable[[Array], Array]) -> Array:
        """A distance of the robot, seen from person i, shape (n,); NaN while they are away."""
        values = np.full(len(self.states), np.nan)
        values[self.there[:, i]] = distance(self.relative[self.there[:, i], i])
        return values

    @cached_property
    def h(self) -> Array:
        """Barriers with people as they truly were, people before walls, shape (n, P+W) [m]."""
        s, walls = self.settings, self.scenario.walls
        zones = np.reshape([(*zone.foci.flat, zone.semi_axes[0]) for zone in self.zones], (-1, 5))
        to_people = ellipse_formula(self.relative[..., 0], self.relative[..., 1], *zones.T)
        margins = [s.eps] * len(zones) + [wall_margin(wall, s) for wall in walls]
        distances = np.hstack([to_people, self._to_walls(segment_formula)])
        return np.asarray(barrier(distances, s.r_robot, np.array(margins)))

    @cached_property
    def clearance(self) -> Array:
        """Euclidean gaps from the robot's disc to bodies (of `BODY_RADIUS`) and walls, (n, P+W) [m]."""
        to_people = np.hypot(self.relative[..., 0], self.relative[..., 1]) - BODY_RADIUS
        return np.hstack([to_people, self._to_walls(euclidean_segment_formula)]) - self.settings.r_robot

    def _to_walls(self, distance: Callable[..., Array]) -> Array:
        """A distance of the robot to each wall, shape (n, W) [m]."""
        x, y = self.states[:, :1], self.states[:, 1:2]
        return distance(x, y, *self.scenario.walls.reshape(-1, 4).T)

    @cached_property
    def cbf_people(self) -> Array:
        """Smallest residual of a person's barrier condition, shape (n,) [m]; inf where there is none."""
        return nanmin(self.residual[:, : len(self.zones)], axis=(1, 2))

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row a step: the state at its time and the control decided there.

        Columns: t [s], x, y [m], vx, vy, speed [m/s], ax, ay [m/s2] (or else `inputs`),
        status, rung, slack, solve_time [s], cbf_people [m], clearance (the least) [m], and for each person
        i and wall j: person_i_x, person_i_y [m], person_i_heading [rad], h_person_i, h_wall_j [m].
        """
        n, columns = len(self.zones), {"t": self.time}
        columns |= dict(zip(("x", "y", "vx", "vy"), self.states.T, strict=True)) | {"speed": self.speed}
        columns |= dict(zip(self.inputs, self.controls.T, strict=True))
        words = {"status": [status_of(rung) for rung in self.rung.tolist()], "rung": self.rung}
        numbers = {"slack": self.slack, "solve_time": self.solve_time, "cbf_people": self.cbf_people}
        numbers["clearance"] = nanmin(self.clearance, axis=1)
        for i in range(n):
            x, y, heading = self.people[:, i, :3].T
            numbers |= {f"person_{i}_x": x, f"person_{i}_y": y, f"person_{i}_heading": heading}
            numbers[f"h_person_{i}"] = self.h[:, i]
        numbers |= {f"h_wall_{j}": self.h[:, n + j] for j in range(len(self.scenario.walls))}
        return pd.DataFrame({**columns, **words, **numbers})

    def at(self, time: float) -> tuple[Array, Array, list[Person]]:
        """What a controller was asked at a time of the run [s]: state, goal, and people with the zones kept.

        So `controller.step(*log.at(5.0))` decides there anew. Who was away is left out.  Raises DataError
        for a time that is not within the run.
        """
        row = round(time / self.settings.dt)
        if not 0 <= row < len(self.states):
            raise DataError(f"the run has times from 0 to {self.time[-1]:g} s; got {time:g}")
        there = [
            Person((x, y), (vx, vy), heading, zone)
            for zone, (x, y, heading, vx, vy) in zip(self.zones, self.people[row].tolist(), strict=True)
            if x == x
        ]
        return self.states[row], self.scenario.goal, there

    def min_h(self) -> pd.Series[float]:
        """Smallest h of each person and wall over the run [m]."""
        return self.table.filter(regex="^h_").min()

    def metrics(self) -> dict[str, Any]:
        """The run in numbers; `szlib.simulation.metrics.compute_metrics` says what each is."""
        return compute_metrics(self)

    def plot(self, ax: Axes | None = None, **options: Any) -> Axes:
        """Draw the run (paper, fig. 6); `options` of `workbook.figures.simulation.plot_scenario`."""
        from ..workbook.figures.simulation import plot_scenario

        return plot_scenario(self, ax=ax, **options)

    def animate(self, **options: Any) -> bytes:
        """The run as an animated GIF, a player in notebooks; `options` as of `figures.animate`."""
        from ..workbook.figures.simulation import animate

        return animate(self, **options)

    def __repr__(self) -> str:
        shown = self.metrics()
        numbers = ", ".join(f"{name} {_short(shown[name])}" for name in _SHOWN)
        return (
            f"SimulationLog of {self.scenario.name!r}: {len(self.states)} states in {self.time[-1]:g} s, "
            f"{len(self.zones)} people, {len(self.scenario.walls)} walls\n  {numbers}"
        )

    def _repr_html_(self) -> str:
        rows = pd.Series({name: _short(value) for name, value in self.metrics().items()})
        title = self.scenario.title or self.scenario.name
        return f"<p><b>{title}</b></p>" + rows.to_frame(f"{self.time[-1]:g} s").to_html()

    def save(self, path: str | Path) -> None:
        """Write the run as ``<path>.parquet``, its arrays, and then ``<path>.json``, all else.

        A suffix of `path` is left out.  Claims are functions and are not saved.  Raises DataError where
        a file cannot be written.
        """
        stem, rows = Path(path).with_suffix(""), len(self.states)
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        flat = {name: list(a.reshape(rows, -1)) if a.ndim > 1 else a for name, a in arrays.items()}
        scenario, people = self.scenario, self.scenario.people
        content = {
            "format": _FORMAT,
            "version": _VERSION,
            "szlib": __version__,
            "units": "m, s, rad; world frame, zones in the frame of their person",
            "arrived": self.arrived,
            "promises": self.promises,
            "inputs": self.inputs,
            "shapes": {name: a.shape for name, a in arrays.items() if a.ndim == 3},
            "settings": asdict(self.settings),
            "zones": [_plain(zone) for zone in self.zones],
            "scenario": {name: getattr(scenario, name) for name in ("name", "title", "duration")}
            | {name: getattr(scenario, name).tolist() for name in ("start", "goal", "walls")},
            "people": [
                {"position": p.position, "velocity": p.velocity, "heading": p.heading} for p in people
            ],
        }
        buffer = io.BytesIO()
        pd.DataFrame(flat).to_parquet(buffer)
        write_file(stem.with_suffix(".parquet"), buffer.getvalue())
        write_file(stem.with_suffix(".json"), json.dumps(content, indent=1))

    @classmethod
    def load(cls, path: str | Path) -> SimulationLog:
        """Read a run written by `save`, its people with the zones that were kept.

        Raises DataError where there is none, or it is damaged or of another version of szlib.
        """
        stem = Path(path).with_suffix("")
        try:
            content = json.loads(stem.with_suffix(".json").read_text(encoding="utf-8"))
            if (content["format"], content["version"]) != (_FORMAT, _VERSION):
                raise ValueError(
                    f"format {content['format']} {content['version']}, expected {_FORMAT} {_VERSION}"
                )
            rows = pd.read_parquet(stem.with_suffix(".parquet"))
            arrays: dict[str, Any] = {name: np.array(rows[name].tolist()) for name in _ARRAYS}
            zones = tuple(Ellipse(z["center"], z["semi_axes"], z["angle"]) for z in content["zones"])
            people = tuple(
                Person(**who, zone=zones[i] if i < len(zones) else None)
                for i, who in enumerate(content["people"])
            )
            settings = MPCSettings(**content["settings"])
            scenario = Scenario(**content["scenario"], people=people)
            arrays |= {name: arrays[name].reshape(shape) for name, shape in content["shapes"].items()}
            more = {"arrived": content["arrived"], "promises": content["promises"]}
            return cls(scenario, settings, zones, inputs=tuple(content["inputs"]), **arrays, **more)
        except (OSError, KeyError, TypeError, ValueError) as error:
            raise DataError(
                f"{stem}: cannot be read as a run ({error!r}); expected the two files of SimulationLog.save"
            ) from error


def _plain(zone: Ellipse) -> Mapping[str, Any]:
    return {"center": zone.center, "semi_axes": zone.semi_axes, "angle": zone.angle}


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)

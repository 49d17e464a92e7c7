"""The laboratory without a kernel: runs over a small grid of values, recorded in the page with their reasons."""

from __future__ import annotations

import json
import zlib
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from html import escape
from itertools import product
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from szlib.core.checks import Array
from szlib.core.errors import DataError
from szlib.workbook.figures.movies import read_scripts, scene_layout

from .explanation import explain, name_limit
from .sliders import is_interactive
from .widget import Laboratory
from .world import World

LARGEST = 250_000  # of a recording in a page [bytes]
_MARGIN, _HEIGHT = 0.8, 1.6  # around everything, and half of the least height of the scene [m]
_PLACES = ("accelerations", "recorded")


@dataclass(frozen=True)
class Axis:
    """A value that a reader chooses.

    Parameters
    ----------
    name : of the argument that makes the world.
    label : what the reader sees, with its unit.
    values : the values, in order.
    start : the number of the value that is shown first.
    """

    name: str
    label: str
    values: Sequence[float]
    start: int = 0


class Recording:
    """Runs of the laboratory over all values of one or two axes; in a notebook and in HTML, a player.

    Parameters
    ----------
    title : what the runs show.
    make_world : function of the values of the axes that returns a `World`.
    axes : what the reader chooses.
    longest : time after which a run ends that does not arrive [s].
    every : time steps between two recorded ones.

    Attributes
    ----------
    table : for each run its values, the time to the goal [s] (None: it does not arrive) and the least h [m].

    Raises
    ------
    DataError : the recording is larger than a page should hold; use fewer values.

    Examples
    --------
    >>> import szlib
    >>> from laboratory import PRESETS, Axis, Recording, RobotOptions, World
    >>> zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
    >>> def make(gamma):
    ...     return World(PRESETS["passing"], zone, [RobotOptions(changes={"gamma": gamma})])
    >>> recording = Recording("Passing", make, [Axis("gamma", "gamma", [0.05, 0.2])], longest=2.0)
    >>> [row["gamma"] for row in recording.table]
    [0.05, 0.2]
    """

    def __init__(
        self,
        title: str,
        make_world: Callable[..., World],
        axes: Sequence[Axis],
        *,
        longest: float = 30.0,
        every: int = 2,
    ) -> None:
        self.title, self.table = title, list[dict[str, Any]]()
        self._make_world, self._shown = make_world, {each.name: each.values[each.start] for each in axes}
        texts: dict[str, int] = {}
        worlds, runs, places = [], [], [np.empty((0, 2))]
        for values in product(*(axis.values for axis in axes)):
            given = dict(zip((axis.name for axis in axes), values, strict=True))
            worlds.append(make_world(**given))
            run = _record(worlds[-1], longest, every, texts)
            places += [run.pop("places")]
            self.table.append(given | {"time": run.pop("time"), "least_h": run.pop("least_h")})
            runs.append(run | {"summary": _summarise(self.table[-1])})
        first, limits = worlds[0], _find_limits(np.vstack(places))
        settings = first.steps[0].scene.settings
        zones = [(*z.center, *z.semi_axes, z.angle) for z in first.steps[0].scene.person_zones]
        data = {
            "title": title,
            "layout": scene_layout(first.scenario, settings, limits),
            "axes": [vars(axis) | {"values": list(axis.values)} for axis in axes],
            "zones": np.round(zones, 4).tolist(),
            "a_max": settings.a_max,
            "every": every,
            "runs": runs,
            "texts": list(texts),
        }
        text = json.dumps(data, separators=(",", ":"))
        self.packed = b64encode(zlib.compress(text.encode(), 9)).decode()
        if len(self.packed) > LARGEST:
            raise DataError(
                f"the recording {title!r} has {len(self.packed)} bytes; expected at most {LARGEST}: record fewer runs"
            )

    def open_live(self) -> Laboratory | None:
        """The live laboratory on the scene that is shown first; None where no page of JupyterLab runs this."""
        if not is_interactive():
            return None
        world = self._make_world(**self._shown)
        return Laboratory(world.scenario, zone=world.zone, robots=world.robots)

    def __repr__(self) -> str:
        return f"{self.title}: {len(self.table)} recorded runs"

    def _repr_html_(self) -> str:
        name = f"szlib-{sha256(self.packed.encode()).hexdigest()[:8]}"
        scripts = "\n".join([read_scripts("scene"), *(_read(each) for each in _PLACES)])
        return (
            f'<figure class="szlib-recording" data-recording="{name}" style="margin:0">'
            f'<p class="szlib-still">{escape(self.title)}. Scripts do not run here, so the runs are listed.</p>'
            f"{self._list_runs()}</figure>\n<script>(() => {{\n{scripts}\n"
            f'const text = "{self.packed}";\n'
            f"document.querySelectorAll('[data-recording={name}]:not([data-ready])')"
            ".forEach((figure) => playRecording(figure, text));\n})()</script>"
        )

    def _list_runs(self) -> str:
        """All runs as a table, for those who do not see the picture."""
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(_show(value))}</td>" for value in row.values()) + "</tr>"
            for row in self.table
        )
        names = [*list(self.table[0])[:-2], "time to the goal [s]", "least h [m]"]
        head = "".join(f"<th>{escape(each)}</th>" for each in names)
        return (
            "<details><summary>All runs as a table</summary>"
            f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></details>"
        )


def _read(name: str) -> str:
    return Path(__file__).with_name(f"{name}.js").read_text(encoding="utf-8")


def _show(value: float | None) -> str:
    return "does not arrive" if value is None else f"{value:g}"


def _summarise(row: Mapping[str, Any]) -> str:
    time = "it does not arrive" if row["time"] is None else f"it arrives after {row['time']:.1f} s"
    return f"In this run {time}; least h {row['least_h']:.2f} m."


def _record(world: World, longest: float, every: int, texts: dict[str, int]) -> dict[str, Any]:
    """Rows of a run for `recorded.js`, in centimetres; `texts` numbers the sentences."""
    rows, least, places = [], np.inf, [world.scenario.goal]
    while True:
        step = world.steps[0]
        least = min(least, float(step.h.min(initial=np.inf)))
        done = world.arrived or world.n * world.dt >= longest
        if world.n % every == 0 or done:
            rows.append(_make_row(world, texts))
        places += [np.array(step.scene.state[:2]), *(np.array(p.position) for p in world.people)]
        if done:
            break
        world.advance()
    walls = world.scenario.walls
    return {
        "rows": rows,
        "goal": np.round(world.scenario.goal, 2).tolist(),
        "walls": np.round(walls.reshape(-1, 4), 2).tolist(),
        "time": round(world.n * world.dt, 1) if world.arrived else None,
        "least_h": round(least, 2) + 0.0,
        "places": np.vstack(places),
    }


def _make_row(world: World, texts: dict[str, int]) -> list[Any]:
    """One recorded time step: see `recorded.js`."""
    step, reasons = world.steps[0], explain(world.steps[0])
    x, y, *velocity = step.scene.state
    parts = shapely.get_parts(reasons.found.polygon.simplify(0.03))  # 0.03 m/s2 off
    allowed = [p.exterior.coords for p in parts if p.geom_type == "Polygon" and not p.is_empty]
    people = [(*person.position, person.heading or 0.0) for person in world.people]
    named = [(name_limit(step, each).rsplit(" ", 1), each.curve) for each in reasons.active]
    sentence, safety = (texts.setdefault(text, len(texts)) for text in (reasons.sentence, reasons.safety))
    return [
        _round([x, y]),
        _round([hypot(*velocity)])[0],
        [_round(person) for person in people],
        _round([float(step.h.min())])[0] if len(step.h) else None,
        _round(step.predicted[1:, :2]),
        _round(step.control),
        [_round(np.asarray(corners)) for corners in allowed],
        [[kind, int(number), _round(_thin(curve))] for (kind, number), curve in named],
        sentence,
        safety,
    ]


def _thin(curve: Array) -> Array:
    """At most eight points of a curve, with its ends."""
    return curve[np.unique(np.linspace(0, len(curve) - 1, 8).astype(int))]


def _round(values: Any) -> list[int]:
    """Centimetres, or hundredths, as whole numbers."""
    return [round(100.0 * float(each)) for each in np.asarray(values, float).ravel()]


def _find_limits(places: Array) -> tuple[float, float, float, float]:
    (x0, y0), (x1, y1) = places.min(axis=0) - _MARGIN, places.max(axis=0) + _MARGIN
    return x0, x1, min(y0, -_HEIGHT), max(y1, _HEIGHT)

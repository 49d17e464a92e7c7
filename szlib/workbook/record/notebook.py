"""What a notebook writes down: its checks, its figures, its key numbers, its artefacts.

A *check* must hold, or the run fails.  It belongs to the settings it was made for: where a parameter was
changed it becomes an *observation*, unless it holds for any setting (`always`).  A *claim* of the paper is
measured: where the data does not support it the record says "not supported here", with the numbers.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from pandas.io.formats.style import Styler

from ... import __version__
from ...encounters.areas import as_area
from ...encounters.finding import find_encounters
from ...encounters.geometry import Area
from ...encounters.one_day import require_encounters, with_area
from ...encounters.settings import EncounterSettings
from ...errors import DataError, ZoneError
from ...files import claim_folder, file_content, load_cached, store_cached, write_checksum, write_file
from ...plaza.generation import make_plaza
from ...plaza.settings import PlazaSettings
from ...tracks import datasets
from ...tracks.clock import read_tracks
from ...tracks.options import ReadOptions
from ...zones.ellipses import Ellipse
from ...zones.social_zone import SocialZone
from . import places
from .method import DEFAULTS, Method
from .tables import as_text, show_drawn, show_with_words, whole
from .validation import FOR_OPTIONS, NEUTRAL, defaults_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_PLAIN = "text that is not made from numbers speaks of the defaults"


class NotebookRecord:
    """The record of one notebook.

    Parameters
    ----------
    name : of the notebook, "NN_topic".
    variables : the notebook's, `globals()`, of which these and those of its cell tagged "parameters" count:
        data: "synthetic" (the plaza, written among the results), or as in `szlib.tracks.datasets.find`;
        area: where encounters are looked for, as for `szlib.as_area`, "auto", or "" for the data's own;
        seed: of everything random, the synthetic plaza included; results: folder of all results,
        `places.RESULTS` where it is not given.

    Attributes
    ----------
    data, area, seed : these.
    method : how the zone is made: the knobs of notebooks 02 to 05, as they were turned.
    changed : parameters of this notebook, and knobs of the method, that are not as they were when its checks
        were made: name and value.
    out : where its results go: into the folder of the run that executes it; executed by hand, into one
        for its data and parameters in the folder `lab` of all results.
    """

    def __init__(self, name: str, variables: Mapping[str, Any]) -> None:
        self.name = name
        self.data: str | Sequence[str] = variables["data"]
        self.area: str = variables.get("area", "")
        self.seed: int = variables.get("seed", 0)
        self.checks: list[dict[str, Any]] = []
        self.figures: list[str] = []
        self.key: dict[str, Any] = {}
        script = places.NOTEBOOKS / f"{name}.py"
        defaults = {**DEFAULTS, **(defaults_of(script) if script.exists() else {"area": "", "seed": 0})}
        self.method = Method.of(variables)
        changed = {n: variables[n] for n, v in defaults.items() if variables.get(n, v) != v}
        self.changed = {n: v for n, v in changed.items() if n not in NEUTRAL}
        if self.changed:
            print(f"{self._settings()}: checks of the defaults are observations here; {_PLAIN}")
        self.out = self._folder(variables, {n: v for n, v in changed.items() if n not in FOR_OPTIONS})
        for part in ("records", "figures"):
            (self.out / part).mkdir(exist_ok=True)
        show_with_words()

    def _folder(self, variables: Mapping[str, Any], given: Mapping[str, Any]) -> Path:
        if run := os.environ.get(places.RUN_VARIABLE):
            return Path(run)
        results = places.root(variables.get("results", places.RESULTS))
        claim_folder(results, places.ROOT)
        return places.home(results / places.LAB, self.data, given)

    @property
    def synthetic(self) -> bool:
        """Whether the data is the plaza, whose truth is known."""
        return self.data == datasets.SYNTHETIC

    def _settings(self) -> str:
        """What was changed, to read: "with gamma = 0.2"."""
        return "with " + ", ".join(f"{name} = {value}" for name, value in self.changed.items())

    def files(self) -> list[Path]:
        """The files of the data set."""
        return data_files(self.data, folder=self.out, seed=self.seed)

    def tracks(self) -> pd.DataFrame:
        """The track table of the data set."""
        return read_tracks(self.files())

    def encounters(self) -> pd.DataFrame:
        """The encounters that notebook 02 left, or found now where there are none of this data and seed."""
        content = load_cached(self.out / "encounters.parquet", self._source())
        if content is not None:
            return pd.read_parquet(io.BytesIO(content))
        tracks = self.tracks()
        found = find_encounters(tracks, area=self.square(tracks), **self.method.search())
        return self.keep_encounters(found)

    def square(self, tracks: pd.DataFrame | None = None) -> Area:
        """Where encounters are looked for: the area given, or the data's own; found once, kept in area.txt.

        `tracks`, those of the data, spare reading them again where people's walks must tell the area.
        """
        if content := load_cached(self.out / "area.txt", self._source()):
            return as_area(content.decode())
        settings = EncounterSettings(area=self.area or None)
        area = with_area(settings, self.files(), ReadOptions(), tracks).area
        store_cached(self.out / "area.txt", str(area).encode(), self._source())
        return as_area(area)

    def keep_encounters(self, samples: pd.DataFrame) -> pd.DataFrame:
        """Leave the encounters for the notebooks to come; DataError, saying why, where there are none."""
        require_encounters(samples)
        content = io.BytesIO()
        samples.to_parquet(content)
        store_cached(self.out / "encounters.parquet", content.getvalue(), self._source())
        return samples

    def zone(self) -> SocialZone:
        """The zone that notebook 05 left, or fitted now where there is none of this data and seed."""
        file = self.out / "zone.json"
        if file.exists():
            try:
                if load_cached(file, self._source(zone=True)) is not None:
                    return SocialZone.load(file)
                print("fitting the zone again: that in zone.json is of other data, or damaged")
            except ZoneError as error:
                print(f"fitting the zone again: {error}")
        return self.keep_zone(SocialZone.fit(self.encounters(), **self.method.fit()))

    def ellipse(self) -> Ellipse:
        """The zone that the robot keeps: that of `zone_speed`, in the person's frame."""
        return self.zone().ellipse(self.method.zone_speed)

    def keep_zone(self, zone: SocialZone) -> SocialZone:
        """Leave the zone for the notebooks to come."""
        source = self._source(zone=True)
        zone = replace(zone, provenance={**zone.provenance, "source": source})
        zone.save(self.out / "zone.json")
        write_checksum(self.out / "zone.json", (self.out / "zone.json").read_bytes(), source)
        return zone

    def check(self, what: str, passed: object, value: object = None, *, always: bool = False) -> None:
        """Record what must hold; a failure fails the run, after the notebook has gone to its end.

        Where a parameter was `changed` it is an observation, which fails nothing, unless it holds `always`:
        for any setting, by construction or by proof.
        """
        if self.changed and not always:
            result = f"{'holds' if passed else 'does not hold'} {self._settings()}"
            self._record("observation", what, bool(passed), value, result)
        else:
            self._record("check", what, bool(passed), value, "holds" if passed else "FAILED")

    def claim(self, what: str, supported: object, value: object = None) -> None:
        """Record whether the data supports a claim of the paper; if not, the run goes on."""
        self._record(
            "claim", what, bool(supported), value, "supported" if supported else "not supported here"
        )

    def figure(self, figure: Figure, name: str) -> None:
        """Save a figure among the results as NN_topic-name.png, and show it."""
        content = io.BytesIO()
        figure.savefig(content, dpi=150, bbox_inches="tight")
        self._picture(content.getvalue(), f"{self.name}-{name}.png")
        show_drawn(figure, content.getvalue())

    def animation(self, content: bytes, name: str) -> None:
        """Save an animated picture among the results as NN_topic-name.gif."""
        self._picture(content, f"{self.name}-{name}.gif")

    def table(self, table: pd.DataFrame, name: str) -> None:
        """Save a table among the results as name.csv."""
        write_file(self.out / f"{name}.csv", table.to_csv(index=False))

    def close(self) -> Styler:
        """Write the record for the summary; returns its checks and claims to read."""
        record = {
            "notebook": self.name,
            "checks": self.checks,
            "key_figures": self.key,
            "figures": self.figures,
        }
        text = json.dumps(record, indent=1, default=_plain)
        write_file(self.out / "records" / f"{self.name}.json", text)
        rows = [(c["kind"], c["name"], c["result"], as_text(c["value"])) for c in self.checks]
        return whole(pd.DataFrame(rows, columns=["kind", "name", "result", "value"]))

    def _record(self, kind: str, name: str, passed: bool, value: object, result: str) -> None:
        value = _plain(value)
        self.checks.append({"kind": kind, "name": name, "passed": passed, "value": value, "result": result})
        print(f"{kind}: {name}: {result}" + ("" if value is None else f" ({as_text(value)})"))

    def _picture(self, content: bytes, name: str) -> None:
        write_file(self.out / "figures" / name, content, durable=False)
        self.figures.append(name)

    def _source(self, *, zone: bool = False) -> dict[str, Any]:
        """What encounters, or the zone, are made of: the files' content, every parameter, this version."""
        files = [[file.name, *file_content(file)] for file in self.files()]
        made = {"data": datasets.label(self.data), "seed": self.seed, "files": files, "area": self.area}
        made["szlib"] = __version__
        made["parameters"] = EncounterSettings(**self.method.search()).as_json()
        if zone:
            made["fit"] = self.method.fit()
        return json.loads(json.dumps(made))  # type: ignore[no-any-return]


def data_files(data: str | Sequence[str], *, folder: Path, seed: int) -> list[Path]:
    """The files of a data set; those of the plaza of this seed are written into `folder` if missing.

    A file of that name that is not this plaza's is made anew: it is known by its content.
    """
    if data != datasets.SYNTHETIC:
        return datasets.find(data)
    file = folder / f"plaza-{seed}.csv"
    made = {"plaza": repr(PlazaSettings()), "seed": seed, "szlib": __version__}
    if load_cached(file, made) is None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            make_plaza(file, seed=seed)
            write_checksum(file, file.read_bytes(), made)
        except OSError as error:
            raise DataError(f"{file}: the plaza cannot be made ({error}); choose another folder") from error
    return [file]


def _plain(value: Any) -> Any:
    """NumPy's numbers as Python's, rounded to what a reader can use."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(v) for v in value]
    if hasattr(value, "item"):
        value = value.item()
    return round(value, 6) if isinstance(value, float) else value

"""The data of a notebook: tracks, area, encounters and zone, computed once for each choice of parameters."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd

from ... import (
    DataError,
    Ellipse,
    EncounterSettings,
    NullEncounters,
    PlazaSettings,
    SocialZone,
    ZoneError,
    __version__,
    find_encounters,
    make_plaza,
    null_encounters,
    read_tracks,
)
from ...core.files import load_cached, store_cached, write_checksum
from ...core.input_files import file_content, printable, unchanged_files
from ...encounters import days
from ...encounters.areas import AUTO, place_apart
from ...encounters.finding import find_place
from ...encounters.geometry import Area
from ...tracks import datasets
from ...zones.social_zone import recorded_hours
from ...zones.verdict import describe_missing_encounters, require_encounters
from .parameters import ZoneMethod

# time-shifted copies of the data that lone encounters are compared with (assumed)
NULL_SHIFTS = 39


@dataclass(frozen=True)
class DataCache:
    """Tracks, area, encounters and zone of a data set, kept in a folder of results.

    A file in the folder is used if it was made from the same data, parameters and version of szlib, and is
    not damaged. Otherwise it is made again.

    Parameters
    ----------
    folder : where the files are, `encounters.parquet` and `zone.json`.
    data : "synthetic" (the plaza, which is then written into the folder), the name of another data set, or
        paths of track files.
    area : where encounters are found, as for `szlib.as_area`; "auto"; or "" for the default of the data.
    seed : of the synthetic plaza.
    method : how encounters are found and the zone is fitted.
    contents : name, size and checksum of each file of the data; empty: those of the first time that they are
        read.  Files that then hold something else raise a DataError.

    Examples
    --------
    >>> import szlib
    >>> from szlib.workbook.record import DataCache
    >>> szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=3)).name
    'plaza.csv'
    >>> cache = DataCache("results", "plaza.csv")
    >>> cache.encounters()["encounter"].nunique() > 0
    True
    """

    folder: str | Path
    data: str | Sequence[str]
    area: str = ""
    seed: int = 0
    method: ZoneMethod = field(default_factory=ZoneMethod)
    contents: list[list[Any]] = field(default_factory=list, repr=False)

    @property
    def is_synthetic(self) -> bool:
        """Whether the data is the synthetic plaza, whose true zone is known."""
        return self.data == datasets.SYNTHETIC

    @property
    def settings(self) -> EncounterSettings:
        """What counts as an encounter, and the area, if one is given."""
        return self.method.encounter_settings(self.area or None)

    def files(self) -> list[Path]:
        """The files of the data set; the plaza is written first if it is missing or damaged."""
        if not self.is_synthetic:
            return datasets.find(self.data)
        file = self._path(f"plaza-{self.seed}.csv")
        source = {
            "plaza": repr(PlazaSettings()),
            "seed": self.seed,
            "szlib": __version__,
        }
        if load_cached(file, source) is None:
            make_plaza(file, seed=self.seed)
            write_checksum(file, file.read_bytes(), source)
        return [file]

    def tracks(self) -> pd.DataFrame:
        """The track table of the data set; recordings that have each their own area stand side by side."""
        with self._unchanged_data() as files:
            tracks = read_tracks(files, recipe=self.method.read_options())
        area = self.settings.area or tracks.attrs.get("area", AUTO)
        return place_apart(tracks) if area == AUTO else tracks

    def find_area(self, tracks: pd.DataFrame | None = None) -> Area:
        """The area in which encounters are found: the one given, or the default of the data.

        `tracks`, the table of the data, saves reading the files again where the area depends on them.
        """
        if tracks is not None:
            return find_place(tracks, self.settings)[1]
        with self._unchanged_data() as files:
            return days.find_area(files, self.settings, self.method.read_options())

    def encounters(self) -> pd.DataFrame:
        """The encounters that notebook 02 stored, or the same found now."""
        content = load_cached(self._path("encounters.parquet"), self.source())
        if content:
            return pd.read_parquet(io.BytesIO(content))
        return self.store_encounters(
            find_encounters(self.tracks(), settings=self.settings)
        )

    def store_encounters(self, samples: pd.DataFrame) -> pd.DataFrame:
        """Store the `samples` of encounters for later notebooks, and return them.

        Raises DataError, which names the condition that rejected the last rows, if there are none.
        """
        require_encounters(samples)
        content = io.BytesIO()
        samples.to_parquet(content)
        store_cached(
            self._path("encounters.parquet"), content.getvalue(), self.source()
        )
        return samples

    def zone(self) -> SocialZone:
        """The zone that notebook 06 stored, or the same fitted now."""
        file = self._path("zone.json")
        source = self._zone_source()
        zone = read_stored_zone(file) if load_cached(file, source) else None
        if zone and zone.provenance.get("source") == json.loads(json.dumps(source)):
            return zone
        return self.fit_zone()

    def fit_zone(self) -> SocialZone:
        """Fit the zone to every pair of people, and store it for later notebooks.

        Where a recording is too short for a null model, it is the paper's zone, of lone encounters.
        """
        options = self.method.fit_options()
        tracks = self.tracks()
        area = self.find_area(tracks)
        try:
            zone = SocialZone.from_tracks(tracks, area=area, **options)
        except DataError as error:
            print(f"The zone is not tested against a null model: {error}")
            zone = SocialZone.fit(self.encounters(), method="paper", **options)
        return self.store_zone(zone)

    def null_model(self) -> NullEncounters | None:
        """The null model of the encounters, as from `find_null_model`."""
        return find_null_model(
            self.tracks(), settings=self.settings, r_max=self.method.r_max
        )

    def ellipse(self) -> Ellipse:
        """The ellipse that the robot keeps out of: the zone at `zone_speed`, in the person's frame."""
        return self.zone().ellipse(self.method.zone_speed)

    def store_zone(self, zone: SocialZone) -> SocialZone:
        """Store the `zone` for later notebooks, and return it with its source."""
        file = self._path("zone.json")
        source = self._zone_source()
        zone = replace(zone, provenance={**zone.provenance, "source": source})
        zone.save(file)
        write_checksum(file, file.read_bytes(), source)
        return zone

    def _path(self, name: str) -> Path:
        """A file in the folder, which is made if it is missing."""
        folder = Path(self.folder)
        folder.mkdir(parents=True, exist_ok=True)
        return folder / name

    @contextmanager
    def _unchanged_data(self) -> Iterator[list[Path]]:
        """Give the files of the data; raise DataError if they change, or are not those of `contents`."""
        files = self.files()
        with unchanged_files(files):
            found = [[file.name, *file_content(file)] for file in files]
            self.contents.extend([] if self.contents else found)
            changed = [
                file
                for file, now in zip(files, found, strict=True)
                if now not in self.contents
            ]
            if changed:
                raise DataError(
                    f"{printable(changed[0])}: has changed since it was first read; run again"
                )
            yield files

    def source(self) -> dict[str, Any]:
        """What encounters are made from: content of the files, parameters, version of szlib."""
        with self._unchanged_data():
            files = self.contents
        return {
            "data": datasets.label(self.data),
            "seed": self.seed,
            "files": files,
            "area": self.area,
            "szlib": __version__,
            "parameters": self.method.encounter_settings().as_json(),
            "reading": self.method.reading,
        }

    def _zone_source(self) -> dict[str, Any]:
        """What the zone is made from."""
        return self.source() | {"fit": self.method.fit_options()}


def find_null_model(tracks: pd.DataFrame, **options: Any) -> NullEncounters | None:
    """The null model of `tracks`; None, and a message, where they are too short for one.

    `options` are as for `szlib.null_encounters`.
    """
    try:
        return null_encounters(tracks, shifts=NULL_SHIFTS, progress=False, **options)
    except DataError as error:
        print(f"The zone is not tested against a null model: {error}")
        return None


def describe_missing_data(file: Path) -> str:
    """What the stored encounters in a `file` lack for a zone; "" if nothing, or without a file."""
    if not file.exists():
        return ""
    samples = pd.read_parquet(file, columns=["day", "t", "encounter"])
    n_encounters = samples["encounter"].nunique()
    return describe_missing_encounters(
        {"encounters": n_encounters, "hours": recorded_hours(samples)}
    )


def read_stored_zone(file: Path) -> SocialZone | None:
    """The zone in a `file`; None if it is damaged or of another version: it is fitted again when needed."""
    try:
        return SocialZone.load(file)
    except ZoneError:
        return None

"""One day from its files to its encounters: every parameter on the way, the way itself, and its record.

The stored encounters of a day are written as a whole or not at all, and known by what they were made of.
"""

from __future__ import annotations

import hashlib
import io
import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .. import __version__
from ..errors import DataError, DataWarning
from ..files import file_content, write_file
from ..tracks import funnels
from ..tracks.clock import to_clock
from ..tracks.formats import find_format
from ..tracks.options import Columns, ReadOptions
from ..tracks.readers import read_raw
from .areas import AUTO, as_area, walked_area
from .finding import find_encounters
from .geometry import PAPER_SPACE, Area, AttentionalSpace, Region, Square
from .kinds import KINDS
from .near_rows import read_near_square
from .near_rows_cache import Content
from .samples import SAMPLE_COLUMNS

_ADVICE = {
    "corner": 'the space ahead of a person, 4 m x 5 m, has no room there: give a larger area, or "auto"',
    "square": 'give an area in which people walked: four numbers or a polygon, or "auto"',
    "slow": "are unit and frame rate right? else pass a smaller min_speed",
    "velocity": "tracks are single points: pass a longer max_gap, or join the ids of one person",
    "ends": "tracks are short, or torn: pass a longer max_gap, or a shorter duration",
    "nobody": "people were never near each other: more data, or a larger space",
    "several": "it was crowded: a smaller space",
    "nearer": "people came into view late: pass a smaller min_distance",
    "somebody else": "more data, or other conditions (szlib.find_encounters)",
}
"""What to do where a condition, known by a word of it, has turned everybody away."""
_FORMAT, _VERSION = "szlib.extraction", 5


@dataclass(frozen=True)
class Chain:
    """Every parameter from a file to its encounters: those of `read_tracks` and `find_encounters`.

    `square` may be anything that `szlib.as_area` takes; "auto" finds the `szlib.walked_area` of the files;
    None stands for the data's own: `ATC_SQUARE` for files in a format of the ATC mall's, else "auto".
    """

    square: object = None
    space: AttentionalSpace = PAPER_SPACE
    duration: float = 3.0
    min_distance: float = 1.0
    min_speed: float = 0.4
    throughout: bool = False
    file_format: str | None = None
    unit: str | None = None
    frame_rate: float | None = None
    max_gap: float | None = None
    tz: str = "Asia/Tokyo"
    columns: Columns | None = None

    def __post_init__(self) -> None:
        if self.square is not None and self.square != AUTO:
            object.__setattr__(self, "square", as_area(self.square))
        _ = self.read_options

    @property
    def read_options(self) -> ReadOptions:
        """How the files are read."""
        return ReadOptions(**{name: getattr(self, name) for name in ReadOptions.__dataclass_fields__})

    def parameters(self) -> dict[str, Any]:
        """Every parameter as JSON values; the area as text that reads back."""
        return asdict(self) | {"square": None if self.square is None else str(self.square)}

    def settled(self, files: Sequence[Path], tracks: pd.DataFrame | None = None) -> Chain:
        """The same with the area that these files have where none was given; `tracks`: theirs, if known."""
        if area := self._known_area(files):
            return replace(self, square=area)
        if tracks is not None:
            return replace(self, square=walked_area(tracks))
        with warnings.catch_warnings():  # rows set aside are told when the day itself is read
            warnings.simplefilter("ignore", DataWarning)
            tracks = to_clock(self._read(files), max_gap=self.max_gap)
        return replace(self, square=walked_area(tracks))

    def encounters(self, files: Sequence[Path], content: Sequence[Content] = ()) -> pd.DataFrame:
        """The encounters of one day's files: identical to those found from `szlib.read_tracks(files)`.

        With the `contents` of the files, rows near the area are kept for next time, in the user's cache.
        """
        area = self._known_area(files)
        raw = self._read(files, area, content)
        tracks = to_clock(raw, max_gap=self.max_gap) if len(raw) else raw
        if len(tracks) == 0:
            return funnels.attach(no_samples(), funnels.get(tracks))
        return find_encounters(
            tracks,
            square=area or walked_area(tracks),
            space=self.space,
            duration=self.duration,
            min_distance=self.min_distance,
            min_speed=self.min_speed,
            throughout=self.throughout,
        )

    def _known_area(self, files: Sequence[Path]) -> Area | None:
        """The area given, or the mall's; None where it must be found."""
        if isinstance(self.square, Square | Region):
            return self.square
        areas = {find_format(file, self.read_options).area for file in files}
        known = areas.pop() if self.square is None and len(areas) == 1 else None
        return Square(*known) if known else None

    def _read(
        self, files: Sequence[Path], near: Area | None = None, content: Sequence[Content] = ()
    ) -> pd.DataFrame:
        """Rows of the files; of a single one, where an area is given, those near it."""
        if near is None or len(files) > 1:
            return read_raw(files, options=self.read_options)
        known = content[0] if content else None
        return read_near_square(
            files[0], square=near, duration=self.duration, options=self.read_options, content=known
        )


def check_met(samples: pd.DataFrame) -> pd.DataFrame:
    """The samples, where anybody met; else DataError: the stage that was emptied, by what, and what to do."""
    if len(samples):
        return samples
    stages = [stage for stage in funnels.get(samples) if stage["entered"]]
    emptied = next((stage for stage in stages if not stage["kept"]), None)
    if emptied is None:
        raise DataError("the table of samples is empty, and has no funnel that says why")
    rows = ", ".join(f"{count:,} {reason}" for reason, count in emptied["rejected"].items())
    last = list(emptied["rejected"])[-1]
    advice = next((told for words, told in _ADVICE.items() if words in last), _ADVICE["somebody else"])
    raise DataError(
        f"nobody met in the area {samples.attrs.get('area', '')}: of {emptied['entered']:,} "
        f"({emptied['stage']}) none is left: {rows}.  What emptied it: {last}; {advice}"
    )


def no_samples() -> pd.DataFrame:
    """A table of samples in which nobody met."""
    integers, numbers = np.zeros(0, np.int64), np.zeros(0)
    columns: Mapping[str, Any] = dict.fromkeys(SAMPLE_COLUMNS, numbers) | dict.fromkeys(
        ("encounter", "ref_id", "other_id"), integers
    )
    samples = pd.DataFrame({**columns, "day": pd.Categorical([])})[SAMPLE_COLUMNS]
    return samples.assign(kind=pd.Categorical([], categories=list(KINDS)))


@contextmanager
def contents(files: Sequence[str]) -> Iterator[list[Content]]:
    """What gives the content of each file; a thread looks for it from now on, while the files are read."""
    with ThreadPoolExecutor(1) as thread:
        yield [thread.submit(file_content, Path(file)).result for file in files]


def day_key(files: Sequence[str], content: Sequence[Content], chain: Chain) -> str:
    """Names the result: the content of the files, every parameter, and this version of szlib."""
    found = sorted((Path(file).name, *known()) for file, known in zip(files, content, strict=True))
    named = {"format": [_FORMAT, _VERSION, __version__], "files": found, "parameters": chain.parameters()}
    return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()


def finished_record(folder: Path, day: str, key: str) -> dict[str, Any] | None:
    """The record of a day that is there, whole, and made of the same content with the same parameters."""
    try:
        record = json.loads((folder / f"{day}.json").read_text(encoding="utf-8"))
        samples = (folder / f"{day}.parquet").read_bytes()
    except (OSError, ValueError):  # not there, or not whole
        return None
    whole = isinstance(record, dict) and record.get("key") == key and record.get("seal") == _seal(record)
    return record if whole and record.get("sha256") == hashlib.sha256(samples).hexdigest() else None


def write_record(
    folder: Path, day: str, key: str, samples: pd.DataFrame, files: Sequence[str], chain: Chain
) -> dict[str, Any]:
    """Write the samples of a day, then its record."""
    content = io.BytesIO()
    samples.to_parquet(content, index=False)
    stages = funnels.get(samples)
    read = [stage for stage in stages if stage["stage"].startswith("read ")]
    record = {
        "format": _FORMAT,
        "version": _VERSION,
        "szlib": __version__,
        "key": key,
        "day": day,
        "files": [Path(file).name for file in files],
        "parameters": chain.parameters(),
        "rows": sum(stage["entered"] for stage in read),
        "unusable": sum(stage["entered"] - stage["kept"] for stage in read),
        "encounters": int(samples["encounter"].nunique()),
        "samples": len(samples),
        "sha256": hashlib.sha256(content.getvalue()).hexdigest(),
        "funnel": stages,
    }
    record["seal"] = _seal(record)
    write_file(folder / f"{day}.parquet", content.getvalue())
    write_file(folder / f"{day}.json", json.dumps(record, indent=1))
    return record


def _seal(record: Mapping[str, Any]) -> str:
    """SHA-256 of all else in a record."""
    rest = {name: value for name, value in record.items() if name != "seal"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()

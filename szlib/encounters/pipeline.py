"""One day from its files to its encounters: every parameter on the way, and the way itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd

from ..errors import DataError
from ..tracks import funnels
from ..tracks.clock import to_clock
from ..tracks.formats import FORMATS
from ..tracks.readers import read_raw
from .geometry import ATC_SQUARE, PAPER_SPACE, AttentionalSpace, Square
from .kinds import KINDS
from .search import SAMPLE_COLUMNS, find_encounters
from .streaming import read_near_square


@dataclass(frozen=True)
class Chain:
    """Every parameter from a file to its encounters: those of `read_tracks` and `find_encounters`."""

    square: Square = ATC_SQUARE
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

    def __post_init__(self) -> None:
        try:
            ZoneInfo(self.tz)
        except (KeyError, ValueError, OSError) as error:
            raise DataError(f"unknown time zone {self.tz!r}; expected one like 'Asia/Tokyo'") from error
        if self.file_format is not None and self.file_format not in FORMATS:
            raise DataError(f"unknown file_format {self.file_format!r}; expected one of {list(FORMATS)}")
        if self.unit not in (None, "m", "mm"):
            raise DataError(f"unit must be 'm' or 'mm'; got {self.unit!r}")

    def encounters(self, files: Sequence[Path]) -> pd.DataFrame:
        """The encounters of one day's files: identical to those found from `szlib.read_tracks(files)`."""
        if len(files) == 1:
            raw = read_near_square(
                files[0],
                square=self.square,
                duration=self.duration,
                file_format=self.file_format,
                unit=self.unit,
                frame_rate=self.frame_rate,
                max_gap=self.max_gap,
                tz=self.tz,
            )
        else:
            raw = read_raw(
                files,
                file_format=self.file_format,
                unit=self.unit,
                frame_rate=self.frame_rate,
                tz=self.tz,
            )
        tracks = to_clock(raw, max_gap=self.max_gap) if len(raw) else raw
        if len(tracks) == 0:
            return funnels.carry(no_samples(), funnels.of(tracks))
        return find_encounters(
            tracks,
            square=self.square,
            space=self.space,
            duration=self.duration,
            min_distance=self.min_distance,
            min_speed=self.min_speed,
            throughout=self.throughout,
        )


def no_samples() -> pd.DataFrame:
    """A table of samples in which nobody met."""
    integers, numbers = np.zeros(0, np.int64), np.zeros(0)
    columns: Mapping[str, Any] = dict.fromkeys(SAMPLE_COLUMNS, numbers) | dict.fromkeys(
        ("encounter", "ref_id", "other_id"), integers
    )
    samples = pd.DataFrame({**columns, "day": pd.Categorical([])})[SAMPLE_COLUMNS]
    return samples.assign(kind=pd.Categorical([], categories=list(KINDS)))

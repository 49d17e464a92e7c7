"""The ATC mall's files: raw, about 25 rows a second and person, and 1 Hz."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

from .base import TrackFormat

_DAY, _JAPAN = 86_400.0, "Asia/Tokyo"
# Central square of the mall, (lowest, highest) x and y [m] (assumed; free of pillars, walls and queues).
ATC_AREA = ((-18.5, -7.5), (-10.0, 8.0))
_COLUMNS = {"t": 0, "id": 1, "x": 2, "y": 3}


@dataclass(frozen=True)
class _AtcRaw(TrackFormat):
    """Rows of 8 numbers: time [s], id, x, y, z [mm], speed [mm/s], two angles."""

    tz = _JAPAN
    area = ATC_AREA
    is_streamed = True
    speed_field = (5, 1e-3)

    def first_time(self, path: Path, first: str) -> float | None:
        """Time of the `first` line of file `path` [s since 1970]; ValueError where it holds no number."""
        return float(first.split(self.separator)[self.columns["t"]]) + self.clock_start(path, first)


@dataclass(frozen=True)
class _Atc1Hz(_AtcRaw):
    """Rows of 6 numbers: time [s], id, x, y [m], speed [m/s], angle."""

    is_ambiguous = True
    is_streamed = False
    speed_field = (4, 1.0)

    def clock_start(self, path: Path, first: str) -> float:
        """Midnight of the day in the name of file `path` [s since 1970], if its `first` line counts from it.

        The ATC days of LaCE-LHMP, ``MMDD.csv`` of 2012, may count from the start of the day, in Japan.
        """
        try:
            day = datetime.strptime(f"2012{path.name.split('.')[0]}", "%Y%m%d")
            since = float(first.split(self.separator)[self.columns["t"]])
        except ValueError:  # named otherwise, or the first row is damaged
            return 0.0
        return day.replace(tzinfo=ZoneInfo(_JAPAN)).timestamp() if 0 <= since < _DAY else 0.0


ATC_RAW = _AtcRaw("atc-raw", n_fields=8, columns=_COLUMNS, metres=1e-3, max_gap=0.5)
ATC_1HZ = _Atc1Hz("atc-1hz", n_fields=6, columns=_COLUMNS, max_gap=1.6)

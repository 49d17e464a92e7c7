"""The ATC mall's files: raw, about 25 rows a second and person, and 1 Hz."""

from __future__ import annotations

from .base import TrackFormat

# Central square of the mall, (lowest, highest) x and y [m] (assumed; free of pillars, walls and queues).
ATC_AREA = ((-18.5, -7.5), (-10.0, 8.0))
_COLUMNS = {"t": 0, "id": 1, "x": 2, "y": 3}

# Rows of 8 numbers: time [s], id, x, y, z [mm], speed [mm/s], two angles.
ATC_RAW = TrackFormat(
    "atc-raw", 8, _COLUMNS, metres=1e-3, max_gap=0.5, tz="Asia/Tokyo", area=ATC_AREA, is_streamed=True,
    speed_field=(5, 1e-3),
)  # fmt: skip
# Rows of 6 numbers: time [s], id, x, y [m], speed [m/s], angle.  The days of LaCE-LHMP are ``MMDD.csv``.
ATC_1HZ = TrackFormat(
    "atc-1hz", 6, _COLUMNS, max_gap=1.6, tz="Asia/Tokyo", area=ATC_AREA, is_ambiguous=True,
    speed_field=(4, 1.0), year=2012,
)  # fmt: skip

"""The error of tracks that are sampled more coarsely than the clock and interpolated linearly."""

from __future__ import annotations

import numpy as np
import pandas as pd

from szlib.tracks.clock import TICKS_PER_SECOND, clock_index, nearest_tick, to_clock


def measure_thinning_error(
    tracks: pd.DataFrame, *, every: float = 1.0
) -> tuple[float, float]:
    """RMS and 95 % quantile of the error of positions [m] where one tick in `every` seconds is used.

    Measured at 1 s: THOR-MAGNI 5.3 and 9.5 cm, the ETH sequence 5.6 and 11.6 cm (both are sampled every
    0.4 s, so their error is a little larger), the plaza 2.9 and 3.6 cm.
    """
    step = round(every * TICKS_PER_SECOND)
    order, tick, piece = clock_index(tracks)
    begin = np.searchsorted(piece, piece)
    known = pd.DataFrame({"day": "", "id": piece, "t": tick / TICKS_PER_SECOND})
    known[["x", "y"]] = tracks[["x", "y"]].to_numpy(float)[order]
    thinned = to_clock(known[(tick - tick[begin]) % step == 0], max_gap=every)
    matched = known.assign(tick=tick).merge(
        thinned.assign(tick=nearest_tick(thinned["t"].to_numpy())),
        on=["id", "tick"],
        suffixes=("", "_thin"),
    )
    error = np.hypot(
        *(
            matched[[name, f"{name}_thin"]].diff(axis=1).to_numpy()[:, 1]
            for name in "xy"
        )
    )
    return float(np.sqrt((error**2).mean())), float(np.quantile(error, 0.95))

"""Distance or time: `python -m studies.collision` writes 06_collision.csv.

How often do strangers have a distance, or a time to collision, compared with chance (Karamouzas, Skinner & Guy,
Phys. Rev. Lett. 113, 2014)?  For each speed of approach: at which value are they half as frequent as by chance?

A distance that grows with the speed looks like people who keep a time.  But who will pass at a distance of R is
never close and fast towards the other at once, so it grows for people who keep a circle as well.  The site "circle"
shows that: pairs by chance at Grand Central, without those who come nearer than `CIRCLE`.  On the site "crowd"
people ignore each other.  The real data is looked for in $SZLIB_DATA_DIR.
"""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
import pandas as pd
from sklearn.isotonic import IsotonicRegression
from studies.committed import study, write_table
from studies.noninteracting_crowd import noninteracting_crowd
from studies.respect import load

import szlib

CONTACT = 0.4
"""Distance at which two bodies touch [m] (assumed: two bodies of radius 0.2 m)."""
BANDS = ((0.5, 1.1), (1.1, 1.7), (1.7, 2.3), (2.3, 2.9))
"""Speeds of approach, and relative speeds at the nearest approach [m/s]."""
R_MAX, FAR = 6.0, (3.0, 5.0)
"""Pairs are sampled up to the first distance; where reactions are small, data and null model are made equal [m]."""
BINS = {
    "distance": np.arange(0, 4.01, 0.1),
    "time to collision": np.arange(0, 5.01, 0.2),
    "nearest approach": np.arange(0, 2.51, 0.1),
}
"""Variables and their bins [m or s]."""
SHIFTS = {"grand-central": 5, "circle": 5, "atc-1hz": 20, "crowd": 5}
"""Shifts of each site."""
CIRCLE = 0.45
"""Radius that nobody of the site "circle" enters [m]: about that of Grand Central."""
RESAMPLES, SMALLEST = 200, 5
"""Resamples of the pairs; pairs or samples by chance that a bin needs."""


def describe_motion(samples: pd.DataFrame) -> pd.DataFrame:
    """Distance [m], speed of approach, relative speed [m/s] and time to collision [s] of each of `samples`.

    The speed of approach is positive while the distance becomes smaller.  The time to collision is infinite where
    two people who keep their velocities do not touch.  As in `szlib.find_encounters`, the frame is that of the
    reference pedestrian, who walks along x.
    """
    angle, distance = (samples[c].to_numpy(float) for c in ("los_angle", "distance"))
    heading = angle + np.pi - samples["other_los_angle"].to_numpy(float)
    place = distance * np.exp(1j * angle)
    velocity = samples["other_speed"].to_numpy(float) * np.exp(1j * heading)
    velocity -= samples["speed"].to_numpy(float)
    closing = -(place * velocity.conj()).real
    squared = np.maximum(np.abs(velocity) ** 2, 1e-12)
    root = closing**2 - squared * (distance**2 - CONTACT**2)
    will_touch = (closing > 0) & (root > 0)
    time = np.where(will_touch, (closing - np.sqrt(np.abs(root))) / squared, np.inf)
    return pd.DataFrame(
        {
            "pair": pd.factorize(samples["encounter"])[0],
            "distance": distance,
            "approach": closing / np.maximum(distance, 1e-6),
            "relative": np.sqrt(squared),
            "time to collision": np.where(distance > CONTACT, time, 0.0),
        }
    )


def select(motion: pd.DataFrame, variable: str, band: tuple[float, float]) -> pd.DataFrame:
    """Pair, distance and value of a `variable`, of everybody who approaches at a speed in the `band` [m/s]."""
    speed = motion["approach"]
    if variable == "nearest approach":
        motion = motion.loc[motion.groupby("pair")["distance"].idxmin()]
        speed = motion["relative"]
    chosen = motion[speed.between(*band, inclusive="left")]
    return chosen.assign(value=chosen["distance" if variable == "nearest approach" else variable])


def count(chosen: pd.DataFrame, bins: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted samples in each of the `bins`, divided by those at a distance of `FAR`."""
    weight = weights[chosen["pair"]]
    far = weight[chosen["distance"].between(*FAR)].sum()
    counts = np.histogram(chosen["value"], bins, weights=weight)[0]
    return counts / far if far else np.full(len(counts), np.nan)


def find_half(value: np.ndarray, seen: np.ndarray, expected: np.ndarray, n: np.ndarray) -> float:
    """The `value` from which `seen` is at least half of `expected`; 0: everywhere, NaN: nowhere.

    The ratio is made to rise (isotonic regression), over the bins with at least `SMALLEST` by chance (`n`).
    """
    known = (n >= SMALLEST) & (expected > 0) & np.isfinite(expected) & np.isfinite(seen)
    if not known.any():
        return np.nan
    x, ratio = value[known], seen[known] / expected[known]
    rising = IsotonicRegression().fit_transform(x, ratio, sample_weight=expected[known])
    if rising[-1] < 0.5:
        return np.nan
    above = int(np.argmax(rising >= 0.5))
    around = slice(above - 1, above + 1)
    return float(np.interp(0.5, rising[around], x[around])) if above else 0.0


def compare(sides: list[pd.DataFrame], variable: str, band: tuple[float, float]) -> dict[str, object]:
    """A row: where people are half as frequent as by chance, with an interval.

    Parameters
    ----------
    sides : the motion of the data, and of the null model, as of `describe_motion`.
    variable : a key of `BINS`.
    band : of speeds [m/s].
    """
    rng, bins = np.random.default_rng(0), BINS[variable]
    middle = (bins[:-1] + bins[1:]) / 2
    chosen = [select(side, variable, band) for side in sides]
    sizes = [int(side["pair"].max()) + 1 for side in sides]
    n = np.histogram(chosen[1]["value"], bins)[0]
    found = []
    for k in range(1 + RESAMPLES):
        drawn = [rng.multinomial(m, np.full(m, 1 / m)) if k else np.ones(m) for m in sizes]
        counts = [count(*each) for each in zip(chosen, (bins, bins), drawn, strict=True)]
        found.append(find_half(middle, *counts, n))
    low, high = np.quantile(found[1:], [0.025, 0.975])  # NaN where one of them is
    return {
        "variable": variable,
        "slowest": band[0],
        "fastest": band[1],
        "pairs": chosen[0]["pair"].nunique(),
        "half": found[0],
        "half_low": low,
        "half_high": high,
    }


def load_sides(site: str) -> list[pd.DataFrame]:
    """The motion of all pairs of a `site`, and of its null model."""
    if site == "crowd":
        tracks, area = noninteracting_crowd(seed=0, people=1500, minutes=30), szlib.ATC_SQUARE
    else:
        tracks, area, _ = load("grand-central" if site == "circle" else site)
    options = {"area": area, "r_max": R_MAX}
    move = partial(szlib.null_pairs, tracks, shifts=SHIFTS[site], progress=False, **options)
    pairs = keep_out(move(seed=1).samples) if site == "circle" else szlib.find_pairs(tracks, **options)
    return [describe_motion(each) for each in (pairs, move(seed=0).samples)]


def of_site(site: str) -> pd.DataFrame:
    """The table of one site."""
    sides = load_sides(site)
    return pd.DataFrame({"site": site} | compare(sides, *row) for row in product(BINS, BANDS))


def keep_out(pairs: pd.DataFrame) -> pd.DataFrame:
    """The samples of the `pairs` who do not come nearer than `CIRCLE`."""
    nearest = pairs.groupby("encounter")["distance"].transform("min")
    return pairs[nearest >= CIRCLE]


@study("06_collision", notebook="06")
def recompute(row: pd.Series) -> dict[str, object]:
    """A row of the crowd, again."""
    return compare(load_sides("crowd"), row["variable"], (row["slowest"], row["fastest"]))


if __name__ == "__main__":
    write_table(pd.concat([of_site(site) for site in SHIFTS]), "06_collision")

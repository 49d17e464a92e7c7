"""A quantity of the zones of several sites, pooled: its mean, and what to expect at a new site.

Site i has the value theta_i ~ N(mu, tau^2), and its estimate y_i ~ N(theta_i, s_i^2) with s_i from the 95 %
interval. Positive quantities are pooled as logarithms. tau is the one with which the weighted squares sum to
their expectation k - 1 (Paule & Mandel, J. Res. Natl. Bur. Stand. 87, 1982). The interval of the mean has the
weighted scatter of the sites and t of k - 1 degrees (Hartung & Knapp, Stat. Med. 20, 2001; Sidik & Jonkman,
Stat. Med. 21, 2002). That of a new site is mean -+ t sqrt(tau^2 + se^2), with t of k - 2 degrees (Higgins,
Thompson & Spiegelhalter, J. R. Stat. Soc. A 172, 2009): with k - 1, as others recommend, it held fewer.

The interval of the mean held the truth in 93 to 96 % of 20,000 simulated pools each of 3 to 12 sites. That of
a new site held it in 91 to 98 % where the sites differ by twice the errors of their estimates or more, in 86
to 98 % where they differ by as much, and in 83 to 99 % by half as much: then tau is often estimated as 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from scipy.stats import norm, t

from szlib.core.errors import ZoneError
from szlib.zones.social_zone import SocialZone

POSITIVE = ("radius", "a", "b", "area")  # pooled as logarithms
UNITS = dict.fromkeys([*POSITIVE, "center_x", "center_y"], "m") | {"area": "m2"}
MIN_SITES = 3  # sites that an interval for a new one needs


@dataclass(frozen=True, eq=False)
class Pooled:
    """Result of `pool`.

    Attributes
    ----------
    quantity : what is pooled.
    table : one row a site: site, value, low, high (its 95 % interval), weight (their sum is 1).
    n_sites : number of sites.
    tau : standard deviation between sites; of the natural logarithm for a positive quantity.
    mean, low, high : mean of all sites, and its 95 % interval.
    new_low, new_high : 95 % prediction interval of a new site; NaN with fewer than three sites.

    Examples
    --------
    >>> from studies.pooling import pool
    >>> print(pool({"hall": (0.9, 0.8, 1.0), "mall": (1.2, 1.0, 1.4)}).table.round(2))
       site  value  low  high  weight
    0  hall    0.9  0.8   1.0    0.52
    1  mall    1.2  1.0   1.4    0.48
    """

    quantity: str
    table: pd.DataFrame
    n_sites: int
    tau: float
    mean: float
    low: float
    high: float
    new_low: float
    new_high: float

    def __str__(self) -> str:
        unit, spread = UNITS[self.quantity], f"{self.tau:.2f}"
        spread += " of the logarithm" if self.quantity in POSITIVE else f" {unit}"
        new = f"no interval of a new site, which needs {MIN_SITES} sites"
        if self.n_sites >= MIN_SITES:
            new = f"a new site {self.new_low:.2f} to {self.new_high:.2f} {unit} (95 % prediction interval)"
        return (
            f"{self.quantity} over {self.n_sites} sites: mean {self.mean:.2f} {unit} (its 95 % interval "
            f"{self.low:.2f} to {self.high:.2f}); {new}; standard deviation between sites {spread}"
        )


def pool(sites: Mapping[str, Any], *, quantity: str = "radius", speed: float = 1.1) -> Pooled:
    """Pool a quantity of several sites by a random-effects model.

    Parameters
    ----------
    sites : for each name a `szlib.SocialZone` with intervals, or a triple: value, and low and high end of its
        95 % interval, as asymmetric as it may be: its width counts.
    quantity : "radius" (of the circle with the zone's area), "a", "b", "center_x", "center_y" [m], or "area"
        [m2]. Radius, a, b and area are positive, and pooled as logarithms.
    speed : walking speed of the zones [m/s]; it must have been fitted.

    Returns
    -------
    A `Pooled`.

    Raises
    ------
    ZoneError : there are fewer than two sites, the quantity is unknown, or a site has no interval around its
        value. The message names the site and its values.

    Examples
    --------
    >>> from studies.pooling import pool
    >>> pooled = pool({"hall": (0.9, 0.8, 1.0), "mall": (1.2, 1.0, 1.4), "lab": (0.6, 0.5, 0.7)})
    >>> pooled.n_sites, round(pooled.mean, 2), round(pooled.low, 2), round(pooled.high, 2)
    (3, 0.87, 0.37, 2.05)
    """
    if quantity not in UNITS:
        raise ZoneError(f"quantity {quantity!r} cannot be pooled; expected one of {', '.join(UNITS)}")
    if not isinstance(sites, Mapping) or len(sites) < 2:
        raise ZoneError(f"expected two or more sites by name; got {sites!r:.80}; add sites")
    rows = [(name, *_read_site(name, site, quantity, speed)) for name, site in sites.items()]
    table = pd.DataFrame(rows, columns=["site", "value", "low", "high"])
    numbers = table[["value", "low", "high"]].to_numpy()
    y, low, high = (np.log(numbers) if quantity in POSITIVE else numbers).T
    tau, k = (
        _estimate_tau(y, variances := ((high - low) / (2 * norm.ppf(0.975))) ** 2),
        len(y),
    )
    weights = 1 / (variances + tau**2)
    mean = np.average(y, weights=weights)
    error = np.sqrt(np.average((y - mean) ** 2, weights=weights) / (k - 1))
    # t of 0 degrees is NaN
    reach, new = t.ppf(0.975, [k - 1, k - 2]) * [error, np.hypot(tau, error)]
    ends = np.array([mean, mean - reach, mean + reach, mean - new, mean + new])
    found = map(float, np.exp(ends) if quantity in POSITIVE else ends)
    return Pooled(quantity, table.assign(weight=weights / weights.sum()), k, tau, *found)


def _read_site(name: str, site: Any, quantity: str, speed: float) -> tuple[float, float, float]:
    """Value and interval of a quantity of a `site`."""
    what, values = f"site {name!r}: ", site
    if isinstance(site, SocialZone):
        what += f"{quantity} at {speed:g} m/s: "
        if speed not in site.ellipses:
            raise ZoneError(f"{what}the zone was fitted at {list(site.ellipses)} m/s; choose one of these")
        column = "area" if quantity == "radius" else quantity
        row = site.table().set_index("speed").loc[speed, [column, f"{column}_low", f"{column}_high"]]
        values = row.to_numpy(float)
        if np.isnan(values).any():
            raise ZoneError(f"{what}the zone has no interval; fit it with n_resamples=200, or to more data")
        if quantity == "radius":
            values = np.sign(values) * np.sqrt(np.abs(values) / np.pi)
    try:
        value, low, high = map(float, values)
    except (TypeError, ValueError) as error:
        raise ZoneError(f"{what}expected a SocialZone, or value, low, high; got {site!r:.80}") from error
    numbers, lowest = ("numbers > 0", 0.0) if quantity in POSITIVE else ("numbers", -np.inf)
    if not (lowest < low <= value <= high < np.inf and low < high):
        got = f"got {value:g}, {low:g}, {high:g}; leave the site out"
        raise ZoneError(f"{what}expected {numbers}, low < high, and the value between them; {got}")
    return value, low, high


def _estimate_tau(y: np.ndarray, variances: np.ndarray) -> float:
    """The standard deviation between sites by Paule and Mandel; 0 if the sites differ less than by chance."""

    def excess(squared: float) -> float:
        """Weighted squares above their expectation, if `squared` is the variance between sites."""
        weights = 1 / (variances + squared)
        return float(weights @ (y - np.average(y, weights=weights)) ** 2) - (len(y) - 1)

    return float(np.sqrt(brentq(excess, 0.0, len(y) * np.ptp(y) ** 2))) if excess(0.0) > 0 else 0.0

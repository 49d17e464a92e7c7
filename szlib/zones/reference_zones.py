"""Zones of real people, for a robot developer who has no tracks: `reference_zone`.

They were learned from recordings that cannot be shipped (see their source). `reference_zones.json` beside
this module holds them; ``python -m studies.reference_zones`` in the folder notebooks makes it anew.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from ..core.checks import require
from ..core.errors import ZoneError
from .ellipses import Ellipse
from .verdict import Verdict

FILE = Path(__file__).with_name("reference_zones.json")


@dataclass(frozen=True)
class ReferenceZone:
    """A zone that was learned elsewhere, for people at about 1.1 m/s.

    Attributes
    ----------
    name : as for `reference_zone`.
    ellipse : the zone, in the frame of the person [m].
    intervals : 95 % interval of the true value of radius, a, b and center_x [m], where there is one.
    n_encounters : number of encounters that it rests on; 0: not learned from tracks.
    method : the estimator, as of `szlib.SocialZone.fit`, or what else it rests on.
    verdict : as from `SocialZone.verdict`, with its reasons.
    source, cite : where the data is from, and what to cite.

    Examples
    --------
    >>> import szlib
    >>> zone = szlib.reference_zone("grand-central-strangers")
    >>> 0.3 < zone.ellipse.semi_axes[1] < 0.8
    True
    """

    name: str
    ellipse: Ellipse
    intervals: dict[str, list[float]]
    n_encounters: int
    method: str
    verdict: Verdict
    source: str
    cite: str


def reference_zone(name: str) -> ReferenceZone:
    """Get a zone that was learned from real people elsewhere.

    Parameters
    ----------
    name : "atc-strangers" (a day of the ATC mall, Osaka: undecided, because its tracker loses people near
        each other), "grand-central-strangers" (Grand Central, New York), "atc-paper" and
        "atc-paper-strangers" (that ATC day by the paper's method, all and strangers), or "hall" (a circle:
        Hall's personal distance).

    Raises
    ------
    ZoneError : there is no zone of this name.

    Examples
    --------
    >>> import szlib
    >>> hall = szlib.reference_zone("hall")
    >>> hall.ellipse.semi_axes, str(hall.verdict)
    ((1.2, 1.2), 'undecided')
    """
    zones = json.loads(FILE.read_bytes())
    require(name in zones, "name", name, f"one of {', '.join(zones)}", ZoneError)
    entry = zones[name]
    verdict = Verdict(entry["verdict"], entry.pop("reasons"))
    ellipse = Ellipse(**entry["ellipse"])
    entry |= {"ellipse": ellipse, "verdict": verdict}
    return ReferenceZone(name, **entry)

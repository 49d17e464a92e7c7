"""The zones that szlib ships, from the real data: szlib/zones/reference_zones.json.

python -m studies.reference_zones

The data is looked for in $SZLIB_DATA_DIR (atc-1hz/ and gc/).
"""

from __future__ import annotations

import argparse
import json
import warnings
from typing import Any

import numpy as np
from studies.committed import NULL_MODELS, read_arguments
from studies.respect import data_and_null, load

import szlib
from szlib.core.files import write_file
from szlib.zones.reference_zones import FILE

SPEED = 1.1
PAPERS = 16_181
"""Encounters of the paper (sec. 2)."""
SOURCES = {
    "atc-strangers": (
        "atc-1hz",
        "a day (2012-10-24) of the ATC mall in Osaka at 1 Hz, strangers",
        "D. Brscic, T. Kanda, T. Ikeda, T. Miyashita: Person tracking in large public spaces using 3-D range "
        "sensors. IEEE Trans. Human-Machine Systems 43(6), 2013",
    ),
    "grand-central-strangers": (
        "grand-central",
        "a video of the hall of Grand Central Station in New York, strangers",
        "S. Yi, H. Li, X. Wang: Understanding pedestrian behaviors from stationary crowd groups. CVPR 2015",
    ),
}


def main() -> None:
    asked = read_arguments(__doc__, jobs=1, cache=NULL_MODELS)
    zones = {name: fit(site) for name, (site, _, _) in SOURCES.items()}
    entries = {name: describe(name, zone) for name, zone in zones.items()}
    entries["atc-paper"] = describe_paper(asked, None)
    entries["atc-paper-strangers"] = describe_paper(asked, "strangers")
    entries["hall"] = {
        "ellipse": {"center": [0.0, 0.0], "semi_axes": [1.2, 1.2], "angle": 0.0},
        "intervals": {},
        "n_encounters": 0,
        "method": "far end of the personal distance",
        "verdict": "undecided",
        "reasons": ["it was not estimated from tracks"],
        "source": "observations of middle-class adults in the north-east of the United States",
        "cite": "E. T. Hall: The hidden dimension. Doubleday, 1966",
    }
    write_file(FILE, json.dumps(entries, indent=1) + "\n")
    print(FILE.read_text(encoding="utf-8"))


def fit(site: str) -> szlib.SocialZone:
    """The zone of every pair of people of a site who come towards each other or cross."""
    tracks, area, _ = load(site)
    with warnings.catch_warnings(action="ignore", category=szlib.DataWarning):  # the verdict says it
        return szlib.SocialZone.from_tracks(tracks, area=area, speeds=(0.9, SPEED, 1.3), progress=False)


def describe(name: str, zone: szlib.SocialZone) -> dict[str, Any]:
    """The entry of a fitted zone: its ellipse, or the circle of respect where too few encounters give no ellipse."""
    verdict, respect = zone.verdict(SPEED), zone.null_test.respect
    if zone.method == "respect":
        ellipse, method = zone.ellipses[SPEED], "respect"
        row = zone.table().set_index("speed").loc[SPEED]
        ends = {key: [row[f"{key}_low"], row[f"{key}_high"]] for key in ("a", "b", "center_x", "area")}
        ends["radius"] = [np.sqrt(end / np.pi) for end in ends.pop("area")]
    else:
        ellipse = szlib.Ellipse((0.0, 0.0), (respect.radius, respect.radius))
        method, ends = "radius of respect, all directions pooled", {"radius": [respect.low, respect.high]}
    _, source, cite = SOURCES[name]
    return {
        "ellipse": round_ellipse(ellipse),
        "intervals": {key: [round(float(end), 3) for end in pair] for key, pair in sorted(ends.items())},
        "n_encounters": int(zone.provenance["encounters"]),
        "method": method,
        "verdict": str(verdict),
        "reasons": list(verdict.reasons),
        "source": source,
        "cite": cite,
    }


def describe_paper(asked: argparse.Namespace, kind: str | None) -> dict[str, Any]:
    """The entry of the zone of the ATC day by the paper's chain, of everybody or of people of a `kind`."""
    site, source, cite = SOURCES["atc-strangers"]
    samples, _ = data_and_null(site, asked)
    people = szlib.of_kind(samples, kind) if kind else samples
    with warnings.catch_warnings(action="ignore", category=szlib.DataWarning):
        zone = szlib.SocialZone.fit(people, method="paper", speeds=(SPEED,), n_resamples=0)
    n = int(zone.provenance["encounters"])
    return {
        "ellipse": round_ellipse(zone.ellipse(SPEED)),
        "intervals": {},
        "n_encounters": n,
        "method": "paper",
        "verdict": "undecided",
        "reasons": [
            f"the zone of a hull shrinks as encounters are added: the paper has {PAPERS / n:.0f} times as many"
        ],
        "source": source if kind else source.replace("strangers", "everybody"),
        "cite": cite,
    }


def round_ellipse(ellipse: szlib.Ellipse) -> dict[str, Any]:
    """The numbers of an `ellipse`, to 1 mm."""
    return {
        "center": [round(value, 3) for value in ellipse.center],
        "semi_axes": [round(value, 3) for value in ellipse.semi_axes],
        "angle": round(ellipse.angle, 3),
    }


if __name__ == "__main__":
    main()

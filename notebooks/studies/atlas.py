"""The sensitivity atlas: the paper's scenarios over gamma, width, the person's pace and the zone's size.

    python -m studies.atlas    27_atlas.csv

A row for each run, as in `szlib.simulation.atlas.chart`, with its zone `REFERENCE`; 1,384 runs,
four minutes on one core.  Notebook 27 drives a part of it anew and holds it against the table.
"""

from __future__ import annotations

from itertools import product

from studies.committed import write_table

from szlib.simulation.atlas import REFERENCE, AtlasCell, run_atlas

PACES, SIZES = (0.3, 0.5, 0.8), (0.5, 0.75, 1.0, 1.25)
CELLS = [
    AtlasCell("corridor", *rest)
    for rest in product(
        (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2), (3.0, 3.4, 3.8, 4.2, 4.6, 5.4, 6.4), (*PACES, 1.1), SIZES
    )
] + [
    AtlasCell(*rest)
    for rest in product(
        ("waiting", "making_room"),
        (0.03, 0.05, 0.07, 0.1, 0.2),
        (1.4, 1.7, 2.0, 2.5, 3.0),
        PACES,
        SIZES,
    )
]

if __name__ == "__main__":
    write_table(run_atlas(CELLS, REFERENCE, n_jobs=1), "27_atlas")

"""The colours that all figures share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

BLUE, ORANGE, GREEN, RED, GREY, BLACK = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#999999",
    "#000000",
)

SEQUENCE = "viridis"


def pick_colours(values: Sequence[Any]) -> list[Any]:
    """Return one colour for each of the `values`, from dark to light, without the palest.

    Examples
    --------
    >>> from szlib.workbook import figures
    >>> len(figures.pick_colours([0.7, 1.1, 1.5]))
    3
    """
    return list(plt.get_cmap(SEQUENCE)(np.linspace(0, 0.85, len(values))))

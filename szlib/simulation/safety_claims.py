"""Steps that said they were safe and led to h < 0: which they were, and what people did meanwhile.

A step promises h >= 0 at the next state to people who keep the velocity and the heading with which they were
given (`szlib.control.step.Step.safe`).  Nobody can promise more of people who decide for themselves.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from ..checks import Array
from ..control.barriers import barrier, ellipse_distance
from ..control.problem import TOLERANCE

if TYPE_CHECKING:
    from .log import SimulationLog

SAME = 1e-6
"""Who is no farther than this from where their velocity leads has kept it [m], and so their heading [rad]."""
MOTION_CHANGES = (
    "came",
    "turned",
    "slowed down",
    "sped up",
    "faced elsewhere",
    "kept their velocity",
    "wall",
)
"""What people did: `safety_violations` says what each is."""


def safety_violations(log: SimulationLog) -> pd.DataFrame:
    """A row for each step that said it was safe, and each person or wall with h < 0 one step later.

    Returns
    -------
    Columns:

    t : time of the state with h < 0 [s].
    person : index; people before walls.
    h : then [m].
    h_promised : if the person had kept their velocity and heading [m]; NaN for who was not there before.
    off : how far they are from where they would be then [m].
    did : "came", they were not there before; "turned", "slowed down", "sped up", whichever changed their
        velocity most; "faced elsewhere", their zone turned and they did not; "kept their velocity"; "wall".
    explained : the promise was kept to them as they were given, h_promised >= 0, or there was none.
    """
    columns = ["t", "person", "h", "h_promised", "off", "did", "explained"]
    return pd.DataFrame(_rows(log), columns=columns)


def _rows(log: SimulationLog) -> Iterator[tuple[Any, ...]]:
    worst, n = log.h[1:], len(log.zones)
    for k, i in np.argwhere(log.safe[:-1, None] & (worst < -TOLERANCE)).tolist():
        t, h = float(log.time[k + 1]), float(worst[k, i])
        if i >= n:
            yield t, i, h, h, 0.0, "wall", False
            continue
        before, after = log.people[k, i], log.people[k + 1, i]
        if np.isnan(before).any():
            yield t, i, h, np.nan, np.nan, "came", True
            continue
        there = before[:2] + log.settings.dt * before[3:]
        zone = log.zones[i].placed((float(there[0]), float(there[1])), float(before[2]))
        distance = ellipse_distance(log.states[k + 1, :2], zone)
        promised = float(barrier(distance, log.settings.r_robot, log.settings.eps))
        off = float(np.hypot(*(after[:2] - there)))
        yield t, i, h, promised, off, _did(before, after, off, log.settings.dt), promised >= -TOLERANCE


def _did(before: Array, after: Array, off: float, dt: float) -> str:
    """What a person did between two states (x, y, heading, vx, vy), off by so much [m]."""
    if off <= SAME:
        turned = abs((after[2] - before[2] + np.pi) % (2 * np.pi) - np.pi)
        return "kept their velocity" if turned <= SAME else "faced elsewhere"
    given, walked = before[3:], (after[:2] - before[:2]) / dt
    pace, faster = np.hypot(*given), np.hypot(*walked) - np.hypot(*given)
    if np.hypot(*(walked - given)) > np.sqrt(2) * abs(faster) and pace > 0:
        return "turned"
    return "sped up" if faster > 0 else "slowed down"

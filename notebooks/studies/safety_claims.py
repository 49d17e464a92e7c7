"""Safety claims that fail: steps that are reported as safe and lead to h < 0, and what people do meanwhile.

A safe step claims h >= 0 at the next state, for people who keep the velocity and the heading that the
controller is given (`szlib.Step.safe`).  It claims nothing for people who change them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from szlib.control.obstacles import barrier, ellipse_distance
from szlib.control.settings import TOLERANCE
from szlib.core.checks import Array
from szlib.encounters.geometry import wrap_angle
from szlib.simulation.robot_run import Run

# A person within this distance of the expected position keeps their velocity [m]; the same for the heading
# [rad].
SAME_MOTION = 1e-6
MOTION_CHANGES = (
    "appeared", "turned", "slowed down", "sped up", "faced elsewhere", "kept their velocity", "wall",
)  # fmt: skip
"""What people do during a step; see `safety_violations`."""


def safety_violations(run: Run) -> pd.DataFrame:
    """Violations after safe steps of a `run`: one row for each such step and each person or wall with h < 0.

    Returns
    -------
    t : time of the state with h < 0 [s].
    person : place of the person or obstacle in `Run.h`.
    h : h at that state [m].
    h_claimed : h if the person keeps their velocity and heading [m]; NaN for a person who was absent.
    deviation : distance of the person from the position at constant velocity [m].
    change : "appeared": the person was absent before. "turned", "slowed down", "sped up": the greatest change of
        their velocity. "faced elsewhere": only the zone turned. "kept their velocity"; "wall".
    explained : True if the claim holds for the person as the controller was given them (h_claimed >= 0), or
        if there was no claim.
    """
    rows: list[tuple[Any, ...]] = []
    h_next, n, dt = run.h[1:], len(run.zones), run.settings.dt
    for k, i in np.argwhere(run.safe[:-1, None] & (h_next < -TOLERANCE)).tolist():
        t, h = float(run.time[k + 1]), float(h_next[k, i])
        if i >= n:
            rows.append((t, i, h, h, 0.0, "wall", False))
            continue
        before, after = run.people[k, i], run.people[k + 1, i]
        if np.isnan(before).any():
            rows.append((t, i, h, np.nan, np.nan, "appeared", True))
            continue
        expected = before[:2] + dt * before[3:]
        zone = run.zones[i].placed((float(expected[0]), float(expected[1])), float(before[2]))
        distance = float(ellipse_distance(run.states[k + 1, :2], zone))
        h_claimed = barrier(distance, run.settings.r_robot, run.settings.eps)
        deviation = float(np.hypot(*(after[:2] - expected)))
        change = _classify_change(before, after, deviation, dt)
        rows.append((t, i, h, h_claimed, deviation, change, h_claimed >= -TOLERANCE))
    columns = ["t", "person", "h", "h_claimed", "deviation", "change", "explained"]
    return pd.DataFrame(rows, columns=columns)


def _classify_change(before: Array, after: Array, deviation: float, dt: float) -> str:
    """What a person does between two states (x, y, heading, vx, vy), `deviation` [m] from the expected."""
    if deviation <= SAME_MOTION:
        angle = abs(wrap_angle(after[2] - before[2]))
        return "kept their velocity" if angle <= SAME_MOTION else "faced elsewhere"
    velocity, new_velocity = before[3:], (after[:2] - before[:2]) / dt
    speed, increase = np.hypot(*velocity), np.hypot(*new_velocity) - np.hypot(*velocity)
    if np.hypot(*(new_velocity - velocity)) > np.sqrt(2) * abs(increase) and speed > 0:
        return "turned"
    return "sped up" if increase > 0 else "slowed down"

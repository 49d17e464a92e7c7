"""Why the controller chose an acceleration: one sentence, and the limits that it names."""

from __future__ import annotations

from math import dist, hypot, inf
from typing import NamedTuple

import numpy as np
import shapely

import szlib
from szlib.control.obstacles import Priority
from szlib.simulation.scenario import GOAL_RADIUS, STOPPED_SPEED

from .admissible_controls import AdmissibleControls, BarrierLimit, find_admissible_controls

_AT_LIMIT = 0.02  # a limit as near to the chosen acceleration as this share of the bound is active (assumed)
_SLIGHT = 0.05  # below this share of the bound an acceleration, or of v_max a speed, is not named (assumed)
_MOST_NAMED = 2  # persons and walls in one sentence
_OF_WAYS = "way: ", "not: "  # beginnings of the lines of `Step.explain` on ways


class Explanation(NamedTuple):
    """Why the controller chose an acceleration.

    Attributes
    ----------
    sentence : what the robot does, and why.
    safety : whether the step is safe, and why it is not.
    way : the way that is taken, and those that are not; "" if none was looked for.
    notes : what else has to be known: a goal that cannot be reached, a robot that makes no progress.
    found : all admissible accelerations, with the limits of persons and walls.
    active : the limits that the sentence names.
    """

    sentence: str
    safety: str
    way: str
    notes: tuple[str, ...]
    found: AdmissibleControls
    active: tuple[BarrierLimit, ...]


def explain(step: szlib.Step) -> Explanation:
    """Explain a step of an `MPCCBF`.

    A limit is active if the chosen acceleration lies on its edge, and no other limit is exceeded at a price.
    Persons and walls are numbered as in `Step.explain`, from 0.

    Examples
    --------
    >>> import szlib
    >>> from laboratory import explain
    >>> controller = szlib.MPCCBF(szlib.Ellipse((0.1, 0.0), (1.0, 0.7)))
    >>> step = controller.step((-2.5, 0.0, 0.8, 0.0), (4.0, 0.0), [szlib.Person((0.0, 0.0), heading=0.0)])
    >>> explain(step).sentence.partition(":")[0]
    'It brakes and turns right'
    """
    first, *rest = (line.strip() for line in step.explain().splitlines())
    meaning, _, danger = first.removeprefix("Step: ").partition("; ")
    way = " ".join(_as_sentence(line) for line in rest if line.startswith(_OF_WAYS))
    is_shown = ("control", "nearest", *_OF_WAYS)
    notes = tuple(_as_sentence(line) for line in rest if not line.startswith(is_shown))
    found = find_admissible_controls(step)
    price = _describe_price(step, found)
    active = _find_active(step, found) if step.feasible and not price else ()
    if not step.feasible:
        reason = f"no plan keeps every limit, so the plan is {meaning}"
    elif price:
        reason = price
    elif active:
        reason = _describe_limits(step, active)
    else:
        reason = _describe_freedom(step)
    safety = _as_sentence(danger) if danger != "safe" else "Safe, if people keep their velocity."
    return Explanation(f"It {_describe_motion(step)}: {reason}.", safety, way, notes, found, active)


def _as_sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _find_active(step: szlib.Step, found: AdmissibleControls) -> tuple[BarrierLimit, ...]:
    """The nearest limit of each person and wall on whose edge the control lies, at most `_MOST_NAMED`,
    persons first."""
    control, nearest = shapely.Point(step.control), dict[int, BarrierLimit]()
    distances = [(shapely.LineString(limit.curve).distance(control), limit) for limit in found.limits]
    for distance, limit in sorted(distances, key=lambda each: each[0]):
        if distance <= _AT_LIMIT * step.scene.settings.a_max:
            nearest.setdefault(limit.row, limit)
    return tuple(sorted(list(nearest.values())[:_MOST_NAMED], key=lambda limit: limit.row))


def _describe_price(step: szlib.Step, found: AdmissibleControls) -> str:
    """The limits beyond which the control lies, because the plan pays their price; "" if there are none."""
    s, control, beyond = step.scene.settings, shapely.Point(step.control), dict[Priority, dict[str, None]]()
    for limit in found.limits if s.decay_price < inf else ():
        off = shapely.LineString(limit.curve).distance(control)
        if off > _AT_LIMIT * s.a_max and limit.forbidden.covers(control):
            beyond.setdefault(limit.priority, {})[name_limit(step, limit)] = None
    texts = {
        Priority.DECAY: "it comes nearer to {} than gamma allows, at a price",
        Priority.ZONE: "its plan leads through the zone of {}, at a price",
    }
    for priority, text in texts.items():
        if priority in beyond:
            return text.format(" and ".join([*beyond[priority]][:_MOST_NAMED]))
    return ""


def name_limit(step: szlib.Step, limit: BarrierLimit) -> str:
    """Whose `limit` it is, such as "wall 1"."""
    return step.scene.name(limit.row).partition(" (")[0]


def _describe_motion(step: szlib.Step) -> str:
    """What the robot does, as a verb."""
    s, (x, y, vx, vy), (ax, ay) = step.scene.settings, step.scene.state, step.control.tolist()
    speed, slight = hypot(vx, vy), _SLIGHT * s.a_max
    if speed <= _SLIGHT * s.v_max:
        return "stands still" if hypot(ax, ay) <= slight else "sets off"
    along, left = (ax * vx + ay * vy) / speed, (ay * vx - ax * vy) / speed
    gx, gy = step.scene.goal
    is_away = (gx - x) * vx + (gy - y) * vy < 0
    parts = ["goes back"] * is_away
    parts += ["brakes" if along < -slight else "speeds up" if along > slight else "keeps its speed"]
    parts += ["turns left" if left > slight else "turns right"] * (abs(left) > slight)
    return " and ".join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else parts[0]


def _describe_limits(step: szlib.Step, active: tuple[BarrierLimit, ...]) -> str:
    """The persons and walls at whose limit the control lies, and the rule that makes it a limit."""
    scene, s, texts = step.scene, step.scene.settings, list[str]()
    x, y, vx, vy = scene.state
    gaps = scene.barriers.gaps(
        np.array([x, x + s.dt * vx]), np.array([y, y + s.dt * vy]), np.array([0.0, s.dt])
    )
    closing = (gaps[:, 0] - gaps[:, 1]) / s.dt
    for limit in active:
        row = limit.row
        is_closing = float(closing[row]) >= _SLIGHT
        motion = f"comes closer at {closing[row]:.1f} m/s" if is_closing else "limits what it may do next"
        when = f", at its limit in {s.times[limit.k + 1]:.1f} s" if limit.k > 1 else ""
        texts.append(f"{name_limit(step, limit)} {motion} (h = {step.h[row]:.2f} m{when})")
    return f"{', '.join(texts)}, and h may shrink by at most {100 * s.gamma:g} % a step"


def _describe_freedom(step: szlib.Step) -> str:
    """Why the robot chose a control that lies on the limit of no person and no wall."""
    scene, s = step.scene, step.scene.settings
    x, y, *velocity = scene.state
    if dist((x, y), scene.goal) <= GOAL_RADIUS and hypot(*velocity) <= STOPPED_SPEED:
        return "it is at its goal"
    if hypot(*step.predicted[1, 2:]) >= s.v_max - _AT_LIMIT:
        return f"{s.v_max:g} m/s is its highest speed, and no person and no wall limits it"
    if max(abs(step.control)) >= s.a_max * (1 - _AT_LIMIT):
        return f"only the bound of its acceleration limits it, {s.a_max:g} m/s² along x and along y"
    if s.lookahead == inf and dist(step.target, scene.goal) > GOAL_RADIUS:
        return f"it meets a person head-on, and aims to pass on the {s.pass_side}"
    return f"no person and no wall limits it, and its goal is {dist((x, y), scene.goal):.1f} m away"

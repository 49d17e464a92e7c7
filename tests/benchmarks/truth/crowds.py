"""Crowds whose truth is known: people who ignore each other, in many manners, and people who keep a zone.

Written without szlib's likelihood: paths are drawn, moved and cut here, and only then read as a track table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from szlib.encounters.geometry import Square
from szlib.tracks.clock import to_clock

AREA = Square((-8.0, 8.0), (-8.0, 8.0))
_EDGE = 11.0  # people come and go on the sides of a square of twice this width [m]
_DT = 0.1
_SPACING = 0.7  # between people who walk abreast [m]


@dataclass
class Walk:
    """A person's path: positions (n, 2) [m] every 0.1 s from a tick on, and the unit that walks together."""

    tick: int
    path: np.ndarray
    unit: int
    id: int = field(default=-1)


def _edge_point(side: int, share: float) -> np.ndarray:
    along, out = _EDGE * (2 * share - 1), _EDGE
    return np.array([(-out, along), (along, -out), (out, along), (along, out)][side])


def _straight(start: np.ndarray, end: np.ndarray, speed: float) -> np.ndarray:
    n = max(int(np.hypot(*(end - start)) / speed / _DT), 2)
    return start + np.linspace(0, 1, n)[:, None] * (end - start)


def _unit(
    rng: np.random.Generator,
    unit: int,
    t: float,
    sides: tuple[int, int],
    size: int = 1,
    via: np.ndarray | None = None,
) -> list[Walk]:
    """People who walk abreast from side to side, by way of a point."""
    start, end = (_edge_point(side, rng.uniform(0.1, 0.9)) for side in sides)
    speed, paths = rng.uniform(0.8, 1.6), []
    legs = [start, end] if via is None else [start, via, end]
    for k in range(size):
        parts = []
        for a, b in zip(legs[:-1], legs[1:], strict=True):
            across = np.array([a[1] - b[1], b[0] - a[0]]) / np.hypot(*(b - a))
            offset = (k - (size - 1) / 2) * _SPACING * across
            parts.append(_straight(a + offset, b + offset, speed))
        paths.append(Walk(round(t / _DT), np.concatenate(parts), unit))
    return paths


def _any_sides(rng: np.random.Generator) -> tuple[int, int]:
    side = int(rng.integers(4))
    return side, int((side + rng.integers(1, 4)) % 4)


def singles(rng: np.random.Generator, people: int, seconds: float) -> list[Walk]:
    """Everybody alone, from any side to any other."""
    return [
        w
        for k in range(people)
        for w in _unit(rng, k, rng.uniform(0, seconds), _any_sides(rng))
    ]


def groups(rng: np.random.Generator, people: int, seconds: float) -> list[Walk]:
    """Seven of ten people in groups of two to four abreast."""
    walks: list[Walk] = []
    unit = 0
    while len(walks) < people:
        size = int(rng.choice([1, 2, 3, 4], p=[0.52, 0.28, 0.12, 0.08]))
        walks += _unit(rng, unit, rng.uniform(0, seconds), _any_sides(rng), size)
        unit += 1
    return walks


def one_way(rng: np.random.Generator, people: int, seconds: float) -> list[Walk]:
    """Four of five go from left to right, in groups too; the others cross."""
    walks: list[Walk] = []
    for k in range(people // 2):
        sides = (0, 2) if rng.random() < 0.8 else (1, 3)
        walks += _unit(rng, k, rng.uniform(0, seconds), sides, int(rng.integers(1, 4)))
    return walks


def counterflow(rng: np.random.Generator, people: int, seconds: float) -> list[Walk]:
    """Left to right and right to left."""
    sides = [(0, 2), (2, 0)]
    return [
        w
        for k in range(people)
        for w in _unit(rng, k, rng.uniform(0, seconds), sides[k % 2])
    ]


def bottleneck(rng: np.random.Generator, people: int, seconds: float) -> list[Walk]:
    """Everybody through a door 3 m wide in the middle."""
    walks: list[Walk] = []
    for k in range(people):
        via = np.array([rng.uniform(-0.2, 0.2), rng.uniform(-1.5, 1.5)])
        walks += _unit(rng, k, rng.uniform(0, seconds), [(0, 2), (2, 0)][k % 2], 1, via)
    return walks


def stops(rng: np.random.Generator, people: int, seconds: float) -> list[Walk]:
    """A third stands for 5 to 30 s on the way."""
    walks = singles(rng, people, seconds)
    for walk in walks[::3]:
        at = int(rng.uniform(0.3, 0.7) * len(walk.path))
        still = np.repeat(walk.path[at : at + 1], int(rng.uniform(5, 30) / _DT), axis=0)
        walk.path = np.concatenate([walk.path[:at], still, walk.path[at:]])
    return walks


def trains(rng: np.random.Generator, people: int, seconds: float) -> list[Walk]:
    """Fifteen at a time, within 20 s, from one side to one other."""
    walks: list[Walk] = []
    for k in range(people // 15):
        t, sides = rng.uniform(0, seconds), _any_sides(rng)
        for member in range(15):
            walks += _unit(rng, 15 * k + member, t + rng.uniform(0, 20), sides)
    return walks


def signals(rng: np.random.Generator, people: int, seconds: float) -> list[Walk]:
    """From two sides at once, within 8 s, every minute."""
    walks: list[Walk] = []
    for k in range(people):
        t = 60 * rng.integers(int(seconds // 60)) + rng.uniform(0, 8)
        walks += _unit(rng, k, t, [(0, 2), (2, 0)][k % 2])
    return walks


def turnstiles(rng: np.random.Generator, people: int, seconds: float) -> list[Walk]:
    """Three gates that release one person every 2 s at most; others come from the far side."""
    walks: list[Walk] = []
    t = np.zeros(3)
    for k in range(people // 2):
        gate = int(rng.integers(3))
        t[gate] += 2 + rng.exponential(max(6 * seconds / people - 2, 0.1))
        end = _edge_point(2, rng.uniform(0.1, 0.9))
        path = _straight(
            np.array([-_EDGE, 4.0 * (gate - 1)]), end, rng.uniform(0.8, 1.6)
        )
        walks.append(Walk(round(float(t[gate]) / _DT), path, k))
        walks += _unit(rng, people + k, rng.uniform(0, seconds), (2, 0))
    return walks


CROWDS: dict[str, Callable[[np.random.Generator, int, float], list[Walk]]] = {
    "singles": singles, "groups": groups, "one way": one_way, "counterflow": counterflow,
    "bottleneck": bottleneck, "stops": stops, "trains": trains, "signals": signals, "turnstiles": turnstiles,
}  # fmt: skip
"""People who ignore each other."""


def as_table(walks: list[Walk]) -> pd.DataFrame:
    """Rows id, tick, x, y; each walk is one person unless it has an id."""
    parts = []
    for k, walk in enumerate(walks):
        rows = pd.DataFrame(walk.path, columns=["x", "y"])
        parts.append(
            rows.assign(
                tick=walk.tick + np.arange(len(rows)), id=k if walk.id < 0 else walk.id
            )
        )
    return pd.concat(parts, ignore_index=True)


def near_pairs(
    rows: pd.DataFrame, reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Row numbers of two people at one tick within `reach` [m], and their distance."""
    from scipy.spatial import cKDTree

    points = np.column_stack([rows["x"], rows["y"], 10 * reach * rows["tick"]])
    one, other = cKDTree(points).query_pairs(reach, output_type="ndarray").T
    return one, other, np.hypot(*(points[one, :2] - points[other, :2]).T)


def merging(
    rows: pd.DataFrame,
    rng: np.random.Generator,
    reach: float = 0.45,
    early: float = 0.0,
) -> pd.DataFrame:
    """A tracker that loses one of two people nearer than `reach` [m], and gives a new id after that.

    The one is lost `early` [s] before, and found as long after.
    """
    one, other, _ = near_pairs(rows, reach)
    lost = np.zeros(len(rows), bool)
    lost[np.where(rng.random(len(one)) < 0.5, one, other)] = True
    lost[np.maximum(one, other)] = True  # always the same one of a pair
    if early:
        key = rows["id"].to_numpy() * 1e6 + rows["tick"].to_numpy()
        steps = round(early / _DT)
        around = key[lost][:, None] + np.arange(-steps, steps + 1)
        lost = np.isin(key, around)
    return _new_ids(
        rows.assign(gone=lost).sort_values(["id", "tick"], ignore_index=True)
    )


def _new_ids(rows: pd.DataFrame) -> pd.DataFrame:
    """Without the rows that are gone; a person who comes back has a new id."""
    gone = rows.pop("gone").to_numpy()
    piece = np.cumsum(
        np.r_[True, (np.diff(rows["id"]) != 0) | (np.diff(gone.astype(int)) != 0)]
    )
    return rows.assign(id=piece)[~gone]


def id_switches(
    rows: pd.DataFrame, rng: np.random.Generator, reach: float = 0.5
) -> pd.DataFrame:
    """A tracker that exchanges the ids of half of the pairs that come nearer than `reach` [m]."""
    one, other, distance = near_pairs(rows, reach)
    ids, ticks = rows["id"].to_numpy().copy(), rows["tick"].to_numpy()
    pairs = pd.DataFrame(
        {"a": ids[one], "b": ids[other], "tick": ticks[one], "d": distance}
    )
    nearest = pairs.sort_values("d").drop_duplicates(["a", "b"]).sort_values("tick")
    for a, b, tick, _ in nearest.itertuples(index=False):
        if rng.random() < 0.5:
            later = ticks > tick
            is_a, is_b = later & (ids == a), later & (ids == b)
            ids[is_a], ids[is_b] = b, a
    return rows.assign(id=ids)


def broken(
    rows: pd.DataFrame, rng: np.random.Generator, every: float = 4.0
) -> pd.DataFrame:
    """A tracker that loses a person for half a second, `every` so many seconds or so."""
    rows = rows.sort_values(["id", "tick"], ignore_index=True)
    starts = rng.random(len(rows)) < _DT / every
    gone = np.convolve(starts, np.ones(6), "full")[: len(rows)] > 0
    return _new_ids(rows.assign(gone=gone))


TRACKERS: dict[str, Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]] = {
    "merging": merging, "id switches": id_switches, "broken": broken,
}  # fmt: skip


def read(
    rows: pd.DataFrame,
    rng: np.random.Generator,
    *,
    rate: float = 10.0,
    noise: float = 0.0,
) -> pd.DataFrame:
    """The track table of a sensor with a rate [Hz] and an error of each position [m]."""
    rows = rows.sort_values(["id", "tick"], ignore_index=True)
    if rate < 10:
        rows = rows[rows["tick"] % round(10 / rate) == 0]
    rows = rows.assign(t=rows["tick"] * _DT, day="crowd")
    rows[["x", "y"]] += rng.normal(0, noise, (len(rows), 2)) if noise else 0.0
    return to_clock(rows[["day", "id", "t", "x", "y"]], max_gap=1.5 / min(rate, 10))


def swerving(
    walks: list[Walk],
    rng: np.random.Generator,
    radii: tuple[float, float],
    *,
    careless: float = 0.03,
) -> None:
    """Let strangers step aside, so that none enters the other's ellipse of semi-axes (along, across).

    Each of two people takes half of what is missing, within about a second, and up to some centimetres more.
    """
    ignores: dict[tuple[int, int], bool] = {}
    for _ in range(4):
        rows = as_table(walks)
        rows["unit"] = np.concatenate([np.full(len(w.path), w.unit) for w in walks])
        rows["at"] = np.concatenate([np.arange(len(w.path)) for w in walks])
        velocity = np.concatenate([np.gradient(w.path, _DT, axis=0) for w in walks])
        one, other, _ = near_pairs(rows, max(radii) + 0.5)
        unit = rows["unit"].to_numpy()
        strangers = unit[one] != unit[other]
        one, other = one[strangers], other[strangers]
        place = rows[["x", "y"]].to_numpy()
        apart = place[other] - place[one]
        level = np.minimum(
            _level(apart, velocity[one], radii), _level(-apart, velocity[other], radii)
        )
        who, at = rows["id"].to_numpy(), rows["at"].to_numpy()
        table = pd.DataFrame(
            {
                "a": who[one],
                "b": who[other],
                "i": at[one],
                "j": at[other],
                "level": level,
            }
        )
        table[["dx", "dy"]] = apart
        worst = table.sort_values("level").drop_duplicates(["a", "b"])
        for a, b, i, j, depth, dx, dy in worst.itertuples(index=False):
            if ignores.setdefault((a, b), rng.random() < careless) or depth >= 1:
                continue
            away = np.array([dx, dy])
            size = np.hypot(*away) or 1e-6
            missing = size * (1 / max(depth, 0.05) - 1) + rng.exponential(0.05)
            for k, middle, sign in ((a, i, -0.5), (b, j, 0.5)):
                path = walks[k].path
                bump = np.exp(-(((np.arange(len(path)) - middle) / 12.0) ** 2))
                path += sign * min(missing, 1.0) * bump[:, None] * away / size


def orca(walks: list[Walk], radius: float) -> None:
    """Let everybody walk to the end of the path by ORCA, as discs whose centres stay a `radius` [m] apart."""
    import pyrvo  # an extra

    near = (5.0, 10, 2.0, 2.0)  # distance [m], number of neighbours, horizons [s]
    walking: list[tuple[Walk, list[np.ndarray], np.ndarray, float]] = []
    coming = sorted(walks, key=lambda walk: walk.tick)
    for tick in range(coming[0].tick, 10**6):
        while coming and coming[0].tick == tick:
            walk = coming.pop(0)
            speed = float(np.hypot(*(walk.path[1] - walk.path[0]))) / _DT
            walking.append((walk, [walk.path[0]], np.zeros(2), speed))
        if not (coming or walking):
            return
        simulator = pyrvo.RVOSimulator(_DT, *near, radius / 2, 2.0)
        for i, (walk, path, velocity, speed) in enumerate(walking):
            ahead = walk.path[-1] - path[-1]
            wanted = speed * ahead / max(float(np.hypot(*ahead)), 1e-6)
            simulator.add_agent(
                path[-1].tolist(), *near, radius / 2, 1.3 * speed, velocity.tolist()
            )
            simulator.set_agent_pref_velocity(i, wanted.tolist())
        simulator.do_step()
        going = []
        for i, (walk, path, velocity, speed) in enumerate(walking):
            path.append(np.array(simulator.get_agent_position(i).to_tuple()))
            velocity[:] = simulator.get_agent_velocity(i).to_tuple()
            if np.hypot(*(walk.path[-1] - path[-1])) < 0.3 or len(path) > 600:
                walk.path = np.array(path)
            else:
                going.append((walk, path, velocity, speed))
        walking = going


def _level(
    apart: np.ndarray, velocity: np.ndarray, radii: tuple[float, float]
) -> np.ndarray:
    """Distance from the centre of an ellipse along the motion, in units of its edge."""
    ahead = velocity / np.maximum(np.hypot(*velocity.T), 1e-6)[:, None]
    along = (apart * ahead).sum(axis=1)
    across = apart[:, 1] * ahead[:, 0] - apart[:, 0] * ahead[:, 1]
    return np.hypot(along / radii[0], across / radii[1])

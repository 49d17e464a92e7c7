"""Wrong answers to the exercises, as students write them, and what the judge must say of each.

`WRONG[task]` is a list of (part of the message, answer). No answer uses the code of the judges.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

import szlib
from szlib.zones import outliers

from .exercises import SOLUTIONS, TASKS, cells, defined

Answer = Callable[..., Any]


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def wrap(angle):
    return np.angle(np.exp(1j * angle))


def sides(paths, people):
    """Whole turns of each way around each person, more than those of the first way, as a set of rows."""
    d = paths[:, None] - people
    steps = wrap(np.diff(np.arctan2(d[..., 1], d[..., 0])))
    turns = steps.sum(axis=-1) / (2 * np.pi)
    return {tuple(row) for row in np.rint(turns - turns[0]).astype(int).tolist()}


def bearing(ref, other):
    return np.arctan2(other[1] - ref[1], other[0] - ref[0])


def in_frame(ref, heading, others):
    """How far ahead and how far to the left [m]."""
    return (others - ref) @ unit(heading), (others - ref) @ unit(heading + np.pi / 2)


def inside(ahead, left, *, back=0.0, length=5.0, half=2.0):
    return (ahead >= back) & (ahead <= length) & (np.abs(left) <= half)


SHEET1: dict[str, list[tuple[str, Answer]]] = {
    "velocity": [
        (
            "this is a displacement [m]",
            lambda path, k, half: path[k + half] - path[k - half],
        ),
        (
            "the time step is missing",
            lambda path, k, half: (path[k + half] - path[k - half]) / (2 * half),
        ),
        (
            "this is twice the velocity",
            lambda path, k, half: (path[k + half] - path[k - half]) / half / 0.1,
        ),
        ("velocity over one tick", lambda path, k, half: (path[k + 1] - path[k]) / 0.1),
        (
            "the sign is wrong",
            lambda path, k, half: (path[k - half] - path[k + half]) / (0.2 * half),
        ),
        (
            "this looks back only",
            lambda path, k, half: (path[k] - path[k - half]) / (0.1 * half),
        ),
        (
            "this is the speed, one number",
            lambda path, k, half: (
                math.dist(path[k + half], path[k - half]) / (0.2 * half)
            ),
        ),
        (
            "shape (2,); got numbers, shape (30, 2)",
            lambda path, k, half: np.diff(path, axis=0) / 0.1,
        ),
        ("stopped with IndexError", lambda path, k, half: path[len(path) + half]),
    ],
    "line_of_sight": [
        (
            "these are degrees",
            lambda ref, heading, other: np.degrees(wrap(bearing(ref, other) - heading)),
        ),
        (
            "this is the bearing in the world",
            lambda ref, heading, other: bearing(ref, other),
        ),
        (
            "the two people are swapped",
            lambda ref, heading, other: wrap(bearing(other, ref) - heading),
        ),
        (
            "the angle is not wrapped",
            lambda ref, heading, other: bearing(ref, other) - heading,
        ),
        (
            "lies in [0, 2 pi)",
            lambda ref, heading, other: (bearing(ref, other) - heading) % (2 * np.pi),
        ),
        (
            "np.arctan2 takes y first",
            lambda ref, heading, other: wrap(np.arctan2(*(other - ref)) - heading),
        ),
        (
            "np.arctan cannot tell ahead from behind",
            lambda ref, heading, other: wrap(
                np.arctan((other - ref)[1] / (other - ref)[0]) - heading
            ),
        ),
        (
            "the sign is wrong",
            lambda ref, heading, other: wrap(heading - bearing(ref, other)),
        ),
        (
            "the heading has the wrong sign",
            lambda ref, heading, other: wrap(bearing(ref, other) + heading),
        ),
        (
            "the side is missing",
            lambda ref, heading, other: np.abs(wrap(bearing(ref, other) - heading)),
        ),
        (
            "no answer: this uses szlib",
            lambda ref, heading, other: szlib.encounters.geometry.wrap_angle(
                bearing(ref, other) - heading
            ),
        ),
    ],
    "in_space": [
        (
            "does not turn with the person",
            lambda ref, heading, o: inside(*in_frame(ref, 0.0, o)),
        ),
        (
            "turned the wrong way",
            lambda ref, heading, o: inside(*in_frame(ref, -heading, o)),
        ),
        (
            "4 m is the whole width",
            lambda ref, heading, o: inside(*in_frame(ref, heading, o), half=4),
        ),
        (
            "length and width are swapped",
            lambda r, h, o: inside(*in_frame(r, h, o), length=4, half=2.5),
        ),
        (
            "ahead of the person, not around",
            lambda r, h, o: inside(*in_frame(r, h, o), back=-2.5, length=2.5),
        ),
        (
            "people behind are counted",
            lambda r, h, o: inside(*in_frame(r, h, o), back=-np.inf),
        ),
        (
            "expected booleans, shape (40,); got numbers",
            lambda r, h, o: inside(*in_frame(r, h, o)).astype(int),
        ),
        ("got a boolean", lambda r, h, o: inside(*in_frame(r, h, o)).any()),
        ("does not depend on the arguments", lambda r, h, o: np.ones(len(o), bool)),
    ],
    "one_hertz": [
        ("use half the angle", lambda r, v, dt: r * (1 - np.cos(v * dt / r))),
        ("formula for small angles", lambda r, v, dt: (v * dt) ** 2 / (8 * r)),
        ("the interval is missing", lambda r, v, dt: r * (1 - np.cos(v / r / 2))),
        ("distance from the centre", lambda r, v, dt: r * np.cos(v * dt / r / 2)),
        ("length of the chord", lambda r, v, dt: 2 * r * np.sin(v * dt / r / 2)),
        (
            "difference of two lengths",
            lambda r, v, dt: v * dt - 2 * r * np.sin(v * dt / r / 2),
        ),
        ("the radius is missing", lambda r, v, dt: 1 - np.cos(v * dt / r / 2)),
        ("expected 0", lambda r, v, dt: math.nan),
    ],
}


def mirrored_points(angle, distance, r_max):
    return (r_max - distance)[:, None] * np.column_stack(
        [np.cos(angle), -np.sin(angle)]
    )


def polar(angle, radius):
    return np.asarray(radius)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def corner_of(cloud):
    return cloud.max(axis=0) + 1.0


SHEET2: dict[str, list[tuple[str, Answer]]] = {
    "complementary": [
        ("these are plain positions", lambda a, d, r: polar(a, d)),
        (
            "the angles are in radians already",
            lambda a, d, r: polar(np.deg2rad(a), r - d),
        ),
        (
            "cos and sin are swapped",
            lambda a, d, r: np.column_stack([np.sin(a), np.cos(a)]) * (r - d)[:, None],
        ),
        ("the sign is wrong", lambda a, d, r: polar(a, d - r)),
        ("the sign of the angle", mirrored_points),
        (
            "the shape is transposed",
            lambda a, d, r: np.array([(r - d) * np.cos(a), (r - d) * np.sin(a)]),
        ),
        ("r_max is an argument", lambda a, d, r: polar(a, 2 - d)),
        (
            "no answer: this uses szlib",
            lambda a, d, r: outliers.complementary_points(
                __import__("pandas").DataFrame({"los_angle": a, "distance": d}), r_max=r
            ),
        ),
    ],
    "nearest": [
        (
            "each encounter has its own minimum",
            lambda s: [s.distance.min()] * s.encounter.nunique(),
        ),
        ("this is one number", lambda s: s.distance.min()),
        ("these are means", lambda s: s.groupby("encounter").distance.mean()),
        (
            "these are the first samples",
            lambda s: s.drop_duplicates("encounter").sort_values("encounter").distance,
        ),
        (
            "these are the largest",
            lambda s: s.groupby("encounter").distance.max().tolist(),
        ),
        (
            "the order is that of the table",
            lambda s: [
                s.distance[s.encounter == n].min() for n in s.encounter.unique()
            ],
        ),
        (
            "the distances are sorted",
            lambda s: sorted(s.groupby("encounter").distance.min()),
        ),
        (
            "shape (4, 2)",
            lambda s: s.groupby("encounter")[["los_angle", "distance"]].min(),
        ),
    ],
    "found": [
        ("swapped", lambda r, i: ((r & i).sum() / i.sum(), (r & i).sum() / r.sum())),
        ("shares of all samples", lambda r, i: ((r & i).mean(), (r & i).mean())),
        (
            "samples that were not removed",
            lambda r, i: ((~r & i).sum() / (~r).sum(), (~r & i).sum() / i.sum()),
        ),
        (
            "people who are not intruders",
            lambda r, i: ((r & ~i).sum() / r.sum(), (r & ~i).sum() / (~i).sum()),
        ),
        ("share of correct decisions", lambda r, i: (r == i).mean()),
        ("these are counts", lambda r, i: ((r & i).sum(), (r & i).sum())),
        (
            "shares of removed samples and of intruders",
            lambda r, i: (r.mean(), i.mean()),
        ),
        ("got a str", lambda r, i: "precision"),
    ],
    "blind_spot": [
        ("an encounter has 31 samples", lambda cloud: corner_of(cloud)[None]),
        ("this is not an intruder", lambda cloud: cloud[:31] + 0.01),
        ("the same point", lambda cloud: np.tile(corner_of(cloud), (31, 1))),
        (
            "LOF removes",
            lambda cloud: corner_of(cloud) + 0.02 * np.arange(31)[:, None] ** 2,
        ),
        (
            "LOF removes",
            lambda cloud: (
                cloud.mean(axis=0) + np.geomspace(20, 900, 31)[:, None] * [1, 0]
            ),
        ),
        ("some of your samples are not finite", lambda cloud: np.full((31, 2), np.inf)),
        (
            "this is not an intruder",
            lambda cloud: (
                np.random.default_rng(0).uniform(-1, 1, (31, 2)) + cloud.mean(0)
            ),
        ),
    ],
}


def reach_of(polygon, theta):
    along = np.roll(polygon, -1, axis=0) - polygon
    normal = np.column_stack([along[:, 1], -along[:, 0]])
    facing = normal @ unit(theta)
    return ((normal * polygon).sum(axis=1)[facing > 0] / facing[facing > 0]).min()


def half_cross(triangle):
    (ax, ay), (bx, by) = triangle[1:] - triangle[0]
    return abs(ax * by - ay * bx) / 2


def side_lengths(triangle):
    return np.hypot(*(triangle - np.roll(triangle, 1, axis=0)).T)


# area of the smallest ellipse, over that of its triangle
SMALLEST = 4 * np.pi / (3 * np.sqrt(3))


def quantile_ellipse(samples, q, *, complement=False):
    """An ellipse along the axes, from the quantile q of the nearest approaches on four sides."""
    close = samples[
        (samples["distance"] <= 2.0) & (samples["speed"] - 1.1).abs().le(0.2)
    ]
    turn = np.radians([0, 90, 180, -90])
    off = wrap(close["los_angle"].to_numpy()[:, None] - turn)
    radii = []
    for side in (np.abs(off) < np.radians(15)).T:
        approach = close[side].groupby("encounter")["distance"].min()
        radii.append(float(np.quantile(approach, q)))
    ahead, left, behind, right = (2.0 - r if complement else r for r in radii)
    a, b = sorted([(ahead + behind) / 2, (left + right) / 2], reverse=True)
    center = (ahead - behind) / 2, (left - right) / 2
    return szlib.Ellipse(center, (a, b), np.pi / 2 if complement else 0.0)


def at_share(a, b, share):
    return a[:2] + share * (b[:2] - a[:2])


SHEET3: dict[str, list[tuple[str, Answer]]] = {
    "crossing": [
        ("the middle of the edge", lambda a, b, v: (a[:2] + b[:2]) / 2),
        (
            "measured from the wrong end",
            lambda a, b, v: at_share(a, b, (b[2] - v) / (b[2] - a[2])),
        ),
        (
            "the end with the nearer speed",
            lambda a, b, v: (a if abs(a[2] - v) < abs(b[2] - v) else b)[:2],
        ),
        (
            "give x' and y' only",
            lambda a, b, v: a + (v - a[2]) / (b[2] - a[2]) * (b - a),
        ),
        ("must be divided by the difference", lambda a, b, v: at_share(a, b, v - a[2])),
        ("measure from a[2]", lambda a, b, v: at_share(a, b, v / b[2])),
        ("got a number", lambda a, b, v: at_share(a, b, (v - a[2]) / (b[2] - a[2]))[0]),
    ],
    "zone_radius": [
        ("this is R'", lambda p, th, r: reach_of(p, th)),
        (
            "the distance to a corner",
            lambda p, th, r: (
                r - np.hypot(*p[np.argmax((p / np.hypot(*p.T)[:, None]) @ unit(th))])
            ),
        ),
        (
            "any direction",
            lambda p, th, r: r - min(reach_of(p, t) for t in edge_normals(p)),
        ),
        ("do not convert it", lambda p, th, r: r - reach_of(p, np.radians(th))),
        ("the opposite direction", lambda p, th, r: r - reach_of(p, th + np.pi)),
        ("the sign is wrong", lambda p, th, r: reach_of(p, th) - r),
        ("not always 2 m", lambda p, th, r: 2.0 - reach_of(p, th)),
    ],
    "triangle_ellipse": [
        (
            "the circle through the three corners",
            lambda t: np.pi * (np.prod(side_lengths(t)) / (4 * half_cross(t))) ** 2,
        ),
        ("this is the area of the triangle", half_cross),
        ("largest ellipse inside", lambda t: SMALLEST / 4 * half_cross(t)),
        (
            "the box around the triangle",
            lambda t: np.pi / 4 * np.prod(t.max(axis=0) - t.min(axis=0)),
        ),
        ("this is twice the area", lambda t: 2 * SMALLEST * half_cross(t)),
        (
            "equilateral triangle only",
            lambda t: np.pi * (side_lengths(t) ** 2).mean() / 3,
        ),
        (
            "a circle around the longest side",
            lambda t: np.pi * (side_lengths(t).max() / 2) ** 2,
        ),
        (
            "no answer: this uses szlib",
            lambda t: szlib.minimum_enclosing_ellipse(t).area,
        ),
    ],
    "my_zone": [
        ("expected a szlib.Ellipse", lambda samples, v: 1.0),
        (
            "too small; a few people walk through",
            lambda samples, v: quantile_ellipse(samples, 0.0),
        ),
        (
            "too large; most people keep farther away",
            lambda samples, v: quantile_ellipse(samples, 0.4),
        ),
        (
            "this is an ellipse around the slice",
            lambda s, v: quantile_ellipse(s, 0.05, complement=True),
        ),
        (
            "does not depend on the arguments",
            lambda s, v: szlib.Ellipse((0.05, 0), (0.95, 0.72)),
        ),
        (
            "no answer: this uses szlib",
            lambda s, v: szlib.SocialZone.fit(s).ellipse(v),
        ),
        (
            "no answer: this uses szlib",
            lambda s, v: szlib.minimum_enclosing_ellipse(
                polar(s.los_angle, s.distance)[:500]
            ),
        ),
    ],
}


def edge_normals(polygon):
    along = np.roll(polygon, -1, axis=0) - polygon
    return np.arctan2(-along[:, 0], along[:, 1])


def moved(t, person, shift):
    return t + shift[person]


SHEET4: dict[str, list[tuple[str, Answer]]] = {
    "quantile_radius": [
        ("the nearest of all", lambda d, q: min(d)),
        ("the wrong end", lambda d, q: np.sort(d)[math.ceil((1 - q) * len(d)) - 1]),
        ("between two encounters", lambda d, q: np.quantile(d, q)),
        ("one approach too many", lambda d, q: np.sort(d)[int(q * len(d))]),
        (
            "one approach too few",
            lambda d, q: np.sort(d)[max(math.floor(q * len(d)) - 1, 0)],
        ),
        ("sort them first", lambda d, q: d[math.ceil(q * len(d)) - 1]),
        ("one approach too far", lambda d, q: np.sort(d)[math.ceil(q * len(d))]),
        (
            "expected a number; got numbers",
            lambda d, q: np.sort(d)[: math.ceil(q * len(d))],
        ),
    ],
    "expected_nearest": [
        ("the error of a mean", lambda mean, n: mean / n**0.5),
        ("does not depend on n", lambda mean, n: mean),
        ("uniform distances", lambda mean, n: mean / (n + 1)),
        ("the median of the nearest", lambda mean, n: mean * math.log(2) / n),
        ("the mean was taken for a rate", lambda mean, n: 1 / (mean * n)),
        ("probabilities multiply", lambda mean, n: mean**n),
        (
            "the farthest of n people",
            lambda mean, n: mean * sum(1 / k for k in range(1, n + 1)),
        ),
        (
            "expected 0.",
            lambda mean, n: (
                np.random.default_rng(0).exponential(mean, (2000, n)).min(axis=1).mean()
            ),
        ),
    ],
    "p_value": [
        ("p could be 0", lambda obs, null: np.mean(null >= obs)),
        (">=, not >", lambda obs, null: (1 + np.sum(null > obs)) / (1 + len(null))),
        (
            "the other side",
            lambda obs, null: (1 + np.sum(null <= obs)) / (1 + len(null)),
        ),
        (
            "two-sided",
            lambda obs, null: 2 * (1 + np.sum(null >= obs)) / (1 + len(null)),
        ),
        ("this is a count", lambda obs, null: np.sum(null >= obs)),
        (
            "in the numerator as well",
            lambda obs, null: np.sum(null >= obs) / (1 + len(null)),
        ),
        (
            "in the denominator as well",
            lambda obs, null: (1 + np.sum(null >= obs)) / len(null),
        ),
        ("got a boolean", lambda obs, null: bool(np.mean(null >= obs) < 0.05)),
    ],
    "shifted": [
        ("all people are shifted by the same time", lambda t, p, s, T: (t + s[0]) % T),
        ("lie outside the recording", lambda t, p, s, T: moved(t, p, s)),
        ("the path is torn", lambda t, p, s, T: (t + np.resize(s, len(t))) % T),
        ("cut off at the ends", lambda t, p, s, T: np.clip(moved(t, p, s), 0, T)),
        ("the sign is wrong", lambda t, p, s, T: (t - s[p]) % T),
        ("negative shifts", lambda t, p, s, T: (t + abs(s[p])) % T),
        ("only one end", lambda t, p, s, T: moved(t, p, s) - T * (moved(t, p, s) > T)),
        ("stopped with ValueError", lambda t, p, s, T: (t + s) % T),
    ],
}


def sum_of_distances(points, center, c, angle):
    return sum(
        np.hypot(*(points - center - side * c * unit(angle)).T) for side in (1, -1)
    )


def focus(axes):
    return np.sqrt(axes[0] ** 2 - axes[1] ** 2)


def level(points, center, axes, angle):
    x, y = (points - center) @ unit(angle), (points - center) @ unit(angle + np.pi / 2)
    return (x / axes[0]) ** 2 + (y / axes[1]) ** 2 - 1


def g_t_length(points, a, b):
    length = math.dist(a, b)
    x, y = (points - a).T
    g = (x * (b - a)[1] - y * (b - a)[0]) / length
    return (
        g,
        ((length / 2) ** 2 - ((points - (a + b) / 2) ** 2).sum(axis=1)) / length,
        length,
    )


def wall(g, t):
    return np.sqrt(g**2 + ((np.abs(t) - t) / 2) ** 2)


def multiply_t(g, t, length):
    return g, t * length


def to_segment(points, a, b):
    share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.hypot(*(points - a - share[:, None] * (b - a)).T)


SHEET5: dict[str, list[tuple[str, Answer]]] = {
    "focal_distance": [
        (
            "the half is missing",
            lambda p, c, ab, th: sum_of_distances(p, c, focus(ab), th) - ab[0],
        ),
        (
            "not b",
            lambda p, c, ab, th: sum_of_distances(p, c, focus(ab), th) / 2 - ab[1],
        ),
        (
            "the foci are not turned",
            lambda p, c, ab, th: sum_of_distances(p, c, focus(ab), 0) / 2 - ab[0],
        ),
        (
            "turned the wrong way",
            lambda p, c, ab, th: sum_of_distances(p, c, focus(ab), -th) / 2 - ab[0],
        ),
        (
            "along the longer axis, not across",
            lambda p, c, ab, th: (
                sum_of_distances(p, c, focus(ab), th + np.pi / 2) / 2 - ab[0]
            ),
        ),
        ("the level of the ellipse", level),
        (
            "the distance to the centre",
            lambda p, c, ab, th: np.hypot(*(p - c).T) - ab[0],
        ),
        (
            "too far out",
            lambda p, c, ab, th: sum_of_distances(p, c, np.hypot(*ab), th) / 2 - ab[0],
        ),
        (
            "not at a - b",
            lambda p, c, ab, th: sum_of_distances(p, c, ab[0] - ab[1], th) / 2 - ab[0],
        ),
        (
            "no answer: this uses szlib",
            lambda p, c, ab, th: szlib.ellipse_distance(p, szlib.Ellipse(c, ab, th)),
        ),
    ],
    "wall_distance": [
        ("the distance to the whole line", lambda p, a, b: abs(g_t_length(p, a, b)[0])),
        ("this is g", lambda p, a, b: g_t_length(p, a, b)[0]),
        (
            "the sign in the trimming term",
            lambda p, a, b: wall(g_t_length(p, a, b)[0], -g_t_length(p, a, b)[1]),
        ),
        (
            "the half is missing",
            lambda p, a, b: wall(g_t_length(p, a, b)[0], 2 * g_t_length(p, a, b)[1]),
        ),
        (
            "divided by the length",
            lambda p, a, b: wall(*multiply_t(*g_t_length(p, a, b))),
        ),
        ("the Euclidean distance", to_segment),
        ("the squared distance", lambda p, a, b: wall(*g_t_length(p, a, b)[:2]) ** 2),
        ("the middle of the wall", lambda p, a, b: np.hypot(*(p - (a + b) / 2).T)),
        (
            "no answer: this uses szlib",
            lambda p, a, b: szlib.segment_distance(p, a, b),
        ),
    ],
    "barrier_row": [
        ("the size of the robot is missing", lambda d, e, g, r, eps: e - (1 - g) * d),
        (
            "the margin eps is missing",
            lambda d, e, g, r, eps: (e - r) - (1 - g) * (d - r),
        ),
        (
            "the margin has the wrong sign",
            lambda d, e, g, r, eps: (e - r + eps) - (1 - g) * (d - r + eps),
        ),
        (
            "gamma and 1 - gamma are swapped",
            lambda d, e, g, r, eps: (e - r - eps) - g * (d - r - eps),
        ),
        (
            "the sign is wrong",
            lambda d, e, g, r, eps: (1 - g) * (d - r - eps) - (e - r - eps),
        ),
        (
            "gamma has the wrong sign",
            lambda d, e, g, r, eps: (e - d) - g * (d - r - eps),
        ),
        ("only requires that the next h", lambda d, e, g, r, eps: e - r - eps),
        ("this is a comparison", lambda d, e, g, r, eps: e - d >= -g * (d - r - eps)),
        (
            "this is a comparison",
            lambda d, e, g, r, eps: np.bool_(e - d >= -g * (d - r - eps)),
        ),
        ("this is the change of d", lambda d, e, g, r, eps: e - d),
    ],
    "end_margin": [
        ("this is the distance d", lambda r, length: r + r**2 / length),
        ("has no unit", lambda r, length: r / length),
        ("half the margin", lambda r, length: r**2 / length / 2),
        (
            "twice the margin",
            lambda r, length: (
                ((length / 2 + r) ** 2 - (length / 2) ** 2) / length * 2 - 2 * r
            ),
        ),
        ("the paper's margin", lambda r, length: 0.05),
        ("longer than the true one", lambda r, length: 0),
        ("a distance to the middle", lambda r, length: length / 2),
        ("expected a number; got a str", lambda r, length: str(r**2 / length)),
    ],
}


def runs_without_infeasible(zone, a_max, gammas):
    good = []
    for gamma in gammas:
        settings = szlib.MPCSettings(gamma=gamma, a_max=a_max)
        log = szlib.simulate(
            szlib.SCENARIOS["passing"], szlib.MPCCBF(zone, settings=settings)
        )
        if log.metrics()["infeasible_steps"]:
            break
        good.append(gamma)
    return good


def predicts(scenario, change, before, after, quantity):
    """The correct predictions."""
    rises = (after == "behind") if change == "approach" else after > before
    return "larger" if rises == (quantity == "path_length") else "smaller"


OTHER = {"smaller": "larger", "larger": "smaller"}

SHEET6: dict[str, list[tuple[str, Answer]]] = {
    "speed_limit": [
        ("dt is missing", lambda h, g, dt, v: g * h - v),
        ("uses up part of it", lambda h, g, dt, v: g * h / dt),
        ("the wrong sign: the person comes", lambda h, g, dt, v: g * h / dt + v),
        ("divide by dt", lambda h, g, dt, v: g * h * dt - v),
        ("a negative limit is no mistake", lambda h, g, dt, v: max(0, g * h / dt - v)),
        ("the sign matters", lambda h, g, dt, v: abs(g * h / dt - v)),
        ("gamma is missing", lambda h, g, dt, v: h / dt - v),
        ("gamma and 1 - gamma are swapped", lambda h, g, dt, v: (1 - g) * h / dt - v),
    ],
    "largest_gamma": [
        (
            "this is one too large",
            lambda z, a, gs: gs[len(runs_without_infeasible(z, a, gs))],
        ),
        ("this is the smallest gamma", lambda z, a, gs: min(gs)),
        ("this is the largest gamma", lambda z, a, gs: max(gs)),
        ("use a_max", lambda z, a, gs: runs_without_infeasible(z, 1.0, gs)[-1]),
        (
            "the formula of the straight approach",
            lambda z, a, gs: max([g for g in gs if g <= a * 0.1] or [gs[0]]),
        ),
        (
            "this is an index",
            lambda z, a, gs: len(runs_without_infeasible(z, a, gs)) - 1,
        ),
        ("does not depend on the arguments", lambda z, a, gs: 0.07),
    ],
    "next_plan": [
        ("the last control is repeated", lambda plan: np.vstack([plan[1:], plan[-1]])),
        ("this is the old plan", lambda plan: plan),
        ("the wrong way", lambda plan: np.vstack([[0, 0], plan[:-1]])),
        ("what comes last?", lambda plan: plan[1:]),
        ("the first control comes again", lambda plan: np.vstack([plan[1:], plan[0]])),
        ("not at rest after zero controls", lambda plan: 0 * plan),
        ("must move on by one step", lambda plan: np.vstack([plan[:-1], [0, 0]])),
        ("got a list", lambda plan: [*plan[1:].tolist(), [None, None]]),
    ],
    "prediction": [
        ("the same answer", lambda *change: "smaller"),
        (
            "the same answer",
            lambda s, c, before, after, quantity: (
                "larger" if c == "width" else "smaller"
            ),
        ),
        ("the wrong way around", lambda *change: OTHER[predicts(*change)]),
        (
            "at least one kind of change",
            lambda *change: (
                OTHER[predicts(*change)] if change[1] == "gamma" else predicts(*change)
            ),
        ),
        (
            "at least one kind of change",
            lambda s, c, before, after, quantity: (
                "larger" if str(after) > str(before) else "smaller"
            ),
        ),
        ("expected one of", lambda *change: "nearer"),
        ("expected one of", lambda *change: ("smaller", "larger")),
        (
            "no answer: this uses szlib",
            lambda *change: szlib.simulate(
                szlib.SCENARIOS[change[0]],
                szlib.MPCCBF(szlib.Ellipse((0.1, 0), (0.9, 0.7))),
            ).metrics(),
        ),
    ],
    "count_ways": [
        ("these are all ways", lambda paths, people: len(paths)),
        ("np.unwrap removes the jumps", lambda paths, people: 1),
        ("how many there may be", lambda paths, people: 2 ** len(people)),
        (
            "from where they are at that time",
            lambda paths, people: len(sides(paths, people[:, :1])),
        ),
        (
            "not from where they end",
            lambda paths, people: len(sides(paths, people[:, -1:])),
        ),
        (
            "are added up",
            lambda paths, people: len({sum(row) for row in sides(paths, people)}),
        ),
        (
            "only the first person",
            lambda paths, people: len(sides(paths, people[:1])),
        ),
    ],
}

CHANGES: dict[str, list[tuple[str, str, str]]] = {
    "filter_1d": [
        ("the person's velocity is missing", " + velocity", ""),
        ("the person's velocity has the wrong sign", " + velocity", " - velocity"),
        ("dt is missing", "h / DT", "h"),
        ("gamma and 1 - gamma are swapped", "gamma * h", "(1 - gamma) * h"),
        ("R is missing", " - RADIUS", ""),
        ("gamma is missing", "gamma * h", "h"),
        (
            "the limits of the input are missing",
            "np.clip(min(wish, limit), -V_MAX, V_MAX)",
            "min(wish, limit)",
        ),
        ("take the smaller of wish and limit", "min(wish", "max(wish"),
        ("this is the wish", "min(wish, limit)", "wish"),
        ("this is the limit", "min(wish, limit)", "limit"),
        (
            "expected a number; got a list",
            "np.clip(min(wish, limit), -V_MAX, V_MAX)",
            "[None]",
        ),
    ],
    "filter_2d": [
        ("the gradient has the wrong sign", "(x - people) /", "(people - x) /"),
        ("the people's velocities are missing", "(away * velocities).sum(axis=1)", "0"),
        (
            "the people's velocities have the wrong sign",
            "(away * velocities).sum",
            "-(away * velocities).sum",
        ),
        ("dt is missing", "h / DT", "h"),
        ("R is missing", "distance - RADIUS", "distance"),
        ("the limits of the input are missing", "-V_MAX, V_MAX", "-np.inf, np.inf"),
        ("only the first person", "away, least,", "away[:1], least[:1],"),
        ("the barriers are missing", "away, least,", "[], [],"),
        ("H and f do not belong together", "-2 * wish", "-wish"),
        ("f has the wrong sign", "-2 * wish", "2 * wish"),
    ],
    "predict": [
        (
            "the list begins with x_1",
            "np.vstack(M)",
            "np.vstack([np.eye(2, 2 + N), *M[:-1]])",
        ),
        ("DT^2 / 2 is missing in B", "DT**2 / 2", "0"),
        ("the half is missing", "DT**2 / 2", "DT**2"),
        ("not by u", "np.array([DT**2 / 2, DT])", "np.array([DT**2 / 2, 1])"),
        ("the powers of A are one too high", "= B", "= A @ B"),
        ("in reversed order", "2 + k] = B", "1 + N - k] = B"),
        (
            "not all positions first",
            "np.vstack(M)",
            "np.hstack(M).reshape(2, N, -1).reshape(2 * N, -1)",
        ),
        (
            "the initial state is missing",
            "np.vstack(M)",
            "np.vstack(M) * (np.arange(2 + N) > 1)",
        ),
    ],
    "mpc_1d": [
        ("the cost is on the inputs only", "G.T @ Q @", "0 * G.T @ Q @"),
        ("the velocity is not in the cost", "[1, 2]", "[1, 0]"),
        ("the weights are swapped", "[1, 2]", "[2, 1]"),
        ("the inputs are not in the cost", " + np.eye(N)", ""),
        ("f has the wrong sign", "f = 2", "f = -2"),
        ("takes the half of z'Hz", "f = 2 *", "f ="),
        ("twice as large", "H = 2 *", "H ="),
        ("the goal is missing", "free - np.tile([goal, 0], N)", "free"),
        ("the limits of the inputs are missing", "-A_MAX, A_MAX", "-1e3, 1e3"),
        (
            "only the last state",
            "np.diag(np.tile([1, 2], N))",
            "np.diag([0] * (2 * N - 2) + [1, 2])",
        ),
        (
            "after the last input",
            "np.diag(np.tile([1, 2], N))",
            "np.diag([1, 2] * (N - 1) + [0, 0])",
        ),
    ],
    "mpc_cbf_1d": [
        ("the person's velocity is missing", " * velocity", " * 0"),
        ("the person's velocity has the wrong sign", "person + k", "person - k"),
        (
            "only the first step",
            "k = np.arange(1, N_h + 1)",
            "N_h, k = 1, np.array([1])",
        ),
        ("the power is missing", "(1 - gamma) ** k", "(1 - gamma)"),
        ("(1 - gamma)**k of h must be left", "(1 - gamma) ** k", "gamma**k"),
        ("(1 - gamma)**k of h must be left", "(1 - gamma) ** k", "0"),
        ("h may not fall at all", "(1 - gamma) ** k *", ""),
        (
            "the horizon of the barrier is off by one",
            "there = person + k",
            "there = person + (k - 1)",
        ),
        ("R is missing", " - RADIUS", ""),
        ("the barrier is missing", "f, rows, least,", "f, [], [],"),
        ("N_h is not used", "    k = np.arange", "    N_h = N\n    k = np.arange"),
    ],
    "mpc_cbf_2d": [
        ("a row has the wrong sign", "away = (guess", "away = -(guess"),
        ("the people's velocities are missing", " * velocity", " * 0"),
        ("the people's velocities have the wrong sign", "person + k", "person - k"),
        ("only the first step", "N_h + 1", "2"),
        ("the power is missing", "(1 - gamma) ** k", "(1 - gamma)"),
        ("(1 - gamma)**k of h must be left", "(1 - gamma) ** k", "0"),
        ("the horizon of the people is off by one", "person + k", "person + (k - 1)"),
        ("R is missing", "RADIUS", "0"),
        (
            "only the first person",
            "zip(people, velocities, strict=True)",
            "zip(people[:1], velocities)",
        ),
        (
            "the barriers are missing",
            "f.T.ravel(), rows, least,",
            "f.T.ravel(), [], [],",
        ),
        ("the velocity is not in the cost", "[1, 2]", "[1, 0]"),
        (
            "N_h is not used",
            "    rows, least = [], []",
            "    rows, least = [], []\n    N_h = N",
        ),
    ],
    "tuned": [
        ("does not depend on the arguments", "0.05 * a_max, 8", "0.02, 8"),
        ("does not depend on the arguments", "0.05 * a_max, 8", "0.1, 8"),
        ("has no solution", "0.05 * a_max, 8", "0.05 / a_max, 8"),
        ("has no solution", "0.05 * a_max, 8", "0.035, 8"),
        ("expected 0 < gamma <= 1", "0.05 * a_max, 8", "0.05 * a_max, 1"),
        ("does not arrive in time", "0.05 * a_max, 8", "0.01 * a_max, 8"),
        ("has no solution", "0.05 * a_max, 8", "0.15 * a_max, 8"),
        (
            "expected 0 < gamma <= 1 and a whole number",
            "0.05 * a_max, 8",
            "8, 0.05 * a_max",
        ),
        ("expected numbers, shape (2,)", "0.05 * a_max, 8", "0.05 * a_max"),
    ],
}
"""A controller: what the judge must say, and the part of the solution that is replaced, by what."""


def change(name: str, old: str, new: str) -> Answer:
    """The solution of the task `name`, with one part of it replaced."""
    sheet = TASKS[name][0]
    (source,) = [
        cell.source
        for cell in cells(SOLUTIONS / f"{sheet}.py")
        if cell.source.startswith(f"def {name}(")
    ]
    if old not in source:
        raise ValueError(f"{name} has no {old!r} to replace")
    found = dict(defined(sheet, SOLUTIONS))
    exec(source.replace(old, new), found)
    answer: Answer = found[name]
    return answer


CONTROLLER = {
    name: [(message, change(name, old, new)) for message, old, new in changes]
    for name, changes in CHANGES.items()
}

WRONG: dict[str, list[tuple[str, Answer]]] = {
    **SHEET1, **SHEET2, **SHEET3, **SHEET4, **SHEET5, **SHEET6, **CONTROLLER,
}  # fmt: skip

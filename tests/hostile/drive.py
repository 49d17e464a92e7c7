"""The differential drive and the ROS 2 node: wheels recomputed by formulas of our own, and any message.

At the samples and between them the robot runs along arcs.  The node hears messages that are late,
early, from another frame, not finite, or absent: each time it commands what its wheels can do, and zero
unless it knows where it is, who is there and where to go.
"""

from __future__ import annotations

import tempfile
import warnings
from collections import Counter
from math import atan2, hypot, tan
from pathlib import Path
from typing import Any

import helpers.ros_stubs as ros
import numpy as np
from clocks import broken
from controller import (
    A_SETTING,
    BETWEEN,
    NEAR,
    TOLERANCE,
    Judge,
    person_of,
    same,
    settings_of,
)
from helpers.ros_stubs import Node, goal, hear, odometry, people, tick
from tqdm import tqdm

import szlib
from szlib.zones.ellipses import EllipseZone

STEPS = {False: 300, True: 50_000}
TICKS = {False: 400, True: 50_000}
NUMBERS = [
    0.0,
    -0.0,
    1e8,
    1e9,
    1e300,
    -1e300,
    1e-300,
    float("nan"),
    float("inf"),
    -float("inf"),
]


def attack(long: bool) -> Counter[str]:
    """Count the steps and ticks, and what was broken."""
    tally: Counter[str] = Counter()
    attack_drives(STEPS[long], tally)
    attack_node(TICKS[long], tally)
    return tally


def arc(own: Any, control: Any, time: float) -> Any:
    """(x, y, theta) after `time` with wheels that hold (v, omega), shape (3,)."""
    (x, y, theta), (v, omega) = own[:3], control
    if abs(omega * time) < 1e-5:
        mean = theta + omega * time / 2
        return np.array(
            [
                x + v * time * np.cos(mean),
                y + v * time * np.sin(mean),
                theta + omega * time,
            ]
        )
    turned = theta + omega * time
    swept = np.array([np.sin(turned) - np.sin(theta), np.cos(theta) - np.cos(turned)])
    return np.r_[np.array([x, y]) + v / omega * swept, turned]


def attack_drives(count: int, tally: Counter[str], seed: int = 0) -> None:
    """Steps of drives of any size and speed, driven for a while, then thrown elsewhere."""
    with tqdm(total=count, unit="step", desc="drives", leave=False) as bar:
        for k in range(count // A_SETTING):
            rng = np.random.default_rng([seed, k, 2])
            s = settings_of(rng)
            turn = min(rng.uniform(0.1, 0.9) * np.pi / s.dt, rng.uniform(1, 8))
            ahead = None if rng.random() < 0.7 else float(rng.uniform(0.05, 0.5))
            walls = [np.array([(-5.0, 8.0), (5.0, 8.0 + rng.uniform())])] * int(
                rng.integers(2)
            )
            zone = szlib.Ellipse((0, 0), (1, 1))
            drive = szlib.DifferentialDrive(
                zone, walls=walls, settings=s, omega_max=turn, ahead=ahead
            )
            own = to = around = None
            for i in range(A_SETTING):
                if i % 20 == 0:
                    own, to = (
                        np.r_[rng.uniform(-5, 5, 2), rng.uniform(-4, 4)],
                        rng.uniform(-5, 5, 2),
                    )
                    own = np.r_[
                        own, rng.uniform(-1, 1, 2) * (drive.v_max, drive.omega_max)
                    ]
                    around = [person_of(rng) for _ in range(rng.integers(0, 4))]
                where = f"seed [{seed}, {k}, 2], step {i}, {s}"
                step = drive.step(own if i % 2 else own[:3], to, around)
                tally["steps of drives"] += 1
                tally["steps of drives, safe"] += int(step.safe)
                for fault in faults(drive, own, around, step):
                    broken(tally, fault, where)
                own = np.r_[arc(own, step.control, s.dt), step.control]
                around = [person.after(s.dt) for person in around]
            bar.update(A_SETTING)


def faults(drive: Any, own: Any, around: Any, step: Any) -> Any:
    """What is not as it should be about the step of a drive."""
    s, (v, omega) = drive.settings, step.control
    if not (np.isfinite(step.control).all() and np.isfinite(step.predicted).all()):
        yield "not finite"
        return
    if (
        abs(v) > drive.v_max * (1 + NEAR) + NEAR
        or abs(omega) > drive.omega_max * (1 + NEAR) + NEAR
    ):
        yield "wheels faster than they can"
    judge, end = Judge(s, list(drive.walls), around), arc(own, step.control, s.dt)
    if not (
        same(step.predicted[0, :2], own[:2]) and same(step.predicted[1, :2], end[:2])
    ):
        yield "plan is no arc"
    if not same(step.h, judge.h(own[:2])):
        yield "h of the disc"
    lever = drive.ahead * np.array([np.cos(end[2]), np.sin(end[2])])
    if hypot(*step.planned[0, 2:]) <= drive.v_max and step.feasible:
        at, away = end[:2] + lever, step.planned[1, :2]
        if np.abs(at - away).max() > 2 * TOLERANCE:
            yield "the point is not where it was planned"
    if step.safe:
        h = min(
            judge.h(p, t).min(initial=1) for p, t in ((own[:2], 0.0), (end[:2], s.dt))
        )
        gap = min(
            judge.gaps(p, t).min(initial=1)
            for p, t in ((own[:2], 0.0), (end[:2], s.dt))
        )
        if min(h, gap) < -2 * TOLERANCE or step.unknown:
            yield "safe"
        times, bow = (
            BETWEEN * s.dt,
            abs(v) * s.dt / 2 * tan(min(abs(omega) * s.dt / 4, 1.5)),
        )
        path = [arc(own, step.control, time)[:2] for time in times]
        if judge.between(own[:2], end[:2], path, times, bow, s.dt) < -1e-5:
            yield "unsafe between samples after a safe step"


# the node


def attack_node(count: int, tally: Counter[str], seed: int = 0) -> None:
    """Ticks of nodes that hear random messages."""
    node = ros.node_module("ros2_node_full")
    with (
        tempfile.TemporaryDirectory() as folder,
        node as module,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", szlib.DataWarning)  # a zone of nobody's data
        zone = Path(folder) / "zone.json"
        shape = EllipseZone({1.1: szlib.Ellipse((0.1, 0.0), (0.9, 0.7), 0.0)})
        szlib.SocialZone(shape, 2.0, shape.ellipses).save(zone)
        for k in tqdm(range(count // A_SETTING), desc="nodes", leave=False):
            rng = np.random.default_rng([seed, k, 3])
            Node.given = {
                "zone": str(zone),
                "walls": str(rng.choice(["", "-6 4 6 4", "2 -3 2 3; -6 4 6 4"])),
            }
            Node.now = ros.START
            talk(module.FullSocialDrive(), rng, tally, f"seed [{seed}, {k}, 3]")


def talk(node: Any, rng: np.random.Generator, tally: Counter[str], where: str) -> None:
    """A robot that obeys its node, which hears a random message now and then."""
    own, last = np.zeros(5), dict.fromkeys(("odom", "people", "goal_pose"), -np.inf)
    honest = bool(rng.random() < 0.3)
    """Whether every message is true and in time."""
    for i in range(A_SETTING):
        for topic in last:
            if rng.random() < (0.3 if topic == "goal_pose" else 0.8):
                what, usable = utter(topic, own, rng, honest)
                try:
                    hear(node, topic, what)
                except Exception as error:
                    broken(
                        tally,
                        f"{type(error).__name__} of a message of {topic}",
                        f"{where}, tick {i}",
                    )
                if usable:
                    stamp = what.header.stamp
                    last[topic] = stamp.sec + 1e-9 * stamp.nanosec
        try:
            v, omega = tick(node)
        except Exception as error:
            broken(
                tally,
                f"{type(error).__name__} of a tick",
                f"{where}, tick {i}: {error}",
            )
            return
        tally["ticks of nodes"] += 1
        tally["ticks of nodes that move"] += int(v != 0 or omega != 0)
        if not (
            abs(v) <= node.v_max * (1 + NEAR)
            and abs(omega) <= node.omega_max * (1 + NEAR)
        ):
            broken(
                tally,
                "a command that wheels cannot follow",
                f"{where}, tick {i}: {v}, {omega}",
            )
        blind = (
            max(abs(Node.now - last["odom"]), abs(Node.now - last["people"]))
            > node.timeout
        )
        if (blind or last["goal_pose"] == -np.inf) and (v or omega):
            broken(tally, "moves blindly", f"{where}, tick {i}")
        own = np.r_[arc(own, (v, omega), 0.1), v, omega]
        own[2] = atan2(np.sin(own[2]), np.cos(own[2]))
        Node.now += 0.1 if honest else rng.choice([0.0, 0.1, 0.1, 0.1, -0.1, 0.7, 1e3])


def utter(
    topic: str, own: Any, rng: np.random.Generator, honest: bool
) -> tuple[Any, bool]:
    """A message, and whether the node may use it."""
    how = {
        "late": 0.0
        if honest
        else float(rng.choice([0.0, 0.0, 0.04, -0.04, 0.4, 0.6, 1e4, -1e4]))
    }
    lie = not honest and rng.random() < 0.15
    if not honest and rng.random() < 0.05:
        how["frame"] = str(rng.choice(["", "map", "odom "]))
    if topic == "odom":
        at = own.copy()
        if lie:
            at[rng.choice([0, 1, 3, 4])] = NUMBERS[rng.integers(len(NUMBERS))]
        return odometry(at, **how), "frame" not in how and bool(np.isfinite(at).all())
    if topic == "goal_pose":
        at = [
            NUMBERS[rng.integers(len(NUMBERS))] if lie else float(rng.uniform(-4, 3))
            for _ in range(2)
        ]
        return goal(*at, **how), "frame" not in how
    walkers = [[str(rng.choice(["", "anna", "x" * 99, "\0", "ä"])), rng.uniform(-5, 5, 4) * [1, 1, 0.2, 0.2]]
               for _ in range(rng.integers(0, 5))]  # fmt: skip
    for walker in walkers:
        if lie:
            walker[1][rng.integers(4)] = NUMBERS[rng.integers(len(NUMBERS))]
    return people(
        *[(name, row.tolist()) for name, row in walkers], **how
    ), "frame" not in how

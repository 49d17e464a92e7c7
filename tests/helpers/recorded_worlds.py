"""A world of the laboratory for recordings: a robot passes a person who stands, by gamma and place."""

from dataclasses import replace

import numpy as np
from laboratory import PRESETS, Axis, RobotOptions, World

import szlib

ZONE = szlib.Ellipse((0.03, 0.0), (0.97, 0.75))
AXES = [Axis("gamma", "gamma", (0.05, 0.3)), Axis("y", "person at y [m]", (0.0, 0.5))]


def make_world(gamma, y):
    person = szlib.Person((0.0, y), heading=np.pi)
    scene = replace(PRESETS["passing"], people=(person,))
    return World(scene, ZONE, [RobotOptions(changes={"gamma": gamma})])

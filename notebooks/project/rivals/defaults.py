"""szlib's defaults."""

import math

import szlib


def make_controller(walls, zone):
    """The controller of szlib, without its time limit: the same on every machine."""
    return szlib.MPCCBF(zone, walls=walls, settings=szlib.MPCSettings(time_limit=math.inf))

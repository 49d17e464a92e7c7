"""The settings that szlib recommends among people."""

import math

import szlib


def make_controller(walls, zone):
    """The controller of szlib among people, without its time limit: the same on every machine."""
    settings = szlib.MPCSettings.among_people(time_limit=math.inf)
    return szlib.MPCCBF(zone, walls=walls, settings=settings)

"""The settings that szlib recommends among people, with a bolder gamma."""

import math

import szlib


def make_controller(walls, zone):
    """The controller of szlib among people, which may come nearer in a step."""
    settings = szlib.MPCSettings.among_people(gamma=0.2, time_limit=math.inf)
    return szlib.MPCCBF(zone, walls=walls, settings=settings)

"""The paper's settings, to the letter: the rival to beat."""

import szlib


def make_controller(walls, zone):
    """The paper's controller."""
    return szlib.MPCCBF(zone, walls=walls, settings=szlib.MPCSettings.paper())

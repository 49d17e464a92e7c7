"""My controller: a template that runs as it is.

    python my_controller.py    drive through three variations of the meeting, and draw the first

Hand in this one file. The judge calls `make_controller` once for each world.
"""

import math

import szlib

MEETING = "intersection"
SETTINGS = szlib.MPCSettings(gamma=0.1, time_limit=math.inf)  # no limit here: the judge has its own


def make_controller(walls, zone):
    """Make the controller for a world.

    Parameters
    ----------
    walls : the walls of the world, shape (n, 2, 2) [m].
    zone : the zone of everybody, a `szlib.Ellipse` in the person's frame.

    Returns
    -------
    An object with `step(state, goal, people)`, which returns an object with `control`, (ax, ay) [m/s2]: see
    `szlib.control.Controller`, from which you can derive a class of your own.
    """
    return szlib.MPCCBF(zone, walls=walls, settings=SETTINGS)


if __name__ == "__main__":
    zone = szlib.Ellipse(center=(0.03, 0.0), semi_axes=(0.97, 0.75))
    worlds = szlib.simulation.Variations(szlib.MEETINGS[MEETING], zone)
    loop = szlib.simulation.LoopSettings(behaviour=szlib.simulation.VisiblePeople())
    for seed in range(3):
        world = worlds(seed)
        controller = make_controller(world.walls, zone)
        log = szlib.drive(world, controller, loop)
        print(f"world {seed}: {log!r}")
        if seed == 0:
            log.plot().figure.savefig("my_controller.png")

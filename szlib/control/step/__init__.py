"""What the controller decided, and how far it can be relied upon.

scene     what was asked: the robot, its goal, people and walls
report    a step checked again by formulas of its own, and told in words: `Report`
decision  what was decided: `Step`
polygon   what could have been chosen: the polygon of accelerations that obey every row: `admissible`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["scene", "report", "decision", "polygon"],
    submod_attrs={
        "scene": ["Scene"],
        "report": ["Report"],
        "polygon": ["Admissible", "Limit", "admissible"],
        "decision": ["RUNGS", "Rung", "Status", "Step", "status_of", "terminal_of"],
    },
)

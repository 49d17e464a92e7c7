"""What the controller decided, and how far it can be relied upon.

scene     what was asked: the robot, its goal, people and walls
report    a step checked again by formulas of its own, and told in words: `Report`
decision  what was decided: `Step`
polygon   what could have been chosen: the polygon of accelerations that obey every row: `admissible`
"""

from .decision import RUNGS, Rung, Status, Step, status_of, terminal_of
from .polygon import Admissible, Limit, admissible
from .report import Report
from .scene import Scene

__all__ = [
    "RUNGS",
    "Admissible",
    "Limit",
    "Report",
    "Rung",
    "Scene",
    "Status",
    "Step",
    "admissible",
    "status_of",
    "terminal_of",
]

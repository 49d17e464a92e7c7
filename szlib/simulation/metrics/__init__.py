"""A run in numbers.

endings  how a run ended, and who broke a barrier: `outcome`
motion   one dictionary of metrics for scenarios, random worlds and comparisons: `metrics`
manners  what the robot did: went ahead, waited, backed out, ...: `manner`
social   what people would notice, after HuNavSim: `social`
"""

from .endings import Outcome, outcome, path_exists
from .manners import MANNERS, Manner, manner, retreat
from .motion import along_course, avoidance_start, metrics, passing_side, yielding

__all__ = [
    "MANNERS",
    "Manner",
    "Outcome",
    "along_course",
    "avoidance_start",
    "manner",
    "metrics",
    "outcome",
    "passing_side",
    "path_exists",
    "retreat",
    "yielding",
]

"""A run in numbers.

endings  how a run ended, and who broke a barrier: `outcome`
motion   one dictionary of metrics for scenarios, random worlds and comparisons: `metrics`
manners  what the robot did: went ahead, waited, backed out, ...: `manner`
social   what people would notice, after HuNavSim: `social`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["endings", "motion", "manners", "social"],
    submod_attrs={
        "endings": ["Outcome", "outcome", "path_exists"],
        "manners": ["MANNERS", "Manner", "manner", "retreat"],
        "motion": ["along_course", "avoidance_start", "metrics", "passing_side", "yielding"],
    },
)

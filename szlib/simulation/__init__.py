"""What happens then: the robot among people, in the paper's scenarios and in random worlds.

scenario              the scene of a run, its variations, and random worlds: `Scenario`, `Worlds`
crowds                how people move, and who react to the robot: `Behaviour`, `ReactingPeople`
robot_run             the arrays of a run, and the quantities that follow from them: `Run`
metrics               a run in numbers, how it ends, and what the robot does: `compute_metrics`
log                   a run with its table, metrics, pictures and files: `SimulationLog`
closed_loop           the robot among people, step by step: `simulate`, `drive`
catalogue             the named scenarios: the paper's, and meetings: `SCENARIOS`, `MEETINGS`
baseline_controllers  controllers to compare with: `CONTROLLERS`
monte_carlo           thousands of random worlds, in parallel; comparisons: `rollouts`, `compare`
"""

from .baseline_controllers import CONTROLLERS, make_mpc_cbf
from .catalogue import MEETINGS, SCENARIOS
from .closed_loop import LoopSettings, drive, simulate
from .crowds import (
    WALKING_MODELS,
    Behaviour,
    Crowd,
    CrowdModel,
    ReactingPeople,
    VisiblePeople,
)
from .log import SimulationLog
from .metrics import (
    STRATEGIES,
    classify_outcome,
    classify_strategy,
    compute_metrics,
    compute_retreat,
    find_avoidance_start,
    find_passing_side,
    find_yielding_steps,
)
from .monte_carlo import (
    BEHAVIOURS,
    FORMULATIONS,
    METHOD,
    ZONES,
    RolloutSetup,
    compare,
    rollouts,
)
from .robot_run import Run
from .scenario import (
    GOAL_RADIUS,
    ONE_PERSON,
    STOPPED_SPEED,
    Claim,
    Scenario,
    Variations,
    Worlds,
)

__all__ = [
    "BEHAVIOURS",
    "CONTROLLERS",
    "FORMULATIONS",
    "GOAL_RADIUS",
    "MEETINGS",
    "METHOD",
    "ONE_PERSON",
    "SCENARIOS",
    "STOPPED_SPEED",
    "STRATEGIES",
    "WALKING_MODELS",
    "ZONES",
    "Behaviour",
    "Claim",
    "Crowd",
    "CrowdModel",
    "LoopSettings",
    "ReactingPeople",
    "RolloutSetup",
    "Run",
    "Scenario",
    "SimulationLog",
    "Variations",
    "VisiblePeople",
    "Worlds",
    "classify_outcome",
    "classify_strategy",
    "compare",
    "compute_metrics",
    "compute_retreat",
    "drive",
    "find_avoidance_start",
    "find_passing_side",
    "find_yielding_steps",
    "make_mpc_cbf",
    "rollouts",
    "simulate",
]

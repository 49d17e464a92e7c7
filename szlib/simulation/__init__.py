"""What happens then: the robot among people, in the paper's scenarios and in random worlds.

scenario              the scene of a run, the paper's claims of it, and how people move: `Scenario`
scenarios             the paper's four scenarios, eleven meetings, random worlds
crowds                people who react, by a model of walking: `ReactingPeople`
run                   the arrays of a run, and the quantities that follow from them: `Run`
metrics               the motion of a run in numbers: `compute_metrics`
outcomes              how a run ends: `classify_outcome`
strategies            what the robot does: goes ahead, waits, backs out: `classify_strategy`
social_metrics        what people notice, and a robot beside the person whom it replaces
safety_claims         safe steps that lead to h < 0: `safety_violations`
log                   a run with its table, metrics, pictures and files: `SimulationLog`
closed_loop           the robot among people, step by step: `simulate`, `drive`
baseline_controllers  controllers to compare with
monte_carlo           thousands of random worlds, in parallel: `rollouts`
comparisons           controllers, zones, formulations and behaviours on identical worlds: `compare`
replay                the robot in the place of a recorded walker: `find_replays`
"""

from .closed_loop import drive, simulate
from .comparisons import (
    BEHAVIOURS,
    CONTROLLERS,
    FORMULATIONS,
    ZONES,
    compare,
    measure_time_inside,
    summarise,
)
from .crowds import ReactingPeople
from .log import SimulationLog
from .metrics import (
    compute_metrics,
    find_avoidance_start,
    find_passing_side,
    find_yielding_steps,
)
from .monte_carlo import rerun_world, rollouts
from .outcomes import classify_outcome
from .replay import ReplacedWalker, Replay, Replays, find_replays
from .run import Run
from .safety_claims import safety_violations
from .scenario import Behaviour, Claim, Crowd, CrowdModel, Scenario
from .scenarios import (
    MEETINGS,
    ONE_PERSON,
    SCENARIOS,
    Variations,
    VisiblePeople,
    Worlds,
)
from .social_metrics import compute_replay_metrics, compute_social_metrics
from .strategies import STRATEGIES, classify_strategy, compute_retreat

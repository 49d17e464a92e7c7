"""What happens then: the robot among people, in the paper's scenarios and in random worlds.

closed_loop  the closed loop and its log: `simulate`
scenarios    the four scenarios of the paper: `SCENARIOS`
worlds       random worlds, each from its seed
runs         a drive through a world in arrays
rollouts     thousands of them, in parallel: `rollouts`
comparisons  zones, formulations and behaviours on identical worlds
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["closed_loop", "scenarios", "worlds", "runs", "rollouts", "comparisons"],
)

"""How does a robot keep out: control barrier functions inside model predictive control (MPC-CBF).

barriers   distances to walls and zones, and the discrete barrier condition
settings   every parameter of the controller: `MPCSettings`
distances  approximate against Euclidean distances, and the margin that is needed
people     people as the controller sees them: `Person`; on which side one met head-on is passed
problem    the optimal control problem, in symbols
ipopt      its solution by IPOPT, as in the paper
sqp        its solution by a condensed SQP
step       what it decides, and how far that can be relied upon: `Step`
mpc        the controller: `MPCCBF`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["barriers", "settings", "distances", "people", "problem", "ipopt", "sqp", "step", "mpc"],
)

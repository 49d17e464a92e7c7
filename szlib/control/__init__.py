"""How does a robot keep out: control barrier functions inside model predictive control (MPC-CBF).

barriers   distances to walls and zones, and the discrete barrier condition
settings   every parameter of the controller: `MPCSettings`
distances  approximate against Euclidean distances, and the margin that is needed
people     people as the controller sees them, and their zones in the world: `Person`
head_on    on which side a person is passed who is met head-on
problem    the optimal control problem, in symbols
ipopt      its solution by IPOPT, as in the paper
sqp        its solution by a condensed SQP
mpc        the controller: `MPCCBF`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["barriers", "settings", "distances", "people", "head_on", "problem", "ipopt", "sqp", "mpc"],
)

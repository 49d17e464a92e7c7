"""How does a robot keep out: control barrier functions inside model predictive control (MPC-CBF).

barriers      distances to walls and zones, and the discrete barrier condition
settings      every parameter of the controller: `MPCSettings`
distances     approximate against Euclidean distances, and the margin that is needed
people        people as the controller sees them: `Person`, `Tracker`; how one met head-on is passed
problem       the optimal control problem, in symbols
step          what the controller decides, and how far that can be relied upon: `Step`
solvers       a condensed SQP, or IPOPT as in the paper; and what is done where there is no solution
mpc           the controller: `MPCCBF`
differential  a robot with two wheels: `DifferentialDrive`
"""

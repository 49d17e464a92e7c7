"""How does a robot keep out: control barrier functions inside model predictive control (MPC-CBF).

settings              every parameter of the controller: `MPCSettings`
barriers              distances to walls and zones, and the discrete barrier condition
distances             approximate against Euclidean distances, and the margin that is needed
person                a person as the controller sees them: `Person`
tracker               people from one measurement to the next: `Tracker`
head_on               on which side the robot passes a person whom it meets head-on
scene                 what a step was asked
step_report           a step checked again by formulas of its own
step                  what the controller decided: `Step`
acceleration_polygon  the accelerations that a step could have chosen
problem               the optimal control problem, in symbols
solvers               the solvers of the problem, and the fallbacks where there is no solution
mpc                   the controller: `MPCCBF`
differential_drive    a robot with two wheels: `DifferentialDrive`
"""

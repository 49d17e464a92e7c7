"""Other people's crowds: people who react to the robot and to each other, and people who were recorded.

walkers       everybody in numbers, and what a model of walking must do: `Walkers`, `Model`
orca          optimal reciprocal collision avoidance, by pyrvo
social_force  the extended social force model, by PySocialForce
speed_model   the collision-free speed model, by JuPedSim
reacting      one behaviour over the three: `Reacting`
replay        the robot in the place of a recorded walker: `Replay`, `replays`
promises      steps that said they were safe and led to h < 0, and why: `broken_promises`
scores        one set of numbers for robots and for the people they replace: `score`
"""

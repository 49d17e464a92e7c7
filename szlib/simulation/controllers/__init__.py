"""What drives a robot: what the closed loop asks of a controller and of a robot.

protocol   what a controller, its steps and a robot must have: `Controller`, `StepLike`, `Robot`
baselines  what people would otherwise use: straight ahead with stop, social force, dynamic window
"""

from .baselines import dynamic_window, social_force, straight
from .protocol import Controller, DoubleIntegrator, Factory, Robot, StepLike

__all__ = [
    "Controller",
    "DoubleIntegrator",
    "Factory",
    "Robot",
    "StepLike",
    "dynamic_window",
    "social_force",
    "straight",
]

"""What drives a robot: what the closed loop asks of a controller and of a robot.

protocol  what a controller, its steps and a robot must have: `Controller`, `StepLike`, `Robot`
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["protocol"],
    submod_attrs={"protocol": ["Controller", "DoubleIntegrator", "Factory", "Robot", "StepLike"]},
)

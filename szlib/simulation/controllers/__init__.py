"""What drives a robot: what the closed loop asks of a controller and of a robot.

protocol   what a controller, its steps and a robot must have: `Controller`, `StepLike`, `Robot`
baselines  what people would otherwise use: straight ahead with stop, social force, dynamic window
"""

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["protocol", "baselines"],
    submod_attrs={
        "protocol": ["Controller", "DoubleIntegrator", "Factory", "Robot", "StepLike"],
        "baselines": ["dynamic_window", "social_force", "straight"],
    },
)

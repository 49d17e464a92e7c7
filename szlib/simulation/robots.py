"""The factory of controllers that comparisons and rollouts use; controllers and robots are defined in
`szlib.control.controller`."""

from __future__ import annotations

from collections.abc import Callable

from ..control.controller import Controller as Controller
from ..control.controller import DoubleIntegrator as DoubleIntegrator
from ..control.controller import Robot as Robot
from ..control.controller import advance as advance
from ..control.settings import MPCSettings
from .scenario import Scenario

ControllerFactory = Callable[[Scenario, MPCSettings], Controller]
"""Makes a controller for a scenario; a function of a module, so that other processes find it."""

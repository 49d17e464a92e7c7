"""How does a robot keep out: control barrier functions inside model predictive control (MPC-CBF).

settings            every parameter of the controller: `MPCSettings`
obstacles           what the robot keeps out of: distances, barriers, and the kinds `Zone`, `Body`, `Wall`,
                    `HalfPlane`, and those of users: `Obstacle`
verification        steps computed again by other formulas: `Step.verify`
walls               walls from lines, polygons and the maps of ROS: `walls_from_map`
people              people as the controller sees them: `Person`, `Tracker`
controller          the base class of controllers, the robots that they drive, and their clock
ways                where the plan heads: around walls and between people, and past those met head-on
problem             the problem of a step in matrices and symbols
planner             the problem, and its solution by priorities
step                what a step is asked, and what the controller decided: `Step`
mpc                 the controller, and its guard: `MPCCBF`
differential_drive  a robot with two wheels: `DifferentialDrive`
"""

from .controller import Controller, DoubleIntegrator, Robot, advance, as_controller
from .differential_drive import DifferentialDrive, DriveStep, Unicycle
from .mpc import MPCCBF
from .obstacles import (
    Body,
    HalfPlane,
    Obstacle,
    Obstacles,
    Priority,
    Wall,
    Zone,
    barrier,
    cbf_residual,
    ellipse_distance,
    segment_distance,
)
from .people import Person, Prediction, TrackedPeople, Tracker, predict
from .settings import MPCSettings
from .step import STATUSES, Scene, Step
from .verification import Report
from .walls import read_walls, walls_from_grid, walls_from_map
from .ways import Way

__all__ = [
    "MPCCBF",
    "STATUSES",
    "Body",
    "Controller",
    "DifferentialDrive",
    "DoubleIntegrator",
    "DriveStep",
    "HalfPlane",
    "MPCSettings",
    "Obstacle",
    "Obstacles",
    "Person",
    "Prediction",
    "Priority",
    "Report",
    "Robot",
    "Scene",
    "Step",
    "TrackedPeople",
    "Tracker",
    "Unicycle",
    "Wall",
    "Way",
    "Zone",
    "advance",
    "as_controller",
    "barrier",
    "cbf_residual",
    "ellipse_distance",
    "predict",
    "read_walls",
    "segment_distance",
    "walls_from_grid",
    "walls_from_map",
]

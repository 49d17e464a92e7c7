"""How does a robot keep out: control barrier functions inside model predictive control (MPC-CBF).

settings              every parameter of the controller: `MPCSettings`
barriers              distances to walls and zones, and the discrete barrier condition
maps                  walls from the maps of ROS: `walls_from_map`
distances             approximate against Euclidean distances, and the margin that is needed
person                a person as the controller sees them: `Person`
tracker               people from one measurement to the next: `Tracker`
head_on               on which side the robot passes a person whom it meets head-on
controller            the base class of controllers, and the robots that they drive: `Controller`
routes                the shortest way around walls: `find_route`
crowding              which barriers stay hard near several people, and which get a price
scene                 what a step is asked
step_clock            when a controller decides, with which state, and whether the robot makes progress
step_report           a step checked again by formulas of its own: `StepReport`
step                  what the controller decided: `Step`
acceleration_polygon  the accelerations that a step could have chosen: `find_admissible_controls`
problem               the optimal control problem, in symbols
solvers               the solvers of the problem, and the fallbacks where there is no solution
mpc                   the controller: `MPCCBF`
differential_drive    a robot with two wheels: `DifferentialDrive`
"""

from .acceleration_polygon import (
    AdmissibleControls,
    BarrierLimit,
    find_admissible_controls,
)
from .barriers import (
    barrier,
    cbf_residual,
    compute_h,
    ellipse_distance,
    read_walls,
    segment_distance,
)
from .controller import Controller, DoubleIntegrator, Robot, advance, as_controller
from .differential_drive import DifferentialDrive, DriveStep, Unicycle
from .distances import (
    compare_distances,
    euclidean_to_ellipse,
    euclidean_to_segment,
    required_margin,
    wall_margin,
)
from .maps import walls_from_grid, walls_from_map
from .mpc import MPCCBF
from .person import Person
from .routes import find_route
from .scene import Scene
from .settings import Crowding, MPCSettings
from .step import FALLBACKS, Step
from .step_report import StepReport
from .tracker import TrackedPeople, Tracker

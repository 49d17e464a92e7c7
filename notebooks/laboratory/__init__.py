"""The laboratory of notebook 13: a scene that can be dragged and set while the controller runs.

world                the scene, the robots in it, and every change that a user made
admissible_controls  the accelerations that a step could have chosen, and their figure
explanation          why the controller chose an acceleration, in one sentence
widget               both on a page of JupyterLab, drawn by `laboratory.js`
recorded             runs over a small grid of values, recorded in a page that needs no kernel (`recorded.js`)
sliders              sliders for one figure, as in notebooks 05 and 07
"""

from .admissible_controls import (
    AdmissibleControls,
    BarrierLimit,
    draw_step,
    find_admissible_controls,
    plot_admissible_controls,
)
from .explanation import Explanation, explain
from .recorded import Axis, Recording
from .sliders import is_interactive, show_sliders
from .widget import Laboratory
from .world import PRESETS, RobotOptions, World

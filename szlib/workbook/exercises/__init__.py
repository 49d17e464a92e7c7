"""Can you do it yourself? The tasks of the exercise sheets: `check` an answer, ask for a `hint`.

task       one task: fresh cases, the truth, what is said of typical mistakes
tracks     sheet 1: velocity, line of sight, attentional space, 1 Hz
outliers   sheet 2: complementary coordinates, nearest approaches, LOF's blind spot
zones      sheet 3: a slice, its zone, the smallest ellipse, a zone of your own
certainty  sheet 4: quantiles, extremes, p-values, the null model
barriers   sheet 5: distances to zones and walls, the barrier row, the margin
robot      sheet 6: speed limit, gamma by experiment, the terminal proof, predictions
checking   `check` and `hint`, over all sheets
"""

from .checking import SHEETS, check, hint
from .task import Task, Verdict

__all__ = ["SHEETS", "Task", "Verdict", "check", "hint"]

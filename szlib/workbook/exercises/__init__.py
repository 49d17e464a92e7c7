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

import lazy_loader as lazy

__getattr__, __dir__, __all__ = lazy.attach(
    __name__,
    submodules=["task", "tracks", "outliers", "zones", "certainty", "barriers", "robot", "checking"],
    submod_attrs={"checking": ["SHEETS", "check", "hint"], "task": ["Task", "Verdict"]},
)

"""Tasks of the exercise sheets: `check` an answer, or read a `hint`.

task              one task: it draws cases and compares the answers
texts.toml        minutes, hints and messages of all tasks
sheet1_tracks     velocity, line of sight, attentional space, sampling at 1 Hz
sheet2_outliers   complementary coordinates, nearest approaches, LOF's blind spot
sheet3_zones      a slice, its zone, the smallest ellipse, a zone of your own
sheet4_certainty  quantiles, extremes, p-values, the null model
sheet5_barriers   distances to zones and walls, the barrier row, the margin
sheet6_robot      speed limit, gamma by experiment, the terminal proof, predictions, distinct ways
sheets            `check` and `hint`, over all sheets
"""

from .sheets import SHEETS, case, check, hint, plot, sheet_minutes
from .task import ESSAY_MINUTES, Task, Verdict

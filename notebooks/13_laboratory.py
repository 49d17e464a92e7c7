# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3 (ipykernel)
#     language: python
#     name: python3
# ---

# %% [markdown]
# # 13 - The laboratory
#
# **Question.** What does the robot do if *you* put the person somewhere else, move the goal, narrow the
# corridor, or change gamma while it drives?
#
# **Expectation.** Two robots in the same scene do not see each other and differ in one setting: the one that
# may use up a larger share of h in each step comes nearer to the zone before it gives way, and arrives
# sooner.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [12 - Other people's crowds](12_among_people.ipynb) ·
# [paper](https://arxiv.org/abs/2405.15101): sec. 3-4 · 10 min to read
#
# **Afterwards you can** try out a scene of your own, live, and hand its settings on.

# %%
import numpy as np
import pandas as pd
from laboratory import Experiment, LaboratoryWidget, RobotOptions, is_interactive, make_scene

import szlib
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, TUNED, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
goal = [4.0, 0.0]  # x, y [m]
person = [4.0, 0.0, 180.0]  # x, y [m], walks towards [deg]
speed = 0.5  # of the person [m/s]
walls = [-6.0, 2.3, 7.0, 2.3, -6.0, -2.3, 7.0, -2.3]  # xa, ya, xb, yb of each [m]
gamma = 0.05
N_h = 2
a_max = 1.0
size = 1.0
estimator = "quantile"
gamma_b = 0.2
N_h_b = 2
a_max_b = 1.0
size_b = 1.0
estimator_b = "quantile"

# %%
record = NotebookRecord("13_laboratory", globals())
parameters(
    [
        ("the scene", "the corridor of notebook 10", ASSUMED, "the paper gives no coordinates"),
        ("gamma of A, of B", f"{gamma:g}, {gamma_b:g}", TUNED, "notebook 09; B is to compare with"),
        (
            "N_h, a_max",
            f"{N_h} and {N_h_b} steps, {a_max:g} and {a_max_b:g} m/s2",
            PAPER,
            "sec. 4; a_max assumed",
        ),
        ("size of the zone", f"{size:g} and {size_b:g} times", ASSUMED, "1 is what was measured"),
    ]
)

# %% [markdown]
# ## The scene, and two robots
#
# A zone for each estimator: the quantile zone that notebook 05 kept, and the hull. Robot A is as in
# notebook 10; robot B is set by the parameters that end in `_b`.

# %%
samples = record.cache.encounters()
pace = record.cache.method.zone_speed
hull = szlib.SocialZone.fit(samples, method="hull", speeds=(pace,), n_resamples=0)
zones = {"quantile": record.cache.ellipse(), "hull": hull.ellipse(pace)}
first = RobotOptions(gamma, N_h, a_max, size, estimator)
second = RobotOptions(gamma_b, N_h_b, a_max_b, size_b, estimator_b)

# %%
scene = make_scene(goal, person, speed, walls, start=[-4.0, 0.0])
logs = {}
for name, choice in (("A", first), ("B", second)):
    controller = szlib.MPCCBF(choice.zone(zones), walls=scene.walls, settings=choice.settings())
    logs[f"{name}: gamma = {choice.gamma:g}"] = szlib.simulate(scene, controller)

# %% [markdown]
# ## In pictures
#
# The same scene every three seconds, for who has no kernel at hand: A above, B below. The disc is the
# robot, the diamond its goal; the triangle is the person, within their zone.

# %%
fig = figures.draw_run_grid(logs, every=3.0)
record.figure(fig, "strip")

# %%
a, b = (log.metrics() for log in logs.values())
shown = ["min_h", "time_to_goal", "min_speed", "infeasible_steps"]
pd.DataFrame({name: log.metrics() for name, log in logs.items()}).loc[shown]

# %%
record.key |= {"A: min_h": a["min_h"], "B: min_h": b["min_h"]}
record.key |= {"A: time_to_goal": a["time_to_goal"], "B: time_to_goal": b["time_to_goal"]}

# %% [markdown]
# ## Live
#
# In JupyterLab the scene stands here: press *run*, drag what you like, set what you like. Below each scene:
# the least h over time, and all accelerations that obey every condition at this instant (green), with the one
# chosen. *share* writes a parameter cell: put it below that of this notebook, and it begins with your scene.

# %%
LaboratoryWidget(Experiment(scene, zones, [first, second])) if is_interactive() else None

# %% [markdown]
# What is shown live is what `szlib.simulate` computes, step by step:

# %%
trial = Experiment(scene, zones, [first, second])
same = []
for k in range(min(60, *(len(log.states) for log in logs.values()))):
    same += [np.array_equal(x, log.states[k]) for x, log in zip(trial.states, logs.values(), strict=True)]
    trial.step()
record.check("its steps are those of szlib.simulate", all(same), f"{len(same)} states", always=True)

# %% [markdown]
# Things to try:
#
# 1. Put the person at rest (speed 0) in the middle of the corridor. Which robot stops, and at which gamma?
# 2. Narrow the corridor by the ends of its walls until A waits. What happens to the green polygon?
# 3. Give B a horizon `N_h` of 8 at gamma = 0.5, and drag the person in front of it.
# 4. Make the zone half as large, then twice as large: what does yielding cost?

# %%
sooner = a["time_to_goal"] - b["time_to_goal"]
nearer = a["min_h"] - b["min_h"]
print(
    f"With gamma = {gamma_b:g} in place of {gamma:g} the robot comes {abs(100 * nearer):.0f} cm "
    f"{'nearer to' if nearer > 0 else 'less near to'} the edge of what is allowed, and arrives "
    f"{abs(sooner):.1f} s {'sooner' if sooner > 0 else 'later'}."
)

# %% [markdown]
# **What it means.** h is what is left before the zone is reached, and gamma the share of it that may be used
# up in a step. The sentence above says what that is worth here; in your own scene it may say something else.

# %%
record.close()

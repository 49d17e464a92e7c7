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
# # 10 - Yielding by making room
#
# **Question.** This time the robot is *in* the passage when the person comes. It cannot wait
# where it is.
#
# **Expectation.** The paper: the robot gives way first - here it must back out - and goes on
# afterwards.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [9 - Yielding by waiting](09_waiting.ipynb) · next: [11 -
# Feasibility](11_feasibility.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4, fig. 6d · 5 min to
# read
#
# **Afterwards you can** say why the robot backs out of a passage, although no rule tells it to.

# %%
import matplotlib.pyplot as plt
import pandas as pd

import szlib
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, PAPER, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05

# %%
record = NotebookRecord("10_making_room", globals())
settings = szlib.MPCSettings(gamma=gamma)
scenario = szlib.SCENARIOS["making_room"]
person = scenario.people[0]
parameters(
    [
        (
            "person's speed",
            f"{abs(person.velocity[0])} m/s",
            PAPER,
            "constant, known exactly, unaffected by the robot",
        ),
        ("places of robot, person, walls", "see the figure", ASSUMED, "the paper shows them without numbers"),
        ("N, N_h, dt", f"{settings.N}, {settings.N_h}, {settings.dt} s", PAPER, "sec. 4"),
        ("gamma", gamma, MEASURED, "see notebook 06"),
        ("Q, R, P, a_max, tie", "as in notebook 07", ASSUMED, "the paper gives none"),
    ]
)

# %%
zone = record.zone().ellipse(settings.zone_speed)
controller = szlib.MPCCBF(zone, walls=scenario.walls, settings=settings)
log = szlib.simulate(scenario, controller)
metrics = log.metrics()
pd.Series(metrics).to_frame("value")

# %%
ax = log.plot()
record.figure(ax.figure, "scenario")

# %%
record.animation(movie := log.animate(), "run")
movie

# %% [markdown]
# ## Safe?
#
# The promises that must hold with any zone that leaves the scene passable: the goal, $h \ge 0$ at
# every step for every person and wall, no step without a solution, no speeding.

# %%
record.check("the goal is reached", metrics["success"])
record.check("h >= 0 at every step", metrics["min_h"] >= 0, metrics["min_h"])
record.check("no infeasible step", metrics["infeasible_steps"] == 0, metrics["infeasible_steps"])
record.check("nothing is touched (Euclidean)", metrics["min_clearance"] > 0, metrics["min_clearance"])
record.check("never faster than 1 m/s", metrics["max_speed"] <= 1 + 1e-6, metrics["max_speed"])
record.key |= {name: metrics[name] for name in ("time_to_goal", "min_h", "min_speed", "time_yielding")}

# %% [markdown]
# ## As the paper says?

# %%
for claim in scenario.claims:
    record.claim(claim.text, *claim.check(log))

# %%
fig, (upper, lower) = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True, layout="constrained")
figures.plot_speed(log, ax=upper).set(title="The robot backs out, stands aside, and goes on", xlabel="")
figures.plot_barriers(log, ax=lower)
record.figure(fig, "run")

# %%
log.min_h().to_frame("smallest h [m]").round(3)

# %% [markdown]
# **What it means.** The zone moves with the person, and h falls even for a robot at rest: the
# only controls that obey the barrier condition lead backwards. Making room needs no rule of its
# own.

# %%
record.close()

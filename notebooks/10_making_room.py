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

# %%
import pandas as pd
from IPython.display import Image

import szlib
from szlib.workbook.figures import simulation as scenes
from szlib.workbook.record import ASSUMED, MEASURED, PAPER, Page, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
seed = 0
results = "../results"
gamma = 0.05

# %%
page = Page("10_making_room", data=data, results=results, seed=seed)
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
zone = page.zone().ellipse(settings.zone_speed)
controller = szlib.MPCCBF(zone, walls=scenario.walls, settings=settings)
log = szlib.simulate(scenario, controller)
metrics = log.metrics()
pd.Series(metrics).to_frame("value")

# %%
ax = scenes.plot_scenario(log)
page.figure(ax.figure, "scenario")

# %%
page.animation(movie := scenes.animate(log), "run")
Image(movie)

# %% [markdown]
# ## Safe?
#
# The promises that must hold with any zone that leaves the scene passable: the goal, $h \ge 0$ at
# every step for every person and wall, no step without a solution, no speeding.

# %%
page.check("the goal is reached", metrics["success"])
page.check("h >= 0 at every step", metrics["min_h"] >= 0, metrics["min_h"])
page.check("no infeasible step", metrics["infeasible_steps"] == 0, metrics["infeasible_steps"])
page.check("nothing is touched (Euclidean)", metrics["min_clearance"] > 0, metrics["min_clearance"])
page.check("never faster than 1 m/s", metrics["max_speed"] <= 1 + 1e-6, metrics["max_speed"])
page.key |= {name: metrics[name] for name in ("time_to_goal", "min_h", "min_speed", "time_yielding")}

# %% [markdown]
# ## As the paper says?

# %%
for claim in scenario.claims:
    page.claim(claim.text, *claim.check(log))

# %%
figure = scenes.plot_run(log, title="The robot backs out, stands aside, and goes on")
page.figure(figure, "run")
figure

# %%
log.min_h().to_frame("smallest h [m]").round(3)

# %% [markdown]
# **What it means.** The zone moves with the person, and h falls even for a robot at rest: the
# only controls that obey the barrier condition lead backwards. Making room needs no rule of its
# own.

# %%
page.close()

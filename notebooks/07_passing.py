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
# # 7 - Passing a person who stands
#
# **Question.** A person stands in the way and looks at the robot. What does the robot do, and
# when does it begin?
#
# **Expectation.** The paper: the robot goes around in good time, and begins farther away when it
# comes from the front than when it comes from behind, because the zone reaches farther ahead.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [6 - Barriers](06_barriers.ipynb) · next: [8 - Meeting in a narrow
# corridor](08_corridor.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4, fig. 6a · 10 min to read
#
# **Afterwards you can** say when the robot begins to avoid a person, and what chooses the side.
#
# **Words.** *IPOPT*: the solver for nonlinear optimisation that the paper uses; *slack*: by how much a row
# is violated; *SQP*: sequential quadratic programming: solve quadratic problems in a row, each around the
# last answer.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import pandas as pd

import szlib
from szlib.simulation.metrics import avoidance_start
from szlib.workbook import figures
from szlib.workbook.record import NotebookRecord, settings_table

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05
interactive = False  # True: a slider for gamma

# %%
record = NotebookRecord("07_passing", globals())
settings = szlib.MPCSettings(gamma=gamma)
settings_table(settings)

# %% [markdown]
# ## The problem, ten times a second (eq. 2)
#
# With $\mathbf{e}_k = \mathbf{x}_k - \mathbf{x}_{goal}$:
#
# $$\min_{\mathbf{u}}\; \mathbf{e}_N^\top P\,\mathbf{e}_N + \sum_{k=1}^{N-1}\mathbf{e}_k^\top Q\,\mathbf{e}_k
#   + \sum_{k=0}^{N-1}\mathbf{u}_k^\top R\,\mathbf{u}_k$$
#
# subject to the dynamics (eq. 8)
#
# $$\mathbf{p}_{k+1} = \mathbf{p}_k + \Delta t\,\mathbf{v}_k + \tfrac12\Delta t^2\,\mathbf{u}_k, \quad
#   \mathbf{v}_{k+1} = \mathbf{v}_k + \Delta t\,\mathbf{u}_k$$
#
# to $|a_x|, |a_y| \le 1$ m/s², $\|\mathbf{v}\| \le 1$ m/s, and to the barrier condition (eq. 1)
# for every person and wall over the first $N_h$ steps. `MPCCBF` builds it once; `step` solves it
# for the present state.
#
# Ours, not the paper's: while the goal lies behind a person met head-on, the robot is drawn to a
# point beside that person on `pass_side` (parameter `tie`); and a step without a solution is
# solved again with penalised slack, flagged and counted.

# %%
zone = record.zone().ellipse(settings.zone_speed)
scenario = szlib.SCENARIOS["passing"]
controller = szlib.MPCCBF(zone, walls=scenario.walls, settings=settings)
step = controller.step(scenario.start, scenario.goal, scenario.people)
print(f"first acceleration {step.control.round(3)} m/s2, {step.status}")

# %%
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
# ## Did it keep its promises?

# %%
record.check("the goal is reached", metrics["success"])
record.check("h >= 0 at every step", metrics["min_h"] >= 0, metrics["min_h"])
record.check("no infeasible step", metrics["infeasible_steps"] == 0, metrics["infeasible_steps"])
record.check("nothing is touched (Euclidean)", metrics["min_clearance"] > 0, metrics["min_clearance"])
record.check("never faster than 1 m/s", metrics["max_speed"] <= 1 + 1e-6, metrics["max_speed"])
record.key |= {name: metrics[name] for name in ("time_to_goal", "min_h", "min_clearance", "min_speed")}
for claim in scenario.claims:
    record.claim(claim.text, *claim.check(log))

# %%
fig, (upper, lower) = plt.subplots(2, 1, figsize=(8, 4.5), sharex=True, layout="constrained")
figures.plot_speed(log, ax=upper).set(title="The robot hardly slows down: there is room", xlabel="")
figures.plot_barriers(log, ax=lower)
record.figure(fig, "run")

# %% [markdown]
# ## From the front, from behind
#
# The same meeting with the person turned around: avoidance *starts* where the robot is 10 cm off
# the straight line.

# %%
behind = szlib.simulate(scenario.turned(), controller)
starts = {name: avoidance_start(run) for name, run in (("head-on", log), ("from behind", behind))}
pd.DataFrame(starts, index=["distance to the person [m]", "h [m]"]).round(3)

# %%
ax = figures.plot_robot_paths({"head-on": log, "from behind": behind})
ax.set_title("Nearly the same path, begun a little earlier or later")
record.figure(ax.figure, "head-on-or-behind")

# %% [markdown]
# ## Left or right
#
# Exactly head-on both ways around are equally long. A solver that is not told which to take may
# stop in front of the person for ever and report success at every step, or be tipped to one side
# by rounding. So the side is a parameter. (The paper's robot passes on the right; here it is
# *told* to.)

# %%
sides = {}
for side in ("right", "left"):
    other = szlib.MPCCBF(zone, walls=scenario.walls, settings=replace(settings, pass_side=side))
    sides[side] = szlib.simulate(scenario, other)
    record.check(f"asked for {side}, passes on the {side}", sides[side].metrics()["passing_side"] == side)
ax = figures.plot_robot_paths(sides)
ax.set_title("pass_side decides")
record.figure(ax.figure, "sides")


# %%
def run_with(gamma: float) -> None:
    other = szlib.MPCCBF(zone, walls=scenario.walls, settings=replace(settings, gamma=gamma))
    szlib.simulate(scenario, other).plot()


if interactive:
    from ipywidgets import FloatSlider, interact

    interact(run_with, gamma=FloatSlider(gamma, min=0.01, max=0.2, step=0.01))

# %% [markdown]
# **What it means.** The minimum zone is a last boundary. With gamma = 0.05 the robot gives way
# long before it, as the barrier turns distance into a speed limit. Head-on or from behind makes a
# difference of centimetres, for the zone is that much longer at one end: nobody would see it.

# %%
record.close()

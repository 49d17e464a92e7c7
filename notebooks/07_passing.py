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
# **Question.** A person stands in the way and looks at the robot. When does the robot begin to go around
# them, and what decides that?
#
# **Expectation.** The paper: the robot goes around in good time, and begins farther away when it
# comes from the front than when it comes from behind, because the zone reaches farther ahead.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [6b - Build the controller yourself](06b_build_a_controller.ipynb)
# · next: [8 - Meeting in a narrow corridor](08_corridor.ipynb) · [paper](https://arxiv.org/abs/2405.15101):
# sec. 4, fig. 6a · 15 min to read
#
# **Afterwards you can** say when the robot begins to avoid a person, and what chooses the side.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import Markdown

import szlib
from szlib.simulation.metrics import find_avoidance_start
from szlib.workbook import figures, laboratory
from szlib.workbook.record import NotebookRecord, settings_table

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05
N = 8
N_h = 2
a_max = 1.0  # m/s2

# %%
record = NotebookRecord("07_passing", globals())
settings = szlib.MPCSettings(gamma=gamma, N=N, N_h=N_h, a_max=a_max)
settings_table(settings)

# %% [markdown]
# ## The run
#
# The controller is that of notebook 06b. Numbers in the figure are times in s: where the robot is at 4, the
# person is at 4, too.

# %%
zone = record.cache.ellipse()
scenario = szlib.SCENARIOS["passing"]
controller = szlib.MPCCBF(zone, walls=scenario.walls, settings=settings)
log = szlib.simulate(scenario, controller)
metrics = log.metrics()
pd.Series(metrics).filter(regex="^(?!solve_time)").to_frame("value")  # all but the machine's times

# %%
ax = log.plot()
record.figure(ax.figure, "scenario")

# %%
record.animation(movie := log.animate(), "run")
movie

# %%
record.check("the goal is reached", metrics["success"])
record.check("h >= 0 at every step", metrics["min_h"] >= 0, metrics["min_h"])
record.check("no infeasible step", metrics["infeasible_steps"] == 0, metrics["infeasible_steps"])
record.check("nothing is touched (Euclidean)", metrics["min_clearance"] > 0, metrics["min_clearance"])
record.check("never faster than 1 m/s", metrics["max_speed"] <= 1 + 1e-6, metrics["max_speed"])
record.key |= {name: metrics[name] for name in ("time_to_goal", "min_h", "min_clearance", "min_speed")}

# %%
for claim in scenario.claims:
    record.claim(claim.text, *claim.check(log))

# %% [markdown]
# ## What decides when it begins
#
# The barrier allows $h$ to fall by $\gamma h$ a step, that is, the robot and the zone may come closer by
# $\gamma h / \Delta t$ metres a second. Draw how fast they do against $h$: a run starts on the right, far
# away, and moves to the left. Far away the limit does not matter. Where the run meets the line, it begins to
# turn, and from there on it goes down along it.

# %%
behind = szlib.simulate(scenario.turn_people(), controller)
fig, ax = plt.subplots(figsize=(8.5, 4), layout="constrained")
for (name, run), line in zip({"head-on": log, "from behind": behind}.items(), ("-", "--"), strict=True):
    h = run.h[:, 0]
    ax.plot(h[:-1], -np.diff(h) / settings.dt, line, color=figures.BLUE, label=f"the robot, {name}")
limit = np.array([0.0, log.h.max()])
ax.plot(limit, gamma * limit / settings.dt, color=figures.RED, linewidth=1, label="limit: gamma h / dt")
ax.set(xlabel="h [m]", ylabel="h falls by [m/s]", ylim=(-1.2, 1.2))
ax.set_title("From right to left: free, then held; then away")
ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=9)
record.figure(fig, "limit")

# %%
turns = float(log.time[np.argmax(np.abs(log.controls[:, 1]) > 0.5 * a_max)])
step = controller.step(*log.controller_inputs(turns))
record.figure(figures.draw_step(step), "admissible")

# %% [markdown]
# This is the instant at which it begins to turn. On the right are all accelerations that obey every row of
# the problem with the rest of the plan kept: what lies in the direction of the person is gone, but *aside* is
# as free as ever. So it need not stop: it turns. (A curved edge is the speed limit.)

# %%
Markdown(
    f"It happens at {turns:.1f} s, with h = {step.h[0]:.2f} m; at full speed the limit is met at "
    f"v dt / gamma = {settings.v_max * settings.dt / gamma:.2f} m. The least h of the run is "
    f"{metrics['min_h']:.2f} m."
)

# %% [markdown]
# ## From the front, from behind
#
# The same meeting with the person turned around: avoidance *starts* where the robot is 10 cm off
# the straight line.

# %%
starts = {name: find_avoidance_start(run) for name, run in (("head-on", log), ("from behind", behind))}
pd.DataFrame(starts, index=["distance to the person [m]", "h [m]"]).round(3)

# %%
earlier = 100 * (starts["head-on"][0] - starts["from behind"][0])
ax = figures.plot_robot_paths({"head-on": log, "from behind": behind})
ax.set_title(f"Head-on, avoidance starts {earlier:.0f} cm farther away")
record.figure(ax.figure, "head-on-or-behind")

# %% [markdown]
# ## Left or right
#
# Exactly head-on both ways around are equally long. A solver that is not told which to take may
# stop in front of the person for ever and report success at every step, or be tipped to one side
# by rounding. So the side is a parameter, `pass_side`: while the goal lies behind somebody met head-on, the
# robot is drawn to a point beside them. (The paper's robot passes on the right; here it is *told* to.)
#
# When must it be told? Before its plan meets the zone. A zone that was learned is never quite straight, and
# once the plan touches it, a tilt of three thousandths of a radian is enough to choose. With a small gamma
# the barrier is felt long before, at $h = v\,\Delta t/\gamma$; with gamma = 0.4 that would be 0.25 m, when a
# plan of 0.8 s has long been turned. So the rule begins at whichever is farther.

# %%
sides = {}
for other_gamma in (gamma, 0.4):
    for side in ("right", "left"):
        changed = replace(settings, gamma=other_gamma, pass_side=side)
        run = szlib.simulate(scenario, szlib.MPCCBF(zone, walls=scenario.walls, settings=changed))
        sides[f"{side}, gamma = {other_gamma:g}"] = run
        passed = run.metrics()["passing_side"]
        record.check(f"asked for {side}, passes on the {side}, gamma = {other_gamma:g}", passed == side)

# %%
ax = figures.plot_robot_paths(sides)
kept = all(run.metrics()["passing_side"] in name for name, run in sides.items())
ax.set_title("pass_side decides" if kept else "pass_side does not always decide")
record.figure(ax.figure, "sides")

# %% [markdown]
# ## Where gamma = 0.05 comes from
#
# The paper gives no gamma. Here are its four scenarios against it: time to the goal, least $h$, and steps
# without a solution (with $N_h$ = 2, as in the paper). A small gamma is slow. With a large one the robot may
# drive up so fast that two steps later there is no acceleration that saves it.

# %%
GAMMAS = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.4)
rows = []
for name, scene in szlib.SCENARIOS.items():
    for each in GAMMAS:
        other = szlib.MPCCBF(zone, walls=scene.walls, settings=replace(settings, gamma=each))
        found = szlib.simulate(scene, other).metrics()
        rows.append((name, each, *(found[key] for key in ("time_to_goal", "min_h", "infeasible_steps"))))
sweep = pd.DataFrame(
    rows, columns=["scenario", "gamma", "time to goal [s]", "least h [m]", "infeasible steps"]
)
sweep.pivot(index="gamma", columns="scenario", values="infeasible steps")

# %%
fig, panels = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
for ax, what in zip(panels, sweep.columns[2:], strict=True):
    for marker, (name, rows) in zip("os^D", sweep.groupby("scenario", sort=False), strict=True):
        ax.plot(rows["gamma"], rows[what], f"{marker}-", markersize=5, label=name)
    ax.axvline(gamma, color=figures.GREY, linestyle=":")
    ax.axhline(0, color=figures.GREY, linewidth=0.8)
    ax.set(xscale="log", xlabel="gamma", ylabel=what)
    ax.set_xticks([0.02, 0.05, 0.1, 0.2, 0.4], ["0.02", "0.05", "0.1", "0.2", "0.4"], minor=False)
    ax.minorticks_off()
panels[0].set_title("Too small is slow")
panels[2].set_title("Too large has no way out")
figures.add_shared_legend(panels)
record.figure(fig, "gamma")

# %%
clean = sweep.groupby("gamma").agg(
    {"infeasible steps": "sum", "least h [m]": "min", "time to goal [s]": "max"}
)
usable = clean[(clean["infeasible steps"] == 0) & (clean["least h [m]"] >= 0)]
record.check("gamma is among those without an infeasible step in any scenario", gamma in usable.index)
record.key["largest gamma without an infeasible step"] = float(usable.index.max())
Markdown(
    f"Without an infeasible step in any scenario: gamma up to {usable.index.max():g}. The next, "
    f"{clean.index[clean.index > usable.index.max()].min():g}, has some. Slowest scenario with "
    + ", ".join(f"{g:g}: {s:.0f} s" for g, s in usable["time to goal [s]"].items())
    + "."
)


# %%
def run_with(gamma: float) -> None:
    other = szlib.MPCCBF(zone, walls=scenario.walls, settings=replace(settings, gamma=gamma))
    szlib.simulate(scenario, other).plot()


laboratory.show_sliders(run_with, gamma=(gamma, 0.01, max(0.2, gamma), 0.01))

# %% [markdown]
# **What it means.** The minimum zone is a last boundary. The robot gives way long before it, as the
# barrier turns distance into a speed limit, and gamma says how long before. Whether the person faces the
# robot or turns their back changes the start by as much as the zone is longer at one end, which is too
# little to be noticed.

# %%
record.close()

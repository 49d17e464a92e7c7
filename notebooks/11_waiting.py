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
# # 11 - Yielding by waiting
#
# **Question.** A passage is too narrow for two, and a person is in it. The robot has no rule of priority.
# Why does it wait, and what does waiting look like to a solver?
#
# **Expectation.** The paper: the robot waits outside until the person is through, then it goes.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [10](10_corridor.ipynb) · next: [11b - Yielding by making
# room](11b_making_room.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4, fig. 6c · 35 min · needs
# [10](10_corridor.ipynb) · exercises:
# [6.4-6.5](exercises/sheet6_robot.ipynb#6.4-Predict,-then-run-(20-min)) · laboratory:
# [13](13_laboratory.ipynb)
#
# **Afterwards you can** say why the robot waits, although no rule tells it to.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import Markdown
from studies import paper_claims
from studies.atlas import AtlasCell

import szlib
from szlib.control.acceleration_polygon import find_admissible_controls
from szlib.simulation.metrics import find_yielding_steps
from szlib.simulation.strategies import classify_strategy
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, TUNED, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05
N = 8
N_h = 2
a_max = 1.0  # m/s2
width = 2.0  # of the passage, m
pace = 0.5  # of the person, m/s

# %%
record = NotebookRecord("11_waiting", globals())
settings = szlib.MPCSettings(gamma=gamma, N=N, N_h=N_h, a_max=a_max)
scenario = AtlasCell("waiting", width=width, pace=pace).scenario()
parameters(
    [
        ("person's speed", f"{pace} m/s", PAPER, "constant, known exactly, unaffected by the robot"),
        ("passage", f"{width} m", ASSUMED, "the paper shows walls without numbers"),
        ("N, N_h, dt", f"{settings.N}, {settings.N_h}, {settings.dt} s", PAPER, "sec. 4"),
        ("gamma", gamma, TUNED, "on these four scenarios; in 2,000 other worlds: notebook 09"),
        ("a_max; Q, R, P", f"{a_max} m/s²; as in notebook 09", ASSUMED, "the paper gives none"),
        (
            "head_on_share",
            settings.head_on_share,
            ASSUMED,
            "ours; 0 in the paper's chain: the rule of the side acts while the goal lies within this share of the "
            "half-angle under which the robot sees the zone, and fades out up to twice that",
        ),
    ]
)

# %% [markdown]
# ## The paper's chain, as it comes out
#
# First everything as the paper has it: its zone (outliers by LOF, hull, slice, smallest ellipse) and its
# controller (IPOPT, 5 cm of margin around every wall, no rule of the side). The paper does not give gamma, Q, R, P
# and a_max: they are ours.

# %%
paper_zone = record.cache.paper_ellipse()
paper = szlib.MPCSettings.paper(gamma=gamma, N=N, N_h=N_h, a_max=a_max)
paper_log = szlib.simulate(scenario, szlib.MPCCBF(paper_zone, walls=scenario.walls, settings=paper))
claims = paper_claims.record_claims(record, scenario.claims, paper_log)
honest = paper_log.metrics()["unflagged_violations"] == 0
record.check("the paper's chain: no step that called itself safe led to h < 0", honest, always=True)
Markdown(paper_claims.describe_run(paper_log, claims))

# %% [markdown]
# In this scene the robot starts beside the passage, so there is no symmetry to break, and no side to choose.

# %% [markdown]
# ## The run
#
# From here on the robot is ours: `MPCSettings()`, and the *quantile zone* of notebook 05. Here they are beside the
# paper's.

# %%
zone = record.cache.ellipse()
rows = {"paper": [*paper_zone.center, *paper_zone.semi_axes], "ours": [*zone.center, *zone.semi_axes]}
sizes = ["centre ahead [m]", "centre to the left [m]", "semi-axis a [m]", "semi-axis b [m]"]
pd.DataFrame(rows, index=sizes).round(2)

# %%
controller = szlib.MPCCBF(zone, walls=scenario.walls, settings=settings)
log = szlib.simulate(scenario, controller)
metrics = log.metrics()
both = pd.DataFrame({"the paper's chain": paper_log.metrics(), "ours": metrics})
both.filter(regex="^(?!solve_time)", axis="index")  # all but the machine's times

# %%
ax = log.plot()
record.figure(ax.figure, "scenario")

# %%
record.animation(movie := log.animate(), "run")
movie

# %% [markdown]
# ## Safe, and as the paper says?
#
# The promises that must hold with any zone that leaves the scene passable, and the claims of the paper for ours.

# %%
record.check("the goal is reached", metrics["success"])
record.check("h >= 0 at every step", metrics["min_h"] >= 0, metrics["min_h"])
record.check("no infeasible step", metrics["infeasible_steps"] == 0, metrics["infeasible_steps"])
record.check("nothing is touched (Euclidean)", metrics["min_clearance"] > 0, metrics["min_clearance"])
record.check("never faster than 1 m/s", metrics["max_speed"] <= 1 + 1e-6, metrics["max_speed"])
record.key |= {name: metrics[name] for name in ("time_to_goal", "min_h", "min_speed", "time_yielding")}

# %%
paper_claims.record_claims(record, scenario.claims, log, prefix="ours: ")

# %% [markdown]
# ## Who is in the passage when
#
# Time runs to the right, the passage lies across. Where the grey band holds only one line at a time, nobody
# met in it.

# %%
fig, ax = plt.subplots(figsize=(8, 4), layout="constrained")
ax.axhspan(0, 3, color=figures.GREY, alpha=0.25, label="inside the passage")
ax.plot(log.time, log.states[:, 0], color=figures.BLUE, linewidth=2, label="robot")
x = log.people[:, 0, 0]
ax.plot(log.time, x, "--", color=figures.RED, label="person")
reach = zone.semi_axes[0]
ax.fill_between(log.time, x - reach, x + reach, color=figures.RED, alpha=0.15, lw=0, label="zone")
out_first, between = scenario.claims[1].check(log)
title = (
    f"The robot enters {between:.1f} s after the person has left" if out_first else "Both are inside at once"
)
ax.set(xlabel="time [s]", ylabel="x [m]", title=title)
ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1))
record.figure(fig, "space-time")

# %% [markdown]
# ## What waiting looks like
#
# `time_yielding` counts the time without progress while the person's barrier holds the robot. From the middle
# of it, one step:

# %%
waits = np.flatnonzero(find_yielding_steps(log))
middle = float(log.time[waits[len(waits) // 2] if len(waits) else log.speed[10:].argmin() + 10])
step = controller.step(*log.controller_inputs(middle))
record.figure(figures.draw_step(step), "admissible")

# %%
ahead = find_admissible_controls(step).polygon.bounds[2]
record.check(
    "while the robot waits, no admissible acceleration leads towards the passage", ahead < 0.1, ahead
)
Markdown(
    f"At {middle:.1f} s: h is {step.h[0]:.2f} m to the person, and {step.h[1:].min():.2f} m to the "
    f"nearest wall; the largest admissible acceleration ahead is {ahead:+.2f} m/s²."
)

# %% [markdown]
# With the default settings two edges close the way. The person's zone forbids what leads to the mouth, and
# the wall beside the mouth what leads straight on. What is left points back and aside, and the chosen one is
# the tip that is nearest to the goal. That is all that waiting is: a corner of the polygon near zero. The
# robot hardly ever stands; it creeps up, is moved aside as the zone comes out, and comes back behind it.

# %% [markdown]
# ## Who goes first?
#
# Let the person begin farther away, so that the robot is at the passage before them.

# %%
rows, runs = [], {}
for start in (4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0):
    person = szlib.Person((start, 0.0), (-pace, 0.0))
    scene = replace(scenario, people=(person,))
    run = runs[start] = szlib.simulate(scene, szlib.MPCCBF(zone, walls=scene.walls, settings=settings))
    both = (run.states[:, 0] > 0) & (run.people[:, 0, 0] > 0)
    found = run.metrics()
    numbers = (found[name] for name in ("time_yielding", "time_to_goal", "min_h"))
    rows.append((start, classify_strategy(run), bool(both.any()), *numbers))
columns = ["person from x [m]", "robot", "in before they are out", "yields [s]", "to goal [s]", "least h [m]"]
firsts = pd.DataFrame(rows, columns=columns)
firsts.style.format(precision=2).hide(axis="index")

# %%
fig, ax = plt.subplots(figsize=(8, 4), layout="constrained")
ax.axhspan(0, 3, color=figures.GREY, alpha=0.25, label="inside the passage")
for (start, run), colour in zip(runs.items(), figures.pick_colours(list(runs)), strict=True):
    ax.plot(run.time, run.states[:, 0], color=colour, label=f"robot, person from {start:g} m")
    ax.plot(run.time, run.people[:, 0, 0], "--", color=colour, linewidth=0.8)
ahead = firsts.loc[firsts["robot"] == "goes ahead", "person from x [m]"]
title = (
    f"The robot goes first if the person starts at {ahead.min():g} m or farther"
    if len(ahead)
    else "It never goes first"
)
ax.set(xlabel="time [s]", ylabel="x [m]", title=f"{title} (person dashed)")
ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=8)
record.figure(fig, "who-first")

# %% [markdown]
# **What it means.** There is no rule about who goes first. The robot has no idea of a passage; it sees 0.8 s
# ahead, a zone and some walls. It goes in where at that moment nothing holds it, and where the person then
# comes it has to go back (notebook 11b). A plan over the whole passage would know better.

# %%
record.close()

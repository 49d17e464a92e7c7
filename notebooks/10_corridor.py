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
# # 10 - Meeting in a narrow corridor
#
# **Question.** A person walks towards the robot in a corridor. There is room for both, but not much. Who
# slows the robot down: the person, or the wall?
#
# **Expectation.** The paper: the robot slows down while it passes, because between the wall and
# the zone the barrier leaves little speed.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [09](09_passing.ipynb) · next: [11 - Yielding: waiting and making
# room](11_waiting.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4, fig. 6b · 35 min · needs
# [09](09_passing.ipynb) · laboratory: [13](13_laboratory.ipynb)
#
# **Afterwards you can** say why the robot slows down in a corridor, and speeds up beside the person.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import Markdown
from studies import paper_claims
from studies.atlas import AtlasCell

import szlib
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
width = 4.6  # of the corridor, m
pace = 0.5  # of the person, m/s

# %%
record = NotebookRecord("10_corridor", globals())
settings = szlib.MPCSettings(gamma=gamma, N=N, N_h=N_h, a_max=a_max)
scenario = AtlasCell("corridor", width=width, pace=pace).scenario()
parameters(
    [
        ("person's speed", f"{pace} m/s", PAPER, "constant, known exactly, unaffected by the robot"),
        ("corridor", f"{width} m", ASSUMED, "the paper shows walls without numbers"),
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
# The side, again, is that of the zone's tilt (notebook 09): nothing in the paper's problem prefers one. That it slows
# down is due to the barriers, of the person and of the wall.

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
passed = metrics["passing_side"]
record.check("our robot passes on the chosen side", passed == settings.pass_side, passed)

# %% [markdown]
# ## Who holds it, and when
#
# A row of the problem *holds* the robot where it leaves nothing over: then the acceleration would be another
# without it. Above the robot's speed; below, who holds it when.

# %%
holds = {"person": log.residual[:, 0], "wall to its left": log.residual[:, 1]}
holds["wall to its right"] = log.residual[:, 2]
fig, (upper, lower) = plt.subplots(
    2, 1, figsize=(8, 4.5), sharex=True, layout="constrained", height_ratios=[2, 1]
)
figures.plot_speed(log, ax=upper).set(xlabel="")
for y, left in enumerate(holds.values()):
    when = log.time[left.min(axis=1) <= 1e-4]
    lower.plot(when, np.full(len(when), y), "s", color=figures.BLACK, markersize=4)
lower.set(xlabel="time [s]", ylim=(-0.5, 2.5), title="Who holds it back")
lower.set_yticks(range(3), holds)
record.figure(fig, "holds")

# %%
slow = int(log.speed[10 : np.abs(log.people[:, 0, 0] - log.states[:, 0]).argmin()].argmin()) + 10
step = controller.step(*log.controller_inputs(float(log.time[slow])))
record.figure(figures.draw_step(step), "admissible")

# %% [markdown]
# The instant at which it is slowest before they are abeam. With the default settings person and wall leave a
# corner of the accelerations between them, and the chosen one sits in its tip: the person's row forbids what
# leads nearer to the zone, the wall's what leads aside, and of the way ahead little is left.

# %%
share = {name: float(np.mean(left.min(axis=1) <= 1e-4)) for name, left in holds.items()}
Markdown(
    f"Slowest at {log.time[slow]:.1f} s with {log.speed[slow]:.2f} m/s; h is {step.h[0]:.2f} m to the "
    f"person and {step.h[1:].min():.2f} m to the nearer wall. Share of the run in which each holds it: "
    + ", ".join(f"{name} {100 * part:.0f} %" for name, part in share.items())
    + "."
)

# %% [markdown]
# ## How wide must a corridor be?
#
# The same meeting in other corridors.

# %%
WIDTHS = (3.4, 3.8, 4.2, 4.6, 5.0, 5.6, 6.4, 8.0)
runs = {}
for each in WIDTHS:
    scene = AtlasCell("corridor", width=each, pace=pace).scenario()
    runs[each] = szlib.simulate(scene, szlib.MPCCBF(zone, walls=scene.walls, settings=settings))
rows = [
    (classify_strategy(run), run.metrics()["min_speed"], run.metrics()["time_to_goal"])
    for run in runs.values()
]
table = pd.DataFrame(rows, index=list(runs), columns=["robot", "slowest [m/s]", "to goal [s]"])
table.rename_axis("width [m]").style.format(precision=2).format_index("{:.1f}")

# %%
fig, ax = plt.subplots(figsize=(7, 3.5), layout="constrained")
ax.plot(table.index, table["slowest [m/s]"], "o-", color=figures.BLUE, label="slowest [m/s]")
other = ax.twinx()
other.plot(table.index, table["to goal [s]"], "s--", color=figures.ORANGE, label="time to goal [s]")
ax.axvline(width, color=figures.GREY, linestyle=":")
ax.set(
    xlabel="width of the corridor [m]",
    ylabel="slowest speed [m/s]",
    title="The wider the corridor, the faster the robot",
)
other.set_ylabel("time to goal [s]")
fig.legend(loc="outside lower center", ncols=2)
record.figure(fig, "widths")

# %% [markdown]
# **What it means.** The robot slows down because two rows hold at once, the person's and the wall's, in the
# paper's chain and in ours. Neither alone would slow it so much: beside a person in the open it is faster
# (notebook 09), and a wall lets it drive along. Together they leave it a slow way, and once abeam, the way opens
# and it drives on. The side on which it passes is another matter: in ours a rule decides it.

# %%
record.close()

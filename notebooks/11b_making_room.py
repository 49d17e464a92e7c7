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
# # 11b - Yielding by making room
#
# **Question.** This time the robot is *in* the passage when the person comes. It wants to go ahead. What
# makes it go back?
#
# **Expectation.** The paper: the robot gives way first - here it must back out - and goes on
# afterwards.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [11](11_waiting.ipynb) · next: [12 - Other people's
# crowds](12_among_people.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4, fig. 6d · 45 min ·
# laboratory: [13](13_laboratory.ipynb)
#
# **Afterwards you can** say why the robot backs out of a passage, although no rule tells it to.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import Markdown
from studies import chains as chains_study
from studies import paper_claims
from studies.atlas import AtlasCell

import szlib
from szlib.control.acceleration_polygon import find_admissible_controls
from szlib.simulation.strategies import classify_strategy, compute_retreat
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
record = NotebookRecord("11b_making_room", globals())
settings = szlib.MPCSettings(gamma=gamma, N=N, N_h=N_h, a_max=a_max)
scenario = AtlasCell("making_room", width=width, pace=pace).scenario()
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
# It makes room on one side of the entrance. Which one is due to the zone's tilt, as in notebook 09, and no claim.

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

# %%
fig, ax = plt.subplots(figsize=(8, 4), layout="constrained")
ax.axhspan(0, 3, color=figures.GREY, alpha=0.25, label="inside the passage")
ax.plot(log.time, log.states[:, 0], color=figures.BLUE, linewidth=2, label="robot")
x = log.people[:, 0, 0]
ax.plot(log.time, x, "--", color=figures.RED, label="person")
reach = zone.semi_axes[0]
ax.fill_between(log.time, x - reach, x + reach, color=figures.RED, alpha=0.15, lw=0, label="zone")
ax.set(
    xlabel="time [s]",
    ylabel="x [m]",
    title=f"It goes back by {compute_retreat(log):.1f} m, stands aside, and goes on",
)
ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1))
record.figure(fig, "space-time")

# %% [markdown]
# ## A speed limit below zero
#
# $h$ may fall by $\gamma h / \Delta t$ a second. The person alone uses up `pace` of that, as they come nearer
# whatever the robot does. What is left for the robot is $\gamma h / \Delta t$ less their pace: zero at
# $h = $ pace $\cdot\,\Delta t / \gamma$, and *negative* nearer than that. A robot that stands still there
# breaks the condition; the least that it may do is to go back.

# %%
h, back = log.h[:, 0], -log.states[:, 2]
until = int(np.argmax(log.states[:, 0] < 0))
stand = pace * settings.dt / gamma
fig, ax = plt.subplots(figsize=(7, 4), layout="constrained")
ax.plot(h[:until], log.states[:until, 2], color=figures.BLUE, linewidth=2, label="robot, until it is out")
line = np.array([0.0, 1.2 * h[:until].max()])
ax.plot(line, gamma * line / settings.dt - pace, color=figures.RED, label="gamma h / dt - pace")
ax.axhline(0, color=figures.GREY, linewidth=0.8)
ax.axvline(stand, color=figures.GREY, linestyle=":", label=f"h = {stand:.2f} m: stand still")
ax.set(xlabel="h to the person [m]", ylabel="speed ahead [m/s]", xlim=(0, line[1]), ylim=(-0.8, 0.8))
ax.set_title("From right to left: on, slower, back")
ax.legend(loc="lower right")
record.figure(fig, "below-zero")

# %% [markdown]
# From the moment at which it turns back, one step, with all accelerations that obey every row:

# %%
turns = float(log.time[np.argmax(log.states[:, 2] < -0.02)])
step = controller.step(*log.controller_inputs(turns))
record.figure(figures.draw_step(step), "admissible")

# %%
ahead = find_admissible_controls(step).polygon.bounds[2]
record.check("as the robot turns back, every admissible acceleration leads back", ahead < 0, ahead)
Markdown(
    f"At {turns:.1f} s, h = {step.h[0]:.2f} m: the gentlest of them is {ahead:.2f} m/s². "
    f"The rule of thumb above says: back from h = {stand:.2f} m on."
)

# %% [markdown]
# ## How fast may the person come?
#
# The robot must go back as fast as they come, and be out of the way in time.

# %%
rows = []
for each in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2):
    scene = AtlasCell("making_room", width=width, pace=each).scenario()
    run = szlib.simulate(scene, szlib.MPCCBF(zone, walls=scene.walls, settings=settings))
    found = run.metrics()
    numbers = (found[name] for name in ("min_h", "infeasible_steps", "time_to_goal"))
    rows.append((each, classify_strategy(run), compute_retreat(run), *numbers))
columns = ["pace [m/s]", "robot", "goes back [m]", "least h [m]", "infeasible steps", "to goal [s]"]
paces = pd.DataFrame(rows, columns=columns)
paces.style.format(precision=2).hide(axis="index")

# %%
fig, ax = plt.subplots(figsize=(7, 3.4), layout="constrained")
safe = paces["infeasible steps"] == 0
ax.plot(paces["pace [m/s]"], paces["least h [m]"], "-", color=figures.GREY, linewidth=1)
for some, marker, label in ((safe, "o", "every step has a plan"), (~safe, "X", "some steps have none")):
    shown = paces[some]
    ax.plot(shown["pace [m/s]"], shown["least h [m]"], marker, markersize=8, label=label)
ax.axhline(0, color=figures.BLACK, linewidth=0.8)
nearest = paces.loc[paces["least h [m]"].idxmin(), "pace [m/s]"]
ax.set(
    xlabel="pace of the person [m/s]",
    ylabel="least h [m]",
    title=f"Least h for a person who walks at {nearest:g} m/s",
)
ax.legend()
record.figure(fig, "paces")

# %%
failing = paces.loc[~safe, "pace [m/s]"]
Markdown(
    "Every step had a plan up to the fastest tried."
    if failing.empty
    else f"The slowest person for whom some step had no plan walks at {failing.min():g} m/s."
)

# %% [markdown]
# ## All four scenarios: what is due to what?
#
# Notebooks 09 to 11b drove each scenario twice. Between the paper's chain and ours are four differences: the solver,
# the zone, the margin around walls, and the rule of the side. Which of them do you expect to change the run, and in
# which scenario? Here each is switched on alone, from the paper's chain. (The last three with the SQP, which is six
# times as fast; the row "solver" says what that changes.) Each entry is: time to the goal, least h, least speed,
# passing side, claims of the paper that hold (s, m, m/s).

# %%
chains = chains_study.compare_chains((paper_zone, paper), (zone, settings))
record.table(chains, "10_chains")
entries = [
    f"{r.time_to_goal:.1f}, {r.min_h:.2f}, {r.min_speed:.2f}, {r.passing_side}, {r.claims_held}/{r.claims}"
    for r in chains.itertuples()
]
names, order = list(szlib.SCENARIOS), list(chains["chain"].unique())
chains.assign(entry=entries).pivot(index="chain", columns="scenario", values="entry").loc[order, names]

# %%
found = chains.set_index(["chain", "scenario"])
singles = ("solver", "zone", "margin", "side rule")
effects = {name: [each for each in singles if found.loc[(each, name), "changed"]] for name in names}
record.check("the solver alone changes no scenario", not found.loc["solver", "changed"].any(), effects)
ruled = found.loc["side rule", "passing_side"][["passing", "corridor"]]
on_side = bool((ruled == settings.pass_side).all())
record.check("the rule alone makes the robot pass on the chosen side", on_side, ruled.to_dict())
lowest = chains.groupby("chain", sort=False)["min_h"].min()
record.check("h >= 0 with every chain of settings", lowest.min() >= 0, f"least h {lowest.min():.2f} m")

# %%
units = {"time_to_goal": ("time to the goal", " s"), "min_h": ("least h", " m")}
units["min_speed"] = ("least speed", " m/s")
rest = (found.loc["ours", list(units)] - found.loc["side rule", list(units)]).abs().max()
lines = {name: f"- {name}: {', '.join(which) or 'nothing'}" for name, which in effects.items()}
for name in (name for name in names if "side rule" in effects[name]):
    old, new = found.loc[("paper", name)], found.loc[("side rule", name)]
    moved = [key for key in units if abs(new[key] - old[key]) > chains_study.RESOLUTION[key]]
    parts = [f"{units[key][0]} {old[key]:.2f} to {new[key]:.2f}{units[key][1]}" for key in moved]
    parts += [f"passing side {old['passing_side']} to {new['passing_side']}"]
    lines[name] += f"; with it {', '.join(parts)}"
Markdown(
    "Switched on alone, this changes the run:\n\n"
    + "\n".join(lines.values())
    + "\n\nWhat the rule of the side changes in ours "
    "does not come from the barrier. With that rule alone the paper's chain drives like ours, but for at most "
    + ", ".join(f"{value:.2g}{units[key][1]} ({units[key][0]})" for key, value in rest.items())
    + "."
)

# %% [markdown]
# **What it means.** Making room needs no rule of its own. The zone moves with the person, and $h$ falls even
# for a robot at rest: near enough, the only controls that obey the barrier lead backwards.

# %%
record.close()

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
# # 26 - Eleven meetings
#
# **Question.** Robots that drive among people are tried in named meetings: head-on, in a doorway, around a
# corner. What does the controller do in each, against what others would use - and where is it bad?
#
# **Expectation.** It comes into nobody's zone, for that is what it is made for; the others pass closer and
# sooner. It looks ahead no farther than 0.8 s and plans no way, so it should lose time where a way around
# has to be chosen.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [25](25_claims.ipynb) · next: [27 - A sensitivity
# atlas](27_atlas.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4-5 · 40 min · needs
# [12](../12_among_people.ipynb)
#
# **Afterwards you can** say in which meetings this controller is good, and in which it is bad.

# %%
import sys

sys.path.append("..")  # for `studies`
import matplotlib.pyplot as plt
import pandas as pd
from studies import meetings

import szlib
from szlib.simulation.closed_loop import drive
from szlib.simulation.comparisons import CONTROLLERS, summarise
from szlib.simulation.scenarios.meetings import Variations, VisiblePeople
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
variations = 2  # of each meeting; 12 for the table that is saved
n_jobs = 1

# %%
record = NotebookRecord("26_meetings", globals())
zone = record.cache.ellipse()
size = "{:.2f} m x {:.2f} m".format(*zone.semi_axes)
parameters(
    [
        ("zone: semi-axes", size, PAPER, f"of notebook 05, at {record.cache.method.zone_speed:g} m/s"),
        ("people's speed", "0.5 m/s", PAPER, "0.3 overtaken, 0.7 at the corner, 0.8 on the circle: assumed"),
        ("places and walls", "see the figure", ASSUMED, "the source draws them without numbers"),
        ("variations", variations, ASSUMED, "starts 0.2 m off in x and y, people 20 % slower or faster"),
    ]
)

# %% [markdown]
# ## The meetings
#
# The names are those of A. Francis et al., "Principles and guidelines for evaluating social robot navigation
# algorithms" (2025). People walk on at constant velocity and do not react, as in the paper, so all the
# courtesy must come from the robot. Whom a wall hides, the controller does not get.

# %%
logs = {}
for name, meeting in szlib.MEETINGS.items():
    scenario = Variations(meeting, zone, shift=0.0, pace=(1.0, 1.0))(seed)
    controller = CONTROLLERS["MPC-CBF"](scenario, szlib.MPCSettings())
    logs[name] = drive(scenario, controller, behaviour=VisiblePeople())
pd.DataFrame({name: log.metrics() for name, log in logs.items()}).T[
    ["outcome", "time_to_goal", "path_length", "min_h", "min_clearance", "flagged_steps"]
]

# %%
fig, grid = plt.subplots(4, 3, figsize=(12, 12), layout="constrained")
for ax, (name, log) in zip(grid.flat, logs.items(), strict=False):
    log.plot(ax=ax).set_title(f"{name}: {log.time[-1]:.0f} s", fontsize=11)
    ax.get_legend().remove()
grid.flat[-1].axis("off")
figures.add_shared_legend([grid[0, 1]])
record.figure(fig, "meetings")

# %% [markdown]
# ## Four controllers, the same variations
#
# *Straight* drives ahead and stops for who is in its lane. *Social force* is Helbing and Molnar's, with the
# numbers that Moussaid et al. (2009) measured of people. *Dynamic window* takes the best velocity within
# reach that can still be stopped (Fox et al. 1997). All keep the same limits, 1 m/s and 1 m/s$^2$. The last
# three know bodies, no zones.
#
# Metrics are those of HuNavSim: *personal* is the share of time in which the nearest person is between 0.45
# and 1.2 m from the robot (Hall), *path efficiency* the straight way over the way driven.

# %%
options = {"seed": seed, "n_jobs": n_jobs, "progress": variations > 2}
rows = pd.concat([meetings.meet(controller, zone, variations, **options) for controller in CONTROLLERS])
mine = rows[rows["controller"] == "MPC-CBF"]
hidden = ["intersection", "blind corner", "narrow doorway"]
kept = mine[~mine["meeting"].isin(hidden)]["unflagged_violations"]
honest = (kept == 0).all()
record.check(
    "no step that called itself safe led to h < 0, of people in sight", honest, len(kept), always=True
)

# %% [markdown]
# ## What it is bad at, and what helps
#
# With $\gamma = 0.05$ the robot gives way to a person from afar, whatever they do next: a barrier at $h$ may
# fall by no more than $0.5\,h$ a second. Who crosses a junction then pushes the robot up the hall before
# them. A larger $\gamma$ lets it come closer faster; that is safe if the barrier holds on a horizon in which
# the robot can stop: $N = N_h = 24$, 2.4 s, with $\gamma = 0.2$. `MPCSettings.among_people()` has more than that:
# a route around walls, and, where several people are near, prices instead of hard barriers (notebook 12).

# %%
more = ("MPC-CBF, bolder", "MPC-CBF, N = 24 alone", "MPC-CBF, among people")
helped = [meetings.meet(controller, zone, variations, **options) for controller in more]
everything = pd.concat([rows, *helped])
table = summarise(everything, meetings.BY, meetings.METRICS)
paired = summarise(everything, meetings.BY, meetings.METRICS, against=meetings.RIVAL)
record.table(table.round(4), "26_meetings")
record.table(paired.round(4), "26_meetings_paired")


# %%
def formatted(found: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Mean [low, high] of one metric: meetings down, controllers across."""
    shown = found[found["metric"] == metric]
    text = [f"{m:.2f} [{a:.2f}, {b:.2f}]" for m, a, b in shown[["mean", "low", "high"]].to_numpy()]
    wide = shown.assign(text=text).pivot(index="meeting", columns="controller", values="text")
    return wide.loc[list(szlib.MEETINGS), list(dict.fromkeys(shown["controller"]))]


formatted(table, "time_to_goal")

# %% [markdown]
# ## The full table
#
# Twelve variations of each meeting, in which everybody has the plaza's zone, rounded to a centimetre
# (`python -m studies.meetings 12`). They are saved beside the notebooks, and shown from here on. "MPC-CBF"
# has szlib's defaults, not the paper's settings. Intervals are 95 % bootstrap intervals over variations.

# %%
quick = "metric in ['time_to_goal', 'path_efficiency', 'closest_person'] and first == first"
full = record.committed_table("26_meetings", meetings.recompute, where=quick)
change = record.committed_table("26_meetings_paired", meetings.recompute_paired, where=quick)
record.key["variations in the saved table"] = int(full["n"].max())
formatted(full, "time_to_goal")

# %%
labels = {
    "success": "arrived, share of variations",
    "time_to_goal": "time to goal [s]",
    "path_efficiency": "path efficiency",
    "min_clearance": "least gap to body or wall [m]",
    "personal": "personal space, share of time",
    "robot_on_person": "ran into somebody, times",
}
shown = full[full["controller"].isin([*CONTROLLERS, "MPC-CBF, among people"])]
fig = figures.draw_interval_grid(shown, labels, rows="meeting", colour="controller")
record.figure(fig, "controllers")

# %%
mean = full.set_index(["controller", "metric", "meeting"])["mean"]
ran = {name: mean[name]["robot_on_person"].mean() for name in CONTROLLERS}
record.claim(
    "the controller runs into nobody", ran["MPC-CBF"] == 0, {k: f"{share:.0%}" for k, share in ran.items()}
)
steps = mean["MPC-CBF"]["violations"]
record.claim(
    "the controller enters nobody's zone, of people in sight",
    (steps.drop(hidden) == 0).all(),
    f"{steps.drop(hidden).max():g} steps",
)
least = {name: mean[name]["min_h"].min() for name in CONTROLLERS if name != "MPC-CBF"}
value = {name: f"h down to {h:.2f} m" for name, h in least.items()}
record.claim("the other controllers enter zones", max(least.values()) < 0, value)
of_hidden = mean["MPC-CBF"]["unflagged_violations"][hidden]
record.claim(
    "no step that called itself safe led to h < 0, even where walls hide people",
    (of_hidden == 0).all(),
    f"{of_hidden.max():g} steps",
)

# %% [markdown]
# ## Carried along
#
# In the junction: with szlib's defaults, and with the longer horizon and the larger $\gamma$.

# %%
scenario = logs["intersection"].scenario
way = {"gamma = 0.05, N_h = 2": logs["intersection"]}
controller = szlib.MPCCBF(zone, walls=scenario.walls, settings=meetings.METHODS["MPC-CBF, bolder"][1])
way["gamma = 0.2, N = N_h = 24"] = drive(scenario, controller, behaviour=VisiblePeople())
ax = figures.plot_robot_paths(way)
ax.set(title="intersection: the person walks up, from below")
record.figure(ax.figure, "carried-along")
pd.DataFrame({name: log.metrics() for name, log in way.items()}).loc[["time_to_goal", "min_h", "path_length"]]

# %%
record.animation(movie := logs["intersection"].animate(every=0.8), "intersection")
movie

# %%
lost = mean["MPC-CBF"]["time_to_goal"] / mean["social force"]["time_to_goal"]
record.claim(
    "the controller loses most time in the junction",
    lost.idxmax() == "intersection",
    f"{lost.max():.1f} times as long as the social force",
)
gain = change[change["metric"] == "time_to_goal"].set_index(["controller", "meeting"])
in_seconds = "{mean:+.1f} s (95 % interval {low:+.1f} to {high:+.1f})".format_map
there = gain.loc[("MPC-CBF, bolder", "intersection"), ["mean", "low", "high"]]
record.claim(
    "in the junction the larger gamma with the longer barrier saves time",
    there["high"] < 0,
    in_seconds(there),
)
alone = gain.loc[("MPC-CBF, N = 24 alone", "intersection"), ["mean", "low", "high"]]
record.claim("in the junction a longer horizon alone saves no time", alone["high"] >= 0, in_seconds(alone))

# %%
steps = mean["MPC-CBF, bolder"]["unflagged_violations"]
record.claim(
    "no step of the bolder controller that called itself safe led to h < 0",
    (steps.drop(hidden) == 0).all(),
    f"{steps.drop(hidden).max():g} steps",
)
stuck = {name: mean[name]["success"]["robot crowding"] for name in ("MPC-CBF", "MPC-CBF, bolder")}
record.claim(
    "crowded in, the controller does not always find the gap",
    stuck["MPC-CBF"] < 1,
    f"it arrives in {stuck['MPC-CBF']:.0%}",
)
bolder = stuck["MPC-CBF, bolder"]
record.claim(
    "crowded in, the bolder controller finds the gap more often",
    stuck["MPC-CBF"] < bolder,
    f"in {bolder:.0%}",
)

# %%
among = mean["MPC-CBF, among people"]
record.claim(
    "the controller among people arrives in all variations of all meetings",
    (among["success"] == 1).all(),
    f"{among['success'].min():.0%}",
)
least = among["min_h"].drop(hidden).sort_values()
entered = sorted(least.index[least < -0.01])
record.claim(
    "the controller among people has h < 0 only on the circle and where it is crowded in, and says so",
    entered == ["circular crossing", "robot crowding"] and among["unflagged_violations"].max() == 0,
    {name: f"{h:.2f} m" for name, h in least[entered].items()},
)
faster = (among["time_to_goal"] / mean["MPC-CBF"]["time_to_goal"]).median()
record.claim(
    "in the median meeting the controller among people is faster than the defaults",
    faster < 1,
    f"{faster:.0%} of their time",
)

# %% [markdown]
# **What it means.** The barrier does what it is for: in none of these meetings does the robot come into the
# zone of somebody whom it sees, while each of the others drives into zones and, but for the dynamic window,
# into people. Its price is time where a way has to be chosen. In the junction it lets itself be carried
# along, because $\gamma = 0.05$ makes it give way long before it has to; a longer horizon alone changes
# nothing, a larger $\gamma$ with the barrier on the whole of a horizon in which the robot can stop does.
# Among people who stand around it, it may stop before one of them although there is a gap: it plans no way,
# and only the choice of a side (notebook 09) leads it out. With `among_people()` it arrives in all variations. The
# price is that $h < 0$ for some time where five or more people are near: half a metre inside a zone on the circle, with
# a gap to all bodies. People here do not react; those of notebook 12 do.

# %%
record.close()

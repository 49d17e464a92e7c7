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
#   szlib:
#     label: meetings
#     paper: sec. 4-5
#     aim: say in which meetings this controller is good, and in which it is bad.
#     asks: How does the robot do in standard meetings, with other gammas, widths, speeds
#       and zones, and in crowds?
#     needs:
#     - '12'
# ---

# %% [markdown]
# # 26 - Named meetings
#
# **Question.** Robots that drive among people are tested in named meetings: head-on, in a doorway, around a
# corner. Where is this controller good, and where is it bad?
#
# **Expectation.** It enters nobody's zone, because it is made for that. It looks only 0.8 s ahead and plans no
# route, so it should lose time where it has to choose a way around.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [25](25_claims.ipynb) · next: [27 - A sensitivity
# atlas](27_atlas.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4-5 · 15 min · needs
# [12](../12_among_people.ipynb)
#
# **Afterwards you can** say in which meetings this controller is good, and in which it is bad.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
variations = 2  # of each meeting; 12 for the table that is saved
n_jobs = 1

# %% jupyter={"source_hidden": true}
# Imports, and the record of the run
import sys

sys.path.append("..")  # for `plots` and `studies`
import matplotlib.pyplot as plt
import pandas as pd
import plots
from IPython.display import display
from matplotlib.patches import Circle
from studies import meetings
from studies.folds import fold_table
from studies.summaries import summarise

import szlib
from szlib.simulation.baseline_controllers import CONTROLLERS
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.simulation.crowds import VisiblePeople
from szlib.simulation.scenario import Variations
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, PAPER, NotebookRecord, parameters, read_table

record = NotebookRecord("26_meetings", globals(), plaza_zone=True)
zone = record.cache.ellipse()

# %% jupyter={"source_hidden": true}
# Parameters and their sources
size = "{:.2f} m x {:.2f} m".format(*zone.semi_axes)
parameters(
    [
        ("zone: semi-axes", size, MEASURED, f"of chapter 06, at {record.cache.method.zone_speed:g} m/s"),
        ("people's speed", "0.5 m/s", PAPER, "0.3 overtaken, 0.7 at the corner, 0.8 on the circle: assumed"),
        ("places and walls", "see the figure", ASSUMED, "the source draws them without numbers"),
        ("variations", variations, ASSUMED, "starts 0.2 m off in x and y, people 20 % slower or faster"),
    ]
)

# %% jupyter={"source_hidden": true}
# Figure
shown = [*CONTROLLERS, "MPC-CBF, among people"]
saved = read_table("26_meetings")
outcomes = meetings.find_outcomes(saved[saved["controller"].isin(shown)])
fig = meetings.draw_outcomes(outcomes)
good = outcomes[outcomes["outcome"] == "arrives, enters no zone"]["controller"].value_counts()
rivals = max(good.get(name, 0) for name in CONTROLLERS if name != "MPC-CBF")
fig.suptitle(
    f"MPC-CBF arrives without entering a zone in {good['MPC-CBF']} of {outcomes['meeting'].nunique()} meetings, "
    f"simple controllers in at most {rivals}"
)
record.figure(fig, "outcomes")

# %% [markdown]
# A row is a meeting, a column a controller. The symbol is the worst outcome in twelve variations of the meeting, the
# number the mean time to the goal. Now one step at a time.
#
# ## The meetings
#
# The names are those of A. Francis et al., "Principles and guidelines for evaluating social robot navigation
# algorithms" (2025). People walk on at constant velocity and do not react, as in the paper. So only the robot
# can avoid anybody. If a wall hides a person, the controller does not know of this person.
#
# In which meeting do you expect the longest detour?

# %% jupyter={"source_hidden": true}
# Computation
logs = {}
for name, meeting in szlib.MEETINGS.items():
    scenario = Variations(meeting, zone, shift=0.0, pace=(1.0, 1.0))(seed)
    controller = CONTROLLERS["MPC-CBF"](scenario, szlib.MPCSettings())
    logs[name] = drive(scenario, controller, LoopSettings(behaviour=VisiblePeople()))

# %% jupyter={"source_hidden": true}
# Figure
fig, grid = plt.subplots(4, 3, figsize=(12, 11), layout="constrained")
for ax, (name, log) in zip(grid.flat, logs.items(), strict=False):
    plots.plot_crowd(log, ax=ax)
    ax.set_title(f"{name}: {log.time[-1]:.0f} s, least h {log.h.min():.2f} m", fontsize=11)
    ax.set(xlim=(-7.5, 7.5), ylim=(-5, 6), xticks=(-5, 0, 5), xlabel="x [m]" if ax in grid[-1] else "")
    ax.set_ylabel("y [m]" if ax in grid[:, 0] else "")
handles, names = grid[0, 1].get_legend_handles_labels()
known = dict(zip(names, handles, strict=True))  # there are two walls
grid.flat[-1].axis("off")
grid.flat[-1].legend(known.values(), known, loc="center", fontsize=12)
lengths = {name: log.metrics()["path_length"] for name, log in logs.items()}
least = min(log.h.min() for log in logs.values())
farthest = max(lengths, key=lengths.get)
fig.suptitle(f"In all meetings MPC-CBF keeps h >= {least:.3f} m; it drives farthest in the {farthest}")
record.figure(fig, "meetings")

# %% [markdown]
# Each panel shows the paths with a dot each second; the robot, the people and their zones are drawn at the time when the
# robot is nearest to a person.
#
# ## Four controllers, the same variations
#
# - *Straight* drives ahead, and stops if somebody is in its lane.
# - *Social force* is the model of Helbing and Molnar, with the numbers that Moussaid et al. (2009) measured.
# - *Dynamic window* takes the best velocity within reach from which it can still stop (Fox et al. 1997).
#
# All have the same limits, 1 m/s and 1 m/s$^2$. These three know the bodies of people and no zones.

# %% jupyter={"source_hidden": true}
# Checks
options = {"seed": seed, "n_jobs": n_jobs, "progress": variations > 2}
rows = pd.concat([meetings.meet(controller, zone, variations, **options) for controller in CONTROLLERS])
mine = rows[rows["controller"] == "MPC-CBF"]
hidden = ["intersection", "blind corner", "narrow doorway"]
kept = mine[~mine["meeting"].isin(hidden)]["unflagged_violations"]
record.check(
    "no step that called itself safe led to h < 0, of people in sight",
    (kept == 0).all(),
    f"{kept.sum():.0f} steps in {len(kept)} runs",
    always=True,
)

# %% [markdown]
# ## What it is bad at, and what helps
#
# **A worked number.** With $\gamma = 0.05$ in steps of 0.1 s, $h$ may shrink at the rate $0.5\,h$ per second: at
# $h = 2$ m that is 1 m/s. A person who comes at 0.5 m/s uses up half of it. At $h = 1$ m the person uses up all of it.
# So the robot gives way early, whatever the person does next. In the intersection, the person walks up the hall, and the robot goes up the hall ahead of them.
#
# A larger $\gamma$ lets the robot come closer before it gives way. That is safe if the robot looks so far ahead that it
# can stop: with $\gamma = 0.2$ it needs $N = N_h = 24$ steps, which is 2.4 s. We call this "bolder".
# `MPCSettings.among_people()` has more: ways around walls and people, and prices instead of hard barriers
# (chapter 12). The full table below has all three; this run drives the four controllers.

# %% jupyter={"source_hidden": true}
# Table
table = summarise(rows, meetings.BY, meetings.METRICS)
record.table(table.round(4), "26_meetings")
paired = summarise(rows, meetings.BY, meetings.METRICS, against=meetings.RIVAL)
record.table(paired.round(4), "26_meetings_paired")


def format_metric(found: pd.DataFrame, metric: str) -> pd.DataFrame:
    """Mean [low, high] of one metric: meetings down, controllers across."""
    rows = found[found["metric"] == metric]
    numbers = rows[["mean", "low", "high"]].to_numpy()
    text = ["never arrives" if m != m else f"{m:.2f} [{a:.2f}, {b:.2f}]" for m, a, b in numbers]
    wide = rows.assign(text=text).pivot(index="meeting", columns="controller", values="text")
    return wide.loc[list(szlib.MEETINGS), list(dict.fromkeys(rows["controller"]))]


fold_table(f"Time to goal [s] in {variations} variations of this run", format_metric(table, "time_to_goal"))

# %% [markdown]
# ## The full table
#
# Twelve variations of each meeting, in which everybody has the zone of the plaza, rounded to a centimetre
# (`python -m studies.meetings 12`). They are saved beside the notebooks; the first picture and all that follows show them.
# "MPC-CBF" has szlib's defaults, not the paper's settings. Brackets hold 95 % bootstrap intervals over variations.

# %% jupyter={"source_hidden": true}
# Table
quick = "metric in ['time_to_goal', 'path_efficiency', 'closest_person'] and first == first"
full = record.committed_table("26_meetings", meetings.recompute, where=quick)
change = record.committed_table("26_meetings_paired", meetings.recompute_paired, where=quick)
record.key["variations in the saved table"] = int(full["n"].max())
LABELS = {
    "time_to_goal": "Time to goal [s]",
    "path_efficiency": "Straight way over the way driven",
    "min_clearance": "Least gap to a body or a wall [m]",
    "personal": "Share of the time with the nearest person between 0.45 and 1.2 m away (Hall's personal distance)",
}
for metric, label in LABELS.items():
    display(fold_table(label, format_metric(full, metric)))

# %% jupyter={"source_hidden": true}
# Checks
mean = full.set_index(["controller", "metric", "meeting"])["mean"]
# contacts in which the robot approaches faster than the person; in the others a person walks into the robot
ran = {name: mean[name]["robot_on_person"].mean() for name in CONTROLLERS}
value = ", ".join(f"{name} in {share:.0%} of runs" for name, share in ran.items())
record.claim("the controller runs into nobody", ran["MPC-CBF"] == 0, value)
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
# Back to the intersection. The person comes from below and walks up the hall. Where is the robot with szlib's
# defaults 12 s after the start, and where is the bolder one?

# %% jupyter={"source_hidden": true}
# Computation
scenario = logs["intersection"].scenario
bolder = szlib.MPCCBF(zone, walls=scenario.walls, settings=meetings.METHODS["MPC-CBF, bolder"][1])
way = {
    "gamma = 0.05, N_h = 2": (logs["intersection"], figures.BLUE, "-"),
    "gamma = 0.2, N = N_h = 24": (
        drive(scenario, bolder, LoopSettings(behaviour=VisiblePeople())),
        figures.GREEN,
        "--",
    ),
}
late, early = (log.time[-1] for log, *_ in way.values())

# %% jupyter={"source_hidden": true}
# Figure
fig, panels = plt.subplots(1, 4, figsize=(13, 4), layout="constrained", sharey=True)
for ax, time in zip(panels, (3, 6, 9, 12), strict=True):
    ax.plot(*scenario.walls.transpose(2, 1, 0), color=figures.BLACK, linewidth=3)
    ax.plot(*scenario.goal, "D", color=figures.GREY, markeredgecolor=figures.BLACK, label="goal")
    for name, (log, shade, line) in way.items():
        row = min(round(time / log.settings.dt), len(log.states) - 1)
        ax.plot(*log.states[: row + 1, :2].T, line, color=shade, label=name)
        ax.add_patch(Circle(log.states[row, :2], log.settings.r_robot, color=shade, alpha=0.7))
    x, y, angle = logs["intersection"].people[round(10 * time), 0, :3]
    ax.plot(*zone.placed((x, y), angle).curve().T, color=figures.RED, label="zone of the person")
    ax.plot(x, y, "^", color=figures.RED)
    figures.label_metres(ax, f"after {time} s").set(xlim=(-5.8, 5.8), ylim=(-4.2, 6.2), ylabel="")
panels[0].set_ylabel("y [m]")
fig.suptitle(
    f"With gamma = 0.05 the person pushes the robot up the hall: {late:.0f} s to the goal, not {early:.0f} s"
)
figures.add_shared_legend([panels[0]])
record.figure(fig, "carried-along")

# %% jupyter={"source_hidden": true}
# The run as a player
record.animation(movie := logs["intersection"].animate(every=1.0, width=9.0), "intersection")
movie

# %% jupyter={"source_hidden": true}
# Checks
lost = mean["MPC-CBF"]["time_to_goal"] / mean["social force"]["time_to_goal"]
record.claim(
    "the controller loses most time in the intersection",
    lost.idxmax() == "intersection",
    f"{lost.max():.1f} times as long as the social force",
)
gain = change[change["metric"] == "time_to_goal"].set_index(["controller", "meeting"])
in_seconds = "{mean:+.1f} s (95 % interval {low:+.1f} to {high:+.1f} s)".format_map
there = gain.loc[("MPC-CBF, bolder", "intersection"), ["mean", "low", "high"]]
record.claim(
    "in the intersection the larger gamma with the longer barrier saves time",
    there["high"] < 0,
    in_seconds(there),
)
alone = gain.loc[("MPC-CBF, N = 24 alone", "intersection"), ["mean", "low", "high"]]
record.claim(
    "in the intersection a longer horizon alone saves no time", alone["high"] >= 0, in_seconds(alone)
)

# %% jupyter={"source_hidden": true}
# Checks
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
    f"it arrives in {stuck['MPC-CBF']:.0%} of the variations",
)
gap = change[change["metric"] == "success"].set_index(["controller", "meeting"])
there = gap.loc[("MPC-CBF, bolder", "robot crowding"), ["mean", "low", "high"]]
record.claim(
    "crowded in, the bolder controller finds the gap more often",
    True if there["low"] > 0 else None,  # undecided where the interval holds 0
    f"in {stuck['MPC-CBF, bolder']:.0%} of 12 variations, the other in {stuck['MPC-CBF']:.0%}",
)

# %% jupyter={"source_hidden": true}
# Checks
among = mean["MPC-CBF, among people"]
record.claim(
    "the controller among people arrives in all variations of all meetings",
    (among["success"] == 1).all(),
    f"in {among['success'].min():.0%} at least",
)
least = among["min_h"].drop(hidden).sort_values()
record.claim(
    "the least h of the controller among people is above -1 cm in the mean of each meeting with people in sight, and no "
    "step that claims to be safe leads to h < 0",
    least.iloc[0] > -0.01 and among["unflagged_violations"].max() == 0,
    f"{least.index[0]}: {least.iloc[0]:.3f} m",
)
faster = (among["time_to_goal"] / mean["MPC-CBF"]["time_to_goal"]).median()
record.claim(
    "in the median meeting the controller among people is faster than the defaults",
    faster < 1,
    f"{faster:.0%} of their time",
)

# %% [markdown]
# **A common mistake:** "a longer horizon makes the robot plan ahead, so it will not be pushed up the hall". No: with
# $N = 24$ alone it takes as long as before. The barrier decides how early it gives way, not the horizon.
#
# **What it means.** The barrier does its work: in none of these meetings does the robot enter the zone of a person
# whom it sees, and each of the others enters zones. The price is time where the robot has to choose a way. In the
# intersection it is pushed up the hall, because with $\gamma = 0.05$ it gives way long before it has to; a
# larger $\gamma$ with the barrier on a horizon in which the robot can stop mends this. Among people who stand around it, it
# may stop before one of them although there is a gap: these settings look for no ways, and only the choice of a side
# (chapter 09) leads the robot out. With `among_people()` it arrives in all variations, and in the
# mean of a meeting its least $h$ is at least -2 cm. People here do not react; those of notebook 29 do.

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

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
#     label: atlas
#     paper: sec. 4-5
#     aim: predict from gamma, width, speed and zone what the robot will do.
#     row: '26'
#     needs:
#     - '11'
# ---

# %% [markdown]
# # 27 - A sensitivity atlas
#
# **Question.** Chapters 10 and 11 show one corridor, one passage, one walking speed, one zone. What does the robot do
# in others?
#
# **Expectation.** The paper says that the size of the zone trades "yielding behavior" against "navigation
# efficiency". So with some settings the robot goes ahead, with others it yields, with a gradual change between them.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [26](26_meetings.ipynb) · next: [28 - From sentence to
# verdict](28_sentences.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4-5 · 20 min · needs
# [11](../11_waiting.ipynb)
#
# **Afterwards you can** predict from gamma, width, speed and zone what the robot will do.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05
again = 12  # runs of the saved atlas that are driven anew
n_jobs = 1

# %% jupyter={"source_hidden": true}
# Imports, and the record of the run
import sys

sys.path.append("..")  # for `plots` and `studies`
import matplotlib.pyplot as plt
import numpy as np
import plots
from IPython.display import Markdown
from studies.atlas import REFERENCE, SCENES, AtlasCell, run_atlas

from szlib.simulation.metrics import STRATEGIES, classify_strategy
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, PAPER, NotebookRecord, parameters, read_table

record = NotebookRecord("27_atlas", globals(), plaza_zone=True)
size = "{:.2f} m x {:.2f} m".format(*REFERENCE.semi_axes)
parameters(
    [
        ("gamma of the maps", "0.02 to 0.2", MEASURED, "0.05 in MPCSettings(): chapter 09"),
        ("widths of corridor, passage", "3.0 to 6.4 m, 1.4 to 3.0 m", ASSUMED, "4.6 m and 2.0 m elsewhere"),
        ("speed of the person", "0.3 to 1.1 m/s", ASSUMED, "0.5 m/s in the paper"),
        ("size of the zone", "0.5 to 1.25 times", ASSUMED, f"1 is {size}"),
        ("N, N_h, dt, speed limit", "8, 2, 0.1 s, 1 m/s", PAPER, "sec. 4"),
    ]
)

# %% jupyter={"source_hidden": true}
# Figure
atlas = read_table("27_atlas")
found = [name for name in STRATEGIES if (atlas["strategy"] == name).any()]
corridor = atlas[atlas["scene"] == "corridor"]
usual = corridor[(corridor["pace"] == 0.5) & (corridor["size"] == 1)]
fig, ax = plt.subplots(figsize=(8, 3.9), layout="constrained")
plots.plot_strategies(usual, names=found, rows="gamma", columns="width", ax=ax)
ax.set(xlabel="width of the corridor [m]", ylabel="gamma")
lacks_plans = usual["strategy"].isin(["h < 0", "infeasible"]).groupby(usual["gamma"]).all()
limit = lacks_plans.index[lacks_plans].min()
ax.set_title(
    f"The wider the corridor, the less the robot yields; from gamma = {limit:g} on, steps lack a plan"
)
ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
record.figure(fig, "corridor-map")

# %% [markdown]
# This is the paper's corridor: a person comes at 0.5 m/s. Each cell is one run. Read it from below: with a small gamma
# the robot gives way early, in a narrow corridor it *backs out*. With a larger gamma it *waits* for a shorter time, and then
# it *goes ahead*. With a gamma of 0.1 or more it comes so near before it gives way that some steps have no
# plan, even where it arrives.
#
# ## What a robot can do
#
# Each run gets one name, the first of these that holds (`szlib.simulation.metrics.classify_strategy`):
#
# | name | meaning |
# |---|---|
# | h < 0 | it entered a zone, or came too near to a wall |
# | infeasible | some step had no plan that obeys every row |
# | deadlock | it was not at its goal after 60 s |
# | backs out | it went back by 0.5 m or more |
# | waits | it yielded for 1 s or more in all |
# | passes on the other side | it had the person on its right when it passed |
# | goes ahead | none of these |
#
# The atlas is a saved table of 1,384 runs (`python -m studies.atlas`). Twelve of them are driven again here.

# %%
some = atlas.sample(again, random_state=seed)
named = ["scene", "gamma", "width", "pace", "size"]
anew = run_atlas([AtlasCell(**cell) for cell in some[named].to_dict("records")], REFERENCE, n_jobs=n_jobs)

# %% jupyter={"source_hidden": true}
# Checks
same = int((anew["strategy"].to_numpy() == some["strategy"].to_numpy()).sum())
record.check("runs driven anew end as in the table", same == again, f"{same} of {again} runs")
off = float(np.abs(anew["min_h"].to_numpy() - some["min_h"].to_numpy()).max())
record.check("runs driven anew have the same least h, to a millimetre", off < 1e-3, f"to {1000 * off:.2f} mm")
counts = atlas.groupby(["strategy", "scene"]).size().unstack(fill_value=0).reindex(STRATEGIES, fill_value=0)
counts.rename_axis(index="number of runs", columns="")

# %% [markdown]
# ## The corridor
#
# Now the zone and the person change. Before you look: where does the light area, in which the robot *goes ahead*, go
# when the person walks faster? And when the zone is larger?

# %% jupyter={"source_hidden": true}
# Figure
sizes, paces = sorted(corridor["size"].unique()), sorted(corridor["pace"].unique())
fig, grid = plt.subplots(4, 4, figsize=(11, 9), layout="constrained", sharex=True, sharey=True)
for (size, pace), part in corridor.groupby(["size", "pace"]):
    ax = grid[sizes.index(size), paces.index(pace)]
    plots.plot_strategies(part, names=found, rows="gamma", columns="width", ax=ax)
    ax.set(xlabel="", ylabel="")
    ax.set_xticks(range(0, 7, 2), ["3", "3.8", "4.6", "6.4"])
for ax, pace in zip(grid[0], paces, strict=True):
    ax.set_title(f"person at {pace:g} m/s")
for ax, size in zip(grid[:, 0], sizes, strict=True):
    ax.set_ylabel(f"zone x {size:g}\ngamma")
for ax in grid[-1]:
    ax.set_xlabel("width [m]")
fig.suptitle("The robot goes ahead less often if the person is faster or the zone is larger")
figures.add_shared_legend([grid[0, 0]])
record.figure(fig, "corridor")

# %% [markdown]
# <details><summary>Answer</summary>
#
# It moves to the right: the robot needs a wider corridor to go ahead. For a faster person it also becomes lower,
# because a large gamma leaves no time to brake. Our setting, 4.6 m and gamma = 0.05, lies near the edge of the light area: there
# small changes decide whether the robot waits.
#
# </details>
#
# ## The passage
#
# The robot meets the person in a pathway between two walls: it waits outside (chapter 11), or it is already inside and
# has to make room.

# %% jupyter={"source_hidden": true}
# Figure
fig, grid = plt.subplots(2, 4, figsize=(11, 5), layout="constrained", sharex=True, sharey=True)
for row, scene in zip(grid, ("waiting", "making_room"), strict=True):
    part = atlas[(atlas["scene"] == scene) & (atlas["pace"] == 0.5)]
    for ax, (size, cells) in zip(row, part.groupby("size"), strict=True):
        plots.plot_strategies(cells, names=found, rows="gamma", columns="width", ax=ax)
        ax.set(title=f"zone x {size:g}" if scene == "waiting" else "", xlabel="", ylabel="")
    row[0].set_ylabel(f"{scene.replace('_', ' ')}\ngamma")
for ax in grid[-1]:
    ax.set_xlabel("width [m]")
passage = atlas[(atlas["scene"] != "corridor") & (atlas["pace"] == 0.5)]
arrived = (~passage["strategy"].isin(["h < 0", "infeasible", "deadlock"])).groupby(passage["gamma"])
works, cases = arrived.sum(), arrived.size().iloc[0]
fig.suptitle(f"In a passage gamma = 0.07 works in {works[0.07]} of {cases} cases, 0.05 in {works[0.05]}")
figures.add_shared_legend([grid[0, 0]])
record.figure(fig, "passage")

# %% jupyter={"source_hidden": true}
# Figure
share = atlas.assign(good=100.0 * ~atlas["strategy"].isin(["h < 0", "infeasible", "deadlock"]))
by_gamma = share.groupby(["gamma", "scene"])["good"].mean().unstack()
record.key["share of good endings at gamma = 0.05"] = float(by_gamma.loc[0.05].mean()) / 100
fig, ax = plt.subplots(figsize=(8, 3.2), layout="constrained")
looks = {
    "corridor": (figures.BLUE, "o-"),
    "waiting": (figures.GREEN, "^--"),
    "making_room": (figures.RED, "s:"),
}
for scene, (shade, line) in looks.items():
    ax.plot(by_gamma[scene].dropna(), line, color=shade, label=scene.replace("_", " "))
ax.set(xscale="log", xlabel="gamma", ylabel="arrived with a plan\nat every step [% of runs]", ylim=(-4, 104))
ax.set_xticks(by_gamma.index, [f"{value:g}" for value in by_gamma.index])
ax.minorticks_off()
ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
worst = by_gamma.min(axis=1, skipna=False)
ax.set_title(
    f"gamma = {worst.idxmax():g} is the best in these narrow scenes: {worst.max():.0f} % or more in each"
)
record.figure(fig, "gamma")

# %% [markdown]
# With a smaller gamma the robot in the corridor is pushed back for so long that time runs out, and in a narrow passage
# some steps have no plan. With a larger gamma it drives into places from which there is no way out.
#
# ## An example of each
#
# For each name, the run that is nearest to gamma = 0.05, to our widths, the paper's walking speed, and to the plaza's zone.

# %% jupyter={"source_hidden": true}
# Checks
distance = (
    np.abs(np.log(atlas["gamma"] / 0.05))
    + np.abs(np.log(atlas["width"] / atlas["scene"].map(SCENES)))
    + np.abs(np.log(atlas["pace"] / 0.5))
    + np.abs(np.log(atlas["size"]))
)
nearest = atlas.assign(distance=distance).sort_values("distance").groupby("strategy").head(1)
examples = {cell["strategy"]: AtlasCell(**{k: cell[k] for k in named}) for cell in nearest.to_dict("records")}
logs = {name: examples[name].run(REFERENCE) for name in found}
right = sum(classify_strategy(log) == name for name, log in logs.items())
record.check("each example is what it stands for", right == len(logs), f"{right} of {len(logs)} runs")

# %% jupyter={"source_hidden": true}
# Figure
fig, grid = plt.subplots(3, 2, figsize=(12, 9), layout="constrained", sharex=True, sharey=True)
for ax, (name, log) in zip(grid.flat, logs.items(), strict=False):
    cell = examples[name]
    log.plot(every=4.0, ax=ax).get_legend().remove()
    settings_text = f"{cell.scene.replace('_', ' ')}, {cell.width:g} m wide, zone x {cell.size:g}"
    ax.set(xlim=(-7.2, 7.2), ylim=(-3.1, 3.1), xlabel="", ylabel="")
    ax.set_title(f"{name}: {settings_text}", fontsize=11)
for ax in grid[-1]:
    ax.set_xlabel("x [m]")
for ax in grid[:, 0]:
    ax.set_ylabel("y [m]")
fig.suptitle("The same controller goes ahead, waits, backs out or fails (times in s; later is darker)")
figures.add_shared_legend([grid[0, 0]])
record.figure(fig, "examples")

# %% jupyter={"source_hidden": true}
# Table
missing = [name for name in STRATEGIES if name not in examples]
deadlock = "In the *deadlock* the person pushes the robot out of the corridor, and it ends behind the wall beside its goal. "
Markdown(
    deadlock + (f"In the whole atlas the robot never *{'*, never *'.join(missing)}*." if missing else "")
)

# %% [markdown]
# ## Yielding against efficiency
#
# Now the sentence of the paper: "the degree to which the robot yields can be adjusted by varying the size of the social zone".
# The zone of this data gets nine sizes. How long does the robot yield, and when does it arrive?

# %%
SIZES = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2)
zone = record.cache.ellipse()
cells = [AtlasCell(scene, gamma, width, size=size) for scene, width in SCENES.items() for size in SIZES]
curve = run_atlas(cells, zone, n_jobs=n_jobs)

# %% jupyter={"source_hidden": true}
# Figure
fig, panels = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained", sharey=True)
for ax, (scene, rows) in zip(panels, curve.groupby("scene", sort=False), strict=True):
    ax.plot(rows["size"], rows["time_to_goal"], "o-", color=figures.BLUE, label="time to the goal")
    ax.plot(rows["size"], rows["time_yielding"], "s--", color=figures.RED, label="time in which it yields")
    ax.set(xlabel="size of the zone (1: as measured)", title=scene.replace("_", " "))
    ax.grid(axis="y", color=figures.GREY, alpha=0.3)
panels[0].set(ylabel="time [s]", ylim=(0, 1.1 * curve["time_to_goal"].max()))
fig.suptitle("With a larger zone the robot yields longer and arrives later, in all three scenarios")
figures.add_shared_legend([panels[0]])
record.figure(fig, "trade")

# %% jupyter={"source_hidden": true}
# Checks
slopes = {}
for scene, rows in curve.dropna().groupby("scene", sort=False):
    more, later = (
        np.polyfit(rows["size"], rows[name], 1)[0] / 10 for name in ("time_yielding", "time_to_goal")
    )
    slopes[scene] = f"{more:+.2f} s of yielding and {later:+.2f} s to the goal"
    record.claim(
        f"{scene}: a larger zone yields longer and arrives later", more > 0 and later > 0, slopes[scene]
    )
lines = [f"- {scene.replace('_', ' ')}: {slope}" for scene, slope in slopes.items()]
Markdown("If the zone is a tenth larger:\n\n" + "\n".join(lines))

# %% jupyter={"source_hidden": true}
# Table
near = corridor[(corridor["width"] == 4.6) & (corridor["pace"] == 0.5)].set_index(["gamma", "size"])
times = near["time_to_goal"]
record.key["corridor: to the goal with gamma 0.03, 0.07 [s]"] = [float(times[g, 1.0]) for g in (0.03, 0.07)]
Markdown(
    "Gamma does the same. In a corridor of 4.6 m the robot arrives after "
    f"{times[0.03, 1.0]:.1f} s with gamma = 0.03, and after {times[0.07, 1.0]:.1f} s with gamma = 0.07; "
    f"after {times[0.05, 1.25]:.1f} s with a zone of 1.25 times the size, and after {times[0.05, 0.75]:.1f} s with one of 0.75."
)

# %% [markdown]
# **A common mistake:** "a small zone is always the safe choice for the robot". No: in a passage of 3 m, with half the zone, the
# robot stays inside beside the person who walks at 0.5 m/s, and h falls 5 mm below 0.
#
# **What it means.** The size of the zone trades yielding against time, as the paper says, and so does gamma.
# Neither is free. On one side of the maps the robot is pushed back until time is up. On the other side it drives
# into places from which there is no way out.

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

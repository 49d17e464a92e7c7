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
# # 27 - A sensitivity atlas
#
# **Question.** Notebooks 10 and 11 show one corridor, one passage, one pace, one zone. What would the robot
# have done in others?
#
# **Expectation.** The paper: "the degree to which the robot yields can be adjusted by varying the size of the
# social zone, allowing us to appropriately trade off between the robot's yielding behavior and navigation
# efficiency." So there should be settings in which it goes ahead, others in which it
# yields, and a curve from the one to the other.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [26](26_meetings.ipynb) · next: [28 - From sentence to
# verdict](28_sentences.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4-5 · 35 min · needs
# [11](../11_waiting.ipynb)
#
# **Afterwards you can** predict from gamma, width, speed and zone what the robot will do.

# %%
import sys

sys.path.append("..")  # for `studies`
import matplotlib.pyplot as plt
import numpy as np
from IPython.display import Markdown
from studies.atlas import REFERENCE, SCENES, AtlasCell, run_atlas

from szlib.simulation.strategies import STRATEGIES, classify_strategy
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, PAPER, NotebookRecord, parameters, read_table

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05
again = 12  # runs of the saved atlas that are driven anew
n_jobs = 1

# %%
record = NotebookRecord("27_atlas", globals())
size = "{:.2f} m x {:.2f} m"
parameters(
    [
        ("gamma of the maps", "0.02 to 0.2", MEASURED, "0.05 elsewhere: notebook 09"),
        ("widths of corridor, passage", "3.0 to 6.4 m, 1.4 to 3.0 m", ASSUMED, "4.6 m and 2.0 m elsewhere"),
        ("pace of the person", "0.3 to 1.1 m/s", ASSUMED, "0.5 m/s in the paper"),
        ("size of the zone", "0.5 to 1.25 times", ASSUMED, "1 is " + size.format(*REFERENCE.semi_axes)),
        ("N, N_h, dt, speed limit", "8, 2, 0.1 s, 1 m/s", PAPER, "sec. 4"),
    ]
)

# %% [markdown]
# ## What a robot can do
#
# Each run gets one name, the first of these that holds (`szlib.simulation.strategies.manner`):
#
# | | |
# |---|---|
# | h < 0 | it came into a zone or too near to a wall |
# | infeasible | some step had no plan that obeys every row |
# | deadlock | it was not at its goal after 60 s |
# | backs out | it went back by 0.5 m or more |
# | waits | it yielded for 1 s or more in all |
# | passes on the other side | it met the person on its left |
# | goes ahead | none of these |
#
# The atlas is a saved table of 1,384 runs, made by
# `python -m studies.atlas`. A part of it is driven anew here.

# %%
atlas = read_table("27_atlas")
some = atlas.sample(again, random_state=seed)
named = ["scene", "gamma", "width", "pace", "size"]
anew = run_atlas([AtlasCell(**cell) for cell in some[named].to_dict("records")], REFERENCE, n_jobs=n_jobs)
same = (anew["strategy"].to_numpy() == some["strategy"].to_numpy()).mean()
record.check("runs driven anew end as in the table", same == 1, float(same))

# %%
off = np.abs(anew["min_h"].to_numpy() - some["min_h"].to_numpy()).max()
record.check("runs driven anew have the same least h, to a millimetre", off < 1e-3, float(off))
counts = atlas.groupby(["scene", "strategy"]).size().unstack(0, fill_value=0)
counts.reindex(STRATEGIES, fill_value=0)

# %% [markdown]
# ## The corridor
#
# In each panel gamma runs upwards and the corridor gets wider to the right; larger zones are in lower rows,
# faster people to the right.

# %%
corridor = atlas[atlas["scene"] == "corridor"]
fig, grid = plt.subplots(4, 4, figsize=(13, 12), layout="constrained", sharex=True, sharey=True)
for (size, pace), part in corridor.groupby(["size", "pace"]):
    row, column = sorted(corridor["size"].unique()).index(size), sorted(corridor["pace"].unique()).index(pace)
    ax = figures.plot_strategies(part, names=STRATEGIES, rows="gamma", columns="width", ax=grid[row, column])
    ax.set_title(f"zone x {size:g}, person at {pace:g} m/s", fontsize=10)
    ax.set(xlabel="width [m]" if row == 3 else "", ylabel="gamma" if column == 0 else "")
key = ",  ".join(f"{chr(ord('A') + i)}: {name}" for i, name in enumerate(STRATEGIES))
fig.supxlabel(key, fontsize=11)
record.figure(fig, "corridor")

# %% [markdown]
# ## The passage

# %%
fig, grid = plt.subplots(2, 4, figsize=(13, 6.5), layout="constrained", sharex=True, sharey=True)
for row, scene in enumerate(("waiting", "making_room")):
    part = atlas[(atlas["scene"] == scene) & (atlas["pace"] == 0.5)]
    for column, (size, cells) in enumerate(part.groupby("size")):
        ax = figures.plot_strategies(
            cells, names=STRATEGIES, rows="gamma", columns="width", ax=grid[row, column]
        )
        ax.set_title(f"{scene}, zone x {size:g}", fontsize=10)
        ax.set(xlabel="width [m]" if row else "", ylabel="gamma" if column == 0 else "")
fig.supxlabel(key, fontsize=11)
record.figure(fig, "passage")

# %%
share = atlas.assign(good=~atlas["strategy"].isin(["h < 0", "infeasible", "deadlock"]))
by_gamma = share.groupby(["gamma", "scene"])["good"].mean().unstack()
record.key["share of good endings at gamma = 0.05"] = float(share[share["gamma"] == 0.05]["good"].mean())
by_gamma.style.format("{:.0%}", na_rep="").format_index("{:g}")

# %% [markdown]
# Share of runs that end at the goal with a plan at every step, by gamma. Too small, and the robot is pushed
# back for so long that time runs out; too large, and it drives into places from which there is no way out.
#
# ## An example of each
#
# Of each name the run that is nearest to gamma = 0.05, the paper's widths and pace, and the plaza's zone.

# %%
distance = (
    np.abs(np.log(atlas["gamma"] / 0.05))
    + np.abs(np.log(atlas["width"] / atlas["scene"].map(SCENES)))
    + np.abs(np.log(atlas["pace"] / 0.5))
    + np.abs(np.log(atlas["size"]))
)
nearest = atlas.assign(distance=distance).sort_values("distance").groupby("strategy").head(1)
examples = {cell["strategy"]: AtlasCell(**{k: cell[k] for k in named}) for cell in nearest.to_dict("records")}
logs = {name: examples[name].run(REFERENCE) for name in STRATEGIES if name in examples}
record.check(
    "each example is what it stands for", all(classify_strategy(log) == name for name, log in logs.items())
)

# %%
fig, grid = plt.subplots(3, 2, figsize=(13, 13), layout="constrained")
for ax, (name, log) in zip(grid.flat, logs.items(), strict=False):
    cell = examples[name]
    log.plot(every=3.0, ax=ax).get_legend().remove()
    settings_text = f"gamma {cell.gamma:g}, {cell.width:g} m, {cell.pace:g} m/s, zone x {cell.size:g}"
    ax.set_title(f"{name}: {cell.scene}, {settings_text}", fontsize=10)
for ax in grid.flat[len(logs) :]:
    ax.axis("off")
figures.add_shared_legend([grid[0, 0]])
record.figure(fig, "examples")

# %%
missing = [name for name in STRATEGIES if name not in examples]
Markdown(f"In the whole atlas it never *{'*, never *'.join(missing)}*." if missing else "Each name occurs.")

# %% [markdown]
# ## Yielding against efficiency
#
# That sentence of the paper, with the zone at hand: how long the robot yields, and when it arrives, for zones of
# other sizes. Each point is a run, its number the size of the zone.

# %%
SIZES = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2)
zone = record.cache.ellipse()
cells = [AtlasCell(scene, gamma, width, size=size) for scene, width in SCENES.items() for size in SIZES]
curve = run_atlas(cells, zone, n_jobs=n_jobs)
curve.pivot(index="size", columns="scene", values=["time_yielding", "time_to_goal"]).round(1)

# %%
fig, panels = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
for ax, (scene, rows) in zip(panels, curve.groupby("scene", sort=False), strict=True):
    ax.plot(rows["time_yielding"], rows["time_to_goal"], "o-", color=figures.BLUE, linewidth=1)
    for point in rows.itertuples():
        at = (point.time_yielding, point.time_to_goal)
        ax.annotate(f"{point.size:g}", at, (4, -10), textcoords="offset points", fontsize=8)
    ax.margins(0.12)
    ax.set(xlabel="yields for [s]", ylabel="at the goal after [s]", title=scene)
record.figure(fig, "trade")

# %%
slopes = {}
for scene, rows in curve.dropna().groupby("scene", sort=False):
    more, later = (
        np.polyfit(rows["size"], rows[name], 1)[0] / 10 for name in ("time_yielding", "time_to_goal")
    )
    slopes[scene] = f"{more:+.2f} s of yielding and {later:+.2f} s to the goal"
    record.claim(
        f"{scene}: a larger zone yields longer and arrives later", more > 0 and later > 0, slopes[scene]
    )
Markdown("For each tenth that the zone is larger: " + "; ".join(f"{k}: {v}" for k, v in slopes.items()) + ".")

# %%
near = corridor[(corridor["width"] == 4.6) & (corridor["pace"] == 0.5)].set_index(["gamma", "size"])
times = near["time_to_goal"]
record.key["corridor: to the goal with gamma 0.03, 0.07 [s]"] = [float(times[g, 1.0]) for g in (0.03, 0.07)]
Markdown(
    "To the goal of the corridor of the paper, with our settings: gamma from 0.03 to 0.07 takes it from "
    f"{times[0.03, 1.0]:.1f} to {times[0.07, 1.0]:.1f} s; "
    f"the zone from 1.25 to 0.75 times from {times[0.05, 1.25]:.1f} to {times[0.05, 0.75]:.1f} s."
)

# %% [markdown]
# **What it means.** The size of the zone trades yielding against time, as the paper says, and so does gamma.
# Neither is free: on one side of the maps the robot is pushed back until time is up, on the other it drives
# into places from which there is no way out. Nor is a small zone always the safe choice: in a passage of 3 m
# with half the zone the robot stays inside beside the person, and is squeezed against the wall.

# %%
record.close()

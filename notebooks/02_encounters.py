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
#     label: encounters
#     paper: sec. 2, fig. 2-3
#     aim: say when two people meet alone, and compute where one sees the other.
#     asks: When do two people meet with nobody else around?
#     needs:
#     - '01'
#     exercises:
#     - 1.2-1.3
#     week: 1
# ---

# %% [markdown]
# # 2 - Encounters of two people
#
# **Question.** When do two people meet with nobody else around, and what does each see of the other?
#
# **Expectation.** Around a walking person there is a place that others do not enter.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [01](01_tracks.ipynb) · next: [3 - Outliers](03_outliers.ipynb) ·
# [paper](https://arxiv.org/abs/2405.15101): sec. 2, fig. 2-3 · 25 min · needs [01](01_tracks.ipynb) ·
# exercises: [1.2-1.3](exercises/sheet1_tracks.ipynb#1.2-The-line-of-sight-(10-min))
#
# **Afterwards you can** say when two people meet alone, and compute where one sees the other. **Words.**
# *reference pedestrian*: the person of an encounter from whom we look at the other.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
space_width = 4.0  # of the attentional space [m]
space_length = 5.0
duration = 3.0  # of a window [s]
min_distance = 1.0  # of the other person when it opens [m]
min_speed = 0.4  # of the reference pedestrian [m/s]
has_walls = False  # True: the outline of the area is a wall, and the space may reach beyond it
examples = 25  # paths drawn

# %% jupyter={"source_hidden": true}
# Set-up, and the figure
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import plots
from IPython.display import Markdown
from studies import real_day

import szlib
from szlib.tracks import funnels
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord, parameters

record = NotebookRecord("02_encounters", globals())
conditions = record.cache.method.encounter_settings()  # of an encounter
space = conditions.space
beyond = "allowed" if has_walls else "not allowed"
tracks = record.cache.tracks()
square = record.cache.find_area(tracks)
samples = record.cache.store_encounters(szlib.find_encounters(tracks, square=square, settings=conditions))
count = samples["encounter"].nunique()
fig = plots.draw_space_and_paths(plots.reference_frame(tracks, samples), n_shown=examples)
record.figure(fig, "paths")

# %% jupyter={"source_hidden": true}
# Parameters, with sources
parameters(
    [
        ("attentional space", f"{space.width:g} m x {space.length:g} m", PAPER, "sec. 2"),
        ("ahead of the person", not space.centred, ASSUMED, "people attend to what they walk towards"),
        ("window", f"{duration:g} s", PAPER, f"{round(10 * duration) + 1} samples of 0.1 s"),
        ("distance at the opening", f">= {min_distance:g} m", PAPER, "people closer than 1 m walk together"),
        ("speed of the reference pedestrian", f">= {min_speed:g} m/s", PAPER, "a direction is needed"),
        ("space beyond the area", beyond, ASSUMED, "unless the outline is a wall"),
        ("other person inside the space", "at the opening", ASSUMED, "see below: two readings"),
    ]
)

# %% jupyter={"source_hidden": true}
# This data in numbers
first = samples.groupby("encounter").first()
per_day = count / max(tracks["day"].nunique(), 1)
close = samples[samples["distance"] <= record.cache.method.r_max]
near = float(close.groupby("encounter")["distance"].min().quantile(0.05))
companions = float((first["kind"] == "companions").mean())
record.key |= {"encounters": count, "samples": len(samples)}
numbers = {
    "encounters": f"{count:,}",
    "encounters in a person-hour": f"{count / (len(tracks) / 36_000):.3g}",
    "of companions": f"{companions:.0%}",
    "of people who walk towards each other": f"{(first['kind'] == 'opposite').mean():.0%}",
    "one in twenty of the encounters within 2 m comes nearer than": f"{near:.2f} m",
}
note = (
    "The plaza is built to be busy: every pair meets. Here most people are never alone with one other person, and "
    f"{companions:.0%} of the encounters are of companions, who walk near each other by choice."
)
real_day.compare_with_plaza(record, numbers, note)

# %% [markdown]
# ## A number first
#
# You walk straight ahead. Someone is 1 m ahead of you and 1 m to your left: at (1, 1) in your own frame. Their distance is
# $\sqrt{1^2 + 1^2}$ = **1.41 m**. You see them at **45°**. This is the *line-of-sight angle* (LOS): 0° is straight ahead, left is
# positive, 180° is behind you.
#
# The person whose frame it is, you, is called the *reference pedestrian*. You turn, and the frame turns with you. Say you stand
# at (2, 1) on the map and walk in the direction of y. Someone is at (1, 2). That is 1 m ahead and 1 m to the left again: 45°.


# %%
def line_of_sight(ref, heading, other):
    """Angle [rad] and distance [m] at which the reference pedestrian sees the other person."""
    ahead = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-ahead[1], ahead[0]])
    x, y = (other - ref) @ ahead, (other - ref) @ left
    return np.arctan2(y, x), np.hypot(x, y)


angle, distance = line_of_sight(np.array([2, 1]), np.pi / 2, np.array([1, 2]))
print(f"LOS {np.degrees(angle):.0f} deg, distance {distance:.2f} m")

# %% [markdown]
# ## Four conditions
#
# The paper watches a rectangle ahead of the person, 5 m long and 4 m wide: the *attentional space*. An *encounter* is
# a window of 3 s in which all of this holds:
#
# 1. the four corners of the space stay inside the open area;
# 2. one other person is in the space when the window opens, and nobody else enters it;
# 3. when it opens, the other person is at least 1 m away;
# 4. the reference pedestrian walks at 0.4 m/s or faster, all the time.
#
# Try it on two people in an empty hall. Anna walks to the right at 1.2 m/s, Ben comes towards her at 1.0 m/s, 0.8 m to
# her left. He starts 6 m ahead of her. (Condition 1 holds everywhere in a large hall, and there is no third person who
# could enter the space.)

# %%
t = np.arange(0, 6, 0.1)
anna = np.column_stack([1.2 * t, 0 * t])
ben = np.column_stack([6 - 1.0 * t, 0 * t + 0.8])
los, r = np.transpose([line_of_sight(a, 0.0, b) for a, b in zip(anna, ben, strict=True)])
x, y = r * np.cos(los), r * np.sin(los)
opens = (x >= 0) & (x <= 5) & (abs(y) <= 2) & (r >= 1)
start = np.flatnonzero(opens)[0]
window = slice(start, start + 31)  # 3 s: 31 samples, 0.1 s apart
print(f"opens at {t[start]:.1f} s: LOS {np.degrees(los[start]):.0f} deg, {r[start]:.2f} m away")
print(f"nearest: {r[window].min():.2f} m; at the end LOS {np.degrees(los[window][-1]):.0f} deg")

# %% [markdown]
# Ben leaves the space 2.2 s after the window opens, when he is beside Anna. The window goes on, so that we see him pass.
# At its end he is behind her. For Ben the same meeting is a second encounter, with himself as the reference pedestrian.

# %% jupyter={"source_hidden": true}
# Checks
rows = {"t": t, "day": "a", "vy": 0.0}
walks = [
    pd.DataFrame({"id": name, "x": path[:, 0], "y": path[:, 1], "vx": v, **rows})
    for name, path, v in ((1, anna, 1.2), (2, ben, -1.0))
]
met = szlib.find_encounters(pd.concat(walks), area="-20 30 -20 20")
hers = met[met["ref_id"] == 1].iloc[:31]
off = float(np.abs(hers["distance"] - r[window]).max())
record.check(
    "the library's distances are those by hand", off < 1e-9, f"largest difference {off:.0e} m", always=True
)
off = float(np.degrees(np.abs(hers["los_angle"] - los[window]).max()))
record.check(
    "the library's angles are those by hand", off < 1e-6, f"largest difference {off:.0e} deg", always=True
)
seen_by = met["ref_id"].nunique()
record.check(
    "each of the two is once the reference pedestrian", seen_by == 2, f"{seen_by} people", always=True
)

# %% [markdown]
# ## The same with the library
#
# `szlib.find_encounters(tracks)` does this for everybody at every 0.1 s. Windows of one reference pedestrian do not overlap.

# %%
samples[["encounter", "ref_id", "other_id", "los_angle", "distance", "speed", "kind"]].head(3).round(2)

# %% jupyter={"source_hidden": true}
# Checks
size = round(10 * duration) + 1
sizes = samples.groupby("encounter").size()
evidence = f"{sizes.min()} to {sizes.max()} samples"
record.check(f"each encounter has {size} samples", (sizes == size).all(), evidence, always=True)
nearest, slowest = float(first["distance"].min()), float(samples["speed"].min())
away = f"at the opening the other person is at least {min_distance:g} m away"
record.check(away, nearest >= min_distance, f"{nearest:.2f} m", always=True)
x, y = (first["distance"] * part(first["los_angle"]) for part in (np.cos, np.sin))
there = (x > -1e-9) & (x < space.length + 1e-9) & (y.abs() < space.width / 2 + 1e-9)
evidence = f"{x.min():.2f} to {x.max():.2f} m ahead"
record.check("at the opening the other person is inside the space ahead", there.all(), evidence, always=True)
walks = slowest >= min_speed
record.check("the reference pedestrian walks throughout", walks, f"at least {slowest:.2f} m/s", always=True)
if data == "atc-1hz":
    what = "as many encounters a day as in the paper (176), within a factor of two"
    record.claim(what, 0.5 < per_day / 176 < 2, f"{per_day:.0f} a day")

# %% [markdown]
# **What do you think?** What happens to the number of encounters if the window is 5 s instead of 3 s? And with 1 s?

# %% jupyter={"source_hidden": true}
# Figure
if record.cache.is_synthetic:  # its people are seen for 3.4 s only; here for 8 s
    longer = szlib.PlazaSettings(n_encounters=500, tracked=8.0)
    people = szlib.read_tracks(szlib.make_plaza(record.out / "02_longer.csv", seed=seed, settings=longer))
else:
    people = tracks
windows = (1.0, 2.0, 3.0, 5.0)
found = [szlib.find_encounters(people, square=square, duration=w)["encounter"].nunique() for w in windows]
fig, ax = plt.subplots(figsize=(6.5, 3.2), layout="constrained")
bars = ax.bar(
    [f"{w:g} s" for w in windows], found, color=[figures.BLUE if w == 3 else figures.GREY for w in windows]
)
ax.bar_label(bars)
ax.set(xlabel="length of the window", ylabel="encounters", ylim=(0, 1.12 * max(found)))
ax.set_title(f"A window of 5 s finds {1 - found[3] / max(found[2], 1):.0%} fewer encounters than one of 3 s")
record.figure(fig, "windows")

# %% [markdown]
# <details><summary>Answer</summary>
#
# A longer window finds fewer. The conditions have to hold longer: both people must be tracked, the space must stay in the
# area, and nobody else may enter. Also one meeting gives fewer windows that do not share a sample. A window of 1 s has 11
# samples, so the next one begins 1.1 s later: a meeting of 7 s is six encounters of 1 s, two of 3 s, and one of 5 s. So a number of encounters says nothing without the length of the window.
# (The plaza of this figure has 500 pairs who are seen for 8 s.)
#
# </details>

# %% [markdown]
# ## Distance and line of sight
#
# A *sample* is one line of the table above: one position of the other person, as the reference pedestrian sees it. Now put
# every sample of every encounter around one person who walks to the right.
#
# **What do you think?** Where is it empty? Is the empty place a circle?

# %% jupyter={"source_hidden": true}
# Figure
ax = plots.plot_relative_positions(samples, r_max=record.cache.method.r_max)
record.figure(ax.figure, "los")

# %% jupyter={"source_hidden": true}
# Figure
ax = plots.plot_distance_by_direction(samples, r_max=record.cache.method.r_max)
ax.figure.set_size_inches(7, 3.8)
record.figure(ax.figure, "los-distance")

# %% [markdown]
# <details><summary>Answer</summary>
#
# Around the person there is a place where few others are. Read its edge off the line in the second figure, at 0° (ahead)
# and at ±90° (beside). On the plaza it is no circle: it is longer ahead than beside. On a real day some directions have too few
# encounters to say. A few samples lie far inside. They may be people who brush past, or errors: chapter 03.
#
# </details>

# %% [markdown]
# ## Who they are to each other
#
# The paper takes everybody. But two people who walk together stay near each other by choice: their distance says nothing
# about respect between strangers. The column `kind` marks such pairs as *companions*, from their whole common track. All
# others are *strangers*: their kind says how the two walk at the opening. `szlib.of_kind(samples, "strangers")` leaves
# companions out. Chapter 05 takes everybody, chapter 06 shows both.

# %%
first["kind"].value_counts().to_frame("encounters")

# %% jupyter={"source_hidden": true}
# Checks
kinds = first["kind"].value_counts()
record.key["strangers"] = szlib.of_kind(samples, "strangers")["encounter"].nunique()
walked = tracks.set_index(["day", "id", "t"])[["vx", "vy"]]
own, theirs = (
    walked.loc[pd.MultiIndex.from_frame(first[["day", name, "t"]])].to_numpy()
    for name in ("ref_id", "other_id")
)
towards = (own * theirs).sum(axis=1) < 0  # more than 90 deg between the velocities
share = {kind: float(towards[first["kind"] == kind].mean()) for kind in ("opposite", "same direction")}
apart = share["opposite"] > 0.95 and share["same direction"] < 0.05
what = "as the window opens, opposite pairs walk towards each other, others of one direction do not"
evidence = "towards each other: " + ", ".join(f"{value:.0%} of {kind}" for kind, value in share.items())
if kinds.reindex(list(share)).min() >= 20:  # among fewer, one exception is more than 5 %
    record.check(what, apart, evidence)
else:
    record.claim(what, None, evidence)

# %% [markdown]
# ## Two readings of one sentence
#
# The paper writes: "Only one other pedestrian is present in this space for a duration of 3 seconds". Must that person
# *stay* inside for 3 s? We said no.
#
# **What do you think?** If yes: how many encounters remain, and where do you never see anybody?

# %% jupyter={"source_hidden": true}
# Figure
strict = szlib.find_encounters(tracks, square=square, settings=conditions, throughout=True)
fig, both = plt.subplots(1, 2, figsize=(10, 4), layout="constrained", sharex=True, sharey=True)
behind, r_max = [], record.cache.method.r_max
for ax, name, each in zip(both, ("at the opening", "throughout"), (samples, strict), strict=True):
    plots.plot_relative_positions(each, r_max=r_max, ax=ax)
    behind.append(int((each["los_angle"].abs() > np.pi / 2)[each["distance"] <= r_max].sum()))
    n = each["encounter"].nunique()
    ax.set_title(f"inside {name}: {n:,} encounters,\n{behind[-1]:,} close samples behind the person")
record.figure(fig, "readings")

# %% jupyter={"source_hidden": true}
# Checks, and the answer
record.check("the chosen reading sees people behind the person", behind[0] > 0, f"{behind[0]:,} samples")
Markdown(
    f"<details><summary>Answer</summary>\n\n{strict['encounter'].nunique():,} of {count:,} encounters remain. Two people who walk "
    "towards each other close in at 2.4 m/s, if each walks at 1.2 m/s: in 2 s they are past each other, and the other person has left the "
    "space. The strict reading never sees a pass, and never an angle beyond 90°. A zone needs a back, so we take the "
    "other reading.\n\n</details>"
)

# %% [markdown]
# ## Three common mistakes
#
# - **"The line-of-sight angle is measured on the map."** No. It is measured from the direction in which the reference pedestrian
#   walks at that moment. Someone who stands still has no direction of motion, so condition 4 asks for a speed.
# - **"One meeting is one encounter."** No. Each of the two may be the reference pedestrian, and a long meeting has several windows.
#   Samples of one meeting are not independent. So chapter 05 draws pairs of people for its intervals, not samples.
# - **"A busy place gives more encounters."** Not without end: where a third person is always near, nobody is alone with another.

# %% jupyter={"source_hidden": true}
# What we know now
lost = {reason: n for stage in funnels.get(samples)[-2:] for reason, n in stage["rejected"].items()}
reason = max(lost, key=lost.get)
Markdown(
    f"**What we know now.** There are {count:,} encounters, {per_day:,.0f} a day; the paper has 176 a day. At most other moments no "
    f"encounter opens. The main reason: {reason}. Of the encounters within 2 m, one in twenty comes nearer than {near:.2f} m; around a walking person "
    f"there is a place where few others are. The nearest of all came to {samples['distance'].min():.2f} m: is that true? Chapter 03 asks."
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

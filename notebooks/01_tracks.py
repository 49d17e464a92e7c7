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
#     label: tracks
#     paper: sec. 2, fig. 1
#     aim: bring files of tracks to one clock, and say where two people can be watched.
#     asks: Where do people walk, how fast, and where is open space?
#     exercises:
#     - '1.1'
#     - 1.4-1.5
#     week: 1
# ---

# %% [markdown]
# # 1 - Tracks and the area
#
# **Question.** What can go wrong with tracks of people, and where can two of them be watched?
#
# **Expectation.** We can put all people on one clock, measure a speed that noise does not inflate, and find
# an area without obstacles.

# %% [markdown]
# before: [00](00_start_here.ipynb) · next: [2 - Encounters of two people](02_encounters.ipynb) ·
# [paper](https://arxiv.org/abs/2405.15101): sec. 2, fig. 1 · 20 min · exercises:
# [1.1](exercises/sheet1_tracks.ipynb#1.1-Velocity-(5-min)),
# [1.4-1.5](exercises/sheet1_tracks.ipynb#1.4-What-one-sample-a-second-loses-(20-min))
#
# **Afterwards you can** bring files of tracks to one clock, and say where two people can be watched.
# **Words.** *EWAP*: the walking pedestrians recorded at ETH Zürich, and the format of their files,
# `obsmat`; *tidy*: of a table: one row for each observation, one column for each quantity.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
reading = {}  # options of szlib.Recipe, such as {"unit": "mm", "columns": {"t": "Zeit"}}
seed = 0
results = "../results"

# %% jupyter={"source_hidden": true}
# Set-up, and the figure
import warnings

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import plots
from IPython.display import Markdown
from studies import real_day

import szlib
from szlib.tracks import clock, funnels, readers
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, NotebookRecord, parameters

record = NotebookRecord("01_tracks", globals())
gap_reason = "after a longer gap the next row is another person in about half of the cases"
files, options = record.cache.files(), record.cache.method.read_options()
raw = readers.read_raw(files, recipe=options)
people = clock.to_clock(raw, max_gap=options.max_gap)
if people["day"].nunique() > 1:
    people = record.cache.tracks()  # recordings of several places stand side by side
square = record.cache.find_area(people)
inside = square.contains(people["x"], people["y"])
speed = np.hypot(people["vx"], people["vy"])
walking = speed[speed > 0.4]
fig = plots.draw_map_and_speeds(people, square, share=inside.mean(), median=walking.median())
record.figure(fig, "map")

# %% jupyter={"source_hidden": true}
# Parameters, with sources
parameters(
    [
        ("clock", "0.1 s", ASSUMED, "two people's samples must coincide; the paper's control step"),
        ("velocity span", f"+-{clock.VELOCITY_SPAN} s", ASSUMED, "a step is about 0.5 s: less sees the sway"),
        ("longest gap", "0.5 s raw, 1.6 s at 1 Hz", MEASURED, gap_reason),
        ("event days", "none left out", ASSUMED, "the paper removed them by hand; pass exclude="),
        ("area", record.cache.area or "the data's own", ASSUMED, "the paper names none; see below"),
    ]
)

# %% jupyter={"source_hidden": true}
# This data in numbers
n_people = int(raw.groupby("day", observed=True)["id"].nunique().sum())
person_hours = len(people) / 36_000
rate = 1 / raw.groupby(["day", "id"], observed=True)["t"].diff().median()
numbers = {
    "people": f"{n_people:,}",
    "time that they were seen": f"{person_hours:.0f} person-hours",
    "samples of a person": f"{rate:.0f} a second",
    "walking speed, median": f"{walking.median():.2f} m/s",
    "person-time in the area": f"{inside.mean():.0%}",
}
record.key |= {"rows": len(raw), "people": n_people, "median speed": float(walking.median())}
note = (
    "On the plaza all people are pairs who meet, and they are only seen while they do. Here people come and go "
    f"as they like: they spend {inside.mean():.0%} of their time in the area. Speeds of walkers gather "
    f"around {walking.median():.1f} m/s; on the plaza they are spread evenly."
)
real_day.compare_with_plaza(record, numbers, note)

# %% [markdown]
# The paper uses 92 days of the ATC mall in Osaka (Brščić et al., 2013). By default this workbook uses a
# *synthetic plaza*: artificial people who keep a distance that we know. So each later result can be compared
# with the truth. `szlib run --data atc-1hz` repeats all of it on a real day.

# %% [markdown]
# ## A number first
#
# A sensor sees a person at x = 5.00 m, and 0.05 s later at x = 5.06 m. How fast is that?
#
# 6 cm in 0.05 s are **1.2 m/s**. But let each position be wrong by at most 1 cm. Then the person moved by something
# between 4 cm and 8 cm: at 0.8 to 1.6 m/s. The two samples say little.
#
# Now take two samples that are 1 s apart: 1.20 m. The same errors give **1.18 to 1.22 m/s**.


# %%
def measure_speed(x, t, span):
    """Displacement from span/2 before to span/2 after each time, over the span."""
    return (np.interp(t + span / 2, t, x) - np.interp(t - span / 2, t, x)) / span


t = np.arange(0, 10, 0.05)
x = 1.2 * t + np.random.default_rng(0).normal(0, 0.01, len(t))  # 1.2 m/s; standard deviation 1 cm

# %% [markdown]
# **What do you think?** The person walks at exactly 1.2 m/s. Between which values does the measured speed lie,
# over 0.1 s and over 1 s?

# %% jupyter={"source_hidden": true}
# Figure
middle = (t > 1) & (t < 9)
spread = {span: measure_speed(x, t, span)[middle].std() for span in (0.1, 1.0)}
fig, ax = plt.subplots(figsize=(8, 3.4), layout="constrained")
for span, colour, line in ((0.1, figures.ORANGE, ":"), (1.0, figures.BLUE, "-")):
    ax.plot(t[middle], measure_speed(x, t, span)[middle], line, color=colour, label=f"over {span:g} s")
ax.set(xlabel="time [s]", ylabel="speed [m/s]", ylim=(0, 2.6))
ax.set_title(
    f"Noise of 1 cm makes {100 * spread[0.1]:.0f} cm/s over 0.1 s, {100 * spread[1.0]:.1f} cm/s over 1 s"
)
ax.legend(loc="lower right")
record.figure(fig, "noise")

# %% [markdown]
# <details><summary>Answer</summary>
#
# Two errors with standard deviation $\sigma$ make a speed with standard deviation $\sqrt2\,\sigma / \Delta t$, where
# $\Delta t$ is the time between the samples. With $\sigma$ = 1 cm that is 14 cm/s over 0.1 s, and 1.4 cm/s over
# 1 s. Nearly all measured speeds lie within two standard deviations: 0.92 to 1.48 m/s, and 1.17 to 1.23 m/s. Over 1 s a real
# change of speed is smoothed, too. That is the price.
#
# </details>

# %% jupyter={"source_hidden": true}
# Checks
for span, found in spread.items():
    expected = np.sqrt(2) * 0.01 / span
    evidence = f"{100 * found:.1f} cm/s, expected {100 * expected:.1f} cm/s"
    what = f"noise of 1 cm makes the speed over {span:g} s uncertain by sqrt(2) cm / {span:g} s, within 25 %"
    record.check(what, abs(found / expected - 1) < 0.25, evidence, always=True)

# %% [markdown]
# ## One clock
#
# A sensor does not see everybody at the same moment. Anna is seen at 1.97 s (x = 4.96 m) and at 2.01 s
# (x = 5.00 m). Where is she at 2.00 s? Three quarters of the way: at 4.99 m.

# %%
print(f"Anna at 2.00 s: x = {np.interp(2.00, [1.97, 2.01], [4.96, 5.00]):.2f} m")

# %% [markdown]
# `szlib.read_tracks(file)` does this for everybody at all multiples of 0.1 s, and takes the velocity over 1 s. It reads ATC raw
# files, the public day at 1 Hz, EWAP `obsmat`, tidy tables and others. A person is a pair *(day, id)*; `t` is in seconds, since
# 1970 where the file has dates, `x` and `y` are in m, `vx` and `vy` in m/s.

# %%
people[["day", "id", "t", "x", "y", "vx", "vy"]].head(3).round(2)

# %% [markdown]
# ## What can go wrong
#
# Two people walk towards each other at 1.2 m/s. Five things go wrong with their record.
#
# **What do you think?** Which of the five does a program notice by itself?


# %%
def spoil(fault):
    t = np.arange(0, 6, 0.1)
    one = pd.DataFrame({"t": t, "id": 1, "x": 1.2 * t, "y": 0.0})
    both = pd.concat([one, one.assign(id=2, x=7 - 1.2 * t)], ignore_index=True)
    late = both["t"] > 2.9
    if fault == "a jump":
        both.loc[late & (both["id"] == 1), "x"] += 3
    if fault == "swapped ids":
        both.loc[late, "id"] = 3 - both.loc[late, "id"]
    if fault == "a gap":
        both = both[(both["id"] == 2) | (both["t"] < 2) | (both["t"] > 3.5)]
    if fault == "millimetres":
        both["x"] *= 1000
    if fault == "milliseconds":
        both["t"] *= 1000
    return both


# %% jupyter={"source_hidden": true}
# Figure
FAULTS = ("a good record", "a jump", "swapped ids", "a gap", "millimetres", "milliseconds")
fig, axs = plt.subplots(2, 3, figsize=(10, 5), layout="constrained")
for ax, fault in zip(axs.flat, FAULTS, strict=True):
    for person, marker, colour in ((1, "o", figures.BLUE), (2, "^", figures.ORANGE)):
        rows = spoil(fault).query("id == @person")
        ax.plot(rows["t"], rows["x"], marker, color=colour, ms=3, label=f"id {person}")
    ax.set(title=fault, xlabel="time [s]", ylabel="x [m]")
figures.add_shared_legend(axs.flat)
fig.suptitle("Two people walk towards each other: one good record, and five bad ones")
record.figure(fig, "faults")

# %% jupyter={"source_hidden": true}
# What the reader does with each record
found, fastest = {}, {}
warnings.simplefilter("ignore", szlib.DataWarning)  # which say the same as the table below
for fault in FAULTS:
    try:
        tracks = szlib.read_tracks(spoil(fault))
        found[fault] = int(clock.clock_index(tracks)[2].max()) + 1  # pieces without a gap
        fastest[fault] = float(np.hypot(tracks["vx"], tracks["vy"]).max())
    except szlib.DataError:
        found[fault] = 0

# %% jupyter={"source_hidden": true}
# Checks, and the answer
refused = [fault for fault, pieces in found.items() if not pieces]
evidence = f"refused: {', '.join(refused)}"
record.check(
    "the reader refuses a wrong unit and a wrong clock", refused == [*FAULTS[4:]], evidence, always=True
)
is_cut, evidence = found["a gap"] == 3, f"{found['a gap']} pieces of 2 tracks"
record.check("the reader ends a track at a gap of 1.5 s", is_cut, evidence, always=True)
is_missed = found["a jump"] == found["swapped ids"] == 2
record.check("the reader does not see a jump or swapped ids", is_missed, "2 pieces of 2 tracks", always=True)
Markdown(
    "<details><summary>Answer</summary>\n\n"
    "| what is wrong | what the reader does | how you find it |\n|---|---|---|\n"
    f"| a jump of 3 m | nothing | a speed of {fastest['a jump']:.1f} m/s |\n"
    "| swapped ids | nothing | both people turn round at one moment, near each other |\n"
    "| a gap of 1.5 s | ends the track, and begins a new one | it is counted below |\n"
    "| a wrong unit | refuses the file if people would be too slow or too fast, and says which unit to pass | the message |\n"
    "| a wrong clock | refuses the file | the message |\n\nDoubled rows and missing numbers are left out and counted.\n\n</details>"
)

# %% [markdown]
# So look for the faults that the reader cannot see. A jump shows in the fastest second of each person:

# %%
fastest_second = speed.groupby([people["day"], people["id"]], observed=True).max()
too_fast = int((fastest_second > 3).sum())
print(f"{too_fast} of {len(fastest_second):,} people move faster than 3 m/s in some second")
print(f"the fastest: {fastest_second.max():.1f} m/s")

# %% jupyter={"source_hidden": true}
# What is wrong with this data
stages = funnels.get(people)
rejected = sum(n for stage in stages for n in stage["rejected"].values())
n_gaps = int(clock.clock_index(people)[2].max()) + 1 - len(fastest_second)
if record.cache.is_synthetic:
    lines = sum(len(file.read_text().splitlines()) for file in files)
    what, evidence = "each line of the file entered the funnel", f"{lines:,} lines"
    record.check(what, lines == stages[0]["entered"], evidence, always=True)
Markdown(
    f"**This data**: {len(raw):,} rows of {n_people:,} people. {rejected:,} rows could not be used. {n_gaps:,} gaps end a track. "
    f"{too_fast:,} people have a second above 3 m/s: these may run, or their tracks jump. Nothing was removed in silence: "
    "every table carries its *funnel*, which counts the rows that came in, the rows that went on, and why others did not. "
    "Notebook 24 judges whole days."
)

# %% [markdown]
# ## The area
#
# Two people can only be watched where nothing is in their way: no pillar, no shop, no queue. The paper names "the
# rectangular central square" without coordinates (fig. 1). In the mall the largest open rectangle is x from -18.5
# to -7.5 m, y from -10 to 8 m. The plaza has the same. For other data `auto` takes the outline of the
# place where people were seen. It may hold furniture and pillars: gaps between people narrower than 4 m are closed.
#
# A test of openness that needs no map: do people walk on each square metre of it?

# %% jupyter={"source_hidden": true}
# Figure, and check
(x0, x1), (y0, y1) = square.x, square.y
cells = [np.arange(x0, x1 + 1e-9), np.arange(y0, y1 + 1e-9)]  # of 1 m
seconds = np.histogram2d(people["x"], people["y"], bins=cells)[0].T / 10
used = float((seconds > 0).mean())
fig, ax = plt.subplots(figsize=(6, 4.6), layout="constrained")
shown = ax.pcolormesh(*cells, np.ma.masked_equal(seconds, 0), cmap="viridis", rasterized=True)
fig.colorbar(shown, ax=ax, label="person-seconds on the square metre")
figures.label_metres(ax, f"People walk on {used:.0%} of the area's square metres")
record.figure(fig, "open")
if not area and square.is_rectangle:
    what = "the area is open: people walk in nine tenths of it"
    record.check(what, used >= 0.9, f"{used:.0%} of its square metres")
record.key["area [m2]"] = round(square.area, 1)

# %% [markdown]
# ## Three common mistakes
#
# - **"The file has a column with the velocity, so I use it."** It may come from the noise of the sensor. People who stand still
#   then move at 0.3 m/s and more. Take the displacement over a second.
# - **"One id is one person."** A person who disappears behind another comes back with a new id. Numbers of people are numbers of
#   tracks.
# - **"Nobody walks there, so there is a wall."** Perhaps nobody had a reason to. And the other way round: a map of people shows no
#   low shelf between two paths. Look at the place.

# %% jupyter={"source_hidden": true}
# What we know now
Markdown(
    f"**What we know now.** {n_people:,} people are on one clock, in metres, for {person_hours:.0f} person-hours. Their median walking "
    f"speed is {walking.median():.2f} m/s, measured over 1 s, where noise of 1 cm makes an error of {100 * spread[1.0]:.1f} cm/s. They spend "
    f"{inside.mean():.0%} of their time in an open area of {square.area:.0f} m². When do two of them meet there? That is chapter 02."
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

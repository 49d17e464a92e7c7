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
#     label: data quality
#     paper: sec. 2
#     aim: judge whether a file of tracks can be used, and find days unlike the others.
#     asks: Can a file of tracks be trusted? How are 92 days processed?
#     needs:
#     - '03'
# ---

# %% [markdown]
# # 24 - Data quality
#
# **Question.** Can a file of tracks be trusted, and which days are unlike the others?
#
# **Expectation.** Frames come irregularly, people get lost, noise inflates the sensor's own speed, and on event days
# people stand where they otherwise walk. Nothing is removed in silence: each row is used, or counted with a reason.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [23](23_comparison.ipynb) · next: [25 - What is
# true?](25_claims.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 2 · 25 min · needs
# [03](../03_outliers.ipynb)
#
# **Afterwards you can** judge whether a file of tracks can be used, and find days unlike the others.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
exclude = []

# %% jupyter={"source_hidden": true}
# Imports
import sys

sys.path.append("..")  # for `plots` and `studies`
from itertools import cycle
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import plots
from IPython.display import Markdown
from studies import hours as hours_study
from studies import quality

import szlib
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.tracks import funnels
from szlib.tracks.readers import CALENDAR_BEGINS, find_format
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, NotebookRecord, parameters, read_table

# %% jupyter={"source_hidden": true}
# The record of the run
record = NotebookRecord("24_data_quality", globals())
parameters(
    [
        ("standing", f"< {quality.STANDING:g} m in 1 s", MEASURED, "the sensor's noise stays below it"),
        ("gap that ends a track", "0.5 s raw, 1.6 s at 1 Hz", MEASURED, "no position is made up inside it"),
        ("area", str(record.cache.find_area()), ASSUMED, "only rows near it are kept"),
        ("excluded days", exclude or "none", ASSUMED, "event days, chosen by hand as in the paper"),
    ]
)

# %% jupyter={"source_hidden": true}
# Figure
files = record.cache.files()
options = record.cache.method.read_options()
if record.cache.is_synthetic:  # three more days; on the last one most people stand
    for day, (encounters, standing) in enumerate(((700, 0.08), (700, 0.08), (1000, 0.8))):
        file = record.out / f"plaza-day{day + 2}-{seed}.csv"
        date = f"2000-01-{3 + day:02}"
        plaza = PlazaSettings(n_encounters=encounters, standing=standing, date=date)
        files.append(make_plaza(file, seed=seed + day + 1, settings=plaza))
seconds = pd.concat([quality.summarise_seconds(file, options).assign(file=file.name) for file in files])
zone = options.tz or find_format(files[0], options).tz or "UTC"  # of the clock: that of the mall, or UTC
both = seconds.dropna(subset=["sensor_speed", "moved"])
if len(both):
    fig, ax = plt.subplots(figsize=(8, 3.6), layout="constrained")
    plots.plot_speed_histogram(both["sensor_speed"].to_numpy(), both["moved"].to_numpy(), ax=ax)
    slow = both.loc[both["moved"] < quality.STANDING, "sensor_speed"].median()
    ax.set_title(f"The file's velocity column gives {slow:.2f} m/s to people who stand still")
    ax.legend(loc="upper right")
    record.figure(ax.figure, "speeds")
    record.key["sensor speed of who stands [m/s]"] = round(float(slow), 3)
    record.claim("the velocity column is inflated for people who stand", slow > 0.3, f"{slow:.2f} m/s")

# %% [markdown]
# ## What the velocity column says
#
# The figure compares two speeds of the same person in the same second: the one in the file, and the displacement over 1 s.
#
# **In numbers.** A person stands. The sensor sees them with an error of about 1 cm, every 0.04 s. From one frame to the
# next the position jumps by about 2 cm, and 0.02 m / 0.04 s is 0.5 m/s. Over a whole second the same 2 cm make 0.02 m/s.
# So we never use the file's velocity, and compute speeds over a second or longer.

# %%
rng = np.random.default_rng(0)
seen = rng.normal(scale=0.01, size=(2000, 2))  # a person who stands at (0, 0), seen every 0.04 s [m]
from_frames = np.linalg.norm(seen[1:] - seen[:-1], axis=1) / 0.04
from_seconds = np.linalg.norm(seen[25:] - seen[:-25], axis=1) / 1.0
print(f"mean speed: {from_frames.mean():.2f} m/s from frames, {from_seconds.mean():.2f} m/s from seconds")

# %% [markdown]
# ## Frames, gaps, lengths of tracks, ids
#
# What else goes wrong in files of tracks, and what the workbook does about it:
#
# | problem | how it shows | what we do |
# |---|---|---|
# | irregular frames | times between frames differ | bring all people to one clock |
# | gap: a person is lost for a while | one time between two rows is long | end the track; make up no positions |
# | jump: another person, or an error of the sensor | a speed that nobody runs | warn above 100 m; smaller ones show in the fastest second (chapter 01) |
# | swapped ids: two people who come close exchange their ids | nothing, or a sharp turn | no repair; an encounter that is near and alone is removed (chapter 03) |
# | wrong unit or clock | people move at 1,000 m/s, or nobody walks | refuse the file, and suggest another reading |
#
# The next figure has three curves. Each says for which share of frames, or of people, a time is at most so long. *A
# person needs to be seen for 3 s without a gap to be in an encounter. Does this file have such people?*

# %% jupyter={"source_hidden": true}
# Figure
intervals = np.concatenate([quality.measure_frame_intervals(file, options) for file in files])
found = pd.concat([quality.summarise_people(file, options).assign(file=file.name) for file in files])
found["length"] = found["last_seen"] - found["first_seen"]
usual = float(np.median(intervals[intervals < 5]))
record.key["median frame interval [s]"] = round(usual, 4)
fig, ax = plt.subplots(figsize=(9, 3.8), layout="constrained")
for values, name, colour, line in (
    (intervals, "time from one frame to the next", figures.BLACK, ":"),
    (found["longest_gap"].dropna(), "longest gap of each person", figures.RED, "--"),
    (found["length"], "time for which each person is seen", figures.BLUE, "-"),
):
    ax.ecdf(np.maximum(values, 0.01), color=colour, linestyle=line, linewidth=2, label=name)
ax.axvline(3.0, color=figures.GREY, linewidth=1)
ax.text(2.9, 0.45, "3 s", color="#555555", ha="right")
ax.set(xscale="log", xlabel="time [s]", ylabel="share that is at most so long")
ax.set_xticks([0.01, 0.1, 1, 10, 100], ["0.01", "0.1", "1", "10", "100"])
ax.set_xlim(0.02, max(10.0, 1.5 * found["length"].quantile(0.99)))
long_enough, lost = (found["length"] >= 3).mean(), (found["longest_gap"] > 10 * usual).mean()
ax.set_title(
    f"Seen for 3 s: {100 * long_enough:.0f} % of the people; lost for ten frames: {100 * lost:.0f} %"
)
fig.legend(loc="outside lower center", ncols=3)
record.figure(fig, "times")

# %% jupyter={"source_hidden": true}
# Checks
record.check("frames are at most 1 s apart (median)", usual <= 1.0, f"{usual:.3f} s")
table = found.groupby("file").agg(
    people=("id", "nunique"),
    opens=("first_seen", "min"),
    closes=("last_seen", "max"),
    median_length=("length", "median"),
)
for name in ("opens", "closes"):
    local = pd.to_datetime(table[name], unit="s", utc=True).dt.tz_convert(zone)
    table[name] = local.dt.strftime("%H:%M:%S")
table["ids"] = found.groupby("file")["id"].agg(lambda ids: f"{ids.min()} to {ids.max()}")
table.rename(columns={"median_length": "median length [s]"}).round(2).head(7)

# %% [markdown]
# **A common mistake:** to close a gap by a straight line. The line may run through other people or through walls, and
# makes encounters that did not happen.
#
# ## Visits and standing people, to choose event days
#
# An event shows as a day, or an hour, with more visits than its neighbours, or with many people who stand. Weekdays are
# beside the dates: a Sunday is no event.

# %% jupyter={"source_hidden": true}
# Figure
has_dates = seconds["second"].min() > CALENDAR_BEGINS
recordings = {"": seconds} if has_dates else dict(list(seconds.groupby("file")))
counted = {name: quality.count_visits_by_hour(part, tz=zone) for name, part in recordings.items()}
hours = pd.concat(part if has_dates else part.assign(day=name) for name, part in counted.items())
days = hours.groupby("day", as_index=False).agg(visits=("visits", "sum"), standing=("standing", "mean"))
names = pd.to_datetime(days["day"]).dt.strftime("%a %Y-%m-%d") if has_dates else days["day"]
event = days["standing"] > 2 * days["standing"].median()
size = (10, 0.45 * len(days) + 1.4)
figure, panels = plt.subplots(1, 2, figsize=size, layout="constrained", sharey=True)
labels = {"visits": "visits [people]", "standing": "people who stand at a time, mean"}
for ax, (column, label) in zip(panels, labels.items(), strict=True):
    ax.barh(days.index[~event], days.loc[~event, column], color=figures.BLUE, label="usual")
    ax.barh(days.index[event], days.loc[event, column], color=figures.ORANGE, hatch="//", label="event?")
    ax.locator_params(axis="x", nbins=5)
    ax.set(xlabel=label, ylim=(len(days) - 0.4, -0.6))
panels[0].set_yticks(days.index, names)
panels[1].legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
unlike = ", ".join(names[event]) or "none of these days"
figure.suptitle(f"More than twice the usual number of people stand: {unlike}")
record.figure(figure, "days")
record.key["days like an event"] = int(event.sum())

# %% [markdown]
# The same by the hour. To compare, grey bars show the real day of the ATC mall, Wednesday 2012-10-24 (saved beside the
# notebooks). *Which hour of the mall would you look at before using it?*

# %% jupyter={"source_hidden": true}
# Figure
mall = record.committed_table("24_hours", hours_study.recompute, where="site == 'plaza'")
mall = mall[mall["site"] == "ATC day"]
figure, panels = plt.subplots(1, 2, figsize=(11, 3.8), layout="constrained")
for ax, (column, label) in zip(panels, labels.items(), strict=True):
    ax.bar(mall["hour"], mall[column], color="#CCCCCC", label="ATC mall, one day")
    shades = (figures.BLUE, figures.BLACK, figures.GREEN, figures.ORANGE, figures.RED)
    shown = list(zip(days["day"], cycle(shades), cycle("os^Dv"), strict=False))
    for number, (day, colour, marker) in enumerate(shown):
        own = hours[hours["day"] == day]
        beside = own["hour"] + 0.16 * (number - (len(shown) - 1) / 2)  # days do not hide each other
        ax.plot(beside, own[column], f"{marker}-", color=colour, linewidth=1, label=day)
    ax.set(xlabel="hour of the day", ylabel=label, ylim=(0, None))
few = mall.loc[mall["hour"].between(10, 18)].nsmallest(1, "visits").iloc[0]
figure.suptitle(
    f"In the mall {few['visits']:.0f} people are seen in the hour from {few['hour']:.0f}, "
    f"in a usual hour {mall['visits'].median():,.0f}"
)
figures.add_shared_legend(panels)
record.figure(figure, "hours")

# %% [markdown]
# <details><summary>Answer</summary>
#
# The hour from 12: it has a seventh of the people of the next one, and no mall is so empty at noon. The file holds only a
# part of this hour.
#
# </details>
#
# ## The funnel
#
# Every row of a file is counted at each stage, as `szlib inspect FILE` prints it. *How many of a million rows do you
# expect to end in an encounter?*

# %%
by_recording = not has_dates and len(files) > 1 and area in ("", "auto")  # each has its own area
conditions = record.cache.method.encounter_settings("auto" if by_recording else record.cache.find_area())
reading = {"settings": conditions, "recipe": options, "progress": False}
extraction = szlib.extract_days(files, out=record.out / "days", exclude=exclude, **reading)
samples = extraction.samples()

# %% jupyter={"source_hidden": true}
# Figure
stages = funnels.get(samples)
ax = plots.plot_funnel(funnels.table(stages))
n_encounters = samples["encounter"].nunique()
read = [stage for stage in stages if stage["stage"].startswith("read ")]
rows = sum(stage["entered"] for stage in read)
ax.set_title(f"{rows:,} rows of {len(files)} files hold {n_encounters:,} encounters")
record.figure(ax.figure, "funnel")
record.key |= {"rows": rows, "encounters": n_encounters}
done, failed = len(extraction.table), len(extraction.failed)
record.check("every file was read", failed == 0, f"{failed} of {done} days failed", always=True)
if record.cache.is_synthetic:
    lines = sum(len(Path(file).read_text().splitlines()) for file in files)
    found_rows = f"{rows:,} rows of {lines:,} lines"
    record.check("each line of the files entered the funnel", rows == lines, found_rows, always=True)
extraction.table[["day", "files", "rows", "unusable", "encounters"]].head(7)

# %% jupyter={"source_hidden": true}
# The answer
Markdown(
    f"<details><summary>Answer</summary>\n\n{1e6 * len(samples) / max(rows, 1):,.0f} of a million: {len(samples):,} samples of "
    f"{n_encounters:,} encounters, 0.1 s apart. Most rows are dropped at one stage: a window of 3 s can open at a row only if both "
    "people are seen throughout, near enough, and alone. The stages before it drop next to nothing in a good file; where they do, "
    "look at the file.\n\n</details>"
)

# %% [markdown]
# ## Ninety-two days
#
# `szlib extract atc/*.csv --out days --jobs 4 --exclude 2012-11-11` writes a Parquet file and a funnel for each day. In
# Python:
#
# ```
# days = szlib.extract_days("atc/", out="days", n_jobs=4)  # print(days): the table
# zone = szlib.SocialZone.fit(days.samples())
# ```
#
# Of a raw day of 1 GB only the rows near the area are sorted and brought to the clock, and the encounters are bit for bit
# those of the whole day. Files and parameters identify a day. A run that was stopped resumes, and a day that fails does not
# stop the others.

# %% [markdown]
# | where | how |
# |---|---|
# | laptop | `--jobs 2`; each process needs about 1.5 GB for a raw day of 1 GB |
# | workstation | `--jobs 16`; set `POLARS_MAX_THREADS=2`, so that processes do not compete for cores |
# | machines with SSH, or SLURM | [many_days.py](../examples/many_days.py): `python many_days.py ssh HOST1,HOST2 atc/ out`, or `slurm 20 atc/ out` |
# | any Dask scheduler | `szlib extract atc/ --out days --scheduler tcp://HOST:8786 --wait 600`: workers may come ten minutes later |
#
# Measured on a machine of **two cores**, with raw days of 1 GB and 15 million rows (`python -m studies.many_days`; the
# memory is that of the largest process). There four processes are no faster than one, which uses both cores already:

# %% jupyter={"source_hidden": true}
# Table
measured = read_table("24_many_days")
extracted = measured.dropna(subset="disk_mb").set_index("task")
per_day = extracted["seconds"] / extracted["days"]
shown = {"one day [s]": per_day, "92 days [min]": 92 * per_day / 60, "memory [MB]": extracted["memory_mb"]}
pd.DataFrame(shown).rename_axis("extraction").style.format("{:.1f}")

# %% jupyter={"source_hidden": true}
# The same in words
fits = measured[measured["disk_mb"].isna()]
disk = 92 * extracted["disk_mb"].iloc[0]
Markdown(
    f"The result of 92 days needs {disk:.0f} MB of disk, the raw days 92 GB. A fit of all days together, with "
    f"{fits['samples'].min():,} to {fits['samples'].max():,} samples, takes {fits['seconds'].min():.0f} to "
    f"{fits['seconds'].max():.0f} s and at most {fits['memory_mb'].max():.0f} MB."
)

# %% jupyter={"source_hidden": true}
# What we know now
Markdown(f"""**What we know now.** Speeds must come from positions, over a second or longer. Gaps and irregular frames are
ordinary: all people are brought to one clock, within pieces without a gap. Which days to leave out remains a choice by
hand, made with the figure of visits and standing people ({unlike}), and passed on as `exclude`; the funnel says what it
costs.""")

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

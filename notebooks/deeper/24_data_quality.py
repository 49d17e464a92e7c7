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
# # 24 - Data quality
#
# **Question.** Before anything is learned from a file of tracks: can it be trusted, and which days are
# unlike the others?
#
# **Expectation.** Frames come irregularly, people get lost, the sensor's own speed is inflated by
# noise, and on event days people stand where they otherwise walk. None of it may be cleaned away in
# silence: each row is used, or counted by the reason why not.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [23](23_comparison.ipynb) · next: [25 - What is
# true?](25_claims.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 2 · 40 min · needs
# [03](../03_outliers.ipynb)
#
# **Afterwards you can** judge whether a file of tracks can be used, and find days unlike the others.

# %%
import sys

sys.path.append("..")  # for `studies`
from itertools import cycle
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import Markdown
from studies import hours as hours_study

import szlib
from szlib.plaza.generation import make_plaza
from szlib.plaza.settings import PlazaSettings
from szlib.tracks import funnels, quality
from szlib.tracks.formats import find_format
from szlib.tracks.formats.base import CALENDAR_BEGINS
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, NotebookRecord, parameters, read_table

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
exclude = []

# %%
record = NotebookRecord("24_data_quality", globals())
parameters(
    [
        ("standing", f"< {quality.STANDING:g} m in 1 s", MEASURED, "the sensor's noise stays below it"),
        ("gap that ends a track", "0.5 s raw, 1.6 s at 1 Hz", MEASURED, "nobody is bridged across it"),
        ("area", str(record.cache.find_area()), ASSUMED, "only rows near it leave the scan"),
        ("excluded days", exclude or "none", ASSUMED, "event days, chosen by hand as in the paper"),
    ]
)

# %% [markdown]
# The plaza has one day; here it gets three more, of which the last is an event day: more people, and most of
# them stand.

# %%
files = record.cache.files()
options = record.cache.method.read_options()
if record.cache.is_synthetic:
    for day, (encounters, standing) in enumerate(((700, 0.08), (700, 0.08), (1000, 0.8))):
        file = record.out / f"plaza-day{day + 2}-{seed}.csv"
        date = f"2000-01-{3 + day:02}"
        settings = PlazaSettings(n_encounters=encounters, standing=standing, date=date)
        files.append(make_plaza(file, seed=seed + day + 1, settings=settings))
seconds = pd.concat([quality.summarise_seconds(file, options).assign(file=file.name) for file in files])
zone = options.tz or find_format(files[0], options).tz  # of the clock: that of the mall, or UTC
print(f"{len(files)} files, {seconds['rows'].sum():,} rows, {len(seconds):,} person-seconds; clock: {zone}")

# %% [markdown]
# ## What the velocity column says
#
# Speed from displacement over 1 s, against the file's own column for the same person and second.

# %%
both = seconds.dropna(subset=["sensor_speed", "moved"])
if len(both):
    ax = figures.plot_speed_histogram(both["sensor_speed"].to_numpy(), both["moved"].to_numpy())
    slow = both.loc[both["moved"] < quality.STANDING, "sensor_speed"].median()
    inflated = "inflates" if slow > 0.3 else "does not inflate"
    ax.set_title(f"The velocity column {inflated} the speed of who stands: {slow:.2f} m/s")
    record.figure(ax.figure, "speeds")
    record.key["sensor speed of who stands [m/s]"] = round(float(slow), 3)
    record.claim("the velocity column is inflated for people who stand", slow > 0.3, f"{slow:.2f} m/s")

# %% [markdown]
# ## Frames, gaps, lengths of tracks, ids

# %%
intervals = np.concatenate([quality.measure_frame_intervals(file, options) for file in files])
found = pd.concat([quality.summarise_people(file, options).assign(file=file.name) for file in files])
table = found.assign(length=found["last_seen"] - found["first_seen"]).groupby("file", as_index=False)
table = table.agg(
    people=("id", "nunique"),
    lowest_id=("id", "min"),
    highest_id=("id", "max"),
    opens=("first_seen", "min"),
    closes=("last_seen", "max"),
    median_length=("length", "median"),
)
for name in ("opens", "closes"):
    local = pd.to_datetime(table[name], unit="s", utc=True).dt.tz_convert(zone)
    table[name] = local.dt.strftime("%H:%M:%S")
table

# %%
usual = float(np.median(intervals[intervals < 5]))
record.key["median frame interval [s]"] = round(usual, 4)
ax = figures.get_axes(None)
short = 1e3 * intervals[intervals < 3 * usual]
bins = np.arange(np.floor(short.min()) - 0.5, short.max() + 1.5)  # of 1 ms, as the files tell time
ax.hist(short, bins=bins if len(bins) < 200 else 60, color=figures.BLUE)
spread = np.percentile(short, [5, 95]).round().astype(int)
ax.set(xlabel="from one frame to the next [ms]", ylabel="frames")
ax.set_title("Nine frames in ten come after {} to {} ms".format(*spread))
record.figure(ax.figure, "intervals")

# %%
ax = figures.get_axes(None)
gaps = found["longest_gap"].dropna().to_numpy()
lengths = (found["last_seen"] - found["first_seen"]).to_numpy()
bins = np.geomspace(0.02, 2000, 31).tolist()
for values, name, colour, line in (
    (gaps, "longest gap", figures.RED, "--"),
    (lengths, "length of track", figures.BLUE, "-"),
):
    ax.hist(values, bins=bins, histtype="step", color=colour, linestyle=line, linewidth=1.6, label=name)
ax.set(xscale="log", xlabel="time [s]", ylabel="people", title="How long people are seen, and lost")
ax.legend()
record.figure(ax.figure, "tracks")

# %% [markdown]
# ## Visits and standing people, to choose event days
#
# An event shows as a day, or an hour, with more visits than its neighbours or with many who stand. Weekdays
# stand beside the dates: a Sunday is no event.

# %%
has_dates = seconds["second"].min() > CALENDAR_BEGINS
recordings = {"": seconds} if has_dates else dict(list(seconds.groupby("file")))
counted = {name: quality.count_visits_by_hour(part, tz=zone) for name, part in recordings.items()}
hours = pd.concat(part if has_dates else part.assign(day=name) for name, part in counted.items())
days = hours.groupby("day", as_index=False).agg(visits=("visits", "sum"), standing=("standing", "mean"))
names = pd.to_datetime(days["day"]).dt.strftime("%a %Y-%m-%d") if has_dates else days["day"]
event = days["standing"] > 2 * days["standing"].median()
size = (10, 0.5 * len(days) + 1.6)
figure, panels = plt.subplots(1, 2, figsize=size, layout="constrained", sharey=True)
labels = {"visits": "visits", "standing": "people who stand, mean"}
for ax, (column, label) in zip(panels, labels.items(), strict=True):
    ax.barh(days.index[~event], days.loc[~event, column], color=figures.BLUE, label="usual")
    if event.any():
        ax.barh(days.index[event], days.loc[event, column], color=figures.RED, hatch="//", label="event?")
    ax.locator_params(axis="x", nbins=5)
    ax.set(xlabel=label, ylim=(len(days) - 0.4, -0.6))
panels[0].set_yticks(days.index, names)
panels[1].legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
found = ", ".join(names[event]) or "none of these days"
figure.suptitle(f"More than twice the usual number who stand: {found}")
record.figure(figure, "days")
record.key["days like an event"] = int(event.sum())
days

# %% [markdown]
# By the hour; dotted, to compare, the real day of the ATC mall, Wednesday 2012-10-24 (saved beside the
# notebooks; of the hour from 12 it holds a tenth of the people).

# %%
mall = record.committed_table("24_hours", hours_study.recompute, where="site == 'plaza'")
mall = mall[mall["site"] == "ATC day"]
figure, panels = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
lines = zip(hours.groupby("day"), figures.pick_colours(days["day"]), cycle("os^Dv"), strict=False)
for (day, rows), colour, marker in lines:
    for ax, column in zip(panels, ("visits", "standing"), strict=True):
        ax.plot(rows["hour"], rows[column], f"{marker}-", color=colour, label=day)
for ax, title in zip(panels, ("visits", "standing"), strict=True):
    ax.plot(mall["hour"], mall[title], "o:", color=figures.GREY, label="ATC mall", zorder=0)
    ax.set(xlabel="hour of the day", ylabel="people", ylim=(0, None))
panels[0].set_title("Visits in the hour")
panels[1].set_title("People who stand, mean")
figures.add_shared_legend(panels)
record.figure(figure, "hours")

# %% [markdown]
# ## The funnel
#
# The same as `szlib inspect FILE` prints; over all days, each stage added up.

# %%
own = not has_dates and len(files) > 1 and area in ("", "auto")  # each recording its own area
conditions = record.cache.method.encounter_settings("auto" if own else record.cache.find_area())
extraction = szlib.extract_days(
    files, out=record.out / "days", exclude=exclude, progress=False, settings=conditions, options=options
)
extraction.table.drop(columns="seconds")

# %%
samples = extraction.samples()
stages = funnels.get(samples)
ax = figures.plot_funnel(funnels.table(stages))
ax.set_title("From rows of files to encounters")
record.figure(ax.figure, "funnel")

# %%
read = [stage for stage in stages if stage["stage"].startswith("read ")]
rows = sum(stage["entered"] for stage in read)
record.key |= {"rows": rows, "encounters": samples["encounter"].nunique()}
record.check("every file was read", len(extraction.failed) == 0, len(extraction.table), always=True)
if record.cache.is_synthetic:
    lines = sum(len(Path(file).read_text().splitlines()) for file in files)
    record.check("each line of the files entered the funnel", rows == lines, rows, always=True)
record.check("frames are at most 1 s apart (median)", usual <= 1.0, f"{usual:.3f} s")

# %% [markdown]
# ## Ninety-two days
#
# `szlib extract atc/*.csv --out days --jobs 4 --exclude 2012-11-11` writes a Parquet file and a funnel for each day. In Python:
#
# ```
# days = szlib.extract_days("atc/", out="days", n_jobs=4)  # print(days): the table
# zone = szlib.SocialZone.fit(days.samples())
# ```
#
# A raw day of 1 GB is streamed: only rows near the area are kept in memory, and the encounters are bit for bit those of the
# whole day. A day is identified by the content of its files and every parameter. A run that was stopped or killed resumes, and
# a day that fails does not stop the others.
#
# | where | how |
# |---|---|
# | laptop | `--jobs 2`; each process needs up to 1 GB, or 180 bytes for each row near the area where that is more |
# | workstation | `--jobs 16`; set `POLARS_MAX_THREADS=2`, so that processes do not compete for cores |
# | machines with SSH, or SLURM | [many_days.py](../examples/many_days.py): `python many_days.py ssh HOST1,HOST2 atc/ out`, or `slurm 20 atc/ out` |
# | any Dask scheduler | `szlib extract atc/ --out days --scheduler tcp://HOST:8786 --wait 600`: workers may come ten minutes later |
#
# Measured on a machine of **two cores** with raw days of 1 GB and 15 million rows, and with the samples of one day, repeated
# as other people, for the pooled fit (`python -m studies.many_days`; the memory is that of the largest process):

# %%
measured = read_table("24_many_days")
measured["92 days: seconds"] = np.where(
    measured["disk_mb"] > 0, 92 * measured["seconds"] / measured["days"], np.nan
)
measured.style.format("{:.1f}", subset=measured.columns[3:], na_rep="").hide(axis="index")

# %%
one, four, fits = measured.iloc[0], measured.iloc[1], measured[measured["disk_mb"].isna()]
Markdown(
    f"So 92 days take {92 * one['seconds'] / 60:.0f} min in one process here, and {92 * four['seconds'] / four['days'] / 60:.0f} min in "
    f"four processes on two cores. The result needs {92 * one['disk_mb']:.0f} MB of disk beside the {92:.0f} GB of raw days. The pooled fit of up "
    f"to {fits['samples'].max():,} samples takes {fits['seconds'].min():.0f} to {fits['seconds'].max():.0f} s."
)

# %% [markdown]
# **What it means.** Speed must come from positions. Gaps and irregular frames are ordinary: everything
# is brought to one clock, within pieces without a gap. Which days to leave out remains a choice by hand,
# made with the figure of visits and standing people, and handed on as `exclude`; the funnel says what it
# cost.

# %%
record.close()

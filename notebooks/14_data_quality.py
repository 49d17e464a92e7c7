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
# # 14 - Data quality
#
# **Question.** Before anything is learned from a file of tracks: can it be trusted, and which days are
# unlike the others?
#
# **Expectation.** Frames come irregularly, people get lost, the sensor's own speed is inflated by
# noise, and on event days people stand where they otherwise walk. None of it may be cleaned away in
# silence: each row is used, or counted by the reason why not.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [13 - Against everything else](13_comparison.ipynb) · next: [15 -
# Respect or emptiness?](15_respect.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 2 · 10 min to
# read
#
# **Afterwards you can** judge whether a file of tracks can be used, and find days unlike the others.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import szlib
from szlib.plaza.people import make_plaza
from szlib.plaza.truth import PlazaSettings
from szlib.tracks import funnels, quality
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
exclude = []

# %%
record = NotebookRecord("14_data_quality", globals())
parameters(
    [
        ("standing", f"< {quality.STANDING:g} m in 1 s", MEASURED, "the sensor's noise stays below it"),
        ("gap that ends a track", "0.5 s raw, 1.6 s at 1 Hz", MEASURED, "nobody is bridged across it"),
        ("area", str(record.square()), ASSUMED, "only rows near it leave the scan"),
        ("excluded days", exclude or "none", ASSUMED, "event days, chosen by hand as in the paper"),
    ]
)

# %% [markdown]
# The plaza has one day; here it gets three more, the last one with more people, as on an event day.

# %%
files = record.files()
if record.synthetic:
    for day, encounters in enumerate((300, 300, 900)):
        file = record.out / f"plaza-day{day + 2}-{seed}.csv"
        settings = PlazaSettings(encounters=encounters, date=f"2000-01-{3 + day:02}")
        files.append(make_plaza(file, seed=seed + day + 1, settings=settings))
seconds = pd.concat([quality.seconds(file).assign(file=file.name) for file in files])
print(f"{len(files)} files, {seconds['rows'].sum():,} rows, {len(seconds):,} person-seconds")

# %% [markdown]
# ## What the velocity column says
#
# Speed from displacement over 1 s, against the file's own column for the same person and second.

# %%
both = seconds.dropna(subset=["sensor_speed", "moved"])
if len(both):
    ax = figures.plot_speeds(both["sensor_speed"].to_numpy(), both["moved"].to_numpy())
    record.figure(ax.figure, "speeds")
    slow = both.loc[both["moved"] < quality.STANDING, "sensor_speed"].median()
    record.key["sensor speed of who stands [m/s]"] = round(float(slow), 3)
    record.claim("the velocity column is inflated for who stands", slow > 0.3, f"{slow:.2f} m/s")

# %% [markdown]
# ## Frames, gaps, lengths of tracks, ids

# %%
intervals = np.concatenate([quality.frame_intervals(file) for file in files])
found = pd.concat([quality.people(file).assign(file=file.name) for file in files])
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
    local = pd.to_datetime(table[name], unit="s", utc=True).dt.tz_convert("Asia/Tokyo")
    table[name] = local.dt.strftime("%H:%M:%S")
table

# %%
usual = float(np.median(intervals[intervals < 5]))
record.key["median frame interval [s]"] = round(usual, 4)
ax = figures.axes(None)
ax.hist(1e3 * intervals[intervals < 3 * usual], bins=60, color=figures.BLUE)
ax.set(xlabel="from one frame to the next [ms]", ylabel="frames", title="Frames come irregularly")
record.figure(ax.figure, "intervals")

# %%
ax = figures.axes(None)
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
# An event shows as a day, or an hour, with more visits than its neighbours or with many who stand.

# %%
hours = quality.by_hour(seconds)
days = hours.groupby("day", as_index=False).agg(visits=("visits", "sum"), standing=("standing", "mean"))
figure, panels = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
for (day, rows), colour in zip(hours.groupby("day"), figures.colours(days["day"]), strict=True):
    for ax, column in zip(panels, ("visits", "standing"), strict=True):
        ax.plot(rows["hour"], rows[column], "o-", color=colour, label=day)
for ax, title in zip(panels, ("Visits", "People who stand, mean"), strict=True):
    ax.set(xlabel="hour of the day", ylabel="people", title=title, xticks=range(9, 22), ylim=(0, None))
panels[0].legend()
record.figure(figure, "hours")
days

# %% [markdown]
# ## The funnel
#
# The same as `szlib inspect FILE` prints; over all days, each stage added up.

# %%
extraction = szlib.extract_days(files, out=record.out / "days", exclude=exclude, progress=False)
extraction.table.drop(columns="seconds")

# %%
samples = extraction.samples()
stages = funnels.of(samples)
ax = figures.plot_funnel(funnels.table(stages))
ax.set_title("From rows of files to encounters")
record.figure(ax.figure, "funnel")

# %%
read = [stage for stage in stages if stage["stage"].startswith("read ")]
unusable = sum(sum(stage["set_aside"].values()) for stage in read)
record.key |= {"rows": sum(stage["entered"] for stage in read), "encounters": samples["encounter"].nunique()}
record.check("every file was read", len(extraction.failed) == 0, len(extraction.table))
record.check("each row is used or counted", all(s["entered"] >= s["kept"] for s in stages), unusable)
record.check("frames are at most 1 s apart (median)", usual <= 1.0, f"{usual:.3f} s")

# %% [markdown]
# **What it means.** Speed must come from positions. Gaps and irregular frames are ordinary: everything
# is brought to one clock, within pieces without a gap. Which days to leave out remains a choice by hand,
# made with the figure of visits and standing people, and handed on as `exclude`; the funnel says what it
# cost.

# %%
record.close()

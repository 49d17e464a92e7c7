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
# # 1 - Tracks and the area
#
# **Question.** Where do people walk, how fast, and where is there open space enough to watch two
# of them meet without a wall or a shop in the way?
#
# **Expectation.** A mall is crowded along its corridors and open in its middle. Walking speeds
# gather near 1.2 m/s on a real day; on the plaza they are spread evenly. The paper uses 92 days
# of the ATC mall in Osaka (Brščić et al., 2013); here the default is a *synthetic plaza* whose
# social zone we know, so that every later step can be proved, and `szlib run --data atc-1hz`
# repeats it all on a real day.

# %% [markdown]
# before: [00](00_start_here.ipynb) · next: [2 - Encounters of two people](02_encounters.ipynb) ·
# [paper](https://arxiv.org/abs/2405.15101): sec. 2, fig. 1 · 25 min · exercises:
# [1.1](exercises/sheet1_tracks.ipynb#1.1-Velocity-(5-min)),
# [1.4-1.5](exercises/sheet1_tracks.ipynb#1.4-What-one-sample-a-second-loses-(20-min))
#
# **Afterwards you can** bring files of tracks to one clock, and say where two people can be watched.
# **Words.** *EWAP*: the walking pedestrians recorded at ETH Zürich, and the format of their files,
# `obsmat`; *tidy*: of a table: one row for each observation, one column for each quantity.

# %%
import numpy as np

import szlib
from szlib.encounters.areas import area_for
from szlib.tracks import clock, funnels, readers
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
reading = {}  # options of szlib.ReadOptions, such as {"unit": "mm", "columns": {"t": "Zeit"}}
seed = 0
results = "../results"

# %%
record = NotebookRecord("01_tracks", globals())
parameters(
    [
        ("clock", "0.1 s", ASSUMED, "two people's samples must coincide; the paper's control step"),
        (
            "velocity span",
            f"+-{clock.VELOCITY_SPAN} s",
            ASSUMED,
            "a step is about 0.5 s: shorter spans see the sway",
        ),
        (
            "longest gap",
            "0.5 s raw, 1.6 s at 1 Hz",
            MEASURED,
            "longer silences are other people as often as not",
        ),
        ("event days", "none left out", ASSUMED, "the paper removed them by hand; pass exclude="),
    ]
)

# %% [markdown]
# ## From files to rows
#
# `read_raw` takes ATC raw files (8 columns, mm), the public 1 Hz day (6 columns, m), EWAP
# `obsmat` and tidy tables. A person is a pair *(day, id)*. Rows that cannot be used are set aside
# and counted.

# %%
files = record.cache.files()
options = record.cache.method.read_options()
raw = readers.read_raw(files, options=options)
print(f"{len(files)} file(s), {len(raw):,} rows, {raw.groupby('day')['id'].nunique().sum():,} people")
raw.head(3)

# %% [markdown]
# ## One clock
#
# Sensors see people at irregular times. `to_clock` interpolates to multiples of 0.1 s *within*
# gap-free pieces - a person who vanishes behind somebody and comes back is not bridged - and
# takes velocity from the displacement over one second. It never reads the velocity column of a file:
# notebook 24 shows what noise does to it.

# %%
people = clock.to_clock(raw, max_gap=options.max_gap)
people.head(3)

# %%
speed = np.hypot(people["vx"], people["vy"])
walking = speed[speed > 0.4]
print(f"{len(people) / 36000:,.0f} person-hours; walkers' median speed {walking.median():.2f} m/s")
record.key |= {
    "rows": len(raw),
    "people": int(raw.groupby("day")["id"].nunique().sum()),
    "median speed": float(walking.median()),
}

# %% [markdown]
# ## The area
#
# The paper names "the rectangular central square" without coordinates (fig. 1). In the mall the
# largest rectangle without pillars, walls or queues is x from -18.5 to -7.5 m, y from -10 to 8 m,
# the plaza's as well. Any other data has, unless one is given, the largest rectangle in which
# people walked everywhere: three people at least on each spot of 0.5 m. In small rooms and
# with few people it is the outline of the place where people were seen. Look at the map before
# you trust it: a pillar or a shelf may stand where nobody walked.

# %%
if people["day"].nunique() > 1:
    people = record.cache.tracks()  # recordings of several places stand side by side
square = record.cache.find_area(people)
ax = figures.plot_map(people, square)
record.figure(ax.figure, "map")
parameters(
    [("area", str(square), ASSUMED, record.cache.area or "the data's own; see --square, --polygon, --auto")]
)

# %% [markdown]
# What `auto` finds in these tracks. It never reaches outside where people were seen.

# %%
try:
    found = area_for(people, "auto")
    ax = figures.plot_map(people, found)
    ax.set_title(f"auto: {found.area:.0f} m$^2$")
    record.figure(ax.figure, "auto")
    print(found.reason)
except szlib.DataError as error:
    print(error)

# %%
inside = square.contains(people["x"], people["y"])
print(f"{inside.mean():.1%} of all person-time is spent in the area of {square.area:.0f} m2")
if not area and isinstance(square, szlib.Square):
    (x0, x1), (y0, y1) = square.x, square.y
    cells = [np.arange(x0, x1 + 1e-9), np.arange(y0, y1 + 1e-9)]  # of 1 m
    used = np.histogram2d(people["x"], people["y"], bins=cells)[0] > 0
    record.check("the area is open: people walk in nine tenths of it", used.mean() >= 0.9, used.mean())
record.key["area [m2]"] = round(square.area, 1)
ax = figures.plot_attentional_space(szlib.AttentionalSpace(), square)
record.figure(ax.figure, "space")

# %% [markdown]
# ## Nothing is lost
#
# Every table carries its *funnel*: rows that came in, rows that went on, and why the others did
# not.

# %%
stages = funnels.get(people)
lost = {reason: n for s in stages for reason, n in s["rejected"].items()}
print(lost or "no row set aside")
if record.cache.is_synthetic:
    lines = sum(len(file.read_text().splitlines()) for file in record.cache.files())
    record.check(
        "each line of the file entered the funnel", lines == stages[0]["entered"], lines, always=True
    )
funnels.table(stages).tail(5)

# %% [markdown]
# **What it means.** We have people on one clock, in metres, with a velocity that can be trusted,
# and an open area to watch them in. Next: when do two people meet?

# %%
record.close()

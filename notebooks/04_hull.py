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
# # 4 - The hull and its slices
#
# **Question.** From scattered samples to a boundary: how near did people come, in each direction,
# at each walking speed?
#
# **Expectation.** The faster somebody walks, the more room they are given. Few samples exist for
# any one speed, so the paper borrows from neighbouring speeds: one convex hull over all of them,
# cut at the speed of interest.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [03](03_outliers.ipynb) · next: [5 - Social zones](05_zones.ipynb)
# · [paper](https://arxiv.org/abs/2405.15101): sec. 2, fig. 4b · 25 min · needs [03](03_outliers.ipynb) ·
# exercises: [3.1-3.2](exercises/sheet3_zones.ipynb#3.1-A-slice-by-hand-(10-min)),
# [4.2](exercises/sheet4_certainty.ipynb#4.2-Why-the-hull-shrinks-(15-min))
#
# **Afterwards you can** turn samples into a hull, cut it at a speed, and read the zone off the slice.

# %%
import matplotlib.pyplot as plt
import numpy as np

import szlib
from szlib.plaza import accuracy
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord, parameters
from szlib.zones import hulls, outliers

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
r_max = 2.0  # as in notebook 03 [m]
zone_speed = 1.1  # of the slice shown [m/s]
speeds = [0.7, 0.9, 1.1, 1.3]  # of the slices of the hull [m/s]

# %%
record = NotebookRecord("04_hull", globals())
parameters(
    [
        ("outliers", "0.2 % of the samples, 20 neighbours", PAPER, "method='paper'; ours is method='hull'"),
        ("hull over", "x', y', speed", PAPER, "sec. 2, fig. 4b"),
        ("speed", "of the reference pedestrian, at the sample", PAPER, "not the mean of the encounter"),
        ("slices", f"{speeds} m/s", ASSUMED, "the paper shows a range of speeds"),
        ("zone", "r_max - R', not the slice", ASSUMED, "the paper does not say; map first, enclose second"),
    ]
)

# %%
samples = record.cache.encounters()
paper_rule = {"fraction": outliers.FRACTION, "n_neighbours": outliers.N_NEIGHBOURS}
inliers = szlib.remove_outliers(samples, r_max=r_max, **paper_rule)
points = np.column_stack([outliers.complementary_points(inliers, r_max=r_max), inliers["speed"]])
vertices = hulls.hull_vertices(points)
print(f"{len(points):,} inliers, {len(vertices)} of them vertices of the hull")
record.key |= {"inliers": len(points), "vertices": len(vertices)}

# %% [markdown]
# ## The hull in three dimensions
#
# Each dot is a sample: the farther from the axis, the nearer the other person was. Each line is a slice.
# `method="paper"` is the paper's chain to the letter: its rule for outliers, hull, slices, ellipses.

# %%
zone = szlib.SocialZone.fit(samples, method="paper", r_max=r_max, speeds=[*speeds, zone_speed], n_resamples=0)
low, high = zone.speed_range
print(f"slices at {list(zone.ellipses)} m/s; the data covers {low:.2f} to {high:.2f} m/s")
ax = figures.plot_hull(zone, list(zone.ellipses), points=points)
record.figure(ax.figure, "hull")
if record.cache.is_synthetic:
    off = accuracy.largest_error(zone, speeds=speeds)
    record.check("the zones of these slices are the true ones, to 5 cm", off < 0.05, off)

# %% [markdown]
# ## A slice, and the zone it leaves free
#
# A slice is a convex polygon around the origin. With $R'(\theta)$ the distance from the origin to
# its edge, the **minimum social zone** is
#
# $$r_{zone}(\theta) = r_{max} - R'(\theta)$$
#
# Map first, enclose second: an ellipse around the *slice* would be no zone.

# %%
section = hulls.slice_hull(vertices, zone_speed, r_max=r_max)
theta = np.linspace(-np.pi, np.pi, 721)
corners = section.polygon
dents = section.boundary(np.arctan2(*corners.T[::-1]))
fig, (left, right) = plt.subplots(1, 2, figsize=(11, 6), layout="constrained", sharex=True, sharey=True)
left.fill(*corners.T, facecolor=figures.BLUE, alpha=0.3, edgecolor=figures.BLUE, label="slice")
left.plot(*corners.T, "o", color=figures.BLUE, markersize=4, label="its corners")
right.fill(*section.boundary(theta).T, facecolor=figures.ORANGE, alpha=0.4, label="zone")
right.plot(*dents.T, "o", color=figures.BLUE, markersize=4, label="the same corners")
right.plot(0, 0, marker=(3, 0, -90), color=figures.BLACK, markersize=10)
titles = (f"The slice at {zone_speed:g} m/s", "The zone it leaves free")
for ax, title, circle in zip((left, right), titles, ("contact, r = 0", "r_max"), strict=True):
    ax.plot(r_max * np.cos(theta), r_max * np.sin(theta), ":", color=figures.BLACK, label=circle)
    figures.label_metres(ax, title, person=True)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, fontsize=8)
left.set(xlabel="x' [m]", ylabel="y' [m]")
record.figure(fig, "slice")

# %% [markdown]
# Corner for corner: a corner of the slice is where somebody came nearest, and dents the zone; an edge
# between two corners is where nobody came as near, and the zone bulges there. With few people the corners
# are far apart and the bulges large: they tell of who was not there, not of respect. (On the plaza, with
# thousands of encounters, there are hardly any; on the real day there are.)
#
# The zone must be empty: each inlier lies outside, or just on the edge of, the zone of its own
# speed. (That is a test of the code, not of people; and the outliers that were removed *are*
# inside.)

# %%
some = inliers.sample(min(300, len(inliers)), random_state=seed)
some = some[some["speed"].between(low, high, inclusive="neither")]
margins = []
for v, angle, distance in zip(some["speed"], some["los_angle"], some["distance"], strict=True):
    try:
        margins.append(distance - (r_max - zone.shape.slice(v).reach(angle)))
    except szlib.ZoneError:  # of speeds at which nobody was seen on some side there is no zone
        continue
print(f"{len(margins)} of {len(some)} samples have a zone of their own speed")
margin = float(np.min(margins))
record.check("no inlier is inside the zone of its own speed", margin > -1e-9, margin, always=True)

# %% [markdown]
# ## What the hull does to speed
#
# A convex hull cannot be wider at both ends of its speeds than between them. So its slices
# shrink, and the zones grow, away from some speed in the middle, whatever people do:

# %%
grid = np.linspace(low, high, 41)[2:-2]
areas = []
for v in grid:
    try:
        boundary = zone.boundary(v)
        areas.append(
            0.5 * abs(np.sum(boundary[:-1, 0] * boundary[1:, 1] - boundary[1:, 0] * boundary[:-1, 1]))
        )
    except szlib.ZoneError:
        areas.append(np.nan)
ax = figures.get_axes(None)
ax.plot(grid, areas, color=figures.BLUE)
ax.set(
    xlabel="speed [m/s]",
    ylabel="area of the zone [m$^2$]",
    title=f"The zone is smallest at {grid[np.nanargmin(areas)]:.2f} m/s",
)
record.figure(ax.figure, "area")

# %%
areas = np.array(areas)
smallest = float(grid[np.nanargmin(areas)])
between = areas[(grid >= 0.7) & (grid <= 1.3)]
covered = grid[0] <= 0.7 and grid[-1] >= 1.3
record.key["smallest zone at"] = smallest
record.claim(
    "the zone grows with speed between 0.7 and 1.3 m/s (part of any growth is the hull's own)",
    covered and np.all(np.diff(between) > 0),
    f"smallest at {smallest:.2f} m/s; the data covers {low:.2f} to {high:.2f} m/s",
)

# %% [markdown]
# **What it means.** Read the zones in the middle of the data's range of speeds; near its ends
# they say more about how few people walk so slowly or so fast than about the room they are given.

# %%
record.close()

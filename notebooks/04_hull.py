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
#     label: hull
#     paper: sec. 2, fig. 4b
#     aim: turn samples into a hull, cut it at a speed, and enclose the zone in the smallest ellipse.
#     asks: How near did people come, in each direction, at each speed?
#     needs:
#     - '03'
#     exercises:
#     - 3.1-3.3
#     - '3.5'
#     week: 2
# ---

# %% [markdown]
# # 4 - The hull and its slices
#
# **Question.** From scattered samples to a boundary: how near did people come, in each direction,
# at each walking speed?
#
# **Expectation.** The faster a person walks, the more room others leave. Few samples have exactly one speed. So
# the paper borrows from neighbouring speeds: one convex hull around all samples, cut at the speed of interest.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [03](03_outliers.ipynb) · next: [5 - Social zones](05_zones.ipynb)
# · [paper](https://arxiv.org/abs/2405.15101): sec. 2, fig. 4b · 25 min · needs [03](03_outliers.ipynb) ·
# exercises: [3.1-3.3](exercises/sheet3_zones.ipynb#3.1-A-slice-by-hand-(10-min)),
# [3.5](exercises/sheet3_zones.ipynb#3.5-Why-the-hull-shrinks-(15-min))
#
# **Afterwards you can** turn samples into a hull, cut it at a speed, and enclose the zone in the smallest
# ellipse.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
r_max = 2.0  # as in chapter 03 [m]
zone_speed = 1.1  # of the slice shown [m/s]
speeds = [0.7, 0.9, 1.1, 1.3]  # of the slices of the hull [m/s]

# %% jupyter={"source_hidden": true}
# Set-up, and the figure
import warnings

import matplotlib.pyplot as plt
import numpy as np
import plots
from IPython.display import Markdown
from scipy.spatial import ConvexHull
from studies import plaza_truth, real_day

import szlib
from szlib.plaza import PlazaSettings
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord, parameters
from szlib.zones import hulls, outliers

warnings.simplefilter("ignore", szlib.DataWarning)  # the line below the first figure says it
record = NotebookRecord("04_hull", globals())
samples = record.cache.encounters()
paper_rule = {"fraction": outliers.FRACTION, "n_neighbours": outliers.N_NEIGHBOURS}
inliers = szlib.remove_outliers(samples, r_max=r_max, **paper_rule)
fit = {"r_max": r_max, "speeds": sorted({*speeds, zone_speed}), "n_resamples": 0}
zone = szlib.SocialZone.fit(samples, method="paper", **fit)
points = np.column_stack([outliers.complementary_points(inliers, r_max=r_max), inliers["speed"]])
record.figure(plots.draw_hull_and_zones(zone, points), "hull")

# %% jupyter={"source_hidden": true}
# Parameters, with sources
parameters(
    [
        ("outliers", "0.2 % of the samples", PAPER, "sec. 2, as in chapter 03"),
        ("neighbours of a sample", outliers.N_NEIGHBOURS, ASSUMED, "scikit-learn's default"),
        ("hull over", "x', y', speed", PAPER, "sec. 2, fig. 4b"),
        ("speed", "of the reference pedestrian, at the sample", PAPER, "not the mean of the encounter"),
        ("slices", f"{speeds} m/s", ASSUMED, "the paper shows a range of speeds"),
        ("zone", "r_max - R', not the slice", ASSUMED, "the paper does not say; map first, enclose second"),
    ]
)

# %% jupyter={"source_hidden": true}
# How this data differs from the plaza
counts = zone.side_counts.set_index("speed").loc[zone_speed]
seen = counts.drop("encounters")
real_day.compare_with_plaza(
    record,
    {
        "encounters": f"{samples['encounter'].nunique():,}",
        f"of them at {zone_speed:g} m/s": f"{counts['encounters']:,}",
        "fewest on one side": f"{seen.min():,}, {seen.idxmin()}",
        f"zone at {zone_speed:g} m/s": "{:.2f} m x {:.2f} m".format(*zone.ellipse(zone_speed).semi_axes),
    },
    note=f"At {zone_speed:g} m/s only {seen.min():,} encounters were seen {seen.idxmin()}. There the zone is large "
    "because few people were watched, not because people keep a large distance.",
)

# %% [markdown]
# ## A number first
#
# We look at people within $r_{max}$ = 2 m. One person passes you on the left, 0.9 m away. We draw this sample not
# at 0.9 m but at $r' = 2 - 0.9$ = **1.1 m** to the left. Somebody who passes at 1.4 m is drawn at $r'$ = 0.6 m.
# The nearer a person came, the *farther out* the point.
#
# So the outermost points are those who came nearest, and a boundary around all points has nobody beyond it. To
# the left it ends at 1.1 m. Turned back: **nobody came nearer than 2 - 1.1 = 0.9 m**.
#
# Now the speeds. To your left, people came to 1.0 m when you walked at 1.0 m/s, and to 1.2 m when you walked at
# 1.2 m/s. Nobody was watched at 1.1 m/s. What do you say about 1.1 m/s?
#
# The straight line between the two samples ($r'$ = 1.0 m and 0.8 m) passes $r'$ = 0.9 m at 1.1 m/s. So we say
# 2 - 0.9 = **1.1 m**. That line is an edge of the hull, and reading it at 1.1 m/s is a slice.

# %% [markdown]
# ## The hull in three dimensions
#
# This chapter follows the paper: its rule of 0.2 % removes outliers, and the samples that are left are the *inliers*. Each
# is a point of three numbers: two for the place, one for the speed of the reference pedestrian.
#
# $$x' = (r_{max} - r)\cos\theta,\qquad y' = (r_{max} - r)\sin\theta,\qquad v$$
#
# - $r$ is the distance of the other person [m], $\theta$ the line-of-sight angle: 0 is ahead, 90° is left.
# - $v$ is the speed of the reference pedestrian at that moment [m/s].
#
# The *convex hull* is the smallest body without dents that contains all points: a rubber skin around them. Only a
# few points touch the skin. They are its *vertices*.

# %%
nearness, angle = r_max - inliers["distance"], inliers["los_angle"]
points = np.column_stack([nearness * np.cos(angle), nearness * np.sin(angle), inliers["speed"]])
vertices = points[ConvexHull(points).vertices]
low, high = vertices[:, 2].min(), vertices[:, 2].max()
print(f"{len(points):,} samples, {len(vertices)} of them vertices; {low:.2f} to {high:.2f} m/s")

# %% jupyter={"source_hidden": true}
# Checks
record.key |= {"inliers": len(points), "vertices": len(vertices)}
same = np.array_equal(np.sort(vertices, axis=0), np.sort(zone.shape.vertices, axis=0))
found = f"{len(zone.shape.vertices)} vertices"
record.check("these lines and the library find the same vertices", same, found, always=True)
if record.cache.is_synthetic:
    off = plaza_truth.largest_error(zone, speeds=speeds)
    record.check("the zones of these slices are the true ones, to 5 cm", off < 0.05, f"{off:.3f} m")

# %% [markdown]
# ## A slice, and the zone it leaves free
#
# A slice is a polygon around the origin. Let $R'(\theta)$ be the distance from the origin to its edge. The
# **minimum social zone** is what it leaves free:
#
# $$r_{zone}(\theta) = r_{max} - R'(\theta)$$
#
# **What do you think?** Where somebody came nearest, the slice has a corner. What has the zone there: a dent or a
# bulge? And what does the zone do between two corners, where nobody came as near?

# %%
section = hulls.slice_hull(vertices, zone_speed, r_max=r_max)
theta = np.linspace(-np.pi, np.pi, 721)
free = r_max - section.reach(theta)
zone_x, zone_y = free * np.cos(theta), free * np.sin(theta)

# %% jupyter={"source_hidden": true}
# Figure
fig, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained", sharex=True, sharey=True)
corners = section.polygon
dents = section.boundary(np.arctan2(*corners.T[::-1]))
left.fill(*corners.T, facecolor=figures.BLUE, alpha=0.3, edgecolor=figures.BLUE, label="slice")
left.plot(*corners.T, "o", color=figures.BLUE, markersize=4, label="its corners")
right.fill(zone_x, zone_y, facecolor=figures.ORANGE, alpha=0.4, label="zone")
right.plot(*dents.T, "o", color=figures.BLUE, markersize=4, label="the same corners")
right.plot(0, 0, marker=(3, 0, -90), color=figures.BLACK, markersize=10)
titles = (f"{len(corners)} corners, from those who came nearest", "Each corner dents the zone")
for ax, title, circle in zip((left, right), titles, ("contact, r = 0", "r_max"), strict=True):
    ax.plot(r_max * np.cos(theta), r_max * np.sin(theta), ":", color=figures.BLACK, label=circle)
    figures.label_metres(ax, title, person=True)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3, fontsize=8)
left.set(xlabel="x' [m]", ylabel="y' [m]")
record.figure(fig, "slice")

# %% [markdown]
# <details><summary>Answer</summary>
#
# A dent. The corner is a person who came near, so the zone must end before that place. Between two corners the
# zone bulges: nobody came as near there. A bulge is a gap in the data. It does not show respect.
#
# </details>

# %% [markdown]
# ## The number of people
#
# **What do you think?** We forget nine of ten encounters and do the same again. Is the zone larger or smaller?

# %% jupyter={"source_hidden": true}
# Figure
everyone = inliers["encounter"].unique()
tenth = np.random.default_rng(seed).choice(everyone, max(len(everyone) // 10, 1), replace=False)
shown = {}
for name, rows in (("all", np.full(len(inliers), True)), ("a tenth", inliers["encounter"].isin(tenth))):
    try:
        boundary = hulls.slice_hull(points[rows], zone_speed, r_max=r_max).boundary(theta)
    except szlib.ZoneError:  # so few people that some side has nobody
        continue
    x, y = boundary.T
    shown[name] = boundary, 0.5 * abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
fig, ax = plt.subplots(figsize=(7.5, 4), layout="constrained")
looks = {"all": (figures.BLUE, "-", len(everyone)), "a tenth": (figures.ORANGE, "--", len(tenth))}
for name, (boundary, size) in shown.items():
    colour, line, n = looks[name]
    ax.plot(*boundary.T, line, color=colour, linewidth=2, label=f"{n:,} encounters: {size:.2f} m$^2$")
ax.plot(0, 0, marker=(3, 0, -90), color=figures.BLACK, markersize=10)
ax.legend(loc="center left", bbox_to_anchor=(1, 0.5))
gone = "a tenth" not in shown
title = "A tenth of the people leaves no zone at all" if gone else "With fewer people the zone is larger"
figures.label_metres(ax, title, person=True)
record.figure(fig, "fewer")

# %% jupyter={"source_hidden": true}
# Checks, and the answer
sizes = {name: size for name, (_, size) in shown.items()}
larger = sizes.get("a tenth", np.inf) > sizes["all"]
evidence = ", ".join(f"{name}: {size:.2f} m2" for name, size in sizes.items())
record.check("a tenth of the encounters gives a larger zone, or none", larger, evidence, always=True)
Markdown(
    "<details><summary>Answer</summary>\n\nLarger: the hull of a part lies inside the hull of all, so its slice is "
    f"smaller. {evidence.replace('m2', 'm²').capitalize()}. So this zone shrinks with every day of data. It says how near the "
    "nearest people *seen* came. Chapter 05 shows an estimate that does not shrink.\n\n</details>"
)

# %% [markdown]
# ## The zone is empty
#
# Each inlier must lie outside the zone of its own speed, or on its edge. This tests the code. The zone is empty
# of inliers only: an outlier that came near lies inside.

# %% jupyter={"source_hidden": true}
# Checks
some = inliers.sample(min(300, len(inliers)), random_state=seed)
some = some[some["speed"].between(low, high, inclusive="neither")]
margins = []
for v, angle, distance in zip(some["speed"], some["los_angle"], some["distance"], strict=True):
    try:
        margins.append(distance - (r_max - zone.shape.slice(v).reach(angle)))
    except szlib.ZoneError:  # of speeds at which nobody was seen on some side there is no zone
        continue
margin = float(np.min(margins))
found = f"{len(margins)} samples, the nearest {abs(1000 * margin):.1f} mm outside"
record.check("no inlier is inside the zone of its own speed", margin > -1e-9, found, always=True)

# %% [markdown]
# ## What the hull does to speed
#
# **What do you think?** Few people walk very fast. How large is the zone at the highest speeds of the data: too
# small, too large, or right but uncertain?


# %% jupyter={"source_hidden": true}
# How large the zone is at each speed, and how far it reaches in each direction
def enclosed(curve):
    x, y = np.vstack([curve, curve[:1]]).T
    return 0.5 * abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))


grid, areas, reaches = np.linspace(low, high, 63)[1:-1], [], []
for v in grid:
    try:
        cut = hulls.slice_hull(vertices, v, r_max=r_max)
        areas.append(enclosed(cut.boundary(theta)))
        reaches.append(np.hypot(*cut.boundary(theta).T))
    except szlib.ZoneError:  # nobody was seen on some side
        areas.append(np.nan)
        reaches.append(np.full(len(theta), np.nan))
areas, reaches = np.array(areas), np.array(reaches)
smallest = float(grid[np.nanargmin(areas)])
known = grid[np.isfinite(areas)]
tenths = np.arange(np.floor(10 * low) / 10, high + 0.1, 0.1)
people = [inliers.loc[inliers["speed"].between(v, v + 0.1), "encounter"].nunique() for v in tenths]

# %% jupyter={"source_hidden": true}
# Figure
fig, (above, below) = plt.subplots(
    2, 1, figsize=(8, 5.2), layout="constrained", sharex=True, height_ratios=(2, 1)
)
above.plot(grid, areas, color=figures.BLUE, label="read off the hull")
above.plot(smallest, np.nanmin(areas), "o", color=figures.BLUE, label=f"smallest: {smallest:.2f} m/s")
if record.cache.is_synthetic:
    walked = np.linspace(*PlazaSettings().speeds, 30)
    truth = [PlazaSettings().true_zone(v).area for v in walked]
    above.plot(walked, truth, ":", color=figures.RED, linewidth=2, label="truth")
above.set(ylabel="area of the zone [m$^2$]", ylim=(0, None))
above.set_title("Where few people were seen, the zone is large")
above.legend(loc="upper left")
below.bar(tenths, people, width=0.09, align="edge", color=figures.GREY)
below.set(xlabel="walking speed [m/s]", ylabel="encounters", title="Encounters at each speed")
record.figure(fig, "area")

# %% jupyter={"source_hidden": true}
# The answer
place = (smallest - low) / (high - low)
where = "near the lowest" if place < 0.25 else "near the highest" if place > 0.75 else "in the middle of the"
Markdown(
    f"""<details><summary>Answer</summary>

Large. The zone is smallest at {smallest:.2f} m/s ({np.nanmin(areas):.1f} m²), {where} speeds of this data. It grows
towards both ends, to {areas[np.isfinite(areas)][0]:.1f} m² at {known[0]:.2f} m/s and to
{areas[np.isfinite(areas)][-1]:.1f} m² at {known[-1]:.2f} m/s. There the hull closes like the end of an egg: its slices
become small, so the zone grows towards the whole circle of {np.pi * r_max**2:.1f} m². As soon as a slice leaves a side
without anybody, there is no zone. That happens whatever people do.
Number of encounters in the last 0.1 m/s: {people[int((known[-1] - tenths[0]) / 0.1)]}.

</details>"""
)

# %% [markdown]
# ### Theory: why the zone grows to both sides
#
# Look in one direction. The hull is convex, so it holds the straight line between any two of its points, also between
# points at different speeds. Hence its edge R' in this direction is a **concave** function of the speed: it rises to one
# maximum, and falls after it. The zone reaches r_max - R', which is **convex**: it falls to one minimum, and rises after
# it. So in each direction there is one speed at which the zone is smallest, and it grows to both sides of it. The
# data decides *which* speed that is: it is near the speeds at which people came nearest.

# %% jupyter={"source_hidden": true}
# Checks
bend = float(np.nanmin(reaches[2:] - 2 * reaches[1:-1] + reaches[:-2]))
claim = "in every direction the reach of the zone is convex in the speed"
record.check(claim, bend > -1e-6, f"least second difference {bend:.1g} m", always=True)
between = areas[(grid >= 0.7) & (grid <= 1.3)]
covered = grid[0] <= 0.7 and grid[-1] >= 1.3
record.key["smallest zone at"] = smallest
record.claim(
    "the zone grows with speed between 0.7 and 1.3 m/s (part of any growth is the hull's own)",
    covered and np.all(np.diff(between) > 0),
    f"smallest at {smallest:.2f} m/s; the data covers {low:.2f} to {high:.2f} m/s",
)

# %% [markdown]
# ## The smallest ellipse
#
# The zone has as many kinks as the slice has corners. The controller of later chapters needs a smooth shape, which
# it can move and turn with the person. So the paper encloses the zone in the *smallest ellipse* (Gärtner & Schönherr, 1997).
#
# **A number first.** How many points fix the smallest circle around many points? Two or three: all others lie
# inside and could be left out. They are its points of *support*.
#
# **What do you think?** The zone below has hundreds of points. How many of them fix the smallest ellipse around it?

# %%
boundary = zone.boundary(zone_speed)
ellipse = szlib.minimum_enclosing_ellipse(boundary)
print(f"{len(ellipse.support)} of {len(boundary)} points touch it; an ellipse is fixed by three to five")

# %% jupyter={"source_hidden": true}
# Figure
fitted = zone.ellipse(zone_speed)
fig, ax = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
ax.fill(*boundary.T, facecolor=figures.GREY, alpha=0.4, label="zone: r_max - R'")
ax.plot(*fitted.curve().T, color=figures.BLUE, linewidth=2, label="smallest ellipse around it")
ax.plot(*fitted.support.T, "o", color=figures.BLUE, label=f"its {len(fitted.support)} points of support")
ax.plot(0, 0, marker=(3, 0, -90), color=figures.BLACK, markersize=10)
ax.legend(loc="center left", bbox_to_anchor=(1, 0.5))
title = f"{len(fitted.support)} points decide: {fitted.semi_axes[0]:.2f} m x {fitted.semi_axes[1]:.2f} m"
figures.label_metres(ax, title, person=True)
record.figure(fig, "ellipse")

# %% jupyter={"source_hidden": true}
# Checks
record.key |= {
    f"hull: a({zone_speed:g})": fitted.semi_axes[0],
    f"hull: b({zone_speed:g})": fitted.semi_axes[1],
}
most = max(float(e.level(zone.boundary(v, 5000)).max()) for v, e in zone.ellipses.items())
evidence = f"largest level of the zone {most:.6f}; 1 is the ellipse"
record.check("each ellipse encloses its zone", most <= 1 + 1e-9, evidence, always=True)
number = [len(e.support) for e in zone.ellipses.values()]
ok = all(3 <= n <= 5 for n in number)
record.check(
    "each ellipse has three to five points of support", ok, f"{min(number)} to {max(number)}", always=True
)
again = szlib.minimum_enclosing_ellipse(fitted.support)
off = float(np.abs(np.subtract(again.semi_axes, fitted.semi_axes)).max())
ok = off < 1e-6 * fitted.semi_axes[0]
record.check(
    "the points of support alone determine the ellipse", ok, f"semi-axes differ by {off:.0e} m", always=True
)
if len(fitted.support) > 3:
    without = [np.delete(fitted.support, i, axis=0) for i in range(len(fitted.support))]
    largest = max(szlib.minimum_enclosing_ellipse(points).area for points in without)
    evidence = f"largest area without one {largest:.3f} m2, with all {fitted.area:.3f} m2"
    claim = "the ellipse shrinks without any one of its points of support"
    record.check(claim, largest < fitted.area, evidence, always=True)

# %% [markdown]
# ## The same with the library
#
# `szlib.SocialZone.fit(samples, method="paper")` is all of this: outliers, hull, slices, ellipses. Its ellipse
# encloses the whole curve, not only 361 points of it.

# %%
paper = szlib.SocialZone.fit(samples, method="paper", r_max=r_max, speeds=[zone_speed], n_resamples=0)
print("library {:.3f} m x {:.3f} m".format(*paper.ellipse(zone_speed).semi_axes))
print("by hand {:.3f} m x {:.3f} m".format(*ellipse.semi_axes))

# %% jupyter={"source_hidden": true}
# Checks
off = float(np.abs(np.subtract(paper.ellipse(zone_speed).semi_axes, ellipse.semi_axes)).max())
claim = "the library's ellipse is the one by hand, to 1 cm"
record.check(claim, off < 0.01, f"semi-axes differ by {1000 * off:.1f} mm", always=True)

# %% jupyter={"source_hidden": true}
# Two common mistakes
wrong = szlib.minimum_enclosing_ellipse(corners)
Markdown(
    f"""## Two common mistakes

- **"The ellipse around the slice is the zone."** No. The slice is large where the zone is small. The ellipse around
  this slice is {wrong.semi_axes[0]:.2f} m x {wrong.semi_axes[1]:.2f} m, the zone's
  {fitted.semi_axes[0]:.2f} m x {fitted.semi_axes[1]:.2f} m. Map back first, then enclose.
- **"A large zone at {high:.1f} m/s means that others leave much room to fast walkers."** No. A hull
  closes at the lowest and at the highest speed of the data, so near both the zone is large for any people."""
)

# %% jupyter={"source_hidden": true}
# What we know now
Markdown(
    f"""**What we know now.** {len(vertices)} of {len(points):,} samples make the hull, and its slice at
{zone_speed:g} m/s leaves a zone whose smallest ellipse is {fitted.semi_axes[0]:.2f} m x {fitted.semi_axes[1]:.2f} m. The
zone is smallest at {smallest:.2f} m/s; near {low:.1f} m/s, where condition 4 ends the data, and near {high:.1f} m/s,
where few people walk so fast, the hull closes and the zone is large. Another encounter that is no outlier never makes it larger, and makes it smaller if somebody comes nearer than the hull allows: chapter 05 estimates a zone that does not depend on their number, and says how far to
trust it."""
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

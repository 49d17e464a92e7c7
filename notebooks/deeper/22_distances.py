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
# # 22 - The distances, audited
#
# **Question.** The barriers use *approximate* distances to zones and walls, and a margin of 5 cm
# "since the approximated distance function contains some errors" (sec. 4). Where do they err, to
# which side, and is the margin enough?
#
# **Expectation.** An error on the long side is dangerous: the robot is nearer than it thinks. An
# error on the short side only costs room. The paper: the focal distance is adequate "when the
# distance between the two foci is not too large"; of the segment it says nothing.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [21](21_feasibility.ipynb) · next: [23 - Against everything
# else](23_comparison.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 3, eq. 3-7 · 30 min · needs
# [07](../07_barriers.ipynb)
#
# **Afterwards you can** say where the two distances err, and which margin makes up for it.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import szlib
from szlib.control import distances
from szlib.simulation.closed_loop import drive
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
lengths = [0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 13.0]  # of walls [m]
eccentricities = [0.0, 0.3, 0.5, 0.65, 0.8, 0.9, 0.99]  # of ellipses as long as the learned one

# %%
record = NotebookRecord("22_distances", globals())
settings = szlib.MPCSettings()
r, eps = settings.r_robot, settings.eps
parameters(
    [
        ("robot radius", f"{r} m", PAPER, ""),
        ("margin eps", f"{eps} m", PAPER, "audited here"),
        ("wall lengths", lengths, ASSUMED, "a pillar to a corridor"),
        ("eccentricities", eccentricities, ASSUMED, "a circle to a needle"),
    ]
)

# %% [markdown]
# ## An exact reference
#
# The distance to a segment is a projection, clamped; that to an ellipse the one root of a function
# of one angle, found by bisection (`szlib.control.distances`; the tests hold both against a geometry
# library). Red below: $d$ is longer than the truth. Where an $h = 0$ lies within the dotted line, the robot's
# disc may touch although $h \ge 0$.

# %%
zone = record.cache.ellipse()
fig, sides = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
figures.plot_distance_error(zone, r_robot=r, eps=eps, ax=sides[0]).set_title("Around the learned zone")
short = np.array([(-0.5, 0.0), (0.5, 0.0)])
figures.plot_distance_error(short, r_robot=r, eps=eps, extent=1.3, ax=sides[1]).set_title(
    "Around a wall of 1 m"
)
record.figure(fig, "maps")

# %% [markdown]
# ## Around a zone: never too long
#
# Let $p$ be the point of the ellipse nearest to $x$. The triangle inequality for both foci,
# $\|x-c\| \le \|x-p\| + \|p-c\|$, summed and halved, gives
#
# $$d(x) \le \|x-p\| + d(p) = \|x-p\|,$$
#
# since $d = 0$ on the ellipse. So the focal distance **never over-estimates**, for any
# eccentricity, and a zone needs **no margin at all**. What grows with the eccentricity is the room
# given away beside the person: at most $r + \epsilon$ becomes
# $\sqrt{(a+r+\epsilon)^2-c^2} - b$.

# %%
points = np.random.default_rng(seed).uniform(-4, 4, (100_000, 2))
true = distances.euclidean_to_ellipse(points, zone)
over = distances.compute_distance_error(points, zone)[true > 0]
most = 100 * float(over.max())
record.check(
    "the focal distance never over-estimates", most <= 1e-7, f"by {most + 0.0:.2g} cm at most", always=True
)

# %%
a = zone.semi_axes[0]
rows = {}
for e in eccentricities:
    like = szlib.Ellipse((0.0, 0.0), (a, a * np.sqrt(1 - e**2)))
    rows[e] = distances.compare_distances(like, r_robot=r, eps=eps)
zones = (100 * pd.DataFrame(rows.values(), index=rows.keys())).rename_axis("eccentricity").round(1)
zones.columns = ["least gap [cm]", "greatest gap [cm]", "margin required [cm]"]
zones

# %%
learned = distances.compare_distances(zone, r_robot=r, eps=eps)
beside = learned.farthest - eps
record.claim(
    "eps covers the error around the learned zone",
    learned.required <= eps,
    f"{100 * learned.required:.1f} cm needed",
)
enough = learned.nearest >= eps - 1e-6
record.check("the gap left around the learned zone is at least eps", enough, learned.nearest, always=True)
record.key["room given away beside the zone [cm]"] = 100 * beside
print(f"beside the learned zone the robot keeps {100 * beside:.1f} cm more than it has to")

# %% [markdown]
# ## Around a wall: too long at its ends
#
# Straight ahead of an end, at the true distance $s$, the trimming term is $-t = s + s^2/L$, and
# $d$ is just that. The robot's disc touches the end at $s = r$, where $d = r + r^2/L$; nowhere else
# on the outline at distance $r$ is $d$ longer (proof in `szlib.control.distances`). So
#
# $$\epsilon_{required} = \frac{r^2}{L},$$
#
# and 5 cm are enough from $L = r^2/\epsilon = 5$ m on. Below, the gap that the paper's margin
# leaves between the robot's disc and the wall, at worst: negative is a collision with $h \ge 0$.

# %%
walls = {length: distances.compare_distances([(0, 0), (length, 0)], r_robot=r, eps=eps) for length in lengths}
table = (100 * pd.DataFrame(walls.values(), index=walls.keys())).rename_axis("wall [m]").round(1)
table.columns = ["least gap [cm]", "greatest gap [cm]", "margin required [cm]"]
table

# %%
for length, found in walls.items():
    gap = f"{round(100 * found.nearest, 1) + 0.0} cm left"
    record.claim(f"eps covers the error of a wall of {length:g} m", found.nearest >= -1e-9, gap)
    enough = max(eps, found.required)
    mended = distances.compare_distances([(0, 0), (length, 0)], r_robot=r, eps=enough)
    claim = f"eps = {100 * enough:.1f} cm is enough for a wall of {length:g} m"
    record.check(claim, mended.nearest >= -1e-9, mended.nearest, always=True)

# %%
fig, ax = plt.subplots(figsize=(7, 3.8), layout="constrained")
length = np.geomspace(0.4, 14, 200)
ax.plot(length, 100 * r**2 / length, label="required by a wall: $r^2/L$")
ax.axhline(100 * eps, color=figures.RED, linestyle="--", label="the paper's eps")
ax.plot(length, 0 * length, color=figures.GREEN, linestyle=":", label="required by a zone: none")
ax.set(xlabel="length of the wall [m]", ylabel="margin [cm]", xscale="log", ylim=(-2, 65))
ax.set_xticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
ax.set_title("A short wall needs a large margin")
ax.legend()
record.figure(fig, "margin")

# %% [markdown]
# ## The controller with enough margin
#
# `MPCSettings.paper()` keeps the paper's eps around every wall (`margin="paper"`). `MPCSettings()` gives each wall
# what it requires, $\max(\epsilon, r^2/L)$ (`margin="euclidean"`). A robot with the paper's settings is sent to a
# goal 40 cm ahead of the end of a wall of 1 m: 10 cm too near for its disc, yet $h \ge 0$ there by that margin.

# %%
wall = np.array([[(0.0, -1.0), (0.0, 0.0)]])
start, goal = np.array([-2.0, 3.0, 0.0, 0.0]), np.array([0.0, 0.4])
scenario = szlib.Scenario("end", start, goal, walls=wall, title="To the end of a wall of 1 m")
paper = szlib.MPCSettings.paper()
log = drive(scenario, szlib.MPCCBF(zone, walls=wall, settings=paper), until_arrival=False)
nearest, lowest = float(log.clearance.min()), float(log.h.min())
print(f"eps {eps:.2f} m: min h {100 * lowest:+.1f} cm, true gap {100 * nearest:+.1f} cm")
record.check("the paper's barrier is not negative all the way", lowest >= -1e-6, lowest)
record.claim("the paper's barrier keeps the robot off the wall", nearest >= 0, f"{100 * nearest:.0f} cm left")
overlaps = log.clearance.min(axis=1) < -1e-6
honest = not (log.safe[:-1] & overlaps[1:]).any()
record.check("no step into an overlap says that it is safe", honest, always=True)

# %%
careful, refusal = szlib.MPCCBF(zone, walls=wall, settings=settings), ""
try:
    careful.step(start, goal)
except szlib.SolverError as error:
    refusal = str(error)
    print(f"margin {distances.wall_margin(wall[0], settings):.2f} m: {refusal}")
record.check(
    "with the required margin a goal too close to the wall is refused", "cannot be reached" in refusal
)

# %%
past = szlib.Scenario("past", start, np.array([1.0, -3.0]), walls=wall, title="Around the end of a wall")
log = drive(past, careful, until_arrival=False)
gap = float(log.clearance.min())
record.check("on the way around the end of the wall nothing is touched", gap >= 0, gap)
record.key["wall of 1 m, paper's eps: gap [cm]"] = 100 * nearest

# %% [markdown]
# **What it means.** Around people the margin is not needed, and the approximation errs to the safe
# side: it keeps the robot farther off. At the ends of walls shorter than 5 m it is not enough; the paper's
# restricted pathway has such walls. The right margin is $r^2/L$, and that is what the controller keeps.
# It costs at most 0.42 r of room, beside walls as long as the robot is wide: describe a row of short
# pieces as one long wall.

# %%
record.close()

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
# # Sheet 3 - From samples to a zone
#
# Write each function, then run the cell below it: it asks your function for many fresh cases and says
# what is right or wrong. A case that fails is printed with its seed, so that you can run it again.
# `judges.hint("crossing", 1)` prints a hint, 2 and 3 print more. Write the functions with NumPy and
# pandas: an answer that calls szlib is refused, unless the task allows it.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 2](sheet2_outliers.ipynb) · next: [sheet
# 4](sheet4_certainty.ipynb) · [to do](../exercises/sheet3_zones.ipynb) ·
# [solved](../solutions/sheet3_zones.ipynb) · 3 h 35 min · belongs to [04](../04_hull.ipynb),
# [05](../05_zones.ipynb)

# %%
# Solution: the judges are in the folder of the sheets.
import sys

sys.path.append("../exercises")

# %%
import judges
import matplotlib.pyplot as plt
import numpy as np

import szlib
from szlib.workbook import figures

# %% [markdown]
# ## 3.1 A slice by hand (10 min)
#
# The hull over $(x', y', \text{speed})$ has edges from vertex `a` to vertex `b`, shape (3,) each. The
# slice at a speed is the polygon of the points where edges cross the plane of that speed. Give the
# point $(x', y')$ where this edge does, shape (2,).


# %%
def crossing(a, b, speed):
    """Where the edge from a to b crosses the plane of one speed: (x', y') [m]."""
    ### BEGIN SOLUTION
    share = (speed - a[2]) / (b[2] - a[2])
    return a[:2] + share * (b[:2] - a[:2])
    ### END SOLUTION


# %%
judges.check("crossing", crossing)

# %% [markdown]
# ## 3.2 The zone that a slice leaves (25 min)
#
# `polygon` is a slice: its corners in the complementary plane, counter-clockwise around the origin,
# shape (k, 2) [m]. How far does the zone reach in the direction `theta` [rad]: $r_{max} -
# R'(\theta)$, where $R'(\theta)$ is the distance from the origin to the polygon's edge in that
# direction?

# %%
corner = np.radians([20, 75, 140, 200, 265, 320, 380])
polygon = np.column_stack([1.3 * np.cos(corner), np.sin(corner)])
ax = figures.get_axes(None, size=(5, 4.2))
ax.fill(*polygon.T, facecolor=figures.BLUE, alpha=0.3)
ax.plot([0, 1.5 * np.cos(0.9)], [0, 1.5 * np.sin(0.9)], "--", color=figures.BLACK)
ax.annotate("theta", (0.95, 1.08))
ax.plot(0, 0, "o", color=figures.BLACK)
figures.label_metres(ax, "Where does the ray leave the slice?").set(xlabel="x' [m]", ylabel="y' [m]")
plt.show()


# %%
def zone_radius(polygon, theta, r_max):
    """How far the zone reaches in the direction theta [m]."""
    ### BEGIN SOLUTION
    along = np.roll(polygon, -1, axis=0) - polygon
    normal = np.column_stack([along[:, 1], -along[:, 0]])
    distance = (normal * polygon).sum(axis=1)
    facing = normal @ [np.cos(theta), np.sin(theta)]
    reach = (distance[facing > 0] / facing[facing > 0]).min()
    return r_max - reach
    ### END SOLUTION


# %%
judges.check("zone_radius", zone_radius)

# %% [markdown]
# ## 3.3 The smallest ellipse (20 min)
#
# `triangle` holds three points, shape (3, 2) [m]. What is the area of the smallest ellipse that
# contains them? (You need no search: think of an equilateral triangle first, and of what stretching
# the plane does to areas.)


# %%
def triangle_ellipse(triangle):
    """Area of the smallest ellipse around a triangle [m2]."""
    ### BEGIN SOLUTION
    (ax, ay), (bx, by) = triangle[1:] - triangle[0]
    return 4 * np.pi / (3 * np.sqrt(3)) * abs(ax * by - ay * bx) / 2
    ### END SOLUTION


# %%
judges.check("triangle_ellipse", triangle_ellipse)

# %% [markdown]
# ## 3.4 A zone of your own (an evening, 150 min)
#
# `samples` are the encounters of a fresh plaza: columns `encounter`, `los_angle` [rad], `distance`
# [m], `speed` of the reference pedestrian [m/s]. Everybody keeps out of everybody's zone, but one in
# a hundred walks right through it. Find the zone of people who walk at `speed` [m/s], as a `szlib.Ellipse` in the
# person's frame: centre and semi-axes within 10 cm and, where the semi-axes differ, the angle within 0.2 rad.
# Width, length, centre, angle, speed, and whether zones grow or shrink with speed are drawn anew each
# time, each for itself. Of szlib you may use `szlib.Ellipse` only.


# %%
def my_zone(samples, speed):
    """The zone at this speed [m/s], a szlib.Ellipse in the person's frame."""
    ### BEGIN SOLUTION
    close = samples[(samples["distance"] <= 2) & samples["speed"].between(speed - 0.2, speed + 0.2)]
    edge = []
    for theta in np.radians(np.arange(-180, 180, 10)):
        off = np.angle(np.exp(1j * (close["los_angle"] - theta)))
        approach = close[np.abs(off) < np.radians(12)].groupby("encounter")["distance"].min()
        edge.append(np.quantile(approach, 0.07) * np.array([np.cos(theta), np.sin(theta)]))
    x, y = np.transpose(edge)
    terms = np.column_stack([x * x, x * y, y * y, x, y])
    p, q, r, s, t = np.linalg.lstsq(terms, np.ones(len(x)))[0]
    form = np.array([[p, q / 2], [q / 2, r]])
    center = -np.linalg.solve(form, [s, t]) / 2
    values, vectors = np.linalg.eigh(form / (1 + center @ form @ center))
    a, b = 1 / np.sqrt(values)
    return szlib.Ellipse(center, (a, b), np.arctan2(vectors[1, 0], vectors[0, 0]))
    ### END SOLUTION


# %%
judges.check("my_zone", my_zone)

# %% [markdown]
# ## 3.5 In your own words (10 min)
#
# Your zone of 3.4 is within 10 cm on synthetic plazas. Name three reasons why it may be farther off in a
# real hall, and for each of them what you would look at in the data to notice it. Write five to eight
# sentences.

# %% [markdown]
# **Rubric** (10 points; a person grades this answer)
#
# | points | for |
# |---|---|
# | 3 | three different reasons, such as few encounters in a direction, groups, walls, errors of tracking, culture or crowding |
# | 3 | for each reason an observation in the data that would show it |
# | 2 | bias is told from noise: which of the reasons more data would not mend |
# | 2 | the choice of quantile and speed range of one's own method is discussed |

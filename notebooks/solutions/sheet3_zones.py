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
# # Sheet 3 - From samples to a zone, and how sure
#
# Write each function, then run the cell below it: it asks your function for many fresh cases and says
# what is right or wrong. A case that fails is printed with its seed, so that you can run it again.
# `judges.hint("crossing", 1)` prints a hint, 2 and 3 print more. Write the functions with NumPy and
# pandas: an answer that calls szlib is refused, unless the task allows it.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 2](sheet2_outliers.ipynb) · next: [sheet
# 4](sheet4_own_zone.ipynb) · [to do](../exercises/sheet3_zones.ipynb) ·
# [solved](../solutions/sheet3_zones.ipynb) · 1 h 55 min · belongs to [04](../04_hull.ipynb),
# [05](../05_zones.ipynb), [06](../06_respect.ipynb)

# %%
# Solution: the judges are in the folder of the sheets.
import sys

sys.path.append("../exercises")

# %%
import judges
import matplotlib.pyplot as plt
import numpy as np

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
# ## 3.4 The quantile zone in one direction (10 min)
#
# `nearest` holds how near people came in one direction, one number for each encounter [m]. The
# quantile zone ends at the least approach such that at least a share `q` of the encounters came as
# near as that, or nearer. Give this radius [m]: always the approach of somebody, never a number in
# between.


# %%
def quantile_radius(nearest, q):
    """Radius of the quantile zone in this direction [m]."""
    ### BEGIN SOLUTION
    return min(radius for radius in nearest if np.mean(nearest <= radius) >= q)
    ### END SOLUTION


# %%
judges.check("quantile_radius", quantile_radius)

# %% [markdown]
# ## 3.5 Why the hull shrinks (15 min)
#
# People keep out of a zone, and each a little farther: by a distance that is exponentially
# distributed with mean `mean` [m], each independently of the others. How far from the zone's edge is
# the nearest of `n` people, on average [m]?


# %%
def expected_nearest(mean, n):
    """Mean distance of the nearest of n people from the edge of the zone [m]."""
    ### BEGIN SOLUTION
    return mean / n
    ### END SOLUTION


# %%
judges.check("expected_nearest", expected_nearest)

# %% [markdown]
# **Solution.** All n keep more than x with probability exp(-x / mean)^n = exp(-n x / mean). So the
# nearest is exponential again, with mean / n. On a real day there is no sharp edge behind it, and the
# hull goes on shrinking: that is why chapter 05 takes a quantile, which settles.

# %%
counts = np.geomspace(10, 1000, 20).astype(int)
drawn = [np.random.default_rng(0).exponential(0.3, (400, n)) for n in counts]
ax = figures.get_axes(None, size=(6, 3.6))
ax.plot(counts, [each.min(axis=1).mean() for each in drawn], "o", color=figures.BLUE, label="nearest of n")
ax.plot(
    counts,
    [np.quantile(d, 0.05, axis=1).mean() for d in drawn],
    "s",
    color=figures.ORANGE,
    label="5 % quantile",
)
ax.set(xscale="log", yscale="log", xlabel="encounters n", ylabel="from the zone's edge [m]")
ax.set_title("An extreme goes on shrinking, a quantile settles")
ax.legend()
plt.show()

# %% [markdown]
# ## 3.6 A p-value (10 min)
#
# `observed` says how rarely people were near each other, and the array `null` what the same number is
# in many null models, where people do not react to each other. Large values speak for respect. How
# likely is a value as large as the observed one, or larger, if people do not react? The data then is
# one draw among all the others.


# %%
def p_value(observed, null):
    """One-sided p-value, a share in (0, 1]."""
    ### BEGIN SOLUTION
    return (1 + (null >= observed).sum()) / (1 + len(null))
    ### END SOLUTION


# %%
judges.check("p_value", p_value)

# %% [markdown]
# ## 3.7 The null model (15 min)
#
# The null model keeps each person's path and moves it in time. Samples have times `t` [s], from 0 to
# `period`, and belong to `person` (its number, from 0), both of shape (n,); `shift` says by how much
# each person is moved, one number a person [s], of either sign. Give the new times. A person who is moved past
# the end of the recording comes in at its beginning.


# %%
def shifted(t, person, shift, period):
    """New times in [0, period) [s], shape (n,)."""
    ### BEGIN SOLUTION
    return (t + shift[person]) % period
    ### END SOLUTION


# %%
judges.check("shifted", shifted)

# %% [markdown]
# ## 3.8 In your own words (10 min)
#
# The null model of people who ignore each other is rejected with p = 0.01. A newspaper writes that with a
# probability of 99 % people respect each other's zone. Correct the sentence, and say what the number does
# and does not support. Write five to eight sentences.

# %% [markdown]
# **Rubric** (10 points; a person grades this answer)
#
# | points | for |
# |---|---|
# | 3 | p is the probability of data at least as extreme if the null model were true, not that of the null model |
# | 3 | what is rejected: independent times on the same paths; other reasons than respect can reject it as well |
# | 2 | the size of the effect is another question than p |
# | 2 | p cannot be less than 1 / (1 + number of shifts) |

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
    # YOUR CODE HERE
    raise NotImplementedError()


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
    # YOUR CODE HERE
    raise NotImplementedError()


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
    # YOUR CODE HERE
    raise NotImplementedError()


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
    # YOUR CODE HERE
    raise NotImplementedError()


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
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("expected_nearest", expected_nearest)

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
    # YOUR CODE HERE
    raise NotImplementedError()


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
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("shifted", shifted)

# %% [markdown]
# ## 3.8 In your own words (10 min)
#
# The null model of people who ignore each other is rejected with p = 0.01. A newspaper writes that with a
# probability of 99 % people respect each other's zone. Correct the sentence, and say what the number does
# and does not support. Write five to eight sentences.

# %% [markdown]
# YOUR ANSWER HERE

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
# # Sheet 1 - Tracks and meetings
#
# Write each function, then run the cell below it: it asks your function for many fresh cases and says
# what is right or wrong. A case that fails is printed with its seed, so that you can run it again.
# `judges.hint("velocity", 1)` prints a hint, 2 and 3 print more. Write the functions with NumPy and
# pandas: an answer that calls szlib is refused, unless the task allows it. Units are metres, seconds and
# radians throughout.

# %% [markdown]
# [Start](../00_start_here.ipynb) · next: [sheet 2](sheet2_outliers.ipynb) · [to
# do](../exercises/sheet1_tracks.ipynb) · [solved](../solutions/sheet1_tracks.ipynb) · 1 h 00 min · belongs
# to [01](../01_tracks.ipynb), [02](../02_encounters.ipynb)

# %%
import judges
import matplotlib.pyplot as plt
import numpy as np

import szlib
from szlib.workbook import figures

# %% [markdown]
# ## 1.1 Velocity (5 min)
#
# `path` holds a person's positions, shape (n, 2) [m], one each 0.1 s. Give their velocity (vx, vy)
# [m/s] at tick `k` (row k of `path`): the displacement from `half` ticks before to `half` ticks after it,
# over the time between. (szlib takes half a second to either side: a step is about as long, and shorter spans see
# the body sway.)


# %%
def velocity(path, k, half):
    """Velocity (vx, vy) [m/s] at tick k."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("velocity", velocity)

# %% [markdown]
# ## 1.2 The line of sight (10 min)
#
# A reference pedestrian at `ref` walks in the direction `heading` (counter-clockwise from x).
# Somebody is at `other`. Give the line-of-sight angle: their bearing in the reference pedestrian's
# own frame, 0 straight ahead, positive to the left, in (-pi, pi].

# %%
ref, heading, other = np.array([1.0, 1.0]), 2.4, np.array([-1.5, 0.6])
ax = figures.get_axes(None, size=(5, 3.6))
ax.plot(*ref, marker=(3, 0, np.degrees(heading) - 90), color=figures.BLACK, markersize=14)
ax.arrow(*ref, 1.5 * np.cos(heading), 1.5 * np.sin(heading), head_width=0.1, color=figures.BLACK)
ax.plot(*other, "o", color=figures.ORANGE, markersize=10)
ax.plot(*np.transpose([ref, other]), ":", color=figures.ORANGE)
ax.annotate("other", (-1.5, 0.3), ha="center")
ax.annotate("ref, with heading", (1.2, 1.1))
figures.label_metres(ax, "Which angle is the line of sight?").set(xlim=(-2.5, 3.2), ylim=(0, 2.6))
plt.show()


# %%
def line_of_sight(ref, heading, other):
    """Bearing of the other in the reference pedestrian's frame [rad], in (-pi, pi]."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("line_of_sight", line_of_sight)

# %% [markdown]
# ## 1.3 The attentional space (15 min)
#
# The paper watches a rectangle ahead of the reference pedestrian, 5 m long and 4 m wide, which turns
# with them. `others` holds many positions in the world, shape (n, 2). Say for each whether it lies in
# that space: booleans, shape (n,).

# %%
corners = szlib.AttentionalSpace().corners
ax = figures.get_axes(None, size=(4.5, 3.6))
ax.fill(*corners.T, color=figures.BLUE, alpha=0.3)
ax.plot(0, 0, marker=(3, 0, -90), color=figures.BLACK, markersize=14)
figures.label_metres(ax, "The attentional space", person=True)
plt.show()


# %%
def in_space(ref, heading, others):
    """Which of the others (n, 2) [m] are in the attentional space, shape (n,)."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("in_space", in_space)

# %% [markdown]
# ## 1.4 What one sample a second loses (20 min)
#
# The public day of the ATC mall has one position a second. Between two of them szlib draws a straight
# line. Somebody walks along a circle of `radius` [m] at `speed` [m/s] and is seen every `interval`
# [s]. How far at most is the straight line from where they walked [m]?


# %%
def one_hertz(radius, speed, interval):
    """Greatest distance between the arc and its chord [m]."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("one_hertz", one_hertz)

# %% [markdown]
# ## 1.5 In your own words (10 min)
#
# A tracker gives one position a second, and its positions have errors of some 5 cm. A colleague takes the
# velocity from two samples that follow each other, and says that people in this hall turn sharply every
# second. What do you answer, and what would you compute instead? Write five to eight sentences.

# %% [markdown]
# YOUR ANSWER HERE

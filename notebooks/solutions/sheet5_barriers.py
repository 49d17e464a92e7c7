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
# # Sheet 5 - Barriers
#
# Write each function, then run the cell below it: it asks your function for many fresh cases and says
# what is right or wrong. A case that fails is printed with its seed, so that you can run it again.
# `judges.hint("barrier_row", 1)` prints a hint, 2 and 3 print more. Write the functions with NumPy and
# pandas: an answer that calls szlib is refused, unless the task allows it.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 4](sheet4_certainty.ipynb) · next: [sheet
# 6](sheet6_robot.ipynb) · [to do](../exercises/sheet5_barriers.ipynb) ·
# [solved](../solutions/sheet5_barriers.ipynb) · 1 h 10 min · belongs to [07](../07_barriers.ipynb)

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
# ## 5.1 Focal distance (15 min)
#
# A zone is an ellipse with a `center` (m, n), `semi_axes` (a, b) with a >= b [m] and the `angle` of
# its longer axis, counter-clockwise from x [rad]. Give for each of `points`, shape (n, 2), the
# paper's distance (eq. 7): half the sum of the distances to the two foci, less a.

# %%
zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
grid = np.stack(np.meshgrid(np.linspace(-2, 2, 201), np.linspace(-2, 2, 201)), axis=-1)
ax = figures.get_axes(None, size=(5.5, 4.5))
lines = ax.contour(*np.moveaxis(grid, -1, 0), szlib.ellipse_distance(grid, zone), levels=7)
ax.clabel(lines, fontsize=7)
ax.plot(*zone.curve().T, color=figures.BLACK, linewidth=2)
figures.label_metres(ax, "Distance to the zone [m]", person=True)
plt.show()


# %%
def focal_distance(points, center, semi_axes, angle):
    """Approximate signed distance of points to the ellipse (n,) [m]."""
    ### BEGIN SOLUTION
    a, b = semi_axes
    offset = np.sqrt(a**2 - b**2) * np.array([np.cos(angle), np.sin(angle)])
    to_foci = [np.hypot(*(points - center - side * offset).T) for side in (1, -1)]
    return (to_foci[0] + to_foci[1]) / 2 - a
    ### END SOLUTION


# %%
judges.check("focal_distance", focal_distance)

# %% [markdown]
# ## 5.2 The distance to a wall (15 min)
#
# A wall goes from `a` to `b`, shape (2,) each. Give for each of `points`, shape (n, 2), the paper's
# distance (eq. 3-5), with $L$ the wall's length and $\mathbf{x}_c$ its middle:
#
# $$g = \frac{(x-x_a)(y_b-y_a)-(y-y_a)(x_b-x_a)}{L},\quad
#   t = \frac{(L/2)^2-\|\mathbf{x}-\mathbf{x}_c\|^2}{L},\quad
#   d = \sqrt{g^2 + \left(\tfrac{|t|-t}{2}\right)^2}$$


# %%
def wall_distance(points, a, b):
    """Approximate distance of points to the wall (n,) [m]."""
    ### BEGIN SOLUTION
    length = np.hypot(*(b - a))
    x, y = (points - a).T
    g = (x * (b - a)[1] - y * (b - a)[0]) / length
    t = ((length / 2) ** 2 - ((points - (a + b) / 2) ** 2).sum(axis=1)) / length
    return np.sqrt(g**2 + ((np.abs(t) - t) / 2) ** 2)
    ### END SOLUTION


# %%
judges.check("wall_distance", wall_distance)

# %% [markdown]
# ## 5.3 A barrier row (10 min)
#
# The robot's centre is at the distance `d_now` from a zone, and after the step at `d_next` [m]. With
# the barrier $h = d - r_{robot} - \epsilon$ the step is allowed if $h_{next} - h_{now} \ge
# -\gamma\,h_{now}$ (eq. 1). Give what this row has left over [m]: positive where the step is allowed,
# 0 where it just is.


# %%
def barrier_row(d_now, d_next, gamma, r_robot, eps):
    """What the barrier condition leaves over [m]."""
    ### BEGIN SOLUTION
    h_now, h_next = d_now - r_robot - eps, d_next - r_robot - eps
    return h_next - (1 - gamma) * h_now
    ### END SOLUTION


# %%
judges.check("barrier_row", barrier_row)

# %% [markdown]
# ## 5.4 The margin at the end of a wall (20 min)
#
# Straight ahead of the end of a wall the distance of 5.2 is too long. A robot of radius `r_robot` may
# stand so that its disc just touches the end. By how much does $d$ exceed the radius there? So large
# must the margin eps be, or $h \ge 0$ allows an overlap. `length` is the wall's [m].


# %%
def end_margin(r_robot, length):
    """The least margin eps that keeps the robot off the end of the wall [m]."""
    ### BEGIN SOLUTION
    to_middle = length / 2 + r_robot
    d = (to_middle**2 - (length / 2) ** 2) / length
    return d - r_robot
    ### END SOLUTION


# %%
judges.check("end_margin", end_margin)

# %% [markdown]
# **Solution.** It comes to r^2 / L: with the paper's robot (0.5 m) and margin (5 cm) a wall must be 5
# m long. The walls of the paper's restricted pathway are shorter; notebook 22 shows the collision.

# %% [markdown]
# ## 5.5 In your own words (10 min)
#
# A colleague proposes to drop gamma and to require h >= 0 at the next step only. When is the robot still
# safe, when not, and what does gamma cost? Use the barrier row of 5.3. Write five to eight sentences.

# %% [markdown]
# **Rubric** (10 points; a person grades this answer)
#
# | points | for |
# |---|---|
# | 3 | with gamma = 1 the row limits the robot only when it is too late to brake |
# | 3 | inertia or limits on the input are the reason; a robot that obeys at once is safe |
# | 2 | a small gamma slows the robot down early, far from anybody |
# | 2 | a calculation or a sketch with numbers |

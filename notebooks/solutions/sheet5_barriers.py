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
# # Sheet 5 - Barriers, and the first filter
#
# Write each function, then run the cell below it: it asks your function for many fresh cases and says
# what is right or wrong. A case that fails is printed with its seed, so that you can run it again.
# `judges.hint("barrier_row", 1)` prints a hint, 2 and 3 print more. Write the functions with NumPy and
# pandas: an answer that calls szlib is refused, unless the task allows it.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 4](sheet4_own_zone.ipynb) · next: [sheet
# 6](sheet6_controller.ipynb) · [to do](../exercises/sheet5_barriers.ipynb) ·
# [solved](../solutions/sheet5_barriers.ipynb) · 2 h 15 min · belongs to [07](../07_barriers.ipynb),
# [08](../08_build_a_controller.ipynb)

# %%
# Solution: the judges are in the folder of the sheets.
import sys

sys.path.append("../exercises")

# %%
import judges
import matplotlib.pyplot as plt
import numpy as np
from judges.qp import solve_qp

import szlib
from szlib.workbook import figures

DT = 0.1  # time of a step [s]
RADIUS = 1.0  # h = 0 at this distance from a person's centre [m]
V_MAX = 1.0  # 5.5, 5.6: largest velocity of the robot on each axis [m/s]
A_MAX = 2.0  # 5.7: largest acceleration of the robot on each axis [m/s2]
N = 15  # steps of a plan

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
# m long. The paper gives no lengths. The walls that we assume for its pathway are shorter; notebook 22 shows the collision.

# %% [markdown]
# The next three tasks begin a controller; sheet 6 goes on with it. The checks of 5.5 and 5.6 drive a robot with your function
# through worlds that you have not seen. If it does not arrive with $h \ge 0$ at every step, the check says when and why, and
# `judges.plot("filter_1d", filter_1d, seed=..., number=...)` shows that world.

# %% [markdown]
# `solve_qp(H, f, rows, least, low, high)` gives the z with the smallest $\tfrac12 z^\top H z + f^\top z$ for
# which `rows @ z >= least` and `low <= z <= high`. `rows` and `least` may be empty lists. It raises
# `Infeasible` if there is none; leave that to the judge. An example: as near to 3 as 2 z >= 1 and |z| <= 2
# allow.

# %%
solve_qp([[2.0]], [-6.0], rows=[[2.0]], least=[1.0], low=-2.0, high=2.0)

# %% [markdown]
# ## 5.5 A filter on a road (15 min)
#
# A robot at `x` [m] chooses its velocity $v$ [m/s], and moves by $v\,\Delta t$ in a step. It would like to
# have the velocity `wish`. A person ahead, at `person` > `x`, walks with `velocity` (negative: towards the
# robot). The barrier is $h = \text{person} - x - R$, and the condition (eq. 1) is $h_{next} \ge
# (1-\gamma)\,h_{now}$. Give the velocity nearest to `wish` that satisfies it, in [-V_MAX, V_MAX]. (With one
# number, a CBF-QP needs no solver.)


# %%
def filter_1d(x, wish, person, velocity, gamma):
    """The velocity nearest to the wish [m/s] that the barrier allows."""
    ### BEGIN SOLUTION
    h = person - x - RADIUS
    limit = gamma * h / DT + velocity
    return np.clip(min(wish, limit), -V_MAX, V_MAX)
    ### END SOLUTION


# %%
judges.check("filter_1d", filter_1d)

# %% [markdown]
# ## 5.6 A filter in the plane (25 min)
#
# Now `x` and `wish` have shape (2,), `people` and `velocities` shape (n, 2). The barrier of person $i$ is
# $h_i = \|\mathbf x - \mathbf p_i\| - R$, and $\mathbf n_i$ is the unit vector from the person to the robot.
# Since $h_i$ changes by $\mathbf n_i^\top(\mathbf u - \mathbf w_i)\,\Delta t$ in a step at least, the
# condition is satisfied if
#
# $$\mathbf n_i^\top (\mathbf u - \mathbf w_i) \ge -\gamma\,h_i / \Delta t \quad\text{for each person.}$$
#
# Give the velocity $\mathbf u$, shape (2,), with the smallest $\|\mathbf u - \text{wish}\|^2$, each of its
# numbers in [-V_MAX, V_MAX].


# %%
def filter_2d(x, wish, people, velocities, gamma):
    """The velocity (2,) nearest to the wish [m/s] that the barriers of all people allow."""
    ### BEGIN SOLUTION
    distance = np.linalg.norm(x - people, axis=1)
    away = (x - people) / distance[:, None]
    h = distance - RADIUS
    least = (away * velocities).sum(axis=1) - gamma * h / DT
    return solve_qp(2 * np.eye(2), -2 * wish, away, least, -V_MAX, V_MAX)
    ### END SOLUTION


# %%
judges.check("filter_2d", filter_2d)

# %% [markdown]
# ## 5.7 The states of a plan (25 min)
#
# From here on the robot has inertia: its input is an acceleration $u$ [m/s2], and
#
# $$\mathbf s_{k+1} = A\,\mathbf s_k + B\,u_k,\quad \mathbf s = \begin{pmatrix}x\\v\end{pmatrix},\quad
#   A = \begin{pmatrix}1&\Delta t\\0&1\end{pmatrix},\quad
#   B = \begin{pmatrix}\Delta t^2/2\\\Delta t\end{pmatrix}.$$
#
# A *condensed* MPC has no states among its unknowns: they are computed from the inputs. Give the matrix $M$,
# shape (2 N, 2 + N), for which
#
# $$(x_1, v_1, x_2, v_2, \dots, x_N, v_N) = M\,(x_0, v_0, u_0, \dots, u_{N-1}).$$
#
# The check puts your matrix into an MPC of its own, for several N.


# %%
def predict(N):
    """The matrix (2 N, 2 + N) that gives all states of a plan."""
    ### BEGIN SOLUTION
    A, B = np.array([[1, DT], [0, 1]]), np.array([DT**2 / 2, DT])
    M, state = [], np.eye(2, 2 + N)
    for k in range(N):
        state = A @ state
        state[:, 2 + k] = B
        M.append(state)
    return np.vstack(M)
    ### END SOLUTION


# %%
judges.check("predict", predict)

# %% [markdown]
# ## 5.8 In your own words (10 min)
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

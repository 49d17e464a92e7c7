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
# # Sheet 6 - A controller
#
# You go on with the controller of sheet 5: a plan (MPC), and plan and barrier together (MPC-CBF), first on a
# road, then in the plane. Each check drives a robot with your function through worlds
# that you have not seen, with people who stand and walk. The robot must arrive, with $h \ge 0$ at every
# step and inputs within their limits. If it does not, the check says when and why, and
# `judges.plot("mpc_1d", mpc_1d, seed=..., number=...)` shows that world. `judges.hint("mpc_1d", 1)`
# prints a hint.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 5](sheet5_barriers.ipynb) · next: [sheet
# 7](sheet7_robot.ipynb) · [to do](../exercises/sheet6_controller.ipynb) ·
# [solved](../solutions/sheet6_controller.ipynb) · 2 h 15 min · belongs to
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

DT = 0.1  # time of a step [s]
RADIUS = 1.0  # h = 0 at this distance from a person's centre [m]
A_MAX = 2.0  # largest acceleration of the robot on each axis [m/s2]
N = 15  # steps of a plan

# %% [markdown]
# `solve_qp(H, f, rows, least, low, high)` gives the z with the smallest $\tfrac12 z^\top H z + f^\top z$ for
# which `rows @ z >= least` and `low <= z <= high`. `rows` and `least` may be empty lists. It raises
# `Infeasible` if there is none; leave that to the judge. An example: as near to 3 as 2 z >= 1 and |z| <= 2
# allow.

# %%
solve_qp([[2.0]], [-6.0], rows=[[2.0]], least=[1.0], low=-2.0, high=2.0)

# %% [markdown]
# `plan_matrix(N)` is the matrix of task 5.7: all states of a plan, from the first state and the inputs.


# %%
def plan_matrix(N):
    """The matrix (2 N, 2 + N) that gives all states of a plan, as in task 5.7."""
    A, B = np.array([[1, DT], [0, 1]]), np.array([DT**2 / 2, DT])
    M, state = [], np.eye(2, 2 + N)
    for k in range(N):
        state = A @ state
        state[:, 2 + k] = B
        M.append(state)
    return np.vstack(M)


# %% [markdown]
# ## 6.1 MPC on a road (25 min)
#
# `state` is $(x_0, v_0)$, `goal` a position [m]. Give the plan $u_0, \dots, u_{N-1}$, shape (N,), with the
# smallest cost
#
# $$\sum_{k=1}^{N}\left((x_k - goal)^2 + 2\,v_k^2\right) + \sum_{k=0}^{N-1} u_k^2, \qquad |u_k| \le A_{max}.$$
#
# Put the states of 5.7 in, and read off H and f. The robot takes the first input of each plan, and asks
# again.


# %%
def mpc_1d(state, goal):
    """The plan (N,) [m/s2] with the smallest cost."""
    ### BEGIN SOLUTION
    M = plan_matrix(N)
    free, G = M[:, :2] @ state, M[:, 2:]  # states without input, and what the inputs add
    Q = np.diag(np.tile([1, 2], N))
    error = free - np.tile([goal, 0], N)
    H = 2 * (G.T @ Q @ G + np.eye(N))
    f = 2 * G.T @ Q @ error
    return solve_qp(H, f, [], [], -A_MAX, A_MAX)
    ### END SOLUTION


# %%
judges.check("mpc_1d", mpc_1d)

# %% [markdown]
# ## 6.2 MPC-CBF on a road (25 min)
#
# The same with a person on the road, who is at `person` and walks with `velocity`, so that they will be at
# $p_k = \text{person} + k\,\Delta t\,\text{velocity}$. The barrier is $h_k = p_k - x_k - R$. Applied k times,
# eq. 1 gives
#
# $$h_k \ge (1-\gamma)^k\,h_0, \quad k = 1, \dots, N_h .$$
#
# Add these rows to the program of 6.1, and give its plan, shape (N,). (Chapter 08 requires eq. 1 in each step, which
# is a little stricter.)


# %%
def mpc_cbf_1d(state, goal, person, velocity, gamma, N_h):
    """The plan (N,) [m/s2] with the smallest cost that the barrier allows."""
    ### BEGIN SOLUTION
    M = plan_matrix(N)
    free, G = M[:, :2] @ state, M[:, 2:]
    Q = np.diag(np.tile([1, 2], N))
    H = 2 * (G.T @ Q @ G + np.eye(N))
    f = 2 * G.T @ Q @ (free - np.tile([goal, 0], N))
    k = np.arange(1, N_h + 1)
    there = person + k * DT * velocity
    rows = -G[::2][:N_h]
    least = (1 - gamma) ** k * (person - state[0] - RADIUS) - (there - free[::2][:N_h] - RADIUS)
    return solve_qp(H, f, rows, least, -A_MAX, A_MAX)
    ### END SOLUTION


# %%
judges.check("mpc_cbf_1d", mpc_cbf_1d)

# %% [markdown]
# ## 6.3 MPC-CBF in the plane (45 min)
#
# `state` is $(x, y, v_x, v_y)$, `goal` and each of `people` and `velocities` have shape (2,). Each axis has
# the dynamics and the cost of 6.1. A distance is no linear function of the inputs, so the direction of each
# row is taken from `guess`, shape (N, 2): the positions that the last plan gives for $k = 1, \dots, N$. With
# $\mathbf n_k$ the unit vector from $\mathbf p_k$, where the person will be, to `guess[k - 1]`,
#
# $$\mathbf n_k^\top(\mathbf x_k - \mathbf p_k) - R \ge (1-\gamma)^k\,h_0, \quad k = 1, \dots, N_h,
#   \quad\text{for each person,}$$
#
# with $h_0 = \|\mathbf x_0 - \mathbf p_0\| - R$. Since $\|\mathbf x_k - \mathbf p_k\|$ is at least the left
# product, this is on the safe side. Give the plan, shape (N, 2). (Order the unknowns as you like; with those of
# x first, `np.kron` builds H and the rows.)


# %%
def mpc_cbf_2d(state, goal, people, velocities, gamma, N_h, guess):
    """The plan (N, 2) [m/s2] with the smallest cost that the barriers of all people allow."""
    ### BEGIN SOLUTION
    M = plan_matrix(N)
    free, G = M[:, :2] @ state.reshape(2, 2), M[:, 2:]  # a column for each axis
    Q = np.diag(np.tile([1, 2], N))
    H = 2 * (G.T @ Q @ G + np.eye(N))
    f = 2 * G.T @ Q @ (free - np.tile([goal, 0 * goal], (N, 1)))
    rows, least = [], []
    for person, velocity in zip(people, velocities, strict=True):
        h = np.linalg.norm(state[:2] - person) - RADIUS
        for k in range(1, N_h + 1):
            there = person + k * DT * velocity
            away = (guess[k - 1] - there) / np.linalg.norm(guess[k - 1] - there)
            rows.append(np.kron(away, G[2 * k - 2]))
            least.append((1 - gamma) ** k * h + RADIUS - away @ (free[2 * k - 2] - there))
    plan = solve_qp(np.kron(np.eye(2), H), f.T.ravel(), rows, least, -A_MAX, A_MAX)
    return plan.reshape(2, N).T
    ### END SOLUTION


# %%
judges.check("mpc_cbf_2d", mpc_cbf_2d)

# %% [markdown]
# ## 6.4 gamma and N_h (30 min)
#
# Robots with other brakes take the controller of 6.2: `a_max` [m/s2] is between 0.25 and 2. Give $\gamma$ and
# $N_h$, from 2 to N, for each. A person stands 20 cm farther than needed behind the goal, or comes towards the robot with
# up to 0.65 m/s. With a large $\gamma$ the robot finds out too late that it cannot brake, and the program has
# no solution; with a small one it creeps, and does not arrive in time: 28 s for the weakest brakes, 9.6 s for
# the best ones (a_max > 1.6). Below is one of the worlds; `number` goes from 1 to 4.

# %%
judges.plot("tuned", lambda a_max: (0.1, 8), seed=1, number=2)
plt.show()


# %%
def tuned(a_max):
    """gamma and N_h for a robot with this brake [m/s2]."""
    ### BEGIN SOLUTION
    return 0.05 * a_max, 8
    ### END SOLUTION


# %%
judges.check("tuned", tuned)

# %% [markdown]
# ## 6.5 In your own words (10 min)
#
# Your controller was judged in closed loop, and against the exact minimum of its program. What does each
# of the two show that the other does not? Which failure on a real robot would neither of them find? Write
# five to eight sentences.

# %% [markdown]
# **Rubric** (10 points; a person grades this answer)
#
# | points | for |
# |---|---|
# | 3 | the minimum shows that the program is the intended one; the closed loop, that this program is a good one |
# | 3 | an example for each side, such as an infeasible program that is solved correctly |
# | 2 | neither finds wrong models: people who change their velocity, delays, wheels instead of two axes, errors of sensors |
# | 2 | what the worlds contain limits what the closed loop shows |

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
# # Sheet 6 - The robot
#
# Write each function, then run the cell below it: it asks your function for fresh cases and says in
# words what is right or wrong. `judges.hint("speed_limit", 1)` prints a hint, 2 the next, 3 is
# nearly the solution.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 5](sheet5_barriers.ipynb) · [to
# do](../exercises/sheet6_robot.ipynb) · [solved](../solutions/sheet6_robot.ipynb) · 1 h 20 min · belongs to
# [11](../11_waiting.ipynb), [11b](../11b_making_room.ipynb), [12](../12_among_people.ipynb),
# [13](../13_laboratory.ipynb)

# %%
import judges
import matplotlib.pyplot as plt
import numpy as np

import szlib
from szlib.workbook import figures

# %% [markdown]
# ## 6.1 The speed limit (5 min)
#
# The robot drives straight at a person who walks straight at the robot with `person_speed` [m/s]. The
# barrier is at `h` [m] and may fall by the share `gamma` in a step of `dt` [s]. How fast may the
# robot be [m/s]? (Negative: it has to go back.)


# %%
def speed_limit(h, gamma, dt, person_speed):
    """Largest speed of the robot towards the person [m/s]."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("speed_limit", speed_limit)

# %% [markdown]
# ## 6.2 gamma by experiment (40 min)
#
# With the paper's two barrier steps ($N_h = 2$, 0.2 s) a large gamma lets the robot find out too late
# that it cannot brake any more: the problem has no solution, the step is *infeasible*. For the
# scenario `szlib.SCENARIOS["passing"]`, a `zone` that you have not seen and a robot that brakes with
# `a_max` [m/s2], give the largest of `gammas` (ascending) up to which no run has an infeasible step. A
# run takes some 50 ms.

# %%
zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
controller = szlib.MPCCBF(zone, settings=szlib.MPCSettings(gamma=0.15, a_max=0.5))
log = szlib.simulate(szlib.SCENARIOS["passing"], controller)
ax = figures.plot_barriers(log)
ax.set_title(f"gamma = 0.15, a_max = 0.5: {log.metrics()['infeasible_steps']} infeasible steps")
plt.show()


# %%
def largest_gamma(zone, a_max, gammas):
    """The largest gamma, going up from the smallest, before the first with an infeasible step."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("largest_gamma", largest_gamma)

# %% [markdown]
# ## 6.3 The terminal proof (15 min)
#
# With `terminal="rest"` each plan ends at rest, $\mathbf{v}_N = 0$, and the barrier rows hold on the
# whole horizon. Everybody stands. The robot has applied the first control of `plan`, shape (N, 2)
# [m/s2]. Without solving anything: give a plan for the next step, of the same shape, that is sure to
# satisfy every row.


# %%
def next_plan(plan):
    """A plan (N, 2) that satisfies the next problem, from one that satisfied the last."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("next_plan", next_plan)

# %% [markdown]
# ## 6.4 Predict, then run (20 min)
#
# Before you run anything: what changes? `prediction` gives a dict with an answer to each of three
# questions:
#
# - "passing, gamma from 0.05 to 0.1: the least h is": "smaller" or "larger",
# - "waiting at gamma 0.2, N_h from 2 to 8: the infeasible steps are": "fewer" or "more",
# - "passing, from the front to from behind: avoidance starts": "nearer" or "farther away".
#
# The check makes the runs, with a zone that is drawn anew, and compares. Where you were wrong, look for
# the reason in notebooks 07, 09 and 21.


# %%
def prediction():
    """Your answers, made before the runs."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("prediction", prediction)

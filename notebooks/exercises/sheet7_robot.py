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
# # Sheet 7 - The robot
#
# Write each function, then run the cell below it: it asks your function for many fresh cases and says
# what is right or wrong. A case that fails is printed with its seed, so that you can run it again.
# `judges.hint("largest_gamma", 1)` prints a hint, 2 and 3 print more. Write the functions with NumPy and
# pandas: an answer that calls szlib is refused, unless the task allows it.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 6](sheet6_controller.ipynb) · [to
# do](../exercises/sheet7_robot.ipynb) · [solved](../solutions/sheet7_robot.ipynb) · 1 h 45 min · belongs to
# [08](../08_build_a_controller.ipynb), [09](../09_passing.ipynb), [11](../11_waiting.ipynb),
# [12](../12_among_people.ipynb)

# %%
import judges
import matplotlib.pyplot as plt
import numpy as np

import szlib
from szlib.workbook import figures

# %% [markdown]
# ## 7.1 gamma by experiment (40 min)
#
# With the paper's two barrier steps ($N_h = 2$, 0.2 s) a large gamma lets the robot find out too late
# that it cannot brake any more: the problem has no solution, the step is *infeasible*. For the
# scenario `szlib.SCENARIOS["passing"]`, a `zone` that you have not seen and a robot that brakes with
# `a_max` [m/s2], give the largest of `gammas` (ascending) up to which no run has an infeasible step. A
# run takes some 50 ms, and szlib may be used here. The figure shows $h$ in one run; its axis is linear up to
# 0.5 m and logarithmic above, so that both the approach and the moment near 0 can be seen.

# %%
zone = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
controller = szlib.MPCCBF(zone, settings=szlib.MPCSettings(gamma=0.15, a_max=0.5))
log = szlib.simulate(szlib.SCENARIOS["passing"], controller)
ax = log.table.plot("t", "h_person_0", color=figures.RED, legend=False, figsize=(8, 2.5))
ax.axhline(0, color=figures.GREY, linewidth=1)
ax.set_yscale("symlog", linthresh=0.5)
ax.set(xlabel="time [s]", ylabel="h [m], logarithmic\nabove 0.5 m")
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
# ## 7.2 The terminal proof (15 min)
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
# ## 7.3 Predict, then run (20 min)
#
# Before you run anything: what becomes larger, and what smaller? `prediction` is asked about twelve changes
# of one parameter, from `before` to `after`, and answers "larger" or "smaller" for a `quantity`:
#
# | scenario | change | from, to (or back) | quantity |
# |---|---|---|---|
# | "passing" | "gamma" | about 0.04, 0.1 | "min_h": the smallest h of the run [m] |
# | "passing" | "gamma" | about 0.04, 0.1 | "start": how far from the person avoidance starts [m] |
# | "waiting" | "N_h" | 2, 6 to 8 | "infeasible_steps", at gamma 0.2 |
# | "passing" | "a_max" | about 0.5, 1.2 m/s2 | "infeasible_steps", at gamma 0.15 |
# | "passing" | "approach" | "front", "behind" | "start", as above |
# | "passing" | "width" | shorter semi-axis of the zone, about 0.7, 0.85 m | "path_length" [m] |
#
# The check makes the runs with a zone that is drawn anew. It does not say which prediction is wrong, since
# that would be its answer: look for the reason in chapters 07 and 09 and in notebook 21, or make the runs yourself.


# %%
def prediction(scenario, change, before, after, quantity):
    """Say "larger" or "smaller": what the quantity becomes with this change."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("prediction", prediction)

# %% [markdown]
# ## 7.4 Count the ways (20 min)
#
# `paths`, shape (m, T, 2), are m ways of a robot to its goal [m]. `people`, shape (n, T, 2), is where n people are
# at the same T times; some of them walk. All ways begin and end at the same two places, and at no time is the robot in a
# body. Two ways are the same if they pass each person on the same side, and distinct if they differ at one person at
# least. For somebody who walks, *in front* and *behind* are different sides. How many distinct ways are there?
# (Chapter 12 says how a person can tell the side: by turning with the robot.)


# %%
def count_ways(paths, people):
    """Number of distinct ways among the paths."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("count_ways", count_ways)

# %% [markdown]
# ## 7.5 In your own words (10 min)
#
# You must choose gamma for a robot in a hospital corridor. Which experiments of this sheet help, which do
# not, and what would you have to measure in that corridor first? Write five to eight sentences.

# %% [markdown]
# YOUR ANSWER HERE

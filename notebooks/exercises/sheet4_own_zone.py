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
# # Sheet 4 - A zone of your own
#
# Write each function, then run the cell below it: it asks your function for many fresh cases and says
# what is right or wrong. A case that fails is printed with its seed, so that you can run it again.
# `judges.hint("my_zone", 1)` prints a hint, 2 and 3 print more. Write the functions with NumPy and
# pandas: an answer that calls szlib is refused, unless the task allows it.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 3](sheet3_zones.ipynb) · next: [sheet
# 5](sheet5_barriers.ipynb) · [to do](../exercises/sheet4_own_zone.ipynb) ·
# [solved](../solutions/sheet4_own_zone.ipynb) · 2 h 45 min · belongs to [05](../05_zones.ipynb),
# [07](../07_barriers.ipynb)

# %%
import judges
import numpy as np

import szlib

# %% [markdown]
# ## 4.1 A zone of your own (an evening, 150 min)
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
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("my_zone", my_zone)

# %% [markdown]
# ## 4.2 The speed limit (5 min)
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
# ## 4.3 In your own words (10 min)
#
# Your zone of 4.1 is within 10 cm on synthetic plazas. Name three reasons why it may be farther off in a
# real hall, and for each of them what you would look at in the data to notice it. Say which of the three more
# data would not mend, and how your choice of quantile and of the range of speeds matters. Write five to eight
# sentences.

# %% [markdown]
# YOUR ANSWER HERE

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
# # Sheet 2 - Inside out
#
# Write each function, then run the cell below it: it asks your function for many fresh cases and says
# what is right or wrong. A case that fails is printed with its seed, so that you can run it again.
# `judges.hint("complementary", 1)` prints a hint, 2 and 3 print more. Write the functions with NumPy and
# pandas: an answer that calls szlib is refused, unless the task allows it.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 1](sheet1_tracks.ipynb) · next: [sheet
# 3](sheet3_zones.ipynb) · [to do](../exercises/sheet2_outliers.ipynb) ·
# [solved](../solutions/sheet2_outliers.ipynb) · 1 h 05 min · belongs to [03](../03_outliers.ipynb)

# %%
import judges
import matplotlib.pyplot as plt
import numpy as np

from szlib.workbook import figures

# %% [markdown]
# ## 2.1 Complementary coordinates (5 min)
#
# Line-of-sight angles [rad] and distances [m] of samples, both of shape (n,). Give the points $(x',
# y')$ whose direction is the same, but whose distance from the origin is the complementary one, $r' =
# r_{max} - r$: shape (n, 2).


# %%
def complementary(los_angle, distance, r_max):
    """Points (x', y') [m], shape (n, 2)."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("complementary", complementary)

# %% [markdown]
# ## 2.2 The nearest approach (10 min)
#
# `samples` is a table as `szlib.find_encounters` gives it: columns `encounter` (its number),
# `los_angle`, `distance`. How near did the two people of each encounter come? One number for each, in
# the order of their numbers.


# %%
def nearest(samples):
    """The least distance of each encounter [m], by number of the encounter."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("nearest", nearest)

# %% [markdown]
# ## 2.3 Who is found (10 min)
#
# On the plaza it is known which samples are of intruders. `removed` says which samples a rule took
# away, `intruder` which it should have; both are booleans of shape (n,). Give *precision*, the share
# of intruders in what was removed, and *recall*, the share of the intruders that was removed.


# %%
def found(removed, intruder):
    """Precision and recall, two shares."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("found", found)

# %% [markdown]
# ## 2.4 LOF's blind spot (30 min)
#
# The local outlier factor compares how dense the data is around a sample with how dense it is around
# the sample's 20 nearest neighbours. `cloud` holds other people's samples, shape (600, 2). Give the
# 31 samples of one encounter, shape (31, 2), all of them 0.3 m or more from everybody in the cloud
# and no two the same, of which LOF with a quota of 1 % takes away *none*.


# %%
def blind_spot(cloud):
    """31 samples (31, 2) [m], far from the cloud, that LOF does not find."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("blind_spot", blind_spot)

# %%
direction, reach = np.random.default_rng(0).uniform([-np.pi, 0], [np.pi, 1], (600, 2)).T
cloud = np.sqrt(reach)[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
ax = figures.get_axes(None, size=(5, 4.5))
ax.plot(*cloud.T, ".", color=figures.GREY, markersize=3, label="everybody else")
try:
    ax.plot(*blind_spot(cloud).T, "x", color=figures.RED, markersize=4, label="your intruder")
except NotImplementedError:
    print("your intruder appears here once blind_spot is written")
figures.label_metres(ax, "Far from everybody, and in dense company")
figures.add_shared_legend([ax])
ax.set(xlabel="x' [m]", ylabel="y' [m]")
plt.show()

# %% [markdown]
# ## 2.5 In your own words (10 min)
#
# LOF removes the samples that lie apart from their neighbours. Explain to somebody who has never heard of
# LOF why it does not find the intruder of 2.4, and what you would remove instead. What may your rule do
# wrong? Compare the precision or the recall of the two rules. Write five to eight sentences.

# %% [markdown]
# YOUR ANSWER HERE

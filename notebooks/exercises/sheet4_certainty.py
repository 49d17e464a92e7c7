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
# # Sheet 4 - How sure?
#
# Write each function, then run the cell below it: it asks your function for many fresh cases and says
# what is right or wrong. A case that fails is printed with its seed, so that you can run it again.
# `judges.hint("p_value", 1)` prints a hint, 2 and 3 print more. Write the functions with NumPy and
# pandas: an answer that calls szlib is refused, unless the task allows it.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [sheet 3](sheet3_zones.ipynb) · next: [sheet
# 5](sheet5_barriers.ipynb) · [to do](../exercises/sheet4_certainty.ipynb) ·
# [solved](../solutions/sheet4_certainty.ipynb) · 1 h 00 min · belongs to [04](../04_hull.ipynb),
# [05](../05_zones.ipynb), [06](../06_respect.ipynb)

# %%
import judges
import matplotlib.pyplot as plt
import numpy as np

from szlib.workbook import figures

# %% [markdown]
# ## 4.1 The quantile zone in one direction (10 min)
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
# ## 4.2 Why the hull shrinks (15 min)
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
# ## 4.3 A p-value (10 min)
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
# ## 4.4 The null model (15 min)
#
# The null model keeps each person's path and moves it in time. Samples have times `t` [s], from 0 to
# `period`, and belong to `person` (its number, from 0), both of shape (n,); `shift` says by how much
# each person is moved, one number a person [s], of either sign. Give the new times. Who is moved past
# the end of the recording comes in at its beginning.


# %%
def shifted(t, person, shift, period):
    """New times in [0, period) [s], shape (n,)."""
    # YOUR CODE HERE
    raise NotImplementedError()


# %%
judges.check("shifted", shifted)

# %% [markdown]
# ## 4.5 In your own words (10 min)
#
# The null model of people who ignore each other is rejected with p = 0.01. A newspaper writes that with a
# probability of 99 % people respect each other's zone. Correct the sentence, and say what the number does
# and does not support. Write five to eight sentences.

# %% [markdown]
# YOUR ANSWER HERE

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
# # 3 - Outliers
#
# **Question.** Some people brush past each other, and some tracks are wrong. Which samples say
# nothing about the distance that people keep?
#
# **Expectation.** The *local outlier factor* (LOF, Breunig et al., 2000) compares how dense the
# data is around a sample with how dense it is around its neighbours. But people are sparse
# exactly where they are close to each other, so LOF on plain distances would cut the zone's own
# edge.

# %%
import matplotlib.pyplot as plt
import numpy as np

import szlib
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord, parameters
from szlib.zones import outliers

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
seed = 0
results = "../results"
fraction = 0.002
r_max = 2.0

# %%
record = NotebookRecord("03_outliers", data=data, results=results, seed=seed)
parameters(
    [
        ("r_max", f"{r_max:g} m", PAPER, "sec. 2"),
        (
            "outlier fraction",
            f"{fraction:.1%}",
            PAPER,
            "a quota, not a detection: it removes that share whatever the data",
        ),
        ("neighbours", outliers.NEIGHBOURS, ASSUMED, "scikit-learn's default"),
        ("features", "x', y'", ASSUMED, "speed would need a scale: metres for a difference of 1 m/s"),
    ]
)

# %% [markdown]
# ## Inside out
#
# With the *complementary distance* $r' = r_{max} - r$ the many who keep away gather around the
# origin and the few who come close lie on the rim:
#
# $$(x', y') = (r_{max} - r)\,(\cos\theta_{LOS}, \sin\theta_{LOS})$$

# %%
samples = record.encounters()
close = samples[samples["distance"] <= r_max]
points = outliers.complementary_points(close, r_max=r_max)
print(f"{len(close):,} of {len(samples):,} samples are within {r_max:g} m")

# %%
outlier = outliers.is_outlier(close, fraction=fraction, r_max=r_max)
ax = figures.plot_outliers(points, outlier, r_max=r_max)
record.figure(ax.figure, "outliers")

# %%
inliers = szlib.remove_outliers(samples, fraction=fraction, r_max=r_max)
removed = int(outlier.sum())
record.check("the quota is met", abs(removed - fraction * len(close)) <= 1, f"{removed} of {len(close)}")
record.check("remove_outliers keeps the others", len(inliers) == len(close) - removed)
record.key |= {"close samples": len(close), "outliers": removed}

# %% [markdown]
# ## Why inside out?
#
# The same LOF on the plain positions $r(\cos\theta, \sin\theta)$ takes other samples. Where do
# the two disagree?

# %%
from sklearn.neighbors import LocalOutlierFactor

plain = close["distance"].to_numpy()[:, None] * np.column_stack(
    [np.cos(close["los_angle"]), np.sin(close["los_angle"])]
)
plain_outlier = (
    LocalOutlierFactor(n_neighbors=outliers.NEIGHBOURS, contamination=fraction).fit_predict(plain) == -1
)
fig, both = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained", sharex=True, sharey=True)
for ax, mask, title in zip(both, (outlier, plain_outlier), ("complementary", "plain"), strict=True):
    ax.plot(*plain[~mask].T, ".", color=figures.GREY, markersize=2)
    ax.plot(*plain[mask].T, "x", color=figures.RED, markersize=7, mew=1.8)
    figures.metres(ax, f"LOF on {title} coordinates", person=True)
record.figure(fig, "plain")

# %%
distance = close["distance"].to_numpy()
rim, rim_plain = (distance[outlier] < 1).sum(), (distance[plain_outlier] < 1).sum()
record.claim(
    "complementary coordinates spare the edge (fewer outliers nearer than 1 m)",
    rim < rim_plain,
    f"{rim} of {removed}, plain {rim_plain}",
)

# %% [markdown]
# On the plaza both take the intruders, and both cut a little of the rim; on the real day each
# takes a piece of one streak. The complementary one spends part of its quota at 2 m, where many
# bearings shrink to a point and density changes fast: those samples never touch the hull.

# %% [markdown]
# ## How much does it matter?
#
# The zone is the hull's complement, so a single sample on the rim can move it. Take away none,
# the paper's share, and ten times as much:

# %%
for share in (0.0, fraction, 10 * fraction):
    rest = szlib.remove_outliers(samples, fraction=share, r_max=r_max)
    print(f"{share:5.1%} removed: nearest sample left at {rest['distance'].min():.2f} m")

# %% [markdown]
# **What it means.** LOF with a quota is a convention, not a discovery: it takes 0.2 % whatever
# the data. And an intruder within the dense streak of its own track is not lonely: on a real day
# LOF may leave the nearest samples in.

# %%
record.close()

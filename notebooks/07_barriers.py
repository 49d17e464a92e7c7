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
# # 7 - Barriers
#
# **Question.** How does "stay out of the zone" become something that a controller can obey, ten
# times a second?
#
# **Expectation.** A function $h$ that is zero at the edge, positive outside, and may fall only so
# fast. As long as each step has a solution, a robot that starts outside stays outside, and slows
# down as it comes near.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [06](06_respect.ipynb) · next: [8 - Build the controller
# yourself](08_build_a_controller.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 3, eq. 1-7 · 25
# min · needs [05](05_zones.ipynb) · exercises:
# [5.1-5.5](exercises/sheet5_barriers.ipynb#5.1-Focal-distance-(15-min)),
# [6.1](exercises/sheet6_robot.ipynb#6.1-The-speed-limit-(5-min)) · laboratory: [13](13_laboratory.ipynb)
#
# **Afterwards you can** turn a distance into a condition on the next step, and say what gamma does.
# **Words.** *class K*: of a function, as gamma in the paper's eq. 1: it is 0 at 0 and grows; here it is
# gamma times h.

# %%
import matplotlib.pyplot as plt
import numpy as np

import szlib
from szlib.control import barriers
from szlib.workbook import figures
from szlib.workbook.record import PAPER, TUNED, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05
zone_speed = 1.1  # whose zone the robot keeps [m/s], as in notebook 05

# %%
record = NotebookRecord("07_barriers", globals())
settings = szlib.MPCSettings(gamma=gamma, zone_speed=zone_speed)
parameters(
    [
        ("robot radius", f"{settings.r_robot} m", PAPER, "a cylinder"),
        ("margin eps", f"{settings.eps} m", PAPER, "for the error of the approximate distances"),
        ("zone", f"{zone_speed:g} m/s", PAPER, "1.1 m/s: a little more than the robot's top speed"),
        (
            "gamma",
            settings.gamma,
            TUNED,
            "on the paper's four scenarios; in 2,000 other worlds: notebook 09",
        ),
    ]
)

# %% [markdown]
# ## Distance to a person's zone
#
# An ellipse with centre $(m, n)$ and angle $\theta$ (eq. 6, whose second term lacks the minus
# sign in the paper) has the foci $\mathbf{c}_{a,b} = (m,n) \pm \sqrt{a^2-b^2}\,(\cos\theta,
# \sin\theta)$:
#
# $$\frac{[(x-m)\cos\theta+(y-n)\sin\theta]^2}{a^2} + \frac{[-(x-m)\sin\theta+(y-n)\cos\theta]^2}{b^2} = 1$$
#
# The sum of the distances to its foci is constant on the ellipse (eq. 7), so
#
# $$d(\mathbf{x}) = \tfrac12\left(\|\mathbf{x}-\mathbf{c}_a\| + \|\mathbf{x}-\mathbf{c}_b\|\right)
# - a$$
#
# is zero there, positive outside, smooth, and cheap.

# %%
zone = record.cache.ellipse()
print(
    f"semi-axes {zone.semi_axes[0]:.2f} m and {zone.semi_axes[1]:.2f} m, centre {zone.center[0]:+.2f} m ahead"
)
on_zone = szlib.ellipse_distance(zone.curve(), zone)
off = float(np.abs(on_zone).max())
record.check("d = 0 on the zone", off < 1e-12, off, always=True)

# %%
ax = figures.plot_distance(zone)
record.figure(ax.figure, "ellipse")

# %% [markdown]
# ## Distance to a wall
#
# A segment is a line, trimmed by a disc (Shapiro & Tsukanov, 1999), eq. 3-5, where the paper's
# $\|t\|$ is $|t|$:
#
# $$g = \frac{(x-x_a)(y_b-y_a)-(y-y_a)(x_b-x_a)}{L},\quad
#   t = \frac{(L/2)^2-\|\mathbf{x}-\mathbf{x}_c\|^2}{L},\quad
#   d = \sqrt{g^2 + \left(\tfrac{|t|-t}{2}\right)^2}$$

# %%
wall = (np.array([-1.0, 0.0]), np.array([1.0, 0.0]))
ax = figures.plot_distance(wall)
record.figure(ax.figure, "segment")

# %%
along = np.column_stack([np.linspace(-1, 1, 101), np.zeros(101)])
off = float(np.abs(szlib.segment_distance(along, *wall)).max())
record.check("d = 0 on the segment", off < 1e-12, off, always=True)
beside = szlib.segment_distance(np.array([[0.0, 0.4], [0.5, -0.3]]), *wall)
record.check("beside the segment d is the Euclidean distance", np.allclose(beside, [0.4, 0.3]), always=True)

# %% [markdown]
# ## The discrete barrier condition
#
# $h = d - r_{robot} - \epsilon$, and each step may use up a share $\gamma$ of what is left (eq.
# 1):
#
# $$h(\mathbf{x}_{k+1}) - h(\mathbf{x}_k) \ge -\gamma\, h(\mathbf{x}_k)
#   \quad\Rightarrow\quad h(\mathbf{x}_k) \ge (1-\gamma)^k\, h(\mathbf{x}_0)$$
#
# A robot that drives straight at somebody is thereby given a limit to the speed at which the two
# close in, $v \le \gamma h / \Delta t$: its own speed is that minus theirs, and where they walk
# towards it, it may have to go back.

# %%
fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
t = np.arange(0, 81) * settings.dt
for share, line in zip(sorted({gamma, 0.02, 0.2}), (":", "-", "--"), strict=False):
    h = 2.0 * (1 - share) ** np.arange(81)
    ax.plot(t, h, line, color=figures.BLUE, label=f"gamma = {share:g}")
ax.set(xlabel="time [s]", ylabel="lowest h allowed [m]", title="A smaller gamma brakes earlier")
ax.legend()
record.figure(fig, "gamma")

# %%
h = 1.0
less, more = (barriers.cbf_residual(h - share * gamma * h, h, gamma) for share in (0.6, 1.2))
claim = f"from h = 1 m it may fall by {60 * gamma:.3g} cm in a step, and not by {120 * gamma:.3g} cm"
record.check(claim, less > 0 > more, always=True)
record.key |= {
    "v limit at h = 1 m": settings.gamma * h / settings.dt,
}

# %% [markdown]
# **What it means.** Distance has become a speed limit that tightens as the robot comes near; what
# is left is to find, ten times a second, the best acceleration that obeys it. Both distances are
# approximations: notebook 22 asks where they are too long, and whether the margin is enough.

# %%
record.close()

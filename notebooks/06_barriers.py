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
# # 6 - Barriers
#
# **Question.** How does "stay out of the zone" become something that a controller can obey, ten
# times a second?
#
# **Expectation.** A function $h$ that is zero at the edge, positive outside, and may fall only so
# fast. As long as each step has a solution, a robot that starts outside stays outside, and slows
# down as it comes near.

# %%
import matplotlib.pyplot as plt
import numpy as np

import szlib
from szlib.control import barriers
from szlib.workbook.figures import simulation as scenes
from szlib.workbook.figures import tracks as plotting
from szlib.workbook.record import ASSUMED, MEASURED, PAPER, Page, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
seed = 0
results = "../results"

# %%
page = Page("06_barriers", data=data, results=results, seed=seed)
settings = szlib.MPCSettings()
parameters(
    [
        ("robot radius", f"{settings.r_robot} m", PAPER, "a cylinder"),
        ("margin eps", f"{settings.eps} m", PAPER, "for the error of the approximate distances"),
        ("zone", "1.1 m/s", PAPER, "a little more than the robot's top speed"),
        (
            "gamma",
            settings.gamma,
            MEASURED,
            "in simulation: larger ones have infeasible steps",
        ),
        (
            "slices of the audit",
            "segment of 2 m, the learned zone",
            ASSUMED,
            "walls of a corridor are longer",
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
zone = page.zone().ellipse(1.1)
print(
    f"semi-axes {zone.semi_axes[0]:.2f} m and {zone.semi_axes[1]:.2f} m, centre {zone.center[0]:+.2f} m ahead"
)
on_zone = szlib.ellipse_distance(zone.curve(), zone)
page.check("d = 0 on the zone", np.abs(on_zone).max() < 1e-12, float(np.abs(on_zone).max()))

# %%
ax = scenes.plot_distance(zone)
page.figure(ax.figure, "ellipse")

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
ax = scenes.plot_distance(wall)
page.figure(ax.figure, "segment")

# %%
along = np.column_stack([np.linspace(-1, 1, 101), np.zeros(101)])
page.check("d = 0 on the segment", np.abs(szlib.segment_distance(along, *wall)).max() < 1e-12)
beside = np.array([[0.0, 0.4], [0.5, -0.3]])
page.check("and Euclidean beside it", np.allclose(szlib.segment_distance(beside, *wall), [0.4, 0.3]))

# %% [markdown]
# ## How wrong are they?
#
# Both are approximations. Where one *over*-estimates, the robot comes nearer than it thinks; the
# margin of 5 cm is meant to cover that. What is the true distance where $d = r_{robot} +
# \epsilon$?

# %%
phi = np.linspace(0, 2 * np.pi, 361)
ring = np.column_stack([np.cos(phi), np.sin(phi)])
points = np.array(zone.center) + np.linspace(0, 3, 3001)[:, None, None] * ring
nearest = np.argmin(np.abs(szlib.ellipse_distance(points, zone) - settings.r_robot - settings.eps), axis=0)
edge = points[nearest, np.arange(len(phi))]
true = np.array([np.hypot(*(zone.curve(4001) - point).T).min() for point in edge])
over = szlib.ellipse_distance(edge, zone) - true

# %%
ax = plotting.axes(None, size=(7, 3.5))
ax.plot(np.degrees(phi), 100 * over, color=plotting.BLUE)
ax.axhline(100 * settings.eps, color=plotting.RED, linestyle="--", label="eps")
ax.set(xlabel="direction from the zone's centre [deg]", ylabel="d - Euclidean [cm]", xticks=range(0, 361, 45))
ax.set_title("Beside the person, the focal distance is shorter than the true one")
ax.legend(loc="upper right", bbox_to_anchor=(1.0, 0.9))
page.figure(ax.figure, "audit")
page.claim(
    "eps covers the error around the zone", over.max() <= settings.eps, f"{100 * over.max():.1f} cm at worst"
)

# %% [markdown]
# Around the zone the approximation errs on the safe side. A wall is another matter: on the line
# beyond its end, $d = s + s^2/L$ is *longer* than the true $s$, and the more so the shorter the
# wall.

# %%
for length in (1.0, 2.0, 3.0, 4.0, 8.0, 13.0):
    half = np.array([length / 2, 0.0])
    s = np.linspace(0, 1, 10001)
    d = szlib.segment_distance(half + np.column_stack([s, 0 * s]), -half, half)
    excess = float(np.interp(settings.r_robot + settings.eps, d, d - s))
    page.claim(
        f"eps covers the error at the end of a wall of {length:g} m",
        excess <= settings.eps,
        f"{100 * excess:.1f} cm",
    )

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
for gamma, line in ((0.02, ":"), (0.05, "-"), (0.2, "--")):
    h = 2.0 * (1 - gamma) ** np.arange(81)
    ax.plot(t, h, line, color=plotting.BLUE, label=f"gamma = {gamma}")
ax.set(xlabel="time [s]", ylabel="lowest h allowed [m]", title="A smaller gamma brakes earlier")
ax.legend()
page.figure(fig, "gamma")

# %%
h = 1.0
left = barriers.cbf_residual(h - 0.03, h, settings.gamma)
page.check(
    "falling by 3 cm from h = 1 m is allowed at gamma = 0.05, by 6 cm is not",
    left > 0 > barriers.cbf_residual(h - 0.06, h, settings.gamma),
)
page.key |= {
    "v limit at h = 1 m": settings.gamma * h / settings.dt,
    "worst error [cm]": 100 * float(over.max()),
}

# %% [markdown]
# **What it means.** Distance has become a speed limit that tightens as the robot comes near; what
# is left is to find, ten times a second, the best acceleration that obeys it. Around people the
# margin is ample. But the walls of notebooks 09 and 10 are 3 m long, and at h = 0 the robot could
# touch the end of one (7.5 cm of error, 5 cm of margin): so those notebooks check the Euclidean
# clearance as well.

# %%
page.close()

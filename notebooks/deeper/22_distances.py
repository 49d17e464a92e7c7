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
#   szlib:
#     label: distances
#     paper: sec. 3, eq. 3-7
#     aim: say where the two distances err, and which margin makes up for it.
#     row: '21'
#     needs:
#     - '07'
# ---

# %% [markdown]
# # 22 - The distances, audited
#
# **Question.** The paper's distances to zones and walls are approximate, with a margin of 5 cm. Is it enough?
#
# **Expectation.** A distance that is too long is dangerous: the robot is nearer than it computes. One that is too
# short only costs space. The paper gives the margin "since the approximated distance function contains some errors".

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [21](21_feasibility.ipynb) · next: [23 - Against everything
# else](23_comparison.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 3, eq. 3-7 · 25 min · needs
# [07](../07_barriers.ipynb)
#
# **Afterwards you can** say where the two distances err, and which margin makes up for it.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
lengths = [0.5, 1.0, 3.0, 5.0, 13.0]  # of walls [m]
eccentricities = [0.0, 0.3, 0.5, 0.65, 0.8, 0.9, 0.99]  # of ellipses as long as the learned one

# %% jupyter={"source_hidden": true}
# Imports, and the record of the run
import sys

sys.path.append("..")  # for `studies`
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import Markdown
from studies import distances
from studies.distances import euclidean_to_ellipse

import szlib
from szlib.control import Obstacle
from szlib.simulation.closed_loop import LoopSettings, drive
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord, parameters

record = NotebookRecord("22_distances", globals(), plaza_zone=True)
settings = szlib.MPCSettings()
r, eps = settings.r_robot, settings.eps
parameters(
    [
        ("robot radius r", f"{r} m", PAPER, ""),
        ("margin eps", f"{eps} m", PAPER, "audited here"),
        ("wall lengths", lengths, ASSUMED, "from a pillar to a corridor [m]"),
        ("eccentricities", eccentricities, ASSUMED, "from a circle to a needle"),
    ]
)

# %% jupyter={"source_hidden": true}
# Figure
zone = record.cache.ellipse()
end, start = np.array([(0.5, 0.0), (-0.5, 0.0)])
fig, sides = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
distances.plot_distance_error(zone, r_robot=r, eps=eps, extent=2.1, ax=sides[0])
sides[0].set_title("Around a zone the distance d is never too long")
distances.plot_distance_error([start, end], r_robot=r, eps=eps, extent=1.3, ax=sides[1])
needed = distances.required_margin([start, end], r)
sides[1].set_title(f"At the ends of a wall of 1 m it is {100 * needed:.0f} cm too long")
record.figure(fig, "maps")

# %% [markdown]
# ## An exact reference
#
# Each colour is the paper's distance $d$ minus the Euclidean distance. Red is dangerous: $d$ is too long. On the
# dotted line the robot's disc touches the zone or the wall. The controller keeps the robot's centre outside the
# solid line, where $h = 0$. Where the solid line runs *inside* the dotted one, the disc can touch although
# $h \ge 0$.
#
# The Euclidean distance to a segment is a projection, cut off at its ends. The one to an ellipse has no formula: it is
# found by bisection, with an angle as the unknown (`szlib.control.verification`). Tests compare both with a geometry
# library.
#
# ## Around a zone: never too long
#
# **In numbers.** An ellipse has semi-axes $a$ = 1 m and $b$ = 0.75 m, so its foci are
# $c = \sqrt{a^2 - b^2}$ = 0.66 m from its centre. A point stands 0.5 m beside it, 1.25 m from the centre. Both foci are
# $\sqrt{0.66^2 + 1.25^2}$ = 1.41 m away, so $d = 1.41 - a$ = **0.41 m**: 9 cm too short, and so on the safe side.
#
# **Always.** Let $x$ be a point outside, $p$ the point of the ellipse nearest to it, and $c_1$, $c_2$ the foci. By the
# triangle inequality $\|x-c_i\| \le \|x-p\| + \|p-c_i\|$. The mean over both foci gives
#
# $$d(x) \le \|x-p\| + d(p) = \|x-p\|,$$
#
# since $d(p) = 0$ on the ellipse. So the focal distance never over-estimates, for any eccentricity: a zone needs **no
# margin**. *What do you think happens beside a very long ellipse: does the robot keep more space, or less?*

# %%
points = np.random.default_rng(seed).uniform(-4, 4, (100_000, 2))
exact = euclidean_to_ellipse(points, zone)
error = szlib.ellipse_distance(points, zone) - exact
outside = 100 * error[exact > 0]
print(
    f"Outside the learned zone d is up to {-outside.min():.0f} cm too short, {max(outside.max(), 0):.0f} cm too long."
)

# %% jupyter={"source_hidden": true}
# Checks
most = float(outside.max())
record.check(
    "the focal distance never over-estimates",
    most <= 1e-7,
    f"at most {max(most, 0):.1f} cm too long at {len(outside):,} points",
    always=True,
)
a = zone.semi_axes[0]
rows = {}
for e in eccentricities:
    like = szlib.Ellipse((0.0, 0.0), (a, a * np.sqrt(1 - e**2)))
    rows[f"{e:g}"] = distances.compare_distances(like, r_robot=r, eps=eps)
zones = (100 * pd.DataFrame(rows.values(), index=rows.keys())).rename_axis("eccentricity")
zones.columns = ["smallest gap [cm]", "largest gap [cm]", "margin required [cm]"]
zones.round(1)

# %% [markdown]
# <details><summary>Answer</summary>
#
# More. The gap between the robot's disc and the zone, at $h = 0$, is the margin of 5 cm at the tips of the ellipse. At
# its sides it grows with the eccentricity, up to $\sqrt{(a+r+\epsilon)^2-c^2} - b - r$ (table: the largest gap). The
# approximation costs space beside the person, but no safety.
#
# </details>

# %% jupyter={"source_hidden": true}
# Checks
learned = distances.compare_distances(zone, r_robot=r, eps=eps)
beside = learned.farthest - eps
record.claim(
    "eps covers the error around the learned zone",
    learned.required <= eps,
    f"{100 * learned.required:.1f} cm needed, eps is {100 * eps:.0f} cm",
)
record.check(
    f"the gap left around the learned zone is at least eps, {100 * eps:.0f} cm",
    learned.nearest >= eps - 1e-6,
    f"{100 * learned.nearest:.1f} cm",
    always=True,
)
record.key["room given away beside the zone [cm]"] = 100 * beside
print(f"Beside the learned zone the robot keeps {100 * beside:.1f} cm more than it has to.")

# %% [markdown]
# ## Around a wall: too long at its ends
#
# **In numbers.** The robot ($r$ = 0.5 m) drives straight towards the end of a wall of $L$ = 1 m. When its disc touches
# the end, the true distance of its centre is $s$ = 0.5 m. The paper's distance adds a *trimming term* $s^2/L$ there:
# $d = 0.5 + 0.5^2/1$ = **0.75 m**. With a margin of 5 cm the robot may go on until $d$ = 0.55 m. That is at
# $s$ = 0.39 m: its disc is then 11 cm inside the wall.
#
# *What do you think: does a longer wall need a larger margin, or a smaller one?*
#
# **Always.** At the true distance $s$ straight ahead of an end, $d = s + s^2/L$. The disc touches at $s = r$, and
# nowhere else on the outline at distance $r$ is $d$ longer (proof in `studies.distances`). So the margin must be
#
# $$\epsilon_{required} = \frac{r^2}{L},$$
#
# and 5 cm are enough from $L = r^2/\epsilon$ = 5 m on.


# %%
def distance_ahead(s, length):
    """The paper's distance [m] at the true distance s straight ahead of the end of a wall [m]."""
    return s + s**2 / length


own = distance_ahead(0.5, 1.0)
library = szlib.segment_distance((1.0, 0.0), start, end)  # the wall from (-0.5, 0) to (0.5, 0)
f"by hand {own:.2f} m, szlib {library:.2f} m"

# %% jupyter={"source_hidden": true}
# Figure
fig, ax = plt.subplots(figsize=(8, 3.6), layout="constrained")
length = np.geomspace(0.4, 14, 200)
ax.plot(length, 100 * r**2 / length, color=figures.BLUE, linewidth=2, label="required by a wall: $r^2/L$")
ax.axhline(100 * eps, color=figures.RED, linestyle="--", linewidth=2, label="the paper's eps")
ax.plot(length, 0 * length, color=figures.BLACK, linestyle=":", linewidth=2, label="required by a zone: none")
short = length <= r**2 / eps
ax.fill_between(length, 100 * eps, 100 * r**2 / length, where=short, color=figures.ORANGE, alpha=0.25)
ax.text(0.62, 16, "the disc can touch\nthe end of the wall", fontsize=9)
ax.set(xlabel="length L of the wall [m]", ylabel="margin [cm]", xscale="log", ylim=(-2, 65))
ax.set_xticks([0.5, 1, 2, 5, 10], ["0.5", "1", "2", "5", "10"])
ax.set_title(f"A margin of {100 * eps:.0f} cm is enough for walls of {r**2 / eps:g} m and longer")
ax.legend()
record.figure(fig, "margin")

# %% [markdown]
# <details><summary>Answer</summary>
#
# A smaller one. A wall of 1 m needs 25 cm, one of 5 m needs 5 cm. The table has the gap that the paper's margin leaves
# between the robot's disc and the wall; negative is a collision with $h \ge 0$.
#
# </details>

# %% jupyter={"source_hidden": true}
# Table
walls = {length: distances.compare_distances([(0, 0), (length, 0)], r_robot=r, eps=eps) for length in lengths}
names = [f"{length:g}" for length in walls]
table = (100 * pd.DataFrame(walls.values(), index=names)).rename_axis("wall [m]")
table.columns = ["smallest gap [cm]", "largest gap [cm]", "margin required [cm]"]
table.round(1) + 0.0

# %% jupyter={"source_hidden": true}
# Checks
for length, found in walls.items():
    gap = f"{round(100 * found.nearest, 1) + 0.0} cm left"
    record.claim(f"eps covers the error of a wall of {length:g} m", found.nearest >= -1e-9, gap)
    enough = max(eps, found.required)
    mended = distances.compare_distances([(0, 0), (length, 0)], r_robot=r, eps=enough)
    claim = f"eps = {100 * enough:.1f} cm is enough for a wall of {length:g} m"
    gap = f"{round(100 * mended.nearest, 1) + 0.0} cm left"
    record.check(claim, mended.nearest >= -1e-9, gap, always=True)

# %% [markdown]
# ## The controller with enough margin
#
# `MPCSettings.paper()` keeps the paper's eps around every wall (`margin="paper"`). `MPCSettings()` keeps around each
# wall what it requires, $\max(\epsilon, r^2/L)$ (`margin="required"`). Both are sent to a goal 40 cm ahead of the end
# of a wall of 1 m. The disc of the robot has a radius of 50 cm, so at this goal it overlaps the wall by 10 cm.
#
# *What will each of them do?*

# %%
wall = np.array([[(0.0, -1.0), (0.0, 0.0)]])
start, goal = np.array([-2.0, 3.0, 0.0, 0.0]), np.array([0.0, 0.4])
scenario = szlib.Scenario("end", start, goal, walls=wall, title="To the end of a wall of 1 m")
paper = szlib.MPCCBF(zone, walls=wall, settings=szlib.MPCSettings.paper())
log = drive(scenario, paper, LoopSettings(until_arrival=False))

careful = szlib.MPCCBF(zone, walls=wall, settings=settings)
step = careful.step(start, goal)
print(f"The margin that the wall requires: {distances.required_margin(wall[0], r):.2f} m")
print(next(note for note in step.explain().splitlines() if "goal" in note).strip())

# %% jupyter={"source_hidden": true}
# Figure
past = szlib.Scenario("past", start, np.array([1.0, -3.0]), walls=wall, title="Around the end of a wall")
around = drive(past, careful, LoopSettings(until_arrival=False))
fig, panels = plt.subplots(1, 2, figsize=(10, 4.8), layout="constrained", sharey=True)
nearest = around.clearance.min(axis=1).argmin()
for ax, run, row in zip(panels, (log, around), (-1, nearest), strict=True):
    ax.plot(*wall[0].T, color=figures.BLACK, linewidth=4, solid_capstyle="round", label="wall of 1 m")
    ax.plot(*run.states[:, :2].T, color=figures.BLUE, linewidth=1.5, label="path of the robot")
    ax.add_patch(plt.Circle(run.states[row, :2], r, color=figures.BLUE, alpha=0.35, lw=0, label="robot"))
    ax.plot(*run.scenario.goal, "D", color=figures.ORANGE, mec=figures.BLACK, ls="", label="goal")
    figures.label_metres(ax).set(xlim=(-2.8, 2.2), ylim=(-3.3, 3.3))
gap, free = float(log.clearance.min()), float(around.clearance.min())
panels[0].set_title(f"The paper's margin: the robot is\n{-100 * gap:.0f} cm in the wall, with h >= 0")
panels[1].set_title(f"The required margin: on the way around\nthe wall at least {100 * free:.0f} cm are free")
panels[1].legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
record.figure(fig, "end-of-a-wall")

# %% [markdown]
# <details><summary>Answer</summary>
#
# With the paper's margin the robot drives to the goal and touches the wall, while its own $h$ never becomes negative.
# With the required margin it says that this goal cannot be reached, and would wait beside it. Sent around the wall, it keeps
# clear of its end.
#
# </details>
#
# **A common mistake:** "$h \ge 0$ means that nothing is touched." Only if $h$ is made from a distance that is never
# too long, or if the margin makes up for its error.

# %% jupyter={"source_hidden": true}
# Checks
lowest = 100 * float(log.h.min())
record.check(
    "the paper's barrier is not negative all the way", lowest >= -1e-4, f"least h {lowest + 0.0:.1f} cm"
)
record.claim("the paper's barrier keeps the robot off the wall", gap >= 0, f"{100 * gap:.0f} cm left")
overlaps = log.clearance.min(axis=1) < -1e-6
dishonest = int((log.safe[:-1] & overlaps[1:]).sum())
record.check(
    "no step into an overlap is reported as safe",
    dishonest == 0,
    f"{dishonest} of {int(overlaps.sum())} steps with an overlap",
    always=True,
)
record.check(
    "with the required margin a goal too close to the wall is reported", step.goal_blocked, always=True
)
record.check(
    "on the way around the end of the wall nothing is touched",
    free >= 0,
    f"at least {100 * free:.0f} cm free",
)
record.key["wall of 1 m, paper's eps: gap [cm]"] = 100 * gap

# %% [markdown]
# ## The Euclidean distance itself
#
# The required margin costs space beside short walls. `MPCSettings.among_people()` measures walls by Euclidean distance
# (`margin="euclidean"`): then eps is enough everywhere. Why does `MPCSettings()` not do the same?
#
# **What do you think?** In the paper's scenario *waiting* the robot goes around the corner of a wall into a pathway.
# Each robot has a margin, and barriers on $N_h$ steps. Which of them arrive?

# %%
robots = {
    "required, N_h = 2": {},
    "euclidean, N_h = 2": {"margin": "euclidean"},
    "euclidean, N_h = 3": {"margin": "euclidean", "N_h": 3},
}
waiting, times = szlib.SCENARIOS["waiting"], {}
for name, changes in robots.items():
    robot = szlib.MPCCBF(zone, walls=waiting.walls, settings=szlib.MPCSettings(**changes))
    times[name] = szlib.simulate(waiting, robot).metrics()["time_to_goal"]
pd.Series(times, name="time to the goal [s]").round(1).to_frame()

# %% [markdown]
# <details><summary>Answer</summary>
#
# With the Euclidean distance and $N_h = 2$ the robot stands still beside the corner (NaN). Only two steps of its plan obey the
# barriers. From the third on it drives through the wall.
#
# </details>

# %% jupyter={"source_hidden": true}
# Checks
found = ", ".join(f"{time:.1f} s" for time in times.values())
arrives = [time < np.inf for time in times.values()]
record.check("the Euclidean distance needs N_h = 3", arrives == [True, False, True], found)

# %% [markdown]
# ## An obstacle of your own
#
# A round table in the way is no wall. Twelve short walls around it would be a rough outline. But its distance is known:
# that to its centre, less its radius, which is Euclidean and needs no margin. An obstacle is one class with this distance. The
# controller, its steps and their checks know nothing else of it.


# %%
class Table(Obstacle):
    kind = "table"

    @staticmethod
    def distance(x, y, t, px, py, radius):  # of the point (x, y), t seconds from now [m]
        return ((x - px) ** 2 + (y - py) ** 2) ** 0.5 - radius


table = Table(0.0, 0.1, 0.8)
hall = szlib.Scenario("table", (-3.0, 0.0, 0.0, 0.0), (3.0, 0.0), obstacles=(table,), duration=15.0)
served = drive(hall, szlib.MPCCBF(zone, obstacles=[table]))
numbers = served.metrics()
f"{numbers['outcome']} after {numbers['time_to_goal']:.1f} s, {100 * numbers['min_clearance']:.0f} cm free at least"

# %% jupyter={"source_hidden": true}
# Checks
gap = numbers["min_clearance"]
record.check(
    "an obstacle of one's own is kept off", gap >= eps - 1e-4, f"{100 * gap:.1f} cm free", always=True
)

# %% jupyter={"source_hidden": true}
# What we know now
Markdown(f"""**What we know now.** Around people the approximation errs to the safe side: no margin is needed, and beside
the learned zone the robot keeps {100 * beside:.0f} cm more than it has to. At the ends of walls shorter than
{r**2 / eps:g} m the paper's margin is too small, and our restricted pathway has such walls. The right margin is
$r^2/L$, and `MPCSettings()` keeps it. It costs at most 0.42 r = {42 * r:.0f} cm of space, beside walls as long as the
robot is wide. `among_people()` measures the Euclidean distance, which needs no extra space: each step of its plan has
barriers.""")

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

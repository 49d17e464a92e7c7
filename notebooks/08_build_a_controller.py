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
#     label: build a controller
#     paper: sec. 3-4, eq. 1-2, 8
#     aim: write an MPC-CBF yourself, and say what each of its terms is there for.
#     row: '07'
#     needs:
#     - '07'
#     exercises:
#     - 5.5-5.7
#     - 6.1-6.5
#     - '7.2'
#     week: 4
# ---

# %% [markdown]
# # 8 - Build the controller yourself
#
# **Question.** What does it take to turn the barrier condition of chapter 07 into a robot that drives in the plane?
#
# **Expectation.** A model of the robot, a cost, limits, and one inequality (a *row*) for each barrier and step. The
# result should choose the same accelerations as `szlib.MPCCBF`.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [07](07_barriers.ipynb) · next: [9 - Passing a person who
# stands](09_passing.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 3-4, eq. 1-2, 8 · 45 min ·
# needs [07](07_barriers.ipynb) · exercises:
# [5.5-5.7](exercises/sheet5_barriers.ipynb#5.5-A-filter-on-a-road-(15-min)),
# [6.1-6.5](exercises/sheet6_controller.ipynb#6.1-MPC-on-a-road-(25-min)),
# [7.2](exercises/sheet7_robot.ipynb#7.2-The-terminal-proof-(15-min)) · laboratory:
# [13](13_laboratory.ipynb)
#
# **Afterwards you can** write an MPC-CBF yourself, and say what each of its terms is there for. **Words.**
# *IPOPT*: the solver for nonlinear optimisation that the paper uses; *MPC*: model predictive control: plan
# some steps ahead, take the first, plan again; *priority*: what a plan obeys first if it cannot obey all:
# walls, then bodies, then zones, then decay; *SQP*: sequential quadratic programming: solve quadratic
# problems in a row, each around the last answer.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05
N = 8
N_h = 2
a_max = 1.0  # m/s2

# %% jupyter={"source_hidden": true}
# Set-up, and the figure
from dataclasses import replace

import daqp
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import plots
from IPython.display import Markdown
from scipy.linalg import block_diag
from studies.ipopt import ByIpopt
from studies.lesson_zones import choose_zone

import szlib
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, TUNED, NotebookRecord, parameters

record = NotebookRecord("08_build_a_controller", globals(), plaza_zone=True)
zone = choose_zone(record)
same = {"gamma": gamma, "N": N, "N_h": N_h, "a_max": a_max}
paper = szlib.MPCSettings.paper(**same)
scene = replace(szlib.SCENARIOS["corridor"], start=np.array([-4.0, -0.4, 0, 0]))
log = szlib.simulate(scene, szlib.MPCCBF(zone, walls=scene.walls, settings=paper))
fig = plots.draw_plans(log, (40, 70, 90))
fig.suptitle(f"Ten times a second: the best {N} steps that obey the barriers; the first one is driven")
record.figure(fig, "goal")

# %% jupyter={"source_hidden": true}
# Parameters, with sources
parameters(
    [
        ("dt, top speed", "0.1 s, 1 m/s", PAPER, "sec. 4"),
        ("N, N_h", f"{N}, {N_h}", PAPER, "sec. 4: steps of the plan, and those under the barrier condition"),
        ("gamma", gamma, TUNED, "on these four scenarios: chapter 09"),
        ("a_max", f"{a_max} m/s²", ASSUMED, "the paper gives none"),
        ("Q, R, P", "diag(10, 10, 1, 1), I, 10 Q", ASSUMED, "the paper gives none; its code: below"),
    ]
)

# %% [markdown]
# ## The model: two steps by hand, then all of them at once
#
# The state is $\mathbf x = (x, y, v_x, v_y)$, the input the acceleration $\mathbf u = (a_x, a_y)$. **A number
# first.** The robot stands, accelerates at 1 m/s² for 0.1 s, and then rolls for 0.1 s. Where is it? After the first step
# at 5 mm with 0.1 m/s; rolling adds 10 mm: **15 mm**. As matrices (eq. 8):
#
# $$\mathbf x_{k+1} = A\,\mathbf x_k + B\,\mathbf u_k$$

# %%
dt, v_max = 0.1, 1.0
A = np.eye(4) + dt * np.eye(4, k=2)  # x += dt vx, y += dt vy
B = np.vstack([dt**2 / 2 * np.eye(2), dt * np.eye(2)])
x = np.zeros(4)
for u in ([1.0, 0.0], [0.0, 0.0]):
    x = A @ x + B @ u
    print(f"x = {1000 * x[0]:.0f} mm, v_x = {x[2]:.1f} m/s")

# %% [markdown]
# A plan is a list of $N$ accelerations, $\mathbf z = (\mathbf u_0, \dots, \mathbf u_{N-1})$: 16 numbers for $N = 8$. Insert
# each step into the next. All states are then one matrix times the plan:
#
# $$\mathbf x_k = A^k\,\mathbf x_0 + \sum_{j<k} A^{k-1-j} B\,\mathbf u_j
#   \qquad\text{or}\qquad \mathbf X = F\,\mathbf x_0 + G\,\mathbf z$$
#
# The states are no longer unknowns, only the accelerations are: the problem is *condensed*.

# %%
power = np.linalg.matrix_power
F = np.vstack([power(A, k) for k in range(1, N + 1)])
S = np.zeros((N + 1, 4, N, 2))  # S[k]: what z does to the state k
for k in range(1, N + 1):
    for j in range(k):
        S[k, :, j] = power(A, k - 1 - j) @ B
S = S.reshape(N + 1, 4, 2 * N)
G = S[1:].reshape(4 * N, 2 * N)


def predict(x, z):
    return np.vstack([x, (F @ x + G @ z).reshape(N, 4)])


# %% jupyter={"source_hidden": true}
# Checks
rng = np.random.default_rng(seed)
plan = rng.uniform(-a_max, a_max, 2 * N)
one_by_one = [rng.uniform(-1, 1, 4)]
for u in plan.reshape(N, 2):
    one_by_one.append(A @ one_by_one[-1] + B @ u)
off = float(np.abs(predict(one_by_one[0], plan) - one_by_one).max())
evidence = f"largest difference {off:.0e} m"
record.check("F and G give the states of one step after the other", off < 1e-12, evidence, always=True)

# %% [markdown]
# ## The cost
#
# What is a good plan? One that comes near the goal soon, without large accelerations. With the error $\mathbf e_k =
# \mathbf x_k - \mathbf x_{goal}$ (eq. 2):
#
# $$\mathbf e_N^\top P\,\mathbf e_N + \sum_{k=1}^{N-1}\mathbf e_k^\top Q\,\mathbf e_k
#   + \sum_{k=0}^{N-1} \mathbf u_k^\top R\,\mathbf u_k$$
#
# - $Q$: the price of an error on the way. 1 m costs 10, 1 m/s costs 1, in each step.
# - $P$: the price of the error at the end of the plan, which stands for all that comes later.
# - $R$: the price of an acceleration. 1 m/s² costs 1. Only the ratios of the prices matter.
#
# $\mathbf X$ is linear in $\mathbf z$, so the cost is a parabola in 16 dimensions, $\tfrac12 \mathbf z^\top H\,\mathbf z +
# \mathbf f^\top \mathbf z$ and a constant. Its lowest point solves a linear system of equations, $H\,\mathbf z = -\mathbf f$.


# %%
def make_cost(P=10.0, R=1.0):
    Q = np.diag([10.0, 10.0, 1.0, 1.0])
    weights = block_diag(*[Q] * (N - 1), P * Q)
    H = 2 * (G.T @ weights @ G + R * np.eye(2 * N))
    return H, 2 * G.T @ weights  # f is the second one times the error without a plan


COST = H, K = make_cost()
error = F @ np.zeros(4) - np.tile([8.0, 0.0, 0.0, 0.0], N)
z = -np.linalg.solve(H, K @ error)
print(f"goal 8 m ahead: the best plan begins with {z[0]:.0f} m/s²")

# %% [markdown]
# No robot can do that. It needs limits.
#
# ## The limits, and a quadratic program
#
# Two limits: each acceleration, $|a| \le a_{max}$, and the speed, $v_x^2 + v_y^2 \le v_{max}^2$. A parabola with
# *linear* limits is a quadratic program (QP), as in chapter 07, now with 16 unknowns.


# %%
def solve_qp(H, f, rows, least):
    """The best z with rows @ z >= least and |z| <= a_max, and the price of each row."""
    low = np.r_[np.full(2 * N, -a_max), least]
    high = np.r_[np.full(2 * N, a_max), np.full(len(least), 1e30)]
    z, _, flag, info = daqp.solve(H, f, rows, high, low, np.zeros(len(low), np.intc))
    return (z, info["lam"][2 * N :]) if flag > 0 else (None, None)


# %% [markdown]
# The limit of the speed is a circle, not a straight line. So replace the circle by its tangent at the last plan, solve
# the QP, and repeat with the new plan. Each limit becomes a *value* (positive: obeyed) and a *row*: how the value
# changes with each number of the plan.


# %%
def speed_rows(states):
    v = states[1:, 2:]
    return v_max**2 - (v**2).sum(axis=1), np.einsum("kc,kcz->kz", -2 * v, S[1:, 2:])


# %% [markdown]
# ## The barrier rows
#
# For a person, $h$ comes from the distance of chapter 07 (eq. 6-7). In step $k$ the zone is where the person will be
# then. For a wall, $h$ comes from eq. 3-5.


# %%
def keep_off(person):
    (c, d), a = zone.placed(person.position, person.heading).foci, zone.semi_axes[0]

    def h(p, k):
        p = p - k * dt * np.array(person.velocity)  # as if the person stood
        return (np.hypot(*(p - c)) + np.hypot(*(p - d))) / 2 - a - 0.5 - 0.05

    return h


def keep_off_wall(wall):
    return lambda p, k: float(szlib.segment_distance(p, *wall)) - 0.5 - 0.05


# %% [markdown]
# The condition (eq. 1) for the first $N_h$ steps, as value and row:
#
# $$h(\mathbf x_{k+1}) - (1 - \gamma)\,h(\mathbf x_k) \ge 0, \qquad k = 0, \dots, N_h - 1$$


# %%
def slope(h, p, k, e=1e-6):
    return np.array([(h(p + d, k) - h(p - d, k)) / (2 * e) for d in e * np.eye(2)])


def barrier_rows(h, states, n_h):
    values, rows = [], []
    for k in range(n_h):
        p, q = states[k, :2], states[k + 1, :2]
        values.append(h(q, k + 1) - (1 - gamma) * h(p, k))
        rows.append(slope(h, q, k + 1) @ S[k + 1, :2] - (1 - gamma) * slope(h, p, k) @ S[k, :2])
    return values, np.reshape(rows, (-1, 2 * N))


# %% [markdown]
# ## The controller
#
# Compute the rows around the last plan, solve a QP, and repeat until the plan no longer changes. This is *sequential
# quadratic programming* (SQP). The solver gives a *price* for each row, its multiplier: by how much the cost would fall
# if the row gave way a little. `bend` is the curvature of the circle times this price. Without it the plan would jump
# back and forth along the tangents.


# %%
def decide(x, goal, barriers, z, n_h, cost):
    (H, K), price = cost, np.zeros(N)
    f = K @ (F @ x - np.tile([*goal, 0, 0], N))
    for _ in range(30):
        states = predict(x, z)
        parts = [speed_rows(states), *(barrier_rows(h, states, n_h) for h in barriers)]
        values, rows = (np.concatenate(each) for each in zip(*parts, strict=True))
        bend = 2 * np.einsum("k,kcz,kcw->zw", price, S[1:, 2:], S[1:, 2:])
        new, prices = solve_qp(H + bend, f - bend @ z, rows, rows @ z - values)
        if new is None:
            return None  # no plan obeys all rows
        change, z, price = abs(new - z).max(), new, abs(prices[:N])
        if change < 1e-9:
            break
    return z


# %% [markdown]
# The loop around it is called *receding horizon*: plan $N$ steps, drive the first, plan again. The rest of a plan is
# the first guess for the next one.


# %%
def drive(x, goal, people=(), walls=(), n_h=N_h, steps=140, cost=COST):
    z, run, unsolved = np.zeros(2 * N), [], 0
    for k in range(steps):
        barriers = [keep_off(p.after(k * dt)) for p in people] + [keep_off_wall(w) for w in walls]
        new = decide(x, goal, barriers, z, n_h, cost)
        unsolved += new is None
        z = z if new is None else new  # without a plan, go on with the last one
        run.append(np.r_[x, z])
        x, z = A @ x + B @ z[:2], np.r_[z[2:], z[-2:]]
    run = np.array(run)
    return run[:, :4], run[:, 4:], unsolved


# %% [markdown]
# ## What P and R do
#
# **What do you think?** The goal is 3 m ahead, nothing is in the way. What happens if accelerations become *dearer*,
# that is, cost more ($R$ = 1, 30, 100)? And if the end of the plan costs nothing ($P = 0$)?

# %% jupyter={"source_hidden": true}
# Figure
fig, panels = plt.subplots(1, 2, figsize=(10, 3.4), sharey=True, layout="constrained")
past = {}
for ax, name, values in zip(panels, "RP", ((1, 30, 100), (10, 1, 0)), strict=True):
    for value, line, colour in zip(values, ("-", "--", ":"), figures.pick_colours(values), strict=True):
        states, _, _ = drive(np.zeros(4), (3.0, 0.0), steps=100, cost=make_cost(**{name: value}))
        label = f"R = {value}" if name == "R" else f"P = {value} Q"
        ax.plot(dt * np.arange(100), states[:, 0], line, color=colour, label=label)
        past[label] = 100 * (states[:, 0].max() - 3)
    ax.axhline(3, color=figures.GREY, linewidth=0.8)
    ax.set(xlabel="time [s]", ylabel="x [m]")
    ax.legend(loc="lower right")
panels[0].set_title(f"Dear accelerations: {past['R = 100']:.0f} cm past the goal")
panels[1].set_title(f"A free end: {past['P = 0 Q']:.0f} cm past the goal")
record.figure(fig, "weights")

# %% jupyter={"source_hidden": true}
# Checks, and the answer
record.check(
    "the robot drives past the goal the farther the dearer an acceleration is",
    past["R = 1"] < past["R = 30"] < past["R = 100"],
    ", ".join(f"{label}: {way:.1f} cm" for label, way in past.items() if label[0] == "R"),
)
Markdown(
    "<details><summary>Answer</summary>\n\nIf accelerations cost much, so does braking: the robot brakes late and gently, and "
    f"drives {past['R = 100']:.0f} cm past the goal with R = 100. P makes it slow down for a goal that it reaches only "
    f"after the plan ends; without it the robot drives {past['P = 0 Q']:.0f} cm past.\n\n</details>"
)

# %% [markdown]
# ## What the barrier rows do
#
# **What do you think?** A person stands in the way, 4 m ahead. What does the robot do without barrier rows, with rows for
# one step, and for two steps?

# %% jupyter={"source_hidden": true}
# Figure
standing = szlib.Person((4.0, 0.3), (0.0, 0.0), heading=np.pi)
runs = {n: drive(np.zeros(4), (8.0, 0.0), [standing], n_h=n, steps=110) for n in (0, 1, 2)}
least = {n: min(keep_off(standing)(p, 0) for p in run[0][:, :2]) for n, run in runs.items()}
shake = {n: float(np.abs(np.diff(run[1][:, :2], axis=0)).mean()) for n, run in runs.items()}
fig, (left, right) = plt.subplots(2, 1, figsize=(8, 5.4), layout="constrained", height_ratios=(1.3, 1))
styles = zip((":", "--", "-"), (figures.BLACK, figures.ORANGE, figures.BLUE), strict=True)
for (n, (states, plans, _)), (line, colour) in zip(runs.items(), styles, strict=True):
    left.plot(*states[:, :2].T, line, color=colour, label=f"N_h = {n}: least h {least[n]:.2f} m")
    right.plot(dt * np.arange(110), plans[:, 1], line, color=colour, linewidth=1)
left.fill(*zone.placed((4.0, 0.3), np.pi).curve().T, color=figures.RED, alpha=0.25, label="zone")
left.plot(8, 0, "D", color=figures.BLUE, markeredgecolor=figures.BLACK, linestyle="", label="goal")
figures.label_metres(left, "Without rows: through the zone. Rows for one step: it shakes")
left.legend(loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=8)
right.set(xlabel="time [s]", ylabel="a_y [m/s²]")
record.figure(fig, "rows")

# %% jupyter={"source_hidden": true}
# Checks, and the answer
record.check("plain MPC drives into the zone", least[0] < 0, f"least h {least[0]:.2f} m")
record.check("MPC-CBF does not drive into the zone", least[2] > 0, f"least h {least[2]:.2f} m")
evidence = f"mean change of a in a step: {shake[1]:.2f} and {shake[2]:.2f} m/s²"
record.check("rows for two steps shake less than half as much as for one", shake[2] < shake[1] / 2, evidence)
Markdown(
    "<details><summary>Answer</summary>\n\nThe cost contains no people: without rows the robot drives straight through the zone. "
    "With rows for one step it keeps out, but in one step an acceleration of 1 m/s² moves it by 5 mm only, so it needs large "
    "accelerations to correct its place, and shakes. Two steps are enough to see what an acceleration does to the "
    "*speed* of approach.\n\n</details>"
)

# %% [markdown]
# ## It drives
#
# The paper's corridor: a person comes at 0.5 m/s, and walls are on both sides.

# %%
states, plans, unsolved = drive(scene.start, scene.goal, scene.people, scene.walls)
print(f"steps without a plan: {unsolved} of {len(states)}")

# %% jupyter={"source_hidden": true}
# Figure
fig, panels = plt.subplots(2, 2, figsize=(10, 5.4), layout="constrained", sharex=True, sharey=True)
for ax, k in zip(panels.flat, (20, 40, 70, 90), strict=True):
    plots.draw_moment(ax, log, k, states[k], predict(states[k], plans[k]))
    ax.plot(*log.states[:, :2].T, ":", color=figures.BLACK, label="path of szlib.MPCCBF")
    ax.plot(*states[: k + 1, :2].T, color=figures.BLUE, linewidth=2, label="path of your controller")
    ax.label_outer()
fig.suptitle("Your controller meets a person in a corridor, on the same path as the library's")
handles, labels = panels[0, 0].get_legend_handles_labels()
fig.legend(handles, labels, loc="outside lower center", ncols=4)
record.figure(fig, "corridor")

# %% jupyter={"source_hidden": true}
# Checks
hs = np.array(
    [
        [keep_off(scene.people[0].after(k * dt))(s[:2], 0)]
        + [keep_off_wall(w)(s[:2], 0) for w in scene.walls]
        for k, s in enumerate(states)
    ]
)
record.check("your controller never enters the zone", hs.min() > 0, f"least h {hs.min():.3f} m")
bound = hs[0] * (1 - gamma) ** np.arange(len(hs))[:, None]
what = "h of your controller is always above the bound h0 (1 - gamma)^k"
above = (hs - bound)[1:].min()
record.check(what, above > -1e-9, f"at least {1000 * above:.1f} mm above it")
left = float(np.hypot(*(states[-1, :2] - scene.goal)))
record.check("your controller arrives in 14 s", left < 0.2, f"{left:.2f} m from the goal")

# %% [markdown]
# ## The same as szlib's?
#
# `szlib.MPCCBF` with `MPCSettings.paper()` computes its control in seven states of this run by its SQP. IPOPT, the paper's
# solver, does the same (`studies/ipopt.py`). The SQP stops when it expects that more iterations change the acceleration by
# less than 1e-4 m/s². IPOPT stops a little inside the limits.

# %% jupyter={"source_hidden": true}
# Checks
rows = []
for k in range(0, 140, 20):
    for solver, make in {"sqp": szlib.MPCCBF, "ipopt": ByIpopt}.items():
        controller = make(zone, walls=scene.walls, settings=paper)
        step = controller.step(states[k], scene.goal, [scene.people[0].after(k * dt)])
        rows.append((k * dt, solver, np.abs(step.control - plans[k, :2]).max()))
differences = pd.DataFrame(rows, columns=["t [s]", "solver", "largest difference [m/s²]"])
table = differences.pivot(index="t [s]", columns="solver", values="largest difference [m/s²]")
for solver, worst in table.max().items():
    what = f"{solver} gives the same velocity after the step, to 1e-5 m/s"
    record.check(what, dt * worst < 1e-5, f"{dt * worst:.0e} m/s apart")
what = "IPOPT gives the same acceleration, to 1e-4 m/s²"
record.check(what, table["ipopt"].max() < 1e-4, f"{table['ipopt'].max():.0e} m/s² apart")
record.key["largest difference of an acceleration [m/s²]"] = float(table.to_numpy().max())

# %% [markdown]
# ## Theory: one plan, or several?
#
# **The QP has at most one solution.** $H = 2\,(G^\top \bar Q\, G + \bar R)$ is positive definite, because $R$ is. ($\bar Q$ and
# $\bar R$ repeat $Q$, $P$ and $R$ for each step.) The cost is a bowl: it has one lowest point, also inside linear limits.
#
# **The problem has several.** The outside of a zone is not convex: there are plans on the left and on the right of the
# person. SQP finds the best one near its first guess, the last plan. `MPCSettings()` adds the *rule of the side*
# (chapter 09); the paper has no such rule.
#
# **A plan need not exist** (chapter 07). Your robot then goes on with its last plan. The library takes a plan that violates
# the rows as little as possible, by their priorities (below), and flags the step (notebook 21).

# %% [markdown]
# **A wish and a duty.** A *control Lyapunov function* $V$ is for goals what $h$ is for people: $V$ is 0 at the goal, positive
# elsewhere, and some input makes it fall, $\dot V \le -c\,V$. A *CLF-CBF-QP* (Ames et al., 2017) takes both, and lets the
# goal give way, by $\delta$:
#
# $$\min_{v,\,\delta}\ v^2 + p\,\delta^2 \quad\text{subject to}\quad \dot V \le -c\,V + \delta, \qquad \dot h \ge -\alpha\,h .$$
#
# The robot is $e = 2$ m away from its goal, $V = e^2$, and a zone begins $h$ in front of it. With $c = 1$/s and $\alpha = 0.5$/s:


# %%
def choose_speed(e, h, c=1.0, alpha=0.5, price=10.0):
    """The speed of the CLF-CBF-QP on a road, and by how much the goal gives way."""
    v = price * 2 * e * c * e**2 / (1 + price * (2 * e) ** 2)  # the best one without the barrier
    v = min(v, alpha * h)
    return v, max(0.0, c * e**2 - 2 * e * v)


for room in (4.0, 0.5, 0.0):
    print(
        "h = {:g} m: v = {:.2f} m/s, the goal gives way by {:.2f} m²/s".format(room, *choose_speed(2.0, room))
    )

# %% [markdown]
# **Exercise.** A person stands exactly between the robot and its goal. Where does this robot end, in the plane as well?
# <details><summary>Answer</summary>At $h = 0$, in front of the person: $V$ could fall only through the zone, and no one-step condition
# looks around it. Such a stop is an *undesired equilibrium* of the CLF-CBF-QP (Reis et al., 2021). A plan that reaches
# past the person has a way around, which costs less than to stand.</details>
#
# **Recursive feasibility.** If there is a plan now, is there one in the next step? Let the whole plan obey the rows ($N_h = N$)
# and end *at rest*, $\mathbf v_N = 0$, among people who stand. Then yes. How long must such a plan be?

# %%
for brake in (1.0, 0.5):
    print(
        f"from {v_max:g} m/s with {brake:g} m/s²: at least {np.ceil(v_max / brake / dt):.0f} steps to stand"
    )

# %% [markdown]
# So with our bound of 1 m/s² (the paper gives none) $N = 8$ cannot end at rest at 1 m/s: there is no such guarantee (notebook 21 counts what that costs).
#
# **Proof 2, on paper.** Show: if the plan $(\mathbf u_0, \dots, \mathbf u_{N-1})$ obeys all limits and rows, and ends at rest, then
# so does $(\mathbf u_1, \dots, \mathbf u_{N-1}, \mathbf 0)$ one step later. Where do you need that people stand, that $h \ge 0$, and that $\gamma \le 1$?
# <details><summary>Model solution</summary>The first step of the old plan is driven, so the new plan passes through the old states
# $\mathbf x_1, \dots, \mathbf x_N$, with old inputs: their limits of speed and acceleration hold. People stand, so $h$ of each of these places is
# what it was, and the rows between them hold. One step is new: $\mathbf u = \mathbf 0$ from $\mathbf x_N$, where $\mathbf v_N = 0$. The robot stays,
# $\mathbf x_{N+1} = \mathbf x_N$, at rest again. Its row is $h(\mathbf x_{N+1}) = h(\mathbf x_N) \ge (1 - \gamma)\,h(\mathbf x_N)$, which holds for $h \ge 0$
# and $0 \le \gamma \le 1$; and $h(\mathbf x_N) \ge (1-\gamma)^N h(\mathbf x_0) \ge 0$ follows from the rows. If people walk, $h(\mathbf x_N)$ changes while the
# robot stands, and the last step fails.</details>
#
# **Prices or priorities.** A row that gives way by $s \ge 0$ costs $p\,s$. Is $s = 0$ wherever $s = 0$ is possible? A robot that would
# like 1 m/s, $\min (v - 1)^2 + p\,s$, has the limit $v \le 0.25 + s$:


# %%
def violate(price, wish=1.0, limit=0.25):
    v = max(limit, min(wish, wish - price / 2))  # where the slope of the cost is the price
    return v - min(v, limit)


for price in (0.5, 1.4, 1.6):
    print(f"price {price:g}: the row gives way by {violate(price):.2f} m/s")

# %% [markdown]
# From $p = 2\,(1 - 0.25) = 1.5$ on it does not give way. This is the multiplier of the row, its *price* above. A penalty $p\,s$
# with a larger $p$ is **exact**; $p\,s^2$ never is. But multipliers differ from step to step, so a fixed $p$ is too small some
# time, and a huge one spoils the numbers. The library therefore has **priorities**: it first makes the violation of walls as small as
# possible, then that of bodies, then of zones, then of eq. 1, and only then the cost.
#
# **Exercise.** Why is $p\,s^2$ never exact?
# <details><summary>Answer</summary>At $s = 0$ its slope is 0: to give way a little is free, but it gains at the rate of the
# multiplier. So it gives way by about multiplier / 2p, however large $p$ is.</details>

# %% jupyter={"source_hidden": true}
# Checks
grid = np.linspace(0, 1, 100_001)
cheapest = [grid[np.argmin((grid - 1) ** 2 + p * np.maximum(0, grid - 0.25))] - 0.25 for p in (0.5, 1.4, 1.6)]
off = max(abs(violate(p) - best) for p, best in zip((0.5, 1.4, 1.6), cheapest, strict=True))
is_exact = violate(1.4) > 0 == violate(1.6)
record.check(
    "a price above the multiplier is exact", is_exact and off < 1e-4, f"{off:.0e} m/s off", always=True
)
wishes = [(v := choose_speed(2.0, room)[0]) <= 0.5 * room + 1e-9 and v >= 0 for room in (4.0, 0.5, 0.0)]
record.check("the goal gives way, the barrier does not", all(wishes), wishes, always=True)

# %% [markdown]
# ## Try it: how far ahead the barrier looks
#
# Nothing has to be installed for this: the runs are recorded in the page. Choose, press *play*, step, or move the time
# line. The green area holds all accelerations that the robot may choose then, and the sentence says why it chose this one.
#
# **What do you think?** A person comes at 0.8 m/s. gamma grows from 0.05 to 0.8. How many steps ahead ($N_h$) must the robot look so that h does not become negative? Write it
# down, then look.

# %% jupyter={"source_hidden": true}
# The recorded laboratory
from laboratory import PRESETS, Axis, Recording, RobotOptions, World


def look_ahead(gamma, n_h):
    scene = replace(PRESETS["passing"], people=(szlib.Person((4.0, 0.3), (-0.8, 0.0)),))
    return World(scene, zone, [RobotOptions(changes={"gamma": gamma, "N_h": n_h})])


axes = [Axis("gamma", "gamma", (0.05, 0.2, 0.8), 1), Axis("n_h", "N_h [steps]", (1, 2, 8))]
recording = Recording("A person comes, with a barrier on some steps", look_ahead, axes, longest=14.0)
recording

# %% [markdown]
# With a kernel, the next line opens the live laboratory on the same scene: there you drag the person.

# %%
recording.open_live()

# %% jupyter={"source_hidden": true}
# The answer
low = {(row["gamma"], row["n_h"]): row["least_h"] for row in recording.table}
need = {g: [n for n in (1, 2, 8) if low[g, n] >= 0] for g in (0.05, 0.2, 0.8)}
fewest = "; ".join(f"{n[0] if n else 'none'} with gamma = {g:g}" for g, n in need.items())
Markdown(
    f"<details><summary>Answer</summary>\n\nThe fewest of 1, 2 and 8 steps that keep h >= 0: {fewest}. The least h, with $N_h$ = 1, 2 and 8, is "
    + "; ".join(
        f"{', '.join(f'{low[g, n]:.2f}' for n in (1, 2, 8))} m with gamma = {g:g}" for g in (0.05, 0.2, 0.8)
    )
    + ". A large gamma lets the robot come near at full speed, so it must look farther. With the others one step is enough here, because "
    "the robot can turn aside; in chapter 07 it could only brake.\n\n</details>"
)


# %% [markdown]
# ## The paper's eq. 2 next to ours
#
# - *The errors.* The paper writes $\mathbf x_k^\top Q\,\mathbf x_k$; here it is $\mathbf e_k$. With $\mathbf x_k$ every
#   robot would drive to the origin.
# - *The sum over $\mathbf u$* begins at $k = 1$ there and at $k = 0$ here: $\mathbf u_0$ is the one that is applied.
# - *The limits.* The paper's "maximum speed 1 m/s" is the Euclidean speed here. It gives no limit of $\mathbf u$.
# - *$\Delta h$* is computed with the zone where it will be in that step: the paper's robot knows the person's velocity
#   (sec. 4).
#
# *The weights.* The paper gives none. It uses the public code of Zeng, Zhang and Sreenath (2021), which has $Q = 10\,I$,
# $R = I$, $P = 100\,I$ and gamma = 0.4: there a velocity costs ten times as much as here.
# **What do you think?** With these weights, and our gamma, is the robot sooner at its goal, or later?

# %%
code = szlib.MPCSettings.paper(gamma=gamma, Q=(10,) * 4, R=(1,) * 2, P=(100,) * 4)
for name, scene in szlib.SCENARIOS.items():
    runs = [
        szlib.simulate(scene, szlib.MPCCBF(zone, walls=scene.walls, settings=each))
        for each in (szlib.MPCSettings.paper(gamma=gamma), code)
    ]
    ours, theirs = (run.metrics()["time_to_goal"] for run in runs)
    print(f"{name}: {ours:.1f} s with our weights, {theirs:.1f} s with those of the code")

# %% [markdown]
# <details><summary>Answer</summary>
#
# Later: a dear velocity makes the robot slow. Which claims of the paper depend on these numbers? See notebook
# [28](deeper/28_sentences.ipynb).
#
# </details>
#
# ## Three common mistakes
#
# - **"A limit of 1 m/s on $v_x$ and on $v_y$ is a limit of the speed."** No. On a diagonal the robot drives 1.41 m/s.
# - **"The plan is what the robot will do."** No. Only its first step is driven. Beyond $N_h$ the plan may lead through a
#   person.
# - **"A longer plan is always safer."** No. Only if it has more barrier rows, too: $N_h$ counts, not $N$.

# %% jupyter={"source_hidden": true}
# What we know now
Markdown(
    f"**What we know now.** The method is a page of code: {2 * N} unknowns, a cost, {N} rows for the speed, and "
    f"{N_h} rows for each person and wall. In the corridor your controller kept h >= {hs.min():.2f} m, and gave the same velocity as "
    f"`szlib.MPCCBF`, to {dt * float(table.to_numpy().max()):.0e} m/s. The library is faster, and it has an answer where no plan obeys "
    "all rows. Next, the controller meets a person who stands in its way: chapter 09."
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

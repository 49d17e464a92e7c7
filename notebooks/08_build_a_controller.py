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
# # 8 - Build the controller yourself
#
# **Question.** What does it take to turn the barrier condition of notebook 07 into a robot that drives?
#
# **Expectation.** Four stages: a speed limit, a filter for a robot with inertia (CBF-QP), a controller that
# plans (MPC), and both together (MPC-CBF). The last one is the controller of the paper, and must decide the
# same as `szlib.MPCCBF`.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [07](07_barriers.ipynb) · next: [9 - Passing a person who
# stands](09_passing.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 3-4, eq. 1-2, 8 · 50 min ·
# needs [07](07_barriers.ipynb) · exercises:
# [7.1-7.8](exercises/sheet7_controller.ipynb#7.1-A-filter-on-a-road-(15-min)) · laboratory:
# [13](13_laboratory.ipynb)
#
# **Afterwards you can** write an MPC-CBF yourself, and say what each of its terms is there for. **Words.**
# *IPOPT*: the solver for nonlinear optimisation that the paper uses; *MPC*: model predictive control: plan
# some steps ahead, take the first, plan again; *slack*: by how much a row is violated; *SQP*: sequential
# quadratic programming: solve quadratic problems in a row, each around the last answer.

# %%
import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import szlib
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, TUNED, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05
N = 8
N_h = 2
a_max = 1.0  # m/s2

# %%
record = NotebookRecord("08_build_a_controller", globals())
parameters(
    [
        ("dt, top speed", "0.1 s, 1 m/s", PAPER, "sec. 4"),
        ("N, N_h", f"{N}, {N_h}", PAPER, "sec. 4: steps of the plan, and those under the barrier condition"),
        ("gamma", gamma, TUNED, "on these four scenarios: notebook 09"),
        ("a_max", f"{a_max} m/s²", ASSUMED, "the paper gives none"),
        ("Q, R, P", "diag(10, 10, 1, 1), I, 10 Q", ASSUMED, "the paper gives none"),
    ]
)

# %% [markdown]
# ## 1. A point that obeys at once
#
# A point on a line, at $x$, may choose its velocity $v$. A zone begins at $x = 4$ m, so the barrier is
# $h(x) = 4 - x$. The condition (eq. 1) is $h(x_{k+1}) - h(x_k) \ge -\gamma\,h(x_k)$, and here
# $h(x_{k+1}) - h(x_k) = -v\,\Delta t$, so it is nothing but a speed limit: $v \le \gamma\,h / \Delta t$.

# %%
dt, v_max, edge = 0.1, 1.0, 4.0
x, xs = 0.0, []
for _ in range(120):
    xs.append(x)
    x += dt * min(v_max, gamma * (edge - x) / dt)

# %% [markdown]
# What stands on the right of the condition, $\alpha(h) = \gamma h$, is called a **class K function**: it is 0
# at 0 and grows with $h$. So far away it allows much, at the edge nothing, and $h$ can fall no faster
# than $h_0 (1-\gamma)^k$: it never reaches 0.

# %%
fig, ax = plt.subplots(figsize=(7, 3.2), layout="constrained")
t = dt * np.arange(120)
ax.plot(t, edge - np.array(xs), color=figures.BLUE, label="h of the point")
ax.plot(
    t, edge * (1 - gamma) ** np.arange(120), ":", color=figures.BLACK, label="h₀ (1 - γ)ᵏ, the least allowed"
)
ax.set(xlabel="time [s]", ylabel="h [m]", title="Full speed, then slower with what is left")
ax.legend()
record.figure(fig, "point")

# %%
h = edge - np.array(xs)
record.check("the point never enters the zone", h.min() > 0, h.min())
record.check(
    "h of the point is always above the bound", (h >= edge * (1 - gamma) ** np.arange(120) - 1e-12).all()
)

# %% [markdown]
# ## 2. A point with mass: the CBF-QP
#
# A robot cannot choose its velocity, only its acceleration $a$, $|a| \le a_{max}$:
#
# $$x_{k+1} = x_k + \Delta t\, v_k + \tfrac12 \Delta t^2 a_k, \qquad v_{k+1} = v_k + \Delta t\, a_k .$$
#
# Let something simple say what it wants, here "reach 1 m/s", and let a *filter* change that as little as the
# condition demands: at each step a quadratic program (QP) with one unknown.

# %%
a, state, wanted = ca.SX.sym("a"), ca.SX.sym("state", 2), ca.SX.sym("wanted")
ahead = state[0] + dt * state[1] + dt**2 / 2 * a
row = (edge - ahead) - (1 - gamma) * (edge - state[0])
program = {"x": a, "p": ca.vertcat(state, wanted), "f": (a - wanted) ** 2, "g": row}
qp = ca.qpsol("qp", "qrqp", program, {"print_iter": False, "print_header": False, "error_on_fail": False})


# %%
def cbf_qp(x, v):
    wish = np.clip((v_max - v) / dt, -a_max, a_max)
    answer = qp(p=[x, v, wish], lbx=-a_max, ubx=a_max, lbg=0)
    return float(answer["x"]) if qp.stats()["success"] else -a_max


# %% [markdown]
# Where the program has no solution the robot brakes fully, and that is to be seen, not hidden.


# %%
def drive(decide, steps=120):
    x, v, rows = 0.0, 0.0, []
    for _ in range(steps):
        a = decide(x, v)
        rows.append((x, v, a))
        x, v = x + dt * v + dt**2 / 2 * a, v + dt * a
    return np.array(rows).T


# %%
filtered = drive(cbf_qp)
swings = float(np.abs(np.diff(filtered[2][-60:])).mean())
print(
    f"least h {edge - filtered[0].max():.3f} m; a changes by {swings:.2f} m/s² from step to step at the end"
)

# %% [markdown]
# The filter keeps the condition and drives badly. It looks one step ahead, in which an acceleration of 1
# m/s² moves the robot by 5 mm: to correct its place it has to shake. It needs to look farther.
#
# ## 3. A plan: MPC
#
# Model predictive control plans $N$ accelerations at once, applies the first, and plans again from where it
# then is: the **receding horizon**. What is a good plan is said by a cost on the error to the goal, $\mathbf
# e_k = \mathbf x_k - \mathbf x_{goal}$:
#
# $$\mathbf e_N^\top P\,\mathbf e_N + \sum_{k=1}^{N-1}\mathbf e_k^\top Q\,\mathbf e_k
#   + \sum_{k=0}^{N-1} u_k^\top R\,u_k .$$
#
# $Q$ pulls on the way, $P$ at the end of the plan (standing for all that comes later), and $R$ makes
# accelerations dear. Only their ratios matter.


# %%
def plan_in_1d(P, Q, R, rows):
    opti = ca.Opti()
    x, u, start = opti.variable(2, N + 1), opti.variable(1, N), opti.parameter(2)
    opti.subject_to(x[:, 0] == start)
    opti.subject_to(x[0, 1:] == x[0, :-1] + dt * x[1, :-1] + dt**2 / 2 * u)
    opti.subject_to(x[1, 1:] == x[1, :-1] + dt * u)
    opti.subject_to(opti.bounded(-a_max, u, a_max))
    opti.subject_to(opti.bounded(-v_max, x[1, 1:], v_max))
    for k in range(rows):
        opti.subject_to((edge - x[0, k + 1]) >= (1 - gamma) * (edge - x[0, k]))
    e = x - ca.DM([5.0, 0.0])
    opti.minimize(P * e[0, N] ** 2 + Q * ca.sumsqr(e[0, 1:N]) + R * ca.sumsqr(u))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    plan = opti.to_function("plan", [start], [x, u])
    return lambda *now: plan(now)


# %% [markdown]
# The goal is 1 m inside the zone, at 5 m, so something must stop the robot. `rows` says how many steps obey
# the barrier: 0 is plain MPC, `N_h` is MPC-CBF.

# %%
mpc, mpc_cbf = plan_in_1d(100, 10, 1, rows=0), plan_in_1d(100, 10, 1, rows=N_h)
plain = drive(lambda x, v: float(mpc(x, v)[1][0]))
planned = drive(lambda x, v: float(mpc_cbf(x, v)[1][0]))

# %%
fig, (left, right) = plt.subplots(1, 2, figsize=(11, 3.6), layout="constrained")
runs = {"CBF-QP": (filtered, "--"), "MPC": (plain, ":"), "MPC-CBF": (planned, "-")}
for (name, run), colour in zip(runs.items(), (figures.ORANGE, figures.BLACK, figures.BLUE), strict=True):
    left.plot(t, run[0][0], run[1], color=colour, label=name)
    right.plot(t, run[0][2], run[1], color=colour, label=name, linewidth=1)
left.axhspan(edge, 5.2, color=figures.RED, alpha=0.2, label="zone")
left.set(xlabel="time [s]", ylabel="x [m]", title="Where they come to")
right.set(xlabel="time [s]", ylabel="a [m/s²]", title="What it costs")
left.legend()
record.figure(fig, "stages")

# %%
inside = {name: float(edge - run[0][0].max()) for name, run in runs.items()}
record.check("plain MPC drives into the zone", inside["MPC"] < 0, inside["MPC"])
record.check("MPC-CBF does not drive into the zone", inside["MPC-CBF"] > -1e-6, inside["MPC-CBF"])
calm = float(np.abs(np.diff(planned[2][-60:])).mean())
record.check("MPC-CBF hardly shakes at the end", calm < 0.1 * swings, calm)

# %% [markdown]
# The receding horizon in a picture: each thin line is one plan, of which only the first step was driven.
# Only the first `N_h` steps of a plan obey the barrier; the rest runs ahead, and is never driven.

# %%
fig, ax = plt.subplots(figsize=(7, 3.4), layout="constrained")
for k in range(0, 80, 6):
    path = np.array(mpc_cbf(planned[0][k], planned[1][k])[0])[0]
    ax.plot(dt * (k + np.arange(N + 1)), path, ".-", color=figures.GREEN, markersize=3, linewidth=0.8)
ax.plot(t[:90], planned[0][:90], color=figures.BLUE, linewidth=2, label="driven")
ax.plot([], [], ".-", color=figures.GREEN, label="planned")
ax.axhspan(edge, edge + 0.6, color=figures.RED, alpha=0.2, label="zone")
ax.set(xlabel="time [s]", ylabel="x [m]", title="Plan N steps, drive one, plan again")
ax.legend(loc="lower right")
record.figure(fig, "receding")

# %% [markdown]
# What $R$ and $P$ do: the same robot, with no zone in its way. What is dear is done less; and as the plan
# ends after `N` steps, it is $P$ that tells it to slow down for a goal that it only reaches later.

# %%
fig, panels = plt.subplots(1, 2, figsize=(11, 3.4), sharey=True, layout="constrained")
for ax, name, values in zip(panels, "RP", ((1, 30, 100), (100, 10, 0)), strict=True):
    for value, line in zip(values, ("-", "--", ":"), strict=True):
        run = plain  # P = 100, R = 1: driven above
        if value != values[0]:
            decide = plan_in_1d(**{"P": 100, "Q": 10, "R": 1, "rows": 0} | {name: value})
            run = drive(lambda x, v, decide=decide: float(decide(x, v)[1][0]))
        ax.plot(t, run[0], line, color=figures.BLUE, label=f"{name} = {value}")
    ax.axhline(5, color=figures.GREY, linewidth=0.8)
    ax.set(xlabel="time [s]", ylabel="x [m]", title=f"The weight {name}")
    ax.legend(loc="lower right")
record.figure(fig, "weights")

# %% [markdown]
# ## 4. The plane: MPC-CBF
#
# Now the robot of the paper (eq. 8): the state is $(x, y, v_x, v_y)$, the input $(a_x, a_y)$. The scene is
# the paper's corridor; what changes from step to step - the state, the person's foci and velocity - are
# parameters of the program, which is written down once.

# %%
zone = record.cache.ellipse()
scene = szlib.SCENARIOS["corridor"]
opti = ca.Opti()
x, u = opti.variable(4, N + 1), opti.variable(2, N)
x0, foci, w = opti.parameter(4), opti.parameter(2, 2), opti.parameter(2)

# %% [markdown]
# **Motion** (eq. 8), from the present state.

# %%
A = ca.DM([[1, 0, dt, 0], [0, 1, 0, dt], [0, 0, 1, 0], [0, 0, 0, 1]])
B = ca.DM([[dt**2 / 2, 0], [0, dt**2 / 2], [dt, 0], [0, dt]])
opti.subject_to(x[:, 0] == x0)
opti.subject_to(x[:, 1:] == A @ x[:, :-1] + B @ u)

# %% [markdown]
# **Limits**: each acceleration, and the Euclidean speed. The paper says only "maximum speed 1 m/s"; that it is the
# Euclidean speed is ours. A limit on each component of the velocity would let the robot drive 1.41 m/s on a
# diagonal.

# %%
opti.subject_to(opti.bounded(-a_max, ca.vec(u), a_max))
opti.subject_to(ca.sum1(x[2:, 1:] ** 2) <= v_max**2)

# %% [markdown]
# **Cost.**

# %%
Q, R = ca.diag([10, 10, 1, 1]), ca.DM.eye(2)
e = x - ca.DM([*scene.goal, 0, 0])
opti.minimize(
    10 * ca.bilin(Q, e[:, N])
    + sum(ca.bilin(Q, e[:, k]) for k in range(1, N))
    + sum(ca.bilin(R, u[:, k]) for k in range(N))
)


# %% [markdown]
# **Barriers** (eq. 3-7): $h = d - r_{robot} - \epsilon$ to the person's zone, which moves on with velocity
# $w$ inside the plan, and to each wall.


# %%
def h_person(k):
    p = x[:2, k] - k * dt * w
    d = (ca.norm_2(p - foci[:, 0]) + ca.norm_2(p - foci[:, 1])) / 2 - zone.semi_axes[0]
    return d - 0.5 - 0.05


# %%
def h_wall(k, a, b):
    length, (px, py) = np.hypot(*(b - a)), ca.vertsplit(x[:2, k])
    g = ((px - a[0]) * (b[1] - a[1]) - (py - a[1]) * (b[0] - a[0])) / length
    t = ((length / 2) ** 2 - ca.sumsqr(x[:2, k] - (a + b) / 2)) / length
    return ca.sqrt(g**2 + ((ca.fabs(t) - t) / 2) ** 2) - 0.5 - 0.05


# %% [markdown]
# **The condition** (eq. 1), for everybody and every wall, over the first $N_h$ steps.

# %%
for k in range(N_h):
    opti.subject_to(h_person(k + 1) >= (1 - gamma) * h_person(k))
    for a, b in scene.walls:
        opti.subject_to(h_wall(k + 1, a, b) >= (1 - gamma) * h_wall(k, a, b))

# %%
opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-10})


unsolved = []


def decide(state, person):
    opti.set_value(x0, state)
    opti.set_value(foci, zone.placed(person.position, person.heading).foci.T)
    opti.set_value(w, person.velocity)
    opti.set_initial(x, np.tile(np.reshape(state, (4, 1)), N + 1))
    try:
        return opti.solve().value(u)[:, 0]
    except RuntimeError:  # no solution: IPOPT's last guess is all there is; notebook 21 does better
        unsolved.append(tuple(state))
        return np.clip(opti.debug.value(u)[:, 0], -a_max, a_max)


# %% [markdown]
# That is the controller. It drives:

# %%
state, states, controls = np.array([-4.0, -0.4, 0.0, 0.0]), [], []
for k in range(140):
    states.append(state)
    controls.append(decide(state, scene.people[0].after(k * dt)))
    state = np.array(A @ state + B @ controls[-1]).ravel()
print(f"steps without a solution: {len(unsolved)} of {len(states)}")

# %%
path = np.array(states)
fig, ax = plt.subplots(figsize=(9, 4), layout="constrained")
for k in (0, 40, 60, 80, 100):
    who = scene.people[0].after(k * dt)
    ax.plot(*zone.placed(who.position, who.heading).curve().T, color=figures.RED, linewidth=1)
    ax.annotate(f"{k * dt:.0f} s", who.position, color=figures.RED, ha="center", va="center", fontsize=9)
    ax.add_patch(plt.Circle(path[k, :2], 0.5, color=figures.BLUE, alpha=0.35, lw=0))
    ax.annotate(f"{k * dt:.0f} s", path[k, :2], ha="center", va="center", fontsize=9)
ax.plot(*path[:, :2].T, color=figures.BLUE)
for a, b in scene.walls:
    ax.plot(*np.array([a, b]).T, color=figures.BLACK, linewidth=3)
figures.label_metres(ax, "Your controller in the corridor; zones of the person in red")
record.figure(fig, "corridor")

# %% [markdown]
# ## The same as szlib's?
#
# `szlib.MPCCBF` with `MPCSettings.paper()` and either of its solvers, asked in states along this run. Ours,
# `MPCSettings()`, adds one thing to the problem of the paper: a rule for the side on which the robot passes a person
# whom it meets head-on. It acts fully while the goal lies within `head_on_share` = 0.25 of the half-angle under which the robot
# sees the person's zone, and fades out up to twice that share. In the paper's settings the share is 0. Both
# IPOPTs go on to the last digits; the SQP stops where it expects no more than 1e-4 m/s² from going on.

# %%
rows = []
for k in (k for k in range(0, 100, 10) if tuple(path[k]) not in unsolved):
    for solver in ("sqp", "ipopt"):
        settings = szlib.MPCSettings.paper(gamma=gamma, N=N, N_h=N_h, a_max=a_max, solver=solver)
        controller = szlib.MPCCBF(zone, walls=scene.walls, settings=settings)
        step = controller.step(path[k], scene.goal, [scene.people[0].after(k * dt)])
        rows.append((k * dt, solver, np.abs(step.control - controls[k]).max()))
differences = pd.DataFrame(rows, columns=["t [s]", "solver", "largest difference [m/s²]"])
table = differences.pivot(index="t [s]", columns="solver", values="largest difference [m/s²]")
table.style.format("{:.0e}").format_index("{:.0f}")

# %%
for solver, worst in table.max().items():
    off = dt * float(worst)
    record.check(f"{solver} gives the same velocity after the step, to 1e-5 m/s", off < 1e-5, off)
record.check("IPOPT gives the same acceleration, to 1e-5 m/s²", table["ipopt"].max() < 1e-5)
record.key["largest difference of an acceleration [m/s²]"] = float(table.to_numpy().max())

# %% [markdown]
# ## The paper's eq. 2 next to ours
#
# *The errors.* The paper writes $\mathbf x_N^\top P\,\mathbf x_N$ and $\mathbf x_k^\top Q\,\mathbf x_k$; here
# it is $\mathbf e = \mathbf x - \mathbf x_{goal}$, or else every robot would drive to the origin.
#
# *The sum over $\mathbf u$.* It begins at $k = 1$ there and at $k = 0$ here: $\mathbf u_0$ is the one that is
# applied, and without a price it would be as large as it may.
#
# *The sets $\mathcal X_k$ and $\mathcal U_k$.* The paper says only "maximum speed 1 m/s"; the Euclidean speed is
# ours. It gives no bound on $\mathbf u$; here it is `a_max` on each axis, as a robot without one could do anything
# at the last moment.
#
# *$\Delta h(\mathbf x_k, \mathbf u_k)$.* Here $h(\mathbf x_{k+1}, k+1) - h(\mathbf x_k, k)$: the zone moves
# on within the plan, for the paper's robot knows the person's velocity (sec. 4).
#
# *$\lVert t \rVert - t$ in eq. 5* is $\lvert t \rvert - t$, for $t$ is a number; and *eq. 6* lacks a minus
# sign (notebook 07).
#
# *The margin* $\epsilon$ is 5 cm for every wall in the paper and in `MPCSettings.paper()`; `MPCSettings()` gives
# walls shorter than 5 m more (notebook 22).
#
# *The solver* is IPOPT in the paper and in `MPCSettings.paper()`; that of `MPCSettings()` is an SQP with the same
# answers.
#
# Two things are not in the paper. Both ways around a person ahead cost nearly the same:
# the smallest tilt of the zone decides, or the robot stops in front of a symmetric one. The rule of the side replaces
# that, and acts while the goal lies within twice `head_on_share` of the half-angle of the zone; notebook 09 shows what
# it changes. And where the program has no solution, a solver's guess may lead through a person: then it is solved
# again with a penalised slack, and says so (notebook 21).
#
# **What it means.** The method is a page of code: a model, two limits, a cost, and one inequality for each
# person and wall. What the other files of `szlib/control` add is what a robot needs besides: speed, proof,
# and a decent answer where this program has none.

# %%
record.close()

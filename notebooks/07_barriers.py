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
#     label: barriers
#     paper: sec. 3, eq. 1-7
#     aim: turn a distance into a condition on the next step, and say what gamma does.
#     asks: How does a controller obey "stay out"? How is it built, line by line?
#     needs:
#     - '06'
#     exercises:
#     - '4.2'
#     - 5.1-5.4
#     - '5.8'
#     week: 3
# ---

# %% [markdown]
# # 7 - Barriers: how fast may the robot approach?
#
# **Question.** The zone says where the robot must not be. How fast may the robot approach it?
#
# **Expectation.** One line of mathematics turns the distance to the zone into a limit of the speed. Far away
# the limit does not matter. At the edge of the zone it is zero.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [06](06_respect.ipynb) · next: [8 - Build the controller
# yourself](08_build_a_controller.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 3, eq. 1-7 · 50
# min · needs [06](06_respect.ipynb) · exercises:
# [4.2](exercises/sheet4_own_zone.ipynb#4.2-The-speed-limit-(5-min)),
# [5.1-5.4](exercises/sheet5_barriers.ipynb#5.1-Focal-distance-(15-min)),
# [5.8](exercises/sheet5_barriers.ipynb#5.8-In-your-own-words-(10-min)) · laboratory:
# [13](13_laboratory.ipynb)
#
# **Afterwards you can** turn a distance into a condition on the next step, and say what gamma does.
# **Words.** *CBF-QP*: a quadratic program for one step: as near to the wanted control as the barrier
# allows; *class K*: of a function, as gamma in the paper's eq. 1: it is 0 at 0 and grows; here it is gamma
# times h.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
gamma = 0.05
zone_speed = 1.1  # whose zone the robot keeps [m/s], as in notebook 05

# %% jupyter={"source_hidden": true}
# Set-up, and the figure
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import plots
from IPython.display import Markdown
from studies.lesson_zones import choose_zone

import szlib
from szlib.control import HalfPlane, barrier, cbf_residual
from szlib.workbook import figures
from szlib.workbook.record import PAPER, TUNED, NotebookRecord, parameters

record = NotebookRecord("07_barriers", globals(), plaza_zone=True)
settings = szlib.MPCSettings(gamma=gamma, zone_speed=zone_speed)
zone = choose_zone(record)
record.figure(plots.draw_limit(zone, settings), "limit")

# %% jupyter={"source_hidden": true}
# Parameters, with sources
parameters(
    [
        ("robot radius", f"{settings.r_robot} m", PAPER, "a cylinder"),
        ("margin eps", f"{settings.eps} m", PAPER, "for the error of the approximate distances"),
        ("zone", f"{zone_speed:g} m/s", PAPER, "1.1 m/s: a little more than the robot's top speed"),
        ("gamma", gamma, TUNED, "on the paper's four scenarios; in 2,000 other worlds: chapter 09"),
    ]
)

# %% [markdown]
# ## A number first
#
# The robot is $h = 1$ m away from the zone of a person who stands. We allow $h$ to shrink by at most 5 % in each
# step of 0.1 s. How fast may the robot approach?
#
# 5 % of 1 m is 5 cm. 5 cm in 0.1 s are **0.5 m/s**.
#
# Now the person walks towards the robot at 0.5 m/s. Robot and person together may shorten $h$ by 5 cm in a step.
# The person alone shortens it by 5 cm. **0 m/s** is left for the robot.


# %%
def allowed_speed(h, gamma=0.05, dt=0.1, person_speed=0.0):
    return gamma * h / dt - person_speed


for person_speed in (0.0, 0.5, 1.0):
    print(f"person at {person_speed:g} m/s: robot {allowed_speed(1.0, person_speed=person_speed):+.1f} m/s")

# %% [markdown]
# The last line is negative: the robot has to go **back**. No rule says "go back". It follows from the 5 %.

# %% [markdown]
# ## The discrete barrier condition
#
# This is all of the paper's eq. 1:
#
# $$h(\mathbf{x}_{k+1}) - h(\mathbf{x}_k) \ge -\gamma\, h(\mathbf{x}_k)$$
#
# - $\mathbf{x}_k$ is the state in step $k$, and $h$ is the *barrier function*: 0 at the edge of what is allowed,
#   positive inside of it [m].
# - $\gamma$ is the share of $h$ that one step may use up, between 0 and 1; it was 5 % above.
#
# A controller wants some speed, for example the top speed towards its goal. It takes the allowed speed that is
# nearest to the wanted one. That is a *quadratic program* (CBF-QP):
#
# $$\min_v\ (v - v_{wanted})^2 \quad\text{subject to}\quad v \le \gamma h / \Delta t - v_{person}$$
#
# In one dimension its solution is the smaller of two numbers.


# %%
def approach(gamma, h=4.0, v_wanted=1.0, dt=0.1, duration=10.0):
    """Speed and h of a robot that drives towards a person who stands."""
    run = []
    for _ in range(round(duration / dt)):
        v = min(v_wanted, allowed_speed(h, gamma, dt))
        run.append((h, v))
        h = h - v * dt
    return np.array(run)


# %% [markdown]
# **What do you think?** The first robot may use up 2 % of $h$ in a step, the second 5 %, the third 20 %. Which
# one slows down first? Which one ends nearest to the zone? Write it down, then look.

# %% jupyter={"source_hidden": true}
# Figure
shares = sorted({gamma, 0.02, 0.2})
fig, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
for share, line, colour in zip(shares, (":", "-", "--"), figures.pick_colours(shares), strict=False):
    h, v = approach(share).T
    t = settings.dt * np.arange(len(h))
    left.plot(t, v, line, color=colour, label=f"gamma = {share:g}")
    right.plot(t, h, line, color=colour)
starts = {share: allowed_speed(1.0, share) ** -1 for share in shares}
left.set(xlabel="time [s]", ylabel="speed [m/s]", title="A small gamma slows the robot down early")
right.set(xlabel="time [s]", ylabel="h [m]", title="No gamma lets h become negative", ylim=(-0.1, None))
right.axhline(0, color=figures.RED, linewidth=1)
left.legend()
record.figure(fig, "gamma")

# %% jupyter={"source_hidden": true}
# Checks, and the answer
lowest = min(approach(share)[:, 0].min() for share in shares)
record.check("the robot of the worked example never enters the zone", lowest >= 0, f"least h {lowest:.1g} m")
Markdown(
    "<details><summary>Answer</summary>\n\nThe robot slows down where its limit "
    r"$\gamma h / \Delta t$ becomes smaller than the speed that it wants: at $h = v\,\Delta t / \gamma$. For 1 m/s that is "
    + ", ".join(f"{start:.1f} m with gamma = {share:g}" for share, start in starts.items())
    + ". If this distance is larger than the first h, the robot is slow from the start. All of them approach the same place, the edge of "
    f"the zone; with gamma = {min(starts):g} that takes longer than the figure shows. Before a person who stands, gamma sets **when** the robot slows down, "
    "not how near it comes.\n\n</details>"
)

# %% [markdown]
# ## Theory: why h stays positive for ever
#
# **Forward invariance.** Write eq. 1 as $h_{k+1} \ge (1-\gamma)\,h_k$. After $k$ steps
#
# $$h_k \ge (1-\gamma)^k\, h_0 \ge 0$$
#
# A robot that starts outside the zone stays outside for ever, *if every step has a solution*. The safe set
# $\{h \ge 0\}$ is then called *forward invariant*. Remember the *if*: the next figure shows a robot without one.
#
# **Class K.** A function is of *class K* if it is 0 at 0 and grows. Instead of $\gamma h$, any such function
# $\kappa(h)$ may stand in eq. 1 if it is never larger than $h$: then $h_{k+1} \ge h_k - \kappa(h_k) \ge 0$. The
# paper takes the simplest one, $\gamma h$.
#
# **From continuous to discrete.** In continuous time the condition is $\dot h \ge -\alpha\,h$ with a rate
# $\alpha$ [1/s] (Ames et al., 2019). It gives $h(t) \ge e^{-\alpha t} h_0$. Over one step of $\Delta t$ that is
#
# $$\gamma = 1 - e^{-\alpha \Delta t} \approx \alpha\, \Delta t$$
#
# So gamma depends on $\Delta t$. A controller with half the $\Delta t$ needs about half the gamma to drive alike:

# %%
alpha = -np.log(1 - 0.05) / 0.1
for dt in (0.1, 0.05, 0.02):
    print(f"dt = {dt:4g} s: gamma = {1 - np.exp(-alpha * dt):.4f}")

# %% [markdown]
# **Relative degree.** So far the robot chose its *speed*. A real robot chooses its *acceleration* $a$. In one
# step that moves it by only
#
# $$\tfrac12\, a\, \Delta t^2 = \tfrac12 \cdot 1\ \mathrm{m/s^2} \cdot (0.1\ \mathrm{s})^2 = 5\ \mathrm{mm}$$
#
# while the speed of 1 m/s moves it by 10 cm. (In continuous time $a$ appears in the *second* derivative of $h$
# only: the *relative degree* is 2.) If the robot arrives too fast, no acceleration obeys eq. 1 in the next step.
#
# **How large may gamma be?** On the limit, $v = \gamma h/\Delta t$. As $h$ shrinks at the rate $v$, the robot has to
# brake at $\gamma v/\Delta t$. With gamma = 0.05 and 1 m/s that is 0.5 m/s². The robot can brake at
# $a_{max}$ = 1 m/s², so this is possible. With gamma = 0.2 it is 2 m/s², which is impossible. For a person who
# stands, and a robot that looks two steps ahead, the rule is
#
# $$\gamma \le \frac{a_{max}\,\Delta t}{v_{max}} = \frac{1\ \mathrm{m/s^2} \cdot 0.1\ \mathrm{s}}{1\ \mathrm{m/s}} = 0.1$$
#
# **With a larger gamma** the robot has to look ahead: it obeys eq. 1 not only in the next step, but in the next
# $N_h$ steps. Then it finds out earlier that it must brake. In code: is there an acceleration now, followed by
# full braking, that obeys eq. 1 in $N_h$ steps?


# %%
def obeys(a, h, v, gamma, N_h, dt=0.1, a_max=1.0):
    for _ in range(N_h):
        h_next = h - v * dt - a * dt**2 / 2
        if h_next < (1 - gamma) * h - 1e-12:
            return False
        h, v = h_next, v + a * dt
        a = max(-a_max, -v / dt)  # then brake, until the robot stands
    return True


def drive(gamma, N_h, h=3.0, v=1.0, dt=0.1, a_max=1.0, v_max=1.0):
    run = []
    for _ in range(60):
        brake = max(-a_max, -v / dt)
        choices = np.linspace(min(a_max, (v_max - v) / dt), brake, 401)
        a = next((a for a in choices if obeys(a, h, v, gamma, N_h)), np.nan)
        run.append((h, v, a))
        a = brake if np.isnan(a) else a
        h, v = h - v * dt - a * dt**2 / 2, v + a * dt
    return np.array(run)


# %% [markdown]
# **What do you think?** With gamma = 0.2 and a top speed of 1 m/s: what happens to a robot that looks one step
# ahead? How many steps are enough?

# %% jupyter={"source_hidden": true}
# Figure
fig, ax = plt.subplots(figsize=(7.5, 4), layout="constrained")
most = next(n for n in range(1, 9) if not np.isnan(drive(0.2, n)[:, 2]).any())
runs = {n: drive(0.2, n) for n in (1, 2, most)}
for (n, run), line, colour in zip(
    runs.items(), ("-", "--", "-."), figures.pick_colours(list(runs)), strict=True
):
    h, v, a = run.T
    ax.plot(h, v, line, color=colour, label=f"N_h = {n}: least h {round(100 * h.min())} cm")
    ax.plot(h[np.isnan(a)], v[np.isnan(a)], "x", color=colour)
ax.plot([], [], "kx", label="no acceleration obeys eq. 1")
ax.plot([0, 0.6], [0, 1.2], color=figures.RED, linewidth=1, label="limit gamma h / dt")
ax.axvspan(-0.2, 0, color=figures.RED, alpha=0.15, lw=0, label="inside the zone")
ax.set(xlim=(1.2, -0.2), ylim=(0, 1.1), xlabel="h [m] (the robot comes from the left)", ylabel="speed [m/s]")
ax.set_title(
    f"One step ahead is too late: h falls to {100 * runs[1][:, 0].min():.0f} cm; {most} steps are enough"
)
ax.legend(loc="lower left", fontsize=8)
record.figure(fig, "steps-ahead")

# %% jupyter={"source_hidden": true}
# Checks, and the answer
without = {n: int(np.isnan(run[:, 2]).sum()) for n, run in runs.items()}
lows = {n: float(run[:, 0].min()) for n, run in runs.items()}
evidence = f"least h {lows[1]:.2f} m and {lows[most]:.2f} m"
too_late = without[1] > 0 and lows[1] < 0
gentle = [int(np.isnan(drive(0.1, n)[:, 2]).sum()) for n in (1, 2)]
record.check("with gamma = 0.2 and N_h = 1 the robot enters the zone", too_late, evidence, always=True)
is_enough = most > 2 and lows[most] >= 0
record.check(
    "with gamma = 0.2 every step has a solution from some N_h above 2 on", is_enough, evidence, always=True
)
shown = f"{gentle[0]} and {gentle[1]} steps without a solution"
record.check("gamma <= a_max dt / v_max needs N_h >= 2", gentle[1] == 0 < gentle[0], shown, always=True)
Markdown(
    "<details><summary>Answer</summary>\n\n"
    f"With $N_h = 1$ it begins to brake at h = {runs[1][np.isnan(runs[1][:, 2])][0, 0]:.2f} m. From 1 m/s it needs 0.50 m to stop, "
    f"so it enters the zone by {-lows[1]:.2f} m. With $N_h = 2$, {without[2]} steps have no solution, but full braking is just in time. From "
    f"$N_h = {most}$ on every step has a solution. A smaller gamma helps as well: it brakes early and gently. But it does not replace the "
    f"second step: with gamma = 0.1, which the rule allows, and $N_h = 1$, {gentle[0]} steps have no solution, with $N_h = 2$ {gentle[1]}. The "
    "paper takes $N_h = 2$. Notebook 21 shows where that is not enough.\n\n</details>"
)

# %% [markdown]
# ## Theory: the same in continuous time
#
# **Lie derivatives.** A robot $\dot{\mathbf x} = f(\mathbf x) + g(\mathbf x)\,u$ changes $h$ at the rate
#
# $$\dot h = L_f h + L_g h\, u, \qquad L_f h = \nabla h^\top f, \quad L_g h = \nabla h^\top g .$$
#
# $L_f h$ is what happens without an input, $L_g h$ what the input can do. A *control barrier function* (Ames et al., 2019)
# has an input with $L_f h + L_g h\,u \ge -\alpha h$ in each state. The robot that chooses its speed has $L_g h = -1$.
# The robot that chooses its acceleration has $f = (v, 0)$ and $g = (0, 1)$:


# %%
def lie(h, field, state, e=1e-4):
    step = e * np.array(field(state))
    return (h(state + step) - h(state - step)) / (2 * e)


def gap(state):
    return 3.0 - state[0]  # h of a robot at x, before a zone that begins at 3 m


def drift(state):
    return state[1], 0.0


def push(state):
    return 0.0, 1.0


moving = np.array([1.0, 0.8])
first, second = lie(gap, push, moving), lie(lambda s: lie(gap, drift, s), push, moving)
print(f"L_f h = {lie(gap, drift, moving):.1f} m/s, L_g h = {first:.0f}, L_g L_f h = {second:.0f}")

# %% [markdown]
# $L_g h = 0$: no acceleration changes $\dot h$. It appears in $\ddot h$, with $L_g L_f h = -1$. The number of derivatives until
# the input appears is the **relative degree**, here 2.
#
# **Exercise.** A robot with two wheels chooses its speed and its rate of turning. Which relative degree has $h$ for each?
# <details><summary>Answer</summary>1 for the speed, since the speed moves the robot at once; except where it drives along the
# edge of the zone: there $L_g h = 0$. 2 for the rate of turning, which changes the heading, and the heading changes
# where the speed leads; but none for a robot that stands: there turning never changes $h$.</details>
#
# **Higher order.** Take the condition twice (Nguyen & Sreenath, 2016: *exponential* CBF; Xiao & Belta, 2022: *high-order* CBF):
#
# $$\psi_1 = \dot h + \alpha_1 h, \qquad \dot\psi_1 + \alpha_2 \psi_1 \ge 0
#   \quad\Longleftrightarrow\quad \ddot h + (\alpha_1 + \alpha_2)\,\dot h + \alpha_1 \alpha_2\, h \ge 0 .$$
#
# For the straight approach, $\dot h = -v$ and $\ddot h = -a$, so $a \le \alpha_1\alpha_2 h - (\alpha_1+\alpha_2)\,v$. How hard does
# the robot brake?


# %%
def brake_by_order_two(rate, h=10.0, v=1.0, dt=0.001):
    """Least h and the hardest braking of a robot that keeps its speed until the condition limits it."""
    least, hardest = h, 0.0
    for _ in range(round(20 / dt)):
        a = min(0.0, rate**2 * h - 2 * rate * v)
        h, v = h - v * dt, v + a * dt
        least, hardest = min(least, h), max(hardest, -a)
    return least, hardest


by_rate = {rate: brake_by_order_two(rate) for rate in (0.5, 1.0, 2.0)}
for rate, (low, hard) in by_rate.items():
    print(f"both rates {rate:g} /s: brakes with at most {hard:.2f} m/s², least h {low:.2f} m")

# %% [markdown]
# With both rates $\alpha$ a robot at $v$ brakes with up to $\alpha v / e \approx 0.37\,\alpha v$: so $\alpha \le e\,a_{max}/v_{max}$.
# For gamma the limit was $a_{max}\Delta t / v_{max}$, above.
#
# **Proof 1, on paper.** Let $h(0) \ge 0$, $\psi_1(0) \ge 0$ and $\dot\psi_1 + \alpha_2\psi_1 \ge 0$ at all times. Show that $h(t) \ge 0$ at all
# times. Why is $\psi_1(0) \ge 0$ needed? Give a start with $h(0) > 0$ for which no controller helps.
# <details><summary>Model solution</summary>Multiply by $e^{\alpha_2 t} > 0$: $\frac{d}{dt}\big(e^{\alpha_2 t}\psi_1\big) = e^{\alpha_2
# t}(\dot\psi_1 + \alpha_2\psi_1) \ge 0$, so $e^{\alpha_2 t}\psi_1(t) \ge \psi_1(0) \ge 0$, and $\psi_1(t) \ge 0$. That says $\dot h + \alpha_1 h \ge 0$.
# The same step with $e^{\alpha_1 t}$ gives $e^{\alpha_1 t}h(t) \ge h(0) \ge 0$. Without $\psi_1(0) \ge 0$ the first step fails: $\psi_1$ may be
# negative for a time, and $h$ falls faster than at the rate $\alpha_1$. A start: $h = 0.2$ m with $v = 1$ m/s and $a_{max}$ = 1 m/s².
# It needs 0.5 m to stop. So the safe set is $\{h \ge 0, \psi_1 \ge 0\}$, not $\{h \ge 0\}$.</details>
#
# **What does the discrete condition do about it?** In discrete time an acceleration does appear in the next $h$, but with a
# small gain: after $n$ steps it has moved the robot by $(n - \tfrac12)\,\Delta t^2 a$.

# %%
for dt in (0.1, 0.05):
    gains = ", ".join(f"{1000 * (n - 0.5) * dt**2:.2f} mm after {n}" for n in (1, 2, 8))
    print(f"dt = {dt:g} s: 1 m/s² in the first step moves the robot by {gains} steps")

# %% [markdown]
# The row of the second step is $h_{k+2} \ge (1-\gamma)\,h_{k+1}$. Its first acceleration acts on the *speed* in that step: it
# says $v_{k+1} \lesssim \gamma h_{k+1}/\Delta t$, which is $\psi_1 \ge 0$ with $\alpha_1 = \gamma/\Delta t$. So $N_h = 2$ does for a relative degree of 2 what
# $\psi_1$ does in continuous time, and more steps do it earlier, with a limit of $a$ in mind.
#
# **Exercise.** You halve $\Delta t$ and keep $N_h$. Does the robot look as far ahead?
# <details><summary>Answer</summary>No: $N_h\,\Delta t$ is halved, and so is what it can do about a speed in that time; the gain of one
# step even falls to a quarter. Double $N_h$, and halve gamma.</details>
#
# **A wrong velocity.** The condition trusts the velocity of the person. Let the person come faster by $\delta$ than the robot
# assumes. Then $h_{k+1} \ge (1-\gamma)\,h_k - \delta\,\Delta t$. What happens to $h$?


# %%
def approach_blindly(error, gamma, h=2.0, dt=0.1):
    """h after 60 s of a robot that assumes a person who stands, while the person comes with `error` m/s."""
    for _ in range(600):
        h = h - (allowed_speed(h, gamma, dt) + error) * dt
    return h


lags = {(error, share): approach_blindly(error, share) for error in (0.05, 0.1) for share in (0.05, 0.1)}
for (error, share), low in lags.items():
    print(f"{error:g} m/s too fast, gamma = {share:g}: h ends at {100 * low:+.0f} cm")

# %% [markdown]
# It ends at $-\delta\,\Delta t/\gamma$, and goes no lower: the set $\{h \ge -\delta\,\Delta t/\gamma\}$ is invariant. (This is *input-to-state
# safety*, Kolathaya & Ames, 2019.) A *smaller* gamma makes it worse here: such a robot corrects an error more slowly.
#
# **Exercise.** The margin $\epsilon$ is 5 cm. For which $\delta$ is that enough, with gamma = 0.05?
# <details><summary>Answer</summary>$\delta = \epsilon\gamma/\Delta t$, which is 2.5 cm/s. Speeds of people are measured with larger errors.
# Errors that change sign from one measurement to the next mostly cancel. An error that lasts does not: the robot then enters the
# zone, and it touches nobody only because a zone is larger than a body.</details>

# %% jupyter={"source_hidden": true}
# Checks
what = "the condition of order two keeps h positive"
record.check(what, min(low for low, _ in by_rate.values()) > 0, f"rates {list(by_rate)}", always=True)
peak = {rate: hard / rate for rate, (_, hard) in by_rate.items()}
alike = max(abs(each - np.exp(-1)) for each in peak.values())
record.check("the robot brakes with alpha v / e", alike < 0.01, f"{peak[1.0]:.3f}", always=True)
record.check("relative degree 2: L_g h = 0, L_g L_f h = -1", abs(first) + abs(second + 1) < 1e-6, always=True)
off = max(abs(low + error * 0.1 / share) for (error, share), low in lags.items())
record.check("a wrong velocity ends at h = -delta dt / gamma", off < 1e-6, f"{off:.0e} m off", always=True)

# %% [markdown]
# ## Distance to a person's zone
#
# What is $h$ in the plane? We need a distance from a point to an ellipse. The exact one has no short formula. The
# paper takes the sum of the distances to the two foci (the *focal distance*). It is constant on the ellipse (eq. 7):
#
# $$d(\mathbf{x}) = \tfrac12\left(\|\mathbf{x}-\mathbf{c}_a\| + \|\mathbf{x}-\mathbf{c}_b\|\right) - a,
# \qquad \mathbf{c}_{a,b} = (m,n) \pm \sqrt{a^2-b^2}\,(\cos\theta, \sin\theta)$$
#
# Here $(m, n)$ is the centre, $\theta$ the angle, $a$ and $b$ are the semi-axes of the ellipse (eq. 6, whose second
# term lacks a minus sign in the paper). Then $h = d - r_{robot} - \epsilon$.

# %%
(a, b), direction = zone.semi_axes, np.array([np.cos(zone.angle), np.sin(zone.angle)])
foci = [np.array(zone.center) + sign * np.sqrt(a**2 - b**2) * direction for sign in (1, -1)]


def distance(x):
    return (np.linalg.norm(x - foci[0]) + np.linalg.norm(x - foci[1])) / 2 - a


for x in ([2.0, 0.0], [0.0, 2.0]):
    print(f"robot at {x}: d = {distance(np.array(x)):.2f} m, h = {distance(np.array(x)) - 0.55:.2f} m")

# %% jupyter={"source_hidden": true}
# Checks
off = float(np.abs(szlib.ellipse_distance(zone.curve(), zone)).max())
record.check("d = 0 on the zone", off < 1e-12, f"largest |d| {off:.0e} m", always=True)
places = np.random.default_rng(seed).uniform(-3, 3, (100, 2))
off = max(abs(distance(x) - float(szlib.ellipse_distance(x, zone))) for x in places)
record.check("d by hand is the library's d", off < 1e-12, f"largest difference {off:.0e} m", always=True)

# %% jupyter={"source_hidden": true}
# Figure
ax = plots.plot_distance(zone)
ax.set_title("The robot's centre must stay outside the orange line")
record.figure(ax.figure, "ellipse")

# %% [markdown]
# ## Distance to a wall
#
# A wall is a straight segment: a line, trimmed by a disc (Shapiro & Tsukanov, 1999), eq. 3-5. The paper writes
# $\|t\|$ for $|t|$:
#
# $$g = \frac{(x-x_a)(y_b-y_a)-(y-y_a)(x_b-x_a)}{L},\quad
#   t = \frac{(L/2)^2-\|\mathbf{x}-\mathbf{x}_c\|^2}{L},\quad
#   d = \sqrt{g^2 + \left(\tfrac{|t|-t}{2}\right)^2}$$
#
# $L$ is the length of the wall, $\mathbf{x}_c$ its middle. $g$ is the distance to the endless line. $t$ is
# positive inside the disc around the wall; there the last term is 0, and $d = |g|$.

# %% jupyter={"source_hidden": true}
# Figure
wall = (np.array([-1.0, 0.0]), np.array([1.0, 0.0]))
ax = plots.plot_distance(wall)
ax.set_title("Around a wall the orange line closes behind both ends")
record.figure(ax.figure, "segment")

# %% jupyter={"source_hidden": true}
# Checks
along = np.column_stack([np.linspace(-1, 1, 101), np.zeros(101)])
off = float(np.abs(szlib.segment_distance(along, *wall)).max())
record.check("d = 0 on the segment", off < 1e-12, f"largest |d| {off:.0e} m", always=True)
beside = szlib.segment_distance(np.array([[0.0, 0.4], [0.5, -0.3]]), *wall)
is_euclidean = np.allclose(beside, [0.4, 0.3])
record.check("beside the segment d is the Euclidean distance", is_euclidean, "0.4 m and 0.3 m", always=True)

# %% [markdown]
# ## Distance to an edge
#
# The robot drives on a platform, and the rails lie below $y = -1$ m. The forbidden side is a *half-plane*. Its distance is
# the simplest one: with a point $\mathbf{p}$ on the edge and a unit vector $\mathbf{n}$ towards the allowed side,
#
# $$d = \mathbf{n}^\top (\mathbf{x} - \mathbf{p})$$
#
# Eq. 1 is the same for all three distances, so the controller of the library takes an edge as it takes walls and people.
#
# **What do you think?** The goal lies beyond the edge, at $y = -2$ m. Where does the robot stop: at $h = 0$, or
# before? Its plan has eight steps. Does it matter whether all of them obey the edge, or only the first two?

# %%
edge, ends = HalfPlane(point=(0.0, -1.0), normal=(0.0, 1.0)), {}
for n_h in (8, 2):
    controller = szlib.MPCCBF(zone, obstacles=[edge], settings=replace(settings, N_h=n_h))
    state = np.array([0.0, 0.0, 0.0, 0.0])
    for _ in range(150):
        step = controller.step(state, goal=(2.0, -2.0))
        state = step.predicted[1]  # nothing disturbs the robot: it is where the plan says
    ends[n_h] = step.h[0]
    print(f"N_h = {n_h}: after 15 s at y = {state[1]:.3f} m, where h = {step.h[0]:.3f} m")
print("goal blocked:", step.goal_blocked)

# %% jupyter={"source_hidden": true}
# Checks, and the answer
lowest, stands = min(ends.values()), settings.a_max * settings.dt**2 / (2 * gamma)
record.check("the robot stops before the edge", lowest >= -1e-6, f"h = {lowest:.3f} m", always=True)
what = "with N_h = 2 it stops where h = a_max dt^2 / (2 gamma)"
record.check(what, abs(ends[2] - stands) < 1e-3 > ends[8], f"{ends[2]:.3f} m and {stands:.3f} m")
Markdown(
    f"<details><summary>Answer</summary>\n\nWith $N_h = 8$ at $h = 0$: its side is then {settings.eps:g} m away from the edge. "
    f"With $N_h = 2$ it stops {100 * ends[2]:.0f} cm before that. Such a plan obeys the edge in two steps only, and drives on over "
    "it later. At $h = a_{max}\\,\\Delta t^2 / (2\\gamma)$ the second row leaves room for full acceleration in the second step, "
    "if the robot stands still in the first. So each plan starts in its second step; but only the first step is "
    "driven. In both cases the step says that the goal cannot be reached.\n\n</details>"
)

# %% [markdown]
# ## The same with the library
#
# `szlib.ellipse_distance`, `control.barrier` and `control.cbf_residual` are these formulas. The residual is
# positive where eq. 1 is obeyed:

# %%
h = float(barrier(szlib.ellipse_distance([2.5, 0.0], zone), settings.r_robot, settings.eps))
h_next = float(barrier(szlib.ellipse_distance([2.45, 0.0], zone), settings.r_robot, settings.eps))
print(f"h = {h:.3f} m, then {h_next:.3f} m: residual {cbf_residual(h_next, h, gamma):+.3f} m")

# %% jupyter={"source_hidden": true}
# Checks
h = 1.0
less, more = (cbf_residual(h - share * gamma * h, h, gamma) for share in (0.6, 1.2))
claim = f"from h = 1 m it may fall by {60 * gamma:.3g} cm in a step, and not by {120 * gamma:.3g} cm"
record.check(claim, less > 0 > more, f"residuals {100 * less:+.1f} cm and {100 * more:+.1f} cm", always=True)
person, aside = szlib.Person((0.0, 0.0), heading=0.0), np.array([1.5, 1.0])
of_person, of_edge = szlib.MPCCBF(zone, obstacles=[edge], settings=settings).barriers(aside, [person])
off = max(abs(of_person - (distance(aside) - 0.5 - 0.05)), abs(of_edge - (aside[1] + 1.0 - 0.5 - 0.05)))
what = "the controller's h is the distance by hand less 0.5 m and 5 cm: of a person, and of an edge"
record.check(what, off < 1e-12, f"{off:.0e} m off", always=True)
record.key |= {"v limit at h = 1 m": settings.gamma * h / settings.dt}

# %% [markdown]
# ## Try it: a person comes
#
# Nothing has to be installed for this: the runs are recorded in the page. Choose, press *play*, step, or move the time
# line. The green area holds all accelerations that the robot may choose then, and the sentence says why it chose this one.
#
# **What do you think?** A person walks towards a robot that cannot pass: it drives in a narrow passage. Which gamma turns back first, and which
# comes nearest to the zone? Write it down, then look.

# %% jupyter={"source_hidden": true}
# The recorded laboratory
from laboratory import PRESETS, Axis, Recording, RobotOptions, World


def meet_head_on(gamma, pace):
    walls = [[(-9.0, y), (7.0, y)] for y in (1.5, -1.5)]
    person = szlib.Person((4.0, 0.0), (-pace, 0.0), heading=np.pi)
    scene = replace(PRESETS["passing"], people=(person,), walls=np.array(walls))
    return World(scene, zone, [RobotOptions(changes={"gamma": gamma})])


axes = [
    Axis("gamma", "gamma", (0.02, 0.05, 0.2), 1),
    Axis("pace", "pace of the person [m/s]", (0.0, 0.2, 0.4)),
]
recording = Recording("A robot and a person in a narrow passage", meet_head_on, axes, longest=9.0)
recording

# %% [markdown]
# With a kernel, the next line opens the live laboratory on the same scene: there you drag the person.

# %%
recording.open_live()

# %% jupyter={"source_hidden": true}
# The answer
nearest = {row["gamma"]: row["least_h"] for row in recording.table if row["pace"] == 0.4}
Markdown(
    "<details><summary>Answer</summary>\n\nThe smallest gamma turns back first: it allows the least speed of approach at each h. "
    "At 0.4 m/s the least h in these 9 s is "
    + ", ".join(f"{low:.2f} m with gamma = {gamma:g}" for gamma, low in nearest.items())
    + ". Below 0 it turned back too late.\n\n</details>"
)


# %% [markdown]
# ## Three common mistakes
#
# - **"h < 0 means a collision."** No. The zone is larger than the body. At $h = 0$ the robot's side is still at
#   least 5 cm outside the zone. $h < 0$ means that the robot comes closer than people do.
# - **"A smaller gamma keeps a larger distance."** No. Before a person who stands, a robot that chooses its speed ends at the
#   edge of the zone with every gamma. A smaller one slows it down earlier. (A robot that chooses its acceleration, with
#   $N_h = 2$, ends some 10 cm before: see "Distance to an edge".)
# - **"The barrier stops the robot."** Only if the person stands. If the person comes, $h$ falls although the robot
#   stands still, and the condition requires that it goes back (chapter 11).

# %% jupyter={"source_hidden": true}
# What we know now
Markdown(
    "**What we know now.** Distance has become a limit of the speed: at h = 1 m the robot may approach at "
    f"{allowed_speed(1.0, gamma):.2g} m/s, at h = 0 not at all. Eq. 1 keeps h positive as long as every step has a solution. "
    "A small gamma, or a look some steps ahead, gives it one. Both distances are approximations; notebook 22 measures "
    "their errors. Next: a controller that finds, ten times a second, the best acceleration in the plane that obeys eq. 1: "
    "chapter 08."
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

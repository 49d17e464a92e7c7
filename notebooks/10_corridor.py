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
#     label: corridor
#     paper: sec. 4, fig. 6b
#     aim: say why the robot slows down in a corridor, and speeds up beside the person.
#     row: 09
#     needs:
#     - 09
#     week: 5
# ---

# %% [markdown]
# # 10 - Meeting in a narrow corridor
#
# **Question.** A person walks towards the robot in a corridor. There is room for both, but not much. Who
# slows the robot down: the person, or the wall?
#
# **Expectation.** The paper: the robot slows down because it nears the safety boundary (sec. 4). Which boundary,
# that of the zone or that of the wall?

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [09](09_passing.ipynb) · next: [11 - Yielding: waiting and making
# room](11_waiting.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4, fig. 6b · 25 min · needs
# [09](09_passing.ipynb) · laboratory: [13](13_laboratory.ipynb)
#
# **Afterwards you can** say why the robot slows down in a corridor, and speeds up beside the person.

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
width = 4.6  # of the corridor, m
pace = 0.5  # of the person, m/s

# %% jupyter={"source_hidden": true}
# Set-up, and the figure
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from IPython.display import Markdown
from laboratory import draw_step
from studies import scenario_runs
from studies.atlas import AtlasCell
from studies.lesson_zones import choose_zone

import szlib
from szlib.simulation.metrics import classify_strategy
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord

record = NotebookRecord("10_corridor", globals(), plaza_zone=True)
settings = szlib.MPCSettings(gamma=gamma, N=N, N_h=N_h, a_max=a_max)
scenario = AtlasCell("corridor", width=width, pace=pace).scenario()
runs = scenario_runs.drive_both(record, scenario, settings)
log, zone = runs.ours, choose_zone(record)
controller = szlib.MPCCBF(zone, walls=scenario.walls, settings=settings)
metrics = log.metrics()
sides = [run.metrics()["passing_side"] for run in (runs.paper, log)]
lowest = max(run.metrics()["min_speed"] for run in (runs.paper, log))
title = f"Both slow down to {lowest:.2f} m/s or less (the paper's: {sides[0]}, ours: {sides[1]})"
record.figure(scenario_runs.draw_paths_and_speeds(runs, title), "chains")

# %% jupyter={"source_hidden": true}
# Parameters, with sources
scenario_runs.list_parameters(
    settings,
    ("person's speed", f"{pace} m/s", PAPER, "constant, known exactly, unaffected by the robot"),
    ("corridor", f"{width} m wide", ASSUMED, "the paper shows walls without numbers"),
)

# %% [markdown]
# ## The paper's chain, and ours
#
# As in chapter 09, orange is the paper's chain, its zone and its controller; gamma and a_max are ours, since the paper
# gives none. Blue is our zone (chapter 06) and our controller. In the paper's chain the tilt of the zone chooses the
# side, in ours the rule of the side (chapter 09).

# %%
scenario_runs.tabulate_five(runs.all_by_name())

# %% [markdown]
# Our run, step by step. The numbers are times in seconds: a 4 marks where the robot and the person are at 4 s. Later is
# darker.

# %% jupyter={"source_hidden": true}
# Figure
fig, ax = plt.subplots(figsize=(9, 4.2), layout="constrained")
figures.plot_scenario(log, ax=ax)
ax.set_title(f"Between zone and wall the robot slows down to {metrics['min_speed']:.2f} m/s (times in s)")
record.figure(fig, "scenario")

# %% jupyter={"source_hidden": true}
# Animation
record.animation(movie := log.animate(width=9), "run")
movie

# %% [markdown]
# ## Safe, and as the paper says?
#
# The checks must hold with any zone that leaves the corridor passable. The claims are the paper's, for its chain
# and for ours.

# %% jupyter={"source_hidden": true}
# Checks
scenario_runs.record_safety(record, runs)

# %% jupyter={"source_hidden": true}
# Checks: eq. 1 in each step
spare = log.h[1:] - (1 - gamma) * log.h[:-1]  # eq. 1 of each row and each step
what = f"in each step h of the person falls by {gamma:.0%} at most, and comes to that limit"
is_limit = -1e-6 < spare[:, 0].min() < 1e-3 if record.cache.is_synthetic else spare[:, 0].min() > -1e-6
record.check(what, is_limit, f"{1000 * spare[:, 0].min():.3f} mm left")
record.check("our robot passes on the chosen side", sides[1] == settings.pass_side, f"side: {sides[1]}")

# %% jupyter={"source_hidden": true}
# The paper's claims
scenario_runs.record_both_claims(record, runs)

# %% [markdown]
# ## A number first
#
# How much room is left beside the person, when the robot is there? The person walks in the middle of the corridor. On
# each side there is half the width of the corridor, minus the zone, minus the robot with a margin on both of its sides:


# %%
reach = zone.curve()[:, 1].max()  # of the zone, to the side on which the robot passes


def free_room(width, zone_sideways=reach, robot=0.5, margin=0.05):
    return width / 2 - zone_sideways - 2 * (robot + margin)


room, least_width = free_room(width), 2 * (reach + 1.1)
print(
    f"the zone reaches {reach:.2f} m to the side: {100 * room:.0f} cm are free, and {50 * room:.0f} cm on each side of the robot"
)
print(f"both fit side by side in a corridor wider than 2 x ({reach:.2f} m + 1.1 m) = {least_width:.1f} m")

# %% [markdown]
# The robot fits. Its speed there depends on the row that limits it.
#
# ## Person or wall?
#
# **What do you think?** Take the walls away: how slow does the robot become beside the person? Put them back, and
# take the person away: how slow is it now? Write down two speeds.

# %% jupyter={"source_hidden": true}
# Figure
cases = {
    "person and walls": scenario,
    "person alone": replace(scenario, walls=scenario.walls[:0]),
    "walls alone": replace(scenario, people=()),
}
alone = {name: scenario_runs.drive(scene, zone, settings) for name, scene in cases.items()}
slowest = {name: run.metrics()["min_speed"] for name, run in alone.items()}
fig, ax = plt.subplots(figsize=(8.5, 3.6), layout="constrained")
styles = ("-", figures.BLUE), ("--", figures.ORANGE), (":", figures.BLACK)
for (name, run), (line, colour) in zip(alone.items(), styles, strict=True):
    ax.plot(run.time, run.speed, line, color=colour, label=f"{name}: slowest {slowest[name]:.2f} m/s")
both, least_alone = slowest["person and walls"], min(slowest["person alone"], slowest["walls alone"])
ax.set(xlabel="time [s]", ylabel="speed [m/s]", ylim=(0, 1.1))
ax.set_title(f"Neither alone slows it below {least_alone:.2f} m/s; both together: {both:.2f} m/s")
ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=9)
record.figure(fig, "person-or-wall")

# %% jupyter={"source_hidden": true}
# Checks, and the answer
record.check(
    "the robot is more than twice as slow between person and wall as beside either alone",
    least_alone > 2 * both,
    f"{both:.2f} m/s, and {least_alone:.2f} m/s alone",
)
Markdown(
    f"<details><summary>Answer</summary>\n\nBeside the person alone {slowest['person alone']:.2f} m/s, between the walls alone "
    f"{slowest['walls alone']:.2f} m/s. Without walls the robot goes around as far as it needs, and a wall that it drives along "
    "does not limit its speed ahead. Only both together leave it no fast way: nearer to the wall the wall's "
    "row limits it, nearer to the zone the person's.\n\n</details>"
)

# %% [markdown]
# ## Which row holds the robot, and when
#
# A row of the problem *holds* the robot when the chosen acceleration lies on the limit of this row (the row is
# *active*): without the row the robot would choose another acceleration. Robot and person are *abeam* when they are
# side by side. **What do you think?** Which row holds the robot first, the person's or a wall's? And does it speed up
# before, at, or after the moment when both are abeam?

# %% jupyter={"source_hidden": true}
# Figure
holds = scenario_runs.find_holding_times(log)
ahead = log.people[:, 0, 0] - log.states[:, 0]
abeam = float(log.time[np.abs(ahead).argmin()])
together = np.intersect1d(holds["person"], np.union1d(*list(holds.values())[1:]))
fig, (upper, lower) = plt.subplots(
    2, 1, figsize=(8.5, 4.2), sharex=True, layout="constrained", height_ratios=[2, 1]
)
upper.plot(log.time, log.speed, color=figures.BLUE)
upper.set(ylabel="speed [m/s]", ylim=(0, 1.1))
upper.set_title(
    f"From {together.min():.1f} to {together.max():.1f} s person and wall hold it at once"
    if together.size
    else "Person and wall never hold it at once"
)
for y, when in enumerate(holds.values()):
    lower.plot(when, np.full(len(when), y), "s", color=figures.BLACK, markersize=4)
for ax in (upper, lower):
    ax.axvline(abeam, color=figures.GREY, linestyle=":")
upper.text(abeam + 0.1, 0.05, "abeam")
lower.set(xlabel="time [s]", ylim=(-0.5, 2.5))
lower.set_yticks(range(3), [f"held by the {name}" for name in holds])
record.figure(fig, "holds")

# %% jupyter={"source_hidden": true}
# Figure
row = int(log.speed[10 : max(11, round(abeam / settings.dt))].argmin()) + 10
step = controller.step(*log.controller_inputs(float(log.time[row])))
fig = draw_step(step)
fig.suptitle(f"Slowest before abeam, at {log.time[row]:.1f} s: it chooses a corner of what is allowed")
record.figure(fig, "admissible")

# %% jupyter={"source_hidden": true}
# The answer
shares = ", ".join(f"the {name} {100 * len(when) / len(log.time):.0f} %" for name, when in holds.items())
again = float(log.time[row + np.argmax(log.speed[row:] > 0.5)])
begins = sorted((float(when[0]), name) for name, when in holds.items() if len(when))
first = "; ".join(f"the {name} holds it from {when:.1f} s" for when, name in begins).capitalize() + "."
Markdown(
    f"<details><summary>Answer</summary>\n\n{first} Shares of the run in which each holds it: {shares}. It is slowest at "
    f"{log.time[row]:.1f} s, when h is {step.h[0]:.2f} m to the person and {step.h[1:].min():.2f} m to the nearer wall; faster "
    f"than 0.5 m/s again from {again:.1f} s on; abeam at {abeam:.1f} s. So it speeds up "
    f"{'before' if again < abeam else 'after'} both are abeam: the barrier limits how fast h falls, not how fast the robot "
    "drives. On the right of the last figure the two rows leave a corner, and the robot chooses its tip: the person's "
    "row forbids accelerations nearer to the zone, the wall's row those to the side.\n\n</details>"
)

# %% [markdown]
# ## How wide must a corridor be?
#
# Both fit side by side if the room that is left is positive ("A number first" gives the width). **What do you think?**
# Does the robot pass in the narrowest corridor in which both fit? From which width on does it no longer notice the
# walls?

# %%
widths, meetings = (3.4, 3.8, 4.2, 4.6, 5.0, 5.6, 6.4, 8.0), {}
for each in widths:
    scene = AtlasCell("corridor", width=each, pace=pace).scenario()
    meetings[each] = scenario_runs.drive(scene, zone, settings)

# %% jupyter={"source_hidden": true}
# Figure
found = {each: run.metrics() for each, run in meetings.items()}
strategies = {each: classify_strategy(run) for each, run in meetings.items()}
fig, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
for ax, key, name in (
    (left, "min_speed", "slowest speed [m/s]"),
    (right, "time_to_goal", "time to goal [s]"),
):
    ax.plot(widths, [each[key] for each in found.values()], "-", color=figures.GREY, linewidth=1)
    kinds = zip(dict.fromkeys(strategies.values()), "Xso^D", figures.pick_colours(range(5)), strict=False)
    for strategy, marker, colour in kinds:
        shown = [each for each in widths if strategies[each] == strategy]
        values = [found[each][key] for each in shown]
        ax.plot(shown, values, marker, color=colour, markersize=8, label=strategy)
    ax.axvline(width, color=figures.GREY, linestyle=":")
    ax.set(xlabel="width of the corridor [m]", ylabel=name, ylim=(0, None))
left.set_title("The wider, the faster")
backs, passes = (
    [each["time_to_goal"] for at, each in found.items() if (strategies[at] == "backs out") == is_back]
    for is_back in (True, False)
)
costs = min(backs, default=0) > max(passes, default=np.inf)
right.set_title("Going back costs more time than squeezing by" if costs else "The time that each width costs")
left.legend(loc="lower right")
record.figure(fig, "widths")

# %% jupyter={"source_hidden": true}
# The answer
narrow = [each for each in widths if strategies[each] == "backs out"]
unhindered = [each for each in widths if found[each]["min_speed"] > 0.95 * slowest["person alone"]]
begin = f"from a width of {min(unhindered):g} m on" if unhindered else "in none of these corridors"
text = "none of these corridors" if not narrow else f"corridors up to {max(narrow):g} m wide"
roomy = [each for each in narrow if each > least_width]
fits = ""
if roomy:
    fits = (
        f"At {roomy[0]:g} m both would fit, with {100 * free_room(roomy[0]):.0f} cm of room: with so little h the robot may "
        "hardly move, and the person is there before it has squeezed by. "
    )
Markdown(
    f"<details><summary>Answer</summary>\n\nIn {text} the robot goes back and lets the person through. {fits}It no longer notices the walls {begin}: there its "
    f"slowest speed is that beside a person in the open ({slowest['person alone']:.2f} m/s), to 5 %.\n\n</details>"
)

# %% [markdown]
# ## Try it: width and pace
#
# Nothing has to be installed for this: the runs are recorded in the page. Choose, press *play*, step, or move the time
# line. The green area holds all accelerations that the robot may choose then, and the sentence says why it chose this one.
#
# **What do you think?** The corridor is 3.8 to 5 m wide, and the person comes at 0.3 to 0.7 m/s. Where does the robot leave the corridor to the
# person? Write it down, then look.

# %% jupyter={"source_hidden": true}
# The recorded laboratory
from laboratory import Axis, Recording, World


def meet_in_corridor(width, pace):
    walls = np.array([[(-6.0, y), (7.0, y)] for y in (width / 2, -width / 2)])
    person = szlib.Person((4.0, 0.0), (-pace, 0.0))
    return World(replace(szlib.SCENARIOS["corridor"], people=(person,), walls=walls), zone)


axes = [Axis("width", "width [m]", (3.8, 4.4, 5.0), 1), Axis("pace", "pace [m/s]", (0.3, 0.7))]
recording = Recording("A person in a corridor", meet_in_corridor, axes, every=3)
recording

# %% [markdown]
# With a kernel, the next line opens the live laboratory on the same scene: there you drag the person.

# %%
recording.open_live()

# %% jupyter={"source_hidden": true}
# The answer
Markdown(
    "<details><summary>Answer</summary>\n\nThe times to the goal, the latest first: "
    + scenario_runs.list_arrivals(recording.table)
    + "."
    + " In the narrowest one it goes back and lets the person out first, although both would fit."
    * (3.8 in roomy)
    + "\n\n</details>"
)

# %% [markdown]
# ## A common mistake
#
# **"The barrier of the wall stops the robot."** No. A wall limits how fast the robot comes *nearer to the wall*.
# Along the wall the robot may drive at its top speed. Only a second row, here the person's, limits the way ahead.

# %% jupyter={"source_hidden": true}
# What we know now
Markdown(
    f"**What we know now.** Neither the person nor the wall alone slows the robot much: each leaves it at least {least_alone:.2f} "
    f"m/s, both together {both:.2f} m/s (the paper's chain: {runs.paper.metrics()['min_speed']:.2f} m/s). It speeds up beside "
    "the person, because h no longer falls there. "
    f"{f'In corridors up to {max(narrow):g} m wide it goes back, although no rule says so' if narrow else 'It passes in each width'}: "
    "chapter 11 asks why."
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

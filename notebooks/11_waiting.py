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
#     label: yielding
#     paper: sec. 4, fig. 6c-d
#     aim: say why the robot waits, and why it backs out of a passage, although no rule tells it
#       to.
#     asks: Who goes first in a narrow passage? What if the robot is in the way?
#     needs:
#     - '10'
#     exercises:
#     - '7.3'
#     - '7.5'
#     week: 6
# ---

# %% [markdown]
# # 11 - Yielding: waiting and making room
#
# **Question.** A passage is too narrow for two, and a person is in it. Why does the robot wait outside, and why
# does it go back if it is inside, although no rule says who goes first?
#
# **Expectation.** The paper: a robot outside waits until the person is through. A robot inside backs out first.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [10](10_corridor.ipynb) · next: [12 - Among people: ways, crowds,
# and limits](12_among_people.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 4, fig. 6c-d · 30 min
# · needs [10](10_corridor.ipynb) · exercises:
# [7.3](exercises/sheet7_robot.ipynb#7.3-Predict,-then-run-(20-min)),
# [7.5](exercises/sheet7_robot.ipynb#7.5-In-your-own-words-(10-min)) · laboratory: [13](13_laboratory.ipynb)
#
# **Afterwards you can** say why the robot waits, and why it backs out of a passage, although no rule tells
# it to.

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
width = 2.0  # of the passage, m
pace = 0.5  # of the person, m/s

# %% jupyter={"source_hidden": true}
# Set-up, and the figure
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import Markdown
from laboratory import draw_step, find_admissible_controls
from studies import chains, scenario_runs
from studies.atlas import AtlasCell
from studies.lesson_zones import choose_paper_zone, choose_zone

import szlib
from szlib.simulation.metrics import ACTIVE_RESIDUAL, classify_strategy, find_yielding_steps
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord

record = NotebookRecord("11_waiting", globals(), plaza_zone=True)
settings = szlib.MPCSettings(gamma=gamma, N=N, N_h=N_h, a_max=a_max)
scenes = {name: AtlasCell(name, width=width, pace=pace).scenario() for name in ("waiting", "making_room")}
waiting, making_room = (scenario_runs.drive_both(record, scene, settings) for scene in scenes.values())
_, between = scenes["waiting"].claims[1].check(waiting.ours)
_, back = scenes["making_room"].claims[0].check(making_room.ours)
titles = {
    f"Waiting: it goes in {between:.1f} s after the person is out": waiting,
    f"Making room: it goes back {back:.1f} m": making_room,
}
record.figure(scenario_runs.draw_space_times(titles), "space-time")

# %% jupyter={"source_hidden": true}
# Parameters, with sources
scenario_runs.list_parameters(
    settings,
    ("person's speed", f"{pace} m/s", PAPER, "constant, known exactly, unaffected by the robot"),
    ("passage", f"{width} m wide", ASSUMED, "the paper shows walls without numbers"),
)

# %% [markdown]
# The horizontal axis of a panel is the time. The vertical axis is the way through the passage, which is the grey band.
# The person walks down through the band. In the left panel the robot starts outside, and stays below the band until the
# person is out. In the right panel it starts in the band, goes down out of it, and comes back. The *mouth* is the end
# of the passage on the robot's side.

# %% [markdown]
# ## The paper's chain, and ours
#
# As in chapter 09, orange is the paper's chain, its zone and its controller; gamma and a_max are ours, since the paper
# gives none. Blue is our zone (chapter 06) and our controller. Here both do nearly the same: our rule of
# the side changes only where the robot steps aside. The same five numbers describe a run in chapters 09 to 11:

# %%
named = {f"waiting, {name}": run for name, run in waiting.all_by_name().items()}
named |= {f"making room, {name}": run for name, run in making_room.all_by_name().items()}
scenario_runs.tabulate_five(named)

# %% [markdown]
# *Yielding* is time without progress while the barrier of a person holds the robot. The *clearance* is the
# Euclidean gap from the robot's side to a body or a wall.

# %% [markdown]
# The run in which our robot makes room (waiting can be played at the end of the chapter, in "Try it"):

# %% jupyter={"source_hidden": true}
# Animation: making room
record.animation(movie := making_room.ours.animate(width=9, every=1.0), "run")
movie

# %% [markdown]
# ## Safe, and as the paper says?
#
# The checks must hold with any zone that leaves the passage open. The claims are the paper's, for its chain and
# for ours.

# %% jupyter={"source_hidden": true}
# Checks: waiting
scenario_runs.record_safety(record, waiting)

# %% jupyter={"source_hidden": true}
# The paper's claims: waiting
scenario_runs.record_both_claims(record, waiting)

# %% jupyter={"outputs_hidden": true, "source_hidden": true}
# Checks: making room; the same as for waiting
scenario_runs.record_safety(record, making_room, "making room: ")

# %% jupyter={"source_hidden": true}
# The paper's claims: making room
scenario_runs.record_both_claims(record, making_room, "making room: ")

# %% [markdown]
# ## What waiting looks like
#
# Ten times a second the robot chooses an acceleration that obeys every row of the problem: the person's and each
# wall's. **What do you think?** In the middle of waiting, which accelerations are left: only zero, all that point
# away from the passage, or some to the side?

# %% jupyter={"source_hidden": true}
# Figure
log = waiting.ours
controller = szlib.MPCCBF(log.zones[0], walls=scenes["waiting"].walls, settings=settings)
waits = np.flatnonzero(find_yielding_steps(log))
middle = float(log.time[waits[len(waits) // 2] if len(waits) else log.speed[10:].argmin() + 10])
step = controller.step(*log.controller_inputs(middle))
fig = draw_step(step)
ahead = find_admissible_controls(step).polygon.bounds[2]
fig.suptitle(f"Waiting at {middle:.1f} s: at most {ahead:+.2f} m/s² towards the passage (x) is allowed")
record.figure(fig, "admissible")

# %% jupyter={"source_hidden": true}
# Checks, and the answer
evidence = f"at most {ahead:+.2f} m/s²"
record.check(
    "while the robot waits, no admissible acceleration leads towards the passage", ahead <= 0, evidence
)
Markdown(
    "<details><summary>Answer</summary>\n\nThose that point back, and some to the side. "
    f"h is {step.h[0]:.2f} m to the person and {step.h[1:].min():.2f} m to the nearest wall. The "
    "person's row forbids accelerations to the mouth of the passage, and the row of the wall beside the mouth those straight "
    "on. The robot takes the corner of what is left that is nearest to its goal. Waiting is nothing else: this corner lies "
    "near zero. So the robot hardly ever stands still. It comes slowly nearer, goes aside as the zone comes out, and comes "
    "back behind the zone.\n\n</details>"
)

# %% [markdown]
# **What do you think?** The person leaves the passage, and the robot enters it some seconds later (first figure, left). What
# holds it in between: still the person, or the walls?

# %% jupyter={"source_hidden": true}
# The answer
out, enters = (float(log.time[np.argmax(each)]) for each in (log.people[:, 0, 0] < 0, log.states[:, 0] > 0))
holds = log.residual.min(axis=2) <= ACTIVE_RESIDUAL
between_both = (log.time >= out) & (log.time < enters)
by_person, by_walls = between_both & holds[:, 0], between_both & ~holds[:, 0] & holds[:, 1:].any(axis=1)
last = float(log.time[by_person][-1]) if by_person.any() else out
walls = log.h[by_walls, 1:] if by_walls.any() else np.full((1, 4), np.nan)  # first those of the passage
passage, beside = walls[:, :2].min(axis=1), walls[:, 2:].min()
record.check(
    "after the person is out, first the person and then the walls at the mouth hold the robot",
    (by_person | by_walls).sum() > 0.8 * between_both.sum() and by_walls.any(),
    f"the person {by_person.sum()}, walls alone {by_walls.sum()} of {between_both.sum()} steps",
)
Markdown(
    f"<details><summary>Answer</summary>\n\nBoth, one after the other. The person is out at {out:.1f} s, but the zone still passes "
    f"beside the robot: the person's row holds it until {last:.1f} s. Then it comes back, held by two walls that meet at the corner of "
    f"the mouth. The wall beside the mouth leaves no room ahead: its h is down to {100 * beside:.0f} cm. The way back leads "
    f"towards the wall of the passage. Eq. 1 lets this h fall by {100 * gamma:g} % in a step: by {gamma * passage[0] / settings.dt:.2f} m/s "
    f"at first, and by {gamma * passage.min() / settings.dt:.2f} m/s where it is least. So the robot goes around the corner slowly, and is in "
    f"at {enters:.1f} s. The wait for the person is short. The way around the corner is what takes long.\n\n</details>"
)

# %% [markdown]
# ## A speed limit below zero
#
# Now the robot is in the passage. It is $h = 0.6$ m away from the zone of a person who walks towards it at
# 0.5 m/s. With gamma = 0.05 a step of 0.1 s may use up 5 % of 0.6 m, that is 3 cm, or 0.3 m/s. The person alone
# uses up 0.5 m/s. **-0.2 m/s** is left: the robot has to go back. As a formula (chapter 07):
#
# $$v \le \frac{\gamma h}{\Delta t} - v_{person}$$
#
# The limit is zero at $h = v_{person}\, \Delta t / \gamma$, here 1 m. Nearer than that a robot that stands still
# breaks the condition.
#
# **What do you think?** Does the robot turn back at 1 m, earlier, or later?

# %% jupyter={"source_hidden": true}
# Figure
log = making_room.ours
h, until = log.h[:, 0], int(np.argmax(log.states[:, 0] < 0))
stand = pace * settings.dt / gamma
turn = int(np.argmax(log.states[:, 2] < -0.02))
fig, ax = plt.subplots(figsize=(8, 3.8), layout="constrained")
ax.plot(h[:until], log.states[:until, 2], color=figures.BLUE, linewidth=2, label="robot, until it is out")
line = np.array([0.0, 1.2 * h[:until].max()])
ax.plot(line, gamma * line / settings.dt - pace, "--", color=figures.RED, label="limit: gamma h / dt - pace")
ax.axhline(0, color=figures.GREY, linewidth=0.8)
ax.plot(stand, 0, "o", color=figures.RED, label=f"the limit is 0 at h = {stand:.2f} m")
ax.set(xlabel="h to the person [m]", ylabel="speed ahead [m/s]", xlim=(line[1], 0), ylim=(-0.8, 0.8))
ax.set_title(f"It drives on, slows down, and turns back at h = {h[turn]:.2f} m")
ax.legend(loc="lower left")
record.figure(fig, "below-zero")

# %% jupyter={"source_hidden": true}
# Checks, and the answer
controller = szlib.MPCCBF(log.zones[0], walls=scenes["making_room"].walls, settings=settings)
step = controller.step(*log.controller_inputs(float(log.time[turn])))
ahead = find_admissible_controls(step).polygon.bounds[2]
evidence = f"at most {ahead:+.2f} m/s²"
record.check("as the robot turns back, every admissible acceleration leads back", ahead < 0, evidence)
Markdown(
    f"<details><summary>Answer</summary>\n\nAt h = {h[turn]:.2f} m; the formula says {stand:.2f} m. The condition "
    "must hold in the steps to come, too, so the robot stays a little below the line. As it "
    f"turns, the gentlest acceleration that obeys every row is {ahead:+.2f} m/s² ahead: all of them lead back.\n\n</details>"
)

# %% [markdown]
# ## Who goes first?
#
# The robot outside wants to go in. Let the person begin farther and farther away. **What do you think?** The robot
# needs about 7 s to the mouth, and 3 more to the other end. From which start of the person on does it go first?
# And what if it is just too late?

# %%
starts, firsts = (4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0), []
for start in starts:
    scene = replace(scenes["waiting"], people=(szlib.Person((start, 0.0), (-pace, 0.0)),))
    run = scenario_runs.drive(scene, choose_zone(record), settings)
    outside = run.time[run.states[:, 0] < 0]
    entries = run.time[np.argmax(run.states[:, 0] > 0)], outside[-1]
    firsts.append((start / pace, *entries, classify_strategy(run)))
firsts = pd.DataFrame(firsts, index=starts, columns=["person out", "robot in", "in for good", "robot"])

# %% jupyter={"source_hidden": true}
# Figure
goes_first = firsts.index[firsts["in for good"] < firsts["person out"]]
returns = firsts["in for good"] > firsts["robot in"] + 1
fig, ax = plt.subplots(figsize=(8, 3.8), layout="constrained")
ax.plot(starts, firsts["person out"], "--", color=figures.RED, label="the person leaves the passage")
ax.plot(starts, firsts["in for good"], "o-", color=figures.BLUE, label="the robot goes in for good")
first_try = firsts.loc[returns, "robot in"]
ax.plot(first_try, "x", color=figures.BLACK, markersize=8, label="it had gone in, and must come out")
ax.set(xlabel="start of the person, x [m]", ylabel="time [s]", ylim=(0, None))
ax.set_title(
    f"The robot goes first if the person starts at {goes_first.min():g} m or farther"
    if len(goes_first)
    else "The robot never goes first"
)
ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1), fontsize=9)
record.figure(fig, "who-first")

# %% jupyter={"source_hidden": true}
# The answer
late = firsts[returns]
Markdown(
    "<details><summary>Answer</summary>\n\nThe robot goes in whenever nothing holds it at the mouth. It sees "
    f"{settings.N * settings.dt:.1f} s ahead, not the length of the passage. "
    + (
        f"With {len(late)} of these {len(starts)} starts the person catches it inside: it goes in, comes out again, and goes in "
        f"for good {(late['in for good'] - late['person out']).mean():.0f} s after the person is out. "
        if len(late)
        else "With none of these starts the person catches it inside. "
    )
    + "A plan over the whole passage would avoid this.\n\n</details>"
)

# %% [markdown]
# ## How fast may the person come?
#
# The robot must go back as fast as the person comes, and be out of the passage in time. **What do you think?** Does
# the robot come nearer to a slow person or to a fast one? With which of them do some steps have no plan?

# %%
paces = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2)
rows = []
for each in paces:
    scene = AtlasCell("making_room", width=width, pace=each).scenario()
    run = scenario_runs.drive(scene, choose_zone(record), settings)
    rows.append((run.h[:, 0].min(), run.h[:, 1:].min(), run.metrics()["infeasible_steps"]))
to_person, to_wall, unsolved = np.array(rows).T

# %% jupyter={"source_hidden": true}
# Figure
fig, ax = plt.subplots(figsize=(7.5, 3.6), layout="constrained")
ax.plot(paces, 100 * to_person, "-", color=figures.BLUE, linewidth=1)
ax.plot(paces, 100 * to_wall, "s:", color=figures.BLACK, markersize=4, label="to the nearest wall")
kinds = (unsolved == 0, "o", figures.BLUE, "to the person; every step has a plan"), (
    unsolved > 0, "X", figures.RED, "to the person; some steps have none",
)  # fmt: skip
for chosen, marker, colour, label in kinds:
    ax.plot(np.array(paces)[chosen], 100 * to_person[chosen], marker, color=colour, markersize=9, label=label)
ax.axhline(0, color=figures.BLACK, linewidth=0.8)
failing = np.array(paces)[unsolved > 0]
ax.set_title(
    f"Steps without a plan: at {', '.join(f'{each:g}' for each in failing)} m/s"
    if failing.size
    else "Every step has a plan"
)
ax.set(xlabel="speed of the person [m/s]", ylabel="least h [cm]")
ax.legend(loc="lower right")
record.figure(fig, "paces")

# %% jupyter={"source_hidden": true}
# The answer
nearest = paces[int(to_person.argmin())]
Markdown(
    f"<details><summary>Answer</summary>\n\nIt comes nearest to the person who walks at {nearest:g} m/s: "
    f"{100 * to_person.min():.1f} cm. The limit is zero at h = speed x dt / gamma: the slower the person, the nearer the robot "
    "may come before it has to go back. "
    + (
        f"At {failing.min():g} m/s the run has steps without a plan: {unsolved[unsolved > 0][0]:.0f}. The robot itself "
        f"cannot go back faster than {settings.v_max:g} m/s."
        if failing.size
        else "No speed that was tried left it without a plan."
    )
    + "\n\n</details>"
)

# %% [markdown]
# ## All four scenarios: what is due to what?
#
# Chapters 09 to 11 drive each scenario by the paper's chain and by ours. Three things that can change these runs differ
# between them: the zone, the margin around walls, and the rule of the side (*side rule* in the table). **What do you think?** Which
# of them changes a run, and in which scenario? Each row of the table is the paper's chain with one of the three changed.

# %% jupyter={"source_hidden": true}
# Table
own = choose_zone(record), settings
papers = choose_paper_zone(record), scenario_runs.paper_settings(settings)
compared = chains.compare_chains(papers, own)
record.table(compared, "10_chains")
found = compared.set_index(["chain", "scenario"])
singles, names = ("zone", "margin", "side rule"), list(szlib.SCENARIOS)
cells = [[chains.describe_change(found, each, name) for name in names] for each in singles]
pd.DataFrame(cells, index=list(singles), columns=[name.replace("_", " ") for name in names]).style

# %% jupyter={"source_hidden": true}
# Checks
ruled = found.loc["side rule", "passing_side"][["passing", "corridor"]]
on_side = bool((ruled == settings.pass_side).all())
record.check("the rule alone makes the robot pass on the chosen side", on_side, ruled.to_dict())
lowest = compared.groupby("chain", sort=False)["min_h"].min()
record.check("h >= 0 with every chain of settings", lowest.min() >= 0, f"least h {lowest.min():.2f} m")

# %% [markdown]
# A dash means: no change of more than 0.25 s, 2 cm of h or 5 cm/s, and the same side and claims. On the plaza our
# zone alone changes the side, and so does the rule of the side alone. With the rule the side does not depend on the
# tilt of a zone
# ([chapter 9](09_passing.ipynb)).

# %% [markdown]
# ## Try it: who goes first
#
# Nothing has to be installed for this: the runs are recorded in the page. Choose, press *play*, step, or move the time
# line. The green area holds all accelerations that the robot may choose then, and the sentence says why it chose this one.
#
# **What do you think?** The passage is 1.6 to 2.4 m wide, and the person comes at 0.3 to 0.8 m/s. Where does the robot wait longest? Write it down, then look.

# %% jupyter={"source_hidden": true}
# The recorded laboratory
from laboratory import Axis, Recording, World


def meet_at_passage(width, pace):
    return World(AtlasCell("waiting", width=width, pace=pace).scenario(), zone)


zone = choose_zone(record)
axes = [Axis("width", "width [m]", (1.6, 2.4)), Axis("pace", "pace [m/s]", (0.3, 0.5, 0.8), 1)]
recording = Recording("A person comes out of a passage", meet_at_passage, axes, every=3)
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
    + ". It goes on when the person is out.\n\n</details>"
)

# %% [markdown]
# ## Three common mistakes
#
# - **"The robot knows that the person goes first."** No. It knows a zone, some walls and 0.8 s. Who goes first
#   follows from who is at the mouth.
# - **"A robot that stands is safe."** No. The zone moves with the person, and $h$ falls for a robot at rest, too.
# - **"Going back means that the controller has failed."** No. In the passage only going back obeys the barrier.

# %% jupyter={"source_hidden": true}
# What we know now
Markdown(
    "**What we know now.** Waiting and making room need no rule of their own: the robot waits where no acceleration that "
    f"obeys eq. 1 leads into the passage ({between:.1f} s after the person is out it goes in), and turns back just before the limit of its "
    f"speed is negative, which is nearer than h = {stand:.2f} m. "
    "Because it plans less than a second ahead, it sometimes goes in and has to come out again. "
    "So far there was one person. Many people, and walls that form a dead end, need more: chapter 12."
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

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
#     label: laboratory
#     paper: sec. 3-4
#     aim: try out a scene of your own, live, and hand its settings on.
#     row: '12'
#     needs:
#     - '07'
#     - '10'
#     week: 6
# ---

# %% [markdown]
# # 13 - The laboratory
#
# **Question.** What does the robot do if *you* put the person somewhere else, move the goal, narrow the
# corridor, or change gamma while it drives?
#
# **Expectation.** Each step has a reason: the chosen acceleration lies on the limit of a person, of a wall, or of the
# robot itself.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [12](12_among_people.ipynb) ·
# [paper](https://arxiv.org/abs/2405.15101): sec. 3-4 · 10 min · needs [07](07_barriers.ipynb) · needs
# [10](10_corridor.ipynb)
#
# **Afterwards you can** try out a scene of your own, live, and hand its settings on.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"

# %% jupyter={"source_hidden": true}
# Set-up, and the figure
import numpy as np
import pandas as pd
from laboratory import PRESETS, Laboratory, RobotOptions, World, draw_step, explain, is_interactive
from studies.lesson_zones import choose_zone

import szlib
from szlib.workbook.record import NotebookRecord

record = NotebookRecord("13_laboratory", globals(), plaza_zone=True)
zone = choose_zone(record)
still = World(PRESETS["corridor"], zone)
while still.n * still.dt < 4.0:
    still.advance()
fig = draw_step(still.steps[0])
fig.set_size_inches(9.5, 3.8)
fig.suptitle(explain(still.steps[0]).sentence, fontsize=11)
record.figure(fig, "still")

# %%
Laboratory(zone=zone) if is_interactive() else None

# %% [markdown]
# If you run this notebook (*Run > Run All Cells*), the laboratory appears above this text. The picture shows one moment of it. Choose a
# scene, press *play* or *step*, and move the time line to go back. Drag what you like, also while it runs: people, the tip of
# a person's arrow, the robot, its goal, the ends of walls. The green area holds all accelerations that the robot may choose
# now without paying a price. With `among_people()` it may pay one and choose another; then the sentence over the picture says
# so. Otherwise the sentence names the *active* limit, the one that holds the robot (chapter 10): it is the orange edge. *share*
# writes code that computes what is on the screen.

# %% [markdown]
# ## Things to try
#
# Say what you expect before you look.
#
# **1. Greed.** Scene *corridor*: drive once, then again with gamma = 0.5. Does the robot arrive sooner? At what price?
# <details><summary>What to expect</summary>It arrives about three seconds sooner. In the middle it brakes too late: "not safe"
# appears, and h of the person falls below 0.</details>
#
# **2. Foresight.** Keep gamma = 0.5 and raise N_h from 2 to 8. What changes?
# <details><summary>What to expect</summary>The robot obeys the barrier 0.8 s ahead instead of 0.2 s. The lowest h is about
# 13 cm higher, just above 0, and every step is safe.</details>
#
# **3. The paper's settings against `among_people()`.** Choose `MPCSettings.paper()`, and compare with
# `MPCSettings.among_people()` in *corridor*. (Items 3 and 9: chapter 12 explains `among_people()`, the settings with a longer
# horizon, ways and prices.)
# <details><summary>What to expect</summary>The paper's robot meets the person head-on, keeps the zone free, and needs
# a little more than 5 s longer. The other one plans 3 s ahead, and turns aside early. It may pay for a short way through the edge of the
# zone; then "not safe" appears. It touches nobody.</details>
#
# **4. A narrower corridor.** Drag the four ends of its walls to y = 1.8 and -1.8 m. Who goes first?
# <details><summary>What to expect</summary>The two do not fit side by side. The robot goes back, out of the corridor, lets
# the person out, and then goes on. h stays above 0.</details>
#
# **5. A person in a hurry.** Pull the person's arrow to 2 m/s, towards the robot. Are all steps safe?
# <details><summary>What to expect</summary>For a second or two no plan keeps h from falling faster than gamma allows: "not
# safe", although the robot escapes, and h stays above 0.</details>
#
# **6. A slow robot.** Scene *making_room*, v_max = 0.4 m/s, then 0.5 m/s. The person walks at 0.5 m/s.
# <details><summary>What to expect</summary>At 0.4 m/s the person catches up with the robot, and h falls below 0. At 0.5 m/s
# it does not.</details>
#
# **7. A goal that is taken.** Scene *passing*: drag the goal close to the person, and then onto a wall in *corridor*.
# <details><summary>What to expect</summary>The robot waits beside the person, and says that the goal cannot be reached. It
# does the same beside the wall.</details>
#
# **8. Out of nowhere.** *corridor*, at 2.5 s: drag the person to 1.5 m ahead of the robot, with an arrow of 0 m/s. Then go back
# on the time line, and try 2 m.
# <details><summary>What to expect</summary>At 1.5 m it is too late: h is below 0 at once. At 2 m there is no good plan either for a
# moment, but the robot passes with h above 0.</details>
#
# **9. Two doors.** Scene *two_doors*: drive with `MPCSettings()`, then with `MPCSettings.among_people()`. The ways of the
# robot are violet: the one that is taken solid, the others dashed.
# <details><summary>What to expect</summary>`MPCSettings()` looks for no ways, and waits before the person. With
# `among_people()` the robot takes the other door.</details>


# %% jupyter={"source_hidden": true}
# A scene with one change, without a screen
def try_scene(name, constructor="MPCSettings", at=0.0, edit=None, **settings):
    """Run a scene as the laboratory does, with one change at a time [s], for 40 s."""
    world, steps = World(PRESETS[name], zone, [RobotOptions(constructor, settings)]), []
    while not world.arrived and world.n < 400:
        if edit and world.n == round(at / world.dt):
            world.change(**edit)
        steps.append(world.steps[0])
        world.advance()
    low = min(step.h.min() for step in steps)
    unsafe, back = sum(not step.safe for step in steps), min(step.scene.state[0] for step in steps)
    row = {"time": world.n * world.dt, "least h": low, "steps not safe": unsafe, "least x": back}
    row |= {"arrived": world.arrived, "blocked": steps[-1].goal_blocked}
    return row | {"gap": min(step.clearance[:, 0].min() for step in steps)}


# %% [markdown]
# The notebook tries all of it, and checks what is written above:

# %% jupyter={"source_hidden": true}
# All of the above
narrow = {"walls": [[-6.0, 1.8, 7.0, 1.8], [-6.0, -1.8, 7.0, -1.8]]}
ahead = [{"people": {0: {"position": [x, 0.0], "speed": 0.0}}} for x in (-0.5, 0.0)]
tried = {
    "corridor": try_scene("corridor"),
    "1: gamma = 0.5": try_scene("corridor", gamma=0.5),
    "2: and N_h = 8": try_scene("corridor", gamma=0.5, N_h=8),
    "3: paper()": try_scene("corridor", "MPCSettings.paper"),
    "3: among_people()": try_scene("corridor", "MPCSettings.among_people"),
    "4: narrower": try_scene("corridor", edit=narrow),
    "5: 2 m/s": try_scene("corridor", edit={"people": {0: {"speed": 2.0}}}),
    "6: v_max = 0.4": try_scene("making_room", v_max=0.4),
    "6: v_max = 0.5": try_scene("making_room", v_max=0.5),
    "7: goal taken": try_scene("passing", edit={"goal": [0.8, 0.8]}),
    "7: goal on a wall": try_scene("corridor", edit={"goal": [4.0, 2.2]}),
    "8: 1.5 m ahead": try_scene("corridor", at=2.5, edit=ahead[0]),
    "8: 2 m ahead": try_scene("corridor", at=2.5, edit=ahead[1]),
    "9: two doors": try_scene("two_doors"),
    "9: among_people()": try_scene("two_doors", "MPCSettings.among_people"),
}
table = pd.DataFrame(tried).T
table[["time", "least h", "steps not safe", "arrived"]]

# %% jupyter={"outputs_hidden": true, "source_hidden": true}
# Checks
time, low, unsafe, back = (table[name].astype(float) for name in table.columns[:4])
held = {
    "1: sooner, but not safe": time.iloc[1] < time.iloc[0] - 2 and low.iloc[1] < 0 < unsafe.iloc[1],
    "2: foresight keeps h higher": low.iloc[2] > low.iloc[1] + 0.1
    and low.iloc[2] >= 0
    and not unsafe.iloc[2],
    "3: the paper's robot needs longer": time.iloc[3] > time.iloc[4] + 2 and not unsafe.iloc[3],
    "3: both touch nobody": table["gap"].iloc[3:5].min() > 0,
    "4: the robot leaves the corridor": back.iloc[5] < -6 and low.iloc[5] >= 0 and table["arrived"].iloc[5],
    "5: not safe, and h stays above 0": unsafe.iloc[6] > 5 and low.iloc[6] > 0,
    "6: a slower robot is caught": low.iloc[7] < 0 <= low.iloc[8],
    "7: the robot waits beside its goal": table["blocked"].iloc[9:11].all()
    and not table["arrived"].iloc[9:11].any(),
    "8: 1.5 m is too late, 2 m is not": low.iloc[11] < 0 <= low.iloc[12] and unsafe.iloc[12] > 0,
    "9: only among_people() takes the second door": table["arrived"].iloc[13:].tolist() == [False, True],
}
for what, holds in held.items() if record.cache.is_synthetic else ():
    record.check(what, bool(holds))

# %% [markdown]
# And what is shown live is what `szlib.simulate` computes, step by step:

# %% jupyter={"source_hidden": true}
# Checks
log = szlib.simulate(PRESETS["corridor"], szlib.MPCCBF(zone, walls=PRESETS["corridor"].walls))
trial, same = World(PRESETS["corridor"], zone), []
for state in log.states:
    same.append(np.array_equal(trial.states[0], state))
    trial.advance()
record.check(
    "the steps of the laboratory are those of szlib.simulate", all(same), f"{len(same)} states", always=True
)
record.key |= {"gamma = 0.5: min_h": low.iloc[1], "among_people: time_to_goal": time.iloc[4]}

# %% [markdown]
# **What it means.** h is the distance that is left to the zone, and gamma is the share of it that a step may use up. Most
# of the time the chosen acceleration lies on the edge of a limit: this edge answers the question "why did the robot do this?".
# This is the last chapter. You can now build a controller of your own: the [final project](project/README.md).

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

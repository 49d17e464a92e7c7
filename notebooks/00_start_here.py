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
#     paper: all
#     aim: choose a route, and take the first step.
# ---

# %% [markdown]
# # Start here
#
# **Question.** How near do people let each other come, and how does a robot keep that distance?
#
# **Expectation.** J. Jang and M. Ghaffari learn a *minimum social zone* from recorded people. Their controller keeps a robot
# out of the zone of each person. This workbook rebuilds the method step by step, and measures each claim of the paper.

# %% [markdown]
# next: [1 - Tracks and the area](01_tracks.ipynb) · [paper](https://arxiv.org/abs/2405.15101): all · 10 min
#
# **Afterwards you can** choose a route, and take the first step.

# %% [markdown]
# | Synthetic: a robot makes room for a person | Recorded: one day of the ATC mall in Osaka |
# |---|---|
# | <img src="figures/making_room.gif" alt="A robot in a passage makes room for a person, then goes on" width="520"> | <img src="figures/mall.png" alt="Where people walked in the mall on one day, and the area in which encounters are found" width="520"> |
#
# By default everything runs on a *synthetic plaza*: its people are computed, and we know the zone that they keep. The mall is a
# real place, recorded on 2012-10-24. Nobody knows the true zone there, and each person has one position a second. In an
# *encounter* two people meet, and nobody else is near. The day has 252 encounters; 101 are of *companions*, who walk close by
# choice. The verdict on the zone of the day is *undecided*: its tracker loses people who are near each other. The folder `real_day` holds chapters 01 to 06, 09 to 11 and notebook 28, executed on that day: [tracks](real_day/01_tracks.ipynb), [distances](real_day/05_zones.ipynb), [respect,
# and the zone](real_day/06_respect.ipynb).

# %% [markdown]
# ## Readers, and what you need to know
#
# For final-year students of robotics, control or pedestrian dynamics, for researchers with tracks or a robot, and for lecturers.
# You read Python (NumPy, pandas), and know vectors and matrices, eigenvectors, derivatives, least squares, means, standard
# deviations, quantiles and the exponential distribution. No data has to be fetched.
#
# - Notebooks 01 to 13 are the *chapters*: each builds on earlier ones. Control theory begins in chapter 07. Notebooks 21 to 29,
#   in the folder `deeper`, answer further questions.
# - A *check* must hold, or the run fails. A *claim* of the paper is measured, and may be "not supported here".
# - Code that only draws or records is hidden: click on the bar left of a cell to see it.

# %% [markdown]
# ## Three routes
#
# - **The idea.** [05](05_zones.ipynb), [06](06_respect.ipynb), [07](07_barriers.ipynb), [09](09_passing.ipynb), [10](10_corridor.ipynb), [13](13_laboratory.ipynb): 3 h 00 min to read.
# - **The method.** [01](01_tracks.ipynb), [02](02_encounters.ipynb), [03](03_outliers.ipynb), [04](04_hull.ipynb), [05](05_zones.ipynb), [06](06_respect.ipynb), [07](07_barriers.ipynb), [08](08_build_a_controller.ipynb), [09](09_passing.ipynb), [10](10_corridor.ipynb), [11](11_waiting.ipynb), [12](12_among_people.ipynb): 6 h 35 min to read.
# - **The course, in six weeks.** Reading and exercises; running and looking around come on top.
#
# | week | topic | notebooks | to read | exercises | to do |
# |---|---|---|---|---|---|
# | 1 | Tracks, encounters, and which of them to believe | [01](01_tracks.ipynb), [02](02_encounters.ipynb), [03](03_outliers.ipynb) | 1 h 10 min | [1.1-1.5](exercises/sheet1_tracks.ipynb#1.1-Velocity-(5-min)), [2.1-2.5](exercises/sheet2_outliers.ipynb#2.1-Complementary-coordinates-(5-min)) | 2 h 05 min |
# | 2 | From samples to a zone; respect or emptiness | [04](04_hull.ipynb), [05](05_zones.ipynb), [06](06_respect.ipynb) | 1 h 30 min | [3.1-3.8](exercises/sheet3_zones.ipynb#3.1-A-slice-by-hand-(10-min)) | 1 h 55 min |
# | 3 | A zone of your own, and a barrier around it | [07](07_barriers.ipynb) | 50 min | [4.1-4.3](exercises/sheet4_own_zone.ipynb#4.1-A-zone-of-your-own-(an-evening,-150-min)) | 2 h 45 min |
# | 4 | A controller of your own | [08](08_build_a_controller.ipynb) | 45 min | [5.1-5.8](exercises/sheet5_barriers.ipynb#5.1-Focal-distance-(15-min)) | 2 h 15 min |
# | 5 | MPC with barriers, and the first meetings | [09](09_passing.ipynb), [10](10_corridor.ipynb) | 55 min | [6.1-6.5](exercises/sheet6_controller.ipynb#6.1-MPC-on-a-road-(25-min)) | 2 h 15 min |
# | 6 | The robot yields, and drives among people | [11](11_waiting.ipynb), [12](12_among_people.ipynb), [13](13_laboratory.ipynb) | 1 h 35 min | [7.1-7.5](exercises/sheet7_robot.ipynb#7.1-gamma-by-experiment-(40-min)) | 1 h 45 min |

# %% [markdown]
# ## The first step
#
# Open [1 - Tracks](01_tracks.ipynb), and choose *Run > Run All Cells*. Then open the hidden cell *Parameters of this
# notebook* near its top, change `seed`, and run again. This does not change what `szlib run` has recorded.
#
# An exercise is a function that you write. `judges.check("velocity", velocity)` tests it on random cases, and says in words
# what is wrong; `judges.hint("velocity", 1)` gives a hint. Each sheet ends with an essay. Solutions and rubrics are in
# `solutions`. In the [final project](project/README.md) a controller of yours meets people in hidden worlds. For a class, `python notebooks/tools/sheets.py --class FOLDER` makes a course of
# [nbgrader](https://nbgrader.readthedocs.io), with a README for the lecturer.

# %% [markdown]
# ## Where to look things up
#
# - [Reference](reference.md): all notebooks, words, symbols and parameters; what is not in the paper; related work.
# - [Which estimator, which settings?](which_settings.md): for tracks or a robot of your own.
#
# JupyterLab opens both as text: click on it with the right button, and choose *Show Markdown Preview*.
#
# - Open it without installing: [Binder](https://mybinder.org/v2/gh/OWNER/szlib/main?labpath=notebooks/00_start_here.ipynb), or
#   [Colab](https://colab.research.google.com/github/OWNER/szlib/blob/main/notebooks/00_start_here.ipynb), where a first cell has to be
#   `!git clone https://github.com/OWNER/szlib && pip install ./szlib[workbook]`, then `%cd szlib/notebooks`. (OWNER stands for the
#   public address, which is still to come.)
# - JupyterLab lists each notebook twice. `.ipynb` is the one to open: it holds the pictures. `.py` is its text: for comparing
#   versions, for searching, and for editors. Saving one changes the other.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"

# %% jupyter={"source_hidden": true}
# Is everything here?
import szlib
from szlib.workbook import folders
from szlib.workbook.record import NotebookRecord, read_table

record = NotebookRecord("00_start_here", globals())
sheets = [file.read_text(encoding="utf-8") for file in folders.NOTEBOOKS.glob("exercises/sheet*.py")]
n_exercises = record.key["exercises"] = sum(sheet.count("\njudges.check(") for sheet in sheets)
print(f"szlib {szlib.__version__}: {len(folders.list_notebooks())} notebooks, {n_exercises} exercises")
sites = (
    read_table("06_sites").query("site == 'atc-1hz' and min_distance == 1").set_index("kinds")["encounters"]
)
companions = sites["all"] - sites["strangers"]
found = f"{companions} of {sites['all']} encounters"
record.check("the text states the encounters of the recorded day", found == "101 of 252 encounters", found)

# %% [markdown]
# **What it means.** The workbook follows one question from tracks to a robot, one step in each chapter. Go on with
# [chapter 01](01_tracks.ipynb), or with the route that fits your time.

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

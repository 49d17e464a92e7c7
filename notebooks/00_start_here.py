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
# # Start here
#
# **Question.** How near do people come to each other, and how does a robot keep out of that place?
#
# **Expectation.** J. Jang and M. Ghaffari answer both in *Social Zone as a Barrier Function for
# Socially-Compliant Robot Navigation*: learn the *minimum social zone* from recorded people, then drive
# the robot by model predictive control with a barrier around every person. This workbook follows them
# step by step, fills what the paper leaves open, and says where data does not support a claim.
#
# ![The minimum social zone at 1.1 m/s, learned from synthetic people](figures/zone.png)
# ![A robot makes room for a person in a passage, then goes on](figures/making_room.gif)

# %% [markdown]
# next: [1 - Tracks and the area](01_tracks.ipynb) · [paper](https://arxiv.org/abs/2405.15101): all · 35 min
#
# **Afterwards you can** choose a route, and find any notebook, word or symbol again.

# %% [markdown]
# ## For whom, and what you need
#
# For students of robotics, control or pedestrian dynamics in their last year, for researchers who want to
# use the method on their own data or robot, and for lecturers. You should read Python (NumPy, pandas) and
# know vectors, derivatives, and what a mean and a quantile are. Control theory is explained from the
# beginning in notebook 07. Of the tools you need only this repository: the README's two commands set it
# up. No data has to be fetched: by default everything runs on a synthetic plaza whose true zone is known.
#
# Each notebook begins with a question and an expectation, asks its data, and ends with what it means. A
# *check* must hold, or the run fails; a *claim* of the paper is measured, and may turn out "not supported
# here". Every parameter has a badge: **paper**, **assumed**, **measured** or **tuned**. Change the values of the cell
# below the imports, and run: nothing that you do here changes what `szlib run` has recorded.

# %%
import szlib
from szlib.workbook import folders
from szlib.workbook.record import NotebookRecord

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"

# %%
record = NotebookRecord("00_start_here", globals())
sheets = [file.read_text(encoding="utf-8") for file in folders.NOTEBOOKS.glob("exercises/sheet*.py")]
record.key["exercises"] = sum(sheet.count("\njudges.check(") for sheet in sheets)
n_exercises = record.key["exercises"]
print(f"szlib {szlib.__version__}: {len(folders.list_notebooks())} notebooks, {n_exercises} exercises")
ours, paper = szlib.MPCSettings(), szlib.MPCSettings.paper()
for settings in (ours, paper):
    numbers = (settings.dt, settings.N, settings.N_h, settings.v_max, settings.r_robot, settings.eps)
    record.check(
        "the table of parameters has the numbers of szlib", numbers == (0.1, 8, 2, 1, 0.5, 0.05), numbers
    )
assumed = (ours.gamma, ours.Q, ours.R, ours.P, ours.a_max, ours.pass_side)
expected = (0.05, (10, 10, 1, 1), (1, 1), (100, 100, 10, 10), 1, "right")
record.check(
    "the table of parameters has the numbers of szlib where the paper gives none",
    assumed == expected,
    assumed,
)

# %% [markdown]
# ## The map
#
# | notebook | question | to read |
# |---|---|---|
# | [1 - Tracks and the area](01_tracks.ipynb) | Where do people walk, how fast, and where is there open space enough to watch two of them meet without a wall or a shop in the way? | 25 min |
# | [2 - Encounters of two people](02_encounters.ipynb) | When do two people meet with nobody else around, and what does each see of the other? | 30 min |
# | [3 - Outliers](03_outliers.ipynb) | Some people brush past each other, and some tracks are wrong. Which samples say nothing about the distance that people keep? | 40 min |
# | [4 - The hull and its slices](04_hull.ipynb) | From scattered samples to a boundary: how near did people come, in each direction, at each walking speed? | 25 min |
# | [5 - Social zones](05_zones.ipynb) | Can a robot carry the zone along? | 35 min |
# | [6 - Respect or emptiness?](06_respect.ipynb) | Around a walking person there is a place where nobody is. Do people keep out of it, or is it only rare that two of them are anywhere near each other? | 60 min |
# | [7 - Barriers: how fast may the robot approach?](07_barriers.ipynb) | The zone says where the robot must not be. How fast may it come closer? | 35 min |
# | [8 - Build the controller yourself](08_build_a_controller.ipynb) | What does it take to turn the barrier condition of notebook 07 into a robot that drives? | 50 min |
# | [9 - Passing a person who stands](09_passing.ipynb) | A person stands in the way and looks at the robot. When does the robot begin to go around them, and what decides that? | 65 min |
# | [10 - Meeting in a narrow corridor](10_corridor.ipynb) | A person walks towards the robot in a corridor. There is room for both, but not much. Who slows the robot down: the person, or the wall? | 35 min |
# | [11 - Yielding by waiting](11_waiting.ipynb) | A passage is too narrow for two, and a person is in it. The robot has no rule of priority. Why does it wait, and what does waiting look like to a solver? | 35 min |
# | [11b - Yielding by making room](11b_making_room.ipynb) | This time the robot is *in* the passage when the person comes. It wants to go ahead. What makes it go back? | 45 min |
# | [12 - Other people's crowds](12_among_people.ipynb) | So far people walked straight ahead. How does the robot do among simulated people, who react to it by models of walking from the literature, and among recorded people, who do not react? | 80 min |
# | [13 - The laboratory](13_laboratory.ipynb) | What does the robot do if *you* put the person somewhere else, move the goal, narrow the corridor, or change gamma while it drives? | 10 min |
# | [21 - Feasibility](deeper/21_feasibility.ipynb) | A hard constraint is a promise only while the problem has a solution. When does it lose it, what happens then, and can one have a promise that is kept for ever? | 40 min |
# | [22 - The distances, audited](deeper/22_distances.ipynb) | The barriers use *approximate* distances to zones and walls, and a margin of 5 cm "since the approximated distance function contains some errors" (sec. 4). Where do they err, to which side, and is the margin enough? | 30 min |
# | [23 - Against everything else](deeper/23_comparison.ipynb) | Is the fitted ellipse worth its trouble? | 30 min |
# | [24 - Data quality](deeper/24_data_quality.ipynb) | Before anything is learned from a file of tracks: can it be trusted, and which days are unlike the others? | 40 min |
# | [25 - What is true?](deeper/25_claims.ipynb) | What does the paper claim, and what of it does the data support? | 80 min |
# | [26 - Eleven meetings](deeper/26_meetings.ipynb) | Robots that drive among people are tried in named meetings: head-on, in a doorway, around a corner. What does the controller do in each, against what others would use - and where is it bad? | 40 min |
# | [27 - A sensitivity atlas](deeper/27_atlas.ipynb) | Notebooks 10 to 11b show one corridor, one passage, one pace, one zone. What would the robot have done in others? | 35 min |
# | [28 - From sentence to verdict](deeper/28_sentences.ipynb) | Which sentences of the paper say something that can be checked, and does each of them hold? | 10 min |

# %% [markdown]
# ## Three routes
#
# - **An hour: the idea.** [02](02_encounters.ipynb), [05](05_zones.ipynb), [07](07_barriers.ipynb), [10](10_corridor.ipynb), [13](13_laboratory.ipynb): 2 h 25 min to read.
# - **A day: the method.** [01](01_tracks.ipynb), [02](02_encounters.ipynb), [03](03_outliers.ipynb), [04](04_hull.ipynb), [05](05_zones.ipynb), [06](06_respect.ipynb), [07](07_barriers.ipynb), [08](08_build_a_controller.ipynb), [09](09_passing.ipynb), [10](10_corridor.ipynb), [11](11_waiting.ipynb), [11b](11b_making_room.ipynb), [12](12_among_people.ipynb): 9 h 20 min to read.
# - **Six weeks: the course.** Running and looking around come on top.
#
# | week | topic | notebooks | to read | exercises | to do |
# |---|---|---|---|---|---|
# | 1 | Tracks, encounters, and which of them to believe | [01](01_tracks.ipynb), [02](02_encounters.ipynb), [03](03_outliers.ipynb) | 1 h 35 min | [1.1-1.5](exercises/sheet1_tracks.ipynb#1.1-Velocity-(5-min)), [2.1-2.5](exercises/sheet2_outliers.ipynb#2.1-Complementary-coordinates-(5-min)) | 2 h 05 min |
# | 2 | From samples to a zone; respect or emptiness | [04](04_hull.ipynb), [05](05_zones.ipynb), [06](06_respect.ipynb) | 2 h 00 min | [3.1-3.3](exercises/sheet3_zones.ipynb#3.1-A-slice-by-hand-(10-min)), [4.1-4.5](exercises/sheet4_certainty.ipynb#4.1-The-quantile-zone-in-one-direction-(10-min)) | 1 h 55 min |
# | 3 | A zone of your own, and a barrier around it | [07](07_barriers.ipynb) | 35 min | [3.4-3.5](exercises/sheet3_zones.ipynb#3.4-A-zone-of-your-own-(an-evening,-150-min)), [6.1](exercises/sheet6_robot.ipynb#6.1-The-speed-limit-(5-min)) | 2 h 45 min |
# | 4 | A controller of your own | [08](08_build_a_controller.ipynb) | 50 min | [5.1-5.5](exercises/sheet5_barriers.ipynb#5.1-Focal-distance-(15-min)), [7.1-7.3](exercises/sheet7_controller.ipynb#7.1-A-filter-on-a-road-(15-min)) | 2 h 15 min |
# | 5 | MPC with barriers, and the first meetings | [09](09_passing.ipynb), [10](10_corridor.ipynb) | 1 h 40 min | [7.4-7.8](exercises/sheet7_controller.ipynb#7.4-MPC-on-a-road-(25-min)) | 2 h 15 min |
# | 6 | The robot yields, and drives among people | [11](11_waiting.ipynb), [11b](11b_making_room.ipynb), [12](12_among_people.ipynb), [13](13_laboratory.ipynb) | 2 h 50 min | [6.2-6.5](exercises/sheet6_robot.ipynb#6.2-gamma-by-experiment-(40-min)) | 1 h 25 min |

# %% [markdown]
# **The exercises** are functions that you write. `judges.check("velocity", velocity)` asks yours for many cases
# that it draws afresh and says in words what is right or wrong; a case that fails can be run again with its
# seed. `judges.hint("velocity", 1)` gives a hint. On sheet 7 the check drives a robot with your controller.
# Each sheet ends with an essay question. The solutions, with a rubric for each essay, are in `solutions/`, the
# judges in `exercises/judges`. For a class, `python notebooks/tools/sheets.py --class FOLDER` makes a course of
# [nbgrader](https://nbgrader.readthedocs.io) (`pip install nbgrader`), with a README for the lecturer: what is
# handed out, checks that give points, one for each minute, and the command that grades.

# %% [markdown]
# ## Words
#
# | word | meaning | first used in |
# |---|---|---|
# | ATC | a shopping mall in Osaka whose visitors were tracked on 92 days | [01](01_tracks.ipynb) |
# | attentional space | the 4 m by 5 m ahead of a person that are watched for others | [02](02_encounters.ipynb) |
# | barrier function | h: 0 at the edge of what is allowed, positive inside of it | [07](07_barriers.ipynb) |
# | bootstrap | draw people anew from those there are, many times, to see how far a result moves | [23](deeper/23_comparison.ipynb) |
# | CBF-QP | a quadratic program for one step: as near to the wanted control as the barrier allows | [07](07_barriers.ipynb) |
# | class K | of a function, as gamma in the paper's eq. 1: it is 0 at 0 and grows; here it is gamma times h | [07](07_barriers.ipynb) |
# | complementary distance | r' = r_max - r, large for who is near | [03](03_outliers.ipynb) |
# | EWAP | the walking pedestrians recorded at ETH Zürich, and the format of their files, `obsmat` | [01](01_tracks.ipynb) |
# | exact penalty | a price on violations so high that none is paid where a solution without violations exists | [21](deeper/21_feasibility.ipynb) |
# | fallback | which of the controller's ways to a control was taken: hard, relaxed, shifted, braking | [21](deeper/21_feasibility.ipynb) |
# | funnel | how many rows came in, went on, and why the others did not | [01](01_tracks.ipynb) |
# | horizon | the number of steps that a plan looks ahead, N, or that obey the barrier, N_h | [08](08_build_a_controller.ipynb) |
# | hull | the smallest convex body around points | [04](04_hull.ipynb) |
# | infeasible | of a step: no plan obeys all rows, so one that violates them least is taken, and flagged | [09](09_passing.ipynb) |
# | IPOPT | the solver for nonlinear optimisation that the paper uses | [08](08_build_a_controller.ipynb) |
# | jerk | the change of acceleration by time | [12](12_among_people.ipynb) |
# | line-of-sight angle | LOS: where the other person is, seen from the reference pedestrian | [02](02_encounters.ipynb) |
# | LOF | local outlier factor: how isolated a sample is, compared with its neighbours | [03](03_outliers.ipynb) |
# | MPC | model predictive control: plan some steps ahead, take the first, plan again | [08](08_build_a_controller.ipynb) |
# | null model | the same people, each moved in time, so that they ignore each other | [06](06_respect.ipynb) |
# | ORCA | a model of walking: each of two people takes half of what keeps them apart | [12](12_among_people.ipynb) |
# | plaza | synthetic people whose zone is known, to prove the method on | [01](01_tracks.ipynb) |
# | precision, recall | of what was removed, the share that should be; of what should be, the share that was | [03](03_outliers.ipynb) |
# | quantile zone | what all but a share q of encounters keep out of | [05](05_zones.ipynb) |
# | reference pedestrian | the one of two people from whom the other is looked at | [02](02_encounters.ipynb) |
# | respect zone | the ellipse that careful people keep out of, compared with people who ignore each other | [06](06_respect.ipynb) |
# | slack | by how much a row is violated | [08](08_build_a_controller.ipynb) |
# | social force | people who are pushed by others and by walls, and drawn to their goal | [12](12_among_people.ipynb) |
# | SQP | sequential quadratic programming: solve quadratic problems in a row, each around the last answer | [08](08_build_a_controller.ipynb) |
# | tidy | of a table: one row for each observation, one column for each quantity | [01](01_tracks.ipynb) |
# | window | the 3 s for which two people are watched | [02](02_encounters.ipynb) |

# %% [markdown]
# ## Symbols
#
# | paper | meaning | here, in code |
# |---|---|---|
# | $r_{max}$ | distance within which people count, 2 m | `szlib.zones.outliers.R_MAX` |
# | $r' = r_{max} - r$ | complementary distance | `szlib.zones.outliers.complementary_points` |
# | 4 m x 5 m | attentional space | `szlib.AttentionalSpace` |
# | $a, b, (m, n), \theta$ | semi-axes, centre, angle of a zone | `szlib.Ellipse` |
# | $\mathbf{c}_a, \mathbf{c}_b$ | foci | `szlib.Ellipse.foci` |
# | $g, t, d$ (eq. 3-5) | distance to a wall | `szlib.segment_distance` |
# | $d$ (eq. 7) | distance to a zone | `szlib.ellipse_distance` |
# | $h = d - r_r - \epsilon$ | barrier | `szlib.control.barriers.barrier` |
# | $\Delta h \ge -\gamma h$ (eq. 1) | barrier condition | `szlib.control.barriers.cbf_residual` |
# | $\gamma$ | share of h that a step may use up | `szlib.MPCSettings.gamma` |
# | $N, N_h$ | steps of the plan; steps under barriers | `szlib.MPCSettings.N`, `szlib.MPCSettings.N_h` |
# | $P, Q, R$ | weights of the end, the way, the control | `szlib.MPCSettings.P`, `szlib.MPCSettings.Q`, `szlib.MPCSettings.R` |
# | $\Delta t$ | time step, 0.1 s | `szlib.MPCSettings.dt` |
# | $r_r, \epsilon$ | robot's radius, margin | `szlib.MPCSettings.r_robot`, `szlib.MPCSettings.eps` |
# | $\mathbf{x} = (x, y, v_x, v_y)$ | state of the robot | `szlib.SimulationLog.table` |
# | $\mathbf{u} = (f_x, f_y)$ | control, an acceleration | `szlib.Step` |

# %% [markdown]
# ## Parameters
#
# | parameter | value | badge |
# |---|---|---|
# | attentional space; window; smallest distance at the opening; smallest speed | 4 m x 5 m ahead; 3 s; 1 m; 0.4 m/s | paper ("ahead": assumed) |
# | the other person | inside the space at the opening | assumed |
# | area of the ATC mall | x -18.5 to -7.5 m, y -10 to 8 m | assumed |
# | clock; velocity from the displacement over | 0.1 s; +-0.5 s | assumed |
# | gap that ends a track | 0.5 s in raw files, 1.6 s at 1 Hz | measured |
# | $r_{max}$ | 2 m | paper |
# | outliers: encounters nearer than half of all, with a local outlier factor above | 2, among 2 % of all (at least 20) | measured |
# | outliers by samples (`fraction=0.002, n_neighbours=20`): share; neighbours | 0.2 %; 20 | paper; assumed |
# | zone that the robot keeps | the one at 1.1 m/s | paper |
# | time step; N; $N_h$; speed limit (Euclidean) | 0.1 s; 8; 2; 1 m/s | paper |
# | robot radius; margin $\epsilon$ | 0.5 m; 0.05 m, more at the ends of short walls ($r^2 / L$) | paper; measured |
# | quantile q; encounters needed on each side | 5 %; 20 | assumed |
# | companions; shifts of the null model | see notebook 06; 1 to 10 min | measured; assumed |
# | gamma | 0.05 | tuned on the four scenarios |
# | Q; R; P | diag(10, 10, 1, 1); I; 10 Q | assumed |
# | acceleration limit per axis | 1 m/s2 | assumed |
# | side on which a head-on person is passed | right | assumed |
# | solver | SQP (IPOPT is the paper's) | measured |
# | places in the four scenarios | as in `szlib.SCENARIOS` | assumed |

# %% [markdown]
# ## References
#
# - J. Jang, M. Ghaffari: Social zone as a barrier function for socially-compliant robot navigation, 2024.
#   [arXiv:2405.15101](https://doi.org/10.48550/arXiv.2405.15101)
# - D. Brščić, T. Kanda, T. Ikeda, T. Miyashita: Person tracking in large public spaces using 3-D range sensors,
#   2013. [10.1109/THMS.2013.2283945](https://doi.org/10.1109/THMS.2013.2283945)
# - M. Breunig, H.-P. Kriegel, R. Ng, J. Sander: LOF: identifying density-based local outliers, 2000.
#   [10.1145/342009.335388](https://doi.org/10.1145/342009.335388)
# - B. Gärtner, S. Schönherr: Smallest enclosing ellipses - fast and exact. Report B 97-03, Freie Universität
#   Berlin, 1997 (no DOI).
# - V. Shapiro, I. Tsukanov: Implicit functions with guaranteed differential properties, 1999.
#   [10.1145/304012.304038](https://doi.org/10.1145/304012.304038)
# - A. Ames, S. Coogan, M. Egerstedt, G. Notomista, K. Sreenath, P. Tabuada: Control barrier functions: theory and
#   applications, 2019. [10.23919/ECC.2019.8796030](https://doi.org/10.23919/ECC.2019.8796030)
# - J. Zeng, B. Zhang, K. Sreenath: Safety-critical model predictive control with discrete-time control barrier
#   function, 2021. [10.23919/ACC50511.2021.9483029](https://doi.org/10.23919/ACC50511.2021.9483029)
# - A. Wächter, L. Biegler: On the implementation of an interior-point filter line-search algorithm for large-scale
#   nonlinear programming, 2006. [10.1007/s10107-004-0559-y](https://doi.org/10.1007/s10107-004-0559-y)
# - S. Pellegrini, A. Ess, K. Schindler, L. Van Gool: You'll never walk alone, 2009.
#   [10.1109/ICCV.2009.5459260](https://doi.org/10.1109/ICCV.2009.5459260)
# - M. Moussaïd and others: Experimental study of the behavioural mechanisms underlying self-organization in human
#   crowds, 2009. [10.1098/rspb.2009.0405](https://doi.org/10.1098/rspb.2009.0405)
# - A. Francis and others: Principles and guidelines for evaluating social robot navigation algorithms, 2025.
#   [10.1145/3700599](https://doi.org/10.1145/3700599)
# - E. T. Hall: The hidden dimension. Doubleday, 1966 (no DOI).

# %% [markdown]
# ## Related work
#
# What else there is, by its documentation and source code in 2026. Only `szlib` goes from tracks to a zone with its
# uncertainty and on to a controller; it is neither a planner nor a simulator of crowds nor a general toolbox for control.
#
# | project | what it does | what it does not |
# |---|---|---|
# | [PedPy](https://pedpy.readthedocs.io) | density, speed, flow, Voronoi cells, profiles and pair distributions from tracks; reads the files of five simulators | zones by direction and speed; robots |
# | [OpenTraj](https://github.com/crowdbotp/OpenTraj) | loads a dozen data sets of tracks, and describes them: density, entropy, smallest distances to others | encounters of two, intervals; robots |
# | [cbfpy](https://github.com/danielpmorton/cbfpy) | filters the control of one step by a quadratic program (JAX); the user writes the dynamics and the barrier | a horizon; people and their zones |
# | [do-mpc](https://www.do-mpc.com) | model predictive control and state estimation of any model (CasADi), robust and with multiple stages | barriers that are ready to use; people and their zones |
# | [HuNavSim](https://github.com/robotics-upo/hunav_sim) | people who walk by a social force model and react to a robot, in ROS 2 with Gazebo; metrics | zones from data; a controller for the robot |
# | [CrowdNav](https://github.com/vita-epfl/CrowdNav) | trains and tests policies of a robot among simulated people (ORCA) by reinforcement learning | real tracks; constraints that hold at every step |
# | [Social-Neural-CBF](https://github.com/dohjh0219/Social-Neural-CBF) | the paper's elliptical barrier, and a network that learns it, in a controller; it aims at the ATC data | its code reads no tracks: the axes are set by hand, and the network learns from samples of that barrier |

# %% [markdown]
# **What it means.** One question, a story of notebooks in order, and an exercise sheet for each part of it. Go on with
# [notebook 01](01_tracks.ipynb), or with the route that fits your time.
# Tracks or a robot of your own? [Which estimator, which settings](which_settings.md) answers in tables.

# %%
record.close()

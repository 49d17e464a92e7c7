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
#     label: sentences
#     paper: all
#     aim: find each sentence of the paper with its code, its cell and its verdict.
#     row: '25'
# ---

# %% [markdown]
# # 28 - From sentence to verdict
#
# **Question.** Which sentences of the paper can be checked, and which of them hold?
#
# **Expectation.** What the paper defines is implemented, or altered for a reason that is given. Its claims about the
# robot hold with the paper's settings, and with some others. Comfort cannot be tested here.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [27](27_atlas.ipynb) · next: [29 - Crowds and recorded
# people](29_crowds.ipynb) · [paper](https://arxiv.org/abs/2405.15101): all · 15 min
#
# **Afterwards you can** find each sentence of the paper with its code, its cell and its verdict.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"

# %% jupyter={"source_hidden": true}
# Imports, and the record of the run
import sys

import matplotlib.pyplot as plt
from IPython.display import HTML, Markdown, display

sys.path.append("..")  # for `studies`
from studies import paper_matrix

from szlib.workbook import claims, figures
from szlib.workbook.record import NotebookRecord
from szlib.workbook.record.display import style_table

record = NotebookRecord("28_sentences", globals())
drawn = f"source == '{paper_matrix.PLAZAS}'"
zones = record.committed_table("28_zones", paper_matrix.recompute_zone, where=drawn)
driven = f"scenario != '{paper_matrix.NO_SCENARIO}' or {drawn}"
matrix = record.committed_table("28_matrix", paper_matrix.recompute, where=driven)
verdicts = claims.judge_claims(matrix)
is_ours = verdicts["claim"].str.contains("(ours", regex=False)
for row in verdicts.to_dict("records"):
    evidence = f"share {row['share']:.2f} ({row['low']:.2f} to {row['high']:.2f}), {row['zones']} zones"
    record.claim(row["claim"], row["verdict"], evidence)
every = claims.judge_sentences(claims.read_checks(record))
is_stress = every["kind"] == "stress"
sentences, stress = every[~is_stress].copy(), every[is_stress]
counts = sentences["verdict"].value_counts()
judged = sentences[sentences["verdict"] != claims.NOT_RUN]
n_not_run = len(sentences) - len(judged)

# %% jupyter={"source_hidden": true}
# Figure
COLOURS = {"supported": figures.GREEN, "implemented": figures.BLUE, "not supported": figures.RED}
COLOURS |= {"mostly supported": figures.GREEN, "implemented, by test": figures.BLUE}
fig, ax = plt.subplots(figsize=(8, 0.4 * len(counts) + 0.9), layout="constrained")
bars = ax.barh(counts.index, counts, color=[COLOURS.get(name, figures.GREY) for name in counts.index])
ax.bar_label(bars, padding=3)
ax.invert_yaxis()
ax.set(xlabel="sentences of the paper", xlim=(0, 1.1 * counts.max()))
good = sum(counts.get(name, 0) for name in ("supported", "implemented", "implemented, by test"))
title = f"{good} of {len(judged)} sentences are supported or implemented as they stand"
left_out = f";\n{n_not_run} other sentences were not run with this data"
ax.set_title(title + left_out * bool(n_not_run))
record.figure(fig, "verdicts")

# %% [markdown]
# ## In how many conditions
#
# A claim about the robot depends on the zone, on the controller, and on the scene, and the paper gives neither gamma nor
# the weights. So each claim is judged in many conditions. A column is one of them:
#
# - **Zones** by the paper's method: 40 of everybody on the ATC day, 40 of strangers there, 40 of Grand Central. For each the
#   pairs of people are drawn anew, with replacement. And those of 40 plazas.
# - **Robots**: the paper's settings, and one change each. The paper says that it uses a public code: its weights
#   (Q = 10 I, R = I, P = 100 I) and its gamma of 0.4 are among them. The last robot is ours.
# - **Chains**: the paper's way from samples to a zone, and one change each.
# - **Controls** lack what the paper gives as the cause: no barrier of the person; gamma = 1, which is a plain distance
#   constraint; a circle of the same area. They do not count.
#
# A number is the *share* of zones in which the claim holds, in percent. **What do you think?** Which one changes more
# verdicts, where the zone is from, or gamma?

# %% jupyter={"source_hidden": true}
# Figure
fig = paper_matrix.draw_matrix(matrix)
record.figure(fig, "matrix")

# %% jupyter={"source_hidden": true}
# The answer
papers = verdicts[~is_ours]
by = papers["decides"].str.partition(":")[0].value_counts()
Markdown(
    f"<details><summary>Answer</summary>\n\nFor {by.get('condition', 0)} of {len(papers)} claims the controller or the chain decides "
    f"most, for {by.get('source', 0)} the place. gamma is what matters: with 0.4, that of the code, the robot leaves the safety set in "
    "all zones. The place decides about the shape of the zone, and so about the side.\n\n</details>"
)

# %% [markdown]
# ## The verdicts
#
# The share of a claim is that of all its conditions and zones together. Its interval is that of as many trials as there
# are zones. Read both with care: we chose the conditions, and one more gamma changes the share; and 120 of the 160 zones are
# draws from two recordings, so the interval is one for new draws, not for new places. The figure above shows each condition. The
# verdict follows from the interval alone:
#
# | verdict | 95 % interval of the share |
# |---|---|
# | supported | at or above 90 % |
# | mostly supported | above 50 % |
# | depends on the condition | contains 50 % (with fewer than 40 zones: not decidable) |
# | mostly not supported | below 50 % |
# | not supported | at or below 10 % |
#
# *Decides* names the factor whose levels differ most, if by 20 % or more.

# %% jupyter={"source_hidden": true}
# Table
shares = papers.assign(
    share=[f"{row.share:.0%} ({row.low:.0%} to {row.high:.0%})" for row in papers.itertuples()],
    controls=["" if share != share else f"{share:.0%}" for share in papers["control"]],
)
style_table(shares[["claim", "verdict", "share", "zones", "decides", "controls"]])

# %% [markdown]
# ## All sentences, counted
#
# | verdict | meaning |
# |---|---|
# | implemented, altered | the sentence defines something: the code does this, or something else for a reason |
# | by test | no notebook shows it: a test of the package holds it |
# | supported ... not supported | the sentence claims something: by its share, or by the checks of the notebooks |
# | not decidable | the data is too little to say |
# | untestable here | tracks and simulations alone cannot decide it, for example comfort |
# | not done here | it can be tested, but nobody did it here |
# | not run with this data | the notebook that checks it was not run, or was run with other data |
#
# The verdicts are computed from the checks and claims that the notebooks of this run recorded, and from the table of
# conditions, of which each run drives one cell again. If a notebook was not run, or was run with other data, its
# sentences say so. A sentence with several results has the worst of their verdicts.

# %% jupyter={"source_hidden": true}
# Checks
record.table(every.drop(columns="unknown"), "28_sentences")
record.table(verdicts, "28_verdicts")
unknown = [name for names in every["unknown"] for name in names]
if record.cache.is_synthetic:
    record.check(
        "each check that a sentence names was made, where its notebook ran",
        not unknown,
        f"{len(unknown)} missing" + ": " * bool(unknown) + ", ".join(unknown),
    )
record.key |= {f"sentences {verdict}": int(number) for verdict, number in counts.items()}

# %% [markdown]
# ## Every sentence
#
# Open a verdict to see its sentences, each with our code, the cell that shows it, and the numbers that decide it.

# %% jupyter={"source_hidden": true}
# Computation
sentences["how, and numbers"] = sentences["how"] + "\n" + sentences["numbers"]
cells = sentences["notebook"] + ": " + sentences["cell"].str.lstrip("# ")
sentences["code; notebook: cell"] = sentences["code"] + "\n" + cells
shown = ["place", "sentence", "how, and numbers", "code; notebook: cell"]
width = {"sentence": "25%", "how, and numbers": "40%", "code; notebook: cell": "25%"}
lines = {"selector": "td", "props": "white-space: pre-line; overflow-wrap: anywhere; vertical-align: top"}
columns = {name: [{"selector": "", "props": f"width: {share}"}] for name, share in width.items()}
for verdict, number in counts.items():
    table = style_table(sentences[sentences["verdict"] == verdict][shown])
    table = table.set_table_styles([lines], overwrite=False).set_table_styles(columns, overwrite=False)
    display(HTML(f"<details><summary>{verdict}: {number} sentences</summary>\n{table.to_html()}\n</details>"))

# %% [markdown]
# ## Harder than the paper
#
# These are tests of ours. They ask for more than the paper says: any gamma, short walls, growth with speed. They do not
# count.

# %% jupyter={"source_hidden": true}
# Table
style_table(stress[["place", "sentence", "verdict", "numbers"]])

# %% [markdown]
# **A common mistake:** "not supported here" means that the paper is wrong. No: it means that this data, with
# these settings, does not show it. The paper had 92 days of people; the plaza is synthetic.

# %% jupyter={"source_hidden": true}
# What we know now
claimed = judged.loc[judged["kind"] == "claim", "verdict"]
n_claims = (sentences["kind"] == "claim").sum() - len(claimed)
left_out = f"; {n_not_run} others, {n_claims} of them claims, were not run with this data"
held, failed = ((papers["verdict"] == word).sum() for word in ("supported", "not supported"))
Markdown(
    f"**What it means.** Of {len(judged)} sentences {len(claimed)} claim something about people or the robot, and "
    f"{(claimed == 'supported').sum()} of these are supported as they stand{left_out * bool(n_not_run)}. Of the {len(papers)} claims that were judged in "
    f"many conditions, {held} hold in nearly all, {failed} in nearly none, and for {by.get('condition', 0)} the controller or the chain "
    "decides more than the place where people were recorded."
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

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
# **Expectation.** What the paper defines is implemented, or altered for a reason that is given. Its claims are
# supported by some data and not by other data. Comfort cannot be tested here.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [27](27_atlas.ipynb) · next: [29 - Crowds and recorded
# people](29_crowds.ipynb) · [paper](https://arxiv.org/abs/2405.15101): all · 10 min
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
import matplotlib.pyplot as plt
from IPython.display import HTML, Markdown, display

from szlib.workbook import figures, paper_sentences
from szlib.workbook.record import NotebookRecord
from szlib.workbook.record.display import style_table

record = NotebookRecord("28_sentences", globals())
sentences = paper_sentences.judge_sentences(record)
counts = sentences["verdict"].value_counts()

# %% jupyter={"source_hidden": true}
# Figure
COLOURS = {"supported": figures.GREEN, "implemented": figures.BLUE, "not supported": figures.RED}
fig, ax = plt.subplots(figsize=(8, 0.4 * len(counts) + 0.9), layout="constrained")
bars = ax.barh(counts.index, counts, color=[COLOURS.get(name, figures.GREY) for name in counts.index])
ax.bar_label(bars, padding=3)
ax.invert_yaxis()
ax.set(xlabel="sentences of the paper", xlim=(0, 1.1 * counts.max()))
good = counts.get("supported", 0) + counts.get("implemented", 0)
ax.set_title(f"{good} of {len(sentences)} sentences are supported or implemented as they stand")
record.figure(fig, "verdicts")

# %% [markdown]
# ## The verdicts, counted
#
# | verdict | meaning |
# |---|---|
# | implemented, altered | the sentence defines something: the code does this, or something else for a reason |
# | supported, not supported | the sentence claims something: the checks of the notebooks say so, or not |
# | not decidable | the data is too little to say |
# | untestable here | tracks and simulations alone cannot decide it, for example comfort |
# | not done here | it can be tested, but nobody did it here |
#
# The verdicts are computed from the checks and claims that the notebooks of this run recorded. Nobody types them. If
# a notebook was not run, or was run with other data, its sentences say so. Sentences about fig. 6 are judged by the
# paper's zone and settings; chapters 09 to 11 show ours beside them.

# %% jupyter={"source_hidden": true}
# Checks
record.table(sentences.drop(columns="unknown"), "28_sentences")
unknown = [name for names in sentences["unknown"] for name in names]
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
# **A common mistake:** "not supported here" means that the paper is wrong. No: it means that this data, with
# these settings, does not show it. The paper had 92 days of people; the plaza is synthetic.

# %% jupyter={"source_hidden": true}
# What we know now
supported, claims = counts.get("supported", 0), (sentences["kind"] == "claim").sum()
Markdown(
    f"**What it means.** Of {len(sentences)} sentences {claims} claim something about people or the robot, and "
    f"{supported} of these are supported here. {counts.get('altered', 0)} sentences are altered, each for the reason "
    f"given; {counts.get('untestable here', 0)} cannot be tested with tracks and simulations alone."
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

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
# # 28 - From sentence to verdict
#
# **Question.** Which sentences of the paper say something that can be checked, and does each of them hold?
#
# **Expectation.** What the paper defines is implemented as it says, or altered for a reason that is given. What it
# claims is supported by some data and not by other data. What it says about comfort cannot be tested here.

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [27](27_atlas.ipynb) ·
# [paper](https://arxiv.org/abs/2405.15101): all · 10 min
#
# **Afterwards you can** find each sentence of the paper with its code, its cell and its verdict.

# %%
from IPython.display import Markdown

from szlib.workbook import paper_sentences
from szlib.workbook.record import NotebookRecord
from szlib.workbook.record.display import style_table

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"

# %%
record = NotebookRecord("28_sentences", globals())

# %% [markdown]
# ## The verdicts, counted
#
# Each verdict is computed from the checks and claims that the notebooks of this run recorded; none is typed. A
# sentence whose notebook was not run, or was run with other data, says so. Sentences about fig. 6 are judged by the
# paper's zone and settings; ours are in notebooks 09 to 11 beside them.

# %%
sentences = paper_sentences.judge_sentences(record)
record.table(sentences.drop(columns="unknown"), "28_sentences")
unknown = [name for names in sentences["unknown"] for name in names]
if record.cache.is_synthetic:
    record.check("each check that a sentence names was made, where its notebook ran", not unknown, unknown)
counts = sentences["verdict"].value_counts()
record.key |= {f"sentences {verdict}": int(number) for verdict, number in counts.items()}
counts.to_frame("sentences")

# %% [markdown]
# ## Every sentence
#
# Each with our code, the cell that shows it, its verdict, and the numbers that decide it.

# %%
sentences["how, and numbers"] = sentences["how"] + "\n" + sentences["numbers"]
cells = sentences["notebook"] + ": " + sentences["cell"].str.lstrip("# ")
sentences["code; notebook: cell"] = sentences["code"] + "\n" + cells
shown = ["place", "sentence", "verdict", "how, and numbers", "code; notebook: cell"]
width = {"sentence": "20%", "verdict": "12%", "how, and numbers": "36%", "code; notebook: cell": "22%"}
lines = {"selector": "td", "props": "white-space: pre-line; overflow-wrap: anywhere; vertical-align: top"}
columns = {name: [{"selector": "", "props": f"width: {share}"}] for name, share in width.items()}
style_table(sentences[shown]).set_table_styles([lines], overwrite=False).set_table_styles(
    columns, overwrite=False
)

# %%
supported, claims = counts.get("supported", 0), (sentences["kind"] == "claim").sum()
Markdown(
    f"**What it means.** Of {len(sentences)} sentences {claims} claim something about people or the robot, and "
    f"{supported} of these are supported here. {counts.get('altered', 0)} sentences are altered, each for the reason "
    f"given; {counts.get('untestable here', 0)} cannot be tested with tracks and simulations alone."
)

# %%
record.close()

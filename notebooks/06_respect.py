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
# # 6 - Respect or emptiness?
#
# **Question.** Around a walking person there is a place where nobody is. Do people keep out of it, or
# is it only rare that two of them are anywhere near each other?
#
# **Expectation.** If it is respect, people must be there less often than they would be by chance. So we
# need to know what chance gives: the same people on the same paths who take no notice of each other.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [05](05_zones.ipynb) · next: [7 - Barriers: how fast may the robot
# approach?](07_barriers.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 2 · 60 min · needs
# [05](05_zones.ipynb) · exercises: [4.3-4.5](exercises/sheet4_certainty.ipynb#4.3-A-p-value-(10-min))
#
# **Afterwards you can** tell respect from emptiness by a null model.

# %%
import warnings

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import Markdown
from studies import respect

import szlib
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, MEASURED, NotebookRecord, parameters

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
zone_speed = 1.1  # of the zones compared [m/s]
shifts = 20  # null models; the saved tables have 100
resamples = 100  # for the intervals of the zones

# %%
record = NotebookRecord("06_respect", globals())
parameters(
    [
        (
            "shift of each person",
            "1 to 10 min, either way; less in a recording of less than 11 min",
            ASSUMED,
            "longer than a meeting, shorter than the day's changes",
        ),
        ("null models", shifts, ASSUMED, f"the smallest p-value is 1/{shifts + 1}"),
        (
            "companions",
            "5 s together within 2 m, at equal velocity",
            MEASURED,
            "on people whose groups are known",
        ),
        ("quantile zone", "q = 5 %", ASSUMED, "the share of encounters that may enter it"),
        ("respect zone", "g = 1/2", ASSUMED, "careful people are half as frequent as by chance at its edge"),
    ]
)

# %% [markdown]
# ## Who meets whom
#
# Not every encounter is a meeting of strangers. Two people who walk together keep a distance as well,
# but another one, for another reason. The *kind* of an encounter is decided on the whole common track
# of the two people (`szlib.encounters.kinds`).

# %%
tracks = record.cache.tracks()
square = record.cache.find_area(tracks)
conditions = record.cache.method.encounter_settings()  # as in notebook 02
samples = szlib.find_encounters(tracks, square=square, settings=conditions)
pairs = samples.drop_duplicates("encounter")
counts = pairs["kind"].value_counts()
record.key |= {"encounters": len(pairs), "companions": int(counts["companions"])}
counts.to_frame("encounters")

# %% [markdown]
# ## The null model
#
# `szlib.null_encounters` moves each person in time alone, by minutes. Every path, every speed and the
# density of the crowd stay; that two people take notice of each other is lost. Companions are taken
# apart. Whatever is found now is what emptiness looks like.

# %%
null = szlib.null_encounters(
    tracks,
    square=square,
    shifts=shifts,
    seed=seed,
    r_max=record.cache.method.r_max,
    progress=shifts > 20,
    settings=conditions,
)
by_chance = null.encounters.drop_duplicates("encounter")["kind"].value_counts() / shifts
compared = pd.DataFrame({"seen": counts, "by chance": by_chance.round(1)})
print(f"{len(pairs)} encounters seen, {len(null.encounters) / shifts:.0f} by chance")
compared

# %% [markdown]
# On the plaza pairs come one after the other: by chance they would hardly ever meet. In a mall they
# would, and those who meet by chance do not walk side by side.

# %%
fig, ax = plt.subplots(figsize=(7, 3), layout="constrained")
compared.loc[counts.index].plot.barh(ax=ax, color=[figures.BLUE, figures.GREY], width=0.75)
for bar in ax.containers[1]:
    bar.set_hatch("///")
ax.legend()
ax.set(xlabel="encounters", ylabel="", title="Who meets whom, and who would by chance")
record.figure(fig, "kinds")

# %% [markdown]
# ## Where people are, and where they would be
#
# $g(r, \theta)$ is how often people were there, divided by how often they are there in the null model. It is 1
# where people ignore each other, and below 1 where they keep out. The map shows strangers only.
#
# A map counts every sample. Two people who keep apart take all their samples away, also those far from the
# edge. So the black line is not the edge of the zone, and the map gives no radius. The dashed circle, the
# radius of all directions, comes from the next figure.

# %%
strangers, others = szlib.of_kind(samples, "strangers"), null.of_kind("strangers")
tests = {
    "everybody": szlib.null_test(samples, null),
    "strangers": szlib.null_test(strangers, others),
}
respected = tests["strangers"].respect
radius = respected.radius
distance = f"Few strangers come nearer than {radius:.2f} m" if radius else "No distance that strangers keep"
ax = figures.plot_pair_correlation(szlib.pair_correlation(strangers, others), radius=radius)
ax.set_title(distance)
record.figure(ax.figure, "g")
record.key["respect radius, strangers [m]"] = radius

# %% [markdown]
# ## How near they come
#
# Each encounter counts once now, with its nearest approach $r$. Among people who ignore each other, encounters
# of the kind $k$ have nearest approaches with the frequencies $N_k(r)$ of the null model. Respect changes these
# frequencies:
#
# $$p(r \mid k) = \frac{N_k(r)\, g(r)}{\sum_r N_k(r)\, g(r)}, \qquad g(r) = f + \frac{1 - f}{1 + e^{-(r - R) / w}}$$
#
# - $R$ is the **radius of the respect zone**: there, careful people are half as frequent as by chance;
# - $w$ is the softness of the edge;
# - $f$ is the share of careless people, who enter the zones of others.
#
# `szlib.null_test(samples, null).respect` tries all $R$, $w$ and $f$ of a fine grid. The interval holds every $R$
# that explains the data nearly as well as the best one (95 %).


# %%
def nearest_approaches(people: pd.DataFrame) -> pd.DataFrame:
    """Kind and nearest approach of each encounter within r_max."""
    near = people.groupby("encounter").agg(kind=("kind", "first"), nearest=("distance", "min"))
    return near[near["nearest"] < null.r_max]


seen, expected = nearest_approaches(strangers), nearest_approaches(others.samples)
share = seen["kind"].value_counts() / expected["kind"].value_counts()  # as many of each kind as were seen
bins = np.arange(0, null.r_max + 0.05, 0.1)
fig, ax = plt.subplots(figsize=(8, 4), layout="constrained")
ax.hist(seen["nearest"], bins=bins, color=figures.BLUE, label="seen")
ax.hist(
    expected["nearest"],
    bins=bins,
    weights=expected["kind"].map(share).astype(float).fillna(0),
    histtype="step",
    color=figures.BLACK,
    linestyle="--",
    label="by chance, as many of each kind",
)
ax.axvspan(respected.low, respected.high, color=figures.RED, alpha=0.25, linewidth=0)
ax.axvline(radius, color=figures.RED, linewidth=2, label=f"radius of the respect zone: {respected}")
ax.set(xlabel="nearest approach [m]", ylabel="encounters of strangers", xlim=(0, null.r_max))
ax.set_title(distance)
fig.legend(loc="outside lower center", ncol=3)
record.figure(fig, "nearest")

# %% [markdown]
# ## Is it respect at all?
#
# If people ignored each other, the data would be just one more shifted day. Its rank among the null models
# is then a p-value, for any statistic. Ours asks: of the people who come near, do too few come very near?
# Each kind of encounter is compared with the same kind, because shifts in time also change the mix of kinds:
# people who arrive in a group walk in the same direction, for other reasons than respect.

# %%
for name, test in tests.items():
    print(f"{name}: {test}")
    record.key[f"p-value, {name}"] = test.p_value
found = tests["strangers"].is_significant
record.claim("people keep out of each other's way more than by chance", found, str(tests["strangers"]))

# %%
fig, ax = plt.subplots(figsize=(7, 3), layout="constrained")
ax.hist(tests["strangers"].null_statistics, bins=15, color=figures.GREY, label=f"{shifts} null models")
ax.axvline(tests["strangers"].statistic, color=figures.RED, linewidth=2, label="the data")
ax.set(xlabel="too few come near, by so many standard deviations", ylabel="null models")
ax.set_title("Respect is " + ("shown" if found else "not shown") + " here")
ax.legend()
record.figure(fig, "test")

# %% [markdown]
# A test is only useful if it finds nothing where there is nothing. So it was run on crowds of people who
# ignore each other. They walk straight on at a speed of their own, singly or in bunches of ten as from a
# train (`python -m studies.respect nobody`). At a level of 5 %, five false alarms in a hundred crowds are
# expected, and as many crowds whose interval of the radius does not contain 0.

# %%
nobody = record.committed_table("06_nobody", respect.recompute_nobody, where="radius > 0")
nobody["alarm"] = nobody["p_value"] <= 0.05
nobody["zone"] = nobody["radius_low"] > 0
alarms = nobody.groupby(["bunch", "kinds"]).agg(
    alarms=("alarm", "sum"), zones=("zone", "sum"), crowds=("seed", "size")
)
every_kind = alarms.xs("all", level="kinds")
record.check(
    "where people ignore each other: at most 5 false alarms in 100 crowds, singly or in bunches",
    (every_kind["alarms"] <= 0.05 * every_kind["crowds"]).all(),
    every_kind["alarms"].to_dict(),
    always=True,
)
alarms.rename(columns={"alarms": "false alarms", "zones": "intervals without 0"})

# %% [markdown]
# ## Three zones of the same people
#
# - **paper**: where (nearly) nobody ever was: the paper's, to the letter;
# - **quantile**: where all but 5 % of encounters keep out;
# - **respect**: the ellipse that careful people keep out of, compared with people who ignore each other.
#
# For the respect zone, both people of an encounter carry the same ellipse, each turned with its own motion.
# What counts is how near either of them comes to the other's ellipse, or how deep into it. With the nearest
# approach replaced by this distance, it is the equation above; centre and semi-axes may change with speed.
# People who walk in the same direction are left out: they stay together for other reasons than respect, which a
# shift in time removes as well.
#
# Each zone has its interval, for everybody and for strangers (on the plaza all are strangers). Those of the
# first two come from pairs of people drawn anew, and are meant to contain the zone that the same method gives
# for all people there are. Those of the respect zone come from its posterior distribution, and are meant to
# contain the true zone. They need a null model with at least twice as many encounters as the data. On the plaza
# it has fewer, as people hardly ever meet there by chance.


# %%
def zone_at(people: pd.DataFrame, model: szlib.NullEncounters, method: str) -> pd.Series:
    """The row of the table at `zone_speed`; empty where there is no zone."""
    more = {"respect": {"null": model}, "quantile": {"q": record.cache.method.q}}.get(method, {})
    options = {"r_max": record.cache.method.r_max, "speeds": (zone_speed,), "n_resamples": resamples} | more
    try:
        zone = szlib.SocialZone.fit(people, method=method, **options)
    except szlib.ZoneError as error:
        print(f"{method}: {error}")
        return pd.Series({"adequate": False})
    return zone.table().iloc[0]


groups = {"everybody": (samples, null), "strangers": (strangers, others)}
if len(strangers) == len(samples):
    del groups["everybody"]  # the same people
rows = {}
with warnings.catch_warnings():
    warnings.simplefilter("ignore", szlib.DataWarning)  # the column adequate says it
    for name, (people, model) in groups.items():
        for method in ("paper", "quantile", "respect"):
            rows[method, name] = zone_at(people, model, method)
columns = ["a", "a_low", "a_high", "b", "center_x", "area", "influence", "adequate"]
zones = pd.DataFrame(rows).T.reindex(columns=columns)
record.table(zones.rename_axis(["method", "who"]).reset_index(), "15_zones")
zones

# %%
fig, ax = plt.subplots(figsize=(7, 1.4 + 0.3 * len(zones)), layout="constrained")
looks = {"paper": (figures.RED, "o"), "quantile": (figures.BLUE, "s"), "respect": (figures.GREEN, "^")}
for at, ((method, _), line) in enumerate(zones.iterrows()):
    shade, marker = looks[method]
    ax.hlines(at, line["a_low"], line["a_high"], color=shade, linewidth=2)
    ax.plot(line["a"], at, marker, color=shade, fillstyle="full" if line["adequate"] else "none")
ax.set_yticks(range(len(zones)), [f"{method}, {who}" for method, who in zones.index])
ax.invert_yaxis()
ax.set(xlabel=f"semi-major axis at {zone_speed:g} m/s [m], 95 %; hollow: too few people on some side")
ax.set_title("Three zones of the same people")
record.figure(fig, "zones")
for (method, who), line in zones.dropna(subset="a").iterrows():
    record.key[f"a, {method}, {who}"] = float(line["a"])

# %% [markdown]
# ## By the number of encounters
#
# Take fewer encounters of the same place at random, and estimate again. An extreme shrinks with every
# person added, until one careless person sets it; a radius from all nearest approaches does not. The real ATC
# day and Grand Central, New York (`python -m studies.respect n-curve`):

# %%
curves = record.committed_table("06_n_curve", respect.recompute_n_curve, where="site == 'plaza'")
curves = curves[(curves["kinds"] == "strangers") & (curves["site"] != "plaza")]
fig, panels = plt.subplots(1, 2, figsize=(11, 4), layout="constrained", sharey=True)
shown = {
    "hull_a": "the paper's zone: semi-major axis",
    "respect": "respect zone: radius",
    "null_respect": "respect zone of the null model: radius",
}
for ax, (site, part) in zip(panels, curves.groupby("site"), strict=True):
    figures.plot_zone_sizes(part, shown, ax=ax).set_title(f"{site}, strangers")
record.figure(fig, "n-curve")

# %%
sites = record.committed_table("06_sites", respect.recompute_sites, where="site == 'plaza'")
sites = sites[(sites["site"] != "plaza") & sites["kinds"].isin(["all", "strangers", "opposite, crossing"])]
sites[
    [
        "site",
        "kinds",
        "encounters",
        "radius",
        "radius_low",
        "radius_high",
        "null_radius_high",
        "p_value",
        "hull_a",
        "null_hull_a",
    ]
].round(3)

# %% [markdown]
# The respect zone of strangers at 1.1 m/s: how far it reaches in four directions [m], with intervals. Few
# straight paths touch a zone ahead and behind, so its reach is less certain there than to the sides. The
# strangers of the ATC day are too few to determine it.

# %%
reach = sites[sites["kinds"] != "all"].set_index(["site", "kinds"])
pd.DataFrame(
    {
        where: reach.apply(
            lambda row, at=where: "{:.2f} ({:.2f} to {:.2f})".format(*row.filter(like=at)), axis=1
        )
        for where in ("ahead", "left", "behind", "right")
    }
)

# %% [markdown]
# ## What the radius depends on
#
# At Grand Central: on who counts, on the shifts of the null model, on the area, and on the scale and the
# frame rate of its video? Each with its interval (`python -m studies.respect changes`).

# %%
changes = record.committed_table("06_changes", respect.recompute_changes, where="site == 'plaza'")
changes = changes[changes["site"] == "grand-central"]
fig, ax = plt.subplots(figsize=(9, 4.5), layout="constrained")
looks = zip((figures.GREY, figures.BLUE, figures.ORANGE), "os^", (-0.2, 0.0, 0.2), strict=True)
for (who, part), (shade, marker, up) in zip(changes.groupby("kinds", sort=False), looks, strict=True):
    at = [up + k for k in range(len(part))]
    ax.hlines(at, part["radius_low"], part["radius_high"], color=shade, linewidth=2)
    ax.plot(part["radius"], at, marker, color=shade, label=who)
ax.set_yticks(range(len(part)), part["change"])
ax.invert_yaxis()
ax.set(xlabel="radius of the respect zone, all directions [m], 95 %", ylabel="changed", xlim=(0, None))
ax.legend(loc="upper left", bbox_to_anchor=(1, 1))
ax.set_title("Grand Central: one thing changed at a time")
record.figure(fig, "changes")

# %%
by = changes.pivot(index="change", columns="kinds", values="radius")
moved = (by.drop(index="nothing") / by.loc["nothing"] - 1).abs().max(axis=1)
usual = changes[changes["change"] == "nothing"].set_index("kinds").filter(like="radius")
described = usual.agg(lambda row: "{:.2f} m ({:.2f} to {:.2f})".format(*row), axis=1)
Markdown(f"""Strangers keep {described["strangers"]}; without those who walk in the same direction it is
{described["not in the same direction"]}. Of the other changes "{moved.idxmax()}" moves the radius most, by
{100 * moved.max():.0f} %.""")

# %% [markdown]
# ## Results on real data
#
# | | ATC day, strangers | Grand Central, strangers |
# |---|---|---|
# | radius of the respect zone [m] | 1.03 (0.77 to 1.35) | 0.57 (0.54 to 0.59); not in the same direction: 0.56 (0.53 to 0.58) |
# | encounters with a careless person who enters it | 0 % (up to 8 %) | 3.0 % (up to 3.1 %) |
# | p-value | 1/101, the least of 100 null models | 1/21, the least of 20 |
# | the null model's own radius, 97.5 % [m] | 0.15 | 0.00 |
# | the null model's *hull*, semi-major axis [m] | 0.32 | 0.12 |
#
# At Grand Central the radius is 0.54 to 0.60 m for 150 to 7,354 encounters, and the paper's zone shrinks from 0.80 to 0.35 m.
#
# Of 100 crowds that ignore each other, 4 gave a false alarm, and of 100 that come in bunches, 1: each kind of encounter is compared
# with its own kind. The interval of the radius contained 0 in 97 and 100 of them.
#
# Companions are found with precision 23/23 and recall 23/24 on THOR-MAGNI, 121/154 and 121/177 on the ETH sequence, whose list
# of groups is incomplete.

# %%
kept = f"a distance of {radius:.2f} m remains that strangers keep" if found else "no distance is shown here"
Markdown(f"""**What it means.** Emptiness alone makes a zone, and a method that looks for the nearest person
cannot tell it from respect. Compared with people who ignore each other, {kept}
(p = {tests["strangers"].p_value:.3f}). At Grand Central the distance hardly depends on how long one watches.
Companions have to be separated first: they are near by choice.""")

# %%
record.close()

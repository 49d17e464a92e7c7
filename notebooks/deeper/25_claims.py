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
# # 25 - What is true?
#
# **Question.** What does the paper claim, and what of it does the data support?
#
# **Expectation.** A claim that rests on 92 days may be undecidable on one. So each becomes an effect with
# its interval, and the verdict may be "not decidable".

# %% [markdown]
# [Start](../00_start_here.ipynb) · before: [24](24_data_quality.ipynb) · next: [26 - Eleven
# meetings](26_meetings.ipynb) · [paper](https://arxiv.org/abs/2405.15101): all · 80 min · needs
# [06](../06_respect.ipynb)
#
# **Afterwards you can** say which claims of the paper the data supports, and with which interval.

# %%
import sys

sys.path.append("..")  # for `studies`
import warnings
from dataclasses import replace
from functools import partial
from itertools import product
from time import thread_time

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from IPython.display import Markdown
from studies import claims as claims_study
from studies import imposed as imposed_study
from studies import paper_claims as claims
from studies import plazas as plazas_study
from studies import zones as zones_study

import szlib
from szlib.control.distances import compare_distances
from szlib.plaza.accuracy import true_kinds
from szlib.workbook import figures, paper_sentences
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord, parameters, read_table
from szlib.zones.outliers import is_outlier
from szlib.zones.sensitivity import sensitivity

# %% tags=["parameters"]
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
fraction = 0.002  # as in notebook 03
r_max = 2.0  # as in notebook 03 [m]
zone_speed = 1.1  # as in notebook 05 [m/s]
resamples = 200  # for the intervals

# %%
record = NotebookRecord("25_claims", globals())
parameters(
    [
        (
            "intervals",
            f"95 %, {resamples} resamples of pairs of people",
            ASSUMED,
            "one pair is one piece of evidence; delays in deterministic runs: range over scenarios",
        ),
        (
            "verdict",
            "the interval lies above, below or around 0",
            ASSUMED,
            "an effect above 0 is as the paper says",
        ),
        ("speed of the zone", f"{zone_speed:g} m/s", PAPER, "1.1 m/s: sec. 4"),
        ("slow and fast", "0.7 and 1.3 m/s", ASSUMED, "well inside the data"),
    ]
)

# %% [markdown]
# ## The claims, on this data
#
# Every zone has a shape, also that of people who ignore each other. So a claim about the shape is a difference
# from the null model of this data: from the respect zone, which compares the two (notebook 06), and from its
# posterior distribution. Below 150 encounters of people who cross or come towards each other, that would
# repeat the prior, and nothing is decided.

# %%
samples = record.cache.encounters()
null = record.cache.null_model(few_shifts=4)  # two encounters for each of the data are enough
speeds = (0.7, zone_speed, 1.3)
with warnings.catch_warnings():
    warnings.simplefilter("ignore", szlib.DataWarning)  # what is not adequate cannot decide, and says so
    fit = partial(szlib.SocialZone.fit, samples, r_max=r_max, speeds=speeds, n_resamples=resamples, seed=seed)
    zone = fit(method="quantile", q=record.cache.method.q)

# %%
found, methods = [claims.measure_passing_side(samples)], ["-"]
if data == "atc-1hz":
    found.append(claims.measure_encounter_rate(samples["encounter"].nunique(), samples["day"].nunique()))
    methods.append("-")
found += claims.measure_shape(samples, null, r_max=r_max, speed=zone_speed)
methods += ["respect", "respect"]
DECIDED = {"supported": True, "contradicted": False}  # other verdicts: not decidable
table = claims.tabulate_findings(found, data=record.out.name).assign(method=methods)
record.table(table, "25_claims")
for each, method in zip(found, methods, strict=True):
    name = each.claim if method == "-" else f"{each.claim} ({method})"
    record.claim(name, DECIDED.get(each.verdict), str(each))

# %%
if record.cache.is_synthetic:
    settings = szlib.PlazaSettings()
    close = samples[samples["distance"] <= r_max]
    intruder = true_kinds(close, seed=seed) == "intruder"
    removed = is_outlier(close, fraction=fraction, n_neighbours=20, r_max=r_max)
    lof = claims.measure_intruders_removed(int((removed & intruder).sum()), int(removed.sum()))
    record.claim(f"{lof.claim} (20 neighbours, {fraction:.1%})", lof.low > 0, str(lof))

# %%
ax = figures.plot_claims(table)
ax.set_title(f"{(table['verdict'] == 'supported').sum()} of {len(table)} claims are supported here")
record.figure(ax.figure, "claims")

# %% [markdown]
# ## The same on every data set
#
# The plaza, the real ATC day, Grand Central, THOR-MAGNI, and the ETH sequence (`python -m studies.claims claims`),
# about strangers. What the paper says about its own square is asked at the ATC mall alone. Brackets hold 95 %
# intervals; those of the robot's delay hold the range over the four scenarios, because the runs are deterministic.

# %%
of_plaza = "data == 'plaza' and effect == effect"
everywhere = record.committed_table("25_claims", claims_study.recompute, where=of_plaza)
everywhere["cell"] = everywhere.agg(claims.format_finding, axis=1)
is_shape = everywhere["claim"].isin(claims_study.CLAIMS)
by_respect = everywhere["method"].str.startswith("respect")
answers = everywhere[~is_shape | by_respect]
record.key["claims decided"] = int((~answers["verdict"].str.startswith("not")).sum())
record.key["cells"] = len(answers)
wide = answers.pivot(index="claim", columns="data", values="cell").fillna("")
wide[list(dict.fromkeys(answers["data"]))]

# %% [markdown]
# One real site, Grand Central, has enough people for a claim about the shape. Both intervals contain 0: whether the
# zone reaches farther ahead than behind, or grows with speed, is open. The quantile zone alone would say that it
# reaches farther ahead; but so does, a little, the quantile zone of people who ignore each other:

# %%
ahead = everywhere[everywhere["claim"] == claims.LARGER_AHEAD]
ahead.pivot(index="method", columns="data", values="cell")[["plaza", "Grand Central"]]

# %%
central = ahead[ahead["data"] == "Grand Central"].set_index("method")["effect"]
by_chance = float(central["quantile, null model"])
record.check(
    "at Grand Central the quantile zone of people who ignore each other reaches farther ahead as well",
    by_chance > 0,
    f"{by_chance:+.2f} m; of the data {central['quantile, strangers']:+.2f} m",
    always=True,
)

# %% [markdown]
# ## Three estimators
#
# | `method` | the zone is where | error on the plaza | with more people |
# |---|---|---|---|
# | `"quantile"` | all but 5 % of encounters keep out | within 4 cm | stable: 0.72, 0.58, 0.54, 0.57 m at Grand Central with 150, 600, 2,400, 7,354 strangers |
# | `"hull"` | nobody ever was | within 4 cm, 2,600 to 21,000 encounters, up to 2 % intruders | shrinks: 1.25 m with 36 strangers there, 0.35 m with 7,354 |
# | `"respect"` | careful people keep out, compared with people who ignore each other | needs a null model: see below | stable: an edge, no extreme |
#
# Without `method`, the respect zone is taken where the data has 150 encounters, the null model twice as many, and they
# show respect; else the quantile zone: on the plaza the latter, because few of its people would meet by chance.
#
# `"paper"` is the hull with 0.2 % of the samples removed and 20 neighbours. It fails at the paper's own size: with 16,000 encounters and 0.25 %
# intruders it is 16 to 25 cm off, with 2 % more than 60 cm, because LOF with 20 neighbours compares an intruder with their own
# samples. By default whole encounters are judged instead (precision and recall 1.00 there; notebook 03). With 2 % intruders, 5 cm
# of noise, or both, the quantile zone is within 3.8 cm, the hull within 4 cm without the noise and within 11 cm with it. The
# paper's zone is 9 cm off with the noise alone, and 49 to 60 cm with the intruders.
#
# Every zone has 95 % intervals from resampled pairs of people, the largest influence of one encounter, counts by side, and
# `zone.adequate(speed)`. A zone with fewer than 20 encounters on some side gives a warning when it is used, and is drawn dashed.
# On 400 plazas of 600 pairs the 95 % intervals of the quantile contain its limit in 90 to 98 % of cases; with 300 pairs in 91 %
# on average. They contain the true semi-axes in 33 to 87 %, and the true centre of the default plaza in 13 to 16 %: the limit
# lies 0.4 to 2 cm outside the truth, depending on people's clearance, which cannot be observed. The intervals of the hull contain
# the truth of centred plazas in 91 to 100 %. With more people, by pooling plazas (`python -m studies.zones sizes 8`), and with
# fewer, by drawing from the ATC day (`python -m studies.zones subsets 20`):

# %%
pooled = record.committed_table("25_sizes", zones_study.recompute_sizes, where="plazas == 1")
largest = float(pooled["error_m"].max())
record.check("the quantile zone of one to eight plazas is within 4 cm", largest <= 0.04, largest, always=True)
subsets = record.committed_table("25_subsets", zones_study.recompute_subsets, where="site == 'plaza'")
of_day = subsets[subsets["site"] == "ATC day"].set_index(["method", "share"])
of_day[["draws", "zones", "a_lower", "a_median", "a_upper", "b_median"]].round(2)

# %% [markdown]
# ## Can the zones and their intervals be trusted?
#
# On plazas the truth is known: the largest error of centre and axes, with intruders, with 5 cm of noise
# (`python -m studies.zones estimators 3`).

# %%
saved = record.committed_table("25_estimators", zones_study.recompute_estimators)
errors = saved.pivot_table("error_m", "case", "method", aggfunc="max")
off = float(errors["quantile"].max())
record.check("the quantile zone is within 4 cm in every case", off <= 0.04, off, always=True)
errors.round(3)

# %% [markdown]
# A 95 % interval is to hold something in 95 % of data sets. Of what? Of the *limit*: the zone that the same
# method would give of all the people there are. Or of the *truth*: the edge that the plaza's people keep to.
# From 600 pairs of people each (`python -m studies.zones coverage quantile 200 centred default`, the
# hull likewise):

# %%
again, names = zones_study.recompute_coverage, ("25_coverage", "25_coverage_hull")
tables = [record.committed_table(name, again) for name in names]
coverage = pd.concat(tables)
limit = coverage["limit"].dropna()
record.check(
    "95 % intervals of the quantile hold its limit in 90 to 98 % of plazas, each quantity at each speed",
    limit.between(0.9, 0.98).all(),
    f"{limit.min():.3f} to {limit.max():.3f}",
    always=True,
)
coverage.pivot_table(["limit", "truth"], "quantity", ["plaza", "method"]).round(2)

# %%
levels = record.committed_table("25_levels", zones_study.recompute_levels)
levels = levels.set_index(["clearance", "q"])[["a", "b"]]
(100 * levels).round(1).rename(columns="{}, outside of the truth [cm]".format)

# %% [markdown]
# The truth is held less often, because the limit is another line. The share of encounters that may enter
# is 5 %; whether that ends right at the edge, or 1 cm inside, or 3 cm outside of it, hangs on how far people
# keep clear of the edge (`clearance`, mean, in m; `python -m studies.zones levels 3`), which the
# data does not tell. So an interval says how far other people of the same kind would move the zone.

# %% [markdown]
# ## A known zone on real paths
#
# Plazas are walked by our own rules. Real paths are not, but their truth is unknown. So a truth is imposed: of a
# time-shifted crowd, in which nobody minds anybody, the pairs are removed in which one person enters the other's
# ellipse, but for a share of careless pairs (`szlib.impose_zone`). What is left keeps a known zone on real paths.
# What do the two estimators find there, and does the 95 % interval hold the *truth*? (`python -m studies.imposed 6`)

# %%
imposed = record.committed_table("25_imposed", imposed_study.recompute, where="site == 'plaza'")
imposed = imposed[imposed["site"] != "plaza"]
by_estimator = imposed.groupby(["quantity", "method"])[["held", "width"]].mean()
errors = imposed.assign(error=lambda t: np.hypot(t["bias"], t["scatter"]))
by_estimator["error"] = errors.groupby(["quantity", "method"])["error"].mean()
held = by_estimator["held"].unstack()
for method in ("respect", "quantile"):
    record.key[f"truth held on real paths, {method}"] = float(held[method].mean())
record.check(
    "on real paths, intervals of the respect zone hold the truth more often than those of the quantile",
    (held["respect"] > held["quantile"]).all(),
    held.round(2).to_dict(),
    always=True,
)
by_estimator.unstack().round(2)

# %%
looks = {"respect": (figures.GREEN, "^-"), "quantile": (figures.BLUE, "s--")}
fig, panels = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
of_site = errors[errors["site"] == "grand-central"].assign(error=lambda t: 100 * t["error"])
for method, part in of_site.groupby("method"):
    shade, mark = looks[method]
    of_b, of_all = part[part["quantity"] == "b"], part.assign(held=100 * part["held"])
    for ax, line in zip(
        panels, (of_b.groupby("encounters")["error"], of_all.groupby("encounters")["held"]), strict=True
    ):
        ax.plot(line.mean(), mark, color=shade, label=method)
panels[1].axhspan(90, 98, color=figures.GREY, alpha=0.3, label="as it should be")
sizes = sorted(of_site["encounters"].unique())
for ax, name in zip(
    panels, ("error of the semi-axis b [cm]", "intervals that hold the truth [%]"), strict=True
):
    ax.set(xscale="log", xlabel="encounters", ylabel=name, ylim=(0, None))
    ax.set_xticks(sizes, [f"{n:,}" for n in sizes])
    ax.minorticks_off()
    ax.legend()
fig.suptitle(
    "A known zone on the paths of Grand Central: the respect zone and its intervals come nearer to it"
)
record.figure(fig, "imposed")

# %% [markdown]
# On plazas as well, with 5 cm of noise and intruders of any speed, whose people are seen for 20 s, so that the null model
# has encounters enough (`python -m studies.plazas`; one or two plazas a case, so these are rough shares):

# %%
on_plazas = record.committed_table("25_plazas", plazas_study.recompute, where="pairs == 150").query(
    "pairs > 150"
)
weighted = on_plazas.assign(held=on_plazas["held"] * on_plazas["plazas"])
by_case = weighted.groupby(["pairs", "centre", "method"]).agg(
    worst=("worst", "max"), held=("held", "sum"), n=("plazas", "sum")
)
by_case = by_case.assign(
    **{"held": by_case["held"] / by_case["n"], "largest error [cm]": 100 * by_case["worst"]}
)
by_case[["largest error [cm]", "held"]].unstack().round(2)

# %%
weighted["within"] = weighted["worst"] <= 0.035
bars = weighted.groupby(["method", "quantity"]).agg(
    cases=("within", "size"), within=("within", "sum"), held=("held", "sum"), plazas=("plazas", "sum")
)
bars["held"] = bars["held"] / bars["plazas"]
ours = bars.loc["respect"]
record.check(
    "on plazas too, intervals of the respect zone hold the truth more often than those of the quantile",
    (ours["held"] > bars.loc["quantile", "held"]).all(),
    bars["held"].round(2).to_dict(),
    always=True,
)
fulfilled = {name: "holds" if 0.9 <= held <= 0.98 else "does not hold" for name, held in ours["held"].items()}
lines = [
    f"| {name} | {row['within']:.0f} of {row['cases']:.0f} cases | {row['held']:.0%} | {fulfilled[name]} |"
    for name, row in ours.iterrows()
]
Markdown(
    "What is asked of the respect zone: each error at most 3.5 cm, and an interval that holds the truth in 90 to 98 %.\n\n"
    "| quantity | within 3.5 cm | interval holds | 90 to 98 % |\n|---|---|---|---|\n" + "\n".join(lines)
)

# %% [markdown]
# The semi-axis across, b, is known well. How far the zone reaches behind is not: a person behind me has me ahead, so a
# zone that reaches farther ahead hides its back. Then centre and semi-axis along the motion are several centimetres off
# in opposite directions, and their sum, the reach ahead, is nearer to the truth. The zone 0.20 m ahead is the worst case.
# The posterior alone was too narrow here: on other plazas it held centre and semi-axes in about 60 %. So it now carries
# the error of the model, measured there: a standard deviation of at least 5 cm along the motion and 1.2 cm across.

# %% [markdown]
# ## Several sites
#
# How near do strangers come elsewhere? A random-effects model (`szlib.pool`) gives the mean over sites and, with three sites
# or more, what to expect at a new one. Here are the radii of respect, all directions pooled, of notebook 06. The
# shape has no mean over sites yet: one site gives it.

# %%
radii = read_table("06_sites").query("kinds == 'strangers' and site != 'plaza'").set_index("site")
sites = {name: tuple(row) for name, row in radii[["radius", "radius_low", "radius_high"]].iterrows()}
pooled = szlib.pool(sites)
ax = figures.plot_forest(pooled)
ax.set_xlim(0.25, 4.0)
ax.set_xticks([0.25, 0.5, 1.0, 2.0, 4.0], ["0.25", "0.5", "1", "2", "4"])
ax.set_title("Two sites differ by more than their intervals")
record.figure(ax.figure, "forest")
print(pooled)

# %% [markdown]
# ## What moves the zone most
#
# Each parameter of the method alone, the others as in the paper, or at their defaults: on this data with the
# paper's zone, and on the real day with both estimators (`python -m studies.claims sensitivity`).

# %%
tracks = record.cache.tracks()
space = {"area": record.cache.find_area(tracks), "has_walls": record.cache.method.has_walls}
moved = sensitivity(tracks, **space, speed=zone_speed)
record.table(moved, "25_sensitivity")
most = moved.iloc[1:].assign(change=lambda t: (t["area"] / moved["area"].iloc[0] - 1).abs())
strongest = most.loc[most["change"].idxmax()]
record.key |= {"moves the zone most": strongest["parameter"], "by": f"{100 * strongest['change']:.0f} %"}
moved.round(2)


# %%
def moved_again(row: pd.Series) -> dict[str, float]:
    """The row of the plaza, from this run if it is of the plaza."""
    here = record.cache.is_synthetic and not record.changed
    now = moved if here else pd.concat(claims_study.move_zone("plaza", ("paper",)))
    same = now[(now["parameter"] == row["parameter"]) & (now["value"] == row["value"])]
    return same[["encounters", "a", "b", "area"]].iloc[0].to_dict()


# %%
quick = "data == 'plaza' and method == 'paper' and a == a and value == value"
saved = record.committed_table("25_sensitivity", moved_again, where=quick)
saved = saved[saved["data"] == "ATC day"]
fig, panels = plt.subplots(1, 3, figsize=(15, 4.6), layout="constrained")
figures.plot_sensitivity(moved, ax=panels[0]).set_title("This data, paper")
for ax, (method, part) in zip(panels[1:], saved.groupby("method"), strict=True):
    figures.plot_sensitivity(part, ax=ax).set_title(f"ATC day, {method}")
record.figure(fig, "tornado")

# %% [markdown]
# ## What it means for the robot
#
# A zone is known up to its interval. The four scenarios with the low, the middle and the high end of the quantile
# zone: what does the uncertainty about people cost the robot?

# %%
kept = zone.ellipse(zone_speed)  # the notebook ends here where the data is too little for this zone
line = zone.table().set_index("speed").loc[zone_speed]
size = {"low": (line["a_low"] / line["a"]), "middle": 1.0, "high": (line["a_high"] / line["a"])}
rows = []
for name in szlib.SCENARIOS:
    for end, scale in size.items():
        metrics = claims.run_scenario(name, kept.scaled(scale))
        rows.append(
            (
                name,
                end,
                line["a"] * scale,
                metrics["time_to_goal"],
                metrics["time_yielding"],
                metrics["outcome"],
            )
        )
driven = pd.DataFrame(
    rows, columns=["scenario", "zone", "a [m]", "time to goal [s]", "yields [s]", "outcome"]
)
driven.pivot(index="scenario", columns="zone", values=["time to goal [s]", "yields [s]"]).round(1)

# %%
# the runs are deterministic: the brackets hold the range over the four scenarios, no 95 % interval
trade = claims.measure_delay_by_size(zone.ellipses[zone_speed])
record.claim(trade.claim, trade.low > 0, str(trade))
fig, ax = plt.subplots(figsize=(7, 3.5), layout="constrained")
for (name, part), (shade, line) in zip(
    driven.groupby("scenario", sort=False),
    ((figures.BLUE, "-"), (figures.ORANGE, "--"), (figures.GREEN, "-."), (figures.RED, ":")),
    strict=True,
):
    ax.plot(part["a [m]"], part["time to goal [s]"], "o" + line, color=shade, label=name)
ax.set(xlabel="semi-major axis of the zone [m]", ylabel="time to goal [s]")
times = driven.groupby("scenario")["time to goal [s]"].agg(lambda t: t.max() - t.min())
wide = driven["a [m]"].max() - driven["a [m]"].min()
ax.set_title(f"{100 * wide:.1f} cm of uncertainty changes no time by more than {times.max():.1f} s")
ax.legend(fontsize=8)
record.figure(fig, "robot")

# %% [markdown]
# ## What a shorter barrier horizon saves
#
# "Despite having a shorter horizon than MPC, CBF can ensure stability, thereby increasing computational efficiency" (sec. 4):
# asserted, not measured. Here the paper's settings solve the same steps of the corridor with $N_h$ = 1 to 8, by IPOPT and
# by our solver (processor time of a step, ms, the median). Whether $N_h$ = 2 is enough for safety: notebook 21.

# %%
corridor, paper, ellipse = szlib.SCENARIOS["corridor"], szlib.MPCSettings.paper(), zone.ellipses[zone_speed]
way = szlib.simulate(corridor, szlib.MPCCBF(ellipse, walls=corridor.walls))
moments = [way.controller_inputs(t) for t in way.time[30:55]]
solve_times = {}
for solver, N_h in product(("ipopt", "sqp"), range(1, paper.N + 1)):
    settings = replace(paper, solver=solver, N_h=N_h)
    controller = szlib.MPCCBF(ellipse, walls=corridor.walls, settings=settings)
    clock = []
    for moment in moments:
        controller.step(*moment)
        clock.append(thread_time())
    solve_times[solver, N_h] = 1000 * np.diff(clock)  # without the first step, which builds the problem

# %%
costs = pd.DataFrame({key: [np.median(values)] for key, values in solve_times.items()}).T[0].unstack(0)
for solver, cost in costs.items():
    factor = float(cost[paper.N] / cost[2])
    name = f"a step with N_h = {paper.N} takes longer than with N_h = 2 ({solver})"
    record.claim(name, factor > 1, f"{factor:.2f} times as long")
longest = max(solve_times["ipopt", paper.N_h])
record.claim("each step with IPOPT takes less than 0.1 s", longest < 1000 * paper.dt, f"{longest:.0f} ms")
costs.rename_axis(index="N_h", columns="").round(2)

# %% [markdown]
# ## Sentences that no other notebook decides
#
# Some sentences of the paper have no notebook of their own, so the cells below decide them: about the corridor without
# the person, about gamma, the distance and wrong predictions, and about people at the ATC mall and at Grand Central.
# Notebook 28 lists every sentence with its verdict.

# %%
free = replace(corridor, people=())
alone = szlib.simulate(free, szlib.MPCCBF(ellipse, walls=free.walls, settings=paper))
middle = np.abs(alone.states[:, 0]) <= 2.0
slow = float(alone.speed[middle].min() / alone.speed.max())
record.claim("without the person the robot does not slow down in the corridor", slow > 0.8, f"to {slow:.0%}")

# %%
atlas = read_table("27_atlas").query("scene == 'corridor' and width == 4.6 and pace == 0.5")
arrives = atlas[atlas["size"] == 1.0].set_index("gamma")["time_to_goal"]
record.claim(
    "gamma from 0.03 to 0.07 changes the time to the goal of the corridor by 20 % or more",
    arrives[0.03] / arrives[0.07] >= 1.2,
    f"{arrives[0.03]:.1f} and {arrives[0.07]:.1f} s",
)
wrong = read_table("23_comparison").query("zone == 'fitted' and metric == 'flagged_steps'")
flagged = wrong[wrong["behaviour"] != "as expected"].groupby("formulation")["mean"].mean()
short, whole = float(flagged["szlib"]), float(flagged["whole horizon"])
record.claim(
    "with wrong predictions fewer steps are flagged with N_h = 2 than on the whole horizon",
    short < whole,
    f"{short:.2f} and {whole:.2f} steps in a world",
)

# %%
gap = compare_distances(ellipse, r_robot=paper.r_robot, eps=paper.eps)
uneven = 100 * (gap.farthest - gap.nearest)
record.claim(
    "h = 0 keeps the same distance to the zone on all sides, to 1 cm", uneven <= 1, f"{uneven:.1f} cm"
)

# %%
sites = read_table("06_sites").query("min_distance == 1").set_index(["site", "kinds"])
for name, site in {"ATC day": "atc-1hz", "Grand Central": "grand-central"}.items():
    for kinds in ("strangers", "opposite, crossing"):
        p = float(sites.loc[(site, kinds), "p_value"])
        record.claim(
            f"{name}, {kinds}: fewer come near than in 95 % of the null models", p <= 0.05, f"p = {p:.2g}"
        )
atc, central = (sites.loc[(site, "strangers")] for site in ("atc-1hz", "grand-central"))
both = [f"{each['radius_low']:.2f} to {each['radius_high']:.2f} m" for each in (atc, central)]
apart = max(atc["radius_low"], central["radius_low"]) > min(atc["radius_high"], central["radius_high"])
record.claim(
    "strangers keep different distances at the ATC mall and at Grand Central", apart, " and ".join(both)
)
everybody = float(sites.loc[("atc-1hz", "all"), "radius_high"])
value = f"{both[0]}, everybody at most {everybody:.2f} m"
record.claim("ATC day: strangers keep a larger distance than everybody", atc["radius_low"] > everybody, value)
nearest, usual = float(central["hull_a"]), float(central["radius_low"])
value = f"{nearest:.2f} m, most {usual:.2f} m"
record.claim("Grand Central: some come nearer than most strangers keep", nearest < usual, value)
record.claim("nobody at Grand Central comes nearer than most strangers keep", nearest >= usual, value)

# %%
asked = {name for names in paper_sentences.load_sentences()["held_by"] for name in names}
for row in everywhere.to_dict("records"):
    where = row["data"] if row["method"] == "-" else f"{row['data']}, {row['method']}"
    if f"{record.name[:2]}: {where}: {row['claim']}" in asked:
        record.claim(f"{where}: {row['claim']}", DECIDED.get(row["verdict"]), claims.format_finding(row))
about_zones = everywhere[is_shape & by_respect]
decided = about_zones[~about_zones["verdict"].str.startswith("not")]["data"].value_counts()
for name, site in {
    "no claim about the zone is decided by the ETH sequence": "ETH",
    "no claim about the zone is decided by Grand Central": "Grand Central",
}.items():
    number = int(decided.get(site, 0))
    record.claim(name, number == 0, f"{number} decided")

# %%
day = saved[saved["method"] == "quantile"]
change = (day.iloc[1:].set_index("parameter")["area"] / day["area"].iloc[0] - 1).abs()
most_of_day = change.groupby(level=0).max().idxmax()
supported = (table["verdict"] == "supported").sum()
Markdown(f"""**What it means.** {supported} of {len(table)} claims are supported by this data. Of the
method's own parameters {strongest["parameter"]} moves the paper's zone most here, by
{100 * strongest["change"]:.0f} %;
on the real ATC day, with the quantile zone, {most_of_day} does, by {100 * change.max():.0f} %. For the robot
the uncertainty about people counts for at most {times.max():.1f} s. A zone should be given with its interval,
its kinds of encounter, and its null model.""")

# %%
record.close()

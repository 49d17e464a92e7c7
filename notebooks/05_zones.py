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
#     label: zones
#     paper: sec. 2, fig. 5
#     aim: estimate a zone that does not shrink with more data, and say how far to trust it.
#     asks: How near do most people come, and how far can such a number be trusted?
#     needs:
#     - '04'
#     exercises:
#     - '3.4'
#     - '4.1'
#     - '4.3'
#     week: 2
# ---

# %% [markdown]
# # 5 - Social zones
#
# **Question.** How near do most people come, and how far can such a number be trusted?
#
# **Expectation.** One careless person shrinks the hull. The distance that 95 of 100 people keep hardly changes when
# more people come. According to the paper the zone reaches farther ahead than behind.

# %% [markdown]
# [Start](00_start_here.ipynb) · before: [04](04_hull.ipynb) · next: [6 - Respect or
# emptiness?](06_respect.ipynb) · [paper](https://arxiv.org/abs/2405.15101): sec. 2, fig. 5 · 25 min · needs
# [04](04_hull.ipynb) · exercises:
# [3.4](exercises/sheet3_zones.ipynb#3.4-The-quantile-zone-in-one-direction-(10-min)),
# [4.1](exercises/sheet4_own_zone.ipynb#4.1-A-zone-of-your-own-(an-evening,-150-min)),
# [4.3](exercises/sheet4_own_zone.ipynb#4.3-In-your-own-words-(10-min))
#
# **Afterwards you can** estimate a zone that does not shrink with more data, and say how far to trust it.
# **Words.** *bootstrap*: draw people from the data at random, with repetition, and estimate again: how far
# a result moves.

# %% jupyter={"source_hidden": true} tags=["parameters"]
# Parameters of this notebook
data = "synthetic"  # "synthetic", "atc-1hz", or files of tracks
area = ""  # "": the data's own; or "X0 X1 Y0 Y1" [m], "auto", a polygon (WKT, or its file)
seed = 0
results = "../results"
r_max = 2.0  # as in chapter 03 [m]
q = 0.05  # share of the encounters in a direction that may enter the quantile zone there
zone_speed = 1.1  # of the zone [m/s]

# %% jupyter={"source_hidden": true}
# Set-up, and the figure
import warnings

import matplotlib.pyplot as plt
import numpy as np
import plots
from IPython.display import Markdown
from laboratory import show_sliders
from studies import paper_claims as claims
from studies import quantile_zone, real_day

import szlib
from szlib.plaza.settings import PlazaSettings
from szlib.workbook import figures
from szlib.workbook.record import ASSUMED, PAPER, NotebookRecord, parameters, read_table
from szlib.zones.ellipses import DIRECTIONS
from szlib.zones.outliers import smooth_paths

warnings.simplefilter("ignore", szlib.DataWarning)  # few people on a side: the intervals say it
record = NotebookRecord("05_zones", globals())
samples = record.cache.encounters()
fit = record.cache.method.fit_options()
zone = szlib.SocialZone.fit(samples, method=quantile_zone.NAME, q=q, seed=seed, **fit)
truth = {v: PlazaSettings().true_zone(v) for v in zone.ellipses} if record.cache.is_synthetic else {}
kept = zone.ellipse(zone_speed)
bands = zone.uncertainty.bands[zone.uncertainty.bands["speed"] == zone_speed]
widths = 100 * (bands["high"] - bands["low"])
fig = plots.draw_zone_and_reach(kept, truth.get(zone_speed), bands, zone_speed)
record.figure(fig, "zone")

# %% jupyter={"source_hidden": true}
# Parameters, with sources
parameters(
    [
        ("q", q, ASSUMED, "share of the encounters in a direction that may enter the zone there"),
        ("sector", "35 deg", ASSUMED, "25 to 45 deg do as well"),
        ("speeds pooled", "0.2 m/s slower to faster", ASSUMED, "few people walk at exactly one speed"),
        ("walking speed", f"{zone_speed:g} m/s", PAPER, "sec. 4: that of the zone that the robot keeps"),
        ("r_max", f"{r_max:g} m", PAPER, "see chapter 03"),
    ]
)

# %% jupyter={"source_hidden": true}
# How this data differs from the plaza
table = zone.table().set_index("speed")
row, at = table.loc[zone_speed], f"({zone_speed:g})"
record.key |= {f"a{at}": kept.semi_axes[0], f"b{at}": kept.semi_axes[1], f"x{at}": kept.center[0]}
real_day.compare_with_plaza(
    record,
    {
        "encounters": f"{samples['encounter'].nunique():,}",
        f"quantile zone at {zone_speed:g} m/s": "{:.2f} m x {:.2f} m".format(*kept.semi_axes),
        "95 % interval of the longer semi-axis": f"{row['a_low']:.2f} to {row['a_high']:.2f} m",
    },
    note="Chapter 06 compares with chance, and says whether a zone of this data can be used.",
)

# %% [markdown]
# The band is an interval of **where 5 % come nearer**, not of the zone that people keep (dotted on the plaza, where
# the two differ by some centimetres; "Does it find the true zone?" says why). The zone of the robot comes in
# chapter 06, with an interval that is meant to hold the truth.
#
# ## A number first
#
# Forty people passed on your left. These were the nearest approaches, sorted: **0.31**, 0.74, 0.75, 0.77, 0.80, ... m.
#
# The hull takes the first: 0.31 m. That person did not care. The *quantile* lets a share $q$ = 5 % enter. 5 % of 40
# are two people, so the radius to the left is the second number: **0.74 m**.
#
# Now forty more come, with 0.28, 0.73, 0.76, ... m. One of them did not care either. The hull shrinks to 0.28 m. 5 %
# of 80 are four people: 0.28, 0.31, 0.73, **0.74**. The quantile stays.
#
# $$r_q(\theta) = \min\{\,r : \text{at least a share } q \text{ of the encounters came within } r\,\}$$
#
# - $\theta$ is the direction, seen from the reference pedestrian. Only encounters in which the other person was seen
#   there count, each once, with its nearest approach there.
# - $q$ is the share of these encounters that may enter the zone there.

# %% [markdown]
# ## The quantile zone in ten lines


# %%
def radius_by_direction(samples, speed):
    near = samples[(samples["distance"] <= r_max) & (abs(samples["speed"] - speed) <= 0.2)]
    angle = np.degrees(near["los_angle"])
    radii = []
    for direction in range(-180, 180, 5):
        is_there = abs((angle - direction + 180) % 360 - 180) <= 17.5  # a sector of 35 degrees
        nearest = near[is_there].groupby("encounter")["distance"].min()
        some = len(nearest) > 0
        radii.append(np.quantile(nearest, q, method="inverted_cdf") if some else np.nan)
    return np.array(radii)


by_hand = radius_by_direction(samples, zone_speed)

# %% [markdown]
# The same with the library, in two lines:

# %%
fitted = szlib.SocialZone.fit(
    samples, method=quantile_zone.NAME, q=q, r_max=r_max, speeds=[zone_speed], n_resamples=0
)
library = fitted.shape.radii[0]
print(f"by hand minus library: {np.nanmin(by_hand - library):+.3f} to {np.nanmax(by_hand - library):+.3f} m")

# %% [markdown]
# They differ. The library does one thing first.
#
# **What do you think?** A sensor errs by a few centimetres, up and down, ten times a second. We take the *nearest* of
# some thirty positions. Is that, on average, too near, too far or right?

# %% jupyter={"source_hidden": true}
# Checks, and the answer
angle, distance = smooth_paths(samples)
smoothed = samples.assign(los_angle=angle, distance=distance)
off = float(np.nanmax(np.abs(radius_by_direction(smoothed, zone_speed) - library)))
ok = off < 1e-9 and (np.isnan(by_hand) == np.isnan(library)).mean() > 0.9
record.check(
    "on smoothed paths the ten lines give the library's radii", ok, f"largest difference {1000 * off:.1f} mm"
)
before = samples["distance"] * np.exp(1j * samples["los_angle"])  # as complex numbers
moved = float(np.abs(distance * np.exp(1j * angle) - before).mean())
record.check("smoothing moves a position by less than 10 cm", moved < 0.1, f"{100 * moved:.1f} cm on average")
noise = np.random.default_rng(seed).normal(0, 0.05, (10_000, 30)).min(axis=1).mean()
Markdown(
    f"""<details><summary>Answer</summary>

Too near: the nearest of several noisy positions has an error that points towards the person. With an error of 5 cm and
30 independent positions it is {-100 * noise:.0f} cm too near. So the library first smooths each path, over 0.7 s before
and after. The largest difference between the ten lines and the library, both on smoothed paths: {1000 * off:.1f} mm.

</details>"""
)

# %% [markdown]
# The radii are known in 72 directions, each with its own error. The library *fits* an ellipse to them by least squares.
# (The smallest ellipse *around* them, as in chapter 04, would follow the largest errors.)

# %% jupyter={"source_hidden": true}
# Figure
fig, ax = plt.subplots(figsize=(7.5, 3.9), layout="constrained")
unit = np.column_stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
ax.plot(*(library[:, None] * unit).T, ".", color=figures.GREY, markersize=7, label="radius in a direction")
ax.plot(*kept.curve().T, color=figures.BLUE, linewidth=2, label="fitted ellipse")
if truth:
    ax.plot(*truth[zone_speed].curve().T, ":", color=figures.RED, linewidth=2, label="truth")
ax.plot(0, 0, marker=(3, 0, -90), color=figures.BLACK, markersize=10)
ax.legend(loc="center left", bbox_to_anchor=(1, 0.5))
figures.label_metres(ax, "72 radii and one ellipse: {:.2f} m x {:.2f} m".format(*kept.semi_axes), person=True)
record.figure(fig, "quantile")

# %% [markdown]
# ## What is an interval?
#
# On another day other people would have come, and the zone would be a little different. How different? We have no other
# day. So we make some from the people whom we have: put their names in a hat, draw as many names *with replacement*, and
# estimate again. Some people are drawn twice, others not at all. This is the **bootstrap** (Efron, 1979).
#
# The middle 95 % of a thousand such radii are the 95 % **interval**. Here for the left side alone:

# %%
near = smoothed[(smoothed["distance"] <= r_max) & (abs(smoothed["speed"] - zone_speed) <= 0.2)]
is_left = abs(np.degrees(near["los_angle"]) - 90) <= 17.5
left_side = near[is_left].groupby("encounter")["distance"].min().to_numpy()
rng = np.random.default_rng(seed)


def redraw(n):
    return [np.quantile(rng.choice(left_side, n), q, method="inverted_cdf") for _ in range(1000)]


all_drawn, quarter_drawn = redraw(len(left_side)), redraw(len(left_side) // 4)

# %% [markdown]
# **What do you think?** With a quarter of the people: is the interval half as wide, as wide, twice as wide or four times
# as wide?

# %% jupyter={"source_hidden": true}
# Figure
bins = np.linspace(min(quarter_drawn) - 0.01, max(quarter_drawn) + 0.01, 40)
fig, ax = plt.subplots(figsize=(8, 3.6), layout="constrained")
widths = []
for drawn, n, colour, height in (
    (all_drawn, len(left_side), figures.BLUE, -25),
    (quarter_drawn, len(left_side) // 4, figures.ORANGE, -60),
):
    low, high = np.quantile(drawn, [0.025, 0.975])
    widths.append(high - low)
    label = f"{n} encounters: {low:.3f} to {high:.3f} m"
    ax.hist(drawn, bins=bins, color=colour, alpha=0.6, label=label)
    ax.hlines(height, low, high, color=colour, linewidth=5)
ax.axvline(
    np.quantile(left_side, q, method="inverted_cdf"), color=figures.BLACK, linestyle="--", label="the data"
)
ax.set(xlabel="radius of the zone to the left [m]", ylabel="draws of 1000", yticks=range(0, 251, 50))
ax.set_title(f"A quarter of the people, {widths[1] / widths[0]:.1f} times the interval (bars: middle 95 %)")
ax.legend(loc="center left", bbox_to_anchor=(1, 0.5))
record.figure(fig, "interval")

# %% [markdown]
# <details><summary>Answer</summary>
#
# About twice: a width falls with the square root of the number of people. (Not exactly, as an extreme quantile of few
# people jumps from one person to the next.) To halve an interval, watch four times as long.
#
# The library draws *pairs* of people, not encounters: two encounters of the same pair are not independent. It also
# corrects for bias.
#
# </details>

# %% [markdown]
# ## From few encounters to many
#
# **What do you think?** We estimate the zone from few encounters, then from more and more. What becomes
# of the hull of chapter 04, and of the quantile? And does each interval contain its own estimate?

# %% jupyter={"source_hidden": true}
# The zone by number of encounters, with both methods
everyone = samples["encounter"].unique()
order = np.random.default_rng(seed).permutation(everyone)
sizes = [n for n in (150, 300, 600, 1200) if n < 0.8 * len(everyone)] + [len(everyone)]
options = {"r_max": r_max, "n_resamples": 100}
paper = szlib.SocialZone.fit(samples, method="paper", speeds=fit["speeds"], **options)
found = {"paper": {}, "quantile": {}}
for n in sizes:
    part = samples[samples["encounter"].isin(order[:n])]
    for method, more in (("paper", {}), (quantile_zone.NAME, {"q": q})):
        try:
            one = szlib.SocialZone.fit(part, method=method, speeds=[zone_speed], **options, **more)
        except szlib.ZoneError:  # too few people on some side
            continue
        found[method][n] = one.table().iloc[0]

# %% jupyter={"source_hidden": true}
# Figure
fig, ax = plt.subplots(figsize=(8, 3.8), layout="constrained")
looks = {
    "paper": (figures.ORANGE, "o", "hull (the paper's)", 0.96),
    "quantile": (figures.BLUE, "s", "quantile", 1.04),
}
for method, (colour, marker, name, aside) in looks.items():
    for n, each in found[method].items():
        ax.vlines(n * aside, each["a_low"], each["a_high"], color=colour, linewidth=4, alpha=0.5)
        ax.plot(n * aside, each["a"], marker, color=colour)
    ax.plot([], [], marker, color=colour, label=f"{name}, and its 95 % interval")
if truth:
    ax.axhline(truth[zone_speed].semi_axes[0], color=figures.RED, linestyle=":", label="truth")
ax.set(xscale="log", xticks=sizes, xticklabels=[f"{n:,}" for n in sizes])
ax.minorticks_off()
ax.set(
    xlabel="encounters",
    ylabel="longer semi-axis [m]",
    title="The interval of a hull lies below its value: it still shrinks",
)
ax.legend(loc="center left", bbox_to_anchor=(1, 0.5))
record.figure(fig, "sizes")

# %% [markdown]
# <details><summary>Answer</summary>
#
# On the plaza the quantile levels out with some hundred encounters, and its interval lies around it. The hull is an
# *extreme*: the nearest people who ever came. More people can only bring nearer ones. So its interval, which
# should contain the hull of *all* people there are, lies below the estimate itself.
#
# </details>

# %% [markdown]
# ## The zone at each walking speed

# %% jupyter={"source_hidden": true}
# Figure
fig, ax = plt.subplots(figsize=(8, 3.8), layout="constrained")
for name, colour, marker, text in (
    ("a", figures.BLUE, "s", "longer semi-axis a"),
    ("b", figures.GREEN, "^", "shorter, b"),
):
    ends = abs(table[[f"{name}_low", f"{name}_high"]].sub(table[name], axis=0)).to_numpy().T
    label = f"{text}, and its 95 % interval"
    ax.errorbar(
        table.index, table[name], ends, color=colour, fmt=marker, markersize=3, capsize=6, label=label
    )
    if truth:
        ax.plot(list(truth), [e.semi_axes[name == "b"] for e in truth.values()], ":", color=figures.RED)
ax.plot([], [], ":", color=figures.RED, label="truth" if truth else "_nothing")
grown = table["a"].iloc[-1] - table["a"].iloc[0]
title = f"From {table.index[0]:g} to {table.index[-1]:g} m/s the zone becomes {100 * abs(grown):.0f} cm {'longer' if grown > 0 else 'shorter'}"
ax.set(xlabel="walking speed [m/s]", ylabel="semi-axis [m]", title=title)
ax.legend(loc="center left", bbox_to_anchor=(1, 0.5))
record.figure(fig, "zones")

# %% [markdown]
# In JupyterLab a slider for the walking speed stands here:


# %%
def draw_zone(speed: float) -> plt.Axes:
    ax = figures.label_metres(plt.subplots()[1], f"Where 5 % come nearer, at {speed:g} m/s", person=True)
    ax.plot(*zone.ellipse(speed).curve().T, color=figures.BLUE)
    ax.set(xlim=(-2, 2), ylim=(-2, 2))
    return ax


low, high = (round(v, 2) for v in zone.speed_range)
show_sliders(draw_zone, speed=(1.1, low + 0.1, high - 0.1, 0.05))

# %% [markdown]
# ## Does it find the true zone?
#
# On the plaza we know the zone that everybody respects, except a few intruders. Between this truth and our estimate lie the
# noise of the sensor, gaps, the clock, the conditions of an encounter, and outliers. Both methods must still find the true
# zone. On other data nobody knows the truth.

# %% jupyter={"source_hidden": true}
# Checks
for name, method in (("quantile", zone), ("the paper's zone", paper)) if truth else ():
    for v in (0.7, 0.9, 1.1, 1.3):
        one, true = method.ellipses[v], truth[v]
        off = np.abs([*np.subtract(one.center, true.center), *np.subtract(one.semi_axes, true.semi_axes)])
        turn = abs(np.degrees(np.angle(np.exp(2j * (one.angle - true.angle))) / 2))
        record.check(
            f"{name}: true zone found at {v} m/s (5 cm, 10 deg)",
            off.max() < 0.05 and turn < 10,
            f"{off.max():.3f} m, {turn:.1f} deg",
        )

# %% [markdown]
# ## Is it larger in front?
#
# The paper says so. But where few people were in view, a zone is uncertain. So subtract the reach behind from the reach
# ahead, and look at the interval of this difference: does it exclude 0?

# %% jupyter={"source_hidden": true}
# Checks, and the answer
near = samples[samples["distance"] <= r_max]
few = near.loc[np.abs(near["los_angle"]) > 3 * np.pi / 4, "encounter"].nunique()
ahead = claims.measure_reach_ahead(zone, speed=zone_speed)
claim = f"the zone at {zone_speed:g} m/s reaches farther ahead than behind"
record.claim(claim, ahead.verdict, f"{ahead}; {few} encounters were in view behind")
Markdown(
    f"""<details><summary>Answer</summary>

The reach ahead minus the reach behind is {ahead.effect:+.2f} m, with an interval from {ahead.low:+.2f} to {ahead.high:+.2f} m; {few:,} encounters
were in view behind. {"On the plaza it is so by construction: the true zone reaches 0.10 m farther ahead. The data shows only a part of it. " * bool(truth)}A
person who is behind me has me ahead of them. If their zone ahead is larger than mine behind, the larger one keeps us apart, and
few people come to the edge of my zone behind.

</details>"""
)

# %% [markdown]
# ## The plaza and a real day, side by side
#
# The plaza is made of people whose zone we know. The real day is 2012-10-24 in the ATC mall in Osaka, thinned to 1 Hz
# (from 12 to 13 h with a seventh of the people of the next hour). The paper has 92 days of 10 to 40 Hz. A copy of this chapter on the real day is in
# [real_day/05_zones.ipynb](real_day/05_zones.ipynb).

# %% jupyter={"source_hidden": true}
# Table
hull = paper.ellipse(zone_speed)
atc = read_table("06_sites").query("site == 'atc-1hz' and kinds == 'all'").iloc[0]
name = "plaza" if truth else "this data"
Markdown(
    f"""| | {name} | ATC day | paper |
|---|---|---|---|
| encounters | {len(everyone):,} | {atc["encounters"]:.0f} | 16,181 |
| hull at {zone_speed:g} m/s, longer semi-axis | {hull.semi_axes[0]:.2f} m | {atc["hull_a"]:.2f} m (1.1 m/s) | only a figure, no number |

With {atc["encounters"]:.0f} encounters the real day has fewer than 20 people on several sides. Chapter 06 finds more in it, and says what
stands against its zone."""
)

# %% jupyter={"source_hidden": true}
# Two common mistakes
outside = ""
if truth:
    a = truth[zone_speed].semi_axes[0]
    holds = row["a_low"] <= a <= row["a_high"]
    outside = (
        f" Here the true semi-axis is {a:.2f} m, and the interval {row['a_low']:.2f} to {row['a_high']:.2f} m "
        f"{'holds' if holds else 'does not hold'} it."
    )
Markdown(
    f"""## Two common mistakes

- **"With 95 % the true zone is in the interval."** No. The interval says how far the *estimate* moves when other people
  come. What is wrong with the method for any people, it does not see: most people leave a few centimetres more than the
  zone demands, and no data says how many.{outside}
- **"A narrow interval means that people keep out."** No. People who ignore each other have a zone with a narrow interval
  too. Chapter 06 compares with them."""
)

# %% jupyter={"source_hidden": true}
# What we know now
first, last = (found["quantile"][n]["a"] for n in (min(found["quantile"]), max(found["quantile"])))
Markdown(
    f"""**What we know now.** At {zone_speed:g} m/s the zone is {kept.semi_axes[0]:.2f} m x {kept.semi_axes[1]:.2f} m. In each
direction some {100 * q:g} % of the encounters come nearer. These are different encounters in each direction, so more than
{100 * q:g} % enter the zone somewhere. The 95 % interval of the longer semi-axis is {row["a_low"]:.2f} to {row["a_high"]:.2f} m. From {min(found["quantile"]):,} to {max(found["quantile"]):,} encounters this
semi-axis changed by {100 * (last - first):+.0f} cm. This describes where people were. Do they keep out of this zone, or is it only empty?
Chapter 06 asks, and estimates the zone that the robot keeps."""
)

# %% jupyter={"source_hidden": true}
# Summary of the checks
record.close()

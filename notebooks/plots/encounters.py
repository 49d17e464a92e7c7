"""Figures of encounters: paths, and where the other person is (notebook 02)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from szlib.core.checks import check_columns, check_rows
from szlib.encounters.occupants import SAMPLE_COLUMNS
from szlib.tracks.clock import COLUMNS, nearest_tick
from szlib.workbook.figures.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    RED,
    SEQUENCE,
    add_legend_below,
    draw_person,
    get_axes,
    label_metres,
)

_N_BINS = 40  # cells across r_max, or twice r_max: 5 or 10 cm for the paper's 2 m


def reference_frame(tracks: pd.DataFrame, samples: pd.DataFrame) -> pd.DataFrame:
    """Transform both people's paths of each encounter to the reference pedestrian's frame *at the opening*.

    Parameters
    ----------
    tracks : the track table in which the encounters were found.
    samples : samples as from `szlib.find_encounters`, before outliers are removed: the first sample of an
        encounter is its opening.

    Returns
    -------
    One row for each row of `samples`, in their order: encounter, t [s], ref_x, ref_y, other_x, other_y [m].
    x points along the motion at the opening, y to the left (paper, fig. 2).

    Raises
    ------
    DataError : a table lacks a column or is empty, or a sample is not in `tracks`.

    Examples
    --------
    >>> import szlib
    >>> import plots
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=20))
    >>> tracks = szlib.read_tracks(plaza)
    >>> paths = plots.reference_frame(tracks, szlib.find_encounters(tracks))
    >>> list(paths.columns)
    ['encounter', 't', 'ref_x', 'ref_y', 'other_x', 'other_y']
    """
    ref, oth = match_rows(tracks, samples)
    opening = ref.groupby("encounter")["tick"].transform("idxmin").to_numpy()
    x, y, vx, vy = (ref[name].to_numpy()[opening] for name in ("x", "y", "vx", "vy"))
    cos, sin = np.cos(np.arctan2(vy, vx)), np.sin(np.arctan2(vy, vx))
    out = {"encounter": samples["encounter"].to_numpy(), "t": samples["t"].to_numpy()}
    for person, rows in (("ref", ref), ("other", oth)):
        dx, dy = rows["x"].to_numpy() - x, rows["y"].to_numpy() - y
        out |= {f"{person}_x": cos * dx + sin * dy, f"{person}_y": cos * dy - sin * dx}
    return pd.DataFrame(out)


def match_rows(tracks: pd.DataFrame, samples: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The rows of `tracks` of the reference pedestrian and of the other person, for each of `samples`.

    Both tables have the columns encounter, tick, x, y [m], vx, vy [m/s], in the order of the samples.  Raises
    DataError as `reference_frame`.
    """
    check_columns(tracks, COLUMNS)
    check_columns(samples, SAMPLE_COLUMNS[:5])
    people = tracks[tracks["id"].isin(samples["ref_id"]) | tracks["id"].isin(samples["other_id"])]
    people = people[["day", "id", "x", "y", "vx", "vy"]].assign(
        tick=nearest_tick(people["t"].to_numpy(float))
    )
    keys = samples[["encounter", "day", "ref_id", "other_id"]].assign(
        tick=nearest_tick(samples["t"].to_numpy(float))
    )
    ref, oth = (
        keys.merge(
            people,
            how="left",
            left_on=["day", column, "tick"],
            right_on=["day", "id", "tick"],
        )
        for column in ("ref_id", "other_id")
    )
    is_known = ref["x"].notna() & oth["x"].notna()
    expected = "this sample is not in these tracks; pass the tracks it was found in"
    check_rows(samples, is_known, SAMPLE_COLUMNS[:5], expected)
    return ref, oth


def plot_encounter_paths(paths: pd.DataFrame, *, n_shown: int = 200, ax: Axes | None = None) -> Axes:
    """Plot the paths of both people in the reference pedestrian's first frame (paper, fig. 2).

    A dot is the start of the other person's path. An arrow's head is the end of a path; it points in the
    direction of the last half second.

    Parameters
    ----------
    paths : table as from `reference_frame`.
    n_shown : number of encounters to draw, evenly spread over all.
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> import plots
    >>> t = np.arange(31) / 10
    >>> paths = pd.DataFrame({"encounter": 0, "t": t, "ref_x": t, "ref_y": 0.0, "other_x": 5 - t})
    >>> paths["other_y"] = 1.0
    >>> plots.plot_encounter_paths(paths).get_title()
    "Paths in the reference pedestrian's first frame, n = 1"
    """
    ax = get_axes(ax, size=(7, 5.5))
    every = [g for _, g in paths.groupby("encounter", sort=True)]
    shown = [every[i] for i in np.unique(np.linspace(0, len(every) - 1, n_shown).round().astype(int))]
    for prefix, colour, name in (
        ("other", BLUE, "other person"),
        ("ref", ORANGE, "reference pedestrian"),
    ):
        lines = [g[[f"{prefix}_x", f"{prefix}_y"]].to_numpy() for g in shown]
        ax.add_collection(LineCollection(lines, colors=colour, linewidths=0.6, alpha=0.5, label=name))
        ends, before = (np.array([line[at] for line in lines]) for at in (-1, max(-6, -len(lines[0]))))
        for (x, y), heading in zip(ends, np.arctan2(*(ends - before).T[::-1]), strict=True):
            draw_person(ax, x, y, heading, color=colour, markersize=4, markeredgewidth=0)
    starts = np.array([[g["other_x"].iloc[0], g["other_y"].iloc[0]] for g in shown])
    ax.plot(
        *starts.T,
        ".",
        color=BLACK,
        markersize=3,
        label="start of the other person's path",
    )
    ax.autoscale_view()
    ax.plot(
        [],
        [],
        marker=(3, 0, -90),
        color=GREY,
        linestyle="",
        label="end of a path, and its direction",
    )
    add_legend_below(ax)
    return label_metres(
        ax,
        f"Paths in the reference pedestrian's first frame, n = {len(shown)}",
        person=True,
    )


def draw_space_and_paths(paths: pd.DataFrame, *, n_shown: int = 25) -> Figure:
    """Draw the paper's attentional space with a person at 45 deg, beside the paths of encounters.

    Parameters
    ----------
    paths : table as from `reference_frame`.
    n_shown : largest number of encounters to draw.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> import plots
    >>> t = np.arange(31) / 10
    >>> paths = pd.DataFrame({"encounter": 0, "t": t, "ref_x": t, "ref_y": 0.0, "other_x": 5 - t})
    >>> figure = plots.draw_space_and_paths(paths.assign(other_y=1.0))
    >>> figure.axes[1].get_title()
    '1 of 1 encounters'
    """
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(10.5, 3.8), layout="constrained", width_ratios=(1, 1.25)
    )
    left.add_patch(Rectangle((0, -2), 5, 4, color=BLUE, alpha=0.2, label="attentional space"))
    left.plot(0, 0, marker=(3, 0, -90), color=ORANGE, ms=14, ls="", label="reference pedestrian")
    left.plot(1, 1, "o", color=BLUE, ms=9, label="other person")
    left.plot([0, 1], [0, 1], ":", color=BLACK)
    left.annotate("1.41 m, at 45°", (1.15, 1.15))
    left.set(xlim=(-0.7, 5.4), ylim=(-2.3, 3.9))
    label_metres(left, "Seen at 45°: ahead, to the left", person=True)
    left.legend(loc="upper right", fontsize=8)
    plot_encounter_paths(paths, n_shown=n_shown, ax=right)
    n_paths = paths["encounter"].nunique()
    right.set_title(f"{min(n_shown, n_paths)} of {n_paths:,} encounters")
    right.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
    return figure


def plot_relative_positions(samples: pd.DataFrame, *, r_max: float = 2.0, ax: Axes | None = None) -> Axes:
    """Plot where the other person is around the reference pedestrian (paper, fig. 3a).

    One encounter in twenty comes nearer than the dotted circle.

    Parameters
    ----------
    samples : table as from `szlib.find_encounters`.
    r_max : largest distance [m].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> import plots
    >>> angle = np.linspace(-3, 3, 90)
    >>> samples = pd.DataFrame({"encounter": range(90), "los_angle": angle, "distance": 1.0})
    >>> plots.plot_relative_positions(samples).get_title()
    'One encounter in twenty comes nearer than 1.00 m'
    """
    ax = get_axes(ax, size=(6.2, 4.8))
    close = samples[samples["distance"] <= r_max]
    x, y = (close["distance"] * part(close["los_angle"]) for part in (np.cos, np.sin))
    edges = np.linspace(-r_max, r_max, _N_BINS + 1)
    _draw_density(ax, x, y, (edges, edges))
    radius = float(close.groupby("encounter")["distance"].min().quantile(0.05))
    ax.add_patch(Circle((0, 0), radius, fill=False, linestyle=":", linewidth=2, color=RED))
    draw_person(ax, 0, 0, 0, color=RED, markersize=12)
    return label_metres(ax, f"One encounter in twenty comes nearer than {radius:.2f} m", person=True)


def plot_distance_by_direction(samples: pd.DataFrame, *, r_max: float = 2.0, ax: Axes | None = None) -> Axes:
    """Plot the distance of the other person by line-of-sight angle (paper, fig. 3b).

    The line is the 5 % quantile of the nearest approaches in each 15 deg, where there are at least five.

    Parameters
    ----------
    samples : table as from `szlib.find_encounters`.
    r_max : largest distance [m].
    ax : axes to draw on; None makes new ones.

    Examples
    --------
    >>> import numpy as np, pandas as pd
    >>> import plots
    >>> angle = np.linspace(-3, 3, 90)
    >>> samples = pd.DataFrame({"encounter": range(90), "los_angle": angle, "distance": 1.0})
    >>> ax = plots.plot_distance_by_direction(samples)
    """
    ax = get_axes(ax, size=(7, 4))
    close = samples[samples["distance"] <= r_max]
    angle = np.degrees(close["los_angle"])
    edges = np.linspace(-180, 180, 73), np.linspace(0, r_max, _N_BINS + 1)
    _draw_density(ax, angle, close["distance"], edges, ("deg", "m"))
    sector = (np.floor(angle / 15) * 15 + 7.5).rename("sector")
    nearest = close.groupby([sector, "encounter"])["distance"].min().groupby("sector")
    edge = nearest.quantile(0.05).where(nearest.size() >= 5).reindex(np.arange(-172.5, 180, 15))
    ax.plot(
        edge.index,
        edge,
        "o-",
        color=RED,
        markersize=4,
        label="one encounter in twenty comes nearer",
    )
    ax.set(
        xlabel="line-of-sight angle [deg] (left is positive)",
        ylabel="distance [m]",
        ylim=(0, r_max),
    )
    ax.set(
        xlim=(-180, 180),
        xticks=range(-180, 181, 45),
        title="How near people come, by direction",
    )
    add_legend_below(ax, gap=0.16)
    return ax


def _draw_density(
    ax: Axes,
    x: pd.Series,
    y: pd.Series,
    edges: tuple[np.ndarray, np.ndarray],
    units: tuple[str, str] = ("m", "m"),
) -> None:
    """Draw the number of samples in each cell on a log scale; empty cells stay white."""
    counts = np.histogram2d(x, y, bins=edges)[0].T
    shown = np.ma.masked_equal(counts, 0)
    top = max(float(counts.max(initial=0)), 2.0)
    image = ax.pcolormesh(*edges, shown, cmap=f"{SEQUENCE}_r", norm=LogNorm(1, top), rasterized=True)
    sides = (f"{edge[1] - edge[0]:.2g} {unit}" for edge, unit in zip(edges, units, strict=True))
    cell = " x ".join(sides)
    ax.figure.colorbar(image, ax=ax, shrink=0.9, label=f"samples in a cell of {cell} (log scale)")

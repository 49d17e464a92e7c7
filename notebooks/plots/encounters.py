"""Figures of encounters: paths, a recorded encounter in motion, where the other person is (notebook 02)."""

from __future__ import annotations

import io

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image

from szlib.core.checks import check_columns, check_rows
from szlib.core.errors import DataError
from szlib.encounters.samples import SAMPLE_COLUMNS
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
from szlib.zones.ellipses import Ellipse

_HALF_TICK = 0.05  # half a step of the clock of tracks [s]


_REFERENCE = "reference pedestrian"


_PEOPLE = {
    _REFERENCE: ORANGE,
    "other person": BLUE,
}  # colours of the two people of an encounter


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


def animate_encounter(
    tracks: pd.DataFrame,
    samples: pd.DataFrame,
    encounter: int | None = None,
    *,
    zone: Ellipse | None = None,
    margin: float = 2.0,
    every: float = 0.2,
    width: float = 5.5,
) -> bytes:
    """Animate a recorded encounter: both people's real paths, in the time in which they walked.

    Parameters
    ----------
    tracks : the track table in which the encounters were found.
    samples : table as from `szlib.find_encounters`.
    encounter : its number; None: the one whose nearest approach is the median.
    zone : a zone in the person's frame, to be drawn around the reference pedestrian.
    margin : time before and after the encounter that is shown as well [s].
    every : time between two frames [s].
    width : width of the picture [inch].

    Returns
    -------
    An animated GIF, which a browser, `IPython.display.Image` or `NotebookRecord.animation` shows.

    Raises
    ------
    DataError : there is no such encounter, or its people are not in the tracks.

    Examples
    --------
    >>> import szlib
    >>> import plots
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=20))
    >>> tracks = szlib.read_tracks(plaza)
    >>> gif = plots.animate_encounter(tracks, szlib.find_encounters(tracks), every=1.0)
    >>> gif[:6]
    b'GIF89a'
    """
    nearest = samples.groupby("encounter")["distance"].min().sort_values()
    number = nearest.index[len(nearest) // 2] if encounter is None and len(nearest) else encounter
    shown = samples[samples["encounter"] == number]
    if shown.empty:
        raise DataError(f"encounter {number!r} is not among the {len(nearest)} encounters of the samples")
    begin, end, day = shown["t"].min(), shown["t"].max(), str(shown["day"].iloc[0])
    rows = tracks[(tracks["day"].astype(str) == day) & tracks["t"].between(begin - margin, end + margin)]
    paths = [rows[rows["id"] == shown[name].iloc[0]].sort_values("t") for name in ("ref_id", "other_id")]
    if paths[0].empty or paths[1].empty:
        raise DataError(f"encounter {number!r}: its people are not in these tracks on the day {day}")
    figure = Figure(figsize=(width, width), layout="constrained", dpi=80)
    canvas, ax, frames = FigureCanvasAgg(figure), figure.subplots(), []
    both = pd.concat(paths)[["x", "y"]].to_numpy()
    low, high = both.min(0), both.max(0)
    box = np.transpose([(low + high) / 2 + side * ((high - low).max() / 2 + 1) for side in (-1, 1)])
    for t in np.arange(begin - margin, end + margin + every / 2, every).tolist():
        ax.clear()
        ax.set(xlim=box[0], ylim=box[1])
        pasts = [path[path["t"] <= t + _HALF_TICK] for path in paths]
        here = {}
        for path, past, (name, colour) in zip(paths, pasts, _PEOPLE.items(), strict=True):
            ax.plot(path["x"], path["y"], color=colour, alpha=0.25)
            ax.plot(past["x"], past["y"], color=colour, linewidth=2, label=name)
            if len(past) and t <= path["t"].iloc[-1] + _HALF_TICK:  # here now
                x, y, vx, vy = past[["x", "y", "vx", "vy"]].iloc[-1]
                here[name] = x, y, np.arctan2(vy, vx)
                draw_person(ax, *here[name], color=colour, markersize=11)
        if zone is not None and (pose := here.get(_REFERENCE)):
            ax.plot(*zone.placed(pose[:2], pose[2]).curve().T, color=GREY, label="zone")
        add_legend_below(ax, ncols=3)
        apart = ""
        if len(here) == 2:
            (x, y, _), (other_x, other_y, _) = here.values()
            apart = f", {np.hypot(x - other_x, y - other_y):.2f} m apart"
        phase = "encounter" if begin <= t <= end else "before" if t < begin else "after"
        label_metres(ax, f"Encounter {number}, {t - begin:+.1f} s ({phase}){apart}")
        canvas.draw()  # type: ignore[no-untyped-call]
        figure.set_layout_engine("none")  # that of the first frame stays
        pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        frames.append(Image.fromarray(pixels).convert("RGB").quantize(method=Image.Quantize.FASTOCTREE))
    gif = io.BytesIO()
    frames[0].save(
        gif,
        "GIF",
        save_all=True,
        append_images=frames[1:],
        duration=1000 * every,
        loop=0,
    )
    return gif.getvalue()


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
    _draw_density(ax, angle, close["distance"], edges)
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


def _draw_density(ax: Axes, x: pd.Series, y: pd.Series, edges: tuple[np.ndarray, np.ndarray]) -> None:
    """Draw the number of samples in each cell on a log scale; empty cells stay white."""
    counts = np.histogram2d(x, y, bins=edges)[0].T
    shown = np.ma.masked_equal(counts, 0)
    top = max(float(counts.max(initial=0)), 2.0)
    image = ax.pcolormesh(*edges, shown, cmap=f"{SEQUENCE}_r", norm=LogNorm(1, top), rasterized=True)
    cell = " x ".join(f"{edge[1] - edge[0]:.2g}" for edge in edges)
    ax.figure.colorbar(image, ax=ax, shrink=0.9, label=f"samples in a cell of {cell} (log scale)")

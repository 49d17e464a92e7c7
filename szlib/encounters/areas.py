"""Areas: one in any form (`as_area`), or the outline of the place where people were seen (`walked_area`)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import shapely

from ..core.checks import check_columns
from ..core.errors import DataError, warn
from ..core.input_files import printable, read_small, reading
from ..tracks import funnels
from ..tracks.clock import COLUMNS
from .geometry import PAPER_SPACE, Area, AttentionalSpace, Square

AUTO = "auto"  # stands for the area that `walked_area` finds
_FORMS = (
    '"X0 X1 Y0 Y1" in metres, a polygon as well-known text or GeoJSON, a file of one of these, a polygon of '
    f'Shapely or PedPy, or "{AUTO}"'
)
_NUMBER = r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?"
# Text that is an area itself, not the path of a file.
_AREA = rf"(?i)\s*((MULTI)?POLYGON\b|\{{)|[\s,]*{_NUMBER}([\s,]+{_NUMBER})*[\s,]*$"

_WALKING = 0.4  # a slower person [m/s] stands, queues or sits (paper: 0.4 for a reference pedestrian)
_OUTLYING = 1e-3  # share of positions on either side that does not belong to the site: trackers jump
_CELL = 0.125  # width of the cells on which people were seen [m]
_MOST_CELLS = 300  # along an axis: those of a large site are wider
# People can be seen unless a disc of this radius [m] fits in where nobody was seen (assumed: as wide as gaps
# that few people leave).
_GAP = 2.0
_STRIP = 0.5  # strips as wide as this on both sides of their middle are left out (assumed) [m]
_ROUGH = 0.05  # deviation of the outline, which has fewer corners then [m]
# Hardly anybody walked on a square of this width [m] if fewer people did (measured on the ATC mall: 1 m
# misses pillars).  Where the median square that was walked on saw no more than `_FEW`, many are empty by
# chance (measured on plazas of 100 to 2,600 encounters).
_SPOT = 0.5
_PEOPLE = 3
_FEW = 12
_DOUBTFUL = 0.01  # share of the area that is reported (assumed)
_OUTLINE = "the outline of the place where people were seen"
_APART = 51.0  # between recordings that are placed side by side, up to a metre less [m]


def as_area(area: object) -> Area:
    """Convert an area in any form; the text ``str(area)`` gives the same area again.

    Parameters
    ----------
    area : an `Area`; a Shapely polygon; an object with a ``polygon`` (PedPy's ``WalkableArea``
        and ``MeasurementArea``); four numbers x0, x1, y0, y1; or text: these numbers, well-known text,
        GeoJSON, or the path of a file of one of these.  All in metres, in the frame of the tracks.

    Raises
    ------
    DataError : `area` has another form, is not valid, or has no inside.

    Examples
    --------
    >>> import szlib
    >>> szlib.as_area("0 12 0 8")
    Area(x=(0.0, 12.0), y=(0.0, 8.0), area=96.0)
    >>> szlib.as_area("POLYGON ((0 0, 12 0, 12 8, 0 0))").area
    48.0
    """
    if isinstance(area, Area):
        return area
    if isinstance(area, str) and re.match(_AREA, area):
        return _from_text(area.strip())
    if isinstance(area, str | Path):
        with reading(Path(area), "as an area", _FORMS):
            return _from_text(read_small(Path(area)).decode("utf-8-sig").strip())
    shape = getattr(area, "polygon", area)
    return Area(shape) if hasattr(shape, "geom_type") else _from_numbers(shape)


def area_for(
    tracks: pd.DataFrame, area: object, space: AttentionalSpace = PAPER_SPACE
) -> Area:
    """Convert `area` as `as_area` does; "auto" stands for the `walked_area` of the `tracks` for a `space`."""
    if str(area).strip() != AUTO:
        return as_area(area)
    places = _find_places(tracks)
    if places.nunique() < 2:
        return walked_area(tracks, space=space)
    polygons = [
        walked_area(part, space=space).polygon for _, part in tracks.groupby(places)
    ]
    return Area(
        shapely.union_all(polygons),
        f"{_OUTLINE}, for each of {len(polygons)} recordings, side by side along x",
    )


def place_apart(tracks: pd.DataFrame) -> pd.DataFrame:
    """Move recordings without a calendar apart along x, so that each can have an area of its own.

    Days of a calendar stay where they are: they are of one place.  Where `tracks` are of one place, they are
    returned themselves.
    """
    check_columns(tracks, COLUMNS)
    places = _find_places(tracks)
    if places.nunique() < 2:
        return tracks
    metres = (tracks["x"].round(3) // 1).groupby(places)
    low = metres.min()
    width = metres.max() - low + _APART
    begin = low.iloc[0] + width.cumsum().shift(fill_value=0)
    return tracks.assign(x=tracks["x"] + places.map(begin - low))


def has_calendar(day: object) -> bool:
    """Whether a `day` is a date, not the name of a recording."""
    return re.match(r"\d{4}-\d\d-\d\d", str(day)) is not None


def _find_places(tracks: pd.DataFrame) -> pd.Series[str]:
    """The name of the place of each row: that of its recording; empty on days of a calendar."""
    day = tracks["day"].astype(object)
    return day.map({each: "" if has_calendar(each) else each for each in day.unique()})


def walked_area(tracks: pd.DataFrame, *, space: AttentionalSpace = PAPER_SPACE) -> Area:
    """Find the outline of the place where people were seen.

    The area never reaches outside where people can be seen: where people were seen, and in gaps between
    them that are narrower than 4 m.  Strips narrower than 1 m and pieces narrower than the attentional
    space are left out, as is the thousandth of the positions that is farthest out on each side (trackers
    that jump).

    The area may hold spots where hardly anybody walked (furniture, pillars), of which a DataWarning states
    the share if many people walked: look at the map (`plots.plot_map`, beside the notebooks).

    Parameters
    ----------
    tracks : a track table as from `szlib.read_tracks`.
    space : the attentional space that must fit in.

    Returns
    -------
    The area; its `reason` says what was taken.

    Raises
    ------
    DataError : nobody walks at 0.4 m/s or faster, people were seen on lines only, or a column is missing.

    Examples
    --------
    >>> import szlib
    >>> plaza = szlib.make_plaza("plaza.csv", settings=szlib.PlazaSettings(n_encounters=100))
    >>> szlib.walked_area(szlib.read_tracks(plaza)).reason
    'the outline of the place where people were seen'
    """
    check_columns(tracks, COLUMNS)
    walks = tracks[np.hypot(tracks["vx"], tracks["vy"]) >= _WALKING]
    if walks.empty:
        raise DataError(
            f"nobody walks at {_WALKING} m/s or faster in these tracks: no area can be found"
        )
    low, high = np.quantile(walks[["x", "y"]], [_OUTLYING, 1 - _OUTLYING], axis=0)
    cell = max(_CELL, (high - low).max() / _MOST_CELLS)
    place = _join_cells(
        (tracks[["x", "y"]] / cell).round().drop_duplicates(), cell
    ).intersection(shapely.box(*low, *high))
    # in two steps, which is faster
    grown = place.buffer(_GAP / 4).buffer(0.75 * _GAP)
    # positions are anywhere in their cells, which reach half a cell too far on each side
    inner = grown.buffer(-_GAP - _STRIP - cell / 2)
    outline = inner.buffer(_STRIP).simplify(_ROUGH)
    pieces = [
        piece
        for piece in shapely.get_parts(shapely.set_precision(outline, 0.01))
        if not piece.buffer(-space.width / 2).is_empty
    ]
    if not pieces:
        notes = [f"{note}; " for note in funnels.warnings(funnels.get(tracks))]
        raise DataError(
            f"{''.join(notes)}no area was found: people were seen in no place as wide as the attentional "
            f"space, {space.width:g} m x {space.length:g} m; use more data, pass a smaller space, or give "
            f"the area yourself: expected {_FORMS}"
        )
    area = Area(shapely.union_all(pieces), _OUTLINE)
    spots = (walks[["x", "y"]] / _SPOT).round().assign(day=walks["day"], id=walks["id"])
    people = spots.drop_duplicates().value_counts(["x", "y"])
    if people.median() > _FEW:
        walked = _join_cells(people.index[people >= _PEOPLE].to_frame(), _SPOT)
        # but for a strip along the outline, where fewer people walk
        share = inner.difference(walked).area / area.area
        if share >= _DOUBTFUL:
            warn(
                f"in {share:.0%} of the area found ({area.area:.0f} m2) fewer than {_PEOPLE} people "
                "walked, perhaps for furniture, pillars or walls: look at the map, and give a better area if "
                "you know one"
            )
    return area


def _join_cells(cells: pd.DataFrame, width: float) -> shapely.Geometry:
    """The polygons of square cells of a `width` [m], given by their middles as multiples of it."""
    ends = width * np.hstack([cells - 0.5, cells + 0.5])
    return shapely.coverage_union_all(shapely.box(*ends.T))


def _from_numbers(numbers: object) -> Area:
    try:
        x0, x1, y0, y1 = map(float, np.asarray(numbers, float))
    except (TypeError, ValueError) as error:
        raise DataError(
            f"{printable(str(numbers)[:80])}: is no area; expected {_FORMS}"
        ) from error
    return Square((x0, x1), (y0, y1))


def _from_text(text: str) -> Area:
    """The area of four numbers, well-known text or GeoJSON: all polygons of a collection in one."""
    if text[:1] not in "{MPmp":
        return _from_numbers(text.replace(",", " ").split())
    read = shapely.from_geojson if text.startswith("{") else shapely.from_wkt
    try:
        shape = read(text)
        if shape.geom_type == "GeometryCollection":
            shape = shapely.union_all(shapely.get_parts(shape))
    except shapely.errors.ShapelyError as error:
        raise DataError(
            f"{printable(text[:40])!r}: is no well-known text and no GeoJSON ({error}); expected {_FORMS}"
        ) from error
    return Area(shape)

"""Areas: all forms mean the same, the direction of the axes does not matter; the area where people walk."""

import json
import math
import pickle
import warnings

import numpy as np
import pandas as pd
import pytest
import shapely
from helpers.encounter_tables import ROOM, assert_same_samples
from helpers.raw_days import assert_selected_as_whole, make_raw_day, write_raw_day
from helpers.track_tables import make_crowd, make_hall, make_tracks, make_walk
from hypothesis import given, strategies
from matplotlib.path import Path as Outline

import szlib
from szlib.encounters.areas import area_for, place_apart
from szlib.encounters.finding import find_encounters
from szlib.encounters.geometry import Area, Square
from szlib.encounters.null_model import null_encounters
from szlib.workbook.record import DataCache

ATC_POLYGON = shapely.box(-18.5, -10, -7.5, 8)
HALL = shapely.Polygon([(0, 0), (12, 0), (12, 8), (0, 8)])
ELL = shapely.Polygon([(0, 0), (12, 0), (12, 5), (5, 5), (5, 12), (0, 12)])
PILLAR = shapely.Polygon(
    [(0, 0), (12, 0), (12, 8), (0, 8)], [[(5, 3), (6, 3), (6, 4), (5, 4)]]
)
SHAPES = {
    "hall": HALL,
    "ell": ELL,
    "pillar": PILLAR,
    "two": shapely.MultiPolygon([HALL, shapely.box(20, 0, 30, 9)]),
}


def turned(shape, angle, by=(3.0, -7.0)):
    matrix = np.array(
        [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    )
    return shapely.transform(shape, lambda points: points @ matrix.T + by)


def turned_tracks(tracks, angle, by=(3.0, -7.0)):
    matrix = np.array(
        [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    )
    moved = tracks.copy()
    moved[["x", "y"]] = tracks[["x", "y"]].to_numpy() @ matrix.T + by
    moved[["vx", "vy"]] = tracks[["vx", "vy"]].to_numpy() @ matrix.T
    return moved


# --- one area, many forms ----------------------------------------------------------------------------


def geojson(shape, kind):
    geometry = json.loads(shapely.to_geojson(shape))
    feature = {"type": "Feature", "properties": {"name": "hall"}, "geometry": geometry}
    whole = {"type": "FeatureCollection", "features": [feature]}
    return json.dumps(
        {"geometry": geometry, "feature": feature, "collection": whole}[kind]
    )


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(
    "form", ["shapely", "wkt", "geometry", "feature", "collection", "text", "with z"]
)
def test_all_forms_give_the_same_area(tmp_path, name, form):
    shape = SHAPES[name]
    given = {
        "shapely": shape,
        "wkt": shape.wkt,
        "with z": shapely.force_3d(shape),
        "text": str(szlib.as_area(shape)),
    }
    area = szlib.as_area(given[form] if form in given else geojson(shape, form))
    assert area == szlib.as_area(shape)
    assert area.is_rectangle == (name == "hall")
    assert hash(area) == hash(szlib.as_area(shape))
    assert area.area == pytest.approx(shape.area)
    file = tmp_path / "area of the hall.txt"
    file.write_text("\ufeff" + str(area) + "\n", encoding="utf-8")
    assert szlib.as_area(file) == szlib.as_area(str(file)) == area
    assert pickle.loads(pickle.dumps(area)) == area


@pytest.mark.parametrize(
    "given",
    ["0 12 0 8", "0,12, 0,8", [0, 12, 0, 8], "POLYGON ((0 0, 0 8, 12 8, 12 0, 0 0))"],
)
def test_four_numbers_are_a_square(given):
    assert szlib.as_area(given) == Square(x=(0, 12), y=(0, 8))


def test_areas_of_pedpy_are_accepted():
    pedpy = pytest.importorskip("pedpy")
    assert szlib.as_area(pedpy.WalkableArea(HALL)) == Square(x=(0, 12), y=(0, 8))
    with_pillar = pedpy.WalkableArea(
        HALL.exterior.coords[:-1], obstacles=[PILLAR.interiors[0].coords[:-1]]
    )
    assert szlib.as_area(with_pillar).area == 95
    assert szlib.as_area(pedpy.MeasurementArea(turned(HALL, 1.0))) == szlib.as_area(
        turned(HALL, 1.0)
    )


numbers = strategies.floats(-1e6, 1e6, allow_nan=False)


@given(numbers, strategies.floats(1e-3, 1e6), numbers, strategies.floats(1e-3, 1e6))
def test_text_of_a_square_round_trips(x, width, y, height):
    square = Square(x=(x, x + width), y=(y, y + height))
    assert szlib.as_area(str(square)) == square


def test_numbers_of_a_square_come_back():
    square = Square(x=(-1.5, 3.25), y=(0.1, 7))
    assert str(square) == "-1.5 3.25 0.1 7.0"
    assert repr(square) == "Area(x=(-1.5, 3.25), y=(0.1, 7.0), area=32.775)"
    zero, minus_zero = Square(x=(0.0, 1), y=(0, 1)), Square(x=(-0.0, 1), y=(0, 1))
    assert zero == minus_zero and hash(zero) == hash(minus_zero)


@given(numbers, numbers, strategies.floats(1e-3, 100))
def test_grown_square_has_the_margin_on_each_side(x, y, margin):
    grown = Square(x=(x, x + 11), y=(y, y + 18)).grown(margin)
    expected = (x - margin, x + 11 + margin, y - margin, y + 18 + margin)
    assert (*grown.x, *grown.y) == pytest.approx(expected, rel=0, abs=1e-9)
    assert (grown.area, grown.is_rectangle) == (
        pytest.approx((11 + 2 * margin) * (18 + 2 * margin)),
        True,
    )


def test_reason_is_neither_compared_nor_shown():
    assert Area(HALL, "a reason") == Area(HALL)
    assert repr(Area(HALL, "a reason")) == repr(Area(HALL))
    assert szlib.as_area(Area(HALL, "a reason")).reason == "a reason"


@given(strategies.floats(0, 7), numbers, numbers)
def test_text_of_a_polygon_round_trips(angle, x, y):
    area = szlib.as_area(turned(ELL, angle, (x, y)))
    assert szlib.as_area(str(area)) == area


WRONG = {
    "": "expected",
    "1 2 3": "expected",
    "5 1 0 8": "lowest, highest",
    "0 12 0 nan": "expected",
    "no/such/file.wkt": "cannot be read as an area",
    "POLYGON ((0 0, 1 1": "no well-known text",
    "POLYGON ((0 0, 4 4, 4 0, 0 4, 0 0))": "cross itself",
    "POLYGON ((0 0, 4 0, 8 0, 0 0))": "a valid polygon.*got 'Self-intersection",
    "POLYGON ((0 0, 4 0, inf 4, 0 0))": "a valid polygon.*got 'Invalid Coordinate",
    "POLYGON EMPTY": "with an inside",
    '{"type": "Polygon"}': "no GeoJSON",
    '{"type": "Point", "coordinates": [1, 2]}': "must be a polygon",
    "{broken": "no GeoJSON",
}


@pytest.mark.parametrize(("text", "message"), WRONG.items())
def test_invalid_text_raises(text, message):
    with pytest.raises(szlib.DataError, match=message):
        szlib.as_area(text)


@pytest.mark.parametrize(
    "given",
    [None, 3, [1, 2, 3], shapely.Point(1, 2), shapely.LineString([(0, 0), (1, 1)])],
)
def test_objects_that_are_no_area_raise(given):
    with pytest.raises(szlib.DataError, match="area"):
        szlib.as_area(given)


def test_error_names_a_file_that_is_no_area(tmp_path):
    for content in (
        b"t,id,x,y\n1,2,3,4\n",
        b"",
        b"\xff\xfe\x00",
        b"POLYGON ((0 0, 4 4, 4 0, 0 4, 0 0))",
    ):
        (tmp_path / "hall.wkt").write_bytes(content)
        with pytest.raises(szlib.DataError, match=r"hall\.wkt"):
            szlib.as_area(tmp_path / "hall.wkt")
    with pytest.raises(szlib.DataError, match="cannot be read as an area"):
        szlib.as_area(tmp_path)


# --- inside ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_contains_agrees_with_matplotlib(name, angle):
    shape = turned(SHAPES[name], angle)
    area = szlib.as_area(shape)
    x0, x1, y0, y1 = *area.x, *area.y
    x, y = np.random.default_rng(0).uniform(
        [[x0 - 1], [y0 - 1]], [[x1 + 1], [y1 + 1]], (2, 20_000)
    )
    crossings = sum(
        Outline(ring).contains_points(np.column_stack([x, y])).astype(int)
        for ring in area.outlines
    )
    np.testing.assert_array_equal(area.contains(x, y), crossings % 2 == 1)


def test_border_is_inside():
    polygon = szlib.ATC_SQUARE
    ticks = np.r_[
        -18.5,
        -10,
        -7.5,
        8,
        np.nextafter([-18.5, -7.5, 8, -10], 99),
        np.nextafter([-18.5, 8], -99),
        np.nan,
    ]
    x, y = np.meshgrid(ticks, ticks)
    inside = (x >= -18.5) & (x <= -7.5) & (y >= -10) & (y <= 8)
    np.testing.assert_array_equal(polygon.contains(x, y), inside)


@pytest.mark.parametrize("name", SHAPES)
def test_covers_requires_every_point_inside(name):
    area = Area(SHAPES[name])
    rng = np.random.default_rng(1)
    n, unit = 400, np.linspace(0, 1, 41)
    heading = rng.uniform(-np.pi, np.pi, n)
    ahead, side = szlib.AttentionalSpace(length=2.5, width=2).corners.T[..., None]
    x = rng.uniform(0, 12, n) + ahead * np.cos(heading) - side * np.sin(heading)
    y = rng.uniform(0, 8, n) + ahead * np.sin(heading) + side * np.cos(heading)
    u, v = (each.ravel()[:, None] for each in np.meshgrid(unit, unit))
    weights = [(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v]
    points = [
        sum(w * corner for w, corner in zip(weights, each, strict=True))
        for each in (x, y)
    ]
    dense = area.contains(*points).all(axis=0)
    covered = area.covers(x, y)
    assert 20 < covered.sum() < n - 20
    assert not (covered & ~dense).any()
    assert (dense & ~covered).sum() <= 2, (
        "a corner may reach in between two of the points"
    )


# --- encounters --------------------------------------------------------------------------------------


def test_square_given_as_polygon_gives_identical_encounters():
    pedpy = pytest.importorskip("pedpy")
    found = 0
    for seed in range(6):
        tracks = make_crowd(seed)
        expected = find_encounters(tracks, square=szlib.ATC_SQUARE)
        forms = [
            Area(ATC_POLYGON),
            ATC_POLYGON,
            pedpy.WalkableArea(ATC_POLYGON),
            "-18.5 -7.5 -10 8",
        ]
        for form in forms:
            samples = find_encounters(tracks, square=form)
            pd.testing.assert_frame_equal(samples, expected, check_exact=True)
            assert samples.attrs["funnel"] == expected.attrs["funnel"]
        found += len(expected)
    assert found > 0
    assert szlib.as_area(expected.attrs["area"]) == szlib.ATC_SQUARE


@pytest.mark.parametrize("angle", [0.3, -2.0])
def test_encounters_do_not_depend_on_the_direction_of_the_axes(angle):
    crowd = make_crowd(77, people=160, seconds=200, square=ROOM)
    for shape in (
        shapely.box(-20, -20, 20, 20),
        shapely.box(-20, -20, 20, 20) - shapely.box(-3, -3, 3, 3),
    ):
        known = find_encounters(crowd, square=shape)
        samples = find_encounters(
            turned_tracks(crowd, angle), square=turned(shape, angle)
        )
        assert len(known) > 0
        assert_same_samples(samples, known)
        assert samples["kind"].tolist() == known["kind"].tolist()


def test_no_encounter_where_the_space_holds_a_pillar():
    walks = (
        make_walk((1, 5), (1.0, 0), duration=6),
        make_walk((9, 5), (-1.0, 0), person=2, duration=6),
    )
    room, pillar = shapely.box(-5, 0, 15, 10), shapely.box(5.2, 5.5, 5.4, 5.7)
    assert find_encounters(make_tracks(*walks), square=room)["encounter"].nunique() == 2
    assert len(find_encounters(make_tracks(*walks), square=room - pillar)) == 0


@pytest.mark.parametrize(
    "shape",
    [
        ATC_POLYGON,
        turned(ATC_POLYGON, 0.3, (-4, 3)),
        ATC_POLYGON - shapely.box(-13, -1, -12, 0),
    ],
)
def test_streaming_in_a_polygon_gives_the_encounters_of_the_whole_day(tmp_path, shape):
    found = 0
    for seed in range(2):
        path = write_raw_day(
            tmp_path / "day.csv", make_raw_day(seed, wild=seed % 2 == 0)
        )
        found += assert_selected_as_whole(
            path, square=szlib.as_area(shape), duration=1.0
        )
    assert found > 0


def test_null_model_accepts_any_area():
    crowd = make_crowd(7, people=60, seconds=600)
    options = {"shifts": 2, "minutes": (0.2, 2.0), "progress": False}
    expected = null_encounters(crowd, square=szlib.ATC_SQUARE, **options)
    found = null_encounters(crowd, square=ATC_POLYGON, **options)
    pd.testing.assert_frame_equal(found.encounters, expected.encounters)


# --- where people walked -----------------------------------------------------------------------------


def test_walked_area_reaches_the_walls_of_a_hall():
    found = szlib.walked_area(make_hall())
    assert found.polygon.symmetric_difference(HALL).area < 4
    assert found == area_for(make_hall(), "auto")
    samples = find_encounters(make_hall(), square="auto")
    assert samples.attrs["area"] == str(found)


@pytest.mark.parametrize(("gap", "is_closed"), [(3.5, True), (4.5, False)])
def test_walked_area_closes_gaps_narrower_than_four_metres(gap, is_closed):
    lanes = [y for y in np.arange(0.25, 16.0, 0.5) if abs(y - 8) >= gap / 2]
    walks = [
        make_walk((0, y), (1.0, 0.0), person=k, duration=20)
        for k, y in enumerate(lanes)
    ]
    found = szlib.walked_area(make_tracks(*walks))
    assert found.contains(np.array([10.0]), np.array([8.0])) == is_closed
    assert len(shapely.get_parts(found.polygon)) == (1 if is_closed else 2)


@pytest.mark.slow
@pytest.mark.parametrize(("side", "is_hole"), [(2.0, False), (6.0, True)])
def test_walked_area_excludes_a_wide_pillar(side, is_hole):
    low, high = 15 - side / 2, 15 + side / 2
    pillar = (low, low - 5, high, high - 5)
    tracks = make_hall(people=1500, pillar=pillar, size=(30, 20))
    found = szlib.walked_area(tracks)
    assert found.contains(np.array([15.0]), np.array([10.0])) != is_hole
    assert len(found.outlines) == 1 + is_hole
    assert found.area > 0.9 * (30 * 20 - is_hole * side**2)


def test_walked_area_leaves_out_strips_narrower_than_a_metre():
    lanes = [
        make_walk((11, y), (1.0, 0.0), person=1000 + k, duration=8)
        for k, y in enumerate(np.linspace(3.6, 4.4, 12))
    ]
    with_strip = szlib.walked_area(make_tracks(make_hall(), *lanes))
    assert with_strip.x[1] < 15


def test_walked_area_ignores_queues_jumps_and_ids():
    tracks = make_hall()
    found = szlib.walked_area(tracks)
    queue = [
        make_walk((-3 + 0.1 * k, 4), (0.05, 0), person=1000 + k) for k in range(20)
    ]
    jump = [make_walk((4000, -3000), (1, 0), person=2000, duration=0.3)]
    assert szlib.walked_area(make_tracks(tracks, *queue, *jump)) == found
    assert szlib.walked_area(tracks.sample(frac=1, random_state=1)) == found
    assert (
        szlib.walked_area(
            tracks.assign(
                id=tracks["id"] % 100 + 7, day=(tracks["id"] // 100).astype(str)
            )
        )
        == found
    )


OBLIQUE = shapely.Polygon([(0, 0), (16, 2), (20, 13), (-1, 11)])


def see(tracks):
    """Those of `tracks` in the view of a camera."""
    is_seen = shapely.contains_xy(OBLIQUE, tracks["x"], tracks["y"])
    return tracks[is_seen].reset_index(drop=True)


VIEWS = {
    "hall": (make_hall, HALL),
    "hall of many people": (lambda: make_hall(people=900), HALL),
    "few people": (
        lambda: make_hall(people=60, size=(15, 13)),
        shapely.box(0, 0, 15, 13),
    ),
    "corridor": (
        lambda: make_hall(people=300, size=(20, 5)),
        shapely.box(0, 0, 20, 5),
    ),
    "view": (lambda: see(make_hall(2, people=500, size=(24, 18))), OBLIQUE),
    "view of few people": (lambda: see(make_hall(people=60, size=(24, 18))), OBLIQUE),
    "room that is turned": (
        lambda: turned_tracks(make_hall(size=(11, 11)), 0.6),
        turned(shapely.box(0, 0, 11, 11), 0.6),
    ),
}
"""How to make tracks of people, few and many, and where they can be seen."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.* of the area found:szlib.DataWarning")
@pytest.mark.parametrize("name", VIEWS)
def test_walked_area_never_reaches_outside_where_people_can_be_seen(name):
    make, view = VIEWS[name]
    found = szlib.walked_area(make())
    reached = found.polygon
    assert view.buffer(0.15).covers(reached)
    assert reached.area > 0.6 * view.area
    assert found.reason == "the outline of the place where people were seen"


def test_walked_area_of_a_corridor_holds_its_encounters():
    """Narrower than the space can turn in: the people who walk along it still meet."""
    corridor = make_hall(people=300, size=(20, 5))
    by_hand = find_encounters(corridor, area="0 20 0 5")["encounter"].nunique()
    assert (
        0.7 * by_hand
        < find_encounters(corridor, area="auto")["encounter"].nunique()
        <= by_hand
    )
    with pytest.raises(
        szlib.DataError, match="in no place as wide as the attentional space, 4 m x 5 m"
    ):
        szlib.walked_area(make_hall(size=(30, 3)))
    assert (
        szlib.walked_area(
            make_hall(size=(30, 3)), space=szlib.AttentionalSpace(width=2.0)
        ).area
        > 85
    )


def test_walked_area_ignores_one_who_walks_just_outside():
    tracks = make_hall()
    for start in ((-0.4, 3.0), (4.0, -0.4), (12.2, 3.0), (4.0, 8.2)):
        outside = make_walk(
            start,
            (0.0, 1.0) if start[1] == 3.0 else (1.0, 0.0),
            person=3000,
            duration=0.3,
        )
        assert szlib.walked_area(make_tracks(tracks, outside)) == szlib.walked_area(
            tracks
        )


def test_walked_area_moves_and_turns_with_the_tracks():
    found = szlib.walked_area(make_hall())
    moved = szlib.walked_area(
        make_hall().assign(x=lambda t: t["x"] + 37.5, y=lambda t: t["y"] - 12)
    )
    back = shapely.transform(moved.polygon, lambda points: points - (37.5, -12))
    assert back.symmetric_difference(found.polygon).area < 0.2
    for angle, off in ((0.4, 0.15), (np.pi / 2, 0.05)):  # [m]
        again = szlib.walked_area(turned_tracks(make_hall(), angle)).polygon
        wrong = again.symmetric_difference(turned(found.polygon, angle)).area
        assert wrong < off * found.polygon.length


def test_walked_area_with_furniture_warns():
    tracks = make_hall(people=900, pillar=(5.2, 3.2, 6.8, 4.8))
    with pytest.warns(
        szlib.DataWarning,
        match=r"of the area found \(.* m2\) fewer than 3 people walked",
    ):
        found = szlib.walked_area(tracks)
    assert found.area > 60
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        szlib.walked_area(make_hall(people=900))


def test_tracks_without_an_area_raise():
    with pytest.raises(szlib.DataError, match="nobody walks"):
        szlib.walked_area(make_tracks(make_walk((0, 0), (0.1, 0))))
    with pytest.raises(szlib.DataError, match="no area was found"):
        szlib.walked_area(make_tracks(make_walk((0, 0), (1, 0))))


@pytest.mark.filterwarnings("ignore:.* of the area found:szlib.DataWarning")
def test_walked_area_of_the_mall_holds_its_open_square(
    real_tracks,
):
    found = szlib.walked_area(real_tracks)
    assert found.polygon.covers(szlib.ATC_SQUARE.polygon)
    assert found.area < 1400  # not the walls and shops around its corridors


# --- several recordings ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rooms():
    """Three rooms, each in a frame of its own."""
    sizes = {"a": (12, 8), "b": (15, 13), "c": (9, 11)}
    return {name: make_hall(size=size).assign(day=name) for name, size in sizes.items()}


def by_day(samples):
    return samples.groupby(samples["day"].astype(str))["encounter"].nunique().to_dict()


@pytest.mark.slow
def test_recordings_without_a_calendar_have_each_their_own_area(
    rooms,
):
    alone = {
        name: by_day(find_encounters(room, area="auto"))[name]
        for name, room in rooms.items()
    }
    together = find_encounters(pd.concat(rooms.values()), area="auto")
    assert by_day(together) == alone
    assert "for each of 3 recordings" in together.attrs["area_reason"]
    null = null_encounters(
        pd.concat(rooms.values()), shifts=2, progress=False, area="auto"
    )
    assert len(null.encounters) > 0
    assert szlib.as_area(null.parameters["area"]) == szlib.as_area(
        together.attrs["area"]
    )


def test_days_of_a_calendar_share_an_area(rooms):
    days = [
        room.assign(day=f"2024-05-0{k}")
        for k, room in enumerate(rooms.values(), start=1)
    ]
    assert find_encounters(pd.concat(days), area="auto").attrs["area"] == str(
        szlib.walked_area(pd.concat(days))
    )


def test_recordings_are_placed_apart_once_and_one_place_stays(
    rooms,
):
    apart = place_apart(pd.concat(rooms.values(), ignore_index=True))
    pd.testing.assert_frame_equal(place_apart(apart), apart)
    spans = apart.groupby("day")["x"].agg(["min", "max"]).to_numpy()
    assert (spans[1:, 0] - spans[:-1, 1] >= 50).all()
    assert place_apart(rooms["a"]) is rooms["a"]


@pytest.mark.slow
def test_extraction_and_notebooks_find_the_encounters_of_each_recording(
    rooms, tmp_path
):
    files = [tmp_path / f"{name}.csv" for name in rooms]
    for file, room in zip(files, rooms.values(), strict=True):
        room[["t", "id", "x", "y"]].to_csv(file, index=False)
    days = szlib.extract_days(files, out=tmp_path / "days", progress=False)
    alone = {
        file.stem: by_day(find_encounters(szlib.read_tracks(file), area="auto"))[
            file.stem
        ]
        for file in files
    }
    assert (
        days.table.set_index("day")["encounters"].to_dict()
        == alone
        == by_day(days.samples())
    )
    assert days.settings.area is None
    cache = DataCache(tmp_path / "results", list(map(str, files)))
    assert by_day(cache.encounters()) == alone
    assert by_day(find_encounters(cache.tracks(), area=cache.find_area())) == alone
    given = DataCache(tmp_path / "given", list(map(str, files)), area="0 9 0 8")
    assert given.tracks()["x"].max() < 16


@pytest.mark.slow
def test_without_an_area_only_files_of_the_atc_mall_have_its_square(
    tmp_path,
):
    plaza = szlib.make_plaza(tmp_path / "plaza.csv", seed=1)
    tracks = szlib.read_tracks(plaza)
    assert find_encounters(tracks).attrs["area"] == str(szlib.ATC_SQUARE)
    hall = tracks.assign(x=tracks["x"] + 100.0)[["t", "id", "x", "y"]]
    hall.to_csv(tmp_path / "hall.csv", index=False)
    with pytest.warns(szlib.DataWarning, match="of the area found"):
        own = find_encounters(szlib.read_tracks(tmp_path / "hall.csv"))
    assert len(own) and own.attrs["area"] != str(szlib.ATC_SQUARE)

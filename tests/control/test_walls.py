"""Walls from lines, polygons and maps of ROS: where, how few, and what is wrong with a bad one."""

from __future__ import annotations

import copy
import io
import pickle
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from PIL import Image

import szlib
from szlib.control import read_walls, walls_from_grid
from szlib.control.walls import find_solids

ZONE = szlib.Ellipse((0.1, 0.0), (1.0, 0.7))
GREY = NDArray[np.uint8]
ENTRIES = {
    "image": "map.pgm", "resolution": 0.05, "origin": [-1.0, -2.0, 0.0], "negate": 0,
    "occupied_thresh": 0.65, "free_thresh": 0.196,
}  # fmt: skip


def cells() -> GREY:
    """Free cells with an occupied block of 20 rows and 10 columns near the lower left corner."""
    grey = np.full((60, 80), 254, np.uint8)
    grey[35:55, 4:14] = 0
    return grey


def write_map(folder: Path, grey: GREY | None = None, **changes: Any) -> Path:
    """A map; an entry that is None is left out."""
    entries = {
        key: value for key, value in {**ENTRIES, **changes}.items() if value is not None
    }
    if isinstance(name := entries.get("image"), str):
        Image.fromarray(cells() if grey is None else grey).save(folder / name)
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in entries.items()))
    return path


def bounds(walls: Any) -> list[float]:
    return [*walls.min(axis=(0, 1)).tolist(), *walls.max(axis=(0, 1)).tolist()]


@pytest.mark.parametrize("image", ["map.pgm", "map.png"])
def test_a_block_of_cells_becomes_its_outline_in_the_world(
    tmp_path: Path, image: str
) -> None:
    walls = szlib.walls_from_map(write_map(tmp_path, image=image))
    assert walls.shape == (4, 2, 2)
    # rows count from the top
    assert bounds(walls) == pytest.approx([-0.8, -1.75, -0.3, -0.75])


def test_yaw_turns_the_map_about_its_origin(tmp_path: Path) -> None:
    straight = szlib.walls_from_map(write_map(tmp_path))
    turned = szlib.walls_from_map(write_map(tmp_path, origin=[-1.0, -2.0, pi / 6]))
    c, s = cos(pi / 6), sin(pi / 6)
    assert turned - (-1, -2) == pytest.approx(
        (straight - (-1, -2)) @ np.array([[c, s], [-s, c]])
    )


def test_each_kind_of_cell_is_read_as_map_server_reads_it(tmp_path: Path) -> None:
    grey = np.full((3, 40), 254, np.uint8)
    # p = 1, 0.196, 0.498, 0.667
    grey[1, 5], grey[1, 15], grey[1, 25], grey[1, 35] = (0, 205, 128, 85)
    columns = {
        (): {5, 35},
        (("unknown", True),): {5, 15, 25, 35},
        (("negate", 1), ("unknown", True)): {*range(40)} - {5},
        (("free_thresh", 0.1), ("unknown", True)): {5, 15, 25, 35},
    }
    for changes, expected in columns.items():
        given = {"free_thresh": 0.19, **dict(changes)}
        unknown = bool(given.pop("unknown", False))
        path = write_map(
            tmp_path, grey, resolution=1.0, origin=[0.0, 0.0, 0.0], **given
        )
        walls = szlib.walls_from_map(path, unknown=unknown)
        centres = np.arange(40) + 0.5
        solid = shapely.build_area(shapely.multilinestrings(list(walls)))
        found = set(np.flatnonzero(shapely.contains_xy(solid, centres, 1.5)).tolist())
        assert found == expected, changes


def test_transparent_pictures_and_other_modes_are_refused(tmp_path: Path) -> None:
    path = write_map(tmp_path, np.full((9, 9, 2), 255, np.uint8), image="map.png")
    with pytest.raises(szlib.DataError, match=r"image 'map\.png'.* its mode must be"):
        szlib.walls_from_map(path)
    for mode in ("scale", "raw"):
        with pytest.raises(szlib.DataError, match="mode must be 'trinary'"):
            szlib.walls_from_map(write_map(tmp_path, mode=mode))


def test_simplified_outlines_are_few_and_deviate_by_no_more_than_asked() -> None:
    y, x = np.mgrid[:200, :200]
    ring = np.abs(np.hypot(x - 100, y - 100) - 80) < 3  # of 8 m, 30 cm thick
    slanted = np.abs(y - 0.3 * x - 40) < 2
    raw = walls_from_grid(ring | slanted, 0.05, simplify=0.0)
    few = walls_from_grid(ring | slanted, 0.05)
    assert len(few) < len(raw) / 8
    lines, cells = (
        shapely.multilinestrings(few.tolist()),
        shapely.multilinestrings(raw.tolist()),
    )
    assert shapely.hausdorff_distance(cells, lines) < 0.05 + 1e-6


BAD = {
    "resolution": ("resolution", {"resolution": None}),
    "negative": ("resolution must be positive", {"resolution": -0.05}),
    "word": ("resolution must be numbers", {"resolution": "fine"}),
    "image": ("the map cannot be read: 'image'", {"image": None}),
    "no image": ("image .other.pgm. cannot be read", {"image": "[map.pgm]"}),
    "origin": (r"origin must have shape \(3,\)", {"origin": [0.0, 0.0]}),
    "infinite": ("origin must be finite", {"origin": "[.inf, 0.0, 0.0]"}),
    "swapped": (
        "free_thresh must be from 0 to below occupied_thresh = 0.1",
        {"occupied_thresh": 0.1},
    ),
    "threshold": ("free_thresh must be", {"occupied_thresh": 65}),
    "negate": ("negate must be 0 or 1", {"negate": 2}),
    "mode": ("mode must be 'trinary'", {"mode": "trinity"}),
    "far away": ("must lie within", {"origin": [1e8, 0.0, 0.0]}),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_entry_is_an_error_with_file_and_key(tmp_path: Path, kind: str) -> None:
    message, changes = BAD[kind]
    if kind == "no image":
        path = write_map(tmp_path)
        path.write_text(path.read_text().replace("map.pgm", "other.pgm"))
    else:
        path = write_map(tmp_path, **changes)
    with pytest.raises(szlib.DataError, match=message) as error:
        szlib.walls_from_map(path)
    assert "map.yaml" in str(error.value) or "other.pgm" in str(error.value)


def test_a_file_that_is_no_map_is_an_error(tmp_path: Path) -> None:
    path = write_map(tmp_path)
    whole = (tmp_path / "map.pgm").read_bytes()
    wide = io.BytesIO()
    Image.fromarray(np.zeros((4, 4), np.uint16)).save(wide, "png")
    for content in (
        whole[:-100],
        b"no picture",
        b"",
        b"P5\n100000 100000\n255\n",
        wide.getvalue(),
    ):
        (tmp_path / "map.pgm").write_bytes(content)
        with pytest.raises(szlib.DataError, match=r"map\.yaml: image .map\.pgm"):
            szlib.walls_from_map(path)
    for text in ("- a list", "image: [", "just text", "\0", "a: 2001-99-99"):
        path.write_text(text)
        with pytest.raises(szlib.DataError, match=r"map\.yaml"):
            szlib.walls_from_map(path)
    path.write_bytes(b"x" * 10_000_001)
    with pytest.raises(szlib.DataError, match="larger than 10 MB"):
        szlib.walls_from_map(path)
    with pytest.raises(szlib.DataError, match=r"no\.yaml"):
        szlib.walls_from_map(tmp_path / "no.yaml")


def test_a_bad_grid_is_an_error() -> None:
    for arguments in (
        (np.zeros(4, bool), 0.05),
        (np.zeros((4, 4), bool), 0.0),
        (np.zeros((4, 4), bool), 0.05, (0.0, 0.0)),
        (np.full((4, 4), -1), 0.05),  # unknown, in a grid of ROS
        (np.full((4, 4), np.nan), 0.05),
    ):
        with pytest.raises(szlib.SolverError, match=r"must be|must have"):
            walls_from_grid(*arguments)


# --- walls of any shape -----------------------------------------------------------------------------


BOX = shapely.box(0, 0, 4, 2)


@pytest.mark.parametrize(
    ("walls", "count"),
    [
        ([], 0),
        (np.zeros((0, 2, 2)), 0),
        ([[(0, 0), (1, 0)], [(1, 0), (1, 1)]], 2),
        ([(0, 0), (1, 0), (1, 1)], 2),
        (np.array([(0, 0), (1, 0), (1, 1), (0, 1)]), 3),
        ([[(0, 0), (1, 0), (1, 1)], [(5, 5), (6, 6)]], 3),
        (shapely.LineString([(0, 0), (1, 0), (1, 0), (1, 1)]), 2),
        (shapely.LineString([(0, 0, 7), (1, 0, 7)]), 1),
        ([shapely.LineString([(0, 0), (1, 0)]), [(2, 2), (3, 3)]], 2),
        (BOX, 4),
        (BOX.difference(shapely.box(1, 0.5, 2, 1)), 8),
        (shapely.MultiLineString([[(0, 0), (1, 0)], [(2, 0), (3, 0), (4, 1)]]), 3),
        (shapely.GeometryCollection([BOX, shapely.LineString([(9, 9), (8, 8)])]), 5),
        (shapely.union(BOX, shapely.box(8, 0, 9, 1)), 8),
        (BOX.exterior, 4),
    ],
    ids=lambda each: type(each).__name__ if not isinstance(each, int) else str(each),
)
def test_walls_may_be_segments_lines_and_shapes(walls: Any, count: int) -> None:
    segments = read_walls(walls)
    assert segments.shape == (count, 2, 2)
    if hasattr(walls, "boundary") and hasattr(walls, "length"):
        assert np.hypot(*(segments[:, 1] - segments[:, 0]).T).sum() == pytest.approx(
            walls.length
        )
    assert np.array_equal(szlib.MPCCBF(ZONE, walls=walls).walls, segments)


def test_the_same_wall_in_any_shape_gives_the_same_control() -> None:
    rings = [BOX, BOX.exterior, list(BOX.exterior.coords), read_walls(BOX)]
    steps = [
        szlib.MPCCBF(ZONE, walls=walls).step((-1.0, 1.0, 0.4, 0), (5.0, -2.0))
        for walls in rings
    ]
    assert all(np.array_equal(step.control, steps[0].control) for step in steps)
    assert len(steps[0].h) == 4


@pytest.mark.parametrize(
    "walls",
    [
        5,
        "wall",
        None,
        shapely.Point(0, 0),
        [(0, 0)],
        [(0, 0, 0), (1, 1, 1)],
        [[(0, 0), (0, 0), (0, 0)]],
    ],
)
def test_objects_that_are_not_walls_raise_an_error(walls: Any) -> None:
    with pytest.raises(szlib.SolverError, match="wall"):
        szlib.MPCCBF(ZONE, walls=walls)


@pytest.mark.parametrize("kind", [szlib.MPCCBF, szlib.DifferentialDrive])
def test_rows_of_four_numbers_are_refused_with_what_was_expected(kind: Any) -> None:
    rows = np.array([[0.0, 0.0, 1.0, 0.0], [0.0, 2.0, 1.0, 2.0]])
    with pytest.raises(
        szlib.SolverError, match=r"shape \(n, 2, 2\).* rows of four numbers"
    ):
        kind(ZONE, walls=rows)
    controller = kind(ZONE, walls=np.reshape(rows, (-1, 2, 2)))  # as the error says
    assert controller.walls.shape == (2, 2, 2)
    with pytest.raises(szlib.SolverError, match="rows of four numbers by"):
        controller.set_walls(rows.tolist())
    assert controller.walls.shape == (2, 2, 2), "it keeps those that it had"


# --- solid walls -------------------------------------------------------------------------------------


def inside_step(controller: Any, at: tuple[float, float]) -> Any:
    return controller.step((*at, 0.0, 0.0), (20.0, 0.0))


@pytest.mark.parametrize("source", ["polygon", "nested", "set", "copy", "pickle"])
def test_a_robot_inside_of_a_solid_wall_is_not_safe(source: str) -> None:
    block = shapely.box(-8.5, -8.5, 8.5, 8.5)
    walls: Any = (
        [shapely.MultiPolygon([block]), [(30.0, 0.0), (30.0, 1.0)]]
        if source == "nested"
        else block
    )
    controller = szlib.MPCCBF(ZONE, walls=() if source == "set" else walls)
    if source == "set":
        controller.set_walls(walls)
    if source == "copy":
        controller = copy.deepcopy(controller)
    if source == "pickle":
        controller = pickle.loads(pickle.dumps(controller))
    inside, outside = (
        inside_step(controller, (0.0, 0.0)),
        inside_step(controller, (11.0, 0.0)),
    )
    assert not inside.safe and inside.verify().ok and not inside.verify().safe
    assert "inside of a solid wall" in inside.explain()
    assert outside.safe and outside.verify().ok
    drive = szlib.DifferentialDrive(ZONE, walls=walls)
    inside, outside = (
        drive.step((0.0, 0.0, 0.0), (20.0, 0.0)),
        drive.step((11.0, 0.0, 0.0), (20.0, 0.0)),
    )
    assert (
        not inside.safe and outside.safe and inside.verify().ok and outside.verify().ok
    )


def test_a_room_is_no_solid() -> None:
    outline = shapely.box(-8.5, -8.5, 8.5, 8.5)
    courtyard = shapely.box(-9, -9, 9, 9) - outline
    for walls in (
        outline.exterior,
        list(outline.exterior.coords),
        read_walls(outline),
        courtyard,
    ):
        step = szlib.MPCCBF(ZONE, walls=walls).step((0.0, 0.0, 0.0, 0.0), (4.0, 0.0))
        assert step.safe and step.verify().ok


def test_segments_enclose_no_solid() -> None:
    assert find_solids(walls_from_grid(np.ones((4, 4), bool), 1.0)) is None
    assert find_solids([]) is None


def test_a_goal_or_a_start_inside_of_a_solid_is_blocked():
    controller = szlib.MPCCBF(ZONE, walls=shapely.box(3, -5, 13, 5))
    assert controller.step((0, 0, 0, 0), (8, 0)).goal_blocked
    assert not controller.step((0, 0, 0, 0), (1, 0)).goal_blocked
    for start, goal in (((0, 0, 0, 0), (8, 0)), ((8, 0, 0, 0), (0, 0))):
        with pytest.raises(szlib.SolverError, match="outside of solids"):
            controller.check_start(start, goal)


def test_no_way_leads_into_a_block_of_a_map():
    grid = np.zeros((24, 24), bool)
    grid[6:12, 6:12] = True
    settings = szlib.MPCSettings.among_people()
    walls = walls_from_grid(grid, 1.0)
    controller = szlib.MPCCBF(ZONE, walls=walls, settings=settings)
    step = controller.step((3.0, 9.0, 0.0, 0.0), (9.0, 9.0))
    assert step.goal_blocked and "no way to the goal" in step.explain()


def test_a_coloured_cell_is_as_dark_as_the_mean_of_its_channels(tmp_path):
    picture = np.full((10, 10, 3), 254, np.uint8)
    picture[4:6, 4:6] = (0, 255, 0)
    Image.fromarray(picture).save(tmp_path / "map.png")
    entries = ENTRIES | {"image": "map.png"}
    text = "\n".join(f"{name}: {value}" for name, value in entries.items())
    (tmp_path / "map.yaml").write_text(text)
    assert len(szlib.walls_from_map(tmp_path / "map.yaml")) == 4


@pytest.mark.parametrize("length", [1e-9, 5e-4])
def test_a_wall_shorter_than_a_millimetre_is_refused(length):
    with pytest.raises(szlib.SolverError, match=r"0\.001 m long or longer"):
        read_walls([(0, 0), (length, 0)])


@pytest.mark.parametrize("piece", [0.02, 0.3, 1.0])
def test_pieces_of_a_straight_wall_are_one_wall(piece: float) -> None:
    x = np.linspace(-5.0, 5.0, round(10 / piece) + 1)
    line = np.column_stack([x, 0.3 * x])
    whole = [[line[0].tolist(), line[-1].tolist()]]
    assert read_walls(line).tolist() == whole
    assert read_walls(np.stack([line[:-1], line[1:]], axis=1)).tolist() == whole
    there_and_back = [(0, 0), (2, 0), (1, 0)]
    gap = [[(0, 0), (1, 0)], [(1.1, 0), (2, 0)]]
    assert len(read_walls(there_and_back)) == len(read_walls(gap)) == 2

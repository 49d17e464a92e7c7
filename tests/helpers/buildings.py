"""Maps with many walls: a building, its map by SLAM, and scattered walls.

The building: 40 m x 30 m, two corridors with rooms on both sides, a third that joins
them, 20 rooms, doors of .9 to 1.2 m, and furniture.  Its walls are as an architect
draws them, about 600 segments.  A ragged map of it is what a robot records: an
occupancy grid of .05 m whose outlines jitter, with about 5,000 segments.  In every map
a disc of the radius `FREE` can move from the start to the goal.  The same seed gives
the same map.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt, gaussian_filter, label

from szlib.control import walls_from_grid
from szlib.core.checks import Array

WIDTH, HEIGHT = 40.0, 30.0
"""Of the building [m]."""
ROOMS_IN_ROW, ROWS = 5, 4
CORRIDOR = (2.0, 2.4)
"""Least and largest width of a corridor [m]."""
DOOR = (0.9, 1.2)
"""Least and largest width of a door [m]."""
FREE = 0.37
"""Radius of a disc that can reach the goal; a robot of .3 m and its margin is less."""
OUTER, INNER = 0.3, 0.15
"""Thickness of walls [m]."""
PIECES = (4, 7)
"""Least and largest number of pieces of furniture in a room."""
SIZES = ((1.4, 0.7), (1.6, 0.8), (0.8, 0.4), (0.45, 0.45), (0.5, 0.5), (2.0, 0.9))
"""Of desks, tables, cabinets, chairs and sofas [m]."""
DOORWAY = 0.9
"""Distance of furniture from the middle of a door [m]."""
OPEN_FLOOR = 0.8
"""Distance of the start and the goal from everything [m]."""
RESOLUTION, MARGIN = 0.05, 1.0
"""Side of a cell, and floor around the building, of the ragged map [m]."""
JITTER, SMOOTHING = 0.035, 1.7
"""Standard deviation of an outline [m], and how far its errors reach [cells]."""
SIMPLIFY = 0.03
"""Deviation that the conversion of the ragged map may add [m]."""
SCATTERED_SIZE, SHORT = 60.0, (0.1, 1.0)
"""Side of the area with scattered walls, and their lengths [m]."""


class FloorPlan(NamedTuple):
    """Walls, shape (n, 2, 2), a start, and a goal in reach, shape (2,) [m]."""

    walls: Array
    start: Array
    goal: Array


def make_building(seed: int, *, ragged: bool = False) -> FloorPlan:
    """Make a building of 40 m x 30 m with 20 rooms, corridors, doors and furniture.

    Parameters
    ----------
    seed : of every random number; `ragged` changes neither start nor goal.
    ragged : True: as a map by SLAM, converted by `walls_from_grid`, about 5,000
        segments; else about 600.
    """
    rng = np.random.default_rng([seed, 3401])
    while True:
        rooms, solids, doors = _draw_rooms(rng)
        solid = shapely.union_all(solids).difference(shapely.union_all(doors))
        furniture = [each for room in rooms for each in _furnish(room, doors, rng)]
        solid = shapely.union_all([solid, *furniture])
        if ends := _choose_ends(rooms, solid, rng):
            break
    if not ragged:
        return FloorPlan(_outlines(solid), *ends)
    return FloorPlan(_scan(solid, doors, ends, rng), *ends)


def make_scattered(seed: int, n: int = 2000) -> FloorPlan:
    """Make an area of 60 m x 60 m with `n` short walls and a free way across."""
    rng = np.random.default_rng([seed, 3402])
    ends = np.array([(3.0, 3.0), (SCATTERED_SIZE - 3.0, SCATTERED_SIZE - 3.0)])
    while True:
        walls = np.empty((0, 2, 2))
        while len(walls) < n:
            middles = rng.uniform(0, SCATTERED_SIZE, (n, 1, 2))
            turns, lengths = rng.uniform(0, np.pi, n), rng.uniform(*SHORT, n)
            along = (
                lengths[:, None] / 2 * np.column_stack([np.cos(turns), np.sin(turns)])
            )
            new = middles + np.stack([-along, along], axis=1)
            lines, points = shapely.linestrings(new), shapely.points(ends)
            gaps = shapely.distance(lines[:, None], points)
            walls = np.concatenate([walls, new[gaps.min(axis=1) > OPEN_FLOOR]])[:n]
        if _is_connected(shapely.multilinestrings(walls), *ends):
            return FloorPlan(walls, *ends)


def _draw_rooms(rng: np.random.Generator) -> tuple[list[Any], list[Any], list[Any]]:
    """Draw rooms, row by row, walls, and openings of doors, as polygons."""
    low, high, joint = rng.uniform(*CORRIDOR, 3)
    tall = (HEIGHT - low - high) / ROWS
    depths = tall + rng.uniform(-0.6, 0.6, 2)  # of the lowest and the highest row
    bottoms = [0.0, depths[0] + low, HEIGHT / 2, HEIGHT - depths[1]]
    tops = [depths[0], HEIGHT / 2, HEIGHT - depths[1] - high, HEIGHT]
    shell = shapely.box(0, 0, WIDTH, HEIGHT)
    rooms, doors = list[Any](), list[Any]()
    solids = [shell.difference(shell.buffer(-OUTER))]

    def add_door(x: float, y: float, is_level: bool) -> None:
        half = rng.uniform(*DOOR) / 2
        across = half, INNER
        dx, dy = across if is_level else across[::-1]
        doors.append(shapely.box(x - dx, y - dy, x + dx, y + dy))

    for row, (bottom, top) in enumerate(zip(bottoms, tops, strict=True)):
        is_split = row in (1, 2)  # by the corridor that joins the others
        wide = (WIDTH - is_split * joint) / ROOMS_IN_ROW
        lefts = wide * np.arange(ROOMS_IN_ROW + 1) + rng.uniform(
            -1, 1, ROOMS_IN_ROW + 1
        )
        lefts[[0, -1]] = 0.0, WIDTH - is_split * joint
        if row == 1:
            joint_at, gap = lefts[2], lefts[2] - 2 * wide
        elif row == 2:  # the corridor is straight
            lefts[2] = 2 * wide + gap
        for i, (left, right) in enumerate(zip(lefts, lefts[1:], strict=False)):
            shift = joint if is_split and i >= 2 else 0.0
            room = shapely.box(left + shift, bottom, right + shift, top)
            rooms.append(room)
            solids.append(room.buffer(INNER / 2, join_style="mitre").exterior)
            doorway = top if row in (0, 2) else bottom
            add_door(rng.uniform(left + 1.2, right - 1.2) + shift, doorway, True)
            if i and not (is_split and i == 2) and rng.random() < 0.3:
                add_door(left + shift, rng.uniform(bottom + 1.2, top - 1.2), False)
    walls = [room.exterior.buffer(INNER / 2, join_style="mitre") for room in rooms]
    ends = [  # the corridor that joins the others is as high as both rows beside it
        shapely.box(joint_at, bottoms[1], joint_at + joint, tops[2])
    ]
    inside = shapely.union_all(ends).buffer(-INNER / 2)
    return rooms, [solids[0], *(each.difference(inside) for each in walls)], doors


def _furnish(room: Any, doors: list[Any], rng: np.random.Generator) -> list[Any]:
    """Draw furniture that leaves free most of a room and a way between its doors."""
    own = [door for door in doors if door.intersects(room)]
    keep_free = shapely.union_all([door.centroid.buffer(DOORWAY) for door in own])
    inside = room.buffer(-INNER / 2 - FREE)
    floor = shapely.union_all([inside, *(door.buffer(0.5) for door in own)])
    left, bottom, right, top = room.bounds
    pieces, count = list[Any](), int(rng.integers(PIECES[0], PIECES[1] + 1))
    for _ in range(20 * count):
        if len(pieces) == count:
            break
        a, b = SIZES[rng.integers(len(SIZES))]
        turn = rng.choice([0.0, 90.0, rng.uniform(0, 90)], p=[0.4, 0.4, 0.2])
        piece = shapely.box(-a / 2, -b / 2, a / 2, b / 2)
        piece = shapely.affinity.rotate(piece, turn)
        x, y = rng.uniform((left, bottom), (right, top))
        if rng.random() < 0.5:  # at a wall
            x = min(
                (left + a / 2 + 0.1, right - a / 2 - 0.1), key=lambda to: abs(to - x)
            )
        piece = shapely.affinity.translate(piece, x, y)
        if not room.contains(piece) or piece.intersects(keep_free):
            continue
        if any(piece.distance(each) < 0.05 for each in pieces):
            continue
        left_over = floor.difference(
            shapely.union_all([*pieces, piece]).buffer(FREE + 0.1)
        )
        parts = [part for part in shapely.get_parts(left_over) if part.area > 0.2]
        largest = max(parts, key=lambda part: part.area)
        if largest.area > 0.5 * inside.area and all(
            largest.intersects(door.centroid) for door in own
        ):
            pieces.append(piece)
    return pieces


def _choose_ends(
    rooms: list[Any], solid: Any, rng: np.random.Generator
) -> tuple[Array, Array] | None:
    """Choose a start and a goal in rooms of both corridors; None if no way is free."""
    half = len(rooms) // 2
    numbers = rng.integers(half), half + rng.integers(half)
    ends = list[Array]()
    for number in numbers:
        left, bottom, right, top = rooms[number].bounds
        places = rng.uniform((left, bottom), (right, top), (200, 2))
        gaps = shapely.distance(shapely.points(places), solid)
        if gaps.max() <= OPEN_FLOOR:
            return None
        ends.append(places[np.argmax(gaps > OPEN_FLOOR)])
    start, goal = ends
    return (start, goal) if _is_connected(solid, start, goal) else None


def _is_connected(solid: Any, start: Array, goal: Array) -> bool:
    """True if a disc of the radius `FREE` can move from the start to the goal."""
    area = shapely.box(*solid.buffer(2 * FREE).bounds)
    parts = shapely.get_parts(area.difference(solid.buffer(FREE)))
    ends = shapely.points([start, goal])
    return any(shapely.contains(part, ends).all() for part in parts)


def _outlines(solid: Any) -> Array:
    """The edges of polygons as segments, shape (n, 2, 2)."""
    rings = shapely.get_rings(shapely.get_parts(solid.simplify(1e-6)))
    corners = [shapely.get_coordinates(ring) for ring in rings]
    return np.concatenate([np.stack([each[:-1], each[1:]], axis=1) for each in corners])


def _scan(
    solid: Any, doors: list[Any], ends: tuple[Array, Array], rng: np.random.Generator
) -> Array:
    """Walls as mapped by a robot: a grid of cells with errors; doors stay open."""
    x, y = (
        np.arange(-MARGIN, side + MARGIN, RESOLUTION) + RESOLUTION / 2
        for side in (WIDTH, HEIGHT)
    )
    cells, openings = np.meshgrid(x, y), shapely.union_all(doors)
    shapely.prepare([solid, openings])
    inside, is_open = (shapely.contains_xy(each, *cells) for each in (solid, openings))
    gaps = distance_transform_edt(~inside) - distance_transform_edt(inside)
    columns, rows = ((np.array(ends) + MARGIN) / RESOLUTION).astype(int).T
    while True:
        noise = gaussian_filter(rng.normal(size=inside.shape), SMOOTHING)
        occupied = gaps * RESOLUTION < JITTER * noise / noise.std()
        occupied &= ~is_open
        space = distance_transform_edt(~occupied) * RESOLUTION
        parts, _ = label(space > FREE + SIMPLIFY + RESOLUTION / 2)
        start, goal = parts[rows, columns]
        if start and start == goal:
            origin = (-MARGIN, -MARGIN, 0.0)
            return walls_from_grid(occupied, RESOLUTION, origin, simplify=SIMPLIFY)

"""Zones as a layer of a costmap: against cells one by one, turned, moved, and with nobody there."""

import numpy as np
import pytest
import shapely

import szlib
from szlib.zones.costmaps import BODY_RADIUS, FADE, circle_around
from szlib.zones.polar import DIRECTIONS, PolarZone

ZONE = szlib.Ellipse((0.2, -0.1), (1.0, 0.6), 0.4)
GRID = szlib.Grid((-4.0, -3.0), 0.1, (60, 80))


def polygon(zone, n=4000):
    return shapely.Polygon(zone.curve(n))


def brute(people, grid, zone):
    """Cell by cell and person by person, with polygons."""
    costs = np.zeros(grid.shape)
    for x, y, vx, vy in people:
        around = polygon(zone.placed((x, y), np.arctan2(vy, vx)))
        m = np.array(around.centroid.coords[0])
        for i in range(grid.shape[0]):
            for j in range(grid.shape[1]):
                at = np.array(grid.origin) + grid.resolution * (np.array([j, i]) + 0.5)
                ray = shapely.LineString([m, m + 100 * (at - m)])
                edge = np.hypot(*(ray.intersection(around.exterior).coords[0] - m))
                far = np.hypot(*(at - m))
                cost = 99 - 49 * far / edge if far <= edge else max(0, 50 * (1 - (far - edge) / FADE))
                if np.hypot(*(at - (x, y))) <= BODY_RADIUS:
                    cost = 100
                costs[i, j] = max(costs[i, j], cost)
    return costs


def test_it_is_what_every_cell_and_person_alone_says():
    grid = szlib.Grid((-2.5, -1.0), 0.17, (18, 25))
    people = np.array([[0.0, 0.0, 0.5, 0.2], [1.3, 0.4, -0.4, 0.0], [-2.4, 1.9, 0.3, -0.9]])
    costs, expected = ZONE.costmap(people, grid), brute(people, grid, ZONE)
    assert costs.dtype == np.int8
    assert costs.shape == (18, 25)
    assert np.abs(costs - expected).max() <= 1.001  # rounding to whole numbers
    assert len(np.unique(costs)) > 50


def test_half_and_more_is_inside_somebodys_zone_and_nothing_else_is():
    rng = np.random.default_rng(0)
    people = np.column_stack([rng.uniform((-4, -3), (4, 3), (6, 2)), rng.uniform(-1, 1, (6, 2))])
    inside = np.zeros(GRID.shape, bool)
    for x, y, vx, vy in people:
        inside |= ZONE.placed((x, y), np.arctan2(vy, vx)).level(GRID.centers()) <= 1
        inside |= np.hypot(*np.moveaxis(GRID.centers() - (x, y), -1, 0)) <= BODY_RADIUS
    assert np.array_equal(ZONE.costmap(people, GRID) >= 50, inside)
    assert np.array_equal(ZONE.costmap(people, GRID, fade=0.0) > 0, inside)


def test_rows_are_y_and_columns_are_x_from_the_corner_on():
    costs = ZONE.costmap([[1.96, -1.04, 1.0, 0.0]], szlib.Grid((0.0, -2.0), 0.1, (20, 50)), fade=0.0)
    assert costs[9, 19] == 100
    assert GRID.centers()[0, 0] == pytest.approx([-3.95, -2.95])
    assert GRID.centers()[59, 79] == pytest.approx([3.95, 2.95])
    assert costs.ravel()[9 * 50 + 19] == 100  # OccupancyGrid.data: row by row, x fastest


def test_moved_by_whole_cells_it_moves_and_turned_a_quarter_it_turns():
    rng = np.random.default_rng(1)
    people = np.column_stack([rng.uniform(-2, 2, (4, 2)), rng.uniform(-1, 1, (4, 2))])
    grid = szlib.Grid((-3.2, -3.2), 0.1, (64, 64))
    costs = ZONE.costmap(people, grid)
    moved = ZONE.costmap(people + np.array([0.3, -0.5, 0, 0]), szlib.Grid((-2.9, -3.7), 0.1, (64, 64)))
    turned = ZONE.costmap(people[:, [1, 0, 3, 2]] * [-1, 1, -1, 1], grid)
    assert np.abs(moved - costs).max() <= 1  # a cell whose cost is a half may round either way
    assert np.abs(turned - costs.T[:, ::-1]).max() <= 1
    assert np.array_equal(ZONE.costmap(people[::-1], grid), costs)
    assert np.array_equal(np.maximum(ZONE.costmap(people[:2], grid), ZONE.costmap(people[2:], grid)), costs)


def test_of_who_stands_the_circle_is_drawn_and_of_who_is_known_to_face_somewhere_the_zone():
    circle = circle_around(ZONE)
    standing = ZONE.costmap([[0.0, 0.0, 0.0, 0.0]], GRID)
    assert np.array_equal(standing >= 50, circle.level(GRID.centers()) <= 1)
    assert np.array_equal(standing, ZONE.costmap([[0.0, 0.0, 0.1, -0.1]], GRID))  # a tracker's noise
    facing = ZONE.costmap([szlib.Person((0.0, 0.0), heading=1.0)], GRID)
    assert np.array_equal(facing >= 50, ZONE.placed((0.0, 0.0), 1.0).level(GRID.centers()) <= 1)


def test_the_circle_around_a_zone_is_the_smallest():
    rng = np.random.default_rng(2)
    for _ in range(100):
        axes = np.sort(rng.uniform(0.2, 2.0, 2))[::-1]
        zone = szlib.Ellipse(tuple(rng.uniform(-1, 1, 2)), tuple(axes), rng.uniform(-2, 2))
        circle = circle_around(zone)
        assert circle.center == (0.0, 0.0)
        assert circle.semi_axes[0] == pytest.approx(np.hypot(*zone.curve(20_001).T).max(), rel=1e-7)


def test_people_may_have_zones_of_their_own_and_a_social_zone_is_asked_for_its_speed():
    own = szlib.Ellipse((0.0, 0.0), (0.5, 0.5))
    drawn = ZONE.costmap([szlib.Person((0.0, 0.0), (1.0, 0.0), zone=own)], GRID)
    assert np.array_equal(drawn, own.costmap([[0.0, 0.0, 1.0, 0.0]], GRID))
    radii = PolarZone(np.array([0.5, 1.1]), DIRECTIONS, np.ones((2, len(DIRECTIONS))))
    zone = szlib.SocialZone(None, 2.0, {0.5: own, 1.1: ZONE}, {}, {}, "quantile", radii)
    people = [[0.0, 0.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.0]]
    with pytest.warns(szlib.DataWarning, match="of unknown worth") as told:
        assert np.array_equal(zone.costmap(people, GRID), ZONE.costmap(people, GRID))
    assert len(told) == 1
    with pytest.warns(szlib.DataWarning):
        assert np.array_equal(zone.costmap(people, GRID, speed=0.5), own.costmap(people, GRID))


@pytest.mark.parametrize("nobody", [[], (), np.zeros((0, 4))])
def test_nobody_costs_nothing(nobody):
    assert not ZONE.costmap(nobody, GRID).any()


def test_people_outside_of_the_grid_only_reach_in():
    large = szlib.Grid((-8.0, -7.0), 0.1, (140, 160))
    people = [[-4.3, 0.0, 1.0, 0.0], [30.0, 0.0, 1.0, 0.0], [4.2, 3.3, 0.0, -1.0]]
    assert np.array_equal(ZONE.costmap(people, GRID), ZONE.costmap(people, large)[40:100, 40:120])
    assert ZONE.costmap(people, GRID).any()


def test_what_cannot_be_used_is_told():
    with pytest.raises(szlib.ZoneError, match="number 1 is"):
        ZONE.costmap([[0, 0, 1, 0], [0, np.nan, 1, 0]], GRID)
    with pytest.raises(szlib.ZoneError, match=r"array \(n, 4\)"):
        ZONE.costmap(np.zeros((3, 2)), GRID)
    with pytest.raises(szlib.ZoneError, match="fade and body"):
        ZONE.costmap([], GRID, fade=-1.0)
    for origin, resolution, shape in [
        ((0, 0), 0.0, (5, 5)), ((0, np.inf), 0.1, (5, 5)), ((0, 0), 0.1, (5, 0)), ((0, 0), 0.1, (5.0, 5)),
    ]:  # fmt: skip
        with pytest.raises(szlib.ZoneError, match="a grid"):
            szlib.Grid(origin, resolution, shape)

"""Costmaps of zones: compared with single cells, rotated, moved, and without people."""

import numpy as np
import pytest
import shapely
from costmaps import FADE, Grid, draw_costmap

import szlib
from szlib.zones.ellipses import BODY_RADIUS, EllipseZone, circle_around

ZONE = szlib.Ellipse((0.2, -0.1), (1.0, 0.6), 0.4)
GRID = Grid((-4.0, -3.0), 0.1, (60, 80))


def polygon(zone, n=4000):
    return shapely.Polygon(zone.curve(n))


def compute_cell_by_cell(people, grid, zone):
    """Costs of each cell and person on its own, with polygons."""
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
                cost = (
                    99 - 49 * far / edge
                    if far <= edge
                    else max(0, 50 * (1 - (far - edge) / FADE))
                )
                if np.hypot(*(at - (x, y))) <= BODY_RADIUS:
                    cost = 100
                costs[i, j] = max(costs[i, j], cost)
    return costs


def test_costs_equal_a_computation_cell_by_cell():
    grid = Grid((-2.5, -1.0), 0.17, (18, 25))
    people = np.array(
        [[0.0, 0.0, 0.5, 0.2], [1.3, 0.4, -0.4, 0.0], [-2.4, 1.9, 0.3, -0.9]]
    )
    costs, expected = (
        draw_costmap(ZONE, people, grid),
        compute_cell_by_cell(people, grid, ZONE),
    )
    assert costs.dtype == np.int8
    assert costs.shape == (18, 25)
    assert np.abs(costs - expected).max() <= 1.001  # rounding to whole numbers
    assert len(np.unique(costs)) > 50


def test_costs_of_half_and_more_mark_zones_and_bodies():
    rng = np.random.default_rng(0)
    people = np.column_stack(
        [rng.uniform((-4, -3), (4, 3), (6, 2)), rng.uniform(-1, 1, (6, 2))]
    )
    inside = np.zeros(GRID.shape, bool)
    for x, y, vx, vy in people:
        inside |= ZONE.placed((x, y), np.arctan2(vy, vx)).level(GRID.centers()) <= 1
        inside |= np.hypot(*np.moveaxis(GRID.centers() - (x, y), -1, 0)) <= BODY_RADIUS
    assert np.array_equal(draw_costmap(ZONE, people, GRID) >= 50, inside)
    assert np.array_equal(draw_costmap(ZONE, people, GRID, fade=0.0) > 0, inside)


def test_rows_are_y_and_columns_are_x():
    costs = draw_costmap(
        ZONE,
        [[1.96, -1.04, 1.0, 0.0]],
        Grid((0.0, -2.0), 0.1, (20, 50)),
        fade=0.0,
    )
    assert costs[9, 19] == 100
    assert GRID.centers()[0, 0] == pytest.approx([-3.95, -2.95])
    assert GRID.centers()[59, 79] == pytest.approx([3.95, 2.95])
    # OccupancyGrid.data: row by row, x fastest
    assert costs.ravel()[9 * 50 + 19] == 100


def test_person_without_heading_gets_the_circle():
    circle = circle_around(ZONE)
    standing = draw_costmap(ZONE, [[0.0, 0.0, 0.0, 0.0]], GRID)
    assert np.array_equal(standing >= 50, circle.level(GRID.centers()) <= 1)
    # a tracker's noise
    assert np.array_equal(standing, draw_costmap(ZONE, [[0.0, 0.0, 0.1, -0.1]], GRID))
    facing = draw_costmap(ZONE, [szlib.Person((0.0, 0.0), heading=1.0)], GRID)
    assert np.array_equal(
        facing >= 50, ZONE.placed((0.0, 0.0), 1.0).level(GRID.centers()) <= 1
    )


def test_person_zone_replaces_the_common_zone_and_social_zone_depends_on_speed():
    own = szlib.Ellipse((0.0, 0.0), (0.5, 0.5))
    drawn = draw_costmap(ZONE, [szlib.Person((0.0, 0.0), (1.0, 0.0), zone=own)], GRID)
    assert np.array_equal(drawn, draw_costmap(own, [[0.0, 0.0, 1.0, 0.0]], GRID))
    shape = EllipseZone({0.5: own, 1.1: ZONE})
    zone = szlib.SocialZone(shape, 2.0, shape.ellipses)
    people = [[0.0, 0.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.0]]
    with pytest.warns(
        szlib.DataWarning, match="quality of the zone is unknown"
    ) as caught:
        assert np.array_equal(
            draw_costmap(zone, people, GRID), draw_costmap(ZONE, people, GRID)
        )
    assert len(caught) == 1
    with pytest.warns(szlib.DataWarning):
        assert np.array_equal(
            draw_costmap(zone, people, GRID, speed=0.5), draw_costmap(own, people, GRID)
        )


@pytest.mark.parametrize("empty", [[], (), np.zeros((0, 4))])
def test_costmap_without_people_is_empty(empty):
    assert not draw_costmap(ZONE, empty, GRID).any()


def test_costs_do_not_depend_on_the_grid_border():
    large = Grid((-8.0, -7.0), 0.1, (140, 160))
    people = [[-4.3, 0.0, 1.0, 0.0], [30.0, 0.0, 1.0, 0.0], [4.2, 3.3, 0.0, -1.0]]
    assert np.array_equal(
        draw_costmap(ZONE, people, GRID),
        draw_costmap(ZONE, people, large)[40:100, 40:120],
    )
    assert draw_costmap(ZONE, people, GRID).any()


def test_invalid_arguments_are_refused():
    with pytest.raises(szlib.ZoneError, match="person 1 is"):
        draw_costmap(ZONE, [[0, 0, 1, 0], [0, np.nan, 1, 0]], GRID)
    with pytest.raises(szlib.ZoneError, match=r"array \(n, 4\)"):
        draw_costmap(ZONE, np.zeros((3, 2)), GRID)
    with pytest.raises(szlib.ZoneError, match="fade and body_radius"):
        draw_costmap(ZONE, [], GRID, fade=-1.0)
    for origin, resolution, shape in [
        ((0, 0), 0.0, (5, 5)), ((0, np.inf), 0.1, (5, 5)), ((0, 0), 0.1, (5, 0)), ((0, 0), 0.1, (5.0, 5)),
    ]:  # fmt: skip
        with pytest.raises(szlib.ZoneError, match="a grid"):
            Grid(origin, resolution, shape)


def test_a_grid_may_have_one_row_or_one_cell():
    for shape in ((1, 5), (5, 1), (1, 1)):
        grid = Grid(origin=(0.0, 0.0), resolution=0.1, shape=shape)
        assert grid.centers().shape == (*shape, 2)

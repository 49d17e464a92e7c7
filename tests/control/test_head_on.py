"""People whom the robot meets head-on: the target beside them."""

from math import asin, atan2, cos, pi, sin

import numpy as np
import pytest
from szlib.control.people import place_zone

import szlib
from szlib.control.head_on import find_target

CIRCLE = szlib.Ellipse((0.0, 0.0), (0.7, 0.7))
STANDING = place_zone(szlib.Person((0.0, 0.0), heading=pi), CIRCLE)
ROBOT = (-3.0, 0.0)


def find_turn(bearing: float, settings: szlib.MPCSettings, walls: tuple = ()) -> float:
    """Angle from the goal, 8 m away at a `bearing`, to the target [rad], both seen from the robot."""
    goal = (ROBOT[0] + 8 * cos(bearing), ROBOT[1] + 8 * sin(bearing))
    x, y = find_target(ROBOT, goal, [STANDING], walls, settings)
    assert np.hypot(x - ROBOT[0], y - ROBOT[1]) == pytest.approx(8), (
        "as far away as the goal"
    )
    return atan2(y - ROBOT[1], x - ROBOT[0]) - bearing


def half_angle(settings: szlib.MPCSettings) -> float:
    """Half the angle under which the robot sees the set h < 0 of a round zone."""
    return asin((0.7 + settings.r_robot + settings.eps) / 3)


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5])
@pytest.mark.parametrize(("side", "sign"), [("right", -1), ("left", 1)])
def test_the_target_lies_along_the_tangent_and_turns_back_without_a_jump(
    side, sign, share
):
    settings = szlib.MPCSettings(pass_side=side, head_on_share=share)
    w = half_angle(settings)
    leads = np.linspace(-0.999, 2.5, 400)
    turns = sign * np.array(
        [find_turn(sign * lead * share * w, settings) for lead in leads]
    )
    expected = (w - leads * share * w) * np.clip(2 - leads, 0, 1)
    assert turns == pytest.approx(expected, abs=1e-9)
    assert np.abs(np.diff(turns)).max() < 2 * w * (leads[1] - leads[0]), (
        "without a jump"
    )


def test_the_robot_passes_on_the_other_side_if_the_goal_lies_there():
    settings = szlib.MPCSettings(pass_side="right")
    limit = settings.head_on_share * half_angle(settings)
    assert find_turn(0.99 * limit, settings) < 0 < find_turn(1.01 * limit, settings)
    assert find_turn(2.01 * limit, settings) == pytest.approx(0)


def test_a_person_who_walks_across_does_not_hide_one_ahead():
    across = place_zone(szlib.Person((-1.0, -3.0), (0.0, 1.0)), CIRCLE)
    s = szlib.MPCSettings(head_on_share=0.25)
    alone = find_target(ROBOT, (5.0, 0.0), [STANDING], (), s)
    assert (
        find_target(ROBOT, (5.0, 0.0), [across, STANDING], (), s) == alone != (5.0, 0.0)
    )


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("walls", [(), (-1.6,), (1.6,), (-2.2, 2.2), (-1.6, 1.6)])
def test_the_target_moves_and_turns_with_the_scene(side, walls):
    settings = szlib.MPCSettings(pass_side=side)
    zone = szlib.Ellipse((0.1, 0.05), (0.8, 0.6), 0.3)

    def find(angle, shift):
        def move(x, y):
            return x * cos(angle) - y * sin(angle) + shift[0], x * sin(angle) + y * cos(
                angle
            ) + shift[1]

        person = szlib.Person(move(0.0, 0.0), heading=pi + angle)
        rows = [(*move(-9.0, y), *move(9.0, y), 0.05) for y in walls]
        robot, goal = move(*ROBOT), move(5.0, 0.0)
        x, y = np.subtract(
            find_target(robot, goal, [place_zone(person, zone)], rows, settings), shift
        )
        return x * cos(angle) + y * sin(angle), y * cos(angle) - x * sin(angle)

    expected = find(0.0, (0.0, 0.0))
    assert find(0.0, (30.0, -20.0)) == pytest.approx(expected)
    assert find(2.3, (-4.0, 7.0)) == pytest.approx(expected)
    free = {"right": -1.6 not in walls, "left": 1.6 not in walls}
    other = "left" if side == "right" else "right"
    passed = side if free[side] else other if free[other] else "none"
    assert np.sign(expected[1]) == {"right": -1, "left": 1, "none": 0}[passed]


@pytest.mark.parametrize("turned", [0.0, pi / 2])
@pytest.mark.parametrize(("more", "is_free"), [(-0.01, False), (0.01, True)])
def test_a_side_is_free_if_the_robot_fits_between_the_zone_and_the_wall(
    turned, more, is_free
):
    """Beside the set h < 0 of an ellipse the robot's disc needs its radius and the wall's margin."""
    settings, zone = (
        szlib.MPCSettings(pass_side="right"),
        szlib.Ellipse((0.0, 0.0), (1.0, 0.6), turned),
    )
    person = place_zone(szlib.Person((0.0, 0.0), heading=pi), zone)
    reach = 1.0 + settings.r_robot + settings.eps
    widest = reach if turned else np.sqrt(reach**2 - 1.0**2 + 0.6**2)
    y = -(widest + settings.r_robot + 0.07 + more)
    target = find_target(
        ROBOT, (4.0, 0.0), [person], [(-50.0, y, 50.0, y, 0.07)], settings
    )
    assert (target[1] < 0) == is_free
    assert target[1] != 0, "otherwise it passes on the left"


@pytest.mark.parametrize("end", [-1.89, -1.91])
@pytest.mark.parametrize("shift", [0.0, 0.5, -7.3])
def test_a_wall_that_just_reaches_into_the_space_makes_the_side_not_free(end, shift):
    """A wall 1 m long, end on; 1.4 m beside the person's centre the disc passes 0.5 m from it."""
    settings = szlib.MPCSettings(pass_side="right")
    zone = szlib.Ellipse((0.0, 0.0), (0.85, 0.85))
    person = place_zone(szlib.Person((shift, shift), heading=pi), zone)
    wall = (shift - 0.05, shift + end, shift - 0.05, shift + end - 1.0, 0.25)
    target = find_target(
        (shift - 3.0, shift), (shift + 4.0, shift), [person], [wall], settings
    )
    assert (target[1] > shift) == (end == -1.89)

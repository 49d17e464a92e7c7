"""The ROS 2 nodes of notebooks/examples, without ROS: stubs of rclpy and messages, a robot that obeys."""

from math import hypot

import helpers.ros_stubs as ros
import numpy as np
import pytest
from helpers.ros_stubs import Node, goal, grid, hear, odometry, people
from studies.distances import euclidean_to_ellipse

import szlib
from szlib.control.differential_drive import Unicycle
from szlib.zones.ellipses import EllipseZone

ZONE = szlib.Ellipse((0.1, 0.0), (0.9, 0.7), 0.0)
GOAL = (5.0, 0.5)
# a zone of nobody's data
pytestmark = pytest.mark.filterwarnings("ignore::szlib.core.errors.DataWarning")


CLASSES = {"ros2_node": "SocialDrive", "ros2_node_full": "FullSocialDrive"}


@pytest.fixture(params=CLASSES)
def make_either(request, monkeypatch, tmp_path):
    """A node with these parameters: the short one, or the full one without TF."""
    yield from maker(monkeypatch, tmp_path, request.param)


@pytest.fixture
def make_short(monkeypatch, tmp_path):
    """The short node with these parameters."""
    yield from maker(monkeypatch, tmp_path, "ros2_node")


@pytest.fixture
def make(monkeypatch, tmp_path):
    """The full node with these parameters, without TF."""
    yield from maker(monkeypatch, tmp_path, "ros2_node_full")


@pytest.fixture
def make_with_tf(monkeypatch, tmp_path):
    """The full node with these parameters, and with TF."""
    yield from maker(monkeypatch, tmp_path, "ros2_node_full", tf=True)


def maker(monkeypatch, tmp_path, module_name, tf=False):
    """How to make a node."""
    shape = EllipseZone({1.1: ZONE})
    szlib.SocialZone(shape, 2.0, shape.ellipses).save(tmp_path / "zone.json")
    with ros.node_module(module_name, tf) as module:

        def node(**parameters):
            given = {"zone": str(tmp_path / "zone.json"), "v_max": 1.0} | parameters
            monkeypatch.setattr(Node, "given", given)
            return getattr(module, CLASSES[module_name])()

        yield node


def tick(node):
    """The timer goes off every 0.1 s; what is commanded."""
    assert list(node.every) == [0.1]
    return np.array(ros.tick(node))


def drive(node, walker, steps, silent=(), late=0.04):
    """The loop: the robot obeys, and each topic comes, a little late, unless it has fallen silent."""
    robot, own, path = Unicycle(), np.array([0.0, 0.0, -2.0, 0.0, 0.0]), []
    for k in range(steps):
        before = robot.advance(own, own[3:], -late)
        before[3:] = own[3:]
        if "odom" not in silent or k < 30:
            hear(node, "odom", odometry(before, late=late))
        x, y, vx, vy = walker
        seen = (x + vx * (0.1 * k - late), y + vy * (0.1 * k - late), vx, vy)
        if "people" not in silent or k < 30:
            hear(node, "people", people(("anna", seen), late=late))
        command = tick(node)
        path.append((own, command))
        own = robot.advance(own, command, 0.1)
        Node.now += 0.1
    return path


def test_the_robot_reaches_its_goal_past_a_person(make_either):
    node = make_either(walls="-1 3 7 3; -1 -3 7 -3")
    hear(node, "goal_pose", goal(*GOAL))
    walker = (4.0, 0.2, -0.4, 0.0)
    path = drive(node, walker, 150)
    assert node.logged == []
    assert hypot(path[-1][0][0] - GOAL[0], path[-1][0][1] - GOAL[1]) < 0.1
    assert np.abs(path[-1][1]).max() < 0.05
    for k, (own, _) in enumerate(path):
        offset = own[:2] - np.array(walker[:2]) - 0.1 * k * np.array(walker[2:])
        assert (
            euclidean_to_ellipse(offset, ZONE.placed((0.0, 0.0), np.pi))
            >= 0.3 + 0.05 - 1e-6
        )


@pytest.mark.parametrize("topic", ["odom", "people"])
def test_the_robot_stops_when_a_topic_falls_silent(make_either, topic):
    node = make_either()
    hear(node, "goal_pose", goal(*GOAL))
    path = drive(node, (4.0, 2.5, 0.0, 0.0), 60, silent=(topic,))
    commands = np.array([command for _, command in path])
    assert np.abs(commands[25:30, 0]).min() > 0.3  # it was on its way
    assert not commands[36:].any()  # 0.5 s after the last message, and a step
    assert {"odom": "no recent odometry", "people": "no recent people"}[
        topic
    ] in node.logged[-1]
    last = path[-1][0]
    hear(node, "odom", odometry(last))
    hear(node, "people", people())
    again = tick(node)
    assert again.any()  # as soon as all is there again, and from rest
    assert abs(again[0]) <= 2 * 0.1


def test_the_robot_waits_for_odometry_people_and_goal(make_either):
    node = make_either()
    assert not tick(node).any()
    hear(node, "odom", odometry(np.zeros(5)))
    hear(node, "people", people())
    assert not tick(node).any()
    hear(node, "goal_pose", goal(*GOAL))
    assert tick(node).any()


def test_messages_in_another_frame_are_ignored_with_a_warning(make):
    node = make()
    hear(node, "odom", odometry(np.zeros(5)))
    hear(node, "goal_pose", goal(*GOAL))
    hear(node, "people", people(frame="camera"))
    assert not tick(node).any()
    assert "people is in the frame 'camera', not in 'odom'" in node.logged[0]


def test_odometry_that_is_not_finite_is_ignored(make):
    node = make()
    hear(node, "people", people())
    hear(node, "goal_pose", goal(*GOAL))
    hear(node, "odom", odometry(np.array([0.0, np.nan, 0.0, 0.0, 0.0])))
    assert not tick(node).any()
    assert "odom is not finite" in node.logged[0]
    hear(node, "odom", odometry(np.zeros(5)))
    assert tick(node).any()


def test_the_robot_stays_clear_of_people_whose_numbers_cannot_be_used(make_either):
    node = make_either()
    hear(node, "goal_pose", goal(*GOAL))
    hear(node, "odom", odometry(np.zeros(5)))
    hear(node, "people", people(("anna", (np.nan, 0.0, 0.0, 0.0))))
    assert np.abs(tick(node)).max() < 1e-3
    assert "1 are unknown" in node.logged[-1]


@pytest.mark.parametrize("w", [0.0, 0.9, 2.0, np.nan])
def test_a_quaternion_whose_norm_is_not_one_is_no_heading(make, w):
    node, message = make(), odometry(np.zeros(5))
    message.pose.pose.orientation.w = w
    hear(node, "people", people())
    hear(node, "goal_pose", goal(*GOAL))
    hear(node, "odom", message)
    assert not tick(node).any() and "its quaternion is no rotation" in node.logged[0]
    hear(node, "odom", odometry(np.array([0.0, 0.0, 3.0, 0.0, 0.0])))
    assert tick(node).any()


def test_a_base_that_wants_stamped_commands_gets_them(make):
    node = make(stamped=True)
    hear(node, "odom", odometry(np.zeros(5)))
    hear(node, "people", people())
    hear(node, "goal_pose", goal(*GOAL))
    ((_, timer),) = node.every.items()
    timer()
    (command,) = node.published["cmd_vel"]
    assert type(command) is ros.TwistStamped and command.twist.linear.x > 0
    assert command.header.stamp == ros.stamp_of(Node.now)


def test_messages_in_frames_that_tf_knows_are_brought_into_the_frame_of_the_walls(
    make_with_tf, monkeypatch
):
    half = np.pi / 4  # the camera is at (1, 2) and looks along y
    turned = ros.xyz(w=float(np.cos(half)))
    turned.z = float(np.sin(half))
    monkeypatch.setattr(
        ros.Buffer,
        "poses",
        {"camera": (1.0, 2.0, turned), "broken": (0, 0, ros.xyz(w=0.0))},
    )
    node = make_with_tf()
    hear(node, "odom", odometry(np.array([3.0, -1.0, 0.5, 0.2, 0.1]), frame="camera"))
    assert node.own == pytest.approx([2.0, 5.0, 0.5 + np.pi / 2, 0.2, 0.1])
    hear(node, "people", people(("anna", (3.0, -1.0, 0.4, 0.0)), frame="camera"))
    assert node.people == pytest.approx(np.array([[2.0, 5.0, 0.0, 0.4]]))
    hear(node, "goal_pose", goal(1.0, 1.0, frame="camera"))
    assert node.goal == pytest.approx((0.0, 3.0))
    hear(node, "goal_pose", goal(1.0, 1.0, frame="unknown"))
    hear(node, "people", people(frame="broken"))
    assert node.goal == pytest.approx((0.0, 3.0)) and len(node.people) == 1
    assert (
        "unknown does not exist" in node.logged[0]
        and "is no rotation" in node.logged[1]
    )


def test_a_robot_that_is_stuck_says_why(make_either):
    node = make_either(walls="1.2 -3 1.2 3; -3 -3 -3 3; -3 -3 1.2 -3; -3 3 1.2 3")
    hear(node, "goal_pose", goal(*GOAL))
    drive(node, (-4.0, 3.0, 0.0, 0.0), 110)
    assert any(
        "no progress for" in said and "no way to the goal" in said
        for said in node.logged
    )


def test_before_a_goal_inside_a_wall_the_robot_waits_and_says_so(make_either):
    node = make_either(walls="4 -3 4 3")
    hear(node, "goal_pose", goal(3.95, 0.0))
    path = drive(node, (0.0, 5.0, 0.0, 0.0), 120)
    places = np.array([own[:2] for own, _ in path])
    nearest = np.column_stack([np.full(len(path), 4.0), places[:, 1].clip(-3.0, 3.0)])
    assert np.hypot(*(places - nearest).T).min() > 0.3, "no wall is touched"
    assert any("cannot be reached" in said for said in node.logged)


def test_a_goal_that_is_not_finite_is_dropped_with_an_error(make_either):
    node = make_either()
    hear(node, "odom", odometry(np.zeros(5)))
    hear(node, "people", people())
    hear(node, "goal_pose", goal(np.nan, 0.0))
    assert not tick(node).any()
    assert "the goal is dropped" in node.logged[-1]
    hear(node, "goal_pose", goal(2.0, 0.0))
    assert tick(node).any()


def test_the_costmap_lies_where_the_people_are(make):
    node = make()
    hear(node, "goal_pose", goal(*GOAL))
    hear(node, "odom", odometry(np.array([20.3, -7.1, 0.0, 0.0, 0.0])))
    hear(node, "people", people(("anna", (21.55, -6.05, 0.5, 0.0))))
    tick(node)
    (grid,) = node.published["social_costmap"]
    assert (grid.header.frame_id, grid.info.width, grid.info.height) == ("odom", 80, 80)
    assert grid.header.stamp == node.people_stamp
    corner = grid.info.origin.position
    costs = np.reshape(grid.data, (80, 80))
    assert costs.max() == 100
    row, column = np.argwhere(costs == 100).mean(axis=0)
    assert corner.x + 0.1 * (column + 0.5) == pytest.approx(21.55, abs=0.05)
    assert corner.y + 0.1 * (row + 0.5) == pytest.approx(-6.05, abs=0.05)
    assert all(type(cost) is int for cost in grid.data)


def test_a_missing_zone_parameter_is_named_in_the_error(make):
    with pytest.raises(szlib.ZoneError, match="parameter `zone`"):
        make(zone="")


def test_a_zone_that_does_not_exist_is_refused(make_either):
    with pytest.raises(szlib.ZoneError, match=r"nowhere\.json"):
        make_either(zone="nowhere.json")


def test_the_short_node_stands_still_when_a_number_of_its_odometry_is_not_finite(
    make_short,
):
    node = make_short()
    hear(node, "people", people())
    hear(node, "goal_pose", goal(*GOAL))
    hear(node, "odom", odometry(np.array([0.0, np.nan, 0.0, 0.0, 0.0])))
    assert not tick(node).any()
    assert "the goal is dropped: state must be finite" in node.logged[-1]


def test_a_map_gives_walls_in_the_frame_of_the_walls(make_with_tf, monkeypatch):
    turned = ros.xyz(w=float(np.cos(np.pi / 4)))
    turned.z = float(np.sin(np.pi / 4))
    monkeypatch.setattr(ros.Buffer, "poses", {"map": (10.0, 0.0, turned)})
    node = make_with_tf(walls="4 -3 4 3")
    cells = np.zeros((8, 10), int)
    # a block, an unknown cell, and one below 65 %
    cells[2:4, 1:5], cells[6, 6], cells[7, 7] = (100, -1, 40)
    hear(node, "map", grid(cells, 0.5, (1.0, 2.0, 0.0), frame="map"))
    walls = node.drive.walls
    assert walls.shape == (5, 2, 2)
    block = walls[:4]
    assert [*block.min(axis=(0, 1)), *block.max(axis=(0, 1))] == pytest.approx(
        [6.0, 1.5, 7.0, 3.5]
    )
    assert not node.drive.step((6.5, 2.5, 0.0), (9.0, 9.0)).safe


def test_a_map_that_cannot_be_used_changes_nothing(make):
    node = make(walls="4 -3 4 3")
    short, still = (
        grid(np.zeros((4, 4), int), 0.5, (0, 0, 0)),
        grid(np.zeros((4, 4), int), 0.0, (0, 0, 0)),
    )
    short.data = short.data[:-1]
    for bad in (
        short,
        still,
        grid(np.zeros((4, 4), int), 0.5, (0, 0, 0), frame="elsewhere"),
    ):
        hear(node, "map", bad)
        assert node.drive.walls.shape == (1, 2, 2)
    assert (
        len(node.logged) == 3
        and "cannot be used" in node.logged[0]
        and "resolution" in node.logged[1]
    )

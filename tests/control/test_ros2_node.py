"""The ROS 2 node of notebooks/examples, without ROS: stubs of rclpy and messages, a robot that obeys."""

import importlib.util
import sys
from copy import deepcopy
from math import cos, hypot, sin
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import szlib
from szlib.control.differential_drive import Unicycle
from szlib.control.distances import euclidean_to_ellipse
from szlib.zones.polar import DIRECTIONS, PolarZone

NODE = Path(__file__).parents[2] / "notebooks" / "examples" / "ros2_node.py"
ZONE = szlib.Ellipse((0.1, 0.0), (0.9, 0.7), 0.0)
GOAL = (5.0, 0.5)
pytestmark = pytest.mark.filterwarnings("ignore::szlib.errors.DataWarning")  # a zone of nobody's data


# --- ROS, as far as the node needs it -----------------------------------------------------------------


def message(**fields):
    """A class of messages whose fields begin with copies of these."""
    return type("Message", (SimpleNamespace,), {"__init__": lambda self: vars(self).update(deepcopy(fields))})


def xyz(**more):
    return SimpleNamespace(x=0.0, y=0.0, z=0.0, **more)


POSE = SimpleNamespace(position=xyz(), orientation=xyz(w=1.0))
HEADER = SimpleNamespace(frame_id="", stamp=SimpleNamespace(sec=0, nanosec=0))
Twist = message(linear=xyz(), angular=xyz())
Odometry = message(
    header=HEADER,
    pose=SimpleNamespace(pose=POSE),
    twist=SimpleNamespace(twist=SimpleNamespace(linear=xyz(), angular=xyz())),
)
PoseStamped = message(header=HEADER, pose=POSE)
Walker = message(name="", position=xyz(), velocity=xyz(), reliability=0.0, tagnames=[], tags=[])
People = message(header=HEADER, people=[])
OccupancyGrid = message(
    header=HEADER, info=SimpleNamespace(resolution=0.0, width=0, height=0, origin=POSE), data=[]
)


class Node:
    """The part of rclpy.node.Node that the example uses, with the same arguments."""

    given, now = {}, 1.75e9

    def __init__(self, node_name):
        self.subscribed, self.published, self.logged, self.every = {}, {}, [], {}

    def declare_parameter(self, name, value):
        self.logged += (
            [] if type(self.given.get(name, value)) is type(value) else [f"{name} has another type"]
        )

    def get_parameter(self, name):
        return SimpleNamespace(value=self.given.get(name, DEFAULTS()[name]))

    def create_subscription(self, msg_type, topic, callback, qos_profile):
        self.subscribed[topic] = (msg_type, callback)

    def create_publisher(self, msg_type, topic, qos_profile):
        def publish(what):
            assert type(what) is msg_type
            self.published.setdefault(topic, []).append(what)

        return SimpleNamespace(publish=publish)

    def create_timer(self, timer_period_sec, callback):
        self.every[timer_period_sec] = callback

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=round(Node.now * 1e9)))

    def get_logger(self):
        def say(text, throttle_duration_sec=0.0):
            self.logged.append(text)

        return SimpleNamespace(warning=say, error=say)


def DEFAULTS():
    return sys.modules["ros2_node"].DEFAULTS


@pytest.fixture
def make(monkeypatch, tmp_path):
    """A node with these parameters."""
    modules = {
        "rclpy": {"init": None, "spin": None, "try_shutdown": None},
        "rclpy.node": {"Node": Node},
        "rclpy.executors": {"ExternalShutdownException": RuntimeError},
        "geometry_msgs": {},
        "geometry_msgs.msg": {"Twist": Twist, "PoseStamped": PoseStamped},
        "nav_msgs": {},
        "nav_msgs.msg": {"Odometry": Odometry, "OccupancyGrid": OccupancyGrid},
        "people_msgs": {},
        "people_msgs.msg": {"People": People},
    }
    for name, contents in modules.items():
        module = ModuleType(name)
        vars(module).update(contents)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("ros2_node", NODE)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "ros2_node", module)
    spec.loader.exec_module(module)
    shape = PolarZone(np.array([1.1]), DIRECTIONS, np.ones((1, len(DIRECTIONS))))
    szlib.SocialZone(shape, 2.0, {1.1: ZONE}).save(tmp_path / "zone.json")

    def node(**parameters):
        monkeypatch.setattr(Node, "now", 1.75e9)
        monkeypatch.setattr(Node, "given", {"zone": str(tmp_path / "zone.json"), "v_max": 1.0} | parameters)
        return module.SocialDrive()

    return node


# --- a world with one robot ---------------------------------------------------------------------------


def stamped(what, frame="odom", late=0.0):
    when = Node.now - late
    what.header.frame_id, what.header.stamp.sec = frame, int(when)
    what.header.stamp.nanosec = round((when - int(when)) * 1e9)
    return what


def odometry(own, **how):
    at, what = own.tolist(), Odometry()
    what.pose.pose.position.x, what.pose.pose.position.y = at[:2]
    what.pose.pose.orientation.z, what.pose.pose.orientation.w = sin(at[2] / 2), cos(at[2] / 2)
    what.twist.twist.linear.x, what.twist.twist.angular.z = at[3:]
    return stamped(what, **how)


def people(*walkers, **how):
    what = People()
    for name, (x, y, vx, vy) in walkers:
        walker = Walker()
        walker.name, walker.position.x, walker.position.y = name, x, y
        walker.velocity.x, walker.velocity.y = vx, vy
        what.people.append(walker)
    return stamped(what, **how)


def goal(x, y, **how):
    what = PoseStamped()
    what.pose.position.x, what.pose.position.y = x, y
    return stamped(what, **how)


def hear(node, topic, what):
    msg_type, callback = node.subscribed[topic]
    assert type(what) is msg_type
    callback(what)


def tick(node):
    """The timer goes off; what is commanded."""
    ((period, callback),) = node.every.items()
    assert period == 0.1
    callback()
    twist = node.published["cmd_vel"][-1]
    assert vars(twist.linear) | {"x": 0.0} == vars(xyz())  # two wheels move ahead and turn, nothing else
    return np.array([twist.linear.x, twist.angular.z])


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


def test_the_robot_reaches_its_goal_past_a_person(make):
    node = make(walls="-1 3 7 3; -1 -3 7 -3")
    hear(node, "goal_pose", goal(*GOAL))
    walker = (4.0, 0.2, -0.4, 0.0)
    path = drive(node, walker, 150)
    assert node.logged == []
    assert hypot(path[-1][0][0] - GOAL[0], path[-1][0][1] - GOAL[1]) < 0.1
    assert np.abs(path[-1][1]).max() < 0.05
    for k, (own, _) in enumerate(path):
        offset = own[:2] - np.array(walker[:2]) - 0.1 * k * np.array(walker[2:])
        assert euclidean_to_ellipse(offset, ZONE.placed((0.0, 0.0), np.pi)) >= 0.3 + 0.05 - 1e-6


@pytest.mark.parametrize("topic", ["odom", "people"])
def test_the_robot_stops_when_a_topic_falls_silent(make, topic):
    node = make()
    hear(node, "goal_pose", goal(*GOAL))
    path = drive(node, (4.0, 2.5, 0.0, 0.0), 60, silent=(topic,))
    commands = np.array([command for _, command in path])
    assert np.abs(commands[25:30, 0]).min() > 0.3  # it was on its way
    assert not commands[36:].any()  # 0.5 s after the last message, and a step
    assert {"odom": "no recent odometry", "people": "no recent people"}[topic] in node.logged[-1]
    last = path[-1][0]
    hear(node, "odom", odometry(last))
    hear(node, "people", people())
    again = tick(node)
    assert again.any()  # as soon as all is there again, and from rest
    assert abs(again[0]) <= 2 * 0.1


def test_the_robot_waits_for_odometry_people_and_goal(make):
    node = make()
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


def test_the_robot_stays_clear_of_people_whose_numbers_cannot_be_used(make):
    node = make()
    hear(node, "goal_pose", goal(*GOAL))
    hear(node, "odom", odometry(np.zeros(5)))
    hear(node, "people", people(("anna", (np.nan, 0.0, 0.0, 0.0))))
    assert np.abs(tick(node)).max() < 1e-3
    assert "1 unknown" in node.logged[-1]


def test_a_goal_inside_a_wall_is_dropped_with_an_error(make):
    node = make(walls="4 -3 4 3")
    hear(node, "odom", odometry(np.zeros(5)))
    hear(node, "people", people())
    hear(node, "goal_pose", goal(3.95, 0.0))
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
    assert grid.header.stamp == node.people.header.stamp
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

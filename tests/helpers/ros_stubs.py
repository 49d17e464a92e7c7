"""ROS 2, as far as the nodes of notebooks/examples need it: stubs of rclpy and of messages."""

import importlib
import sys
from contextlib import contextmanager
from copy import deepcopy
from math import cos, sin
from pathlib import Path
from types import ModuleType, SimpleNamespace
from unittest import mock

EXAMPLES = Path(__file__).parents[2] / "notebooks" / "examples"
START = 1.75e9


def message(**fields):
    """A class of messages whose fields begin with copies of these."""
    return type(
        "Message",
        (SimpleNamespace,),
        {"__init__": lambda self: vars(self).update(deepcopy(fields))},
    )


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
TwistStamped = message(
    header=HEADER, twist=SimpleNamespace(linear=xyz(), angular=xyz())
)
PoseStamped = message(header=HEADER, pose=POSE)
Walker = message(
    name="", position=xyz(), velocity=xyz(), reliability=0.0, tagnames=[], tags=[]
)
People = message(header=HEADER, people=[])
OccupancyGrid = message(
    header=HEADER,
    info=SimpleNamespace(resolution=0.0, width=0, height=0, origin=POSE),
    data=[],
)


class Node:
    """The part of rclpy.node.Node that the example uses, with the same arguments."""

    given, now = {}, START

    def __init__(self, node_name):
        self.subscribed, self.published, self.logged, self.every = {}, {}, [], {}

    def declare_parameter(self, name, value):
        self.logged += (
            []
            if type(self.given.get(name, value)) is type(value)
            else [f"{name} has another type"]
        )
        return SimpleNamespace(value=self.given.get(name, value))

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
        now = SimpleNamespace(
            nanoseconds=round(Node.now * 1e9), to_msg=lambda: stamp_of(Node.now)
        )
        return SimpleNamespace(now=lambda: now)

    def get_logger(self):
        def say(text, throttle_duration_sec=0.0):
            self.logged.append(text)

        return SimpleNamespace(warning=say, error=say)


class TransformError(Exception):
    """tf2_ros.TransformException."""


class Buffer:
    """The part of tf2_ros.Buffer that the example uses: `poses` are (x, y, quaternion) by frame."""

    poses = None

    def lookup_transform(self, target_frame, source_frame, time):
        if source_frame not in self.poses:
            raise TransformError(f"{source_frame} does not exist")
        x, y, rotation = self.poses[source_frame]
        return SimpleNamespace(
            transform=SimpleNamespace(
                translation=SimpleNamespace(x=x, y=y, z=0.0), rotation=rotation
            )
        )


@contextmanager
def node_module(node_name, tf=False):
    """The module of a node, which finds these stubs in place of ROS, with TF or without it."""
    contents = {
        "rclpy": {"init": None, "spin": None, "try_shutdown": None},
        "rclpy.node": {"Node": Node},
        "rclpy.executors": {"ExternalShutdownException": RuntimeError},
        "rclpy.qos": {
            "QoSProfile": SimpleNamespace,
            "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL=1),
        },
        "rclpy.time": {"Time": SimpleNamespace(from_msg=time_of)},
        "geometry_msgs": {},
        "geometry_msgs.msg": {
            "Twist": Twist,
            "TwistStamped": TwistStamped,
            "PoseStamped": PoseStamped,
        },
        "nav_msgs": {},
        "nav_msgs.msg": {"Odometry": Odometry, "OccupancyGrid": OccupancyGrid},
        "people_msgs": {},
        "people_msgs.msg": {"People": People},
    }
    if tf:
        listener = lambda buffer, node: (buffer, node)  # noqa: E731
        contents["tf2_ros"] = {
            "Buffer": Buffer, "TransformListener": listener, "TransformException": TransformError
        }  # fmt: skip
    modules = {name: ModuleType(name) for name in contents}
    for name, content in contents.items():
        vars(modules[name]).update(content)
    path = [str(EXAMPLES), *sys.path]
    with (
        mock.patch.dict(sys.modules, modules),
        mock.patch.multiple(Node, given={}, now=START),
        mock.patch.object(sys, "path", path),
    ):
        yield importlib.import_module(node_name)


def time_of(stamp):
    return SimpleNamespace(nanoseconds=stamp.sec * 10**9 + stamp.nanosec)


def stamp_of(when):
    return SimpleNamespace(sec=int(when), nanosec=round((when - int(when)) * 1e9))


def stamped(what, frame="odom", late=0.0):
    what.header.frame_id, what.header.stamp = frame, stamp_of(Node.now - late)
    return what


def odometry(own, **how):
    at, what = own.tolist(), Odometry()
    what.pose.pose.position.x, what.pose.pose.position.y = at[:2]
    what.pose.pose.orientation.z, what.pose.pose.orientation.w = (
        sin(at[2] / 2),
        cos(at[2] / 2),
    )
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


def grid(cells, side, origin, **how):
    what = OccupancyGrid()
    (what.info.height, what.info.width), what.info.resolution = cells.shape, side
    what.info.origin.position.x, what.info.origin.position.y, angle = origin
    what.info.origin.orientation.z, what.info.origin.orientation.w = (
        sin(angle / 2),
        cos(angle / 2),
    )
    what.data = cells.ravel().tolist()
    return stamped(what, **how)


def goal(x, y, **how):
    what = PoseStamped()
    what.pose.position.x, what.pose.position.y = x, y
    return stamped(what, **how)


def hear(node, topic, what):
    """Deliver a message."""
    msg_type, callback = node.subscribed[topic]
    assert type(what) is msg_type
    callback(what)


def tick(node):
    """Let the timer go off, and return what is commanded, (v, omega)."""
    ((_, callback),) = node.every.items()
    callback()
    twist = node.published["cmd_vel"][-1]
    # two wheels move ahead and turn, nothing else
    assert vars(twist.linear) | {"x": 0.0} == vars(xyz())
    return twist.linear.x, twist.angular.z

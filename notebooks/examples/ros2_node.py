"""A ROS 2 node around szlib's robot with two wheels: glue to copy, in one file.

    python ros2_node.py --ros-args -p zone:=results/atc-1hz/zone.json -p walls:="4 -3 4 3; 0 2 6 2"

subscribes  odom                 nav_msgs/Odometry            where the robot is, and its (v, omega)
            people               people_msgs/People           tracked people: name, position, velocity
            goal_pose            geometry_msgs/PoseStamped    where to; its orientation is not used
publishes   cmd_vel              geometry_msgs/Twist          (v, omega), every dt
            social_costmap       nav_msgs/OccupancyGrid       the zones around people, 0 to 100

Parameters: `zone`, a file that `SocialZone.save` wrote; `walls`, "x1 y1 x2 y2; ..." [m]; `frame`, the one
frame of all messages and of the walls: what comes in another is not used, and said; of the robot `r_robot`
[m], `v_max` [m/s], `omega_max` [rad/s], `ahead` [m] (0: what `DifferentialDrive` takes); `max_people` to
build for at the start; `timeout` [s]; `costmap_size` and `costmap_resolution` [m].

Watchdog: the node commands zero velocity, every dt, unless it has a goal, and odometry and people no older
than `timeout` by their own stamps. Silence about people does not mean that nobody is there: a tracker that
sees nobody has to publish an empty list. If this node itself dies, only the base can stop the robot: its
driver must do so when cmd_vel falls silent.

Tested without ROS by tests/control/test_ros2_node.py.
"""

from math import atan2

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from people_msgs.msg import People
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

import szlib

DEFAULTS = {
    "zone": "",
    "walls": "",
    "frame": "odom",
    "r_robot": 0.3,
    "v_max": 0.8,
    "omega_max": 4.0,
    "ahead": 0.0,
    "max_people": 10,
    "timeout": 0.5,
    "costmap_size": 8.0,
    "costmap_resolution": 0.1,
}


class SocialDrive(Node):
    """Drives to the last goal it was given, out of people's zones; see the top of this file."""

    def __init__(self):
        super().__init__("social_drive")
        for name, value in DEFAULTS.items():
            self.declare_parameter(name, value)
            setattr(self, name, self.get_parameter(name).value)
        if not self.zone:
            raise szlib.ZoneError("the parameter `zone` must name a file of SocialZone.save; got ''")
        self.zone_around, walls = szlib.SocialZone.load(self.zone), self.walls.split(";")
        self.drive = szlib.DifferentialDrive(
            self.zone_around,
            walls=[np.reshape(wall.split(), (2, 2)).astype(float) for wall in walls if wall.strip()],
            settings=szlib.MPCSettings(r_robot=self.r_robot, v_max=self.v_max),
            omega_max=self.omega_max,
            ahead=self.ahead or None,
            max_people=self.max_people,
        )
        self.odometry = self.people = self.goal = None
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.create_subscription(People, "people", self.on_people, 10)
        self.create_subscription(PoseStamped, "goal_pose", self.on_goal, 10)
        self.command = self.create_publisher(Twist, "cmd_vel", 10)
        self.costmap = self.create_publisher(OccupancyGrid, "social_costmap", 1)
        self.create_timer(self.drive.settings.dt, self.on_timer)

    def on_odometry(self, message):
        """Keep where the robot was, and when; numbers that are not finite are no odometry."""
        own = pose_and_speeds(message)
        if not np.isfinite(own).all():
            self.say(f"odom is not finite: {own.tolist()}: not used")
        elif self.usable(message, "odom"):
            self.odometry, self.own = message, own

    def on_people(self, message):
        """Keep who was seen, and when."""
        if self.usable(message, "people"):
            self.people = message

    def on_goal(self, message):
        """From now on, there."""
        if self.usable(message, "goal_pose"):
            self.goal = (message.pose.position.x, message.pose.position.y)

    def usable(self, message, topic):
        """True if the message is in the frame that everything is in."""
        if message.header.frame_id != self.frame:
            self.say(f"{topic} is in the frame {message.header.frame_id!r}, not in {self.frame!r}: not used")
        return message.header.frame_id == self.frame

    def say(self, text):
        """A warning, at most one a second."""
        self.get_logger().warning(text, throttle_duration_sec=1.0)

    def on_timer(self):
        """Command (v, omega), or zero."""
        now = self.get_clock().now().nanoseconds * 1e-9
        missing = [topic for topic in ("odometry", "people") if not self.recent(getattr(self, topic), now)]
        if missing:
            self.say(f"no recent {' and '.join(missing)}: the robot stops")
        if missing or self.goal is None:
            self.command.publish(Twist())
            return
        try:
            people, how = self.seen(now)
            step = self.drive.step(self.state(now), self.goal, people, **how)
        except szlib.SolverError as error:
            self.get_logger().error(f"the goal is given up: {error}")
            self.goal = None
            self.command.publish(Twist())
            return
        if not step.safe:
            least = min(step.h, default=np.inf)
            self.say(f"not safe: {step.fallback}, h = {least:.2f} m, {step.point.unknown} lost")
        twist = Twist()
        twist.linear.x, twist.angular.z = step.control.tolist()
        self.command.publish(twist)
        self.costmap.publish(self.layer(step.point.scene.people))

    def recent(self, message, now):
        """True if there is a message, no older than the timeout."""
        return message is not None and abs(now - seconds(message.header.stamp)) <= self.timeout

    def state(self, now):
        """(x, y, theta, v, omega) by now, from the last odometry."""
        return self.drive.robot.advance(self.own, self.own[3:], now - seconds(self.odometry.header.stamp))

    def seen(self, now):
        """People as an array (n, 4), and as keywords of `step` their names and when they were seen."""
        rows = [(p.position.x, p.position.y, p.velocity.x, p.velocity.y) for p in self.people.people]
        return np.reshape(np.array(rows, float), (-1, 4)), {
            "ids": [p.name or None for p in self.people.people],
            "stamps": seconds(self.people.header.stamp),
            "now": now,
        }

    def layer(self, people):
        """The zones around people, in a square around the robot."""
        side, cells = self.costmap_resolution, round(self.costmap_size / self.costmap_resolution)
        corner = [side * round(c / side) - side * (cells // 2) for c in self.own[:2].tolist()]
        costs = szlib.draw_costmap(self.zone_around, people, szlib.Grid(corner, side, (cells, cells)))
        message = OccupancyGrid()
        message.header.frame_id, message.header.stamp = self.frame, self.people.header.stamp
        message.info.resolution, message.info.width, message.info.height = side, cells, cells
        message.info.origin.position.x, message.info.origin.position.y = corner
        message.info.origin.orientation.w = 1.0
        message.data = costs.ravel().tolist()
        return message


def pose_and_speeds(odometry):
    """(x, y, theta, v, omega) of a robot on the plane, shape (5,)."""
    at, q = odometry.pose.pose.position, odometry.pose.pose.orientation
    theta = atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))
    return np.array([at.x, at.y, theta, odometry.twist.twist.linear.x, odometry.twist.twist.angular.z])


def seconds(stamp):
    """A builtin_interfaces/Time in seconds."""
    return stamp.sec + 1e-9 * stamp.nanosec


def main():
    """Run until interrupted."""
    rclpy.init()
    try:
        rclpy.spin(SocialDrive())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()

"""A ROS 2 node for szlib's robot with two wheels, in one file to copy.

    python ros2_node.py --ros-args -p zone:=results/atc-1hz/zone.json -p walls:="4 -3 4 3; 0 2 6 2"

subscribes  odom                 nav_msgs/Odometry            where the robot is, and its (v, omega)
            people               people_msgs/People           tracked people: name, position, velocity
            goal_pose            geometry_msgs/PoseStamped    the goal; its orientation is not used
            map                  nav_msgs/OccupancyGrid       more walls, around what is occupied
publishes   cmd_vel              geometry_msgs/Twist          (v, omega), every dt; TwistStamped if `stamped`
            social_costmap       nav_msgs/OccupancyGrid       the zones around people, 0 to 100

Parameters: `zone`, a file that `SocialZone.save` wrote; `walls`, "x1 y1 x2 y2; ..." [m]; `frame`, the frame
of the walls, into which all messages are brought by TF (messages in another frame are ignored with a warning
where TF does not know it at their time, or is not installed; velocities are only turned, so the frame of
people should stand still); `stamped`, True for a base that wants TwistStamped; of the robot `r_robot` [m],
`v_max` [m/s], `omega_max` [rad/s], `ahead` [m] (0: the default of `DifferentialDrive`); `max_people`, the
number to prepare for; `timeout` [s]; `costmap_size` and `costmap_resolution` [m].

Watchdog: the node commands zero velocity, every dt, unless it has a goal, and odometry and people no older
than `timeout` by their own stamps. Silence about people does not mean that nobody is there: a tracker that
sees nobody has to publish an empty list. If this node itself dies, only the base can stop the robot: its
driver must do so when cmd_vel falls silent.

Tested without ROS by tests/control/test_ros2_node.py.
"""

from math import atan2, nan

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from people_msgs.msg import People
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time

import szlib

try:
    import tf2_ros
except ImportError:
    tf2_ros = None

DEFAULTS = {
    "zone": "",
    "walls": "",
    "frame": "odom",
    "stamped": False,
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
    """Drives to the last goal received, outside people's zones; see the top of this file."""

    def __init__(self):
        super().__init__("social_drive")
        for name, value in DEFAULTS.items():
            self.declare_parameter(name, value)
            setattr(self, name, self.get_parameter(name).value)
        if not self.zone:
            raise szlib.ZoneError("the parameter `zone` must name a file of SocialZone.save; got ''")
        self.zone_around, walls = szlib.SocialZone.load(self.zone), self.walls.split(";")
        self.own_walls = [np.reshape(w.split(), (2, 2)).astype(float) for w in walls if w.strip()]
        self.drive = szlib.DifferentialDrive(
            self.zone_around,
            walls=self.own_walls,
            settings=szlib.MPCSettings(r_robot=self.r_robot, v_max=self.v_max, lookahead=4.0),
            omega_max=self.omega_max,
            ahead=self.ahead or None,
            max_people=self.max_people,
        )
        self.odometry = self.people = self.goal = None
        self.transforms = tf2_ros and tf2_ros.Buffer()
        self.listener = tf2_ros and tf2_ros.TransformListener(self.transforms, self)
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.create_subscription(People, "people", self.on_people, 10)
        self.create_subscription(PoseStamped, "goal_pose", self.on_goal, 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(OccupancyGrid, "map", self.on_map, latched)
        self.command = self.create_publisher(TwistStamped if self.stamped else Twist, "cmd_vel", 10)
        self.costmap = self.create_publisher(OccupancyGrid, "social_costmap", 1)
        self.create_timer(self.drive.settings.dt, self.on_timer)

    def on_odometry(self, message):
        """Store the odometry, unless a number is not finite."""
        own = pose_and_speeds(message)
        if not np.isfinite(own).all():
            self.warn(f"odom is not finite, or its quaternion is no rotation: {own.tolist()}; it is ignored")
        elif (frame := self.find_frame(message, "odom")) is not None:
            own[:2], own[2] = frame[:2] + turn(own[:2], frame[2]), own[2] + frame[2]
            self.odometry, self.own = message, own

    def on_people(self, message):
        """Store the people who were seen."""
        frame = self.find_frame(message, "people")
        if frame is not None:
            self.people, self.people_frame = message, frame

    def on_goal(self, message):
        """Replace the goal."""
        frame = self.find_frame(message, "goal_pose")
        if frame is not None:
            at = turn(np.array([message.pose.position.x, message.pose.position.y]), frame[2])
            self.goal = tuple((frame[:2] + at).tolist())

    def on_map(self, message):
        """Take the outlines of cells that are occupied, by 65 % or more, as walls beside those of `walls`."""
        message.header.stamp.sec = message.header.stamp.nanosec = 0  # where the map is now
        frame, info = self.find_frame(message, "map"), message.info
        if frame is None:
            return
        try:
            cells = np.reshape(np.array(message.data), (info.height, info.width)) >= 65
            at = frame[:2] + turn(np.array([info.origin.position.x, info.origin.position.y]), frame[2])
            origin = (*at.tolist(), yaw(info.origin.orientation) + frame[2])
            walls = szlib.control.walls_from_grid(cells, info.resolution, origin)
            self.drive.set_walls([walls, self.own_walls])
        except (ValueError, szlib.SolverError) as error:
            self.warn(f"map cannot be used: {error}; it is ignored")

    def find_frame(self, message, topic):
        """(x, y, angle) of the message's frame in the frame of the walls; None and a warning if unknown."""
        name, why = message.header.frame_id, "there is no TF"
        if name == self.frame:
            return np.zeros(3)
        if tf2_ros:
            try:
                when = Time.from_msg(message.header.stamp)
                found = self.transforms.lookup_transform(self.frame, name, when).transform
                at = np.array([found.translation.x, found.translation.y, yaw(found.rotation)])
                if np.isfinite(at).all():
                    return at
                why = "its transform is no rotation"
            except tf2_ros.TransformException as error:
                why = str(error)
        self.warn(f"{topic} is in the frame {name!r}, not in {self.frame!r}, and {why}; it is ignored")
        return None

    def warn(self, text):
        """Log a warning, at most one a second."""
        self.get_logger().warning(text, throttle_duration_sec=1.0)

    def on_timer(self):
        """Publish (v, omega), or zero, and the costmap."""
        now = self.get_clock().now().nanoseconds * 1e-9
        missing = [topic for topic in ("odometry", "people") if not self.is_recent(getattr(self, topic), now)]
        if missing:
            self.warn(f"no recent {' and '.join(missing)}: the robot stops")
        if missing or self.goal is None:
            self.drive_at(0.0, 0.0)
            return
        try:
            people, options = self.read_people(now)
            step = self.drive.step(self.predict_state(now), self.goal, people, **options)
        except szlib.SolverError as error:
            self.get_logger().error(f"the goal is dropped: {error}")
            self.goal = None
            self.drive_at(0.0, 0.0)
            return
        if not step.safe:
            min_h = min(step.h, default=np.inf)
            self.warn(f"not safe: {step.fallback}, h = {min_h:.2f} m, {step.point.unknown} unknown")
        if step.stuck or step.clock:
            self.warn(step.explain())
        self.drive_at(*step.control.tolist())
        self.costmap.publish(self.draw_costmap(step.point.scene.people))

    def drive_at(self, v, omega):
        """Publish a command."""
        message = TwistStamped() if self.stamped else Twist()
        twist = message.twist if self.stamped else message
        twist.linear.x, twist.angular.z = v, omega
        if self.stamped:
            message.header.stamp = self.get_clock().now().to_msg()
        self.command.publish(message)

    def is_recent(self, message, now):
        """True if there is a message no older than the timeout."""
        return message is not None and abs(now - to_seconds(message.header.stamp)) <= self.timeout

    def predict_state(self, now):
        """(x, y, theta, v, omega) now, predicted from the last odometry."""
        return self.drive.robot.advance(self.own, self.own[3:], now - to_seconds(self.odometry.header.stamp))

    def read_people(self, now):
        """People as an array, shape (n, 4), and the other arguments of `step`: ids, stamps and time."""
        rows = [(p.position.x, p.position.y, p.velocity.x, p.velocity.y) for p in self.people.people]
        rows, (x, y, angle) = np.reshape(np.array(rows, float), (-1, 4)), self.people_frame
        rows = np.hstack([np.add(turn(rows[:, :2], angle), (x, y)), turn(rows[:, 2:], angle)])
        return rows, {
            "ids": [p.name or None for p in self.people.people],
            "stamps": to_seconds(self.people.header.stamp),
            "now": now,
        }

    def draw_costmap(self, people):
        """The costmap of people's zones, in a square around the robot."""
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
    at, speeds = odometry.pose.pose.position, odometry.twist.twist
    theta = yaw(odometry.pose.pose.orientation)
    return np.array([at.x, at.y, theta, speeds.linear.x, speeds.angular.z])


def yaw(q):
    """Angle of a rotation on the plane [rad]; NaN if the quaternion `q` has not the norm 1."""
    is_rotation = abs(q.x**2 + q.y**2 + q.z**2 + q.w**2 - 1) < 0.01
    return atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2)) if is_rotation else nan


def turn(points, angle):
    """Points, shape (..., 2), turned by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    with np.errstate(all="ignore"):  # infinite numbers stay unusable
        return points @ np.array([[c, s], [-s, c]])


def to_seconds(stamp):
    """Convert a builtin_interfaces/Time to seconds."""
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

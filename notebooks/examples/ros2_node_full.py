"""The node of ros2_node.py with TF, the map, a costmap, stamped commands, and checks of every message.

    python ros2_node_full.py --ros-args -p zone:=results/atc-1hz/zone.json -p walls:="4 -3 4 3; 0 2 6 2"

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
`v_max` [m/s], `omega_max` [rad/s], `ahead` [m] (0: the default of `DifferentialDrive`); `timeout` [s];
`costmap_size` and `costmap_resolution` [m].

Watchdog: the node commands zero velocity, every dt, unless it has a goal, and odometry and people no older
than `timeout` by their own stamps. Silence about people does not mean that nobody is there: a tracker that
sees nobody has to publish an empty list. If this node itself dies, only the base can stop the robot: its
driver must do so when cmd_vel falls silent.

Copy ros2_node.py and costmaps.py as well. All are tested without ROS by tests/control/test_ros2_node.py.
"""

from math import atan2, nan

import numpy as np
import rclpy
import ros2_node
from costmaps import Grid, draw_costmap
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time

import szlib

try:
    import tf2_ros
except ImportError:
    tf2_ros = None

DEFAULTS = ros2_node.DEFAULTS | {
    "frame": "odom",
    "stamped": False,
    "omega_max": 4.0,
    "ahead": 0.0,
    "costmap_size": 8.0,
    "costmap_resolution": 0.1,
}


class FullSocialDrive(ros2_node.SocialDrive):
    """Drives to the last goal received, outside people's zones; see the top of this file."""

    def __init__(self):
        try:
            super().__init__(DEFAULTS)
        except szlib.ZoneError as error:
            raise szlib.ZoneError(
                f"the parameter `zone` must name a file of SocialZone.save: {error}"
            ) from error
        self.drive = szlib.DifferentialDrive(
            self.zone_around,
            walls=self.own_walls,
            settings=self.drive.settings,
            omega_max=self.omega_max,
            ahead=self.ahead or None,
        )
        self.transforms = tf2_ros and tf2_ros.Buffer()
        self.listener = tf2_ros and tf2_ros.TransformListener(self.transforms, self)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(OccupancyGrid, "map", self.on_map, latched)
        self.costmap = self.create_publisher(OccupancyGrid, "social_costmap", 1)

    @property
    def command_type(self):
        """The type of cmd_vel."""
        return TwistStamped if self.stamped else Twist

    def on_odometry(self, message):
        """Store the odometry in the frame of the walls, unless a number is not finite."""
        at, speed = message.pose.pose.position, message.twist.twist
        own = [at.x, at.y, yaw(message.pose.pose.orientation), speed.linear.x, speed.angular.z]
        if not np.isfinite(own).all():
            self.warn(f"odom is not finite, or its quaternion is no rotation: {own}; it is ignored")
        elif (frame := self.find_frame(message, "odom")) is not None:
            super().on_odometry(message)
            self.own[:2], self.own[2] = frame[:2] + turn(self.own[:2], frame[2]), own[2] + frame[2]

    def on_people(self, message):
        """Store the people who were seen, in the frame of the walls."""
        if (frame := self.find_frame(message, "people")) is not None:
            super().on_people(message)
            where, velocities = turn(self.people[:, :2], frame[2]), turn(self.people[:, 2:], frame[2])
            self.people, self.people_stamp = np.hstack([frame[:2] + where, velocities]), message.header.stamp

    def on_goal(self, message):
        """Replace the goal."""
        if (frame := self.find_frame(message, "goal_pose")) is not None:
            super().on_goal(message)
            self.goal = tuple((frame[:2] + turn(np.array(self.goal), frame[2])).tolist())

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

    def on_timer(self):
        """Publish (v, omega), or zero, and the costmap."""
        step = super().on_timer()
        if step:
            self.costmap.publish(self.draw_costmap(step.scene.people))
        return step

    def publish(self, v, omega):
        """Publish a command."""
        if not self.stamped:
            super().publish(v, omega)
            return
        message = TwistStamped()
        message.twist.linear.x, message.twist.angular.z = v, omega
        message.header.stamp = self.get_clock().now().to_msg()
        self.publisher.publish(message)

    def draw_costmap(self, people):
        """The costmap of people's zones, in a square around the robot."""
        side, cells = self.costmap_resolution, round(self.costmap_size / self.costmap_resolution)
        corner = [side * round(c / side) - side * (cells // 2) for c in self.own[:2].tolist()]
        costs = draw_costmap(self.zone_around, people, Grid(corner, side, (cells, cells)))
        message = OccupancyGrid()
        message.header.frame_id, message.header.stamp = self.frame, self.people_stamp
        message.info.resolution, message.info.width, message.info.height = side, cells, cells
        message.info.origin.position.x, message.info.origin.position.y = corner
        message.info.origin.orientation.w = 1.0
        message.data = costs.ravel().tolist()
        return message


def yaw(q):
    """Angle of a rotation on the plane [rad]; NaN if the quaternion `q` has not the norm 1."""
    is_rotation = abs(q.x**2 + q.y**2 + q.z**2 + q.w**2 - 1) < 0.01
    return atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2)) if is_rotation else nan


def turn(points, angle):
    """Points, shape (..., 2), turned by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    with np.errstate(all="ignore"):  # infinite numbers stay unusable
        return points @ np.array([[c, s], [-s, c]])


def main():
    """Run until interrupted."""
    rclpy.init()
    try:
        rclpy.spin(FullSocialDrive())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()

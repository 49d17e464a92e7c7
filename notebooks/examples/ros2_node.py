"""A ROS 2 node for a robot with two wheels: `python ros2_node.py --ros-args -p zone:=zone.json`.

All messages are in one frame, as are `walls`, "x1 y1 x2 y2; ..." [m]. The robot stops unless it has a goal, and
odometry and people no older than `timeout` [s]: a tracker that sees nobody has to publish an empty list. The base
has to stop by itself when cmd_vel falls silent. ros2_node_full.py adds TF, the map, a costmap, and more checks.
"""

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, Twist
from nav_msgs.msg import Odometry
from people_msgs.msg import People
from rclpy.node import Node
from rclpy.time import Time

import szlib

DEFAULTS = {"zone": "", "walls": "", "timeout": 0.5, "r_robot": 0.3, "v_max": 0.8}


class SocialDrive(Node):
    command_type = Twist

    def __init__(self, defaults=DEFAULTS):
        super().__init__("social_drive")
        for name, value in defaults.items():
            setattr(self, name, self.declare_parameter(name, value).value)
        self.zone_around, walls = szlib.SocialZone.load(self.zone), self.walls.split(";")
        self.own_walls = [np.reshape(w.split(), (2, 2)).astype(float) for w in walls if w.strip()]
        settings = szlib.MPCSettings.among_people(r_robot=self.r_robot, v_max=self.v_max)
        self.drive = szlib.DifferentialDrive(self.zone_around, walls=self.own_walls, settings=settings)
        self.goal, self.stamps = None, {"odometry": -np.inf, "people": -np.inf}
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.create_subscription(People, "people", self.on_people, 10)
        self.create_subscription(PoseStamped, "goal_pose", self.on_goal, 10)
        self.publisher = self.create_publisher(self.command_type, "cmd_vel", 10)
        self.create_timer(settings.dt, self.on_timer)

    def on_odometry(self, message):
        at, q, speed = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
        self.own = np.array([at.x, at.y, 2 * np.arctan2(q.z, q.w), speed.linear.x, speed.angular.z])
        self.stamps["odometry"] = Time.from_msg(message.header.stamp).nanoseconds * 1e-9

    def on_people(self, message):
        rows = [(p.position.x, p.position.y, p.velocity.x, p.velocity.y) for p in message.people]
        self.people, self.names = np.reshape(rows, (-1, 4)), [p.name or None for p in message.people]
        self.stamps["people"] = Time.from_msg(message.header.stamp).nanoseconds * 1e-9

    def on_goal(self, message):
        self.goal = (message.pose.position.x, message.pose.position.y)

    def on_timer(self):
        now, when, step = self.get_clock().now().nanoseconds * 1e-9, self.stamps["people"], None
        old = [name for name, stamp in self.stamps.items() if not abs(now - stamp) <= self.timeout]
        if old:
            self.warn(f"no recent {' and '.join(old)}: the robot stops")
        elif self.goal is not None:
            own = self.drive.robot.advance(self.own, self.own[3:], now - self.stamps["odometry"])
            try:
                step = self.drive.step(own, self.goal, self.people, ids=self.names, stamps=when, now=now)
            except szlib.SolverError as error:
                self.goal = None
                self.get_logger().error(f"the goal is dropped: {error}")
        if step and (not step.safe or step.scene.goal_blocked or step.stuck or step.clock):
            self.warn(step.explain())
        self.publish(*(step.control.tolist() if step else (0.0, 0.0)))
        return step

    def publish(self, v, omega):
        twist = Twist()
        twist.linear.x, twist.angular.z = v, omega
        self.publisher.publish(twist)

    def warn(self, text):
        self.get_logger().warning(text, throttle_duration_sec=1.0)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(SocialDrive())

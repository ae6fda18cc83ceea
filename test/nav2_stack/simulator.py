"""The robot in the graph: odometry, transforms and a laser, from velocity commands and a map."""

import math
import random
import threading
import time

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped, Twist
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.writing import grid_to_message, quaternion_of
from llm_astar_planner.nodes.common.entities import LATCHED
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from nav2_stack.world import BEAMS, NEAR, RANGE, SILENCE, off_by

# Steps a second, and steps from scan to scan.
HZ, SCAN_EVERY = 30, 3
# Steps from one move of the boxes that move to the next.
MOVE_EVERY = 6
# Of the localization: steps from one correction to the next, how much of its error that leaves,
# and radians that it is off for each metre.
CORRECT_EVERY, KEPT, TURNED = 15, 0.7, 1.0 / 3.0


class Simulator(Node):
    """Drives the robot of a `world.World`; `track` are its poses (x, y, yaw) since `place`.

    `noise` is the standard deviation of the error of the localization, in metres; its heading
    is off by a third of that, in radians. Twice a second it jumps to another one.
    """

    def __init__(self, world, noise=0.0):
        super().__init__('simulator')
        self.world, self._noise = world, noise
        self._chance = random.Random(1)  # noqa: S311
        self._error = self._map_to_odom = Pose2D(0.0, 0.0, 0.0)
        self._lock, self._steps = threading.Lock(), 0
        self._command, self._commanded = (0.0, 0.0), 0.0
        self.track, self.near, self.moving = [], 0.0, ()
        self._map = self.create_publisher(OccupancyGrid, 'map', LATCHED)
        self._tf = self.create_publisher(TFMessage, 'tf', 10)
        self._odom = self.create_publisher(Odometry, 'odom', 10)
        self._scan = self.create_publisher(LaserScan, 'scan', qos_profile_sensor_data)
        self.create_subscription(Twist, 'cmd_vel', self._on_command, 1)
        self._map.publish(grid_to_message(world.grid_map, self.now()))
        self._last = time.monotonic()
        self.create_timer(1.0 / HZ, self.step)

    def now(self):
        return self.get_clock().now().to_msg()

    def place(self, pose):
        """Put the robot there, and begin a new track."""
        with self._lock:
            self.world.robot.pose = pose
            self.world.robot.speed = self.world.robot.turn = 0.0
            self._command, self.world.bumps = (0.0, 0.0), 0
            self.track, self.near = [pose], 0.0

    def put(self, name, *boxes):
        with self._lock:
            self.world.put(name, *boxes)

    def _on_command(self, message):
        self._command = message.linear.x, message.angular.z
        self._commanded = time.monotonic()

    def step(self):
        """Drive on by the time that has passed, and publish what odometry and laser see."""
        now = time.monotonic()
        seconds, self._last = min(now - self._last, 0.2), now
        command = self._command if now - self._commanded < SILENCE else (0.0, 0.0)
        with self._lock:
            if self.moving and self._steps % MOVE_EVERY == 0:
                self.world.swing('boxes', self.moving, len(self.track) / HZ)
            self.world.step(*command, seconds)
            pose = self.world.robot.pose
            self.track.append(pose)
            if self.world.clearance(pose.x, pose.y) < NEAR:
                self.near += seconds
            scan = self.world.scan() if self._steps % SCAN_EVERY == 0 else None
        self._steps += 1
        self.publish(pose, scan)

    def publish(self, pose, scan):
        stamp = self.now()
        self._correct(pose)
        transforms = [
            transform('map', 'odom', self._map_to_odom, stamp),
            transform('odom', 'base_link', pose, stamp),
        ]
        self._tf.publish(TFMessage(transforms=transforms))
        odometry = Odometry(child_frame_id='base_link')
        odometry.header.stamp, odometry.header.frame_id = stamp, 'odom'
        place = odometry.pose.pose
        place.position.x, place.position.y = pose.x, pose.y
        place.orientation = quaternion_of(pose.yaw)
        odometry.twist.twist.linear.x = self.world.robot.speed
        odometry.twist.twist.angular.z = self.world.robot.turn
        self._odom.publish(odometry)
        if scan is not None:
            self._scan.publish(scan_message(scan, stamp))

    def _correct(self, pose):
        """Let map -> odom jump to another error about zero, as with each correction of AMCL."""
        if self._noise and self._steps % CORRECT_EVERY == 0:
            step = self._noise * math.sqrt(1.0 - KEPT**2)
            sizes = (step, step, step * TURNED)
            errors = (KEPT * e + self._chance.gauss(0.0, s) for e, s in zip(self._error, sizes))
            self._error = Pose2D(*errors)
            self._map_to_odom = off_by(self._error, pose)


def transform(parent, child, pose, stamp):
    message = TransformStamped(child_frame_id=child)
    message.header.stamp, message.header.frame_id = stamp, parent
    message.transform.translation.x = float(pose.x)
    message.transform.translation.y = float(pose.y)
    message.transform.rotation = quaternion_of(float(pose.yaw))
    return message


def scan_message(ranges, stamp: Time):
    message = LaserScan(range_min=0.05, range_max=RANGE, scan_time=SCAN_EVERY / HZ)
    message.header.stamp, message.header.frame_id = stamp, 'base_link'
    message.angle_min, message.angle_increment = -math.pi, 2.0 * math.pi / BEAMS
    message.angle_max = math.pi - message.angle_increment
    message.ranges = np.asarray(ranges, dtype=np.float32).tolist()
    return message

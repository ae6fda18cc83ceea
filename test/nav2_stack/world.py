"""A robot on a map: how it moves, what its laser sees, and how near it is to obstacles."""

import math
from dataclasses import dataclass, field

import numba
import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from scipy import ndimage

ROBOT_RADIUS = 0.22
# Within this distance, in metres from the robot's centre, an obstacle is near.
NEAR = 0.35
# Limits of the robot: m/s2 and rad/s2, and seconds without a command after which it stops.
ACCELERATION, TURN_ACCELERATION, SILENCE = 2.5, 3.2, 0.5
BEAMS, RANGE = 360, 8.0
# How boxes move: metres to both sides of their place, and seconds there and back; how far from
# the robot's centre they stop.
SWING, PERIOD, KEPT_OFF = 0.8, 8.0, 0.9
OCCUPIED = 65


@dataclass
class Robot:
    """A robot with two driven wheels, which follows commands as fast as its limits allow."""

    pose: Pose2D
    speed: float = 0.0
    turn: float = 0.0

    def moved(self, speed, turn, seconds):
        """Return the pose after a step towards these speeds: an arc of a circle."""
        self.speed = towards(self.speed, speed, ACCELERATION * seconds)
        self.turn = towards(self.turn, turn, TURN_ACCELERATION * seconds)
        x, y, yaw = self.pose
        angle = self.turn * seconds
        chord = self.speed * seconds * np.sinc(angle / (2.0 * math.pi))
        middle = yaw + angle / 2.0
        heading = math.remainder(yaw + angle, 2.0 * math.pi)
        return Pose2D(x + chord * math.cos(middle), y + chord * math.sin(middle), heading)


def towards(value, wanted, most):
    return value + min(max(wanted - value, -most), most)


def off_by(error, pose):
    """Return map -> odom for a robot at `pose` in odom that is localized off by `error` there."""
    cos, sin = math.cos(error.yaw), math.sin(error.yaw)
    x = pose.x + error.x - cos * pose.x + sin * pose.y
    y = pose.y + error.y - sin * pose.x - cos * pose.y
    return Pose2D(x, y, error.yaw)


@numba.njit(cache=True, fastmath=False)
def cast(walls, x, y, angles, longest):
    """Return the distance [n], in cells, to the first wall along each ray from (x, y)."""
    height, width = walls.shape
    ranges = np.full(angles.size, np.inf)
    for ray in range(angles.size):
        dx, dy = math.cos(angles[ray]), math.sin(angles[ray])
        column, row = math.floor(x), math.floor(y)
        step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        per_x = abs(1.0 / dx) if dx != 0.0 else math.inf
        per_y = abs(1.0 / dy) if dy != 0.0 else math.inf
        next_x = (column + (step_x > 0) - x) / dx if dx != 0.0 else math.inf
        next_y = (row + (step_y > 0) - y) / dy if dy != 0.0 else math.inf
        distance = 0.0
        while distance <= longest and 0 <= column < width and 0 <= row < height:
            if walls[row, column]:
                ranges[ray] = distance
                break
            if next_x < next_y:
                distance, column, next_x = next_x, column + step_x, next_x + per_x
            else:
                distance, row, next_y = next_y, row + step_y, next_y + per_y
    return ranges


@dataclass
class World:
    """The true map: that of the map file, and boxes (x, y, width, height), in metres."""

    grid_map: GridMap
    boxes: dict = field(default_factory=dict)

    def __post_init__(self):
        self.robot = Robot(Pose2D(0.0, 0.0, 0.0))
        self.bumps = 0
        self._resolution = self.grid_map.resolution
        self._build()

    def put(self, name, *boxes):
        """Put boxes there under a name, in the place of what that was before; none take away."""
        self.boxes[name] = boxes
        self._build()

    def swing(self, name, places, seconds):
        """Move boxes of a name about their `places`, to where they are after so many seconds.

        They go along x and y in turn, each at another time; one that the robot is near to waits.
        """
        moved, before = [], self.boxes.get(name) or places
        for number, (place, (x, y, width, height)) in enumerate(zip(places, before)):
            away = SWING * math.sin(2.0 * math.pi * seconds / PERIOD + number)
            dx, dy = (away, 0.0) if number % 2 else (0.0, away)
            box = (place[0] + dx, place[1] + dy, width, height)
            middle = box[0] + width / 2.0, box[1] + height / 2.0
            is_near = math.dist(middle, self.robot.pose[:2]) < KEPT_OFF
            moved.append((x, y, width, height) if is_near else box)
        self.put(name, *moved)

    def _build(self):
        walls = self.grid_map.cells >= OCCUPIED
        for x, y, width, height in (box for boxes in self.boxes.values() for box in boxes):
            corners = np.array([self.cell(x, y), self.cell(x + width, y + height)])
            (left, low), (right, high) = np.maximum(0, corners.round().astype(int))
            walls[low:high, left:right] = True
        self.walls = walls
        # To the edge of the nearest cell that is occupied.
        away = ndimage.distance_transform_edt(~walls) - 0.5
        self.distances = np.maximum(away, 0.0) * self._resolution

    def cell(self, x, y):
        """Return the place of a point on the grid, where whole numbers are corners of cells."""
        column, row = self.grid_map.world_to_grid([x, y])[0] + 0.5
        return float(column), float(row)

    def clearance(self, x, y):
        """Return the metres from a point to the nearest obstacle, from the middle of its cell."""
        column, row = self.cell(x, y)
        height, width = self.walls.shape
        if not (0.0 <= column < width and 0.0 <= row < height):
            return 0.0
        return float(self.distances[int(row), int(column)])

    def step(self, speed, turn, seconds):
        """Drive on; a robot that would touch an obstacle stands still, and a bump is counted."""
        pose = self.robot.moved(speed, turn, seconds)
        resolution = self._resolution
        if self.clearance(pose.x, pose.y) > ROBOT_RADIUS - resolution / 2.0:
            self.robot.pose = pose
            return
        self.bumps += abs(self.robot.speed) > 0.0
        # It may turn in place, and drive away from what it touches.
        away = self.clearance(pose.x, pose.y) > self.clearance(*self.robot.pose[:2])
        self.robot.pose = pose if away else self.robot.pose._replace(yaw=pose.yaw)
        self.robot.speed = self.robot.speed if away else 0.0

    def scan(self, beams=BEAMS, longest=RANGE):
        """Return the ranges float32 [beams] of a laser on the robot, from -pi on; inf is none."""
        x, y, yaw = self.robot.pose
        angles = yaw - math.pi + np.arange(beams) * (2.0 * math.pi / beams)
        cells = cast(self.walls, *self.cell(x, y), angles, longest / self._resolution)
        return (cells * self._resolution).astype(np.float32)

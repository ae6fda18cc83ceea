"""The maps and the missions: made from a seed, or Nav2's own maps where they are installed."""

import math
import random
from dataclasses import dataclass

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.map_server import load_map
from scipy import ndimage

from nav2_stack.world import OCCUPIED, World

RESOLUTION = 0.05
# Metres from a start or goal to the next obstacle, and between the two.
CLEAR, SHORTEST = 0.6, 6.0
# What a robot of 0.22 m needs on both sides of its centre to pass safely.
PASSABLE = 0.45
DOOR = (14.0, 6.0)


@dataclass(frozen=True)
class Mission:
    """A start and a goal; boxes that only the laser sees, (x, y, width, height) in metres.

    `event` happens `after` seconds: 'door' shuts, 'goal' changes to `second`, 'kill' the planner.
    'moving' is that the boxes move all the time.
    """

    start: Pose2D
    goal: Pose2D
    boxes: tuple = ()
    event: str = ''
    after: float = 0.0
    second: Pose2D | None = None


def depot(seed=1):
    """Return a hall of 30 x 15 m with two rooms, a door between them, and crates."""
    chance = random.Random(seed)  # noqa: S311 - a map is no secret
    walls = walled(30.0, 15.0)
    fill(walls, DOOR[0], 0.0, 0.15, 15.0)
    fill(walls, DOOR[0], DOOR[1] - 0.8, 0.15, 1.6, wall=False)
    fill(walls, DOOR[0], 12.0, 0.15, 1.6, wall=False)
    for _ in range(14):
        x, y = chance.uniform(1.0, 28.0), chance.uniform(1.0, 13.0)
        size = chance.uniform(0.5, 1.6)
        if abs(x + size / 2 - DOOR[0]) > 2.2:
            fill(walls, x, y, size, size)
    return to_map(walls)


def warehouse(seed=1):
    """Return a warehouse of 30 x 40 m: rows of racks with aisles of 2.4 m, and pallets."""
    chance = random.Random(seed)  # noqa: S311
    walls = walled(30.0, 40.0)
    for row in range(9):
        for column in range(2):
            fill(walls, 3.0 + 13.0 * column, 4.0 + 3.6 * row, 10.5, 1.2)
    for _ in range(12):
        fill(walls, chance.uniform(1.0, 28.0), chance.uniform(1.0, 38.0), 0.8, 0.8)
    return to_map(walls)


def walled(width, height):
    walls = np.zeros((round(height / RESOLUTION), round(width / RESOLUTION)), dtype=bool)
    walls[[0, -1]] = walls[:, [0, -1]] = True
    return walls


def fill(walls, x, y, width, height, wall=True):
    left, low, right, high = (round(n / RESOLUTION) for n in (x, y, x + width, y + height))
    walls[max(0, low) : high, max(0, left) : right] = wall


def to_map(walls):
    return GridMap(np.where(walls, 100, 0).astype(np.int8), resolution=RESOLUTION)


def find_map(name, folder=None):
    """Return Nav2's own map of that name where it is installed, else one made from a seed."""
    path = folder / f'{name}.yaml' if folder else None
    if path is not None and path.is_file():
        return load_map(path)
    return {'depot': depot, 'warehouse': warehouse}[name]()


def missions(grid_map, scenario, count, seed=1):
    """Return `count` missions of a scenario, the same for the same seed."""
    chance = random.Random(f'{scenario} {seed}')  # noqa: S311
    reachable = largest_room(World(grid_map), CLEAR)
    return [mission(grid_map, scenario, reachable, chance) for _ in range(count)]


def mission(grid_map, scenario, reachable, chance):
    if scenario == 'door':
        return door_mission(chance)
    start, goal, second = (place(grid_map, reachable, chance) for _ in range(3))
    if math.dist(start[:2], goal[:2]) < SHORTEST or math.dist(goal[:2], second[:2]) < SHORTEST:
        return mission(grid_map, scenario, reachable, chance)
    if scenario == 'boxes':
        return Mission(start, goal, some_boxes(grid_map, start, goal, chance))
    if scenario == 'moving':
        return Mission(start, goal, some_boxes(grid_map, start, goal, chance, count=6), scenario)
    if scenario in ('goal', 'kill'):
        return Mission(start, goal, (), scenario, chance.uniform(2.0, 5.0), second)
    return Mission(start, goal)


def place(grid_map, reachable, chance):
    row, column = reachable[chance.randrange(len(reachable))]
    x, y = grid_map.grid_to_world([column, row])[0]
    return Pose2D(float(x), float(y), chance.uniform(-math.pi, math.pi))


def largest_room(world, clearance):
    """Return the cells (row, column) [n, 2] of the largest part with so much room about it."""
    free = (world.distances > clearance) & (world.grid_map.cells >= 0)
    parts, _ = ndimage.label(free)
    return np.argwhere(parts == np.bincount(parts[parts > 0]).argmax())


def some_boxes(grid_map, start, goal, chance, count=14):
    """Return boxes around the straight line of a mission that leave a way to its goal."""
    boxes, world = [], World(grid_map)
    while len(boxes) < count:
        part, size = chance.random(), chance.uniform(0.3, 0.7)
        x = start.x + part * (goal.x - start.x) + chance.gauss(0.0, 1.5)
        y = start.y + part * (goal.y - start.y) + chance.gauss(0.0, 1.5)
        if min(math.dist((x, y), end[:2]) for end in (start, goal)) < 1.3:
            continue
        box = (x - size / 2, y - size / 2, size, size)
        world.put('boxes', *boxes, box)
        if connected(world, start, goal):
            boxes.append(box)
    return tuple(boxes)


def connected(world, start, goal):
    parts, _ = ndimage.label((world.distances > PASSABLE) & (world.grid_map.cells < OCCUPIED))
    cells = [tuple(int(n) for n in reversed(world.cell(*end[:2]))) for end in (start, goal)]
    return parts[cells[0]] == parts[cells[1]] > 0


def door_mission(chance):
    """Return a mission of `depot` through its door, which shuts as the robot comes near."""
    start = Pose2D(DOOR[0] - 5.0, DOOR[1] + chance.uniform(-0.5, 0.5), 0.0)
    goal = Pose2D(DOOR[0] + 5.0, DOOR[1] + chance.uniform(-0.5, 0.5), 0.0)
    return Mission(start, goal, (), 'door', chance.uniform(1.5, 3.0))


DOOR_BOX = (DOOR[0], DOOR[1] - 0.8, 0.15, 1.6)

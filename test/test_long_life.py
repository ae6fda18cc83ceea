"""Both nodes for hours: memory, threads, descriptors and shared memory do not grow.

`make soak HOURS=8` runs them for eight hours; LONG_LIFE_HOURS says how long a slow run is.
"""

import itertools
import os
import time

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from graph_tools import calling, process
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.writing import grid_to_message
from llm_astar_planner.nodes.common.entities import LATCHED
from nav_msgs.msg import OccupancyGrid
from test_soak import usage
from tqdm import tqdm

NAMESPACE = '/long_life'
HOURS = float(os.environ.get('LONG_LIFE_HOURS', '0.08'))
# Sides of the maps, one after the other: each round has another one.
SIDES = (300, 500, 200, 600, 400)
# The short run is over before caches and landmarks are full, so it has room for these.
SHORT_ROUNDS = 10
MOST_AT_FIRST = {'bytes': 96 * 2**20, 'threads': 16, 'descriptors': 16, 'shared files': 16}
# How much more there may be after 1000 maps, by the slope of the last three quarters.
MOST_IN_1000 = {'bytes': 64 * 2**20, 'threads': 4, 'descriptors': 4, 'shared files': 4}
SETTINGS = ['-p', 'inflation_radius:=2.0', '-p', 'source_timeout:=0.5']


@pytest.fixture(autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


def map_of(side, draw):
    """Return a map with some rooms, another one each time."""
    cells = np.zeros((side, side), dtype=np.int8)
    for x, y in draw.integers(10, side - 60, (side // 10, 2)):
        cells[y : y + 30, x : x + 30] = 100
    return GridMap(cells)


def lives(is_over):
    """Change the map and call, until `is_over(rounds)`; return what both nodes used each round."""
    draw, seen = np.random.default_rng(1), {'planner': [], 'client': []}
    with (
        process('planner_node', *SETTINGS, namespace=NAMESPACE, files=()) as planner,
        process(
            'llm_client_node', '-p', 'source:=straight', namespace=NAMESPACE, files=()
        ) as client,
        calling(NAMESPACE) as caller,
    ):
        maps = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        progress = tqdm(disable=HOURS < 0.5)
        for side in itertools.cycle(SIDES):
            grid_map = map_of(side, draw)
            maps.publish(grid_to_message(grid_map, Time()))
            caller.wait_until_ready(grid_map.digest, client='llm_client_node')
            for _ in range(4):
                ends = [Pose2D(*place) for place in draw.uniform(1.0, side - 1.0, (2, 2))]
                path, report, _ = caller.call(*ends)
                assert report.map_digest == grid_map.digest
                assert bool(path.poses) == (report.code == 0), report.summary
            seen['planner'].append(usage(planner.pid))
            seen['client'].append(usage(client.pid))
            progress.update()
            if is_over(len(seen['planner'])):
                return seen


def slope(values):
    """Return by how much values grow from one to the next, by least squares."""
    return float(np.polyfit(np.arange(len(values)), values, 1)[0])


def test_maps_of_changing_size_leave_both_nodes_as_large_as_they_were():
    for node, used in lives(lambda rounds: rounds >= SHORT_ROUNDS).items():
        first, last = used[len(SIDES) - 1], used[-1]
        grown = {name: last[name] - first[name] for name in MOST_AT_FIRST}
        assert all(grown[name] <= most for name, most in MOST_AT_FIRST.items()), (node, grown)


@pytest.mark.slow
@pytest.mark.timeout(int(HOURS * 3600) + 600)
def test_both_nodes_live_for_hours_and_nothing_grows():
    end = time.monotonic() + HOURS * 3600
    for node, used in lives(lambda _: time.monotonic() >= end).items():
        late = used[len(used) // 4 :]
        slopes = {name: slope([one[name] for one in late]) for name in MOST_IN_1000}
        tqdm.write(f'{node}: {len(used)} maps, {late[0]} to {late[-1]}, a map adds {slopes}')
        # Fewer maps say less: the noise of memory is some megabytes.
        patience = max(1.0, 1000 / len(late))
        over = {
            name: value
            for name, value in slopes.items()
            if 1000 * value > patience * MOST_IN_1000[name]
        }
        assert not over, (node, over)

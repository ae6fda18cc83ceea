"""A bag of 2 GB is evaluated within 1 GB of memory. Slow, and needs 2.2 GB of disk."""

import csv
import os
import subprocess
import sys

import numpy as np
import pytest
from bag_makers import call_at, map_at
from llm_astar_lab.bags.types import define
from llm_astar_lab.bags.writing import BagWriter, OfferedTopic
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D

SIDE, MAPS, NOISE = 2000, 50, 1 << 20
GOAL_BYTES = 2 * 10**9
# Prints the peak of a command's resident memory in KiB after the command's own output.
MEASURE = """
import resource, subprocess, sys
code = subprocess.run(sys.argv[1:]).returncode
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, file=sys.stderr)
raise SystemExit(code)
"""


def big_map(number):
    """Return a map of scattered walls, another one for each number."""
    random = np.random.default_rng(number)
    cells = (random.random((SIDE, SIDE)) < 0.02).astype(np.int8) * 100
    cells[:20, :20] = cells[-20:, -20:] = 0
    return GridMap(cells, 0.05, Pose2D(0.0, 0.0))


def write_big_bag(folder):
    """Write maps, a request on each, and camera-like noise until 2 GB are full."""
    topics = {
        '/map': 'nav_msgs/msg/OccupancyGrid',
        '/planner_node/get_plan/_service_event': 'nav_msgs/srv/GetPlan_Event',
        '/camera': 'sensor_msgs/msg/CompressedImage',
    }
    a_map = GOAL_BYTES // MAPS // NOISE + 1
    with BagWriter(folder) as bag:
        for name, msgtype in topics.items():
            bag.add_topic(OfferedTopic(name, define(msgtype)))
        for number in range(MAPS):
            second = 100 * number
            for topic, seconds, message in (
                map_at(second, big_map(number)),
                call_at(second + 1, (0.5, 0.5), (99.5, 99.5), number),
            ):
                bag.write_message(topic, int(seconds * 1e9), message)
            for frame in range(a_map):
                stamp = int((second + 2 + frame / 10) * 1e9)
                bag.write('/camera', stamp, b'\0\1\0\0' + os.urandom(NOISE))
    return sum(file.stat().st_size for file in folder.iterdir())


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.skipif(sys.platform != 'linux', reason='counts memory in KiB')
def test_a_bag_of_2_gb_is_evaluated_within_1_gb_of_memory(tmp_path):
    size = write_big_bag(tmp_path / 'big')
    assert size >= GOAL_BYTES
    module = [sys.executable, '-m', 'llm_astar_planner.cli.main']
    command = [sys.executable, '-c', MEASURE, *module, 'evaluate', str(tmp_path / 'big')]
    options = ['--methods', 'guided', '--source', 'straight', '--out', str(tmp_path / 'out')]
    done = subprocess.run([*command, *options], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    peak = int(done.stderr.split()[-1]) * 1024
    with (tmp_path / 'out' / 'results.csv').open() as file:
        rows = list(csv.DictReader(file))
    print(f'{size / 1e9:.2f} GB, {len(rows)} rows, peak {peak / 1e9:.2f} GB')  # noqa: T201
    assert len(rows) == 3 * MAPS
    assert peak < 1e9

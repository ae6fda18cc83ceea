"""planner_node serves before its searches are imported and compiled, and ends while they are."""

import os
import signal
import subprocess
import sys
import time

import pytest
import rclpy
from graph_tools import calling, process, wait_for
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_planner.nodes.tools.planner_client import PlannerClientError

COLD = '/cold'
HEAVY = ('numba', 'scipy', 'httpx', 'lark', 'matplotlib', 'rosbags')
LISTED = f"""
import sys
from llm_astar_planner.nodes.planner import {{}}
print(*sorted(set({HEAVY!r}) & set(sys.modules)))
"""


@pytest.mark.parametrize(
    ('module', 'taken'),
    [
        ('planner_node', {'lark'}),  # which the ROS wheels import
        ('planner_server', {'lark', 'numba', 'scipy'}),  # llm_client_node is the HTTP client
    ],
)
def test_nothing_that_takes_long_is_imported_before_it_is_needed(module, taken):
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, '-c', LISTED.format(module)],
        capture_output=True, text=True, env=environment,
    )  # fmt: skip
    assert done.stderr == ''
    assert set(done.stdout.split()) <= taken


@pytest.fixture
def ros():
    rclpy.init()
    yield
    rclpy.try_shutdown()


def test_the_waypoint_client_says_that_it_compiles_and_a_signal_ends_it(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    with process('llm_client_node', namespace=COLD, files=()) as node:
        announced = f'the first waypoints wait for up to a minute; they are kept in {tmp_path}'
        wait_for(lambda: announced in ''.join(node.output), 'the announcement')
    assert node.returncode == 0
    assert 'Traceback' not in ''.join(node.output)


@pytest.mark.usefixtures('ros')
def test_a_goal_waits_for_the_compilation_and_a_signal_ends_it(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    with process('planner_node', namespace=COLD) as node, calling(COLD) as caller:
        wait_for(lambda: 'compiling the searches' in ''.join(node.output), 'the announcement')
        assert 'up to a minute' in ''.join(node.output)
        # Longer than it would wait for a map.
        with pytest.raises(PlannerClientError, match='did not respond'):
            caller.call(Pose2D(1.0, 1.0), Pose2D(2.0, 2.0), seconds=3.0)
        node.send_signal(signal.SIGTERM)
        began = time.monotonic()
        assert node.wait(20.0) == 0
        assert time.monotonic() - began < 15.0
    assert 'Traceback' not in ''.join(node.output)

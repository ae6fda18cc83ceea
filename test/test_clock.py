"""Simulated time stands still."""

import threading

import pytest
import rclpy
from graph_tools import PATIENCE, running
from llm_astar_planner.nodes.common.entities import Entities
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter

SPACE = '/clock'


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


def test_timers_go_on_where_simulated_time_stands_still():
    node = rclpy.create_node(
        'still', namespace=SPACE, parameter_overrides=[Parameter('use_sim_time', value=True)]
    )
    called = threading.Event()
    with running(node):
        Entities(node).timer(0.01, called.set, ReentrantCallbackGroup())
        assert called.wait(PATIENCE)

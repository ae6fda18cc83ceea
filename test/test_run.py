"""Nodes spin on whatever happens beside them, and end on what is wrong."""

import subprocess
import sys
from types import SimpleNamespace

import pytest
from llm_astar_planner.nodes.common.spin import spin
from rclpy._rclpy_pybind11 import RCLError

GONE = "Failed to add 'rcl_action_server_t' to wait set: action server pointer is invalid"


class Executor:
    """Fails as told, step by step, and ends the context at last."""

    def __init__(self, *problems):
        self.problems = list(problems)
        self.context = SimpleNamespace(ok=lambda: self.steps <= len(problems))
        self.steps = 0

    def spin_once(self, timeout_sec):
        self.steps += 1
        if self.problems:
            raise RCLError(self.problems.pop(0))


def test_an_action_server_that_leaves_the_graph_does_not_end_the_node():
    executor = Executor(GONE, GONE)
    spin(executor, executor.context)
    assert executor.steps == 3


def test_another_failure_of_the_middleware_ends_it():
    executor = Executor('out of memory', GONE)
    with pytest.raises(RCLError, match='memory'):
        spin(executor, executor.context)


HANGS = """
import ctypes
from llm_astar_planner.nodes.common import spin as run
class Node:
    def destroy_node(self):
        ctypes.PyDLL(None).sleep(60)  # and keeps Python's lock, as the middleware may
run.LONGEST_LEAVE = 0.1
run.leave(Node())
"""


def test_a_process_that_cannot_leave_the_graph_ends_all_the_same_and_says_where_it_was():
    ended = subprocess.run(
        [sys.executable, '-c', HANGS], capture_output=True, text=True, timeout=50, check=False
    )
    assert ended.returncode == 1
    assert 'in destroy_node' in ended.stderr

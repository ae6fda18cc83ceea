"""Spinning survives what a shutdown causes, and ends on other failures."""

import concurrent.futures.thread
import subprocess
import sys
from types import SimpleNamespace

import pytest
import rclpy
from llm_astar_planner.nodes.common.spin import RCLError, end_threads, spin
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import MultiThreadedExecutor

GONE = "Failed to add 'rcl_action_server_t' to wait set: action server pointer is invalid"


class Executor:
    """Raises the given errors, one in each step, and then ends the context."""

    def __init__(self, *problems):
        self.problems = list(problems)
        self.context = SimpleNamespace(ok=lambda: self.steps <= len(problems))
        self.steps = 0

    def spin_once(self, timeout_sec):
        self.steps += 1
        if self.problems:
            raise self.problems.pop(0)


def test_an_action_server_that_leaves_the_graph_does_not_end_the_node():
    executor = Executor(RCLError(GONE), RCLError(GONE))
    spin(executor, executor.context)
    assert executor.steps == 3


def test_an_entity_destroyed_while_the_executor_waits_does_not_end_the_node():
    executor = Executor(InvalidHandle('destruction was requested'))
    spin(executor, executor.context)
    assert executor.steps == 2


def test_another_failure_of_the_middleware_ends_the_node():
    executor = Executor(RCLError('out of memory'), RCLError(GONE))
    with pytest.raises(RCLError, match='memory'):
        spin(executor, executor.context)


HANGS = """
import ctypes
from llm_astar_planner.nodes.common import spin
class Node:
    def destroy_node(self):
        ctypes.PyDLL(None).sleep(60)  # and keeps Python's lock, as the middleware may
spin.LONGEST_LEAVE = 0.1
spin.leave(Node())
"""


def test_a_process_that_cannot_leave_the_graph_is_ended_with_a_traceback():
    ended = subprocess.run(
        [sys.executable, '-c', HANGS], capture_output=True, text=True, timeout=50, check=False
    )
    assert ended.returncode == 1
    assert 'in destroy_node' in ended.stderr


def test_a_thread_that_python_does_not_know_ends_with_the_executor(monkeypatch):
    """A signal between its start and its registration leaves such a thread behind."""
    monkeypatch.setattr(concurrent.futures.thread, '_threads_queues', {})
    context = Context()
    rclpy.init(context=context)
    executor = MultiThreadedExecutor(num_threads=2, context=context)
    executor._executor.submit(int).result()
    (thread,) = executor._executor._threads
    end_threads(executor)
    thread.join(60.0)
    assert not thread.is_alive()
    end_threads(None)
    rclpy.shutdown(context=context)

"""Nodes, as real processes or in this one, and callers in their graph, for the live graph."""

import contextlib
import signal
import subprocess
import sys
import threading
import time

import rclpy
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_planner.nodes.common.spin import spin
from llm_astar_planner.nodes.llm_client_node import LlmClientNode
from llm_astar_planner.nodes.map_node import MapNode
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.nodes.tools.planner_client import PlannerClient
from llm_astar_planner.resources import find_file
from rcl_interfaces.srv import SetParameters
from rclpy.executors import MultiThreadedExecutor
from rclpy.parameter import Parameter

START, GOAL = Pose2D(39.0, 18.0), Pose2D(7.0, 19.0)
DEMO = str(find_file('demo.yaml', 'config'))
# Waypoints that stay what they are, whatever the embedded model learns.
REPLAY = str(find_file('llm_replay.yaml', 'config'))
# Tests that start nodes of their own do so out of the sight of the shared graph.
ALONE = '/alone'
PATIENCE = 60.0


NODES = {'map_node': MapNode, 'llm_client_node': LlmClientNode, 'planner_node': PlannerNode}


def ros_arguments(arguments, namespace, files):
    """Return the arguments of a node for ROS."""
    remap = ['-r', f'__ns:={namespace}'] if namespace else []
    parameters = [word for file in files for word in ('--params-file', file)]
    return ['--ros-args', *parameters, *remap, *arguments]


@contextlib.contextmanager
def in_this_process(name, *arguments, namespace='', files=(DEMO, REPLAY)):
    """Run a node beside the test: what `process` does, without a start of Python each."""
    node = NODES[name](cli_args=ros_arguments(arguments, namespace, files))
    with running(node):
        yield node


@contextlib.contextmanager
def process(name, *arguments, namespace='', files=(DEMO, REPLAY)):
    """Run a node as a process of its own; give it back, and end it as Ctrl-C would."""
    command = [sys.executable, '-m', 'llm_astar_planner.nodes', name]
    node = subprocess.Popen(
        [*command, *ros_arguments(arguments, namespace, files)],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    output = []
    reader = threading.Thread(target=lambda: output.extend(node.stdout), daemon=True)
    reader.start()
    node.output = output
    try:
        yield node
    finally:
        if node.poll() is None:
            node.send_signal(signal.SIGCONT)
            node.send_signal(signal.SIGINT)
        try:
            node.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            node.kill()
            node.wait()
            raise
        finally:
            reader.join(PATIENCE)
            node.stdout.close()


@contextlib.contextmanager
def spinning(*nodes):
    """Spin nodes of this process on threads of their own, and destroy them in the end."""
    executor = MultiThreadedExecutor(num_threads=8)
    for node in nodes:
        executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()
        for node in nodes:
            node.destroy_node()


class PatientClient(PlannerClient):
    """A caller that gives nodes the time which they take to start on a busy machine."""

    def wait_until_ready(self, map_digest=None, *, client='', seconds=PATIENCE):
        super().wait_until_ready(map_digest, client=client, seconds=seconds)

    def wait_for_landmarks(self):
        """Before its landmarks are there, a planner finds the same path with more expansions."""

        def has_landmarks():
            return any(values.get('landmarks') for values in self._health.values())

        self.wait_for(has_landmarks, 'landmarks', PATIENCE)


@contextlib.contextmanager
def calling(namespace='', name='test_caller'):
    """Join the graph as a caller."""
    node = rclpy.create_node(name, namespace=namespace or None)
    try:
        with PatientClient(node) as caller:
            yield caller
    finally:
        node.destroy_node()


@contextlib.contextmanager
def running(*nodes):
    """Spin nodes in this process, as their main does, and take them out of the graph again."""
    executor = MultiThreadedExecutor(num_threads=8)
    stopped = threading.Event()
    for node in nodes:
        executor.add_node(node)
    thread = threading.Thread(target=spin, args=(executor, nodes[0].context, stopped))
    thread.start()
    try:
        yield
    finally:
        for node in nodes:
            node.destroy_node()
        stopped.set()
        executor.create_task(int)
        thread.join()
        executor.shutdown()


def wait_for(condition, what, seconds=PATIENCE):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.02)


def set_parameter(caller, node, name, value):
    client = caller.node.create_client(SetParameters, f'{node}/set_parameters')
    message = Parameter(name, value=value).to_parameter_msg()
    return caller.ask(client, SetParameters.Request(parameters=[message])).results[0]

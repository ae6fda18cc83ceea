"""Floods: more callers, maps and instructions than the nodes can follow. Nothing grows."""

import contextlib
import itertools
import threading
import time

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from graph_tools import PATIENCE, calling, running, wait_for
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.writing import grid_to_message, pose_to_message
from llm_astar_planner.nodes.common.qos import CALLS, LATCHED, RELIABLE
from llm_astar_planner.nodes.llm_client_node import CALLERS, QUERY_THREADS, LlmClientNode
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetPlan
from rclpy.parameter import Parameter
from std_msgs.msg import String

SIDE = 60
ENDS = Pose2D(5.5, 5.5), Pose2D(50.5, 50.5)
AT_ONCE = 64
MAPS_A_SECOND, INSTRUCTIONS_A_SECOND = 100, 1000
FLOOD_SECONDS = 1.0


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


class Source:
    """Answers when it is let go, and counts how often it was asked."""

    name = 'slow'

    def __init__(self):
        self.asked = []
        self.go = threading.Event()

    def waypoints(self, query):
        self.asked.append(query.grid_map.digest)
        self.go.wait(PATIENCE)
        return WaypointReply(((20.0, 20.0),), 'slow', SourceStatus.OK)


def map_number(number):
    cells = np.zeros((SIDE, SIDE), dtype=np.int8)
    cells[0, 1 + number % (SIDE - 2)] = 100
    return GridMap(cells)


class MapFlood:
    """Publishes maps; `newest` is the digest of the last one."""

    def __init__(self, caller):
        maps = [map_number(number) for number in range(SIDE - 2)]
        self._messages = itertools.cycle(
            (grid_map.digest, grid_to_message(grid_map, Time())) for grid_map in maps
        )
        self._publisher = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        self.newest = ''

    def __call__(self):
        self.newest, message = next(self._messages)
        self._publisher.publish(message)


def flood(action, rate, seconds=FLOOD_SECONDS):
    """Start a thread that does something `rate` times a second."""

    def work():
        end = time.monotonic() + seconds
        for number in itertools.count(1):
            action()
            due = end - seconds + number / rate
            if due > end:
                return
            time.sleep(max(0.0, due - time.monotonic()))

    thread = threading.Thread(target=work)
    thread.start()
    return thread


def request(tolerance=0.0):
    start, goal = (pose_to_message(end, 'map', Time()) for end in ENDS)
    return GetPlan.Request(start=start, goal=goal, tolerance=tolerance)


def answers(client, requests):
    """Call for all at once, and return the paths of the answers."""
    futures = [client.call_async(one) for one in requests]
    wait_for(lambda: all(future.done() for future in futures), 'the answers')
    return [future.result().plan for future in futures]


@contextlib.contextmanager
def most_threads():
    """Yield a list whose one element becomes the most threads that ran meanwhile."""
    most, done = [0], threading.Event()

    def watch():
        while not done.wait(0.01):
            most[0] = max(most[0], threading.active_count())

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        yield most
    finally:
        done.set()
        watcher.join()


def test_a_flood_of_questions_to_a_source_that_hangs_takes_few_threads(monkeypatch):
    namespace, source = '/flooded_client', Source()
    node = LlmClientNode(
        namespace=namespace, parameter_overrides=[Parameter('source', value='none')]
    )
    monkeypatch.setattr(node, '_new_source', source)
    node.adopt_source()
    with running(node), calling(namespace) as caller:
        maps = MapFlood(caller)
        maps()
        client = caller.node.create_client(
            GetPlan, 'llm_client_node/get_waypoints', qos_profile=CALLS
        )
        assert client.wait_for_service(PATIENCE)
        wait_for(lambda: node._grid_map is not None, 'the map')
        before = threading.active_count()
        with most_threads() as most:
            maps_flood = flood(maps, MAPS_A_SECOND)
            plans = answers(client, [request(0.3)] * AT_ONCE)
            maps_flood.join()
            # Maps got through while callers waited.
            wait_for(lambda: node._grid_map.digest == maps.newest, 'the newest map')
            plans += answers(client, [request(0.3)] * AT_ONCE)
        assert most[0] - before <= QUERY_THREADS + CALLERS + 4
        assert len(source.asked) <= QUERY_THREADS
        assert all(plan.poses == [] for plan in plans)
        source.go.set()
        wait_for(lambda: not node._queue._running, 'the source')
        assert [len(plan.poses) for plan in answers(client, [request()] * 3)] == [1] * 3
        assert source.asked[-1] == maps.newest


def test_floods_of_callers_maps_and_instructions_leave_a_planner_that_answers():
    namespace = '/flooded_planner'
    node = PlannerNode(
        namespace=namespace, parameter_overrides=[Parameter('llm_client', value='')]
    )
    with running(node), calling(namespace) as caller:
        maps = MapFlood(caller)
        maps()
        caller.wait_until_ready()
        caller.call(*ENDS)
        instructions = caller.node.create_publisher(String, 'planner_node/instruction', RELIABLE)
        wait_for(instructions.get_subscription_count, 'the instructions')
        texts = itertools.cycle(['stay left', '', 'avoid the north', 'nonsense'])
        client = caller.node.create_client(GetPlan, 'planner_node/get_plan', qos_profile=CALLS)
        assert client.wait_for_service(PATIENCE)
        before = threading.active_count()
        with most_threads() as most:
            floods = [
                flood(maps, MAPS_A_SECOND),
                flood(
                    lambda: instructions.publish(String(data=next(texts))), INSTRUCTIONS_A_SECOND
                ),
            ]
            answered = 0
            while any(thread.is_alive() for thread in floods):
                plans = answers(client, [request()] * AT_ONCE)
                answered += sum(bool(plan.poses) for plan in plans)
        assert answered >= AT_ONCE
        # The callers' threads are the executor's own.
        assert most[0] - before <= 40
        wait_for(lambda: caller.call(*ENDS)[1].map_digest == maps.newest, 'the newest map')
        wait_for(lambda: threading.active_count() <= before + 24, 'the end of the threads')

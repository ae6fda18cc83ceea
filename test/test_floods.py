"""Floods: more callers, maps and instructions than the nodes can follow. Nothing grows."""

import contextlib
import gc
import itertools
import threading
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from graph_tools import PATIENCE, calling, process, running, set_parameter, wait_for
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import NO_PLACES
from llm_astar_msgs_adapter.messages.report import PlanReport, report_from_message
from llm_astar_msgs_adapter.messages.writing import grid_to_message, pose_to_message
from llm_astar_planner.instructions.interpretation import Understanding
from llm_astar_planner.nodes import llm_client_node
from llm_astar_planner.nodes.common.entities import (
    CALLS,
    LATCHED,
    RELIABLE,
    REPORTS_OF_CALLS,
    Entities,
)
from llm_astar_planner.nodes.llm_client_node import CALLERS, QUERY_THREADS, LlmClientNode
from llm_astar_planner.nodes.planner.goals import CancellationToken, PlanGoal
from llm_astar_planner.nodes.planner.instruction_server import MOST_WAITING, InstructionClient
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import ResultCode
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


def answers(client, requests, seconds=PATIENCE):
    """Call for all at once, and return the paths of the answers."""
    futures = [client.call_async(one) for one in requests]
    wait_for(lambda: all(future.done() for future in futures), 'the answers', seconds)
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
        # Besides the threads of the executor.
        assert most[0] - before <= QUERY_THREADS + CALLERS + 12
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
        # Hundreds of maps have come and gone, and nothing keeps them.
        gc.collect()
        kept = [one for one in gc.get_objects() if type(one) is Planner]
        assert sum(one.grid_map.width == SIDE for one in kept) <= 5


@pytest.mark.parametrize('callers', [500, pytest.param(2000, marks=pytest.mark.slow)])
def test_every_one_of_many_callers_at_once_hears_and_a_late_turn_is_no_plan(callers):
    namespace = '/crowded_planner'
    node = PlannerNode(
        namespace=namespace, parameter_overrides=[Parameter('llm_client', value='')]
    )
    with running(node), calling(namespace) as caller:
        MapFlood(caller)()
        caller.wait_until_ready()
        caller.call(*ENDS)
        client = caller.node.create_client(GetPlan, 'planner_node/get_plan', qos_profile=CALLS)
        assert client.wait_for_service(PATIENCE)
        said = []
        caller.node.create_subscription(
            DiagnosticArray,
            'planner_node/report',
            lambda message: said.append(report_from_message(message, PlanReport).summary),
            REPORTS_OF_CALLS,
        )
        plans = answers(client, [request()] * callers, 3 * PATIENCE)
        assert any(plan.poses for plan in plans)
        wait_for(lambda: any('busy: 128 requests are waiting' in one for one in said), 'busy')
        # The time of a request that waited runs from its arrival.
        start, goal, arrived = request().start, request().goal, time.monotonic()
        assert node.set_parameters([Parameter('max_planning_time', value=0.01)])[0].successful
        time.sleep(0.02)
        late = node.answer(PlanGoal((goal,), start), CancellationToken(arrived))
        assert late.plan.code is ResultCode.TIMEOUT
        assert 'its turn came after' in late.plan.message
        assert node.set_parameters([Parameter('max_planning_time', value=5.0)])[0].successful
        # Whoever comes after the flood is answered as before.
        assert caller.call(*ENDS)[0].poses


def test_changes_of_parameters_leave_few_threads_that_wait_for_a_server(chat_server, monkeypatch):
    chat_server.script = [chat_server.wait(PATIENCE)]
    values = {'source': 'endpoint', 'base_url': chat_server.base_url, 'model': 'tiny'}
    node = LlmClientNode(
        namespace='/changed_client',
        parameter_overrides=[Parameter(name, value=value) for name, value in values.items()],
    )
    try:
        node.on_map(map_number(0))
        most = threading.active_count() + 10
        monkeypatch.setattr(llm_client_node, 'MOST_THREADS', most)
        monkeypatch.setattr('llm_astar_planner.waypoints.async_query.IDLE_SECONDS', 0.2)
        reasons = []
        for number in range(40):
            changed = Parameter('temperature', value=number / 100)
            reasons.append(node.set_parameters([changed])[0].reason)
            node.ask(request(0.02), time.monotonic())
        # Those of the server itself included.
        assert threading.active_count() <= most + 15
        assert reasons[:3] == [''] * 3
        assert reasons[-1] == llm_client_node.REPLACED_TOO_OFTEN
        chat_server.stopping.set()
        wait_for(lambda: threading.active_count() < most, 'the end of the threads')
        assert node.set_parameters([Parameter('temperature', value=1.0)])[0].successful
    finally:
        node.destroy_node()


def test_a_question_whose_answer_is_of_no_use_any_more_ends_at_once():
    node = rclpy.create_node('asking', namespace='/dropped')
    node.create_subscription(String, 'model/interpret', lambda _: None, RELIABLE)
    with running(node):
        client = InstructionClient(Entities(node), 'model')
        wait_for(lambda: client.ready, 'who is asked')
        answers, threads = [], []
        for number in range(1, MOST_WAITING + 2):
            ask = partial(client.interpret, f'waltz {number}', NO_PLACES, 10 * PATIENCE)
            threads.append(threading.Thread(target=lambda ask=ask: answers.append(ask())))
            threads[-1].start()
            wait_for(lambda number=number: len(client._answers) == number, 'the question')
        client.drop_oldest()
        threads[0].join(PATIENCE)
        (dropped,) = answers
        assert (dropped.text, dropped.status) == ('waltz 1', Understanding.PENDING)
        assert 'was changed while it was asked' in dropped.detail
        client.close()
        for thread in threads:
            thread.join(PATIENCE)


def state_of(process):
    """Return the memory in MB and the threads of a process."""
    lines = Path(f'/proc/{process.pid}/status').read_text().splitlines()
    values = dict(line.split(':', 1) for line in lines)
    return int(values['VmRSS'].split()[0]) / 1000, int(values['Threads'])


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_memory_of_a_planner_is_that_of_its_largest_map_after_100_maps_of_other_sizes():
    generator, seen = np.random.default_rng(1), []
    with (
        process('planner_node', '-p', 'inflation_radius:=3.0', files=()) as node,
        calling() as caller,
    ):
        maps = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        for side in itertools.islice(itertools.cycle((600, 900, 400, 1000, 700)), 100):
            cells = np.zeros((side, side), dtype=np.int8)
            for x, y in generator.integers(10, side - 60, (60, 2)):
                cells[y : y + 30, x : x + 30] = 100
            grid_map = GridMap(cells)
            maps.publish(grid_to_message(grid_map, Time()))
            caller.wait_until_ready(grid_map.digest, seconds=PATIENCE)
            caller.call(Pose2D(2.5, 2.5), Pose2D(side - 2.5, side - 2.5))
            seen.append(state_of(node))
    memory, threads = zip(*seen)
    # Landmarks take at most 64 MB of the largest map, and two maps 23 bytes a cell each.
    assert max(memory[-20:]) - memory[0] < 130.0, memory
    assert threads[-1] < 64


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_floods_of_everything_leave_memory_and_threads_of_both_nodes_flat(chat_server):
    chat_server.script = [chat_server.wait(PATIENCE)]
    values = {'source': 'endpoint', 'base_url': chat_server.base_url, 'timeout_s': 1.0}
    options = [word for name, value in values.items() for word in ('-p', f'{name}:={value}')]
    numbers = itertools.count()
    with (
        process('llm_client_node', *options, files=()) as client,
        process('planner_node', files=()) as planner,
        calling() as caller,
    ):
        maps = MapFlood(caller)
        maps()
        caller.wait_until_ready(client='llm_client_node', seconds=PATIENCE)
        topics = (
            'planner_node/instruction',
            'planner_node/interpret',
            'llm_client_node/interpret',
        )
        texts = [caller.node.create_publisher(String, topic, RELIABLE) for topic in topics]
        goals = caller.node.create_publisher(PoseStamped, 'goal_pose', RELIABLE)
        services = [
            caller.node.create_client(GetPlan, name, qos_profile=CALLS)
            for name in ('llm_client_node/get_waypoints', 'planner_node/get_plan')
        ]
        assert all(service.wait_for_service(PATIENCE) for service in services)

        def publish():
            for publisher in texts:
                publisher.publish(String(data=f'waltz around the thing {next(numbers)}'))
            goals.publish(request().goal)
            temperature = (next(numbers) % 199) / 100
            if next(numbers) % 7 == 0:
                set_parameter(caller, 'llm_client_node', 'temperature', temperature)

        seen = []
        for _ in range(4):
            floods = [flood(maps, 5.0, 10.0), flood(publish, 50.0, 10.0)]
            while any(thread.is_alive() for thread in floods):
                for service in services:
                    answers(service, [request(0.3)] * AT_ONCE)
            seen.append((state_of(planner), state_of(client)))
    for first, last in zip(seen[1], seen[-1]):
        assert last[0] - first[0] < 64.0, seen
        assert last[1] <= llm_client_node.MOST_THREADS + 64, seen

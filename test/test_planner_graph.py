"""planner_node in a live graph: cancels, deadlines, changing worlds, and being managed."""

import contextlib
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from graph_tools import PATIENCE, calling, process, running, set_parameter, wait_for
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message, yaw_of
from llm_astar_msgs_adapter.messages.writing import (
    grid_to_message,
    path_to_message,
    pose_to_message,
    report_to_message,
)
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE, REPORTS
from llm_astar_planner.nodes.planner.map_manager import MapManager
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.report import plan_report
from llm_astar_planner.planning.types import Plan, ResultCode
from nav_msgs.msg import OccupancyGrid, Path
from nav_msgs.srv import GetPlan
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock

LONG = 60.0
# Each node out of the others' sight: a call may still find one that has just left.
WORLD, MANAGED, WAITING = '/world', '/managed', '/managed_waiting'
AGAIN, APART, SIMULATED = '/managed_again', '/managed_apart', '/simulated'
START, GOAL, OTHER_GOAL = Pose2D(5.5, 5.5), Pose2D(35.5, 5.5, 1.0), Pose2D(5.5, 20.5)
CELLS = np.zeros((30, 40), dtype=np.int8)
CELLS[:25, 20] = 100
CORNERS = [(19.5, 26.5), (21.5, 26.5)]


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


class Client(Node):
    """Stands in for llm_client_node: answers with two corners, or hangs for as long as told."""

    def __init__(self):
        super().__init__('llm_client_node', namespace=WORLD)
        self.declare_parameter('model', 'one')
        self.asked = []
        self.go = threading.Event()
        self.go.set()
        self.create_service(
            GetPlan,
            '~/get_waypoints',
            self._answer,
            callback_group=ReentrantCallbackGroup(),
        )

    def _answer(self, request, response):
        self.asked.append(request)
        self.go.wait(LONG)
        response.plan = path_to_message(CORNERS, 'map', self.get_clock().now().to_msg())
        return response

    def destroy_node(self):
        self.go.set()
        super().destroy_node()


class Graph:
    """A planner with its client and a caller, and all they publish."""

    def __init__(self, planner, client, caller):
        self.planner, self.client, self.caller = planner, client, caller
        self.paths = []
        node = caller.node
        node.create_subscription(Path, 'plan', self.paths.append, RELIABLE)
        self.maps = node.create_publisher(OccupancyGrid, 'map', LATCHED)
        self.goals = node.create_publisher(PoseStamped, 'goal_pose', RELIABLE)
        self.starts = node.create_publisher(PoseWithCovarianceStamped, 'initialpose', RELIABLE)
        wait_for(lambda: node.count_publishers('plan'), 'the plan')
        for publisher in (self.maps, self.goals, self.starts):
            wait_for(publisher.get_subscription_count, publisher.topic_name)

    def show(self, *cells):
        """Publish the map with more cells occupied, and wait until it is planned on."""
        after = CELLS.copy()
        for x, y in cells:
            after[y, x] = 100
        grid_map = GridMap(after)
        self.maps.publish(grid_to_message(grid_map, Time()))
        self.caller.wait_until_ready(grid_map.digest)
        return grid_map

    def set(self, **parameters):
        for name, value in parameters.items():
            result = set_parameter(self.caller, 'planner_node', name, value)
            assert result.successful, result.reason

    def aim(self, goal):
        """Press RViz's button."""
        self.goals.publish(pose_to_message(goal, 'map', Time()))

    @property
    def reports(self):
        return [report for _, report in list(self.caller._reports.values())]

    def wait_for_report(self, condition, what):
        wait_for(lambda: any(condition(report) for report in self.reports), what)
        return next(report for report in self.reports if condition(report))

    def health(self):
        return self.caller._health.get(f'{WORLD[1:]}/planner_node: planner', {})


def node_of(namespace=WORLD, context=None, **parameters):
    overrides = [Parameter(name, value=value) for name, value in parameters.items()]
    return PlannerNode(namespace=namespace, context=context, parameter_overrides=overrides)


@contextlib.contextmanager
def graph(**parameters):
    client, planner = Client(), node_of(**parameters)
    with running(client, planner), calling(WORLD) as caller:
        made = Graph(planner, client, caller)
        made.show()
        wait_for(lambda: made.health().get('llm_client_ready'), 'the client')
        yield made


@pytest.fixture(scope='module')
def slow_graph(_context):
    """A planner that has a minute, and waits for waypoints before it searches."""
    with graph(max_planning_time=LONG, source_timeout=LONG, search_while_waiting=False) as made:
        yield made


@pytest.fixture
def world(slow_graph):
    slow_graph.client.go.set()
    slow_graph.caller._reports.clear()
    slow_graph.paths.clear()
    slow_graph.client.asked.clear()
    return slow_graph


def forget(world):
    """Drop the waypoints and the path of an earlier test."""
    server = world.planner._server
    server._client.cache.clear()
    server.monitor.tasks.put(server.monitor.forget)


def yaws(path):
    return [yaw_of(pose.pose.orientation, 'pose') for pose in path.poses]


def test_goals_that_are_published_back_to_back_are_taken_in_their_order(world, monkeypatch):
    """So the last survives, even if threads change as often as they can."""
    server = world.planner._server
    begin, interval = server._goals.begin, sys.getswitchinterval()
    tokens, rows = [], {}

    def begun(reason):
        tokens.append(begin(reason))
        return tokens[-1]

    def answer(goal, token):
        rows[token] = goal.goals[0].pose.position.y

    monkeypatch.setattr(server._goals, 'begin', begun)
    monkeypatch.setattr(world.planner, 'answer', answer)
    sys.setswitchinterval(1e-6)
    try:
        for _ in range(10):
            tokens.clear()
            rows.clear()
            for row in range(8):
                world.aim(Pose2D(GOAL.x, float(row)))
            wait_for(lambda: len(rows) == 8, 'the goals')
            assert [rows[token] for token in tokens] == list(range(8))
            assert [token.reason for token in tokens] == ['a newer goal came'] * 7 + ['']
    finally:
        sys.setswitchinterval(interval)


def test_a_busy_caller_loses_no_response_among_those_to_others(world):
    forget(world)
    is_busy, is_free = threading.Event(), threading.Event()

    def be_busy():
        is_busy.set()
        is_free.wait(LONG)

    with calling(WORLD, 'busy_caller') as busy, ThreadPoolExecutor(1) as thread:
        busy.call(START, GOAL)
        busy.node.create_timer(0.01, be_busy)
        assert is_busy.wait(LONG)
        answer = thread.submit(busy.call, START, GOAL, seconds=LONG / 4.0)
        # The middleware brings every caller the responses to all of them.
        for _ in range(30):
            world.caller.call(START, GOAL)
        is_free.set()
        assert answer.result()[1].code == 0


def test_a_newer_goal_cancels_the_one_that_waits_for_waypoints(world):
    start = PoseWithCovarianceStamped()
    start.header.frame_id = 'map'
    start.pose.pose = pose_to_message(START, 'map', Time()).pose
    world.starts.publish(start)
    wait_for(lambda: world.planner._server._initial_pose, 'the start')
    world.client.go.clear()
    began = time.monotonic()
    world.aim(GOAL)
    wait_for(lambda: world.client.asked, 'the question')
    world.set(use_waypoints=False)
    try:
        world.aim(OTHER_GOAL)
        canceled = world.wait_for_report(lambda report: report.code == 207, 'the cancel')
        world.wait_for_report(lambda report: report.code == 0, 'the plan')
    finally:
        world.set(use_waypoints=True)
    assert 'a newer goal came' in canceled.message
    assert time.monotonic() - began < LONG / 2
    wait_for(lambda: world.paths, 'the path')
    assert {tuple(path_from_message(path)[-1]) for path in world.paths} == {OTHER_GOAL[:2]}


def test_a_path_comes_in_time_whatever_the_client_does(world):
    forget(world)
    world.client.go.clear()
    world.set(max_planning_time=0.5)
    try:
        path, report, _ = world.caller.call(START, GOAL)
    finally:
        world.set(max_planning_time=LONG)
    assert (report.code, report.guided_by) == (0, 'none')
    assert report.source_status == 'TIMEOUT'
    assert len(path.poses) > 30


def test_a_client_whose_parameters_change_is_asked_again(world):
    forget(world)
    world.caller.call(START, GOAL)
    world.show((2, 28))
    world.caller.call(START, GOAL)
    assert len(world.client.asked) == 1  # its waypoints hold on the changed map
    assert set_parameter(world.caller, 'llm_client_node', 'model', 'two').successful

    def is_asked_again():
        world.caller.call(START, GOAL)
        return len(world.client.asked) == 2

    wait_for(is_asked_again, 'the second query')
    world.show()


def test_the_client_is_given_the_rules_that_the_planner_plans_by(world):
    forget(world)
    world.client.declare_parameter('occupied_threshold', 65)
    world.client.declare_parameter('robot_radius', 0.0)
    world.set(robot_radius=0.25, occupied_threshold=99)
    try:
        world.caller.call(START, GOAL)
        known = [
            world.client.get_parameter(name).value
            for name in ('occupied_threshold', 'robot_radius')
        ]
    finally:
        world.set(robot_radius=0.0, occupied_threshold=65)
    assert known == [99, 0.25]


def test_the_last_path_is_checked_on_a_new_map_and_replanned_only_if_broken(world):
    forget(world)
    path, report, _ = world.caller.call(START, GOAL)
    planned = f'planned on map {report.map_digest}: {report.message}'
    wait_for(lambda: world.health().get('last_path') == planned, 'what was planned')
    world.caller._reports.clear()
    world.paths.clear()
    elsewhere = world.show((2, 28))
    wait_for(
        lambda: world.health().get('last_path') == f'the path stands on map {elsewhere.digest}',
        'the look at the path',
    )
    assert (world.reports, world.paths) == ([], [])
    x, y = map(int, path_from_message(path)[8])
    broken = world.show((x, y))
    report = world.wait_for_report(lambda report: 'replanned' in report.message, 'a new path')
    assert f'replanned on map {broken.digest}: it hits an obstacle at ({x}, {y})' in report.message
    assert (report.code, report.map_digest) == (0, broken.digest)
    wait_for(lambda: world.paths, 'the new path')
    cells = np.floor(path_from_message(world.paths[-1])).astype(int).tolist()
    assert [x, y] not in cells
    # The corners still hold: the client was asked once, for the first of the plans.
    assert len(world.client.asked) == 1
    assert 'kept from the plan on map' in report.source_detail
    world.show()


def test_a_request_that_fails_does_not_stop_the_replanning_of_a_broken_path(world):
    forget(world)
    path, _, _ = world.caller.call(START, GOAL)
    world.client.go.clear()
    world.client.asked.clear()
    # The first corner is lost too, so the client is asked, and keeps the replanning waiting.
    broken = world.show((19, 26), tuple(map(int, path_from_message(path)[8])))
    wait_for(lambda: world.client.asked, 'the question to the client')
    assert world.caller.call(START, Pose2D(-50.0, 0.0))[1].code_name == 'GOAL_OUTSIDE_MAP'
    world.client.go.set()
    report = world.wait_for_report(lambda report: 'replanned' in report.message, 'a new path')
    assert (report.code, report.map_digest) == (0, broken.digest)
    world.show()


def test_the_way_is_kept_from_call_to_call_and_the_report_says_why_it_changes(world):
    forget(world)
    world.set(switch_margin=0.05, use_waypoints=False)
    narrow = [(20, 25)]
    try:
        world.show(*narrow)
        first = world.caller.call(START, GOAL)[0]
        # The wider gap saves less than 5 %.
        world.show()
        way = path_from_message(first)
        on_it = Pose2D(*way[6], 0.0)
        path, report, _ = world.caller.call(on_it, GOAL)
        assert 'kept: at most ' in report.message
        assert path_from_message(path)[1:] == pytest.approx(way[7:])
        wait_for(lambda: len(world.paths) == 2, 'both paths')
        # Another goal has a way of its own, and so has each way to ask.
        assert 'kept' not in world.caller.call(on_it, OTHER_GOAL)[1].message
        x, y = (int(value) for value in way[12])
        world.show((x, y))
        path, report, _ = world.caller.call(on_it, GOAL)
        assert f'changed: blocked at ({x + 0.5:.2f}, {y + 0.5:.2f})' in report.message
        assert report.code == 0
    finally:
        world.set(switch_margin=0.0, use_waypoints=True)
        world.show()
    assert 'kept' not in world.caller.call(on_it, GOAL)[1].message


def test_a_smooth_path_has_no_kink_and_begins_at_the_robot_even_in_an_obstacle(world):
    forget(world)
    world.set(any_angle=True, smoothing=True, start_tolerance=2.0)
    try:
        path = world.caller.call(START, GOAL)[0]
        turns = (np.diff(yaws(path)[1:-1]) + np.pi) % (2.0 * np.pi) - np.pi
        assert np.degrees(np.abs(turns)).max() < 20.0
        world.show((5, 5))
        path, report, _ = world.caller.call(START, GOAL)
        assert report.start_shift > 0.0
        assert path_from_message(path)[0] == pytest.approx(START[:2])
    finally:
        world.set(any_angle=False, smoothing=False, start_tolerance=0.25)
        world.show()


def test_replan_on_map_replans_a_path_that_is_still_valid(world):
    forget(world)
    world.set(replan_on_map=True)
    try:
        world.caller.call(START, GOAL)
        world.show((2, 27))
        report = world.wait_for_report(lambda report: 'replanned' in report.message, 'a new path')
    finally:
        world.set(replan_on_map=False)
    assert 'replan_on_map is set' in report.message
    assert report.code == 0
    world.show()


def test_a_path_that_cannot_be_replanned_is_reported_with_its_code(world):
    forget(world)
    world.caller.call(START, GOAL)
    world.show(*[(20, y) for y in range(25, 30)])
    report = world.wait_for_report(lambda report: 'replanned' in report.message, 'the report')
    assert report.code_name == 'NO_VALID_PATH'
    wait_for(lambda: world.health().get('last_path') == report.message, 'the end of the path')
    world.caller._reports.clear()
    # There is no path left to look at.
    world.show((2, 26), *[(20, y) for y in range(25, 30)])
    world.show()
    assert world.reports == []


def test_paths_end_with_the_orientation_of_the_goal_or_of_their_last_move(world):
    goal_yaw = yaws(world.caller.call(START, GOAL)[0])[-1]
    assert goal_yaw == pytest.approx(GOAL.yaw)
    world.set(use_final_approach_orientation=True)
    try:
        arriving = yaws(world.caller.call(START, GOAL)[0])
        here = Pose2D(*START[:2], 0.7)
        staying = world.caller.call(here, Pose2D(*START[:2], 2.0))[0]
    finally:
        world.set(use_final_approach_orientation=False)
    assert arriving[-1] == pytest.approx(arriving[-2])
    assert yaws(staying) == pytest.approx([0.7])
    turning = world.caller.call(START, Pose2D(*START[:2], 2.0))[0]
    assert yaws(turning) == pytest.approx([2.0])


def test_diagnostics_tell_the_state_of_the_planner(world):
    world.caller.call(START, GOAL)
    wait_for(lambda: world.health().get('landmarks'), 'the health')
    health = world.health()
    assert health['active'] is True
    assert health['llm_client_ready'] is True
    assert health['map_age'] > 0.0
    assert health['landmark_builds'] >= 1


def test_map_updates_change_the_map_and_malformed_ones_do_not(world):
    messages = pytest.importorskip('map_msgs.msg')
    publisher = world.caller.node.create_publisher(
        messages.OccupancyGridUpdate, 'map_updates', RELIABLE
    )
    wait_for(publisher.get_subscription_count, 'map_updates')
    update = messages.OccupancyGridUpdate(x=2, y=3, width=2, height=1, data=[100, -1])
    cells = CELLS.copy()
    cells[3, 2:4] = (100, -1)
    after = GridMap(cells).digest
    publisher.publish(update)
    world.caller.wait_until_ready(after)
    publisher.publish(messages.OccupancyGridUpdate(x=39, y=0, width=2, height=1, data=[0, 0]))
    publisher.publish(messages.OccupancyGridUpdate(x=0, y=0, width=1, height=1, data=[100]))
    cells[0, 0] = 100
    world.caller.wait_until_ready(GridMap(cells).digest)
    # The whole map overtakes an update that it holds already; the next one counts.
    whole = grid_to_message(GridMap(CELLS), Time(sec=7))
    world.maps.publish(whole)
    world.caller.wait_until_ready(GridMap(CELLS).digest)
    for sec, x in ((6, 1), (8, 2)):
        late = messages.OccupancyGridUpdate(x=x, y=0, width=1, height=1, data=[100])
        late.header.stamp.sec = sec
        publisher.publish(late)
    after = CELLS.copy()
    after[0, 2] = 100
    world.caller.wait_until_ready(GridMap(after).digest)
    world.show()


def change_state(caller, transition):
    client = caller.node.create_client(ChangeState, 'planner_node/change_state')
    request = ChangeState.Request(transition=Transition(id=transition))
    return caller.ask(client, request, PATIENCE).success


def state(caller):
    client = caller.node.create_client(GetState, 'planner_node/get_state')
    return caller.ask(client, GetState.Request(), PATIENCE).current_state.label


def test_a_managed_node_answers_while_it_is_active_and_says_why_not_otherwise():
    node = node_of(MANAGED, autostart=False, llm_client='')
    with running(node), calling(MANAGED) as caller:
        assert state(caller) == 'unconfigured'
        assert caller.node.count_publishers('plan') == 0
        maps = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        maps.publish(grid_to_message(GridMap(CELLS), Time()))
        for _ in range(2):
            assert change_state(caller, Transition.TRANSITION_CONFIGURE)
            caller.wait_until_ready(GridMap(CELLS).digest)
            path, report, _ = caller.call(START, GOAL)
            assert (report.code_name, path.poses) == ('UNKNOWN', [])
            assert 'not active' in report.message
            assert change_state(caller, Transition.TRANSITION_ACTIVATE)
            assert caller.call(START, GOAL)[1].code == 0
            assert change_state(caller, Transition.TRANSITION_DEACTIVATE)
            assert 'not active' in caller.call(START, GOAL)[1].message
            assert change_state(caller, Transition.TRANSITION_CLEANUP)
            wait_for(lambda: not caller.node.count_publishers('plan'), 'its leaving')
            caller._health.clear()
        assert change_state(caller, Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
        assert state(caller) == 'finalized'


def test_a_managed_node_tells_its_state_while_a_parameter_waits_for_the_map(monkeypatch):
    waits, go = threading.Event(), threading.Event()

    def refresh(_):
        waits.set()
        go.wait(PATIENCE)

    monkeypatch.setattr(MapManager, 'refresh', refresh)
    node = node_of(WAITING, autostart_node=False, llm_client='')
    with running(node), calling(WAITING) as caller:
        assert change_state(caller, Transition.TRANSITION_CONFIGURE)
        setting = threading.Thread(
            target=set_parameter, args=(caller, 'planner_node', 'robot_radius', 0.1)
        )
        setting.start()
        assert waits.wait(PATIENCE)
        assert state(caller) == 'inactive'
        go.set()
        setting.join()


def test_a_map_that_is_ready_after_the_shutdown_is_left_alone():
    context = rclpy.Context()
    rclpy.init(context=context)
    node = node_of('/map_too_late', context=context, autostart=False)
    node.trigger_configure()
    context.shutdown()
    node._server.on_planner(Planner(GridMap(CELLS)))
    node.destroy_node()


def test_a_path_planned_before_a_deactivation_is_not_replanned_after_it():
    node = node_of(AGAIN, autostart=False, llm_client='')
    with running(node), calling(AGAIN) as caller:
        maps = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        maps.publish(grid_to_message(GridMap(CELLS), Time()))
        node.trigger_configure()
        node.trigger_activate()
        caller.wait_until_ready(GridMap(CELLS).digest)
        path, _, _ = caller.call(START, GOAL)
        node.trigger_deactivate()
        node.trigger_activate()
        broken = CELLS.copy()
        x, y = map(int, path_from_message(path)[8])
        broken[y, x] = 100
        maps.publish(grid_to_message(GridMap(broken), Time()))
        caller.wait_until_ready(GridMap(broken).digest)
        # The replanning would have come before this answer, or cut it short.
        caller.call(START, OTHER_GOAL)
        assert [
            one.message for _, one in caller._reports.values() if 'replan' in one.message
        ] == []


def test_the_parameter_makes_it_a_managed_node_which_outlives_a_wrong_transition():
    with (
        process('planner_node', '-p', 'autostart:=false', namespace=APART) as planner,
        calling(APART) as caller,
    ):
        wait_for(lambda: 'ready to be configured' in ''.join(planner.output), 'the node')
        assert not change_state(caller, Transition.TRANSITION_ACTIVATE)
        assert state(caller) == 'unconfigured'
        assert change_state(caller, Transition.TRANSITION_CONFIGURE)
        assert change_state(caller, Transition.TRANSITION_ACTIVATE)
        assert 'no map' in caller.call(START, GOAL)[1].message
    assert planner.returncode == 0
    assert 'Traceback' not in ''.join(planner.output)


def test_a_caller_waits_for_the_report_of_its_own_call():
    """Another plan at the same simulated time, before the simulation began anew, has its stamp."""
    node = rclpy.create_node('planner_node', namespace=SIMULATED)
    reports = node.create_publisher(DiagnosticArray, '~/report', REPORTS)
    stamp = Time(sec=100)

    def publish(message):
        plan = Plan(ResultCode.NONE, message, '', (0, 0), (0, 0), np.zeros((0, 0), dtype=bool))
        reports.publish(report_to_message(plan_report(plan, None), 'planner_node', stamp))

    def answer(_, response):
        response.plan.header.stamp = stamp
        threading.Timer(0.3, publish, ['of the call']).start()
        return response

    node.create_service(GetPlan, '~/get_plan', answer)
    with running(node), calling(SIMULATED) as caller:
        publish('of the plan before')
        wait_for(lambda: caller._reports, 'the first report')
        assert caller.call(START, GOAL)[1].message == 'of the call'


def test_stamps_of_plans_differ_when_a_simulation_begins_anew():
    node = node_of(SIMULATED, use_sim_time=True, llm_client='')
    with running(node), calling(SIMULATED) as caller:
        wait_for(lambda: node._server, 'its start')
        clock = caller.node.create_publisher(Clock, '/clock', LATCHED)
        stamps = []
        for seconds in (100, 200, 100):
            clock.publish(Clock(clock=Time(sec=seconds)))
            wait_for(lambda at=seconds: node.get_clock().now().nanoseconds == at * 10**9, 'time')
            stamps += [node._server.handler.next_stamp() for _ in range(2)]
    assert [(stamp.sec, stamp.nanosec) for stamp in stamps] == [
        (100, 0), (100, 1), (200, 0), (200, 1), (100, 2), (100, 3)
    ]  # fmt: skip

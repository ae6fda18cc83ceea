"""The live graph: real processes, real DDS, and the faults a robot meets."""

import csv
import json
import signal
import subprocess
import sys
import threading
import time
from operator import itemgetter

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from graph_tools import (
    ALONE,
    DEMO,
    GOAL,
    PATIENCE,
    REPLAY,
    START,
    calling,
    in_this_process,
    process,
    set_parameter,
    wait_for,
)
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import grid_from_message, path_from_message
from llm_astar_msgs_adapter.messages.writing import grid_to_message, pose_to_message
from llm_astar_planner.cli.main import main
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE
from llm_astar_planner.nodes.planner.waypoint_client import WaypointClient
from llm_astar_planner.nodes.tools.planner_client import PlannerClientError
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.resources import find_file
from nav_msgs.msg import OccupancyGrid, Path
from nav_msgs.srv import GetMap
from rcl_interfaces.srv import DescribeParameters

LABEL = 'replay:hand-written example'
# This process takes a client that was killed for present, until DDS misses it.
KILLED = '/killed'


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture(scope='module')
def nodes(_context):
    with (
        process('map_node') as map_node,
        process('llm_client_node') as client,
        process('planner_node') as planner,
    ):
        yield {'map': map_node, 'client': client, 'planner': planner}
    for node in (map_node, client, planner):
        assert node.returncode == 0, ''.join(node.output)
        assert 'Traceback' not in ''.join(node.output)


@pytest.fixture(scope='module')
def caller(nodes):
    with calling() as caller:
        caller.wait_until_ready(client='llm_client_node')
        yield caller


def test_another_stack_gets_a_plan_that_says_what_guided_it(caller):
    path, report, _ = caller.call(START, GOAL)
    barrier_map = load_barrier_maps(find_file('demo.json', 'maps'))[0]
    expected = Planner.for_barrier_map(barrier_map).plan(PlanRequest((39, 18), (7, 19), 'astar'))
    assert report.code == 0
    assert report.guided_by == LABEL
    assert report.source_status == 'OK'
    assert [verdict for *_, verdict in report.waypoints] == ['accepted'] * 5
    assert report.waypoints[1][:2] == pytest.approx((31.0, 10.0))
    assert report.operation == 49
    assert report.length == pytest.approx(expected.length)
    points = path_from_message(path)
    assert points[0] == pytest.approx(START[:2])
    assert points[-1] == pytest.approx(GOAL[:2])
    assert np.hypot(*np.diff(points, axis=0).T).sum() == pytest.approx(report.length)
    assert {pose.header.frame_id for pose in path.poses} == {'map'}
    assert report.map_digest == barrier_map.to_grid().digest


def test_a_subscriber_that_joins_late_gets_the_map(caller):
    maps = []
    caller.node.create_subscription(OccupancyGrid, 'map', maps.append, LATCHED)
    wait_for(lambda: maps, 'the latched map')
    service = caller.node.create_client(GetMap, 'map_node/map')
    served = caller.ask(service, GetMap.Request()).map
    assert grid_from_message(maps[0]).digest == grid_from_message(served).digest


def test_four_clients_at_once_all_get_their_plans(nodes):
    reports, errors = [], []

    def work():
        try:
            with calling() as caller:
                caller.wait_until_ready(client='llm_client_node')
                for _ in range(5):
                    reports.append(caller.call(START, GOAL, seconds=PATIENCE)[1])
        except PlannerClientError as error:
            errors.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(2 * PATIENCE)
    assert errors == []
    assert len(reports) == 20
    assert {(report.code, report.guided_by, report.operation) for report in reports} == {
        (0, LABEL, 49)
    }


def test_rviz_buttons_plan_and_a_goal_without_a_start_says_so(caller):
    paths = []
    caller.node.create_subscription(Path, 'plan', paths.append, RELIABLE)
    goal = caller.node.create_publisher(PoseStamped, 'goal_pose', RELIABLE)
    initial = caller.node.create_publisher(PoseWithCovarianceStamped, 'initialpose', RELIABLE)
    wait_for(lambda: goal.get_subscription_count() and initial.get_subscription_count(), 'RViz')
    wait_for(lambda: caller.node.count_publishers('plan'), 'plan')

    def codes():
        return [report.code_name for _, report in list(caller._reports.values())]

    goal.publish(pose_to_message(GOAL, 'map', Time()))
    wait_for(lambda: 'TF_ERROR' in codes(), 'the report of a goal without a start')
    pose = pose_to_message(START, 'map', Time())
    start = PoseWithCovarianceStamped(header=pose.header)
    start.pose.pose = pose.pose
    initial.publish(start)
    deadline = time.monotonic() + PATIENCE
    while not paths and time.monotonic() < deadline:
        goal.publish(pose_to_message(GOAL, 'map', Time()))
        time.sleep(0.5)
    assert paths
    assert path_from_message(paths[0])[-1] == pytest.approx(GOAL[:2])
    assert paths[0].header.frame_id == 'map'


@pytest.mark.parametrize(
    ('start', 'goal', 'frame', 'code'),
    [
        (START, GOAL, 'odom', 'TF_ERROR'),
        (Pose2D(-9.0, 3.0), GOAL, 'map', 'START_OUTSIDE_MAP'),
        (START, Pose2D(60.0, 3.0), 'map', 'GOAL_OUTSIDE_MAP'),
        (Pose2D(20.0, 15.0), GOAL, 'map', 'START_OCCUPIED'),
        (START, Pose2D(0.0, 0.0), 'map', 'GOAL_OCCUPIED'),
        (Pose2D(float('nan'), 3.0), GOAL, 'map', 'START_OUTSIDE_MAP'),
    ],
)
def test_a_request_that_cannot_be_met_gets_its_code_and_an_empty_path(
    caller, start, goal, frame, code
):
    path, report, _ = caller.call(start, goal, frame)
    assert report.code_name == code
    assert report.message
    assert path.poses == []


def test_an_empty_frame_means_the_frame_of_the_map(caller):
    assert caller.call(START, GOAL, '')[1].code == 0


def test_parameters_are_checked_when_set_and_the_reason_names_the_choices(caller):
    for node, name, value, word in [
        ('planner_node', 'method', 'theta', 'dynamic_weighted_astar'),
        ('planner_node', 'max_planning_time', -1.0, 'max_planning_time'),
        ('planner_node', 'max_planning_time', 'soon', 'Wrong parameter type'),
        ('planner_node', 'llm_client', 'other', 'llm_client'),
        ('llm_client_node', 'source', 'oracle9', 'replay'),
        ('llm_client_node', 'transcript', 'nowhere.jsonl', 'transcript: is fixed'),
        ('map_node', 'map_file', 'nowhere.json', 'demo.json'),
        ('map_node', 'map_id', 99, 'holds 0, 1, 2'),
    ]:
        result = set_parameter(caller, node, name, value)
        assert not result.successful, (name, value)
        assert word in result.reason
    assert caller.call(START, GOAL)[1].operation == 49


def test_parameters_are_described(caller):
    client = caller.node.create_client(DescribeParameters, 'planner_node/describe_parameters')
    names = ['method', 'max_planning_time', 'occupied_threshold', 'llm_client']
    request = DescribeParameters.Request(names=names)
    method, limit, threshold, llm_client = caller.ask(client, request).descriptors
    assert 'llm_astar' in method.additional_constraints
    assert limit.floating_point_range[0].from_value > 0
    assert threshold.integer_range[0].to_value == 100
    assert llm_client.read_only
    assert all(item.description for item in (method, limit, threshold, llm_client))


def test_a_changed_method_counts_from_the_next_plan(caller):
    assert set_parameter(caller, 'planner_node', 'method', 'astar').successful
    try:
        report = caller.call(START, GOAL)[1]
        assert (report.method, report.operation, report.guided_by) == ('astar', 721, 'none')
    finally:
        assert set_parameter(caller, 'planner_node', 'method', 'llm_astar').successful


def test_guided_plans_are_bounded_and_their_raw_path_is_published_too(caller):
    plans, raw = [], []
    caller.node.create_subscription(Path, 'plan', plans.append, RELIABLE)
    caller.node.create_subscription(Path, 'planner_node/raw_plan', raw.append, RELIABLE)
    wait_for(lambda: caller.node.count_publishers('planner_node/raw_plan'), 'raw_plan')
    changes = {'method': 'guided', 'search_while_waiting': False, 'any_angle': True}
    try:
        for name, value in changes.items():
            assert set_parameter(caller, 'planner_node', name, value).successful
        assert not set_parameter(caller, 'planner_node', 'max_suboptimality', 0.5).successful
        path, report, _ = caller.call(START, GOAL)
        deadline = time.monotonic() + PATIENCE
        while not (plans and raw) and time.monotonic() < deadline:
            path, report, _ = caller.call(START, GOAL)
            time.sleep(0.2)
    finally:
        for name, value in {'method': 'llm_astar', 'any_angle': False}.items():
            assert set_parameter(caller, 'planner_node', name, value).successful
    assert (report.code, report.guided_by) == (0, LABEL)
    assert 1.0 <= report.ratio <= 1.1
    assert 0 < report.first_operation <= report.operation
    straight = path_from_message(path)
    cells = path_from_message(raw[-1])
    lengths = [np.hypot(*np.diff(points, axis=0).T).sum() for points in (straight, cells)]
    assert lengths[0] < lengths[1]
    assert lengths[1] == pytest.approx(report.length)
    assert straight[0] == pytest.approx(START[:2])
    assert straight[-1] == pytest.approx(GOAL[:2])


def test_with_the_defaults_a_plan_does_not_wait_for_waypoints(caller):
    """By default guided does not wait: what comes too late is told, and a plan there is."""
    set_parameter(caller, 'planner_node', 'search_while_waiting', True)
    assert set_parameter(caller, 'planner_node', 'method', 'guided').successful
    try:
        report = caller.call(START, GOAL)[1]
    finally:
        assert set_parameter(caller, 'planner_node', 'method', 'llm_astar').successful
    assert report.code == 0
    assert report.ratio <= 1.1
    assert report.source_status in ('OK', 'LATE')
    assert (report.guided_by == LABEL) == bool(report.waypoints and report.operation)


def test_a_map_changed_by_parameter_reaches_the_planner(caller):
    maps = load_barrier_maps(find_file('demo.json', 'maps'))
    assert set_parameter(caller, 'map_node', 'map_id', 1).successful
    try:
        caller.wait_until_ready(maps[1].to_grid().digest, client='llm_client_node')
        report = caller.call(Pose2D(6.0, 22.0), Pose2D(41.0, 5.0))[1]
        assert (report.code, report.guided_by, report.operation) == (0, LABEL, 47)
    finally:
        assert set_parameter(caller, 'map_node', 'map_id', 0).successful
        caller.wait_until_ready(maps[0].to_grid().digest, client='llm_client_node')


def free_map(width):
    return GridMap(np.zeros((20, width), dtype=np.int8))


def now(caller):
    return caller.node.get_clock().now().to_msg()


def test_a_malformed_map_is_refused_and_the_last_good_one_stays():
    with process('planner_node', namespace=ALONE) as planner, calling(ALONE) as caller:
        publisher = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        good = free_map(30)
        publisher.publish(grid_to_message(good, now(caller)))
        caller.wait_until_ready(good.digest)
        broken = grid_to_message(free_map(40), now(caller))
        broken.info.resolution = 0.0
        publisher.publish(broken)
        wait_for(lambda: 'map refused' in ''.join(planner.output), 'the refusal')
        report = caller.call(Pose2D(3.0, 3.0), Pose2D(15.0, 15.0))[1]
        assert (report.code, report.map_digest) == (0, good.digest)
        better = free_map(50)
        publisher.publish(grid_to_message(better, now(caller)))
        caller.wait_until_ready(better.digest)
    assert planner.returncode == 0


def test_a_caller_before_the_first_map_gets_the_reason():
    with in_this_process('planner_node', namespace=ALONE), calling(ALONE) as caller:
        caller.wait_for_planner(PATIENCE)
        path, report, _ = caller.call(START, GOAL)
        assert (report.code_name, path.poses) == ('TIMEOUT', [])
        assert 'no map' in report.message


def test_a_client_killed_mid_call_never_stops_the_plan(monkeypatch):
    """The client falls silent while asked, a map arrives meanwhile, and then it is killed."""
    asked, ask = threading.Event(), WaypointClient.ask
    monkeypatch.setattr(WaypointClient, 'ask', lambda *some: asked.set() or ask(*some))
    patient = ['-p', 'source_timeout:=30.0', '-p', 'max_planning_time:=60.0']
    with (
        process('llm_client_node', namespace=KILLED) as client,
        in_this_process('planner_node', *patient, namespace=KILLED),
        calling(KILLED) as caller,
        calling(KILLED) as other,
    ):
        publisher = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        old, new = free_map(30), free_map(31)
        publisher.publish(grid_to_message(old, now(caller)))
        caller.wait_until_ready(old.digest, client='llm_client_node')
        assert caller.call(Pose2D(3.0, 3.0), Pose2D(15.0, 15.0))[1].source_status == 'MISSING'
        assert set_parameter(caller, 'planner_node', 'source_timeout', 5.0).successful
        client.send_signal(signal.SIGSTOP)
        asked.clear()
        answers = []
        asking = threading.Thread(
            target=lambda: answers.append(caller.call(Pose2D(3.0, 3.0), Pose2D(15.0, 15.0)))
        )
        asking.start()
        # The request has its map when it asks.
        assert asked.wait(PATIENCE)
        publisher.publish(grid_to_message(new, now(caller)))
        other.wait_until_ready(new.digest)
        assert answers == []
        client.send_signal(signal.SIGKILL)
        asking.join(PATIENCE)
        path, report, _ = answers[0]
        assert report.code == 0
        assert len(path.poses) == 13
        assert report.map_digest == old.digest
        assert report.guided_by == 'none'
        assert report.source_status in ('TIMEOUT', 'UNREACHABLE')
        assert 'llm_client' in report.source_detail
        assert set_parameter(caller, 'planner_node', 'source_timeout', 0.5).successful
        assert caller.call(Pose2D(3.0, 3.0), Pose2D(15.0, 15.0))[1].map_digest == new.digest


def test_a_graph_without_a_client_plans_and_says_so():
    with (
        in_this_process('map_node', namespace=ALONE),
        in_this_process('planner_node', namespace=ALONE),
        calling(ALONE) as caller,
    ):
        caller.wait_until_ready()
        report = caller.call(START, GOAL)[1]
        assert (report.code, report.guided_by) == (0, 'none')
        assert report.source_status == 'UNREACHABLE'
        assert report.operation == 439


def test_names_follow_the_namespace():
    with (
        process('map_node', namespace='/robot1'),
        process('llm_client_node', namespace='/robot1'),
        process('planner_node', namespace='/robot1'),
        calling('/robot1') as caller,
    ):
        caller.wait_until_ready(client='llm_client_node')
        assert caller.call(START, GOAL)[1].guided_by == LABEL


@pytest.mark.parametrize('name', ['map_node', 'llm_client_node', 'planner_node'])
@pytest.mark.parametrize('ending', [signal.SIGINT, signal.SIGTERM])
def test_a_node_ends_cleanly(name, ending):
    with process(name, namespace=ALONE) as node:
        ready = 'published' if name == 'map_node' else 'ready'
        wait_for(lambda: ready in ''.join(node.output), name)
        node.send_signal(ending)
        node.send_signal(ending)
        assert node.wait(PATIENCE) == 0
    assert 'Traceback' not in ''.join(node.output)


@pytest.mark.parametrize(
    ('name', 'parameter', 'words'),
    [
        ('map_node', 'map_file:=nowhere.json', ['nowhere.json', 'demo.json']),
        ('map_node', 'resolution:=-1.0', ['resolution']),
        ('llm_client_node', 'source:=oracle9', ['source', 'oracle9', 'replay']),
        ('planner_node', 'method:=theta', ['method', 'theta', 'llm_astar']),
        ('planner_node', 'weight:=heavy', ['weight']),
        ('planner_node', 'robot_raduis:=0.2', ['robot_raduis', 'did you mean robot_radius?']),
        ('llm_client_node', 'modell:=x', ['modell', 'did you mean model?']),
        ('map_node', 'map_fil:=x', ['map_fil', 'did you mean map_file?']),
    ],
)
def test_an_impossible_parameter_is_one_line_at_start(name, parameter, words):
    with process(name, '-p', parameter, namespace=ALONE) as node:
        assert node.wait(PATIENCE) == 2
    output = ''.join(node.output)
    assert 'Traceback' not in output
    for word in words:
        assert word in output


def test_a_node_refuses_names_of_other_nodes_in_its_own_section_only(tmp_path):
    own, shared = tmp_path / 'own.yaml', tmp_path / 'shared.yaml'
    own.write_text('/**/map_node: {ros__parameters: {base_url: x}}')
    shared.write_text(
        '/**: {ros__parameters: {base_url: x, weight: 3.0, use_sim_time: false, '
        'robot_description: x, plugin: {type: y}}}'
    )
    with process('map_node', '--params-file', str(shared), namespace=ALONE) as node:
        wait_for(lambda: 'published' in ''.join(node.output), 'the map')
    assert node.returncode == 0
    with process('map_node', '--params-file', str(own), namespace=ALONE) as node:
        assert node.wait(PATIENCE) == 2
    assert 'base_url: map_node has no parameter of this name' in ''.join(node.output)


ROBOT = """
/**/planner_node:
  ros__parameters:
    method: guided
    search_while_waiting: false
    max_suboptimality: 1.0
    corner_cutting: false
    robot_radius: 1.0
    inflation_radius: 3.0
    cost_scaling_factor: 1.5
    cost_travel_multiplier: 5.0
"""


def test_a_plan_of_the_node_is_reproduced_by_one_command_line(capsys, tmp_path):
    robot = tmp_path / 'robot.yaml'
    robot.write_text(ROBOT)
    files = [part for file in (DEMO, REPLAY, robot) for part in ('--params-file', str(file))]
    capsys.readouterr()
    assert main(['plan', *files, '--json']) == 0
    plan = json.loads(capsys.readouterr().out)
    with (
        in_this_process('map_node', namespace=ALONE),
        in_this_process('llm_client_node', namespace=ALONE),
        in_this_process('planner_node', '--params-file', str(robot), namespace=ALONE),
        calling(ALONE) as caller,
    ):
        caller.wait_until_ready(client='llm_client_node')
        caller.wait_for_landmarks()
        deadline = time.monotonic() + PATIENCE
        path, report, _ = caller.call(START, GOAL)
        # While the landmarks are repaired for a newer map a plan goes without them.
        while report.operation != plan['operation'] and time.monotonic() < deadline:
            path, report, _ = caller.call(START, GOAL)
    # A cell of the demo map is a metre wide, and its centre is at whole metres.
    assert plan['path'] == np.rint(path_from_message(path)).astype(int).tolist()
    assert len(plan['path']) > 40
    waypoints = [(point['x'], point['y'], point['verdict']) for point in plan['waypoints']]
    assert waypoints == list(report.waypoints) != []
    for name in ('operation', 'first_operation', 'storage', 'ratio', 'guided_by', 'clearance'):
        assert plan[name] == getattr(report, name), name


@pytest.mark.parametrize(
    ('arguments', 'word'),
    [
        (['--params-file', 'nowhere.yaml'], 'nowhere.yaml'),
        (['--bogus'], "unknown ROS arguments: ['--bogus']"),
    ],
)
def test_arguments_that_ros_cannot_read_are_one_line_too(arguments, word):
    with process('map_node', *arguments, namespace=ALONE) as node:
        assert node.wait(PATIENCE) == 2
    output = ''.join(node.output)
    assert 'Traceback' not in output
    assert word in output


def run_benchmark_node(*arguments, code=('-m', 'llm_astar_lab.nodes.benchmark_node')):
    command = [sys.executable, *code, *arguments, '--ros-args', '-r', f'__ns:={ALONE}']
    return subprocess.run(command, capture_output=True, text=True, timeout=3 * PATIENCE)


def rows_of(folder):
    """Return the rows of a results folder without what a clock decides."""
    clocks = ('seconds_source', 'seconds_search', 'seconds_round_trip')
    with (folder / 'results.csv').open() as file:
        return [
            {name: value for name, value in row.items() if name not in clocks}
            for row in csv.DictReader(file)
        ]


def test_the_live_benchmark_gives_the_rows_of_the_benchmark_without_a_graph(tmp_path, monkeypatch):
    """Row for row, through GetPlan: what the graph adds is time alone."""
    live, direct = tmp_path / 'live', tmp_path / 'direct'
    selection = ['--limit', '6', '--map-ids', '0-3', '--methods', 'llm_astar']
    with (
        in_this_process('llm_client_node', '-p', 'source:=oracle', namespace=ALONE),
        in_this_process('planner_node', '-p', 'method:=weighted_astar', namespace=ALONE),
        calling(ALONE) as caller,
    ):
        done = run_benchmark_node(*selection, '--out', str(live))
        assert done.returncode == 0, done.stderr
        # The planner is left as it was found.
        caller.wait_until_ready()
        assert caller.call(Pose2D(3.0, 3.0), Pose2D(4.0, 4.0))[1].method == 'weighted_astar'
        again = run_benchmark_node(*selection, '--out', str(live), '--resume')
        assert again.returncode == 0, again.stderr
    assert main(['bench', *selection, '--source', 'oracle', '--out', str(direct)]) == 0
    rows = rows_of(live)
    keys = {(row['method'], row['source']) for row in rows}
    assert keys == {('astar', 'none'), ('llm_astar', 'none'), ('llm_astar', 'oracle')}
    assert len(rows) == 18
    order = itemgetter('map', 'pair', 'method', 'source')
    expected = [row for row in rows_of(direct) if (row['method'], row['source']) in keys]
    assert sorted(rows, key=order) == sorted(expected, key=order)
    summary = json.loads((live / 'summary.json').read_text())
    assert all(case['seconds_round_trip']['p95'] > 0 for case in summary['cases'])


def test_the_benchmark_node_without_a_planner_says_so_and_loses_nothing(tmp_path):
    impatient = """
from llm_astar_lab.nodes import benchmark_node
from llm_astar_planner.nodes.tools import planner_client as caller
caller.PlannerClient.wait_for_planner.__defaults__ = (0.5,)
raise SystemExit(benchmark_node.main())
"""
    arguments = ['--limit', '2', '--out', str(tmp_path / 'out')]
    done = run_benchmark_node(*arguments, code=('-c', impatient))
    assert done.returncode == 3
    assert 'planner_node' in done.stderr
    assert 'Traceback' not in done.stderr


def test_the_benchmark_node_without_a_dataset_names_the_available_ones():
    module = 'llm_astar_lab.nodes.benchmark_node'
    done = subprocess.run(
        [sys.executable, '-m', module, '--dataset', 'nowhere.json'], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert 'demo.json' in done.stderr
    assert 'Traceback' not in done.stderr

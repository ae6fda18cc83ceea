"""The graph with a language model: a real one on loopback, and a server that misbehaves."""

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from graph_tools import (
    ALONE,
    GOAL,
    START,
    calling,
    in_this_process,
    process,
    set_parameter,
    spinning,
    wait_for,
)
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.report import ExchangeReport, report_from_message
from llm_astar_msgs_adapter.messages.writing import grid_to_message, pose_to_message
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE, REPORTS
from llm_astar_planner.nodes.llm_client_node import LlmClientNode, NoMapError
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.planning.parameters import FIXED
from llm_astar_planner.waypoints.transcript import read_transcript
from local_llm import LocalLlm, needs_llm
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetPlan
from rcl_interfaces.msg import Log, ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import Parameter

HOUSE = Path(__file__).resolve().parents[1] / 'maps' / 'instructions' / 'house.yaml'
KEY = 'planted-secret-0123456789'
KEY_ENV = 'LLM_ASTAR_TEST_API_KEY'
GOOD = 'Generated Path: [[39, 18], [31, 10], [27, 9], [12, 9], [7, 19]]'


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


def endpoint(base_url, **parameters):
    """Return the arguments of an llm_client_node that asks an endpoint."""
    values = {
        'source': 'endpoint',
        'base_url': base_url,
        'api_key_env': KEY_ENV,
        'model': 'test-model',
        'transcript': '',
        'dataset': '',
        **parameters,
    }
    return [word for name, value in values.items() for word in ('-p', f'{name}:={value!r}')]


def graph(client_arguments, *planner_arguments, kind=in_this_process):
    return (
        kind('map_node', namespace=ALONE),
        kind('llm_client_node', *client_arguments, namespace=ALONE),
        kind('planner_node', *planner_arguments, namespace=ALONE),
        calling(ALONE),
    )


def ask_client(caller):
    """Call the client node as the planner does, and return its exchange."""
    service = caller.node.create_client(GetPlan, 'llm_client_node/get_waypoints')
    request = GetPlan.Request(
        start=pose_to_message(START, 'map', Time()), goal=pose_to_message(GOAL, 'map', Time())
    )
    stamp = caller.ask(service, request, 150.0).plan.header.stamp
    found = []

    def keep(message):
        if message.header.stamp == stamp:
            found.append(report_from_message(message, ExchangeReport))

    exchanges = caller.node.create_subscription(
        DiagnosticArray, 'llm_client_node/exchange', keep, REPORTS
    )
    wait_for(lambda: found, 'the exchange')
    caller.node.destroy_subscription(exchanges)
    return found[0]


@needs_llm
def test_client_and_planner_with_a_real_model(monkeypatch):
    """Two prompts, structured output, a bearer key, 401 without it, and a plan with it all."""
    monkeypatch.setenv(KEY_ENV, KEY)
    slow = ['-p', 'max_planning_time:=200.0', '-p', 'source_timeout:=120.0']
    slow += ['-p', 'search_while_waiting:=false']
    answered = ('OK', 'NO_WAYPOINTS', 'MALFORMED')
    with LocalLlm(api_key_env=KEY_ENV) as server:
        limits = {'max_output_tokens': 24, 'timeout_s': 100.0, 'max_retries': 0}
        arguments = endpoint(server.base_url, fixed_endpoint=False, **limits)
        map_node, client, planner, caller = graph(arguments, *slow)
        with map_node, client, planner, caller as caller:
            caller.wait_until_ready(client='llm_client_node')
            # The shortest and the default one, whose beginning the model then has read already.
            for prompt in ('zero_shot', 'few_shot'):
                assert set_parameter(caller, 'llm_client_node', 'prompt', prompt).successful
                exchange = ask_client(caller)
                assert exchange.status in answered, exchange
                assert exchange.prompt == prompt
                assert exchange.text
                assert exchange.completion_tokens > 0
            for name, value in {'prompt': '', 'response_format': 'json_schema'}.items():
                assert set_parameter(caller, 'llm_client_node', name, value).successful
            report = caller.call(START, GOAL, seconds=200.0)[1]
            exchange = ask_client(caller)
            assert exchange.text.lstrip().startswith('{')
            again = caller.call(START, GOAL, seconds=200.0)[1]
            assert set_parameter(caller, 'llm_client_node', 'api_key_env', '').successful
            refused = caller.call(START, GOAL, seconds=200.0)[1]
    assert report.code == 0
    assert report.source_status in answered, report
    dropped = ('occupied', 'out_of_bounds')
    used = [verdict for *_, verdict in report.waypoints if verdict not in dropped]
    assert report.guided_by == ('endpoint:test-model' if used else 'none')
    # The second answer comes out of the cache.
    assert (again.waypoints, again.operation) == (report.waypoints, report.operation)
    assert again.seconds_source < report.seconds_source
    assert (refused.code, refused.guided_by, refused.source_status) == (0, 'none', 'AUTH')


# A wall whose only gap, three cells wide, costs 80.
GAP_OF_COST_80 = np.zeros((41, 61), dtype=np.int8)
GAP_OF_COST_80[:, 30] = 100
GAP_OF_COST_80[19:22, 30] = 80


@pytest.fixture
def client_node():
    """An llm_client_node in this process, whose callbacks the tests call."""
    parameters = {'source': 'oracle', 'transcript': '', 'dataset': '', 'fixed_endpoint': False}
    node = LlmClientNode(
        namespace=ALONE,
        parameter_overrides=[Parameter(name, value=value) for name, value in parameters.items()],
    )
    yield node
    node.destroy_node()


def ask_node(node, start=(10.5, 10.5), goal=(50.5, 38.5)):
    """Return the cells of the waypoints that a node in this process answers with."""
    request = GetPlan.Request(
        start=pose_to_message(Pose2D(*start), 'map', Time()),
        goal=pose_to_message(Pose2D(*goal), 'map', Time()),
    )
    plan = node.on_get_waypoints(request, GetPlan.Response(), time.monotonic()).plan
    return [(int(pose.pose.position.x), int(pose.pose.position.y)) for pose in plan.poses]


def set_on(node, **values):
    results = node.set_parameters([Parameter(name, value=value) for name, value in values.items()])
    return [result.reason for result in results if not result.successful]


def test_the_costmap_rules_of_the_client_decide_which_cells_its_waypoints_use(client_node):
    """A wall's only gap costs 80 and is three cells wide: open at 99, closed for a wide robot."""
    client_node.on_map(GridMap(GAP_OF_COST_80))
    assert ask_node(client_node) == []
    assert set_on(client_node, occupied_threshold=99) == []
    (corner,) = ask_node(client_node)
    assert Costmap(GridMap(GAP_OF_COST_80), CostmapConfig(99)).line_of_sight.clear_along(
        [(10, 10), corner, (50, 38)]
    )
    assert set_on(client_node, robot_radius=2.0) == []
    assert ask_node(client_node) == []
    assert 'occupied_threshold out of range' in set_on(client_node, occupied_threshold=0)[0]


def test_planner_and_client_use_the_same_cells_through_the_graph():
    """The planner gives the client its rules, so that the client's waypoints lead to the gap."""
    space = '/gap'
    given = {'source': 'oracle', 'transcript': '', 'dataset': ''}
    client = LlmClientNode(
        namespace=space,
        parameter_overrides=[Parameter(name, value=value) for name, value in given.items()],
    )
    rules = {'occupied_threshold': 99, 'search_while_waiting': False}
    planner = PlannerNode(
        namespace=space,
        parameter_overrides=[Parameter(name, value=value) for name, value in rules.items()],
    )
    start, goal = Pose2D(10.5, 10.5), Pose2D(50.5, 38.5)
    with spinning(client, planner), calling(space) as caller:
        maps = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)
        maps.publish(grid_to_message(GridMap(GAP_OF_COST_80), Time()))
        caller.wait_until_ready(client='llm_client_node')
        through = caller.call(start, goal)[1]
        assert set_parameter(caller, 'planner_node', 'occupied_threshold', 65).successful
        barred = caller.call(start, goal)[1]
    assert (through.code, through.source_status, through.guided_by) == (0, 'OK', 'oracle')
    assert [status for *_, status in through.waypoints] == ['accepted']
    assert (barred.code, barred.waypoints) == (208, ())


@pytest.mark.parametrize('name', FIXED)
def test_nobody_in_the_graph_can_change_where_a_key_is_sent_or_which_file_is_written(name):
    node = LlmClientNode(namespace=ALONE, parameter_overrides=[Parameter('source', value='none')])
    try:
        before = node.get_parameter(name).value
        (reason,) = set_on(node, **{name: 'http://attacker.example/v1'})
        assert reason.startswith(f'{name}: is fixed; start the node with `fixed_endpoint: false`')
        assert node.get_parameter(name).value == before
        assert set_on(node, source='oracle', timeout_s=2.0) == []
        assert len(set_on(node, fixed_endpoint=False)) == 1
        assert len(set_on(node, api_key_names='*')) == 1
    finally:
        node.destroy_node()


def test_other_costmap_rules_are_no_reason_for_a_new_source(client_node, chat_server):
    chat_server.script = [chat_server.completion('Generated Path: [[10, 10], [30, 20], [50, 38]]')]
    client_node.on_map(GridMap(np.zeros((41, 61), dtype=np.int8)))
    settings = {'source': 'endpoint', 'base_url': chat_server.base_url, 'timeout_s': 20.0}
    changes = [Parameter(name, value=value) for name, value in settings.items()]
    assert client_node.set_parameters_atomically(changes).successful
    for threshold in (65, 99, 65, 99):
        assert set_on(client_node, occupied_threshold=threshold) == []
        assert ask_node(client_node) == [(10, 10), (30, 20), (50, 38)]
    assert len(chat_server.requests) == 2


def test_a_costmap_is_kept_until_the_map_or_a_rule_changes(client_node):
    with pytest.raises(NoMapError, match='no map has arrived yet'):
        client_node.costmap()
    assert ask_node(client_node) == []
    grid_map = GridMap(np.zeros((4, 6), dtype=np.int8))
    client_node.on_map(grid_map)
    first = client_node.costmap()
    assert set_on(client_node, candidates=3) == []
    assert client_node.costmap() is first
    assert set_on(client_node, inflation_radius=1.0) == []
    second = client_node.costmap()
    assert (second is first, second.grid_map is grid_map) == (False, True)
    assert second.config == CostmapConfig(inflation_radius=1.0)
    client_node.on_map(GridMap(np.zeros((4, 6), dtype=np.int8)))
    assert client_node.costmap() is not second


def test_the_embedded_model_says_it_is_no_llm():
    map_node, client, planner, caller = graph(['-p', 'source:=embedded', '-p', 'candidates:=1'])
    with map_node, client, planner, caller as caller:
        caller.wait_until_ready(client='llm_client_node')
        greedy = caller.call(START, GOAL)[1]
        assert set_parameter(caller, 'llm_client_node', 'candidates', 8).successful
        refused = set_parameter(caller, 'llm_client_node', 'candidates', 0)
        best, exchange = caller.call(START, GOAL)[1], ask_client(caller)
    assert not refused.successful
    for report in (greedy, best):
        assert report.source_status == 'OK'
        assert report.guided_by.startswith('embedded:learned waypoint model')
        assert {verdict for *_, verdict in report.waypoints} == {'accepted'}
    assert exchange.label.endswith('not an LLM')


def test_by_default_nobody_is_asked_on_a_map_where_waypoints_save_no_time():
    start, goal = Pose2D(10.05, 9.45), Pose2D(14.15, 2.15)
    processes = (
        in_this_process('map_node', '-p', f'map_file:={HOUSE}', namespace=ALONE),
        in_this_process('llm_client_node', '-p', 'source:=auto', namespace=ALONE),
        in_this_process('planner_node', '-p', 'search_while_waiting:=false', namespace=ALONE),
    )
    with processes[0], processes[1], processes[2], calling(ALONE) as caller:
        caller.wait_until_ready(client='llm_client_node')
        asked, not_asked = (caller.call(start, goal)[1] for _ in range(2))
        assert set_parameter(caller, 'llm_client_node', 'source', 'straight').successful
        wait_for(
            lambda: caller.call(start, goal)[1].source_status == 'OK', 'the source that is named'
        )
    for report in (asked, not_asked):
        assert (report.code, report.source_status) == (0, 'NONE')
        assert report.source_detail == 'they save no time on such a map'
    assert asked.seconds_source > 0.0
    assert not_asked.seconds_source == 0.0


def test_one_process_has_planner_and_client_where_a_user_wants_that():
    options = ('-p', 'client_in_process:=true', '-p', 'search_while_waiting:=false')
    both = process('planner_node', *options, namespace=ALONE)
    map_node = in_this_process('map_node', namespace=ALONE)
    with map_node, both as both, calling(ALONE) as caller:
        caller.wait_until_ready(client='llm_client_node')
        report = caller.call(START, GOAL)[1]
    assert (report.code, report.source_status) == (0, 'OK')
    assert both.returncode == 0


def test_an_endpoint_guides_and_gets_one_request_for_equal_queries(chat_server, monkeypatch):
    monkeypatch.setenv(KEY_ENV, KEY)
    chat_server.script = [chat_server.completion(GOOD)]
    map_node, client, planner, caller = graph(endpoint(chat_server.base_url))
    with map_node, client, planner, caller as caller:
        caller.wait_until_ready(client='llm_client_node')
        reports = [caller.call(START, GOAL)[1] for _ in range(5)]
    assert {(report.guided_by, report.operation) for report in reports} == {
        ('endpoint:test-model', 49)
    }
    assert len(chat_server.requests) == 1
    asked = json.dumps(chat_server.requests[0])
    assert '[39, 18]' in asked
    assert '[7, 19]' in asked
    assert '[27, 10, 23]' in asked  # a barrier


def failures(server):
    """Return what an endpoint does, and the status that the plan must report."""
    return {
        'refused': ([server.error(429, 'insufficient_quota', 'insufficient_quota')], 'REFUSED'),
        'wrong key': ([server.error(401, f'bad key {KEY}')], 'AUTH'),
        'broken': ([server.error(500, 'oops')], 'ERROR'),
        'silent': ([server.wait(30.0)], 'TIMEOUT'),
        'dripping': ([server.drip(b'HTTP/1.1 200 OK\r\nContent-Length: 9999\r\n\r\n')], 'TIMEOUT'),
        'chatty': ([server.completion('I would go around the wall.')], 'MALFORMED'),
        'hostile': ([server.completion('__import__("os").system("true")')], 'MALFORMED'),
        'empty': ([server.completion('Generated Path: []')], 'NO_WAYPOINTS'),
    }


def test_no_failure_of_the_endpoint_stops_a_plan_and_each_is_reported(chat_server, monkeypatch):
    monkeypatch.setenv(KEY_ENV, KEY)
    arguments = endpoint(chat_server.base_url, timeout_s=2.0, max_retries=0)
    map_node, client, planner, caller = graph(
        arguments, '-p', 'max_planning_time:=8.0', '-p', 'source_timeout:=5.0'
    )
    seen = {}
    with map_node, client, planner, caller as caller:
        caller.wait_until_ready(client='llm_client_node')
        for name, (script, _) in failures(chat_server).items():
            # A changed parameter makes a new client: no breaker and no cache from before.
            assert set_parameter(caller, 'llm_client_node', 'model', f'model {name}').successful
            chat_server.requests.clear()
            chat_server.script = script
            began = time.monotonic()
            path, report, _ = caller.call(START, GOAL)
            assert time.monotonic() - began < 15.0
            assert report.code == 0, (name, report)
            assert len(path.poses) > 30
            assert report.guided_by == 'none'
            assert report.source_detail, name
            assert KEY not in str(report)
            seen[name] = report.source_status
    assert seen == {name: status for name, (_, status) in failures(chat_server).items()}


def listen(caller, messages):
    """Keep everything that a bag of this graph would hold."""
    topics = {
        'llm_client_node/exchange': (DiagnosticArray, REPORTS),
        'planner_node/report': (DiagnosticArray, REPORTS),
        '/diagnostics': (DiagnosticArray, RELIABLE),
        '/rosout': (Log, RELIABLE),
        '/parameter_events': (ParameterEvent, RELIABLE),
    }
    for topic, (kind, qos) in topics.items():
        caller.node.create_subscription(kind, topic, messages.append, qos)


def dump_parameters(caller, node):
    """Return what `ros2 param dump` reads."""
    names = caller.ask(
        caller.node.create_client(ListParameters, f'{node}/list_parameters'),
        ListParameters.Request(),
    ).result.names
    values = caller.ask(
        caller.node.create_client(GetParameters, f'{node}/get_parameters'),
        GetParameters.Request(names=names),
    )
    return f'{names} {values}'


def test_a_key_appears_in_no_topic_parameter_log_or_file(chat_server, monkeypatch, tmp_path):
    """The endpoint repeats the key in its errors and replies, and no output contains it."""
    monkeypatch.setenv(KEY_ENV, KEY)
    transcript = tmp_path / 'record.jsonl'
    escaped = ''.join(f'&#{ord(letter)};' for letter in KEY)
    # The second query differs from the first, which fails, so neither is answered from the cache.
    chat_server.script = [
        chat_server.error(500, f'\x1b[31m{KEY} is no good, nor is {escaped}'),
        chat_server.completion(f'Your key is {KEY}. {GOOD}'),
    ]
    arguments = endpoint(chat_server.base_url, record=str(transcript), max_retries=0)
    map_node, client, planner, caller = graph(arguments, '--log-level', 'debug', kind=process)
    messages = []
    with map_node, client as client, planner as planner, caller as caller:
        listen(caller, messages)
        caller.wait_until_ready(client='llm_client_node')
        failed = caller.call(START, GOAL)[1]
        guided = caller.call(GOAL, START)[1]
        parameters = dump_parameters(caller, 'llm_client_node')
        wait_for(lambda: any(isinstance(message, Log) for message in messages), 'a log')
        wait_for(lambda: str(messages).count('endpoint:test-model') > 1, 'the exchanges')
    assert chat_server.headers[0]['Authorization'] == f'Bearer {KEY}'
    assert (failed.guided_by, guided.guided_by) == ('none', 'endpoint:test-model')
    recorded = transcript.read_text()
    everything = [str(messages), parameters, recorded, *client.output, *planner.output]
    assert KEY_ENV in parameters
    assert '***' in recorded
    for text in everything:
        assert KEY not in text
        assert escaped[:30] not in text
        assert '\x1b[31m' not in text
    assert KEY in os.environ[KEY_ENV]


def test_what_was_recorded_live_is_replayed_to_the_same_plan(chat_server, monkeypatch, tmp_path):
    monkeypatch.setenv(KEY_ENV, KEY)
    transcript = tmp_path / 'record.jsonl'
    chat_server.script = [chat_server.completion(GOOD)]
    exchanges = []
    map_node, client, planner, caller = graph(
        endpoint(chat_server.base_url, record=str(transcript))
    )
    with map_node, client, planner, caller as caller:
        caller.node.create_subscription(
            DiagnosticArray, 'llm_client_node/exchange', exchanges.append, REPORTS
        )
        caller.wait_until_ready(client='llm_client_node')
        live = caller.call(START, GOAL)[1]
        wait_for(lambda: exchanges, 'the exchange')
    exchange = report_from_message(exchanges[0], ExchangeReport)
    recorded = read_transcript(transcript)[0]
    assert (exchange.map_digest, exchange.pair) == (recorded.map, recorded.pair)
    assert exchange.text == recorded.response == GOOD
    assert [content for _, content in exchange.messages] == [
        message.content for message in recorded.messages
    ]
    replay = ['source:=replay', f'transcript:={transcript}', "dataset:=''"]
    arguments = [word for value in replay for word in ('-p', value)]
    map_node, client, planner, caller = graph(arguments)
    with map_node, client, planner, caller as caller:
        caller.wait_until_ready(client='llm_client_node')
        replayed = caller.call(START, GOAL)[1]
    assert replayed.guided_by == 'replay:test-model'
    assert (replayed.waypoints, replayed.operation, replayed.length) == (
        live.waypoints,
        live.operation,
        live.length,
    )

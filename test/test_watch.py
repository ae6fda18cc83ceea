"""`llm-astar watch` over a live graph, and what it prints."""

import contextlib
import json
import signal
import subprocess
import sys
import threading
from dataclasses import asdict, replace

import numpy as np
import pytest
import rclpy
from graph_tools import GOAL, START, calling, spinning, wait_for
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.report import ExchangeReport
from llm_astar_planner.cli.main import main
from llm_astar_planner.cli.watch import to_json, to_line
from llm_astar_planner.nodes.llm_client_node import LlmClientNode
from llm_astar_planner.nodes.map_node import MapNode
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.nodes.tools.planner_client import EventKind, MonitorEvent
from llm_astar_planner.planning.report import plan_report
from llm_astar_planner.planning.types import Plan, ResultCode
from rclpy.parameter import Parameter

SPACE = '/watched'
REPLAY = [
    Parameter('source', value='replay'),
    Parameter('transcript', value='demo_transcript.jsonl'),
    Parameter('dataset', value='demo.json'),
]
FINE = Plan(ResultCode.NONE, 'fine', '', (0, 0), (0, 0), np.zeros((0, 0), dtype=bool))
PLAN = MonitorEvent(
    EventKind.PLAN,
    5_000_000_000,
    'planner_node',
    {
        **asdict(plan_report(FINE, None)),
        'method': 'guided',
        'guided_by': 'replay:x',
        'source_status': 'OK',
        'operation': 49,
        'length': 43.699,
        'ratio': 1.0,
        'waypoints': ((1.0, 2.0, 'accepted'), (3.0, 2.0, 'out_of_bounds'), (1.0, 1.0, 'accepted')),
    },
)
INSTRUCTED = {
    'clauses': [
        {'clause': 'avoid the lab', 'status': 'kept', 'detail': '0 m inside'},
        {'clause': 'visit the dock', 'status': 'not kept', 'detail': 'never nearer than 3.2 m'},
    ],
    'satisfied': False,
    'note': 'the clauses leave no path',
    'interpretation': {'status': 'understood', 'understood_by': 'grammar'},
}


@pytest.fixture(scope='module')
def graph():
    """The three nodes, in this process, spun by threads."""
    rclpy.init()
    nodes = [
        MapNode(namespace=SPACE),
        LlmClientNode(namespace=SPACE, parameter_overrides=REPLAY),
        PlannerNode(
            namespace=SPACE, parameter_overrides=[Parameter('search_while_waiting', value=False)]
        ),
    ]
    with spinning(*nodes), calling(SPACE) as caller:
        caller.wait_until_ready(client='llm_client_node')
        yield caller
    rclpy.try_shutdown()


@contextlib.contextmanager
def watch(*arguments):
    """Run the command as a process of its own; give it back with the lines it has printed."""
    command = [sys.executable, '-m', 'llm_astar_planner.cli.main', 'watch', *arguments]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1
    )
    lines = []
    reader = threading.Thread(target=lambda: lines.extend(process.stdout), daemon=True)
    reader.start()
    try:
        yield process, lines
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        reader.join(10.0)
        process.stdout.close()
        process.stderr.close()


def test_plans_exchanges_and_states_are_printed_and_the_count_ends_the_watch(graph):
    graph.call(START, GOAL)
    with watch('--namespace', SPACE, '--json', '--count', '2') as (process, lines):
        for kind in ('"plan"', '"exchange"'):
            wait_for(lambda: any(kind in line for line in lines), f'the {kind} from before')  # noqa: B023
        report = graph.call(START, Pose2D(0.0, 0.0))[1]
        assert process.wait(30.0) == 0
    seen = [json.loads(line) for line in lines]
    plans = [item for item in seen if item['kind'] == 'plan']
    assert [plan['code_name'] for plan in plans] == ['NONE', 'GOAL_OCCUPIED']
    assert plans[0]['guided_by'] == 'replay:hand-written example'
    assert plans[0]['node'] == 'watched/planner_node'
    assert plans[1]['message'] == report.message
    exchanges = [item for item in seen if item['kind'] == 'exchange']
    assert [(item['status'], len(item['waypoints'])) for item in exchanges] == [('OK', 5)]


def test_ctrl_c_ends_a_watch_cleanly_and_silence_is_answered_with_advice(graph):
    with watch('--namespace', SPACE, '--node', 'nobody') as (process, _):
        advice = process.stderr.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(30.0) == 0
        assert process.stderr.read() == ''
    for word in ('/watched/nobody', 'ROS_DOMAIN_ID', '--namespace', '--node'):
        assert word in advice


@pytest.mark.parametrize(
    'arguments', [('--count', '0'), ('--namespace', 'no/1bad'), ('--node', 'a b')]
)
def test_invalid_options_are_refused_in_one_line(capsys, arguments):
    assert main(['watch', *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith('llm-astar: error: ')
    assert error.count('\n') == 1


def test_a_line_has_the_figures_of_the_plan():
    line = to_line(PLAN)
    for words in (
        'path found: fine',
        'method guided',
        '0.0 ms to search',
    ):
        assert words in line
    assert 'NONE' not in line
    assert '\033' not in line
    printed = json.loads(to_json(PLAN))
    assert (printed['operation'], printed['stamp']) == (49, 5.0)


EXCHANGE = ExchangeReport(
    'endpoint:x', 'OK', '', 'x', 'cot', '[[1, 2]]', 1, 12, 3, 0.5, ((1.0, 2.0),), '', ''
)


def test_a_line_of_an_exchange_says_how_many_waypoints_came_or_why_none():
    line = to_line(
        MonitorEvent(EventKind.EXCHANGE, 5_000_000_000, 'llm_client_node', asdict(EXCHANGE))
    )
    assert line.endswith('exchange  1 waypoints from endpoint:x  12 + 3 tokens  0.50 s')
    failed = replace(EXCHANGE, status='TIMEOUT', detail='no answer', prompt_tokens=0, waypoints=())
    failed = replace(failed, completion_tokens=0)
    line = to_line(
        MonitorEvent(EventKind.EXCHANGE, 5_000_000_000, 'llm_client_node', asdict(failed))
    )
    assert line.endswith('exchange  no waypoints from endpoint:x: no answer [TIMEOUT]  0.50 s')


def test_each_clause_of_an_instruction_has_a_line_with_what_became_of_it():
    line = to_line(PLAN._replace(values={**PLAN.values, 'instruction_report': INSTRUCTED}))
    _, *clauses = line.split('\n')
    assert clauses == [
        '          kept            avoid the lab (0 m inside)',
        '          not kept        visit the dock (never nearer than 3.2 m)',
        '          the clauses leave no path',
    ]


def test_an_instruction_that_is_not_understood_yet_has_no_lines_of_clauses():
    report = {**INSTRUCTED, 'clauses': [], 'note': ''}
    assert '\n' not in to_line(PLAN._replace(values={**PLAN.values, 'instruction_report': report}))


def test_warnings_of_a_plan_are_in_its_line():
    change = {'warnings': ('the goal was shifted by 0.30 m',)}
    line = to_line(PLAN._replace(values={**PLAN.values, **change}))
    assert '! the goal was shifted by 0.30 m' in line


def test_text_of_a_model_cannot_control_the_terminal():
    hostile = {**PLAN.values, 'code': 200, 'message': 'gone\n\033[2Jwrong\x07'}
    line = to_line(PLAN._replace(values=hostile))
    assert line.isprintable()
    assert 'wrong' in line

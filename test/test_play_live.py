"""`llm-astar play --live` on a running graph, and how the command starts and ends."""

import contextlib
import json
import re
import signal
import subprocess
import sys
import threading

import httpx
import pytest
import rclpy
from graph_tools import GOAL, START, calling, spinning
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_planner.nodes.map_node import MapNode
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from rclpy.parameter import Parameter

SPACE = '/played'
PATIENCE = 60.0


@pytest.fixture(scope='module')
def graph():
    rclpy.init()
    planner = PlannerNode(
        namespace=SPACE,
        parameter_overrides=[
            Parameter('llm_client', value=''),
            Parameter('instruction', value='keep 1 m from the walls'),
        ],
    )
    with spinning(MapNode(namespace=SPACE), planner), calling(SPACE) as caller:
        caller.wait_until_ready()
        yield caller
    rclpy.try_shutdown()


@contextlib.contextmanager
def play(*arguments):
    """Run the command as a process of its own; give it back with the address that it prints."""
    command = [sys.executable, '-m', 'llm_astar_planner.cli.main', 'play', '--no-browser']
    process = subprocess.Popen(
        [*command, '--port', '0', *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    killer = threading.Timer(PATIENCE, process.kill)
    killer.start()
    try:
        yield process, re.search(r'http://\S+', process.stdout.readline())[0]
    finally:
        killer.cancel()
        if process.poll() is None:
            process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()


def end(process):
    process.send_signal(signal.SIGINT)
    assert process.wait(30.0) == 0
    assert process.stdout.read() == 'stopped\n'
    assert process.stderr.read() == ''


class Events:
    """The server-sent events of a page, one after the other."""

    def __init__(self, lines):
        self.lines = lines

    def next(self, kind, accept=lambda value: True):
        for line in self.lines:
            if line == f'event: {kind}':
                value = json.loads(next(self.lines).removeprefix('data: '))
                if accept(value):
                    return value
        raise AssertionError(f'the stream ended before its {kind}')


def test_a_page_sees_the_graphs_map_plans_and_state_and_ctrl_c_ends_the_server(graph):
    with play('--live', '--namespace', SPACE) as (process, url):
        with (
            httpx.Client(base_url=url, trust_env=False, timeout=PATIENCE) as page,
            page.stream('GET', 'api/live') as stream,
        ):
            assert page.get('api/options').json()['live']
            assert stream.headers['content-type'].startswith('text/event-stream')
            events = Events(stream.iter_lines())
            shown = events.next('map')
            assert (shown['width'], shown['height'], shown['resolution']) == (51, 31, 1.0)
            path, report, _ = graph.call(START, GOAL)
            plan = events.next('plan', lambda plan: plan.get('path'))
            assert plan['found']
            assert plan['path'][0] == [39, 18]
            assert plan['path'][-1] == [7, 19]
            assert len(plan['path']) == len(path.poses)
            assert plan['figures']['expansions'] == report.operation
            assert plan['figures']['length_m'] == report.length
            clauses = plan['instruction']['clauses']
            assert [clause['status'] for clause in clauses] == ['satisfied']
            report = graph.call(START, Pose2D(0.0, 0.0))[1]
            failed = events.next('plan', lambda plan: not plan['found'])
            assert (failed['code'], failed['message']) == ('GOAL_OCCUPIED', report.message)
            assert failed['path'] == []
            assert '/played/planner_node' in events.next('status')['message']
        end(process)


def test_without_a_planner_the_page_is_told_what_to_check(graph):
    with play('--live', '--namespace', SPACE, '--node', 'nobody') as (process, url):
        with httpx.stream('GET', f'{url}api/live', trust_env=False, timeout=PATIENCE) as stream:
            events = Events(stream.iter_lines())
            said = events.next('status', lambda status: 'nobody' in status['message'])
            assert 'ROS_DOMAIN_ID' in said['message']
            process.send_signal(signal.SIGINT)
            assert 'event: plan' not in list(events.lines)  # which ends
        assert process.wait(30.0) == 0
        assert process.stderr.read() == ''

"""`llm-astar play --live` on a running graph, and what a page sees of it."""

import asyncio
import contextlib
import json
import re
import signal
import subprocess
import sys
import threading
from dataclasses import asdict, replace

import httpx
import numpy as np
import pytest
import rclpy
import shapely
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from graph_tools import GOAL, START, calling, spinning, wait_for
from llm_astar_lab.nodes import live_view
from llm_astar_lab.play.live import LiveFeed
from llm_astar_lab.play.maps import PlayError
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.writing import path_to_message, report_to_message
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.zones import Zone
from llm_astar_planner.nodes.common.entities import RELIABLE, REPORTS
from llm_astar_planner.nodes.map_node import MapNode
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.report import plan_report
from llm_astar_planner.planning.types import Plan, PlanRequest, ResultCode
from nav_msgs.msg import Path
from rclpy.parameter import Parameter

SPACE = '/played'
PATIENCE = 60.0
FINE = Plan(ResultCode.NONE, 'fine', 'guided', (0, 0), (0, 0), np.zeros((0, 0), dtype=bool))


@pytest.fixture(scope='module')
def graph():
    rclpy.init()
    planner = PlannerNode(
        namespace=SPACE,
        parameter_overrides=[
            Parameter('llm_client', value=''),
            Parameter('places_file', value='instructions/barriers_0.places.geojson'),
            Parameter('instruction', value='keep 1 m from the walls'),
        ],
    )
    with spinning(MapNode(namespace=SPACE), planner), calling(SPACE) as caller:
        caller.wait_until_ready(seconds=PATIENCE)
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


class Events:
    """The server-sent events of a page; those of different kinds come in any order."""

    def __init__(self, lines):
        self.lines = lines
        self.seen = []

    def next(self, kind, accept=lambda value: True):
        for event in self.seen:
            if event[0] == kind and accept(event[1]):
                self.seen.remove(event)
                return event[1]
        for line in self.lines:
            if line.startswith('event: '):
                value = json.loads(next(self.lines).removeprefix('data: '))
                if line == f'event: {kind}' and accept(value):
                    return value
                self.seen.append((line.removeprefix('event: '), value))
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
            if not shown['places']:  # which come on a topic of their own
                shown = events.next('map', lambda value: value['places'])
            assert all(place['name'] and place['polygon'] for place in shown['places'])
            assert events.next('rules') == []
            path, report, _ = graph.call(START, GOAL)
            plan = events.next('plan', lambda plan: plan.get('path'))
            assert plan['found']
            assert plan['path'][0] == [39, 18]
            assert plan['path'][-1] == [7, 19]
            assert len(plan['path']) == len(path.poses)
            assert plan['operation'] == report.operation
            assert plan['length_m'] == report.length
            clauses = plan['instruction_report']['clauses']
            assert [clause['status'] for clause in clauses] == ['kept']
            report = graph.call(START, Pose2D(0.0, 0.0))[1]
            failed = events.next('plan', lambda plan: not plan['found'])
            assert (failed['code_name'], failed['message']) == ('GOAL_OCCUPIED', report.message)
            assert failed['path'] == []
            events.next('status', lambda status: '/played/planner_node' in status['message'])
            process.send_signal(signal.SIGINT)
            assert 'event: plan' not in list(events.lines)  # which ends
        assert process.wait(30.0) == 0
        assert process.stdout.read() == 'stopped\n'
        assert process.stderr.read() == ''


def test_a_page_is_told_what_to_check_where_there_is_no_planner(graph, monkeypatch):
    monkeypatch.setattr(live_view, 'SILENCE_S', 0.1)
    feed, stopped = LiveFeed(), threading.Event()
    view = live_view.LiveView(graph.node, 'nobody', 'no_client', feed)
    following = threading.Thread(target=view.follow, args=(stopped,))
    following.start()

    async def first_advice():
        async for event in feed.follow():
            if 'nobody' in event:
                return event

    try:
        assert 'ROS_DOMAIN_ID' in asyncio.run(asyncio.wait_for(first_advice(), PATIENCE))
    finally:
        stopped.set()
        following.join()


def test_plans_a_nanosecond_apart_are_shown_with_their_own_paths(graph):
    class Viewer:
        def show_plan(self, points, report):
            plans.append((len(points), report['operation']))

        def show_map(self, grid_map):
            """Ignore it."""

        show_places = show_status = show_map

    plans, stopped, namespace = [], threading.Event(), f'{SPACE}/twins'
    with calling(namespace, 'publishes_twins') as caller:
        view = live_view.LiveView(caller.node, 'planner', 'no_client', Viewer())
        paths = caller.node.create_publisher(Path, 'plan', RELIABLE)
        reports = caller.node.create_publisher(DiagnosticArray, 'planner/report', REPORTS)
        for publisher in (paths, reports):
            caller.wait_for_subscriber(publisher, PATIENCE)
        following = threading.Thread(target=view.follow, args=(stopped,))
        stamps = [Time(sec=1_700_000_000, nanosec=nanosec) for nanosec in (5, 6)]
        for size, stamp in enumerate(stamps, 1):
            paths.publish(path_to_message(np.zeros((size, 2)), 'map', stamp))
        following.start()
        for size, stamp in enumerate(stamps, 1):
            report = replace(plan_report(FINE, None), operation=size)
            reports.publish(report_to_message(report, 'planner', stamp))
            wait_for(lambda: len(plans) == size, f'plan {size}')  # noqa: B023
        stopped.set()
        following.join()
    assert plans == [(1, 1), (2, 2)]


def test_a_plan_that_cannot_be_read_is_said_to_be_so():
    feed = LiveFeed()
    feed.show_map(GridMap(np.zeros((4, 4), dtype=np.int8)))
    report = asdict(plan_report(FINE, None))
    for points, fields in (
        ([[np.nan, 0.0]], {}),
        ([[0.0, 0.0]], {'seconds_search': np.inf}),
        ([[0.0, 0.0]], {'waypoints': ((1.0, 2.0),)}),
        ([[0.0, 0.0]], {'why': {'causes': 3}}),
    ):
        feed.show_plan(np.array(points), report | fields)
        plan = asyncio.run(newest_plan(feed))
        assert plan['code_name'] == 'UNREADABLE'
        assert not plan['found']
    feed.show_plan(np.array([[0.0, 0.0]]), report)
    assert asyncio.run(newest_plan(feed))['found']


def test_zones_and_rules_of_a_running_graph_are_sent_in_cells():
    line = shapely.LineString([(1.0, 2.0), (5.0, 2.0)])
    lane = Zone('1', line, 0, name='lane', kind='one_way', width=1.0)
    feed = LiveFeed()
    feed.show_map(GridMap(np.zeros((20, 30), dtype=np.int8), 0.5))
    feed.show_zones([lane, Zone('2', shapely.box(0, 0, 1, 1), name='spill')])
    one_way, area = asyncio.run(newest(feed, 'rules'))
    assert one_way['arrows'] == [[[1.5, 3.5], [9.5, 3.5]]]
    assert (one_way['name'], one_way['kind'], one_way['width']) == ('lane', 'one_way', 2.0)
    assert (area['name'], area['kind'], area['cost'], area['arrows']) == ('spill', 'area', 100, [])
    assert len(area['rings'][0]) == 5


def test_what_closes_the_way_of_a_running_graph_is_sent_in_cells():
    cells = np.zeros((20, 30), dtype=np.int8)
    cells[:, 15], cells[9:12, 15] = 100, 0
    grid_map = GridMap(cells, 0.5)
    planner = Planner(grid_map, CostmapConfig(robot_radius=1.5))
    plan = planner.plan(PlanRequest((4, 10), (26, 10)))
    feed = LiveFeed()
    feed.show_map(grid_map)
    feed.show_plan(np.zeros((0, 2)), asdict(plan_report(plan, grid_map)))
    (cause,) = asyncio.run(newest_plan(feed))['causes']
    assert cause['name'] == 'radius'
    assert cause['points'][-1] == [15.0, 10.0]


def newest_plan(feed):
    return newest(feed, 'plan')


async def newest(feed, kind):
    async for event in feed.follow():
        if event.startswith(f'event: {kind}'):
            return json.loads(event.split('data: ')[1])


def test_a_map_that_is_too_large_is_not_sent_and_the_ninth_page_is_refused():
    feed = LiveFeed()
    feed.show_map(GridMap(np.zeros((2001, 2000), dtype=np.int8)))

    async def look():
        streams = [feed.follow() for _ in range(8)]
        first = [await anext(stream) for stream in streams]
        with pytest.raises(PlayError):
            feed.follow()
        for stream in streams:
            await stream.aclose()
        return first

    assert all('2000 x 2001' in event for event in asyncio.run(look()))

"""Callers whose response gets lost, as it does where a service has not discovered them yet."""

import contextlib
import threading
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from graph_tools import GOAL, PATIENCE, START, calling, running, wait_for
from llm_astar_msgs_adapter.messages.writing import path_to_message, report_to_message
from llm_astar_planner.nodes.common.entities import REPORTS
from llm_astar_planner.nodes.tools import planner_client
from llm_astar_planner.nodes.tools.planner_client import PlannerClientError
from llm_astar_planner.planning.report import plan_report
from llm_astar_planner.planning.types import Plan, ResultCode
from nav_msgs.srv import GetPlan
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.callback_groups import ReentrantCallbackGroup

FOUND = Plan(ResultCode.NONE, '', 'guided', (0, 0), (0, 0), np.zeros((0, 0), dtype=bool))


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


class Server:
    """Answers each request but those that are `lost`, by their numbers, from 1."""

    def __init__(self, node, kind, name, respond, lost):
        self.asked = self.answered = 0
        self._respond = respond
        self._lost = lost
        self.ended = threading.Event()
        group = ReentrantCallbackGroup()
        node.create_service(kind, name, self._on_request, callback_group=group)

    def _on_request(self, request, response):
        self.asked = number = self.asked + 1
        if number in self._lost:
            self.ended.wait(PATIENCE)
        self.answered += 1
        return self._respond(number, response)


@contextlib.contextmanager
def serving(namespace, kind, name, respond, lost):
    node = rclpy.create_node('planner_node', namespace=namespace, start_parameter_services=False)
    reports = node.create_publisher(DiagnosticArray, 'planner_node/report', REPORTS)
    with running(node):
        server = Server(node, kind, name, partial(respond, reports), lost)
        try:
            yield server
        finally:
            server.ended.set()
            wait_for(lambda: server.answered == server.asked, 'the end of the callbacks')


def respond_with_plan(reports, number, response):
    stamp = Time(sec=number)
    response.plan = path_to_message(np.zeros((number, 2)), 'map', stamp)
    report = replace(plan_report(FOUND, None), operation=number)
    reports.publish(report_to_message(report, 'planner_node', stamp))
    return response


def respond_with_success(_, number, response):
    response.results = [SetParametersResult(successful=True)] * number
    return response


def test_a_plan_whose_response_gets_lost_is_asked_for_again(monkeypatch):
    monkeypatch.setattr(planner_client, 'PLAN_AGAIN_S', 0.2)
    space = '/lost_plan'
    get_plan = GetPlan, 'planner_node/get_plan', respond_with_plan
    with serving(space, *get_plan, {1, 2}) as server, calling(space) as caller:
        path, report, _ = caller.call(START, GOAL, seconds=PATIENCE)
        assert (len(path.poses), report.operation, server.asked) == (3, 3, 3)


def test_a_planner_that_has_discovered_the_caller_is_asked_once_however_slow_it_is(monkeypatch):
    monkeypatch.setattr(planner_client, 'PLAN_AGAIN_S', 0.1)
    space = '/slow_plan'
    get_plan = GetPlan, 'planner_node/get_plan', respond_with_plan
    with serving(space, *get_plan, {2}) as server, calling(space) as caller:
        caller.call(START, GOAL)
        with pytest.raises(PlannerClientError, match=r'did not respond within 0\.5 s'):
            caller.call(START, GOAL, seconds=0.5)
        assert server.asked == 2
        # Who knows: it may have been restarted.
        assert caller.call(START, GOAL, seconds=PATIENCE)[1].operation == 3


def test_a_parameter_is_set_again_where_the_response_gets_lost():
    space = '/lost_parameters'
    set_parameters = SetParameters, 'planner_node/set_parameters', respond_with_success
    with serving(space, *set_parameters, {1}), calling(space) as caller:
        client = caller.node.create_client(*set_parameters[:2])
        request = SetParameters.Request()
        assert len(caller.ask(client, request, PATIENCE, ask_again=0.2).results) == 2

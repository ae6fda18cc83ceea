"""A request repeated after a failure is planned on a costmap newer than itself, if one is due.

A behaviour tree plans, clears the costmap and plans again, within milliseconds; the costmap is
published as free only a moment later.
"""

import contextlib
import threading
import time

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from graph_tools import PATIENCE, calling, running, set_parameter, wait_for
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.writing import grid_to_message, pose_to_message
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE, UPDATES
from llm_astar_planner.nodes.common.map_subscription import OccupancyGridUpdate
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.parameter import Parameter

START, GOAL, OTHER = Pose2D(5.5, 5.5), Pose2D(35.5, 5.5), Pose2D(36.5, 6.5)
FREE = np.zeros((30, 40), dtype=np.int8)
WALL = FREE.copy()
WALL[:, 20] = 100
CORNER = WALL.copy()
CORNER[0, 0] = 100
PERIOD, CLEARING = 0.2, 0.6


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


class Costmap:
    """Publishes a costmap with a wall, again and again, until it is cleared or stopped."""

    def __init__(self, node):
        self.node = node
        self.cells = WALL
        self.as_updates = False
        self.whole = node.create_publisher(OccupancyGrid, 'map', LATCHED)
        self.parts = OccupancyGridUpdate and node.create_publisher(
            OccupancyGridUpdate, 'map_updates', UPDATES
        )
        self.stopped = threading.Event()
        self.thread = None

    def publish(self):
        stamp = self.node.get_clock().now().to_msg()
        message = grid_to_message(GridMap(self.cells), stamp)
        if not self.as_updates:
            self.whole.publish(message)
            return
        height, width = self.cells.shape
        update = OccupancyGridUpdate(header=message.header, width=width, height=height)
        update.data = message.data
        self.parts.publish(update)

    def run(self, seconds):
        while not self.stopped.wait(seconds):
            self.publish()
            seconds = PERIOD

    def start(self, seconds=0.0):
        """Publish every PERIOD from so many seconds on."""
        self.stopped.clear()
        self.thread = threading.Thread(target=self.run, args=(seconds,))
        self.thread.start()

    def stop(self):
        self.stopped.set()
        if self.thread is not None:
            self.thread.join()

    def clear(self):
        """Publish what was made before, and CLEARING seconds later that all is free."""
        self.stop()
        self.publish()
        self.cells = FREE
        self.start(CLEARING)


class Robot:
    """A planner, its costmap, a caller, and what is published."""

    def __init__(self, planner, caller, costmap):
        self.planner, self.caller, self.costmap = planner, caller, costmap
        self.paths, self.levels = [], []
        node = caller.node
        node.create_subscription(Path, 'plan', self.paths.append, RELIABLE)
        node.create_subscription(DiagnosticArray, '/diagnostics', self.on_state, RELIABLE)
        self.starts = node.create_publisher(PoseWithCovarianceStamped, 'initialpose', RELIABLE)
        self.goals = node.create_publisher(PoseStamped, 'goal_pose', RELIABLE)
        for publisher in (costmap.whole, self.starts, self.goals):
            wait_for(publisher.get_subscription_count, publisher.topic_name)

    def on_state(self, message):
        for status in message.status:
            if status.name == f'{self.planner.get_fully_qualified_name()[1:]}: planner':
                self.levels.append((status.level, status.message))

    def ask(self, goal=GOAL):
        return self.caller.call(START, goal)[1]

    @property
    def arrivals(self):
        return self.planner._server._maps.arrivals

    @property
    def failures(self):
        return self.planner._server.handler._waits.failures

    def wait_for_rhythm(self):
        wait_for(lambda: self.arrivals.is_due(PERIOD), 'a rhythm')

    def settle(self):
        """Stop the costmap with one of its own: when it is planned on, no other is on its way."""
        self.costmap.stop()
        self.costmap.cells = CORNER
        self.costmap.publish()
        name = f'map {GridMap(CORNER).digest}'
        wait_for(lambda: self.planner._server._maps.name.startswith(name), 'the last map')

    def set(self, name, value):
        assert set_parameter(self.caller, 'planner_node', name, value).successful


@contextlib.contextmanager
def robot_in(namespace, **parameters):
    values = {'llm_client': '', 'max_planning_time': 0.9, 'tolerance': 0.0} | parameters
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    planner = PlannerNode(namespace=namespace, parameter_overrides=overrides)
    with running(planner), calling(namespace) as caller:
        wait_for(lambda: planner._server and planner.is_active, 'the start')
        # Maps that change are prepared at once.
        compiler = planner._server.handler.compiler
        wait_for(lambda: compiler.done >= 4, 'the compilation')  # of maps that change, too
        costmap = Costmap(caller.node)
        robot = Robot(planner, caller, costmap)
        try:
            yield robot
        finally:
            costmap.stop()


@pytest.fixture(scope='module')
def periodic():
    with robot_in('/fresh') as robot:
        yield robot


@pytest.fixture
def robot(periodic):
    """A robot in front of a wall, on a costmap that comes again and again."""
    costmap = periodic.costmap
    costmap.stop()
    costmap.cells, costmap.as_updates = WALL, False
    periodic.failures.clear()
    costmap.start()
    wall = GridMap(WALL).digest
    wait_for(lambda: periodic.planner._server._maps.name.startswith(f'map {wall}'), 'the wall')
    periodic.wait_for_rhythm()
    yield periodic
    costmap.stop()


def test_a_retry_after_a_clear_is_planned_on_the_cleared_costmap(robot):
    first = robot.ask()
    assert (first.code_name, first.warnings) == ('NO_VALID_PATH', ())
    robot.costmap.clear()
    retry = robot.ask()
    assert (retry.code_name, retry.warnings) == ('NONE', ())
    assert retry.map_digest == GridMap(FREE).digest
    assert retry.seconds_map > CLEARING / 2


def test_a_retry_waits_for_an_update_too(robot):
    if OccupancyGridUpdate is None:
        pytest.skip('map_msgs is not installed')
    robot.costmap.as_updates = True
    robot.ask()
    robot.costmap.clear()
    retry = robot.ask()
    assert (retry.code_name, retry.map_digest) == ('NONE', GridMap(FREE).digest)


def test_a_retry_on_an_unchanged_costmap_fails_as_soon_as_it_came_again(robot):
    assert robot.ask().code_name == 'NO_VALID_PATH'
    retry = robot.ask()
    assert (retry.code_name, retry.warnings) == ('NO_VALID_PATH', ())
    assert retry.seconds_map > 0.0
    assert retry.map_digest == GridMap(WALL).digest


def test_another_goal_is_no_retry_and_waits_for_nothing(robot):
    robot.settle()
    assert (robot.ask().seconds_map, robot.ask(OTHER).seconds_map) == (0.0, 0.0)


def test_a_goal_of_rviz_set_again_is_planned_on_the_cleared_costmap(robot):
    start = PoseWithCovarianceStamped()
    start.pose.pose = pose_to_message(START, 'map', Time()).pose
    robot.starts.publish(start)
    wait_for(lambda: robot.planner._server._initial_pose, 'the start')
    goal = pose_to_message(GOAL, 'map', Time())
    robot.goals.publish(goal)
    wait_for(lambda: robot.failures, 'the failure')
    robot.paths.clear()
    robot.costmap.clear()
    robot.goals.publish(goal)
    wait_for(lambda: robot.paths, 'the path')


def test_a_timeout_of_0_never_waits_and_a_short_one_says_that_it_was_too_short(robot):
    robot.set('costmap_update_timeout', 0.0)
    try:
        robot.settle()
        assert (robot.ask().seconds_map, robot.ask().seconds_map) == (0.0, 0.0)
        robot.set('costmap_update_timeout', 0.5 * CLEARING)
        robot.costmap.clear()
        retry = robot.ask()
        assert retry.code_name == 'NO_VALID_PATH'
        [warning] = retry.warnings
        assert 'no newer map was ready after 0.' in warning
        assert retry.seconds_map >= 0.5 * CLEARING
    finally:
        robot.set('costmap_update_timeout', 2.5)


def test_a_deactivated_node_waits_no_longer(robot):
    robot.ask()
    robot.costmap.stop()
    waiting = threading.Timer(0.1, robot.planner.trigger_deactivate)
    waiting.start()
    report = robot.ask()
    waiting.join()
    robot.planner.trigger_activate()
    assert 'the node was deactivated' in report.message


def test_a_costmap_that_stops_coming_is_warned_of_and_still_planned_on(robot):
    robot.costmap.stop()
    robot.costmap.cells = FREE
    for _ in range(10):
        robot.costmap.publish()
        time.sleep(0.05)
    robot.caller.wait_until_ready(GridMap(FREE).digest)
    wait_for(robot.arrivals.warnings, 'the warning')
    report = robot.ask()
    [warning] = report.warnings
    assert report.code_name == 'NONE'
    assert 'no map or update has come for ' in warning
    wait_for(
        lambda: any(
            level == DiagnosticStatus.WARN and 'no map or update' in message
            for level, message in robot.levels
        ),
        'the diagnosis',
    )
    robot.set('costmap_timeout', 0.1)
    stale = robot.ask()
    assert stale.code_name == 'TIMEOUT'
    assert stale.message.startswith('no map or update has come for ')
    assert stale.message.endswith('(costmap_timeout is 0.1 s)')
    robot.costmap.publish()
    wait_for(lambda: robot.ask().code_name == 'NONE', 'a plan on a costmap that comes again')
    robot.set('costmap_timeout', 0.0)


def test_a_map_that_is_published_once_is_never_waited_for_again():
    with robot_in('/static', costmap_update_timeout=0.3) as robot:
        began = time.monotonic()
        none = robot.ask()
        assert (none.code_name, none.map_digest) == ('TIMEOUT', '')
        assert 'no map has arrived yet, after ' in none.message
        assert time.monotonic() - began >= 0.3
        robot.set('costmap_update_timeout', PATIENCE)
        threading.Timer(0.2, robot.costmap.publish).start()
        first = robot.ask()
        assert (first.code_name, first.warnings) == ('NO_VALID_PATH', ())
        assert 0.0 < first.seconds_map < PATIENCE
        assert robot.ask().seconds_map == 0.0

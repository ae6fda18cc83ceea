"""Plans are made on the newest map that has arrived, whatever it takes and for no longer."""

import contextlib
import threading
import time
import weakref
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from graph_tools import PATIENCE, calling, running, set_parameter, wait_for
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.writing import grid_to_message
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.nodes.common.entities import LATCHED
from llm_astar_planner.nodes.common.map_subscription import MapSubscription
from llm_astar_planner.nodes.planner.map_manager import MapManager
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.nodes.planner.request_handler import RequestError
from llm_astar_planner.planning.types import ResultCode
from nav_msgs.msg import OccupancyGrid
from rclpy.duration import Duration
from rclpy.logging import get_logger
from rclpy.parameter import Parameter

NAMESPACE = '/newest_map'
START, GOAL = Pose2D(5.5, 5.5), Pose2D(35.5, 5.5)


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


class Rules:
    """The rules of the costmap, which a preparation gets only while the gate is open."""

    def __init__(self):
        self.gate = threading.Event()
        self.gate.set()
        self.asked = 0
        self.config = CostmapConfig()

    def __call__(self):
        self.asked += 1
        self.gate.wait(PATIENCE)
        return self.config


@pytest.fixture
def rules():
    return Rules()


@pytest.fixture
def planners():
    return []


@pytest.fixture
def maps(rules, planners):
    maps = MapManager(get_logger('test_maps'), rules, planners.append)
    yield maps
    rules.gate.set()
    maps.close()


def map_with(*cells, shape=(30, 40)):
    occupancy = np.zeros(shape, dtype=np.int8)
    for x, y in cells:
        occupancy[y, x] = 100
    return GridMap(occupancy)


def always():
    return True


def test_a_wait_ends_when_what_had_arrived_is_ready(maps, rules):
    assert not maps.is_preparing
    assert maps.wait(0.0, always)
    rules.gate.clear()
    maps.take(map_with((1, 1)))
    assert maps.is_preparing
    assert not maps.wait(0.05, always)
    assert maps.planner is None
    threading.Timer(0.05, rules.gate.set).start()
    assert maps.wait(PATIENCE, always)
    assert maps.planner.grid_map.digest == map_with((1, 1)).digest
    assert not maps.is_preparing
    assert 0.0 < maps.age < PATIENCE


def test_the_planner_of_the_map_before_is_not_held(maps, planners):
    for x in range(2):
        maps.take(map_with((x, 0)))
        assert maps.wait(PATIENCE, always)
        wait_for(lambda: len(planners) == x + 1, 'the planner')  # noqa: B023
    before = weakref.ref(planners.pop(0))
    wait_for(lambda: before() is None, 'the end of the planner')


def test_of_maps_that_come_faster_than_they_can_be_prepared_the_newest_wins(maps, rules, planners):
    rules.gate.clear()
    maps.take(map_with((0, 0)))
    wait_for(lambda: rules.asked == 1, 'the first preparation')
    for x in range(1, 30):
        maps.take(map_with((x, 0)))
    rules.gate.set()
    assert maps.wait(PATIENCE, always)
    assert maps.planner.grid_map.digest == map_with((29, 0)).digest
    wait_for(lambda: len(planners) == 2, 'two planners')
    assert rules.asked == 2


def test_maps_of_another_size_or_place_are_planned_on_and_a_refused_one_is_not_waited_for(
    maps, rules
):
    for grid_map in (
        map_with((1, 1)),
        map_with((1, 1), shape=(20, 50)),
        GridMap(map_with((1, 1)).cells, 0.5),
        GridMap(map_with((1, 1)).cells, 0.5, Pose2D(3.0, 4.0, 0.1)),
    ):
        maps.take(grid_map)
        assert maps.wait(PATIENCE, always)
        assert maps.planner.grid_map.digest == grid_map.digest
    good = maps.newest
    rules.config = 'no rules at all'
    maps.take(map_with((2, 2)))
    assert maps.wait(PATIENCE, always)
    assert maps.newest is good
    assert not maps.is_preparing


def test_an_equal_map_is_not_prepared_again_but_is_younger(maps):
    maps.take(map_with((1, 1)))
    assert maps.wait(PATIENCE, always)
    before = maps.newest
    maps.take(map_with((1, 1)))
    assert maps.wait(PATIENCE, always)
    assert maps.newest.planner is before.planner
    assert maps.newest.arrived > before.arrived


def test_paths_are_checked_on_a_map_that_is_still_being_prepared(maps, rules):
    assert maps.newest_arrived() is None
    rules.gate.clear()
    maps.take(map_with((1, 1)))
    assert maps.newest_arrived() is None  # what checks paths may not be compiled
    rules.gate.set()
    assert maps.wait(PATIENCE, always)
    costmap, checker = maps.newest_arrived()
    assert (costmap, checker) == (maps.planner.costmap, maps.planner.checker)
    rules.config, good = 'no rules at all', maps.newest
    maps.take(map_with((2, 2)))
    assert maps.wait(PATIENCE, always)
    assert maps.newest_arrived()[0] is good.planner.costmap
    rules.config = CostmapConfig()
    preparing = maps._changed
    with preparing:
        newest = map_with((3, 3))
        maps.take(newest)
        costmap, checker = maps.newest_arrived()
    assert costmap.grid_map is newest
    assert checker.rules[0] is newest.cells


def test_a_map_with_other_zones_is_as_old_as_the_last_message(maps):
    maps.take(map_with((1, 1)), 0.3)
    assert maps.wait(PATIENCE, always)
    before = maps.newest
    maps.take(map_with((2, 2)), None)
    assert maps.wait(PATIENCE, always)
    assert maps.newest.planner is not before.planner
    assert maps.newest.arrived == before.arrived == maps.arrivals.last
    assert maps.age >= 0.3
    assert not maps.wait(0.0, always, newer_than=before.arrived)


def test_a_cancelled_goal_and_a_closed_node_wait_no_longer(maps, rules):
    rules.gate.clear()
    maps.take(map_with((1, 1)))

    def cancelled():
        raise RequestError(ResultCode.TIMEOUT, 'canceled')

    began = time.monotonic()
    with pytest.raises(RequestError):
        maps.wait(PATIENCE, cancelled)
    waiting = threading.Thread(target=maps.wait, args=(PATIENCE, always))
    waiting.start()
    closing = threading.Thread(target=maps.close)
    closing.start()
    waiting.join()
    assert time.monotonic() - began < PATIENCE / 2
    rules.gate.set()
    closing.join()


def test_a_map_of_another_size_between_updates_and_updates_off_it_leave_the_last_good_map():
    entities, taken = Mock(), []
    entities.node.get_clock().now.return_value.nanoseconds = 0
    subscription = MapSubscription(entities, lambda grid_map, _: taken.append(grid_map))
    errors = entities.node.get_logger().error

    def update(x, sec=0, value=100):
        header = SimpleNamespace(frame_id='', stamp=Time(sec=sec))
        subscription._on_part(
            SimpleNamespace(header=header, x=x, y=0, width=1, height=1, data=[value])
        )

    update(0)
    assert 'it came before its map' in errors.call_args[0][0]
    subscription._on_whole(grid_to_message(map_with(), Time(sec=1)))
    update(39, sec=2)
    smaller = map_with(shape=(10, 20))
    subscription._on_whole(grid_to_message(smaller, Time(sec=3)))
    assert len(taken) == 3
    update(5, sec=2)  # of the map before
    update(39, sec=4)
    assert 'do not lie on a map of 20 x 10' in errors.call_args[0][0]
    assert f'map {smaller.digest} stays' in errors.call_args[0][0]
    update(5, sec=5, value=101)
    assert 'values must lie in' in errors.call_args[0][0]
    update(5, sec=6)
    assert len(taken) == 4
    assert taken[-1].digest == map_with((5, 0), shape=(10, 20)).digest


def test_a_message_says_how_long_it_was_under_way_if_its_stamp_is_of_just_now():
    node, transits = rclpy.create_node('stamps'), []
    entities = Mock(node=node)
    subscription = MapSubscription(entities, lambda _, transit: transits.append(transit))
    now = node.get_clock().now()

    def send(seconds):
        stamp = (now - Duration(seconds=seconds)).to_msg()
        subscription._on_whole(grid_to_message(map_with(), stamp))

    send(0.2)
    send(60.0)
    send(-60.0)
    subscription._on_whole(grid_to_message(map_with(), Time()))
    subscription._on_whole(SimpleNamespace())  # refused
    node.destroy_node()
    assert len(transits) == 4
    assert 0.2 <= transits[0] < 30.0
    assert transits[1:] == [0.0, 0.0, 0.0]


@contextlib.contextmanager
def slow_preparation(monkeypatch):
    """Let preparations of maps wait until the event yielded is set."""
    go, begun = threading.Event(), threading.Event()
    make_planner = MapManager.make_planner

    def wait_and_make(self, *arguments):
        begun.set()
        go.wait(PATIENCE)
        return make_planner(self, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(MapManager, 'make_planner', wait_and_make)
        try:
            yield go, begun
        finally:
            go.set()


def test_the_report_says_which_map_was_planned_on_and_how_old_it_was(monkeypatch):
    node = PlannerNode(
        namespace=NAMESPACE,
        parameter_overrides=[
            Parameter('llm_client', value=''),
            Parameter('max_planning_time', value=PATIENCE),
            Parameter('costmap_update_timeout', value=PATIENCE),
        ],
    )
    with running(node), calling(NAMESPACE) as caller:
        maps = caller.node.create_publisher(OccupancyGrid, 'map', LATCHED)

        def show(*cells):
            grid_map = map_with(*cells)
            maps.publish(grid_to_message(grid_map, Time()))
            return grid_map.digest

        old = show((1, 1))
        caller.wait_until_ready(old)
        report = caller.call(START, GOAL)[1]
        assert (report.map_digest, report.warnings) == (old, ())
        assert 0.0 < report.map_age < PATIENCE
        with slow_preparation(monkeypatch) as (go, begun):
            new = show((2, 2))
            assert begun.wait(PATIENCE)
            threading.Timer(0.1, go.set).start()
            report = caller.call(START, GOAL)[1]
        assert (report.code, report.map_digest, report.warnings) == (0, new, ())
        assert report.map_age >= 0.1
        assert set_parameter(caller, 'planner_node', 'costmap_update_timeout', 0.05).successful
        with slow_preparation(monkeypatch) as (_, begun):
            show((3, 3))
            assert begun.wait(PATIENCE)
            report = caller.call(START, GOAL)[1]
            assert (report.code, report.map_digest) == (0, new)
            [warning] = report.warnings
            assert 'the newest map was not ready after 0.0' in warning
        assert set_parameter(caller, 'planner_node', 'costmap_update_timeout', PATIENCE).successful
        with slow_preparation(monkeypatch) as (_, begun):
            show((4, 4))
            assert begun.wait(PATIENCE)
            threading.Timer(0.1, node.trigger_deactivate).start()
            report = caller.call(START, GOAL, seconds=PATIENCE / 4)[1]
            assert (report.code_name, report.map_digest) == ('TIMEOUT', '')
            assert 'the node was deactivated' in report.message

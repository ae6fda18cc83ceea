"""Zones and filter masks of a running planner: what plans, replans and other nodes see of them."""

import contextlib
import json
import time
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.srv import AddDiagnostics
from graph_tools import PATIENCE, calling, running, set_parameter, wait_for
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_msgs_adapter.messages.writing import grid_to_message, path_to_message
from llm_astar_planner.costmap.zone_layer import FilterInfo, FilterKind, FilterMask
from llm_astar_planner.costmap.zones import ZonesError
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE
from llm_astar_planner.nodes.common.tf import FrameError
from llm_astar_planner.nodes.planner import zone_server
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.nodes.planner.zone_server import MaskSubscription, ZoneServer
from llm_astar_planner.parameter import ParameterError
from nav_msgs.msg import OccupancyGrid, Path
from nav_msgs.srv import GetPlan
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

SPACE = '/zones'
START, GOAL = Pose2D(5.5, 5.5), Pose2D(35.5, 5.5)
WAYPOINTS = [(15.5, 15.5), (20.5, 20.5)]
# Across the straight way from start to goal.
WALL = 18.0, 0.0, 22.0, 12.0


class Waypoints(Node):
    """A waypoint client that answers the same waypoints, whatever it is asked."""

    def __init__(self):
        super().__init__('llm_client_node', namespace=SPACE)
        self.create_service(
            GetPlan, '~/get_waypoints', self._answer, callback_group=ReentrantCallbackGroup()
        )

    def _answer(self, request, response):
        response.plan = path_to_message(WAYPOINTS, 'map', self.get_clock().now().to_msg())
        return response


def ring(box):
    x0, y0, x1, y1 = box
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]


def zone(box=WALL, **properties):
    geometry = {'type': 'Polygon', 'coordinates': [ring(box)]}
    return {'type': 'Feature', 'geometry': geometry, 'properties': properties}


def geojson(*zones, **members):
    return json.dumps({'type': 'FeatureCollection', 'features': list(zones)} | members)


def grid(width=40):
    cells = np.zeros((30, width), dtype=np.int8)
    cells[25, 3] = 100
    return GridMap(cells)


class Graph:
    """The planner as its callers see it."""

    def __init__(self, caller, planner):
        self.caller, self.planner = caller, planner
        node = caller.node
        self.adding = node.create_client(AddDiagnostics, 'planner_node/add_zones')
        self.removing = node.create_client(AddDiagnostics, 'planner_node/remove_zones')
        self.maps = node.create_publisher(OccupancyGrid, 'map', LATCHED)
        self.plans, self.shown = [], []
        node.create_subscription(Path, 'plan', self.plans.append, RELIABLE)
        node.create_subscription(String, 'planner_node/zones_geojson', self.shown.append, LATCHED)

    def show(self, grid_map):
        self.maps.publish(grid_to_message(grid_map, Time()))

    def ask(self, client, text):
        request = AddDiagnostics.Request(load_namespace=text)
        answer = self.caller.ask(client, request)
        return answer.success, answer.message

    def add(self, *zones, **members):
        return self.ask(self.adding, geojson(*zones, **members))

    def remove(self, text='*'):
        return self.ask(self.removing, text)

    def plan(self, start=START, goal=GOAL):
        path, report = self.caller.call(start, goal)[:2]
        return path_from_message(path), report


@pytest.fixture(scope='module')
def running_graph():
    rclpy.init()
    overrides = {
        'tolerance': 0.0,
        'use_waypoints': False,
        'search_while_waiting': False,
        'max_planning_time': PATIENCE,
        'costmap_update_timeout': PATIENCE,
        'max_suboptimality': 1.0,
    }
    planner = PlannerNode(
        namespace=SPACE,
        parameter_overrides=[Parameter(name, value=value) for name, value in overrides.items()],
    )
    with running(planner, Waypoints()), calling(SPACE) as caller:
        graph = Graph(caller, planner)
        graph.show(grid())
        caller.wait_until_ready(grid().digest, seconds=PATIENCE)
        assert graph.adding.wait_for_service(PATIENCE)
        assert graph.removing.wait_for_service(PATIENCE)
        yield graph
    rclpy.try_shutdown()


@pytest.fixture
def graph(running_graph):
    running_graph.remove()
    running_graph.plans.clear()
    yield running_graph
    running_graph.show(grid())


def within(points, box=WALL):
    x, y = points[:, 0], points[:, 1]
    return bool(((x > box[0]) & (x < box[2]) & (y > box[1]) & (y < box[3])).any())


def test_a_keepout_zone_across_the_last_path_is_replanned_around_and_expires(graph):
    straight, _ = graph.plan()
    assert within(straight)
    wait_for(lambda: graph.plans, 'the first path')
    graph.plans.clear()
    said = graph.add(zone(id='wall', name='wet floor'))
    assert said == (True, 'added wall (wet floor); 1 in all')
    wait_for(lambda: graph.plans, 'the path around')
    assert not within(path_from_message(graph.plans[-1]))
    around, report = graph.plan()
    assert not within(around)
    assert report.zones == ('wall (wet floor)',)
    wait_for(lambda: 'wet floor' in graph.shown[-1].data, 'the zone')
    # The same id replaces it, by one that ends.
    assert graph.add(zone(id='wall', name='wet floor', seconds=0.3))[0]
    wait_for(lambda: 'wet floor' not in graph.shown[-1].data, 'the expiry')
    again, report = graph.plan()
    assert again.tolist() == straight.tolist()
    assert report.zones == ()


def test_a_one_way_against_the_last_path_is_replanned_around_and_drawn_with_an_arrow(graph):
    straight, _ = graph.plan()
    wait_for(lambda: graph.plans, 'the first path')
    graph.plans.clear()
    seen = []
    graph.caller.node.create_subscription(MarkerArray, 'planner_node/zones', seen.append, LATCHED)
    rule = {'kind': 'one_way', 'heading': 180.0}
    assert graph.add(zone(id='west', **rule)) == (True, 'added west; 1 in all')
    wait_for(
        lambda: graph.plans and not within(path_from_message(graph.plans[-1])), 'the path around'
    )
    back, report = graph.plan(GOAL, START)
    assert report.zones == ('west',)
    assert len(back) == len(straight)
    wait_for(
        lambda: seen and any(one.type == Marker.ARROW for one in seen[-1].markers), 'an arrow'
    )
    wait_for(lambda: '"kind": "one_way"' in graph.shown[-1].data, 'the zone')


def test_a_cost_is_gone_around_where_that_is_cheaper(graph):
    around, _ = graph.plan()
    graph.add(zone((18.0, 3.0, 22.0, 8.0), id='slow', cost=60))
    dear, report = graph.plan()
    assert (report.code, report.zones) == (0, ('slow',))
    assert not within(dear, (18.0, 3.0, 22.0, 8.0))
    graph.add(zone((18.0, 0.0, 22.0, 30.0), id='slow', cost=60))
    through, report = graph.plan()
    assert report.code == 0
    assert within(through, (18.0, 0.0, 22.0, 30.0))
    assert graph.remove('slow') == (True, 'removed slow; 0 left')
    assert graph.plan()[0].tolist() == around.tolist()


def test_zones_survive_new_maps_of_any_size_and_changed_rules(graph):
    graph.add(zone(id='a'), zone((50.0, 0.0, 52.0, 9.0), id='b', name='later'))
    digest = graph.plan()[1].map_digest
    graph.show(grid(width=60))
    wait_for(lambda: graph.plan()[1].map_digest != digest, 'the larger map')
    points, report = graph.plan(goal=Pose2D(55.5, 5.5))
    assert report.zones == ('a', 'b (later)')
    assert not within(points)
    assert not within(points, (50.0, 0.0, 52.0, 9.0))
    graph.add(zone((0.0, 15.0, 60.0, 16.0), id='line', cost=90))
    for threshold in (50, 99):
        assert set_parameter(
            graph.caller, 'planner_node', 'occupied_threshold', threshold
        ).successful
        assert graph.plan(goal=Pose2D(5.5, 20.5))[1].code == 0
    assert set_parameter(graph.caller, 'planner_node', 'occupied_threshold', 65).successful


def test_a_wrong_request_changes_nothing_and_says_what_is_wrong(graph):
    graph.add(zone(id='good'))
    wait_for(lambda: 'good' in graph.shown[-1].data, 'the zone')
    for text, problem in (
        (geojson(zone(), zone(cost=0)), 'zones: feature 1: cost'),
        (geojson(zone(id='x'), zone(id='x')), 'id of another zone'),
        (geojson(zone(), frame_id='odom'), "'odom'"),
        ('[' * 100_000, 'nested too deeply'),
        ('', 'not JSON'),
    ):
        success, message = graph.ask(graph.adding, text)
        assert not success
        assert problem in message
    assert graph.remove('nobody') == (False, "no zone has the id or name 'nobody'; there is good")
    assert [one['id'] for one in json.loads(graph.shown[-1].data)['features']] == ['good']
    assert not within(graph.plan()[0])


def test_a_zone_off_the_map_is_accepted_with_a_warning(graph):
    success, message = graph.add(zone((90.0, 90.0, 99.0, 99.0), id='far'))
    assert (success, message) == (True, 'added far; 1 in all; off the map as it is now: far')


def test_zones_are_removed_by_id_name_or_all(graph):
    names = {'a': 'dock', 'b': 'dock', 'c': 'door', 'd': ''}
    graph.add(*(zone(id=number, name=name) for number, name in names.items()))
    assert graph.remove('dock') == (True, 'removed a (dock), b (dock); 2 left')
    assert graph.remove('c') == (True, 'removed c (door); 1 left')
    wait_for(lambda: '"c"' not in graph.shown[-1].data, 'one zone')
    assert graph.remove('*') == (True, 'removed d; 0 left')
    assert graph.remove('*') == (True, 'removed none; 0 left')


def test_a_viewer_that_comes_late_sees_the_zones(graph):
    graph.add(zone(id='a', name='dock'), zone(id='b', cost=20, seconds=100))
    wait_for(lambda: 'dock' in graph.shown[-1].data, 'the zones')
    seen = []
    graph.caller.node.create_subscription(MarkerArray, 'planner_node/zones', seen.append, LATCHED)
    wait_for(lambda: seen, 'the markers')
    assert [marker.text for marker in seen[-1].markers if marker.text] == ['a (dock)', 'b']
    first, second = json.loads(graph.shown[-1].data)['features']
    assert first['properties']['seconds'] is None
    assert 0.0 < second['properties']['seconds'] <= 100.0


def test_waypoints_in_a_keepout_zone_are_dropped(graph):
    set_parameter(graph.caller, 'planner_node', 'use_waypoints', True)
    try:
        assert [status for _, _, status in graph.plan()[1].waypoints] == ['accepted', 'accepted']
        graph.add(zone((19.0, 19.0, 22.0, 22.0), id='closed'))
        report = graph.plan()[1]
        assert (report.code, report.source_status) == (0, 'OK')
        assert [status for _, _, status in report.waypoints] == ['accepted', 'occupied']
    finally:
        set_parameter(graph.caller, 'planner_node', 'use_waypoints', False)


def test_a_flood_of_requests_is_answered_and_bounded(graph):
    texts = [geojson(zone((x, 20.0, x + 1.0, 21.0), id=str(x))) for x in range(30)]
    began = time.monotonic()
    requests = [AddDiagnostics.Request(load_namespace=text) for text in texts * 3]
    futures = [graph.adding.call_async(request) for request in requests]
    bad = AddDiagnostics.Request(load_namespace='{')
    futures += [graph.adding.call_async(bad) for _ in range(8)]
    assert graph.plan()[1].code == 0
    wait_for(lambda: all(future.done() for future in futures), 'the answers')
    assert sum(future.result().success for future in futures) == len(requests)
    assert graph.remove('*')[1].endswith('and 20 more; 0 left')
    assert time.monotonic() - began < PATIENCE


def test_is_path_valid_knows_the_zones(graph):
    services = pytest.importorskip('nav2_msgs.srv', reason='nav2_msgs is not installed')
    client = graph.caller.node.create_client(services.IsPathValid, 'is_path_valid')
    path = path_to_message([(5.5, 5.5), (19.5, 5.5), (35.5, 5.5)], 'map', Time())

    def is_valid():
        return graph.caller.ask(client, services.IsPathValid.Request(path=path)).is_valid

    assert is_valid()
    graph.add(zone(id='wall'))
    wait_for(lambda: not is_valid(), 'the zone')
    graph.remove('wall')
    wait_for(is_valid, 'the way')


@contextlib.contextmanager
def publishing(graph, kind, topic, message):
    """Have a latched message on a topic."""
    publisher = graph.caller.node.create_publisher(kind, topic, LATCHED)
    publisher.publish(message)
    try:
        yield publisher
    finally:
        graph.caller.node.destroy_publisher(publisher)


def test_masks_of_nav2_become_costs(graph):
    messages = pytest.importorskip('nav2_msgs.msg', reason='nav2_msgs is not installed')
    cells = np.full((15, 8), -1, dtype=np.int8)
    cells[:6, 3:5] = 100
    # Cells of two metres, so that the mask covers 16 m to 20 m of the way.
    keepout = GridMap(cells, 2.0, Pose2D(10.0, 0.0))
    info = messages.CostmapFilterInfo(type=0, filter_mask_topic='/zones/keepout', multiplier=1.0)
    with (
        publishing(graph, OccupancyGrid, '/zones/keepout', grid_to_message(keepout, Time())) as to,
        publishing(graph, messages.CostmapFilterInfo, 'costmap_filter_info', info) as infos,
    ):
        wait_for(lambda: not within(graph.plan()[0], (16.0, 0.0, 20.0, 12.0)), 'the mask')
        graph.show(grid(width=41))
        wait_for(lambda: not within(graph.plan()[0], (16.0, 0.0, 20.0, 12.0)), 'the map')
        # A malformed mask and a wrong info leave the last one.
        broken = grid_to_message(keepout, Time())
        broken.info.width = 9
        to.publish(broken)
        infos.publish(messages.CostmapFilterInfo(type=7, filter_mask_topic='x'))
        infos.publish(messages.CostmapFilterInfo(type=1, filter_mask_topic='no topic!'))
        graph.add(zone((0.0, 28.0, 1.0, 29.0)))
        assert not within(graph.plan()[0], (16.0, 0.0, 20.0, 12.0))
        to.publish(grid_to_message(GridMap(np.zeros_like(cells), 2.0), Time()))
        wait_for(lambda: within(graph.plan()[0], (16.0, 0.0, 20.0, 12.0)), 'the free mask')
        # A quarter of the speed costs four times the time.
        cells[:6, 3:5] = 25
        speed = grid_to_message(GridMap(np.maximum(cells, 0), 2.0, Pose2D(10.0, 0.0)), Time())
        info = messages.CostmapFilterInfo(type=2, filter_mask_topic='slow', multiplier=0.01)
        with publishing(graph, OccupancyGrid, 'slow', speed):
            infos.publish(info)
            set_parameter(graph.caller, 'planner_node', 'cost_travel_multiplier', 4.0)
            set_parameter(graph.caller, 'planner_node', 'max_speed', 1.0)
            wait_for(lambda: not within(graph.plan()[0], (16.0, 0.0, 20.0, 12.0)), 'the limit')
            set_parameter(graph.caller, 'planner_node', 'max_speed', 0.0)
            assert within(graph.plan()[0], (16.0, 0.0, 20.0, 12.0))
            set_parameter(graph.caller, 'planner_node', 'cost_travel_multiplier', 2.0)


class Settings(dict):
    def values(self):
        return dict(self)


@pytest.fixture
def server():
    """A zone server without a graph."""
    entities, frames = Mock(), Mock()
    server = ZoneServer(
        entities, Mock(), Settings(max_speed=0.0, occupied_threshold=99), frames, Mock()
    )
    entities.node.get_clock().now().to_msg.return_value = Time()
    return server


def test_a_map_or_mask_that_cannot_be_composed_leaves_the_last_one(server, monkeypatch):
    server.take(grid())
    server.add_text(geojson(zone(id='a')))
    handed_on = server.on_map
    assert (handed_on.call_args[0][0].cells[:12, 18:22] == 100).all()
    count = handed_on.call_count
    with monkeypatch.context() as patch:
        patch.setattr(
            'llm_astar_planner.costmap.zone_layer.ZoneLayer', Mock(side_effect=MemoryError)
        )
        server.take(grid(width=50))
        with pytest.raises(MemoryError):
            server.add_text(geojson(zone(id='b')))
    assert handed_on.call_count == count
    assert [one.id for one in server.zones] == ['a']
    server.take(grid(width=50))
    assert handed_on.call_args[0][0].cells.shape == (30, 50)


def test_zones_before_a_map_wait_for_it_and_those_of_another_frame_are_refused(server):
    with pytest.raises(ZonesError, match="'map' is not that of the map; leave it out"):
        server.add_text(geojson(zone(), frame_id='map'))
    assert server.add_text(geojson(zone(id='a'))) == 'added a; 1 in all'
    server.on_map.assert_not_called()
    server.take(grid())
    assert server.on_map.call_args[0][0].zones == ('a',)
    server.add_text(geojson(zone(id='b'), frame_id='map'))
    with pytest.raises(ZonesError, match="'odom' is not that of the map"):
        server.add_text(geojson(zone(), frame_id='odom'))
    assert [one.id for one in server.zones] == ['a', 'b']


def speed_mask(topic='slow', kind=FilterKind.SPEED_ABSOLUTE, frame_id='map'):
    cells = np.full((30, 40), 50, dtype=np.int8)
    return FilterMask(FilterInfo(kind, topic, 0.0, 0.01), GridMap(cells, frame_id=frame_id))


def test_a_mask_that_cannot_be_used_yet_is_tried_again_with_the_next_map(server):
    server.take(grid())
    server.frames.locate.side_effect = FrameError('no transform')
    server.use(masks=[speed_mask(frame_id='odom')])
    server.take(grid())
    cells = server.on_map.call_args[0][0].cells
    assert (cells == grid().cells).all(), 'the speed of the robot is not known'
    server.settings['max_speed'] = 1.0
    server.refresh()
    assert (server.on_map.call_args[0][0].cells == grid().cells).all(), 'nor the transform'
    server.frames.locate = Mock(return_value=Pose2D(0.0, 0.0))
    server.take(grid())
    # Half of the speed takes twice the time, so the cost of a cell doubles: 1 + 2 * 50 / 100.
    assert server.on_map.call_args[0][0].cells[0, 0] == 50
    assert server.values() == {'zones': 0, 'filter_masks': 1}


def test_masks_replace_those_of_their_sort_and_stay_when_the_next_is_wrong():
    parent, taken = Mock(), []
    masks = MaskSubscription(Mock(), parent, '', taken.append)

    def info(**fields):
        fields = {'type': 0, 'base': 0.0, 'multiplier': 1.0, 'filter_mask_topic': 'a'} | fields
        masks.on_info(SimpleNamespace(**fields))
        return masks._infos

    message = grid_to_message(grid(), Time())
    keepout = info()[True]
    masks.on_mask(keepout, message)
    speed = info(type=1, filter_mask_topic='b')[False]
    masks.on_mask(speed, message)
    assert [[mask.info.topic for mask in one] for one in taken] == [['a'], ['a', 'b']]
    for wrong in ({'type': 3}, {'base': float('nan')}, {'filter_mask_topic': ''}):
        info(**wrong)
        assert masks._infos == {True: keepout, False: speed}
    assert parent.get_logger().error.call_count == 3
    broken = grid_to_message(grid(), Time())
    broken.info.resolution = 0.0
    masks.on_mask(keepout, broken)
    assert 'the last one stays: resolution' in parent.get_logger().error.call_args[0][0]
    newer = info(filter_mask_topic='c')[True]
    masks.on_mask(keepout, message)  # of the subscription before
    assert len(taken) == 2
    masks.on_mask(newer, message)
    assert sorted(mask.info.topic for mask in taken[-1]) == ['b', 'c']


def test_an_impossible_topic_of_masks_is_named(monkeypatch):
    parent = Mock()
    parent.resolve_topic_name.side_effect = InvalidTopicNameException('bad', 'a space', 0)
    monkeypatch.setattr(zone_server, 'CostmapFilterInfo', object())
    with pytest.raises(ParameterError, match=r'filter_info_topic: .*a space'):
        MaskSubscription(Mock(), parent, 'no topic', Mock())

"""Zones: what they cost on a map, against shapely, and what is refused."""

import json
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import ORIGIN, GridMap, Pose2D
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.costmap.zone_layer import ZoneLayer
from llm_astar_planner.costmap.zones import (
    MAX_TOTAL_VERTICES,
    MAX_VERTICES,
    MAX_ZONES,
    NO_ZONES,
    Zone,
    Zones,
    ZonesError,
    zones_from_text,
    zones_to_geojson,
)

SHAPE = 12, 16
SQUARE = [[1, 1], [4, 1], [4, 3], [1, 3], [1, 1]]
COSTMAP = CostmapConfig(occupied_threshold=99, unknown_cost=0)


def a_map(random, resolution=1.0, origin=ORIGIN):
    cells = random.choice(np.array([-1, 0, 0, 0, 30, 98, 100], dtype=np.int8), SHAPE)
    return GridMap(cells, resolution, origin)


def random_zone(random, number, grid_map):
    middle = grid_map.grid_to_world([random.uniform(-2, 16, 2)])[0]
    size = grid_map.resolution
    kind = random.integers(0, 3)
    if kind == 0:
        geometry = shapely.Point(middle).buffer(size * random.uniform(0.1, 6))
    elif kind == 1:
        points = middle + size * random.uniform(-6, 6, (6, 2))
        geometry = shapely.convex_hull(shapely.MultiPoint(points))
    else:
        outer, inner = (shapely.Point(middle).buffer(size * radius) for radius in (5, 3))
        geometry = shapely.union(outer.difference(inner), shapely.Point(middle).buffer(size))
    return Zone(str(number), geometry, int(random.integers(1, 101)))


def squares(grid_map):
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    cells = [(x, y) for y in range(grid_map.height) for x in range(grid_map.width)]
    points = [grid_map.grid_to_world(corners + cell) for cell in cells]
    return np.array([shapely.Polygon(ring) for ring in points]).reshape(grid_map.cells.shape)


@pytest.mark.parametrize('seed', range(25))
def test_a_cell_has_the_highest_cost_of_the_zones_that_touch_it(seed):
    random = np.random.default_rng(seed)
    resolution = float(random.choice([1.0, 0.05]))
    origin = Pose2D(*random.uniform(-3, 3, 2), float(random.choice([0.0, 0.5, -2.0])))
    grid_map = a_map(random, resolution, origin)
    zones = [random_zone(random, number, grid_map) for number in range(4)]
    composed = ZoneLayer(grid_map, zones, config=COSTMAP).compose(grid_map)
    cells = squares(grid_map)
    expected = grid_map.cells.copy()
    unsure = np.zeros(SHAPE, dtype=bool)
    for zone in zones:
        area = shapely.area(shapely.intersection(cells, zone.geometry)) / resolution**2
        unsure |= (area > 0) & (area < 1e-6)
        cost = zone.cost if zone.cost == 100 else min(zone.cost, 98)
        expected = np.where(area >= 1e-6, np.maximum(expected, cost), expected)
    np.testing.assert_array_equal(composed.cells[~unsure], expected[~unsure])


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_removing_zones_restores_the_cells_and_their_order_does_not_matter(seed):
    random = np.random.default_rng(seed)
    grid_map = a_map(random)
    zones = Zones(random_zone(random, number, grid_map) for number in range(5))
    some = tuple(zone for zone in zones if random.random() < 0.5)

    def composed(zones):
        return ZoneLayer(grid_map, zones).compose(grid_map)

    before = composed(zones.remove(some))
    again = composed(Zones(reversed(tuple(zones.remove(some).add(some)))))
    np.testing.assert_array_equal(again.cells, composed(zones).cells)
    np.testing.assert_array_equal(composed(zones.remove(some)).cells, before.cells)
    assert composed(zones.remove(zones)) is grid_map
    assert (again.cells >= grid_map.cells).all()


def test_only_keepout_zones_close_cells_whatever_the_threshold():
    grid_map = GridMap(np.zeros(SHAPE, dtype=np.int8))
    zones = [Zone('a', shapely.box(0, 0, 4, 4), 99), Zone('b', shapely.box(8, 0, 10, 4))]
    for config in (CostmapConfig(), COSTMAP, CostmapConfig(occupied_threshold=1)):
        cells = ZoneLayer(grid_map, zones, config=config).compose(grid_map).cells
        blocked = Costmap(GridMap(cells), config).blocked
        assert not blocked[:4, :4].any()
        assert blocked[:4, 8:10].all()
        assert blocked.sum() == 8
        assert cells[0, 0] == min(98, config.occupied_threshold - 1)


def test_a_cost_neither_opens_unknown_cells_nor_makes_them_cheaper():
    grid_map = GridMap(np.full(SHAPE, -1, dtype=np.int8))
    zones = [Zone('a', shapely.box(0, 0, 4, 4), 20), Zone('b', shapely.box(3, 0, 6, 4))]
    config = CostmapConfig(allow_unknown=False)
    closed = ZoneLayer(grid_map, zones, config=config).compose(grid_map)
    assert Costmap(closed, config).blocked.all()
    assert closed.cells[0].tolist()[:7] == [-1, -1, -1, 100, 100, 100, -1]
    for unknown_cost, value in ((0, 20), (19, 20), (20, -1), (98, -1)):
        config = CostmapConfig(unknown_cost=unknown_cost)
        cells = ZoneLayer(grid_map, zones, config=config).compose(grid_map).cells
        assert cells[0].tolist()[:7] == [value, value, value, 100, 100, 100, -1]


def test_a_map_names_its_zones():
    grid_map = GridMap(np.zeros(SHAPE, dtype=np.int8))
    zones = [Zone(str(n), shapely.box(n % 9, 0, n % 9 + 1, 1), name=f'n{n}') for n in range(30)]
    off = Zone('off', shapely.box(50, 50, 60, 60))
    assert ZoneLayer(grid_map, [off]).compose(grid_map) is grid_map
    names = ZoneLayer(grid_map, [off, *zones]).compose(grid_map).zones
    assert names[:2] == ('0 (n0)', '1 (n1)')
    assert names[-1] == 'and 10 more'


def test_a_layer_fits_maps_that_lie_alike():
    grid_map = GridMap(np.zeros(SHAPE, dtype=np.int8))
    layer = ZoneLayer(grid_map, [Zone('a', shapely.box(0, 0, 2, 2))])
    other = GridMap(np.full(SHAPE, 7, dtype=np.int8))
    assert layer.fits(other)
    assert layer.compose(other).cells[3, 3] == 7
    assert not layer.fits(GridMap(other.cells, origin=Pose2D(1.0, 0.0)))
    assert not layer.fits(GridMap(np.zeros((12, 17), dtype=np.int8)))


def test_a_zone_changes_the_costmap_in_its_window_only():
    grid_map = GridMap(np.zeros((300, 300), dtype=np.int8))
    before = Costmap(grid_map)
    before.prepare()
    zone = Zone('a', shapely.box(100.2, 200.2, 103.5, 205.5))
    after = Costmap(ZoneLayer(grid_map, [zone]).compose(grid_map), previous=before)
    assert after.changes.tolist() == [[199, 207, 99, 105]]


def test_zones_are_added_replaced_found_removed_and_expire():
    box = shapely.box(0, 0, 1, 1)
    zones = NO_ZONES.add([Zone('a', box, name='dock', expires=10.0), Zone('b', box, name='dock')])
    assert zones.next_expiry == 10.0
    assert [zone.id for zone in zones.find('dock')] == ['a', 'b']
    assert [zone.id for zone in zones.find('a')] == ['a']
    assert zones.find('c') == ()
    assert zones.expired(9.9) == ()
    assert [zone.id for zone in zones.expired(10.0)] == ['a']
    left = zones.remove(zones.expired(10.0))
    assert [zone.id for zone in left] == ['b']
    assert left.next_expiry == math.inf
    replaced = left.add([Zone('b', box, cost=5)])
    assert [zone.cost for zone in replaced] == [5]
    assert len(zones) == 2, 'zones are immutable'


def feature(coordinates=(SQUARE,), kind='Polygon', **members):
    geometry = {'type': kind, 'coordinates': list(coordinates)}
    return {'type': 'Feature', 'geometry': geometry, 'properties': {}} | members


def text_of(*features, **members):
    return json.dumps({'type': 'FeatureCollection', 'features': list(features)} | members)


def test_geojson_is_read_and_written():
    hole = [[2, 1.5], [3, 1.5], [3, 2.5], [2, 1.5]]
    first = feature([SQUARE, hole], id=7, properties={'cost': 40.0, 'name': ' a  dock '})
    second = feature([[SQUARE]], 'MultiPolygon', properties={'seconds': 5, 'id': 'b'})
    zones, frame = zones_from_text(text_of(first, second, feature(properties=None)), 100.0)
    assert [zone.label for zone in zones[:2]] == ['7 (a dock)', 'b']
    assert len(zones[2].id) == 36
    assert [zone.cost for zone in zones] == [40, 100, 100]
    assert [zone.expires for zone in zones] == [None, 105.0, None]
    assert [zone.geometry.area for zone in zones] == [5.5, 6.0, 6.0]
    assert frame == ''
    collection = zones_to_geojson(Zones(zones), 102.0, 'odom')
    again, frame = zones_from_text(json.dumps(collection), 102.0)
    assert [(one.label, one.cost, one.expires) for one in again] == [
        (one.label, one.cost, one.expires) for one in zones
    ]
    assert all(a.geometry.equals(b.geometry) for a, b in zip(again, zones, strict=True))
    assert frame == 'odom'


LINE = [[0, 0], [4, 0], [4, 4]]


def test_rules_of_the_road_are_read_and_written():
    rules = {'kind': 'one_way', 'heading': 90, 'id': 'a'}, {'kind': 'keep_right', 'width': 2}
    text = text_of(
        feature(properties=rules[0]),
        feature(LINE, 'LineString', properties=rules[1]),
        feature([LINE], 'MultiLineString', properties={'kind': 'preferred', 'width': 0.5}),
        feature(LINE, 'LineString', properties={'width': 1, 'cost': 30}),
    )
    zones, _ = zones_from_text(text, 0.0)
    assert [zone.cost for zone in zones] == [0, 0, 50, 30]
    assert [zone.rule for zone in zones] == [
        {'kind': 'one_way', 'heading': 90.0},
        {'kind': 'keep_right', 'width': 2.0},
        {'kind': 'preferred', 'width': 0.5},
        {'width': 1.0},
    ]
    again, _ = zones_from_text(json.dumps(zones_to_geojson(Zones(zones), 0.0, 'map')), 0.0)
    assert [zone.rule for zone in again] == [zone.rule for zone in zones]
    assert [len(zone.arrows()) for zone in again] == [1, 2, 0, 0]
    assert again[1].area.area == pytest.approx(16.0 + math.pi - 1.0 + math.pi / 4.0, rel=0.02)


def test_the_edges_of_a_nav2_route_graph_are_preferred_lines():
    nodes = [feature([x, 0], 'Point', properties={'id': x, 'frame': 'map'}) for x in (0, 4)]
    edges = [
        feature([[0, 0], [4, 0]], 'LineString', properties={'id': 5, 'startid': 0, 'endid': 4}),
        feature([[[4, 0], [4, 4]]], 'MultiLineString',
                properties={'id': 6, 'startid': 4, 'endid': 0, 'cost': 3.5}),
    ]  # fmt: skip
    zones, _ = zones_from_text(text_of(*nodes, *edges, feature(id='spill')), 0.0)
    assert [(zone.id, zone.cost) for zone in zones] == [('spill', 100), ('route graph', 50)]
    assert zones[1].rule == {'kind': 'preferred', 'width': 1.0}
    assert zones[1].geometry.length == 8.0
    (graph,), _ = zones_from_text(text_of(*nodes, *edges, width=2, cost=80), 0.0)
    assert (graph.width, graph.cost) == (2.0, 80)


def circle(count):
    angles = np.linspace(0, 2 * np.pi, count - 1, endpoint=False)
    points = np.stack([np.cos(angles), np.sin(angles)], axis=1).tolist()
    return [*points, points[0]]


def deep(count):
    nested = []
    for _ in range(count):
        nested = [nested]
    return nested


BOWTIE = [[0, 0], [2, 2], [2, 0], [0, 2], [0, 0]]
BAD = {
    'no JSON': ('{"type"', 'not JSON'),
    'a list': ('[]', 'FeatureCollection is expected'),
    'NaN': (text_of(feature([[[0, 0], [math.nan, 1], [1, 1], [0, 0]]])), 'not nan'),
    'deep': ('[' * 100_000, 'nested too deeply'),
    'deep coordinates': (text_of(feature([deep(400)] * 4)), 'is expected'),
    'no feature': (text_of(), 'features: 0 are not 1 to 1000'),
    'many': (text_of(*[feature()] * 10_000), '10000 are not 1 to 1000'),
    'crossing': (text_of(feature([BOWTIE])), 'feature 0: coordinates: Self-intersection'),
    'two points': (
        text_of(feature(), feature([[[0, 0], [1, 1]]])),
        'feature 1: coord.*4 coord',
    ),
    'a line': (text_of(feature([[[0, 0], [1, 1], [2, 2], [0, 0]]])), 'feature 0: coordinates'),
    '1e300': (text_of(feature([[[0, 0], [1e300, 0], [1, 1], [0, 0]]])), 'metres are expected'),
    'huge': (text_of(feature([[[0, 0], [10**400, 0], [1, 1], [0, 0]]])), 'metres are expected'),
    'text': (text_of(feature([[[0, 0], ['1', 0], [1, 1], [0, 0]]])), 'metres are expected'),
    'vertices': (text_of(feature([[[1, 1]] * 100_000])), '100000 points are over 10000'),
    'a point': (
        text_of(feature([1, 2], 'Point')),
        "feature 0: geometry: 'Point' is not one",
    ),
    'no geometry': (text_of(feature(geometry=None)), 'feature 0: geometry'),
    'cost 0': (
        text_of(feature(properties={'cost': 0})),
        'feature 0: cost: a number from 1 to',
    ),
    'cost 101': (text_of(feature(properties={'cost': 101})), 'cost'),
    'cost 1.5': (text_of(feature(properties={'cost': 1.5})), 'cost'),
    'cost true': (text_of(feature(properties={'cost': True})), 'cost'),
    'cost text': (text_of(feature(properties={'cost': '5'})), 'cost'),
    'expired': (text_of(feature(properties={'seconds': 0})), 'seconds: a number from 0.001'),
    'negative': (text_of(feature(properties={'seconds': -1})), 'seconds'),
    'for ever': (text_of(feature(properties={'seconds': 1e300})), 'seconds'),
    'name': (text_of(feature(properties={'name': ['x']})), 'name: a text is expected'),
    'long name': (text_of(feature(properties={'name': 'x' * 1000})), '1000 characters'),
    'id': (text_of(feature(id={'a': 1})), 'id: a text is expected'),
    'long id': (text_of(feature(id='x' * 1000)), 'id: 1000 characters'),
    'frame': (text_of(feature(), frame_id=3), 'frame_id: a text is expected'),
    'no cost': (text_of(feature(properties={'cost': None})), 'cost: a number from 1'),
    'kind': (text_of(feature(properties={'kind': 'oneway'})), "feature 0: .*kind: 'oneway' is"),
    'no heading': (text_of(feature(properties={'kind': 'one_way'})), 'heading: degrees'),
    'heading': (text_of(feature(properties={'heading': 'east'})), 'heading: a number'),
    'a wide line': (text_of(feature(LINE, 'LineString', properties={'width': 1e6})), 'width'),
    'no width': (text_of(feature(LINE, 'LineString')), 'width: 0 m is not above 0'),
    'a lane': (text_of(feature(properties={'kind': 'keep_right'})), 'is a line with a width'),
    'a short line': (
        text_of(feature([[1, 1], [1, 1]], 'LineString', properties={'width': 1})),
        'Too few points',
    ),
    'an edge': (
        text_of(
            feature(properties={'startid': 1, 'endid': 2})
            | {'geometry': {'type': 'MultiLineString', 'coordinates': 3}}
        ),
        'edge: coordinates: a list',
    ),
    'degrees': (text_of(feature(), crs={'name': 'EPSG:4326'}), 'degrees'),
    'size': (' ' * 5_000_000, 'over 4 MB'),
}


@pytest.mark.parametrize('case', BAD)
def test_what_is_wrong_is_said_with_the_feature(case):
    text, problem = BAD[case]
    with pytest.raises(ZonesError, match=problem):
        zones_from_text(text, 0.0)


def test_zones_that_cover_too_many_cells_are_refused():
    grid_map = GridMap(np.zeros((1000, 1000), dtype=np.int8))
    zones = [Zone(str(number), shapely.box(0, 0, 1000, 1000)) for number in range(401)]
    with pytest.raises(ZonesError, match='401 million cells of the map, over 400'):
        ZoneLayer(grid_map, zones)


def test_zones_are_bounded():
    box = shapely.box(0, 0, 1, 1)
    with pytest.raises(ZonesError, match='over 1000; remove some'):
        Zones(Zone(str(number), box) for number in range(MAX_ZONES + 1))
    large = shapely.Polygon(circle(MAX_VERTICES))
    count = MAX_TOTAL_VERTICES // MAX_VERTICES
    Zones(Zone(str(number), large) for number in range(count))
    with pytest.raises(ZonesError, match='simplify or remove some'):
        Zones(Zone(str(number), large) for number in range(count + 1))
    with pytest.raises(ZonesError, match='id of another zone'):
        NO_ZONES.add([Zone('a', box), Zone('a', box)])


@pytest.mark.parametrize(
    ('fields', 'problem'),
    [
        ({'id': ''}, 'id'),
        ({'id': 'a\n'}, 'id'),
        ({'cost': 0}, 'cost'),
        ({'cost': 2.0}, 'cost'),
        ({'geometry': shapely.Point(0, 0)}, 'not a Polygon'),
        ({'geometry': shapely.Polygon()}, 'points'),
        ({'geometry': shapely.Polygon(BOWTIE)}, 'cross itself'),
        ({'geometry': shapely.box(0, 0, 1e300, 1)}, 'metres'),
        ({'geometry': shapely.box(0, 0, math.inf, 1)}, 'finite'),
        ({'geometry': shapely.Polygon(circle(MAX_VERTICES + 2))}, 'over 10000'),
        ({'expires': math.inf}, 'expires'),
    ],
)
def test_a_wrong_zone_is_refused(fields, problem):
    with pytest.raises(ZonesError, match=problem):
        Zone(**({'id': 'a', 'geometry': shapely.box(0, 0, 1, 1)} | fields))

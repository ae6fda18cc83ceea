"""Every kind of check against paths that fulfil it and paths that do not."""

import math

import numpy as np
import pytest
import shapely
from instruction_suites import MAPS, ROOMS
from llm_astar_lab.instruct_bench.checks import (
    CHECK_KINDS,
    FORMS,
    read_check,
    region_geometry,
    spans_in,
)
from llm_astar_lab.instruct_bench.maps import Scene, SuiteMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Place, Places, places_from_polygons
from llm_astar_planner.instructions.verification.geometry import first_from, polyline

PLACES = places_from_polygons(MAPS['rooms']['places'])
MAP = SuiteMap('rooms', GridMap(np.where(ROOMS, 100, 0), 0.5), PLACES)
START, GOAL = (2.25, 1.25), (10.25, 1.25)
SCENE = Scene(MAP, (4, 2), (20, 2))
DIRECT = [START, GOAL]
# Through the north door instead of the south one.
NORTH = [START, (5.5, 4.5), (7.0, 4.5), GOAL]
BOX = {'rect': [4, 0, 5, 2]}
DISC = {'circle': [4, 1.25, 1]}
SOUTH_DOOR, NORTH_DOOR = {'place': 'south door'}, {'place': 'north door'}
DOORS = [SOUTH_DOOR, NORTH_DOOR]
NORTH_FIRST = {'first': NORTH_DOOR, 'second': SOUTH_DOOR}


def verdict(check, points, scene=SCENE, direct_length=8.0):
    return read_check(check, 'checks[0]', scene, 2).measure(polyline(points), direct_length)


# Kind, fields, a path that fulfils the check, one that does not.
CASES = [
    ('inside_max', {'region': SOUTH_DOOR, 'metres': 0.1}, NORTH, DIRECT),
    ('inside_max', {'region': BOX, 'metres': 1.0}, DIRECT, [START, (4.9, 1.25), START, GOAL]),
    ('inside_max', {'region': DISC, 'metres': 2.0}, DIRECT, [(3, 1), (5, 1), (3, 1)]),
    ('outside_max', {'region': {'half': 'south'}, 'metres': 0.0}, DIRECT, NORTH),
    ('outside_max', {'region': {'half': 'west'}, 'metres': 4.25}, DIRECT, NORTH),
    ('touch', {'region': NORTH_DOOR}, NORTH, DIRECT),
    ('touch', {'region': {'place': 'desk'}, 'tol': 1.0}, [(9, 3.5), (10, 3.5)], [(9, 3.4), GOAL]),
    ('touch', {'region': BOX, 'tol': -0.4}, DIRECT, [(1, 1), (4.3, 1), (1, 1)]),
    (
        'order',
        {'regions': DOORS},
        [*DIRECT, *NORTH[::-1]],
        NORTH + DIRECT[::-1],
    ),
    ('order', {'regions': [BOX, DISC]}, DIRECT, NORTH[:2]),
    ('order', {'regions': [BOX, DISC, {'place': 'desk'}]}, [*DIRECT, (9.5, 5)], DIRECT),
    ('visit_before', NORTH_FIRST, NORTH + DIRECT[::-1], DIRECT),
    (
        'visit_before',
        {'first': NORTH_DOOR, 'second': SOUTH_DOOR},
        [(1, 1), (2, 2)],
        DIRECT + NORTH,
    ),
    ('visit_after', NORTH_FIRST, NORTH + DIRECT[::-1], DIRECT[::-1] + NORTH),
    ('visit_after', NORTH_FIRST, DIRECT, [*DIRECT, *NORTH[::-1]]),
    # They overlap, and the path is in both when it leaves the first one, or it is not.
    ('visit_after', {'first': BOX, 'second': DISC}, [START, (5, 1.25)], [START, (4.5, 0.1), GOAL]),
    ('never_after', {**NORTH_FIRST, 'metres': 0.0}, [*DIRECT, *NORTH[::-1]], NORTH + DIRECT[::-1]),
    ('never_after', {**NORTH_FIRST, 'metres': 0.0}, DIRECT + DIRECT[::-1], [*NORTH, START, GOAL]),
    ('entries', {'region': BOX, 'apart': 0.5, 'at_least': 2}, DIRECT + DIRECT[::-1], DIRECT),
    ('entries', {'region': BOX, 'apart': 0.5, 'at_most': 1}, DIRECT, DIRECT + DIRECT[::-1]),
    # To leave it by less than `apart` is no other entry.
    (
        'entries',
        {'region': BOX, 'apart': 0.5, 'at_most': 1},
        [START, (4.5, 1), (5.4, 1), (4.5, 1)],
        [START, (4.5, 1), (5.6, 1), (4.5, 1)],
    ),
    (
        'entries',
        {'region': BOX, 'tol': -0.2, 'apart': 0.5, 'at_least': 1},
        DIRECT,
        [(3, 1), (4.1, 1), (3, 1)],
    ),
    ('end_in', {'region': {'place': 'east room'}}, DIRECT, DIRECT[::-1]),
    ('end_in', {'region': BOX, 'tol': 1.0}, [START, (5.9, 1)], [START, (6.1, 1)]),
    ('dist_min', {'region': {'place': 'desk'}, 'metres': 2.0}, DIRECT, NORTH),
    ('dist_min', {'region': BOX, 'metres': 1.0, 'ends': 2.0}, [(4, 1), (6, 1), (9, 1)], DIRECT),
    ('wall_dist_min', {'metres': 0.5}, [(1, 1), (5.5, 1)], [(1, 1), (5.6, 1)]),
    ('wall_dist_min', {'metres': 0.5, 'ends': 1.0}, [(1, 3), (6, 3)], [(1, 3), (6, 3), (1, 3)]),
    ('cross', {'segment': [5, 0, 5, 2], 'times': 'some'}, DIRECT, [(1, 3), (9, 3)]),
    ('cross', {'segment': [5, 0, 5, 2], 'times': 0}, [(1, 3), (9, 3)], DIRECT),
    ('cross', {'segment': [5, 0, 5, 2], 'times': 2}, [*DIRECT, START], DIRECT),
    ('cross', {'segment': [3, 1.25, 5, 1.25], 'times': 1}, DIRECT, [*DIRECT, START]),
    ('length_max', {'of_direct': 1.1}, DIRECT, NORTH),
    ('length_max', {'metres': 8.0}, DIRECT, NORTH),
    ('length_max', {'metres': 20.0, 'of_direct': 1.0}, DIRECT, NORTH),
]


@pytest.mark.parametrize(('kind', 'fields', 'good', 'bad'), CASES)
def test_a_check_tells_a_path_that_fulfils_it_from_one_that_does_not(kind, fields, good, bad):
    check = {'check': kind, **fields}
    assert verdict(check, good).holds
    assert not verdict(check, bad).holds


def test_every_kind_has_cases():
    assert {kind for kind, *_ in CASES} == set(CHECK_KINDS)


def test_lengths_are_those_of_the_path_itself():
    # Into the disc of 1 m around (4, 1.25) and out of it again, through its centre.
    detail = verdict({'check': 'inside_max', 'region': DISC, 'metres': 1.0}, DIRECT).detail
    assert detail == '2.00 m inside, at most 1'
    slanted = [(0, 0), (3, 4)]
    detail = verdict({'check': 'outside_max', 'region': BOX, 'metres': 1.0}, slanted).detail
    assert detail == '5.00 m outside, at most 1'


def test_a_stretch_on_the_edge_is_inside_for_nobody_and_outside_for_nobody():
    edge = [(1, 3), (5, 3)]
    half = {'half': 'south'}
    assert verdict({'check': 'inside_max', 'region': half, 'metres': 0.0}, edge).holds
    assert verdict({'check': 'outside_max', 'region': half, 'metres': 0.0}, edge).holds
    assert verdict({'check': 'touch', 'region': half}, edge).holds


@pytest.mark.parametrize('kind', ['inside_max', 'outside_max'])
def test_a_path_of_one_point_has_no_length(kind):
    check = {'check': kind, 'region': BOX, 'metres': 0.0}
    assert verdict(check, [(4.5, 1)]).holds
    assert verdict({'check': 'touch', 'region': BOX}, [(4.5, 1), (4.5, 1)]).holds
    assert not verdict({'check': 'touch', 'region': BOX}, [(9, 1)]).holds


def test_a_path_that_leaves_a_region_and_comes_back_has_two_stretches():
    path = polyline([(0, 0), (10, 0), (10, 1), (0, 1)])
    spans = spans_in(path, shapely.box(4, -1, 5, 2))
    assert np.allclose(spans, [(4, 5), (16, 17)])
    assert first_from(spans, 5.5) == pytest.approx(16)
    assert math.isinf(first_from(spans_in(path, shapely.box(20, 0, 21, 1)), 0.0))


def test_a_ring_shaped_region_gives_two_stretches_of_one_piece():
    ring = shapely.Point(5, 0).buffer(3).difference(shapely.Point(5, 0).buffer(1))
    assert np.allclose(spans_in(polyline([(0, 0), (10, 0)]), ring), [(2, 4), (6, 8)])


def test_walls_are_the_squares_of_occupied_cells_on_a_turned_map():
    cells = np.zeros((8, 8))
    cells[4, 4:6] = 100
    turned = SuiteMap('turned', GridMap(cells, 0.5, Pose2D(1.0, 0.0, math.pi / 2)), Places())
    assert len(turned.walls) == 1
    # Grid x runs along map y: the cells lie at x from 1 - 2.5 to 1 - 2 and y from 2 to 3.
    assert np.allclose(turned.walls[0].bounds, (-1.5, 2.0, -1.0, 3.0))
    assert np.allclose(turned.extent, (-3.0, 0.0, 1.0, 4.0))
    scene = Scene(turned, (0, 0), (0, 1))
    check = {'check': 'wall_dist_min', 'metres': 0.5}
    assert verdict(check, [(-0.5, 0), (-0.5, 4)], scene).holds
    assert not verdict(check, [(-0.6, 0), (-0.6, 4)], scene).holds


def test_a_map_without_walls_keeps_any_distance_to_them():
    empty = Scene(SuiteMap('empty', GridMap(np.zeros((4, 4))), Places()), (0, 0), (1, 1))
    assert verdict({'check': 'wall_dist_min', 'metres': 9.0}, [(1, 1), (2, 2)], empty).holds


REGIONS = {
    'place': ({'place': 'Left Room'}, 36.0),
    'tag': ({'tag': 'door'}, 1.0),
    'circle': ({'circle': [3, 3, 1]}, math.pi),
    'rect': ({'rect': [1, 1, 3, 4]}, 6.0),
    'polygon': ({'polygon': [[0, 0], [4, 0], [0, 4]]}, 8.0),
    'half': ({'half': 'north'}, 36.0),
    'union': ({'union': [{'rect': [0, 0, 2, 2]}, {'rect': [1, 0, 3, 2]}]}, 6.0),
    'between': ({'between': DOORS}, 1.0),
    'near': ({'near': {'rect': [1, 1, 2, 2]}, 'width': 1}, 5.0 + math.pi),
    'walls': ({'walls': 0.0001}, 2.0),
}


@pytest.mark.parametrize('form', sorted(FORMS))
def test_regions_have_the_area_that_they_should(form):
    value, area = REGIONS[form]
    assert region_geometry(value, 'region', SCENE).area == pytest.approx(area, rel=1e-3)


def test_halves_of_places_and_of_the_way():
    room = region_geometry({'half': 'east', 'of': 'west room'}, 'region', SCENE)
    assert room.bounds == (3.0, 0.0, 6.0, 6.0)
    left = region_geometry({'half': 'left'}, 'region', SCENE)
    assert left.contains(shapely.Point(5, 2))
    assert not left.contains(shapely.Point(5, 1))
    assert region_geometry({'rect': [None, 3, None, None]}, 'region', SCENE).contains(
        shapely.Point(500, 500)
    )


def test_a_point_place_is_a_disc_of_half_a_metre():
    places = Places([Place('charger', shapely.Point(3, 3))])
    scene = Scene(SuiteMap('rooms', MAP.grid_map, places), (4, 2), (20, 2))
    check = {'check': 'touch', 'region': {'place': 'charger'}}
    assert verdict(check, [(0, 3.4), (6, 3.4)], scene).holds
    assert not verdict(check, [(0, 3.6), (6, 3.6)], scene).holds


@pytest.mark.parametrize(
    ('check', 'message'),
    [
        ({'check': 'fly'}, 'check: .fly. is not one of inside_max'),
        ({'check': 'touch'}, 'region: is not an object'),
        ({'check': 'touch', 'region': {'place': 'attic'}}, "'attic' is not a place of the map"),
        ({'check': 'touch', 'region': {'tag': 'red'}}, "'red' is not a kind or tag"),
        ({'check': 'touch', 'region': {'round': 1}}, 'has none of place, tag'),
        ({'check': 'touch', 'region': {'circle': [0, 0, 0]}}, 'circle: is empty'),
        ({'check': 'touch', 'region': {'circle': [0, 0]}}, 'is not a list of 3 numbers'),
        ({'check': 'touch', 'region': {'polygon': [[0, 0], [1, 1]]}}, '3 to 1000 points'),
        ({'check': 'touch', 'region': {'polygon': [[0, 0], [1, 1], [0, 1], [1, 0]]}}, 'crosses'),
        ({'check': 'touch', 'region': BOX, 'tol': -0.6}, 'nothing lies 0.6 m deep'),
        ({'check': 'touch', 'region': BOX, 'tolerance': 1}, "has no field 'tolerance'"),
        ({'check': 'touch', 'region': {'place': 'desk', 'of': 1}}, "place has no field 'of'"),
        ({'check': 'touch', 'region': {'half': 'up'}}, "'up' is not one of north"),
        ({'check': 'touch', 'region': {'between': [BOX]}}, 'is not a list of two regions'),
        ({'check': 'touch', 'region': BOX, 'clause': 2}, 'clause: 2 is not the index of one of 2'),
        ({'check': 'inside_max', 'region': BOX}, 'metres: None is not a number'),
        ({'check': 'order', 'regions': [BOX]}, 'is not a list of 2 to 16 regions'),
        ({'check': 'order', 'regions': [BOX, {'tag': 'x'}]}, r'regions\[1\]: tag'),
        ({'check': 'cross', 'segment': [1, 1, 1, 1], 'times': 0}, 'segment: is a point'),
        ({'check': 'cross', 'segment': [1, 1, 1, 2], 'times': 'often'}, 'neither a number'),
        ({'check': 'cross', 'segment': [1, 1, 1, 2], 'times': True}, 'neither a number'),
        ({'check': 'length_max'}, 'neither of_direct nor metres'),
    ],
)
def test_a_malformed_check_is_refused_with_its_field(check, message):
    with pytest.raises(ValueError, match=message):
        read_check(check, 'checks[0]', SCENE, 2)


def test_regions_nested_without_end_are_refused():
    region = BOX
    for _ in range(10):
        region = {'union': [region]}
    with pytest.raises(ValueError, match='nested too deep'):
        region_geometry(region, 'region', SCENE)

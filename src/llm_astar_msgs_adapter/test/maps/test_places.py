import json
import os

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import (
    MAX_BYTES,
    MAX_PROBLEMS,
    NO_PLACES,
    Place,
    Places,
    PlacesError,
    load_places,
    places_beside,
    places_problems,
)

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]


def polygon(name, ring=SQUARE, **properties):
    return {
        'type': 'Feature',
        'geometry': {'type': 'Polygon', 'coordinates': [ring]},
        'properties': {'name': name, **properties},
    }


def point(x, y, **properties):
    return {
        'type': 'Feature',
        'geometry': {'type': 'Point', 'coordinates': [x, y]},
        'properties': properties,
    }


def box(x0, y0, x1, y1):
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]


def write(tmp_path, *features, **fields):
    path = tmp_path / 'places.geojson'
    collection = {'type': 'FeatureCollection', 'features': list(features), **fields}
    path.write_text(json.dumps(collection))
    return path


def problem(path):
    with pytest.raises(PlacesError) as caught:
        load_places(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    return message


def test_polygons_and_points_have_their_properties(tmp_path):
    kitchen = polygon('kitchen', kind='room', aliases=['Küche'], tags=['blue', 'wet'])
    places = load_places(write(tmp_path, kitchen, point(1, 2, name='charger', kind='object')))
    room, charger = places
    assert (room.name, room.kind, room.aliases) == ('kitchen', 'room', ('Küche',))
    assert room.tags == ('blue', 'wet')
    assert room.geometry.area == 16.0
    assert charger.is_object
    assert (charger.geometry.x, charger.geometry.y) == (1, 2)
    assert places.get('KÜCHE') is room


def test_what_was_written_is_read_back(tmp_path):
    path = write(tmp_path, polygon('a', tags=['b']), point(1, 2, name='c'))
    places = load_places(path)
    path.write_text(json.dumps(places.to_geojson()))
    assert load_places(path).digest == places.digest


def test_lists_may_be_texts_with_commas_and_fields_may_be_null_as_qgis_writes_them(tmp_path):
    ring = [[*corner, 0.0] for corner in SQUARE]
    feature = polygon('a', ring, aliases='b, c', tags=None, kind=None, fid=7)
    crs = {'type': 'name', 'properties': {'name': 'urn:ogc:def:crs:EPSG::3857'}}
    (place,) = load_places(write(tmp_path, feature, crs=crs, name='layer'))
    assert (place.aliases, place.tags, place.kind) == (('b', 'c'), (), 'area')
    assert not place.geometry.has_z


def test_several_polygons_are_one_place(tmp_path):
    feature = polygon('racks')
    feature['geometry'] = {
        'type': 'MultiPolygon',
        'coordinates': [[box(0, 0, 1, 1)], [box(2, 0, 3, 1)]],
    }
    (place,) = load_places(write(tmp_path, feature))
    assert place.geometry.area == 2.0


def test_named_nodes_of_a_route_graph_are_places(tmp_path):
    edge = {
        'type': 'Feature',
        'geometry': {'type': 'MultiLineString'},
        'properties': {'id': 3, 'startid': 0, 'endid': 1, 'metadata': {'name': 'lane'}},
    }
    named = point(3, 4, id=1, frame='odom', metadata={'name': 'dock', 'kind': 'station'})
    places = load_places(write(tmp_path, point(1, 2, id=0, frame='odom'), named, edge))
    (dock,) = places
    assert (dock.name, dock.kind, places.frame_id) == ('dock', 'station', 'odom')


def test_places_of_several_frames_are_refused(tmp_path):
    path = write(tmp_path, point(1, 2, name='a', frame='odom'), point(1, 2, name='b'))
    assert 'frame: the places are in several frames, odom, map' in problem(path)


@pytest.mark.parametrize(
    ('feature', 'words'),
    [
        (polygon(None), 'feature 0: name: is missing'),
        (polygon(7), 'feature 0 (7): name: a text is expected'),
        (polygon('  '), "feature 0 ('  '): name: is empty"),
        (polygon('x' * 81), 'name: 81 characters are over 80'),
        (polygon('a\x1b[31m'), 'name: '),
        (polygon('a', tags=[3]), "feature 0 ('a'): tags: a text is expected, not 3"),
        (polygon('a', aliases={'b': 1}), "feature 0 ('a'): aliases: a list of texts"),
        (polygon('a', kind=[]), "feature 0 ('a'): kind"),
        (polygon('a', [[0, 0], [4, 4], [4, 0], [0, 4], [0, 0]]), 'Self-intersection'),
        (polygon('a', [[0, 0], [1, 1], [0, 0]]), 'coordinates'),
        (polygon('a', [[0, 0], [1, 1], [2, 2], [0, 0]]), 'coordinates'),
        (polygon('a', [[0, 0], [1, '1'], [2, 0], [0, 0]]), "metres are expected, not '1'"),
        (polygon('a', [[0, 0], [1, 1e999], [2, 0], [0, 0]]), 'coordinates'),
        (polygon('a', [[0, 0], 5, [2, 0], [0, 0]]), 'a list is expected, not 5'),
        (polygon('a', []), 'coordinates'),
        (point(1, True, name='a'), 'metres are expected, not True'),
        (polygon('a') | {'geometry': None}, 'geometry: is missing'),
        (polygon('a') | {'properties': None}, 'feature 0: properties'),
        ('kitchen', "feature 0: type: a Feature is expected, not 'kitchen'"),
        (
            polygon('a') | {'geometry': {'type': 'LineString', 'coordinates': SQUARE}},
            "geometry: 'LineString' is not one of Polygon, MultiPolygon, Point",
        ),
    ],
)
def test_an_error_names_the_feature_and_the_field(tmp_path, feature, words):
    text = json.dumps({'type': 'FeatureCollection', 'features': [feature]})
    path = tmp_path / 'places.geojson'
    path.write_text(text.replace('Infinity', '1e999'))
    assert words in problem(path)


def test_two_places_of_one_name_are_listed(tmp_path):
    path = write(tmp_path, polygon('Lab'), polygon('x', aliases=['lab']))
    assert "feature 1 ('x'): 'lab' is also a name of feature 0 ('Lab'); rename" in problem(path)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'not JSON'),
        ('[1', 'not JSON'),
        ('[' * 100_000, 'JSON'),
        ('{"a":' * 100_000, 'JSON'),
        ('[NaN]', 'FeatureCollection is expected'),
        ('[' + '9' * 10_000 + ']', 'JSON'),
        ('[]', 'type: a GeoJSON FeatureCollection is expected'),
        ('{"type": "FeatureCollection"}', 'features: a list is expected, not None'),
        ('\xff', 'JSON'),
    ],
)
def test_a_file_of_something_else_is_refused(tmp_path, text, words):
    path = tmp_path / 'places.geojson'
    path.write_bytes(text.encode('latin-1'))
    message = problem(path)
    assert words in message or 'nested too deeply' in message


def test_only_regular_files_of_a_bounded_size_are_read(tmp_path):
    assert 'No such file' in problem(tmp_path / 'absent.geojson')
    assert 'not a regular file' in problem(tmp_path)
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    assert 'not a regular file' in problem(pipe)
    large = tmp_path / 'large'
    large.write_bytes(b' ' * (MAX_BYTES + 1))
    assert 'is over 4 MB' in problem(large)


def test_the_number_of_places_and_of_points_is_bounded(tmp_path):
    many = [point(1, 2, name=f'p{number}') for number in range(1001)]
    assert 'over 1000 places' in problem(write(tmp_path, *many))
    ring = [[np.cos(angle), np.sin(angle)] for angle in np.linspace(0, 6, 10_001)]
    assert 'coordinates: 10001 points are over 10000' in problem(
        write(tmp_path, polygon('a', ring))
    )


def test_degrees_are_refused(tmp_path):
    crs = {'type': 'name', 'properties': {'name': 'urn:ogc:def:crs:OGC:1.3:CRS84'}}
    assert 'crs: the coordinates are degrees' in problem(write(tmp_path, polygon('a'), crs=crs))


def test_the_places_beside_a_map_are_found(tmp_path):
    assert places_beside(tmp_path / 'depot.yaml') is None
    shared = tmp_path / 'places.geojson'
    shared.touch()
    assert places_beside(tmp_path / 'depot.yaml') == shared
    own = tmp_path / 'depot.places.geojson'
    own.touch()
    assert places_beside(str(tmp_path / 'depot.yaml')) == own


def room_map(yaw=0.0):
    cells = np.zeros((20, 20), dtype=np.int8)
    cells[:, :5] = 100
    cells[:, 15:] = -1
    return GridMap(cells, 0.5, Pose2D(-1.0, 2.0, yaw))


def problems_of(tmp_path, *features):
    return places_problems(load_places(write(tmp_path, *features)), room_map())


def test_places_on_free_cells_are_no_problem(tmp_path):
    table = polygon('table', box(4, 4, 6, 5), kind='object')
    beside = polygon('beside', box(4.95, 3, 6, 6))
    assert problems_of(tmp_path, polygon('room', box(2, 3, 5, 6)), table, beside) == []
    assert places_problems(NO_PLACES, room_map()) == []


def test_doubtful_places_are_named(tmp_path):
    assert problems_of(
        tmp_path,
        polygon('far', box(100, 100, 101, 101)),
        polygon('edge', box(5, 11, 6, 13)),
        polygon('wall', box(-1, 3, 1, 5)),
        polygon('rack', box(-1, 6, 1, 8), kind='object'),
        polygon('dark', box(7, 3, 8, 4)),
        point(-0.5, 2.5, name='pillar'),
        polygon('lab', box(2, 3, 4, 5)),
        polygon('store', box(3, 4, 5, 6)),
    ) == [
        "'far' lies off the map",
        "'edge' lies partly off the map",
        "'wall' lies wholly in walls or unknown space; its kind is perhaps 'object'",
        "'dark' lies wholly in walls or unknown space; its kind is perhaps 'object'",
        "'pillar' lies wholly in walls or unknown space; its kind is perhaps 'object'",
        "'lab' and 'store' overlap by 1.0 m²",
    ]


def test_a_place_may_reach_into_a_wall_and_be_smaller_than_a_cell(tmp_path):
    thin = polygon('thin', box(2.1, 3.1, 2.2, 3.2))
    assert problems_of(tmp_path, polygon('corner', box(0, 2, 1.8, 3)), thin) == []


def test_a_turned_map_is_checked_in_its_own_frame():
    places = Places([Place('a', shapely.box(-3, 4, -2, 5))])
    assert places_problems(places, room_map()) == ["'a' lies off the map"]
    assert places_problems(places, room_map(np.pi / 2)) == []


def test_the_list_of_problems_is_bounded(tmp_path):
    many = [point(100, number, name=f'p{number}') for number in range(50)]
    found = problems_of(tmp_path, *many)
    assert len(found) == MAX_PROBLEMS + 1
    assert found[-1] == 'and 30 more'


def test_places_of_another_frame_are_a_problem(tmp_path):
    found = problems_of(tmp_path, point(2, 4, name='a', frame='odom'))
    assert found == ["the places are in frame 'odom', the map is in 'map'"]

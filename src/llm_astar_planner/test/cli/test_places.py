"""`llm-astar places` as a user types it."""

import json

import numpy as np
import pytest
import shapely
from llm_astar_lab.pictures.places import places_figure
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.cli.main import main
from PIL import Image

PLACES = Places(
    [
        Place('kitchen', shapely.box(1, 1, 4, 4), 'room', ('Küche',), ('wet', 'blue')),
        Place('charger', shapely.Point(5, 2)),
        Place('far away', shapely.box(100, 1, 104, 4)),
    ]
)


@pytest.fixture
def files(tmp_path):
    """A places file and a map of 8 x 5 m."""
    path = tmp_path / 'places.geojson'
    path.write_text(json.dumps(PLACES.to_geojson()))
    Image.fromarray(np.full((10, 16), 254, dtype=np.uint8)).save(tmp_path / 'm.pgm')
    (tmp_path / 'm.yaml').write_text(
        'image: m.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\n'
        'occupied_thresh: 0.65\nfree_thresh: 0.25\n'
    )
    return str(path), str(tmp_path / 'm.yaml')


def test_places_are_listed(files, capsys):
    assert main(['places', files[0]]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == '3 places in frame map'
    assert lines[2].split() == [
        'kitchen',
        'room',
        'wet,',
        'blue',
        '2.50,',
        '2.50',
        '9.0',
        'm²',
        'Küche',
    ]
    assert lines[3].split() == ['charger', 'area', '-', '5.00,', '2.00', 'point', '-']


def test_doubtful_places_are_named_on_a_map_and_in_json(files, capsys):
    assert main(['places', files[0], '--map', files[1]]) == 0
    assert "warning: 'far away' lies off the map" in capsys.readouterr().out
    assert main(['places', files[0], '--map', files[1], '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['problems'] == ["'far away' lies off the map"]
    assert [place['name'] for place in found['places']] == ['kitchen', 'charger', 'far away']
    assert found['places'][0]['area'] == 9.0
    assert found['places'][1]['area'] is None


def test_a_malformed_file_is_one_line(tmp_path, capsys):
    path = tmp_path / 'places.geojson'
    path.write_text('{"type": "FeatureCollection", "features": [{}]}')
    assert main(['places', str(path)]) == 2
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert f'{path}: feature 0: type' in error


def test_places_are_drawn_with_and_without_their_map(files, tmp_path, capsys):
    for number, options in enumerate(([], ['--map', files[1]])):
        picture = tmp_path / f'{number}.png'
        assert main(['places', files[0], *options, '--png', str(picture)]) == 0
        with Image.open(picture) as image:
            # As wide as a page; the places lie in a row of 102 x 3 m.
            assert image.width > 1000
            assert image.height > 100
    assert capsys.readouterr().out.count('picture: ') == 2


def names_of(figure):
    return {text.get_text(): text for text in figure.axes[0].texts}


def test_no_name_hides_another():
    crowd = Places(
        Place(f'place number {n}', shapely.box(n % 3, n // 3, n % 3 + 1.2, n // 3 + 1.2))
        for n in range(9)
    )
    figure = places_figure(crowd)
    boxes = [text.get_window_extent() for text in names_of(figure).values()]
    assert len(boxes) == 9
    overlapping = [(a, b) for a in boxes for b in boxes if a is not b and a.overlaps(b)]
    assert overlapping == []


def test_the_name_of_a_narrow_place_stands_upright():
    aisles = Places(
        [Place('aisle one', shapely.box(0, 0, 1, 20)), Place('b', shapely.box(20, 0, 40, 20))]
    )
    assert names_of(places_figure(aisles))['aisle one'].get_rotation() == 90


def test_a_turned_map_is_drawn_where_its_places_are():
    grid_map = GridMap(np.zeros((4, 8), dtype=np.int8), 0.5, Pose2D(3.0, 1.0, np.pi / 2))
    axes = places_figure(PLACES, grid_map).axes[0]
    assert np.allclose([axes.get_xlim(), axes.get_ylim()], [(1.0, 3.0), (1.0, 5.0)])


def test_a_map_without_places_is_drawn():
    assert list(places_figure(Places()).axes[0].texts) == []


@pytest.mark.parametrize('name', ['avoid', 'Not', 'the', 'vermeide', 'sans', 'évite', 'el'])
def test_a_place_that_is_called_as_instructions_begin_is_refused(tmp_path, capsys, name):
    path = tmp_path / 'places.geojson'
    for place in (
        Place(name, shapely.Point(5, 2)),
        Place('x', shapely.Point(5, 2), 'room', (name,)),
    ):
        path.write_text(json.dumps(Places([place]).to_geojson()))
        assert main(['places', str(path)]) == 2
        said = capsys.readouterr().err
        assert f'{path}: place {name!r}: is a word that instructions are made of' in said


@pytest.mark.parametrize('name', ['A', 'north', 'stop', 'avoid station', 'The Hall', 'Notting'])
def test_a_place_may_be_called_by_other_words(tmp_path, capsys, name):
    path = tmp_path / 'places.geojson'
    path.write_text(json.dumps(Places([Place(name, shapely.Point(5, 2))]).to_geojson()))
    assert main(['places', str(path)]) == 0

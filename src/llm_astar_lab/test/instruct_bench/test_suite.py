"""Suites are read whole before anything runs; an error names file, instruction and field."""

import json
from pathlib import Path

import pytest
from instruction_suites import INSTRUCTIONS, avoid, via, write_rooms, write_suite
from llm_astar_lab.instruct_bench.suite import SuiteError, load_suite
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.regions import NamedPlace

REFERENCE = Path(__file__).resolve().parents[4] / 'maps'


def test_a_suite_has_its_maps_places_truth_and_checks(tmp_path):
    suite = load_suite(write_suite(tmp_path))
    assert [item.id for item in suite.instructions] == [item['id'] for item in INSTRUCTIONS]
    door = suite.find('door')
    assert (door.start, door.goal) == ((4, 3), (20, 3))
    assert door.suite_map.grid_map.width == 24
    assert door.truth.clauses == (Visit(regions=(NamedPlace('north door'),)),)
    assert door.accepted[0].clauses == (Avoid(region=NamedPlace('south door')),)
    assert (door.lang, door.style, door.writer) == ('en', 'templated', '')
    assert [check.clause for check in door.checks] == [0]
    assert suite.find('tür').expect == 'ok'
    assert suite.find('both').clause_kinds == ('visit', 'avoid')


def test_the_words_of_earlier_suites_are_read(tmp_path):
    def change(suite):
        suite['instructions'] = suite['instructions'][:1]
        suite['instructions'][0] |= {
            'spec': {
                'clauses': [
                    {'kind': 'via', 'region': {'place': 'desk'}, 'strength': 'must'},
                    {'kind': 'pass', 'object': 'desk', 'side': 'north'},
                    {'kind': 'keep_distance', 'from': 'left room', 'metres': 2},
                ]
            },
            'direct_length': 8.0,
            'already': False,
            'anything': 'else',
        }

    kinds = load_suite(write_suite(tmp_path, change)).instructions[0].clause_kinds
    assert kinds == ('visit', 'pass', 'keep_distance')


def test_maps_are_found_by_file_dataset_number_folder_and_beside_the_suite(tmp_path):
    folder = tmp_path / 'other'
    folder.mkdir()
    write_rooms(folder, 'hall')

    def change(suite):
        common = {'expect': 'none', 'spec': {'clauses': []}, 'text': 'x'}
        suite['maps'] = {
            'rooms': {},
            'renamed': {'file': 'rooms.yaml'},
            'hall': {},
            'p3': {},
            'third': {'dataset': 'samples_1000.json', 'id': 3},
        }
        ends = {'rooms': [2, 1.5], 'p3': [46, 18]}
        suite['instructions'] = [
            {'id': name, 'map': name, 'start': ends.get(name, [2, 1.5]), **common,
             'goal': ends.get(name, [2, 1.5])}
            for name in ('rooms', 'renamed', 'hall')
        ]  # fmt: skip

    suite = load_suite(write_suite(tmp_path, change), [folder])
    cells = [item.suite_map.grid_map.digest for item in suite.instructions]
    assert len(set(cells)) == 1
    with pytest.raises(SuiteError, match=r"map 'hall': file: is missing, and hall.yaml is not in"):
        load_suite(tmp_path / 'suite.json')


def test_a_barrier_map_is_measured_in_its_cells(tmp_path):
    def change(suite):
        entry = json.loads((REFERENCE / 'samples_1000.json').read_text())[6]
        start, goal, _ = entry['start_goal'][0]
        suite['maps'] = {'p6': {'places': {}}, 'same': {'dataset': 'samples_1000.json', 'id': 6}}
        suite['instructions'] = [
            {'id': name, 'map': name, 'start': start, 'goal': goal, 'text': 'go', 'expect': 'none',
             'spec': {'clauses': []}}
            for name in suite['maps']
        ]  # fmt: skip

    numbered, named = load_suite(write_suite(tmp_path, change)).instructions
    assert numbered.start == named.start
    assert numbered.suite_map.barrier_map.id == 6
    centre = numbered.suite_map.grid_map.grid_to_world([numbered.start])[0]
    assert tuple(centre) == numbered.start


def test_places_come_from_the_entry_a_file_or_beside_the_map(tmp_path):
    feature = {
        'type': 'Feature',
        'geometry': {'type': 'Point', 'coordinates': [3, 3]},
        'properties': {'name': 'charger', 'tags': ['power']},
    }
    geojson = json.dumps({'type': 'FeatureCollection', 'features': [feature]})
    (tmp_path / 'mine.geojson').write_text(geojson)

    def with_file(suite):
        suite['maps'] = {'rooms': {'places_file': 'mine.geojson'}}
        suite['instructions'] = [{**INSTRUCTIONS[4]}]

    assert (
        load_suite(write_suite(tmp_path, with_file))
        .instructions[0]
        .suite_map.places.get('charger')
    )

    def beside(suite):
        suite['maps'] = {'rooms': {}}
        suite['instructions'] = [{**INSTRUCTIONS[4]}]

    assert not load_suite(write_suite(tmp_path, beside)).instructions[0].suite_map.places
    (tmp_path / 'rooms.places.geojson').write_text(geojson)
    assert len(load_suite(write_suite(tmp_path, beside)).instructions[0].suite_map.places) == 1


def set_field(path, value):
    *parents, last = path

    def change(suite):
        for name in parents:
            suite = suite[name]
        suite[last] = value

    return change


FIRST = ('instructions', 0)


@pytest.mark.parametrize(
    ('path', 'value', 'message'),
    [
        (('version',), 2, r'suite.json: version: 2 is not 1'),
        (('maps',), {}, r'suite.json: maps: is not an object'),
        (('maps', 'rooms'), 3, r"suite.json: map 'rooms': entry: is not an object"),
        (('maps', 'attic'), {}, r"suite.json: map 'attic': file: is missing"),
        (('maps', 'rooms', 'file'), 'no.yaml', r"map 'rooms': .*no.yaml"),
        (
            ('maps', 'rooms', 'dataset'),
            'samples_1000.json',
            "'rooms': id: None is not the id",
        ),
        (('maps', 'rooms', 'places_file'), 'no.geojson', r"map 'rooms': .*no.geojson"),
        (('maps', 'rooms', 'places', 'desk', 'polygon'), [[0, 0]], r"'rooms': places: 'desk'"),
        (('maps', 'rooms', 'places', 'desk', 'aliases'), ['vault'], r"'vault' names both"),
        (('instructions',), [], r'instructions: is not a list of 1'),
        ((*FIRST,), 'go', r'instruction at 0: entry: is not an object'),
        ((*FIRST, 'id'), None, r'instruction at 0: id: is not a text'),
        ((*FIRST, 'id'), 'vault', r"instruction 'vault': id: is used twice"),
        ((*FIRST, 'map'), 'attic', r"instruction 'door': map: 'attic' is not one of rooms"),
        ((*FIRST, 'start'), [1], r"'door': start: is not a list of 2 numbers"),
        ((*FIRST, 'start'), [99, 1], r"'door': start: \(99, 1\) lies off map 'rooms'"),
        ((*FIRST, 'goal'), [6.2, 3], r"'door': goal: \(6.2, 3\) is occupied on map 'rooms'"),
        ((*FIRST, 'text'), 7, r"'door': text: is not a text"),
        ((*FIRST, 'expect'), 'maybe', r"'door': expect: 'maybe' is not one of ok"),
        ((*FIRST, 'style'), 'loose', r"'door': style: 'loose' is not one of"),
        ((*FIRST, 'tags'), 'x', r"'door': instruction: tags: is not a list"),
        ((*FIRST, 'spec'), None, r"'door': spec: specification: is not an object"),
        ((*FIRST, 'spec'), {'clauses': []}, r"'door': spec: 0 clauses do not go with expect ok"),
        ((*FIRST, 'spec'), via('attic'), r"'door': spec: place: 'attic' is not a place"),
        ((*FIRST, 'accept'), [avoid('attic')], r"'door': accept\[0\]: place: 'attic'"),
        ((*FIRST, 'checks'), [], r"'door': checks: an instruction that can be met"),
        ((*FIRST, 'checks'), [{'check': 'fly'}], r"'door': checks\[0\]: check: 'fly'"),
        (('instructions', 4, 'spec'), via('desk'), r"'hurry': spec: 1 clauses do not go with"),
    ],
)
def test_a_malformed_suite_is_refused(tmp_path, path, value, message):
    suite = write_suite(tmp_path, set_field(path, value))
    with pytest.raises(SuiteError, match=message):
        load_suite(suite)


@pytest.mark.parametrize(
    'path',
    [
        ('version',),
        ('maps', 'x' * 5000),
        ('maps', 'rooms', 'places', 'x' * 5000),
        (*FIRST, 'id'),
        (*FIRST, 'map'),
        (*FIRST, 'checks', 0, 'check'),
        (*FIRST, 'checks', 0, 'clause'),
        (*FIRST, 'checks', 0, 'x' * 5000),
        (*FIRST, 'checks', 0, 'region', 'x' * 5000),
    ],
)
def test_an_error_of_a_suite_with_long_texts_is_short(tmp_path, path):
    suite = write_suite(tmp_path, set_field(path, 'x' * 5000))
    with pytest.raises(SuiteError) as raised:
        load_suite(suite)
    assert len(str(raised.value).replace(str(suite), '')) < 500


@pytest.mark.parametrize('text', ['', '[]', '{"version": 1', '[' * 100_000])
def test_a_file_that_is_no_suite_is_refused(tmp_path, text):
    path = tmp_path / 'suite.json'
    path.write_text(text)
    with pytest.raises(SuiteError, match=r'suite.json: '):
        load_suite(path)
    with pytest.raises(SuiteError, match=r'nothing.json: No such file'):
        load_suite(tmp_path / 'nothing.json')


def test_an_unknown_id_is_named(tmp_path):
    with pytest.raises(SuiteError, match="has no instruction 'x'"):
        load_suite(write_suite(tmp_path)).find('x')

"""`llm-astar plan` between places and with instructions."""

import io
import json
import sys

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.cli.main import main
from PIL import Image

PLACES = Places(
    [
        Place('west room', shapely.box(0, 0, 4, 6)),
        Place('east room', shapely.box(6, 0, 10, 6), aliases=('lab',)),
        Place('south door', shapely.box(4, 0, 6, 2), 'door'),
        Place('north door', shapely.box(4, 4, 6, 6), 'door'),
        Place('pillar', shapely.box(4, 2, 6, 4), 'object'),
        Place('cellar', shapely.box(20, 20, 21, 21)),
    ]
)
YAML = (
    'image: room.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n'
    'occupied_thresh: 0.65\nfree_thresh: 0.25\n'
)


@pytest.fixture
def room(tmp_path):
    """A map of 10 x 6 m with a pillar in the middle, and its places beside it."""
    pixels = np.full((60, 100), 254, dtype=np.uint8)
    pixels[20:40, 40:60] = 0
    Image.fromarray(pixels).save(tmp_path / 'room.pgm')
    (tmp_path / 'room.yaml').write_text(YAML)
    (tmp_path / 'room.places.geojson').write_text(json.dumps(PLACES.to_geojson()))
    return str(tmp_path / 'room.yaml')


def plan(capsys, *words):
    code = main(['plan', *words, '--source', 'none', '--json'])
    return code, json.loads(capsys.readouterr().out)


def inside(found, name):
    """Return the metres of a path's cells inside a place."""
    points = (np.array(found['path']) + 0.5) * 0.1
    return shapely.LineString(points).intersection(PLACES.get(name).geometry).length


def test_start_and_goal_may_be_places(capsys, room):
    code, found = plan(capsys, '--map', room, '--from', 'west room', '--to', 'LAB')
    assert (code, found['start'], found['goal']) == (0, [19, 29], [79, 29])
    code, found = plan(capsys, '--map', room, '--start', '5', '5', '--to', 'pillar')
    assert code == 0
    near = (np.array(found['goal']) + 0.5) * 0.1
    assert 0 < PLACES.get('pillar').geometry.distance(shapely.Point(near)) <= 1.0


def test_the_cells_of_places_are_said(capsys, room):
    assert main(['plan', '--map', room, '--from', 'west room', '--to', 'lab']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(' m, ')[2] for line in lines[2:4]] == [
        'cell (19, 29), west room',
        'cell (79, 29), lab',
    ]


def test_a_goal_without_a_start_begins_at_the_pair(capsys, room):
    found = plan(capsys, '--map', room, '--to', 'lab')[1]
    other = plan(capsys, '--map', room, '--pair', '1', '--to', 'lab')[1]
    assert found['goal'] == other['goal'] == [79, 29]
    assert found['start'] != other['start']


@pytest.mark.parametrize(
    ('words', 'parts'),
    [
        (['--to', 'east rom'], ['did you mean east room?', 'there is west room, east room']),
        (['--to', 'door'], ['several places', 'south door, north door']),
        (['--to', 'cellar'], ["'cellar'", 'no cell']),
        (['--from', 'lab'], ['--from and --to', 'go together']),
        (['--start', '1', '1'], ['go together']),
        (['--places', 'nowhere.geojson', '--to', 'lab'], ['nowhere.geojson']),
    ],
)
def test_what_is_no_place_is_one_line(capsys, room, words, parts):
    assert main(['plan', '--map', room, *words]) == 2
    error = capsys.readouterr().err.splitlines()
    assert error[-1].startswith('llm-astar: error: ')
    for part in parts:
        assert part in error[-1]


def test_doubtful_places_are_warned_of(capsys, room):
    assert main(['plan', '--map', room, '--to', 'lab']) == 0
    assert capsys.readouterr().err == ("llm-astar: warning: places: 'cellar' lies off the map\n")


def test_places_may_be_in_any_file(capsys, room, tmp_path):
    other = tmp_path / 'other.geojson'
    other.write_text(json.dumps(Places([Place('desk', shapely.Point(1.04, 1.04))]).to_geojson()))
    code, found = plan(capsys, '--map', room, '--places', str(other), '--to', 'desk')
    assert (code, found['goal']) == (0, [10, 10])
    (tmp_path / 'room.places.geojson').unlink()
    assert main(['plan', '--map', room, '--to', 'lab']) == 2
    assert 'no places are loaded' in capsys.readouterr().err


WAY = ('--from', 'west room', '--to', 'east room')


def test_an_instruction_bends_the_path_and_each_clause_is_reported(capsys, room):
    for door, other in (('north', 'south'), ('south', 'north')):
        words = ('--map', room, *WAY, '--instruction', f'avoid the {door} door')
        code, found = plan(capsys, *words)
        report = found['instruction_report']
        assert (code, report['satisfied']) == (0, True)
        assert [clause['status'] for clause in report['clauses']] == ['kept']
        assert inside(found, f'{door} door') == 0.0 < inside(found, f'{other} door')
        assert found['instruction'].startswith(f'avoid the {door} door: kept')


def test_a_person_reads_what_was_understood_and_what_became_of_it(capsys, room):
    text = 'avoid the north door; visit the south door; frobnicate; whistle'
    assert main(['plan', '--map', room, *WAY, '--instruction', text]) == 3
    lines = capsys.readouterr().out.splitlines()
    assert f'instruction "{text}"' in lines
    assert any(line.startswith('understood as: avoid the north door; visit') for line in lines)
    assert any(line.startswith('partly understood by grammar') for line in lines)
    clauses = [line for line in lines if line.startswith('clause ')]
    assert len(clauses) == 4
    assert 'avoid the north door: kept (0.0 m inside)' in clauses[0]
    assert 'not understood: "' in clauses[2]
    assert 'unsupported: "whistle" is about action' in clauses[3]
    assert any(line.startswith('verdict    2 of 4 clauses are kept; ') for line in lines)


UNSURE = ('--instruction', 'avoid the nroth door')
QUESTION = 'Did you mean the north door by "nroth door"?'


@pytest.fixture
def nothing_remembered(tmp_path, monkeypatch):
    """A user who has not answered any question yet."""
    monkeypatch.setenv('XDG_STATE_HOME', str(tmp_path))


@pytest.mark.usefixtures('nothing_remembered')
def test_an_unsure_reading_is_a_question_that_is_confirmed_once(capsys, room):
    words = ('plan', '--map', room, *WAY, *UNSURE, '--source', 'none')
    assert main([*words]) == 3
    out, err = capsys.readouterr()
    assert f'clause 1   avoid the north door: unsure ({QUESTION}' in out
    assert f'verdict    A question first: {QUESTION}' in out
    assert 'hint: if what is asked is meant, add --confirm' in err
    assert main([*words, '--confirm']) == 0
    assert 'verdict    The instruction is kept' in capsys.readouterr().out
    # The answer is remembered for these places.
    code, found = plan(capsys, '--map', room, *WAY, *UNSURE)
    assert (code, found['instruction_report']['interpretation']['questions']) == (0, [])


@pytest.mark.usefixtures('nothing_remembered')
@pytest.mark.parametrize(('answer', 'code'), [('y', 0), ('ja', 0), ('n', 3), ('', 3)])
def test_a_person_at_a_terminal_is_asked(capsys, room, monkeypatch, answer, code):
    terminal = io.StringIO(f'{answer}\n')
    for stream in (terminal, sys.stdout):
        monkeypatch.setattr(stream, 'isatty', lambda: True)
    monkeypatch.setattr(sys, 'stdin', terminal)
    assert main(['plan', '--map', room, *WAY, *UNSURE, '--source', 'none']) == code
    out, err = capsys.readouterr()
    assert f'{QUESTION} [y/n] ' in err
    # What is neither yes nor no is no answer: it is asked again the next time.
    assert ('add --confirm' in err) is (not answer)
    assert ('clause 1   avoid the north door: kept' in out) is (code == 0)


@pytest.mark.usefixtures('nothing_remembered')
def test_an_unsure_reading_is_no_path_where_the_instruction_is_required(capsys, room):
    words = ('--map', room, *WAY, *UNSURE, '--instruction-policy', 'require')
    code, found = plan(capsys, *words)
    assert (code, found['code_name'], found['path']) == (1, 'NO_VALID_PATH', [])
    assert QUESTION in found['message']
    assert plan(capsys, *words, '--confirm')[0] == 0


def test_what_cannot_be_met_is_said_and_by_policy_refused(capsys, room):
    words = ('--map', room, *WAY, '--instruction', 'avoid the north door and the south door')
    code, found = plan(capsys, *words)
    assert (code, found['instruction_report']['satisfied']) == (3, False)
    code, found = plan(capsys, *words, '--instruction-policy', 'require')
    assert (code, found['code_name'], found['path']) == (1, 'NO_VALID_PATH', [])


def test_on_a_barrier_map_the_places_are_in_its_coordinates(capsys, tmp_path):
    path = tmp_path / 'shifted.json'
    entry = {
        'id': 0, 'range_x': [-50, 1], 'range_y': [100, 131], 'start_goal': [],
        'horizontal_barriers': [[110, -40, -15]], 'vertical_barriers': [],
    }  # fmt: skip
    path.write_text(json.dumps([entry]))
    places = Places([Place('spot', shapely.box(-21, 119, -19, 121))])
    (tmp_path / 'places.geojson').write_text(json.dumps(places.to_geojson()))
    code, found = plan(
        capsys, '--map', str(path), '--start', '-30', '105', '--to', 'spot',
        '--instruction', 'go to -45, 125',
    )  # fmt: skip
    assert (code, found['goal']) == (0, [-20, 120])
    assert [-45, 125] in found['path']
    assert found['instruction_report']['satisfied'] is True


@pytest.mark.parametrize(
    'text', ['avoid the north door', 'avoid both rooms', 'keep 0.5 m from the pillar; sing']
)
def test_instructions_are_drawn(capsys, room, tmp_path, text):
    picture = tmp_path / 'a.png'
    words = ('--map', room, *WAY, '--instruction', text, '--png', str(picture))
    assert main(['plan', *words]) == (0 if text == 'avoid the north door' else 3)
    assert f'picture    {picture}' in capsys.readouterr().out
    with Image.open(picture) as image:
        assert min(image.size) > 500

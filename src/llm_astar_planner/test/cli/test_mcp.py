"""`llm-astar mcp`, driven by the client of the official SDK over standard input and output."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.places import Place, Places
from PIL import Image

anyio = pytest.importorskip('anyio')
pytest.importorskip('mcp.server.mcpserver', reason='the extra mcp is not installed')

from mcp.client import Client  # noqa: E402 - after the check that it is installed
from mcp.client.stdio import StdioServerParameters, stdio_client  # noqa: E402

PLACES = Places(
    [
        Place('west room', shapely.box(0, 0, 4, 6)),
        Place('east room', shapely.box(6, 0, 10, 6), aliases=('lab',)),
        Place('south door', shapely.box(4, 0, 6, 2)),
        Place('north door', shapely.box(4, 4, 6, 6)),
    ]
)


@pytest.fixture(scope='module')
def room(tmp_path_factory):
    """A map of 10 x 6 m with a pillar in the middle, and its places beside it."""
    folder = tmp_path_factory.mktemp('room')
    pixels = np.full((60, 100), 254, dtype=np.uint8)
    pixels[20:40, 40:60] = 0
    Image.fromarray(pixels).save(folder / 'room.pgm')
    (folder / 'room.yaml').write_text(
        'image: room.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\n'
        'occupied_thresh: 0.65\nfree_thresh: 0.25\n'
    )
    (folder / 'room.places.geojson').write_text(json.dumps(PLACES.to_geojson()))
    return str(folder / 'room.yaml')


# Name of the call: tool and arguments.
CALLS = {
    'places': ('list_places', {}),
    'interpret': ('interpret', {'text': 'avoid the north door; frobnicate'}),
    'too long': ('interpret', {'text': 'x' * 501}),
    'no text': ('interpret', {}),
    'direct': ('plan_route', {'start': [1, 3.5], 'goal': 'lab'}),
    'south': (
        'plan_route',
        {'start': [1, 3.5], 'goal': 'lab', 'instruction': 'avoid the north door'},
    ),
    'impossible': (
        'plan_route',
        {
            'start': 'west room',
            'goal': 'east room',
            'instruction': 'avoid the north door and the south door',
        },
    ),
    'required': (
        'plan_route',
        {
            'start': 'west room',
            'goal': 'east room',
            'instruction': 'avoid the north door and the south door',
            'policy': 'require',
        },
    ),
    'unsure': (
        'plan_route',
        {'start': [1, 3.5], 'goal': 'lab', 'instruction': 'avoid the nroth door'},
    ),
    'confirmed': (
        'plan_route',
        {
            'start': [1, 3.5],
            'goal': 'lab',
            'instruction': 'avoid the nroth door',
            'confirm': True,
        },
    ),
    'policy': ('plan_route', {'start': [1, 1], 'goal': [9, 1], 'policy': 'perhaps'}),
    'unknown place': ('plan_route', {'start': 'west rom', 'goal': [9, 1]}),
    'three numbers': ('plan_route', {'start': [1, 1, 0], 'goal': [9, 1]}),
    'huge': ('plan_route', {'start': [1e300, 1], 'goal': [9, 1]}),
    'off the map': ('plan_route', {'start': [1, 1], 'goal': [90, 1]}),
    'good path': (
        'check_path',
        {'points': [[1, 1], [9, 1]], 'instruction': 'avoid the north door'},
    ),
    'bad path': (
        'check_path',
        {'points': [[1, 3], [9, 3]], 'instruction': 'visit the north door'},
    ),
    'path off the map': ('check_path', {'points': [[1, 1], [90, 1]]}),
    'no path': ('check_path', {'points': []}),
    'why': (
        'ask_why',
        {'start': [1, 3.5], 'goal': 'lab', 'question': 'why not through the south door?'},
    ),
    'why what': ('ask_why', {'start': [1, 3.5], 'goal': 'lab', 'question': 'why me?'}),
}


@pytest.fixture(scope='module')
def answers(room):
    """The tools of the server, and its answers to all calls in one session."""

    async def ask():
        environment = {name: os.environ[name] for name in ('PATH', 'HOME') if name in os.environ}
        environment['XDG_STATE_HOME'] = os.environ['XDG_STATE_HOME']
        environment['PYTHONPATH'] = os.pathsep.join(sys.path)
        words = ['-m', 'llm_astar_planner.cli.main', 'mcp', '--map', room]
        command = StdioServerParameters(command=sys.executable, args=words, env=environment)
        async with Client(stdio_client(command)) as client:
            tools = (await client.list_tools()).tools
            found = {name: await client.call_tool(*call) for name, call in CALLS.items()}
        return {tool.name: tool for tool in tools}, found

    return anyio.run(ask)


def value(answers, name):
    answer = answers[1][name]
    assert not answer.is_error, answer.content[0].text
    assert json.loads(answer.content[0].text) == answer.structured_content
    return answer.structured_content


def error(answers, name):
    answer = answers[1][name]
    assert answer.is_error
    return answer.content[0].text


def test_the_five_tools_have_descriptions_and_bounded_arguments(answers):
    tools = answers[0]
    assert set(tools) == {'list_places', 'interpret', 'plan_route', 'ask_why', 'check_path'}
    assert all(len(tool.description) > 40 for tool in tools.values())
    assert tools['interpret'].input_schema['properties']['text']['maxLength'] == 500
    assert tools['check_path'].input_schema['properties']['points']['maxItems'] == 10_000


def test_a_question_is_answered_with_both_lengths(answers):
    found = value(answers, 'why')
    assert found['other'] > found['own'] > 7.0
    assert found['sentence'].startswith('through the south door: ')
    assert 'why me' in error(answers, 'why what')


def test_places_are_listed_with_the_map(answers):
    listed = value(answers, 'places')
    assert listed['map_corners'] == [[0, 0], [10, 0], [10, 6], [0, 6]]
    assert [place['name'] for place in listed['places']] == [place.name for place in PLACES]
    assert listed['places'][1]['aliases'] == ['lab']


def test_what_is_understood_and_what_is_not_is_said(answers):
    found = value(answers, 'interpret')
    kinds = [clause['kind'] for clause in found['specification']['clauses']]
    assert (found['status'], kinds) == ('partly understood', ['avoid', 'unknown'])
    assert found['sentence'].startswith('avoid the north door')


def test_a_question_goes_to_a_person_and_the_answer_comes_back(answers):
    asked, answered = value(answers, 'unsure'), value(answers, 'confirmed')
    assert asked['questions'] == ['Did you mean the north door by "nroth door"?']
    assert asked['instruction']['clauses'][0]['status'] == 'unsure'
    assert answered['questions'] == []
    assert answered['instruction']['sentence'] == 'The instruction is kept'


def test_a_route_without_an_instruction_is_the_shortest(answers):
    found = value(answers, 'direct')
    assert found['found']
    assert found['instruction'] is None
    assert found['path'][0] == pytest.approx([1.05, 3.55])
    assert found['path'][-1] == pytest.approx(found['goal'])
    assert shapely.LineString(found['path']).length == pytest.approx(found['length'], abs=0.01)


def test_a_route_keeps_to_an_instruction_and_says_so_for_each_clause(answers):
    found = value(answers, 'south')
    (clause,) = found['instruction']['clauses']
    assert (clause['status'], found['instruction']['satisfied']) == ('kept', True)
    path = shapely.LineString(found['path'])
    assert not path.crosses(PLACES.get('north door').geometry)
    assert path.crosses(PLACES.get('south door').geometry)
    assert found['length'] > value(answers, 'direct')['length']


def test_what_cannot_be_kept_is_never_called_satisfied(answers):
    found = value(answers, 'impossible')
    assert found['found']
    assert found['instruction']['satisfied'] is False
    assert found['instruction']['clauses'][-1]['status'] != 'kept'
    refused = value(answers, 'required')
    assert (refused['found'], refused['path'], refused['length']) == (False, [], None)


def test_a_path_is_checked_without_planning(answers):
    good, bad = value(answers, 'good path'), value(answers, 'bad path')
    assert (good['drivable'], good['problem'], good['length']) == (True, None, 8.0)
    assert good['instruction']['satisfied'] is True
    assert bad['drivable'] is False
    assert 'obstacle' in bad['problem']
    assert bad['instruction']['clauses'][0]['status'] == 'not kept'


@pytest.mark.parametrize(
    ('name', 'words'),
    [
        ('too long', 'at most 500'),
        ('no text', 'text'),
        ('policy', "policy: 'perhaps' is not one of prefer, require"),
        ('unknown place', 'did you mean west room?'),
        ('three numbers', 'at most 2 items'),
        ('huge', 'start: 1e+300 is not a number'),
        ('path off the map', 'points[1]: 90, 1 lies off the map'),
        ('no path', 'at least 1 item'),
    ],
)
def test_bad_arguments_are_errors_of_the_tool(answers, name, words):
    assert words in error(answers, name)


def test_a_goal_off_the_map_is_an_answer(answers):
    found = value(answers, 'off the map')
    assert not found['found']
    assert 'outside the map' in found['message']


def test_the_help_needs_no_sdk():
    script = (
        'import sys; sys.modules["mcp"] = None\n'
        'from llm_astar_planner.cli.main import main; main(["mcp", "--help"])'
    )
    done = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, '')
    assert '--places' in done.stdout

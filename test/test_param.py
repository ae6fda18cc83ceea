"""`llm-astar param` against a running node: values, types, limits, and what is not there."""

import re
import subprocess
import sys

import pytest
from graph_tools import process
from llm_astar_planner.cli.main import main
from llm_astar_planner.cli.param import ACTIONS, shown
from llm_astar_planner.nodes.tools.parameter_client import (
    RemoteParameterError,
    Type,
    parameter_client,
    typed,
)

PATIENCE = 60.0
SPACE = '/param_tests'
NODE = f'{SPACE}/map_node'
COMMAND = (sys.executable, '-m', 'llm_astar_planner.cli', 'param')


@pytest.fixture(scope='module')
def client():
    """A client in the graph of a running map_node."""
    with (
        process('map_node', namespace=SPACE, files=()),
        parameter_client(SPACE, [], PATIENCE) as client,
    ):
        yield client


@pytest.fixture
def param(client):
    """Do what the command does; return the value that `--json` prints, and the text."""
    return lambda action, *words: ACTIONS[action](client, *words)


def test_parameters_of_a_node_are_listed_read_and_set(param):
    values, text = param('list', NODE)
    assert values[NODE]['map_id'] == 0
    assert text.splitlines()[0] == NODE
    assert '  resolution                       1.0' in text.splitlines()
    # A whole number serves where a number is expected; ROS alone refuses it.
    assert param('set', NODE, 'resolution', '2') == (2.0, 'resolution: 2.0 (was 1.0)')
    assert param('get', 'map_node', 'resolution') == (2.0, '2.0')


def test_every_node_of_the_graph_is_listed(param):
    values, _ = param('list')
    assert values[NODE]['frame_id'] == 'map'


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (('get', NODE, 'map_di'), f'{NODE} has no parameter map_di; did you mean map_id?'),
        (('set', NODE, 'map_id', 'x'), "map_id: a whole number is expected, not 'x'"),
        (('set', NODE, 'map_id', '999'), f'{NODE} refused it: '),
    ],
)
def test_what_a_node_does_not_have_or_take_is_named(param, words, message):
    with pytest.raises(RemoteParameterError, match=f'^{re.escape(message)}'):
        param(*words)


@pytest.mark.usefixtures('client')
def test_the_command_prints_json_and_names_the_nodes_there_are():
    options = (('map_node', '--json', '--time-limit', '60'), ('map_nod', '--time-limit', '2'))
    known, unknown = (
        subprocess.Popen(
            [*COMMAND, 'get', name, 'map_file', '--namespace', SPACE, *more],
            text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )
        for name, *more in options
    )  # fmt: skip
    assert known.communicate(timeout=60.0)[0] == '"demo.json"\n'
    assert known.returncode == 0
    assert f'error: there is no node {SPACE}/map_nod; ' in unknown.communicate(timeout=60.0)[0]
    assert unknown.returncode == 2


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (('set', NODE, 'map_id'), 'param set NODE NAME VALUE is expected, not '),
        (('get', 'a b', 'x'), 'Invalid topic name'),
        (('list', '--time-limit', '0'), "--time-limit: '0' is not a number of at least 0.001"),
    ],
)
def test_wrong_usage_is_one_line(words, message, capfd):
    assert main(['param', *words]) == 2
    (said,) = capfd.readouterr().err.splitlines()
    assert said.startswith('llm-astar: error: ')
    assert message in said


@pytest.mark.parametrize(
    ('text', 'kind', 'value'),
    [
        ('true', Type.BOOL, True),
        ('off', Type.BOOL, False),
        ('3', Type.INTEGER, 3),
        ('3', Type.DOUBLE, 3.0),
        ('1e-3', Type.DOUBLE, 0.001),
        ('3', Type.STRING, '3'),
        ('avoid 1: [the', Type.STRING, 'avoid 1: [the'),
        ('[1.0, 2.5]', Type.DOUBLE_ARRAY, [1.0, 2.5]),
    ],
)
def test_a_text_becomes_a_value_of_the_parameters_type(text, kind, value):
    assert typed('name', text, kind).value == value


@pytest.mark.parametrize(
    ('text', 'kind'),
    [
        ('1', Type.BOOL),
        ('3.5', Type.INTEGER),
        ('true', Type.DOUBLE),
        ('[1, 2', Type.INTEGER_ARRAY),
        ('3', Type.INTEGER_ARRAY),
    ],
)
def test_a_text_that_is_no_value_of_the_type_is_refused(text, kind):
    with pytest.raises(RemoteParameterError, match=r'^name: .* is expected, not'):
        typed('name', text, kind)


def test_values_are_shown_as_a_parameter_file_has_them():
    assert [shown(value) for value in (True, 0.5, 'a b', '', [1, 2], 'a\x1b[2J')] == [
        'true', '0.5', 'a b', "''", '[1, 2]', r'"a\u001b[2J"',
    ]  # fmt: skip

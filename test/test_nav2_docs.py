"""docs/nav2.md compares every code, parameter, topic, service and action of planner_node."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest
import rclpy
from graph_tools import running, wait_for
from llm_astar_planner.nodes.planner.goals import error_name
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.planning.parameters import NODES
from llm_astar_planner.planning.types import ResultCode
from rclpy.action import get_action_server_names_and_types_by_node as action_names

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'nav2.md'
SECTION = re.compile(r'^## (.*?)\n(.*?)(?=^## |\Z)', re.MULTILINE | re.DOTALL)
SECTIONS = dict(SECTION.findall(PAGE.read_text()))
SPACE = '/compared'
# One row of the page stands for these.
OF_ANY_NODE = re.compile(r'.*(get_type_description|parameters?|parameter_types|_atomically)$')
# What planner_node and its waypoint client say to each other is no part of Nav2's interface.
OF_THE_CLIENT = re.compile(r'^llm_client_node/|.*/_action/')
REPORTED = {'goal occupied, `tolerance` 0': 0.0}
REASONS = {'cancelled, preempted, or deactivated meanwhile': 'a newer goal came'}


def rows_of(section):
    """Return the cells of each row of a section's table."""
    rows = [line[1:-1].split('|') for line in SECTIONS[section].splitlines() if line[:1] == '|']
    return rows[2:]


def code_rows():
    return rows_of('Codes')


def names(text):
    return set(re.findall(r'`([^`]+)`', text))


def ours_alone(section):
    """Return the names that a section lists behind its table."""
    return names(SECTIONS[section].partition('Ours alone: ')[2])


def test_every_parameter_is_compared_and_those_of_ours_exist():
    own = {parameter.name for parameter in NODES['planner_node']}
    assert own - names(SECTIONS['Parameters']) == set()
    assert ours_alone('Parameters') <= own


def test_our_defaults_are_those_of_the_table():
    own = {parameter.name: parameter.default for parameter in NODES['planner_node']}
    compared = 0
    for theirs, _, ours, default, _ in rows_of('Parameters'):
        same = names(theirs) if ours == 'the same' else names(ours)
        if len(same & own.keys()) == 1 and default not in ('', 'as above'):
            (name,) = same & own.keys()
            value = own[name]
            stated = default.strip('`').replace('empty', '')
            assert stated == (str(value).lower() if isinstance(value, bool) else str(value)), name
            compared += 1
    assert compared >= 12


@pytest.mark.parametrize('row', code_rows(), ids=lambda row: row[0])
def test_the_codes_of_the_actions_are_those_of_the_table(row):
    case, ours, reported = row[0], row[4], row[5].strip('`')
    code = ResultCode[reported]
    goals = () if case.startswith('`goals`') else ('a pose',)
    response = SimpleNamespace(
        plan=SimpleNamespace(code=code),
        goal=SimpleNamespace(goals=goals),
        request=SimpleNamespace(tolerance=REPORTED.get(case, 0.5)),
    )
    name = error_name(response, REASONS.get(case, ''))
    if name == 'NONE':
        assert ours.startswith(('a path', 'no code'))
    else:
        assert ours == f'`{name}`'


COMPARED = [name for name, text in SECTIONS.items() if '|---' in text and name != 'Times']


@pytest.mark.parametrize('section', COMPARED)
def test_every_row_says_what_is_the_same_what_differs_and_what_is_missing(section):
    verdict = re.compile(
        r'same|differs( because|:)|differs in|as (NavFn|Smac 2D)|\[below\]|of tf2'
    )
    for row in rows_of(section):
        is_missing = any(cell.startswith('missing') for cell in row[1:-1])
        assert is_missing or verdict.match(row[-1]) or row[0].startswith('**'), row


def test_every_code_of_a_plan_is_in_the_table():
    assert {code.name for code in ResultCode} == {row[5].strip('`') for row in code_rows()}


def names_in_the_graph(node):
    """Return the topics, services and actions of a node and of its side nodes, as in the page."""
    found = {name for name, _ in action_names(node, node.get_name(), SPACE)}
    for owner in node.get_node_names():
        for kind in ('publisher', 'subscriber', 'service'):
            get = getattr(node, f'get_{kind}_names_and_types_by_node')
            found |= {name for name, _ in get(owner, SPACE)}
    relative = {name.removeprefix(f'{SPACE}/') for name in found}
    return {name.replace(f'{node.get_name()}/', '~/') for name in relative}


def test_every_topic_service_and_action_is_compared_and_those_of_ours_exist():
    rclpy.init()
    node = PlannerNode(namespace=SPACE)
    compared = names(SECTIONS['Topics, services and actions'])
    with running(node):
        # The last that it subscribes to.
        wait_for(lambda: 'map' in names_in_the_graph(node), 'its topics')
        found = names_in_the_graph(node)
    rclpy.try_shutdown()
    missing = {name for name in found - compared if not OF_ANY_NODE.match(name)}
    assert {name for name in missing if not OF_THE_CLIENT.match(name)} == set()
    assert ours_alone('Topics, services and actions') <= found

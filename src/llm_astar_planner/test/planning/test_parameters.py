"""The table of parameters, and the parameter files that are checked against it."""

import re
from dataclasses import fields
from pathlib import Path

import pytest
import yaml
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.text import MAX_INSTRUCTION_CHARS
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.parameters import (
    FIXED,
    NODES,
    OTHERS,
    costmap_config,
    defaults,
    read_parameter_files,
    request_fields,
)
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.waypoints.config import SettingsError, SourceSettings, make_source
from make_reference import documented, markdown, yaml_text

ROOT = Path(__file__).parents[4]
ENTRIES = [(node, item) for node, table in NODES.items() for item in table]
NAMES = [f'{node}-{item.name}' for node, item in ENTRIES]


def read(tmp_path, text):
    path = tmp_path / 'planner.yaml'
    path.write_text(text)
    return read_parameter_files([path], ['planner_node'])['planner_node']


@pytest.mark.parametrize(('node', 'item'), ENTRIES, ids=NAMES)
def test_every_default_is_in_its_range_and_every_other_default_has_its_reason(node, item):
    assert item.problem(item.default) is None
    assert item.sentence
    assert (item.cli_default is None) == (item.cli_reason == '')
    if item.cli_default is not None:
        assert type(item.cli_default) is type(item.default)
        assert item.problem(item.cli_default) is None


def test_sentences_name_what_the_code_says():
    sentences = {item.name: item.sentence for _, item in ENTRIES}
    assert f'at most {MAX_INSTRUCTION_CHARS} characters' in sentences['instruction']
    named = re.findall(r'`(\w+)`', sentences['fixed_endpoint'])
    assert tuple(named) == FIXED


def test_names_are_unique_and_the_other_names_lead_to_present_ones():
    for node, table in NODES.items():
        names = [item.name for item in table]
        others = OTHERS.get(node, {})
        assert len({*names, *others}) == len(names) + len(others)
        assert set(others.values()) <= set(names)


def test_the_sources_of_the_table_are_those_that_can_be_made():
    source = next(item for item in NODES['llm_client_node'] if item.name == 'source')
    for name in source.choices:
        if name == 'replay':
            with pytest.raises(SettingsError, match='transcript: name'):
                make_source(SourceSettings(source=name))
        else:
            assert make_source(SourceSettings(source=name)).name == name


def test_configurations_have_the_defaults_of_the_table():
    names = {field.name for field in fields(CostmapConfig)}
    planner = defaults(NODES['planner_node'])
    assert {name: getattr(CostmapConfig(), name) for name in names} == {
        name: planner[name] for name in names
    }
    client = defaults(NODES['llm_client_node'])
    names = [field.name for field in fields(SourceSettings)]
    assert {name: getattr(SourceSettings(), name) for name in names} == {
        name: client[name] for name in names
    }


def test_a_request_is_made_of_parameters():
    values = defaults(NODES['planner_node'])
    request = PlanRequest((1, 1), (2, 2), **request_fields(values))
    assert (request.time_limit, request.source_time_limit) == (5.0, 4.0)
    assert request.max_suboptimality == 1.1
    first = request_fields(values | {'max_suboptimality': 0.0})
    assert first['max_suboptimality'] is None


def test_the_shipped_parameter_file_is_made_of_the_table():
    text = (ROOT / 'config' / 'planner.yaml').read_text()
    assert text == yaml_text()
    for node, sections in yaml.safe_load(text).items():
        stated = sections['ros__parameters']
        known = defaults(documented(node.removeprefix('/**/')))
        assert stated == {name: value for name, value in known.items() if value != ''}


def test_the_reference_holds_the_tables_of_parameters():
    assert markdown() in (ROOT / 'docs' / 'reference.md').read_text()


@pytest.mark.parametrize(
    'text',
    [
        'planner_node: {ros__parameters: {robot_radius: 1, weight: 3.0, use_sim_time: true}}',
        '/**: {ros__parameters: {robot_radius: 1, weight: 3.0}}',
        '/**/planner_node: {ros__parameters: {robot_radius: 1, weight: 3.0}}',
        '/robot1: {planner_node: {ros__parameters: {robot_radius: 1, weight: 3.0}}}',
        'planner_node: {ros__parameters: {weight: 3.0}}\n/**: {ros__parameters: '
        '{robot_radius: 1, weight: 9.0}}\nother: {ros__parameters: {robot_radius: 7}}',
    ],
)
def test_what_is_meant_for_the_node_counts_the_nearest_first(tmp_path, text):
    assert read(tmp_path, text) == {'robot_radius': 1.0, 'weight': 3.0}


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('planner_node: [', 'planner.yaml: '),
        ('- a', 'a ROS parameter file is expected'),
        ('map_node: {ros__parameters: {a: 1}}', 'has no ros__parameters for planner_node'),
        ('/**: {ros__parameters: {allow_unknown: 1}}', 'allow_unknown: bool is expected, not 1'),
        ('/**: {ros__parameters: {occupied_threshold: 65.0}}', 'occupied_threshold: int is exp'),
        ('/**: {ros__parameters: {robot_radius: -1}}', 'robot_radius: -1.0 is not in 0 to 10'),
        ('/**: {ros__parameters: {robot_radius: .nan}}', 'robot_radius: nan is not in'),
        ('/**: {ros__parameters: {method: magic}}', "method: 'magic' is not one of guided"),
        (
            '/**: {ros__parameters: {max_suboptimality: 0.5}}',
            'max_suboptimality: 0.5 is not in 1 to 1000, or 0',
        ),
    ],
)
def test_a_bad_file_is_refused_with_its_name_and_the_parameter(tmp_path, text, expected):
    with pytest.raises(ParameterError, match=r'planner\.yaml') as error:
        read(tmp_path, text)
    assert expected in str(error.value)


def test_what_is_not_given_is_at_the_nodes_defaults():
    assert costmap_config({}) == CostmapConfig()
    assert costmap_config({'cost_travel_multiplier': 5.0}) == CostmapConfig(
        cost_travel_multiplier=5.0
    )
    assert defaults(NODES['planner_node'])['tolerance'] == 0.5


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        (
            'planner_node: {ros__parameters: {robot_raduis: 0.2}}',
            'robot_raduis: planner_node has no parameter of this name; did you mean robot_radius?',
        ),
        (
            '/**: {ros__parameters: {robot_raduis: 0.2}}',
            'robot_raduis: no node of this package has a parameter of this name; did you mean '
            'robot_radius?',
        ),
        ('planner_node: {ros__parameters: {base_url: x}}', 'base_url: planner_node has no'),
        ('/robot/planner_node: {ros__parameters: {zzz: 1}}', 'zzz: planner_node has no parameter'),
        (
            'planner_node: {ros__parameters: {weight: 2.0}}\n'
            'llm_client_node: {ros__parameters: {modle: x}}',
            'modle: llm_client_node has no parameter of this name; did you mean model?',
        ),
    ],
)
def test_an_unknown_name_is_refused_and_the_nearest_one_named(tmp_path, text, expected):
    with pytest.raises(ParameterError, match=r'planner\.yaml: ') as error:
        read(tmp_path, text)
    assert expected in str(error.value)


@pytest.mark.parametrize(
    'text',
    [
        '/**: {ros__parameters: {base_url: x, map_id: 3, use_sim_time: true, weight: 3.0}}',
        '/**: {ros__parameters: {robot_description: x, plugin: {type: y}, weight: 3.0}}',
        'planner_node: {ros__parameters: {use_sim_time: true, weight: 3.0, '
        'qos_overrides./map.subscription.depth: 1, start_type_description_service: false}}',
        'planner_node: {ros__parameters: {weight: 3.0, qos_overrides: {/map: {subscription: '
        '{depth: 1}}}}}',
        'planner_node: {ros__parameters: {weight: 3.0}}\n'
        'controller_server: {ros__parameters: {weigth: 1}}',
    ],
)
def test_names_of_other_nodes_and_of_ros_are_no_mistake(tmp_path, text):
    assert read(tmp_path, text) == {'weight': 3.0}


def test_a_later_file_overrides_an_earlier_one(tmp_path):
    for name, weight in (('a', 3.0), ('b', 4.0)):
        (tmp_path / name).write_text(f'planner_node: {{ros__parameters: {{weight: {weight}}}}}')
    (tmp_path / 'c').write_text('llm_client_node: {ros__parameters: {source: none}}')
    found = read_parameter_files([tmp_path / name for name in 'abc'])
    assert found == {
        'planner_node': {'weight': 4.0},
        'llm_client_node': {'source': 'none'},
    }


def test_a_name_of_nav2s_is_accepted_and_gives_way_to_ours(tmp_path):
    path = tmp_path / 'nav2.yaml'
    path.write_text('planner_node: {ros__parameters: {autostart_node: false}}')
    found = read_parameter_files([path])
    assert found['planner_node'] == {'autostart': False}
    path.write_text('planner_node: {ros__parameters: {autostart_node: false, autostart: true}}')
    assert read_parameter_files([path])['planner_node'] == {'autostart': True}

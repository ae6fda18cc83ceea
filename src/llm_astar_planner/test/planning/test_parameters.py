"""A node's parameter file read without the node."""

import pytest
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.parameters import (
    OptionError,
    grid_rules,
    read_params_file,
    request_options,
)


def read(tmp_path, text):
    path = tmp_path / 'planner.yaml'
    path.write_text(text)
    return read_params_file(path)


@pytest.mark.parametrize(
    'text',
    [
        'planner_node: {ros__parameters: {robot_radius: 1, weight: 3.0, any_angle: true}}',
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
        ('/**: {ros__parameters: {method: magic}}', "method: 'magic' is none of guided"),
        ('/**: {ros__parameters: {max_suboptimality: 0.5}}', '0.5 is neither 0'),
    ],
)
def test_a_bad_file_is_refused_with_its_name_and_the_parameter(tmp_path, text, expected):
    with pytest.raises(OptionError, match=r'planner\.yaml') as error:
        read(tmp_path, text)
    assert expected in str(error.value)


def test_what_is_not_given_is_at_the_nodes_defaults():
    assert grid_rules({}) == CostmapConfig()
    assert grid_rules({'cost_travel_multiplier': 5.0}) == CostmapConfig(cost_multiplier=5.0)
    assert request_options({})['tolerance'] == 0.5

"""The parameter files in config/ set parameters that exist, to values that they can have."""

from pathlib import Path

import pytest
import yaml
from llm_astar_planner.nodes.planner.goals import INTROSPECTION_STATES
from llm_astar_planner.planning.parameters import NODES, read_parameter_files

CONFIG = Path(__file__).parents[1] / 'config'
FILES = sorted(path.name for path in CONFIG.glob('*.yaml'))
TABLE = {node: {item.name: item for item in table} for node, table in NODES.items()}


@pytest.mark.parametrize('name', FILES)
def test_a_parameter_file_holds_what_its_nodes_take(name):
    assert set(read_parameter_files([CONFIG / name], list(NODES))) == set(NODES)
    sections = yaml.safe_load((CONFIG / name).read_text())
    assert {node.removeprefix('/**/') for node in sections} <= set(NODES)
    for node, section in sections.items():
        # rcl takes no whole number for a float.
        for key, value in section['ros__parameters'].items():
            parameter = TABLE[node.removeprefix('/**/')][key]
            assert type(value) is type(parameter.default), key
            assert parameter.problem(value) is None


def test_the_modes_of_introspection_are_those_of_the_table():
    assert TABLE['planner_node']['introspection_mode'].choices == tuple(INTROSPECTION_STATES)

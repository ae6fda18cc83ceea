"""The parameter files hold parameters that there are, and planner.yaml their defaults."""

from pathlib import Path

import pytest
import yaml
from llm_astar_planner.nodes.planner.parameters import PARAMETERS, problem

DEFAULTS = {parameter.name: parameter for parameter in PARAMETERS}


def values_of(name):
    file = Path(__file__).parents[1] / 'config' / name
    return yaml.safe_load(file.read_text())['/**/planner_node']['ros__parameters']


@pytest.mark.parametrize('name', ['planner.yaml', 'costmap.yaml', 'nav2.yaml', 'demo.yaml'])
def test_a_parameter_file_holds_what_the_planner_takes(name):
    values = values_of(name)
    for key, value in values.items():
        parameter = DEFAULTS[key]
        assert type(value) is type(parameter.default), key
        assert parameter.problem(value) == ''
        if parameter.minimum is not None:
            assert parameter.minimum <= value <= parameter.maximum, key
    assert problem({key: item.default for key, item in DEFAULTS.items()} | values) == ''


def test_the_planners_own_file_states_the_defaults():
    values = values_of('planner.yaml')
    assert values == {name: DEFAULTS[name].default for name in values}
    assert set(DEFAULTS) - set(values) <= {'llm_client', 'instruction'}

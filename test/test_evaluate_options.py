"""What `evaluate` takes for the planner node's defaults are the node's defaults."""

from llm_astar_planner.nodes.planner.parameters import PARAMETERS
from llm_astar_planner.planning.parameters import OPTIONS


def test_options_have_the_nodes_names_and_defaults():
    own = {parameter.name: parameter.default for parameter in PARAMETERS}
    assert {name: option.default for name, option in OPTIONS.items()} == {
        name: own[name] for name in OPTIONS
    }

"""The shipped templates, as a model gets them."""

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.prompts.map_description import describe
from llm_astar_planner.waypoints.prompts.template import (
    load_template,
)
from llm_astar_planner.waypoints.source import WaypointQuery

MAP = BarrierMap(0, (0, 51), (0, 31), (Barrier(10, 3, 25),), (Barrier(25, 10, 22),))
DESCRIPTION = describe(WaypointQuery(Costmap(MAP.to_grid()), (39, 22), (3, 14)))
QUESTION = (
    'Start Point: [39, 22]\nGoal Point: [3, 14]\n'
    'Horizontal Barriers: [[10, 3, 25]]\nVertical Barriers: [[25, 10, 22]]'
)


@pytest.mark.parametrize(
    ('name', 'examples'), [('few_shot', 5), ('zero_shot', 0), ('cot', 3), ('repe', 3)]
)
def test_a_shipped_template_shows_its_examples_and_asks_last(name, examples):
    text = load_template(name).render(DESCRIPTION).content
    assert text.count('\nStart Point') == examples + 1
    assert f'\n\n{QUESTION}\n' in text


def test_the_zero_shot_prompt_is_the_few_shot_prompt_without_its_examples():
    zero, few = (load_template(name).text.split('\n\n') for name in ('zero_shot', 'few_shot'))
    assert zero == [few[0], few[-1]]

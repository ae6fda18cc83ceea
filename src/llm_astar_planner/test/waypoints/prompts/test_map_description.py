"""Prompts: true demonstrations, faithful descriptions, coordinates that find their way back."""

import re
from itertools import pairwise

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.prompts.map_description import (
    MAX_BARRIERS,
    MAX_LATTICE_SIDE,
    Lattice,
    describe,
)
from llm_astar_planner.waypoints.prompts.reply_parser import parse_reply
from llm_astar_planner.waypoints.prompts.template import (
    TEMPLATES,
    TemplateError,
    load_template,
    template_path,
)
from llm_astar_planner.waypoints.source import WaypointQuery
from segments import crosses

DEMONSTRATION = re.compile(
    r'Start Point: (?P<start>\[.*\])\nGoal Point: (?P<goal>\[.*\])\n'
    r'Horizontal Barriers: (?P<horizontal>\[.*\])\nVertical Barriers: (?P<vertical>\[.*\])\n'
    r'(?P<thoughts>(?:.+\n)*?)(?P<path>Generated Path: .*)\n'
)
MAP = BarrierMap(
    id=0,
    range_x=(0, 51),
    range_y=(0, 31),
    horizontal_barriers=(Barrier(10, 0, 25), Barrier(15, 30, 50)),
    vertical_barriers=(Barrier(25, 10, 22),),
)


def numbers(text):
    return [int(value) for value in re.findall(r'-?\d+', text)]


def triples(text):
    values = numbers(text)
    return [tuple(values[i : i + 3]) for i in range(0, len(values), 3)]


def demonstrations(name):
    found = [match.groupdict() for match in DEMONSTRATION.finditer(load_template(name).text)]
    return [demo for demo in found if '{' not in demo['start']]


@pytest.mark.parametrize(('name', 'count'), [('few_shot', 5), ('cot', 3), ('repe', 3)])
def test_every_demonstration_is_a_valid_path(name, count):
    demos = demonstrations(name)
    assert len(demos) == count
    for demo in demos:
        path = parse_reply(demo['path'])
        assert [*path[0], *path[-1]] == numbers(demo['start']) + numbers(demo['goal'])
        assert all(2 <= x <= 48 and 2 <= y <= 28 for x, y in path)
        walls = [((x0, y), (x1, y)) for y, x0, x1 in triples(demo['horizontal'])]
        walls += [((x, y0), (x, y1)) for x, y0, y1 in triples(demo['vertical'])]
        for p, q in pairwise(path):
            assert not any(crosses(p, q, *wall) for wall in walls), (demo, p, q)


def test_the_first_demonstration_is_the_papers():
    for name in ('few_shot', 'cot', 'repe'):
        first = demonstrations(name)[0]
        assert (first['start'], first['goal']) == ('[5, 5]', '[20, 20]')
        assert first['horizontal'] == '[[10, 0, 25], [15, 30, 50]]'
        assert first['vertical'] == '[[25, 10, 22]]'
        assert first['path'] == 'Generated Path: [[5, 5], [26, 9], [25, 23], [20, 20]]'


def test_demonstrations_think_as_their_prompt_asks():
    assert all(not demo['thoughts'] for demo in demonstrations('few_shot'))
    assert all(demo['thoughts'].startswith('Thought: ') for demo in demonstrations('cot'))
    for demo in demonstrations('repe'):
        steps = demo['thoughts'].split('- ')[1:]
        reached = [parse_reply(step.split('Evaluation')[-2])[-1] for step in steps]
        assert tuple(reached) == parse_reply(demo['path'])[1:]
        for step in steps:
            assert step.count('Selected Point') == step.count('Evaluation')
            assert step.count('collides') == step.count('Selected Point') - 1


@pytest.mark.parametrize('name', TEMPLATES)
def test_a_prompt_states_the_whole_question(name):
    description = describe(WaypointQuery(Costmap(MAP.to_grid()), (39, 22), (3, 14)))
    (message,) = load_template(name).render(description)
    assert message.role == 'user'
    question = message.content[message.content.rindex('Start Point') :]
    assert question.startswith('Start Point: [39, 22]\nGoal Point: [3, 14]\n')
    listed = re.findall(r'Barriers: (.*)', question)
    # The outermost cells are walls anyway, so a barrier may be listed without its end there.
    assert triples(listed[0]) in ([(10, 0, 25), (15, 30, 50)], [(10, 1, 25), (15, 30, 49)])
    assert triples(listed[1]) == [(25, 10, 22)]
    assert 'x from 2 to 48 and y from 2 to 28' in message.content
    assert '{' not in message.content


def test_a_users_template(tmp_path):
    path = tmp_path / 'mine.txt'
    path.write_text('{"from": {start}, "to": {goal}} {horizontal_barriers}{vertical_barriers} {x}')
    template = load_template(str(path))
    description = describe(WaypointQuery(Costmap(MAP.to_grid()), (5, 5), (20, 20)))
    text = template.render(description)[0].content
    assert template.name == 'mine'
    assert text.startswith('{"from": [5, 5], "to": [20, 20]} [[')
    assert text.endswith('{x}')
    assert not template.thinks
    path.write_text('{start} {goal}')
    with pytest.raises(TemplateError, match=r'mine.txt: does not use \{horizontal_barriers\}'):
        load_template(str(path))
    with pytest.raises(
        TemplateError, match="'five_shot' is none of few_shot, zero_shot, cot, repe"
    ):
        load_template('five_shot')
    with pytest.raises(TemplateError, match='No such file'):
        load_template(str(tmp_path / 'none.txt'))
    with pytest.raises(TemplateError, match='none of'):
        template_path('mine')


def test_the_lattice_of_a_dataset_is_kept():
    shifted = BarrierMap(0, (-5, 15), (2, 12), horizontal_barriers=(Barrier(6, -4, 8),))
    description = describe(
        WaypointQuery(Costmap(shifted.to_grid()), (1, 2), (10, 8)), lattice=Lattice(-5, 2)
    )
    assert (description.start, description.goal) == ((-4, 4), (5, 10))
    assert [b.line for b in description.horizontal_barriers] == [6]
    assert description.x_bounds == (-3, 12)
    assert description.lattice.to_cells([(-4.0, 4.0)], off_map(shifted.to_grid())) == ((1.0, 2.0),)


def test_a_scaled_map_of_the_paper_keeps_its_numbers():
    scaled = MAP.scale(10)
    description = describe(WaypointQuery(Costmap(scaled.to_grid()), (50, 50), (200, 200)))
    assert description.lattice.unit == 1
    assert description.start == (50, 50)
    assert Barrier(250, 100, 220) in description.vertical_barriers


def big_map():
    """Rooms of 200 cells with doors of 30 and some noise: 1200 x 900."""
    rng = np.random.default_rng(1)
    cells = np.zeros((900, 1200), dtype=np.int8)
    cells[::200, :] = cells[:, ::200] = 100
    for x in range(100, 1200, 200):
        cells[:, x : x + 30][cells[:, x : x + 30] > 0] = 0
    for y in range(100, 900, 200):
        cells[y : y + 30, :] = 0
    cells[rng.integers(0, 900, 500), rng.integers(0, 1200, 500)] = 100
    return GridMap(cells, 0.05, Pose2D(-3.0, 1.0, 0.3))


def off_map(grid_map):
    """Return a query whose start and goal lie in no block of the map."""
    return WaypointQuery(Costmap(grid_map), (-99, -99), (-99, -99))


def test_a_big_map_fits_its_budget_on_a_coarse_lattice():
    start, goal = (17, 33), (1130, 871)
    query = WaypointQuery(Costmap(big_map()), start, goal)
    description = describe(query, max_tokens=400)
    barriers = description.horizontal_barriers + description.vertical_barriers
    values = description.values()
    assert 0 < len(barriers) <= MAX_BARRIERS
    assert len(values['horizontal_barriers'] + values['vertical_barriers']) <= 400 * 1.5 + 10
    assert max(description.x_bounds + description.y_bounds) < MAX_LATTICE_SIDE
    lattice = description.lattice
    assert lattice.unit == 12
    assert lattice.to_cells([description.start, description.goal], query) == (start, goal)


def test_coarse_points_come_back_on_free_cells():
    grid_map = big_map()
    lattice = Lattice(unit=12)
    for x in range(0, 100, 7):
        for y in range(0, 75, 7):
            ((cx, cy),) = lattice.to_cells([(x, y)], off_map(grid_map))
            block = grid_map.cells[y * 12 : y * 12 + 12, x * 12 : x * 12 + 12]
            assert lattice.to_lattice((int(cx), int(cy))) == (x, y)
            assert grid_map.cells[int(cy), int(cx)] == 0 or not (block == 0).any()
    assert lattice.to_cells([(500, -3)], off_map(grid_map)) == ((6005.0, -31.0),)

"""Questions about a path are answered by two exact searches, in four languages."""

import numpy as np
import pytest
import shapely
from grids import shortest_path
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.zone_layer import ZoneLayer
from llm_astar_planner.costmap.zones import Zone
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter
from llm_astar_planner.instructions.interpretation import RouteInstruction
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.questions import QuestionError, Questions, read_question
from llm_astar_planner.planning.types import PlanRequest

START, GOAL = (5, 30), (75, 30)
KITCHEN = ('Küche', 'cuisine', 'cocina')
PLACES = Places([
    Place('kitchen', shapely.box(4.5, 0.2, 7.9, 2.0), 'room', aliases=KITCHEN),
    Place('door', shapely.box(3.9, 2.5, 4.2, 3.5), 'door', aliases=('Tür', 'porte', 'puerta')),
])  # fmt: skip
# A wall of which the doors are far from the straight line, one of them in a zone.
CELLS = np.zeros((60, 80), dtype=np.int8)
CELLS[:, 40], CELLS[22:26, 40], CELLS[45:50, 40] = 100, 0, 0
ZONE = Zone('z1', shapely.box(3.5, 2.0, 4.5, 2.7), name='wet floor')
RULES = CostmapConfig(robot_radius=0.15)
GRAMMAR = GrammarInterpreter()


def questions(zones=(ZONE,), cells=CELLS, **fields):
    base = GridMap(cells, 0.1)
    grid_map = ZoneLayer(base, zones, config=RULES).compose(base)
    request = PlanRequest(START, GOAL, time_limit=60.0, **fields)
    return Questions(Planner(grid_map, RULES), request, GRAMMAR, PLACES)


@pytest.mark.parametrize(
    ('text', 'begin'),
    [
        ('why not through the kitchen?', 'through the kitchen: 10.5 m instead of 8.3 m'),
        ('Warum nicht durch die Küche?', 'durch die Küche: 10.5 m statt 8.3 m'),
        ('Pourquoi pas par la cuisine ?', 'par la cuisine : 10.5 m au lieu de 8.3 m'),
        ('¿Por qué no por la cocina?', 'por la cocina: 10.5 m en lugar de 8.3 m'),
    ],
)
def test_why_not_compares_both_paths_and_says_where_it_is_narrow(text, begin):
    answer = questions().answer(text)
    assert answer['sentence'].startswith(begin)
    assert '(4.05, 4.65) m' in answer['sentence']
    assert '0.05 m' in answer['sentence']
    assert (answer['own'], answer['other']) == pytest.approx((8.325, 10.53), abs=1e-3)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('what if the door were open?', '7.0 m instead of 8.3 m'),
        ('Was wäre, wenn die Tür offen wäre?', '7.0 m statt 8.3 m'),
        ('Et si la porte était ouverte ?', '7.0 m au lieu de 8.3 m'),
        ('¿Y si la puerta estuviera abierta?', '7.0 m en lugar de 8.3 m'),
        ('what if the wet floor were gone?', '7.5 m instead of 8.3 m'),
        ('what if the kitchen was closed?', '8.3 m, no longer than the best path'),
    ],
)
def test_what_if_solves_the_other_map(text, words):
    assert words in questions().answer(text)['sentence']


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('why so long?', 'without z1 (wet floor) 7.5 m'),
        ('Warum ist der Weg so lang?', 'ohne z1 (wet floor) 7.5 m; ohne den Radius'),
        ('Pourquoi si long ?', 'sans z1 (wet floor) 7.5 m'),
        ('¿Por qué tan largo?', 'sin z1 (wet floor) 7.5 m'),
    ],
)
def test_why_so_long_has_the_price_of_each_cause(text, words):
    answer = questions().answer(text)
    assert words in answer['sentence']
    assert answer['prices']['z1 (wet floor)'] == pytest.approx(7.497, abs=1e-3)


def test_walls_alone_are_said_to_be_it():
    planner = Planner(GridMap(CELLS, 0.1))
    asked = Questions(planner, PlanRequest(START, GOAL), GRAMMAR, PLACES)
    assert asked.answer('why this way?')['sentence'].endswith('the walls alone make it so long')


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('why not through the door?', 'through the door: the path does so already'),
        ('warum nicht durch die Tür?', 'durch die Tür: das tut der Weg schon'),
        ('why not avoid the kitchen?', 'avoid the kitchen: the path does so already'),
    ],
)
def test_what_the_path_does_already_is_said_so(text, words):
    door = CELLS.copy()
    door[22:36, 40] = 0
    answer = questions((), door).answer(text)
    assert answer['sentence'] == words
    assert answer['own'] == answer['other']


def test_the_narrowest_place_is_a_gap_and_no_lone_post():
    cells = np.zeros((60, 80), dtype=np.int8)
    cells[:, 60], cells[44:51, 60] = 100, 0
    cells[31, 20] = 100
    asked = questions((), cells)
    assert '(6.05, 4.55) m' in asked.answer('why not through the kitchen?')['sentence']
    assert asked.other is not None
    # Past the post there is open floor.
    cells[:, 60] = 0
    kitchen = questions((), cells).answer('why not through the kitchen?')['sentence']
    assert 'narrowest' not in kitchen


def test_why_so_long_names_the_eight_directions():
    cells = np.zeros((60, 80), dtype=np.int8)
    asked = Questions(Planner(GridMap(cells, 0.1)), PlanRequest((5, 5), (75, 35)), GRAMMAR)
    assert asked.answer('why so long?')['sentence'] == (
        '8.2 m, 7.6 m in a straight line; in 8 directions 8.2 m, at any angle 7.6 m '
        '(`any_angle: true`)'
    )


def test_without_a_path_why_so_long_says_what_opens_one():
    cells = CELLS.copy()
    cells[45:50, 40] = 100
    answer = questions(cells=cells).answer('why so long?')
    assert answer['own'] is None
    assert answer['sentence'].startswith('there is no path (')
    assert answer['sentence'].endswith('; without z1 (wet floor) 7.5 m')


def test_clauses_of_an_instruction_have_their_price_and_stay_in_force():
    reading = GRAMMAR.interpret('avoid the door; visit the kitchen', PLACES, 1.0)
    asked = questions((), instruction=RouteInstruction(reading, PLACES))
    prices = asked.answer('why so long?')['prices']
    assert prices == {'"visit the kitchen"': pytest.approx(7.497, abs=1e-3)}
    both = asked.answer('what if the door were closed?')
    assert both['other'] == both['own']


def test_what_is_impossible_says_why():
    cells = CELLS.copy()
    cells[0:22, 40:] = 100
    answer = questions(cells=cells).answer('why not through the kitchen?')
    assert answer['other'] is None
    assert answer['sentence'].startswith('through the kitchen: there is no path (')
    cells = CELLS.copy()
    cells[45:50, 40] = 100
    answer = questions(cells=cells).answer('what if the door were open?')
    assert answer['own'] is None
    assert answer['sentence'].startswith('what if the door were open: 7.0 m; now there is no path')


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('why me', 'is not understood; ask'),
        ('why not through the ballroom?', "'through the ballroom' is not understood"),
        ('what if the ballroom were open?', 'is not understood'),
        ('', 'is not understood; ask'),
    ],
)
def test_what_is_not_understood_says_what_can_be_asked(text, words):
    with pytest.raises(QuestionError, match=words):
        questions().answer(text)


def test_an_instruction_is_no_question():
    for text in ('avoid the kitchen', 'visit the door', 'nicht durch die Küche', 'what a day'):
        assert read_question(text) is None


def visits(seed, number):
    """Ask why a random path does not pass a random cell, and solve it by two searches."""
    random = np.random.default_rng(seed)
    while number:
        cells = np.where(random.random((16, 16)) < 0.25, 100, 0).astype(np.int8)
        start, goal, by = (tuple(map(int, random.integers(0, 16, 2))) for _ in range(3))
        place = Place('spot', shapely.box(by[0], by[1], by[0] + 1.0, by[1] + 1.0))
        planner = Planner(GridMap(cells))
        asked = Questions(planner, PlanRequest(start, goal), GRAMMAR, Places([place]))
        grid = planner.costmap.grid_graph
        if (
            not planner.plan(PlanRequest(start, by)).code
            and not planner.plan(PlanRequest(by, goal)).code
        ):
            number -= 1
            legs = shortest_path(grid, start, by)[1] + shortest_path(grid, by, goal)[1]
            answer = asked.answer('why not through the spot?')
            expected = shortest_path(grid, start, goal)[1], legs
            yield (answer['own'], answer['other']) == pytest.approx(expected, abs=2e-3)


def test_why_not_is_the_difference_of_two_exact_searches():
    assert all(visits(0, 40))


@pytest.mark.slow
def test_it_is_five_hundred_times():
    assert sum(visits(1, 500)) == 500

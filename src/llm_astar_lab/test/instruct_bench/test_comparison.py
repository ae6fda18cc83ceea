"""Which specifications count as the same, and which do not."""

import numpy as np
import pytest
from instruction_suites import MAPS, ROOMS
from llm_astar_lab.instruct_bench.maps import SuiteError, SuiteMap
from llm_astar_lab.instruct_bench.suite import normal_form, same_specification
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import places_from_polygons
from llm_astar_planner.instructions.specification import from_json

PLACES = places_from_polygons(MAPS['rooms']['places'])
MAP = SuiteMap('rooms', GridMap(np.where(ROOMS, 100, 0), 0.5), PLACES)
DESK, VAULT = {'place': 'desk'}, {'place': 'vault'}


def spec(*clauses):
    return from_json({'clauses': list(clauses)})


def clause(kind, region=None, **fields):
    return {'kind': kind, **({} if region is None else {'region': region}), **fields}


SAME = [
    (spec(clause('avoid', DESK)), spec(clause('avoid', {'place': 'Desk'}))),
    (spec(clause('visit', {'place': 'left room'})), spec(clause('visit', {'place': 'west room'}))),
    (
        spec(clause('avoid', {'point': [1, 2]})),
        spec(clause('avoid', {'point': [1, 2], 'radius': 1})),
    ),
    (spec(clause('visit', {'point': [1, 2]})), spec(clause('visit', {'point': [1, 2.004]}))),
    (
        spec(clause('avoid', DESK), clause('visit', VAULT)),
        spec(clause('visit', VAULT), clause('avoid', DESK)),
    ),
    (spec(clause('visit', regions=[DESK, VAULT])), spec(clause('visit', regions=[VAULT, DESK]))),
    (
        spec(clause('avoid', {'box': [0, 3, 12, 6]})),
        spec(clause('avoid', {'box': [None, 3, None, None]})),
    ),
    (
        spec(clause('avoid', {'tag': 'door'})),
        spec(clause('avoid', {'place': 'north door'}), clause('avoid', {'place': 'south door'})),
    ),
    (spec(clause('stay_in', {'tag': 'blue'})), spec(clause('stay_in', {'place': 'east room'}))),
    (
        spec(clause('keep_distance', **{'from': DESK, 'metres': 2})),
        spec(clause('avoid', DESK, margin=2)),
    ),
    (
        spec(clause('keep_distance', **{'from': {'point': [1, 2]}, 'metres': 5})),
        spec(clause('avoid', {'point': [1, 2], 'radius': 5})),
    ),
    (
        spec(clause('keep_distance', **{'from': 'walls', 'metres': 1})),
        spec(clause('avoid', {'along': 'walls', 'width': 1})),
    ),
    (
        spec(clause('avoid', DESK), clause('avoid', DESK)),
        spec(clause('avoid', DESK, guessed=True)),
    ),
    (
        spec(clause('stay_in', {'between': ['desk', 'vault']})),
        spec(clause('stay_in', {'between': ['vault', 'desk']})),
    ),
    (spec(clause('unknown', text='dance')), spec(clause('unknown', text='dance then sing'))),
    (
        spec(clause('visit', {'tag': 'door'})),
        spec(clause('visit', {'any_of': [{'place': 'south door'}, {'place': 'north door'}]})),
    ),
    (
        spec(clause('avoid', {'any_of': [DESK, VAULT]})),
        spec(clause('avoid', VAULT), clause('avoid', DESK)),
    ),
    (
        spec(clause('avoid', {'region': {'tag': 'door'}, 'except': [{'place': 'north door'}]})),
        spec(clause('avoid', {'place': 'south door'})),
    ),
    (
        spec(clause('then', first=DESK, second={'any_of': [VAULT, DESK]})),
        spec(clause('then', first={'place': 'Desk'}, second={'any_of': [DESK, VAULT]})),
    ),
    (
        spec(clause('unsupported', text='slowly', about='speed')),
        spec(clause('unsupported', text='slow', about='speed')),
    ),
]
DIFFERENT = [
    (spec(clause('avoid', DESK)), spec(clause('avoid', VAULT))),
    (spec(clause('avoid', DESK)), spec(clause('avoid', DESK, strength='should'))),
    (spec(clause('avoid', DESK)), spec(clause('avoid', DESK, margin=1))),
    (spec(clause('avoid', DESK)), spec(clause('visit', DESK))),
    (
        spec(clause('visit', DESK), clause('visit', VAULT)),
        spec(clause('visit', VAULT), clause('visit', DESK)),
    ),
    (
        spec(clause('visit', DESK), clause('visit', VAULT)),
        spec(clause('visit', regions=[DESK, VAULT])),
    ),
    (spec(clause('avoid', {'point': [1, 2]})), spec(clause('avoid', {'point': [2, 1]}))),
    (spec(clause('avoid', DESK)), spec(clause('avoid', DESK), clause('unknown', text='dance'))),
    (spec(clause('avoid', DESK)), spec()),
    (spec(clause('unknown', text='dance')), spec()),
    (spec(clause('avoid', {'box': [0, 3, 12, 6]})), spec(clause('avoid', {'box': [0, 4, 12, 6]}))),
    (
        spec(clause('avoid', {'half': 'north'})),
        spec(clause('avoid', {'half': 'north', 'of': 'desk'})),
    ),
    (
        spec(clause('before', first=DESK, second=VAULT)),
        spec(clause('before', first=VAULT, second=DESK)),
    ),
    (spec(clause('pass', DESK, side='north')), spec(clause('pass', DESK, side='left'))),
    (
        spec(clause('then', first=DESK, second=VAULT)),
        spec(clause('then', first=VAULT, second=DESK)),
    ),
    (
        spec(clause('then', first=DESK, second=VAULT)),
        spec(clause('never_after', first=DESK, second=VAULT)),
    ),
    (spec(clause('count', DESK, at_most=2)), spec(clause('count', DESK, at_most=1))),
    (spec(clause('count', DESK, at_most=2)), spec(clause('count', DESK, at_least=2))),
    (spec(clause('end_at', {'end': 'start'})), spec(clause('end_at', {'end': 'goal'}))),
    (
        spec(clause('avoid', {'region': {'half': 'north'}, 'except': [DESK]})),
        spec(clause('avoid', {'half': 'north'})),
    ),
    (
        spec(clause('visit', {'any_of': [DESK, VAULT]})),
        spec(clause('visit', {'all_of': [DESK, VAULT]})),
    ),
]


@pytest.mark.parametrize(('one', 'other'), SAME)
def test_these_ask_the_same(one, other):
    assert same_specification(one, [other], MAP)


@pytest.mark.parametrize(('one', 'other'), DIFFERENT)
def test_these_do_not(one, other):
    assert not same_specification(one, [other], MAP)


def test_one_of_several_accepted_ones_is_enough():
    one, other = DIFFERENT[0]
    assert same_specification(one, [other, one], MAP)


def test_a_place_that_is_not_on_the_map_is_the_same_as_nothing():
    attic = spec(clause('avoid', {'place': 'attic'}))
    assert not same_specification(attic, [spec(clause('avoid', DESK))], MAP)
    with pytest.raises(SuiteError, match='attic'):
        normal_form(attic, MAP)

"""Queries in plain language, in the form of the dataset's sentences."""

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMapError, load_barrier_maps
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.prompts.map_description import QueryError, parse_query

SENTENCE = (
    'design a path from [5, 5] to [20, 20] on a 51 by 31 grid that avoids horizontal barriers '
    'centered at [[10, 0, 25], [15, 30, 50]] and vertical barriers at [[25, 10, 22]].'
)


def check(barrier_map):
    (sample,) = barrier_map.samples
    assert (sample.start, sample.goal) == ((5, 5), (20, 20))
    assert (barrier_map.range_x, barrier_map.range_y) == ((0, 51), (0, 31))
    assert barrier_map.horizontal_barriers == (Barrier(10, 0, 25), Barrier(15, 30, 50))
    assert barrier_map.vertical_barriers == (Barrier(25, 10, 22),)


def test_a_sentence_in_the_form_of_the_dataset():
    check(parse_query(SENTENCE))
    check(parse_query('  ' + SENTENCE.upper().replace(', ', ',').replace(' ', '\n ')))
    check(parse_query(SENTENCE.replace('[10, 0, 25]', '[10, 25, 0]')))
    bare = parse_query(
        'Plan a path from [1,1] to [8, 8] on a 10 by 12 grid that avoids horizontal barriers '
        'at [] and vertical barriers at []'
    )
    assert bare.range_y == (0, 12)
    assert bare.horizontal_barriers == ()


def test_every_sentence_of_the_dataset():
    for barrier_map in load_barrier_maps(find_file('samples_1000.json', 'maps')):
        for sample in barrier_map.samples:
            asked = parse_query(sample.query)
            assert asked.samples == (sample._replace(query=''),)
            assert asked.horizontal_barriers == barrier_map.horizontal_barriers
            assert asked.vertical_barriers == barrier_map.vertical_barriers
            assert asked.range_x == barrier_map.range_x


def test_a_sentence_of_another_form_is_refused_with_the_form_that_is_understood():
    with pytest.raises(QueryError, match='not of the form "design a path from'):
        parse_query('get me from the door to the window')
    with pytest.raises(QueryError, match='longer than'):
        parse_query(SENTENCE + ' ' * 30000)


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('[5, 5]', '[99, 5]', 'start x: 99 is outside'),
        ('51 by 31', '999999 by 999999', 'range_x, range_y: over'),
        ('[15, 30, 50]', '[15, 30, 60]', r'horizontal_barriers\[1\]'),
        ('[25, 10, 22]', '[52, 10, 22]', r'vertical_barriers\[0\]'),
    ],
)
def test_numbers_that_fit_no_map_are_named(old, new, words):
    with pytest.raises(BarrierMapError, match=words):
        parse_query(SENTENCE.replace(old, new))

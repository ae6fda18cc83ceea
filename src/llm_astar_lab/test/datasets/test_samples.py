"""Samples are selected by map and by limit; bad selections are named."""

import pytest
from llm_astar_lab.datasets.named import SelectionError, draw, load_samples, parse_ranges


def test_selections_by_map_and_by_limit(dataset):
    assert {sample.key[0] for sample in load_samples(dataset, '3,11-12')} == {3, 11, 12}
    few, more = (load_samples(dataset, limit=n, seed=2) for n in (3, 9))
    assert {sample.key for sample in few} < {sample.key for sample in more}
    assert draw(few, 50, 0) == few
    assert parse_ranges('1-3,7', '--scales') == [1, 2, 3, 7]


@pytest.mark.parametrize(
    'text',
    [
        '',
        'a',
        '3-',
        '5-1',
        '1,,2',
        '-4',
        '0-99999999999999',
        '9' * 5000,
        '0-600000,7-1200000',
    ],
)
def test_bad_ranges_are_named(text):
    with pytest.raises(SelectionError, match='--maps'):
        parse_ranges(text, '--maps')


def test_a_selection_that_leaves_nothing_lists_what_there_is(dataset):
    with pytest.raises(SelectionError, match='its ids are 3 to 12'):
        load_samples(dataset, '50-99')

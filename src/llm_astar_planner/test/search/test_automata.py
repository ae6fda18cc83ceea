"""What the automata of clauses accept, against sentences about words of cells."""

import itertools
import math

import numpy as np
import pytest
from llm_astar_planner.search.automata import (
    Automaton,
    AutomatonError,
    before,
    entries,
    never_after,
    then,
    visits,
)

# Words of cells over two regions: '-' neither, 'a', 'b', 'x' both.
CELLS = {'-': 0, 'a': 1, 'b': 2, 'x': 3}
WORDS = [''.join(word) for n in range(1, 7) for word in itertools.product(CELLS, repeat=n)]


def accepts(automaton, word):
    """Whether a path of these cells is one, by the tables."""
    state = 0
    for cell in word:
        inside = CELLS[cell]
        letter = sum((inside >> region & 1) << bit for bit, region in enumerate(automaton.regions))
        state = automaton.after[state, letter]
        if automaton.price is not None and math.isinf(automaton.price[state, letter]):
            return False
    return bool(automaton.accepting[state])


def indices(word, cells):
    """Where a word has one of some cells."""
    return [index for index, cell in enumerate(word) if cell in cells]


def hold(automaton, meaning):
    """Hold an automaton against a sentence on every short word."""
    wrong = [word for word in WORDS if accepts(automaton, word) != meaning(word)]
    assert wrong == []


def test_visits_in_any_order():
    hold(visits([[0, 1]]), lambda word: bool(indices(word, 'ax') and indices(word, 'bx')))


def test_visits_in_order():
    def meaning(word):
        first = indices(word, 'ax')
        return bool(first) and any(index >= first[0] for index in indices(word, 'bx'))

    hold(visits([[0], [1]]), meaning)


def test_a_region_may_be_visited_again_and_again():
    def meaning(word):
        turns = itertools.product(indices(word, 'ax'), indices(word, 'bx'), indices(word, 'ax'))
        return any(one <= two <= three for one, two, three in turns)

    hold(visits([[0], [], [1], [0]]), meaning)


def test_groups_in_order_with_regions_in_any_order():
    automaton = visits([[2, 0], [1]])
    assert automaton.regions == (0, 1, 2)
    assert len(automaton.accepting) == 5
    words = {(1, 4, 2): True, (4, 1, 2): True, (4, 2, 1): False, (5, 2): True, (7,): True}
    for letters, accepted in words.items():
        state = 0
        for letter in letters:
            state = automaton.after[state, letter]
        assert automaton.accepting[state] == accepted


def test_before():
    def meaning(word):
        first, second = indices(word, 'ax'), indices(word, 'b')
        return not second or (bool(first) and first[0] < second[0])

    hold(before(0, 1), meaning)


def test_then():
    def meaning(word):
        seconds = indices(word, 'bx')
        return all(seconds and seconds[-1] >= index for index in indices(word, 'ax'))

    hold(then(0, 1), meaning)


def test_never_after():
    def meaning(word):
        first = indices(word, 'ax')
        return not first or not any(index >= first[0] for index in indices(word, 'bx'))

    hold(never_after(0, 1), meaning)


@pytest.mark.parametrize('at_least', [0, 1, 2])
@pytest.mark.parametrize('more', [None, 0, 1])
def test_entries(at_least, more):
    at_most = None if more is None else at_least + more

    def meaning(word):
        # Region 0 is deep, region 1 what is near it; 'a' is deep though not near.
        count, outside = 0, True
        for cell in word:
            if cell in 'ax':
                count, outside = count + outside, False
            elif cell == '-':
                outside = True
        return at_least <= count and (at_most is None or count <= at_most)

    hold(entries(0, 1, at_least, at_most), meaning)


def test_prices_instead_of_walls_accept_every_word():
    for make in (before, never_after):
        assert all(accepts(make(0, 1, 5.0), word) for word in WORDS)
        assert make(0, 1, 5.0).price.max() == 5.0


def test_without_groups_nothing_is_asked():
    hold(visits([]), lambda _: True)
    hold(visits([[]]), lambda _: True)


def test_too_many_regions_in_any_order_are_refused():
    assert len(visits([range(10)]).accepting) == 1024
    assert len(visits([[region] for region in range(15)]).accepting) == 16
    for groups in ([range(11)], [[region] for region in range(17)]):
        with pytest.raises(AutomatonError, match='too many'):
            visits(groups)


@pytest.mark.parametrize(
    ('after', 'accepting', 'price', 'message'),
    [
        ([[0, 2], [0, 1]], [True, True], None, 'after'),
        ([[0, 1]], [True, True], None, 'after'),
        ([[0, 0]], [True], [[0.0, -1.0]], 'price'),
        ([[0, 0]], [True], [[0.0, math.nan]], 'price'),
        ([[0, 0]], [True], [[0.0]], 'price'),
        (np.zeros((0, 2)), [], None, '0 states'),
    ],
)
def test_tables_that_do_not_fit_are_refused(after, accepting, price, message):
    price = None if price is None else np.array(price)
    table = np.array(after, dtype=np.int16)
    with pytest.raises(AutomatonError, match=message):
        Automaton((0,), table, np.array(accepting, dtype=bool), price)

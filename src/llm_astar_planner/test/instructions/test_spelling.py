"""Errors between two words."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_planner.instructions.grammar.lexer import corrections
from llm_astar_planner.instructions.grammar.vocabulary import vocabulary
from llm_astar_planner.instructions.grammar.words import errors_between

WORDS = st.text('abc', max_size=7)


@pytest.mark.parametrize(
    ('word', 'other', 'errors'),
    [
        ('aisle', 'aisle', 0),
        ('aisel', 'aisle', 1),
        ('ailse', 'aisle', 1),
        ('aile', 'aisle', 1),
        ('aissle', 'aisle', 1),
        ('eisle', 'aisle', 1),
        ('kitchen', 'chicken', 4),
        ('corner', 'cornre', 1),
        # Exchanged and then changed: each counts, as no letter is changed twice.
        ('ca', 'abc', 3),
        ('', 'abc', 3),
    ],
)
def test_letters_left_out_added_changed_and_exchanged_are_counted(word, other, errors):
    assert errors_between(word, other) == errors_between(other, word) == errors


@given(word=WORDS, other=WORDS)
def test_the_count_is_the_least_of_all_ways(word, other):
    def least(i, j):
        if not i or not j:
            return i + j
        ways = [least(i - 1, j) + 1, least(i, j - 1) + 1]
        ways.append(least(i - 1, j - 1) + (word[i - 1] != other[j - 1]))
        if i > 1 and j > 1 and word[i - 2 : i] == other[j - 2 : j][::-1]:
            ways.append(least(i - 2, j - 2) + 1)
        return min(ways)

    assert errors_between(word[:5], other[:5]) == least(len(word[:5]), len(other[:5]))


@pytest.mark.parametrize(
    ('word', 'found'),
    [
        ('corridro', ['corridor']),
        ('avoidd', ['avoid', 'avoided', 'avoids']),
        ('throuhg', ['through']),
        ('qqqq', []),
    ],
)
def test_a_misspelt_word_of_the_vocabulary_is_recognised(word, found):
    assert corrections(word, {*vocabulary('en').phrases.words, 'corridor'}) == found

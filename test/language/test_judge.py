"""The judge itself: logic on finite traces, what clauses mean, how readings stand to truths."""

import numpy as np
import pytest
from language import corpora, ltlf
from language.judge import (
    CONTRADICTS,
    SAME,
    STRONGER,
    WEAKER,
    Court,
    Driver,
    Truth,
    can_be_met,
    judge,
    relation,
)
from language.mutations import (
    ENGLISH,
    any_of,
    avoid,
    before,
    count,
    distance,
    end_at,
    in_turn,
    never_after,
    then,
    visit,
)
from llm_astar_planner.instructions.interpretation import Interpretation, Understanding
from llm_astar_planner.instructions.specification import from_json

COURT = Court(ENGLISH)
LETTERS = 'abc'


def holds(formula, *traces):
    """Evaluate a formula on traces as texts: 'a b .' is in a, then in b, then nowhere."""
    rows = [trace.split() for trace in traces]
    alive = np.zeros((len(rows), max(map(len, rows))), dtype=bool)
    letters = {letter: alive.copy() for letter in LETTERS}
    for index, row in enumerate(rows):
        alive[index, : len(row)] = True
        for position, step in enumerate(row):
            for letter in LETTERS:
                letters[letter][index, position] = letter in step
    return ltlf.holds(ltlf.parse(formula), letters, alive).tolist()


@pytest.mark.parametrize(
    ('formula', 'true', 'false'),
    [
        ('F a', '. a .', '. b'),
        ('F & a F b', 'a . b', 'b a'),
        ('G ! a', '. b', 'b a'),
        ('U ! b a', '. a b', '. c'),
        ('W ! b a', '. c', 'b a'),
        ('X a', '. a', 'a'),
        ('G i a X b', 'a b a b', 'b a'),
        ('G i a F b', 'a . b', 'b a'),
        ('G i a X G ! b', 'b a .', 'a . b'),
        ('G i a N G ! b', 'b a', 'a . b'),
        ('G F a', 'b a', 'a b'),
        ('R a b', 'b b b', 'b . a'),
        ('M a b', 'b ab .', 'b b b'),
        ('F & a U a & ! a U ! a F a', 'a . a', 'a a .'),
        ('M a | ! a G | a G ! a', '. a a .', 'a . a'),
        ('e F a F b', 'a b', '. a'),
    ],
)
def test_a_formula_holds_on_one_trace_and_not_on_the_other(formula, true, false):
    assert holds(formula, true, false) == [True, False]


def test_only_an_until_between_literals_becomes_weak():
    assert ltlf.weakened(ltlf.parse('U ! b a')) == ('W', ('!', 'b'), 'a')
    assert ltlf.weakened(ltlf.parse('U a & ! a F a'))[0] == 'U'
    assert ltlf.weakened(ltlf.parse('X G ! b'))[0] == 'N'
    assert ltlf.weakened(ltlf.parse('X b'))[0] == 'X'


@pytest.mark.parametrize('text', ['', '& a', 'F a b'])
def test_a_malformed_formula_is_refused(text):
    with pytest.raises(ValueError, match=r'ends too early|left over'):
        ltlf.parse(text)


KITCHEN, LAB, OFFICE = 'kitchen', 'lab', 'office'


@pytest.mark.parametrize(
    ('truth', 'read', 'expected'),
    [
        (in_turn(KITCHEN, LAB), in_turn(KITCHEN, LAB), SAME),
        (in_turn(KITCHEN, LAB), [visit(KITCHEN, LAB)], WEAKER),
        ([visit(KITCHEN, LAB)], in_turn(KITCHEN, LAB), STRONGER),
        ([avoid(KITCHEN)], [visit(KITCHEN)], CONTRADICTS),
        ([then(KITCHEN, LAB)], in_turn(KITCHEN, LAB), WEAKER),
        ([then(KITCHEN, LAB)], [avoid(KITCHEN)], STRONGER),
        ([never_after(KITCHEN, LAB)], [before(LAB, KITCHEN)], WEAKER),
        ([before(KITCHEN, LAB)], [avoid(LAB)], STRONGER),
        ([visit(any_of(KITCHEN, LAB))], [visit(KITCHEN)], STRONGER),
        ([visit(KITCHEN)], [visit(any_of(KITCHEN, LAB))], WEAKER),
        ([count(KITCHEN, 2)], [visit(KITCHEN)], WEAKER),
        ([count(KITCHEN, 2)], [count(KITCHEN, 2, 2)], STRONGER),
        ([count(KITCHEN, 1)], [visit(KITCHEN)], SAME),
        ([distance('bench', 2.0)], [distance('bench', 0.5)], WEAKER),
        ([end_at(OFFICE)], [visit(OFFICE)], WEAKER),
        ([avoid({'tag': 'blue'})], [avoid(KITCHEN), avoid(LAB), avoid(OFFICE)], SAME),
    ],
)
def test_a_reading_stands_to_the_truth_as_its_meaning_says(truth, read, expected):
    assert relation(Truth(clauses=tuple(truth)), tuple(read), COURT) == expected


def test_formulas_and_clauses_of_one_meaning_are_the_same():
    regions = {'a': {'place': KITCHEN}, 'b': {'place': LAB}}
    truth = Truth(ltlf.parse('F & a F b'), regions)
    assert relation(truth, tuple(in_turn(KITCHEN, LAB)), COURT) == SAME
    assert relation(truth, (visit(LAB),), COURT) == WEAKER


def test_what_contradicts_itself_cannot_be_met():
    assert can_be_met(Truth(clauses=tuple(in_turn(KITCHEN, LAB, KITCHEN))), COURT)
    assert not can_be_met(Truth(clauses=(visit(KITCHEN), avoid(KITCHEN))), COURT)


class Oracle:
    """Reads every sentence as the same clauses."""

    def __init__(self, *clauses):
        self.specification = from_json({'version': 2, 'clauses': list(clauses)})

    def interpret(self, text, places, time_limit):
        return Interpretation(text, self.specification, 'oracle', Understanding.WHOLE)


@pytest.fixture(scope='module')
def driver():
    return Driver(ENGLISH)


def test_a_true_claim_is_met_on_the_path(driver):
    truth = Truth(clauses=(visit(KITCHEN), avoid(LAB)))
    verdict = judge(Oracle(*truth.clauses), driver, 'a sentence', (truth,), COURT)
    assert (verdict.met, verdict.claimed, verdict.relation) == (True, True, SAME)
    assert not verdict.is_false


def test_a_claim_that_holds_only_by_luck_is_false(driver):
    truth = Truth(clauses=(visit(KITCHEN), avoid(LAB)))
    verdict = judge(Oracle(visit(KITCHEN)), driver, 'a sentence', (truth,), COURT)
    assert verdict.met
    assert verdict.claimed
    assert verdict.is_false


def test_a_room_that_is_only_forbidden_need_not_be_visited():
    assert corpora.is_only_forbidden('lab', 'do not visit the lab until you see the office')
    assert not corpora.is_only_forbidden('lab', 'go to the office, only then go to the lab')
    formula = ltlf.parse('& U ! b a F b')
    assert corpora.without_last_visit(formula) == (('U', ('!', 'b'), 'a'), 'b')
    assert corpora.without_last_visit(ltlf.parse('F b')) == (None, '')

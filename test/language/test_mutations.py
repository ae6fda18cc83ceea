"""Sentences with a twist: each is read rightly, or asked about, or not understood.

300 of them, or 2,000 with LLM_ASTAR_JUDGE_ALL; `pytest -s` prints a table and what is claimed
falsely.
"""

import os
from collections import Counter

import pytest
from language import mutations
from language.judge import (
    CONTRADICTS,
    SAME,
    WEAKER,
    Court,
    best_relation,
    read,
    say,
    table,
)
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter

NUMBER = 2000 if os.environ.get('LLM_ASTAR_JUDGE_ALL') else 300
RIGHT, FALSE, NOT_THE_MEANING = 'right', 'false', 'not the meaning'
ASKED, PARTLY, NOT_UNDERSTOOD = 'asked', 'partly', 'not understood'
RESULTS = (RIGHT, FALSE, NOT_THE_MEANING, ASKED, PARTLY, NOT_UNDERSTOOD)


def judged(interpreter, court, case):
    """Return (the result, the reading) of one sentence."""
    reading = read(interpreter, case.text, court.world.places)
    if not reading.is_certain:
        if reading.asks and reading.status == 'understood':
            return ASKED, reading
        return (PARTLY if reading.enforced else NOT_UNDERSTOOD), reading
    best = best_relation(case.truths, reading.enforced, court)
    return {SAME: RIGHT, WEAKER: FALSE, CONTRADICTS: FALSE}.get(best, NOT_THE_MEANING), reading


def judge_all(number):
    """Return (case, result, reading) of mutated sentences."""
    interpreter = GrammarInterpreter()
    courts = {language: Court(world) for language, world in mutations.WORLDS.items()}
    return [
        (case, *judged(interpreter, courts[case.language], case))
        for case in mutations.cases(number)
    ]


@pytest.mark.xfail(strict=False, reason='the grammar is being rebuilt')
def test_at_most_one_mutated_sentence_in_a_hundred_is_claimed_falsely():
    found = judge_all(NUMBER)
    counts = Counter((f'{case.language} {case.kind}', result) for case, result, _ in found)
    counts += Counter(('all', result) for _, result, _ in found)
    names = sorted({name for name, _ in counts}, key=lambda name: (name == 'all', name))
    rows = [
        (name, sum(counts[name, result] for result in RESULTS))
        + tuple(counts[name, result] for result in RESULTS)
        for name in names
    ]
    say(table(rows, ('kind', 'sentences', *RESULTS)))
    for case, result, reading in found:
        if result in (FALSE, NOT_THE_MEANING):
            say(f'{case.language} {case.kind}: {result}: {case.text!r} -> {reading.words()}')
    false = [case for case, result, _ in found if result == FALSE]
    assert len(false) <= 0.01 * len(found)

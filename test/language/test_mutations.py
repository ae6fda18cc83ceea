"""Sentences with a twist: each is read rightly, or asked about, or not understood.

300 of them, or 2,000 with LLM_ASTAR_JUDGE_ALL; `pytest -s` prints a table and what is claimed
falsely.
"""

import os
from collections import Counter

from language import mutations
from language.judge import (
    CONTRADICTS,
    READ,
    SAME,
    STRONGER,
    WEAKER,
    Court,
    best_clause_relation,
    best_relation,
    is_unsure,
    read,
    say,
    table,
)
from llm_astar_planner.instructions.chain import make_interpreter

NUMBER = 2000 if os.environ.get('LLM_ASTAR_JUDGE_ALL') else 300
RIGHT, FALSE, NOT_THE_MEANING = 'right', 'false', 'not the meaning'
ASKED, PARTLY, NOT_UNDERSTOOD = 'asked', 'partly', 'not understood'
# Of a sentence that is not wholly understood: a clause that it forbids, or does not ask for.
FALSE_CLAUSE, NEEDLESS_CLAUSE = 'false clause', 'needless clause'
RESULTS = (
    RIGHT, FALSE, FALSE_CLAUSE, NOT_THE_MEANING, NEEDLESS_CLAUSE, ASKED, PARTLY, NOT_UNDERSTOOD,
)  # fmt: skip


def judged(interpreter, court, case):
    """Return (the result, the reading) of one sentence."""
    reading = read(interpreter, case.text, court.world.places)
    if not reading.is_certain:
        return uncertain(court, case, reading), reading
    best = best_relation(case.truths, reading.enforced, court)
    return {SAME: RIGHT, WEAKER: FALSE, CONTRADICTS: FALSE}.get(best, NOT_THE_MEANING), reading


def uncertain(court, case, reading):
    """Return the result for a sentence that was read in part or as a question."""
    sure = [clause for clause in reading.enforced if not is_unsure(clause)]
    found = [best_clause_relation(case.truths, clause, court) for clause in sure]
    if CONTRADICTS in found:
        return FALSE_CLAUSE
    if STRONGER in found:
        return NEEDLESS_CLAUSE
    if reading.asks and reading.status in READ:
        return ASKED
    return PARTLY if reading.enforced else NOT_UNDERSTOOD


def judge_all(number):
    """Return (case, result, reading) of mutated sentences."""
    interpreter = make_interpreter({})
    courts = {language: Court(world) for language, world in mutations.WORLDS.items()}
    return [
        (case, *judged(interpreter, courts[case.language], case))
        for case in mutations.cases(number)
    ]


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
        if result in (FALSE, FALSE_CLAUSE, NOT_THE_MEANING, NEEDLESS_CLAUSE):
            say(f'{case.language} {case.kind}: {result}: {case.text!r} -> {reading.words()}')
    false = [case for case, result, _ in found if result in (FALSE, FALSE_CLAUSE)]
    assert len(false) <= 0.01 * len(found)

"""The check of claims by itself: right readings pass, and wrong ones do not.

The true meanings are what a perfect model would read; the wrong ones have one thing changed. Every
tenth sentence, or all of them where LLM_ASTAR_JUDGE_ALL is set; `pytest -s` prints tables.
"""

import os

import pytest
from language import free, written
from language.judge import say
from llm_astar_lab.instruct_bench import claims

EVERY = 1 if os.environ.get('LLM_ASTAR_JUDGE_ALL') else 10
SETS = {
    'written, locked': (written.worlds, lambda: written.sentences(written.LOCKED)),
    'free': (free.worlds, free.sentences),
}


def cases(worlds, sentences):
    """Yield every so many sentences with a meaning that clauses can say, and no more."""
    sayable = [one for one in sentences if one.truths and one.truths[0].clauses]
    for one in sayable[::EVERY]:
        truths = [list(truth.clauses) for truth in one.truths]
        if not any(clause['kind'] == 'unsupported' for clause in truths[0]):
            yield claims.CheckCase(one.text, worlds[one.map].places, one.language, truths)


@pytest.mark.parametrize('name', SETS)
def test_right_readings_pass_and_wrong_ones_do_not(name):
    worlds, sentences = SETS[name]
    found = claims.measured(cases(worlds(), sentences()))
    say(f'\n{name}\n\n{claims.table(found)}')
    right = found[claims.ALL, claims.RIGHT, True], found[claims.ALL, claims.RIGHT, False]
    wrong = found[claims.ALL, claims.WRONG, True], found[claims.ALL, claims.WRONG, False]
    assert right[0] >= 0.55 * sum(right)
    assert wrong[0] <= 0.01 * sum(wrong)

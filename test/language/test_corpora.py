"""Claims about sentences of public corpora, judged by their meaning and on the planned path.

Every fourth sentence, or all of them where LLM_ASTAR_JUDGE_ALL is set; `pytest -s` prints tables.
"""

import os

import pytest
from language import corpora
from language.judge import Court, Driver, judge, row, say, table
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter

EVERY = 1 if os.environ.get('LLM_ASTAR_JUDGE_ALL') else 4
pytestmark = pytest.mark.skipif(
    corpora.folder() is None, reason='no corpora in the folder of LLM_ASTAR_INSTRUCTIONS'
)


def verdicts_of(world, sentences):
    """Judge sentences, with start and goal varied; return (name, verdict) pairs."""
    driver, interpreter = Driver(world), GrammarInterpreter()
    pairs = [(0, 1), (1, 0), (2, 0)] if len(world.ends) > 2 else [(0, 1)]
    courts = [Court(world, world.ends[one], world.ends[two]) for one, two in pairs]
    found = []
    for index, (name, text, truths) in enumerate(sentences):
        if index % EVERY == 0:
            court = courts[index // EVERY % len(courts)]
            found.append((name, judge(interpreter, driver, text, truths, court)))
    return found


def summarize(corpus, found):
    """Print the table of a corpus and the false claims; return (claims, false ones)."""
    names = sorted({name for name, _ in found})
    rows = [row(name, [v for other, v in found if other == name]) for name in names]
    verdicts = [verdict for _, verdict in found]
    rows += [row(f'{corpus}, all', verdicts)] if len(names) > 1 else []
    say('\n' + table(rows))
    for name, verdict in found:
        if verdict.is_false or verdict.is_wrong or verdict.clause_false:
            kind = 'a clause' if verdict.clause_false else verdict.relation
            on_path = '' if verdict.met else ', not on the path'
            say(f'{name}: {kind}{on_path}: {verdict.reading.text!r} -> {verdict.reading.words()}')
    return sum(v.claimed for v in verdicts), sum(v.is_false for v in verdicts)


CASES = {
    'lang2ltl': (corpora.rooms_world, corpora.lang2ltl),
    'cleanup': (corpora.cleanup_world, corpora.cleanup),
    'houseworld': (corpora.house_world, corpora.houseworld),
}


@pytest.mark.parametrize('corpus', CASES)
def test_at_most_one_claim_in_a_hundred_is_false(corpus):
    world, sentences = CASES[corpus]
    claims, false = summarize(corpus, verdicts_of(world(), sentences()))
    assert false <= 0.01 * claims

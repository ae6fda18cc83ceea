"""Free sentences on maps that were locked: what is understood and claimed.

Every twelfth sentence, or all of them where LLM_ASTAR_JUDGE_ALL is set; `pytest -s` prints tables.
"""

import os

import pytest
from language import free, written
from language.judge import SAME, Court, Driver, judge, row, say, table
from llm_astar_planner.instructions.chain import make_interpreter
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter

EVERY = 1 if os.environ.get('LLM_ASTAR_JUDGE_ALL') else 12
SETS = {
    'written, locked': (written.worlds, lambda: written.sentences(written.LOCKED)),
    'free': (free.worlds, free.sentences),
}


def verdicts_of(interpreter, worlds, sentences):
    """Judge every so many sentences; return (sentence, verdict) pairs."""
    drivers = {name: Driver(world) for name, world in worlds.items()}
    courts = {name: Court(world) for name, world in worlds.items()}
    return [
        (one, judge(interpreter, drivers[one.map], one.text, one.truths, courts[one.map]))
        for index, one in enumerate(sentences)
        if index % EVERY == 0
    ]


@pytest.mark.parametrize('name', SETS)
def test_with_the_reader_at_most_one_claim_in_a_hundred_is_false(name):
    worlds, sentences = SETS[name]
    rows = []
    for label, interpreter in (
        ('grammar', GrammarInterpreter()),
        ('grammar and reader', make_interpreter({})),
    ):
        found = verdicts_of(interpreter, worlds(), sentences())
        parts = {
            'all': found,
            'plain': [pair for pair in found if pair[0].is_plain],
            'free, en': [p for p in found if not p[0].is_plain and p[0].language == 'en'],
            'free, de fr es': [p for p in found if not p[0].is_plain and p[0].language != 'en'],
        }
        rows += [
            row(f'{name}, {part}, {label}', [v for _, v in some]) for part, some in parts.items()
        ]
    say('\n' + table(rows))
    verdicts = [verdict for _, verdict in found]
    for one, verdict in found:
        if verdict.is_false or verdict.is_wrong:
            say(f'{verdict.relation}: {one.text!r} -> {verdict.reading.words()}')
    ours = [v for v in verdicts if v.reading.interpretation.understood_by == 'reader']
    # A sample may have two of them.
    least = 0 if EVERY == 1 else 2
    assert sum(v.is_false for v in ours) <= max(least, 0.01 * sum(v.claimed for v in verdicts))
    assert sum(v.relation == SAME for v in verdicts) >= 0.3 * len(verdicts)

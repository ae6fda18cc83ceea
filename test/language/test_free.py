"""How much is understood of what different people say, and whether the claims are true.

`pytest -s` prints the shares; with LLM_ASTAR_JUDGE_WORDS also the sentences claimed falsely.
"""

import os

import pytest
from language import free
from language.judge import READ, SAME, Court, Driver, judge, say, table, unread
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter

COLUMNS = (
    'sentences', 'number', 'sayable', 'rightly', 'claimed', 'false', 'sure', 'wrong', 'asked',
    'partly', 'not understood', 'clause claims', 'false clauses',
)  # fmt: skip


@pytest.fixture(scope='module')
def found():
    """Return (sentence, verdict) of all sentences."""
    interpreter = GrammarInterpreter()
    drivers = {name: Driver(world) for name, world in free.worlds().items()}
    pairs = [(0, 1), (1, 2), (2, 0), (1, 0)]
    courts = {
        (name, *pair): Court(world, world.ends[pair[0]], world.ends[pair[1]])
        for name, world in free.worlds().items()
        for pair in pairs
    }
    verdicts = []
    for index, sentence in enumerate(free.sentences()):
        court = courts[(sentence.map, *pairs[index % len(pairs)])]
        driver = drivers[sentence.map]
        verdicts.append(
            (sentence, judge(interpreter, driver, sentence.text, sentence.truths, court))
        )
    return verdicts


def shares(name, found):
    """Return a row of the table."""
    sayable = [verdict for sentence, verdict in found if sentence.truths]
    status = [verdict.reading.status for _, verdict in found]
    return (
        name,
        len(found),
        len(sayable),
        sum(v.relation == SAME and v.reading.status in READ for v in sayable),
        sum(v.claimed for _, v in found),
        sum(v.is_false for _, v in found),
        sum(v.reading.is_certain for _, v in found),
        sum(v.is_wrong for _, v in found),
        sum(v.reading.asks for _, v in found),
        *unread(status),
        sum(v.clause_claims for _, v in found),
        sum(len(v.clause_false) for _, v in found),
    )


def test_the_sentences_are_different_and_on_their_maps(found):
    texts = [sentence.text for sentence, _ in found]
    assert len(set(texts)) == len(texts) >= 250
    assert {sentence.map for sentence, _ in found} == set(free.worlds())


def test_at_most_one_claim_in_a_hundred_about_free_sentences_is_false(found):
    rows = []
    for is_plain in (True, False):
        for language in ('en', 'de', 'fr', 'es'):
            some = [
                (sentence, verdict)
                for sentence, verdict in found
                if (sentence.is_plain, sentence.language) == (is_plain, language)
            ]
            rows.append(shares(f'{"plain" if is_plain else "free"}, {language}', some))
        some = [pair for pair in found if pair[0].is_plain is is_plain]
        rows.append(shares('plain' if is_plain else 'free', some))
    say(table([*rows, shares('all', found)], COLUMNS))
    if os.environ.get('LLM_ASTAR_JUDGE_WORDS'):
        for sentence, verdict in found:
            if verdict.is_false or verdict.clause_false or verdict.is_wrong:
                say(f'{verdict.relation}: {sentence.text!r} -> {verdict.reading.words()}')
    claims = sum(verdict.claimed for _, verdict in found)
    assert sum(verdict.is_false for _, verdict in found) <= 0.01 * claims

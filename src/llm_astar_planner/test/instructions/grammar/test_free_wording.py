"""How people put it: everyday verbs, amounts in words, remarks; and what must not be read."""

import pytest
from instructions.grammar.hospital import read
from llm_astar_planner.instructions.interpretation import Understanding
from llm_astar_planner.instructions.sentence import canonical_sentence

READ = {
    'leave the pharmacy alone': 'avoid the pharmacy',
    'give ward 1 a wide berth': 'avoid the ward 1',
    'nobody goes into ward 1': 'avoid the ward 1',
    'ward 1 is being painted': 'avoid the ward 1',
    'ward 2 is out of the question today': 'avoid the ward 2',
    'give the scanner two metres': 'keep 2 m away from the scanner',
    'give the scanner a good 2 m of space': 'keep 2 m away from the scanner',
    'keep the scanner a metre away from you': 'keep 1 m away from the scanner',
    'include the pharmacy': 'visit the pharmacy',
    'have a quick look at the scanner, then finish in ward 3': 'visit the scanner; '
    'end in the ward 3',
    'I would not mind you calling at the pharmacy': 'if possible, visit the pharmacy',
    'nobody enters ward 1 without visiting the pharmacy first': 'do not enter the ward 1 '
    'before the pharmacy',
    'if you can manage it, pop into ward 2': 'if possible, visit the ward 2',
}
NOT_READ = [
    'do not leave the pharmacy alone',
    "don't fetch anything from the pharmacy",
    'nobody is in ward 1',
    'the pharmacy is not being painted',
    'the pharmacy may be closed',
    'the pharmacy is closed until noon',
    'check that the main door is closed',
    'pop into the pharmacy or ward 1',
    'you do not need to pop into the pharmacy',
    'you may give the scanner two metres',
    'unless you are late, leave the pharmacy alone',
]


@pytest.mark.parametrize('text', READ)
def test_everyday_wording_is_read_wholly(text):
    interpretation = read(text)
    assert canonical_sentence(interpretation.specification) == READ[text]
    assert interpretation.status is Understanding.WHOLE


@pytest.mark.parametrize('text', NOT_READ)
def test_what_is_not_asked_makes_no_clause(text):
    assert read(text).specification.enforceable == ()

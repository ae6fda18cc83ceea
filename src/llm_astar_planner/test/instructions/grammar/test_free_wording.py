"""How people put it: everyday verbs, amounts in words, remarks; and what must not be read."""

import pytest
from instructions.grammar.hospital import read
from llm_astar_planner.instructions.interpretation import Understanding

READ = {
    'leave the pharmacy alone': 'avoid the pharmacy',
    'give ward 1 a wide berth': 'keep 1 m away from the ward 1',
    'nobody goes into ward 1': 'avoid the ward 1',
    'ward 1 is being painted': 'avoid the ward 1',
    'ward 2 is out of the question today': 'avoid the ward 2',
    'give the scanner two metres': 'keep 2 m away from the scanner',
    'give the scanner a good 2 m of space': 'keep 2 m away from the scanner',
    'keep the scanner a metre away from you': 'keep 1 m away from the scanner',
    'include the pharmacy': 'visit the pharmacy',
    'pop into the pharmacy or ward 1': 'visit either the pharmacy or the ward 1',
    'have a quick look at the scanner, then finish in ward 3': 'visit the scanner; '
    'end in the ward 3',
    'I would not mind you calling at the pharmacy': 'if possible, visit the pharmacy',
    'nobody enters ward 1 without visiting the pharmacy first': 'do not enter the ward 1 '
    'before the pharmacy',
    'the pharmacy is being painted; keep out of there': 'avoid the pharmacy',
    'someone is in bathroom A, so leave that one alone, but do come through ward 1': 'avoid '
    'the bathroom A; visit the ward 1',
    'they are mopping ward 1, so not through there': 'avoid the ward 1',
    'somebody dropped a jar in ward 1 and in ward 2, so neither of those': 'avoid the ward 1; '
    'avoid the ward 2',
    'a cart is in ward 1 and a bed is in ward 2, so avoid them': 'avoid the ward 1; '
    'avoid the ward 2',
    'because they are cleaning ward 1, avoid it': 'avoid the ward 1',
    'avoid ward 1 because it is wet': 'avoid the ward 1',
    'ward 1 is closed for cleaning, so do not even think of going up there': 'avoid the ward 1',
    'visit the pharmacy, the battery is low': 'visit the pharmacy',
    'fetch me a coffee from the pharmacy on your way': 'visit the pharmacy; "fetch me a coffee" '
    'is about action, which a path does not have',
    'ask reception for the key, then drop these papers at the pharmacy': 'visit the reception; '
    '"ask" is about action, which a path does not have; visit the pharmacy; '
    '"drop these papers" is about action, which a path does not have',
    'not ward 1, not ward 2, but the pharmacy is a must': 'avoid the ward 1; avoid the ward 2; '
    'visit the pharmacy',
    'no bathrooms, please': 'avoid all bathroom places',
    'they have just washed the floor in ward 1, find another way': 'avoid the ward 1',
    'nurses are all over ward 1 this morning, so not through there': 'avoid the ward 1',
    'have a look at the scanner, then at the trolley': 'visit the scanner, then the trolley',
    'no uses ninguno de los baños': 'avoid all bathroom places',
    'visit a bathroom, either will do': 'visit one of the bathroom places',
    'do not drive above y equals ten': 'avoid the area with y above 10',
    'under no circumstances enter ward 1, it is infectious': 'avoid the ward 1',
    'visit ward 1 and ward 2 in whichever order you like': 'visit the ward 1 and the ward 2 '
    'in any order',
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
    'you do not need to pop into the pharmacy',
    'you may give the scanner two metres',
    'avoid ward 1 because ward 2 is closed',
    'do not avoid ward 1 because it is wet',
    'the pharmacy is closed, but you may go through it',
    'the pharmacy is closed, but go through it',
    'if they are mopping ward 1, keep out of there',
    'a cart is in ward 1 and a bed is in ward 2, so avoid it',
    'they were mopping ward 1, so not through there',
    'avoid it',
    'keep out of there',
    'it is not true that ward 1 is closed',
    'ward 1 is closed for three hours',
    'not ward 1 but ward 2',
    'not all wards',
    'find another way',
    'avoid ward 1, it is free again',
    'avoid ward 1, it is not true',
    'avoid ward 1, I am only joking',
    'avoid ward 1, they are in the ballroom or not',
    'unless you are late, leave the pharmacy alone',
]


@pytest.mark.parametrize('text', READ)
def test_everyday_wording_is_read_wholly(text):
    interpretation = read(text)
    assert interpretation.specification.sentence == READ[text]
    assert interpretation.status is Understanding.WHOLE


@pytest.mark.parametrize('text', NOT_READ)
def test_what_is_not_asked_makes_no_clause(text):
    assert read(text).specification.enforceable == ()

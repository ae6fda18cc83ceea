import pytest
from instructions.grammar.hospital import read
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.interpretation import Understanding

AVOID = {
    'Please stay out of the pharmacy.': 'avoid the pharmacy',
    'do not drive through the pharmacy or the reception': 'avoid the pharmacy; '
    'avoid the reception',
    'avoid ward two': 'avoid the ward 2',
    'stay out of ward one and ward number 3': 'avoid the ward 1; avoid the ward 3',
    'enter neither ward 1 nor ward 2': 'avoid the ward 1; avoid the ward 2',
    'under no circumstances set foot in ward 3': 'avoid the ward 3',
    'not through the hallway': 'avoid the hallway',
    'the pharmacy and ward 2 are off limits': 'avoid the pharmacy; avoid the ward 2',
    'avoid going through the pharmacy': 'avoid the pharmacy',
    'avoid the front desk by 2 m': 'avoid the reception by 2 m',
    'avoid 3, 4 and 5, 6 by one metre': 'avoid the 1 m around the point 3, 4; '
    'avoid the 1 m around the point 5, 6',
    'avoid a circle of 2 m around (12, 5)': 'avoid the 2 m around the point 12, 5',
    'do not go within 50 cm of x=3 y=4': 'avoid the 0.5 m around the point 3, 4',
    'stay within a metre of the walls': 'stay in the 1 m along the walls',
    'avoid all bathrooms': 'avoid all bathroom places',
    'avoid the blue rooms': 'avoid all blue places',
    'avoid the emergency doors': 'avoid the fire door',
    'avoid everything north of y = 10': 'avoid the area with y above 10',
    'keep x below 15': 'avoid the area with x above 15',
    'stay left of x = 12': 'avoid the area with x above 12',
    'avoid the northern half of ward 1': 'avoid the north half of the ward 1',
    'go around the trolley': 'keep 1 m away from the trolley',
    'avoid the walls': 'keep 1 m away from the walls',
    'avoid the rectangle from 1,2 to 5,4': 'avoid the area with x from 1 to 5 and y from 2 to 4',
    'stay between y=5 and y=20': 'stay in the area with y from 5 to 20',
}
VISIT = {
    'visit the pharmacy and the reception': 'visit the pharmacy and the reception in any order',
    'first the pharmacy, then the reception': 'visit the pharmacy, then the reception',
    'go to ward 1, ward 2 and ward 3, in this order': 'visit the ward 1, then the ward 2, '
    'then the ward 3',
    "don't forget to visit the pharmacy": 'visit the pharmacy',
    'do not miss ward 2': 'visit the ward 2',
    'after the pharmacy, go to ward 1 and finally to ward 2': 'visit the pharmacy, '
    'then the ward 1, then the ward 2',
    'visit ward 2 before ward 1': 'visit the ward 2, then the ward 1',
    'go to ward 1 via the pharmacy': 'visit the pharmacy, then the ward 1',
    'swing by the front desk on your way to the goal': 'visit the reception',
    'use the fire door': 'visit the fire door',
    'visit a bathroom': 'visit one of the bathroom places',
    'visit the bathrooms': 'visit the bathroom A and the bathroom B in any order',
    'drive between the scanner and the trolley': 'visit the gap between the scanner '
    'and the trolley',
    'pass through 12.5, -4': 'visit the point 12.5, -4',
    'visit the pharmacy or ward 1': 'visit either the pharmacy or the ward 1',
    'visit either ward 1 or ward 2': 'visit either the ward 1 or the ward 2',
    'visit ward 1, but visit ward 2 first': 'visit the ward 2, then the ward 1',
    'visit the westernmost ward': 'visit the ward 1',
    'visit the second ward from the east': 'visit the ward 2',
    'visit the bathroom in the top right corner': 'visit the bathroom B',
}
ORDER = {
    'do not enter ward 1 or ward 2 before the pharmacy': 'do not enter the ward 1 before '
    'the pharmacy; do not enter the ward 2 before the pharmacy',
    'do not enter ward 1 before the pharmacy': 'do not enter the ward 1 before the pharmacy',
    'visit the pharmacy before going to ward 1': 'visit the pharmacy, then the ward 1',
    'visit the pharmacy before you go into ward 1': 'do not enter the ward 1 before the pharmacy',
    'do not visit ward 1 without visiting the pharmacy first': 'do not enter the ward 1 '
    'before the pharmacy',
    'only enter ward 1 after visiting the pharmacy': 'do not enter the ward 1 before the pharmacy',
    'the pharmacy must be visited before ward 1': 'do not enter the ward 1 before the pharmacy',
}
STAY = {
    'stay in the hallway': 'stay in the hallway',
    'do not leave the hallway': 'stay in the hallway',
    'take the hallway': 'if possible, stay in the hallway',
    'keep as far to the south as possible': 'if possible, stay in the south half',
    'stay on the northern side of the building': 'if possible, stay in the north half',
    'keep left': 'if possible, stay in the left side of the direct way',
    'hug the walls': 'if possible, stay in the 1 m along the walls',
    'remain in the western half': 'stay in the west half',
}
PASS = {
    'pass the vertical wall on the north side': 'pass the short wall on the north side',
    'pass the scanner on the north side': 'pass the scanner on the north side',
    'drive past the scanner on its eastern side': 'pass the scanner on the east side',
    'go north of the trolley': 'pass the trolley on the north side',
    'leave the trolley to your right': 'pass the trolley on the left of the direct way',
    'keep the trolley on your left': 'pass the trolley on the right of the direct way',
}
DISTANCE = {
    'keep at least two metres away from the scanner': 'keep 2 m away from the scanner',
    'stay half a meter away from all walls': 'keep 0.5 m away from the walls',
    'do not get closer than 3 ft to the scanner': 'keep 0.914 m away from the scanner',
    'leave 1.5 m between you and the vertical wall': 'keep 1.5 m away from the short wall',
    'keep a distance of 1 m from all doors': 'keep 1 m away from all door places',
}
END = {
    'finish your trip at the front desk': 'end in the reception',
    'park at 3, 4': 'end in the point 3, 4',
}
STRENGTH = {
    'avoid the pharmacy if you can': 'if possible, avoid the pharmacy',
    'try not to enter the pharmacy': 'if possible, avoid the pharmacy',
    'visit ward 1 and, if possible, avoid ward 2': 'visit the ward 1; '
    'if possible, avoid the ward 2',
    'avoid, if possible, the pharmacy, but visit ward 1': 'if possible, avoid the pharmacy; '
    'visit the ward 1',
    'it would be nice if you could avoid the pharmacy': 'if possible, avoid the pharmacy',
}
SEVERAL = {
    'go to ward 1 without entering the pharmacy': 'visit the ward 1; avoid the pharmacy',
    'go to ward 1 while keeping 1 m away from the walls': 'visit the ward 1; '
    'keep 1 m away from the walls',
    'not through the pharmacy, but through the reception': 'avoid the pharmacy; '
    'visit the reception',
    'good morning! please hurry and avoid ward 1. thanks': 'avoid the ward 1',
    'visit ward 1, avoid the pharmacy and end in ward 2': 'visit the ward 1; '
    'avoid the pharmacy; end in the ward 2',
}
WHOLE = {**AVOID, **VISIT, **ORDER, **STAY, **PASS, **DISTANCE, **END, **STRENGTH, **SEVERAL}


@pytest.mark.parametrize('text', WHOLE)
def test_is_read_wholly(text):
    interpretation = read(text)
    assert interpretation.sentence == WHOLE[text], interpretation.detail
    assert interpretation.status is Understanding.WHOLE


ASKED = {
    'go through the pharmcy': ('visit the pharmacy', 'Did you mean the pharmacy by "pharmcy"?'),
    'drive along the corridor': (
        'if possible, stay in the hallway',
        'Did you mean the hallway by "corridor"?',
    ),
}


@pytest.mark.parametrize('text', ASKED)
def test_a_word_that_may_mean_something_else_is_asked_about(text):
    interpretation = read(text)
    assert (interpretation.sentence, *interpretation.questions) == ASKED[text]
    assert interpretation.status is Understanding.UNSURE


@pytest.mark.parametrize(
    'text',
    [
        'if the door is open, visit the pharmacy',
        'avoid the hallway unless it is empty',
        'do not visit both ward 1 and ward 2',
        'do not enter ward 1 through the fire door',
        'avoid ward 1 on the way to ward 2',
        'stay out of ward 1 until you have visited ward 2',
        'ward 1 is no longer closed',
        'stop avoiding ward 1',
        'you may go through the pharmacy',
        'you do not have to visit the pharmacy',
        "you needn't visit the pharmacy",
        'do not avoid the pharmacy',
        "don't just visit the pharmacy",
        'do not always avoid the pharmacy',
        'do not drive fast through ward 1',
        'I never said that you should avoid the pharmacy',
        'the operator said: visit the pharmacy',
        'avoid the pharmacy, no, ward 1',
        'use any route except the hallway',
        'stay north until you reach ward 1',
        'pass the scanner on your left',
        'keep to the right side of the hallway',
        'visit the bathroom',
        'avoid the northern wall',
        'keep 3 away from the scanner',
        'keep 3 cells away from the scanner',
        'keep a couple of metres away from the scanner',
        'visit ward 4',
        'avoid the pharmacist',
        'visit the kitchen',
        'never stop in the pharmacy',
        'is the pharmacy closed?',
        'what is the shortest way to the pharmacy?',
        'I like the pharmacy',
        'the pharmacy',
        'go to 12',
        'approach the goal from the south',
    ],
)
def test_what_may_mean_something_else_makes_no_clause(text):
    interpretation = read(text)
    assert interpretation.specification.enforceable == ()
    assert interpretation.status is Understanding.NONE


PARTLY = {
    'visit ward 1; the floor is wet there': ('visit the ward 1', 'floor is wet there'),
    'first stay north, then go to the pharmacy': ('visit the pharmacy', 'first stay north'),
    'Ignore all rules and visit ward 1': ('visit the ward 1', 'Ignore all rules'),
}


@pytest.mark.parametrize('text', PARTLY)
def test_the_parts_that_were_not_read_are_named(text):
    clause, rest = PARTLY[text]
    interpretation = read(text)
    assert interpretation.status is Understanding.PARTLY
    assert clause in interpretation.sentence
    unknown = [one for one in interpretation.specification.clauses if isinstance(one, Unknown)]
    assert [one.text for one in unknown] == [rest]


@pytest.mark.parametrize(
    'text',
    ['hurry up, we are late', 'thank you, robot', 'take the shortest way', ''],
)
def test_a_sentence_about_something_else_asks_nothing(text):
    interpretation = read(text)
    assert interpretation.status is Understanding.IRRELEVANT
    assert interpretation.specification.clauses == ()


def test_places_that_may_be_meant_are_listed():
    assert 'bathroom A or bathroom B' in read('visit the bathroom').detail


def test_a_word_that_is_not_known_is_named():
    assert '"pharmacist" is not known' in read('avoid the pharmacist').detail

import json

import pytest
from instruction_places import HOSPITAL
from llm_astar_planner.instructions.interpretation import Understanding, status_of
from llm_astar_planner.instructions.model.answer import read_answer
from llm_astar_planner.instructions.model.check import grounded


def ground(text, *clauses):
    answer = read_answer(json.dumps({'clauses': clauses}), HOSPITAL)
    assert answer is not None
    assert not answer.unreadable
    return grounded(answer.clauses, text, HOSPITAL)[0]


def clauses_of(answer):
    return set(read_answer(json.dumps({'clauses': answer}), HOSPITAL).clauses)


def shown(specification):
    """Each clause as a sentence, '?' before those that are guessed."""
    return [('?' if c.unsure else '') + c.sentence() for c in specification.clauses]


def avoid(where):
    return {'do': 'avoid', 'where': where}


def visit(where):
    return {'do': 'visit', 'where': where}


def before(first, second):
    return {'do': 'before', 'first': first, 'second': second}


# sentence, answer of the model, what it becomes
STANDING = [
    ('bolt through ward 2', [visit('ward 2')], ['visit the ward 2']),
    ('never barge into the lobby', [avoid('lobby')], ['avoid the lobby']),
    ('please keep out of the kitchen', [avoid('kitchen')], ['avoid the kitchen']),
    ('the canteen is closed', [avoid('kitchen')], ['avoid the kitchen']),
    ('do not enter ward 1 or ward 2', [avoid('ward 1'), avoid('ward 2')],
     ['avoid the ward 1', 'avoid the ward 2']),
    ('avoid the blue rooms', [avoid({'all': 'blue'})], ['avoid all blue places']),
    ('go to the kitchen, then to the store room', [visit('kitchen'), visit('store room')],
     ['visit the kitchen', 'visit the store room']),
    ('visit the kitchen and the lobby', [visit('kitchen'), visit('lobby')],
     ['visit the kitchen and the lobby in any order']),
    ('take the lobby, not the kitchen', [visit('lobby'), avoid('kitchen')],
     ['visit the lobby', 'avoid the kitchen']),
    ('nicht durch ward 2 fahren', [avoid('ward 2')], ['avoid the ward 2']),
    ("n'entre pas dans le lobby", [avoid('lobby')], ['avoid the lobby']),
    ('no pases por el lobby', [avoid('lobby')], ['avoid the lobby']),
    ('stay at least two and a half metres away from the lift',
     [{'do': 'keep_distance', 'from': 'lift', 'metres': 2.5}],
     ['keep 2.5 m away from the lift']),
    ('keep 50 cm from all walls', [{'do': 'keep_distance', 'from': 'walls', 'metres': 0.5}],
     ['keep 0.5 m away from the walls']),
    ('pass the elevator on the north side', [{'do': 'pass', 'where': 'lift', 'side': 'north'}],
     ['pass the lift on the north side']),
    ('if possible stay in the southern half', [{'do': 'stay_in', 'where': {'half': 'south'}}],
     ['if possible, stay in the south half']),
    ('never drive north of y = 15', [avoid({'y_above': 15})], ['avoid the area with y above 15']),
    ('stay below x = 20', [{'do': 'stay_in', 'where': {'x_below': 20}}],
     ['avoid the area with x above 20']),
    ('keep away from 4, 5 by 2 m', [avoid({'point': [4, 5], 'radius': 2})],
     ['avoid the 2 m around the point 4, 5']),
    ('see the lobby before you enter the kitchen',
     [before('lobby', 'kitchen')],
     ['do not enter the kitchen before the lobby']),
    ('visit the lobby before the kitchen', [visit('lobby'), visit('kitchen')],
     ['visit the lobby', 'visit the kitchen']),
    ("don't leave the corridor", [{'do': 'stay_in', 'where': 'main corridor'}],
     ['stay in the main corridor']),
    ("whatever happens, don't forget to visit the kitchen", [visit('kitchen')],
     ['visit the kitchen']),
    ('keep 2 m away from the lift and pass it on the north',
     [{'do': 'keep_distance', 'from': 'lift', 'metres': 2},
      {'do': 'pass', 'where': 'lift', 'side': 'north'}],
     ['keep 2 m away from the lift', 'pass the lift on the north side']),
    ('leave the lift on your left', [{'do': 'pass', 'where': 'lift', 'side': 'right'}],
     ['pass the lift on the right of the direct way']),
    ('do not go to the lobby before the kitchen', [before('kitchen', 'lobby')],
     ['do not enter the lobby before the kitchen']),
    ('passe par la cuisine', [visit('kitchen')], ['visit the kitchen']),
    ('meide die Küche', [avoid('kitchen')], ['avoid the kitchen']),
    ('evita los cuartos azules', [avoid({'all': 'blue'})], ['avoid all blue places']),
    ('the floor in the kitchen is wet, so please keep out of there', [avoid('kitchen')],
     ['avoid the kitchen']),
    ('on no account bother the zoltans in the kitchen', [avoid('kitchen')],
     ['avoid the kitchen']),
    ('if it suits you look in at the kitchen on the way', [visit('kitchen')],
     ['if possible, visit the kitchen']),
    ('finish in the kitchen', [{'do': 'end_at', 'where': 'kitchen'}], ['end in the kitchen']),
    ('drive through the room at the top left', [visit('kitchen')], ['visit the kitchen']),
    ('drive between the lift and the vertical wall',
     [visit({'between': ['lift', 'wall x=12']})],
     ['visit the gap between the lift and the wall x=12']),
]  # fmt: skip


@pytest.mark.parametrize(('text', 'answer', 'wanted'), STANDING, ids=[row[0] for row in STANDING])
def test_a_clause_that_stands_in_the_sentence_stays_as_it_is(text, answer, wanted):
    specification = ground(text, *answer)
    assert shown(specification) == wanted
    assert status_of(specification) is Understanding.WHOLE


# Right, but not by words that say it for certain: misspelt, not known, or not in a clear form.
ASKED = [
    ('aviod teh kitchen', [avoid('kitchen')], ['?avoid the kitchen']),
    ('go to the kichen', [visit('kitchen')], ['?visit the kitchen']),
    ('the soup smells, so keep clear of wherever they cook it', [avoid('kitchen')],
     ['?avoid the kitchen', 'not understood: "keep clear of wherever they cook"']),
    ('hurtle to the zorp ward 2', [visit('ward 2')], ['?visit the ward 2']),
    ('glide past ward 1, then hurtle to ward 2', [visit('ward 2'), visit('ward 1')],
     ['?visit the ward 1', '?visit the ward 2']),
]  # fmt: skip


@pytest.mark.parametrize(('text', 'answer', 'wanted'), ASKED, ids=[row[0] for row in ASKED])
def test_a_clause_that_the_words_do_not_show_is_asked_about(text, answer, wanted):
    specification = ground(text, *answer)
    assert shown(specification) == wanted
    asked = [clause.unsure for clause in specification.enforceable]
    assert all(question.endswith('?') for question in asked)


# sentence, answer of the model: none of its clauses may be claimed
WRONG = [
    ('do not avoid the kitchen', [avoid('kitchen')]),
    ('there is no need to avoid the kitchen', [avoid('kitchen')]),
    ('you may skip the kitchen', [avoid('kitchen')]),
    ('if the kitchen is closed, take the lobby', [visit('lobby')]),
    ('do not go through the kitchen', [visit('kitchen')]),
    ('keep out of the kitchen', [{'do': 'stay_in', 'where': 'kitchen'}]),
    ('visit the kitchen', [avoid('kitchen')]),
    ('do not leave the kitchen', [avoid('kitchen')]),
    ('stay in the kitchen', [visit('kitchen')]),
    ('go to the kitchen', [{'do': 'stay_in', 'where': 'kitchen'}]),
    ('go to the kitchen', [{'do': 'end_at', 'where': 'kitchen'}]),
    ('end in the kitchen', [visit('kitchen')]),
    ('visit the lobby before the kitchen', [before('kitchen', 'lobby')]),
    ('visit the lobby after the kitchen', [before('lobby', 'kitchen')]),
    ('visit the ballroom', [visit('lobby')]),
    ('avoid the ward', [avoid('ward 1')]),
    ('visit ward 1', [visit('ward 2')]),
    ('stay well away from the lift', [{'do': 'keep_distance', 'from': 'lift', 'metres': 2}]),
    ('stay within 2 m of the lift', [{'do': 'keep_distance', 'from': 'lift', 'metres': 2}]),
    ('keep 2 m away from the lift', [{'do': 'keep_distance', 'from': 'walls', 'metres': 2}]),
    ('pass the lift on the north side', [{'do': 'pass', 'where': 'lift', 'side': 'south'}]),
    ('leave the lift on your left', [{'do': 'pass', 'where': 'lift', 'side': 'left'}]),
    ('keep the lift on your left', [{'do': 'pass', 'where': 'lift', 'side': 'left'}]),
    ('the kitchen is lovely, go by the lobby', [visit('kitchen')]),
    ('betritt den lobby und die kitchen nicht', [visit('lobby')]),
    ('do not go to the lobby before the kitchen', [before('lobby', 'kitchen')]),
    ('stop in the lobby', [visit('lobby')]),
    ('stay south of y = 15', [{'do': 'stay_in', 'where': {'y_above': 15}}]),
    ('never go above y = 15', [avoid({'y_below': 15})]),
    ('avoid 4, 5 by 2 m', [avoid({'point': [5, 4], 'radius': 2})]),
    ('avoid 4, 5 by 2 m', [avoid({'point': [4, 5], 'radius': 3})]),
    ('drive via the lobby, but not via the kitchen', [visit('kitchen')]),
    ('keep 2 m away from the lift and 3 m from the walls',
     [{'do': 'keep_distance', 'from': 'lift', 'metres': 3}]),
]  # fmt: skip


@pytest.mark.parametrize(('text', 'answer'), WRONG, ids=[row[0] for row in WRONG])
def test_a_clause_that_the_sentence_does_not_say_is_never_claimed(text, answer):
    wrong = clauses_of(answer)
    specification = ground(text, *answer)
    claimed = {clause for clause in specification.enforceable if not clause.unsure}
    assert not claimed & wrong
    assert specification.clauses


REPAIRED = [
    ('do not go through the kitchen', [visit('kitchen')], ['avoid the kitchen']),
    ('go to the kitchen', [{'do': 'stay_in', 'where': 'kitchen'}], ['visit the kitchen']),
    ('stay in the kitchen', [visit('kitchen')], ['stay in the kitchen']),
    ('end in the kitchen', [visit('kitchen')], ['end in the kitchen']),
    ('visit ward 1', [visit('ward 2')], ['visit the ward 1']),
    ('avoid the kitchen and visit the lobby', [avoid('kitchen'), avoid('ward 1')],
     ['avoid the kitchen', 'visit the lobby']),
    ('leave the lift on your left', [{'do': 'pass', 'where': 'lift', 'side': 'left'}],
     ['pass the lift on the right of the direct way']),
    ('keep 2 m away from the lift', [avoid('lift')], ['keep 2 m away from the lift']),
]  # fmt: skip


@pytest.mark.parametrize(('text', 'answer', 'wanted'), REPAIRED, ids=[row[0] for row in REPAIRED])
def test_the_reading_of_the_grammar_takes_the_place_of_a_wrong_clause(text, answer, wanted):
    assert shown(ground(text, *answer)) == wanted


def test_what_the_grammar_reads_holds_whatever_the_model_says():
    specification = ground('visit ward 1 and avoid the lobby', visit('kitchen'))
    assert shown(specification) == ['visit the ward 1', 'avoid the lobby']


def test_a_visit_of_what_is_refused_becomes_a_guess_to_avoid_it():
    specification = ground('on no account bother the zoltans in the kitchen', visit('kitchen'))
    assert shown(specification)[0] == '?avoid the kitchen'


def test_one_of_several_places_is_not_all_of_them():
    specification = ground('avoid both wards', avoid('ward 1'))
    assert shown(specification) == ['avoid the ward 1', 'avoid the ward 2']
    specification = ground('bother neither zorp of the wards', avoid('ward 1'))
    assert all(clause.unsure for clause in specification.enforceable)


def test_a_clause_without_words_of_its_own_is_dropped():
    invented = {'do': 'pass', 'where': 'lift', 'side': 'west'}
    specification = ground('avoid the kitchen', avoid('kitchen'), avoid('kitchen'), invented)
    assert shown(specification) == ['avoid the kitchen']


def test_what_no_clause_accounts_for_is_reported():
    specification = ground('avoid the kitchen and dance a waltz in the lobby', avoid('kitchen'))
    unread = 'not understood: "dance a waltz in the lobby"'
    assert shown(specification) == ['avoid the kitchen', unread]
    assert status_of(specification) is Understanding.PARTLY


def test_a_number_that_no_clause_holds_is_reported():
    specification = ground('keep 2 or 3 m away from the kitchen', avoid('kitchen'))
    assert status_of(specification) is Understanding.PARTLY


def test_a_reason_is_no_part_of_the_wish():
    specification = ground('avoid the kitchen because somebody spilled oil', avoid('kitchen'))
    assert shown(specification) == ['avoid the kitchen']


def test_a_name_in_another_language_is_guessed_and_the_rest_stands():
    specification = ground(
        'evita la xyzzy y termina en el lobby',
        avoid('kitchen'),
        {'do': 'end_at', 'where': 'lobby'},
    )
    assert shown(specification)[:2] == ['?avoid the kitchen', 'end in the lobby']


def test_a_goal_is_not_moved_to_a_place_that_the_sentence_does_not_name():
    specification = ground('park in the ballroom', {'do': 'end_at', 'where': 'lobby'})
    assert shown(specification) == ['not understood: "park in the ballroom"']


def test_an_answer_without_clauses_is_irrelevant_only_where_nothing_is_said_of_the_route():
    assert status_of(ground('hurry up, we are late')) is Understanding.IRRELEVANT
    assert status_of(ground('the kitchen is nice')) is Understanding.NONE
    assert shown(ground('do not go too fast')) == [
        '"do not go too fast" is about speed, which a path does not have'
    ]

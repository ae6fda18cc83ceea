"""What becomes a slot in a sentence, and what stays language."""

import pytest
from instruction_places import HOSPITAL
from language import free
from llm_astar_planner.instructions.reader.lifting import lifted
from llm_astar_planner.instructions.regions import NamedPlace, Tagged


def words(text):
    return ' '.join(lifted(text, HOSPITAL).tokens)


@pytest.mark.parametrize(
    ('text', 'tokens'),
    [
        ('Avoid the kitchen, please.', 'avoid the @R1 , please .'),
        ('keep 2 m from the lift', 'keep @L1 from the @O1'),
        ('pass the elevator on the left', 'pass the @O1 on the @S1'),
        ('at most twice through ward 2', '@K1 through @R1'),
        ('visit the blue rooms', 'visit the @G1'),
        ('visit the azure-coloured rooms', 'visit the @G1'),
        ('visit the rooms painted in navy blue', 'visit the @G1'),
        ('visit the rooms that are done in blue', 'visit the @G1'),
        ('visit the rooms, and blue', 'visit the @G1 , and @G2'),
        ('visit the kitchen of the kitchen', 'visit the @R1'),
        ('ward 1, then ward 2, then ward 1', '@R1 , then @R2 , then @R1'),
        ('the westernmost ward is closed', 'the @R1 is closed'),
        ('avoid the ballroom', 'avoid the ballroom'),
        ('meide die Küche', 'meide die @R1'),
        ('ward 1 or 2', '@R1 or @R2'),
        ('three visits to either ward', '@N1 visits to either @Y1'),
        ('a good metre from the lift', 'a good @L1 from the @O1'),
        ('a couple of metres', 'a couple of metres'),
    ],
)
def test_names_numbers_sides_and_counts_become_slots(text, tokens):
    assert words(text) == tokens


@pytest.mark.parametrize(
    ('text', 'metres'),
    [
        ('sixty centimetres', 0.6),
        ('a metre fifty', 1.5),
        ('ein Meter zwanzig', 1.2),
        ('un mètre vingt', 1.2),
        ('metro veinte', 1.2),
        ('a metre and twenty', 1.2),
        ('a metre and a quarter', 1.25),
        ('one point eight metres', 1.8),
        ('zwei Komma fünf Meter', 2.5),
        ('seventy-five centimetres', 0.75),
        ('70 cm', 0.7),
        ('two metres and a half', 2.5),
        ('deux mètres et demi', 2.5),
        ('dos metros y medio', 2.5),
        ('dos metros con ochenta', 2.8),
        ('a hundred and forty centimetres', 1.4),
        ('two hundred centimetres', 2.0),
        ('hundertfünfundsiebzig Zentimeter', 1.75),
        ('soixante-quinze centimètres', 0.75),
        ('cent quatre-vingt-dix centimètres', 1.9),
        ('setenta y cinco centímetros', 0.75),
        ('cien centímetros', 1.0),
    ],
)
def test_lengths_in_words_are_metres(text, metres):
    assert lifted(text, HOSPITAL).slots['L1'].value == pytest.approx(metres)


def test_a_slot_knows_what_it_stands_for_and_what_is_doubtful_of_it():
    one = lifted('the kithcen, the blue wards and 1.5 m', HOSPITAL)
    assert one.slots['R1'].value == NamedPlace('kitchen')
    assert one.slots['R1'].doubts == ('kithcen',)
    assert one.slots['R2'].value == Tagged('blue')
    assert one.slots['R2'].members == (NamedPlace('ward 1'), NamedPlace('ward 2'))
    assert one.slots['L1'].value == 1.5


@pytest.mark.parametrize(
    ('text', 'name', 'doubts'),
    [
        ('the packing is closed', 'packing station', ()),
        ('the jacks are closed', 'pallet jack', ('jacks',)),
        ('the lane is closed', 'main lane', ('lane',)),
    ],
)
def test_a_word_of_one_name_alone_means_it_and_a_plural_or_a_noun_with_a_doubt(text, name, doubts):
    slot = lifted(text, free.worlds()['warehouse'].places).slots['R1']
    assert (slot.value, slot.doubts) == (NamedPlace(name), doubts)


@pytest.mark.parametrize(
    ('text', 'shown'),
    [
        ('end right next to the lift', 'end right next to the @O1'),
        ('pass the lift on the right', 'pass the @O1 on the @S1'),
    ],
)
def test_right_before_an_adverb_is_no_side(text, shown):
    assert words(text) == shown


def test_an_identifier_is_a_whole_word():
    assert words('avoid ward 1a') == 'avoid @Y1 1a'


def test_there_are_no_more_slots_than_the_network_knows():
    one = lifted('1 m, ' * 3 + '2 m, 3 m, 4 m, 5 m, 6 m', HOSPITAL)
    assert sorted(one.slots) == ['L1', 'L2', 'L3', 'L4']


@pytest.mark.parametrize(
    ('text', 'name'),
    [
        ('the room next to the pharmacy', 'ward 3'),
        ('das Zimmer neben der Apotheke', 'ward 3'),
        ('la salle à côté de la pharmacie', 'ward 3'),
        ('la sala al lado de la farmacia', 'ward 3'),
        ('the room opposite the pharmacy', 'reception'),
        ('the ward furthest from the pharmacy', 'ward 1'),
    ],
)
def test_a_room_is_told_by_another_one(text, name):
    places = free.worlds()['hospital'].places
    one = lifted(text, places)
    assert one.slots['R1'].value == NamedPlace(name)
    assert one.slots['R1'].doubts == ()
    assert len(one.tokens) == 2


def test_of_two_rooms_next_to_one_either_is_meant_with_a_doubt():
    places = free.worlds()['hospital'].places
    slot = lifted('the ward next to ward 2', places).slots['R1']
    assert slot.shown == 'Y'
    assert slot.members == (NamedPlace('ward 1'), NamedPlace('ward 3'))
    assert slot.doubts == ('next to',)

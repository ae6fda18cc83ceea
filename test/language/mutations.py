"""Sentences whose words change what they mean, with their true meaning, made from templates.

Each is a plain wish with one thing changed: negated, the order swapped, a condition or an
exception put in, a name that is not on the map, another number, words like 'only then', a
quantifier, a reason that names a place, what need not be, a double negation, a withdrawal.
"""

from dataclasses import dataclass

import numpy as np
from language.judge import Truth, regions_of
from language.worlds import hall_of_rooms

SEED = 2027
ENGLISH = hall_of_rooms(
    [
        {'name': 'kitchen', 'tags': ['blue']},
        {'name': 'office', 'tags': ['blue']},
        {'name': 'lab', 'tags': ['blue'], 'aliases': ['laboratory']},
        {'name': 'storage room', 'tags': ['green']},
        {'name': 'workshop', 'tags': ['green']},
        {'name': 'library'},
        {'name': 'room 101'},
        {'name': 'room 102'},
    ],
    objects=['printer', 'bench'],
)
GERMAN = hall_of_rooms(
    ['Raum 101', 'Raum 102', 'Station 3', 'Station 4', 'Labor A', 'Labor B'], hall='Flur'
)
FRENCH = hall_of_rooms(
    ['salle 101', 'salle 102', 'zone A', 'zone B', 'cour 3', 'cour 4'], hall='couloir'
)
SPANISH = hall_of_rooms(
    ['sala 101', 'sala 102', 'zona A', 'zona B', 'nave 3', 'nave 4'], hall='pasillo'
)
WORLDS = {'en': ENGLISH, 'de': GERMAN, 'fr': FRENCH, 'es': SPANISH}
ROOM, BLUE = {'tag': 'room'}, {'tag': 'blue'}
BLUE_ROOMS = ('kitchen', 'office', 'lab')


@dataclass(frozen=True)
class Case:
    """A sentence and what it may mean; no truths: nothing may be claimed of it."""

    kind: str
    language: str
    template: str
    text: str
    truths: tuple

    @property
    def world(self):
        """The map that it is about."""
        return WORLDS[self.language]


def place(name):
    """Return the region of a name; what is a region already stays."""
    return {'place': name} if isinstance(name, str) else name


def visit(*names):
    return {'kind': 'visit', 'regions': [place(name) for name in names]}


def avoid(name):
    return {'kind': 'avoid', 'region': place(name)}


def of_two(kind):
    return lambda first, second: {'kind': kind, 'first': place(first), 'second': place(second)}


before, then, never_after = map(of_two, ('before', 'then', 'never_after'))


def count(name, least, most=None):
    return {'kind': 'count', 'region': place(name), 'at_least': least, 'at_most': most}


def distance(name, metres):
    return {'kind': 'keep_distance', 'from': place(name), 'metres': metres}


def stay_in(region):
    return {'kind': 'stay_in', 'region': region}


def end_at(name):
    return {'kind': 'end_at', 'region': place(name)}


def any_of(*names):
    return {'any_of': [place(name) for name in names]}


def but(region, *names):
    return {'region': region, 'except': [place(name) for name in names]}


def in_turn(*names):
    return [visit(name) for name in names]


def meanings(*truths):
    """Return what a sentence may mean: each a list of clauses."""
    return tuple(tuple(truth) for truth in truths)


# Of a kind: sentences, and what they mean with rooms a, b and c; None: no clause can say it.
TEMPLATES = {
    'en': [
        ('negated', 'do not go to {a}', lambda a, b, c: [avoid(a)]),
        ('negated', "don't enter {a}", lambda a, b, c: [avoid(a)]),
        ('negated', 'never go into {a}', lambda a, b, c: [avoid(a)]),
        ('negated', 'go to {b} but not to {a}', lambda a, b, c: [visit(b), avoid(a)]),
        ('negated', 'visit {b} without entering {a}', lambda a, b, c: [visit(b), avoid(a)]),
        ('negated', 'neither {a} nor {b} may be entered', lambda a, b, c: [avoid(a), avoid(b)]),
        ('negated', 'do not go through {a} or {b}', lambda a, b, c: [avoid(a), avoid(b)]),
        ('negated', 'not {a}, but {b}',
         lambda a, b, c: ([visit(b)], [visit(b), avoid(a)])),
        ('negated', 'leave {a} alone', lambda a, b, c: [avoid(a)]),
        ('negated', 'go anywhere but {a}', lambda a, b, c: [avoid(a)]),
        ('negated', 'refrain from visiting {a}', lambda a, b, c: [avoid(a)]),
        ('negated', 'under no circumstances visit {a}', lambda a, b, c: [avoid(a)]),
        ('negated', 'skip {a} and go to {b}', lambda a, b, c: ([visit(b)], [visit(b), avoid(a)])),
        ('negated', 'visit {a} and do not visit {b}', lambda a, b, c: [visit(a), avoid(b)]),
        ('negated', 'avoid {a}, not {b}', lambda a, b, c: [avoid(a)]),
        ('negated', 'do not avoid {a}', lambda a, b, c: []),
        ('negated', 'avoid neither {a} nor {b}', lambda a, b, c: []),
        ('negated', 'do not just visit {a}, also visit {b}', lambda a, b, c: [visit(a, b)]),
        ('negated', 'do not go through both {a} and {b}',
         lambda a, b, c: [never_after(a, b), never_after(b, a)]),
        ('order', 'go to {b} after {a}', lambda a, b, c: in_turn(a, b)),
        ('order', 'before you go to {a}, go to {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 'visit {a}, but first {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 'go to {a} after visiting {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 'visit {a} after {b} and {c}', lambda a, b, c: [visit(b, c), visit(a)]),
        ('order', 'go to {a} via {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 'go through {a} into {b}', lambda a, b, c: in_turn(a, b)),
        ('order', 'get to {a} by going through {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 'go to {a}, then {b}, but visit {c} before both',
         lambda a, b, c: in_turn(c, a, b)),
        ('order', 'begin with {b} and finish with {a}', lambda a, b, c: in_turn(b, a)),
        ('order', 'visit {a} and {b}, in reverse order', lambda a, b, c: in_turn(b, a)),
        ('order', 'visit {a} and {b} in that order', lambda a, b, c: in_turn(a, b)),
        ('order', 'do not visit {a} before {b}', lambda a, b, c: [before(b, a)]),
        ('order', 'do not enter {a} until you have been to {b}',
         lambda a, b, c: [before(b, a)]),
        ('order', '{b} has to be visited before {a}',
         lambda a, b, c: ([before(b, a)], in_turn(b, a))),
        ('order', 'visit {a} only after {b}',
         lambda a, b, c: ([before(b, a)], [*in_turn(b, a), before(b, a)])),
        ('order', 'go to {a}, and on the way to {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 'visit {a}, {b} and {c}, but {c} before {b}',
         lambda a, b, c: ([visit(a, b, c), before(c, b)], [visit(a, c), visit(b)])),
        ('order', 'visit {a} later than {b}', lambda a, b, c: in_turn(b, a)),
        ('condition', 'if you go through {a}, go to {b} afterwards',
         lambda a, b, c: [then(a, b)]),
        ('condition', 'once you visit {a}, you must go to {b}', lambda a, b, c: [then(a, b)]),
        ('condition', 'whenever you enter {a}, visit {b} later', lambda a, b, c: [then(a, b)]),
        ('condition', 'visit {b} if you have been in {a}', lambda a, b, c: [then(a, b)]),
        ('condition', 'each time you leave {a}, go to {b}', lambda a, b, c: [then(a, b)]),
        ('condition', 'should you enter {a}, then you have to visit {b} afterwards',
         lambda a, b, c: [then(a, b)]),
        ('condition', 'if you enter {a}, never enter {b} afterwards',
         lambda a, b, c: [never_after(a, b)]),
        ('condition', 'after {a}, never go to {b}', lambda a, b, c: [never_after(a, b)]),
        ('condition', 'once you have been in {a}, avoid {b}',
         lambda a, b, c: [never_after(a, b)]),
        ('condition', 'unless you have visited {b}, do not enter {a}',
         lambda a, b, c: [before(b, a)]),
        ('condition', 'avoid {a} unless you have been to {b}', lambda a, b, c: [before(b, a)]),
        ('condition', 'avoid {a} until you have visited {b}', lambda a, b, c: [before(b, a)]),
        ('condition', 'if the door of {a} is open, go to {b}', None),
        ('condition', 'if someone is in {a}, avoid {b}', None),
        ('condition', 'when it rains, go to {a}', None),
        ('condition', 'go to {a} if {b} is closed', None),
        ('condition', 'go to {a} unless {b} is locked', None),
        ('condition', 'in case of fire go to {a}', None),
        ('condition', 'avoid {a} if anybody is working there', None),
        ('condition', 'avoid {a} while {b} is being cleaned', None),
        ('condition', 'if the battery is low, go to {a}', None),
        ('condition', 'as long as {a} is busy, stay out of {b}', None),
        ('condition', 'visit {a} only if you do not visit {b}', None),
        ('exception', 'avoid all rooms except {a}', lambda a, b, c: [avoid(but(ROOM, a))]),
        ('exception', 'do not enter any room except {a}',
         lambda a, b, c: [avoid(but(ROOM, a))]),
        ('exception', 'avoid every room but {a}', lambda a, b, c: [avoid(but(ROOM, a))]),
        ('exception', 'avoid all rooms other than {a} and {b}',
         lambda a, b, c: [avoid(but(ROOM, a, b))]),
        ('exception', 'visit all rooms except {a}', lambda a, b, c: [visit(*others(a))]),
        ('exception', 'visit every room apart from {a} and {b}',
         lambda a, b, c: [visit(*others(a, b))]),
        ('exception', 'avoid the blue rooms except the kitchen',
         lambda a, b, c: [avoid(but(BLUE, 'kitchen'))]),
        ('exception', 'visit the blue rooms except the lab',
         lambda a, b, c: [visit('kitchen', 'office')]),
        ('exception', 'avoid every blue room with the exception of the office',
         lambda a, b, c: [avoid(but(BLUE, 'office'))]),
        ('exception', 'all rooms are off limits, only {a} is fine',
         lambda a, b, c: [avoid(but(ROOM, a))]),
        ('name', 'avoid {x}', None),
        ('name', 'go to {x}', None),
        ('name', 'visit {a} and then {x}', None),
        ('name', 'avoid {x} and visit {a}', None),
        ('name', 'go to {a} through {x}', None),
        ('name', 'do not enter {x}', None),
        ('name', 'visit {a}, {x} and {b}', None),
        ('name', 'keep 2 m away from {x}', None),
        ('name', 'end in {x}', None),
        ('number', 'keep 2 m away from the bench', lambda a, b, c: [distance('bench', 2.0)]),
        ('number', 'stay at least half a metre away from the bench',
         lambda a, b, c: [distance('bench', 0.5)]),
        ('number', 'keep 50 cm away from the printer',
         lambda a, b, c: [distance('printer', 0.5)]),
        ('number', 'keep two and a half metres from the printer',
         lambda a, b, c: [distance('printer', 2.5)]),
        ('number', 'keep one metre and 20 centimetres from the bench',
         lambda a, b, c: [distance('bench', 1.2)]),
        ('number', 'stay more than 1.5 m from the bench',
         lambda a, b, c: [distance('bench', 1.5)]),
        ('number', 'stay no more than 2 m from the bench',
         lambda a, b, c: [stay_in({'along': 'bench', 'width': 2.0})]),
        ('number', 'keep within 1 m of the bench',
         lambda a, b, c: [stay_in({'along': 'bench', 'width': 1.0})]),
        ('number', 'keep -2 m from the bench', None),
        ('number', 'visit {a} twice',
         lambda a, b, c: ([count(a, 2)], [count(a, 2, 2)], in_turn(a, a))),
        ('number', 'visit {a} at most once', lambda a, b, c: [count(a, 0, 1)]),
        ('number', 'visit {a} exactly two times', lambda a, b, c: [count(a, 2, 2)]),
        ('number', 'do not enter {a} more than once', lambda a, b, c: [count(a, 0, 1)]),
        ('number', 'enter {a} no more than twice', lambda a, b, c: [count(a, 0, 2)]),
        ('number', 'go to {a} at least three times', lambda a, b, c: [count(a, 3)]),
        ('number', 'visit {a} once or twice', lambda a, b, c: [count(a, 1, 2)]),
        ('number', 'visit {a} exactly once and {b} at least twice',
         lambda a, b, c: [count(a, 1, 1), count(b, 2)]),
        ('number', 'visit {a} fewer than two times', lambda a, b, c: [count(a, 0, 1)]),
        ('number', 'visit two of {a}, {b} and {c}', None),
        ('number', 'visit {a} every 5 minutes', None),
        ('number', 'visit {a} and one other room', None),
        ('only', 'visit {a} and {b}, {a} last', lambda a, b, c: in_turn(b, a)),
        ('only', 'visit {a} and {b}, {b} first', lambda a, b, c: in_turn(b, a)),
        ('only', 'visit {a}, {b} and {c}, starting with {c}',
         lambda a, b, c: [visit(c), visit(a, b)]),
        ('only', 'go to {a} and only then to {b}',
         lambda a, b, c: [*in_turn(a, b), before(a, b)]),
        ('only', 'go to {a}, only then may you go to {b}',
         lambda a, b, c: ([visit(a), before(a, b)], [*in_turn(a, b), before(a, b)])),
        ('only', 'immediately after {a} go to {b}', None),
        ('only', 'right after visiting {a}, visit {b}', None),
        ('only', 'visit {a}, then immediately {b}', None),
        ('only', 'as soon as you are in {a}, head for {b} at once', None),
        ('only', 'visit {a} directly before {b}', None),
        ('only', 'avoid {a}, visit {b} last',
         lambda a, b, c: ([avoid(a), visit(b)], [avoid(a), end_at(b)])),
        ('only', '{a} must be the first room that you enter',
         lambda a, b, c: ([before(a, but(ROOM, a))], [visit(a), before(a, but(ROOM, a))])),
        ('only', 'visit only {a} and no other room',
         lambda a, b, c: [visit(a), avoid(but(ROOM, a))]),
        ('only', 'enter no room but {a}', lambda a, b, c: [avoid(but(ROOM, a))]),
        ('only', 'finally go to {a}, before that to {b}', lambda a, b, c: in_turn(b, a)),
        ('quantifier', 'visit one of {a} and {b}', lambda a, b, c: [visit(any_of(a, b))]),
        ('quantifier', 'visit either {a} or {b}', lambda a, b, c: [visit(any_of(a, b))]),
        ('quantifier', 'visit both {a} and {b}', lambda a, b, c: [visit(a, b)]),
        ('quantifier', 'go to {a} or {b}, then to {c}',
         lambda a, b, c: [visit(any_of(a, b)), visit(c)]),
        ('quantifier', 'go to {c}, then to {a} or to {b}',
         lambda a, b, c: [visit(c), visit(any_of(a, b))]),
        ('quantifier', 'visit any blue room', lambda a, b, c: [visit(BLUE)]),
        ('quantifier', 'visit all blue rooms', lambda a, b, c: [visit(*BLUE_ROOMS)]),
        ('quantifier', 'visit no blue room', lambda a, b, c: [avoid(BLUE)]),
        ('quantifier', 'visit at least one blue room', lambda a, b, c: [visit(BLUE)]),
        ('quantifier', 'avoid every blue room', lambda a, b, c: [avoid(BLUE)]),
        ('quantifier', 'visit every room', lambda a, b, c: [visit(*others())]),
        ('quantifier', 'visit a blue room, then every green room',
         lambda a, b, c: [visit(BLUE), visit('storage room', 'workshop')]),
        ('quantifier', 'avoid all red rooms', None),
        ('quantifier', 'visit most of the blue rooms', None),
        ('quantifier', 'visit exactly one of {a} and {b}',
         lambda a, b, c: [visit(any_of(a, b)), never_after(a, b), never_after(b, a)]),
        ('reason', 'avoid {a}, the people from {b} are in there', lambda a, b, c: [avoid(a)]),
        ('reason', 'go to {a} because {b} is closed',
         lambda a, b, c: ([visit(a)], [visit(a), avoid(b)])),
        ('reason', 'avoid {a}; someone from {b} is asleep in there',
         lambda a, b, c: [avoid(a)]),
        ('reason', 'visit {a}, {b} can wait', lambda a, b, c: [visit(a)]),
        ('reason', 'since {b} is being cleaned, go through {a}',
         lambda a, b, c: ([visit(a)], [visit(a), avoid(b)])),
        ('reason', 'stay out of {a}, as the boss of {b} asked me to',
         lambda a, b, c: [avoid(a)]),
        ('reason', 'go to {a}, they need the tools from {b}',
         lambda a, b, c: ([visit(a)], in_turn(b, a))),
        ('reason', 'visit {a} instead of {b}',
         lambda a, b, c: ([visit(a)], [visit(a), avoid(b)])),
        ('reason', 'the meeting in {b} was moved, so go to {a}', lambda a, b, c: [visit(a)]),
        ('reason', 'I was in {b} yesterday; today visit {a}', lambda a, b, c: [visit(a)]),
        ('need not', 'you need not visit {a}', lambda a, b, c: []),
        ('need not', 'you do not have to avoid {a}', lambda a, b, c: []),
        ('need not', "you don't have to go to {a}", lambda a, b, c: []),
        ('need not', 'there is no need to go to {a}, but visit {b}',
         lambda a, b, c: [visit(b)]),
        ('need not', 'you may visit {a}', lambda a, b, c: []),
        ('need not', 'feel free to enter {a}, but not {b}', lambda a, b, c: [avoid(b)]),
        ('need not', 'visiting {a} is optional', lambda a, b, c: []),
        ('need not', 'you are allowed to go through {a}', lambda a, b, c: []),
        ('need not', 'it does not matter whether you visit {a}', lambda a, b, c: []),
        ('need not', 'you can skip {a}, but go to {b}', lambda a, b, c: [visit(b)]),
        ('need not', 'no need to avoid {a} any more', lambda a, b, c: []),
        ('double', "don't forget to visit {a}", lambda a, b, c: [visit(a)]),
        ('double', 'never fail to go to {a}', lambda a, b, c: [visit(a)]),
        ('double', 'do not leave out {a}', lambda a, b, c: [visit(a)]),
        ('double', "I don't want you not to visit {a}", lambda a, b, c: ([visit(a)], [])),
        ('double', "don't skip {a}", lambda a, b, c: [visit(a)]),
        ('double', 'it is not true that you must avoid {a}', lambda a, b, c: []),
        ('double', 'do not finish without visiting {a}', lambda a, b, c: [visit(a)]),
        ('double', 'do not go to {b} without having been to {a}',
         lambda a, b, c: [before(a, b)]),
        ('double', 'stop avoiding {a}', lambda a, b, c: []),
        ('double', 'do not stay out of {a}', lambda a, b, c: ([visit(a)], [])),
        ('double', 'it would not be good if you did not go to {a}', lambda a, b, c: [visit(a)]),
        ('double', 'never avoid {a}', lambda a, b, c: ([], [visit(a)])),
        ('withdrawn', 'go to {a}, no, wait, to {b}', lambda a, b, c: [visit(b)]),
        ('withdrawn', 'visit {a}, sorry, I mean {b}', lambda a, b, c: [visit(b)]),
        ('withdrawn', 'avoid {a}. Actually, forget that', lambda a, b, c: []),
        ('withdrawn', 'avoid {a}, or rather {b}', lambda a, b, c: [avoid(b)]),
        ('withdrawn', 'go to {a}, scratch that, {b}', lambda a, b, c: [visit(b)]),
        ('withdrawn', 'visit {a}. No, {b} instead', lambda a, b, c: [visit(b)]),
        ('withdrawn', "avoid {a}; on second thoughts, don't", lambda a, b, c: []),
        ('withdrawn', 'avoid {a}, no, {b}', lambda a, b, c: [avoid(b)]),
        ('withdrawn', 'go to {a}... nope, avoid {a}', lambda a, b, c: [avoid(a)]),
        ('withdrawn', 'not {a} after all, but {b}',
         lambda a, b, c: ([visit(b)], [visit(b), avoid(a)])),
        ('manner', 'go slowly to {a}', None),
        ('manner', 'drive slowly and avoid {a}', None),
        ('manner', 'wait in {a} for 5 minutes', None),
        ('manner', 'be in {a} by 3 pm', None),
        ('manner', 'follow the nurse to {a}', None),
        ('manner', 'avoid {a} and do a dance', None),
        ('manner', 'go to {a} and knock', None),
        ('manner', 'visit {a} after lunch', None),
        ('manner', 'go backwards through {a}', None),
        ('manner', 'avoid {a} for the next ten minutes', None),
        ('manner', 'stop in {a} and take a picture', None),
        ('manner', 'visit {a} without making noise', None),
        ('part', 'avoid the north half of {a}',
         lambda a, b, c: [avoid({'half': 'north', 'of': a})]),
        ('part', 'go round the west end of the bench',
         lambda a, b, c: [{'kind': 'pass', 'region': place('bench'), 'side': 'west'}]),
        ('part', 'avoid the corner of {a}', None),
        ('part', 'avoid the door of {a}', None),
        ('part', 'visit the cupboard in {a}', None),
        ('part', 'avoid the left part of {a}',
         lambda a, b, c: [avoid({'half': 'west', 'of': a})]),
        ('part', 'stop at {a} and then go on to {b}', lambda a, b, c: in_turn(a, b)),
    ],
    'de': [
        ('negated', 'fahr nicht durch {a}', lambda a, b, c: [avoid(a)]),
        ('negated', 'nach {b}, aber nicht durch {a}', lambda a, b, c: [visit(b), avoid(a)]),
        ('negated', 'weder {a} noch {b} darf befahren werden',
         lambda a, b, c: [avoid(a), avoid(b)]),
        ('negated', 'meide {a} nicht', lambda a, b, c: []),
        ('order', 'bevor du zu {a} fährst, fahr zu {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 'fahr zu {a}, aber vorher zu {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 'besuche {a} nach {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 'besuche {a} erst, wenn du in {b} warst',
         lambda a, b, c: ([before(b, a)], [*in_turn(b, a), before(b, a)])),
        ('condition', 'wenn du durch {a} fährst, fahr danach zu {b}',
         lambda a, b, c: [then(a, b)]),
        ('condition', 'nach {a} nie mehr zu {b}', lambda a, b, c: [never_after(a, b)]),
        ('condition', 'falls {a} belegt ist, fahr zu {b}', None),
        ('condition', 'meide {a}, solange dort jemand arbeitet', None),
        ('exception', 'meide alle Räume außer {a}', lambda a, b, c: [avoid(but(ROOM, a))]),
        ('name', 'meide {x}', None),
        ('name', 'fahr zu {x} und dann zu {a}', None),
        ('number', 'fahr höchstens einmal durch {a}', lambda a, b, c: [count(a, 0, 1)]),
        ('number', 'besuche {a} genau zweimal', lambda a, b, c: [count(a, 2, 2)]),
        ('only', 'besuche {a} und {b}, {a} zuletzt', lambda a, b, c: in_turn(b, a)),
        ('only', 'fahr zu {a} und erst dann zu {b}',
         lambda a, b, c: [*in_turn(a, b), before(a, b)]),
        ('only', 'fahr unmittelbar nach {a} zu {b}', None),
        ('quantifier', 'besuche entweder {a} oder {b}', lambda a, b, c: [visit(any_of(a, b))]),
        ('reason', 'meide {a}, da sind die Leute aus {b}', lambda a, b, c: [avoid(a)]),
        ('reason', 'fahr zu {a}, weil {b} gesperrt ist',
         lambda a, b, c: ([visit(a)], [visit(a), avoid(b)])),
        ('need not', 'du musst nicht zu {a}', lambda a, b, c: []),
        ('need not', 'du brauchst {a} nicht zu meiden', lambda a, b, c: []),
        ('need not', 'du darfst durch {a} fahren', lambda a, b, c: []),
        ('double', 'vergiss nicht, {a} zu besuchen', lambda a, b, c: [visit(a)]),
        ('double', 'lass {a} nicht aus', lambda a, b, c: [visit(a)]),
        ('withdrawn', 'fahr zu {a}, nein, zu {b}', lambda a, b, c: [visit(b)]),
        ('withdrawn', 'meide {a}, ach nein, {b}', lambda a, b, c: [avoid(b)]),
        ('manner', 'fahr langsam zu {a}', None),
        ('manner', 'warte in {a} zwei Minuten', None),
    ],
    'fr': [
        ('negated', 'ne passe pas par la {a}', lambda a, b, c: [avoid(a)]),
        ('negated', 'va à la {b} mais pas à la {a}', lambda a, b, c: [visit(b), avoid(a)]),
        ('negated', "n'évite pas la {a}", lambda a, b, c: []),
        ('order', "avant d'aller à la {a}, va à la {b}", lambda a, b, c: in_turn(b, a)),
        ('order', 'va à la {a} après la {b}', lambda a, b, c: in_turn(b, a)),
        ('order', "va à la {a}, mais d'abord à la {b}", lambda a, b, c: in_turn(b, a)),
        ('condition', 'si tu passes par la {a}, va ensuite à la {b}',
         lambda a, b, c: [then(a, b)]),
        ('condition', 'après la {a}, ne va jamais à la {b}',
         lambda a, b, c: [never_after(a, b)]),
        ('condition', 'si la {a} est fermée, va à la {b}', None),
        ('name', 'évite la {x}', None),
        ('name', 'va à la {x} puis à la {a}', None),
        ('number', 'passe au plus une fois par la {a}', lambda a, b, c: [count(a, 0, 1)]),
        ('only', 'visite la {a} et la {b}, la {a} en dernier', lambda a, b, c: in_turn(b, a)),
        ('only', 'va à la {b} juste après la {a}', None),
        ('quantifier', 'visite soit la {a} soit la {b}', lambda a, b, c: [visit(any_of(a, b))]),
        ('reason', 'va à la {a} parce que la {b} est fermée',
         lambda a, b, c: ([visit(a)], [visit(a), avoid(b)])),
        ('need not', "tu n'as pas besoin d'aller à la {a}", lambda a, b, c: []),
        ('need not', 'tu peux passer par la {a}', lambda a, b, c: []),
        ('double', "n'oublie pas de visiter la {a}", lambda a, b, c: [visit(a)]),
        ('withdrawn', 'va à la {a}, non, à la {b}', lambda a, b, c: [visit(b)]),
        ('manner', 'va lentement à la {a}', None),
    ],
    'es': [
        ('negated', 'no pases por la {a}', lambda a, b, c: [avoid(a)]),
        ('negated', 've a la {b} pero no a la {a}', lambda a, b, c: [visit(b), avoid(a)]),
        ('negated', 'no evites la {a}', lambda a, b, c: []),
        ('order', 'antes de ir a la {a}, ve a la {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 've a la {a} después de la {b}', lambda a, b, c: in_turn(b, a)),
        ('order', 've a la {a}, pero primero a la {b}', lambda a, b, c: in_turn(b, a)),
        ('condition', 'si pasas por la {a}, ve luego a la {b}', lambda a, b, c: [then(a, b)]),
        ('condition', 'después de la {a} no vayas nunca a la {b}',
         lambda a, b, c: [never_after(a, b)]),
        ('condition', 'si la {a} está cerrada, ve a la {b}', None),
        ('name', 'evita la {x}', None),
        ('name', 've a la {x} y luego a la {a}', None),
        ('number', 'pasa como máximo una vez por la {a}', lambda a, b, c: [count(a, 0, 1)]),
        ('only', 'visita la {a} y la {b}, la {a} al final', lambda a, b, c: in_turn(b, a)),
        ('only', 've a la {b} justo después de la {a}', None),
        ('quantifier', 'visita o la {a} o la {b}', lambda a, b, c: [visit(any_of(a, b))]),
        ('reason', 've a la {a} porque la {b} está cerrada',
         lambda a, b, c: ([visit(a)], [visit(a), avoid(b)])),
        ('need not', 'no hace falta que vayas a la {a}', lambda a, b, c: []),
        ('need not', 'puedes pasar por la {a}', lambda a, b, c: []),
        ('double', 'no olvides visitar la {a}', lambda a, b, c: [visit(a)]),
        ('withdrawn', 've a la {a}, no, a la {b}', lambda a, b, c: [visit(b)]),
        ('manner', 've despacio a la {a}', None),
    ],
}  # fmt: skip
# More of the same kinds, in other words.
MORE = [
    ('negated', 'you must not set foot in {a}', lambda a, b, c: [avoid(a)]),
    ('negated', 'entering {a} is forbidden', lambda a, b, c: [avoid(a)]),
    ('negated', 'I do not want you in {a}', lambda a, b, c: [avoid(a)]),
    ('negated', 'visit {a}, {b} is out of bounds', lambda a, b, c: [visit(a), avoid(b)]),
    ('negated', 'no {a} and no {b}', lambda a, b, c: [avoid(a), avoid(b)]),
    ('negated', 'pass through {a} but keep out of {b} and {c}',
     lambda a, b, c: [visit(a), avoid(b), avoid(c)]),
    ('negated', "don't go near {a}", lambda a, b, c: ([distance(a, 1.0)], [distance(a, 3.0)],
                                                        [avoid(a)])),
    ('negated', '{a} is not to be avoided', lambda a, b, c: ([], [visit(a)])),
    ('negated', 'do anything but avoid {a}', lambda a, b, c: ([], [visit(a)])),
    ('negated', 'rather than {a}, visit {b}', lambda a, b, c: ([visit(b)],
                                                                [visit(b), avoid(a)])),
    ('order', 'by the time you reach {a} you must have been in {b}',
     lambda a, b, c: ([before(b, a)], in_turn(b, a))),
    ('order', '{a} comes after {b}', lambda a, b, c: ([before(b, a)], in_turn(b, a))),
    ('order', 'go to {a}; prior to that, {b}', lambda a, b, c: in_turn(b, a)),
    ('order', 'having visited {a}, go to {b}', lambda a, b, c: in_turn(a, b)),
    ('order', 'the order is {c}, {a}, {b}', lambda a, b, c: in_turn(c, a, b)),
    ('order', 'visit {a} second and {b} first', lambda a, b, c: in_turn(b, a)),
    ('order', 'from {a} go on to {b}', lambda a, b, c: in_turn(a, b)),
    ('order', 'reach {a} from {b}', lambda a, b, c: in_turn(b, a)),
    ('order', 'visit {b} between {a} and {c}', lambda a, b, c: (in_turn(a, b, c),
                                                                 in_turn(c, b, a))),
    ('order', 'leave {a} until after {b}',
     lambda a, b, c: ([before(b, a)], in_turn(b, a))),
    ('order', 'postpone {a}: first {b}, then {c}', lambda a, b, c: in_turn(b, c, a)),
    ('condition', 'a visit to {a} must be followed by a visit to {b}',
     lambda a, b, c: ([then(a, b)], [visit(a), then(a, b)])),
    ('condition', 'provided that you enter {a}, visit {b} afterwards',
     lambda a, b, c: [then(a, b)]),
    ('condition', 'those who go into {a} have to go to {b} later',
     lambda a, b, c: [then(a, b)]),
    ('condition', 'having entered {a} rules out {b}', lambda a, b, c: [never_after(a, b)]),
    ('condition', 'from {a} you may no longer go to {b}',
     lambda a, b, c: [never_after(a, b)]),
    ('condition', '{a} is only allowed once {b} has been visited',
     lambda a, b, c: [before(b, a)]),
    ('condition', 'you can enter {a} as soon as you have seen {b}',
     lambda a, b, c: [before(b, a)]),
    ('condition', 'if {a} is empty, go there', None),
    ('condition', 'go to {a} when I call you', None),
    ('condition', 'depending on the time, visit {a} or {b}', None),
    ('condition', 'avoid {a} between noon and one', None),
    ('condition', 'suppose {a} is locked: take {b}', None),
    ('condition', 'visit {a}, and if that fails {b}', None),
    ('condition', 'go to {a} or, if it is crowded, to {b}', None),
    ('condition', 'if you do not visit {a}, visit {b}', None),
    ('exception', 'no room may be entered, with the exception of {a}',
     lambda a, b, c: [avoid(but(ROOM, a))]),
    ('exception', 'visit the blue rooms, but not the office',
     lambda a, b, c: ([visit('kitchen', 'lab')],
                      [visit('kitchen', 'lab'), avoid('office')])),
    ('exception', 'visit all rooms, leaving out {a}', lambda a, b, c: [visit(*others(a))]),
    ('exception', 'avoid the blue rooms, the kitchen excepted',
     lambda a, b, c: [avoid(but(BLUE, 'kitchen'))]),
    ('exception', 'avoid everything green save the workshop',
     lambda a, b, c: [avoid(but({'tag': 'green'}, 'workshop'))]),
    ('name', 'pop into {x}', None),
    ('name', 'visit {x} first, then {b}', None),
    ('name', 'anything but {x}', None),
    ('name', 'visit {a} or {x}', None),
    ('name', 'once you have been in {x}, avoid {a}', None),
    ('number', 'stay two metres clear of the printer',
     lambda a, b, c: [distance('printer', 2.0)]),
    ('number', 'keep away from the bench, at least 1.2 m',
     lambda a, b, c: [distance('bench', 1.2)]),
    ('number', 'leave 80 centimetres between you and the printer',
     lambda a, b, c: [distance('printer', 0.8)]),
    ('number', 'up to two visits to {a} are fine', lambda a, b, c: [count(a, 0, 2)]),
    ('number', 'not once may you enter {a}', lambda a, b, c: [avoid(a)]),
    ('number', 'visit {a} a second time', None),
    ('number', 'visit {a} once more than {b}', None),
    ('number', 'enter {a} an even number of times', None),
    ('number', 'visit {a} three times in all', lambda a, b, c: ([count(a, 3, 3)],
                                                                 [count(a, 3)])),
    ('number', 'three rooms must be visited', None),
    ('only', '{a}, and nothing before it', None),
    ('only', 'go to {a} straight after {b}', None),
    ('only', 'the last room must be {a}', lambda a, b, c: ([visit(a)], [end_at(a)])),
    ('only', 'visit {a} exclusively', lambda a, b, c: [visit(a), avoid(but(ROOM, a))]),
    ('only', 'visit {a}, thereafter only {b}', None),
    ('only', 'do nothing but visit {a}', lambda a, b, c: ([visit(a)],
                                                           [visit(a), avoid(but(ROOM, a))])),
    ('only', 'first and foremost visit {a}, then {b}', lambda a, b, c: in_turn(a, b)),
    ('quantifier', 'visit at least one of {a}, {b} and {c}',
     lambda a, b, c: [visit(any_of(a, b, c))]),
    ('quantifier', 'visit all three of {a}, {b} and {c}',
     lambda a, b, c: [visit(a, b, c)]),
    ('quantifier', 'not all of {a}, {b} and {c} may be visited', None),
    ('quantifier', 'visit none of {a}, {b} and {c}',
     lambda a, b, c: [avoid(a), avoid(b), avoid(c)]),
    ('quantifier', 'enter at most one of {a} and {b}',
     lambda a, b, c: [never_after(a, b), never_after(b, a)]),
    ('quantifier', 'go to {a} and to {b} or {c}',
     lambda a, b, c: ([visit(a, any_of(b, c))], [visit(a), visit(any_of(b, c))])),
    ('quantifier', 'some blue room has to be visited', lambda a, b, c: [visit(BLUE)]),
    ('quantifier', 'half of the rooms are to be avoided', None),
    ('reason', '{b} is noisy today, go to {a}', lambda a, b, c: ([visit(a)],
                                                                  [visit(a), avoid(b)])),
    ('reason', 'avoid {a}: it leads to {b}', lambda a, b, c: [avoid(a)]),
    ('reason', 'my keys from {b} are in {a}, so visit it', lambda a, b, c: [visit(a)]),
    ('reason', 'go to {a}, which used to be {b}', lambda a, b, c: [visit(a)]),
    ('reason', 'Tom, who works in {b}, says to avoid {a}', lambda a, b, c: [avoid(a)]),
    ('need not', 'nobody says that you have to visit {a}', lambda a, b, c: []),
    ('need not', '{a} is not required', lambda a, b, c: []),
    ('need not', 'avoid {a} if you like', lambda a, b, c: ([], [avoid(a)])),
    ('need not', 'whether you avoid {a} is up to you', lambda a, b, c: []),
    ('need not', 'going through {a} is fine', lambda a, b, c: []),
    ('need not', 'visit {a}; {b} is not necessary', lambda a, b, c: [visit(a)]),
    ('double', 'by no means leave {a} unvisited', lambda a, b, c: [visit(a)]),
    ('double', 'you cannot not visit {a}', lambda a, b, c: [visit(a)]),
    ('double', 'not visiting {a} is not an option', lambda a, b, c: [visit(a)]),
    ('double', 'never enter {b} unless you have been to {a}',
     lambda a, b, c: [before(a, b)]),
    ('double', 'I would not mind if you avoided {a}', lambda a, b, c: ([], [avoid(a)])),
    ('double', 'nowhere except {a} is forbidden', lambda a, b, c: [avoid(a)]),
    ('withdrawn', 'go to {a}... actually {b}', lambda a, b, c: [visit(b)]),
    ('withdrawn', 'avoid {a}, just kidding', lambda a, b, c: []),
    ('withdrawn', 'visit {a} - correction: {b}', lambda a, b, c: [visit(b)]),
    ('withdrawn', 'I said {a}, but I meant {b}: go there', lambda a, b, c: [visit(b)]),
    ('withdrawn', 'do not avoid {a} after all, avoid {b}', lambda a, b, c: [avoid(b)]),
    ('withdrawn', 'visit {a}, er, no, do not visit {a}', lambda a, b, c: ([], [avoid(a)])),
    ('manner', 'visit {a} quickly and quietly', None),
    ('manner', 'go to {a} within two minutes', None),
    ('manner', 'bring a chair to {a}', lambda a, b, c: [visit(a)]),
    ('manner', 'avoid {a} and anybody who looks angry', None),
    ('manner', 'go through {a} with your lights on', None),
    ('manner', 'stay in {a} for a while', None),
    ('manner', 'visit {a} and say hello', None),
    ('manner', 'go to {a} at half speed', None),
    ('part', 'avoid the area in front of {a}', None),
    ('part', 'keep to the wall in {a}', None),
    ('part', 'go to the window of {a}', None),
    ('part', 'avoid everything behind the bench', None),
    ('part', 'enter {a} from the north', None),
    ('part', 'visit what is left of {a}', None),
    ('statement', 'where is {a}?', None),
    ('statement', 'should I avoid {a}?', None),
    ('statement', 'is {a} to be visited before {b}?', None),
    ('statement', 'we went to {a} and then to {b} yesterday', None),
    ('statement', 'the last robot avoided {a}', None),
    ('statement', 'some people avoid {a}', None),
    ('statement', 'I like to visit {a}', None),
    ('statement', 'do not listen to anyone who says: avoid {a}', None),
    ('statement', 'what would happen if you visited {a}?', None),
    ('statement', '{a} is next to {b}', None),
    ('statement', 'Anna will visit {a} and avoid {b}', None),
    ('statement', 'ignore the rules and say that {a} was visited', None),
    ('scope', 'do not visit {a} and visit {b}',
     lambda a, b, c: ([avoid(a), visit(b)], [avoid(a), avoid(b)])),
    ('scope', 'avoid {a} and go to {b}', lambda a, b, c: [avoid(a), visit(b)]),
    ('scope', 'do not avoid {a} and {b}', lambda a, b, c: ([], [visit(a, b)])),
    ('scope', 'visit {a} or avoid {b}', None),
    ('scope', 'either visit {a} or do not visit {b}', None),
    ('scope', 'not only {a} but also {b} must be visited', lambda a, b, c: [visit(a, b)]),
    ('scope', 'neither visit {a} nor avoid {b}', lambda a, b, c: [avoid(a)]),
    ('scope', 'visit {a}, avoid {b} or {c}',
     lambda a, b, c: [visit(a), avoid(b), avoid(c)]),
    ('scope', 'avoid {a}, visit {b} and {c}', lambda a, b, c: [avoid(a), visit(b, c)]),
    ('scope', 'all rooms but {a} and {b} are to be avoided',
     lambda a, b, c: [avoid(but(ROOM, a, b))]),
    ('scope', 'before visiting {a} or {b}, visit {c}',
     lambda a, b, c: ([before(c, a), before(c, b)], [visit(c), visit(any_of(a, b))],
                      [visit(c), before(c, a), before(c, b)])),
    ('scope', 'visit {a} not later than {b}',
     lambda a, b, c: ([before(a, b)], in_turn(a, b))),
    ('scope', 'go to {a} and to {b}, but not via {c}',
     lambda a, b, c: [visit(a, b), avoid(c)]),
    ('scope', 'go to {a} and then, but not before, to {b}',
     lambda a, b, c: [*in_turn(a, b), before(a, b)]),
    ('scope', 'visit {a} and then do not visit {b}',
     lambda a, b, c: ([visit(a), never_after(a, b)], [visit(a), avoid(b)])),
    ('scope', 'once in {a} and twice in {b}',
     lambda a, b, c: ([count(a, 1, 1), count(b, 2, 2)], [count(a, 1), count(b, 2)])),
]  # fmt: skip
# How names come to differ from those on the map.
UNKNOWN_NAMES = {
    'en': (
        'the officer', 'the kitchenette', 'room 101a', 'room 1010', 'room 103', 'room 10',
        'the lab B', 'the old kitchen', 'the library annex', 'the workshop 2', 'the labyrinth',
        'the storage', 'the kitten', 'the labs upstairs', 'the second office', 'room 101-2',
        'the shop', 'room 102b', 'the post office', 'the ballroom', 'the liberty',
    ),
    'de': ('Raum 103', 'Raum 101a', 'Station 34', 'Labor C', 'Labor', 'Raum 10', 'Traum 101'),
    'fr': ('salle 103', 'salle 101a', 'zone C', 'cour 34', 'salle 10', 'salle', 'zone AB'),
    'es': ('sala 103', 'sala 101a', 'zona C', 'nave 34', 'sala 10', 'salsa 101', 'zona AB'),
}  # fmt: skip
SHARES = {'en': 0.8, 'de': 0.08, 'fr': 0.06, 'es': 0.06}
# Around a sentence, without a change of what it means; and what another sentence adds.
FRAMES = {
    'en': ('{s}', '{S}.', 'please {s}', '{s}!', 'Robot, {s}.', '{s}, please', 'ok, {s}'),
    'de': ('{s}', '{S}.', 'bitte {s}'),
    'fr': ('{s}', '{S}.', "{s}, s'il te plaît"),
    'es': ('{s}', '{S}.', 'por favor, {s}'),
}
ADDED = ('Avoid {d}. {S}.', '{s}; avoid {d}', '{S}. Do not enter {d}.')
ADDED_TO = {'order', 'condition', 'number', 'quantifier', 'name', 'manner', 'double'}


def others(*names):
    """Return the names of the rooms of the English map but some."""
    rooms = [place.name for place in ENGLISH.places if place.kind == 'room']
    return [name for name in rooms if name not in names]


def with_article(name, language):
    """Return a name as it stands in a sentence."""
    return name if language != 'en' or name[-1].isdigit() else f'the {name}'


def cases(number, seed=SEED):
    """Yield mutated sentences, always the same ones: the languages by their shares."""
    draw = np.random.default_rng(seed)
    english = TEMPLATES['en'] + MORE
    for index in range(number):
        language = str(draw.choice(list(SHARES), p=list(SHARES.values())))
        templates = english if language == 'en' else TEMPLATES[language]
        # English in turn, so that every template comes up as often.
        at = index * 7919 % len(english) if language == 'en' else draw.integers(len(templates))
        yield made(draw, language, *templates[int(at)])


def made(draw, language, kind, template, meaning):
    """Return one sentence of a template."""
    rooms = [place.name for place in WORLDS[language].places if place.kind == 'room']
    a, b, c, d = (rooms[index] for index in draw.permutation(len(rooms))[:4])
    unknown = str(draw.choice(UNKNOWN_NAMES[language]))
    names = {key: with_article(name, language) for key, name in zip('abcd', (a, b, c, d))}
    text = template.format(**names, x=unknown)
    truths = () if meaning is None else meaning(a, b, c)
    truths = meanings(truths) if isinstance(truths, list) else meanings(*truths)
    frame = str(draw.choice(FRAMES[language]))
    if language == 'en' and kind in ADDED_TO and draw.random() < 0.25:
        frame = str(draw.choice(ADDED))
        truths = tuple((*truth, avoid(d)) for truth in truths)
        if d in {leaf.get('place') for truth in truths for leaf in named(truth)}:
            frame = '{s}'
            truths = tuple(truth[:-1] for truth in truths)
    text = frame.format(s=text, S=text[0].upper() + text[1:], d=names['d'])
    return Case(kind, language, template, text, tuple(Truth(clauses=truth) for truth in truths))


def named(clauses):
    """Return the regions that all but the last of some clauses name."""
    return regions_of(clauses[:-1])

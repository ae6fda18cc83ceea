"""Sentences with a name that is not on the map: names of their own, and near misses."""

import numpy as np
from language.mutations import ENGLISH, with_article

SEED = 8000
# A plural is the same name: 'the labs' where there is a lab.
SENTENCES = (
    'avoid {x}', 'go to {x}', 'visit {x}', 'do not enter {x}', 'please stay out of {x}',
    'go through {x}', 'visit {a} and then {x}', 'go to {x}, then to {a}', 'avoid {a} and {x}',
    'visit {a}, {x} and {b}', 'go to {a} but not through {x}', 'avoid {x} and visit {a}',
    'do not visit {x} before {a}', 'keep 2 m away from {x}', 'end in {x}', 'stay in {x}',
    'visit {a} or {x}', 'pass the bench on the left and avoid {x}', 'all rooms except {x}',
    'visit all blue rooms except {x}', 'avoid {x}, please', 'if possible avoid {x}',
    'visit {x} at most once', 'after {x} go to {a}', 'once you have been in {x}, avoid {a}',
    'go to {x} via {a}', 'head for {x}', '{x} is off limits', 'swing by {x}', 'steer clear of {x}',
    'go between {a} and {x}', 'avoid the north half of {x}', 'meide {x}', 'évite {x}', 'evita {x}',
    'fahr zu {x}', 'va à {x}', 've a {x}',
)  # fmt: skip
# Words for places, and parts of names, that are on no map here.
PLACES = (
    'garage', 'attic', 'ballroom', 'vault', 'sauna', 'greenhouse', 'atrium', 'foyer', 'stable',
    'cellar', 'terrace', 'boiler room', 'server room', 'waiting room', 'changing room', 'bar',
    'hangar', 'crypt', 'kiosk', 'mezzanine', 'pump house', 'paint shop', 'gate', 'ramp', 'silo',
    'bay 4', 'dock', 'zone Z', 'aisle 9', 'rack Q', 'gymnasium', 'lounge', 'balcony', 'closet',
)  # fmt: skip
ADJECTIVES = ('old', 'new', 'other', 'second', 'upper', 'small', 'former', 'red', 'guest', 'dark')
SUFFIXES = (
    'a',
    'B',
    '2',
    '-2',
    '.1',
    'x',
    '7b',
    'bis',
    ' 2',
    ' B',
    ' annex',
    ' entrance',
    ' door',
)
LETTERS = 'abcdefghijklmnopqrstuvwxyz'


def known_names():
    """Return all names on the map and their plurals, folded."""
    names = {name for place in ENGLISH.places for name in (place.name, *place.aliases)}
    return {folded(name + end) for name in names for end in ('', 's')}


def folded(name):
    """Return a name without case and spaces: 'room102' is 'room 102'."""
    return ''.join(name.casefold().split())


def invented(draw):
    """Return a name of two to four syllables, or a word for a place."""
    if draw.random() < 0.5:
        return str(draw.choice(PLACES))
    syllables = [
        f'{draw.choice(list("bcdfghklmnprstvz"))}{draw.choice(list("aeiou"))}'
        for _ in range(draw.integers(2, 5))
    ]
    return ''.join(syllables)


def near_miss(draw):
    """Return a name of the map with a change: a letter, a number, a word more or less."""
    places = list(ENGLISH.places)
    name = places[draw.integers(len(places))].name
    at = int(draw.integers(len(name)))
    match draw.integers(6):
        case 0:
            return f'{name}{draw.choice(SUFFIXES)}'
        case 1:
            return f'{draw.choice(ADJECTIVES)} {name}'
        case 2:
            return name[:at] + str(draw.choice(list(LETTERS))) + name[at + 1 :]
        case 3:
            return name[:at] + str(draw.choice(list(LETTERS))) + name[at:]
        case 4:
            return (name[:at] + name[at + 1 :]).strip()
    return f'{name.split()[0]} {draw.choice(PLACES)}'


def cases(number):
    """Yield (sentence, the name that is not on the map), always the same ones."""
    draw = np.random.default_rng(SEED)
    rooms = [place.name for place in ENGLISH.places if place.kind == 'room']
    known = known_names()
    made = 0
    while made < number:
        unknown = near_miss(draw) if draw.random() < 0.6 else invented(draw)
        if folded(unknown) in known or len(unknown) < 3:
            continue
        a, b = (rooms[index] for index in draw.permutation(len(rooms))[:2])
        names = {'a': with_article(a, 'en'), 'b': with_article(b, 'en')}
        article = '' if draw.random() < 0.15 or unknown[-1].isdigit() else 'the '
        template = str(draw.choice(SENTENCES))
        yield template.format(**names, x=article + unknown), unknown
        made += 1

"""Free sentences in the voices of different people, with their meanings (written.json).

Language models wrote them for 238 maps of their own, without sight of any code of this repository.

By a hash of its name each map is for training or locked: nothing may be tuned to the locked ones
but the limit of a claim.
"""

import json
import zlib
from functools import cache
from pathlib import Path

from language.free import Sentence
from language.judge import Truth
from language.worlds import hall_of_rooms

FILE = Path(__file__).with_name('written.json')
TRAINING, LOCKED = 0, 1


def half_of(name):
    """Return whether a map is for training or locked."""
    return TRAINING if read()['maps'][name].get('all_train') else zlib.crc32(name.encode()) % 2


@cache
def read():
    """Return the file."""
    return json.loads(FILE.read_text(encoding='utf-8'))


@cache
def worlds():
    """Return the maps by name."""
    return {
        name: hall_of_rooms(entry['rooms'], entry['objects'], entry['hall'])
        for name, entry in read()['maps'].items()
    }


def sentences(half):
    """Yield the sentences of a half."""
    for entry in read()['sentences']:
        if half_of(entry['map']) == half:
            truths = tuple(Truth(clauses=tuple(clauses)) for clauses in entry['truths'])
            yield Sentence(entry['map'], entry['language'], entry['plain'], entry['text'], truths)

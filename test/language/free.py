"""Sentences as different people would say them, on four maps, with their meanings (free.json).

They measure how much is understood. Nothing may be tuned to them.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from language.judge import Truth
from language.worlds import hall_of_rooms

FILE = Path(__file__).with_name('free.json')


@dataclass(frozen=True)
class Sentence:
    """A sentence, in plain or in free words; no truths: clauses cannot say what it means."""

    map: str
    language: str
    is_plain: bool
    text: str
    truths: tuple


@cache
def worlds():
    """Return the maps by name."""
    maps = json.loads(FILE.read_text(encoding='utf-8'))['maps']
    return {
        name: hall_of_rooms(entry['rooms'], entry['objects'], entry['hall'])
        for name, entry in maps.items()
    }


def sentences():
    """Yield all sentences."""
    for entry in json.loads(FILE.read_text(encoding='utf-8'))['sentences']:
        truths = tuple(Truth(clauses=tuple(clauses)) for clauses in entry['truths'])
        yield Sentence(entry['map'], entry['language'], entry['plain'], entry['text'], truths)

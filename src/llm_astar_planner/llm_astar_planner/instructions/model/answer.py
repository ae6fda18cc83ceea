# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The form in which a model answers, and how it becomes clauses.

It is smaller than the published one, so that small models fill it in: one object a clause, all
fields required, no strength (the words of the sentence decide it). Every clause passes the checks
of the published form.

    {"clauses": [{"do": "avoid", "where": "kitchen"},
                 {"do": "keep_distance", "from": "walls", "metres": 0.5}]}
"""

import json
import re
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions import regions
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.fields import FAR, SpecificationError
from llm_astar_planner.instructions.grammar.interpreter import languages_of, lexer_for
from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.vocabulary import KINDS
from llm_astar_planner.instructions.grammar.words import read_words
from llm_astar_planner.instructions.regions import NamedPlace, Region
from llm_astar_planner.instructions.specification import clause_from_json
from llm_astar_planner.waypoints.prompts.reply_parser import MAX_REPLY_CHARS

# Clauses of one answer; a small model that repeats itself is stopped here.
MAX_ANSWER_CLAUSES = 10
# Braces at which a JSON object is looked for in a reply with text around it.
MAX_STARTS = 16
# What a model writes for a place that the list has not.
UNKNOWN_PLACE = 'unknown'
FORMS = Path(__file__).with_name('answer_forms.json')
# The kinds with one region, in the field `where`.
_WHERE = ('avoid', 'stay_in', 'end_at', 'pass')


@dataclass(frozen=True, eq=False)
class Sentence:
    """The lexemes of a sentence in its likeliest language, with all that they mention."""

    lexemes: tuple[Lexeme, ...]
    places: Places
    written: tuple[float, ...] = ()

    @property
    def names(self) -> list[str]:
        """The names of the places that it may mean."""
        return list(dict.fromkeys(name for one in self.lexemes for name in one.names))

    @property
    def numbers(self) -> list[float]:
        """Every number that a clause may hold: as written, and in metres."""
        found = (value for lexeme in self.lexemes for value in numbers_of(lexeme))
        return [value for value in dict.fromkeys([*self.written, *found]) if abs(value) <= FAR]

    @property
    def sides(self) -> list[str]:
        """The directions that it names, in the order of SIDES."""
        found = {one.value for one in self.lexemes if one.kind in ('SIDE', 'MOST')}
        return [side for side in regions.SIDES if side in found]

    def has(self, *kinds: str) -> bool:
        """Return whether a word of one of some kinds is in it."""
        return any(lexeme.kind in kinds for lexeme in self.lexemes)


def read_sentence(text: str, places: Places) -> Sentence:
    """Find what a sentence mentions. The time grows with its length alone."""
    words = read_words(text)
    lexer = lexer_for(places, next(languages_of(words)))
    corrected, _ = lexer.corrected(words)
    written = tuple(float(word.text) for word in words if word.is_number)
    return Sentence(tuple(lexer.lexemes(corrected)), places, written)


def numbers_of(lexeme: Lexeme) -> Iterator[float]:
    """Yield the numbers of a lexeme, lengths in metres."""
    if lexeme.kind in ('LENGTH', 'NUMBER'):
        yield lexeme.number
    elif lexeme.kind == 'POINT':
        yield from lexeme.value
    elif lexeme.kind == 'AXISLINE':
        yield lexeme.value[1]
    elif lexeme.kind == 'RANGE':
        yield from (side for box in lexeme.value for side in box.sides)


class ReadReply(NamedTuple):
    """The clauses of a model's answer, and how many more could not be read."""

    clauses: tuple[Clause, ...]
    unreadable: int = 0


def answer_schema(sentence: Sentence, places: Places) -> dict[str, Any]:
    """Return the JSON schema of an answer about one sentence.

    It offers the map's names and tags, and of numbers, directions and forms only what the
    sentence has: a decoder that is constrained by it can invent neither.
    """
    # As models write them: 3 instead of 3.0.
    numbers = [int(one) if one == int(one) else one for one in sentence.numbers]
    compass = [side for side in sentence.sides if side in regions.COMPASS]
    offered = {
        'name': offered_names(sentence, places), 'tag': offered_tags(places), 'number': numbers,
        'side': sentence.sides, 'compass': compass,
    }  # fmt: skip
    known = {name for name, values in offered.items() if values}
    known |= {'no name'} - {f'no {name}' for name in known}
    known |= {f'{count} numbers' for count in (2, 4) if len(numbers) >= count}
    words = {'order': KINDS.order_words, 'between': ('BETWEEN',), 'along': ('ALONG', 'CLOSE')}
    known |= {word for word, kinds in words.items() if sentence.has(*kinds)}
    offered |= {'width': [1, *numbers], 'radius': [0, *numbers]}
    definitions: dict[str, Any] = {name: {'enum': some} for name, some in offered.items() if some}
    definitions['region'] = {'anyOf': forms_of('regions', known)}
    items = {'anyOf': forms_of('clauses', known)}
    clauses = {'type': 'array', 'maxItems': MAX_ANSWER_CLAUSES, 'items': items}
    return {**_form({'clauses': clauses}), '$defs': definitions}


def offered_names(sentence: Sentence, places: Places) -> list[str]:
    """Return the names that an answer may hold: those mentioned, or all if a word is unclear."""
    mentioned = set(sentence.names)
    # A word that is not known may be a name, or one may mean several places.
    unclear = any(one.kind == 'UNKNOWN' or len(one.names) > 1 for one in sentence.lexemes)
    names = [place.name for place in places if unclear or place.name in mentioned]
    return [*names, UNKNOWN_PLACE] if unclear else names


def offered_tags(places: Places) -> list[str]:
    """Return the kinds and tags that are no names."""
    names = {place.name.casefold() for place in places}
    return [tag for tag in places.tags if tag.casefold() not in names]


@cache
def all_forms() -> dict[str, list[dict[str, Any]]]:
    """Return all forms of clauses and regions, each with what a sentence `needs` to have it."""
    forms: dict[str, list[dict[str, Any]]] = json.loads(FORMS.read_text(encoding='utf-8'))
    return forms


def forms_of(what: str, known: Set[str]) -> list[dict[str, Any]]:
    """Return the schemas of the forms that a sentence with these words and numbers may hold."""
    found = [one for one in all_forms()[what] if known >= set(one['needs'])]
    return [one['form'] if 'form' in one else _form(one['fields']) for one in found]


def _form(properties: dict[str, Any]) -> dict[str, Any]:
    return {
        'type': 'object',
        'properties': properties,
        'required': list(properties),
        'additionalProperties': False,
    }


def read_answer(text: str, places: Places) -> ReadReply | None:
    """Read a model's reply; None where it holds no object with a list of clauses.

    A clause that cannot be read is counted and left out; the others stay.
    """
    found = find_object(text)
    items = found.get('clauses') if found is not None else None
    if not isinstance(items, list):
        return None
    read = [read_clause(item, places) for item in items[:MAX_ANSWER_CLAUSES]]
    clauses = tuple(clause for clause in read if clause is not None)
    return ReadReply(clauses, len(items) - len(clauses))


def read_clause(item: object, places: Places) -> Clause | None:
    """Return a clause of an answer, None where it cannot be read or names no known place."""
    if isinstance(item, dict) and UNKNOWN_PLACE in map(str, item.values()):
        return Unknown(text=UNKNOWN_PLACE)
    try:
        return known_places(clause_from_json(published(item), 'clause'), places)
    except SpecificationError:
        return None


def find_object(text: str) -> Mapping[str, Any] | None:
    """Return the first JSON object with clauses in a reply, None without one. Linear in time."""
    text = text[:MAX_REPLY_CHARS].rpartition('</think>')[2]
    decoder = json.JSONDecoder()
    for brace in islice(re.finditer('{', text), MAX_STARTS):
        try:
            value, _end = decoder.raw_decode(text, brace.start())
        except (ValueError, RecursionError):
            continue
        if isinstance(value, dict) and 'clauses' in value:
            return value
    return None


def published(item: object) -> object:
    """Return the published form of a clause of an answer; what is no clause stays as it is."""
    if not isinstance(item, dict) or 'do' not in item:
        return item
    own = {name: value for name, value in item.items() if name not in ('do', 'where', 'text')}
    fields = {name: published_region(value) for name, value in own.items()}
    fields['kind'] = kind = item['do']
    where = published_region(item.get('where'))
    if kind == 'visit':
        fields['regions'] = [where]
    elif kind in _WHERE:
        fields['region'] = where
    elif kind == 'unknown':
        fields['text'] = UNKNOWN_PLACE
    return fields


def published_region(value: object) -> object:
    """Return the published form of a region of an answer; what is none stays as it is."""
    if not isinstance(value, dict):
        return value
    if 'all' in value:
        return {'tag': value['all']}
    for n, axis in enumerate('xy'):
        box: list[object] = [None] * 4
        box[n], box[n + 2] = value.get(f'{axis}_above'), value.get(f'{axis}_below')
        span = value.get(f'{axis}_between')
        if isinstance(span, list) and len(span) == 2:
            box[n], box[n + 2] = in_order(span)
        if box != [None] * 4:
            return {'box': box}
    if isinstance(value.get('box'), list) and len(value['box']) == 4:
        (x0, x1), (y0, y1) = in_order(value['box'][::2]), in_order(value['box'][1::2])
        return {'box': [x0, y0, x1, y1]}
    return value


def in_order(pair: list[object]) -> list[object]:
    """Return two numbers, the lower one first; anything else as it is."""
    if all(isinstance(end, (int, float)) for end in pair):
        return sorted(pair)  # type: ignore[type-var]
    return pair


def known_places(clause: Clause, places: Places) -> Clause:
    """Return a clause with the places' own names for aliases.

    Raises SpecificationError where it has a place or a tag that the map has not.
    """
    own = {name: value for name, value in vars(clause).items() if isinstance(value, Region)}
    known: dict[str, Any] = {name: known_region(value, places) for name, value in own.items()}
    if isinstance(clause, Visit):
        known['regions'] = tuple(known_region(region, places) for region in clause.regions)
    return replace(clause, **known)


def known_region(region: Region, places: Places) -> Region:
    """Return a region with the places' own names. Raises SpecificationError for unknown ones."""
    if isinstance(region, regions.Tagged) and not places.with_tag(region.tag):
        raise SpecificationError(f'tag: no place has {region.tag!r}')
    match region:
        case NamedPlace(name) if places.get(name) is None and places.with_tag(name):
            return regions.Tagged(name)  # models write a tag where a name is asked for
        case regions.Along(regions.WALLS):
            return region
    said = {n: v for n, v in vars(region).items() if n in ('place', 'of', 'first', 'second') and v}
    return replace(region, **{field: known_name(name, places) for field, name in said.items()})


def known_name(name: str, places: Places) -> str:
    """Return a place's own name for a name or alias. Raises SpecificationError without one."""
    place = places.get(name)
    if place is None:
        raise SpecificationError(f'place: the map has no {name!r}')
    return place.name

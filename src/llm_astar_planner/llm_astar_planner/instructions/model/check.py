# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Holds a model's clauses against the sentence, by the grammar and without any model.

What the grammar reads for certain holds, whatever the model says. Of the other parts of the
sentence the model's clauses are taken: sure where the words of the part name all that the clause
holds, say its kind and whether it is refused, and every one of them is known; else with a
question. A clause of which the sentence names nothing is left out, but for one where a word is
not known. What no clause accounts for is `Unknown`.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions import regions
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import SHOULD, Clause
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.fields import MAX_NAME_CHARS, MAX_QUESTION_CHARS
from llm_astar_planner.instructions.grammar import interpreter
from llm_astar_planner.instructions.grammar.interpreter import Reading
from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.meaning import CLEAR
from llm_astar_planner.instructions.grammar.pieces import Piece
from llm_astar_planner.instructions.grammar.vocabulary import KINDS, vocabulary
from llm_astar_planner.instructions.grammar.words import read_words
from llm_astar_planner.instructions.model.answer import numbers_of
from llm_astar_planner.instructions.regions import NamedPlace, Region
from llm_astar_planner.instructions.specification import MAX_CLAUSES, MAX_VISITS, Specification

TOLERANCE = 1e-3
SAYING = {
    'visit': KINDS.says_visit, 'stay_in': KINDS.says_stay_in, 'end_at': KINDS.says_end_at,
    'pass': KINDS.says_pass, 'keep_distance': KINDS.says_keep_distance,
}  # fmt: skip


@dataclass(eq=False)
class Part:
    """A part of the sentence that the grammar did not read, with the clauses that are about it."""

    at: float
    piece: Piece
    clauses: list[Clause]

    @property
    def names(self) -> set[str]:
        """The places that it may name."""
        return {name for lexeme in self.piece.lexemes for name in lexeme.names}

    def where(self, clause: Clause) -> int:
        """Return where it names the first place of a clause, else its end."""
        names = {leaf.place for leaf in parts_of(clause) if isinstance(leaf, NamedPlace)}
        at = (n for n, lexeme in enumerate(self.piece.lexemes) if names & set(lexeme.names))
        return next(at, len(self.piece.lexemes))


def grounded(clauses: Sequence[Clause], text: str, places: Places) -> tuple[Specification, str]:
    """Return the specification of a model's clauses, and what the sentence does not say."""
    reading = interpreter.best_reading(text, places)
    if reading.interpretation.is_read:
        return reading.interpretation.specification, reading.interpretation.detail
    wanted = [usual_form(clause, places) for clause in clauses if not isinstance(clause, Unknown)]
    parts = [Part(one.at, one.piece, []) for one in reading.parts if not one.is_read]
    said = interpreter.known_visits(reading.parts)
    left = (
        one
        for one in dict.fromkeys(wanted)
        if not (isinstance(one, Visit) and set(one.regions) <= said)
    )
    deal_out(left, parts, reading)
    return put_together(reading, parts, text)


def usual_form(clause: Clause, places: Places) -> Clause:
    """Return a clause as the grammar says it: a distance from a point is a disc."""
    match clause:
        case KeepDistance(metres=metres, region=regions.Disc(x, y, radius)):
            return Avoid(clause.strength, clause.unsure, regions.Disc(x, y, metres + radius))
        case Avoid(region=regions.Disc(x, y, radius), margin=margin) if margin:
            return Avoid(clause.strength, clause.unsure, regions.Disc(x, y, radius + margin))
        case Avoid(region=NamedPlace(name), margin=0.0):
            place = places.get(name)
            if place is not None and place.is_object:
                return KeepDistance(clause.strength, clause.unsure, CLEAR, clause.region)
    return clause


def deal_out(clauses: Iterable[Clause], parts: Sequence[Part], reading: Reading) -> None:
    """Give each clause to the part that names its regions, in the order of the sentence.

    One of which nothing is named goes to a part with an unknown word and no clause, if there is
    one; a goal is never moved to a place that the sentence does not name.
    """
    known = {clause for one in reading.parts for clause in one.clauses}
    homeless = []
    for clause in clauses:
        home = next((part for part in parts if not missing(clause, part)), None)
        if home is not None:
            home.clauses.append(clause)
        elif clause.kind != 'end_at' and clause not in known:
            homeless.append(clause)
    for clause in homeless:
        strange = (part for part in parts if not part.clauses and 'UNKNOWN' in part.piece.kinds)
        home = next(strange, None)
        if home is not None and not names_read(clause, reading):
            home.clauses.append(clause)


def names_read(clause: Clause, reading: Reading) -> bool:
    """Whether a place of a clause stands in a part that the grammar read."""
    read = [one for part in reading.parts if part.is_read for one in part.clauses]
    places = {leaf for one in read for leaf in parts_of(one)}
    return bool(places & set(parts_of(clause)))


def parts_of(clause: Clause) -> list[Region]:
    """Return the simple regions of a clause."""
    return [leaf for region in clause.regions for leaf in regions.leaves(region)]


def missing(clause: Clause, part: Part) -> str:
    """Return what a clause holds and a part of the sentence does not name, '' for nothing."""
    for region in parts_of(clause):
        if not names_region(region, part):
            return region.phrase()
    numbers = {KeepDistance: 'metres', Avoid: 'margin'}.get(type(clause))
    wanted = getattr(clause, numbers) if numbers else 0.0
    if wanted and wanted != CLEAR and not has_number(wanted, part.piece.lexemes):
        return f'{wanted:g} m'
    side = getattr(clause, 'side', '')
    if side and side not in sides_of(part):
        return str(side)
    is_walls = isinstance(clause, KeepDistance) and clause.region is None
    return 'the walls' if is_walls and 'wall' not in nouns_of(part) else ''


def names_region(region: Region, part: Part) -> bool:
    """Whether a part of the sentence names a simple region."""
    lexemes = part.piece.lexemes
    values = [(lexeme.kind, lexeme.value) for lexeme in lexemes]
    is_named = True
    match region:
        case NamedPlace(name):
            is_named = name in part.names
        case regions.Tagged(tag):
            is_named = tag in tags_of(part)
        case regions.Disc(x, y, radius):
            is_named = ('POINT', (x, y)) in values and (not radius or has_number(radius, lexemes))
        case regions.Box():
            is_named = all(has_number(s, lexemes) for s in region.sides if math.isfinite(s))
        case regions.Half(side, of):
            is_named = side in sides_of(part) and {of} - {''} <= part.names
        case regions.Between(first, second):
            is_named = {first, second} <= part.names
        case regions.Along(place):
            is_named = place in part.names or 'wall' in nouns_of(part)
        case regions.End(end):
            is_named = ('ENDPOINT', end) in values
    return is_named


def sides_of(part: Part) -> set[str]:
    """Return the directions that a part names, and left for right: 'leave it on your left'."""
    found = {str(one.value) for one in part.piece.lexemes if one.kind == 'SIDE'}
    return found | set(regions.ROUTE_SIDES) if found & set(regions.ROUTE_SIDES) else found


def tags_of(part: Part) -> set[str]:
    """Return the kinds and tags that a part names."""
    found = {str(lexeme.value) for lexeme in part.piece.lexemes if lexeme.kind == 'TAG'}
    for group in (lexeme.value for lexeme in part.piece.lexemes if lexeme.kind == 'NOUN'):
        tagged, named = group.all_places, {*group.places}
        found |= {tag for tag in tagged.tags if {*tagged.with_tag(tag)} == named}
    return found


def nouns_of(part: Part) -> set[str]:
    """Return the nouns of a part for several places."""
    return {lexeme.value.noun for lexeme in part.piece.lexemes if lexeme.kind == 'NOUN'}


def has_number(value: float, lexemes: Sequence[Lexeme]) -> bool:
    """Return whether a number of some lexemes is this value."""
    found = (number for lexeme in lexemes for number in numbers_of(lexeme))
    return any(math.isclose(value, one, rel_tol=TOLERANCE, abs_tol=1e-9) for one in found)


def is_sure(clause: Clause, part: Part) -> bool:
    """Whether the words of a part say a clause, and nothing that may change it.

    It is the only one of its part, about places that are named for certain.
    """
    kinds, lexemes = part.piece.kinds, part.piece.lexemes
    strange = any(one.doubts or len(one.names) > 1 for one in lexemes) or not is_known(lexemes)
    other = part.names - {leaf.place for leaf in parts_of(clause) if isinstance(leaf, NamedPlace)}
    if strange or other or kinds & KINDS.unclear_parts or is_qualified(part.piece):
        return False
    if missing(clause, part) or len(part.clauses) > 1 or is_about_more(clause):
        return False
    if sum(lexeme.kind == 'LENGTH' for lexeme in lexemes) > isinstance(clause, KeepDistance):
        return False
    refusals = sum(lexeme.kind in KINDS.refusals_of_parts for lexeme in lexemes)
    if isinstance(clause, Avoid):
        return refusals == 1 and not kinds & KINDS.others
    says = SAYING.get(clause.kind)
    if says is None or refusals:
        return False
    others = KINDS.others - {'LENGTH'} | (KINDS.verbs - KINDS.says_visit)
    return bool(kinds & says) and not kinds & (others - says)


def is_known(lexemes: Sequence[Lexeme]) -> bool:
    """Whether all words are known, but for a verb that 'not' or nothing stands before.

    In 'never barge into A', 'bolt through A' the other words tell enough.
    """
    kinds = [lexeme.kind for lexeme in lexemes]
    led = kinds[1:] if kinds[:1] == ['NEG'] else kinds
    # What leads on from an unknown verb.
    ways = {'THROUGH', 'INTO', *(('IN',) if led is not kinds else ())}
    is_verb = led[:1] == ['UNKNOWN'] and bool(ways & set(led[1:2]))
    return 'UNKNOWN' not in (led[1:] if is_verb else kinds)


def is_qualified(piece: Piece) -> bool:
    """Whether a part says more than its words: a condition, a question, 'last', 'slowly'."""
    is_told = piece.is_broken or piece.is_question or piece.takes_back or piece.is_first
    is_noted = piece.order or piece.soon or piece.unsupported or piece.remarks
    return bool(is_told or is_noted or piece.is_strict or 'LAST' in piece.said)


def is_about_more(clause: Clause) -> bool:
    """Whether a clause is about more than places by their names, or a side of the way."""
    of_way = getattr(clause, 'side', '') in regions.ROUTE_SIDES
    return of_way or not all(isinstance(leaf, NamedPlace) for leaf in parts_of(clause))


def not_refused(clause: Clause, part: Part) -> Clause:
    """Return what is to be avoided for a visit of what a part refuses.

    It stays a question; but a robot sent where it must not go is worse than one kept out.
    """
    refusals = sum(lexeme.kind in KINDS.refusals_of_parts for lexeme in part.piece.lexemes)
    if isinstance(clause, Visit) and refusals == 1 and 'MISS' not in part.piece.kinds:
        return Avoid(clause.strength, region=clause.regions[0])
    return clause


def put_together(reading: Reading, parts: Sequence[Part], text: str) -> tuple[Specification, str]:
    """Return the specification: what the grammar read, what the model said, and what is left."""
    language = next(interpreter.languages_of(read_words(text)))
    question = vocabulary(language).questions['model']
    found = [(one.at, clause) for one in reading.parts for clause in one.clauses]
    notes = []
    for part in parts:
        piece = part.piece
        words = text[piece.start : piece.end]
        for clause in in_order(part):
            strength = SHOULD if piece.is_preference else clause.strength
            turned = replace(not_refused(clause, part), strength=strength)
            if not is_sure(clause, part):
                asked = question.replace('{said}', words).replace('{meant}', turned.phrase())
                turned = replace(turned, unsure=asked[:MAX_QUESTION_CHARS])
                lacks = missing(clause, part)
                notes += [f'the sentence does not say {lacks}'] if lacks else []
            found.append((part.at, turned))
        if not part.clauses and words:
            found.append((part.at, Unknown(text=words[:MAX_NAME_CHARS])))
    found.sort(key=lambda one: one[0])
    return within_limits([clause for _, clause in found]), '; '.join(dict.fromkeys(notes))


def in_order(part: Part) -> list[Clause]:
    """Return the clauses of a part as they stand in it; the model's where a word says one."""
    if part.piece.kinds & KINDS.limiting:
        return part.clauses
    return sorted(part.clauses, key=part.where)


def within_limits(clauses: Sequence[Clause]) -> Specification:
    """Return as many clauses as a specification may hold; the rest is not understood."""
    kept: list[Clause] = []
    visits = 0
    for clause in dict.fromkeys(clauses):
        visits += len(clause.regions) if isinstance(clause, Visit) else 0
        if len(kept) == MAX_CLAUSES - 1 or visits > MAX_VISITS:
            return Specification((*kept, Unknown(text=clause.phrase()[:MAX_NAME_CHARS])))
        kept.append(clause)
    return Specification(tuple(kept))

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Holds a model's clauses against the sentence, by the grammar and the robot's own networks.

What the grammar reads for certain holds, whatever the model says, unless the networks find it
unlikely. The model's clauses are sure where the networks, which have learnt from other sentences,
find them likely and no rule speaks against them (`reader.check`). Else what the grammar read of
parts of the sentence holds, and those of the other parts are asked about. A clause of which the
sentence names nothing is left out, but for one where a word is not known. What no clause accounts
for is `Unknown`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

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
from llm_astar_planner.instructions.grammar.meaning import CLEAR
from llm_astar_planner.instructions.grammar.pieces import Piece
from llm_astar_planner.instructions.grammar.vocabulary import KINDS, vocabulary
from llm_astar_planner.instructions.grammar.words import read_words
from llm_astar_planner.instructions.reader.check import doubt_about, is_likely
from llm_astar_planner.instructions.reader.lifting import lifted
from llm_astar_planner.instructions.reader.meaning import UNKNOWN, Unreadable
from llm_astar_planner.instructions.reader.translation import Translation
from llm_astar_planner.instructions.regions import NamedPlace, Region
from llm_astar_planner.instructions.specification import (
    MAX_CLAUSES,
    MAX_VISITS,
    Specification,
    clause_to_json,
)


@dataclass(eq=False)
class Part:
    """A part of the sentence that the grammar did not read, with the clauses that are about it."""

    at: float
    piece: Piece
    translation: Translation
    clauses: list[Clause] = field(default_factory=list)

    def where(self, clause: Clause) -> int:
        """Return where it names the first place of a clause, else its end."""
        names = {leaf.place for leaf in parts_of(clause) if isinstance(leaf, NamedPlace)}
        at = (n for n, lexeme in enumerate(self.piece.lexemes) if names & set(lexeme.names))
        return next(at, len(self.piece.lexemes))


def grounded(clauses: Sequence[Clause], text: str, places: Places) -> tuple[Specification, str]:
    """Return the specification of a model's clauses, and what the sentence does not say."""
    reading = interpreter.best_reading(text, places)
    known = reading.interpretation
    if known.is_read and is_likely(text, places, in_json(known.specification.clauses)):
        return known.specification, known.detail
    # A model does not say which of them are wishes.
    for proposed in (clauses, [replace(clause, strength=SHOULD) for clause in clauses]):
        if clauses and not doubt_about(text, places, in_json(proposed)):
            return within_limits(proposed), ''
    wanted = [usual_form(clause, places) for clause in clauses if not isinstance(clause, Unknown)]
    unread = (one for one in reading.parts if not one.is_read)
    parts = [Part(one.at, one.piece, translation(one.piece, text, places)) for one in unread]
    said = interpreter.known_visits(reading.parts)
    left = (
        one
        for one in dict.fromkeys(wanted)
        if not (isinstance(one, Visit) and set(one.regions) <= said)
    )
    deal_out(left, parts, reading)
    return put_together(reading, parts, text)


def translation(piece: Piece, text: str, places: Places) -> Translation:
    """Return what writes clauses with what a piece of a sentence names, and nothing else."""
    return Translation(lifted(text[piece.start : piece.end], places).slots, places)


def in_json(clauses: Sequence[Clause]) -> list[dict[str, Any]]:
    """Return clauses in JSON."""
    return [clause_to_json(clause) for clause in clauses]


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
    try:
        tokens = part.translation.meaning(in_json([clause]))
    except Unreadable as error:
        return str(error)
    return clause.regions[0].phrase() if UNKNOWN in tokens else ''


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
            asked = question.replace('{said}', words).replace('{meant}', turned.phrase())
            found.append((part.at, replace(turned, unsure=asked[:MAX_QUESTION_CHARS])))
            lacks = missing(clause, part)
            notes += [f'the sentence does not say {lacks}'] if lacks else []
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

"""Which words of a sentence no clause accounts for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.grammar.words import word_set
from llm_astar_planner.instructions.model.structure import STOP, Structure
from llm_astar_planner.instructions.model.vocabulary import Token, vocabulary
from llm_astar_planner.instructions.regions import Along, Between, Box, Disc, Half, Tagged

MAX_PARTS = 4
MAX_PART_CHARS = 80
# Words that ask nothing of the route by themselves.
_IDLE = word_set('fillers idle soft order any_order insist reason turn reverse verb')
_REFUSING = word_set('negator shun leave apart at_most')
_COMPARING = word_set('compare.above compare.below')
_AREAS = _COMPARING | word_set('regions.half regions.box')
_ROUTE = word_set('verb shun negator regions.walls')
# The classes of words that a clause of a kind, or a region of a form, accounts for.
_ACCOUNTED: dict[type[object], frozenset[str]] = {
    Avoid: _REFUSING | _COMPARING,
    Pass: _REFUSING | _COMPARING,
    KeepDistance: _REFUSING,
    StayIn: _REFUSING,
    Before: _REFUSING,
    Disc: word_set('regions.point'),
    Box: _AREAS,
    Half: _AREAS,
    Between: word_set('regions.between'),
    Along: word_set('regions.along regions.walls'),
    Tagged: word_set('regions.all'),
}


def unread_parts(clauses: Sequence[Clause], used: set[int], structure: Structure) -> list[str]:
    """Return the parts of the sentence that no clause accounts for, as they are written.

    `used` are the words that the clauses account for by name, number or direction.
    """
    tokens = structure.sentence.tokens
    known = accounted_labels(clauses)
    mentioned = {n for m in structure.sentence.mentions for n in m.tokens}
    optional = {
        n for m in structure.sentence.mentions if m.tags for n in m.tokens if tokens[n].labels
    }
    excused = (
        thing_words(used, structure)
        | reason_words(structure)
        | (statement_words(structure) if clauses else set())
    )
    unread = [
        n
        for n, token in enumerate(tokens)
        if (
            n not in used
            and not (token.is_break or is_read(token, known))
            and (n in mentioned or n not in excused)
        )
        or (n in mentioned - used - optional)
    ]
    return parts_of(unread, structure)


def accounted_labels(clauses: Iterable[Clause]) -> set[str]:
    """Return the classes of words that clauses account for."""
    known = set(_IDLE)
    for clause in clauses:
        known.add(f'kinds.{clause.kind}')
        for one in (clause, *clause.regions):
            known |= _ACCOUNTED.get(type(one), frozenset())
        if isinstance(clause, KeepDistance) and clause.region is None:
            known.add('regions.walls')
    return known


def is_read(token: Token, known: set[str]) -> bool:
    """Return whether a word is accounted for by its class, or counts nothing ('two', 'm')."""
    words = vocabulary()
    if token.labels & known:
        return True
    return token.text in words.units or (not token.is_number and token.text in words.numbers)


def reason_words(structure: Structure) -> set[int]:
    """Return the words of reasons: from 'because' to the end of that part of the sentence."""
    found: set[int] = set()
    inside = False
    for chunk in structure.chunks:
        if chunk.boundary == STOP:
            inside = False
        for n in chunk.tokens:
            inside = inside or 'reason' in structure.sentence.tokens[n].labels
            if inside:
                found.add(n)
        if chunk.boundary == 'comma' and 'verb' in chunk.labels and 'reason' not in chunk.labels:
            inside = False
    return found


def statement_words(structure: Structure) -> set[int]:
    """Return the words of statements ('the floor is wet'): by themselves they ask nothing."""
    return {n for chunk in structure.chunks if structure.states(chunk) for n in chunk.tokens}


def thing_words(used: set[int], structure: Structure) -> set[int]:
    """Return the words for things to carry, where the place of their verb is accounted for.

    In 'collect the mail' without a place they may stand for one.
    """
    tokens = structure.sentence.tokens
    return {
        n
        for chunk in structure.chunks
        if used & set(chunk.tokens)
        for n in chunk.tokens
        if 'things' in tokens[n].labels
    }


def parts_of(unread: Sequence[int], structure: Structure) -> list[str]:
    """Return the words in parts: those of one chunk of the sentence go together."""
    parts: list[list[int]] = []
    for n in unread:
        together = bool(parts) and any(
            n in chunk.tokens and parts[-1][-1] in chunk.tokens for chunk in structure.chunks
        )
        if together:
            parts[-1].append(n)
        else:
            parts.append([n])
    if len(parts) > MAX_PARTS:
        parts = [*parts[: MAX_PARTS - 1], [n for part in parts[MAX_PARTS - 1 :] for n in part]]
    return [structure.sentence.words(part[0], part[-1])[:MAX_PART_CHARS] for part in parts]


def says_of_route(structure: Structure) -> bool:
    """Return whether a sentence holds anything that may be about the route."""
    return bool(structure.sentence.mentions) or any(
        token.labels & _ROUTE for token in structure.sentence.tokens
    )

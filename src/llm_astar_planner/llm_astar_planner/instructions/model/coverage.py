"""Which words of a sentence no clause accounts for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from llm_astar_planner.instructions.model.structure import STOP, Structure
from llm_astar_planner.instructions.model.vocabulary import Token, vocabulary
from llm_astar_planner.instructions.specification import (
    MUST,
    Along,
    Avoid,
    Before,
    Between,
    Box,
    Clause,
    Disc,
    Half,
    KeepDistance,
    Pass,
    Region,
    StayIn,
    Tagged,
    regions_of,
)

MAX_PARTS = 4
MAX_PART_CHARS = 80
# Words that ask nothing of the route by themselves.
_IDLE = frozenset(
    [
        'fillers',
        'idle',
        'soft',
        'order',
        'any_order',
        'insist',
        'reason',
        'turn',
        'reverse',
        'verb',
    ]
)
_REFUSING = frozenset(['negator', 'shun', 'leave', 'apart', 'at_most'])
_ROUTE = frozenset(['verb', 'shun', 'negator', 'regions.walls'])
_REGION_WORDS: dict[type[Region], str] = {
    Disc: 'point', Box: 'box', Half: 'half', Between: 'between', Along: 'along', Tagged: 'all',
}  # fmt: skip


def unread_parts(clauses: Sequence[Clause], used: set[int], structure: Structure) -> list[str]:
    """Return the parts of the sentence that no clause accounts for, as they are written.

    `used` are the words that the clauses account for by name, number or direction.
    """
    tokens = structure.reading.tokens
    known = accounted_labels(clauses)
    mentioned = {n for m in structure.reading.mentions for n in m.tokens}
    optional = {
        n for m in structure.reading.mentions if m.tags for n in m.tokens if tokens[n].labels
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
        if isinstance(clause, (Avoid, KeepDistance, StayIn, Before, Pass)):
            known |= _REFUSING
        if isinstance(clause, (Pass, Avoid)):
            known |= {'compare.above', 'compare.below'}
        if isinstance(clause, KeepDistance) and clause.region is None:
            known.add('regions.walls')
        for region in regions_of(clause):
            name = _REGION_WORDS.get(type(region))
            if name:
                known.add(f'regions.{name}')
            if isinstance(region, (Box, Half)):
                known |= {'compare.above', 'compare.below', 'regions.half', 'regions.box'}
            if isinstance(region, Along):
                known.add('regions.walls')
        if clause.strength != MUST:
            known.add('soft')
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
    for piece in structure.pieces:
        if piece.boundary == STOP:
            inside = False
        for n in piece.tokens:
            inside = inside or 'reason' in structure.reading.tokens[n].labels
            if inside:
                found.add(n)
        if piece.boundary == 'comma' and 'verb' in piece.labels and 'reason' not in piece.labels:
            inside = False
    return found


def statement_words(structure: Structure) -> set[int]:
    """Return the words of statements ('the floor is wet'): by themselves they ask nothing."""
    return {n for piece in structure.pieces if structure.states(piece) for n in piece.tokens}


def thing_words(used: set[int], structure: Structure) -> set[int]:
    """Return the words for things to carry, where the wish is about a place that is accounted for.

    In 'collect the mail' without a place they may stand for one.
    """
    tokens = structure.reading.tokens
    return {
        n
        for piece in structure.pieces
        if used & set(piece.tokens)
        for n in piece.tokens
        if 'things' in tokens[n].labels
    }


def parts_of(unread: Sequence[int], structure: Structure) -> list[str]:
    """Return the words in parts: those of one piece of the sentence go together."""
    parts: list[list[int]] = []
    for n in unread:
        together = bool(parts) and any(
            n in piece.tokens and parts[-1][-1] in piece.tokens for piece in structure.pieces
        )
        if together:
            parts[-1].append(n)
        else:
            parts.append([n])
    if len(parts) > MAX_PARTS:
        parts = [*parts[: MAX_PARTS - 1], [n for part in parts[MAX_PARTS - 1 :] for n in part]]
    return [structure.reading.words(part[0], part[-1])[:MAX_PART_CHARS] for part in parts]


def says_of_route(structure: Structure) -> bool:
    """Return whether a sentence holds anything that may be about the route."""
    return bool(structure.reading.mentions) or any(
        token.labels & _ROUTE for token in structure.reading.tokens
    )

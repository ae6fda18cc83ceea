# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What an instruction says beside its clauses: reasons, remarks, and what pronouns stand for.

'They are mopping the ward, so not through there': the first part is a reason, 'there' is the
ward. A reason or remark is left out only where nothing in it could ask something of the route.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import takewhile

from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.pieces import Piece
from llm_astar_planner.instructions.grammar.vocabulary import KINDS, nouns

# Pronouns: 'it' stands for one place, 'there' and 'them' for all that were named together.
ONE = 'one'


def without_remarks(pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces with places for pronouns and without reasons and remarks.

    A reason with a place that nothing refers to makes its piece broken: who can tell what it asks.
    """
    for piece in pieces:
        shorten(piece)
    forbid_first(pieces)
    left_out = [
        piece
        for piece, before in zip(pieces, [Piece(), *pieces])
        if is_remark(piece) or gives_reason(piece, before)
    ]
    spoken = [piece for piece in pieces if piece not in left_out] or list(pieces)
    for piece in left_out:
        note_remark(piece, [*[one for one in spoken if one.start < piece.start][-1:], *spoken][0])
    kept: list[Piece] = []
    for piece in spoken:
        kept = with_antecedent(kept, piece) if 'PRONOUN' in piece.kinds else [*kept, piece]
    for piece in kept:
        piece.is_broken = piece.is_broken or piece.link == 'BECAUSE'
    return kept


def shorten(piece: Piece) -> None:
    """Leave out of a piece what is fetched from a place, and for what a place is closed."""
    kinds = [lexeme.kind for lexeme in piece.lexemes]
    first = next((n for n, kind in enumerate(kinds) if kind in ('FETCH', 'FORBIDDEN')), None)
    if first is None or 'NEG' in kinds:
        return
    if kinds[first] == 'FETCH':
        to = next((n for n, kind in enumerate(kinds) if n > first and kind in KINDS.towards), 0)
        if to and set(kinds[first + 1 : to]) <= KINDS.objects and kinds[to + 1 : to + 2]:
            fetched = piece.lexemes[first + 1 : to]
            note(piece, fetched, piece.lexemes[first + 1].start, piece.lexemes[to - 1].end)
            del piece.lexemes[first + 1 : to + 1]
    # 'Closed for cleaning', 'blocked by boxes'.
    ends = [n for n, one in enumerate(piece.lexemes) if one.kind in ('PURPOSE', 'BY')]
    after = piece.lexemes[ends[-1] + 1 :] if ends else []
    if after and {lexeme.kind for lexeme in after} <= KINDS.objects and not names_place(after):
        note(piece, after, after[0].start, after[-1].end)
        del piece.lexemes[ends[-1] :]


def note(piece: Piece, words: Sequence[Lexeme], start: int, end: int) -> None:
    """Note words that are left out beside a piece, if one is not known: it may be a place."""
    if any(lexeme.kind == 'UNKNOWN' or lexeme.doubts for lexeme in words):
        piece.remarks.append((start, end))


def note_remark(one: Piece, piece: Piece) -> None:
    """Note a remark that is left out beside a piece, if a word of it is not known."""
    note(piece, (*one.lexemes, *one.unsupported), one.start, one.end)


def forbid(piece: Piece) -> None:
    """Read a 'not' as to avoid."""
    piece.lexemes = [
        replace(one, kind='AVOID') if one.kind == 'NEG' else one for one in piece.lexemes
    ]


def forbid_first(pieces: Sequence[Piece]) -> None:
    """Read 'not A, not B' at the beginning as to avoid them, unless 'but C' corrects it."""
    for piece, after in zip(pieces, [*pieces[1:], None]):
        if piece.is_broken or piece.order or piece.link not in ('', 'COMMA', 'AND', 'HARD'):
            return
        if 'NEG' not in piece.kinds or not piece.kinds <= KINDS.naming | {'NEG', 'AND'}:
            return
        follows = after is not None and after.link != 'HARD'
        if after and follows and not after.kinds & (KINDS.verbs | {'NEG', 'REQUIRED', 'STATE'}):
            return
        forbid(piece)


def with_antecedent(before: list[Piece], piece: Piece) -> list[Piece]:
    """Return the pieces before and one with a pronoun as the place that it stands for.

    The statement that named the place is left out; where it is not clear which place is meant,
    the pronoun stays, and nobody can read its piece.
    """
    number = named_in(before)
    said = before[len(before) - number :]
    runs = [run for one in said for run in runs_of(one)]
    pronoun = next(lexeme for lexeme in piece.lexemes if lexeme.kind == 'PRONOUN')
    is_clear = len(runs) == number and all(one.link in ('AND', 'COMMA') for one in said[1:])
    is_clear = is_clear and not any(one.is_broken or 'POISON' in one.kinds for one in said)
    lexemes = [lexeme for run in runs for lexeme in (*run, Lexeme('AND', '', 0, 0))][:-1]
    is_single = sum(lexeme.kind in KINDS.region_ends for lexeme in lexemes) == 1
    if not lexemes or not is_clear or (pronoun.value == ONE and not is_single):
        return [*before, piece]
    at = piece.lexemes.index(pronoun)
    piece.lexemes[at : at + 1] = [
        replace(lexeme, start=pronoun.start, end=pronoun.end) for lexeme in lexemes
    ]
    if piece.kinds <= KINDS.naming | {'NEG', 'AND'}:
        forbid(piece)
    if not {'NEG', 'AVOID'} & piece.kinds and any('FORBIDDEN' in one.kinds for one in said):
        # 'It is closed, but go through it': nobody knows which of the two holds.
        for one in (*said, piece):
            one.is_broken = True
    for one in said:
        if is_reason(one):
            note_remark(one, piece)
    return [*before[: len(before) - number], *(one for one in said if not is_reason(one)), piece]


def named_in(before: Sequence[Piece]) -> int:
    """Return how many of the last pieces name what a pronoun after them stands for."""
    pairs = zip(before[-2::-1], before[::-1])
    joined = takewhile(
        lambda pair: pair[1].link not in ('', 'HARD') and 'STATE' in pair[0].kinds, pairs
    )
    return min(len(before), 1 + len(list(joined)))


def runs_of(piece: Piece) -> list[list[Lexeme]]:
    """Return the phrases of a piece that name places, each with its adjectives."""
    runs: list[list[Lexeme]] = [[]]
    for lexeme in piece.lexemes:
        if lexeme.kind in KINDS.naming or (lexeme.kind == 'AND' and runs[-1]):
            runs[-1].append(lexeme)
        elif runs[-1]:
            runs.append([])
    named = KINDS.region_ends - {'LENGTH', 'TIMES'}
    return [run for run in runs if any(lexeme.kind in named for lexeme in run)]


def is_reason(piece: Piece) -> bool:
    """Whether a piece only says how things are, so that its answer with a pronoun says it all."""
    kinds = [lexeme.kind for lexeme in piece.lexemes]
    if piece.is_broken or KINDS.telling & set(kinds):
        return False
    verb = next((n for n, kind in enumerate(kinds) if kind in KINDS.verbs), len(kinds))
    is_part = piece.link == 'AND' and verb == len(kinds)
    return 'STATE' in kinds[:verb] or 'FORBIDDEN' in kinds or is_part


def is_remark(piece: Piece) -> bool:
    """Whether a piece says nothing about the route: 'because it is wet', 'the battery is low'."""
    if piece.is_broken or piece.order or not piece.lexemes or names_place(piece.lexemes):
        return False
    if piece.link == 'BECAUSE':
        return bool(piece.kinds <= KINDS.of_reasons)
    return piece.kinds <= KINDS.harmless and {'STATE', 'REMARK'} <= piece.kinds


def gives_reason(piece: Piece, before: Piece) -> bool:
    """Whether it says why a place is to be avoided: 'keep out of A, they are working there'."""
    named = before.kinds & KINDS.region_ends - {'PRONOUN'}
    is_asked = bool({'NEG', 'AVOID'} & before.kinds and named)
    if not is_asked or before.is_broken or piece.is_broken or piece.link not in ('COMMA', 'COLON'):
        return False
    if 'STATE' not in piece.kinds or not piece.kinds <= KINDS.of_reasons | {'PRONOUN'}:
        return False
    is_taken_back = any(lexeme.value in KINDS.taking_back for lexeme in piece.lexemes)
    return not is_taken_back and not names_place(piece.lexemes)


def names_place(lexemes: Collection[Lexeme]) -> bool:
    """Whether an unknown word is one for places, of which the map has none."""
    known = nouns().everywhere.words
    return any(lexeme.kind == 'UNKNOWN' and lexeme.value in known for lexeme in lexemes)

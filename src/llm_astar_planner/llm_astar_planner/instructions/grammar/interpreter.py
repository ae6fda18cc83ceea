"""Understands route instructions by a grammar, without a model, in a millisecond."""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import SHOULD, Clause
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.fields import MAX_NAME_CHARS
from llm_astar_planner.instructions.grammar.lexemes import AND, COMMA, UNKNOWN
from llm_astar_planner.instructions.grammar.lexer import Lexer
from llm_astar_planner.instructions.grammar.lexicon import lexicon
from llm_astar_planner.instructions.grammar.meaning import ParsedClause, visit_of
from llm_astar_planner.instructions.grammar.parser import parse_clause
from llm_astar_planner.instructions.grammar.pieces import (
    ANYORDER,
    BUT,
    GOVERNING,
    HARD,
    INORDER,
    NEG,
    REGION_ENDS,
    THEN,
    Piece,
    Splitter,
)
from llm_astar_planner.instructions.grammar.remarks import without_remarks
from llm_astar_planner.instructions.grammar.selection import Unclear
from llm_astar_planner.instructions.grammar.vocabulary import LANGUAGES, vocabulary
from llm_astar_planner.instructions.grammar.words import Word, read_words
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    Understanding,
    not_understood,
    status_of,
)
from llm_astar_planner.instructions.regions import NamedPlace, Tagged
from llm_astar_planner.instructions.specification import MAX_CLAUSES, MAX_VISITS, Specification
from llm_astar_planner.instructions.text import InstructionError, clean_instruction

NAME = 'grammar'
QUOTED = 'not understood: "'
# A language is tried if it knows at least this share of the words that the best one knows.
WORTHWHILE = 0.5
# Languages tried of one text, and words and signs that it may have: 500 characters of brackets
# are no instruction.
MOST_LANGUAGES = 2
MOST_WORDS = 160


@dataclass(eq=False)
class ReadPiece:
    """A piece with the clauses that were read of it; none where it was not understood."""

    piece: Piece
    clauses: tuple[Clause, ...]
    segment: int

    @property
    def is_read(self) -> bool:
        """Whether it was understood."""
        return bool(self.clauses)

    def drop(self) -> None:
        """Take it as not understood."""
        self.clauses = ()


@dataclass(eq=False)
class Assembler:
    """Puts the readings of the pieces of one instruction together."""

    text: str
    lexer: Lexer
    words: Sequence[Word]
    notes: list[str]
    parts: list[ReadPiece] = field(default_factory=list)
    segments: int = 0
    previous: Clause | None = None
    is_preference_open: bool = False

    def take(self, segment: Sequence[Piece]) -> None:
        """Take the pieces between two full stops; a condition makes all of them unclear."""
        is_broken = any(
            piece.is_broken or (piece.kinds & GOVERNING and not piece.kinds & REGION_ENDS)
            for piece in segment
        )
        self.previous, self.is_preference_open = None, False
        for piece in segment:
            if not self.is_irrelevant(piece):
                clauses = () if is_broken else self.read(piece)
                self.previous = clauses[-1] if clauses else None
                self.parts.append(ReadPiece(piece, clauses, self.segments))
        self.segments += 1

    def settle(self) -> None:
        """Drop what was read only because another part was not. Then name the unknown words."""
        drop_exceptions(self.parts, self.lexer.lexicon.places)
        drop_withdrawn(self.parts)
        drop_timed(self.parts)
        drop_beside_unread(self.parts)
        self.notes += [
            f'"{lexeme.value}" is not known'
            for part in self.parts
            for lexeme in part.piece.lexemes
            if lexeme.kind == UNKNOWN and not part.is_read
        ]

    @property
    def clauses(self) -> list[tuple[int, Clause]]:
        """The clauses, each with where it stands."""
        return [(part.piece.start, clause) for part in self.parts for clause in part.clauses]

    @property
    def unknown(self) -> list[tuple[int, int]]:
        """Where the parts stand that were not understood; neighbours are one."""
        found: list[tuple[int, int]] = []
        last: ReadPiece | None = None
        for part in self.parts:
            if not part.is_read:
                is_same = last and not last.is_read and last.segment == part.segment
                start = found.pop()[0] if is_same else part.piece.start
                found.append((start, part.piece.end))
            last = part
        return found

    def is_irrelevant(self, piece: Piece) -> bool:
        """Whether all words of a piece are of phrases that say nothing about the route."""
        words, vocabulary = self.words, self.lexer.vocabulary
        at = bisect_left(words, piece.start, key=lambda word: word.start)
        found = False
        while at < len(words) and words[at].start < piece.end:
            count, _ = vocabulary.irrelevant.longest(words, at)
            found = found or count > 0
            if not count:
                count, meanings = vocabulary.phrases.longest(words, at)
                count = count if meanings and meanings[0][0][0] in ('MUST', 'ENROUTE') else 0
            if not count:
                return False
            at += count
        return found

    def read(self, piece: Piece) -> tuple[Clause, ...]:
        """Return the clauses of a piece, none where it was not read wholly."""
        if (piece.is_paced or piece.is_question) and NEG in piece.kinds:
            return ()
        try:
            clauses = self.in_flow(piece, parse_clause(piece.lexemes))
        except Unclear as reason:
            self.notes += [str(reason)] if str(reason) else []
            return ()
        self.is_preference_open = piece.preference_leads or (
            self.is_preference_open and piece.link in (AND, THEN)
        )
        if piece.is_preference or self.is_preference_open:
            clauses = tuple(replace(clause, strength=SHOULD) for clause in clauses)
        return clauses if self.has_room_for(clauses) else ()

    def in_flow(self, piece: Piece, reading: ParsedClause) -> tuple[Clause, ...]:
        """Return the clauses of a reading by what stands before it. Raises Unclear.

        'then the lab' is a visit after a visit; 'not the lab' is to be avoided after one.
        """
        clauses = reading.clauses
        in_turn = piece.link == THEN or piece.is_first
        if self.is_through_after_other(piece):
            raise Unclear('not through it, or through it')
        if reading.things:
            if not (piece.is_first or (in_turn and isinstance(self.previous, Visit))):
                raise Unclear('a place without a verb')
            clauses = (visit_of(reading.things),)
        elif reading.is_negative and not (
            isinstance(self.previous, Visit) and piece.link in (BUT, COMMA, AND)
        ):
            raise Unclear('a place without a verb')
        is_visit = all(isinstance(clause, (Visit, Before)) for clause in clauses)
        if piece.order != ANYORDER and any(map(has_repetition, clauses)):
            raise Unclear('the same place twice')
        is_after_visit = any(isinstance(clause, Visit) for _, clause in self.clauses)
        is_one = len(clauses) == 1 and (is_visit or isinstance(clauses[0], EndAt))
        if piece.is_later and not (is_one and is_after_visit):
            raise Unclear('which of them afterwards')
        if piece.is_first and is_after_visit:
            raise Unclear('first, after another visit')
        is_end = piece.link == THEN and all(isinstance(clause, EndAt) for clause in clauses)
        if (in_turn or piece.order) and not (is_visit or is_end):
            raise Unclear('only visits have an order')
        return ordered(clauses, piece.order)

    def is_through_after_other(self, piece: Piece) -> bool:
        """Whether it is the end of 'avoid A and through B'."""
        is_bare = piece.first is not None and piece.first.kind == 'THROUGH'
        is_other = self.previous is not None and not isinstance(self.previous, Visit)
        return is_bare and is_other and piece.link in (AND, COMMA)

    def has_room_for(self, clauses: Sequence[Clause]) -> bool:
        """Whether a specification may hold so many clauses and visits."""
        both = [clause for _, clause in self.clauses] + list(clauses)
        visits = sum(len(clause.regions) for clause in both if isinstance(clause, Visit))
        # Room for what is not understood.
        if len(both) < MAX_CLAUSES and visits <= MAX_VISITS:
            return True
        self.notes.append(f'more than {MAX_CLAUSES - 1} clauses or {MAX_VISITS} visits')
        return False


def has_repetition(clause: Clause) -> bool:
    """Whether it is a visit of the same region twice."""
    return isinstance(clause, Visit) and len(set(clause.regions)) < len(clause.regions)


def ordered(clauses: tuple[Clause, ...], order: str) -> tuple[Clause, ...]:
    """Return visits 'in this order' as one clause each. Raises Unclear for one in any order."""
    if order == INORDER:
        return tuple(
            replace(clause, regions=(region,))
            for clause in clauses
            if isinstance(clause, Visit)
            for region in clause.regions
        )
    if order == ANYORDER and any(len(clause.regions) < 2 for clause in clauses):  # type: ignore[attr-defined]
        raise Unclear('one place in any order')
    return clauses


def drop_exceptions(parts: Sequence[ReadPiece], places: Places) -> None:
    """Drop 'visit all rooms, not the lab': a set, and one of it that is treated otherwise."""
    for kind, other in ((Visit, Avoid), (Avoid, Visit)):
        singles = {
            name: part
            for part in parts
            if 'NOUN' not in part.piece.kinds
            for name in place_names(part, other, places)
        }
        for part in parts:
            if 'NOUN' in part.piece.kinds:
                for name in place_names(part, kind, places) & set(singles):
                    singles[name].drop()
                    part.drop()


def place_names(part: ReadPiece, kind: type[Clause], places: Places) -> set[str]:
    """Return the places that clauses of a kind, avoid or visit, name."""
    found: set[str] = set()
    for clause in part.clauses:
        if isinstance(clause, Visit) and kind is Visit:
            found |= {region.place for region in clause.regions if isinstance(region, NamedPlace)}
        elif isinstance(clause, Avoid) and kind is Avoid:
            if isinstance(clause.region, NamedPlace):
                found.add(clause.region.place)
            elif isinstance(clause.region, Tagged):
                found |= {place.name for place in places.with_tag(clause.region.tag)}
    return found


def drop_withdrawn(parts: Sequence[ReadPiece]) -> None:
    """Drop the sentence before 'no, wait', and before 'Not the lab', which is an exception."""
    for part in parts:
        if not part.is_read and part.piece.withdraws:
            for other in parts:
                if other.segment == part.segment - 1:
                    other.drop()


def drop_timed(parts: Sequence[ReadPiece]) -> None:
    """Drop what a 'then' ends: in 'stay in the hall, then visit the lab' the stay."""
    for part, after in pairwise(parts):
        ended = (StayIn, EndAt)
        is_ended = any(
            isinstance(clause, ended) if after.piece.ends_route else not isinstance(clause, Visit)
            for clause in part.clauses
        )
        if after.piece.link == THEN and is_ended:
            part.drop()


def drop_beside_unread(parts: Sequence[ReadPiece]) -> None:
    """Drop the parts that no strong boundary parts from one that was not understood."""
    for ordered_parts in (parts, parts[::-1]):
        for part, other in pairwise(ordered_parts):
            later = other if ordered_parts is parts else part
            if not part.is_read and part.segment == other.segment and not later.piece.is_apart:
                other.drop()


def understand(text: str, lexer: Lexer) -> tuple[Interpretation, float]:
    """Return what a clean text says in the words of one lexer, and the share that was read."""
    plain, quoted = without_quoted(text)
    words, notes = lexer.corrected(read_words(plain))
    language = lexer.vocabulary.language
    pieces = without_remarks(Splitter(lexer.lexemes(words), language).split())
    assembler = Assembler(text, lexer, words, notes)
    segment: list[Piece] = []
    for piece in [*pieces, Piece(HARD)]:
        if piece.link == HARD and segment:
            assembler.take(segment)
            segment = []
        segment.append(piece)
    assembler.settle()
    return result_of(assembler, quoted)


def without_quoted(text: str) -> tuple[str, list[tuple[int, int]]]:
    """Return a text without what a canonical sentence quotes, and where that stands."""
    found = []
    at = text.find(QUOTED)
    while at >= 0:
        end = text.find('"', at + len(QUOTED))
        if end < 0:
            break
        found.append((at + len(QUOTED), end))
        text = f'{text[:at]}{";" * (end + 1 - at)}{text[end + 1 :]}'
        at = text.find(QUOTED, end)
    return text, found


def result_of(
    assembler: Assembler, quoted: Sequence[tuple[int, int]]
) -> tuple[Interpretation, float]:
    """Return the interpretation, clauses and unread parts in order, and the share read."""
    text = assembler.text
    unknown = [*assembler.unknown, *quoted]
    room = MAX_CLAUSES - len(assembler.clauses)
    if len(unknown) > room:
        unknown = [*unknown[: room - 1], (unknown[room - 1][0], unknown[-1][1])]
    parts = assembler.clauses + [
        (start, Unknown(text=text[start:end][:MAX_NAME_CHARS])) for start, end in unknown
    ]
    parts.sort(key=lambda part: part[0])
    specification = Specification(tuple(clause for _, clause in parts))
    missed = sum(end - start for start, end in unknown)
    interpretation = Interpretation(
        text,
        specification,
        NAME,
        status_of(specification),
        '; '.join(dict.fromkeys(assembler.notes))[:300],
    )
    return interpretation, 1.0 - missed / max(1, len(text))


class GrammarInterpreter:
    """Understands instructions by vocabulary tables and a grammar: an Interpreter.

    It answers WHOLE or IRRELEVANT only if every word was read; of other instructions it gives the
    clauses that were read wholly, and Unknown for the rest.
    """

    name = NAME

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:  # noqa: ARG002
        """Say what was understood of a text; takes milliseconds, whatever the time limit.

        Never raises: a text that is too long is not understood.
        """
        began = time.perf_counter()
        try:
            clean = clean_instruction(text)
        except InstructionError as error:
            return not_understood(text[:80], str(error), NAME)
        if not clean:
            return Interpretation('', understood_by=NAME, status=Understanding.IRRELEVANT)
        words = read_words(clean)
        if len(words) > MOST_WORDS:
            return not_understood(clean, f'more than {MOST_WORDS} words and signs', NAME)
        best, most = not_understood(clean, '', NAME), -1.0
        for language in languages_of(words):
            understood, share = understand(clean, lexer_for(places, language))
            if share > most:
                best, most = understood, share
            if understood.is_whole:
                break
        return replace(best, seconds=time.perf_counter() - began)


@lru_cache(maxsize=64)
def lexer_for(places: Places, language: str) -> Lexer:
    """Return what reads instructions about some places in a language."""
    return Lexer(lexicon(places), vocabulary(language))


def languages_of(words: Sequence[Word]) -> Iterator[str]:
    """Yield the languages that a text may be in, the likeliest first, English where none is."""
    known = {
        language: sum(vocabulary(language).knows(word.text) for word in words if word.is_letters)
        for language in LANGUAGES
    }
    ordered = sorted(LANGUAGES, key=lambda language: -known[language])[:MOST_LANGUAGES]
    least = WORTHWHILE * known[ordered[0]]
    return (language for language in ordered if language == ordered[0] or known[language] > least)

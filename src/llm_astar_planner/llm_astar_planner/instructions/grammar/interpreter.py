# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Understands route instructions by a grammar, without a model, in a millisecond."""

from bisect import bisect_left
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import dropwhile, groupby, pairwise, takewhile
from operator import attrgetter

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import SHOULD, Clause, Clauses
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.unsupported import Unsupported
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.fields import MAX_NAME_CHARS, MAX_QUESTION_CHARS
from llm_astar_planner.instructions.grammar import meaning
from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.lexer import Lexer
from llm_astar_planner.instructions.grammar.lexicon import lexicon
from llm_astar_planner.instructions.grammar.pieces import ALL, DOUBT, NEAR, Piece, Splitter
from llm_astar_planner.instructions.grammar.remarks import without_remarks
from llm_astar_planner.instructions.grammar.selection import Unclear, unclear_if
from llm_astar_planner.instructions.grammar.spoken import with_spoken_numbers
from llm_astar_planner.instructions.grammar.vocabulary import KINDS, LANGUAGES, SAID, vocabulary
from llm_astar_planner.instructions.grammar.words import Word, read_words
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    interpreted,
    not_understood,
    status_of,
)
from llm_astar_planner.instructions.regions import AnyOf, Except, NamedPlace, Region, Tagged
from llm_astar_planner.instructions.specification import MAX_CLAUSES, MAX_VISITS, Specification

NAME = 'grammar'
# Places that a question names.
MOST_NAMED = 6
# A language is tried if it knows at least this share of the words that the best one knows.
WORTHWHILE = 0.5
# Languages tried of one text, and words and signs that it may have: 500 characters of brackets
# are no instruction.
MOST_LANGUAGES = 2
MOST_WORDS = 160


@dataclass(eq=False)
class ReadPiece:
    """A piece with the clauses that were read of it; none where it was not understood.

    `at` is its place among the others. `is_said` where others say all that it does.
    """

    piece: Piece
    clauses: Clauses
    segment: int
    at: float
    is_said: bool = False

    @property
    def is_read(self) -> bool:
        """Whether it was understood."""
        return bool(self.clauses) or self.is_said

    @property
    def visits(self) -> list[Visit]:
        """Its visits."""
        return [clause for clause in self.clauses if isinstance(clause, Visit)]

    def drop(self) -> None:
        """Take it as not understood."""
        self.clauses, self.is_said = (), False

    def ask(self, question: str, about: Collection[Clause] | None = None) -> None:
        """Make clauses unsure, all or those that it is `about`.

        `question` may have `{meant}` in place of what they say. With more questions than can be
        asked it is not understood.
        """
        try:
            self.clauses = asked(self.clauses, question, about)
        except Unclear:
            self.drop()


def asked(clauses: Clauses, question: str, about: Collection[Clause] | None = None) -> Clauses:
    """Return clauses with a question about them, but for those that claim nothing anyway.

    Raises Unclear where a clause has more questions than can be asked.
    """
    about = clauses if about is None else about
    claiming = [one for one in clauses if one in about and not isinstance(one, Unknown)]
    meant = '; '.join(clause.phrase() for clause in claiming)
    question = question.replace('{meant}', meant)[:MAX_QUESTION_CHARS]
    return tuple(
        replace(clause, unsure=both_asked(clause.unsure, question))
        if clause in claiming
        else clause
        for clause in clauses
    )


def both_asked(first: str, second: str) -> str:
    """Return two questions as one. Raises Unclear where it is too long."""
    if not first or not second or second in first:
        return first or second
    unclear_if(len(first) + len(second) >= MAX_QUESTION_CHARS, 'too many doubts')
    return f'{first} {second}'


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
    is_refusal_open: bool = False

    def take(self, segment: Sequence[Piece]) -> None:
        """Take the pieces between two full stops; a condition makes all of them unclear."""
        is_broken = any(
            piece.is_broken or (piece.lexemes and piece.kinds <= KINDS.governing)
            for piece in segment
        )
        self.previous, self.is_preference_open, self.is_refusal_open = None, False, False
        is_conditional = False
        for piece in segment:
            if not self.is_irrelevant(piece):
                is_visit = any(isinstance(clause, Visit) for _, clause in self.clauses)
                if 'INSTEAD' in piece.said and is_visit:
                    piece.is_broken = piece.takes_back = is_broken = True
                is_conditional = is_conditional and piece.link != 'BUT'
                clauses = () if is_broken or is_conditional else self.read(piece)
                self.previous = clauses[-1] if clauses else None
                part = ReadPiece(piece, clauses, self.segments, piece.start)
                self.parts.append(part)
                self.ask_about(part)
                is_conditional = is_conditional or piece.leads_a_condition
        self.segments += 1

    def settle(self) -> None:
        """Drop what was read only because another part was not. Then name the unknown words."""
        drop_exceptions(self.parts, self.lexer.lexicon.places)
        drop_withdrawn(self.parts)
        drop_timed(self.parts)
        self.put_in_order()
        self.weigh_unread()
        self.notes += [
            f'"{lexeme.value}" is not known'
            for part in self.parts
            for lexeme in part.piece.lexemes
            if lexeme.kind == 'UNKNOWN' and lexeme.value and not part.is_read
        ]

    def question(self, name: str, said: str = '', meant: str = '') -> str:
        """Return a question in the language of the instruction."""
        question = self.lexer.vocabulary.questions[name].replace('{said}', said)
        return question.replace('{meant}', meant) if meant else question

    def ask_about(self, part: ReadPiece) -> None:
        """Ask about words of a piece that may mean something else."""
        piece = part.piece
        for lexeme, named in named_by(piece):
            for said, meant in lexeme.doubts:
                found = meant or some_of(lexeme.names or [str(lexeme.value)])
                question = self.question('word' if meant else 'name', said, found)
                part.ask(question, self.clauses_about(part, lexeme, named))
        objects = self.driven_through(piece)
        for clause in part.clauses if objects else ():
            entered = entered_in(clause, self.lexer.lexicon.places)
            names = [name for name in objects if name in entered]
            if names:
                part.ask(self.question('through', some_of(names)), [clause])
        for start, end in piece.remarks:
            part.ask(self.question('remark', self.text[start:end]))
        if any(lexeme.kind == 'END' and lexeme.value == 'STOP' for lexeme in piece.lexemes):
            part.ask(self.question('stop'))

    def driven_through(self, piece: Piece) -> list[str]:
        """Return the objects, which nobody enters, that a piece says to go through or into."""
        named = [one for one in piece.lexemes if one.kind in ('PLACE', 'NOUN')]
        found: list[Lexeme] = []
        for match in SAID['entering'].finditer(self.text, piece.start, piece.end):
            # Canonical sentences say 'enter' of limits: 'enter the lathe at most 2 times'.
            is_limit = match[0].lower() == 'enter' and bool(piece.kinds & {'TIMES', 'NEG'})
            if is_limit or any(one.start <= match.start() < one.end for one in named):
                continue
            behind = (one for one in piece.lexemes if one.start >= match.start())
            rest = dropwhile(lambda one: one not in named, sorted(behind, key=attrgetter('start')))
            run = takewhile(lambda one: one.kind in KINDS.listed, rest)
            found += [one for one in run if one in named] or named
        meant = [place for one in found for place in one.places]
        return list(dict.fromkeys(place.name for place in meant if place.is_object))

    def clauses_about(self, part: ReadPiece, lexeme: Lexeme, named: Lexeme) -> list[Clause]:
        """Return the clauses of a part that a word concerns: of a place those that name it."""
        if lexeme.kind == 'UNSUPPORTED':
            return [one for one in part.clauses if isinstance(one, Unsupported)]
        places = self.lexer.lexicon.places
        tagged = places.with_tag(str(named.value)) if named.kind == 'TAG' else named.places
        names = {place.name for place in tagged}
        found = [one for one in part.clauses if names & names_of(one.to_json(), places)]
        return found or list(part.clauses)

    def put_in_order(self) -> None:
        """Put visits that 'before' and 'after' name again where they belong, once each.

        'Last' goes with no visit after it; where none is before it either, it asks.
        """
        for part in self.parts:
            others = [one for one in self.parts if one is not part]
            if len(part.visits) == 2 and part.piece.kinds & KINDS.repeating:
                order_again(part, others)
            elif part.visits and part.piece.is_first and part.piece.link == 'BUT':
                part.at = min([one.at for one in others if one.visits], default=part.at) - 0.5
            at = self.parts.index(part)
            before = self.parts[at - 1] if at else None
            if part.visits and before and before.visits and self.may_lead(before, part):
                part.ask(self.question('order', meant=f'{before.clauses[0].phrase()}, {{meant}}'))
            if 'LAST' in part.piece.said and part.visits:
                if any(one.visits and one.at > part.at for one in others):
                    part.drop()
                elif not any(one.visits for one in others) and len(part.visits) == 1:
                    part.ask(self.question('last'))

    def may_lead(self, before: ReadPiece, part: ReadPiece) -> bool:
        """Whether a place may be on the way to the one before: 'go to A and go through B'."""
        words, first = self.words_of(part.piece), self.words_of(before.piece)
        is_added = part.piece.link in ('AND', 'BUT') and before.segment == part.segment
        is_end = bool(SAID['to'].search(first)) and not SAID['through'].search(first)
        return is_added and is_end and bool(SAID['through'].search(words))

    def weigh_unread(self) -> None:
        """Drop what an unread piece may change the meaning of, and ask about what it perhaps does.

        Also of the clause before 'and visit B if you enter A' nobody knows whether it hangs on A.
        """
        around = zip([None, *self.parts], self.parts, [*self.parts[1:], None])
        unread = [one for one in around if not one[1].is_read]
        for before, part, after in unread:
            reach, said = part.piece.reach, self.said(part.piece)
            for other in self.parts if reach == ALL else (before, after):
                if other is None or other.segment != part.segment:
                    continue
                if reach in (ALL, NEAR) or (other is after and other.piece.link == 'COLON'):
                    other.drop()
                elif reach == DOUBT:
                    other.ask(self.question('rest', said))
        for part, other in pairwise(self.parts):
            is_trailing = 'ONCE' in other.piece.kinds and not other.piece.leads_a_condition
            if is_trailing and part.segment == other.segment:
                part.ask(self.question('rest', self.said(other.piece)))

    @property
    def clauses(self) -> list[tuple[float, Clause]]:
        """The clauses, each with where it stands."""
        return [(part.at, clause) for part in self.parts for clause in part.clauses]

    @property
    def unknown(self) -> list[tuple[int, int]]:
        """Where the parts stand that were not understood; neighbours are one."""
        runs = groupby(self.parts, lambda part: (part.is_read, part.segment))
        unread = [list(run) for (is_read, _), run in runs if not is_read]
        return [(run[0].piece.start, run[-1].piece.end) for run in unread]

    def is_irrelevant(self, piece: Piece) -> bool:
        """Whether all words of a piece are of phrases that say nothing about the route."""
        words, vocabulary = self.words, self.lexer.vocabulary
        at = bisect_left(words, piece.start, key=lambda word: word.start)
        found = False
        if at and words[at - 1].text in vocabulary.articles:  # 'the fine' is a name
            return False
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

    def read(self, piece: Piece) -> Clauses:
        """Return the clauses of a piece, none where it was not read wholly."""
        if (piece.is_paced or piece.is_question) and 'NEG' in piece.kinds:
            return ()
        try:
            clauses = self.clauses_of(piece)
        except Unclear as reason:
            self.notes += [str(reason)] if str(reason) else []
            return ()
        return clauses if self.has_room_for(clauses) else ()

    def clauses_of(self, piece: Piece) -> Clauses:
        """Return the clauses of a piece. Raises Unclear where it was not read wholly."""
        unsupported = self.unsupported(piece)
        if unsupported and piece.kinds <= KINDS.bare:
            return (Unsupported(text=self.words_of(piece), about=unsupported[0].about),)
        parsed = meaning.parse_clause(piece.lexemes)
        clauses = self.in_flow(piece, parsed)
        self.refuse_times(piece, clauses)
        # Of visits 'but not' is to avoid it; of what is avoided it is an exception.
        is_exception = kinds_of(clauses) <= {'visit', 'avoid', 'keep_distance'}
        unclear_if('EXCEPTNOT' in piece.kinds and not is_exception, 'but not what')
        if 'AFTERYOU' in piece.kinds and SAID['perfect'].search(self.words_of(piece)):
            visits = [clause for clause in clauses if isinstance(clause, Visit)]
            clauses += befores_of(*visits) if len(visits) == 2 else ()
        if piece.soon is not None:
            clauses, more = self.at_once(piece, piece.soon, clauses)
            unsupported += more
        if parsed.question:
            clauses = asked(clauses, self.question(parsed.question))
        goes_on = piece.link in ('AND', 'THEN')
        self.is_refusal_open = (piece.preference_leads and piece.is_refusal) or (
            self.is_refusal_open and goes_on and not piece.preference_leads
        )
        self.is_preference_open = piece.preference_leads or (self.is_preference_open and goes_on)
        if piece.is_refusal or self.is_refusal_open:
            is_sought = kinds_of(clauses) & {'visit', 'end_at', 'then', 'count'}
            unclear_if(is_sought, 'unless there is another way to what')
        if piece.is_preference or self.is_preference_open:
            clauses = tuple(replace(clause, strength=SHOULD) for clause in clauses)
        return clauses + tuple(unsupported)

    def said(self, one: Piece | Lexeme) -> str:
        """Return the words of a piece as they were said."""
        return self.text[one.start : one.end]

    def words_of(self, one: Piece | Lexeme) -> str:
        """Return the words of a piece, as many as a clause holds."""
        return self.said(one)[:MAX_NAME_CHARS]

    def unsupported(self, piece: Piece) -> list[Unsupported]:
        """Return what a piece asks that a path does not have, also what is fetched or done."""
        errands = [lexeme for lexeme in piece.lexemes if lexeme.kind == 'FETCH']
        names = self.lexer.lexicon.names.words
        for one in errands:
            said = {word.text for word in self.words if one.start <= word.start < one.end}
            unclear_if(any(len(word) > 2 for word in said & names), 'a thing or a place')
        found = [(lexeme, lexeme.value) for lexeme in piece.unsupported]
        found += [(lexeme, 'action') for lexeme in errands]
        return [Unsupported(text=self.words_of(one), about=about) for one, about in found]

    def refuse_times(self, piece: Piece, clauses: Sequence[Clause]) -> None:
        """Raise Unclear for a time at what is not only visited: 'avoid the lab before noon'."""
        is_timed = any(one.value in ('time', 'waiting') for one in piece.unsupported)
        only_visits = kinds_of(clauses) <= {'visit', 'end_at', 'before'}
        unclear_if(is_timed and not only_visits, 'at a time, or always')
        unclear_if(piece.unsupported and 'NEG' in piece.kinds, 'not so, or not at all')

    def at_once(
        self, piece: Piece, soon: Lexeme, clauses: Clauses
    ) -> tuple[Clauses, list[Unsupported]]:
        """Return clauses with 'immediately': of an order a question, else it is about time."""
        said = self.said(soon)
        is_order = piece.link == 'THEN' or bool(piece.kinds & (KINDS.order_words | {'AFTERYOU'}))
        if not is_order and soon.value != STRAIGHT:
            return clauses, [Unsupported(text=said, about='time')]
        return asked(clauses, self.question('soon', said)), []

    def in_flow(self, piece: Piece, reading: meaning.ParsedClause) -> Clauses:
        """Return the clauses of a reading by what stands before it. Raises Unclear.

        'then the lab' is a visit after a visit; 'not the lab' is to be avoided after one.
        """
        clauses = reading.clauses
        in_turn = piece.link == 'THEN' or piece.is_first
        before = next((one for _, one in self.clauses[::-1] if isinstance(one, Visit)), None)
        is_other = self.previous is not None and not isinstance(self.previous, Visit)
        is_bare = piece.first is not None and piece.first.kind == 'THROUGH'
        if is_bare and is_other and piece.link in ('AND', 'COMMA'):
            # The end of 'avoid A and through B'.
            raise Unclear('not through it, or through it')
        follows = isinstance(self.previous, Visit) and piece.link in ('BUT', 'COMMA', 'AND')
        unclear_if(reading.is_negative and not follows, 'a place without a verb')
        if reading.things:
            clauses = self.bare_visits(piece, reading.things)
        is_visit = kinds_of(clauses) <= {'visit', 'before'}
        visited = [one.regions for one in clauses if isinstance(one, Visit)]
        if piece.order != 'ANYORDER':
            unclear_if(any(len({*one}) < len(one) for one in visited), 'the same place twice')
        is_after_visit = any(isinstance(clause, Visit) for _, clause in self.clauses)
        is_one = len(clauses) == 1 and (is_visit or clauses[0].kind == 'end_at')
        is_told = kinds_of(clauses) <= {'then', 'never_after'} or (is_one and is_after_visit)
        unclear_if(piece.is_later and not is_told, 'which of them afterwards')
        is_too_late = piece.is_first and is_after_visit and piece.link != 'BUT'
        unclear_if(is_too_late, 'first, after another visit')
        unclear_if(piece.link == 'THEN' and piece.goes_on and not self.parts, 'to go on with what')
        if piece.is_first and 'BEFORE' in piece.kinds and len(clauses) == 2 and is_visit:
            clauses += befores_of(*clauses)  # type: ignore[arg-type]
        if 'LAST' in piece.said:
            clauses = last_of(piece, clauses)
        if piece.is_strict and before is not None and isinstance(clauses[0], Visit):
            clauses += befores_of(before, clauses[0])
        is_visit |= piece.link == 'THEN' and kinds_of(clauses) <= {'end_at', 'visit'}
        unclear_if((in_turn or piece.order) and not is_visit, 'only visits have an order')
        return ordered(clauses, piece.order)

    def bare_visits(self, piece: Piece, things: meaning.Things) -> Clauses:
        """Return the visit of places without a verb, 'then the lab'. Raises Unclear."""
        is_last = 'LAST' in piece.said
        goes_on = (piece.link == 'THEN' or is_last) and isinstance(self.previous, (Visit, Before))
        unclear_if(not piece.is_first and not goes_on, 'a place without a verb')
        visit = meaning.visit_of(things)
        is_again = is_last and known_visits(self.parts) & {*visit.regions}
        unclear_if(is_again, 'the same place twice')
        return (visit,)

    def has_room_for(self, clauses: Sequence[Clause]) -> bool:
        """Whether a specification may hold so many clauses and visits."""
        both = [clause for _, clause in self.clauses] + list(clauses)
        visits = sum(len(clause.regions) for clause in both if isinstance(clause, Visit))
        # Room for what is not understood.
        if len(both) < MAX_CLAUSES and visits <= MAX_VISITS:
            return True
        self.notes.append(f'more than {MAX_CLAUSES - 1} clauses or {MAX_VISITS} visits')
        return False


STRAIGHT = 'straight'


def last_of(piece: Piece, clauses: Clauses) -> Clauses:
    """Return visits with the last of 'A, B last' as one of its own. Raises Unclear for others."""
    unclear_if(not all(isinstance(clause, Visit) for clause in clauses), 'the last of what')
    *others, last = (region for clause in clauses for region in clause.regions)
    joints = [lexeme.value for lexeme in piece.lexemes if lexeme.kind == 'AND']
    if len(clauses) == 1 and others and joints[-1:] == ['COMMA']:
        return Visit(regions=tuple(others)), Visit(regions=(last,))
    return clauses


def kinds_of(clauses: Sequence[Clause]) -> set[str]:
    """Return the kinds of clauses."""
    return {clause.kind for clause in clauses}


def known_visits(parts: Sequence[ReadPiece]) -> set[Region]:
    """Return the regions that parts ask to visit."""
    return {region for part in parts for visit in part.visits for region in visit.regions}


def some_of(names: Sequence[str]) -> str:
    """Return names, some of them where they are many."""
    return ', '.join(names[:MOST_NAMED]) + (', ...' if len(names) > MOST_NAMED else '')


def entered_in(clause: Clause, places: Places) -> set[str]:
    """Return the places of which a clause says that they themselves are entered."""
    if clause.kind in ('avoid', 'keep_distance', 'pass'):
        return set()
    wholes = [
        one for one in clause.regions if isinstance(one, (NamedPlace, Tagged, Except, AnyOf))
    ]
    return set().union(*(names_of(one.to_json(), places) for one in wholes))


def named_by(piece: Piece) -> Iterator[tuple[Lexeme, Lexeme]]:
    """Yield the words of a piece, each with the noun that it belongs to, itself if to none."""
    lexemes = [*piece.lexemes, *piece.unsupported]
    for at, lexeme in enumerate(lexemes):
        noun = lexeme
        if lexeme.kind in KINDS.adjectives:
            after = (one for one in lexemes[at:] if one.kind not in KINDS.adjectives)
            noun = next(after, lexeme)
        yield lexeme, noun if noun.kind in ('PLACE', 'NOUN') else lexeme


def names_of(value: object, places: Places) -> set[str]:
    """Return the names of the places that the JSON form of a clause has, those of tags too."""
    if isinstance(value, str):
        tagged = {place.name for place in places.with_tag(value)} if value in places.tags else ()
        return {value, *tagged}
    inner = value.values() if isinstance(value, dict) else value
    if not isinstance(inner, Iterable):
        return set()
    return set().union(*(names_of(one, places) for one in inner))


def befores_of(first: Visit, second: Visit) -> Clauses:
    """Return that none of the second regions is entered before all of the first. Raises Unclear.

    What is asked about one of them is asked about the order.
    """
    unsure = both_asked(first.unsure, second.unsure)
    return tuple(
        Before(first=a, second=b, unsure=unsure) for b in second.regions for a in first.regions
    )


def order_again(part: ReadPiece, others: Sequence[ReadPiece]) -> None:
    """Leave out of two visits in order those that another piece asks for, in that order."""
    first, second = part.visits
    at = {visit.regions: one for one in others for visit in one.visits}
    early, late = at.get(first.regions), at.get(second.regions)
    if early and late and early.at >= late.at:
        part.drop()
        return
    known = [visit for visit, one in ((first, early), (second, late)) if one]
    if late and not early:
        part.at = late.at - 0.5
    kept = tuple(one for one in part.clauses if one not in known)
    try:
        is_order = late and 'BEFORE' in part.piece.kinds
        part.clauses = (*kept, *(befores_of(first, second) if is_order else ()))
    except Unclear:
        part.drop()
        return
    part.is_said = True
    # What is left out here takes its questions to where it is said.
    for one in (early, late):
        for visit in known:
            if (
                one
                and visit.unsure
                and (not part.clauses or visit.regions in [other.regions for other in one.visits])
            ):
                one.ask(visit.unsure)


def ordered(clauses: Clauses, order: str) -> Clauses:
    """Return visits 'in this order' as one clause each. Raises Unclear for one in any order."""
    if order == 'INORDER':
        return tuple(
            replace(clause, regions=(region,))
            for clause in clauses
            if isinstance(clause, Visit)
            for region in clause.regions
        )
    if order == 'ANYORDER' and any(len(clause.regions) < 2 for clause in clauses):
        raise Unclear('one place in any order')
    return clauses


def drop_exceptions(parts: Sequence[ReadPiece], places: Places) -> None:
    """Drop 'visit all rooms, not the lab': a set, and one of it that is treated otherwise."""
    for kind, other in (('visit', 'avoid'), ('avoid', 'visit')):
        sets = [part for part in parts if 'NOUN' in part.piece.kinds]
        singles = {
            name: part
            for part in parts
            if part not in sets
            for name in place_names(part, other, places)
        }
        for part in sets:
            for name in place_names(part, kind, places) & set(singles):
                singles[name].drop()
                part.drop()


def place_names(part: ReadPiece, kind: str, places: Places) -> set[str]:
    """Return the places that clauses of a kind, avoid or visit, name; of avoid those of tags."""
    regions = [one for clause in part.clauses if clause.kind == kind for one in clause.regions]
    found = {region.place for region in regions if isinstance(region, NamedPlace)}
    if kind == 'avoid':
        tags = [region.tag for region in regions if isinstance(region, Tagged)]
        found |= {place.name for tag in tags for place in places.with_tag(tag)}
    return found


def drop_withdrawn(parts: Sequence[ReadPiece]) -> None:
    """Drop the sentence before 'no, wait', and before 'Not the lab', which is an exception."""
    withdrawn = set()
    for piece, segment in ((one.piece, one.segment) for one in parts if not one.is_read):
        is_bare_not = 'NEG' in piece.kinds and not piece.kinds & KINDS.verbs
        withdrawn |= {segment - 1} if piece.takes_back or is_bare_not else set()
    for part in parts:
        if part.segment in withdrawn:
            part.drop()


def drop_timed(parts: Sequence[ReadPiece]) -> None:
    """Drop what a 'then' ends: in 'stay in the hall, then visit the lab' the stay."""
    for part, after in pairwise(parts):
        kinds = kinds_of(part.clauses)
        ended = kinds - {'visit', 'before', 'then', 'unsupported'}
        if 'END' in after.piece.kinds:
            ended = kinds & {'stay_in', 'end_at'}
        if after.piece.link == 'THEN' and ended:
            part.drop()


@dataclass(frozen=True, eq=False)
class Reading:
    """What a text says in the words of one language: the parts, and the share that was read."""

    interpretation: Interpretation
    share: float = -1.0
    parts: tuple[ReadPiece, ...] = ()


def best_reading(text: str, places: Places) -> Reading:
    """Return what a clean text says, in the language in which most of it is read."""
    best = Reading(not_understood(text, '', NAME))
    words = read_words(text)
    if len(words) > MOST_WORDS:
        return Reading(not_understood(text, f'more than {MOST_WORDS} words and signs', NAME))
    for language in languages_of(words):
        reading = understand(text, lexer_for(places, language))
        best = reading if reading.share > best.share else best
        if reading.interpretation.is_read:
            break
    return best


def understand(text: str, lexer: Lexer) -> Reading:
    """Return what a clean text says in the words of one lexer."""
    plain, quoted = without_quoted(text)
    words, notes = lexer.corrected(with_spoken_numbers(read_words(plain)))
    language = lexer.vocabulary.language
    pieces = without_remarks(Splitter(lexer.lexemes(words), language).split())
    assembler = Assembler(text, lexer, words, notes)
    begins = [n for n, piece in enumerate(pieces) if n and piece.link == 'HARD']
    for begin, end in pairwise([0, *begins, len(pieces)]):
        assembler.take(pieces[begin:end])
    assembler.settle()
    return Reading(*result_of(assembler, quoted), tuple(assembler.parts))


def without_quoted(text: str) -> tuple[str, list[tuple[int, Clause]]]:
    """Return a text without what a canonical sentence quotes, and its clauses with their place."""
    found: list[tuple[int, Clause]] = [
        (
            match.start(),
            Unsupported(text=match['words'], about=match['about'])
            if match['about']
            else Unknown(text=match['text']),
        )
        for match in SAID['canonical'].finditer(text)
    ]
    return SAID['canonical'].sub(lambda match: ';' * len(match[0]), text), found


def result_of(
    assembler: Assembler, quoted: Sequence[tuple[int, Clause]]
) -> tuple[Interpretation, float]:
    """Return the interpretation, clauses and unread parts in order, and the share read."""
    text = assembler.text
    unknown = assembler.unknown
    room = MAX_CLAUSES - len(assembler.clauses) - len(quoted)
    if len(unknown) > room:
        unknown = [*unknown[: room - 1], (unknown[room - 1][0], unknown[-1][1])]
    unread = [(start, Unknown(text=text[start:end][:MAX_NAME_CHARS])) for start, end in unknown]
    parts = sorted([*assembler.clauses, *quoted, *unread], key=lambda part: part[0])
    specification = Specification(tuple(clause for _, clause in parts))
    missed = sum(end - start for start, end in unknown)
    missed += sum(len(one.text) for _, one in quoted if isinstance(one, Unknown))
    notes = '; '.join(dict.fromkeys(assembler.notes))[:300]
    interpretation = Interpretation(text, specification, NAME, status_of(specification), notes)
    return interpretation, 1.0 - missed / max(1, len(text))


class GrammarInterpreter:
    """Understands instructions by vocabulary tables and a grammar: an Interpreter.

    It answers WHOLE, UNSURE or IRRELEVANT only if every word was read; of other instructions it
    gives the clauses that were read wholly, and Unknown for the rest.
    """

    name = NAME

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:  # noqa: ARG002
        """Say what was understood of a text; takes milliseconds, whatever the time limit.

        Never raises: a text that is too long is not understood.
        """
        return interpreted(text, NAME, lambda one: best_reading(one, places).interpretation)


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

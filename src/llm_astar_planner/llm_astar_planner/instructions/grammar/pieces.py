# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Where one clause of an instruction ends and another begins.

One pass over the lexemes: a comma or an 'and' before a region goes on with a list, before
anything else it begins a new piece. Each piece is then put into the order that the grammar reads.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, takewhile

from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.vocabulary import KINDS

# The value of 'unless there is no other way', which goes with what is refused alone.
REFUSED = 'refused'
# Values: of verbs as in 'visited', and of words that take back what stands before.
PAST, BACK, YOU, ONLY, ON, WHILE, ALWAYS = 'past', 'back', 'you', 'only', 'on', 'while', 'always'
# How far an unread piece reaches, and the kinds of words of one that reaches its neighbours.
ALL, NEAR, DOUBT = 'all', 'near', 'doubt'


def with_stops(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return lexemes with 'stop at' as a visit where the route goes on, else as its end.

    Nobody knows whether the goal is to change then; the value STOP says so.
    """
    result: list[Lexeme] = []
    goes_on = any(lexeme.kind == 'ENROUTE' for lexeme in lexemes)
    for at in range(len(lexemes) - 1, -1, -1):
        lexeme = lexemes[at]
        if lexeme.kind == 'STOP' and (at == 0 or lexemes[at - 1].kind != 'FIRST'):
            lexeme = replace(lexeme, kind='STOPBY' if goes_on else 'END', value='STOP')
        elif lexeme.kind == 'STOP':
            lexeme = replace(lexeme, kind='STOPBY')
        is_refused = at > 0 and lexemes[at - 1].kind in KINDS.governing
        goes_on = goes_on or (lexeme.kind in KINDS.goes_on and not is_refused)
        if lexeme.kind != 'ENROUTE':
            result.append(lexeme)
    return result[::-1]


def in_reading_order(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return a piece with its negation first and a verb at its end before what it governs.

    A negation of what follows an order word, 'if you do not enter A', makes it unreadable.
    """
    lexemes = with_only_after(with_times_last(lexemes))
    order = next((n for n, one in enumerate(lexemes) if one.kind in KINDS.order_words), None)
    if order is None:
        return with_visits([*negations_in(lexemes), *verb_first(without_negations(lexemes))])
    word, before, behind = lexemes[order], lexemes[:order], lexemes[order + 1 :]
    is_inner = any(lexeme.kind != 'NEG' for lexeme in before)
    if is_inner:
        head, tail = before, behind
        is_scope_clear = not negations_in(tail[:-1])
    else:
        cut = next((n for n, one in enumerate(behind) if one.kind == 'PART'), 0)
        head, tail = behind[:cut], [*before, *behind[cut:]]
        regions = [n for n, one in enumerate(behind) if one.kind in KINDS.region_ends]
        first = next((n for n, one in enumerate(behind) if one.kind == 'NEG'), len(behind))
        is_scope_clear = not negations_in(head) and (bool(before) or regions[:1] <= [first])
    negations = negations_in([*head, *tail])
    head, tail = (
        verb_first([one for one in without_negations(part) if one.kind != 'PART'])
        for part in (head, tail)
    )
    if (word.kind, word.value) == ('AFTER', YOU):
        word = replace(word, kind='AFTERYOU')  # a condition, too
    inner = [*head, word, *tail] if is_inner else [word, *head, *tail]
    unread = [] if is_scope_clear else [replace(word, kind='UNREAD')]
    return with_visits([*negations, *inner, *unread])


def with_times_last(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return 'go at most twice through A' as 'go through A at most twice'."""
    times = [lexeme for lexeme in lexemes if lexeme.kind == 'TIMES']
    if len(times) != 1 or (lexemes[0].kind == 'TIMES' and len(lexemes) > 1):
        return lexemes
    return [*(lexeme for lexeme in lexemes if lexeme.kind != 'TIMES'), *times]


def negations_in(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the negations among lexemes."""
    return [lexeme for lexeme in lexemes if lexeme.kind == 'NEG']


def without_negations(lexemes: Sequence[Lexeme]) -> list[Lexeme]:
    """Return the other lexemes."""
    return [lexeme for lexeme in lexemes if lexeme.kind != 'NEG']


def with_only_after(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return 'only enter A after B' as 'enter A only after B'."""
    kinds = [lexeme.kind for lexeme in lexemes]
    if kinds.count('ONLY') != 1 or not {'AFTER', 'ONCE'} & set(kinds):
        return lexemes
    later = {'AFTER': 'ONLYAFTER', 'ONCE': 'ONLYAFTER'}
    return [
        replace(one, kind=later.get(one.kind, one.kind)) for one in lexemes if one.kind != 'ONLY'
    ]


def verb_first(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return lexemes with a verb at their end before them: 'die Küche meiden'.

    After another verb if that governs it: 'vergiss die Küche nicht zu besuchen'.
    """
    kinds = [lexeme.kind for lexeme in lexemes]
    others = [n for n, kind in enumerate(kinds[:-1]) if kind in KINDS.verbs]
    if (
        not kinds
        or kinds[-1] not in KINDS.verbs
        or any(kinds[n] not in KINDS.governing for n in others)
    ):
        return lexemes
    at = others[-1] + 1 if others else 0
    return [*lexemes[:at], lexemes[-1], *lexemes[at:-1]]


def with_visits(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return lexemes with 'drive' and 'to' as one, but not in 'drive to the north of A'."""
    result: list[Lexeme] = []
    for at, lexeme in enumerate(lexemes):
        moves = bool(result) and result[-1].kind == 'MOVE'
        is_side = [one.kind for one in lexemes[at + 1 : at + 3]] == ['SIDE', 'OF']
        is_way = lexeme.kind in KINDS.ways and not is_side
        if moves and (is_way or lexeme.kind == 'PRONOUN'):
            result[-1] = replace(result[-1], kind='VISIT')
        if not (moves and is_way):
            result.append(lexeme)
    return result


@dataclass(eq=False)
class Piece:
    """The lexemes of one clause, and how it follows the one before.

    - `link`: '' at the beginning, else the kind of the separator before it.
    - `start`, `end`: where its words stand in the text, separators included.
    - `is_first`: it begins with 'first'. `is_preference`: it has an 'if possible';
      `preference_leads`: at the beginning; `is_refusal`: an 'unless there is no other way'.
    - `order`: it ends with 'in any order' or 'in this order'.
    - `is_paced`: it holds words that change their meaning beside a negation.
    - `is_later`: it ends with 'afterwards'.
    - `is_broken`: it holds a condition or words that make it no instruction.
    - `first`: its first lexeme as it was said.
    - `is_question`: a question mark ends it. `takes_back`: it holds 'no, wait' or the like.
    - `is_strict`: it begins with 'only then'. `goes_on`: with 'continue to'.
    - `said`: kinds of words that it holds besides: LAST, EITHER, and INSTEAD, which takes back a
      visit before it.
    - `soon`: the words for at once. `unsupported`: the words for what a path does not have.
    - `remarks`: where words stand that were left out beside it although they are not known.
    """

    link: str = ''
    lexemes: list[Lexeme] = field(default_factory=list)
    start: int = 0
    end: int = 0
    is_first: bool = False
    is_preference: bool = False
    preference_leads: bool = False
    is_refusal: bool = False
    order: str = ''
    is_broken: bool = False
    is_paced: bool = False
    is_later: bool = False
    first: Lexeme | None = None
    is_question: bool = False
    takes_back: bool = False
    is_strict: bool = False
    goes_on: bool = False
    said: set[str] = field(default_factory=set)
    soon: Lexeme | None = None
    unsupported: list[Lexeme] = field(default_factory=list)
    remarks: list[tuple[int, int]] = field(default_factory=list)

    @property
    def kinds(self) -> set[str]:
        """The kinds of its lexemes."""
        return {lexeme.kind for lexeme in self.lexemes}

    @property
    def last(self) -> str:
        """The kind of its last lexeme, '' if there is none."""
        return self.lexemes[-1].kind if self.lexemes else ''

    @property
    def is_complete(self) -> bool:
        """Whether it could end here: its last word is a region."""
        return self.last in KINDS.region_ends

    @property
    def reach(self) -> str:
        """What becomes of the others where it is not understood: ALL, NEAR, DOUBT or ''.

        A condition may govern the whole sentence (ALL); an exception, an order or a 'not' without
        a verb what is beside it (NEAR); words without a verb perhaps (DOUBT). A clause of its own
        concerns no other one.
        """
        kinds = self.kinds
        if self.is_broken or 'ONCE' in kinds:
            return ALL
        is_own = bool(kinds & (KINDS.verbs - KINDS.governing) and kinds & KINDS.region_ends)
        leads = self.first.kind if self.first else ''
        is_limiting = bool(kinds & KINDS.limiting) or self.is_refusal
        if is_limiting or leads in KINDS.positions or (kinds & KINDS.refusing and not is_own):
            return NEAR
        return '' if self.link in ('AND', 'THEN', 'BUT') or kinds & KINDS.verbs else DOUBT

    @property
    def leads_a_condition(self) -> bool:
        """Whether it begins with 'if you' and the like: what follows may be conditional, too."""
        return self.first is not None and self.first.kind == 'ONCE'

    @property
    def awaits_verb(self) -> bool:
        """Whether the next verb belongs to it: there is none yet, or an order word waits."""
        if self.lexemes and self.lexemes[0].kind in KINDS.order_words:
            return True
        return not (self.kinds & KINDS.verbs or 'THROUGH' in self.kinds)


class Splitter:
    """Splits lexemes into pieces; one instance splits one instruction."""

    def __init__(self, lexemes: Sequence[Lexeme], language: str) -> None:
        """Take the lexemes of an instruction, and its language."""
        self.lexemes = with_stops(lexemes)
        self.language = language
        self.pieces: list[Piece] = [Piece()]
        self.skipped = 0

    def split(self) -> list[Piece]:
        """Return the pieces, each in the order that the grammar reads."""
        for at, lexeme in enumerate(self.lexemes):
            # The 'no' of 'avoid A, no, B'.
            is_no = lexeme.other == 'CONDITION' and self.kind_after(at) in ('COMMA', 'HARD')
            if self.skipped:
                self.skipped -= 1
            elif lexeme.kind in KINDS.separators or is_no:
                self.separate(at, lexeme)
            elif lexeme.kind == 'OR':
                self.choose(at, lexeme)
            else:
                self.add(at, lexeme)
        if self.piece.link == 'THEN' and not self.piece.lexemes and len(self.pieces) > 1:
            self.pieces[-2].is_later = True
        filled = [p for p in self.pieces if p.lexemes or p.is_broken or p.unsupported or p.soon]
        for piece in filled:
            piece.first = piece.lexemes[0] if piece.lexemes else None
            if self.is_unclear(piece):
                piece.lexemes = [*piece.lexemes, Lexeme('UNREAD', '', piece.end, piece.end)]
            elif 'NEG' in piece.kinds or piece.is_question or is_limited(piece):
                # 'You may', 'can' give leave.
                piece.lexemes = [
                    one
                    for one in piece.lexemes
                    if one.kind != 'MAY' and (one.kind, one.value) != ('POISON', BACK)
                ]
            piece.lexemes = in_reading_order(chosen(piece.lexemes))
        return filled

    def is_unclear(self, piece: Piece) -> bool:
        """Whether the order of its words leaves open what a 'not' or a 'first' belongs to."""
        kinds = [lexeme.kind for lexeme in piece.lexemes]
        lists = [lexeme.value for lexeme in piece.lexemes if lexeme.kind == 'AND']
        ends_negated = bool(kinds) and kinds[-1] == 'NEG'
        if ends_negated and (self.language != 'de' or 'COMMA' in lists[-1:]):
            return True
        if 'EITHER' in piece.said and not piece.kinds & {'OR', 'NEG'}:
            return True
        has_past = any(one.value == PAST and one.kind in KINDS.verbs for one in piece.lexemes)
        return has_past and not piece.kinds & KINDS.order_words and 'HAVING' not in piece.kinds

    @property
    def piece(self) -> Piece:
        """The piece that grows."""
        return self.pieces[-1]

    def kind_after(self, at: int, *skipped: str) -> str:
        """Return the kind of the lexeme after one, some kinds skipped, '' at the end."""
        kinds = (lexeme.kind for lexeme in self.lexemes[at + 1 :])
        return next((kind for kind in kinds if kind not in skipped), '')

    def kinds_until(self, at: int, ends: Collection[str]) -> list[str]:
        """Return the kinds of the lexemes after one, up to one of some kinds."""
        kinds = (lexeme.kind for lexeme in self.lexemes[at + 1 :])
        return list(takewhile(lambda kind: kind not in ends, kinds))

    def begin(self, link: str) -> None:
        """Begin a new piece; a stronger link before it stays."""
        if self.piece.lexemes or self.piece.is_broken:
            self.pieces.append(Piece(link))
        elif link not in ('AND', 'COMMA') or not self.piece.link:
            self.piece.link = link if self.piece.link != 'THEN' else 'THEN'
            self.piece.is_broken = self.piece.is_broken or link == 'CONDITION'

    def extend(self, lexeme: Lexeme) -> None:
        """Add a lexeme to the piece."""
        piece = self.piece
        if not piece.end:
            piece.start = lexeme.start
        piece.lexemes.append(lexeme)
        piece.end = lexeme.end

    def separate(self, at: int, lexeme: Lexeme) -> None:
        """Take a separator: go on with a list, leave it out, or begin a new piece."""
        # 'While the lab is being cleaned' says how things are.
        told = {'FORBIDDEN', 'STATE', 'REQUIRED', 'POISON'}
        is_state = lexeme.value == WHILE and told & {*self.kinds_until(at, KINDS.separators)}
        kind = 'CONDITION' if lexeme.other == 'CONDITION' or is_state else lexeme.kind
        if lexeme.value == '?':
            self.piece.is_question = True
        is_in_tail = 'PART' in self.piece.kinds and not self.piece.is_complete
        if kind == 'THEN' and is_in_tail and not lexeme.other:
            return
        if kind == 'THEN' and self.leads_an_order() and self.piece.lexemes[0].kind != 'BEFORE':
            self.extend(Lexeme('PART', '', lexeme.start, lexeme.end))
            return
        if kind == 'BUT' and self.is_exception(at):
            is_not = self.kind_after(at) == 'NEG'
            self.extend(replace(lexeme, kind='EXCEPTNOT' if is_not else 'EXCEPT'))
            self.skipped = int(is_not)
            return
        if kind == 'CONDITION':
            self.begin(kind)
            self.piece.link = 'CONDITION'
            self.piece.is_broken = True
            self.piece.takes_back = BACK in (lexeme.value, lexeme.other_value)
            self.piece.start, self.piece.end = lexeme.start, lexeme.end
        elif kind not in ('AND', 'COMMA') or not self.is_left_out(at, kind):
            self.begin(kind)
            self.piece.is_strict = self.piece.is_strict or lexeme.value == ONLY
            self.piece.goes_on = self.piece.goes_on or lexeme.value == ON

    def is_left_out(self, at: int, kind: str) -> bool:
        """Whether a comma or 'and' ends no piece; one within a list is added to it."""
        following = self.kind_after(at, 'COMMA', 'AND')
        if following in ('THEN', 'BUT', 'OR', ''):
            return True
        if kind == 'COMMA':
            kinds = self.piece.kinds
            is_visit = bool(kinds & {'VISIT', 'THROUGH', 'STOPBY'}) and not kinds & {'NEG', 'ONLY'}
            if following == 'ONLYAFTER' and is_visit:
                self.extend(Lexeme('UNREAD', '', self.piece.end, self.piece.end))
            is_governing = bool(kinds) and kinds <= KINDS.governing
            if self.leads_an_order():
                lexeme = self.lexemes[at]
                self.extend(Lexeme('PART', '', lexeme.start, lexeme.end))
                return True
            if is_governing or (kinds and following in KINDS.trailers):
                return True
        if self.goes_on(at, following):
            return True
        if following != 'SHOULD' or kind != 'COMMA':
            return False
        # What follows an 'if possible' may be a clause of its own.
        behind = self.kind_after(at, 'COMMA', 'SHOULD')
        return behind in KINDS.separators | {''} or not self.piece.is_complete

    def is_exception(self, at: int) -> bool:
        """Whether it is the 'but' of 'all wards but ward 1', 'all wards but not ward 1'."""
        if not (self.piece.is_complete and {'ALL', 'NOUN'} <= self.piece.kinds):
            return False
        kinds = self.kinds_until(at, KINDS.separators - {'AND'})
        first = self.kind_after(at, 'NEG')
        return first in KINDS.region_starts and not KINDS.verbs & set(kinds)

    def leads_an_order(self) -> bool:
        """Whether the comma in 'before A, visit B' is at hand: it ends nothing."""
        piece = self.piece
        leads = bool(piece.lexemes) and piece.lexemes[0].kind in KINDS.order_words
        is_ended = piece.is_complete or piece.last in KINDS.verbs | {'VISITED'}
        is_named = bool(piece.kinds & KINDS.region_ends)
        return leads and is_ended and is_named and 'PART' not in piece.kinds

    def goes_on(self, at: int, following: str) -> bool:
        """Whether a comma or 'and' goes on with a list; then its lexeme is added."""
        piece, lexeme = self.piece, self.lexemes[at]
        if not piece.is_complete or piece.last == 'TIMES':
            return False
        nearest = self.kind_after(at)
        if following in KINDS.region_starts and not self.names_a_subject(at):
            is_comma = lexeme.kind == 'COMMA' and nearest != 'AND'
            kind = 'UNREAD' if is_comma and self.is_between() else 'AND'
            if following != 'LENGTH' or not self.tells_distance(at):
                self.extend(Lexeme(kind, 'COMMA' if is_comma else '', lexeme.start, lexeme.end))
            self.skipped = int(lexeme.kind == 'COMMA' and nearest == 'AND')
            return True
        is_way = nearest in ('THROUGH', 'TO', 'FROM', 'OF', 'INTO') and self.repeats(nearest)
        if not is_way or self.kind_after(at + 1, 'COMMA', 'AND') not in KINDS.region_starts:
            return False
        is_refused = 'NEG' in piece.kinds and 'AVOID' not in piece.kinds
        goes_in = nearest == 'INTO' and 'INTO' not in piece.kinds
        kind = 'UNREAD' if is_refused else nearest if goes_in else 'AND'
        self.extend(Lexeme(kind, '', lexeme.start, lexeme.end))
        self.skipped = 1
        return True

    def tells_distance(self, at: int) -> bool:
        """Whether a length after a comma is that of 'keep away from A, at least 2 m'."""
        kinds = [lexeme.kind for lexeme in self.lexemes[at + 1 :]]
        ends = kinds[1:2] in ([], ['COMMA'], ['HARD'], ['AND'])
        return 'AVOID' in self.piece.kinds and 'LENGTH' not in self.piece.kinds and ends

    def is_between(self) -> bool:
        """Whether the list is of what something lies between: of three nobody knows."""
        kinds = (lexeme.kind for lexeme in reversed(self.piece.lexemes))
        return next((kind for kind in kinds if kind in ('BETWEEN', 'AND')), '') == 'BETWEEN'

    def repeats(self, preposition: str) -> bool:
        """Whether the piece has the preposition already, in a verb or alone."""
        kinds = self.piece.kinds
        if preposition in KINDS.ways:
            return bool(kinds & {preposition, 'VISIT', 'ENTER'})
        return preposition in kinds or 'AVOID' in kinds

    def names_a_subject(self, at: int) -> bool:
        """Whether the region after a comma begins a clause: 'avoid A, B is closed'."""
        if not self.piece.kinds & (KINDS.verbs | {'THROUGH'}):
            return False
        kinds = (lexeme.kind for lexeme in self.lexemes[at + 1 :])
        return next((kind for kind in kinds if kind in KINDS.subject_ends), '') in KINDS.stated

    def choose(self, at: int, lexeme: Lexeme) -> None:
        """Take an 'or': between regions a choice, after a refusal an 'and', else a condition."""
        following = self.kind_after(at, 'COMMA', 'AND')
        piece, kinds = self.piece, self.piece.kinds
        opened = [one.kind for one in piece.lexemes]
        is_order = bool(kinds & KINDS.order_words) and 'NEG' in kinds
        is_refused = bool(kinds & {'NEG', 'AVOID', 'SKIP'}) and not is_order
        is_choice = piece.is_complete and ('EITHER' in piece.said or not is_order)
        is_region = following in KINDS.region_starts
        may_repeat = KINDS.prepositions | (set() if is_refused else {'VISIT', 'ENTER'})
        is_repeated = following in may_repeat and self.repeats(following)
        is_repeated = is_repeated and self.kind_after(at + 1) in KINDS.region_starts
        if opened.count('BRACKET') > opened.count('ENDBRACKET'):
            self.extend(lexeme)
        elif piece.last == 'FORBIDDEN' and is_region:
            self.refuse_too('AVOID', lexeme)
        elif is_choice and (is_region or is_repeated):
            self.extend(replace(lexeme, kind='AND' if is_refused else 'OR'))
            self.skipped = int(not is_region)
        elif is_choice and 'NEG' in kinds and following in KINDS.verbs | {'THROUGH'}:
            self.refuse_too('NEG', lexeme)
        else:
            self.separate(at, Lexeme('CONDITION', '', lexeme.start, lexeme.end))

    def refuse_too(self, kind: str, lexeme: Lexeme) -> None:
        """Begin a piece that refuses as the one before does."""
        self.begin('AND')
        self.extend(Lexeme(kind, '', lexeme.start, lexeme.end))

    def add(self, at: int, lexeme: Lexeme) -> None:
        """Take a word of a clause, or one that says how the clause is meant."""
        piece = self.piece
        if lexeme.kind == 'SHOULD':
            piece.preference_leads = piece.preference_leads or not piece.lexemes
            piece.is_preference = True
            piece.is_refusal = piece.is_refusal or lexeme.value == REFUSED
        elif self.notes(lexeme):
            piece.start = piece.start if piece.end else lexeme.start
            piece.end = max(piece.end, lexeme.end)
        elif lexeme.kind == 'NEED' or (lexeme.kind == 'DEGREE' and piece.last != 'NEG'):
            piece.is_paced = piece.is_paced or lexeme.kind == 'NEED'
            is_rule = lexeme.value == ALWAYS
            piece.lexemes = [
                replace(one, value=YOU) if is_rule and one.kind == 'AFTER' else one
                for one in piece.lexemes
            ]
        elif lexeme.kind == 'FIRST':
            piece.is_first = True
            if 'AND' in piece.kinds:
                self.extend(Lexeme('UNREAD', '', lexeme.start, lexeme.end))
        elif lexeme.kind == 'NONE':
            # After a 'not', as in Spanish, it is 'any of'.
            if 'NEG' not in piece.kinds:
                self.extend(replace(lexeme, kind='NEG'))
            self.extend(replace(lexeme, kind='ANY', value='any'))
        elif lexeme.kind == 'UNTIL' and not piece.lexemes:
            self.separate(at, replace(lexeme, kind='CONDITION'))
        elif lexeme.other == 'WITHOUT' and 'NEG' in piece.kinds:
            self.extend(replace(lexeme, kind='UNTIL'))
        elif self.begins_clause(at, lexeme):
            self.begin('')
            self.extend(lexeme)
        else:
            self.extend(lexeme)
        self.piece.takes_back = self.piece.takes_back or lexeme.value == BACK
        if lexeme.kind in ('SHOULD', 'FIRST', 'ANYORDER', 'INORDER'):
            is_begun = self.piece.lexemes or self.piece.end
            self.piece.start = self.piece.start if is_begun else lexeme.start
            self.piece.end = lexeme.end

    def notes(self, lexeme: Lexeme) -> bool:
        """Note how a clause is meant: 'last', 'at once', 'slowly'; whether the word is one."""
        piece = self.piece
        if lexeme.kind == 'UNSUPPORTED':
            piece.unsupported.append(lexeme)
        elif lexeme.kind == 'SOON':
            piece.soon = lexeme
        elif lexeme.kind in ('ANYORDER', 'INORDER'):
            piece.order = lexeme.kind
        elif lexeme.kind in KINDS.noted:
            piece.said.add(lexeme.kind)
        return lexeme.kind in KINDS.noted

    def begins_clause(self, at: int, lexeme: Lexeme) -> bool:
        """Whether a verb or a 'not' begins a clause although no separator stands before it."""
        piece = self.piece
        # Order words that no region follows yet, and one that leads.
        tail = takewhile(lambda one: one.kind not in KINDS.region_ends, reversed(piece.lexemes))
        is_waiting = any(one.kind in KINDS.order_words for one in (*piece.lexemes[:1], *tail))
        if not piece.is_complete or is_waiting:
            return False
        following = self.kind_after(at)
        at_end = not following or following in KINDS.separators
        if lexeme.kind == 'NEG':
            waits = piece.awaits_verb and following in KINDS.verbs
            return not ('NEG' in piece.kinds or at_end or waits)
        kinds = [one.kind for one in piece.lexemes if one.kind in KINDS.order_words | KINDS.verbs]
        # No verb followed its last order word yet: 'bevor du A | betrittst'.
        closes_an_order = bool(kinds) and kinds[-1] in KINDS.order_words
        if at_end and (closes_an_order or piece.kinds & KINDS.verbs <= KINDS.governing):
            return False
        if lexeme.kind == 'ALONG' and piece.last == 'LENGTH':
            return False
        return lexeme.kind in KINDS.verbs and not piece.awaits_verb


def is_limited(piece: Piece) -> bool:
    """Whether it says how often at most: then 'you may' is no leave but a limit."""
    return any(one.kind == 'TIMES' and one.value[1] is not None for one in piece.lexemes)


def chosen(lexemes: list[Lexeme]) -> list[Lexeme]:
    """Return lexemes with the commas of 'A, B or C' as an 'or'; 'A and B or C' stays."""
    depths = list(
        accumulate((one.kind == 'BRACKET') - (one.kind == 'ENDBRACKET') for one in lexemes)
    )
    if not any(one.kind == 'OR' and not depth for one, depth in zip(lexemes, depths)):
        return lexemes
    return [
        replace(one, kind='OR') if (one.kind, one.value, depth) == ('AND', 'COMMA', 0) else one
        for one, depth in zip(lexemes, depths)
    ]

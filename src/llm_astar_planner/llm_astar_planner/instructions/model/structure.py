"""The parts of a sentence: which words belong to one wish, and whether it is wanted or refused."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from llm_astar_planner.instructions.model.mentions import Mention, Reading
from llm_astar_planner.instructions.model.vocabulary import words_of


class Polarity(Enum):
    """Whether what is mentioned is wanted or refused, as far as the sentence tells."""

    WANTED = 'wanted'
    REFUSED = 'refused'
    UNCLEAR = 'unclear'


# How a piece is separated from the one before it.
START, STOP, TURN, COMMA, AND, OR = 'start', 'stop', 'turn', 'comma', 'and', 'or'
# Labels under which a negation or a condition is none.
_NEUTRAL = frozenset(['insist', 'soft'])


@dataclass
class Piece:
    """Words between two separations. `wish` numbers the wishes of the sentence from 0."""

    tokens: list[int]
    boundary: str
    wish: int = 0
    polarity: Polarity = Polarity.WANTED
    labels: set[str] = field(default_factory=set)

    @property
    def governs(self) -> bool:
        """Whether it has a verb or a refusal."""
        return bool(self.labels & {'verb', 'negator', 'shun'})


class Structure:
    """A sentence cut into pieces and wishes (a verb and what belongs to it)."""

    def __init__(self, reading: Reading) -> None:
        """Cut the sentence and find what is refused."""
        self.reading = reading
        self._mentioned = {index for m in reading.mentions for index in m.tokens}
        self.pieces = self._cut()
        self._piece_of = {index: piece for piece in self.pieces for index in piece.tokens}
        self._number_wishes()
        self._find_polarity()

    def piece_of(self, mention: Mention) -> Piece:
        """Return the piece in which a mention begins."""
        return self._piece_of[mention.first]

    def labels_of(self, wish: int) -> set[str]:
        """Return the classes of all words of a wish."""
        return {label for p in self.pieces if p.wish == wish for label in p.labels}

    def polarity_of(self, mention: Mention) -> Polarity:
        """Return whether a mention is wanted or refused.

        In 'take the lab not the kitchen' the refusal is of what follows it.
        """
        piece = self.piece_of(mention)
        if piece.polarity is not Polarity.REFUSED:
            return piece.polarity
        refusals = [n for n in piece.tokens if self._refuses(n)]
        verbs = [n for n in piece.tokens if 'verb' in self._labels(n) and not self._refuses(n)]
        if not refusals or mention.first > refusals[0]:
            return Polarity.REFUSED
        others = [m for m in self.reading.mentions if m.first > refusals[0] and m.names]
        follows = any(self._piece_of[m.first] is piece for m in others)
        led = any(verb < mention.first for verb in verbs)
        return Polarity.WANTED if follows and led else Polarity.REFUSED

    def _labels(self, index: int) -> set[str]:
        return self.reading.tokens[index].labels

    def _refuses(self, index: int) -> bool:
        labels = self._labels(index)
        return bool(labels & {'negator', 'shun'}) and not labels & _NEUTRAL

    def _waives(self, index: int) -> bool:
        """Return whether a word makes a wish none, or a condition: 'no need to', 'if'."""
        labels = self._labels(index)
        return 'waiver' in labels and not labels & (_NEUTRAL | {'negator'})

    def _cut(self) -> list[Piece]:
        """Cut at punctuation, 'but', 'then', and at commas and 'and' that join no numbers."""
        pieces = [Piece([], START)]
        tokens = self.reading.tokens
        for index, token in enumerate(tokens):
            boundary = self._boundary(index)
            if boundary is not None and index not in self._mentioned:
                if pieces[-1].tokens:
                    pieces.append(Piece([], boundary))
                elif boundary in (STOP, TURN):
                    pieces[-1].boundary = boundary
                elif boundary == OR and pieces[-1].boundary == COMMA:
                    pieces[-1].boundary = OR
            if not token.is_break:
                pieces[-1].tokens.append(index)
                if index not in self._mentioned and not token.labels & _NEUTRAL:
                    pieces[-1].labels |= token.labels
                else:
                    pieces[-1].labels |= token.labels & _NEUTRAL
        return [piece for piece in pieces if piece.tokens] or [Piece([], START)]

    def _boundary(self, index: int) -> str | None:
        """Return how a token separates what follows it from what goes before, None if not."""
        token = self.reading.tokens[index]
        if token.is_comma or token.text in words_of('and'):
            return None if self._joins_numbers(index) else (COMMA if token.is_comma else AND)
        if token.is_break:
            return STOP
        if token.text in words_of('or'):
            return OR
        return TURN if 'turn' in token.labels else None

    def _joins_numbers(self, index: int) -> bool:
        """Return whether numbers stand on both sides of a token."""
        around = (
            self.reading.tokens[index - 1 : index] + self.reading.tokens[index + 1 : index + 2]
        )
        return len(around) == 2 and all(token.is_number for token in around)

    def _number_wishes(self) -> None:
        """Begin a wish at each piece with a verb or a refusal, and after a stop."""
        wish, governed = 0, False
        for piece in self.pieces:
            starts = piece.boundary == STOP or (piece.governs and governed)
            if piece.boundary != START and starts:
                wish, governed = wish + 1, False
            governed = governed or piece.governs
            piece.wish = wish

    def _find_polarity(self) -> None:
        """Set the polarity of each piece by its own words, or by those of its neighbours."""
        last = Polarity.WANTED
        for n, piece in enumerate(self.pieces):
            own = self._own_polarity(piece)
            if own is None and (piece.boundary in (START, STOP)):
                own = self._polarity_ahead(n)
            if own is None and piece.boundary == TURN:
                own = self._after_turn(piece, last)
            if own is Polarity.WANTED and piece.boundary == OR and last is Polarity.REFUSED:
                own = last
            piece.polarity = last = own or last
            if self._refuses_behind(piece) and piece.boundary in (COMMA, AND, OR):
                # 'betritt das Labor und den Flur nicht': it may be of both.
                self.pieces[n - 1].polarity = Polarity.UNCLEAR
        self._follow_pronouns()
        self._leave_conditions_open()

    def _follow_pronouns(self) -> None:
        """Join a statement with the wish behind it: 'the lab is in use, so keep out of it'."""
        for n, piece in enumerate(self.pieces):
            if not (self.states(piece) and self._places_in(piece)) or 'shun' in piece.labels:
                continue
            wish = next((other for other in self.pieces[n + 1 :] if other.governs), None)
            if not wish or 'pronoun' not in wish.labels or self._places_in(wish):
                continue
            if wish.polarity is Polarity.REFUSED or 'strong.around' in wish.labels:
                piece.wish, piece.polarity = wish.wish, Polarity.REFUSED

    def _places_in(self, piece: Piece) -> bool:
        """Return whether a piece mentions a place."""
        named = (m for m in self.reading.mentions if m.names or m.tags)
        return any(m.first in piece.tokens for m in named)

    def _refuses_behind(self, piece: Piece) -> bool:
        """Return whether a piece without a verb ends with a refusal, after what it mentions."""
        if 'verb' in piece.labels or not (self._mentioned & set(piece.tokens)):
            return False
        refusals = [n for n in piece.tokens if self._refuses(n)]
        return bool(refusals) and refusals[0] > max(self._mentioned & set(piece.tokens))

    def _leave_conditions_open(self) -> None:
        """Make all of a sentence with 'if' or 'when' unclear: nobody knows whether it holds."""
        start = 0
        for n, piece in enumerate(self.pieces):
            start = n if piece.boundary == STOP else start
            conditions = (i for i in piece.tokens if 'condition' in self._labels(i))
            if any(not self._labels(i) & (_NEUTRAL | {'reverse'}) for i in conditions):
                behind = self.pieces[n + 1 :]
                stop = next((k for k, p in enumerate(behind) if p.boundary == STOP), len(behind))
                for other in self.pieces[start : n + 1 + stop]:
                    other.polarity = Polarity.UNCLEAR

    def _own_polarity(self, piece: Piece) -> Polarity | None:
        """Return the polarity that the words of a piece give it, None if they give none."""
        if any(self._waives(n) for n in piece.tokens):
            return Polarity.UNCLEAR
        negations = self._negations(piece)
        shuns = 'shun' in piece.labels
        if negations + shuns > 1:
            return Polarity.UNCLEAR
        if negations or shuns:
            return Polarity.REFUSED
        if self.states(piece):
            return Polarity.UNCLEAR
        return Polarity.WANTED if 'verb' in piece.labels else None

    def states(self, piece: Piece) -> bool:
        """Return whether a piece says how things are: 'the floor is wet' asks nothing."""
        labels = [self._labels(n) for n in piece.tokens]
        copula = next((k for k, of in enumerate(labels) if 'copula' in of), None)
        return copula is not None and not any('verb' in of for of in labels[:copula])

    def _negations(self, piece: Piece) -> int:
        """Count the negations of a piece; one of several words, or 'ne ... pas', is one."""
        words = [
            n
            for n in piece.tokens
            if 'negator' in self._labels(n)
            and 'shun' not in self._labels(n)
            and n not in self._mentioned
            and not self._labels(n) & _NEUTRAL
        ]
        full = [
            n for n in words if self.reading.tokens[n].text not in words_of('half_negation')
        ] or words[:1]
        return sum(1 for k, n in enumerate(full) if k == 0 or full[k - 1] != n - 1)

    def _polarity_ahead(self, n: int) -> Polarity | None:
        """Return the polarity of the next piece with one: 'the lab and the hall are taboo'."""
        for piece in self.pieces[n + 1 :]:
            if piece.boundary in (STOP, TURN):
                return None
            own = self._own_polarity(piece)
            if own is not None:
                return None if own is Polarity.WANTED or self._refuses_next(piece) else own
        return None

    def _refuses_next(self, piece: Piece) -> bool:
        """Return whether the refusal of a piece is of what it mentions behind it."""
        refusals = [n for n in piece.tokens if self._refuses(n)]
        return bool(refusals) and any(n > refusals[0] for n in self._mentioned & set(piece.tokens))

    def _after_turn(self, piece: Piece, last: Polarity) -> Polarity | None:
        """Return the polarity after 'but' without a verb: 'not the lab but the hall'."""
        if self.reading.tokens[piece.tokens[0]].text not in words_of('contrast'):
            return None
        return Polarity.WANTED if last is Polarity.REFUSED else Polarity.UNCLEAR

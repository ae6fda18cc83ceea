"""The predicates of a sentence, a verb and its words each, and whether they are refusals."""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass, field
from enum import Enum

from llm_astar_planner.instructions.model.mentions import Sentence
from llm_astar_planner.instructions.model.names import Mention
from llm_astar_planner.instructions.model.vocabulary import words_of


class Polarity(Enum):
    """Whether what is mentioned is wanted or refused, as far as the sentence tells."""

    WANTED = 'wanted'
    REFUSED = 'refused'
    UNCLEAR = 'unclear'


# How a chunk is separated from the one before it.
START, STOP, TURN, COMMA, AND, OR = 'start', 'stop', 'turn', 'comma', 'and', 'or'
# Labels under which a negation or a condition is none.
_NEUTRAL = frozenset(['insist', 'soft'])


@dataclass
class Chunk:
    """Words between two separations. `predicate` numbers the predicates of the sentence from 0."""

    tokens: list[int]
    boundary: str
    predicate: int = 0
    polarity: Polarity = Polarity.WANTED
    labels: set[str] = field(default_factory=set)

    @property
    def governs(self) -> bool:
        """Whether it has a verb or a refusal."""
        return bool(self.labels & {'verb', 'negator', 'shun'})


class Structure:
    """A sentence cut into chunks and predicates (a verb and what belongs to it)."""

    def __init__(self, sentence: Sentence) -> None:
        """Cut the sentence and find what is refused."""
        self.sentence = sentence
        self._mentioned = {index for m in sentence.mentions for index in m.tokens}
        self.chunks = self._cut()
        self._chunk_of = {index: chunk for chunk in self.chunks for index in chunk.tokens}
        self._number_predicates()
        self._find_polarity()

    def chunk_of(self, mention: Mention) -> Chunk:
        """Return the chunk in which a mention begins."""
        return self._chunk_of[mention.first]

    def predicates_of(self, mentions: Iterable[Mention]) -> set[int]:
        """Return the predicates that mentions belong to."""
        return {self.chunk_of(mention).predicate for mention in mentions}

    def labels_of(self, predicates: Container[int]) -> set[str]:
        """Return the classes of all words of some predicates."""
        return {label for p in self.chunks if p.predicate in predicates for label in p.labels}

    def polarity_of(self, mention: Mention) -> Polarity:
        """Return whether a mention is wanted or refused.

        In 'take the lab not the kitchen' the refusal is of what follows it.
        """
        chunk = self.chunk_of(mention)
        if chunk.polarity is not Polarity.REFUSED:
            return chunk.polarity
        refusals = [n for n in chunk.tokens if self._refuses(n)]
        verbs = [n for n in chunk.tokens if 'verb' in self._labels(n) and not self._refuses(n)]
        if not refusals or mention.first > refusals[0]:
            return Polarity.REFUSED
        others = [m for m in self.sentence.mentions if m.first > refusals[0] and m.names]
        follows = any(self._chunk_of[m.first] is chunk for m in others)
        led = any(verb < mention.first for verb in verbs)
        return Polarity.WANTED if follows and led else Polarity.REFUSED

    def _labels(self, index: int) -> set[str]:
        return self.sentence.tokens[index].labels

    def _refuses(self, index: int) -> bool:
        labels = self._labels(index)
        return bool(labels & {'negator', 'shun'}) and not labels & _NEUTRAL

    def _waives(self, index: int) -> bool:
        """Return whether a word makes a request none, or a condition: 'no need to', 'if'."""
        labels = self._labels(index)
        return 'waiver' in labels and not labels & (_NEUTRAL | {'negator'})

    def _cut(self) -> list[Chunk]:
        """Cut at punctuation, 'but', 'then', and at commas and 'and' that join no numbers."""
        chunks = [Chunk([], START)]
        tokens = self.sentence.tokens
        for index, token in enumerate(tokens):
            boundary = self._boundary(index)
            if boundary is not None and index not in self._mentioned:
                if chunks[-1].tokens:
                    chunks.append(Chunk([], boundary))
                elif boundary in (STOP, TURN):
                    chunks[-1].boundary = boundary
                elif boundary == OR and chunks[-1].boundary == COMMA:
                    chunks[-1].boundary = OR
            if not token.is_break:
                chunks[-1].tokens.append(index)
                if index not in self._mentioned and not token.labels & _NEUTRAL:
                    chunks[-1].labels |= token.labels
                else:
                    chunks[-1].labels |= token.labels & _NEUTRAL
        return [chunk for chunk in chunks if chunk.tokens] or [Chunk([], START)]

    def _boundary(self, index: int) -> str | None:
        """Return how a token separates what follows it from what goes before, None if not."""
        token = self.sentence.tokens[index]
        if token.is_comma or token.text in words_of('and'):
            return None if self._joins_numbers(index) else (COMMA if token.is_comma else AND)
        if token.is_break:
            return STOP
        if token.text in words_of('or'):
            return OR
        return TURN if 'turn' in token.labels else None

    def _joins_numbers(self, index: int) -> bool:
        """Return whether numbers stand on both sides of a token."""
        around = self.sentence.tokens[max(0, index - 1) : index + 2 : 2] if index else ()
        return len(around) == 2 and all(token.is_number for token in around)

    def _number_predicates(self) -> None:
        """Begin a predicate at each chunk with a verb or a refusal, and after a stop."""
        predicate, governed = 0, False
        for chunk in self.chunks:
            starts = chunk.boundary == STOP or (chunk.governs and governed)
            if chunk.boundary != START and starts:
                predicate, governed = predicate + 1, False
            governed = governed or chunk.governs
            chunk.predicate = predicate

    def _find_polarity(self) -> None:
        """Set the polarity of each chunk by its own words, or by those of its neighbours."""
        last = Polarity.WANTED
        for n, chunk in enumerate(self.chunks):
            own = self._own_polarity(chunk)
            if own is None and (chunk.boundary in (START, STOP)):
                own = self._polarity_ahead(n)
            if own is None and chunk.boundary == TURN:
                own = self._after_turn(chunk, last)
            if own is Polarity.WANTED and chunk.boundary == OR and last is Polarity.REFUSED:
                own = last
            chunk.polarity = last = own or last
            if self._refuses_behind(chunk) and chunk.boundary in (COMMA, AND, OR):
                # 'betritt das Labor und den Flur nicht': it may be of both.
                self.chunks[n - 1].polarity = Polarity.UNCLEAR
        self._follow_pronouns()
        self._leave_conditions_open()

    def _follow_pronouns(self) -> None:
        """Join a statement with the predicate after it: 'the lab is in use, so keep out'."""
        for n, chunk in enumerate(self.chunks):
            if not (self.states(chunk) and self._places_in(chunk)) or 'shun' in chunk.labels:
                continue
            predicate = next((other for other in self.chunks[n + 1 :] if other.governs), None)
            if not predicate or 'pronoun' not in predicate.labels or self._places_in(predicate):
                continue
            if predicate.polarity is Polarity.REFUSED or 'strong.around' in predicate.labels:
                chunk.predicate, chunk.polarity = predicate.predicate, Polarity.REFUSED

    def _places_in(self, chunk: Chunk) -> bool:
        """Return whether a chunk mentions a place."""
        named = (m for m in self.sentence.mentions if m.names or m.tags)
        return any(m.first in chunk.tokens for m in named)

    def _refuses_behind(self, chunk: Chunk) -> bool:
        """Return whether a chunk without a verb ends with a refusal, after what it mentions."""
        if 'verb' in chunk.labels or not (self._mentioned & set(chunk.tokens)):
            return False
        refusals = [n for n in chunk.tokens if self._refuses(n)]
        return bool(refusals) and refusals[0] > max(self._mentioned & set(chunk.tokens))

    def _leave_conditions_open(self) -> None:
        """Make all of a sentence with 'if' or 'when' unclear: nobody knows whether it holds."""
        start = 0
        for n, chunk in enumerate(self.chunks):
            start = n if chunk.boundary == STOP else start
            conditions = (i for i in chunk.tokens if 'condition' in self._labels(i))
            if any(not self._labels(i) & (_NEUTRAL | {'reverse'}) for i in conditions):
                behind = self.chunks[n + 1 :]
                stop = next((k for k, p in enumerate(behind) if p.boundary == STOP), len(behind))
                for other in self.chunks[start : n + 1 + stop]:
                    other.polarity = Polarity.UNCLEAR

    def _own_polarity(self, chunk: Chunk) -> Polarity | None:
        """Return the polarity that the words of a chunk give it, None if they give none."""
        if any(self._waives(n) for n in chunk.tokens):
            return Polarity.UNCLEAR
        negations = self._negations(chunk)
        shuns = 'shun' in chunk.labels
        if negations + shuns > 1:
            return Polarity.UNCLEAR
        if negations or shuns:
            return Polarity.REFUSED
        if self.states(chunk):
            return Polarity.UNCLEAR
        return Polarity.WANTED if 'verb' in chunk.labels else None

    def states(self, chunk: Chunk) -> bool:
        """Return whether a chunk says how things are: 'the floor is wet' asks nothing."""
        labels = [self._labels(n) for n in chunk.tokens]
        copula = next((k for k, of in enumerate(labels) if 'copula' in of), None)
        return copula is not None and not any('verb' in of for of in labels[:copula])

    def _negations(self, chunk: Chunk) -> int:
        """Count the negations of a chunk; one of several words, or 'ne ... pas', is one."""
        words = [
            n
            for n in chunk.tokens
            if 'negator' in self._labels(n)
            and 'shun' not in self._labels(n)
            and n not in self._mentioned
            and not self._labels(n) & _NEUTRAL
        ]
        full = [
            n for n in words if self.sentence.tokens[n].text not in words_of('half_negation')
        ] or words[:1]
        return sum(1 for k, n in enumerate(full) if k == 0 or full[k - 1] != n - 1)

    def _polarity_ahead(self, n: int) -> Polarity | None:
        """Return the polarity of the next chunk with one: 'the lab and the hall are taboo'."""
        for chunk in self.chunks[n + 1 :]:
            if chunk.boundary in (STOP, TURN):
                return None
            own = self._own_polarity(chunk)
            if own is not None:
                return None if own is Polarity.WANTED or self._refuses_next(chunk) else own
        return None

    def _refuses_next(self, chunk: Chunk) -> bool:
        """Return whether the refusal of a chunk is of what it mentions behind it."""
        refusals = [n for n in chunk.tokens if self._refuses(n)]
        return bool(refusals) and any(n > refusals[0] for n in self._mentioned & set(chunk.tokens))

    def _after_turn(self, chunk: Chunk, last: Polarity) -> Polarity | None:
        """Return the polarity after 'but' without a verb: 'not the lab but the hall'."""
        if self.sentence.tokens[chunk.tokens[0]].text not in words_of('contrast'):
            return None
        return Polarity.WANTED if last is Polarity.REFUSED else Polarity.UNCLEAR

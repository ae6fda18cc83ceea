# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Understands instructions by the small network, and is sure only where everything agrees."""

import random
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions import fields, interpretation
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.grammar.interpreter import asked
from llm_astar_planner.instructions.grammar.selection import Unclear
from llm_astar_planner.instructions.grammar.vocabulary import vocabulary
from llm_astar_planner.instructions.interpretation import Interpretation, not_understood
from llm_astar_planner.instructions.reader import meaning
from llm_astar_planner.instructions.reader.claims import doubt, strange
from llm_astar_planner.instructions.reader.lifting import SIGN, SLOTS, Lifted, lifted, slot_name
from llm_astar_planner.instructions.reader.meaning import Parts, Unreadable
from llm_astar_planner.instructions.reader.network import meanings
from llm_astar_planner.instructions.specification import Specification, from_json

NAME = 'reader'
# Readings of one sentence with its slots numbered anew.
RENUMBERED = 5
# The least log probability of a claim, calibrated on sentences that were locked; that of a
# reading at all, and the share of the readings that have to agree on it.
CLAIMED, READ, AGREED = -0.4, -2.0, 0.5
LONGEST = 64
# Words that may name a place the map does not have; each is tried as one.
MOST_STRANGE = 8
Names = Mapping[str, str]


@dataclass(frozen=True)
class Vote:
    """What most variants of a sentence mean: clauses, the share of them, the least score."""

    clauses: tuple[Parts, ...]
    share: float
    score: float


def vote(one: Lifted) -> Vote:
    """Return what most variants of a sentence mean."""
    found: list[tuple[tuple[Parts, ...], float]] = []
    variants = sorted(variants_of(one), key=lambda pair: len(pair[0]))
    for _, group in groupby(variants, key=lambda pair: len(pair[0])):
        sentences, names = zip(*group)
        for mine, (tokens, score) in zip(names, meanings(sentences, names)):
            back = {shown: name for name, shown in mine.items()}
            found.append((meaning.ordered([back.get(token, token) for token in tokens]), score))
    (best, count), *_ = Counter(clauses for clauses, _ in found).most_common(1)
    return Vote(best, count / len(found), min(score for one, score in found if one == best))


def variants_of(one: Lifted) -> Iterator[tuple[Sequence[str], Names]]:
    """Yield the tokens of a sentence in several ways, each with the names of its slots."""
    tokens, same = one.tokens, {name: name for name in one.slots}
    yield tokens, same
    yield ('please', ',', *tokens), same
    yield tuple(word for word in tokens if word != ',') or tokens, same
    yield tokens[:-1] if tokens[-1] in '.!' and tokens[1:] else (*tokens, '.'), same
    draw = random.Random(0)  # noqa: S311 - no secret
    for _ in range(RENUMBERED if one.slots else 0):
        names: dict[str, str] = {}
        for kind, most in SLOTS.items():
            mine = [name for name in one.slots if name[0] == kind]
            numbers = draw.sample(range(1, most + 1), len(mine))
            names |= {name: f'{kind}{n}' for name, n in zip(mine, numbers)}
        yield tuple(shown(token, names) for token in tokens), names


def shown(token: str, names: Names) -> str:
    """Return a token with the number of its slot by other names."""
    return token if token[0] != SIGN else token[:2] + names[slot_name(token)][1:]


class ReaderInterpreter:
    """Understands instructions by a small network: an Interpreter.

    WHOLE only where all variants of the sentence are read alike, the network is sure and the
    rules of `claims` find no doubt; else UNSURE, with a question, or NONE.
    """

    name = NAME

    def interpret(self, text: str, places: Places, time_limit: float) -> Interpretation:  # noqa: ARG002
        """Say what was understood of a text; takes some milliseconds. Never raises."""
        return interpretation.interpreted(text, NAME, lambda one: read_or_not(one, places))


def read_or_not(text: str, places: Places) -> Interpretation:
    """Return what is read in a clean text, with the reason where nothing is."""
    try:
        return read(text, places)
    except (Unreadable, fields.SpecificationError, Unclear) as error:
        return not_understood(text, str(error), NAME)


def read(text: str, places: Places) -> Interpretation:
    """Return what the network reads in a clean text. Raises Unreadable or SpecificationError."""
    one = lifted(text, places)
    if not 0 < len(one.tokens) <= LONGEST:
        raise Unreadable(f'more than {LONGEST} words')
    best = vote(one)
    if not best.clauses or best.share < AGREED or best.score < READ:
        raise Unreadable('nothing that is read for certain')
    about = {
        str(lexeme.value): text[lexeme.start : lexeme.end][: fields.MAX_NAME_CHARS]
        for lexeme in one.lexemes
        if lexeme.kind == 'UNSUPPORTED'
    }
    writer = meaning.Writer(one.slots, {'': text[: fields.MAX_NAME_CHARS], **about})
    found = from_json({'version': 2, 'clauses': [writer.clause(part) for part in best.clauses]})
    reason = '' if best.share == 1.0 and best.score >= CLAIMED else 'not all readings agree'
    reason = reason or doubt(one, best.clauses, writer.used) or unnamed(one)
    if reason:
        question = vocabulary(one.language).questions['model']
        said = text[: fields.MAX_QUESTION_CHARS // 3]
        if all(isinstance(clause, Unknown) for clause in found.clauses):
            raise Unreadable(reason)
        found = Specification(asked(found.clauses, question.replace('{said}', said)))
    return Interpretation(text, found, NAME, interpretation.status_of(found), reason)


def unnamed(one: Lifted) -> str:
    """Return a word that would be read as a place if the map had it, '' for none."""
    found = strange(one)
    new = f'R{sum(name[0] == "R" for name in one.slots) + 1}'
    if new not in meaning.TOKENS or len(found) > MOST_STRANGE:
        return 'too many words that nobody knows'
    probes = [(*one.tokens[:at], f'@{new}', *one.tokens[at + 1 :]) for at in found]
    names = {name: name for name in (*one.slots, new)}
    read_as = meanings(probes, [names] * len(probes)) if probes else []
    named = (one.tokens[at] for at, (tokens, _) in zip(found, read_as) if new in tokens)
    return next((f'"{word}" is not on the map' for word in named), '')

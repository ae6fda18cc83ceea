"""Sentences for the training: made ones, and those of people with noise, in batches."""

from __future__ import annotations

import itertools
import random
from collections.abc import Mapping, Sequence

from llm_astar_planner.instructions.reader.lifting import SIGN, SLOTS, slot_name
from llm_astar_planner.instructions.reader.meaning import (
    TOKENS,
    Unreadable,
    ordered,
    told_in_turn,
)

from llm_astar_reader.generate import demanded, made, noisy
from llm_astar_reader.mutate import wrong

Words = list[str]
# A sentence with its meanings: those that are right, or a right one and wrong ones.
Sample = tuple[Words, list[Words]]
KNOWN = frozenset(TOKENS)
BATCH, ROUND, LONGEST, MOST_TOKENS = 128, 9_600, 44, 28
GREETED = (['please', ','], ['bitte'], ['ok', ','], ['robot', ','], ['hey', ','], ['so', ','])
JOINTS = (['.'], ['.'], [','], [';'], ['and'], [',', 'and'], ['.', 'oh', ',', 'and'])


def renumbered(tokens: Words, meanings: list[Words], draw: random.Random) -> Sample | None:
    """Return a sentence and meanings with slots numbered anew; None where it has too many."""
    names = list(dict.fromkeys(slot_name(token) for token in tokens if token[0] == SIGN))
    table: dict[str, str] = {}
    is_in_turn = draw.random() < 0.4
    for kind, most in SLOTS.items():
        mine = [name for name in names if name[0] == kind]
        if len(mine) > most:
            return None
        # In order of mention, as they come in use, or in any order.
        numbers: Sequence[int] = draw.sample(range(1, most + 1), len(mine))
        if is_in_turn:
            numbers = range(1, len(mine) + 1)
        table |= {name: f'{kind}{n}' for name, n in zip(mine, numbers)}
    shown = [t if t[0] != SIGN else t[:2] + table[slot_name(t)][1:] for t in tokens]
    return shown, [[table.get(token, token) for token in meaning] for meaning in meanings]


def sample(
    draw: random.Random,
    human: list[Sample],
    share: float,
    wrongs: int,
    misread: Mapping[tuple[str, ...], list[Words]],
) -> Sample | None:
    """Return a sentence with a right meaning and some wrong ones: made, or a person's."""
    if human and draw.random() < share:
        tokens, rights = draw.choice(human)
        mistaken = misread.get(tuple(tokens), [])
        if draw.random() < 0.12:
            mistaken = []
            tokens, rights = joined(tokens, rights, *draw.choice(human), draw)
        tokens = noisy([t for t in tokens if t != ',' or draw.random() > 0.2], draw)
        if draw.random() < 0.15:
            tokens = [*draw.choice(GREETED), *tokens]
        if tokens and tokens[-1] == '.' and draw.random() < 0.5:
            tokens = tokens[:-1]
    else:
        tokens, meaning = made(draw)
        rights, mistaken = [meaning], []
    right = draw.choice(rights)
    if not 0 < len(tokens) <= LONGEST or len(right) > MOST_TOKENS or not {*right} <= KNOWN:
        return None
    try:
        right = told_in_turn(tokens, right)
        known = {ordered(meaning) for meaning in rights}
    except Unreadable:
        return None
    meanings = [right]
    for n in range(wrongs):
        # What readers have really taken it for, once in two times.
        is_real = mistaken and n == 0 and draw.random() < 0.5
        other = draw.choice(mistaken) if is_real else wrong(tokens, right, draw)
        if other is None or ordered(other) in known:
            return None
        meanings.append(told_in_turn(tokens, other))
    return renumbered(tokens, meanings, draw)


def joined(
    tokens: Words, rights: list[Words], others: Words, theirs: list[Words], draw: random.Random
) -> Sample:
    """Return two sentences as one, the first alone where nobody knows what both would mean."""
    mine, more = rights[0], theirs[0]
    if not mine or not more or ('V' in mine and 'V' in more) or ('S' in mine and 'S' in more):
        return tokens, rights
    most = dict.fromkeys(SLOTS, 0)
    for token in tokens:
        if token[0] == SIGN:
            name = slot_name(token)
            most[name[0]] = max(most[name[0]], int(name[1:]))
    names = {
        name: f'{name[0]}{int(name[1:]) + most[name[0]]}'
        for token in others
        if token[0] == SIGN
        for name in [slot_name(token)]
    }
    if any(int(name[1:]) > SLOTS[name[0]] for name in names.values()):
        return tokens, rights
    shown = [t if t[0] != SIGN else t[:2] + names[slot_name(t)][1:] for t in others]
    body = tokens[:-1] if tokens[-1] in '.!' else tokens
    both = [*mine, *(names.get(token, token) for token in more)]
    return [*body, *draw.choice(JOINTS), *shown], [demanded(both)]


def batches(
    draw: random.Random,
    human: list[Sample],
    share: float,
    wrongs: int,
    misread: Mapping[tuple[str, ...], list[Words]],
) -> list[list[Sample]]:
    """Return batches of sentences of one length each."""
    found = [one for _ in range(ROUND) if (one := sample(draw, human, share, wrongs, misread))]
    found.sort(key=lambda one: len(one[0]))
    parts: list[list[Sample]] = []
    for _, group in itertools.groupby(found, key=lambda one: len(one[0])):
        some = list(group)
        draw.shuffle(some)
        parts += [some[at : at + BATCH] for at in range(0, len(some), BATCH)]
    draw.shuffle(parts)
    return parts

"""Wrong meanings of a sentence, near the right one: what the checker learns to refuse.

One thing is changed: the kind of a clause, a place, the order, a side, a number, whether it is a
wish, a clause or a place too many or too few.
"""

from __future__ import annotations

import random
from collections.abc import Sequence

from llm_astar_planner.instructions.reader.lifting import SIGN, slot_name
from llm_astar_planner.instructions.reader.meaning import (
    EACH,
    NOTHING,
    ONE,
    UNKNOWN,
    WISH,
    Parts,
    Unreadable,
    flat,
    ordered,
    parsed,
)

from llm_astar_reader.generate import demanded

Words = list[str]
# Clauses of one form, of which one is taken for another.
ALIKE = (('A', 'S', 'E'), ('B', 'T', 'N'), ('P', 'PX'), ('C', 'CN'), ('CL', 'CG', 'CE'))
ASKED = ('A', 'V', 'A', 'V', 'E', 'S', 'K')
TRIES = 12


def wrong(tokens: Sequence[str], meaning: Sequence[str], draw: random.Random) -> Words | None:
    """Return a wrong meaning of a sentence; None where none was found."""
    slots = list(dict.fromkeys(slot_name(token) for token in tokens if token[0] == SIGN))
    try:
        right = ordered(meaning)
    except Unreadable:
        return None
    for _ in range(TRIES):
        parts = list(parsed(iter(meaning)))
        for _ in range(2 if draw.random() < 0.2 else 1):
            parts = draw.choice(CHANGES)(parts, slots, draw)
        found = demanded(list(flat(parts)))
        if not found and draw.random() < 0.5:
            found = [NOTHING]
        if ordered(found) != right:
            return found
    return None


def dropped(parts: list[Parts], _: Words, draw: random.Random) -> list[Parts]:
    """Leave a clause out, or one of the regions of a list."""
    if not parts:
        return parts
    at = draw.randrange(len(parts))
    kind, *inner = parts[at]
    if kind == 'V' and len(inner) > 1:
        inner.pop(draw.randrange(len(inner)))
        return replaced(parts, at, (kind, *inner))
    return [*parts[:at], *parts[at + 1 :]]


def added(parts: list[Parts], slots: Words, draw: random.Random) -> list[Parts]:
    """Put a clause in, of a region of the sentence, of one that no other names if there is any."""
    said = set(flat(parts))
    regions = [name for name in slots if name[0] == 'R']
    left = [name for name in regions if name not in said]
    region = draw.choice(left or regions or [UNKNOWN])
    kind = draw.choice(ASKED)
    inner = ((region,), ('D',)) if kind == 'K' else ((region,),)
    at = draw.randrange(len(parts) + 1)
    if kind == 'V' and draw.random() < 0.4:
        for n, part in enumerate(parts):
            if part[0] == 'V':
                return replaced(parts, n, (*part, (region,)))
    return [*parts[:at], (kind, *inner), *parts[at:]]


def rekinded(parts: list[Parts], slots: Words, draw: random.Random) -> list[Parts]:
    """Take a clause for one of another kind."""
    if not parts:
        return added(parts, slots, draw)
    at = draw.randrange(len(parts))
    return replaced(parts, at, *other_kind(parts[at], draw))


def other_kind(part: Parts, draw: random.Random) -> list[Parts]:
    """Return a clause, or two, of the same regions."""
    kind, *inner = part
    if kind == WISH:
        return [(WISH, one) for one in other_kind(inner[0], draw)][:1]
    if kind == 'V':
        new = draw.choice(('A', 'A', 'A', 'E', 'S'))
        return [(new, one[1] if one[0] == EACH else one) for one in inner]
    if kind in ('B', 'T', 'N') and draw.random() < 0.5:
        first, second = inner
        choices = (
            [('V', first), ('V', second)], [('V', second)], [('A', second)], [('V', first)],
            [('V', first), ('A', second)], [('A', first), ('V', second)], [('V', first, second)],
        )  # fmt: skip
        return draw.choice(choices)
    if kind in ('A', 'S', 'E') and draw.random() < 0.7:
        return [('V', inner[0])]
    if kind in ('K', 'P', 'PX', 'C', 'CN', 'CL', 'CG', 'CE') and draw.random() < 0.5:
        if inner[0][0] == 'WALLS':
            return []
        return [draw.choice([('A', inner[0]), ('V', inner[0])])]
    for group in ALIKE:
        if kind in group:
            return [(draw.choice([one for one in group if one != kind]), *inner)]
    return []


def turned(parts: list[Parts], slots: Words, draw: random.Random) -> list[Parts]:
    """Exchange what comes first and what later."""
    pairs = [n for n, part in enumerate(parts) if part[0] in ('B', 'T', 'N')]
    visits = [n for n, part in enumerate(parts) if part[0] == 'V']
    if pairs and (len(visits) < 2 or draw.random() < 0.6):
        at = draw.choice(pairs)
        kind, first, second = parts[at]
        return replaced(parts, at, (kind, second, first))
    if len(visits) > 1:
        one, two = draw.sample(visits, 2)
        found = list(parts)
        found[one], found[two] = found[two], found[one]
        return found
    return rekinded(parts, slots, draw)


def reordered(parts: list[Parts], slots: Words, draw: random.Random) -> list[Parts]:
    """Take visits in turn for visits in any order, or the other way round."""
    visits = [n for n, part in enumerate(parts) if part[0] == 'V']
    if len(visits) > 1:
        one, two = visits[:2] if draw.random() < 0.5 else visits[-2:]
        both = (*parts[one], *parts[two][1:])
        return [both if n == one else part for n, part in enumerate(parts) if n != two]
    for n in visits:
        _, *inner = parts[n]
        if len(inner) > 1:
            draw.shuffle(inner)
            return replaced(parts, n, *(('V', region) for region in inner))
    return renamed(parts, slots, draw)


def wished(parts: list[Parts], slots: Words, draw: random.Random) -> list[Parts]:
    """Make a wish of a demand, or a demand of a wish."""
    if not parts:
        return added(parts, slots, draw)
    at = draw.randrange(len(parts))
    part = parts[at]
    if part[0].startswith('U_') or part[0] == NOTHING:
        return dropped(parts, slots, draw)
    return replaced(parts, at, part[1] if part[0] == WISH else (WISH, part))


def renamed(parts: list[Parts], slots: Words, draw: random.Random) -> list[Parts]:
    """Put another slot of the sentence in for one, or a place that nobody knows."""
    tokens = list(flat(parts))
    spots = [n for n, token in enumerate(tokens) if is_slot(token)]
    if not spots:
        return added(parts, slots, draw)
    at = draw.choice(spots)
    kind = 'R' if tokens[at] in (UNKNOWN, 'START', 'GOAL') else tokens[at][0]
    others = [name for name in slots if name[0] == kind and name != tokens[at]]
    if kind == 'R' and (not others or draw.random() < 0.12):
        others = [draw.choice((UNKNOWN, UNKNOWN, 'START', 'GOAL'))]
    if kind == 'L' and not others:
        others = ['D']
    if kind == 'K' and not others and tokens[at - 2][:2] in ('CL', 'CG', 'CE'):
        others = [ONE]
    if not others:
        return rekinded(parts, slots, draw)
    tokens[at] = draw.choice(others)
    try:
        return list(parsed(iter(tokens)))
    except Unreadable:
        return parts


def is_slot(token: str) -> bool:
    """Whether a token of a meaning stands for something of the sentence."""
    return token[1:].isdigit() or token in (UNKNOWN, 'START', 'GOAL')


def regrouped(parts: list[Parts], slots: Words, draw: random.Random) -> list[Parts]:
    """Change what joins places: 'or', 'except', all of a group, a half, beside."""
    done = False

    def changed(part: Parts) -> Parts:
        nonlocal done
        kind, *inner = part
        if not done and kind in ('OR', 'EX', EACH, 'HO', 'AL', 'BW') and draw.random() < 0.8:
            done = True
            if kind == 'OR' and draw.random() < 0.5:
                inner.pop(draw.randrange(len(inner)))
            return draw.choice([one for one in inner if one[0][0] != 'S'] or [part])
        return (kind, *map(changed, inner))

    found = [changed(part) for part in parts]
    if done:
        return found
    for n, (kind, *inner) in enumerate(found):
        if kind == 'V' and len(inner) > 1 and draw.random() < 0.6:
            return replaced(found, n, ('V', ('OR', *inner)))
        if kind == 'V' and inner and inner[0][0][0] == 'R' and draw.random() < 0.3:
            return replaced(found, n, ('V', (EACH, inner[0]), *inner[1:]))
    return dropped(parts, slots, draw)


def replaced(parts: list[Parts], at: int, *others: Parts) -> list[Parts]:
    """Return clauses with others in place of one."""
    return [*parts[:at], *others, *parts[at + 1 :]]


CHANGES = (
    dropped, added, rekinded, rekinded, turned, reordered, wished, renamed, renamed, regrouped,
)  # fmt: skip

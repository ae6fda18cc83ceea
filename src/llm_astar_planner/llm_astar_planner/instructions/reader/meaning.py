# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The language of meanings that the network writes, and the clauses that they stand for.

A meaning is a row of tokens, clauses in prefix form: `A R1` avoids the first region of the
sentence, `V R1 R2 ) V R3 )` visits two in any order and then a third, `W` makes a wish of what
follows, `NO` asks for nothing. Slots are regions R, lengths L, sides S and counts K, numbered as in the sentence.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError

from llm_astar_planner.instructions.clauses.unsupported import ABOUT
from llm_astar_planner.instructions.grammar.meaning import CLEAR
from llm_astar_planner.instructions.grammar.selection import DRAWN, OPPOSITE
from llm_astar_planner.instructions.reader.lifting import SIGN, SLOTS, Slot, slot_name

END, CLOSE, UNKNOWN, WISH, EACH, ONE, NOTHING = '<end>', ')', '?', 'W', 'EA', 'ONE', 'NO'
# The parts of each clause: c a clause, r a region, p a place, s a side, l a length, k how often,
# w a region or the walls, f the first of regions to visit; a star ends a list of any length.
CLAUSES = {
    'A': 'r', 'B': 'rr', 'T': 'rr', 'N': 'rr', 'S': 'r', 'P': 'rs', 'PX': 'rs', 'K': 'wl',
    'E': 'r', 'C': 'rk', 'CN': 'rk', 'CL': 'rk', 'CG': 'rk', 'CE': 'rk', 'HF': 's', 'HO': 'sp',
    'AL': 'p', 'BW': 'pp', 'W': 'c', 'EA': 'p',
    'V': 'fv', 'OR': 'rrm', 'EX': 'rrm', NOTHING: '',
}  # fmt: skip
LISTS = ('V', 'OR', 'EX')
REGIONS = ('HF', 'HO', 'AL', 'BW', 'EA', 'OR', 'EX')
# All tokens in the order of the network's outputs.
TOKENS = (
    END, CLOSE, *CLAUSES, 'START', 'GOAL', 'WALLS', UNKNOWN, 'D', ONE,
    *(f'U_{one}' for one in ABOUT),
    *(f'{kind}{number}' for kind, most in SLOTS.items() for number in range(1, most + 1)),
)  # fmt: skip
# The fields in JSON of each kind of clause.
FIELDS = {
    'A': ('avoid', 'region'), 'S': ('stay_in', 'region'), 'E': ('end_at', 'region'),
    'B': ('before', 'first', 'second'), 'T': ('then', 'first', 'second'),
    'N': ('never_after', 'first', 'second'), 'P': ('pass', 'region', 'side'),
    'PX': ('pass', 'region', 'side'), 'K': ('keep_distance', 'from', 'metres'),
}  # fmt: skip
Parts = tuple[Any, ...]


class Unreadable(LlmAstarError):  # noqa: N818 (no error of the program: the meaning is none)
    """A meaning that makes no clauses."""


def kind_tokens() -> dict[str, frozenset[str]]:
    """Return the tokens of each kind; slots are all that there could be."""
    slots = {kind: {t for t in TOKENS if t[0] == kind and t[1:].isdigit()} for kind in 'RLSK'}
    region = {*REGIONS, 'START', 'GOAL', UNKNOWN, *slots['R']} - {EACH}
    clause = CLAUSES.keys() - {*REGIONS, WISH} | {t for t in TOKENS if t.startswith('U_')}
    kinds = {
        't': clause | {WISH, END}, 'c': clause, 'r': region, 'w': region | {'WALLS'},
        'f': region | {EACH}, 'v': region | {EACH, CLOSE}, 'm': region | {CLOSE},
        'p': slots['R'] | {UNKNOWN}, 's': slots['S'], 'l': slots['L'] | {'D'},
        'k': slots['K'] | {ONE},
    }  # fmt: skip
    return {name: frozenset(tokens) for name, tokens in kinds.items()}


KINDS = kind_tokens()


def after(stack: str, token: str) -> str:
    """Return what is expected after a token; `stack` is what was, the next one first."""
    kind, rest = stack[0], stack[1:]
    if token == CLOSE:
        return rest
    again = kind if kind in 'vm' else ''
    return CLAUSES.get(token, '') + again + rest + ('t' if kind == 't' else '')


def parsed(tokens: Iterator[str]) -> Iterator[Parts]:
    """Yield the clauses of a meaning as trees (token, part, ...). Raises Unreadable."""
    for token in tokens:
        yield tree(token, tokens)


def tree(token: str, tokens: Iterator[str]) -> Parts:
    """Return a token with its parts. Raises Unreadable where some are missing."""
    if token in LISTS:
        return token, *(tree(part, tokens) for part in iter(lambda: following(tokens), CLOSE))
    return token, *(tree(following(tokens), tokens) for _ in CLAUSES.get(token, ''))


def following(tokens: Iterator[str]) -> str:
    """Return the next token. Raises Unreadable where there is none."""
    for token in tokens:
        return token
    raise Unreadable('it ends too soon')


def ordered(tokens: Sequence[str]) -> tuple[Parts, ...]:
    """Return the clauses of a meaning in one order of all that mean the same."""
    found = [sorted_parts(one) for part in parsed(iter(tokens)) for one in apart(part)]
    visits = [part for part in found if is_visit(part)]
    return (*visits, *sorted({part for part in found if not is_visit(part)}, key=str))


def apart(part: Parts) -> list[Parts]:
    """Return 'avoid A or B' as two clauses: both are avoided."""
    kind, *inner = part
    if kind == WISH:
        return [(WISH, one) for one in apart(inner[0])]
    is_joined = kind == 'A' and inner[0][0] == 'OR'
    return [(kind, one) for one in inner[0][1:]] if is_joined else [part]


def flat(parts: Sequence[Parts]) -> Iterator[str]:
    """Yield the tokens of clauses."""
    for kind, *inner in parts:
        yield kind
        yield from flat(inner)
        if kind in LISTS:
            yield CLOSE


def told_in_turn(tokens: Sequence[str], meaning: Sequence[str]) -> list[str]:
    """Return a meaning as the networks write it: in the order of mention, visits first.

    Raises Unreadable for what is no meaning.
    """
    spots: dict[str, int] = {}
    for at, token in enumerate(tokens):
        if token[0] == SIGN:
            spots.setdefault(slot_name(token), at)

    def place(part: Parts) -> tuple[int, str]:
        found = [spots[token] for token in flat([part]) if token in spots]
        return min(found, default=len(tokens)), str(part)

    def sorted_in(part: Parts) -> Parts:
        kind, *inner = part
        inner = [sorted_in(one) for one in inner]
        if kind in LISTS:
            first = inner[:1] if kind == 'EX' else []
            inner = [*first, *sorted(inner[len(first) :], key=place)]
        return (kind, *inner)

    parts = [sorted_in(part) for part in ordered(meaning)]
    visits = [part for part in parts if is_visit(part)]
    return list(flat([*visits, *sorted((p for p in parts if not is_visit(p)), key=place)]))


def is_visit(part: Parts) -> bool:
    """Whether a clause is a visit, or the wish for one."""
    return 'V' in (part[0], part[-1][0] if part[0] == WISH else '')


def sorted_parts(part: Parts) -> Parts:
    """Return a clause with what is in any order in one order."""
    inner = [sorted_parts(one) for one in part[1:]]
    return part[0], *(sorted(inner, key=str) if part[0] in ('V', 'OR') else inner)


@dataclass
class Writer:
    """Writes the clauses of a meaning in JSON, with the slots of its sentence.

    `about` are the words for what a path does not have, '' for others.
    """

    slots: Mapping[str, Slot]
    about: Mapping[str, str]

    def clause(self, part: Parts) -> dict[str, Any]:
        """Return a clause. Raises Unreadable."""
        kind, *inner = part
        if kind == WISH:
            return {'strength': 'should', **self.clause(inner[0])}
        if UNKNOWN in str(part):
            return {'kind': 'unknown', 'text': self.about['']}
        if kind.startswith('U_'):
            about = kind[2:]
            text = self.about.get(about, self.about[''])
            return {'kind': 'unsupported', 'text': text, 'about': about}
        values = [self.value(one) for one in inner]
        if kind == 'V':
            return {'kind': 'visit', 'regions': [one for some in values for one in as_list(some)]}
        if kind[0] == 'C':
            return {'kind': 'count', 'region': values[0], **entries(kind, values[1])}
        if kind == 'PX':
            values[1] = OPPOSITE[values[1]]
        if kind not in FIELDS:
            raise Unreadable(f'{kind} is no clause')
        name, *fields = FIELDS[kind]
        return {'kind': name, **dict(zip(fields, values))}

    def value(self, part: Parts) -> Any:  # noqa: ANN401 - a region, a number, a side
        """Return a part of a clause in JSON. Raises Unreadable."""
        kind, *inner = part
        if kind in self.slots:
            return self.slots[kind].in_json
        if kind == EACH:
            slot = self.slots[inner[0][0]]
            return [one.to_json() for one in slot.members] or slot.in_json
        values = [self.value(one) for one in inner]
        match kind:
            case 'START' | 'GOAL':
                return {'end': kind.lower()}
            case 'ONE':
                return 1
            case 'WALLS' | 'D':
                return 'walls' if kind == 'WALLS' else CLEAR
            case 'OR':
                return {'any_of': values}
            case 'EX':
                return {'region': values[0], 'except': values[1:]}
            case 'HF':
                return {'half': values[0]}
            case 'HO':
                return {'half': DRAWN.get(values[0], values[0]), 'of': values[1].get('place')}
            case 'AL':
                return {'along': values[0].get('place')}
            case 'BW':
                return {'between': [one.get('place') for one in values]}
        raise Unreadable(f'{kind} is nothing of the sentence')


def as_list(value: Any) -> list[Any]:  # noqa: ANN401 - JSON
    """Return what is no list as one."""
    return value if isinstance(value, list) else [value]


def entries(kind: str, times: Any) -> dict[str, Any]:  # noqa: ANN401 - a number or limits
    """Return the least and the most entries. Raises Unreadable for 'not twice' as a wish."""
    slot = Slot('K', times)
    if kind in ('C', 'CN'):
        if isinstance(times, int) or times[2] != (kind == 'CN'):
            raise Unreadable('not so often, or how often')
        least, most = slot.entries
    elif slot.number is None:
        raise Unreadable('how often, or how many')
    else:
        least = 0 if kind == 'CL' else slot.number
        most = None if kind == 'CG' else slot.number
    return {'at_least': least, 'at_most': most}

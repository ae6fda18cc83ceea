"""What is seen of a planner at work, as lines for a terminal or as JSON."""

from __future__ import annotations

import json
import time
from collections import Counter
from enum import Enum
from typing import Any, NamedTuple


class Kind(str, Enum):
    """What was seen."""

    PLAN = 'plan'
    EXCHANGE = 'exchange'  # of the waypoint client with its source
    HEALTH = 'health'  # a node's state, when it changed


class Level(Enum):
    """How well it went, and the ANSI colour that says so."""

    FINE = 32
    DOUBTFUL = 33
    BAD = 31
    QUIET = 2


class Seen(NamedTuple):
    """One thing seen: when (seconds of the node's clock), of which node, and its fields.

    The fields of a plan are PlanReport's, of an exchange ExchangeReport's; a state has `message`
    and the values of its diagnostic status.
    """

    kind: Kind
    stamp: float
    node: str
    values: dict[str, Any]


def to_json(seen: Seen) -> str:
    """Return one JSON object on one line: `kind`, `stamp` and `node`, then the fields."""
    head = {'kind': seen.kind.value, 'stamp': seen.stamp, 'node': seen.node}
    return json.dumps({**head, **seen.values})


def to_line(seen: Seen, *, colour: bool = False) -> str:
    """Return one line for a person, coloured by how well it went where that is wanted.

    What other nodes and models wrote in it cannot steer the terminal.
    """
    clock = time.strftime('%H:%M:%S', time.localtime(seen.stamp))
    words = '  '.join([clock, *_WORDS[seen.kind](seen)])
    text = ''.join(letter if letter.isprintable() else ' ' for letter in words)
    return f'\033[{_level(seen).value}m{text}\033[0m' if colour else text


def _plan_words(seen: Seen) -> list[str]:
    plan = seen.values
    verdicts = Counter(verdict.replace('_', ' ') for *_, verdict in plan['waypoints'])
    words = [
        f'{plan["code_name"]:<8}',
        f'{plan["method"] or "-"} by {plan["guided_by"]}',
        f'{plan["operation"]} ops',
        '' if plan['length'] is None else f'{plan["length"]:.2f} m',
        '' if plan['ratio'] is None else f'ratio {plan["ratio"]:.3f}',
        f'search {1000 * plan["seconds_search"]:.1f} ms',
        f'source {1000 * plan["seconds_source"]:.1f} ms {plan["source_status"]}',
        ', '.join(f'{count} {verdict}' for verdict, count in verdicts.items()),
        f'wish {plan["instruction"]}' if plan['instruction'] else '',
        *(f'! {warning}' for warning in plan['warnings']),
        plan['message'] if plan['code'] else '',
    ]
    return [word for word in words if word]


def _exchange_words(seen: Seen) -> list[str]:
    exchange = seen.values
    words = [
        'exchange',
        f'{exchange["status"]} by {exchange["label"]}',
        f'{len(exchange["waypoints"])} waypoints',
        f'{exchange["prompt_tokens"]} + {exchange["completion_tokens"]} tokens',
        f'{exchange["seconds"]:.2f} s',
        exchange['detail'],
    ]
    return [word for word in words if word]


def _health_words(seen: Seen) -> list[str]:
    return ['health  ', seen.node, seen.values['message']]


def _level(seen: Seen) -> Level:
    if seen.kind is not Kind.PLAN:
        return Level.QUIET
    if seen.values['code']:
        return Level.BAD
    doubtful = seen.values['warnings'] or seen.values['source_status'] not in ('OK', 'NONE')
    return Level.DOUBTFUL if doubtful else Level.FINE


_WORDS = {
    Kind.PLAN: _plan_words,
    Kind.EXCHANGE: _exchange_words,
    Kind.HEALTH: _health_words,
}

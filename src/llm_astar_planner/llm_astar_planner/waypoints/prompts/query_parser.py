"""Parse a sentence that asks for a path (the paper's parse step), without a model if possible."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.barrier_map import (
    BarrierMap,
    BarrierMapError,
    Point,
    parse_barrier_map,
)

from llm_astar_planner.waypoints.source import Message

# Sends messages and the JSON schema of the answer to a model, and returns the answer's text.
ModelCall = Callable[[tuple[Message, ...], dict[str, Any]], str]

MAX_QUERY_CHARS = 20000
_NUMBER = r'\s*-?\d{1,6}\s*'
_POINT = rf'\[{_NUMBER},{_NUMBER}\]'
_LIST = rf'\[\s*(?:\[{_NUMBER},{_NUMBER},{_NUMBER}\]\s*,?\s*)*\]'
_SENTENCE = re.compile(
    rf'\s*(?:design|find|plan)\s+a\s+path\s+from\s*(?P<start>{_POINT})\s*to\s*(?P<goal>{_POINT})'
    r'\s*on\s+an?\s+(?P<width>\d{1,6})\s*by\s*(?P<height>\d{1,6})\s*grid\s+that\s+avoids\s+'
    rf'horizontal\s+barriers\s+(?:centered\s+)?at\s*(?P<horizontal>{_LIST})\s*and\s+'
    rf'vertical\s+barriers\s+(?:centered\s+)?at\s*(?P<vertical>{_LIST})\s*\.?\s*',
    re.IGNORECASE,
)
_EXAMPLE = {
    'width': 51,
    'height': 31,
    'start': {'x': 5, 'y': 5},
    'goal': {'x': 20, 'y': 20},
    'horizontal_barriers': [{'y': 10, 'x_start': 0, 'x_end': 25}],
    'vertical_barriers': [{'x': 25, 'y_start': 10, 'y_end': 22}],
}
_REQUEST = f"""Turn the question about a path on a grid into one JSON object of this form:
{json.dumps(_EXAMPLE)}
"width" and "height" are the size of the grid, "start" and "goal" its points. A horizontal barrier
lies on one line y from x_start to x_end, a vertical one on one line x from y_start to y_end; a
written barrier [a, b, c] is [y, x_start, x_end] or [x, y_start, y_end]. Where there are none of a
kind, its list is empty. Reply with the JSON object alone.

Question: """


class QueryError(LlmAstarError, ValueError):
    """A sentence cannot be parsed; the message says why."""


class PathQuery(NamedTuple):
    """A barrier map, and the lattice points of start and goal."""

    barrier_map: BarrierMap
    start: Point
    goal: Point


def parse_query(text: str, ask: ModelCall | None = None) -> PathQuery:
    """Return the map, start and goal that a sentence describes.

    A sentence in the dataset's own form needs no model; any other goes to `ask`.
    Raises QueryError where there is no `ask`, or where its answer does not make sense.
    """
    if len(text) > MAX_QUERY_CHARS:
        raise QueryError(f'query: longer than {MAX_QUERY_CHARS} characters')
    match = _SENTENCE.fullmatch(text)
    if match is not None:
        return make_query(
            {
                'width': int(match['width']),
                'height': int(match['height']),
                'start': integers(match['start']),
                'goal': integers(match['goal']),
                'horizontal_barriers': triples(match['horizontal']),
                'vertical_barriers': triples(match['vertical']),
            }
        )
    if ask is None:
        raise QueryError(
            'query: not of the form "design a path from [x, y] to [x, y] on a W by H grid that '
            'avoids horizontal barriers centered at [[y, x0, x1], ...] and vertical barriers at '
            '[[x, y0, y1], ...]."; free wording needs an endpoint'
        )
    answer = ask((Message('user', _REQUEST + text.strip()),), query_schema())
    return make_query(first_question(answer))


def query_schema() -> dict[str, Any]:
    """Return the JSON schema of the answer, for endpoints that take one."""

    def numbers(*names: str) -> dict[str, Any]:
        return {
            'type': 'object',
            'properties': {name: {'type': 'integer'} for name in names},
            'required': list(names),
            'additionalProperties': False,
        }

    fields = {
        'width': {'type': 'integer'},
        'height': {'type': 'integer'},
        'start': numbers('x', 'y'),
        'goal': numbers('x', 'y'),
        'horizontal_barriers': {'type': 'array', 'items': numbers('y', 'x_start', 'x_end')},
        'vertical_barriers': {'type': 'array', 'items': numbers('x', 'y_start', 'y_end')},
    }
    return {
        'type': 'object',
        'properties': fields,
        'required': list(fields),
        'additionalProperties': False,
    }


def make_query(data: dict[str, Any]) -> PathQuery:
    """Check the fields and build the map. Raises QueryError naming the field."""
    missing = [name for name in _EXAMPLE if name not in data]
    if missing:
        raise QueryError(f'query: {", ".join(missing)} not found in it')
    barriers = {
        'horizontal_barriers': barrier_lists(
            data, 'horizontal_barriers', ('y', 'x_start', 'x_end')
        ),
        'vertical_barriers': barrier_lists(data, 'vertical_barriers', ('x', 'y_start', 'y_end')),
    }
    endpoints = [named_values(data[name], ('x', 'y')) for name in ('start', 'goal')]
    entry = {
        'id': 0,
        'range_x': [0, data['width']],
        'range_y': [0, data['height']],
        **barriers,
        'start_goal': [endpoints],
    }
    try:
        barrier_map = parse_barrier_map(entry, 'query')
    except BarrierMapError as error:
        raise QueryError(str(error)) from None
    sample = barrier_map.samples[0]
    return PathQuery(barrier_map, sample.start, sample.goal)


def named_values(value: Any, names: tuple[str, ...]) -> Any:  # noqa: ANN401 - any JSON value
    """Return the named values of an object as a list; anything else as it is."""
    return [value.get(name) for name in names] if isinstance(value, dict) else value


def barrier_lists(data: dict[str, Any], field: str, names: tuple[str, ...]) -> list[Any]:
    """Return a field's barriers as lists, lower end first. Raises QueryError if it is no list."""
    if not isinstance(data[field], list):
        raise QueryError(f'query: {field}: a list is expected')
    barriers = [named_values(value, names) for value in data[field]]
    for index, barrier in enumerate(barriers):
        # What is not three numbers is left to the map's own check.
        with contextlib.suppress(TypeError, ValueError):
            line, first, last = barrier
            barriers[index] = [line, min(first, last), max(first, last)]
    return barriers


def first_question(text: str) -> dict[str, Any]:
    """Return the first JSON object in a reply that has a start. Raises QueryError."""
    decoder = json.JSONDecoder()
    for match in list(re.finditer(r'\{', text))[:50]:
        try:
            value, _ = decoder.raw_decode(text, match.start())
        except (ValueError, RecursionError):
            continue
        if isinstance(value, dict) and 'start' in value:
            return value
    raise QueryError('query: the model gave no JSON object that describes it')


def integers(text: str) -> list[int]:
    """Return every integer in a text."""
    return [int(value) for value in re.findall(r'-?\d+', text)]


def triples(text: str) -> list[list[int]]:
    """Return every three integers of a text as a list."""
    values = integers(text)
    return [values[i : i + 3] for i in range(0, len(values), 3)]

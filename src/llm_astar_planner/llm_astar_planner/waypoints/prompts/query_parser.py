# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Parse a sentence that asks for a path (the paper's parse step), in the form of the dataset."""

from __future__ import annotations

import re

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, parse_barrier_map

MAX_QUERY_CHARS = 20000
_NUMBER = r'\s*-?\d{1,6}\s*'
_POINT = rf'\[{_NUMBER},{_NUMBER}\]'
# No text matches these in two ways: backtracking would try them all.
_LIST = rf'\[\s*(?:\[{_NUMBER},{_NUMBER},{_NUMBER}\]\s*(?:,\s*)?)*\]'
_SENTENCE = re.compile(
    rf'\s*(?:design|find|plan)\s+a\s+path\s+from\s*(?P<start>{_POINT})\s*to\s*(?P<goal>{_POINT})'
    r'\s*on\s+an?\s+(?P<width>\d{1,6})\s*by\s*(?P<height>\d{1,6})\s*grid\s+that\s+avoids\s+'
    rf'horizontal\s+barriers\s+(?:centered\s+)?at\s*(?P<horizontal>{_LIST})\s*and\s+'
    rf'vertical\s+barriers\s+(?:centered\s+)?at\s*(?P<vertical>{_LIST})\s*(?:\.\s*)?',
    re.IGNORECASE,
)


class QueryError(LlmAstarError, ValueError):
    """A sentence cannot be parsed; the message says why."""


def parse_query(text: str) -> BarrierMap:
    """Return the map that a sentence describes; its only sample has the start and the goal.

    Raises QueryError for a sentence of another form, BarrierMapError for numbers that fit no map.
    """
    if len(text) > MAX_QUERY_CHARS:
        raise QueryError(f'query: longer than {MAX_QUERY_CHARS} characters')
    match = _SENTENCE.fullmatch(text)
    if match is None:
        raise QueryError(
            'query: not of the form "design a path from [x, y] to [x, y] on a W by H grid that '
            'avoids horizontal barriers centered at [[y, x0, x1], ...] and vertical barriers at '
            '[[x, y0, y1], ...]."'
        )
    entry = {
        'range_x': [0, int(match['width'])],
        'range_y': [0, int(match['height'])],
        'horizontal_barriers': read_barriers(match['horizontal']),
        'vertical_barriers': read_barriers(match['vertical']),
        'start_goal': [[read_integers(match['start']), read_integers(match['goal'])]],
    }
    return parse_barrier_map(entry, 'query')


def read_integers(text: str) -> list[int]:
    """Return every integer in a text."""
    return [int(value) for value in re.findall(r'-?\d+', text)]


def read_barriers(text: str) -> list[list[int]]:
    """Return every three integers in a text as a barrier, the lower end first."""
    numbers = iter(read_integers(text))
    return [[line, *sorted(ends)] for line, *ends in zip(numbers, numbers, numbers)]

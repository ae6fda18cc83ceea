# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The prompt: rules, worked examples and places, then the instruction as quoted data.

What never changes comes first and the instruction last, so that a server that keeps the read
prompt (llama.cpp, vLLM, most services) reads only the instruction again.
"""

import json
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path

import shapely
from llm_astar_msgs_adapter.maps.places import Place, Places, places_from_polygons

from llm_astar_planner.instructions.model.answer import read_sentence
from llm_astar_planner.waypoints.source import Message

EXAMPLES_FILE = Path(__file__).with_name('examples.json')
# A place this many times longer than wide is called horizontal or vertical.
ELONGATED = 3.0
# Places that a prompt lists; of more, those that the instruction seems to mention come first.
MAX_PROMPT_PLACES = 60
MAX_PROMPT_ALIASES = 4
SYSTEM = Path(__file__).with_name('system.txt').read_text(encoding='utf-8').rstrip('\n')

# On one line, with the letters of all languages, as models are shown it.
to_json = partial(json.dumps, ensure_ascii=False)


@cache
def examples() -> tuple[Places, tuple[tuple[str, str], ...]]:
    """Return worked examples: the places of one map, and instructions with their answers."""
    loaded = json.loads(EXAMPLES_FILE.read_text(encoding='utf-8'))
    places = places_from_polygons({entry['name']: entry for entry in loaded['places']})
    turns = ((one['text'], to_json({'clauses': one['clauses']})) for one in loaded['examples'])
    return places, tuple(turns)


def prompt_messages(text: str, places: Places) -> tuple[Message, ...]:
    """Return the chat that asks for the clauses of a clean instruction."""
    messages = [Message('system', SYSTEM)]
    example_places, turns = examples()
    head = f'{places_text(example_places)}\n'
    for instruction, answer in turns:
        messages.append(Message('user', f'{head}{instruction_line(instruction)}'))
        messages.append(Message('assistant', answer))
        head = ''
    listed = places if len(places) <= MAX_PROMPT_PLACES else mentioned_first(text, places)
    asked = f'Another map.\n{places_text(listed)}\n{instruction_line(text)}'
    return (*messages, Message('user', asked))


def mentioned_first(text: str, places: Places) -> Places:
    """Return MAX_PROMPT_PLACES places: those that a sentence may mean, then others."""
    named = set(read_sentence(text, places).names)
    ranked = sorted(places, key=lambda place: place.name not in named)
    return Places(ranked[:MAX_PROMPT_PLACES])


def instruction_line(text: str) -> str:
    """Return the instruction as quoted data."""
    return f'Instruction: {to_json(text)}'


def places_text(places: Places) -> str:
    """Return the list of places: name, aliases, kind, tags, where on the map."""
    if not len(places):
        return 'Places: none.'
    box = shapely.total_bounds([place.geometry for place in places])
    return '\n'.join(['Places:', *(place_line(place, box) for place in places)])


def place_line(place: Place, box: Sequence[float]) -> str:
    """Return the line of a place; `box` is that of all places (x0, y0, x1, y1)."""
    also = ', '.join(to_json(n) for n in place.aliases[:MAX_PROMPT_ALIASES])
    name = to_json(place.name) + (f' (also {also})' if also else '')
    x0, y0, x1, y1 = place.geometry.bounds
    kinds = dict.fromkeys(filter(None, [orientation(place), place.kind, *place.tags]))
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    where = compass_word(x, y, box)
    return f'- {name}: {", ".join(kinds)}; {where}, centre {x:.3g}, {y:.3g}'


def orientation(place: Place) -> str:
    """Return 'horizontal' or 'vertical' for a place that is long and narrow, else ''."""
    x0, y0, x1, y1 = place.geometry.bounds
    wide, high = x1 - x0, y1 - y0
    upright = 'vertical' if high >= ELONGATED * wide > 0 else ''
    return 'horizontal' if wide >= ELONGATED * high > 0 else upright


def compass_word(x: float, y: float, box: Sequence[float]) -> str:
    """Return in which ninth of a box a point lies: 'north-west', ..., 'middle'."""
    row = ('south', '', 'north')[third(y, box[1], box[3])]
    column = ('west', '', 'east')[third(x, box[0], box[2])]
    return '-'.join(filter(None, (row, column))) or 'middle'


def third(value: float, low: float, high: float) -> int:
    """Return 0, 1 or 2: in which third of a range a value lies."""
    return min(2, max(0, int(3 * (value - low) / (high - low)))) if high > low else 1

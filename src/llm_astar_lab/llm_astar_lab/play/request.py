# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What the page asks for, checked field by field, and the command that asks for the same."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.errors import short_repr
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_planner.instructions.text import clean_instruction
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.parameters import PLANNER, defaults
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import BASELINE_NAMES
from numpy.typing import NDArray

from llm_astar_lab.play.maps import Maps, PlayError, PlayMap

# The sources that need neither a network nor a key nor a file, and the text of a model's answer.
REPLY = 'reply'
SOURCES = ('none', 'embedded', *BASELINE_NAMES, REPLY)
# The parameters that the page sets by their own names.
SETTINGS = (
    'method', 'heuristic', 'weight', 'max_suboptimality', 'robot_radius', 'corner_cutting',
    'any_angle', 'instruction',
)  # fmt: skip
MAX_REPLY = 65_536
MAX_VIA = 100
MAX_EDITED = 100_000
FIELDS = {'map', 'start', 'goal', 'source', 'reply', 'via', 'walls', 'confirm', *SETTINGS}
# Without plug-ins: a page names no code.
PARAMETERS = {item.name: replace(item, plugins=None) for item in PLANNER if not item.node_only}


@dataclass(frozen=True)
class Walls:
    """Cells that the page's user has drawn and erased: int32 [n, 2], (x, y)."""

    blocked: NDArray[np.int32]
    freed: NDArray[np.int32]

    @property
    def are_edited(self) -> bool:
        """Whether there are any."""
        return bool(len(self.blocked) or len(self.freed))

    def apply(self, grid_map: GridMap) -> GridMap:
        """Return the map with these walls."""
        if not self.are_edited:
            return grid_map
        cells = grid_map.cells.copy()
        cells[self.freed[:, 1], self.freed[:, 0]] = FREE
        cells[self.blocked[:, 1], self.blocked[:, 0]] = OCCUPIED
        return replace(grid_map, cells=cells)


@dataclass(frozen=True)
class PlayRequest:
    """A plan that the page asks for; cells are (x, y) on the map.

    `values` are those of all planning parameters, of which the page has `given` some. `reply` is
    the text of a model's answer, used instead of the `source`; None for none. `confirm`
    answers the questions on the instruction.
    """

    play_map: PlayMap
    start: Cell
    goal: Cell
    values: dict[str, Any]
    given: dict[str, Any]
    source: str
    reply: str | None
    via: tuple[Cell, ...]
    walls: Walls
    confirm: bool | None = None


def read_request(body: object, maps: Maps) -> PlayRequest:
    """Return the request in the JSON of a page. Raises PlayError, which names the field."""
    if not isinstance(body, dict):
        raise PlayError('the body is not a JSON object: send {"map": ..., "start": [x, y], ...}')
    for name in body:
        if name not in FIELDS:
            raise PlayError(f'{name[:80]}: is not a field; there are {", ".join(sorted(FIELDS))}')
    play_map = maps.get(read_text(body, 'map', 200) or '')
    values = defaults(PARAMETERS.values(), cli=True)
    values['corner_cutting'] = play_map.barriers is not None
    given = read_settings(body)
    reply = read_text(body, 'reply', MAX_REPLY)
    source = read_source(body.get('source', 'none'), reply)
    return PlayRequest(
        play_map,
        read_cell(body.get('start'), 'start', play_map.grid_map),
        read_cell(body.get('goal'), 'goal', play_map.grid_map),
        values | given,
        given,
        source,
        reply,
        tuple(read_cells(body.get('via'), 'via', play_map.grid_map, MAX_VIA)),
        read_walls(body.get('walls'), play_map.grid_map),
        read_confirm(body.get('confirm')),
    )


def read_confirm(value: object) -> bool | None:
    """Return the answer to the questions on the instruction, None for none. Raises PlayError."""
    if value is not None and not isinstance(value, bool):
        raise PlayError(f'confirm: {short_repr(value)} is not true or false', 'instruction')
    return value


def read_source(source: object, reply: str | None) -> str:
    """Return the name of a source; that of a typed reply needs one. Raises PlayError."""
    if not isinstance(source, str) or source not in SOURCES:
        known = ', '.join(SOURCES)
        raise PlayError(f'source: {short_repr(source)} is not one of {known}', 'source')
    if source == REPLY and reply is None:
        raise PlayError("reply: is missing; write a model's answer such as [[5, 5]]", REPLY)
    return source


def read_settings(body: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters that the page sets, by name. Raises PlayError."""
    given: dict[str, Any] = {}
    for name in SETTINGS:
        if body.get(name) is None:
            continue
        try:
            given[name] = PARAMETERS[name].read(body[name])
        except ParameterError as error:
            raise PlayError(str(error), name) from None
    if 'instruction' in given:
        given['instruction'] = clean_instruction(str(given['instruction']))
    return given


def read_text(body: Mapping[str, Any], name: str, limit: int) -> str | None:
    """Return a text of at most `limit` characters, None for none. Raises PlayError."""
    text = body.get(name)
    if text is None:
        return None
    if not isinstance(text, str):
        raise PlayError(f'{name}: a text is expected, not {short_repr(text)}', name)
    if len(text) > limit:
        raise PlayError(f'{name}: {len(text)} characters are over {limit}; shorten it', name)
    return text


def read_cell(value: object, name: str, grid_map: GridMap) -> Cell:
    """Return a cell on the map. Raises PlayError."""
    numbers = value if isinstance(value, list) else []
    if len(numbers) != 2 or not all(type(number) is int for number in numbers):
        raise PlayError(
            f'{name}: {short_repr(value)} is not a cell: send two whole numbers [x, y]', name
        )
    x, y = numbers
    if not grid_map.contains((x, y)):
        raise PlayError(
            f'{name}: {short_repr([x, y])} is off the map of {grid_map.width} x '
            f'{grid_map.height} cells; choose a cell on it',
            name,
        )
    return x, y


def read_cells(value: object, name: str, grid_map: GridMap, limit: int) -> list[Cell]:
    """Return up to `limit` cells on the map, none for null. Raises PlayError."""
    if value is None:
        return []
    if not isinstance(value, list):
        raise PlayError(f'{name}: a list of cells is expected, not {short_repr(value)}', name)
    if len(value) > limit:
        raise PlayError(f'{name}: {len(value)} cells are over {limit}; send fewer', name)
    return [read_cell(cell, name, grid_map) for cell in value]


def read_walls(value: object, grid_map: GridMap) -> Walls:
    """Return the edited walls, none for null. Raises PlayError."""
    fields: Any = {} if value is None else value
    if not isinstance(fields, dict) or not set(fields) <= {'blocked', 'freed'}:
        raise PlayError('walls: {"blocked": [cells], "freed": [cells]} is expected', 'walls')
    blocked, freed = (
        np.array(read_cells(fields.get(name), 'walls', grid_map, MAX_EDITED), dtype=np.int32)
        for name in ('blocked', 'freed')
    )
    if len(blocked) + len(freed) > MAX_EDITED:
        raise PlayError(f'walls: over {MAX_EDITED} cells; edit fewer', 'walls')
    return Walls(blocked.reshape(-1, 2), freed.reshape(-1, 2))


def command_of(request: PlayRequest) -> str | None:
    """Return the command line, None where the walls are edited."""
    if request.walls.are_edited:
        return None
    words = ['llm-astar', 'plan', '--map', request.play_map.file]
    if request.play_map.map_id is not None:
        words += ['--map-id', str(request.play_map.map_id)]
    x_min, y_min = request.play_map.problem.offset
    cells = [('--start', request.start), ('--goal', request.goal)]
    for flag, (x, y) in (*cells, *(('--via', cell) for cell in request.via)):
        words += [flag, str(x + x_min), str(y + y_min)]
    for name, value in request.given.items():
        words.append(flag_of(name.replace('_', '-'), value))
    if request.play_map.is_metric:
        words.append('--cells')
    if request.reply is not None:
        words.append(f'--reply={request.reply}')
    else:
        words += ['--source', request.source]
    if request.confirm:
        words.append('--confirm')
    return shlex.join(words)


def flag_of(name: str, value: object) -> str:
    """Return the flag of a parameter with its value, which may begin with a dash."""
    if isinstance(value, bool):
        return f'--{name}' if value else f'--no-{name}'
    return f'--{name}={value}'

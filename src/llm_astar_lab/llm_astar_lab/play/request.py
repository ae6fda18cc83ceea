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
from llm_astar_msgs_adapter.files import parse_json
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_msgs_adapter.maps.places import Places, features_of, places_from_geojson
from llm_astar_planner.costmap.zone_file import zones_from_geojson
from llm_astar_planner.costmap.zone_layer import ZoneLayer
from llm_astar_planner.costmap.zones import Zone
from llm_astar_planner.instructions.text import clean_instruction
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.parameters import PLANNER, costmap_config, defaults
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
MAX_DRAWN = 500_000
MAX_VIA = 100
MAX_EDITED = 60_000
OTHERS = ('map', 'start', 'goal', 'source', 'reply', 'via', 'walls', 'drawn', 'confirm')
FIELDS = {*SETTINGS, *OTHERS}
# Without plug-ins: a page names no code.
PARAMETERS = {item.name: replace(item, plugins=None) for item in PLANNER if not item.node_only}


@dataclass(frozen=True)
class PlayRequest:
    """A plan that the page asks for; cells are (x, y) on the map.

    `values` are those of all planning parameters, of which the page has `given` some. `reply` is
    the text of a model's answer, used instead of the `source`; None for none. `places` are those
    of the map with those that were drawn, `zones` were drawn too. `confirm` answers the questions
    on the instruction. `walls` are cells that were drawn, int32 [n, 3], (x, y, occupancy).
    """

    play_map: PlayMap
    start: Cell
    goal: Cell
    values: dict[str, Any]
    given: dict[str, Any]
    source: str
    reply: str | None
    via: tuple[Cell, ...]
    walls: NDArray[np.int32]
    places: Places
    zones: tuple[Zone, ...] = ()
    confirm: bool | None = None

    @property
    def is_edited(self) -> bool:
        """Whether something was drawn, which is in no file that a command could name."""
        return bool(len(self.walls) or self.zones or self.places is not self.play_map.places)

    def edited_map(self) -> GridMap:
        """Return the map with what was drawn on it."""
        grid_map = self.play_map.grid_map
        if len(self.walls):
            cells, (x, y, occupancy) = grid_map.cells.copy(), self.walls.T
            cells[y, x] = occupancy
            grid_map = replace(grid_map, cells=cells)
        rules = costmap_config(self.values)
        return ZoneLayer(grid_map, self.zones, config=rules).compose(grid_map)


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
        *read_drawn(read_text(body, 'drawn', MAX_DRAWN), play_map.places),
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


def read_walls(value: object, grid_map: GridMap) -> NDArray[np.int32]:
    """Return cells with their occupancy, int32 [n, 3], none for null. Raises PlayError."""
    items = [] if value is None else value
    if not isinstance(items, list) or len(items) > MAX_EDITED:
        raise PlayError(f'walls: up to {MAX_EDITED} [x, y, occupancy] are expected', 'walls')
    for item in items:
        read_cell(item[:2] if isinstance(item, list) else item, 'walls', grid_map)
        if len(item) != 3 or type(item[2]) is not int or not FREE <= item[2] <= OCCUPIED:
            raise PlayError(f'walls: {short_repr(item)} is not [x, y, 0 to {OCCUPIED}]', 'walls')
    return np.array(items, dtype=np.int32).reshape(-1, 3)


def read_drawn(text: str | None, places: Places) -> tuple[Places, tuple[Zone, ...]]:
    """Return places with those that were drawn, and the zones: features with a `cost`.

    A drawn place replaces one of its name. Raises PlayError.
    """
    if not text:
        return places, ()
    try:
        parts: tuple[list[Any], list[Any]] = ([], [])
        for feature in features_of(parse_json(text), 'drawn'):
            properties = feature.get('properties') if isinstance(feature, dict) else None
            parts[isinstance(properties, dict) and 'cost' in properties].append(feature)
        added, zones = ({'type': 'FeatureCollection', 'features': part} for part in parts)
        drawn = places_from_geojson(added, 'drawn')
        kept = [place for place in places if drawn.get(place.name) is None]
        merged = Places([*kept, *drawn]) if len(drawn) else places
        return merged, zones_from_geojson(zones, 0.0)[0] if parts[1] else ()
    except ValueError as error:
        raise PlayError(str(error), 'drawn') from None


def command_of(request: PlayRequest) -> str | None:
    """Return the command line, None where the map is edited."""
    if request.is_edited:
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

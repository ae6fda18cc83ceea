# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What the page asks for, checked field by field, and the command that asks for the same."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.errors import raising, short_repr
from llm_astar_msgs_adapter.files import parse_json
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_msgs_adapter.maps.places import Places, features_of, places_from_geojson
from llm_astar_planner.costmap.zone_layer import ZoneLayer
from llm_astar_planner.costmap.zones import Zone, part_of, zones_from_geojson
from llm_astar_planner.instructions.text import clean_instruction
from llm_astar_planner.parameter import Parameter, ParameterError
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
    'any_angle', 'alternatives', 'instruction', 'source',
)  # fmt: skip
MAX_REPLY = 65_536
MAX_DRAWN = 500_000
MAX_VIA = 100
MAX_EDITED = 60_000
MAX_QUESTION = 500
# What zones have among their properties, and places have not; the last are of a nav2_route graph.
OF_ZONES = {'cost', 'kind', 'startid', 'endid'}
OTHERS = ('map', 'start', 'goal', 'reply', 'via', 'walls', 'drawn', 'confirm', 'why')
FIELDS = {*SETTINGS, *OTHERS}
# Without plug-ins: a page names no code.
PARAMETERS = {item.name: replace(item, plugins=None) for item in PLANNER if not item.node_only}
PARAMETERS['source'] = Parameter('source', 'none', 'Where waypoints come from.', choices=SOURCES)


@dataclass(frozen=True)
class PlayRequest:
    """A plan that the page asks for; cells are (x, y) on the map.

    `values` are those of all planning parameters and of `source`, of which the page has `given`
    some. `reply` is the text of a model's answer, used instead of the source; None for none.
    `places` are those of the map with those that were drawn, `zones` were drawn too. `confirm`
    answers the questions on the instruction. `walls` are cells that were drawn, int32 [n, 3],
    (x, y, occupancy). `question` is one about the path, '' for none.
    """

    play_map: PlayMap
    start: Cell
    goal: Cell
    values: dict[str, Any]
    given: dict[str, Any]
    reply: str | None
    via: tuple[Cell, ...]
    walls: NDArray[np.int32]
    places: Places
    zones: tuple[Zone, ...]
    confirm: bool | None
    question: str

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
    for name in body.keys() - FIELDS:
        raise PlayError(f'{name[:80]}: is not a field; there are {", ".join(sorted(FIELDS))}')
    play_map = maps.get(read_text(body, 'map', 200) or '')
    values = defaults(PARAMETERS.values(), cli=True)
    values |= {'corner_cutting': play_map.barriers is not None} | (given := read_settings(body))
    reply, confirm = read_text(body, 'reply', MAX_REPLY), body.get('confirm')
    if values['source'] == REPLY and reply is None:
        raise PlayError("reply: is missing; write a model's answer such as [[5, 5]]", REPLY)
    if not isinstance(confirm, bool | None):
        raise PlayError(f'confirm: {short_repr(confirm)} is not true or false', 'instruction')
    grid_map = play_map.grid_map
    start, goal = (read_cell(body.get(end), end, grid_map) for end in ('start', 'goal'))
    listed = read_list(body, 'via', MAX_VIA, 'cells')
    via = tuple(read_cell(cell, 'via', grid_map) for cell in listed)
    walls = read_walls(body, grid_map)
    drawn = read_drawn(read_text(body, 'drawn', MAX_DRAWN), play_map.places)
    question = read_text(body, 'why', MAX_QUESTION) or ''
    return PlayRequest(
        play_map, start, goal, values, given, reply, via, walls, *drawn, confirm, question
    )


def read_settings(body: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters that the page sets, by name. Raises PlayError."""
    given: dict[str, Any] = {}
    for name in SETTINGS:
        if body.get(name) is not None:
            with raising(partial(PlayError, field=name), '', ParameterError):
                given[name] = PARAMETERS[name].read(body[name])
    if 'instruction' in given:
        given['instruction'] = clean_instruction(given['instruction'])
    return given


def read_text(body: Mapping[str, Any], name: str, limit: int) -> str | None:
    """Return a text of at most `limit` characters, None for none. Raises PlayError."""
    text = body.get(name)
    if not isinstance(text, str | None):
        raise PlayError(f'{name}: a text is expected, not {short_repr(text)}', name)
    if text is not None and len(text) > limit:
        raise PlayError(f'{name}: {len(text)} characters are over {limit}; shorten it', name)
    return text


def read_cell(value: object, name: str, grid_map: GridMap) -> Cell:
    """Return a cell on the map. Raises PlayError."""
    if not isinstance(value, list) or [*map(type, value)] != [int, int]:
        problem = f'{short_repr(value)} is not a cell: send two whole numbers [x, y]'
    elif not grid_map.contains((value[0], value[1])):
        size = f'{grid_map.width} x {grid_map.height}'
        problem = f'{short_repr(value)} is off the map of {size} cells; choose a cell on it'
    else:
        return value[0], value[1]
    raise PlayError(f'{name}: {problem}', name)


def read_list(body: Mapping[str, Any], name: str, limit: int, what: str) -> list[Any]:
    """Return a list of up to `limit` values, empty for null. Raises PlayError."""
    value = [] if body.get(name) is None else body[name]
    if not isinstance(value, list):
        raise PlayError(f'{name}: a list of {what} is expected, not {short_repr(value)}', name)
    if len(value) > limit:
        raise PlayError(f'{name}: {len(value)} {what} are over {limit}; send fewer', name)
    return value


def read_walls(body: Mapping[str, Any], grid_map: GridMap) -> NDArray[np.int32]:
    """Return cells with their occupancy, int32 [n, 3]. Raises PlayError."""
    items = read_list(body, 'walls', MAX_EDITED, '[x, y, occupancy]')
    for item in items:
        read_cell(item[:2] if isinstance(item, list) else item, 'walls', grid_map)
        if len(item) != 3 or type(item[2]) is not int or not FREE <= item[2] <= OCCUPIED:
            raise PlayError(f'walls: {short_repr(item)} is not [x, y, 0 to {OCCUPIED}]', 'walls')
    return np.array(items, dtype=np.int32).reshape(-1, 3)


def read_drawn(text: str | None, places: Places) -> tuple[Places, tuple[Zone, ...]]:
    """Return places with those that were drawn, and the zones: features with a `cost` or a `kind`.

    A drawn place replaces one of its name. Raises PlayError.
    """
    with raising(partial(PlayError, field='drawn'), '', ValueError):
        parts: tuple[list[Any], list[Any]] = ([], [])
        for feature in features_of(parse_json(text), 'drawn') if text else ():
            parts[not OF_ZONES.isdisjoint(part_of(feature, 'properties'))].append(feature)
        added, zones = ({'type': 'FeatureCollection', 'features': part} for part in parts)
        drawn = places_from_geojson(added, 'drawn')
        kept = [place for place in places if drawn.get(place.name) is None]
        merged = Places([*kept, *drawn]) if len(drawn) else places
        return merged, zones_from_geojson(zones, 0.0)[0] if parts[1] else ()


def command_of(request: PlayRequest) -> str | None:
    """Return the command line, None where the map is edited."""
    if request.is_edited:
        return None
    play_map = request.play_map
    words = ['llm-astar', 'plan', '--map', play_map.file]
    words += [] if play_map.map_id is None else ['--map-id', str(play_map.map_id)]
    x_min, y_min = play_map.problem.offset
    cells = [('--start', request.start), ('--goal', request.goal)]
    for flag, (x, y) in (*cells, *(('--via', cell) for cell in request.via)):
        words += [flag, str(x + x_min), str(y + y_min)]
    for name, value in request.given.items():
        flag = name.replace('_', '-')
        if isinstance(value, bool):
            words.append(f'--{flag}' if value else f'--no-{flag}')
        elif name != 'source':
            # In one word: a value may begin with a dash.
            words.append(f'--{flag}={value}')
    words += ['--cells'] if play_map.is_metric else []
    words += [f'--why={request.question}'] if request.question else []
    if request.reply is not None:
        words.append(f'--reply={request.reply}')
    else:
        words += ['--source', request.values['source']]
    return shlex.join([*words, '--confirm'] if request.confirm else words)

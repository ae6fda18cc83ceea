"""MovingAI benchmark files: `.map` grids and `.map.scen` scenarios (movingai.com/benchmarks).

Coordinates are those of the files: x to the right, y down, row 0 is the first line.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap

PASSABLE = frozenset('.GS')
HEADER = ('type', 'height', 'width', 'map')
SCENARIO_FIELDS = 9


class MovingAiError(LlmAstarError, ValueError):
    """A file that is not a MovingAI map or scenario; the message names the file and the field."""


class Scenario(NamedTuple):
    """One row of a scenario file: a query on a map and the optimal length published for it.

    `optimal_length` is in cells, for 8-connected moves of 1 and sqrt(2) where a diagonal needs
    both adjacent cardinal cells free.
    """

    bucket: int
    map_name: str
    width: int
    height: int
    start: tuple[int, int]
    goal: tuple[int, int]
    optimal_length: float


def load_map(path: str | Path, *, resolution: float = 1.0, frame_id: str = 'map') -> GridMap:
    """Read a `.map` file: `.`, `G` and `S` are free, everything else is blocked.

    Raises MovingAiError that names the file and the field.
    """
    path = Path(path)
    lines = read_lines(path)
    header = {}
    for name, line in zip(HEADER, lines):
        words = line.split()
        if not words or words[0] != name:
            raise MovingAiError(f'{path}: {name}: is missing; the line is {short_repr(line)}')
        header[name] = words[1] if len(words) > 1 else ''
    if len(header) < 4:
        raise MovingAiError(f'{path}: {HEADER[len(header)]}: is missing')
    height = parse_size(header['height'], f'{path}: height')
    width = parse_size(header['width'], f'{path}: width')
    rows = lines[4 : 4 + height]
    if len(rows) < height:
        raise MovingAiError(f'{path}: map: {len(rows)} rows of {height}')
    cells = np.full((height, width), OCCUPIED, dtype=np.int8)
    for y, row in enumerate(rows):
        if len(row) != width:
            raise MovingAiError(f'{path}: map: row {y} has {len(row)} cells, not {width}')
        cells[y, [x for x, mark in enumerate(row) if mark in PASSABLE]] = FREE
    return GridMap(cells, resolution, frame_id=frame_id)


def load_scenarios(path: str | Path) -> list[Scenario]:
    """Read a `.scen` file, its rows in order. Raises MovingAiError that names file and row."""
    path = Path(path)
    lines = read_lines(path)
    if not lines or not lines[0].lower().startswith('version'):
        raise MovingAiError(f'{path}: version: is missing in the first line')
    rows = [line for line in lines[1:] if line.strip()]
    return [parse_scenario(line, f'{path}: row {index}') for index, line in enumerate(rows)]


def map_of(path: str | Path) -> Path:
    """Return the map file of a scenario file, in the same folder: `x.map` for `x.map.scen`.

    Raises MovingAiError where there is no such file.
    """
    path = Path(path)
    candidates = [path.with_suffix('')]
    scenarios = load_scenarios(path)
    if scenarios:
        candidates.append(path.parent / Path(scenarios[0].map_name).name)
    for candidate in candidates:
        if candidate.is_file() and candidate != path:
            return candidate
    tried = ', '.join(str(candidate) for candidate in candidates)
    raise MovingAiError(f'{path}: map: no such file: {tried}')


def parse_scenario(line: str, where: str) -> Scenario:
    """Read one row of a scenario file. Raises MovingAiError, which begins with `where`."""
    words = line.split('\t') if '\t' in line else line.split()
    if len(words) != SCENARIO_FIELDS:
        raise MovingAiError(f'{where}: {len(words)} fields, not {SCENARIO_FIELDS}')
    names = ('bucket', 'width', 'height', 'start x', 'start y', 'goal x', 'goal y')
    values = [
        parse_integer(word, f'{where}: {name}')
        for name, word in zip(names, words[:1] + words[2:8])
    ]
    bucket, width, height, start_x, start_y, goal_x, goal_y = values
    for name, x, y in (('start', start_x, start_y), ('goal', goal_x, goal_y)):
        if not (0 <= x < width and 0 <= y < height):
            raise MovingAiError(f'{where}: {name}: ({x}, {y}) is off {width} x {height} cells')
    try:
        length = float(words[8])
    except ValueError:
        raise MovingAiError(f'{where}: optimal length: {short_repr(words[8])}') from None
    start, goal = (start_x, start_y), (goal_x, goal_y)
    return Scenario(bucket, words[1], width, height, start, goal, length)


def read_lines(path: Path) -> list[str]:
    """Return the lines of a file. Raises MovingAiError."""
    try:
        return path.read_text(encoding='ascii', errors='replace').splitlines()
    except OSError as error:
        raise MovingAiError(f'{path}: {error.strerror or error}') from None


def parse_size(word: str, name: str) -> int:
    """Return a whole number above 0. Raises MovingAiError, which begins with `name`."""
    value = parse_integer(word, name)
    if value < 1:
        raise MovingAiError(f'{name}: {value} is not 1 or more')
    return value


def parse_integer(word: str, name: str) -> int:
    """Return a whole number. Raises MovingAiError, which begins with `name`."""
    try:
        return int(word)
    except ValueError:
        raise MovingAiError(f'{name}: {short_repr(word)} is not a whole number') from None

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""MovingAI benchmark files: `.map` grids and `.map.scen` scenarios (movingai.com/benchmarks).

Coordinates are those of the files: x to the right, y down, row 0 is the first line.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr
from llm_astar_msgs_adapter.files import read_bytes, read_text
from llm_astar_msgs_adapter.maps.grid_map import FREE, MAX_CELLS, OCCUPIED, GridMap

PASSABLE = b'.GS'
# What each character says of its cell.
MEANINGS = np.full(256, OCCUPIED, dtype=np.int8)
MEANINGS[list(PASSABLE)] = FREE
# A character a cell, and room for the header and the line ends.
MAX_FILE_BYTES = 2 * MAX_CELLS
MAX_SCENARIOS = 100_000
MAX_SCENARIO_BYTES = 16_000_000
# Characters of a line of the header; numbers have few.
MAX_LINE = 200
# Of a whole number.
MAX_DIGITS = 18
HEADER = ('type', 'height', 'width', 'map')


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
    contents = read_bytes(path, MovingAiError, MAX_FILE_BYTES)
    header, end = {}, 0
    for name in HEADER:
        begin, end = end, contents.find(b'\n', end) + 1 or len(contents)
        line = contents[begin : min(end, begin + MAX_LINE)].decode('ascii', 'replace')
        words = line.split()
        if not words or words[0] != name:
            shown = short_repr(line.strip())
            raise MovingAiError(f'{path}: {name}: is missing; the line is {shown}')
        header[name] = words[1] if len(words) > 1 else ''
    height = parse_integer(header['height'], f'{path}: height', minimum=1)
    width = parse_integer(header['width'], f'{path}: width', minimum=1)
    if height * width > MAX_CELLS:
        raise MovingAiError(f'{path}: height, width: over {MAX_CELLS} cells')
    return GridMap(read_rows(contents, end, (height, width), path), resolution, frame_id=frame_id)


def read_rows(contents: bytes, begin: int, shape: tuple[int, int], path: Path) -> NDArray[np.int8]:
    """Return the cells [height, width] of the lines that begin at a byte. Raises MovingAiError.

    Takes two bytes a cell besides `contents`: rows as Python texts would take 50 for each row.
    """
    height, width = shape
    line_end = b'\r\n' if contents[begin - 2 : begin] == b'\r\n' else b'\n'
    marks = np.frombuffer(contents, dtype=np.uint8)[begin:]
    if not contents.endswith(b'\n'):
        marks = np.concatenate((marks, np.frombuffer(line_end, dtype=np.uint8)))
    stride = width + len(line_end)
    rows = marks[: len(marks) // stride * stride].reshape(-1, stride)[:height]
    wrong = (rows[:, -1] != ord('\n')) | (rows[:, :width] == ord('\n')).any(axis=1)
    if wrong.any():
        y = int(wrong.argmax())
        row = contents[begin + y * stride :].split(b'\n', 1)[0].rstrip(b'\r')
        raise MovingAiError(f'{path}: map: row {y} has {len(row)} cells, not {width}')
    if len(rows) < height:
        raise MovingAiError(f'{path}: map: {len(rows)} rows of {height}')
    return MEANINGS[rows[:, :width]]


def load_scenarios(path: str | Path) -> list[Scenario]:
    """Read a `.scen` file, its rows in order. Raises MovingAiError that names file and row."""
    path = Path(path)
    text = read_text(path, MovingAiError, 'ascii', 'replace', MAX_SCENARIO_BYTES)
    if text.count('\n') > MAX_SCENARIOS:
        raise MovingAiError(f'{path}: over {MAX_SCENARIOS} rows')
    lines = text.splitlines()
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
    if len(words) != 9:
        raise MovingAiError(f'{where}: {len(words)} fields, not 9')
    names = ('bucket', 'width', 'height', 'start x', 'start y', 'goal x', 'goal y')
    given = zip(names, words[:1] + words[2:8])
    values = [parse_integer(word, f'{where}: {name}') for name, word in given]
    bucket, width, height, *ends = values
    start, goal = (ends[0], ends[1]), (ends[2], ends[3])
    for name, (x, y) in (('start', start), ('goal', goal)):
        if not (0 <= x < width and 0 <= y < height):
            raise MovingAiError(f'{where}: {name}: ({x}, {y}) is off {width} x {height} cells')
    try:
        length = float(words[8])
    except ValueError:
        raise MovingAiError(f'{where}: optimal length: {short_repr(words[8])}') from None
    return Scenario(bucket, words[1], width, height, start, goal, length)


def parse_integer(word: str, name: str, minimum: int | None = None) -> int:
    """Return a whole number. Raises MovingAiError, which begins with `name`."""
    try:
        value = int(word if len(word) <= MAX_DIGITS else '')
    except ValueError:
        raise MovingAiError(f'{name}: {short_repr(word)} is not a whole number') from None
    if minimum is not None and value < minimum:
        raise MovingAiError(f'{name}: {value} is not {minimum} or more')
    return value

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Barrier maps, the paper's dataset format: loaded, validated, saved, scaled and rasterised.

A dataset is a JSON list of `{id, range_x, range_y, horizontal_barriers [y, x0, x1],
vertical_barriers [x, y0, y1], start_goal [[start, goal, query], ...]}` (LLM-A* paper, sec. 4.1).
Ours may have a `family` too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.errors import LlmAstarError, expect, short_repr
from llm_astar_msgs_adapter.files import read_json
from llm_astar_msgs_adapter.maps.grid_map import FREE, MAX_CELLS, OCCUPIED, GridMap, Pose2D

Point = tuple[int, int]
# Characters of the name of a family of maps.
MAX_FAMILY = 40
# Numbers are below this one, so that errors can show them and floats hold them.
MAX_NUMBER = 2**53


class BarrierMapError(LlmAstarError, ValueError):
    """A barrier map that cannot be used; the message names the file, the map and the field."""


class Barrier(NamedTuple):
    """A straight barrier: its `line` (y if horizontal, x if vertical), both ends inclusive."""

    line: int
    first: int
    last: int


# A map of a dataset, which has an `id`: barriers, or a grid.
MapWithId = TypeVar('MapWithId', bound=Any)


class Sample(NamedTuple):
    """One start-goal pair in lattice coordinates, with its natural-language query."""

    start: Point
    goal: Point
    query: str = ''


@dataclass(frozen=True)
class BarrierMap:
    """A lattice of integer points with straight barriers, all coordinates in lattice units.

    `range_x` and `range_y` are half open: x_min <= x < x_max. The outermost lattice lines are
    walls, as in the paper's published environment. `family` names the kind of map, '' if unknown.
    """

    id: int
    range_x: Point
    range_y: Point
    horizontal_barriers: tuple[Barrier, ...] = ()
    vertical_barriers: tuple[Barrier, ...] = ()
    samples: tuple[Sample, ...] = ()
    family: str = ''

    def to_grid(self, resolution: float = 1.0, frame_id: str = 'map') -> GridMap:
        """Rasterise: lattice point (x, y) becomes the centre of its cell, at (x, y) * resolution.

        Both ends of a barrier are blocked; a barrier of length zero blocks one cell. The outermost
        cells are blocked. The origin is (min - 0.5) * resolution.
        """
        (x_min, y_min), (width, height) = self.offset, self.size
        # One row and column more than the map, since barriers in the published data lie there.
        cells: NDArray[np.int8] = np.full((height + 1, width + 1), FREE, dtype=np.int8)
        for y, first, last in self.horizontal_barriers:
            cells[y - y_min, first - x_min : last - x_min + 1] = OCCUPIED
        for x, first, last in self.vertical_barriers:
            cells[first - y_min : last - y_min + 1, x - x_min] = OCCUPIED
        cells = cells[:-1, :-1]
        cells[[0, -1], :] = OCCUPIED
        cells[:, [0, -1]] = OCCUPIED
        origin = Pose2D((x_min - 0.5) * resolution, (y_min - 0.5) * resolution)
        return GridMap(cells, resolution, origin, frame_id)

    @property
    def offset(self) -> Point:
        """The lattice coordinates (x_min, y_min) of cell (0, 0)."""
        return self.range_x[0], self.range_y[0]

    @property
    def size(self) -> Point:
        """Width and height in cells."""
        (x_min, x_max), (y_min, y_max) = self.range_x, self.range_y
        return x_max - x_min, y_max - y_min

    def to_cell(self, point: Point) -> Point:
        """Return the cell of a lattice point: the same point counted from (x_min, y_min)."""
        x_min, y_min = self.offset
        return point[0] - x_min, point[1] - y_min

    def open_ended(self) -> BarrierMap:
        """Return the map with every barrier one cell shorter at its end; those of one cell vanish.

        This is how the paper's published waypoint filter treats barriers.
        """
        horizontal, vertical = (
            tuple(b._replace(last=b.last - 1) for b in barriers if b.first < b.last)
            for barriers in (self.horizontal_barriers, self.vertical_barriers)
        )
        return replace(self, horizontal_barriers=horizontal, vertical_barriers=vertical)

    def scale(self, factor: int) -> BarrierMap:
        """Multiply every coordinate by `factor` >= 1, the paper's scaled environments.

        Barriers stay one cell thick. Queries are dropped, since they name the old coordinates.
        Raises BarrierMapError for less than 1 and for more cells than a map may have.
        """
        check_scale(factor, math.prod(self.size), self.id, BarrierMapError)
        if factor == 1:
            return self

        def scaled(values: Iterable[int]) -> Any:  # noqa: ANN401 - as many as there are values
            return tuple(value * factor for value in values)

        return replace(
            self,
            range_x=scaled(self.range_x),
            range_y=scaled(self.range_y),
            horizontal_barriers=tuple(Barrier(*scaled(b)) for b in self.horizontal_barriers),
            vertical_barriers=tuple(Barrier(*scaled(b)) for b in self.vertical_barriers),
            samples=tuple(Sample(scaled(item.start), scaled(item.goal)) for item in self.samples),
        )

    def to_json(self) -> dict[str, Any]:
        """Return the paper's JSON object for this map."""
        return {
            'id': self.id,
            'range_x': list(self.range_x),
            'range_y': list(self.range_y),
            'horizontal_barriers': list(map(list, self.horizontal_barriers)),
            'vertical_barriers': list(map(list, self.vertical_barriers)),
            'start_goal': [
                [list(sample.start), list(sample.goal), sample.query] for sample in self.samples
            ],
            **({'family': self.family} if self.family else {}),
        }


def load_barrier_maps(path: str | Path) -> list[BarrierMap]:
    """Read a dataset: every map of a barrier-map JSON file, validated.

    Raises BarrierMapError with the file, the map and the field that are wrong.
    """
    return parse_barrier_maps(read_json(path, BarrierMapError), path)


def parse_barrier_maps(data: object, path: str | Path) -> list[BarrierMap]:
    """Validate the contents of a dataset file; raises as `load_barrier_maps` does."""
    if isinstance(data, list) and data:
        return parse_each(data, path, parse_barrier_map)
    raise BarrierMapError(f'{path}: a JSON list of barrier maps is expected')


def parse_each(
    entries: Sequence[Any], path: str | Path, parse: Callable[[Any, str], MapWithId]
) -> list[MapWithId]:
    """Return the maps of a file by a function of each entry and what errors call it.

    Raises what that raises, and BarrierMapError for an id that is used twice.
    """
    maps: dict[int, MapWithId] = {}
    for index, entry in enumerate(entries):
        where = f'{path}: map at index {index}'
        parsed = parse(entry, where)
        if maps.setdefault(parsed.id, parsed) is not parsed:
            raise BarrierMapError(f'{where}: id: {parsed.id} is used twice')
    return list(maps.values())


def find_barrier_map(maps: Sequence[MapWithId], map_id: int) -> MapWithId:
    """Return the map with an id. Raises BarrierMapError, which lists the ids of the maps."""
    for item in maps:
        if item.id == map_id:
            return item
    ids = ', '.join(str(item.id) for item in maps[:20])
    more = ', ...' if len(maps) > 20 else ''
    raise BarrierMapError(f'map id {map_id} is not in the file; it holds {ids}{more}')


def check_scale(factor: int, cells: int, map_id: int, error: type[LlmAstarError]) -> None:
    """Raise an error for a scale below 1, and for one at which a map has too many cells."""
    if factor < 1:
        raise error(f'scale: {factor} is not 1 or more')
    if cells * factor**2 > MAX_CELLS:
        words = f'{factor} gives map {map_id} over {MAX_CELLS} cells; choose a smaller one'
        raise error(f'scale: {words}')


def parse_barrier_map(entry: object, where: str = 'barrier map') -> BarrierMap:
    """Validate one map of the paper's JSON.

    Raises BarrierMapError that begins with `where` and names the field.
    """
    held = expect(entry, dict, where, 'an object', BarrierMapError)
    map_id = parse_integer(held.get('id', 0), f'{where}: id')
    where = f'{where} (id {map_id})'
    for field in ('range_x', 'range_y'):
        if field not in held:
            raise BarrierMapError(f'{where}: {field}: is missing')
    range_x, range_y = (parse_range(held[f], f'{where}: {f}') for f in ('range_x', 'range_y'))
    if (range_x[1] - range_x[0]) * (range_y[1] - range_y[0]) > MAX_CELLS:
        raise BarrierMapError(f'{where}: range_x, range_y: over {MAX_CELLS} cells')

    def parse_list(field: str, parse: Callable[..., Any], *ranges: Point) -> tuple[Any, ...]:
        name = f'{where}: {field}'
        values = expect(held.get(field, []), list, name, 'a list', BarrierMapError)
        return tuple(parse(value, f'{name}[{i}]', *ranges) for i, value in enumerate(values))

    return BarrierMap(
        map_id,
        range_x,
        range_y,
        parse_list('horizontal_barriers', parse_barrier, range_y, range_x),
        parse_list('vertical_barriers', parse_barrier, range_x, range_y),
        parse_list('start_goal', parse_sample, range_x, range_y),
        parse_family(held, f'{where}: family'),
    )


def parse_family(entry: dict[str, Any], name: str) -> str:
    """Return the `family` of a map's JSON, '' without one.

    Raises BarrierMapError, which begins with `name`.
    """
    family = entry.get('family', '')
    if isinstance(family, str) and len(family) <= MAX_FAMILY and family.isprintable():
        return family
    words = f'up to {MAX_FAMILY} printable characters are expected'
    raise BarrierMapError(f'{name}: {words}, not {short_repr(family)}')


def parse_integer(value: object, name: str) -> int:
    """Return a whole number below MAX_NUMBER. Raises BarrierMapError, which begins with `name`."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value // 1:
        raise BarrierMapError(f'{name}: a whole number is expected, not {short_repr(value)}')
    if abs(value) >= MAX_NUMBER:
        raise BarrierMapError(f'{name}: {short_repr(value)} is not below {MAX_NUMBER}')
    return int(value)


def parse_integers(value: object, name: str, ranges: Mapping[str, Point]) -> list[int]:
    """Return a whole number from the least to the greatest of each range.

    Raises BarrierMapError, which begins with `name` and what the range is called.
    """
    if not isinstance(value, (list, tuple)) or len(value) != len(ranges):
        words = f'{len(ranges)} whole numbers are expected'
        raise BarrierMapError(f'{name}: {words}, not {short_repr(value)}')
    numbers = [parse_integer(item, name) for item in value]
    for number, (label, (low, high)) in zip(numbers, ranges.items()):
        if not low <= number <= high:
            raise BarrierMapError(f'{name}{label}: {number} is outside the range {low} to {high}')
    return numbers


def parse_range(value: object, name: str) -> Point:
    """Return a half-open range. Raises BarrierMapError, which begins with `name`."""
    anything = -MAX_NUMBER, MAX_NUMBER
    low, high = parse_integers(value, name, {' low': anything, ' high': anything})
    if high - low < 3:
        raise BarrierMapError(f'{name}: [{low}, {high}] leaves no room between its walls')
    return low, high


def parse_barrier(value: object, name: str, across: Point, along: Point) -> Barrier:
    """Return a barrier whose line is in the range `across` and whose ends are in `along`.

    Raises BarrierMapError, which begins with `name`.
    """
    # Up to the open end of the range, one past the last lattice line, as in the published data.
    ranges = {': line': across, ': first': along, ': last': along}
    barrier = Barrier(*parse_integers(value, name, ranges))
    if barrier.first > barrier.last:
        raise BarrierMapError(f'{name}: ends {barrier.first} > {barrier.last}; swap them')
    return barrier


def parse_sample(value: object, name: str, range_x: Point, range_y: Point) -> Sample:
    """Return a sample with both points in range. Raises BarrierMapError beginning with `name`."""
    if not isinstance(value, (list, tuple)) or len(value) not in (2, 3):
        raise BarrierMapError(f'{name}: [start, goal, query] is expected, not {short_repr(value)}')
    ranges = {' x': (range_x[0], range_x[1] - 1), ' y': (range_y[0], range_y[1] - 1)}
    (x0, y0), (x1, y1) = (
        parse_integers(item, f'{name}: {label}', ranges)
        for label, item in zip(('start', 'goal'), value)
    )
    text = expect([*value, ''][2], str, f'{name}: query', 'a string', BarrierMapError)
    return Sample((x0, y0), (x1, y1), text)

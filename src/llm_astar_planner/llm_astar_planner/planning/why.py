# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Why there is no path: the fewest causes whose removal opens a way, and what passes instead.

What closes cells is parted into causes: each clause, zone and mask, unknown cells, the robot's
radius. Cells closed by the same causes are one group; a best-first search over sets of causes
floods what each set opens from where the smaller set ended, so the first set that reaches the
goal is a smallest one. Where all together do not, walls do it. How wide a robot passes is found
by a widest path search.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.costmap.inflation import inflate, squared_cells
from llm_astar_planner.planning._kernels import causes as kernels
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph, path_length
from llm_astar_planner.search.jump import jump_search
from llm_astar_planner.search.result import Cell
from llm_astar_planner.search.stop import no_stop

Mask = NDArray[np.bool_]
Items = frozenset[int]
Point = tuple[float, float]
Window = tuple[slice, slice]
WHOLE: Window = slice(None), slice(None)
CLAUSE, ZONE, MASK, UNKNOWN, RADIUS, WALLS, FOOTPRINT = (
    'clause', 'zone', 'mask', 'unknown', 'radius', 'walls', 'footprint',
)  # fmt: skip
# Of sets with equally many causes, what a person changes most easily is named.
ORDER = (CLAUSE, ZONE, MASK, UNKNOWN, RADIUS)
# How much one place in this order counts: less than one cause more.
PLACE = 1e-4
# Sets that are tried until any set will do that cannot spare one of its causes.
MOST_SETS = 256
# Metres, as the widest way of a robot whose size is not known is measured.
WIDEST = 10.0
# Sets tried before it is looked at whether all causes together close the way.
SOON = 8
ROUNDING = 1e-6


class Layers:
    """The cells in groups that the same causes close; walls, which nothing opens, are group 0."""

    def __init__(self, walls: Mask) -> None:
        """Start with walls, bool [height, width], and nothing else closed."""
        height, width = walls.shape
        self.groups = np.zeros((height + 2, width + 2), dtype=np.int32)
        self.cells = self.groups[1:-1, 1:-1]
        np.logical_not(walls, out=self.cells, casting='unsafe')
        self.sets: list[Items | None] = [None, frozenset()]
        self._numbers: dict[Items, int] = {frozenset(): 1}

    def close(self, cause: int, closed: Mask, window: Window = WHOLE) -> None:
        """Let a cause close cells of a window of the map."""
        part = self.cells[window]
        inside = part[closed]
        table = np.arange(len(self.sets), dtype=np.int32)
        for number in np.flatnonzero(np.bincount(inside, minlength=len(self.sets))).tolist():
            items = self.sets[number]
            if items is not None:
                table[number] = self._number(items | {cause})
        part[closed] = table[inside]

    def _number(self, items: Items) -> int:
        number = self._numbers.setdefault(items, len(self.sets))
        if number == len(self.sets):
            self.sets.append(items)
        return number

    def is_open(self, removed: Items) -> Mask:
        """Return which groups are open without some causes: bool [groups]."""
        return np.array([items is not None and items <= removed for items in self.sets])


class Flood(NamedTuple):
    """What is reached: `target` is a flat cell or -1, `edges` the closed cells that were met."""

    target: int
    seen: NDArray[np.uint8]
    edges: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Goals:
    """The map in the frame of the kernels: its steps, the start, and the cells to reach."""

    steps: NDArray[np.int32]
    start: int
    targets: Mask

    @classmethod
    def of(cls, costmap: Costmap, start: Cell, goal: Cell, tolerance: float) -> Goals:
        """Take the cells at most `tolerance` metres from `goal`."""
        height, width = costmap.blocked.shape
        across, targets = width + 2, np.zeros((height + 2, width + 2), dtype=np.bool_)
        reach = squared_cells(tolerance, costmap.grid_map.resolution)
        far = min(math.isqrt(reach), height + width)
        y, x = np.ogrid[-far : far + 1, -far : far + 1]
        rows, columns = np.nonzero(x * x + y * y <= reach)
        rows, columns = rows + goal[1] - far, columns + goal[0] - far
        inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        targets[rows[inside] + 1, columns[inside] + 1] = True
        steps = [1, -1, across, -across]
        if costmap.config.corner_cutting:
            steps += [across + 1, across - 1, 1 - across, -1 - across]
        first = (start[1] + 1) * across + start[0] + 1
        return cls(np.array(steps, dtype=np.int32), first, targets.reshape(-1))

    def cell(self, number: int) -> Cell:
        """Return the cell (x, y) of the map with a number of the frame."""
        y, x = divmod(number, int(self.steps[2]))
        return x - 1, y - 1

    def flood(self, layers: Layers, removed: Items, before: Flood | None = None) -> Flood:
        """Reach what is open without some causes, further than `before` without fewer did."""
        groups, is_open = layers.groups.reshape(-1), layers.is_open(removed)
        stack, edges = np.empty(groups.size, dtype=np.int32), np.empty(groups.size, dtype=np.int32)
        if not is_open[groups[self.start]]:
            return Flood(-1, np.zeros(groups.size, dtype=np.uint8), edges[:0])
        if before is None:
            seen, first = np.zeros(groups.size, dtype=np.uint8), np.array([self.start])
            left = np.zeros(0, dtype=np.int32)
        else:
            seen, is_first = before.seen.copy(), is_open[groups[before.edges]]
            first, left = before.edges[is_first], before.edges[~is_first]
        stack[: len(first)] = first
        target, met = kernels.flood(
            groups, is_open, self.steps, self.targets, seen, stack, len(first), edges
        )
        return Flood(target, seen, np.concatenate((left, edges[:met])))


class Found(NamedTuple):
    """A smallest set of causes, the layers in which it opens a way, and the cell it leads to."""

    removed: Items
    layers: Layers
    target: int


class Causes:
    """All that closes cells of a costmap, by number; `names` are pairs of a kind and a name."""

    def __init__(self, costmap: Costmap, clauses: Sequence[tuple[str, Mask]] = ()) -> None:
        """Take a costmap, and which of its cells each clause of an instruction closes."""
        grid_map, config = costmap.grid_map, costmap.config
        composed = grid_map.composed
        self.base = grid_map if composed is None else composed.base
        self.config = replace(config, inflation_radius=0.0, allow_unknown=True)
        self.resolution = grid_map.resolution
        self.names: list[tuple[str, str]] = []
        cells, bare = self.base.cells, config.obstacle_threshold
        is_plain = self.base is grid_map and config.allow_unknown
        walls = costmap.blocked if is_plain else inflate(self.base, self.config)[0]
        self.lethal = cells >= bare
        self.layers = [Layers(walls)]
        # Without the robot's radius, also that with which a costmap was inflated.
        if config.robot_radius > 0.0 or bare > config.occupied_threshold:
            self.layers.append(Layers(self.lethal))
            self.radius = self.add(RADIUS)
        for name, closed in clauses:
            self.add(CLAUSE, name, WHOLE, closed)
        # Zones are lethal, so they too keep the robot away by its radius.
        self.zones: dict[int, tuple[Window, Mask]] = {}
        for kind, name, window, closed in () if composed is None else composed.closed():
            number = self.add(kind, name, window, closed, is_lethal=True)
            self.zones[number] = window, closed
        if not config.allow_unknown:
            self.add(UNKNOWN, '', WHOLE, self.base.cells < 0)

    def add(
        self,
        kind: str,
        name: str = '',
        window: Window = WHOLE,
        closed: Mask | None = None,
        *,
        is_lethal: bool = False,
    ) -> int:
        """Add what closes cells of a window, around it too if that `is_lethal`."""
        number = len(self.names)
        self.names.append((kind, name))
        for layers in self.layers if closed is not None else ():
            around = window, closed
            if is_lethal and layers is self.layers[0] and self.config.robot_radius > 0.0:
                around = grown(window, closed, self.base, self.config)
            layers.close(number, around[1], around[0])
        return number

    def price(self, removed: Items) -> float:
        """Return how much a set of causes is: the least is named."""
        return sum(1.0 + PLACE * ORDER.index(self.names[item][0]) for item in removed)

    def roots(self) -> Iterator[tuple[Items, Layers]]:
        """Yield the sets that a search begins with: none, and the robot's radius."""
        for layers in self.layers:
            yield frozenset() if layers is self.layers[0] else frozenset({self.radius}), layers

    def least(self, goals: Goals, reached: Flood) -> Found | None:
        """Return a smallest set of causes without which a way leads to the goal, None for none.

        `reached` is what the start reaches with all of them.
        """
        if reached.target >= 0:
            return Found(frozenset(), self.layers[0], reached.target)
        numbers, queue, done = count(), [], set[tuple[int, Items]]()
        for removed, layers in self.roots():
            at = layers.sets[layers.groups.reshape(-1)[goals.start]]
            if at is not None:
                # What is open with the radius is so without it.
                before = reached if not at and len(reached.edges) else None
                removed |= at
                queue.append((self.price(removed), next(numbers), removed, layers, before))
        heapq.heapify(queue)
        while queue:
            _, _, removed, layers, before = heapq.heappop(queue)
            if (id(layers), removed) in done:
                continue
            done.add((id(layers), removed))
            if len(done) == SOON and self.all_open(goals) is None:
                return None
            if len(done) > MOST_SETS:
                return self.any_set(goals)
            found = goals.flood(layers, removed, before)
            if found.target >= 0:
                return Found(removed, layers, found.target)
            met = np.bincount(layers.groups.reshape(-1)[found.edges], minlength=1)
            for number in np.flatnonzero(met[1:]).tolist():
                more = removed | (layers.sets[number + 1] or removed)
                entry = (self.price(more), next(numbers), more, layers, found)
                heapq.heappush(queue, entry)
        return None

    def all_open(self, goals: Goals) -> Found | None:
        """Return the set of all causes where that opens a way, at best with the radius kept."""
        for layers in self.layers:
            every = frozenset(range(len(self.names)))
            if len(self.layers) > 1 and layers is self.layers[0]:
                every -= {self.radius}
            if layers.groups.reshape(-1)[goals.start]:
                target = goals.flood(layers, every).target
                if target >= 0:
                    return Found(every, layers, target)
        return None

    def any_set(self, goals: Goals) -> Found | None:
        """Return a set that opens a way and of which none can be spared; None for none."""
        found = self.all_open(goals)
        size = len(found.removed) if found else 0
        while found is not None and size:
            for part in np.array_split(sorted(found.removed), math.ceil(len(found.removed) / size)):
                fewer = found.removed - {*part.tolist()}
                is_needed = found.layers is self.layers[-1] and len(self.layers) > 1
                if is_needed and self.radius in part:
                    continue
                is_open = found.layers.is_open(fewer)
                if is_open[found.layers.groups.reshape(-1)[goals.start]]:
                    target = goals.flood(found.layers, fewer).target
                    found = found if target < 0 else Found(fewer, found.layers, target)
            size //= 2
        return found

    def room(self, found: Found) -> NDArray[np.int32]:
        """Return how far each open cell is from what stays lethal, squared, in cells.

        Int32 [height, width] with the frame, 0 where it is closed; at most what a robot needs.
        """
        lethal = self.lethal.copy()
        for number, (window, closed) in self.zones.items():
            if number not in found.removed:
                lethal[window] |= closed
        radius = self.config.robot_radius or WIDEST
        reach = math.isqrt(squared_cells(radius, self.resolution)) + 1
        room = np.zeros(found.layers.groups.shape, dtype=np.int32)
        is_open = found.layers.is_open(found.removed)
        reach = min(reach, max(lethal.shape))
        kernels.fill_room(lethal, reach, found.layers.cells, is_open, room[1:-1, 1:-1])
        return room


def grown(
    window: Window, closed: Mask, grid_map: GridMap, config: CostmapConfig
) -> tuple[Window, Mask]:
    """Return the cells that lethal cells of a window close to the robot, and their window."""
    reach = math.isqrt(squared_cells(config.robot_radius, grid_map.resolution))
    sides = [part.indices(size)[:2] for part, size in zip(window, grid_map.cells.shape)]
    around = [
        (max(first - reach, 0), min(last + reach, size))
        for (first, last), size in zip(sides, grid_map.cells.shape)
    ]
    (top, bottom), (left, right) = around
    cells = np.zeros((bottom - top, right - left), dtype=np.int8)
    inner = [slice(a - c, b - c) for (a, b), (c, _) in zip(sides, around)]
    cells[inner[0], inner[1]][closed] = 100
    blocked = inflate(GridMap(cells, grid_map.resolution), config)[0]
    return (slice(top, bottom), slice(left, right)), blocked


class Nearest(NamedTuple):
    """A cell that can be reached, its centre in metres, and its distance to the goal."""

    cell: Cell
    point: Point
    short_of: float


@dataclass(frozen=True)
class Why:
    """Why there is no path: a sentence, and what it says as values for reports.

    `causes` are objects with a `kind`; points are (x, y) in metres of the map's frame. `length`
    is that of the shortest path without the causes, in metres, NaN where walls close the way.
    `nearest` is what can be reached nearest to the goal, None where the goal can.
    """

    sentence: str
    causes: tuple[dict[str, Any], ...]
    length: float = math.nan
    nearest: Nearest | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the form of reports and `--json`."""
        nearest = self.nearest
        return {
            'sentence': self.sentence,
            'causes': list(self.causes),
            'length': round(self.length, 3) if math.isfinite(self.length) else None,
            'nearest': None if nearest is None else nearest.point,
            'short_of': None if nearest is None else nearest.short_of,
        }


@dataclass(frozen=True, eq=False)
class Explainer:
    """Says why no path leads from a cell to within `tolerance` metres of another."""

    costmap: Costmap
    start: Cell
    goal: Cell
    tolerance: float = 0.0
    clauses: Sequence[tuple[str, Mask]] = ()
    goal_name: str = 'goal'
    has_footprint: bool = False

    def explain(self) -> Why | None:
        """Return why, None where no cell is in the way and the robot has no footprint."""
        causes = Causes(self.costmap, self.clauses)
        goals = Goals.of(self.costmap, self.start, self.goal, self.tolerance)
        reached = goals.flood(causes.layers[0], frozenset())
        found = causes.least(goals, reached)
        if found is None:
            entries, length = (self.walls(causes, goals),), math.nan
        elif found.removed:
            entries, length = self.opened(causes, goals, found)
        elif self.has_footprint:
            _, _, widest = self.widest_path(causes, goals, found)
            entries, length = ({'kind': FOOTPRINT, **widest},), math.nan
        else:
            return None
        nearest = self.nearest(reached)
        return Why(self.sentence(entries, length, nearest), entries, length, nearest)

    def opened(
        self, causes: Causes, goals: Goals, found: Found
    ) -> tuple[tuple[dict[str, Any], ...], float]:
        """Return the causes found as values, and the length of the path without them."""
        layers, across = found.layers, int(goals.steps[2])
        facts: dict[int, dict[str, Any]] = {item: {} for item in sorted(found.removed)}
        has_radius = len(causes.layers) > 1 and causes.radius in found.removed
        if has_radius:
            cells, target, widest = self.widest_path(causes, goals, found)
            metres = widest.pop('room')
            facts[causes.radius] = {
                'radius': causes.config.robot_radius, 'passes': below(metres), **widest
            }  # fmt: skip
        else:
            is_open = layers.is_open(found.removed)[layers.cells]
            cells, target = self.path(~is_open, goals.cell(found.target)), found.target
        ends = {'start': goals.start, 'goal': target}
        flat = (cells[:, 1].astype(np.int64) + 1) * across + cells[:, 0] + 1
        on_path = layers.groups.reshape(-1)[flat]
        for item, fact in facts.items():
            has_item = np.array([items is not None and item in items for items in layers.sets])
            met = np.flatnonzero(has_item[on_path])
            if len(met):
                first, last = (cells[met[end]].tolist() for end in (0, -1))
                fact |= {'from': self.metres(first), 'to': self.metres(last)}
            holds = [name for name, cell in ends.items() if has_item[layers.groups.flat[cell]]]
            fact |= {'holds': holds} if holds else {}
        entries = tuple(
            {'kind': kind, 'name': name} | facts[item] if name else {'kind': kind} | facts[item]
            for item, (kind, name) in enumerate(causes.names) if item in facts
        )  # fmt: skip
        return entries, path_length(cells) * causes.resolution

    def path(self, blocked: Mask, goal: Cell) -> NDArray[np.int32]:
        """Return the shortest path on cells that would be open; empty if it is too long."""
        grid = GridGraph(blocked, corner_cutting=self.costmap.config.corner_cutting)
        if not grid.corner_cutting:
            return jump_search(grid, self.start, goal, stop=no_stop()).path
        return exact_astar(grid, self.start, goal, want_expanded=False).path

    def widest_path(
        self, causes: Causes, goals: Goals, found: Found
    ) -> tuple[NDArray[np.int32], int, dict[str, Any]]:
        """Return the shortest of the widest ways, its flat target, and where it is narrowest."""
        room = causes.room(found)
        target, least, where = kernels.widest(
            room.reshape(-1), goals.steps, goals.targets, goals.start
        )
        cells = self.path(room[1:-1, 1:-1] < least, goals.cell(target))
        metres = math.sqrt(least) * causes.resolution
        return cells, target, {'room': metres, 'at': self.metres(goals.cell(where))}

    def walls(self, causes: Causes, goals: Goals) -> dict[str, Any]:
        """Say what only walls close: an end in one of them, or the smaller of two rooms."""
        layers = causes.layers[-1]
        groups, every = layers.groups.reshape(-1), frozenset(range(len(causes.names)))
        cells = {'start': np.array([goals.start]), 'goal': np.flatnonzero(goals.targets)}
        areas = {}
        for name, ends in cells.items():
            free = ends[groups[ends] > 0]
            if not len(free):
                return {'kind': WALLS, 'holds': [name]}
            nowhere = replace(goals, start=int(free[0]), targets=np.zeros_like(goals.targets))
            seen = nowhere.flood(layers, every).seen
            areas[name] = float((seen == kernels.REACHED).sum()) * causes.resolution**2
        name = 'start' if areas['start'] < areas['goal'] else 'goal'
        return {'kind': WALLS, 'room': name, 'area': round(areas[name], 3)}

    def nearest(self, reached: Flood) -> Nearest | None:
        """Return the cell reached that is nearest to the goal, and its distance in metres."""
        height, width = self.costmap.blocked.shape
        seen = reached.seen.reshape(height + 2, width + 2)[1:-1, 1:-1]
        row, column = kernels.nearest_reached(seen, *self.goal)
        cell = column, row
        if row < 0 or cell == self.goal:
            return None
        short = math.dist(cell, self.goal) * self.costmap.grid_map.resolution
        return Nearest(cell, self.metres(cell), round(short, 3))

    def metres(self, cell: Sequence[int]) -> Point:
        """Return the centre of a cell in metres of the map's frame."""
        x, y = self.costmap.grid_map.grid_to_world([cell])[0].tolist()
        return round(x, 3), round(y, 3)

    def place(self, point: Point) -> str:
        """Name a point as `Costmap.describe_cell` does, but its metres alone where there are any.

        """
        words = self.costmap.describe_cell(self.costmap.grid_map.world_to_cell(*point))
        return words.rpartition(' at ')[2]

    def sentence(
        self, entries: Sequence[dict[str, Any]], length: float, nearest: Nearest | None
    ) -> str:
        """Return the sentence for a person."""
        said = ' and '.join(map(self.phrase, entries))
        if entries[0]['kind'] not in (WALLS, FOOTPRINT):
            verb, them = ('closes', 'it') if len(entries) == 1 else ('close', 'them')
            more = f'; without {them} it is {length:.2f} m' if math.isfinite(length) else ''
            said = f'{said} {verb} the way{more}'
            passing = [entry for entry in entries if 'passes' in entry]
            if passing:
                most, place = passing[0]['passes'], self.place(passing[0]['at'])
                said += f'; {most:g} m is the most that passes, at {place}'
        if nearest is not None:
            place = self.place(nearest.point)
            said += (
                f'; the nearest point that can be reached is {place}, {nearest.short_of:.2f} m off'
            )
        return said

    def phrase(self, entry: dict[str, Any]) -> str:
        """Return what one cause is, in words."""
        kind, name, holds = entry['kind'], entry.get('name', ''), entry.get('holds', [])
        lies = ' and '.join(self.goal_name if end == 'goal' else end for end in holds)
        verb = 'lie' if len(holds) > 1 else 'lies'
        if kind == WALLS and holds:
            return f'the {lies} lies in an obstacle of the map'
        if kind == WALLS:
            room = self.goal_name if entry['room'] == 'goal' else 'start'
            return f'walls close the room of {entry["area"]:g} m2 in which the {room} lies'
        if kind == FOOTPRINT:
            gap = f'{entry["room"]:g} m from the nearest obstacle, at {self.place(entry["at"])}'
            return f'the widest way comes within {gap}'
        inside = f', in which the {lies} {verb},' if holds else ''
        if kind == RADIUS and not entry['radius']:
            return 'the inscribed cells of the costmap'
        if kind == RADIUS:
            return f"the robot's radius of {entry['radius']:g} m"
        if kind == UNKNOWN:
            ends = f' from {self.place(entry["from"])} to {self.place(entry["to"])}'
            return f'unknown cells{ends}{inside}'
        words = {ZONE: f'zone {name}', MASK: f'the filter mask {name}'}
        return words.get(kind, f'the instruction "{name}"') + inside


def below(metres: float) -> float:
    """Return the greatest number of whole millimetres, or the greatest float, that is less."""
    whole = math.ceil(1000.0 * metres - ROUNDING) - 1
    return whole / 1000.0 if whole > 0 else metres * (1.0 - ROUNDING)

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Describe a costmap in a prompt: bounds, start, goal and a bounded list of barriers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_decomposition import MAX_SIDE, coarsen, decompose_barriers
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap

from llm_astar_planner.search.arrays import Bools
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import Waypoint, WaypointQuery

# A longer side is described on a coarser lattice; the demonstrations are 51 x 31.
MAX_LATTICE_SIDE = 100
MAX_BARRIERS = 60
MIN_BARRIERS = 4
# For digits and brackets: small tokenizers use a token for nearly every one of them.
CHARS_PER_TOKEN = 1.5
# The planner drops points within this many cells of the edge, as the published code does.
EDGE = 2


class Lattice(NamedTuple):
    """The coordinates of a prompt: cell (0, 0) is the point (x, y), one step is `unit` cells."""

    x: int = 0
    y: int = 0
    unit: int = 1

    def coarsened(self, unit: int) -> Lattice:
        """Return the lattice with a step of `unit` cells; a coarse one starts at cell (0, 0)."""
        return self if unit == self.unit else Lattice(0, 0, unit)

    def to_lattice(self, cell: Cell) -> Cell:
        """Return the lattice point whose block of cells holds `cell`."""
        return cell[0] // self.unit + self.x, cell[1] // self.unit + self.y

    def to_cells(self, points: Sequence[Waypoint], query: WaypointQuery) -> tuple[Waypoint, ...]:
        """Convert a model's points to grid coordinates.

        With a unit of one cell this is a shift. A point of a coarser lattice means a block of
        cells: it becomes the start or the goal of the query if that lies in the block, else the
        block's free cell nearest to its centre.
        """
        if self.unit == 1:
            return tuple((px - self.x, py - self.y) for px, py in points)
        return tuple(self._cell_of_block(point, query) for point in points)

    def _cell_of_block(self, point: Waypoint, query: WaypointQuery) -> Waypoint:
        block = math.floor(point[0] + 0.5), math.floor(point[1] + 0.5)
        for endpoint in (query.start, query.goal):
            if self.to_lattice(endpoint) == block:
                return float(endpoint[0]), float(endpoint[1])
        x0, y0 = ((value - low) * self.unit for value, low in zip(block, (self.x, self.y)))
        x, y = x0 + (self.unit - 1) // 2, y0 + (self.unit - 1) // 2
        if query.grid_map.contains((x, y)):
            block_of = query.costmap.blocked[y0 : y0 + self.unit, x0 : x0 + self.unit]
            rows, columns = np.nonzero(~block_of)
            if rows.size:
                nearest = np.argmin(np.hypot(columns + x0 - x, rows + y0 - y))
                x, y = columns[nearest] + x0, rows[nearest] + y0
        return float(x), float(y)


@dataclass(frozen=True)
class Description:
    """What a prompt says about a map, in the coordinates of `lattice`."""

    lattice: Lattice
    start: Cell
    goal: Cell
    x_bounds: tuple[int, int]
    y_bounds: tuple[int, int]
    horizontal_barriers: tuple[Barrier, ...]
    vertical_barriers: tuple[Barrier, ...]

    def values(self) -> dict[str, str]:
        """Return the text for each placeholder of a template."""
        (x_min, x_max), (y_min, y_max) = self.x_bounds, self.y_bounds
        values = {
            'start': list(self.start),
            'goal': list(self.goal),
            'horizontal_barriers': list(map(list, self.horizontal_barriers)),
            'vertical_barriers': list(map(list, self.vertical_barriers)),
        } | {'x_min': x_min, 'x_max': x_max, 'y_min': y_min, 'y_max': y_max}
        return {name: str(value) for name, value in values.items()}


def describe(
    query: WaypointQuery,
    *,
    lattice: Lattice = Lattice(),  # noqa: B008 - an immutable tuple
    max_tokens: int = 1000,
) -> Description:
    """Describe a query, its costmap by at most MAX_BARRIERS barriers in about `max_tokens` tokens.

    A map with sides of up to MAX_LATTICE_SIDE cells, or one that straight barriers describe
    exactly, keeps its coordinates, shifted to `lattice`. A bigger one gets a lattice with steps
    of several cells.
    """
    budget = int(max_tokens * CHARS_PER_TOKEN)
    # About 16 characters for a barrier: brackets, commas, three numbers of a few digits.
    limit = max(MIN_BARRIERS, min(MAX_BARRIERS, budget // 16))
    blocked = query.costmap.blocked
    barriers = exact_barriers(blocked, limit)
    if barriers is None:
        unit = -(-max(blocked.shape) // MAX_LATTICE_SIDE)
        lattice = lattice.coarsened(unit)
        # A block counts as blocked if a wall one cell thick could cross it; specks close no gap.
        barriers = decompose_barriers(coarsen(blocked, unit, minimum=unit), limit)
    return make_description(barriers, query, lattice, budget)


def make_description(
    barriers: BarrierMap, query: WaypointQuery, lattice: Lattice, budget: int
) -> Description:
    """Return the description; the shortest barriers are dropped until the text fits `budget`."""
    x, y, unit = lattice
    horizontal = [shift(b, y, x) for b in barriers.horizontal_barriers]
    vertical = [shift(b, x, y) for b in barriers.vertical_barriers]
    kept = [(True, barrier) for barrier in horizontal] + [(False, barrier) for barrier in vertical]
    kept.sort(key=lambda item: item[1].first - item[1].last)
    while len(kept) > MIN_BARRIERS and sum(len(str(list(b))) + 2 for _, b in kept) > budget:
        kept.pop()
    height, width = query.costmap.blocked.shape
    return Description(
        lattice, lattice.to_lattice(query.start), lattice.to_lattice(query.goal),
        waypoint_bounds(width, unit, x), waypoint_bounds(height, unit, y),
        tuple(barrier for barrier in horizontal if (True, barrier) in kept),
        tuple(barrier for barrier in vertical if (False, barrier) in kept),
    )  # fmt: skip


def exact_barriers(blocked: Bools, limit: int) -> BarrierMap | None:
    """Return at most `limit` barriers that block exactly these cells, None if there are none.

    The outermost cells are not compared: a barrier map has walls there.
    """
    if max(blocked.shape) > MAX_SIDE:
        return None
    barriers = decompose_barriers(blocked, limit)
    differs = barriers.to_grid().blocked() != blocked
    return None if differs[1:-1, 1:-1].any() else barriers


def shift(barrier: Barrier, across: int, along: int) -> Barrier:
    """Return a barrier moved `across` its line and `along` it."""
    return Barrier(barrier.line + across, barrier.first + along, barrier.last + along)


def waypoint_bounds(side: int, unit: int, offset: int) -> tuple[int, int]:
    """Return the first and last lattice line on which the planner accepts a waypoint."""
    edge = EDGE if unit == 1 else 1
    last = -(-side // unit) - 1
    if last < 2 * edge:
        return offset, offset + last
    return offset + edge, offset + last - edge

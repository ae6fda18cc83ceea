"""From a map to the words of a prompt: bounds, start, goal and a bounded list of barriers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_decomposition import (
    MAX_SIDE,
    coarsen,
    decompose_barriers,
)
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.waypoints.prompts.lattice import Cell, Lattice

# A lattice no finer than this is described point by point; demonstrations are 51 x 31.
MAX_LATTICE_SIDE = 100
MAX_BARRIERS = 60
MIN_BARRIERS = 4
# Digits and brackets: small tokenizers take a token for nearly every one of them.
CHARS_PER_TOKEN = 1.5
# The planner drops points within this many cells of the edge, as the published code does.
EDGE = 2


@dataclass(frozen=True)
class Description:
    """What a prompt says of a map, in the coordinates of `lattice`."""

    lattice: Lattice
    start: Cell
    goal: Cell
    x_bounds: tuple[int, int]
    y_bounds: tuple[int, int]
    horizontal_barriers: tuple[Barrier, ...]
    vertical_barriers: tuple[Barrier, ...]

    def values(self) -> dict[str, str]:
        """Return the text of each name a template may use."""
        return {
            'start': str(list(self.start)),
            'goal': str(list(self.goal)),
            'horizontal_barriers': _listing(self.horizontal_barriers),
            'vertical_barriers': _listing(self.vertical_barriers),
            'x_min': str(self.x_bounds[0]),
            'x_max': str(self.x_bounds[1]),
            'y_min': str(self.y_bounds[0]),
            'y_max': str(self.y_bounds[1]),
        }


def describe(
    grid_map: GridMap,
    start: Cell,
    goal: Cell,
    *,
    lattice: Lattice = Lattice(),  # noqa: B008 - an immutable tuple
    max_tokens: int = 1000,
) -> Description:
    """Describe a map to a model by at most MAX_BARRIERS barriers in about `max_tokens` tokens.

    A map up to MAX_LATTICE_SIDE cells a side, or one that straight barriers describe exactly,
    keeps its own coordinates, shifted to `lattice`. A bigger one gets a lattice of several cells
    a step.
    """
    budget = int(max_tokens * CHARS_PER_TOKEN)
    # About what one barrier takes: brackets, commas, three numbers of a few digits.
    limit = max(MIN_BARRIERS, min(MAX_BARRIERS, budget // 16))
    exact = _exact_barriers(grid_map, limit)
    if exact is not None:
        return _described(exact, grid_map, start, goal, lattice, budget=budget)
    unit = -(-max(grid_map.width, grid_map.height) // MAX_LATTICE_SIDE)
    barriers = decompose_barriers(_coarsen(grid_map, unit), limit)
    return _described(barriers, grid_map, start, goal, lattice.coarsened(unit), budget=budget)


def describe_coarser(fine: Description, grid_map: GridMap, start: Cell, goal: Cell) -> Description:
    """Describe a map again by half as many barriers on a lattice twice as coarse."""
    count = len(fine.horizontal_barriers) + len(fine.vertical_barriers)
    lattice = fine.lattice.coarsened(2 * fine.lattice.unit)
    limit = max(1, count // 2)
    barriers = decompose_barriers(_coarsen(grid_map, lattice.unit), limit)
    return _described(barriers, grid_map, start, goal, lattice, budget=16 * limit)


def _described(
    barriers: BarrierMap,
    grid_map: GridMap,
    start: Cell,
    goal: Cell,
    lattice: Lattice,
    *,
    budget: int,
) -> Description:
    horizontal, vertical = _within(barriers, lattice, budget)
    return Description(
        lattice,
        lattice.to_lattice(start),
        lattice.to_lattice(goal),
        _bounds(grid_map.width, lattice.unit, lattice.x),
        _bounds(grid_map.height, lattice.unit, lattice.y),
        horizontal,
        vertical,
    )


def _exact_barriers(grid_map: GridMap, limit: int) -> BarrierMap | None:
    """Return the barriers of a map that `limit` of them block just as it does, or None."""
    if max(grid_map.width, grid_map.height) > MAX_SIDE:
        return None
    barriers = decompose_barriers(grid_map.blocked(), limit)
    inner = slice(1, -1)
    told = barriers.to_grid().blocked()[inner, inner]
    return barriers if np.array_equal(told, grid_map.blocked()[inner, inner]) else None


def _coarsen(grid_map: GridMap, unit: int) -> NDArray[np.bool_]:
    """Return which blocks of unit x unit cells are blocked: bool [rows, columns].

    A block is blocked where a wall of one cell could cross it: specks close no gap.
    """
    return coarsen(grid_map.blocked(), unit, minimum=unit)


def _within(
    barriers: BarrierMap, lattice: Lattice, budget: int
) -> tuple[tuple[Barrier, ...], tuple[Barrier, ...]]:
    """Shift the barriers to the lattice and drop the shortest until their text fits `budget`."""
    horizontal = [(True, _shift(b, lattice.y, lattice.x)) for b in barriers.horizontal_barriers]
    vertical = [(False, _shift(b, lattice.x, lattice.y)) for b in barriers.vertical_barriers]
    kept = sorted(horizontal + vertical, key=lambda item: item[1].first - item[1].last)
    while len(kept) > MIN_BARRIERS and sum(len(str(list(b))) + 2 for _, b in kept) > budget:
        kept.pop()
    return (
        tuple(b for is_horizontal, b in horizontal if (is_horizontal, b) in kept),
        tuple(b for is_horizontal, b in vertical if (is_horizontal, b) in kept),
    )


def _shift(barrier: Barrier, across: int, along: int) -> Barrier:
    return Barrier(barrier.line + across, barrier.first + along, barrier.last + along)


def _bounds(side: int, unit: int, offset: int) -> tuple[int, int]:
    """Return the first and last lattice line that a useful waypoint may lie on."""
    edge = EDGE if unit == 1 else 1
    last = -(-side // unit) - 1
    if last < 2 * edge:
        return offset, offset + last
    return offset + edge, offset + last - edge


def _listing(barriers: Sequence[Barrier]) -> str:
    return str([list(barrier) for barrier in barriers])

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Small automata over the regions that a path is in: what a clause asks of the order of cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError
from numpy.typing import NDArray

from llm_astar_planner.search.arrays import Bools, Float64s, Int64s

# A price that counts before all lengths; higher ones are refused.
MAX_PRICE = 1e6
# Regions that one automaton may read, and entries that its table may have.
MAX_READ = 16
MAX_TABLE = 1 << 20

Groups = Sequence[Sequence[int]]


class AutomatonError(LlmAstarError, ValueError):
    """An automaton whose tables do not fit together, or that would be too large; says why."""


@dataclass(frozen=True, eq=False)
class Automaton:
    """A deterministic automaton that reads one letter for each cell of a path, the start first.

    The letter of a cell is a number whose bit i tells whether the cell is in region `regions[i]`
    of the problem. `after` [states, letters] is the state after a cell was read; a path begins in
    state 0, which has not read the start yet, and may end in the states of `accepting`. `price`
    [states, letters] is what a cell costs more per cell of length where that is the state after
    it was read: 0 to MAX_PRICE, or inf, forbidden; None: nothing. `only_gains` promises that a
    path that enters more regions than another never fares worse. Raises AutomatonError.
    """

    regions: tuple[int, ...]
    after: NDArray[np.int16]
    accepting: Bools
    price: Float64s | None = None
    only_gains: bool = False

    def __post_init__(self) -> None:
        """Check the tables."""
        shape = len(self.accepting), 1 << len(self.regions)
        if len(self.regions) > MAX_READ or not 0 < shape[0] * shape[1] <= MAX_TABLE:
            raise AutomatonError(f'{shape[0]} states over {len(self.regions)} regions')
        if self.after.shape != shape or not 0 <= self.after.min() <= self.after.max() < shape[0]:
            raise AutomatonError(f'after: not {shape} numbers of states')
        price = self.price
        if price is None:
            return
        valid = (price >= 0.0) & ((price <= MAX_PRICE) | (price == math.inf))
        if price.shape != shape or not valid.all():
            raise AutomatonError(f'price: not {shape} values that are inf or 0 to {MAX_PRICE:g}')


def visits(groups: Groups) -> Automaton:
    """Return what asks for visits: the groups of regions in this order, each group in any order.

    A region is visited when the path is in it while its group is due. One cell may count for
    several regions and groups at once. Raises AutomatonError for too many regions in any order.
    """
    regions = sorted({region for group in groups for region in group})
    due = [np.array([regions.index(it) for it in sorted(set(group))]) for group in groups if group]
    sizes = [(1 << len(group)) - 1 for group in due]
    states, letters = 1 + sum(sizes), 1 << min(len(regions), MAX_READ + 1)
    if len(regions) > MAX_READ or states * letters > MAX_TABLE:
        raise AutomatonError(f'{len(regions)} regions to visit in {len(due)} groups are too many')
    after = np.full((states, letters), states - 1, dtype=np.int16)
    first = states - 1
    for group, size in zip(reversed(due), reversed(sizes)):
        # The state first + i has visited the regions whose bits are set in i.
        inside = pack(np.arange(letters), group)
        visited = np.arange(size)[:, np.newaxis] | inside
        next_group = after[first]
        first -= size
        after[first : first + size] = np.where(visited == size, next_group, first + visited)
    accepting = np.arange(states) == states - 1
    return Automaton(tuple(regions), after, accepting, only_gains=True)


def pack(letters: Int64s, places: Int64s) -> Int64s:
    """Return the bits of the letters at some places, moved together."""
    bits = letters[:, np.newaxis] >> places & 1
    return np.asarray(bits @ (1 << np.arange(len(places))), dtype=np.int64)


def before(first: int, second: int, price: float = math.inf) -> Automaton:
    """Return what forbids `second`, or gives it a price, until the path was in `first`.

    A cell of both counts as one of `first`.
    """
    prices = np.array([[0.0, 0.0, price, 0.0], [0.0] * 4])
    return pair(first, second, [[0, 1, 0, 1], [1] * 4], [True, True], prices)


def then(first: int, second: int) -> Automaton:
    """Return what asks for `second`, later or in the same cell, whenever the path is in `first`.

    A path that never is in `first` has nothing to do.
    """
    return pair(first, second, [[0, 1, 0, 0], [1, 1, 0, 0]], [True, False])


def never_after(first: int, second: int, price: float = math.inf) -> Automaton:
    """Return what forbids `second`, or gives it a price, once the path was in `first`.

    A cell of both counts: `first` is entered, and `second` is forbidden from there on.
    """
    prices = np.array([[0.0] * 4, [0.0, 0.0, price, price]])
    return pair(first, second, [[0, 1, 0, 1], [1] * 4], [True, True], prices)


def pair(
    first: int,
    second: int,
    after: list[list[int]],
    accepting: list[bool],
    price: Float64s | None = None,
) -> Automaton:
    """Return an automaton of two states over two regions; letters: none, first, second, both."""
    return Automaton((first, second), np.array(after, dtype=np.int16), np.array(accepting), price)


def entries(deep: int, near: int, at_least: int, at_most: int | None = None) -> Automaton:
    """Return what counts entries: the path comes to `deep` after it was outside of `near`.

    The beginning is outside. Asks for `at_least` entries and at most `at_most`, None: any number.
    Raises AutomatonError for too many.
    """
    most = at_least if at_most is None else at_most + 1
    # State 2 * n: after n entries and outside; 2 * n + 1: not outside since the last one.
    count, is_inside = np.divmod(np.arange(2 * most + 2), 2)
    entered = np.where(is_inside, count, np.minimum(count + 1, most))
    after = np.stack([2 * count, 2 * entered + 1, 2 * count + is_inside, 2 * entered + 1], axis=1)
    accepting = (count >= at_least) & (at_most is None or count < most)
    return Automaton((deep, near), after.astype(np.int16), accepting)

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Records in which order searches expand cells, for animations.

The kernels keep no order. A recorder lets a search expand a few cells at a time and looks after
each of these steps which cells are new: the searches run as they always do, only slower.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from llm_astar_planner.search.arrays import Bools, Int32s, Int64s

if TYPE_CHECKING:
    from llm_astar_planner.search.astar import SlicedSearch

# Cells looked at in one recording, which bounds its time to about a second.
MAX_LOOKS = 100_000_000
MIN_STEPS = 100


@dataclass(frozen=True, eq=False)
class ExpansionOrder:
    """The cells that were expanded, in order of their first expansion.

    `order` is int32 [n], numbers of cells `y * width + x`; cells expanded in the same step are in
    the order of their numbers. `steps` is int64 [k, 2]: how many expansions there had been after
    each step, and how many cells of `order` had been expanded. A search may expand a cell again.
    """

    order: Int32s
    steps: Int64s

    @property
    def expansions(self) -> int:
        """The number of expansions of the whole search."""
        return int(self.steps[-1, 0]) if len(self.steps) else 0

    def cells_after(self, expansions: int) -> int:
        """Return how many cells of `order` are expanded after so many expansions."""
        step = int(np.searchsorted(self.steps[:, 0], expansions, side='right')) - 1
        return int(self.steps[step, 1]) if step >= 0 else 0


class ExpansionRecorder:
    """Notes what is new after each step of one search, or of successive ones on one map.

    `step` is how many cells are expanded between two looks.
    """

    def __init__(self, shape: tuple[int, int], expansions: int) -> None:
        """Record about so many expansions on a map of `shape`, one by one if that is quick."""
        steps = max(MIN_STEPS, MAX_LOOKS // (shape[0] * shape[1]))
        self.step = max(1, -(-expansions // steps))
        self._expanded = np.zeros(shape, dtype=np.bool_)
        self._known = np.zeros(shape, dtype=np.bool_)
        self._cells: list[Int32s] = []
        self._steps: list[tuple[int, int]] = []
        self._count = self._before = 0

    def next_search(self) -> None:
        """Begin another search, whose expansions count on from those before."""
        self._before = self._steps[-1][0] if self._steps else 0

    def advance(self, search: SlicedSearch, quota: int, others: int = 0) -> None:
        """Advance a search by `quota` in smaller slices; look after each.

        `others` are the expansions of other searches that count too. It ends where one slice
        would have: that does less than it is allowed to where the search has ended or its memory
        has to grow.
        """
        end = search.work + quota
        while (left := end - search.work) > 0:
            before, step = search.work, min(self.step, left)
            search.advance(step)
            search.add_expanded(self._expanded)
            self.look(self._expanded, others + search.expansions)
            if search.work - before < step:
                return

    def is_due(self, expansions: int) -> bool:
        """Tell whether to look after so many expansions of this search."""
        last = self._steps[-1][0] if self._steps else 0
        return self._before + expansions >= last + self.step

    def look(self, expanded: Bools, expansions: int) -> None:
        """Note which of the `expanded` cells are new after so many expansions of this search."""
        new = np.flatnonzero(expanded & ~self._known).astype(np.int32)
        self._known |= expanded
        self._cells.append(new)
        self._count += len(new)
        self._steps.append((self._before + expansions, self._count))

    def order(self) -> ExpansionOrder:
        """Return what was recorded."""
        order = np.concatenate([np.empty(0, dtype=np.int32), *self._cells])
        return ExpansionOrder(order, np.array(self._steps, dtype=np.int64).reshape(-1, 2))

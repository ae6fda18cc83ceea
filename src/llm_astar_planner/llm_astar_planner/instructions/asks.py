# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a clause asks of the search: closed cells, visits, automata over regions, goals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # clauses are read where no search is
    from llm_astar_planner.costmap.raster import Cover
    from llm_astar_planner.search.automata import Automaton

Mask = NDArray[np.bool_]


class Zone(NamedTuple):
    """A region of the search: its cells, bool [height, width], and which driven points are in it.

    The points are those of `Ground.driven`.
    """

    cells: Mask
    driven: Mask


class Rule(NamedTuple):
    """An automaton over zones, made for the price per cell of what it forbids; inf forbids it."""

    zones: tuple[Zone, ...]
    automaton: Callable[[float], Automaton]


@dataclass(frozen=True, eq=False)
class Ask:
    """What one clause asks of the cells of a path.

    - `forbidden`: cells that no move may begin or end in; None for none.
    - `visits`: regions to visit, after those of the clauses before, in any order.
    - `rules`: automata.
    - `goals`: cells to end in, bool [height, width].
    - `ends_within`: metres around start and goal in which nothing is forbidden to a path that
      begins or ends in what is; 0: it is nowhere forbidden to that.
    """

    forbidden: Cover | None = None
    visits: tuple[Zone, ...] = ()
    rules: tuple[Rule, ...] = ()
    goals: Mask | None = None
    ends_within: float = 0.0

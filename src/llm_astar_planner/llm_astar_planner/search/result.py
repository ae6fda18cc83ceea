"""What every search returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Cell = tuple[int, int]
# A stop flag at this, instead of 1: nobody wants a picture of what was expanded any more.
STOP_CANCELLED = 2


class SearchStatus(Enum):
    """How a search ended."""

    FOUND = 'found'
    EXHAUSTED = 'exhausted'  # everything reachable was expanded: there is no path
    STOPPED = 'stopped'  # the stop flag was raised: a deadline or a cancel


def _no_path() -> NDArray[np.int32]:
    return np.empty((0, 2), dtype=np.int32)


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The outcome of one search on a grid.

    `path` is int32 [n, 2], cells (x, y) from start to goal, empty unless found. `expansions`
    counts expansions (the paper's operation), `storage` the states that ever got a g (the
    paper's storage), `length` is in cells. `expanded` is bool [height, width].
    """

    status: SearchStatus
    expansions: int
    storage: int
    expanded: NDArray[np.bool_]
    path: NDArray[np.int32] = field(default_factory=_no_path)
    length: float = float('nan')

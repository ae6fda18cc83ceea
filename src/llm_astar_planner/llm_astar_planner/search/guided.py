"""The guided search: waypoints steer it, A* backs it, and what it returns carries a bound.

docs/guided-search.md tells what it does and proves its bounds.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search import kernels_bucket, kernels_guided as kernels
from llm_astar_planner.search.fast_grid import BoundedResult, FastGrid, PathTooLongError, as_grid
from llm_astar_planner.search.landmarks import NO_MARKS, NONE_ACTIVE, Landmarks
from llm_astar_planner.search.result import Cell, SearchStatus

# How greedily waypoints are followed: the weight of the way still to go.
WEIGHT = 1.05
# The work waypoints may cost, as a part of the work A* would need.
SLACK = 1.1
# Within how many cells of a waypoint it counts as met, and, once nearer to the next waypoint
# than this one is, within what part of the leg between them.
RADIUS = 2.0
PASSING = 0.5
SLICE = 4096
_BUCKETS = 2048
_SHORTER = 1e-9


@dataclass(frozen=True)
class Improvement:
    """A better path while the search goes on.

    `cost` and `lower_bound` in cells, `ratio` proven, `operation` the expansions so far, `path`
    int32 [n, 2].
    """

    cost: float
    lower_bound: float
    ratio: float
    operation: int
    path: NDArray[np.int32]


class GuidedSearch:
    """One search, steered by waypoints that may come while it runs.

    `improvements()` runs it and yields each better path; `result()` gives what it found, at any
    time. `guide(waypoints)` may be called before or during the run, from any thread, again and
    again; without it the search is an exact A*. With `max_suboptimality` w >= 1 it ends when
    the path is proven within w of the optimum, without it at the first path the waypoints
    lead to. `landmarks` make the proof cheap and must hold on the grid.
    """

    def __init__(
        self,
        blocked: FastGrid | NDArray[np.bool_],
        start: Cell,
        goal: Cell,
        *,
        corner_cutting: bool = False,
        max_suboptimality: float | None = None,
        landmarks: Landmarks | None = None,
        stop: NDArray[np.uint8] | None = None,
        weight: float = WEIGHT,
        slack: float = SLACK,
    ) -> None:
        """Take the query; nothing is searched yet. Raises ValueError for what no search can be."""
        if max_suboptimality is not None and not max_suboptimality >= 1.0:
            raise ValueError(f'max_suboptimality: {max_suboptimality} is under 1')
        self.grid = as_grid(blocked, corner_cutting=corner_cutting)
        self.start, self.goal = start, goal
        self.max_suboptimality = max_suboptimality
        self.landmarks = landmarks
        self.stop = np.zeros(1, dtype=np.uint8) if stop is None else stop
        self.weight, self.slack = weight, slack
        self._lock = threading.Lock()
        self._pending: NDArray[np.float64] | None = None
        self._ends = (self.grid.index(start), self.grid.index(goal))

    def guide(self, waypoints: ArrayLike) -> None:
        self._pending = np.asarray(waypoints, dtype=np.float64).reshape(-1, 2)

    def _targets(self, waypoints):
        grid = self.grid
        points = waypoints[np.isfinite(waypoints).all(axis=1)]
        cells = np.clip(np.rint(points), 0, (grid.width - 1, grid.height - 1)).astype(np.int64)
        if len(cells):
            cells = cells[np.concatenate(([True], (np.diff(cells, axis=0) != 0).any(axis=1)))]
        most = kernels.MAX_TARGETS - 1
        if len(cells) > most:
            cells = cells[np.linspace(0, len(cells) - 1, most).round().astype(np.int64)]
        if len(cells) and tuple(cells[-1]) == tuple(self.goal):
            cells = cells[:-1]
        cells = np.concatenate((cells, [self.goal])).astype(np.int64)
        delta = np.abs(np.diff(cells, axis=0))
        legs = grid.straight * delta.max(axis=1) + (grid.diagonal - grid.straight) * delta.min(
            axis=1
        )
        targets = np.zeros((len(cells), 5), dtype=np.int64)
        targets[:, :2] = cells
        targets[:-1, 2] = legs[::-1].cumsum()[::-1]
        targets[:, 3] = int(RADIUS * grid.straight)
        targets[:-1, 4] = np.maximum(PASSING * legs, PASSABS * grid.straight)
        return targets

    def run(self):
        grid = self.grid
        kb = kernels_bucket
        ws = grid.borrow()
        self.plain = None
        n = max(ws.pool.size, 1024)
        self.pool = np.empty(n, np.int64)
        self.keys = np.empty(n, np.int64)
        heads = np.zeros(_BUCKETS + 1, np.int32)
        c = self.c = np.zeros(kernels.G_SIZE, np.int64)
        s, g = self._ends
        c[kernels.G_START], c[kernels.G_GOAL] = s, g
        c[kernels.G_GENERATION] = ws.next_generation()
        c[kernels.G_STRAIGHT], c[kernels.G_DIAGONAL] = grid.straight, grid.diagonal
        c[kernels.G_WIDTH] = grid.width
        c[kernels.G_WEIGHT] = round(self.weight * kernels.ONE)
        c[kernels.G_SLACK] = round(self.slack * kernels.ONE)
        c[kernels.G_RATIO] = (
            0 if self.max_suboptimality is None else int(self.max_suboptimality * kernels.ONE)
        )
        active, marks = NONE_ACTIVE, NO_MARKS
        if self.landmarks is not None:
            marks = self.landmarks.marks
            active = self.landmarks.active(grid, self.start, self.goal)
        kernels.begin(
            ws.records, self.pool, self.keys, heads, grid.price.size > 0, marks, active, c
        )
        targets = np.zeros((1, 5), np.int64)
        self.first_op = None
        pl = None
        pops = 0
        injected = kb.NO_PATH
        gshift = 5
        k = kernels
        c[k.G_SHARE] = round(SHARE * k.ONE)
        c[k.G_CREDIT] = int(c[k.G_LEAST] * self.slack)

        def rk(proving, fresh=False):
            k.rekey(
                ws.records,
                self.pool,
                self.keys,
                heads,
                targets,
                marks,
                active,
                proving,
                fresh,
                5 if proving else gshift,
                c,
            )

        while True:
            if self._pending is not None:
                p, self._pending = self._pending, None
                targets = self._targets(p)
                key0 = (
                    int(targets[0, 2])
                    + grid.straight
                    * max(abs(targets[0, 0] - self.start[0]), abs(targets[0, 1] - self.start[1]))
                ) * 1.7
                gshift = 5
                while (_BUCKETS << gshift) < key0 - c[k.G_BOUND]:
                    gshift += 1
                rk(False, True)
            st = k.advance(
                grid.moves,
                grid.price,
                ws.records,
                self.pool,
                self.keys,
                heads,
                targets,
                marks,
                active,
                c,
                SLICE,
                self.stop,
            )
            if st == kb.NEED_SPACE:
                self._grow()
                continue
            if self.first_op is None and c[k.G_BEST] < kb.NO_PATH:
                self.first_op = c[k.G_GUIDED] + c[k.G_PROOF] + pops
                self.first = c[k.G_BEST]
            if st == kb.FOUND:
                if self.max_suboptimality is None or k.is_met(c):
                    break
                rk(True)
                continue
            if st in (kb.EXHAUSTED, kb.STOPPED):
                break
            if st == k.SWITCH:
                if c[k.G_PROVING]:
                    c[k.G_CREDIT] = max(c[k.G_CREDIT], c[k.G_PROOF])
                    rk(False)
                else:
                    c[k.G_CREDIT] = int(c[k.G_GUIDED] * GROW)
                    rk(True)
                continue
            if st == k.WORKED:
                if pl is None:
                    pl = grid.borrow()
                    pc = pl.control
                    pc[:] = 0
                    gen = pl.next_generation()
                if pc[kb.A_STARTED] and c[k.G_BEST] < pc[kb.A_BEST]:
                    pc[kb.A_BEST] = injected = c[k.G_BEST]
                st = kb.astar(
                    grid.moves,
                    grid.price,
                    grid.width,
                    grid.straight,
                    grid.diagonal,
                    s,
                    g,
                    self.every,
                    gen,
                    pl.records,
                    pl.pool,
                    pl.heads,
                    pc,
                    self.stop,
                    max(4, pops // 8),
                )
                if st == kb.NEED_SPACE:
                    pl.grow_pool()
                pops = pc[kb.A_OPERATION]
                if pc[kb.A_BEST] < injected and pc[kb.A_BEST] < c[k.G_BEST]:
                    c[k.G_BEST] = pc[kb.A_BEST]
                if st == kb.FOUND:
                    c[k.G_BOUND] = c[k.G_BEST] = pc[kb.A_BEST]
                    break
                if st == kb.EXHAUSTED:
                    break
                c[k.G_BOUND] = max(c[k.G_BOUND], pc[kb.A_BUCKET] << 5)
                c[k.G_LEAST] = max(c[k.G_LEAST], pops)
                if k.is_met(c):
                    break
        grid.give_back(ws)
        self.pops = pops
        self.pstore = 0
        if pl is not None:
            self.pstore = pc[kb.A_STORAGE]
            grid.give_back(pl)
        return st, c

    every = False

    def _grow(self):
        self.pool = np.concatenate((self.pool, np.empty_like(self.pool)))
        self.keys = np.concatenate((self.keys, np.empty_like(self.keys)))


PASSABS = 3.0
SHARE = 0.6
GROW = 1.25

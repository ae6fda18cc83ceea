"""Other planners for grids, as functions that prepare them for a map. All are optional."""

from __future__ import annotations

import importlib
import importlib.metadata
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llm_astar_planner.search.result import Cell
from numpy.typing import NDArray

from benchmarks.cases import SMALL_CELLS, Problem, SpeedCase

Path2D = NDArray[np.signedinteger[Any]]
# Takes start and goal, returns the cells (x, y) of a path, empty if there is none.
Plan = Callable[[Cell, Cell], Path2D]
Prepare = Callable[[Problem], Plan]


class Peer(NamedTuple):
    """A planner of others: its distribution and module, how to prepare it, and its limits.

    `most_cells` is the size of map up to which it answers in seconds; `graded` tells whether
    it takes graded costs.
    """

    name: str
    module: str
    prepare: Prepare
    most_cells: int
    graded: bool

    def reason_to_skip(self, case: SpeedCase) -> str | None:
        """Say why it takes no part in a case, or None."""
        try:
            importlib.import_module(self.module)
        except ImportError as error:
            return f'not installed: {error}'
        if case.graded and not self.graded:
            return 'takes no graded costs'
        return 'too slow or too large for it' if case.cells > self.most_cells else None

    @property
    def version(self) -> str:
        """The version that is installed, '' if it says none."""
        try:
            return importlib.metadata.version(self.name)
        except importlib.metadata.PackageNotFoundError:
            return ''


def as_cells(path: Any, *, rows_first: bool) -> Path2D:  # noqa: ANN401
    """Turn a peer's path, None or a sequence of pairs, into cells (x, y): int64 [n, 2]."""
    if path is None or len(path) == 0:
        return np.empty((0, 2), dtype=np.int64)
    cells = np.asarray(path, dtype=np.int64).reshape(-1, 2)
    return cells[:, ::-1] if rows_first else cells


def prepare_nano(problem: Problem) -> Plan:
    """Prepare nano-astar."""
    peer = importlib.import_module('nano_astar')
    grid = problem.blocked.astype(np.uint8)

    def plan(start: Cell, goal: Cell) -> Path2D:
        found = peer.astar(grid, start[::-1], goal[::-1])
        return as_cells(found and found[0], rows_first=True)

    return plan


def prepare_pyastar2d(problem: Problem) -> Plan:
    """Prepare pyastar2d, whose diagonals cut corners; a move costs what its cell costs."""
    peer = importlib.import_module('pyastar2d')
    weights = problem.weights

    def plan(start: Cell, goal: Cell) -> Path2D:
        path = peer.astar_path(weights, start[::-1], goal[::-1], allow_diagonal=True)
        return as_cells(path, rows_first=True)

    return plan


def prepare_w9(problem: Problem) -> Plan:
    """Prepare w9-pathfinding's A*."""
    environments = importlib.import_module('w9_pathfinding.envs')
    finders = importlib.import_module('w9_pathfinding.pf')
    moves = importlib.import_module('w9_pathfinding.diagonal_movement').DiagonalMovement
    grid = environments.Grid(
        np.where(problem.blocked, -1.0, problem.weights.astype(np.float64)),
        diagonal_movement=moves.only_when_no_obstacle,
        diagonal_movement_cost_multiplier=math.sqrt(2.0),
    )
    finder = finders.AStar(grid)
    return lambda start, goal: as_cells(finder.find_path(start, goal), rows_first=False)


def prepare_tcod(problem: Problem) -> Plan:
    """Prepare libtcod's A*, whose diagonals cut corners; its `Pathfinder` is slower."""
    peer = importlib.import_module('tcod.path')
    cost = np.where(problem.blocked, np.float32(0.0), problem.weights)
    cost = cost if problem.graded else cost.astype(np.int8)
    finder = peer.AStar(np.ascontiguousarray(cost.T), diagonal=math.sqrt(2.0))

    def plan(start: Cell, goal: Cell) -> Path2D:
        path = finder.get_path(*start, *goal)
        return as_cells([start, *path] if path else None, rows_first=False)

    return plan


def prepare_cstar(problem: Problem) -> Plan:
    """Prepare cstar-pathfinding's A*, whose diagonals cut corners."""
    peer = importlib.import_module('cstar.pathfinding')
    free = ~problem.blocked

    def plan(start: Cell, goal: Cell) -> Path2D:
        return as_cells(peer.run_astar_2D(free, *start[::-1], *goal[::-1])[0], rows_first=True)

    return plan


def prepare_networkx(problem: Problem) -> Plan:
    """Prepare networkx's A* on a graph with an edge for each legal move, with our costs."""
    peer = importlib.import_module('networkx')
    graph, free, weights = peer.Graph(), ~problem.blocked, problem.weights
    for y, x in np.argwhere(free).tolist():
        for to_x, to_y in ((x + 1, y), (x, y + 1), (x + 1, y + 1), (x - 1, y + 1)):
            inside = 0 <= to_x < free.shape[1] and to_y < free.shape[0]
            if inside and free[to_y, to_x] and free[y, to_x] and free[to_y, x]:
                mean = (weights[y, x] + weights[to_y, to_x]) / 2
                graph.add_edge((x, y), (to_x, to_y), weight=math.dist((x, y), (to_x, to_y)) * mean)

    def estimate(cell: Cell, goal: Cell) -> float:
        less, more = sorted((abs(cell[0] - goal[0]), abs(cell[1] - goal[1])))
        return more + (math.sqrt(2.0) - 1.0) * less

    def plan(start: Cell, goal: Cell) -> Path2D:
        try:
            return as_cells(peer.astar_path(graph, start, goal, estimate), rows_first=False)
        except (peer.NetworkXNoPath, peer.NodeNotFound):
            return as_cells(None, rows_first=False)

    return plan


PEERS = (
    Peer('nano-astar', 'nano_astar', prepare_nano, 2**27, graded=False),
    Peer('pyastar2d', 'pyastar2d', prepare_pyastar2d, 2**27, graded=True),
    Peer('w9-pathfinding', 'w9_pathfinding.pf', prepare_w9, 2**25, graded=True),
    Peer('tcod', 'tcod.path', prepare_tcod, 2**25, graded=True),
    Peer('cstar-pathfinding', 'cstar.pathfinding', prepare_cstar, 2**25, graded=False),
    Peer('networkx', 'networkx', prepare_networkx, SMALL_CELLS, graded=True),
)

"""Labels, compiled: which next hop is how good on the way to the goal, by a visibility graph.

Nodes are the start, the goal and the cell beyond each barrier's first and last cell; see
`llm_astar_planner.waypoints.learned.features`. A line of sight is one in the sense of
`llm_astar_planner.search.visibility`: it touches no barrier, and blocked cells side by side are
joined.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from llm_astar_training.maps import (
    MOST_SCALE,
    RECIPE,
    SCALED,
    draw_ends,
    draw_map,
    is_blocked,
    scale_map,
)

_jit: Any = njit(cache=True, nogil=True)

# How much longer a way may be and still be about as good: in cells, and of the longer side.
TOLERANCE_CELLS = 0.25
TOLERANCE_SIDE = 0.004
# What the rows off the best way count; those on it count 1.
OFF_ROUTE = 0.25
# The recipe asks for five cells between start and goal, and the way about to be worth it.
MIN_DISTANCE = 5.0
MIN_DETOUR = 1.15


@_jit
def place_nodes(barriers: NDArray[np.int32], ends: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the cells [2 + 2 B, 2] of start, goal and the cells beyond the barriers' ends."""
    count = barriers.shape[0]
    nodes = np.empty((2 + 2 * count, 2), np.int32)
    for axis in range(2):
        nodes[0, axis], nodes[1, axis] = ends[0, axis], ends[1, axis]
    for k in range(count):
        along = 0 if barriers[k, 0] else 1
        nodes[2 + 2 * k, along] = barriers[k, 2] - 1
        nodes[3 + 2 * k, along] = barriers[k, 3] + 1
        nodes[2 + 2 * k, 1 - along] = nodes[3 + 2 * k, 1 - along] = barriers[k, 1]
    return nodes


@_jit
def _joins(barriers: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the one-cell walls (horizontal, line, first, last) between barriers side by side."""
    count = barriers.shape[0]
    found = np.empty((count * count + 1, 4), np.int32)
    n = 0
    for a in range(count):
        for b in range(a):
            low, high = np.empty(2, np.int32), np.empty(2, np.int32)
            one, two = _box(barriers[a]), _box(barriers[b])
            for axis in range(2):
                low[axis] = max(one[axis], two[axis])
                high[axis] = min(one[axis + 2], two[axis + 2])
            for axis in range(2):
                other = 1 - axis
                if low[axis] - high[axis] == 1 and low[other] <= high[other]:
                    for at in (low[other], high[other]):
                        if n < found.shape[0]:
                            found[n, 0] = 1 if axis == 0 else 0
                            found[n, 1] = at
                            found[n, 2], found[n, 3] = high[axis], low[axis]
                            n += 1
    return found[:n]


@_jit
def _box(barrier: NDArray[np.int32]) -> tuple[int, int, int, int]:
    if barrier[0]:
        return barrier[2], barrier[1], barrier[3], barrier[1]
    return barrier[1], barrier[2], barrier[1], barrier[3]


@_jit
def meets(wall: NDArray[np.int32], ax: int, ay: int, bx: int, by: int) -> bool:
    """Tell whether the closed line a-b touches the closed wall, in whole numbers."""
    if not wall[0]:
        ax, ay, bx, by = ay, ax, by, bx
    line, first, last = wall[1], wall[2], wall[3]
    da, db = ay - line, by - line
    if (da > 0 and db > 0) or (da < 0 and db < 0):
        return False
    if da == db:
        return max(ax, bx) >= first and min(ax, bx) <= last
    # The line meets the wall's at x = (ax db - bx da) / (db - da).
    over, under = ax * db - bx * da, db - da
    if under < 0:
        over, under = -over, -under
    return first * under <= over <= last * under


@_jit
def see(walls: NDArray[np.int32], ax: int, ay: int, bx: int, by: int) -> bool:
    """Tell whether the line a-b touches no wall."""
    for k in range(walls.shape[0]):
        if meets(walls[k], ax, ay, bx, by):
            return False
    return True


@_jit
def mark_usable(
    barriers: NDArray[np.int32],
    size: NDArray[np.int32],
    nodes: NDArray[np.int32],
    usable: NDArray[np.bool_],
) -> None:
    """Mark in `usable` [N] the nodes that are free cells which no node before them has."""
    for i in range(len(nodes)):
        usable[i] = not is_blocked(barriers, size[0], size[1], nodes[i, 0], nodes[i, 1])
        for j in range(i):
            if nodes[i, 0] == nodes[j, 0] and nodes[i, 1] == nodes[j, 1]:
                usable[i] = False


@_jit
def measure_sights(
    barriers: NDArray[np.int32],
    nodes: NDArray[np.int32],
    usable: NDArray[np.bool_],
    apart: NDArray[np.float32],
) -> None:
    """Fill in `apart` [N, N], in cells, between nodes that see each other; else infinity."""
    joins = _joins(barriers)
    for i in range(len(nodes)):
        apart[i, i] = np.inf
        for j in range(i):
            ax, ay, bx, by = nodes[i, 0], nodes[i, 1], nodes[j, 0], nodes[j, 1]
            distance = np.inf
            if (
                usable[i]
                and usable[j]
                and see(barriers, ax, ay, bx, by)
                and see(joins, ax, ay, bx, by)
            ):
                distance = math.sqrt((ax - bx) ** 2 + (ay - by) ** 2)
            apart[i, j] = apart[j, i] = distance


@_jit
def lengths_to_goal(apart: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the length in cells of the shortest way from each node to node 1, the goal."""
    count = len(apart)
    lengths = np.full(count, np.inf, np.float32)
    done = np.zeros(count, np.bool_)
    lengths[1] = 0.0
    for _ in range(count):
        best = -1
        for i in range(count):
            if not done[i] and (best < 0 or lengths[i] < lengths[best]):
                best = i
        done[best] = True
        if not np.isfinite(lengths[best]):
            break
        for i in range(count):
            lengths[i] = min(lengths[i], lengths[best] + apart[best, i])
    return lengths


@_jit
def soften_hops(
    apart: NDArray[np.float32],
    lengths: NDArray[np.float32],
    tolerance: float,
    hops: NDArray[np.float32],
    weights: NDArray[np.float32],
) -> None:
    """Fill in each row's probabilities of the next hop [N, N] and the rows' weights [N].

    p(j | i) falls by e for every `tolerance` cells that the way by j is longer than the best.
    """
    count = len(apart)
    for i in range(count):
        if i == 1 or not np.isfinite(lengths[i]):
            continue
        weights[i] = OFF_ROUTE
        total = 0.0
        for j in range(count):
            if np.isfinite(apart[i, j]):
                hops[i, j] = math.exp(-(apart[i, j] + lengths[j] - lengths[i]) / tolerance)
                total += hops[i, j]
        for j in range(count):
            hops[i, j] /= total
    node = 0
    while node != 1:
        weights[node] = 1.0
        best = 0
        for j in range(count):
            if apart[node, j] + lengths[j] < apart[node, best] + lengths[best]:
                best = j
        node = best


@_jit
def _worthwhile(kind: int, apart: NDArray[np.float32], length: float, direct: float) -> bool:
    """Tell whether start to goal is worth learning: mostly what needs a detour."""
    if not np.isfinite(length) or direct < 1.5:
        return False
    if np.isfinite(apart[0, 1]):
        return kind not in (RECIPE, SCALED) and np.random.random() < 0.04
    if kind in (RECIPE, SCALED) and direct < MIN_DISTANCE:
        return False
    return length >= MIN_DETOUR * direct or np.random.random() < 0.5


@_jit
def draw_problem(
    kind: int,
    barriers: NDArray[np.int32],
    size: NDArray[np.int32],
    ends: NDArray[np.int32],
    usable: NDArray[np.bool_],
    apart: NDArray[np.float32],
    hops: NDArray[np.float32],
    weights: NDArray[np.float32],
) -> None:
    """Draw one problem with its labels into arrays of zeros, again until it is worth learning."""
    while True:
        if not (draw_map(kind, barriers, size) and draw_ends(barriers, size, ends)):
            continue
        if kind == SCALED:
            scale_map(barriers, size, ends, np.random.randint(2, MOST_SCALE + 1))
            if np.random.random() < 0.5:
                draw_ends(barriers, size, ends)
        nodes = place_nodes(barriers, ends)
        mark_usable(barriers, size, nodes, usable)
        if not usable[1]:
            continue
        measure_sights(barriers, nodes, usable, apart)
        lengths = lengths_to_goal(apart)
        dx, dy = ends[0, 0] - ends[1, 0], ends[0, 1] - ends[1, 1]
        if _worthwhile(kind, apart, lengths[0], math.sqrt(dx * dx + dy * dy)):
            break
    tolerance = TOLERANCE_CELLS + TOLERANCE_SIDE * max(size[0], size[1])
    soften_hops(apart, lengths, tolerance, hops, weights)


@_jit
def fill_batch(
    seed: int,
    kind: int,
    barriers: NDArray[np.int32],
    size: NDArray[np.int32],
    ends: NDArray[np.int32],
    usable: NDArray[np.bool_],
    apart: NDArray[np.float32],
    hops: NDArray[np.float32],
    weights: NDArray[np.float32],
) -> None:
    """Fill a batch of problems in place; the same seed gives the same batch."""
    np.random.seed(seed)
    for n in range(len(barriers)):
        draw_problem(kind, barriers[n], size[n], ends[n], usable[n], apart[n], hops[n], weights[n])

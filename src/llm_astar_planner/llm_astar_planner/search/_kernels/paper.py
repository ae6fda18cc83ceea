# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The compiled search loop of the paper's methods, exact to its published code.

One loop serves A*, weighted A*, dynamic weighted A* and LLM-A*: f = g + (w h(goal) + h(target)).
The methods differ in w and in the target. Nodes are numbered x * height + y, so that the
heap's order (f, node) is the published order (f, x, y).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from llm_astar_planner.search._kernels import astar as shared
from llm_astar_planner.search._kernels.astar import heap_pop, heap_push, sift_down
from llm_astar_planner.search.arrays import Bools, Float64s, Int8s, Int32s, Int64s, Uint8s
from llm_astar_planner.search.kernel_cache import jit

EUCLIDEAN, OCTILE, CHEBYSHEV, MANHATTAN = range(4)
# What estimates depend on: the map's height, the kind of heuristic, whether there is a target,
# and the goal and the target, (x, y) each.
Aim = tuple[int, int, bool, int, int, float, float]
# Slots of the counts that a search keeps from call to call; all 0 before the first.
SIZE, TARGET, STORAGE, EXPANSIONS, STALE, COUNTS = range(6)
SQRT2 = math.sqrt(2.0)

# The published order of neighbours; it decides ties among parents.
_DX = np.array([-1, -1, 0, 1, 1, 1, 0, -1], dtype=np.int64)
_DY = np.array([0, 1, 1, 1, 0, -1, -1, -1], dtype=np.int64)


@jit
def distance(kind: int, dx: float, dy: float) -> float:
    """Return the obstacle-free distance of a displacement in cells, by heuristic `kind`."""
    dx, dy = abs(dx), abs(dy)
    if kind == EUCLIDEAN:
        return math.sqrt(dx * dx + dy * dy)
    if kind == OCTILE:
        return max(dx, dy) + (SQRT2 - 1.0) * min(dx, dy)
    if kind == CHEBYSHEV:
        return max(dx, dy)
    return dx + dy


@jit
def estimate_cost(node: int, weight: float, aim: Aim) -> float:
    """Return w h(goal) + h(target), summed in the published order."""
    height, kind, guided, goal_x, goal_y, target_x, target_y = aim
    x, y = node // height, node % height
    estimate = weight * distance(kind, x - goal_x, y - goal_y)
    if guided:
        estimate += distance(kind, x - target_x, y - target_y)
    return estimate


@jit
def rekey(keys: Any, nodes: Any, size: int, g: Any, weight: float, aim: Aim) -> None:
    """Give every OPEN entry its current g plus the new estimate; duplicates stay."""
    for i in range(size):
        keys[i] = g[nodes[i]] + estimate_cost(nodes[i], weight, aim)
    for i in range(size // 2 - 1, -1, -1):
        sift_down(keys, nodes, i, size, True)


@jit
def paper_search(
    blocked: Bools,
    start: int,
    goal: int,
    targets: Float64s,
    kind: int,
    decay: float,
    corner_cutting: bool,
    stop: Uint8s,
    quota: int,
    seen: Bools,
    closed: Bools,
    g: Float64s,
    move_to: Int8s,
    counts: Int64s,
    weights: Float64s,
    keys: Float64s,
    nodes: Int64s,
) -> int:
    """Search from the node `start` to `goal` on `blocked` [height, width], or go on with that.

    `targets` [n, 2] is the paper's target list without its start: the search heads for each in
    turn; empty means no target term. `weights` is the weight of h(goal) and what it was before it
    was limited to 1 and more, which is multiplied by `decay` at each pop. `seen` and `closed`, all
    False at first, `g` and `move_to` (the move from the parent) are [width * height] and filled
    in: g and move of seen cells only. The heap is in `keys` and `nodes`. A call ends after
    `quota` queue entries were popped or given new keys.
    """
    height, width = blocked.shape
    guided = len(targets) > 0
    size, index, stale = counts[SIZE], counts[TARGET], counts[STALE] != 0
    storage, expansions = counts[STORAGE], counts[EXPANSIONS]
    goal_x, goal_y = goal // height, goal % height
    target_x, target_y = (targets[index, 0], targets[index, 1]) if guided else (0.0, 0.0)
    aim = height, kind, guided, goal_x, goal_y, target_x, target_y
    w, raw_weight = weights[0], weights[1]
    if storage == 0:
        g[start] = 0.0
        seen[start] = True
        keys[0] = estimate_cost(start, w, aim)
        nodes[0] = start
        size = storage = 1

    while True:
        if size == 0:
            status = shared.EXHAUSTED
            break
        if stop[0]:
            status = shared.STOPPED
            break
        if quota <= 0:
            status = shared.RUNNING
            break
        if size + 8 > len(keys):
            status = shared.NEED_SPACE
            break
        quota -= 1
        if decay != 1.0:
            # All of OPEN gets keys with the current weight before each pop. Once the weight stays
            # at 1, only a g that has shrunk since then can change a key.
            new_w = max(1.0, raw_weight)
            if new_w != w or stale:
                w = new_w
                rekey(keys, nodes, size, g, w, aim)
                quota -= size
                stale = False
            raw_weight *= decay

        node = heap_pop(keys, nodes, size, True)
        size -= 1
        expansions += 1
        closed[node] = True
        if node == goal:
            status = shared.FOUND
            break

        x, y = node // height, node % height
        for move in range(8):
            nx, ny = x + _DX[move], y + _DY[move]
            at_target = guided and nx == target_x and ny == target_y
            if at_target and not (nx == goal_x and ny == goal_y):
                if index + 1 < len(targets):
                    index += 1
                    target_x, target_y = targets[index, 0], targets[index, 1]
                    aim = height, kind, guided, goal_x, goal_y, target_x, target_y
                rekey(keys, nodes, size, g, w, aim)
                quota -= size
            if nx < 0 or ny < 0 or nx >= width or ny >= height:
                continue
            neighbour = nx * height + ny
            if closed[neighbour]:
                continue
            if not seen[neighbour]:
                seen[neighbour] = True
                g[neighbour] = np.inf
                storage += 1
            # Only the start can be a blocked node here: none of its moves is legal.
            if blocked[ny, nx] or blocked[y, x]:
                continue
            diagonal = nx != x and ny != y
            if diagonal and not corner_cutting and (blocked[y, nx] or blocked[ny, x]):
                continue
            new_g = g[node] + (SQRT2 if diagonal else 1.0)
            if new_g < g[neighbour]:
                stale = stale or g[neighbour] != np.inf
                g[neighbour] = new_g
                move_to[neighbour] = move
                left = estimate_cost(neighbour, w, aim)
                heap_push(keys, nodes, size, new_g + left, neighbour, True)
                size += 1
    counts[SIZE], counts[TARGET], counts[STALE] = size, index, stale
    counts[STORAGE], counts[EXPANSIONS] = storage, expansions
    weights[0], weights[1] = w, raw_weight
    return status


@jit
def trace_back(move_to: Int8s, start: int, goal: int, height: int) -> tuple[Int32s, int]:
    """Follow the parent moves from `goal` to `start`.

    Returns the cells [n, 2] from start to goal, and how many moves between them are diagonal.
    """
    nodes, diagonals = [goal], 0
    while nodes[-1] != start:
        move = move_to[nodes[-1]]
        diagonals += _DX[move] != 0 and _DY[move] != 0
        nodes.append(nodes[-1] - _DX[move] * height - _DY[move])
    path = np.empty((len(nodes), 2), dtype=np.int32)
    for i, node in enumerate(nodes[::-1]):
        path[i, 0], path[i, 1] = node // height, node % height
    return path, diagonals

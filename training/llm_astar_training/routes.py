"""Training labels, compiled: how good each next hop on the way to the goal is.

The nodes are the start, the goal and the cells just beyond both ends of each barrier; see
`llm_astar_planner.waypoints.learned`. A line of sight is one in the sense of
`llm_astar_planner.search.any_angle`: it touches no barrier, and blocked cells that share a side
are connected. Shortest ways over the visibility graph of the nodes give the labels.
"""

from __future__ import annotations

import math

import numpy as np

from llm_astar_training import maps
from llm_astar_training.maps import Flags, Floats, Ints, draw_endpoints, draw_map, is_blocked, jit

# How much longer than the shortest a route may be and count as about as good: in cells, and as a
# share of the map's longer side.
TOLERANCE_CELLS = 0.25
TOLERANCE_SIDE = 0.004
# The weight of rows off the shortest route; rows on it have weight 1.
OFF_ROUTE = 0.25
# The recipe asks for five cells between start and goal; a useful problem needs a detour.
MIN_DISTANCE = 5.0
MIN_DETOUR = 1.15


@jit
def place_nodes(barriers: Ints, endpoints: Ints) -> Ints:
    """Return the cells [2 + 2 B, 2] of start, goal and just beyond the barriers' ends."""
    count = barriers.shape[0]
    nodes = np.empty((2 + 2 * count, 2), np.int32)
    for axis in range(2):
        nodes[0, axis], nodes[1, axis] = endpoints[0, axis], endpoints[1, axis]
    for k in range(count):
        along = 0 if barriers[k, 0] else 1
        nodes[2 + 2 * k, along] = barriers[k, 2] - 1
        nodes[3 + 2 * k, along] = barriers[k, 3] + 1
        nodes[2 + 2 * k, 1 - along] = nodes[3 + 2 * k, 1 - along] = barriers[k, 1]
    return nodes


@jit
def bounding_box(barrier: Ints) -> tuple[int, int, int, int]:
    """Return the lowest x and y and the highest x and y of a barrier's cells."""
    if barrier[0]:
        return barrier[2], barrier[1], barrier[3], barrier[1]
    return barrier[1], barrier[2], barrier[1], barrier[3]


@jit
def connecting_walls(barriers: Ints) -> Ints:
    """Return the walls (horizontal, line, first, last) that connect barriers side by side."""
    count = barriers.shape[0]
    found = np.empty((count * count + 1, 4), np.int32)
    n = 0
    for a in range(count):
        for b in range(a):
            low, high = np.empty(2, np.int32), np.empty(2, np.int32)
            one, two = bounding_box(barriers[a]), bounding_box(barriers[b])
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


@jit
def touches(wall: Ints, ax: int, ay: int, bx: int, by: int) -> bool:
    """Tell whether the closed line a-b touches the closed wall, in whole numbers."""
    if not wall[0]:
        ax, ay, bx, by = ay, ax, by, bx
    line, first, last = wall[1], wall[2], wall[3]
    da, db = ay - line, by - line
    if (da > 0 and db > 0) or (da < 0 and db < 0):
        return False
    if da == db:
        return max(ax, bx) >= first and min(ax, bx) <= last
    # The line crosses that of the wall at x = (ax db - bx da) / (db - da).
    over, under = ax * db - bx * da, db - da
    if under < 0:
        over, under = -over, -under
    return first * under <= over <= last * under


@jit
def is_visible(walls: Ints, ax: int, ay: int, bx: int, by: int) -> bool:
    """Tell whether the line a-b touches no wall."""
    for k in range(walls.shape[0]):
        if touches(walls[k], ax, ay, bx, by):
            return False
    return True


@jit
def mark_usable(barriers: Ints, size: Ints, nodes: Ints, usable: Flags) -> None:
    """Mark in `usable` [N] the nodes that are free cells and differ from all earlier nodes."""
    for i in range(len(nodes)):
        usable[i] = not is_blocked(barriers, size[0], size[1], nodes[i, 0], nodes[i, 1])
        for j in range(i):
            if nodes[i, 0] == nodes[j, 0] and nodes[i, 1] == nodes[j, 1]:
                usable[i] = False


@jit
def measure_visibility(barriers: Ints, nodes: Ints, usable: Flags, distances: Floats) -> None:
    """Fill in `distances` [N, N] in cells between usable nodes in sight, infinity elsewhere."""
    connecting = connecting_walls(barriers)
    for i in range(len(nodes)):
        distances[i, i] = np.inf
        for j in range(i):
            ax, ay, bx, by = nodes[i, 0], nodes[i, 1], nodes[j, 0], nodes[j, 1]
            visible = usable[i] and usable[j] and is_visible(barriers, ax, ay, bx, by)
            distance = np.inf
            if visible and is_visible(connecting, ax, ay, bx, by):
                distance = math.sqrt((ax - bx) ** 2 + (ay - by) ** 2)
            distances[i, j] = distances[j, i] = distance


@jit
def lengths_to_goal(distances: Floats) -> Floats:
    """Return the length in cells of the shortest route from each node to node 1, the goal."""
    count = len(distances)
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
            lengths[i] = min(lengths[i], lengths[best] + distances[best, i])
    return lengths


@jit
def soften_hops(
    distances: Floats, lengths: Floats, tolerance: float, hops: Floats, weights: Floats
) -> None:
    """Fill in the probabilities of the next hop, `hops` [N, N], and the rows' `weights` [N].

    p(j | i) falls by a factor of e per `tolerance` cells that the route by j is longer than the
    shortest.
    """
    count = len(distances)
    for i in range(count):
        if i == 1 or not np.isfinite(lengths[i]):
            continue
        weights[i] = OFF_ROUTE
        total = 0.0
        for j in range(count):
            if np.isfinite(distances[i, j]):
                hops[i, j] = math.exp(-(distances[i, j] + lengths[j] - lengths[i]) / tolerance)
                total += hops[i, j]
        for j in range(count):
            hops[i, j] /= total
    node = 0
    while node != 1:
        weights[node] = 1.0
        best = 0
        for j in range(count):
            if distances[node, j] + lengths[j] < distances[node, best] + lengths[best]:
                best = j
        node = best


@jit
def is_worth_learning(kind: int, distances: Floats, length: float, direct: float) -> bool:
    """Tell whether to keep a problem: mostly those that need a detour."""
    if not np.isfinite(length) or direct < 1.5:
        return False
    if np.isfinite(distances[0, 1]):
        return kind not in (maps.RECIPE, maps.SCALED) and np.random.random() < 0.04
    if kind in (maps.RECIPE, maps.SCALED) and direct < MIN_DISTANCE:
        return False
    return length >= MIN_DETOUR * direct or np.random.random() < 0.5


@jit
def draw_problem(
    kind: int, barriers: Ints, size: Ints, endpoints: Ints,
    usable: Flags, distances: Floats, hops: Floats, weights: Floats,
) -> None:  # fmt: skip
    """Draw one problem with its labels into arrays of zeros, until it is worth learning."""
    while True:
        if not (draw_map(kind, barriers, size) and draw_endpoints(barriers, size, endpoints)):
            continue
        if kind == maps.SCALED:
            maps.scale_map(barriers, size, endpoints, np.random.randint(2, maps.MAX_SCALE + 1))
            if np.random.random() < 0.5:
                draw_endpoints(barriers, size, endpoints)
        nodes = place_nodes(barriers, endpoints)
        mark_usable(barriers, size, nodes, usable)
        if not usable[1]:
            continue
        measure_visibility(barriers, nodes, usable, distances)
        lengths = lengths_to_goal(distances)
        dx, dy = endpoints[0, 0] - endpoints[1, 0], endpoints[0, 1] - endpoints[1, 1]
        if is_worth_learning(kind, distances, lengths[0], math.sqrt(dx * dx + dy * dy)):
            break
    tolerance = TOLERANCE_CELLS + TOLERANCE_SIDE * max(size[0], size[1])
    soften_hops(distances, lengths, tolerance, hops, weights)


@jit
def fill_batch(
    seed: int, kind: int, barriers: Ints, size: Ints, endpoints: Ints,
    usable: Flags, distances: Floats, hops: Floats, weights: Floats,
) -> None:  # fmt: skip
    """Fill a batch of problems in place; the same seed gives the same batch."""
    np.random.seed(seed)
    for n in range(len(barriers)):
        draw_problem(
            kind, barriers[n], size[n], endpoints[n],
            usable[n], distances[n], hops[n], weights[n],
        )  # fmt: skip

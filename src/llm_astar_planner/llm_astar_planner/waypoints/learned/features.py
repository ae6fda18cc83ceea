# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The inputs of the embedded waypoint model: features of barriers, start and goal.

A problem with B barriers has N = 2 + 2 B nodes: the start, the goal, and for each barrier the
cell just beyond its first and just beyond its last cell. Arrays are batched over n problems with
the same number of barriers. Training and inference use the same code. Lines of sight are not used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

START, GOAL = 0, 1
# Fourier features of a coordinate: half periods of 1, 1/2, 1/4, ... of the longer side.
WAVES = 6
NODE_FEATURES = 6 * (1 + 2 * WAVES) + 4 + 3 + 3 + 2 + 4
BARRIER_FEATURES = 8
PAIR_FEATURES = 6
# Coordinates relative to a barrier are in units of the longer side divided by this.
PARTS = 6.0


@dataclass(frozen=True)
class Features:
    """The network's inputs, float32."""

    nodes: Floats  # [n, N, NODE_FEATURES]
    barriers: Floats  # [n, N, B, BARRIER_FEATURES]: nodes relative to barriers
    pairs: Floats  # [n, PAIR_FEATURES, N, N]


def place_nodes(barriers: NDArray[np.int32], endpoints: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the cells [n, N, 2] of the nodes.

    `barriers` [n, B, 4] are (horizontal, line, first, last), `endpoints` [n, 2, 2] start and goal.
    """
    horizontal, line, first, last = np.moveaxis(barriers, -1, 0)
    tips = np.stack([first - 1, last + 1], axis=-1)
    lines = np.stack([line, line], axis=-1)
    flat = horizontal[..., None] == 1
    cells = np.stack([np.where(flat, tips, lines), np.where(flat, lines, tips)], axis=-1)
    return np.concatenate([endpoints, cells.reshape(len(cells), -1, 2)], axis=1)


def featurise(
    barriers: NDArray[np.int32], size: NDArray[np.int32], endpoints: NDArray[np.int32]
) -> Features:
    """Compute the network's inputs; `size` [n, 2] is width and height in cells."""
    cells = place_nodes(barriers, endpoints).astype(np.float32)
    side = size.max(axis=1).astype(np.float32)
    return Features(
        node_features(barriers, size, cells, side),
        barrier_features(barriers, cells, side),
        pair_features(cells, side),
    )


def node_features(
    barriers: NDArray[np.int32], size: NDArray[np.int32], cells: Floats, side: Floats
) -> Floats:
    """Return [n, N, NODE_FEATURES]; `cells` [n, N, 2] are the nodes, `side` [n] longer sides."""
    count, nodes = cells.shape[:2]
    unit = side[:, None, None]
    places = np.concatenate(
        [cells - size[:, None] / 2, cells - cells[:, :1], cells - cells[:, 1:2]], axis=-1
    )
    places = (places / unit).astype(np.float32)
    turns = np.pi * 2.0 ** np.arange(WAVES, dtype=np.float32)
    waves = (places[..., None] * turns).astype(np.float32).reshape(count, nodes, -1)
    walls = np.concatenate([cells, size[:, None] - 1 - cells], axis=-1)
    shape = np.stack([np.log(side / 50), *(size / side[:, None]).T], axis=-1)
    kinds = np.zeros((count, nodes, 3), np.float32)
    kinds[:, START, 0] = kinds[:, GOAL, 1] = kinds[:, 2:, 2] = 1
    parts = [
        places, np.sin(waves), np.cos(waves), np.tanh(walls / 4),
        np.broadcast_to(shape[:, None], (count, nodes, 3)),
        kinds, tip_features(barriers, unit),
    ]  # fmt: skip
    return np.concatenate(parts, axis=-1, dtype=np.float32)


def tip_features(barriers: NDArray[np.int32], unit: Floats) -> Floats:
    """Return [n, N, 6]: the direction in which a barrier's end points; zeros for start and goal.

    The unit vector, the vector times the barrier's length over the longer side, and the vector
    times tanh(length in cells / 8).
    """
    count, each = barriers.shape[:2]
    flat = barriers[..., None, 0]
    away = np.array([-1, 1], np.float32)
    points = np.stack([flat * away, (1 - flat) * away], axis=-1).reshape((count, 2 * each, 2))
    cells = np.repeat(barriers[..., 3] - barriers[..., 2] + 1, 2, axis=1)[..., None]
    tips = np.concatenate([points, points * cells / unit, points * np.tanh(cells / 8)], axis=-1)
    return np.concatenate([np.zeros((count, 2, 6)), tips], axis=1, dtype=np.float32)


def barrier_features(barriers: NDArray[np.int32], cells: Floats, side: Floats) -> Floats:
    """Return [n, N, B, BARRIER_FEATURES]: nodes relative to a barrier's ends and its line."""
    horizontal, line, first, last = np.moveaxis(barriers[:, None], -1, 0)
    x, y = cells[:, :, None, 0], cells[:, :, None, 1]
    along = np.where(horizontal == 1, x, y)
    across = np.where(horizontal == 1, y, x)
    from_ends = np.stack([along - first, along - last, across - line], axis=-1)
    own = np.zeros(along.shape, np.float32)
    for k in range(barriers.shape[1]):
        own[:, 2 + 2 * k : 4 + 2 * k, k] = 1
    parts = [
        from_ends * (PARTS / side[:, None, None, None]),
        np.tanh(from_ends / 2),
        own[..., None],
        np.ones_like(own)[..., None],
    ]
    return np.concatenate(parts, axis=-1, dtype=np.float32)


def pair_features(cells: Floats, side: Floats) -> Floats:
    """Return [n, PAIR_FEATURES, N, N]: offset from node i to j, distance, inverse distance."""
    gap = cells[:, None] - cells[:, :, None]
    apart = np.hypot(gap[..., 0], gap[..., 1])
    unit = side[:, None, None]
    parts = [
        gap[..., 0] / unit, gap[..., 1] / unit, apart / unit,
        np.tanh(apart / 3), np.sqrt(apart / unit), PARTS / (PARTS * apart / unit + 0.3),
    ]  # fmt: skip
    return np.stack(parts, axis=1).astype(np.float32)

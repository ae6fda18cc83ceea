"""What the embedded waypoint model is told: numbers of a prompt's barriers, start and goal.

A problem of B barriers has N = 2 + 2 B nodes: the start, the goal, and for each barrier the cell
straight beyond its first and beyond its last cell. Everything here is batched over n problems of
equally many barriers and is the same in training and in use. No line of sight is looked at.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

START, GOAL = 0, 1
# Waves of Fourier features over a coordinate: half periods of the longer side, and so on down.
WAVES = 6
NODE_FEATURES = 6 * (1 + 2 * WAVES) + 4 + 3 + 3 + 2 + 4
BARRIER_FEATURES = 8
PAIR_FEATURES = 6
# Coordinates relative to a barrier, in the longer side's parts of this size.
PARTS = 6.0


@dataclass(frozen=True)
class Features:
    """The network's inputs, float32."""

    nodes: Floats  # [n, N, NODE_FEATURES]
    barriers: Floats  # [n, N, B, BARRIER_FEATURES]: a node as a barrier sees it
    pairs: Floats  # [n, PAIR_FEATURES, N, N]


def place_nodes(barriers: NDArray[np.int32], ends: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the cells [n, N, 2] of the nodes.

    `barriers` [n, B, 4] are (horizontal, line, first, last), `ends` [n, 2, 2] start and goal.
    """
    horizontal, line, first, last = np.moveaxis(barriers, -1, 0)
    tips = np.stack([first - 1, last + 1], axis=-1)
    lines = np.stack([line, line], axis=-1)
    flat = horizontal[..., None] == 1
    cells = np.stack([np.where(flat, tips, lines), np.where(flat, lines, tips)], axis=-1)
    return np.concatenate([ends, cells.reshape(len(cells), -1, 2)], axis=1)


def featurise(
    barriers: NDArray[np.int32], size: NDArray[np.int32], ends: NDArray[np.int32]
) -> Features:
    """Turn problems into the network's inputs; `size` [n, 2] is width and height in cells."""
    cells = place_nodes(barriers, ends).astype(np.float32)
    side = size.max(axis=1).astype(np.float32)
    return Features(
        _node_features(barriers, size, cells, side),
        _barrier_features(barriers, cells, side),
        _pair_features(cells, side),
    )


def _node_features(
    barriers: NDArray[np.int32], size: NDArray[np.int32], cells: Floats, side: Floats
) -> Floats:
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
    parts = [
        places, np.sin(waves), np.cos(waves), np.tanh(walls / 4),
        np.broadcast_to(shape[:, None], (count, nodes, 3)),
        _kinds(count, nodes), _tips(barriers, unit),
    ]  # fmt: skip
    return np.concatenate(parts, axis=-1, dtype=np.float32)


def _kinds(count: int, nodes: int) -> Floats:
    kinds = np.zeros((count, nodes, 3), np.float32)
    kinds[:, START, 0] = kinds[:, GOAL, 1] = kinds[:, 2:, 2] = 1
    return kinds


def _tips(barriers: NDArray[np.int32], unit: Floats) -> Floats:
    """Return [n, N, 6]: which way a tip points, three times; zeros for start and goal.

    Plain, times its barrier's length over the side, and times that in cells, squashed.
    """
    count, each = barriers.shape[:2]
    flat = barriers[..., None, 0]
    away = np.array([-1, 1], np.float32)
    points = np.stack([flat * away, (1 - flat) * away], axis=-1).reshape((count, 2 * each, 2))
    cells = np.repeat(barriers[..., 3] - barriers[..., 2] + 1, 2, axis=1)[..., None]
    tips = np.concatenate([points, points * cells / unit, points * np.tanh(cells / 8)], axis=-1)
    return np.concatenate([np.zeros((count, 2, 6)), tips], axis=1, dtype=np.float32)


def _barrier_features(barriers: NDArray[np.int32], cells: Floats, side: Floats) -> Floats:
    """Look at nodes along and across each barrier: from its first cell, its last and its line."""
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


def _pair_features(cells: Floats, side: Floats) -> Floats:
    """Return [n, PAIR_FEATURES, N, N]: the way from i to j, its length, and its inverse last."""
    gap = cells[:, None] - cells[:, :, None]
    apart = np.hypot(gap[..., 0], gap[..., 1])
    unit = side[:, None, None]
    parts = [
        gap[..., 0] / unit, gap[..., 1] / unit, apart / unit,
        np.tanh(apart / 3), np.sqrt(apart / unit), PARTS / (PARTS * apart / unit + 0.3),
    ]  # fmt: skip
    return np.stack(parts, axis=1).astype(np.float32)

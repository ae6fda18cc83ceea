"""Batches of problems with labels, and the seeded schedule of what each step learns from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from llm_astar_training.maps import BOXES, KINDS, MOST_PARALLEL, RECIPE, ROOMS, SCALED, SCATTERED
from llm_astar_training.routes import fill_batch

# How often a step learns from each kind of map.
SHARES = {RECIPE: 0.35, SCALED: 0.12, SCATTERED: 0.23, ROOMS: 0.15, BOXES: 0.15}
MOST_BARRIERS = 30
MOST_MAPS = 256
# Pairs of nodes times barriers in a batch, which bounds its memory and its time.
MOST_TRIPLES = 660_000
# Training steps count up from here; held-out problems are drawn from seeds above them all.
HELD_OUT_SEED = 4_000_000_000


@dataclass(frozen=True)
class Batch:
    """n problems of B barriers each, N = 2 + 2 B nodes; see `routes` for the labels."""

    kind: int
    barriers: NDArray[np.int32]  # [n, B, 4]
    size: NDArray[np.int32]  # [n, 2]
    ends: NDArray[np.int32]  # [n, 2, 2]
    usable: NDArray[np.bool_]  # [n, N]
    apart: NDArray[np.float32]  # [n, N, N]
    hops: NDArray[np.float32]  # [n, N, N]
    weights: NDArray[np.float32]  # [n, N]


def make_batch(seed: int, kind: int, barriers: int, count: int) -> Batch:
    """Draw `count` problems of one kind and number of barriers."""
    nodes = 2 + 2 * barriers
    batch = Batch(
        kind,
        np.zeros((count, barriers, 4), np.int32),
        np.zeros((count, 2), np.int32),
        np.zeros((count, 2, 2), np.int32),
        np.zeros((count, nodes), np.bool_),
        np.zeros((count, nodes, nodes), np.float32),
        np.zeros((count, nodes, nodes), np.float32),
        np.zeros((count, nodes), np.float32),
    )
    fill_batch(
        seed, kind, batch.barriers, batch.size, batch.ends,
        batch.usable, batch.apart, batch.hops, batch.weights,
    )  # fmt: skip
    return batch


def batch_size(barriers: int, most: int = MOST_MAPS) -> int:
    """Return how many maps of so many barriers a batch holds."""
    nodes = 2 + 2 * barriers
    return max(4, min(most, MOST_TRIPLES // (nodes * nodes * max(barriers, 1))))


def step_batch(seed: int, step: int, most: int = MOST_MAPS) -> Batch:
    """Draw the batch of a training step. Raises ValueError where it would reach the held-out."""
    if not 0 <= seed < 1000 or not 0 <= step < 4_000_000:
        message = f'seed {seed}, step {step}: seeds up to 999 and steps below 4 million are apart'
        raise ValueError(message)
    draw = np.random.default_rng([seed, step])
    kind = int(draw.choice(len(KINDS), p=[SHARES[kind] for kind in range(len(KINDS))]))
    if kind in (RECIPE, SCALED):
        barriers = int(draw.integers(1, MOST_PARALLEL, size=2, endpoint=True).sum())
    else:
        # Few as often as many, without the cost of many.
        barriers = int((MOST_BARRIERS + 1) ** draw.random())
        barriers = barriers if draw.random() < 0.97 else 0
        barriers = max(barriers, 1) if kind != SCATTERED else barriers
    return make_batch(seed * 4_000_000 + step, kind, barriers, batch_size(barriers, most))


def held_out(maps: int) -> list[Batch]:
    """Return the fixed held-out problems: about `maps` of the recipe, then as many wider ones."""
    batches = [
        make_batch(HELD_OUT_SEED + n, RECIPE, n, max(1, round(maps * share / 16)))
        for n, share in zip(range(2, 9), (1, 2, 3, 4, 3, 2, 1))
    ]
    wide = [
        (kind, barriers)
        for kind in (SCALED, SCATTERED, ROOMS, BOXES)
        for barriers in ((3, 5, 8) if kind == SCALED else (4, 12, 20, 30))
    ]
    return batches + [
        make_batch(HELD_OUT_SEED + 100 + n, kind, barriers, max(1, maps // len(wide)))
        for n, (kind, barriers) in enumerate(wide)
    ]

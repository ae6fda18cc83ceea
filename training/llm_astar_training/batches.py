"""Batches of labelled problems, the seeded schedule of training steps, and how routes score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from llm_astar_planner.waypoints.learned import Route, follow

from llm_astar_training import maps
from llm_astar_training.maps import Flags, Floats, Ints
from llm_astar_training.routes import fill_batch

# The share of steps that learn from each of `maps.KINDS`.
SHARES = (0.35, 0.12, 0.23, 0.15, 0.15)
MAX_BARRIERS = 30
MAX_MAPS = 256
# Pairs of nodes times barriers in a batch: limits its memory and its time.
MAX_TRIPLES = 660_000
# The seeds of training steps count up from 0; held-out problems have seeds above all of them.
STEPS_PER_SEED = 4_000_000
HELD_OUT_SEED = 1000 * STEPS_PER_SEED


@dataclass(frozen=True)
class Batch:
    """n problems of B barriers each, N = 2 + 2 B nodes; see `routes` for the labels.

    The arrays are in the order in which `fill_batch` takes them.
    """

    kind: int
    barriers: Ints  # [n, B, 4]
    size: Ints  # [n, 2]
    endpoints: Ints  # [n, 2, 2]
    usable: Flags  # [n, N]
    distances: Floats  # [n, N, N]
    hops: Floats  # [n, N, N]
    weights: Floats  # [n, N]


def make_batch(seed: int, kind: int, barriers: int, count: int) -> Batch:
    """Draw `count` problems of one kind and number of barriers."""
    nodes = 2 + 2 * barriers
    arrays: list[Any] = [
        np.zeros((count, barriers, 4), np.int32),
        np.zeros((count, 2), np.int32),
        np.zeros((count, 2, 2), np.int32),
        np.zeros((count, nodes), np.bool_),
        np.zeros((count, nodes, nodes), np.float32),
        np.zeros((count, nodes, nodes), np.float32),
        np.zeros((count, nodes), np.float32),
    ]
    fill_batch(seed, kind, *arrays)
    return Batch(kind, *arrays)


def step_batch(seed: int, step: int, most: int = MAX_MAPS, left_out: Sequence[int] = ()) -> Batch:
    """Draw the batch of a training step, of at most `most` maps, of no kind that is left out.

    Raises ValueError for a seed or step whose problems would overlap with others.
    """
    if not 0 <= seed < 1000 or not 0 <= step < STEPS_PER_SEED:
        message = f'seed {seed}, step {step}: not a seed below 1000 and a step below 4 million'
        raise ValueError(message)
    draw = np.random.default_rng([seed, step])
    shares = np.array([0.0 if kind in left_out else share for kind, share in enumerate(SHARES)])
    kind = int(draw.choice(len(SHARES), p=shares / shares.sum() if left_out else SHARES))
    if kind in (maps.RECIPE, maps.SCALED):
        barriers = int(draw.integers(1, maps.MAX_PARALLEL, size=2, endpoint=True).sum())
    else:
        # Drawn on a log scale: many barriers cost much time.
        barriers = int((MAX_BARRIERS + 1) ** draw.random())
        barriers = barriers if draw.random() < 0.97 else 0
        barriers = max(barriers, 1) if kind != maps.SCATTERED else barriers
    triples = (2 + 2 * barriers) ** 2 * max(barriers, 1)
    count = max(4, min(most, MAX_TRIPLES // triples))
    return make_batch(seed * STEPS_PER_SEED + step, kind, barriers, count)


def held_out(count: int) -> list[Batch]:
    """Return the fixed held-out problems: about `count` of the recipe and as many wider ones."""
    batches = [
        make_batch(HELD_OUT_SEED + n, maps.RECIPE, n, max(1, round(count * share / 16)))
        for n, share in zip(range(2, 9), (1, 2, 3, 4, 3, 2, 1))
    ]
    wide = [
        (kind, barriers)
        for kind in (maps.SCALED, maps.SCATTERED, maps.ROOMS, maps.BOXES)
        for barriers in ((3, 5, 8) if kind == maps.SCALED else (4, 12, 20, 30))
    ]
    return batches + [
        make_batch(HELD_OUT_SEED + 100 + n, kind, barriers, max(1, count // len(wide)))
        for n, (kind, barriers) in enumerate(wide)
    ]


def greedy_routes(logits: Floats, usable: Flags) -> list[Route]:
    """Return each problem's greedy route; `logits` is [n, N, N], `usable` [n, N]."""
    return [follow(*problem) for problem in zip(logits, usable)]


def valid_share(routes: Sequence[Route], distances: Floats) -> float:
    """Return the share of the routes whose segments are all in sight; `distances` [n, N, N]."""
    valid = [
        np.isfinite(distances[n, route[:-1], route[1:]]).all() for n, route in enumerate(routes)
    ]
    return float(np.mean(valid))

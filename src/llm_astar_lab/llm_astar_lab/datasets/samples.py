# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Selects samples of a dataset."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr, shortened
from llm_astar_msgs_adapter.maps.barrier_map import Sample
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap, load_maps
from llm_astar_planner.costmap.config import CostmapConfig

# MovingAI's rules: a diagonal move needs both adjacent cells free, and only lengths count.
GRID_CONFIG = CostmapConfig(corner_cutting=False, cost_travel_multiplier=0.0)
# Numbers that ranges may name, and digits of each.
MAX_NUMBERS, MAX_DIGITS = 1_000_000, 15


class SelectionError(LlmAstarError, ValueError):
    """Samples cannot be selected as asked; the message names the option."""


@dataclass(frozen=True, slots=True)
class BenchmarkSample:
    """One start-goal pair, with its unscaled map (without samples) and its index on that map."""

    barrier_map: ProblemMap
    pair: int
    sample: Sample

    @property
    def key(self) -> tuple[int, int]:
        """The map's id and the pair's index."""
        return self.barrier_map.id, self.pair


def load_samples(
    path: str | Path, maps: str | None = None, limit: int | None = None, seed: int = 0
) -> list[BenchmarkSample]:
    """Load the samples of a dataset in order of map and pair.

    `maps` selects map ids, such as `50-99` or `0-9,12`. `limit` draws that many samples with
    `seed`; a larger limit includes every sample of a smaller one. Raises what `load_maps` raises
    on a bad file, and SelectionError where no sample is left.
    """
    return select_samples(load_maps(path, limit, seed), str(path), maps, limit, seed)


def select_samples(
    loaded: Sequence[ProblemMap],
    path: str,
    maps: str | None = None,
    limit: int | None = None,
    seed: int = 0,
) -> list[BenchmarkSample]:
    """Select samples from loaded maps as `load_samples` does; messages name `path`."""
    if maps is not None:
        wanted = set(parse_ranges(maps, '--map-ids'))
        known = {barrier_map.id for barrier_map in loaded}
        if not wanted & known:
            ids = f'{min(known)} to {max(known)}' if len(known) > 1 else str(*known)
            message = f'--map-ids {maps}: {path} has none of them, its ids are {ids}'
            raise SelectionError(message)
        loaded = [barrier_map for barrier_map in loaded if barrier_map.id in wanted]
    samples = [
        BenchmarkSample(bare, pair, sample)
        for barrier_map in loaded
        for bare in (replace(barrier_map, samples=()),)
        for pair, sample in enumerate(barrier_map.samples)
    ]
    if not samples:
        raise SelectionError(f'{path}: its maps have no samples')
    return samples if limit is None else draw(samples, limit, seed)


def draw(samples: Sequence[BenchmarkSample], count: int, seed: int) -> list[BenchmarkSample]:
    """Draw `count` samples, or all if there are fewer, and return them in their order."""
    order = list(range(len(samples)))
    random.Random(seed).shuffle(order)  # noqa: S311 - no secret
    return [samples[i] for i in sorted(order[:count])]


def sample_pairs(
    samples: Sequence[BenchmarkSample], scales: Sequence[int], count: int, seed: int
) -> list[tuple[BenchmarkSample, int]]:
    """Return which samples a run has at which scales: all at scale 1, `count` at the others.

    These are drawn with `seed`, and are at scale 1 too so that the scales can be compared.
    """
    pairs = [(sample, 1) for sample in samples if 1 in scales]
    larger = [scale for scale in scales if scale != 1]
    if larger:
        drawn = draw(samples, count, seed)
        pairs += [(sample, scale) for scale in (1, *larger) for sample in drawn]
    return pairs


def parse_ranges(text: str, option: str) -> list[int]:
    """Parse whole numbers such as `1-10` or `0-9,12`, ascending.

    Raises SelectionError, also for more than MAX_NUMBERS.
    """
    shown = f'{option} {shortened(text)}'
    numbers: set[int] = set()
    for part in text.split(','):
        first, dash, last = part.strip().partition('-')
        is_range = first.isdecimal() and (last.isdecimal() or not dash)
        if not is_range or max(len(first), len(last)) > MAX_DIGITS:
            what = short_repr(part)
            raise SelectionError(f'{shown}: {what} is not a number or a range such as 50-99')
        chosen = range(int(first), int(last or first) + 1)
        if len(chosen) + len(numbers) > MAX_NUMBERS:
            raise SelectionError(f'{shown}: names over {MAX_NUMBERS} numbers; choose fewer')
        numbers.update(chosen)
    if not numbers:
        raise SelectionError(f'{shown}: is empty')
    return sorted(numbers)

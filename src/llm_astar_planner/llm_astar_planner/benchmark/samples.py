"""The samples of a dataset: loaded, selected, scaled."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from llm_astar_msgs_adapter.barrier_map import BarrierMap, Sample, load_barrier_maps


class SelectionError(ValueError):
    """A selection of samples that cannot be made; the message names the option."""


@dataclass(frozen=True)
class BenchmarkSample:
    """One start-goal pair: its unscaled map (without its samples) and its index there."""

    barrier_map: BarrierMap
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

    `maps` selects map ids, such as `50-99` or `0-9,12`. `limit` draws so many of them by `seed`;
    a larger limit holds every sample of a smaller one. Raises BarrierMapError on a bad file and
    SelectionError on a selection that leaves nothing.
    """
    loaded = load_barrier_maps(path)
    if maps is not None:
        wanted = set(parse_ranges(maps, '--maps'))
        known = {barrier_map.id for barrier_map in loaded}
        if not wanted & known:
            message = f'--maps {maps}: {path} has none of them, its ids are {_ids(known)}'
            raise SelectionError(message)
        loaded = [barrier_map for barrier_map in loaded if barrier_map.id in wanted]
    samples = list(_samples(loaded))
    if not samples:
        message = f'{path}: its maps have no samples'
        raise SelectionError(message)
    return samples if limit is None else draw(samples, limit, seed)


def draw(samples: Sequence[BenchmarkSample], count: int, seed: int) -> list[BenchmarkSample]:
    """Draw `count` samples, all if there are fewer, and return them in their order."""
    order = list(range(len(samples)))
    random.Random(seed).shuffle(order)  # noqa: S311 - no secret
    return [samples[i] for i in sorted(order[:count])]


def parse_ranges(text: str, option: str) -> list[int]:
    """Read whole numbers such as `1-10` or `0-9,12`, ascending. Raises SelectionError."""
    numbers: set[int] = set()
    for part in text.split(','):
        first, dash, last = part.strip().partition('-')
        if not (first.isdecimal() and (last.isdecimal() or not dash)):
            message = f'{option} {text}: {part!r} is not a number or a range such as 50-99'
            raise SelectionError(message)
        numbers.update(range(int(first), int(last or first) + 1))
    if not numbers:
        message = f'{option} {text}: is empty'
        raise SelectionError(message)
    return sorted(numbers)


def _samples(maps: Iterable[BarrierMap]) -> Iterable[BenchmarkSample]:
    for barrier_map in maps:
        bare = replace(barrier_map, samples=())
        for pair, sample in enumerate(barrier_map.samples):
            yield BenchmarkSample(bare, pair, sample)


def _ids(ids: set[int]) -> str:
    shown = sorted(ids)
    return f'{shown[0]} to {shown[-1]}' if len(shown) > 1 else str(shown[0])

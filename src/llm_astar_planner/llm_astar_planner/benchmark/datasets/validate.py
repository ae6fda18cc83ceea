"""Check a dataset: what makes it unusable, and what makes it a poor benchmark."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, Sample, load_barrier_maps
from numpy.typing import NDArray
from scipy import ndimage

from llm_astar_planner.benchmark.datasets.generate import detour, query_sentence
from llm_astar_planner.search.visibility import LineOfSightChecker


class Finding(NamedTuple):
    """One thing found; an `error` keeps a sample from being planned, a note does not."""

    error: bool
    where: str
    message: str

    def __str__(self) -> str:
        """Write it as one line."""
        return f'{"error" if self.error else "note"}: {self.where}: {self.message}'


class DatasetSummary(NamedTuple):
    """What a dataset holds: sizes, and how far its barriers lengthen the ways, map by map."""

    maps: int
    samples: int
    detours: tuple[float, ...]


def check_file(path: str | Path) -> tuple[DatasetSummary, list[Finding]]:
    """Load a dataset file and check every sample.

    Raises BarrierMapError, naming file, map and field, where it is malformed.
    """
    maps = load_barrier_maps(path)
    return summarise(maps), list(check_maps(maps))


def summarise(maps: Sequence[BarrierMap]) -> DatasetSummary:
    """Count maps and samples and measure the detours."""
    samples = sum(len(barrier_map.samples) for barrier_map in maps)
    solvable = [m for m in maps if m.samples and not any(f.error for f in _check_map(m))]
    return DatasetSummary(len(maps), samples, tuple(detour(m) for m in solvable))


def check_maps(maps: Sequence[BarrierMap]) -> Iterator[Finding]:
    """Yield what is wrong or odd, map by map."""
    for barrier_map in maps:
        yield from _check_map(barrier_map)


def _check_map(barrier_map: BarrierMap) -> Iterator[Finding]:
    where = f'map {barrier_map.id}'
    if not barrier_map.samples:
        yield Finding(False, where, 'has no samples')
    blocked = barrier_map.to_grid().blocked()
    labels, _ = ndimage.label(~blocked, structure=np.ones((3, 3)))
    walls = LineOfSightChecker(blocked)
    seen: set[tuple[object, object]] = set()
    for pair, sample in enumerate(barrier_map.samples):
        name = f'{where}, pair {pair}'
        yield from _check_sample(name, barrier_map, sample, labels, walls)
        if sample[:2] in seen:
            yield Finding(False, name, 'repeats an earlier pair')
        seen.add(sample[:2])


def _check_sample(
    where: str,
    barrier_map: BarrierMap,
    sample: Sample,
    labels: NDArray[np.int32],
    walls: LineOfSightChecker,
) -> Iterator[Finding]:
    start, goal = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
    for name, (x, y) in (('start', start), ('goal', goal)):
        if labels[y, x] == 0:
            yield Finding(True, where, f'{name} {(x, y)} lies on a barrier or on the outer wall')
            return
    if labels[start[::-1]] != labels[goal[::-1]]:
        yield Finding(True, where, f'no path leads from {start} to {goal}')
    elif start == goal:
        yield Finding(False, where, f'start and goal are both {start}')
    elif walls.clear([start], [goal])[0]:
        yield Finding(False, where, 'the straight line from start to goal is free')
    expected = query_sentence(barrier_map, sample.start, sample.goal)
    if sample.query and sample.query != expected:
        yield Finding(False, where, 'the query does not describe this map and pair')

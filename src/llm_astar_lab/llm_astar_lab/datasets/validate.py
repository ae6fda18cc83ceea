"""Validates a dataset: what makes it unusable, and what makes it a poor benchmark."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, Sample
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap, load_maps
from llm_astar_planner.lazy import ndimage
from llm_astar_planner.search.visibility import LineOfSightChecker
from numpy.typing import NDArray

from llm_astar_lab.datasets.generate import detour, query_sentence

# Samples of a map whose detour is measured, the first ones.
MEASURED_SAMPLES = 20


class DatasetProblem(NamedTuple):
    """A problem of a dataset: an `error` makes a sample unplannable, a note does not."""

    error: bool
    where: str
    message: str

    def __str__(self) -> str:
        """Return it as one line."""
        return f'{"error" if self.error else "note"}: {self.where}: {self.message}'


class DatasetSummary(NamedTuple):
    """The number of maps and samples, and the mean detour that the barriers of each map cause."""

    maps: int
    samples: int
    detours: tuple[float, ...]


def validate_file(path: str | Path) -> tuple[DatasetSummary, list[DatasetProblem]]:
    """Load a dataset file and validate every sample.

    Raises BarrierMapError, GridProblemError or MovingAiError, which name the file, the map and
    the field, where it is malformed.
    """
    maps = load_maps(path)
    return summarise_dataset(maps), list(validate_maps(maps))


def summarise_dataset(maps: Sequence[ProblemMap]) -> DatasetSummary:
    """Count maps and samples; measure the detours on maps without errors."""
    samples = sum(len(barrier_map.samples) for barrier_map in maps)
    solvable = [m for m in maps if m.samples and not any(p.error for p in validate_maps([m]))]
    measured = [replace(m, samples=m.samples[:MEASURED_SAMPLES]) for m in solvable]
    return DatasetSummary(len(maps), samples, tuple(detour(m) for m in measured))


def validate_maps(maps: Sequence[ProblemMap]) -> Iterator[DatasetProblem]:
    """Yield the problems of maps and of their samples."""
    for barrier_map in maps:
        where = f'map {barrier_map.id}'
        if not barrier_map.samples:
            yield DatasetProblem(False, where, 'has no samples')
        blocked = barrier_map.to_grid().blocked()
        # On grids a diagonal move needs both adjacent cells free, so these decide.
        neighbours = np.ones((3, 3)) if isinstance(barrier_map, BarrierMap) else None
        labels, _ = ndimage.label(~blocked, structure=neighbours)
        line_of_sight = LineOfSightChecker(blocked)
        seen: set[tuple[object, object]] = set()
        for pair, sample in enumerate(barrier_map.samples):
            name = f'{where}, pair {pair}'
            yield from validate_sample(name, barrier_map, sample, labels, line_of_sight)
            if sample[:2] in seen:
                yield DatasetProblem(False, name, 'repeats an earlier pair')
            seen.add(sample[:2])


def validate_sample(
    where: str,
    barrier_map: ProblemMap,
    sample: Sample,
    labels: NDArray[np.int32],
    line_of_sight: LineOfSightChecker,
) -> Iterator[DatasetProblem]:
    """Yield the problems of one sample.

    `labels` [height, width] numbers the connected free cells from 1; 0 is blocked.
    """
    start, goal = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
    for name, (x, y) in (('start', start), ('goal', goal)):
        if labels[y, x] == 0:
            message = f'{name} {(x, y)} lies on a barrier or on the outer wall'
            yield DatasetProblem(True, where, message)
            return
    if labels[start[::-1]] != labels[goal[::-1]]:
        yield DatasetProblem(True, where, f'no path leads from {start} to {goal}')
    elif start == goal:
        yield DatasetProblem(False, where, f'start and goal are both {start}')
    elif line_of_sight.clear([start], [goal])[0]:
        yield DatasetProblem(False, where, 'the straight line from start to goal is free')
    if (
        isinstance(barrier_map, BarrierMap)
        and sample.query
        and sample.query != query_sentence(barrier_map, sample.start, sample.goal)
    ):
        yield DatasetProblem(False, where, 'the query does not describe this map and pair')

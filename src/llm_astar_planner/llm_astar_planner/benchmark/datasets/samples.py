"""The samples of a dataset: loaded, selected, scaled."""

from __future__ import annotations

import json
import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from llm_astar_msgs_adapter.maps.barrier_map import (
    BarrierMap,
    Sample,
    load_barrier_maps,
    parse_barrier_map,
)
from llm_astar_msgs_adapter.maps.grid_dataset import (
    GridProblem,
    is_grid_problem,
    parse_grid_problem,
)

from llm_astar_planner.benchmark.datasets.grids import is_grid_dataset, load_grid_problem

# A map with its samples: barriers, as the paper's, or any grid.
ProblemMap = BarrierMap | GridProblem


class SelectionError(ValueError):
    """A selection of samples that cannot be made; the message names the option."""


@dataclass(frozen=True)
class BenchmarkSample:
    """One start-goal pair: its unscaled map (without its samples) and its index there."""

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

    `maps` selects map ids, such as `50-99` or `0-9,12`. `limit` draws so many of them by `seed`;
    a larger limit holds every sample of a smaller one. Raises what `load_maps` raises on a bad
    file and SelectionError on a selection that leaves nothing.
    """
    return select_samples(load_maps(path, limit, seed), str(path), maps, limit, seed)


def select_samples(
    loaded: Sequence[ProblemMap],
    path: str,
    maps: str | None = None,
    limit: int | None = None,
    seed: int = 0,
) -> list[BenchmarkSample]:
    """Select samples of loaded maps as `load_samples` does; `path` is for messages."""
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


def load_maps(path: str | Path, limit: int | None = None, seed: int = 0) -> list[ProblemMap]:
    """Load the maps of a dataset with their samples.

    Barrier-map JSON; MovingAI's `x.map.scen` beside its map; a map_server yaml, on which `limit`
    pairs (100) are drawn by `seed`. Raises BarrierMapError, GridProblemError, MovingAiError or
    MapServerError that names the file and the field.
    """
    if is_grid_dataset(path):
        return [load_grid_problem(path, limit, seed)]
    return list(load_barrier_maps(path))


def save_kept_maps(maps: Sequence[ProblemMap], path: str | Path) -> None:
    """Write the maps of a results folder, one a line. Raises OSError."""
    lines = ',\n'.join(json.dumps(item.to_json()) for item in maps)
    Path(path).write_text(f'[\n{lines}\n]\n', encoding='utf-8')


def load_kept_maps(path: str | Path) -> list[ProblemMap]:
    """Read the maps of a results folder back. Raises BarrierMapError or GridProblemError."""
    path = Path(path)
    try:
        entries = json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError):
        entries = None
    if not isinstance(entries, list):
        return list(load_barrier_maps(path))
    return [
        parse_grid_problem(entry, f'{path}: map at index {index}')
        if is_grid_problem(entry)
        else parse_barrier_map(entry, f'{path}: map at index {index}')
        for index, entry in enumerate(entries)
    ]


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


def _samples(maps: Iterable[ProblemMap]) -> Iterable[BenchmarkSample]:
    for barrier_map in maps:
        bare = replace(barrier_map, samples=())
        for pair, sample in enumerate(barrier_map.samples):
            yield BenchmarkSample(bare, pair, sample)


def _ids(ids: set[int]) -> str:
    shown = sorted(ids)
    return f'{shown[0]} to {shown[-1]}' if len(shown) > 1 else str(shown[0])

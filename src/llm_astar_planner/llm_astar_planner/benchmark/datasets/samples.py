"""Loads the maps of a dataset and selects samples."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr, shortened
from llm_astar_msgs_adapter.files import read_json
from llm_astar_msgs_adapter.maps.barrier_map import (
    BarrierMap,
    BarrierMapError,
    Sample,
    parse_barrier_map,
    parse_barrier_maps,
)
from llm_astar_msgs_adapter.maps.grid_dataset import (
    GridProblem,
    GridProblemError,
    cell_count,
    is_grid_problem,
    parse_grid_problem,
)
from llm_astar_msgs_adapter.maps.grid_map import MAX_CELLS

from llm_astar_planner.benchmark.datasets.grids import is_grid_dataset, load_grid_problem

# Numbers that ranges may name, and digits of each.
MAX_NUMBERS, MAX_DIGITS = 1_000_000, 15
# A map with its samples: barriers as in the paper, or a grid.
ProblemMap = BarrierMap | GridProblem


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


def load_maps(path: str | Path, limit: int | None = None, seed: int = 0) -> list[ProblemMap]:
    """Load the maps of a dataset with their samples.

    The file is barrier-map JSON, JSON of grids as `save_maps` writes it, MovingAI's `x.map.scen`
    in the folder of its map, or a map_server yaml, on which `limit` pairs (default 100) are drawn
    with `seed`. Raises BarrierMapError, GridProblemError, MovingAiError or MapServerError, which
    name the file and the field.
    """
    if is_grid_dataset(path):
        return [load_grid_problem(path, limit, seed)]
    entries = read_json(path, BarrierMapError)
    if isinstance(entries, list) and any(map(is_grid_problem, entries)):
        return parse_maps(entries, path)
    return list(parse_barrier_maps(entries, path))


def save_maps(maps: Sequence[ProblemMap], path: str | Path) -> None:
    """Write maps with their samples as JSON that `load_maps` reads. Raises OSError."""
    Path(path).write_text(format_kept_maps(maps), encoding='utf-8')


def format_kept_maps(maps: Sequence[ProblemMap]) -> str:
    """Return maps as JSON for a results folder, one per line."""
    lines = ',\n'.join(json.dumps(item.to_json()) for item in maps)
    return f'[\n{lines}\n]\n'


def load_kept_maps(path: str | Path) -> list[ProblemMap]:
    """Read the maps of a results folder. Raises BarrierMapError or GridProblemError."""
    entries = read_json(path, BarrierMapError)
    if not isinstance(entries, list):
        raise BarrierMapError(f'{path}: a JSON list of maps is expected')
    return parse_maps(entries, path)


def parse_maps(entries: Sequence[Any], path: str | Path) -> list[ProblemMap]:
    """Read barrier maps and grids of a file; raises as `load_kept_maps` does."""
    cells = 0
    for index, entry in enumerate(entries):
        if is_grid_problem(entry):
            cells += cell_count(entry, f'{path}: map at index {index}')
        if cells > MAX_CELLS:
            raise GridProblemError(f'{path}: its maps have over {MAX_CELLS} cells')
    maps: dict[int, ProblemMap] = {}
    for index, entry in enumerate(entries):
        where = f'{path}: map at index {index}'
        parse = parse_grid_problem if is_grid_problem(entry) else parse_barrier_map
        parsed = parse(entry, where)
        if parsed.id in maps:
            raise GridProblemError(f'{where}: id: {parsed.id} is used twice')
        maps[parsed.id] = parsed
    return list(maps.values())


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

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Datasets by name, MovingAI's sets and generated families; selects their samples.

MovingAI's maps and scenarios are read from a folder that the user has: the archives of
https://movingai.com/benchmarks/grids.html unpack as `dao-map/x.map` and `dao-scen/x.map.scen`,
which may lie side by side, in folders named by their set, or in one.
"""

import hashlib
import json
import os
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from llm_astar_msgs_adapter.errors import LlmAstarError, nearest_name, short_repr, shortened
from llm_astar_msgs_adapter.maps.barrier_map import Sample
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem, GridProblemError
from llm_astar_msgs_adapter.maps.grid_map import MAX_CELLS
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap, load_maps, load_scenario_problem
from llm_astar_planner.costmap.config import CostmapConfig

from llm_astar_lab.datasets import generate as drawing
from llm_astar_lab.datasets.generate import GenerationError, MapRules, generate

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
            raise SelectionError(f'--map-ids {maps}: {path} has none of them, its ids are {ids}')
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


# The sets by their names on the site: Baldur's Gate II (scaled to 512 x 512, and as they are),
# Dragon Age 2 and Origins, mazes, random cells, rooms, StarCraft, streets and Warcraft III.
SETS = (
    'bg512', 'bgmaps', 'da2', 'dao', 'maze', 'random', 'room', 'sc1', 'street', 'wc3maps512',
)  # fmt: skip
PREFIX = 'movingai/'
SCENARIO_END = '.map.scen'
# Files and folders that are looked at below the user's folder.
MAX_ENTRIES = 20_000
BARRIERS = 'barriers'
GENERATED = (BARRIERS, *drawing.FAMILIES)
READ = tuple(f'{PREFIX}{name}' for name in SETS)
NAMES = (*GENERATED, *READ)
DEFAULT_MAPS, DEFAULT_PAIRS = 100, 10
# Pairs of a map, and samples of a family.
MAX_PAIRS, MAX_SAMPLES = 1000, 1_000_000


@dataclass(frozen=True)
class DrawRules:
    """How many maps of a generated family are drawn, with how many pairs each, by which seed.

    `size` are the largest coordinates of maps of barriers.
    """

    seed: int = 0
    maps: int = DEFAULT_MAPS
    pairs: int = DEFAULT_PAIRS
    size: tuple[int, int] = MapRules.size


@dataclass(frozen=True)
class Dataset:
    """The maps of a run.

    `names` are the datasets, empty for a file of the user's. `file` is set where the maps are
    those of one file.
    """

    names: tuple[str, ...]
    maps: list[ProblemMap]
    file: Path | None = None

    def __str__(self) -> str:
        """Return the file or the names, for messages."""
        return ', '.join(self.names) if self.file is None else str(self.file)

    @property
    def identity(self) -> dict[str, str] | None:
        """Names and digest for a run's metadata; None for a file, whose digest is the file's."""
        if self.file is not None:
            return None
        digest = hashlib.sha256()
        for item in self.maps:
            grid = item.digest if isinstance(item, GridProblem) else json.dumps(item.to_json())
            digest.update(f'{grid}\n'.encode())
        return {'file': ', '.join(self.names), 'sha256': digest.hexdigest()}


def parse_names(text: str) -> tuple[str, ...]:
    """Return the names of datasets in a text, separated by commas.

    Raises SelectionError for another, which lists the names.
    """
    parts = tuple(dict.fromkeys(part.strip() for part in text.split(',')))
    for unknown in (part for part in parts if part not in NAMES):
        known = f'{nearest_name(unknown, NAMES) or ";"} there are {", ".join(NAMES)}'
        file = '; a file is given with --map' if Path(unknown).suffix else ''
        raise SelectionError(f'--dataset: {short_repr(unknown)} is unknown{known}{file}')
    return parts


def load_named(names: Sequence[str], path: Path | None, rules: DrawRules) -> Dataset:
    """Read or draw datasets; the maps of several are numbered from 0 in this order.

    `path` is the folder of those that are read. Raises SelectionError, GenerationError,
    and what reading the files raises.
    """
    maps = [item for name in names for item in load_one(name, path, rules)]
    if len(names) > 1:
        maps = [replace(item, id=number) for number, item in enumerate(maps)]
    return Dataset(tuple(names), maps)


def load_one(name: str, path: Path | None, rules: DrawRules) -> Sequence[ProblemMap]:
    """Return the maps of one dataset, read or drawn. Raises as `load_named` does."""
    if name in GENERATED:
        return draw_family(name, rules)
    if path is None:
        what = "the folder of the set's maps and scenarios"
        raise SelectionError(f'--dataset {name} needs --path, {what}: nothing is downloaded')
    return list(load_set(name.removeprefix(PREFIX), path))


def draw_family(name: str, rules: DrawRules, scale: int = 1) -> list[ProblemMap]:
    """Draw the maps of a generated family at a scale. Raises GenerationError."""
    check_size(name, rules, scale)
    if name == BARRIERS:
        drawn = generate(rules.seed, rules.maps, MapRules(size=rules.size, pairs=rules.pairs))
        return [replace(item.scale(scale), family=BARRIERS) for item in drawn]
    if rules.seed < 0:
        raise GenerationError('--seed: the minimum is 0')
    grids = drawing.generate_family(name, rules.seed, rules.maps, rules.pairs)
    return [item.scale(scale) for item in grids]


def check_size(name: str, rules: DrawRules, scale: int) -> None:
    """Raise GenerationError where a family would have no map, or too much of something."""
    if min(rules.maps, rules.pairs, scale) < 1:
        raise GenerationError('--maps, --pairs and --scale: the minimum is 1')
    width, height = rules.size if name == BARRIERS else (drawing.DEFAULT_SIDE,) * 2
    if rules.maps * width * height * scale**2 > MAX_CELLS:
        what = f'at scale {scale} they have over {MAX_CELLS} cells'
        raise GenerationError(f'--maps {rules.maps}: {what}; choose fewer')
    if rules.pairs > MAX_PAIRS or rules.maps * rules.pairs > MAX_SAMPLES:
        what = f'over {MAX_PAIRS} pairs of a map or {MAX_SAMPLES} samples'
        raise GenerationError(f'--maps, --pairs: {what}')


def load_set(name: str, folder: Path) -> Iterator[GridProblem]:
    """Yield the maps of a set in the order of their names, with ids from 0.

    Their samples are the rows of their scenarios. Raises GridProblemError or MovingAiError, which
    name the folder or the file.
    """
    files = sorted(files_of_set(name, folder), key=lambda path: path.name)
    maps = {key: list(named) for key, named in groupby(files, key=lambda path: path.name)}
    scenarios = [path for path in files if path.name.endswith(SCENARIO_END)]
    if not scenarios:
        raise GridProblemError(f'{folder}: has no scenarios of {name}, files x.map.scen')
    for key in (path.name for path in scenarios if len(maps[path.name]) > 1):
        raise GridProblemError(f'{folder}: has several files {key}; remove all but one')
    cells = 0
    for map_id, path in enumerate(scenarios):
        map_path = find_map_file(path, maps.get(path.name.removesuffix('.scen'), []), folder)
        problem = load_scenario_problem(path, map_path, map_id, f'{PREFIX}{name}')
        cells += problem.grid_map.cells.size
        if cells > MAX_CELLS:
            raise GridProblemError(f'{folder}: the maps of {name} have over {MAX_CELLS} cells')
        yield problem


def files_of_set(name: str, folder: Path) -> list[Path]:
    """Return the files of a set: those in folders of its name, else all, if none is of another.

    Raises GridProblemError.
    """
    if not folder.is_dir():
        raise GridProblemError(f'--path {folder}: is not a folder')
    files = list(walk(folder))
    sets = {path: set_of(path.relative_to(folder.parent)) for path in files}
    own = [path for path in files if sets[path] == name]
    if not own and (others := ', '.join(sorted(filter(None, {*sets.values()})))):
        raise GridProblemError(f'{folder}: has no folder of {name}, but of {others}')
    return own or files


def set_of(path: Path) -> str | None:
    """Return the set that a folder of the path is named by, such as `dao` of `dao-map/x.map`."""
    names = (part.partition('-')[0].lower() for part in reversed(path.parts[:-1]))
    return next((name for name in names if name in SETS), None)


def walk(folder: Path) -> Iterator[Path]:
    """Yield the maps and scenarios below a folder. Raises GridProblemError if it is too large."""
    entries, seen = 0, set[str]()
    for place, folders, names in os.walk(folder, followlinks=True):
        real = os.path.realpath(place)
        if real in seen:  # by a link, perhaps one that leads back
            folders.clear()
            continue
        seen.add(real)
        entries += len(folders) + len(names)
        if entries > MAX_ENTRIES:
            what = f'has over {MAX_ENTRIES} files'
            raise GridProblemError(f'{folder}: {what}; name a smaller folder')
        endings = ('.map', SCENARIO_END)
        yield from (Path(place, name) for name in names if name.endswith(endings))


def find_map_file(scenarios: Path, maps: list[Path], folder: Path) -> Path:
    """Return the map of a scenario file: the one beside it, else the only one of its name.

    Raises GridProblemError.
    """
    beside = scenarios.with_name(scenarios.name.removesuffix('.scen'))
    if beside in maps:
        return beside
    if len(maps) != 1:
        found = 'several of them are' if maps else 'it is not'
        raise GridProblemError(f'{scenarios}: map: {found} in {folder}: {beside.name}')
    return maps[0]

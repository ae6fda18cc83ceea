"""Datasets by name: the paper's, MovingAI's sets, and generated families."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from llm_astar_msgs_adapter.errors import short_repr
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import MAX_CELLS
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.parameter import nearest_name

from llm_astar_lab.datasets import families, movingai_sets
from llm_astar_lab.datasets.generate import GenerationError, MapRules, generate
from llm_astar_lab.datasets.samples import SelectionError

PAPER, BARRIERS = 'paper', 'barriers'
# The file that the paper's code publishes.
PAPER_FILE = 'environment_50_30.json'
GENERATED = (BARRIERS, *families.FAMILIES)
READ = (PAPER, *(f'{movingai_sets.PREFIX}{name}' for name in movingai_sets.SETS))
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
    those of one file. `map_names` are the names of MovingAI's maps by id.
    """

    names: tuple[str, ...]
    maps: list[ProblemMap]
    file: Path | None = None
    map_names: Mapping[int, str] = field(default_factory=dict)

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
        near = nearest_name(unknown, NAMES) or ';'
        file = '; a file is given with --map' if Path(unknown).suffix else ''
        raise SelectionError(
            f'--dataset: {short_repr(unknown)} is unknown{near} there are {", ".join(NAMES)}{file}'
        )
    return parts


def load_named(names: Sequence[str], path: Path | None, rules: DrawRules) -> Dataset:
    """Read or draw datasets; the maps of several are numbered from 0 in this order.

    `path` is the file or folder of those that are read. Raises SelectionError, GenerationError,
    and what reading the files raises.
    """
    maps: list[ProblemMap] = []
    map_names: dict[int, str] = {}
    for name in names:
        for map_name, item in load_one(name, path, rules):
            number = len(maps) if len(names) > 1 else item.id
            map_names |= {number: map_name} if map_name else {}
            maps.append(replace(item, id=number))
    file = paper_file(path) if path is not None and tuple(names) == (PAPER,) else None
    return Dataset(tuple(names), maps, file, map_names)


def load_one(name: str, path: Path | None, rules: DrawRules) -> list[tuple[str, ProblemMap]]:
    """Read or draw one dataset; return its maps, each with its name, '' where it has none.

    Raises as `load_named` does.
    """
    if name in GENERATED:
        return [('', item) for item in draw_family(name, rules)]
    if path is None:
        what = PAPER_FILE if name == PAPER else "the set's maps and scenarios"
        raise SelectionError(f'--dataset {name} needs --path, with {what}: nothing is downloaded')
    if name == PAPER:
        maps = load_barrier_maps(paper_file(path))
        return [('', replace(item, family=PAPER)) for item in maps]
    return list(movingai_sets.load_set(name.removeprefix(movingai_sets.PREFIX), path))


def paper_file(path: Path) -> Path:
    """Return the file of the paper's dataset: the path, or the file in this folder."""
    return path / PAPER_FILE if path.is_dir() else path


def draw_family(name: str, rules: DrawRules, scale: int = 1) -> list[ProblemMap]:
    """Draw the maps of a generated family at a scale. Raises GenerationError."""
    check_size(name, rules, scale)
    if name == BARRIERS:
        drawn = generate(rules.seed, rules.maps, MapRules(size=rules.size, pairs=rules.pairs))
        return [replace(item.scale(scale), family=BARRIERS) for item in drawn]
    if rules.seed < 0:
        raise GenerationError('--seed: the minimum is 0')
    grids = families.generate_family(name, rules.seed, rules.maps, rules.pairs)
    return [item.scale(scale) for item in grids]


def check_size(name: str, rules: DrawRules, scale: int) -> None:
    """Raise GenerationError where a family would have no map, or too much of something."""
    if min(rules.maps, rules.pairs, scale) < 1:
        raise GenerationError('--maps, --pairs and --scale: the minimum is 1')
    width, height = rules.size if name == BARRIERS else (families.DEFAULT_SIDE,) * 2
    if rules.maps * width * height * scale**2 > MAX_CELLS:
        raise GenerationError(
            f'--maps {rules.maps}: at scale {scale} they have over {MAX_CELLS} cells; choose fewer'
        )
    if rules.pairs > MAX_PAIRS or rules.maps * rules.pairs > MAX_SAMPLES:
        raise GenerationError(
            f'--maps, --pairs: over {MAX_PAIRS} pairs of a map or {MAX_SAMPLES} samples'
        )

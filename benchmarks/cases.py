"""The maps and queries that planners are timed on: files, and families drawn from a seed.

A case is saved to a file as it is made, so that planners in other processes get the same one.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps import map_server
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_msgs_adapter.maps.movingai import load_map, load_scenarios
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.result import Cell
from numpy.typing import NDArray
from scipy import ndimage

from benchmarks import map_families

# Metres a cell, as on most robots' maps.
RESOLUTION = 0.05
UNIFORM = CostmapConfig()
# Graded costs as Nav2's inflation makes them, with its default radius and a common decay.
GRADED = CostmapConfig(inflation_radius=0.55, cost_scaling_factor=3.0)
# Networkx and other slow planners take part in cases with so many cells.
SMALL_CELLS = 20_000
SEED = 13
# Family, cells a side and queries of each generated map.
GENERATED = (
    ('rooms', 512, 20),
    ('random 40 %', 512, 20),
    ('maze', 512, 20),
    ('city', 1024, 20),
    ('warehouse', 1024, 20),
    ('city', 4096, 4),
    ('boxes', 4096, 4),
    ('boxes', 8192, 3),
)
# The maps that are also timed with graded costs.
ALSO_GRADED = frozenset(
    {
        'barriers 51x31',
        'bg512__AR0011SR',
        'depot',
        'rooms 512',
        'city 1024',
        'warehouse 1024',
        'boxes 4096',
    }
)

Query = tuple[Cell, Cell]


@dataclass(frozen=True, eq=False)
class Problem:
    """Queries on one map: `blocked` bool [height, width] and (start, goal) pairs.

    `published` holds the optimal lengths in cells that came with the queries, if any. With
    `graded` the cells near obstacles cost more.
    """

    blocked: NDArray[np.bool_]
    queries: tuple[Query, ...]
    published: tuple[float, ...] = ()
    graded: bool = False

    @cached_property
    def grid_map(self) -> GridMap:
        """The map as an occupancy grid."""
        cells = np.where(self.blocked, OCCUPIED, FREE).astype(np.int8)
        return GridMap(cells, RESOLUTION)

    @property
    def config(self) -> CostmapConfig:
        """The rules of the map."""
        return GRADED if self.graded else UNIFORM

    @cached_property
    def costmap(self) -> Costmap:
        """The map under its rules."""
        return Costmap(self.grid_map, self.config)

    @cached_property
    def grid(self) -> GridGraph:
        """The cells and moves by which paths are judged."""
        return self.costmap.grid_graph

    @cached_property
    def weights(self) -> NDArray[np.float32]:
        """What a move into a cell costs per cell of length, 1 or more; inf where blocked."""
        share = np.float32(self.config.cost_travel_multiplier / 100)
        cost = np.maximum(self.costmap.cost, 0) if self.graded else np.float32(0.0)
        weights: NDArray[np.float32] = np.where(self.blocked, np.float32(np.inf), 1 + share * cost)
        return weights.astype(np.float32, copy=False)


@dataclass(frozen=True, eq=False)
class SpeedCase:
    """A named set of problems that are timed together, with uniform or graded costs."""

    name: str
    problems: tuple[Problem, ...]

    @property
    def cells(self) -> int:
        """Cells of the largest map."""
        return max(problem.blocked.size for problem in self.problems)

    @property
    def graded(self) -> bool:
        """Whether costs are graded."""
        return self.problems[0].graded

    def save(self, path: Path) -> None:
        """Write the case to an .npz file."""
        arrays: dict[str, Any] = {'graded': np.array([self.graded])}
        for index, problem in enumerate(self.problems):
            arrays[f'blocked {index}'] = problem.blocked
            arrays[f'queries {index}'] = np.array(problem.queries)
            arrays[f'published {index}'] = np.array(problem.published)
        with path.open('wb') as file:
            np.savez_compressed(file, **arrays)

    @classmethod
    def load(cls, path: Path) -> SpeedCase:
        """Read a case that was saved; its name is that of the file."""
        problems = []
        with np.load(path) as arrays:
            graded = bool(arrays['graded'][0])
            for index in range(len(arrays.files) // 3):
                queries = tuple(
                    ((int(x), int(y)), (int(to_x), int(to_y)))
                    for (x, y), (to_x, to_y) in arrays[f'queries {index}']
                )
                published = tuple(arrays[f'published {index}'].tolist())
                blocked = arrays[f'blocked {index}']
                problems.append(Problem(blocked, queries, published, graded))
        return cls(path.stem, tuple(problems))


# Makes a case; it may take seconds.
MakeCase = Callable[[], SpeedCase]


def barrier_case(path: Path) -> SpeedCase:
    """Return the samples of a barrier-map dataset, rasterised, without corner cutting."""
    problems = []
    for barrier_map in load_barrier_maps(path):
        queries = tuple(
            (barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal))
            for sample in barrier_map.samples
        )
        problems.append(Problem(barrier_map.to_grid().blocked(), queries))
    return SpeedCase('barriers 51x31', tuple(problems))


def scenario_cases(folder: str | Path) -> list[SpeedCase]:
    """Return one case per map of `scenarios.csv`, which is in `folder` with its MovingAI maps."""
    rows: dict[str, list[tuple[Query, float]]] = {}
    with (Path(folder) / 'scenarios.csv').open(encoding='utf-8') as file:
        for row in csv.DictReader(file):
            start = int(row['start_x']), int(row['start_y'])
            goal = int(row['goal_x']), int(row['goal_y'])
            length = float(row['optimal_length'])
            rows.setdefault(row['map'], []).append(((start, goal), length))
    cases = []
    for name, pairs in rows.items():
        queries, published = zip(*pairs)
        blocked = load_map(Path(folder) / f'{name}.map').blocked()
        cases.append(SpeedCase(name, (Problem(blocked, queries, published),)))
    return cases


def movingai_case(path: Path, queries: int = 20) -> SpeedCase:
    """Return a MovingAI map with scenarios spread evenly over `PATH.scen`, easy ones to hard."""
    scenarios = load_scenarios(path.with_name(f'{path.name}.scen'))
    kept = np.linspace(0, len(scenarios) - 1, queries + 1).round().astype(int)[1:]
    pairs = tuple((scenarios[index].start, scenarios[index].goal) for index in kept)
    published = tuple(scenarios[index].optimal_length for index in kept)
    return SpeedCase(path.stem, (Problem(load_map(path).blocked(), pairs, published),))


def depot_case(folder: Path, queries: int = 20) -> SpeedCase:
    """Return Nav2's depot, 604 x 307, with random queries; unknown cells are blocked."""
    blocked = map_server.load_map(folder / 'depot.yaml').blocked(allow_unknown=False)
    return drawn_case('depot', blocked, queries, seed=SEED)


def drawn_case(
    name: str, blocked: NDArray[np.bool_], queries: int, *, seed: int = SEED
) -> SpeedCase:
    """Return random queries on a map, in its largest connected area and an eighth of it apart."""
    labels, _ = ndimage.label(~blocked)
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    free = np.flatnonzero(labels == sizes.argmax())
    random, width = np.random.default_rng(seed), blocked.shape[1]
    pairs: list[Query] = []
    while len(pairs) < queries:
        first, last = random.choice(free, 2).tolist()
        (y, x), (to_y, to_x) = divmod(first, width), divmod(last, width)
        if max(abs(x - to_x), abs(y - to_y)) >= max(blocked.shape) // 8:
            pairs.append(((x, y), (to_x, to_y)))
    return SpeedCase(name, (Problem(blocked, tuple(pairs)),))


def graded_case(make: MakeCase) -> SpeedCase:
    """Return a case with the costs that inflation makes."""
    case = make()
    problems = tuple(
        Problem(problem.blocked, problem.queries, graded=True) for problem in case.problems
    )
    return SpeedCase(f'{case.name} graded', problems)


def generated_case(family: str, size: int, queries: int, *, seed: int = SEED) -> SpeedCase:
    """Return a map of a family of `map_families.FAMILIES`, and random queries on it."""
    blocked = map_families.FAMILIES[family](size, np.random.default_rng(seed))
    name = f'{family} {size}' + ('' if seed == SEED else f' seed {seed}')
    return drawn_case(name, blocked, queries, seed=seed)


def all_cases(
    reference: Path | None, maps: Path | None, largest: int
) -> Iterator[tuple[str, MakeCase]]:
    """Yield the name of each case and a function that makes it, small maps first.

    `reference` is a folder of reference figures, `maps` one of MovingAI's .map and .map.scen
    files. Generated maps have sides up to `largest` cells.
    """
    makers: dict[str, MakeCase] = {}
    if reference is not None:
        barriers = next(reference.glob('barrier_maps*.json'))
        makers['barriers 51x31'] = partial(barrier_case, barriers)
        for case in [*scenario_cases(reference / 'grids'), depot_case(reference / 'grids')]:
            makers[case.name] = partial(copy, case)
    for path in sorted(maps.glob('*.map')) if maps is not None else ():
        makers[path.stem] = partial(movingai_case, path)
    for family, size, queries in GENERATED:
        if size <= largest:
            makers[f'{family} {size}'] = partial(generated_case, family, size, queries)
    for name, make in makers.items():
        yield name, make
        if name in ALSO_GRADED:
            yield f'{name} graded', partial(graded_case, make)

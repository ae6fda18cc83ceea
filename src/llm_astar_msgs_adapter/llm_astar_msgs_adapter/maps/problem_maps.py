# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Loads maps with start-goal pairs: barrier maps, MovingAI's `.map.scen`, map_server's yaml."""

import json
import math
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from llm_astar_msgs_adapter.files import naming, read_json
from llm_astar_msgs_adapter.maps import barrier_map, grid_dataset, map_server, movingai
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, BarrierMapError, Sample
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem, GridProblemError, is_grid_problem
from llm_astar_msgs_adapter.maps.grid_map import MAX_CELLS, GridMap

SCENARIOS, YAML, BARE_MAP = ('.scen',), ('.yaml', '.yml'), ('.map',)
# Pairs drawn on a map that has none, unless a limit is given.
DEFAULT_PAIRS = 100
# A map with its samples: barriers as in the paper, or a grid.
ProblemMap = BarrierMap | GridProblem


def load_maps(path: str | Path, limit: int | None = None, seed: int = 0) -> list[ProblemMap]:
    """Load the maps of a dataset with their samples.

    The file is barrier-map JSON, JSON of grids as `save_maps` writes it, MovingAI's `x.map.scen`
    in the folder of its map, or a map_server yaml, on which `limit` pairs (default 100) are drawn
    with `seed`. Raises BarrierMapError, GridProblemError, MovingAiError or MapServerError, which
    name the file and the field.
    """
    if Path(path).suffix.lower() in (*SCENARIOS, *YAML, *BARE_MAP):
        return [load_grid_problem(path, limit, seed)]
    entries = read_json(path, BarrierMapError)
    if isinstance(entries, list) and any(map(is_grid_problem, entries)):
        return parse_maps(entries, path)
    return list(barrier_map.parse_barrier_maps(entries, path))


def save_maps(maps: Sequence[ProblemMap], path: str | Path) -> None:
    """Write maps with their samples as JSON that `load_maps` reads. Raises OSError."""
    with naming(path):
        Path(path).write_text(format_kept_maps(maps), encoding='utf-8')


def format_kept_maps(maps: Sequence[ProblemMap]) -> str:
    """Return maps as JSON for a results folder, one per line."""
    lines = ',\n'.join(json.dumps(item.to_json()) for item in maps)
    return f'[\n{lines}\n]\n'


def load_kept_maps(path: str | Path) -> list[ProblemMap]:
    """Read the maps of a results folder. Raises BarrierMapError or GridProblemError."""
    entries = read_json(path, BarrierMapError)
    if isinstance(entries, list):
        return parse_maps(entries, path)
    raise BarrierMapError(f'{path}: a JSON list of maps is expected')


def parse_maps(entries: Sequence[Any], path: str | Path) -> list[ProblemMap]:
    """Read barrier maps and grids of a file; raises as `load_kept_maps` does."""
    cells = 0
    for index, entry in enumerate(entries):
        if is_grid_problem(entry):
            cells += grid_dataset.cell_count(entry, f'{path}: map at index {index}')
        if cells > MAX_CELLS:
            raise GridProblemError(f'{path}: its maps have over {MAX_CELLS} cells')

    def parse(entry: Any, where: str) -> ProblemMap:  # noqa: ANN401 - any JSON value
        if is_grid_problem(entry):
            return grid_dataset.parse_grid_problem(entry, where)
        return barrier_map.parse_barrier_map(entry, where)

    return barrier_map.parse_each(entries, path, parse)


def load_grid_problem(path: str | Path, pairs: int | None = None, seed: int = 0) -> GridProblem:
    """Load a grid dataset as one map with id 0.

    The samples of a `.scen` file are its rows in order. On a map_server yaml `pairs` samples
    (default 100) are drawn with `seed`. Raises GridProblemError, MovingAiError or MapServerError,
    which name the file and the field.
    """
    path, suffix = Path(path), Path(path).suffix.lower()
    if suffix in YAML:
        grid_map = map_server.load_map(path)
        count = DEFAULT_PAIRS if pairs is None else pairs
        drawn = draw_pairs(grid_map, count, seed) if count else ()
        if count and not drawn:
            raise GridProblemError(f'{path}: no two of its free cells are connected')
        return GridProblem(0, grid_map, drawn)
    if suffix in BARE_MAP:
        problem = f'a map has no start-goal pairs; name its scenario file, {path}.scen'
        raise GridProblemError(f'{path}: {problem}')
    return load_scenario_problem(path, movingai.map_of(path))


def load_scenario_problem(
    path: Path, map_path: Path, map_id: int = 0, family: str = ''
) -> GridProblem:
    """Load a `.scen` file with its map. Raises GridProblemError or MovingAiError."""
    grid_map = movingai.load_map(map_path)
    scenarios = movingai.load_scenarios(path)
    size, blocked = (grid_map.width, grid_map.height), grid_map.blocked()
    for row, scenario in enumerate(scenarios):
        where, wanted = f'{path}: row {row}', (scenario.width, scenario.height)
        if size != wanted:
            cells = f'{size[0]} x {size[1]} cells, not {wanted[0]} x {wanted[1]}'
            raise GridProblemError(f'{where}: width, height: the map has {cells}')
        for name, (x, y) in (('start', scenario.start), ('goal', scenario.goal)):
            if blocked[y, x]:
                raise GridProblemError(f'{where}: {name}: ({x}, {y}) is blocked')
    samples = tuple(Sample(scenario.start, scenario.goal) for scenario in scenarios)
    # Some published files have the length 0 for pairs without a path, or for all of them.
    lengths = tuple(
        scenario.optimal_length if scenario.optimal_length or start == goal else math.nan
        for scenario, (start, goal, _) in zip(scenarios, samples)
    )
    return GridProblem(map_id, grid_map, samples, lengths, family)


def draw_pairs(grid_map: GridMap, count: int, seed: int) -> tuple[Sample, ...]:
    """Draw start-goal pairs: different known free cells that known free cells connect.

    The start is uniform over all such cells, the goal over the others connected with it. A larger
    count begins with the pairs of a smaller one. Empty where no two cells are connected.
    """
    from scipy import ndimage  # noqa: PLC0415 - a fifth of a second that most maps do not need

    free = ~grid_map.blocked(allow_unknown=False)
    labels = ndimage.label(free)[0].ravel()
    sizes = np.bincount(labels)
    starts = np.flatnonzero(free.ravel() & (sizes[labels] > 1))
    if not len(starts):
        return ()
    # The cells sorted by region; `ends` is where each region ends.
    cells, ends = np.argsort(labels, kind='stable'), np.cumsum(sizes)
    draw = random.Random(seed)  # noqa: S311 - no secret
    samples = []
    for _ in range(count):
        start = goal = int(starts[draw.randrange(len(starts))])
        label = labels[start]
        while goal == start:
            goal = int(cells[draw.randrange(int(ends[label - 1]), int(ends[label]))])
        (y, x), (goal_y, goal_x) = divmod(start, grid_map.width), divmod(goal, grid_map.width)
        samples.append(Sample((x, y), (goal_x, goal_y)))
    return tuple(samples)

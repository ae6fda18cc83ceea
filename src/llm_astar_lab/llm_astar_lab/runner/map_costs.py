# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a map costs before its queries, as in the Grid-Based Path Planning Competition (GPPC).

The competition reports the time for preprocessing a map, the memory that its planner holds and
the times of the queries, each by itself.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Iterable, Iterator, Mapping
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.methods import GUIDED

from llm_astar_lab.analysis.statistics import spread
from llm_astar_lab.datasets.named import GRID_CONFIG
from llm_astar_lab.results.stored_rows import StoredRows
from llm_astar_lab.runner.engine import compile_once

# What a planner shares with everything else, and what leads there.
SHARED = (type, ModuleType, FunctionType, str, bytes)


def map_costs(
    problems: Iterable[GridProblem], names: Mapping[int, str]
) -> Iterator[dict[str, Any]]:
    """Measure each map; yield its id, name, family, size, seconds of preprocessing and bytes.

    The bytes are those of all arrays that the planner holds after a query, without the map's own.
    """
    compile_once()
    for problem in problems:
        begun = time.perf_counter()
        planner = Planner(problem.grid_map, GRID_CONFIG).prepare()
        seconds = time.perf_counter() - begun
        start, goal, _ = problem.samples[0]
        planner.plan(PlanRequest(start, goal, GUIDED))
        yield {
            'map': problem.id, 'name': names.get(problem.id, ''), 'family': problem.family,
            'width': problem.grid_map.width, 'height': problem.grid_map.height, 'seconds': seconds,
            'bytes': held_bytes(planner) - problem.grid_map.cells.nbytes,
        }  # fmt: skip


def held_bytes(root: object) -> int:
    """Return the bytes of all arrays that an object leads to, each counted once."""
    seen: set[int] = set()
    left, total = [root], 0
    while left:
        item = left.pop()
        if id(item) in seen or isinstance(item, SHARED):
            continue
        seen.add(id(item))
        if isinstance(item, np.ndarray):
            # A view holds all of the array that it is of.
            left += [] if item.base is None else [item.base]
            total += item.nbytes if item.base is None else 0
        else:
            left += gc.get_referents(item)
    return total


def add_query_times(costs: Iterable[dict[str, Any]], rows: StoredRows) -> None:
    """Add to each map's costs the seconds of its queries by variant, at scale 1."""
    by_map = {cost['map']: cost.setdefault('queries', {}) for cost in costs}
    for variant in rows.variants('scale = 1'):
        found = rows.arrays('seconds', *variant)
        for number, queries in by_map.items():
            chosen = found['seconds_search'][found['map'] == number]
            if len(chosen):
                queries[str(variant)] = {'count': len(chosen), **spread(chosen)._asdict()}

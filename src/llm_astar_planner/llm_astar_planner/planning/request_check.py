"""What about a request no map could make good."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from llm_astar_planner.planning.parameters import PLANNER
from llm_astar_planner.planning.types import PlanRequest

MAX_VIA = 64
# The fields of a request that have the names and limits of parameters.
CHECKED = ('method', 'heuristic', 'max_suboptimality', 'weight', 'tolerance', 'start_tolerance')
# A request says None where a parameter says 0.
TABLE = {item.name: replace(item, zero='') for item in PLANNER if item.name in CHECKED}


def request_problem(request: PlanRequest) -> str:
    """Say what is wrong with the names and numbers of a request and what would do, or ''."""
    return next(_problems(request), '')


def _problems(request: PlanRequest) -> Iterator[str]:
    for name, entry in TABLE.items():
        value = getattr(request, name)
        problem = None if value is None else entry.problem(value)
        if problem:
            yield problem
    for name in ('time_limit', 'source_time_limit'):
        if math.isnan(getattr(request, name)):
            yield f'{name} is not a number of seconds'
    if len(request.via) > MAX_VIA:
        yield f'{len(request.via)} via points, over the {MAX_VIA} that are planned through'

"""What about a request no map could make good."""

from __future__ import annotations

import math
from collections.abc import Iterator

from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.paper import HEURISTICS, METHODS

MAX_BOUND = 1000.0
MAX_WEIGHT = 1000.0
MAX_TOLERANCE = 1000.0  # metres
MAX_VIA = 64


def request_problem(request: PlanRequest) -> str:
    """Say what is wrong with the names and numbers of a request and what would do, or ''."""
    return next(_problems(request), '')


def _problems(request: PlanRequest) -> Iterator[str]:
    if request.method not in METHODS:
        yield f'no method {request.method!r}; there is {", ".join(METHODS)}'
    if request.heuristic not in HEURISTICS:
        yield f'no heuristic {request.heuristic!r}; there is {", ".join(HEURISTICS)}'
    bound = request.max_suboptimality
    if bound is not None and not 1.0 <= bound <= MAX_BOUND:
        yield f'max_suboptimality {bound} is not in 1 to {MAX_BOUND:g}'
    if not 1.0 <= request.weight <= MAX_WEIGHT:
        yield f'weight {request.weight} is not in 1 to {MAX_WEIGHT:g}'
    for name in ('time_limit', 'source_time_limit'):
        if math.isnan(getattr(request, name)):
            yield f'{name} is not a number of seconds'
    for name in ('tolerance', 'start_tolerance'):
        if not 0.0 <= getattr(request, name) <= MAX_TOLERANCE:
            yield f'{name} {getattr(request, name)} is not in 0 to {MAX_TOLERANCE:g} metres'
    if len(request.via) > MAX_VIA:
        yield f'{len(request.via)} via points, over the {MAX_VIA} that are planned through'

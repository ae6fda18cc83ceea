"""A waypoint source and a search method of another package, to start your own from.

docs/plugins.md says what each of them gets and returns.
"""

import heapq
import math
import time

import numpy as np
from llm_astar_planner.search.problem import SearchProblem, search_method
from llm_astar_planner.search.result import SearchResult, SearchStatus
from llm_astar_planner.waypoints.config import SourceContext
from llm_astar_planner.waypoints.source import WaypointQuery, WaypointReply


class Sidestep:
    """Answers with the free cell nearest to the middle, on the line across the straight one."""

    name = 'sidestep'

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return that cell (x, y)."""
        blocked = query.costmap.blocked
        height, width = blocked.shape
        (x0, y0), (x1, y1) = query.start, query.goal
        length = math.hypot(x1 - x0, y1 - y0) or 1.0
        for step in sorted(range(-width - height, width + height), key=abs):
            x = round((x0 + x1) / 2 - step * (y1 - y0) / length)
            y = round((y0 + y1) / 2 + step * (x1 - x0) / length)
            if 0 <= x < width and 0 <= y < height and not blocked[y, x]:
                return WaypointReply(((x, y),))
        return WaypointReply()


def make_sidestep(context: SourceContext) -> Sidestep:
    """Make the source; `context.settings` has the parameters, such as the model to ask."""
    del context
    return Sidestep()


def neighbours(problem: SearchProblem, cell: tuple[int, int]):  # noqa: ANN201 - an example
    """Yield the free cells that one move leads to."""
    blocked, (x, y) = problem.blocked, cell
    height, width = blocked.shape
    for dx, dy in ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)):
        i, j = x + dx, y + dy
        if not (0 <= i < width and 0 <= j < height) or blocked[j, i]:
            continue
        if problem.grid.corner_cutting or not (blocked[y, i] or blocked[j, x]):
            yield i, j


@search_method(uses_waypoints=True)
def greedy_best_first(problem: SearchProblem) -> SearchResult:
    """Go from waypoint to waypoint, always expanding the cell nearest to the next one."""
    targets = [(round(x), round(y)) for x, y in problem.waypoints]
    targets = [(x, y) for x, y in targets if not problem.blocked[y, x]]
    expanded = np.zeros(problem.blocked.shape, dtype=bool)
    path, expansions, storage = [problem.start], 0, 1
    for target in [*targets, problem.goal]:
        before = {path[-1]: None}
        queue = [(math.dist(path[-1], target), path[-1])]
        while queue and target not in before:
            if problem.stop[0] or time.monotonic() > problem.deadline:
                return SearchResult(SearchStatus.STOPPED, expansions, storage, expanded)
            _, cell = heapq.heappop(queue)
            expansions += 1
            expanded[cell[1], cell[0]] = True
            for other in neighbours(problem, cell):
                if other not in before:
                    before[other] = cell
                    storage += 1
                    heapq.heappush(queue, (math.dist(other, target), other))
        if target not in before:
            return SearchResult(SearchStatus.EXHAUSTED, expansions, storage, expanded)
        stretch = [target]
        while (previous := before[stretch[-1]]) is not None:
            stretch.append(previous)
        path += stretch[-2::-1]
    return SearchResult(SearchStatus.FOUND, expansions, storage, expanded, np.array(path))

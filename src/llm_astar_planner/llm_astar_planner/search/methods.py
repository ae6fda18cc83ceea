# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The search methods by name: the package's own, and those of other packages."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from llm_astar_planner.plugins import PluginError, Plugins, call, checked_count, log_failure
from llm_astar_planner.search.arrays import Bools, Int32s
from llm_astar_planner.search.problem import SearchProblem
from llm_astar_planner.search.result import SearchResult, SearchStatus, empty_path

# Seconds after its time in which a method may still return what it has.
GRACE_S = 0.05
GUIDED = 'guided'
EXACT = 'exact_astar'
# The paper's, which `search.paper` has by these names.
PAPER_NAMES = ('astar', 'weighted_astar', 'dynamic_weighted_astar', 'llm_astar')
# The largest coordinate of a path.
MAX_COORDINATE = 2**31 - 1


@dataclass(frozen=True, eq=False)
class PluginMethod:
    """The method of a plug-in. Its paths count as those of a method that proves nothing."""

    name: str
    function: Callable[[SearchProblem], Any]
    uses_waypoints: bool
    takes_late_waypoints: ClassVar[bool] = False
    as_published: ClassVar[bool] = False

    def __call__(self, problem: SearchProblem) -> SearchResult:
        """Search; one that comes back late has stopped without a path.

        Raises PluginError where the method fails.
        """
        try:
            result = call(lambda: checked_result(self.function(problem), problem))
        except PluginError as error:
            log_failure(self.name, error)
            raise PluginError(f'search method {self.name}: {error}') from None
        late = time.monotonic() - problem.deadline
        if late > GRACE_S and not problem.stop[0]:
            log_failure(self.name, TimeoutError(f'came back {late:.2f} s after its time was over'))
            return SearchResult(SearchStatus.STOPPED, 0, 0, expanded_cells((), problem))
        return result


def make_plugin_method(name: str, function: Any) -> PluginMethod:  # noqa: ANN401 - foreign
    """Return the method that a plug-in's function is. Raises PluginError for none."""
    if not callable(function):
        raise PluginError(f'is {type(function).__name__}, not a function of a SearchProblem')
    return PluginMethod(name, function, getattr(function, 'uses_waypoints', False) is True)


def checked_result(answer: Any, problem: SearchProblem) -> SearchResult:  # noqa: ANN401
    """Return a plug-in's result made of plain values; what it proves is not taken over.

    The length is measured on the path. Raises PluginError, which names the field.
    """
    if not isinstance(answer, SearchResult):
        raise PluginError(f'returned {type(answer).__name__}, not a SearchResult')
    path = checked_path(answer.path, problem)
    length = float(np.hypot(*np.diff(path, axis=0).T).sum()) if len(path) else float('nan')
    expansions = checked_count(answer.expansions, 'expansions')
    storage = checked_count(answer.storage, 'storage')
    expanded = expanded_cells(answer.expanded, problem)
    status = SearchStatus(answer.status)
    return SearchResult(status, expansions, storage, expanded, path, length)


def checked_path(path: Any, problem: SearchProblem) -> Int32s:  # noqa: ANN401
    """Return a plug-in's path as int32 [n, 2], n at most the cells of the map.

    Raises PluginError.
    """
    cells = np.asarray(path)
    if cells.size == 0:
        return empty_path()
    if cells.ndim != 2 or cells.shape[1] != 2 or cells.dtype.kind not in 'iu':
        raise PluginError(f'path: {cells.dtype} {cells.shape} is not whole numbers [n, 2]')
    if len(cells) > problem.grid.blocked.size:
        raise PluginError(f'path: has {len(cells)} cells, more than the map')
    if cells.min() < 0 or cells.max() > MAX_COORDINATE:
        raise PluginError('path: leaves the map')
    return cells.astype(np.int32)


def expanded_cells(expanded: Any, problem: SearchProblem) -> Bools:  # noqa: ANN401
    """Return a copy of a plug-in's picture of expanded cells, [0, 0] where none is wanted.

    Without a picture no cell is expanded. Raises PluginError for one of another shape.
    """
    shape = problem.grid.blocked.shape if problem.want_expanded else (0, 0)
    picture = np.asarray(expanded, dtype=np.bool_)
    if picture.size == 0 or not problem.want_expanded:
        return np.zeros(shape, dtype=np.bool_)
    if picture.shape != shape:
        raise PluginError(f'expanded: has shape {picture.shape}, the map {shape}')
    return picture.copy()


# The package's own by name, in the order in which they are listed; each is a SearchMethod.
# Of our own searches, the first two, paths carry a suboptimality bound: docs/guided-search.md.
HERE = 'llm_astar_planner.search'
SEARCH_METHODS = Plugins(
    'search method',
    'llm_astar.search_methods',
    {
        GUIDED: f'{HERE}.guided:guided_method',
        EXACT: f'{HERE}.astar:exact_method',
        **{name: f'{HERE}.paper:{name}' for name in PAPER_NAMES},
    },
    make_plugin_method,
    # What `bench` calls rows without a search, now and before.
    frozenset({'waypoints_only', 'llm_only'}),
)
METHODS = tuple(SEARCH_METHODS.own)
# Of these, the methods that use waypoints; the others never query a source.
WAYPOINT_METHODS = frozenset({GUIDED, 'llm_astar'})
# How the paper's methods estimate the distance to the goal.
HEURISTIC_NAMES = ('euclidean', 'octile', 'chebyshev', 'manhattan')


def uses_waypoints(name: str) -> bool:
    """Tell whether a method may use waypoints; that of a plug-in says so once it is loaded."""
    if name in METHODS:
        return name in WAYPOINT_METHODS
    plugin = SEARCH_METHODS.loaded.get(name)
    return plugin is None or bool(plugin.uses_waypoints)

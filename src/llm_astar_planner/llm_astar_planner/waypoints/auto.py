# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The source `auto`: on each map the one that helps there, or none (docs/performance.md)."""

from __future__ import annotations

from dataclasses import replace

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.config import SourceContext, make_source
from llm_astar_planner.waypoints.source import (
    SAVES_NOTHING,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)


def best_source(costmap: Costmap) -> str:
    """Return the source that helps on a costmap: `embedded` or `none`.

    The embedded model is for maps of the paper's kind, a few dozen straight barriers. Elsewhere
    the search takes less time than any source.
    """
    return 'embedded' if costmap.is_barrier_map else 'none'


def helps_on(costmap: Costmap) -> bool:
    """Tell whether any source helps on a costmap."""
    return best_source(costmap) != 'none'


class AutoSource:
    """Asks the best source for each query's map; its replies say which that was. Thread-safe."""

    name = 'auto'

    def __init__(self, context: SourceContext) -> None:
        """Take what sources are made from; they are made when they are first asked."""
        self._context = context
        self._made: dict[str, WaypointSource] = {}
        self.helps_on = helps_on

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the reply of the best source, or one with status NONE."""
        name = best_source(query.costmap)
        if name == 'none':
            return WaypointReply(label=self.name, status=SourceStatus.NONE, detail=SAVES_NOTHING)
        if name not in self._made:
            settings = replace(self._context.settings, source=name)
            self._made[name] = make_source(settings, self._context.dataset, self._context.seed)
        return self._made[name].waypoints(query)

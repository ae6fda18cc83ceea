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


def helps_on(costmap: Costmap) -> bool:
    """Tell whether a source helps on a costmap: the embedded model, on maps of the paper's kind.

    These are a few dozen straight barriers. Elsewhere the search takes less time than any source.
    """
    return costmap.is_barrier_map


class AutoSource:
    """Asks the embedded model on the maps where it helps. Thread-safe."""

    name = 'auto'

    def __init__(self, context: SourceContext) -> None:
        """Take what the model is made from; it is loaded when it is first asked."""
        self._context = context
        self._embedded: WaypointSource | None = None
        self.helps_on = helps_on

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the reply of the embedded model, or one with status NONE."""
        if not helps_on(query.costmap):
            return WaypointReply(label=self.name, status=SourceStatus.NONE, detail=SAVES_NOTHING)
        if self._embedded is None:
            settings = replace(self._context.settings, source='embedded')
            self._embedded = make_source(settings, self._context.dataset, self._context.seed)
        return self._embedded.waypoints(query)

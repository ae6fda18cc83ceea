# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""LLM-A* for ROS 2: a global planner that the waypoints of a language model may guide.

What a user imports: Planner, PlanRequest, Plan, CostmapConfig, ResultCode, WaypointSource.
"""

from __future__ import annotations

import gc
from importlib import import_module

# As type checkers know it: importing typing takes a while, in which Ctrl-C is not handled yet.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from llm_astar_planner.costmap.config import CostmapConfig
    from llm_astar_planner.planning.planner import Planner
    from llm_astar_planner.planning.types import Plan, PlanRequest, ResultCode
    from llm_astar_planner.waypoints.source import WaypointSource

__version__ = '0.1.0'
__all__ = ['CostmapConfig', 'Plan', 'PlanRequest', 'Planner', 'ResultCode', 'WaypointSource']

# Imported when first used: the searches take a second, and `llm-astar --help` needs none.
_HOMES = {
    'CostmapConfig': 'costmap.config', 'Planner': 'planning.planner', 'Plan': 'planning.types',
    'PlanRequest': 'planning.types', 'ResultCode': 'planning.types',
    'WaypointSource': 'waypoints.source',
}  # fmt: skip


def __getattr__(name: str) -> Any:  # noqa: ANN401 - of the module's names
    """Import a public name from its home."""
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    # What modules define stays, and to look for garbage in it takes an eighth of the time.
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        return getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)
    finally:
        if was_enabled:
            gc.enable()

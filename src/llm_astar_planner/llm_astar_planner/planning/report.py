"""Plans of the core as reports: in metres, for the wire, for bags."""

from __future__ import annotations

import math

from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.report import PlanReport

from llm_astar_planner.planning.types import Plan, ResultCode


def plan_report(plan: Plan, grid_map: GridMap) -> PlanReport:
    """Report a plan: metres in the map's frame instead of cells."""
    places = grid_map.grid_to_world([(point.x, point.y) for point in plan.waypoints]).tolist()
    verdicts = [point.status.value for point in plan.waypoints]
    length = plan.length * grid_map.resolution
    return PlanReport(
        code=int(plan.code),
        code_name=plan.code.name,
        message=plan.message,
        method=plan.method,
        guided_by=plan.guided_by,
        source=plan.source,
        source_status=plan.source_status.value,
        source_detail=plan.reply.detail,
        operation=plan.expansions,
        first_operation=plan.first_expansions,
        storage=plan.storage,
        length=length if math.isfinite(length) else None,
        ratio=plan.suboptimality_bound if math.isfinite(plan.suboptimality_bound) else None,
        seconds_source=plan.seconds_source,
        seconds_search=plan.seconds_search,
        waypoints=tuple((x, y, verdict) for (x, y), verdict in zip(places, verdicts)),
        map_digest=grid_map.digest,
        start_shift=plan.start_shift,
        goal_shift=plan.goal_shift,
        unknown_length=plan.unknown_length,
        clearance=plan.clearance if math.isfinite(plan.clearance) else None,
        turns=plan.turns,
        warnings=plan.warnings,
        instruction=plan.instruction,
    )


def failure_report(code: ResultCode, message: str) -> PlanReport:
    """Report a request that never came to planning."""
    return PlanReport(
        code=int(code),
        code_name=code.name,
        message=message,
        method='',
        guided_by='none',
        source='none',
        source_status='NONE',
        source_detail='',
        operation=0,
        first_operation=0,
        storage=0,
        length=None,
        ratio=None,
        seconds_source=0.0,
        seconds_search=0.0,
        waypoints=(),
        map_digest='',
    )

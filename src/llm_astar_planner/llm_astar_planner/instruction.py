"""Plan with a wish in plain language: its waypoints become via points, and it costs no plan.

The direct plan is made first, with the question to the source in it. Where the source answers the
wish, the way through its waypoints is planned in what time is left and taken if there is one.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import groupby

from llm_astar_planner import targets
from llm_astar_planner.plan import Plan, PlanRequest
from llm_astar_planner.prompts.instruction import InstructionError, clean_instruction
from llm_astar_planner.result_code import ResultCode
from llm_astar_planner.search.methods import WAYPOINT_METHODS
from llm_astar_planner.search.result import Cell
from llm_astar_planner.targets import JudgedWaypoint, Verdict
from llm_astar_planner.waypoint_source.wish import FOLLOWED

# The part of a request's time for the source and the direct plan; the rest is for the wish.
DIRECT_SHARE = 0.9
# A way so many times as long as the direct one is worth a warning.
DETOUR = 3.0
MAX_REASON_CHARS = 200
# What an outcome begins with that another try may better.
NOT_HONOURED = 'not honoured'


def plan_with_wish(
    request: PlanRequest,
    make: Callable[[PlanRequest], Plan],
    is_free: Callable[[Cell], bool],
) -> Plan:
    """Answer a request that has an instruction; `make` answers one without regard to its wish.

    `is_free` tells of a cell of the map whether a path may be there. The plan's `instruction`
    says what became of the wish, whatever that is.
    """
    deadline = time.monotonic() + request.time_limit
    try:
        wish = clean_instruction(request.instruction)
    except InstructionError as error:
        return _told(make(replace(request, instruction='')), f'ignored: {error}')
    direct = make(
        replace(
            request,
            instruction=wish,
            time_limit=DIRECT_SHARE * request.time_limit,
            search_while_waiting=False,
        )
    )
    if not wish:
        return direct
    if direct.reply.instruction != FOLLOWED:
        return _told(direct, f'ignored: {_reason(direct, request)}')
    if direct.code is not ResultCode.NONE:
        return _told(direct, f'{NOT_HONOURED}: there is no plan at all')
    return _honoured(request, direct, make, is_free, deadline)


def _honoured(
    request: PlanRequest,
    direct: Plan,
    make: Callable[[PlanRequest], Plan],
    is_free: Callable[[Cell], bool],
    deadline: float,
) -> Plan:
    """Return the plan through the waypoints of the direct one, else that one."""
    via = _via(direct, is_free)
    lost = _lost(direct.waypoints, is_free)
    if not via:
        if lost:
            return _told(direct, f'{NOT_HONOURED}: no waypoint can be passed ({lost})')
        return _told(direct, 'followed by the direct way: no waypoint lies in between')
    time_left = deadline - time.monotonic()
    through = make(replace(request, instruction='', source=None, via=via, time_limit=time_left))
    if through.code is not ResultCode.NONE:
        why = f'no path through its {_points(len(via))}: {through.message}'
        return _told(_with_work_of(direct, through), f'{NOT_HONOURED}: {why}')
    outcome = f'followed through {_points(len(via))}'
    if lost:
        outcome += f'; left out: {lost}'
    guided = replace(
        through,
        waypoints=_in_order(direct.waypoints, through),
        guided_by=direct.reply.label,
        source=direct.source,
        reply=direct.reply,
        warnings=(*through.warnings, *_detour(direct, through)),
    )
    return _told(_with_work_of(guided, direct), outcome)


def _via(direct: Plan, is_free: Callable[[Cell], bool]) -> tuple[Cell, ...]:
    """Return the cells of the waypoints that can be passed, start and goal left out."""
    passable = (point for point in direct.waypoints if _can_be_passed(point, is_free))
    cells = [(round(point.x), round(point.y)) for point in passable]
    between = [cell for cell in cells if cell not in (direct.start, direct.goal)]
    return tuple(cell for cell, _ in groupby(between))


def _can_be_passed(point: JudgedWaypoint, is_free: Callable[[Cell], bool]) -> bool:
    # Between lattice points the paper's rules see no obstacle.
    return point.verdict in targets.GUIDING and is_free((round(point.x), round(point.y)))


def _lost(waypoints: tuple[JudgedWaypoint, ...], is_free: Callable[[Cell], bool]) -> str:
    """Count the waypoints that cannot be passed, by why, or ''."""
    counts = Counter(
        (Verdict.OCCUPIED if point.verdict in targets.GUIDING else point.verdict)
        for point in waypoints
        if not _can_be_passed(point, is_free)
    )
    return ', '.join(f'{count} {why.value.replace("_", " ")}' for why, count in counts.items())


def _in_order(waypoints: tuple[JudgedWaypoint, ...], plan: Plan) -> tuple[JudgedWaypoint, ...]:
    """Judge the order of waypoints again, by another plan's path."""
    accepted = (
        replace(point, verdict=Verdict.ACCEPTED) if point.verdict in targets.GUIDING else point
        for point in waypoints
    )
    return targets.mark_out_of_order(tuple(accepted), plan.path)


def _detour(direct: Plan, through: Plan) -> tuple[str, ...]:
    if through.length <= DETOUR * direct.length:
        return ()
    factor = through.length / direct.length if direct.length else float('inf')
    return (f'the way of the wish is {factor:.1f} times as long as the direct one',)


def _with_work_of(plan: Plan, other: Plan) -> Plan:
    """Return a plan that was made at the cost of another one too."""
    return replace(
        plan,
        operation=plan.operation + other.operation,
        storage=plan.storage + other.storage,
        first_operation=plan.first_operation + other.operation,
        seconds_source=plan.seconds_source + other.seconds_source,
        seconds_search=plan.seconds_search + other.seconds_search,
    )


def _reason(direct: Plan, request: PlanRequest) -> str:
    """Say why a wish was not read."""
    if direct.reply.instruction:
        return direct.reply.instruction[:MAX_REASON_CHARS]
    if request.via:
        return 'the request has via points of its own'
    if request.source is None:
        return 'no source was asked'
    if request.method not in WAYPOINT_METHODS:
        return f'method {request.method} asks for no waypoints'
    return 'no waypoints were asked for'


def _told(plan: Plan, outcome: str) -> Plan:
    return replace(plan, instruction=outcome, message=f'{plan.message}; wish {outcome}')


def _points(count: int) -> str:
    return f'{count} via point{"" if count == 1 else "s"}'

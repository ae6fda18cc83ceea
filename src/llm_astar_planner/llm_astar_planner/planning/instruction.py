"""Plans with an instruction in plain language: the source's waypoints become via points.

The direct path is planned first and is the answer if nothing comes of the instruction. If the
source answers it, a path through its waypoints is planned in the time that is left. An
instruction never costs the plan.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.types import NOT_ASKED, Plan, PlanRequest, ResultCode
from llm_astar_planner.planning.waypoint_filter import (
    CheckedWaypoint,
    WaypointStatus,
    check_waypoints,
)
from llm_astar_planner.search.paper import WAYPOINT_METHODS
from llm_astar_planner.search.result import Cell
from llm_astar_planner.search.stop import POLL_PERIOD_S
from llm_astar_planner.waypoints.async_query import query_source
from llm_astar_planner.waypoints.prompts.instruction import InstructionError, clean_instruction
from llm_astar_planner.waypoints.source import (
    FOLLOWED,
    Waypoint,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

# The part of a request's time for the source and the direct plan; the rest is for the path
# through the via points.
DIRECT_SHARE = 0.9
# A path so many times as long as the direct one gets a warning.
DETOUR = 3.0
MAX_REASON_CHARS = 200
# An outcome that begins so may be better at the next try.
NOT_HONOURED = 'not honoured'


class SharedReplySource:
    """Queries a source once and keeps the reply for whoever needs it after the search."""

    def __init__(self, source: WaypointSource) -> None:
        """Take the source."""
        self.name = source.name
        self._source = source
        self._answered = threading.Event()
        self._reply: WaypointReply | None = None

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Query the source, and keep its reply."""
        self._reply, _ = query_source(self._source, query)
        self._answered.set()
        return self._reply

    def wait_for_reply(self, deadline: float, stop: NDArray[np.uint8]) -> WaypointReply | None:
        """Wait until `deadline` (monotonic seconds) or `stop`; None if no reply came."""
        while not self._answered.wait(POLL_PERIOD_S):
            if stop[0] or time.monotonic() >= deadline:
                break
        return self._reply


def plan_with_instruction(
    request: PlanRequest,
    make: Callable[[PlanRequest], Plan],
    costmap: Costmap,
    stop: NDArray[np.uint8],
) -> Plan:
    """Answer a request that has an instruction; `stop[0] = 1` from another thread cancels.

    `make` plans a request as if it had no instruction, which still reaches its source. The plan's
    `instruction` says what became of the instruction.
    """
    deadline = time.monotonic() + request.time_limit
    try:
        instruction = clean_instruction(request.instruction)
    except InstructionError as error:
        return with_outcome(make(replace(request, instruction='')), f'ignored: {error}')
    if not instruction:
        return make(replace(request, instruction=''))
    source = None if request.source is None else SharedReplySource(request.source)
    time_limit = DIRECT_SHARE * request.time_limit
    direct = make(replace(request, instruction=instruction, source=source, time_limit=time_limit))
    if direct.code is not ResultCode.NONE:
        return with_outcome(direct, f'{NOT_HONOURED}: there is no plan at all')
    reply = None
    if source is not None and direct.reply is not NOT_ASKED:
        reply = source.wait_for_reply(deadline, stop)
    if reply is None or reply.instruction != FOLLOWED:
        return with_outcome(direct, f'ignored: {ignored_reason(reply, request)}')

    def make_through(via: tuple[Cell, ...]) -> Plan:
        time_left = deadline - time.monotonic()
        return make(replace(request, instruction='', source=None, via=via, time_limit=time_left))

    cells = rounded(reply.waypoints)
    checked = check_waypoints(cells, costmap.blocked, costmap.components, direct.start, 0)
    return plan_through(direct, reply, checked, make_through)


def plan_through(
    direct: Plan,
    reply: WaypointReply,
    checked: tuple[CheckedWaypoint, ...],
    make_through: Callable[[tuple[Cell, ...]], Plan],
) -> Plan:
    """Return the plan through the reply's waypoints, or the direct one if that fails."""
    usable = [point for point in checked if point.status is WaypointStatus.ACCEPTED]
    lost = count_by_status(point for point in checked if point not in usable)
    cells = [(int(point.x), int(point.y)) for point in usable]
    between = [cell for cell in cells if cell not in (direct.start, direct.goal)]
    via = tuple(cell for cell, _ in groupby(between))
    if not via:
        if lost:
            return with_outcome(direct, f'{NOT_HONOURED}: no waypoint can be passed ({lost})')
        return with_outcome(direct, 'followed by the direct path: no waypoint lies in between')
    points = f'{len(via)} via point{"" if len(via) == 1 else "s"}'
    through = make_through(via)
    if through.code is not ResultCode.NONE:
        outcome = f'{NOT_HONOURED}: no path through its {points}: {through.message}'
        return with_outcome(with_work_of(direct, through), outcome)
    warnings = through.warnings
    if through.length > DETOUR * direct.length:
        factor = through.length / direct.length if direct.length else math.inf
        warning = f'the path of the instruction is {factor:.1f} times as long as the direct one'
        warnings = (*warnings, warning)
    plan = replace(
        through,
        checked_waypoints=checked,  # they are the via points, so they are in order
        guided_by=reply.label,
        source=direct.source,
        reply=reply,
        warnings=warnings,
    )
    outcome = f'followed through {points}'
    return with_outcome(
        with_work_of(plan, direct), f'{outcome}; left out: {lost}' if lost else outcome
    )


def rounded(waypoints: Sequence[Waypoint]) -> list[Waypoint]:
    """Return the cells that waypoints lie in, as waypoints; what is not finite is left out."""
    return [(float(round(x)), float(round(y))) for x, y in waypoints if math.isfinite(x + y)]


def count_by_status(waypoints: Iterable[CheckedWaypoint]) -> str:
    """Count waypoints by status, in words; '' for none."""
    counts = Counter(point.status for point in waypoints)
    return ', '.join(
        f'{count} {status.value.replace("_", " ")}' for status, count in counts.items()
    )


def with_work_of(plan: Plan, other: Plan) -> Plan:
    """Return a plan that includes the work of another one that was made on the way to it."""
    return replace(
        plan,
        expansions=plan.expansions + other.expansions,
        storage=plan.storage + other.storage,
        first_expansions=plan.first_expansions + other.expansions,
        seconds_source=plan.seconds_source + other.seconds_source,
        seconds_search=plan.seconds_search + other.seconds_search,
    )


def ignored_reason(reply: WaypointReply | None, request: PlanRequest) -> str:
    """Say why an instruction was ignored."""
    if reply is not None:
        return reply.instruction[:MAX_REASON_CHARS]
    if request.via:
        return 'the request has via points of its own'
    if request.source is None:
        return 'no source was asked'
    if request.method not in WAYPOINT_METHODS:
        return f'method {request.method} asks for no waypoints'
    if request.start == request.goal:
        return 'start and goal are the same'
    return f'source {request.source.name} did not answer in time'


def with_outcome(plan: Plan, outcome: str) -> Plan:
    """Return a plan that says what became of the instruction."""
    return replace(plan, instruction=outcome, message=f'{plan.message}; instruction {outcome}')

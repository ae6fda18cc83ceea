"""Plan with a wish in plain language: its waypoints become via points, and it costs no plan.

The direct way is planned as ever, and is the answer where nothing comes of the wish. Where the
source answers it, the way through its waypoints is planned in what time is left.
"""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.planning.types import NOT_ASKED, Plan, PlanRequest, ResultCode
from llm_astar_planner.planning.waypoint_filter import CheckedWaypoint, WaypointStatus
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

# The part of a request's time for the source and the direct plan; the rest is for the wish.
DIRECT_SHARE = 0.9
# A way so many times as long as the direct one is worth a warning.
DETOUR = 3.0
MAX_REASON_CHARS = 200
# What an outcome begins with that another try may better.
NOT_HONOURED = 'not honoured'

Maker = Callable[[PlanRequest], Plan]
Judge = Callable[[Sequence[Waypoint], Cell], tuple[CheckedWaypoint, ...]]


class _AskedOnce:
    """A source whose answer can still be had when the search it was to guide is done."""

    def __init__(self, source: WaypointSource) -> None:
        self.name = source.name
        self._source = source
        self._answered = threading.Event()
        self._reply: WaypointReply | None = None

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Ask the source, and keep what it says."""
        self._reply, _ = query_source(self._source, query)
        self._answered.set()
        return self._reply

    def reply(self, deadline: float, stop: NDArray[np.uint8]) -> WaypointReply | None:
        """Wait for the answer until `deadline` (monotonic) or `stop`; None where none came."""
        while not self._answered.wait(POLL_PERIOD_S):
            if stop[0] or time.monotonic() >= deadline:
                break
        return self._reply


def plan_with_wish(
    request: PlanRequest, make: Maker, judge: Judge, stop: NDArray[np.uint8]
) -> Plan:
    """Answer a request that has an instruction; `make` answers one without honouring its wish.

    `judge` judges waypoints as seen from a start. The plan's `instruction` says what became of
    the wish, whatever that is. Another thread cancels by `stop[0] = 1`.
    """
    deadline = time.monotonic() + request.time_limit
    try:
        wish = clean_instruction(request.instruction)
    except InstructionError as error:
        return _told(make(replace(request, instruction='')), f'ignored: {error}')
    if not wish:
        return make(replace(request, instruction=''))
    source = None if request.source is None else _AskedOnce(request.source)
    time_limit = DIRECT_SHARE * request.time_limit
    direct = make(replace(request, instruction=wish, source=source, time_limit=time_limit))
    if direct.code is not ResultCode.NONE:
        return _told(direct, f'{NOT_HONOURED}: there is no plan at all')
    reply = None
    if source is not None and direct.reply is not NOT_ASKED:
        reply = source.reply(deadline, stop)
    if reply is None or reply.instruction != FOLLOWED:
        return _told(direct, f'ignored: {_reason(reply, request)}')

    def make_through(via: tuple[Cell, ...]) -> Plan:
        time_left = deadline - time.monotonic()
        return make(replace(request, instruction='', source=None, via=via, time_limit=time_left))

    waypoints = judge(_rounded(reply.waypoints), direct.start)
    return _honoured(direct, reply, waypoints, make_through)


def _honoured(
    direct: Plan,
    reply: WaypointReply,
    waypoints: tuple[CheckedWaypoint, ...],
    make_through: Callable[[tuple[Cell, ...]], Plan],
) -> Plan:
    """Return the plan through the waypoints of a reply, else the direct one."""
    lost = _lost(waypoints)
    via = _via(waypoints, direct)
    if not via:
        if lost:
            return _told(direct, f'{NOT_HONOURED}: no waypoint can be passed ({lost})')
        return _told(direct, 'followed by the direct way: no waypoint lies in between')
    through = make_through(via)
    if through.code is not ResultCode.NONE:
        why = f'no path through its {_points(len(via))}: {through.message}'
        return _told(_with_work_of(direct, through), f'{NOT_HONOURED}: {why}')
    guided = replace(
        through,
        waypoints=waypoints,  # in order whatever else the path passes: they are its via points
        guided_by=reply.label,
        source=direct.source,
        reply=reply,
        warnings=(*through.warnings, *_detour(direct, through)),
    )
    outcome = f'followed through {_points(len(via))}'
    return _told(
        _with_work_of(guided, direct), f'{outcome}; left out: {lost}' if lost else outcome
    )


def _rounded(waypoints: Sequence[Waypoint]) -> list[Waypoint]:
    """Return the cells that waypoints lie on, as waypoints."""
    return [(float(round(x)), float(round(y))) for x, y in waypoints if math.isfinite(x + y)]


def _via(waypoints: tuple[CheckedWaypoint, ...], direct: Plan) -> tuple[Cell, ...]:
    """Return the cells of the waypoints that can be passed, start and goal left out."""
    cells = [(int(point.x), int(point.y)) for point in waypoints if _can_be_passed(point)]
    between = [cell for cell in cells if cell not in (direct.start, direct.goal)]
    return tuple(cell for cell, _ in groupby(between))


def _can_be_passed(point: CheckedWaypoint) -> bool:
    return point.status is WaypointStatus.ACCEPTED


def _lost(waypoints: tuple[CheckedWaypoint, ...]) -> str:
    """Count the waypoints that cannot be passed, by why, or ''."""
    counts = Counter(point.status for point in waypoints if not _can_be_passed(point))
    return ', '.join(f'{count} {why.value.replace("_", " ")}' for why, count in counts.items())


def _detour(direct: Plan, through: Plan) -> tuple[str, ...]:
    if through.length <= DETOUR * direct.length:
        return ()
    factor = through.length / direct.length if direct.length else float('inf')
    return (f'the way of the wish is {factor:.1f} times as long as the direct one',)


def _with_work_of(plan: Plan, other: Plan) -> Plan:
    """Return a plan that was made at the cost of another one too."""
    return replace(
        plan,
        expansions=plan.expansions + other.expansions,
        storage=plan.storage + other.storage,
        first_expansions=plan.first_expansions + other.expansions,
        seconds_source=plan.seconds_source + other.seconds_source,
        seconds_search=plan.seconds_search + other.seconds_search,
    )


def _reason(reply: WaypointReply | None, request: PlanRequest) -> str:
    """Say why a wish was not read."""
    if reply is not None:
        return reply.instruction[:MAX_REASON_CHARS]
    if request.via:
        return 'the request has via points of its own'
    if request.source is None:
        return 'no source was asked'
    if request.method not in WAYPOINT_METHODS:
        return f'method {request.method} asks for no waypoints'
    if request.start == request.goal:
        return 'start and goal are one'
    return f'source {request.source.name} did not answer in time'


def _told(plan: Plan, outcome: str) -> Plan:
    return replace(plan, instruction=outcome, message=f'{plan.message}; wish {outcome}')


def _points(count: int) -> str:
    return f'{count} via point{"" if count == 1 else "s"}'

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plans for the page, one a core at a time: the chosen plan, and some to compare with."""

import asyncio
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

from llm_astar_planner.caches import Recent
from llm_astar_planner.cli.planning_options import route_instruction, sample_key_of, settled
from llm_astar_planner.instructions.chain import make_interpreter
from llm_astar_planner.instructions.interpretation import Interpreter
from llm_astar_planner.planning.compile import compile_progress
from llm_astar_planner.planning.parameters import costmap_config, request_fields
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.questions import QuestionError, Questions
from llm_astar_planner.planning.types import Plan, PlanRequest
from llm_astar_planner.search.arrays import Int32s, StopFlag, no_stop
from llm_astar_planner.search.methods import WAYPOINT_METHODS
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.replay import FixedReply
from llm_astar_planner.waypoints.source import WaypointSource

from llm_astar_lab.pictures.retrace import retrace
from llm_astar_lab.play.maps import PlayError
from llm_astar_lab.play.request import PlayRequest

# Seconds that one plan may take, and that an instruction may take to be understood.
TIME_LIMIT_S = 10.0
INTERPRETATION_S = 5.0
# Cells of the maps whose planners are kept, each with the landmarks of its map.
MAX_KEPT_CELLS = 8_000_000
# Plans that may wait for their turn, in all and of one address; and how many run at a time.
MAX_WAITING, MAX_OF_ONE = 64, 32
AT_A_TIME = min(8, len(os.sched_getaffinity(0)))
# Returns the answer to a page, until the flag stops it.
Job = Callable[[StopFlag], bytes]


class PlayedPlan(NamedTuple):
    """A plan, what part it plays (`chosen`, `no_waypoints`, `astar`) and its title.

    `order` is int32 [n]: the cells y * width + x in the order of their expansion, None where that
    is not known.
    """

    role: str
    title: str
    plan: Plan
    order: Int32s | None


class PlanningService:
    """Plans what the page asks for; it keeps the planners of the last maps. Thread-safe."""

    def __init__(self) -> None:
        """Start without planners."""
        self._lock = threading.Lock()
        self._planners: Recent[tuple[object, ...], Planner] = Recent(
            MAX_KEPT_CELLS, lambda planner: planner.grid_map.cells.size
        )
        self._interpreter: Interpreter = make_interpreter({})

    def planner_for(self, request: PlayRequest) -> Planner:
        """Return a prepared planner for the map, the rules and the walls of a request."""
        config = costmap_config(request.values)
        barriers = None if request.is_edited else request.play_map.barriers
        grid_map = request.edited_map()
        key = request.play_map.id, config, barriers is None, grid_map.digest
        # One is prepared at a time: many users may ask for the same one.
        with self._lock:
            if self._planners.get(key) is None:
                self._planners[key] = Planner(grid_map, config, barriers).prepare()
            return self._planners[key]

    def plan(self, request: PlayRequest, stop: StopFlag) -> tuple[Planner, list[PlayedPlan]]:
        """Return the planner, the chosen plan and those to compare it with, until stopped."""
        planner = self.planner_for(request)
        plans = []
        for role, wanted in compared(self.plan_request(request)).items():
            # So that the times of plans are for planning; says so where it takes long.
            with compile_progress():
                planner.compile(wanted)
            plan = planner.plan(wanted, stop)
            order = None if stop[0] else retrace(planner, wanted, plan)
            plans.append(
                PlayedPlan(role, title_of(wanted), plan, None if order is None else order.order)
            )
        return planner, plans

    def answer(
        self, request: PlayRequest, planner: Planner, stop: StopFlag
    ) -> dict[str, Any] | None:
        """Return the answer to the question of a request, None where it has none.

        It has the `sentence`, and as `path` the cells of the other path, if the question has one.
        """
        if not request.question:
            return None
        wanted = self.plan_request(request)
        questions = Questions(planner, wanted, self._interpreter, request.places, stop)
        try:
            answer = questions.answer(request.question)
        except QuestionError as error:
            return {'sentence': str(error), 'path': []}
        other = questions.other
        return answer | {'path': [] if other is None else other.path.tolist()}

    def plan_request(self, request: PlayRequest) -> PlanRequest:
        """Return the request for the chosen plan."""
        ends, settle = (request.start, request.goal), partial(settled, confirm=request.confirm)
        instruction = route_instruction(
            request.values, request.places, INTERPRETATION_S, lambda: self._interpreter, settle
        )
        return PlanRequest(
            *ends, source=waypoint_source(request),
            sample=sample_key_of(request.play_map.problem, *ends), via=request.via,
            instruction=instruction,
            **request_fields(request.values) | {'time_limit': TIME_LIMIT_S},
        )  # fmt: skip


def compared(chosen: PlanRequest) -> dict[str, PlanRequest]:
    """Return by role the chosen request, and others to compare it with where they differ.

    `no_waypoints` is the same without a source. `astar` is the paper's A*, which knows nothing of
    waypoints, instructions or angles; via points and the rules of the costmap stay.
    """
    requests = {'chosen': chosen}
    if chosen.source is not None and not chosen.via:
        requests['no_waypoints'] = replace(chosen, source=None, alternatives=0)
    if chosen.method != 'astar' or chosen.instruction is not None:
        plain = replace(chosen, source=None, instruction=None, any_angle=False, alternatives=0)
        requests['astar'] = replace(plain, method='astar')
    return requests


def title_of(request: PlanRequest) -> str:
    """Name a request's method, and what guides it."""
    title = request.method
    if request.source is not None:
        title += f', waypoints by {request.source.name}'
    elif request.method in WAYPOINT_METHODS:
        title += ', no waypoints'
    return title + (', by the instruction' if request.instruction else '')


def waypoint_source(request: PlayRequest) -> WaypointSource | None:
    """Return the source of waypoints, None where none is asked."""
    name = request.values['source']
    if request.values['method'] not in WAYPOINT_METHODS:
        return None
    if request.reply is not None:
        return FixedReply(request.reply, request.play_map.problem.offset)
    return None if name == 'none' else make_source(SourceSettings(source=name))


@dataclass(frozen=True, eq=False)
class Waiting:
    """A job of an address, under the name that its page gave it, and the flag that stops it."""

    future: Future[bytes]
    stop: StopFlag
    address: str
    name: str


class Worker:
    """Runs AT_A_TIME jobs on threads of its own, and stops jobs that nobody waits for."""

    def __init__(self) -> None:
        """Start idle."""
        self._threads = ThreadPoolExecutor(AT_A_TIME, thread_name_prefix='plan')
        # In their order.
        self._jobs: list[Waiting] = []

    async def run(
        self, job: Job, gone: asyncio.Task[None], address: str = '', name: str = ''
    ) -> bytes:
        """Return what a job returns; the flag that it gets is raised once `gone` is done.

        Raises PlayError where too many jobs wait (503) and where the job was stopped (499), and
        what the job raises.
        """
        waiting = self.waiting()
        own = sum(one.address == address for one in waiting)
        if len(waiting) >= MAX_WAITING or own >= MAX_OF_ONE:
            count = f'{len(waiting)} plans are waiting, {own} of this address'
            raise PlayError(f'busy: {count}; ask again in a moment', status=503)
        stop = no_stop()
        entry = Waiting(self._threads.submit(job, stop), stop, address, name)
        self._jobs.append(entry)
        try:
            answer = asyncio.wrap_future(entry.future)
            both: set[asyncio.Future[Any]] = {answer, gone}
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
            if answer.done():
                return answer.result()
            raise PlayError('the page has asked anew', status=499)
        finally:
            stop[0] = 1
            entry.future.cancel()
            self._jobs.remove(entry)

    def waiting(self) -> list[Waiting]:
        """Return the jobs that no thread has begun, in their order."""
        return [one for one in self._jobs if not (one.future.running() or one.future.done())]

    def queue(self, name: str) -> dict[str, int]:
        """Return how many jobs run and wait, and the place of a page's own, 0 if none waits."""
        waiting = self.waiting()
        places = [place for place, one in enumerate(waiting, 1) if one.name == name]
        running = len(self._jobs) - len(waiting)
        return {'running': running, 'waiting': len(waiting), 'place': max(places, default=0)}

    def close(self) -> None:
        """Stop what is running, drop what waits, and end the threads."""
        for one in self._jobs:
            one.stop[0] = 1
        self._threads.shutdown(wait=False, cancel_futures=True)

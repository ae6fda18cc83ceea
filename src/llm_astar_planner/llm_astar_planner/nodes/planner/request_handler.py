"""Answers questions: reads them, has them planned, and publishes what came of it."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.diagnostics import PlanReport
from llm_astar_msgs_adapter.messages.path import path_to_message
from nav_msgs.msg import Path
from rclpy.node import Node

from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.planner.diagnostics import PlanStatistics
from llm_astar_planner.nodes.planner.map_manager import MapManager
from llm_astar_planner.nodes.planner.paths import Paths
from llm_astar_planner.nodes.planner.preemption import CancellationToken
from llm_astar_planner.nodes.planner.publishers import PlanPublisher
from llm_astar_planner.nodes.planner.request_conversion import (
    Ends,
    PlanGoal,
    RequestConverter,
    RequestError,
)
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.recall import Recall
from llm_astar_planner.planning.report import failure_report, plan_report
from llm_astar_planner.planning.types import Plan, ResultCode
from llm_astar_planner.search.guided import AnytimeSolution

# What of the planning time is left for the path's check and message: so many seconds, or a part.
FINISH_SECONDS, FINISH_SHARE = 0.1, 0.1
LEAST_SECONDS = 0.001
# What a canceled question may take to end, in seconds, before it is left behind.
LONGEST_END = 2.0
INACTIVE = 'the node is not active: configure and activate it (lifecycle)'


@dataclass(frozen=True, eq=False)
class Answer:
    """What a caller gets: a path, empty unless `code` is NONE, a sentence, the seconds it took."""

    path: Path
    code: ResultCode
    message: str
    seconds: float


@dataclass(frozen=True, eq=False)
class Standing:
    """The last path that was published: to which question, on which map, in which cells."""

    question: PlanGoal
    grid_map: GridMap
    plan: Plan


@dataclass(eq=False)
class _Job:
    """One question being answered, since `begin` (monotonic) and for `limit` seconds."""

    question: PlanGoal
    stamp: Time
    begin: float
    limit: float
    cancel: CancellationToken
    on_better: Callable[[], None]
    why: str

    def refuse_if_canceled(self) -> None:
        """Raise RequestError where the question was given up."""
        if self.cancel.reason:
            raise RequestError(ResultCode.TIMEOUT, f'canceled: {self.cancel.reason}')

    def may_wait(self) -> bool:
        """Tell whether there is time left. Raises RequestError where it was given up."""
        self.refuse_if_canceled()
        return time.monotonic() < self.begin + self.limit


class RequestHandler:
    """The work of the planner node: any number of questions at a time, from any thread."""

    def __init__(
        self,
        node: Node,
        settings: Parameters,
        maps: MapManager,
        reader: RequestConverter,
        *,
        recall: Recall,
        announcer: PlanPublisher,
    ) -> None:
        """Take the parts it works with."""
        self.is_active = False
        # Called where the map changed while a path was planned on the one before.
        self.on_outdated: Callable[[], None] = lambda: None
        # Called before a path is published that somebody has just asked for.
        self.on_publish: Callable[[], None] = lambda: None
        self.standing: Standing | None = None
        self._published: Path | None = None
        self.tally = PlanStatistics()
        self._running: set[CancellationToken] = set()
        self._ended = threading.Condition()
        self._node = node
        self._settings = settings
        self._maps = maps
        self._reader = reader
        self._recall = recall
        self._announcer = announcer

    def answer(
        self,
        question: PlanGoal,
        cancel: CancellationToken | None = None,
        on_better: Callable[[], None] = lambda: None,
        why: str = '',
    ) -> Answer:
        """Plan, publish what came of it, and return it; never raises.

        `cancel` ends it from another thread: its code is TIMEOUT then, and nothing is published
        but the report. `on_better` is called at each better path on the way. `why` tells why the
        question is asked at all, where nobody has just asked it.
        """
        stamp = self._node.get_clock().now().to_msg()
        limit = self._settings['max_planning_time']
        job = _Job(
            question, stamp, time.monotonic(), limit, cancel or CancellationToken(), on_better, why
        )
        with self._running_until_told(job.cancel):
            return self._told(job)

    def _told(self, job: _Job) -> Answer:
        try:
            path, report = self._plan(job)
        except RequestError as error:
            path, report = self._nothing(job, error.code, str(error))
        except Exception as error:  # noqa: BLE001 - a robot waits for its answer
            self._node.get_logger().error(traceback.format_exc())
            message = f'{type(error).__name__} while planning: see the log'
            path, report = self._nothing(job, ResultCode.UNKNOWN, message)
        if job.why:
            report = replace(report, message=f'{job.why}; {report.message}')
        self._announcer.tell(report, job.stamp)
        self.tally.count(report)
        seconds = time.monotonic() - job.begin
        return Answer(path, ResultCode(report.code), report.message, seconds)

    def give_up(self, reason: str) -> None:
        """Cancel every question that is being answered, and wait until it is told."""
        with self._ended:
            for cancel in self._running:
                cancel(reason)
            self._ended.wait_for(lambda: not self._running, LONGEST_END)

    @contextmanager
    def _running_until_told(self, cancel: CancellationToken) -> Iterator[None]:
        with self._ended:
            self._running.add(cancel)
        try:
            yield
        finally:
            with self._ended:
                self._running.discard(cancel)
                self._ended.notify_all()

    def _nothing(self, job: _Job, code: ResultCode, message: str) -> tuple[Path, PlanReport]:
        planner = self._maps.planner
        frame_id = planner.grid_map.frame_id if planner else ''
        return path_to_message([], frame_id, job.stamp), failure_report(code, message)

    def _plan(self, job: _Job) -> tuple[Path, PlanReport]:
        """Answer a question. Raises RequestError where it never comes to a plan."""
        planner = self._maps.planner
        if not self.is_active:
            raise RequestError(ResultCode.UNKNOWN, INACTIVE)
        if planner is None:
            raise RequestError(ResultCode.UNKNOWN, 'no map has arrived yet')
        ends = self._reader.ends(job.question, planner.grid_map, job.may_wait)
        paths = self._paths(job, ends, planner.grid_map)
        plan, how = self._searched(job, ends, planner, paths)
        job.refuse_if_canceled()
        if plan is None:
            message = "out of time waiting for another caller's search of the same"
            raise RequestError(ResultCode.TIMEOUT, message)
        path = paths.final(plan)
        # A long path takes its time to write, and nothing is published after what came instead.
        job.refuse_if_canceled()
        if plan.code is ResultCode.NONE:
            self._publish(job, path)
            if self._announcer.wants_raw:
                self._announcer.publish_raw(paths.message(plan.path))
            self._keep(job, plan, planner)
        self._announcer.show(plan, planner.grid_map, job.stamp)
        report = plan_report(plan, planner.grid_map)
        if how:
            report = replace(report, message=f'{report.message}; {how}')
        return path, report

    def _keep(self, job: _Job, plan: Plan, planner: Planner) -> None:
        """Keep a published path, to look at it again when the ground changes."""
        if not self._settings['remember_plans']:
            self.standing = None
            return
        self.standing = Standing(job.question, planner.grid_map, plan)
        if self._maps.planner not in (None, planner):
            self.on_outdated()

    def _paths(self, job: _Job, ends: Ends, grid_map: GridMap) -> Paths:
        as_it_arrives = self._settings['use_final_approach_orientation']
        goal_yaw = None if as_it_arrives else ends.goals[-1].yaw
        return Paths(grid_map, job.stamp, ends.start.yaw, goal_yaw)

    def _searched(
        self, job: _Job, ends: Ends, planner: Planner, paths: Paths
    ) -> tuple[Plan | None, str]:
        wants = self._announcer.wants_expanded
        request = self._reader.request(job.question, ends, planner.grid_map, want_expanded=wants)
        finish = min(FINISH_SECONDS, FINISH_SHARE * job.limit)
        time_left = job.begin + job.limit - finish - time.monotonic()

        def publish_better(better: AnytimeSolution) -> None:
            path = None if job.cancel.reason else paths.message(better.path)
            if path is not None and not job.cancel.reason:
                self._publish(job, path)
                job.on_better()

        return self._recall.plan(
            planner, request, max(LEAST_SECONDS, time_left), job.cancel.stop, publish_better
        )

    def _publish(self, job: _Job, path: Path) -> None:
        """Publish a path, unless it was the last to be published, as a better one."""
        if not job.why:
            self.on_publish()
        if path is not self._published:
            self._published = path
            self._announcer.publish(path)

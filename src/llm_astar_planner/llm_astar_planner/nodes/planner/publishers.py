# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Publishes paths, reports, markers, and the state of the planner."""

import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from llm_astar_msgs_adapter.maps.grid_map import BORDER_TOLERANCE, GridMap, Pose2D
from llm_astar_msgs_adapter.messages import markers as drawing
from llm_astar_msgs_adapter.messages.writing import (
    path_to_message,
    report_to_message,
    status_to_message,
)
from nav_msgs.msg import GridCells, Path
from numpy.typing import ArrayLike
from visualization_msgs.msg import MarkerArray

from llm_astar_planner.nodes.common.entities import RELIABLE, REPORTS, Entities, LoggedThread
from llm_astar_planner.nodes.common.spin import RCLError
from llm_astar_planner.nodes.planner.goals import PlanResponse, PreemptingGoalSlot
from llm_astar_planner.planning.footprint_search import FootprintSearch
from llm_astar_planner.planning.path_validator import CollisionChecker, curve_cells
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.report import plan_report
from llm_astar_planner.planning.types import Plan, PlanRequest, Point
from llm_astar_planner.search.any_angle import interpolate
from llm_astar_planner.search.arrays import Float64s

# Reports that wait to be written, at most: a flood of goals waits for the oldest of them.
MAX_REPORTS = 32
LONGEST_WAIT = 1.0

NEWER_PATH = 'a newer path was published'
PERIOD_S = 1.0

# An end this near to the centre of its cell, in cells, is at it.
AT_CENTRE = 1e-9
# Ends of a path of one cell that are this near to each other, in cells, are the same place.
SAME_PLACE = 1e-3
# Points of a smooth path over which its ends are moved to where they have to be.
EASED = 10
# Where a path begins and ends exactly, [2] each; None: at the centre of its cell.
Ends = tuple[Float64s | None, Float64s | None]


@dataclass(eq=False)
class PathWriter:
    """Writes the paths of one goal as messages: one frame, one stamp, the same ends."""

    planner: Planner
    stamp: Time
    start: Pose2D
    goal: Pose2D
    keeps_heading: bool
    request: PlanRequest | None = None

    def __post_init__(self) -> None:
        """Place the ends on the planner's map, in whose frame `start` and `goal` are.

        With `keeps_heading` the last pose looks along the path instead of as `goal` does, and the
        only pose of a path of one as the start (Nav2's use_final_approach_orientation). The
        footprint of the `request` has to pass the ends too.
        """
        # In grid coordinates, and their cells.
        places = [self.start[:2], self.goal[:2]]
        self._ends = self.planner.grid_map.world_to_grid(places)
        self._cells = self.planner.grid_map.world_to_cells(places).tolist()
        self._goal_yaw = None if self.keeps_heading else self.goal.yaw
        self._fits: Callable[[Float64s], bool] | None = None
        if self.request is not None and self.request.footprint is not None:
            self._fits = FootprintSearch(self.planner.costmap, self.request).passes_ends
        self._last: tuple[Float64s, Path] | None = None

    def write(self, points: ArrayLike, *, is_smooth: bool = False) -> Path:
        """Write points [n, 2] in grid coordinates; equal points give the same message again.

        Where they begin in the start's cell and end in the goal's, the path begins and ends at
        those poses. A goal that was moved stays at the centre of its cell; where the start was,
        the robot's pose comes before the centre of the cell. A path that `is_smooth` stays so.
        """
        cells = np.asarray(points, dtype=np.float64)
        if self._last is not None and np.array_equal(self._last[0], cells):
            return self._last[1]
        grid_map, checker = self.planner.grid_map, self.planner.checker
        ends: Ends = None, None
        if len(cells):
            (start, goal), (begin, end) = self._ends, self._cells
            ends = (
                start if cells[0].tolist() == begin else None,
                goal if cells[-1].tolist() == end else None,
            )
            is_smooth &= self._fits is None
            if self._fits is not None:
                ends = ends_that_fit(cells, ends, checker, self._fits)
        to_ends = with_eased_ends if is_smooth else with_exact_ends
        places = grid_map.grid_to_world(to_ends(cells, *ends, checker))
        if ends[1] is not None:
            places[-1] = self.goal[:2]
        if ends[0] is not None:
            places[0] = self.start[:2]
        is_moved = bool(len(cells)) and cells[0].tolist() != self._cells[0]
        if is_moved:
            # The robot gets out of the obstacle first.
            places = np.concatenate(([self.start[:2]], places))
        starts_here = is_moved or ends[0] is not None or len(places) == 1
        start_yaw = self.start.yaw if starts_here else None
        path = path_to_message(places, grid_map.frame_id, self.stamp, self._goal_yaw, start_yaw)
        self._last = (cells, path)
        return path

    def write_plan(self, plan: Plan) -> Path:
        """Write a plan's path with one pose per cell, as controllers expect; return it."""
        if plan.smoothed is not None:
            return self.write(plan.smoothed, is_smooth=True)
        return self.write(
            plan.path if plan.any_angle is None else interpolate(plan.any_angle.points)
        )


def with_exact_ends(
    points: Float64s, start: Float64s | None, goal: Float64s | None, checker: CollisionChecker
) -> Float64s:
    """Return a path [n, 2] in grid coordinates that begins at `start` and ends at `goal`, [2].

    These lie in the cells of its first and its last point; None leaves an end as it is. A path of
    one cell leads from `start` straight to `goal`; where they are the same place it stays one
    point.
    """
    if len(points) == 1:
        ends = [end for end in (start, goal) if end is not None]
        if len(ends) == 2 and np.abs(ends[1] - ends[0]).max() <= SAME_PLACE:
            del ends[1]
        return np.array(ends) if ends else points
    if start is not None:
        points = with_exact_goal(points[::-1], start, checker)[::-1]
    return points if goal is None else with_exact_goal(points, goal, checker)


def with_eased_ends(
    points: Float64s, start: Float64s | None, goal: Float64s | None, checker: CollisionChecker
) -> Float64s:
    """Return a smooth path [n, 2] as `with_exact_ends` does, without a kink near its ends.

    The first and the last EASED points, at most a cell apart, are moved, the less the farther on.
    Where the path does not stay on free cells so, it is as `with_exact_ends` makes it.
    """
    eased, count = points.copy(), min(EASED, len(points) // 2)
    shares = (1.0 - np.arange(count) / max(count, 1))[:, None]
    if start is not None:
        eased[:count] += shares * (start - points[0])
    if goal is not None:
        eased[len(eased) - count :] += shares[::-1] * (goal - points[-1])
    eased = interpolate(eased)
    if count and checker.is_free_curve(eased):
        return eased
    return with_exact_ends(points, start, goal, checker)


def ends_that_fit(
    points: Float64s, ends: Ends, checker: CollisionChecker, fits: Callable[[Float64s], bool]
) -> Ends:
    """Return the ends with which a path [n, 2] `fits`: both if possible, else one of them."""
    start, goal = ends
    for kept in (ends, (None, goal), (start, None)):
        if fits(with_exact_ends(points, *kept, checker)):
            return kept
    return None, None


def with_exact_goal(points: Float64s, goal: Float64s, checker: CollisionChecker) -> Float64s:
    """Return a path [n, 2] that ends at `goal`, [2], which lies in the cell of its last point.

    The straight line to `goal` replaces the points in that cell if it passes through free cells
    alone. Else it leads on from the last point, which never leaves the cell.
    """
    if np.abs(points[-1] - goal).max() <= AT_CENTRE:
        return points
    last = len(points) - 1
    cell = cell_of(points[-1])
    while last > 0 and cell_of(points[last]) == cell:
        last -= 1
    line = interpolate(np.stack([points[last], goal])) + BORDER_TOLERANCE
    if not checker.is_free(curve_cells(line).astype(np.int64)):
        last = len(points) - 1
    return np.concatenate((points[: last + 1], goal[None]))


def cell_of(point: Float64s) -> tuple[int, int]:
    """Return the cell (x, y) of a point [2] in grid coordinates."""
    x, y = point.tolist()
    shift = 0.5 + BORDER_TOLERANCE
    return math.floor(x + shift), math.floor(y + shift)


class PlanPublisher:
    """The topics that plans are published on.

    Paths are published at once. Reports and markers are written on a thread of their own, so that
    no caller waits for them.
    """

    def __init__(self, entities: Entities, replans: PreemptingGoalSlot) -> None:
        """Make the publishers; a path that a client requested preempts those in `replans`."""
        self._replans = replans
        self._node = entities.node
        self._plan = entities.publisher(Path, 'plan', RELIABLE)
        self._raw_plan = entities.publisher(Path, '~/raw_plan', RELIABLE)
        self._alternatives = entities.publisher(Path, '~/alternatives', RELIABLE)
        self._report = entities.publisher(DiagnosticArray, '~/report', REPORTS)
        self._markers = entities.publisher(MarkerArray, '~/markers', RELIABLE)
        self._explored = entities.publisher(GridCells, '~/explored', RELIABLE)
        # How many want to see the expanded cells.
        self.count_viewers: Callable[[], int] = self._explored.get_subscription_count
        self._lock = threading.Lock()
        self._to_draw: tuple[Plan, GridMap, Time] | None = None
        self._published: Path | None = None
        self._free = threading.Semaphore(MAX_REPORTS)
        self._thread = LoggedThread(entities, 'publisher')

    def publish_path(self, path: Path, *, is_replan: bool) -> None:
        """Publish a path, unless this very message was the last one published."""
        if not is_replan:
            self._replans.cancel(NEWER_PATH)
        with self._lock:
            is_new, self._published = path is not self._published, path
        # To write thousands of poses takes as long as to find them.
        if is_new and self._plan.get_subscription_count():
            self._plan.publish(path)

    def publish_report(
        self, response: PlanResponse, stamp: Time, *, is_cancelled: bool, is_routine: bool = False
    ) -> None:
        """Publish and log the plan of a response.

        A failure that was somebody's wish is logged at debug level: on a map that changes at
        5 Hz, each replan may preempt the last. So is a path that `is_routine`, one a second.
        """
        self._free.acquire(timeout=LONGEST_WAIT)
        self._thread.run(self.write_report, response, stamp, is_cancelled, is_routine)

    def write_report(
        self, response: PlanResponse, stamp: Time, is_cancelled: bool, is_routine: bool
    ) -> None:
        """Publish and log the plan of a response now."""
        self._free.release()
        plan, planner = response.plan, response.planner
        report = plan_report(plan, planner.grid_map if planner else None, response.map_age)
        self._report.publish(report_to_message(report, self._node.get_name(), stamp))
        logger = self._node.get_logger()
        guide = [] if report.guided_by == 'none' else [f'guided by {report.guided_by}']
        said = '; '.join([report.summary, *guide, *plan.warnings])
        # A call each: rclpy refuses another severity from the same line.
        if report.code and is_cancelled:
            logger.debug(report.summary)
        elif report.code:
            logger.warning(report.summary)
        elif is_routine and not plan.warnings:
            logger.debug(said)
        else:
            logger.info(said)

    def publish_views(
        self, plan: Plan, grid_map: GridMap, stamp: Time, write: Callable[[ArrayLike], Path]
    ) -> None:
        """Publish the ways to choose from, and what only viewers want: raw path and markers.

        `write` makes the message of a path. Markers are drawn on the publisher's thread; a newer
        plan replaces one not drawn yet.
        """
        if len(plan.path) and self._raw_plan.get_subscription_count():
            self._raw_plan.publish(write(plan.path))
        for way in plan.alternatives:
            self._alternatives.publish(write(way.path))
        if not (self._markers.get_subscription_count() or self.count_viewers()):
            return
        with self._lock:
            is_waiting = self._to_draw is not None
            self._to_draw = (plan, grid_map, stamp)
        if not is_waiting:
            self._thread.run(self.draw)

    def draw(self) -> None:
        """Publish the markers and expanded cells of the newest plan."""
        with self._lock:
            newest, self._to_draw = self._to_draw, None
        if newest is None:
            return
        plan, grid_map, stamp = newest
        if self._markers.get_subscription_count():
            waypoints = [
                (point.x, point.y, point.status.value) for point in plan.checked_waypoints
            ]
            endpoints = (plan.start, plan.goal)
            markers = drawing.waypoints_to_markers(waypoints, grid_map, stamp, endpoints, plan.via)
            reasons = reasons_of(plan, grid_map)
            markers.markers += drawing.reasons_to_markers(reasons, grid_map.frame_id, stamp)
            self._markers.publish(markers)
        if self.count_viewers() and plan.expanded.size:
            self._explored.publish(drawing.expanded_to_message(plan.expanded, grid_map, stamp))


def reasons_of(plan: Plan, grid_map: GridMap) -> Iterator[tuple[str, list[Point]]]:
    """Yield the causes and ways of a plan by name, with their points in metres."""
    yield from () if plan.why is None else plan.why.places()
    for number, way in enumerate(plan.alternatives, start=1):
        yield f'way {number}', grid_map.grid_to_world(way.path).tolist()


class DiagnosticsPublisher:
    """Publishes the state at 1 Hz, and on request.

    It has a thread of its own: a monitor must see the node also while every other thread plans.
    """

    def __init__(
        self, entities: Entities, state: Callable[[], tuple[bool, str, dict[str, Any]]]
    ) -> None:
        """Start; `state` returns whether all is well, a sentence, and values by name."""
        self._node = entities.node
        self._state = state
        self._publisher = entities.publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self.run, name='diagnostics', daemon=True)
        self._thread.start()
        entities.on_close(self.close)

    def run(self) -> None:
        """Publish the state once a second until `close`, or until the context is shut down."""
        try:
            while not self._closed.wait(PERIOD_S):
                self.publish()
        except RCLError:
            if self._node.context.ok():
                raise

    def close(self) -> None:
        """End the thread."""
        self._closed.set()
        self._thread.join()

    def publish(self) -> None:
        """Publish the state now, where anybody listens: a robot may have no monitor."""
        if not self._publisher.get_subscription_count():
            return
        is_well, message, values = self._state()
        level = DiagnosticStatus.OK if is_well else DiagnosticStatus.WARN
        name = f'{self._node.get_fully_qualified_name()[1:]}: planner'
        stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(status_to_message(name, level, message, values, stamp))

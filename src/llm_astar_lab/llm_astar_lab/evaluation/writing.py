"""Bags that are written here: the samples of a dataset, and the plans of an evaluation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, replace
from itertools import groupby
from pathlib import Path

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.report import PlanReport
from numpy.typing import ArrayLike

from llm_astar_lab.bags import messages as bag_messages
from llm_astar_lab.bags.messages import (
    BARRIER_MAP,
    GET_PLAN_EVENT,
    MAP,
    NANOSECONDS,
    evaluation_topic,
)
from llm_astar_lab.bags.types import GET_PLAN_EVENT_TYPE, define
from llm_astar_lab.bags.writing import LATCHED, BagWriter, OfferedTopic, qos
from llm_astar_lab.datasets.samples import BenchmarkSample

GRID = 'nav_msgs/msg/OccupancyGrid'
# The time of a sample bag's first map; it is fixed, so that the same samples give the same bag.
FIRST_STAMP = 1_700_000_000 * NANOSECONDS
# The time from each map or request of a sample bag to the next.
STEP = NANOSECONDS
# How long barriers come before their map, and a map before the first plan on it.
LEAD = NANOSECONDS // 1000
# What is written of each plan, and its type.
RESULT_TYPES = {
    'plan': 'nav_msgs/msg/Path',
    'report': 'diagnostic_msgs/msg/DiagnosticArray',
    'markers': 'visualization_msgs/msg/MarkerArray',
}
# The size of the spheres that show waypoints, in cells.
MARKER_CELLS = 1.5


def write_sample_bag(
    samples: Iterable[BenchmarkSample], folder: str | Path, storage: str = 'mcap'
) -> dict[str, int]:
    """Write samples, in their order, as a bag; return the number of messages by topic.

    Each map is an OccupancyGrid, with its barriers as JSON just before it if it has any; each
    sample is a request of GetPlan, a second after the one before. The same samples give the same
    bag. Raises BagWriteError where the folder exists or the disk is full, OSError where the folder
    cannot be made.
    """
    with BagWriter(folder, storage) as bag:
        bag.add_topic(OfferedTopic(BARRIER_MAP, define('std_msgs/msg/String'), (LATCHED,)))
        bag.add_topic(OfferedTopic(MAP, define(GRID), (LATCHED,)))
        bag.add_topic(OfferedTopic(GET_PLAN_EVENT, define(GET_PLAN_EVENT_TYPE), (qos(),)))
        stamp, number = FIRST_STAMP, 0
        for _, of_map in groupby(samples, key=lambda sample: sample.barrier_map.id):
            group = list(of_map)
            problem = group[0].barrier_map
            if isinstance(problem, BarrierMap):
                whole = replace(problem, samples=tuple(sample.sample for sample in group))
                text = bag_messages.barrier_map_text(whole)
                bag.write_message(BARRIER_MAP, stamp - LEAD, text)
            grid_map = problem.to_grid()
            bag.write_message(MAP, stamp, bag_messages.occupancy_grid(grid_map, stamp))
            for sample in group:
                stamp += STEP
                number += 1
                cells = [problem.to_cell(sample.sample.start), problem.to_cell(sample.sample.goal)]
                start, goal = (Pose2D(*point) for point in grid_map.grid_to_world(cells).tolist())
                request = bag_messages.get_plan_request(
                    start, goal, grid_map.frame_id, stamp, number
                )
                bag.write_message(GET_PLAN_EVENT, stamp, request)
            stamp += STEP
    return bag.counts


class ResultsBag:
    """Writes the plans of an evaluation into a bag; a context manager that closes it.

    `/map` is written when it changes; for each method (with a source: both their names) there are
    `/evaluation/<method>/plan`, `/report` and `/markers`. Players show messages in order of their
    times, so the plans of all methods for one request come before those for the next.
    """

    def __init__(self, folder: str | Path, storage: str = 'mcap') -> None:
        """Prepare a new bag, `mcap` or `sqlite3`. Raises BagWriteError where `folder` exists."""
        self._bag = BagWriter(folder, storage)
        self._map_digest: str | None = None

    def __enter__(self) -> ResultsBag:
        """Make the folder. Raises OSError where that fails."""
        self._bag.__enter__()
        self._bag.add_topic(OfferedTopic(MAP, define(GRID), (LATCHED,)))
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._bag.__exit__(kind, error, trace)

    def add(
        self,
        method: str,
        source: str,
        grid_map: GridMap,
        stamp: int,
        *,
        points: ArrayLike,
        report: PlanReport,
    ) -> None:
        """Write a method's plan for the request at `stamp` (nanoseconds).

        `points` [n, 2] are the path in metres, empty where there is none; `source` is `none`
        where no source was asked. Raises BagWriteError where the disk is full or fails.
        """
        stamp = max(stamp, 0)
        if grid_map.digest != self._map_digest:
            before = max(stamp - LEAD, 0)
            self._bag.write_message(MAP, before, bag_messages.occupancy_grid(grid_map, before))
            self._map_digest = grid_map.digest
        frame, size = grid_map.frame_id, MARKER_CELLS * grid_map.resolution
        level, name = report.level[0], f'{method} {source}'
        messages = {
            'plan': bag_messages.path(points, frame, stamp),
            'report': bag_messages.status(name, level, report.summary, asdict(report), stamp),
            'markers': bag_messages.waypoint_markers(report.waypoints, size, frame, stamp),
        }
        for kind, message in messages.items():
            topic = evaluation_topic(method, source, kind)
            if topic not in self._bag.counts:
                self._bag.add_topic(OfferedTopic(topic, define(RESULT_TYPES[kind]), (qos(),)))
            self._bag.write_message(topic, stamp, message)

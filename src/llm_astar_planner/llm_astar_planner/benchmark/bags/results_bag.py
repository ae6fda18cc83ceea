"""The plans and reports of an evaluation as a bag, to look at and to evaluate again."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from types import TracebackType

from llm_astar_msgs_adapter.bags import messages as bag_messages
from llm_astar_msgs_adapter.bags.messages import MAP, evaluation_topic
from llm_astar_msgs_adapter.bags.types import define
from llm_astar_msgs_adapter.bags.writing import LATCHED, BagWriter, OfferedTopic, qos
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.report import PlanReport
from numpy.typing import ArrayLike

# What is written of each plan, and as what.
KINDS = {
    'plan': 'nav_msgs/msg/Path',
    'report': 'diagnostic_msgs/msg/DiagnosticArray',
    'markers': 'visualization_msgs/msg/MarkerArray',
}
# A map comes this many nanoseconds before the first plan on it.
LEAD = bag_messages.NANOSECONDS // 1000
# Waypoints are drawn as spheres so many cells wide.
MARKER_CELLS = 1.5


class ResultsBag:
    """Writes plans as they are made; a context manager that closes the bag at its end.

    `/map` is written when it changes, and for each method (with a source: both their names)
    `/evaluation/<method>/plan`, `/report` and `/markers`. Players show messages in order of
    their times, so plans come request by request, all methods of one together.
    """

    def __init__(self, folder: str | Path, storage: str = 'mcap') -> None:
        """Prepare a new bag, `mcap` or `sqlite3`. Raises BagWriteError where `folder` exists."""
        self._bag = BagWriter(folder, storage)
        self._map_digest = ''

    def __enter__(self) -> ResultsBag:
        """Make the folder. Raises OSError where that cannot be."""
        self._bag.__enter__()
        self._bag.add_topic(OfferedTopic(MAP, define('nav_msgs/msg/OccupancyGrid'), (LATCHED,)))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bag.__exit__(kind, error, trace)

    @property
    def counts(self) -> dict[str, int]:
        """The number of messages written, by topic."""
        return self._bag.counts

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
        """Write what a method made of the request at `stamp` (nanoseconds).

        `points` [n, 2] are the plan's in metres, none where there is no plan; `source` is `none`
        where none was asked. Raises BagWriteError where the disk refuses it.
        """
        stamp = max(stamp, 0)
        self._write_map(grid_map, max(stamp - LEAD, 0))
        frame, size = grid_map.frame_id, MARKER_CELLS * grid_map.resolution
        level, name = report.level[0], f'{method} {source}'
        messages = {
            'plan': bag_messages.path(points, frame, stamp),
            'report': bag_messages.status(name, level, report.summary, asdict(report), stamp),
            'markers': bag_messages.waypoint_markers(report.waypoints, size, frame, stamp),
        }
        for kind, message in messages.items():
            topic = evaluation_topic(method, source, kind)
            if topic not in self.counts:
                self._bag.add_topic(OfferedTopic(topic, define(KINDS[kind]), (qos(),)))
            self._bag.write_message(topic, stamp, message)

    def _write_map(self, grid_map: GridMap, stamp: int) -> None:
        """Write a map, unless it is the one written last."""
        if grid_map.digest == self._map_digest:
            return
        self._bag.write_message(MAP, stamp, bag_messages.occupancy_grid(grid_map, stamp))
        self._map_digest = grid_map.digest

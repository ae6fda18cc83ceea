"""The samples of a dataset as a bag: what a robot would have recorded of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from llm_astar_msgs_adapter.bags.messages import (
    BARRIER_MAP,
    GET_PLAN_EVENT,
    MAP,
    NANOSECONDS,
    barrier_map_text,
    get_plan_request,
    occupancy_grid,
)
from llm_astar_msgs_adapter.bags.types import GET_PLAN_EVENT_TYPE, define
from llm_astar_msgs_adapter.bags.writing import LATCHED, BagWriter, OfferedTopic, qos
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D

from llm_astar_planner.benchmark.datasets.samples import BenchmarkSample

# Any fixed time will do: the same samples give the same bag.
BEGIN = 1_700_000_000 * NANOSECONDS
# A map comes a second after what was before it, each of its requests a second after the last.
STEP = NANOSECONDS
# The barriers of a map come this much before it.
LEAD = NANOSECONDS // 1000


def write_sample_bag(
    samples: Iterable[BenchmarkSample], folder: str | Path, storage: str = 'mcap'
) -> dict[str, int]:
    """Write samples, in their order, as a bag; return the number of messages by topic.

    Each map is an OccupancyGrid, its barriers as JSON just before it where it has barriers; each
    sample a request of GetPlan. Times count from a fixed one, a second from each to the next.
    Raises BagWriteError where the folder exists or the disk takes no more, OSError where it cannot
    be made.
    """
    with BagWriter(folder, storage) as bag:
        for topic in _topics():
            bag.add_topic(topic)
        stamp, number = BEGIN, 0
        for _, of_map in groupby(samples, key=lambda sample: sample.barrier_map.id):
            group = list(of_map)
            grid_map = group[0].barrier_map.to_grid()
            _write_map(bag, group, grid_map, stamp)
            for sample in group:
                stamp += STEP
                number += 1
                start, goal = _ends(sample, grid_map)
                request = get_plan_request(start, goal, grid_map.frame_id, stamp, number)
                bag.write_message(GET_PLAN_EVENT, stamp, request)
            stamp += STEP
    return bag.counts


def _topics() -> tuple[OfferedTopic, ...]:
    return (
        OfferedTopic(BARRIER_MAP, define('std_msgs/msg/String'), (LATCHED,)),
        OfferedTopic(MAP, define('nav_msgs/msg/OccupancyGrid'), (LATCHED,)),
        OfferedTopic(GET_PLAN_EVENT, define(GET_PLAN_EVENT_TYPE), (qos(),)),
    )


def _write_map(
    bag: BagWriter, samples: list[BenchmarkSample], grid_map: GridMap, stamp: int
) -> None:
    bare = samples[0].barrier_map
    if isinstance(bare, BarrierMap):
        whole = replace(bare, samples=tuple(sample.sample for sample in samples))
        bag.write_message(BARRIER_MAP, stamp - LEAD, barrier_map_text(whole))
    bag.write_message(MAP, stamp, occupancy_grid(grid_map, stamp))


def _ends(sample: BenchmarkSample, grid_map: GridMap) -> tuple[Pose2D, Pose2D]:
    points = (sample.sample.start, sample.sample.goal)
    cells = [sample.barrier_map.to_cell(point) for point in points]
    start, goal = grid_map.grid_to_world(cells).tolist()
    return Pose2D(*start), Pose2D(*goal)

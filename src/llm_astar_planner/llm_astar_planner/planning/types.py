"""What a planner is asked and what it answers, in plain values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from operator import index
from typing import SupportsIndex

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.planning.waypoint_filter import CheckedWaypoint
from llm_astar_planner.search.any_angle import AnyAnglePath
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointReply,
    WaypointSource,
)

NOT_ASKED = WaypointReply(status=SourceStatus.NONE)


class ResultCode(IntEnum):
    """Result codes of nav2_msgs/ComputePathToPose, same numbers and meanings."""

    NONE = 0
    UNKNOWN = 200
    INVALID_PLANNER = 201
    TF_ERROR = 202
    START_OUTSIDE_MAP = 203
    GOAL_OUTSIDE_MAP = 204
    START_OCCUPIED = 205
    GOAL_OCCUPIED = 206
    TIMEOUT = 207
    NO_VALID_PATH = 208


@dataclass(frozen=True)
class PlanRequest:
    """One question to the planner: a way from start to goal, both cells (x, y).

    `time_limit` is seconds for everything, of which the source gets at most `source_time_limit`.
    `heuristic` and `weight` are for the paper's methods. The rest is for `guided`: it goes on
    until the path is proven within `max_suboptimality` (1 or more) of the shortest, or takes the
    first one where that is None; `search_while_waiting` starts it, after 30 ms at most, before the
    waypoints are there, which may then come too late to guide. `any_angle` adds a shortened path,
    `want_expanded` False spares the picture of expanded cells. `sample` names the benchmark
    sample, if it is one.

    Where the goal cannot be had, the nearest cell to it that can is taken, at most `tolerance`
    metres off; where the start is not free, the nearest free cell, at most `start_tolerance` off.
    `via` are cells the path must pass, in order. `instruction` is a wish in plain language of at
    most 500 characters: where the source answers it, its waypoints become `via`, else it is
    ignored; the plan says which. Raises ValueError on a start, goal or via that is no cell.
    """

    start: Cell
    goal: Cell
    method: str = 'guided'
    source: WaypointSource | None = None
    heuristic: str = 'euclidean'
    weight: float = 2.0
    time_limit: float = 5.0
    source_time_limit: float = float('inf')
    max_suboptimality: float | None = None
    search_while_waiting: bool = False
    any_angle: bool = False
    want_expanded: bool = True
    sample: SampleKey | None = None
    tolerance: float = 0.0
    start_tolerance: float = 0.0
    via: tuple[Cell, ...] = ()
    instruction: str = ''

    def __post_init__(self) -> None:
        """Take cells of any whole numbers, numpy's too. Raises ValueError on what is no cell."""
        object.__setattr__(self, 'start', _as_cell('start', self.start))
        object.__setattr__(self, 'goal', _as_cell('goal', self.goal))
        object.__setattr__(self, 'via', tuple(_as_cell('via', cell) for cell in self.via))


def _as_cell(name: str, cell: Sequence[SupportsIndex]) -> Cell:
    try:
        x, y = cell
        return index(x), index(y)
    except (TypeError, ValueError):
        raise ValueError(f'{name}: {cell!r} is no cell: two whole numbers (x, y)') from None


@dataclass(frozen=True, eq=False)
class Plan:
    """What came of a request.

    `path` is int32 [n, 2], cells (x, y), empty unless `code` is NONE; `length` and `cost` (with
    the price of occupancy) are in cells. The cost is proven to be at most
    `suboptimality_bound` times the least; NaN where the method proves nothing. `expansions`
    counts all expansions, `first_expansions` those up to the first path. `guided_by` names whose
    waypoints steered the search, `none` where nobody's did; `reply` is the source's whole answer.
    `expanded` is bool [height, width], empty where it was not wanted, of no use where the request
    was canceled.

    `start` and `goal` are the cells planned between, `start_shift` and `goal_shift` how many
    metres they lie off those asked for, and `warnings` a sentence on each such thing. Of the path,
    in metres: `unknown_length` through unknown cells, `clearance` the least distance from the
    centres of its cells to that of a lethal one (inf where there is none). `turns` are its changes
    of direction. `via` are the cells it passes because the request or the wish says so, and
    `instruction` tells what became of the wish, '' where none was made.
    """

    code: ResultCode
    message: str
    method: str
    start: Cell
    goal: Cell
    path: NDArray[np.int32]
    expanded: NDArray[np.bool_]
    waypoints: tuple[CheckedWaypoint, ...] = ()
    guided_by: str = 'none'
    source: str = 'none'
    reply: WaypointReply = NOT_ASKED
    expansions: int = 0
    first_expansions: int = 0
    storage: int = 0
    length: float = float('nan')
    cost: float = float('nan')
    suboptimality_bound: float = float('nan')
    any_angle: AnyAnglePath | None = None
    seconds_source: float = 0.0
    seconds_search: float = 0.0
    start_shift: float = 0.0
    goal_shift: float = 0.0
    unknown_length: float = 0.0
    clearance: float = float('inf')
    turns: int = 0
    warnings: tuple[str, ...] = ()
    via: tuple[Cell, ...] = ()
    instruction: str = ''

    @property
    def source_status(self) -> SourceStatus:
        """How asking the source went."""
        return self.reply.status

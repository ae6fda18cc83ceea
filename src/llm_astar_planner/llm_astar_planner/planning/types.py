# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a planner is asked and what it answers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import Enum, IntEnum
from operator import index
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import Pose2D

from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.parameters import PLANNER
from llm_astar_planner.search.arrays import Bools, Float64s, Int32s, Int64s
from llm_astar_planner.search.result import Cell, empty_path
from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointReply,
    WaypointSource,
)

if TYPE_CHECKING:
    from llm_astar_msgs_adapter.maps.places import Places

    from llm_astar_planner.costmap.costmap import Costmap
    from llm_astar_planner.instructions.interpretation import RouteInstruction
    from llm_astar_planner.instructions.outcome import InstructionOutcome
    from llm_astar_planner.search.any_angle import AnyAnglePath

# Via points of a request, at most: as poses of a message these are about 1 MB. How many can be
# planned through is a matter of the time limit.
MAX_VIA = 10_000
# Via points that may guide a search; it follows at most 256 of them, taken evenly.
MAX_VIAPOINTS = 1024
# The fields of a request that have the names and limits of parameters. A request says None where
# a parameter says 0.
CHECKED = ('method', 'heuristic', 'max_suboptimality', 'weight', 'tolerance', 'start_tolerance')
LIMITS = {item.name: replace(item, zero='') for item in PLANNER if item.name in CHECKED}
# Metres of the map's frame, [x, y].
Point = list[float]
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


class PlanningFailure(LlmAstarError, ValueError):  # noqa: N818 - an outcome, not a bug
    """Why there is no path: a sentence, and the result code that a caller acts on."""

    def __init__(self, code: ResultCode, message: str) -> None:
        """Take the code and the sentence."""
        super().__init__(message)
        self.code = code


class WaypointStatus(str, Enum):
    """What became of a waypoint."""

    ACCEPTED = 'accepted'
    OUT_OF_BOUNDS = 'out_of_bounds'
    OCCUPIED = 'occupied'
    UNREACHABLE = 'unreachable'


@dataclass(frozen=True)
class CheckedWaypoint:
    """A waypoint in grid coordinates, with its status."""

    x: float
    y: float
    status: WaypointStatus


class Endpoints(NamedTuple):
    """The cells to plan between, their distance in metres to those requested, and warnings."""

    start: Cell
    goal: Cell
    via: tuple[Cell, ...] = ()
    start_shift: float = 0.0
    goal_shift: float = 0.0
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class LastPath:
    """The way of a plan, for a later one to keep, perhaps on another map.

    `cells`: int32 [n, 2], single moves. `turns`: int64 [m], which of them straight lines at any
    angle join, if there are any. On its map, `first` is the point (x, y) in metres of the
    cell (0, 0), and `frame` the resolution, the yaw of the origin and the frame.
    """

    cells: Int32s
    turns: Int64s
    first: tuple[float, float]
    frame: tuple[float, float, str]


@dataclass(frozen=True)
class PlanRequest:
    """One request: a path from start to goal, both cells (x, y).

    - `method`: one of `search.methods.METHODS`, or a plug-in's name. `heuristic` and `weight` are
      for the paper's.
    - `source`: the waypoint source, or None to search without waypoints.
    - `time_limit`: seconds for everything; of these the source gets at most
      `source_time_limit`.
    - `first_path_time_limit`: seconds for a search without a path, where that is longer than
      `time_limit`, which then only ends improving; for each stretch between via points.
    - `max_suboptimality`: `guided` searches until its path is proven to cost at most this many
      times the cheapest, 1 or more; None takes its first path.
    - `search_while_waiting`: `guided` starts after 30 ms, even if the waypoints are not there
      yet. They may then come too late to be used.
    - `any_angle`: also return a path with straight segments at any angle. The search then gets
      90 % of the time; if the rest is too short for it, it is left out with a warning.
    - `smoothing`: also return the path, at any angle if that is asked for, with its kinks rounded.
    - `want_expanded`: whether the plan has the picture of expanded cells.
    - `sample`: which benchmark sample this is, if it is one.
    - `tolerance`, `start_tolerance`: metres. An unreachable goal or via point is replaced by the
      nearest reachable cell within `tolerance`, a blocked start by the nearest free cell within
      `start_tolerance`.
    - `via`: cells that the path must pass, in order, at most MAX_VIA. An unreachable one is
      replaced as the goal is.
    - `viapoints`: cells that guide the search as a source's waypoints do, instead of `source`: a
      reference route that the path need not pass. One that cannot be reached is replaced by the
      nearest cell within `tolerance` that can, or dropped. Ignored where there is `via`.
    - `last_path`: the way of the last plan to this goal. It is kept as far as it is left, valid
      and costs at most 1 + `switch_margin` times what the path found does.
    - `footprint`: the robot's polygon; a path that it cannot pass is not returned. It stands at
      `start_pose` and ends with `goal_yaw`, in metres and radians of the map's frame; None: as the
      path begins and ends. None of the three matters without a footprint.
    - `instruction`: what was understood of an instruction; the path keeps to it as far as
      possible, and the plan says clause by clause how far. Not together with `via`.
    - `allow_partial_planning`: where the goal cannot be reached, the path leads to the nearest
      point that can, and is marked as partial.
    - `alternatives`: how many ways that pass obstacles on different sides the plan has besides;
      none with via points, a footprint or an instruction.

    Raises ValueError if start, goal or any via point is not a pair of whole numbers.
    """

    start: Cell
    goal: Cell
    method: str = 'guided'
    source: WaypointSource | None = None
    heuristic: str = 'euclidean'
    weight: float = 2.0
    time_limit: float = 5.0
    source_time_limit: float = math.inf
    max_suboptimality: float | None = None
    search_while_waiting: bool = False
    any_angle: bool = False
    smoothing: bool = False
    want_expanded: bool = True
    sample: SampleKey | None = None
    tolerance: float = 0.0
    start_tolerance: float = 0.0
    via: tuple[Cell, ...] = ()
    instruction: RouteInstruction | None = None
    viapoints: tuple[Cell, ...] = ()
    footprint: Footprint | None = None
    start_pose: Pose2D | None = None
    goal_yaw: float | None = None
    last_path: LastPath | None = None
    switch_margin: float = 0.0
    first_path_time_limit: float = 0.0
    allow_partial_planning: bool = False
    alternatives: int = 0

    def __post_init__(self) -> None:
        """Turn any whole numbers, numpy's too, into cells. Raises ValueError otherwise."""
        given = {'start': (self.start,), 'goal': (self.goal,)}
        for name, cells in (given | {'via': self.via, 'viapoints': self.viapoints}).items():
            whole: list[Cell] = []
            try:
                for cell in cells:
                    x, y = cell
                    whole.append((index(x), index(y)))
            except (TypeError, ValueError):
                problem = f'{cell!r} is not a cell: two whole numbers (x, y)'
                raise ValueError(f'{name}: {problem}') from None
            object.__setattr__(self, name, whole[0] if name in given else tuple(whole))


def check_request(request: PlanRequest) -> None:
    """Raise PlanningFailure (INVALID_PLANNER) for a name or number that no map could serve."""
    problem = None
    for name, limits in LIMITS.items():
        value = getattr(request, name)
        if value is None or value in limits.choices:
            continue
        if limits.between is None or not limits.between[0] <= value <= limits.between[1]:
            problem = problem or limits.problem(value)
    for name in ('time_limit', 'first_path_time_limit', 'source_time_limit'):
        if math.isnan(getattr(request, name)):
            problem = f'{name}: not a number of seconds'
    if len(request.via) > MAX_VIA:
        problem = f'via: {len(request.via)} via points, over the {MAX_VIA} allowed'
    if len(request.viapoints) > MAX_VIAPOINTS:
        problem = f'viapoints: {len(request.viapoints)}, over the {MAX_VIAPOINTS} allowed'
    if problem:
        raise PlanningFailure(ResultCode.INVALID_PLANNER, problem)


# Codes of plans that say why there is no path.
EXPLAINED = (ResultCode.START_OCCUPIED, ResultCode.GOAL_OCCUPIED, ResultCode.NO_VALID_PATH)


class Alternative(NamedTuple):
    """One of several ways to choose from, the cheapest that passes obstacles on these sides.

    `path` is int32 [n, 2] cells, `length` in metres, `cost` in cells, at most `ratio` times the
    least of these sides. `around` are the centres, [x, y] in metres, of obstacles that the best
    way passes on the other side. `clearance` is in metres, None without obstacles.
    """

    path: Int32s
    length: float
    cost: float
    ratio: float
    around: list[Point]
    clearance: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the form of reports and `--json`, without the path."""
        return {name: value for name, value in self._asdict().items() if name != 'path'}


class Why(NamedTuple):
    """Why there is no path: a sentence, and what it says as values for reports.

    `causes` are objects with a `kind`; points are [x, y] in metres of the map's frame. `length`
    is that of the shortest path without the causes, in metres, None where walls close the way.
    `nearest` is the point that can be reached nearest to the goal, `short_of` metres off, None
    where the goal can, and `cell` its cell; with via points to the first of them that cannot,
    after the first `reached` ones.
    """

    sentence: str
    causes: list[dict[str, Any]]
    length: float | None
    nearest: Point | None
    short_of: float | None
    cell: Cell | None
    reached: int

    def to_json(self) -> dict[str, Any]:
        """Return the form of reports and `--json`."""
        return dict(zip(self._fields[:5], self))

    def places(self) -> Iterator[tuple[str, list[Point]]]:
        """Yield the name of each cause that lies somewhere, and its points in metres."""
        for cause in self.causes:
            points = [cause[end] for end in ('from', 'to', 'at') if end in cause]
            if points:
                yield cause.get('name') or cause['kind'], points


@dataclass(frozen=True, eq=False)
class Plan:
    """The answer to a request.

    - `code`, `message`: NONE and what was found, or why there is no path.
    - `path`: int32 [n, 2], cells (x, y); empty unless `code` is NONE. `length` and `cost` (with
      what occupied and inflated cells cost) are in cells.
    - `suboptimality_bound`: the cost is proven to be at most this many times the least possible;
      NaN if the method proves nothing.
    - `any_angle`: the path shortened at any angle, if requested, valid and found in time.
    - `smoothed`: float64 [m, 2], that path, or `path` where there is none, with rounded kinks, if
      requested and valid: points in cells, at most one apart.
    - `expansions`, `first_expansions`: all expansions, and those up to the first path.
      `storage`: the states that ever got a g (the paper's storage).
    - `expanded`: bool [height, width], the expanded cells; [0, 0] if not requested. Incomplete
      after a cancel.
    - `start`, `goal`: the cells planned between; `start_shift`, `goal_shift`: their distance in
      metres from those requested. `via`: the via points of the request, where they were moved to.
    - `source`: the name of the waypoint source; `reply`: its whole answer; `checked_waypoints`:
      its waypoints with what became of each; `guided_by`: the label of the source whose
      waypoints the search used, `none` if it used none.
    - `instruction`: what became of the instruction on this path, None if there was none.
    - `clearance`: metres from the path's cells to the nearest lethal cell, inf without one;
      `unknown_length`: metres of the path through unknown cells; `turns`: its changes of
      direction.
    - `seconds_source`, `seconds_search`: wall time; `seconds_map`: how long a node waited for a
      map before. `warnings`: one sentence each.
    - `footprint`: the polygon that the path was searched for, None for a circle.
    - `why`: what closes the way, where there is none. `partial`: the path leads to the nearest
      point that can be reached, not to the goal.
    - `alternatives`: ways that pass obstacles on different sides, the cheapest first.
    - `is_final`: False for a better path found while the search goes on.
    """

    code: ResultCode
    message: str
    method: str
    start: Cell
    goal: Cell
    expanded: Bools
    path: Int32s = field(default_factory=empty_path)
    checked_waypoints: tuple[CheckedWaypoint, ...] = ()
    guided_by: str = 'none'
    source: str = 'none'
    reply: WaypointReply = NOT_ASKED
    expansions: int = 0
    first_expansions: int = 0
    storage: int = 0
    length: float = math.nan
    cost: float = math.nan
    suboptimality_bound: float = math.nan
    any_angle: AnyAnglePath | None = None
    smoothed: Float64s | None = None
    seconds_source: float = 0.0
    seconds_search: float = 0.0
    seconds_map: float = 0.0
    start_shift: float = 0.0
    goal_shift: float = 0.0
    unknown_length: float = 0.0
    clearance: float = math.inf
    turns: int = 0
    warnings: tuple[str, ...] = ()
    via: tuple[Cell, ...] = ()
    instruction: InstructionOutcome | None = None
    footprint: Footprint | None = None
    is_final: bool = True
    why: Why | None = None
    partial: bool = False
    alternatives: tuple[Alternative, ...] = ()

    def _repr_png_(self) -> bytes | None:
        """Return the picture that a notebook shows.

        None for a copy of a plan, which is without its map, and without the laboratory.
        """
        # What only a notebook takes.
        from pathlib import Path  # noqa: PLC0415
        from tempfile import TemporaryDirectory  # noqa: PLC0415

        from llm_astar_msgs_adapter.maps.places import NO_PLACES  # noqa: PLC0415

        from llm_astar_planner.instructions.route import Route  # noqa: PLC0415
        from llm_astar_planner.plugins import find_drawing  # noqa: PLC0415

        costmap, places = PLANNED_ON.get(self, (None, None))
        with suppress(ImportError, LlmAstarError), TemporaryDirectory() as folder:
            if costmap is not None:
                path = Path(folder, 'plan.png')
                route = Route(costmap, self.start, self.goal, places or NO_PLACES)
                find_drawing('plan').load()(self, route, (0, 0), str(path))
                return path.read_bytes()
        return None

    @property
    def source_status(self) -> SourceStatus:
        """How the query to the source went."""
        return self.reply.status

    def to_dict(self) -> dict[str, Any]:
        """Return everything but cells and arrays, by the names that files and messages use.

        Reports, `--json` and result rows pick from it by name. Numbers that are not finite are
        None; lengths are in cells, shifts and clearance in metres.
        """
        return {
            'code': int(self.code), 'code_name': self.code.name, 'message': self.message,
            'method': self.method, 'guided_by': self.guided_by, 'source': self.source,
            'source_status': self.source_status.value, 'source_detail': self.reply.detail,
            'operation': self.expansions, 'first_operation': self.first_expansions,
            'storage': self.storage, 'length': finite_or_none(self.length),
            'cost': finite_or_none(self.cost), 'ratio': finite_or_none(self.suboptimality_bound),
            'seconds_source': self.seconds_source, 'seconds_search': self.seconds_search,
            'seconds_map': self.seconds_map, 'start_shift': self.start_shift,
            'goal_shift': self.goal_shift, 'unknown_length': self.unknown_length,
            'clearance': finite_or_none(self.clearance), 'turns': self.turns,
            'footprint': '' if self.footprint is None else str(self.footprint),
            'warnings': self.warnings,
            'instruction': self.instruction.summary() if self.instruction else '',
            'instruction_report': self.instruction.to_json() if self.instruction else None,
            'why': self.why.to_json() if self.why else None, 'partial': self.partial,
            'alternatives': tuple(way.to_json() for way in self.alternatives),
        }  # fmt: skip


# What `Planner.plan` planned on, while its plan lives.
PLANNED_ON: WeakKeyDictionary[Plan, tuple[Costmap, Places | None]] = WeakKeyDictionary()


def describe_expansions(count: int) -> str:
    """Return a count of expansions as text: '1 expansion', '82,264 expansions'."""
    return f'{count:,} expansion{"" if count == 1 else "s"}'


def finite_or_none(value: float) -> float | None:
    """Return a number, or None for NaN and infinity, which JSON does not have."""
    return value if math.isfinite(value) else None

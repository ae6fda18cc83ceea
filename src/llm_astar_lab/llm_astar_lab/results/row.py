# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The record of one sample planned with one variant, and how its columns are written."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_planner.search.any_angle import turning_points
from llm_astar_planner.waypoints.source import SourceStatus
from numpy.typing import NDArray

# The method that takes the waypoints themselves as the path, called `llm_only` up to 0.1.0.
WAYPOINTS_ONLY = 'waypoints_only'
METHOD_ALIASES = {'llm_only': WAYPOINTS_ONLY}
# The order of a report: methods as in the paper, and models before the baseline sources.
METHOD_ORDER = (
    'astar', 'exact_astar', 'weighted_astar', 'dynamic_weighted_astar', WAYPOINTS_ONLY,
    'llm_astar', 'guided',
)  # fmt: skip
BASELINE_SOURCES = ('none', 'coarse', 'straight', 'oracle', 'noisy', 'random', 'reversed')
# Source statuses that a second query would not change.
FINAL_STATUSES = frozenset(
    status.value for status in SourceStatus if status.is_answer or status is SourceStatus.NONE
)


class ResultsError(LlmAstarError, RuntimeError):
    """A results folder cannot be read, written or resumed; the message names the file."""


class Variant(NamedTuple):
    """What is compared: a method with a waypoint source, its prompt and its model."""

    method: str
    source: str = 'none'
    prompt: str = ''
    model: str = ''

    def __str__(self) -> str:
        """Return method/source/prompt/model without the empty parts."""
        return '/'.join(part for part in self if part)

    @property
    def is_baseline(self) -> bool:
        """Whether its waypoints come from no model."""
        return self.source in BASELINE_SOURCES

    @property
    def is_learned(self) -> bool:
        """Whether its waypoints come from the embedded model: learned, but not an LLM."""
        return self.source.startswith('embedded')

    @property
    def report_order(self) -> tuple[int, str, bool, int, str]:
        """The sort key of reports: methods as in the paper, models before baselines."""
        known = self.method in METHOD_ORDER
        method = METHOD_ORDER.index(self.method) if known else len(METHOD_ORDER)
        source = BASELINE_SOURCES.index(self.source) if self.is_baseline else -1
        return method, self.method, self.is_baseline, source, str(self)


# The paper's A*, to which every ratio refers.
PAPER_ASTAR = Variant('astar')


@dataclass(frozen=True, slots=True)
class Row:
    """One sample planned with one variant: a line of results.csv, whose columns are the fields.

    `code` is the name of the result code. `operation` (expansions), `storage` and `length` (cells)
    are NaN where the variant has none. `waypoints` and `path` (its turning points) are cells
    `x,y` joined by `;`, and `verdicts` are the statuses of the waypoints.
    `seconds_round_trip` is the time of a call through the running graph, NaN without a graph.
    `first_operation` counts the expansions up to the first path. `ratio` is the suboptimality
    bound that was proven, NaN where the method proves none. `clearance` and `unknown_length` are
    in metres, `turns` counts changes of direction. `instruction` says what became of each clause
    of an instruction; `instruction_satisfied` is 1 if all of it was understood and satisfied, 0
    if not, NaN where nothing was asked. `reply_problems` are the names of what is wrong with a
    model's reply, joined by `;`: `none` where nothing is, empty where no model replied.
    `seconds_reply` is how long the model took when its reply was recorded. `family` is the family
    of the map, such as `rooms`, empty where it is unknown.

    For a request from a bag: the bag's name, the index of the request in it, its time (seconds
    since 1970) and the digest of the map at that time. `recorded_*` is the result of the planner
    that was running on the robot: its result code and waypoints where it was this planner, length
    (cells) and turning points of its path, why that path is invalid on this map, and what became
    of its instruction. They are empty where nothing was recorded.
    """

    map: int
    pair: int
    scale: int
    method: str
    source: str
    prompt: str
    model: str
    code: str
    operation: float = math.nan
    storage: float = math.nan
    length: float = math.nan
    seconds_source: float = 0.0
    seconds_search: float = 0.0
    source_status: str = 'NONE'
    guided_by: str = 'none'
    prompt_tokens: int = 0
    completion_tokens: int = 0
    waypoints: str = ''
    verdicts: str = ''
    path: str = ''
    seconds_round_trip: float = math.nan
    first_operation: float = math.nan
    ratio: float = math.nan
    clearance: float = math.nan
    turns: float = math.nan
    unknown_length: float = math.nan
    bag: str = ''
    request: int = 0
    stamp: float = math.nan
    map_digest: str = ''
    recorded_code: str = ''
    recorded_length: float = math.nan
    recorded_problem: str = ''
    recorded_waypoints: str = ''
    recorded_path: str = ''
    instruction: str = ''
    instruction_satisfied: float = math.nan
    recorded_instruction: str = ''
    recorded_instruction_satisfied: float = math.nan
    reply_problems: str = ''
    family: str = ''
    seconds_reply: float = math.nan

    @property
    def variant(self) -> Variant:
        """The variant that was run."""
        return Variant(self.method, self.source, self.prompt, self.model)

    @property
    def key(self) -> tuple[int, int, int, Variant]:
        """Map, pair, scale and variant, unique within a run."""
        return self.map, self.pair, self.scale, self.variant

    @property
    def found(self) -> bool:
        """Whether there is a valid path."""
        return self.code == 'NONE'

    @property
    def answered(self) -> bool:
        """Whether the source answered, usefully or not, or no source was asked."""
        return self.source_status in FINAL_STATUSES


COLUMNS = {field.name: str(field.type) for field in dataclasses.fields(Row)}


# The columns that results of earlier versions do not have.
ADDED_COLUMNS = (
    'instruction', 'instruction_satisfied', 'recorded_instruction',
    'recorded_instruction_satisfied', 'reply_problems', 'family', 'seconds_reply',
)  # fmt: skip


# The columns that a plan fills, by the names of `Plan.to_dict()` and of reports.
PLAN_COLUMNS = (
    'operation', 'storage', 'seconds_source', 'seconds_search', 'source_status', 'guided_by',
    'ratio', 'instruction',
)  # fmt: skip


# The columns that it fills only if a path was found.
PATH_COLUMNS = ('length', 'first_operation', 'clearance', 'turns', 'unknown_length')


def plan_columns(
    values: Mapping[str, Any], statuses: Iterable[str], path: NDArray[np.int32]
) -> dict[str, Any]:
    """Return the columns of a row that describe a plan.

    `values` is `Plan.to_dict()` or the fields of a report with its length in cells; `statuses`
    are those of the waypoints, `path` the cells [n, 2]. A number that is None is unknown, except
    that a clearance of None is infinite.
    """
    names = PLAN_COLUMNS + (PATH_COLUMNS if values['code'] == 0 else ())
    columns: dict[str, Any] = {
        'code': values['code_name'],
        'verdicts': ';'.join(statuses),
        'path': format_points(turning_points(path)),
    }
    for name in names:
        unknown = math.inf if name == 'clearance' else math.nan
        value = unknown if values[name] is None else values[name]
        columns[name] = float(value) if COLUMNS[name] == 'float' else value
    columns['instruction_satisfied'] = satisfied_column(values['instruction_report'])
    return columns


def satisfied_column(report: Mapping[str, Any] | None) -> float:
    """Return 1 if a report says that an instruction is satisfied, 0 if not, NaN without one."""
    satisfied = None if report is None else report.get('satisfied')
    return math.nan if satisfied is None else float(satisfied is True)


def parse_points(text: str) -> tuple[tuple[float, float], ...]:
    """Read the points of a row, `x,y` joined by `;`. Raises ValueError."""
    points = (item.split(',') for item in text.split(';') if item)
    return tuple((float(x), float(y)) for x, y in points)


def format_points(points: Iterable[Iterable[float]]) -> str:
    """Write points as rows store them; `parse_points` is the inverse."""
    return ';'.join(','.join(f'{value:g}' for value in point) for point in points)


def cells_along(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return the cells [m, 2] along a polyline through points [n, 2], in steps of one cell."""
    corners = np.rint(points).astype(np.int32)
    segments = [corners[:1]]
    for begin, end in pairwise(corners):
        steps = int(np.abs(end - begin).max())
        parts = np.arange(1, steps + 1)[:, None] / max(steps, 1)
        segments.append(np.rint(begin + parts * (end - begin)).astype(np.int32))
    return np.concatenate(segments)

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The fields of plan reports and of exchanges with a waypoint source, as plain values."""

from collections import Counter
from dataclasses import MISSING, dataclass, fields
from typing import Any, TypeVar

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import parse_json

# The levels of diagnostic_msgs/DiagnosticStatus.
OK, WARN, ERROR = b'\x00', b'\x01', b'\x02'


class ReportError(LlmAstarError, ValueError):
    """A diagnostic message that is not a report of the expected kind; names the field."""


@dataclass(frozen=True)
class PlanReport:
    """The figures of one plan, besides its path.

    `code` and `code_name` are Nav2's. `length` is in metres, None without a path. The path costs
    at most `ratio` times the least possible cost, None where no bound is proven. `operation`
    counts all expansions, `first_operation` those up to the first path, `storage` the states
    stored. `waypoints` are (x, y, status), in metres in the map's frame. `seconds_*` are wall
    clock. `map_digest` names the map that was planned on, which a node had received `map_age`
    seconds before; it had waited for it for `seconds_map`. `zones` are those of its zones that lie
    on it, the first 20.

    `start_shift` and `goal_shift` (m) are how far start and goal were moved to a free cell.
    `unknown_length` (m) is the part of the path through unknown cells, `clearance` (m) its
    smallest distance to a lethal cell, None where there is none. `turns` counts the path's
    changes of direction. `footprint` describes the robot's polygon, '' for a robot that is planned
    for as a circle. `instruction` says in one line what became of an instruction, '' where
    none was given; `instruction_report` says it clause by clause.
    """

    code: int
    code_name: str
    message: str
    method: str
    guided_by: str
    source: str
    source_status: str
    source_detail: str
    operation: int
    first_operation: int
    storage: int
    length: float | None
    ratio: float | None
    seconds_source: float
    seconds_search: float
    waypoints: tuple[tuple[float, float, str], ...]
    map_digest: str
    start_shift: float = 0.0
    goal_shift: float = 0.0
    unknown_length: float = 0.0
    clearance: float | None = None
    turns: int = 0
    footprint: str = ''
    warnings: tuple[str, ...] = ()
    instruction: str = ''
    map_age: float | None = None
    seconds_map: float = 0.0
    zones: tuple[str, ...] = ()
    instruction_report: dict[str, Any] | None = None
    why: dict[str, Any] | None = None
    partial: bool = False
    alternatives: tuple[dict[str, Any], ...] = ()

    @property
    def level(self) -> bytes:
        """OK for a plan, ERROR for none.

        WARN for one with warnings, without its source, or that does not satisfy its instruction.
        """
        if self.code != 0:
            return ERROR
        is_guided = self.source_status in ('OK', 'NONE')
        is_violated = (self.instruction_report or {}).get('satisfied') is False
        return OK if is_guided and not self.warnings and not is_violated else WARN

    @property
    def summary(self) -> str:
        """One line for a person; the code is named only where there is no path."""
        text = f'path found: {self.message}'
        if self.code:
            text = f'no path: {self.message} [{self.code_name} {self.code}]'
        return replace_lone_surrogates(text)

    @property
    def waypoint_summary(self) -> str:
        """What became of the waypoints, for a person: whether any were asked for, came, helped."""
        detail = f': {self.source_detail}' if self.source_detail else ''
        if self.source_status == 'NONE':
            text = f'none asked{detail}'
        elif self.source_status == 'NO_WAYPOINTS':
            text = f'none: {self.source} suggests none{detail}'
        elif self.source_status == 'LATE':
            text = f'none in time{detail}'
        elif self.source_status != 'OK':
            text = f'none from {self.source}{detail} [{self.source_status}]'
        else:
            statuses = Counter(status.replace('_', ' ') for *_, status in self.waypoints)
            counts = ', '.join(f'{count} {status}' for status, count in statuses.items())
            name, end = self.source, '; the path was found without them'
            if self.guided_by != 'none':
                name, end = self.guided_by, ''
            shown = name if name == self.source else name.replace(':', ': ', 1)
            text = f'{counts or "none"}, from {shown}{end}'
        return replace_lone_surrogates(text)


@dataclass(frozen=True)
class ExchangeReport:
    """One exchange with a waypoint source: query, answer and cost. It holds no secrets.

    `messages` are (role, content). `waypoints` are (x, y) in grid coordinates; `unit` is how many
    cells one step of the reply's own coordinates was. `map_digest` and `pair` (`x0,y0->x1,y1` in
    cells) identify the query, so that the exchange can be replayed from a transcript.
    """

    label: str
    status: str
    detail: str
    model: str
    prompt: str
    text: str
    unit: int
    prompt_tokens: int
    completion_tokens: int
    seconds: float
    waypoints: tuple[tuple[float, float], ...]
    map_digest: str
    pair: str
    # The longest value is last, so that a list of all values shows the others first.
    messages: tuple[tuple[str, str], ...] = ()

    @property
    def level(self) -> bytes:
        """OK for an answer, WARN for none."""
        return OK if self.status in ('OK', 'NONE') else WARN

    @property
    def summary(self) -> str:
        """One line for a person."""
        if self.status == 'OK':
            text = f'{len(self.waypoints)} waypoints from {self.label}'
        else:
            text = f'no waypoints from {self.label}: {self.detail or "none given"} [{self.status}]'
        return replace_lone_surrogates(text)


Report = TypeVar('Report', PlanReport, ExchangeReport)


def report_from_message(message: Any, kind: type[Report]) -> Report:  # noqa: ANN401 - live or decoded
    """Read a diagnostic_msgs/DiagnosticArray that holds one report; unknown names are ignored.

    A missing field takes its default, as in reports written before the field existed. Raises
    ReportError where a field without a default is missing or a value is not JSON.
    """
    if len(message.status) != 1:
        raise ReportError(f'{kind.__name__}: {len(message.status)} statuses, not one')
    texts = {item.key: item.value for item in message.status[0].values}
    values: dict[str, Any] = {}
    for field in fields(kind):
        if field.name not in texts:
            if field.default is MISSING:
                raise ReportError(f'{kind.__name__}: {field.name}: is missing')
            continue
        try:
            values[field.name] = lists_to_tuples(parse_json(texts[field.name]))
        except (ValueError, RecursionError):
            raise ReportError(f'{kind.__name__}: {field.name}: is not JSON') from None
    return kind(**values)


def lists_to_tuples(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """Turn JSON lists into tuples, at every depth."""
    return tuple(map(lists_to_tuples, value)) if isinstance(value, list) else value


def replace_lone_surrogates(text: str) -> str:
    """Replace what UTF-8 cannot encode, since a model may reply with half a character."""
    return text.encode(errors='replace').decode()

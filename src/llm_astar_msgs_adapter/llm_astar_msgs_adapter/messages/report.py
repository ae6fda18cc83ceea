"""What plan reports and exchanges with a model hold, in plain values."""

from __future__ import annotations

from dataclasses import dataclass

# diagnostic_msgs/DiagnosticStatus's levels.
OK, WARN, ERROR = b'\x00', b'\x01', b'\x02'


@dataclass(frozen=True)
class PlanReport:
    """What a plan tells beside its path.

    `code` and `code_name` are Nav2's. `length` is in metres, None without a path. The path's cost
    is proven to be at most `ratio` times the least, None where nothing is proven. `operation`
    counts all expansions, `first_operation` those up to the first path. `waypoints` are
    (x, y, verdict), in metres in the map's frame. `seconds_*` are wall clock. `map_digest` names
    the map planned on.

    In metres too: how far start and goal were shifted to be plannable, how far the path runs
    through unknown cells, and its least distance to a lethal one, None where there is none.
    `turns` are its changes of direction. `instruction` tells what became of a wish in plain
    language, '' where none was made.
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
    warnings: tuple[str, ...] = ()
    instruction: str = ''

    @property
    def level(self) -> bytes:
        """OK for a plan as asked, WARN for one with warnings or no source, ERROR for no plan."""
        if self.code != 0:
            return ERROR
        fine = self.source_status in ('OK', 'NONE') and not self.warnings
        return OK if fine else WARN

    @property
    def summary(self) -> str:
        """One line for a person."""
        return _sayable(f'{self.code_name}: {self.message}')


@dataclass(frozen=True)
class ExchangeReport:
    """One exchange with a waypoint source: what was asked, answered and spent. No secrets.

    `messages` are (role, content), `waypoints` (x, y) in grid coordinates, `unit` the cells one
    step of the reply's own coordinates was. With `map_digest` and `pair` (`x0,y0->x1,y1` in
    cells) it can be replayed as a line of a transcript. `instruction` is the wish in plain
    language it was asked with, '' for none, and `instruction_outcome` what became of that.
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
    instruction: str = ''
    instruction_outcome: str = ''
    # Long, so last: who lists the values finds the answer before it.
    messages: tuple[tuple[str, str], ...] = ()

    @property
    def level(self) -> bytes:
        """OK for an answer, WARN for none."""
        fine = self.status in ('OK', 'NONE')
        return OK if fine else WARN

    @property
    def summary(self) -> str:
        """One line for a person."""
        count = f'{len(self.waypoints)} waypoints by {self.label}'
        return _sayable(f'{self.status}: {self.detail or count}')


def _sayable(words: str) -> str:
    """Return words as a message and a log can hold them: a model's may have half a character."""
    return words.encode(errors='replace').decode()

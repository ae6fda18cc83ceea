"""The protocol of waypoint sources and the plain values it trades in."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

from llm_astar_msgs_adapter.maps.grid_map import GridMap

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.prompts.message import Message

Waypoint = tuple[float, float]


class SampleKey(NamedTuple):
    """Which benchmark sample a request is: map id, index of the pair, scale of the map."""

    map: int | str
    pair: int | str
    scale: int = 1


class SourceStatus(str, Enum):
    """How asking for waypoints went."""

    OK = 'OK'
    NONE = 'NONE'  # no source was asked
    NO_WAYPOINTS = 'NO_WAYPOINTS'  # it answered, but with none
    NOT_CONFIGURED = 'NOT_CONFIGURED'
    UNREACHABLE = 'UNREACHABLE'
    TIMEOUT = 'TIMEOUT'
    AUTH = 'AUTH'
    MALFORMED = 'MALFORMED'  # it answered, but not with a list of points
    MISSING = 'MISSING'  # a replay without this exchange
    REFUSED = 'REFUSED'  # a limit or the endpoint said no
    ERROR = 'ERROR'
    LATE = 'LATE'  # the search was done before it answered


@dataclass(frozen=True)
class WaypointQuery:
    """One question to a source: a path from start to goal, both cells (x, y), on a costmap.

    A source may use the cells that the costmap leaves free, the same as the search.
    `time_limit` is how many seconds the answer may take. `sample` names the benchmark sample,
    where there is one. `instruction` is the caller's wish in plain language, '' for none.
    """

    costmap: Costmap
    start: tuple[int, int]
    goal: tuple[int, int]
    time_limit: float = float('inf')
    sample: SampleKey | None = None
    instruction: str = ''

    @property
    def grid_map(self) -> GridMap:
        """The map that the costmap was made from."""
        return self.costmap.grid_map


@dataclass(frozen=True)
class WaypointReply:
    """What a source answered: waypoints in grid coordinates (x, y), as it gave them, unjudged.

    `label` says who answered, such as `replay:gpt-3.5` or `none`. `text` is the raw reply,
    bounded; `detail` a sentence on what went wrong, if anything did. `messages` is what the model
    was asked, last of all; `unit` how many cells one step of its coordinates was.
    `instruction` is `followed` where the waypoints answer the wish, else why it was ignored; ''
    where none was made.
    """

    waypoints: tuple[Waypoint, ...] = ()
    label: str = 'none'
    status: SourceStatus = SourceStatus.OK
    detail: str = ''
    text: str = ''
    model: str = ''
    prompt: str = ''
    prompt_tokens: int = 0
    completion_tokens: int = 0
    seconds: float = 0.0
    messages: tuple[Message, ...] = ()
    unit: int = 1
    instruction: str = ''


class WaypointSource(Protocol):
    """Anything that can be asked for waypoints.

    `waypoints` never raises for what the outside world does: a failure is a reply with its
    status and no waypoints. It returns within `query.time_limit`.
    """

    @property
    def name(self) -> str:
        """The kind of source: `none`, `replay`, `endpoint`, `embedded`, ..."""

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Ask for waypoints. Thread-safe."""

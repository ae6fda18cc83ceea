# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The WaypointSource protocol, its plain values, and the sources by name, plug-ins included."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from llm_astar_msgs_adapter.errors import printable, raising, short_repr
from llm_astar_msgs_adapter.maps.grid_map import GridMap

from llm_astar_planner.plugins import PluginError, Plugins, call, checked_count, log_failure
from llm_astar_planner.search.arrays import StopFlag

if TYPE_CHECKING:
    from llm_astar_planner.costmap.costmap import Costmap

Waypoint = tuple[float, float]
# How a language model may be asked, and the formats that its replies may be asked for in.
MESSAGE, TURNS, COMPLETION = FORMS = ('message', 'turns', 'completion')
RESPONSE_FORMATS = ('text', 'json_object', 'json_schema')
# Which variables may hold a key, unless the start says otherwise.
KEY_NAMES = '*_API_KEY, *_TOKEN'
# Characters of the name of a model or a prompt, which stands in logs, tables and file names.
MAX_NAME = 200
# Why the source `auto` is not asked on a map.
SAVES_NOTHING = 'they save no time on such a map'
# More waypoints than any route needs; checking an unlimited number would take unlimited time.
MAX_WAYPOINTS = 1000


class SampleKey(NamedTuple):
    """Identifies a benchmark sample: map id, index of the start-goal pair, scale of the map."""

    map: int | str
    pair: int | str
    scale: int = 1


def live_key(map_digest: str, start: tuple[int, int], goal: tuple[int, int]) -> SampleKey:
    """Return the key of a query without a dataset: the map's digest, `x0,y0->x1,y1` in cells."""
    (x0, y0), (x1, y1) = start, goal
    return SampleKey(map_digest, f'{x0},{y0}->{x1},{y1}', 1)


class Message(NamedTuple):
    """One message of a chat: its role (`system`, `user` or `assistant`) and its text."""

    role: str
    content: str


class Provenance(NamedTuple):
    """What is known of how a model came to its reply; '' and None are unknown.

    `finish_reason` is why the model ended, as the server says: `length` is its token limit.
    `model_digest` is how the server identifies the exact model, its `system_fingerprint`;
    `prompt_digest` is the SHA-256 of the prompt's template, `dataset_digest` that of the dataset.
    `time` is when the reply was recorded, as ISO 8601.
    """

    finish_reason: str = ''
    model_digest: str = ''
    prompt_digest: str = ''
    dataset_digest: str = ''
    temperature: float | None = None
    seed: int | None = None
    time: str = ''


UNKNOWN_PROVENANCE = Provenance()


class SourceStatus(str, Enum):
    """Outcome of a query to a waypoint source."""

    OK = 'OK'
    NONE = 'NONE'  # no source was queried
    NO_WAYPOINTS = 'NO_WAYPOINTS'  # the answer is an empty list
    NOT_CONFIGURED = 'NOT_CONFIGURED'
    UNREACHABLE = 'UNREACHABLE'
    TIMEOUT = 'TIMEOUT'
    AUTH = 'AUTH'
    MALFORMED = 'MALFORMED'  # the answer holds no list of points
    MISSING = 'MISSING'  # the replayed transcript has no such exchange
    REFUSED = 'REFUSED'  # a limit of ours, or the endpoint, refused the request
    ERROR = 'ERROR'
    LATE = 'LATE'  # the search finished before the answer came

    @property
    def is_answer(self) -> bool:
        """Whether a model has answered, usefully or not: asking it again changes nothing."""
        return self.value in ('OK', 'NO_WAYPOINTS', 'MALFORMED')


def name_problem(name: str) -> str | None:
    """Say why a text cannot be the name of a model or a prompt; None where it can."""
    if len(name) <= MAX_NAME and name.isprintable():
        return None
    return f'{short_repr(name)} is no name of at most {MAX_NAME} printable characters'


@dataclass(frozen=True)
class WaypointQuery:
    """A query to a source: a path from start to goal, both cells (x, y), on a costmap.

    A source may use the cells that the costmap leaves free, the same as the search.
    `time_limit` is how many seconds the answer may take. `sample` names the benchmark sample, if
    it is one. `stop[0]` becomes 1 when nobody waits for the answer any more.
    """

    costmap: Costmap
    start: tuple[int, int]
    goal: tuple[int, int]
    time_limit: float = float('inf')
    sample: SampleKey | None = None
    stop: StopFlag | None = field(default=None, compare=False)

    @property
    def grid_map(self) -> GridMap:
        """The map that the costmap was made from."""
        return self.costmap.grid_map

    @property
    def live_key(self) -> SampleKey:
        """Key of the query without a dataset: the map's digest, and `x0,y0->x1,y1` in cells."""
        return live_key(self.grid_map.digest, self.start, self.goal)

    def random_generator(self, salt: str = '') -> np.random.Generator:
        """Return a generator seeded by `salt`, map, start and goal: the same for equal queries."""
        seed = f'{salt} {self.grid_map.digest} {self.start} {self.goal}'.lstrip()
        return np.random.default_rng(list(hashlib.sha256(seed.encode()).digest()))


@dataclass(frozen=True)
class WaypointReply:
    """A source's reply: waypoints (x, y) in grid coordinates, not yet checked.

    `label` names what answered, such as `replay:gpt-3.5` or `none`. `text` is the raw answer,
    bounded in length; `detail` is a sentence on what went wrong, '' if nothing did. `seconds` is
    how long the model took, 0 if unknown. `messages` are those that led to the answer; `unit` is
    the lattice step of its coordinates in cells.
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
    provenance: Provenance = UNKNOWN_PROVENANCE


class WaypointSource(Protocol):
    """Anything that can be queried for waypoints.

    `waypoints` does not raise for failures outside the program (network, endpoint, files): it
    returns a reply with a status and no waypoints. It returns within `query.time_limit`. Where a
    source also has `helps_on(costmap)`, it is asked only on costmaps for which that is true.
    One that has `service_is_ready()` is asked without a thread where that is false: it answers at
    once that nobody is there.
    """

    @property
    def name(self) -> str:
        """The kind of source: `none`, `replay`, `endpoint`, `embedded`, ..."""

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return waypoints for a query. Thread-safe."""


GROUP = 'llm_astar.waypoint_sources'
# Characters of a plug-in's texts that are kept.
MAX_TEXT, MAX_DETAIL = 100_000, 500
# Seconds that a model may be said to have taken: a day.
MAX_SECONDS = 86_400.0
# What the fields of a reply are, but for its waypoints.
COUNTS = ('prompt_tokens', 'completion_tokens', 'unit')
PLAIN: dict[str, type] = {
    **dict.fromkeys(('label', 'detail', 'text', 'model', 'prompt'), str),
    'status': SourceStatus,
    'messages': tuple,
    'provenance': Provenance,
}


def plugin_factory(
    name: str, factory: Callable[[Any], WaypointSource]
) -> Callable[[Any], WaypointSource]:
    """Return what makes the source of a plug-in of a SourceContext, by the plug-in's function.

    It raises PluginError where the function makes none.
    """

    def make(context: Any) -> WaypointSource:  # noqa: ANN401 - a SourceContext
        source = factory(context)
        if not callable(getattr(source, 'waypoints', None)):
            kind = type(source).__name__
            raise PluginError(f'its factory returned {kind}, which has no waypoints(query)')
        return PluginSource(name, source)

    def make_or_say_why(context: Any) -> WaypointSource:  # noqa: ANN401 - a SourceContext
        with raising(PluginError, f'source {name}: ', PluginError):
            return call(lambda: make(context))

    return make_or_say_why


@dataclass(frozen=True)
class PluginSource:
    """The source of a plug-in; its replies are checked and named after it.

    As of every source, a thread of a QueryQueue asks it, and a reply that comes late is dropped.
    """

    name: str
    inner: WaypointSource

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the plug-in's reply, or one with status ERROR that says why."""
        try:
            return call(lambda: plugin_reply(self.name, self.inner.waypoints(query)))
        except PluginError as error:
            log_failure(self.name, error)
            return WaypointReply(label=self.name, status=SourceStatus.ERROR, detail=str(error))


def plugin_reply(name: str, answer: object) -> WaypointReply:
    """Return a plug-in's reply named after it, its texts bounded. Raises PluginError."""
    reply = as_reply(answer)
    model, prompt = str(reply.model), str(reply.prompt)
    problem = name_problem(model) or name_problem(prompt)
    if problem:
        raise PluginError(f'model or prompt: {problem}')
    # It may yield without end.
    points = tuple(islice(reply.waypoints, MAX_WAYPOINTS + 1))
    detail, text = printable(str(reply.detail)[:MAX_DETAIL]), str(reply.text)[:MAX_TEXT]
    adopted = WaypointReply(
        points, name, SourceStatus(reply.status), detail, text, model, prompt,
        reply.prompt_tokens, reply.completion_tokens, reply.seconds,
    )  # fmt: skip
    return checked_reply(adopted)


def as_reply(answer: object) -> WaypointReply:
    """Return what a source has returned. Raises PluginError where that is no reply."""
    if isinstance(answer, WaypointReply):
        return answer
    raise PluginError(f'returned {type(answer).__name__}, not a WaypointReply')


def checked_reply(answer: object) -> WaypointReply:
    """Return a reply that is made of plain values, with at most MAX_WAYPOINTS waypoints.

    Its detail says if some were cut off. Raises PluginError, which names the field.
    """
    reply = as_reply(answer)
    for name, kind in PLAIN.items():
        if type(value := getattr(reply, name)) is not kind:
            raise PluginError(f'{name}: is a {type(value).__name__}, not a {kind.__name__}')
    counts: dict[str, Any] = {n: checked_count(getattr(reply, n), n) for n in COUNTS}
    if not (isinstance(reply.seconds, (int, float)) and 0 <= reply.seconds <= MAX_SECONDS):
        raise PluginError(f'seconds: {short_repr(reply.seconds)} is not a time of 0 or more')
    if not isinstance(reply.waypoints, (tuple, list, np.ndarray)):
        raise PluginError(f'waypoints: is a {type(reply.waypoints).__name__}, not a tuple')
    detail = reply.detail
    if len(reply.waypoints) > MAX_WAYPOINTS:
        cut = f'only its first {MAX_WAYPOINTS} waypoints'
        detail = f'{detail}; {cut}' if detail else cut
    points = tuple(map(checked_point, reply.waypoints[:MAX_WAYPOINTS]))
    return replace(reply, waypoints=points, detail=detail, **counts)


def checked_point(point: Any) -> Waypoint:  # noqa: ANN401 - of foreign code
    """Return a waypoint as two finite numbers, whole ones as they are. Raises PluginError."""
    try:
        x, y = map(float, () if isinstance(point, str | bytes | Set | Mapping) else point)
    except Exception:  # noqa: BLE001 - of foreign code
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise PluginError(f'waypoints: {short_repr(point)} is not two finite numbers (x, y)')
    is_plain = type(point) is tuple and {type(value) for value in point} <= {int, float}
    return point if is_plain else (x, y)


# The package's own by name, in the order in which they are listed; each is a function of a
# SourceContext.
HERE = 'llm_astar_planner.waypoints'
BASELINE_NAMES = ('coarse', 'straight', 'oracle', 'noisy', 'random', 'reversed')
SOURCES = Plugins(
    'source',
    GROUP,
    {
        'auto': f'{HERE}.config:AutoSource',
        'none': f'{HERE}.replay:NoSource',
        'embedded': f'{HERE}.learned:make_embedded',
        'replay': f'{HERE}.replay:make_replay',
        'endpoint': f'{HERE}.llm.source:make_endpoint',
        **dict.fromkeys(BASELINE_NAMES, f'{HERE}.baselines:make_baseline'),
    },
    plugin_factory,
    # What `bench` calls the embedded model's other rows.
    frozenset({'embedded-best-of-8'}),
)

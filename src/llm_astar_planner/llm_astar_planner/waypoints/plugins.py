# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The waypoint sources by name, and how those of other packages are called."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass
from itertools import islice
from typing import Any

from llm_astar_msgs_adapter.errors import printable, short_repr

from llm_astar_planner.plugins import PluginError, Plugins, call, checked_count, log_failure
from llm_astar_planner.waypoints.source import (
    MAX_WAYPOINTS,
    SourceStatus,
    Waypoint,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
    name_problem,
)

GROUP = 'llm_astar.waypoint_sources'
# Characters of a plug-in's texts that are kept.
MAX_TEXT, MAX_DETAIL = 100_000, 500
# Seconds that a model may be said to have taken: a day.
MAX_SECONDS = 86_400.0


@dataclass(frozen=True)
class PluginFactory:
    """Makes the source of a plug-in by its factory, a function of a SourceContext."""

    name: str
    factory: Callable[[Any], WaypointSource]

    def __call__(self, context: Any) -> WaypointSource:  # noqa: ANN401 - a SourceContext
        """Return the source. Raises PluginError where the factory makes none."""

        def make() -> WaypointSource:
            source = self.factory(context)
            if not callable(getattr(source, 'waypoints', None)):
                kind = type(source).__name__
                raise PluginError(f'its factory returned {kind}, which has no waypoints(query)')
            return source

        try:
            return PluginSource(self.name, call(make))
        except PluginError as error:
            raise PluginError(f'source {self.name}: {error}') from None


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
            return call(lambda: checked_reply(self.name, self.inner.waypoints(query)))
        except PluginError as error:
            log_failure(self.name, error)
            return WaypointReply(label=self.name, status=SourceStatus.ERROR, detail=str(error))


def checked_reply(name: str, reply: Any) -> WaypointReply:  # noqa: ANN401 - of foreign code
    """Return a plug-in's reply made of plain values, with at most MAX_WAYPOINTS waypoints.

    Raises PluginError, which names the field.
    """
    if not isinstance(reply, WaypointReply):
        raise PluginError(f'returned {type(reply).__name__}, not a WaypointReply')
    model, prompt = str(reply.model), str(reply.prompt)
    problem = name_problem(model) or name_problem(prompt)
    if problem:
        raise PluginError(f'model or prompt: {problem}')
    points = list(map(checked_point, islice(reply.waypoints, MAX_WAYPOINTS + 1)))
    detail = printable(str(reply.detail)[:MAX_DETAIL])
    if len(points) > MAX_WAYPOINTS:
        detail = '; '.join(filter(None, (detail, f'only its first {MAX_WAYPOINTS} waypoints')))
    return WaypointReply(
        tuple(points[:MAX_WAYPOINTS]),
        name,
        SourceStatus(reply.status),
        detail,
        str(reply.text)[:MAX_TEXT],
        model,
        prompt,
        checked_count(reply.prompt_tokens, 'prompt_tokens'),
        checked_count(reply.completion_tokens, 'completion_tokens'),
        checked_seconds(reply.seconds),
    )


def checked_point(point: Any) -> Waypoint:  # noqa: ANN401 - of foreign code
    """Return a waypoint as two finite floats. Raises PluginError."""
    try:
        x, y = map(float, () if isinstance(point, str | bytes | Set | Mapping) else point)
    except (TypeError, ValueError):
        x = math.nan
    else:
        if math.isfinite(x) and math.isfinite(y):
            return x, y
    raise PluginError(f'waypoints: {short_repr(point)} is not two finite numbers (x, y)')


def checked_seconds(value: Any) -> float:  # noqa: ANN401 - of foreign code
    """Return how long a model took. Raises PluginError."""
    if isinstance(value, (int, float)) and 0 <= value <= MAX_SECONDS:
        return float(value)
    raise PluginError(f'seconds: {short_repr(value)} is not a time of 0 or more')


# The package's own by name, in the order in which they are listed; each is a function of a
# SourceContext.
HERE = 'llm_astar_planner.waypoints'
BASELINE_NAMES = ('coarse', 'straight', 'oracle', 'noisy', 'random', 'reversed')
SOURCES = Plugins(
    'source',
    GROUP,
    {
        'auto': f'{HERE}.auto:AutoSource',
        'none': f'{HERE}.replay:make_none',
        'embedded': f'{HERE}.learned.source:make_embedded',
        'replay': f'{HERE}.replay:make_replay',
        'endpoint': f'{HERE}.llm.source:make_endpoint',
        **dict.fromkeys(BASELINE_NAMES, f'{HERE}.baselines:make_baseline'),
    },
    PluginFactory,
    # What `bench` calls the embedded model's other rows.
    frozenset({'embedded-best-of-8'}),
)

"""Make the waypoint source that the settings ask for."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from llm_astar_msgs_adapter.barrier_map import BarrierMap, load_barrier_maps

from llm_astar_planner.prompts.template import load_template
from llm_astar_planner.waypoint_source.base import WaypointSource
from llm_astar_planner.waypoint_source.cache import CachedSource
from llm_astar_planner.waypoint_source.chat_client import ChatClient
from llm_astar_planner.waypoint_source.credentials import Endpoint
from llm_astar_planner.waypoint_source.dialect import Dialect
from llm_astar_planner.waypoint_source.endpoint import EndpointSource
from llm_astar_planner.waypoint_source.limits import CallBudget
from llm_astar_planner.waypoint_source.none import NoSource
from llm_astar_planner.waypoint_source.recording import RecordingSource
from llm_astar_planner.waypoint_source.replay import ReplaySource
from llm_astar_planner.waypoint_source.retry import RetryPolicy
from llm_astar_planner.waypoint_source.settings import (
    DEFAULT_PROMPT,
    SettingsError,
    SourceSettings,
)
from llm_astar_planner.waypoint_source.transcript import TranscriptWriter

Maker = Callable[[SourceSettings], WaypointSource]


def make_source(
    settings: SourceSettings, more: Mapping[str, Maker] | None = None
) -> WaypointSource:
    """Make the source named by `settings.source`, with cache and recording around it.

    `more` adds kinds of source to the built-in none, replay and endpoint.
    Raises SettingsError naming the field, or ValueError naming the file that is wrong.
    """
    kinds = ('none', 'replay', 'endpoint', *(more or ()))
    if settings.source not in kinds:
        raise SettingsError(f'source: {settings.source!r} is none of {", ".join(kinds)}')
    settings.check()
    dataset = load_barrier_maps(settings.dataset) if settings.dataset else []
    if settings.source == 'endpoint':
        endpoint = make_endpoint_source(settings, dataset)
        return CachedSource(
            _recorded(endpoint, settings, dataset),
            model=settings.model,
            prompt=endpoint.template.name,
            size=settings.cache_size,
            timeout_s=settings.timeout_s,
        )
    if settings.source == 'replay':
        source: WaypointSource = ReplaySource(
            settings.transcript, settings.model, settings.prompt, dataset
        )
    elif settings.source == 'none':
        source = NoSource()
    else:
        source = (more or {})[settings.source](settings)
    return _recorded(source, settings, dataset)


def make_client(settings: SourceSettings) -> ChatClient:
    """Make the client of the endpoint alone. Raises SettingsError naming the field."""
    settings.check()
    return ChatClient(
        Endpoint(settings.base_url, settings.api_key_env),
        settings.model,
        Dialect(settings.max_output_tokens, settings.temperature, settings.response_format),
        RetryPolicy(settings.max_retries),
        CallBudget(settings.max_calls_per_hour, settings.max_tokens_per_day),
        max_concurrent=settings.max_concurrent,
    )


def make_endpoint_source(
    settings: SourceSettings, dataset: list[BarrierMap] | None = None
) -> EndpointSource:
    """Make the endpoint source without a cache around it. Raises SettingsError."""
    return EndpointSource(
        make_client(settings),
        load_template(settings.prompt or DEFAULT_PROMPT),
        timeout_s=settings.timeout_s,
        max_prompt_tokens=settings.max_prompt_tokens,
        repair_rounds=settings.repair_rounds,
        dataset=dataset,
    )


def client_of(source: WaypointSource) -> ChatClient | None:
    """Return the client below the wrappers of a source, for its state and its counts, or None."""
    inner: object = source
    while isinstance(inner, (CachedSource, RecordingSource)):
        inner = inner.inner
    return inner.client if isinstance(inner, EndpointSource) else None


def close_source(source: WaypointSource) -> None:
    """Close what a source made by `make_source` holds open; it may not be asked any more."""
    inner: object = source
    while isinstance(inner, (CachedSource, RecordingSource)):
        if isinstance(inner, RecordingSource):
            inner.close()
        inner = inner.inner


def _recorded(
    source: WaypointSource, settings: SourceSettings, dataset: list[BarrierMap]
) -> WaypointSource:
    if not settings.record:
        return source
    return RecordingSource(source, TranscriptWriter(settings.record), dataset)

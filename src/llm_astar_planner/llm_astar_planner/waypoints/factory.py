"""Make a waypoint source from settings, the same for nodes and command line."""

from __future__ import annotations

from collections.abc import Sequence

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

from llm_astar_planner.search.coarse import compile_kernels
from llm_astar_planner.waypoints.baselines import baseline_sources
from llm_astar_planner.waypoints.cache import CachedSource
from llm_astar_planner.waypoints.config import DEFAULT_PROMPT, SettingsError, SourceSettings
from llm_astar_planner.waypoints.fixed import NoSource
from llm_astar_planner.waypoints.learned.network import packaged_weights
from llm_astar_planner.waypoints.learned.source import EmbeddedSource
from llm_astar_planner.waypoints.llm.client import ChatClient
from llm_astar_planner.waypoints.llm.credentials import Endpoint
from llm_astar_planner.waypoints.llm.protocol import Dialect
from llm_astar_planner.waypoints.llm.resilience import CallBudget
from llm_astar_planner.waypoints.llm.source import EndpointSource
from llm_astar_planner.waypoints.prompts.template import load_template
from llm_astar_planner.waypoints.replay import ReplaySource
from llm_astar_planner.waypoints.source import WaypointSource
from llm_astar_planner.waypoints.transcript import RecordingSource, TranscriptWriter

Dataset = Sequence[BarrierMap] | None
# How many seconds a request that missed its deadline may go on, to answer the next query.
LATE_S = 60.0


def make_source(settings: SourceSettings, dataset: Dataset = None) -> WaypointSource:
    """Make the source that `settings` name; `dataset` lets samples be recognised by their cells.

    Raises SettingsError for wrong settings, and what the source raises for its files.
    """
    settings.check()
    if settings.source == 'none':
        return NoSource()
    if settings.source == 'embedded':
        # Read the weights now, so that a broken file is reported here and not at the first query.
        packaged_weights()
        return EmbeddedSource(settings.candidates)
    if settings.source == 'replay':
        if not settings.transcript:
            raise SettingsError(
                'transcript: name the JSON Lines file that source replay answers from'
            )
        return ReplaySource(settings.transcript, settings.model, settings.prompt, dataset)
    if settings.source == 'endpoint':
        return make_endpoint_source(settings, dataset)
    if settings.source == 'coarse':
        compile_kernels()
    return baseline_sources()[settings.source]


def make_endpoint_source(settings: SourceSettings, dataset: Dataset) -> WaypointSource:
    """Make the source that asks a language model, with a cache and, if set, a recording."""
    client = make_client(settings)
    template = load_template(settings.prompt or DEFAULT_PROMPT)
    source: WaypointSource = EndpointSource(
        client,
        template,
        timeout_s=settings.timeout_s,
        max_prompt_tokens=settings.max_prompt_tokens,
        repair_rounds=settings.repair_rounds,
        late_s=LATE_S,
        dataset=dataset,
    )
    if settings.record:
        source = RecordingSource(source, TranscriptWriter(settings.record), dataset)
    return CachedSource(
        source,
        model=settings.model,
        prompt=template.name,
        size=settings.cache_size,
        timeout_s=settings.timeout_s,
    )


def make_client(settings: SourceSettings) -> ChatClient:
    """Make the client of the endpoint that settings name. Raises EndpointError."""
    return ChatClient(
        Endpoint(settings.base_url, settings.api_key_env),
        settings.model,
        Dialect(settings.max_output_tokens, settings.temperature, settings.response_format),
        settings.max_retries,
        CallBudget(settings.max_calls_per_hour, settings.max_tokens_per_day),
        max_concurrent=settings.max_concurrent,
    )


def client_of(source: WaypointSource) -> ChatClient | None:
    """Return the endpoint's client inside a source, for its state and counts, or None."""
    inner: object = source
    while isinstance(inner, (CachedSource, RecordingSource)):
        inner = inner.inner
    return inner.client if isinstance(inner, EndpointSource) else None

"""Make a source that asks a language model at an endpoint, and the client that it asks with."""

from __future__ import annotations

from llm_astar_planner.waypoints.cache import CachedSource
from llm_astar_planner.waypoints.config import DEFAULT_PROMPT, SourceSettings
from llm_astar_planner.waypoints.llm.client import ChatClient
from llm_astar_planner.waypoints.llm.credentials import Endpoint
from llm_astar_planner.waypoints.llm.protocol import Dialect
from llm_astar_planner.waypoints.llm.resilience import CallBudget
from llm_astar_planner.waypoints.llm.source import EndpointSource
from llm_astar_planner.waypoints.plugins import SourceContext
from llm_astar_planner.waypoints.prompts.examples import load_example_library
from llm_astar_planner.waypoints.prompts.prompt import Prompt
from llm_astar_planner.waypoints.prompts.template import COMPLETION, load_template
from llm_astar_planner.waypoints.source import WaypointSource
from llm_astar_planner.waypoints.transcript import RecordingSource, TranscriptWriter

# How many seconds a request that missed its deadline may go on, to answer the next query.
LATE_S = 60.0


def make_endpoint(context: SourceContext) -> WaypointSource:
    """Make the source that asks a language model, with a cache and, if set, a recording.

    Raises SettingsError, TemplateError, ExamplesError or OSError where a setting cannot be used.
    """
    settings = context.settings
    prompt = make_prompt(settings)
    source: WaypointSource = EndpointSource(
        make_client(settings, prompt.template.stop),
        prompt,
        timeout_s=settings.timeout_s,
        max_prompt_tokens=settings.max_prompt_tokens,
        repair_rounds=settings.repair_rounds,
        late_s=LATE_S,
        dataset=context.dataset,
    )
    if settings.record:
        source = RecordingSource(source, TranscriptWriter(settings.record), context.dataset)
    return CachedSource(
        source,
        model=settings.model,
        prompt=prompt.name,
        size=settings.cache_size,
        timeout_s=settings.timeout_s,
    )


def make_prompt(settings: SourceSettings) -> Prompt:
    """Make the prompt that settings name. Raises TemplateError or ExamplesError for its files."""
    template = load_template(settings.prompt or DEFAULT_PROMPT)
    count = settings.retrieved_examples
    library = load_example_library(settings.examples_file, count) if count else None
    return Prompt(template, settings.prompt_form, library, count)


def make_client(settings: SourceSettings, stop: str = '') -> ChatClient:
    """Make the client of the endpoint that settings name. Raises EndpointError.

    A text completion ends where the model writes `stop`.
    """
    return ChatClient(
        Endpoint(settings.base_url, settings.api_key_env, settings.api_key_names),
        settings.model,
        Dialect(
            settings.max_output_tokens,
            settings.temperature,
            settings.response_format,
            is_completion=settings.prompt_form == COMPLETION,
            stop=stop,
        ),
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

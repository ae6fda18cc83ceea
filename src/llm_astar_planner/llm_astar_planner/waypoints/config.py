# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The settings of a waypoint source, the same for nodes and command line, and what it makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from llm_astar_msgs_adapter.errors import raising

from llm_astar_planner.parameter import ParameterError, parameter, parameters_of
from llm_astar_planner.waypoints import source as sources
from llm_astar_planner.waypoints.source import (
    SAVES_NOTHING,
    SOURCES,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

if TYPE_CHECKING:
    from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap

    from llm_astar_planner.costmap.costmap import Costmap
    from llm_astar_planner.waypoints.prompts.template import Template


DEFAULT_PROMPT = 'few_shot'
SOURCE_NAMES = tuple(SOURCES.own)


class SettingsError(ParameterError):
    """A setting that cannot be used; the message names the field and says what can."""


@dataclass(frozen=True)
class SourceSettings:
    """Settings of a waypoint source; the fields are parameters of llm_client_node.

    - `source`: Where waypoints come from. `auto` is `embedded` on maps of a few dozen straight
      barriers, and `none` on others, where the search takes less time than any source. `embedded`
      is a learned waypoint model, not an LLM; `endpoint` is a language model behind an
      OpenAI-compatible API; `replay` answers from a recorded transcript; `coarse` is the cheapest
      route on a coarser map, without a model; the last five are baselines to compare with. Or the
      name of an installed plug-in, or, at the start only, its `package.module:factory`
      (docs/plugins.md)
    - `base_url`: URL of the OpenAI-compatible endpoint, without `/chat/completions`
    - `api_key_env`: NAME of the environment variable that holds the endpoint's key; empty: no key
    - `api_key_names`: Names that `api_key_env` may have, with `*` for any part, separated by
      commas, so that no other variable of the environment is ever sent
    - `model`: Model to ask; for `replay`, the model whose exchanges are replayed, empty for any
    - `prompt`: Prompt template: `few_shot`, `zero_shot`, `cot`, `repe` or the path of a file;
      empty: `few_shot` for `endpoint`, any for `replay`
    - `prompt_form`: How `endpoint` is asked: `message`, the whole prompt in one message; `turns`,
      the examples as turns of user and assistant; `completion`, one text for a model without chat,
      by `/completions`
    - `retrieved_examples`: How many solved samples, those most similar to the query, replace the
      template's own examples; 0: none do
    - `examples_file`: Dataset of barrier maps that examples are retrieved from: a path, or a name
      in `maps/`; empty: `samples_1000.json`
    - `response_format`: Response format to ask the endpoint for
    - `candidates`: How many routes `embedded` samples before it returns the best one; 1 is its
      greedy route
    - `temperature`: Sampling temperature sent to the endpoint
    - `sampling_seed`: Seed sent to the endpoint, where it draws words at random; -1: none is sent
    - `max_output_tokens`: Longest reply to request
    - `max_prompt_tokens`: About how long the description of the map may be, with the retrieved
      examples
    - `timeout_s`: Time limit for one query, retries included; a later reply is cached
    - `max_retries`: How often a failed request is sent again
    - `max_concurrent`: How many requests may be in flight at once
    - `max_calls_per_hour`: Most requests in an hour; 0: no limit
    - `max_tokens_per_day`: Most tokens in a day; 0: no limit
    - `transcript`: Transcript that `replay` answers from: a path, or a name in `maps/`
    - `record`: Transcript to which each exchange with `endpoint` is appended; empty: none
    """

    source: str = parameter('auto', choices=SOURCE_NAMES, plugins=SOURCES)
    base_url: str = parameter('https://api.openai.com/v1')
    api_key_env: str = parameter('')
    api_key_names: str = parameter(sources.KEY_NAMES, read_only=True)
    model: str = parameter(
        '',
        check=lambda name: (
            f'model: {problem}' if (problem := sources.name_problem(name)) else None
        ),
    )
    prompt: str = parameter('')
    prompt_form: str = parameter(sources.MESSAGE, choices=sources.FORMS)
    retrieved_examples: int = parameter(0, between=(0, 100))
    examples_file: str = parameter('')
    response_format: str = parameter('text', choices=sources.RESPONSE_FORMATS)
    candidates: int = parameter(8, between=(1, 64))
    temperature: float = parameter(0.0, between=(0.0, 2.0))
    sampling_seed: int = parameter(-1, between=(-1, 2**31 - 1))
    max_output_tokens: int = parameter(1000, unit='tokens', between=(1, 100000))
    max_prompt_tokens: int = parameter(2000, unit='tokens', between=(100, 1000000))
    timeout_s: float = parameter(
        4.0,
        unit='s',
        between=(0.001, 3600.0),
        cli_default=30.0,
        cli_reason='since a person waits longer for a language model than a robot does',
    )
    max_retries: int = parameter(2, between=(0, 10))
    max_concurrent: int = parameter(2, between=(1, 64))
    max_calls_per_hour: int = parameter(600, between=(0, 1000000))
    max_tokens_per_day: int = parameter(0, between=(0, 2**31 - 1))
    transcript: str = parameter('')
    record: str = parameter('')

    def check(self) -> None:
        """Raise SettingsError for the first field that cannot be used."""
        for name, entry in SOURCE.items():
            problem = entry.problem(getattr(self, name))
            if problem:
                raise SettingsError(problem)
        if self.source != 'endpoint':
            return
        # Only who asks a model needs this.
        from llm_astar_planner.waypoints.llm.credentials import Endpoint  # noqa: PLC0415

        with raising(SettingsError, '', ValueError):
            Endpoint(self.base_url, self.api_key_env, self.api_key_names)
            template = self.template
        if self.retrieved_examples and template.thinks:
            words = f'these hold no thoughts, which the prompt {template.name} asks for'
            raise SettingsError(f'retrieved_examples: {words}; use few_shot or zero_shot')

    @property
    def template(self) -> Template:
        """The template of the prompt. Raises TemplateError."""
        from llm_astar_planner.waypoints.prompts.template import load_template  # noqa: PLC0415

        return load_template(self.prompt or DEFAULT_PROMPT)

    @property
    def prompt_name(self) -> str:
        """The name of the prompt in replies, rows and transcripts. Raises TemplateError."""
        return self.template.prompt_name(self.prompt_form, self.retrieved_examples)


# The parameters, by field name.
SOURCE = parameters_of(SourceSettings)


@dataclass(frozen=True)
class SourceContext:
    """What a source is made from.

    `settings` are the parameters of sources, `dataset` the barrier maps whose samples may be
    recognised by their cells, `seed` that of what is drawn at random.
    """

    settings: SourceSettings
    dataset: Sequence[BarrierMap] | None = None
    seed: int = 0


def make_source(
    settings: SourceSettings, dataset: Sequence[BarrierMap] | None = None, seed: int = 0
) -> WaypointSource:
    """Make the source that `settings` name, the package's own or a plug-in's.

    `dataset` lets samples be recognised by their cells; `seed` is of what is drawn at random.
    Raises SettingsError for wrong settings, PluginError for a plug-in that cannot be loaded, and
    what the source raises for its files.
    """
    settings.check()
    source: WaypointSource = SOURCES.load(settings.source)(SourceContext(settings, dataset, seed))
    return source


def helps_on(costmap: Costmap) -> bool:
    """Tell whether a source helps on a costmap: the embedded model, on maps of the paper's kind.

    These are a few dozen straight barriers. Elsewhere the search takes less time than any source.
    """
    return costmap.is_barrier_map


class AutoSource:
    """Asks the embedded model on the maps where it helps. Thread-safe."""

    name = 'auto'

    def __init__(self, context: SourceContext) -> None:
        """Take what the model is made from; it is loaded when it is first asked."""
        self._context = context
        self._embedded: WaypointSource | None = None
        self.helps_on = helps_on

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the reply of the embedded model, or one with status NONE."""
        if not helps_on(query.costmap):
            return WaypointReply(label=self.name, status=SourceStatus.NONE, detail=SAVES_NOTHING)
        if self._embedded is None:
            settings = replace(self._context.settings, source='embedded')
            self._embedded = make_source(settings, self._context.dataset, self._context.seed)
        return self._embedded.waypoints(query)

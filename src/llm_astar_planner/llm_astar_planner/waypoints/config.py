"""Every setting of a waypoint source, in one place for nodes and command line alike."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from llm_astar_planner.waypoints.llm.credentials import Endpoint
from llm_astar_planner.waypoints.llm.protocol import RESPONSE_FORMATS
from llm_astar_planner.waypoints.prompts.template import load_template

MAX_RETRIES = 10
MAX_CANDIDATES = 64
DEFAULT_PROMPT = 'few_shot'


class SettingsError(ValueError):
    """A setting that cannot be; the message names the field and says what can."""


@dataclass(frozen=True)
class SourceSettings:
    """Settings of a waypoint source; the field names are the ROS parameters.

    - `source`: one of the factory's SOURCES.
    - `base_url`: where the OpenAI-compatible endpoint is, without `/chat/completions`.
    - `api_key_env`: the NAME of the environment variable with its key, '' for none.
    - `model`, `temperature`, `max_output_tokens`: sent to the endpoint; a `replay` looks for
      `model` and `prompt` in its transcript, any if they are empty.
    - `prompt`: a shipped template's name or one's own file; '' is `few_shot` to an endpoint.
    - `response_format`: `text`, `json_object` or `json_schema`.
    - `candidates`: how many routes the `embedded` model draws, to answer with the best in sight;
      1 is its greedy route, judged by nothing.
    - `timeout_s`: for a whole question, retries and repairs included; an answer that comes later
      is kept for the next time.
    - `max_retries`, `max_concurrent`: of requests to the endpoint.
    - `max_prompt_tokens`: about how many the description of the map may take.
    - `repair_rounds`: how often a route that collides is asked for again.
    - `max_calls_per_hour`, `max_tokens_per_day`: 0 for no limit.
    - `cache_size`: how many answers are kept.
    - `transcript`: the file a `replay` answers from; `record`: the file exchanges are added to,
      '' for none.
    """

    source: str = 'none'
    base_url: str = 'https://api.openai.com/v1'
    api_key_env: str = ''
    model: str = ''
    prompt: str = ''
    response_format: str = 'text'
    candidates: int = 8
    temperature: float = 0.0
    max_output_tokens: int = 1000
    max_prompt_tokens: int = 2000
    timeout_s: float = 4.0
    max_retries: int = 2
    max_concurrent: int = 2
    repair_rounds: int = 0
    max_calls_per_hour: int = 600
    max_tokens_per_day: int = 0
    cache_size: int = 256
    transcript: str = ''
    record: str = ''

    def check(self) -> None:
        """Raise SettingsError for the first field that cannot be."""
        numbers: tuple[tuple[str, Callable[[float], bool], str], ...] = (
            ('temperature', lambda v: 0 <= v <= 2, '0 to 2'),
            ('max_output_tokens', lambda v: v >= 1, '1 or more'),
            ('max_prompt_tokens', lambda v: v >= 100, '100 or more'),
            ('timeout_s', lambda v: 0 < v <= 3600, 'above 0, to 3600'),
            ('max_retries', lambda v: 0 <= v <= MAX_RETRIES, f'0 to {MAX_RETRIES}'),
            ('max_concurrent', lambda v: 1 <= v <= 64, '1 to 64'),
            ('candidates', lambda v: 1 <= v <= MAX_CANDIDATES, f'1 to {MAX_CANDIDATES}'),
            ('repair_rounds', lambda v: 0 <= v <= 10, '0 to 10'),
            ('max_calls_per_hour', lambda v: v >= 0, '0 (no limit) or more'),
            ('max_tokens_per_day', lambda v: v >= 0, '0 (no limit) or more'),
            ('cache_size', lambda v: v >= 1, '1 or more'),
        )
        for name, is_fine, expected in numbers:
            value = getattr(self, name)
            if not math.isfinite(value) or not is_fine(value):
                raise SettingsError(f'{name}: {value} is not {expected}')
        if self.response_format not in RESPONSE_FORMATS:
            known = ', '.join(RESPONSE_FORMATS)
            raise SettingsError(f'response_format: {self.response_format!r} is none of {known}')
        if self.source == 'endpoint':
            self._check_endpoint()

    def _check_endpoint(self) -> None:
        try:
            Endpoint(self.base_url, self.api_key_env)
            load_template(self.prompt or DEFAULT_PROMPT)
        except ValueError as error:
            raise SettingsError(str(error)) from None

"""The options that choose a waypoint source, for every command that asks one."""

from __future__ import annotations

import argparse
from typing import Any

from llm_astar_planner.waypoints.factory import SOURCES, SourceSettings
from llm_astar_planner.waypoints.llm.protocol import RESPONSE_FORMATS

DEFAULTS = SourceSettings()
# What a person at a terminal waits for a model; a robot's node waits for less.
TIMEOUT_S = 30.0


def add_source_arguments(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options to a group of a parser."""
    group.add_argument(
        '--source',
        default=DEFAULTS.source,
        help=f'one of {", ".join(SOURCES)}; embedded is a learned waypoint model, not an LLM '
        '(default: %(default)s)',
    )
    group.add_argument(
        '--record', default='', metavar='FILE', help='add each exchange with endpoint to FILE'
    )
    group.add_argument('--model', default='', help='model asked, or whose exchanges are replayed')
    group.add_argument(
        '--prompt',
        default='',
        help="few_shot (default), cot, repe, a template's path, or whose exchanges are replayed",
    )
    add_endpoint_arguments(group)
    group.add_argument(
        '--response-format', default=DEFAULTS.response_format, choices=tuple(RESPONSE_FORMATS)
    )
    group.add_argument(
        '--candidates',
        type=int,
        default=DEFAULTS.candidates,
        metavar='K',
        help='routes embedded draws and takes the best of; 1: greedy (default: %(default)s)',
    )
    group.add_argument(
        '--timeout',
        type=float,
        default=TIMEOUT_S,
        metavar='SECONDS',
        help='for the whole question (default: %(default)s)',
    )


def add_endpoint_arguments(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add where a model's answers come from, live or recorded; `add_source_arguments` does too."""
    group.add_argument('--transcript', default='', metavar='FILE', help='what replay answers from')
    group.add_argument(
        '--base-url',
        default=DEFAULTS.base_url,
        metavar='URL',
        help='OpenAI-compatible endpoint, without /chat/completions (default: %(default)s)',
    )
    group.add_argument(
        '--api-key-env',
        default='',
        metavar='NAME',
        help='NAME of the environment variable that holds its key',
    )
    group.add_argument(
        '--repair-rounds',
        type=int,
        default=0,
        metavar='N',
        help='how often a model is told what collides and asked again (default: 0)',
    )


def source_settings(arguments: argparse.Namespace) -> SourceSettings:
    """Return the settings that parsed options choose."""
    return SourceSettings(
        source=arguments.source,
        base_url=arguments.base_url,
        api_key_env=arguments.api_key_env,
        model=arguments.model,
        prompt=arguments.prompt,
        response_format=arguments.response_format,
        timeout_s=arguments.timeout,
        repair_rounds=arguments.repair_rounds,
        candidates=arguments.candidates,
        transcript=arguments.transcript,
        record=arguments.record,
    )

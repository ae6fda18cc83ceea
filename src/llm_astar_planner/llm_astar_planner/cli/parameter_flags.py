"""Command-line flags made from the table of parameters, and the values that they lead to."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Mapping
from typing import Any

from llm_astar_planner.parameter import Parameter, ParameterError, Scalar
from llm_astar_planner.planning.parameters import SOURCE, defaults

ENDPOINT = (
    'base_url', 'api_key_env', 'api_key_names', 'repair_rounds', 'prompt_form',
    'retrieved_examples', 'examples_file',
)  # fmt: skip
METAVARS = {'s': 'SECONDS', 'm': 'METRES'}
# What the flags of some parameters take; those with choices and the rest take a NAME.
TEXTS = {
    'footprint': 'POINTS',
    'instruction': 'TEXT',
    'base_url': 'URL',
    'prompt': 'NAME|FILE',
    'examples_file': 'FILE',
    'instruction_examples': 'FILE',
    'transcript': 'FILE',
    'record': 'FILE',
}


def flag_of(name: str) -> str:
    """Return the flag of a parameter."""
    return '--' + name.replace('_', '-')


def add_parameter_flags(group: Any, parameters: Iterable[Parameter]) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add a flag for each parameter; a flag that is not given is None."""
    for item in parameters:
        flag = flag_of(item.name)
        default = item.default if item.cli_default is None else item.cli_default
        facts = [str(default or 'none') if isinstance(default, str) else json.dumps(default)]
        facts += [item.cli_reason] if item.cli_reason else []
        text = f'{item.sentence} (default: {", ".join(facts)})'
        common: dict[str, Any] = {
            'dest': item.name,
            'default': None,
            'help': text.replace('`', '').replace('%', '%%'),
        }
        if isinstance(item.default, bool):
            group.add_argument(flag, action=argparse.BooleanOptionalAction, **common)
            continue
        kind = type(item.default)
        word = TEXTS.get(item.name, 'NAME') if kind is str else 'N'
        if item.choices:
            common['help'] += f'; one of {item.limits}'
        flags = [flag, *map(flag_of, item.short_flags)]
        group.add_argument(*flags, type=kind, metavar=METAVARS.get(item.unit, word), **common)


def add_params_file_flag(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--params-file`, which may be given several times."""
    group.add_argument(
        '--params-file',
        action='append',
        default=[],
        metavar='FILE',
        help="a node's own parameter file; flags override it, and what neither says has the "
        "node's default",
    )


def given_values(
    arguments: argparse.Namespace, parameters: Iterable[Parameter]
) -> dict[str, Scalar]:
    """Return the values of the flags that were given, by parameter name.

    Raises ParameterError for one that its parameter cannot have, PluginError for a plug-in that
    cannot be imported.
    """
    given = {}
    for item in parameters:
        value = getattr(arguments, item.name)
        if value is not None:
            if item.plugins is not None:
                item.plugins.admit(value)
            try:
                given[item.name] = item.read(value)
            except ParameterError as error:
                message = str(error).replace(item.name, flag_of(item.name), 1)
                raise ParameterError(message) from None
    return given


def parameter_values(
    arguments: argparse.Namespace,
    parameters: Iterable[Parameter],
    file: Mapping[str, Scalar] | None,
) -> dict[str, Any]:
    """Return every parameter's value: of its flag, else of a file, else its default.

    The default is the node's where there is a file, else the command line's.
    """
    parameters = tuple(parameters)
    known = defaults(parameters, cli=file is None)
    in_file = {name: value for name, value in (file or {}).items() if name in known}
    return known | in_file | given_values(arguments, parameters)


def add_endpoint_arguments(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add where a model's replies come from, live or recorded."""
    endpoint = [item for item in SOURCE if item.name in ENDPOINT]
    add_parameter_flags(group, endpoint)
    group.set_defaults(**defaults(endpoint))

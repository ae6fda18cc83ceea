# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Flags that several commands share, and those made from the table of parameters."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import printable

from llm_astar_planner.parameter import Parameter, ParameterError, Scalar

METAVARS = {'s': 'SECONDS', 'm': 'METRES'}
# The types of what options take, unless they say otherwise.
TYPES = {'N': int, 'SECONDS': float}
# What the flags of some parameters take; those with choices and the rest take a NAME.
TEXTS = {
    'footprint': 'POINTS',
    'instruction': 'TEXT',
    'base_url': 'URL',
    'prompt': 'NAME|FILE',
    **dict.fromkeys(('examples_file', 'transcript', 'record'), 'FILE'),
}
CONFIRM_HINT = 'llm-astar: hint: if what is asked is meant, add --confirm\n'
# A yes, in each language of the instructions.
YES = {'y', 'yes', 'j', 'ja', 'o', 'oui', 's', 'si', 'sí'}
NO = {'n', 'no', 'nein', 'non'}
# A point, as two numbers.
POINT: dict[str, Any] = {'type': float, 'nargs': 2, 'metavar': ('X', 'Y')}
# What matplotlib writes; importing it only to ask takes most of a second.
FORMATS = ('.png', '.svg', '.pdf', '.jpg', '.jpeg', '.webp', '.tif', '.tiff', '.eps', '.ps')
ANIMATIONS = ('.gif',)


def flag_of(name: str) -> str:
    """Return the flag of a parameter."""
    return '--' + name.replace('_', '-')


def option(group: Any, words: str, text: str, **facts: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add an option to a parser or a group, `text` being its help.

    `words` are its names and what it takes, such as `--count N`. `facts` are for argparse; the
    type is that of a number as default, else as TYPES has it for what the option takes. What
    takes nothing and has no facts is a switch.
    """
    names = words.split()
    if len(names) > 1 and not names[-1].startswith('-'):
        facts['metavar'] = names.pop()
    elif not facts:
        facts['action'] = 'store_true'
    default, word = facts.get('default'), str(facts.get('metavar'))
    kind = type(default) if isinstance(default, int | float) else TYPES.get(word)
    if kind is not None:
        facts.setdefault('type', kind)
    group.add_argument(*names, help=text, **facts)


def add_graph_options(group: Any, *, client: bool = False) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--namespace` and `--node`, which name a running planner, and its `--client`."""
    option(group, '--namespace NAME', "the planner's namespace (default: /)", default='/')
    text = 'name of the planner (default: %(default)s)'
    option(group, '--node NAME', text, default='planner_node')
    if client:
        text = 'name of its waypoint client (default: %(default)s)'
        option(group, '--client NAME', text, default='llm_client_node')


def add_time_limit(group: Any, default: float) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the `--time-limit` of waits, in seconds."""
    text = 'longest wait for each answer (default: %(default)s)'
    option(group, '--time-limit SECONDS', text, default=default, type=at_least(0.001))


def at_least(least: float, kind: type[float] = float) -> Callable[[str], float]:
    """Return what parses a finite number of at least `least`, of the type float or int."""

    def parse(text: str) -> float:
        try:
            number = kind(text)
        except ValueError:
            number = math.nan
        if not least <= number < math.inf:
            what = 'whole number' if kind is int else 'number'
            raise argparse.ArgumentTypeError(f'{text!r} is not a {what} of at least {least:g}')
        return number

    return parse


def add_picture_option(group: Any, text: str) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--png`, which may be called `--out` as in other commands; `text` says what is drawn."""
    text = f'{text}, into a file whose ending says how: .png, .svg, .pdf, .jpg'
    option(group, '--png FILE', text, type=picture_file)
    hidden = argparse.SUPPRESS
    group.add_argument('--out', dest='png', type=picture_file, default=hidden, help=hidden)


def picture_file(text: str, endings: tuple[str, ...] = FORMATS) -> str:
    """Return the name of a file with one of the endings. Raises ArgumentTypeError otherwise."""
    path = Path(text)
    if path.is_dir():
        raise argparse.ArgumentTypeError(f'{text}: Is a directory; a file is expected')
    if path.suffix.lower() not in endings:
        named = f'ends in {path.suffix!r}' if path.suffix else 'has no ending'
        allowed = ', '.join(endings)
        raise argparse.ArgumentTypeError(f'{text} {named}; the ending is one of {allowed}')
    return text


# The name of a picture or an animation.
picture_or_animation = partial(picture_file, endings=(*ANIMATIONS, *FORMATS))


def add_parameter_flags(group: Any, parameters: Iterable[Parameter]) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add a flag for each parameter; a flag that is not given is None."""
    for item in parameters:
        default = item.default if item.cli_default is None else item.cli_default
        facts = [str(default or 'none') if isinstance(default, str) else json.dumps(default)]
        facts += [item.cli_reason] if item.cli_reason else []
        text = f'{item.sentence} (default: {", ".join(facts)})'.replace('`', '')
        common: dict[str, Any] = {'dest': item.name, 'help': text.replace('%', '%%')}
        flags = map(flag_of, (item.name, *item.short_flags))
        if isinstance(item.default, bool):
            group.add_argument(*flags, action=argparse.BooleanOptionalAction, **common)
            continue
        kind = type(item.default)
        word = TEXTS.get(item.name, 'NAME') if kind is str else 'N'
        if item.choices:
            common['help'] += f'; one of {item.limits}'
        group.add_argument(*flags, type=kind, metavar=METAVARS.get(item.unit, word), **common)


def named(parameters: Iterable[Parameter], *names: str) -> tuple[Parameter, ...]:
    """Return the parameters of these names, in the order of the table."""
    return tuple(item for item in parameters if item.name in names)


def add_params_file_flag(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--params-file`, which may be given several times."""
    option(
        group, '--params-file FILE',
        "a node's own parameter file; flags override it, and what neither says has the "
        "node's default", action='append', default=[],
    )  # fmt: skip


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


def ask_person(questions: Sequence[str]) -> bool | None:
    """Ask a person questions; return whether all answers are yes.

    None if this is no terminal, or one of them is answered neither with yes nor with no.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        return None
    answers = []
    for question in questions:
        sys.stderr.write(f'{printable(question)} [y/n] ')
        sys.stderr.flush()
        answers.append(sys.stdin.readline().strip().casefold())
    return all(answer in YES for answer in answers) if {*answers} <= YES | NO else None

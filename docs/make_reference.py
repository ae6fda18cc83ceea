"""Makes what is written of the table of parameters.

`python docs/make_reference.py` prints the tables of docs/reference.md, and with the argument
`yaml` the file config/planner.yaml.
"""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterator, Sequence

import yaml
from llm_astar_planner.parameter import Parameter, Scalar
from llm_astar_planner.planning.parameters import NODES, OTHERS, SET_BY_PLANNER


def markdown() -> str:
    """Return the tables of docs/reference.md: a section for each node."""
    return '\n\n'.join(markdown_section(node) for node in NODES) + '\n'


def documented(node: str) -> list[Parameter]:
    """Return the parameters of a node that a user sets."""
    hidden = SET_BY_PLANNER if node == 'llm_client_node' else ()
    return [item for item in NODES[node] if item.name not in hidden]


def markdown_section(node: str) -> str:
    """Return the heading and the table of one node, with what differs on the command line."""
    lines = [f'### `{node}`', '', '| parameter | default | values | |', '|---|---|---|---|']
    for item in documented(node):
        sentence = item.sentence + (' (fixed at start)' if item.read_only else '')
        unit = f' {item.unit}' if item.unit else ''
        limits = f'`{"`, `".join(item.choices)}`' if item.choices else item.limits
        default = f'`{yaml_literal(item.default)}`{unit}'
        lines.append(f'| `{item.name}` | {default} | {limits} | {sentence} |')
    other = [
        f'- `{item.name}`: `{yaml_literal(default)}`{where}, {reason}.'
        for item in documented(node)
        for default, where, reason in (
            (item.cli_default, '', item.cli_reason),
            (item.bench_default, ' in `bench` and `evaluate`', item.bench_reason),
        )
        if reason
    ]
    if other:
        lines += ['', 'The command line has other defaults for these:', '', *other]
    if node == 'llm_client_node':
        names = ', '.join(f'`{name}`' for name in SET_BY_PLANNER)
        lines += ['', f'Before it asks, `planner_node` also sets its own values of {names}.']
    for name, ours in OTHERS.get(node, {}).items():
        lines += ['', f"Nav2's name of `{ours}`, `{name}`, is accepted too."]
    return '\n'.join(lines)


def yaml_text() -> str:
    """Return config/planner.yaml: every parameter at its default, with its sentence."""
    blocks = [
        '# Parameters of the planner graph. Every value here is the default, for a robot; pass\n'
        '# another file with `ros2 launch llm_astar_planner planner.launch.py params_file:=...`.\n'
        '# /** covers any namespace. Made by `python docs/make_reference.py yaml`.'
    ]
    for node in NODES:
        lines = [f'/**/{node}:', '  ros__parameters:']
        for item in documented(node):
            lines += yaml_entry(item)
        blocks.append('\n'.join(lines))
    return '\n\n'.join(blocks) + '\n'


def yaml_entry(item: Parameter) -> Iterator[str]:
    """Return the lines of a parameter: what it means, and its default."""
    facts = [fact for fact in (item.unit, item.limits) if fact]
    text = item.sentence.replace('`', '') + (f' [{"; ".join(facts)}]' if facts else '')
    yield from (f'    # {line}' for line in textwrap.wrap(text, 92))
    # rcl takes an empty string for a missing value.
    comment = '# ' if item.default == '' else ''
    yield f'    {comment}{item.name}: {yaml_literal(item.default)}'


def yaml_literal(value: Scalar | None) -> str:
    """Return a value as YAML has it."""
    # A plain * would begin an alias.
    return str(yaml.safe_dump(value, width=99)).splitlines()[0]


def main(arguments: Sequence[str]) -> int:
    """Print what is made of the table."""
    sys.stdout.write(yaml_text() if list(arguments) == ['yaml'] else markdown())
    return 0


if __name__ == '__main__':
    raise SystemExit(main(sys.argv[1:]))

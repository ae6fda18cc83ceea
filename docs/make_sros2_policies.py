"""Makes config/sros2/policies.xml of the table of the graph in docs/reference.md.

`python docs/make_sros2_policies.py` prints the policies of the nodes in no namespace, and with a
namespace as argument, such as `/robot1`, those of the nodes in it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape

REFERENCE = Path(__file__).parent / 'reference.md'
ENCLAVES = '/llm_astar'
# The kinds of the table, in the order of the file: what a policy calls them.
KINDS = {
    'pub': ('topic', 'publish'),
    'sub': ('topic', 'subscribe'),
    'srv': ('service', 'reply'),
    'call': ('service', 'request'),
    'action': ('action', 'execute'),
}
# What ROS itself gives to every node, and to the hidden ones in planner_node's process.
HIDDEN_NODE = [
    ('pub', '/parameter_events'),
    ('sub', '/clock'),
    ('srv', '~/get_type_description'),
]
PARAMETER_SERVICES = (
    'describe_parameters', 'get_parameter_types', 'get_parameters', 'list_parameters',
    'set_parameters', 'set_parameters_atomically',
)  # fmt: skip
EVERY_NODE = [
    *HIDDEN_NODE,
    ('pub', '/rosout'),
    *(('srv', f'~/{name}') for name in PARAMETER_SERVICES),
]
HIDDEN_NODES = {
    'planner_node': [f'_planner_node_{n}' for n in ('bond', 'maps', 'transforms', 'waypoints')]
}


class Entry(NamedTuple):
    """A topic, service or action of a node, of one of KINDS; `note` is the rest of its row."""

    node: str
    kind: str
    name: str
    note: str


def entries(text: str) -> Iterator[Entry]:
    """Yield what the table of the graph lists."""
    section = text.partition('\n## The graph\n')[2].partition('\n## ')[0]
    node = ''
    for line in section.splitlines():
        cells = [cell.strip() for cell in line.strip('|').split(' | ')]
        kinds = cells[1].split(', ') if len(cells) > 2 else []
        if not kinds or not set(kinds) <= set(KINDS):
            continue
        node = cells[0].strip('| `') or node
        for kind in kinds:
            for name in re.findall('`([^`]+)`', cells[2]):
                yield Entry(node, kind, name, ' '.join(cells[3:]))


def policies(text: str, namespace: str = '/') -> str:
    """Return the policies: an enclave for each process, a profile for each of its nodes."""
    table = list(entries(text))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<!-- Made by `python docs/make_sros2_policies.py` of the table in docs/reference.md.',
        '     Topics that are remapped have to be renamed here too. -->',
        '<policy version="0.2.0">',
        '  <enclaves>',
    ]
    for node in dict.fromkeys(entry.node for entry in table):
        own = [(entry.kind, entry.name) for entry in table if entry.node == node]
        lines += [f'    <enclave path="{ENCLAVES}/{node}">', '      <profiles>']
        lines += profile(namespace, node, EVERY_NODE + own)
        for hidden in HIDDEN_NODES.get(node, ()):
            lines += profile(namespace, hidden, HIDDEN_NODE)
        lines += ['      </profiles>', '    </enclave>']
    return '\n'.join([*lines, '  </enclaves>', '</policy>', ''])


def profile(namespace: str, node: str, granted: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Yield the lines of one node's profile; `granted` are kinds and names."""
    yield f'        <profile ns="{escape(namespace)}" node="{node}">'
    for kind, (what, verb) in KINDS.items():
        names = sorted({name for of_kind, name in granted if of_kind == kind})
        if names:
            yield f'          <{what}s {verb}="ALLOW">'
            yield from (f'            <{what}>{escape(name)}</{what}>' for name in names)
            yield f'          </{what}s>'
    yield '        </profile>'


def main(arguments: Sequence[str]) -> int:
    """Print the policies."""
    sys.stdout.write(policies(REFERENCE.read_text(), *arguments[:1]))
    return 0


if __name__ == '__main__':
    raise SystemExit(main(sys.argv[1:]))

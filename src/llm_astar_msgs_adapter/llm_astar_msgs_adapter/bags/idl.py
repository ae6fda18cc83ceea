"""Message definitions as ROS 2 IDL, which can name the messages of a service."""

from __future__ import annotations

from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

# What bags put between the definitions of a type and of those it is made of.
SEPARATOR = '=' * 80 + '\nIDL: '
BASE_TYPES = {'float32': 'float', 'float64': 'double', 'bool': 'boolean', 'byte': 'octet'}


def idl_text(store: Typestore, msgtype: str) -> str:
    """Return the definition of a registered type and of all it is made of, constants left out.

    rosbag2 joins IDL files so; `.msg` texts cannot name a type below `srv`.
    """
    found: dict[str, str] = {}
    _collect(store, msgtype, found)
    return ''.join(f'{SEPARATOR}{name}\n{text}\n' for name, text in found.items())


def nested_type(description: Any) -> str:  # noqa: ANN401 - a parse tree of rosbags
    """Return the type of a field that is a message, or of whose elements are; '' of no other."""
    kind, detail = description
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return nested_type(detail[0])
    return str(detail) if kind is Nodetype.NAME else ''


def _collect(store: Typestore, msgtype: str, found: dict[str, str]) -> None:
    _, fields = store.fielddefs[msgtype]
    package, kind, name = msgtype.split('/')
    members = ' '.join(_member(field, description) for field, description in fields)
    struct = f'struct {name} {{ {members} }};'
    found[msgtype] = f'module {package} {{ module {kind} {{ {struct} }}; }};'
    for _, description in fields:
        nested = nested_type(description)
        if nested and nested not in found:
            _collect(store, nested, found)


def _member(name: str, description: Any) -> str:  # noqa: ANN401 - a parse tree of rosbags
    kind, detail = description
    if kind is Nodetype.ARRAY:
        return f'{_type(detail[0])} {name}[{detail[1]}];'
    return f'{_type(description)} {name};'


def _type(description: Any) -> str:  # noqa: ANN401 - a parse tree of rosbags
    kind, detail = description
    if kind is Nodetype.NAME:
        return str(detail).replace('/', '::')
    base, bound = detail
    if kind is Nodetype.SEQUENCE:
        base = _type(base)
        return f'sequence<{base}, {bound}>' if bound else f'sequence<{base}>'
    if base == 'string' and bound:
        return f'string<{bound}>'
    return BASE_TYPES.get(base, str(base))

"""The message types of bags: Jazzy's own, GetPlan's service events, and whatever is installed."""

from __future__ import annotations

import os
import sys
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from llm_astar_msgs_adapter.bags.idl import idl_text, nested_type

GET_PLAN_EVENT_TYPE = 'nav_msgs/srv/GetPlan_Event'
GET_PLAN = """\
geometry_msgs/PoseStamped start
geometry_msgs/PoseStamped goal
float32 tolerance
---
nav_msgs/Path plan
"""
EVENT_INFO_TYPE = 'service_msgs/msg/ServiceEventInfo'
# As rosidl reads it: `char` is its uint8, also where a type is hashed, and rosbags keeps the char.
EVENT_INFO = """\
uint8 REQUEST_SENT=0
uint8 REQUEST_RECEIVED=1
uint8 RESPONSE_SENT=2
uint8 RESPONSE_RECEIVED=3
uint8 event_type
builtin_interfaces/Time stamp
uint8[16] client_gid
int64 sequence_number
"""
# What service introspection publishes of any service: rosidl's `Event`, which no file defines.
EVENT = """\
service_msgs/ServiceEventInfo info
{package}/{name}_Request[<=1] request
{package}/{name}_Response[<=1] response
"""


class BagTypeError(ValueError):
    """A message type whose definition is not to be had; the message names the type."""


class Definition(NamedTuple):
    """A message type: its name, all of its text (`.msg` or IDL) for a bag, its RIHS01 hash."""

    msgtype: str
    text: str
    digest: str


@cache
def bag_types() -> Typestore:
    """Return Jazzy's message types, nav_msgs/srv/GetPlan's events among them."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.fielddefs.update(get_types_from_msg(EVENT_INFO, EVENT_INFO_TYPE))
    _register_service(store, 'nav_msgs', 'GetPlan', GET_PLAN)
    return store


def define(msgtype: str) -> Definition:
    """Return the definition of a message type, `package/msg/Name` or `package/srv/Name_Event`.

    What Jazzy's common packages lack is read from the packages installed here. Raises
    BagTypeError where they lack it too.
    """
    store = bag_types()
    try:
        _learn(store, msgtype)
        if '/msg/' in msgtype:
            text, _ = store.generate_msgdef(msgtype, ros_version=2)
        else:
            text = idl_text(store, msgtype)
        return Definition(msgtype, text, store.hash_rihs01(msgtype))
    except (OSError, TypesysError, ValueError) as error:
        message = f'{msgtype}: its definition cannot be read: {error}'
        raise BagTypeError(message) from None


def _learn(store: Typestore, msgtype: str) -> None:
    """Register a type, and what it is made of, from the files of installed packages."""
    if msgtype in store.types:
        return
    package, kind, name = msgtype.split('/')
    if kind == 'srv' and name.endswith('_Event'):
        service = name.removesuffix('_Event')
        _register_service(store, package, service, _installed(package, 'srv', service))
    else:
        _register(store, get_types_from_msg(_installed(package, kind, name), msgtype))


def _register_service(store: Typestore, package: str, name: str, text: str) -> None:
    """Register the events of a service of which `text` is the `.srv` file."""
    request, _, response = text.partition('---')
    event = EVENT.format(package=package, name=name)
    for part, fields in (('Request', request), ('Response', response), ('Event', event)):
        # The parser of `.msg` puts every name below `msg`.
        types = get_types_from_msg(fields, f'{package}/msg/{name}_{part}')
        items = _as_service(list(types.items()), package, name)
        _register(store, dict(items))


def _register(store: Typestore, types: dict[str, Any]) -> None:
    for _, fields in types.values():
        for _, description in fields:
            name = nested_type(description)
            if name and name not in types:
                _learn(store, name)
    store.register(types)


def _as_service(tree: Any, package: str, name: str) -> Any:  # noqa: ANN401 - any parse tree
    """Return a parse tree with the messages of a service named as ROS names them."""
    if isinstance(tree, (list, tuple)):
        return type(tree)(_as_service(item, package, name) for item in tree)
    if isinstance(tree, str):
        return tree.replace(f'{package}/msg/{name}_', f'{package}/srv/{name}_')
    return tree


def _installed(package: str, kind: str, name: str) -> str:
    """Read a definition from an installed package. Raises BagTypeError where there is none."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    for prefix in [*filter(None, prefixes), sys.prefix]:
        file = Path(prefix, 'share', package, kind, f'{name}.{kind}')
        if file.is_file():
            return file.read_text(encoding='utf-8')
    message = f'no installed package {package} has {kind}/{name}.{kind}'
    raise BagTypeError(message)

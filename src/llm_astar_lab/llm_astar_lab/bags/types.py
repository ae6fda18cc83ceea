# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Message types of bags, decoding by those in a bag, and messages that are made without ROS.

Definitions come from Jazzy's common packages (rosbags has them), from the packages installed on
this machine, or from the bag itself.
"""

import json
import math
import os
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zstandard
from llm_astar_msgs_adapter.errors import LlmAstarError, raising
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from rosbags import typesys
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys.store import Typestore

from llm_astar_lab.bags.storage import Channel, unzstd

GET_PLAN_EVENT_TYPE = 'nav_msgs/srv/GetPlan_Event'
# What service introspection publishes, with its parts, as it is in a bag. rosidl generates these
# types; no file of ROS defines them, and `.msg` cannot name a type below `srv`.
GET_PLAN_EVENT_IDL = Path(__file__).with_name('GetPlan_Event.idl').read_text(encoding='utf-8')
EVENT_INFO_TYPE = 'service_msgs/msg/ServiceEventInfo'
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
# What parsing somebody else's definition may raise.
DEFINITION_ERRORS = (
    typesys.TypesysError, KeyError, ValueError, TypeError, AssertionError, IndexError,
    RecursionError, AttributeError, OverflowError, StopIteration, SyntaxError,
)  # fmt: skip
# Characters of a definition; the longest of Jazzy's packages has 20,000.
MAX_DEFINITION = 2**18
# rosbags generates code for every element of an array of messages.
MAX_ELEMENTS = 10_000


class BagTypeError(LlmAstarError, ValueError):
    """A message type without a definition; the message names the type."""


class DecodeError(LlmAstarError, ValueError):
    """A message whose bytes do not fit its type."""


class UnknownTypeError(LlmAstarError, ValueError):
    """A message type that neither Jazzy nor the bag defines; the message names it."""


class TypeDefinition(NamedTuple):
    """A message type's name, its definition for a bag, that one's format, and its RIHS01 hash."""

    msgtype: str
    text: str
    encoding: str
    digest: str


@cache
def bag_types() -> Typestore:
    """Return Jazzy's message types and the events of nav_msgs/srv/GetPlan."""
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    modules = [line for line in GET_PLAN_EVENT_IDL.splitlines() if line.startswith('module')]
    types = typesys.get_types_from_idl('\n'.join(modules))
    # rosidl reads its `char` as uint8, also for the type's hash, but rosbags does not.
    constants, _ = store.fielddefs.pop(EVENT_INFO_TYPE)
    types[EVENT_INFO_TYPE] = constants, types[EVENT_INFO_TYPE][1]
    store.register({name: tree for name, tree in types.items() if name not in store.fielddefs})
    return store


def define(msgtype: str) -> TypeDefinition:
    """Return the definition of a message type, `package/msg/Name`, or of the events of GetPlan.

    Raises BagTypeError where neither Jazzy's common packages nor those installed here define it.
    """
    store, what = bag_types(), f'{msgtype}: its definition cannot be read: '
    with raising(BagTypeError, what, OSError, typesys.TypesysError, ValueError):
        if msgtype == GET_PLAN_EVENT_TYPE:
            text, encoding = GET_PLAN_EVENT_IDL, 'ros2idl'
        else:
            learn(store, msgtype)
            (text, _), encoding = store.generate_msgdef(msgtype, ros_version=2), 'ros2msg'
        return TypeDefinition(msgtype, text, encoding, store.hash_rihs01(msgtype))


def learn(store: Typestore, msgtype: str) -> None:
    """Register a type and its parts from installed packages, unless `store` has it."""
    if msgtype in store.types:
        return
    package, kind, name = msgtype.split('/')
    types = typesys.get_types_from_msg(installed_text(package, kind, name), msgtype)
    for _, fields in types.values():
        for element, part in (element_of(*tree) for _, tree in fields):
            if element is Nodetype.NAME and part not in types:
                learn(store, str(part))
    store.register(types)


def installed_text(package: str, kind: str, name: str) -> str:
    """Read a definition from an installed package. Raises BagTypeError where there is none."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    for prefix in [*filter(None, prefixes), sys.prefix]:
        file = Path(prefix, 'share', package, kind, f'{name}.{kind}')
        if file.is_file():
            return file.read_text(encoding='utf-8')
    raise BagTypeError(f'no installed package {package} has {kind}/{name}.{kind}')


def element_of(kind: Nodetype, detail: Any) -> Any:  # noqa: ANN401 - a parse tree of rosbags
    """Return kind and detail of a field's type, or of its elements where it has many."""
    return detail[0] if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else (kind, detail)


class Decoder:
    """Decodes the messages of one bag, by the bag's own definitions where it has them."""

    def __init__(self) -> None:
        """Begin with Jazzy's types."""
        self._embedded = typesys.get_typestore(typesys.Stores.EMPTY)
        self._names: set[str] = set()

    def learn(self, channel: Channel) -> None:
        """Use the bag's definition of a type. Without a usable one, Jazzy's is used.

        Definitions in IDL are not read: rosbag2 writes them for services alone.
        """
        name, is_idl = channel.msgtype, channel.format == 'ros2idl'
        if not channel.definition or is_idl or name in self._names:
            return
        store = self._embedded
        with suppress(*DEFINITION_ERRORS):
            types = parse_definition(channel)
            store.register({n: found for n, found in types.items() if n not in store.fielddefs})
            # Compiled now, so that a type with unknown parts counts as unknown.
            store.get_msgdef(name)
            self._names.add(name)

    def knows(self, msgtype: str) -> bool:
        """Tell whether messages of a type can be decoded."""
        return msgtype in self._names or msgtype in bag_types().types

    def decode(self, msgtype: str, data: bytes) -> Any:  # noqa: ANN401 - of the message's type
        """Return a message with its fields as attributes; arrays are numpy's.

        Raises DecodeError for data that do not fit the type, UnknownTypeError for the type.
        """
        if data[:4] == ZSTD_MAGIC:
            with raising(DecodeError, '', ValueError, zstandard.ZstdError):
                data = unzstd(data)
        try:
            if msgtype in self._names:
                return self._embedded.deserialize_cdr(data, msgtype)
            return bag_types().deserialize_cdr(data, msgtype)
        except SerdeError as error:
            raise DecodeError(str(error)) from None
        except DEFINITION_ERRORS as error:
            message = f'its type {msgtype} is unknown here and the bag does not define it'
            raise UnknownTypeError(f'{message} ({error})') from None


def parse_definition(channel: Channel) -> dict[str, Any]:
    """Return the types in a channel's definition by name, as rosbags' parse trees.

    Raises one of DEFINITION_ERRORS, also for arrays of more messages than MAX_ELEMENTS.
    """
    if len(channel.definition) > MAX_DEFINITION:
        raise ValueError(f'over {MAX_DEFINITION} characters')
    types = dict(typesys.get_types_from_msg(channel.definition, channel.msgtype))
    for name, (_, fields) in types.items():
        for field, (kind, detail) in fields:
            element, base = element_of(kind, detail)
            # Arrays of numbers are read at once.
            at_once = element is Nodetype.BASE and base[0] not in ('string', 'wstring')
            if kind is Nodetype.ARRAY and int(detail[1]) > MAX_ELEMENTS and not at_once:
                raise ValueError(f'{name}: {field}: {detail[1]} elements')
    return types


# Topics, with the names that the nodes use by default.
MAP = '/map'
# The barriers that the next map was made from, as JSON. They make the paper's waypoint filter
# exact and keep the samples' ids.
BARRIER_MAP = '/llm_astar/barrier_map'
# Service introspection publishes the requests and responses of GetPlan here.
GET_PLAN_EVENT = '/planner_node/get_plan/_service_event'
NANOSECONDS = 1_000_000_000
# The last second that a Time can hold; the clock of a damaged bag may be later.
LAST_SECOND = 2**31 - 1
# Of service_msgs/ServiceEventInfo.
REQUEST_RECEIVED = 1


def occupancy_grid(grid_map: GridMap, stamp: int) -> object:
    """Return a map message whose stamp and load time are `stamp` (ns)."""
    return make_message(
        'nav_msgs/msg/OccupancyGrid',
        header=header(grid_map.frame_id, stamp),
        info={
            'map_load_time': time_of(stamp),
            'resolution': grid_map.resolution,
            'width': grid_map.width,
            'height': grid_map.height,
            'origin': pose_of(grid_map.origin),
        },
        data=grid_map.cells.ravel(),
    )


def barrier_map_text(barrier_map: BarrierMap) -> object:
    """Return a barrier map as a string message of its dataset's JSON."""
    return make_message('std_msgs/msg/String', data=json.dumps(barrier_map.to_json()))


def get_plan_request(
    start: Pose2D, goal: Pose2D, frame_id: str, stamp: int, number: int
) -> object:
    """Return the event that a server of GetPlan publishes for its request `number`."""
    head = header(frame_id, stamp)
    ends = {'start': start, 'goal': goal}
    request = {name: {'header': head, 'pose': pose_of(pose)} for name, pose in ends.items()}
    info = {'event_type': REQUEST_RECEIVED, 'stamp': time_of(stamp), 'sequence_number': number}
    return make_message(GET_PLAN_EVENT_TYPE, info=info, request=[request])


def make_message(msgtype: str, **given: Any) -> object:  # noqa: ANN401 - of the message's own types
    """Return a message of `bag_types()`; a field that is not given is 0 or empty."""
    parts, empty = empty_fields(msgtype)
    filled = {name: with_parts(parts.get(name, ''), value) for name, value in given.items()}
    return bag_types().types[msgtype](**(empty | filled))


def with_parts(msgtype: str, value: Any) -> Any:  # noqa: ANN401 - of the field's type
    """Return the value of a field with messages of this type for dicts."""
    if isinstance(value, list):
        return [with_parts(msgtype, item) for item in value]
    return make_message(msgtype, **value) if isinstance(value, dict) else value


@cache
def empty_fields(msgtype: str) -> tuple[dict[str, str], dict[str, Any]]:
    """Return the types of a message's fields that are messages, and what empty fields hold."""
    parts, empty = {}, {}
    for name, (kind, detail) in bag_types().fielddefs[msgtype][1]:
        element, base = element_of(kind, detail)
        has_many = kind in (Nodetype.ARRAY, Nodetype.SEQUENCE)
        if element is Nodetype.NAME:
            parts[name] = base
            empty[name] = [] if has_many else make_message(base)
        elif has_many:
            count = int(detail[1]) if kind is Nodetype.ARRAY else 0
            empty[name] = np.zeros(count, dtype=base[0])
        else:
            empty[name] = {'string': '', 'bool': False}.get(base[0], 0)
    return parts, empty


def time_of(stamp: int) -> dict[str, int]:
    """Return the fields of a time in nanoseconds."""
    seconds, rest = divmod(stamp, NANOSECONDS)
    return {'sec': min(seconds, LAST_SECOND), 'nanosec': rest}


def header(frame_id: str, stamp: int) -> object:
    """Return a header with its stamp in nanoseconds."""
    return make_message('std_msgs/msg/Header', stamp=time_of(stamp), frame_id=frame_id)


def pose_of(pose: Pose2D) -> dict[str, dict[str, float]]:
    """Return the fields of a pose in the plane."""
    turn = {'z': math.sin(pose.yaw / 2.0), 'w': math.cos(pose.yaw / 2.0)}
    return {'position': {'x': float(pose.x), 'y': float(pose.y)}, 'orientation': turn}

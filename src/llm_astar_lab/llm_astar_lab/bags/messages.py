# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Topics and messages of the bags that are written here, made without ROS.

A message within a message may be given as a dict of its fields.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import headings_along
from numpy.typing import ArrayLike
from rosbags.interfaces import Nodetype

from llm_astar_lab.bags.types import GET_PLAN_EVENT_TYPE, bag_types, element_of

# Topics, with the names that the nodes use by default.
MAP = '/map'
# The barriers that the next map was made from, as JSON. They make the paper's waypoint filter
# exact and keep the samples' ids.
BARRIER_MAP = '/llm_astar/barrier_map'
# Service introspection publishes the requests and responses of GetPlan here.
GET_PLAN_EVENT = '/planner_node/get_plan/_service_event'
EVALUATION = '/evaluation'

NANOSECONDS = 1_000_000_000
# The last second that a Time can hold; the clock of a damaged bag may be later.
LAST_SECOND = 2**31 - 1
# Constants of service_msgs/ServiceEventInfo and visualization_msgs/Marker.
REQUEST_RECEIVED = 1
SPHERE_LIST, ADD, DELETE = 7, 0, 2
ACCEPTED = {'r': 0.16, 'g': 0.63, 'b': 0.17, 'a': 1.0}
REJECTED = {'r': 0.84, 'g': 0.15, 'b': 0.16, 'a': 1.0}


def evaluation_topic(method: str, source: str, kind: str) -> str:
    """Return a topic of an evaluation's results: `kind` is plan, report or markers.

    Characters that a ROS name cannot have become underscores.
    """
    named = method if source in ('', 'none') else f'{method} {source}'
    words = ''.join(c if c.isascii() and c.isalnum() else ' ' for c in named).split()
    return f'{EVALUATION}/{"_".join(words)}/{kind}'


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
    request = {name: {'header': head, 'pose': pose_of(pose)}
               for name, pose in (('start', start), ('goal', goal))}  # fmt: skip
    info = {'event_type': REQUEST_RECEIVED, 'stamp': time_of(stamp), 'sequence_number': number}
    return make_message(GET_PLAN_EVENT_TYPE, info=info, request=[request])


def path(points: ArrayLike, frame_id: str, stamp: int) -> object:
    """Return points [n, 2] in metres as a path, each pose oriented towards the next."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    head = header(frame_id, stamp)
    poses = [
        {'header': head, 'pose': pose_of(Pose2D(x, y, yaw))}
        for (x, y), yaw in zip(points.tolist(), headings_along(points))
    ]
    return make_message('nav_msgs/msg/Path', header=head, poses=poses)


def status(name: str, level: int, message: str, values: Mapping[str, Any], stamp: int) -> object:
    """Return one diagnostic status with JSON values, like the planner node's report."""
    pairs = [{'key': key, 'value': json.dumps(value)} for key, value in values.items()]
    one = {'level': level, 'name': name, 'message': message, 'values': pairs}
    array = 'diagnostic_msgs/msg/DiagnosticArray'
    return make_message(array, header=header('', stamp), status=[one])


def waypoint_markers(
    waypoints: Sequence[tuple[float, float, str]], size: float, frame_id: str, stamp: int
) -> object:
    """Return waypoints (x, y in metres, status) as spheres of `size` metres.

    Green where accepted, red where not. They replace the spheres before; no waypoints delete them.
    """
    marker = {
        'header': header(frame_id, stamp),
        'ns': 'waypoints',
        'type': SPHERE_LIST,
        'action': ADD if waypoints else DELETE,
        'pose': pose_of(Pose2D(0.0, 0.0)),
        'scale': {'x': size, 'y': size, 'z': size},
        'color': ACCEPTED,
        'points': [{'x': float(x), 'y': float(y)} for x, y, _ in waypoints],
        'colors': [ACCEPTED if found == 'accepted' else REJECTED for *_, found in waypoints],
    }
    return make_message('visualization_msgs/msg/MarkerArray', markers=[marker])


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

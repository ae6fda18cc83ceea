"""Plain values as messages for bags, which need no ROS installed."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from llm_astar_msgs_adapter.bag_types import GET_PLAN_EVENT_TYPE, bag_types
from llm_astar_msgs_adapter.barrier_map import BarrierMap
from llm_astar_msgs_adapter.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.headings import headings

NANOSECONDS = 1_000_000_000
REQUEST_RECEIVED = 1


def occupancy_grid(grid_map: GridMap, stamp: int) -> object:
    """Write a map, stamped and with its load time set to `stamp` (nanoseconds)."""
    return _make(
        'nav_msgs/msg/OccupancyGrid',
        header=_header(grid_map.frame_id, stamp),
        info=_make(
            'nav_msgs/msg/MapMetaData',
            map_load_time=_time(stamp),
            resolution=grid_map.resolution,
            width=grid_map.width,
            height=grid_map.height,
            origin=_pose(grid_map.origin),
        ),
        data=grid_map.cells.ravel(),
    )


def barrier_map_text(barrier_map: BarrierMap) -> object:
    """Write a barrier map as a string of the dataset's own JSON."""
    return _make('std_msgs/msg/String', data=json.dumps(barrier_map.to_json()))


def get_plan_request(
    start: Pose2D, goal: Pose2D, frame_id: str, stamp: int, number: int
) -> object:
    """Write the event of a request of GetPlan as its server tells it; `number` counts them."""
    service = GET_PLAN_EVENT_TYPE.removesuffix('_Event')
    request = _make(
        f'{service}_Request',
        start=_pose_stamped(start, frame_id, stamp),
        goal=_pose_stamped(goal, frame_id, stamp),
        tolerance=0.0,
    )
    info = _make(
        'service_msgs/msg/ServiceEventInfo',
        event_type=REQUEST_RECEIVED,
        stamp=_time(stamp),
        client_gid=np.zeros(16, dtype=np.uint8),
        sequence_number=number,
    )
    return _make(GET_PLAN_EVENT_TYPE, info=info, request=[request], response=[])


def path(points: ArrayLike, frame_id: str, stamp: int, goal_yaw: float | None = None) -> object:
    """Write points [n, 2] in metres as a path, each pose looking towards the next."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    poses = [
        _pose_stamped(Pose2D(x, y, yaw), frame_id, stamp)
        for (x, y), yaw in zip(points.tolist(), headings(points, goal_yaw))
    ]
    return _make('nav_msgs/msg/Path', header=_header(frame_id, stamp), poses=poses)


def status(name: str, level: int, message: str, values: Mapping[str, Any], stamp: int) -> object:
    """Write one diagnostic status with JSON values, as the live report has them."""
    pairs = [
        _make('diagnostic_msgs/msg/KeyValue', key=key, value=json.dumps(value))
        for key, value in values.items()
    ]
    one = _make(
        'diagnostic_msgs/msg/DiagnosticStatus',
        level=level,
        name=name,
        message=message,
        hardware_id='',
        values=pairs,
    )
    array = 'diagnostic_msgs/msg/DiagnosticArray'
    return _make(array, header=_header('', stamp), status=[one])


def _make(msgtype: str, **fields: Any) -> object:  # noqa: ANN401 - of the message's own types
    return bag_types().types[msgtype](**fields)


def _time(stamp: int) -> object:
    seconds, rest = divmod(stamp, NANOSECONDS)
    return _make('builtin_interfaces/msg/Time', sec=seconds, nanosec=rest)


def _header(frame_id: str, stamp: int) -> object:
    return _make('std_msgs/msg/Header', stamp=_time(stamp), frame_id=frame_id)


def _pose(pose: Pose2D) -> object:
    half = pose.yaw / 2.0
    point = _make('geometry_msgs/msg/Point', x=float(pose.x), y=float(pose.y), z=0.0)
    turn = _make('geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=math.sin(half), w=math.cos(half))
    return _make('geometry_msgs/msg/Pose', position=point, orientation=turn)


def _pose_stamped(pose: Pose2D, frame_id: str, stamp: int) -> object:
    message = 'geometry_msgs/msg/PoseStamped'
    return _make(message, header=_header(frame_id, stamp), pose=_pose(pose))

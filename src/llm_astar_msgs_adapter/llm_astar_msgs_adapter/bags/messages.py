"""Plain values as messages for bags, which need no ROS installed."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from llm_astar_msgs_adapter.bags.types import GET_PLAN_EVENT_TYPE, bag_types
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import headings_along

NANOSECONDS = 1_000_000_000
# A Time has no later one; the clock of a broken bag may.
LAST_SECOND = 2**31 - 1
# service_msgs/ServiceEventInfo's, and visualization_msgs/Marker's.
REQUEST_RECEIVED = 1
SPHERE_LIST, ADD, DELETE = 7, 0, 2
ACCEPTED, REFUSED = (0.16, 0.63, 0.17), (0.84, 0.15, 0.16)
NO_BYTES = np.zeros(0, dtype=np.uint8)


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
        for (x, y), yaw in zip(points.tolist(), headings_along(points, goal_yaw))
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


def waypoint_markers(
    waypoints: Sequence[tuple[float, float, str]], size: float, frame_id: str, stamp: int
) -> object:
    """Draw waypoints (x, y in metres, verdict) as spheres of `size` metres.

    Green where accepted, red where not. They take the place of those before; no waypoints remove
    them.
    """
    colours = [ACCEPTED if verdict == 'accepted' else REFUSED for *_, verdict in waypoints]
    marker = _make(
        'visualization_msgs/msg/Marker',
        header=_header(frame_id, stamp),
        ns='waypoints',
        id=0,
        type=SPHERE_LIST,
        action=ADD if waypoints else DELETE,
        pose=_pose(Pose2D(0.0, 0.0)),
        scale=_make('geometry_msgs/msg/Vector3', x=size, y=size, z=size),
        color=_colour(ACCEPTED),
        lifetime=_make('builtin_interfaces/msg/Duration', sec=0, nanosec=0),
        frame_locked=False,
        points=[_point(x, y) for x, y, _ in waypoints],
        colors=[_colour(colour) for colour in colours],
        texture_resource='',
        texture=_make(
            'sensor_msgs/msg/CompressedImage', header=_header('', 0), format='', data=NO_BYTES
        ),
        uv_coordinates=[],
        text='',
        mesh_resource='',
        mesh_file=_make('visualization_msgs/msg/MeshFile', filename='', data=NO_BYTES),
        mesh_use_embedded_materials=False,
    )
    return _make('visualization_msgs/msg/MarkerArray', markers=[marker])


def _make(msgtype: str, **fields: Any) -> object:  # noqa: ANN401 - of the message's own types
    return bag_types().types[msgtype](**fields)


def _time(stamp: int) -> object:
    seconds, rest = divmod(stamp, NANOSECONDS)
    return _make('builtin_interfaces/msg/Time', sec=min(seconds, LAST_SECOND), nanosec=rest)


def _header(frame_id: str, stamp: int) -> object:
    return _make('std_msgs/msg/Header', stamp=_time(stamp), frame_id=frame_id)


def _point(x: float, y: float) -> object:
    return _make('geometry_msgs/msg/Point', x=float(x), y=float(y), z=0.0)


def _colour(colour: tuple[float, float, float]) -> object:
    red, green, blue = colour
    return _make('std_msgs/msg/ColorRGBA', r=red, g=green, b=blue, a=1.0)


def _pose(pose: Pose2D) -> object:
    half = pose.yaw / 2.0
    point = _point(pose.x, pose.y)
    turn = _make('geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=math.sin(half), w=math.cos(half))
    return _make('geometry_msgs/msg/Pose', position=point, orientation=turn)


def _pose_stamped(pose: Pose2D, frame_id: str, stamp: int) -> object:
    message = 'geometry_msgs/msg/PoseStamped'
    return _make(message, header=_header(frame_id, stamp), pose=_pose(pose))

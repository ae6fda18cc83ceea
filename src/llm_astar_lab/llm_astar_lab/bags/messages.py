"""Topics and messages of the bags that are written here, made without ROS.

Live messages are made in `messages/`, since rclpy's classes are filled field by field, which is
twice as fast for them, while those of rosbags take all their fields at once.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import headings_along
from numpy.typing import ArrayLike

from llm_astar_lab.bags.types import GET_PLAN_EVENT_TYPE, bag_types

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
ACCEPTED, REJECTED = (0.16, 0.63, 0.17), (0.84, 0.15, 0.16)
NO_BYTES = np.zeros(0, dtype=np.uint8)


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
        header=make_header(grid_map.frame_id, stamp),
        info=make_message(
            'nav_msgs/msg/MapMetaData',
            map_load_time=make_time(stamp),
            resolution=grid_map.resolution,
            width=grid_map.width,
            height=grid_map.height,
            origin=make_pose(grid_map.origin),
        ),
        data=grid_map.cells.ravel(),
    )


def barrier_map_text(barrier_map: BarrierMap) -> object:
    """Return a barrier map as a string message of its dataset's JSON."""
    return make_message('std_msgs/msg/String', data=json.dumps(barrier_map.to_json()))


def get_plan_request(
    start: Pose2D, goal: Pose2D, frame_id: str, stamp: int, number: int
) -> object:
    """Return the event that a server of GetPlan publishes for its request `number`."""
    service = GET_PLAN_EVENT_TYPE.removesuffix('_Event')
    request = make_message(
        f'{service}_Request',
        start=make_pose_stamped(start, frame_id, stamp),
        goal=make_pose_stamped(goal, frame_id, stamp),
        tolerance=0.0,
    )
    info = make_message(
        'service_msgs/msg/ServiceEventInfo',
        event_type=REQUEST_RECEIVED,
        stamp=make_time(stamp),
        client_gid=np.zeros(16, dtype=np.uint8),
        sequence_number=number,
    )
    return make_message(GET_PLAN_EVENT_TYPE, info=info, request=[request], response=[])


def path(points: ArrayLike, frame_id: str, stamp: int, goal_yaw: float | None = None) -> object:
    """Return points [n, 2] in metres as a path, each pose oriented towards the next."""
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    poses = [
        make_pose_stamped(Pose2D(x, y, yaw), frame_id, stamp)
        for (x, y), yaw in zip(points.tolist(), headings_along(points, goal_yaw))
    ]
    return make_message('nav_msgs/msg/Path', header=make_header(frame_id, stamp), poses=poses)


def status(name: str, level: int, message: str, values: Mapping[str, Any], stamp: int) -> object:
    """Return one diagnostic status with JSON values, like the planner node's report."""
    pairs = [
        make_message('diagnostic_msgs/msg/KeyValue', key=key, value=json.dumps(value))
        for key, value in values.items()
    ]
    one = make_message(
        'diagnostic_msgs/msg/DiagnosticStatus',
        level=level,
        name=name,
        message=message,
        hardware_id='',
        values=pairs,
    )
    array = 'diagnostic_msgs/msg/DiagnosticArray'
    return make_message(array, header=make_header('', stamp), status=[one])


def waypoint_markers(
    waypoints: Sequence[tuple[float, float, str]], size: float, frame_id: str, stamp: int
) -> object:
    """Return waypoints (x, y in metres, status) as spheres of `size` metres.

    Green where accepted, red where not. They replace the spheres before; no waypoints delete them.
    """
    colours = [ACCEPTED if status == 'accepted' else REJECTED for *_, status in waypoints]
    marker = make_message(
        'visualization_msgs/msg/Marker',
        header=make_header(frame_id, stamp),
        ns='waypoints',
        id=0,
        type=SPHERE_LIST,
        action=ADD if waypoints else DELETE,
        pose=make_pose(Pose2D(0.0, 0.0)),
        scale=make_message('geometry_msgs/msg/Vector3', x=size, y=size, z=size),
        color=make_colour(ACCEPTED),
        lifetime=make_message('builtin_interfaces/msg/Duration', sec=0, nanosec=0),
        frame_locked=False,
        points=[make_point(x, y) for x, y, _ in waypoints],
        colors=[make_colour(colour) for colour in colours],
        texture_resource='',
        texture=make_message(
            'sensor_msgs/msg/CompressedImage', header=make_header('', 0), format='', data=NO_BYTES
        ),
        uv_coordinates=[],
        text='',
        mesh_resource='',
        mesh_file=make_message('visualization_msgs/msg/MeshFile', filename='', data=NO_BYTES),
        mesh_use_embedded_materials=False,
    )
    return make_message('visualization_msgs/msg/MarkerArray', markers=[marker])


def make_message(msgtype: str, **fields: Any) -> object:  # noqa: ANN401 - of the message's own types
    """Return a message of `bag_types()`."""
    return bag_types().types[msgtype](**fields)


def make_time(stamp: int) -> object:
    """Return a time in nanoseconds as a message."""
    seconds, rest = divmod(stamp, NANOSECONDS)
    return make_message('builtin_interfaces/msg/Time', sec=min(seconds, LAST_SECOND), nanosec=rest)


def make_header(frame_id: str, stamp: int) -> object:
    """Return a header with its stamp in nanoseconds."""
    return make_message('std_msgs/msg/Header', stamp=make_time(stamp), frame_id=frame_id)


def make_point(x: float, y: float) -> object:
    """Return a point in the plane."""
    return make_message('geometry_msgs/msg/Point', x=float(x), y=float(y), z=0.0)


def make_colour(colour: tuple[float, float, float]) -> object:
    """Return an opaque colour of red, green and blue, each 0 to 1."""
    red, green, blue = colour
    return make_message('std_msgs/msg/ColorRGBA', r=red, g=green, b=blue, a=1.0)


def make_pose(pose: Pose2D) -> object:
    """Return a pose in the plane."""
    half = pose.yaw / 2.0
    point = make_point(pose.x, pose.y)
    turn = make_message(
        'geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)
    )
    return make_message('geometry_msgs/msg/Pose', position=point, orientation=turn)


def make_pose_stamped(pose: Pose2D, frame_id: str, stamp: int) -> object:
    """Return a pose in the plane with its header; the stamp is in nanoseconds."""
    message = 'geometry_msgs/msg/PoseStamped'
    return make_message(message, header=make_header(frame_id, stamp), pose=make_pose(pose))

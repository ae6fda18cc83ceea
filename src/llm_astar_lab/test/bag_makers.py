"""Helpers that make the messages of a robot and write them as small bags."""

import json

import numpy as np
from llm_astar_lab.bags.types import (
    NANOSECONDS,
    bag_types,
    define,
    get_plan_request,
    make_message,
    occupancy_grid,
)
from llm_astar_lab.bags.writing import BagWriter, OfferedTopic
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

TYPES = {
    '/map': 'nav_msgs/msg/OccupancyGrid',
    '/planner_node/get_plan/_service_event': 'nav_msgs/srv/GetPlan_Event',
    '/goal_pose': 'geometry_msgs/msg/PoseStamped',
    '/initialpose': 'geometry_msgs/msg/PoseWithCovarianceStamped',
    '/amcl_pose': 'geometry_msgs/msg/PoseWithCovarianceStamped',
    '/plan': 'nav_msgs/msg/Path',
    '/planner_node/report': 'diagnostic_msgs/msg/DiagnosticArray',
    '/llm_client_node/exchange': 'diagnostic_msgs/msg/DiagnosticArray',
    '/tf': 'tf2_msgs/msg/TFMessage',
    '/tf_static': 'tf2_msgs/msg/TFMessage',
    '/odom': 'nav_msgs/msg/Odometry',
    '/chatter': 'std_msgs/msg/String',
    '/llm_astar/barrier_map': 'std_msgs/msg/String',
}
EVENT = '/planner_node/get_plan/_service_event'
SQLITE3 = StoragePlugin.SQLITE3


def make(msgtype, **fields):
    return bag_types().types[msgtype](**fields)


def room(width=20, height=10, *walls):
    """Return a walled room of 1 m cells with further occupied cells."""
    cells = np.zeros((height, width), dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    for x, y in walls:
        cells[y, x] = 100
    return GridMap(cells, 1.0, Pose2D(-0.5, -0.5))


def at(seconds):
    return int(seconds * NANOSECONDS)


def write_bag(folder, messages, storage='mcap'):
    """Write (topic, seconds, message) in this order; a message may be serialized."""
    topics = dict.fromkeys(topic for topic, _, _ in messages)
    if storage == 'sqlite3':
        return write_sqlite3(folder, messages, topics)
    with BagWriter(folder) as bag:
        for topic in topics:
            bag.add_topic(OfferedTopic(topic, define(TYPES[topic])))
        for topic, seconds, message in messages:
            if isinstance(message, bytes):
                bag.write(topic, at(seconds), message)
            else:
                bag.write_message(topic, at(seconds), message)
    return folder


def write_split(folder, messages):
    """Write a bag with a file for each message, as a recorder does that splits it."""
    folder.mkdir()
    names = [f'{folder.name}_{number}.mcap' for number in range(len(messages))]
    for name, message in zip(names, messages):
        part = write_bag(folder / 'part', [message])
        (part / 'part_0.mcap').rename(folder / name)
        (part / 'metadata.yaml').unlink()
        part.rmdir()
    described = {'rosbag2_bagfile_information': {'relative_file_paths': names}}
    (folder / 'metadata.yaml').write_text(json.dumps(described))
    return folder


def as_sqlite3(bag, folder):
    """Write a bag again as rosbags does, in sqlite3."""
    with Reader(bag) as source, Writer(folder, version=9, storage_plugin=SQLITE3) as copy:
        topics = {}
        for one in source.connections:
            defined = {'msgdef': one.msgdef.data, 'rihs01': one.digest}
            topics[one.topic] = copy.add_connection(one.topic, one.msgtype, **defined)
        for one, stamp, data in source.messages():
            copy.write(topics[one.topic], stamp, data)
    return folder


def write_sqlite3(folder, messages, topics):
    with Writer(folder, version=9, storage_plugin=SQLITE3) as bag:
        for topic in topics:
            _, text, _, digest = define(TYPES[topic])
            topics[topic] = bag.add_connection(topic, TYPES[topic], msgdef=text, rihs01=digest)
        for topic, seconds, message in messages:
            is_raw = isinstance(message, bytes)
            data = message if is_raw else bag_types().serialize_cdr(message, TYPES[topic])
            bag.write(topics[topic], at(seconds), data)
    return folder


def path(points, frame, stamp):
    head = {'stamp': {'sec': stamp // NANOSECONDS, 'nanosec': stamp % NANOSECONDS}}
    head['frame_id'] = frame
    places = ({'x': float(x), 'y': float(y)} for x, y in points)
    poses = [{'position': place, 'orientation': {'w': 1.0}} for place in places]
    poses = [{'header': head, 'pose': pose} for pose in poses]
    return make_message('nav_msgs/msg/Path', header=head, poses=poses)


def status(name, level, message, values, stamp):
    """Return one diagnostic status with JSON values, like the planner node's report."""
    pairs = [{'key': key, 'value': json.dumps(value)} for key, value in values.items()]
    one = {'level': level, 'name': name, 'message': message, 'values': pairs}
    head = {'stamp': {'sec': stamp // NANOSECONDS, 'nanosec': stamp % NANOSECONDS}}
    return make_message('diagnostic_msgs/msg/DiagnosticArray', header=head, status=[one])


def map_at(seconds, grid_map):
    return '/map', seconds, occupancy_grid(grid_map, at(seconds))


def call_at(seconds, start, goal, number=1, frame='map'):
    request = get_plan_request(Pose2D(*start), Pose2D(*goal), frame, at(seconds), number)
    return EVENT, seconds, request


def answer_at(seconds, points, number=1):
    """Return the event that a server publishes for its response to a call."""
    info = make(
        'service_msgs/msg/ServiceEventInfo',
        event_type=2,
        stamp=make('builtin_interfaces/msg/Time', sec=int(seconds), nanosec=0),
        client_gid=np.zeros(16, dtype=np.uint8),
        sequence_number=number,
    )
    response = make('nav_msgs/srv/GetPlan_Response', plan=path(points, 'map', at(seconds)))
    return EVENT, seconds, make(TYPES[EVENT], info=info, request=[], response=[response])


def pose(x, y):
    point = make('geometry_msgs/msg/Point', x=float(x), y=float(y), z=0.0)
    turn = make('geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=0.0, w=1.0)
    return make('geometry_msgs/msg/Pose', position=point, orientation=turn)


def header(seconds, frame):
    stamp = make('builtin_interfaces/msg/Time', sec=int(seconds), nanosec=0)
    return make('std_msgs/msg/Header', stamp=stamp, frame_id=frame)


def goal_at(seconds, place, frame='map'):
    message = make(TYPES['/goal_pose'], header=header(seconds, frame), pose=pose(*place))
    return '/goal_pose', seconds, message


def start_at(seconds, place, frame='map', topic='/initialpose'):
    covered = make(
        'geometry_msgs/msg/PoseWithCovariance', pose=pose(*place), covariance=np.zeros(36)
    )
    return topic, seconds, make(TYPES[topic], header=header(seconds, frame), pose=covered)


def odometry_at(seconds, place, frame='map'):
    zero = make('geometry_msgs/msg/Vector3', x=0.0, y=0.0, z=0.0)
    twist = make(
        'geometry_msgs/msg/TwistWithCovariance',
        twist=make('geometry_msgs/msg/Twist', linear=zero, angular=zero),
        covariance=np.zeros(36),
    )
    covered = make(
        'geometry_msgs/msg/PoseWithCovariance', pose=pose(*place), covariance=np.zeros(36)
    )
    fields = {'child_frame_id': 'base_link', 'pose': covered, 'twist': twist}
    return '/odom', seconds, make(TYPES['/odom'], header=header(seconds, frame), **fields)


def tf_at(seconds, parent, child, place, topic='/tf'):
    transform = make(
        'geometry_msgs/msg/Transform',
        translation=make('geometry_msgs/msg/Vector3', x=place[0], y=place[1], z=0.0),
        rotation=pose(0, 0).orientation,
    )
    stamped = make(
        'geometry_msgs/msg/TransformStamped',
        header=header(seconds, parent),
        child_frame_id=child,
        transform=transform,
    )
    return topic, seconds, make('tf2_msgs/msg/TFMessage', transforms=[stamped])


def plan_at(seconds, points, stamp=None):
    stamp = at(seconds if stamp is None else stamp)
    return '/plan', seconds, path(points, 'map', stamp)


def report_at(seconds, code, waypoints, stamp, **values):
    values |= {'code_name': code, 'waypoints': waypoints}
    message = status('planner_node', 0, code, values, at(stamp))
    return '/planner_node/report', seconds, message


def exchange_at(when, **values):
    message = status('llm_client_node', 0, '', values, at(when))
    return '/llm_client_node/exchange', when, message


def list_at(seconds, value):
    return '/chatter', seconds, make('std_msgs/msg/String', data=json.dumps(value))

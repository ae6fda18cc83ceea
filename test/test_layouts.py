"""The layouts for RViz and Foxglove use topics, types and QoS of the nodes."""

import json
from typing import NamedTuple

import pytest
import rclpy
import yaml
from graph_tools import spinning, wait_for
from llm_astar_planner.nodes.llm_client_node import LlmClientNode
from llm_astar_planner.nodes.map_node import MapNode
from llm_astar_planner.nodes.planner.planner_node import PlannerNode
from llm_astar_planner.resources import find_file
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

SPACE = '/layouts'
DISPLAYS = {
    'Map': 'nav_msgs/msg/OccupancyGrid',
    'GridCells': 'nav_msgs/msg/GridCells',
    'Path': 'nav_msgs/msg/Path',
    'MarkerArray': 'visualization_msgs/msg/MarkerArray',
}
TOOLS = {
    'SetInitialPose': 'geometry_msgs/msg/PoseWithCovarianceStamped',
    'SetGoal': 'geometry_msgs/msg/PoseStamped',
}
# What Foxglove's panels can show; its 3D panel knows no GridCells.
SHOWN = {
    '3D': {
        'nav_msgs/msg/OccupancyGrid',
        'nav_msgs/msg/Path',
        'visualization_msgs/msg/MarkerArray',
    },
    'DiagnosticSummary': {'diagnostic_msgs/msg/DiagnosticArray'},
    'DiagnosticStatusPanel': {'diagnostic_msgs/msg/DiagnosticArray'},
}
# The demo's map and the legend left of it, in metres: x from, x to, y from, y to.
SIGHT = (-15.0, 50.5, -0.5, 30.5)
POSES = {'/goal_pose': 'SetGoal', '/initialpose': 'SetInitialPose'}
POLICIES = {
    'Reliable': ReliabilityPolicy.RELIABLE,
    'Best Effort': ReliabilityPolicy.BEST_EFFORT,
    'Transient Local': DurabilityPolicy.TRANSIENT_LOCAL,
    'Volatile': DurabilityPolicy.VOLATILE,
}


class Wanted(NamedTuple):
    """A topic of a layout."""

    topic: str
    kind: str
    qos: QoSProfile


@pytest.fixture(scope='module')
def nodes():
    """The nodes of the graph in a namespace of their own."""
    rclpy.init()
    made = [make(namespace=SPACE) for make in (MapNode, LlmClientNode, PlannerNode)]
    with spinning(*made):
        yield made
    rclpy.try_shutdown()


@pytest.fixture(scope='module')
def rviz_window():
    return yaml.safe_load(find_file('planner.rviz', 'config').read_text())


@pytest.fixture(scope='module')
def rviz(rviz_window):
    return rviz_window['Visualization Manager']


@pytest.fixture(scope='module')
def foxglove():
    return json.loads(find_file('foxglove.json', 'config').read_text())


def wanted(topic, kinds, item):
    name = item['Class'].removeprefix('rviz_default_plugins/')
    qos = QoSProfile(
        depth=topic['Depth'],
        reliability=POLICIES[topic['Reliability Policy']],
        durability=POLICIES[topic['Durability Policy']],
    )
    assert topic['History Policy'] == 'Keep Last'
    return Wanted(topic['Value'], kinds[name], qos)


def panels(foxglove, kind):
    configs = foxglove['configById'].items()
    return [config for name, config in configs if name.split('!')[0] == kind]


def endpoints_of(nodes, topic, end):
    """Return the publishers or subscriptions of a topic in the namespace of the nodes."""
    if topic != '/diagnostics':
        topic = f'{SPACE}/{topic.lstrip("/")}'
    found = getattr(nodes[0], f'get_{end}_info_by_topic')
    wait_for(lambda: found(topic), f'{end} of {topic}')
    return found(topic)


def gets(offered, requested):
    """Whether a subscription of one quality of service receives from a publisher of another."""
    reliable = (requested.reliability, offered.reliability)
    durable = (requested.durability, offered.durability)
    return reliable != (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT) and durable != (
        DurabilityPolicy.TRANSIENT_LOCAL,
        DurabilityPolicy.VOLATILE,
    )


def test_each_display_of_rviz_shows_a_topic_of_the_nodes_with_a_compatible_qos(nodes, rviz):
    displays = [wanted(item['Topic'], DISPLAYS, item) for item in rviz['Displays']]
    assert {item.topic for item in displays} == {
        'map',
        'plan',
        'planner_node/raw_plan',
        'planner_node/markers',
        'planner_node/explored',
        'planner_node/places',
        'planner_node/zones',
    }
    for item in displays:
        for publisher in endpoints_of(nodes, item.topic, 'publishers'):
            assert publisher.topic_type == item.kind
            assert gets(publisher.qos_profile, item.qos), item.topic
    assert displays[0].topic == 'map'
    assert displays[0].qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_the_buttons_of_rviz_publish_topics_that_the_planner_subscribes_to(nodes, rviz):
    tools = [wanted(item['Topic'], TOOLS, item) for item in rviz['Tools'] if 'Topic' in item]
    assert {item.topic for item in tools} == {'initialpose', 'goal_pose'}
    for item in tools:
        for subscriber in endpoints_of(nodes, item.topic, 'subscriptions'):
            assert subscriber.node_name == 'planner_node'
            assert subscriber.topic_type == item.kind
            assert gets(item.qos, subscriber.qos_profile), item.topic


def test_rviz_looks_at_the_frame_of_the_map(rviz):
    assert rviz['Global Options']['Fixed Frame'] == 'map'
    assert rviz['Views']['Current']['Target Frame'] == 'map'


def sees(centre, width, height):
    """Whether a view from above, of a width and height in metres, contains all of SIGHT."""
    left, right, low, high = SIGHT
    (x, y), half_width, half_height = centre, width / 2, height / 2
    wide = x - half_width <= left and right <= x + half_width
    return wide and y - half_height <= low and high <= y + half_height


def test_rviz_shows_the_whole_demo_map_next_to_its_panels(rviz, rviz_window):
    window, view = rviz_window['Window Geometry'], rviz['Views']['Current']
    # RViz reads these two into variables it has not set.
    assert window['Hide Left Dock'] is False
    assert window['Hide Right Dock'] is False
    width, height = window['Width'] - 350, window['Height'] - 150
    assert sees((view['X'], view['Y']), width / view['Scale'], height / view['Scale'])


def test_foxglove_shows_the_whole_demo_map_the_right_way_round(foxglove):
    (scene,) = panels(foxglove, '3D')
    camera = scene['cameraState']
    # `target` is the followed frame's place; what is looked at is `targetOffset`.
    assert camera['target'] == [0, 0, 0]
    assert sees(camera['targetOffset'][:2], 1.4 * camera['distance'], camera['distance'])
    # From straight above there is no direction to keep: the first zoom would turn the map.
    assert camera['phi'] > 0
    assert camera['thetaOffset'] == 0


def test_foxglove_draws_the_paths_over_the_map(foxglove):
    (scene,) = panels(foxglove, '3D')
    for topic in ('/plan', '/planner_node/raw_plan'):
        # An opaque line is drawn before the map, which then covers it.
        assert all(colour[7:] < 'ff' for colour in scene['topics'][topic]['gradient'])


def test_the_report_in_foxglove_does_not_become_stale(foxglove):
    for config in panels(foxglove, 'DiagnosticStatusPanel'):
        assert config['secondsUntilStale'] >= 3600


def test_every_panel_of_foxglove_is_placed_once_and_configured(foxglove):
    def leaves(place):
        if isinstance(place, str):
            return [place]
        assert place['direction'] in ('row', 'column')
        assert 0 < place['splitPercentage'] < 100
        return leaves(place['first']) + leaves(place['second'])

    assert sorted(leaves(foxglove['layout'])) == sorted(foxglove['configById'])
    assert {'configById', 'layout', 'globalVariables', 'userNodes', 'playbackConfig'} == set(
        foxglove
    )


def test_each_panel_of_foxglove_shows_topics_the_nodes_publish(nodes, foxglove):
    (scene,) = panels(foxglove, '3D')
    shown = [('3D', topic) for topic in scene['topics'] if topic not in POSES]
    for kind in ('DiagnosticSummary', 'DiagnosticStatusPanel'):
        shown += [(kind, config['topicToRender']) for config in panels(foxglove, kind)]
    for config in panels(foxglove, 'DiagnosticStatusPanel'):
        # A report is the status of the node that publishes it.
        assert config['selectedName'] == config['topicToRender'].split('/')[1]
    assert {topic for _, topic in shown} == {
        '/map',
        '/plan',
        '/planner_node/raw_plan',
        '/planner_node/markers',
        '/planner_node/places',
        '/planner_node/zones',
        '/planner_node/report',
        '/llm_client_node/exchange',
        '/diagnostics',
    }
    for kind, topic in shown:
        types = {info.topic_type for info in endpoints_of(nodes, topic, 'publishers')}
        assert types <= SHOWN[kind]


def test_foxglove_sends_instructions_and_poses_to_the_planner(nodes, foxglove):
    (scene,) = panels(foxglove, '3D')
    (panel,) = panels(foxglove, 'Publish')
    assert json.loads(panel['value']).keys() == {'data'}
    (subscriber,) = endpoints_of(nodes, panel['topicName'], 'subscriptions')
    assert subscriber.topic_type == panel['datatype'] == 'std_msgs/msg/String'
    for field, name in (('poseTopic', 'SetGoal'), ('poseEstimateTopic', 'SetInitialPose')):
        subscribers = endpoints_of(nodes, scene['publish'][field], 'subscriptions')
        assert [info.topic_type for info in subscribers] == [TOOLS[name]]

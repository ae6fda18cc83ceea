"""The layouts for RViz and Foxglove name what the nodes publish and hear, and can get it."""

import json
from typing import NamedTuple

import pytest
import rclpy
import yaml
from graph_tools import wait_for
from llm_astar_planner.nodes.llm_client_node import LlmClientNode
from llm_astar_planner.nodes.map_node import MapNode
from llm_astar_planner.nodes.planner_node import PlannerNode
from llm_astar_planner.share import find_file
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
    'RawMessages': {'diagnostic_msgs/msg/DiagnosticArray'},
}
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
    """The nodes of the graph in a namespace of their own; nobody needs to spin them."""
    rclpy.init()
    made = [make(namespace=SPACE) for make in (MapNode, LlmClientNode, PlannerNode)]
    yield made
    for node in made:
        node.destroy_node()
    rclpy.try_shutdown()


@pytest.fixture(scope='module')
def rviz():
    return yaml.safe_load(find_file('planner.rviz', 'config').read_text())['Visualization Manager']


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


def ends_of(nodes, topic, end):
    """Return who is at the other end of a topic; names from the root are those of our space."""
    if topic != '/diagnostics':
        topic = f'{SPACE}/{topic.lstrip("/")}'
    found = getattr(nodes[0], f'get_{end}_info_by_topic')
    wait_for(lambda: found(topic), f'{end} of {topic}')
    return found(topic)


def gets(offered, requested):
    """Whether a subscription of one quality of service hears a publisher of another."""
    reliable = (requested.reliability, offered.reliability)
    durable = (requested.durability, offered.durability)
    return reliable != (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT) and durable != (
        DurabilityPolicy.TRANSIENT_LOCAL,
        DurabilityPolicy.VOLATILE,
    )


def test_each_display_of_rviz_shows_a_topic_of_the_nodes_with_a_qos_that_gets_it(nodes, rviz):
    displays = [wanted(item['Topic'], DISPLAYS, item) for item in rviz['Displays']]
    assert {item.topic for item in displays} == {
        'map',
        'plan',
        'planner_node/raw_plan',
        'planner_node/markers',
        'planner_node/explored',
    }
    for item in displays:
        for publisher in ends_of(nodes, item.topic, 'publishers'):
            assert publisher.topic_type == item.kind
            assert gets(publisher.qos_profile, item.qos), item.topic
    assert displays[0].topic == 'map'
    assert displays[0].qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_the_buttons_of_rviz_publish_what_the_planner_hears(nodes, rviz):
    tools = [wanted(item['Topic'], TOOLS, item) for item in rviz['Tools'] if 'Topic' in item]
    assert {item.topic for item in tools} == {'initialpose', 'goal_pose'}
    for item in tools:
        for subscriber in ends_of(nodes, item.topic, 'subscriptions'):
            assert subscriber.node_name == 'planner_node'
            assert subscriber.topic_type == item.kind
            assert gets(item.qos, subscriber.qos_profile), item.topic


def test_rviz_looks_at_the_frame_of_the_map(rviz):
    assert rviz['Global Options']['Fixed Frame'] == 'map'
    assert rviz['Views']['Current']['Target Frame'] == 'map'


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
    shown += [
        ('RawMessages', config['topicPath'].split('.')[0])
        for config in panels(foxglove, 'RawMessages')
    ]
    for config in panels(foxglove, 'DiagnosticStatusPanel'):
        # A report is the status of the node that publishes it.
        assert config['selectedName'] == config['topicToRender'].split('/')[1]
    assert {topic for _, topic in shown} == {
        '/map',
        '/plan',
        '/planner_node/raw_plan',
        '/planner_node/markers',
        '/planner_node/report',
        '/llm_client_node/exchange',
        '/diagnostics',
    }
    for kind, topic in shown:
        assert {info.topic_type for info in ends_of(nodes, topic, 'publishers')} <= SHOWN[kind]


def test_foxglove_sends_wishes_and_poses_to_the_planner(nodes, foxglove):
    (scene,) = panels(foxglove, '3D')
    (panel,) = panels(foxglove, 'Publish')
    assert json.loads(panel['value']).keys() == {'data'}
    (subscriber,) = ends_of(nodes, panel['topicName'], 'subscriptions')
    assert subscriber.topic_type == panel['datatype'] == 'std_msgs/msg/String'
    for field, name in (('poseTopic', 'SetGoal'), ('poseEstimateTopic', 'SetInitialPose')):
        subscribers = ends_of(nodes, scene['publish'][field], 'subscriptions')
        assert [info.topic_type for info in subscribers] == [TOOLS[name]]

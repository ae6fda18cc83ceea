"""Recording the live graph by the real command, and the readers of other libraries."""

import contextlib
import csv
import json
import signal
import subprocess
import sys
import threading
import time

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from graph_tools import DEMO, PATIENCE, calling, in_this_process, wait_for
from llm_astar_lab.bags.types import bag_types
from llm_astar_lab.nodes.recorder import import_message_class
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_planner.cli.main import main
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE
from llm_astar_planner.resources import find_file
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetPlan
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader
from std_msgs.msg import String

ALONE = '/recorded'
EVENT = f'{ALONE}/planner_node/get_plan/_service_event'
LATCHED_ALL = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PAIRS = [
    tuple(Pose2D(float(x), float(y)) for x, y in (sample.start, sample.goal))
    for sample in load_barrier_maps(find_file('demo.json', 'maps'))[0].samples[:3]
]


@pytest.fixture(scope='module', autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@contextlib.contextmanager
def recording(folder, *options, namespace=ALONE, ending=signal.SIGINT):
    """Run `llm-astar record` as a process; end it by a signal, sent twice."""
    command = [sys.executable, '-m', 'llm_astar_planner.cli.main', 'record', '--out', str(folder)]
    recorder = subprocess.Popen(
        [*command, '--namespace', namespace, *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    recorder.lines = []
    reader = threading.Thread(target=lambda: recorder.lines.extend(recorder.stdout), daemon=True)
    reader.start()
    recorder.printed = lambda words: any(words in line for line in recorder.lines)
    try:
        yield recorder
        recorder.send_signal(ending)
        recorder.send_signal(ending)
        recorder.wait(PATIENCE)
    finally:
        recorder.kill()
        recorder.wait()
        reader.join(PATIENCE)
        recorder.stdout.close()


def read(folder):
    """Read a bag by the types it defines: (topic, time, message)."""
    with AnyReader([folder]) as reader:
        return [
            (connection.topic, stamp, reader.deserialize(data, connection.msgtype))
            for connection, stamp, data in reader.messages()
        ]


@pytest.fixture(scope='module')
def drive(_context, tmp_path_factory):
    """Record a graph that plans: the bag, the answers its caller got, the recorder."""
    folder = tmp_path_factory.mktemp('bags') / 'drive'
    with (
        recording(folder) as recorder,
        in_this_process('map_node', namespace=ALONE),
        in_this_process('llm_client_node', namespace=ALONE),
        in_this_process('planner_node', namespace=ALONE),
        calling(ALONE) as caller,
    ):
        caller.wait_until_ready(client='llm_client_node')
        for topic in ('map', 'plan', 'planner_node/report', 'llm_client_node/exchange'):
            wait_for(lambda topic=topic: recorder.printed(f'recording {ALONE}/{topic} '), topic)
        wait_for(lambda: recorder.printed(f'recording {EVENT}'), 'service events')
        # The recorder receives the latched map only after it has subscribed.
        time.sleep(1.0)
        events = []
        caller.listen(GetPlan.Event, EVENT, events.append, RELIABLE)
        wait_for(lambda: caller.node.count_publishers(EVENT), 'service events')
        answers = [caller.call(*pair)[:2] for pair in PAIRS]
        # The last answer's event leaves the planner right after the answer.
        wait_for(lambda: len(events) == 2 * len(PAIRS), 'the events of each call')
        time.sleep(0.5)
    assert recorder.returncode == 0, recorder.lines
    return folder, answers, recorder


def of(messages, topic):
    return [message for name, _, message in messages if name == f'{ALONE}/{topic}']


def test_a_drive_is_recorded_completely_and_in_order(drive):
    folder, answers, _ = drive
    messages = read(folder)
    assert of(messages, 'map')[0].info.width == 51
    events = of(messages, 'planner_node/get_plan/_service_event')
    assert [event.info.event_type for event in events] == [1, 2] * len(PAIRS)
    asked = [event.request[0] for event in events if len(event.request)]
    assert [(r.start.pose.position.x, r.goal.pose.position.x) for r in asked] == [
        (start.x, goal.x) for start, goal in PAIRS
    ]
    plans = of(messages, 'plan')
    for plan, (path, _) in zip(plans, answers, strict=True):
        assert path_from_message(plan).tolist() == path_from_message(path).tolist()
    reports = [
        {value.key: json.loads(value.value) for value in message.status[0].values}
        for message in of(messages, 'planner_node/report')
    ]
    assert [r['operation'] for r in reports] == [report.operation for _, report in answers]
    assert len(of(messages, 'llm_client_node/exchange')) == len(PAIRS)
    # Each request stands before what came of it, the first map before every request.
    names = [name.removeprefix(f'{ALONE}/') for name, _, _ in messages]
    order = [n for n in names if n in ('plan', 'planner_node/get_plan/_service_event')]
    assert order == [EVENT.removeprefix(f'{ALONE}/'), 'plan', order[0]] * len(PAIRS)
    assert names.index('map') < names.index(order[0])


def test_the_mcap_library_accepts_every_checksum_of_a_recording(drive):
    folder, _, _ = drive
    with (folder / 'drive_0.mcap').open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        counted = reader.get_summary().statistics.message_count
        assert sum(1 for _ in reader.iter_messages()) == counted == len(read(folder))
        plans = list(reader.iter_decoded_messages(topics=[f'{ALONE}/plan']))
    assert [len(plan.poses) > 2 for *_, plan in plans] == [True] * len(PAIRS)


def test_a_recording_keeps_the_qos_of_the_publishers(drive):
    folder, _, recorder = drive
    with Reader(folder) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles[0].durability for c in reader.connections}
    assert offered[f'{ALONE}/map'] is QosDurability.TRANSIENT_LOCAL
    assert offered[f'{ALONE}/plan'] is QosDurability.VOLATILE
    assert recorder.printed('never there: /recorded/map_updates')
    assert recorder.printed('3 /recorded/plan')


def test_a_recorded_drive_evaluated_with_replay_gives_the_same_paths(drive, tmp_path):
    """The same rules, the recorded exchanges: the same waypoints, cell for cell the same paths."""
    folder, answers, _ = drive
    out = tmp_path / 'out'
    topics = ['--map-topic', f'{ALONE}/map', '--plan-topic', f'{ALONE}/plan']
    options = ['--methods', 'llm_astar', '--source', 'replay', '--params-file', DEMO]
    assert main(['evaluate', str(folder), *topics, *options, '--out', str(out)]) == 0
    with (out / 'results.csv').open() as file:
        rows = [row for row in csv.DictReader(file) if row['source'] == 'replay']
    assert len(rows) == len(PAIRS)
    for row, (_, report) in zip(rows, answers, strict=True):
        assert row['code'] == report.code_name == 'NONE'
        assert row['recorded_problem'] == ''
        assert row['path'] == row['recorded_path']
        assert row['waypoints'] == row['recorded_waypoints'] != ''
        assert float(row['operation']) == report.operation
        assert float(row['length']) == pytest.approx(report.length)


def test_messages_are_written_as_they_come(tmp_path):
    """None is lost: those that have arrived when the recording ends are written too."""
    bag = tmp_path / 'bag'
    sent = [f'{number:05}' * 1000 for number in range(30)]
    node = rclpy.create_node('talker', namespace=ALONE)
    with recording(bag, '--topics', 'chatter', ending=signal.SIGTERM) as recorder:
        # Latched and of that depth: nothing is lost to a recorder that is found late.
        publisher = node.create_publisher(String, 'chatter', LATCHED_ALL)
        for text in sent:
            publisher.publish(String(data=text))
        wait_for(lambda: recorder.printed('recording /recorded/chatter'), 'the topic')
        wait_for(publisher.get_subscription_count, 'the recorder')
        publisher.wait_for_all_acked()
    node.destroy_node()
    assert recorder.returncode == 0, recorder.lines
    with Reader(bag) as reader:
        messages = list(reader.messages())
    texts = [
        bag_types().deserialize_cdr(data, 'std_msgs/msg/String').data for *_, data in messages
    ]
    assert texts == sent


def test_what_is_published_by_who_appears_and_leaves_at_once_is_recorded(tmp_path):
    bag = tmp_path / 'bag'
    node = rclpy.create_node('passer_by', namespace=ALONE)
    requests = {
        'goal_pose': (PoseStamped(), RELIABLE),
        'initialpose': (PoseWithCovarianceStamped(), RELIABLE),
        'map': (OccupancyGrid(), LATCHED),
    }
    with recording(bag) as recorder:
        for topic, (message, qos) in requests.items():
            wait_for(lambda topic=topic: node.count_subscribers(topic), topic)
            publisher = node.create_publisher(type(message), topic, qos)
            publisher.publish(message)
            publisher.wait_for_all_acked()
            node.destroy_publisher(publisher)
        wait_for(lambda: recorder.printed('recording /recorded/map '), 'the map')
    node.destroy_node()
    assert recorder.returncode == 0, recorder.lines
    assert [topic for topic, *_ in read(bag)] == [f'{ALONE}/{topic}' for topic in requests]
    assert recorder.printed('never there: /recorded/map_updates, /recorded/amcl_pose')


def test_a_later_publisher_with_a_weaker_qos_is_recorded_too(tmp_path):
    """A reliable subscription receives nothing from a best-effort publisher."""
    bag = tmp_path / 'bag'
    node = rclpy.create_node('talkers', namespace=ALONE)
    words = String(data='best effort' * 1000)
    with recording(bag, '--topics', 'chatter') as recorder:
        first = node.create_publisher(String, 'chatter', LATCHED_ALL)
        first.publish(String(data='reliable'))
        wait_for(lambda: recorder.printed('recording /recorded/chatter'), 'the topic')
        wait_for(first.get_subscription_count, 'the recorder')
        first.wait_for_all_acked()
        second = node.create_publisher(String, 'chatter', qos_profile_sensor_data)
        wait_for(lambda: recorder.printed('subscribed to /recorded/chatter again'), 'the second')
        # Best-effort messages are lost until discovery. Some of them fill a chunk of the file.
        file = bag / 'bag_0.mcap'
        size = file.stat().st_size
        wait_for(lambda: second.publish(words) or file.stat().st_size > size, 'the words')
    node.destroy_node()
    texts = [message.data for topic, _, message in read(bag) if topic.endswith('chatter')]
    assert texts[0] == 'reliable'
    assert set(texts[1:]) == {words.data}


def test_a_recorder_without_messages_says_so_and_exits_with_1(tmp_path, capfd):
    with recording(tmp_path / 'bag', '--duration', '0.5', namespace='nobody/') as recorder:
        assert recorder.wait(PATIENCE) == 1
    assert recorder.printed('never there: /nobody/map')
    assert recorder.printed('0 messages')
    assert main(['record', '--out', str(tmp_path / 'bag')]) == 2
    assert 'exists already' in capfd.readouterr().err
    for wrong in (('--topics', 'bad name'), ('--namespace', 'bad name')):
        assert main(['record', '--out', str(tmp_path / 'other'), *wrong]) == 2
        assert "bad name' is invalid" in capfd.readouterr().err
    assert not (tmp_path / 'other').exists()


def test_a_topics_type_imports_nothing_but_messages(tmp_path, monkeypatch):
    package = tmp_path / 'nosy_msgs'
    package.mkdir()
    (package / '__init__.py').write_text('raise SystemExit("imported")')
    monkeypatch.syspath_prepend(tmp_path)
    assert import_message_class('nav_msgs/msg/Path').__name__ == 'Path'
    assert import_message_class('nav_msgs/srv/GetPlan_Event').__name__ == 'GetPlan_Event'
    for name in ('nosy_msgs', 'this', '..', 'no_such_msgs'):
        with pytest.raises(ImportError, match='is no package of ROS messages'):
            import_message_class(f'{name}/msg/Path')

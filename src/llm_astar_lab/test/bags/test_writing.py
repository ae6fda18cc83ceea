"""Writing bags: described by metadata.yaml, closed after errors too."""

import io
import os
import resource
import shutil

import pytest
import yaml
from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.bags.types import BagTypeError, bag_types, define
from llm_astar_lab.bags.writing import BagWriteError, BagWriter, OfferedTopic, qos
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

STRING = 'std_msgs/msg/String'
CHATTER = OfferedTopic('/chatter', define(STRING), (qos(),))


def text(content):
    return bag_types().serialize_cdr(bag_types().types[STRING](data=content), STRING)


def write(bag, count, topic='/chatter', size=100):
    for number in range(count):
        bag.write(topic, 1000 + number, text(f'{number:0{size}}'))


def information(folder):
    return yaml.safe_load((folder / 'metadata.yaml').read_text())['rosbag2_bagfile_information']


def test_a_bag_is_a_file_that_its_metadata_describes(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic(CHATTER)
        write(bag, 25)
    found = information(tmp_path / 'bag')
    assert found['relative_file_paths'] == ['bag_0.mcap']
    files = sorted(file.name for file in (tmp_path / 'bag').iterdir())
    assert files == ['bag_0.mcap', 'metadata.yaml']
    assert [file['message_count'] for file in found['files']] == [25]
    assert found['message_count'] == 25
    assert found['starting_time']['nanoseconds_since_epoch'] == 1000
    assert found['duration']['nanoseconds'] == 24
    assert found['topics_with_message_count'][0]['message_count'] == 25
    with AnyReader([tmp_path / 'bag']) as reader:
        contents = [reader.deserialize(data, STRING).data for _, _, data in reader.messages()]
    assert contents == [f'{number:0100}' for number in range(25)]


def test_a_topic_added_later_is_in_the_metadata_too(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic(CHATTER)
        write(bag, 15)
        bag.add_topic(CHATTER._replace(name='/late'))
        write(bag, 2, '/late')
    with Reader(tmp_path / 'bag') as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        assert counts == bag.counts == {'/chatter': 15, '/late': 2}
        assert len(list(reader.messages())) == 17


def test_an_error_between_messages_still_leaves_a_complete_bag(tmp_path):
    def break_off():
        with BagWriter(tmp_path / 'bag') as bag:
            bag.add_topic(CHATTER)
            write(bag, 3)
            raise OSError('the disk is full')

    with pytest.raises(OSError, match='disk'):
        break_off()
    with Reader(tmp_path / 'bag') as reader:
        assert reader.message_count == 3


def test_an_unfinished_mcap_file_holds_all_but_the_last_chunk(tmp_path):
    bag = BagWriter(tmp_path / 'bag')
    with bag:
        bag.add_topic(CHATTER)
        write(bag, 100, size=10_000)
        cut_off = (tmp_path / 'bag' / 'bag_0.mcap').read_bytes()
    found = []
    with pytest.raises(EndOfFile):
        found.extend(StreamReader(io.BytesIO(cut_off), validate_crcs=True).records)
    assert sum(isinstance(record, Message) for record in found) >= 90


def test_an_unfinished_file_is_read_after_the_finished_ones(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic(CHATTER)
        write(bag, 20, size=10_000)
    left = shutil.copytree(tmp_path / 'bag', tmp_path / 'left')
    with BagWriter(tmp_path / 'more') as bag:
        bag.add_topic(CHATTER)
        write(bag, 30, size=10_000)
        shutil.copy(tmp_path / 'more' / 'more_0.mcap', left / 'bag_1.mcap')
    with Bag(left) as found:
        assert 40 <= found.topics['/chatter'].count <= 50
        (note,) = found.problems.notes
    assert 'bag_1' in note
    assert 'does not name it yet' in note


def test_a_full_disk_is_reported_and_the_messages_before_can_be_read(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill():
        with BagWriter(tmp_path / 'bag') as bag:
            bag.add_topic(CHATTER)
            for stamp in range(1000):
                bag.write('/chatter', stamp, text(os.urandom(5_000).hex()))

    resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, before[1]))
    try:
        with pytest.raises(BagWriteError) as refused:
            fill()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert str(refused.value).endswith('; what was written before is kept')
    assert not [item for item in (tmp_path / 'bag').iterdir() if item.is_dir()]
    with Bag(tmp_path / 'bag') as kept:
        assert kept.topics['/chatter'].count >= 10


def test_a_bag_without_messages_can_be_read(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic(CHATTER)
    with Reader(tmp_path / 'bag') as reader:
        assert list(reader.messages()) == []


def test_an_existing_folder_is_not_overwritten(tmp_path):
    with pytest.raises(BagWriteError, match='exists already'):
        BagWriter(tmp_path)


@pytest.mark.parametrize(('sourced', 'distro'), [('', 'jazzy'), ('kilted', 'kilted')])
def test_mcap_files_hold_distro_and_type_hashes_as_rosbag2_writes_them(
    tmp_path, monkeypatch, sourced, distro
):
    monkeypatch.setenv('ROS_DISTRO', sourced)
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add_topic(CHATTER)
        write(bag, 15)
    assert information(tmp_path / 'bag')['ros_distro'] == distro
    with (tmp_path / 'bag' / 'bag_0.mcap').open('rb') as stream:
        reader = make_reader(stream)
        (channel,) = reader.get_summary().channels.values()
        (metadata,) = (found.metadata for found in reader.iter_metadata())
    assert channel.metadata['topic_type_hash'] == define(STRING).digest
    inside = yaml.safe_load(metadata['serialized_metadata'])
    assert inside['ros_distro'] == distro
    assert inside['relative_file_paths'] == ['bag_0.mcap']
    with Reader(tmp_path / 'bag') as reader:
        assert [connection.digest for connection in reader.connections] == [define(STRING).digest]


def test_type_hashes_are_those_of_ros_also_for_services():
    """As Jazzy's own packages state them in share/nav_msgs/srv/GetPlan.json."""
    assert define('nav_msgs/srv/GetPlan_Event').digest == (
        'RIHS01_2550c2e32e7ee24d4806e10847958e1fc37e2631a63dd83f5512fa02ac0cdda5'
    )
    assert define('nav_msgs/msg/Path').digest == (
        'RIHS01_1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b'
    )


def test_types_of_other_packages_are_read_from_their_installation(tmp_path, monkeypatch):
    share = tmp_path / 'share' / 'robot_msgs'
    for name, content in {
        'msg/Wheel.msg': 'float64 speed\n',
        'msg/Wheels.msg': 'std_msgs/Header header\nWheel[4] wheels\n',
    }.items():
        (share / name).parent.mkdir(parents=True, exist_ok=True)
        (share / name).write_text(content)
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    assert 'MSG: robot_msgs/Wheel\n' in define('robot_msgs/msg/Wheels').text
    for other in ('msg/Arm', 'srv/Turn_Event'):
        with pytest.raises(BagTypeError, match=rf'robot_msgs/{other}: .* no installed package'):
            define(f'robot_msgs/{other}')

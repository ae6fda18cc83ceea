"""A dataset as a bag: readable by other libraries, the same for the same samples."""

import json

import numpy as np
import pytest
from llm_astar_lab.bags.types import BARRIER_MAP, GET_PLAN_EVENT, MAP, bag_types
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps, parse_barrier_map
from llm_astar_planner.cli.main import main
from llm_astar_planner.resources import find_file
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader

DATASET = find_file('samples_1000.json', 'maps')
MAPS = load_barrier_maps(DATASET)


def make_bag(folder, *options):
    return main(['dataset', 'to-bag', '--map', str(DATASET), '--out', str(folder), *options])


def read(folder):
    """Read a bag as rosbags does: (topic, time, message) in order."""
    with Reader(folder) as reader:
        return [
            (connection.topic, stamp, bag_types().deserialize_cdr(data, connection.msgtype))
            for connection, stamp, data in reader.messages()
        ]


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp('bags') / 'samples'
    assert make_bag(folder, '--map-ids', '50-52') == 0
    return folder


def test_each_map_follows_its_barriers_and_precedes_its_samples_as_requests(folder):
    messages = read(folder)
    topics = [topic for topic, _, _ in messages]
    assert topics == [BARRIER_MAP, MAP, *10 * [GET_PLAN_EVENT]] * 3
    stamps = [stamp for _, stamp, _ in messages]
    assert stamps == sorted(set(stamps))
    for number, barrier_map in enumerate(MAPS[50:53]):
        text, grid, *requests = (message for _, _, message in messages[12 * number :][:12])
        assert parse_barrier_map(json.loads(text.data)) == barrier_map
        expected = barrier_map.to_grid()
        assert np.array_equal(grid.data.reshape(31, 51), expected.cells)
        assert grid.info.resolution == expected.resolution
        for sample, event in zip(barrier_map.samples, requests):
            request = event.request[0]
            places = [
                (p.pose.position.x, p.pose.position.y) for p in (request.start, request.goal)
            ]
            assert places == [sample.start, sample.goal]
            assert len(event.response) == 0


def test_the_mcap_library_accepts_every_checksum(folder):
    with next(folder.glob('*.mcap')).open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_summary().statistics.message_count == 36
        assert [channel.topic for _, channel, _ in reader.iter_messages()] == [
            topic for topic, _, _ in read(folder)
        ]
        decoded = [message for *_, message in reader.iter_decoded_messages(topics=[MAP])]
    assert [grid.info.width for grid in decoded] == [51, 51, 51]


def test_a_damaged_byte_fails_a_checksum(folder, tmp_path):
    """The file has checksums, so one wrong byte among the messages is noticed."""
    data = bytearray(next(folder.glob('*.mcap')).read_bytes())
    data[len(data) // 3] ^= 1
    broken = tmp_path / 'broken.mcap'
    broken.write_bytes(data)
    with broken.open('rb') as stream, pytest.raises(Exception, match=r'(?i)crc|checksum|decomp'):
        list(make_reader(stream, validate_crcs=True).iter_messages())


def test_a_bag_defines_its_own_types(tmp_path):
    """A reader that knows only the types in the bag reads every message."""
    assert make_bag(tmp_path / 'bag', '--map-ids', '7') == 0
    with AnyReader([tmp_path / 'bag']) as reader:
        messages = [
            (connection.topic, reader.deserialize(data, connection.msgtype))
            for connection, _, data in reader.messages()
        ]
    assert [topic for topic, _ in messages] == [BARRIER_MAP, MAP, *10 * [GET_PLAN_EVENT]]
    assert messages[1][1].info.width == 51
    first = messages[2][1].request[0].start.pose.position
    assert (first.x, first.y) == MAPS[7].samples[0].start


def test_maps_are_offered_to_late_joiners(folder):
    with Reader(folder) as reader:
        offered = {c.topic: c.ext.offered_qos_profiles[0].durability for c in reader.connections}
    assert offered[MAP] is offered[BARRIER_MAP] is QosDurability.TRANSIENT_LOCAL
    assert offered[GET_PLAN_EVENT] is QosDurability.VOLATILE


def test_the_same_samples_give_the_same_bag(folder, tmp_path):
    again = tmp_path / folder.name
    assert make_bag(again, '--map-ids', '50-52') == 0
    for file in folder.iterdir():
        assert (again / file.name).read_bytes() == file.read_bytes()


def test_a_grid_without_barriers_is_written_as_a_map(tmp_path):
    (tmp_path / 'x.map').write_text('type octile\nheight 2\nwidth 3\nmap\n...\n.@.\n')
    (tmp_path / 'x.map.scen').write_text('version 1\n0 x.map 3 2 0 0 2 0 2.0\n')
    out = tmp_path / 'bag'
    assert (
        main(['dataset', 'to-bag', '--map', str(tmp_path / 'x.map.scen'), '--out', str(out)]) == 0
    )
    assert [topic for topic, _, _ in read(out)] == [MAP, GET_PLAN_EVENT]


def test_a_bag_that_cannot_be_written_is_one_sentence(folder, capsys):
    assert make_bag(folder) == 2
    assert 'exists already' in capsys.readouterr().err
    assert make_bag(folder.parent / 'new', '--map-ids', '5000') == 2
    assert '--map-ids 5000' in capsys.readouterr().err
    assert not (folder.parent / 'new').exists()

"""Reading bags in every storage; damaged ones as far as possible, with a sentence on the rest."""

import random
import sqlite3
import struct
import tracemalloc
from contextlib import closing

import pytest
import zstandard
from bag_makers import TYPES, call_at, list_at, map_at, room, write_bag, write_split
from llm_astar_lab.bags.reading import Bag, Problems, unpack
from llm_astar_lab.bags.storage import LARGEST, BagError, McapFile, unzstd
from llm_astar_lab.bags.types import bag_types, define
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter

DAY = [
    map_at(1, room()),
    call_at(2, (2, 2), (8, 8), 1),
    map_at(3, room(30, 12)),
    call_at(4, (3, 3), (9, 9), 2),
]
NAMES = 'rosbag2_bagfile_information: {{relative_file_paths: {}}}'
SEEN = [('/map', 1.0), (DAY[1][0], 2.0), ('/map', 3.0), (DAY[3][0], 4.0)]


def seen(bag):
    return [(message.topic, message.time / 1e9) for message in bag.messages(list(bag.topics))]


def read(path):
    """Return the messages of a bag and its problems."""
    with Bag(path) as bag:
        return seen(bag), bag.problems


def write_by_rosbags(folder, storage, compression=None):
    writer = RosbagsWriter(folder, version=9, storage_plugin=storage)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        topics = {}
        for name in dict.fromkeys(name for name, _, _ in DAY):
            known = define(TYPES[name])
            topics[name] = writer.add_connection(
                name, TYPES[name], msgdef=known.text, rihs01=known.digest
            )
        for name, seconds, message in DAY:
            data = bag_types().serialize_cdr(message, TYPES[name])
            writer.write(topics[name], int(seconds * 1e9), data)
    return folder


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_both_storages_are_read_in_order_of_time(tmp_path, storage):
    found, problems = read(write_bag(tmp_path / 'bag', DAY, storage))
    assert found == SEEN
    assert not problems.notes
    assert not problems.left_out


@pytest.mark.parametrize(
    ('storage', 'compression'),
    [
        (StoragePlugin.MCAP, CompressionMode.FILE),
        (StoragePlugin.MCAP, CompressionMode.MESSAGE),
        (StoragePlugin.MCAP, CompressionMode.STORAGE),
        (StoragePlugin.SQLITE3, CompressionMode.FILE),
        (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
    ],
)
def test_compressed_files_messages_and_chunks_are_read(tmp_path, storage, compression):
    assert read(write_by_rosbags(tmp_path / 'bag', storage, compression))[0] == SEEN


def test_a_split_bag_is_read_file_after_file_and_a_bare_file_alone(tmp_path):
    folder = write_split(tmp_path / 'bag', DAY)
    files = sorted(folder.glob('*.mcap'))
    assert len(files) == len(DAY)
    assert read(folder)[0] == SEEN
    assert read(files[0])[0] == SEEN[:1]


def test_without_its_metadata_a_bag_is_read_in_order_of_names_and_says_so(tmp_path):
    folder = write_split(tmp_path / 'bag', DAY)
    (folder / 'bag_3.mcap').rename(folder / 'bag_10.mcap')
    (folder / 'metadata.yaml').unlink()
    found, problems = read(folder)
    assert found == SEEN
    assert 'metadata.yaml: is missing' in problems.notes[0]


@pytest.mark.parametrize(
    'text', ['rosbag2: [', 'a: 1', '[]', '\x00', '[' * 3000, NAMES.format('[[a]]')]
)
def test_malformed_metadata_is_only_a_note(tmp_path, text):
    folder = write_bag(tmp_path / 'bag', DAY)
    (folder / 'metadata.yaml').write_text(text)
    found, problems = read(folder)
    assert found == SEEN
    assert 'cannot be used' in problems.notes[0]


def test_metadata_that_names_other_files_is_only_a_note(tmp_path):
    """As after renaming the file."""
    folder = write_bag(tmp_path / 'bag', DAY)
    (folder / 'bag_0.mcap').rename(folder / 'monday.mcap')
    found, problems = read(folder)
    assert found == SEEN
    assert 'names bag_0.mcap, and none of them is there' in problems.notes[0]
    assert not problems.left_out


def test_a_missing_file_is_named_and_the_others_are_read(tmp_path):
    folder = write_split(tmp_path / 'bag', DAY)
    (folder / 'bag_1.mcap').unlink()
    found, problems = read(folder)
    assert found == [SEEN[0], *SEEN[2:]]
    assert 'bag_1.mcap: is missing' in problems.left_out[0]


def mcap_of(folder, messages, compression, chunk_size=1 << 20, **options):
    """Write a file by the mcap library, with ROS 2 schemas."""
    folder.mkdir()
    with (folder / 'bag.mcap').open('wb') as stream:
        writer = McapWriter(stream, chunk_size=chunk_size, compression=compression, **options)
        writer.start(profile='ros2')
        channels = {}
        for name, seconds, message in messages:
            if name not in channels:
                text = define(TYPES[name]).text.encode()
                schema = writer.register_schema(TYPES[name], 'ros2msg', text)
                channels[name] = writer.register_channel(name, 'cdr', schema)
            data = bytes(bag_types().serialize_cdr(message, TYPES[name]))
            stamp = int(seconds * 1e9)
            writer.add_message(channels[name], stamp, data, stamp)
        writer.finish()
    return folder / 'bag.mcap'


@pytest.mark.parametrize('compression', list(CompressionType))
def test_files_of_the_mcap_library_are_read_as_far_as_they_are_complete(tmp_path, compression):
    file = mcap_of(tmp_path / 'bag', DAY, compression, chunk_size=500)
    assert read(file)[0] == SEEN
    whole = file.read_bytes()
    found_at = []
    for part in (0.9, 0.5, 0.2, 0.1):
        file.write_bytes(whole[: int(part * len(whole))])
        found, problems = read(file)
        assert found == SEEN[: len(found)]
        assert len(found) == 4 or 'was cut off' in problems.left_out[0]
        found_at.append(len(found))
    assert found_at == sorted(found_at, reverse=True)
    assert found_at[0] == 4  # only the index is missing
    assert found_at[-1] < 4


@pytest.mark.parametrize('index_types', list(IndexType))
@pytest.mark.parametrize(
    'options', [{}, {'repeat_channels': False, 'repeat_schemas': False}, {'use_chunking': False}]
)
def test_files_are_read_without_parts_of_their_summary(tmp_path, index_types, options):
    options = {'chunk_size': 500, 'index_types': index_types, **options}
    file = mcap_of(tmp_path / 'bag', DAY, CompressionType.ZSTD, **options)
    found, problems = read(file)
    assert found == SEEN
    assert not problems.notes
    assert not problems.left_out


@pytest.mark.parametrize('missing', [1, 8, 30, 200, 400])
def test_a_file_cut_off_in_its_summary_gives_every_message(tmp_path, missing):
    file = mcap_of(tmp_path / 'bag', DAY, CompressionType.ZSTD, chunk_size=500)
    file.write_bytes(file.read_bytes()[:-missing])
    assert read(file)[0] == SEEN


@pytest.mark.parametrize('opcode', [6, 7, 99])
def test_a_record_of_another_kind_within_a_chunk_is_skipped(tmp_path, opcode):
    record = struct.pack('<BQ', opcode, 3) + b'abc'
    file = mcap_of(tmp_path / 'bag', DAY, CompressionType.NONE, use_chunking=False)
    # Its header record has 8 bytes of magic before it; the data end stands before its summary.
    data = file.read_bytes()
    begin = 8 + 9 + struct.unpack_from('<Q', data, 9)[0]
    content = record + data[begin : data.index(struct.pack('<BQ', 15, 4))] + record
    head = struct.pack('<QQQII', 0, 0, len(content), 0, 0) + struct.pack('<Q', len(content))
    chunk = struct.pack('<BQ', 6, len(head) + len(content)) + head + content
    file.write_bytes(data[:begin] + chunk + struct.pack('<BQI', 15, 4, 0))
    found, problems = read(file)
    assert found == SEEN
    assert not problems.left_out


def test_a_cut_chunk_gives_the_messages_before_the_cut(tmp_path):
    file = mcap_of(tmp_path / 'bag', DAY, CompressionType.NONE)
    whole = file.read_bytes()
    last = whole.index(bytes(bag_types().serialize_cdr(DAY[3][2], TYPES[DAY[3][0]])))
    file.write_bytes(whole[: last + 10])
    assert read(file)[0] == SEEN[:3]


def test_zeros_at_the_end_of_a_file_are_not_messages(tmp_path):
    file = mcap_of(tmp_path / 'bag', DAY, CompressionType.NONE, chunk_size=100)
    whole = file.read_bytes()
    file.write_bytes(whole[: whole.index(struct.pack('<BQ', 15, 4))])
    with file.open('r+b') as stream:
        stream.truncate(LARGEST)
    found, problems = read(file)
    assert found == SEEN
    assert 'was cut off' in problems.left_out[0]


@pytest.mark.parametrize(('opcode', 'length'), [(9, LARGEST), (6, 1 << 62), (5, LARGEST + 1)])
def test_records_larger_than_any_message_are_not_read_into_memory(tmp_path, opcode, length):
    file = tmp_path / 'large.mcap'
    with file.open('wb') as stream:
        stream.write(b'\x89MCAP0\r\n' + struct.pack('<BQ', opcode, length))
        stream.truncate(LARGEST + 1000)
    tracemalloc.start()
    try:
        assert read(file)[1].left_out
        assert tracemalloc.get_traced_memory()[1] < 1e7
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_chunks_that_hold_every_topic(tmp_path):
    file = tmp_path / 'topics.mcap'
    with file.open('wb') as stream:
        writer = McapWriter(stream, chunk_size=8000)
        writer.start(profile='ros2')
        text = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        topics = [writer.register_channel(f'/t{n}', 'cdr', text) for n in range(200)]
        for stamp in range(200 * 200):
            writer.add_message(topics[stamp % 200], stamp, b'\0\1\0\0', stamp)
        writer.finish()
    with closing(McapFile(file)) as storage:
        next(stamps := storage.stamps())
        tracemalloc.start()
        try:
            assert sum(1 for _ in stamps) == 200 * 200 - 1
            assert tracemalloc.get_traced_memory()[0] < 500_000
        finally:
            tracemalloc.stop()


def test_a_chunk_with_more_bytes_than_it_says_is_left_out(tmp_path):
    data = zstandard.ZstdCompressor().compress(bytes(1_000_000))
    chunk = struct.pack('<QQQII', 0, 1, 1000, 0, 4) + b'zstd' + struct.pack('<Q', len(data)) + data
    file = tmp_path / 'bomb.mcap'
    file.write_bytes(b'\x89MCAP0\r\n' + struct.pack('<BQ', 6, len(chunk)) + chunk)
    assert 'compressed from more than 1000 bytes' in read(file)[1].left_out[0]
    with pytest.raises(ValueError, match='more than 1000 bytes'):
        unzstd(data, 1000)


def test_messages_of_the_mcap_ros2_writer_are_read(tmp_path):
    file = tmp_path / 'text.mcap'
    with Ros2Writer(str(file)) as writer:
        schema = writer.register_msgdef('std_msgs/msg/String', 'string data')
        writer.write_message('/chatter', schema, {'data': 'hello'}, log_time=5)
    with Bag(file) as bag:
        (message,) = bag.messages(['/chatter'])
    assert (message.value.data, message.time) == ('hello', 5)


def test_a_chunk_with_a_wrong_checksum_is_left_out_and_the_rest_is_read(tmp_path):
    file = mcap_of(tmp_path / 'bag', DAY, CompressionType.NONE, chunk_size=100)
    data = bytearray(file.read_bytes())
    place = bytes(data).index(bytes(bag_types().serialize_cdr(DAY[0][2], TYPES['/map'])))
    data[place + 40] ^= 0xFF
    file.write_bytes(data)
    found, problems = read(file)
    assert found == SEEN[1:]
    assert 'its checksum is wrong' in problems.left_out[0]


def test_an_open_bag_counts_what_can_be_read_and_names_what_cannot(tmp_path):
    file = mcap_of(tmp_path / 'bag', DAY, CompressionType.NONE, chunk_size=100)
    data = bytearray(file.read_bytes())
    data[data.index(bytes(bag_types().serialize_cdr(DAY[0][2], TYPES['/map']))) + 40] ^= 0xFF
    file.write_bytes(data)
    with Bag(file) as bag:
        assert bag.topics['/map'].count == 1
        assert 'its checksum is wrong' in bag.problems.left_out[0]


def test_a_database_that_is_cut_off_is_read_up_to_there(tmp_path):
    maps = [map_at(n, room(200, 100)) for n in range(1, 9)]
    folder = write_bag(tmp_path / 'bag', maps, 'sqlite3')
    (file,) = folder.glob('*.db3')
    data = file.read_bytes()
    file.write_bytes(data[: int(0.6 * len(data))])
    found, problems = read(folder)
    assert 0 < len(found) < 8
    assert 'is damaged' in problems.left_out[0]


def test_a_compressed_file_that_is_cut_off_is_read_up_to_there(tmp_path):
    folder = write_by_rosbags(tmp_path / 'bag', StoragePlugin.MCAP, CompressionMode.FILE)
    (file,) = folder.glob('*.zstd')
    inside = zstandard.ZstdDecompressor().decompressobj().decompress(file.read_bytes())
    packed = zstandard.ZstdCompressor().compress(inside[: len(inside) // 2])
    file.write_bytes(packed)
    found, problems = read(folder)
    assert found == SEEN[: len(found)]
    assert problems.left_out


def test_a_topic_of_unknown_type_is_left_out_and_the_rest_is_read(tmp_path):
    file = tmp_path / 'odd.mcap'
    with file.open('wb') as stream:
        writer = McapWriter(stream)
        writer.start(profile='ros2')
        odd = writer.register_schema('odd_msgs/msg/Odd', 'ros2msg', b'not a definition !')
        writer.add_message(writer.register_channel('/odd', 'cdr', odd), 1, b'\0\1\0\0', 1)
        proto = writer.register_schema('foxglove.Log', 'protobuf', b'\x0a\x01')
        writer.add_message(writer.register_channel('/log', 'protobuf', proto), 2, b'\x0a', 2)
        text = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        data = bag_types().serialize_cdr(list_at(3, [])[2], 'std_msgs/msg/String')
        writer.add_message(writer.register_channel('/chatter', 'cdr', text), 3, bytes(data), 3)
        writer.finish()
    with Bag(file) as bag:
        assert [message.topic for message in bag.messages(list(bag.topics))] == ['/chatter']
        (line,) = bag.problems.left_out
        assert 'odd_msgs/msg/Odd is unknown here' in line
        assert "'protobuf', not as ROS 2" in bag.problems.notes[0]
        assert 'not readable: /odd (odd_msgs/msg/Odd)' in bag.problems.notes[1]


@pytest.mark.parametrize(
    'definition',
    ['x_msgs/A a', f'x_msgs/B[1000000000] b\n{"=" * 80}\nMSG: x_msgs/B\nuint8 c'],
)
def test_an_unusable_definition_makes_its_type_unknown(tmp_path, definition):
    file = tmp_path / 'odd.mcap'
    with file.open('wb') as stream:
        writer = McapWriter(stream)
        writer.start(profile='ros2')
        odd = writer.register_schema('x_msgs/msg/A', 'ros2msg', definition.encode())
        writer.add_message(writer.register_channel('/odd', 'cdr', odd), 1, b'\0\1\0\0', 1)
        writer.finish()
    assert 'x_msgs/msg/A is unknown here' in read(file)[1].left_out[0]


def test_a_type_is_decoded_by_the_definition_in_the_bag(tmp_path):
    file = tmp_path / 'own.mcap'
    with Ros2Writer(str(file)) as writer:
        schema = writer.register_msgdef('my_msgs/msg/Pair', 'int32 a\nint32 b')
        writer.write_message('/pair', schema, {'a': 3, 'b': 4}, log_time=1)
    with Bag(file) as bag:
        (message,) = bag.messages(['/pair'])
    assert (message.value.a, message.value.b) == (3, 4)


def test_a_message_that_does_not_decode_is_left_out_alone(tmp_path):
    folder = write_bag(tmp_path / 'bag', [*DAY[:2], ('/map', 2.5, b'\0\1\0\0oops'), *DAY[2:]])
    found, problems = read(folder)
    assert found == SEEN
    assert '/map: a message at 1.500 s is left out' in problems.left_out[0]


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_a_file_whose_clock_jumps_back_is_read_in_order_of_recording(tmp_path, storage):
    late = [map_at(100, room()), call_at(101, (2, 2), (8, 8), 1)]
    found, problems = read(write_bag(tmp_path / 'bag', [*late, *DAY], storage))
    assert [time for _, time in found] == [100.0, 101.0, 1.0, 2.0, 3.0, 4.0]
    assert 'the clock jumps back by 99.000 s' in problems.notes[0]


def test_topics_written_one_after_the_other_are_not_a_clock_jump(tmp_path):
    by_topic = sorted(DAY, key=lambda item: item[0])
    found, problems = read(write_bag(tmp_path / 'bag', by_topic))
    assert found == SEEN
    assert not problems.notes


@pytest.mark.parametrize(
    ('make_it', 'expected'),
    [
        (lambda path: None, 'there is no such bag'),
        (lambda path: path.mkdir(), 'holds neither metadata.yaml nor a file'),
        (lambda path: path.write_text('x'), 'a bag is a folder'),
    ],
)
def test_a_path_that_is_not_a_bag_is_refused_by_name(tmp_path, make_it, expected):
    make_it(tmp_path / 'thing')
    with pytest.raises(BagError, match=expected):
        Bag(tmp_path / 'thing')


@pytest.mark.parametrize('name', ['bag.mcap', 'bag.db3'])
@pytest.mark.parametrize('content', [b'', b'rubbish, and more of it than a header has'])
def test_a_malformed_file_is_refused_by_name(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(BagError, match=name):
        Bag(tmp_path / name)


def test_a_database_without_definitions_is_decoded_by_those_of_jazzy(tmp_path):
    folder = write_bag(tmp_path / 'bag', DAY, 'sqlite3')
    (file,) = folder.glob('*.db3')
    with sqlite3.connect(file) as connection:
        connection.execute('DROP TABLE message_definitions')
    connection.close()
    assert read(folder)[0] == SEEN


def test_service_events_keep_their_requests(tmp_path):
    with Bag(write_bag(tmp_path / 'bag', DAY)) as bag:
        events = [message.value for message in bag.messages([DAY[1][0]])]
    assert [event.request[0].goal.pose.position.x for event in events] == [8.0, 9.0]


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_a_file_with_random_damage_is_read_or_refused(tmp_path, storage):
    (file,) = (
        f for f in write_bag(tmp_path / 'bag', DAY, storage).iterdir() if f.suffix != '.yaml'
    )
    whole, chance = file.read_bytes(), random.Random(5)  # noqa: S311 - no secret
    outcomes = set()
    for _ in range(40):
        data = bytearray(whole[: chance.choice([len(whole), chance.randrange(len(whole))])])
        for _ in range(min(5, len(data))):
            data[chance.randrange(len(data))] = chance.randrange(256)
        file.write_bytes(data)
        try:
            outcomes.add(len(read(file)[0]))
        except BagError as error:
            assert file.name in str(error)
    assert len(outcomes) > 1


def test_a_file_is_unpacked_up_to_a_limit(tmp_path, monkeypatch):
    monkeypatch.setattr('llm_astar_lab.bags.reading.MOST_UNPACKED', 2**20)
    packed = tmp_path / 'x.mcap.zstd'
    packed.write_bytes(zstandard.ZstdCompressor().compress(bytes(2**26)))
    problems = Problems()
    folder = tmp_path / 'unpacked'
    folder.mkdir()
    assert unpack(packed, folder, problems).stat().st_size == 2**20
    assert 'x.mcap.zstd: is read up to the first' in problems.left_out[0]


def test_chunks_of_one_time_are_read_up_to_a_limit(tmp_path, monkeypatch):
    day = [map_at(seconds, room(30, 30)) for seconds in range(1, 20)]
    folder = write_bag(tmp_path / 'bag', day, 'mcap')
    assert len(read(folder)[0]) == 19
    monkeypatch.setattr('llm_astar_lab.bags.storage.MOST_HELD', 5000)
    found, problems = read(folder)
    assert 1 <= len(found) < 19
    assert 'over 5000 bytes of its chunks are of the same time' in problems.left_out[0]

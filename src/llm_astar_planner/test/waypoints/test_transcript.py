"""Transcripts: what is written is read back, and what is broken is named."""

import json
import os
import resource
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from llm_astar_lab.datasets.generate import generate
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.replay import NoSource, RecordingSource, dataset_digest
from llm_astar_planner.waypoints.source import (
    Message,
    Provenance,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
)
from llm_astar_planner.waypoints.transcript import (
    Exchange,
    TranscriptError,
    TranscriptWriter,
    read_transcript,
)

EXCHANGE = Exchange(
    map=3,
    pair=1,
    scale=1,
    model='tiny',
    prompt='few_shot',
    messages=(Message('user', 'where to?\n'),),
    response='Generated Path: [[1, 2]]',
    prompt_tokens=10,
    completion_tokens=5,
    seconds=0.25,
    status=SourceStatus.OK,
)
FIELDS = [
    'map',
    'pair',
    'scale',
    'model',
    'prompt',
    'messages',
    'response',
    'prompt_tokens',
    'completion_tokens',
    'seconds',
    'status',
]


def test_written_and_read_back(tmp_path):
    path = tmp_path / 'deep' / 'transcript.jsonl'
    live = replace(EXCHANGE, map='0123456789ab', pair='1,2->3,4', unit=4, response='\u00e4\ud800')
    for exchange in (EXCHANGE, live):
        writer = TranscriptWriter(path)
        writer.write(exchange.to_json())
    assert read_transcript(path) == [EXCHANGE, live]
    assert list(json.loads(path.read_text().splitlines()[0])) == FIELDS


def test_what_is_known_of_a_reply_is_written_and_read_back(tmp_path):
    path = tmp_path / 'transcript.jsonl'
    known = Provenance(
        'stop', 'fp_1', 'ab' * 32, 'cd' * 32, 0.0, 20261001, '2026-11-22T19:00:00+00:00'
    )
    exchange = replace(EXCHANGE, provenance=known)
    TranscriptWriter(path).write(exchange.to_json())
    assert read_transcript(path) == [exchange]
    record = json.loads(path.read_text())
    assert record['seed'] == 20261001
    assert record['temperature'] == 0.0
    # What an earlier version reads of it is the same as without.
    assert {name: record[name] for name in FIELDS} == EXCHANGE.to_json()
    path.write_text(json.dumps({**EXCHANGE.to_json(), 'seed': None, 'temperature': 1}) + '\n')
    assert read_transcript(path)[0].provenance == Provenance(temperature=1)


def test_a_dataset_keeps_its_digest_whatever_its_sentences_and_file(tmp_path):
    first, second = generate(9, 2)
    reworded = [sample._replace(query='another sentence') for sample in first.samples]
    digest = dataset_digest([first, second])
    assert dataset_digest([replace(first, samples=tuple(reworded)), second]) == digest
    assert dataset_digest([replace(first, family='paper'), second]) == digest
    assert dataset_digest([second, first]) != digest
    assert dataset_digest([replace(first, samples=first.samples[1:]), second]) != digest


def test_a_cut_off_last_line_is_left_out_with_a_warning(tmp_path, caplog):
    path = tmp_path / 'transcript.jsonl'
    line = json.dumps(EXCHANGE.to_json())
    path.write_text(f'{line}\n{line[:50]}')
    assert read_transcript(path) == [EXCHANGE]
    assert 'line 2: cut off' in caplog.text
    cut = path.read_bytes().rpartition(b'\n')[2]
    writer = TranscriptWriter(path)
    writer.write(EXCHANGE.to_json())
    assert read_transcript(path) == [EXCHANGE, EXCHANGE]
    assert path.with_name('transcript.jsonl.cut').read_bytes() == cut + b'\n'


def test_a_last_line_without_its_end_counts(tmp_path):
    path = tmp_path / 'transcript.jsonl'
    path.write_text(json.dumps(EXCHANGE.to_json()))
    assert read_transcript(path) == [EXCHANGE]
    writer = TranscriptWriter(path)
    writer.write(EXCHANGE.to_json())
    assert len(read_transcript(path)) == 2


@pytest.mark.parametrize('text', ['one line', 'a\nb', '\n', '{"key": 1}', '[1, 2', '{"map'])
def test_a_file_that_is_no_transcript_is_not_touched(tmp_path, text):
    path = tmp_path / 'notes.txt'
    path.write_text(text)
    with pytest.raises(TranscriptError, match='is no transcript'):
        TranscriptWriter(path)
    assert path.read_text() == text
    assert list(tmp_path.iterdir()) == [path]


def test_nothing_but_a_regular_file_is_recorded_to(tmp_path):
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    for path in (pipe, '/dev/null'):
        with pytest.raises(TranscriptError, match='is not a regular file'):
            TranscriptWriter(path)


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'map': None}, 'line 2: map: int or str is expected'),
        ({'scale': 0}, 'line 2: scale: 0 is not 1 to 1e'),
        ({'scale': True}, 'line 2: scale: int is expected'),
        ({'messages': [{'role': 'user'}]}, r'line 2: messages\[0\]: content'),
        ({'messages': ['hello']}, r'line 2: messages\[0\]: an object'),
        ({'status': 'fine'}, "line 2: status: 'fine' is none of OK, "),
        ({'unit': 'x'}, 'line 2: unit: int is expected'),
        ({'model': 'gpt\x1b[2J'}, 'line 2: model: .* is no name'),
        ({'prompt': 'p' * 100_000}, 'line 2: prompt: .* is no name'),
        ({'seed': 1.5}, 'line 2: seed: int is expected'),
        ({'temperature': 'hot'}, 'line 2: temperature: int or float is expected'),
        ({'model_digest': 'a\nb'}, 'line 2: model_digest: .* is no name'),
        ({'time': 'yesterday'}, "line 2: time: 'yesterday' is no time such as 2026-"),
    ],
)
def test_a_bad_field_is_named(tmp_path, change, words):
    path = tmp_path / 'transcript.jsonl'
    good = EXCHANGE.to_json()
    path.write_text(f'{json.dumps(good)}\n{json.dumps({**good, **change})}\n')
    with pytest.raises(TranscriptError, match=words) as error:
        read_transcript(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize('field', FIELDS)
def test_a_missing_field_is_named(tmp_path, field):
    path = tmp_path / 'transcript.jsonl'
    record = EXCHANGE.to_json()
    del record[field]
    path.write_text(json.dumps(record) + '\n')
    with pytest.raises(TranscriptError, match=f'line 1: {field}: is missing'):
        read_transcript(path)


def test_a_file_that_is_not_a_transcript_is_named(tmp_path):
    path = tmp_path / 'transcript.jsonl'
    with pytest.raises(TranscriptError, match='No such file'):
        read_transcript(path)
    path.write_text('{"map"\n{}\n')
    with pytest.raises(TranscriptError, match='line 1: not JSON'):
        read_transcript(path)
    path.write_text('[]\n')
    with pytest.raises(TranscriptError, match='line 1: an object is expected'):
        read_transcript(path)
    with pytest.raises(TranscriptError, match=str(tmp_path)):
        TranscriptWriter(tmp_path)


def test_a_full_disk_damages_no_earlier_exchange(tmp_path):
    path = tmp_path / 'transcript.jsonl'
    writer = TranscriptWriter(path)
    writer.write(EXCHANGE.to_json())
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 50, limits[1]))
    try:
        with pytest.raises(OSError, match='No space left'):
            writer.write(EXCHANGE.to_json())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    writer.write(EXCHANGE.to_json())
    assert read_transcript(path) == [EXCHANGE, EXCHANGE]


def test_lines_from_many_threads_stay_whole(tmp_path):
    path = tmp_path / 'transcript.jsonl'
    writer = TranscriptWriter(path)
    big = replace(EXCHANGE, response='x' * 20000)
    threads = [
        threading.Thread(target=lambda: [writer.write(big.to_json()) for _ in range(20)])
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert read_transcript(path) == [big] * 80


def test_a_source_that_asks_no_model_is_not_recorded(tmp_path):
    path = tmp_path / 'transcript.jsonl'
    query = WaypointQuery(Costmap(GridMap(np.zeros((3, 3), dtype=np.int8))), (0, 0), (2, 2))
    assert RecordingSource(NoSource(), TranscriptWriter(path)).waypoints(query).waypoints == ()
    assert path.read_text() == ''


def test_a_failed_write_does_not_cost_the_answer(tmp_path, caplog):
    class Answers:
        name = 'answers'

        def waypoints(self, query):
            return WaypointReply(((1.0, 1.0),))

    query = WaypointQuery(Costmap(GridMap(np.zeros((3, 3), dtype=np.int8))), (0, 0), (2, 2))
    writer = TranscriptWriter(tmp_path / 'transcript.jsonl')
    writer.path = Path('/dev/full')
    assert RecordingSource(Answers(), writer).waypoints(query).waypoints == ((1.0, 1.0),)
    assert 'cannot be written: No space left' in caplog.text.replace('[Errno 28] ', '')

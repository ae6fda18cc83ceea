"""Files of other people: what is not a regular file, or too large, or made to take all time."""

import contextlib
import os
import time

import pytest
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import (
    MAX_YAML_BYTES,
    read_bytes,
    read_json,
    read_text,
    read_yaml,
)


class RefusedError(LlmAstarError):
    """What the readers are to raise."""


def problem(read, path, **options):
    with pytest.raises(RefusedError) as error:
        read(path, RefusedError, **options)
    assert str(error.value).startswith(f'{path}: ')
    return str(error.value)


@pytest.mark.parametrize('read', [read_bytes, read_text, read_json, read_yaml])
def test_only_regular_files_of_a_bounded_size_are_read(read, tmp_path):
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    for path in (pipe, tmp_path, '/dev/zero'):
        assert 'is not a regular file' in problem(read, path)
    assert 'No such file' in problem(read, tmp_path / 'absent')
    assert 'null' in problem(read, 'a\0b')
    large = tmp_path / 'large'
    large.write_bytes(b'1' * 2001)
    assert 'is over 0.002 MB' in problem(read, large, limit=2000)


@pytest.mark.parametrize(
    ('read', 'text', 'words'),
    [
        (read_text, b'\xff', "can't decode"),
        (read_json, b'{', 'not JSON'),
        (read_json, b'\xff', 'not JSON'),
        (read_json, b'[' * 100_000, 'too deeply'),
        (read_json, b'1' * 10_000, 'not JSON'),
        # Newer libyaml stops before we do, and says it in other words.
        (read_yaml, b'[' * 100_000, 'nest'),
        (read_yaml, b'- ' * 100_000, 'nest'),
        (read_yaml, b'a: &a [x]\nb: *a', 'aliases are not supported'),
        (read_yaml, b'a: 2000-13-01', 'month must be in 1..12'),
        (read_yaml, b'a: !!python/object:os.system x', 'could not determine a constructor'),
        (read_yaml, b'? [a]\n: b', 'unhashable'),
        (read_yaml, b'a: ' + b'1:' * 20_000 + b'1', 'line 1: over 4096 characters'),
        (read_yaml, b'- 1\n' * 200_000, 'over 100000 values'),
    ],
)
def test_contents_that_cannot_be_used_are_named(read, text, words, tmp_path):
    path = tmp_path / 'file'
    path.write_bytes(text)
    assert words in problem(read, path)


def test_the_line_ends_of_every_system_are_read(tmp_path):
    path = tmp_path / 'file'
    path.write_bytes(b'a\r\nb\rc\n')
    assert read_text(path, RefusedError) == 'a\nb\nc\n'


@pytest.mark.parametrize('unit', ['- {a: [1, 2]}\n', '- 1:1:1\n', f'- {"1:" * 2000}1\n'])
def test_yaml_of_the_largest_size_takes_seconds_and_little_memory(unit, tmp_path):
    path = tmp_path / 'file'
    path.write_text(unit * (MAX_YAML_BYTES // len(unit)))
    begin = time.thread_time()
    with contextlib.suppress(RefusedError):
        read_yaml(path, RefusedError)
    # One of the 490,000 values took 14 s.
    assert time.thread_time() - begin < 10

"""Reads damaged files within limits: what a reader may raise, how long and how much it may take.

`python fuzz_readers.py NAME=COUNT...` reads COUNT mutations of a reader's files, each reader in a
process of its own, and prints a line of JSON for each: what went wrong, and the most memory.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import os
import random
import re
import resource
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.errors import LlmAstarError

# What one reading may take: seconds of CPU, and bytes of memory besides those of the cells.
MOST_SECONDS = 10
MOST_BYTES = 300 * 10**6
# The failures of one reader that are told.
MOST_FAILURES = 5
# Characters of an error.
MOST_CHARS = 3000
TOKEN = re.compile(rb'"(?:[^"\\]|\\.)*"|[\w.+-]+|[^\w\s]|\s+')
NUMBERS = [0, -1, 1, 2, 3.5, 255, 65536, 2**31, -(2**31), 2**63, 10**18, 10**400, 10**3999, 1e308,
           -1e308, 1e-300, float('nan'), float('inf')]  # fmt: skip
TEXTS = ['', ' ', 'x', 'nan', '\0', '\ud800', '\u202e', 'é' * 50, 'x' * 5000, '../../etc/passwd',
         '/dev/zero', '1' * 400, '[[[[', '}{', '%s%n', '0x10', '1e5', '1_000']  # fmt: skip
VALUES: list[Any] = [
    *NUMBERS,
    *TEXTS,
    None,
    True,
    False,
    [],
    {},
    [[]],
    [None],
    {'': None},
    [0] * 500,
]
TOKENS = [json.dumps(value).encode() for value in VALUES] + [
    b'[' * 2000, b'{"a":' * 2000, b'\xff\xfe', b'\0' * 20, b'&a', b'*a',
    b'!!python/name:os.system',
    b'\r', b'\n', b'\n\n\n', b',', b';', b'"', b"'", b'-', b':', b'#', b'---\n', b'2000-13-01',
    b'',
]  # fmt: skip


class Reader(NamedTuple):
    """A reader of foreign data.

    `make` writes whole files into a folder and returns the one that is mutated. `read` reads that
    file. A reader `of_files` names the file in its errors.
    """

    make: Callable[[Path], Path]
    read: Callable[[Path], object]
    of_files: bool = True


def mutated(data: bytes, rng: random.Random) -> bytes:
    """Return data with one to three kinds of damage."""
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        kinds = [mutated_bits, mutated_part, mutated_token, mutated_token, mutated_token]
        data = rng.choice([*kinds, mutated_json, mutated_json])(data, rng)
    return data


def mutated_bits(data: bytes, rng: random.Random) -> bytes:
    """Return data with a few bits flipped."""
    changed = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 8])):
        if changed:
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def mutated_part(data: bytes, rng: random.Random) -> bytes:
    """Return data with a part cut out, put somewhere else, repeated or overwritten."""
    begin = rng.randrange(len(data) + 1)
    end = min(len(data), begin + rng.choice([1, 4, 8, 50, 500, len(data)]))
    part, other = data[begin:end], rng.randrange(len(data) + 1)
    return rng.choice([
        data[:begin] + data[end:],
        data[:begin] + part * rng.choice([2, 3, 40]) + data[end:],
        data[:other] + part + data[other + len(part):],
        data[:begin] + rng.choice([b'\xff', b'\0', b'\x7f']) * len(part) + data[end:],
        data[:begin],
    ])  # fmt: skip


def mutated_token(data: bytes, rng: random.Random) -> bytes:
    """Return data with a word, number or sign replaced by an odd one, or by another of its own."""
    tokens = TOKEN.findall(data[: 2**16])
    if not tokens:
        return data
    chosen = rng.randrange(len(tokens))
    tokens[chosen] = rng.choice(tokens) if rng.random() < 0.3 else rng.choice(TOKENS)
    return b''.join(tokens) + data[2**16 :]


def mutated_json(data: bytes, rng: random.Random) -> bytes:
    """Return JSON, or a line of it, with a value replaced, left out or put in twice."""
    lines = data.split(b'\n')
    for text in (data, rng.choice(lines)):
        with contextlib.suppress(ValueError, RecursionError):
            value = json.loads(text)
            changed = json.dumps(changed_value(value, rng)).encode()
            return changed if text is data else data.replace(text, changed, 1)
    return mutated_token(data, rng)


def changed_value(value: Any, rng: random.Random) -> Any:
    """Return a JSON value that differs in one place."""
    if not isinstance(value, (dict, list)) or not value or rng.random() < 0.1:
        return rng.choice(VALUES)
    keys = list(value) if isinstance(value, dict) else list(range(len(value)))
    key, kind = rng.choice(keys), rng.random()
    changed = value.copy()
    if kind < 0.1:
        del changed[key]
    elif kind < 0.2 and isinstance(changed, list):
        changed.insert(key, value[key])
    else:
        changed[key] = changed_value(value[key], rng)
    return changed


def memory_kb(field: str) -> int:
    """Return VmData, VmRSS or VmHWM of this process, in kB."""
    lines = Path('/proc/self/status').read_text(encoding='utf-8').splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f'{field}:'))


def limit_memory(most: int) -> None:
    """Let this process take so many bytes more than it has.

    Of its data, not of its addresses: each thread of DuckDB reserves 128 MB of addresses.
    """
    limit = memory_kb('VmData') * 1024 + most
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


def in_fork(work: Callable[[], dict[str, Any]], most_bytes: int) -> dict[str, Any]:
    """Return what a function returns in a process of its own that may take so many bytes more.

    The dictionary also has `megabytes`, the most it took, and `died` where it did not end well.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(reading)
            limit_memory(most_bytes)
            before = memory_kb('VmRSS')
            found = work()
            found['megabytes'] = (memory_kb('VmHWM') - before) / 1000
            with os.fdopen(writing, 'w') as pipe:
                json.dump(found, pipe)
        except BaseException:  # noqa: BLE001 - nothing may reach the parent's code
            traceback.print_exc()
        finally:
            # Nothing of the parent's is ended here.
            sys.stderr.flush()
            os._exit(1)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        text = pipe.read()
    status = os.waitpid(child, 0)[1]
    return json.loads(text) if text else {'died': f'status {status}'}


def problem(reader: Reader, path: Path) -> str | None:
    """Say what is wrong with how a reader reads a file; None where it reads or refuses it."""
    # CPU time, since another process may hold the core; the alarm, which ends the process even in
    # compiled code, is for a reader that waits.
    begin = time.process_time()
    faulthandler.dump_traceback_later(6 * MOST_SECONDS, exit=True)
    try:
        reader.read(path)
    except LlmAstarError as error:
        if reader.of_files and not any(
            name in str(error) for name in (path.parent.name, path.name)
        ):
            return f'names no file: {error}'
        if len(str(error)) > MOST_CHARS:
            return f'is too long to be read: {error!s:.300}'
    except BaseException:  # noqa: BLE001 - a reader may raise nothing else
        return traceback.format_exc()
    finally:
        faulthandler.cancel_dump_traceback_later()
    seconds = time.process_time() - begin
    return None if seconds < MOST_SECONDS else f'took {seconds:.1f} s'


def fuzz(reader: Reader, name: str, count: int, folder: Path) -> dict[str, Any]:
    """Read so many mutations of a reader's file; the same every time."""
    path = reader.make(folder)
    data, failures, refused = path.read_bytes(), [], 0
    whole = problem(reader, path)
    if whole is not None:
        return {'failures': [f'the whole file: {whole}'], 'count': 0}
    for number in range(count):
        damaged = mutated(data, random.Random(f'{name} {number}'))  # noqa: S311 - no secret
        path.write_bytes(damaged)
        found = problem(reader, path)
        if found is not None:
            refused += 1
            if len(failures) < MOST_FAILURES:
                failures.append(f'mutation {number}: {damaged[:200]!r}: {found}')
    return {'failures': failures, 'count': count, 'failed': refused}


def run(readers: dict[str, Reader], counts: dict[str, str]) -> Iterator[dict[str, Any]]:
    """Fuzz readers, each so many times and in a process of its own."""
    for name, count in counts.items():
        with tempfile.TemporaryDirectory(prefix='fuzzed-') as folder:
            begin = time.monotonic()
            # The names of files in messages are looked for by that of their folder.
            where = Path(folder) / f'folder-of-{name}'
            where.mkdir()
            found = in_fork(lambda: fuzz(readers[name], name, int(count), where), MOST_BYTES)  # noqa: B023
            seconds = time.monotonic() - begin
            yield {'name': name, 'seconds': round(seconds, 2), **found}


def run_outside(counts: dict[str, int]) -> dict[str, dict[str, Any]]:
    """Fuzz readers, each so many times, in two processes without the threads of this one.

    Returns what came of it by name.
    """
    words = [f'{name}={count}' for name, count in counts.items()]
    script = str(Path(__file__).with_name('fuzz_readers.py'))
    path = os.pathsep.join(item for item in sys.path if item)
    processes = [
        subprocess.Popen(
            [sys.executable, script, *part], env=os.environ | {'PYTHONPATH': path},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )
        for part in (words[::2], words[1::2]) if part
    ]  # fmt: skip
    found = {}
    for process in processes:
        lines = process.communicate()[0].splitlines()
        results = [json.loads(line) for line in lines if line.startswith('{"name":')]
        said = [line for line in lines if not line.startswith('{"name":')]
        found.update({result['name']: {**result, 'said': said[-40:]} for result in results})
    return found

"""Small files that ask for much memory; `python bombs.py` reads each within its limit.

Each is read in a process of its own that may take 300 MB and 10 bytes for each cell of a map. It
prints a line of JSON for each: what was read or refused, and the most memory.
"""

from __future__ import annotations

import base64
import faulthandler
import io
import json
import sqlite3
import struct
import sys
import tempfile
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from fuzz_readers import FIELDS, WAYPOINT_LINE, append_to_transcript, make_results
from fuzzing import MOST_BYTES, MOST_SECONDS, in_fork
from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps import map_server, movingai
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.problem_maps import load_kept_maps
from llm_astar_planner.planning.parameters import read_parameter_files
from llm_astar_planner.waypoints.learned import read_weights
from llm_astar_planner.waypoints.transcript import read_transcript

BYTES_A_CELL = 10
MAGIC = b'\x89MCAP0\r\n'


class Bomb(NamedTuple):
    """A file and its reader; `cells` is how many cells the map has that the file describes."""

    make: Callable[[Path], bytes | str]
    read: Callable[[Path], object]
    cells: int = 0
    name: str = 'x'


def zeros(megabytes: int) -> bytes:
    """Return zeros, compressed by zlib."""
    packer = zlib.compressobj(1)
    return b''.join(packer.compress(bytes(10**6)) for _ in range(megabytes)) + packer.flush()


def png(side: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))
        )

    head = struct.pack('>IIBBBBB', side, side, 8, 0, 0, 0, 0)
    data = zlib.compress(bytes(side * (side + 1)), 1)
    return b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', head) + chunk(b'IDAT', data) + chunk(b'IEND', b'')


def image(contents: bytes) -> Callable[[Path], str]:
    def make(folder: Path) -> str:
        (folder / 'x.image').write_bytes(contents)
        return FIELDS.format('x.image')

    return make


def kept_maps(_: Path) -> str:
    entry = {'id': 0, 'width': 9, 'height': 9, 'resolution': 1.0, 'frame_id': 'map',
             'cells': base64.b64encode(zeros(600)).decode(), 'start_goal': [],
             'optimal_lengths': []}  # fmt: skip
    return json.dumps([entry])


def results(folder: Path) -> str:
    make_results('results.csv')(folder)
    return (folder / 'results.csv').read_text().splitlines()[0] + '\n' + ',' * 45_000_000 + '\n'


def weights(_: Path) -> bytes:
    head = "{'descr': '|u1', 'fortran_order': False, 'shape': (600000000,), }".ljust(117) + '\n'
    held = io.BytesIO()
    with (
        zipfile.ZipFile(held, 'w', zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open('header.npy', 'w') as file,
    ):
        file.write(b'\x93NUMPY\x01\x00' + struct.pack('<H', 118) + head.encode())
        for _ in range(600):
            file.write(bytes(10**6))
    return held.getvalue()


def laughs(_: Path) -> str:
    lines = ['a0: &a0 [x, x, x, x, x, x, x, x, x]']
    lines += [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 9)}]' for n in range(1, 12)]
    return '\n'.join(lines)


def text(value: str) -> bytes:
    return struct.pack('<I', len(value)) + value.encode()


def record(opcode: int, payload: bytes) -> bytes:
    return struct.pack('<BQ', opcode, len(payload)) + payload


TOPIC = record(
    3, struct.pack('<H', 1) + text('nav_msgs/msg/OccupancyGrid') + text('') + text('')
) + record(4, struct.pack('<HH', 1, 1) + text('/map') + text('cdr') + struct.pack('<I', 0))
MESSAGE = record(5, struct.pack('<HIQQ', 1, 1, 5, 5) + b'\0\1\0\0\0\0\0\0')


def chunk(contents: bytes) -> bytes:
    packed = zstandard.ZstdCompressor().compress(contents)
    head = struct.pack('<QQQI', 5, 5, len(contents), 0) + text('zstd')
    return record(6, head + struct.pack('<Q', len(packed)) + packed)


def mcap(*chunks: bytes, summary: int | None = None) -> bytes:
    """Return an mcap file of chunks; its summary is where it is, or at a byte given."""
    head = MAGIC + record(1, text('') + text('')) + TOPIC
    indices, place = b'', len(head)
    for item in chunks:
        span = struct.pack('<QQQQIQ', 5, 5, place, len(item), 0, 0)
        indices += record(8, span + text('zstd') + struct.pack('<QQ', 1, 1))
        place += len(item)
    end = record(15, bytes(4))
    begin = place + len(end) if summary is None else summary
    footer = record(2, struct.pack('<QQI', begin, 0, 0))
    return head + b''.join(chunks) + end + TOPIC + indices + footer + MAGIC


def database(*statements: str) -> Callable[[Path], bytes]:
    def make(folder: Path) -> bytes:
        path = folder / 'made.db'
        connection = sqlite3.connect(path)
        for statement in (
            'CREATE TABLE topics(id, name TEXT, type TEXT, serialization_format TEXT)',
            "INSERT INTO topics VALUES (1, '/map', 'nav_msgs/msg/OccupancyGrid', 'cdr')",
            *statements,
        ):
            connection.execute(statement)
        connection.commit()
        connection.close()
        return path.read_bytes()

    return make


def read_messages(path: Path) -> None:
    with Bag(path) as bag:
        for _ in bag.messages(list(bag.topics)):
            pass


COLUMNS = 'messages(id INTEGER PRIMARY KEY, topic_id, timestamp'
ENDLESS = (
    'CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) '
    'SELECT i AS id, 1 AS topic_id, i AS timestamp, zeroblob(9) AS data FROM n'
)
BOMBS = {
    'image of 4000 x 4000 pixels': Bomb(image(png(4000)), map_server.load_map, 4000**2),
    'image header of 12,600 x 12,600': Bomb(image(b'P5 12600 12600 255\n'), map_server.load_map),
    'MovingAI header': Bomb(
        lambda _: 'type octile\nheight 12600\nwidth 12600\nmap\n', movingai.load_map
    ),
    'MovingAI rows of one cell': Bomb(
        lambda _: 'type octile\nheight 9000000\nwidth 1\nmap\n' + '.\n' * 9_000_000,
        movingai.load_map, 9_000_000,
    ),
    'MovingAI scenarios': Bomb(
        lambda _: 'version 1\n' + '0 x 1 1 0 0 0 0 0\n' * 880_000, movingai.load_scenarios
    ),
    'JSON of empty lists': Bomb(lambda _: '[' + '[],' * 9_000_000 + '[]]', load_barrier_maps),
    'JSON of small objects': Bomb(lambda _: '[' + '{"":0},' * 3_000_000 + '[]]', load_kept_maps),
    '20,000 barrier maps': Bomb(
        lambda _: json.dumps(
            [{'id': n, 'range_x': [0, 9], 'range_y': [0, 9]} for n in range(20_000)]
        ),
        load_barrier_maps,
    ),
    'cells of a kept map': Bomb(kept_maps, load_kept_maps),
    'empty lines of a transcript': Bomb(lambda _: '\n' * 31_000_000, read_transcript),
    'last line of a transcript': Bomb(
        lambda _: json.dumps(WAYPOINT_LINE) + '\n[' + '[],' * 9_000_000, append_to_transcript
    ),
    'row of results': Bomb(
        results, lambda path: list(ResultsFolder(path.parent).read()), name='results.csv'
    ),
    'weights': Bomb(weights, lambda path: read_weights(path.read_bytes(), str(path))),
    'yaml aliases': Bomb(laughs, lambda path: read_parameter_files([path])),
    'yaml values': Bomb(lambda _: '- 1\n' * 260_000, lambda path: read_parameter_files([path])),
    'mcap chunk of 600 MB': Bomb(
        lambda _: mcap(chunk(bytes(600 * 10**6))), read_messages, name='x.mcap'
    ),
    'mcap chunk of a million messages': Bomb(
        lambda _: mcap(chunk(MESSAGE * 900_000)), read_messages, name='x.mcap'
    ),
    'mcap summary before the chunks': Bomb(
        lambda _: mcap(chunk(TOPIC + bytes(600 * 10**6)), summary=8), read_messages, name='x.mcap'
    ),
    'mcap types': Bomb(
        lambda _: mcap(*(
            chunk(b''.join(
                record(3, struct.pack('<H', 100 * n + m) + text('x') * 2 + text('x' * 10**6))
                for m in range(40)))
            for n in range(12)
        ), summary=0),
        read_messages, name='x.mcap',
    ),
    'database with an endless view': Bomb(
        database(ENDLESS),
        read_messages, name='x.db3',
    ),
    'database with computed messages': Bomb(
        database(f'CREATE TABLE {COLUMNS}, data AS (zeroblob(400000000)))',
                 'INSERT INTO messages VALUES (1, 1, 5)'),
        read_messages, name='x.db3',
    ),
    'database with a large message': Bomb(
        database(f'CREATE TABLE {COLUMNS}, data)',
                 'INSERT INTO messages VALUES (1, 1, 5, zeroblob(400000000))'),
        read_messages, name='x.db3',
    ),
}  # fmt: skip


def outcome(bomb: Bomb, path: Path) -> dict[str, Any]:
    """Read a file; say how that ended and how long it took (CPU seconds)."""
    begin = time.process_time()
    # Ends the process.
    faulthandler.dump_traceback_later(6 * MOST_SECONDS, exit=True)
    try:
        bomb.read(path)
        said = 'read'
    except LlmAstarError as error:
        said = f'refused: {error}'
    except Exception as error:  # noqa: BLE001 - what must not happen is reported
        said = f'{type(error).__name__}: {error}'
    return {'outcome': said[:500], 'seconds': round(time.process_time() - begin, 2)}


def main() -> None:
    """Read every bomb."""
    for title, bomb in BOMBS.items():
        with tempfile.TemporaryDirectory(prefix='bomb-') as folder:
            path = Path(folder) / bomb.name
            contents = bomb.make(path.parent)
            path.write_bytes(contents if isinstance(contents, bytes) else contents.encode())
            del contents
            limit = MOST_BYTES + BYTES_A_CELL * bomb.cells
            found = in_fork(lambda: outcome(bomb, path), limit)  # noqa: B023
            found |= {'name': title, 'limit': limit / 1e6}
            sys.stdout.write(f'{json.dumps(found)}\n')


if __name__ == '__main__':
    main()

"""The results folder: rows as they come, and what is known about the run.

`results.csv` has a row a sample and case, failures included. A row is on disk before the next
sample is waited for, so an interrupted run loses none; `--resume` goes on behind the last whole
one.
"""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import hashlib
import io
import json
import math
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import llm_astar_planner
from llm_astar_planner.waypoints.source import SourceStatus

# The parameters that decide rows, whatever else a run is made with.
DECIDING = (
    'seed', 'heuristic', 'weight', 'time_limit', 'max_suboptimality', 'grid', 'rules', 'tolerance',
    'start_tolerance', 'paper_corners', 'requests', 'plan_window', 'topics',
)  # fmt: skip
# What a source said of a row that asking again would not change.
_ANSWERED = frozenset(status.value for status in (
    SourceStatus.OK, SourceStatus.NONE, SourceStatus.NO_WAYPOINTS, SourceStatus.MALFORMED,
))  # fmt: skip
# The maps of the rows, kept beside them so that a folder can be reported on by itself.
MAPS_FILE = 'maps.json'


# A long path is a long field: one through a maze has more turning points than csv reads unasked.
csv.field_size_limit(2**31 - 1)


class ResultsError(RuntimeError):
    """A results folder that cannot be used or written; the message names the file."""


class Case(NamedTuple):
    """What was run: a method and whose waypoints it was given."""

    method: str
    source: str = 'none'
    prompt: str = ''
    model: str = ''

    def __str__(self) -> str:
        """Write it as method/source/prompt/model without the empty parts."""
        return '/'.join(part for part in self if part)


# What no two rows of a run share: map, pair, scale and case.
RowKey = tuple[int, int, int, Case]


@dataclass(frozen=True)
class Row:
    """One sample under one case, a line of results.csv.

    `code` is the name of the result code. `operation`, `storage` and `length` (cells) are NaN
    where the case has none. `waypoints` and `path` (its turning points) are cells `x,y` joined by
    `;`, `verdicts` belong to the waypoints. `seconds_round_trip` is what a call through the live
    graph took, NaN without one. `first_operation` are the expansions up to the first path, and
    `ratio` what the path is proven within, NaN where the method proves nothing. `clearance` and
    `unknown_length` are metres, `turns` changes of direction.

    Of a bag: its name, the number of the request in it, when it was made (seconds since 1970) and
    the digest of the map of then. `recorded_*` is what the robot's own stack made of it: a result
    code and waypoints where it was a planner of ours, the length (cells) and turning points of
    its path, and what is wrong with that path on this map; empty where nothing was recorded.
    """

    map: int
    pair: int
    scale: int
    method: str
    source: str
    prompt: str
    model: str
    code: str
    operation: float = math.nan
    storage: float = math.nan
    length: float = math.nan
    seconds_source: float = 0.0
    seconds_search: float = 0.0
    source_status: str = 'NONE'
    guided_by: str = 'none'
    prompt_tokens: int = 0
    completion_tokens: int = 0
    waypoints: str = ''
    verdicts: str = ''
    path: str = ''
    seconds_round_trip: float = math.nan
    first_operation: float = math.nan
    ratio: float = math.nan
    clearance: float = math.nan
    turns: float = math.nan
    unknown_length: float = math.nan
    bag: str = ''
    request: int = 0
    stamp: float = math.nan
    map_digest: str = ''
    recorded_code: str = ''
    recorded_length: float = math.nan
    recorded_problem: str = ''
    recorded_waypoints: str = ''
    recorded_path: str = ''

    @property
    def case(self) -> Case:
        """The case the row belongs to."""
        return Case(self.method, self.source, self.prompt, self.model)

    @property
    def key(self) -> RowKey:
        """What no two rows of a run share: map, pair, scale and case."""
        return self.map, self.pair, self.scale, self.case

    @property
    def found(self) -> bool:
        """Whether there is a valid path."""
        return self.code == 'NONE'

    @property
    def answered(self) -> bool:
        """Whether the source answered, if only to no use, or none was to be asked."""
        return self.source_status in _ANSWERED


FIELDS = {field.name: str(field.type) for field in dataclasses.fields(Row)}


class ResultsFolder:
    """A folder of results, new or gone on with."""

    def __init__(self, path: str | Path) -> None:
        """Name the folder; nothing is touched yet."""
        self.path = Path(path)
        self.results = self.path / 'results.csv'
        self.transcript = self.path / 'transcript.jsonl'

    def refuse_old(self) -> None:
        """Raise ResultsError where there are results already."""
        if self.results.exists():
            message = f'{self.results}: exists; go on with --resume or name another --out'
            raise ResultsError(message)

    def start(self) -> None:
        """Begin a new results.csv. Raises ResultsError where there is one already."""
        self.refuse_old()
        self._write('results.csv', _csv_line(list(FIELDS)))

    def append(self, rows: Iterable[Row]) -> None:
        """Write rows to disk. Raises ResultsError, say on a full disk; earlier rows are kept."""
        text = ''.join(_csv_line([_text(value) for value in _values(row)]) for row in rows)
        try:
            with self.results.open('a', encoding='utf-8', newline='') as file:
                file.write(text)
        except OSError as error:
            message = (
                f'{self.results}: {error.strerror or error}; the rows before are kept, '
                'make room and go on with --resume'
            )
            raise ResultsError(message) from None

    def read(self) -> list[Row]:
        """Read every whole row in order of samples; figures then do not hang on who came first.

        A row that a crash cut short is left out, and of rows with one key, which two runs at a
        time leave, all but the last. Raises ResultsError.
        """
        text = _read(self.results)
        whole = text[: text.rfind('\n') + 1]
        reader = csv.DictReader(io.StringIO(whole))
        if list(reader.fieldnames or []) != list(FIELDS):
            message = f'{self.results}: its columns are not those of version {_own_version()}'
            raise ResultsError(message)
        try:
            rows = {row.key: row for row in map(_row, reader)}
        except (csv.Error, ValueError) as error:
            message = f'{self.results}: line {reader.line_num}: {error}'
            raise ResultsError(message) from None
        return sorted(rows.values(), key=lambda row: row.key[:3])

    def rewrite(self, rows: Iterable[Row]) -> None:
        """Replace results.csv by these rows, in one step."""
        lines = [list(FIELDS), *([_text(value) for value in _values(row)] for row in rows)]
        self._write('results.csv', ''.join(_csv_line(line) for line in lines))

    def write_json(self, name: str, values: Mapping[str, Any]) -> None:
        """Write a JSON file into the folder; what is not a number becomes null."""
        text = json.dumps(_finite(values), indent=1, allow_nan=False, default=str)
        self._write(name, text + '\n')

    def write_text(self, name: str, text: str) -> Path:
        """Write a text file into the folder and return its path."""
        return self._write(name, text)

    def read_json(self, name: str) -> dict[str, Any]:
        """Read a JSON object of the folder. Raises ResultsError."""
        try:
            values = json.loads(_read(self.path / name))
        except ValueError as error:
            message = f'{self.path / name}: not JSON: {error}'
            raise ResultsError(message) from None
        if not isinstance(values, dict):
            message = f'{self.path / name}: a JSON object is expected'
            raise ResultsError(message)
        return values

    def _write(self, name: str, text: str) -> Path:
        path = self.path / name
        draft = path.with_name(f'.{name}.draft')
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            draft.write_text(text, encoding='utf-8', newline='')
            draft.replace(path)
        except OSError as error:
            with contextlib.suppress(OSError):
                draft.unlink()
            message = f'{path}: {error.strerror or error}'
            raise ResultsError(message) from None
        return path


def describe_run(
    datasets: Sequence[str | Path],
    parameters: Mapping[str, Any],
    files: Sequence[str | Path] = (),
) -> dict[str, Any]:
    """Return the metadata of a run: versions, parameters, digests of its data, machine.

    A dataset may be a folder. `files` are what else decides the rows, such as transcripts and
    prompts. Raises OSError.
    """
    return {
        'version': _own_version(),
        'parameters': dict(parameters),
        'dataset': {
            'file': ', '.join(Path(dataset).name for dataset in datasets),
            'sha256': _digest(*datasets),
        },
        'files': {Path(file).name: _digest(file) for file in files},
        'machine': describe_machine(),
        'packages': {name: _version(name) for name in ('numpy', 'numba', 'scipy', 'shapely')},
    }


def describe_machine() -> dict[str, Any]:
    """Say what machine this is: processor, cores, memory in GiB, system, Python."""
    return {
        'processor': _processor(),
        'cores': os.cpu_count(),
        'memory_gib': round(os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30, 1),
        'system': f'{platform.system()} {platform.machine()}',
        'python': platform.python_version(),
    }


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Say in what two runs differ that makes their rows no longer one set of results."""
    changed = [] if before.get('version') == now['version'] else ['version']
    if before.get('dataset', {}).get('sha256') != now['dataset']['sha256']:
        changed.append('dataset')
    old = before.get('parameters', {})
    return changed + [
        f'{name} ({old.get(name)} before)'
        for name in DECIDING
        if old.get(name) != now['parameters'].get(name)
    ]


def _values(row: Row) -> list[Any]:
    return [getattr(row, name) for name in FIELDS]


def _text(value: object) -> str:
    if isinstance(value, float):
        return '' if math.isnan(value) else repr(round(value, 9))
    return str(value)


def _csv_line(values: Sequence[str]) -> str:
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator='\n').writerow(values)
    return buffer.getvalue()


def _row(record: Mapping[str, str]) -> Row:
    if None in record or None in record.values():  # where it holds more or fewer
        message = f'{len(FIELDS)} values are expected'
        raise ValueError(message)
    values: dict[str, Any] = dict(record)
    for name, kind in FIELDS.items():
        if kind == 'int':
            values[name] = int(record[name])
        elif kind == 'float':
            values[name] = float(record[name]) if record[name] else math.nan
    return Row(**values)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        message = f'{path}: {getattr(error, "strerror", None) or error}'
        raise ResultsError(message) from None


def _finite(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """Replace NaN and infinities, which JSON has not, by None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value


def _digest(*paths: str | Path) -> str:
    """Return the SHA-256 of files one after the other, of folders' files by their names.

    Less what SQLite keeps beside a bag for its locks, which reading changes.
    """
    digest = hashlib.sha256()
    for path in map(Path, paths):
        for file in sorted(path.iterdir()) if path.is_dir() else [path]:
            if file.is_file() and not file.name.endswith('-shm'):
                _add_file(digest, file)
    return digest.hexdigest()


def _add_file(digest: hashlib._Hash, path: Path) -> None:
    with path.open('rb') as file:
        while block := file.read(1 << 20):
            digest.update(block)


def _own_version() -> str:
    return llm_astar_planner.__version__


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return 'missing'


def _processor() -> str:
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
    except OSError:
        lines = []
    names = (line.partition(':')[2].strip() for line in lines if line.startswith('model name'))
    return next(names, platform.processor() or 'unknown')

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The results folder of a run: one CSV row per sample and variant, and the run's metadata.

Rows are appended to `results.csv` as samples finish, failures included, so an interrupted run
keeps every finished row. `--resume` continues after the last complete one.
"""

import csv
import fcntl
import hashlib
import io
import json
import math
import os
import platform
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import short_repr
from llm_astar_msgs_adapter.files import read_json, read_yaml
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places, load_places

import llm_astar_planner
from llm_astar_lab.results.row import COLUMNS, ResultsError, Row
from llm_astar_lab.results.stored_rows import ANSWERED, UNANSWERED, Finished, StoredRows

# Costmap parameters that 0.1.0 wrote under another name.
RULE_ALIASES = {'cost_multiplier': 'cost_travel_multiplier'}
# Costmap parameters that 0.1.0 did not have, with the values that it planned by.
OLD_RULES = {'unknown_cost': 0}
# The shape of metadata.json, and which of its parameters a resumed run must share.
METADATA = read_yaml(Path(__file__).with_name('metadata.yaml'), ResultsError)
# What runs that do not say it had.
UNSTATED = {'examples_file': ''}
# The maps of the rows, stored in the folder so that a report needs no dataset.
MAPS_FILE = 'maps.json'
# The places that instructions of the run name, if there were any.
PLACES_FILE = 'places.geojson'

# What a report consists of, besides its pictures.
REPORT_FILES = ('summary.json', 'report.md', 'report.html')
# The folders that this process has claimed, with the descriptors that hold the locks.
CLAIMED: dict[Path, int] = {}

# Rows of a Parquet part: so many wait in results.csv first, where a crash does not lose them.
PART_ROWS = 16_384


class ResultsFolder:
    """The results folder of one run, new or resumed."""

    def __init__(self, path: str | Path) -> None:
        """Set the paths; nothing is read or written yet."""
        self.path = Path(path)
        self.results, self.transcript, self._parts = (
            self.path / name for name in ('results.csv', 'transcript.jsonl', 'results.parquet')
        )
        # Rows of results.csv that are not in a part yet.
        self._waiting = 0

    @property
    def parts(self) -> list[Path]:
        """The Parquet files, in the order in which they were written."""
        return sorted(self._parts.glob(f'part-{6 * "[0-9]"}.parquet'))

    @property
    def has_rows(self) -> bool:
        """Whether there are rows."""
        if self.parts or not self.results.exists():
            return bool(self.parts)
        with self.results.open('rb') as file:
            return bool(file.readline()) and file.readline().endswith(b'\n')

    @property
    def is_parquet(self) -> bool:
        """Whether the rows go into Parquet parts, PART_ROWS at a time, by way of results.csv."""
        return self._parts.is_dir()

    def claim(self) -> None:
        """Keep the runs of other processes out until this one ends. Raises ResultsError."""
        with writing(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            key = self.path.resolve()
            if key in CLAIMED:
                return
            number = os.open(key, os.O_RDONLY | os.O_DIRECTORY)
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(number)
            message = f'{self.path}: another run writes to it; wait for it, or name another --out'
            raise ResultsError(message) from None
        except OSError:
            pass  # a file system without locks
        CLAIMED[key] = number

    def require_own(self) -> None:
        """Raise ResultsError where files that a run would replace are not those of a run."""
        if (self.path / 'metadata.json').exists():
            return
        for name in REPORT_FILES:
            if (path := self.path / name).exists():
                raise ResultsError(f'{path}: is there, but of no run; name another --out')

    def require_new(self) -> None:
        """Raise ResultsError where the folder already has rows."""
        if self.has_rows:
            ways = 'continue it with --resume, replace it with --overwrite, or name another --out'
            raise ResultsError(f'{self.results}: exists; {ways}')

    def discard_results(self) -> None:
        """Remove rows and reports of an earlier run; a transcript stays. Raises ResultsError."""
        tables = [*self.path.glob('tables/*.tex'), *self.path.glob('tables/*.csv')]
        with writing(self.path):
            self._clear_parts()
            for name in ('results.csv', *REPORT_FILES, PLACES_FILE):
                (self.path / name).unlink(missing_ok=True)
            for path in filter(Path.is_file, tables):
                path.unlink()

    def start(self, *, parquet: bool = False) -> None:
        """Create an empty results.csv, and for Parquet the folder of the parts.

        Raises ResultsError where there are rows or the folder cannot be written to.
        """
        self.require_new()
        with writing(self.path):
            self._clear_parts()
            if parquet:
                self._parts.mkdir(parents=True)
            self._clear_csv()

    def append(self, rows: Iterable[Row]) -> None:
        """Append rows to results.csv.

        Raises ResultsError, for example on a full disk; the rows written before are kept.
        """
        lines = [format_row(row) for row in rows]
        advice = 'the rows before are kept: free some space and continue with --resume'
        with writing(self.results, advice):
            with self.results.open('a', encoding='utf-8', newline='') as file:
                file.write(format_csv(lines))
            self._waiting += len(lines)
            if self._waiting >= PART_ROWS and self.is_parquet:
                self._fold()

    def fold(self) -> None:
        """Move the rows that wait in results.csv into a Parquet part, if the run writes parts.

        Raises ResultsError; no row is lost then.
        """
        with writing(self.path):
            if self.is_parquet:
                self._fold()

    def stored(self, beside: StoredRows | None = None) -> StoredRows:
        """Return all complete rows once, sorted by map, pair and scale; see StoredRows.

        A last row that was cut short by a crash is skipped. Of rows with the same key, which two
        simultaneous runs leave behind, the last one counts. Raises ResultsError.
        """
        return StoredRows([*self.parts, self.results], beside)

    def read(self) -> Iterator[Row]:
        """Yield the rows of `stored`, without holding them. Raises ResultsError at once."""
        return self.stored().rows()

    def keep_answered(self) -> Finished:
        """Drop the rows whose source never answered and return what the others finished.

        Raises ResultsError; no answered row is lost then.
        """
        stored, parts = self.stored(), self.parts
        done = stored.finished(ANSWERED)
        with writing(self.path):
            if not self.is_parquet:
                with drafted(self.results) as draft:
                    stored.write(draft, ANSWERED)
            elif stored.variants(UNANSWERED):
                self._add_part(stored, ANSWERED)
                for part in parts:
                    part.unlink()
                self._clear_csv()
            else:
                del stored  # so that only one database is open
                self._fold()
        return done

    def _fold(self) -> None:
        waiting = StoredRows([self.results])
        if len(waiting):
            # A crash between the two leaves rows twice, and the last of equal rows counts.
            self._add_part(waiting)
            self._clear_csv()
        self._waiting = 0

    def _add_part(self, rows: StoredRows, condition: str = 'true') -> None:
        """Write rows as a new part, which is there in full or not at all. Raises OSError."""
        parts = self.parts
        number = int(parts[-1].stem.removeprefix('part-')) + 1 if parts else 0
        with drafted(self._parts / f'part-{number:06d}.parquet') as draft:
            rows.write(draft, condition)

    def _clear_csv(self) -> None:
        with drafted(self.results) as draft:
            draft.write_text(format_csv([list(COLUMNS)]), encoding='utf-8')

    def _clear_parts(self) -> None:
        for path in (*self.parts, *self._parts.glob('.*.draft*')):
            path.unlink()
        if self.is_parquet:
            self._parts.rmdir()

    def write_json(self, name: str, values: Mapping[str, Any]) -> None:
        """Write a JSON file into the folder; NaN and infinities become null."""
        text = json.dumps(without_nan(values), indent=1, allow_nan=False, default=str)
        self.write_text(name, text + '\n')

    def write_text(self, name: str, text: str) -> Path:
        """Write a file into the folder, whole or not at all; return its path.

        `name` may be in a subfolder, which is made. Raises ResultsError.
        """
        path = self.path / name
        with writing(path), drafted(path) as draft:
            draft.write_text(text, encoding='utf-8', newline='')
        return path

    def write_places(self, places: Places) -> None:
        """Keep the places of a run, so that a report shows them; nothing where there are none."""
        if len(places):
            self.write_text(PLACES_FILE, json.dumps(places.to_geojson()) + '\n')

    def read_places(self) -> Places:
        """Read the places of the run. Raises PlacesError where the file is malformed."""
        path = self.path / PLACES_FILE
        return load_places(path) if path.exists() else NO_PLACES

    def read_json(self, name: str) -> dict[str, Any]:
        """Read a JSON object from the folder. Raises ResultsError."""
        path = self.path / name
        values = read_json(path, ResultsError)
        if not isinstance(values, dict):
            raise ResultsError(f'{path}: a JSON object is expected')
        return values

    def read_metadata(self) -> dict[str, Any]:
        """Read metadata.json in the parameters of today, not 0.1.0's. Raises ResultsError."""
        metadata, path = self.read_json('metadata.json'), self.path / 'metadata.json'
        for name in ('version', 'parameters', 'dataset', 'machine'):
            if name not in metadata:
                raise ResultsError(f'{path}: {name} is missing')
        check_shape(metadata, METADATA['shape'], str(path))
        parameters = metadata['parameters']
        if parameters.get('seed', 0) < 0:
            raise ResultsError(f'{path}: parameters: seed: 0 or more is expected')
        if rules := parameters.get('rules'):
            parameters['rules'] = OLD_RULES | {
                RULE_ALIASES.get(name, name): value for name, value in rules.items()
            }
        return metadata


@contextmanager
def writing(path: Path, advice: str = '') -> Iterator[None]:
    """Raise ResultsError, which names the file and what to do, for an OSError."""
    try:
        yield
    except OSError as error:
        message = f'{path}: {error.strerror or error}' + (f'; {advice}' if advice else '')
        raise ResultsError(message) from None


@contextmanager
def drafted(path: Path) -> Iterator[Path]:
    """Name a file that takes the place of `path` when the block ends without error."""
    draft = path.with_name(f'.{path.stem}.draft{path.suffix}')
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield draft
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def format_row(row: Row) -> list[str]:
    """Return the cells of a CSV line; NaN is an empty cell."""
    values = [getattr(row, name) for name in COLUMNS]
    return [
        ('' if math.isnan(value) else repr(round(value, 9)))
        if isinstance(value, float)
        else str(value)
        for value in values
    ]


def format_csv(lines: Iterable[Sequence[str]]) -> str:
    """Return lines of cells as CSV text."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator='\n').writerows(lines)
    return buffer.getvalue()


def check_shape(value: Any, shape: Any, where: str) -> None:  # noqa: ANN401 - any JSON value
    """Raise ResultsError, which begins with `where`, for a JSON value unlike a shape as SHAPE."""
    expected = shape if isinstance(shape, str) else type(shape).__name__
    found = 'null' if value is None else type(value).__name__
    if found not in expected.split(' or '):
        raise ResultsError(f'{where}: {expected} is expected, not {short_repr(value)}')
    if isinstance(shape, dict):
        for name in filter(value.__contains__, shape):
            check_shape(value[name], shape[name], f'{where}: {name}')
    elif isinstance(shape, list):
        for item in value:
            check_shape(item, shape[0], where)


def describe_run(
    datasets: Sequence[str | Path], parameters: Mapping[str, Any], files: Sequence[str | Path] = ()
) -> dict[str, Any]:
    """Return the metadata of a run: version, parameters, digests of its input, machine.

    A dataset may be a folder. `files` are other inputs that the rows depend on, such as
    transcripts and prompts; two of the same name go by their paths. Raises OSError.
    """
    count = Counter(Path(file).name for file in dict.fromkeys(files))
    names = {file: Path(file).name if count[Path(file).name] == 1 else str(file) for file in files}
    return {
        'version': llm_astar_planner.__version__,
        'parameters': dict(parameters),
        'dataset': {
            'file': ', '.join(Path(dataset).name for dataset in datasets),
            'sha256': digest_files(*datasets),
        },
        'files': {names[file]: digest_files(file) for file in names},
        'machine': describe_machine(),
        'packages': {name: version(name) for name in ('numpy', 'numba', 'scipy', 'shapely')},
    }


def describe_machine() -> dict[str, Any]:
    """Return processor, cores, memory in GiB, operating system and Python version."""
    lines: list[str] = []
    with suppress(OSError):
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
    models = (line.partition(':')[2].strip() for line in lines if line.startswith('model name'))
    return {
        'processor': next(models, platform.processor() or 'unknown'), 'cores': os.cpu_count(),
        'memory_gib': round(os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30, 1),
        'system': f'{platform.system()} {platform.machine()}', 'python': platform.python_version(),
    }  # fmt: skip


def run_differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return what differs between two runs' metadata and forbids mixing their rows."""
    changed = []
    if before['version'] != now['version']:
        changed.append(f'version ({before["version"]} before, {now["version"]} now)')
    if before['dataset'].get('sha256') != now['dataset']['sha256']:
        changed.append('dataset')
    old, new = UNSTATED | before['parameters'], UNSTATED | now['parameters']
    differ = (name for name in METADATA['compared'] if old.get(name) != new.get(name))
    return changed + [f'{name} ({before["parameters"].get(name)} before)' for name in differ]


def without_nan(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """Replace NaN and infinities, which JSON cannot hold, by None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): without_nan(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [without_nan(item) for item in value]
    return value


def digest_files(*paths: str | Path) -> str:
    """Return the SHA-256 of the concatenated files; a folder counts as its files by name.

    SQLite's `-shm` files are skipped, because reading a bag changes them.
    """
    digest = hashlib.sha256()
    for path in map(Path, paths):
        for file in sorted(path.iterdir()) if path.is_dir() else [path]:
            if file.is_file() and not file.name.endswith('-shm'):
                with file.open('rb') as stream:
                    while block := stream.read(1 << 20):
                        digest.update(block)
    return digest.hexdigest()

"""The results folder of a run: one CSV row per sample and variant, and the run's metadata.

Rows are appended to `results.csv` as samples finish, failures included, so an interrupted run
keeps every finished row. `--resume` continues after the last complete one.
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
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from itertools import islice, pairwise
from pathlib import Path
from types import NoneType
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr
from llm_astar_msgs_adapter.files import read_json, read_text
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from llm_astar_msgs_adapter.maps.places_file import load_places
from numpy.typing import NDArray

import llm_astar_planner
from llm_astar_planner.search.any_angle import turning_points
from llm_astar_planner.waypoints.source import SourceStatus

# The method that takes the waypoints themselves as the path, called `llm_only` up to 0.1.0.
WAYPOINTS_ONLY = 'waypoints_only'
METHOD_ALIASES = {'llm_only': WAYPOINTS_ONLY}
# Costmap parameters that 0.1.0 wrote under another name.
RULE_ALIASES = {'cost_multiplier': 'cost_travel_multiplier'}
# Costmap parameters that 0.1.0 did not have, with the values that it planned by.
OLD_RULES = {'unknown_cost': 0}
# A run is resumed only with equal values of these parameters: they change the rows.
COMPARED_PARAMETERS = (
    'seed', 'heuristic', 'weight', 'time_limit', 'max_suboptimality', 'grid', 'rules', 'tolerance',
    'start_tolerance', 'paper_corners', 'requests', 'plan_window', 'topics', 'instruction',
    'instruction_policy',
)  # fmt: skip
# Source statuses that a second query would not change.
FINAL_STATUSES = frozenset(status.value for status in (
    SourceStatus.OK, SourceStatus.NONE, SourceStatus.NO_WAYPOINTS, SourceStatus.MALFORMED,
))  # fmt: skip
# The maps of the rows, stored in the folder so that a report needs no dataset.
MAPS_FILE = 'maps.json'
# The places that instructions of the run name, if there were any.
PLACES_FILE = 'places.geojson'

# Rows of a folder, which take about 1 kB each, and characters of one.
MAX_ROWS = 200_000
MAX_LINE_CHARS = 16_000_000
# What the fields of metadata.json are, where they are there.
METADATA_TYPES: dict[str, tuple[type, ...]] = {
    'version': (str,), 'parameters': (dict,), 'dataset': (dict,), 'machine': (dict,),
    'seconds': (int, float), 'bags': (list,), 'left_out': (list,), 'notes': (list,),
}  # fmt: skip
PARAMETER_TYPES: dict[str, tuple[type, ...]] = {
    'seed': (int,), 'rules': (dict, NoneType), 'price': (list, NoneType), 'heuristic': (str,),
    'weight': (int, float), 'time_limit': (int, float), 'tolerance': (int, float),
    'start_tolerance': (int, float), 'max_suboptimality': (int, float, NoneType),
    'paper_corners': (bool,),
}  # fmt: skip
DATASET_TYPES: dict[str, tuple[type, ...]] = {'file': (str,), 'sha256': (str,)}

# The turning points of a path through a maze exceed csv's default limit of 131072 characters.
csv.field_size_limit(2**31 - 1)


class ResultsError(LlmAstarError, RuntimeError):
    """A results folder cannot be read, written or resumed; the message names the file."""


class Variant(NamedTuple):
    """What is compared: a method with a waypoint source, its prompt and its model."""

    method: str
    source: str = 'none'
    prompt: str = ''
    model: str = ''

    def __str__(self) -> str:
        """Return method/source/prompt/model without the empty parts."""
        return '/'.join(part for part in self if part)


# The paper's A*, to which every ratio refers.
PAPER_ASTAR = Variant('astar')
# Map id, pair index, scale and variant: unique within a run.
RowKey = tuple[int, int, int, Variant]


@dataclass(frozen=True, slots=True)
class Row:
    """One sample planned with one variant: a line of results.csv, whose columns are the fields.

    `code` is the name of the result code. `operation` (expansions), `storage` and `length` (cells)
    are NaN where the variant has none. `waypoints` and `path` (its turning points) are cells
    `x,y` joined by `;`, and `verdicts` are the statuses of the waypoints.
    `seconds_round_trip` is the time of a call through the running graph, NaN without a graph.
    `first_operation` counts the expansions up to the first path. `ratio` is the suboptimality
    bound that was proven, NaN where the method proves none. `clearance` and `unknown_length` are
    in metres, `turns` counts changes of direction. `instruction` says what became of each clause
    of an instruction; `instruction_satisfied` is 1 if all of it was understood and satisfied, 0
    if not, NaN where nothing was asked. `reply_problems` are the names of what is wrong with a
    model's reply, joined by `;`: empty where nothing is, and where no model replied. `family` is
    the family of the map, such as `rooms`, empty where it is unknown.

    For a request from a bag: the bag's name, the index of the request in it, its time (seconds
    since 1970) and the digest of the map at that time. `recorded_*` is the result of the planner
    that was running on the robot: its result code and waypoints where it was this planner, length
    (cells) and turning points of its path, why that path is invalid on this map, and what became
    of its instruction. They are empty where nothing was recorded.
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
    instruction: str = ''
    instruction_satisfied: float = math.nan
    recorded_instruction: str = ''
    recorded_instruction_satisfied: float = math.nan
    reply_problems: str = ''
    family: str = ''

    @property
    def variant(self) -> Variant:
        """The variant that was run."""
        return Variant(self.method, self.source, self.prompt, self.model)

    @property
    def key(self) -> RowKey:
        """Map, pair, scale and variant, unique within a run."""
        return self.map, self.pair, self.scale, self.variant

    @property
    def found(self) -> bool:
        """Whether there is a valid path."""
        return self.code == 'NONE'

    @property
    def answered(self) -> bool:
        """Whether the source answered, usefully or not, or no source was asked."""
        return self.source_status in FINAL_STATUSES


COLUMNS = {field.name: str(field.type) for field in dataclasses.fields(Row)}
# The columns that results of earlier versions do not have.
ADDED_COLUMNS = (
    'instruction', 'instruction_satisfied', 'recorded_instruction',
    'recorded_instruction_satisfied', 'reply_problems', 'family',
)  # fmt: skip
# The columns that a plan fills, by the names of `Plan.to_dict()` and of reports.
PLAN_COLUMNS = (
    'operation', 'storage', 'seconds_source', 'seconds_search', 'source_status', 'guided_by',
    'ratio', 'instruction',
)  # fmt: skip
# The columns that it fills only if a path was found.
PATH_COLUMNS = ('length', 'first_operation', 'clearance', 'turns', 'unknown_length')


class ResultsFolder:
    """The results folder of one run, new or resumed."""

    def __init__(self, path: str | Path) -> None:
        """Set the paths; nothing is read or written yet."""
        self.path = Path(path)
        self.results = self.path / 'results.csv'
        self.transcript = self.path / 'transcript.jsonl'

    @property
    def has_rows(self) -> bool:
        """Whether there is anything in results.csv below its header."""
        return self.results.exists() and self.results.read_bytes().count(b'\n') > 1

    def require_new(self) -> None:
        """Raise ResultsError where the folder already has rows."""
        if self.has_rows:
            message = (
                f'{self.results}: exists; continue it with --resume, replace it with --overwrite, '
                'or name another --out'
            )
            raise ResultsError(message)

    def discard_results(self) -> None:
        """Remove the rows and reports of an earlier run; a transcript stays. Raises OSError."""
        for name in ('results.csv', 'summary.json', 'report.md', 'report.html', PLACES_FILE):
            (self.path / name).unlink(missing_ok=True)
        for path in (self.path / 'tables').glob('*.*'):
            path.unlink()

    def start(self) -> None:
        """Create an empty results.csv. Raises ResultsError where one exists."""
        self.require_new()
        self.rewrite([])

    def append(self, rows: Iterable[Row]) -> None:
        """Append rows to results.csv.

        Raises ResultsError, for example on a full disk; the rows written before are kept.
        """
        text = format_csv([format_row(row) for row in rows])
        try:
            with self.results.open('a', encoding='utf-8', newline='') as file:
                file.write(text)
        except OSError as error:
            message = (
                f'{self.results}: {error.strerror or error}; the rows before are kept: '
                'free some space and continue with --resume'
            )
            raise ResultsError(message) from None

    def read(self) -> list[Row]:
        """Read all complete rows, sorted by map, pair and scale.

        A last row that was cut short by a crash is skipped. Of rows with the same key, which two
        simultaneous runs leave behind, the last one counts. Raises ResultsError.
        """
        text = read_text(self.results, ResultsError)
        reader = csv.DictReader(complete_lines(text))
        names = list(reader.fieldnames or [])
        if names != [name for name in COLUMNS if name in names or name not in ADDED_COLUMNS]:
            message = (
                f'{self.results}: its columns are not those of version '
                f'{llm_astar_planner.__version__}'
            )
            raise ResultsError(message)
        try:
            rows = {row.key: row for row in islice(map(parse_row, reader), MAX_ROWS + 1)}
        except (csv.Error, ValueError) as error:
            message = f'{self.results}: line {reader.line_num}: {error}'
            raise ResultsError(message) from None
        if len(rows) > MAX_ROWS:
            raise ResultsError(f'{self.results}: over {MAX_ROWS} rows')
        return sorted(rows.values(), key=lambda row: row.key[:3])

    def rewrite(self, rows: Iterable[Row]) -> None:
        """Replace results.csv atomically by these rows."""
        lines = [list(COLUMNS), *(format_row(row) for row in rows)]
        self.write_text('results.csv', format_csv(lines))

    def write_json(self, name: str, values: Mapping[str, Any]) -> None:
        """Write a JSON file into the folder; NaN and infinities become null."""
        text = json.dumps(without_nan(values), indent=1, allow_nan=False, default=str)
        self.write_text(name, text + '\n')

    def write_text(self, name: str, text: str) -> Path:
        """Write a file into the folder, whole or not at all; return its path.

        `name` may be in a subfolder, which is made. Raises ResultsError.
        """
        path = self.path / name
        draft = path.with_name(f'.{path.name}.draft')
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            draft.write_text(text, encoding='utf-8', newline='')
            draft.replace(path)
        except OSError as error:
            with contextlib.suppress(OSError):
                draft.unlink()
            message = f'{path}: {error.strerror or error}'
            raise ResultsError(message) from None
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
        check_types(metadata, METADATA_TYPES, str(path))
        parameters = metadata['parameters']
        check_types(parameters, PARAMETER_TYPES, f'{path}: parameters')
        check_types(metadata['dataset'], DATASET_TYPES, f'{path}: dataset')
        if rules := parameters.get('rules'):
            parameters['rules'] = OLD_RULES | {
                RULE_ALIASES.get(name, name): value for name, value in rules.items()
            }
        return metadata


def check_types(
    fields: Mapping[str, Any], types: Mapping[str, tuple[type, ...]], where: str
) -> None:
    """Raise ResultsError, which begins with `where`, for a field of another type."""
    for name, kinds in types.items():
        value = fields.get(name, '')
        if name in fields and (
            not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds)
        ):
            expected = ' or '.join('null' if kind is NoneType else kind.__name__ for kind in kinds)
            raise ResultsError(f'{where}: {name}: {expected} is expected, not {short_repr(value)}')


def describe_run(
    datasets: Sequence[str | Path], parameters: Mapping[str, Any], files: Sequence[str | Path] = ()
) -> dict[str, Any]:
    """Return the metadata of a run: version, parameters, digests of its input, machine.

    A dataset may be a folder. `files` are other inputs that the rows depend on, such as
    transcripts and prompts. Raises OSError.
    """
    return {
        'version': llm_astar_planner.__version__,
        'parameters': dict(parameters),
        'dataset': {
            'file': ', '.join(Path(dataset).name for dataset in datasets),
            'sha256': digest_files(*datasets),
        },
        'files': {Path(file).name: digest_files(file) for file in files},
        'machine': describe_machine(),
        'packages': {
            name: package_version(name) for name in ('numpy', 'numba', 'scipy', 'shapely')
        },
    }


def describe_machine() -> dict[str, Any]:
    """Return processor, cores, memory in GiB, operating system and Python version."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
    except OSError:
        lines = []
    models = (line.partition(':')[2].strip() for line in lines if line.startswith('model name'))
    return {
        'processor': next(models, platform.processor() or 'unknown'),
        'cores': os.cpu_count(),
        'memory_gib': round(os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30, 1),
        'system': f'{platform.system()} {platform.machine()}',
        'python': platform.python_version(),
    }


def run_differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return what differs between two runs' metadata and forbids mixing their rows."""
    changed = []
    if before.get('version') != now['version']:
        changed.append(f'version ({before.get("version")} before, {now["version"]} now)')
    if before.get('dataset', {}).get('sha256') != now['dataset']['sha256']:
        changed.append('dataset')
    old = before['parameters']
    return changed + [
        f'{name} ({old.get(name)} before)'
        for name in COMPARED_PARAMETERS
        if old.get(name) != now['parameters'].get(name)
    ]


def plan_columns(
    values: Mapping[str, Any], statuses: Iterable[str], path: NDArray[np.int32]
) -> dict[str, Any]:
    """Return the columns of a row that describe a plan.

    `values` is `Plan.to_dict()` or the fields of a report with its length in cells; `statuses`
    are those of the waypoints, `path` the cells [n, 2]. A number that is None is unknown, except
    that a clearance of None is infinite.
    """
    names = PLAN_COLUMNS + (PATH_COLUMNS if values['code'] == 0 else ())
    columns: dict[str, Any] = {
        'code': values['code_name'],
        'verdicts': ';'.join(statuses),
        'path': format_points(turning_points(path)),
    }
    for name in names:
        unknown = math.inf if name == 'clearance' else math.nan
        value = unknown if values[name] is None else values[name]
        columns[name] = float(value) if COLUMNS[name] == 'float' else value
    columns['instruction_satisfied'] = satisfied_column(values['instruction_report'])
    return columns


def satisfied_column(report: Mapping[str, Any] | None) -> float:
    """Return 1 if a report says that an instruction is satisfied, 0 if not, NaN without one."""
    satisfied = None if report is None else report.get('satisfied')
    return math.nan if satisfied is None else float(satisfied is True)


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


def complete_lines(text: str) -> Iterator[str]:
    """Yield the lines of a text with their line ends, but for a last one without.

    Raises ValueError for a line of over MAX_LINE_CHARS characters.
    """
    begin = 0
    while end := text.find('\n', begin) + 1:
        if end - begin > MAX_LINE_CHARS:
            raise ValueError(f'over {MAX_LINE_CHARS} characters')
        yield text[begin:end]
        begin = end


def parse_row(record: Mapping[str, str]) -> Row:
    """Read a CSV record, with the method names of older versions. Raises ValueError."""
    if None in record or None in record.values():  # more or fewer cells than columns
        message = f'{len([name for name in record if name])} values are expected'
        raise ValueError(message)
    # Most texts stand in many rows: they are kept once.
    values: dict[str, Any] = {name: sys.intern(text) for name, text in record.items()}
    for name, kind in COLUMNS.items():
        if name not in record:
            continue
        if kind == 'int':
            values[name] = int(record[name])
        elif kind == 'float':
            values[name] = float(record[name]) if record[name] else math.nan
    values['method'] = METHOD_ALIASES.get(record['method'], record['method'])
    return Row(**values)


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


def package_version(package: str) -> str:
    """Return the installed version of a package, or `missing`."""
    try:
        return version(package)
    except PackageNotFoundError:
        return 'missing'


def parse_points(text: str) -> tuple[tuple[float, float], ...]:
    """Read the points of a row, `x,y` joined by `;`. Raises ValueError."""
    points = (item.split(',') for item in text.split(';') if item)
    return tuple((float(x), float(y)) for x, y in points)


def format_points(points: Iterable[Iterable[float]]) -> str:
    """Write points as rows store them; `parse_points` is the inverse."""
    return ';'.join(','.join(f'{value:g}' for value in point) for point in points)


def cells_along(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return the cells [m, 2] along a polyline through points [n, 2], in steps of one cell."""
    corners = np.rint(points).astype(np.int32)
    segments = [corners[:1]]
    for begin, end in pairwise(corners):
        steps = int(np.abs(end - begin).max())
        parts = np.arange(1, steps + 1)[:, None] / max(steps, 1)
        segments.append(np.rint(begin + parts * (end - begin)).astype(np.int32))
    return np.concatenate(segments)

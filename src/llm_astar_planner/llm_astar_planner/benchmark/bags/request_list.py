"""Start-goal lists: requests written down in a CSV or JSON file, in metres in the map's frame."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.maps.grid_map import Pose2D

COLUMNS = ('start_x', 'start_y', 'goal_x', 'goal_y')


class RequestListError(ValueError):
    """A list that cannot be used; the message names the file, the entry and the field."""


class ListedRequest(NamedTuple):
    """A request, made `time` seconds behind the bag's first message, infinity: at its end."""

    number: int
    time: float
    start: Pose2D
    goal: Pose2D


def load_requests(path: str | Path) -> list[ListedRequest]:
    """Read a list of requests.

    A `.json` file holds a list of `{"start": [x, y], "goal": [x, y], "time": t}`; any other is CSV
    with a head naming `start_x, start_y, goal_x, goal_y` and, if wanted, `time`. Without a time a
    request is made on the last map. Raises RequestListError.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding='utf-8-sig')
    except (OSError, UnicodeDecodeError) as error:
        raise RequestListError(f'{path}: {getattr(error, "strerror", None) or error}') from None
    entries = _from_json(text, path) if path.suffix == '.json' else _from_csv(text, path)
    requests = [_request(entry, f'{path}: entry {n}', n) for n, entry in enumerate(entries, 1)]
    if not requests:
        raise RequestListError(f'{path}: lists no requests')
    return requests


def _from_csv(text: str, path: Path) -> Iterable[Mapping[str, Any]]:
    reader = csv.DictReader(text.splitlines(), skipinitialspace=True)
    missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
    if missing:
        raise RequestListError(f'{path}: its first line must name {", ".join(missing)}, too')
    return list(reader)


def _from_json(text: str, path: Path) -> Iterable[Mapping[str, Any]]:
    try:
        entries = json.loads(text)
    except ValueError as error:
        raise RequestListError(f'{path}: not JSON: {error}') from None
    if not isinstance(entries, list):
        raise RequestListError(f'{path}: a JSON list of requests is expected')
    return [_flat(entry, f'{path}: entry {n}') for n, entry in enumerate(entries, 1)]


def _flat(entry: object, where: str) -> Mapping[str, Any]:
    """Bring a JSON entry into the columns of a CSV file."""
    if not isinstance(entry, dict):
        raise RequestListError(f'{where}: an object with start and goal is expected')
    values = {'time': entry.get('time')}
    for name in ('start', 'goal'):
        point = entry.get(name)
        if not isinstance(point, list) or len(point) != 2:
            raise RequestListError(f'{where}: {name}: [x, y] in metres is expected')
        values[f'{name}_x'], values[f'{name}_y'] = point
    return values


def _request(entry: Mapping[str, Any], where: str, number: int) -> ListedRequest:
    start_x, start_y, goal_x, goal_y = (_number(entry[name], name, where) for name in COLUMNS)
    given = entry.get('time')
    time = math.inf if given in (None, '') else _number(given, 'time', where)
    return ListedRequest(number, time, Pose2D(start_x, start_y), Pose2D(goal_x, goal_y))


def _number(value: Any, field: str, where: str) -> float:  # noqa: ANN401 - as the file has it
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(value, bool) or not math.isfinite(number):
        raise RequestListError(f'{where}: {field}: a number is expected, not {value!r}')
    return number

"""MovingAI's sets of maps and scenarios, read from a folder that the user has.

The archives of https://movingai.com/benchmarks/grids.html unpack as `dao-map/x.map` and
`dao-scen/x.map.scen`; they may lie side by side, in folders named by their set, or in one.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem, GridProblemError
from llm_astar_msgs_adapter.maps.grid_map import MAX_CELLS
from llm_astar_msgs_adapter.maps.problem_maps import load_scenario_problem

# The sets by their names on the site: Baldur's Gate II (scaled to 512 x 512, and as they are),
# Dragon Age 2 and Origins, mazes, random cells, rooms, StarCraft, streets and Warcraft III.
SETS = (
    'bg512', 'bgmaps', 'da2', 'dao', 'maze', 'random', 'room', 'sc1', 'street', 'wc3maps512',
)  # fmt: skip
PREFIX = 'movingai/'
SCENARIO_END = '.map.scen'
# Files and folders that are looked at below the user's folder.
MAX_ENTRIES = 20_000


def load_set(name: str, folder: Path) -> Iterator[tuple[str, GridProblem]]:
    """Yield the maps of a set by name, with ids from 0; their samples are their scenarios' rows.

    Raises GridProblemError or MovingAiError, which name the folder or the file.
    """
    files = files_of_set(name, folder)
    maps: dict[str, list[Path]] = {}
    for path in files:
        if path.suffix == '.map':
            maps.setdefault(path.name, []).append(path)
    scenarios = sorted(
        (path for path in files if path.name.endswith(SCENARIO_END)), key=lambda path: path.name
    )
    if not scenarios:
        raise GridProblemError(f'{folder}: has no scenarios of {name}, files x.map.scen')
    names = [path.name for path in scenarios]
    for first, second in pairwise(names):
        if first == second:
            raise GridProblemError(f'{folder}: has several files {first}; remove all but one')
    cells = 0
    for map_id, path in enumerate(scenarios):
        map_path = find_map_file(path, maps.get(path.name.removesuffix('.scen'), []), folder)
        problem = load_scenario_problem(path, map_path, map_id, f'{PREFIX}{name}')
        cells += problem.grid_map.cells.size
        if cells > MAX_CELLS:
            raise GridProblemError(f'{folder}: the maps of {name} have over {MAX_CELLS} cells')
        yield path.name.removesuffix(SCENARIO_END), problem


def files_of_set(name: str, folder: Path) -> list[Path]:
    """Return the files of a set: those in folders of its name, else all, if none is of another.

    Raises GridProblemError.
    """
    if not folder.is_dir():
        raise GridProblemError(f'--path {folder}: is not a folder')
    files = list(walk(folder))
    sets = {path: set_of(path.relative_to(folder.parent)) for path in files}
    own = [path for path in files if sets[path] == name]
    others = {found for found in sets.values() if found is not None}
    if not own and others:
        found = ', '.join(sorted(others))
        raise GridProblemError(f'{folder}: has no folder of {name}, but of {found}')
    return own or files


def set_of(path: Path) -> str | None:
    """Return the set that a folder of the path is named by, such as `dao` of `dao-map/x.map`."""
    for part in reversed(path.parts[:-1]):
        if part.partition('-')[0].lower() in SETS:
            return part.partition('-')[0].lower()
    return None


def walk(folder: Path) -> Iterator[Path]:
    """Yield the maps and scenarios below a folder. Raises GridProblemError if it is too large."""
    entries, seen = 0, set[str]()
    for place, folders, names in os.walk(folder, followlinks=True):
        real = os.path.realpath(place)
        if real in seen:  # by a link, perhaps one that leads back
            folders.clear()
            continue
        seen.add(real)
        entries += len(folders) + len(names)
        if entries > MAX_ENTRIES:
            raise GridProblemError(
                f'{folder}: has over {MAX_ENTRIES} files; name a smaller folder'
            )
        for name in names:
            if name.endswith(('.map', SCENARIO_END)):
                yield Path(place, name)


def find_map_file(scenarios: Path, maps: list[Path], folder: Path) -> Path:
    """Return the map of a scenario file: the one beside it, else the only one of its name.

    Raises GridProblemError.
    """
    beside = scenarios.with_name(scenarios.name.removesuffix('.scen'))
    if beside in maps:
        return beside
    if len(maps) != 1:
        found = 'several of them are' if maps else 'it is not'
        raise GridProblemError(f'{scenarios}: map: {found} in {folder}: {beside.name}')
    return maps[0]

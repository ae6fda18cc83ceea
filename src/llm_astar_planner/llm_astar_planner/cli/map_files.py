"""The map and the places that a command works on, by its options."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, BarrierMapError, find_barrier_map
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.movingai import load_map
from llm_astar_msgs_adapter.maps.places import (
    NO_PLACES,
    Place,
    Places,
    load_places,
    places_beside,
    places_problems,
)
from llm_astar_msgs_adapter.maps.problem_maps import BARE_MAP, ProblemMap, load_maps

from llm_astar_planner.planning.parameters import PLANNER
from llm_astar_planner.resources import find_file

# What --map takes.
MAP_KINDS = (
    "a robot's map as a map_server yaml, a MovingAI x.map or x.map.scen, or barrier-map JSON; a "
    'path or a name in maps/'
)
# Decimals of metres in listings.
DECIMALS = 3
PLACES_FILE = next(item for item in PLANNER if item.name == 'places_file')


def add_map_options(group: Any, *, default: str | None = None) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--map` and `--map-id`."""
    shown = ' (default: %(default)s)' if default else ''
    group.add_argument(
        '--map',
        default=default,
        metavar='FILE',
        help=f'{MAP_KINDS}{shown}',
    )
    group.add_argument(
        '--map-id',
        type=int,
        metavar='ID',
        help='which of the barrier maps in the file (default: the first)',
    )


def add_places_option(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--places`, the flag of the parameter `places_file`."""
    group.add_argument(
        '--places',
        '--places-file',
        dest=PLACES_FILE.name,
        metavar='FILE',
        help='GeoJSON with the named places of the map (default: NAME.places.geojson or '
        'places.geojson beside the map)',
    )


def open_maps(arguments: argparse.Namespace) -> tuple[list[ProblemMap], ProblemMap]:
    """Return all maps of `--map` and the one of `--map-id`; raises what reading them raises."""
    maps = maps_of(find_file(arguments.map, 'maps'))
    if arguments.map_id in (None, maps[0].id):
        return maps, maps[0]
    return maps, find_barrier_map(maps, arguments.map_id)


def maps_of(path: Path) -> list[ProblemMap]:
    """Return the maps of a file. Raises what reading them raises, which says what a map is."""
    if path.suffix.lower() in BARE_MAP:
        return [GridProblem(0, load_map(path))]
    try:
        return load_maps(path)
    except BarrierMapError as error:
        known = '' if path.suffix.lower() == '.json' else f'; --map takes {MAP_KINDS}'
        raise BarrierMapError(f'{error}{known}') from None


def barrier_maps_of(maps: list[ProblemMap]) -> list[BarrierMap]:
    """Return the maps that are given by barriers."""
    return [item for item in maps if isinstance(item, BarrierMap)]


def open_places(name: str, map_name: str | None) -> Places:
    """Return the places of a file, or of the one beside the map if `name` is empty.

    Raises PlacesError for a malformed file, FileNotFoundError for one that does not exist.
    """
    if name:
        return load_places(find_file(name, 'maps'))
    beside = places_beside(find_file(map_name, 'maps')) if map_name else None
    return NO_PLACES if beside is None else load_places(beside)


def warn_of_places(places: Places, grid_map: GridMap) -> None:
    """Print what is doubtful about places on a map, a line each."""
    for problem in places_problems(places, grid_map):
        sys.stderr.write(f'llm-astar: warning: places: {problem}\n')


def place_to_json(place: Place) -> dict[str, Any]:
    """Return a place for a listing; `area` is null for a point."""
    middle, area = place.geometry.representative_point(), place.geometry.area
    return {
        'name': place.name,
        'kind': place.kind,
        'tags': list(place.tags),
        'aliases': list(place.aliases),
        'centre': [round(middle.x, DECIMALS), round(middle.y, DECIMALS)],
        'area': round(area, DECIMALS) if area else None,
    }

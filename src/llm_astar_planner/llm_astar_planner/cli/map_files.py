# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The map, the places and the unit of points that a command works with, by its options."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps import places as place_files
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMapError, Point, find_barrier_map
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import FAR, GridMap
from llm_astar_msgs_adapter.maps.movingai import load_map
from llm_astar_msgs_adapter.maps.problem_maps import BARE_MAP, YAML, ProblemMap, load_maps

from llm_astar_planner.cli.flags import option
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.parameters import PLANNER
from llm_astar_planner.resources import find_file
from llm_astar_planner.search.result import Cell

# What --map takes.
MAP_KINDS = (
    "a robot's map as a map_server yaml, a MovingAI x.map or x.map.scen, or barrier-map JSON; a "
    'path or a name in maps/, as depot, office, house and hospital'
)
# Decimals of metres in listings.
DECIMALS = 3
PLACES_FILE = next(item for item in PLANNER if item.name == 'places_file')
PLACES_TEXT = """GeoJSON with the named places of the map (default: NAME.places.geojson or
places.geojson beside the map)"""


@dataclass(frozen=True)
class Coordinates:
    """How points of one map are read and written.

    `offset` is what the map's file calls cell (0, 0). With `metres`, points are metres of the
    map's frame, else cells as the file counts them.
    """

    grid_map: GridMap
    offset: Point
    metres: bool

    def to_cell(self, option: str, point: Sequence[float]) -> Cell:
        """Return the cell (x, y) of a point that an option names, on the map or off it.

        Raises ParameterError for a cell that is not two whole numbers, and for a point that is
        not finite or farther than any map.
        """
        x, y = point
        if not max(abs(x), abs(y)) <= FAR:
            raise ParameterError(f'{option} {x:g} {y:g}: numbers up to {FAR:g} are expected')
        if self.metres:
            return self.grid_map.world_to_cell(x, y)
        if not (float(x).is_integer() and float(y).is_integer()):
            raise ParameterError(
                f'{option} {x:g} {y:g}: coordinates are cells on this map, so whole numbers; '
                'add --metres to give metres'
            )
        return int(x) - self.offset[0], int(y) - self.offset[1]

    def could_be_cell(self, point: Sequence[float]) -> bool:
        """Tell whether a point's numbers would also be a cell of the map."""
        x, y = point
        return x.is_integer() and y.is_integer() and self.grid_map.contains((int(x), int(y)))

    def describe(self, x: float, y: float) -> str:
        """Return a point given in grid coordinates as text: metres and cell, or cell alone."""
        cell = f'cell ({x + self.offset[0]:g}, {y + self.offset[1]:g})'
        if not self.metres:
            return cell
        ((east, north),) = self.grid_map.grid_to_world([(x, y)]).tolist()
        return f'({round(east, 3):g}, {round(north, 3):g}) m, {cell}'

    def describe_length(self, cells: float) -> str:
        """Return a length given in cells as text, in metres first if points are in metres."""
        text = f'{cells:.2f} cells'
        return f'{self.grid_map.resolution * cells:.2f} m, {text}' if self.metres else text

    def describe_distance(self, metres: float) -> str:
        """Return a distance given in metres as text, in the unit of the points."""
        if self.metres:
            return f'{metres:.2f} m'
        return f'{metres / self.grid_map.resolution:.2f} cells'


def add_map_options(group: Any, *, default: str | None = None) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--map` and `--map-id`."""
    shown = ' (default: %(default)s)' if default else ''
    option(group, '--map FILE', f'{MAP_KINDS}{shown}', default=default)
    text = 'which of the barrier maps in the file (default: the first)'
    option(group, '--map-id ID', text, type=int)


def add_places_option(group: Any, text: str = PLACES_TEXT) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--places`, the flag of the parameter `places_file`."""
    option(group, '--places --places-file FILE', text, dest=PLACES_FILE.name)


def add_unit_options(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--cells` and `--metres`, of which one may be given."""
    either = group.add_mutually_exclusive_group()
    text = "points are metres of the map's frame: the default on a map_server yaml"
    option(either, '--metres', text)
    text = 'points are cells, as the map counts them: the default on all other maps'
    option(either, '--cells', text)


def coordinates_of(
    arguments: argparse.Namespace, problem: ProblemMap, grid_map: GridMap
) -> Coordinates:
    """Return the unit of a map's points: by the options, else by the kind of the map's file."""
    is_robot_map = find_file(arguments.map, 'maps').suffix.lower() in YAML
    in_metres = arguments.metres or (is_robot_map and not arguments.cells)
    return Coordinates(grid_map, problem.offset, in_metres)


def open_maps(
    arguments: argparse.Namespace, pairs: int | None = None
) -> tuple[list[ProblemMap], ProblemMap]:
    """Return all maps of `--map` and the one of `--map-id`; raises what reading them raises.

    On a robot's map so many start-goal pairs are drawn, as many as usual for None.
    """
    maps = maps_of(find_file(arguments.map, 'maps'), pairs)
    if arguments.map_id in (None, maps[0].id):
        return maps, maps[0]
    return maps, find_barrier_map(maps, arguments.map_id)


def maps_of(path: Path, pairs: int | None = None) -> list[ProblemMap]:
    """Return the maps of a file, with pairs as `open_maps`.

    Raises what reading them raises, which says what a map is.
    """
    if path.suffix.lower() in BARE_MAP:
        return [GridProblem(0, load_map(path))]
    try:
        return load_maps(path, pairs)
    except BarrierMapError as error:
        known = '' if path.suffix.lower() == '.json' else f'; --map takes {MAP_KINDS}'
        raise BarrierMapError(f'{error}{known}') from None


def open_places(name: str, map_name: str | None, *, by_words: bool = True) -> place_files.Places:
    """Return the places of a file, or of the one beside the map if `name` is empty.

    Raises PlacesError for a malformed file and, if they are named `by_words` of an instruction or
    question, for a name that these mean otherwise; FileNotFoundError for a file that does not
    exist.
    """
    path = find_file(name, 'maps') if name else None
    if path is None and map_name:
        path = place_files.places_beside(find_file(map_name, 'maps'))
    if path is None:
        return place_files.NO_PLACES
    places = place_files.load_places(path)
    if by_words:
        # Its tables take a fifth of a second to read.
        from llm_astar_planner.instructions.grammar.vocabulary import check_names  # noqa: PLC0415

        check_names(places, str(path))
    return places


def zones_text(name: str | None) -> str:
    """Return the text of a file of zones, '' for none. Raises ZonesError, FileNotFoundError."""
    if not name:
        return ''
    # shapely, which plans without zones do not take.
    from llm_astar_planner.costmap.zones import ZonesError, zones_from_text  # noqa: PLC0415

    text = find_file(name, 'maps').read_text(encoding='utf-8')
    try:
        zones_from_text(text)
    except ZonesError as error:
        raise ZonesError(f'{name}: {error}') from None
    return text


def warn_of_places(places: place_files.Places, grid_map: GridMap) -> None:
    """Print what is doubtful about places on a map, a line each."""
    for problem in place_files.places_problems(places, grid_map):
        sys.stderr.write(f'llm-astar: warning: places: {problem}\n')


def place_to_json(place: place_files.Place) -> dict[str, Any]:
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

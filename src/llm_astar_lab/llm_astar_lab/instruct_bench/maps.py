# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The maps of a suite: found, loaded, and their places read; and what its checks refer to."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError, raising, short_repr
from llm_astar_msgs_adapter.maps import places as place_files
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, find_barrier_map, load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.map_server import load_map
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.fields import as_mapping, as_text
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.verification.regions import Regions
from llm_astar_planner.instructions.verification.walls import Walls
from llm_astar_planner.resources import SAMPLES_FILE, find_file
from llm_astar_planner.search.result import Cell
from numpy.typing import NDArray

# The dataset in which map pN is map N.
NUMBERED = re.compile(r'p([0-9]{1,6})')
MAX_PLACES = 1000


class SuiteError(LlmAstarError, ValueError):
    """A suite that cannot be used; the message names the file, the instruction and the field."""


@dataclass(frozen=True, eq=False)
class SuiteMap:
    """A map of a suite with its places; `barrier_map` where its grid was made from one."""

    name: str
    grid_map: GridMap
    places: Places
    barrier_map: BarrierMap | None = None

    def place_name(self, name: object, where: str) -> str:
        """Return the name of a place by name or alias. Raises SuiteError, which lists them."""
        place = self.places.get(as_text(name, where))
        if place is not None:
            return place.name
        known = ', '.join(place.name for place in self.places) or 'none'
        raise SuiteError(f'{where}: {name!r} is not a place of the map, which has: {known}')

    def tagged_names(self, tag: object, where: str) -> list[str]:
        """Return the names of the places with a tag. Raises SuiteError where there are none."""
        if tagged := self.places.with_tag(as_text(tag, where)):
            return [place.name for place in tagged]
        what = 'is not a kind or tag of the places, which have'
        raise SuiteError(f'{where}: {tag!r} {what}: {", ".join(self.places.tags) or "none"}')

    @cached_property
    def walls(self) -> NDArray[Any]:
        """The occupied cells as polygons [n], neighbours in a row joined."""
        blocked = np.pad(self.grid_map.blocked(), ((0, 0), (1, 1)))
        steps = np.diff(blocked.astype(np.int8), axis=1)
        rows, first = np.nonzero(steps == 1)
        _, end = np.nonzero(steps == -1)
        corners = [(first, rows), (end, rows), (end, rows + 1), (first, rows + 1)]
        cells = np.stack([np.stack(corner, axis=1) for corner in corners], axis=1) - 0.5
        return np.asarray(shapely.polygons(self.grid_map.grid_to_world(cells).reshape(-1, 4, 2)))

    @cached_property
    def wall_tree(self) -> shapely.STRtree:
        """The walls, indexed for nearest neighbours."""
        return shapely.STRtree(self.walls)

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """The least box x0, y0, x1, y1 around the whole grid, in the map's frame."""
        x0, y0, x1, y1 = Scene(self, (0, 0), (0, 0)).regions.map_outline.bounds
        return x0, y0, x1, y1


@dataclass(frozen=True, eq=False)
class Scene:
    """What the checks of one instruction refer to: a map, and the cells of start and goal."""

    suite_map: SuiteMap
    start: Cell
    goal: Cell

    @cached_property
    def regions(self) -> Regions:
        """Where the verification has regions."""
        # A robot without a body.
        costmap = Costmap(self.suite_map.grid_map)
        route = Route(costmap, self.start, self.goal, self.suite_map.places)
        return Regions(route, Walls(costmap))


@dataclass(frozen=True, eq=False)
class MapFinder:
    """Loads the maps of a suite at `suite`; `folders` are searched for NAME.yaml, too."""

    suite: Path
    folders: Sequence[Path] = ()
    datasets: dict[Path, list[BarrierMap]] = field(default_factory=dict)

    def load(self, name: str, value: object) -> SuiteMap:
        """Return a map from its entry in the suite.

        Raises SuiteError, which names the suite, the map and the field.
        """
        where = f'{self.suite}: map {short_repr(name)}: '
        with raising(SuiteError, where, LlmAstarError, OSError):
            as_text(name, 'its name')
            fields = as_mapping(value, 'entry')
            file = self.map_file(name, fields)
            places = self.read_places(fields, file)
            if file is not None:
                return SuiteMap(name, load_map(file), places)
            barrier_map = self.barrier_map(name, fields)
            return SuiteMap(name, barrier_map.to_grid(), places, barrier_map)

    def map_file(self, name: str, fields: Mapping[str, Any]) -> Path | None:
        """Return the map_server yaml of a map, None where it has none."""
        if 'file' in fields:
            return self.suite.parent / as_text(fields['file'], 'file')
        if 'dataset' in fields:
            return None
        tried = [folder / f'{name}.yaml' for folder in (self.suite.parent, *self.folders)]
        return next((path for path in tried if path.is_file()), None)

    def barrier_map(self, name: str, fields: Mapping[str, Any]) -> BarrierMap:
        """Return the barrier map that the fields or the name give. Raises LlmAstarError."""
        numbered = NUMBERED.fullmatch(name)
        if 'dataset' in fields:
            dataset, number = as_text(fields['dataset'], 'dataset'), fields.get('id')
            if type(number) is not int:
                raise SuiteError(f'id: {short_repr(number)} is not the id of a map of {dataset}')
        elif numbered:
            dataset, number = SAMPLES_FILE, int(numbered[1])
        else:
            searched = ', '.join(str(folder) for folder in (self.suite.parent, *self.folders))
            fix = 'name the file, or its folder with --map-folder'
            raise SuiteError(f'file: is missing, and {name}.yaml is not in {searched}; {fix}')
        beside = self.suite.parent / dataset
        path = beside if beside.is_file() else find_file(dataset, 'maps')
        if path not in self.datasets:
            self.datasets[path] = load_barrier_maps(path)
        return find_barrier_map(self.datasets[path], number)

    def read_places(self, fields: Mapping[str, Any], map_file: Path | None) -> Places:
        """Return the places of a map: of its entry, its places file, or the file beside it.

        Raises LlmAstarError.
        """
        file = None
        if 'places_file' in fields:
            file = self.suite.parent / as_text(fields['places_file'], 'places_file')
        elif map_file is not None and 'places' not in fields:
            file = place_files.places_beside(map_file)
        if file is not None:
            return place_files.load_places(file)
        entries = as_mapping(fields.get('places', {}), 'places')
        if len(entries) > MAX_PLACES:
            raise SuiteError(f'places: {len(entries)} are over the {MAX_PLACES} allowed')
        return Places(read_place(name, value) for name, value in entries.items())


def read_place(name: str, value: object) -> Place:
    """Read a place of a suite's map. Raises PlacesError or SpecificationError."""
    where = f'places: {short_repr(name)}'
    fields = as_mapping(value, where)
    geometry: dict[str, Any] = {'type': 'Polygon', 'coordinates': [fields.get('polygon')]}
    if 'point' in fields:
        geometry = {'type': 'Point', 'coordinates': fields['point']}
    feature = {'type': 'Feature', 'geometry': geometry, 'properties': {**fields, 'name': name}}
    place = place_files.parse_feature(feature, where)
    if place is None:
        raise SuiteError(f'{where}: is no place')
    return place


def as_list(value: object, where: str, least: int, most: int, what: str) -> list[Any]:
    """Return a JSON list of so many entries. Raises SuiteError, which says `what` is listed."""
    if isinstance(value, list) and least <= len(value) <= most:
        return value
    size = f'{least} to {most}' if least else f'up to {most}'
    raise SuiteError(f'{where}: is not a list of {size} {what}'.rstrip())

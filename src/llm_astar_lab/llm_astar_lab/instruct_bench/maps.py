"""The maps of a suite: found, loaded, and their places read."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, find_barrier_map, load_barrier_maps
from llm_astar_msgs_adapter.maps.map_server import load_map
from llm_astar_msgs_adapter.maps.places import (
    Place,
    Places,
    load_places,
    parse_feature,
    places_beside,
)
from llm_astar_planner.instructions.specification_json import as_mapping, as_text
from llm_astar_planner.resources import SAMPLES_FILE, find_file

from llm_astar_lab.instruct_bench.regions import SuiteError, SuiteMap

# The dataset in which map pN is map N.
NUMBERED = re.compile(r'p([0-9]{1,6})')
MAX_PLACES = 1000
MAX_NAMES = 100


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
        where = f'{self.suite}: map {short_repr(name)}'
        try:
            as_text(name, 'its name')
            fields = as_mapping(value, 'entry')
            file = self.map_file(name, fields)
            places = self.read_places(fields, file)
            if file is not None:
                return SuiteMap(name, load_map(file), places)
            barrier_map = self.barrier_map(name, fields)
            return SuiteMap(name, barrier_map.to_grid(), places, barrier_map)
        except (LlmAstarError, OSError) as error:
            raise SuiteError(f'{where}: {error}') from None

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
            raise SuiteError(
                f'file: is missing, and {name}.yaml is not in {searched}; name the file, or its '
                'folder with --map-folder'
            )
        beside = self.suite.parent / dataset
        path = beside if beside.is_file() else find_file(dataset, 'maps')
        if path not in self.datasets:
            self.datasets[path] = load_barrier_maps(path)
        return find_barrier_map(self.datasets[path], number)

    def read_places(self, fields: Mapping[str, Any], map_file: Path | None) -> Places:
        """Return the places of a map: of its entry, its places file, or the file beside it.

        Raises LlmAstarError.
        """
        if 'places_file' in fields:
            return load_places(self.suite.parent / as_text(fields['places_file'], 'places_file'))
        beside = None if map_file is None or 'places' in fields else places_beside(map_file)
        if beside is not None:
            return load_places(beside)
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
    properties = {**fields, 'name': name}
    feature = {'type': 'Feature', 'geometry': geometry, 'properties': properties}
    place = parse_feature(feature, where)
    if place is None:
        raise SuiteError(f'{where}: is no place')
    return place


def read_texts(fields: Mapping[str, Any], name: str, where: str) -> tuple[str, ...]:
    """Read an optional list of short texts. Raises SuiteError or SpecificationError."""
    value = fields.get(name, [])
    if not isinstance(value, list) or len(value) > MAX_NAMES:
        raise SuiteError(f'{where}: {name}: is not a list of up to {MAX_NAMES} texts')
    return tuple(as_text(item, f'{where}: {name}') for item in value)

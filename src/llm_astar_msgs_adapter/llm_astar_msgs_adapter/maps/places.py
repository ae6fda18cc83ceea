# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Places on a map: named areas and objects, read from GeoJSON in the map's frame.

A file is drawn in QGIS, written by hand, or has the nodes of a nav2_route graph. Coordinates are
metres in the map's frame; a third coordinate is ignored. The properties `name`, `aliases`, `kind`
and `tags` may also be in `metadata`, as nav2_route writes them, and lists may be texts with
commas, as QGIS writes them. Of a nav2_route graph the nodes with a name become places; other nodes
and all edges are skipped.
"""

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import mapping, shape
from shapely.geometry.base import BaseGeometry

from llm_astar_msgs_adapter.errors import LlmAstarError, expect, raising, short_repr
from llm_astar_msgs_adapter.files import read_json
from llm_astar_msgs_adapter.maps.grid_map import FAR, GridMap

# The kind of a place that nobody can stand in: a rack, a machine, a wall.
OBJECT = 'object'
DEFAULT_KIND = 'area'
MAX_BYTES = 4_000_000
MAX_PLACES = 1000
MAX_FEATURES = 100_000
MAX_VERTICES = 10_000
MAX_NAMES = 50
MAX_NAME_CHARS = 80
GEOMETRIES = ('Polygon', 'MultiPolygon', 'Point')
LINES = ('LineString', 'MultiLineString')
# Nested lists below `coordinates`: of a MultiPolygon polygons, rings, points, numbers.
DEPTHS = {'Point': 1, 'LineString': 2, 'MultiLineString': 3, 'Polygon': 3, 'MultiPolygon': 4}
# Parts of an area below this count as drawn inexactly. Rooms usually share the wall between them.
TOLERATED = 0.05
MAX_PROBLEMS = 20
BLOCK = 10_000
# Coordinate systems in degrees. QGIS converts to these unless another one is chosen.
DEGREES = ('CRS84', 'EPSG::4326', 'EPSG:4326')


class PlacesError(LlmAstarError, ValueError):
    """A malformed places file; the message names the feature and the field."""


@dataclass(frozen=True)
class Place:
    """A named part of the map: `geometry` is a shapely polygon or point, metres, map frame.

    `kind` says what it is ('room', 'door', 'object', ...), `tags` what else is true of it
    ('blue'). A place of kind or tag `object` is visited by coming near it.
    """

    name: str
    geometry: BaseGeometry
    kind: str = DEFAULT_KIND
    aliases: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()

    @property
    def is_object(self) -> bool:
        """Whether it is visited by coming near it instead of entering it."""
        return OBJECT in (self.kind, *self.tags)


class Places:
    """The places of a map, by name. Immutable; names and aliases are compared without case."""

    def __init__(self, places: Iterable[Place] = (), frame_id: str = 'map') -> None:
        """Take places. Raises PlacesError where two have one name or alias."""
        self.places = tuple(places)
        self.frame_id = frame_id
        self._by_name: dict[str, Place] = {}
        for place in self.places:
            for name in (place.name, *place.aliases):
                other = self._by_name.setdefault(name.casefold(), place)
                if other is not place:
                    raise PlacesError(f'{name!r} names both {other.name!r} and {place.name!r}')

    def __iter__(self) -> Iterator[Place]:
        """Iterate over the places in the file's order."""
        return iter(self.places)

    def __len__(self) -> int:
        """Count the places."""
        return len(self.places)

    def get(self, name: str) -> Place | None:
        """Return the place with a name or alias, or None."""
        return self._by_name.get(name.casefold())

    def with_tag(self, tag: str) -> tuple[Place, ...]:
        """Return the places of a kind or with a tag."""
        wanted = tag.casefold()

        def has(place: Place) -> bool:
            return wanted in {name.casefold() for name in (place.kind, *place.tags)}

        return tuple(filter(has, self.places))

    @property
    def tags(self) -> tuple[str, ...]:
        """All kinds and tags, each once, in order of appearance."""
        return tuple(dict.fromkeys(t for place in self.places for t in (place.kind, *place.tags)))

    @cached_property
    def digest(self) -> str:
        """Twelve hex digits that identify the places: names, aliases, kinds, tags, geometry."""
        text = json.dumps(self.to_geojson(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def to_geojson(self) -> dict[str, object]:
        """Return the FeatureCollection."""
        features = [
            {
                'type': 'Feature',
                'geometry': mapping(place.geometry),
                'properties': {
                    'name': place.name, 'aliases': list(place.aliases),
                    'kind': place.kind, 'tags': list(place.tags),
                },
            }
            for place in self.places
        ]  # fmt: skip
        return {'type': 'FeatureCollection', 'features': features}


NO_PLACES = Places()


def places_from_polygons(entries: Mapping[str, Mapping[str, Any]]) -> Places:
    """Return places from `{name: {polygon, aliases, kind, tags}}`, the form of suites."""
    return Places(
        Place(
            name, shapely.Polygon(entry['polygon']), str(entry.get('kind', DEFAULT_KIND)),
            tuple(entry.get('aliases', ())), tuple(entry.get('tags', ())),
        )
        for name, entry in entries.items()
    )  # fmt: skip


def load_places(path: str | Path) -> Places:
    """Read the places of a GeoJSON file.

    Raises PlacesError, which names the file, the feature and the field.
    """
    return places_from_geojson(read_json(path, PlacesError, MAX_BYTES), str(path))


def places_from_geojson(collection: object, source: str) -> Places:
    """Read the places of a FeatureCollection; `source` is what errors call it.

    Raises PlacesError, which names the source, the feature and the field.
    """
    places: list[Place] = []
    frames, owners = dict[str, str](), dict[str, str]()
    for index, feature in enumerate(features_of(collection, source)):
        where = feature_label(source, index, feature)
        place = parse_feature(feature, where)
        if place is None:
            continue
        claim_names(place, where, owners)
        # The node of a graph may name another one than `map`.
        frame = feature['properties'].get('frame')
        frame = 'map' if frame in (None, '') else parse_name(frame, f'{where}: frame')
        frames.setdefault(frame, where)
        places.append(place)
        if len(places) > MAX_PLACES:
            raise PlacesError(f'{source}: features: over {MAX_PLACES} places; split the file')
    if len(frames) > 1:
        several = f'the places are in several frames, {", ".join(frames)}; keep those of one'
        raise PlacesError(f'{source}: frame: {several}')
    return Places(places, next(iter(frames), 'map'))


def places_beside(map_file: str | Path) -> Path | None:
    """Return the file with the places of a map, in its folder, or None.

    For `depot.yaml` that is `depot.places.geojson`, or else `places.geojson`.
    """
    map_file = Path(map_file)
    names = (f'{map_file.stem}.places.geojson', 'places.geojson')
    found = (map_file.parent / name for name in names)
    return next((path for path in found if path.is_file()), None)


def features_of(collection: object, source: str) -> list[Any]:
    """Return the features of a FeatureCollection. Raises PlacesError."""
    if not isinstance(collection, dict) or collection.get('type') != 'FeatureCollection':
        raise PlacesError(f'{source}: type: a GeoJSON FeatureCollection is expected')
    found = collection.get('features')
    features = expect(found, list, f'{source}: features', 'a list', PlacesError)
    if len(features) > MAX_FEATURES:
        raise PlacesError(f'{source}: features: {len(features)} are over {MAX_FEATURES}')
    crs = json.dumps(collection.get('crs'))
    if any(name in crs for name in DEGREES):
        raise PlacesError(
            f'{source}: crs: the coordinates are degrees, not metres of the map; '
            'save the layer without a coordinate system, or with EPSG:3857'
        )
    return features


def feature_label(source: str, index: int, feature: object) -> str:
    """Return how messages call a feature: file, number, and name where it has one."""
    properties = feature.get('properties') if isinstance(feature, dict) else None
    name = find_property(properties, 'name') if isinstance(properties, dict) else None
    return f'{source}: feature {index}' + (f' ({short_repr(name)})' if name else '')


def parse_feature(feature: object, where: str) -> Place | None:
    """Return the place of a feature, None for an edge or a node without a name.

    Raises PlacesError, which begins with `where`.
    """
    if not isinstance(feature, dict) or feature.get('type') != 'Feature':
        raise PlacesError(f'{where}: type: a Feature is expected, not {short_repr(feature)}')
    properties, geometry = feature.get('properties'), feature.get('geometry')
    if not isinstance(properties, dict):
        raise PlacesError(f'{where}: properties: an object with a name is expected')
    if not isinstance(geometry, dict):
        raise PlacesError(f'{where}: geometry: is missing; draw a polygon or a point')
    kind = geometry.get('type')
    if kind in LINES and 'startid' in properties and 'endid' in properties:
        return None
    name = find_property(properties, 'name')
    place_kind = find_property(properties, 'kind')
    if name is None and kind == 'Point' and 'id' in properties:
        return None
    return Place(
        parse_name(name, f'{where}: name'),
        parse_geometry(geometry, where),
        parse_name(DEFAULT_KIND if place_kind in (None, '') else place_kind, f'{where}: kind'),
        parse_names(find_property(properties, 'aliases'), f'{where}: aliases'),
        parse_names(find_property(properties, 'tags'), f'{where}: tags'),
    )


def find_property(properties: Mapping[str, Any], name: str) -> Any:  # noqa: ANN401 - any JSON
    """Return a property, or that of nav2_route's metadata, or None."""
    if properties.get(name) is not None:
        return properties[name]
    metadata = properties.get('metadata')
    return metadata.get(name) if isinstance(metadata, dict) else None


def parse_name(value: object, where: str) -> str:
    """Return a name as one clean line. Raises PlacesError, which begins with `where`."""
    if value is None:
        raise PlacesError(f'{where}: is missing')
    name = ' '.join(expect(value, str, where, 'a text', PlacesError).split())
    if not name:
        raise PlacesError(f'{where}: is empty')
    if len(name) > MAX_NAME_CHARS:
        raise PlacesError(f'{where}: {len(name)} characters are over {MAX_NAME_CHARS}')
    if not name.isprintable():
        raise PlacesError(f'{where}: {short_repr(name)} has unprintable characters')
    return name


def parse_names(value: object, where: str) -> tuple[str, ...]:
    """Return names, each once: of a list, or of a text with commas. Raises PlacesError."""
    if value is None:
        return ()
    if isinstance(value, str):
        value = [part for part in value.strip('[]').split(',') if part.strip()]
    names = expect(value, list, where, 'a list of texts', PlacesError)
    if len(names) > MAX_NAMES:
        raise PlacesError(f'{where}: {len(names)} names are over {MAX_NAMES}')
    return tuple(dict.fromkeys(parse_name(item, where) for item in names))


def parse_geometry(
    geometry: Mapping[str, Any], where: str, kinds: Sequence[str] = GEOMETRIES
) -> BaseGeometry:
    """Return a geometry of some kinds. Raises PlacesError, which begins with `where`."""
    kind, coordinates = str(geometry.get('type')), geometry.get('coordinates')
    if kind not in kinds:
        raise PlacesError(f'{where}: geometry: {kind[:40]!r} is not one of {", ".join(kinds)}')
    count = check_coordinates(coordinates, DEPTHS[kind], f'{where}: coordinates')
    if count > MAX_VERTICES:
        raise PlacesError(f'{where}: coordinates: {count} points are over {MAX_VERTICES}')
    damage = ValueError, TypeError, IndexError, shapely.errors.ShapelyError
    with raising(PlacesError, f'{where}: coordinates: ', *damage):
        found: BaseGeometry = shapely.force_2d(shape({'type': kind, 'coordinates': coordinates}))
    if not found.is_valid:
        reason = shapely.is_valid_reason(found)
        raise PlacesError(f'{where}: coordinates: {reason}; the outline must not cross itself')
    if found.is_empty or (kind in GEOMETRIES[:2] and not found.area > 0.0):
        raise PlacesError(f'{where}: coordinates: the place has no area; draw it, or use a Point')
    return found


def check_coordinates(value: object, depth: int, where: str) -> int:
    """Return the number of points in coordinates nested `depth` deep. Raises PlacesError."""
    items = expect(value, list, where, 'a list', PlacesError)
    if depth > 1:
        return sum(check_coordinates(item, depth - 1, where) for item in items)
    if len(items) not in (2, 3):
        raise PlacesError(f'{where}: [x, y] is expected, not {short_repr(items)}')
    for number in items:
        is_number = isinstance(number, (int, float)) and not isinstance(number, bool)
        # In this order: a whole number of 400 digits has no float.
        if not is_number or abs(number) > FAR or not math.isfinite(number):
            raise PlacesError(f'{where}: metres are expected, not {short_repr(number)}')
    return 1


def claim_names(place: Place, where: str, owners: dict[str, str]) -> None:
    """Enter the names of a place under its label. Raises PlacesError for one that is taken."""
    for name in (place.name, *place.aliases):
        other = owners.setdefault(name.casefold(), where)
        if other is not where:
            owner = other.rpartition(': ')[2]
            raise PlacesError(
                f'{where}: {name.casefold()!r} is also a name of {owner}; rename one of them'
            )


def places_problems(places: Places, grid_map: GridMap) -> list[str]:
    """Return a sentence for each doubtful place, at most MAX_PROBLEMS and a last one.

    None of them is an error: the places can be used as they are.
    """
    problems, frames = [], (places.frame_id, grid_map.frame_id)
    if places and frames[0] != frames[1]:
        problems.append('the places are in frame {!r}, the map is in {!r}'.format(*frames))
    free = ~grid_map.blocked(allow_unknown=False)
    outline = map_outline(grid_map)
    for place in places:
        problem = position_problem(place, grid_map, outline, free)
        if problem is not None:
            problems.append(f'{place.name!r} {problem}')
    problems += overlaps(places)
    if len(problems) > MAX_PROBLEMS:
        problems[MAX_PROBLEMS:] = [f'and {len(problems) - MAX_PROBLEMS} more']
    return problems


def map_outline(grid_map: GridMap) -> BaseGeometry:
    """Return the rectangle of a map, in metres in its frame."""
    right, top = grid_map.width - 0.5, grid_map.height - 0.5
    corners = [[-0.5, -0.5], [right, -0.5], [right, top], [-0.5, top]]
    return shapely.Polygon(grid_map.grid_to_world(corners))


def position_problem(
    place: Place, grid_map: GridMap, outline: BaseGeometry, free: NDArray[np.bool_]
) -> str | None:
    """Say what is doubtful about where a place is, or None."""
    geometry = place.geometry
    if not outline.intersects(geometry):
        return 'lies off the map'
    if geometry.difference(outline).area > TOLERATED * geometry.area:
        return 'lies partly off the map'
    if not place.is_object and not has_free_cell(geometry, grid_map, free):
        return "lies wholly in walls or unknown space; its kind is perhaps 'object'"
    return None


def has_free_cell(geometry: BaseGeometry, grid_map: GridMap, free: NDArray[np.bool_]) -> bool:
    """Tell whether the centre of a free cell, or a place's own middle, lies in a free cell."""
    middle = geometry.representative_point()
    cell = grid_map.world_to_cell(middle.x, middle.y)
    if grid_map.contains(cell) and free[cell[1], cell[0]]:
        return True
    corners = np.rint(grid_map.world_to_grid(shapely.get_coordinates(geometry))).astype(int)
    (x, y), (right, top) = np.maximum(corners.min(axis=0), 0), corners.max(axis=0) + 1
    rows, columns = np.nonzero(free[y:top, x:right])
    shapely.prepare(geometry)
    # In blocks: most places have a free cell among the first.
    for block in range(0, len(rows), BLOCK):
        part = slice(block, block + BLOCK)
        centres = grid_map.grid_to_world(np.stack((columns[part] + x, rows[part] + y), axis=-1))
        if shapely.intersects_xy(geometry, *centres.T).any():
            return True
    return False


def overlaps(places: Places) -> Iterator[str]:
    """Yield a sentence for each two areas of which one covers more than an edge of the other.

    Objects are left out: a table stands in a kitchen, and walls cross each other.
    """
    areas = [place for place in places if not place.is_object]
    if not areas:
        return
    found = [place.geometry for place in areas]
    pairs = shapely.STRtree(found).query(found, predicate='intersects').T
    for first, second in sorted((int(a), int(b)) for a, b in pairs if a < b):
        shared = found[first].intersection(found[second]).area
        if shared > TOLERATED * min(found[first].area, found[second].area):
            yield f'{areas[first].name!r} and {areas[second].name!r} overlap by {shared:.1f} m²'

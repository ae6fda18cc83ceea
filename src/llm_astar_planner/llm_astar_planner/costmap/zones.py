# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Zones: areas that are closed to the robot, cost more or have rules, set while it runs.

Rules of the road: against a `one_way` no move is made, in a `keep_right` lane the right half is
driven along its line and the left half against it, and off the `preferred` lines cells cost more.

As GeoJSON they are a FeatureCollection of polygons and lines in metres of the map's frame. A
feature's properties are `cost` (1 to 100, 100 by default), `name`, `seconds` (until it expires),
`kind` with `heading` and `width`, and `id`, which may also be the feature's own member. A
collection may have a `frame_id`. The edges of a nav2_route graph are one zone of preferred lines.
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError, expect, raising, short_repr
from llm_astar_msgs_adapter.files import parse_json
from llm_astar_msgs_adapter.maps.grid_map import FAR
from llm_astar_msgs_adapter.maps.places import (
    LINES,
    MAX_BYTES,
    PlacesError,
    feature_label,
    features_of,
    parse_geometry,
    parse_name,
)
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

KEEPOUT = 100
MAX_ZONES = 1000
# Points of the outlines of one zone, and of all.
MAX_VERTICES = 10_000
MAX_TOTAL_VERTICES = 50_000
MAX_ID_CHARS = 80
MAX_WIDTH = 1000.0
AREA, ONE_WAY, KEEP_RIGHT, PREFERRED = 'area', 'one_way', 'keep_right', 'preferred'
# The kinds, with the cost that each has unless another is given; 0: none.
COSTS = {AREA: KEEPOUT, ONE_WAY: 0, KEEP_RIGHT: 0, PREFERRED: 50}
RULES = (ONE_WAY, KEEP_RIGHT)
POLYGONS = ('Polygon', 'MultiPolygon')
Point2D = tuple[float, float]


class ZonesError(LlmAstarError, ValueError):
    """A malformed zone, or too many; the message names the zone and the field."""


@dataclass(frozen=True, eq=False)
class Zone:
    """An area in metres of the map's frame: polygons, holes included, or lines with a `width`.

    A `cost` of KEEPOUT (100) closes the cells that the area touches, of a PREFERRED one all
    others; from 1 to 99 they cost as much as cells of this occupancy, and stay open. The zone
    ends at `expires`, in seconds of the clock that `Zones.expired` is asked with; None: never.
    `heading` is the way of ONE_WAY polygons, in degrees from the frame's +x towards its +y; lines
    have their own. Raises ZonesError.
    """

    id: str
    geometry: BaseGeometry
    cost: int = KEEPOUT
    name: str = ''
    expires: float | None = None
    kind: str = AREA
    heading: float = math.nan
    width: float = 0.0

    def __post_init__(self) -> None:
        """Check the fields."""
        if not 0 < len(self.id) <= MAX_ID_CHARS or not self.id.isprintable():
            raise ZonesError(f'id: {short_repr(self.id)} is not 1 to {MAX_ID_CHARS} characters')
        least, problem = min(COSTS.get(self.kind, 1), 1), geometry_problem(self.geometry)
        if problem is not None:
            problem = f'geometry: {problem}'
        elif not (isinstance(self.cost, int) and least <= self.cost <= KEEPOUT):
            problem = f'cost: {self.cost!r} is not a whole number from {least} to {KEEPOUT}'
        elif self.kind not in COSTS:
            problem = f'kind: {short_repr(self.kind)} is not one of {", ".join(COSTS)}'
        elif self.is_line and not 0.0 < self.width <= MAX_WIDTH:
            problem = f'width: {self.width:g} m is not above 0 and up to {MAX_WIDTH:g}'
        elif self.kind == KEEP_RIGHT and not self.is_line:
            problem = f'geometry: {KEEP_RIGHT} is a line with a width, not a polygon'
        elif self.kind == ONE_WAY and not (self.is_line or math.isfinite(self.heading)):
            problem = 'heading: degrees from +x towards +y are expected for a one_way polygon'
        elif self.expires is not None and not math.isfinite(self.expires):
            problem = f'expires: {self.expires} is not finite'
        if problem is not None:
            raise ZonesError(f'zone {self.label}: {problem}')

    @property
    def is_line(self) -> bool:
        """Whether the zone is drawn as lines."""
        return self.geometry.geom_type in LINES

    @cached_property
    def area(self) -> BaseGeometry:
        """The polygons of the zone: of lines all that lies within half of the width."""
        return self.geometry.buffer(self.width / 2.0) if self.is_line else self.geometry

    @property
    def rule(self) -> dict[str, object]:
        """The fields that plain areas do not have, by name."""
        given = {'kind': self.kind != AREA, 'heading': math.isfinite(self.heading)}
        given['width'] = self.width > 0.0
        return {name: getattr(self, name) for name, is_given in given.items() if is_given}

    def arrows(self) -> list[tuple[Point2D, ...]]:
        """Return pairs of points, from which to which a rule leads, for pictures."""
        if self.kind not in RULES:
            return []
        lines = [list(line.coords) for line in shapely.get_parts(self.geometry) if self.is_line]
        if not lines:
            middle, angle = self.geometry.representative_point(), math.radians(self.heading)
            ahead = middle.x + math.cos(angle), middle.y + math.sin(angle)
            lines = [[(middle.x, middle.y), ahead]]
        return [pair for line in lines for pair in pairwise(line)]

    @property
    def label(self) -> str:
        """The zone for a person: its id, and its name where it has one."""
        return f'{self.id} ({self.name})' if self.name else self.id


def geometry_problem(geometry: BaseGeometry) -> str | None:
    """Say why a geometry cannot be a zone's, None where it can."""
    if geometry.geom_type not in POLYGONS + LINES:
        return f'a {geometry.geom_type} is not a Polygon or MultiPolygon, or a line'
    count = int(shapely.get_num_coordinates(geometry))
    if count > MAX_VERTICES:
        return f'{count} points are over {MAX_VERTICES}; simplify it'
    # Written so that NaN is refused.
    if not (count and abs(shapely.get_coordinates(geometry)).max() <= FAR):
        return 'its points must be finite and in metres of the map'
    if not geometry.is_valid:
        return f'{shapely.is_valid_reason(geometry)}; the outline must not cross itself'
    is_large = geometry.area if geometry.geom_type in POLYGONS else geometry.length
    return None if is_large > 0.0 else 'it has no area'


class Zones:
    """The zones of a map, by id, in the order in which they were added. Immutable."""

    def __init__(self, zones: Iterable[Zone] = ()) -> None:
        """Take zones. Raises ZonesError where two have one id, or there are too many."""
        self._by_id: dict[str, Zone] = {}
        for zone in zones:
            if zone.id in self._by_id:
                raise ZonesError(f'zone {zone.label}: id: is the id of another zone too')
            self._by_id[zone.id] = zone
        if len(self) > MAX_ZONES:
            raise ZonesError(f'{len(self)} zones are over {MAX_ZONES}; remove some')
        count = int(shapely.get_num_coordinates([zone.geometry for zone in self]).sum())
        if count > MAX_TOTAL_VERTICES:
            raise ZonesError(
                f'all zones together have {count} points, over {MAX_TOTAL_VERTICES}; '
                'simplify or remove some'
            )

    def __iter__(self) -> Iterator[Zone]:
        """Iterate over the zones."""
        return iter(self._by_id.values())

    def __len__(self) -> int:
        """Count the zones."""
        return len(self._by_id)

    def add(self, zones: Iterable[Zone]) -> Zones:
        """Return the zones with these too; one with an id that is there replaces that zone.

        Raises ZonesError where two of the new ones have one id, or there are too many then.
        """
        new = Zones(zones)
        return Zones((self._by_id | new._by_id).values())

    def remove(self, zones: Iterable[Zone]) -> Zones:
        """Return the zones without these; those that are not there are passed over."""
        ids = {zone.id for zone in zones}
        return Zones(zone for zone in self if zone.id not in ids)

    def find(self, text: str) -> tuple[Zone, ...]:
        """Return the zone with an id, or else all with a name; empty for none."""
        if text in self._by_id:
            return (self._by_id[text],)
        return tuple(zone for zone in self if zone.name == text)

    def expired(self, now: float) -> tuple[Zone, ...]:
        """Return the zones whose time is over at `now`, in seconds of their clock."""
        return tuple(zone for zone in self if zone.expires is not None and zone.expires <= now)

    @property
    def next_expiry(self) -> float:
        """When the next zone expires, in seconds of their clock; infinity for never."""
        return min((zone.expires for zone in self if zone.expires is not None), default=math.inf)


NO_ZONES = Zones()

SOURCE = 'zones'
# The zone that the edges of a nav2_route graph make, and its width unless the file has one.
ROUTE_GRAPH, ROUTE_WIDTH = 'route graph', 1.0
MAX_NUMBER, LEAST_SECONDS = 1e9, 0.001


def zones_from_text(text: str, now: float = 0.0) -> tuple[tuple[Zone, ...], str]:
    """Read zones that are added at `now`, in seconds; return them and their frame, '' for none.

    Raises ZonesError, which names the feature and the field.
    """
    if len(text) > MAX_BYTES:
        raise ZonesError(f'{SOURCE}: over {MAX_BYTES // 1_000_000} MB of text; add fewer at once')
    with raising(ZonesError, f'{SOURCE}: not JSON: ', ValueError):
        collection = parse_json(text)
    with raising(ZonesError, '', PlacesError):
        return zones_from_geojson(collection, now)


def zones_from_geojson(
    collection: Any,  # noqa: ANN401 - any JSON
    now: float,
) -> tuple[tuple[Zone, ...], str]:
    """Read a FeatureCollection as `zones_from_text` does. Raises ZonesError or PlacesError."""
    features = without_graph(features_of(collection, SOURCE), collection)
    if not 0 < len(features) <= MAX_ZONES:
        raise ZonesError(f'{SOURCE}: features: {len(features)} are not 1 to {MAX_ZONES}')
    found = collection.get('frame_id', '')
    frame_id = expect(found, str, f'{SOURCE}: frame_id', 'a text', ZonesError)
    zones = (
        zone_from_feature(feature, feature_label(SOURCE, index, feature), now)
        for index, feature in enumerate(features)
    )
    return tuple(zones), frame_id


def without_graph(features: list[Any], collection: dict[str, Any]) -> list[Any]:
    """Return features in which those of a nav2_route graph, if there is one, are one zone.

    Raises ZonesError.
    """
    lines, others = list[Any](), list[Any]()
    for one in features:
        geometry = part_of(one, 'geometry')
        kind, found = geometry.get('type'), geometry.get('coordinates')
        if {'startid', 'endid'} <= part_of(one, 'properties').keys():
            where = f'{SOURCE}: edge: coordinates'
            lines += [found] if kind == LINES[0] else expect(
                found, list, where, 'a list', ZonesError
            )  # fmt: skip
        elif kind != 'Point':
            others.append(one)
    if not lines:
        return features
    given = {name: collection[name] for name in ('width', 'cost') if name in collection}
    return [*others, {
        'type': 'Feature', 'id': ROUTE_GRAPH,
        'properties': {'kind': PREFERRED, 'width': ROUTE_WIDTH, **given},
        'geometry': {'type': LINES[1], 'coordinates': lines},
    }]  # fmt: skip


def part_of(feature: object, name: str) -> dict[str, Any]:
    """Return an object in a feature, an empty one where there is none."""
    found = feature.get(name) if isinstance(feature, dict) else None
    return found if isinstance(found, dict) else {}


def zone_from_feature(feature: object, where: str, now: float) -> Zone:
    """Read one zone. Raises ZonesError or PlacesError, which begin with `where`."""
    if not isinstance(feature, dict) or feature.get('type') != 'Feature':
        raise ZonesError(f'{where}: type: a Feature is expected, not {short_repr(feature)}')
    found = feature.get('properties')
    properties = expect(
        {} if found is None else found, dict, f'{where}: properties', 'an object', ZonesError
    )
    name, kind = properties.get('name'), str(properties.get('kind') or AREA)
    usual = COSTS.get(kind, KEEPOUT)
    cost = number_of(properties, 'cost', usual, where, (min(usual, 1), KEEPOUT))
    seconds = number_of(properties, 'seconds', None, where, (LEAST_SECONDS, MAX_NUMBER))
    fields: dict[str, Any] = {
        'id': id_of(feature.get('id', properties.get('id')), where),
        'geometry': parse_geometry(part_of(feature, 'geometry'), where, POLYGONS + LINES),
        'cost': int(cost) if cost % 1 == 0 else cost,
        'name': '' if name in (None, '') else parse_name(name, f'{where}: name'),
        'expires': seconds and now + seconds,
        'kind': kind,
        'heading': number_of(properties, 'heading', math.nan, where),
        'width': number_of(properties, 'width', 0.0, where),
    }
    with raising(ZonesError, f'{where}: ', ZonesError):
        return Zone(**fields)


def number_of(
    properties: dict[str, Any], name: str, default: float | None, where: str,
    between: tuple[float, float] = (-MAX_NUMBER, MAX_NUMBER),
) -> Any:  # noqa: ANN401 - a number, or the default  # fmt: skip
    """Return a number among properties, or the default. Raises ZonesError."""
    value: Any = properties.get(name, default)
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if value is not default and not (is_number and between[0] <= value <= between[1]):
        words = 'a number from {:g} to {:g} is expected'.format(*between)
        raise ZonesError(f'{where}: {name}: {words}, not {short_repr(value)}')
    return value


def id_of(value: object, where: str) -> str:
    """Return the id of a zone, a new one for None. Raises PlacesError."""
    if value is None:
        return str(uuid.uuid4())
    is_number = isinstance(value, int) and not isinstance(value, bool)
    return parse_name(str(value) if is_number else value, f'{where}: id')


def zones_to_geojson(zones: Zones, now: float, frame_id: str) -> dict[str, object]:
    """Return the FeatureCollection that `zones_from_geojson` reads at `now`."""
    features = [{
        'type': 'Feature', 'id': zone.id, 'geometry': mapping(zone.geometry),
        'properties': {
            'name': zone.name, 'cost': zone.cost, 'seconds': seconds_left(zone, now), **zone.rule,
        },
    } for zone in zones]  # fmt: skip
    return {'type': 'FeatureCollection', 'frame_id': frame_id, 'features': features}


def seconds_left(zone: Zone, now: float) -> float | None:
    """Return in how many seconds a zone expires, None for never."""
    if zone.expires is None or not math.isfinite(now):
        return None
    return round(max(zone.expires - now, LEAST_SECONDS), 3)

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Zones as GeoJSON: a FeatureCollection of polygons and lines in metres of the map's frame.

A feature's properties are `cost` (1 to 100, 100 by default), `name`, `seconds` (until it expires),
`kind` with `heading` and `width`, and `id`, which may also be the feature's own member. A
collection may have a `frame_id`. The edges of a nav2_route graph are one zone of preferred lines.
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Mapping
from typing import Any

from llm_astar_msgs_adapter.errors import expect, short_repr
from llm_astar_msgs_adapter.files import parse_json
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

from llm_astar_planner.costmap.zones import (
    AREA,
    COSTS,
    KEEPOUT,
    MAX_ZONES,
    POLYGONS,
    PREFERRED,
    Zone,
    Zones,
    ZonesError,
)

SOURCE = 'zones'
# The zone that the edges of a nav2_route graph make, and its width unless the file has one.
ROUTE_GRAPH, ROUTE_WIDTH = 'route graph', 1.0
# Corners of a triangle, the first once more at the end.
LEAST_POINTS = 4
MAX_SECONDS = 1e9


def zones_from_text(text: str, now: float = 0.0) -> tuple[tuple[Zone, ...], str]:
    """Read zones that are added at `now`, in seconds; return them and their frame, '' for none.

    Raises ZonesError, which names the feature and the field.
    """
    if len(text) > MAX_BYTES:
        raise ZonesError(f'{SOURCE}: over {MAX_BYTES // 1_000_000} MB of text; add fewer at once')
    try:
        collection = parse_json(text)
    except ValueError as error:
        raise ZonesError(f'{SOURCE}: not JSON: {error}') from None
    try:
        return zones_from_geojson(collection, now)
    except PlacesError as error:
        raise ZonesError(str(error)) from None


def zones_from_geojson(collection: object, now: float) -> tuple[tuple[Zone, ...], str]:
    """Read a FeatureCollection as `zones_from_text` does. Raises ZonesError or PlacesError."""
    features = without_graph(features_of(collection, SOURCE), collection)
    if not 0 < len(features) <= MAX_ZONES:
        raise ZonesError(f'{SOURCE}: features: {len(features)} are not 1 to {MAX_ZONES}')
    frame_id = collection.get('frame_id', '') if isinstance(collection, dict) else ''
    if not isinstance(frame_id, str):
        raise ZonesError(f'{SOURCE}: frame_id: a text is expected, not {short_repr(frame_id)}')
    zones = tuple(
        zone_from_feature(feature, feature_label(SOURCE, index, feature), now)
        for index, feature in enumerate(features)
    )
    return zones, frame_id


def without_graph(features: list[Any], collection: Any) -> list[Any]:  # noqa: ANN401 - any JSON
    """Return features in which those of a nav2_route graph, if there is one, are one zone.

    Raises ZonesError.
    """
    graph = [part_of(one, 'geometry') for one in features if is_edge(one)]
    if not graph:
        return features
    lines = list[Any]()
    for edge in graph:
        is_one, found = edge.get('type') == LINES[0], edge.get('coordinates')
        where = f'{SOURCE}: edge: coordinates'
        lines += [found] if is_one else expect(found, list, where, 'a list', ZonesError)
    given = {name: collection[name] for name in ('width', 'cost') if name in collection}
    others = [
        one
        for one in features
        if not is_edge(one) and part_of(one, 'geometry').get('type') != 'Point'
    ]
    return [*others, {
        'type': 'Feature', 'id': ROUTE_GRAPH,
        'properties': {'kind': PREFERRED, 'width': ROUTE_WIDTH, **given},
        'geometry': {'type': LINES[1], 'coordinates': lines},
    }]  # fmt: skip


def part_of(feature: object, name: str) -> dict[str, Any]:
    """Return an object in a feature, an empty one where there is none."""
    found = feature.get(name) if isinstance(feature, dict) else None
    return found if isinstance(found, dict) else {}


def is_edge(feature: object) -> bool:
    """Tell whether a feature is an edge of a nav2_route graph."""
    return {'startid', 'endid'} <= part_of(feature, 'properties').keys()


def zone_from_feature(feature: object, where: str, now: float) -> Zone:
    """Read one zone. Raises ZonesError or PlacesError, which begin with `where`."""
    if not isinstance(feature, dict) or feature.get('type') != 'Feature':
        raise ZonesError(f'{where}: type: a Feature is expected, not {short_repr(feature)}')
    properties = feature.get('properties')
    if properties is None:
        properties = {}
    if not isinstance(properties, dict):
        raise ZonesError(f'{where}: properties: an object is expected')
    name = properties.get('name')
    seconds, kind = seconds_of(properties, where), str(properties.get('kind') or AREA)
    fields = {
        'id': id_of(feature.get('id', properties.get('id')), where),
        'geometry': polygon_of(feature.get('geometry'), where),
        'cost': cost_of(properties, COSTS.get(kind, KEEPOUT), where),
        'name': '' if name in (None, '') else parse_name(name, f'{where}: name'),
        'expires': None if seconds is None else now + seconds,
        'kind': kind,
        'heading': number_of(properties, 'heading', math.nan, where),
        'width': number_of(properties, 'width', 0.0, where),
    }
    try:
        return Zone(**fields)
    except ZonesError as error:
        raise ZonesError(f'{where}: {error}') from None


def polygon_of(geometry: object, where: str) -> BaseGeometry:
    """Return the polygons or lines of a feature. Raises ZonesError or PlacesError."""
    if not isinstance(geometry, dict) or geometry.get('type') not in POLYGONS + LINES:
        kind = geometry.get('type') if isinstance(geometry, dict) else geometry
        raise ZonesError(
            f'{where}: geometry: a {" or ".join(POLYGONS)} is expected, not {short_repr(kind)}'
        )
    coordinates = geometry.get('coordinates')
    if geometry['type'] in LINES:
        return parse_geometry(geometry, where, LINES)
    outlines = [coordinates] if geometry['type'] == 'Polygon' else coordinates
    for outline in outlines if isinstance(outlines, list) else ():
        for ring in outline if isinstance(outline, list) else ():
            if isinstance(ring, list) and len(ring) < LEAST_POINTS:
                raise ZonesError(
                    f'{where}: coordinates: an outline of {len(ring)} points; it needs three '
                    'corners, and the first of them once more at the end'
                )
    return parse_geometry(geometry, where)


def cost_of(properties: Mapping[str, Any], default: int, where: str) -> int:
    """Return a zone's cost. Raises ZonesError."""
    cost, least = properties.get('cost', default), min(default, 1)
    if (
        isinstance(cost, bool)
        or not isinstance(cost, (int, float))
        or cost not in range(least, 101)
    ):
        raise ZonesError(
            f'{where}: cost: a whole number from 1 to {KEEPOUT}, which closes the zone, is '
            f'expected, not {short_repr(cost)}'
        )
    return int(cost)


def number_of(properties: Mapping[str, Any], name: str, default: float, where: str) -> float:
    """Return a number among properties. Raises ZonesError."""
    value = properties.get(name)
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, (int, float)) or abs(value) > MAX_SECONDS:
        raise ZonesError(f'{where}: {name}: a number is expected, not {short_repr(value)}')
    return float(value)


def seconds_of(properties: Mapping[str, Any], where: str) -> float | None:
    """Return after how many seconds a zone expires, None for never. Raises ZonesError."""
    seconds = properties.get('seconds')
    if seconds is None:
        return None
    is_number = isinstance(seconds, (int, float)) and not isinstance(seconds, bool)
    if not is_number or not 0.0 < seconds <= MAX_SECONDS:
        raise ZonesError(
            f'{where}: seconds: a number above 0 is expected, not {short_repr(seconds)}; '
            'leave it out for a zone that stays'
        )
    return float(seconds)


def id_of(value: object, where: str) -> str:
    """Return the id of a zone, a new one for None. Raises PlacesError."""
    if value is None:
        return str(uuid.uuid4())
    is_number = isinstance(value, int) and not isinstance(value, bool)
    return parse_name(str(value) if is_number else value, f'{where}: id')


def zones_to_geojson(zones: Zones, now: float, frame_id: str) -> dict[str, object]:
    """Return the FeatureCollection that `zones_from_geojson` reads at `now`."""
    return {
        'type': 'FeatureCollection',
        'frame_id': frame_id,
        'features': [
            {
                'type': 'Feature',
                'id': zone.id,
                'geometry': mapping(zone.geometry),
                'properties': {
                    'name': zone.name,
                    'cost': zone.cost,
                    'seconds': seconds_left(zone, now),
                    **zone.rule,
                },
            }
            for zone in zones
        ],
    }


def seconds_left(zone: Zone, now: float) -> float | None:
    """Return in how many seconds a zone expires, None for never."""
    if zone.expires is None or not math.isfinite(now):
        return None
    return round(max(zone.expires - now, 0.001), 3)

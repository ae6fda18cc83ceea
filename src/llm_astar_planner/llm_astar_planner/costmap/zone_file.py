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
KINDS = POLYGONS + LINES
LEAST_POINTS = 4
MAX_NUMBER = 1e9
# What is expected where something else is found.
COST_WORDS = f'a whole number from 1 to {KEEPOUT}, which closes the zone,'
SECONDS_WORDS = 'a number above 0, or none for a zone that stays,'


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
    cost = number_of(
        properties, 'cost', usual, where, words=COST_WORDS, least=min(usual, 1), most=KEEPOUT
    )
    above_zero = math.ulp(0.0)
    seconds = number_of(properties, 'seconds', None, where, words=SECONDS_WORDS, least=above_zero)
    fields: dict[str, Any] = {
        'id': id_of(feature.get('id', properties.get('id')), where),
        'geometry': geometry_of(feature, where),
        'cost': int(cost) if cost % 1 == 0 else cost,
        'name': '' if name in (None, '') else parse_name(name, f'{where}: name'),
        'expires': seconds and now + seconds,
        'kind': kind,
        'heading': number_of(properties, 'heading', math.nan, where),
        'width': number_of(properties, 'width', 0.0, where),
    }
    try:
        return Zone(**fields)
    except ZonesError as error:
        raise ZonesError(f'{where}: {error}') from None


def geometry_of(feature: dict[str, Any], where: str) -> BaseGeometry:
    """Return the polygons or lines of a feature. Raises ZonesError or PlacesError."""
    geometry = part_of(feature, 'geometry')
    kind, found = geometry.get('type'), geometry.get('coordinates')
    if kind not in KINDS:
        raise ZonesError(
            f'{where}: geometry: a {" or ".join(POLYGONS)} is expected, not {short_repr(kind)}'
        )
    outlines = {POLYGONS[0]: [found], POLYGONS[1]: found}.get(kind)
    for outline in outlines if isinstance(outlines, list) else ():
        for ring in outline if isinstance(outline, list) else ():
            if isinstance(ring, list) and len(ring) < LEAST_POINTS:
                raise ZonesError(
                    f'{where}: coordinates: an outline of {len(ring)} points; it needs three '
                    'corners, and the first of them once more at the end'
                )
    return parse_geometry(geometry, where, KINDS)


def number_of(
    properties: dict[str, Any], name: str, default: float | None, where: str, *,
    words: str = 'a number', least: float = -MAX_NUMBER, most: float = MAX_NUMBER,
) -> Any:  # noqa: ANN401 - a number, or the default  # fmt: skip
    """Return a number among properties. Raises ZonesError: `words` are expected."""
    value: Any = properties.get(name, default)
    if name not in properties or (value is None and default is None):
        return value
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not (is_number and least <= value <= most):
        raise ZonesError(f'{where}: {name}: {words} is expected, not {short_repr(value)}')
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
    return round(max(zone.expires - now, 0.001), 3)

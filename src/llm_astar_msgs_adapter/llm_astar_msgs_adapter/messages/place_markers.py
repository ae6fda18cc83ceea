"""Named places as markers for RViz and Foxglove: their names and outlines."""

from __future__ import annotations

from collections.abc import Iterator

import shapely
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from shapely.geometry.base import BaseGeometry
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from llm_astar_msgs_adapter.maps.places import Place, Places

NAMESPACE = 'places'
# Stand out on a light and on a dark background.
COLOUR = (0.12, 0.56, 0.60)
OBJECT_COLOUR = (0.70, 0.45, 0.20)
LINE_WIDTH = 0.05
# Metres, and as a part of the longer side of the box around all places.
TEXT_SIZE = 0.3
PART_OF_PLACES = 0.015


def places_to_markers(places: Places, stamp: Time) -> MarkerArray:
    """Draw places: a text and a line strip around each polygon, in one namespace.

    The first marker deletes those of the places before.
    """
    clear = Marker(action=Marker.DELETEALL)
    clear.header.frame_id = places.frame_id
    size = text_size(places)
    markers = [marker for place in places for marker in place_to_markers(place, size)]
    for number, marker in enumerate(markers, start=1):
        marker.header.frame_id = places.frame_id
        marker.header.stamp = stamp
        marker.ns, marker.id, marker.action = NAMESPACE, number, Marker.ADD
        marker.pose.orientation.w = 1.0
    return MarkerArray(markers=[clear, *markers])


def text_size(places: Places) -> float:
    """Return the height of the names in metres."""
    if not len(places):
        return TEXT_SIZE
    x0, y0, x1, y1 = shapely.total_bounds([place.geometry for place in places]).tolist()
    return float(max(TEXT_SIZE, PART_OF_PLACES * max(x1 - x0, y1 - y0)))


def place_to_markers(place: Place, size: float) -> Iterator[Marker]:
    """Yield the name and the outlines of one place."""
    red, green, blue = OBJECT_COLOUR if place.is_object else COLOUR
    colour = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    inside = place.geometry.representative_point()
    name = Marker(type=Marker.TEXT_VIEW_FACING, text=place.name, color=colour)
    name.pose.position = Point(x=inside.x, y=inside.y, z=size)
    name.scale.z = size
    yield name
    for points in outlines(place.geometry):
        outline = Marker(type=Marker.LINE_STRIP, color=colour)
        outline.scale.x = LINE_WIDTH
        outline.points = [Point(x=x, y=y, z=0.0) for x, y in points]
        yield outline


def outlines(geometry: BaseGeometry) -> Iterator[list[tuple[float, float]]]:
    """Yield the closed outer rings of polygons; a point has none."""
    for part in shapely.get_parts(geometry):
        if part.geom_type == 'Polygon':
            yield [(float(x), float(y)) for x, y in part.exterior.coords]

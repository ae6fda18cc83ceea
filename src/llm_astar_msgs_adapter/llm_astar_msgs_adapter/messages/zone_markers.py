"""Zones as markers for RViz and Foxglove: their names and outlines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import shapely
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from shapely.geometry.base import BaseGeometry
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from llm_astar_msgs_adapter.messages.place_markers import LINE_WIDTH, TEXT_SIZE

NAMESPACE = 'zones'
CLOSED_COLOUR = (0.84, 0.15, 0.16)
OPEN_COLOUR = (0.93, 0.60, 0.10)


def zones_to_markers(
    zones: Iterable[tuple[str, BaseGeometry, bool]], frame_id: str, stamp: Time
) -> MarkerArray:
    """Draw zones: label, polygon in metres, and whether it is closed to the robot.

    Each is a text and a line strip around each ring. The first marker deletes those before.
    """
    clear = Marker(action=Marker.DELETEALL)
    clear.header.frame_id = frame_id
    markers = [marker for zone in zones for marker in zone_to_markers(*zone)]
    for number, marker in enumerate(markers, start=1):
        marker.header.frame_id = frame_id
        marker.header.stamp = stamp
        marker.ns, marker.id, marker.action = NAMESPACE, number, Marker.ADD
        marker.pose.orientation.w = 1.0
    return MarkerArray(markers=[clear, *markers])


def zone_to_markers(label: str, geometry: BaseGeometry, is_closed: bool) -> Iterator[Marker]:
    """Yield the label and the outlines of one zone."""
    red, green, blue = CLOSED_COLOUR if is_closed else OPEN_COLOUR
    colour = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    inside = geometry.representative_point()
    text = Marker(type=Marker.TEXT_VIEW_FACING, text=label, color=colour)
    text.pose.position = Point(x=inside.x, y=inside.y, z=TEXT_SIZE)
    text.scale.z = TEXT_SIZE
    yield text
    for part in shapely.get_parts(geometry):
        for ring in (part.exterior, *part.interiors):
            outline = Marker(type=Marker.LINE_STRIP, color=colour)
            outline.scale.x = LINE_WIDTH
            outline.points = [Point(x=x, y=y, z=0.0) for x, y in ring.coords]
            yield outline

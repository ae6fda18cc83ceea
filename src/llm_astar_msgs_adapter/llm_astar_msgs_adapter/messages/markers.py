# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Markers for RViz and Foxglove: plans with their expanded cells, named places, and zones."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from nav_msgs.msg import GridCells
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from llm_astar_msgs_adapter.maps.barrier_decomposition import coarsen
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Places

# A message of a million cells takes ten seconds to write, and no screen can show them all.
MAX_DRAWN = 10_000
Point2D = tuple[float, float]
Colour = tuple[float, float, float]

# Colours by waypoint status; they stand out on a light and on a dark background.
STATUS_COLOURS = {
    'accepted': (0.16, 0.63, 0.17),
    'unreachable': (0.58, 0.40, 0.74),
    'occupied': (0.84, 0.15, 0.16),
    'out_of_bounds': (0.50, 0.50, 0.50),
}
UNKNOWN_STATUS_COLOUR = (0.0, 0.0, 0.0)
START_COLOUR = (0.12, 0.47, 0.71)
GOAL_COLOUR = (0.89, 0.10, 0.45)
VIA_COLOUR = (0.09, 0.75, 0.81)
PLACE_COLOUR = (0.12, 0.56, 0.60)
OBJECT_COLOUR = (0.70, 0.45, 0.20)
CLOSED_COLOUR = (0.84, 0.15, 0.16)
OPEN_COLOUR = (0.93, 0.60, 0.10)
# Of the names of places and zones: metres, and as a part of the box around all places.
TEXT_SIZE = 0.3
PART_OF_PLACES = 0.015
LINE_WIDTH = 0.05
# A marker's least size: in cells, and as a part of the map's longer side.
CELLS_WIDE = 1.5
PART_OF_MAP = 0.015
# The distance of a label from its shape, in marker sizes.
LABEL_OFFSET = 1.5


class Shape(NamedTuple):
    """One marker before it becomes a message: `point` in grid coordinates, `size` in metres.

    `offset` moves it along y, in sizes: a label right above its shape would hide it from above.
    """

    namespace: str
    kind: int
    point: Point2D
    colour: Colour
    size: float
    text: str = ''
    offset: float = 0.0

    def to_marker(self, x: float, y: float) -> Marker:
        """Return the marker at a position in metres."""
        colour, z = rgba(self.colour), self.size if self.text else 0.0
        marker = Marker(ns=self.namespace, type=self.kind, color=colour, text=self.text)
        marker.pose.position = Point(x=x, y=y + self.offset * self.size, z=z)
        marker.scale.x = marker.scale.y = marker.scale.z = self.size
        return marker


def waypoints_to_markers(
    waypoints: Sequence[tuple[float, float, str]],
    grid_map: GridMap,
    stamp: Time,
    endpoints: Sequence[Point2D] = (),
    via: Sequence[Point2D] = (),
) -> MarkerArray:
    """Draw a plan's waypoints (x, y, status), endpoints and via points, in grid coordinates.

    Waypoints are numbered spheres coloured by status.
    `endpoints`, start and goal, are cubes; `via` points are numbered cylinders. The first marker
    deletes those of the previous plan. Each kind has its namespace, to be hidden on its own.
    """
    longer_side = max(grid_map.width, grid_map.height)
    size = max(CELLS_WIDE, PART_OF_MAP * longer_side) * grid_map.resolution
    shapes: list[Shape] = []
    for number, (x, y, status) in enumerate(waypoints, start=1):
        colour = STATUS_COLOURS.get(status, UNKNOWN_STATUS_COLOUR)
        text = f'{number}' if status == 'accepted' else f'{number} {status.replace("_", " ")}'
        shapes.append(Shape('waypoints', Marker.SPHERE, (x, y), colour, size))
        shapes.append(label((x, y), colour, size, text))
    for point, name, colour in zip(endpoints, ('start', 'goal'), (START_COLOUR, GOAL_COLOUR)):
        shapes.append(Shape('ends', Marker.CUBE, point, colour, size))
        # On the other side than a waypoint's label: models also return start and goal.
        shapes.append(label(point, colour, size, name, -LABEL_OFFSET))
    for number, point in enumerate(via, start=1):
        shapes.append(Shape('via', Marker.CYLINDER, point, VIA_COLOUR, 1.4 * size))
        shapes.append(label(point, VIA_COLOUR, size, f'via {number}'))
    positions = grid_map.grid_to_world([shape.point for shape in shapes]).tolist()
    markers = [shape.to_marker(x, y) for shape, (x, y) in zip(shapes, positions)]
    return numbered(markers, grid_map.frame_id, stamp)


def label(
    point: Point2D, colour: Colour, size: float, text: str, offset: float = LABEL_OFFSET
) -> Shape:
    """Return the text next to a shape."""
    return Shape('labels', Marker.TEXT_VIEW_FACING, point, colour, size, text, offset)


def expanded_to_message(expanded: NDArray[np.bool_], grid_map: GridMap, stamp: Time) -> GridCells:
    """Draw the expanded cells (bool [height, width]) as grid cells.

    Where they are more than MAX_DRAWN, blocks of 2 x 2, 4 x 4, ... cells are drawn instead.
    """
    factor, blocks = 1, expanded
    while np.count_nonzero(blocks) > MAX_DRAWN:
        factor *= 2
        blocks = coarsen(expanded, factor)
    message = GridCells()
    message.header.frame_id = grid_map.frame_id
    message.header.stamp = stamp
    message.cell_width = message.cell_height = float(grid_map.resolution * factor)
    rows, columns = np.nonzero(blocks)
    centres = np.column_stack((columns, rows)) * factor + (factor - 1) / 2
    points = grid_map.grid_to_world(centres)
    message.cells = [Point(x=x, y=y, z=0.0) for x, y in points.tolist()]
    return message


def expanded_from_message(message: GridCells, grid_map: GridMap) -> NDArray[np.bool_]:
    """Read the expanded cells of a map (bool [height, width]) back from their message."""
    expanded = np.zeros(grid_map.cells.shape, dtype=np.bool_)
    factor = round(message.cell_width / grid_map.resolution)
    if message.cells:
        centres = grid_map.world_to_grid([(point.x, point.y) for point in message.cells])
        columns, rows = np.rint(centres - (factor - 1) / 2).astype(int).T
        within = np.arange(factor)
        y = (rows[:, None, None] + within[:, None]).clip(max=grid_map.height - 1)
        x = (columns[:, None, None] + within).clip(max=grid_map.width - 1)
        expanded[y, x] = True
    return expanded


def places_to_markers(places: Places, stamp: Time) -> MarkerArray:
    """Draw places: a text and a line strip around each polygon, in one namespace.

    The first marker deletes those of the places before.
    """
    size = TEXT_SIZE
    if len(places):
        x0, y0, x1, y1 = shapely.total_bounds([place.geometry for place in places]).tolist()
        size = max(TEXT_SIZE, PART_OF_PLACES * max(x1 - x0, y1 - y0))
    areas = [
        Mark(place.name, place.geometry, OBJECT_COLOUR if place.is_object else PLACE_COLOUR, size)
        for place in places
    ]
    return areas_to_markers('places', areas, places.frame_id, stamp)


def zones_to_markers(
    zones: Iterable[tuple[str, BaseGeometry, bool, Sequence[tuple[Point2D, ...]]]],
    frame_id: str,
    stamp: Time,
) -> MarkerArray:
    """Draw zones: label, polygon in metres, whether it is closed to the robot, and arrows.

    Each is a text, a line strip around each ring, and arrows from point to point. The first marker
    deletes those before.
    """
    areas = [
        Mark(label, geometry, CLOSED_COLOUR if is_closed else OPEN_COLOUR, TEXT_SIZE, True, arrows)
        for label, geometry, is_closed, arrows in zones
    ]
    return areas_to_markers('zones', areas, frame_id, stamp)


def reasons_to_markers(
    reasons: Iterable[tuple[str, Sequence[Sequence[float]]]], frame_id: str, stamp: Time
) -> list[Marker]:
    """Draw what explains a plan: names, and lines through points (x, y) in metres, not none."""
    areas = [
        Mark(name, shapely.LineString([*points, points[-1]]), CLOSED_COLOUR, TEXT_SIZE)
        for name, points in reasons
    ]
    return list(areas_to_markers('reasons', areas, frame_id, stamp).markers[1:])


class Mark(NamedTuple):
    """A named place, zone or line: its name has a height in metres, holes may have outlines."""

    name: str
    geometry: BaseGeometry
    colour: Colour
    size: float
    with_holes: bool = False
    arrows: Sequence[tuple[Point2D, ...]] = ()

    def markers(self) -> Iterator[Marker]:
        """Yield the name, closed outlines of polygons, and lines; a point has none."""
        colour = rgba(self.colour)
        inside = self.geometry.representative_point()
        text = Marker(type=Marker.TEXT_VIEW_FACING, text=self.name, color=colour)
        text.pose.position = Point(x=inside.x, y=inside.y, z=self.size)
        text.scale.z = self.size
        yield text
        for part in shapely.get_parts(self.geometry):
            holes = part.interiors if self.with_holes else ()
            is_polygon = part.geom_type == 'Polygon'
            lines = [part] if part.geom_type == 'LineString' else []
            for ring in (part.exterior, *holes) if is_polygon else lines:
                yield self.through(ring.coords, Marker.LINE_STRIP)
        for points in self.arrows:
            yield self.through(points, Marker.ARROW)

    def through(self, points: Iterable[Sequence[float]], kind: int) -> Marker:
        """Return a line or an arrow through points."""
        marker = Marker(type=kind, color=rgba(self.colour))
        marker.scale.x = LINE_WIDTH
        marker.scale.y = 3.0 * LINE_WIDTH if kind == Marker.ARROW else 0.0
        marker.points = [Point(x=x, y=y, z=0.0) for x, y in points]
        return marker


def areas_to_markers(
    namespace: str, areas: Sequence[Mark], frame_id: str, stamp: Time
) -> MarkerArray:
    """Return the markers of areas in one namespace, after one that deletes those before."""
    markers = [marker for area in areas for marker in area.markers()]
    for marker in markers:
        marker.ns = namespace
    return numbered(markers, frame_id, stamp)


def numbered(markers: Sequence[Marker], frame_id: str, stamp: Time) -> MarkerArray:
    """Return markers with ids, after one that deletes all markers of the topic."""
    clear = Marker(action=Marker.DELETEALL)
    clear.header.frame_id = frame_id
    for number, marker in enumerate(markers, start=1):
        marker.header.frame_id = frame_id
        marker.header.stamp = stamp
        marker.id, marker.action, marker.pose.orientation.w = number, Marker.ADD, 1.0
    return MarkerArray(markers=[clear, *markers])


def rgba(colour: Colour) -> ColorRGBA:
    """Return an opaque colour."""
    red, green, blue = colour
    return ColorRGBA(r=red, g=green, b=blue, a=1.0)

"""Waypoints and expanded cells as RViz shows them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from nav_msgs.msg import GridCells
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from llm_astar_msgs_adapter.grid_map import GridMap

# Colours by verdict, for a light and a dark background alike.
VERDICT_COLOURS = {
    'accepted': (0.16, 0.63, 0.17),
    'out_of_order': (1.00, 0.65, 0.00),
    'unreachable': (0.58, 0.40, 0.74),
    'occupied': (0.84, 0.15, 0.16),
    'out_of_bounds': (0.50, 0.50, 0.50),
}


def waypoints_to_markers(
    waypoints: Sequence[tuple[float, float, str]], grid_map: GridMap, stamp: Time
) -> MarkerArray:
    """Draw waypoints (x, y in grid coordinates, verdict) as numbered spheres.

    The first marker deletes those of the plan before.
    """
    clear = Marker(action=Marker.DELETEALL)
    clear.header.frame_id = grid_map.frame_id
    markers = [clear]
    places = grid_map.grid_to_world([(x, y) for x, y, _ in waypoints]).tolist()
    for number, ((x, y), (_, _, verdict)) in enumerate(zip(places, waypoints), start=1):
        for kind in (Marker.SPHERE, Marker.TEXT_VIEW_FACING):
            marker = Marker(ns='waypoints', id=len(markers), type=kind, action=Marker.ADD)
            marker.header.frame_id = grid_map.frame_id
            marker.header.stamp = stamp
            marker.pose.position = Point(x=x, y=y, z=0.0)
            marker.pose.orientation.w = 1.0
            size = 1.5 * grid_map.resolution
            marker.scale.x = marker.scale.y = marker.scale.z = size
            red, green, blue = VERDICT_COLOURS.get(verdict, (0.0, 0.0, 0.0))
            marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
            if kind == Marker.TEXT_VIEW_FACING:
                marker.text = f'{number} {verdict}'
                marker.pose.position.z = 1.5 * size
            markers.append(marker)
    return MarkerArray(markers=markers)


def expanded_to_message(expanded: NDArray[np.bool_], grid_map: GridMap, stamp: Time) -> GridCells:
    """Draw the expanded cells (bool [height, width]) as grid cells."""
    message = GridCells()
    message.header.frame_id = grid_map.frame_id
    message.header.stamp = stamp
    message.cell_width = message.cell_height = float(grid_map.resolution)
    rows, columns = np.nonzero(expanded)
    points = grid_map.grid_to_world(np.column_stack((columns, rows)))
    message.cells = [Point(x=x, y=y, z=0.0) for x, y in points.tolist()]
    return message


def expanded_from_message(message: GridCells, grid_map: GridMap) -> NDArray[np.bool_]:
    """Read the cells of a message on the map they were drawn for: bool [height, width]."""
    expanded = np.zeros(grid_map.cells.shape, dtype=np.bool_)
    if message.cells:
        places = grid_map.world_to_grid([(point.x, point.y) for point in message.cells])
        columns, rows = np.rint(places).astype(int).T
        expanded[rows, columns] = True
    return expanded

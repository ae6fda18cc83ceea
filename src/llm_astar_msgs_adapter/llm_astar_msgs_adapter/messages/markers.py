"""Plans as RViz and Foxglove show them: waypoints, ends, via points, expanded cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from nav_msgs.msg import GridCells
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from llm_astar_msgs_adapter.maps.barrier_decomposition import coarsen
from llm_astar_msgs_adapter.maps.grid_map import GridMap

# A message of a million cells takes ten seconds to write, and no screen shows them all.
MAX_DRAWN = 10_000
Place = tuple[float, float]
Colour = tuple[float, float, float]

# Colours by verdict, for a light and a dark background alike.
VERDICT_COLOURS = {
    'accepted': (0.16, 0.63, 0.17),
    'out_of_order': (1.00, 0.65, 0.00),
    'unreachable': (0.58, 0.40, 0.74),
    'occupied': (0.84, 0.15, 0.16),
    'out_of_bounds': (0.50, 0.50, 0.50),
}
START_COLOUR = (0.12, 0.47, 0.71)
GOAL_COLOUR = (0.89, 0.10, 0.45)
VIA_COLOUR = (0.09, 0.75, 0.81)
# A marker is at least so many cells wide, and so large a part of the map's longer side.
CELLS_WIDE = 1.5
PART_OF_MAP = 0.015
# How far a label stands off its shape, in sizes.
ASIDE = 1.5


class _Shape(NamedTuple):
    """A marker to be: its namespace, kind, place in grid coordinates, size in metres.

    `aside` is how many sizes off its place it stands, along y: a label right over its shape would
    hide it from above.
    """

    space: str
    kind: int
    place: Place
    colour: Colour
    size: float
    text: str = ''
    aside: float = 0.0


def waypoints_to_markers(
    waypoints: Sequence[tuple[float, float, str]],
    grid_map: GridMap,
    stamp: Time,
    ends: Sequence[Place] = (),
    via: Sequence[Place] = (),
) -> MarkerArray:
    """Draw what a plan was given, all in grid coordinates (x, y).

    Waypoints with their verdict are numbered spheres, and a legend left of the map's top counts
    them; `ends`, start and goal, are cubes; `via` are numbered cylinders. The first marker deletes
    those of the plan before. Each kind is a namespace, to be switched off alone.
    """
    size = _size(grid_map)
    shapes = [
        *_waypoint_shapes(waypoints, size),
        *_end_shapes(ends, size),
        *_via_shapes(via, size),
        *_legend_shapes(waypoints, grid_map, size),
    ]
    clear = Marker(action=Marker.DELETEALL)
    clear.header.frame_id = grid_map.frame_id
    places = grid_map.grid_to_world([shape.place for shape in shapes]).tolist()
    markers = [
        _marker(number, shape, Point(x=x, y=y, z=0.0), grid_map.frame_id, stamp)
        for number, (shape, (x, y)) in enumerate(zip(shapes, places), start=1)
    ]
    return MarkerArray(markers=[clear, *markers])


def _size(grid_map: GridMap) -> float:
    """Return how many metres wide a marker is, to be seen on the whole map."""
    longer = max(grid_map.width, grid_map.height)
    return max(CELLS_WIDE, PART_OF_MAP * longer) * grid_map.resolution


def _waypoint_shapes(waypoints: Sequence[tuple[float, float, str]], size: float) -> list[_Shape]:
    shapes = []
    for number, (x, y, verdict) in enumerate(waypoints, start=1):
        colour = VERDICT_COLOURS.get(verdict, (0.0, 0.0, 0.0))
        text = f'{number}' if verdict == 'accepted' else f'{number} {verdict.replace("_", " ")}'
        shapes.append(_Shape('waypoints', Marker.SPHERE, (x, y), colour, size))
        shapes.append(_Shape('labels', Marker.TEXT_VIEW_FACING, (x, y), colour, size, text, ASIDE))
    return shapes


def _end_shapes(ends: Sequence[Place], size: float) -> list[_Shape]:
    shapes = []
    for place, name, colour in zip(ends, ('start', 'goal'), (START_COLOUR, GOAL_COLOUR)):
        shapes.append(_Shape('ends', Marker.CUBE, place, colour, size))
        # On the other side than a waypoint's, as models name the ends, too.
        shapes.append(_Shape('labels', Marker.TEXT_VIEW_FACING, place, colour, size, name, -ASIDE))
    return shapes


def _via_shapes(via: Sequence[Place], size: float) -> list[_Shape]:
    shapes = []
    for number, place in enumerate(via, start=1):
        text = f'via {number}'
        shapes.append(_Shape('via', Marker.CYLINDER, place, VIA_COLOUR, 1.4 * size))
        label = _Shape('labels', Marker.TEXT_VIEW_FACING, place, VIA_COLOUR, size, text, ASIDE)
        shapes.append(label)
    return shapes


def _legend_shapes(
    waypoints: Sequence[tuple[float, float, str]], grid_map: GridMap, size: float
) -> list[_Shape]:
    """Return a line a verdict that occurs, below each other, outside the map."""
    counts = Counter(verdict for _, _, verdict in waypoints)
    cells = size / grid_map.resolution
    shapes = []
    for line, (verdict, colour) in enumerate(
        (verdict, colour) for verdict, colour in VERDICT_COLOURS.items() if counts[verdict]
    ):
        place = (-6.0 * cells, grid_map.height - 1.0 - 1.5 * cells * line)
        text = f'{counts[verdict]} {verdict.replace("_", " ")}'
        shapes.append(_Shape('legend', Marker.TEXT_VIEW_FACING, place, colour, size, text))
    return shapes


def _marker(number: int, shape: _Shape, place: Point, frame_id: str, stamp: Time) -> Marker:
    marker = Marker(ns=shape.space, id=number, type=shape.kind, action=Marker.ADD)
    marker.header.frame_id = frame_id
    marker.header.stamp = stamp
    marker.pose.position = place
    marker.pose.position.y += shape.aside * shape.size
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = shape.size
    red, green, blue = shape.colour
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    if shape.text:
        marker.text = shape.text
        marker.pose.position.z = shape.size
    return marker


def expanded_to_message(expanded: NDArray[np.bool_], grid_map: GridMap, stamp: Time) -> GridCells:
    """Draw the expanded cells (bool [height, width]) as grid cells.

    More than MAX_DRAWN are drawn as larger cells: 2 x 2, 4 x 4, ... of the map's.
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
    """Read the cells of a message on the map they were drawn for: bool [height, width]."""
    expanded = np.zeros(grid_map.cells.shape, dtype=np.bool_)
    factor = round(message.cell_width / grid_map.resolution)
    if message.cells:
        places = grid_map.world_to_grid([(point.x, point.y) for point in message.cells])
        columns, rows = np.rint(places - (factor - 1) / 2).astype(int).T
        within = np.arange(factor)
        y = (rows[:, None, None] + within[:, None]).clip(max=grid_map.height - 1)
        x = (columns[:, None, None] + within).clip(max=grid_map.width - 1)
        expanded[y, x] = True
    return expanded

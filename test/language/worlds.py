"""Maps for sentences: rooms with doors beside a hall, and what lies in them.

A World has the grid, the places, some cells to start and end at, and spots: points that lie
clearly inside or outside of every place, of which random traces are made.
"""

from functools import cached_property

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Place, Places
from scipy import ndimage

RESOLUTION = 0.25
ROOM, DEPTH, HALL = 4.0, 4.0, 3.0
# Metres from the edge of a place that make a spot clear.
CLEAR = 0.55


class World:
    """A map with places; `ends` are points in the hall or in rooms to start and end at."""

    def __init__(self, grid_map, places, ends):
        self.grid_map = grid_map
        self.places = places
        self.ends = ends
        height, width = grid_map.cells.shape
        x0, y0 = grid_map.origin[:2]
        size = grid_map.resolution
        self.bounds = (x0, y0, x0 + width * size, y0 + height * size)

    @cached_property
    def wall_distance(self):
        """Metres from each free cell's centre to the nearest occupied cell."""
        return ndimage.distance_transform_edt(self.grid_map.cells < 65) * self.grid_map.resolution

    @cached_property
    def spots(self):
        """Points [n, 2]: the clear ones of a coarse grid, and those near objects."""
        x0, y0, x1, y1 = self.bounds
        xs, ys = np.meshgrid(np.arange(x0 + 0.5, x1, 0.95), np.arange(y0 + 0.5, y1, 0.95))
        points = np.column_stack((xs.ravel(), ys.ravel()))
        areas = [place.geometry for place in self.places if not place.is_object]
        clear = np.ones(len(points), dtype=bool)
        for area in areas:
            far = shapely.distance(shapely.boundary(area), shapely.points(points))
            clear &= far > min(CLEAR, 0.24 * np.sqrt(area.area))
        spots = [points[clear]]
        for place in self.places:
            centre = np.array(place.geometry.centroid.coords[0])
            spots.append([centre])
            if place.is_object:
                offset = np.array([[0.6, 0], [0, 0.6], [-1.8, 0], [0, -1.8]])
                half = np.ptp(np.array(place.geometry.envelope.exterior.coords), axis=0) / 2
                spots.append(centre + offset + np.sign(offset) * half)
        return np.concatenate(spots)

    def cell(self, point):
        """Return the cell (x, y) of a point."""
        return self.grid_map.world_to_cell(*point)


def hall_of_rooms(rooms, objects=(), hall='hall'):
    """Return a World: rooms in two rows, a door each, north and south of a hall.

    `rooms` are dicts of name, and of kind, aliases and tags where they have them; `objects` lie
    in the hall, near its northern wall.
    """
    rows = -(-len(rooms) // 2)
    width, height = rows * ROOM, 2 * DEPTH + HALL
    cells = np.zeros((round(height / RESOLUTION), round(width / RESOLUTION)), dtype=np.int8)
    at = lambda metres: round(metres / RESOLUTION)  # noqa: E731
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    places = []
    for index, room in enumerate(rooms):
        column, is_north = index % rows, index >= rows
        x, y = column * ROOM, (DEPTH + HALL) * is_north
        wall = at(DEPTH + HALL) if is_north else at(DEPTH) - 1
        cells[wall, at(x) : at(x + ROOM)] = 100
        cells[wall, at(x + 1.25) : at(x + 2.75)] = 0
        if column:
            cells[at(y) : at(y + DEPTH), at(x)] = 100
        box = shapely.box(x + 0.25, y + 0.25, x + ROOM, y + DEPTH - 0.25)
        places.append(named(room, box, 'room'))
    step = width / (len(objects) + 1)
    for index, thing in enumerate(objects):
        x, y = (index + 1) * step, DEPTH + HALL / 2 + 0.25
        cells[at(y - 0.25) : at(y + 0.25), at(x - 0.25) : at(x + 0.25)] = 100
        places.append(named(thing, shapely.box(x - 0.25, y - 0.25, x + 0.25, y + 0.25), 'object'))
    if hall:
        strip = shapely.box(0.25, DEPTH, width - 0.25, DEPTH + HALL)
        places.append(Place(hall, strip, 'corridor'))
    middle = DEPTH + 0.9
    ends = [(0.9, middle), (width - 0.9, middle), (width / 2 + 0.1, middle)]
    return World(GridMap(cells, RESOLUTION), Places(places), ends)


def named(entry, shape, kind):
    """Return a Place of a dict, or of a name."""
    entry = {'name': entry} if isinstance(entry, str) else entry
    return Place(
        entry['name'],
        shape,
        entry.get('kind', kind),
        tuple(entry.get('aliases', ())),
        tuple(entry.get('tags', ())),
    )


def open_field(places, bounds, ends):
    """Return a World without walls but the border: `bounds` are its corners in metres."""
    x0, y0, x1, y1 = bounds
    cells = np.zeros((round((y1 - y0) / 0.5), round((x1 - x0) / 0.5)), dtype=np.int8)
    return World(GridMap(cells, 0.5, Pose2D(x0, y0, 0.0)), places, ends)

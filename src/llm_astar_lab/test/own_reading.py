"""A reading of the regions of a suite's checks, and a measure of paths, in code of their own.

Neither the enforcement nor the verification of instructions, nor the benchmark, shares anything
with it: the tests hold the benchmark, which reads regions as the verification does, against it.
"""

import math
from functools import cached_property

import numpy as np
import shapely

# Straight lines for a quarter of a circle.
QUARTER = 64
# Metres. Open sides lie this far away.
FAR = 1e6
VISIT_RADIUS = 0.5
# Metres. Stretches of a path with a smaller gap between them are one.
GAP = 1e-7


def geometry_of(value, suite_map, start, goal):
    """Return the geometry of a region of a check; start and goal are in metres."""

    def part(one):
        return geometry_of(one, suite_map, start, goal)

    match value:
        case {'place': name}:
            return place_geometry(suite_map.places.get(name))
        case {'tag': tag}:
            return shapely.union_all(list(map(place_geometry, suite_map.places.with_tag(tag))))
        case {'circle': [x, y, radius]}:
            return disc(x, y, radius)
        case {'rect': sides}:
            open_sides = (-FAR, -FAR, FAR, FAR)
            pairs = zip(sides, open_sides, strict=True)
            return shapely.box(*(far if side is None else side for side, far in pairs))
        case {'polygon': corners}:
            return shapely.Polygon(corners)
        case {'half': 'left' | 'right' as side}:
            return half_plane(start, goal, side)
        case {'half': side, 'of': name}:
            place = place_geometry(suite_map.places.get(name))
            return box_half(side, place.bounds).intersection(place)
        case {'half': side}:
            return box_half(side, extent(suite_map.grid_map))
        case {'union': values}:
            return shapely.union_all(list(map(part, values)))
        case {'between': values}:
            both = shapely.union_all(list(map(part, values)))
            return both.convex_hull.difference(both)
        case {'near': one, 'width': width}:
            return part(one).buffer(width, quad_segs=QUARTER)
        case {'walls': width}:
            return shapely.union_all(shapely.buffer(walls(suite_map), width))
    raise ValueError(value)


def extent(grid_map):
    """Return the least box x0, y0, x1, y1 around the whole grid."""
    width, height = grid_map.width - 0.5, grid_map.height - 0.5
    corners = [(-0.5, -0.5), (width, -0.5), (width, height), (-0.5, height)]
    points = grid_map.grid_to_world(corners)
    return (*points.min(axis=0), *points.max(axis=0))


def walls(suite_map):
    """Return the squares of the occupied cells."""
    grid_map = suite_map.grid_map
    rows, columns = np.nonzero(grid_map.blocked(65))
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    cells = np.stack((columns, rows), axis=1)[:, None] + corners
    return shapely.polygons(grid_map.grid_to_world(cells.reshape(-1, 2)).reshape(-1, 4, 2))


def place_geometry(place):
    """Return the polygon of a place; of a point, the disc in which it counts as visited."""
    if isinstance(place.geometry, shapely.Point):
        return disc(place.geometry.x, place.geometry.y, VISIT_RADIUS)
    return place.geometry


def disc(x, y, radius):
    """Return a disc as a polygon."""
    return shapely.Point(x, y).buffer(radius, quad_segs=QUARTER)


def box_half(side, bounds):
    """Return the half of a box on a compass side."""
    x0, y0, x1, y1 = bounds
    x, y = (x0 + x1) / 2.0, (y0 + y1) / 2.0
    halves = {
        'north': (x0, y, x1, y1),
        'south': (x0, y0, x1, y),
        'east': (x, y0, x1, y1),
        'west': (x0, y0, x, y1),
    }
    return shapely.box(*halves[side])


def half_plane(start, goal, side):
    """Return all to the left or right of the line from start to goal, as far as FAR."""
    along = (np.array(goal) - start) / math.dist(start, goal) * FAR
    across = np.array([-along[1], along[0]]) * (1.0 if side == 'left' else -1.0)
    first, last = np.array(start) - along, np.array(goal) + along
    return shapely.Polygon([first, last, last + across, first + across])


class MeasuredPath:
    """A polyline through `points` [n, 2] in metres, n at least 1.

    A stretch of it is (first, last) in metres from its start, along the path.
    """

    def __init__(self, points):
        given = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        new = np.any(np.diff(given, axis=0) != 0.0, axis=1)
        self.points = given[np.concatenate([[True], new])]
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        self.offsets = np.concatenate([[0.0], np.cumsum(steps)])
        self.length = float(self.offsets[-1])

    @cached_property
    def pieces(self):
        if len(self.points) == 1:
            return np.array([shapely.Point(self.points[0])])
        pairs = np.stack([self.points[:-1], self.points[1:]], axis=1)
        return np.asarray(shapely.linestrings(pairs))

    def stretches(self, geometry):
        shapely.prepare(geometry)
        near = np.flatnonzero(shapely.intersects(self.pieces, geometry))
        parts, owner = shapely.get_parts(
            shapely.intersection(self.pieces[near], geometry), return_index=True
        )
        points, part = shapely.get_coordinates(parts, return_index=True)
        piece = near[owner[part]]
        along = self.offsets[piece] + np.linalg.norm(points - self.points[piece], axis=1)
        first, last = np.full(len(parts), np.inf), np.full(len(parts), -np.inf)
        np.minimum.at(first, part, along)
        np.maximum.at(last, part, along)
        joined = []
        for begin, end in sorted(zip(first.tolist(), last.tolist(), strict=True)):
            if joined and begin - joined[-1][1] <= GAP:
                joined[-1] = joined[-1][0], max(end, joined[-1][1])
            else:
                joined.append((begin, end))
        return joined

    def length_in(self, geometry):
        return sum(last - first for first, last in self.stretches(geometry))

    def first_touch(self, geometry, after=0.0):
        found = (max(first, after) for first, last in self.stretches(geometry) if last >= after)
        return next(found, math.inf)

    def without_ends(self, ends):
        if ends <= 0.0 or len(self.points) == 1:
            return self.pieces
        if 2.0 * ends >= self.length:
            return self.pieces[:0]
        inner = (self.offsets > ends) & (self.offsets < self.length - ends)
        cuts = [self.point_at(ends), *self.points[inner], self.point_at(self.length - ends)]
        return np.asarray(shapely.linestrings(np.stack([cuts[:-1], cuts[1:]], axis=1)))

    def point_at(self, along):
        return np.array([np.interp(along, self.offsets, axis) for axis in self.points.T])

# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Paths and parts of the plane as the verification measures them.

A path is a polyline, an area a polygon with exact discs beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

# Radians. Segments that turn less than this are measured as one.
STRAIGHT = 1e-9
# Metres along the path that rounding may cost.
ROUNDING = 1e-9

# Less than any length of a segment.
TINY = 1e-300

Spans = NDArray[np.float64]
Vectors = NDArray[np.float64]
# The first and the last place of lines in something, float64 [n] each; last before first: nowhere.
Stretches = tuple[NDArray[np.float64], NDArray[np.float64]]
Parts = Callable[[Vectors, Vectors], Iterable[Stretches]]
# Metres. A path that lies no deeper in an area than this runs along its edge, and a stretch that
# is no longer is a rounding.
EDGE = 1e-6
# Sides of a quarter circle where an arc has to become a polygon: 0.075 mm off for 1 m of radius.
QUARTER_SIDES = 64
NOTHING = shapely.Polygon()


class PathError(LlmAstarError, ValueError):
    """A path that cannot be measured; the message says why."""


@dataclass(frozen=True, eq=False)
class Polyline:
    """A path through `corners`, float64 [n, 2] metres, n > 0; `at` is the length up to each.

    A place on it is given by the metres along it. Spans are float64 [n, 2], first and last place,
    in order and apart from each other; a span may be a single place.
    """

    corners: NDArray[np.float64]
    at: NDArray[np.float64]

    @property
    def length(self) -> float:
        """Metres."""
        return float(self.at[-1])

    @cached_property
    def segments(self) -> NDArray[np.object_]:
        """The straight parts as shapely lines [n - 1], or the one point of a path without any."""
        if len(self.corners) == 1:
            return np.array([shapely.Point(self.corners[0])], dtype=np.object_)
        pairs = np.stack((self.corners[:-1], self.corners[1:]), axis=1)
        lines: NDArray[np.object_] = shapely.linestrings(pairs)
        return lines

    @cached_property
    def shape(self) -> BaseGeometry:
        """All of it as one shapely line, or a point."""
        if len(self.corners) == 1:
            return shapely.Point(self.corners[0])
        return shapely.LineString(self.corners)

    def point(self, place: float) -> tuple[float, float]:
        """Return the point (x, y) at a place."""
        x = float(np.interp(place, self.at, self.corners[:, 0]))
        y = float(np.interp(place, self.at, self.corners[:, 1]))
        return x, y

    def part(self, first: float, last: float = math.inf) -> Polyline:
        """Return the path from a place to another, or to its end."""
        last = min(last, self.length)
        between = self.corners[(self.at > first) & (self.at < last)]
        return polyline(np.concatenate(([self.point(first)], between, [self.point(last)])))

    def spans_in_polygon(self, polygon: BaseGeometry) -> Spans:
        """Return where each segment lies in a polygon: what a cut leaves is straight on it."""
        if polygon.is_empty:
            return np.empty((0, 2))
        shapely.prepare(polygon)
        hit = np.flatnonzero(shapely.intersects(polygon, self.segments))
        cuts = shapely.intersection(self.segments[hit], polygon)
        pieces, owners = shapely.get_parts(cuts, return_index=True)
        points, piece = shapely.get_coordinates(pieces, return_index=True)
        if not len(points):
            return np.empty((0, 2))
        segment = hit[owners[piece]]
        places = self.at[segment] + np.hypot(*(points - self.corners[segment]).T)
        firsts = np.flatnonzero(np.diff(piece, prepend=-1))
        return np.column_stack(
            (np.minimum.reduceat(places, firsts), np.maximum.reduceat(places, firsts))
        )

    def spans_in_discs(self, discs: NDArray[np.float64]) -> Spans:
        """Return where each segment lies in each disc, float64 [n, 3]."""
        numbers = np.indices((len(self.segments), len(discs))).reshape(2, -1)
        x, y, radii = discs[numbers[1]].T
        return self.spans_in_convex(
            numbers[0],
            lambda begins, ahead: [in_disc(ahead, np.column_stack((x, y)) - begins, radii)],
        )

    def spans_in_convex(self, segment: NDArray[np.intp], parts: Parts) -> Spans:
        """Return where segments, of these numbers [n], lie in convex shapes, one for each.

        `parts` gives the stretches of the lines through the segments in parts of the shapes.
        """
        step, length = np.diff(self.corners, axis=0), np.diff(self.at)
        if not len(step):
            step, length = np.zeros((1, 2)), np.zeros(1)
        # Not by `length`, which is 0 for a step too small to count in the length so far.
        norms = np.maximum(np.hypot(*step.T), TINY)[:, None]
        ahead, length = (step / norms)[segment], length[segment]
        firsts, lasts = np.full(len(segment), np.inf), np.full(len(segment), -np.inf)
        for begin, end in parts(self.corners[segment], ahead):
            first, last = np.maximum(begin, 0.0), np.minimum(end, length)
            hit = first <= last
            firsts[hit] = np.minimum(firsts, first)[hit]
            lasts[hit] = np.maximum(lasts, last)[hit]
        hit = firsts <= lasts
        spans: Spans = self.at[segment[hit], None] + np.column_stack((firsts, lasts))[hit]
        return spans


def in_box(ahead: Vectors, low: Vectors, high: Vectors) -> Stretches:
    """Return where lines from the origin, all [n, 2], lie in boxes."""
    with np.errstate(divide='ignore', invalid='ignore'):
        one, other = low / ahead, high / ahead
    return np.fmin(one, other).max(axis=1), np.fmax(one, other).min(axis=1)


def in_disc(ahead: Vectors, centres: Vectors, radius: float | Vectors) -> Stretches:
    """Return where lines from the origin lie in discs around the centres, both [n, 2]."""
    along = (centres * ahead).sum(axis=1)
    across = np.hypot(*(centres - along[:, None] * ahead).T)
    half = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    return along - half, np.where(across <= radius, along + half, -np.inf)


def polyline(points: ArrayLike) -> Polyline:
    """Return the polyline through points [n, 2] in metres.

    Points that repeat the one before or lie on the straight way to the next are left out. Raises
    PathError where there is no point or a coordinate is not finite.
    """
    xy = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    if not len(xy):
        raise PathError('the path has no points')
    if not np.isfinite(xy).all():
        raise PathError('the path has a coordinate that is not finite')
    moved = (np.diff(xy, axis=0) != 0.0).any(axis=1)
    xy = xy[np.concatenate(([True], moved))]
    if len(xy) > 2:
        before, after = np.diff(xy, axis=0)[:-1].T, np.diff(xy, axis=0)[1:].T
        turn = np.abs(before[0] * after[1] - before[1] * after[0])
        onward = before[0] * after[0] + before[1] * after[1]
        xy = xy[np.concatenate(([True], ~(turn <= STRAIGHT * onward), [True]))]
    lengths = np.hypot(*np.diff(xy, axis=0).T) if len(xy) > 1 else np.empty(0)
    return Polyline(xy, np.concatenate(([0.0], np.cumsum(lengths))))


def joined(spans: Spans) -> Spans:
    """Return spans in order, those that meet made one."""
    if len(spans) < 2:
        return spans
    spans = spans[np.argsort(spans[:, 0], kind='stable')]
    reach = np.maximum.accumulate(spans[:, 1])
    begins = np.concatenate(([True], spans[1:, 0] > reach[:-1] + ROUNDING))
    ends = np.concatenate((begins[1:], [True]))
    return np.column_stack((spans[begins, 0], reach[ends]))


def total(spans: Spans) -> float:
    """Return the metres that spans cover."""
    return float((spans[:, 1] - spans[:, 0]).sum())


def first_from(spans: Spans, place: float) -> float:
    """Return the first place of the spans that is not before a place, inf if none."""
    ahead = spans[spans[:, 1] >= place - ROUNDING]
    return max(place, float(ahead[0, 0])) if len(ahead) else math.inf


@dataclass(frozen=True, eq=False)
class Area:
    """A polygon together with discs, as one closed set; metres, map frame.

    `discs` is float64 [n, 3]: x, y, radius. They stay exact, so that a path that touches a circle
    is told from one that crosses it.
    """

    polygon: BaseGeometry
    discs: NDArray[np.float64]

    @property
    def wall_distance(self) -> float:
        """How near to a wall everything in it is, 0 if it is not about walls."""
        return 0.0

    @property
    def has_size(self) -> bool:
        """Whether a path can lie in it: its area is not 0."""
        return bool(self.polygon.area > 0.0 or (self.discs[:, 2] > 0.0).any())

    @cached_property
    def outline(self) -> BaseGeometry:
        """All of it as one polygon, the circles approximated."""
        if not len(self.discs):
            return self.polygon
        x, y, radii = self.discs.T
        circles = shapely.buffer(
            shapely.points(x, y), np.maximum(radii, 0.0), quad_segs=QUARTER_SIDES
        )
        return shapely.union_all([self.polygon, *circles])

    def grown(self, by: float) -> Area:
        """Return all points within `by` metres, at least 0, of it; exactly.

        A polygon grown with straight cuts at its corners lacks just the arcs there, and a disc
        around each corner adds them.
        """
        if by <= 0.0 or (self.polygon.is_empty and not len(self.discs)):
            return self
        discs = self.discs + (0.0, 0.0, by)
        corners = np.unique(shapely.get_coordinates(self.polygon), axis=0)
        arcs = np.column_stack((corners, np.full(len(corners), by)))
        polygon = shapely.buffer(self.polygon, by, join_style='bevel', cap_style='flat')
        return Area(polygon, np.concatenate((discs, arcs)))

    def shrunk(self, by: float) -> Area:
        """Return all points of it that are at least `by` metres, at least 0, from its edge.

        Parts that overlap are shrunk one by one, which can only make the result smaller.
        """
        discs = self.discs - (0.0, 0.0, by)
        polygon = shapely.buffer(self.polygon, -by, join_style='mitre')
        return Area(polygon, discs[discs[:, 2] > 0.0])

    def spans(self, path: Polyline) -> Spans:
        """Return where a path lies in it, its edge included."""
        spans = [path.spans_in_polygon(self.polygon), path.spans_in_discs(self.discs)]
        return joined(np.concatenate(spans))

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points [n, 2] lie in it, those within EDGE of its edge included."""
        xy = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        shapely.prepare(self.polygon)
        inside: NDArray[np.bool_] = shapely.dwithin(self.polygon, shapely.points(xy), EDGE)
        for x, y, radius in self.discs:
            inside |= np.hypot(xy[:, 0] - x, xy[:, 1] - y) <= radius + EDGE
        return inside

    def distance(self, shape: BaseGeometry) -> float:
        """Return the metres from a shape to it, inf if it is empty."""
        distances = [math.inf]
        if not self.polygon.is_empty:
            distances.append(float(shapely.distance(self.polygon, shape)))
        if len(self.discs):
            centres = shapely.points(self.discs[:, :2])
            gaps = shapely.distance(centres, shape) - self.discs[:, 2]
            distances.append(max(0.0, float(gaps.min())))
        return min(distances)

    def nearest_point(self, shape: BaseGeometry) -> tuple[float, float]:
        """Return the point (x, y) of a shape that is nearest to it."""
        line = shapely.shortest_line(shape, self.outline)
        x, y = shapely.get_coordinates(line if line is not None else shape)[0]
        return float(x), float(y)


def outline_of(grid_map: GridMap) -> BaseGeometry:
    """Return the outline of a whole grid in the map's frame."""
    x, y = grid_map.width - 0.5, grid_map.height - 0.5
    return shapely.Polygon(grid_map.grid_to_world([(-0.5, -0.5), (x, -0.5), (x, y), (-0.5, y)]))


def polygon_area(shape: BaseGeometry) -> Area:
    """Return the polygons of a shape as an area; repairs invalid ones."""
    return Area(polygons_of(shape), np.empty((0, 3)))


def disc_area(x: float, y: float, radius: float) -> Area:
    """Return a disc."""
    return Area(NOTHING, np.array([[x, y, radius]], dtype=np.float64))


def together(areas: Iterable[Area]) -> Area:
    """Return several areas as one; polygons that share an edge have none between them."""
    parts = list(areas)
    if len(parts) == 1:
        return parts[0]
    discs = np.concatenate([np.empty((0, 3)), *(part.discs for part in parts)])
    return Area(shapely.union_all([part.polygon for part in parts]), discs)


def polygons_of(shape: BaseGeometry) -> BaseGeometry:
    """Return the polygons of a shape, repaired; empty where it has none or is not finite."""
    shape = shapely.force_2d(shape)
    if shape.is_empty or not np.isfinite(shapely.get_coordinates(shape)).all():
        return NOTHING
    parts = [
        part
        for part in shapely.get_parts(shapely.get_parts(shapely.make_valid(shape)))
        if part.geom_type == 'Polygon' and part.area > 0.0
    ]
    if len(parts) == 1:
        return parts[0]
    return shapely.union_all(parts) if parts else NOTHING

"""A path as a polyline in metres, measured against geometry along its own length."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

# Metres. A stretch that lies no deeper in a region than this lies on its edge.
EDGE = 1e-6
# Metres. Stretches with a smaller gap between them are one.
GAP = 1e-7

Stretch = tuple[float, float]


class MeasuredPath:
    """A polyline through `points` [n, 2] in metres, n at least 1.

    A stretch of it is (first, last) in metres from its start, along the path.
    """

    def __init__(self, points: ArrayLike, direct_length: float = math.nan) -> None:
        """Take the points; repeated ones are dropped.

        `direct_length` is the length of the path without instruction, in metres.
        """
        self.direct_length = direct_length
        given = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        new = np.any(np.diff(given, axis=0) != 0.0, axis=1)
        self.points = given[np.concatenate([[True], new])]
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        self.offsets: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(steps)])
        self.length = float(self.offsets[-1])

    @cached_property
    def pieces(self) -> NDArray[Any]:
        """The straight pieces as shapely lines; of a single point, that point."""
        if len(self.points) == 1:
            return np.array([shapely.Point(self.points[0])])
        pairs = np.stack([self.points[:-1], self.points[1:]], axis=1)
        return np.asarray(shapely.linestrings(pairs))

    def stretches(self, geometry: BaseGeometry) -> list[Stretch]:
        """Return where the path lies in closed geometry, in order, touching stretches joined."""
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
        joined: list[Stretch] = []
        for begin, end in sorted(zip(first.tolist(), last.tolist(), strict=True)):
            if joined and begin - joined[-1][1] <= GAP:
                joined[-1] = joined[-1][0], max(end, joined[-1][1])
            else:
                joined.append((begin, end))
        return joined

    def length_in(self, geometry: BaseGeometry) -> float:
        """Return the length in closed geometry, in metres."""
        return sum(last - first for first, last in self.stretches(geometry))

    def first_touch(self, geometry: BaseGeometry, after: float = 0.0) -> float:
        """Return how far along the path it first touches geometry from `after` on; inf: never."""
        found = (max(first, after) for first, last in self.stretches(geometry) if last >= after)
        return next(found, math.inf)

    def without_ends(self, ends: float) -> NDArray[Any]:
        """Return the pieces without the first and last `ends` metres; empty if nothing is left."""
        if ends <= 0.0 or len(self.points) == 1:
            return self.pieces
        if 2.0 * ends >= self.length:
            return self.pieces[:0]
        inner = (self.offsets > ends) & (self.offsets < self.length - ends)
        cuts = [self.point_at(ends), *self.points[inner], self.point_at(self.length - ends)]
        return np.asarray(shapely.linestrings(np.stack([cuts[:-1], cuts[1:]], axis=1)))

    def point_at(self, along: float) -> NDArray[np.float64]:
        """Return the point [2] at `along` metres from the start."""
        return np.array([np.interp(along, self.offsets, axis) for axis in self.points.T])


def opened(geometry: BaseGeometry) -> BaseGeometry:
    """Return geometry without its edge, so that what lies on the edge lies outside."""
    return geometry.buffer(-EDGE, join_style='mitre')

"""A path as a polyline, measured by the length along it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.instructions.verification.area import Area

# Radians. Segments that turn less than this are measured as one.
STRAIGHT = 1e-9
# Metres along the path that rounding may cost.
ROUNDING = 1e-9

Spans = NDArray[np.float64]


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

    def spans_in(self, area: Area) -> Spans:
        """Return where the path lies in an area, its edge included."""
        return joined(area.spans_of(self))

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
        """Return where each segment lies in each disc, float64 [n, 3], by its quadratic."""
        if not len(discs):
            return np.empty((0, 2))
        begins = self.corners[: max(1, len(self.corners) - 1), None]
        lengths = np.diff(self.at, append=self.at[-1])[: len(begins), None]
        steps = np.diff(self.corners, axis=0, append=self.corners[-1:])[: len(begins), None]
        ahead = steps / np.where(lengths > 0.0, lengths, 1.0)[..., None]
        to_centre = discs[:, :2] - begins
        along = (to_centre * ahead).sum(axis=-1)
        off = np.where(
            lengths > 0.0,
            ahead[..., 0] * to_centre[..., 1] - ahead[..., 1] * to_centre[..., 0],
            np.hypot(*np.moveaxis(to_centre, -1, 0)),
        )
        half = np.sqrt(np.maximum(discs[:, 2] ** 2 - off**2, 0.0))
        first, last = np.maximum(along - half, 0.0), np.minimum(along + half, lengths)
        hit = (np.abs(off) <= discs[:, 2]) & (first <= last)
        begin_at = np.broadcast_to(self.at[: len(begins), None], hit.shape)[hit]
        return np.column_stack((begin_at + first[hit], begin_at + last[hit]))


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

"""Parts of the plane as the verification measures them: polygons with exact discs beside them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

if TYPE_CHECKING:
    from llm_astar_planner.instructions.verification.polyline import Polyline

# Metres. A path that lies no deeper in an area than this runs along its edge.
EDGE = 1e-6
# Sides of a quarter circle where an arc has to become a polygon: 0.075 mm off for 1 m of radius.
QUARTER_SIDES = 64
NOTHING = shapely.Polygon()


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
        if self.polygon.is_empty and len(circles) == 1:
            return circles[0]
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

    def spans_of(self, path: Polyline) -> NDArray[np.float64]:
        """Return where a path lies in it, its edge included; spans as in Polyline."""
        spans = [path.spans_in_polygon(self.polygon), path.spans_in_discs(self.discs)]
        return np.concatenate(spans)

    def contains_inside(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points [n, 2] lie in it and not on its edge."""
        x, y = np.asarray(points, dtype=np.float64).reshape(-1, 2).T
        inside: NDArray[np.bool_] = shapely.contains_xy(self.polygon, x, y)
        for centre_x, centre_y, radius in self.discs:
            inside |= np.hypot(x - centre_x, y - centre_y) < radius
        return inside

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points [n, 2] lie in it, those within EDGE of its edge included."""
        xy = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        inside = np.zeros(len(xy), dtype=np.bool_)
        if not self.polygon.is_empty:
            shapely.prepare(self.polygon)
            inside |= shapely.dwithin(self.polygon, shapely.points(xy), EDGE)
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


def polygon_area(shape: BaseGeometry) -> Area:
    """Return the polygons of a shape as an area; repairs invalid ones."""
    return Area(polygons_of(shape), np.empty((0, 3)))


def disc_area(x: float, y: float, radius: float) -> Area:
    """Return a disc."""
    return Area(NOTHING, np.array([[x, y, radius]], dtype=np.float64))


def together(areas: Iterable[Area]) -> Area:
    """Return several areas as one; polygons that share an edge have none between them."""
    parts = list(areas)
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

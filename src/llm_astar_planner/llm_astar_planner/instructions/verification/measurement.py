# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What every check of a clause needs: the path, the map, and how an outcome is worded."""

import math
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from llm_astar_planner.instructions.clauses.clause import SHOULD, Clause
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.outcome import ClauseOutcome, as_length, as_point, broken
from llm_astar_planner.instructions.regions import Region
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification import geometry
from llm_astar_planner.instructions.verification import regions as placed
from llm_astar_planner.instructions.verification.reference import Reference
from llm_astar_planner.instructions.verification.walls import Walls

# What a path may have over the least possible, besides one cell.
EXCESS = 1.05
Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Measurement:
    """One path, held against the clauses of one specification."""

    specification: Specification
    path: geometry.Polyline
    route: Route
    deadline: float = math.inf

    @cached_property
    def drive(self) -> geometry.Polyline:
        """The way driven so far and then the path: what order and number are judged on."""
        return geometry.polyline(np.concatenate((self.route.driven, self.path.corners)))

    @cached_property
    def begin(self) -> float:
        """Where on the drive the path begins."""
        return geometry.polyline(np.concatenate((self.route.driven, self.path.corners[:1]))).length

    @cached_property
    def walls(self) -> Walls:
        """The map's walls."""
        return Walls(self.route.costmap)

    @cached_property
    def regions(self) -> placed.Regions:
        """Where regions lie."""
        return placed.Regions(self.route, self.walls)

    @cached_property
    def reference(self) -> Reference:
        """The reference searches; with a clause that says where to end they may end there."""
        return Reference(self.route, self.walls, self.end, self.deadline)

    @cached_property
    def end(self) -> geometry.Area | None:
        """Where a clause asks the path to end, None without such a clause."""
        for clause in reversed(self.specification.clauses):
            if isinstance(clause, EndAt):
                with suppress(placed.RegionError):
                    return self.regions.resolve(clause.region).ends
        return None

    @property
    def start(self) -> Point:
        """The path's first point."""
        return self.path.point(0.0)

    @property
    def goal(self) -> Point:
        """The path's last point."""
        return self.path.point(self.path.length)

    def sized(self, region: Region) -> placed.Resolved:
        """Return where a region lies. Raises RegionError if it does not exist or has no area."""
        found = self.regions.resolve(region)
        placed.require_size(found.area)
        return found

    def ends_in(self, spans: geometry.Spans) -> list[bool]:
        """Tell for the ends that every path has whether spans of this one hold them.

        The first point, and the last unless a clause sets it.
        """
        first, last = (spans[0, 0], spans[-1, 1]) if len(spans) else (math.inf, -math.inf)
        ends = [first <= geometry.ROUNDING, last >= self.path.length - geometry.ROUNDING]
        return ends if self.end is None else ends[:1]

    def on_map(self, area: geometry.Area) -> bool:
        """Tell whether any of an area lies on the map."""
        return area.wall_distance > 0.0 or area.distance(self.regions.map_outline) <= 0.0

    def unreachable_reason(self, area: geometry.Area) -> str:
        """Say why no path can touch an area, '' if one can."""
        if not area.has_size:
            return placed.NO_AREA
        if not self.on_map(area):
            return 'the region lies off the map'
        if not self.reference.can_touch(area, self.reference.reachable):
            return 'no free cell of it can be reached'
        return ''

    def allowed(self, least: float) -> float:
        """Return the metres a path may have in a region where `least` are needed; 0 for NaN.

        Where none are needed none are allowed.
        """
        resolution = self.route.costmap.grid_map.resolution
        return EXCESS * least + resolution if least > geometry.EDGE else 0.0

    def broken_by(
        self, clause: Clause, metres: float, side: str, where: Point, least: float, **how: bool
    ) -> ClauseOutcome:
        """Return the outcome of a clause that so many metres of a path violate.

        A wish is kept as far as possible by the least that any path has.
        """
        possible = ''
        if least > 0.0:
            is_least = as_length(metres) == as_length(least)
            possible = ', the least possible' + ('' if is_least else f' is {as_length(least)}')
        detail = f'{as_length(metres)} {side}{possible}, from {as_point(where)}'
        if clause.strength == SHOULD:
            how = {'is_least': metres <= self.allowed(least)}
        return broken(clause, detail, metres, where, least, **how)

    def place_text(self, place: float) -> str:
        """Return a place of the drive as details show it: '4.1, 3.0', and if it was driven."""
        driven = ' on the way driven' if place < self.begin else ''
        return as_point(self.drive.point(place)) + driven

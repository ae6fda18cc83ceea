"""What every check of a clause needs: the path, the map, and how an outcome is worded."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification.geometry import Area, Polyline, Spans
from llm_astar_planner.instructions.verification.reference import Reference
from llm_astar_planner.instructions.verification.regions import RegionError, Regions
from llm_astar_planner.instructions.verification.walls import Walls

# Metres in a region that are no more than rounding.
NEGLIGIBLE = 1e-6
# What a path may have over the least possible, besides one cell.
EXCESS = 1.05
Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Measurement:
    """One path, held against the clauses of one specification."""

    specification: Specification
    path: Polyline
    route: Route
    deadline: float = math.inf

    @cached_property
    def walls(self) -> Walls:
        """The map's walls."""
        return Walls(self.route.costmap, self.path)

    @cached_property
    def regions(self) -> Regions:
        """Where regions lie."""
        return Regions(self.route, self.walls)

    @cached_property
    def reference(self) -> Reference:
        """The reference searches; with a clause that says where to end they may end there."""
        return Reference(self.route, self.walls, self.end, self.deadline)

    @cached_property
    def end(self) -> Area | None:
        """Where a clause asks the path to end, None without such a clause."""
        end: Area | None = None
        for clause in self.specification.clauses:
            if isinstance(clause, EndAt) and not clause.unsure:
                try:
                    end = self.regions.resolve(clause.region).ends
                except RegionError:
                    continue
        return end

    @property
    def start(self) -> Point:
        """The path's first point."""
        return self.path.point(0.0)

    @property
    def goal(self) -> Point:
        """The path's last point."""
        return self.path.point(self.path.length)

    @property
    def fixed_ends(self) -> list[Point]:
        """The ends that every path has: the first point, and the last unless a clause sets it."""
        return [self.start, self.goal] if self.end is None else [self.start]

    def on_map(self, area: Area) -> bool:
        """Tell whether any of an area lies on the map."""
        if area.wall_distance > 0.0:
            return True
        return area.distance(self.regions.map_outline) <= 0.0

    def allowed(self, least: float) -> float:
        """Return the metres a path may have in a region where `least` are needed; 0 for NaN.

        Where none are needed none are allowed.
        """
        if math.isnan(least) or least <= NEGLIGIBLE:
            return 0.0
        return EXCESS * least + self.route.costmap.grid_map.resolution

    def first_point(self, spans: Spans) -> Point:
        """Return the point at which spans begin."""
        return self.path.point(float(spans[0, 0]))


def satisfied(
    clause: Clause, detail: str, measured: float = 0.0, least: float = 0.0
) -> ClauseOutcome:
    """Return the outcome of a clause that a path satisfies."""
    return ClauseOutcome(clause, ClauseStatus.KEPT, detail, measured, least)


def violated(
    clause: Clause,
    detail: str,
    measured: float,
    where: Point,
    least: float = math.nan,
    *,
    impossible: bool = False,
) -> ClauseOutcome:
    """Return the outcome of a clause that a path violates, impossible or not."""
    status = ClauseStatus.IMPOSSIBLE if impossible else ClauseStatus.NOT_KEPT
    return ClauseOutcome(clause, status, detail, measured, least, where)


def no_size(clause: Clause) -> ClauseOutcome:
    """Return the outcome of a clause about a region that holds nothing."""
    return ClauseOutcome(clause, ClauseStatus.NOT_UNDERSTOOD, 'the region has no area')


def length_text(metres: float) -> str:
    """Return a length as details show it: '2.3 m', and '0.004 m' where that says more."""
    decimals = 1 if metres >= 0.1 or metres <= NEGLIGIBLE else 3
    return f'{metres:.{decimals}f} m'


def point_text(point: Point) -> str:
    """Return a point as details show it: '4.1, 3.0'."""
    return f'{point[0]:.1f}, {point[1]:.1f}'

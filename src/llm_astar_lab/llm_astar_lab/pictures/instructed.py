# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A path with its instruction: the regions, where the path violates them, what it visited.

These are what the verification measured; pictures and the page draw them.
"""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus, InstructionOutcome
from llm_astar_planner.instructions.regions import WALLS, Along
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.verification.geometry import Area, polyline
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.regions import RegionError
from llm_astar_planner.instructions.verification.visit import attempts
from llm_astar_planner.planning.types import Plan
from numpy.typing import NDArray

# What a path falls short of, the worst first.
SHORT = (ClauseStatus.NOT_KEPT, ClauseStatus.IMPOSSIBLE, ClauseStatus.AS_FAR_AS_POSSIBLE)


@dataclass(frozen=True, eq=False)
class InstructedPath:
    """A path with what became of its instruction; `points` [n, 2], n > 0, are metres."""

    outcome: InstructionOutcome
    route: Route
    points: NDArray[np.float64]

    @cached_property
    def measurement(self) -> Measurement:
        """The path as the verification measures it."""
        specification = self.outcome.interpretation.specification
        return Measurement(specification, polyline(self.points), self.route)

    def shown_areas(self, clause: Clause) -> Iterator[Area]:
        """Yield the areas that a clause is about; those of unknown names are left out."""
        regions, reach = self.measurement.regions, reach_of(clause)
        resolve = regions.resolve_avoided if isinstance(clause, Avoid) else regions.resolve
        for region in clause.regions:
            # All walls together cannot be drawn as a region.
            if not (isinstance(region, Along) and region.place == WALLS):
                with suppress(RegionError):
                    area = resolve(region).area
                    yield area.grown(reach) if reach else area
        if clause.is_closed and not clause.regions:
            yield self.measurement.walls.zone(reach)

    def violating_parts(self, outcome: ClauseOutcome) -> Iterator[NDArray[np.float64]]:
        """Yield the stretches of the path, points [n, 2], that violate a clause about lengths."""
        is_closed, is_bound = outcome.clause.is_closed, isinstance(outcome.clause, StayIn)
        if outcome.status not in SHORT or not (is_closed or is_bound):
            return
        path = self.measurement.path
        for area in self.shown_areas(outcome.clause):
            spans = area.spans(path)
            if is_bound:
                edges = np.concatenate(([0.0], spans.ravel(), [path.length]))
                spans = edges.reshape(-1, 2)
            for first, last in spans:
                if last > first:
                    yield path.part(first, last).corners

    def visited_points(self) -> Iterator[tuple[float, float]]:
        """Yield the points at which the path visits regions, in the order of the clauses."""
        for group in attempts(self.measurement):
            for attempt in group:
                if attempt.done and attempt.place >= self.measurement.begin:
                    yield self.measurement.drive.point(attempt.place)


def reach_of(clause: Clause) -> float:
    """Return how many metres around its regions a path is not to come."""
    reach = getattr(clause, 'metres', 0.0) or getattr(clause, 'margin', 0.0)
    return float(reach) if clause.is_closed else 0.0


def instructed_path(plan: Plan, route: Route) -> InstructedPath | None:
    """Return a plan's path with its instruction, None where it lacks one of them."""
    # The path that leaves the planner, on which the instruction is verified too.
    points = plan.path if plan.any_angle is None else plan.any_angle.points
    if plan.instruction is None or not len(plan.path):
        return None
    return InstructedPath(plan.instruction, route, route.costmap.grid_map.grid_to_world(points))

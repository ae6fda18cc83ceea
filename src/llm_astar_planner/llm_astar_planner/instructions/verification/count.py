# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""count: how often the path enters a region."""

import math

from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.count import Count
from llm_astar_planner.instructions.outcome import ClauseOutcome, broken, kept
from llm_astar_planner.instructions.verification.geometry import EDGE, Area, Spans, first_from
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.reference import grown_by_a_cell

# Cells. Who was no farther away than this has not left a region.
LEFT = 1.5


def check(measurement: Measurement, clause: Count, _: int) -> ClauseOutcome:
    """Count the stays at a region that go as deep into it as a visit."""
    region = measurement.sized(clause.region)
    around = region.entered.grown(LEFT * measurement.route.costmap.grid_map.resolution)
    stays = around.spans(measurement.drive)
    most = math.inf if clause.at_most is None else clause.at_most
    entries = entries_of(measurement, region.visited, stays)
    deep = region.visited.shrunk(2.0 * EDGE)
    if len(entries) > most:  # to touch the depth of a visit alone need not count
        entries = entries_of(measurement, deep, stays)
    often = {0: 'not entered', 1: 'entered once'}
    detail = often.get(len(entries), f'entered {len(entries)} times')
    if entries:
        detail += f', at {" and ".join(measurement.place_text(entry) for entry in entries)}'
    if clause.at_least <= len(entries) <= most:
        return kept(clause, detail)
    if len(entries) < clause.at_least:
        reason = measurement.unreachable_reason(region.visited)
        point = region.visited.nearest_point(measurement.drive.shape)
        return broken(clause, reason or detail, math.nan, point, impossible=bool(reason))
    fewest = fewest_entries(measurement, deep, around)
    is_least = clause.strength == SHOULD and len(entries) <= fewest
    detail += ', the least possible' if is_least else ''
    point, impossible = measurement.drive.point(entries[int(most)]), fewest > most
    return broken(clause, detail, math.nan, point, impossible=impossible, is_least=is_least)


def entries_of(measurement: Measurement, visited: Area, stays: Spans) -> list[float]:
    """Return the places at which an area is visited first in each stay that visits it."""
    visits = visited.spans(measurement.drive)
    found = ((first_from(visits, first), last) for first, last in stays)
    return [entry for entry, last in found if entry <= last]


def fewest_entries(measurement: Measurement, visited: Area, around: Area) -> int:
    """Return a number of entries that no path has fewer of; 0 after a way driven."""
    reference, goals = measurement.reference, measurement.reference.goal_mask
    if not reference.small_enough or len(measurement.route.driven):
        return 0
    deep, far = reference.inside(visited), ~reference.cells_in(around)
    cells, count, known = reference.start_mask, 0, 0
    while known < (known := int(cells.sum())):
        outside = cells | (reference.reach(deep, starts=cells) > 0)
        if (outside & goals).any():
            return count
        count += 1
        cells = outside | (reference.reach(far, starts=grown_by_a_cell(outside)) > 0)
        if (cells & goals).any():
            return count
    return 0

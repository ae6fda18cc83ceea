"""avoid: the metres of the path in a region and its margin."""

from __future__ import annotations

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.outcome import ClauseOutcome
from llm_astar_planner.instructions.regions import WALLS, Along
from llm_astar_planner.instructions.verification.geometry import EDGE, Area, total
from llm_astar_planner.instructions.verification.measurement import (
    NEGLIGIBLE,
    NO_AREA,
    Measurement,
    as_far,
    broken,
    is_walls,
    kept,
    metres_text,
)
from llm_astar_planner.instructions.verification.regions import RegionError


def check(measurement: Measurement, clause: Avoid, _: int) -> ClauseOutcome:
    """Measure the metres of a path in a region and its margin.

    None is kept, even where start or goal lies inside; a wish is kept as far as possible by the
    least that any path has there.
    """
    area = avoided_area(measurement, clause)
    if not area.has_size:
        raise RegionError(NO_AREA)
    reference = measurement.reference
    spans = area.spans(measurement.path)
    metres = total(spans)
    ends_inside = bool(area.contains_inside(measurement.fixed_ends).any())
    if metres <= NEGLIGIBLE and not ends_inside:
        off = '' if measurement.on_map(area) else ', the region lies off the map'
        return kept(clause, f'0.0 m inside{off}')
    least, where = reference.least_inside(area), measurement.first_point(spans)
    detail = metres_text(metres, 'inside', least, where)
    if clause.strength == SHOULD:
        judged = as_far if metres <= measurement.allowed(least) else broken
        return judged(clause, detail, metres, where, least)
    impossible = ends_inside or (
        reference.small_enough and reference.separates(reference.inside(area))
    )
    return broken(clause, detail, metres, where, least, impossible=impossible)


def avoided_area(measurement: Measurement, clause: Avoid) -> Area:
    """Return the region to avoid with its margin, without its edge; it may have no size."""
    if is_walls(clause.region):
        strip = Along(WALLS, clause.region.width + clause.margin)
        return measurement.regions.resolve(strip).area.shrunk(EDGE)
    region = measurement.regions.resolve_avoided(clause.region).area
    if clause.margin > EDGE and region.has_size:
        return region.grown(clause.margin - EDGE)
    return region.shrunk(EDGE)

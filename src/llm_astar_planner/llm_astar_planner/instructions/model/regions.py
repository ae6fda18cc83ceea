"""The regions of a clause."""

from __future__ import annotations

from llm_astar_planner.instructions.specification import Before, Clause, Region, Visit


def regions_of(clause: Clause) -> tuple[Region, ...]:
    """Return the regions of a clause."""
    if isinstance(clause, Visit):
        return clause.regions
    if isinstance(clause, Before):
        return clause.first, clause.second
    region = getattr(clause, 'region', None)
    return (region,) if isinstance(region, Region) else ()

"""The sample that a report draws, one of about median saving, planned again by a few methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.search.methods import GUIDED, SEARCH_METHODS
from llm_astar_planner.search.result import describe_expansions
from numpy.typing import NDArray

from llm_astar_lab.analysis.summary import by_variant, is_baseline
from llm_astar_lab.pictures.animation import AnimatedSearch
from llm_astar_lab.pictures.figures import (
    Picture,
    describe_length,
    drawable_map,
    picture_of,
)
from llm_astar_lab.pictures.retrace import retrace
from llm_astar_lab.report.sentences import variant_label
from llm_astar_lab.results.row import PAPER_ASTAR, WAYPOINTS_ONLY, Row, Variant, parse_points
from llm_astar_lab.runner.engine import SearchSettings, request_again

# The part of the samples on each side of the median that count as about median.
AROUND = 0.05


@dataclass(frozen=True)
class DrawnSample:
    """One sample planned by several methods: their pictures, and their animations if known."""

    where: str
    pictures: list[Picture]
    searches: list[AnimatedSearch]


def draw_median(
    rows: Sequence[Row], maps: Sequence[ProblemMap], settings: SearchSettings
) -> DrawnSample | None:
    """Plan a sample of about median saving again: no extreme one. None where there is none.

    A plan is drawn by planning again, without an instruction.
    """
    stored = {item.id: len(item.samples) for item in maps}
    drawable = [row for row in rows if row.pair < stored.get(row.map, 0) and not row.instruction]
    chosen = median_rows(drawable)
    if not chosen:
        return None
    problem = next(item for item in maps if item.id == chosen[0].map)
    pictures, searches = [], []
    for row in chosen:
        picture, search = drawn_row(problem, row, settings)
        pictures.append(picture)
        searches += [] if search is None else [search]
    where = (
        f'Map {chosen[0].map}, pair {chosen[0].pair}, the largest sample of about median saving'
    )
    return DrawnSample(where, pictures, searches if len(searches) == len(pictures) else [])


def drawn_row(
    problem: ProblemMap, row: Row, settings: SearchSettings
) -> tuple[Picture, AnimatedSearch | None]:
    """Plan a row again; return its picture, and its animation if the order is known."""
    sample = problem.samples[row.pair]
    planner, request = request_again(problem, sample, row, settings)
    plan = planner.plan(request)
    grid_map = drawable_map(planner.grid_map, settings.costmap)
    picture = picture_of(
        plan, grid_map, plan.start, plan.goal, problem.offset, costmap=planner.costmap
    )
    name, length = variant_label(row.variant), describe_length(plan, grid_map.resolution)
    title = f'{name}\n{length}, {describe_expansions(plan.expansions)}'
    picture = replace(picture, title=title, recorded=cells_of(row.recorded_path))
    order = retrace(planner, request, plan)
    return picture, None if order is None else AnimatedSearch(picture, order, name, length)


def cells_of(path: str) -> NDArray[np.float64]:
    """Return the turning points of a path as written in a row: float [n, 2]."""
    return np.array(parse_points(path), dtype=float).reshape(-1, 2)


def median_rows(rows: Sequence[Row]) -> list[Row]:
    """Return the rows to draw, of one sample: A*, another method, and `guided`.

    The other method is LLM-A*, with a model's waypoints if there are any; `guided` has the same.
    Of the samples whose saving is about the median it is the one that A* expands most on.
    """
    variants = by_variant(rows)
    compared = [
        variant
        for variant in variants
        if variant.method not in (PAPER_ASTAR.method, WAYPOINTS_ONLY)
        and SEARCH_METHODS.problem(variant.method) is None
    ]
    base = variants.get(PAPER_ASTAR)
    if base is None or not compared:
        return []
    chosen = min(compared, key=rank)
    ratios = {
        sample: row.operation / base[sample].operation
        for sample, row in variants[chosen].items()
        if row.found and sample in base and base[sample].found
    }
    if not ratios:
        return []
    ranked = sorted(ratios, key=ratios.__getitem__)
    middle, spread = len(ranked) // 2, round(AROUND * len(ranked))
    near = ranked[max(0, middle - spread) : middle + spread + 1]
    # The largest of those in the middle, for there is something to see.
    sample = max(near, key=lambda key: base[key].operation)
    shown = [PAPER_ASTAR, chosen]
    guided = [item for item in compared if item.method == GUIDED and item != chosen]
    shown += sorted(guided, key=lambda item: (item[1:] != chosen[1:], rank(item)))[:1]
    found = [variants[variant].get(sample) for variant in shown]
    return [row for row in found if row is not None and row.found]


def rank(variant: Variant) -> tuple[bool, bool, bool, bool, bool]:
    """Return the sort key by which a variant is drawn: LLM-A* with a model's waypoints first."""
    return (
        variant.source == 'none',
        is_baseline(variant),
        variant.source != 'oracle',
        variant.method != 'llm_astar',
        variant.method != GUIDED,
    )

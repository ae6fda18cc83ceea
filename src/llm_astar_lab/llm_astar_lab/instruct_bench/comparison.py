# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Whether two specifications ask the same: compared as normalised clauses.

Normalised, places have their own names instead of aliases, defaults are written out, boxes that
reach the map's edge are open, one avoided tag is each of its places (any of several regions each
of these), and a distance to keep from a region is a region to avoid with that margin. The order
counts among visits alone. The words of unknown parts and the questions of unsure clauses do not
count.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Iterator

from llm_astar_planner.instructions import regions as forms
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.specification import Specification

from llm_astar_lab.instruct_bench.maps import SuiteMap, find_place, find_tagged

# Of lengths in metres: nobody asks for less than a centimetre.
DIGITS = 2
# What clauses say besides their regions.
FACTS = ('side', 'at_least', 'at_most')

# Visits in order, and the other clauses in any order.
NormalForm = tuple[tuple[Hashable, ...], frozenset[Hashable]]


def same_specification(
    specification: Specification, accepted: Iterable[Specification], suite_map: SuiteMap
) -> bool:
    """Tell whether a specification asks the same as one of the accepted ones."""
    try:
        found = normal_form(specification, suite_map)
    except ValueError:  # it names what is not on the map
        return False
    return any(found == normal_form(other, suite_map) for other in accepted)


def normal_form(specification: Specification, suite_map: SuiteMap) -> NormalForm:
    """Return the normal form. Raises SuiteError for a place or tag that the map does not have."""
    visits: list[Hashable] = []
    others: set[Hashable] = set()
    for clause in specification.clauses:
        keys = list(clause_keys(clause, suite_map))
        if isinstance(clause, Visit):
            visits += keys
        else:
            others.update(keys)
    return tuple(visits), frozenset(others)


def clause_keys(clause: Clause, suite_map: SuiteMap) -> Iterator[Hashable]:
    """Yield what a clause is compared by, several for an avoided tag. Raises SuiteError."""
    kind, strength = clause.kind, clause.strength
    match clause:
        case Unknown():
            yield kind
        case Avoid(region=forms.Along(place, width), margin=0.0) if place == forms.WALLS:
            yield KeepDistance.kind, strength, round(width, DIGITS)
        case KeepDistance(metres=metres, region=None):
            yield kind, strength, round(metres, DIGITS)
        case KeepDistance(metres=metres, region=forms.Region() as region):
            yield from avoid_keys(region, metres, strength, suite_map)
        case Avoid(region=region, margin=margin):
            yield from avoid_keys(region, margin, strength, suite_map)
        case Visit(regions=regions):
            yield kind, strength, frozenset(region_key(region, suite_map) for region in regions)
        case _:
            keys = (region_key(region, suite_map) for region in clause.regions)
            yield kind, strength, *keys, *(getattr(clause, name, None) for name in FACTS)


def avoid_keys(
    region: forms.Region, margin: float, strength: str, suite_map: SuiteMap
) -> Iterator[Hashable]:
    """Yield what an avoided region is compared by: each place of a tag, a disc with its margin."""
    if isinstance(region, forms.Disc):
        radius = region.radius + margin or forms.AVOID_RADIUS
        region, margin = forms.Disc(region.x, region.y, radius), 0.0
    for part in parts_of(region, suite_map):
        yield Avoid.kind, strength, region_key(part, suite_map), round(margin, DIGITS)


def parts_of(region: forms.Region, suite_map: SuiteMap) -> list[forms.Region]:
    """Return the regions that one joins: each place of a tag, without those that are excepted."""
    match region:
        case forms.Tagged(tag):
            tagged = find_tagged(tag, 'tag', suite_map.places)
            return [forms.NamedPlace(place.name) for place in tagged]
        case forms.AnyOf(regions):
            return [part for one in regions for part in parts_of(one, suite_map)]
        case forms.Except(inner, others):
            within = parts_of(inner, suite_map)
            without = parts_of(forms.AnyOf(others), suite_map)
            keys = {region_key(part, suite_map) for part in without}
            if keys <= {region_key(part, suite_map) for part in within}:
                return [part for part in within if region_key(part, suite_map) not in keys]
    return [region]


def region_key(region: forms.Region, suite_map: SuiteMap) -> Hashable:
    """Return what a region is compared by. Raises SuiteError for an unknown place or tag."""
    places = suite_map.places
    parts = parts_of(region, suite_map)
    if parts != [region]:
        keys = frozenset(region_key(part, suite_map) for part in parts)
        return next(iter(keys)) if len(keys) == 1 else keys
    key: Hashable = region
    match region:
        case forms.NamedPlace(name):
            key = forms.NamedPlace(find_place(name, 'place', places).name)
        case forms.AllOf(regions):
            key = forms.AllOf, frozenset(region_key(one, suite_map) for one in regions)
        case forms.Except(inner, others):
            without = region_key(forms.AnyOf(others), suite_map)
            key = forms.Except, region_key(inner, suite_map), without
        case forms.Disc(x, y, radius):
            values = (x, y, radius or forms.VISIT_RADIUS)
            key = forms.Disc(*(round(value, DIGITS) for value in values))
        case forms.Box():
            key = opened_box(region, suite_map)
        case forms.Half(side, of) if of:
            key = forms.Half(side, find_place(of, 'of', places).name)
        case forms.Between(first, second):
            key = frozenset(find_place(name, 'between', places).name for name in (first, second))
        case forms.Along(place, width):
            name = place if place == forms.WALLS else find_place(place, 'along', places).name
            key = forms.Along(name, round(width, DIGITS))
    return key


def opened_box(box: forms.Box, suite_map: SuiteMap) -> forms.Box:
    """Return a box with the sides open that reach the map's edge, to within a cell."""
    cell, extent = suite_map.grid_map.resolution, suite_map.extent
    # The upper sides with the other sign, so that low is open for all.
    sides = (box.x0, box.y0, -box.x1, -box.y1)
    edges = (extent[0], extent[1], -extent[2], -extent[3])
    x0, y0, x1, y1 = (
        -math.inf if side <= edge + cell else round(side, DIGITS)
        for side, edge in zip(sides, edges)
    )
    return forms.Box(x0, y0, -x1, -y1)

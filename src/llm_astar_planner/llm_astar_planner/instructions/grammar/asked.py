"""Clauses from what was selected: what 'avoid', 'keep away from' and 'visit' make of regions."""

from __future__ import annotations

from dataclasses import dataclass

from llm_astar_planner.instructions.grammar.regions import Selection, Unclear
from llm_astar_planner.instructions.specification import (
    MAX_METRES,
    WALLS,
    Along,
    Avoid,
    Before,
    Clause,
    Disc,
    Half,
    KeepDistance,
    Region,
    Visit,
)

Things = tuple[Selection, ...]


@dataclass(frozen=True)
class Reading:
    """What one clause of an instruction says.

    `things` are regions without a verb; `is_negative` where a 'not' stands before them.
    """

    clauses: tuple[Clause, ...] = ()
    things: Things = ()
    is_negative: bool = False


def visit_of(things: Things) -> Visit:
    """Return the visit of all things, in any order. Raises Unclear."""
    regions: list[Region] = []
    for thing in things:
        if thing.is_walls:
            raise Unclear('walls cannot be visited')
        regions += [thing.one] if thing.any_one else thing.regions
    return Visit(regions=tuple(regions))


def avoid_of(things: Things, metres: float = 0.0) -> tuple[Clause, ...]:
    """Return what avoids all things. Raises Unclear."""
    clauses: list[Clause] = []
    for thing in things:
        if thing.any_one == 'one':
            raise Unclear('which one is to be avoided')
        if thing.is_walls:
            clauses.append(KeepDistance(metres=positive(metres)))
        elif thing.is_point and metres:
            clauses.append(Avoid(region=with_radius(thing, metres)))
        else:
            regions = thing.regions if thing.together is None else (thing.together,)
            clauses += [Avoid(region=region, margin=metres) for region in regions]
    return tuple(clauses)


def distance_of(things: Things, metres: float) -> tuple[Clause, ...]:
    """Return what keeps a distance from all things. Raises Unclear."""
    clauses: list[Clause] = []
    for thing in things:
        if thing.any_one == 'one':
            raise Unclear('a distance from which one')
        if thing.is_walls:
            clauses.append(KeepDistance(metres=positive(metres)))
        elif thing.is_point:
            clauses.append(Avoid(region=with_radius(thing, positive(metres))))
        else:
            regions = thing.regions if thing.together is None else (thing.together,)
            clauses += [KeepDistance(metres=positive(metres), region=one) for one in regions]
    return tuple(clauses)


def befores(firsts: Things, seconds: Things) -> tuple[Clause, ...]:
    """Return that each of the second things is entered after each of the first ones."""
    if any(two.is_all for two in seconds):
        raise Unclear('some of them or none')
    each = [
        region
        for one in firsts
        for region in ((one.one,) if one.any_one or not one.is_group else one.regions)
    ]
    return tuple(Before(first=first, second=two.one) for two in seconds for first in each)


def with_radius(thing: Selection, metres: float) -> Disc:
    """Return a point as a disc."""
    point = thing.one
    if not isinstance(point, Disc):
        raise Unclear('no point')
    return Disc(point.x, point.y, metres)


def positive(metres: float) -> float:
    """Return a distance. Raises Unclear where there is none."""
    if not 0.0 < metres <= MAX_METRES:
        raise Unclear('no distance that can be kept')
    return metres


def strip_along(thing: Selection, metres: float) -> Along:
    """Return the strip around a place or the walls."""
    return Along(WALLS if thing.is_walls else thing.place.name, positive(metres))


def all_objects(thing: Selection) -> bool:
    """Whether a selection is of objects."""
    return bool(thing.places) and all(place.is_object for place in thing.places)


def refuse_half_of_object(thing: Selection) -> None:
    """Raise Unclear for 'the south side of the rack': nobody can drive in it."""
    if isinstance(thing.one, Half) and all_objects(thing):
        raise Unclear('the side of what nobody can enter')


def single(things: Things) -> Selection:
    """Return the only thing. Raises Unclear where there are several."""
    if len(things) != 1:
        raise Unclear('several things where one is expected')
    return things[0]

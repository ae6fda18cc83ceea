# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Places told by where they lie: 'the room in the top left', 'the vertical wall'."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import Place

from llm_astar_planner.instructions.grammar.lexemes import axis_box
from llm_astar_planner.instructions.grammar.lexicon import Group, common_tag, sides_in
from llm_astar_planner.instructions.regions import AnyOf, Box, Half, NamedPlace, Region, Tagged

NORTH, SOUTH, EAST, WEST = 'north', 'south', 'east', 'west'
OPPOSITE = {NORTH: SOUTH, SOUTH: NORTH, EAST: WEST, WEST: EAST, 'left': 'right', 'right': 'left'}
# How much farther to the wanted side the meant place must lie than any other, as a share of the
# extent of all that could be meant.
CLEARLY = 0.08
# Metres. Places that differ by less lie side by side.
LEAST_SPAN = 0.25
# Places lie in a row that is so many times longer than wide, as a share.
ROW = 0.2
# A wall is vertical or horizontal if it is so many times longer than wide.
ELONGATED = 1.5
# On a map as it is drawn.
DRAWN = {'left': WEST, 'right': EAST}
WALL = 'wall'


def towards(place: Place, side: str) -> float:
    """Return how far to a compass side the middle of a place lies, metres."""
    centre = place.geometry.centroid
    along = float(centre.y if side in (NORTH, SOUTH) else centre.x)
    return along if side in (NORTH, EAST) else -along


def extreme(places: Sequence[Place], sides: Sequence[str]) -> tuple[Place, ...]:
    """Return the one place that lies farthest to all the sides, or those that may be meant.

    For a corner, ('north', 'west'), the distances are in shares of the extent.
    """
    spans = {side: span(places, side) for side in sides if span(places, side) > LEAST_SPAN}
    if not spans:
        return tuple(places)
    best = clearly_first(
        places, lambda place: sum(towards(place, side) / spans[side] for side in spans)
    )
    if len(best) > 1 or all(towards(best[0], side) > middle(places, side) for side in spans):
        return best
    return tuple(places)


def span(places: Sequence[Place], side: str) -> float:
    """Return the extent of the places' middles along an axis, metres."""
    values = [towards(place, side) for place in places]
    return max(values, default=0.0) - min(values, default=0.0)


def middle(places: Sequence[Place], side: str) -> float:
    """Return the middle of the places' middles along an axis."""
    values = [towards(place, side) for place in places]
    return sum((min(values), max(values))) / 2


def clearly_first(places: Sequence[Place], score: Callable[[Place], float]) -> tuple[Place, ...]:
    """Return the place of the highest score, with all others that are nearly as high."""
    most = max((score(place) for place in places), default=0.0)
    return tuple(place for place in places if score(place) >= most - CLEARLY)


def central(places: Sequence[Place]) -> tuple[Place, ...]:
    """Return the place in the middle of all, or those that may be meant."""
    spans = {side: span(places, side) for side in (NORTH, EAST)}
    # Of places in a row the middle one has as many on one side as on the other.
    least = max(LEAST_SPAN, ROW * max(spans.values()))
    sides = [side for side in spans if spans[side] > least]
    if len(places) < 3 or not sides or (len(sides) == 1 and len(places) % 2 == 0):
        return tuple(places)
    if len(sides) == 1:
        return counted(places, len(places) // 2 + 1, sides[0])
    middles = {side: middle(places, side) for side in sides}

    def nearness(place: Place) -> float:
        return -max(abs(towards(place, side) - middles[side]) / spans[side] for side in sides)

    return clearly_first(places, nearness)


def counted(places: Sequence[Place], number: int, side: str) -> tuple[Place, ...]:
    """Return the place of a number, counted from a side: 'the second aisle from the south'.

    Where two lie about equally far, nobody can count: all are returned.
    """
    ordered = sorted(places, key=lambda place: -towards(place, side))
    least = CLEARLY * span(places, side)
    gaps = [towards(a, side) - towards(b, side) for a, b in pairwise(ordered)]
    if number > len(ordered) or any(gap <= least for gap in gaps):
        return tuple(places)
    return (ordered[number - 1],)


def is_oriented(place: Place, orientation: str) -> bool:
    """Whether a place is long in the direction 'vertical' (along y) or 'horizontal'."""
    x0, y0, x1, y1 = place.geometry.bounds
    along, across = (y1 - y0, x1 - x0) if orientation == 'vertical' else (x1 - x0, y1 - y0)
    return bool(along >= ELONGATED * across and along > 0.0)


class Unclear(LlmAstarError):  # noqa: N818 (no error of the program: the sentence is unclear)
    """Words that may mean several things, or nothing that a clause can say."""


def unclear_if(condition: object, why: str) -> None:
    """Raise Unclear where a condition holds."""
    if condition:
        raise Unclear(why)


@dataclass(frozen=True)
class Selection:
    """What one noun phrase means.

    - `regions`: each of them is meant.
    - `together`: the same regions as one, if there is a tag for them.
    - `any_one`: one of them is meant: 'a blue room'.
    - `is_point`: a point without a radius. `is_walls`: the walls, all of them.
    - `is_positioned`: words for a position followed the noun: 'the room on the north side'.
    - `is_group`: a noun for several places; `is_all`: with 'all' or 'each'.
    - `is_limit`: one side of a line, 'x below 5', which goes with other limits.
    - `is_except`: 'except' follows it, of which beside others nobody knows what it is from.
    - `refused`: what 'but not' takes out of it, which is not to be entered.
    """

    regions: tuple[Region, ...] = ()
    together: Region | None = None
    any_one: str = ''
    places: tuple[Place, ...] = ()
    is_point: bool = False
    is_walls: bool = False
    is_positioned: bool = False
    is_group: bool = False
    is_all: bool = False
    is_limit: bool = False
    is_except: bool = False
    refused: tuple[Selection, ...] = ()

    @property
    def each(self) -> tuple[Region, ...]:
        """The regions, or the one that stands for them."""
        return self.regions if self.together is None else (self.together,)

    @property
    def one(self) -> Region:
        """The regions as one. Raises Unclear where there are several."""
        if len(self.each) != 1 and self.any_one:
            return AnyOf(self.each)
        unclear_if(len(self.each) != 1, 'several places where one is expected')
        return self.each[0]

    @property
    def place(self) -> Place:
        """The one place that is meant. Raises Unclear."""
        unclear_if(len(self.places) != 1, 'no single place')
        return self.places[0]


@dataclass(frozen=True)
class Modifier:
    """A word beside a noun: its kind and value ('SIDE', 'north')."""

    kind: str
    value: object


def select_group(group: Group, parts: Sequence[Modifier], where: Sequence[Modifier]) -> Selection:
    """Return what a noun with its adjectives and the words after it means. Raises Unclear."""
    quantity = next((part for part in parts if part.kind in ('ALL', 'ANY')), Modifier('', ''))
    if quantity.kind == 'ALL' and any(part.kind == 'ORDINAL' for part in parts):
        raise Unclear('every second one')
    tags = [str(part.value) for part in parts if part.kind == 'TAG']
    narrowing = [part for part in parts if part.kind not in ('ALL', 'ANY', 'TAG')]
    wanted = {tag.casefold() for tag in tags}
    found = [
        place
        for place in group.places
        if wanted <= {one.casefold() for one in (place.kind, *place.tags)}
    ]
    is_bare = not (tags or narrowing or where)
    if group.noun == WALL and is_bare and (group.plural or quantity.kind or not found):
        return Selection(is_walls=True, places=group.places)
    found = narrowed(group, found, narrowing, where)
    unclear_if(not found, f'there is no such place: {group.words}')
    tag = group.tag or common_tag(group, found, tags, is_told=quantity.kind != 'ANY')
    is_one = len(found) == 1 and not group.tag
    several = group.plural or quantity.kind == 'ALL'
    if not is_one and not several and quantity.kind != 'ANY':
        raise Unclear(f'{group.words} may be {" or ".join(place.name for place in found)}')
    return Selection(
        tuple(NamedPlace(place.name) for place in found),
        Tagged(tag) if tag and not is_one else None,
        str(quantity.value) if quantity.kind == 'ANY' and not is_one else '',
        tuple(found),
        is_positioned=bool(where),
        is_group=not is_one,
        is_all=quantity.kind == 'ALL',
    )


def narrowed(
    group: Group, found: list[Place], parts: Sequence[Modifier], where: Sequence[Modifier]
) -> list[Place]:
    """Return the places that lie where the words say. Raises Unclear."""
    kinds = {part.kind: str(part.value) for part in parts}
    if 'ORIENT' in kinds:
        found = [place for place in found if is_oriented(place, kinds['ORIENT'])]
    sides = [str(part.value) for part in (*parts, *where) if part.kind == 'SIDE']
    if 'ORDINAL' in kinds:
        unclear_if(len(sides) != 1, 'counted from no side')
        side = DRAWN.get(sides[0], sides[0])
        return list(counted(found, int(float(kinds['ORDINAL'])), side))
    if 'MOST' in kinds:
        return list(extreme(found, (kinds['MOST'],)))
    if any(part.kind == 'CENTER' for part in (*parts, *where)):
        return named_or(found, 'center', central(found))
    if not sides:
        return found
    unclear_if(group.noun == WALL and 'ORIENT' not in kinds, 'it may be an outer wall')
    return on_sides(found, sides)


def on_sides(found: list[Place], sides: Sequence[str]) -> list[Place]:
    """Return the place on a side, or in a corner, of all that were found. Raises Unclear."""
    compass = [DRAWN.get(side, side) for side in sides]
    axes = {side in (NORTH, SOUTH) for side in compass}
    unclear_if(len(compass) > 2 or len(axes) != len(compass), 'no corner')
    if len(compass) == 1:
        named = named_or(found, compass[0], ())
        if named:
            return named
        unclear_if(sides[0] in DRAWN, 'left and right of what')
    return list(extreme(found, compass))


def named_or(found: list[Place], side: str, otherwise: Sequence[Place]) -> list[Place]:
    """Return the only place with a side in its name, else other places."""
    named = [place for place in found if side in sides_in(place.name, *place.aliases)]
    return named if len(named) == 1 else list(otherwise)


def half_of(side: str, said: Collection[str], whole: Place | None) -> Selection:
    """Return a half of the map, of a place, or of the direct way. Raises Unclear.

    `said` are the kinds of the words for it.
    """
    is_half, is_drawn = 'HALFNOUN' in said, side in DRAWN
    if whole is not None:
        unclear_if(is_drawn and not is_half, 'the left or right side as drawn or as driven')
        return Selection((Half(DRAWN.get(side, side), whole.name),), places=(whole,))
    is_named = bool({'OFMAP', 'OFWAY'} & {*said})
    unclear_if(is_drawn and is_half and not is_named, 'the left or right half of what')
    unclear_if(not is_drawn and 'OFWAY' in said, 'the way has a left and a right side')
    return Selection((Half(DRAWN[side] if is_drawn and 'OFMAP' in said else side),))


def axis_half(side: str, axis: str, value: float) -> Box:
    """Return everything on a side of a line 'y = 22.5'. Raises Unclear for 'south of x = 3'."""
    side = DRAWN.get(side, side)
    unclear_if((axis == 'y') != (side in (NORTH, SOUTH)), f'{side} of {axis} = {value:g}')
    is_low = side in (SOUTH, WEST)
    low, high = (-math.inf, value) if is_low else (value, math.inf)
    return axis_box(axis, low, high)


def common_box(boxes: Sequence[Box]) -> Box:
    """Return the box where all boxes overlap. Raises Unclear where they do not."""
    box = Box.overlap(boxes)
    unclear_if(box.is_empty, 'an empty area')
    return box


def joint_limits(limits: Sequence[Selection]) -> list[Selection]:
    """Return the area where several limits hold, 'x above 2 and x below 5'. Raises Unclear.

    Limits of one axis that exclude each other are two areas: 'x below 2 and x above 5'.
    """
    boxes = [box for limit in limits for box in limit.regions if isinstance(box, Box)]
    try:
        return [Selection((common_box(boxes),))]
    except Unclear:
        return list(limits)

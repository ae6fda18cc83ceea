"""Regions from words: single places, groups of places, discs, boxes, halves, strips."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import Place

from llm_astar_planner.instructions.grammar.lexicon import Group, common_tag, sides_in
from llm_astar_planner.instructions.grammar.relative import (
    EAST,
    NORTH,
    SOUTH,
    WEST,
    central,
    counted,
    extreme,
    is_oriented,
)
from llm_astar_planner.instructions.specification import (
    ROUTE_SIDES,
    Box,
    Half,
    NamedPlace,
    Region,
    Tagged,
)

# On a map as it is drawn.
DRAWN = {'left': WEST, 'right': EAST}
WALL = 'wall'


class Unclear(LlmAstarError):  # noqa: N818 (no error of the program: the sentence is unclear)
    """Words that may mean several things, or nothing that a clause can say."""


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

    @property
    def one(self) -> Region:
        """The regions as one. Raises Unclear where there are several."""
        if self.together is not None:
            return self.together
        if len(self.regions) != 1:
            raise Unclear('several places where one is expected')
        return self.regions[0]

    @property
    def place(self) -> Place:
        """The one place that is meant. Raises Unclear."""
        if len(self.places) != 1:
            raise Unclear('no single place')
        return self.places[0]


@dataclass(frozen=True)
class Part:
    """A word beside a noun: its kind and value ('SIDE', 'north')."""

    kind: str
    value: object


def select_place(place: Place) -> Selection:
    """Return the selection of one place."""
    return Selection((NamedPlace(place.name),), places=(place,))


def select_group(group: Group, parts: Sequence[Part], where: Sequence[Part]) -> Selection:
    """Return what a noun with its adjectives and the words after it means. Raises Unclear."""
    quantity = next((part for part in parts if part.kind in ('ALL', 'ANY')), Part('', ''))
    if quantity.kind == 'ALL' and any(part.kind == 'ORDINAL' for part in parts):
        raise Unclear('every second one')
    tags = [str(part.value) for part in parts if part.kind == 'TAG']
    narrowing = [part for part in parts if part.kind not in ('ALL', 'ANY', 'TAG')]
    found = [place for place in group.places if all(has_tag(place, tag) for tag in tags)]
    is_bare = not (tags or narrowing or where)
    if group.noun == WALL and is_bare and (group.plural or quantity.kind or not found):
        return Selection(is_walls=True, places=group.places)
    found = narrowed(group, found, narrowing, where)
    if not found:
        raise Unclear(f'there is no such place: {group.words}')
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


def has_tag(place: Place, tag: str) -> bool:
    """Whether a place is of a kind or has a tag."""
    return tag.casefold() in {one.casefold() for one in (place.kind, *place.tags)}


def narrowed(
    group: Group, found: list[Place], parts: Sequence[Part], where: Sequence[Part]
) -> list[Place]:
    """Return the places that lie where the words say. Raises Unclear."""
    kinds = {part.kind: str(part.value) for part in parts}
    if 'ORIENT' in kinds:
        found = [place for place in found if is_oriented(place, kinds['ORIENT'])]
    sides = [str(part.value) for part in (*parts, *where) if part.kind == 'SIDE']
    if 'ORDINAL' in kinds:
        if len(sides) != 1:
            raise Unclear('counted from no side')
        side = DRAWN.get(sides[0], sides[0])
        return list(counted(found, int(float(kinds['ORDINAL'])), side))
    if 'MOST' in kinds:
        return list(extreme(found, (kinds['MOST'],)))
    if any(part.kind == 'CENTER' for part in (*parts, *where)):
        return named_or(found, 'center', central(found))
    if not sides:
        return found
    if group.noun == WALL and 'ORIENT' not in kinds:
        raise Unclear('it may be an outer wall')
    return on_sides(found, sides)


def on_sides(found: list[Place], sides: Sequence[str]) -> list[Place]:
    """Return the place on a side, or in a corner, of all that were found. Raises Unclear."""
    compass = [DRAWN.get(side, side) for side in sides]
    axes = {side in (NORTH, SOUTH) for side in compass}
    if len(compass) > 2 or len(axes) != len(compass):
        raise Unclear('no corner')
    if len(compass) == 1:
        named = named_or(found, compass[0], ())
        if named:
            return named
        if sides[0] in ROUTE_SIDES:
            raise Unclear('left and right of what')
    return list(extreme(found, compass))


def named_or(found: list[Place], side: str, otherwise: Sequence[Place]) -> list[Place]:
    """Return the only place with a side in its name, else other places."""
    named = [place for place in found if side in sides_in(place.name, *place.aliases)]
    return named if len(named) == 1 else list(otherwise)


def half_of(side: str, is_half: bool, whole: object) -> Selection:
    """Return a half of the map, of a place, or of the direct way. Raises Unclear.

    `whole` is a place, 'map', 'way' or None.
    """
    if isinstance(whole, Place):
        if side in DRAWN and not is_half:
            raise Unclear('the left or right side as drawn or as driven')
        return Selection((Half(DRAWN.get(side, side), whole.name),), places=(whole,))
    if side in DRAWN and whole == 'map':
        side = DRAWN[side]
    elif side in DRAWN and whole is None and is_half:
        raise Unclear('the left or right half of what')
    elif side not in DRAWN and whole == 'way':
        raise Unclear('the way has a left and a right side')
    return Selection((Half(side),))


def axis_half(side: str, axis: str, value: float) -> Box:
    """Return everything on a side of a line 'y = 22.5'. Raises Unclear for 'south of x = 3'."""
    side = DRAWN.get(side, side)
    if (axis == 'y') != (side in (NORTH, SOUTH)):
        raise Unclear(f'{side} of {axis} = {value:g}')
    is_low = side in (SOUTH, WEST)
    low, high = (-math.inf, value) if is_low else (value, math.inf)
    if axis == 'x':
        return Box(low, -math.inf, high, math.inf)
    return Box(-math.inf, low, math.inf, high)


def common_box(boxes: Sequence[Box]) -> Box:
    """Return the box where all boxes overlap. Raises Unclear where they do not."""
    box = Box(
        max((box.x0 for box in boxes), default=-math.inf),
        max((box.y0 for box in boxes), default=-math.inf),
        min((box.x1 for box in boxes), default=math.inf),
        min((box.y1 for box in boxes), default=math.inf),
    )
    if not (box.x0 < box.x1 and box.y0 < box.y1):
        raise Unclear('an empty area')
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


def outside(box: Box) -> Box | None:
    """Return everything outside of a box that is open on three sides, None of other boxes."""
    limits = [side for side in (box.x0, box.y0, box.x1, box.y1) if math.isfinite(side)]
    if len(limits) != 1:
        return None
    if math.isfinite(box.x0) or math.isfinite(box.y0):
        return Box(-math.inf, -math.inf, opened(box.x0), opened(box.y0))
    return Box(
        box.x1 if math.isfinite(box.x1) else -math.inf,
        box.y1 if math.isfinite(box.y1) else -math.inf,
        math.inf,
        math.inf,
    )


def opened(side: float) -> float:
    """Return a lower limit as an upper one: none stays none."""
    return side if math.isfinite(side) else math.inf

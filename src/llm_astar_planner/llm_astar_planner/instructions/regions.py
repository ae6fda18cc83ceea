# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Regions: the parts of a map that clauses are about, with their JSON form and their words.

Lengths are metres and points lie in the map's frame. Where a region lies is found twice: in
`polygons` for the search, in `verification/regions` for the check.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from llm_astar_msgs_adapter.errors import short_repr

from llm_astar_planner.instructions import fields

COMPASS = ('north', 'south', 'east', 'west')
# Of the direct way from start to goal; everything that shows them says so.
ROUTE_SIDES = ('left', 'right')
SIDES = (*COMPASS, *ROUTE_SIDES)
WALLS = 'walls'
ENDS = ('start', 'goal')
# Metres. What an instruction means where it gives no number.
AVOID_RADIUS = 1.0
VISIT_RADIUS = 0.5
ALONG_WIDTH = 1.0
# Metres. How near 'near' and 'past' are.
NEAR_WIDTH = 3.0
# An object (nobody can stand in it) is visited within this many metres.
OBJECT_REACH = 1.0
# An area is visited at least so deep, or a quarter of its width if that is less.
VISIT_DEPTH = 0.5
# Regions within one another, as in the rooms except the lab, and those that one joins.
MAX_NESTED, MAX_JOINED = 3, 16
# The field of the JSON form that tells the form; of those of several regions, looked for first.
FORMS = ('place', 'tag', 'point', 'box', 'half', 'between', 'along', 'end')
JOINS = ('any_of', 'all_of', 'except')
OPEN_SIDES = (-math.inf, -math.inf, math.inf, math.inf)


@dataclass(frozen=True)
class Region:
    """A part of the map; the subclasses are its forms."""

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        return dict(vars(self))

    def phrase(self, any_one: bool = False) -> str:
        """Return the words for it; with `any_one`, one of the places of a tag is meant."""
        raise NotImplementedError

    def from_phrase(self) -> str:
        """Return the words for what a distance is measured from."""
        return self.phrase()


@dataclass(frozen=True)
class NamedPlace(Region):
    """The region of one place: `{"place": NAME}`."""

    place: str

    def phrase(self, any_one: bool = False) -> str:  # noqa: ARG002 - as the others
        """Return its name."""
        return f'the {self.place}'


NOWHERE = NamedPlace('')


@dataclass(frozen=True)
class Tagged(Region):
    """All places of a kind or with a tag, together: `{"tag": TAG}`. A visit takes one of them."""

    tag: str

    def phrase(self, any_one: bool = False) -> str:
        """Return 'all blue places', or one of them."""
        return f'{"one of the" if any_one else "all"} {self.tag} places'


@dataclass(frozen=True)
class Disc(Region):
    """A point with a radius: `{"point": [X, Y], "radius": R}`. Radius 0 means the default."""

    x: float
    y: float
    radius: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        radius = {'radius': self.radius} if self.radius else {}
        return {'point': [self.x, self.y], **radius}

    def phrase(self, any_one: bool = False) -> str:  # noqa: ARG002 - as the others
        """Return 'the 2 m around the point 1, 2'."""
        within = f'the {metres(self.radius)} around ' if self.radius else ''
        return f'{within}the point {number(self.x)}, {number(self.y)}'

    def from_phrase(self) -> str:
        """Return the words for the disc: 'avoid the point 1, 2 by 3 m' is one of 3 m."""
        return self.phrase() if self.radius else f'the surroundings of {self.phrase()}'


@dataclass(frozen=True)
class Box(Region):
    """A box, `{"box": [X0, Y0, X1, Y1]}`; infinite sides, null in JSON, are open.

    `Box(-inf, 22.5, inf, inf)` is everything north of y = 22.5.
    """

    x0: float
    y0: float
    x1: float
    y1: float

    @classmethod
    def overlap(cls, boxes: Sequence[Box]) -> Box:
        """Return the box that lies in all boxes, of none the whole map; it may be empty."""
        x0, y0, x1, y1 = zip(OPEN_SIDES, *(box.sides for box in boxes))
        return cls(max(x0), max(y0), min(x1), min(y1))

    @property
    def sides(self) -> tuple[float, float, float, float]:
        """All four."""
        return self.x0, self.y0, self.x1, self.y1

    @property
    def is_empty(self) -> bool:
        """Whether nothing lies in it."""
        return self.x0 >= self.x1 or self.y0 >= self.y1

    @property
    def outside(self) -> Box | None:
        """Everything outside of it if it is open on three sides, None of other boxes."""
        finite = [number for number, side in enumerate(self.sides) if math.isfinite(side)]
        if len(finite) != 1:
            return None
        beyond = [*OPEN_SIDES]
        beyond[finite[0] - 2] = self.sides[finite[0]]
        return Box(*beyond)

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {'box': [side if math.isfinite(side) else None for side in self.sides]}

    def phrase(self, any_one: bool = False) -> str:  # noqa: ARG002 - as the others
        """Return 'the area with x from 2 to 5 and y above 3'."""
        ranges = []
        for axis, low, high in (('x', self.x0, self.x1), ('y', self.y0, self.y1)):
            if math.isfinite(low) and math.isfinite(high):
                ranges.append(f'{axis} from {number(low)} to {number(high)}')
            elif math.isfinite(low):
                ranges.append(f'{axis} above {number(low)}')
            elif math.isfinite(high):
                ranges.append(f'{axis} below {number(high)}')
        return f'the area with {" and ".join(ranges)}' if ranges else 'the whole map'


@dataclass(frozen=True)
class Half(Region):
    """A half of the map, or of the place `of`: `{"half": "north", "of": NAME}`.

    The halves are of equal width. Of the map, `left` and `right` are the sides of the straight
    line from start to goal, seen in the direction of travel.
    """

    side: str
    of: str = ''

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {'half': self.side, **({'of': self.of} if self.of else {})}

    def phrase(self, any_one: bool = False) -> str:  # noqa: ARG002 - as the others
        """Return 'the north half of the lab'."""
        if self.of:
            return f'the {self.side} half of the {self.of}'
        if self.side in ROUTE_SIDES:
            return f'the {self.side} side of the direct way'
        return f'the {self.side} half'


@dataclass(frozen=True)
class Between(Region):
    """The gap between two places, their convex hull without them: `{"between": [A, B]}`."""

    first: str
    second: str

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {'between': [self.first, self.second]}

    def phrase(self, any_one: bool = False) -> str:  # noqa: ARG002 - as the others
        """Return 'the gap between the lab and the dock'."""
        return f'the gap between the {self.first} and the {self.second}'


@dataclass(frozen=True)
class Along(Region):
    """A strip around a place, or around all walls: `{"along": NAME or "walls", "width": W}`."""

    place: str
    width: float = ALONG_WIDTH

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {'along': self.place, 'width': self.width}

    def phrase(self, any_one: bool = False) -> str:  # noqa: ARG002 - as the others
        """Return 'the 1 m along the walls'."""
        name = 'the walls' if self.place == WALLS else f'the {self.place}'
        return f'the {metres(self.width)} along {name}'


@dataclass(frozen=True)
class AnyOf(Region):
    """Regions joined: `{"any_of": [...]}`. A visit takes one of them."""

    regions: tuple[Region, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {'any_of': [region.to_json() for region in self.regions]}

    def phrase(self, any_one: bool = False) -> str:
        """Return 'either the lab or the dock', or 'the area (the lab or the dock)'."""
        words = ' or '.join(bracketed(region, any_one) for region in self.regions)
        return f'either {words}' if any_one else f'the area ({words})'


@dataclass(frozen=True)
class AllOf(Region):
    """What regions have in common: `{"all_of": [...]}`."""

    regions: tuple[Region, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {'all_of': [region.to_json() for region in self.regions]}

    def phrase(self, any_one: bool = False) -> str:  # noqa: ARG002 - as the others
        """Return 'the overlap (the hall and the north half)'."""
        return f'the overlap ({" and ".join(bracketed(region) for region in self.regions)})'


@dataclass(frozen=True)
class Except(Region):
    """A region without others: `{"region": R, "except": [...]}`."""

    region: Region
    others: tuple[Region, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the JSON form."""
        others = [region.to_json() for region in self.others]
        return {'region': self.region.to_json(), 'except': others}

    def phrase(self, any_one: bool = False) -> str:
        """Return 'all room places except the lab'."""
        return f'{bracketed(self.region, any_one)} except {self.others_phrase}'

    def from_phrase(self) -> str:
        """Return the words for it where a point is a disc of no radius."""
        region = self.region
        words = region.from_phrase() if isinstance(region, Disc) else bracketed(region)
        return f'{words} except {self.others_phrase}'

    @property
    def others_phrase(self) -> str:
        """The words for what it is without."""
        return ' and '.join(bracketed(region) for region in self.others)


@dataclass(frozen=True)
class End(Region):
    """The start or the goal of the request: `{"end": "start"}`."""

    end: str

    def phrase(self, any_one: bool = False) -> str:  # noqa: ARG002 - as the others
        """Return 'the start'."""
        return f'the {self.end}'


def bracketed(region: Region, any_one: bool = False) -> str:
    """Return the words for a region among others: in brackets if it is put together of several."""
    phrase = region.phrase(any_one)
    return f'({phrase})' if isinstance(region, (AnyOf, AllOf, Except)) else phrase


def refused_phrase(region: Region) -> str:
    """Return the words after 'do not enter', where 'either A or B' would be both of them."""
    return region.phrase(any_one=not isinstance(region, AnyOf))


def leaves(region: Region) -> tuple[Region, ...]:
    """Return the regions that a region is put together from, itself if it is simple."""
    match region:
        case AnyOf(regions) | AllOf(regions):
            return tuple(leaf for part in regions for leaf in leaves(part))
        case Except(inner, others):
            return tuple(leaf for part in (inner, *others) for leaf in leaves(part))
    return (region,)


def region_from_json(value: object, where: str, nested: int = 0) -> Region:
    """Read a region; `where` names it in errors. Raises SpecificationError.

    A text is the name of a place and a list of two numbers a point, as models write them.
    """
    if isinstance(value, str):
        return NamedPlace(fields.as_text(value, where))
    values = {'point': value} if isinstance(value, list) else fields.as_mapping(value, where)
    form = next((form for form in (*JOINS, *FORMS) if form in values), '')
    if form in JOINS and nested == MAX_NESTED:
        raise fields.SpecificationError(f'{where}: regions within regions, over {MAX_NESTED} deep')
    own, here = values.get(form), f'{where}: {form}'
    match form:
        case 'any_of':
            return AnyOf(joined_from_json(own, here, nested + 1))
        case 'all_of':
            return AllOf(joined_from_json(own, here, nested + 1))
        case 'except':
            inner = region_from_json(values.get('region'), f'{where}: region', nested + 1)
            return Except(inner, joined_from_json(own, here, nested + 1))
        case 'place':
            return NamedPlace(fields.as_text(own, here))
        case 'tag':
            return Tagged(fields.as_text(own, here))
        case 'point':
            x, y = fields.as_numbers(own, here, 2)
            return Disc(x, y, metres_in(values, 'radius', 0.0, where))
        case 'box':
            return box_from_json(own, here)
        case 'half':
            of = fields.as_text(values['of'], f'{where}: of') if values.get('of') else ''
            return Half(fields.as_choice(own, here, COMPASS if of else SIDES), of)
        case 'between':
            names = fields.as_list(own, here, 'places', 2)
            return Between(*(fields.as_text(name, here) for name in names))
        case 'along':
            width = metres_in(values, 'width', ALONG_WIDTH, where)
            return Along(fields.as_text(own, here), width)
        case 'end':
            return End(fields.as_choice(own, here, ENDS))
    raise fields.SpecificationError(f'{where}: has none of {", ".join((*FORMS, *JOINS))}')


def metres_in(values: fields.Fields, name: str, default: float, where: str) -> float:
    """Read a length. Raises SpecificationError."""
    return fields.as_number(values.get(name, default), f'{where}: {name}', 0.0, fields.MAX_METRES)


def joined_from_json(value: object, where: str, nested: int) -> tuple[Region, ...]:
    """Read a list of regions. Raises SpecificationError."""
    parts = fields.as_list(value, where)
    if len(parts) > MAX_JOINED:
        raise fields.SpecificationError(f'{where}: {len(parts)} regions are over {MAX_JOINED}')
    return tuple(region_from_json(part, where, nested) for part in parts)


def box_from_json(value: object, where: str) -> Box:
    """Read a box, whose open sides are null. Raises SpecificationError where it is empty."""
    sides = zip(fields.as_list(value, where, 'numbers', 4), OPEN_SIDES)
    box = Box(
        *(
            limit if side is None else fields.as_number(side, where, -fields.FAR, fields.FAR)
            for side, limit in sides
        )
    )
    if box.is_empty:
        empty = f'{short_repr(value)} is empty; give [x0, y0, x1, y1] in order'
        raise fields.SpecificationError(f'{where}: {empty}')
    return box


def metres(length: float) -> str:
    """Return a length in words: '3 m'."""
    return f'{number(length)} m'


def number(value: float) -> str:
    """Return a number to the millimetre, without an exponent and trailing zeros."""
    text = f'{value:.3f}'.rstrip('0').rstrip('.')
    return '0' if text == '-0' else text

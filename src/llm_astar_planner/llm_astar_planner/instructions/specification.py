"""The route specification: what an instruction asks of a path, as typed clauses.

Lengths are metres and points lie in the map's frame. `specification_json` has the JSON form and
its schema, `sentence` the canonical English sentence that people are shown.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from llm_astar_msgs_adapter.errors import LlmAstarError

MUST, SHOULD = 'must', 'should'
STRENGTHS = (MUST, SHOULD)
COMPASS = ('north', 'south', 'east', 'west')
# Of the direct way from start to goal; everything that shows them says so.
ROUTE_SIDES = ('left', 'right')
SIDES = (*COMPASS, *ROUTE_SIDES)
WALLS = 'walls'
MAX_CLAUSES = 16
# Regions to visit, all clauses together: the search has a layer for each set of them.
MAX_VISITS = 8
MAX_NAME_CHARS = 80
MAX_METRES = 1000.0
# Metres. What an instruction means where it gives no number.
AVOID_RADIUS = 1.0
VISIT_RADIUS = 0.5
ALONG_WIDTH = 1.0
# An object (nobody can stand in it) is visited within this many metres.
OBJECT_REACH = 1.0
# An area is visited at least so deep, or a quarter of its width if that is less.
VISIT_DEPTH = 0.5


class SpecificationError(LlmAstarError, ValueError):
    """A malformed specification; the message names the clause and the field."""


class Region:
    """A part of the map; the subclasses are its forms."""


@dataclass(frozen=True)
class NamedPlace(Region):
    """The region of one place: `{"place": NAME}`."""

    place: str


@dataclass(frozen=True)
class Tagged(Region):
    """All places of a kind or with a tag, together: `{"tag": TAG}`. A visit takes one of them."""

    tag: str


@dataclass(frozen=True)
class Disc(Region):
    """A point with a radius: `{"point": [X, Y], "radius": R}`. Radius 0 means the default."""

    x: float
    y: float
    radius: float = 0.0


@dataclass(frozen=True)
class Box(Region):
    """A box, `{"box": [X0, Y0, X1, Y1]}`; infinite sides, null in JSON, are open.

    `Box(-inf, 22.5, inf, inf)` is everything north of y = 22.5.
    """

    x0: float
    y0: float
    x1: float
    y1: float


@dataclass(frozen=True)
class Half(Region):
    """A half of the map, or of the place `of`: `{"half": "north", "of": NAME}`.

    The halves are of equal width. Of the map, `left` and `right` are the sides of the straight
    line from start to goal, seen in the direction of travel.
    """

    side: str
    of: str = ''


@dataclass(frozen=True)
class Between(Region):
    """The gap between two places, their convex hull without them: `{"between": [A, B]}`."""

    first: str
    second: str


@dataclass(frozen=True)
class Along(Region):
    """A strip around a place, or around all walls: `{"along": NAME or "walls", "width": W}`."""

    place: str
    width: float = ALONG_WIDTH


@dataclass(frozen=True)
class Clause:
    """One thing that is asked of the path.

    `strength` is `must` or `should` ("if possible"). `guessed` marks a clause with a number or a
    name that the sentence does not hold: it is never reported as satisfied.
    """

    kind: ClassVar[str] = ''
    strength: str = MUST
    guessed: bool = False


@dataclass(frozen=True)
class Avoid(Clause):
    """No part of the path lies in the region or within `margin` metres of it."""

    kind: ClassVar[str] = 'avoid'
    region: Region = NamedPlace('')
    margin: float = 0.0


@dataclass(frozen=True)
class Visit(Clause):
    """The path enters each of the regions, in any order; visit clauses follow each other in order.

    "the dock, then the lab and the kitchen" is two clauses, the second one with two regions.
    """

    kind: ClassVar[str] = 'visit'
    regions: tuple[Region, ...] = ()


@dataclass(frozen=True)
class Before(Clause):
    """The path enters `second` only after it has visited `first`; it need not enter either."""

    kind: ClassVar[str] = 'before'
    first: Region = NamedPlace('')
    second: Region = NamedPlace('')


@dataclass(frozen=True)
class StayIn(Clause):
    """The path lies in the region, as much of it as is possible."""

    kind: ClassVar[str] = 'stay_in'
    region: Region = NamedPlace('')


@dataclass(frozen=True)
class Pass(Clause):
    """The path passes the object on a side: it crosses the ray from it to that side of the map.

    It crosses neither the object nor the ray to the opposite side.
    """

    kind: ClassVar[str] = 'pass'
    region: Region = NamedPlace('')
    side: str = 'north'


@dataclass(frozen=True)
class KeepDistance(Clause):
    """The path keeps at least `metres` from a region, or from all walls where it is None."""

    kind: ClassVar[str] = 'keep_distance'
    metres: float = 0.0
    region: Region | None = None


@dataclass(frozen=True)
class EndAt(Clause):
    """The path ends in the region, at the cell that suits the other clauses best."""

    kind: ClassVar[str] = 'end_at'
    region: Region = NamedPlace('')


@dataclass(frozen=True)
class Unknown(Clause):
    """Words that were not understood; nothing is enforced and nothing is claimed of them."""

    kind: ClassVar[str] = 'unknown'
    text: str = ''


CLAUSES: dict[str, type[Clause]] = {
    kind.kind: kind for kind in (Avoid, Visit, Before, StayIn, Pass, KeepDistance, EndAt, Unknown)
}


@dataclass(frozen=True)
class Specification:
    """What an instruction asks: clauses, in the order of the sentence.

    Raises SpecificationError over more than MAX_CLAUSES clauses or MAX_VISITS regions to visit.
    """

    clauses: tuple[Clause, ...] = ()

    def __post_init__(self) -> None:
        """Check the sizes."""
        if len(self.clauses) > MAX_CLAUSES:
            raise SpecificationError(
                f'{len(self.clauses)} clauses, over the {MAX_CLAUSES} allowed'
            )
        visits = sum(len(clause.regions) for clause in self.clauses if isinstance(clause, Visit))
        if visits > MAX_VISITS:
            raise SpecificationError(f'{visits} regions to visit are over {MAX_VISITS}')

    @property
    def enforceable(self) -> tuple[Clause, ...]:
        """The clauses without the unknown ones."""
        return tuple(clause for clause in self.clauses if not isinstance(clause, Unknown))


NOTHING_ASKED = Specification()


def regions_of(clause: Clause) -> tuple[Region, ...]:
    """Return the regions of a clause."""
    if isinstance(clause, Visit):
        return clause.regions
    if isinstance(clause, Before):
        return clause.first, clause.second
    region = getattr(clause, 'region', None)
    return (region,) if isinstance(region, Region) else ()

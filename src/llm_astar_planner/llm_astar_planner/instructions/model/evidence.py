"""What in a sentence speaks for a clause: its places, numbers, directions and its kind."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.model.kinds import kind_problem
from llm_astar_planner.instructions.model.mentions import Sentence
from llm_astar_planner.instructions.model.names import Mention
from llm_astar_planner.instructions.model.structure import Structure
from llm_astar_planner.instructions.regions import (
    ALONG_WIDTH,
    ROUTE_SIDES,
    WALLS,
    Along,
    Between,
    Box,
    Disc,
    Half,
    NamedPlace,
    Region,
    Tagged,
)

# Numbers that differ by less are the same: a model may round what it converts.
TOLERANCE = 1e-3
# Words between the two numbers of a point.
POINT_GAP = 3


@dataclass
class Evidence:
    """What was found of a clause.

    - `tokens`: the words of the sentence that it accounts for.
    - `anchors`: the mentions of its regions, or of what stands for them.
    - `parts`: the anchors of each region.
    - `problems`: what does not stand in the sentence; empty for a clause that does.
    """

    tokens: set[int] = field(default_factory=set)
    anchors: list[Mention] = field(default_factory=list)
    parts: list[list[Mention]] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    def use(self, mentions: Iterable[Mention], *, anchor: bool = False) -> None:
        """Account for mentions."""
        for mention in mentions:
            self.tokens.update(mention.tokens)
            if anchor:
                self.anchors.append(mention)


class Witness:
    """Looks in one sentence for the evidence of clauses."""

    def __init__(self, structure: Structure, places: Places) -> None:
        """Take the sentence and the places it may name. `used` are words already accounted for."""
        self.structure = structure
        self.sentence: Sentence = structure.sentence
        self.places = places
        self.used: set[int] = set()

    def evidence_of(self, clause: Clause) -> Evidence:
        """Return the evidence for a clause."""
        found = Evidence()
        for region in clause.regions:
            before = len(found.anchors)
            self._region(region, found)
            found.parts.append(found.anchors[before:])
        match clause:
            case KeepDistance(metres=metres):
                if clause.region is None:
                    self._words('regions.walls', 'walls', found)
                self._number(metres, found, with_unit=True)
            case Avoid(margin=margin) if margin:
                self._number(margin, found, with_unit=True)
            case Pass(side=side):
                self._side(self._said_side(side, found), found, near=True)
        problem = kind_problem(clause, found.parts or [found.anchors], self.structure)
        if problem:
            found.problems.append(problem)
        return found

    def _region(self, region: Region, found: Evidence) -> None:
        match region:
            case NamedPlace(name):
                self._place(name, found)
            case Tagged(tag):
                self._tag(tag, found)
            case Disc():
                self._disc(region, found)
            case Box():
                self._box(region, found)
            case Half(side, of):
                if of:
                    self._place(of, found)
                self._side(side, found, anchor=not of)
            case Between(first, second):
                self._place(first, found)
                self._place(second, found)
                self._words('regions.between', 'between', found)
            case Along(place, width):
                if place == WALLS:
                    self._words('regions.walls', 'walls', found)
                else:
                    self._place(place, found)
                self._words('regions.along', 'along', found)
                if not math.isclose(width, ALONG_WIDTH):
                    self._number(width, found)

    def _take(
        self, fitting: Sequence[Mention], shown: str, found: Evidence, *, anchor: bool = False
    ) -> Mention | None:
        """Account for the first mention that no other clause has used, else for the first."""
        free = [m for m in fitting if not self.used.issuperset(m.tokens)]
        mention = next(iter(free or fitting), None)
        if mention is None:
            found.problems.append(f'no {shown} in the sentence')
        else:
            found.use([mention], anchor=anchor)
        return mention

    def _place(self, name: str, found: Evidence) -> None:
        fitting = [m for m in self.sentence.mentions if name in m.names]
        mention = self._take(fitting, repr(name), found, anchor=True)
        if mention is not None and len(mention.names) > 1 and not mention.is_plural:
            found.problems.append(f'{name!r} is one of several that may be meant')

    def _tag(self, tag: str, found: Evidence) -> None:
        names = {place.name for place in self.places.with_tag(tag)}
        fitting = [
            m
            for m in self.sentence.mentions
            if tag in m.tags or (len(m.names) > 1 and set(m.names) == names)
        ]
        self._take(fitting, repr(tag), found, anchor=True)

    def _number(self, value: float, found: Evidence, *, with_unit: bool = False) -> None:
        fitting = [m for m in self.sentence.mentions if holds(m, value)]
        predicates = self.structure.predicates_of(found.anchors)
        near = [m for m in fitting if self.structure.chunk_of(m).predicate in predicates]
        if with_unit:
            near = [m for m in near if m.has_unit] or near
        mention = self._take(near or fitting, f'{value:g}', found)
        if mention is not None and self._has_other_unit(mention, predicates, found):
            found.problems.append(f'{value:g} belongs to something else')

    def _has_other_unit(self, number: Mention, predicates: set[int], found: Evidence) -> bool:
        """Return whether another length stands nearer to the anchors than a number does."""
        home = self.structure.chunk_of(number)
        lengths = [m for m in self.sentence.mentions if m.has_unit and m is not number]
        chunks = [self.structure.chunk_of(m) for m in found.anchors]
        if any(home is chunk for chunk in chunks) or not chunks:
            return False
        near = [self.structure.chunk_of(m) for m in lengths]
        beside = any(a is b for a in near for b in chunks)
        return beside or (
            home.predicate not in predicates and any(p.predicate in predicates for p in near)
        )

    def _disc(self, disc: Disc, found: Evidence) -> None:
        """Find x and y next to each other, in this order, and the radius."""
        numbers = [m for m in self.sentence.mentions if m.numbers]
        pairs = [
            (a, b)
            for a, b in pairwise(numbers)
            if holds(a, disc.x) and holds(b, disc.y) and b.first - a.tokens[-1] <= POINT_GAP + 1
        ]
        free = [
            pair for pair in pairs if not self.used.issuperset(pair[0].tokens + pair[1].tokens)
        ]
        pair = next(iter(free or pairs), None)
        if pair is None:
            found.problems.append(f'no point {disc.x:g}, {disc.y:g} in the sentence')
            return
        found.use(pair, anchor=True)
        if disc.radius:
            self._number(disc.radius, found, with_unit=True)

    def _box(self, box: Box, found: Evidence) -> None:
        """Find the limits; a half-open box also needs the word for its side."""
        limits = [side for side in (box.x0, box.y0, box.x1, box.y1) if math.isfinite(side)]
        for limit in limits:
            fitting = [m for m in self.sentence.mentions if holds(m, limit)]
            unused = [m for m in fitting if not found.tokens & set(m.tokens)]
            self._take(unused, f'{limit:g}', found, anchor=True)
        if len(limits) == 1:
            self._box_side(box, found)

    def _box_side(self, box: Box, found: Evidence) -> None:
        """Check the side of a box with one limit by 'north of', 'above', 'less than'."""
        of_x = math.isfinite(box.x0) or math.isfinite(box.x1)
        is_low = math.isfinite(box.x0) or math.isfinite(box.y0)
        above, below = (
            f'sides.{side}' for side in (('east', 'west') if of_x else ('north', 'south'))
        )
        says = [{above, 'compare.above'}, {below, 'compare.below'}]
        predicates = self.structure.predicates_of(found.anchors)
        for_it, against_it = (
            self._words_of(predicates, labels) for labels in (says if is_low else says[::-1])
        )
        if against_it or not for_it:
            found.problems.append('the sentence does not say which side of it')
        found.use(m for m in self.sentence.mentions if set(m.tokens) & for_it)

    def _words_of(self, predicates: set[int], labels: set[str]) -> set[int]:
        """Return the words of some predicates that are of one of some classes."""
        return {
            n
            for chunk in self.structure.chunks
            for n in chunk.tokens
            if chunk.predicate in predicates and labels & self.sentence.tokens[n].labels
        }

    def _side(
        self, side: str, found: Evidence, *, anchor: bool = False, near: bool = False
    ) -> None:
        fitting = [m for m in self.sentence.mentions if side in m.sides]
        predicates = self.structure.predicates_of(found.anchors)
        if near and predicates:
            fitting = [m for m in fitting if self._belongs(m, predicates)]
        self._take(fitting, repr(side), found, anchor=anchor)

    def _belongs(self, mention: Mention, predicates: set[int]) -> bool:
        """Return whether a mention is in one of some predicates, or says something of 'it'."""
        predicate = self.structure.chunk_of(mention).predicate
        places = (m for m in self.sentence.mentions if m.names or m.tags)
        own = any(self.structure.chunk_of(m).predicate == predicate for m in places)
        return predicate in predicates or (
            not own and 'pronoun' in self.structure.labels_of({predicate})
        )

    def _said_side(self, side: str, found: Evidence) -> str:
        """Return how a sentence says a side: to leave an object on the left is to pass right."""
        predicates = self.structure.predicates_of(found.anchors)
        if side not in ROUTE_SIDES or not self._words_of(predicates, {'strong.left_behind'}):
            return side
        return ROUTE_SIDES[1 - ROUTE_SIDES.index(side)]

    def _words(self, name: str, shown: str, found: Evidence) -> None:
        """Find a word of a class of the vocabulary."""
        hits = [Mention((n,)) for n, one in enumerate(self.sentence.tokens) if name in one.labels]
        self._take(hits, repr(shown), found, anchor=name == 'regions.walls')


def holds(mention: Mention, value: float) -> bool:
    """Return whether a number of the sentence is this value."""
    return any(
        math.isclose(number, value, rel_tol=TOLERANCE, abs_tol=1e-9) for number in mention.numbers
    )

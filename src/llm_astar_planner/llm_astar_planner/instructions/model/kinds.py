"""Whether the words around a region say what kind of clause it is in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.model.mentions import Sentence
from llm_astar_planner.instructions.model.names import Mention, orientation
from llm_astar_planner.instructions.model.structure import Polarity, Structure
from llm_astar_planner.instructions.regions import (
    ROUTE_SIDES,
    Along,
    Between,
    Box,
    Half,
    NamedPlace,
    Region,
)

Parts = Sequence[Sequence[Mention]]


class Said(NamedTuple):
    """What a sentence says around the regions of a clause.

    `polarity` is that of all of them, `labels` are the classes of the words beside them.
    """

    clause: Clause
    polarity: Polarity
    labels: set[str]
    sentence: Sentence

    def is_about(self, *forms: type[Region]) -> bool:
        """Tell whether a region of the clause is of one of some forms."""
        return any(isinstance(region, forms) for region in self.clause.regions)

    @property
    def is_long(self) -> bool:
        """Whether a place of it is long and narrow: taking an aisle is staying in it."""
        regions = self.clause.regions
        names = [region.place for region in regions if isinstance(region, NamedPlace)]
        found = [self.sentence.places.get(name) for name in names]
        return any(place is not None and orientation(place) for place in found)


def kind_problem(clause: Clause, parts: Parts, structure: Structure) -> str | None:
    """Return why the sentence does not say this kind of clause of its regions, None if it does.

    `parts` are the mentions of each region.
    """
    anchors = [mention for part in parts for mention in part]
    if not anchors:
        return None
    if isinstance(clause, Before):
        return before_problem(parts, structure)
    labels = structure.labels_of(structure.predicates_of(anchors))
    said = Said(clause, polarity(anchors, structure), labels, structure.sentence)
    check = PROBLEMS.get(type(clause))
    return 'no rule tells that it says so' if check is None else check(said)


def polarity(anchors: Sequence[Mention], structure: Structure) -> Polarity:
    """Return the polarity that all mentions share, UNCLEAR if they differ."""
    found = {structure.polarity_of(mention) for mention in anchors}
    return found.pop() if len(found) == 1 else Polarity.UNCLEAR


def avoid_problem(said: Said) -> str | None:
    """Check that an avoided region is refused: not, avoid, never; 'do not leave' is another."""
    around = 'strong.around' in said.labels and said.polarity is Polarity.WANTED
    around = around and 'strong.way' not in said.labels and not said.sentence.sides
    if said.polarity is not Polarity.REFUSED and not around:
        return 'nothing refuses it'
    if 'leave' in said.labels and 'shun' not in said.labels:
        return 'not leaving is no avoiding'
    return None


def visit_problem(said: Said) -> str | None:
    """Check that a visited region is wanted, and that it is not one to stay or end in."""
    if said.polarity is not Polarity.WANTED:
        return 'it is refused, or may be'
    if 'strong.finish' in said.labels:
        return 'it may be one to end in'
    if may_be_to_stay_in(said):
        return 'it may be one to stay in'
    between = said.is_about(Between, Along)
    if said.labels & {'strong.before', 'strong.until'} and not between:
        return 'it may be one of before and after'
    is_said = said.labels & {'kinds.visit', 'verb', 'order'}
    return None if is_said else 'nothing says to go there'


def may_be_to_stay_in(said: Said) -> bool:
    """Return whether a region may be meant as one to stay in, not only to go through."""
    if 'strong.stay' in said.labels:
        return True
    held = 'strong.stay_in' in said.labels and said.is_about(Half, Box)
    taken = 'strong.take' in said.labels and said.is_long
    return (held or taken) and 'strong.way' not in said.labels


def stay_problem(said: Said) -> str | None:
    """Check that there is a word for staying, or that the region is not to be left."""
    if said.polarity is Polarity.REFUSED:
        is_not_left = 'leave' in said.labels and 'shun' not in said.labels
        return None if is_not_left else 'it is refused'
    if said.polarity is Polarity.UNCLEAR:
        return 'it is refused, or may be'
    if 'strong.stay_in' in said.labels or ('strong.take' in said.labels and said.is_long):
        return None
    return 'nothing says to stay there'


def end_problem(said: Said) -> str | None:
    """Check that the region is wanted and that there is a word for ending."""
    if said.polarity is not Polarity.WANTED:
        return 'it is refused, or may be'
    wanted = 'strong.finish' if said.is_about(Half, Box) else 'strong.end_at'
    return None if wanted in said.labels else 'nothing says to end there'


def before_problem(parts: Parts, structure: Structure) -> str | None:
    """Check that a word says which of the two is first."""
    first, second = parts
    if not first or not second:
        return 'it does not name both'
    said = is_said_first(first[0], second[0], structure)
    if said is None:
        return 'nothing says before or after'
    return None if said else 'the order is another one'


def is_said_first(first: Mention, second: Mention, structure: Structure) -> bool | None:
    """Return whether 'before', 'after' or 'until' puts one before the other.

    None where no such word stands with them. Not before, like after, goes before the first one.
    """
    both = sorted([first, second], key=lambda mention: mention.first)
    for n, token in enumerate(structure.sentence.tokens[: both[1].first]):
        follows = both[0] if n < both[0].first else both[1]
        other = both[1] if n < both[0].first else both[0]
        if 'strong.before' in token.labels:
            negated = structure.chunk_of(other).polarity is Polarity.REFUSED
            return (follows is first) if negated else (follows is second)
        if token.labels & {'strong.after', 'strong.until'}:
            return follows is first
    return None


def pass_problem(said: Said) -> str | None:
    """Check that it is passed, and on a side of its own: 'on your left' may be its right."""
    bypassed = 'shun' in said.labels and 'negator' not in said.labels
    if said.polarity is not Polarity.WANTED and not bypassed:
        return 'it is refused, or may be'
    if not said.labels & {'verb', 'kinds.pass'}:
        return 'nothing says to pass it'
    of_robot = 'strong.at_hand' in said.labels and 'strong.left_behind' not in said.labels
    if getattr(said.clause, 'side', '') in ROUTE_SIDES and of_robot:
        return 'the side may be that of the robot'
    return None


def distance_problem(said: Said) -> str | None:
    """Check that the distance is kept away from something, not within it."""
    if said.polarity is Polarity.UNCLEAR:
        return 'it is refused, or may be'
    refused = said.polarity is Polarity.REFUSED
    if 'at_most' in said.labels and not refused:
        return 'it is a greatest distance'
    return None if refused or 'apart' in said.labels else 'nothing says away from it'


PROBLEMS: dict[type[Clause], Callable[[Said], str | None]] = {
    Avoid: avoid_problem,
    Visit: visit_problem,
    StayIn: stay_problem,
    EndAt: end_problem,
    Pass: pass_problem,
    KeepDistance: distance_problem,
}

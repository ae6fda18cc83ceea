"""Whether the words around a region say what kind of clause it is in."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from llm_astar_planner.instructions import specification as spec
from llm_astar_planner.instructions.model.names import Mention, orientation
from llm_astar_planner.instructions.model.structure import Polarity, Structure

Parts = Sequence[Sequence[Mention]]


def kind_problem(clause: spec.Clause, parts: Parts, structure: Structure) -> str | None:
    """Return why the sentence does not say this kind of clause of its regions, None if it does.

    `parts` are the mentions of each region.
    """
    anchors = [mention for part in parts for mention in part]
    if not anchors:
        return None
    if isinstance(clause, spec.Before):
        return before_problem(parts, structure)
    return PROBLEMS[type(clause)](clause, anchors, structure)


def labels_around(anchors: Sequence[Mention], structure: Structure) -> set[str]:
    """Return the classes of the words in the predicates of some mentions."""
    return structure.labels_of(structure.predicates_of(anchors))


def polarity(anchors: Sequence[Mention], structure: Structure) -> Polarity:
    """Return the polarity that all mentions share, UNCLEAR if they differ."""
    found = {structure.polarity_of(mention) for mention in anchors}
    return found.pop() if len(found) == 1 else Polarity.UNCLEAR


def avoid_problem(_: spec.Clause, anchors: Sequence[Mention], structure: Structure) -> str | None:
    """Check that an avoided region is refused: not, avoid, never; 'do not leave' is another."""
    held = polarity(anchors, structure)
    labels = labels_around(anchors, structure)
    around = 'strong.around' in labels and held is Polarity.WANTED
    around = around and 'strong.way' not in labels and not structure.sentence.sides
    if held is not Polarity.REFUSED and not around:
        return 'nothing refuses it'
    if 'leave' in labels and 'shun' not in labels:
        return 'not leaving is no avoiding'
    return None


def visit_problem(
    clause: spec.Clause, anchors: Sequence[Mention], structure: Structure
) -> str | None:
    """Check that a visited region is wanted, and that it is not one to stay or end in."""
    if polarity(anchors, structure) is not Polarity.WANTED:
        return 'it is refused, or may be'
    labels = labels_around(anchors, structure)
    if 'strong.finish' in labels:
        return 'it may be one to end in'
    if may_be_to_stay_in(clause, labels, structure):
        return 'it may be one to stay in'
    between = any(
        isinstance(region, (spec.Between, spec.Along)) for region in spec.regions_of(clause)
    )
    if labels & {'strong.before', 'strong.until'} and not between:
        return 'it may be one of before and after'
    return None if labels & {'kinds.visit', 'verb', 'order'} else 'nothing says to go there'


def may_be_to_stay_in(clause: spec.Clause, labels: set[str], structure: Structure) -> bool:
    """Return whether a region may be meant as one to stay in, not only to go through."""
    if 'strong.stay' in labels:
        return True
    half = any(isinstance(region, (spec.Half, spec.Box)) for region in spec.regions_of(clause))
    held = half and 'strong.stay_in' in labels
    taken = 'strong.take' in labels and is_long(clause, structure)
    return (held or taken) and 'strong.way' not in labels


def is_long(clause: spec.Clause, structure: Structure) -> bool:
    """Return whether a clause is about a long and narrow place: taking an aisle is staying in."""
    names = [
        region.place for region in spec.regions_of(clause) if isinstance(region, spec.NamedPlace)
    ]
    found = [structure.sentence.places.get(name) for name in names]
    return any(place is not None and orientation(place) for place in found)


def stay_problem(
    clause: spec.Clause, anchors: Sequence[Mention], structure: Structure
) -> str | None:
    """Check that there is a word for staying, or that the region is not to be left."""
    held = polarity(anchors, structure)
    labels = labels_around(anchors, structure)
    if held is Polarity.REFUSED:
        return None if 'leave' in labels and 'shun' not in labels else 'it is refused'
    if held is Polarity.UNCLEAR:
        return 'it is refused, or may be'
    if 'strong.stay_in' in labels or ('strong.take' in labels and is_long(clause, structure)):
        return None
    return 'nothing says to stay there'


def end_problem(
    clause: spec.Clause, anchors: Sequence[Mention], structure: Structure
) -> str | None:
    """Check that the region is wanted and that there is a word for ending."""
    if polarity(anchors, structure) is not Polarity.WANTED:
        return 'it is refused, or may be'
    half = any(isinstance(region, (spec.Half, spec.Box)) for region in spec.regions_of(clause))
    wanted = 'strong.finish' if half else 'strong.end_at'
    if wanted not in labels_around(anchors, structure):
        return 'nothing says to end there'
    return None


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


def pass_problem(
    clause: spec.Clause, anchors: Sequence[Mention], structure: Structure
) -> str | None:
    """Check that it is passed, and on a side of its own: 'on your left' may be its right."""
    if polarity(anchors, structure) is not Polarity.WANTED and not avoided_around(
        anchors, structure
    ):
        return 'it is refused, or may be'
    labels = labels_around(anchors, structure)
    if not labels & {'verb', 'kinds.pass'}:
        return 'nothing says to pass it'
    of_robot = 'strong.at_hand' in labels and 'strong.left_behind' not in labels
    if getattr(clause, 'side', '') in spec.ROUTE_SIDES and of_robot:
        return 'the side may be that of the robot'
    return None


def avoided_around(anchors: Sequence[Mention], structure: Structure) -> bool:
    """Return whether a refusal is 'bypass': going around, on a side."""
    labels = labels_around(anchors, structure)
    return 'shun' in labels and 'negator' not in labels


def distance_problem(
    _: spec.Clause, anchors: Sequence[Mention], structure: Structure
) -> str | None:
    """Check that the distance is kept away from something, not within it."""
    labels = labels_around(anchors, structure)
    held = polarity(anchors, structure)
    if held is Polarity.UNCLEAR:
        return 'it is refused, or may be'
    refused = held is Polarity.REFUSED
    if 'at_most' in labels and not refused:
        return 'it is a greatest distance'
    if not refused and 'apart' not in labels:
        return 'nothing says away from it'
    return None


PROBLEMS: dict[
    type[spec.Clause], Callable[[spec.Clause, Sequence[Mention], Structure], str | None]
] = {
    spec.Avoid: avoid_problem,
    spec.Visit: visit_problem,
    spec.StayIn: stay_problem,
    spec.EndAt: end_problem,
    spec.Pass: pass_problem,
    spec.KeepDistance: distance_problem,
}

"""Holds a model's clauses against the sentence, word by word and without any model.

A clause stands in the sentence if the sentence names its places, holds its numbers and
directions, and says its kind: what is refused is not visited, and what is not refused is not
avoided. A clause without words of its own is dropped, one with words of which something does not
fit is `guessed`: enforced, but never claimed. What the sentence says and no clause accounts for
is `Unknown`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import MUST, SHOULD, Clause
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.fields import MAX_METRES
from llm_astar_planner.instructions.model.coverage import says_of_route, unread_parts
from llm_astar_planner.instructions.model.evidence import Evidence, Witness, holds
from llm_astar_planner.instructions.model.kinds import is_said_first, polarity
from llm_astar_planner.instructions.model.mentions import Sentence, read_sentence
from llm_astar_planner.instructions.model.names import Mention
from llm_astar_planner.instructions.model.structure import Polarity, Structure
from llm_astar_planner.instructions.regions import (
    ALONG_WIDTH,
    COMPASS,
    ROUTE_SIDES,
    SIDES,
    Along,
    Disc,
    Half,
    NamedPlace,
    Region,
)
from llm_astar_planner.instructions.specification import (
    GUESSED,
    MAX_CLAUSES,
    MAX_VISITS,
    Specification,
)

Weighed = list[tuple[Clause, Evidence]]


def repaired(clause: Clause, witness: Witness) -> tuple[Clause, Evidence] | None:
    """Return the only variant of a clause that stands by words that no other clause uses.

    One that accounts for more of the sentence goes before one that accounts for less.
    """
    found: dict[Clause, Evidence] = {}
    for variant in variants(clause, witness):
        evidence = witness.evidence_of(variant)
        if not evidence.problems and not evidence.tokens <= witness.used:
            found[variant] = evidence
    tokens = [evidence.tokens for evidence in found.values()]
    fullest = [
        (variant, evidence)
        for variant, evidence in found.items()
        if not any(evidence.tokens < other for other in tokens)
    ]
    return fullest[0] if len(fullest) == 1 else None


def turned(clause: Clause, evidence: Evidence, witness: Witness) -> Clause:
    """Return what is to be avoided for a visit of what the sentence refuses.

    It stays a guess; but a robot sent where it must not go is worse than one kept out.
    """
    if not (isinstance(clause, Visit) and evidence.problems and evidence.anchors):
        return clause
    if polarity(evidence.anchors, witness.structure) is not Polarity.REFUSED:
        return clause
    return Avoid(clause.strength, region=clause.regions[0])


def variants(clause: Clause, witness: Witness) -> Iterator[Clause]:
    """Yield the clauses of other kinds, places or sides that a clause may stand for."""
    regions = clause.regions
    if len(regions) != 1:
        return
    for region in [regions[0], *other_regions(regions[0], witness)]:
        yield from of_each_kind(clause, region, witness)


def of_each_kind(clause: Clause, region: Region, witness: Witness) -> Iterator[Clause]:
    """Yield what may be asked of a region."""
    strength = clause.strength
    yield Avoid(strength, region=region)
    yield Visit(strength, regions=(region,))
    yield StayIn(strength, region=region)
    yield EndAt(strength, region=region)
    for metres in unused_lengths(witness):
        yield KeepDistance(strength, region=region, metres=metres)
    if isinstance(clause, Pass) or isinstance(region, Half):
        sides = witness.sentence.sides
        for side in SIDES if set(sides) & set(ROUTE_SIDES) else sides:
            yield Pass(strength, region=region, side=side)


def unused_lengths(witness: Witness) -> list[float]:
    """Return the lengths in metres that no clause uses yet."""
    unused = [m for m in witness.sentence.mentions if not witness.used.issuperset(m.tokens)]
    lengths = (m.numbers[-1] for m in unused if m.has_unit)
    return [metres for metres in dict.fromkeys(lengths) if 0.0 < metres <= MAX_METRES]


def other_regions(region: Region, witness: Witness) -> Iterator[Region]:
    """Yield what a region may stand for: the place or the side that no clause uses yet."""
    unused = [m for m in witness.sentence.mentions if not witness.used.issuperset(m.tokens)]
    named = {name for mention in unused for name in mention.names if len(mention.names) == 1}
    if isinstance(region, NamedPlace) and len(named) == 1:
        yield NamedPlace(named.pop())
    if isinstance(region, Half):
        for side in witness.sentence.sides:
            if not region.of or side in COMPASS:
                yield replace(region, side=side)


def grounded(clauses: Sequence[Clause], text: str, places: Places) -> tuple[Specification, str]:
    """Return the specification of a model's clauses, and what does not stand in the sentence.

    Clauses that do not stand are repaired only where all of the sentence is then accounted for:
    of a sentence that is read in parts, the model knows more than these checks.
    """
    structure = Structure(read_sentence(text, places))
    wanted = [usual_form(clause) for clause in clauses if not isinstance(clause, Unknown)]
    asked = said_orders(list(dict.fromkeys(wanted)), structure)
    first = checked(weigh(asked, Witness(structure, places)), structure)
    if is_sure(first[0]):
        return first
    witness = Witness(structure, places)
    second = checked(repaired_ones(weigh(asked, witness), witness), structure)
    return second if is_sure(second[0]) else first


def is_sure(specification: Specification) -> bool:
    """Return whether all of a sentence is accounted for by clauses that stand in it."""
    clauses = specification.clauses
    return not any(clause.unsure or isinstance(clause, Unknown) for clause in clauses)


def checked(weighed: Weighed, structure: Structure) -> tuple[Specification, str]:
    """Return the specification of weighed clauses and what the sentence says besides."""
    kept = without_extras(weighed)
    used = {n for _, evidence in kept for n in evidence.tokens}
    unread = unread_parts([clause for clause, _ in kept], used, structure)
    kept = without_inventions(kept, len(unread))
    used = {n for _, evidence in kept if evidence.anchors for n in evidence.tokens}
    used -= words_half_read([clause for clause, _ in kept], structure.sentence)
    unread = unread_parts([clause for clause, _ in kept], used, structure)
    if not kept and not says_of_route(structure):
        unread = []
    return assembled(joined_visits(kept, structure), unread, structure)


def usual_form(clause: Clause) -> Clause:
    """Return a clause in the form that the grammar gives: a distance from a point is a disc."""
    match clause:
        case KeepDistance(metres=metres, region=Disc(x, y, radius)):
            return Avoid(clause.strength, clause.unsure, Disc(x, y, metres + radius))
        case Avoid(region=Disc(x, y, radius), margin=margin) if margin:
            return Avoid(clause.strength, clause.unsure, Disc(x, y, radius + margin))
    return clause


def said_orders(clauses: Sequence[Clause], structure: Structure) -> list[Clause]:
    """Return the clauses with two visits as one clause where 'before' puts one first."""
    joined: list[Clause] = []
    for clause in clauses:
        order = said_order(joined[-1], clause, structure) if joined else None
        joined[-1:] = [order] if order else [*joined[-1:], clause]
    return joined


def joined_visits(weighed: Weighed, structure: Structure) -> Weighed:
    """Return the clauses with successive visits in any order, where no word says in which."""
    sentence = structure.sentence
    ordered = (sentence.has('order') or sentence.has('reverse')) and not sentence.has('any_order')
    joined: Weighed = []
    for clause, evidence in weighed:
        last, before = joined[-1] if joined else (None, Evidence())
        alike = bool(before.problems) == bool(evidence.problems)
        if isinstance(clause, Visit) and isinstance(last, Visit) and alike and not ordered:
            regions = tuple(dict.fromkeys(last.regions + clause.regions))
            joined[-1] = replace(last, regions=regions), both(before, evidence)
        else:
            joined.append((clause, evidence))
    return joined


def both(first: Evidence, second: Evidence) -> Evidence:
    """Return the evidence of two clauses that become one."""
    return Evidence(
        first.tokens | second.tokens,
        first.anchors + second.anchors,
        first.parts + second.parts,
        first.problems + second.problems,
    )


def said_order(first: Clause, second: Clause, structure: Structure) -> Before | None:
    """Return the clause of two visits between which 'before' puts the first one first."""
    if not (isinstance(first, Visit) and isinstance(second, Visit)):
        return None
    if not structure.sentence.has('strong.before') or len(first.regions) > 1:
        return None
    earlier, later = (mention_of(visit.regions[0], structure) for visit in (first, second))
    if earlier is None or later is None or not is_said_first(earlier, later, structure):
        return None
    return Before(first=first.regions[0], second=second.regions[0])


def mention_of(region: Region, structure: Structure) -> Mention | None:
    """Return the first mention of a named place, None for another region or without one."""
    if not isinstance(region, NamedPlace):
        return None
    found = (m for m in structure.sentence.mentions if region.place in m.names)
    return next(found, None)


def weigh(clauses: Sequence[Clause], witness: Witness) -> Weighed:
    """Return the clauses with their evidence; those that stand use up their words first."""
    found: dict[int, Evidence] = {}
    for n, clause in enumerate(clauses):
        evidence = witness.evidence_of(clause)
        evidence.problems += read_back_problems(clause, witness.sentence)
        if not evidence.problems:
            found[n] = evidence
            witness.used |= evidence.tokens
    for n, clause in enumerate(clauses):
        if n not in found:
            found[n] = witness.evidence_of(clause)
    for evidence in found.values():
        evidence.problems += lengths_left(evidence, witness)
    return [(turned(clause, found[n], witness), found[n]) for n, clause in enumerate(clauses)]


def repaired_ones(weighed: Weighed, witness: Witness) -> Weighed:
    """Return the clauses; one that does not stand becomes the only variant of it that does."""
    result: Weighed = []
    for clause, evidence in weighed:
        variant = repaired(clause, witness) if evidence.problems else None
        if variant is not None:
            witness.used |= variant[1].tokens
        result.append(variant or (clause, evidence))
    return result


def lengths_left(evidence: Evidence, witness: Witness) -> list[str]:
    """Return the lengths that the sentence says with a clause and that no clause holds."""
    structure = witness.structure
    predicates = structure.predicates_of(evidence.anchors)
    left = [
        mention.numbers[-1]
        for mention in witness.sentence.mentions
        if mention.has_unit
        and structure.chunk_of(mention).predicate in predicates
        and not witness.used.issuperset(mention.tokens)
    ]
    return [f'{metres:g} m is left over' for metres in left if not evidence.problems]


def read_back_problems(clause: Clause, sentence: Sentence) -> list[str]:
    """Return what the canonical sentence of a clause says and the sentence does not.

    The sentence that people are shown is read as theirs was: its places and its numbers must be
    among those of the sentence.
    """
    shown = read_sentence(clause.sentence(), sentence.places)
    names = {name for mention in sentence.mentions for name in mention.names}
    said = {mention.names[0] for mention in shown.mentions if len(mention.names) == 1}
    problems = [f'the sentence does not name {name!r}' for name in sorted(said - names)]
    numbers = [mention for mention in sentence.mentions if mention.numbers]
    strip = any(isinstance(region, Along) for region in clause.regions)
    values = [mention.numbers[0] for mention in shown.mentions if mention.numbers]
    return problems + [
        f'the sentence does not say {value:g}'
        for value in values
        if not (strip and value == ALONG_WIDTH)
        and not any(holds(mention, value) for mention in numbers)
    ]


def without_extras(weighed: Weighed) -> Weighed:
    """Return the clauses without those whose words all belong to clauses that stand.

    Of clauses that stand, one whose words are a part of another one's says nothing more.
    """
    standing = [evidence.tokens for _, evidence in weighed if not evidence.problems]
    taken = set().union(*standing)

    def is_extra(evidence: Evidence) -> bool:
        if evidence.problems:
            return bool(evidence.tokens) and evidence.tokens <= taken
        return any(evidence.tokens < other for other in standing)

    return [(clause, evidence) for clause, evidence in weighed if not is_extra(evidence)]


def words_half_read(clauses: Sequence[Clause], sentence: Sentence) -> set[int]:
    """Return the words for several places of which clauses name some and not all."""
    regions = [region for clause in clauses for region in clause.regions]
    named = {region.place for region in regions if isinstance(region, NamedPlace)}
    return {
        n
        for mention in sentence.mentions
        if mention.is_plural and 0 < len(named & set(mention.names)) < len(mention.names)
        for n in mention.tokens
    }


def without_inventions(kept: Weighed, unread: int) -> Weighed:
    """Return the clauses without those of which the sentence names nothing.

    As many stay as there are parts of the sentence that they may come from, such as a name in
    another language. A goal is never moved to a place that the sentence does not name.
    """
    left = unread
    result: Weighed = []
    for clause, evidence in kept:
        if not evidence.anchors:
            if left == 0 or isinstance(clause, EndAt):
                continue
            left -= 1
        result.append((clause, evidence))
    return result


def assembled(
    kept: Weighed, unread: Sequence[str], structure: Structure
) -> tuple[Specification, str]:
    """Return the specification, in the bounds of one, and the problems as one text."""
    clauses: list[Clause] = []
    problems: list[str] = []
    visits = 0
    for clause, evidence in kept:
        visits += len(clause.regions) if isinstance(clause, Visit) else 0
        if visits > MAX_VISITS or len(clauses) >= MAX_CLAUSES - len(unread):
            problems.append('more is asked than fits')
            break
        # 'if possible' or the like belongs to its verb.
        is_soft = 'soft' in structure.labels_of(structure.predicates_of(evidence.anchors))
        strength = SHOULD if is_soft else MUST
        clauses.append(
            replace(clause, strength=strength, unsure=GUESSED * bool(evidence.problems))
        )
        problems += [f'{clause.sentence()}: {problem}' for problem in evidence.problems[:1]]
    clauses += [Unknown(text=part) for part in unread]
    return Specification(tuple(clauses)), '; '.join(problems)

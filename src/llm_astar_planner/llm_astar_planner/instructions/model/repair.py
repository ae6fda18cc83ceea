"""What a model may have meant by a clause that does not stand in the sentence.

Small models take the right place and the wrong verb, or a place that the sentence does not name.
The same clause of another kind, with the place or the side that is left, is tried; it is taken if
it is the only one that stands in the sentence, by all checks that hold for a model's clauses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from llm_astar_planner.instructions.model.evidence import Evidence, Witness
from llm_astar_planner.instructions.model.kinds import polarity
from llm_astar_planner.instructions.model.regions import regions_of
from llm_astar_planner.instructions.model.structure import Polarity
from llm_astar_planner.instructions.specification import (
    COMPASS,
    MAX_METRES,
    ROUTE_SIDES,
    SIDES,
    Avoid,
    Clause,
    EndAt,
    Half,
    KeepDistance,
    NamedPlace,
    Pass,
    Region,
    StayIn,
    Visit,
)


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
    regions = regions_of(clause)
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
        sides = witness.reading.sides
        for side in SIDES if set(sides) & set(ROUTE_SIDES) else sides:
            yield Pass(strength, region=region, side=side)


def unused_lengths(witness: Witness) -> list[float]:
    """Return the lengths in metres that no clause uses yet."""
    unused = [m for m in witness.reading.mentions if not witness.used.issuperset(m.tokens)]
    lengths = (m.numbers[-1] for m in unused if m.has_unit)
    return [metres for metres in dict.fromkeys(lengths) if 0.0 < metres <= MAX_METRES]


def other_regions(region: Region, witness: Witness) -> Iterator[Region]:
    """Yield what a region may stand for: the place or the side that no clause uses yet."""
    unused = [m for m in witness.reading.mentions if not witness.used.issuperset(m.tokens)]
    named = {name for mention in unused for name in mention.names if len(mention.names) == 1}
    if isinstance(region, NamedPlace) and len(named) == 1:
        yield NamedPlace(named.pop())
    if isinstance(region, Half):
        for side in witness.reading.sides:
            if not region.of or side in COMPASS:
                yield replace(region, side=side)

"""Wrong answers to the suite's sentences: what a small model may make of them is not claimed.

Each wrong answer is the true specification with one clause dropped, of another kind, at another
place or on another side.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

from llm_astar_lab.instruct_bench.suite import load_suite, same_specification
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import MUST
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.interpretation import Understanding, status_of
from llm_astar_planner.instructions.model.check import grounded
from llm_astar_planner.instructions.regions import COMPASS, Half, NamedPlace
from llm_astar_planner.instructions.specification import Specification

SUITE = Path(__file__).resolve().parents[5] / 'maps' / 'instructions' / 'suite.json'
# One instruction of so many; all of them take a minute.
STEP = 6


@cache
def instructions():
    return load_suite(SUITE).instructions[::STEP]


def wrong_clauses(clause, places):
    """Clauses that ask something else than `clause`."""
    regions = clause.regions
    if isinstance(clause, Before):
        return [replace(clause, first=clause.second, second=clause.first)]
    if len(regions) != 1:
        return []
    region = regions[0]
    found = [Avoid(region=region), Visit(regions=(region,)), StayIn(region=region)]
    found.append(EndAt(region=region))
    if isinstance(region, NamedPlace):
        other = next(place.name for place in places if place.name != region.place)
        new = NamedPlace(other)
        found.append(
            Visit(regions=(new,)) if isinstance(clause, Visit) else replace(clause, region=new)
        )
    if isinstance(region, Half):
        found += [StayIn(region=replace(region, side=side)) for side in COMPASS]
    if isinstance(clause, Pass):
        found += [replace(clause, side=side) for side in COMPASS]
    return [wrong for wrong in found if wrong != clause]


def wrong_answers(truth, places):
    for n, clause in enumerate(truth):
        yield truth[:n] + truth[n + 1 :]
        for wrong in wrong_clauses(clause, places):
            yield (*truth[:n], wrong, *truth[n + 1 :])


def must(specification):
    return Specification(tuple(replace(c, strength=MUST) for c in specification.clauses))


def claimed(specification):
    guessed = any(clause.unsure for clause in specification.clauses)
    return status_of(specification) is Understanding.WHOLE and not guessed


def test_at_most_one_wrong_answer_in_a_hundred_is_claimed():
    false, tried = [], 0
    for entry in instructions():
        accepted = [must(right) for right in (entry.truth, *entry.accepted)]
        for answer in wrong_answers(entry.truth.clauses, entry.suite_map.places):
            tried += 1
            found, _ = grounded(answer, entry.text, entry.suite_map.places)
            right = same_specification(must(found), accepted, entry.suite_map)
            if claimed(found) and not right:
                false.append((entry.text, found.sentence))
    assert len(false) <= tried / 100, false


def test_most_true_answers_to_plain_sentences_are_claimed():
    plain = [entry for entry in instructions() if entry.style == 'templated' and entry.checks]
    found = [
        grounded(entry.truth.clauses, entry.text, entry.suite_map.places)[0] for entry in plain
    ]
    assert sum(map(claimed, found)) >= 0.75 * len(plain)

"""What is claimed of clauses is true of the planned path, whoever read them.

The true meanings of the free and the mutated sentences are planned with, and every clause that is
reported as kept is looked up on the path. 150 of them, or all with LLM_ASTAR_JUDGE_ALL.
"""

import json
import os
from collections import Counter

from language import free, mutations
from language.judge import Court, Driver, clause_words, say
from language.semantics import keeps_one
from llm_astar_planner.instructions.interpretation import Interpretation, Understanding
from llm_astar_planner.instructions.specification import from_json

EVERY = 1 if os.environ.get('LLM_ASTAR_JUDGE_ALL') else 4


def meanings():
    """Yield (name of the map, its world, clauses) of all true meanings, each once."""
    found = {}
    for sentence in free.sentences():
        for truth in sentence.truths:
            found[json.dumps([sentence.map, truth.clauses])] = free.worlds()[sentence.map]
    seen = set()
    for case in mutations.cases(800):
        if case.language == 'en' and case.template not in seen:
            seen.add(case.template)
            for truth in case.truths:
                found[json.dumps(['en', truth.clauses])] = case.world
    for key, world in found.items():
        name, clauses = json.loads(key)
        if clauses:
            yield name, world, clauses


def test_every_clause_that_is_reported_as_kept_is_kept_on_the_path():
    drivers, counts, wrong = {}, Counter(), []
    for index, (name, world, clauses) in enumerate(meanings()):
        if index % EVERY:
            continue
        driver = drivers.setdefault(name, Driver(world))
        court = Court(world, *((world.ends[0], world.ends[1 + index % 2])))
        specification = from_json({'version': 2, 'clauses': clauses})
        read = Interpretation('a sentence', specification, 'truth', Understanding.WHOLE)
        plan = driver.plan(read, court.start, court.goal)
        outcomes = plan.instruction.clauses
        counts['specifications'] += 1
        counts['satisfied'] += plan.instruction.satisfied is True
        if not outcomes:
            counts[plan.message] += 1
            continue
        trace = driver.trace(plan, court.start, court.goal)
        for clause, outcome in zip(clauses, outcomes):
            kept = bool(keeps_one(clause, trace)[0])
            counts[f'{clause["kind"]}: {outcome.status.value}'] += 1
            if outcome.status.value == 'kept' and not kept:
                wrong.append(f'{name}: {clause_words(clause)}: {outcome.detail}')
            elif outcome.status.value == 'not kept' and kept:
                counts[f'{clause["kind"]}: not kept, though it is'] += 1
    for line, number in sorted(counts.items()):
        say(f'{line}: {number}')
    assert not wrong, '\n'.join(wrong)

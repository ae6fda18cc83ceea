# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs the instructions of a suite: understood by a source, planned, checked, and judged."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product, starmap
from typing import NamedTuple

from llm_astar_planner.instructions import interpretation as readings
from llm_astar_planner.instructions.interpretation import Interpretation, Understanding
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus, InstructionOutcome
from llm_astar_planner.instructions.text import InstructionError, clean_instruction
from llm_astar_planner.instructions.verification.geometry import polyline
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import Plan, PlanRequest
from llm_astar_planner.search.result import Cell

from llm_astar_lab.instruct_bench import suite as suites
from llm_astar_lab.instruct_bench.checks import Check, Verdict
from llm_astar_lab.instruct_bench.suite import IMPOSSIBLE, NONE, OK, SuiteInstruction

TRUTH, NO_INSTRUCTION = 'truth', 'none'
# How an instruction that cannot be met was reported, best first.
RECOGNISED = 'recognised'
NOT_UNDERSTOOD = 'not understood'
VIOLATED = 'violated'
MISSED = 'missed'


@dataclass(frozen=True, eq=False)
class InstructionResult:
    """One instruction with one source.

    - `source`: its name. `outcome`: None of the source `none`.
    - `plan`: the plan that the checks were held against. `direct_length`: the length in metres
      without instruction; `already`: whether that path fulfils all checks.
    - `verdicts`: one a check, empty without a path.
    - `seconds`: of understanding; `planning_seconds`: of the plan.
    """

    instruction: SuiteInstruction
    source: str
    outcome: InstructionOutcome | None
    plan: Plan
    verdicts: tuple[Verdict, ...]
    direct_length: float
    already: bool
    seconds: float = 0.0
    planning_seconds: float = 0.0

    @property
    def fulfilled(self) -> bool:
        """Whether there is a path that fulfils every check."""
        return self.plan.code == 0 and all(verdict.holds for verdict in self.verdicts)

    @property
    def path_length(self) -> float:
        """The length of the plan's path in metres, NaN without one."""
        return self.plan.length * self.instruction.suite_map.grid_map.resolution

    @property
    def judged(self) -> list[tuple[Check, Verdict]]:
        """Each check with its verdict."""
        return list(zip(self.instruction.checks, self.verdicts))

    @property
    def check_lines(self) -> list[str]:
        """A line for each check: its kind, whether it holds, what was measured."""
        return [
            f'{check.kind} {"holds" if verdict.holds else "fails"} ({verdict.detail})'
            for check, verdict in self.judged
        ]

    @property
    def read(self) -> Interpretation | None:
        """What was understood; None of the source `none`."""
        return None if self.outcome is None else self.outcome.interpretation

    @property
    def sentence(self) -> str:
        """The canonical sentence of what was understood, '' of nothing."""
        return '' if self.read is None else self.read.sentence

    @property
    def unanswered(self) -> bool:
        """Whether the source gave no answer in time."""
        return self.read is not None and self.read.status is Understanding.PENDING

    @property
    def exact(self) -> bool:
        """Whether exactly the truth was understood, or what counts as the same."""
        instruction, read = self.instruction, self.read
        accepted = (instruction.truth, *instruction.accepted)
        return read is not None and suites.same_specification(
            read.specification, accepted, instruction.suite_map
        )

    @property
    def claimed(self) -> bool:
        """Whether the report says that the instruction was satisfied."""
        return self.outcome is not None and self.outcome.satisfied is True

    @property
    def false_claim(self) -> bool:
        """Whether the report says so of a path that violates it, or of what cannot be met."""
        return self.claimed and not (self.instruction.expect == OK and self.fulfilled)

    @property
    def claimed_clauses(self) -> tuple[ClauseOutcome, ...]:
        """The clauses that are reported as satisfied."""
        outcomes = () if self.outcome is None else self.outcome.clauses
        return tuple(item for item in outcomes if item.status is ClauseStatus.KEPT)

    @property
    def false_clauses(self) -> tuple[ClauseOutcome, ...]:
        """The clauses reported as satisfied of which a check fails, or where nothing was asked."""
        return tuple(item for item in self.claimed_clauses if self.is_false(item))

    @property
    def unasked_clauses(self) -> tuple[ClauseOutcome, ...]:
        """The clauses reported as satisfied that were not asked, on a path that fails a check."""
        if self.instruction.expect == NONE or self.fulfilled:
            return ()
        return tuple(item for item in self.claimed_clauses if not self.asked(item))

    def asked(self, outcome: ClauseOutcome) -> set[int]:
        """Return the indices of the truth's clauses that a clause is, or counts as."""
        instruction = self.instruction
        count, suite_map = len(instruction.truth.clauses), instruction.suite_map
        keys = set(suites.clause_keys(outcome.clause, suite_map))
        return {
            index
            for reading in (instruction.truth, *instruction.accepted)
            if len(reading.clauses) == count
            for index, clause in enumerate(reading.clauses)
            if not keys.isdisjoint(suites.clause_keys(clause, suite_map))
        }

    def is_false(self, outcome: ClauseOutcome) -> bool:
        """Tell whether a clause cannot be satisfied as reported."""
        expect, asked = self.instruction.expect, self.asked(outcome)
        if expect == NONE or not asked:
            return expect == NONE
        if len(self.instruction.truth.clauses) == 1:
            return expect == IMPOSSIBLE or not self.fulfilled
        return any(check.clause in asked and not verdict.holds for check, verdict in self.judged)

    @property
    def recognition(self) -> str:
        """How the report treats an instruction that cannot be met; '' for others.

        An impossible or contradictory one is recognised where a clause is reported as impossible
        or a note concerns the whole, an irrelevant one where the report says that it is.
        """
        expect, outcome = self.instruction.expect, self.outcome
        if expect == OK or outcome is None:
            return ''
        understanding = outcome.interpretation.status
        if expect == NONE:
            if understanding is Understanding.IRRELEVANT:
                return RECOGNISED
            silent = understanding is not Understanding.WHOLE and not self.claimed_clauses
            return NOT_UNDERSTOOD if silent else MISSED
        if self.claimed or understanding is Understanding.IRRELEVANT:
            return MISSED
        impossible = any(item.status is ClauseStatus.IMPOSSIBLE for item in outcome.clauses)
        if impossible or outcome.note:
            return RECOGNISED
        return VIOLATED if understanding is Understanding.WHOLE else NOT_UNDERSTOOD


class Source(NamedTuple):
    """Says what an instruction of a suite means; None to plan without instruction."""

    name: str
    understand: Callable[[SuiteInstruction], Interpretation | None]


def true_meaning(instruction: SuiteInstruction) -> Interpretation:
    """Return the true specification: what is measured is the planner apart from understanding."""
    truth = instruction.truth
    return Interpretation(instruction.text[:80], truth, TRUTH, readings.status_of(truth))


def interpreter_source(name: str, interpreter: readings.Interpreter, time_limit: float) -> Source:
    """Return the source that asks an interpreter, for so many seconds each time.

    Nothing is understood of a text that is too long. An interpreter that fails leaves the
    instruction unanswered, and the run goes on.
    """

    def understand(instruction: SuiteInstruction) -> Interpretation:
        try:
            text = clean_instruction(instruction.text)
        except InstructionError as error:
            return readings.not_understood(instruction.text[:80], str(error))
        try:
            return interpreter.interpret(text, instruction.suite_map.places, time_limit)
        except Exception as error:  # noqa: BLE001 - a fault to report, not to end a long run by
            failed = readings.not_understood(text, f'failed with {type(error).__name__}: {error}')
            return replace(failed, status=Understanding.PENDING)

    return Source(name, understand)


TRUE_SOURCE = Source(TRUTH, true_meaning)
# What is measured is what is met by chance.
NO_SOURCE = Source(NO_INSTRUCTION, lambda _: None)


@dataclass(frozen=True, eq=False)
class SuiteRunner:
    """Plans instructions; one planner a map and one direct plan a pair are kept, with its seconds.

    `request` is what every request has in common, such as method and time limit.
    """

    request: PlanRequest
    planners: dict[str, Planner] = field(default_factory=dict)
    direct_plans: dict[tuple[str, Cell, Cell], tuple[Plan, float]] = field(default_factory=dict)

    def run(
        self, instructions: Sequence[SuiteInstruction], sources: Sequence[Source]
    ) -> Iterator[InstructionResult]:
        """Return the results of all sources as they are made, instruction by instruction."""
        return starmap(self.run_one, product(instructions, sources))

    def run_one(self, instruction: SuiteInstruction, source: Source) -> InstructionResult:
        """Understand, plan and check one instruction."""
        direct, planning_seconds = self.direct(instruction)
        direct_length = direct.length * instruction.suite_map.grid_map.resolution
        begun = time.perf_counter()
        interpretation = source.understand(instruction)
        seconds = 0.0 if interpretation is None else time.perf_counter() - begun
        plan = direct
        if interpretation is not None:
            # A replay says how long the recorded model took.
            seconds = interpretation.seconds or seconds
            asked = readings.RouteInstruction(interpretation, instruction.suite_map.places)
            plan, planning_seconds = self.plan(instruction, asked)
        without = verdicts_of(instruction, direct, direct_length)
        return InstructionResult(
            instruction=instruction,
            source=source.name,
            outcome=plan.instruction if interpretation is not None else None,
            plan=plan,
            verdicts=verdicts_of(instruction, plan, direct_length),
            direct_length=direct_length,
            already=direct.code == 0 and all(verdict.holds for verdict in without),
            seconds=seconds,
            planning_seconds=planning_seconds,
        )

    def direct(self, instruction: SuiteInstruction) -> tuple[Plan, float]:
        """Return the plan without instruction between the same cells, and its seconds."""
        key = instruction.suite_map.name, instruction.start, instruction.goal
        if key not in self.direct_plans:
            self.direct_plans[key] = self.plan(instruction, None)
        return self.direct_plans[key]

    def plan(
        self, instruction: SuiteInstruction, asked: readings.RouteInstruction | None
    ) -> tuple[Plan, float]:
        """Plan between the instruction's start and goal; return the plan and its seconds."""
        suite_map = instruction.suite_map
        name, barriers = suite_map.name, suite_map.barrier_map
        if name not in self.planners:
            # On a barrier map by the paper's rules.
            made = Planner.for_barrier_map(barriers) if barriers else Planner(suite_map.grid_map)
            self.planners[name] = made.prepare()
        request = replace(
            self.request, start=instruction.start, goal=instruction.goal, instruction=asked
        )
        begun = time.perf_counter()
        plan = self.planners[name].plan(request)
        return plan, time.perf_counter() - begun


def verdicts_of(
    instruction: SuiteInstruction, plan: Plan, direct_length: float
) -> tuple[Verdict, ...]:
    """Return the verdict of each check on a plan's path; none without a path."""
    if plan.code != 0:
        return ()
    path = polyline(instruction.suite_map.grid_map.grid_to_world(plan.path))
    return tuple(check.measure(path, direct_length) for check in instruction.checks)

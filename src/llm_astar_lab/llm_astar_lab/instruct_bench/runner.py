"""Runs the instructions of a suite: understood by a source, planned, and checked on the path."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.instructions.interpretation import (
    InstructionError,
    Interpretation,
    Interpreter,
    RouteInstruction,
    Understanding,
    clean_instruction,
    not_understood,
    status_of,
)
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import Plan, PlanRequest
from llm_astar_planner.search.result import Cell

from llm_astar_lab.instruct_bench.checks import Verdict, path_of
from llm_astar_lab.instruct_bench.regions import SuiteMap
from llm_astar_lab.instruct_bench.results import InstructionResult
from llm_astar_lab.instruct_bench.suite import SuiteInstruction

TRUTH, NO_INSTRUCTION = 'truth', 'none'


class Source(NamedTuple):
    """Says what an instruction of a suite means; None to plan without instruction."""

    name: str
    understand: Callable[[SuiteInstruction], Interpretation | None]


def true_meaning(instruction: SuiteInstruction) -> Interpretation:
    """Return the true specification: what is measured is the planner apart from understanding."""
    truth = instruction.truth
    return Interpretation(instruction.text[:80], truth, TRUTH, status_of(truth))


def no_meaning(_: SuiteInstruction) -> None:
    """Ask for nothing: what is measured is what is met by chance."""


def interpreter_source(name: str, interpreter: Interpreter, time_limit: float) -> Source:
    """Return the source that asks an interpreter, for so many seconds each time.

    Nothing is understood of a text that is too long. An interpreter that fails leaves the
    instruction unanswered, and the run goes on.
    """

    def understand(instruction: SuiteInstruction) -> Interpretation:
        try:
            text = clean_instruction(instruction.text)
        except InstructionError as error:
            return not_understood(instruction.text[:80], str(error))
        try:
            return interpreter.interpret(text, instruction.suite_map.places, time_limit)
        except Exception as error:  # noqa: BLE001 - a fault to report, not to end a long run by
            failed = not_understood(text, f'failed with {type(error).__name__}: {error}')
            return replace(failed, status=Understanding.PENDING)

    return Source(name, understand)


TRUE_SOURCE, NO_SOURCE = Source(TRUTH, true_meaning), Source(NO_INSTRUCTION, no_meaning)


class Direct(NamedTuple):
    """The plan without instruction, its length in metres and the seconds it took."""

    plan: Plan
    length: float
    seconds: float


@dataclass(frozen=True, eq=False)
class SuiteRunner:
    """Plans instructions; one planner a map and one direct plan a pair are kept.

    `request` is what every request has in common, such as method and time limit.
    """

    request: PlanRequest
    planners: dict[str, Planner] = field(default_factory=dict)
    direct_plans: dict[tuple[str, Cell, Cell], Direct] = field(default_factory=dict)

    def run(
        self, instructions: Sequence[SuiteInstruction], sources: Sequence[Source]
    ) -> Iterator[InstructionResult]:
        """Yield the results of all sources, instruction by instruction."""
        for instruction in instructions:
            for source in sources:
                yield self.run_one(instruction, source)

    def run_one(self, instruction: SuiteInstruction, source: Source) -> InstructionResult:
        """Understand, plan and check one instruction."""
        direct = self.direct(instruction)
        begun = time.perf_counter()
        interpretation = source.understand(instruction)
        seconds = 0.0 if interpretation is None else time.perf_counter() - begun
        plan, planning_seconds = direct.plan, direct.seconds
        if interpretation is not None:
            # A replay says how long the recorded model took.
            seconds = interpretation.seconds or seconds
            asked = RouteInstruction(interpretation, instruction.suite_map.places)
            plan, planning_seconds = self.plan(instruction, asked)
        without = verdicts_of(instruction, direct.plan, direct.length)
        return InstructionResult(
            instruction=instruction,
            source=source.name,
            outcome=plan.instruction if interpretation is not None else None,
            plan=plan,
            verdicts=verdicts_of(instruction, plan, direct.length),
            direct_length=direct.length,
            already=direct.plan.code == 0 and all(verdict.holds for verdict in without),
            seconds=seconds,
            planning_seconds=planning_seconds,
        )

    def direct(self, instruction: SuiteInstruction) -> Direct:
        """Return the plan without instruction between the same cells."""
        key = instruction.suite_map.name, instruction.start, instruction.goal
        if key not in self.direct_plans:
            plan, seconds = self.plan(instruction, None)
            length = plan.length * instruction.suite_map.grid_map.resolution
            self.direct_plans[key] = Direct(plan, length, seconds)
        return self.direct_plans[key]

    def plan(
        self, instruction: SuiteInstruction, asked: RouteInstruction | None
    ) -> tuple[Plan, float]:
        """Plan between the instruction's start and goal; return the plan and its seconds."""
        suite_map = instruction.suite_map
        if suite_map.name not in self.planners:
            self.planners[suite_map.name] = planner_of(suite_map).prepare()
        request = replace(
            self.request, start=instruction.start, goal=instruction.goal, instruction=asked
        )
        begun = time.perf_counter()
        plan = self.planners[suite_map.name].plan(request)
        return plan, time.perf_counter() - begun


def planner_of(suite_map: SuiteMap) -> Planner:
    """Return a planner for a map; on a barrier map by the paper's rules."""
    if suite_map.barrier_map is not None:
        return Planner.for_barrier_map(suite_map.barrier_map)
    return Planner(
        suite_map.grid_map, CostmapConfig(occupied_threshold=suite_map.occupied_threshold)
    )


def verdicts_of(
    instruction: SuiteInstruction, plan: Plan, direct_length: float
) -> tuple[Verdict, ...]:
    """Return the verdict of each check on a plan's path; none without a path."""
    if plan.code != 0:
        return ()
    points = instruction.suite_map.grid_map.grid_to_world(plan.path)
    path = path_of(points)
    return tuple(check.measure(path, direct_length) for check in instruction.checks)

"""What became of one instruction of a suite with one source, judged by its truth and checks."""

from __future__ import annotations

from dataclasses import dataclass

from llm_astar_planner.instructions.interpretation import Understanding
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus, InstructionOutcome
from llm_astar_planner.planning.types import Plan

from llm_astar_lab.instruct_bench.checks import Verdict
from llm_astar_lab.instruct_bench.comparison import clause_keys, same_specification
from llm_astar_lab.instruct_bench.suite import IMPOSSIBLE, NONE, OK, SuiteInstruction

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
    def unanswered(self) -> bool:
        """Whether the source gave no answer in time."""
        if self.outcome is None:
            return False
        return self.outcome.interpretation.status is Understanding.PENDING

    @property
    def exact(self) -> bool:
        """Whether exactly the truth was understood, or what counts as the same."""
        if self.outcome is None:
            return False
        instruction = self.instruction
        understood = self.outcome.interpretation.specification
        accepted = (instruction.truth, *instruction.accepted)
        return same_specification(understood, accepted, instruction.suite_map)

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
        return tuple(item for item in outcomes if item.status is ClauseStatus.SATISFIED)

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
        keys = set(clause_keys(outcome.clause, suite_map))
        return {
            index
            for reading in (instruction.truth, *instruction.accepted)
            if len(reading.clauses) == count
            for index, clause in enumerate(reading.clauses)
            if not keys.isdisjoint(clause_keys(clause, suite_map))
        }

    def is_false(self, outcome: ClauseOutcome) -> bool:
        """Tell whether a clause cannot be satisfied as reported."""
        instruction, asked = self.instruction, self.asked(outcome)
        if instruction.expect == NONE or not asked:
            return instruction.expect == NONE
        if len(instruction.truth.clauses) == 1:
            return instruction.expect == IMPOSSIBLE or not self.fulfilled
        verdicts = zip(instruction.checks, self.verdicts)
        return any(check.clause in asked and not verdict.holds for check, verdict in verdicts)

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

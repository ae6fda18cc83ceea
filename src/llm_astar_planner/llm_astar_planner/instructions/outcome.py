# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What became of an instruction on a path, clause by clause."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.interpretation import Interpretation, Understanding


class ClauseStatus(Enum):
    """What became of one clause."""

    KEPT = 'kept'
    # A wish, or a demand that no path keeps: by the least that any path can.
    AS_FAR_AS_POSSIBLE = 'kept as far as possible'
    NOT_KEPT = 'not kept'
    # No path on this map satisfies it, whatever the other clauses are.
    IMPOSSIBLE = 'impossible'
    NOT_UNDERSTOOD = 'not understood'
    # It was read, but not for certain: enforced, but nothing is claimed till it is confirmed.
    UNSURE = 'unsure'
    # Understood, but nothing that a path has: a speed, a time.
    UNSUPPORTED = 'unsupported'


# What a person is told of, besides questions.
WORST_FIRST = (
    ClauseStatus.NOT_KEPT,
    ClauseStatus.IMPOSSIBLE,
    ClauseStatus.NOT_UNDERSTOOD,
    ClauseStatus.UNSUPPORTED,
    ClauseStatus.AS_FAR_AS_POSSIBLE,
)
# Metres.
ROUNDING = 1e-6
AS_FAR = ClauseStatus.AS_FAR_AS_POSSIBLE.value


@dataclass(frozen=True)
class ClauseOutcome:
    """What became of one clause, as measured on the path.

    - `measured`, `least`: metres that the path violates the clause by (inside a region, outside
      of one, short of a distance, or off a region to visit), and the least that any path can;
      NaN where nothing was measured.
    - `where`: the point (x, y) in metres where the path violates it first or most, or None.
    - `detail`: the measured fact as a short sentence.
    - `price`: the metres by which the path is longer for this clause, NaN where not measured.
    """

    clause: Clause
    status: ClauseStatus
    detail: str = ''
    measured: float = math.nan
    least: float = math.nan
    where: tuple[float, float] | None = None
    price: float = math.nan

    @property
    def words(self) -> str:
        """The status with the measured fact and the price: 'kept (0.0 m inside), costs 4.2 m'."""
        return self.status.value + (f' ({self.detail})' if self.detail else '') + self.cost

    @property
    def cost(self) -> str:
        """The price in words: ', costs 4.2 m'; '' where it was not measured."""
        return f', costs {self.price:.1f} m' if math.isfinite(self.price) else ''

    @property
    def fact(self) -> str:
        """What it asks with the measured fact, or the words that were not understood."""
        if type(self.clause) is Unknown:
            return f'"{self.clause.text}"'
        if self.status is ClauseStatus.AS_FAR_AS_POSSIBLE:
            return f'{self.clause.phrase()}, {self.detail}{self.cost}'
        return self.clause.phrase() + (f' ({self.detail})' if self.detail else '')

    def to_json(self) -> dict[str, Any]:
        """Return the form of reports and `--json`; NaN is null."""
        return {
            'clause': self.clause.sentence(),
            'kind': self.clause.kind,
            'status': self.status.value,
            'detail': self.detail,
            'measured': self.measured if math.isfinite(self.measured) else None,
            'least': self.least if math.isfinite(self.least) else None,
            'where': None if self.where is None else list(self.where),
            'price': self.price if math.isfinite(self.price) else None,
        }


@dataclass(frozen=True)
class InstructionOutcome:
    """What became of an instruction: what was understood, and each clause on the final path.

    `note` says what concerns the whole: contradictions, no path, not understood yet.
    """

    interpretation: Interpretation
    clauses: tuple[ClauseOutcome, ...] = ()
    note: str = ''

    @property
    def satisfied(self) -> bool | None:
        """True if all was understood and every clause is kept; None if nothing was asked."""
        if self.interpretation.status is Understanding.IRRELEVANT:
            return None
        understood = self.interpretation.status is Understanding.WHOLE
        done = all(outcome.status is ClauseStatus.KEPT for outcome in self.clauses)
        return understood and bool(self.clauses) and done

    def sentence(self) -> str:
        """Return one sentence for a person: 'The instruction is kept'.

        What is not kept for certain follows with the measured facts, the worst first; a question
        comes before everything else.
        """
        status = self.interpretation.status
        if self.satisfied:
            return 'The instruction is kept'
        if status is Understanding.IRRELEVANT:
            return 'The instruction asks nothing of the path'
        if not self.clauses:
            reason = self.note or self.interpretation.detail
            read = status in (Understanding.WHOLE, Understanding.PARTLY)
            verdict = 'not kept' if read else status.value
            return f'The instruction is {verdict}' + (f': {reason}' if reason else '')
        facts = self._facts()
        kept = sum(one.status is ClauseStatus.KEPT for one in self.clauses)
        question = next((one.clause.unsure for one in self.clauses if one.clause.unsure), '')
        if question:
            facts.insert(0, f'A question first: {question}')
        elif kept == len(self.clauses):
            facts.insert(0, 'What was understood is kept')
        elif kept == 0 or (len(facts) == 1 and facts[0].startswith(AS_FAR)):
            facts[0] = f'The instruction is {facts[0]}'
        else:
            verb = 'is' if kept == 1 else 'are'
            facts.insert(0, f'{kept} of {len(self.clauses)} clauses {verb} kept')
        return '; '.join([*facts, *filter(None, [self.note])])

    def _facts(self) -> list[str]:
        """Return what is not kept, by status: 'not kept: visit the lab (...)'."""
        found = {
            kind: f'{kind.value}: {"; ".join(facts)}'
            for kind in WORST_FIRST
            if (facts := [one.fact for one in self.clauses if one.status is kind])
        }
        is_whole = self.interpretation.status is Understanding.WHOLE
        if is_whole or {ClauseStatus.NOT_UNDERSTOOD, ClauseStatus.UNSUPPORTED} & {*found}:
            return [*found.values()]
        return [*found.values(), self.interpretation.status.value]

    def summary(self) -> str:
        """Return one line for the report: the status of each clause with the measured fact."""
        reading = self.interpretation
        parts = [f'{outcome.clause.sentence()}: {outcome.words}' for outcome in self.clauses]
        nothing = ': '.join(filter(None, (reading.status.value, reading.detail)))
        return '; '.join(filter(None, (*(parts or [nothing]), self.note)))

    def to_json(self) -> dict[str, Any]:
        """Return the form of reports and `--json`."""
        return {
            'summary': self.summary(),
            'sentence': self.sentence(),
            'satisfied': self.satisfied,
            'clauses': [outcome.to_json() for outcome in self.clauses],
            'note': self.note,
            'interpretation': self.interpretation.to_json(),
        }


def kept(clause: Clause, detail: str, measured: float = 0.0) -> ClauseOutcome:
    """Return the outcome of a clause that a path keeps."""
    return ClauseOutcome(clause, ClauseStatus.KEPT, detail, measured, 0.0)


def broken(
    clause: Clause,
    detail: str,
    measured: float,
    where: tuple[float, float],
    least: float = math.nan,
    *,
    impossible: bool = False,
    is_least: bool = False,
) -> ClauseOutcome:
    """Return the outcome of a clause that a path violates: impossible, or by the least, or not."""
    status = ClauseStatus.IMPOSSIBLE if impossible else ClauseStatus.NOT_KEPT
    status = ClauseStatus.AS_FAR_AS_POSSIBLE if is_least else status
    return ClauseOutcome(clause, status, detail, measured, least, where)


def as_length(metres: float) -> str:
    """Return a length as details show it: '2.3 m', and '0.004 m' where that says more."""
    decimals = 1 if metres >= 0.1 or metres <= ROUNDING else 3
    return f'{metres:.{decimals}f} m'


def as_point(point: tuple[float, float]) -> str:
    """Return a point as details show it: '4.1, 3.0'."""
    return f'{point[0]:.1f}, {point[1]:.1f}'
